"""Glass: how much passes one interface and where to, by Snell and Fresnel; solids against a white world and Cycles."""

import math

import numpy as np
import pytest

from .conftest import places
from .foggy_stage import box, fill

SIZE = (24, 24)
SLOW = pytest.mark.slow


def fresnel(cosine, ior):
    inside = np.sqrt(1 - (1 - cosine**2) / ior**2)
    s = (cosine - ior * inside) / (cosine + ior * inside)
    p = (inside - ior * cosine) / (inside + ior * cosine)
    return (s * s + p * p) / 2


def passing(images, order="direct"):
    """Radiance of a transmission pass, (H, W, 3)."""
    return images[f"transmission_{order}"][..., :3] * images["transmission_color"][..., :3]


def glass(stage, roughness=0.0, ior=1.5, color=(1, 1, 1, 1)):
    return stage.material("ShaderNodeBsdfGlass", Color=color, Roughness=roughness, IOR=ior)


def tilted_camera(stage, degrees, span=4.0):
    tilt = np.radians(degrees)
    camera = stage.camera_above(span)
    camera.location, camera.rotation_euler = (0, -20 * np.sin(tilt), 20 * np.cos(tilt)), (tilt, 0, 0)
    camera.data.clip_end = 1000


def ball(stage, material, radius=1.0, rings=24):
    """A smooth-shaded sphere around the origin."""
    turn = np.linspace(0, 2 * np.pi, 2 * rings, endpoint=False)
    heights = np.linspace(0, np.pi, rings + 1)[1:-1]
    corners = [(radius * np.sin(h) * np.cos(t), radius * np.sin(h) * np.sin(t), radius * np.cos(h))
               for h in heights for t in turn]  # fmt: skip
    corners += [(0, 0, radius), (0, 0, -radius)]
    n, faces = len(turn), []
    for row in range(rings - 2):
        faces += [
            (row * n + k, (row + 1) * n + k, (row + 1) * n + (k + 1) % n, row * n + (k + 1) % n) for k in range(n)
        ]
    faces += [(len(corners) - 2, k, (k + 1) % n) for k in range(n)]
    last = (rings - 2) * n
    faces += [(len(corners) - 1, last + (k + 1) % n, last + k) for k in range(n)]
    made = stage.mesh(corners, faces, material=material)
    made.data.shade_smooth()
    return made


@pytest.mark.parametrize("degrees", [0, 60])
@pytest.mark.parametrize("inside", [False, True])
def test_a_smooth_interface_passes_what_fresnel_leaves(stage, degrees, inside):
    """From inside, beyond 41.8 degrees, nothing."""
    stage.rectangle((-99, -99), (99, 99), material=glass(stage), turn=(np.pi * inside, 0, 0))
    stage.world((1.0, 0.5, 0.25))
    tilted_camera(stage, degrees)
    found = passing(stage.render(16, SIZE)).mean(axis=(0, 1))
    cosine = np.cos(np.radians(degrees))
    if inside and degrees:
        expected = 0.0
    else:
        expected = 1 - fresnel(cosine, 1 / 1.5 if inside else 1.5)
    assert found == pytest.approx(expected * np.array([1.0, 0.5, 0.25]), abs=2e-3)


@pytest.mark.slow
def test_what_stands_behind_an_interface_is_seen_where_snell_says(stage):
    """An emissive half plane a metre below the interface: its edge moves to y = depth * tan of the bent angle."""
    stage.rectangle((-99, -99), (99, 99), material=glass(stage, ior=1.5))
    light = stage.material("ShaderNodeEmission", Strength=1.0)
    stage.rectangle((-99, 0), (99, 99), z=-1.0, material=light)
    tilted_camera(stage, 45)
    found = passing(stage.render(16, SIZE)).mean(axis=(1, 2))
    _, along = places(SIZE)
    on_glass = along[:, 0] / np.cos(np.radians(45))
    bent = np.arcsin(np.sin(np.radians(45)) / 1.5)
    edge = -np.tan(bent)
    step = on_glass[1] - on_glass[0]
    lit = found > 0.5 * found.max()
    assert on_glass[lit].min() == pytest.approx(edge, abs=step)
    assert lit[on_glass > edge + step].all()


