"""Entries of a long list on the GPU (images.upload_list) that are replaced: parts of a texture cannot be uploaded.

The new entries travel in a list of their own, and one dispatch puts them into their places.
"""

from __future__ import annotations

import numpy as np

from ..gfx import images, passes
from ..gfx.library import Program

SCATTER = Program(
    name="entries of a list",
    compute="kernels/scatter.comp.glsl",
    textures=(("RGBA32F", "entries"),),
    images=(("into", "RGBA32F", "FLOAT_2D", "WRITE"),),
    constants=(("INT", "count"), ("INT", "texels")),
    group=(64, 1, 1),
)

ACROSS = 1 << 16  # threads along x: devices bound the groups along an axis


def scatter(into: images.Image, numbers: np.ndarray, entries: np.ndarray) -> None:
    """Put `entries` (K, texels, 4) into a list at entry `numbers` (K,), which differ, below 2^24."""
    if not len(numbers):
        return
    count, texels = entries.shape[:2]
    rows = np.zeros((count, texels + 1, 4), np.float32)
    rows[:, :texels], rows[:, texels, 0] = entries, numbers
    threads = count * texels
    passes.compute(
        SCATTER, (min(threads, ACROSS), -(-threads // ACROSS)),
        textures={"entries": images.upload_list(rows.reshape(-1, 4))}, images={"into": into},
        constants={"count": count, "texels": texels},
    )  # fmt: skip
