"""Every entry of the node table on the GPU: it compiles, and its values agree with closed forms or with Cycles."""

import math as mathematics

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies as st

from addon.materials.compiler import compile_material
from addon.materials.graph import Graph, Input, Node
from addon.materials.nodes import REGISTRY
from addon.materials.nodes.entry import Attribute, Rows, Setting, Socket
from addon.materials.reader import read_graph
from addon.snapshot.scene import Image
from tests.materials.cycles import new_material, render_patches
from tests.materials.graphs import diffuse, emission, graph, image, math, mix, node, principled, transparent
from tests.materials.probe import points

VALUE_ENTRIES = [entry for entry in REGISTRY if entry.outputs]
SHADER_ENTRIES = [entry for entry in REGISTRY if entry.summary]
PICTURE = Image("picture", 1, np.full((2, 2, 4), 0.5, np.float32))


def settings_of(entry):
    """One set of properties per choice of the entry, all of which it draws."""
    longest = max((len(values) for values in entry.choices.values()), default=1)
    for i in range(longest):
        chosen = {name: values[min(i, len(values) - 1)] for name, values in entry.choices.items()}
        yield {**entry.when, **chosen}


def node_of(entry, key, properties, link=None):
    sockets = {a.identifier: Input(a.kind, a.default, link) for a in entry.arguments if isinstance(a, Socket)}
    outputs = dict(entry.outputs) or {"Shader": "SHADER"}
    return Node(key, key, entry.type, sockets, outputs, properties, "picture" if entry.image else "")


def label(entry):
    return entry.type.removeprefix("ShaderNode") + "".join(f"-{value}" for value in entry.when.values())


@pytest.mark.parametrize("entry", VALUE_ENTRIES, ids=label)
def test_every_value_node_compiles_with_and_without_links(evaluate, entry):
    """All variants of one entry at once, each output feeding an emission; first alone, then fed by a colour."""
    nodes = [node("Paint", "ShaderNodeRGB", {"Color": "COLOR"}, Color=(0.2, 0.5, 0.8, 1.0))]
    surface = None
    for i, properties in enumerate(settings_of(entry)):
        for link in (None, ("Paint", "Color")):
            made = node_of(entry, f"N{i}{link is None}", properties, link)
            nodes.append(made)
            for output, _ in entry.outputs:
                shown = emission(f"E{len(nodes)}", Color=(made.key, output))
                nodes.append(shown)
                if surface is None:
                    surface = (shown.key, "Emission")
                else:
                    add = node(f"A{len(nodes)}", "ShaderNodeAddShader", {"Shader": "SHADER"}, Shader=surface,
                               Shader_001=(shown.key, "Emission"))  # fmt: skip
                    nodes.append(add)
                    surface = (add.key, "Shader")
    material = compile_material("Test", graph(*nodes, surface=surface), {"picture": PICTURE})
    assert "is not supported" not in str(material.fallbacks)
    closures = evaluate(material, points(attributes=[(0.3, 0.4, 0.0, 1.0)] * 3), {"picture": PICTURE})
    assert np.isfinite(closures["emission"]).all()


@pytest.mark.parametrize("entry", SHADER_ENTRIES, ids=label)
def test_every_shader_compiles_with_and_without_links(evaluate, entry):
    for link in (None, ("Paint", "Color")):
        paint = node("Paint", "ShaderNodeRGB", {"Color": "COLOR"}, Color=(0.2, 0.5, 0.8, 1.0))
        shader = node_of(entry, "Shader", dict(entry.when), link)
        material = compile_material("Test", graph(paint, shader, surface=("Shader", "Shader")))
        closures = evaluate(material, points(incoming=(0.6, 0.0, 0.8)))
        assert all(np.isfinite(values).all() for values in closures.values())
        passed = closures["transparency"][0] + closures["diffuse"][0]
        assert (passed <= 1.0 + 1e-5).all() and (passed >= 0.0).all()


def test_table_entries_are_well_formed():
    for entry in REGISTRY:
        assert entry.combine or entry.function, entry.type
        assert not (entry.outputs and entry.summary), entry.type
        for argument in entry.arguments:
            if isinstance(argument, Socket):
                assert argument.kind in {"FLOAT", "VECTOR", "COLOR"}


