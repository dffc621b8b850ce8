"""Variance soft shadow maps: penumbrae of one map against clipped areas, points that stand for parts, no leaks."""

import numpy as np
import pytest

from tests.techniques import light_model as model
from tests.techniques.test_shadows import EVERYWHERE, HEIGHT, LIGHTS, SPAN, irradiance, receivers

# RMS of the visibility over a 4 m wide strip. What remains is the technique's assumption that every part of the light
# counts the same for the receiver: a long light seen from its end, and discs that the horizon foreshortens, do not.
PENUMBRA_RMS = {
    "square": 0.015, "rectangle": 0.032, "disc": 0.025, "sphere": 0.006, "soft point": 0.006, "sun": 0.008,
}  # fmt: skip
EDGE = ((-EVERYWHERE, -EVERYWHERE), (0.0, EVERYWHERE), 1.0)


@pytest.fixture
def floor(stage):
    """A floor under one map per light and sample."""
    stage.floor()
    stage.camera_above(SPAN)
    stage.scene.candela.slot_shadow = "vssm"
    stage.scene.candela.light_probes_maps = 0.0
    stage.scene.candela.denoise_strength = 0.0
    return stage


def visibility(stage, source, samples=1, size=(64, 4), seed=0):
    return irradiance(stage, samples, size, seed).ravel() / model.irradiance(source, receivers(size))


def rms(found, expected):
    return float(np.sqrt(((found - expected) ** 2).mean()))


def expected_visibility(source, blockers, size=(64, 4)):
    points = receivers(size)
    return model.irradiance(source, points, blockers) / model.irradiance(source, points)


@pytest.mark.parametrize("name", LIGHTS)
def test_one_sample_without_blockers_is_the_whole_light(floor, name):
    kind, settings, source = LIGHTS[name]
    floor.light(kind, (0, 0, HEIGHT), **settings)
    floor.blocker((30, 30), (31, 31), 0.5)  # casts no shadow here
    assert visibility(floor, source) == pytest.approx(1.0, abs=2e-4)


def test_a_small_lamp_far_away_shows_all_of_its_light(floor):
    """The terms of its edges cancel to a hundred thousandth of each."""
    side, height = 0.01, 1000.0
    floor.light("AREA", (0, 0, height), size=side)
    floor.blocker((30, 30), (31, 31), 0.5)  # casts no shadow here
    source = model.area((0, 0, height), (side, 0, 0), (0, side, 0), 100)
    assert visibility(floor, source) == pytest.approx(1.0, abs=5e-5)


@pytest.mark.parametrize("name", LIGHTS)
def test_one_map_shows_the_penumbra_of_an_edge(floor, name):
    kind, settings, source = LIGHTS[name]
    floor.light(kind, (0, 0, HEIGHT), **settings)
    floor.blocker(*EDGE)
    expected = expected_visibility(source, [EDGE])
    found = visibility(floor, source)
    assert ((expected > 0.05) & (expected < 0.95)).sum() > 10
    assert rms(found, expected) < PENUMBRA_RMS[name]
    assert found[expected == 0].max() < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("name", ["square", "sphere", "sun"])
def test_points_that_stand_for_parts_of_the_light_leave_less_error_than_points(floor, name):
    kind, settings, source = LIGHTS[name]
    floor.light(kind, (0, 0, HEIGHT), **settings)
    floor.blocker(*EDGE)
    expected = expected_visibility(source, [EDGE])

    def errors():
        """With 16 and with 64 samples; the mean of eight seeds."""
        return [np.mean([rms(visibility(floor, source, n, seed=k), expected) for k in range(8)]) for n in (16, 64)]

    parts = errors()
    floor.scene.candela.slot_shadow = "accumulated_maps"
    floor.scene.candela.accumulated_maps_by = "MAPS"
    points = errors()
    assert parts[0] < 0.8 * points[0]
    assert parts[1] < 0.7 * points[1]
    assert parts[1] < 0.5 * parts[0]


