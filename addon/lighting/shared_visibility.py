"""Shared visibility: soft shadows are looked up at every fourth pixel and interpolated where they vary little.

A soft shadow lookup reads some hundred texels per pixel and light, for a visibility that is mostly smooth. So up to
four lights at a time are looked up at every RATE-th pixel along both axes, a sixteenth of the pixels. A cell between
four such pixels knows the visibility of a light if two or more of its corners lie on one plane (within two pixels'
width, normals within 25 degrees) and the visibility at those is equal or linear. Pixels of the cell on that plane
interpolate:

    V(p) = bilinear of V at the corners on the plane,
    max V - min V <= ALIKE there, or <= LINEAR where second differences, one corner further too, are at most BEND

All other pixels do their own lookup: outlines, contacts and bends of penumbrae stay as exact as without sharing. Those
pixels are scattered, so they are compacted into a list per light (kernels/lists.py) and looked up in one dispatch.
Small pictures (below MANY_PIXELS) are not shared: they cost little, and narrow shadows are much of them.

| cost | per four lights, beside the lookups |
|---|---|
| passes | 2, and 2 dispatches |
| fetches | 28 per cell; per pixel 7, and 1 per light |
| bytes | per pixel 8 per light, and 2 |

Bias (direct light of soft maps in pictures of few samples): shadows narrower than four pixels between corners that do
not see them are lost; elsewhere at most ALIKE between three corners, or an eighth of BEND between four. None with more
samples, or with `sparse` off. Errors and times with and without: docs/log/2026-11-26-soft-shadows.md.

Sources: Ward, Rubinstein, Clear, "A ray tracing solution for diffuse interreflection", SIGGRAPH 1988, for keeping a
quantity where it varies little; on a screen grid with silhouettes found by planes, Nichols & Wyman 2009.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import cache

import numpy as np

from ..frame.picture import Frame
from ..frame.technique import Technique
from ..gfx import context, images, passes
from ..gfx.library import Program
from ..kernels import lists
from ..scene.view import VIEW
from ..sources import lights
from ..surfaces.draw import SURFACE_TEXTURES, surface_bindings
from . import repeated_light
from .visibility import Lookup, Maps, source_of

RATE = 4  # pixels between lookups, along both axes
# Differences of visibility between a cell's corners up to which pixels within it interpolate: whatever lies around, and
# where second differences there are at most BEND.
ALIKE, LINEAR, BEND = 0.1, 0.3, 0.05
MANY_PIXELS = 100_000
LIGHTS = 4  # whose visibility one image holds
DEFINES = (("RATE", str(RATE)), ("FACING", "0.9"), ("OFF_PLANE", "2.0"))
SEEN = tuple(texture for texture in SURFACE_TEXTURES if texture[1] in ("surface_position", "surface_normal"))
LOBE = ("RGBA32F", "surface_lobe")  # whether light may shine through; last, since few pixels ask it
FOUND = ("R32F", "pixel_visibility")  # of all pixels, lights one above the other
BETWEEN = Lookup("shared visibility", "light/shared_visibility.glsl", textures=(FOUND,), maps=False)
CELLS = passes.fullscreen_program(
    "cells of shared visibility",
    "light/visibility_cells.frag.glsl",
    textures=(*SEEN, ("RGBA32F", "visibility")),
    blocks=((VIEW, "film_view"),),
    defines=(*DEFINES, ("ALIKE", str(ALIKE)), ("LINEAR", str(LINEAR)), ("BEND", str(BEND))),
    outputs=(("VEC4", "out_cell"),),
)


def _between(listed: bool) -> Program:
    """The dispatch that finds the visibility of lights between pixels where it is known, and who looks for it."""
    return Program(
        name=f"visibility between pixels, others {'listed' if listed else 'marked'}",
        compute="light/visibility_between.comp.glsl",
        textures=(*SEEN, ("RGBA32F", "visibility"), ("RGBA32F", "cells")),
        images=((FOUND[1], FOUND[0], "FLOAT_2D", "WRITE"), *(lists.FILLED if listed else ())),
        blocks=((VIEW, "film_view"),),
        constants=(("INT", "light_count"),),
        defines=(*DEFINES, *(LISTED if listed else ())),
    )


LISTED = (("LISTED", ""), *lists.DEFINES)
LISTING, MARKING = _between(True), _between(False)
SHARE = 16  # of a list's room: entries that a thread may take


def _looking(lookup: Lookup, kinds: int, *more: tuple[str, str]) -> dict:
    """What all programs that look up the visibility of lights of these kinds declare."""
    return {
        "textures": (*lookup.textures, ("RGBA32F", "depth_maps"), *SEEN, *more, LOBE),
        "blocks": ((VIEW, "film_view"), (lights.SOURCES, "sources"), *lookup.blocks),
        "constants": (*lookup.constants, ("INT", "light_count")),
        "defines": (*DEFINES, *lookup.defines, ("LIGHT_KINDS", str(kinds))),
        "snippets": source_of(lookup),
    }


@cache
def looking(lookup: Lookup, kinds: int = -1) -> Program:
    """The pass that looks up the visibility of lights of these kinds (bits as in lights.LAMPS; -1: any light) at every
    RATE-th pixel."""
    return passes.fullscreen_program(
        f"visibility at some pixels, {lookup.name}", "light/visibility.frag.glsl", **_looking(lookup, kinds),
        outputs=(("VEC4", "out_visibility"),),
    )  # fmt: skip


@cache
def looking_apart(lookup: Lookup, kinds: int = -1, listed: bool = True) -> Program:
    """The dispatch that looks it up at the pixels that look for themselves: those listed, or all that are marked."""
    declared = _looking(lookup, kinds, *(lists.READ if listed else ()))
    return Program(
        name=f"visibility at {'listed' if listed else 'marked'} pixels, {lookup.name}",
        compute="light/visibility_apart.comp.glsl",
        images=((FOUND[1], FOUND[0], "FLOAT_2D", "WRITE" if listed else "READ_WRITE"),),
        group=(lists.RUN, 1, 1),
        **declared | {
            "constants": (*declared["constants"], ("INT", "first_row"), *((("INT", "columns"),) if listed else ())),
            "defines": (*declared["defines"], *(LISTED if listed else ())),
        },
    )  # fmt: skip


def programs_of(lookup: Lookup) -> tuple[Program, ...]:
    """All that may look shadows up in this way."""
    return looking(lookup), looking_apart(lookup), looking_apart(lookup, listed=False)


def _find(
    frame: Frame, technique: Technique, rows: list[np.ndarray], kinds: int, sources: lights.Sources, maps: Maps,
    found: images.Image,
) -> Iterator[None]:  # fmt: skip
    """Look up the visibility of up to LIGHTS lights, in parts, into `found`: a picture of each, one above another."""
    size = tuple((extent - 1) // RATE + 1 for extent in frame.size)  # so that each pixel has a cell
    points = tuple(count + 1 for count in size)
    bindings = surface_bindings(frame)
    seen = {name: bindings[name] for _, name in SEEN}
    view = {"film_view": frame.view_block}
    count = {"light_count": len(rows)}
    target = {FOUND[1]: found}

    def bound(constants: dict, textures: dict | None = None) -> dict:
        return {
            "textures": {
                **seen,
                LOBE[1]: bindings[LOBE[1]],
                "depth_maps": maps.atlas,
                **maps.textures,
                **(textures or {}),
            },
            "blocks": {**view, "sources": sources.set(rows, maps.views), **maps.blocks},
            "constants": {**count, **constants, **maps.constants},
        }

    listed = context.counts_in_images()
    with ExitStack() as stack:
        listing = stack.enter_context(lists.borrowed(frame.size, len(rows))) if listed else {}
        with images.borrowed(*points, "RGBA32F") as some, images.borrowed(*size, "RGBA32F") as cells:
            passes.fullscreen(looking(maps.lookup, kinds), some, **bound({}))
            known = {**seen, "visibility": some.colors[0]}
            passes.fullscreen(CELLS, cells, textures=known, blocks=view)
            passes.compute(
                LISTING if listed else MARKING, frame.size, textures={**known, "cells": cells.colors[0]}, blocks=view,
                images={**target, **listing}, constants=count,
            )  # fmt: skip
        yield
        program = looking_apart(maps.lookup, kinds, listed)
        width = lists.columns(frame.size, SHARE) if listed else frame.size[0]
        threads = {"columns": width} if listed else {}
        for first, last in frame.bands(technique, "visibility"):
            passes.compute(
                program, (width, last - first), images=target, **bound({**threads, "first_row": first}, listing)
            )
            yield


def add(
    frame: Frame, technique: Technique, sources: lights.Sources, lit: repeated_light.Lit, kinds: int, maps: Maps,
    answering: Callable[[Lookup, dict[str, images.Image]], tuple[Program, dict[str, images.Image]]],
) -> Iterator[None]:  # fmt: skip
    """Add this light to the sample's radiance, in parts, and keep it for other points of the film, which ask `maps`
    themselves. `answering`: the pass of light with a lookup, and all that it reads beside the surfaces."""
    many = min(LIGHTS, max(images.most_side() // frame.size[1], 1))  # one above the other in an image
    for first in range(0, len(lit.rows), many):
        some = lit.rows[first : first + many]
        found = images.pool.take(frame.size[0], frame.size[1] * len(some), FOUND[0])
        try:
            yield from _find(frame, technique, some, kinds, sources, maps, found)
            between, textures = answering(BETWEEN, {FOUND[1]: found})
            known = {
                "textures": textures,
                "blocks": {},
                "constants": {
                    "light_count": len(some), "traced_roughness": lit.bindings["constants"]["traced_roughness"]
                },
            }  # fmt: skip
            part = repeated_light.Lit(between, lit.where, known, some, lit.views)
            yield from repeated_light.add(frame, technique, sources, part, keeps=False)
        finally:
            images.pool.give(found)
        frame.count(technique, "passes", 5)
        frame.count(technique, "shared lookups", len(some))
    repeated_light.keep(frame, lit)
