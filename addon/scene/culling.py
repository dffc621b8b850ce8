"""Which draws a projection needs, joined into as few calls as possible, and which of them may leave out back faces.

On every GPU a shadow map costs vertices and calls before it costs texels. Three exact savings, in order of effect:
draws outside of the view or behind all receivers are left out; neighbouring groups of instances become one call; and
of closed meshes that the light stands outside of, only the faces towards the light are drawn: the surface nearest to
the light, which is all that a depth map keeps, is always one of them. So are those of shells of relief that any viewer
stands outside of: rays look for the surface where they come in.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..gfx import device
from ..snapshot.scene import Mesh

if TYPE_CHECKING:
    from .geometry import Draw

LARGEST_OPEN, MOST_PARTS = 20_000, 64  # triangles and parts of a mesh that is taken apart
# Of rows x, y, w, q: what is above 0 within a view.
SIDES = np.array([[0, 0, 1, 0], [-1, 0, 1, 0], [1, 0, 1, 0], [0, -1, 1, 0], [0, 1, 1, 0]], np.float64)
CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float64)


@dataclass(frozen=True)
class Boxes:
    """Bounds of draws, for testing views against all of them at once."""

    centre: np.ndarray  # (D, 3)
    half: np.ndarray

    @classmethod
    def between(cls, low: np.ndarray, high: np.ndarray) -> Boxes:
        """Boxes from corners (D, 3); an empty list may have any shape."""
        low, high = np.asarray(low, np.float64).reshape(-1, 3), np.asarray(high, np.float64).reshape(-1, 3)
        return cls((low + high) / 2, (high - low) / 2)

    @classmethod
    def of(cls, draws: list[Draw]) -> Boxes:
        return cls.between([draw.low for draw in draws], [draw.high for draw in draws])

    @cached_property
    def _columns(self) -> np.ndarray:
        """(7, D) centre, 1 and half axes."""
        return np.concatenate([self.centre.T, np.ones((1, len(self.centre))), self.half.T])

    def seen(self, rows: np.ndarray, least_q: float = -np.inf) -> np.ndarray:
        """(D,) whether a projection with `rows` x, y, w, q may see the box before the depth measure `least_q`.

        Each condition is a linear form, whose extremes over a box are its value at the centre and its reach over the
        half axes: nothing is lost against testing all corners.
        """
        forms = SIDES @ rows  # w, w - x, w + x, w - y, w + y
        most = np.concatenate([forms, np.abs(forms[:, :3])], axis=1) @ self._columns
        seen = (most.min(axis=0) >= 0) & (most[0] > 0)
        if math.isfinite(least_q):
            # By more than what float32 and the slack of the comparison could mistake.
            before = rows[3] - least_q * (1.0 - 1e-3) * rows[2]
            ends = np.array([(*before, *np.abs(before[:3])), (*forms[0], *-np.abs(forms[0, :3]))]) @ self._columns
            seen &= (ends[0] >= 0) | (ends[1] <= 0)  # some of it nearer, or beside the eye
        return seen

    def without(self, point: np.ndarray) -> np.ndarray:
        """(D,) whether `point` lies outside of the box, by more than rounding."""
        margin = 2e-3 * np.linalg.norm(self.half, axis=1)[:, None]
        return (np.abs(point - self.centre) > self.half + margin).any(axis=1)


def entered(draws: list[Draw], boxes: Boxes, rows: np.ndarray) -> frozenset[int]:
    """Materials of which a projection with `rows` x, y, w, q shows shells alone, and stands outside of all of them."""
    if not any(draw.prisms for draw in draws):
        return frozenset()
    x, y, w, q = np.asarray(rows, np.float64)
    if np.dot(np.cross(x[:3], y[:3]), q[:3] - w[:3]) < 0.0:  # a picture turned around: back faces are front faces
        return frozenset()
    shown = np.array([draw.prisms for draw in draws], bool)
    if w[:3].any():
        planes = np.stack([x, y, w])
        shown &= boxes.without(np.linalg.lstsq(planes[:, :3], -planes[:, 3], rcond=None)[0])
    material = np.array([draw.material for draw in draws])
    return frozenset(material.tolist()) - frozenset(material[~shown].tolist())


@dataclass(frozen=True)
class Call:
    """One draw call: `count` instances from `first` on."""

    draw: Draw
    first: int
    count: int

    @property
    def triangles(self) -> int:
        return self.draw.batch.triangles * self.count


def calls(draws: list[Draw], indices: Iterable[int]) -> Iterator[Call]:
    """The draws of `indices` (ascending), neighbouring groups of instances joined."""
    current: Call | None = None
    for index in indices:
        draw = draws[index]
        if current is None:
            current = Call(draw, draw.first, draw.count)
        elif draw.batch is current.draw.batch and draw.first == current.first + current.count:
            current = Call(current.draw, current.first, current.count + draw.count)
        else:
            yield current
            current = Call(draw, draw.first, draw.count)
    if current is not None:
        yield current


CALL_OF_PASS = 0.2  # what a call takes, by a pass with all its bindings


def joined(first: np.ndarray, seen: np.ndarray) -> list[tuple[int, int]]:
    """First triangle and number of triangles of the calls that draw the chunks of a mask `seen` (C,), which begin with
    triangles `first` (C + 1,): what lies between two runs is drawn, too, where that costs this device less than a
    call."""
    if not seen.any():
        return []
    edges = np.flatnonzero(np.diff(np.concatenate([[False], seen, [False]])))
    starts, ends = first[edges[0::2]].tolist(), first[edges[1::2]].tolist()
    costs = device.current()
    most = CALL_OF_PASS * costs.python / max(costs.triangle, 1e-9)
    runs, begin, end = [], starts[0], ends[0]
    for start, stop in zip(starts[1:], ends[1:]):
        if start - end > most:
            runs.append((begin, end - begin))
            begin = start
        end = stop
    return [*runs, (begin, end - begin)]


def closed(positions: np.ndarray, triangles: np.ndarray) -> bool:
    """Whether triangles (T, 3) over `positions` (V, 3) bound a volume and face outwards: every line out of it leaves by
    a front face.

    The boundary of the surface is the sum of its directed edges, an edge and its reverse cancelling; it is zero if a
    sum of hashes is, each with the sign of the edge's direction. Outwards means that the signed volume is positive.
    """
    if not len(triangles):
        return False
    start = triangles.astype(np.uint64)
    end = np.roll(start, -1, axis=1)
    low, high = np.minimum(start, end), np.maximum(start, end)
    with np.errstate(over="ignore"):
        mixed = (low * np.uint64(0x9E3779B97F4A7C15)) ^ (high * np.uint64(0xC2B2AE3D27D4EB4F) + np.uint64(0x165667B1))
        mixed = (mixed ^ (mixed >> np.uint64(29))) * np.uint64(0xBF58476D1CE4E5B9)
        mixed ^= mixed >> np.uint64(32)
        boundary = mixed[start < end].sum(dtype=np.uint64) - mixed[start > end].sum(dtype=np.uint64)
    corners = positions[triangles].astype(np.float64)
    return bool(boundary == 0 and _volume(corners, corners[0, 0]) > 0.0)


def _volume(corners: np.ndarray, apex: np.ndarray) -> float:
    """Six times the signed volume of the cones from `apex` to triangles (T, 3, 3)."""
    a, b, c = np.moveaxis(corners - apex, 1, 0)
    return float(np.einsum("ti,ti->", a, np.cross(b, c)))


def closed_triangles(mesh: Mesh) -> np.ndarray:
    """(T,) which triangles belong to closed parts of the mesh: the crown of a tree, but not its open trunk.

    Parts hang together by their vertices. Large open meshes and those of many parts are not taken apart.
    """
    triangles = mesh.corner_vertices[mesh.triangle_corners]
    if closed(mesh.positions, triangles):
        return np.ones(len(triangles), bool)
    found = np.zeros(len(triangles), bool)
    if len(triangles) <= LARGEST_OPEN:
        label = parts(triangles, len(mesh.positions))
        names = np.unique(label)
        for name in names if len(names) <= MOST_PARTS else ():
            own = label == name
            found[own] = closed(mesh.positions, triangles[own])
    return found


def parts(triangles: np.ndarray, vertices: int) -> np.ndarray:
    """(T,) a number that triangles share if they hang together: the least vertex of their part."""
    label = np.arange(vertices)
    while True:
        before = label.copy()
        least = label[triangles].min(axis=1)
        for corner in range(3):
            np.minimum.at(label, triangles[:, corner], least)
        label = label[label]  # follow what the least vertex has learnt itself
        if np.array_equal(label, before):
            return label[triangles[:, 0]]
