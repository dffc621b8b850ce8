"""The eye in the camera's tab: observers set what they name, and the pictures are of the eye as it is set."""

import bpy
import numpy as np
import pytest

from addon.eye.presets import PRESETS
from addon.ui import eye_panel


@pytest.fixture
def camera(registered, gpu_context):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    data = bpy.data.cameras.new("Camera")
    scene.camera = bpy.data.objects.new("Camera", data)
    scene.collection.objects.link(scene.camera)
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 320, 180, 100
    data.candela.eye_side = "128"
    return data


def pixels_of(name):
    image = bpy.data.images[name]
    width, height = image.size
    return np.array(image.pixels[:], np.float32).reshape(height, width, 4)


@pytest.mark.parametrize("name", PRESETS)
def test_an_observer_sets_what_it_names_and_nothing_of_the_one_before(camera, name):
    camera.candela.eye_wavelengths = 48
    for one in ("OLD", name):
        assert bpy.ops.candela.eye_preset(preset=one) == {"FINISHED"}
    for key, value in PRESETS[name].values.items():
        assert getattr(camera.candela, f"eye_{key}") == pytest.approx(value)
    if "age" not in PRESETS[name].values:
        assert camera.candela.eye_age == 30.0
    assert camera.candela.eye_wavelengths == 48


def test_the_pictures_are_data_blocks_that_a_compositor_may_convolve_with(camera):
    assert bpy.ops.candela.eye_pictures() == {"FINISHED"}
    kernel, pupil = pixels_of(eye_panel.GLARE), pixels_of(eye_panel.PUPIL)
    np.testing.assert_allclose(kernel[..., :3].sum(axis=(0, 1)), 1.0, atol=1e-3)
    assert kernel.shape[0] == kernel.shape[1]
    assert kernel.shape[0] % 2 == 1
    middle = len(pupil) // 2
    assert pupil[2, 2, 0] == 0.0
    assert 0.5 < pupil[middle - 8 : middle + 8, middle - 8 : middle + 8, 0].mean() <= 1.0
    assert bpy.data.images[eye_panel.GLARE].preview.image_size[0] > 0


def test_pictures_show_the_frame_and_what_is_set(camera):
    bpy.ops.candela.eye_pictures()
    first = pixels_of(eye_panel.GLARE)
    bpy.context.scene.frame_set(17)
    bpy.ops.candela.eye_pictures()
    second = pixels_of(eye_panel.GLARE)
    assert (first != second).any()
    camera.candela.eye_blink = 1.0
    bpy.ops.candela.eye_pictures()
    assert not pixels_of(eye_panel.PUPIL)[..., :3].any()
    assert [image.name for image in bpy.data.images if image.name.startswith("Candela")] == [
        eye_panel.GLARE, eye_panel.PUPIL,
    ]  # fmt: skip


def test_an_image_of_the_artists_own_stays_whatever_its_name(camera):
    own = bpy.data.images.new(eye_panel.GLARE, 4, 4, float_buffer=True)
    for _ in range(2):
        assert bpy.ops.candela.eye_pictures() == {"FINISHED"}
    assert tuple(own.size) == (4, 4) and own.packed_file is None
    assert len([image for image in bpy.data.images if image.name.startswith(eye_panel.GLARE)]) == 2


def test_without_its_core_the_kernel_holds_what_is_scattered(camera):
    bpy.ops.candela.eye_pictures(whole=False)
    share = pixels_of(eye_panel.GLARE)[..., :3].sum(axis=(0, 1))
    assert (share > 0.01).all()
    assert (share < 0.9).all()


def test_keyframes_of_the_eye_reach_a_render(camera):
    scene = bpy.context.scene
    for frame, value in ((1, 0.0), (5, 1.0)):
        camera.candela.eye_blink = value
        camera.candela.keyframe_insert("eye_blink", frame=frame)
    from addon.ui.properties import settings_of

    found = []
    for frame in (1, 5):
        scene.frame_set(frame)
        settings = settings_of(scene, viewport=False, depsgraph=bpy.context.evaluated_depsgraph_get())
        found.append(settings.values["eye", "blink"])
    assert found == [0.0, 1.0]


def test_a_pass_tree_has_nodes_for_the_eye_and_for_the_convolution(camera):
    scene = bpy.context.scene
    scene.render.engine = "CANDELA"
    camera.candela.glare_mode = "CONVOLUTION"
    tree = bpy.data.node_groups.new("Tree", "CandelaPassTree")
    eye, glare, film = (tree.nodes.new(f"CandelaPass_{name}") for name in ("eye", "glare", "film"))
    taken, given = ([socket.identifier for socket in one] for one in (glare.inputs, glare.outputs))
    assert "point spread" in [socket.identifier for socket in eye.outputs]
    assert taken == ["point spread", "film.combined"]
    assert given == ["film.lens"]
    assert "film.combined" in [socket.identifier for socket in film.outputs]
