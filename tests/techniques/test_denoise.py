"""Denoising: less error, the same light, nothing where there is no noise, and nothing of it where it is not wanted."""

from types import SimpleNamespace

import numpy as np
import pytest

from addon.compare.passes import light_paths
from addon.frame import ledger
from addon.gfx import images, passes
from addon.gfx.struct import Block
from addon.scene.view import VIEW, View
from addon.snapshot.scene import Camera, Film
from addon.techniques.denoise import LEVEL, Denoise
from tests.techniques.conftest import places

SIZE = (64, 48)


def lit_room(stage, angle=0.0):
    """A lamp over a floor and a wall whose light comes by the floor alone; `angle` of a sun, or 0 for a point."""
    stage.floor(material=stage.diffuse(0.7))
    stage.rectangle((-2, 0), (2, 2), 0.0, location=(0, 2, 0), turn=(np.pi / 2, 0, 0), material=stage.diffuse(0.5))
    stage.light("POINT", (0.5, 0.5, 1.5), shadow_soft_size=angle, energy=50)
    stage.camera_above(6.0)


def row():
    return next(row for row in ledger.latest().rows if row.name == "denoise")


def paths_of(stage, strength, samples, bounces, seed=1):
    stage.scene.candela.denoise_strength = strength
    return light_paths(stage.render(samples, SIZE, bounces=bounces, seed=seed))


@pytest.mark.slow
def test_indirect_light_has_half_the_error_and_the_same_mean(stage):
    lit_room(stage)
    truth = paths_of(stage, 0.0, 192, 2, seed=2)["diffuse_indirect"]
    errors = []
    for strength in (0.0, 1.0):
        found = paths_of(stage, strength, 16, 2)["diffuse_indirect"]
        errors.append(np.mean((found - truth) ** 2))
        assert found.mean() == pytest.approx(truth.mean(), rel=0.03)
    assert errors[1] < 0.5 * errors[0]


@pytest.mark.slow
def test_columns_a_few_pixels_wide_lose_their_noise_too(stage):
    """Normals turn by some 20 degrees from pixel to pixel, light hardly."""
    lit_room(stage)
    turn = np.linspace(0, 2 * np.pi, 25)[:-1]
    sides = [(k, (k + 1) % 24, 24 + (k + 1) % 24, 24 + k) for k in range(24)]
    for x in (-1.5, -0.8, 0.8, 1.5):  # they lie on the floor, so that the camera above sees their sides
        ends = [(x + 0.25 * np.cos(t), y, 0.4 + 0.25 * np.sin(t)) for y in (-2, 2) for t in turn]
        stage.mesh(ends, sides, material=stage.diffuse(0.5))
    plain, denoised = (
        [paths_of(stage, strength, 8, 2, seed)["diffuse_indirect"] for seed in range(3)] for strength in (0.0, 1.0)
    )
    middle = plain[0].shape[1] / 2
    columns = [int(middle + x * plain[0].shape[1] / 6.0) for x in (-1.5, -0.8, 0.8, 1.5)]
    shown = np.s_[12:36, [c + k for c in columns for k in (-1, 0, 1)]]
    noise = [np.var([image[shown] for image in images], axis=0).mean() for images in (plain, denoised)]
    assert noise[1] < 0.3 * noise[0]


def test_what_both_halves_agree_on_is_left_as_it_is(stage):
    """A point without size: every sample has the same light, apart from edges."""
    lit_room(stage)
    plain, denoised = (paths_of(stage, strength, 8, 0)["diffuse_direct"] for strength in (0.0, 1.0))
    floor = np.s_[4:20, 4:-4]
    np.testing.assert_allclose(denoised[floor], plain[floor], rtol=2e-3)


@pytest.mark.slow
def test_the_picture_is_the_sum_of_its_passes(stage):
    lit_room(stage, 0.3)
    stage.scene.candela.denoise_strength = 1.0
    images = stage.render(8, SIZE, bounces=2)
    paths = light_paths(images)
    names = ("diffuse_direct", "diffuse_indirect", "glossy_direct", "glossy_indirect", "emission", "environment")
    total = sum(paths[name] for name in names if name in paths)
    np.testing.assert_allclose(images["combined"][..., :3], total, rtol=1e-3, atol=1e-5)


@pytest.mark.parametrize(("strength", "samples", "reason"), [(0.0, 8, "strength"), (1.0, 1, "fewer than 2")])
def test_it_is_left_out_with_a_reason(stage, strength, samples, reason):
    lit_room(stage)
    paths_of(stage, strength, samples, 0)
    assert row().state == "skipped" and reason in row().reason


def test_light_paths_that_nothing_writes_are_not_filtered(stage):
    lit_room(stage)
    paths_of(stage, 1.0, 4, 0)
    assert row().counters == {"passes": 5}


