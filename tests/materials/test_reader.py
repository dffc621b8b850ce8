"""Reading Blender's trees: groups, reroutes, muted nodes and links, outputs, circles. Trees are made in memory."""

import bpy
import numpy as np
import pytest

from addon.materials.compiler import compile_material
from addon.materials.reader import read_graph


def image_key(image, image_user):
    return image.name


@pytest.fixture
def material(empty_scene):
    made = bpy.data.materials.new("Test")
    if bpy.app.version < (5, 0, 0):
        made.use_nodes = True
    made.node_tree.nodes.clear()
    return made


class Tree:
    """Adds nodes to a tree and links them by socket name."""

    def __init__(self, tree):
        self.tree = tree

    def add(self, node_type, name="", **inputs):
        node = self.tree.nodes.new(node_type)
        node.name = name or node.name
        for socket, value in inputs.items():
            node.inputs[socket.replace("_", " ")].default_value = value
        return node

    def link(self, source, output, target, socket):
        return self.tree.links.new(source.outputs[output], target.inputs[socket])

    def surface(self, node, output=0):
        end = self.add("ShaderNodeOutputMaterial")
        self.link(node, output, end, "Surface")
        return end


def read(owner):
    return read_graph(owner, image_key)


def follow(graph, *sockets):
    """The node that is reached from the surface along these sockets."""
    node = graph.nodes[graph.surface[0]]
    for socket in sockets:
        node = graph.nodes[node.inputs[socket].link[0]]
    return node


def test_a_plain_tree_keeps_sockets_settings_and_links(material):
    tree = Tree(material.node_tree)
    math = tree.add("ShaderNodeMath")
    math.operation = "MULTIPLY"
    shader = tree.add("ShaderNodeBsdfPrincipled", Metallic=0.25)
    tree.link(math, "Value", shader, "Roughness")
    tree.surface(shader)
    graph, notes = read(material)
    assert notes == ()
    assert set(graph.nodes) == {math.name, shader.name}
    principled = follow(graph)
    assert principled.inputs["Metallic"].value == pytest.approx(0.25)
    assert principled.inputs["Roughness"].link == (math.name, "Value")
    assert principled.inputs["Base Color"].kind == "COLOR"
    assert principled.outputs == {"BSDF": "SHADER"}
    assert follow(graph, "Roughness").properties["operation"] == "MULTIPLY"


def test_no_tree_and_no_output_are_not_errors(material):
    assert read(material)[0].surface is None
    assert "no output" in read(material)[1][0][1]
    assert read(bpy.data.lights.new("Lamp", "POINT"))[0].surface is not None
    Tree(material.node_tree).add("ShaderNodeOutputMaterial")
    graph, notes = read(material)
    assert graph.surface is None and notes == ()


@pytest.mark.skipif(bpy.app.version >= (5, 0, 0), reason="since 5.0 every material uses its nodes")
def test_a_material_without_nodes_is_diffuse_in_its_viewport_color(empty_scene):
    material = bpy.data.materials.new("Plain")
    material.use_nodes = False
    material.diffuse_color = (0.1, 0.2, 0.3, 1.0)
    graph, _ = read(material)
    assert follow(graph).type == "ShaderNodeBsdfDiffuse"
    assert follow(graph).inputs["Color"].value[:3] == pytest.approx((0.1, 0.2, 0.3))


def test_the_output_for_cycles_wins(material):
    tree = Tree(material.node_tree)
    eevee = tree.surface(tree.add("ShaderNodeEmission", "For EEVEE"))
    eevee.target = "EEVEE"
    cycles = tree.surface(tree.add("ShaderNodeEmission", "For Cycles"))
    cycles.target = "CYCLES"
    assert read(material)[0].surface[0] == "For Cycles"
    tree.tree.nodes.remove(cycles)
    assert read(material)[0].surface[0] == "For EEVEE"


def test_reroutes_vanish(material):
    tree = Tree(material.node_tree)
    color = tree.add("ShaderNodeRGB", "Paint")
    color.outputs[0].default_value = (0.1, 0.2, 0.3, 1.0)
    first, second = tree.add("NodeReroute"), tree.add("NodeReroute")
    shader = tree.add("ShaderNodeBsdfDiffuse")
    tree.link(color, 0, first, 0)
    tree.link(first, 0, second, 0)
    tree.link(second, 0, shader, "Color")
    tree.surface(shader)
    graph, notes = read(material)
    assert follow(graph, "Color").key == "Paint"
    assert follow(graph, "Color").inputs["Color"].value[:3] == pytest.approx((0.1, 0.2, 0.3))
    assert notes == ()


