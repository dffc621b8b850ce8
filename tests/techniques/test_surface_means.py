"""Means of materials over what shows them: opacity of parts of a sheet of sprites, emission of gradients."""

import bpy
import numpy as np
import pytest

UPRIGHT = {"location": (-1.0, 0.0, 1.0), "turn": (0, np.pi / 2, 0)}
SHEET = 64  # pixels a side: the left half lets all light pass, the right half none


@pytest.fixture
def sheet(stage):
    """A diffuse material whose alpha is an image."""
    image = bpy.data.images.new("Sheet", SHEET, SHEET, alpha=True)
    pixels = np.ones((SHEET, SHEET, 4), np.float32)
    pixels[:, : SHEET // 2, 3] = 0.0
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    material = stage.principled(Base_Color=(0.8, 0.8, 0.8, 1), Specular_IOR_Level=0.0)
    tree = material.node_tree
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image, texture.interpolation = image, "Closest"
    shader = next(node for node in tree.nodes if node.type == "BSDF_PRINCIPLED")
    tree.links.new(texture.outputs["Alpha"], shader.inputs["Alpha"])
    return material


def card(stage, material, left, right, **placement):
    """A square that shows the image between `left` and `right`."""
    made = stage.rectangle((-1, -1), (1, 1), material=material, **placement)
    layer = made.data.uv_layers.new(name="UVMap")
    for corner, place in enumerate([(left, 0), (right, 0), (right, 1), (left, 1)]):
        layer.uv[corner].vector = place
    return made


def opacity(stage, material):
    frame = stage.renderer.frame
    return next(one.opacity for one in frame.measured_materials if one.name == material.name)


@pytest.mark.parametrize(("left", "right", "expected"), [(0.55, 0.95, 1.0), (0.05, 0.45, 0.0), (0.0, 1.0, 0.5)])
@pytest.mark.parametrize("shadow", [True, False])
def test_opacity_is_that_of_the_part_that_is_shown(stage, sheet, left, right, expected, shadow):
    sheet.use_transparent_shadow = shadow
    card(stage, sheet, left, right)
    stage.floor(z=-1.0)
    stage.light("SUN")
    stage.camera_above()
    stage.render(1, (16, 16))
    assert opacity(stage, sheet) == pytest.approx(expected, abs=0.03)


def test_what_shows_a_material_is_weighted_by_its_size(stage, sheet):
    card(stage, sheet, 0.55, 0.95)
    card(stage, sheet, 0.05, 0.45, location=(1.0, 0.0, 0.5), scale=(0.5, 0.5, 1.0))
    stage.light("SUN")
    stage.camera_above()
    stage.render(1, (16, 16))
    assert opacity(stage, sheet) == pytest.approx(0.8, abs=0.04)


def test_it_is_measured_once(stage, sheet, monkeypatch):
    from addon.frame import surface_means

    made = []
    measured = surface_means._opacity
    monkeypatch.setattr(surface_means, "_opacity", lambda *arguments: made.append(1) or measured(*arguments))
    placed = card(stage, sheet, 0.0, 1.0)
    stage.light("SUN")
    stage.camera_above()
    stage.render(2, (16, 16), bounces=2)
    placed.location.x = 0.3
    stage.render(2, (16, 16), bounces=2)
    assert opacity(stage, sheet) == pytest.approx(0.5, abs=0.03)
    assert len(made) == 1


def test_a_wall_that_shows_an_opaque_part_keeps_light_in(stage, sheet):
    """Two walls of a corner under a sun: as much light between them as if the material had no alpha."""
    found = []
    for material in (sheet, stage.principled(Base_Color=(0.8, 0.8, 0.8, 1), Specular_IOR_Level=0.0)):
        walls = [card(stage, material, 0.55, 0.95, **place) for place in ({}, UPRIGHT)]
        if not found:
            stage.light("SUN", turn=(0, 0.5, 0), energy=5.0)
            stage.camera_above()
        found.append(stage.render(8, (24, 24), bounces=4)["diffuse_indirect"][..., :3].mean())
        for wall in walls:
            bpy.data.objects.remove(wall)
    assert found[0] == pytest.approx(found[1], rel=0.02)


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
    panel = card(stage, ramp(stage, factor_of, ends), 0.5, 1.0, location=(0.0, 0.0, 3.0))
    panel.visible_camera = panel.visible_shadow = False
    stage.floor()
    stage.camera_above()
    ours = stage.render(16, (16, 16))["diffuse_direct"][..., 0].mean()
    found = [one for one in stage.renderer.frame.measured_materials if one.emissive]
    assert found[0].emission == pytest.approx((expected,) * 3, rel=0.01)
    cycles = stage.render(256, (16, 16), engine="CYCLES")["diffuse_direct"][..., 0].mean()
    assert ours == pytest.approx(cycles, rel=0.03)
