"""Size, border and filter of the picture."""

import numpy as np
import pytest


def test_film_takes_the_scenes_settings(stage):
    stage.scene.render.filter_size = 2.5
    stage.scene.render.film_transparent = True
    film = stage.take(width=320, height=200).film
    assert (film.width, film.height, film.border) == (320, 200, (0, 0, 320, 200))
    assert film.filter_width == pytest.approx(2.5)
    assert film.transparent is True
    assert film.exposure == 1.0


@pytest.mark.parametrize("low", [(0.25, 0.1), (0.7, 0.3)])  # in double precision .7 of 100 pixels are 69
@pytest.mark.parametrize("size", [(64, 48), (65, 49), (101, 7), (100, 100)])
def test_the_border_is_rounded_down_as_blender_rounds_it(stage, size, low):
    """The size of a bordered result is what Blender saves when it crops: asked by rendering one."""
    import bpy

    width, height = size
    render = stage.scene.render
    render.use_border = render.use_crop_to_border = True
    render.border_min_x, render.border_max_x = low[0], 0.8
    render.border_min_y, render.border_max_y = low[1], 0.55
    render.resolution_x, render.resolution_y = size
    stage.camera()
    sizes = []

    class Engine(bpy.types.RenderEngine):
        bl_idname = "SNAPSHOT_FILM_TEST"
        bl_label = "Snapshot test"

        def render(self, depsgraph):
            result = self.begin_result(0, 0, self.resolution_x, self.resolution_y)
            sizes.append((result.resolution_x, result.resolution_y))
            self.end_result(result)

    bpy.utils.register_class(Engine)
    try:
        render.engine = Engine.bl_idname
        bpy.ops.render.render()
    finally:
        bpy.utils.unregister_class(Engine)
    film = stage.take(width=width, height=height).film
    assert film.border_size == sizes[0]
    assert film.border[:2] == tuple(int(np.float32(share) * np.float32(n)) for share, n in zip(low, size))


def test_a_border_of_the_caller_wins(stage):
    stage.scene.render.use_border = True
    assert stage.take(border=(1, 2, 30, 40)).film.border == (1, 2, 30, 40)


def test_a_border_without_width_keeps_a_pixel(stage):
    render = stage.scene.render
    render.use_border = True
    render.border_min_x = render.border_max_x = render.border_min_y = render.border_max_y = 1.0
    assert stage.take(width=64, height=48).film.border == (63, 47, 64, 48)


def test_the_snapshot_names_its_scene_and_says_what_it_cost(stage):
    stage.link("O", stage.mesh())
    snapshot = stage.take()
    assert snapshot.scene_name == stage.scene.name
    assert snapshot.sync_stats["meshes_read"] == 1
    assert snapshot.sync_stats["seconds"] > 0


@pytest.mark.parametrize("setting", ["use_camera_cull", "use_distance_cull"])
def test_culling_of_simplify_is_said_to_be_left_out(stage, setting):
    setattr(stage.scene.cycles, setting, True)
    assert not stage.take().notes
    stage.scene.render.use_simplify = True
    assert [note.subject for note in stage.take().notes] == ["Simplify"]