@pytest.mark.slow
@pytest.mark.parametrize("roughness", [0.0, pytest.param(0.3, marks=SLOW)])
def test_a_white_solid_vanishes_in_a_white_world(stage, roughness):
    """The mean over the ball; Cycles has 0.96 for roughness 0.3, where the shared factor for multiple scattering does
    not hold direction by direction."""
    ball(stage, glass(stage, roughness))
    stage.world()
    stage.camera((0, -5, 1), (np.pi / 2 - 0.2, 0, 0), 0.4)
    images = stage.render(32, SIZE)
    inside = images["transmission_color"][..., 0] > 0.5
    assert inside.sum() > 100
    assert images["combined"][inside][:, :3].mean() == pytest.approx(1.0, abs=0.01 if roughness == 0 else 0.07)


@pytest.mark.parametrize("roughness", [0.3, pytest.param(0.6, marks=SLOW)])
@pytest.mark.parametrize("inside", [False, True])
def test_rough_interfaces_bend_a_sun_as_in_cycles(stage, roughness, inside):
    """The value of f cos itself, for one direction to the viewer."""
    stage.rectangle((-99, -99), (99, 99), material=glass(stage, roughness), turn=(np.pi * inside, 0, 0))
    tilted_camera(stage, 20)
    for turn in ((np.pi - 0.1, 0.2, 0), (np.pi + 0.4, -0.3, 0)):
        sun = stage.light("SUN", turn=turn, angle=0.02)
        ours = stage.render(64, (4, 4))
        cycles = stage.render(256, (4, 4), engine="CYCLES")
        expected = passing(cycles).mean()
        assert expected > 1e-3
        assert passing(ours).mean() == pytest.approx(expected, rel=0.01)
        stage.scene.collection.objects.unlink(sun)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["area", "emissive"])
def test_light_behind_rough_glass_is_as_bright_as_in_cycles(stage, kind):
    stage.rectangle((-9, -9), (9, 9), material=glass(stage, 0.4, color=(0.9, 0.7, 0.5, 1.0)))
    tilted_camera(stage, 25)
    if kind == "area":
        stage.light("AREA", (0.3, 0, -1), turn=(np.pi, 0, 0), size=1.5)
    else:
        stage.rectangle((-0.7, -0.7), (0.7, 0.7), z=-1.0, material=stage.material("ShaderNodeEmission", Strength=5.0))
    ours = passing(stage.render(64, SIZE))
    cycles = passing(stage.render(1024, SIZE, engine="CYCLES"))
    assert ((ours - cycles) ** 2).sum() < 0.005 * (cycles**2).sum()


@SLOW
def test_a_ball_of_glass_shows_the_world_as_in_cycles(stage):
    ball(stage, glass(stage, color=(0.9, 0.8, 1.0, 1.0)), rings=32)
    stage.world((0.2, 0.4, 0.8))
    stage.light("SUN", turn=(2.6, 0.3, 0), angle=0.6, energy=2.0)
    stage.camera((0, -5, 1), (np.pi / 2 - 0.2, 0, 0), 0.5)
    ours = passing(stage.render(64, SIZE), "indirect")
    cycles = passing(stage.render(1024, SIZE, engine="CYCLES", bounces=12), "indirect")
    assert ours.mean() == pytest.approx(cycles.mean(), rel=0.01)
    assert ((ours - cycles) ** 2).sum() < 0.01 * (cycles**2).sum()


def test_surfaces_behind_glass_keep_their_texture(stage):
    """A floor of two halves, seen through two interfaces. Light on its way to the floor passes both as a pane's at 45
    degrees, with what is mirrored between them."""
    stage.mesh([(-9, -9, 0), (0, -9, 0), (0, 9, 0), (-9, 9, 0)], [(0, 1, 2, 3)], material=stage.diffuse(0.2))
    stage.mesh([(0, -9, 0), (9, -9, 0), (9, 9, 0), (0, 9, 0)], [(0, 1, 2, 3)], material=stage.diffuse(0.8))
    stage.light("SUN", turn=(0.5, 0, 0), energy=np.pi / np.cos(0.5))  # apart from its image in the panes
    for z, turn in ((-1.0, (np.pi, 0, 0)), (1.2, (0, 0, 0))):
        stage.rectangle((-9, -9), (9, 9), z=z, material=glass(stage), turn=turn)
    stage.camera_above(4.0)
    found = passing(stage.render(32, SIZE), "indirect").mean(axis=(0, 2))
    face = fresnel(math.sqrt(0.5), 1.5)
    passed = (1 - fresnel(1.0, 1.5)) ** 2 * (1 - face) / (1 + face)
    assert found[:10].mean() == pytest.approx(0.2 * passed, rel=0.03)
    assert found[-10:].mean() == pytest.approx(0.8 * passed, rel=0.03)
    assert found[:11].max() < 0.3 * passed < 0.6 * passed < found[-11:].min()


