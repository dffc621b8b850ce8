"""Which open glass is a single sheet, such as a pool's surface: one side of it is the inside of no solid.

Light that enters glass by one open face and leaves it by another has passed a pane; what enters a sheet stays within.
Open parts of meshes are judged with those that they may bound a solid with:

1. those that face away from each other, each behind the other: the faces of a pane, or of a lens, at any distance;
2. of the rest those whose boxes touch, as faces of a block do that are objects of their own.

A group is one of sheets if its faces, summed by area, look one way: the sum is longer than ONE_SIDED of their area.

Cost: numpy over the triangles of meshes with open glass, and over pairs of up to MOST_PARTS open parts; more are one
group. Kept (SheetCache) until something of glass moves, comes or goes.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ..materials.compiled import CompiledMaterial
from ..snapshot.scene import Instance, Mesh
from .culling import closed
from .mesh_parts import parts_of

ALONE = 0.99  # share of a material, from which on it is glass and nothing else
ONE_SIDED = 0.25  # length of the sum of a sheet's faces, over their area
AWAY = -0.7  # cosine between faces of a pane
OVERLAP = 0.5  # of the smaller one's extent, along either axis across, by which faces of a pane lie behind each other
TOUCH = 1e-3  # of a box's diagonal, by which it may miss another one
MOST_PARTS = 1024
MOST_KEPT = 64  # meshes of which is kept what is open
MOST_SETS = 8  # of instances of which sheets are kept: those that paths meet

Sheets = dict[int, frozenset[int]]  # by id of an instance: parts of its mesh (open_parts) that are single sheets
NO_SHEETS: Sheets = {}


@dataclass(frozen=True)
class OpenParts:
    """Open parts of glass in world space, by area."""

    owner: np.ndarray  # (P,) number of the instance
    number: np.ndarray  # (P,) of the part in its mesh
    facing: np.ndarray  # (P, 3) sum of the faces' areas along their normals, m2 times 2
    area: np.ndarray  # (P,) the same of their areas
    low: np.ndarray  # (P, 3)
    high: np.ndarray


def sheets_of(shown: Iterable[Instance], meshes: dict[str, Mesh], materials: list[CompiledMaterial]) -> Sheets:
    """The single sheets of glass among the instances."""
    glass = _glass_of(materials)
    shown = [one for one in _showing(shown, glass) if meshes[one.mesh].triangle_count]
    parts = _world_parts(shown, meshes, [*glass])
    if parts is None:
        return {}
    found: dict[int, set[int]] = {}
    for k in np.flatnonzero(_single(parts)):
        found.setdefault(id(shown[parts.owner[k]]), set()).add(int(parts.number[k]))
    return {name: frozenset(some) for name, some in found.items()}


class SheetCache:
    """The single sheets of glass of a scene, for all paths."""

    def __init__(self):
        self._showing: tuple = (None, frozenset(), ())  # instances, glass, those of them that show it
        self._found: dict[tuple, Sheets] = {}  # by the latter, glass and what their meshes are

    def get(self, shown: tuple[Instance, ...], meshes: dict[str, Mesh], materials: list[CompiledMaterial]) -> Sheets:
        """As sheets_of."""
        glass = _glass_of(materials)
        if not glass:
            return NO_SHEETS
        if self._showing[0] is not shown or self._showing[1] != glass:
            self._showing = shown, glass, tuple(_showing(shown, glass))
        own = self._showing[2]
        named = dict.fromkeys(one.mesh for one in own)
        key = own, glass, tuple((meshes[name].key, meshes[name].version) for name in named)
        if key not in self._found:
            self._found = dict([*self._found.items()][1 - MOST_SETS :]) | {key: sheets_of(own, meshes, materials)}
        return self._found[key]


def _glass_of(materials: list[CompiledMaterial]) -> frozenset[int]:
    return frozenset(k for k, one in enumerate(materials) if one.glass is not None and one.glass.share > ALONE)


def _showing(shown: Iterable[Instance], materials: frozenset[int]) -> Iterable[Instance]:
    """Those of the instances that show any of these materials."""
    known: dict[tuple[int, ...], bool] = {}  # by what slots hold, which many copies share
    for one in shown:
        if one.materials not in known:
            known[one.materials] = not materials.isdisjoint(one.materials)
        if known[one.materials]:
            yield one


_open: dict[tuple, np.ndarray] = {}  # by what tells a mesh's content


def open_parts(mesh: Mesh) -> np.ndarray:
    """(T,) number of the connected part that a triangle belongs to; -1: of a closed one."""
    key = (mesh.key, mesh.version, mesh.triangle_count, mesh.bounds_min.tobytes(), mesh.bounds_max.tobytes())
    if key not in _open:
        if len(_open) >= MOST_KEPT:
            _open.clear()
        triangles = mesh.corner_vertices[mesh.triangle_corners]
        if closed(mesh.positions, triangles):
            _open[key] = np.full(len(triangles), -1)
        else:
            parts = parts_of(mesh.positions, triangles)
            _open[key] = np.where(parts.closed[parts.of_triangle], -1, parts.of_triangle)
    return _open[key]


def _world_parts(shown: list[Instance], meshes: dict[str, Mesh], glass: list[int]) -> OpenParts | None:
    rows = []
    for number, one in enumerate(shown):
        mesh = meshes[one.mesh]
        parts = open_parts(mesh)
        own = (parts >= 0) & np.isin(mesh.triangle_materials(one.materials), glass)
        if not own.any():
            continue
        corners = mesh.positions[mesh.corner_vertices[mesh.triangle_corners[own]]] @ one.matrix[:3, :3].T
        corners = corners + one.matrix[:3, 3]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        names, part = np.unique(parts[own], return_inverse=True)
        facing, area = np.zeros((len(names), 3)), np.zeros(len(names))
        np.add.at(facing, part, across)
        np.add.at(area, part, np.linalg.norm(across, axis=1))
        low, high = np.full((len(names), 3), np.inf), np.full((len(names), 3), -np.inf)
        np.minimum.at(low, part, corners.min(axis=1))
        np.maximum.at(high, part, corners.max(axis=1))
        rows.append((np.full(len(names), number), names, facing, area, low, high))
    return OpenParts(*(np.concatenate(column) for column in zip(*rows))) if rows else None


def _single(parts: OpenParts) -> np.ndarray:
    """(P,) which are single sheets."""
    count = len(parts.area)
    if count > MOST_PARTS:
        return _one_sided(parts, np.zeros(count, int))
    of_panes = _groups(_behind_each_other(parts))
    single = _one_sided(parts, of_panes)
    left = single & (np.bincount(of_panes, minlength=count)[of_panes] == 1)
    touching = _groups(_touching(parts) & left & left[:, None])
    return np.where(left, _one_sided(parts, touching), single)


def _one_sided(parts: OpenParts, group: np.ndarray) -> np.ndarray:
    """(P,) whether the faces of each part's group look one way together."""
    facing, area = np.zeros((len(group), 3)), np.zeros(len(group))
    np.add.at(facing, group, parts.facing)
    np.add.at(area, group, parts.area)
    return (np.linalg.norm(facing, axis=1) > ONE_SIDED * area)[group]


