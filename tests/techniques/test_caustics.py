"""Caustics on surfaces: closed forms, energy, and what may not happen."""

import time
from itertools import pairwise
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from addon.compare.passes import light_paths
from addon.frame import shares
from addon.frame.ledger import RAN, SKIPPED
from addon.gfx import images as gpu_images
from addon.lighting import caustic_casters, light_views, photon_grids, photons
from addon.lighting.caustic_casters import grown
from addon.lighting.caustic_maps import CausticMaps
from addon.lighting.light_views import groups
from addon.materials.gloss import THROWS
from addon.techniques import screen_space_photons
from tests.techniques.conftest import places
from tests.techniques.foggy_stage import absorber, box, fill

PHOTONS, MAPPING = "screen_space_photons", "caustics_mapping"
SIZE = (128, 128)


def ball(stage, material, radius=0.5, place=(0, 0, 1), segments=96):
    bpy.ops.mesh.primitive_uv_sphere_add(segments=segments, ring_count=segments // 2, radius=radius, location=place)
    made = bpy.context.object
    made.data.materials.append(material)
    for polygon in made.data.polygons:
        polygon.use_smooth = True
    made.visible_camera = False
    return made


def glass(stage, ior=1.5, **inputs):
    return stage.material("ShaderNodeBsdfGlass", IOR=ior, **{"Roughness": 0.0, **inputs})


def irradiance(stage, technique, samples=16, size=SIZE, path="diffuse_indirect", seed=0, **settings):
    """W/m2 on white surfaces that caustics bring, (H, W)."""
    stage.scene.candela.slot_indirect = "OFF"
    stage.scene.candela.slot_caustics = technique
    for name, value in settings.items():
        setattr(stage.scene.candela, f"{technique}_{name}", value)
    images = stage.render(samples=samples, size=size, seed=seed, bounces=2)
    assert technique == "OFF" or stage.ledger.row(technique).state == RAN, stage.ledger.text()
    return images[path][..., 0] * np.pi


def within(energy, radius, span, disc):
    """Share of the light of a disc of radius `disc` that falls within `radius` of the middle; a pixel counts by the
    part of it that lies there."""
    size = energy.shape[::-1]
    fine = 8
    x, y = places((size[0] * fine, size[1] * fine), span)
    part = (np.hypot(x, y) < radius).reshape(size[1], fine, size[0], fine).mean(axis=(1, 3))
    return float((energy * part).sum() * (span / max(size)) ** 2 / (np.pi * disc**2))


@pytest.fixture(params=[PHOTONS, MAPPING])
def technique(request):
    return request.param


# The specification's table: unit glass ball of index 1.5 in parallel light, share of the light of its disc within the
# radius r on a plane at X from the middle, two refractions with Fresnel's losses.
BALL_LENS = {
    1.25: {0.1: 0.651, 0.2: 0.723, 0.3: 0.763, 0.5: 0.802},
    1.5: {0.1: 0.373, 0.2: 0.518, 0.3: 0.607, 0.5: 0.708},
    2.0: {0.1: 0.068, 0.2: 0.190, 0.3: 0.302, 0.5: 0.468},
    2.5: {0.1: 0.020, 0.2: 0.072, 0.3: 0.140, 0.5: 0.280},
}


def ball_lens(stage, technique, distance, span=1.2, **settings):
    stage.floor()
    ball(stage, glass(stage), place=(0, 0, 0.5 * distance), segments=192)
    stage.light("SUN", angle=0.0)
    stage.camera_above(span)
    return irradiance(stage, technique, samples=16, **settings)


@pytest.mark.slow
@pytest.mark.parametrize("distance", BALL_LENS)
def test_ball_lens_has_the_light_of_the_table_in_each_ring(stage, distance):
    energy = ball_lens(stage, PHOTONS, distance, span=0.6)
    for radius, share in BALL_LENS[distance].items():
        assert within(energy, 0.5 * radius, 0.6, 0.5) == pytest.approx(share, abs=0.01, rel=0.015)


@pytest.mark.slow
@pytest.mark.parametrize("distance", (2.0, 2.5))
def test_ball_lens_by_look_ups_lacks_little_of_its_light(stage, distance):
    """What neighbouring texels of the far side tell of its normals is coarser than rays: 5 % of the light."""
    energy = ball_lens(stage, MAPPING, distance)
    for radius, share in BALL_LENS[distance].items():
        assert within(energy, 0.5 * radius, 1.2, 0.5) == pytest.approx(share, abs=0.02, rel=0.05)


@pytest.mark.slow
def test_ball_lens_by_a_map_and_rays_has_the_light_of_the_table(stage):
    energy = ball_lens(stage, MAPPING, 2.0, by="RAYS")
    for radius, share in BALL_LENS[2.0].items():
        assert within(energy, 0.5 * radius, 1.2, 0.5) == pytest.approx(share, abs=0.01, rel=0.03)


@pytest.mark.slow
def test_plane_mirror_is_a_second_light(stage):
    """Mirror of 1 m at z = 0, spot of 100 W at (-1, 0, 1): the wall at x = 1.5 is lit from (-1, 0, -1)."""
    wall = stage.rectangle((-4, -4), (4, 4), material=stage.diffuse(), turn=(0, -np.pi / 2, 0), location=(1.5, 0, 0))
    wall.name = "Wall"
    stage.rectangle(
        (-0.5, -0.5), (0.5, 0.5), material=stage.material("ShaderNodeBsdfGlossy", Roughness=0.0, Color=(1, 1, 1, 1))
    )
    lamp = stage.light("SPOT", location=(-1, 0, 1), energy=100.0, shadow_soft_size=0.0, spot_size=2.4, spot_blend=0.0)
    lamp.rotation_euler = (0, -np.pi / 4, 0)
    camera = stage.camera_above(5.0)
    camera.location, camera.rotation_euler = (-5, 0, 2), (np.pi / 2, 0, -np.pi / 2)
    energy = irradiance(stage, PHOTONS, samples=16, size=(64, 64))
    y, z = places((64, 64), 5.0)
    y, z = -y, z + 2.0
    expected = 7.9577 * 2.5 / (2.5**2 + y**2 + (z + 1) ** 2) ** 1.5
    inside = (z > 0.8) & (z < 3.6) & (np.abs(y) < 0.46 * (z + 1))
    outside = (z < 0.5) | (z > 4.3) | (np.abs(y) > 0.56 * (z + 1) + 0.1)
    ratio = energy[inside] / expected[inside]
    assert ratio.mean() == pytest.approx(1.0, abs=0.02)
    assert ratio.std() < 0.05
    assert energy[outside].max() < 0.02


def nephroid(distance, radius=0.5, height=0.25, elevation=np.pi / 6):
    """Irradiance on the axis of a mirror ring, in the sun's on the floor, at `distance` from its far wall."""
    reach = height / np.tan(elevation)
    sheet = radius / abs(radius - 2 * distance) if distance < reach else 0.0
    if distance < radius / 2 and radius - distance <= reach:
        cosine = radius / (2 * (radius - distance))
        sheet += 2 * radius * cosine / abs(radius * cosine - 2 * (radius - distance))
    return sheet


@pytest.mark.slow
@pytest.mark.parametrize("technique", (PHOTONS, MAPPING))
def test_mirror_ring_has_the_nephroid(stage, technique):
    """Ring of radius .5 and height .25 under a sun of 30 degrees that travels along +x, beside the closed
    form on its axis: 1.25 to 4.58 where one sheet and two meet, 5.0 to 1.67 beyond the cusp."""
    stage.floor()
    count, radius, height = 512, 0.5, 0.25
    turns = np.linspace(0, 2 * np.pi, count, endpoint=False)
    rim = [(radius * np.cos(t), radius * np.sin(t), z) for z in (0.0, height) for t in turns]
    faces = [(k, (k + 1) % count, count + (k + 1) % count, count + k) for k in range(count)]
    mirror = stage.material("ShaderNodeBsdfGlossy", Roughness=0.0, Color=(1, 1, 1, 1))
    ring = stage.mesh(rim, faces, material=mirror)
    for polygon in ring.data.polygons:
        polygon.use_smooth = True
    ring.visible_camera = False
    stage.light("SUN", turn=(0, -np.pi / 3, 0), angle=0.0)
    stage.camera_above(1.2)
    energy = irradiance(stage, technique, samples=64, size=(192, 192), grid=256) / np.sin(np.pi / 6)
    x, y = places((192, 192), 1.2)
    axis = energy[np.abs(y[:, 0]) < 0.008].mean(axis=0)
    places_x = x[0]
    for distance in (0.05, 0.1, 0.15, 0.3, 0.35, 0.4):
        found = np.interp(radius - distance, places_x, axis)
        print(technique, distance, nephroid(distance), found)
        assert found == pytest.approx(nephroid(distance), rel=0.08)
    assert np.interp(radius - 0.46, places_x, axis) < 0.1


def checkered(stage, ior):
    """Glass that is green where x < 0 and red beside."""
    made = stage.material("ShaderNodeBsdfGlass", Roughness=0.0, IOR=ior)
    nodes, links = made.node_tree.nodes, made.node_tree.links
    checker, place = nodes.new("ShaderNodeTexChecker"), nodes.new("ShaderNodeTexCoord")
    checker.inputs["Scale"].default_value = 0.5
    checker.inputs["Color1"].default_value, checker.inputs["Color2"].default_value = (1, 0.5, 0.5, 1), (0.5, 1, 0.5, 1)
    shift = nodes.new("ShaderNodeMapping")
    shift.inputs["Location"].default_value = (2.0, 1.0, 1.0)  # a step at x = 0 alone
    links.new(place.outputs["Object"], shift.inputs["Vector"])
    links.new(shift.outputs["Vector"], checker.inputs["Vector"])
    links.new(checker.outputs["Color"], nodes["Glass BSDF"].inputs["Color"])
    return made


@pytest.mark.parametrize("columns", [(-4, 4), (-4, 0, 4)], ids=["patterns", "even faces"])
def test_stained_water_passes_what_clear_water_does_times_its_colour(stage, columns):
    """A sheet, green and red, under a sun at its normal: colour (1 - F) / n^2, faces of one colour or not."""
    stage.floor()
    corners = np.array([(x, y, 0.5) for y in (-4, 4) for x in columns])
    count = len(columns)
    faces = [(k, k + 1, k + 1 + count, k + count) for k in range(count - 1)]
    stage.mesh(corners, faces, material=checkered(stage, 1.33)).visible_camera = False
    stage.light("SUN", energy=np.pi, angle=0.0)
    stage.camera_above(1.0)
    stage.scene.candela.slot_indirect, stage.scene.candela.slot_caustics = "OFF", PHOTONS
    found = stage.render(samples=4, size=(24, 24), bounces=3)["diffuse_indirect"][..., :3]
    clear = (1 - (0.33 / 2.33) ** 2) / 1.33**2
    assert found[8:16, 4:9].mean((0, 1)) == pytest.approx(clear * np.array([0.5, 1.0, 0.5]), abs=0.03)
    assert found[8:16, 15:20].mean((0, 1)) == pytest.approx(clear * np.array([1.0, 0.5, 0.5]), abs=0.03)


@pytest.mark.slow
def test_flat_water_passes_the_share_that_fresnel_leaves(stage):
    """A sheet of index 1.33 under a sun at 30 degrees from its normal: E cos T / n^2 on the floor below, evenly. The
    radiance that leaves water is L / n^2 of what its floor sends, which stands in the light on the floor, as in Cycles.
    """
    stage.floor()
    stage.rectangle((-4, -4), (4, 4), 0.5, material=glass(stage, 1.33)).visible_camera = False
    stage.light("SUN", turn=(0, np.pi / 6, 0), angle=0.0)
    stage.camera_above(1.0)
    energy = irradiance(stage, PHOTONS, samples=4, size=(32, 32))
    cosine, bent = np.cos(np.pi / 6), np.sqrt(1 - (0.5 / 1.33) ** 2)
    s = (cosine - 1.33 * bent) / (cosine + 1.33 * bent)
    p = (1.33 * cosine - bent) / (1.33 * cosine + bent)
    expected = cosine * (1 - 0.5 * (s * s + p * p)) / 1.33**2
    assert energy.mean() == pytest.approx(expected, rel=0.005)
    assert energy == pytest.approx(expected, rel=0.03)


def slab(stage, material, low, high, half=1.5):
    """A closed box with faces at z = `low` and `high`, whose sides lie outside of what is looked at."""
    corners = [(x, y, z) for z in (low, high) for x, y in ((-half, -half), (half, -half), (half, half), (-half, half))]
    sides = [(k, (k + 1) % 4, 4 + (k + 1) % 4, 4 + k) for k in range(4)]
    made = stage.mesh(corners, [(3, 2, 1, 0), (4, 5, 6, 7), *sides], material=material)
    made.visible_camera = False
    return made


def passed(cosine, ior):
    """Share of light that a face of index `ior` lets in at the cosine, and the tangent behind it."""
    sine = np.sqrt(1 - cosine * cosine)
    bent = np.sqrt(1 - (sine / ior) ** 2)
    s = (cosine - ior * bent) / (cosine + ior * bent)
    p = (ior * cosine - bent) / (ior * cosine + bent)
    return 1 - 0.5 * (s * s + p * p), sine / ior / bent


@pytest.mark.slow
def test_slab_shifts_light_sideways_and_takes_what_its_faces_reflect(stage):
    """Sun at 30 degrees through a hole of .4 m over .4 m of glass: the spot lies h (tan T - tan T') nearer, as bright
    as two faces leave and what goes to and fro between them gives back."""
    ior, thick, angle, plate = 1.5, 0.4, np.pi / 6, 1.0
    stage.floor()
    slab(stage, glass(stage, ior), 0.5, 0.5 + thick)
    hole, wide = 0.2, 3.0
    rim = [
        (-wide, -wide),
        (wide, -wide),
        (wide, wide),
        (-wide, wide),
        (-hole, -hole),
        (hole, -hole),
        (hole, hole),
        (-hole, hole),
    ]
    faces = [(k, (k + 1) % 4, 4 + (k + 1) % 4, 4 + k) for k in range(4)]
    stage.mesh([(x, y, plate) for x, y in rim], faces, material=stage.diffuse()).visible_camera = False
    stage.light("SUN", turn=(0, angle, 0), angle=0.0)
    stage.camera_above(2.0)
    energy = irradiance(stage, PHOTONS, samples=16, size=(96, 96), grid=256)
    x, y = places((96, 96), 2.0)
    inside, bent = passed(np.cos(angle), ior)
    middle = (energy * x).sum() / energy.sum()
    expected = -((plate - thick) * np.tan(angle) + thick * bent)
    assert middle == pytest.approx(expected, abs=0.01)
    assert (energy * y).sum() / energy.sum() == pytest.approx(0.0, abs=0.005)
    share = inside / (2 - inside)  # (1 - R) / (1 + R)
    spot = (np.abs(x - expected) < 0.12) & (np.abs(y) < 0.12)
    assert energy[spot].mean() == pytest.approx(np.cos(angle) * share, rel=0.01)
    assert energy.sum() * (2.0 / 96) ** 2 == pytest.approx((2 * hole) ** 2 * np.cos(angle) * share, rel=0.02)


@pytest.mark.slow
def test_glass_with_an_absorbing_inside_dims_by_beer_and_lambert(stage, technique_name):
    """Two slabs of one density, .2 and .5 m thick: the ratio is exp(-density times .3 m), by channel."""
    stage.floor()
    material = glass(stage)
    ball(stage, material, radius=0.1, place=(3, 0, 1))  # flat glass alone is left to shadows
    fill(material.node_tree, "ShaderNodeVolumeAbsorption", Color=(0.5, 0.0, 1.0, 1.0), Density=2.0)
    stage.light("SUN", angle=0.0)
    stage.camera_above(1.0)
    stage.scene.candela.slot_indirect, stage.scene.candela.slot_caustics = "OFF", technique_name
    means = []
    for thick in (0.2, 0.5):
        made = slab(stage, material, 0.4, 0.4 + thick)
        light = stage.render(samples=4, size=(32, 32), bounces=2)["diffuse_indirect"][..., :3] * np.pi
        means.append(light.mean(axis=(0, 1)))
        bpy.data.objects.remove(made)
    np.testing.assert_allclose(means[1] / means[0], np.exp(-2.0 * 0.3 * np.array([0.5, 1.0, 0.0])), rtol=0.01)


@pytest.mark.slow
def test_light_on_a_floor_that_stands_in_water_is_dimmed(stage):
    """On the way of .4 m to it, though no photon leaves the water."""
    stage.floor()
    material = glass(stage)
    ball(stage, material, radius=0.1, place=(3, 0, 1))
    fill(material.node_tree, "ShaderNodeVolumeAbsorption", Color=(0.5, 0.0, 1.0, 1.0), Density=2.0)
    slab(stage, material, -0.1, 0.4)
    stage.light("SUN", angle=0.0)
    stage.camera_above(1.0)
    stage.scene.candela.slot_indirect, stage.scene.candela.slot_caustics = "OFF", PHOTONS
    seen = stage.render(samples=4, size=(32, 32), bounces=2)["combined"][..., :3].mean(axis=(0, 1))
    np.testing.assert_allclose(seen / seen[2], np.exp(-0.4 * np.array([1.0, 2.0, 0.0])), rtol=0.01)


@pytest.mark.slow
def test_light_through_a_drink_that_reaches_into_the_walls_of_its_glass_is_dimmed_between_them(stage):
    stage.floor(z=-1.0)
    clear, drink = glass(stage), glass(stage)
    ball(stage, clear, radius=0.1, place=(3, 0, 1))
    fill(drink.node_tree, "ShaderNodeVolumeAbsorption", Color=(0.5, 0.0, 1.0, 1.0), Density=2.0)
    for low, high, material in ((0.4, 0.5, clear), (-0.5, -0.4, clear), (-0.41, 0.41, drink)):
        slab(stage, material, low, high)
    stage.light("SUN", angle=0.0)
    stage.camera_above(1.0)
    stage.scene.candela.slot_indirect, stage.scene.candela.slot_caustics = "OFF", PHOTONS
    seen = stage.render(samples=4, size=(32, 32), bounces=2)["diffuse_indirect"][..., :3].mean(axis=(0, 1))
    np.testing.assert_allclose(seen / seen[2], np.exp(-0.82 * np.array([1.0, 2.0, 0.0])), rtol=0.02)


@pytest.mark.parametrize("gap", [0.003, 0.05])
def test_a_small_caster_beside_a_large_one_is_answered_for_once(gap):
    """However near: boxes are grown before they are sorted into groups, and groups do not overlap."""
    low = np.array([[0, 0, 0], [1 + gap, 0.5, 0.3]], float)
    found_low, found_high = groups(*grown(low, np.array([[1, 1, 1], [1.015 + gap, 0.515, 0.315]])))
    assert len(found_low) == 1 or (found_low[0] > found_high[1]).any() or (found_low[1] > found_high[0]).any()
    assert len(found_low) == (1 if gap < 0.02 else 2)


def test_a_thousand_casters_are_grouped_soon():
    low = np.random.default_rng(0).random((1000, 3)) * 100
    started = time.process_time()
    found_low, found_high = groups(low, low + 0.1)
    assert time.process_time() - started < 1.0
    assert len(found_low) <= 4
    for one in low:
        assert ((found_low <= one).all(axis=1) & (found_high >= one + 0.1).all(axis=1)).sum() == 1


def test_a_mirror_brings_no_light_of_glass_to_lamps_that_are_not_asked(stage):
    """Refractive caustics off: glass and lamps that are set to have them all the same, alone."""
    stage.floor()
    ball(stage, glass(stage), radius=0.3, place=(0, 0, 0.5)).cycles.is_caustics_caster = True
    ball(stage, stage.material("ShaderNodeBsdfGlossy", Roughness=0.0), radius=0.3, place=(2, 0, 0.5))
    stage.light("POINT", (0, 0, 3), energy=100, shadow_soft_size=0.0)
    stage.camera_above(4.0)
    stage.scene.candela.slot_indirect = "OFF"
    lamp = next(one for one in stage.scene.objects if one.type == "LIGHT")
    light = {}
    stage.scene.cycles.caustics_refractive = False
    try:
        for asked in (True, False):
            lamp.data.cycles.is_caustics_light = asked
            light[asked] = stage.render(2, size=(32, 32), bounces=2)["diffuse_indirect"][12:20, 12:20, 0].mean()
    finally:
        stage.scene.cycles.caustics_refractive = True
    assert light[True] > 0.05 and light[False] < 0.1 * light[True]


@pytest.mark.slow
def test_crests_of_water_focus_where_the_paraxial_law_says(stage):
    """z = A sin(kx): light below a crest comes together at the depth f = ior / ((ior - 1) A k^2), and above it has T /
    (1 - depth / f) of the sun's light."""
    ior, amplitude, wave = 1.33, 0.005, 2 * np.pi / 0.8
    focus = ior / ((ior - 1) * amplitude * wave**2)
    columns = 512
    across = np.linspace(-1.2, 1.2, columns + 1)
    rows = [[(x, y, amplitude * np.cos(wave * x)) for x in across] for y in (-0.6, 0.6)]
    faces = [(k, k + 1, columns + 2 + k, columns + 1 + k) for k in range(columns)]
    water = stage.mesh([*rows[0], *rows[1]], faces, material=glass(stage, ior))
    for polygon in water.data.polygons:
        polygon.use_smooth = True
    water.visible_camera = False
    floor = stage.floor(4.0)
    stage.light("SUN", angle=0.0)
    stage.camera_above(0.2, height=3.0)
    through = passed(1.0, ior)[0] / ior**2  # as radiance above the water
    starts = np.linspace(-0.15, 0.15, 30001)
    lean = np.arctan(amplitude * wave * np.sin(wave * starts))  # of the surface
    bend = lean - np.arcsin(np.sin(lean) / ior)
    for part in (0.25, 0.5, 0.75):
        floor.location.z = -part * focus
        energy = irradiance(stage, PHOTONS, samples=4, size=(32, 8), grid=512)
        found = energy[2:6, 14:18].mean()
        ends = starts - np.tan(bend) * (part * focus + amplitude * np.cos(wave * starts))
        half = 2 * 0.2 / 32
        exact = (np.abs(ends) < half).mean() * 0.3 / (2 * half)
        assert exact == pytest.approx(1 / (1 - part), rel=0.1)  # what aberration leaves of the law
        assert found == pytest.approx(through * exact, rel=0.02)
    floor.location.z = -focus
    assert irradiance(stage, PHOTONS, samples=4, size=(32, 8), grid=512)[2:6, 14:18].mean() > 8.0 / ior**2


@pytest.mark.slow
def test_a_turned_scene_has_the_same_caustic_and_grey_light_stays_grey(stage, technique_name):
    """Look-ups depend on where texels lie on the far side, by the 5 % of the ball lens."""
    stage.floor()
    ball(stage, glass(stage))
    lamp = stage.light("SPOT", location=(0.8, 0, 3.0), turn=(0, 0.3, 0), shadow_soft_size=0.05, spot_size=1.0)
    stage.camera_above(3.0)
    totals = []
    for turn in (0.0, 1.1):
        lamp.location = (0.8 * np.cos(turn), 0.8 * np.sin(turn), 3.0)
        lamp.rotation_euler = (0, 0.3, turn)
        light = irradiance(stage, technique_name, samples=4)  # pixels of 2 cm: of larger ones the spot misses some
        totals.append(float(light.sum()))
    assert totals[1] == pytest.approx(totals[0], rel=0.02 if technique_name == PHOTONS else 0.05)
    images = stage.render(samples=2, size=(32, 32), bounces=2)["diffuse_indirect"]
    np.testing.assert_allclose(images[..., 1:3], images[..., :1].repeat(2, axis=-1), rtol=1e-4, atol=1e-6)


@pytest.mark.slow
def test_nothing_bent_puts_light_straight_behind_its_caster(stage, technique_name):
    """Index 1: caustic and shadow together are the light without the ball."""
    stage.floor()
    ball(stage, glass(stage, 1.0))
    stage.light("SUN", angle=0.0)
    stage.camera_above(2.0)
    images = both(stage, technique_name)
    x, y = places((64, 64), 2.0)
    away = np.abs(np.hypot(x, y) - 0.5) > 0.06
    whole = images[away]
    assert whole.mean() == pytest.approx(1.0, abs=0.01)
    assert np.abs(whole - 1.0).max() < 0.06


@pytest.fixture(params=(PHOTONS, MAPPING))
def technique_name(request):
    return request.param


def both(stage, technique, samples=4, size=(64, 64)):
    """Direct and caustic irradiance together."""
    stage.scene.candela.slot_indirect = "OFF"
    stage.scene.candela.slot_caustics = technique
    images = stage.render(samples=samples, size=size, bounces=2)
    return (images["diffuse_direct"] + images["diffuse_indirect"])[..., 0] * np.pi


@pytest.mark.slow
def test_total_is_the_same_for_coarse_and_fine_grids(stage, technique_name):
    stage.floor()
    ball(stage, glass(stage))
    stage.light("SUN", angle=0.0)
    stage.camera_above(4.0)
    totals = [irradiance(stage, technique_name, samples=4, size=(64, 64), grid=side).sum() for side in (48, 96, 192)]
    for total in totals:
        assert float(total) == pytest.approx(float(totals[-1]), rel=0.015)


def test_twice_the_power_is_twice_the_caustic(stage, technique_name):
    stage.floor()
    ball(stage, glass(stage))
    lamp = stage.light("SUN", angle=0.0)
    stage.camera_above(3.0)
    once = irradiance(stage, technique_name, samples=1, size=(32, 32))
    lamp.data.energy = 2.0
    assert irradiance(stage, technique_name, samples=1, size=(32, 32)) == pytest.approx(2 * once, rel=1e-4, abs=1e-6)


def test_what_hides_and_what_catches_is_drawn_where_its_own_material_says(stage, monkeypatch):
    """By one program for all materials, and by each one's own, which a card with alpha has in any case."""
    stage.floor()
    ball(stage, glass(stage))
    see_through = stage.material("ShaderNodeBsdfPrincipled", Alpha=0.5)
    for place, material in (((0.4, 0, 2), stage.material("ShaderNodeBsdfDiffuse")), ((-0.4, 0, 2), see_through)):
        bpy.ops.mesh.primitive_plane_add(size=0.4, location=place)
        bpy.context.object.data.materials.append(material)
        bpy.context.object.visible_camera = False
    lamp = stage.light("SUN", angle=0.0)
    stage.camera_above(3.0)
    once = irradiance(stage, MAPPING, samples=1, size=(32, 32))
    monkeypatch.setattr(light_views, "told_by_place", lambda *_: frozenset())
    lamp.data.energy = 2.0
    twice = irradiance(stage, MAPPING, samples=1, size=(32, 32))
    assert once.max() > 0.5 and twice == pytest.approx(2 * once, rel=1e-3, abs=1e-5)


def test_glass_casts_a_full_shadow_where_its_light_arrives_as_photons(stage):
    """And the grey one where the slot is off: nothing is counted twice, nothing is missing."""
    stage.floor()
    ball(stage, glass(stage))
    stage.light("SUN", angle=0.0)
    stage.camera_above(0.6)
    dark = irradiance(stage, PHOTONS, samples=4, size=(16, 16), path="diffuse_direct")
    assert dark.max() == pytest.approx(0.0, abs=1e-6)
    grey = irradiance(stage, "OFF", samples=4, size=(16, 16), path="diffuse_direct")
    assert 0.5 < grey[6:10, 6:10].mean() < 1.0
    assert "the caustics slot is off" in stage.ledger.row(PHOTONS).reason


@pytest.mark.slow
def test_maps_of_glass_that_stops_light_are_no_finer_and_not_drawn_by_colour(stage):
    """Coloured glass takes three maps, twice as fine from 64 samples on, only where light passes it straight."""
    stage.floor()
    ball(stage, glass(stage, Color=(0.9, 0.5, 0.2, 1)))
    stage.light("SUN", angle=0.0)
    stage.camera_above(0.6)

    def maps_of(technique):
        irradiance(stage, technique, samples=64, size=(16, 16), path="diffuse_direct")
        frame = stage.renderer.frame
        provider = next(one for one in frame.plan.techniques if one.name == "accumulated_maps")
        return provider.resolution(frame), stage.ledger.row("accumulated_maps").counters["maps"]

    coarse, fine = maps_of(PHOTONS), maps_of("OFF")
    assert fine[0] == 2 * coarse[0]
    assert fine[1] == 3 * coarse[1]


@pytest.mark.slow
def test_larger_lamps_make_softer_caustics(stage):
    """A mirror shows the floor a disc of .2 m from 2 m away: edges are .2 m wide, in the mean of samples and in one."""
    stage.floor()
    mirror = stage.material("ShaderNodeBsdfGlossy", Roughness=0.0, Color=(1, 1, 1, 1))
    made = stage.rectangle((-0.4, -0.4), (0.4, 0.4), material=mirror, location=(0, 0, 2), turn=(0, -np.pi / 4, 0))
    made.visible_camera = False
    stage.light("SUN", turn=(0, np.pi / 2, 0), angle=0.2)
    stage.camera_above(3.0)
    many = irradiance(stage, PHOTONS, samples=64, size=(64, 64))
    ones = [irradiance(stage, PHOTONS, samples=1, size=(64, 64), seed=seed) for seed in range(6)]
    assert np.mean([one.sum() for one in ones]) == pytest.approx(many.sum(), rel=0.03)
    assert np.mean([np.abs(one - many).mean() for one in ones]) < 0.15 * many.mean()


def light_through_a_ball(lamp, width, power, middle, radius, ior, edges, rays=400_000):
    """Light tracing: W/m2 on the floor z = 0 in rings about (0, 0), of a square lamp that looks down from `lamp` m, by
    a ball's two refractions; a lamp of P watts has the radiance P / (pi width^2)."""
    rng = np.random.default_rng(3)
    start = np.concatenate([(rng.random((rays, 2)) - 0.5) * width, np.full((rays, 1), lamp)], axis=1)
    turn, away = 2 * np.pi * rng.random(rays), 1.05 * radius * np.sqrt(rng.random(rays))
    axis = middle - start
    far = np.linalg.norm(axis, axis=1, keepdims=True)
    axis /= far
    u = np.cross(axis, (1.0, 0.0, 0.0))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    disc = away[:, None] * (np.cos(turn)[:, None] * u + np.sin(turn)[:, None] * np.cross(axis, u))
    way = middle + disc - start
    far = np.linalg.norm(way, axis=1, keepdims=True)
    way /= far
    facing = np.sum(way * axis, axis=1)
    flux = power / np.pi * -way[:, 2] * facing / far[:, 0] ** 2 * np.pi * (1.05 * radius) ** 2 / rays

    def fresnel(cosine, eta):
        g = np.sqrt(eta * eta - 1 + cosine * cosine)
        first = (g - cosine) / (g + cosine)
        second = ((g + cosine) * cosine - 1) / ((g - cosine) * cosine + 1)
        return 0.5 * first**2 * (1 + second**2)

    offset = start - middle
    along = np.sum(offset * way, axis=1)
    inside = along**2 - np.sum(offset**2, axis=1) + radius**2
    hit = inside > 0
    start, way, flux, along, inside = start[hit], way[hit], flux[hit], along[hit], inside[hit]
    place = start - way * (along + np.sqrt(inside))[:, None]
    normal = (place - middle) / radius
    cosine = -np.sum(way * normal, axis=1)
    within_it = np.sqrt(1 - (1 - cosine**2) / ior**2)
    flux *= (1 - fresnel(cosine, ior)) ** 2  # at both faces the same
    way = way / ior + (cosine / ior - within_it)[:, None] * normal
    place = place + 2 * radius * within_it[:, None] * way
    normal = (place - middle) / radius
    way = way * ior + (cosine - ior * within_it)[:, None] * normal
    down = way[:, 2] < 0
    place, way, flux = place[down], way[down], flux[down]
    from_middle = np.linalg.norm((place - way * (place[:, 2] / way[:, 2])[:, None])[:, :2], axis=1)
    watts = np.histogram(from_middle, edges, weights=flux)[0]
    return watts / (np.pi * np.diff(np.square(edges)))


def rings(energy, span, edges):
    """Mean of an image of the floor from above in rings about its middle."""
    x, y = places(energy.shape[::-1], span)
    from_middle = np.hypot(x, y)
    return np.array([energy[(from_middle >= a) & (from_middle < b)].mean() for a, b in pairwise(edges)])


@pytest.mark.slow
def test_a_caustic_that_few_samples_draw_has_all_of_its_light(stage):
    """From eight samples on photons come in as many as they are worth: no more light than where every sample has them,
    though inner faces choose for all photons of a sample whether they mirror."""
    stage.floor()
    stage.light("POINT", (0, 0, 3), energy=300, shadow_soft_size=0.05)
    ball(stage, glass(stage, Color=(0.5, 0.5, 0.5, 1.0)), radius=0.3, place=(0, 0, 0.5), segments=48)
    stage.camera_above(3.0)
    few, many = (irradiance(stage, PHOTONS, samples=samples, size=(48, 48)).mean() for samples in (4, 16))
    assert many == pytest.approx(few, rel=0.05)


@pytest.mark.slow
def test_a_softbox_has_its_caustic_and_the_glass_its_shadow(stage):
    """A lamp of 1 m, 1 m above a glass ball: as wide as it is far."""
    stage.floor()
    ball(stage, glass(stage), radius=0.3, place=(0, 0, 0.5), segments=64)
    stage.light("AREA", (0, 0, 1.5), energy=80, size=1.0)
    stage.camera_above(1.6)
    edges = np.array([0.0, 0.18, 0.3])
    truth = light_through_a_ball(1.5, 1.0, 80, np.array([0, 0, 0.5]), 0.3, 1.5, edges)
    many, few = (
        np.mean([irradiance(stage, PHOTONS, samples=samples, size=(64, 64), seed=seed) for seed in range(4)], axis=0)
        for samples in (16, 1)
    )
    np.testing.assert_allclose(rings(many, 1.6, edges), truth, rtol=0.06)
    assert few.mean() == pytest.approx(many.mean(), rel=0.1)


@pytest.mark.slow
def test_colours_of_several_glasses_are_bent_as_if_each_stood_alone(stage):
    """Dispersion as it is built of Glass nodes that are added: red of index 1.3, blue of 1.7."""
    stage.floor()
    colors = {1.3: (1.0, 0.0, 0.0, 1.0), 1.7: (0.0, 0.0, 1.0, 1.0)}
    single = [glass(stage, ior, Color=color) for ior, color in colors.items()]
    both = bpy.data.materials.new("both")
    both.use_nodes = True
    tree = both.node_tree
    output = next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
    joined = tree.nodes.new("ShaderNodeAddShader")
    for socket, (ior, color) in zip(joined.inputs, colors.items()):
        node = tree.nodes.new("ShaderNodeBsdfGlass")
        node.inputs["IOR"].default_value, node.inputs["Color"].default_value = ior, color
        node.inputs["Roughness"].default_value = 0.0
        tree.links.new(node.outputs[0], socket)
    tree.links.new(joined.outputs[0], output.inputs["Surface"])
    made = ball(stage, both, segments=64)
    stage.light("SUN", angle=0.0)
    stage.camera_above(1.6)
    stage.scene.candela.slot_indirect, stage.scene.candela.slot_caustics = "OFF", PHOTONS

    def caustic(material, samples):
        made.data.materials[0] = material
        return stage.render(samples=samples, size=(48, 48), bounces=2)["diffuse_indirect"]

    alone = [caustic(material, 4) for material in single]
    for samples in (4, 1):
        found = caustic(both, samples)
        for image, channel in zip(alone, (0, 2)):
            assert found[..., channel].mean() == pytest.approx(image[..., channel].mean(), rel=0.05)
            assert np.abs(found - image)[..., channel].mean() < 0.25 * image[..., channel].mean()


@pytest.mark.slow
@pytest.mark.skipif(bpy.app.version < (5, 3), reason="Principled has no dispersion before Blender 5.3")
def test_principled_glass_bends_blue_more_than_red(stage):
    """Below a ball of Abbe number 4, as far away as red comes together, red is 1.6 times as bright as blue in the
    middle (Cycles: 1.64), and all of the light is white."""
    stage.floor()
    made = stage.principled(Transmission_Weight=1.0, Roughness=0.0, Base_Color=(1, 1, 1, 1), IOR=1.5)
    node = next(node for node in made.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    node.inputs["Transmission Dispersion Scale"].default_value = 1.0
    node.inputs["Transmission Dispersion Abbe Number"].default_value = 4.0
    ball(stage, made, segments=48)
    stage.light("SUN", angle=0.2)
    stage.camera_above(1.6)
    stage.scene.candela.slot_indirect = "OFF"
    light = stage.render(samples=8, size=(32, 32), bounces=2)["diffuse_indirect"][..., :3]
    middle = light[14:18, 14:18].mean(axis=(0, 1))
    assert middle[0] > middle[1] > middle[2]
    assert middle[0] == pytest.approx(1.64 * middle[2], rel=0.2)
    assert light.mean(axis=(0, 1)) == pytest.approx(light.mean(), rel=0.1)


@pytest.mark.slow
def test_normals_of_a_coarse_smooth_mesh_make_no_light(stage):
    """Shading normals bend light that a triangle of another slope meets: of a ball of few faces, smooth-shaded, as much
    arrives as of a fine one (Veach's factor of adjoint scattering)."""
    stage.floor()
    stage.light("SUN", angle=0.0)
    stage.camera_above(2.4)
    totals = []
    for segments in (64, 16):
        made = ball(stage, glass(stage), segments=segments, place=(0, 0, 0.9))
        totals.append(irradiance(stage, PHOTONS, samples=4, size=(48, 48)).mean())
        stage.remove(made)
    polygon = 16 / (2 * np.pi) * np.sin(2 * np.pi / 16)  # share of a disc that its outline holds
    assert totals[1] == pytest.approx(polygon * totals[0], rel=0.06)


# What they are skipped for -------------------------------------------------------------------------------------------


def reason(stage, name=PHOTONS):
    stage.render(samples=1, size=(8, 8), bounces=2)
    row = stage.ledger.row(name)
    assert row.state == SKIPPED
    return row.reason


@pytest.mark.slow
def test_scenes_without_casters_lamps_or_room_for_them_say_so(stage):
    stage.floor()
    lamp = stage.light("SUN", angle=0.0)
    stage.camera_above(1.0)
    assert f"no material is glass or metal of roughness {THROWS:g} or less" in reason(stage)
    pane = stage.mesh(
        [(x, y, z) for z in (0.5, 0.52) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))],
        [(3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)],
        material=glass(stage),
    )
    assert "flat panes" in reason(stage)
    stage.remove(pane)
    made = ball(stage, glass(stage))
    lamp.data.use_shadow = False
    assert "no lamp that casts shadows" in reason(stage)
    lamp.data.use_shadow = True
    stage.remove(made)
    ball(stage, stage.material("ShaderNodeBsdfGlossy", Roughness=0.0))
    stage.scene.cycles.caustics_refractive = stage.scene.cycles.caustics_reflective = False
    try:
        assert "switched off" in reason(stage)
    finally:
        stage.scene.cycles.caustics_refractive = stage.scene.cycles.caustics_reflective = True


