"""Images that node trees read, on the GPU: as few bits as their files have, and levels for lookups that average.

Pixels of 8-bit files are kept in 8 bits, colours of others in 16-bit floats, data of others (heights, normals) and what
is beyond such floats in 32 bits. Levels are mip levels of our own, since no Blender lets Python make or fill them: each
texel of level n is the mean, in linear light, of 2^n by 2^n texels, weighed by alpha where that is coverage, so that
a crown of leaves keeps its density. Level 1 averages what lookups give between texels (texture/first_level.frag.glsl),
the others what is in the one before. They stand above the image in the same texture (texture/levels.glsl): a program
has 16 textures, of which a material may take 12.

| cost | |
|---|---|
| bytes | 4 a texel of 8-bit files, 8 of 16-bit floats; a third more where a lookup averages (4096^2: 89 MB, not 268) |
| passes | once per image version: one per strip of 512 rows, and two per level |
| peak | level 1 in 16-bit floats (33 MB of a 4096^2 image), and one strip in 32-bit floats |

Images beyond 12288 rows, with which the levels would not fit in 16384, have none. Which lookups average, and over how
much: materials/averages.py.
"""

from __future__ import annotations

import numpy as np

from ..gfx import images, passes, readback
from ..materials.atlas import keys_of, level_sizes, texture_layout
from ..materials.expressions import image_flags
from ..snapshot.scene import Image

STRIP = 1 << 21  # texels that are sent at once
LARGEST_HALF = 65504.0  # of a 16-bit float

FIRST_LEVEL = passes.fullscreen_program(
    "first level of a texture",
    "texture/first_level.frag.glsl",
    textures=(("FLOAT_2D", "texture_whole"),),
    constants=(("IVEC4", "level_part"), ("INT", "level_flags")),
    outputs=(("VEC4", "out_level"),),
)
NEXT_LEVEL = passes.fullscreen_program(
    "next level of a texture",
    "texture/next_level.frag.glsl",
    textures=(("FLOAT_2D", "finer_level"),),
    constants=(("IVEC2", "finer_extent"),),
    outputs=(("VEC4", "out_level"),),
)
STORE_LEVEL = passes.fullscreen_program(
    "level into a texture",
    "texture/store_level.frag.glsl",
    textures=(("FLOAT_2D", "level_mean"),),
    constants=(("IVEC4", "level_part"), ("INT", "level_number"), ("INT", "level_flags")),
    outputs=(("VEC4", "out_texel"),),
)


def upload_texture(known: dict[str, Image], key: str, levels: bool = False) -> images.Image:
    """The image of a key that a compiled tree names: one of `known`, or several in one (materials/atlas.py).

    `levels`: with those that averaging lookups read. Raises as images.create.
    """
    parts = [part for one in keys_of(key) for part in _parts(known[one])]
    sizes = [(pixels.shape[1], pixels.shape[0]) for _, pixels in parts]
    corners, whole, fits = texture_layout(sizes)
    levels = levels and fits
    if len(parts) == 1 and not levels:
        whole = sizes[0]
    texture = images.create(*whole, _widest([stored_as(image) for image, _ in parts]))
    for (image, pixels), corner in zip(parts, corners):
        _send(pixels, texture, corner)
        if levels:
            _make_levels(texture, (*corner, pixels.shape[1], pixels.shape[0]), image_flags(image))
    return texture


def _parts(image: Image) -> list[tuple[Image, np.ndarray]]:
    """An image's pixels, or those of each of its tiles."""
    if not image.tiles:
        return [(image, image.pixels)]
    return [(image, image.pixels[y : y + height, x : x + width]) for _, x, y, width, height in image.tiles]


def stored_as(image: Image) -> str:
    """The format of fewest bits that holds an image's pixels."""
    pixels = image.pixels
    if image.bits == 32 or not pixels.size:
        return "RGBA32F"
    low, high = float(pixels.min()), float(pixels.max())
    some = pixels[:: -(-pixels.shape[0] // 64)] * 255.0
    if image.bits == 8 and low >= 0.0 and high <= 1.0 and np.abs(some - np.round(some)).max() < 0.01:
        return "RGBA8"
    return "RGBA16F" if max(-low, high) <= LARGEST_HALF else "RGBA32F"  # not so where one is NaN, either


def _widest(formats: list[str]) -> str:
    return max(formats, key=("RGBA8", "RGBA16F", "RGBA32F").index)


def _send(pixels: np.ndarray, texture: images.Image, corner: tuple[int, int]) -> None:
    """In strips: Blender takes 32-bit floats alone, and of a whole image these would be four times its bytes."""
    height, width = pixels.shape[:2]
    target, rows = images.Target((texture,)), max(STRIP // width, 1)
    for row in range(0, height, rows):
        strip = images.upload(pixels[row : row + rows])
        readback.put(strip, target, corner[0], corner[1] + row)


def _make_levels(texture: images.Image, part: tuple[int, int, int, int], flags: int) -> None:
    """The levels of an image that stands at x, y of a texture and is so wide and high."""
    x, y, width, height = part
    exact = "RGBA32F" if texture.format == "RGBA32F" else "RGBA16F"
    target, first, finer = images.Target((texture,)), y + height, None
    for number, size in enumerate(level_sizes(width, height), 1):
        coarser = images.create(*size, exact)
        if finer is None:
            constants = {"level_part": part, "level_flags": flags}
            passes.fullscreen(
                FIRST_LEVEL, images.Target((coarser,)), textures={"texture_whole": texture}, constants=constants
            )
        else:
            constants = {"finer_extent": finer.size}
            passes.fullscreen(
                NEXT_LEVEL, images.Target((coarser,)), textures={"finer_level": finer}, constants=constants
            )
        rows = -(-size[1] >> number)
        passes.fullscreen(
            STORE_LEVEL, target, viewport=(x, first, width, rows), textures={"level_mean": coarser},
            constants={"level_part": part, "level_number": number, "level_flags": flags},
        )  # fmt: skip
        first, finer = first + rows, coarser
