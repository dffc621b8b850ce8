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


def principled(name: str, color=(0.8, 0.8, 0.8, 1), tiles: float = 0.0, other=(0.1, 0.1, 0.1, 1), **inputs):
    """A Principled material; with `tiles` its colour is a chequer of so many tiles over the UV map."""
    made = one_shader(name, "ShaderNodeBsdfPrincipled", Base_Color=color, **inputs)
    if tiles:
        shader = node_of(made, "BSDF_PRINCIPLED")
        made.node_tree.links.new(chequer(made, tiles, color, other), shader.inputs["Base Color"])
    return made


def chequer(material, tiles: float, color, other, output: str = "UV"):
    """The socket of a new chequer of a material over its UV map or another output of Texture Coordinate."""
    nodes, links = material.node_tree.nodes, material.node_tree.links
    place, cells = nodes.new("ShaderNodeTexCoord"), nodes.new("ShaderNodeTexChecker")
    links.new(place.outputs[output], cells.inputs["Vector"])
    cells.inputs["Scale"].default_value = tiles
    cells.inputs["Color1"].default_value, cells.inputs["Color2"].default_value = color, other
    return cells.outputs["Color"]


def glass(name: str = "Glass", color=(1, 1, 1, 1), roughness: float = 0.0, ior: float = 1.5):
    return one_shader(name, "ShaderNodeBsdfGlass", Color=color, Roughness=roughness, IOR=ior)


def dispersing(colors_and_indices):
    """The material of several Glass nodes that are added: (r, g, b, 1) and index of each."""
    made = one_shader("Dispersing", "ShaderNodeBsdfGlass", Color=colors_and_indices[0][0], IOR=colors_and_indices[0][1])
    tree = made.node_tree
    joined = node_of(made, "BSDF_GLASS").outputs[0]
    for color, ior in colors_and_indices[1:]:
        node, both = tree.nodes.new("ShaderNodeBsdfGlass"), tree.nodes.new("ShaderNodeAddShader")
        node.inputs["Color"].default_value, node.inputs["IOR"].default_value = color, ior
        tree.links.new(joined, both.inputs[0])
        tree.links.new(node.outputs[0], both.inputs[1])
        joined = both.outputs[0]
    tree.links.new(joined, node_of(made, "OUTPUT_MATERIAL").inputs["Surface"])
    return made