@pytest.mark.parametrize("samples", [1, 8])
def test_photons_stay_on_their_side_of_a_wall(stage, samples):
    """A wall without thickness beside a ball of glass: the floor behind it stays dark, and no light is lost."""
    found = []
    for wall in (True, False):
        stage.clear()
        stage.floor()
        ball(stage, glass(stage), radius=0.3, place=(-0.45, 0, 0.7))
        if wall:
            black = stage.diffuse(0.0)
            stage.rectangle((-2, -2), (2, 2), material=black, turn=(0, np.pi / 2, 0)).visible_camera = False
        stage.light("POINT", (-1.4, 0, 1.6), energy=100.0, shadow_soft_size=0.02)
        stage.camera_above(1.6)
        found.append(irradiance(stage, PHOTONS, samples=samples, size=(64, 64)))
    before, behind = found[0][:, :32], found[0][:, 32:]
    assert behind.sum() < 2e-3 * before.sum()
    assert before.sum() == pytest.approx(found[1][:, :32].sum(), rel=0.02)


# Stress --------------------------------------------------------------------------------------------------------------


def touching(stage):
    ball(stage, glass(stage), place=(0, 0, 0.5), segments=32)


def sheets(stage):
    for k in range(40):
        stage.rectangle((-0.5, -0.5), (0.5, 0.5), 0.3 + 0.01 * k, material=glass(stage, 1.2))


