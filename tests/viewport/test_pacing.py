"""When the viewport is coarse and fine, and how long a redraw works."""

import itertools

import bpy
import numpy as np
import pytest
from mathutils import Vector

from addon import viewport
from addon.frame.bands import Bands
from addon.gfx import images, passes
from addon.viewport import picture
from addon.viewport.pace import GuidePace
from addon.viewport.picture import Viewport
from tests.viewport.region import SIZE
from tests.viewport.test_compiling import material_named


def test_moving_view_is_coarse_and_rests_in_full_resolution(region):
    region.rest()
    region.viewport.pace.cost = {1: 1.0, 2: 0.3, 4: 0.06}
    region.draw(region.moved(0.1))
    assert region.viewport.scale == 4
    assert region.viewport.picture.size == (24, 16)
    region.camera = region.moved(0.1)
    region.clock.now += 2 * viewport.REST_S
    region.draw()
    assert region.viewport.scale == 1
    assert region.viewport.picture.size == SIZE


def test_fast_scene_is_never_coarse_once_that_is_known(region):
    region.rest()
    region.viewport.pace.cost = {1: 0.01}
    region.draw(region.moved(0.1))
    assert region.viewport.scale == 1


@pytest.mark.parametrize(
    ("cost", "scale"),
    [
        ({}, 8),  # unknown: careful
        ({1: 0.05}, 1),
        ({1: 0.3}, 2),  # a quarter of the pixels is expected to take a quarter of the time
        ({1: 0.3, 2: 0.2}, 4),
        ({1: 5.0, 2: 4.0, 4: 3.0, 8: 2.0, 16: 1.0}, 16),  # nothing helps: the coarsest
        ({1: 0.05, 2: 0.3}, 1),  # an old measure of a heavier scene
        ({4: 0.02}, 2),
        ({4: 0.001}, 2),  # what a draft takes tells nothing about full resolution
    ],
)
def test_pace_takes_the_finest_scale_that_is_fast_enough(cost, scale):
    assert viewport.Pace(dict(cost)).scale() == scale


def test_one_redraw_ends_when_its_time_is_spent(region):
    region.clock.tick = viewport.BUDGET_S
    region.draw()
    assert region.viewport.frame.samples_done == 1
    region.clock.tick = 0.0
    region.draw()
    assert region.viewport.frame.samples_done == 4


def test_redraws_at_rest_work_as_long_as_blender_draws_its_window(region):
    """Up to a limit: with a software GPU, most of the time would be spent on the window otherwise."""
    region.viewport.pace.cost = {1: 1.0, 2: 0.3, 4: 0.06}
    region.rest()
    bpy.context.scene.candela.seed, bpy.context.scene.candela.viewport_samples = 3, 16
    region.clock.tick = viewport.BUDGET_S / 4
    region.draw()
    region.clock.now += 2 * viewport.REST_S

    def redraw(elsewhere):
        region.clock.now += elsewhere
        before = region.clock.now
        region.draw()
        return region.clock.now - before

    region.draw()
    short, long = redraw(0.0), redraw(0.2)
    assert short < 2.5 * viewport.BUDGET_S
    assert 0.15 < long < 2 * viewport.MOST_BUDGET_S


def test_sample_at_rest_is_done_in_parts_and_the_coarse_picture_stays_until_it_has_a_point(region):
    """Each redraw ends after a part; the moved view stays shown until a sample of full resolution has a first point."""
    region.rest()
    region.viewport.pace.cost = {1: 1.0, 2: 0.3, 4: 0.06}
    region.camera = region.moved(0.1)
    coarse = images.read(region.draw())
    region.clock.now += 2 * viewport.REST_S
    region.clock.tick = viewport.BUDGET_S
    redraws, grows = 0, False
    while region.viewport.frame.samples_done == 0 or region.viewport.scale > 1:
        picture = region.draw()
        redraws += 1
        grows = grows or region.viewport.frame.part_done > 0
        if grows:
            assert picture.size == SIZE
        elif region.viewport.frame.samples_done == 0:
            assert np.array_equal(images.read(picture), coarse)
    assert redraws > 3
    assert region.viewport.picture.size == SIZE


