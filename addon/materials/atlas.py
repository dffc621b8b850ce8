"""Places in a texture: of the levels of an image, and of several images in one, which are what a material reads
beyond the samplers that a program has, and the tiles of a UDIM image.

Parts stand side by side on shelves, the highest first, so that equal sets of sizes always lie alike. The generated
lookups of a part wrap and filter within it (materials/nodes/image.py). Each part has its levels above it
(shaders/texture/levels.glsl).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

PREFIX = "atlas "
WIDEST = 16384  # pixels: what every GPU has
FEW_ROWS, MOST_LONG = 16, 64  # of an image without levels: its shorter side, and the longer one by that


def atlas_key(keys: Sequence[str]) -> str:
    """The key of the image that holds these images."""
    return PREFIX + "|".join(keys)


def keys_of(key: str) -> tuple[str, ...]:
    """The images that the image of a key is made of: itself, unless it is an atlas."""
    return tuple(key.removeprefix(PREFIX).split("|")) if key.startswith(PREFIX) else (key,)


def layout(sizes: Sequence[tuple[int, int]]) -> tuple[list[tuple[int, int]], tuple[int, int]]:
    """Lower left corners of parts of these sizes (width, height), and the size of the whole."""
    corners: list[tuple[int, int]] = [(0, 0)] * len(sizes)
    x = y = shelf = widest = 0
    limit = min(WIDEST, max(2 * int(np.sqrt(sum(w * h for w, h in sizes))), max((w for w, _ in sizes), default=1)))
    for k in sorted(range(len(sizes)), key=lambda k: (-sizes[k][1], -sizes[k][0], k)):
        width, height = sizes[k]
        if x and x + width > limit:
            x, y, shelf = 0, y + shelf, 0
        corners[k] = x, y
        x, shelf = x + width, max(shelf, height)
        widest = max(widest, x)
    return corners, (max(widest, 1), max(y + shelf, 1))


def level_sizes(width: int, height: int) -> list[tuple[int, int]]:
    """Width and height of the levels of an image from 1 on."""
    return [(width >> n, height >> n) for n in range(1, min(width, height).bit_length())]


def rows_with_levels(width: int, height: int) -> int:
    """Rows of a texture that hold an image and, above it, its levels: of level n 2^n rows stand side by side."""
    return height + sum(-(-rows >> n) for n, (_, rows) in enumerate(level_sizes(width, height), 1))


def texture_layout(sizes: Sequence[tuple[int, int]]) -> tuple[list[tuple[int, int]], tuple[int, int], bool]:
    """Lower left corners of images of these sizes in one texture, its size, and whether it has levels: where there is
    room for them, and no image is so long beside its width that levels, which halve both, would average all of the
    shorter side where the longer one is seen small."""
    corners, whole = layout([(width, rows_with_levels(width, height)) for width, height in sizes])
    if max(whole) <= WIDEST and not any(
        1 < min(size) < FEW_ROWS and MOST_LONG * min(size) <= max(size) for size in sizes
    ):
        return corners, whole, True
    return *layout(sizes), False


def packed(parts: Sequence[np.ndarray]) -> np.ndarray:
    """(H, W, 4) of parts (h, w, 4) as `layout` places them."""
    corners, (width, height) = layout([(part.shape[1], part.shape[0]) for part in parts])
    whole = np.zeros((height, width, 4), np.float32)
    for (x, y), part in zip(corners, parts):
        whole[y : y + part.shape[0], x : x + part.shape[1]] = part
    return whole
