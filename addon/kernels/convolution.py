"""Filtered depth comparisons: the basis images of a depth map and the constants of their series.

The comparison of a texel's depth z with a receiver's depth d is a truncated Fourier series whose terms separate into
functions of d and of z (shaders/lib/convolution.glsl). The functions of z are images that can be averaged beforehand,
by a pyramid of means (any box within a factor, blurred by bilinear reading, 4 bytes per texel and tile) or by a
summed-area table (any box exactly, 16 bytes). A depth map of any kind of light can be filtered so: what brings the map
declares in GLSL how a texel's z follows from it.

With `order` terms there are order + 1 tiles of four values, laid out in a grid beside each other.

The series rings. Scaled about its middle, so that the ripples lie beyond 0 and 1 and are cut off, it is exact from
`offset` on: the receiver is moved by that towards the light, or it would be half in its own shadow. For 4, 8, 16
terms the scale is 1.121, 1.111, 1.108 and the offset 0.064, 0.033, 0.016 of the depth range.

Source: Annen, Mertens, Bekaert, Seidel, Kautz, "Convolution shadow maps", EGSR 2007. Scale and offset are ours.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from ..gfx import images
from . import tables

MOST_SIDE = 16384  # of an image on every GPU of today
PYRAMID, TABLE = "PYRAMID", "TABLE"
# Sums over 256x256 texels stay below 2^31.
_TABLE_SOURCE = """uvec4 table_source(ivec2 texel)
{
  return uvec4(ivec4(round(basis_source(texel) * 32767.0)));
}
"""
_MEANS_SOURCE = """vec4 means_source(ivec2 texel)
{
  return basis_source(texel);
}
"""


@dataclass(frozen=True)
class Basis:
    """Basis images of order `order` (a multiple of 4), filtered by PYRAMID or TABLE.

    `glsl` defines `vec4 basis_source(ivec2 place)`, a texel of the grid of tiles; it may use `base_extent`, the size of
    a tile, and `tile_columns`, the tiles in a row of the grid.
    """

    name: str
    glsl: str
    order: int
    prefilter: str
    textures: tuple[tuple[str, str], ...] = ()
    constants: tuple[tuple[str, str], ...] = ()

    def columns(self, width: int) -> int:
        """Tiles in a row of the grid: about as many as rows, and no more than an image can hold."""
        return max(min(int(np.ceil(np.sqrt(self.order + 1))), MOST_SIDE // width), 1)

    def size(self, width: int, height: int) -> tuple[int, int]:
        """Of the grid of tiles of this size."""
        columns = self.columns(width)
        return columns * width, -(-(self.order + 1) // columns) * height

    @property
    def source(self) -> tables.TableSource | tables.PyramidSource:
        shared = {
            "textures": self.textures,
            "constants": (("IVEC2", "base_extent"), ("INT", "tile_columns"), *self.constants),
            "defines": (("ORDER", str(self.order)),),
        }
        name = f"{self.name} basis"
        if self.prefilter == TABLE:
            return tables.TableSource(name, self.glsl + _TABLE_SOURCE, integer=True, **shared)
        return tables.PyramidSource(name, self.glsl + _MEANS_SOURCE, means=True, **shared)

    def image(self, width: int, height: int) -> tuple[tuple[int, int], str]:
        """Size and format of the filtered image."""
        size = self.size(width, height)
        return (size, "RGBA32UI") if self.prefilter == TABLE else (tables.pyramid_size(*size), "RGBA16F")

    def constants_for(self, width: int, height: int) -> dict[str, object]:
        """What the lookup must know besides."""
        return {
            "base_extent": (width, height),
            "tile_columns": self.columns(width),
            "basis_rows": self.size(width, height)[1],
        }

    def build(self, out: images.Image, extent: tuple[int, int], levels: int, textures, constants) -> None:
        """Fill `out` from a depth map of `extent`; a pyramid gets `levels` levels, both sides multiples of 2^levels."""
        own = {"base_extent": extent, "tile_columns": self.columns(extent[0]), **constants}
        if self.prefilter == TABLE:
            tables.build_table(self.source, out, textures=textures, constants=own)
        else:
            tables.build_pyramid(self.source, out, levels, textures=textures, constants=own)


@cache
def series(order: int) -> tuple[float, float]:
    """Scale about the middle, and depth offset, that make the truncated comparison exact from the offset on."""
    frequencies = (2 * np.arange(order) + 1) * np.pi

    def lit(beyond: np.ndarray) -> np.ndarray:
        """The series for a texel that lies this much beyond the receiver."""
        return 0.5 + 2 * (np.sin(np.outer(beyond, frequencies)) / frequencies).sum(axis=1)

    peak = 1 / (2 * order)
    least = lit(np.linspace(peak, 1 - peak, 4096)).min()
    rise = np.linspace(0, peak, 4096)
    return float(0.5 / (least - 0.5)), float(np.interp(least, lit(rise), rise))
