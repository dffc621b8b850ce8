"""A noise threshold ends a picture at about the error that was asked for."""

from pathlib import Path

import bpy
import numpy as np
import pytest

from addon import engine
from addon.compare.metrics import relative_squared_error, trimmed_mean
from addon.compare.reference import render_passes
from addon.film.noise import FEWEST, NoiseMeter, relative_change
from addon.frame import ledger
from tests.techniques.conftest import Stage, own_share

SAMPLE_BLENDS = Path(__file__).parents[2] / "sample_blends"
SIZE = (48, 36)


def error(found, truth):
    return float(np.sqrt(trimmed_mean(relative_squared_error(found[..., :3], truth[..., :3]))))


def means(power, seed, count=4096, size=(40, 40)):
    """Means of 1, 2, 4 … samples of a grey picture whose error falls as n^-power."""
    numbers = np.random.default_rng(seed)
    mean, out = np.zeros((*size, 3)), {}
    for k in range(int(np.log2(count)), -1, -1):  # from the end: each is the one after it and something of its own
        n = 2**k
        own = np.sqrt(n ** (-2 * power) - (2 * n) ** (-2 * power))
        mean = mean + own * numbers.normal(size=(*size, 1))
        out[n] = 1.0 + 0.2 * mean
    return dict(sorted(out.items()))


@pytest.mark.parametrize("power", [0.5, 0.75, 1.0])
@pytest.mark.parametrize("asked", [0.01, 0.03])
def test_enough_samples_are_those_at_which_the_error_is_what_was_asked(power, asked):
    meter = NoiseMeter(asked)
    for done, mean in means(power, seed=3).items():
        if done >= FEWEST and (meter.enough is None or done < meter.enough):
            meter.learn(done, mean)
    wanted = (0.2 / asked) ** (1.0 / power)  # where 0.2 n^-power is what was asked
    if wanted > 2 * FEWEST:
        assert 1.0 / 1.5 < (meter.enough / wanted) ** -power < 1.5
    assert meter.enough >= FEWEST


def test_a_black_picture_has_no_noise():
    assert relative_change(np.zeros((8, 8, 3)), np.zeros((8, 8, 3))) == 0.0


def test_the_noise_of_a_single_pixel_counts():
    assert relative_change(np.full((1, 1, 3), 2.0), np.ones((1, 1, 3))) == pytest.approx(0.5, rel=0.01)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("where", ["now", "before", "both"])
def test_a_value_that_is_not_finite_does_not_hide_the_noise_of_the_others(bad, where):
    numbers = np.random.default_rng(1)
    now, before = (1.0 + 0.2 * numbers.normal(size=(64, 64, 1)) * np.ones(3) for _ in range(2))
    clean = relative_change(now, before)
    for picture in {"now": [now], "before": [before], "both": [now, before]}[where]:
        picture[5, 5, 0] = bad
    assert clean > 0.1 and relative_change(now, before) == pytest.approx(clean, rel=0.05)
    meter = NoiseMeter(0.01)
    for done, mean in ((4, before), (8, now)):
        meter.learn(done, mean)
    assert meter.enough is None


def test_a_picture_that_does_not_change_is_enough():
    meter = NoiseMeter(0.01)
    for done in (4, 8, 16):
        meter.learn(done, np.ones((8, 8, 3)))
    assert meter.enough == 8 or meter.enough == 16


SCENES = {
    "cornell_box": 0.05,
    "door_ajar": 0.25,
    "hdri_product": 0.1,
    "soft_shadow_garden": 0.1,
    "window_interior": 0.15,
}  # asked errors, each that of some ten to a hundred samples


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_five_samples_end_within_half_of_the_asked_error(registered, name):
    """The error of the samples' mean, before denoising, beside a picture of many times as many samples."""
    bpy.ops.wm.open_mainfile(filepath=str(SAMPLE_BLENDS / f"{name}.blend"))
    scene, asked = bpy.context.scene, SCENES[name]
    scene.candela.denoise_strength = 0.0
    scene.candela.noise_threshold = asked
    found = render_passes(scene, "CANDELA", 4096, 1, size=SIZE, extra=own_share(scene)).images["combined"]
    taken = ledger.latest().samples
    scene.candela.noise_threshold = 0.0
    truth = render_passes(scene, "CANDELA", min(8 * taken, 1024), 7, size=SIZE).images["combined"]
    engine.free_sessions()
    print(f"{name}: asked {asked}, error {error(found, truth):.4f} with {taken} samples")
    assert asked / 1.5 <= error(found, truth) <= asked * 1.5


@pytest.fixture
def room(registered):
    stage = Stage()
    stage.floor(material=stage.diffuse(0.7))
    stage.light("POINT", (0.5, 0.5, 1.5), shadow_soft_size=0.3, energy=50)
    stage.camera_above(6.0)
    return stage


@pytest.mark.slow
def test_a_threshold_that_is_not_reached_draws_all_samples(room):
    room.scene.candela.noise_threshold = 1e-6
    room.render(12, (32, 24), bounces=1)
    assert ledger.latest().samples == 12


@pytest.mark.slow
def test_a_picture_that_ends_early_is_whole_and_denoised(room):
    room.scene.candela.noise_threshold = 0.2
    found = room.render(256, (32, 24), bounces=1)
    taken = ledger.latest().samples
    assert FEWEST <= taken < 256
    assert ledger.latest().row("denoise").counters["passes"] > 0
    room.scene.candela.noise_threshold = 0.0
    whole = room.render(128, (32, 24), bounces=1)
    assert found["combined"].mean() == pytest.approx(whole["combined"].mean(), rel=0.03)
    assert found["combined"][..., 3].min() == pytest.approx(1.0, abs=1e-4)


def test_without_a_threshold_no_picture_is_read(room, monkeypatch):
    monkeypatch.setattr(NoiseMeter, "look", lambda *_: pytest.fail("looked"))
    room.render(8, (32, 24))
