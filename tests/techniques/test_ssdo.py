"""Light between the surfaces that the picture shows, against form factors in closed form."""

import numpy as np
import pytest

from addon.compare.passes import light_paths
from addon.compare.reference import render_passes
from addon.frame import ledger
from tests.techniques.test_instant_radiosity import corner, sphere, wall_irradiance


@pytest.fixture
def render(stage):
    """Radiance of diffuse indirect light, by a number of bounces; further arguments are the technique's parameters."""

    def render(bounces=1, samples=8, size=(48, 48), **params):
        settings = stage.scene.candela
        settings.slot_indirect = "ssdo"
        for name, value in params.items():
            setattr(settings, f"ssdo_{name}", value)
        images = render_passes(stage.scene, "CANDELA", samples, 0, size=size, bounces=bounces).images
        assert ledger.latest().bad_pixels == 0
        return light_paths(images)["diffuse_indirect"].astype(float)

    return render


def wall_and_floor(stage, elevation):
    """Unit squares that share an edge, lit from straight above: the floor's radiosity is 8."""
    stage.rectangle((0, 0), (1, 1), material=stage.diffuse(0.8))
    stage.mesh([(0, 0, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1)], [(0, 1, 2, 3)], material=stage.diffuse(1.0))
    stage.light("SUN", energy=10.0, angle=0.0)
    place = (5 * np.cos(elevation), 0.5, 5 * np.sin(elevation))
    camera = stage.camera(place, (np.pi / 2 - elevation, 0, np.pi / 2))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 2.0


def heights(rows, elevation):
    """Of the wall's points in the middle of rows of a picture, 48 pixels for 2 metres."""
    return ((rows + 0.5) / 48 - 0.5) * 2 / np.cos(elevation)


@pytest.mark.parametrize("elevation", [30, 45, 60])
def test_a_wall_gets_light_from_the_floor_by_their_form_factor(stage, render, elevation):
    elevation = np.radians(elevation)
    wall_and_floor(stage, elevation)
    light = render(samples=16, steps=48, radius=100.0, rays=False)[:, 21:27].mean(axis=(1, 2)) * np.pi
    rows = np.arange(26, 24 + int(24 * np.cos(elevation)) - 1)
    expected = wall_irradiance(heights(rows, elevation))
    np.testing.assert_allclose(light[rows], expected, rtol=0.15)
    assert light[rows].mean() == pytest.approx(expected.mean(), rel=0.03)


@pytest.mark.parametrize("bounces", [1, 8])
def test_rays_bring_what_the_screen_does_not_show(stage, render, bounces):
    """A sphere lit from its centre, of which a tenth is in the picture: the series of reflections, all the same."""
    sphere(stage, stage.diffuse(0.5))
    stage.light("POINT", (0, 0, 0), energy=4 * np.pi**2, shadow_soft_size=0.0)
    light = render(bounces, samples=8, size=(24, 24))
    assert light.mean() == pytest.approx(0.5 * (1 - 0.5**bounces), rel=0.02)
    assert render(1, samples=8, size=(24, 24), rays=False).mean() < 0.1


@pytest.mark.slow
def test_what_a_mirror_shows_of_lit_surfaces_is_glossy_indirect_light(stage):
    """A mirror on the floor shows a ceiling out of the picture, whose light is known from a picture of the ceiling."""
    mirror = stage.material("ShaderNodeBsdfAnisotropic", Color=(1, 1, 1, 1), Roughness=0.0)
    stage.rectangle((-5, -5), (5, 5), material=mirror)
    stage.rectangle((-5, -5), (5, 5), z=2.0, material=stage.diffuse(0.6))
    stage.light("AREA", (0, 0, 0.5), (np.pi, 0, 0), energy=50.0, size=0.5)
    stage.camera((0, 0, 1.0), (np.pi / 4, 0, 0), angle=0.3)
    stage.scene.candela.slot_indirect = "ssdo"
    shown = light_paths(stage.render(64, (24, 24), bounces=1))["glossy_indirect"].mean()
    stage.scene.camera.rotation_euler = (3 * np.pi / 4, 0, 0)
    stage.scene.camera.location = (0, 0, -1.0)
    stage.scene.objects["Mesh"].visible_camera = False
    assert shown == pytest.approx(light_paths(stage.render(64, (24, 24)))["diffuse_direct"].mean(), rel=0.03)


