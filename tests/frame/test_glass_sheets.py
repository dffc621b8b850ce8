"""Which open glass is a single sheet: by what it may bound a solid with, wherever else in the scene glass is."""

from types import SimpleNamespace

import numpy as np
import pytest

from addon.scene import glass_sheets
from addon.scene.glass_sheets import SheetCache, sheets_of
from addon.snapshot.scene import Instance, Mesh

GLASS = SimpleNamespace(glass=SimpleNamespace(share=1.0))
LARGE, SMALL = 5.0, 0.5


def turned(axis, angle, place=(0, 0, 0)):
    matrix = np.eye(4)
    i, j = ((1, 2), (2, 0), (0, 1))[axis]
    matrix[i, i] = matrix[j, j] = np.cos(angle)
    matrix[j, i] = np.sin(angle)
    matrix[i, j] = -np.sin(angle)
    matrix[:3, 3] = place
    return matrix


def up(place=(0, 0, 0)):
    return turned(0, 0.0, place)


def down(place=(0, 0, 0)):
    return turned(0, np.pi, place)


def sideways(sign, place):
    return turned(1, sign * np.pi / 2, place)


PANE = [(SMALL, sideways(1, (0.05, 0, 3))), (SMALL, sideways(-1, (-0.05, 0, 3)))]
TILTED = turned(0, 0.3)
CASES = {
    "a pond": ([(LARGE, up())], [1]),
    "a pane": (PANE, [0, 0]),
    "a pond and a pane": ([(LARGE, up()), *PANE], [1, 0, 0]),
    "two ponds, one upside down": ([(LARGE, up()), (LARGE, down((20, 0, 0)))], [1, 1]),
    "one of them above the other": ([(LARGE, up()), (LARGE, down((0, 0, 2)))], [1, 1]),
    "the faces of a slab": ([(LARGE, up()), (LARGE, down((0, 0, -2)))], [0, 0]),
    "a tilted pane": ([(SMALL, TILTED), (SMALL, TILTED @ down((0, 0, -0.1)))], [0, 0]),
    "a pane in a pond": ([(LARGE, up()), *((one, up((0, 0, -3)) @ place) for one, place in PANE)], [1, 0, 0]),
    "two panes in a row": ([*PANE, *((size, up((1, 0, 0)) @ place) for size, place in PANE)], [0, 0, 0, 0]),
    "six faces of a block": (
        [(SMALL, up((0, 0, 0.5))), (SMALL, down((0, 0, -0.5))), (SMALL, sideways(1, (0.5, 0, 0))),
         (SMALL, sideways(-1, (-0.5, 0, 0))), (SMALL, turned(0, -np.pi / 2, (0, 0.5, 0))),
         (SMALL, turned(0, np.pi / 2, (0, -0.5, 0)))],
        [0] * 6,
    ),
}  # fmt: skip


def square(size):
    """Of two triangles, that faces up."""
    positions = size * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
    corners = np.array([0, 1, 2, 0, 2, 3], np.int32)
    return Mesh(
        str(size), 0, positions, corners, np.tile(np.float32([0, 0, 1]), (6, 1)), np.arange(6).reshape(2, 3),
        np.zeros(2, np.int32), 1, bounds_min=positions.min(axis=0), bounds_max=positions.max(axis=0),
    )  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_sheets_are_told_by_what_they_bound(name):
    placed, expected = CASES[name]
    meshes = {str(size): square(size) for size in (LARGE, SMALL)}
    instances = [Instance("glass", str(size), matrix, (0,)) for size, matrix in placed]
    found = sheets_of(instances, meshes, [GLASS])
    assert [int(id(one) in found) for one in instances] == expected


def test_sheets_are_found_once_for_all_paths_until_glass_moves(monkeypatch):
    """They were found anew for each path of each picture, though only the camera had turned."""
    meshes = {str(LARGE): square(LARGE)}
    materials = [GLASS, SimpleNamespace(glass=None)]
    pond, leaf = (Instance("thing", str(LARGE), up((0, 0, k)), (k,)) for k in (0, 1))
    calls = []
    find = glass_sheets._world_parts
    monkeypatch.setattr(glass_sheets, "_world_parts", lambda *given: calls.append(1) or find(*given))
    cache, shown = SheetCache(), (pond, leaf)
    for _ in range(3):
        assert id(pond) in cache.get(shown, meshes, [*materials])
    cache.get((pond, Instance("thing", str(LARGE), up((0, 0, 5)), (1,))), meshes, materials)
    cache.get(shown[::-1], meshes, materials)
    assert len(calls) == 1
    moved = Instance("thing", str(LARGE), up((0, 0, 7)), (0,))
    assert [*cache.get((moved, leaf), meshes, materials)] == [id(moved)]
    assert len(calls) == 2
    assert not cache.get(shown, meshes, materials[1:] * 2) and len(calls) == 2
