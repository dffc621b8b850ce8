"""Opaque casters at rest: their triangles in world space, ordered along a space-filling curve, in clusters.

Accumulation draws the same casters into hundreds of depth maps. Drawn object by object, a map pays for whatever the
bounds of large objects touch, and every vertex fetches its transform. Once geometry stands still for a second sample,
its opaque triangles are therefore written out once, neighbours side by side: a view draws the few runs of clusters that
it sees, each vertex is three numbers, and a call covers many objects. While objects move, and in scenes above LARGEST
triangles (instances counted), casters are drawn as instances instead (depth_maps.py); both give the same maps.

Closed meshes and closed parts of others stand apart, so that their back faces can be left out (culling.py).

Costs 12 bytes a vertex and 12 a triangle, and a sort when geometry has changed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from ..gfx import geometry as gfx_geometry
from ..kernels.morton import morton_codes
from ..materials.compiled import CompiledMaterial
from ..snapshot.scene import Instance, Mesh
from .culling import Boxes, closed_triangles

LARGEST = 2_000_000  # triangles
NOBODY = np.zeros(0, np.int64)
CLUSTER = 256  # triangles: enough to keep a GPU busy, few enough to cull


@dataclass(frozen=True)
class Clusters:
    """Triangles of one vertex buffer; cluster k holds CLUSTER triangles from k * CLUSTER on, the last one fewer."""

    batch: gfx_geometry.Batch
    boxes: Boxes  # of the clusters
    shells: Boxes | None = None  # of the objects (P), if all triangles belong to closed parts; else back faces count
    # Which objects have triangles in which cluster, (M,) each.
    member_clusters: np.ndarray = field(default_factory=lambda: NOBODY)
    member_objects: np.ndarray = field(default_factory=lambda: NOBODY)

    def one_sided(self, light_point: np.ndarray | None) -> np.ndarray:
        """(C,) where back faces may be left out: the light (None: at infinity) stands outside of all objects there."""
        count = len(self.boxes.centre)
        if self.shells is None or light_point is None:
            return np.full(count, self.shells is not None)
        around = ~self.shells.without(light_point)
        return np.bincount(self.member_clusters[around[self.member_objects]], minlength=count) == 0

    def runs(self, seen: np.ndarray) -> Iterator[tuple[int, int]]:
        """First triangle and number of triangles for each run of clusters in the mask `seen`."""
        edges = np.flatnonzero(np.diff(np.concatenate([[False], seen, [False]])))
        for start, end in edges.reshape(-1, 2):
            yield int(start) * CLUSTER, min(int(end) * CLUSTER, self.batch.triangles) - int(start) * CLUSTER


def clusters(
    instances: list[Instance], meshes: dict[str, Mesh], materials: list[CompiledMaterial], origin: np.ndarray
) -> list[Clusters] | None:
    """Clusters of what blocks all light, positions relative to `origin`: of closed meshes and parts, and of others.

    None where that would be more than LARGEST triangles.
    """
    if sum(meshes[instance.mesh].triangle_count for instance in instances) > LARGEST:
        return None
    known: dict[str, np.ndarray] = {}
    sorts: dict[bool, list[_Part]] = {True: [], False: []}  # closed or not
    opaque = ~np.array([material.casts_by_lot for material in materials])
    for instance in instances:
        mesh = meshes[instance.mesh]
        if not instance.visibility.shadow or not mesh.triangle_count or not np.isfinite(instance.matrix).all():
            continue
        blocks = opaque[mesh.triangle_materials(instance.materials)]
        if not blocks.any():
            continue
        if mesh.key not in known:
            known[mesh.key] = closed_triangles(mesh)
        matrix = instance.matrix.copy()
        matrix[:3, 3] -= origin
        world = mesh.positions @ matrix[:3, :3].T.astype(np.float32) + matrix[:3, 3].astype(np.float32)
        triangles = mesh.corner_vertices[mesh.triangle_corners]
        if np.linalg.det(matrix[:3, :3]) < 0.0:
            triangles = triangles[:, ::-1]
        # What lets light pass is drawn elsewhere, and what is left of its mesh need not be closed any more.
        whole = known[mesh.key] & blocks.all()
        for is_closed in (True, False):
            own = blocks & (whole == is_closed)
            if own.any():
                sorts[is_closed].append(_Part(world, triangles[own]))
    return [_cluster(parts, is_closed) for is_closed, parts in sorts.items() if parts]


@dataclass(frozen=True)
class _Part:
    world: np.ndarray  # (V, 3) positions
    triangles: np.ndarray  # (T, 3) vertices


def _cluster(parts: list[_Part], is_closed: bool) -> Clusters:
    start = np.cumsum([0] + [len(part.world) for part in parts])
    positions = np.concatenate([part.world for part in parts]).astype(np.float32, copy=False)
    triangles = np.concatenate([part.triangles + first for part, first in zip(parts, start)])
    corners = positions[triangles]
    low, high = corners.min(axis=1), corners.max(axis=1)
    order = np.argsort(morton_codes(np.nan_to_num((low + high) * 0.5)), kind="stable")
    triangles, low, high = triangles[order], low[order], high[order]
    first = np.arange(0, len(triangles), CLUSTER)
    boxes = Boxes.between(np.fmin.reduceat(low, first), np.fmax.reduceat(high, first))
    # Vertices in the order of their use: neighbours in space are then neighbours in memory.
    used, place = np.unique(triangles, return_inverse=True)
    rank = np.full(len(used), len(triangles) * 3, np.int64)
    np.minimum.at(rank, place.reshape(-1), np.arange(place.size))
    turn = np.argsort(rank, kind="stable")
    where = np.empty(len(used), np.int32)
    where[turn] = np.arange(len(used), dtype=np.int32)
    vertices = gfx_geometry.vertex_buffer(position=positions[used[turn]])
    batch = gfx_geometry.triangle_batch(vertices, where[place.reshape(-1, 3)])
    if not is_closed:
        return Clusters(batch, boxes)
    low, high = [part.world.min(axis=0) for part in parts], [part.world.max(axis=0) for part in parts]
    owner = np.repeat(np.arange(len(parts)), [len(part.triangles) for part in parts])[order]
    members = np.unique(np.arange(len(owner)) // CLUSTER * len(parts) + owner)
    return Clusters(batch, boxes, Boxes.between(low, high), members // len(parts), members % len(parts))
