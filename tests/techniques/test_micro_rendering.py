"""Micro-rendering against closed forms, Cycles, and the laws that light obeys."""

from dataclasses import replace
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from addon import engine
from addon.compare.passes import light_paths
from addon.compare.reference import render_passes
from addon.frame import ledger
from addon.frame.run import Renderer
from addon.gfx import library, passes
from addon.lighting import point_runs
from addon.snapshot import SnapshotCache, take
from addon.techniques import make_registry, micro_rendering
from addon.ui.properties import settings_of
from tests.techniques.test_instant_radiosity import corner, sphere, wall_irradiance

NAME = "micro_rendering"


@pytest.fixture
def render(stage):
    """Diffuse indirect radiance of the stage, with the technique's parameters by name."""

    def render(bounces, samples=2, size=(24, 24), seed=0, points=4096, **params):
        stage.scene.candela.slot_indirect = NAME
        for name, value in {"points": points, **params}.items():
            setattr(stage.scene.candela, f"{NAME}_{name}", value)
        images = render_passes(stage.scene, "CANDELA", samples, seed, size=size, bounces=bounces).images
        assert ledger.latest().bad_pixels == 0
        return light_paths(images)["diffuse_indirect"]

    return render


def counters():
    return ledger.latest().row(NAME).counters


def lamp_in_a_corner(stage):
    corner(stage)
    return next(thing for thing in stage.scene.objects if thing.type == "LIGHT")


def shelf(stage, **options):
    return stage.rectangle((-0.3, -0.3), (0.3, 0.3), 0.6, **options)


@pytest.mark.slow
@pytest.mark.parametrize("bounces", [1, 3])
def test_a_sphere_lit_from_its_centre_follows_the_series_of_reflections(stage, render, bounces):
    sphere(stage, stage.diffuse(0.5))
    stage.light("POINT", (0, 0, 0), energy=4 * np.pi**2, shadow_soft_size=0.0)
    light = render(bounces)
    assert light.mean() == pytest.approx(0.5 * (1 - 0.5**bounces), rel=0.02)
    assert light.mean(axis=2).std() < 0.03 * light.mean()


@pytest.mark.slow
def test_a_floor_in_the_sun_lights_the_wall_beside_it_by_their_form_factor(stage, render):
    stage.rectangle((0, 0), (1, 1), material=stage.diffuse(0.8))
    stage.mesh([(0, 0, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1)], [(0, 1, 2, 3)], material=stage.diffuse(1.0))
    stage.light("SUN", energy=10.0, angle=0.0)
    camera = stage.camera((3, 0.5, 0.5), (np.pi / 2, 0, np.pi / 2))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 1.0
    irradiance = render(1, samples=8, size=(64, 64), side=16).mean(axis=2) * np.pi
    # Discs at the floor's rim reach beyond it by up to 1.5 times the radius of what they stand for: of 2048, 3 cm.
    assert irradiance.mean() == pytest.approx(8 * 0.200044, rel=0.04)
    height = (np.arange(64) + 0.5) / 64
    four_rows = irradiance[:, 28:36].reshape(16, 32).mean(axis=1)
    np.testing.assert_allclose(four_rows[1:], wall_irradiance(height).reshape(16, 4).mean(axis=1)[1:], rtol=0.08)


@pytest.mark.slow
def test_a_closed_box_that_shines_loses_and_gains_nothing(stage, render):
    """Radiance 1 and albedo 1/2: each wall sends out 2 in all, so what it gets from others' reflection is 1/2."""
    shining = stage.principled(Base_Color=(0.5, 0.5, 0.5, 1), IOR=1.0, Emission_Strength=1.0)
    shining.node_tree.nodes["Principled BSDF"].inputs["Emission Color"].default_value = (1, 1, 1, 1)
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    stage.mesh(corners, faces, material=shining)
    stage.camera((0.3, 0.2, -0.1), (1.2, 0.3, 0.4), angle=1.4)
    assert render(12, samples=8, points=8192).mean() == pytest.approx(0.5, rel=0.04)


def test_twice_the_light_is_twice_the_picture(stage, render):
    lamp = lamp_in_a_corner(stage)
    once = render(3)
    lamp.data.energy *= 2
    np.testing.assert_allclose(render(3), 2 * once, rtol=1e-4, atol=1e-6)


