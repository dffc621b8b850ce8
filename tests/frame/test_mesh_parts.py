"""Parts of meshes, which are closed, and the sides on which light enters them."""

from types import SimpleNamespace

import numpy as np
import pytest

from addon.scene.mesh_parts import parts_of
from addon.scene.scatter_surface import Surface, Voxels

CUBE = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
FACES = np.array([t for a, b, c, d in QUADS for t in ((a, b, c), (a, c, d))])


def mesh(positions, triangles):
    corners = positions[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.repeat(normals / np.linalg.norm(normals, axis=1, keepdims=True), 3, axis=0)
    return SimpleNamespace(
        positions=positions, corner_vertices=triangles.reshape(-1), corner_normals=normals, uv_maps={}, active_uv="",
        triangle_corners=np.arange(triangles.size).reshape(-1, 3),
        triangle_materials=lambda slots: np.zeros(len(triangles), int),
    )  # fmt: skip


def sides(made):
    instance = SimpleNamespace(matrix=np.eye(4), materials=(0,), terminator=0.1)
    return Surface.sides(instance, made, (1.0,), np.zeros(3))


def outwards(surface):
    middle = surface.corners.mean(axis=1)
    return np.einsum("ni,ni->n", middle - 0.5, surface.normals.mean(axis=1))


def test_a_cube_is_closed_and_without_a_face_it_is_open_along_four_edges():
    whole, part = parts_of(CUBE, FACES), parts_of(CUBE, FACES[2:])
    assert whole.closed.tolist() == [True] and whole.rim.tolist() == [0.0]
    assert part.closed.tolist() == [False] and part.rim == pytest.approx([4.0])


def test_split_edges_open_nothing_and_parts_are_told_apart():
    split = CUBE[FACES.reshape(-1)]
    both = parts_of(np.concatenate([split, split[3:] + 5.0]), np.arange(2 * 36 - 3).reshape(-1, 3))
    assert both.closed.tolist() == [True, False]
    assert np.bincount(both.of_triangle).tolist() == [12, 11]


@pytest.mark.parametrize("winding", [1, -1])
def test_what_is_closed_faces_outwards_however_it_is_wound(winding):
    (front,) = sides(mesh(CUBE, FACES[:, ::winding]))
    assert (outwards(front) > 0.4).all()
    assert front.thickness == pytest.approx(4.0 / 6.0)


@pytest.mark.parametrize("winding", [1, -1])
def test_a_sheet_has_two_sides_and_keeps_its_front(winding):
    made = mesh(CUBE, FACES[:2, ::winding])
    front, back = sides(made)
    assert front.normals == pytest.approx(made.corner_normals.reshape(-1, 3, 3))
    assert back.normals == pytest.approx(-front.normals) and back.behind and not front.behind


def test_voxels_find_the_cell_that_faces_the_way_asked_for():
    (front,) = sides(mesh(CUBE, FACES))
    place, _, face, *_, cloud = front.cells(64)
    grid = Voxels.of([(*cloud, 0, 6.0**0.5 / 8.0)])
    at = tuple(((np.array([0.5, 0.5, 1.0]) - grid.low) / grid.size).astype(int))
    number = np.ravel_multi_index(at, grid.shape)
    cell = int(grid.texels[2 * number + 1, 1]) - 1  # of +z, the fifth of six
    assert face[cell, 0] == pytest.approx([0, 0, 1]) and place[cell, 0, 2] == pytest.approx(1.0)
    assert np.hypot(*(place[cell, 0, :2] - 0.5)) < 0.4