def around_the_lamp(stage):
    ball(stage, glass(stage), place=(0, 0, 2), segments=32)


def around_the_camera(stage):
    ball(stage, glass(stage), radius=2.0, place=(0, 0, 10), segments=32)


def rough(stage):
    ball(stage, glass(stage, Roughness=1.0), segments=32)


def thin(stage):
    stage.mesh([(-1, 0, 0.5), (1, 0, 0.5), (0, 1e-6, 0.5)], [(0, 1, 2)], material=glass(stage))


def broken(stage):
    nan = float("nan")
    stage.mesh([(-1, 0, 0.5), (1, 0, 0.5), (0, 1, nan), (0, -1, 0.5)], [(0, 1, 2), (0, 3, 1)], material=glass(stage))


def extreme_index(stage):
    ball(stage, glass(stage, 1000.0), segments=16)
    ball(stage, glass(stage, 0.3), place=(1, 0, 1), segments=16)


def tiny(stage):
    ball(stage, glass(stage), radius=1e-4, place=(0, 0, 1e-3), segments=16)


@pytest.mark.slow
@pytest.mark.parametrize(
    "build", (touching, sheets, around_the_lamp, around_the_camera, rough, thin, broken, extreme_index, tiny)
)
def test_odd_casters_leave_finite_light(stage, technique_name, build):
    stage.floor()
    build(stage)
    stage.light("POINT", location=(0.1, 0, 2), shadow_soft_size=0.0)
    stage.light("SUN", turn=(0, 1.4, 0), angle=0.01)
    stage.camera_above(3.0)
    images = []
    for _ in range(2):
        stage.scene.candela.slot_caustics = technique_name
        images.append(stage.render(samples=2, size=(16, 16), bounces=2)["diffuse_indirect"])
        stage.scene.candela.slot_caustics = "AUTO"
        stage.render(samples=1, size=(8, 8), bounces=2)  # so that the next one is drawn anew
    assert (images[0] >= 0).all()
    assert images[0] == pytest.approx(images[1], rel=1e-3, abs=1e-5)  # sums in another order


