"""The world: a constant or an equirectangular image with its mapping; anything else is the nearest constant."""

import bpy
import numpy as np
import pytest


def background(world):
    return next(node for node in world.node_tree.nodes if node.type == "BACKGROUND")


def environment(world, image, vector=None):
    """An Environment Texture on the Background; `vector`: output socket to map it by."""
    tree = world.node_tree
    node = tree.nodes.new("ShaderNodeTexEnvironment")
    node.image = image
    tree.links.new(node.outputs[0], background(world).inputs["Color"])
    if vector is not None:
        tree.links.new(vector, node.inputs["Vector"])
    return node


def sky(width=8, height=4):
    image = bpy.data.images.new("sky", width, height, float_buffer=True)
    values = np.ones((height, width, 4), np.float32)
    values[..., 0] = np.arange(width)
    values[..., 1] = np.arange(height)[:, None]
    image.pixels.foreach_set(values.reshape(-1))
    return image


def test_no_world_is_black(stage):
    stage.scene.world = None
    assert stage.take().world.color.tolist() == [0, 0, 0]


def test_a_constant_background(stage):
    node = background(stage.world())
    node.inputs["Color"].default_value = (0.1, 0.2, 0.3, 1.0)
    node.inputs["Strength"].default_value = 2.0
    world = stage.take().world
    assert world.color == pytest.approx([0.2, 0.4, 0.6])
    assert world.image is None


@pytest.mark.skipif(bpy.app.version >= (5, 0), reason="worlds always use nodes from Blender 5.0 on")
def test_a_world_without_nodes_has_its_colour(stage):
    made = bpy.data.worlds.new("World")
    made.color, stage.scene.world = (0.1, 0.2, 0.3), made
    assert stage.take().world.color == pytest.approx([0.1, 0.2, 0.3])


def test_a_view_layer_without_sky_is_black(stage):
    stage.world()
    bpy.context.view_layer.use_sky = False
    assert stage.take().world.color.tolist() == [0, 0, 0]


def test_an_environment_image_keeps_pixels_and_strength(stage):
    world = stage.world()
    background(world).inputs["Strength"].default_value = 3.0
    environment(world, sky())
    snapshot = stage.take()
    assert snapshot.world.image is next(iter(snapshot.images.values()))
    assert snapshot.world.color.tolist() == [3, 3, 3]
    assert snapshot.world.mapping.tolist() == np.eye(3, 4).tolist()
    assert snapshot.notes == ()


def test_generated_coordinates_are_the_direction(stage):
    world = stage.world()
    coordinates = world.node_tree.nodes.new("ShaderNodeTexCoord")
    environment(world, sky(), coordinates.outputs["Generated"])
    assert stage.take().world.mapping.tolist() == np.eye(3, 4).tolist()


def cycles_pixel(stage, direction):
    """Red of what Cycles shows of the world in a direction: two by two pixels, a narrow camera."""
    from mathutils import Vector

    placed = stage.scene.camera
    placed.rotation_euler = Vector(direction).to_track_quat("-Z", "Y").to_euler()
    placed.data.lens = 5000
    render = stage.scene.render
    render.engine, stage.scene.cycles.samples = "CYCLES", 1
    stage.scene.cycles.use_denoising = False
    render.resolution_x = render.resolution_y = 2
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"
    render.filepath = bpy.app.tempdir + "world.exr"
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(render.filepath)
    image.colorspace_settings.name = "Non-Color"
    red, green = image.pixels[0], image.pixels[1]
    bpy.data.images.remove(image)
    return red, green


def looked_up(world, direction):
    """Nearest texel by the convention that scene.World states."""
    d = world.mapping[:, :3] @ direction + world.mapping[:, 3]
    d /= np.linalg.norm(d)
    u, v = -np.arctan2(d[1], d[0]) / (2 * np.pi) + 0.5, np.arcsin(d[2]) / np.pi + 0.5
    height, width = world.image.pixels.shape[:2]
    texel = world.image.pixels[min(int(v * height), height - 1), min(int(u * width), width - 1)]
    return texel[:2] * world.color[:2]


