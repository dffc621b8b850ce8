"""Irradiance under every kind of light against its formula, and the laws that any direct light obeys."""

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix

from addon import engine
from addon.sources.rates import Rate
from addon.techniques import direct_light
from tests.techniques import light_model as model
from tests.techniques.conftest import places

SIZE, SPAN = (32, 32), 4.0
SLOW = pytest.mark.slow
TOLERANCE = 0.005  # of the formula, as issue and docs promise


def receivers(stride=1):
    x, y = (a[::stride, ::stride].ravel() for a in places(SIZE, SPAN))
    return np.column_stack([x, y, np.zeros_like(x)])


def irradiance(stage, samples=64, **options):
    """The picture of a white Lambertian floor, as irradiance in W/m2: radiance is E / pi."""
    return stage.render(samples, SIZE, **options)["diffuse_direct"][..., 0] * np.pi


def check(found, source, floor=0.0, stride=4, **options):
    """`floor`: where the formula gives less than this share of its maximum, errors count against that instead."""
    found = found[::stride, ::stride].ravel()
    expected = model.irradiance(source, receivers(stride), **options)
    scale = np.maximum(expected, floor * expected.max())
    assert expected.max() > 0
    assert np.abs(found / scale - expected / scale).max() < TOLERANCE


@pytest.fixture
def floor(stage):
    stage.floor()
    stage.camera_above(SPAN)
    return stage


# Points and spots ----------------------------------------------------------------------------------------------------


def test_a_point_light_gives_intensity_over_distance_squared(floor):
    floor.light("POINT", (0.5, -0.3, 2.0), shadow_soft_size=0)
    check(irradiance(floor, samples=1), model.point((0.5, -0.3, 2.0), 100), stride=1)


@pytest.mark.parametrize("radius", [pytest.param(0.05, marks=SLOW), 0.5])
def test_a_soft_point_light_is_a_disc_that_faces_the_receiver(floor, radius):
    floor.light("POINT", (0.5, -0.3, 2.0), shadow_soft_size=radius)
    check(irradiance(floor, samples=256), model.soft_point((0.5, -0.3, 2.0), radius, 100))


@pytest.mark.parametrize("radius", [pytest.param(0.05, marks=SLOW), 0.5])
def test_a_spherical_light_gives_what_a_point_gives(floor, radius):
    """While the whole sphere stands above the horizon: pi L (r/d)^2 cos = S cos / (4 pi d^2)."""
    floor.light("POINT", (0.5, -0.3, 2.0), shadow_soft_size=radius, use_soft_falloff=False)
    check(irradiance(floor, samples=256), model.point((0.5, -0.3, 2.0), 100), stride=1)


SPOTS = {
    "hard": (np.radians(60), 0.0, (0, 0, 0), (1, 1, 1)),
    "blend": (np.radians(60), 0.5, (0, 0, 0), (1, 1, 1)),
    "all blend": (np.radians(80), 1.0, (0, 0, 0), (1, 1, 1)),
    "turned": (np.radians(70), 0.3, (0.4, -0.2, 0.3), (1, 1, 1)),
    "elliptic": (np.radians(50), 0.4, (0.1, 0, 0.5), (1.8, 0.7, 1.2)),
    "wide": (np.radians(170), 0.2, (0, 0, 0), (1, 1, 1)),
}


@pytest.mark.parametrize("cone", SPOTS.values(), ids=SPOTS)
def test_a_spot_light_is_a_point_light_within_its_cone(floor, cone):
    angle, blend, turn, scale = cone
    floor.light("SPOT", (0.2, 0.1, 2), turn, scale, shadow_soft_size=0, spot_size=angle, spot_blend=blend)
    matrix = np.array(Euler(turn).to_matrix()) * scale
    source = model.spot(model.point((0.2, 0.1, 2), 100), matrix, angle, blend)
    check(irradiance(floor, samples=1), source, floor=0.05, stride=1)


