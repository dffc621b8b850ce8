"""Emission that varies over triangles: what is measured in tiles becomes means and pieces."""

import numpy as np
import pytest

from addon.scene.emission_maps import _pieces

EVEN = (1.0, 2.0, 3.0)


def test_an_even_triangle_is_one_piece_and_a_varied_one_a_piece_of_each_cell():
    """Tiles of 2 x 2 cells, each measured twice: the first is even, in the second each cell has a value of its own. Its
    triangle has the two cells beside its corners, and both halves of the first."""
    sums, cells = np.zeros((2, 2, 4, 4)), np.array([[1.0, 5.0], [2.0, 40.0]])  # [v, u]
    sums[..., 3] = 2.0
    sums[:, :, :2, :3] = 2.0 * np.array(EVEN)
    sums[:, :, 2:, :3] = 2.0 * cells[..., None]
    mean, pieces, places, radiance = _pieces(sums, np.array([2, 2]), np.array([(0, 0), (2, 0)]))
    np.testing.assert_allclose(mean, np.broadcast_to(np.array([EVEN, (12.0,) * 3])[:, None], (2, 2, 3)))
    assert pieces.tolist() == [0, 1, 1, 1, 1]
    np.testing.assert_allclose(places[0], [(0, 0), (1, 0), (0, 1)])
    np.testing.assert_allclose(radiance[0], [EVEN, EVEN])
    across, up = places[1:, 1] - places[1:, 0], places[1:, 2] - places[1:, 0]
    area = 0.5 * np.abs(across[:, 0] * up[:, 1] - across[:, 1] * up[:, 0])
    np.testing.assert_allclose(area, 0.5 / 4)  # quarters of the triangle, all within it
    assert places.min() >= 0 and places.sum(axis=2).max() <= 1
    found = {
        tuple(np.floor(2 * middle).astype(int)): value for middle, value in zip(places[1:].mean(axis=1), radiance[1:])
    }
    assert {place: value[0, 0] for place, value in found.items()} == {(0, 0): 1.0, (1, 0): 5.0, (0, 1): 2.0}
    assert sorted(radiance[1:, 0, 0]) == [1.0, 1.0, 2.0, 5.0]


def test_sides_that_differ_stay_apart():
    sums = np.ones((2, 1, 1, 4))
    sums[1, ..., :3] = 4.0
    mean, _, _, radiance = _pieces(sums, np.array([1]), np.array([(0, 0)]))
    assert mean[0, 0] == pytest.approx(1.0) and mean[0, 1] == pytest.approx(4.0)
    np.testing.assert_allclose(radiance, mean)