def test_a_black_thing_in_the_way_only_takes_light(stage, render):
    lamp_in_a_corner(stage)
    without = render(1, samples=4)
    shelf(stage, material=stage.diffuse(0.0)).visible_camera = False
    hidden = render(1, samples=4)
    assert hidden.mean() < 0.97 * without.mean()
    assert (hidden < 1.1 * without + 0.05 * without.mean()).mean() > 0.98


def test_light_of_both_sides_of_a_sheet_is_told_apart(stage, render):
    """A lamp above a sheet lights the floor's surroundings, not what looks at the sheet from below."""
    stage.rectangle((-4, -4), (4, 4), 1.0, material=stage.diffuse(0.8)).visible_camera = False
    stage.rectangle((-1, -1), (1, 1), 0.0, material=stage.diffuse(0.8))
    stage.light("SUN", energy=10.0, angle=0.0)
    stage.camera_above(1.0, height=0.9)
    assert np.abs(render(1)).max() < 1e-6


@pytest.mark.slow
def test_error_falls_with_samples_and_with_pixels_of_the_micro_buffer(stage, render):
    lamp_in_a_corner(stage)
    shelf(stage, material=stage.diffuse(0.5))
    truth = render(2, samples=32, points=8192, side=16)

    def error(**params):
        return np.sqrt(((render(2, **params) - truth) ** 2).mean()) / truth.mean()

    few = error(samples=1, side=6)
    assert error(samples=8, side=6) < 0.7 * few
    assert error(samples=1, side=16) < 0.8 * few


@pytest.mark.slow
def test_a_corner_with_a_shelf_is_as_cycles_has_it(stage, render):
    lamp_in_a_corner(stage)
    shelf(stage, material=stage.diffuse(0.5))
    found = render(4, samples=16, size=(32, 32), points=8192, side=16)
    seeds = (light_paths(render_passes(stage.scene, "CYCLES", 512, s, size=(32, 32), bounces=4).images) for s in (1, 2))
    truth = np.mean([paths["diffuse_indirect"] for paths in seeds], axis=0)
    assert found.mean() == pytest.approx(truth.mean(), rel=0.03)
    assert np.sqrt(((found - truth) ** 2).mean()) < 0.08 * truth.mean()


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_a_scene_of_any_size_looks_the_same(stage, render, scale):
    lamp = lamp_in_a_corner(stage)
    expected = render(2)
    stage.enlarge(scale)
    lamp.data.energy *= scale**2
    found = render(2)
    assert found.mean() == pytest.approx(expected.mean(), rel=0.01)
    assert np.sqrt(((found - expected) ** 2).mean()) < 0.05 * expected.mean()


def test_the_same_picture_is_drawn_again(stage, render):
    lamp_in_a_corner(stage)
    first = render(3)
    engine.free_sessions()
    np.testing.assert_array_equal(render(3), first)


def test_trees_stay_while_cameras_and_lamps_move_and_are_made_anew_for_what_is_moved(stage, render):
    lamp = lamp_in_a_corner(stage)
    thing = shelf(stage, material=stage.diffuse(0.5))
    render(2)
    assert counters()["trees made"] == 2
    lamp.location.z += 0.1
    stage.scene.camera.location.x += 0.01
    render(2)
    assert counters()["trees kept"] == 2 and "trees made" not in counters()
    thing.location.z -= 0.1
    render(2)
    assert counters()["trees made"] == 2


@pytest.mark.parametrize("glossy", [False, True])
def test_what_gloss_by_direction_draws_is_among_the_programs_that_are_compiled_ahead(
    stage, render, monkeypatch, glossy
):
    stage.floor(material=stage.material("ShaderNodeBsdfGlossy", Roughness=0.5) if glossy else stage.diffuse(0.5))
    stage.rectangle((-1, -1), (1, 1), 1.0, material=stage.diffuse(0.5))
    stage.light("POINT", (0, 0, 0.5), energy=10)
    stage.camera_above()
    foretold, drawn, own = [], set(), micro_rendering.MicroRendering.programs

    def programs(self, snapshot, settings):
        foretold.extend(own(self, snapshot, settings))
        return ()  # so that only what is drawn is asked for

    get = library.get
    monkeypatch.setattr(micro_rendering.MicroRendering, "programs", programs)
    for module in (library, passes):
        monkeypatch.setattr(module, "get", lambda program: drawn.add(program) or get(program))
    render(2, size=(8, 8), samples=1, points=256)
    assert {*foretold} <= drawn
    assert any("gloss" in one.name for one in drawn) == glossy  # the material of empty slots is in no slot
    missing = {one.name for one in drawn - {*foretold}}
    assert not [name for name in missing if "gloss" in name or "ways" in name], missing


