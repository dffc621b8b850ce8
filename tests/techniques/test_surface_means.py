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


@pytest.fixture
def one_sided(stage):
    """Diffuse where it faces the ray, and not there at all from behind."""
    material = stage.diffuse(0.8)
    tree = material.node_tree
    diffuse, output = (next(n for n in tree.nodes if n.type == kind) for kind in ("BSDF_DIFFUSE", "OUTPUT_MATERIAL"))
    mix, nothing = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new("ShaderNodeBsdfTransparent")
    tree.links.new(tree.nodes.new("ShaderNodeNewGeometry").outputs["Backfacing"], mix.inputs[0])
    tree.links.new(diffuse.outputs[0], mix.inputs[1])
    tree.links.new(nothing.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], output.inputs["Surface"])
    return material


def test_sides_have_an_opacity_each(stage, one_sided):
    stage.blocker((-1, -1), (1, 1), 1.0, material=one_sided)
    stage.floor()
    stage.light("SUN")
    stage.camera_above()
    stage.render(1, (16, 16))
    material = next(one for one in stage.renderer.frame.measured_materials if one.name == one_sided.name)
    assert (material.opacity, material.opacity_behind) == (1.0, 0.0)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("upside_down", [False, True])
def test_rays_meet_the_side_that_is_there(stage, one_sided, mirrored, upside_down):
    """What a mirror shows of a card above it that is there from one side only."""
    stage.floor(material=stage.material("ShaderNodeBsdfGlossy", Color=(1, 1, 1, 1), Roughness=0.0))
    stage.rectangle(
        (-1, -1), (1, 1), material=one_sided, location=(0, 0, 1), turn=(np.pi * upside_down, 0, 0),
        scale=(-1 if mirrored else 1, 1, 1),
    ).visible_camera = False  # fmt: skip
    stage.world()
    stage.camera_above()
    direct = stage.render(16, (16, 16))["glossy_direct"][6:10, 6:10, 0].mean()
    cycles = stage.render(16, (16, 16), engine="CYCLES")["glossy_direct"][6:10, 6:10, 0].mean()
    assert cycles == pytest.approx(0.0 if upside_down else 1.0, abs=0.01)
    assert direct == pytest.approx(cycles, abs=0.01)


def test_a_room_whose_walls_are_seen_through_from_outside_keeps_its_light(stage, one_sided):
    """A box with its faces turned inwards and a lamp in it, seen through its own wall: as if it were opaque."""
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (0, 2)]
    faces = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
    stage.mesh(corners, faces, material=one_sided)
    stage.light("AREA", (0, 0, 1.9), size=0.5)
    stage.camera((0, -5, 1), (np.pi / 2, 0, 0), angle=0.5)
    ours, cycles = (
        stage.render(samples, (24, 24), bounces=6, engine=engine)["diffuse_indirect"][..., :3].mean()
        for engine, samples in (("CANDELA", 16), ("CYCLES", 64))
    )
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
