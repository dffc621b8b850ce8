"""Boxes of a tree's nodes as shaders/trace/hierarchy.glsl reads them, and their change where some leaves move.

The shape is that of box_tree.py. Boxes of children are bytes on a grid of their node, four texels a node. Where leaves
move, the nodes above them alone are made anew: a few hundred for an object among thousands. Boxes then grow, and
`cost` says what that means to rays.
"""

from __future__ import annotations

import numpy as np

from .box_tree import WIDTH, BoxTree

# The node's grid; lower and upper corners of the four children on it; number of the first child that is a node, of the
# first one that is a leaf, how many are nodes: those come first; and whether its leaves are records of instances.
NODE_TEXELS = 4
EMPTY = 1e30


class NodeBoxes:
    """The nodes of a tree over leaves with boxes `leaf_low` to `leaf_high`, (L, 3) float32."""

    def __init__(self, tree: BoxTree, leaf_low: np.ndarray, leaf_high: np.ndarray):
        self.tree = tree
        self.reach = max(np.abs(leaf_low).max(initial=0.0), np.abs(leaf_high).max(initial=0.0))
        self.low = tree.of_children(leaf_low, np.minimum, EMPTY)  # (N, WIDTH, 3)
        self.high = tree.of_children(leaf_high, np.maximum, -EMPTY)
        # (N, NODE_TEXELS, 4), numbers of nodes and leaves as in the tree
        self.rows = np.zeros((len(self.low), NODE_TEXELS, 4), np.float32)
        pack_boxes(self.rows, self.low, self.high, self._least)
        self.rows[:, 3, 0], self.rows[:, 3, 1] = tree.first_node, tree.first_leaf
        self.rows[:, 3, 2] = tree.nodes
        self._parents: tuple[np.ndarray, ...] | None = None

    @property
    def _least(self) -> float:
        return max(1e-6 * float(self.reach), 1e-30)

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """(3,) lowest and highest corner of all; inverted where there is nothing."""
        return self.low[0].min(axis=0), self.high[0].max(axis=0)

    def around(self, most: int) -> tuple[np.ndarray, np.ndarray]:
        """At most so many boxes, (B, 3), that hold all leaves: those of the children of one level's nodes, of the
        lowest one that has so few, and of leaves above it."""
        nodes, found = np.zeros(1, np.int64), []
        slots = np.arange(WIDTH)
        while True:
            there = (self.low[nodes] <= self.high[nodes]).all(axis=2)
            inner = there & (slots < self.tree.nodes[nodes][:, None])
            below = (self.tree.first_node[nodes][:, None] + slots)[inner]
            done = [(nodes, there & ~inner)]
            if not len(below) or sum(int(some.sum()) for _, some in (*found, *done)) + WIDTH * len(below) > most:
                found.append((nodes, there))
                break
            found += done
            nodes = below
        return tuple(np.concatenate([ends[nodes][some] for nodes, some in found]) for ends in (self.low, self.high))

    def linked(self, first_node: int, first_leaf: int, which=slice(None)) -> np.ndarray:
        """The rows of these nodes with links that are so much higher."""
        rows = self.rows[which].copy()
        rows[:, 3, 0] += first_node
        rows[:, 3, 1] += first_leaf
        return rows

    def move(self, leaves: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Put these leaves (K,) into other boxes (K, 3); the numbers of the nodes whose rows have changed."""
        self.reach = max(self.reach, np.abs(low).max(initial=0.0), np.abs(high).max(initial=0.0))
        of_node, slot_of_node, of_leaf, slot_of_leaf = self._parents_of_all()
        nodes, slots, touched = of_leaf[leaves], slot_of_leaf[leaves], []
        while len(nodes):
            self.low[nodes, slots], self.high[nodes, slots] = low, high
            nodes = np.unique(nodes)
            touched.append(nodes)
            # Numbers grow with depth, but leaves hang at all depths: upwards until the root, again where paths meet.
            above = nodes[nodes > 0]
            low, high = self.low[above].min(axis=1), self.high[above].max(axis=1)
            nodes, slots = of_node[above], slot_of_node[above]
        changed = np.unique(np.concatenate(touched)) if touched else np.zeros(0, np.int64)
        rows = self.rows[changed]
        pack_boxes(rows, self.low[changed], self.high[changed], self._least)
        self.rows[changed] = rows
        return changed

    def _parents_of_all(self) -> tuple[np.ndarray, ...]:
        """Of each node and each leaf the node above and its place there."""
        if self._parents is None:
            tree, found = self.tree, []
            before = np.zeros_like(tree.nodes)  # children that stand before the first one of a kind
            for first, count, total in (
                (tree.first_node, tree.nodes, len(tree.nodes)), (tree.first_leaf, tree.leaves, tree.leaf_count),
            ):  # fmt: skip
                above, slot = np.zeros(total, np.int64), np.zeros(total, np.int64)
                for k in range(WIDTH):
                    rows = np.flatnonzero(k < count)
                    above[first[rows] + k], slot[first[rows] + k] = rows, k + before[rows]
                found += [above, slot]
                before = tree.nodes
            self._parents = tuple(found)
        return self._parents

    def cost(self) -> float:
        """Half the surface of all boxes, m2: in proportion to how many of them a ray that crosses the scene meets."""
        x, y, z = (np.maximum(self.high[..., k] - self.low[..., k], 0.0).astype(np.float64) for k in range(3))
        return float((x * y + y * z + z * x).sum())


def pack_boxes(rows: np.ndarray, low: np.ndarray, high: np.ndarray, least: float) -> None:
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
