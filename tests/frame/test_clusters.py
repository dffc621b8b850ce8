"""Clusters of points with normals: sides of an edge stay apart, shapes are right, scale and chance change nothing."""

from itertools import pairwise

import numpy as np
import pytest

from addon.sources.clusters import cluster, members


def square(count=400, seed=1):
    """Points on the unit square in z = 0, facing up."""
    points = np.zeros((count, 3))
    points[:, :2] = np.random.default_rng(seed).random((count, 2))
    return points, np.tile([0.0, 0.0, 1.0], (count, 1))


def both_sides(count=400):
    points, normals = square(count)
    return np.concatenate([points, points - [0, 0, 0.01]]), np.concatenate([normals, -normals])


def test_two_sides_of_a_thin_wall_share_no_cluster():
    points, normals = both_sides()
    groups = cluster(points, normals, np.ones(len(points)), 16)
    assert len(groups) > 8
    for own in members(groups.label, len(groups)):
        assert len(set(normals[own, 2])) == 1


def test_every_point_has_a_cluster_and_no_cluster_is_empty():
    points, normals = both_sides(100)
    for count in (1, 2, 30, 200, 500):
        groups = cluster(points, normals, np.ones(len(points)), count)
        counts = np.bincount(groups.label, minlength=len(groups))
        assert counts.sum() == len(points)
        assert counts.min() > 0 and len(counts) == len(groups) <= count
        assert (groups.label[groups.middle] == np.arange(len(groups))).all()
        np.testing.assert_array_equal(groups.nearest(points, normals), groups.label)


def test_a_single_cluster_of_a_rectangle_is_that_rectangle():
    points, normals = square(20000)
    groups = cluster(points * [3.0, 1.0, 1.0], normals, np.ones(len(points)), 1)
    assert groups.half[0] == pytest.approx([1.5, 0.5], rel=0.02)
    assert abs(groups.across[0]) == pytest.approx([1, 0, 0], abs=0.02)
    assert points[groups.middle[0], :2] == pytest.approx([0.5, 0.5], abs=0.03)


def test_a_few_points_stand_for_the_area_that_they_were_drawn_from():
    """Moments of samples are too small by 1 - 1/n, which the shape makes up for."""
    squared = []
    for seed in range(200):
        points, normals = square(3, seed)
        groups = cluster(points, normals, np.ones(3), 1)
        squared.append((groups.half[0] ** 2).sum())
    assert np.mean(squared) == pytest.approx(2 * 0.5**2, rel=0.05)


def test_opposite_normals_that_cancel_leave_a_normal():
    points, normals = np.zeros((2, 3)), np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    groups = cluster(points, normals, np.ones(2), 1)
    assert np.linalg.norm(groups.normal, axis=1) == pytest.approx(1.0)
    assert (groups.normal * groups.across).sum() == pytest.approx(0.0)


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_clusters_do_not_depend_on_scale_or_chance(scale):
    points, normals = both_sides()
    weights = np.linspace(1, 2, len(points))
    groups, again, scaled = (cluster(points * factor, normals, weights * factor, 20) for factor in (1.0, 1.0, scale))
    np.testing.assert_array_equal(groups.label, again.label)
    np.testing.assert_array_equal(groups.half, again.half)
    np.testing.assert_array_equal(groups.label, scaled.label)
    np.testing.assert_allclose(scaled.half, scale * groups.half, rtol=1e-6)


def test_small_moves_of_light_move_clusters_a_little_and_lose_none():
    """A patch of light of constant size walks from a floor over an edge up a wall."""
    points, _ = square(600)
    counts, middles = [], []
    for step in np.linspace(0, 1, 60):
        along = points[:, 0] + step
        place = np.stack([np.minimum(along, 1.0), points[:, 1], np.maximum(along - 1.0, 0.0)], axis=1)
        facing = np.where((along > 1.0)[:, None], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0])
        groups = cluster(place, facing, np.ones(len(place)), 16)
        counts.append(len(groups))
        middles.append(place[groups.middle])
    assert min(counts) >= 14
    moved = [
        np.linalg.norm(after[:, None] - before[None], axis=2).min(axis=1).mean() for before, after in pairwise(middles)
    ]
    assert np.mean(moved) < 0.1
