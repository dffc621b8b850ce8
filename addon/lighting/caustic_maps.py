"""Caustic maps for what rays have met: pixels show a caustic by splats, hits in mirrors and behind glass ask a map.

A technique of the slot `caustics` that finds the photons of a view of a light (photons.py) splats them into a map of
what that view shows past the casters, too, where rays follow lobes (shaded_reflections.py). Of it one image is kept to
the sample's end: irradiance in W/m2, and the distance along the view's axis of the surface that it is of. A hit adds

    rho / pi * E(x)

of the texels around its place whose surface lies on its plane. Shadow rays of hits take glass as opaque for the lights
answered for, as those of pixels do.

Where Cycles' switches leave diffuse surfaces without some of a light's caustics (caustic_casters.py), lobes have a map
of their own, with all photons: the switches are about diffuse closures alone. Of a light that diffuse closures are to
have nothing of, there is this one only.

Cost, per sample and view: a draw of the surfaces, the splats, a pass over the map; per round of rays a pass over the
hits for each CELLS views, which share an image; 4 x 4 bytes a texel for each of its cells, and of one view 7 x 4 x 4
more. A map has as many texels along each side as the picture has pixels, from LEAST_SIDE to SIDE: mirrors show what
they show smaller than it is.

Bias: the map's texels, and what the light's view does not show. At most MOST views of a sample are kept, those that
come first; lights beyond them keep their grey shadows there.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from ..frame.picture import Frame
from ..frame.technique import Technique
from ..gfx import images, passes
from ..gfx.library import Program
from ..gfx.struct import Block, Struct
from ..kernels import splats
from ..scene.view import VIEW
from ..surfaces.draw import SURFACE_TEXTURES
from . import caustic_casters
from .asked import asked
from .light_views import LightBuffers, LightView, widened
from .path_sources import ShadedLobes
from .photons import MAP, Bundle, LitView, Photons

LEAST_SIDE, SIDE, MOST = 128, 384, 8
COLUMNS, ROWS = 4, 2
CELLS = COLUMNS * ROWS  # of an image of kept maps, which a pass over hits asks all
EXTENT = 3.0  # of the map, beside the casters as the light sees them
LEAST_TEXELS = 1.04


def _into_map(defines: tuple[tuple[str, str], ...] = ()) -> Program:
    return splats.splat_program(
        "photon into caustic map",
        "caustics/map.frag.glsl",
        "map_view.row_x, map_view.row_y, map_view.row_w, map_view.row_q, map_view.backward.w",
        textures=MAP,
        blocks=((VIEW, "map_view"),),
        defines=defines,
        outputs=(("VEC4", "out_irradiance"),),
    )


INTO_MAP = _into_map()
ALL_INTO_MAP = _into_map((("ALL", ""),))  # also what diffuse surfaces are not to have
KEEP = passes.fullscreen_program(
    "caustic map kept",
    "caustics/keep.frag.glsl",
    textures=(("RGBA32F", "caustic_map"), ("RGBA32F", "receiver_position")),
    blocks=((VIEW, "map_view"),),
    constants=(("IVEC2", "cell_corner"),),
    outputs=(("VEC4", "out_kept"),),
)
# Of VIEW, by cell; w of `right`: whether diffuse closures take the map, of `up`: whether lobes do.
KEPT_FIELDS = ("row_x", "row_y", "row_w", "eye", "right", "up", "backward", "frame")
KEPT_VIEWS = Struct("KeptViews", *(("vec4", f"{name}[{CELLS}]") for name in KEPT_FIELDS))
SEEN = tuple(one for one in SURFACE_TEXTURES if one[1] in ("surface_position", "surface_normal", "surface_diffuse"))
AT_HITS = ("energy_table", "ray_direction", "met_path", "hit_passed", "kept_maps")


@cache
def at_hits_program(transmission: bool, soft: bool = False) -> Program:
    """`soft`: some hits have lobes without microfacets."""
    paths = ("glossy", "transmission") if transmission else ("glossy",)
    return passes.fullscreen_program(
        "caustic map at hits",
        "caustics/at_hits.frag.glsl",
        textures=(*SURFACE_TEXTURES, *(("RGBA32F", name) for name in AT_HITS)),
        blocks=((KEPT_VIEWS, "kept_views"),),
        constants=(("INT", "map_count"), ("INT", "map_side"), ("FLOAT", "shaded_roughness")),
        defines=(
            ("MAP_COLUMNS", str(COLUMNS)),
            *((("TRANSMISSION", "1"),) if transmission else ()),
            *((("SOFT", ""),) if soft else ()),
        ),
        outputs=tuple(("VEC4", f"out_{path}_indirect") for path in paths),
    )


PROGRAMS = (INTO_MAP, KEEP, *(at_hits_program(transmission) for transmission in (False, True)))
DECLARED = (ALL_INTO_MAP, *(at_hits_program(transmission, True) for transmission in (False, True)))


@dataclass
class KeptMaps:
    """Up to CELLS maps in one image: irradiance (rgb) and distance (w; 0: nothing) of what a light's view shows."""

    image: images.Image
    side: int  # of a map
    block: Block | None = None
    views: list[dict] = field(default_factory=list)  # fields of VIEW, by cell

    @property
    def next_corner(self) -> tuple[int, int]:
        """Of the first cell that is free."""
        number = len(self.views)
        return number % COLUMNS * self.side, number // COLUMNS * self.side


