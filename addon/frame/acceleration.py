"""A bounding volume hierarchy over all triangles, for rays that no depth map can answer (one direction per pixel).

Triangles are sorted along a Morton curve of their centroids, four to a leaf, and the leaves fill a complete tree with
four children per node. The tree needs no pointers: child c of node i of a level is node 4 i + c of the next, so the
whole build is a sort and a few reductions in numpy, and the shader walks it with a bit mask instead of a stack.

Instances are expanded here, at 3 x 12 bytes a triangle and copy; above LARGEST triangles there is no hierarchy.
Sources: Lauterbach et al. 2009 (linear BVH); the implicit four-wide layout is our own.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import groupby

import numpy as np

from ..gfx import images
from ..materials.compiled import CompiledMaterial
from ..snapshot.scene import Instance, Mesh
from .morton import morton_codes

LARGEST = 4_000_000  # triangles
AT_ONCE = 1 << 16  # triangles of copies that are expanded together: one by one numpy's calls take longer than its work
LEAF = 4
NODE_TEXELS = 3  # the node's grid; lower and upper corners of the four children on it
# Corner x, y, z, first edge x, y, z, second edge x, y, z of four triangles; opacity, negative for what bends light;
# emission r, g, b; material; shading normals of the three corners.
LEAF_TEXELS = 17
OPEN_TO_SHADOW, SHADOW_ALONE = 2.0, 4.0  # added to the opacity, read by shaders/trace/hierarchy.glsl
NORMAL_STEPS = 4095  # of each octahedral coordinate: two of them are exact in one float
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
    """All triangles that rays of `path` (a name of Visibility), or from their ends to lights, can meet: corners
    (T, 3, 3) float32 relative to `origin`, and (T, 8) opacity (what lets one of the two kinds of rays pass says so:
    OPEN_TO_SHADOW, SHADOW_ALONE), mean emitted radiance, number of the material and packed corner normals."""
    corners, looks = [], []
    look = np.array([
        (_opacity(m), *(m.emission if m.emissive else (0.0, 0.0, 0.0)), k)
        for k, m in enumerate(materials)
    ])  # fmt: skip
    shown = [one for one in instances if _met(one, path) and meshes[one.mesh].triangle_count]
    for (key, slots, added), group in groupby(shown, lambda one: (one.mesh, one.materials, _added(one, path))):
        mesh, slots = meshes[key], np.asarray(slots)
        look_of_triangle = look[slots[np.minimum(mesh.triangle_slots, len(slots) - 1)]]
        look_of_triangle[:, 0] += np.copysign(added, look_of_triangle[:, 0])
        copies, at_once = list(group), max(AT_ONCE // mesh.triangle_count, 1)
        for first in range(0, len(copies), at_once):
            some = copies[first : first + at_once]
            matrices = np.stack([one.matrix[:3] for one in some])
            turned, moved = matrices[:, :, :3], (matrices[:, :, 3] - origin).astype(np.float32)
            world = mesh.positions @ turned.transpose(0, 2, 1).astype(np.float32) + moved[:, None]
            corners.append(world[:, mesh.corner_vertices[mesh.triangle_corners]].reshape(-1, 3, 3))
            normals = _packed_normals(mesh.corner_normals @ _cofactors(turned).transpose(0, 2, 1))
            of_triangle = np.broadcast_to(look_of_triangle, (len(some), *look_of_triangle.shape))
            looks.append(np.concatenate([of_triangle, normals[:, mesh.triangle_corners]], axis=2).reshape(-1, 8))
    if not corners:
        return np.zeros((0, 3, 3), np.float32), np.zeros((0, 8))
    return np.concatenate(corners).astype(np.float32, copy=False), np.concatenate(looks)


def _met(instance: Instance, path: str) -> bool:
    return getattr(instance.visibility, path) or instance.visibility.shadow


def _added(instance: Instance, path: str) -> float:
    """What is added to the opacity of an instance that only one kind of rays meets."""
    if not getattr(instance.visibility, path):
        return SHADOW_ALONE
    return 0.0 if instance.visibility.shadow else OPEN_TO_SHADOW


def _opacity(material: CompiledMaterial) -> float:
    """Mean coverage for rays that pass at random; negative where rays may also be bent."""
    opacity = material.opacity if material.transparent else 1.0
    return -max(opacity, 1e-3) if material.glass else opacity


def _cofactors(matrices: np.ndarray) -> np.ndarray:
    """(K, 3, 3) that take normals to world space, outwards where an object is mirrored; also where it is flattened."""
    a, b, c = np.moveaxis(matrices, 2, 0)
    columns = np.cross(b, c), np.cross(c, a), np.cross(a, b)
    mirrored = (a * columns[0]).sum(axis=1) < 0
    return np.stack(columns, axis=2) * np.where(mirrored, -1.0, 1.0)[:, None, None]


def _packed_normals(normals: np.ndarray) -> np.ndarray:
    """(..., 3) of any length as (...) numbers: octahedral coordinates side by side; unpacked in shaders/trace."""
    flat = normals / np.maximum(np.abs(normals).sum(axis=-1, keepdims=True), 1e-30)
    folded = (1.0 - np.abs(flat[..., 1::-1])) * np.where(flat[..., :2] >= 0.0, 1.0, -1.0)
    square = np.where(flat[..., 2:] >= 0.0, flat[..., :2], folded)
    steps = np.floor((square * 0.5 + 0.5) * NORMAL_STEPS + 0.5)
    return np.nan_to_num(steps[..., 0] + (NORMAL_STEPS + 1) * steps[..., 1])


def build(corners: np.ndarray, look: np.ndarray) -> Hierarchy:
    """The hierarchy of `corners` (T, 3, 3) with opacity, emission, material and normals `look` (T, 8)."""
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
    looks = np.zeros((used * LEAF, look.shape[1]), np.float32)
    looks[:count] = look[order]
    packed[:, 9:] = looks.reshape(used, LEAF, -1).transpose(0, 2, 1)

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

    Rays of glossy, diffuse and transmission paths meet different objects only where an artist hid some from one.
    """

    def __init__(self):
        self._kept: dict[object, Hierarchy] = {}

    def get(self, snapshot, materials: list[CompiledMaterial], origin: np.ndarray, path: str) -> Hierarchy | None:
        """The hierarchy of what rays of `path` can meet; None where there are too many triangles (see `too_many`)."""
        if too_many(snapshot):
            return None
        key = (
            tuple((i.mesh, snapshot.meshes[i.mesh].version, i.matrix.tobytes(), i.materials, _added(i, path))
                  for i in snapshot.instances if _met(i, path)),
            tuple((_opacity(m), m.emissive and m.emission) for m in materials), tuple(origin),
        )  # fmt: skip
        if key not in self._kept:
            triangles = world_triangles(list(snapshot.instances), snapshot.meshes, materials, origin, path)
            # At most one for each path; the oldest one, of another scene, goes.
            self._kept = dict([*self._kept.items()][-3:]) | {key: build(*triangles)}
        return self._kept[key]

    def release(self) -> None:
        self._kept = {}


def too_many(snapshot) -> str | None:
    """Why this scene has no hierarchy, as a sentence; None if it has."""
    count = snapshot.triangle_count
    if count > LARGEST:
        return f"{count} triangles with all instances are more than the {LARGEST} that can be traced"
    return None
