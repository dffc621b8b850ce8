"""Bounding volume hierarchies over all triangles, for rays that no depth map can answer (one direction per pixel).

Their shape is that of box_tree.py, four children to a node and up to four triangles to a leaf. Most triangles lie in
one tree, in world space. A mesh whose copies would be many triangles has a tree of its own, in its own space, kept as
long as the mesh and its looks; an upper tree over its instances leads rays into it (instance_tree.py). Scenes without
such meshes have no upper tree, and programs without it.

    node --+-- tree of world space --- triangles
           +-- upper tree --- records of instances --- trees of meshes --- triangles

Where few objects move, their triangles or records keep their places, and the nodes above them alone are made anew and
written into the images. At rest a viewport keeps a large tree until its boxes have grown by GROWN; whole pictures have
fresh trees, so that they do not depend on what came before.

| cost | |
|---|---|
| memory | about 85 bytes of leaf and 10 of nodes a triangle that is kept; see instance_tree.py for copies |
| building | box_tree.py, and about 1 us a triangle for looks and leaves |
| rays | four fetches to enter an instance |

Bias: none. Above LARGEST triangles that would have to be kept there is no hierarchy.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..gfx import images
from ..kernels.scatter import scatter
from ..snapshot.scene import Instance, Snapshot
from . import box_tree
from .box_tree import LEAF
from .glass_sheets import NO_SHEETS, SheetCache
from .instance_tree import MOST_BOXES, OWN_TREE, RECORD_NODES, Copies, UpperTree, is_point, kept, parted
from .node_boxes import EMPTY, NODE_TEXELS, NodeBoxes, pack_boxes
from .on_gpu import SceneOnGpu
from .traced_triangles import (
    ALL_RAYS,
    NO_RECORDS,
    STAINED,
    TINT_CODE,
    absorption_records,
    is_empty,
    is_met,
    is_sheet,
    links_code,
    mean_code,
    mean_emission,
    rays_met,
    world_triangles,
)

LARGEST = 4_000_000  # triangles
MOST_MESHES = 64  # trees of meshes that are kept though nothing shows them now
MOST_MOVED = 1_000_000  # triangles of a tree whose parts are kept for what moves, some 150 bytes each
GROWN = 1.25  # times the cost of a tree when it was built: what a viewport at rest puts up with
ALWAYS_FRESH = 50_000  # triangles and instances of a tree that is built anew at rest after any move
# What shaders/trace/hierarchy.glsl reads; first among a program's textures, since rays ask for most of its texels.
HIERARCHY_TEXTURES = (("RGBA32F", "trace_nodes"), ("RGBA32F", "trace_leaves"))
# Corner x, y, z, first edge x, y, z, second edge x, y, z of four triangles; what of rays they stop, radiance that they
# emit r, g, b, material and side that emits, shading normals of the three corners: see traced_triangles.py.
LEAF_TEXELS = 17
# For programs that trace rays among triangles with tiles; others are a tenth faster without.
TILED = (("OPACITY_TILES", "1"),)
OPACITY_TEXEL = 9
SHEETS = (("GLASS_SHEETS", "1"),)  # where some glass is no closed solid
TINTED, EMISSION_TEXEL = (("TINTED_LAYERS", "1"),), 10  # where some triangle colours light that passes it
ABSORBING = (("ABSORBING_LAYERS", "1"),)  # and where the inside of some glass absorbs
INSTANCED = (("INSTANCED", "1"),)  # and below an upper tree
NO_TILES = np.zeros((0, 4), np.float32)


@dataclass(frozen=True)
class Hierarchy:
    """The trees in two images."""

    nodes: images.Image
    leaves: images.Image
    triangles: int  # that are kept
    # For who needs more of a triangle than leaves hold (surfaces/hits.py): the place of each triangle of `expanded`, in
    # their order, among the slots of the leaves (LEAF each; -1: left out); the first one is that of `first_leaf`.
    slots: np.ndarray | None = None  # (T,) int32
    first_leaf: int = 0
    instances: tuple[Instance, ...] = ()  # all that rays can meet
    expanded: tuple[Instance, ...] = ()  # those whose triangles lie in world space
    shared: tuple[tuple[Instance, np.ndarray], ...] = ()  # an instance of each mesh with a tree of its own, and slots

    @property
    def textures(self) -> dict[str, images.Image]:
        """What HIERARCHY_TEXTURES binds."""
        return {"trace_nodes": self.nodes, "trace_leaves": self.leaves}

    @property
    def has_sheets(self) -> bool:
        """Whether some glass is a single sheet (glass_sheets.py)."""
        return set(SHEETS) <= set(self.leaves.defines)

    @property
    def bytes(self) -> int:
        return self.nodes.bytes + self.leaves.bytes


class Tree:
    """Triangles (T, 3, 3) with their looks (T, 8) in the leaves of one tree, on the CPU's side."""

    def __init__(self, corners: np.ndarray, look: np.ndarray):
        count, shown = len(corners), np.flatnonzero(_shown(corners, look))
        self.triangles = len(shown)
        if self.triangles < len(corners):
            corners, look = corners[shown], look[shown]
        low, high = _bounds(corners)
        shape = box_tree.build(low, high)
        self.place = np.full(count, -1)  # of each triangle among the slots of the leaves; -1: left out
        self.place[shown] = shape.place
        self.low = np.full((shape.leaf_count * LEAF, 3), EMPTY, np.float32)  # of the triangle in each slot
        self.high = -self.low
        self.low[shape.place], self.high[shape.place] = low, high
        # Zero edges are never hit.
        self.leaves = np.zeros((max(shape.leaf_count, 1), LEAF_TEXELS, LEAF), np.float32)
        self.leaves[shape.place // LEAF, :, shape.place % LEAF] = _entries(corners, look)
        self.boxes = NodeBoxes(shape, *_of_leaves(self.low, self.high))
        self.cost = self.boxes.cost()  # when it was built

    def move(self, numbers: np.ndarray, corners: np.ndarray, look: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """Put triangles `numbers` (N,) elsewhere, at the cost of larger boxes; the leaves and nodes that change. None
        where other triangles than before can be met, or parts that this takes are not there any more."""
        shown = _shown(corners, look)
        if self.leaves is None or ((self.place[numbers] >= 0) != shown).any():
            return None
        place, corners = self.place[numbers][shown], corners[shown]
        self.leaves[place // LEAF, :, place % LEAF] = _entries(corners, look[shown])
        self.low[place], self.high[place] = _bounds(corners)
        leaves = np.unique(place // LEAF)
        slots = (LEAF * leaves[:, None] + np.arange(LEAF)).ravel()
        return leaves, self.boxes.move(leaves, *_of_leaves(self.low[slots], self.high[slots]))

    def forget(self) -> None:
        """Keep what shows where triangles are alone."""
        self.leaves = self.low = self.high = self.boxes = None


def _shown(corners: np.ndarray, look: np.ndarray) -> np.ndarray:
    """(T,) which triangles some ray can meet."""
    shown = ~is_empty(look[:, 0])
    if not np.isfinite(corners).all():  # of each alone takes ten times as long
        shown &= np.isfinite(corners.reshape(-1, 9)).all(axis=1)
    return shown


def _entries(corners: np.ndarray, look: np.ndarray) -> np.ndarray:
    """(T, LEAF_TEXELS) what a leaf holds of each triangle."""
    entries = np.empty((len(corners), LEAF_TEXELS), np.float32)
    entries[:, :9] = corners.reshape(-1, 9)
    entries[:, 3:6] -= entries[:, :3]
    entries[:, 6:9] -= entries[:, :3]
    entries[:, 9:] = look
    return entries


def _bounds(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(T, 3) boxes of triangles."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]  # numpy's reduction of three takes four times as long
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


def _any_absorbs(leaves: np.ndarray) -> bool:
    """Whether one of the triangles of leaves (N, LEAF_TEXELS, LEAF) names a record of what its inside absorbs."""
    red, _, blue = np.moveaxis(leaves[:, EMISSION_TEXEL : EMISSION_TEXEL + 3], 1, 0)
    return bool(((red == STAINED) & (blue != 0.0)).any())


def _of_leaves(low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Boxes of leaves, of those of their slots."""
    low, high = low.reshape(-1, LEAF, 3), high.reshape(-1, LEAF, 3)
    return (
        np.minimum(np.minimum(low[:, 0], low[:, 1]), np.minimum(low[:, 2], low[:, 3])),
        np.maximum(np.maximum(high[:, 0], high[:, 1]), np.maximum(high[:, 2], high[:, 3])),
    )


class Trees:
    """The trees of a scene on the GPU.

    Below an upper tree nodes lie in this order: one above both, the root of the tree of world space, that of the upper
    tree, what is below either, the trees of meshes, records of instances.
    """

    def __init__(
        self, world: Tree, tiles: np.ndarray = NO_TILES, copies: Sequence[Copies] = (), origin=(0, 0, 0),
        absorption: np.ndarray = NO_TILES, absorbing: Mapping[int, int] = NO_RECORDS,
    ):  # fmt: skip
        """`tiles`: texels of OpacityMaps that opacity codes tell of; `origin`: what places are relative to;
        `absorption`, `absorbing`: the two of absorption_records, which looks of triangles tell of."""
        self.world, self.moved = world, False
        self.asked: tuple[Instance, ...] | None = None  # instances of the last snapshot that was asked for these
        self.absorbing = absorbing
        told = np.concatenate([tiles, absorption])
        told = np.pad(told, ((0, -len(told) % LEAF_TEXELS), (0, 0)))
        self._first_leaf = len(told) // LEAF_TEXELS
        own = [world, *(one.tree for one in copies)]
        starts = self._first_leaf + np.cumsum([0, *(len(tree.leaves) for tree in own)])
        texels = [told] * bool(len(told)) + [tree.leaves.reshape(-1, 4) for tree in own]
        leaves = images.upload_list(np.concatenate(texels) if len(texels) > 1 else texels[0])
        leaves.defines = (TILED if len(tiles) else ()) + (INSTANCED if len(copies) else ())
        leaves.defines += TINTED if any((tree.leaves[:, EMISSION_TEXEL] <= -TINT_CODE).any() for tree in own) else ()
        leaves.defines += ABSORBING if any(_any_absorbs(tree.leaves) for tree in own) else ()
        leaves.defines += SHEETS if any(is_sheet(tree.leaves[:, OPACITY_TEXEL]).any() for tree in own) else ()
        self.upper = UpperTree(copies, np.asarray(origin, float)) if len(copies) else None
        rows = self._joined(copies, starts[1:]) if len(copies) else world.boxes.linked(0, self._first_leaf)
        shared = tuple(
            (one.instances[0], np.where(one.tree.place < 0, -1, one.tree.place + LEAF * (start - self._first_leaf)))
            for one, start in zip(copies, starts[1:])
        )
        self.hierarchy = Hierarchy(
            images.upload_list(rows.reshape(-1, 4)), leaves, sum(tree.triangles for tree in own),
            world.place.astype(np.int32), self._first_leaf, shared=shared,
        )  # fmt: skip
        self._starts: np.ndarray | None = None  # in `slots`, of the triangles of each expanded instance
        if world.triangles > MOST_MOVED:
            world.forget()

    def _joined(self, copies: Sequence[Copies], first_leaves: np.ndarray) -> np.ndarray:
        """The rows of all nodes."""
        world, upper = self.world.boxes, self.upper.boxes
        self._shift = len(world.rows) + 1  # of the upper tree's nodes but the root
        place = self._shift + len(upper.rows)
        roots, rows = [], []
        for one, first_leaf in zip(copies, first_leaves):
            roots.append(place)
            rows.append(one.tree.boxes.linked(place, first_leaf))
            place += len(rows[-1])
        self._roots, self._first_record = np.array(roots), place
        records = np.zeros((len(self.upper.instances), RECORD_NODES, NODE_TEXELS, 4), np.float32)
        records[self.upper.place] = self.upper.records(self._roots, np.arange(len(records)))
        below = world.linked(2, self._first_leaf), self.upper.linked(self._shift, self._first_record)
        self._world_bounds = world.bounds
        return np.concatenate([
            self._above(), below[0][:1], below[1][:1], below[0][1:], below[1][1:], *rows,
            records.reshape(-1, NODE_TEXELS, 4),
        ])  # fmt: skip

    def _above(self) -> np.ndarray:
        """The node above both trees, (1, NODE_TEXELS, 4)."""
        row = np.zeros((1, NODE_TEXELS, 4), np.float32)
        low, high = np.full((1, 4, 3), EMPTY, np.float32), np.full((1, 4, 3), -EMPTY, np.float32)
        low[0, 0], high[0, 0] = self._world_bounds
        low[0, 1], high[0, 1] = self.upper.boxes.bounds
        pack_boxes(row, low, high, 1e-30)
        row[0, 3, 0], row[0, 3, 2] = 1, 2
        return row

    def move(self, numbers: np.ndarray, triangles: tuple[np.ndarray, np.ndarray], copies: dict[int, Instance]) -> bool:
        """Put `triangles` (corners and looks) `numbers` of the tree of world space, and the instances `copies` by their
        number in the hierarchy, elsewhere, in the same images. False where that cannot be: these trees are used up."""
        names, rows = [], []
        if len(numbers):
            changed = self.world.move(numbers, *triangles)
            if changed is None:
                return False
            leaves, nodes = changed
            scatter(self.hierarchy.leaves, leaves + self._first_leaf, self.world.leaves[leaves])
            names.append(nodes if self.upper is None else np.where(nodes > 0, nodes + 2, 1))
            rows.append(self.world.boxes.linked(0 if self.upper is None else 2, self._first_leaf, nodes))
        if copies:
            which = np.flatnonzero(np.isin(self.upper.numbers, list(copies)))
            nodes = self.upper.move(which, [copies[k] for k in self.upper.numbers[which]])
            if nodes is None:
                return False
            names.append(np.where(nodes > 0, nodes + self._shift, 2))
            rows.append(self.upper.linked(self._shift, self._first_record, nodes))
            first = self._first_record + RECORD_NODES * self.upper.place[which]
            names.append((first[:, None] + np.arange(RECORD_NODES)).ravel())
            rows.append(self.upper.records(self._roots, which).reshape(-1, NODE_TEXELS, 4))
        if self.upper is not None:
            self._world_bounds = self._world_bounds if self.world.boxes is None else self.world.boxes.bounds
            names.append(np.zeros(1, int))
            rows.append(self._above())
        if names:
            scatter(self.hierarchy.nodes, np.concatenate(names), np.concatenate(rows))
        self.moved = True
        return True

    def lasts(self) -> bool:
        """Whether these trees, after moves, are still good enough for a viewport at rest."""
        upper = 0 if self.upper is None else len(self.upper.instances)
        if self.world.triangles + upper <= ALWAYS_FRESH:
            return False
        trees = [tree for tree in (self.world, self.upper) if tree is not None and tree.boxes is not None]
        return all(tree.boxes.cost() <= GROWN * tree.cost for tree in trees)


def build(corners: np.ndarray, look: np.ndarray, tiles: np.ndarray = NO_TILES) -> Trees:
    """The hierarchy of `corners` (T, 3, 3) with opacity, emission, material and normals `look` (T, 8); `tiles` are the
    texels of OpacityMaps that opacity codes tell of."""
    return Trees(Tree(corners, look), tiles)


class HierarchyCache:
    """The hierarchies of a renderer's scene: built when first asked for, kept until geometry or alpha changes.

    Rays of glossy, diffuse and transmission paths meet different objects only where an artist hid some from one.
    """

    def __init__(self):
        self._kept: dict[object, Trees] = {}
        self._meshes: dict[object, Tree] = {}  # trees of meshes' own
        self._sheets = SheetCache()
        self._kinds: tuple[object, dict] = (None, {})  # of instances: one for each visibility among them
        self._looks: tuple[object, tuple] = (None, ())  # of materials: what decides about rays, and what they emit

    def get(self, frame: SceneOnGpu, path: str, passing: frozenset[int] = frozenset()) -> Hierarchy | None:
        """The hierarchy of what rays of `path` can meet; None where there are too many triangles (see `too_many`).
        Objects of the groups of blockers `passing` are left out."""
        snapshot, origin, settings = frame.snapshot, frame.geometry.origin, frame.settings
        if too_many(snapshot):
            return None
        materials, maps, glow = frame.measured_materials, frame.opacity_maps, frame.emission_maps
        if self._kinds[0] is not snapshot.instances:
            self._kinds = snapshot.instances, {id(i.visibility): i for i in snapshot.instances}
        if self._looks[0] is not materials:  # the same for all paths of a picture
            self._looks = materials, tuple((mean_code(m), mean_emission(m), m.absorbed_inside) for m in materials)
        alike = all(is_met(i, path) and rays_met(i, path) == ALL_RAYS for i in self._kinds[1].values())
        shown = snapshot.instances if alike else tuple(i for i in snapshot.instances if is_met(i, path))
        if passing:
            shown = tuple(i for i in shown if i.links.blocker not in passing)
        sheets = self._sheets.get(shown, snapshot.meshes, materials)  # of what moves, too: it may leave another's side
        key = shown, (
            None if alike else tuple(rays_met(i, path) for i in shown),
            tuple((mesh.key, mesh.version) for mesh in snapshot.meshes.values()),
            self._looks[1], maps.changes, glow.changes, tuple(origin),
            tuple(sheets.get(id(i)) for i in shown) if sheets else (),
        )  # fmt: skip
        look = snapshot.meshes, materials, path, maps, glow, sheets
        trees = self._kept.get(key)
        if trees is None and not settings.schedule.may_rebuild:
            trees = self._moved(key, look, origin, settings.schedule.is_draft, snapshot.instances)
        if trees is None or (
            trees.moved and not settings.schedule.is_draft and (settings.schedule.may_rebuild or not trees.lasts())
        ):
            trees = self._built(shown, key[1], look, origin)
        if self._kept.get(key) is not trees:
            # At most one for each path; the oldest one, of another scene, goes.
            most = 3 + len(frame.snapshot.blocker_sets)
            self._kept = dict([*self._kept.items()][-most:]) | {key: trees}
        if trees.hierarchy.instances != shown:  # else the same object: what was made of it still stands
            trees.hierarchy = replace(trees.hierarchy, instances=shown)
        trees.asked = snapshot.instances
        return trees.hierarchy

    def _built(self, shown: tuple[Instance, ...], rest: tuple, look: tuple, origin: np.ndarray) -> Trees:
        """New trees, but for those of meshes that stand."""
        meshes, materials, path, maps, glow, sheets = look
        some = [one for one in shown if meshes[one.mesh].triangle_count]

        def met(one: Instance) -> tuple:
            return rays_met(one, path), links_code(one), sheets.get(id(one))

        expanded, kinds = parted(some, meshes, lambda one: (*maps.kind_of(one), glow.kind_of(one), *met(one)), LARGEST)
        in_trees = (*expanded, *(some[own[0]] for own in kinds.values()))
        if sum(meshes[one.mesh].triangle_count for one in in_trees) > LARGEST:
            # What opacity and emission tell apart between instances would be too many trees: all have the first one's.
            expanded, kinds = parted(some, meshes, lambda one: (one.mesh, one.materials, *met(one)), LARGEST)
        number = {id(one): k for k, one in enumerate(shown)} if kinds else {}
        absorption, absorbing = absorption_records(materials, some, maps)
        copies, used = [], {}
        for kind, own in kinds.items():
            first = some[own[0]]
            slots = {*first.materials, 0}  # faces without a material have the first one
            slots = [slot for slot in sorted(slots) if slot < len(self._looks[1])]
            looks = tuple((self._looks[1][slot], absorbing.get(slot)) for slot in slots)
            named = (kind, meshes[first.mesh].version, looks, *rest[3:5])
            tree = used[named] = self._meshes.get(named) or _tree_of_mesh(first, look, absorbing)
            if tree.triangles:
                own = [some[k] for k in own]
                copies.append(Copies(tree, own, [number[id(one)] for one in own], *tree.boxes.around(MOST_BOXES)))
        world = Tree(*world_triangles(expanded, meshes, materials, origin, path, maps, glow, sheets, absorbing))
        trees = Trees(world, maps.texels, copies, origin, absorption, absorbing)
        trees.hierarchy = replace(trees.hierarchy, instances=shown, expanded=tuple(expanded))
        self._meshes = dict([*self._meshes.items()][-MOST_MESHES:]) | used
        return trees

    def _moved(self, key: tuple, look: tuple, origin: np.ndarray, draft: bool, instances) -> Trees | None:
        """The trees of the same instances, of which a few have moved since; None if there are none."""
        shown, rest = key
        meshes, materials, path, maps, glow, sheets = look
        for other, trees in self._kept.items():
            old = other[0]
            if other[1] != rest or len(old) != len(shown) or trees.asked is instances:
                continue  # or another set of this picture's, whose images are in use
            moved = [k for k, (a, b) in enumerate(zip(shown, old)) if a is not b]
            if any(_looks(shown[k]) != _looks(old[k]) for k in moved):
                continue
            own = () if trees.upper is None else set(trees.upper.numbers.tolist())
            copies = {k: shown[k] for k in moved if k in own}
            place = {id(one): k for k, one in enumerate(trees.hierarchy.expanded)}
            expanded = [k for k in moved if id(old[k]) in place]
            # Others have no triangle that a ray meets, or were left out of the trees since they were points.
            left = (k for k in moved if k not in own and id(old[k]) not in place)
            if any(is_point(old[k]) and not is_point(shown[k]) for k in left if meshes[shown[k].mesh].triangle_count):
                continue
            counts = np.array([meshes[one.mesh].triangle_count for one in trees.hierarchy.expanded], np.int64)
            numbers = [place[id(old[k])] for k in expanded]
            if 2 * counts[numbers].sum() > max(len(trees.world.place), 1):
                continue
            if not draft and trees.world.triangles <= ALWAYS_FRESH:
                continue
            starts = np.cumsum(counts) - counts
            triangles = [np.arange(starts[k], starts[k] + counts[k]) for k in numbers]
            corners = world_triangles(
                [shown[k] for k in expanded], meshes, materials, origin, path, maps, glow, sheets, trees.absorbing
            )
            del self._kept[other]
            if not trees.move(np.concatenate([*triangles, np.zeros(0, np.int64)]), corners, copies):
                return None
            now = list(trees.hierarchy.expanded)
            for k, one in zip(numbers, expanded):
                now[k] = shown[one]
            trees.hierarchy = replace(trees.hierarchy, expanded=tuple(now))
            return trees
        return None

    def release(self) -> None:
        self._kept, self._meshes, self._sheets = {}, {}, SheetCache()


def _looks(instance: Instance) -> tuple:
    """What must be alike where an instance has only moved."""
    return instance.mesh, instance.materials, links_code(instance)


def _tree_of_mesh(instance: Instance, look: tuple, absorbing: Mapping[int, int]) -> Tree:
    """The tree of a mesh in its own space, as an instance shows it."""
    meshes, materials, path, maps, glow, sheets = look
    resting = replace(instance, matrix=np.eye(4))
    own = {id(resting): sheets[id(instance)]} if id(instance) in sheets else NO_SHEETS
    tree = Tree(*world_triangles([resting], meshes, materials, np.zeros(3), path, maps, glow, own, absorbing))
    tree.low = tree.high = None  # it will not move
    return tree


def too_many(snapshot: Snapshot) -> str | None:
    """Why this scene has no hierarchy, as a sentence; None if it has."""
    count = snapshot.triangle_count
    if count > LARGEST:
        count = min(kept(snapshot.times_shown, snapshot.meshes, least) for least in (0, OWN_TREE))
    if count > LARGEST:
        return f"{count} triangles are more than the {LARGEST} that can be traced"
    return None


def too_many_copies(snapshot: Snapshot) -> str | None:
    """Why the triangles of all instances cannot be made in world space, as a sentence; None if they can."""
    count = snapshot.triangle_count
    if count > LARGEST:
        return f"{count} triangles with all instances are more than the {LARGEST} that points can be scattered over"
    return None