def test_light_of_virtual_lights_comes_in_bands_where_a_draft_rests(region, monkeypatch):
    """Each band of the gather takes all of a redraw here: no redraw draws two."""
    region.rest()
    region.viewport.bands = Bands()
    fullscreen, drawn = passes.fullscreen, []

    def slow(program, *arguments, **named):
        fullscreen(program, *arguments, **named)
        if program.name == "instant radiosity":
            region.clock.now += viewport.MOST_BUDGET_S
            drawn.append((region.viewport.scale, named["rows"]))

    monkeypatch.setattr(passes, "fullscreen", slow)
    region.viewport.pace.cost = {1: 10.0, 2: 0.3, 4: 0.06, 8: 0.01}
    region.camera = region.moved(0.1)
    bands = []
    for _ in range(60):
        before = len(drawn)
        region.draw()
        region.clock.now += viewport.REST_S
        bands.append(drawn[before:])
        if region.viewport.scale == 1:
            break
    assert max(map(len, bands)) == 1
    assert len([one for one in drawn if one[0] == 2]) >= 2


def test_picture_between_two_samples_is_the_mean_of_whole_ones(region):
    """A redraw that ends within a sample shows the samples before it, and nothing of its unfinished images."""
    whole = region.rest()
    region.viewport.pace.cost = {1: 1.0, 2: 0.3, 4: 0.06}
    bpy.context.scene.candela.seed, bpy.context.scene.candela.viewport_samples = 3, 16
    region.clock.tick = viewport.BUDGET_S / 8  # a few parts a redraw, of more than one sample
    seen = 0
    for _ in range(60):
        picture = region.draw()
        region.clock.now += viewport.REST_S
        if picture is not None and region.viewport.frame.samples_done > 0 and picture.size == SIZE:
            seen += region.viewport._sample is not None
            np.testing.assert_allclose(images.read(picture)[..., :3].mean(), whole[..., :3].mean(), rtol=0.1)
    assert seen > 2


def test_view_that_is_redrawn_seldom_does_not_rest_between_two_changes(region):
    """Where Blender takes longer than REST_S for its window, a moving view is not taken for one at rest."""
    region.rest()
    for step in range(1, 6):
        region.viewport.pace.cost = {1: 1.0, 2: 0.3, 4: 0.06}
        region.camera = region.moved(0.1)
        region.draw()
        region.clock.now += 1.5 * viewport.REST_S
        region.draw()
        region.clock.now += 1.5 * viewport.REST_S
        assert step == 1 or region.viewport.scale == 4
    for _ in range(3):
        region.draw()
        region.clock.now += 1.5 * viewport.REST_S
    assert region.viewport.scale == 1


def test_view_gets_finer_when_fewer_samples_are_asked_within_one_of_a_draft(region, monkeypatch):
    """Which is not drawn to its end then."""
    region.rest()
    bpy.context.scene.candela.viewport_samples = 64
    region.camera = region.moved(0.1)
    region.clock.tick = viewport.BUDGET_S / 8
    for _ in range(200):
        region.viewport.pace.cost = {16: 0.1, 8: 0.4, 4: 1.0, 2: 3.0, 1: 9.0}
        region.draw()
        if region.viewport.scale == 4:
            monkeypatch.setattr(picture, "REST_S", np.inf)
            if region.viewport.frame.samples_done > 2 and region.viewport._sample is not None:
                break
    monkeypatch.undo()
    assert region.viewport.scale == 4 and region.viewport._sample is not None
    region.clock.tick = 0.0
    bpy.context.scene.candela.viewport_samples = 2
    region.rest()
    assert region.viewport.scale == 1 and region.viewport.frame.settings.samples == 2


