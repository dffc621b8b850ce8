"""Which draws a projection needs, joined into as few calls as possible, and which of them may leave out back faces.

On every GPU a shadow map costs vertices and calls before it costs texels. Three exact savings, in order of effect:
draws outside of the view or behind all receivers are left out; neighbouring groups of instances become one call; and
of closed meshes that the light stands outside of, only the faces towards the light are drawn: the surface nearest to
the light, which is all that a depth map keeps, is always one of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..snapshot.scene import Mesh

if TYPE_CHECKING:
    from .geometry import Draw

CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float64)


@dataclass(frozen=True)
class Boxes:
    """Bounds of a list of draws, for testing many views against them."""

    low: np.ndarray  # (D, 3)
    high: np.ndarray
    corners: np.ndarray  # (D, 8, 4) homogeneous

    @classmethod
    def of(cls, draws: list[Draw]) -> Boxes:
        low = np.array([draw.low for draw in draws]).reshape(-1, 3)
        high = np.array([draw.high for draw in draws]).reshape(-1, 3)
        corners = low[:, None] + CORNERS[None] * (high - low)[:, None]
        return cls(low, high, np.concatenate([corners, np.ones((*corners.shape[:2], 1))], axis=-1))

    def seen(self, rows: np.ndarray, least_q: float = -np.inf) -> np.ndarray:
        """(D,) whether a projection with `rows` x, y, w, q may see the box before the depth measure `least_q`."""
        x, y, w, q = np.moveaxis(self.corners @ rows.T, -1, 0)
        outside = (
            (w <= 0).all(-1) | (x > w).all(-1) | (x < -w).all(-1) | (y > w).all(-1) | (y < -w).all(-1)
        )  # fmt: skip
        # By more than what float32 and the slack of the comparison could mistake.
        outside |= ((w > 0) & (q < least_q * w * (1.0 - 1e-3))).all(-1)
        return ~outside

    def without(self, point: np.ndarray) -> np.ndarray:
        """(D,) whether `point` lies outside of the box, by more than rounding."""
        margin = 1e-3 * np.linalg.norm(self.high - self.low, axis=1)[:, None]
        return ((point < self.low - margin) | (point > self.high + margin)).any(axis=1)


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


def closed(mesh: Mesh) -> bool:
    """Whether the triangles bound a volume and face outwards, so that every line out of it leaves by a front face.

    The boundary of the surface is the sum of its directed edges, an edge and its reverse cancelling; it is zero if a
    sum of hashes is, each with the sign of the edge's direction. Outwards means that the signed volume is positive.
    """
    if not mesh.triangle_count:
        return False
    vertices = mesh.corner_vertices[mesh.triangle_corners].astype(np.uint64)
    start, end = vertices, np.roll(vertices, -1, axis=1)
    low, high = np.minimum(start, end), np.maximum(start, end)
    with np.errstate(over="ignore"):
        mixed = (low * np.uint64(0x9E3779B97F4A7C15)) ^ (high * np.uint64(0xC2B2AE3D27D4EB4F) + np.uint64(0x165667B1))
        mixed = (mixed ^ (mixed >> np.uint64(29))) * np.uint64(0xBF58476D1CE4E5B9)
        mixed ^= mixed >> np.uint64(32)
        boundary = mixed[start < end].sum(dtype=np.uint64) - mixed[start > end].sum(dtype=np.uint64)
    if boundary != 0:
        return False
    a, b, c = np.moveaxis(mesh.positions[vertices] - mesh.positions[vertices[0, 0]], 1, 0).astype(np.float64)
    return bool(np.einsum("ti,ti->", a, np.cross(b, c)) > 0.0)
