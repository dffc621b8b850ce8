"""Light that goes from surface to surface through an absorbing medium, against a closed form.

A lamp stands in the middle of a diffuse sphere of radius R. All its points are lit alike, so that a bounce multiplies
light by albedo times the mean of what passes chords of the length c; their density is c / (2 R^2) up to 2 R:

    m = integral of c / (2 R^2) exp(-s c) = (1 / s^2 - exp(-2 R s) (2 R / s + 1 / s^2)) / (2 R^2)
"""

import bmesh
import bpy
import numpy as np
import pytest

from tests.techniques.foggy_stage import absorber, box, fog, volume

RADIUS, ALBEDO, BOUNCES = 1.0, 0.7, 2
TECHNIQUES = (
    "instant_radiosity", "multires_radiosity", "clustered_visibility", "imperfect_shadow_maps", "ssdo",
    "implicit_visibility", "micro_rendering",
)  # fmt: skip


def ball(stage, radius, material):
    """That faces its inside."""
    made = bpy.data.meshes.new("Ball")
    shape = bmesh.new()
    bmesh.ops.create_icosphere(shape, subdivisions=4, radius=radius)
    bmesh.ops.reverse_faces(shape, faces=shape.faces)
    shape.to_mesh(made)
    shape.free()
    made.materials.append(material)
    return stage.link("Ball", made)


def passing(absorbed):
    """The mean over chords."""
    across = 2 * RADIUS
    rest = np.exp(-across * absorbed) * (across / absorbed + 1 / absorbed**2)
    return (1 / absorbed**2 - rest) / (across * RADIUS)


def inside_a_ball(stage, technique, samples=2):
    """Direct and indirect light at its surface, without the albedo."""
    stage.scene.candela.slot_indirect = technique
    ball(stage, RADIUS, stage.diffuse(ALBEDO))
    stage.light("POINT", (0, 0, 0), energy=10, shadow_soft_size=0.0)
    stage.camera((0, 0, -0.1), (0, 0, 0), angle=1.2)
    seen = stage.render(samples, size=(24, 24), bounces=BOUNCES)
    return (seen[f"diffuse_{name}"][..., :3].mean(axis=(0, 1)) for name in ("direct", "indirect"))


@pytest.mark.parametrize("technique", TECHNIQUES)
def test_each_bounce_loses_what_is_absorbed_on_its_way(stage, technique):
    absorbed = np.array([0.25, 0.5, 1.0])
    fog(stage, node="ShaderNodeVolumeAbsorption", Color=(*(1 - absorbed), 1), Density=1.0)
    direct, indirect = inside_a_ball(stage, technique)
    each = ALBEDO * passing(absorbed)
    assert indirect / direct == pytest.approx(each + each**2, rel=0.06)


def test_a_medium_with_a_boundary_absorbs_light_between_surfaces(stage):
    box(stage, absorber(stage, (0.25, 0.5, 0.9)), (-1.5, -1.5, -1.5), (1.5, 1.5, 1.5))
    direct, indirect = inside_a_ball(stage, "instant_radiosity")
    each = ALBEDO * passing(np.array([0.25, 0.5, 0.9]))
    assert indirect / direct == pytest.approx(each + each**2, rel=0.06)


@pytest.mark.slow
def test_cloth_that_is_lit_from_behind_lights_the_fog_before_it(stage):
    """As a sheet that shines as much: of 1 W/m2 behind it, its albedo of .6 over pi leaves in front."""
    stage.camera((0, 0, 8), (0, 0, 0), angle=0.5)
    stage.world((0, 0, 0), 0.0)
    turn = (0, np.pi / 2, 0)
    box(stage, volume(stage, Color=(1, 1, 1, 1), Density=0.1), (0.02, -0.9, -0.9), (2, 0.9, 0.9))
    cloth = stage.material("ShaderNodeBsdfTranslucent", Color=(0.6, 0.6, 0.6, 1))
    sheet = stage.rectangle((-1, -1), (1, 1), material=cloth, turn=turn)
    lamp = stage.light("SUN", turn=(0, -np.pi / 2, 0), energy=1.0, angle=0.0)
    stage.scene.candela.airlight_bounces = 1
    lit = stage.render(64, size=(16, 16), bounces=2)["volume_indirect"][..., 0].mean()
    bpy.data.objects.remove(lamp)
    sheet.data.materials[0] = stage.material("ShaderNodeEmission", Strength=0.6 / np.pi)
    shone = stage.render(64, size=(16, 16), bounces=2)["volume_direct"][..., 0].mean()
    assert lit == pytest.approx(shone, rel=0.05)


@pytest.mark.parametrize("shader", ["ShaderNodeBsdfTranslucent", "ShaderNodeBsdfDiffuse"])
def test_a_sheet_before_fog_that_a_sun_lights_is_lit_through(stage, shader):
    """As in Cycles. A translucent sheet had the fog's light of the side that is seen, where there is none."""
    stage.rectangle((-0.4, -0.4), (0.4, 0.4), 0.0, material=stage.material(shader, Color=(0.8, 0.8, 0.8, 1)))
    box(stage, volume(stage, Color=(1, 1, 1, 1), Density=0.5), (-1, -1, -2), (1, 1, -0.05))
    stage.light("SUN", turn=(0, np.pi / 2, 0), energy=10.0, angle=0.0)
    camera = stage.camera((0, 0, 3), (0, 0, 0))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 0.6
    seen = [stage.render(n, size=(8, 8), bounces=2, engine=name) for name, n in (("CANDELA", 32), ("CYCLES", 1024))]
    found, truth = (one["combined"][..., :3].mean() for one in seen)
    assert found == pytest.approx(truth, rel=0.1, abs=2e-3)
    assert (truth > 0.05) == (shader == "ShaderNodeBsdfTranslucent")
