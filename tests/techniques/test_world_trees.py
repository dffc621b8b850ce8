"""Worlds whose tree is more than a colour or an image: what they light and what the camera sees, against Cycles."""

import bpy
import numpy as np
import pytest

from addon.gfx import images
from addon.materials.energy import energy_texture
from addon.scene.world_tree import WorldTree
from addon.snapshot import SnapshotCache, take


def tree_of(stage):
    """A world with an empty tree: (tree, its output node)."""
    world = bpy.data.worlds.new("World")
    stage.use_nodes(world)
    world.node_tree.nodes.clear()
    stage.scene.world = world
    return world.node_tree, world.node_tree.nodes.new("ShaderNodeOutputWorld")


def add(tree, node_type, inputs=None, links=None, **settings):
    """A node with input values by place, links to inputs by place, and settings."""
    node = tree.nodes.new(node_type)
    for name, value in settings.items():
        setattr(node, name, value)
    for place, value in (inputs or {}).items():
        node.inputs[place].default_value = value
    for place, socket in (links or {}).items():
        tree.links.new(socket, node.inputs[place])
    return node


def gradient(stage):
    """Warm above, cold below, by the height of the direction; mixed with a second background along x."""
    tree, output = tree_of(stage)
    place = add(tree, "ShaderNodeTexCoord").outputs["Generated"]
    axes = add(tree, "ShaderNodeSeparateXYZ", links={0: place})
    height = add(tree, "ShaderNodeMath", {1: 0.5}, {0: axes.outputs["Z"]}, operation="MULTIPLY_ADD")
    height.inputs[2].default_value = 0.5
    ramp = add(tree, "ShaderNodeValToRGB", links={0: height.outputs[0]})
    ramp.color_ramp.elements[0].color, ramp.color_ramp.elements[1].color = (0.1, 0.2, 0.8, 1), (2.0, 1.0, 0.3, 1)
    first = add(tree, "ShaderNodeBackground", links={0: ramp.outputs[0]})
    second = add(tree, "ShaderNodeBackground", {0: (0.2, 0.9, 0.4, 1.0), 1: 1.5})
    share = add(tree, "ShaderNodeMath", {1: 0.0}, {0: axes.outputs["X"]}, operation="MAXIMUM")
    links = {0: share.outputs[0], 1: first.outputs[0], 2: second.outputs[0]}
    mixed = add(tree, "ShaderNodeMixShader", links=links)
    tree.links.new(mixed.outputs[0], output.inputs["Surface"])


def two_worlds(stage):
    """The camera sees red, surfaces are lit by an even white."""
    tree, output = tree_of(stage)
    seen = add(tree, "ShaderNodeLightPath").outputs["Is Camera Ray"]
    light = add(tree, "ShaderNodeBackground", {0: (1.0, 1.0, 1.0, 1.0)})
    red = add(tree, "ShaderNodeBackground", {0: (0.8, 0.1, 0.0, 1.0)})
    mixed = add(tree, "ShaderNodeMixShader", links={0: seen, 1: light.outputs[0], 2: red.outputs[0]})
    tree.links.new(mixed.outputs[0], output.inputs["Surface"])


def two_images(stage):
    """An equirectangular image turned by a Mapping node, times a tint, plus an even glow."""
    tree, output = tree_of(stage)
    image = bpy.data.images.new("Sky", 64, 32, float_buffer=True)
    v, u = np.mgrid[0:32, 0:64]
    pixels = np.stack([0.2 + (u > 40), 0.1 + v / 32, 0.5 + 0.4 * np.sin(u / 5), np.ones_like(u)], axis=-1)
    image.pixels.foreach_set(pixels.astype(np.float32).ravel())
    image.pack()
    place = add(tree, "ShaderNodeTexCoord").outputs["Generated"]
    turned = add(tree, "ShaderNodeMapping", {"Rotation": (0.3, 0.0, 1.0)}, {"Vector": place})
    texture = add(tree, "ShaderNodeTexEnvironment", links={0: turned.outputs[0]}, image=image)
    first = add(tree, "ShaderNodeBackground", {1: 1.2}, {0: texture.outputs[0]})
    second = add(tree, "ShaderNodeBackground", {0: (0.1, 0.0, 0.2, 1.0)})
    both = add(tree, "ShaderNodeAddShader", links={0: first.outputs[0], 1: second.outputs[0]})
    tree.links.new(both.outputs[0], output.inputs["Surface"])