def value_of(evaluate, *nodes, link, at=None, images=None):
    """What a value node gives, (N, 3), as the radiance of an emission."""
    tree = graph(*nodes, emission(Color=link), surface=("Emission", "Emission"))
    return evaluate(compile_material("Test", tree, images), at, images)["emission"]


MATH_CASES = [
    ("ADD", 2.0, 3.0, 5.0),
    ("DIVIDE", 1.0, 0.0, 0.0),
    ("POWER", -2.0, 3.0, -8.0),
    ("POWER", -2.0, 0.5, 0.0),
    ("LOGARITHM", 8.0, 2.0, 3.0),
    ("SQRT", -1.0, 0.0, 0.0),
    ("MODULO", -3.5, 2.0, -1.5),
    ("FLOORED_MODULO", -3.5, 2.0, 0.5),
    ("SNAP", 2.7, 0.5, 2.5),
    ("PINGPONG", 2.3, 1.0, 0.3),
    ("TRUNC", -1.7, 0.0, -1.0),
    ("SIGN", -3.0, 0.0, -1.0),
    ("ARCTAN2", 1.0, 1.0, mathematics.pi / 4),
    ("TANH", 0.5, 0.0, mathematics.tanh(0.5)),
    ("ROUND", 2.5, 0.0, 3.0),
    ("COMPARE", 1.0, 1.2, 1.0),
]


@pytest.mark.parametrize("operation, first, second, expected", MATH_CASES)
def test_math(evaluate, operation, first, second, expected):
    calculation = math("Math", operation, first, second)
    assert value_of(evaluate, calculation, link=("Math", "Value"))[0] == pytest.approx(expected, abs=1e-5)


def test_weights_of_mixed_shaders_add_up(evaluate):
    tree = graph(
        diffuse("Red", Color=(1.0, 0.0, 0.0, 1.0)),
        diffuse("Green", Color=(0.0, 1.0, 0.0, 1.0)),
        transparent(),
        mix("Inner", 0.25, ("Red", "BSDF"), ("Green", "BSDF")),
        mix("Outer", 0.5, ("Inner", "Shader"), ("Transparent", "BSDF")),
        surface=("Outer", "Shader"),
    )
    closures = evaluate(compile_material("Test", tree))
    assert closures["diffuse"][0] == pytest.approx((0.375, 0.125, 0.0), abs=1e-6)
    assert closures["transparency"][0] == pytest.approx((0.5, 0.5, 0.5), abs=1e-6)


def test_two_glossy_lobes_are_kept_apart_and_exact_in_the_mean(evaluate):
    def glossy(key, color, roughness):
        return node(key, "ShaderNodeBsdfAnisotropic", {"BSDF": "SHADER"}, Color=color, Roughness=roughness)

    tree = graph(
        glossy("Red", (0.9, 0.1, 0.1, 1.0), 0.0),
        glossy("Blue", (0.1, 0.1, 0.9, 1.0), 0.0),
        mix("Mix", 0.3, ("Red", "BSDF"), ("Blue", "BSDF")),
        surface=("Mix", "Shader"),
    )
    count = 4000
    closures = evaluate(compile_material("Test", tree), points(count, random=(np.arange(count) + 0.5) / count))
    mean = (closures["glossy_weight"] * closures["glossy_tint"]).mean(axis=0)
    assert mean == pytest.approx((0.66, 0.1, 0.34), abs=2e-3)


def test_principled_alpha_emission_and_holdout(evaluate):
    tree = graph(
        principled(Alpha=0.25, Emission_Color=(1.0, 0.5, 0.0, 1.0), Emission_Strength=4.0),
        surface=("Principled", "BSDF"),
    )
    closures = evaluate(compile_material("Test", tree))
    assert closures["transparency"][0] == pytest.approx((0.75,) * 3)
    assert closures["emission"][0] == pytest.approx((1.0, 0.5, 0.0))
    hold = graph(node("Hold", "ShaderNodeHoldout", {"Holdout": "SHADER"}), surface=("Hold", "Holdout"))
    assert evaluate(compile_material("Test", hold))["holdout"][0] == pytest.approx(1.0)