@pytest.mark.parametrize("name", ["square", "rectangle"])
def test_sixteen_parts_that_tile_a_light_show_its_penumbra_and_all_of_its_light(floor, name):
    kind, settings, source = LIGHTS[name]
    floor.light(kind, (0, 0, HEIGHT), **settings)
    floor.blocker(*EDGE)
    expected = expected_visibility(source, [EDGE])
    found = visibility(floor, source, 16)
    assert rms(found, expected) < 0.008
    assert found[expected == 1] == pytest.approx(1.0, abs=2e-4)


@pytest.mark.parametrize("name", ["disc", "sphere", "sun"])
def test_few_samples_of_a_light_that_parts_do_not_tile_leave_no_more_error_than_one(floor, name):
    kind, settings, source = LIGHTS[name]
    floor.light(kind, (0, 0, HEIGHT), **settings)
    floor.blocker(*EDGE)
    expected = expected_visibility(source, [EDGE])
    assert rms(visibility(floor, source, 4), expected) < PENUMBRA_RMS[name]


def test_sums_over_the_widest_kernels_fit_into_their_integers(floor):
    """A penumbra of some 256 texels, with a caster close to the lamp, which the table's range is made for."""
    kind, settings, source = LIGHTS["square"]
    floor.scene.candela.vssm_texels_per_pixel = 16.0
    floor.light(kind, (0, 0, HEIGHT), **settings)
    blockers = [EDGE, ((1.2, -0.1), (1.25, 0.1), 1.8)]
    for blocker in blockers:
        floor.blocker(*blocker)
    assert rms(visibility(floor, source), expected_visibility(source, blockers)) < PENUMBRA_RMS["square"]


def test_a_low_bar_hides_the_light_whatever_else_stands_higher(floor):
    """Its shadow is closed, though it is a small part of the window in which the plate's edge is looked for."""
    kind, settings, source = LIGHTS["square"]
    floor.scene.candela.vssm_texels_per_pixel = 8.0
    floor.light(kind, (0, 0, HEIGHT), **settings)
    blockers = [((-EVERYWHERE, -EVERYWHERE), (0.0, EVERYWHERE), 1.0), ((0.15, -EVERYWHERE), (0.35, EVERYWHERE), 0.05)]
    for blocker in blockers:
        floor.blocker(*blocker)
    size = (128, 4)
    under = expected_visibility(source, blockers[1:], size) == 0
    assert under.sum() >= 16
    assert visibility(floor, source, size=size)[under].max() < 0.02


@pytest.mark.parametrize("name", ["square", "sphere", "sun"])
def test_blockers_at_two_heights_that_close_the_light_together_leak_nothing(floor, name):
    kind, settings, source = LIGHTS[name]
    floor.light(kind, (0, 0, HEIGHT), **settings)
    edges = [((-EVERYWHERE, -EVERYWHERE), (0.0, EVERYWHERE), 1.2), ((0.0, -EVERYWHERE), (EVERYWHERE, EVERYWHERE), 1.2)]
    floor.blocker(*edges[0])
    floor.blocker(edges[1][0], edges[1][1], 0.6)
    closed = expected_visibility(source, [edges[0], (edges[1][0], edges[1][1], 0.6)]) == 0
    found = visibility(floor, source)
    assert closed.sum() > 64
    assert found[closed].max() <= 0.02


def test_the_shadow_of_a_slanted_edge_is_sharp_where_it_starts(floor):
    """A wall that stands on the floor: the penumbra of its top edge grows with the height of what casts it."""
    floor.light("SUN", (0, 0, HEIGHT), (0.0, 0.7, 0.0), angle=0.3)
    floor.mesh([(-0.5, -2, 0), (-0.5, 0, 0), (-0.5, 0, 2.0), (-0.5, -2, 2.0)], [(0, 1, 2, 3)])
    share = irradiance(floor, 1, (64, 64))
    share = share / share.max()
    widths = [((share[:, x] > 0.1) & (share[:, x] < 0.9)).sum() for x in (26, 14)]  # beside the wall, and farther
    assert widths[0] < widths[1]


