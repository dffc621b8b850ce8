"""Attributes of every domain and type, as nodes read them on meshes, hair and points, beside Cycles."""

import bpy
import numpy as np
import pytest

from .conftest import agree

TYPES = ("FLOAT", "INT", "INT8", "BOOLEAN", "FLOAT2", "FLOAT_VECTOR", "FLOAT_COLOR", "BYTE_COLOR", "QUATERNION")


def reading(stage, node, output, **settings):
    """An emission of what a node reads."""
    made = stage.material("ShaderNodeEmission")
    tree = made.node_tree
    source = tree.nodes.new(node)
    for name, value in settings.items():
        setattr(source, name, value)
    tree.links.new(source.outputs[output], tree.nodes["Emission"].inputs["Color"])
    return made


def fill(layer):
    """Other values in each element."""
    field, width = {
        "FLOAT": ("value", 1), "INT": ("value", 1), "INT8": ("value", 1), "BOOLEAN": ("value", 1),
        "FLOAT2": ("vector", 2), "FLOAT_VECTOR": ("vector", 3), "FLOAT_COLOR": ("color", 4), "BYTE_COLOR": ("color", 4),
        "QUATERNION": ("value", 4),
    }[layer.data_type]  # fmt: skip
    values = np.random.default_rng(2).random(len(layer.data) * width).astype(np.float32)
    whole = layer.data_type in ("INT", "INT8", "BOOLEAN")
    layer.data.foreach_set(field, np.rint(3 * values).astype(int) % 2 if layer.data_type == "BOOLEAN" else
                           np.rint(3 * values).astype(int) if whole else values)  # fmt: skip


def cells(passes):
    pixels = passes["combined"][..., :3]
    return pixels[4::8, 4::8]


NODES = [
    ("ShaderNodeUVMap", "UV", "uv_map"), ("ShaderNodeVertexColor", "Color", "layer_name"),
    ("ShaderNodeAttribute", "Color", "attribute_name"), ("ShaderNodeAttribute", "Vector", "attribute_name"),
    ("ShaderNodeAttribute", "Fac", "attribute_name"), ("ShaderNodeAttribute", "Alpha", "attribute_name"),
]  # fmt: skip


@pytest.mark.parametrize(("node", "output", "name"), NODES)
@pytest.mark.parametrize("domain", ["POINT", "EDGE", "FACE", "CORNER"])
def test_attributes_of_meshes(stage, beside, node, output, name, domain):
    """A grid of cards, one for each type of attribute."""
    material = reading(stage, node, output, **{name: "places"})
    # Of what is no colour, Cycles' Color Attribute gives undefined numbers.
    types = [one for one in TYPES if "COLOR" in one] if node == "ShaderNodeVertexColor" else TYPES
    if domain == "EDGE":
        types = [one for one in types if one in ("FLOAT", "FLOAT2", "FLOAT_VECTOR", "BOOLEAN")]
    for k, kind in enumerate(types):
        x, y = k % 3, k // 3
        card = stage.rectangle((0, 0), (1.2, 1.2), material=material, location=(1.3 * x - 1.9, 1.3 * y - 1.9, 0))
        fill(card.data.attributes.new("places", kind, domain))
    stage.camera_above()
    own, cycles = beside(1, (32, 32), bounces=0, reference=1)
    agree(cells(own), cells(cycles))


OUTPUTS = ("Is Strand", "Intercept", "Length", "Thickness", "Tangent Normal", "Random")


@pytest.fixture
def hair():
    made = bpy.data.hair_curves.new("Hair")
    made.add_curves([9] * 5)
    places = [c for i in range(5) for j in range(9) for c in (0.6 * i - 1.2, 0.4 * j - 1.6, 0.0)]
    made.attributes["position"].data.foreach_set("vector", places)
    radius = made.attributes.get("radius") or made.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", [0.28 - 0.02 * (k % 9) for k in range(45)])
    return made