def test_hair_absorbs_along_the_mean_chord_of_its_fibre(evaluate):
    """Lines that meet a circle of radius 1 at an even distance from its middle cross it by pi / 2 in the mean."""
    apart = (np.arange(4096) + 0.5) / 4096
    chord = np.mean(2 * np.sqrt(1 - apart**2))
    hair = node(
        "Hair", "ShaderNodeBsdfHairPrincipled", {"BSDF": "SHADER"}, properties={"parametrization": "ABSORPTION"},
        Absorption_Coefficient=(0.25, 0.5, 1.4),
    )  # fmt: skip
    bare = node(
        "Hair", "ShaderNodeBsdfHairPrincipled", {"BSDF": "SHADER"}, properties={"parametrization": "ABSORPTION"},
        Absorption_Coefficient=(0.0, 0.0, 1e6),
    )  # fmt: skip
    albedo = [
        2 * evaluate(compile_material("Test", graph(one, surface=("Hair", "BSDF"))))["diffuse"][0]
        for one in (hair, bare)
    ]
    mirrored = albedo[1][2]
    passed = (albedo[0] - mirrored) / (albedo[1][0] - mirrored)
    np.testing.assert_allclose(passed, np.exp(-chord * np.array([0.25, 0.5, 1.4])), rtol=3e-3)


def test_a_color_as_surface_glows(evaluate):
    tree = graph(node("Paint", "ShaderNodeRGB", {"Color": "COLOR"}, Color=(0.2, 0.5, 0.8, 1.0)),
                 surface=("Paint", "Color"))  # fmt: skip
    material = compile_material("Test", tree)
    assert evaluate(material)["emission"][0] == pytest.approx((0.2, 0.5, 0.8))
    assert material.emission == pytest.approx((0.2, 0.5, 0.8), rel=1e-6)


def test_normal_map_tilts_towards_the_tangent_on_both_sides(evaluate):
    """Colour (1, 0.5, 0.5) is the tangent itself; on the back the surface is turned to the viewer as a whole."""
    mapped = node("Map", "ShaderNodeNormalMap", {"Normal": "VECTOR"}, properties={"space": "TANGENT", "uv_map": ""},
                  Strength=1.0, Color=(1.0, 0.5, 0.5, 1.0))  # fmt: skip
    material = compile_material("Test", graph(mapped, diffuse(Normal=("Map", "Normal")), surface=("Diffuse", "BSDF")))
    assert material.attributes[0].kind == "TANGENT"
    at = points(2, attributes=[(1.0, 0.0, 0.0, 1.0)], backfacing=np.array([0.0, 1.0]))
    normals = evaluate(material, at)["diffuse_normal"]
    assert normals[0] == pytest.approx((1.0, 0.0, 0.0), abs=1e-6)
    assert normals[1] == pytest.approx((-1.0, 0.0, 0.0), abs=1e-6)


def test_a_mirror_normal_is_bent_until_its_reflection_leaves_the_surface(evaluate):
    tilted = node("Normal", "ShaderNodeCombineXYZ", {"Vector": "VECTOR"}, X=0.9, Y=0.0, Z=0.4)
    glossy = node("Glossy", "ShaderNodeBsdfAnisotropic", {"BSDF": "SHADER"}, Normal=("Normal", "Vector"))
    material = compile_material("Test", graph(tilted, glossy, surface=("Glossy", "BSDF")))
    incoming = np.array([0.0, 0.6, 0.8])
    normal = evaluate(material, points(incoming=incoming))["glossy_normal"][0]
    reflected = 2.0 * normal.dot(incoming) * normal - incoming
    assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-5)
    assert reflected[2] == pytest.approx(min(0.9 * 0.8, 0.01), abs=1e-4)


