"""Mirrors and narrow lobes: what they see of lights and world, and what stands in between."""

import numpy as np
import pytest

from addon.frame.ledger import RAN
from tests.techniques.conftest import places

SPAN = 4.0


@pytest.fixture
def mirror(stage):
    """A perfect mirror on the floor, seen straight from above: every pixel sees what stands right above it."""
    stage.floor(material=stage.material("ShaderNodeBsdfGlossy", Color=(1, 1, 1, 1), Roughness=0.0))
    stage.camera_above(SPAN)
    return stage


def glossy(stage, samples=4):
    return stage.render(samples)["glossy_direct"][..., 0].astype(float)


def inside(low, high):
    """Pixels whose centre is well inside or well outside of a rectangle: (inside, outside)."""
    x, y = places((32, 32), SPAN)
    within = np.minimum(np.minimum(x - low[0], high[0] - x), np.minimum(y - low[1], high[1] - y))
    return within > 0.05, within < -0.05


def test_a_mirror_shows_an_area_light_as_bright_as_it_is(mirror):
    """Radiance S / (pi A), where the light stands above the pixel, nothing beside it."""
    mirror.light("AREA", (0.25, 0.5, 2), shape="RECTANGLE", size=1.0, size_y=0.5)
    shown, beside = inside((-0.25, 0.25), (0.75, 0.75))
    found = glossy(mirror)
    np.testing.assert_allclose(found[shown], 100 / (np.pi * 0.5), rtol=1e-4)
    assert (found[beside] == 0).all()


def test_a_mirror_shows_a_spherical_light_as_a_disc(mirror):
    mirror.light("POINT", (0, 0, 2), shadow_soft_size=0.5, use_soft_falloff=False)
    x, y = places((32, 32), SPAN)
    found = glossy(mirror)
    np.testing.assert_allclose(found[np.hypot(x, y) < 0.45], 100 / (4 * np.pi**2 * 0.25), rtol=1e-4)
    assert (found[np.hypot(x, y) > 0.55] == 0).all()


def test_a_mirror_shows_no_light_without_a_size(mirror):
    mirror.light("POINT", (0, 0, 2), shadow_soft_size=0)
    mirror.light("SUN", angle=0.0)
    assert (glossy(mirror) == 0).all()


def test_a_mirror_shows_the_sun_straight_above(mirror):
    mirror.light("SUN", angle=0.5, energy=2.0)
    np.testing.assert_allclose(glossy(mirror), 2.0 / (np.pi * np.sin(0.25) ** 2), rtol=1e-4)


def test_a_mirror_shows_the_world(mirror):
    mirror.world((0.25, 0.5, 1.0), strength=2.0)
    found = mirror.render(4)["glossy_direct"]
    np.testing.assert_allclose(found, np.broadcast_to([0.5, 1.0, 2.0], found.shape), rtol=1e-4)


@pytest.mark.parametrize("opacity", [1.0, 0.5])
def test_what_stands_between_mirror_and_light_hides_it_by_its_opacity(mirror, opacity):
    mirror.light("AREA", (0, 0, 2), size=3.5)
    mirror.blocker((-1, -1), (1, 1), 1.0, material=mirror.see_through(opacity))
    hidden, free = inside((-1, -1), (1, 1))
    x, y = places((32, 32), SPAN)
    free &= (np.abs(x) < 1.7) & (np.abs(y) < 1.7)
    found, radiance = glossy(mirror, samples=64), 100 / (np.pi * 3.5**2)
    np.testing.assert_allclose(found[free], radiance, rtol=1e-4)
    assert found[hidden].mean() == pytest.approx((1 - opacity) * radiance, abs=0.02 * radiance)


def test_an_object_hidden_from_glossy_rays_hides_nothing_from_a_mirror(mirror):
    mirror.world()
    blocker = mirror.blocker((-9, -9), (9, 9), 1.0)
    assert (glossy(mirror) == 0).all()
    blocker.visible_glossy = False
    np.testing.assert_allclose(glossy(mirror), 1.0, rtol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("roughness", [0.3, 0.5, 0.8])
def test_tracing_changes_the_noise_of_a_lobe_and_not_its_mean(stage, roughness):
    """The same light from lobe samples and light samples together, and from light samples alone."""
    stage.floor(material=stage.material("ShaderNodeBsdfGlossy", Color=(1, 1, 1, 1), Roughness=roughness))
    stage.camera_above(SPAN)
    stage.light("AREA", (0, 0, 2), size=2.0)
    settings = stage.scene.candela
    means = []
    for traced in (0.0, 1.0):
        settings.traced_glossy_roughness = traced
        means.append(glossy(stage, samples=256).mean())
    assert means[1] == pytest.approx(means[0], rel=0.02)


def test_of_more_equal_lamps_than_rays_look_for_the_same_are_left_to_points_in_any_order(stage):
    """A lamp that rays look for and points do not know of would be seen twice, or not at all the other way round."""
    places_of_lamps = np.random.default_rng(3).random((70, 2)) * 4 - 2
    pictures = []
    for order in (1, -1):
        stage.clear()
        stage.floor(material=stage.material("ShaderNodeBsdfGlossy", Color=(1, 1, 1, 1), Roughness=0.2))
        stage.camera_above(SPAN)
        for x, y in places_of_lamps[::order]:
            stage.light("POINT", (x, y, 1.5), energy=10, shadow_soft_size=0.3, use_shadow=False)
        pictures.append(glossy(stage))
    np.testing.assert_allclose(pictures[0], pictures[1], rtol=1e-3)


def test_what_has_no_material_traces_rays_where_it_is_glossy(stage):
    """As it is since Blender 5.0."""
    stage.rectangle((-20, -20), (20, 20))
    stage.world((0.5, 0.5, 0.5))
    stage.camera((0, -4, 0.6), (1.4, 0, 0))
    shines, found = (
        stage.render(64, engine=engine)["glossy_direct"][:12, :, 0].astype(float) for engine in ("CYCLES", "CANDELA")
    )
    assert (stage.ledger.row("traced_glossy").state == RAN) == shines.any()
    assert found.mean() == pytest.approx(shines.mean(), rel=0.02)


def test_one_sample_of_an_even_world_has_no_dark_pixels(stage):
    """The candidates of a pixel lie at several angles from the lobe's middle: all in its tail, where light samples have
    most of the share, they left every tenth pixel at half of its light."""
    stage.floor(material=stage.material("ShaderNodeBsdfGlossy", Roughness=0.25, Color=(1, 1, 1, 1)))
    stage.world((1, 1, 1))
    stage.camera_above(1.0)
    stage.scene.candela.use_denoise = False
    light = stage.render(1, (32, 32), bounces=1)["glossy_direct"][..., 0]
    assert light.mean() == pytest.approx(1.0, abs=0.01)
    assert light.std() < 0.2 and light.min() > 0.5