@pytest.mark.parametrize("output", OUTPUTS)
def test_curves_info_tells_of_strands(stage, hair, beside, output):
    hair.materials.append(reading(stage, "ShaderNodeHairInfo", output))
    stage.link("Hair", hair, scale=(1, 0.9, 1))
    stage.camera_above()
    own, cycles = beside(4, (32, 32), bounces=0, reference=16)
    along = np.s_[4:28:6, 16, :3]
    expected = cycles["combined"][along]
    if output == "Tangent Normal":
        assert np.abs(own["combined"][along] - np.maximum(expected, 0)).max() < 0.15  # Cycles draws ribbons
    else:
        agree(own["combined"][along], expected, absolute=0.03)


@pytest.mark.parametrize("domain", ["POINT", "CURVE"])
@pytest.mark.parametrize("kind", TYPES[:-1])
def test_attributes_of_strands(stage, hair, beside, kind, domain):
    fill(hair.attributes.new("places", kind, domain))
    hair.materials.append(reading(stage, "ShaderNodeAttribute", "Color", attribute_name="places"))
    stage.link("Hair", hair)
    stage.camera_above()
    own, cycles = beside(4, (32, 32), bounces=0, reference=16)
    along = np.s_[4:28:6, 16, :3]
    agree(own["combined"][along], cycles["combined"][along], absolute=0.12 if domain == "POINT" else 0.02)


@pytest.mark.skipif(bpy.app.version < (5, 0), reason="points cannot be made before")
@pytest.mark.parametrize("output", ["Position", "Radius", "Random"])
def test_point_info_tells_of_points(stage, beside, output):
    cloud = bpy.data.pointclouds.new("Cloud")
    cloud.resize(4)
    cloud.attributes["position"].data.foreach_set("vector", np.array([0.5, 0.5, 0, -1, 1, 0, 1, -1, 0, 0, 1.5, 0.2]))
    radius = cloud.attributes.get("radius") or cloud.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", [0.3, 0.4, 0.2, 0.25])
    cloud.materials.append(reading(stage, "ShaderNodePointInfo", output))
    stage.link("Cloud", cloud, location=(0.2, 0, 0))
    stage.camera_above()
    own, cycles = beside(4, (32, 32), bounces=0, reference=16)
    inside = cycles["combined"][..., :3].max(axis=2) > 0.05
    assert inside.any()
    agree(own["combined"][..., :3][inside].mean(axis=0), cycles["combined"][..., :3][inside].mean(axis=0))


def test_vertex_groups(stage):
    """As in Cycles an Attribute node may name one: .2 at the left corners, .8 at the right ones, even between; also of
    what a modifier has cut, and of instances. Where the object has no such group it reads 0."""
    material = reading(stage, "ShaderNodeAttribute", "Color", attribute_name="mask")
    card = stage.rectangle((-1, -1), (1, 1), material=material)
    group = card.vertex_groups.new(name="mask")
    for vertex in card.data.vertices:
        group.add([vertex.index], 0.2 if vertex.co.x < 0 else 0.8, "REPLACE")
    cut = card.modifiers.new("cut", "SUBSURF")
    cut.subdivision_type, cut.levels, cut.render_levels = "SIMPLE", 2, 2
    other = stage.rectangle((-1, -1), (1, 1), material=material, location=(0, 40, 0))
    other.vertex_groups.new(name="other").add([0, 1, 2, 3], 0.5, "REPLACE")
    stage.camera_above(2.0)
    expected = 0.2 + 0.6 * (np.arange(32) + 0.5) / 32

    def row():
        stage.scene.render.filter_size = 0.01
        return stage.render(1, (32, 32))["emission"][16]

    np.testing.assert_allclose(row()[:, 0], expected, atol=0.02)
    shown = bpy.data.collections.new("shown")
    shown.objects.link(card)
    stage.scene.collection.objects.unlink(card)
    stage.link("instance", None).instance_type = "COLLECTION"
    stage.scene.objects["instance"].instance_collection = shown
    np.testing.assert_allclose(row()[:, 0], expected, atol=0.02)