def seen_directly_and_in_a_mirror(stage, technique, ior, samples=4, size=0.0):
    """What a floor below a glass ball shows from above, and in a mirror above a camera that looks up."""
    stage.floor(1.5)
    made = ball(stage, glass(stage, ior), place=(0, 0, 1.0))
    made.visible_glossy = False
    mirror = stage.rectangle(
        (-2, -2), (2, 2), 4.0, material=stage.material("ShaderNodeBsdfGlossy", Roughness=0.0, Color=(1, 1, 1, 1))
    )
    mirror.visible_camera = True
    if size:
        stage.light("AREA", location=(0, 0, 3.5), size=size)
    else:
        stage.light("SPOT", location=(0, 0, 3.5), shadow_soft_size=0.2, spot_size=0.6, spot_blend=0.0)
    camera = stage.camera_above(1.6, height=2.5)
    stage.scene.candela.slot_indirect = "OFF"
    stage.scene.candela.slot_caustics = technique
    pictures = []
    for turn in ((0, 0, 0), (np.pi, 0, 0)):
        camera.rotation_euler = turn
        found = stage.render(samples=samples, size=(48, 48), bounces=3)
        pictures.append(found["combined"][..., 0].astype(float))
    assert stage.ledger.row("shaded_reflections").state == stage.ledger.row(technique).state == RAN
    return pictures