@pytest.mark.slow
@pytest.mark.parametrize(("gloss", "passes"), [(False, 12), (True, 23)])
def test_glossy_indirect_light_is_filtered_where_something_is_glossy(stage, gloss, passes):
    stage.floor(material=stage.principled(Roughness=0.3) if gloss else stage.diffuse(0.7))
    stage.rectangle((-2, 0), (2, 2), location=(0, 2, 0), turn=(np.pi / 2, 0, 0), material=stage.diffuse(0.5))
    stage.light("POINT", (0.5, 0.5, 1.5), energy=50)
    stage.camera_above(6.0)
    paths_of(stage, 1.0, 4, 2)
    assert row().counters == {"passes": passes}


@pytest.mark.slow
def test_fireflies_of_glossy_indirect_light_are_spread_and_none_of_it_is_lost(stage):
    """A lamp's highlight on a metal ball, as a rough metal floor shows it: some samples have much, most have none."""
    metal = stage.material("ShaderNodeBsdfGlossy", Roughness=0.35)
    stage.floor(material=metal)
    turn = np.linspace(0, 2 * np.pi, 33)[:-1]
    rings = [
        [(np.cos(t) * np.sin(h), np.sin(t) * np.sin(h), 1 + np.cos(h)) for t in turn]
        for h in np.linspace(0.05, 3.09, 17)
    ]
    faces = [
        (32 * k + j, 32 * k + (j + 1) % 32, 32 * (k + 1) + (j + 1) % 32, 32 * (k + 1) + j)
        for k in range(16)
        for j in range(32)
    ]
    ball = stage.mesh(
        [p for ring in rings for p in ring], faces, material=stage.material("ShaderNodeBsdfGlossy", Roughness=0.15)
    )
    ball.visible_camera = False
    stage.light("POINT", (2.5, 0.5, 1.5), energy=50, shadow_soft_size=0.05)
    stage.camera_above(6.0)
    truth = paths_of(stage, 0.0, 192, 2, seed=2)["glossy_indirect"]
    plain, filtered = (paths_of(stage, strength, 16, 2)["glossy_indirect"] for strength in (0.0, 1.0))
    assert filtered.mean() == pytest.approx(plain.mean(), rel=0.01)
    assert np.mean((filtered - truth) ** 2) < 0.6 * np.mean((plain - truth) ** 2)


@pytest.mark.slow
def test_what_glass_shows_is_filtered_and_none_of_it_is_lost(stage):
    """A rough pane before a wall that a lamp lights: grain of the lobe goes, light stays."""
    lit_room(stage, 0.1)
    stage.rectangle((-2, -2), (2, 2), 1.0, material=stage.material("ShaderNodeBsdfGlass", Roughness=0.3, IOR=1.3))
    results = [stage_light(stage, strength) for strength in (0.0, 1.0)]
    plain, filtered = results
    assert filtered.mean() == pytest.approx(plain.mean(), rel=0.02)
    inner = np.s_[8:-8, 12:-12]
    assert rough(filtered[inner]) < 0.9 * rough(plain[inner])


def stage_light(stage, strength):
    """Light through glass, (H, W)."""
    stage.scene.candela.denoise_strength = strength
    images = stage.render(4, SIZE, bounces=2)
    light = images["transmission_direct"] + images["transmission_indirect"]
    return (light * images["transmission_color"])[..., :3].mean(axis=-1)


def rough(image):
    """Mean square of what pixels differ by from the next."""
    return np.mean(np.diff(image, axis=0) ** 2) + np.mean(np.diff(image, axis=1) ** 2)


@pytest.mark.slow
def test_the_edge_of_a_penumbra_stays_where_it_is(stage):
    """Pixels exchange what may be noise. Light that differs by more is shade: the mean over seeds keeps its slope."""
    lit_room(stage, 0.4)
    stage.blocker((-0.5, -0.5), (0.5, 0.5), 0.4)
    truth = paths_of(stage, 0.0, 256, 0, seed=9)["diffuse_direct"][..., 0]
    denoised = np.mean([paths_of(stage, 1.0, 16, 0, seed)["diffuse_direct"][..., 0] for seed in range(4)], axis=0)
    slope = np.abs(np.diff(truth, axis=1))
    steep = slope > np.quantile(slope, 0.97)
    kept = np.abs(np.diff(denoised, axis=1))[steep].mean() / slope[steep].mean()
    assert 0.9 < kept < 1.1, kept