def test_a_ceiling_behind_an_area_light_hides_none_of_it(floor):
    """Seen from the light's middle it stands beside far receivers, but no ray from them to the light meets it."""
    low = 0.3
    floor.light("AREA", (0, 0, low), size=0.4)
    floor.blocker((-EVERYWHERE, -EVERYWHERE), (EVERYWHERE, EVERYWHERE), low + 0.01)
    source = model.area((0, 0, low), (0.4, 0, 0), (0, 0.4, 0), 100)
    assert visibility(floor, source, 1, (32, 32)) == pytest.approx(1.0, abs=5e-3)


@pytest.mark.slow
def test_a_closed_roof_lets_no_light_pass_whatever_its_distance(floor):
    for name in ("square", "sphere", "sun"):
        kind, settings, _ = LIGHTS[name]
        light = floor.light(kind, (0, 0, HEIGHT), **settings)
        for z in (0.01, 0.5, 1.4):
            roof = floor.blocker((-EVERYWHERE, -EVERYWHERE), (EVERYWHERE, EVERYWHERE), z)
            assert not irradiance(floor, 1, (24, 24)).any()
            floor.remove(roof)
        light.hide_render = True


@pytest.mark.slow
@pytest.mark.parametrize(
    ("technique", "kind", "settings", "height"),
    [
        ("vssm", "AREA", {"size": 200.0}, 2.0),
        ("cssm", "AREA", {"size": 200.0}, 2.0),
        ("vssm", "AREA", {"size": 1.0}, 1e-6),
        ("cssm", "AREA", {"size": 1.0}, 1e-6),
        ("vssm", "POINT", {"shadow_soft_size": 50.0}, 1.0),
        ("vssm", "POINT", {"shadow_soft_size": 0.5}, -1.0),
        ("vssm", "SUN", {"angle": 3.1}, 1.0),
        ("cssm", "SUN", {"angle": 3.1}, 1.0),
        ("vssm", "AREA", {"size": 1e-6}, 1e4),
        ("vssm", "AREA", {"size": 0.5}, 2e7),
        ("cssm", "AREA", {"size": 0.5}, 2e7),
    ],
    ids=str,
)  # fmt: skip
def test_lights_beyond_reason_give_finite_light_between_none_and_all(floor, technique, kind, settings, height):
    floor.scene.candela.slot_shadow = technique
    floor.light(kind, (0, 0, height), **settings)
    bars = [floor.blocker((x, -0.5), (x + 0.3, 0.5), 0.4) for x in (-1.0, 0.0, 1.0)]
    shadowed = irradiance(floor, 1, (32, 32))
    for bar in bars:
        bar.visible_shadow = False
    free = irradiance(floor, 1, (32, 32))
    assert (shadowed >= 0).all()
    assert (shadowed <= free * 1.0001 + 1e-12).all()


@pytest.mark.slow
def test_slats_over_a_deep_pit_behind_bars_are_lit_right_by_the_bounds_rule(floor):
    """Every cell of the kernel holds near blockers, the receiver, and what lies far below it."""
    floor.clear()
    candela = floor.scene.candela
    candela.slot_shadow, candela.light_probes_maps, candela.vssm_texels_per_pixel = "vssm", 0.0, 8.0
    floor.camera_above(SPAN)
    for x in np.arange(-2.0, 2.0, 0.25):
        floor.rectangle((x, -9.0), (x + 0.125, 9.0), material=floor.diffuse())
    floor.rectangle((-20.0, -20.0), (20.0, 20.0), z=-12.0, material=floor.diffuse()).visible_camera = False
    bars = [((x, -EVERYWHERE), (x + 0.06, EVERYWHERE), 1.0) for x in np.arange(-1.0, 1.0, 0.2)]
    for bar in bars:
        floor.blocker(*bar)
    kind, settings, source = LIGHTS["square"]
    floor.light(kind, (0, 0, HEIGHT), **settings)
    size = (64, 4)
    x = receivers(size)[:, 0]
    on_slats = (abs(x) < 1.0) & ((x + 2.0) % 0.25 > 0.02) & ((x + 2.0) % 0.25 < 0.105)
    expected = expected_visibility(source, bars, size)
    errors = {}
    for rule in ("BOUNDS", "MEAN"):
        candela.vssm_rule = rule
        errors[rule] = rms(visibility(floor, source, 1, size)[on_slats], expected[on_slats])
    assert errors["BOUNDS"] < 0.03
    assert errors["BOUNDS"] < 0.3 * errors["MEAN"]


