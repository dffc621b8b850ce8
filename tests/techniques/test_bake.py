"""Blender's bake operator with Candela, beside Cycles' own."""

import bpy
import numpy as np
import pytest

from addon.gfx import context

pytestmark = pytest.mark.usefixtures("opened")
LIGHT = {"DIRECT", "INDIRECT"}
SIDE = 12


@pytest.fixture
def opened():
    """The GPU's context, which Blender before 5.2 does not open in a bake."""
    context.ensure()


@pytest.fixture
def workshop(stage):
    """A cube above a floor, in the light of a sun, a lamp and the world; no camera."""
    bpy.ops.mesh.primitive_cube_add(size=1.5, location=(0, 0, 1))
    cube = bpy.context.object
    cube.data.materials.append(stage.principled(Base_Color=(0.8, 0.3, 0.2, 1), Roughness=0.4))
    stage.rectangle((-3, -3), (3, 3), material=stage.diffuse(0.6))
    stage.world((0.4, 0.5, 0.7), 0.5)
    stage.light("SUN", turn=(0.6, 0.4, 0), angle=0.1, energy=1.5)
    stage.light("POINT", location=(2, -2, 3), energy=200, shadow_soft_size=0.3)
    return cube


def baked(stage, thing, engine, kind, parts=frozenset(), selected=(), samples=16, **options):
    """(SIDE, SIDE, 4) texels that the operator has filled."""
    scene = stage.scene
    image = bpy.data.images.new("Target", SIDE, SIDE, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    for slot in thing.material_slots:
        node = slot.material.node_tree.nodes.new("ShaderNodeTexImage")
        node.image = image
        slot.material.node_tree.nodes.active = node
    before = scene.render.engine
    scene.render.engine = engine
    scene.candela.samples, scene.cycles.samples, scene.cycles.use_denoising = samples, 256, False
    for one in bpy.context.selected_objects:
        one.select_set(False)
    for one in (thing, *selected):
        one.select_set(True)
    bpy.context.view_layer.objects.active = thing
    try:
        bpy.ops.object.bake(type=kind, pass_filter=set(parts), margin=0, use_clear=True, **options)
    finally:
        scene.render.engine = before
    return np.array(image.pixels[:], np.float64).reshape(SIDE, SIDE, 4)


def beside(stage, thing, kind, parts=frozenset(), **options):
    """Texels of the object by Candela and by Cycles, (N, 3) each."""
    own, cycles = (baked(stage, thing, engine, kind, parts, **options) for engine in ("CANDELA", "CYCLES"))
    where = baked(stage, thing, "CANDELA", "UV")[..., 3] > 0.5 if "selected" not in options else cycles[..., 3] > 0.5
    return own[where][:, :3], cycles[where][:, :3]


def error(own, cycles):
    return float(((own - cycles) ** 2 / (cycles**2 + 1e-2)).mean())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "parts"),
    [
        ("COMBINED", LIGHT | {"DIFFUSE", "GLOSSY", "TRANSMISSION", "EMIT"}), ("DIFFUSE", {"DIRECT"}),
        ("GLOSSY", {"DIRECT", "INDIRECT", "COLOR"}), ("AO", ()),
    ],
)  # fmt: skip
def test_light_that_is_baked_is_that_of_cycles(stage, workshop, kind, parts):
    own, cycles = beside(stage, workshop, kind, parts)
    found = error(own, cycles)
    print(f"relMSE {found:.4f}")
    assert found < 0.01


@pytest.mark.parametrize(
    ("kind", "parts", "options"),
    [("DIFFUSE", {"COLOR"}, {}), ("GLOSSY", {"COLOR"}, {}), ("NORMAL", (), {"normal_space": "OBJECT"}),
     ("ROUGHNESS", (), {})],
)  # fmt: skip
def test_what_is_baked_of_surfaces_is_that_of_cycles(stage, workshop, kind, parts, options):
    workshop.rotation_euler = (0.3, 0.2, 0.1)
    own, cycles = beside(stage, workshop, kind, parts, **options)
    np.testing.assert_allclose(own, cycles, atol=2e-3)