@pytest.mark.slow
def test_a_caustic_is_as_bright_in_a_mirror_as_beside_it(stage, technique_name):
    seen, mirrored = seen_directly_and_in_a_mirror(stage, technique_name, 1.5)
    mirrored = mirrored[::-1]
    middle = slice(16, 32)
    assert mirrored[middle, middle].sum() == pytest.approx(seen[middle, middle].sum(), rel=0.05)
    assert mirrored.sum() == pytest.approx(seen.sum(), rel=0.05)
    spread = [float((one * np.hypot(*places((48, 48), 1.6)) ** 2).sum() / one.sum()) for one in (seen, mirrored)]
    assert spread[1] == pytest.approx(spread[0], rel=0.1)


def test_a_pattern_colours_light_where_it_enters_glass_and_where_it_leaves(stage):
    """A slab of index 1 between a sun and a floor, green where x < 0 and red beside: light crosses two faces of one."""
    made = checkered(stage, 1.0)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=32, ring_count=16, radius=0.1, location=(5, 5, 1))  # no pane alone
    bpy.context.object.data.materials.append(made)
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(0, 0, 0.5))
    slab = bpy.context.object
    slab.scale = (1.0, 1.0, 0.1)
    slab.data.materials.append(made)
    slab.visible_camera = False
    stage.floor(2.0)
    stage.light("SUN", energy=np.pi, angle=0.01)
    stage.camera_above(1.0)
    stage.scene.candela.slot_indirect, stage.scene.candela.slot_caustics = "OFF", PHOTONS
    found = stage.render(samples=4, size=(24, 24), bounces=3)["diffuse_indirect"][..., :3]
    assert found[8:16, 4:9].mean((0, 1)) == pytest.approx([0.25, 1.0, 0.25], abs=0.06)
    assert found[8:16, 15:20].mean((0, 1)) == pytest.approx([1.0, 0.25, 0.25], abs=0.06)


