"""A tree over points of surfaces: the discs that they stand for, bounds and normals of groups of them.

A complete binary tree over 2^L points, in the order of a heap: node 1 is the root, nodes 2k and 2k + 1 are the halves
of node k, the last 2^L nodes the points. Points of one triangle stand in a row, and the triangle is cut where nodes
part them (area_points.py), so that each group of them is a triangle, too. What is left is split by medians where it is
longest, in place or, each unit of a normal counting as NORMAL_WEIGHT of its extent, in normal: so that the sides of a
box, or both faces of a thin sheet that are wound the other way, part early. Ties go by order.

    node    bounding ball, mean normal, how far off the plane through its middle it reaches
    point   a piece of a triangle, or the radius of a disc that has COVER^2 times the area that it stands for
    group   a triangle; flat: a rectangle that holds its pieces and discs; else a ball, whose radius goes by the area

A rectangle lies along an edge of a piece's triangle; one that is more than EXACT times as large as its pieces stands
for nothing. Nor do groups with a piece on which something stands (`opened`).

Points that have moved keep their places in the tree: bounds are made anew from the leaves up (refit). `numpy` for 2^14
points: 0.2 s, 0.1 refitted; 2^18: 2 s and 1.

Source: Ritschel 2009, chapter 6.2. Ours: splits by normal, discs by area, pieces.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..gfx import images
from .pieces import octahedral

COVER = 1.5  # radius of a disc beside that of the area which it stands for (holes: see area_points.py)
NORMAL_WEIGHT = 1.2  # more than one: faces at right angles part before what is longest is cut
FLAT = 0.7  # cosine of the half angle of a cone of normals, up to which a group is drawn as a disc
LOOSE = 3.0  # area of a rectangle beside that of the group that it stands for
EXACT = 1.5  # the same of a group of pieces
STRAIGHT = 1e-9  # of an edge's square: what two parts of it may bend
NODE_TEXELS = 3


@dataclass(frozen=True)
class PointTree:
    """`order` (n,): the points in the order of leaves. By node (2 n; 0 is unused): `centre` (2 n, 3), `radius` of the
    bounding ball, `axis` (2 n, 3), `cone` (cosine), `disc` (radius), `area`, m2, `along` (2 n, 3), a side of a flat
    group's rectangle, and `half` (2 n, 2) of its lengths along and across; `exact` (2 n,): no discs are below; `piece`
    (2 n,): a triangle; `thick` (2 n,): how far it reaches off the plane through its middle.

    Of a node that is a piece, `centre` is the middle of its longest edge, which runs along `along`, `disc` half of its
    length, and `half` where the third corner is, across from 0 up. `half` of a disc is 0."""

    order: np.ndarray
    centre: np.ndarray
    radius: np.ndarray
    axis: np.ndarray
    cone: np.ndarray
    disc: np.ndarray
    area: np.ndarray
    along: np.ndarray
    half: np.ndarray
    exact: np.ndarray
    piece: np.ndarray
    thick: np.ndarray

    @property
    def flat(self) -> np.ndarray:
        """(2 n,) groups that a rectangle stands for: those whose rectangle is not much larger than they are."""
        loose = np.where(self.exact, EXACT, LOOSE)
        return ~self.piece & (self.cone >= FLAT) & (4.0 * self.half.prod(axis=1) <= loose * self.area)

    @property
    def leaves(self) -> int:
        return len(self.order)

    def opened(self, leaves: np.ndarray) -> PointTree:
        """The tree whose groups that hold one of `leaves` (n,) bool are never drawn as the rectangle or the piece that
        they are: light differs within them."""
        held = np.zeros(2 * self.leaves, bool)
        held[self.leaves :] = leaves
        for level in range(self.leaves.bit_length() - 2, -1, -1):
            first = 1 << level
            held[first : 2 * first] = held[2 * first : 4 * first].reshape(-1, 2).any(axis=1)
        held[self.leaves :] = False
        return replace(self, piece=self.piece & ~held, cone=np.where(held, -1.0, self.cone))

    def packed(self) -> np.ndarray:
        """(2 n NODE_TEXELS, 4) float32 for shaders/micro/buffer.glsl: centre, radius of the ball; octahedral axis,
        thickness or, of a piece, less than 0: its height; radius of the disc (negative: of a ball); octahedral side of
        the rectangle, its half lengths."""
        rows = np.zeros((2 * self.leaves, NODE_TEXELS, 4), np.float32)
        rows[:, 0, :3], rows[:, 0, 3] = self.centre, self.radius
        rows[:, 1, :2], rows[:, 1, 2] = octahedral(self.axis), np.where(self.piece, -self.half[:, 1], self.thick)
        rows[:, 1, 3] = np.where(self.flat, self.disc, -self.disc / 2)  # of a ball: a quarter of the area
        drawn = self.piece.copy()
        drawn[self.leaves :] = True
        rows[drawn, 1, 3] = self.disc[drawn]
        rows[:, 2, :2], rows[:, 2, 2:] = octahedral(self.along), self.half
        return rows.reshape(-1, 4)

    def upload(self) -> images.Image:
        return images.upload_list(self.packed())


def split(positions: np.ndarray, normals: np.ndarray, sides: np.ndarray | None = None) -> np.ndarray:
    """The order (n,) of leaves of n = 2^L points (n, 3) with unit normals. A group is cut along the direction `sides`
    (n, 3) of one of its points and across it; along the axes of space where that is 0."""
    count = len(positions)
    order = np.arange(count)
    parts = 1
    while parts < count:
        place, normal = positions[order].reshape(parts, -1, 3), normals[order].reshape(parts, -1, 3)
        if sides is not None:
            first = order.reshape(parts, -1)[:, 0]
            place = place @ _frames(normals[first], sides[first])
        grouped = np.concatenate([place, normal], axis=2)
        extent = grouped.max(axis=1) - grouped.min(axis=1)
        extent[:, 3:] *= NORMAL_WEIGHT * extent[:, :3].max(axis=1, keepdims=True)
        axis = extent.argmax(axis=1)
        along = np.take_along_axis(grouped, axis[:, None, None], axis=2)[:, :, 0]
        along = along - along.min(axis=1, keepdims=True)
        # What stands in a row stays so where it is turned.
        along = np.round(along / np.maximum(along.max(axis=1, keepdims=True), 1e-300), 9)
        within = np.argsort(along, axis=1, kind="stable")
        order = np.take_along_axis(order.reshape(parts, -1), within, axis=1).reshape(-1)
        parts *= 2
    return order


def parting(first: np.ndarray, count: np.ndarray) -> np.ndarray:
    """How many of `count` (N,) leaves, two or more, from `first` on lie in the first child of the smallest node of a
    heap that holds them all."""
    last = first + count - 1
    level = np.frexp((first ^ last).astype(float))[1] - 1
    return np.where(count > 1, ((last >> level) << level) - first, 1)


def arranged(place: np.ndarray, normal: np.ndarray, sides: np.ndarray, leaves: np.ndarray) -> np.ndarray:
    """The order (M,) of things at places (M, 3), each with a number of leaves in a row: as `split`, but that those with
    more than one leaf stay whole. `sides`: as there, of those with one."""
    order, edges = np.arange(len(place)), np.array([0, len(place)])
    while len(place) and len(edges) <= len(place):
        wide = np.diff(edges) > 1
        at = np.flatnonzero(np.repeat(wide, np.diff(edges)))  # what is not by itself yet, part by part
        size = np.diff(edges)[wide]
        start = np.cumsum(size) - size
        part, own = np.repeat(np.arange(len(size)), size), order[at]
        first = own[start]
        alone = (np.maximum.reduceat(leaves[own], start) == 1)[:, None]
        frames = _frames(normal[first], np.where(alone, sides[first], 0.0))
        grouped = np.concatenate([np.einsum("ni,nij->nj", place[own], frames[part]), normal[own]], axis=1)
        low = np.minimum.reduceat(grouped, start)
        extent = np.maximum.reduceat(grouped, start) - low
        extent[:, 3:] *= NORMAL_WEIGHT * extent[:, :3].max(axis=1, keepdims=True)
        axis, row = extent.argmax(axis=1)[part], np.arange(len(own))
        along = grouped[row, axis] - low[part, axis]
        along = np.round(along / np.maximum(np.maximum.reduceat(along, start)[part], 1e-300), 9)
        order[at] = own[np.lexsort((along, part))]
        last = np.cumsum(leaves[order])
        begun, count = (last - leaves[order])[at][start], np.add.reduceat(leaves[order][at], start)
        middle = (begun + parting(begun, count))[part]
        # What lies across the middle stands between both halves.
        side = np.where(last[at] <= middle, 0, np.where(last[at] - leaves[order][at] >= middle, 2, 1))
        key = 3 * part + side
        edges = np.union1d(edges, at[1:][key[1:] != key[:-1]])
    return order


def _frames(normal: np.ndarray, side: np.ndarray) -> np.ndarray:
    """(N, 3, 3) along, across and up as columns; the axes of space where `side` is 0."""
    length = np.linalg.norm(side, axis=1, keepdims=True)
    along = side / np.maximum(length, 1e-300)
    frame = np.stack([along, np.cross(normal, along), normal], axis=2)
    return np.where((length > 0.0)[:, :, None], frame, np.eye(3))


def fitted(
    order: np.ndarray, positions: np.ndarray, normals: np.ndarray, areas: np.ndarray, pieces: np.ndarray | None = None,
    sides: np.ndarray | None = None,
) -> PointTree:  # fmt: skip
    """The tree over points (n, 3) with unit normals and the areas (n,) that they stand for, in a known order. `pieces`
    (n, 3, 3): corners of what they stand for, NaN: discs; with directions (n, 3) along which their groups lie."""
    n = len(order)
    place, normal, area = positions[order], normals[order], areas[order]
    disc = COVER * np.sqrt(area / np.pi)
    corners = np.repeat(place[:, None], 3, axis=1)
    centre, axis = np.zeros((2 * n, 3)), np.zeros((2 * n, 3))
    radius, cone, whole, exact = np.zeros(2 * n), np.ones(2 * n), np.zeros(2 * n), np.zeros(2 * n, bool)
    along, half = np.zeros((2 * n, 3)), np.zeros((2 * n, 2))
    along[:] = (1.0, 0.0, 0.0)
    if pieces is not None:
        own = exact[n:] = np.isfinite(pieces[order]).all(axis=(1, 2))
        corners[own] = pieces[order][own]
    centre[n:], axis[n:], radius[n:], whole[n:] = place, normal, disc, area
    piece = np.zeros(2 * n, bool)
    piece[n:] = exact[n:]
    triangle = np.full((2 * n, 3, 3), np.nan)
    triangle[n:] = corners
    thick = np.zeros(2 * n)
    overhang = np.where(exact[n:], 0.0, disc)  # of corners
    wanted = np.zeros((n, 3)) if sides is None else sides[order] * exact[n:, None]
    whole_pieces = not overhang.any()
    low, high = corners.min(axis=1), corners.max(axis=1)
    parts = n // 2
    while parts:
        level = slice(parts, 2 * parts)
        of_node, of_normal = corners.reshape(parts, -1, 3), normal.reshape(parts, -1, 3)
        low, high = low.reshape(parts, 2, 3).min(axis=1), high.reshape(parts, 2, 3).max(axis=1)
        whole[level] = area.reshape(parts, -1).sum(axis=1)
        exact[level] = exact[n:].reshape(parts, -1).all(axis=1)
        sums = (normal * area[:, None]).reshape(parts, -1, 3).sum(axis=1)
        length = np.linalg.norm(sums, axis=1, keepdims=True)
        axis[level] = np.where(
            length > 1e-6 * whole[level][:, None], sums / np.maximum(length, 1e-300), (0.0, 0.0, 1.0)
        )
        cone[level] = np.einsum("nki,ni->nk", of_normal, axis[level]).min(axis=1)
        largest = area.reshape(parts, -1).argmax(axis=1) + np.arange(parts) * (n // parts)
        along[level], across = _sides(axis[level], high - low, wanted[largest])
        middle = (low + high) / 2
        margin = np.where(exact[level], 0.0, COVER * np.sqrt(whole[level] / (n // parts) / np.pi))
        for number, side in enumerate((along[level], across)):
            reach = np.einsum("nki,ni->nk", of_node, side)
            first, last = reach.min(axis=1), reach.max(axis=1)
            half[level, number] = (last - first) / 2 + margin
            middle = middle + side * ((first + last) / 2 - (middle * side).sum(axis=1))[:, None]
        centre[level] = middle
        off = of_node - middle[:, None]
        piece[level], triangle[level] = _joined(piece[2 * parts : 4 * parts], triangle[2 * parts : 4 * parts])
        rise = np.abs(np.einsum("nki,ni->nk", off, axis[level]))
        thick[level] = (rise if whole_pieces else rise + np.repeat(overhang, 3).reshape(parts, -1)).max(axis=1)
        away = np.sqrt(np.einsum("nki,nki->nk", off, off))
        away = (away if whole_pieces else away + np.repeat(overhang, 3).reshape(parts, -1)).max(axis=1)
        radius[level] = np.maximum(away, np.linalg.norm(half[level], axis=1) * (cone[level] >= FLAT))
        parts //= 2
    disc_of_node = COVER * np.sqrt(whole / np.pi)
    disc_of_node[n:] = disc
    _set_pieces(centre, along, half, radius, disc_of_node, triangle, axis, np.flatnonzero(piece))
    thick[n:] = 0.0
    thick[piece] = 0.0
    return PointTree(order, centre, radius, axis, cone, disc_of_node, whole, along, half, exact, piece, thick)


def _joined(piece: np.ndarray, triangle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which pairs of pieces (2 N,) are the halves of a triangle, (N,), and its corners (N, 3, 3)."""
    both, whole = np.zeros(len(piece) // 2, bool), triangle[0::2].copy()
    for first in range(3):
        for second in range(3):
            left, right = np.roll(triangle[0::2], first, axis=1), np.roll(triangle[1::2], second, axis=1)
            joined = np.stack([left[:, 0], right[:, 1], left[:, 2]], axis=1)
            edge, part = joined[:, 1] - joined[:, 0], left[:, 1] - left[:, 0]
            bend = np.linalg.norm(np.cross(edge, part), axis=1)
            good = (left[:, 1:] == right[:, [0, 2]]).all(axis=(1, 2)) & ~both
            good &= bend <= STRAIGHT * (edge * edge).sum(axis=1)
            both |= good
            whole[good] = joined[good]
    return both & piece[0::2] & piece[1::2], whole


def _set_pieces(centre, along, half, radius, disc, triangle, normal, own: np.ndarray) -> None:
    """Fill in what nodes `own` say about their pieces, see PointTree."""
    piece = triangle[own]
    longest = np.linalg.norm(np.roll(piece, -1, axis=1) - piece, axis=2).argmax(axis=1)
    a, b, c = (piece[np.arange(len(own)), (longest + k) % 3] for k in range(3))
    edge = b - a
    length = np.linalg.norm(edge, axis=1)
    side = edge / np.maximum(length, 1e-300)[:, None]
    middle = (a + b) / 2
    across = np.cross(normal[own], side)
    apex = c - middle
    up = (apex * across).sum(axis=1)
    side = side * np.where(up < 0.0, -1.0, 1.0)[:, None]
    centre[own], along[own], disc[own] = middle, side, length / 2
    half[own, 0], half[own, 1] = (apex * side).sum(axis=1), np.maximum(np.abs(up), 1e-30)
    radius[own] = np.maximum(length / 2, np.linalg.norm(apex, axis=1))


def _sides(axis: np.ndarray, extent: np.ndarray, wanted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) twice: sides of rectangles with these normals, the first one nearest to the direction `wanted` or, where
    that is 0, to that axis of space along which the group is longest, as medians cut it."""
    longest = np.eye(3)[(extent * (1.0 - np.abs(axis)) + 1e-30 * (1.0 - np.abs(axis))).argmax(axis=1)]
    size = np.linalg.norm(wanted, axis=1, keepdims=True)
    longest = np.where(size > 0.0, wanted / np.maximum(size, 1e-300), longest)
    along = longest - axis * (longest * axis).sum(axis=1, keepdims=True)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    return along, np.cross(axis, along)
