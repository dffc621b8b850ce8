"""Images as people use them: sequences, UDIM tiles, many in one material, multilayer files, colour spaces, alpha."""

import bpy
import numpy as np
import pytest

from addon.frame import ledger

from .conftest import agree

ENDINGS = {"PNG": "png", "OPEN_EXR": "exr", "TIFF": "tif"}


def saved(folder, name, color, size=4, kind="PNG"):
    """An image file of one colour."""
    made = bpy.data.images.new("made", size, size, alpha=True)
    made.pixels.foreach_set(np.tile(np.array(color, np.float32), size * size))
    path = str(folder / name)
    made.filepath_raw, made.file_format = path, kind
    made.save()
    bpy.data.images.remove(made)
    return path


def shown(stage, image=None, with_alpha=False):
    """An emission of an image on a card that fills the picture, from u, v = 0 to 1; its texture node."""
    made = stage.material("ShaderNodeEmission")
    tree = made.node_tree
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image, texture.interpolation = image, "Closest"
    tree.links.new(texture.outputs["Color"], tree.nodes["Emission"].inputs["Color"])
    if with_alpha:
        tree.links.new(texture.outputs["Alpha"], tree.nodes["Emission"].inputs["Strength"])
    stage.card(made, 0.0, 1.0, scale=(2, 2, 1))
    stage.camera_above()
    return texture


