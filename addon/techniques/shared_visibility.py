"""Shared visibility: soft shadows are looked up at every fourth pixel, and in between where they or surfaces vary.

A soft shadow map asks some hundred texels for each pixel and light, for a visibility that mostly varies little from
one pixel to the next. So up to four lights at a time are looked up at every RATE-th pixel along both axes, a sixteenth
of the pixels. A cell between four such pixels knows the visibility of a light within it if two or more of them lie on a
plane (two pixels' width, normals within 25 degrees) and the light is seen alike from those, or varies in proportion.
Pixels of the cell on that plane interpolate, all others look for themselves:

    V(p) = bilinear of V at the corners on the plane,
    max V - min V <= ALIKE there, or <= LINEAR where second differences, one corner further too, are at most BEND

What is lit, or in full shadow, is as exact as before; so are outlines, contacts and the bends of penumbrae. The pixels
that look for themselves lie scattered, and lanes of a GPU beside them would idle: they are listed (frame/lists.py),
light by light.

Beside looking at every pixel, one variance map of 1024x1024, 640x360 pixels: RMS error of the visibility, and processor
time of its shadow on a software GPU (as `python -m bench.soft_lights` takes it):

| | thin poles | chain fence | foliage | grid | far background | stacked blockers |
|---|---|---|---|---|---|---|
| every pixel | .0270, 314 ms | .0454, 422 ms | .0574, 421 ms | .0417, 330 ms | .0191, 324 ms | .0164, 270 ms |
| shared | .0271, 105 ms | .0456, 332 ms | .0574, 142 ms | .0420, 194 ms | .0181, 132 ms | .0168, 85 ms |

| cost | per four lights, beside the lookups |
|---|---|
| passes | 2, and 2 dispatches per light (1 where shaders cannot count) |
| fetches | 28 per cell; per pixel and light 4 to list, and 2 to light |
| bytes | per pixel 4, and 4 per light; 96 per cell |

Small pictures (MANY_PIXELS) are left alone: they cost little, and shadows narrower than four pixels are much of them.

Bias (direct light of soft maps in pictures of few samples): shadows narrower than four pixels, between corners that do
not see them; else at most ALIKE between three corners, or an eighth of BEND between four. Beside two corners alone, at
outlines, nothing tells how visibility goes on; RMS over the families is the same with three. None with more samples, or
with `sparse` off.

Sources: Ward, Rubinstein, Clear, "A ray tracing solution for diffuse interreflection", SIGGRAPH 1988, for a quantity
that is kept where it varies little; on a grid of the screen, with silhouettes told by planes, Nichols & Wyman 2009.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from ..frame import lights, lists
from ..frame.run import Frame
from ..frame.technique import Technique
from ..frame.view import VIEW
from ..gfx import context, images, passes
from ..gfx.library import Program
from . import repeated_light
from .accumulated_maps import Lookup, Maps
from .surfaces import SURFACE_TEXTURES, surface_bindings

RATE = 4  # pixels between lookups, along both axes
# Differences of visibility between a cell's corners up to which pixels within it interpolate: whatever lies around, and
# where second differences there are at most BEND.
ALIKE, LINEAR, BEND = 0.1, 0.3, 0.05
MANY_PIXELS = 100_000
LIGHTS = 4  # whose visibility one image holds
CORNERS = tuple(f"corners_{k}" for k in range(LIGHTS))  # light: what its cells know
DEFINES = (
    ("RATE", str(RATE)), ("ALIKE", str(ALIKE)), ("LINEAR", str(LINEAR)), ("BEND", str(BEND)), ("FACING", "0.9"),
    ("OFF_PLANE", "2.0"),
)  # fmt: skip
SEEN = tuple(texture for texture in SURFACE_TEXTURES if texture[1] in ("surface_position", "surface_normal"))
BETWEEN = Lookup(
    "shared visibility",
    "light/shared_visibility.glsl",
    textures=(*(("RGBA32F", name) for name in CORNERS), ("R32F", "own_visibility")),
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
CELL = (("RGBA32F", "cell_plane"), *(("RGBA32F", name) for name in CORNERS))
LIST = Program(
    name="pixels that look for themselves",
    compute="light/visibility_list.comp.glsl",
    textures=(*SEEN, *CELL),
    images=lists.FILLED,
    blocks=((VIEW, "film_view"),),
    constants=(("INT", "light_index"),),
    defines=(*DEFINES, *lists.DEFINES),
)
SHARE = 8  # of a list's room: entries that a thread may take


def _looking(lookup: Lookup, kinds: int) -> dict:
    """What all programs that look up the visibility of lights of these kinds declare."""
    return {
        "textures": (*lookup.textures, ("RGBA32F", "depth_maps"), *SEEN),
        "blocks": ((VIEW, "film_view"), (lights.SOURCES, "sources"), *lookup.blocks),
        "constants": lookup.constants,
        "defines": (*DEFINES, *lookup.defines, ("LIGHT_KINDS", str(kinds))),
        "snippets": (("generated/visibility", f'#include "{lookup.file}"\n'),),
    }


@cache
def looking(lookup: Lookup, kinds: int = -1) -> Program:
    """The pass that looks up the visibility of lights of these kinds (bits as in lights.LAMPS; -1: any light) at every
    RATE-th pixel."""
    declared = _looking(lookup, kinds)
    return passes.fullscreen_program(
        f"visibility at some pixels, {lookup.name}", "light/visibility.frag.glsl",
        **declared | {"constants": (*declared["constants"], ("INT", "light_count"))},
        outputs=(("VEC4", "out_visibility"),),
    )  # fmt: skip


@cache
def looking_apart(lookup: Lookup, kinds: int = -1, listed: bool = True) -> Program:
    """The dispatch that looks up that of one light at the pixels that look for themselves: those of a list, or all that
    are found to."""
    declared = _looking(lookup, kinds)
    textures, constants, defines = CELL, (), ()
    if listed:
        textures, constants, defines = lists.READ, (("INT", "columns"),), (*lists.DEFINES, ("LISTED", ""))
    return Program(
        name=f"visibility at {'listed' if listed else 'found'} pixels, {lookup.name}",
        compute="light/visibility_apart.comp.glsl",
        images=(("own_visibility", "R32F", "FLOAT_2D", "WRITE"),),
        group=(lists.RUN, 1, 1),
        **declared | {
            "textures": (*declared["textures"], *textures),
            "constants": (*declared["constants"], ("INT", "light_index"), ("INT", "first_row"), *constants),
            "defines": (*declared["defines"], *defines),
        },
    )  # fmt: skip


def programs_of(lookup: Lookup) -> tuple[Program, ...]:
    """All that may look shadows up in this way."""
    return looking(lookup), looking_apart(lookup), looking_apart(lookup, listed=False)


@dataclass
class _Found:
    """What is known of the visibility of up to LIGHTS lights: at the corners of cells, and at pixels apart."""

    cells: dict[str, images.Image] = field(default_factory=dict)  # by binding, as CELL
    apart: images.Image | None = None  # below 0 where cells tell it

    def find(
        self, frame: Frame, technique: Technique, rows: list[np.ndarray], kinds: int, sources: lights.Sources,
        maps: Maps,
    ) -> Iterator[None]:  # fmt: skip
        """Look the visibility up, in parts."""
        size = tuple((extent - 1) // RATE + 1 for extent in frame.size)  # so that each pixel has a cell
        points = tuple(count + 1 for count in size)
        bindings = surface_bindings(frame)
        seen = {name: bindings[name] for _, name in SEEN}
        view = {"film_view": frame.view_block}
        self.cells = {name: images.pool.take(*size, kind) for kind, name in CELL}
        self.apart = images.pool.take(frame.size[0], frame.size[1] * len(rows), "R32F")
        self.apart.texture.clear(format="FLOAT", value=(-1.0,))

        def bound(constants: dict) -> dict:
            return {
                "textures": {**seen, "depth_maps": maps.atlas, **maps.textures},
                "blocks": {**view, "sources": sources.set(rows, maps.views), **maps.blocks},
                "constants": {**constants, **maps.constants},
            }

        with images.borrowed(*points, "RGBA32F") as visibility:
            passes.fullscreen(looking(maps.lookup, kinds), visibility, **bound({"light_count": len(rows)}))
            known = {**seen, "visibility": visibility.colors[0]}
            passes.fullscreen(CELLS, images.Target(tuple(self.cells.values())), textures=known, blocks=view)
        yield
        listed = context.counts_in_images()
        program = looking_apart(maps.lookup, kinds, listed)
        for index in range(len(rows)):
            where, width, constants = self.cells, frame.size[0], {"light_index": index}
            with ExitStack() as stack:
                if listed:
                    entries = stack.enter_context(lists.borrowed(frame.size))
                    passes.compute(
                        LIST, frame.size, textures={**seen, **self.cells}, blocks=view, images=entries,
                        constants=constants,
                    )  # fmt: skip
                    where, width = entries, lists.columns(frame.size, SHARE)
                    constants["columns"] = width
                for first, last in frame.bands(technique, f"visibility {index}"):
                    given = bound({**constants, "first_row": first})
                    given["textures"] |= where
                    passes.compute(program, (width, last - first), images={"own_visibility": self.apart}, **given)
                    yield

    def give(self) -> None:
        for image in (*self.cells.values(), *([self.apart] if self.apart else [])):
            images.pool.give(image)


def add(
    frame: Frame, technique: Technique, sources: lights.Sources, lit: repeated_light.Lit, kinds: int, maps: Maps,
    between: Program,
) -> Iterator[None]:  # fmt: skip
    """Add this light to the sample's radiance, in parts, by the program `between`, with the lookup BETWEEN, and keep it
    for other points of the film, which ask `maps` themselves."""
    many = min(LIGHTS, max(images.most_side() // frame.size[1], 1))  # one above the other in an image
    for first in range(0, len(lit.rows), many):
        some = lit.rows[first : first + many]
        found = _Found()
        try:
            yield from found.find(frame, technique, some, kinds, sources, maps)
            known = {
                "textures": {
                    "energy_table": frame.materials.energy_table, "own_visibility": found.apart,
                    **{name: found.cells[name] for name in CORNERS},
                },
                "blocks": {},
                "constants": {
                    "light_count": len(some), "traced_roughness": lit.bindings["constants"]["traced_roughness"]
                },
            }  # fmt: skip
            part = repeated_light.Lit(between, lit.where, known, some, lit.views)
            yield from repeated_light.add(frame, technique, sources, part, keeps=False)
        finally:
            found.give()
        frame.count(technique, "passes", 3 + 2 * len(some))
        frame.count(technique, "shared lookups", len(some))
    repeated_light.keep(frame, lit)
