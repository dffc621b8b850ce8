"""An upper tree over instances whose meshes have trees of their own: which those are, where they stand, and records.

A mesh of which so many copies are shown that expanding them would be many triangles is kept once, in its own space. A
ray that reaches the box of an instance goes on in there (shaders/trace/hierarchy.glsl), by the inverse of its matrix.

Cost: 1.5 to 2 us an instance where the tree is built; where few move, the nodes above them. 128 bytes of record, about
40 of nodes. Fails: a flattened instance has no inverse (`inverses`), and is left to others.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..snapshot.scene import Instance, Mesh
from . import box_tree
from .node_boxes import NODE_TEXELS, NodeBoxes

OWN_TREE = 1_000_000  # triangles of copies of a mesh, beside the first, from which on it has a tree of its own
MOST_BOXES = 64  # of a mesh, that are turned for that of an instance: one box alone grows by turning
RECORD_NODES = 2  # a record takes the place of so many nodes
WORST_TURN = 1e4  # condition of a matrix whose inverse float32 can still follow
SLACK = 1e-6  # of a box, relative to its largest coordinate: rays in object space are rounded otherwise


@dataclass
class Copies:
    """Instances that share a tree: `numbers` says which of the hierarchy's instances they are. Boxes `low` to `high`,
    (B, 3), hold all of their mesh."""

    tree: object
    instances: list[Instance]
    numbers: list[int]
    low: np.ndarray
    high: np.ndarray


class UpperTree:
    """The boxes of all instances of these copies, relative to `origin`, as a tree."""

    def __init__(self, copies: Sequence[Copies], origin: np.ndarray):
        self.origin = origin
        self.instances = [one for some in copies for one in some.instances]
        self.numbers = np.array([k for some in copies for k in some.numbers])
        self.kind = np.repeat(np.arange(len(copies)), [len(some.instances) for some in copies])
        self._boxes = [(some.low.astype(float), some.high.astype(float)) for some in copies]
        low, high = self._bounds(np.arange(len(self.instances)))
        shape = box_tree.build(low, high, leaf=1)
        self.place = shape.place  # of each instance among the records
        order = np.argsort(shape.place)
        self.boxes = NodeBoxes(shape, low[order], high[order])
        self.cost = self.boxes.cost()

    def _bounds(self, which: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Boxes around the turned boxes of their meshes, (K, 3) each."""
        matrices = _matrices([self.instances[k] for k in which])
        low, high = np.empty((2, len(which), 3))
        for kind in np.unique(self.kind[which]):
            own, ends = self.kind[which] == kind, self._boxes[kind]
            turns, place = matrices[own, :, :3], matrices[own, :, 3] - self.origin
            middle, reach = turns @ ((ends[0] + ends[1]) / 2).T, np.abs(turns) @ ((ends[1] - ends[0]) / 2).T
            low[own], high[own] = (middle - reach).min(axis=2) + place, (middle + reach).max(axis=2) + place
        slack = SLACK * np.maximum(np.abs(low), np.abs(high)).max(axis=1, keepdims=True)
        return (low - slack).astype(np.float32), (high + slack).astype(np.float32)

    def linked(self, first_node: int, first_record: int, which=slice(None)) -> np.ndarray:
        """Rows of these nodes, whose links lead to nodes and to records that are so much higher."""
        rows = self.boxes.linked(first_node, 0, which)
        rows[:, 3, 1] = first_record + RECORD_NODES * rows[:, 3, 1]
        rows[:, 3, 3] = 1.0
        return rows

    def records(self, roots: np.ndarray, which: np.ndarray) -> np.ndarray:
        """(K, RECORD_NODES, NODE_TEXELS, 4) of these instances; `roots` are the nodes that kinds of them begin with."""
        matrices = _matrices([self.instances[k] for k in which])
        matrices[:, :, 3] -= self.origin
        back = np.linalg.inv(matrices[:, :, :3])
        rows = np.zeros((len(which), RECORD_NODES, NODE_TEXELS, 4), np.float32)
        rows[:, 0, :3, :3] = back
        rows[:, 0, :3, 3] = -np.einsum("nij,nj->ni", back, matrices[:, :, 3])
        rows[:, 0, 3, 0] = roots[self.kind[which]]
        rows[:, 0, 3, 1] = self.numbers[which]
        rows[:, 0, 3, 2] = np.sign(np.linalg.det(matrices[:, :, :3]))
        rows[:, 1, :3] = matrices
        return rows

    def move(self, which: np.ndarray, instances: list[Instance]) -> np.ndarray | None:
        """Put others in the place of these instances, of the same kinds; the nodes that change. None where one of
        them has no inverse."""
        if not inverses(instances).all():
            return None
        for k, one in zip(which, instances):
            self.instances[k] = one
        return self.boxes.move(self.place[which], *self._bounds(which))


