"""A bounding volume hierarchy over all triangles, for rays that no depth map can answer (one direction per pixel).

Its shape is that of box_tree.py, four children to a node and up to four triangles to a leaf. Boxes of children are
bytes on a grid of their node. Triangles that moved may keep their places: boxes are made anew from the leaves up.

Instances are expanded here, at 3 x 12 bytes a triangle and copy; above LARGEST triangles there is no hierarchy.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from ..gfx import images
from ..materials.compiled import CompiledMaterial
from ..snapshot.scene import Instance, Mesh
from . import box_tree
from .box_tree import LEAF
from .emission_maps import EmissionMaps, TriangleEmission
from .opacity_maps import OpacityMaps, TriangleOpacity

LARGEST = 4_000_000  # triangles
AT_ONCE = 1 << 16  # triangles of copies that are expanded together: one by one numpy's calls take longer than its work
MOST_REFITTED = 200_000  # triangles of a tree whose parts are kept, some 100 bytes each
# What shaders/trace/hierarchy.glsl reads; first among a program's textures, since rays ask for most of its texels.
HIERARCHY_TEXTURES = (("RGBA32F", "trace_nodes"), ("RGBA32F", "trace_leaves"))
# The node's grid; lower and upper corners of the four children on it; number of the first child that is a node, of the
# first one that is a leaf, and how many are nodes: those come first.
NODE_TEXELS = 4
# Corner x, y, z, first edge x, y, z, second edge x, y, z of four triangles; opacity (_codes); emission r, g, b;
# material (and _emission); shading normals of the three corners.
LEAF_TEXELS = 17
# Which rays a triangle stops: all, all but those to lights, those alone, all and those to lights for certain.
ALL_RAYS, OPEN_TO_SHADOW, SHADOW_ALONE, WHOLE_SHADOW = range(4)
MAPPED = 4  # added to the above: what follows is a tile of OpacityMaps
FRONT_ALONE = 0.25  # added to the material's number
SIDE_STEPS = 2047  # of the opacity of a side: those of two, and the above, are exact in one float
NORMAL_STEPS = 4095  # of each octahedral coordinate: two of them are exact in one float
EMPTY = 1e30
# For programs that trace rays among triangles with tiles; others are a tenth faster without.
TILED = (("OPACITY_TILES", "1"),)
NO_TILES = np.zeros((0, 4), np.float32)


@dataclass(frozen=True)
class Hierarchy:
    """The tree in two images."""

    nodes: images.Image
    leaves: images.Image
    triangles: int
    # For who needs more of a triangle than leaves hold (surfaces/hits.py): the place of each triangle of `instances`,
    # in their order, among the slots of the leaves (LEAF each; -1: left out); the first one is that of `first_leaf`.
    slots: np.ndarray | None = None  # (T,) int32
    first_leaf: int = 0
    instances: tuple[Instance, ...] = ()

    @property
    def textures(self) -> dict[str, images.Image]:
        """What HIERARCHY_TEXTURES binds."""
        return {"trace_nodes": self.nodes, "trace_leaves": self.leaves}


def world_triangles(
    instances: list[Instance],
    meshes: dict[str, Mesh],
    materials: list[CompiledMaterial],
    origin: np.ndarray,
    path: str,
    maps: OpacityMaps,
    glow: EmissionMaps,
) -> tuple[np.ndarray, np.ndarray]:
    """All triangles that rays of `path` (a name of Visibility), or from their ends to lights, can meet: corners
    (T, 3, 3) float32 relative to `origin`, and (T, 8) opacity (_codes), mean emitted radiance, number of the material
    (with the side that emits, _emission) and packed corner normals."""
    corners, looks = [], []
    look = {
        (rays, mirrored): np.array([
            (_mean_code(m, rays), *radiance, k + side)
            for k, m in enumerate(materials)
            for radiance, side in [_emission(m, mirrored)]
        ])
        for rays in (ALL_RAYS, OPEN_TO_SHADOW, SHADOW_ALONE)
        for mirrored in (False, True)
    }  # fmt: skip
    shown = [one for one in instances if _met(one, path) and meshes[one.mesh].triangle_count]
    # Of instances with equal kinds all triangles look the same.
    turns = np.linalg.det([one.matrix[:3, :3] for one in shown]) if shown else ()
    kinds = zip(shown, (
        (*maps.kind_of(one), glow.kind_of(one), _rays(one, path), turn < 0.0) for one, turn in zip(shown, turns)
    ))  # fmt: skip
    for (key, slots, _, _, rays, mirrored), group in groupby(kinds, lambda pair: pair[1]):
        mesh = meshes[key]
        of_triangle = mesh.triangle_materials(slots)
        look_of_triangle = look[rays, bool(mirrored)][of_triangle]
        copies, at_once = [one for one, _ in group], max(AT_ONCE // mesh.triangle_count, 1)
        known = maps.of(copies[0])
        if known is not None:
            _refine(look_of_triangle, of_triangle, materials, known, rays, bool(mirrored))
        shining = glow.of(copies[0])
        if shining is not None:
            _shine(look_of_triangle, of_triangle, shining, bool(mirrored))
        for first in range(0, len(copies), at_once):
            some = copies[first : first + at_once]
            matrices = np.stack([one.matrix[:3] for one in some])
            turned, moved = matrices[:, :, :3], (matrices[:, :, 3] - origin).astype(np.float32)
            world = mesh.positions @ turned.transpose(0, 2, 1).astype(np.float32) + moved[:, None]
            corners.append(world[:, mesh.corner_vertices[mesh.triangle_corners]].reshape(-1, 3, 3))
            normals = _packed_normals(mesh.corner_normals @ _cofactors(turned).transpose(0, 2, 1))
            of_copies = np.broadcast_to(look_of_triangle, (len(some), *look_of_triangle.shape))
            looks.append(np.concatenate([of_copies, normals[:, mesh.triangle_corners]], axis=2).reshape(-1, 8))
    if not corners:
        return np.zeros((0, 3, 3), np.float32), np.zeros((0, 8))
    return np.concatenate(corners).astype(np.float32, copy=False), np.concatenate(looks)


def _met(instance: Instance, path: str) -> bool:
    return getattr(instance.visibility, path) or instance.visibility.shadow


def _rays(instance: Instance, path: str) -> int:
    """Which rays meet an instance."""
    if not getattr(instance.visibility, path):
        return SHADOW_ALONE
    return ALL_RAYS if instance.visibility.shadow else OPEN_TO_SHADOW


def _mean_code(material: CompiledMaterial, rays: int = ALL_RAYS) -> float:
    """The code of triangles of a material of which no more is known than its mean opacity."""
    if not material.transparent:
        return float(_codes(rays, np.ones(2), False, False))
    stopped, whole = _stopped(material, rays)
    opacity = 1.0 if whole else min(material.opacity, 1.0 - 1.0 / SIDE_STEPS)  # some ray may pass, however few
    return float(_codes(stopped, np.full(2, opacity), False, material.glass is not None))


def opaque_code() -> float:
    """The code of triangles that stop every ray."""
    return float(_codes(ALL_RAYS, np.ones(2), False, False))


def _stopped(material: CompiledMaterial, rays: int) -> tuple[int, bool]:
    """Which rays a transparent material's triangles stop, and whether they stop those wherever they meet them."""
    if material.casts_by_lot or material.glass:
        return rays, False
    return (WHOLE_SHADOW if rays == ALL_RAYS else rays), rays == SHADOW_ALONE


