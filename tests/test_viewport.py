"""The viewport without a window: its picture against the final render; when it is coarse, fine, or not drawn at all."""

import time
import warnings
from dataclasses import replace

import bpy
import gpu
import numpy as np
import pytest
from mathutils import Matrix

from addon import engine, viewport
from addon.frame import ledger
from addon.frame.bands import Bands
from addon.gfx import context, images
from addon.snapshot import camera_of_scene, camera_of_view, take
from addon.ui import ENGINE
from addon.ui.properties import settings_of

SIZE = (96, 64)


class Clock:
    """Time that only passes when it is told to, plus a little with each look."""

    def __init__(self, tick=0.0):
        self.now, self.tick = 100.0, tick

    def __call__(self):
        self.now += self.tick
        return self.now


class Region:
    """A viewport over the scene of the test, as Blender's 3D region would ask for it."""

    def __init__(self, samples=4):
        self.viewport = viewport.Viewport()
        self.clock = Clock()
        self.reads = 0
        bpy.context.scene.candela.viewport_samples = samples
        self.camera = camera_of_scene(bpy.context.scene, self.depsgraph, *SIZE)

    @property
    def depsgraph(self):
        graph = bpy.context.evaluated_depsgraph_get()
        graph.update()
        return graph

    def source(self, camera, width, height):
        self.reads += 1
        return take(self.depsgraph, self.viewport.cache, width, height, view=camera)

    def draw(self, camera=None, size=SIZE):
        settings = settings_of(bpy.context.scene, viewport=True)
        return self.viewport.draw_frame(self.source, camera or self.camera, size, settings, self.clock)

    def rest(self):
        """Redraw until nothing is left to be done; the picture's pixels, (H, W, 4)."""
        self.draw()
        self.clock.now += 2 * viewport.REST_S
        for _ in range(100):
            picture = self.draw()
            if self.viewport.done:
                return images.read(picture)
        raise AssertionError("the viewport never comes to rest")

    def moved(self, distance):
        matrix = self.camera.matrix.copy()
        matrix[0, 3] += distance
        return replace(self.camera, matrix=matrix)


