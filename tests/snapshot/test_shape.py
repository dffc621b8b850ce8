"""Pointiness and islands of small meshes, by hand. Against Cycles: the page of nodes (bench/node_list.py)."""

import numpy as np
import pytest

from addon.snapshot.shape import island_numbers, islands, pointiness

CUBE = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float32)
CUBE_EDGES = np.array([(a, b) for a in range(8) for b in range(a) if np.abs(CUBE[a] - CUBE[b]).sum() == 1])


def outwards(positions):
    normals = positions - positions.mean(axis=0)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def test_corners_of_a_cube_point_by_the_angle_of_their_edges():
    """The mean edge is minus the normal's direction, 1 / sqrt(3) long."""
    found = pointiness(CUBE, outwards(CUBE), CUBE_EDGES)
    assert found == pytest.approx(np.full(8, np.arccos(-1 / np.sqrt(3)) / np.pi), abs=1e-6)
    assert pointiness(CUBE, -outwards(CUBE), CUBE_EDGES) == pytest.approx(1 - found, abs=1e-6)


def test_vertices_at_one_place_count_as_one():
    whole = pointiness(CUBE, outwards(CUBE), CUBE_EDGES)
    twice = pointiness(
        np.concatenate([CUBE, CUBE]), np.concatenate([outwards(CUBE)] * 2), np.concatenate([CUBE_EDGES, CUBE_EDGES + 8])
    )
    assert twice == pytest.approx(np.concatenate([whole, whole]))


def test_islands_are_what_edges_connect():
    edges = np.array([(0, 1), (1, 2), (5, 4), (3, 5), (7, 8)])
    assert islands(9, edges).tolist() == [0, 0, 0, 3, 3, 3, 6, 7, 7]
    numbers = island_numbers(9, edges)
    assert len(np.unique(numbers)) == 4
    assert ((numbers >= 0) & (numbers <= 1)).all()


def test_a_long_chain_is_one_island():
    chain = np.stack([np.arange(999, 0, -1), np.arange(998, -1, -1)], axis=1)
    assert not islands(1000, np.random.default_rng(0).permutation(chain)).any()


def test_a_mesh_without_edges_has_neither():
    assert pointiness(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 2), int)).shape == (0,)
    assert pointiness(np.zeros((1, 3)), np.zeros((1, 3)), np.zeros((0, 2), int)).tolist() == [0.0]
