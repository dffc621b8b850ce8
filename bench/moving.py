"""What moves between frames, and what is new in their errors: shared by the commands that measure motion.

The error of a frame is its mean square; what is new in it, half the mean square of its change from one frame to the
next: 0 where errors stand still, and the error of a frame itself where frames err independently.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np


def shifted(things: Sequence, count: int, step: float) -> Iterator[int]:
    """Numbers of frames; before each but the first the things move so far along X, m."""
    for number in range(count):
        for thing in things:
            thing.location.x += step * (number > 0)
        yield number


def scale_of(truths: Sequence[np.ndarray]) -> np.ndarray:
    """(H, W, 1): by what squares are divided to be relMSE, the mean over frames."""
    luminance = [truth.mean(axis=2) for truth in truths]
    return np.mean([one**2 + (0.1 * one.mean()) ** 2 for one in luminance], axis=0)[..., None]


def of_frame(errors: Sequence[np.ndarray], scale: np.ndarray | float = 1.0) -> float:
    return float((np.square(errors) / scale).mean())


def new_in_it(errors: Sequence[np.ndarray], scale: np.ndarray | float = 1.0) -> float:
    return float((np.square(np.diff(errors, axis=0)).mean(axis=0) / 2 / scale).mean())
