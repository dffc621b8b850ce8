"""Imperfect shadow maps: a small map of what each of many points sees, drawn from a coarse stand-in for the scene.

All maps are drawn at once from large triangles as themselves and from discs at points of the rest
(scene/surface_points.py). Maps of points are half balls, (x, y) / (1 + z); those of directions are squares over what
the picture shows. A texel stores the plane of the nearest thing; pull and push fills holes between discs
(shaders/ism/visibility.glsl says when a plane hides a place).

Virtual lights have them (techniques/imperfect_shadow_maps.py), and so have wide lamps, suns and directions of the world
where *Shadows by* is *Maps of Points*: many points of each in a sample, whose soft shadows are smooth in one sample.

Bias of those: shadows of what is smaller than a texel or the spacing of points are blurred or missing.

Sources: Ritschel, Grosch, Kim, Seidel, Dachsbacher & Kautz 2008 (area lights and worlds there, too); Ritschel 2009,
chapter 5; pull and push: Marroquim et al. 2007, here where three of four texels agree.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.technique import Technique
from ..gfx import geometry, images, passes
from ..gfx.library import Program
from ..scene import acceleration
from ..scene.surface_points import RUNS, TEXELS, SurfacePoints
from ..sources import lights
from ..sources.rates import Rate
from . import repeated_light
from .caustic_casters import answered
from .loop import tinted_casters
from .visibility import BY_POINTS, NO_VIEWS, SHADOWS_BY, Batch, LightPoint, Lookup, Maps, VisibilityProvider

FILL_LEVELS = 2
THRESHOLD = 0.05  # of the distance, on the finest level, between what lies on one plane and what is seen through it
SIDE, POINTS = 64, 1024  # texels along a map of a light, and points of each
AT_ONCE, IN_ALL, OF_DRAFTS = 5, 8, 3  # exponents of two: points of a wide light in a sample, a picture, a draft
MAP_CONSTANTS = (("INT", "map_side"), ("INT", "map_columns"))
PLANE_OUTPUT = (("VEC2", "out_plane"),)
IMPERFECT = Lookup(
    "maps of points",
    "ism/light_visibility.glsl",
    textures=(("FLOAT_2D", "virtual_maps"), ("RGBA32F", "map_eyes")),
    constants=(*MAP_CONSTANTS, ("FLOAT", "half_extent")),
    maps=False,
)
AS_CAUSTICS = "depth maps, since its light that passes glass arrives as caustics, and maps of points let it pass, too"
SPLAT = Program(
    name="surfaces into maps",
    vertex="ism/splat.vert.glsl",
    fragment="ism/splat.frag.glsl",
    inputs=(("INT", "number"),),
    varyings=tuple(
        ("flat", kind, name)
        for kind, name in (
            ("VEC4", "disc"), ("VEC4", "plane"), ("VEC3", "tile"), ("VEC4", "first_bound"), ("VEC4", "second_bound"),
            ("VEC4", "third_bound"),
        )
    ),
    outputs=PLANE_OUTPUT,
    textures=(("RGBA32F", "surface_points"), ("RGBA32F", "virtual_lights")),
    constants=(
        *MAP_CONSTANTS, ("INT", "map_rows"), ("INT", "triangle_count"), ("INT", "first_run"), ("INT", "run_count"),
        ("INT", "run_points"), ("FLOAT", "depth_unit"), ("INT", "draw_seed"), ("FLOAT", "half_extent"),
    ),
    defines=(("ENTRY_TEXELS", str(TEXELS)), ("DISC", "0.0"), ("CUT_DISC", "1.0"), ("TRIANGLE", "2.0")),
    writes_depth=True,
)  # fmt: skip
PULL = passes.fullscreen_program(
    "maps of half the side",
    "ism/pull.frag.glsl",
    textures=(("FLOAT_2D", "finer_maps"),),
    constants=(("INT", "map_side"), ("FLOAT", "threshold"), ("FLOAT", "half_extent")),
    outputs=PLANE_OUTPUT,
)
PUSH = passes.fullscreen_program(
    "holes of maps",
    "ism/push.frag.glsl",
    textures=(("FLOAT_2D", "finer_maps"), ("FLOAT_2D", "coarser_maps")),
    constants=(("INT", "map_side"), ("FLOAT", "threshold"), ("FLOAT", "half_extent")),
    outputs=PLANE_OUTPUT,
)
PROGRAMS = (SPLAT, PULL, PUSH)


class SmallMaps:
    """Maps of what points and directions see. A technique owns one, calls `begin`, then `draw` in each sample, and
    binds what it gets."""

    def __init__(self):
        self._points = SurfacePoints()
        self._numbers = (0, None)  # how many points there are, and they
        self._atlas: list[images.Target] = []  # maps; maps of half the side, a quarter, …
        self._filled: list[images.Target] = []  # without holes: whole side, half, …
        self._borrowed: list[images.Image] = []

    def begin(self, frame: Frame, technique: Technique, points: int, path: str = "diffuse") -> None:
        """Spread runs of `points` points, a power of two, over the surfaces that rays of `path` meet, unless they still
        lie there."""
        made = self._points.update(frame, points, frame.typical_distance, path)
        count = self._points.triangles + self._points.points
        if count != self._numbers[0]:
            self._numbers = (count, geometry.numbered_points(count) if count else None)
        frame.count(technique, "surface points made" if made else "surface points kept", count)

    def draw(
        self, frame: Frame, technique: Technique, eyes: images.Image, side: int, half_extent: float = 0.0
    ) -> tuple[images.Image, dict[str, object]]:
        """Maps of `side` texels, a power of two, and MAP_CONSTANTS. `eyes`: a column for each, place and axis, of half
        balls, or, where `half_extent` (m) is not 0, of squares of twice that. Counts in the technique's row."""
        unit, wanted = frame.typical_distance, eyes.width
        columns = max(int(np.ceil(np.sqrt(wanted))), 1)
        rows = max(-(-wanted // columns), 1)
        self._prepare(side * columns, side * rows)
        self._atlas[0].clear()
        count, numbers = self._numbers
        if count and wanted:
            shader = passes.get(SPLAT)
            with passes.drawing(self._atlas[0], depth_test="LESS"):
                shader.bind(
                    textures={"surface_points": self._points.image, "virtual_lights": eyes},
                    constants={
                        "map_side": side, "map_columns": columns, "map_rows": rows,
                        "triangle_count": self._points.triangles, "run_points": self._points.points,
                        "first_run": frame.sample * wanted % RUNS, "run_count": RUNS, "depth_unit": unit,
                        "draw_seed": frame.sample, "half_extent": half_extent,
                    },
                )  # fmt: skip
                passes.draw_points(shader, numbers, wanted)
        frame.count(technique, "maps", wanted)
        frame.count(technique, "splats", count * wanted)
        maps = self._fill(side, half_extent) if self._points.points else self._atlas[0].colors[0]
        return maps, {"map_side": side, "map_columns": columns}

    def _prepare(self, width: int, height: int) -> None:
        """Images for an atlas of this size."""
        if self._atlas and self._atlas[0].size == (width, height):
            return
        self._give()

        def take(level: int, image_format: str = "RG32F") -> images.Image:
            self._borrowed.append(images.pool.take(width >> level, height >> level, image_format))
            return self._borrowed[-1]

        self._atlas = [images.Target((take(0),), take(0, "DEPTH_COMPONENT32F"))]
        self._atlas += [images.Target((take(level),)) for level in range(1, FILL_LEVELS + 1)]
        self._filled = [images.Target((take(level),)) for level in range(FILL_LEVELS)]

    def _fill(self, side: int, half_extent: float) -> images.Image:
        """The maps without holes: planes pulled up to smaller maps and pushed down again."""
        for level, (finer, coarser) in enumerate(zip(self._atlas, self._atlas[1:])):
            passes.fullscreen(
                PULL, coarser, textures={"finer_maps": finer.colors[0]},
                constants={
                    "map_side": side >> (level + 1), "threshold": THRESHOLD * 2**level, "half_extent": half_extent
                },
            )  # fmt: skip
        coarse = self._atlas[-1].colors[0]
        for level in reversed(range(FILL_LEVELS)):
            passes.fullscreen(
                PUSH, self._filled[level],
                textures={"finer_maps": self._atlas[level].colors[0], "coarser_maps": coarse},
                constants={"map_side": side >> level, "threshold": THRESHOLD * 2**level, "half_extent": half_extent},
            )  # fmt: skip
            coarse = self._filled[level].colors[0]
        return coarse

    def _give(self) -> None:
        for image in self._borrowed:
            images.pool.give(image)
        self._atlas, self._filled, self._borrowed = [], [], []

    def release(self) -> None:
        self._points.release()
        self._give()
        self._numbers = (0, None)


@dataclass(frozen=True)
class Eye:
    """Of a map: a place (3,) and an axis (3,), unit; `parallel`: it looks along that from all places."""

    place: np.ndarray
    axis: np.ndarray
    parallel: bool


def by_points(frame: Frame, technique: Technique) -> bool:
    """Whether wide lights have small maps from points. The ledger's row of the `technique` says why not."""
    if frame.settings.value("accumulated_maps", SHADOWS_BY) != BY_POINTS:
        return False
    why = acceleration.too_many_copies(frame.snapshot)
    if tinted_casters(frame):
        why = "something colours the light that passes it, and shares of maps from points have no colour"
    if why:
        frame.account.chose(technique, "wide lights", f"depth maps, since {why}")
    return not why


def programs_by_points(settings: Settings) -> tuple[Program, ...]:
    """What maps of points are drawn by, where they are asked for."""
    return PROGRAMS if settings.value("accumulated_maps", SHADOWS_BY) == BY_POINTS else ()


class ImperfectMaps(VisibilityProvider):
    """Of single points of flat lamps, of suns and of directions of the world: many in a sample."""

    def __init__(self):
        self._maps = SmallMaps()

    def begin(self, frame: Frame, technique: Technique) -> None:
        self._maps.begin(frame, technique, POINTS, "shadow")

    @staticmethod
    def serves(frame: Frame, technique: Technique, emitter: lights.Emitter) -> bool:
        """Whether it is a wide light, flat or a sun with a disc, of which no part arrives as caustics; else the
        ledger's row of the `technique` says so: glass stops none of it in maps of points, as it has to there."""
        if not (emitter.is_flat or (emitter.kind == lights.SUN and emitter.radius > 0.0)):
            return False
        if answered(frame, emitter):
            frame.account.chose(technique, emitter.light.name, AS_CAUSTICS)
            return False
        return True

    def rate(self, frame: Frame, rate: Rate) -> Rate:
        left = IN_ALL - int(np.log2(max(frame.settings.samples, 1))) if frame.settings.schedule.known_total else AT_ONCE
        most = OF_DRAFTS if frame.settings.schedule.is_draft else AT_ONCE
        return Rate(max(rate.exponent, int(np.clip(left, 0, most))))

    def views(self, frame: Frame, emitter: lights.Emitter, sample: np.ndarray, number: int, cell: float = 0.0) -> list:
        if not emitter.light.cast_shadow:
            return []
        if emitter.kind == lights.SUN:
            return [self.eye_along(frame, sample)]
        return [Eye(emitter.position(sample), emitter.axis, False)]

    @staticmethod
    def eye_along(frame: Frame, towards: np.ndarray) -> Eye:
        """Of light that comes from a direction, (3,) unit."""
        receivers = frame.receivers
        return Eye((receivers.low.min(axis=0) + receivers.high.max(axis=0)) / 2, -np.asarray(towards), True)

    def batches(self, frame: Frame, technique: Technique, points: list[LightPoint]) -> Iterator[Batch]:
        kinds: dict[bool, list[LightPoint]] = {}
        for point in points:
            kinds.setdefault(bool(point.views) and point.views[0].parallel, []).append(point)
        found = [
            (own[first : first + lights.MOST_LIGHTS], parallel)
            for parallel, own in kinds.items()
            for first in range(0, len(own), lights.MOST_LIGHTS)
        ]
        for number, (own, parallel) in enumerate(found):
            if number:  # maps lie where those of the batch before were
                repeated_light.forbid(frame)
            yield self._drawn(frame, technique, own, parallel)

    def _drawn(self, frame: Frame, technique: Technique, points: list[LightPoint], parallel: bool) -> Batch:
        eyes = np.zeros((2, len(points), 4), np.float32)
        for number, point in enumerate(points):
            if point.views:
                point.row[lights.LIGHT.at.first_view], point.row[lights.LIGHT.at.view_count] = number, 1
                eyes[0, number, :3], eyes[1, number, :3] = point.views[0].place, point.views[0].axis
            else:
                eyes[1, number, 2] = 1.0
        receivers = frame.receivers
        extent = np.linalg.norm(receivers.high.max(axis=0) - receivers.low.min(axis=0)) / 2 if parallel else 0.0
        image = images.upload(eyes)
        maps, constants = self._maps.draw(frame, technique, image, SIDE, float(extent))
        textures = {"virtual_maps": maps, "map_eyes": image}
        return points, Maps(None, NO_VIEWS, IMPERFECT, textures, {**constants, "half_extent": float(extent)})

    def release(self) -> None:
        self._maps.release()
