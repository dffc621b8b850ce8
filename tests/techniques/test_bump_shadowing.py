"""Bumped surfaces shade themselves: the closed form of Estevez et al. 2019, and Cycles under a world."""

import bpy
import numpy as np
import pytest

from addon.compare.passes import light_paths

ALBEDO = 0.8


@pytest.fixture
def lit(stage):
    """Diffuse direct radiance of a floor whose normal map turns all normals by `tilt` towards +x."""

    def lit(tilt, samples=16, kind="Diffuse", **options):
        material = stage.material(f"ShaderNodeBsdf{kind}", Color=(ALBEDO, ALBEDO, ALBEDO, 1.0))
        nodes, links = material.node_tree.nodes, material.node_tree.links
        turned = nodes.new("ShaderNodeNormalMap")
        turned.space = "WORLD"
        turned.inputs["Color"].default_value = (0.5 + 0.5 * np.sin(tilt), 0.5, 0.5 + 0.5 * np.cos(tilt), 1.0)
        shader = next(node for node in nodes if node.bl_idname == f"ShaderNodeBsdf{kind}")
        links.new(turned.outputs[0], shader.inputs["Normal"])
        for placed in [placed for placed in stage.scene.objects if placed.type == "MESH"]:
            bpy.data.objects.remove(placed)
        stage.floor(material=material)
        stage.camera_above(2.0)
        return float(light_paths(stage.render(samples, (8, 8), **options))["diffuse_direct"].mean())

    return lit


@pytest.mark.parametrize("sun", [0.0, 0.5, 1.0, 1.4])
@pytest.mark.parametrize("tilt", [0.0, 0.1, 0.5, 0.9])
def test_the_sun_on_a_tilted_normal_is_dimmed_by_the_bump(stage, lit, tilt, sun):
    stage.light("SUN", turn=(0.0, sun, 0.0), energy=np.pi, angle=0.0)
    roughness_squared = min(0.125 * np.tan(tilt) ** 2, 1.0)
    shadowing = 2.0 / (1.0 + np.sqrt(1.0 + roughness_squared * np.tan(sun) ** 2))
    expected = ALBEDO * np.cos(tilt - sun) * shadowing
    assert lit(tilt) == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("sun", [-2.8, -2.1, -1.7, -0.7, 0.0, 1.2, 1.5, 1.7, 2.4])
@pytest.mark.parametrize("kind", ["Translucent", "Sheen", "Toon"])
def test_other_diffuse_shaders_are_dimmed_as_by_cycles(stage, lit, kind, sun):
    stage.light("SUN", turn=(0.0, sun, 0.0), energy=np.pi, angle=0.0)
    expected = lit(0.8, 4, kind, engine="CYCLES")  # along the floor's diagonal it loses some of the light from behind
    assert lit(0.8, 4, kind) == pytest.approx(expected, rel=0.02, abs=2e-3)


def test_light_does_not_come_through_the_surface_onto_a_bump(stage, lit):
    """The normal faces a sun that stands below the floor."""
    stage.light("SUN", turn=(0.0, 1.7, 0.0), energy=np.pi, angle=0.0)
    assert lit(0.6) < 1e-3


@pytest.mark.parametrize("tilt", [1.7, 2.5])
def test_no_light_reaches_a_normal_that_is_turned_below_the_surface(stage, lit, tilt):
    """As by a normal map whose image is black, which says (-1, -1, -1)."""
    stage.light("SUN", turn=(0.0, 1.2, 0.0), energy=np.pi, angle=0.0)
    stage.world((1, 1, 1), 0.5)
    assert lit(tilt, 4, engine="CYCLES") == 0.0
    assert lit(tilt, 4) == 0.0


@pytest.mark.parametrize("tilt", [0.3, 0.6])
def test_the_world_lights_a_bumped_floor_as_in_cycles(stage, lit, tilt):
    stage.world((1, 1, 1), 0.5)
    assert lit(tilt, samples=64) == pytest.approx(lit(tilt, samples=512, engine="CYCLES"), rel=0.01)


