"""Means of materials over what shows them: emission of gradients."""

import numpy as np
import pytest

from addon.scene.overview import overview


def ramp(stage, factor_of, ends):
    """An emissive material whose strength runs between `ends` over a value that `factor_of` gives of its tree."""
    material = stage.material("ShaderNodeEmission", Color=(1, 1, 1, 1))
    tree = material.node_tree
    blend = tree.nodes.new("ShaderNodeMapRange")
    blend.inputs["To Min"].default_value, blend.inputs["To Max"].default_value = ends
    tree.links.new(factor_of(tree), blend.inputs["Value"])
    emission = next(node for node in tree.nodes if node.type == "EMISSION")
    tree.links.new(blend.outputs[0], emission.inputs["Strength"])
    return material


def along_u(tree):
    apart = tree.nodes.new("ShaderNodeSeparateXYZ")
    tree.links.new(tree.nodes.new("ShaderNodeTexCoord").outputs["UV"], apart.inputs[0])
    return apart.outputs["X"]


def camera_ray(tree):
    return tree.nodes.new("ShaderNodeLightPath").outputs["Is Camera Ray"]


@pytest.mark.parametrize(
    ("factor_of", "ends", "expected"), [(along_u, (0.0, 8.0), 6.0), (camera_ray, (3.0, 0.0), 3.0)], ids=["u", "ray"]
)
def test_surfaces_get_what_a_material_emits_on_average(stage, factor_of, ends, expected):
    """A panel high above a floor, that shows u from .5 to 1, or that the camera does not see shine."""
    panel = stage.card(ramp(stage, factor_of, ends), 0.5, 1.0, location=(0.0, 0.0, 3.0))
    panel.visible_camera = panel.visible_shadow = False
    stage.floor()
    stage.camera_above()
    ours = stage.render(16, (16, 16))["diffuse_direct"][..., 0].mean()
    found = [one for one in stage.renderer.frame.measured_materials if one.emissive]
    assert found[0].emission == pytest.approx((expected,) * 3, rel=0.01)
    cycles = stage.render(256, (16, 16), engine="CYCLES")["diffuse_direct"][..., 0].mean()
    assert ours == pytest.approx(cycles, rel=0.03)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("down", [False, True])
def test_a_panel_that_shines_to_one_side_lights_that_side(stage, down, mirrored):
    """Between a floor and a ceiling: what it shines at is as bright as in Cycles, the other side dark; and so is what a
    mirror sees of it."""
    material = stage.material("ShaderNodeEmission", Color=(1, 1, 1, 1))
    tree = material.node_tree
    strength = tree.nodes.new("ShaderNodeMapRange")
    strength.inputs["To Min"].default_value, strength.inputs["To Max"].default_value = 4.0, 0.0
    tree.links.new(tree.nodes.new("ShaderNodeNewGeometry").outputs["Backfacing"], strength.inputs["Value"])
    emission = next(node for node in tree.nodes if node.type == "EMISSION")
    tree.links.new(strength.outputs[0], emission.inputs["Strength"])
    panel = stage.rectangle(
        (-0.5, -0.5), (0.5, 0.5), material=material, location=(0, 0, 1), turn=(np.pi * down, 0, 0),
        scale=(-1 if mirrored else 1, 1, 1),
    )  # fmt: skip
    panel.visible_camera = False
    stage.floor(material=stage.principled(Base_Color=(0.8, 0.8, 0.8, 1), Metallic=0.5, Roughness=0.2))
    stage.camera_above()
    ours, cycles = (stage.render(n, (16, 16), engine=engine) for engine, n in (("CANDELA", 16), ("CYCLES", 256)))
    for path in ("diffuse_direct", "glossy_direct"):
        assert (cycles[path].max() > 0.1) == down
        assert ours[path][..., 0].mean() == pytest.approx(cycles[path][..., 0].mean(), rel=0.03, abs=1e-6)


@pytest.mark.parametrize("backward", [(0.0, 0.6, 0.8), (0.6, 0.64, 0.48)])
def test_an_overview_shows_the_whole_box_from_beyond_it(backward):
    """All corners within the picture, its middle in the middle, the eye a diagonal away on the side it looks from."""
    low, high, backward = np.array([-1.0, 0.0, 2.0]), np.array([3.0, 1.0, 4.0]), np.array(backward)
    view = overview(low, high, backward)
    corners = np.array([[x, y, z, 1] for x in (-1, 3) for y in (0, 1) for z in (2, 4)])
    for row in ("row_x", "row_y"):
        assert np.abs(corners @ view[row]).max() <= 1.0
        assert np.append((low + high) / 2, 1) @ view[row] == pytest.approx(0.0, abs=1e-12)
    assert (np.array(view["eye"][:3]) - (low + high) / 2) @ backward == pytest.approx(np.linalg.norm(high - low))