@pytest.mark.parametrize("kind", ["POINT", "TEXTURE", "VECTOR", "NORMAL"])
def test_mapping_turns_the_sky_as_in_cycles(stage, kind):
    if not hasattr(stage.scene, "cycles"):
        pytest.skip("this Blender has no Cycles")
    world = stage.world()
    mapping = world.node_tree.nodes.new("ShaderNodeMapping")
    coordinates = world.node_tree.nodes.new("ShaderNodeTexCoord")
    world.node_tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    mapping.vector_type = kind
    if kind in ("POINT", "TEXTURE"):
        mapping.inputs["Location"].default_value = (0.1, -0.2, 0.3)
    mapping.inputs["Rotation"].default_value = (0.4, 1.1, -0.7)
    mapping.inputs["Scale"].default_value = (1.0, 2.0, 0.5)
    environment(world, sky(), mapping.outputs[0]).interpolation = "Closest"
    stage.camera()
    world.cycles.sampling_method = "NONE"  # no table of the image has to be built: nothing is lit
    for direction in ((0.8, 0.5, 0.33), (-0.7, 0.1, -0.7)):
        direction = np.array(direction) / np.linalg.norm(direction)
        ours = looked_up(stage.take().world, direction)
        assert cycles_pixel(stage, direction) == pytest.approx(ours, abs=1e-3)


@pytest.mark.parametrize("case", ["mirror ball", "noise mapping", "noise", "no image"])
def test_what_is_more_than_a_colour_or_an_equirectangular_image_is_handed_on_as_a_tree(stage, case):
    world = stage.world()
    noise = world.node_tree.nodes.new("ShaderNodeTexNoise")
    if case == "noise":
        world.node_tree.links.new(noise.outputs["Color"], background(world).inputs["Color"])
    else:
        image = None if case == "no image" else bpy.data.images.new("flat", 4, 2, float_buffer=True)
        node = environment(world, image, noise.outputs["Color"] if case == "noise mapping" else None)
        if case == "mirror ball":
            node.projection = "MIRROR_BALL"
    found = stage.take().world
    assert found.image is None
    assert found.color.tolist() == [1, 1, 1]
    assert found.graph.nodes[found.graph.surface[0]].type == "ShaderNodeBackground"


def two_backgrounds(world, factor=None):
    """A Mix Shader of a red and a green background."""
    tree = world.node_tree
    mix, other = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new("ShaderNodeBackground")
    background(world).inputs["Color"].default_value = (1, 0, 0, 1)
    other.inputs["Color"].default_value = (0, 1, 0, 1)
    tree.links.new(background(world).outputs[0], mix.inputs[1])
    tree.links.new(other.outputs[0], mix.inputs[2])
    output = next(node for node in tree.nodes if node.type == "OUTPUT_WORLD")
    tree.links.new(mix.outputs[0], output.inputs["Surface"])
    return mix


def test_mixed_backgrounds_are_a_tree(stage):
    two_backgrounds(stage.world())
    assert stage.take().world.graph is not None


def test_a_black_body_has_blenders_colour(stage):
    """Blender's own light temperature is the same law, and is held at both ends."""
    from addon.snapshot.constants import blackbody

    light = bpy.data.lights.new("l", "POINT")
    light.use_temperature = True
    for kelvin in (800.0, 1500.0, 3000.0, 6500.0, 10000.0, 20000.0):
        light.temperature = kelvin
        assert blackbody(kelvin) == pytest.approx(light.temperature_color[:3], abs=0.012)


def test_ray_visibility_of_the_world(stage):
    world = stage.world()
    if not hasattr(world, "cycles_visibility"):
        pytest.skip("this Blender has no Cycles")
    world.cycles_visibility.camera = False
    visibility = stage.take().world.visibility
    assert (visibility.camera, visibility.diffuse) == (False, True)