@SLOW
@pytest.mark.parametrize("samples", [1, 16])
def test_within_the_ball_of_a_spot_its_cone_does_not_count(stage, samples):
    """As in Cycles: the ball shines on what stands in it from all around, beside its cone, too.

    Cycles has half of that where the middle of the ball lies behind the surface, of points all of it."""
    stage.floor()
    stage.camera_above(span=0.1)
    stage.light("SPOT", (0, 0, 0.3), (np.pi, 0, 0), spot_size=0.8, shadow_soft_size=0.5, use_soft_falloff=False)
    own, cycles = stage.render(samples, (8, 8)), stage.render(64, (8, 8), engine="CYCLES")
    assert cycles["diffuse_direct"].mean() > 1.0
    assert own["diffuse_direct"].mean() == pytest.approx(cycles["diffuse_direct"].mean(), rel=0.02)


def test_the_cone_of_a_soft_spot_light_applies_to_each_ray(floor):
    floor.light("SPOT", (0, 0, 2), shadow_soft_size=0.4, spot_size=np.radians(60), spot_blend=0.6)
    source = model.spot(model.soft_point((0, 0, 2), 0.4, 100), np.eye(3), np.radians(60), 0.6)
    found, expected = irradiance(floor, samples=256)[::4, ::4].ravel(), model.irradiance(source, receivers(4))
    assert found.mean() == pytest.approx(expected.mean(), rel=TOLERANCE)
    assert np.sqrt(((found - expected) ** 2).mean()) < 0.01 * expected.max()


@pytest.mark.parametrize("spread", [0.0, np.radians(0.1), np.radians(4)])
def test_an_area_light_of_little_spread_lights_what_lies_before_it_evenly(floor, spread):
    """Power over area, and nothing beside; below one degree as at one, as in Cycles. A board leaves its own shadow."""
    floor.blocker((0.0, -2), (0.4, 2), 0.5)
    floor.light("AREA", (0, 0, 2), size=2.0, spread=spread, energy=12.0)
    found = irradiance(floor, samples=4)
    x, y = places(SIZE, SPAN)
    before = (np.abs(y) < 0.8) & (x > -0.8) & (x < -0.2)
    beside, behind = np.abs(y) > 1.2, (np.abs(y) < 0.8) & (x > 0.1) & (x < 0.2)
    assert found[before] == pytest.approx(3.0, rel=0.01)
    assert not found[beside].any()
    assert not found[behind].any()


# Suns ----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("angle", [0.0, np.radians(0.5), np.radians(10), np.radians(60)])
def test_a_sun_gives_its_strength_times_the_cosine(floor, angle):
    """At any angle, while the whole disc stands above the horizon."""
    floor.light("SUN", turn=(0.5, 0.3, 0), angle=angle, energy=3.0)
    cosine = np.cos(0.5) * np.cos(0.3)
    found = irradiance(floor, samples=1 if angle == 0 else 64)
    assert np.abs(found / (3.0 * cosine) - 1).max() < TOLERANCE


@pytest.mark.parametrize("tilt", [0.0, np.radians(60), np.radians(85)])
def test_a_sun_of_180_degrees_is_half_a_sky(floor, tilt):
    """Radiance S / pi over a hemisphere; tilted, the part above the horizon gives pi L (1 + cos) / 2."""
    floor.light("SUN", turn=(tilt, 0, 0), angle=np.pi, energy=2.0)
    found = irradiance(floor, samples=256)
    assert np.abs(found / (2.0 * (1 + np.cos(tilt)) / 2) - 1).max() < TOLERANCE


# Areas ---------------------------------------------------------------------------------------------------------------

AREAS = {
    "square": ({"shape": "SQUARE", "size": 1.2}, (1.2, 1.2)),
    "rectangle": ({"shape": "RECTANGLE", "size": 0.4, "size_y": 2.0}, (0.4, 2.0)),
    "disk": ({"shape": "DISK", "size": 1.5}, (1.5, 1.5)),
    "ellipse": ({"shape": "ELLIPSE", "size": 2.0, "size_y": 0.6}, (2.0, 0.6)),
}


@pytest.mark.parametrize("turn", [pytest.param((0, 0, 0), marks=SLOW), (0.6, -0.3, 0.8)], ids=["level", "turned"])
@pytest.mark.parametrize("shape", AREAS.values(), ids=AREAS)
def test_an_area_light_gives_the_form_factor_of_its_shape(floor, shape, turn):
    settings, (width, height) = shape
    floor.light("AREA", (0.3, -0.2, 2.0), turn, **settings)
    axes = np.array(Euler(turn).to_matrix())
    source = model.area(
        (0.3, -0.2, 2.0), axes[:, 0] * width, axes[:, 1] * height, 100,
        settings["shape"] in ("DISK", "ELLIPSE"), -axes[:, 2],
    )  # fmt: skip
    check(irradiance(floor, samples=256), source, floor=0.05)


