"""A time limit ends a picture in time, with all that belongs to a picture."""

import time

import numpy as np
import pytest

from addon.frame import ledger
from tests.techniques.conftest import Stage

SIZE = (160, 120)


@pytest.fixture
def room(registered):
    stage = Stage()
    stage.floor(material=stage.diffuse(0.7))
    stage.rectangle((-2, 0), (2, 2), 0.0, location=(0, 2, 0), turn=(np.pi / 2, 0, 0), material=stage.diffuse(0.5))
    stage.light("POINT", (0.5, 0.5, 1.5), shadow_soft_size=0.3, energy=50)
    stage.camera_above(6.0)
    return stage


@pytest.mark.slow
@pytest.mark.timing
def test_a_picture_of_many_samples_ends_in_time_and_is_denoised(room):
    """5 s within 5.5, with the light of a picture that was asked for so many samples."""
    room.scene.candela.time_limit = 1e-6
    room.render(60000, SIZE, bounces=2)  # one sample: compiles what the next picture needs
    room.scene.candela.time_limit = 5.0
    started = time.perf_counter()
    limited = room.render(60000, SIZE, bounces=2, seed=3)
    seconds = time.perf_counter() - started
    found = ledger.latest()
    print(f"{seconds:.2f} s, {found.samples} samples")
    assert seconds < 5.5 and 8 < found.samples < 60000
    assert found.row("denoise").counters["passes"] > 0
    room.scene.candela.time_limit = 0.0
    whole = room.render(min(found.samples, 256), SIZE, bounces=2, seed=4)
    for name in ("combined", "diffuse_direct", "diffuse_indirect"):
        assert limited[name].mean() == pytest.approx(whole[name].mean(), rel=0.03)


@pytest.mark.slow
def test_a_limit_that_is_not_reached_changes_nothing(room):
    plain = room.render(6, (32, 24), bounces=1)
    room.scene.candela.time_limit = 1000.0
    limited = room.render(6, (32, 24), bounces=1)
    assert ledger.latest().samples == 6
    for name in ("diffuse_direct", "diffuse_color", "normal", "depth"):
        np.testing.assert_allclose(limited[name], plain[name], rtol=0.2, atol=0.02)  # other halves tell what is noise


def test_at_least_one_sample_is_drawn(room):
    room.scene.candela.time_limit = 1e-6
    images = room.render(64, (32, 24), bounces=1)
    assert ledger.latest().samples == 1
    assert images["combined"].mean() > 0