def _behind_each_other(parts: OpenParts) -> np.ndarray:
    """(P, P) which pairs may be the two faces of a pane."""
    length = np.linalg.norm(parts.facing, axis=1)
    normal = parts.facing / np.maximum(length, 1e-300)[:, None]
    flat = length > ONE_SIDED * parts.area
    middle, half = (parts.low + parts.high) / 2, (parts.high - parts.low) / 2
    offset = middle[None] - middle[:, None]  # from the first to the second
    before = np.einsum("ijk,ik->ij", offset, normal)  # how far the second lies before the first
    slack = TOUCH * np.linalg.norm(half, axis=1)
    behind = before <= slack[:, None]
    across = np.abs(offset - before[..., None] * normal[:, None])
    reach = half[:, None] + half[None] - 2.0 * OVERLAP * np.minimum(half[:, None], half[None])
    facing = np.abs(normal)[:, None] > 0.5  # an axis along which both have no extent to overlap by
    beside = ((across > reach + slack[:, None, None]) & ~facing).any(axis=-1)
    pairs = (normal @ normal.T < AWAY) & behind & behind.T & ~(beside | beside.T) & flat & flat[:, None]
    return pairs | pairs.T


def _touching(parts: OpenParts) -> np.ndarray:
    """(P, P) whose boxes meet."""
    pad = TOUCH * np.linalg.norm(parts.high - parts.low, axis=1)[:, None]
    low, high = parts.low - pad, parts.high + pad
    return ((low[:, None] <= high[None]) & (low[None] <= high[:, None])).all(axis=-1)


def _groups(joined: np.ndarray) -> np.ndarray:
    """(P,) least number of those that each is joined with, over others, too, by a symmetric (P, P)."""
    label = np.arange(len(joined))
    joined = joined | np.eye(len(joined), dtype=bool)
    while True:
        least = np.where(joined, label[None], len(joined)).min(axis=1)
        if (least == label).all():
            return label
        label = least
