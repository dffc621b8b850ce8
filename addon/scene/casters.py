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
from .culling import Boxes, closed_triangles, joined

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

    def calls(self, seen: np.ndarray) -> list[tuple[int, int]]:
        """The same with what lies between two runs where that is cheaper (culling.joined)."""
        return joined(np.minimum(np.arange(len(seen) + 1) * CLUSTER, self.batch.triangles), seen)


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
    opaque = ~np.array([material.casts_stochastically for material in materials])
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
class Together:
    """Opaque casters of many meshes in one batch, their vertices in the space of their mesh, with the number of their
    instance: what moves uploads nothing here. Chunks are culled together."""

    batch: gfx_geometry.Batch
    first: np.ndarray  # (C + 1,) triangle with which each chunk begins; at the end their number
    rows: np.ndarray  # (M,) instances
    edges: np.ndarray  # (C,) where among those each chunk begins
    closed: bool


MOST_TOGETHER, CHUNK = 300_000, 600  # triangles of all instances; of a chunk, about


def together(
    instances: list[Instance], meshes: dict[str, Mesh], materials: list[CompiledMaterial], shell: np.ndarray
) -> list[Together]:
    """Of closed meshes that are opaque all over (`shell`, by instance), and of others. None of too many."""
    if sum(meshes[instance.mesh].triangle_count for instance in instances) > MOST_TOGETHER:
        return []
    opaque = ~np.array([material.casts_stochastically for material in materials], bool)
    positions, numbers, start = [], [], 0
    sorts: dict[bool, list[tuple[int, np.ndarray]]] = {True: [], False: []}
    known: dict[tuple, np.ndarray] = {}
    for k, instance in enumerate(instances):
        mesh, kind = meshes[instance.mesh], (instance.mesh, instance.materials)
        if kind not in known:
            blocks = opaque[mesh.triangle_materials(instance.materials)]
            known[kind] = mesh.corner_vertices[mesh.triangle_corners][blocks]
        if len(known[kind]):
            positions.append(mesh.positions)
            numbers.append(np.full(len(mesh.positions), k, np.int32))
            sorts[bool(shell[k])].append((k, known[kind] + start))
            start += len(mesh.positions)
    if not positions:
        return []
    vertices = gfx_geometry.vertex_buffer(position=np.concatenate(positions), local_instance=np.concatenate(numbers))
    found = []
    for is_closed, parts in sorts.items():
        if parts:
            first, edges = chunks([len(triangles) for _, triangles in parts], CHUNK)
            batch = gfx_geometry.triangle_batch(vertices, np.concatenate([triangles for _, triangles in parts]))
            found.append(Together(batch, first, np.array([k for k, _ in parts]), edges, is_closed))
    return found


def chunks(sizes: list[int], chunk: int) -> tuple[np.ndarray, np.ndarray]:
    """Cut parts of so many triangles into chunks of about `chunk`: the first triangle of each (C + 1,), and the part
    with which it begins (C,)."""
    before = np.cumsum(sizes) - sizes
    edges = np.flatnonzero(np.diff(before // chunk, prepend=-1))
    return np.append(before[edges], sum(sizes)), edges


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
