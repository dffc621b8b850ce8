"""Light of several bounces that media scatter, and light that they bring to surfaces: walks through media and rooms.

A walk starts in a medium or at a surface, looks at each stop for media that a lamp lights, and goes on
(shaders/media/indirect.frag.glsl). Light of several bounces is smooth where media are, so that below MANY samples
walks start in cells of a grid along the view (froxels.py), one each, and pixels integrate what the grid tells: a walk
serves all pixels that look through its cell, at any depth. What surfaces receive is found at one pixel in 16 and
spread over those that face alike. From MANY samples on, and in pictures of few pixels, walks start at each pixel, and
all converges.

| cost | per sample |
|---|---|
| walks | 2 for 16 pixels' surfaces and in each cell, of which one comes on 16 pixels; 4 below FEW samples |
| passes | 2 for media, 2 for surfaces, 1 for each round of rays that mirrors and glass send on |

Bias: below MANY samples light of several bounces is a mean over cells of up to 16 pixels, and 16 slices.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache

from ..frame.picture import Frame
from ..frame.technique import Technique
from ..gfx import images, passes
from ..gfx.interface import answer
from ..gfx.library import Program
from ..scene import acceleration
from ..scene.media import MEDIA_TEXTURES, Media
from ..scene.view import VIEW
from ..sources import lights
from ..sources.environment import WORLD
from ..surfaces.draw import SURFACE_TEXTURES, surface_bindings
from ..surfaces.reflectance import Reflectance
from ..surfaces.seen_layers import SeenLayers
from . import froxels
from .leaving_light import LEAVES
from .media import RAY_TEXTURES, Rays
from .path_sources import shaded_roughness

MANY = 64  # samples: below, light is found in cells, and at a few surfaces
WIDE, SMALL = 64, 32  # pixels along the shorter side: in smaller pictures cells were much of what is seen
STRIDE, SMALL_STRIDE = 4, 2  # pixels between surfaces that are asked
MOST_STEPS, EVERY = 12, 1 << 20  # of walks from surfaces; scatterings where steps alone are counted
FEW, FEW_WALKS, WALKS = 8, 4, 2  # samples: below, more walks of each start
LIT_TEXTURES = (*acceleration.HIERARCHY_TEXTURES, *MEDIA_TEXTURES)
WORLD_TEXTURES = (("RGBA32F", "environment_map"), ("R32F", "environment_density_map"))
CONSTANTS = (
    ("INT", "light_count"), ("IVEC2", "shown_pixel"), ("FLOAT", "offset_size"), ("FLOAT", "world_rows"),
    ("INT", "glass_blocks"),  # what it bends or mirrors arrives as beams
    ("INT", "stride"),
    ("INT", "hidden_rows"),  # the first ones, that light surfaces and no media
)  # fmt: skip
PIXELS, CELLS, ON_SURFACES = "pixels", "cells of the view", "surfaces"  # where walks start
START = {PIXELS: (), CELLS: (("FROM_FROXELS", "1"),), ON_SURFACES: (("FROM_SURFACES", "1"),)}


@dataclass(frozen=True)
class Lit:
    """What shines into media in a sample: lights' kinds as bits, how many rows, how many of them (the first ones) light
    surfaces alone, whether the world is asked by rays, and what programs bind for them."""

    kinds: int
    rows: int
    hidden: int
    world: bool
    textures: dict[str, images.Image]
    blocks: dict[str, object]


def defines_of(kinds: int, world: bool) -> tuple[tuple[str, str], ...]:
    """Of programs that are lit so."""
    return ("LIGHT_KINDS", str(kinds)), *((("WORLD_LIT", "1"),) if world else ())


def _shining(shining: bool) -> tuple[tuple[str, str], ...]:
    return (("SHINING", "1"),) if shining else ()


@cache
def walks_program(start: str, kinds: int, world: bool, shining: bool, once: bool, alone: bool = False) -> Program:
    """Finds light along walks. `shining`: and apart from it what comes straight from media that shine; `once`: media
    scatter it once; `alone`: only what comes straight from media that shine."""
    return passes.fullscreen_program(
        f"walks in media from {start}{', scattered once' if once else ''}{', straight ones' if alone else ''}",
        "media/indirect.frag.glsl",
        textures=(
            *LIT_TEXTURES, *(WORLD_TEXTURES if world else ()), ("RGBA32F", "reflectance"),
            *(SURFACE_TEXTURES if start == ON_SURFACES else (("RGBA32F", "surface_position"),)),
        ),
        blocks=((VIEW, "film_view"), (lights.SOURCES, "sources"), *(((WORLD, "world_light"),) if world else ())),
        constants=(
            *CONSTANTS, ("INT", "walks"), ("INT", "bounces"), ("INT", "scatters"),
            *(froxels.CONSTANTS if start == CELLS else ()),
            *((("FLOAT", "shaded_roughness"),) if start == ON_SURFACES else ()),
        ),
        defines=(
            *defines_of(kinds, world), *START[start], *_shining(shining), *((("ONE_SCATTER", "1"),) if once else ()),
            *((("STRAIGHT_ALONE", "1"),) if alone else ()),
        ),
        outputs=(("VEC4", "out_found"), *((("VEC4", "out_straight"),) if shining and not alone else ())),
    )  # fmt: skip


@cache
def at_hits_program(kinds: int, world: bool, shining: bool, transmission: bool) -> Program:
    """Walks from rays that mirrors and glass send on."""
    seen = walks_program(PIXELS, kinds, world, shining, False)
    paths = ("glossy", "transmission") if transmission else ("glossy",)
    return replace(
        seen,
        name="walks in media from rays of lobes",
        textures=tuple(dict.fromkeys((*seen.textures, *RAY_TEXTURES, ("RGBA32F", "met_path")))),
        constants=(*seen.constants, ("INT", "ray_number")),
        defines=(*seen.defines, ("AT_HITS", "1"), *((("TRANSMISSION", "1"),) if transmission else ())),
        outputs=tuple(("VEC4", f"out_{path}_{order}") for path in paths for order in ("direct", "indirect")),
    )


@cache
def cells_program(shining: bool) -> Program:
    """Brings the light of the grid to all pixels."""
    return passes.fullscreen_program(
        "light of media from cells of the view",
        "media/from_froxels.frag.glsl",
        textures=(
            *MEDIA_TEXTURES, ("RGBA32F", "surface_position"), ("RGBA32F", "froxel_light"),
            *((("RGBA32F", "froxel_straight"),) if shining else ()),
        ),
        blocks=((VIEW, "film_view"),),
        constants=froxels.CONSTANTS,
        defines=_shining(shining),
        outputs=(("VEC4", "out_indirect"), *((("VEC4", "out_direct"),) if shining else ())),
    )  # fmt: skip


@cache
def surfaces_program(shining: bool) -> Program:
    """Brings light that some surfaces receive to all pixels."""
    return passes.fullscreen_program(
        "light of media on surfaces",
        "media/onto_surfaces.frag.glsl",
        textures=(
            *SURFACE_TEXTURES, ("RGBA32F", "known_light"), *((("RGBA32F", "known_straight"),) if shining else ()),
            ("RGBA32F", "energy_table"),
        ),
        blocks=((VIEW, "film_view"),),
        constants=(("IVEC2", "shown_pixel"), ("INT", "stride"), ("FLOAT", "shaded_roughness")),
        defines=_shining(shining),
        outputs=(("VEC4", "out_indirect"), *((("VEC4", "out_direct"),) if shining else ()), ("VEC4", "out_glossy")),
    )  # fmt: skip


DECLARED = (
    *(walks_program(start, -1, start == CELLS, start != PIXELS, start == ON_SURFACES) for start in START),
    *(walks_program(start, -1, False, True, False, True) for start in (PIXELS, CELLS)),
    *(at_hits_program(-1, True, shining, True) for shining in (False, True)),
    *(program(shining) for program in (cells_program, surfaces_program) for shining in (False, True)),
)


class MediaBounces:
    """What walks find in a sample, added to the frame's radiance."""

    def __init__(self):
        self._reflectance = Reflectance()

    def sample(
        self, frame: Frame, technique: Technique, media: Media, lit: Lit, asked: dict[str, object], bounces: int
    ) -> Iterator[None]:
        """`asked`: values of CONSTANTS but the pixel's; `bounces`: before a medium scatters light to the eye. Surfaces
        get light that media have scattered once more than that, as in Cycles, between any number of surfaces. What
        media send out themselves they scatter once even without bounces, as they do light of lamps."""
        self._reflectance.update(frame)
        spread = frame.settings.samples < MANY and min(frame.size) >= SMALL
        self._walks = FEW_WALKS if frame.settings.samples < FEW else WALKS
        yield from self._onto_surfaces(frame, technique, media, lit, asked, bounces + 1, spread)
        if not media.scatters or not (bounces or media.emits):
            return
        if spread:
            yield from self._in_cells(frame, technique, media, lit, asked, bounces)
            return
        names = _names("volume", media.emits)[0 if bounces else 1 :]
        program = walks_program(PIXELS, lit.kinds, lit.world, media.emits, False, not bounces)
        program, bound = self._bound(frame, lit, program)
        bound["textures"]["surface_position"] = frame.kept(SeenLayers).position(frame, technique)
        constants = asked | {
            "shown_pixel": (0, 0),
            "stride": 1,
            "walks": 1,
            "bounces": max(bounces, 1),
            "scatters": EVERY,
        }
        target = frame.target(*names)
        for band in frame.bands(technique, names[0]):
            passes.fullscreen(program, target, blend="ADDITIVE_PREMULT", rows=band, constants=constants, **bound)
            yield
        frame.count(technique, "passes")

    def on_rays(
        self, frame: Frame, technique: Technique, media: Media, lit: Lit, asked: dict[str, object], bounces: int,
        rays: Rays, target: images.Target,
    ) -> None:  # fmt: skip
        """Add what media send back along `rays` after other bounces, in a sample whose own walks have been taken."""
        program = at_hits_program(lit.kinds, lit.world, media.emits, rays.transmission)
        program, bound = self._bound(frame, lit, program)
        bound["textures"] |= rays.textures
        constants = {
            "shown_pixel": (0, 0),
            "stride": 1,
            "walks": 1,
            "bounces": bounces,
            "scatters": EVERY,
        }
        constants |= asked | {"ray_number": rays.number}
        passes.fullscreen(program, target, blend="ADDITIVE_PREMULT", where=rays.where, constants=constants, **bound)
        frame.count(technique, "passes")

    def _in_cells(self, frame, technique, media, lit, asked, bounces) -> Iterator[None]:
        grid = froxels.froxels(frame, media)
        both = bool(bounces and media.emits)
        found = grid.take(1 + both)
        program = walks_program(CELLS, lit.kinds, lit.world, media.emits, False, not bounces)
        constants = asked | grid.constants
        constants |= {
            "shown_pixel": (0, 0),
            "stride": 1,
            "walks": self._walks,
            "bounces": max(bounces, 1),
            "scatters": EVERY,
        }
        program, bound = self._bound(frame, lit, program)
        passes.fullscreen(program, images.Target(found), constants=constants, **bound)
        yield
        passes.fullscreen(
            cells_program(both), frame.target(*_names("volume", media.emits)[0 if bounces else 1 :]),
            blend="ADDITIVE_PREMULT",
            textures={
                **media.textures, "surface_position": frame.kept(SeenLayers).position(frame, technique),
                **dict(zip(("froxel_light", "froxel_straight"), found)),
            },
            blocks={"film_view": frame.view_block}, constants=grid.constants,
        )  # fmt: skip
        for image in found:
            images.pool.give(image)
        frame.count(technique, "passes", 2)
        frame.count(technique, "walks", grid.size[0] * grid.size[1])
        yield

    def _onto_surfaces(self, frame, technique, media, lit, asked, scatters, spread) -> Iterator[None]:
        names = _names("diffuse", media.emits)
        program = walks_program(ON_SURFACES, lit.kinds, lit.world, media.emits, scatters == 1)
        program, bound = self._bound(frame, lit, program)
        constants = asked | {
            "walks": self._walks if spread else 1, "scatters": scatters, "shown_pixel": (0, 0), "stride": 1,
            "bounces": min(frame.settings.bounces, MOST_STEPS), "shaded_roughness": shaded_roughness(frame),
        }  # fmt: skip
        if spread:
            stride = STRIDE if min(frame.size) >= WIDE else SMALL_STRIDE
            turn = frame.sample * 7 % stride**2  # neighbours in turn far apart
            constants |= {"shown_pixel": (turn % stride, turn // stride), "stride": stride}
        size = tuple(-(-side // constants["stride"]) for side in frame.size)
        found = tuple(images.pool.take(*size, "RGBA32F") for _ in names)
        for band in [None] if spread else frame.bands(technique, names[0]):
            passes.fullscreen(program, images.Target(found), rows=band, constants=constants, **bound)
            yield
        passes.fullscreen(
            surfaces_program(media.emits), frame.target(*names, "radiance.glossy_indirect"), blend="ADDITIVE_PREMULT",
            textures={
                **surface_bindings(frame), **dict(zip(("known_light", "known_straight"), found)),
                "energy_table": frame.materials.energy_table,
            },
            blocks={"film_view": frame.view_block},
            constants={name: constants[name] for name in ("shown_pixel", "stride", "shaded_roughness")},
        )  # fmt: skip
        for image in found:
            images.pool.give(image)
        frame.count(technique, "passes", 2)
        yield

    def _bound(self, frame: Frame, lit: Lit, program: Program) -> tuple[Program, dict[str, dict]]:
        """The program for what the frame has, and what it is drawn with."""
        textures = lit.textures | surface_bindings(frame) | {"reflectance": self._reflectance.image}
        read = {name for _, name in program.textures}
        textures = {name: image for name, image in textures.items() if name in read}
        return answer(frame, program, textures, (LEAVES,)), {"textures": textures, "blocks": lit.blocks}

    def release(self) -> None:
        self._reflectance.release()


def _names(kind: str, shining: bool) -> tuple[str, ...]:
    return f"radiance.{kind}_indirect", *((f"radiance.{kind}_direct",) if shining else ())