@pytest.fixture
def scene(registered, gpu_context, empty_scene):
    """A cube on a floor under a lamp, seen by a camera."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        bpy.ops.mesh.primitive_plane_add(size=8)
        bpy.ops.mesh.primitive_cube_add(size=1.5, location=(0, 0, 0.75))
        bpy.ops.object.light_add(type="POINT", location=(2, -2, 4))
        bpy.context.object.data.energy = 400
        bpy.context.object.data.shadow_soft_size = 0.3
        bpy.ops.object.camera_add(location=(4, -5, 4), rotation=(0.95, 0, 0.67))
        empty_scene.camera = bpy.context.object
        empty_scene.render.engine = ENGINE
        yield empty_scene
    engine.free_sessions()


@pytest.fixture
def region(scene):
    made = Region()
    yield made
    made.viewport.release()


def final_picture(scene, tmp_path, samples):
    """The final render in scene-linear values, (H, W, 4), bottom row first."""
    scene.candela.samples = samples
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = 100
    settings = scene.render.image_settings
    settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGBA", "32"
    scene.render.filepath = str(tmp_path / "final.exr")
    bpy.ops.render.render(write_still=True)
    loaded = bpy.data.images.load(scene.render.filepath)
    pixels = np.array(loaded.pixels[:], np.float32).reshape(SIZE[1], SIZE[0], 4)
    bpy.data.images.remove(loaded)
    return pixels


def displayed(pixels):
    """0…255 as a display without a look shows it."""
    return 255 * np.clip(pixels[..., :3], 0, 1) ** (1 / 2.2)


def test_picture_at_rest_is_the_final_render(scene, region, tmp_path):
    scene.candela.light_probes_maps = 0  # a view shows every sample: one point per light in each
    shown = region.rest()
    final = final_picture(scene, tmp_path, samples=4)
    assert final[..., :3].std() > 0.01
    difference = np.abs(displayed(shown) - displayed(final)).max(axis=-1)
    assert (difference <= 2).mean() >= 0.99


def test_view_matrices_give_the_picture_of_the_camera(scene, region):
    """What Blender hands to view_draw in camera view leads to the same picture as the camera itself."""

    class RegionData:
        is_perspective = True
        view_matrix = scene.camera.matrix_world.inverted()
        window_matrix = scene.camera.calc_matrix_camera(region.depsgraph, x=SIZE[0], y=SIZE[1])

    by_camera = region.rest()
    region.camera = camera_of_view(RegionData, None, scene.camera)
    difference = np.abs(displayed(region.rest()) - displayed(by_camera)).max(axis=-1)
    assert (difference <= 2).mean() >= 0.99


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


def test_sample_at_rest_is_done_in_parts_and_the_coarse_picture_stays_until_it_is_whole(region):
    """Each redraw ends after a part; while samples of full resolution are being made, the moved view stays shown."""
    region.rest()
    region.viewport.pace.cost = {1: 1.0, 2: 0.3, 4: 0.06}
    region.camera = region.moved(0.1)
    coarse = images.read(region.draw())
    region.clock.now += 2 * viewport.REST_S
    region.clock.tick = viewport.BUDGET_S
    redraws = 0
    while region.viewport.frame.samples_done == 0 or region.viewport.scale > 1:
        picture = region.draw()
        redraws += 1
        if region.viewport.frame.samples_done == 0:
            assert np.array_equal(images.read(picture), coarse)
    assert redraws > 3
    assert region.viewport.picture.size == SIZE


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


def test_bands_change_no_pixel(region):
    class Thin(Bands):
        def learn(self, seconds, wanted):
            self._rows = dict.fromkeys(("direct_light", "environment_light", "instant_radiosity"), 5)

    class Whole(Bands):
        def split(self, name, height):
            yield 0, height

    region.viewport.bands = Whole()
    whole = region.rest()
    region.viewport.bands = Thin()
    region.draw(region.moved(0.1))
    assert np.array_equal(region.rest(), whole)


def test_sample_that_was_left_unfinished_is_not_continued_from(scene, region):
    whole = region.rest()
    region.viewport.renderer.begin(replace(region.viewport.frame.snapshot), replace(region.viewport.frame.settings))
    frame = region.viewport.frame
    parts = region.viewport.renderer.steps(frame)
    next(parts), next(parts), next(parts)
    parts.close()
    region.viewport.dirty = True
    assert np.array_equal(region.rest(), whole)
    assert region.viewport.frame is not frame


@pytest.mark.parametrize("scale", [1, 4])
def test_only_the_border_is_drawn(scene, region, scale):
    scene.candela.bounces = 0  # which lights stand for indirect light follows from what the picture shows
    whole = region.rest()
    border = (24, 16, 72, 40)
    settings = settings_of(bpy.context.scene, viewport=True)
    if scale > 1:
        region.viewport.pace.cost = {1: 1.0, 2: 0.3, 4: 0.06}
    else:
        region.viewport.pace.cost = {1: 0.01}
    for _ in range(1 if scale > 1 else 20):
        picture = region.viewport.draw_frame(region.source, region.camera, SIZE, settings, region.clock, border)
    assert region.viewport.place == (24, 16, 48, 24)
    assert picture.size == (48 // scale, 24 // scale)
    if scale == 1:
        difference = np.abs(displayed(images.read(picture)) - displayed(whole[16:40, 24:72])).max(axis=-1)
        assert (difference <= 2).mean() >= 0.99


def test_border_of_the_camera_lies_in_its_frame(scene, region):
    """A region twice as wide as the camera's frame shows the frame in its middle."""
    scene.render.resolution_x, scene.render.resolution_y = 100, 100
    scene.render.use_border = True
    scene.render.border_min_x, scene.render.border_max_x = 0.0, 0.5
    scene.render.border_min_y, scene.render.border_max_y = 0.25, 1.0
    camera = camera_of_scene(scene, region.depsgraph, 100, 100)
    left, right, bottom, top = camera.frame
    wide = replace(camera, frame=(2 * left, 2 * right, bottom, top))
    assert viewport.render_border(region.depsgraph, None, wide, scene.camera, (400, 200)) == (100, 50, 200, 200)


