"""Counters whose amounts only the GPU knows: they add up in an image, and are read with the picture, so that none of
them stops the queue.

Each counter is a texel of an image of MOST x 1. What is counted is the first number of a texel of some image, drawn
there by blending. One read holds the picture and, in a row below, the sums.
"""

from __future__ import annotations

import numpy as np

from ..gfx import images
from ..gfx.readback import put

MOST = 16

Counter = tuple[str, str, int]  # technique, name, and what a count stands for


class TexelCounters:
    """Those of a picture. `drop` gives the image back."""

    def __init__(self):
        self._counters: list[Counter] = []
        self._sums: images.Target | None = None

    def add(self, counter: Counter, image: images.Image, at: tuple[int, int]) -> None:
        """Add the first number of the texel `at` of an image. ValueError beyond MOST counters."""
        if self._sums is None:
            self._sums = images.Target((images.pool.take(MOST, 1, "RGBA32F"),))
        if counter not in self._counters:
            if len(self._counters) == MOST:
                raise ValueError(f"More than {MOST} counters are kept in images.")
            if not self._counters:
                self._sums.clear()
            self._counters.append(counter)
        put(image, self._sums, self._counters.index(counter), 0, "ADDITIVE_PREMULT", (*at, 1, 1))

    def read(self, image: images.Image | None) -> tuple[np.ndarray | None, list[tuple[Counter, float]]]:
        """An image's pixels (None: of none), and the sums, which begin anew."""
        if not self._counters:
            return None if image is None else images.read(image), []
        sums = self._sums.colors[0]
        width = max(image.width if image else 0, sums.width)
        height = image.height if image else 0
        if image is not None and image.format != "RGBA32F":  # floats of another format: not worth a program
            pixels, image, height = images.read(image), None, 0
        else:
            pixels = None
        with images.borrowed(width, height + 1, "RGBA32F") as target:
            if image is not None:
                put(image, target, 0, 0)
            put(sums, target, 0, height)
            found = images.read(target.colors[0])
        counted = list(zip(self._counters, found[height, :, 0].tolist()))
        self._counters.clear()
        return found[:height, : image.width] if image is not None else pixels, counted

    def drop(self) -> None:
        """Give the image back to the pool."""
        if self._sums is not None:
            images.pool.give(self._sums.colors[0])
            self._sums = None
