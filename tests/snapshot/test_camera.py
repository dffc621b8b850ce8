"""The frustum is the one of Blender's own projection matrix, at every fit, shift and clip distance."""

from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mathutils import Euler, Matrix, Vector

from addon.snapshot import UnsupportedScene, camera_of_scene, camera_of_view
from addon.snapshot.camera import panoramic_view
from addon.snapshot.scene import Aperture


def projection(camera):
    """Blender's window matrix, float64, from a Camera: what calc_matrix_camera builds."""
    left, right, bottom, top = camera.frame
    near, far = camera.clip_start, camera.clip_end
    matrix = np.zeros((4, 4))
    if camera.kind == "PERSPECTIVE":
        matrix[0, 0], matrix[1, 1] = 2 / (right - left), 2 / (top - bottom)
        matrix[0, 2], matrix[1, 2] = (right + left) / (right - left), (top + bottom) / (top - bottom)
        matrix[2, 2], matrix[2, 3] = -(far + near) / (far - near), -2 * far * near / (far - near)
        matrix[3, 2] = -1
    else:
        matrix[0, 0], matrix[1, 1] = 2 / (right - left), 2 / (top - bottom)
        matrix[0, 3], matrix[1, 3] = -(right + left) / (right - left), -(top + bottom) / (top - bottom)
        matrix[2, 2], matrix[2, 3] = -2 / (far - near), -(far + near) / (far - near)
        matrix[3, 3] = 1
    return matrix


def made(stage, width, height):
    graph = stage.depsgraph()
    return camera_of_scene(graph.scene_eval, graph, width, height)


def blenders(stage, width, height):
    render, graph = stage.scene.render, stage.depsgraph()
    camera = stage.scene.camera.evaluated_get(graph)
    scale = {"scale_x": render.pixel_aspect_x, "scale_y": render.pixel_aspect_y}
    return np.array(camera.calc_matrix_camera(graph, x=width, y=height, **scale))


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
@pytest.mark.parametrize("fit", ["AUTO", "HORIZONTAL", "VERTICAL"])
@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_frame_is_that_of_blenders_matrix(stage, kind, fit, data):
    def number(low, high):
        return data.draw(st.floats(low, high, width=32))

    lens = (stage.scene.camera or stage.camera()).data
    lens.type, lens.sensor_fit = kind, fit
    lens.lens, lens.ortho_scale = number(5, 500), number(0.125, 100)
    lens.sensor_width, lens.sensor_height = number(1, 100), number(1, 100)
    lens.shift_x, lens.shift_y = number(-2, 2), number(-2, 2)
    stage.scene.render.pixel_aspect_x, stage.scene.render.pixel_aspect_y = number(1, 3), number(1, 3)
    # Narrower pictures with a shift leave too few digits in Blender's float32 matrix to compare with.
    width, height = data.draw(st.integers(64, 4000)), data.draw(st.integers(64, 4000))
    ours, theirs = projection(made(stage, width, height)), blenders(stage, width, height)
    assert np.allclose(ours, theirs, rtol=2e-4, atol=2e-4)


@pytest.mark.parametrize("clip", [(1e-9, 1e12), (1e-9, 10.0), (0.1, 1e12)])
def test_extreme_clip_distances_leave_the_frame_exact(stage, clip):
    lens = stage.camera().data
    lens.lens, lens.sensor_width = 50.0, 36.0
    lens.clip_start, lens.clip_end = clip
    camera = made(stage, 640, 360)
    assert camera.frame == pytest.approx((-0.36, 0.36, -0.2025, 0.2025), rel=1e-12)
    # RNA clamps the near distance; what it says is what we give.
    assert (camera.clip_start, camera.clip_end) == (lens.clip_start, lens.clip_end)


def test_matrix_is_the_objects_without_scale(stage):
    turned = Euler((0.3, -1.0, 2.0)).to_matrix().to_4x4()
    stage.camera().matrix_world = Matrix.Translation((1, 2, 3)) @ turned @ Matrix.Diagonal((2, 3, 4, 1))
    matrix = made(stage, 8, 8).matrix
    assert np.allclose(matrix[:3, :3], np.array(turned)[:3, :3], atol=1e-6)
    assert matrix[:, 3].tolist() == [1, 2, 3, 1]