def side_of(frame: Frame) -> int:
    """Texels along a side of a map."""
    return int(np.clip(max(frame.size), LEAST_SIDE, SIDE))


class CausticMaps:
    """Maps of the sample that is drawn. One for each renderer: `frame.kept(CausticMaps)`."""

    def __init__(self):
        self.maps: list[KeptMaps] = []
        self._count = 0  # of maps
        self.lights: set[str] = set()  # keys of those that the maps of this or another sample are of
        self._sample: tuple[weakref.ref[Frame], int] | None = None
        self._pending: tuple[LitView, LightView, images.Image] | None = None
        self._splat: Callable[[Bundle], None] | None = None
        self._receivers = LightBuffers()
        self._maps: list[images.Target] = []
        self._takers: list[tuple[bool, bool]] = []  # of each: diffuse closures, lobes
        self._block: Block | None = None
        self._blocks: list[Block] = []
        self._shift = np.zeros(2)
        self._lasting = False

    def begin(self, frame: Frame, resting: set[str], lasting: bool = False) -> None:
        """Drop the maps of the sample before. Lights that are `resting` have theirs in other samples; `lasting`: what
        this sample makes serves those behind it, too, up to the next that begins."""
        self.end()
        self._lasting = lasting
        self.lights = set(resting)
        self._sample = weakref.ref(frame), frame.sample
        self._shift = np.array(frame.random("caustics/map", frame.sample))

    def done(self) -> None:
        """Nobody asks for the maps in this sample any more."""
        if not self._lasting:
            self.end()

    def end(self) -> None:
        """Give the maps back."""
        for one in self.maps:
            images.pool.give(one.image)
        self.maps, self._count, self.lights, self._sample = [], 0, set(), None
        self._pending = self._splat = None

    def of(self, frame: Frame) -> list[KeptMaps]:
        """The maps of the sample that `frame` is drawing."""
        if self._sample is None or self._sample[0]() is not frame:
            return []
        return self.maps if self._lasting or self._sample[1] == frame.sample else []

    def wants(self, frame: Frame, light: LitView) -> bool:
        """Whether rays of lobes meet surfaces that ask for a map of this view, and there is room for it; of a light
        there are maps of all views or of none."""
        if self._shares(light):
            return True
        if frame.service(ShadedLobes) is None:
            return False
        return self._count < MOST or caustic_casters.key_of(light.emitter) in self.lights

    def add(
        self, frame: Frame, technique: Technique, casters: caustic_casters.Casters, light: LitView, photons: Photons,
        gloss_apart: bool = False,
    ) -> Callable[[Bundle], None]:  # fmt: skip
        """Draw what the light's view shows, or take the map of its other points; the function that is returned splats a
        bundle into it. `keep` ends the map that was added last. `gloss_apart`: lobes have a map of their own."""
        if self._shares(light):
            return self._splat
        self.keep(frame, technique)
        low, high = frame.geometry.bounds_min, frame.geometry.bounds_max
        corners = np.array([[(low, high)[k >> axis & 1][axis] for axis in range(3)] for k in range(8)])
        side = side_of(frame)
        seen_from, extent = light.view, EXTENT
        if light.middle is not None:
            # Light of a point beside the middle lands beside what that shows, by less than this at any distance.
            seen_from = light.middle
            extent *= max(1.0, light.emitter.reach / float(np.linalg.norm(seen_from.high - seen_from.low)))
        key = caustic_casters.key_of(light.emitter)
        view = widened(seen_from, extent, corners[None] - frame.geometry.origin, side, self._shift)
        block, seen = self._receivers.receivers(frame, technique, view, casters.refracting | set(casters.going_on))
        caught = {name: seen[name.replace("receiver", "surface")] for _, name in MAP}
        self._takers = [(True, not gloss_apart)] if casters.wanted(key) or not gloss_apart else []
        self._takers += [(False, True)] * gloss_apart
        maps = self._maps_of(side)

        def splat(bundle: Bundle) -> None:
            records = photons.footprints(frame, technique, bundle, block, LEAST_TEXELS)
            for one, (by_diffuse, _) in zip(maps, self._takers):
                program = INTO_MAP if by_diffuse else ALL_INTO_MAP
                splats.draw(program, one, records, textures=caught, blocks={"map_view": block})
                frame.count(technique, "passes")

        self._pending, self._splat = (light, view, caught["receiver_position"]), splat
        self._count += 1
        self.lights.add(key)
        return splat

    def _shares(self, light: LitView) -> bool:
        """Whether this view's photons go into the map that was added last."""
        return self._pending is not None and light.middle is not None and self._pending[0].middle is light.middle

    def keep(self, frame: Frame, technique: Technique) -> None:
        """Keep the map that was splatted last, if there is one."""
        if self._pending is None:
            return
        _, view, position = self._pending
        self._pending = None
        values = {**view.values, "sample_index": frame.sample, "seed": frame.settings.seed}
        self._block = _updated(self._block, VIEW, values)
        for one, (by_diffuse, by_lobes) in zip(self._maps, self._takers):
            if not self.maps or len(self.maps[-1].views) == CELLS:
                image = images.pool.take(COLUMNS * view.side, ROWS * view.side, "RGBA32F")
                self.maps.append(KeptMaps(image, view.side))
            kept = self.maps[-1]
            corner = kept.next_corner
            passes.fullscreen(
                KEEP,
                images.Target((kept.image,)),
                viewport=(*corner, view.side, view.side),
                textures={"caustic_map": one.colors[0], "receiver_position": position},
                blocks={"map_view": self._block},
                constants={"cell_corner": corner},
            )
            frame.count(technique, "passes")
            takers = {"right": (*values["right"][:3], by_diffuse), "up": (*values["up"][:3], by_lobes)}
            kept.views.append({**values, **takers})
            kept.block = None

    def ready(self, frame: Frame) -> list[KeptMaps]:
        """`of`, with the blocks that programs bind."""
        found = self.of(frame)
        for number, one in enumerate(found):
            if one.block is None:
                if number == len(self._blocks):
                    self._blocks.append(None)
                one.block = self._blocks[number] = _updated(self._blocks[number], KEPT_VIEWS, _by_cell(one.views))
        return found

    def release(self) -> None:
        """Give all images back."""
        self.end()
        self._give_maps()
        self._receivers.release()
        self.__init__()

    def _maps_of(self, side: int) -> list[images.Target]:
        """One for each of the takers, empty."""
        if self._maps and self._maps[0].size != (side, side):
            self._give_maps()
        while len(self._maps) < len(self._takers):
            self._maps.append(images.Target((images.pool.take(side, side, "RGBA32F"),)))
        found = self._maps[: len(self._takers)]
        for one in found:
            one.clear()
        return found

    def _give_maps(self) -> None:
        for one in self._maps:
            images.pool.give(one.colors[0])
        self._maps = []