@pytest.mark.parametrize(("convention", "up"), [("OPENGL", 1.0), ("DIRECTX", -1.0)])
def test_green_of_a_normal_map_runs_upwards_or_downwards(evaluate, convention, up):
    """Colour (0.5, 1, 0.5) is the bitangent itself, or its opposite."""
    mapped = node("Map", "ShaderNodeNormalMap", {"Normal": "VECTOR"},
                  properties={"space": "TANGENT", "uv_map": "", "convention": convention},
                  Strength=1.0, Color=(0.5, 1.0, 0.5, 1.0))  # fmt: skip
    material = compile_material("Test", graph(mapped, diffuse(Normal=("Map", "Normal")), surface=("Diffuse", "BSDF")))
    normal = evaluate(material, points(1, attributes=[(1.0, 0.0, 0.0, 1.0)]))["diffuse_normal"][0]
    assert normal == pytest.approx((0.0, up, 0.0), abs=1e-6)


def test_mapping_turns_by_euler_angles(evaluate):
    turn = node("Map", "ShaderNodeMapping", {"Vector": "VECTOR"}, properties={"vector_type": "POINT"},
                Vector=(1.0, 0.0, 0.0), Location=(0.1, 0.2, 0.3), Rotation=(0.0, 0.0, mathematics.pi / 2),
                Scale=(2.0, 1.0, 1.0))  # fmt: skip
    assert value_of(evaluate, turn, link=("Map", "Vector"))[0] == pytest.approx((0.1, 2.2, 0.3), abs=1e-5)


CYCLES_NODES = [
    ("ShaderNodeMix", {"data_type": "RGBA", "blend_type": mode}, {6: (0.7, 0.3, 0.6, 1), 7: (0.2, 0.6, 0.9, 1), 0: 0.6})
    for mode in ("MIX", "DARKEN", "MULTIPLY", "BURN", "LIGHTEN", "SCREEN", "DODGE", "ADD", "OVERLAY", "SOFT_LIGHT",
                 "LINEAR_LIGHT", "DIFFERENCE", "EXCLUSION", "SUBTRACT", "DIVIDE", "HUE", "SATURATION", "COLOR", "VALUE")
] + [
    ("ShaderNodeMapping", {"vector_type": kind},
     {0: (0.7, 0.3, 0.2), 1: (0.1, 0.2, 0.3), 2: (0.3, 0.5, 0.7), 3: (1.5, 0.8, 2.0)})
    for kind in ("POINT", "TEXTURE", "VECTOR", "NORMAL")
] + [
    ("ShaderNodeVectorRotate", {"rotation_type": "EULER_XYZ", "invert": invert},
     {0: (0.7, 0.5, 0.9), 1: (0.1, 0.2, 0.3), 4: (0.3, -0.2, 0.5)})
    for invert in (False, True)
] + [
    ("ShaderNodeInvert", {}, {0: 0.7, 1: (0.2, 0.5, 0.9, 1)}),
    ("ShaderNodeGamma", {}, {0: (0.2, 0.5, 0.9, 1), 1: 2.2}),
    ("ShaderNodeBrightContrast", {}, {0: (0.2, 0.5, 0.9, 1), 1: 0.1, 2: 0.4}),
    ("ShaderNodeRGBToBW", {}, {0: (0.2, 0.5, 0.9, 1)}),
    ("ShaderNodeClamp", {"clamp_type": "RANGE"}, {0: 0.9, 1: 0.7, 2: 0.2}),
    ("ShaderNodeCombineColor", {"mode": "HSV"}, {0: 0.6, 1: 0.5, 2: 0.8}),
    ("ShaderNodeCombineColor", {"mode": "HSL"}, {0: 0.6, 1: 0.5, 2: 0.4}),
    ("ShaderNodeSeparateColor", {"mode": "HSV"}, {0: (0.2, 0.5, 0.9, 1)}),
    ("ShaderNodeSeparateColor", {"mode": "HSL"}, {0: (0.2, 0.5, 0.9, 1)}),
    ("ShaderNodeValToRGB", {}, {0: 0.3}),
] + [
    ("ShaderNodeMath", {"operation": operation}, {0: 0.73, 1: 0.41, 2: 0.2})
    for operation in ("MULTIPLY_ADD", "SMOOTH_MIN", "SMOOTH_MAX", "WRAP", "PINGPONG", "SNAP", "FLOORED_MODULO",
                      "INVERSE_SQRT", "ARCCOSINE", "COSH", "DEGREES", "LOGARITHM")
]  # fmt: skip