def _codes(stopped: int, sides: np.ndarray, mirrored: bool, glass: bool, tile=0) -> np.ndarray:
    """What decides whether rays pass triangles, as shaders/trace/hierarchy.glsl reads it: coverage (..., 2) of front
    and back by which they pass at random, or, where it is not 0, the `tile` (...) that tells it for each place, and
    which rays that is about; negative where rays may also be bent. `mirrored`: corners run the other way round."""
    steps = np.rint(np.clip(sides[..., ::-1] if mirrored else sides, 0.0, 1.0) * SIDE_STEPS)
    even = (stopped * (SIDE_STEPS + 1) + steps[..., 0]) * (SIDE_STEPS + 1) + steps[..., 1]
    # Twice a whole number: beyond 2^24 every second one is a float.
    tiled = (MAPPED + stopped) * (SIDE_STEPS + 1) ** 2 + 2 * (2 * np.asarray(tile) + mirrored)
    codes = np.where(np.asarray(tile) > 0, tiled, even).astype(float)
    return -np.maximum(codes, 1.0) if glass else codes


def _refine(
    look: np.ndarray,
    of_triangle: np.ndarray,
    materials: list[CompiledMaterial],
    known: TriangleOpacity,
    rays: int,
    mirrored: bool,
) -> None:
    """Put what OpacityMaps found of an instance's triangles, `known`, into their rows of `look`."""
    for number in np.unique(of_triangle[known.measured]):
        material = materials[number]
        stopped, whole = _stopped(material, rays)
        if not whole:
            own = np.flatnonzero(known.measured & (of_triangle == number))
            glass = material.glass is not None
            look[own, 0] = _codes(stopped, known.sides[own], mirrored, glass, known.tile[own])


