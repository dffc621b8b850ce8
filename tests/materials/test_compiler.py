"""What the compiler promises about programs, values and static facts. No GPU."""

import time

import numpy as np
import pytest

from addon.materials.compiler import (
    compile_material,
    default_graph,
    may_be_soft,
    may_mirror,
    may_refract,
    may_tint,
)
from addon.materials.graph import Graph, Input, Node
from addon.snapshot.scene import Image
from tests.materials.graphs import diffuse, emission, graph, image, math, mix, node, principled, transparent


def compiled(*nodes, surface, images=None):
    return compile_material("Test", graph(*nodes, surface=surface), images)


def picture(key="picture", color=(0.5, 0.5, 0.5), alpha=1.0, **settings):
    pixels = np.zeros((4, 4, 4), np.float32)
    pixels[..., :3], pixels[..., 3] = color, alpha
    return Image(key, 1, pixels, **settings)


def test_a_changed_slider_changes_values_and_nothing_else():
    first = compiled(principled(Roughness=0.1, Metallic=0.0), surface=("Principled", "BSDF"))
    second = compiled(principled(Roughness=0.9, Metallic=1.0), surface=("Principled", "BSDF"))
    assert first.program_key == second.program_key
    assert first.glsl == second.glsl
    assert not np.array_equal(first.values, second.values)


def test_names_of_nodes_do_not_make_another_program():
    first = compiled(diffuse("A"), surface=("A", "BSDF"))
    second = compiled(diffuse("B"), surface=("B", "BSDF"))
    assert first.program_key == second.program_key


def test_a_constant_factor_of_0_prunes_nothing():
    def two(fac):
        return compiled(
            diffuse(), transparent(), mix("Mix", fac, ("Diffuse", "BSDF"), ("Transparent", "BSDF")),
            surface=("Mix", "Shader"),
        )  # fmt: skip

    assert two(0.0).program_key == two(0.5).program_key
    assert "shader_transparent" in two(0.0).glsl
    assert not two(0.0).transparent
    assert two(0.5).transparent


def test_another_link_makes_another_program():
    first = compiled(emission(Color=(1.0, 0.0, 0.0, 1.0)), surface=("Emission", "Emission"))
    second = compiled(math("Math", "ADD", 1.0), emission(Color=("Math", "Value")), surface=("Emission", "Emission"))
    assert first.program_key != second.program_key


def test_a_shared_value_is_computed_once():
    material = compiled(
        image("Image", "picture"),
        math("A", "ADD", ("Image", "Color")),
        math("B", "MULTIPLY", ("A", "Value"), ("A", "Value")),
        diffuse(Color=("A", "Value"), Roughness=("B", "Value")),
        emission(Color=("Image", "Color"), Strength=("B", "Value")),
        node("Add", "ShaderNodeAddShader", {"Shader": "SHADER"}, Shader=("Diffuse", "BSDF"),
             Shader_001=("Emission", "Emission")),
        surface=("Add", "Shader"),
    )  # fmt: skip
    body = material.glsl[material.glsl.index("void evaluate_material") :]
    assert body.count("material_image0_flat(") == 1
    assert body.count("math_add(") == 1
    assert body.count("math_multiply(") == 1


def test_a_value_that_a_shader_reads_itself_is_computed_before_what_else_reads_it():
    """Color hangs on the image over two nodes, Roughness directly: the image is asked for second, and needed first."""
    material = compiled(
        image("Image", "picture"),
        math("Near", "ADD", ("Image", "Color"), 0.25),
        math("Far", "MULTIPLY", ("Near", "Value"), 0.5),
        diffuse(Color=("Far", "Value"), Roughness=("Image", "Alpha")),
        surface=("Diffuse", "BSDF"),
    )
    body = material.glsl[material.glsl.index("void evaluate_material") :]
    places = [body.index(call) for call in ("material_image0_flat(", "math_add(", "math_multiply(", "shader_diffuse(")]
    assert places == sorted(places)


def test_a_shared_shader_is_drawn_once_with_the_sum_of_its_weights():
    material = compiled(
        diffuse(),
        mix("Mix", 0.3, ("Diffuse", "BSDF"), ("Diffuse", "BSDF")),
        surface=("Mix", "Shader"),
    )
    assert material.glsl.count("shader_diffuse(") == 1
    assert material.diffuse and not material.glossy


def test_an_empty_surface_has_no_closure_and_the_default_is_diffuse():
    empty = compile_material("Empty", Graph())
    assert not (empty.diffuse or empty.glossy or empty.emissive or empty.transparent)
    assert empty.values.shape == (1, 4)
    default = compile_material("Default", default_graph())
    assert default.diffuse and default.opacity == 1.0