def cloth(stage, distribution, roughness):
    made = stage.material("ShaderNodeBsdfSheen", Color=(1, 1, 1, 1), Roughness=roughness)
    next(node for node in made.node_tree.nodes if node.type == "BSDF_SHEEN").distribution = distribution
    return made


LOBES = {
    "gloss of .3": lambda stage: stage.material("ShaderNodeBsdfGlossy", Roughness=0.3, Color=(1, 1, 1, 1)),
    "gloss of .6": lambda stage: stage.material("ShaderNodeBsdfGlossy", Roughness=0.6, Color=(1, 1, 1, 1)),
    "velvet": lambda stage: cloth(stage, "ASHIKHMIN", 0.8),
    "sheen": lambda stage: cloth(stage, "MICROFIBER", 0.5),
    "toon": lambda stage: stage.material("ShaderNodeBsdfToon", Color=(1, 1, 1, 1), Size=0.9, Smooth=0.1),
}


@pytest.mark.parametrize("lobe", LOBES)
def test_a_lobe_shows_a_lamp_through_glass_that_bends_nothing_as_without_it(stage, lobe):
    """Photons bring what shadow rays bring without the ball, and rays of the lobe do not find the lamp once more."""
    stage.rectangle((-1.5, -1.5), (1.5, 1.5), material=LOBES[lobe](stage))
    made = ball(stage, glass(stage, 1.0), place=(0, 0, 1.0), segments=48)
    stage.light("SPOT", location=(0, 0, 2.5), shadow_soft_size=0.1, spot_size=0.8, spot_blend=0.0)
    stage.camera_above(1.2)
    stage.scene.candela.slot_indirect, stage.scene.candela.slot_caustics = "OFF", PHOTONS
    stage.scene.candela.use_denoise = False
    through = stage.render(samples=4, size=(24, 24), bounces=3)["combined"][..., 0]
    assert stage.ledger.row(PHOTONS).state == RAN
    made.hide_render = True
    free = stage.render(samples=4, size=(24, 24), bounces=3)["combined"][..., 0]
    assert through.sum() == pytest.approx(free.sum(), rel=0.04)
    assert through[10:14, 10:14].mean() == pytest.approx(free[10:14, 10:14].mean(), rel=0.06)


@pytest.mark.parametrize("roughness", [THROWS, 0.5])
def test_rough_metal_is_lit_through_glass_that_it_is_seen_through(stage, roughness):
    """A ball that bends nothing leaves metal below it as bright as without it, and metal that throws caustics itself
    receives them, too. (From lobes as rough as these no ray goes on where they are met: the dial of a watch below its
    domed crystal was black under a lamp.)"""
    metal = stage.material("ShaderNodeBsdfGlossy", Roughness=roughness, Color=(1, 1, 1, 1))
    stage.rectangle((-1.5, -1.5), (1.5, 1.5), material=metal)
    made = ball(stage, glass(stage, 1.0), place=(0, 0, 1.0), segments=48)
    made.visible_camera = True
    stage.light("SPOT", location=(0.5, 0, 2.5), turn=(0, 0.2, 0), shadow_soft_size=0.1, spot_size=1.0, spot_blend=0.0)
    stage.camera_above(0.4)
    stage.scene.candela.slot_indirect, stage.scene.candela.slot_caustics = "instant_radiosity", PHOTONS
    found = []
    for hidden in (False, True):
        made.hide_render = hidden
        found.append(stage.render(samples=4, size=(24, 24), bounces=3)["combined"][4:20, 4:20, 0].mean())
    assert found[0] == pytest.approx(found[1], rel=0.08)


def test_a_light_guide_of_glass_loses_nothing_at_its_walls(stage):
    """A beam that enters the end of a rod at 65 degrees: twelve total reflections in one bring as much to the floor as
    three in another."""
    found = []
    for length in (0.8, 3.0):
        stage.clear()
        stage.floor(material=stage.diffuse(1.0))
        box(stage, glass(stage), (-0.1, -0.1, 0.01), (0.1, 0.1, 0.01 + length)).visible_camera = False
        slant = np.radians(65.0)
        place = (-0.3 * np.sin(slant), 0.0, 0.01 + length + 0.3 * np.cos(slant))
        stage.light("SPOT", place, turn=(0, -slant, 0), shadow_soft_size=0.002, spot_size=0.1, spot_blend=0.0)
        stage.camera_above(0.8)
        found.append(irradiance(stage, PHOTONS, size=(32, 32)).sum())
    assert found[1] == pytest.approx(found[0], rel=0.04)


def ball_over_rough_metal(stage, roughness=0.4):
    """A small lamp, and a ball of glass beside it that throws its light on rough metal, without bounced light."""
    gloss = stage.material("ShaderNodeBsdfGlossy", Roughness=roughness, Color=(1, 1, 1, 1))
    stage.rectangle((-1.5, -1.5), (1.5, 1.5), material=gloss)
    ball(stage, glass(stage), place=(0, 0.9, 0.6), segments=48)
    stage.light("POINT", location=(0.6, -0.9, 1.2), energy=100, shadow_soft_size=0.2)
    stage.camera_above(1.2)
    stage.scene.candela.slot_indirect, stage.scene.candela.slot_caustics = "OFF", PHOTONS


@pytest.mark.slow
def test_gloss_shows_a_lamp_by_way_of_glass_without_dots(stage):
    """What a ball mirrors of a small lamp onto rough metal, and what leaves it again after reflections within, comes as
    photons: rays of the metal's lobe, of which one in a thousand finds the lamp, leave that out."""
    ball_over_rough_metal(stage)
    stage.scene.candela.use_denoise = False
    found = stage.render(16, (24, 24), bounces=4)["glossy_indirect"][..., 0]
    truth = stage.render(4096, (24, 24), engine="CYCLES", bounces=4)["glossy_indirect"][..., 0]
    assert found.sum() == pytest.approx(truth.sum(), rel=0.05)
    assert np.square(found - truth).sum() < 2.0 * np.square(truth).sum()  # by rays 113


@pytest.mark.parametrize(("width", "is_wall"), [(0.01, False), (3.0, True)])
def test_a_thin_post_is_no_wall_to_photons(stage, monkeypatch, width, is_wall):
    """Of what stands in the light of a ball of glass a wall alone cuts footprints off, which would be endless."""
    walled = []

    def keep(self, *given, find=photons.Photons.footprints):
        records = find(self, *given)
        centre, value = (gpu_images.read(records[k])[..., 3] for k in (0, 3))
        walled.append(int(((centre != 0.0) & (value < 1.0)).sum()))
        return records

    monkeypatch.setattr(photons.Photons, "footprints", keep)
    stage.floor()
    ball(stage, glass(stage), radius=0.3, place=(-0.45, 0, 0.7))
    box(stage, stage.diffuse(0.0), (0.2, -width / 2, 0), (0.21, width / 2, 0.2)).visible_camera = False
    stage.light("POINT", (-1.4, 0, 1.6), energy=100.0, shadow_soft_size=0.15)
    stage.camera_above(1.6)
    irradiance(stage, PHOTONS, samples=1, size=(32, 32))
    assert (sum(walled) > 100) == is_wall


ENGINES = "CANDELA", "CYCLES"
SWITCHES = "caustics_reflective", "caustics_refractive"


