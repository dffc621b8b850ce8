"""Points with normals in some tens of groups, each an area light in shape: k-means over place and direction.

    distance = 0.7 |x - c| / scale + 0.3 angle(n, m) / pi + [angle > 60 degrees],
    scale: diagonal of a box as wide as the points lie

The angle keeps the sides of an edge or of a thin wall apart: a group of both would have its middle inside the solid.
Clustering starts anew from points at equal steps of the weight along a curve through space, one for each of the six
directions that normals are nearest to, so that equal points give equal groups and small changes of the points small
ones; started from the groups of the frame before, it would lose groups whenever light moves to another wall. A group
without points is left out.

A group's shape is its flat part: the plane across its mean normal, and in it the rectangle with the second moments of
its points. Its middle is one of its points: the mean of points on a curved surface lies inside or before it.

Source: Dong, Grosch, Ritschel, Kautz, Seidel, "Real-time indirect illumination with clustered visibility", VMV 2009.
Ours: weights in means and start, the limit of the angle, the scale, rectangles from moments, middles on surfaces.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..kernels.morton import morton_codes

PLACE, TURN = 0.7, 0.3
WIDEST = 0.5  # cosine between a point's normal and its group's
ROUNDS = 8


@dataclass(frozen=True)
class Clusters:
    """Groups of points, K of N."""

    label: np.ndarray  # (N,) group of each point
    middle: np.ndarray  # (K,) number of the point nearest to the group's mean
    mean: np.ndarray  # (K, 3) of places
    normal: np.ndarray  # (K, 3) unit, mean
    across: np.ndarray  # (K, 3) unit, along the longer side
    half: np.ndarray  # (K, 2) half sides, longer one first; 0 for single points
    scale: float  # of the distance

    def __len__(self) -> int:
        return len(self.middle)

    def nearest(self, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """(P,) group that other points are nearest to."""
        return _nearest(points, normals, self.mean, self.normal, self.scale)


def members(label: np.ndarray, count: int) -> list[np.ndarray]:
    """Numbers of the points of each of `count` groups."""
    order = np.argsort(label, kind="stable")
    return np.split(order, np.cumsum(np.bincount(label, minlength=count))[:-1])


def cluster(points: np.ndarray, normals: np.ndarray, weights: np.ndarray, count: int) -> Clusters:
    """At most `count` groups of (N, 3) points with (N, 3) unit normals and (N,) weights above 0, N >= 1."""
    scale = np.sqrt(12 * points.var(axis=0).sum()) or 1.0
    seeds = _start(points, normals, weights, count)
    centres, turns = points[seeds], normals[seeds]
    label = None
    for _ in range(ROUNDS):
        before, label = label, _nearest(points, normals, centres, turns, scale)
        if before is not None and np.array_equal(label, before):
            break  # nothing moves any more
        share = np.zeros((len(seeds), len(points)))
        share[label, np.arange(len(points))] = weights
        total = share.sum(axis=1)[:, None]
        held = total[:, 0] > 0
        centres = np.where(held[:, None], share @ points / np.where(held[:, None], total, 1.0), centres)
        mean = share @ normals
        length = np.linalg.norm(mean, axis=1, keepdims=True)
        turns = np.where(length > 1e-3 * total, mean / np.maximum(length, 1e-300), normals[seeds])
    label = _nearest(points, normals, centres, turns, scale)
    held, label = np.unique(label, return_inverse=True)
    return _shaped(points, weights, label.reshape(-1), centres[held], turns[held], float(scale))


def _nearest(points, normals, centres, turns, scale: float) -> np.ndarray:
    # |p|^2 + |c|^2 - 2 p c, a matrix product; about the centres' mean, since the difference loses digits far from it.
    middle = centres.mean(axis=0)
    points, centres = points - middle, centres - middle
    squared = (points**2).sum(axis=1)[:, None] + (centres**2).sum(axis=1) - 2.0 * (points @ centres.T)
    apart = np.sqrt(np.maximum(squared, 0.0)) / scale
    cosine = np.clip(normals @ turns.T, -1.0, 1.0)
    return np.argmin(PLACE * apart + TURN * np.arccos(cosine) / np.pi + (cosine < WIDEST), axis=1)


def _start(points: np.ndarray, normals: np.ndarray, weights: np.ndarray, count: int) -> np.ndarray:
    """Numbers of points at equal steps of the weight along curves through space."""
    main = np.argmax(np.concatenate([normals, -normals], axis=1), axis=1)
    order = np.lexsort((morton_codes(points), main))
    passed = np.cumsum(weights[order])
    marks = (np.arange(count) + 0.5) / count * passed[-1]
    return np.unique(order[np.minimum(np.searchsorted(passed, marks), len(order) - 1)])


def _shaped(points, weights, label, centres, turns, scale: float) -> Clusters:
    count = len(centres)
    middle, across, half = np.zeros(count, int), np.zeros((count, 3)), np.zeros((count, 2))
    for k in range(count):
        own = np.flatnonzero(label == k)
        middle[k] = own[np.argmin(np.linalg.norm(points[own] - centres[k], axis=1))]
        share = weights[own] / weights[own].sum()
        offsets = points[own] - share @ points[own]
        offsets = offsets - np.outer(offsets @ turns[k], turns[k])
        # The moments of a sample are smaller than those of what it was drawn from.
        spread = (share[:, None] * offsets).T @ offsets / max(1.0 - float(share @ share), 1e-6)
        moments, axes = np.linalg.eigh(spread)
        half[k] = np.sqrt(3.0 * np.maximum(moments[[2, 1]], 0.0))
        across[k] = _perpendicular(axes[:, 2] if half[k, 0] > 0 else np.zeros(3), turns[k])
    return Clusters(label, middle, centres, turns, across, half, scale)


def _perpendicular(wished: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Unit vector across `normal`, along `wished` as far as that is possible."""
    for direction in (wished, np.eye(3)[np.argmin(np.abs(normal))]):
        flat = direction - normal * (direction @ normal)
        if np.linalg.norm(flat) > 0.5:
            return flat / np.linalg.norm(flat)
    raise ValueError("A normal has no length: every cluster needs a unit normal.")
