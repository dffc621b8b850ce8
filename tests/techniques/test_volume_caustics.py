"""Volume caustics against closed forms: identity lens, rays and pixels, a ball lens by Snell and Fresnel; stress."""

import bpy
import numpy as np
import pytest

from bench.shaft_truth import meet
from tests.techniques.foggy_stage import box, fill, fog, volume


def ball(stage, radius, ior, location=(0, 0, 0)):
    bpy.ops.mesh.primitive_uv_sphere_add(segments=96, ring_count=48, radius=radius, location=location)
    made = bpy.context.object
    for face in made.data.polygons:
        face.use_smooth = True
    made.data.materials.append(stage.material("ShaderNodeBsdfGlass", IOR=ior, Roughness=0.0))
    return made


def media_light(seen):
    return (seen["volume_direct"] + seen["volume_indirect"])[..., 0]


def beams_alone(stage):
    """Nothing else is drawn, nor compiled."""
    for slot in ("volume", "indirect", "caustics", "reflection"):  # glass still hides beams behind it
        setattr(stage.scene.candela, f"slot_{slot}", "OFF")


def lens_scene(stage, ior):
    stage.camera((0, -5, 0), (np.pi / 2, 0, 0))
    stage.light("POINT", (0, 0, 2.0), energy=300, shadow_soft_size=0.0)
    fog(stage, Color=(0.9, 0.9, 0.9, 1), Density=0.15)
    stage.scene.candela.airlight_bounces = 0
    return ball(stage, 0.5, ior)


@pytest.mark.slow
def test_a_lens_of_index_one_changes_no_fog_below_it(stage):
    made = lens_scene(stage, 1.0001)
    lens = media_light(stage.render(16, size=(24, 24), bounces=1))[:10]
    assert stage.ledger.row("volume_caustics").state == "ran"
    made.hide_render = True
    clear = media_light(stage.render(16, size=(24, 24), bounces=1))[:10]
    assert lens.mean() == pytest.approx(clear.mean(), rel=0.02)


@pytest.mark.slow
def test_neither_rays_nor_pixels_change_a_beam(stage):
    lens_scene(stage, 1.5)
    beams_alone(stage)
    found = {}
    for rays, size in ((32, 32), (64, 32), (128, 32), (128, 64)):
        stage.scene.candela.volume_caustics_rays = rays
        found[rays, size] = stage.render(4, size=(size, size), bounces=1)["volume_indirect"].mean()
    assert list(found.values()) == pytest.approx([found[128, 32]] * 4, rel=0.02)


def test_beams_behind_a_coloured_pane_have_its_colour(stage):
    color, found = (1.0, 0.5, 0.1), []
    for tint in ((1, 1, 1), color):
        stage.clear()
        lens_scene(stage, 1.5)
        beams_alone(stage)
        stage.scene.candela.volume_caustics_rays = 32
        pane = stage.material("ShaderNodeBsdfTransparent", Color=(*tint, 1))
        stage.rectangle((-9, -9), (9, 9), material=pane, location=(0, -3, 0), turn=(np.pi / 2, 0, 0))
        found.append(stage.render(2, size=(16, 16), bounces=1)["volume_indirect"][..., :3].mean((0, 1)))
    assert found[0].min() > 0
    assert found[1] / found[0] == pytest.approx(np.array(color), rel=0.03)


def beams_of_a_ball(density, ior=1.5, pixels=64, span=6.0, rays=60_000, bounces=3):
    """(pixels, pixels) radiance that a ball of radius 1 in a cube of fog throws into it under a sun of irradiance 1,
    seen from the side: rays by Snell and Fresnel, with those mirrored inside up to `bounces` times. Row 0 is low."""
    half, number = span / 2, np.arange(rays)
    r, turn = np.sqrt((number + 0.5) / rays), np.pi * (3 - np.sqrt(5)) * number  # a spiral: even, and without noise
    place = np.stack([r * np.cos(turn), r * np.sin(turn), np.sqrt(1 - r * r)], axis=1)
    direction = np.broadcast_to([0.0, 0.0, -1.0], place.shape)

    flux = np.pi / rays * np.exp(-density * (half - place[:, 2]))
    bent, mirrored, share = meet(direction, place, 1 / ior)
    leaving = [(place, mirrored, flux * share)]
    direction, flux = bent, flux * (1 - share)
    within = np.exp(2 * density * (bent * place).sum(axis=1))  # fog fills the ball; chords are all as long
    for _ in range(bounces + 1):
        flux = flux * within
        place = place - 2 * (direction * place).sum(axis=1)[:, None] * direction
        bent, mirrored, share = meet(direction, -place, ior)
        leaving.append((place, bent, flux * (1 - share)))
        direction, flux = mirrored, flux * share
    image = np.zeros((pixels, pixels))
    for place, direction, flux in leaving:
        down = np.where(np.abs(direction[:, 2]) > 1e-6, direction[:, 2], 1e-6)
        for row, z in enumerate((np.arange(pixels) + 0.5) * span / pixels - half):
            t = (z - place[:, 2]) / down
            x, y = place[:, 0] + t * direction[:, 0], place[:, 1] + t * direction[:, 1]
            there = (t > 0) & (np.abs(x) < half) & (np.abs(y) < half)
            seen = flux[there] * np.exp(-density * (t[there] + half + y[there])) / np.abs(down[there])
            image[row] += np.histogram(x[there], bins=pixels, range=(-half, half), weights=seen)[0]
    return image * density / (4 * np.pi) * pixels / span