@pytest.mark.parametrize("off", [SWITCHES[:1], SWITCHES[1:], SWITCHES], ids=str)
def test_switches_of_caustics_are_about_diffuse_surfaces(stage, off):
    """Gloss sees the same light by way of glass, by photons, whatever Cycles' switches say; it throws none itself."""
    ball_over_rough_metal(stage, roughness=THROWS + 0.05)
    found = [stage.render(4, (24, 24), bounces=4)["glossy_indirect"][..., 0]]
    try:
        for name in off:
            setattr(stage.scene.cycles, name, False)
        found.append(stage.render(4, (24, 24), bounces=4)["glossy_indirect"][..., 0])
    finally:
        for name in off:
            setattr(stage.scene.cycles, name, True)
    assert found[0].max() > 0.1
    assert found[1] == pytest.approx(found[0], rel=1e-3, abs=1e-4)


def test_a_mirror_sends_on_what_glass_lets_pass_where_that_throws_no_caustics(stage, monkeypatch):
    """As in Cycles, what counts is what a diffuse surface sees next: a floor has the lamp by way of glass and a mirror,
    not by way of glass alone."""
    monkeypatch.setattr(screen_space_photons, "_on_gloss", lambda *_: False)  # which wants all that glass lets pass
    stage.floor()
    shade = box(stage, glass(stage), (-2, -0.6, 0.1), (2, -0.5, 3))
    mirror = box(stage, stage.principled(Metallic=1.0, Roughness=0.0), (-2, 0.5, 0), (2, 0.6, 3))
    shade.visible_camera = mirror.visible_camera = False
    stage.light("POINT", (0, -1, 1), energy=100.0, shadow_soft_size=0.0)
    stage.camera_above(0.6)
    found = [irradiance(stage, PHOTONS, samples=2, size=(8, 8)).mean()]
    try:
        stage.scene.cycles.caustics_refractive = False
        found.append(irradiance(stage, PHOTONS, samples=2, size=(8, 8)).mean())
    finally:
        stage.scene.cycles.caustics_refractive = True
    mirror.location.y = 50.0
    by_glass_alone = irradiance(stage, PHOTONS, samples=2, size=(8, 8)).mean()
    assert found[1] > 0.1 * by_glass_alone
    assert found[1] == pytest.approx(found[0] - by_glass_alone, rel=0.1)


def test_velvet_that_takes_no_photons_shows_what_glass_mirrors(stage, monkeypatch):
    """In averaged reflections, whether other gloss takes photons or not; what few rays find varies from run to run."""
    candela, found = stage.scene.candela, []
    for on_gloss in (False, True):
        monkeypatch.setattr(screen_space_photons, "_on_gloss", lambda *_, answer=on_gloss: answer)
        stage.clear()
        stage.rectangle((-1.5, -1.5), (1.5, 1.5), material=cloth(stage, "ASHIKHMIN", 0.8))
        ball(stage, glass(stage), place=(0, 0.6, 0.6), segments=32)
        stage.light("POINT", location=(0, -0.9, 1.2), energy=100, shadow_soft_size=0.2)
        stage.camera_above(1.2)
        candela.slot_caustics, candela.slot_indirect, candela.shaded_reflections_bounces = (
            PHOTONS,
            "instant_radiosity",
            0,
        )
        found.append(stage.render(8, (16, 16), bounces=4)["glossy_indirect"][..., 0].mean())
    assert found[1] == pytest.approx(found[0], rel=0.5)


@pytest.mark.parametrize("index", [1.5, 1.0])
def test_glass_whose_caustics_are_off_stops_a_lamp(stage, index):
    """As in Cycles, whose paths find a wide lamp through it otherwise: diffuse surfaces do without what it would let
    pass, even if that bends nothing."""
    stage.floor()
    box(stage, glass(stage, index), (-3, -3, 0.5), (3, 3, 0.55)).visible_camera = False
    stage.light("POINT", (0, 0, 2), energy=100.0, shadow_soft_size=0.5)
    stage.camera_above(1.0)
    stage.scene.candela.slot_indirect = "OFF"
    lit = stage.render(16, (8, 8), engine="CYCLES", bounces=2)["combined"][..., 0].mean()
    try:
        stage.scene.cycles.caustics_refractive = False
        own, cycles = (stage.render(4, (8, 8), engine=name, bounces=2)["combined"][..., 0].mean() for name in ENGINES)
    finally:
        stage.scene.cycles.caustics_refractive = True
    assert cycles < 0.05 * lit
    assert own == pytest.approx(cycles, rel=0.03, abs=0.02)


def test_gloss_does_not_take_photons_of_a_lamp_that_rays_do_not_see_through_glass(stage):
    gloss = stage.material("ShaderNodeBsdfGlossy", Roughness=0.5, Color=(1, 1, 1, 1))
    stage.rectangle((-1.5, -1.5), (1.5, 1.5), material=gloss)
    ball(stage, glass(stage, 1.0), place=(0, 0, 1.0), segments=48)
    lamp = stage.light("SPOT", location=(0, 0, 2.5), shadow_soft_size=0.1, spot_size=0.8, spot_blend=0.0)
    lamp.visible_transmission = False
    stage.camera_above(1.2)
    stage.scene.candela.slot_indirect, stage.scene.candela.slot_caustics = "OFF", PHOTONS
    found = stage.render(samples=2, size=(24, 24), bounces=3)["combined"][..., 0]
    assert stage.ledger.row(PHOTONS).state == RAN
    assert not found[10:14, 10:14].any()


def test_rough_glass_mirrors_a_lamp_behind_clear_glass(stage):
    """No photon ends on glass: its rays look for the lamp themselves, as without the ball."""
    stage.rectangle((-1.5, -1.5), (1.5, 1.5), material=glass(stage, 1.5, Roughness=0.28))
    made = ball(stage, glass(stage, 1.0), place=(0, 0, 1.0), segments=48)
    stage.light("SPOT", location=(0, 0, 2.5), shadow_soft_size=0.3, spot_size=0.8, spot_blend=0.0)
    stage.camera_above(1.2)
    stage.scene.candela.slot_indirect, stage.scene.candela.slot_caustics = "OFF", PHOTONS
    through = stage.render(samples=8, size=(24, 24), bounces=3)["glossy_indirect"][..., 0]
    made.hide_render = True
    free = stage.render(samples=8, size=(24, 24), bounces=3)["glossy_direct"][..., 0]
    assert through.sum() == pytest.approx(free.sum(), rel=0.1)


def test_denoise_leaves_what_photons_bring(stage):
    """To diffuse surfaces and to gloss: the caustic's edge stays as sharp as its samples have it."""
    floor = stage.material("ShaderNodeBsdfPrincipled", **{"Base Color": (0.5, 0.5, 0.5, 1), "Roughness": 0.5})
    stage.rectangle((-1.5, -1.5), (1.5, 1.5), material=floor)
    ball(stage, glass(stage), place=(0, 0, 0.7), segments=32)
    stage.light("SPOT", location=(0, 0.8, 2.5), energy=200, shadow_soft_size=0.1, spot_size=1.6, spot_blend=0.0)
    stage.camera_above(2.5)
    stage.scene.candela.slot_indirect, stage.scene.candela.slot_caustics = "OFF", PHOTONS
    plain, denoised = (
        (setattr(stage.scene.candela, "denoise_strength", strength), stage.render(8, (32, 32), bounces=2))[1]
        for strength in (0.0, 1.0)
    )
    (before, gloss_before), (after, gloss_after) = (
        [light_paths(images)[path] for path in ("diffuse_indirect", "glossy_indirect")] for images in (plain, denoised)
    )
    focus = np.unravel_index(before[..., 0].argmax(), before.shape[:2])
    assert np.square(after - before).mean() < 1e-3 * np.square(before).mean()
    assert gloss_before[focus][0] > 0.1
    assert gloss_after[focus] == pytest.approx(gloss_before[focus], rel=0.05)


@pytest.mark.slow
def test_points_of_a_wide_lamp_share_a_map_that_has_the_light_of_all(stage, monkeypatch):
    kept, keep = [], CausticMaps.keep
    monkeypatch.setattr(CausticMaps, "keep", lambda self, *given: kept.append(self._pending) or keep(self, *given))
    seen, mirrored = seen_directly_and_in_a_mirror(stage, PHOTONS, 1.5, samples=2, size=1.0)
    # One of the ball a sample and picture, for 8 points; the mirror beside the lamp is seen by faces of cubes.
    assert sum(one is not None and one[0].middle is not None for one in kept) == 2 * 2
    assert mirrored.sum() == pytest.approx(seen.sum(), rel=0.05)
    assert mirrored[16:32, 16:32].sum() == pytest.approx(seen[16:32, 16:32].sum(), rel=0.05)


@pytest.mark.parametrize(("away", "width"), [(3.5, 96), (2.5, 96), (1.5, 96), (9.0, 96)])
def test_grids_are_as_fine_as_pixels_can_show(away, width):
    """Two photons a pixel of a box of 1 m, seen by a right angle from `away`, less two of its diagonals; from 64 to
    160."""
    pixels = width / (2.0 * (away - 2.0)) if away > 2.0 else np.inf
    assert grids(away, width, [10.0])[0, 0] == round(np.clip(2.0 * pixels, 64, 160))


