"""What a mesh knows about its shape beyond places and normals: pointiness, a number for each of its islands, and which
corner of their triangles corners are.

Both follow Cycles' definitions. Pointiness is the angle between a vertex's normal and the mean direction of its edges
over pi: 0.5 on flat ground, more on peaks, less in pits; then averaged over the neighbours. Vertices at one place count
as one. An island is what edges connect.
"""

from __future__ import annotations

import numpy as np


def pointiness(positions: np.ndarray, normals: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """(V,) float32 from places (V, 3), unit vertex normals (V, 3) and edges (E, 2)."""
    count = len(positions)
    if not count:
        return np.zeros(0, np.float32)
    _, first, one_of = np.unique(positions, axis=0, return_index=True, return_inverse=True)
    one_of = one_of.reshape(-1)
    merged = one_of[edges]
    merged = np.unique(np.sort(merged[merged[:, 0] != merged[:, 1]], axis=1), axis=0)
    places = positions[first].astype(np.float64)
    along = places[merged[:, 1]] - places[merged[:, 0]]
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-30)
    total, neighbours = np.zeros((len(first), 3)), np.zeros(len(first))
    for side, sign in ((0, 1.0), (1, -1.0)):
        np.add.at(total, merged[:, side], sign * along)
        np.add.at(neighbours, merged[:, side], 1.0)
    normal = np.zeros((len(first), 3))
    np.add.at(normal, one_of, normals)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    cosine = np.sum(normal * total, axis=1) / np.maximum(neighbours, 1.0)
    raw = np.where(neighbours > 0, np.arccos(np.clip(cosine, -1.0, 1.0)) / np.pi, 0.0)
    blurred = raw.copy()
    np.add.at(blurred, merged[:, 0], raw[merged[:, 1]])
    np.add.at(blurred, merged[:, 1], raw[merged[:, 0]])
    return (blurred / (neighbours + 1.0))[one_of].astype(np.float32)


def islands(count: int, edges: np.ndarray) -> np.ndarray:
    """(V,) int: the lowest vertex of the island that each of `count` vertices belongs to."""
    lowest = np.arange(count)
    a, b = edges[:, 0], edges[:, 1]
    while True:
        before = lowest.copy()
        least = np.minimum(lowest[a], lowest[b])
        np.minimum.at(lowest, a, least)
        np.minimum.at(lowest, b, least)
        lowest = lowest[lowest]  # halves the way to the lowest vertex
        if np.array_equal(before, lowest):
            return lowest


def island_numbers(count: int, edges: np.ndarray) -> np.ndarray:
    """(V,) float32 in 0..1, the same within an island: a hash of its lowest vertex."""
    return (_hash(islands(count, edges).astype(np.uint32)) / np.float64(0xFFFFFFFF)).astype(np.float32)


def corner_numbers(triangles: np.ndarray, corners: int) -> np.ndarray:
    """(C,) 0, 1 or 2, so that the three corners of every triangle differ, (T, 3).

    Triangles of one face share corners, those of other faces none. A face without holes is cut into triangles that hang
    together like a tree, so three numbers are enough: a triangle that shares two corners with one before has but one
    number left for its third.
    """
    numbers = np.full(corners, -1)
    left = triangles
    while len(left):
        given = numbers[left] >= 0
        count = given.sum(axis=1)
        third = left[count == 2]
        if len(third):
            free = ~given[count == 2]
            numbers[third[free]] = (3 - np.where(free, 0, numbers[third]).sum(axis=1)) % 3
        else:  # the first of each group that begins: none of those shares a corner with another
            fresh = left[count == 0]
            if not len(fresh):
                numbers[left[~given]] = 0
                break
            first = np.full(corners, len(fresh))
            np.minimum.at(first, fresh.reshape(-1), np.repeat(np.arange(len(fresh)), 3))
            begins = fresh[(first[fresh] == np.arange(len(fresh))[:, None]).all(axis=1)]
            numbers[begins] = np.arange(3)
        left = left[(numbers[left] < 0).any(axis=1)]
    return np.maximum(numbers, 0)


def _hash(x: np.ndarray) -> np.ndarray:
    """Lookup3 by Bob Jenkins (2006, public domain), final() over one word."""

    def rotated(v: np.ndarray, bits: int) -> np.ndarray:
        return (v << np.uint32(bits)) | (v >> np.uint32(32 - bits))

    start = np.uint32(0xDEADBEEF + (1 << 2) + 13)
    with np.errstate(over="ignore"):
        a, b, c = x + start, np.full_like(x, start), np.full_like(x, start)
        c = (c ^ b) - rotated(b, 14)
        a = (a ^ c) - rotated(c, 11)
        b = (b ^ a) - rotated(a, 25)
        c = (c ^ b) - rotated(b, 16)
        a = (a ^ c) - rotated(c, 4)
        b = (b ^ a) - rotated(a, 14)
        return (c ^ b) - rotated(b, 24)
