"""Blender's side of the viewport: the engine's callbacks with a stand-in for what only a window has."""

import time
from types import SimpleNamespace

import bpy
import gpu
import numpy as np
import pytest
from mathutils import Matrix

from addon import viewport
from addon.gfx import context, images
from addon.viewport import chosen
from tests.viewport.region import SIZE


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
        self.target.clear()  # pictures are blended over what Blender has drawn there

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

    def draw_sample(self, made):
        """Redraw until samples are told of: programs that are not there yet come in one after the other."""
        for _ in range(50):
            pixels = self.draw(made)
            if made.stats.startswith("Sample"):
                break
        return pixels


@pytest.fixture
def window(scene):
    scene.candela.viewport_samples = 2
    yield Window(scene)
    viewport.free_all()


@pytest.mark.slow
def test_region_is_redrawn_until_it_is_complete(window):
    made = Engine()
    window.update(made)
    started = time.monotonic()
    while time.monotonic() - started < 120:  # programs are compiled meanwhile
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
    window.draw_sample(made)
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


def test_error_of_one_view_ends_with_another(window, monkeypatch):
    made = Engine()
    window.update(made)
    monkeypatch.setattr(viewport, "take", lambda *_, **__: 1 / 0)
    window.draw(made)
    assert "division by zero" in made.stats
    monkeypatch.undo()
    window.region_data.view_perspective, window.space_data.use_render_border = "PERSP", False
    window.space_data.clip_start, window.space_data.clip_end = 0.1, 100.0
    window.draw_sample(made)
    assert made.stats.startswith("Sample")


def test_what_the_region_hides_is_asked_for_and_starts_anew(window, monkeypatch):
    asked = []
    monkeypatch.setattr(viewport, "take", lambda *_, shown, **__: asked.append(shown) or 1 / 0)
    made = Engine()
    for hide in (False, True):
        window.space_data.show_object_viewport_light = not hide
        window.update(made)
        window.draw(made)
    assert asked[0] is None and asked[1] is not None


def test_objects_of_a_collection_whose_eye_is_closed_are_left_out(window):
    """Blender lists them in the evaluated scene nevertheless, and asks each space whether it shows them."""
    screens = (area for screen in bpy.data.screens for area in screen.areas)
    window.space_data = next(area.spaces.active for area in screens if area.type == "VIEW_3D")
    cube, layer = bpy.data.objects["Cube"], window.scene.view_layers[0]
    things = bpy.data.collections.new("Things")
    window.scene.collection.children.link(things)
    for one in tuple(cube.users_collection):
        one.objects.unlink(cube)
    things.objects.link(cube)
    made, seen = Engine(), []
    for closed in (False, True, False):
        layer.layer_collection.children["Things"].hide_viewport = closed
        layer.update()
        window.update(made)
        window.draw(made)
        (kept,) = viewport._viewports.values()
        seen.append(len(kept._snapshot.instances))
    assert seen == [seen[0], seen[0] - 1, seen[0]]


def test_what_is_compiled_ahead_is_what_the_region_would_show(window):
    """Through the scene's camera, with its lens, and without shadow catchers."""
    window.scene.camera.data.dof.use_dof = True
    window.scene.camera.data.clip_end = 77.0
    bpy.data.objects["Cube"].is_shadow_catcher = True
    window.region.type, window.space_data.region_3d = "WINDOW", window.region_data
    area = type("Area", (), {"regions": [window.region], "spaces": type("Spaces", (), {"active": window.space_data})})
    foreseen, settings = chosen._shown_in(area, bpy.context.evaluated_depsgraph_get())
    made = Engine()
    window.update(made)
    window.draw(made)
    (kept,) = viewport._viewports.values()
    shown = kept.frame.snapshot
    assert foreseen.camera.clip_end == 77.0 and foreseen.camera.aperture == shown.camera.aperture is not None
    assert [one.visibility for one in foreseen.instances] == [one.visibility for one in shown.instances]
    assert settings.shows == kept.frame.settings.shows and foreseen.film.transparent == shown.film.transparent


def test_pixel_size_of_blender_is_followed(window):
    window.scene.render.preview_pixel_size = "4"
    made = Engine()
    window.update(made)
    window.draw(made)
    (kept,) = viewport._viewports.values()
    assert kept.display.shown.size == (SIZE[0] // 4, SIZE[1] // 4) or kept.scale > 1
    assert kept.display.place == (0, 0, SIZE[0] // 4, SIZE[1] // 4)
    assert viewport.pixel_size("AUTO") in (1, 2) and viewport.pixel_size("8") == 8


def test_an_image_that_a_script_has_painted_is_read_with_the_next_redraw(window, monkeypatch):
    """Blender calls no `view_update` for it."""
    window.scene.candela.bounces, window.scene.candela.viewport_samples = 0, 1
    image = bpy.data.images.new("Painted", 4, 4)
    image.pixels.foreach_set(np.zeros(64, np.float32))
    material = bpy.data.materials.new("Painted")
    if bpy.app.version < (5, 0):
        material.use_nodes = True
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    shader = next(one for one in material.node_tree.nodes if one.type == "BSDF_PRINCIPLED")
    material.node_tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
    bpy.data.objects["Cube"].active_material = material
    made, brightest = Engine(), []
    window.update(made)
    for value in (0.0, 1.0):
        image.pixels.foreach_set(np.full(64, value, np.float32))
        for _ in range(200):  # programs may still be compiled
            window.draw(made)
            (kept,) = viewport._viewports.values()
            if kept.settled:
                break
        kept.images_again = 0.0
        window.draw(made)
        brightest.append(max(one.pixels[..., 0].max() for one in kept._snapshot.images.values()))
    assert brightest[0] == 0 and brightest[1] > 0
    later = []
    monkeypatch.setattr(viewport, "bpy", SimpleNamespace(
        data=bpy.data, context=bpy.context, types=bpy.types,
        app=SimpleNamespace(timers=SimpleNamespace(
            register=lambda look, first_interval: later.append((look, first_interval)), is_registered=lambda _: True,
            unregister=lambda _: None,
        )),
    ))  # fmt: skip
    for _ in range(200):
        window.draw(made)
        if kept.settled:
            break
    image.pixels.foreach_set(np.full(64, 0.5, np.float32))
    later.clear()
    kept.looks_later, kept.images_again = False, time.monotonic() + 100.0
    window.draw(made)  # too soon after the last look
    window.draw(made)
    ((look, seconds),) = later
    assert 90.0 < seconds <= 100.0
    made.redraws = 0
    look()
    assert made.redraws == 1


def test_no_timer_of_a_viewport_outlives_it_nor_are_images_asked_in_each_redraw(window, monkeypatch):
    made, asked = Engine(), []
    window.scene.candela.bounces, window.scene.candela.viewport_samples = 0, 1
    monkeypatch.setattr(viewport, "_shows_unsaved", lambda one: asked.append(one) or False)
    window.update(made)
    for _ in range(200):
        window.draw(made)
        (kept,) = viewport._viewports.values()
        if kept.settled:
            break
    kept.images_again = 0.0
    for _ in range(3):
        window.draw(made)
    assert not asked and not kept.looks_later  # no image is shown: nothing is looked for, and the viewport rests
    kept.cache.images["shown"] = None
    for _ in range(3):
        window.draw(made)
    assert len(asked) == 1 and kept.looks_later
    kept.held = True
    viewport._redraw_soon(kept)
    timers = kept.timers
    assert len(timers) == 2 and all(map(bpy.app.timers.is_registered, timers))
    viewport.free_all()
    assert not any(map(bpy.app.timers.is_registered, timers))
