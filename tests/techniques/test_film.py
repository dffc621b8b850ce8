"""What needs no light: depth, normals, emission, colours, coverage, the render border; and lights that are seen."""

import numpy as np
import pytest

from tests.techniques.conftest import places

SPAN = 4.0


def emission(stage, strength, color=(1, 1, 1)):
    return stage.material("ShaderNodeEmission", Color=(*color, 1), Strength=strength)


def test_depth_is_measured_along_the_cameras_axis(stage):
    """Cycles' Depth is planar: a wall across the view has one depth, also at the rim of a wide picture."""
    stage.rectangle((-50, -50), (50, 50), 0.0)
    stage.camera((0, 0, 3), (0, 0, 0), angle=2.0)
    np.testing.assert_allclose(stage.render(1)["depth"], 3.0, rtol=1e-5)


def test_depth_of_nothing_is_blenders_far_value(stage):
    stage.rectangle((-9, -9), (0, 9), 1.0)
    stage.camera_above(SPAN)
    depth = stage.render(1)["depth"][..., 0]
    x, _ = places((32, 32), SPAN)
    np.testing.assert_allclose(depth[x < 0], 9.0, rtol=1e-5)
    assert (depth[x > 0] == 1e10).all()


def test_normals_are_in_world_space_and_turned_to_the_viewer(stage):
    stage.rectangle((-9, -9), (9, 9), turn=(0.5, 0.2, 0))
    stage.rectangle((-1, -1), (1, 1), location=(0, 0, 4), turn=(np.pi, 0, 0))  # its back to the camera
    stage.camera_above(SPAN)
    normal = stage.render(1)["normal"]
    x, y = places((32, 32), SPAN)
    middle = (np.abs(x) < 0.95) & (np.abs(y) < 0.95)
    np.testing.assert_allclose(normal[middle], np.broadcast_to([0, 0, 1], normal[middle].shape), atol=1e-3)
    from mathutils import Euler

    tilted = np.array(Euler((0.5, 0.2, 0)).to_matrix())[:, 2]
    outside = (np.abs(x) > 1.05) | (np.abs(y) > 1.05)
    np.testing.assert_allclose(normal[outside], np.broadcast_to(tilted, normal[outside].shape), atol=1e-3)


@pytest.mark.parametrize("strength", [0.5, 1e4, 1e12])
def test_an_emissive_surface_shows_its_radiance_from_both_sides(stage, strength):
    stage.rectangle((-9, -9), (0, 9), 1.0, material=emission(stage, strength, (1, 0.5, 0.25)))
    stage.rectangle((0, -9), (9, 9), 1.0, material=emission(stage, strength, (1, 0.5, 0.25)), turn=(0, 0, 0))
    stage.camera_above(SPAN)
    for turn in ((0, 0, 0), (np.pi, 0, 0)):
        stage.scene.camera.rotation_euler, stage.scene.camera.location.z = turn, 10 if turn[0] == 0 else -10
        images = stage.render(1)
        expected = np.broadcast_to(np.array([1, 0.5, 0.25]) * strength, images["emission"].shape)
        np.testing.assert_allclose(images["emission"], expected, rtol=1e-6)
        np.testing.assert_allclose(images["combined"][..., :3], expected, rtol=1e-6)


