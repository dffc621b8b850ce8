"""Splats: records in images drawn as additive quads, one instance each, with a footprint of two half axes.

A record is four texels at the same place of four images, all vec4:

    centre  xyz place; w: 0 for an empty record, whose quad is clipped
    first   xyz half axis of the footprint, in the space of the centre; w: free
    second  the other half axis, at a right angle to the first; w: free
    value   what is spread over the footprint; its meaning is the fragment program's

The caller's fragment program gets them as flat varyings `splat_centre`, `splat_first`, `splat_second`, `splat_value`
and decides what a pixel takes. The kernel is the biweight over the ellipse, 3 (1 - q)^2 / (pi |first| |second|) with
q = (x/|first|)^2 + (y/|second|)^2, which integrates to one (shaders/splat/footprint.glsl).

| cost | per draw |
|---|---|
| vertices | 6 per record, 4 fetches each; empty records are clipped after the first |
| fragments | the projected footprints |

Sums are in the target's format: 32-bit floats keep them exact to 2^-24 of the sum; the order of additions changes the
last bits only.
"""

from __future__ import annotations

from ..gfx import images, passes
from ..gfx.library import Program

RECORD = ("splat_centres", "splat_firsts", "splat_seconds", "splat_values")
VARYINGS = ("splat_centre", "splat_first", "splat_second", "splat_value")


def splat_program(name: str, fragment: str, projection: str, **declared) -> Program:
    """A program that draws records. `projection`: arguments of `project` in lib/projection.glsl after the place, as
    names of what the caller binds (blocks, constants)."""
    return Program(
        name=name,
        vertex="splat/quad.vert.glsl",
        fragment=fragment,
        inputs=passes.QUAD_INPUTS,
        varyings=tuple(("flat", "VEC4", varying) for varying in VARYINGS),
        textures=(*(("RGBA32F", texture) for texture in RECORD), *declared.pop("textures", ())),
        constants=(("INT", "splat_columns"), *declared.pop("constants", ())),
        defines=(("PROJECTION", projection), *declared.pop("defines", ())),
        **declared,
    )


def draw(
    program: Program,
    target: images.Target,
    records: tuple[images.Image, ...],
    textures=None,
    constants=None,
    **bindings,
) -> None:
    """Add all records (four images of one size, in the order of RECORD) to the target's sums."""
    width, height = records[0].size
    shader = passes.get(program)
    with passes.drawing(target, blend="ADDITIVE_PREMULT", depth_test="NONE", depth_write=False):
        shader.bind(
            textures={**dict(zip(RECORD, records)), **(textures or {})},
            constants={"splat_columns": width, **(constants or {})},
            **bindings,
        )
        passes.draw_quads(shader, width * height)
