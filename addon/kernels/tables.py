"""Summed-area tables and pyramids of images: sums, bounds and means over boxes of texels in a few fetches.

A table holds at (x, y) the sum of its source over all texels up to and including x and y. Integer tables wrap modulo
2^32, which is harmless: the sum over a box, a difference of four entries, is exact as long as it is itself below 2^32.
A box may lie anywhere, so one table serves all depth maps of an atlas.

Running sums along an axis: the sums of chunks of CHUNK texels, their own running sums by the same rule, and for each
texel those of the chunks before it plus the texels of its chunk up to itself. Everything is drawn, not dispatched: on a
software rasteriser an image store from a compute shader takes 20 ns, a pixel of a draw 3 to 7, an image load 0.5 (a
texel fetch 2.3); on a GPU the loads of a chunk come from the cache.

| cost of W x H texels | |
|---|---|
| passes | 1 for the source, 2 per power of CHUNK in W and in H (pyramid: 1 per level) |
| loads, writes per texel | 1 of the source; per axis 1 + CHUNK / 2 + 1 and 1 (pyramid: 4/3, 1/3) |
| bytes per texel | 16 kept and 16 borrowed (pyramid: 4) |

Measured with 1024x1024 RGBA32F on a software GPU, processor time in one process: 37 to 40 ms from image to table (9
more for a source); one thread per row and column 118 to 130 ms. Chunks of 4 or 16 texels take 5 % longer. On a
processor with faster stores 35 to 38 ms and 89 ms: half of the table's time is writing two images there. On one with
slower memory 45 to 55 ms and 100 to 124 ms, the same with chunks of 4, 5, 6 and 8 and with loads instead of branches.

Source: Crow, "Summed-area tables for texture mapping", SIGGRAPH 1984; the chunks are the reduce-then-scan of Sengupta
et al., "Scan primitives for GPU computing", 2007, with the last step as a loop.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..gfx import images, passes
from ..gfx.library import Program
from ..gfx.struct import Struct

CHUNK = 8
FEW = 32  # entries whose running sums one pass adds up
_STEPS = ("ivec2(1, 0)", "ivec2(0, 1)")


@dataclass(frozen=True)
class TableSource:
    """What is summed: GLSL with `vec4 table_source(ivec2 texel)` (uvec4 if `integer`), and what it binds."""

    name: str
    glsl: str
    textures: tuple[tuple[str, str], ...] = ()
    blocks: tuple[tuple[Struct, str], ...] = ()
    constants: tuple[tuple[str, str], ...] = ()
    defines: tuple[tuple[str, str], ...] = ()
    integer: bool = False

    @property
    def format(self) -> str:
        return _FORMATS[self.integer]


_FORMATS = {False: "RGBA32F", True: "RGBA32UI"}
_VALUES = {False: "vec4", True: "uvec4"}


def _output(integer: bool) -> tuple[tuple[str, str], ...]:
    return ((_VALUES[integer].upper(), "out_value"),)


def _along(axis: int, integer: bool, chunk: int = CHUNK) -> tuple[tuple[str, str], ...]:
    return (("STEP", _STEPS[axis]), ("CHUNK", str(chunk)), ("TABLE_VALUE", _VALUES[integer]))


def _sums(axis: int, integer: bool) -> Program:
    return passes.fullscreen_program(
        f"sums of chunks, axis {axis}, {_VALUES[integer]}",
        "table/sums.frag.glsl",
        textures=((_FORMATS[integer], "summed"),),
        constants=(("IVEC2", "extent"),),
        defines=_along(axis, integer),
        outputs=_output(integer),
    )


def _prefix(axis: int, integer: bool, chunks: bool) -> Program:
    return passes.fullscreen_program(
        f"running sums, axis {axis}, {_VALUES[integer]}, {'many chunks' if chunks else 'one chunk'}",
        "table/prefix.frag.glsl",
        textures=tuple((_FORMATS[integer], name) for name in ("summed", *(("chunk_sums",) if chunks else ()))),
        defines=(*_along(axis, integer), ("CHUNKS", "1")) if chunks else _along(axis, integer, FEW),
        outputs=_output(integer),
    )


_KINDS = tuple((axis, integer) for axis in (0, 1) for integer in (False, True))
SUMS = tuple(_sums(axis, integer) for axis, integer in _KINDS)
PREFIX = tuple(_prefix(axis, integer, True) for axis, integer in _KINDS)
PREFIX_OF_ONE = tuple(_prefix(axis, integer, False) for axis, integer in _KINDS)  # chunk


def values_program(source: TableSource) -> Program:
    """Writes what the source says of each texel."""
    return passes.fullscreen_program(
        f"{source.name} table, values",
        "table/values.frag.glsl",
        textures=source.textures,
        blocks=source.blocks,
        constants=source.constants,
        defines=source.defines,
        snippets=(("generated/source", source.glsl),),
        outputs=_output(source.integer),
    )


def _run_along(axis: int, integer: bool, summed: images.Image, target: images.Target) -> None:
    """Running sums of `summed` along an axis into a target of its size."""
    kind = _KINDS.index((axis, integer))
    length = summed.size[axis]
    if length <= FEW:
        passes.fullscreen(PREFIX_OF_ONE[kind], target, textures={"summed": summed})
        return
    chunks = list(summed.size)
    chunks[axis] = -(-length // CHUNK)
    with images.borrowed(*chunks, summed.format) as sums, images.borrowed(*chunks, summed.format) as before:
        passes.fullscreen(SUMS[kind], sums, textures={"summed": summed}, constants={"extent": summed.size})
        _run_along(axis, integer, sums.colors[0], before)
        bound = {"summed": summed, "chunk_sums": before.colors[0]}
        passes.fullscreen(PREFIX[kind], target, textures=bound)


def sum_up(image: images.Image, table: images.Image) -> None:
    """Fill `table` with the sums over the texels of `image`: both RGBA32F or RGBA32UI and of one size, or the same."""
    integer = table.format == _FORMATS[True]
    with images.borrowed(*table.size, table.format) as rows:
        _run_along(0, integer, image, rows)
        _run_along(1, integer, rows.colors[0], images.Target((table,)))


def build_table(source: TableSource, table: images.Image, **bindings) -> None:
    """Fill `table` (of the source's format, any size) with the sums of the source over its texels.

    `bindings` are textures, blocks and constants by name, as the source declares them.
    """
    passes.fullscreen(values_program(source), images.Target((table,)), **bindings)
    sum_up(table, table)


# ------------------------------------------------------------------------------------------------------------ pyramid


@dataclass(frozen=True)
class PyramidSource:
    """What is bounded: GLSL with `vec2 bounds_source(ivec2 texel)` (least and largest value), and what it binds.

    With `means`: what is averaged, `vec4 means_source(ivec2 texel)`.
    """

    name: str
    glsl: str
    textures: tuple[tuple[str, str], ...] = ()
    constants: tuple[tuple[str, str], ...] = ()
    defines: tuple[tuple[str, str], ...] = ()
    means: bool = False

    @property
    def format(self) -> str:
        return "RGBA16F" if self.means else "RG32F"


def pyramid_size(width: int, height: int) -> tuple[int, int]:
    """Of the image that holds levels 1 and above of a source; level n begins at row height - (height >> (n - 1))."""
    return max(width // 2, 1), height


def level_program(source: PyramidSource) -> Program:
    """Level 1 from a source. It is drawn, as tables are; further levels read the image that they are written to."""
    return passes.fullscreen_program(
        f"{source.name} pyramid",
        "table/first_level.frag.glsl",
        textures=source.textures,
        constants=source.constants,
        defines=(*source.defines, *_REDUCED[source.means]),
        snippets=(("generated/source", source.glsl),),
        outputs=(("VEC4", "out_entry"),),
    )


_REDUCED = {False: (), True: (("MEANS", ""),)}
FURTHER_LEVELS = tuple(  # of bounds and of means
    Program(
        name=f"further levels of a pyramid of {'means' if means else 'bounds'}",
        compute="table/level.comp.glsl",
        images=(("pyramid", kind, "FLOAT_2D", "READ_WRITE"),),
        constants=(("IVEC2", "extent"), ("INT", "source_row"), ("INT", "row")),
        defines=_REDUCED[means],
        snippets=(
            ("generated/source", f"{value}_source(ivec2 texel)\n{{\n  return imageLoad(pyramid, texel){part};\n}}\n"),
        ),
    )
    for means, kind, value, part in (
        (False, "RG32F", "vec2 bounds", ".xy"), (True, "RGBA16F", "vec4 means", ""),
    )
)  # fmt: skip


def build_pyramid(source: PyramidSource, pyramid: images.Image, levels: int, **bindings) -> None:
    """Fill levels 1 to `levels` of `pyramid` (of the source's format, see `pyramid_size`).

    The source's width and height are multiples of 2^levels. `bindings` as for `build_table`.
    """
    width, height = 2 * pyramid.width, pyramid.height
    if width % (1 << levels) or height % (1 << levels):
        raise ValueError(f"A pyramid of {levels} levels needs sides that 2^{levels} divides, not {width}x{height}.")
    if levels:
        viewport = (0, 0, width // 2, height // 2)
        passes.fullscreen(level_program(source), images.Target((pyramid,)), viewport=viewport, **bindings)
    for level in range(2, levels + 1):
        extent = (width >> level, height >> level)
        rows = [height - (height >> (one - 1)) for one in (level - 1, level)]
        passes.compute(
            FURTHER_LEVELS[source.means], extent, images={"pyramid": pyramid},
            constants={"extent": extent, "source_row": rows[0], "row": rows[1]},
        )  # fmt: skip
