"""What the command of flicker measures, on errors whose figures are known."""

import numpy as np
import pytest

from bench.flicker import bias_of, figures, write_film


def test_errors_that_stand_still_are_no_flicker():
    still = np.random.default_rng(1).random((1, 20, 30, 3)).repeat(10, axis=0)
    assert figures(still) == pytest.approx((0, 0, 0), abs=1e-9)


def test_a_picture_that_breathes_as_a_whole_boils_and_jitters_alike():
    wave = np.sin(np.arange(10))
    grain, boiling, jitter = figures(np.broadcast_to(wave[:, None, None, None], (10, 20, 30, 3)))
    assert grain == pytest.approx(wave.std()) and boiling == pytest.approx(wave.std())
    assert jitter == pytest.approx(np.ptp(wave))


def test_grain_of_single_pixels_is_a_fifth_after_the_blur():
    """25 independent errors have a mean whose deviation is a fifth."""
    noise = np.random.default_rng(2).standard_normal((10, 60, 80, 3))
    grain, boiling, _ = figures(noise)
    assert boiling / grain == pytest.approx(0.2, rel=0.05)


def test_bias_has_a_standard_error_where_there_are_several_seeds():
    assert bias_of([1.02]) == "1.020"
    assert bias_of([0.98, 1.0, 1.02]) == "1.000 ± 0.012"  # .02 / sqrt(3)


def test_a_film_goes_forth_and_back(tmp_path):
    image = pytest.importorskip("PIL.Image")
    frames = [np.full((4, 6, 3), k / 4) for k in range(3)]
    write_film(tmp_path / "film.gif", [frames, frames], 1.0)
    with image.open(tmp_path / "film.gif") as film:
        assert (film.n_frames, film.size) == (4, (16, 4))
