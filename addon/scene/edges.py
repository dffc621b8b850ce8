"""Edges of what casts shadows: the front end of shadow techniques that stream silhouettes instead of drawing maps.

An edge table belongs to a mesh: vertices welded by exact position (so that seams of UVs and normals close), triangles
without area dropped, and every undirected edge with its one or two triangles. An edge of k > 2 triangles becomes
ceil(k / 2) records, so that each record has at most two. For triangle t of an edge (i < j) the orientation o_t is +1
where t runs from i to j, else -1. With the facing f_t(x) = sign(N_t . x + d_t) of a triangle towards a point the weight

    w(x) = sum over t of  o_t f_t(x)

is 0 where both triangles of a closed surface face alike, +-2 on a silhouette, and +-1 on an open border. It does not
depend on how triangles are wound: turning one around flips both o and f.

Tables are kept with their meshes (`EdgeCache`); an object that moves costs a transform of its vertices. `CasterEdges`
is what stands in the scene, in world space relative to the render origin. A group is a connected island of one object:
it is closed if all its edges have an even number of triangles.

| cost | per triangle of a closed mesh |
|---|---|
| table, once per mesh | a sort of 3 keys; 1.5 edges of 48 bytes |
| world space, when something moves | 84 bytes, a transform and a normal |

Triangles that pass light (alpha) are left out: whoever asks says which materials block it all. Above LARGEST triangles
there are no edges: a scene of that size has more silhouettes than any tile could stream.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..materials.compiled import CompiledMaterial
from ..snapshot.scene import Instance, Mesh
from .culling import parts as parts_of

LARGEST = 1_000_000  # triangles, all instances counted
NO_AREA = 1e-12  # of the squared diagonal: triangles below have no plane


@dataclass(frozen=True)
class MeshEdges:
    """The edge table of one mesh in its own space."""

    vertices: np.ndarray  # (V, 3) float32, welded
    triangles: np.ndarray  # (T, 3) vertices
    source: np.ndarray  # (T,) numbers of the mesh's triangles
    ends: np.ndarray  # (E, 2) vertices, the lower number first
    faces: np.ndarray  # (E, 2) triangles; -1: none
    orient: np.ndarray  # (E, 2) +1, -1; 0: none
    island: np.ndarray  # (T,) number of the connected part, from 0
    closed: np.ndarray  # (islands,) whether every edge of it has an even number of triangles


def table(positions: np.ndarray, triangles: np.ndarray) -> MeshEdges:
    """The edge table of triangles (T, 3) over positions (V, 3)."""
    positions = np.ascontiguousarray(positions, np.float32) + np.float32(0.0)  # -0 is 0
    # Of equal positions one stands for all; rows as bytes sort faster than by columns.
    rows = positions.view(np.dtype((np.void, 12))).reshape(-1)
    _, first, place = np.unique(rows, return_index=True, return_inverse=True)
    vertices, welded = positions[first], place.reshape(-1)[triangles].reshape(-1, 3)
    corners = vertices[welded].astype(np.float64)
    doubled = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    finite = vertices[np.isfinite(vertices).all(axis=1)].astype(np.float64)
    span = np.ptp(finite, axis=0) if len(finite) else np.zeros(3)
    source = np.flatnonzero((doubled > NO_AREA * float(span @ span)) & np.isfinite(doubled))
    welded = welded[source]
    count = len(welded)
    start = welded.reshape(-1)
    end = welded[:, [1, 2, 0]].reshape(-1)
    owner = np.repeat(np.arange(count), 3)
    low, high = np.minimum(start, end), np.maximum(start, end)
    sign = np.where(start == low, 1, -1).astype(np.int8)
    key = low * max(len(vertices), 1) + high
    order = np.argsort(key, kind="stable")
    key, owner, sign = key[order], owner[order], sign[order]
    begins = np.flatnonzero(np.diff(key, prepend=-1)) if count else np.zeros(0, np.int64)
    sizes = np.diff(np.append(begins, len(key)))
    records = -(-sizes // 2)
    first_record = np.cumsum(records) - records
    rank = np.arange(len(key)) - np.repeat(begins, sizes)
    record = np.repeat(first_record, sizes) + rank // 2
    total = int(records.sum())
    faces, orient = np.full((total, 2), -1, np.int64), np.zeros((total, 2), np.int8)
    faces[record, rank % 2], orient[record, rank % 2] = owner, sign
    known = np.repeat(key[begins], records)
    ends = np.stack([known // max(len(vertices), 1), known % max(len(vertices), 1)], axis=1)
    name = parts_of(welded, len(vertices)) if count else np.zeros(0, np.int64)
    islands, island = np.unique(name, return_inverse=True)
    island = island.reshape(-1)
    odd = island[owner[begins[sizes % 2 == 1]]] if count else np.zeros(0, np.int64)
    closed = np.bincount(odd, minlength=len(islands)) == 0
    return MeshEdges(vertices, welded, source, ends, faces, orient, island, closed)


@dataclass(frozen=True)
class CasterEdges:
    """Edges and triangles of all opaque casters in world space, relative to the render origin."""

    corners: np.ndarray  # (T, 3, 3) float32
    planes: np.ndarray  # (T, 4) float32: unit normal and offset, N . x + d
    unseen: np.ndarray  # (T,) whether the camera may look through it: hidden from it, or transparent to it
    triangle_group: np.ndarray  # (T,)
    ends: np.ndarray  # (E, 2, 3) float32
    faces: np.ndarray  # (E, 2) triangles; -1: none
    orient: np.ndarray  # (E, 2) int8
    group: np.ndarray  # (E,)
    closed: np.ndarray  # (G,) of the groups

    def without(self, gone: np.ndarray) -> CasterEdges:
        """The same without the triangles in the mask `gone`, whose edges to others become borders."""
        if not gone.any():
            return self
        number = np.where(gone, -1, np.cumsum(~gone) - 1)
        faces = np.where(self.faces >= 0, number[self.faces], -1)
        orient = np.where(faces >= 0, self.orient, 0).astype(np.int8)
        second = faces[:, 0] < 0
        faces[second], orient[second] = faces[second][:, ::-1], orient[second][:, ::-1]
        kept = faces[:, 0] >= 0
        return CasterEdges(
            self.corners[~gone], self.planes[~gone], self.unseen[~gone], self.triangle_group[~gone],
            self.ends[kept], faces[kept], orient[kept], self.group[kept], self.closed & ~self._opened(gone),
        )  # fmt: skip

    def _opened(self, gone: np.ndarray) -> np.ndarray:
        """(G,) groups that lose a triangle."""
        return np.bincount(self.triangle_group[gone], minlength=len(self.closed)) > 0


NO_EDGES = CasterEdges(
    np.zeros((0, 3, 3), np.float32), np.zeros((0, 4), np.float32), np.zeros(0, bool), np.zeros(0, np.int64),
    np.zeros((0, 2, 3), np.float32), np.zeros((0, 2), np.int64), np.zeros((0, 2), np.int8), np.zeros(0, np.int64),
    np.zeros(0, bool),
)  # fmt: skip


def planes_of(corners: np.ndarray) -> np.ndarray:
    """(T, 4) float32 unit normals and offsets of triangles (T, 3, 3). The offset is that of the rounded normal, so that
    the plane goes through the triangle as closely as float32 allows."""
    exact = corners.astype(np.float64)
    normal = np.cross(exact[:, 1] - exact[:, 0], exact[:, 2] - exact[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    rounded = normal.astype(np.float32)
    offset = -np.einsum("tkj,tj->tk", exact, rounded.astype(np.float64)).mean(axis=1)
    return np.concatenate([rounded, offset[:, None].astype(np.float32)], axis=1)


class EdgeCache:
    """Edge tables by mesh, and those of the scene, until geometry or what blocks light changes."""

    def __init__(self):
        self._tables: dict[tuple, MeshEdges] = {}
        self._scene: tuple[object, CasterEdges] | None = None

    def casters(
        self, instances: Sequence[Instance], meshes: dict[str, Mesh], materials: Sequence[CompiledMaterial],
        origin: np.ndarray, changes: int,
    ) -> CasterEdges:  # fmt: skip
        """Edges of what blocks all light. `changes` is the geometry's count of changes: equal ones find the same."""
        blocks = np.array([not material.casts_stochastically for material in materials], bool)
        clear = np.array([bool(material.transparent) for material in materials], bool)
        key = (changes, blocks.tobytes(), clear.tobytes(), tuple(origin))
        if self._scene is not None and self._scene[0] == key:
            return self._scene[1]
        used: dict[tuple, MeshEdges] = {}
        found = []
        for instance in instances:
            mesh = meshes[instance.mesh]
            if not instance.visibility.shadow or not mesh.triangle_count or not np.isfinite(instance.matrix).all():
                continue
            material = mesh.triangle_materials(instance.materials)
            own = blocks[material]
            if not own.any():
                continue
            name = (mesh.key, mesh.version, own.tobytes())
            if name not in used:
                used[name] = self._tables.get(name) or _table_of(mesh, own)
            part = used[name]
            if len(part.triangles):
                found.append(_placed(part, instance, clear[material[part.source]], origin))
        self._tables = used
        scene = _joined(found)
        self._scene = (key, scene)
        return scene

    def release(self) -> None:
        self._tables, self._scene = {}, None