@pytest.mark.parametrize("sun", [-0.6, 0.3, 1.0])
@pytest.mark.parametrize("slope", [0.0, 0.3, -0.5])
def test_a_normal_map_on_a_displaced_surface_is_dimmed_by_what_lies_between_the_two(stage, slope, sun):
    """Displacement turns the normal that bumps are measured from, but not the frame of a normal map, as in Cycles.

    The displaced normal is kept to within four degrees.
    """
    tilt, displaced = 0.3, -np.arctan(slope)
    material = stage.diffuse(ALBEDO)
    nodes, links = material.node_tree.nodes, material.node_tree.links
    turned, place, apart, height = (
        nodes.new(f"ShaderNode{kind}") for kind in ("NormalMap", "TexCoord", "SeparateXYZ", "Displacement")
    )
    turned.inputs["Color"].default_value = (0.5 + 0.5 * np.sin(tilt), 0.5, 0.5 + 0.5 * np.cos(tilt), 1.0)
    height.inputs["Midlevel"].default_value, height.inputs["Scale"].default_value = 0.0, slope
    shader = next(node for node in nodes if node.bl_idname == "ShaderNodeBsdfDiffuse")
    output = next(node for node in nodes if node.bl_idname == "ShaderNodeOutputMaterial")
    links.new(turned.outputs[0], shader.inputs["Normal"])
    links.new(place.outputs["Object"], apart.inputs[0])
    links.new(apart.outputs["X"], height.inputs["Height"])
    links.new(height.outputs[0], output.inputs["Displacement"])
    floor = stage.rectangle((-4, -4), (4, 4), material=material)
    floor.data.uv_layers.new().data.foreach_set("uv", np.array([0, 0, 1, 0, 1, 1, 0, 1], float))
    stage.camera_above(2.0)
    stage.light("SUN", turn=(0.0, sun, 0.0), energy=np.pi, angle=0.0)

    def lit(**options):
        return float(light_paths(stage.render(16, (8, 8), **options))["diffuse_direct"].mean())

    roughness_squared = min(0.125 * np.tan(tilt - displaced) ** 2, 1.0)
    shadowing = 2.0 / (1.0 + np.sqrt(1.0 + roughness_squared * np.tan(sun - displaced) ** 2))
    ours = lit()
    assert ours == pytest.approx(lit(engine="CYCLES"), rel=0.03)
    assert ours == pytest.approx(ALBEDO * np.cos(tilt - sun) * shadowing, rel=0.03)


@pytest.mark.parametrize("sun", [-0.2, 0.7])
def test_a_bump_on_a_smooth_mesh_of_few_faces_is_dimmed_by_what_turns_it_from_the_smooth_normal(stage, sun):
    """Normals of the floor's vertices lean by .5 towards -x; they are kept to within four degrees."""
    tilt, lean = 0.3, -0.5
    material = stage.diffuse(ALBEDO)
    nodes, links = material.node_tree.nodes, material.node_tree.links
    turned = nodes.new("ShaderNodeNormalMap")
    turned.space = "WORLD"
    turned.inputs["Color"].default_value = (0.5 + 0.5 * np.sin(tilt), 0.5, 0.5 + 0.5 * np.cos(tilt), 1.0)
    links.new(turned.outputs[0], next(node for node in nodes if node.type == "BSDF_DIFFUSE").inputs["Normal"])
    floor = stage.rectangle((-4, -4), (4, 4), material=material)
    floor.data.polygons.foreach_set("use_smooth", [True])
    floor.data.normals_split_custom_set([(np.sin(lean), 0.0, np.cos(lean))] * 4)
    stage.camera_above(2.0)
    stage.light("SUN", turn=(0.0, sun, 0.0), energy=np.pi, angle=0.0)
    found = float(light_paths(stage.render(4, (8, 8)))["diffuse_direct"].mean())
    roughness_squared = min(0.125 * np.tan(tilt - lean) ** 2, 1.0)
    shadowing = 2.0 / (1.0 + np.sqrt(1.0 + roughness_squared * np.tan(sun - lean) ** 2))
    assert found == pytest.approx(ALBEDO * np.cos(tilt - sun) * shadowing, rel=0.03)
