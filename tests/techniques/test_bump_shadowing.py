"""Bumped surfaces shade themselves: the closed form of Estevez et al. 2019, and Cycles under a world."""

import bpy
import numpy as np
import pytest

from addon.compare.passes import light_paths

ALBEDO = 0.8


@pytest.fixture
def lit(stage):
    """Diffuse direct radiance of a floor whose normal map turns all normals by `tilt` towards +x."""

    def lit(tilt, samples=16, **options):
        material = stage.diffuse(ALBEDO)
        nodes, links = material.node_tree.nodes, material.node_tree.links
        turned = nodes.new("ShaderNodeNormalMap")
        turned.space = "WORLD"
        turned.inputs["Color"].default_value = (0.5 + 0.5 * np.sin(tilt), 0.5, 0.5 + 0.5 * np.cos(tilt), 1.0)
        shader = next(node for node in nodes if node.bl_idname == "ShaderNodeBsdfDiffuse")
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


def test_light_does_not_come_through_the_surface_onto_a_bump(stage, lit):
    """The normal faces a sun that stands below the floor."""
    stage.light("SUN", turn=(0.0, 1.7, 0.0), energy=np.pi, angle=0.0)
    assert lit(0.6) < 1e-3


@pytest.mark.parametrize("tilt", [0.3, 0.6])
def test_the_world_lights_a_bumped_floor_as_in_cycles(stage, lit, tilt):
    stage.world((1, 1, 1), 0.5)
    assert lit(tilt, samples=64) == pytest.approx(lit(tilt, samples=512, engine="CYCLES"), rel=0.01)
