"""An environment image through a Mapping node that mirrors, stretches or shifts directions, beside Cycles."""

import bpy
import numpy as np
import pytest

from .conftest import agree


@pytest.mark.slow
@pytest.mark.parametrize("settings", [
    {"Rotation": (0.3, 0.8, 2.0), "Scale": (1, -1, 1)}, {"Rotation": (0.3, 0.8, 2.0), "Scale": (1, 1, 3)},
    {"Location": (0.2, 0.0, 0.4)},
], ids=["mirrored", "stretched", "shifted"])  # fmt: skip
def test_image_of_few_pixels(stage, beside, settings):
    """What is between its pixels is blended after directions are mapped."""
    nodes, links = stage.world().node_tree.nodes, stage.scene.world.node_tree.links
    image = bpy.data.images.new("Environment", 16, 8, float_buffer=True)
    pixels = np.random.default_rng(3).random((8, 16, 4)).astype(np.float32)
    pixels[..., 3] = 1.0
    pixels[[0, -1], :, :3] = 0.5  # at a pole all of them meet
    image.pixels.foreach_set(pixels.ravel())
    texture, mapping = nodes.new("ShaderNodeTexEnvironment"), nodes.new("ShaderNodeMapping")
    texture.image = image
    for name, value in settings.items():
        mapping.inputs[name].default_value = value
    links.new(nodes.new("ShaderNodeTexCoord").outputs["Generated"], mapping.inputs["Vector"])
    links.new(mapping.outputs[0], texture.inputs["Vector"])
    background = next(node for node in nodes if node.type == "BACKGROUND")
    links.new(texture.outputs["Color"], background.inputs["Color"])
    stage.camera((0, 0, 0), (1.4, 0, 0.5))
    own, cycles = beside(4, reference=4)
    agree(own["environment"][..., :3], cycles["environment"][..., :3])