@pytest.mark.slow
@pytest.mark.parametrize("technique", ["instant_radiosity", pytest.param("clustered_visibility", marks=SLOW)])
def test_surfaces_behind_glass_get_the_light_of_other_surfaces_as_in_cycles(stage, technique):
    """A room that only its pane shows. Its ceiling, the upper part of the picture, has no light but that of the floor
    and the wall."""
    stage.scene.candela.slot_indirect = technique
    stage.rectangle((-2, 0), (2, 4), material=stage.diffuse(0.7))
    stage.rectangle((-2, 0), (2, 4), z=2.0, material=stage.diffuse(0.7))
    stage.mesh([(-2, 4, 0), (2, 4, 0), (2, 4, 2), (-2, 4, 2)], [(0, 1, 2, 3)], material=stage.diffuse(0.5))
    pane = [(-2, -0.05, 0), (2, -0.05, 0), (2, -0.05, 2), (-2, -0.05, 2)]
    stage.mesh(pane, [(0, 1, 2, 3)], material=glass(stage))
    stage.mesh([(x, 0.0, z) for x, _, z in pane], [(3, 2, 1, 0)], material=glass(stage))
    lamp = stage.light("AREA", (0, 2, 1.9), size=1.0, energy=50.0)
    lamp.visible_transmission = False
    stage.camera((0, -1, 1), (np.pi / 2, 0, 0), 1.2)
    ours = passing(stage.render(32, SIZE, bounces=4), "indirect")
    cycles = passing(stage.render(1024, SIZE, engine="CYCLES", bounces=16), "indirect")
    assert ours[17:].mean() == pytest.approx(cycles[17:].mean(), rel=0.04)
    assert ((ours - cycles) ** 2).sum() < 0.01 * (cycles**2).sum()


@pytest.mark.slow
@pytest.mark.parametrize("roughness", [0.0, 0.3])
def test_what_a_solid_of_glass_absorbs_is_missing_as_in_cycles(stage, roughness):
    """A block of coloured glass before a white world: exp(-d (1 - c) t) of it on a straight path."""
    color, density, depth = np.array([0.9, 0.5, 0.1]), 0.8, 1.5
    material = glass(stage, roughness, 1.3)
    tree = material.node_tree
    volume = tree.nodes.new("ShaderNodeVolumeAbsorption")
    volume.inputs["Color"].default_value, volume.inputs["Density"].default_value = (*color, 1), density
    output = next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
    tree.links.new(volume.outputs[0], output.inputs["Volume"])
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (0, depth)]
    faces = [(0, 4, 5, 1), (2, 3, 7, 6), (0, 1, 3, 2), (4, 6, 7, 5), (1, 5, 7, 3), (0, 2, 6, 4)]
    stage.mesh(corners, faces, material=material)
    stage.world()
    stage.camera_above(1.0)
    ours, cycles = (
        passing(stage.render(samples, (16, 16), bounces=12, engine=engine), "indirect").mean(axis=(0, 1))
        for engine, samples in (("CANDELA", 64), ("CYCLES", 256))
    )
    assert ours == pytest.approx(cycles, rel=0.03)
    if not roughness:
        straight = np.exp(-density * (1 - color) * depth)
        assert ours[0] / ours[2] == pytest.approx(straight[0] / straight[2], rel=0.05)


