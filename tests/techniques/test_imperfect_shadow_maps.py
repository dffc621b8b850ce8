"""Imperfect shadow maps: closed forms where nothing is hidden, traced visibility as the measure where something is."""

from types import SimpleNamespace

import numpy as np
import pytest

from addon.compare.passes import light_paths
from addon.compare.reference import render_passes
from addon.frame import ledger
from addon.lighting.imperfect_maps import ImperfectMaps
from addon.sources.rates import Rate
from tests.techniques.test_caustics import ball, glass
from tests.techniques.test_caustics_of_meshes_and_worlds import world_with_a_bright_zenith
from tests.techniques.test_instant_radiosity import corner, sphere, wall_irradiance

NAME = "imperfect_shadow_maps"


@pytest.fixture
def render(stage):
    """Diffuse indirect radiance of the stage by a technique of the slot, with the technique's parameters by name."""

    def render(bounces, samples=4, size=(32, 32), technique=NAME, virtual_lights=64, seed=0, **params):
        stage.scene.candela.slot_indirect = technique
        for name, value in {"virtual_lights": virtual_lights, **params}.items():
            setattr(stage.scene.candela, f"{technique}_{name}", value)
        images = render_passes(stage.scene, "CANDELA", samples, seed, size=size, bounces=bounces).images
        assert ledger.latest().bad_pixels == 0
        return light_paths(images)["diffuse_indirect"]

    return render


def counters():
    return ledger.latest().row(NAME).counters


def shelf(stage, side=1, **options):
    """A shelf in the corner's middle, of 2 x side^2 triangles."""
    steps = np.linspace(-0.3, 0.3, side + 1)
    vertices = [(x, y, 0.6) for y in steps for x in steps]
    faces = [(k, k + 1, k + side + 2, k + side + 1) for k in range(side * (side + 1)) if k % (side + 1) < side]
    return stage.mesh(vertices, faces, **options)


def error(found, expected):
    """Root of the mean square and mean of the difference, as shares of the mean."""
    return np.sqrt(((found - expected) ** 2).mean()) / expected.mean(), found.mean() / expected.mean() - 1


@pytest.mark.parametrize(
    ("bounces", "points", "rays"), [(1, 64, 0), (3, 64, 0), (1, 1024, 0), (3, 1024, 0), (1, 64, 3)]
)
def test_a_sphere_lit_from_its_centre_follows_the_series_of_reflections(stage, render, bounces, points, rays):
    """Everything sees everything: whatever is missing is a false shadow. Rays correct virtual lights in groups, of
    which each light belongs to one."""
    sphere(stage, stage.diffuse(0.5))
    stage.light("POINT", (0, 0, 0), energy=4 * np.pi**2, shadow_soft_size=0.0)
    light = render(bounces, points=points, rays=rays)
    assert light.mean() == pytest.approx(0.5 * (1 - 0.5**bounces), rel=0.02)
    assert light.mean(axis=2).std() < 0.06 * light.mean()


@pytest.mark.slow
def test_a_floor_in_the_sun_lights_the_wall_beside_it_by_their_form_factor(stage, render):
    stage.rectangle((0, 0), (1, 1), material=stage.diffuse(0.8))
    stage.mesh([(0, 0, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1)], [(0, 1, 2, 3)], material=stage.diffuse(1.0))
    stage.light("SUN", energy=10.0, angle=0.0)
    camera = stage.camera((3, 0.5, 0.5), (np.pi / 2, 0, np.pi / 2))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 1.0
    irradiance = render(1, samples=16, size=(64, 64), virtual_lights=128).mean(axis=2) * np.pi
    assert irradiance.mean() == pytest.approx(8 * 0.200044, rel=0.02)
    height = (np.arange(64) + 0.5) / 64
    four_rows = irradiance[:, 28:36].reshape(16, 32).mean(axis=1)
    np.testing.assert_allclose(four_rows, wall_irradiance(height).reshape(16, 4).mean(axis=1), rtol=0.06)


@pytest.mark.slow
def test_a_closed_box_that_shines_loses_and_gains_nothing(stage, render):
    """Radiance 1 and albedo 1/2: each wall sends out 2 in all, so what it gets from others' reflection is 1/2. What
    points of the walls' own light lack close by falls with the root of the samples: .967, .985 of 16, 64."""
    shining = stage.principled(Base_Color=(0.5, 0.5, 0.5, 1), IOR=1.0, Emission_Strength=1.0)
    shining.node_tree.nodes["Principled BSDF"].inputs["Emission Color"].default_value = (1, 1, 1, 1)
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    stage.mesh(corners, faces, material=shining)
    stage.camera((0.3, 0.2, -0.1), (1.2, 0.3, 0.4), angle=1.4)
    few, many = (np.mean([render(12, samples=n, seed=seed).mean() for seed in range(2)]) for n in (16, 64))
    assert many == pytest.approx(0.5, rel=0.03)
    assert abs(many - 0.5) < 0.7 * abs(few - 0.5)