def test_trees_stay_where_an_object_has_another_pass_index(stage):
    """They hold objects, of which a change that moves nothing makes others."""
    lamp_in_a_corner(stage)
    stage.scene.candela.slot_indirect, stage.scene.candela.micro_rendering_points = NAME, 1024
    size, count = (16, 16), 8
    settings = replace(settings_of(stage.scene, viewport=False), samples=count, bounces=1)
    first = take(bpy.context.evaluated_depsgraph_get(), SnapshotCache(), *size)
    second = replace(first, instances=(replace(first.instances[0], pass_index=3), *first.instances[1:]))

    def drawn(renderer, snapshot, samples):
        frame = renderer.begin(snapshot, settings)
        for _ in range(samples):
            renderer.advance(frame)
        return renderer.finish(frame, ["radiance.diffuse_indirect"])["radiance.diffuse_indirect"]

    used, fresh = Renderer(make_registry), Renderer(make_registry)
    try:
        assert drawn(used, first, 2).max() > 0
        np.testing.assert_array_equal(drawn(used, second, count), drawn(fresh, second, count))
    finally:
        used.release()
        fresh.release()


@pytest.mark.parametrize("levels", [0, 2])
def test_a_picture_is_gathered_in_blocks_that_fit_an_image(stage, render, monkeypatch, levels):
    """Pixels' micro-buffers side by side are soon wider than images may be."""
    corner(stage)
    stage.rectangle((-0.4, -0.4), (0.4, 0.4), 0.3, material=stage.principled(Metallic=1.0, Roughness=0.4))
    asked = {"side": 8, "lobe_side": 5, "levels": levels, "points": 256}
    whole = render(1, 1, **asked)
    reflected = render_passes(stage.scene, "CANDELA", 1, 0, size=(24, 24), bounces=1).images["glossy_indirect"]
    sides = []
    compute = micro_rendering.passes.compute

    def noted(program, size, **bindings):
        sides.extend(bindings["images"]["micro"].size if "micro" in bindings.get("images", {}) else ())
        compute(program, size, **bindings)

    monkeypatch.setattr(micro_rendering, "WIDEST", 60)
    monkeypatch.setattr(micro_rendering.passes, "compute", noted)
    engine.free_sessions()
    np.testing.assert_array_equal(render(1, 1, **asked), whole)
    again = render_passes(stage.scene, "CANDELA", 1, 0, size=(24, 24), bounces=1).images["glossy_indirect"]
    np.testing.assert_array_equal(again, reflected)
    assert reflected.any() and 0 < max(sides) <= 60


@pytest.mark.parametrize(("side", "within"), [(1, 0.01), (5, 0.06)])
def test_white_metal_in_a_lit_sphere_is_as_bright_as_the_sphere(stage, side, within):
    """Irradiance pi and albedo 1/2 give radiance 1/2 all around. Groups of points are drawn as one where they are as
    large as a pixel of the lobe, and leave holes: twice as large ones took a fifth of the light."""
    sphere(stage, stage.diffuse(0.5))
    stage.light("POINT", (0, 0, 0), energy=4 * np.pi**2, shadow_soft_size=0.0)
    white = stage.principled(Base_Color=(1, 1, 1, 1), Metallic=1.0, Roughness=0.5)
    stage.rectangle((-0.1, -0.1), (0.1, 0.1), -0.3, material=white)
    stage.camera((0, 0, -0.1), (0, 0, 0), angle=0.4)
    stage.scene.candela.slot_indirect, stage.scene.candela.micro_rendering_lobe_side = NAME, side
    seen = render_passes(stage.scene, "CANDELA", 8, 0, size=(16, 16), bounces=1).images["glossy_indirect"]
    assert seen[..., :3].mean() == pytest.approx(0.5, rel=within)


