"""Which candidates become virtual lights: without bias, spread in space, and alike in pictures that are alike."""

import numpy as np
import pytest

from addon.lighting.virtual_lights import CELL, _resample

COUNT = 512


@pytest.fixture
def candidates():
    """Points on a floor and a wall, and their radiances."""
    numbers = np.random.default_rng(2)
    points = numbers.random((1536, 3))
    points[:1000, 2] = 0.0
    points[1000:, 0] = 1.0
    return points, numbers.random((1536, 3)) ** 4


def test_what_is_kept_stands_for_all_candidates(candidates):
    points, radiance = candidates
    mean = np.zeros(len(points))
    starts = (np.arange(1000) + 0.5) / 1000
    for u in starts:
        keep, weight = _resample(points, radiance, COUNT, u)
        mean[keep] += weight / len(starts)
    np.testing.assert_allclose(mean, 1.0, atol=0.01)


def test_about_as_many_are_kept_as_are_asked_for(candidates):
    for count in (1, 3, 64, COUNT):
        keep, _ = _resample(*candidates, count, 0.3)
        assert abs(len(keep) - count) <= max(0.05 * count, 1) + (count == COUNT) * CELL


def test_every_part_of_space_has_its_share(candidates):
    points, radiance = candidates
    keep, weight = _resample(points, radiance, COUNT, 0.7)
    for quarter in np.ndindex(2, 2, 1):
        inside = (np.floor(points * 2).clip(0, 1)[:, :2] == quarter[:2]).all(axis=1)
        assert abs(weight[inside[keep]].sum() / inside.sum() - 1) < 0.1


def test_other_candidates_change_what_is_kept_nearby(candidates):
    """One gone, one brighter, one elsewhere: few of those that are kept are others."""
    points, radiance = candidates
    keep, _ = _resample(points, radiance, COUNT, 0.3)
    points, radiance = points.copy(), radiance.copy()
    radiance[100] = 0.0
    radiance[700] *= 2.0
    points[1200] = 1.0 - points[1200]
    others, _ = _resample(points, radiance, COUNT, 0.3)
    assert len(set(keep) ^ set(others)) <= 6 * CELL


def test_where_nothing_has_light_nothing_is_kept(candidates):
    points, radiance = candidates
    keep, weight = _resample(points, np.zeros_like(radiance), COUNT, 0.3)
    assert not len(keep) and not len(weight)


def test_candidates_in_one_place_are_kept_in_proportion():
    points = np.full((100, 3), 0.5)
    _keep, weight = _resample(points, np.ones((100, 3)), 64, 0.1)
    assert abs(weight.sum() - 100) <= 2