def test_a_muted_node_hands_its_input_through(material):
    tree = Tree(material.node_tree)
    color = tree.add("ShaderNodeRGB", "Paint")
    gamma = tree.add("ShaderNodeGamma")
    shader = tree.add("ShaderNodeBsdfDiffuse")
    tree.link(color, 0, gamma, "Color")
    tree.link(gamma, 0, shader, "Color")
    tree.surface(shader)
    gamma.mute = True
    assert follow(read(material)[0], "Color").key == "Paint"


def test_what_a_muted_node_holds_counts_for_nothing(material):
    """The socket that it feeds keeps its own value; before Blender 5.0 it gets zero."""
    tree = Tree(material.node_tree)
    gamma = tree.add("ShaderNodeGamma", Color=(0.1, 0.2, 0.9, 1.0))
    shader = tree.add("ShaderNodeBsdfDiffuse", Color=(0.6, 0.5, 0.4, 1.0))
    tree.link(gamma, 0, shader, "Color")
    tree.surface(shader)
    gamma.mute = True
    socket = follow(read(material)[0]).inputs["Color"]
    expected = (0.6, 0.5, 0.4) if bpy.app.version >= (5, 0) else (0.0, 0.0, 0.0)
    assert socket.link is None and socket.value[:3] == pytest.approx(expected)


def test_a_muted_link_leaves_the_constant(material):
    tree = Tree(material.node_tree)
    shader = tree.add("ShaderNodeBsdfDiffuse", Roughness=0.5)
    link = tree.link(tree.add("ShaderNodeValue"), 0, shader, "Roughness")
    tree.surface(shader)
    link.is_muted = True
    socket = follow(read(material)[0]).inputs["Roughness"]
    assert socket.link is None and socket.value == pytest.approx(0.5)


def make_group(name, kind="NodeSocketColor", default=(0.2, 0.4, 0.6, 1.0)):
    """A group with one diffuse shader, whose colour comes from the group's input."""
    group = bpy.data.node_groups.new(name, "ShaderNodeTree")
    group.interface.new_socket("Paint", in_out="INPUT", socket_type=kind).default_value = default
    group.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    tree = Tree(group)
    start, end = tree.add("NodeGroupInput"), tree.add("NodeGroupOutput")
    shader = tree.add("ShaderNodeBsdfDiffuse", "Inner")
    tree.link(start, 0, shader, "Color")
    tree.link(shader, 0, end, 0)
    return group


def use_group(tree, group, name="Group"):
    node = tree.add("ShaderNodeGroup", name)
    node.node_tree = group
    return node


def test_a_group_is_dissolved_with_its_own_value(material):
    tree = Tree(material.node_tree)
    node = use_group(tree, make_group("Paint"))
    tree.surface(node)
    graph, _ = read(material)
    assert graph.surface == ("Group / Inner", "BSDF")
    assert follow(graph).inputs["Color"].value[:3] == pytest.approx((0.2, 0.4, 0.6))
    node.inputs[0].default_value = (1.0, 0.0, 0.0, 1.0)
    assert follow(read(material)[0]).inputs["Color"].value[:3] == pytest.approx((1.0, 0.0, 0.0))


def test_two_uses_of_a_group_are_two_nodes(material):
    tree = Tree(material.node_tree)
    group = make_group("Paint")
    first, second = use_group(tree, group, "First"), use_group(tree, group, "Second")
    mix = tree.add("ShaderNodeMixShader")
    tree.link(first, 0, mix, 1)
    tree.link(second, 0, mix, 2)
    tree.surface(mix)
    graph, _ = read(material)
    assert {"First / Inner", "Second / Inner"} <= set(graph.nodes)


