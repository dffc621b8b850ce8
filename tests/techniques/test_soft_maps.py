"""What soft shadow maps share: maps are kept, lights that reach nothing have none, alpha is cast, walls are closed."""

import numpy as np
import pytest

from tests.techniques.test_shadows import EVERYWHERE, HEIGHT, irradiance
from tests.techniques.test_vssm import EDGE, floor  # noqa: F401 - a fixture

KINDS = ("vssm", "cssm")
SIZE = (24, 24)


@pytest.fixture(params=KINDS)
def lit(floor, request):  # noqa: F811
    """Under one square light, with one kind of soft shadow maps."""
    floor.kind = request.param
    floor.scene.candela.slot_shadow = floor.kind
    floor.lamp = floor.light("AREA", (0, 0, HEIGHT), size=1.0)
    return floor


def counters(stage):
    return stage.ledger.row(stage.kind).counters


@pytest.mark.slow
def test_a_light_that_only_changes_its_power_keeps_its_map(lit):
    blocker = lit.blocker(*EDGE)
    before = irradiance(lit, 1, SIZE)
    assert (counters(lit)["maps"], counters(lit).get("maps kept", 0)) == (1, 0)
    lit.lamp.data.energy *= 2
    assert irradiance(lit, 1, SIZE) == pytest.approx(2 * before, rel=1e-5)
    assert (counters(lit).get("maps", 0), counters(lit)["maps kept"]) == (0, 1)
    setattr(lit.scene.candela, f"{lit.kind}_cells", 5)
    irradiance(lit, 1, SIZE)
    assert counters(lit)["maps"] == 1
    blocker.location.x += 0.5
    moved = irradiance(lit, 1, SIZE)
    assert counters(lit)["maps"] == 1
    assert abs(moved / 2 - before).max() > 0.5 * before.max()


def test_of_light_that_is_not_refined_one_map_serves_all_samples(lit):
    setattr(lit.scene.candela, f"{lit.kind}_refine", False)
    lit.blocker(*EDGE)
    irradiance(lit, 3, SIZE)
    assert (counters(lit)["maps"], counters(lit)["maps kept"]) == (1, 2)


@pytest.mark.slow
def test_lights_that_shine_away_or_are_too_far_to_matter_have_no_map(lit):
    lit.blocker(*EDGE)
    irradiance(lit, 1, SIZE)
    lit.light("AREA", (0, 0, HEIGHT), turn=(np.pi, 0, 0), size=1.0)
    lit.light("POINT", (5e4, 0, 3.0), shadow_soft_size=0.5)
    irradiance(lit, 1, SIZE, seed=1)
    assert counters(lit)["maps"] == 1


@pytest.mark.slow
@pytest.mark.parametrize("opacity", [0.0, 0.3, 1.0])
def test_a_layer_with_alpha_lets_its_transparency_pass(lit, opacity):
    lit.blocker((30, 30), (31, 31), 0.5)
    free = irradiance(lit, 1, SIZE)
    layer = (EVERYWHERE, EVERYWHERE)
    lit.blocker((-layer[0], -layer[1]), layer, 1.0, material=lit.see_through(opacity))
    share = irradiance(lit, 1, SIZE) / free
    assert share.mean() == pytest.approx(1 - opacity, abs=0.03)
    assert share.std() < 0.06  # texels are drawn at random, and a kernel holds many


def test_a_closed_box_stays_dark_inside_whatever_stands_in_it(lit):
    """Walls that touch the floor, a light outside, and blockers at several heights inside."""
    low, high = (-1.5, -1.5), (1.5, 1.5)
    corners = [(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (0.0, 1.0)]
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (1, 5, 7, 3)]
    lit.mesh(corners, sides, material=lit.diffuse()).visible_camera = False
    for x, z in ((-0.6, 0.2), (0.3, 0.6)):
        lit.blocker((x, -0.5), (x + 0.3, 0.5), z)
    lit.lamp.location = (0.8, 0.3, HEIGHT)
    found = [irradiance(lit, 1, (32, 32), seed) for seed in range(4)]
    inside = slice(6, -6)  # of 4 m: 1.25 m around the middle
    assert np.mean([one.max() for one in found]) > 1.0
    for one in found:
        assert one[inside, inside].max() <= 1e-3 * one.max()


@pytest.mark.slow
@pytest.mark.parametrize("far", [1e3, 1e7])
def test_a_far_background_takes_nothing_from_the_shadow_of_what_is_near(lit, far):
    """Depths of the map reach from 1 to `far` metres."""
    lit.blocker(*EDGE)
    expected = irradiance(lit, 1, SIZE)
    lit.rectangle((-far, -far), (far, far), z=-far).visible_camera = False
    lit.floor(half=3.0)
    found = irradiance(lit, 1, SIZE)
    assert np.sqrt(((found - expected) ** 2).mean()) < 0.03 * expected.max()


@pytest.mark.parametrize("technique", ["vssm", "cssm"])
def test_patches_of_an_even_world_light_an_open_floor_with_all_of_it(stage, technique):
    """Each patch is a sun with a disc there: together they are the world."""
    stage.floor(material=stage.diffuse(0.5))
    stage.world((0.3, 0.6, 1.0), 2.0)
    stage.camera_above()
    stage.scene.candela.slot_shadow = technique
    shown = stage.render(32, (8, 8), bounces=0)["combined"][..., :3].mean(axis=(0, 1))  # few directions are noise
    assert shown == pytest.approx([0.3, 0.6, 1.0], rel=0.01)