@pytest.mark.parametrize("visibility", ["BITS", "POINTS"])
def test_a_surface_alone_gets_no_light_from_itself(stage, render, visibility):
    """From any side: pixels of one plane see each other edge on."""
    stage.floor(5)
    stage.light("POINT", (0, 0, 2))
    for tilt in (0.0, 0.7, 1.4):
        stage.camera((0, -5 * np.sin(tilt), 5 * np.cos(tilt)), (tilt, 0, 0))
        assert render(3, visibility=visibility).max() < 1e-3


def test_points_never_send_more_than_the_directions_that_they_stand_for(stage, render):
    """The thesis's patches of pi r^2 / N beside a floor of radiance 8 / pi."""
    wall_and_floor(stage, np.radians(45))
    light = render(samples=16, visibility="POINTS", radius=0.1)
    assert light[24:26, 21:27].mean() > 0
    assert light.max() < 8 / np.pi


def test_surfaces_that_face_away_hide_light_and_send_none(stage, render):
    """A board between floor and wall, whose lit side the camera sees: the wall sees its dark side."""
    wall_and_floor(stage, np.radians(45))
    open_light = render(samples=16, radius=100.0, rays=False)
    board = stage.mesh([(0.4, 0, 0), (0.4, 1, 0), (0.4, 1, 0.3), (0.4, 0, 0.3)], [(0, 1, 2, 3)])
    board.data.materials.append(stage.diffuse(0.8))
    hidden = render(samples=16, radius=100.0, rays=False)
    low_on_the_wall = slice(26, 30), slice(20, 28)
    assert hidden[low_on_the_wall].mean() < open_light[low_on_the_wall].mean()
    assert (hidden <= 1.3 * open_light.max()).all()


def test_light_is_linear(stage, render):
    corner(stage)
    once = render(3)
    stage.clear()
    corner(stage, energy=120.0)
    np.testing.assert_allclose(render(3), 2 * once, rtol=1e-3, atol=1e-5)


@pytest.mark.parametrize("scale", [1e-3, 1e4])
def test_light_does_not_depend_on_the_scale_of_the_scene(stage, render, scale):
    corner(stage)
    unit = render(2)
    stage.clear()
    corner(stage, energy=60.0 * scale**2)
    stage.enlarge(scale)
    assert render(2).mean() == pytest.approx(unit.mean(), rel=0.02)


def test_bounces_add_up_like_powers_of_the_albedo(stage, render):
    """Each bounce brings the one before once more through the same form factors: less than the albedo of it."""
    corner(stage, albedo=0.5)
    stage.scene.candela.ssdo_bounces = 8
    light = [render(n, samples=16, rays=False).mean() for n in (1, 2, 3, 4)]
    steps = np.diff([0.0, *light])
    assert (steps > 0).all()
    assert (steps[1:] < 0.5 * steps[:-1]).all()
    np.testing.assert_allclose(steps[2] / steps[1], steps[3] / steps[2], rtol=0.05)


def test_a_sample_that_is_shown_alone_is_filtered_and_others_are_not(stage, render):
    corner(stage)
    one, row = render(1, samples=1), ledger.latest().row("ssdo")
    assert row.counters["filtered samples"] == 1
    many, row = render(1, samples=32), ledger.latest().row("ssdo")
    assert "filtered samples" not in row.counters
    assert one.mean() == pytest.approx(many.mean(), rel=0.03)


def test_where_nothing_can_be_lit_nothing_runs(stage, render):
    corner(stage)
    render(0)
    row = ledger.latest().row("ssdo")
    assert (row.state, row.reason) == ("skipped", "the scene's bounces are set to 0")
    stage.clear()
    stage.light("POINT")
    stage.camera_above()
    render(4)
    assert ledger.latest().row("ssdo").reason == "the scene has no surface"
    stage.clear()
    corner(stage)
    for placed in stage.scene.objects:
        if placed.type == "MESH":
            placed.data.materials[0] = stage.material("ShaderNodeEmission")
    render(4)
    assert ledger.latest().row("ssdo").reason == "no material reflects light"
