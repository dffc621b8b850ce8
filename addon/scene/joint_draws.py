"""Surfaces of many meshes and materials in one draw, where their materials share a program.

A draw for each mesh and material costs Python and the driver more than the GPU: a scene of 28 meshes with 27 materials
has 43 of them at each point of the film, but only four programs. So the triangles of all materials of a program are
written out once, instance by instance, into one batch. Corners stay in their mesh's own space, and say which instance
is theirs, so that moving an object uploads its transform alone; which rows of the shared block hold the values of their
material stands in the bits above (shaders/surface/surface.vert.glsl). A view draws the few runs of neighbours that it
may see, and what lies between two runs, where that costs less than a call.

What cannot share is drawn as before (scene/geometry.py): materials with images, attributes or a surface of their own,
and those with layers, which are drawn at random by the number of the triangle.

| cost | |
|---|---|
| bytes | 36 a corner and 12 a triangle, of all instances: none above MOST_TRIANGLES |
| calls | 1 for each program and run |

Anew where meshes, materials of meshes, or instances come and go, not where they move.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np

from ..gfx import geometry as gfx_geometry
from ..materials.compiled import CompiledMaterial
from ..snapshot.scene import Instance
from .casters import chunks
from .culling import Boxes, joined
from .envelope import corner_shapes
from .geometry import SceneGeometry
from .materials import MaterialSet, may_share

MOST_TRIANGLES = 300_000  # of all instances
CHUNK = 600  # triangles that are culled together, about
INSTANCE_BITS = 21  # of the number that a corner has, as in surface/surface.vert.glsl


@dataclass(frozen=True)
class Part:
    """Triangles of the materials that share a program, in chunks."""

    leader: int  # the first of those materials
    batch: gfx_geometry.Batch
    first: np.ndarray  # (C + 1,) triangle with which each chunk begins; at the end their number
    own: slice  # of the chunks of all parts


@dataclass(frozen=True)
class Joint:
    """What is drawn together, and the mask of the geometry's draws that are left."""

    parts: list[Part]
    boxes: Boxes  # of the chunks of all parts
    left: np.ndarray
    leaders: np.ndarray  # by draw of the geometry: of the part that has it; -1 where none has
    members: dict[int, frozenset[int]]  # by leader of a part, the materials that it shows

    def of(self, materials: Collection[int]) -> tuple[frozenset[int], np.ndarray]:
        """Leaders of the parts that show none but these materials, and the mask of the draws that are left then."""
        whole = frozenset(leader for leader, shown in self.members.items() if shown.issubset(materials))
        return whole, ~np.isin(self.leaders, list(whole))

    def calls(
        self, rows: np.ndarray, whole: frozenset[int] | None = None
    ) -> Iterator[tuple[Part, list[tuple[int, int]]]]:
        """Parts (of these leaders) of which a view may see something, with the runs of triangles (first, count) that
        draw it."""
        seen = self.boxes.seen(rows)
        for part in self.parts:
            if whole is not None and part.leader not in whole:
                continue
            runs = joined(part.first, seen[part.own])
            if runs:
                yield part, runs