def test_constants_are_converted_between_kinds_as_blender_does():
    def roughness_of(kind, value):
        shader = Node(
            "D", "D", "ShaderNodeBsdfDiffuse", {"Color": Input("FLOAT", 0.25), "Roughness": Input(kind, value)},
            {"BSDF": "SHADER"},
        )  # fmt: skip
        return compile_material("Test", graph(shader, surface=("D", "BSDF"))).values[0]

    assert roughness_of("COLOR", (0.0, 1.0, 0.0, 1.0)) == pytest.approx((0.25, 0.25, 0.25, 0.7152), abs=1e-4)
    assert roughness_of("VECTOR", (0.0, 1.0, 0.5))[3] == pytest.approx(0.5)


@pytest.mark.parametrize("node_type", ["ShaderNodeShaderToRGB", "NodeUndefined", "ShaderNodeScript"])
def test_an_unknown_value_node_leaves_the_constant_and_says_so(node_type):
    unknown = node("Strange", node_type, {"Color": "COLOR", "Fac": "FLOAT"})
    shader = Node(
        "D", "D", "ShaderNodeBsdfDiffuse", {"Color": Input("COLOR", (0.1, 0.2, 0.3, 1.0), ("Strange", "Color"))},
        {"BSDF": "SHADER"},
    )  # fmt: skip
    material = compile_material("Test", graph(unknown, shader, surface=("D", "BSDF")))
    assert material.values[0, :3] == pytest.approx((0.1, 0.2, 0.3))
    assert [label for label, _ in material.fallbacks] == ["Strange"]


def test_an_unknown_shader_is_diffuse_of_its_own_color():
    hair = node("Hair", "ShaderNodeBsdfHair", {"BSDF": "SHADER"}, Color=(0.1, 0.2, 0.3, 1.0))
    material = compiled(hair, surface=("Hair", "BSDF"))
    assert material.diffuse
    assert material.values[0, :3] == pytest.approx((0.1, 0.2, 0.3))
    assert "not supported" in material.fallbacks[0][1]


def test_every_approximation_is_named_only_when_it_is_seen():
    plain = compiled(principled(Subsurface_Weight=0.0, Sheen_Weight=0.0), surface=("Principled", "BSDF"))
    assert plain.fallbacks == ()
    waxy = compiled(principled(Subsurface_Weight=0.5, Sheen_Weight=1.0, Thin_Wall=1.0), surface=("Principled", "BSDF"))
    assert len(waxy.fallbacks) == 1
    assert waxy.program_key == plain.program_key


def test_a_thin_wall_bends_no_light():
    """So it throws no caustics, and what shines through it casts its straight shadow."""
    wall, pane = (
        graph(principled(Transmission_Weight=1.0, Thin_Wall=thin), surface=("Principled", "BSDF"))
        for thin in (1.0, 0.0)
    )
    assert may_refract(pane) and not may_refract(wall)


@pytest.mark.parametrize("nodes", [
    [principled()], [principled(Sheen_Weight=0.5)],
    [principled(Sheen_Weight=("Math", "Value")), math("Math", "ADD", 1.0)],
    [principled(Subsurface_Weight=0.5)], [principled(Subsurface_Weight=0.5, Thin_Wall=1.0)],
    [principled(Thin_Wall=1.0)],
    *([node("Principled", f"ShaderNodeBsdf{kind}", {"BSDF": "SHADER"})]
      for kind in ("Diffuse", "Glossy", "Sheen", "Translucent", "Toon", "HairPrincipled", "Hair", "RayPortal")),
])  # fmt: skip
def test_soft_lobes_are_known_before_a_material_is_compiled(nodes):
    assert (
        may_be_soft(graph(*nodes, surface=("Principled", "BSDF")))
        == compiled(*nodes, surface=("Principled", "BSDF")).soft
    )


def test_a_wall_bends_light_where_a_node_may_say_that_it_is_not_thin():
    """For rays, which ask its interfaces, and for whoever looks for what throws caustics."""
    nodes = principled(Transmission_Weight=1.0, Thin_Wall=("Math", "Value")), math("Math", "ADD", 0.0, 0.0)
    assert compiled(*nodes, surface=("Principled", "BSDF")).glass is not None
    assert may_refract(graph(*nodes, surface=("Principled", "BSDF")))


def test_a_missing_image_is_pink_and_said():
    material = compiled(
        image("Image", "gone"), emission(Color=("Image", "Color")), surface=("Emission", "Emission"), images={}
    )
    assert material.images == ()
    assert "missing" in material.fallbacks[0][1]
    assert material.emissive