def _emission(material: CompiledMaterial, mirrored: bool = False) -> tuple[tuple[float, float, float], float]:
    """Mean radiance that a triangle emits, and what is added to the number of its material where it does so to one side
    only: FRONT_ALONE or -FRONT_ALONE. Of two sides that both shine the mean stands for either."""
    front, behind = material.emission, material.emission_behind
    if not material.emissive:
        return (0.0, 0.0, 0.0), 0.0
    if front == behind or (any(front) and any(behind)):
        return tuple((a + b) / 2 for a, b in zip(front, behind)), 0.0
    side = FRONT_ALONE if any(front) else -FRONT_ALONE
    return (front if any(front) else behind), -side if mirrored else side


def _shine(look: np.ndarray, of_triangle: np.ndarray, known: TriangleEmission, mirrored: bool) -> None:
    """Put what EmissionMaps found of an instance's triangles, `known`, into their rows of `look`, as _emission does."""
    own = np.flatnonzero(known.measured)
    front, behind = known.mean[own, 0], known.mean[own, 1]
    lit, lit_behind = front.any(axis=1), behind.any(axis=1)
    both = (lit & lit_behind)[:, None]
    look[own, 1:4] = np.where(both, (front + behind) / 2, front + behind)
    side = FRONT_ALONE * (lit.astype(float) - lit_behind)
    look[own, 4] = of_triangle[own] + (-side if mirrored else side)


