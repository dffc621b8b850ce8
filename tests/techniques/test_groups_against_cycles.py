"""What group sockets, muted nodes and reroutes hand on: colours beside Cycles'."""

from pathlib import Path

import bpy
import numpy as np
import pytest

SIZE = (8, 8)
ESSENTIALS = Path(bpy.utils.system_resource("DATAFILES")) / "assets" / "nodes" / "shading_nodes_essentials.blend"


@pytest.fixture
def tree(stage):
    """Of the material of a sphere before the camera, with an emission."""
    stage.camera_above(1.0)
    material = stage.material("ShaderNodeEmission")
    bpy.ops.mesh.primitive_uv_sphere_add(segments=16, ring_count=8)
    made = bpy.context.object
    made.data.shade_smooth()
    made.data.materials.append(material)
    stage.tree = material.node_tree
    stage.emission = next(node for node in stage.tree.nodes if node.type == "EMISSION")
    return stage


def group(stage, kind, inner, socket, output=0, **settings):
    """A group node whose only input, of a kind, feeds a socket of an inner node; its output is the inner node's."""
    made = bpy.data.node_groups.new("Group", "ShaderNodeTree")
    entry = made.interface.new_socket("In", in_out="INPUT", socket_type=kind)
    for name, value in settings.items():
        setattr(entry, name, value)
    made.interface.new_socket("Out", in_out="OUTPUT", socket_type="NodeSocketColor")
    start, node, end = (made.nodes.new(name) for name in ("NodeGroupInput", inner, "NodeGroupOutput"))
    made.links.new(start.outputs[0], node.inputs[socket])
    made.links.new(node.outputs[output], end.inputs[0])
    placed = stage.tree.nodes.new("ShaderNodeGroup")
    placed.node_tree = made
    stage.tree.links.new(placed.outputs[0], stage.emission.inputs["Color"])
    return placed


def check(stage):
    ours, theirs = (stage.render(1, SIZE, engine=e)["emission"][..., :3] for e in ("CANDELA", "CYCLES"))
    np.testing.assert_allclose(ours, theirs, atol=2e-3)


@pytest.mark.parametrize(("kind", "inner"), [("Float", "ShaderNodeGamma"), ("Vector", "ShaderNodeMath"),
                                             ("Color", "ShaderNodeMath")])  # fmt: skip
def test_colours_through_a_group_socket_of_another_kind(tree, kind, inner):
    source = tree.tree.nodes.new("ShaderNodeRGB")
    source.outputs[0].default_value = (1.0, 0.5, 0.0, 1.0)
    placed = group(tree, f"NodeSocket{kind}", inner, 0)
    tree.tree.links.new(source.outputs[0], placed.inputs[0])
    check(tree)


@pytest.mark.parametrize("mutes", ["ShaderNodeTexNoise", "ShaderNodeTexImage"])
def test_a_muted_texture_leaves_the_value_of_the_group(tree, mutes):
    placed = group(tree, "NodeSocketColor", "ShaderNodeGamma", 0)
    placed.inputs[0].default_value = (0.9, 0.2, 0.1, 1.0)
    texture = tree.tree.nodes.new(mutes)
    tree.tree.links.new(texture.outputs["Color"], placed.inputs[0])
    texture.mute = True
    check(tree)


def test_a_reroute_that_nothing_reaches(tree):
    fresnel, reroute = (tree.tree.nodes.new(name) for name in ("ShaderNodeFresnel", "NodeReroute"))
    tree.tree.links.new(reroute.outputs[0], fresnel.inputs["IOR"])
    tree.tree.links.new(fresnel.outputs[0], tree.emission.inputs["Color"])
    check(tree)


@pytest.mark.parametrize("hidden", [False, True])
@pytest.mark.parametrize(("inner", "socket", "output"), [
    ("ShaderNodeFresnel", "Normal", 0), ("ShaderNodeLayerWeight", "Normal", 1), ("ShaderNodeTexGradient", "Vector", 0),
    ("ShaderNodeTexNoise", "Vector", 0),
])  # fmt: skip
def test_a_vector_of_a_group_that_nothing_feeds(tree, inner, socket, output, hidden):
    """Blender 5.0 takes a value that the artist can see for one, and a hidden one for the usual vector."""
    group(tree, "NodeSocketVector", inner, socket, output, hide_value=hidden, default_value=(0.2, 0.3, 0.4))
    check(tree)


@pytest.mark.skipif(not ESSENTIALS.exists(), reason="Blender has had this library of node groups since 5.1")
@pytest.mark.parametrize(("coordinates", "output"), [("Cylindrical", "R"), ("Cylindrical", "Phi"), ("Spherical", "R"),
                                                     ("Spherical", "Theta")])  # fmt: skip
def test_node_groups_that_come_with_blender(tree, coordinates, output):
    """The place on the sphere, taken apart, a part of it shifted, and put together again."""
    with bpy.data.libraries.load(str(ESSENTIALS)) as (_, loaded):
        loaded.node_groups = [f"Separate {coordinates}", f"Combine {coordinates}"]
    apart, together = (tree.tree.nodes.new("ShaderNodeGroup") for _ in range(2))
    apart.node_tree, together.node_tree = loaded.node_groups
    geometry, shift = (tree.tree.nodes.new(f"ShaderNode{name}") for name in ("NewGeometry", "Math"))
    tree.tree.links.new(geometry.outputs["Position"], apart.inputs["Vector"])
    for socket in apart.outputs:
        tree.tree.links.new(socket, together.inputs[socket.name])
    tree.tree.links.new(apart.outputs[output], shift.inputs[0])
    shift.inputs[1].default_value = 0.3
    tree.tree.links.new(shift.outputs[0], together.inputs[output])
    tree.tree.links.new(together.outputs["Vector"], tree.emission.inputs["Color"])
    check(tree)
