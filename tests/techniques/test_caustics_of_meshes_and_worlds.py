"""Caustics of emissive meshes and of the world: as much light as lamps of the same shape have, and none twice."""

import bpy
import numpy as np
import pytest

from addon.materials.energy import fresnel_dielectric
from tests.techniques.test_caustics import BALL_LENS, ball, glass, light_through_a_ball, rings, slab, within

EDGES = np.array([0.0, 0.18, 0.3])
CAP, ROWS = 100.0, 64  # radiance about the zenith, in the uppermost row of an image


def shining_square(stage, power, size, height):
    """As an area lamp of that power, but to both sides."""
    emission = stage.material("ShaderNodeEmission", Strength=power / (np.pi * size**2))
    made = stage.rectangle((-size / 2, -size / 2), (size / 2, size / 2), z=height, material=emission)
    made.visible_camera = False


def world_with_a_bright_zenith(stage):
    """Its irradiance on a floor, W/m2: radiance falls to 0 between the middles of two rows of pixels."""
    pixels = np.zeros((ROWS, 2 * ROWS, 4), np.float32)
    pixels[-1, :, :3], pixels[..., 3] = CAP, 1.0
    image = bpy.data.images.new("Zenith", 2 * ROWS, ROWS, float_buffer=True)
    image.pixels.foreach_set(pixels.ravel())
    tree = stage.world().node_tree
    node = tree.nodes.new("ShaderNodeTexEnvironment")
    node.image = image
    tree.links.new(node.outputs[0], next(one for one in tree.nodes if one.type == "BACKGROUND").inputs[0])
    half = np.pi / ROWS / 2
    angle = (np.arange(2000) + 0.5) / 2000 * 3 * half
    radiance = np.interp(angle, (half, 3 * half), (CAP, 0.0))
    return float((radiance * np.pi * np.sin(2 * angle)).sum() * 3 * half / 2000)


@pytest.mark.slow
def test_an_emissive_square_has_the_caustic_of_an_area_lamp(stage):
    """And the glass its shadow: what it stops is what it bends."""
    stage.floor()
    ball(stage, glass(stage), radius=0.3, place=(0, 0, 0.5), segments=48)
    shining_square(stage, 80, 1.0, 1.5)
    stage.camera_above(1.2)
    stage.scene.candela.slot_indirect = "OFF"
    images = stage.render(samples=16, size=(32, 32), bounces=2)
    truth = light_through_a_ball(1.5, 1.0, 80, np.array([0, 0, 0.5]), 0.3, 1.5, EDGES, rays=100_000)
    np.testing.assert_allclose(rings(images["diffuse_indirect"][..., 0] * np.pi, 1.2, EDGES), truth, rtol=0.1)
    assert images["diffuse_direct"][15:17, 15:17, 0].max() == 0.0


@pytest.mark.slow
def test_the_bright_part_of_the_world_has_the_light_of_the_ball_lens(stage):
    stage.floor()
    arriving = world_with_a_bright_zenith(stage)
    ball(stage, glass(stage), place=(0, 0, 0.5 * 1.25), segments=64)
    stage.camera_above(0.6)
    stage.scene.candela.slot_indirect = "OFF"
    images = stage.render(samples=16, size=(24, 24), bounces=2)
    caustic = images["diffuse_indirect"][..., 0] * np.pi / arriving
    assert within(caustic, 0.5 * 0.5, 0.6, 0.5) == pytest.approx(BALL_LENS[1.25][0.5], rel=0.03)
    assert images["diffuse_direct"][..., 0].mean() < 0.01 * arriving / np.pi


@pytest.mark.parametrize("shape", ("pane", "ball"))
def test_under_an_even_sky_clear_glass_changes_nothing(stage, shape):
    """Below a pane a floor gets what passes straight and what the pane mirrors of the floor: together what it had."""
    stage.floor()
    stage.world()
    stage.camera_above(1.0)
    if shape == "pane":
        slab(stage, glass(stage), 0.3, 0.32, half=1.0)
    else:
        ball(stage, glass(stage), radius=0.3, place=(0, 0, 0.8), segments=24)
    paths = ("diffuse_direct", "diffuse_indirect")
    found = [stage.render(samples=16, size=(16, 16), bounces=4, seed=seed) for seed in range(4)]  # one seed errs by .02
    light = np.mean([images[path][..., 0] for images in found for path in paths]) * len(paths)
    assert light == pytest.approx(1.0, abs=0.04)


def test_a_floor_has_the_light_that_a_pane_of_the_picture_mirrors(stage):
    """Rays that an upright pane stops see what it mirrors, whether the camera shows the pane or not."""
    stage.rectangle((-2, -2), (2, 0), material=stage.diffuse())
    stage.world()
    corners = [(x, y, z) for z in (0, 2) for y in (0.0, 0.1) for x in (-2, 2)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 4, 6, 2), (1, 3, 7, 5)]
    pane = stage.mesh(corners, faces, material=glass(stage))
    stage.camera((0, -4, 2.5), (1.0, 0, 0), angle=0.7)
    found = []
    for pane.visible_camera in (True, False):
        images = [stage.render(samples=16, size=(24, 18), bounces=4, seed=seed) for seed in (1, 2)]
        floor = images[0]["diffuse_color"][..., 0] > 0.99
        found.append(np.mean([one["diffuse_indirect"][..., 0][floor].mean() for one in images]))
    assert found[0] == pytest.approx(found[1], rel=0.15)


def test_a_pane_mirrors_a_lamp_onto_the_floor_at_its_foot_as_both_faces_do(stage):
    """The mirror image of the lamp, by 2 F / (1 + F) at each angle: 1.34 times that where each face stops as many rays
    at all angles."""
    stage.rectangle((-1, -1), (1, 1), material=stage.diffuse())
    slab(stage, glass(stage), 0.0, 0.02, half=9.0).rotation_euler = (-np.pi / 2, 0, 0)
    stage.light("AREA", (0, -1, 1.5), energy=100.0, size=2.0)
    stage.scene.candela.slot_caustics = "OFF"
    camera = stage.camera_above(0.05)
    camera.location.y = -0.1
    found = [stage.render(64, (16, 16), bounces=2, seed=seed)["diffuse_indirect"][..., 0].mean() for seed in range(2)]

    k = 2.0 * (np.arange(200) + 0.5) / 200 - 1.0
    x, y = np.meshgrid(k, 1.0 + k + 0.1)
    distance = np.sqrt(x**2 + y**2 + 1.5**2)
    face = fresnel_dielectric(y / distance, 1.5)
    seen = (1.5 / distance) ** 2 / distance**2 * (2 * face / (1 + face))  # W / (m2 sr) of the lamp: 100 / (4 pi)
    expected = 100.0 / (4.0 * np.pi) * seen.mean() * 4.0 / np.pi
    print(f"{np.mean(found):.4f}, expected {expected:.4f}")
    assert np.mean(found) == pytest.approx(expected, rel=0.1)