@pytest.mark.slow
def test_large_things_hide_virtual_lights_as_rays_say(stage, render):
    """The same virtual lights, all of them traced; unless anything hides them, the picture is 6 % brighter."""
    corner(stage)
    shelf(stage, material=stage.diffuse(0.2))
    settings = {"samples": 4, "size": (64, 64), "levels": 0}
    traced = render(2, technique="multires_radiosity", rays=64, **settings)
    spread, bias = error(render(2, rays=0, **settings), traced)
    assert spread < 0.02
    assert abs(bias) < 0.005


@pytest.mark.slow
def test_what_maps_show_wrong_rays_correct_in_the_mean(stage, render):
    """Maps of 8 x 8 texels from 16 points see little of a finely divided shelf."""
    corner(stage)
    shelf(stage, side=48, material=stage.diffuse(0.2))
    settings = {"samples": 8, "size": (64, 64), "levels": 0}
    traced = render(2, technique="multires_radiosity", rays=64, **settings)
    coarse = {"points": 16, "map_size": 8, **settings}
    assert abs(error(render(2, rays=0, **coarse), traced)[1]) > 0.01
    corrected = render(2, rays=4, **coarse)
    assert abs(error(corrected, traced)[1]) < 0.005
    assert corrected.min() >= 0


@pytest.mark.slow
def test_small_things_hide_them_the_better_the_more_points_they_have(stage, render):
    corner(stage)
    shelf(stage, side=48, material=stage.diffuse(0.2))
    settings = {"samples": 4, "size": (64, 64), "levels": 0}
    traced = render(2, technique="multires_radiosity", rays=64, **settings)
    few, some, many = (
        error(render(2, points=points, rays=0, map_size=64, **settings), traced) for points in (16, 128, 1024)
    )
    assert counters()["splats"] == counters()["maps"] * counters()["surface points made"]
    assert many[0] < some[0] < few[0]
    assert many[0] < 0.04
    assert abs(many[1]) < 0.015


@pytest.mark.slow
def test_a_shelf_that_lets_half_of_the_light_pass_hides_half(stage, render):
    light = []
    for opacity in (0.0, 0.5, 1.0):
        stage.clear()
        corner(stage)
        placed = shelf(stage, side=24, material=stage.see_through(opacity))
        placed.visible_camera = placed.visible_shadow = False
        light.append(render(1, samples=64, points=256).mean())
    assert light[2] < 0.97 * light[0]
    assert light[1] == pytest.approx((light[0] + light[2]) / 2, rel=0.01)


def test_points_are_made_anew_only_where_geometry_changes(stage, render):
    corner(stage)
    placed = shelf(stage, side=24, material=stage.diffuse(0.2))
    render(1, samples=2)
    assert "surface points made" in counters()
    lamp = next(thing for thing in stage.scene.objects if thing.type == "LIGHT")
    lamp.location.x += 0.1
    render(1, samples=2)
    assert "surface points kept" in counters() and "surface points made" not in counters()
    placed.location.x += 0.1
    render(1, samples=2)
    assert "surface points made" in counters()


def test_the_same_scene_gives_the_same_picture(stage, render):
    from addon import engine

    corner(stage)
    shelf(stage, side=24, material=stage.diffuse(0.2))
    first = render(2, samples=2)
    engine.free_sessions()
    np.testing.assert_array_equal(render(2, samples=2), first)


@pytest.mark.parametrize("scale", [2.0**-10, 2.0**13])
def test_maps_do_not_depend_on_the_scale_of_the_scene(stage, render, scale):
    def room(scale):
        stage.clear()
        corner(stage, energy=60.0 * scale**2)
        shelf(stage, side=24, material=stage.diffuse(0.2))
        stage.enlarge(scale)
        return render(2, points=256, samples=8)

    assert error(room(scale), room(1.0))[1] == pytest.approx(0.0, abs=0.02)


# Wide lamps and the sky: points of theirs with maps of points ---------------------------------------------------------


def direct_light(stage, by, samples=1, size=(32, 32), bounces=0):
    """Diffuse direct radiance by a kind of shadows of points."""
    stage.scene.candela.slot_shadow = "accumulated_maps"
    stage.scene.candela.accumulated_maps_by = by
    images = render_passes(stage.scene, "CANDELA", samples, 0, size=size, bounces=bounces).images
    assert ledger.latest().bad_pixels == 0
    return light_paths(images)["diffuse_direct"].mean(axis=2)


@pytest.mark.parametrize("pieces", [1, 24])
def test_a_plate_below_a_wide_lamp_has_the_penumbra_of_rays_in_one_sample(stage, pieces):
    """As one large triangle and as many small ones, which points stand for: no worse than a ray of each pixel."""
    stage.floor(material=stage.diffuse(0.8))
    steps = np.linspace(-0.4, 0.4, pieces + 1)
    vertices = [(x, y, 0.5) for y in steps for x in steps]
    row = pieces + 1
    faces = [(k, k + 1, k + row + 1, k + row) for k in range(row * pieces) if k % row < pieces]
    stage.mesh(vertices, faces, material=stage.diffuse(0.2))
    stage.light("AREA", location=(0, 0, 2), size=1.5, energy=50)
    stage.camera((0, -4, 1.2), (np.radians(73), 0, 0), 0.7)
    expected = direct_light(stage, "RAYS", samples=64)
    found = direct_light(stage, "POINTS")
    spread, bias = error(found, expected)
    print(spread, bias)
    assert spread < error(direct_light(stage, "RAYS"), expected)[0] and abs(bias) < 0.01