def test_nothing_is_done_at_rest(region):
    region.rest()
    frame, uploads = region.viewport.frame, region.viewport.renderer.geometry.uploads
    before = region.reads
    for _ in range(3):
        region.draw()
    assert region.viewport.frame is frame and frame.samples_done == 4
    assert (region.reads, region.viewport.renderer.geometry.uploads) == (before, uploads)


def test_moving_the_view_reads_and_uploads_nothing(region):
    region.rest()
    before = region.reads, region.viewport.renderer.geometry.uploads
    for step in range(5):
        region.draw(region.moved(0.01 * step))
    assert (region.reads, region.viewport.renderer.geometry.uploads) == before


def test_update_that_changes_nothing_keeps_the_samples(region):
    region.rest()
    frame = region.viewport.frame
    region.viewport.dirty = True
    region.draw()
    assert region.viewport.frame is frame and region.viewport.done


def test_moved_object_starts_anew_and_uploads_no_mesh(scene, region):
    before = region.rest()
    uploads = region.viewport.renderer.geometry.uploads
    bpy.data.objects["Cube"].location.x += 0.5
    region.viewport.dirty = True
    after = region.rest()
    assert np.abs(after - before).max() > 0.05
    assert region.viewport.renderer.geometry.uploads == uploads


def test_draft_after_a_move_is_that_of_a_new_viewport(scene, region):
    """Its rays search a tree that was refitted, and its maps are drawn of what is kept for a moving view."""
    scene.candela.bounces = 2
    for k in range(4):
        bpy.ops.mesh.primitive_torus_add(location=(k - 1.5, -1.5, 0.5), major_segments=12, minor_segments=6)
    region.rest()
    for height in (0.4, 0.8):
        bpy.data.objects["Cube"].location.z += height
        region.viewport.dirty = True
        picture = images.read(region.draw())
    assert region.viewport.scale > 1
    other = Region()
    other.viewport.scale, other.viewport.pace = region.viewport.scale, region.viewport.pace
    fresh = images.read(other.draw())
    other.viewport.release()
    assert np.isclose(picture, fresh, rtol=1e-3, atol=1e-4).all(axis=-1).mean() > 0.98


def test_more_samples_continue_where_it_rested(scene, region):
    region.rest()
    frame = region.viewport.frame
    scene.candela.viewport_samples = 6
    region.rest()
    assert region.viewport.frame is frame and frame.samples_done == 6


def test_ledger_is_published_at_rest(region):
    region.rest()
    assert ledger.latest().samples == 4
    assert ledger.latest().row("surfaces").state == ledger.RAN


def test_viewports_do_not_share_samples(scene, region):
    other = Region()
    region.rest()
    other.camera = other.moved(1.0)
    there = other.rest()
    assert np.array_equal(images.read(region.draw()), region.rest())
    assert np.abs(there - region.rest()).max() > 0.05
    other.viewport.release()


def test_resizing_leaves_no_images_behind(region):
    region.rest()
    region.draw(size=(64, 64))
    region.rest()
    allocated = images.pool.allocated_bytes
    for width in range(70, 90, 5):
        region.draw(size=(width, 64))
    region.rest()
    assert images.pool.allocated_bytes <= allocated


def test_released_viewport_holds_no_image(scene):
    images.pool.trim()
    before = images.pool.allocated_bytes
    made = Region()
    made.rest()
    assert images.pool.allocated_bytes > before
    made.viewport.release()
    images.pool.trim()
    assert images.pool.allocated_bytes == before


# Blender's side: the engine's callbacks with a stand-in for what only a window has ------------------------------------


class Engine:
    """What view_update and view_draw use of a RenderEngine."""

    def __init__(self):
        self.stats, self.reports, self.redraws = "", [], 0

    def tag_redraw(self):
        self.redraws += 1

    def update_stats(self, _name, text):
        self.stats = text

    def report(self, kinds, text):
        self.reports.append((kinds, text))

    def bind_display_space_shader(self, scene):
        pass

    def unbind_display_space_shader(self):
        pass


