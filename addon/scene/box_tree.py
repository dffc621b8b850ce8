"""A four-wide bounding volume hierarchy over many small boxes, for rays: its topology, not its bounds.

Built bottom-up by parallel locally-ordered clustering (Meister & Bittner 2018): boxes stand in Morton order; each looks
at REACH of them to either side for the one with which it has the smallest common box, and pairs that chose each other
become one, until one is left. Then every node takes over grandchildren, the largest first, until it has four children
(Wald, Benthin & Boulos 2008), and what has at most LEAF boxes is a leaf.

Nodes and leaves that a ray through the scene may expect to visit (sums of their boxes' areas over the root's), here, in
a tree that is split by the surface area heuristic, and in one of equal halves of the Morton order, which needs no
addresses: `window_interior` 9 and 4, 9 and 4, 34 and 10; `soft_shadow_garden` 2 and 2, 3 and 2, 15 and 4. In blocks, a
million triangles of a bumpy sheet: 21.4 and 2.47, where all of them together have 21.3 and 2.45.

Cost: 1.5 to 2 us per box, about 1 of more than MOST_AT_ONCE. Coincident boxes are paired at random but always the same.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from ..kernels.morton import morton_codes

LEAF = 4  # boxes
WIDTH = 4  # children
REACH = 10  # boxes to either side, in Morton order
# More boxes than this are paired in blocks of the order, one thread each, until one of LEFT remains; many are close
# together in it, so that the best pair is likely to be near.
MOST_AT_ONCE, BLOCK, LEFT, REACH_IN_BLOCKS = 1 << 17, 1 << 15, 16, 5
MOST_THREADS = 8
MOST_CLUSTERED = 4_000_000  # boxes: above, time and memory count for more
DEEPEST = 32  # levels of nodes that a ray can remember (shaders/trace/hierarchy.glsl)


@dataclass(frozen=True)
class BoxTree:
    """Nodes from the root (0) on, level by level. Children that are nodes come first, then leaves; those of a node
    follow each other in number."""

    first_node: np.ndarray  # (N,) number of the first child that is a node
    nodes: np.ndarray  # (N,) how many are
    first_leaf: np.ndarray  # (N,) number of the first child that is a leaf
    leaves: np.ndarray  # (N,) how many are
    levels: tuple[int, ...]  # nodes on each level
    place: np.ndarray  # (B,) of each box: leaf x boxes of a leaf + slot
    leaf_count: int

    def of_children(self, leaves: np.ndarray, joined: np.ufunc, empty: float) -> np.ndarray:
        """Corners of every node's children, (N, WIDTH, 3), from those of the `leaves` (L, 3); `empty` where a node has
        none. `joined` makes a node's corner of those of its children."""
        out = np.full((len(self.nodes), WIDTH, 3), empty, leaves.dtype)
        own = np.full((len(self.nodes), 3), empty, leaves.dtype)
        last = len(self.nodes)
        for width in self.levels[::-1]:
            level = slice(last - width, last)
            first, nodes, count = self.first_node[level], self.nodes[level], self.nodes[level] + self.leaves[level]
            for slot in range(WIDTH):
                rows = np.flatnonzero(slot < nodes)
                out[level][rows, slot] = own[first[rows] + slot]
                rows = np.flatnonzero((slot >= nodes) & (slot < count))
                out[level][rows, slot] = leaves[self.first_leaf[level][rows] + slot - nodes[rows]]
            some = out[level]
            own[level] = joined(joined(some[:, 0], some[:, 1]), joined(some[:, 2], some[:, 3]))
            last -= width
        return out


def build(low: np.ndarray, high: np.ndarray, leaf: int = LEAF) -> BoxTree:
    """The tree of boxes `low` to `high`, (B, 3) finite, at most `leaf` (4 or 1) of which are together."""
    order = np.argsort(morton_codes((low + high) * 0.5), kind="stable")
    low, high = _unit(low[order], high[order])
    if len(low) <= MOST_CLUSTERED:
        tree = _widened(_clustered(low, high), order, leaf)
        if len(tree.levels) <= DEEPEST:
            return tree
    return _widened(_halves(low, high), order, leaf, full=True)


@dataclass(frozen=True)
class _Binary:
    """A binary tree: nodes 0..B-1 are the boxes, the last one is the root; some numbers between may be of none."""

    children: np.ndarray  # (N, 2); -1 for boxes
    area: np.ndarray  # (N,)
    boxes: np.ndarray  # (N,) how many each holds