def test_the_picture_is_the_sum_of_its_light_paths(stage):
    stage.floor(material=stage.principled(Base_Color=(0.8, 0.4, 0.2, 1), Roughness=0.4, Emission_Strength=0.0))
    stage.rectangle((-0.5, -0.5), (0.5, 0.5), 0.5, material=emission(stage, 3.0))
    stage.camera_above(SPAN)
    stage.world((0.1, 0.2, 0.4))
    stage.light("AREA", (1, 0, 2), size=1.0)
    images = stage.render(8)
    total = images["emission"] + images["environment"]
    for lobe in ("diffuse", "glossy"):
        total = total + images[f"{lobe}_direct"] * images[f"{lobe}_color"]
    np.testing.assert_allclose(images["combined"][..., :3], total, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("opacity", [0.25, 0.75])
def test_coverage_of_a_see_through_surface_is_its_alpha(stage, opacity):
    stage.mesh([(-40, -9, 0), (40, -9, 0), (0, 60, 0)], [(0, 1, 2)], material=stage.principled(Alpha=opacity))
    stage.camera_above(SPAN)
    stage.scene.render.film_transparent = True
    alpha = stage.render(256)["combined"][..., 3]
    # Numbers are stratified over the samples of each pixel and triangle, so the error falls nearly like 1 / n.
    np.testing.assert_allclose(alpha, opacity, atol=0.02)
    assert alpha.mean() == pytest.approx(opacity, abs=0.003)


def test_a_border_renders_the_same_pixels_as_the_whole_picture(stage):
    stage.floor()
    stage.rectangle((-0.7, -0.3), (0.4, 0.9), 0.5)
    stage.camera((1, -4, 3), (0.9, 0, 0.2))
    stage.light("POINT", (1, 0, 2), shadow_soft_size=0)
    whole = stage.render(1, (32, 24))
    render = stage.scene.render
    render.use_border = True
    render.border_min_x, render.border_max_x = 0.25, 0.75
    render.border_min_y, render.border_max_y = 0.5, 1.0
    part = stage.render(1, (32, 24))
    assert part["combined"].shape == (12, 16, 4)
    np.testing.assert_allclose(part["depth"], whole["depth"][12:, 8:24], rtol=1e-5)
    np.testing.assert_allclose(part["normal"], whole["normal"][12:, 8:24], atol=1e-5)
    np.testing.assert_allclose(part["diffuse_color"], whole["diffuse_color"][12:, 8:24], atol=1e-5)
    assert part["combined"].mean() == pytest.approx(whole["combined"][12:, 8:24].mean(), rel=0.03)


@pytest.mark.slow
def test_the_pixel_filter_spreads_an_edge_as_blackman_harris_does(stage):
    """An edge through the middle of a pixel column: each column sees the filter's share on its side."""
    stage.rectangle((0, -9), (9, 9), material=emission(stage, 1.0))
    stage.camera_above(SPAN)
    stage.scene.render.filter_size = 1.5
    found = stage.render(1024, (32, 4))["emission"][..., 0].mean(axis=0)
    t = np.linspace(-1.5, 1.5, 30001)
    phase = np.pi * (t / 1.5 + 1)
    density = 0.35875 - 0.48829 * np.cos(phase) + 0.14128 * np.cos(2 * phase) - 0.01168 * np.cos(3 * phase)
    centres = np.arange(32) + 0.5 - 16
    expected = [density[t > -centre].sum() / density.sum() for centre in centres]
    np.testing.assert_allclose(found, expected, atol=0.01)


# Lights that the camera may see --------------------------------------------------------------------------------------


def seen(light):
    light.visible_camera = True
    return light


def test_an_area_light_that_the_camera_may_see_shows_its_radiance_in_emission(stage):
    seen(stage.light("AREA", (0, 0, 1), (np.pi, 0, 0), size=2.0))
    stage.camera_above(SPAN)
    x, y = places((32, 32), SPAN)
    found = stage.render(1)["emission"][..., 0]
    middle, outside = np.maximum(np.abs(x), np.abs(y)) < 0.95, np.maximum(np.abs(x), np.abs(y)) > 1.05
    np.testing.assert_allclose(found[middle], 100 / (np.pi * 4), rtol=1e-4)
    assert (found[outside] == 0).all()


def test_a_sun_that_the_camera_may_see_is_a_disc_of_its_radiance(stage):
    seen(stage.light("SUN", turn=(np.pi, 0, 0), angle=0.6, energy=1.0))
    stage.camera((0, 0, 0), (0, 0, 0), angle=1.2)
    found = stage.render(1)["emission"][..., 0]
    x, y = places((32, 32), 2 * np.tan(0.6))
    away = np.arctan(np.hypot(x, y))
    np.testing.assert_allclose(found[away < 0.28], 1 / (np.pi * np.sin(0.3) ** 2), rtol=1e-4)
    assert (found[away > 0.32] == 0).all()


@pytest.mark.slow
def test_a_light_is_hidden_by_what_stands_before_it(stage):
    seen(stage.light("POINT", (0, 0, 0), shadow_soft_size=0.5, use_soft_falloff=False))
    stage.rectangle((-2, -2), (0, 2), 1.0)
    stage.camera_above(SPAN)
    found = stage.render(1)["emission"][..., 0]
    x, y = places((32, 32), SPAN)
    assert (found[x < 0] == 0).all()
    np.testing.assert_allclose(found[(x > 0) & (np.hypot(x, y) < 0.45)], 100 / (4 * np.pi**2 * 0.25), rtol=1e-4)


def test_exposure_scales_light_and_leaves_alpha(stage):
    stage.floor()
    stage.light("POINT", (0, 0, 2))
    stage.rectangle((-0.5, -0.5), (0.5, 0.5), 0.5, material=emission(stage, 3.0))
    stage.camera_above(SPAN)
    once = stage.render()
    exposure = stage.scene.cycles if hasattr(stage.scene, "cycles") else stage.scene.view_settings
    name = "film_exposure" if hasattr(exposure, "film_exposure") else "exposure"
    setattr(exposure, name, 4.0)
    try:
        bright = stage.render()
    finally:
        exposure.property_unset(name)
    np.testing.assert_allclose(bright["combined"][..., :3], 4 * once["combined"][..., :3], rtol=1e-5)
    np.testing.assert_array_equal(bright["combined"][..., 3], once["combined"][..., 3])


def test_the_ledger_counts_what_was_drawn(stage):
    """Two triangles in each of two samples; passes of every technique that draws."""
    stage.floor()
    stage.light("POINT", (0, 0, 2))
    stage.camera_above(SPAN)
    stage.render(2)
    rows = {row.name: row.counters for row in stage.ledger.rows if row.state == "ran"}
    assert rows["surfaces"]["triangles"] in (4, 6)  # receivers may be drawn apart
    assert rows["film"]["passes"] >= 4 and rows["direct_light"]["passes"] >= 2
    assert rows["film"]["points"] % 2 == 0 and rows["film"]["points"] > 0
