"""Receivers: what the camera sees, as boxes, to which views from lights are fitted."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .culling import CORNERS

TILE = 16  # pixels along each side of what a shader makes a box of


@dataclass(frozen=True)
class Receivers:
    """Boxes around what the camera sees, relative to the render origin, in order of distance from the camera."""

    low: np.ndarray  # (T, 3)
    high: np.ndarray  # (T, 3)
    distance: np.ndarray  # (T,) from the camera, metres
    side: int = TILE  # pixels along each side of what a box is around

    @cached_property
    def typical_distance(self) -> float:
        """The median, m; asked where there are any."""
        return float(np.median(self.distance))

    @property
    def corners(self) -> np.ndarray:
        """(T, 8, 3)"""
        return self.low[:, None] + CORNERS[None] * (self.high - self.low)[:, None]

    def groups(self) -> list[np.ndarray]:
        """Indices by distance, each group reaching at most four times as far as the one before."""
        if not len(self.distance):
            return []
        far = max(float(self.distance.max()), 1e-30)
        level = np.clip(np.floor(np.log(far / np.maximum(self.distance, far * 1e-9)) / np.log(4.0)), 0, 3)
        return [np.flatnonzero(level == k) for k in (3, 2, 1, 0) if (level == k).any()]


MOST = 1024  # boxes: each map of a light is fitted to all of them, on the processor


def merged(low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Bounds of tiles, (rows, columns, 4) each, as bounds of squares of so many tiles a side that MOST are left at
    most; and that number. A tile in which nothing is seen has low above high."""
    rows, columns = low.shape[:2]
    side = 1
    while -(-rows // side) * -(-columns // side) > MOST:
        side += 1
    if side > 1:
        for axis, extent in enumerate((rows, columns)):
            low = np.minimum.reduceat(low, range(0, extent, side), axis=axis)
            high = np.maximum.reduceat(high, range(0, extent, side), axis=axis)
    return low, high, side