def test_places_and_the_map_are_those_of_texels(stage, workshop):
    """Of a floor that fills its map: texel k of 12 lies at (k + 1/2) / 12."""
    floor = stage.rectangle((-1, -1), (1, 1), z=-1.0, material=stage.diffuse(0.5))
    layer = floor.data.uv_layers.new(name="UVMap")
    for corner, place in enumerate([(0, 0), (1, 0), (1, 1), (0, 1)]):
        layer.uv[corner].vector = place
    middles = (np.arange(SIDE) + 0.5) / SIDE
    u, v = np.meshgrid(middles, middles)
    position = baked(stage, floor, "CANDELA", "POSITION")
    np.testing.assert_allclose(position[..., :3], np.stack([2 * u - 1, 2 * v - 1, -np.ones_like(u)], -1), atol=1e-3)
    np.testing.assert_allclose(baked(stage, floor, "CANDELA", "UV")[..., :2], np.stack([u, v], -1), atol=1e-3)


@pytest.mark.slow
def test_a_detailed_object_is_baked_onto_a_simple_one(stage, workshop):
    """Selected to active: normals in the simple one's tangent space, and light."""
    bpy.ops.mesh.primitive_ico_sphere_add(radius=0.8, subdivisions=4, location=(0, 0, 1))
    detailed = bpy.context.object
    bpy.ops.object.shade_smooth()
    detailed.data.materials.append(stage.principled(Base_Color=(0.8, 0.5, 0.3, 1)))
    options = {"selected": (detailed,), "use_selected_to_active": True, "cage_extrusion": 0.6}
    own, cycles = beside(stage, workshop, "NORMAL", **options)
    np.testing.assert_allclose(own, cycles, atol=0.03)
    found = error(*beside(stage, workshop, "DIFFUSE", LIGHT | {"COLOR"}, **options))
    print(f"relMSE {found:.4f}")
    assert found < 0.01


def test_a_mirror_that_is_baked_once_shows_what_its_places_see(stage, workshop):
    """A smooth metal cube above a floor: with one sample three of four rays started in the camera's picture, but for
    scenes without anything transparent, where all points of a pixel show the same."""
    workshop.data.materials[0] = stage.principled(Base_Color=(1, 1, 1, 1), Metallic=1.0, Roughness=0.0)
    stage.camera((0, 0, 40), (0, 0, 0), 0.5)
    inside = baked(stage, workshop, "CANDELA", "UV")[..., 3] > 0.5

    def found():
        return baked(stage, workshop, "CANDELA", "GLOSSY", {"INDIRECT"}, samples=1)[inside][:, :3].mean(axis=0)

    alike = found()
    stage.rectangle((-1, -1), (1, 1), -1.0, material=stage.principled(Alpha=0.5))  # below the floor
    print(f"{found().round(4)} of {alike.round(4)}")
    assert alike.min() > 0.02 and found() == pytest.approx(alike, rel=0.02)


def test_vertices_may_be_the_target(stage):
    """A floor in the light of a sun that stands upright: its colour times 1 / pi at each corner."""
    floor = stage.rectangle((-1, -1), (1, 1), material=stage.diffuse(0.5))
    floor.data.color_attributes.new("Light", "FLOAT_COLOR", "POINT")
    stage.light("SUN", angle=0.0, energy=2.0)
    stage.scene.candela.samples = 2
    bpy.context.view_layer.objects.active = floor
    floor.select_set(True)
    before, stage.scene.render.engine = stage.scene.render.engine, "CANDELA"
    try:
        bpy.ops.object.bake(type="DIFFUSE", pass_filter={"DIRECT", "COLOR"}, target="VERTEX_COLORS")
    finally:
        stage.scene.render.engine = before
    found = [one.color[0] for one in floor.data.color_attributes["Light"].data]
    np.testing.assert_allclose(found, 0.5 * 2.0 / np.pi, rtol=5e-3)