@pytest.mark.parametrize("scale", [(0, 0, 0), (1, 0, 1), (-1, 1, 1)])
def test_degenerate_camera_matrices_stay_rigid(stage, scale):
    stage.camera().scale = scale
    axes = made(stage, 8, 8).matrix[:3, :3]
    assert np.allclose(axes.T @ axes, np.eye(3), atol=1e-6)


def test_the_projection_of_a_panoramic_camera_is_read(stage):
    lens = stage.camera("Dome").data
    lens.type, lens.panorama_type, lens.fisheye_fov, lens.fisheye_lens = "PANO", "FISHEYE_EQUISOLID", 3.0, 8.0
    lens.sensor_width = 30.0
    camera = made(stage, 64, 48)
    assert camera.kind == "PANORAMIC"
    assert camera.panorama.projection == "FISHEYE_EQUISOLID"
    assert camera.panorama.values == pytest.approx((3.0, 8.0, 30.0, 22.5))
    lens.panorama_type, lens.longitude_min, lens.latitude_max = "EQUIRECTANGULAR", -1.0, 0.5
    assert made(stage, 64, 48).panorama.values == pytest.approx((-1.0, np.pi, -np.pi / 2, 0.5))


def test_a_viewport_shows_the_panorama_in_the_cameras_frame(stage):
    """Here the region is the frame, and then one of twice its size."""
    placed, depsgraph = stage.camera("Dome"), bpy.context.evaluated_depsgraph_get()
    window = placed.calc_matrix_camera(depsgraph, x=stage.scene.render.resolution_x, y=stage.scene.render.resolution_y)
    placed.data.type, placed.data.panorama_type = "PANO", "EQUIRECTANGULAR"
    for scale, expected in ((1.0, (0.0, 0.0, 1.0, 1.0)), (0.5, (-0.5, -0.5, 1.5, 1.5))):
        seen = camera_of_view(
            view_of(placed.matrix_world.inverted(), Matrix.Diagonal((scale, scale, 1, 1)) @ window, True)
        )
        shown = panoramic_view(seen, stage.scene, bpy.context.evaluated_depsgraph_get(), placed, (64, 36))
        assert shown.panorama.window == pytest.approx(expected, abs=1e-5)
        assert shown.frame[1] - shown.frame[0] == pytest.approx(np.pi * 2**0.25 * 4 / 3 / scale, rel=0.03)


def test_lenses_that_are_programs_are_refused_with_a_sentence(stage):
    stage.camera("Dome").data.type = "CUSTOM"
    with pytest.raises(UnsupportedScene, match=r"Camera 'Dome'.*OSL.*Perspective"):
        stage.take()


def test_a_scene_without_camera_is_refused_with_a_sentence(stage):
    with pytest.raises(UnsupportedScene, match="has no camera"):
        made(stage, 8, 8)


def test_a_view_needs_no_scene_camera(stage):
    view = camera_of_view(view_of(np.eye(4), np.eye(4), perspective=False))
    assert stage.take(view=view).camera is view


def test_another_camera_may_be_chosen(stage):
    stage.camera("Main")
    other = stage.link("Other", bpy.data.cameras.new("Other"))
    assert stage.take(camera=other).camera.name == "Other"


def test_the_aperture_comes_from_focal_length_and_f_stop(stage):
    lens = stage.camera().data
    lens.lens, dof = 80.0, lens.dof
    assert stage.take().camera.aperture is None
    dof.use_dof, dof.aperture_fstop, dof.focus_distance = True, 4.0, 3.0
    dof.aperture_blades, dof.aperture_rotation, dof.aperture_ratio = 6, 0.25, 2.0
    assert stage.take().camera.aperture == Aperture(pytest.approx(0.01), 3.0, 6, 0.25, 2.0)


def test_the_focus_is_measured_along_the_view_axis(stage):
    placed = stage.camera()
    placed.location = (1, 2, 3)
    placed.data.dof.use_dof = True
    placed.data.dof.focus_object = stage.link("Target", None)
    placed.data.dof.focus_object.location = (9, 9, -4)
    assert stage.take().camera.aperture.focus == pytest.approx(7.0)