def test_draft_of_a_view_that_rests_gets_finer_at_once(region, monkeypatch):
    """Within a sample, too: else all of the draft's samples would be drawn first."""
    region.rest()
    bpy.context.scene.candela.viewport_samples = 64
    region.camera = region.moved(0.1)
    region.clock.tick = viewport.BUDGET_S / 8
    monkeypatch.setattr(picture, "REST_S", np.inf)
    for _ in range(50):
        region.viewport.pace.cost = {8: 0.02, 4: 1.0, 2: 3.0, 1: 9.0}
        region.draw()
        if region.viewport.frame.samples_done and region.viewport._sample is not None:
            break
    draft = region.viewport.frame
    assert region.viewport.scale == 8 and region.viewport._sample is not None
    done = draft.samples_done
    monkeypatch.undo()
    region.clock.tick = 0.0
    region.clock.now += 2 * viewport.REST_S
    region.draw()
    assert region.viewport.scale < 8 and draft.samples_done == done < 64


@pytest.mark.parametrize(("height", "scale"), [(2000, 16), (1024, 16), (1000, 8), (300, 4), (100, 1), (20, 1)])
def test_drafts_keep_64_pixels_from_top_to_bottom(height, scale):
    assert viewport.coarsest_for(height) == scale


def test_setting_of_navigation_and_the_floor_bound_the_scale():
    pace = viewport.Pace({1: 2.0, 2: 0.5, 4: 0.07, 8: 0.02})
    assert [pace.scale(step=0.8 / fps) for fps in (10, 20, 30)] == [4, 8, 8]
    assert pace.scale(step=0.8 / 30, coarsest=2) == 2


def test_picture_at_rest_becomes_finer_step_by_step_where_a_whole_sample_takes_long():
    """Down to full resolution; drafts that are quick anyway are left out."""
    assert viewport.Pace({8: 0.5}).finer(16) == 8
    assert viewport.Pace({1: 20.0, 2: 5.0, 4: 1.2, 8: 0.3}).finer(8) == 4
    assert viewport.Pace({1: 20.0, 2: 0.1, 8: 0.02}).finer(8) == 2
    assert viewport.Pace({1: 20.0, 2: 0.1}).finer(2) == 1
    assert viewport.Pace({1: 0.5, 8: 0.1}).finer(8) == 1


