"""A grid along the view, in which light of media is found once for all pixels that look through it.

Columns of up to CELL pixels a side and SLICES by distance from the eye, even in d / (d + scale), from where media begin
to where they end or let nothing pass (shaders/media/froxels.glsl). All of it moves by a part of a cell from sample to
sample.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..frame.picture import Frame
from ..gfx import images
from ..scene.media import Media

CELL = 16  # pixels of a column's side
LEAST_ROWS = 12  # columns along the shorter side, of pictures that have so many pixels
SLICES = 16
DEEP = 7.0  # optical depth behind which nothing of a medium without an end is seen
CONSTANTS = (("IVEC4", "froxel_shape"), ("VEC4", "froxel_range"), ("VEC2", "froxel_shift"))


@dataclass(frozen=True)
class Froxels:
    """The grid of one sample."""

    shape: tuple[int, int, int]
    cell: int
    range: tuple[float, float, float]  # of d / (d + scale), and the scale in metres
    shift: tuple[float, float]  # in cells

    @property
    def size(self) -> tuple[int, int]:
        """Texels of the images that hold it, slice above slice."""
        columns, rows, slices = self.shape
        return columns, rows * slices

    @property
    def constants(self) -> dict[str, object]:
        """Of programs that read or fill it, by CONSTANTS."""
        return {
            "froxel_shape": (*self.shape, self.cell), "froxel_range": (*self.range, 0.0), "froxel_shift": self.shift,
        }  # fmt: skip

    def take(self, count: int) -> tuple[images.Image, ...]:
        """Images for it from the pool."""
        return tuple(images.pool.take(*self.size, "RGBA32F") for _ in range(count))


def froxels(frame: Frame, media: Media) -> Froxels:
    """The grid of this sample."""
    cell = int(np.clip(min(frame.size) // LEAST_ROWS, 1, CELL))
    columns, rows = (-(-side // cell) + 1 for side in frame.size)
    near, far = reach(frame, media)
    scale = max(min(far, near + frame.geometry.size), 1e-20)
    first, last = near / (near + scale), far / (far + scale)
    shift = frame.random("froxels/shift")
    return Froxels((columns, rows, SLICES), cell, (first, last, scale), (float(shift[0]), float(shift[1])))


def reach(frame: Frame, media: Media) -> tuple[float, float]:
    """Distances from the eye where the media of a scene begin and end, in metres."""
    camera = frame.snapshot.camera
    eye = camera.matrix[:3, 3] - frame.geometry.origin
    near, far = np.inf, 0.0
    for one in media.found:
        if one.corners is None:
            near = 0.0
            taken = one.medium.scattering + one.medium.absorption if not one.varies else np.zeros(3)
            least = float(np.min(np.asarray(taken, float)))
            end = DEEP / least if least > 0 else np.inf
            far = max(far, min(end, 100.0 * frame.geometry.size))
            continue
        places = one.corners.reshape(-1, 3)
        low, high = places.min(axis=0), places.max(axis=0)
        away = np.linalg.norm(np.maximum(np.maximum(low - eye, eye - high), 0.0))
        if camera.kind == "ORTHOGRAPHIC":  # rays begin anywhere on a plane
            away = 0.0
        near = min(near, away)
        far = max(far, np.linalg.norm(np.maximum(np.abs(low - eye), np.abs(high - eye))))
    near = max(near, camera.clip_start) if np.isfinite(near) else camera.clip_start
    return float(near), float(max(far, near * 1.001, 1e-20))