class JointDraws:
    """Those of a renderer's scene: `frame.kept(JointDraws)`."""

    def __init__(self):
        self._key: object = None
        self._bounds: object = None
        self._made: list[tuple[int, gfx_geometry.Batch, np.ndarray, np.ndarray, np.ndarray]] = []
        self._joint: Joint | None = None

    def update(self, geometry: SceneGeometry, materials: MaterialSet) -> Joint | None:
        """The draws of the scene as it is now; None where nothing can be drawn together."""
        bounds = geometry.changes, materials.sharing
        if self._bounds == bounds:
            return self._joint
        self._bounds = bounds
        together = [may_join(compiled) for compiled in materials.compiled]
        key = (geometry.drawn, *(value for k in np.flatnonzero(together) for value in
                                 (k, materials.leaders[k], materials.first_rows[k])))  # fmt: skip
        if key != self._key:
            self._key, self._made = key, _made(geometry, materials, together)
        if not self._made:
            self._joint = None
            return None
        low, high = geometry.instance_bounds
        parts, lows, highs, count = [], [], [], 0
        for leader, batch, first, rows, edges in self._made:
            lows.append(np.minimum.reduceat(low[rows], edges))
            highs.append(np.maximum.reduceat(high[rows], edges))
            parts.append(Part(leader, batch, first, slice(count, count + len(edges))))
            count += len(edges)
        left = np.array([not together[draw.material] for draw in geometry.draws], bool)
        leaders = np.array([materials.leaders[d.material] if together[d.material] else -1 for d in geometry.draws], int)
        members: dict[int, set[int]] = {}
        for draw, leader in zip(geometry.draws, leaders.tolist()):
            members.setdefault(leader, set()).add(draw.material)
        shown = {part.leader: frozenset(members.get(part.leader, ())) for part in parts}
        boxes = Boxes.between(np.concatenate(lows), np.concatenate(highs))
        self._joint = Joint(parts, boxes, left, leaders, shown)
        return self._joint

    def release(self) -> None:
        """Drop GPU resources."""
        self.__init__()


def may_join(compiled: CompiledMaterial) -> bool:
    """Whether a material's surfaces can be drawn together with those of others."""
    return may_share(compiled) and not (compiled.transparent or compiled.glass or compiled.bounds_alone)


def _kind(instance: Instance) -> tuple:
    return instance.mesh, instance.materials


def _made(geometry: SceneGeometry, materials: MaterialSet, together: list[bool]) -> list[tuple]:
    """By program: leader, batch, first triangle of each chunk, rows of the instances that have triangles, and where
    among those each chunk begins."""
    instances, meshes, _ = geometry.placed
    leaders, joins = np.array(materials.leaders), np.array(together, bool)
    if not instances or not joins.any() or len(instances) >> INSTANCE_BITS:
        return []
    if sum(meshes[instance.mesh].triangle_count for instance in instances) > MOST_TRIANGLES:
        return []
    bases = np.array(materials.first_rows, np.int32) << INSTANCE_BITS
    corners: dict[str, list[np.ndarray]] = {"position": [], "normal": [], "envelope": [], "local_instance": []}
    of_leader: dict[int, list[tuple[int, np.ndarray]]] = {}
    start, k = 0, 0
    while k < len(instances):
        mesh, slots = meshes[instances[k].mesh], instances[k].materials
        count = 1
        while k + count < len(instances) and _kind(instances[k + count]) == _kind(instances[k]):
            count += 1
        of_triangle, size = mesh.triangle_materials(slots), len(mesh.corner_vertices)
        base = np.zeros(size, np.int32)
        base[mesh.triangle_corners] = bases[of_triangle][:, None]
        numbers = np.arange(k, k + count, dtype=np.int32)
        places = mesh.positions[mesh.corner_vertices]
        corners["position"].append(np.tile(places, (count, 1)))
        corners["normal"].append(np.tile(mesh.corner_normals, (count, 1)))
        envelope = corner_shapes((mesh,), places, mesh.corner_normals, mesh.triangle_corners)
        corners["envelope"].append(np.tile(envelope, (count, 1)))
        corners["local_instance"].append((numbers[:, None] + base[None]).reshape(-1))
        for leader in np.unique(leaders[of_triangle[joins[of_triangle]]]).tolist():
            own = mesh.triangle_corners[joins[of_triangle] & (leaders[of_triangle] == leader)]
            of_leader.setdefault(leader, []).extend((k + j, own + (start + j * size)) for j in range(count))
        start += count * size
        k += count
    if not of_leader:
        return []
    vertices = gfx_geometry.vertex_buffer(**{name: np.concatenate(parts) for name, parts in corners.items()})
    made = []
    for leader, parts in sorted(of_leader.items()):
        first, edges = chunks([len(triangles) for _, triangles in parts], CHUNK)
        batch = gfx_geometry.triangle_batch(vertices, np.concatenate([triangles for _, triangles in parts]))
        made.append((leader, batch, first, np.array([row for row, _ in parts]), edges))
    return made