def test_the_scale_of_an_area_light_scales_its_shape_and_not_its_power(floor):
    floor.light("AREA", (0, 0, 2), scale=(2.0, 0.5, 3.0), shape="SQUARE", size=1.0)
    check(irradiance(floor), model.area((0, 0, 2), (2, 0, 0), (0, 0.5, 0), 100))


@pytest.mark.parametrize("spread", [pytest.param(np.radians(170), marks=SLOW), np.radians(40)])
def test_a_spread_narrows_an_area_light_and_keeps_its_flux(floor, spread):
    floor.light("AREA", (0, 0, 2), shape="SQUARE", size=0.8, spread=spread)
    check(
        irradiance(floor, samples=256), model.area((0, 0, 2), (0.8, 0, 0), (0, 0.8, 0), 100, spread=spread), floor=0.3
    )


def test_the_form_factor_of_parallel_unit_squares_is_the_textbooks(floor):
    """Two unit squares one metre apart exchange F = 0.1998 of a Lambertian's light (Howell C-11)."""
    floor.light("AREA", (0, 0, 1), shape="SQUARE", size=1.0, energy=1.0)
    x, y = places(SIZE, SPAN)
    received = irradiance(floor)[(np.abs(x) < 0.5) & (np.abs(y) < 0.5)].mean()
    assert received == pytest.approx(0.19982, rel=TOLERANCE)


# What artists may switch ---------------------------------------------------------------------------------------------

NOT_NORMALIZED = {
    "point": ("POINT", {"shadow_soft_size": 0.0}, 4.0),
    "soft point": ("POINT", {"shadow_soft_size": 0.5}, 4 * np.pi * 0.25),
    "square": ("AREA", {"size": 0.7}, 0.49),
    "sun": ("SUN", {"angle": 0.4}, np.pi * np.sin(0.2) ** 2),
}


@pytest.mark.parametrize("kind", NOT_NORMALIZED.values(), ids=NOT_NORMALIZED)
def test_without_normalize_strength_is_radiance_and_grows_with_the_area(floor, kind):
    light_kind, settings, factor = kind
    light = floor.light(light_kind, **settings)
    if not hasattr(light.data, "normalize"):
        pytest.skip("this Blender always normalizes")
    normalized = irradiance(floor, samples=4)
    light.data.normalize = False
    np.testing.assert_allclose(irradiance(floor, samples=4), normalized * factor, rtol=1e-4)


@pytest.mark.parametrize("exposure", [-3.0, 2.0])
def test_exposure_counts_in_powers_of_two(floor, exposure):
    light = floor.light("POINT", shadow_soft_size=0)
    if not hasattr(light.data, "exposure"):
        pytest.skip("this Blender's lights have no exposure")
    plain = irradiance(floor, samples=1)
    light.data.exposure = exposure
    np.testing.assert_allclose(irradiance(floor, samples=1), plain * 2**exposure, rtol=1e-5)


def test_temperature_tints_the_light_with_its_own_colour(floor):
    light = floor.light("POINT", shadow_soft_size=0)
    if not hasattr(light.data, "use_temperature"):
        pytest.skip("this Blender's lights have no temperature")
    plain = floor.render(1)["diffuse_direct"]
    light.data.use_temperature, light.data.temperature = True, 3000.0
    tint = np.array(light.data.temperature_color[:3])
    assert tint[0] > tint[2]
    np.testing.assert_allclose(floor.render(1)["diffuse_direct"], plain * tint, rtol=1e-4)


# Laws ----------------------------------------------------------------------------------------------------------------

KINDS = {
    "point": ("POINT", {"shadow_soft_size": 0.3}),
    "spot": ("SPOT", {"shadow_soft_size": 0.3, "spot_size": 1.2, "spot_blend": 0.5}),
    "sun": ("SUN", {"angle": 0.3}),
    "area": ("AREA", {"size": 1.0}),
}