@pytest.mark.slow
def test_a_ball_lens_gathers_light_where_optics_say(stage):
    """Rays off the axis cross it before the paraxial focus, half a radius behind the ball: the waist is nearer."""
    stage.camera((0, -20, 0), (np.pi / 2, 0, 0))
    camera = stage.scene.camera.data
    camera.type, camera.ortho_scale = "ORTHO", 6.0
    stage.light("SUN", (0, 0, 5), energy=1.0, angle=0.0)
    box(stage, volume(stage, Color=(1, 1, 1, 1), Density=0.01), (-3, -3, -3), (3, 3, 3))
    beams_alone(stage)
    ball(stage, 1.0, 1.5)
    stage.scene.candela.volume_caustics_rays = 128
    beams = stage.render(8, size=(64, 64), bounces=1)["volume_indirect"][..., 0]
    z = 6.0 * ((np.arange(64) + 0.5) / 64 - 0.5)
    below = (z < -1.05) & (z > -2.95)
    expected = beams_of_a_ball(0.01)
    np.testing.assert_allclose(beams[below].sum(axis=1), expected[below].sum(axis=1), rtol=0.02)
    outside = z[:, None] ** 2 + z[None] ** 2 > 1.1**2  # the camera sees no beam behind the ball, nor in it
    assert beams[outside].sum() == pytest.approx(expected[outside].sum(), rel=0.01)

    def waist(image):
        wide = [(row > 0.3 * row.max()).sum() for row in image[below]]
        return z[below][np.flatnonzero(np.array(wide) == min(wide))].mean()

    assert waist(beams) == pytest.approx(waist(expected), abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("case", ["lamp inside", "gem", "speck", "box beside", "along the shaft"])
def test_beams_of_odd_casters_are_finite(stage, case):
    """A lamp in the glass, light that is mirrored inside over and over, glass of a millimetre, fog around half of the
    way, and a camera within the beam that looks along it."""
    stage.camera((0, -5, 0), (np.pi / 2, 0, 0))
    if case == "along the shaft":
        stage.camera((0, 0, -3), (np.pi, 0, 0))
    stage.light("POINT", (0, 0, 0.1 if case == "lamp inside" else 2.0), energy=300, shadow_soft_size=0.0)
    made = volume(stage, Color=(0.9, 0.9, 0.9, 1), Density=0.15)
    box(stage, made, (0.0 if case == "box beside" else -3, -6, -4), (3, 3, 3))
    beams_alone(stage)
    stage.scene.candela.volume_caustics_rays = 32
    ball(stage, 5e-4 if case == "speck" else 0.5, 2.4 if case == "gem" else 1.5)
    seen = stage.render(2, size=(16, 16), bounces=1)["volume_indirect"][..., :3]
    assert np.isfinite(seen).all() and (seen >= 0).all()
    assert case == "speck" or seen.max() > 0


@pytest.mark.slow
def test_fog_below_a_sheet_of_water_is_lit_as_in_cycles(written):
    """Rays of a wide sun, which Cycles' paths find, below a surface that they never leave again; one scattering."""
    stage = written
    stage.floor(2.0, material=stage.diffuse(0.0))
    stage.rectangle((-2, -2), (2, 2), 1.0, material=stage.material("ShaderNodeBsdfGlass", IOR=1.33, Roughness=0.0))
    box(stage, volume(stage, Density=0.3), (-1.5, -1.5, 0.02), (1.5, 1.5, 0.9))
    stage.light("SUN", energy=3.0, angle=0.6)
    stage.scene.cycles.caustics_refractive = True
    stage.camera((0, -3, 0.5), (np.pi / 2, 0, 0), angle=0.25)
    own, cycles = (
        stage.written(engine, samples, size=(16, 16), bounces=1)["Volume Indirect"][2:14, 2:14, :3].mean()
        for engine, samples in (("CANDELA", 8), ("CYCLES", 4096))
    )
    print(f"{own:.5f} beside {cycles:.5f}")
    assert own == pytest.approx(cycles, rel=0.05)


@pytest.mark.slow
def test_beams_do_not_shine_through_the_mirror_that_they_start_on(stage):
    """Seen from behind the mirror, whose front a lamp lights: their kernel is as wide as a tenth of the picture."""
    stage.rectangle((-1, -1), (1, 1), material=stage.material("ShaderNodeBsdfGlossy", Roughness=0.0))
    stage.light("POINT", (0, 0, 1.0), energy=300, shadow_soft_size=0.0)
    box(stage, volume(stage, Density=0.2), (-2, -2, -2), (2, 2, 2))
    beams_alone(stage)
    stage.scene.candela.volume_caustics_rays = 32
    seen = []
    for height, turn in ((5.0, 0.0), (-5.0, np.pi)):
        stage.camera((0, 0, height), (0, turn, 0), angle=0.3)
        seen.append(stage.render(2, size=(24, 24), bounces=1)["volume_indirect"][..., 0].mean())
    assert seen[0] > 0
    print(f"{seen[1] / seen[0]:.5f} of the light before it")
    assert seen[1] < 5e-3 * seen[0]


@pytest.mark.slow
def test_beams_through_an_absorbing_slab_dim_by_beer_and_lambert(stage):
    """.5 m of glass that takes 1 per metre of red, 2 of green and no blue, over fog under a sun."""
    glass = stage.material("ShaderNodeBsdfGlass", IOR=1.5, Roughness=0.0)
    fill(glass.node_tree, "ShaderNodeVolumeAbsorption", Color=(0.5, 0.0, 1.0, 1.0), Density=2.0)
    box(stage, glass, (-1.5, -1.5, 0.5), (1.5, 1.5, 1.0))
    box(stage, volume(stage, Density=0.1), (-0.5, -0.5, -1.0), (0.5, 0.5, 0.4))
    stage.light("SUN", energy=3.0, angle=0.0)
    beams_alone(stage)
    stage.scene.candela.volume_caustics_rays = 64
    stage.camera((0, -4, -0.3), (np.pi / 2, 0, 0), angle=0.2)
    seen = stage.render(2, size=(16, 16), bounces=1)["volume_indirect"][..., :3].mean((0, 1))
    np.testing.assert_allclose(seen / seen[2], np.exp(-0.5 * np.array([1.0, 2.0, 0.0])), rtol=0.01)


def indirect_light_of_beams(stage, pixels=24, samples=2):
    beams_alone(stage)
    stage.scene.candela.volume_caustics_rays = 32
    return stage.render(samples, size=(pixels, pixels), bounces=1)["volume_indirect"][..., :3]


def test_a_sun_sends_no_beams_into_fog_without_an_end(stage):
    stage.camera((0, -5, 0), (np.pi / 2, 0, 0))
    stage.light("SUN", energy=3.0)
    fog(stage, Density=0.01)
    ball(stage, 0.5, 1.5)
    assert not indirect_light_of_beams(stage).any()


@pytest.mark.slow
def test_fog_far_upstream_dims_the_beams_of_a_sun(stage):
    """A slab of optical depth 1, farther away than the scene is large."""
    stage.camera((0, -5, 0), (np.pi / 2, 0, 0))
    stage.light("SUN", energy=3.0, angle=0.0)
    ball(stage, 0.5, 1.5)
    box(stage, volume(stage, Density=0.1), (-1, -1, -1), (1, 1, 1))
    clear = indirect_light_of_beams(stage).mean()
    slab = volume(stage, "ShaderNodeVolumeAbsorption", Color=(0, 0, 0, 1), Density=1.0)
    box(stage, slab, (-2, -2, 50), (2, 2, 51))
    assert indirect_light_of_beams(stage).mean() == pytest.approx(clear * np.exp(-1.0), rel=0.02)


def test_lamps_of_opposite_power_send_beams_that_cancel(stage):
    lens_scene(stage, 1.5)
    one = next(lamp for lamp in stage.scene.objects if lamp.type == "LIGHT")
    single = indirect_light_of_beams(stage)
    stage.light("POINT", one.location, energy=-one.data.energy, shadow_soft_size=0.0)
    assert np.abs(indirect_light_of_beams(stage)).max() < 1e-4 * single.max()


@pytest.mark.slow
def test_many_lamps_take_turns(stage):
    """Twelve at one place are one of their power."""
    lens_scene(stage, 1.5)
    one = next(lamp for lamp in stage.scene.objects if lamp.type == "LIGHT")
    single = indirect_light_of_beams(stage)
    one.data.energy /= 12
    for _ in range(11):
        stage.light("POINT", one.location, energy=one.data.energy, shadow_soft_size=0.0)
    assert indirect_light_of_beams(stage).mean() == pytest.approx(single.mean(), rel=1e-3)
