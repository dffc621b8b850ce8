"""Morton order: numbers that are close for points that are close."""

from __future__ import annotations

import numpy as np

BITS = 63


def morton_codes(points: np.ndarray, bounds: tuple[np.ndarray, np.ndarray] | None = None) -> np.ndarray:
    """Morton codes, BITS long, of (N, 3) points within `bounds`, lowest and highest, or their own."""
    if not len(points):
        return np.zeros(0, np.uint64)
    # Of an axis at a time: along one of three numpy takes ten times as long.
    low, high = bounds or ([joined(points[:, k]) for k in range(3)] for joined in (np.min, np.max))
    low, high = np.asarray(low), np.asarray(high)
    extent = max(float((high - low).max()), 1e-30)
    grid = np.clip((points - low) / extent * (2**21 - 1), 0, 2**21 - 1).astype(np.uint64)
    code = np.zeros(len(points), np.uint64)
    for axis in range(3):
        x = grid[:, axis]
        for shift, mask in (
            (32, 0x1F00000000FFFF), (16, 0x1F0000FF0000FF), (8, 0x100F00F00F00F00F),
            (4, 0x10C30C30C30C30C3), (2, 0x1249249249249249),
        ):  # fmt: skip
            x = (x | (x << np.uint64(shift))) & np.uint64(mask)
        code |= x << np.uint64(axis)
    return code
