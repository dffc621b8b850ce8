"""Zones, closures, bundles and switches of Blender 5's shader trees, beside Cycles."""

import bpy
import pytest

from addon.compare.metrics import relative_squared_error

from .conftest import agree

pytestmark = pytest.mark.skipif(bpy.app.version < (5, 0), reason="nodes of Blender 5")


@pytest.fixture
def tree(stage):
    """A node tree of an emission on a rectangle under the camera, and its socket for colours."""
    stage.scene.render.filter_size = 1.5
    material = stage.material("ShaderNodeEmission")
    stage.rectangle((-2, -2), (2, 2), material=material)
    stage.camera_above()
    return material.node_tree


def add(tree, kind, **settings):
    node = tree.nodes.new(kind)
    for name, value in settings.items():
        setattr(node, name, value)
    return node


def noise(tree, scale=2.0):
    place, made = add(tree, "ShaderNodeTexCoord"), add(tree, "ShaderNodeTexNoise")
    made.inputs["Scale"].default_value = scale
    tree.links.new(place.outputs["Object"], made.inputs["Vector"])
    return made.outputs[0]


def colour(tree):
    return next(node for node in tree.nodes if node.type == "EMISSION").inputs["Color"]


def same(pictures):
    own, cycles = (passes["combined"][..., :3] for passes in pictures)
    assert cycles.std() > 0.01
    assert relative_squared_error(own, cycles).mean() <= 0.01
    agree(own.mean((0, 1)), cycles.mean((0, 1)))


def zone(tree, times, start):
    """A repeat zone that adds noise and halves, `times` times."""
    first, last = add(tree, "GeometryNodeRepeatInput"), add(tree, "GeometryNodeRepeatOutput")
    first.pair_with_output(last)
    last.repeat_items.clear()
    last.repeat_items.new("FLOAT", "Value")
    first.inputs["Iterations"].default_value = times
    tree.links.new(start, first.inputs["Value"])
    half = add(tree, "ShaderNodeMath", operation="MULTIPLY_ADD")
    half.inputs[1].default_value = 0.5
    tree.links.new(first.outputs["Value"], half.inputs[0])
    tree.links.new(noise(tree, 5.0), half.inputs[2])
    tree.links.new(half.outputs[0], last.inputs["Value"])
    return last.outputs["Value"]


@pytest.mark.parametrize("times", [0, 1, 4])
def test_repeat_zone(tree, beside, times):
    tree.links.new(zone(tree, times, noise(tree)), colour(tree))
    same(beside(16, reference=32))


def test_iteration_of_a_repeat_zone(tree, beside):
    result = zone(tree, 3, noise(tree))
    first = next(node for node in tree.nodes if node.bl_idname == "GeometryNodeRepeatInput")
    half = next(node for node in tree.nodes if node.type == "MATH")
    tree.links.new(first.outputs["Iteration"], half.inputs[1])
    tree.links.new(result, colour(tree))
    same(beside(16, reference=32))


def test_closure(tree, beside):
    begin, end, run = (
        add(tree, kind) for kind in ("NodeClosureInput", "NodeClosureOutput", "NodeEvaluateClosure")
    )  # fmt: skip
    begin.pair_with_output(end)
    for node in (end, run):
        node.input_items.new("FLOAT", "Given")
        node.output_items.new("FLOAT", "Made")
    power = add(tree, "ShaderNodeMath", operation="POWER")
    power.inputs[1].default_value = 3.0
    tree.links.new(begin.outputs["Given"], power.inputs[0])
    tree.links.new(power.outputs[0], end.inputs["Made"])
    tree.links.new(end.outputs["Closure"], run.inputs["Closure"])
    tree.links.new(noise(tree), run.inputs["Given"])
    tree.links.new(run.outputs["Made"], colour(tree))
    same(beside(16, reference=32))


def test_bundle(tree, beside):
    pack, unpack = add(tree, "NodeCombineBundle"), add(tree, "NodeSeparateBundle")
    for node in (pack, unpack):
        node.bundle_items.new("FLOAT", "One")
        node.bundle_items.new("RGBA", "Two")
    pack.inputs["Two"].default_value = (0.9, 0.4, 0.1, 1)
    tree.links.new(noise(tree), pack.inputs["One"])
    tree.links.new(pack.outputs["Bundle"], unpack.inputs["Bundle"])
    mix = add(tree, "ShaderNodeMix", data_type="RGBA")
    tree.links.new(unpack.outputs["One"], mix.inputs["Factor"])
    tree.links.new(unpack.outputs["Two"], mix.inputs[6])
    tree.links.new(mix.outputs[2], colour(tree))
    same(beside(16, reference=32))


@pytest.mark.parametrize("chosen", ["A", "B"])
def test_menu_switch_within_a_group(tree, beside, chosen):
    group = bpy.data.node_groups.new("Chosen", "ShaderNodeTree")
    group.interface.new_socket("Colour", in_out="OUTPUT", socket_type="NodeSocketColor")
    switch, end = group.nodes.new("GeometryNodeMenuSwitch"), group.nodes.new("NodeGroupOutput")
    switch.inputs["Menu"].default_value = chosen
    switch.inputs["A"].default_value = (0.2, 0.7, 0.1, 1)
    group.links.new(noise(group), switch.inputs["B"])
    ramp = group.nodes.new("ShaderNodeMixRGB")
    ramp.blend_type = "MULTIPLY"
    group.links.new(switch.outputs[0], ramp.inputs["Color1"])
    group.links.new(noise(group, 3.0), ramp.inputs["Color2"])
    group.links.new(ramp.outputs[0], end.inputs[0])
    made = add(tree, "ShaderNodeGroup", node_tree=group)
    tree.links.new(made.outputs[0], colour(tree))
    same(beside(16, reference=32))


def test_trees_without_them_are_read_as_they_are(stage, tree):
    tree.nodes.new("ShaderNodeBevel").name = "My Bevel"
    tree.links.new(tree.nodes["My Bevel"].outputs[0], colour(tree))
    stage.render()
    assert any(note.node == "My Bevel" for note in stage.ledger.notes)