@pytest.mark.slow
def test_converters_match_cycles(evaluate, empty_scene):
    """The first visible output of each node as an emission, by both. Scaled down, so that a display value fits."""
    materials = []
    for node_type, properties, values in CYCLES_NODES:
        material = new_material()
        tree = material.node_tree
        made, shown, output = (
            tree.nodes.new(name) for name in (node_type, "ShaderNodeEmission", "ShaderNodeOutputMaterial")
        )
        for name, value in properties.items():
            setattr(made, name, value)
        for index, value in values.items():
            made.inputs[index].default_value = value
        source = next(socket for socket in made.outputs if socket.enabled)
        tree.links.new(source, shown.inputs["Color"])
        tree.links.new(shown.outputs[0], output.inputs["Surface"])
        materials.append(material)
    passes, _ = render_patches(materials, resolution=8)
    reference = passes["emission"][:, 3:5, 3:5, :3].mean(axis=(1, 2))
    for material, expected, case in zip(materials, reference, CYCLES_NODES):
        compiled = compile_material("Test", read_graph(material, lambda image, user: "")[0])
        assert compiled.fallbacks == (), case
        # Cycles drops negative emission.
        measured = evaluate(compiled)["emission"][0]
        assert np.maximum(measured, 0.0) == pytest.approx(np.maximum(expected, 0.0), rel=2e-3, abs=1e-3), case


# Random trees.


@st.composite
def trees(draw):
    """A graph of up to 12 nodes, linked backwards at random, with values that may be wild."""
    numbers = st.floats(-1e3, 1e3, width=32) | st.sampled_from([0.0, 1.0, 1e30, float("inf"), float("nan")])
    nodes, values, shaders = {}, [], []
    for i in range(draw(st.integers(1, 12))):
        entry = draw(st.sampled_from(REGISTRY))
        variant = draw(st.sampled_from(list(settings_of(entry))))
        sockets = {}
        for argument in entry.arguments:
            if isinstance(argument, Socket) and draw(st.booleans()):
                link = draw(st.sampled_from(values)) if values and draw(st.booleans()) else None
                value = draw(numbers) if argument.kind == "FLOAT" else tuple(draw(numbers) for _ in range(3))
                sockets[argument.identifier] = Input(argument.kind, value, link)
            elif isinstance(argument, (Attribute, Setting, Rows)):
                variant.pop(argument.property, None)
        if entry.combine:
            for name in ("Shader", "Shader_001"):
                if shaders and draw(st.booleans()):
                    sockets[name] = Input("SHADER", None, draw(st.sampled_from(shaders)))
        outputs = dict(entry.outputs) or {"Shader": "SHADER"}
        key = f"N{i}"
        nodes[key] = Node(key, key, entry.type, sockets, outputs, variant, "picture" if entry.image else "")
        (shaders if entry.summary or entry.combine else values).extend((key, output) for output in outputs)
    return Graph(nodes, draw(st.sampled_from(shaders or values)))


def shader_alone(kind, **values):
    """A tree of one shader, found to fail once."""
    inputs = {name: Input("COLOR" if name == "Color" else "FLOAT", value, None) for name, value in values.items()}
    return Graph({"N": Node("N", "N", kind, inputs, {"Shader": "SHADER"}, {}, "")}, ("N", "Shader"))


def two_kinds_of_lookup():
    """A Sky and an Image Texture that read the same image, found to fail once."""
    sky = node("Sky", "ShaderNodeTexSky", {"Color": "COLOR"}, "picture")
    seen = image("Image", "picture", projection="FLAT")
    seen.inputs["Vector"] = Input("VECTOR", (0.0, 0.0, 0.0), ("Sky", "Color"))
    return graph(sky, seen, diffuse(Color=("Image", "Color")), surface=("Diffuse", "BSDF"))