@pytest.mark.parametrize(
    ("roughness", "caustics", "within", "apart"), [(0.4, "OFF", 0.06, 0.3), (0.2, "AUTO", 0.4, 0.7)]
)
def test_a_wall_of_metal_throws_the_suns_light_on_the_floor(stage, render, roughness, caustics, within, apart):
    """As in Cycles, by direction where nothing throws caustics: .41 of the light came, over all the floor. What photons
    bring (.73 of the light) is not counted again: it was 1.42 of the light."""
    stage.scene.candela.slot_caustics = caustics
    stage.rectangle((-4, -4), (4, 2), material=stage.diffuse(0.8))
    metal = stage.material("ShaderNodeBsdfGlossy", Color=(0.8, 0.6, 0.4, 1), Roughness=roughness)
    stage.mesh([(-4, 2, 0), (4, 2, 0), (4, 2, 2), (-4, 2, 2)], [(0, 1, 2, 3)], material=metal)
    stage.light("SUN", turn=(np.radians(50), 0, 0), energy=10.0, angle=0.0)
    camera = stage.camera((0, -1, 5), (0, 0, 0))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 6.0
    truth = light_paths(render_passes(stage.scene, "CYCLES", 512, 1, size=(16, 16), bounces=1).images)[
        "diffuse_indirect"
    ]
    found = render(1, samples=4, size=(16, 16), points=2048)
    assert found.mean(axis=(0, 1)) == pytest.approx(truth.mean(axis=(0, 1)), rel=within)
    assert found.mean() < 1.05 * truth.mean()
    assert np.sqrt(np.mean((found - truth) ** 2)) < apart * truth.mean()


def test_normals_of_points_are_those_of_the_smooth_surface():
    """Between three corners, of a mesh that is stretched and of its mirror image."""
    corners = np.array([[0.0, 0.6, 0.8], [0.6, 0.0, 0.8], [-0.8, 0.0, 0.6]])
    mesh = SimpleNamespace(corner_normals=corners.astype(np.float32), triangle_corners=np.array([[0, 1, 2]]))
    share = np.array([[0.2, 0.3], [0.5, 0.1]])
    for stretched in (np.diag([2.0, 1.0, 1.0]), np.diag([-2.0, 1.0, 1.0])):
        found = point_runs._shading_normals(mesh, stretched, np.array([0, 0]), share)
        expected = np.stack([(1 - a - b) * corners[0] + a * corners[1] + b * corners[2] for a, b in share])
        expected = expected @ np.linalg.inv(stretched)
        expected /= np.linalg.norm(expected, axis=1, keepdims=True)
        np.testing.assert_allclose(found, expected, atol=1e-6)


def test_one_triangle_and_nothing_are_drawn(stage, render):
    stage.mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)], material=stage.diffuse(0.8))
    stage.light("SUN")
    stage.camera_above(4.0)
    assert np.abs(render(2)).max() == 0.0
    stage.clear()
    stage.camera_above(4.0)
    render(2)
    assert ledger.latest().row(NAME).reason == "the scene has no surface"


@pytest.mark.slow
def test_the_threshold_and_the_test_of_centres_change_the_cost_and_not_the_light(stage, render):
    sphere(stage, stage.diffuse(0.5))
    stage.light("POINT", (0, 0, 0), energy=4 * np.pi**2, shadow_soft_size=0.0)
    for params in (
        {"threshold": 0.1},
        {"threshold": 4.0},
        {"centre_test": False},
        {"levels": 0},
        {"groups": 16, "side": 4},
        {"side": 24},
    ):
        # Where all is drawn as single discs, the specification knows of holes up to 6 % between so few points.
        within = 0.06 if "threshold" in params else 0.03
        assert render(1, **params).mean() == pytest.approx(0.25, rel=within), params
        for name in params:
            stage.scene.candela.property_unset(f"{NAME}_{name}")