class Window:
    """A context with one 3D region that looks through the scene's camera."""

    def __init__(self, scene):
        self.scene, self.size = scene, SIZE
        graph = bpy.context.evaluated_depsgraph_get()
        self.region = type("Region", (), {"width": SIZE[0], "height": SIZE[1], "as_pointer": lambda _: id(self)})()
        self.space_data = type("Space", (), {"local_view": None, "use_local_camera": False, "camera": None})()
        self.region_data = type("RegionData", (), {})()
        self.region_data.view_perspective, self.region_data.is_perspective = "CAMERA", True
        self.region_data.view_matrix = scene.camera.matrix_world.inverted()
        self.region_data.window_matrix = scene.camera.calc_matrix_camera(graph, x=SIZE[0], y=SIZE[1])
        self.screen = type("Screen", (), {"areas": ()})()
        self.target = images.Target((images.create(*SIZE, "RGBA32F"),))

    def update(self, made):
        viewport.changed(made, self, bpy.context.evaluated_depsgraph_get())

    def draw(self, made):
        to_pixels = Matrix.Translation((-1, -1, 0)) @ Matrix.Diagonal((2 / SIZE[0], 2 / SIZE[1], 1, 1))
        with self.target.framebuffer.bind(), gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
            gpu.matrix.load_identity()
            gpu.matrix.load_projection_matrix(to_pixels)
            viewport.draw(made, self, bpy.context.evaluated_depsgraph_get())
            assert gpu.state.active_framebuffer_get() == self.target.framebuffer
            assert tuple(gpu.state.viewport_get()) == (0, 0, *SIZE)
            assert gpu.state.blend_get() == "NONE"
        return images.read(self.target.colors[0])


@pytest.fixture
def window(scene):
    scene.candela.viewport_samples = 2
    yield Window(scene)
    viewport.free_all()


def test_region_is_redrawn_until_it_is_complete(window):
    made = Engine()
    window.update(made)
    started = time.monotonic()
    while time.monotonic() - started < 30:
        before = made.redraws
        pixels = window.draw(made)
        if made.redraws == before:
            break
    assert made.stats.startswith("Sample 2 of 2")
    assert not made.reports
    (kept,) = viewport._viewports.values()
    assert np.allclose(pixels, images.read(kept.picture), atol=1e-5)
    assert pixels[..., :3].std() > 0.01


def test_update_draws_nothing(window):
    window.update(Engine())
    (kept,) = viewport._viewports.values()
    assert kept.frame is None and kept.picture is None and kept.dirty


def test_error_is_told_once_and_ends_with_the_next_change(window, monkeypatch):
    made = Engine()
    window.update(made)
    asked = made.redraws  # by the change
    monkeypatch.setattr(viewport, "take", lambda *_, **__: 1 / 0)
    for _ in range(3):
        window.draw(made)
    assert "division by zero" in made.stats
    assert len(made.reports) == 1 and made.redraws == asked
    monkeypatch.undo()
    window.update(made)
    window.draw(made)
    assert made.stats.startswith("Sample")


def test_new_engine_instance_takes_the_samples_over(window):
    first, second = Engine(), Engine()
    window.update(first)
    window.draw(first)
    (kept,) = viewport._viewports.values()
    frame = kept.frame
    window.update(second)
    window.draw(second)
    assert list(viewport._viewports.values()) == [kept]
    assert kept.frame is frame


def test_viewport_without_an_engine_is_freed_by_the_timer(window):
    made = Engine()
    window.update(made)
    window.draw(made)
    viewport._free_orphans()
    assert viewport._viewports
    del made
    assert bpy.app.timers.is_registered(viewport._free_orphans)
    assert viewport._free_orphans() is None
    assert not viewport._viewports


def test_region_shows_its_picture_while_another_renders(window):
    made = Engine()
    window.update(made)
    window.draw(made)
    with context.turn:
        before = made.redraws
        pixels = window.draw(made)
    assert made.redraws > before
    assert pixels[..., :3].std() > 0.01
