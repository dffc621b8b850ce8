"""Connected parts of a mesh, and which of them are closed: every edge is shared by an even number of triangles.

Corners at the same place count as one, so that split edges and seams open nothing. A part that is closed has an inside,
and its outside is told by the sign of its volume, whichever way its faces are wound; one that is open is a sheet, which
has two sides.

Made on the CPU: about 1 us a triangle, of very long strips several times as much.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Parts:
    """Number of each triangle's part (T,), and of each part whether it is closed (S,) and its open edges' length (S,),
    in the unit of the positions."""

    of_triangle: np.ndarray
    closed: np.ndarray
    rim: np.ndarray


def parts_of(positions: np.ndarray, triangles: np.ndarray) -> Parts:
    """Parts of a mesh: positions (V, 3), and vertices of its triangles (T, 3)."""
    if not len(triangles):
        return Parts(np.zeros(0, int), np.ones(0, bool), np.zeros(0))
    places, vertex = np.unique(np.asarray(positions) + 0.0, axis=0, return_inverse=True)  # -0 is 0
    corners = vertex.reshape(-1)[triangles]
    label = _labels(corners, len(places))
    kinds, of_triangle = np.unique(label[corners[:, 0]], return_inverse=True)
    of_triangle = of_triangle.reshape(-1)
    edges = np.sort(np.concatenate([corners[:, (0, 1)], corners[:, (1, 2)], corners[:, (2, 0)]]), axis=1)
    owner = np.tile(of_triangle, 3)
    real = edges[:, 0] != edges[:, 1]
    edges, owner = edges[real], owner[real]
    key = edges[:, 0] * np.int64(len(places)) + edges[:, 1]
    _, first, count = np.unique(key, return_index=True, return_counts=True)
    odd = first[count % 2 == 1]
    length = np.linalg.norm(places[edges[odd, 0]] - places[edges[odd, 1]], axis=1)
    rim = np.bincount(owner[odd], weights=length, minlength=len(kinds))
    return Parts(of_triangle, np.bincount(owner[odd], minlength=len(kinds)) == 0, rim)


def _labels(corners: np.ndarray, count: int) -> np.ndarray:
    """(count,) the least vertex that each is connected with."""
    label = np.arange(count)
    while True:
        least = label[corners].min(axis=1)
        found = label.copy()
        np.minimum.at(found, label[corners].reshape(-1), np.repeat(least, 3))
        np.minimum.at(found, corners.reshape(-1), np.repeat(least, 3))
        found = found[found]
        while (shorter := found[found]).tobytes() != found.tobytes():
            found = shorter
        if (found == label).all():
            return label
        label = found