def test_the_sky_beside_a_wall_is_its_open_share(stage):
    """A floor before an endless wall of height h sees (1 + x / sqrt(x^2 + h^2)) / 2 of an even sky."""
    stage.floor(material=stage.diffuse(1.0))
    stage.mesh([(0, -40, 0), (0, 40, 0), (0, 40, 1), (0, -40, 1)], [(0, 1, 2, 3)], material=stage.diffuse(0.0))
    stage.world((1, 1, 1), 1.0)
    camera = stage.camera((2.0, 0, 5), (0, 0, 0))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 2.0
    found = direct_light(stage, "POINTS", samples=4)[8:24].mean(axis=0)
    x = 1.0 + (np.arange(32) + 0.5) / 16
    expected = (1 + x / np.sqrt(x * x + 1)) / 2
    np.testing.assert_allclose(found, expected, rtol=0.04)
    assert ledger.latest().row("environment_light").counters["maps"] >= 64


def test_what_reaches_into_the_map_of_a_sun_from_outside_casts_its_shadow(stage):
    """A triangle of which only the tip hides the picture; its middle lies outside the map."""
    stage.floor(material=stage.diffuse(0.8))
    tip = stage.mesh([(-0.25, 0, 0.3), (-2.1, -1, 0.3), (-2.1, 1, 0.3)], [(0, 1, 2)], material=stage.diffuse(0.2))
    tip.visible_camera = False
    stage.light("SUN", energy=5.0, angle=0.02)
    stage.camera_above(span=2.0)
    lit = 1 - 0.5 * 0.75 * (2 * 0.75 / 1.85) / 4  # of the picture; 2 x 2 m
    found = direct_light(stage, "POINTS")
    assert found.mean() / found[0, -1] == pytest.approx(lit, abs=0.004)


@pytest.mark.parametrize(("pieces", "height", "leak"), [(1, 0.4, 0.001), (48, 2.0, 0.01)])
def test_a_wide_view_has_the_shadows_of_what_is_low(stage, pieces, height, leak):
    """A roof of 80 m over a floor of which 200 m are seen: it hides the sun at any height, in many pieces, too."""
    stage.floor(400.0, material=stage.diffuse(0.8))
    steps = np.linspace(-40, 40, pieces + 1)
    vertices, row = [(x, y, height) for y in steps for x in steps], pieces + 1
    faces = [(k, k + 1, k + row + 1, k + row) for k in range(row * pieces) if k % row < pieces]
    stage.mesh(vertices, faces, material=stage.diffuse(0.2)).visible_camera = False
    stage.light("SUN", energy=5.0, angle=0.02)
    stage.camera_above(span=200.0, height=100.0)
    found = direct_light(stage, "POINTS")
    assert found[12:20, 12:20].mean() < leak * found[0, 0]


def test_light_that_glass_colours_has_depth_maps_and_says_so(stage):
    stage.floor(material=stage.diffuse(0.8))
    tinted = stage.material("ShaderNodeBsdfTransparent", Color=(1.0, 0.1, 0.1, 1.0))
    stage.rectangle((-0.5, -0.5), (0.5, 0.5), 0.6, material=tinted)
    stage.light("AREA", location=(0, 0, 2), size=1.0, energy=50)
    stage.camera_above()
    direct_light(stage, "POINTS", size=(16, 12))
    assert "colours the light" in str(ledger.latest().row("accumulated_maps").choices)


@pytest.mark.parametrize("source", ["lamp", "world"])
def test_glass_whose_light_arrives_as_caustics_has_depth_maps_and_says_so(stage, source):
    """Light must not pass a ball of glass straight, too: below it is full shadow."""
    stage.floor(material=stage.diffuse(0.8))
    ball(stage, glass(stage), place=(0, 0, 0.6), segments=48)
    stage.scene.candela.slot_caustics = "screen_space_photons"
    if source == "lamp":
        stage.light("AREA", location=(0, 0, 2), size=0.3, energy=50)
    else:
        world_with_a_bright_zenith(stage)
    stage.camera_above(0.6)
    stage.scene.candela.slot_indirect = "OFF"
    assert direct_light(stage, "POINTS", 2, (12, 12), bounces=1).max() == pytest.approx(0.0, abs=1e-6)
    name = "accumulated_maps" if source == "lamp" else "environment_light"
    assert "as caustics" in str(ledger.latest().row(name).choices)


@pytest.mark.parametrize("samples", [8, 16, 64, 256])
def test_a_wide_light_has_as_many_points_in_a_picture_whatever_its_samples(samples):
    """Where their number is known: 256 points, or one in each sample."""
    schedule = SimpleNamespace(known_total=True, is_draft=False)
    frame = SimpleNamespace(settings=SimpleNamespace(samples=samples, schedule=schedule))
    assert samples * 2 ** ImperfectMaps().rate(frame, Rate(0)).exponent == 256