def _matrices(instances: Sequence[Instance]) -> np.ndarray:
    """(K, 3, 4)"""
    return np.array([one.matrix[:3] for one in instances], float).reshape(-1, 3, 4)


def inverses(instances: Sequence[Instance]) -> np.ndarray:
    """(K,) which instances have a way back into their mesh's space that float32 can follow."""
    matrices = _matrices(instances)
    finite = np.isfinite(matrices).all(axis=(1, 2))
    turns = np.where(finite[:, None, None], matrices[:, :, :3], 0.0)
    size = np.linalg.norm(turns, axis=(1, 2))
    turns /= np.maximum(size, 1e-300)[:, None, None]
    a, b, c = np.moveaxis(turns, 2, 0)
    cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
    volume = np.abs((a * cofactors[:, 0]).sum(axis=1))
    return (size > 1e-15) & (size < 1e15) & (np.linalg.norm(cofactors, axis=(1, 2)) < WORST_TURN * volume)


def is_point(instance: Instance) -> bool:
    """Whether an instance is scaled to a point, or by what is no number."""
    return not np.abs(instance.matrix[:3, :3]).max() > 1e-15


def parted(
    shown: Sequence[Instance], meshes: dict[str, Mesh], kind_of: Callable[[Instance], object], most: int
) -> tuple[list[Instance], dict[object, list[int]]]:
    """Instances whose triangles are expanded in world space, and the numbers of those whose meshes have trees of their
    own, by kind. Where more than `most` triangles would be expanded, all copies share trees."""
    times = Counter((one.mesh, one.materials) for one in shown)
    least = OWN_TREE
    if kept(times, meshes) > most:
        least = 1
    many = {one for one, count in times.items() if (count - 1) * meshes[one[0]].triangle_count >= least}
    if not many:
        return list(shown), {}
    numbers = [k for k, one in enumerate(shown) if (one.mesh, one.materials) in many]
    kinds: dict[object, list[int]] = {}
    points = set()  # no ray meets what is scaled to a point
    for k, fits in zip(numbers, inverses([shown[k] for k in numbers])):
        if fits:
            kinds.setdefault(kind_of(shown[k]), []).append(k)
        elif is_point(shown[k]):
            points.add(k)
    kinds = {
        kind: some for kind, some in kinds.items()
        if (len(some) - 1) * meshes[shown[some[0]].mesh].triangle_count >= least
    }  # fmt: skip
    own = {k for some in kinds.values() for k in some} | points
    return [one for k, one in enumerate(shown) if k not in own], kinds


def kept(times: dict[tuple, int], meshes: dict[str, Mesh], least: int = OWN_TREE) -> int:
    """Triangles that lie in trees where meshes, each with some materials, are shown so many `times`."""
    counts = ((meshes[mesh].triangle_count, count) for (mesh, _), count in times.items())
    return sum(triangles if (count - 1) * triangles >= least else count * triangles for triangles, count in counts)