def _unit(low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The boxes moved and scaled into the unit cube, so that areas neither over- nor underflow."""
    if not len(low):
        return low, high
    corner, top = (
        np.array([joined(box[:, axis]) for axis in range(3)], np.float64)  # along an axis of three numpy is slow
        for box, joined in ((low, np.min), (high, np.max))
    )
    extent = max(float((top - corner).max()), 1e-300)
    return tuple(((box - corner) / extent).astype(np.float32) for box in (low, high))


def _area(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Half the surface of boxes (..., 3)."""
    x, y, z = np.moveaxis(high - low, -1, 0)
    return x * y + y * z + z * x


class _Clusters:
    """Boxes (N, 3) in Morton order that are paired, and the binary tree of all pairs so far."""

    def __init__(self, low: np.ndarray, high: np.ndarray):
        self.count = len(low)
        blocks = -(-self.count // BLOCK)
        total = max(2 * self.count, 1) + (self.count // LEFT + 2 * blocks) * (self.count > MOST_AT_ONCE)
        self.children = np.full((total, 2), -1, np.int64)
        self.area, self.boxes = np.zeros(total, np.float32), np.ones(total, np.int64)
        self.area[: self.count] = _area(low, high)
        # Who is chosen of several that are equally close: what areas are multiplied by, and what is added.
        chance = np.random.default_rng(1).random(self.count + 64, np.float32)
        self.chances = 1.0 + 1e-3 * chance, 1e-20 * chance
        self.axes = [np.ascontiguousarray(corners[:, axis]) for corners in (low, high) for axis in range(3)]

    def joined(
        self, number: np.ndarray, axes: list[np.ndarray], made: int, reach: int, left: int = 1
    ) -> tuple[np.ndarray, list[np.ndarray]]:
        """Pair nodes `number` with boxes `axes` until at most `left` remain; new nodes are numbered from `made` on."""
        while len(number) > left:
            first, second = _pairs(axes, self.chances, reach)
            new = np.arange(made, made + len(first))
            made += len(first)
            self.children[new, 0], self.children[new, 1] = number[first], number[second]
            self.boxes[new] = self.boxes[number[first]] + self.boxes[number[second]]
            number[first] = new
            for axis, corner in enumerate(axes):
                corner[first] = (np.minimum if axis < 3 else np.maximum)(corner[first], corner[second])
            x, y, z = (axes[axis + 3][first] - axes[axis][first] for axis in range(3))
            self.area[new] = x * y + y * z + z * x
            stays = np.ones(len(number), bool)
            stays[second] = False
            number, axes = number[stays], [corner[stays] for corner in axes]
        return number, axes

    def block(self, first: int) -> tuple[np.ndarray, list[np.ndarray]]:
        """What remains of BLOCK boxes from the `first` on, of which new nodes are numbered behind all boxes."""
        last = min(first + BLOCK, self.count)
        axes = [corner[first:last].copy() for corner in self.axes]
        left = max((last - first) // LEFT, 1)
        return self.joined(np.arange(first, last), axes, self.count + first, REACH_IN_BLOCKS, left)


def _clustered(low: np.ndarray, high: np.ndarray) -> _Binary:
    some = _Clusters(low, high)
    number, axes, made = np.arange(some.count), some.axes, some.count
    if some.count > MOST_AT_ONCE:
        with ThreadPoolExecutor(min(os.cpu_count() or 1, MOST_THREADS)) as threads:
            parts = list(threads.map(some.block, range(0, some.count, BLOCK)))
        number = np.concatenate([part[0] for part in parts])
        axes = [np.concatenate([part[1][k] for part in parts]) for k in range(6)]
        made = 2 * some.count
    number, _ = some.joined(number, axes, made, REACH)
    root = int(number[0]) + 1 if len(number) else 1
    return _Binary(some.children[:root], some.area[:root], some.boxes[:root])


def _pairs(axes: list[np.ndarray], chances: tuple[np.ndarray, np.ndarray], reach: int) -> tuple[np.ndarray, np.ndarray]:
    """Clusters that are each other's nearest: numbers of the first and the second of each pair."""
    count = len(axes[0])
    nearest, best = np.full(count, np.inf, np.float32), np.zeros(count, np.int64)
    own = np.arange(count)
    for step in range(1, min(reach, count - 1) + 1):
        low = [np.minimum(corner[:-step], corner[step:]) for corner in axes[:3]]
        high = [np.maximum(corner[:-step], corner[step:]) for corner in axes[3:]]
        x, y, z = (b - a for a, b in zip(low, high))
        factor, added = (chance[step : step + count - step] for chance in chances)
        common = (x * y + y * z + z * x) * factor + added
        for mine, others in ((slice(None, -step), slice(step, None)), (slice(step, None), slice(None, -step))):
            closer = common < nearest[mine]
            np.copyto(nearest[mine], common, where=closer)
            np.copyto(best[mine], own[others], where=closer)
    left = np.flatnonzero((best[best] == own) & (own < best))
    if not len(left):  # nobody is chosen back: neighbours, so that there is an end
        left = own[: count // 2 * 2 : 2]
        return left, left + 1
    return left, best[left]


def _halves(low: np.ndarray, high: np.ndarray) -> _Binary:
    """The binary tree of neighbours in order, which is never deeper than its logarithm."""
    count = len(low)
    total = 2 * count - 1
    children = np.full((total, 2), -1, np.int64)
    area, boxes = np.zeros(total, np.float32), np.ones(total, np.int64)
    area[:count] = _area(low, high)
    number, made = np.arange(count), count
    while len(number) > 1:
        left, right = np.arange(0, len(number) // 2 * 2, 2), np.arange(1, len(number), 2)
        new = np.arange(made, made + len(left))
        made += len(left)
        children[new, 0], children[new, 1] = number[left], number[right]
        boxes[new] = boxes[number[left]] + boxes[number[right]]
        rest = np.arange(2 * len(left), len(number))
        low = np.concatenate([np.minimum(low[left], low[right]), low[rest]])
        high = np.concatenate([np.maximum(high[left], high[right]), high[rest]])
        area[new] = _area(low[: len(left)], high[: len(left)])
        number = np.concatenate([new, number[rest]])
    return _Binary(children, area, boxes)


def _widened(binary: _Binary, order: np.ndarray, most: int = LEAF, full: bool = False) -> BoxTree:
    """Four children for each node, of those that its two would have; leaves of at `most` so many boxes, as `full` as
    they may be, or smaller where there is room for two of them."""
    count = len(order)
    first_node, nodes, first_leaf, leaves, levels, leaf_roots = [], [], [], [], [], []
    next_node, next_leaf = 1, 0
    root = len(binary.area) - 1 if count else -1  # -1: none
    held = np.array([[root, -1, -1, -1] if count <= most else [*binary.children[root], -1, -1]])
    while len(held):
        for slot in range(2, WIDTH):
            _open(binary, held, slot, most, full)
        kind = np.where(held < 0, 2, np.where(binary.boxes[held] > most, 0, 1))
        sorting = np.argsort(kind, axis=1, kind="stable")
        held, kind = np.take_along_axis(held, sorting, axis=1), np.take_along_axis(kind, sorting, axis=1)
        node_count, leaf_count = (kind == 0).sum(axis=1), (kind == 1).sum(axis=1)
        first_node.append(next_node + np.cumsum(node_count) - node_count)
        first_leaf.append(next_leaf + np.cumsum(leaf_count) - leaf_count)
        nodes.append(node_count)
        leaves.append(leaf_count)
        levels.append(len(held))
        leaf_roots.append(held[kind == 1])
        inner = held[kind == 0]
        next_node += len(inner)
        next_leaf += len(leaf_roots[-1])
        held = np.full((len(inner), WIDTH), -1)
        held[:, :2] = binary.children[inner]
    place = np.zeros(count, np.int64)
    box, leaf = _boxes_of(binary, np.concatenate(leaf_roots), count, most)
    slot = np.arange(len(leaf)) - np.searchsorted(leaf, leaf)
    place[order[box]] = leaf * most + slot
    return BoxTree(
        np.concatenate(first_node), np.concatenate(nodes), np.concatenate(first_leaf), np.concatenate(leaves),
        tuple(levels), place, next_leaf,
    )  # fmt: skip


def _open(binary: _Binary, held: np.ndarray, slot: int, most: int, full: bool) -> None:
    """Put the halves of one child into its place and `slot`: of the largest node, or, where all are leaves and need not
    be `full`, of the one whose halves are smallest beside it."""
    known = held[:, :slot]
    children = binary.children[known]
    is_node = binary.boxes[known] > most
    saved = binary.area[known] - binary.area[children].sum(axis=2)
    worth = np.where(is_node, 1.0 + binary.area[known], np.where((children[..., 0] >= 0) & (not full), saved, -1.0))
    worth[known < 0] = -1.0
    chosen = np.argmax(worth, axis=1)
    rows = np.flatnonzero(worth[np.arange(len(held)), chosen] > 0.0)
    halves = binary.children[held[rows, chosen[rows]]]
    held[rows, chosen[rows]], held[rows, slot] = halves[:, 0], halves[:, 1]


def _boxes_of(binary: _Binary, roots: np.ndarray, count: int, most: int) -> tuple[np.ndarray, np.ndarray]:
    """The boxes below `roots` (R,) of at `most` so many each, and below which of them each is, in its order."""
    below, root = roots, np.arange(len(roots))
    for _ in range(most - 1):
        inner = below >= count
        halves = binary.children[below[inner]]
        below = np.concatenate([below[~inner], halves[:, 0], halves[:, 1]])
        root = np.concatenate([root[~inner], root[inner], root[inner]])
    sorting = np.argsort(root, kind="stable")
    return below[sorting], root[sorting]