def test_a_focus_at_the_eye_blurs_nothing(stage):
    dof = stage.camera().data.dof
    dof.use_dof, dof.focus_distance = True, 0.0
    assert stage.take().camera.aperture is None


def test_an_orthographic_aperture_has_no_focal_length(stage):
    lens = stage.camera().data
    lens.type, lens.dof.use_dof, lens.dof.aperture_fstop = "ORTHO", True, 4.0
    assert stage.take().camera.aperture.radius == pytest.approx(1 / 8)


def view_of(view, window, perspective):
    return SimpleNamespace(view_matrix=Matrix(view), window_matrix=Matrix(window), is_perspective=perspective)


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_a_viewport_with_the_cameras_matrices_sees_what_the_camera_sees(stage, kind):
    placed = stage.camera()
    lens = placed.data
    lens.type, lens.shift_x, lens.shift_y, lens.clip_start, lens.clip_end = kind, 0.3, -0.2, 0.5, 50.0
    placed.matrix_world = Matrix.Translation((1, 2, 3)) @ Euler((0.3, -1.0, 2.0)).to_matrix().to_4x4()
    expected = made(stage, 640, 360)
    window = blenders(stage, 640, 360)
    found = camera_of_view(view_of(placed.matrix_world.inverted(), window, kind == "PERSP"))
    assert found.kind == expected.kind
    assert found.frame == pytest.approx(expected.frame, rel=1e-5)
    assert np.allclose(found.matrix, expected.matrix, atol=1e-6)
    assert (found.clip_start, found.clip_end) == pytest.approx((0.5, 50.0), rel=1e-3)


def test_clip_distances_of_a_viewport_come_from_the_space_where_the_matrix_has_lost_them():
    window = projection(SimpleNamespace(kind="PERSPECTIVE", frame=(-1, 1, -1, 1), clip_start=1e-6, clip_end=1e9))
    space = SimpleNamespace(clip_start=1e-6, clip_end=1e9)
    found = camera_of_view(view_of(np.eye(4), window, True), space)
    assert (found.clip_start, found.clip_end) == (1e-6, 1e9)
    assert np.isfinite(camera_of_view(view_of(np.eye(4), window, True)).clip_end)


def test_an_orthographic_viewport_that_sees_behind_itself_steps_back():
    behind = SimpleNamespace(kind="ORTHOGRAPHIC", frame=(-2, 2, -1, 1), clip_start=-100.0, clip_end=100.0)
    found = camera_of_view(view_of(np.eye(4), projection(behind), False))
    assert found.clip_start == 0.0
    assert found.clip_end == pytest.approx(200.0)
    assert found.matrix[:3, 3] == pytest.approx([0, 0, 100])
    assert found.frame == pytest.approx((-2, 2, -1, 1))


def test_a_point_lands_where_blender_says(stage):
    from bpy_extras.object_utils import world_to_camera_view

    placed = stage.camera()
    placed.matrix_world = Matrix.Translation((1, -4, 2)) @ Euler((1.2, 0.1, 0.2)).to_matrix().to_4x4()
    stage.scene.render.resolution_x, stage.scene.render.resolution_y = 640, 360
    stage.depsgraph()
    camera = made(stage, 640, 360)
    point = Vector((0.3, 0.2, 0.1))
    x, y, depth, _ = np.linalg.inv(camera.matrix) @ (*point, 1.0)
    left, right, bottom, top = camera.frame
    ours = ((-x / depth - left) / (right - left), (-y / depth - bottom) / (top - bottom))
    assert ours == pytest.approx(world_to_camera_view(stage.scene, placed, point)[:2], abs=1e-5)


def test_a_sheared_camera_is_told_of(stage):
    placed = stage.camera()
    placed.rotation_euler = (1.2, 0.1, 0.2)
    parent = stage.link("Parent")
    placed.parent, parent.scale = parent, (2.0, 2.0, 2.0)
    assert not stage.take().notes
    parent.scale = (2.0, 1.0, 1.0)
    (note,) = stage.take().notes
    assert note.subject == "Camera 'Camera'" and "shears" in note.text
