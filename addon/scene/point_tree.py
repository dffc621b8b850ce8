"""A tree over points of surfaces: the discs that they stand for, bounds and normals of groups of them.

A complete binary tree over 2^L points by median splits, in the order of a heap: node 1 is the root, nodes 2k and 2k + 1
are the halves of node k, the last 2^L nodes the points. A group is split where it is longest, in place or, each unit of
a normal counting as NORMAL_WEIGHT of the group's extent, in normal: so that the sides of a box, or both faces of a thin
sheet that are wound the other way, part early and what is left is flat. Ties go by order: coincident points are split,
too.

    node    bounding ball, mean normal, cosine of the half angle of the cone of normals
    point   radius of a disc that has COVER^2 times the area that it stands for
    group   flat: a rectangle that holds its points' discs; else a ball, of a radius that goes by the area

Points that have moved keep their places in the tree: bounds are made anew from the leaves up (refit), at a fifth of the
cost. `numpy` for 2^14 points: 12 ms, 3 ms refitted; 2^18: 0.4 s and 0.08.

Source: Ritschel 2009, chapter 6.2. Ours: splits by normal, discs by area.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..gfx import images
from .pieces import octahedral

COVER = 1.5  # radius of a disc beside that of the area which it stands for (holes: see area_points.py)
NORMAL_WEIGHT = 1.2  # more than one: faces at right angles part before what is longest is cut
FLAT = 0.7  # cosine of the half angle of a cone of normals, up to which a group is drawn as a disc
LOOSE = 3.0  # area of a rectangle beside that of the group that it stands for
NODE_TEXELS = 3


@dataclass(frozen=True)
class PointTree:
    """`order` (n,): the points in the order of leaves. By node (2 n; 0 is unused): `centre` (2 n, 3), `radius` of the
    bounding ball, `axis` (2 n, 3), `cone` (cosine), `disc` (radius), `area`, m2, `along` (2 n, 3), a side of a flat
    group's rectangle, and `half` (2 n, 2) of its lengths along and across."""

    order: np.ndarray
    centre: np.ndarray
    radius: np.ndarray
    axis: np.ndarray
    cone: np.ndarray
    disc: np.ndarray
    area: np.ndarray
    along: np.ndarray
    half: np.ndarray

    @property
    def flat(self) -> np.ndarray:
        """(2 n,) groups that a rectangle stands for: those whose rectangle is not much larger than they are."""
        return (self.cone >= FLAT) & (4.0 * self.half.prod(axis=1) <= LOOSE * self.area)

    @property
    def leaves(self) -> int:
        return len(self.order)

    def packed(self) -> np.ndarray:
        """(2 n NODE_TEXELS, 4) float32 for shaders/micro/buffer.glsl: centre, radius of the ball; octahedral axis,
        cosine, radius of the disc (negative: of a ball); octahedral side of the rectangle, its half lengths."""
        rows = np.zeros((2 * self.leaves, NODE_TEXELS, 4), np.float32)
        rows[:, 0, :3], rows[:, 0, 3] = self.centre, self.radius
        rows[:, 1, :2], rows[:, 1, 2] = octahedral(self.axis), self.cone
        rows[:, 1, 3] = np.where(self.flat, self.disc, -self.disc / 2)  # of a ball: a quarter of the area
        rows[self.leaves :, 1, 3] = self.disc[self.leaves :]
        rows[:, 2, :2], rows[:, 2, 2:] = octahedral(self.along), self.half
        return rows.reshape(-1, 4)

    def upload(self) -> images.Image:
        return images.upload_list(self.packed())


def split(positions: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """The order (n,) of leaves of n = 2^L points (n, 3) with unit normals."""
    count = len(positions)
    keys = np.concatenate([positions, normals], axis=1)
    order = np.arange(count)
    parts = 1
    while parts < count:
        grouped = keys[order].reshape(parts, count // parts, 6)
        extent = grouped.max(axis=1) - grouped.min(axis=1)
        extent[:, 3:] *= NORMAL_WEIGHT * extent[:, :3].max(axis=1, keepdims=True)
        axis = extent.argmax(axis=1)
        along = np.take_along_axis(grouped, axis[:, None, None], axis=2)[:, :, 0]
        within = np.argsort(along, axis=1, kind="stable")
        order = np.take_along_axis(order.reshape(parts, -1), within, axis=1).reshape(-1)
        parts *= 2
    return order


def fitted(order: np.ndarray, positions: np.ndarray, normals: np.ndarray, areas: np.ndarray) -> PointTree:
    """The tree over points (n, 3) with unit normals and the areas (n,) that they stand for, in a known order."""
    n = len(order)
    place, normal, area = positions[order], normals[order], areas[order]
    disc = COVER * np.sqrt(area / np.pi)
    centre, axis = np.zeros((2 * n, 3)), np.zeros((2 * n, 3))
    radius, cone, whole = np.zeros(2 * n), np.ones(2 * n), np.zeros(2 * n)
    centre[n:], axis[n:], radius[n:], whole[n:] = place, normal, disc, area
    along, half = np.zeros((2 * n, 3)), np.zeros((2 * n, 2))
    along[:] = (1.0, 0.0, 0.0)
    parts = n // 2
    while parts:
        own = slice(parts, 2 * parts)
        of_node, of_normal = place.reshape(parts, -1, 3), normal.reshape(parts, -1, 3)
        low, high = of_node.min(axis=1), of_node.max(axis=1)
        whole[own] = area.reshape(parts, -1).sum(axis=1)
        sums = (normal * area[:, None]).reshape(parts, -1, 3).sum(axis=1)
        length = np.linalg.norm(sums, axis=1, keepdims=True)
        axis[own] = np.where(length > 1e-6 * whole[own][:, None], sums / np.maximum(length, 1e-300), (0.0, 0.0, 1.0))
        cone[own] = (of_normal @ axis[own][:, :, None])[..., 0].min(axis=1)
        along[own], across = _sides(axis[own], high - low)
        middle = (low + high) / 2
        margin = COVER * np.sqrt(whole[own] / of_node.shape[1] / np.pi)
        for number, side in enumerate((along[own], across)):
            reach = ((of_node - middle[:, None]) @ side[:, :, None])[..., 0]
            first, last = reach.min(axis=1), reach.max(axis=1)
            half[own, number] = (last - first) / 2 + margin
            middle = middle + side * ((first + last) / 2)[:, None]
        centre[own] = middle
        away = np.linalg.norm(of_node - middle[:, None], axis=2) + disc.reshape(parts, -1)
        radius[own] = np.maximum(away.max(axis=1), np.linalg.norm(half[own], axis=1) * (cone[own] >= FLAT))
        parts //= 2
    return PointTree(order, centre, radius, axis, cone, COVER * np.sqrt(whole / np.pi), whole, along, half)


def _sides(axis: np.ndarray, extent: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) twice: sides of rectangles with these normals, the first one nearest to that axis of space along which the
    group is longest, as medians cut it."""
    longest = np.eye(3)[(extent * (1.0 - np.abs(axis)) + 1e-30 * (1.0 - np.abs(axis))).argmax(axis=1)]
    along = longest - axis * (longest * axis).sum(axis=1, keepdims=True)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    return along, np.cross(axis, along)