@pytest.mark.parametrize("apart", ["turned", "behind"])
def test_noise_goes_from_pixel_to_pixel_of_one_surface_alone(gpu_context, apart):
    """One level on two halves of a picture, 1 and 2 with much variance: all may mix, and do so within a half."""
    size = width, height = 32, 16
    rows, columns = np.mgrid[0:height, 0:width].astype(np.float32)
    right = columns >= width / 2
    position = np.stack([(columns - 16) / 16, (rows - 8) / 16, np.zeros_like(rows) - 4, np.ones_like(rows)], axis=-1)
    normal = np.zeros((height, width, 4), np.float32) + np.float32([0, 0, 1, 1])
    if apart == "turned":
        normal[right] = (1, 0, 0, 1)
    else:
        position[right, 2] -= 3
    light = np.where(right, 2.0, 1.0)[..., None] + 0.5 * ((rows + columns) % 2)[..., None] * np.ones(4)
    light[..., 3] = 4.0
    frame = (-0.25, 0.25, -0.125, 0.125)
    view = View(Camera(np.eye(4), "PERSPECTIVE", frame, 0.1, 100.0), Film(*size, (0, 0, *size)), np.zeros(3))
    block = Block(VIEW, **view.values(0, 0, (0.0, 0.0), 10.0))
    pixels = {"surface_position": position, "normal_sum": normal, "light_in": light}
    with images.borrowed(*size, "RGBA32F") as target:
        passes.fullscreen(
            LEVEL, target, blocks={"film_view": block},
            textures={name: images.upload(np.ascontiguousarray(p, np.float32)) for name, p in pixels.items()},
            constants={"stride": 1, "tolerance": 3.0, "sharpness": 32.0},
        )  # fmt: skip
        out = images.read(target.colors[0])[..., 0]
    for half, mean in ((out[:, :16], 1.25), (out[:, 16:], 2.25)):
        assert half.mean() == pytest.approx(mean, abs=0.01)
        assert np.abs(half[4:-4, 4:-4] - mean).max() < 0.1


@pytest.mark.parametrize("count", range(2, 34))
def test_of_an_unknown_number_of_samples_about_half_are_kept(count):
    """From a third to two thirds of them, and never all."""
    frame = SimpleNamespace(settings=SimpleNamespace(may_end_early=True), first_part=None)
    half, name = Denoise()._half(frame, "diffuse_direct", count)
    kept = [1 << k for k in range(8) if 1 << k <= count][-2:]
    assert half == kept[-1 if name.endswith("_half") else -2]
    assert count / 3 <= half <= 2 * count / 3 + 1e-9 or count == 2


@pytest.mark.slow
def test_dark_surroundings_of_a_bright_rim_stay_dark(stage):
    """A lamp of .4 m, 4 cm above the floor: light falls by a thousand within some pixels, and so does its noise."""
    stage.floor()
    glow = stage.material("ShaderNodeEmission", Strength=10.0)
    lamp = stage.rectangle((-0.2, -0.2), (0.2, 0.2), material=glow, turn=(np.pi, 0, 0), location=(0, 0, 0.04))
    lamp.visible_camera = False
    stage.camera_above(1.6)
    stage.scene.candela.slot_indirect = "OFF"

    def picture(samples, strength):
        stage.scene.candela.denoise_strength = strength
        return stage.render(samples, (64, 64))["combined"][..., 0].astype(float)

    truth = picture(1024, 0.0)
    x, y = places((64, 64), 1.6)
    dark = (np.maximum(np.abs(x), np.abs(y)) > 0.3) & (np.maximum(np.abs(x), np.abs(y)) < 0.5)
    denoised = picture(64, 1.0)
    assert denoised[dark].mean() == pytest.approx(truth[dark].mean(), rel=0.2)
    near = np.maximum(np.abs(x), np.abs(y)) < 0.15
    noise = [np.square(one - truth)[near].mean() for one in (denoised, picture(64, 0.0))]
    assert noise[0] < 0.5 * noise[1] and noise[0] < 0.01  # 0.036 and 0.12 before pixels had points of their own here


def test_the_variance_of_a_level_is_that_of_a_weighted_mean(gpu_context):
    """Of an even picture all 5x5 weights are the binomial ones, so that sigma^2 falls by the sum of their squares."""
    size = width, height = 32, 16
    rows, columns = np.mgrid[0:height, 0:width].astype(np.float32)
    position = np.stack([(columns - 16) / 16, (rows - 8) / 16, np.zeros_like(rows) - 4, np.ones_like(rows)], axis=-1)
    normal, light = (np.zeros((height, width, 4), np.float32) + np.float32(one) for one in ((0, 0, 1, 1), (1, 1, 1, 4)))
    view = View(Camera(np.eye(4), "PERSPECTIVE", (-0.25, 0.25, -0.125, 0.125), 0.1, 100.0), Film(*size, (0, 0, *size)),
                np.zeros(3))  # fmt: skip
    with images.borrowed(*size, "RGBA32F") as target:
        passes.fullscreen(
            LEVEL, target, blocks={"film_view": Block(VIEW, **view.values(0, 0, (0.0, 0.0), 10.0))},
            textures={name: images.upload(np.ascontiguousarray(p, np.float32)) for name, p in
                      {"surface_position": position, "normal_sum": normal, "light_in": light}.items()},
            constants={"stride": 1, "tolerance": 3.0, "sharpness": 32.0},
        )  # fmt: skip
        out = images.read(target.colors[0])[4:-4, 4:-4]
    np.testing.assert_allclose(out[..., 0], 1.0, rtol=1e-6)
    np.testing.assert_allclose(out[..., 3], 4.0 * (np.square([1, 4, 6, 4, 1]).sum() / 256) ** 2, rtol=1e-4)