@pytest.mark.slow
@hypothesis.settings(max_examples=30, deadline=None, suppress_health_check=list(hypothesis.HealthCheck))
@hypothesis.given(trees())
@hypothesis.example(two_kinds_of_lookup())
@hypothesis.example(shader_alone("ShaderNodeBsdfAnisotropic", Rotation=float("inf")))
@hypothesis.example(shader_alone("ShaderNodeBsdfPrincipled", **{"Coat Weight": 1.0, "Coat IOR": float("inf")}))
@hypothesis.example(shader_alone("ShaderNodeBsdfPrincipled", **{"Transmission Weight": 1.0, "IOR": float("inf")}))
@hypothesis.example(shader_alone("ShaderNodeBsdfGlass", IOR=float("inf")))
@hypothesis.example(shader_alone("ShaderNodeBsdfGlass", Color=(0.0, 0.0, 1e30), Roughness=1.0))
@hypothesis.example(shader_alone("ShaderNodeBsdfAnisotropic", Color=(0.0, float("nan"), 0.0), Roughness=0.0))
@hypothesis.example(shader_alone("ShaderNodeBsdfTransparent", Color=(0.0, float("inf"), 0.0)))
@hypothesis.example(shader_alone("ShaderNodeBsdfPrincipled", **{"Anisotropic": 1.0, "Anisotropic Rotation": -1e30}))
def test_random_trees_compile_and_stay_finite(evaluate, tree):
    material = compile_material("Test", tree, {"picture": PICTURE})
    closures = evaluate(material, points(attributes=[(0.3, 0.4, 0.0, 1.0)] * 8), {"picture": PICTURE})
    assert np.isfinite(material.values).all()
    bad = {name: values for name, values in closures.items() if not np.isfinite(values).all()}
    assert not bad
    assert 0.0 <= material.opacity <= 1.0


def test_tables_that_fit_no_block_are_read_whole(evaluate):
    """Nine curves, each a table of 129 rows, and a ramp: the block has room for seven of them."""
    steps = np.linspace(0.0, 1.0, 129)
    tables = [0.9 * steps**gamma + 0.1 for gamma in np.linspace(0.4, 1.6, 9)]
    nodes, link, expected = [], (0.3, 0.7, 0.95, 1.0), np.array([0.3, 0.7, 0.95])
    for k, table in enumerate(tables):
        settings = {
            "mapping_table": tuple((y, y, y, 0.0) for y in table.tolist()), "mapping_start": 0.0,
            "mapping_extent": 1.0, "mapping_onwards": False,
        }  # fmt: skip
        nodes.append(node(f"C{k}", "ShaderNodeRGBCurve", {"Color": "COLOR"}, "", settings, Fac=1.0, Color=link))
        link, expected = (f"C{k}", "Color"), np.interp(expected, steps, table)
    material = compile_material("Test", graph(*nodes, emission(Color=link), surface=("Emission", "Emission")))
    assert len(material.values) <= 1024
    assert any("tables" in text for _, text in material.fallbacks)
    assert evaluate(material)["emission"][0] == pytest.approx(expected, rel=1e-4)
    ramp = node(
        "Ramp", "ShaderNodeValToRGB", {"Color": "COLOR", "Alpha": "FLOAT"}, "",
        {"color_ramp": ((0.0, 0.0, 0.0, 0.0, 1.0), (1.0, 1.0, 0.5, 0.25, 1.0))}, Fac=link,
    )  # fmt: skip
    surface = emission(Color=("Ramp", "Color"))
    material = compile_material("Test", graph(*nodes, ramp, surface, surface=("Emission", "Emission")))
    seen = evaluate(material)["emission"][0]
    assert seen[1:] == pytest.approx(seen[0] * np.array([0.5, 0.25]), rel=1e-4)
    assert 0.5 < seen[0] < 1.0


def test_compare_takes_only_equal_numbers_for_equal(evaluate):
    """Cycles: 1 where they are the same or no further apart than the epsilon, which is 1.19e-7 or more."""
    cases = {(5e-6, 0, 0): 0, (1.3e-7, 0, 0): 0, (1e-7, 0, 0): 1, (1e30, 1e30, 0): 1, (0.5, 0.4, 0.2): 1, (1, 0, -1): 0}
    for (a, b, epsilon), expected in cases.items():
        compare = node(
            "Compare", "ShaderNodeMath", {"Value": "FLOAT"}, "", {"operation": "COMPARE"},
            Value=a, Value_001=b, Value_002=epsilon,
        )  # fmt: skip
        shown = graph(compare, emission(Color=("Compare", "Value")), surface=("Emission", "Emission"))
        assert evaluate(compile_material("Test", shown))["emission"][0, 0] == expected