def furnished(stage):
    """A floor with a box above it and a glossy patch: shadow, diffuse and glossy light."""
    stage.floor(material=stage.principled(Base_Color=(0.8, 0.5, 0.3, 1), Roughness=0.6))
    stage.camera_above(SPAN)
    for low, high, z in [((-0.5, -0.5), (0.5, 0.5), 0.5), ((0.8, -1), (1.2, 1), 0.2)]:
        stage.rectangle(low, high, z, material=stage.diffuse(0.5))
    return stage


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_k_times_the_power_is_k_times_the_picture(stage, kind):
    light = furnished(stage).light(kind[0], (0.5, 0.7, 2), **kind[1])
    before = stage.render(4)["combined"][..., :3]
    light.data.energy *= 8.0
    np.testing.assert_array_equal(stage.render(4)["combined"][..., :3], before * 8.0)


@SLOW
@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_two_lights_of_half_the_power_are_one(stage, kind):
    light = furnished(stage).light(kind[0], (0.5, 0.7, 2), **kind[1])
    one = stage.render(64)["combined"][..., :3]
    light.data.energy /= 2
    stage.light(kind[0], (0.5, 0.7, 2), **kind[1]).data.energy = light.data.energy
    two = stage.render(64)["combined"][..., :3]
    assert two.mean() == pytest.approx(one.mean(), rel=TOLERANCE)
    assert np.sqrt(((two - one) ** 2).mean()) < 0.02 * one.mean()


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_a_light_behind_the_surface_gives_nothing(floor, kind):
    floor.light(kind[0], (0.3, 0, -2), (np.pi, 0, 0), **kind[1])
    assert not floor.render(16)["combined"][..., :3].any()


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_nothing_leaks_through_a_wall_with_another_behind_it(floor, kind):
    """Two stacked blockers: what filters depths instead of comparing them lets light through the lower one."""
    floor.light(kind[0], (0.1, 0.2, 2), **kind[1])
    floor.blocker((-9, -9), (9, 9), 1.0)
    floor.blocker((-9, -9), (9, 9), 0.05)
    assert not floor.render(16)["combined"][..., :3].any()


@SLOW
@pytest.mark.parametrize("move", ["far away", "a quarter turn"])
def test_a_scene_that_is_moved_with_its_camera_gives_the_same_picture(stage, move):
    furnished(stage)
    stage.light("AREA", (0.5, 0.7, 2), (0.3, 0.2, 0), size=0.6)
    stage.light("POINT", (-1, 0.4, 1.5), shadow_soft_size=0.1)
    stage.light("SPOT", (0.2, -1, 2), (-0.4, 0, 0), shadow_soft_size=0.05, spot_size=1.0, spot_blend=0.3)
    stage.light("SUN", turn=(0.5, 0.4, 0), angle=0.1, energy=0.5)
    before = stage.render(64)["combined"][..., :3]
    shift, turn = Matrix.Translation((1e3, -2e3, 3e3)), Matrix.Rotation(np.pi / 2, 4, "X")
    bpy.context.view_layer.update()
    for thing in stage.scene.objects:
        thing.matrix_world = (shift if move == "far away" else turn) @ thing.matrix_world
    after = stage.render(64)["combined"][..., :3]
    assert after.mean() == pytest.approx(before.mean(), rel=3e-3)
    assert np.sqrt(((after - before) ** 2).mean()) < 0.03 * before.mean()


def test_the_same_scene_gives_the_same_picture_after_everything_was_freed(stage):
    furnished(stage)
    stage.world((0.2, 0.4, 0.8))
    for kind, settings in KINDS.values():
        stage.light(kind, (0.5, 0.7, 2), **settings)
    stage.blocker((-1.5, -1.5), (-0.5, 1.5), 1.0, material=stage.see_through(0.5))
    first = stage.render(4)
    engine.free_sessions()
    second = stage.render(4)
    assert first.keys() == second.keys()
    for name, pixels in first.items():
        np.testing.assert_array_equal(second[name], pixels, err_msg=name)


@SLOW
def test_another_seed_gives_other_noise_with_the_same_mean(stage):
    furnished(stage)
    stage.light("AREA", (0.5, 0.7, 2), size=1.5)
    a, b = (stage.render(64, seed=seed)["combined"][..., :3] for seed in (0, 1))
    assert (a != b).any()
    assert a.mean() == pytest.approx(b.mean(), rel=2e-3)


