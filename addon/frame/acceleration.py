"""A bounding volume hierarchy over all triangles, for rays that no depth map can answer (one direction per pixel).

Triangles are sorted along a Morton curve of their centroids, four to a leaf, and the leaves fill a complete tree with
four children per node. The tree needs no pointers: child c of node i of a level is node 4 i + c of the next, so the
whole build is a sort and a few reductions in numpy, and the shader walks it with a bit mask instead of a stack.

Instances are expanded here, at 3 x 12 bytes a triangle and copy; above LARGEST triangles there is no hierarchy.
Sources: Lauterbach et al. 2009 (linear BVH); the implicit four-wide layout is our own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..gfx import images
from ..materials.compiled import CompiledMaterial
from ..snapshot.scene import Instance, Mesh
from .morton import morton_codes

LARGEST = 4_000_000  # triangles
LEAF = 4
NODE_TEXELS = 3  # the node's grid; lower and upper corners of the four children on it
# Corner x, y, z, first edge x, y, z, second edge x, y, z of four triangles; opacity; emission r, g, b; material.
LEAF_TEXELS = 14
EMPTY = 1e30


@dataclass(frozen=True)
class Hierarchy:
    """The tree in two images; `levels` counts inner levels (the root is level 0), `leaves` on level `levels`."""

    nodes: images.Image
    leaves: images.Image
    levels: int
    triangles: int


def world_triangles(
    instances: list[Instance],
    meshes: dict[str, Mesh],
    materials: list[CompiledMaterial],
    origin: np.ndarray,
    path: str = "glossy",
) -> tuple[np.ndarray, np.ndarray]:
    """All triangles that rays of `path` (a name of Visibility) can meet: corners (T, 3, 3) float32 relative to
    `origin`, and (T, 5) opacity, mean emitted radiance and number of the material."""
    corners, looks = [], []
    look = np.array([
        (m.opacity if m.transparent else 1.0, *(m.emission if m.emissive else (0.0, 0.0, 0.0)), k)
        for k, m in enumerate(materials)
    ])  # fmt: skip
    for instance in instances:
        mesh = meshes[instance.mesh]
        if not getattr(instance.visibility, path) or not mesh.triangle_count:
            continue
        matrix = instance.matrix.copy()
        matrix[:3, 3] -= origin
        world = mesh.positions @ matrix[:3, :3].T.astype(np.float32) + matrix[:3, 3].astype(np.float32)
        corners.append(world[mesh.corner_vertices[mesh.triangle_corners]])
        slots = np.asarray(instance.materials)
        looks.append(look[slots[np.minimum(mesh.triangle_slots, len(slots) - 1)]])
    if not corners:
        return np.zeros((0, 3, 3), np.float32), np.zeros((0, 5))
    return np.concatenate(corners).astype(np.float32, copy=False), np.concatenate(looks)


def build(corners: np.ndarray, look: np.ndarray) -> Hierarchy:
    """The hierarchy of `corners` (T, 3, 3) with opacity, emission and material `look` (T, 5)."""
    finite = np.isfinite(corners).all(axis=(1, 2))
    corners, look = corners[finite], look[finite]
    low, high = corners.min(axis=1), corners.max(axis=1)
    order = np.argsort(morton_codes((low + high) * 0.5), kind="stable")
    count = len(corners)
    levels = 1
    while LEAF * 4**levels < count:
        levels += 1
    slots = LEAF * 4**levels
    used = -(-max(count, 1) // LEAF)
    packed = np.zeros((used, LEAF_TEXELS, LEAF), np.float32)  # zero edges: never hit
    sorted_corners = np.zeros((used * LEAF, 3, 3), np.float32)
    sorted_corners[:count] = corners[order]
    first = sorted_corners[:, 0]
    edges = sorted_corners[:, 1:] - first[:, None]
    for axis in range(3):
        packed[:, axis] = first[:, axis].reshape(used, LEAF)
        packed[:, 3 + axis] = edges[:, 0, axis].reshape(used, LEAF)
        packed[:, 6 + axis] = edges[:, 1, axis].reshape(used, LEAF)
    looks = np.zeros((used * LEAF, 5), np.float32)
    looks[:count] = look[order]
    packed[:, 9:14] = looks.reshape(used, LEAF, 5).transpose(0, 2, 1)

    box_low = np.full((slots, 3), EMPTY, np.float32)
    box_high = np.full((slots, 3), -EMPTY, np.float32)
    box_low[:count], box_high[:count] = low[order], high[order]
    box_low, box_high = box_low.reshape(-1, LEAF, 3).min(axis=1), box_high.reshape(-1, LEAF, 3).max(axis=1)
    nodes = []
    reach = max(np.abs(box_low[:used]).max(initial=0.0), np.abs(box_high[:used]).max(initial=0.0))
    least = max(1e-6 * float(reach), 1e-30)
    for _ in range(levels):
        children_low, children_high = box_low.reshape(-1, 4, 3), box_high.reshape(-1, 4, 3)
        nodes.append(_packed_boxes(children_low, children_high, least))
        box_low, box_high = children_low.min(axis=1), children_high.max(axis=1)
    rows = np.concatenate(nodes[::-1]).reshape(-1, 4)  # root first
    return Hierarchy(images.upload_list(rows), images.upload_list(packed.reshape(-1, 4)), levels, count)


def _packed_boxes(low: np.ndarray, high: np.ndarray, least: float) -> np.ndarray:
    """Boxes of four children per node, (N, 4, 3), as (N, NODE_TEXELS, 4); see node_meets in shaders/trace.

    A step of the grid is a power of two, so that the shader's arithmetic is exact but for the last addition; the grid
    starts a little below the node's corner and boxes are rounded outwards. Extents below `least` metres count as that.
    """
    empty = (low > high).any(axis=2)
    corner = np.where(empty.all(axis=1)[:, None], 0.0, low.min(axis=1)).astype(np.float64)
    extent = np.where(empty.all(axis=1)[:, None], 0.0, high.max(axis=1) - corner)
    exponent = np.clip(np.ceil(np.log2(np.maximum(extent, least) / 250.0)), -126, 127)
    step = np.exp2(exponent)
    corner = (corner - 0.5 * step).astype(np.float32)
    start = corner.astype(np.float64)[:, None]
    first = np.clip(np.floor((low - start) / step[:, None] - 0.01), 0, 255)
    last = np.clip(np.ceil((high - start) / step[:, None] + 0.01), 0, 255)
    first[empty], last[empty] = 255, 0
    byte = np.array([1.0, 256.0, 65536.0])
    packed = np.zeros((len(low), NODE_TEXELS, 4), np.float32)
    packed[:, 0, :3] = corner
    packed[:, 0, 3] = (exponent + 127) @ byte
    packed[:, 1], packed[:, 2] = first @ byte, last @ byte
    return packed


class HierarchyCache:
    """The hierarchies of a renderer's scene: built when first asked for, kept until geometry or alpha changes.

    Rays of glossy and of diffuse paths meet different objects only where an artist hid some from one of them.
    """

    def __init__(self):
        self._kept: dict[object, Hierarchy] = {}

    def get(self, snapshot, materials: list[CompiledMaterial], origin: np.ndarray, path: str) -> Hierarchy | None:
        """The hierarchy of what rays of `path` can meet; None where there are too many triangles (see `too_many`)."""
        if too_many(snapshot):
            return None
        key = (
            tuple((i.mesh, snapshot.meshes[i.mesh].version, i.matrix.tobytes(), i.materials) for i in snapshot.instances
                  if getattr(i.visibility, path)),
            tuple((m.opacity if m.transparent else 1.0, m.emissive and m.emission) for m in materials), tuple(origin),
        )  # fmt: skip
        if key not in self._kept:
            triangles = world_triangles(list(snapshot.instances), snapshot.meshes, materials, origin, path)
            # At most one for each path; the oldest one, of another scene, goes.
            self._kept = dict([*self._kept.items()][-2:]) | {key: build(*triangles)}
        return self._kept[key]

    def release(self) -> None:
        self._kept = {}


def too_many(snapshot) -> str | None:
    """Why this scene has no hierarchy, as a sentence; None if it has."""
    count = sum(snapshot.meshes[instance.mesh].triangle_count for instance in snapshot.instances)
    if count > LARGEST:
        return f"{count} triangles with all instances are more than the {LARGEST} that can be traced"
    return None