def test_nested_groups_hand_links_through(material):
    inner = make_group("Inner group")
    outer = bpy.data.node_groups.new("Outer group", "ShaderNodeTree")
    outer.interface.new_socket("Paint", in_out="INPUT", socket_type="NodeSocketColor")
    outer.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    inside = Tree(outer)
    node = use_group(inside, inner, "Deep")
    inside.link(inside.add("NodeGroupInput"), 0, node, 0)
    inside.link(node, 0, inside.add("NodeGroupOutput"), 0)
    tree = Tree(material.node_tree)
    color = tree.add("ShaderNodeRGB", "Paint")
    use = use_group(tree, outer, "Outer")
    tree.link(color, 0, use, 0)
    tree.surface(use)
    graph, notes = read(material)
    assert graph.surface[0] == "Outer / Deep / Inner"
    assert follow(graph, "Color").key == "Paint"
    assert notes == ()


def test_a_group_socket_of_another_kind_converts(material):
    tree = Tree(material.node_tree)
    use = use_group(tree, make_group("Grey", "NodeSocketFloat", 0.5))
    tree.surface(use)
    assert follow(read(material)[0]).inputs["Color"].value[:3] == pytest.approx((0.5, 0.5, 0.5))
    color = tree.add("ShaderNodeRGB", "Paint")
    tree.link(color, 0, use, 0)
    graph, _ = read(material)
    if bpy.app.version >= (5, 0, 0):  # links go past the socket, see test_groups_against_cycles.py
        assert follow(graph, "Color").key == "Paint"
        return
    assert follow(graph, "Color").properties["kind"] == "FLOAT"
    assert follow(graph, "Color", "Value").key == "Paint"
    assert "color_luminance" in compile_material("Test", graph).glsl


def test_a_missing_group_and_a_group_without_output_are_said_or_black(material):
    tree = Tree(material.node_tree)
    use = tree.add("ShaderNodeGroup")
    use.node_tree = make_group("Paint")
    tree.surface(use)
    use.node_tree.nodes.clear()
    graph, _ = read(material)
    assert graph.surface is None
    compile_material("Test", graph)


def test_a_circle_is_cut_with_a_sentence(material):
    tree = Tree(material.node_tree)
    first, second = tree.add("ShaderNodeMath", "First"), tree.add("ShaderNodeMath", "Second")
    shader = tree.add("ShaderNodeBsdfDiffuse")
    tree.link(first, 0, second, 0)
    tree.link(second, 0, first, 0)
    tree.link(second, 0, shader, "Roughness")
    tree.surface(shader)
    graph, notes = read(material)
    assert any("cut" in sentence for _, sentence in notes)
    compile_material("Test", graph)


def test_images_ramps_and_curves_become_plain_data(material):
    tree = Tree(material.node_tree)
    texture = tree.add("ShaderNodeTexImage")
    texture.image = bpy.data.images.new("Pixels", 4, 4)
    ramp = tree.add("ShaderNodeValToRGB")
    ramp.color_ramp.elements[0].position = 0.25
    curves = tree.add("ShaderNodeRGBCurve")
    shader = tree.add("ShaderNodeBsdfDiffuse")
    tree.link(texture, "Color", ramp, "Fac")
    tree.link(ramp, "Color", curves, "Color")
    tree.link(curves, "Color", shader, "Color")
    tree.surface(shader)
    graph, _ = read(material)
    read_ramp = follow(graph, "Color", "Color").properties
    assert read_ramp["color_ramp"][0] == pytest.approx((0.25, 0.0, 0.0, 0.0, 1.0))
    assert read_ramp["color_ramp_interpolation"] == "LINEAR"
    read_curves = follow(graph, "Color").properties
    identity = np.linspace(0.0, 1.0, len(read_curves["mapping_table"]))
    assert np.array(read_curves["mapping_table"])[:, :3] == pytest.approx(np.tile(identity[:, None], 3), abs=1e-5)
    assert follow(graph, "Color", "Color", "Fac").image == "Pixels"


def test_every_node_of_this_blender_is_read_and_compiled(material):
    """No node type, known or not, ends in an exception; what is not drawn is said."""
    tree = Tree(material.node_tree)
    end = tree.add("ShaderNodeOutputMaterial")
    read_types = 0
    for name in sorted(dir(bpy.types)):
        if not name.startswith("ShaderNode") or name in {"ShaderNode", "ShaderNodeTree", "ShaderNodeCustomGroup"}:
            continue
        try:
            node = tree.add(name)
        except RuntimeError:
            continue
        for output in node.outputs:
            if output.enabled:
                tree.tree.links.new(output, end.inputs["Surface"])
                graph, notes = read(material)
                compile_material("Test", graph, {}, notes)
        read_types += 1
    assert read_types > 80