def test_grids_have_photons_by_the_third_root_of_what_they_carry():
    found = grids(0.0, 1000, [80.0, 20.0, 0.001])[:, 0]
    assert tuple(found) == (160, 101, 80)
    assert tuple(grids(0.0, 1000, [80.0, np.nan, np.inf])[:, 0]) == (160, 160, 160)


def grids(away, width, watts, side=160):
    """Of lamps 2 m above a box of 1 m of diagonal."""
    matrix = np.eye(4)
    matrix[2, 3] = away
    camera = SimpleNamespace(frame=(-1, 1, -1, 1), kind="PERSPECTIVE", matrix=matrix, from_above=False)
    frame = SimpleNamespace(view=SimpleNamespace(camera=camera, film=SimpleNamespace(width=width), origin=np.zeros(3)))
    lamps = [
        SimpleNamespace(light=1, kind=0, power=one, position=lambda at: np.array([0, 0, 2.0]), middle=lambda: None)
        for one in watts
    ]
    half = np.full(3, 0.5 / np.sqrt(3))
    return photon_grids.sides(frame, lamps, [(-half, half)], side)


@pytest.mark.slow
def test_a_map_that_serves_several_samples_is_as_bright(stage, monkeypatch):
    """In a mirror: rays of 16 samples ask the maps of 5."""
    begun, begin = [], CausticMaps.begin
    monkeypatch.setattr(CausticMaps, "begin", lambda *given: begun.append(given) or begin(*given))
    seen, mirrored = seen_directly_and_in_a_mirror(stage, PHOTONS, 1.5, samples=16)
    assert mirrored.sum() == pytest.approx(seen.sum(), rel=0.05)
    assert len(begun) <= 2 * 5  # of two pictures


@pytest.mark.slow
def test_glass_that_bends_nothing_leaves_no_trace_in_a_mirror(stage, technique_name):
    _, mirrored = seen_directly_and_in_a_mirror(stage, technique_name, 1.0)
    x, y = places((48, 48), 1.6)
    inside = mirrored[np.hypot(x, y) < 0.3].mean()
    around = mirrored[(np.hypot(x, y) > 0.75) & (np.hypot(x, y) < 0.8)].mean()
    assert inside == pytest.approx(around, rel=0.12)  # by the cosine and the distance of the spot


@pytest.mark.slow
def test_a_ball_that_mirrors_spreads_light_which_few_photons_have(stage, monkeypatch):
    """Far fewer photons, and one point of a wide lamp in each sample: the same light in the mean of twelve seeds."""
    stage.floor()
    ball(stage, stage.material("ShaderNodeBsdfGlossy", Roughness=0.0), radius=0.5, place=(0, 0, 0.8))
    stage.light("AREA", location=(0, 0, 4), size=2.0, energy=100.0)
    stage.camera_above(2.0)
    stage.scene.candela.slot_indirect = "OFF"

    def light():
        found = [stage.render(samples=2, size=(32, 32), bounces=2, seed=k)["diffuse_indirect"] for k in range(12)]
        return np.mean([one[..., :3].sum() for one in found]), stage.ledger.row(PHOTONS).counters["photons"]

    few, least = light()
    monkeypatch.setattr(caustic_casters, "is_convex", lambda mesh: False)
    monkeypatch.setattr(photon_grids, "PER_PIXEL", np.inf)  # the whole grid, however few pixels the ball fills
    many, most = light()
    assert least < most / 4
    assert few == pytest.approx(many, rel=0.03)


@pytest.mark.parametrize("shape, convex", [("ball", True), ("cube", False), ("ring", False), ("monkey", False)])
def test_meshes_that_make_no_light_converge(stage, shape, convex):
    make = {
        "ball": lambda: bpy.ops.mesh.primitive_uv_sphere_add(segments=24, ring_count=12),
        "cube": bpy.ops.mesh.primitive_cube_add, "ring": bpy.ops.mesh.primitive_torus_add,
        "monkey": bpy.ops.mesh.primitive_monkey_add,
    }  # fmt: skip
    make[shape]()
    made = bpy.context.object.data
    made.calc_loop_triangles()
    positions = np.array([vertex.co for vertex in made.vertices], np.float32)
    mesh = SimpleNamespace(
        key=shape, version=0, positions=positions, bounds_min=positions.min(axis=0), bounds_max=positions.max(axis=0),
        corner_vertices=np.array([loop.vertex_index for loop in made.loops]),
        triangle_corners=np.array([triangle.loops for triangle in made.loop_triangles]),
        triangle_count=len(made.loop_triangles),
    )  # fmt: skip
    assert caustic_casters.is_convex(mesh) == convex


@pytest.mark.slow
def test_lights_that_take_turns_shine_as_much_as_if_each_sample_had_all(stage, technique, monkeypatch):
    """Three lamps over two balls are six views: 4 a sample at most, so that two rounds have all."""
    monkeypatch.setattr(shares, "FEWEST_SAMPLES", 1000)  # else samples rest for their small share, too
    stage.floor()
    for side in (-0.8, 0.8):
        ball(stage, glass(stage), radius=0.4, place=(side, 0, 0.8), segments=32)
    for k in range(3):
        stage.light("POINT", (0.6 * (k - 1), 0.4 * k, 4.0), energy=100 * (k + 1), shadow_soft_size=0.0)
    stage.camera_above(4.0)
    turns = irradiance(stage, technique, 8, (64, 64), grid=48)
    views = stage.ledger.row(technique).counters["light views"]
    monkeypatch.setattr(photons, "VIEWS", 100)
    irradiance(stage, technique, 1, (8, 8))  # so that the next one is drawn anew
    every = irradiance(stage, technique, 8, (64, 64), grid=48)
    assert views < 0.7 * stage.ledger.row(technique).counters["light views"]
    assert turns.mean() == pytest.approx(every.mean(), rel=0.005)
    coarse, fine = (light.reshape(8, 8, 8, 8).mean(axis=(1, 3)) for light in (turns, every))
    assert np.abs(coarse - fine).mean() < 0.1 * every.mean()  # of half as many samples, footprints are wider


@pytest.mark.slow
@pytest.mark.parametrize("solid", [False, True], ids=["pool", "glass"])
def test_what_lies_in_water_or_glass_is_as_bright_as_in_cycles(written, solid):
    """Seen from above, through a sheet of water and in a block of glass that rays do not leave before."""
    stage = written
    stage.floor(4.0, material=stage.diffuse(0.01))  # dark: light is not thrown to and fro below the surface
    made = glass(stage, 1.5 if solid else 1.33)
    if solid:
        slab(stage, made, -0.5, 0.5, half=4.0).visible_camera = True
    else:
        stage.rectangle((-4, -4), (4, 4), 0.5, material=made)
    stage.light("SUN", angle=0.8)  # wide, so that Cycles' paths find it
    stage.scene.cycles.caustics_refractive = True
    stage.camera_above(1.0)
    own, cycles = (
        stage.written(engine, samples, size=(16, 16), bounces=4)["Transmission Indirect"][..., :3].mean()
        for engine, samples in (("CANDELA", 8), ("CYCLES", 1024))
    )
    print(f"{own:.6f} beside {cycles:.6f}")
    assert own == pytest.approx(cycles, rel=0.04)


def test_fog_dims_photons_before_their_caster_and_after_it(stage, technique_name):
    """A sheet of glass that bends nothing, 1 m above the floor, in an absorbing box 2 m high."""
    stage.floor(2.0)
    stage.rectangle((-1, -1), (1, 1), z=1.0, material=glass(stage, ior=1.0)).visible_camera = False
    stage.light("SUN", angle=0.0)
    stage.camera_above(1.0)
    clear = irradiance(stage, technique_name, samples=1, size=(16, 16)).mean()
    box(stage, absorber(stage, (0.4, 0.4, 0.4)), (-3, -3, -1), (3, 3, 2))
    foggy = irradiance(stage, technique_name, samples=1, size=(16, 16)).mean()
    assert 0.8 < clear < 1.1
    assert foggy / clear == pytest.approx(np.exp(-0.4 * 2), rel=0.01)


def test_photons_lose_at_each_of_two_mirrors_what_it_absorbs(stage):
    """A sun at 45 degrees comes down a gap of 1 m between two walls of mirror, 2 m high: over two reflections, to each
    place of the floor. (The second one took a lobe's mean that is scaled up for rough metal: 1.13 times.)"""
    stage.floor()
    metal = stage.material("ShaderNodeBsdfGlossy", Roughness=0.0, Color=(0.8, 0.8, 0.8, 1))
    for x in (-0.5, 0.5):
        wall = stage.mesh([(x, -9, 0), (x, 9, 0), (x, 9, 2), (x, -9, 2)], [(0, 1, 2, 3)], material=metal)
        wall.visible_camera = False
    stage.light("SUN", turn=(0, -np.pi / 4, 0), angle=0.0, energy=2.0)
    stage.camera_above(0.8)
    energy = irradiance(stage, PHOTONS, size=(48, 48))
    assert energy.mean() == pytest.approx(2.0 * np.cos(np.pi / 4) * 0.8**2, rel=0.02)
