"""Deferred readbacks: values that several steps need are read back together, when the first of them is needed.

A readback stops the queue: the CPU waits until the GPU has done everything before it, and then the GPU waits for what
the CPU makes of it. So what is asked for is left where it is (`later`), and the first `pixels` copies all of it into
one image and reads that.

| cost | |
|---|---|
| passes | 1 for each image, none where only one is read |
| bytes | 16 a texel of the images laid on top of each other, as wide as the widest |
"""

from __future__ import annotations

import numpy as np

from . import images, passes

_PLACE = (("IVEC2", "place"),)
_OUT = (("VEC4", "out_copy"),)
PACK = passes.fullscreen_program(
    "pack", "lib/pack.frag.glsl", textures=(("FLOAT_2D", "original"),), constants=_PLACE, outputs=_OUT
)
PACK_INTEGERS = passes.fullscreen_program(
    "pack integers", "lib/pack.frag.glsl", textures=(("UINT_2D", "original"),), constants=_PLACE, outputs=_OUT
)


def put(
    image: images.Image, target: images.Target, x: int, y: int, blend: str = "NONE",
    part: tuple[int, int, int, int] | None = None,
) -> None:  # fmt: skip
    """Copy an image, or a part (x, y, width, height) of it, to a place of a target. Integers become floats, exact up to
    2^24."""
    program = PACK_INTEGERS if image.format == "R32UI" else PACK
    left, low, *size = part or (0, 0, *image.size)
    passes.fullscreen(
        program, target, blend=blend, viewport=(x, y, *size),
        textures={"original": image}, constants={"place": (x - left, y - low)},
    )  # fmt: skip


class Reading:
    """An image that is read later."""

    def __init__(self, of: Readback, image: images.Image):
        self._of, self.image = of, image
        self.found: np.ndarray | None = None

    def pixels(self) -> np.ndarray:
        """(H, W, channels) float32; waits for the GPU unless that has been done already."""
        if self.found is None:
            self._of.read()
        return self.found


class Readback:
    """Images of the pool that are to be read, which get them back afterwards."""

    def __init__(self):
        self._pending: list[Reading] = []

    def later(self, image: images.Image) -> Reading:
        """Read this image when it, or another one, is asked for. It belongs to the readback from now on."""
        self._pending.append(Reading(self, image))
        return self._pending[-1]

    def read(self) -> None:
        """Read all that is pending, at once."""
        pending, self._pending = self._pending, []
        if len(pending) == 1:
            pending[0].found = images.read(pending[0].image)
        elif pending:
            width = max(one.image.width for one in pending)
            with images.borrowed(width, sum(one.image.height for one in pending), "RGBA32F") as target:
                row = 0
                for one in pending:
                    put(one.image, target, 0, row)
                    row += one.image.height
                packed = images.read(target.colors[0])
            row = 0
            for one in pending:
                channels = images.channels(one.image.format)
                one.found = packed[row : row + one.image.height, : one.image.width, :channels]
                row += one.image.height
        for one in pending:
            images.pool.give(one.image)

    def drop(self) -> None:
        """Give back what nobody asked for."""
        for one in self._pending:
            images.pool.give(one.image)
        self._pending = []
