"""Attributes of objects, of what instances them and of view layers, as Attribute nodes read them, beside Cycles."""

import bpy
import numpy as np
import pytest

from tests.snapshot.test_instances import cube_on_points

from .conftest import agree
from .test_attributes import reading

OUTPUTS = ("Color", "Vector", "Fac", "Alpha")


def cells(passes):
    return passes["combined"][4::8, 4::8, :3]


def read_by(stage, kind, name, output="Color"):
    """A material that shines as an attribute says."""
    return reading(stage, "ShaderNodeAttribute", output, attribute_type=kind, attribute_name=name)


def cards(stage, materials):
    """Squares of a metre, a cell of the picture each."""
    made = []
    for k, material in enumerate(materials):
        place = (k % 4 - 2, k // 4 - 2, 0)
        made.append(stage.rectangle((0, 0), (1, 1), material=material, location=place))
    stage.camera_above()
    return made


def same(stage, beside):
    own, cycles = beside(1, (32, 32), bounces=0, reference=1)
    assert cells(cycles).std() > 0.01
    agree(cells(own), cells(cycles))
    return own


@pytest.mark.parametrize("kind", ["OBJECT", "INSTANCER"])
def test_properties_of_objects_and_of_their_data(stage, beside, kind):
    names = ("number", "whole", "three", "four", "of data", "color", "pass_index", "word", "location", "absent")
    made = cards(stage, [read_by(stage, kind, name, OUTPUTS[k % 4]) for k, name in enumerate((*names, *names[:6]))])
    for k, one in enumerate(made):
        one["number"], one["whole"], one["three"] = 0.25 + 0.01 * k, 2 + k, [0.1, 0.5, 0.02 * k]
        one["four"], one["word"], one.pass_index = [0.3, 0.1, 0.7, 0.4], "a", 3
        one.data["of data"], one.color = 0.6, (0.2, 0.05 * k, 0.8, 0.5)
    same(stage, beside)
    made[0]["number"] = 0.9
    own, cycles = beside(1, (32, 32), bounces=0, reference=1)
    agree(cells(own), cells(cycles))


def test_properties_of_what_instances_collections(stage, beside):
    material = read_by(stage, "INSTANCER", "tone")
    card = stage.rectangle((0, 0), (1, 1), material=material)
    collection = bpy.data.collections.new("Cards")
    stage.scene.collection.objects.unlink(card)
    collection.objects.link(card)
    card["tone"] = 0.3
    for k in range(6):
        empty = stage.link("Empty", None, (k % 4 - 2, k // 4 - 2, 0))
        empty.instance_type, empty.instance_collection = "COLLECTION", collection
        if k < 4:
            empty["tone"] = [0.2 * k, 0.9 - 0.2 * k, 0.4]
    stage.camera_above()
    same(stage, beside)


@pytest.mark.skipif(not hasattr(bpy.types.Object, "evaluated_geometry"), reason="this Blender tells nothing of them")
@pytest.mark.parametrize("kind", ["FLOAT_COLOR", "FLOAT", "FLOAT_VECTOR", "INT"])
def test_what_geometry_nodes_store_with_instances(stage, beside, kind):
    points = stage.mesh([(x - 1.5, y - 1.5, 0) for y in range(4) for x in range(4)])
    layer = points.data.attributes.new("tone", kind, "POINT")
    field, width = {"FLOAT_COLOR": ("color", 4), "FLOAT_VECTOR": ("vector", 3)}.get(kind, ("value", 1))
    values = np.random.default_rng(4).random(16 * width)
    layer.data.foreach_set(field, np.rint(values).astype(int) if kind == "INT" else values)
    group = cube_on_points()
    cube = next(node for node in group.nodes if node.bl_idname == "GeometryNodeMeshCube")
    cube.inputs["Size"].default_value = (0.9, 0.9, 0.9)
    setter = group.nodes.new("GeometryNodeSetMaterial")
    setter.inputs["Material"].default_value = read_by(stage, "INSTANCER", "tone")
    place = next(node for node in group.nodes if node.bl_idname == "GeometryNodeInstanceOnPoints")
    group.links.new(cube.outputs[0], setter.inputs[0])
    group.links.new(setter.outputs[0], place.inputs["Instance"])
    points.modifiers.new("Cubes", "NODES").node_group = group
    stage.camera_above()
    same(stage, beside)


@pytest.mark.slow
def test_properties_of_view_layer_scene_and_world(stage, beside):
    scene = stage.scene
    world = stage.world((0.1, 0.3, 0.2), 1.0)
    layer = scene.view_layers[0]
    layer["first"], scene["first"], world["first"] = [0.9, 0.1, 0.2], 0.5, 0.7
    scene["second"], world["second"], world["third"] = 0.4, 0.8, [0.2, 0.3]
    try:
        names = ("first", "second", "third", "absent", "color")
        cards(stage, [read_by(stage, "VIEW_LAYER", name, output) for name in names for output in OUTPUTS[:3]])
        before = same(stage, beside)
        layer["first"] = [0.1, 0.8, 0.2]
        assert not np.allclose(same(stage, beside)["combined"], before["combined"])
    finally:
        for block in (layer, scene):
            for name in ("first", "second"):
                block.pop(name, None)


def test_light_of_instances_has_the_colours_of_their_attributes(stage, beside):
    """What lamps of one mesh throw on a floor is each one's own."""
    material = read_by(stage, "OBJECT", "tone")
    shader = next(node for node in material.node_tree.nodes if node.type == "EMISSION")
    shader.inputs["Strength"].default_value = 5.0
    first = stage.rectangle((-0.2, -0.2), (0.2, 0.2), 0.5, material, location=(-1, 0, 0))
    for k, tone in enumerate(([1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0])):
        one = first if k == 0 else stage.link("Lamp", first.data, (k - 1, 0, 0))
        one["tone"], one.visible_camera = tone, False
    stage.floor()
    stage.camera_above()
    own, cycles = (one["combined"][..., :3].reshape(4, 8, 4, 8, 3).mean((1, 3)) for one in beside(64, (32, 32), 0, 128))
    agree(own, cycles)
