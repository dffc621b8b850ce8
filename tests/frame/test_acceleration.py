"""The hierarchy that rays search, on the CPU's side: triangles that move keep their places, and boxes follow them."""

import numpy as np
import pytest

from addon.scene import acceleration


@pytest.fixture
def triangles(gpu_context):
    rng = np.random.default_rng(4)
    corners = rng.uniform(-1, 1, (300, 1, 3)) + rng.uniform(-0.1, 0.1, (300, 3, 3))
    return corners.astype(np.float32), rng.uniform(0, 1, (300, 8))


def test_refitted_tree_is_that_of_the_moved_triangles_in_the_old_order(triangles):
    corners, look = triangles
    numbers = np.arange(40, 70)
    moved = corners.copy()
    moved[numbers] += np.float32(2.5)
    tree = acceleration.build(corners, look)
    order = tree.place.copy()
    found = acceleration.refit(tree, numbers, moved[numbers], look[numbers])
    assert found.refitted and not tree.refitted
    assert np.array_equal(found.place, order)
    leaf, slot = order // acceleration.LEAF, order % acceleration.LEAF
    assert np.array_equal(found.leaves[leaf, :3, slot], moved[:, 0])
    assert np.array_equal(found.leaves[leaf, 3:6, slot], moved[:, 1] - moved[:, 0])
    assert np.array_equal(found.low[order], moved.min(axis=1))
    assert np.array_equal(found.high[order], moved.max(axis=1))


def test_triangle_that_is_not_finite_is_left_out_and_not_refitted(triangles):
    corners, look = triangles
    corners[3, 1, 2] = np.nan
    tree = acceleration.build(corners, look)
    assert tree.hierarchy.triangles == 299
    assert tree.place[3] == -1 and len(set(np.delete(tree.place, 3))) == 299
    assert acceleration.refit(tree, np.array([3]), np.zeros((1, 3, 3), np.float32), look[:1]) is None
    assert acceleration.refit(tree, np.array([4]), corners[3:4], look[:1]) is None
