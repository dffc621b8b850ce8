"""The sequence: evenly spread prefixes, film and light together, the same numbers every time."""

import itertools

import numpy as np
import pytest

from addon.sampling import sequence
from addon.sampling.sequence import FILM, pixel_bits, point, points
from addon.scene.view import blackman_harris_offset

USES = [FILM, "light/Lamp", "light/Sun", "environment", "map/Lamp", "map/Lamp/turn"]


def net_quality(x):
    """The smallest t for which x, (2^m, d), is a (t, m, d)-net in base 2: 0 is best, m says nothing."""
    count, dimensions = x.shape
    m = count.bit_length() - 1
    for t in range(m + 1):
        splits = (s for s in itertools.product(range(m - t + 1), repeat=dimensions) if sum(s) == m - t)
        if all((occupancy(x, split) == 2**t).all() for split in splits):
            return t
    raise AssertionError("not even a (m, m, d)-net: points outside of the unit cube")


def occupancy(x, split):
    """How many points lie in each box when axis k is cut into 2^split[k] parts."""
    cell = np.zeros(len(x), int)
    for axis, bits in enumerate(split):
        cell = (cell << bits) + (x[:, axis] * 2**bits).astype(int)
    return np.bincount(cell, minlength=2 ** sum(split))


@pytest.mark.parametrize("use", USES)
def test_each_prefix_of_every_use_is_a_perfect_net(use):
    assert [net_quality(points(0, 2**m, use)) for m in range(11)] == [0] * 11


def volume(count, use):
    """Points of a use that fills a volume, (count, 3)."""
    last = [sequence.third(index, use) for index in range(count)]
    return np.column_stack([points(0, count, use), last])


def test_the_third_number_of_a_use_goes_with_its_point():
    assert all(net_quality(volume(2**m, "light")) <= 1 for m in range(9))


@pytest.mark.parametrize("use", USES)
def test_each_axis_of_each_prefix_is_evenly_cut(use):
    for m in range(11):
        x = points(0, 2**m, use)
        for axis in range(2):
            assert sorted((x[:, axis] * 2**m).astype(int)) == list(range(2**m))


@pytest.mark.parametrize("use", USES[1:])
def test_film_and_light_are_stratified_together(use):
    """Random pairing of two nets has t near m: samples that see one side of an edge would miss half of the light."""
    together = np.concatenate([points(0, 1024, FILM), points(0, 1024, use)], axis=1)
    assert all(net_quality(together[: 2**m]) <= 3 for m in range(11))
    # Of 64 samples, 16 fall into each quarter of the pixel, and 4 of these into each quarter of the light.
    assert (occupancy(together[:64], (1, 1, 0, 0)) == 16).all()
    assert (occupancy(together[:64], (1, 1, 1, 1)) == 4).all()


def test_uses_and_seeds_differ_and_repeat():
    a = points(0, 64, "light/A")
    np.testing.assert_array_equal(a, points(0, 64, "light/A"))
    for other in (points(0, 64, "light/B"), points(0, 64, "light/A", seed=1), points(64, 64, "light/A")):
        assert np.abs(a - other).max() > 0.1


def test_numbers_are_in_the_half_open_interval():
    for use in USES:
        x = points(0, 4096, use)
        assert x.min() >= 0.0
        assert x.max() < 1.0


def test_a_point_is_the_same_alone_and_in_a_row():
    row = points(0, 32, "light/Lamp", seed=3)
    assert [point(i, "light/Lamp", 3) for i in range(32)] == [tuple(p) for p in row]


def test_pixel_bits_are_other_dimensions_than_the_films_as_signed_integers():
    for index in (0, 1, 2, 77, 65535):
        expected = [int(sequence.bits(np.uint64(index), dimension)) for dimension in (0, 1, 5, 6)]
        assert [value % 2**32 for value in pixel_bits(index)] == expected
        assert all(-(2**31) <= value < 2**31 for value in pixel_bits(index))


def test_the_film_offsets_are_distributed_as_the_filter():
    """Mean and variance of the Blackman-Harris density over its support of +-1.5 pixels."""
    offsets = np.array([blackman_harris_offset((i + 0.5) / 4096, 1.5) for i in range(4096)])
    t = np.linspace(-1.5, 1.5, 100001)
    phase = np.pi * (t / 1.5 + 1)
    density = 0.35875 - 0.48829 * np.cos(phase) + 0.14128 * np.cos(2 * phase) - 0.01168 * np.cos(3 * phase)
    assert abs(offsets.mean()) < 1e-4
    assert np.abs(offsets).max() <= 1.5
    assert offsets.var() == pytest.approx((density * t**2).sum() / density.sum(), rel=2e-3)


def test_lens_and_lots_cover_the_plane_together_with_what_they_choose():
    """Two scrambles of one dimension are functions of each other: a point of the lens, or a lot, would see the same
    part of a light for ever."""
    count = 1024
    light = points(0, count, "light")
    numbers = np.array([sequence.uniform(k, "choose lights") for k in range(count)])
    lens = points(0, count, sequence.LENS)
    for other in (numbers, lens[:, 0], lens[:, 1]):
        for axis in (0, 1):
            cells = occupancy(np.stack([other, light[:, axis]], axis=1), (4, 4))
            assert cells.min() > 0 and cells.max() <= 16  # 4 on average; of one dimension 240 of 256 are empty


def test_the_film_begins_in_its_middle_and_the_lens_in_the_apertures():
    assert sequence.point(0, FILM) == (0.5, 0.5) == sequence.point(0, FILM, seed=7)
    assert sequence.point(0, sequence.LENS) == (0.0, 0.0)


def test_the_first_points_of_many_uses_fill_the_plane():
    """Also a single point is anywhere: of 4,000 uses, each cell of 8 x 8 has its share of first points, third numbers
    and pairs of both."""
    first = np.array([(*sequence.point(0, f"use {k}"), sequence.third(0, f"use {k}")) for k in range(4000)])
    for pair in ((0, 1), (0, 2), (1, 2)):
        counts, *_ = np.histogram2d(*first[:, pair].T, bins=8, range=((0, 1), (0, 1)))
        assert counts.min() > 0.5 * 62.5 and counts.max() < 1.6 * 62.5


def test_points_that_are_shifted_alike_lie_at_the_same_place_of_their_cells():
    """Sixteen of each of twenty uses are a net whose points have one remainder; one point of many uses is anywhere."""
    for k in range(20):
        points = np.array([sequence.alike(number, f"use {k}") for number in range(16)])
        np.testing.assert_allclose(np.ptp(points % (1 / 16), axis=0), 0.0, atol=1e-9)
        for cells in ((16, 1), (4, 4), (1, 16)):
            assert len({tuple(place) for place in (points[:, :2] * cells).astype(int)}) == 16
    first = np.array([sequence.alike(0, f"use {k}") for k in range(4000)])
    for pair in ((0, 1), (0, 2), (1, 2)):
        counts, *_ = np.histogram2d(*first[:, pair].T, bins=8, range=((0, 1), (0, 1)))
        assert counts.min() > 0.5 * 62.5 and counts.max() < 1.6 * 62.5
