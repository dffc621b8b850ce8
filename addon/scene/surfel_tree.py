"""A tree of surfels: groups of discs, and which of them may stand for what they hold.

Binary, depth first: a node's first child follows it, `skip` is where to go on beside it. Nodes of up to PURE leaves are
split by normal first, so that most small nodes are flat and may stand for their leaves.

CPU: about 10 us a surfel with the upload; 80 bytes a node, two nodes a surfel."""

from __future__ import annotations

import numpy as np

from .disc_edges import NONE, nearest_two
from .pieces import octahedral
from .surfel_cells import Cells

MOST_LEAVES = 64  # of a node that may stand for them
PURE = 32  # leaves of nodes from which on splits go by normal
FLAT, COHERENT = 0.35, 0.9  # thickness / radius, and length of the mean normal, of a node that may stand for its leaves
NODE_TEXELS = 5


def tree(cells: Cells) -> tuple[Cells, np.ndarray]:
    """The surfels in the order of a tree's leaves, and its nodes (M, NODE_TEXELS, 4), depth first:

    - middle, radius of a ball that holds the discs of all its leaves
    - mean normal (octahedral), how far its discs lie off the plane through its middle, negative where no disc may stand
      for it; node to go on with
    - first leaf, number of leaves, 0 for both sides or 1 where only fronts are seen, 2 of sheets, opacity
    - two edges at which the disc ends: direction in its plane, distance from its middle
    """
    count = len(cells)
    if not count:
        return cells, np.zeros((0, NODE_TEXELS, 4))
    # In an order of their own, whatever order objects came in.
    cells = cells.take(np.lexsort((*cells.normal.T, *cells.place.T)))
    depth = int(np.ceil(np.log2(count)))
    order = np.arange(count)
    for level in range(depth):
        start = _starts(count, level)
        order = order[_halves(cells, order, start, count)]
    cells = cells.take(order)
    spans = [_spans(count, level) for level in range(depth + 1)]
    # Nodes of each level that hold something and are not alike their only child.
    kept = [(first, last) if level == depth else _split(first, last) for level, (first, last) in enumerate(spans)]
    first = np.concatenate([one[0] for one in kept])
    last = np.concatenate([one[1] for one in kept])
    # Depth first: by first leaf, larger nodes before those that they hold.
    order = np.lexsort((-last, first))
    first, last = first[order], last[order]
    skip = np.searchsorted(first, last, side="left")
    return cells, _describe(cells, first, last, np.where(last - first == 1, np.arange(len(first)) + 1, skip))


def _starts(count: int, level: int) -> np.ndarray:
    return np.arange((1 << level) + 1) * count >> level


def _spans(count: int, level: int) -> tuple[np.ndarray, np.ndarray]:
    edges = _starts(count, level)
    held = edges[1:] > edges[:-1]
    return edges[:-1][held], edges[1:][held]