def coverage(codes: np.ndarray, maps: OpacityMaps) -> np.ndarray:
    """(N,) mean of the two sides' opacity, of what world_triangles says of (N,) triangles."""
    sides = np.abs(codes) % (SIDE_STEPS + 1) ** 2
    mean = (sides // (SIDE_STEPS + 1) + sides % (SIDE_STEPS + 1)) / (2 * SIDE_STEPS)
    tiled = np.abs(codes) >= MAPPED * (SIDE_STEPS + 1) ** 2
    if tiled.any():
        mean[tiled] = maps.means[(sides[tiled] / 4).astype(int)]
    return mean


def _empty(codes: np.ndarray) -> np.ndarray:
    """(N,) triangles that no ray can meet."""
    return (codes >= 0) & (codes % (SIDE_STEPS + 1) ** 2 == 0) & (codes < WHOLE_SHADOW * (SIDE_STEPS + 1) ** 2)


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


@dataclass
class Tree:
    """A hierarchy with what it was made of, so that triangles that moved can be put in their old places.

    Of a tree of more than MOST_REFITTED triangles HierarchyCache keeps the hierarchy alone: all other fields are None
    then.
    """

    hierarchy: Hierarchy
    boxes: box_tree.BoxTree | None
    place: np.ndarray | None  # (T,) of each triangle among the slots of the leaves; -1: left out
    leaves: np.ndarray | None  # (L, LEAF_TEXELS, LEAF)
    low: np.ndarray | None  # (slots, 3) of the triangle in each
    high: np.ndarray | None
    tiles: np.ndarray  # (N, 4) texels of OpacityMaps, before the leaves: a whole number of leaves
    refitted: bool = False
    nodes: np.ndarray | None = None  # (N, NODE_TEXELS, 4)


def build(corners: np.ndarray, look: np.ndarray, tiles: np.ndarray = NO_TILES) -> Tree:
    """The hierarchy of `corners` (T, 3, 3) with opacity, emission, material and normals `look` (T, 8); `tiles` are the
    texels of OpacityMaps that opacity codes tell of."""
    shown = np.flatnonzero(_shown(corners, look))
    boxes = box_tree.build(corners[shown].min(axis=1), corners[shown].max(axis=1))
    place = np.full(len(corners), -1)
    place[shown] = boxes.place
    leaves = np.zeros((max(boxes.leaf_count, 1), LEAF_TEXELS, LEAF), np.float32)  # zero edges: never hit
    low = np.full((boxes.leaf_count * LEAF, 3), EMPTY, np.float32)
    hierarchy = Hierarchy(None, None, len(shown))
    tiles = np.pad(tiles, ((0, -len(tiles) % LEAF_TEXELS), (0, 0)))
    return _written(Tree(hierarchy, boxes, place, leaves, low, -low, tiles), boxes.place, corners[shown], look[shown])


def refit(tree: Tree, numbers: np.ndarray, corners: np.ndarray, look: np.ndarray) -> Tree | None:
    """The tree with triangles `numbers` (N,) elsewhere, at the cost of larger boxes; `tree` itself is used up. None
    where other triangles than before can be met."""
    shown = _shown(corners, look)
    if ((tree.place[numbers] >= 0) != shown).any():
        return None
    return _written(replace(tree, refitted=True), tree.place[numbers][shown], corners[shown], look[shown])


def _shown(corners: np.ndarray, look: np.ndarray) -> np.ndarray:
    """(T,) which triangles some ray can meet."""
    return np.isfinite(corners).all(axis=(1, 2)) & ~_empty(look[:, 0])


def _written(tree: Tree, place: np.ndarray, corners: np.ndarray, look: np.ndarray) -> Tree:
    """Write triangles (N, 3, 3) and their looks (N, 8) to their places (N,), and the tree to the GPU."""
    leaf, slot = place // LEAF, place % LEAF
    tree.leaves[leaf, :3, slot] = corners[:, 0]
    tree.leaves[leaf, 3:6, slot] = corners[:, 1] - corners[:, 0]
    tree.leaves[leaf, 6:9, slot] = corners[:, 2] - corners[:, 0]
    tree.leaves[leaf, 9:, slot] = look
    tree.low[place], tree.high[place] = corners.min(axis=1), corners.max(axis=1)

    leaf_low, leaf_high = tree.low.reshape(-1, LEAF, 3).min(axis=1), tree.high.reshape(-1, LEAF, 3).max(axis=1)
    reach = max(np.abs(leaf_low).max(initial=0.0), np.abs(leaf_high).max(initial=0.0))
    low, high = (
        tree.boxes.of_children(*ends) for ends in ((leaf_low, np.minimum, EMPTY), (leaf_high, np.maximum, -EMPTY))
    )
    rows = np.zeros((len(low), NODE_TEXELS, 4), np.float32)
    _pack_boxes(rows, low, high, max(1e-6 * float(reach), 1e-30))
    rows[:, 3, 0], rows[:, 3, 2] = tree.boxes.first_node, tree.boxes.nodes
    rows[:, 3, 1] = tree.boxes.first_leaf + len(tree.tiles) // LEAF_TEXELS
    leaves = np.concatenate([tree.tiles, tree.leaves.reshape(-1, 4)]) if len(tree.tiles) else tree.leaves
    nodes, leaves = (images.upload_list(texels.reshape(-1, 4)) for texels in (rows, leaves))
    leaves.defines = TILED if len(tree.tiles) else ()
    first_leaf = len(tree.tiles) // LEAF_TEXELS
    hierarchy = Hierarchy(nodes, leaves, tree.hierarchy.triangles, tree.place.astype(np.int32), first_leaf)
    return replace(tree, hierarchy=hierarchy, nodes=rows)


def _pack_boxes(rows: np.ndarray, low: np.ndarray, high: np.ndarray, least: float) -> None:
    """Put boxes of four children per node, (N, 4, 3), into `rows` (N, NODE_TEXELS, 4); see boxes_met in shaders/trace.

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
    rows[:, 0, :3] = corner
    rows[:, 0, 3] = (exponent + 127) @ byte
    rows[:, 1], rows[:, 2] = first @ byte, last @ byte


class HierarchyCache:
    """The hierarchies of a renderer's scene: built when first asked for, kept until geometry or alpha changes.

    Rays of glossy, diffuse and transmission paths meet different objects only where an artist hid some from one.
    """

    def __init__(self):
        self._kept: dict[object, Tree] = {}
        self._kinds: tuple[object, dict] = (None, {})  # of instances: one for each visibility among them
        self._looks: tuple[object, tuple] = (None, ())  # of materials: what decides about rays, and what they emit

    def get(self, frame, path: str, passing: frozenset[int] = frozenset()) -> Hierarchy | None:
        """The hierarchy of what rays of `path` can meet; None where there are too many triangles (see `too_many`).
        Objects of the groups of blockers `passing` are left out.

        For a draft, of which the next may follow at once, triangles that moved keep their places in the tree.
        """
        snapshot, origin, draft = frame.snapshot, frame.geometry.origin, frame.settings.draft
        if too_many(snapshot):
            return None
        materials, maps, glow = frame.measured_materials, frame.opacity_maps, frame.emission_maps
        if self._kinds[0] is not snapshot.instances:
            self._kinds = snapshot.instances, {id(i.visibility): i for i in snapshot.instances}
        if self._looks[0] is not materials:  # the same for all paths of a picture
            self._looks = materials, tuple((_mean_code(m), _emission(m)) for m in materials)
        alike = all(_met(i, path) and _rays(i, path) == ALL_RAYS for i in self._kinds[1].values())
        shown = snapshot.instances if alike else tuple(i for i in snapshot.instances if _met(i, path))
        if passing:
            shown = tuple(i for i in shown if i.links.blocker not in passing)
        key = shown, (
            None if alike else tuple(_rays(i, path) for i in shown),
            tuple((mesh.key, mesh.version) for mesh in snapshot.meshes.values()),
            self._looks[1], maps.changes, glow.changes, tuple(origin),
        )  # fmt: skip
        tree = self._kept.get(key)
        if tree is None and draft:
            tree = self._moved(key, snapshot, materials, maps, glow, origin, path)
        if tree is None or (tree.refitted and not draft):
            triangles = world_triangles(list(shown), snapshot.meshes, materials, origin, path, maps, glow)
            tree = build(*triangles, maps.texels)
            if tree.hierarchy.triangles > MOST_REFITTED:
                tree.boxes = tree.place = tree.leaves = tree.low = tree.high = tree.tiles = tree.nodes = None
        if self._kept.get(key) is not tree:
            # At most one for each path; the oldest one, of another scene, goes.
            most = 3 + len(frame.blocker_sets)
            self._kept = dict([*self._kept.items()][-most:]) | {key: tree}
        if tree.hierarchy.instances != shown:  # else the same object: what was made of it still stands
            tree.hierarchy = replace(tree.hierarchy, instances=shown)
        return tree.hierarchy

    def _moved(
        self, key, snapshot, materials, maps: OpacityMaps, glow: EmissionMaps, origin: np.ndarray, path: str
    ) -> Tree | None:
        """The tree of the same instances, of which a few have moved since; None if there is none."""
        shown, rest = key
        for other in self._kept:
            old, tree = other[0], self._kept[other]
            if other[1] != rest or len(old) != len(shown) or tree.place is None:
                continue
            moved = [k for k, (a, b) in enumerate(zip(shown, old)) if a is not b]
            if any((shown[k].mesh, shown[k].materials) != (old[k].mesh, old[k].materials) for k in moved):
                continue
            counts = np.array([snapshot.meshes[one.mesh].triangle_count for one in shown])
            if 2 * counts[moved].sum() > len(tree.place):
                continue
            starts = np.cumsum(counts) - counts
            numbers = [np.arange(starts[k], starts[k] + counts[k]) for k in moved]
            triangles = world_triangles([shown[k] for k in moved], snapshot.meshes, materials, origin, path, maps, glow)
            del self._kept[other]
            return refit(tree, np.concatenate(numbers), *triangles)
        return None

    def release(self) -> None:
        self._kept = {}


def too_many(snapshot) -> str | None:
    """Why this scene has no hierarchy, as a sentence; None if it has."""
    count = snapshot.triangle_count
    if count > LARGEST:
        return f"{count} triangles with all instances are more than the {LARGEST} that can be traced"
    return None