def test_drafts_between_the_first_and_the_whole_picture_are_shown(region):
    """At 1/8, 1/4, 1/2 and in full, each once, where nothing else is known."""
    region.clock.tick = viewport.BUDGET_S / 8
    region.viewport.pace.cost, seen = {8: 0.4, 4: 1.0, 2: 3.0, 1: 9.0}, []
    for _ in range(400):
        shown = region.draw()  # it may begin the next finer one within the same redraw
        region.viewport.pace.cost = {8: 0.4, 4: 1.0, 2: 3.0, 1: 9.0}
        if shown is not None and not region.viewport.looks and SIZE[0] // shown.size[0] not in seen:
            seen.append(SIZE[0] // shown.size[0])
        if region.viewport.scale == 1 and region.viewport.frame.samples_done:
            break
    assert seen[-3:] == [4, 2, 1]


@pytest.fixture
def whole_guides(monkeypatch):
    """Shapes of drafts are found in all pixels, however long that takes."""
    monkeypatch.setattr(GuidePace, "scale", lambda self, pixels, draft, step: 1)


def test_draft_has_the_shapes_of_the_surfaces_that_it_shows(region, whole_guides):
    """A coarse picture, shown in finer pixels: nearer to the whole picture than by its own."""
    whole = region.rest()[..., :3]
    region.viewport.pace.cost = {1: 1.0, 2: 0.3, 4: 0.2, 8: 0.01}
    region.camera = region.moved(1e-4)
    region.draw()
    assert region.viewport.scale == 8 and region.viewport.display.shown.size == SIZE

    def error(picture):
        pixels = images.read(picture)[..., :3]
        fine = pixels.repeat(SIZE[1] // pixels.shape[0], 0).repeat(SIZE[0] // pixels.shape[1], 1)
        return np.abs(fine - whole).mean()

    assert error(region.viewport.display.shown) < 0.8 * error(region.viewport.picture)


@pytest.mark.parametrize("scale", [8, 16])
@pytest.mark.parametrize("shines", ["mesh", "point", "area"])
def test_draft_shows_what_glows_and_is_smaller_than_its_pixels(scene, region, whole_guides, scale, shines):
    """A ball, a lamp and a square of light, of 5 pixels across where those of the draft are 8 and 16: as bright as in
    the whole picture, and no brighter."""
    place = scene.camera.matrix_world @ Vector((-0.4, 0.35, -3.0))
    if shines == "mesh":
        bpy.ops.mesh.primitive_uv_sphere_add(radius=0.05, location=place)
        material = material_named("Glow")
        material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.0, 0.0, 0.0, 1.0)
        material.node_tree.nodes["Principled BSDF"].inputs["Emission Color"].default_value = (1.0, 0.5, 0.2, 1.0)
        material.node_tree.nodes["Principled BSDF"].inputs["Emission Strength"].default_value = 20.0
        bpy.context.object.data.materials.append(material)
    else:
        bpy.ops.object.light_add(type=shines.upper(), location=place)
        bpy.context.object.rotation_euler = (
            scene.camera.rotation_euler[0] + np.pi,
            0.0,
            scene.camera.rotation_euler[2],
        )
        bpy.context.object.visible_camera = True
        lamp = bpy.context.object.data
        lamp.energy = {"point": 2.0, "area": 0.5}[shines]
        if shines == "point":
            lamp.shadow_soft_size = 0.05
        else:
            lamp.size = 0.09
    region.viewport.dirty = True
    whole = region.rest()[..., :3]
    bright = whole.max(axis=-1) > 5.0
    assert 10 <= bright.sum() <= 60
    region.viewport.pace.cost = {1: 1.0, 2: 0.3, 4: 0.2, 8: 0.1 * (scale > 8) + 0.01, 16: 0.01}
    region.viewport.coarsest = scale
    region.camera = region.moved(1e-4)
    region.draw()
    assert region.viewport.scale == scale and region.viewport.display.shown.size == SIZE
    shown = images.read(region.viewport.display.shown)[..., :3]
    np.testing.assert_allclose(shown[bright].mean(axis=0), whole[bright].mean(axis=0), rtol=0.15)
    assert shown.sum() == pytest.approx(whole.sum(), rel=0.15)


def test_draft_of_metal_is_nowhere_brighter_than_its_own_pixels_around(scene, region, whole_guides):
    """What it mirrors does not follow a surface's side towards the lamps, by which diffuse light is drawn finer."""
    metal = material_named("Metal")
    metal.node_tree.nodes["Principled BSDF"].inputs["Metallic"].default_value = 1.0
    for name in ("Cube", "Plane"):
        bpy.data.objects[name].data.materials.append(metal)
    region.viewport.dirty = True
    region.rest()
    region.viewport.pace.cost = {1: 1.0, 2: 0.3, 4: 0.2, 8: 0.01}
    region.camera = region.moved(1e-4)
    region.draw()
    assert region.viewport.scale == 8 and region.viewport.display.shown.size == SIZE
    fine, coarse = (
        images.read(one)[..., :3].max(axis=-1) for one in (region.viewport.display.shown, region.viewport.picture)
    )
    around = np.pad(coarse, 2, mode="edge")
    height, width = coarse.shape
    around = np.max([around[y : y + height, x : x + width] for y in range(5) for x in range(5)], axis=0)
    assert around.max() > 0.0 and (fine < 1.01 * around.repeat(8, axis=0).repeat(8, axis=1) + 1e-3).all()


@pytest.mark.parametrize("metal", [False, True])
def test_single_bright_pixel_of_a_draft_does_not_stand_out_on_metal(scene, region, whole_guides, metal):
    """One of 50 among others of 1: it keeps its light on diffuse surfaces, and its share of white on metal."""
    material = material_named("Floor")
    material.node_tree.nodes["Principled BSDF"].inputs["Metallic"].default_value = float(metal)
    bpy.data.objects["Cube"].hide_render = bpy.data.objects["Cube"].hide_viewport = True
    bpy.data.objects["Plane"].data.materials.append(material)
    region.viewport.dirty = True
    region.rest()
    region.viewport.pace.cost = {1: 1.0, 2: 0.3, 4: 0.2, 8: 0.01}
    region.camera = region.moved(1e-4)
    region.draw()
    pixels = np.ones((SIZE[1] // 8, SIZE[0] // 8, 4), np.float32)
    pixels[3, 5, :3] = 50.0
    fine = images.read(region.viewport.display._guide.refined(images.upload(pixels, "RGBA32F"), 1.0))[..., 0]
    brightest = fine[24:32, 40:48].max()
    assert brightest < 3.0 if metal else brightest > 25.0
    np.testing.assert_allclose(np.median(fine), 1.0, rtol=0.05)


def test_draft_shows_what_glows_behind_a_red_pane_in_red(scene, region, whole_guides):
    """What lets light pass is not in the guide: what shone behind it stood there in full, and white."""
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.3, location=scene.camera.matrix_world @ Vector((0.0, 0.0, -3.0)))
    material = material_named("Glow")
    material.node_tree.nodes["Principled BSDF"].inputs["Emission Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    material.node_tree.nodes["Principled BSDF"].inputs["Emission Strength"].default_value = 20.0
    bpy.context.object.data.materials.append(material)
    bpy.ops.mesh.primitive_plane_add(size=4.0, location=scene.camera.matrix_world @ Vector((0.0, 0.0, -1.0)))
    bpy.context.object.rotation_euler = scene.camera.rotation_euler
    pane = material_named("Pane")
    nodes = pane.node_tree.nodes
    red = nodes.new("ShaderNodeBsdfTransparent")
    red.inputs["Color"].default_value = (0.8, 0.01, 0.01, 1.0)
    pane.node_tree.links.new(red.outputs[0], nodes["Material Output"].inputs["Surface"])
    bpy.context.object.data.materials.append(pane)
    region.viewport.dirty = True
    whole = region.rest()[..., :3]
    bright = whole[..., 0] > 5.0
    assert bright.sum() > 100
    region.viewport.pace.cost = {1: 1.0, 2: 0.3, 4: 0.01}
    region.camera = region.moved(1e-4)
    region.draw()
    assert region.viewport.scale == 4
    shown = images.read(region.viewport.display.shown)[..., :3]
    assert shown[bright].mean(axis=0)[1] < 0.1 * shown[bright].mean(axis=0)[0]
    assert shown.sum() == pytest.approx(whole.sum(), rel=0.2)


def test_draft_shows_how_emission_varies_over_a_surface(scene, region, whole_guides):
    """A floor that glows from 0 on the left to 4 on the right: not in its mean colour everywhere."""
    material = material_named("Screen")
    nodes, links = material.node_tree.nodes, material.node_tree.links
    ramp = nodes.new("ShaderNodeTexGradient")
    links.new(nodes.new("ShaderNodeTexCoord").outputs["Generated"], ramp.inputs["Vector"])
    links.new(ramp.outputs["Color"], nodes["Principled BSDF"].inputs["Emission Color"])
    nodes["Principled BSDF"].inputs["Emission Strength"].default_value = 4.0
    bpy.data.objects["Plane"].data.materials.append(material)
    region.viewport.dirty = True
    whole = region.rest()[..., :3]
    region.viewport.pace.cost = {1: 1.0, 2: 0.3, 4: 0.2, 8: 0.01}
    region.camera = region.moved(1e-4)
    region.draw()
    shown = images.read(region.viewport.display.shown)[..., :3]
    assert np.abs(shown - whole).mean() < 0.25 * np.abs(whole - whole.mean()).mean()


def test_first_sample_is_shown_as_it_grows(region, monkeypatch):
    """Where it has several points of the film: what its sums hold so far, as bright as the whole."""
    bpy.context.scene.candela.viewport_samples = 1
    region.viewport.pace.cost = {1: 10.0, 2: 0.3, 4: 0.06}
    shown, parts = [], []
    take = Viewport._take

    def taking(self, frame):
        take(self, frame)
        if self.scale == 1:
            parts.append(frame.part_done)
            shown.append(images.read(self.picture)[..., :3].mean())

    monkeypatch.setattr(Viewport, "_take", taking)
    region.rest()
    assert len(parts) > 2 and parts[-1] == 0.0 and all(a < b for a, b in itertools.pairwise(parts[:-1]))
    np.testing.assert_allclose(shown, shown[-1], rtol=0.05)
