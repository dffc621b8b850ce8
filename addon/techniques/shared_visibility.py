"""Shared visibility: soft shadows are looked up at every fourth pixel, and in between where they or surfaces vary.

A soft shadow map asks some hundred texels for each pixel and light, for a visibility that mostly varies little from
one pixel to the next. So up to four lights at a time are looked up at every RATE-th pixel along both axes, a sixteenth
of the pixels. A cell between four such pixels knows the visibility within it if three or more of them lie on a plane
(two pixels' width, normals within 25 degrees) and each light is seen alike from those. Pixels of the cell on that plane
interpolate, all others look for themselves:

    V(p) = bilinear of V at the corners on the plane,    max V - min V <= ALIKE there

What is lit, or in full shadow, is as exact as before; so are outlines, contacts and the steep part of penumbrae.

Beside looking at every pixel, one variance map of 1024x1024, software GPU (time: `python -m bench.soft_lights`): the
RMS error of the visibility at 640x360 is .0287 and .0289 (thin poles), .0507 and .0506 (chain fence), .0578 and .0580
(foliage). Of `foliage`, whose ground lies in penumbra all over, lookups take 230 ms of processor time in place of 700:
58 at every fourth pixel, 6 for cells and marks, 170 on leaves and at their outlines.

| cost | per four lights, beside the lookups |
|---|---|
| passes | 3, and the pass of light twice, each over its own pixels |
| fetches | 12 per cell; per pixel 3, and 1 per light |
| bytes | 4 per pixel, 96 per cell |

Small pictures (MANY_PIXELS) are left alone: they cost little, and shadows narrower than four pixels are much of them.
At 128x96 RMS grew from .0234 to .0257 (poles) and .0487 to .0514 (far background), elsewhere by up to .0007. One-sample
pictures at 640x360 take .8 of the time (`soft_shadow_garden`, `window_interior`).

Bias (direct light of soft maps in pictures of few samples): shadows narrower than four pixels, between corners that do
not see them; else at most ALIKE. None with more samples, or with `sparse` off.

Sources: Ward, Rubinstein, Clear, "A ray tracing solution for diffuse interreflection", SIGGRAPH 1988, for a quantity
that is kept where it varies little; on a grid of the screen, with silhouettes told by planes, Nichols & Wyman 2009.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from ..frame import lights
from ..frame.run import Frame
from ..frame.technique import Technique
from ..frame.view import VIEW
from ..gfx import images, passes
from ..gfx.library import Program
from . import repeated_light
from .accumulated_maps import Lookup, Maps
from .surfaces import SURFACE_TEXTURES, surface_bindings

RATE = 4  # pixels between lookups, along both axes
ALIKE = 0.1  # difference of visibility between a cell's corners up to which pixels within it interpolate
MANY_PIXELS = 100_000
LIGHTS = 4  # whose visibility one image holds
KNOWN, UNKNOWN = "GREATER", "LESS"  # `where` of passes.fullscreen: the marks are 0, and 1
CORNERS = ("first", "second", "third", "fourth")  # light: what its cells know
DEFINES = (("RATE", str(RATE)), ("ALIKE", str(ALIKE)), ("FACING", "0.9"), ("OFF_PLANE", "2.0"))
SEEN = tuple(texture for texture in SURFACE_TEXTURES if texture[1] in ("surface_position", "surface_normal"))
BETWEEN = Lookup(
    "shared visibility",
    "light/shared_visibility.glsl",
    textures=tuple(("RGBA32F", name) for name in CORNERS),
    defines=DEFINES,
    maps=False,
)
CELLS = passes.fullscreen_program(
    "cells of shared visibility",
    "light/visibility_cells.frag.glsl",
    textures=(*SEEN, ("RGBA32F", "visibility")),
    blocks=((VIEW, "film_view"),),
    defines=DEFINES,
    outputs=tuple(("VEC4", f"out_{name}") for name in ("plane", *CORNERS)),
)
MARKS = passes.fullscreen_program(
    "marks of shared visibility",
    "light/visibility_marks.frag.glsl",
    textures=(*SEEN, ("RGBA32F", "cell_plane")),
    blocks=((VIEW, "film_view"),),
    defines=DEFINES,
    writes_depth=True,
)


@cache
def looking(lookup: Lookup, kinds: int = -1) -> Program:
    """The pass that looks up the visibility of lights of these kinds (bits as in lights.LAMPS; -1: any light)."""
    return passes.fullscreen_program(
        f"visibility at some pixels, {lookup.name}",
        "light/visibility.frag.glsl",
        textures=(*lookup.textures, ("RGBA32F", "depth_maps"), *SEEN),
        blocks=((VIEW, "film_view"), (lights.SOURCES, "sources"), *lookup.blocks),
        constants=(("INT", "light_count"), *lookup.constants),
        defines=(*DEFINES, *lookup.defines, ("LIGHT_KINDS", str(kinds))),
        snippets=(("generated/visibility", f'#include "{lookup.file}"\n'),),
        outputs=(("VEC4", "out_visibility"),),
    )


@dataclass
class _Cells:
    """What cells know of up to LIGHTS lights, and the marks of the pixels."""

    corners: list[images.Image] = field(default_factory=list)
    marks: images.Image | None = None

    def find(self, frame: Frame, rows: list[np.ndarray], kinds: int, sources: lights.Sources, maps: Maps) -> None:
        points = tuple(-(-(extent - 1) // RATE) + 1 for extent in frame.size)
        size = tuple(max(count - 1, 1) for count in points)
        bindings = surface_bindings(frame)
        seen = {name: bindings[name] for _, name in SEEN}
        view = {"film_view": frame.view_block}
        visibility = images.pool.take(*points, "RGBA32F")
        plane, *self.corners = (images.pool.take(*size, "RGBA32F") for _ in range(1 + LIGHTS))
        self.marks = images.pool.take(*frame.size, "DEPTH_COMPONENT32F")
        passes.fullscreen(
            looking(maps.lookup, kinds), images.Target((visibility,)),
            textures={**seen, "depth_maps": maps.atlas, **maps.textures},
            blocks={**view, "sources": sources.set(rows, maps.views), **maps.blocks},
            constants={"light_count": len(rows), **maps.constants},
        )  # fmt: skip
        cells = images.Target((plane, *self.corners))
        passes.fullscreen(CELLS, cells, textures={**seen, "visibility": visibility}, blocks=view)
        passes.fullscreen(MARKS, images.Target((), self.marks), textures={**seen, "cell_plane": plane}, blocks=view)
        images.pool.give(visibility)
        images.pool.give(plane)

    def give(self) -> None:
        for image in (*self.corners, *([self.marks] if self.marks else [])):
            images.pool.give(image)


def add(
    frame: Frame, technique: Technique, sources: lights.Sources, lit: repeated_light.Lit, kinds: int, maps: Maps,
    between: Program,
) -> Iterator[None]:  # fmt: skip
    """Add this light to the sample's radiance, in parts, and keep it for other points of the film: as it is where
    pixels ask `maps` themselves, and by the program `between`, with the lookup BETWEEN, elsewhere."""
    bindings = lit.bindings
    for first in range(0, len(lit.rows), LIGHTS):
        some = lit.rows[first : first + LIGHTS]
        constants = {**bindings["constants"], "light_count": len(some)}
        cells = _Cells()
        try:
            cells.find(frame, some, kinds, sources, maps)
            yield
            known = {
                "textures": {"energy_table": frame.materials.energy_table, **dict(zip(CORNERS, cells.corners))},
                "blocks": {},
                "constants": {name: constants[name] for name in ("light_count", "traced_roughness")},
            }
            asked = {**bindings, "constants": constants}
            for program, where, bound in ((between, KNOWN, known), (lit.program, UNKNOWN, asked)):
                part = repeated_light.Lit(program, where, bound, some, lit.views)
                yield from repeated_light.add(frame, technique, sources, part, cells.marks)
        finally:
            cells.give()
        frame.count(technique, "passes", 5)
        frame.count(technique, "shared lookups", len(some))
    repeated_light.keep(frame, lit)