@pytest.mark.slow
def test_light_goes_on_beyond_what_stands_on_a_piece(stage, render):
    """Fins parallel to the sun's light stand on a floor of few points: they hide nothing of it from above, and are as
    wide as its pieces."""
    stage.rectangle((-1, -1), (1, 1), material=stage.diffuse(0.8))
    for x in (-0.55, -0.05, 0.35):
        fin = [(x, -1, 0), (x, 1, 0), (x, 1, 0.08), (x, -1, 0.08)]
        stage.mesh(fin, [(0, 1, 2, 3)], material=stage.diffuse(0.0))
    stage.mesh([(-3, -3, 4), (3, -3, 4), (3, 3, 4), (-3, 3, 4)], [(0, 1, 2, 3)], material=stage.diffuse(0.8))
    stage.scene.objects[-1].visible_shadow = False
    stage.light("SUN", energy=10.0, angle=0.0)
    stage.camera((0, 0, 1), (np.pi, 0, 0), angle=0.8)
    many = render(1, points=16384, samples=4)
    assert many.mean() > 0.1
    few = render(1, points=64, samples=8)  # all runs of points
    assert few.mean() == pytest.approx(many.mean(), rel=0.08)  # dark beyond the fins: .62


@pytest.mark.parametrize("metallic", [1.0, 0.4])
def test_mirrored_light_comes_by_way_of_a_wall_that_is_not_in_view(stage, render, metallic):
    """As much as of metal so rough that it throws no photons, which bring what mirrors throw to the picture alone: of a
    mirror nothing came by way of the wall. A material of Metallic .4 throws none."""
    metal = stage.principled(Base_Color=(0.9, 0.9, 0.9, 1), Metallic=metallic, Roughness=0.2)
    stage.rectangle((-0.4, -0.4), (0.4, 0.4), 0.0, material=metal)
    stage.rectangle((0.6, -0.6), (1.8, 0.6), 0.0, material=stage.diffuse(0.8))
    wall = [(2, -2, 0), (2, 2, 0), (2, 2, 4), (2, -2, 4)]
    stage.mesh(wall, [(0, 3, 2, 1)], material=stage.diffuse(0.8))
    other = stage.material("ShaderNodeBsdfGlossy", Roughness=0.1)  # for which photons answer
    stage.rectangle((-4, -4), (-3.9, -3.9), -1.0, material=other)
    spot = {"energy": 500.0, "spot_size": 0.25, "spot_blend": 0.0, "shadow_soft_size": 0.0}
    stage.light("SPOT", (-1.5, 0, 1.5), (0, -np.pi / 4, 0), **spot)
    camera = stage.camera((1.2, 0, 5), (0, 0, 0))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 1.0
    mirror = render(2, samples=4, size=(12, 12), points=2048).mean()
    metal.node_tree.nodes[0].inputs["Roughness"].default_value = 0.26
    assert mirror == pytest.approx(render(2, samples=4, size=(12, 12), points=2048).mean(), rel=0.1)


def test_metal_mirrors_bounced_light_by_direction(stage):
    """A lit card before a wall of metal: what the metal throws on the floor between them, as in Cycles."""
    for y, material in ((-2.0, stage.diffuse(0.8)), (2.0, stage.material("ShaderNodeBsdfGlossy", Roughness=0.4))):
        stage.mesh([(-1, y, 0), (1, y, 0), (1, y, 2), (-1, y, 2)], [(0, 1, 2, 3)], material=material)
    stage.rectangle((-1, -2), (1, 2), material=stage.diffuse(0.8))
    spot = {"energy": 500.0, "spot_size": 0.5, "spot_blend": 0.0, "shadow_soft_size": 0.0}
    stage.light("SPOT", (0, 0.5, 1.6), (-np.pi / 2, 0, 0), **spot)
    camera = stage.camera((0, 0, 5), (0, 0, 0))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 3.9
    stage.scene.candela.slot_indirect = NAME

    def second_bounce(engine, samples):
        """Of the half of the floor beside the card and of that beside the metal."""
        once, twice = (
            light_paths(render_passes(stage.scene, engine, samples, 1, size=(8, 16), bounces=n).images) for n in (1, 2)
        )
        return (twice["diffuse_indirect"] - once["diffuse_indirect"]).reshape(2, -1).mean(axis=1)

    truth, found = second_bounce("CYCLES", 4096), second_bounce("CANDELA", 8)
    assert found == pytest.approx(truth, rel=0.12)  # as of diffuse metal .51 beside the card
