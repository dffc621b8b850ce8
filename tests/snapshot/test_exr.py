"""The EXR reader against pixels that Blender wrote, and against damaged files."""

import bpy
import numpy as np
import pytest

from addon.compare.reference import overridden
from addon.snapshot.exr import ExrError, read_exr

WIDTH, HEIGHT = 21, 37  # more rows than two ZIP chunks hold, and no multiple of anything


@pytest.fixture
def pixels():
    """(H, W, 4) float32 with values that half floats hold exactly, negative and large ones among them."""
    values = np.random.default_rng(7).integers(-2048, 2048, (HEIGHT, WIDTH, 4)).astype(np.float32) / 8
    values[0, 0] = (1, 2, 3, 1)
    values[..., 3] = 1
    return values


def written(tmp_path, pixels, codec, depth):
    """The pixels in an EXR file by Blender. Blender's image rows run from the bottom up, as the reader's do."""
    image = bpy.data.images.new("known", WIDTH, HEIGHT, float_buffer=True, alpha=True)
    image.colorspace_settings.name = "Linear Rec.709"
    image.pixels.foreach_set(pixels.ravel())
    path = tmp_path / "known.exr"
    settings = bpy.context.scene.render.image_settings
    wanted = [
        (settings, name, value)
        for name, value in (
            ("media_type", "IMAGE"),
            ("file_format", "OPEN_EXR"),
            ("color_mode", "RGBA"),
            ("color_depth", depth),
            ("exr_codec", codec),
        )
        if hasattr(settings, name)
    ]
    with overridden(wanted):
        image.save_render(str(path), scene=bpy.context.scene)
    bpy.data.images.remove(image)
    return path


@pytest.mark.parametrize("depth", ["16", "32"])
@pytest.mark.parametrize("codec", ["NONE", "ZIP", "ZIPS", "RLE"])
def test_every_pixel_comes_back_exactly(tmp_path, empty_scene, pixels, codec, depth):
    layers = read_exr(written(tmp_path, pixels, codec, depth))
    assert list(layers) == [""]
    read = layers[""]
    assert read.dtype == np.float32
    np.testing.assert_array_equal(read, pixels)


def test_rows_run_from_the_bottom_up(tmp_path, empty_scene, pixels):
    pixels[:] = (0, 0, 0, 1)
    pixels[0] = (1, 0, 0, 1)  # Blender's first row is the lowest
    read = read_exr(written(tmp_path, pixels, "ZIP", "32"))[""]
    assert (read[0, :, 0] == 1).all() and (read[1:, :, 0] == 0).all()


@pytest.mark.parametrize("interleave", [True, False])
def test_layers_and_passes_are_told_apart(tmp_path, empty_scene, interleave):
    scene = empty_scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 1
    scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.view_layers[0].name = "Layer 1.5"  # a dot in the name must not be taken for the end of the layer
    scene.view_layers[0].use_pass_normal = scene.view_layers[0].use_pass_z = True
    settings = scene.render.image_settings
    if hasattr(settings, "use_exr_interleave"):
        settings.media_type = "MULTI_LAYER_IMAGE"
        settings.use_exr_interleave = interleave
    settings.file_format = "OPEN_EXR_MULTILAYER"
    settings.color_depth, settings.exr_codec = "32", "ZIP"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 9, 5, 100
    scene.render.filepath = str(tmp_path / "passes.exr")
    bpy.ops.render.render(write_still=True)
    layers = read_exr(tmp_path / "passes.exr")
    shapes = {name: image.shape for name, image in layers.items()}
    assert shapes["Layer 1.5.Combined"] == (5, 9, 4)
    assert shapes["Layer 1.5.Normal"] == (5, 9, 3)
    assert shapes["Layer 1.5.Depth"] == (5, 9, 1)
    assert (layers["Layer 1.5.Depth"] == 1e10).all()


def test_a_lossy_codec_is_refused_by_name(tmp_path, empty_scene, pixels):
    with pytest.raises(ExrError, match=r"known\.exr: compression DWAA is not read; save with ZIP"):
        read_exr(written(tmp_path, pixels, "DWAA", "16"))


@pytest.mark.parametrize("keep", [0, 4, 60, 400, 0.7, 0.99])
def test_a_file_cut_short_is_an_error_that_names_it(tmp_path, empty_scene, pixels, keep):
    path = written(tmp_path, pixels, "ZIP", "32")
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * keep) if isinstance(keep, float) else keep])
    with pytest.raises(ExrError, match=r"known\.exr: "):
        read_exr(path)


def test_another_kind_of_file_is_an_error(tmp_path):
    path = tmp_path / "picture.png"
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))
    with pytest.raises(ExrError, match=r"picture\.png: this is not an OpenEXR file"):
        read_exr(path)