@pytest.mark.parametrize("x", [-0.2, 0.0, 0.2], ids=["in front", "edge-on", "behind"])
def test_a_wall_is_lit_by_the_part_of_the_light_above_its_horizon(floor, x):
    """The light's middle stands in front of the wall, in its plane, or behind it; the block blocks none of the rest."""
    floor.light("AREA", (0, 0, HEIGHT), size=1.0)
    corners = [(a, b, c) for a in (x, x + 1.0) for b in (-0.5, 0.5) for c in (0.0, 1.0)]
    block = floor.mesh(corners, [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (1, 5, 7, 3)],
                       material=floor.diffuse())  # fmt: skip
    floor.camera((-3.0, 0.0, 0.5), (np.pi / 2, 0.0, -np.pi / 2), 0.25)
    shadowed = irradiance(floor, 1, (24, 24))[8:-4, 4:-4]
    block.visible_shadow = False
    free = irradiance(floor, 1, (24, 24))[8:-4, 4:-4]
    assert (free > 0).all()
    assert shadowed == pytest.approx(free, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("technique", ["vssm", "cssm"])
def test_maps_of_a_texel_or_few_and_lights_that_touch_what_they_light(floor, technique):
    """Finite, and never more than without blockers."""
    candela = floor.scene.candela
    candela.slot_shadow = technique
    setattr(candela, f"{technique}_texels_per_pixel", 0.125)
    floor.light("AREA", (0, 0, 0.5), size=1.0)
    blockers = [floor.blocker((-0.5, -0.5), (0.0, 0.5), z) for z in (0.5, 0.499999, 1e-6)]
    shadowed = irradiance(floor, 1, (16, 16))
    for blocker in blockers:
        blocker.visible_shadow = False
    free = irradiance(floor, 1, (16, 16))
    assert ((shadowed >= 0) & (shadowed <= free * 1.0001 + 1e-12)).all()


@pytest.mark.parametrize("technique", ["vssm", "cssm"])
def test_a_light_without_extent_casts_hard_shadows(floor, technique):
    floor.scene.candela.slot_shadow = technique
    floor.light("POINT", (0, 0, HEIGHT), shadow_soft_size=0.0)
    floor.blocker(*EDGE)
    share = irradiance(floor, 1, (64, 4)) / model.irradiance(
        model.point((0, 0, HEIGHT), 100), receivers((64, 4))
    ).reshape(4, 64)
    assert set(np.round(share, 3).ravel()) == {0.0, 1.0}
    assert floor.ledger.row(technique).counters["hard lights"] == 1


@pytest.mark.parametrize("seed", range(3))
def test_one_sample_of_a_textured_lamp_has_the_light_of_all_its_places(floor, seed):
    """A checker of places half as bright as their neighbours: its mean, whichever is drawn (.66 or 1.33 before)."""
    lamp = floor.light("AREA", (0, 0, 2), energy=10.0, size=1.0)
    lamp.data.use_nodes = True
    tree = lamp.data.node_tree
    place, checker = tree.nodes.new("ShaderNodeNewGeometry"), tree.nodes.new("ShaderNodeTexChecker")
    for name, value in {"Scale": 2.0, "Color1": (1, 1, 1, 1), "Color2": (0.5, 0.5, 0.5, 1)}.items():
        checker.inputs[name].default_value = value
    tree.links.new(place.outputs["Parametric"], checker.inputs["Vector"])
    emission = next(node for node in tree.nodes if node.type == "EMISSION")
    tree.links.new(checker.outputs["Color"], emission.inputs["Color"])
    source = model.area((0, 0, 2), (1, 0, 0), (0, 1, 0), 7.5)
    found = irradiance(floor, 1, (16, 16), seed)
    assert found.mean() == pytest.approx(model.irradiance(source, receivers((16, 16))).mean(), rel=0.02)
