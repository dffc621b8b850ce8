"""Multi-resolution radiosity: closed forms whatever the regions are, and the gather of every pixel as their measure."""

import numpy as np
import pytest

from addon.compare.passes import light_paths
from addon.compare.reference import render_passes
from addon.frame import ledger
from addon.gfx import context, images
from addon.techniques import multires_radiosity
from tests.techniques.test_instant_radiosity import corner, sphere, wall_irradiance


@pytest.fixture
def render(stage):
    """Diffuse indirect radiance of the stage, with the technique's parameters by name."""

    def render(bounces, samples=8, size=(32, 32), virtual_lights=256, **params):
        stage.scene.candela.slot_indirect = "multires_radiosity"
        for name, value in {"virtual_lights": virtual_lights, **params}.items():
            setattr(stage.scene.candela, f"multires_radiosity_{name}", value)
        images = render_passes(stage.scene, "CANDELA", samples, 0, size=size, bounces=bounces).images
        assert ledger.latest().bad_pixels == 0
        return light_paths(images)["diffuse_indirect"]

    return render


def counters():
    return next(row.counters for row in ledger.latest().rows if row.name == "multires_radiosity")


@pytest.mark.parametrize("rays", [0, 2])
def test_each_pixel_of_a_sphere_gathers_all_virtual_lights(stage, render, rays):
    """As regions of one pixel, by few rays or by none: nothing hides anything."""
    sphere(stage, stage.diffuse(0.5))
    stage.light("POINT", (0, 0, 0), energy=4 * np.pi**2, shadow_soft_size=0.0)
    light = render(1, levels=0, rays=rays)
    assert light.mean() == pytest.approx(0.25, rel=0.03)
    assert light.mean(axis=2).std() < 0.1 * light.mean()


@pytest.mark.slow
@pytest.mark.parametrize("bounces", [1, 3])
def test_a_sphere_lit_from_its_centre_follows_the_series_of_reflections(stage, render, bounces):
    """Every virtual light brings the same everywhere in a sphere, so that interpolation must not change it."""
    sphere(stage, stage.diffuse(0.5))
    stage.light("POINT", (0, 0, 0), energy=4 * np.pi**2, shadow_soft_size=0.0)
    light = render(bounces)
    assert light.mean() == pytest.approx(0.5 * (1 - 0.5**bounces), rel=0.02)
    assert light.mean(axis=2).std() < 0.06 * light.mean()


@pytest.mark.slow
def test_a_floor_in_the_sun_lights_the_wall_beside_it_by_their_form_factor(stage, render):
    stage.rectangle((0, 0), (1, 1), material=stage.diffuse(0.8))
    corners = [(0, 0, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1)]
    stage.mesh(corners, [(0, 1, 2, 3)], material=stage.diffuse(1.0))
    stage.light("SUN", energy=10.0, angle=0.0)
    camera = stage.camera((3, 0.5, 0.5), (np.pi / 2, 0, np.pi / 2))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 1.0
    irradiance = render(1, samples=32, size=(64, 64)).mean(axis=2) * np.pi
    assert irradiance.mean() == pytest.approx(8 * 0.200044, rel=0.02)
    height = (np.arange(64) + 0.5) / 64
    four_rows = irradiance[:, 28:36].reshape(16, 32).mean(axis=1)
    np.testing.assert_allclose(four_rows, wall_irradiance(height).reshape(16, 4).mean(axis=1), rtol=0.06)


@pytest.mark.parametrize("samples", [1, 4])
def test_a_translucent_wall_shows_the_light_that_falls_on_its_other_side(stage, render, samples):
    """Neighbours of one sample make up for others, whichever lobe reflects; seen from behind, as in the test above."""
    stage.rectangle((0, 0), (1, 1), material=stage.diffuse(0.8))
    corners = [(0, 0, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1)]
    stage.mesh(corners, [(0, 1, 2, 3)], material=stage.material("ShaderNodeBsdfTranslucent", Color=(1, 0.5, 0, 1)))
    stage.light("SUN", energy=10.0, angle=0.0)
    camera = stage.camera((-3, 0.5, 0.5), (np.pi / 2, 0, -np.pi / 2))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 1.0
    irradiance = render(1, samples=samples).mean(axis=(0, 1)) * np.pi
    np.testing.assert_allclose(irradiance, 8 * 0.200044 * np.array([1, 0.5, 0]), rtol=0.05)


@pytest.mark.slow
def test_regions_differ_little_from_the_gather_of_every_pixel_and_are_few(stage, render):
    """The same virtual lights, none of them traced."""
    corner(stage)
    settings = {"samples": 1, "size": (320, 240), "rays": 0}
    regions = render(2, levels=3, **settings)
    count = counters()["regions"]
    pixels = render(2, levels=0, **settings)
    assert counters()["regions"] == 320 * 240
    assert count < 320 * 240 / 4
    assert np.sqrt(((regions - pixels) ** 2).mean()) < 0.03 * pixels.mean()


@pytest.mark.slow
def test_light_that_is_not_traced_passes_walls(stage, render):
    """Each virtual light only adds where its shadow is not asked for."""
    corner(stage)
    stage.rectangle((-0.3, -0.3), (0.3, 0.3), z=0.6, material=stage.diffuse(0.2))
    traced = render(2, samples=4, rays=64)
    assert render(2, samples=4, rays=0).mean() > 1.01 * traced.mean()


@pytest.mark.slow
def test_every_size_of_picture_has_its_regions(stage, render):
    corner(stage)
    for size in ((1, 1), (7, 3), (33, 17)):
        assert np.isfinite(render(1, samples=2, size=size, levels=5)).all()


@pytest.mark.slow
def test_pictures_narrower_than_a_group_of_threads_have_their_light_in_one_sample(stage, render):
    corner(stage)
    for size in ((1, 1), (3, 40), (40, 3)):
        light = render(1, samples=1, size=size)
        assert np.isfinite(light).all() and light.mean() > 0


@pytest.mark.slow
def test_regions_without_a_list_gather_the_same(stage, render, monkeypatch):
    """What Metal does."""
    corner(stage)
    settings = {"samples": 1, "size": (61, 47), "rays": 0}
    listed = render(2, **settings)
    monkeypatch.setattr(context, "counts_in_images", lambda: False)
    stage.scene.candela.multires_radiosity_levels = 2
    render(2, **settings)  # so that the picture is not the one that was kept
    stage.scene.candela.multires_radiosity_levels = 3
    np.testing.assert_allclose(render(2, **settings), listed, rtol=1e-5, atol=1e-7)


@pytest.mark.slow
def test_a_picture_whose_atlas_is_too_large_for_an_image_gathers_every_pixel(gpu_context):
    most = min(images.most_side(), 1 << multires_radiosity.REGION_BITS)
    assert multires_radiosity.fitting_levels((most - 8, 4), 3) == 0
    assert multires_radiosity.fitting_levels((most // 2, 4), 3) == 3


@pytest.mark.slow
def test_without_near_bounces_only_what_close_surfaces_reflect_more_than_once_is_missing(stage, render):
    corner(stage, albedo=0.8)
    once = [render(1, virtual_lights=32, near_bounces=follow) for follow in (True, False)]
    np.testing.assert_array_equal(*once)
    often, less = (render(8, virtual_lights=32, near_bounces=follow).mean() for follow in (True, False))
    assert 0.85 * often < less < 0.99 * often