def quarters(passes):
    """(2, 2, 3) colours of the picture's quarters."""
    pixels = passes["combined"][..., :3]
    height, width = pixels.shape[:2]
    return pixels.reshape(2, height // 2, 2, width // 2, 3).mean((1, 3))


@pytest.mark.parametrize("cyclic", [False, True])
def test_a_sequence_shows_the_frame_that_its_node_says(stage, beside, tmp_path, cyclic):
    for number in range(1, 5):
        saved(tmp_path, f"frame_{number:04d}.png", (number / 5, 1 - number / 5, 0.2, 1))
    image = bpy.data.images.load(str(tmp_path / "frame_0001.png"))
    image.source = "SEQUENCE"
    user = shown(stage, image).image_user
    user.frame_duration, user.frame_start, user.frame_offset, user.use_cyclic = 3, 2, 1, cyclic
    user.use_auto_refresh = True
    found = []
    for frame in (2, 3, 4, 6):
        stage.scene.frame_set(frame)
        own, cycles = beside(1, (16, 16), reference=1)
        agree(quarters(own), quarters(cycles))
        found.append(quarters(own)[0, 0, 0])
        assert not ledger.latest().notes
    assert found[0] < found[1] < found[2]
    stage.scene.frame_set(1)


def test_udim_tiles_are_shown_where_they_belong(stage, beside, tmp_path):
    for number, color, size in ((1001, (1, 0, 0, 1), 4), (1002, (0, 1, 0, 1), 8), (1011, (0, 0, 1, 1), 16)):
        saved(tmp_path, f"tile.{number}.png", color, size)
    image = bpy.data.images.load(str(tmp_path / "tile.1001.png"))
    image.source, image.filepath_raw = "TILED", str(tmp_path / "tile.<UDIM>.png")
    image.reload()
    if len(image.tiles) < 3:
        for number in (1002, 1011):
            image.tiles.new(number)
    texture = shown(stage, image)
    tree = texture.id_data
    mapping = tree.nodes.new("ShaderNodeMapping")
    mapping.inputs["Scale"].default_value = (2, 2, 1)
    tree.links.new(tree.nodes.new("ShaderNodeTexCoord").outputs["UV"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], texture.inputs["Vector"])
    own, cycles = beside(1, (16, 16), reference=1)
    agree(quarters(own), quarters(cycles))  # the fourth is missing: magenta
    assert quarters(own)[0, 0, 0] > 0.9 and quarters(own)[0, 1, 1] > 0.9 and quarters(own)[1, 0, 2] > 0.9


@pytest.mark.slow
@pytest.mark.parametrize("count", [13, 30])
def test_a_material_may_read_many_images(stage, beside, count):
    """The sum of many images of other colours, sizes, extensions and interpolations."""
    texture = shown(stage)
    tree, random = texture.id_data, np.random.default_rng(3)
    total = None
    for k in range(count):
        width, height = (int(n) for n in random.integers(2, 9, 2))
        image = bpy.data.images.new(f"Image {k}", width, height, alpha=True)
        image.pixels.foreach_set(random.random(width * height * 4).astype(np.float32))
        node = tree.nodes.new("ShaderNodeTexImage")
        node.image, node.interpolation = image, ("Linear", "Closest", "Cubic")[k % 3]
        node.extension = ("REPEAT", "EXTEND", "MIRROR")[k % 3]
        if total is None:
            total = node.outputs["Color"]
            continue
        add = tree.nodes.new("ShaderNodeMixRGB")
        add.blend_type, add.inputs[0].default_value = "ADD", 1.0
        tree.links.new(total, add.inputs[1])
        tree.links.new(node.outputs["Color"], add.inputs[2])
        total = add.outputs[0]
    tree.links.new(total, tree.nodes["Emission"].inputs["Color"])
    own, cycles = beside(1, (16, 16), reference=16)
    assert not ledger.latest().notes
    agree(quarters(own), quarters(cycles))


@pytest.mark.parametrize("number", [0, 1])
def test_a_pass_of_a_multilayer_file_is_shown(stage, beside, tmp_path, number):
    scene = stage.scene
    shown(stage, None)
    card = scene.objects["Mesh"]
    card.data.materials[0] = stage.material("ShaderNodeEmission", Color=(0.2, 0.6, 0.1, 1))
    scene.render.resolution_x = scene.render.resolution_y = 8
    scene.view_layers[0].use_pass_z, before = True, scene.render.filepath
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format, settings.exr_codec = "OPEN_EXR_MULTILAYER", "ZIP"
    scene.render.engine, scene.render.filepath, scene.cycles.samples = "CYCLES", str(tmp_path / "layers.exr"), 1
    bpy.ops.render.render(write_still=True, scene=scene.name)
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    scene.render.filepath, scene.view_layers[0].use_pass_z = before, False
    stage.remove(card)
    shown(stage, bpy.data.images.load(str(tmp_path / "layers.exr")))
    own, cycles = beside(1, (16, 16), reference=1)
    assert not ledger.latest().notes
    agree(quarters(own), quarters(cycles))


@pytest.mark.parametrize("space", ["Filmic sRGB", "AgX Base sRGB", "Linear Rec.2020", "Rec.1886", "ACEScg"])
@pytest.mark.parametrize("with_alpha", [False, True])
def test_8_bit_images_of_any_colour_space(stage, beside, tmp_path, space, with_alpha):
    path = str(tmp_path / "colors.png")
    made = bpy.data.images.new("made", 8, 8, alpha=True)
    pixels = np.random.default_rng(5).random((8, 8, 4)).astype(np.float32)
    pixels[..., 3] = 0.25 + 0.75 * pixels[..., 3] if with_alpha else 1.0
    made.pixels.foreach_set(pixels.reshape(-1))
    made.filepath_raw, made.file_format = path, "PNG"
    made.save()
    image = bpy.data.images.load(path)
    try:
        image.colorspace_settings.name = space
    except TypeError:
        pytest.skip("not in this Blender's configuration")
    shown(stage, image, with_alpha)
    own, cycles = beside(1, (32, 32), reference=1)
    assert not ledger.latest().notes
    agree(own["combined"][2::4, 2::4, :3], cycles["combined"][2::4, 2::4, :3])


@pytest.mark.parametrize("mode", ["STRAIGHT", "PREMUL", "CHANNEL_PACKED", "NONE"])
@pytest.mark.parametrize("kind", ["PNG", "OPEN_EXR", "TIFF"])
@pytest.mark.parametrize("with_alpha", [False, True])
def test_alpha_of_bytes_and_floats(stage, beside, tmp_path, mode, kind, with_alpha):
    path = saved(tmp_path, f"half.{ENDINGS[kind]}", (0.8, 0.4, 0.1, 0.5), kind=kind)
    image = bpy.data.images.load(path)
    image.alpha_mode = mode
    if kind == "OPEN_EXR":
        image.colorspace_settings.name = "Linear Rec.709"
    shown(stage, image, with_alpha)
    own, cycles = beside(1, (16, 16), reference=1)
    agree(quarters(own), quarters(cycles))
