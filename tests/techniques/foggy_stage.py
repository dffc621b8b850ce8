"""Media for the stage of small scenes (conftest.py)."""

import bpy
import numpy as np

BOX = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def fill(tree, node, **inputs):
    """Put a medium into the tree of a material or a world, beside what it has on its surface."""
    shader = tree.nodes.new(node)
    output = next(one for one in tree.nodes if one.type in ("OUTPUT_MATERIAL", "OUTPUT_WORLD"))
    tree.links.new(shader.outputs[0], output.inputs["Volume"])
    for key, value in inputs.items():
        shader.inputs[key.replace("_", " ")].default_value = value


def volume(stage, node="ShaderNodeVolumeScatter", name="volume", **inputs):
    made = bpy.data.materials.new(name)
    stage.use_nodes(made)
    made.node_tree.nodes.clear()
    made.node_tree.nodes.new("ShaderNodeOutputMaterial")
    fill(made.node_tree, node, **inputs)
    return made


def absorber(stage, per_metre):
    """Absorbs these coefficients."""
    return volume(stage, "ShaderNodeVolumeAbsorption", Color=(*(1 - np.array(per_metre)), 1.0), Density=1.0)


def box(stage, material, low=(-0.5, -0.5, -0.5), high=(0.5, 0.5, 0.5), **placement):
    corners = [(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    return stage.mesh(corners, BOX, material=material, **placement)


def fog(stage, color=(0, 0, 0), node="ShaderNodeVolumeScatter", **inputs):
    """A world of this radiance, full of a medium."""
    fill(stage.world(color).node_tree, node, **inputs)


def glowing_floor(stage, z=-2.0, strength=2.0):
    return stage.rectangle((-5, -5), (5, 5), z=z, material=stage.material("ShaderNodeEmission", Strength=strength))
