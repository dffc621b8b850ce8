"""Bands: they cover a picture once, and their size follows the time they take."""

import pytest

from addon.frame.bands import FIRST, Bands


def drawn(bands, height, seconds_per_row, wanted=0.02, name="gather"):
    """The bands of one pass, each drawn in the time of its rows."""
    found = []
    for first, last in bands.split(name, height):
        found.append((first, last))
        bands.learn((last - first) * seconds_per_row, wanted)
    return found


@pytest.mark.parametrize("height", [1, 5, 16, 17, 1080])
@pytest.mark.parametrize("seconds_per_row", [0.0, 1e-6, 1e-3, 1.0])
def test_every_row_is_drawn_once(height, seconds_per_row):
    bands = Bands()
    for _ in range(3):
        rows = [row for first, last in drawn(bands, height, seconds_per_row) for row in range(first, last)]
        assert rows == list(range(height))


def test_slow_pass_is_cut_until_a_band_takes_what_it_should():
    bands = Bands()
    drawn(bands, 1080, 0.002)
    assert all(last - first == 10 for first, last in drawn(bands, 1080, 0.002))


def test_fast_pass_becomes_one_band():
    bands = Bands()
    drawn(bands, 1080, 1e-6)
    assert drawn(bands, 1080, 1e-6) == [(0, 1080)]


def test_techniques_learn_apart():
    bands = Bands()
    drawn(bands, 1080, 0.02, name="slow")
    assert next(iter(bands.split("other", 1080))) == (0, FIRST)


def test_what_is_not_drawn_in_bands_teaches_nothing():
    bands = Bands()
    bands.learn(10.0, 0.02)
    drawn(bands, 16, 1e-3)
    bands.learn(10.0, 0.02)
    assert next(iter(bands.split("gather", 1080)))[1] >= FIRST