def _table_of(mesh: Mesh, own: np.ndarray) -> MeshEdges:
    """The table of the mesh's triangles in the mask `own`."""
    kept = np.flatnonzero(own)
    made = table(mesh.positions, mesh.corner_vertices[mesh.triangle_corners[kept]])
    return MeshEdges(
        made.vertices, made.triangles, kept[made.source], made.ends, made.faces, made.orient, made.island, made.closed
    )


def _placed(part: MeshEdges, instance: Instance, clear: np.ndarray, origin: np.ndarray) -> CasterEdges:
    """The table where an instance stands."""
    matrix = instance.matrix[:3].astype(np.float64)
    world = (part.vertices @ matrix[:, :3].T + (matrix[:, 3] - origin)).astype(np.float32)
    corners = world[part.triangles]
    unseen = clear | (not instance.visibility.camera)
    return CasterEdges(
        corners, planes_of(corners), unseen, part.island, world[part.ends], part.faces, part.orient,
        part.island[part.faces[:, 0]], part.closed,
    )  # fmt: skip


def _joined(parts: list[CasterEdges]) -> CasterEdges:
    """All parts as one, numbers shifted."""
    if not parts:
        return NO_EDGES
    triangles = np.cumsum([0] + [len(part.corners) for part in parts])
    groups = np.cumsum([0] + [len(part.closed) for part in parts])
    faces = [np.where(part.faces >= 0, part.faces + first, -1) for part, first in zip(parts, triangles)]
    return CasterEdges(
        np.concatenate([part.corners for part in parts]),
        np.concatenate([part.planes for part in parts]),
        np.concatenate([part.unseen for part in parts]),
        np.concatenate([part.triangle_group + first for part, first in zip(parts, groups)]),
        np.concatenate([part.ends for part in parts]),
        np.concatenate(faces),
        np.concatenate([part.orient for part in parts]),
        np.concatenate([part.group + first for part, first in zip(parts, groups)]),
        np.concatenate([part.closed for part in parts]),
    )


def too_many(snapshot) -> str | None:
    """Why this scene has no edges, as a sentence; None if it has."""
    count = snapshot.triangle_count
    if count > LARGEST:
        return f"{count} triangles with all instances are more than the {LARGEST} whose edges are streamed"
    return None
