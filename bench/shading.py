"""Materials and worlds of the bench's scenes, alike in Blender 4.5 to 5.3."""

from __future__ import annotations


def tree_of(block):
    """Node tree of a material, world or lamp: before Blender 5 a new one has to be asked for."""
    import bpy

    if bpy.app.version < (5, 0):
        block.use_nodes = True
    return block.node_tree


def node_of(block, kind: str):
    """The first node of a type, such as BSDF_PRINCIPLED or BACKGROUND, in a block's tree as Blender makes it."""
    return next(node for node in tree_of(block).nodes if node.type == kind)


def one_shader(name: str, kind: str, socket: str = "Surface", **inputs):
    """A material of one shader node; `inputs` are values by their sockets' names, with _ for a space."""
    import bpy

    made = bpy.data.materials.new(name)
    tree = tree_of(made)
    tree.nodes.clear()
    shader, output = tree.nodes.new(kind), tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(shader.outputs[0], output.inputs[socket])
    for key, value in inputs.items():
        shader.inputs[key.replace("_", " ")].default_value = value
    return made


def even_world(color, strength: float = 1.0) -> None:
    """A world of one colour for the scene."""
    import bpy

    world = bpy.data.worlds.new("World")
    node = node_of(world, "BACKGROUND")
    node.inputs["Color"].default_value, node.inputs["Strength"].default_value = (*color, 1.0), strength
    bpy.context.scene.world = world
