"""Which lookups of a tree may be averaged: closed lists of what is affine, and what is not."""

import pytest

from addon.materials.averages import EXACT, FIRST, Averaged, averaged_lookups
from addon.materials.graph import Graph, Input, Node


def texture(key="image", image="i", **properties):
    outputs = {"Color": "COLOR", "Alpha": "FLOAT"}
    return Node(key, key, "ShaderNodeTexImage", {"Vector": Input("VECTOR")}, outputs, properties, image)


def shader(node_type="ShaderNodeBsdfDiffuse", key="shader", **links):
    inputs = {name.replace("_", " "): Input("COLOR", 0.0, link) for name, link in links.items()}
    return Node(key, key, node_type, inputs, {"BSDF": "SHADER"})


def node(node_type, key, output, properties=None, **links):
    return Node(
        key, key, node_type, {n: Input("COLOR", 0.5, link) for n, link in links.items()}, output, properties or {}
    )


def averaged(*nodes, opaque=True):
    graph = Graph({one.key: one for one in nodes}, ("shader", "BSDF"))
    return averaged_lookups(graph, lambda _: opaque)


WHOLE_EXACT, WHOLE_FIRST = Averaged(EXACT, True), Averaged(FIRST, True)
COLOR, ALPHA = ("image", "Color"), ("image", "Alpha")


def test_a_colour_is_exact():
    assert averaged(texture(), shader(Color=COLOR)) == {"image": WHOLE_EXACT}


def test_leaves_have_the_colour_of_many_and_the_alpha_of_the_point():
    principled = shader("ShaderNodeBsdfPrincipled", Base_Color=COLOR, Alpha=ALPHA)
    assert averaged(texture(), principled, opaque=False) == {"image": Averaged(EXACT, False)}


def mixed(passing):
    """One shader or another by alpha, the second in the image's colour."""
    shaders = shader(passing, "first"), shader(key="second", Color=COLOR)
    inputs = {"Fac": Input("FLOAT", 0.5, ALPHA), "Shader": Input("SHADER", None, ("first", "BSDF")),
              "Shader_001": Input("SHADER", None, ("second", "BSDF"))}  # fmt: skip
    return *shaders, Node("shader", "mix", "ShaderNodeMixShader", inputs, {"BSDF": "SHADER"})


def test_a_decal_has_the_alpha_of_many():
    assert averaged(texture(), *mixed("ShaderNodeBsdfDiffuse"), opaque=False) == {"image": WHOLE_EXACT}


def test_a_hole_has_the_alpha_of_the_point():
    found = averaged(texture(), *mixed("ShaderNodeBsdfTransparent"), opaque=False)
    assert found == {"image": Averaged(EXACT, False)}


@pytest.mark.parametrize("socket", ["Color", "Alpha"])
def test_what_decides_alone_whether_a_surface_is_passed_is_that_of_the_point(socket):
    principled = shader("ShaderNodeBsdfPrincipled", Alpha=("image", socket))
    assert averaged(texture(), principled, opaque=False) == {}
    assert averaged(texture(), shader("ShaderNodeBsdfTransparent", Color=COLOR)) == {}


def test_colour_beneath_an_alpha_that_nobody_reads_is_none_of_both():
    assert averaged(texture(), shader(Color=COLOR), opaque=False) == {}


@pytest.mark.parametrize("changed", [{"interpolation": "Closest"}, {"interpolation": "Cubic"}, {"projection": "BOX"}])
def test_other_lookups_stay_as_they_are(changed):
    assert averaged(texture(**changed), shader(Color=COLOR)) == {}


@pytest.mark.parametrize(
    "socket", ["Roughness", "Normal", "Metallic"],
)  # fmt: skip
def test_what_is_not_linear_is_averaged_in_drafts_alone(socket):
    assert averaged(texture(), shader("ShaderNodeBsdfPrincipled", **{socket: COLOR})) == {"image": WHOLE_FIRST}


def test_products_of_images_are_averaged_in_drafts_alone():
    mixed = node("ShaderNodeMix", "mix", {"Result_Color": "COLOR"}, {"data_type": "RGBA", "blend_type": "MULTIPLY"},
                 A_Color=COLOR, B_Color=("other", "Color"))  # fmt: skip
    found = averaged(texture(), texture("other", "j"), mixed, shader(Color=("mix", "Result_Color")))
    assert found == {"image": WHOLE_FIRST, "other": WHOLE_FIRST}


def test_an_image_times_itself_is_averaged_in_drafts_alone():
    squared = node(
        "ShaderNodeMath", "square", {"Value": "FLOAT"}, {"operation": "MULTIPLY"}, Value=COLOR, Value_001=COLOR
    )
    assert averaged(texture(), squared, shader(Color=("square", "Value"))) == {"image": WHOLE_FIRST}


def test_a_scaled_image_is_exact():
    scaled = node("ShaderNodeMath", "scale", {"Value": "FLOAT"}, {"operation": "MULTIPLY"}, Value=COLOR)
    assert averaged(texture(), scaled, shader(Color=("scale", "Value"))) == {"image": WHOLE_EXACT}


@pytest.mark.parametrize(
    "between",
    [
        node("ShaderNodeMath", "between", {"Value": "FLOAT"}, {"operation": "GREATER_THAN"}, Value=ALPHA),
        node("ShaderNodeMath", "between", {"Value": "FLOAT"}, {"operation": "ADD", "use_clamp": True}, Value=ALPHA),
        node("ShaderNodeValToRGB", "between", {"Value": "FLOAT"}, Fac=ALPHA),
        node("ShaderNodeBump", "between", {"Value": "VECTOR"}, Height=ALPHA),
    ],
    ids=["threshold", "clamp", "ramp", "bump"],
)
def test_no_lookup_before_a_threshold_is_averaged(between):
    assert averaged(texture(), between, shader(Color=COLOR, Alpha=("between", "Value"))) == {}


def test_coordinates_that_jump_are_not_followed():
    jumping = node("ShaderNodeVectorMath", "jump", {"Vector": "VECTOR"}, {"operation": "FRACTION"})
    moved = Node("image", "image", "ShaderNodeTexImage", {"Vector": Input("VECTOR", None, ("jump", "Vector"))},
                 {"Color": "COLOR"}, {}, "i")  # fmt: skip
    assert averaged(moved, jumping, shader(Color=COLOR)) == {}


def test_heights_beside_a_colour_do_not_matter():
    lifted = node("ShaderNodeDisplacement", "lift", {"Displacement": "VECTOR"}, Height=COLOR)
    assert averaged(texture(), lifted, shader(Color=COLOR)) == {"image": WHOLE_EXACT}