def ball_before_the_sky(stage):
    """Three boards that face different ways, before the sky."""
    white = stage.diffuse(0.8)
    for k, turn in enumerate(((0.3, 0, 0), (1.5, 0, 0.4), (2.2, 0.5, 0))):
        stage.rectangle((-0.4, -0.4), (0.4, 0.4), material=white, location=(k - 1.0, 0, 0), turn=turn)
    stage.camera((0.0, -4.0, 0.8), (1.4, 0.0, 0.0))


def test_a_texel_of_the_map_that_lights_has_what_its_direction_shows(stage):
    """A world that is as red, green and blue as its direction points along x, y and z, by equal steps of angle."""
    tree, output = tree_of(stage)
    place = add(tree, "ShaderNodeTexCoord").outputs["Generated"]
    inside = add(tree, "ShaderNodeVectorMath", {1: (0.5,) * 3, 2: (0.5,) * 3}, {0: place}, operation="MULTIPLY_ADD")
    background = add(tree, "ShaderNodeBackground", links={0: inside.outputs[0]})
    tree.links.new(background.outputs[0], output.inputs["Surface"])
    stage.camera_above(4.0)
    snapshot = take(bpy.context.evaluated_depsgraph_get(), SnapshotCache(), 8, 8)
    found = WorldTree(snapshot.world, snapshot.images, images.upload(energy_texture(False))).bake()
    height, width = found.shape[:2]
    latitude = ((np.arange(height) + 0.5) / height - 0.5)[:, None] * np.pi
    azimuth = (0.5 - (np.arange(width) + 0.5) / width) * 2 * np.pi
    along = np.cos(latitude) * np.cos(azimuth), np.cos(latitude) * np.sin(azimuth), np.sin(latitude) + 0 * azimuth
    np.testing.assert_allclose(found, 0.5 + 0.5 * np.stack(along, axis=-1), atol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("world", [gradient, two_worlds, two_images])
def test_a_tree_lights_and_shows_what_it_does_in_cycles(stage, world):
    ball_before_the_sky(stage)
    world(stage)
    size = (48, 32)
    ours, cycles = stage.render(64, size), stage.render(512, size, engine="CYCLES")
    shown = np.abs(ours["environment"] - cycles["environment"])[..., :3].max(axis=-1)
    assert np.quantile(shown, 0.95) < 2e-3  # the rest lies on edges
    lit = (ours["diffuse_color"][..., 0] > 0.79) & (cycles["diffuse_color"][..., 0] > 0.79)
    assert lit.sum() > 100
    found, expected = (images["diffuse_direct"][lit][:, :3] for images in (ours, cycles))
    assert found.mean(axis=0) == pytest.approx(expected.mean(axis=0), rel=0.01)
    assert np.abs(found - expected).mean() < 0.03 * expected.mean()


def test_a_change_of_the_tree_is_seen_and_what_is_the_same_is_kept(stage):
    ball_before_the_sky(stage)
    gradient(stage)
    first = stage.render(4)["environment"]
    kept = stage.renderer.frame.environment
    assert np.array_equal(stage.render(4)["environment"], first) and stage.renderer.frame.environment is kept
    next(n for n in stage.scene.world.node_tree.nodes if n.type == "BACKGROUND").inputs["Strength"].default_value = 2.0
    assert stage.render(4)["environment"].mean() > first.mean() and stage.renderer.frame.environment is not kept


def test_a_sky_behind_coloured_glass_is_coloured(stage):
    color = (0.9, 0.5, 0.1)
    glass = stage.material("ShaderNodeBsdfTransparent", Color=(*color, 1.0))
    stage.rectangle((-9, -9), (9, 9), material=glass)
    stage.camera_above(4.0)
    two_worlds(stage)
    found = stage.render(16)["environment"][..., :3].mean(axis=(0, 1))  # how many samples pass is random
    assert found / found[0] == pytest.approx(np.multiply(color, (0.8, 0.1, 0.0)) / (0.9 * 0.8), rel=1e-4)
