"""Shared visibility: soft shadows are looked up at every fourth pixel, and in between where they or surfaces vary.

A soft shadow map asks some hundred texels for each pixel and light, for a visibility that mostly varies little from
one pixel to the next. So up to four lights at a time are looked up at every fourth pixel along both axes, a sixteenth
of the pixels. A cell between four such pixels knows the visibility of a light within it if two or more of them lie on a
plane (two pixels' width, normals within 25 degrees) and the light is seen alike from those, or varies in proportion.
Pixels of the cell on that plane interpolate:

    V(p) = bilinear of V at the corners on the plane,
    max V - min V <= ALIKE there, or <= LINEAR where second differences, one corner further too, are at most BEND

Of the others every second pixel along both axes looks for itself, cells between those are asked in the same way, and
what they do not know looks for itself.

What is lit, or in full shadow, is as exact as before; so are outlines, contacts and the bends of penumbrae. The pixels
that look for themselves lie scattered, and lanes of a GPU beside them would idle: they are listed (frame/lists.py),
light by light, and looked up in one dispatch.

Beside looking at every pixel, and at every fourth and then at all between, one variance map of 1024x1024, 640x360
pixels: RMS error of the visibility, and processor time of its shadow on a software GPU (as `python -m
bench.soft_lights` takes it):

| | thin poles | chain fence | foliage | grid | far background | stacked blockers |
|---|---|---|---|---|---|---|
| every pixel | .0234, 337 ms | .0454, 447 ms | .0570, 446 ms | .0417, 323 ms | .0191, 351 ms | .0164, 294 ms |
| every fourth | .0235, 110 ms | .0456, 329 ms | .0570, 145 ms | .0420, 180 ms | .0181, 117 ms | .0168, 68 ms |
| shared | .0233, 87 ms | .0460, 271 ms | .0571, 125 ms | .0419, 165 ms | .0184, 108 ms | .0167, 53 ms |

| cost | per four lights, beside the lookups |
|---|---|
| passes | 4, and 4 dispatches |
| fetches | 28 per cell of 4 and of 2 pixels; per pixel 7, and 1 per light |
| bytes | per pixel 8 per light, and 8 |

Small pictures (MANY_PIXELS) are left alone: they cost little, and shadows narrower than four pixels are much of them.

Bias (direct light of soft maps in pictures of few samples): shadows narrower than four pixels, between corners that do
not see them; else at most ALIKE between corners that are alike, or an eighth of BEND between four. Beside two corners
alone, at outlines, nothing tells how visibility goes on; RMS over the families is the same with three. None with more
samples, or with `sparse` off.

Sources: Ward, Rubinstein, Clear, "A ray tracing solution for diffuse interreflection", SIGGRAPH 1988, for a quantity
that is kept where it varies little; on a grid of the screen, with silhouettes told by planes, Nichols & Wyman 2009.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
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

# Pixels between lookups, along both axes, each a power of two and half of the one before; and the difference of
# visibility between a cell's corners up to which pixels within it interpolate, whatever lies around: less hides between
# closer ones.
ALIKE = {4: 0.04, 2: 0.07}
RATES = tuple(ALIKE)
LINEAR, BEND = 0.3, 0.05  # the same where second differences around are at most BEND
MANY_PIXELS = 100_000
LIGHTS = 4  # whose visibility one image holds
PLANES = (("FACING", "0.9"), ("OFF_PLANE", "2.0"))
SEEN = tuple(texture for texture in SURFACE_TEXTURES if texture[1] in ("surface_position", "surface_normal"))
FOUND = ("R32F", "pixel_visibility")  # of all pixels, lights one above the other
BETWEEN = Lookup("shared visibility", "light/shared_visibility.glsl", textures=(FOUND,), maps=False)
CELLS = passes.fullscreen_program(
    "cells of shared visibility",
    "light/visibility_cells.frag.glsl",
    textures=(*SEEN, ("RGBA32F", "visibility")),
    blocks=((VIEW, "film_view"),),
    constants=(("INT", "cell_bits"), ("FLOAT", "alike")),
    defines=(*PLANES, ("LINEAR", str(LINEAR)), ("BEND", str(BEND))),
    outputs=(("VEC4", "out_cell"),),
)
POINTS = passes.fullscreen_program(
    "visibility at some pixels, from all",
    "light/visibility_points.frag.glsl",
    textures=(*SEEN, FOUND),
    blocks=((VIEW, "film_view"),),
    constants=(("INT", "point_bits"), ("INT", "light_count")),
    outputs=(("VEC4", "out_visibility"),),
)


def _between(listed: bool) -> Program:
    """The dispatch that finds the visibility of lights between points where it is known, and who looks for it."""
    return Program(
        name=f"visibility between pixels, others {'listed' if listed else 'marked'}",
        compute="light/visibility_between.comp.glsl",
        textures=(*SEEN, ("RGBA32F", "visibility"), ("RGBA32F", "cells")),
        images=((FOUND[1], FOUND[0], "FLOAT_2D", "WRITE"), *(lists.FILLED if listed else ())),
        blocks=((VIEW, "film_view"),),
        constants=tuple(
            ("INT", name) for name in ("cell_bits", "finer_bits", "light_count", *(("list_rows",) if listed else ()))
        ),
        defines=(*PLANES, *((("LISTED", ""), *lists.DEFINES) if listed else ())),
    )


LISTING, MARKING = _between(True), _between(False)
SHARE = 16  # of a list's room: entries that a thread may take


def _looking(lookup: Lookup, kinds: int) -> dict:
    """What all programs that look up the visibility of lights of these kinds declare."""
    return {
        "textures": (*lookup.textures, ("RGBA32F", "depth_maps"), *SEEN),
        "blocks": ((VIEW, "film_view"), (lights.SOURCES, "sources"), *lookup.blocks),
        "constants": lookup.constants,
        "defines": (*lookup.defines, ("LIGHT_KINDS", str(kinds))),
        "snippets": (("generated/visibility", f'#include "{lookup.file}"\n'),),
    }


@cache
def looking(lookup: Lookup, kinds: int = -1) -> Program:
    """The pass that looks up the visibility of lights of these kinds (bits as in lights.LAMPS; -1: any light) at some
    pixels."""
    declared = _looking(lookup, kinds)
    return passes.fullscreen_program(
        f"visibility at some pixels, {lookup.name}", "light/visibility.frag.glsl",
        **declared | {"constants": (*declared["constants"], *POINTS.constants)},
        outputs=(("VEC4", "out_visibility"),),
    )  # fmt: skip


@cache
def looking_apart(lookup: Lookup, kinds: int = -1, listed: bool = True) -> Program:
    """The dispatch that looks up that of one light at the pixels that look for themselves: those of a list, or all that
    are marked."""
    declared = _looking(lookup, kinds)
    return Program(
        name=f"visibility at {'listed' if listed else 'marked'} pixels, {lookup.name}",
        compute="light/visibility_apart.comp.glsl",
        images=((FOUND[1], FOUND[0], "FLOAT_2D", "WRITE" if listed else "READ_WRITE"),),
        group=(lists.RUN, 1, 1),
        **declared | {
            "textures": (*declared["textures"], *(lists.READ if listed else ())),
            "constants": (
                *declared["constants"], ("INT", "light_count"), ("INT", "first_row"),
                *((("INT", "columns"), ("INT", "list_rows")) if listed else (("INT", "finer_bits"),)),
            ),
            "defines": (*declared["defines"], *((("LISTED", ""), *lists.DEFINES) if listed else ())),
        },
    )  # fmt: skip


def programs_of(lookup: Lookup) -> tuple[Program, ...]:
    """All that may look shadows up in this way."""
    return looking(lookup), looking_apart(lookup), looking_apart(lookup, listed=False)


@dataclass(frozen=True)
class _Search:
    """The visibility of up to LIGHTS lights is looked up, and found in one image: `found` has the picture for each, one
    above the other."""

    frame: Frame
    technique: Technique
    rows: list[np.ndarray]
    kinds: int
    sources: lights.Sources
    maps: Maps
    found: images.Image

    def run(self) -> Iterator[None]:
        """All of it, in parts."""
        seen, view = self._seen(), {"film_view": self.frame.view_block}
        cells = {rate: tuple((extent - 1) // rate + 1 for extent in self.frame.size) for rate in RATES}  # all pixels'
        for rate, finer in zip(RATES, (*RATES[1:], 1)):
            points = tuple(count + 1 for count in cells[rate])
            told = {"cell_bits": _bits(rate), "alike": ALIKE[rate]}
            with images.borrowed(*points, "RGBA32F") as known, images.borrowed(*cells[rate], "RGBA32F") as cell:
                some = {"light_count": len(self.rows), "point_bits": _bits(rate)}
                if rate == RATES[0]:
                    passes.fullscreen(looking(self.maps.lookup, self.kinds), known, **self._bound(some))
                    yield
                else:
                    textures = {**seen, FOUND[1]: self.found}
                    passes.fullscreen(POINTS, known, textures=textures, blocks=view, constants=some)
                textures = {**seen, "visibility": known.colors[0]}
                passes.fullscreen(CELLS, cell, textures=textures, blocks=view, constants=told)
                yield from self._find_between({**textures, "cells": cell.colors[0]}, rate, finer)

    def _find_between(self, known: dict[str, images.Image], rate: int, finer: int) -> Iterator[None]:
        """Between cells of `rate` pixels, at pixels `finer` apart."""
        size = tuple(-(-(extent - 1) // finer) + 1 for extent in self.frame.size)
        bits, count = {"finer_bits": _bits(finer)}, len(self.rows)
        constants = {"cell_bits": _bits(rate), "light_count": count, **bits}
        listed = context.counts_in_images()
        with ExitStack() as stack:
            filled, width, where = {}, size[0], bits
            if listed:
                filled, width = stack.enter_context(lists.borrowed(size, count)), lists.columns(size, SHARE)
                constants |= {"list_rows": size[1]}
                where = {"list_rows": size[1], "columns": width}
            passes.compute(
                LISTING if listed else MARKING, size, textures=known, images={FOUND[1]: self.found, **filled},
                blocks={"film_view": self.frame.view_block}, constants=constants,
            )  # fmt: skip
            program = looking_apart(self.maps.lookup, self.kinds, listed)
            for first, last in self.frame.bands(self.technique, f"visibility {finer}", size[1]):
                bound = self._bound({**where, "light_count": count, "first_row": first})
                bound["textures"] |= filled
                passes.compute(program, (width, last - first), images={FOUND[1]: self.found}, **bound)
                yield

    def _seen(self) -> dict[str, images.Image]:
        bindings = surface_bindings(self.frame)
        return {name: bindings[name] for _, name in SEEN}

    def _bound(self, constants: dict) -> dict:
        maps = self.maps
        return {
            "textures": {**self._seen(), "depth_maps": maps.atlas, **maps.textures},
            "blocks": {
                "film_view": self.frame.view_block, "sources": self.sources.set(self.rows, maps.views), **maps.blocks
            },
            "constants": {**constants, **maps.constants},
        }  # fmt: skip


def _bits(rate: int) -> int:
    return rate.bit_length() - 1


def add(
    frame: Frame, technique: Technique, sources: lights.Sources, lit: repeated_light.Lit, kinds: int, maps: Maps,
    between: Program,
) -> Iterator[None]:  # fmt: skip
    """Add this light to the sample's radiance, in parts, by the program `between`, with the lookup BETWEEN, and keep it
    for other points of the film, which ask `maps` themselves."""
    many = min(LIGHTS, max(images.most_side() // frame.size[1], 1))  # one above the other in an image
    for first in range(0, len(lit.rows), many):
        some = lit.rows[first : first + many]
        found = images.pool.take(frame.size[0], frame.size[1] * len(some), FOUND[0])
        try:
            yield from _Search(frame, technique, some, kinds, sources, maps, found).run()
            known = {
                "textures": {"energy_table": frame.materials.energy_table, FOUND[1]: found},
                "blocks": {},
                "constants": {
                    "light_count": len(some), "traced_roughness": lit.bindings["constants"]["traced_roughness"]
                },
            }  # fmt: skip
            part = repeated_light.Lit(between, lit.where, known, some, lit.views)
            yield from repeated_light.add(frame, technique, sources, part, keeps=False)
        finally:
            images.pool.give(found)
        frame.count(technique, "passes", 1 + 4 * len(RATES))
        frame.count(technique, "shared lookups", len(some))
    repeated_light.keep(frame, lit)
