"""Reduction of an image to one texel: the sum of its rgb and the maximum of its alpha.

Blocks of 8 x 8 texels become one, until one is left: 1 + 1/64 + … fetches per texel, four passes for 4096 x 4096.
Sums of sums keep float32 within 1e-6 of what double precision gives for positive values.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass

from ..gfx import images, passes
from ..gfx.library import Program

BLOCK = 8


@dataclass(frozen=True)
class ReductionSource:
    """What is taken together: GLSL with `vec4 reduction_source(ivec2 texel)`, alpha not below 0, and what it binds."""

    name: str
    glsl: str
    textures: tuple[tuple[str, str], ...] = ()
    constants: tuple[tuple[str, str], ...] = ()


TEXELS = ReductionSource(
    "texels",
    "vec4 reduction_source(ivec2 texel)\n{\n  return reduced_fetch(texel);\n}\n",
    textures=(("RGBA32F", "reduced"),),
)


def block_program(source: ReductionSource) -> Program:
    """Takes the blocks of a source together."""
    return passes.fullscreen_program(
        f"{source.name}, reduced",
        "table/block.frag.glsl",
        textures=source.textures,
        constants=(("IVEC2", "extent"), *source.constants),
        defines=(("BLOCK", str(BLOCK)),),
        snippets=(("generated/source", source.glsl),),
        outputs=(("VEC4", "out_value"),),
    )


BLOCKS = block_program(TEXELS)


def reduce(source: ReductionSource, extent: tuple[int, int], target: images.Target, textures, constants=None) -> int:
    """Reduce the source over `extent` texels into `target`, one RGBA32F texel. Returns the number of passes."""
    program, done = block_program(source), 0
    with ExitStack() as stack:
        while True:
            width, height = (-(-side // BLOCK) for side in extent)
            last = width == height == 1
            into = target if last else stack.enter_context(images.borrowed(width, height, "RGBA32F"))
            passes.fullscreen(program, into, textures=textures, constants={"extent": extent, **(constants or {})})
            done += 1
            if last:
                return done
            program, extent, textures, constants = BLOCKS, (width, height), {"reduced": into.colors[0]}, None


def pass_count(extent: tuple[int, int]) -> int:
    """Passes of `reduce`."""
    count = 0
    while count == 0 or max(extent) > 1:
        extent, count = tuple(-(-side // BLOCK) for side in extent), count + 1
    return count