def test_the_same_file_opened_twice_gives_the_same_picture(stage, tmp_path):
    furnished(stage)
    stage.light("AREA", (0.5, 0.7, 2), size=1.5)
    path = str(tmp_path / "scene.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    pictures = []
    for _ in range(2):
        bpy.ops.wm.open_mainfile(filepath=path)
        stage.scene = bpy.context.scene
        pictures.append(stage.render(2)["combined"])
    np.testing.assert_array_equal(pictures[0], pictures[1])


def test_objects_in_another_order_give_the_same_picture(stage):
    pictures = []
    for order in (1, -1):
        stage.clear()
        stage.floor()
        stage.camera_above(SPAN)
        stage.light("POINT", shadow_soft_size=0)
        for x in (-1, 0, 1)[::order]:
            stage.rectangle((x - 0.3, -0.3), (x + 0.3, 0.3), 0.5)
        pictures.append(stage.render(1)["combined"])
    np.testing.assert_array_equal(pictures[0], pictures[1])


@SLOW
def test_of_many_lights_a_few_per_sample_give_the_sum_of_all(floor):
    """Drawn at random, each weighted by the inverse of its chance."""
    places_of_lights = [(x, y, 1.5) for x in np.linspace(-2, 2, 8) for y in np.linspace(-2, 2, 8)]
    for place in places_of_lights:
        floor.light("POINT", place, shadow_soft_size=0, energy=10 + 5 * place[0], use_shadow=False)
    expected = sum(model.irradiance(model.point(p, 10 + 5 * p[0]), receivers()) for p in places_of_lights if p[0] > -2)
    found = irradiance(floor, samples=256).ravel()
    assert found.mean() == pytest.approx(expected.mean(), rel=TOLERANCE)
    assert np.sqrt(np.mean((found / expected - 1) ** 2)) < 0.02


def test_a_small_lamp_far_away_is_seen_as_round_as_a_near_one(stage):
    """Its share of the picture is the cone's that it fills; at this distance the difference of squares cancels."""
    radius, away = 0.05, 300.0
    lamp = stage.light("POINT", (0, 0, -away), shadow_soft_size=radius, use_soft_falloff=False)
    lamp.visible_camera = True
    camera = stage.camera((0, 0, 0), (0, 0, 0), angle=8 * radius / away)
    camera.data.clip_end = 1e4
    seen = stage.render(64, (32, 32))["emission"][..., 0]
    lamp.location.z, camera.data.angle = -away / 100, 8 * radius / (away / 100)
    lamp.data.energy, lamp.data.shadow_soft_size = lamp.data.energy, radius
    near = stage.render(64, (32, 32))["emission"][..., 0]
    np.testing.assert_allclose(seen.sum(), near.sum(), rtol=0.02)


def test_an_area_light_that_faces_away_gives_nothing(floor):
    floor.light("AREA", (0, 0, 2), (np.pi, 0, 0), size=0.5)
    assert floor.render(2)["diffuse_direct"].max() == 0


def test_a_floor_close_to_an_area_light_has_its_light_once(stage, monkeypatch):
    """Points that all pixels share shine as from no nearer than their spacing."""
    stage.scene.candela.slot_shadow = "accumulated_maps"
    height, half = 0.05, 1.0
    stage.floor(material=stage.diffuse(0.5))
    stage.light("AREA", (0, 0, height), energy=100.0, size=2 * half)
    stage.camera_above(1.6)
    y = (np.arange(200) + 0.5) / 100 - 1.0
    x = places((16, 16), 1.6)[0][0]
    radiance = 100.0 / (np.pi * (2 * half) ** 2)
    squared = (x[:, None, None, None] - y[None, None, :, None]) ** 2 + (x[None, :, None, None] - y) ** 2 + height**2
    expected = 0.5 / np.pi * radiance * (height**2 / squared**2).sum(axis=(2, 3)).mean() * (half / 100) ** 2
    found = [stage.render(1, size=(16, 16), seed=seed)["combined"][..., :3].mean() for seed in range(3)]
    assert np.mean(found) == pytest.approx(expected, rel=0.05)  # .08 without those of pixels
    # Nothing is left out where the lamp shines as a whole, whether a sample has a point of it or not.
    stage.scene.candela.slot_shadow = "vssm"
    monkeypatch.setattr(direct_light, "rate_of", lambda *_: Rate(-1))
    found = stage.render(8, size=(16, 16))["combined"][..., :3].mean()
    assert found == pytest.approx(expected, rel=0.05)