def _split(first: np.ndarray, last: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    inner = last - first > 1
    return first[inner], last[inner]


def _halves(cells: Cells, order: np.ndarray, edges: np.ndarray, count: int) -> np.ndarray:
    """Order of the leaves within each node by the axis of its split, so that its halves are its children."""
    held = edges[1:] > edges[:-1]
    first, last = edges[:-1][held], edges[1:][held]
    place, normal = cells.place[order], cells.normal[order]
    extent = np.maximum.reduceat(place, first) - np.minimum.reduceat(place, first)
    turn = np.maximum.reduceat(normal, first) - np.minimum.reduceat(normal, first)
    leaves = last - first
    by_turn = (turn.max(axis=1) > 1.0) & (leaves <= PURE) & (leaves > PURE // 4)
    axis = np.where(by_turn, 3 + turn.argmax(axis=1), extent.argmax(axis=1))
    segment = np.repeat(np.arange(len(first)), leaves)
    values = np.concatenate([place, normal], axis=1)
    return np.lexsort((values[np.arange(count), axis[segment]], segment))


def _describe(cells: Cells, first: np.ndarray, last: np.ndarray, skip: np.ndarray) -> np.ndarray:
    sums = lambda values: _range_sums(values, first, last)  # noqa: E731
    area = np.maximum(sums(cells.area), 1e-300)
    middle = sums(cells.place * cells.area[:, None]) / area[:, None]
    mean = sums(cells.normal * cells.area[:, None]) / area[:, None]
    length = np.linalg.norm(mean, axis=1)
    normal = mean / np.maximum(length, 1e-30)[:, None]
    radius, thickness = np.zeros(len(first)), np.zeros(len(first))
    closed = sums(cells.closed.astype(float))
    leaves = last - first
    for number in np.unique(leaves):  # nodes with as many leaves at a time
        same = np.flatnonzero(leaves == number)
        rows = first[same][:, None] + np.arange(number)
        off = cells.place[rows] - middle[same][:, None]
        radius[same] = (np.linalg.norm(off, axis=2) + cells.radius[rows]).max(axis=1)
        height = np.abs(np.einsum("nki,ni->nk", off, normal[same]))
        cosine = np.einsum("nki,ni->nk", cells.normal[rows], normal[same])
        tilt = cells.radius[rows] * np.sqrt(np.maximum(1.0 - cosine * cosine, 0.0))
        thickness[same] = (height + tilt * (number > 1)).max(axis=1)
    stands = (leaves <= MOST_LEAVES) & (length > COHERENT) & (thickness < FLAT * radius)
    stands &= (closed == 0) | (closed == leaves)
    leaf = leaves == 1
    nodes = np.zeros((len(first), NODE_TEXELS, 4))
    nodes[:, 0, :3], nodes[:, 0, 3] = middle, radius * (1 + 1e-5)
    slab = np.maximum(thickness * (1 + 1e-3), 1e-6 * radius)
    nodes[:, 1, :2], nodes[:, 1, 2], nodes[:, 1, 3] = octahedral(normal), np.where(stands | leaf, slab, -slab), skip
    sheets = sums(cells.sheet.astype(float)) == leaves
    nodes[:, 2, 0], nodes[:, 2, 1], nodes[:, 2, 2] = first, leaves, (closed == leaves) * 1.0 + sheets
    nodes[:, 2, 3] = sums(cells.opacity * cells.area) / area
    nodes[:, 3:, 3] = NONE
    nodes[leaf, 3:] = cells.clips[first[leaf]]
    clipped = sums((cells.clips[:, :, 3] < NONE).any(axis=1).astype(float)) > 0
    for number in np.unique(leaves[stands & ~leaf & clipped]):
        same = np.flatnonzero(stands & clipped & (leaves == number))
        rows = first[same][:, None] + np.arange(number)
        direction = cells.clips[rows][..., :3].reshape(len(same), -1, 3)
        at = (cells.clips[rows][..., :3] * cells.place[rows][:, :, None]).sum(axis=3) + cells.clips[rows][..., 3]
        at = at.reshape(len(same), -1)
        inside = np.einsum("nki,nmi->nkm", direction, cells.place[rows]).max(axis=2) <= at + 1e-6 * radius[same, None]
        distance = at - np.einsum("nki,ni->nk", direction, middle[same])
        level = np.abs(np.einsum("nki,ni->nk", direction, normal[same])) < 0.3
        known = cells.clips[rows][..., 3].reshape(len(same), -1) < NONE
        distance = np.where(inside & level & known & (distance < radius[same, None]), distance, np.inf)
        own = nodes[same, 3:]
        nearest_two(own, distance, direction)
        nodes[same, 3:] = own
    return nodes


def _range_sums(values: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Sums of rows first..last of each range (not empty), one by one: differences of running sums lose small ones."""
    padded = np.concatenate([values, np.zeros((1, *values.shape[1:]))])  # a range may end after the last row
    return np.add.reduceat(padded, np.column_stack([first, last]).reshape(-1), axis=0)[::2]