def _updated(block: Block | None, struct: Struct, values: dict) -> Block:
    if block is None:
        return Block(struct, **values)
    block.update(**values)
    return block


def _by_cell(views: list[dict]) -> dict[str, np.ndarray]:
    """Fields of KEPT_VIEWS."""
    found = {name: np.zeros((CELLS, 4), np.float32) for name in KEPT_FIELDS}
    for cell, view in enumerate(views):
        for name in KEPT_FIELDS:
            found[name][cell] = view[name]
    return found


def add_at_hits(
    frame: Frame, technique: Technique, maps: Iterable[KeptMaps], target: images.Target, transmission: bool, where: str,
    textures: dict[str, images.Image], roughness: float,
) -> None:  # fmt: skip
    """Add the caustics of `maps` at hits into images of indirect light. `textures`: closures of the hits (surface_*),
    and the paths that met them (met_path, hit_passed, ray_direction). `roughness`: of lobes up to which rays go on."""
    program = at_hits_program(transmission, frame.materials.soft)
    textures = {**textures, "energy_table": frame.materials.energy_table}
    wanted = {name for _, name in program.textures}
    bound = {name: image for name, image in textures.items() if name in wanted}
    program = asked(frame, program, bound)
    for one in maps:
        passes.fullscreen(
            program,
            target,
            blend="ADDITIVE_PREMULT",
            where=where,
            textures={**bound, "kept_maps": one.image},
            blocks={"kept_views": one.block},
            constants={"map_count": len(one.views), "map_side": one.side, "shaded_roughness": roughness},
        )
        frame.count(technique, "passes")