def test_alpha_decides_transparency_by_value_and_by_pixels():
    def with_alpha(alpha_of_image):
        return compiled(
            image("Image", "picture"),
            principled(Alpha=("Image", "Alpha")),
            surface=("Principled", "BSDF"),
            images={"picture": picture(alpha=alpha_of_image)},
        )

    assert not compiled(principled(Alpha=1.0), surface=("Principled", "BSDF")).transparent
    assert compiled(principled(Alpha=0.9), surface=("Principled", "BSDF")).transparent
    assert not with_alpha(1.0).transparent
    assert with_alpha(0.25).transparent
    assert with_alpha(0.25).opacity == pytest.approx(0.25)
    assert with_alpha(1.0).program_key == with_alpha(0.25).program_key


@pytest.mark.parametrize(("shader", "mirrors", "tints"), [
    (diffuse(Color=(0.8, 0.5, 0.1, 1.0)), False, False),
    (principled("Principled", Roughness=1.0), True, False),
    (principled("Principled", Transmission_Weight=1.0, Base_Color=(0.8, 0.5, 0.1, 1.0)), True, True),
    (principled("Principled", Transmission_Weight=0.0, Base_Color=(0.8, 0.5, 0.1, 1.0)), True, False),
    (transparent(Color=(0.8, 0.8, 0.8, 1.0)), False, False),
    (transparent(Color=(0.8, 0.5, 0.1, 1.0)), False, True),
])  # fmt: skip
def test_what_may_mirror_or_tint_is_told_from_a_graph_as_from_a_compiled_one(shader, mirrors, tints):
    made = graph(shader, surface=(shader.key, "BSDF"))
    found = compile_material("Material", made)
    assert (may_mirror(made), may_tint(made)) == (found.glossy, found.tinted) == (mirrors, tints)


def test_mean_emission_of_constants_and_images():
    constant = compiled(emission(Color=(1.0, 0.5, 0.25, 1.0), Strength=4.0), surface=("Emission", "Emission"))
    assert constant.emission == pytest.approx((4.0, 2.0, 1.0))
    assert not compiled(emission(Strength=0.0), surface=("Emission", "Emission")).emissive
    # sRGB 0.5 decodes to 0.21404 (IEC 61966-2-1).
    shown = compiled(
        image("Image", "picture"),
        emission(Color=("Image", "Color"), Strength=2.0),
        surface=("Emission", "Emission"),
        images={"picture": picture(encoding="SRGB")},
    )
    assert shown.emission == pytest.approx((0.42808,) * 3, rel=1e-3)


def test_encoding_and_alpha_mode_of_an_image_are_values():
    def with_image(**settings):
        return compiled(
            image("Image", "picture"), emission(Color=("Image", "Color")), surface=("Emission", "Emission"),
            images={"picture": picture(**settings)},
        )  # fmt: skip

    assert with_image(encoding="SRGB").program_key == with_image(encoding="LINEAR", alpha_mode="NONE").program_key


def test_too_many_images_are_said():
    count = 14
    textures = [image(f"I{k}", f"picture{k}") for k in range(count)]
    sums = [math(f"S{k}", "ADD", (f"I{k}", "Color"), (f"S{k - 1}", "Value") if k else 0.0) for k in range(count)]
    material = compiled(*textures, *sums, emission(Color=(f"S{count - 1}", "Value")), surface=("Emission", "Emission"))
    assert len(material.images) == 12
    assert len(material.fallbacks) == 2


def test_more_sliders_than_a_uniform_block_holds_still_compile():
    count = 2500
    chain = [math(f"M{k}", "ADD", (f"M{k - 1}", "Value") if k else 1.0, 0.25) for k in range(count)]
    for k in range(count):  # a third socket each, so that the block overflows
        chain[k].inputs["Value_002"] = Input("FLOAT", 0.0)
    material = compiled(*chain, emission(Color=(f"M{count - 1}", "Value")), surface=("Emission", "Emission"))
    assert len(material.values) <= 1024
    assert any("uniform block" in sentence for _, sentence in material.fallbacks)


@pytest.mark.timing
def test_300_nodes_compile_in_a_fifth_of_a_second():
    chain = [math(f"M{k}", "MULTIPLY_ADD", (f"M{k - 1}", "Value") if k else 1.0) for k in range(300)]
    tree = graph(*chain, principled(Base_Color=("M299", "Value")), surface=("Principled", "BSDF"))
    compile_material("Warm", tree)
    start = time.process_time()
    compile_material("Test", tree)
    assert time.process_time() - start < 0.2


def test_cycles_in_a_graph_made_by_hand_end():
    a = math("A", "ADD", ("B", "Value"))
    b = math("B", "ADD", ("A", "Value"))
    compiled(a, b, emission(Color=("A", "Value")), surface=("Emission", "Emission"))
    first = mix("First", 0.5, ("Second", "Shader"), ("Diffuse", "BSDF"))
    second = mix("Second", 0.5, ("First", "Shader"), ("Diffuse", "BSDF"))
    assert compiled(first, second, diffuse(), surface=("First", "Shader")).diffuse
