"""Nodes in settings that artists find: pictures beside Cycles'."""

import bpy
import numpy as np
import pytest

SIZE = (16, 16)


@pytest.fixture
def card(stage):
    """A square before the camera, and the tree of its material with an emission."""
    stage.camera_above(2.0)
    material = stage.material("ShaderNodeEmission")
    stage.card(material, 0.0, 1.0)
    stage.tree = material.node_tree
    stage.emission = next(node for node in stage.tree.nodes if node.type == "EMISSION")
    return stage


def both(stage, name="emission", samples=(1, 1)):
    return [stage.render(n, SIZE, engine=e)[name][..., :3] for n, e in zip(samples, ("CANDELA", "CYCLES"))]


@pytest.mark.parametrize("hue", [1.2, -0.3, 2.75])
def test_hues_beyond_a_turn_are_not_wrapped(card, hue):
    combine, value = (card.tree.nodes.new(name) for name in ("ShaderNodeCombineColor", "ShaderNodeValue"))
    combine.mode, value.outputs[0].default_value = "HSV", hue
    combine.inputs[1].default_value, combine.inputs[2].default_value = 0.75, 0.5
    card.tree.links.new(value.outputs[0], combine.inputs[0])
    card.tree.links.new(combine.outputs[0], card.emission.inputs["Color"])
    ours, theirs = both(card)
    np.testing.assert_allclose(ours, theirs, atol=1e-4)


@pytest.mark.parametrize("deep", [False, True], ids=["bytes", "floats"])
def test_alpha_does_not_cover_data(card, deep):
    image = bpy.data.images.new("packed", 2, 2, alpha=True, float_buffer=deep)
    image.colorspace_settings.name = "Non-Color"
    image.pixels.foreach_set(np.tile(np.float32([0.8, 0.4, 1.0, 0.2]), 4))
    image.pack()
    texture = card.tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    card.tree.links.new(texture.outputs["Color"], card.emission.inputs["Color"])
    ours, theirs = both(card)
    np.testing.assert_allclose(ours, theirs, atol=2e-3)
    np.testing.assert_allclose(ours.mean(axis=(0, 1)), [0.8, 0.4, 1.0], atol=2e-3)


def test_displacement_along_the_tangent_of_a_turned_object(stage):
    """A constant offset along the surface moves it, and tilts nothing."""
    material = stage.diffuse()
    tree = material.node_tree
    tree_output = next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
    lift = tree.nodes.new("ShaderNodeVectorDisplacement")
    lift.space = "TANGENT"
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(coordinates.outputs["UV"], lift.inputs["Vector"])
    lift.inputs["Scale"].default_value = 0.3
    tree.links.new(lift.outputs[0], tree_output.inputs["Displacement"])
    made = stage.card(material, 0.0, 1.0)
    made.rotation_euler = (0.3, 1.0, 0.4)
    stage.camera_above(1.0)
    stage.light("SUN", turn=(0.2, 0.4, 0.0))
    ours, theirs = both(stage, "diffuse_direct", (1, 16))
    np.testing.assert_allclose(ours, theirs, atol=2e-3)


def test_grilles_finer_than_the_pixels_looked_at_have_holes(stage):
    from addon.materials.estimate import image_estimate
    from addon.snapshot.scene import Image

    pixels = np.ones((1024, 1024, 4), np.float32)
    pixels[1::4, 1::4, :3] = 0.0
    found = image_estimate(Image("grille", 1, pixels, "LINEAR", "NONE", "grille"), False, "Color")
    assert found.low.max() == 0.0 and found.high.min() == 1.0