@pytest.mark.parametrize("slot", ["AUTO", "OFF"])
def test_what_stands_in_a_solid_is_seen_through_what_that_absorbs(stage, slot):
    """A shining plate .6 m below the face of a block, by rays that meet surfaces and by walks among means."""
    material = glass(stage, ior=1.3)
    fill(material.node_tree, "ShaderNodeVolumeAbsorption", Color=(0.5, 0.0, 1.0, 1.0), Density=2.0)
    box(stage, material, (-1, -1, -1), (1, 1, 1))
    stage.rectangle((-0.8, -0.8), (0.8, 0.8), 0.4, material=stage.material("ShaderNodeEmission", Strength=3.0))
    stage.camera_above(1.0)
    stage.scene.candela.slot_reflection = slot
    seen = stage.render(4, (16, 16), bounces=4)["combined"][4:12, 4:12, :3].mean(axis=(0, 1))
    assert seen[2] == pytest.approx(3.0 * (1 - fresnel(1.0, 1.3)), rel=0.02)
    np.testing.assert_allclose(seen / seen[2], np.exp(-0.6 * np.array([1.0, 2.0, 0.0])), rtol=0.01)


@pytest.mark.parametrize("slot", ["AUTO", "OFF"])
def test_a_drink_that_reaches_into_the_walls_of_its_glass_absorbs_between_them(stage, slot):
    """Its faces stand a centimetre within panes of clear glass, as they do for glass and drink to touch."""
    clear, drink = glass(stage, ior=1.3), glass(stage, ior=1.3)
    fill(drink.node_tree, "ShaderNodeVolumeAbsorption", Color=(0.5, 0.0, 1.0, 1.0), Density=2.0)
    box(stage, clear, (-1, -1, 0.4), (1, 1, 0.5))
    box(stage, clear, (-1, -1, -0.5), (1, 1, -0.4))
    box(stage, drink, (-0.99, -0.99, -0.41), (0.99, 0.99, 0.41))
    stage.rectangle((-1, -1), (1, 1), -0.6, material=stage.material("ShaderNodeEmission", Strength=3.0))
    stage.camera_above(1.0)
    stage.scene.candela.slot_reflection = slot
    seen = stage.render(8, (16, 16), bounces=4)["combined"][4:12, 4:12, :3].mean(axis=(0, 1))
    np.testing.assert_allclose(seen / seen[2], np.exp(-0.82 * np.array([1.0, 2.0, 0.0])), rtol=0.02)


def test_scenes_without_glass_pay_nothing(stage):
    stage.floor(material=stage.principled())
    stage.light("SUN")
    stage.camera_above()
    stage.render(1, SIZE)
    assert stage.ledger.row("traced_refraction").reason == "no material is glass"


@pytest.mark.parametrize("kind", ["glass", "principled"])
def test_each_sample_of_smooth_glass_shows_what_it_mirrors_and_what_it_lets_pass(stage, kind):
    """One sample: in every pixel Fresnel's share of the world above, and the rest of a lit wall behind, with colours
    of the node; no pixel shows one of them alone."""
    color = (0.25, 0.5, 0.81)
    made = (
        stage.material("ShaderNodeBsdfGlass", IOR=1.5, Roughness=0.0, Color=(*color, 1.0))
        if kind == "glass"
        else stage.principled(Roughness=0.0, IOR=1.5, Transmission_Weight=1.0, Base_Color=(*color, 1.0))
    )
    stage.rectangle((-99, -99), (99, 99), material=made)
    stage.rectangle((-99, -99), (99, 99), z=-2.0, material=stage.material("ShaderNodeEmission", Strength=3.0))
    stage.world()
    tilted_camera(stage, 60)
    for samples in (1, 2):
        images = stage.render(samples, SIZE, bounces=2)
        share = fresnel(0.5, 1.5)
        mirrored = (images["glossy_direct"] + images["glossy_indirect"])[..., :3] * images["glossy_color"][..., :3]
        passing_it = passing(images) + passing(images, "indirect")
        own, through = (color, color) if kind == "glass" else (np.ones(3), np.sqrt(color))
        np.testing.assert_allclose(mirrored, np.broadcast_to(share * np.array(own), mirrored.shape), rtol=0.01)
        expected = 3.0 * (1.0 - share) * np.array(through)
        np.testing.assert_allclose(passing_it, np.broadcast_to(expected, passing_it.shape), rtol=0.01)
