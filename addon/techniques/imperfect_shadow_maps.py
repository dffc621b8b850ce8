"""Imperfect shadow maps: a small map of what each virtual light sees, drawn from points; rays correct what maps miss.

    irradiance = sum over groups of virtual lights of  (A v_a + B v_b)
    A = sum over the group of  V_i L_i G_i s(d_i),    B = sum of  (1 - V_i) L_i G_i s(d_i)

Virtual lights, kernels G, the bound s with its short rays, and regions are those of multires_radiosity.py. V_i is what
the map of light i says, bilinear between four texels. In each of `rays` groups, light a is drawn in proportion to its
term of A and b to its term of B; rays find their visibilities v_a and v_b. In the mean the maps cancel: the estimate is
that of tracing every virtual light, and its noise is that of what the maps show wrong. Light stays positive.

All maps are drawn at once from a coarse stand-in for the scene (scene/surface_points.py): large triangles as
themselves, the rest as discs at `points` points, others for each map. A map is the half ball over its light's surface,
(x, y) / (1 + z). A texel stores the plane of the nearest thing; plane n . p = h hides a place p of a surface with
normal m if

    n . p - h > slack |p|,     and, where -n . m > 1/2:     n . p - h > 3/4 |p - hit| |n x m| + slack |p|

(the second keeps curved surfaces from shadowing themselves). Pull and push fills holes between discs.

Sources: Ritschel, Grosch, Kim, Seidel, Dachsbacher & Kautz 2008; Ritschel 2009, chapter 5; pull and push: Marroquim et
al. 2007, here where three of four texels agree. Ours: planes, triangles, evenly spread points, correction by rays.

| cost | per sample, with N virtual lights; else as multires_radiosity.py |
|---|---|
| splats, texels | N x (`points` + large triangles) squares; N x `map_size`^2 of 12 bytes, 1.3 passes more for points |
| gathering | 1 kernel and 4 texels per region and virtual light, 2 to 6 rays per region and group |

Bias (diffuse indirect light): that of multires_radiosity.py; without rays also what the maps show wrong. Fails: what is
smaller than a texel or the spacing of points is grain (grass, towns of thousands of houses). Figures:
docs/log/2026-11-26-indirect-light.md.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.technique import Param, Technique
from ..gfx import geometry, images, passes
from ..gfx.library import Program
from ..lighting.virtual_lights import BoundGather, Gather, VirtualLightSet
from ..scene import acceleration
from ..scene.surface_points import RUNS, TEXELS, SurfacePoints
from ..snapshot.scene import Snapshot
from .multires_radiosity import LEVELS, NEAR_BOUNCES, MultiresRadiosity, regions

FILL_LEVELS = 2
THRESHOLD = 0.05  # of the distance, on the finest level, between what lies on one plane and what is seen through it
MAP_CONSTANTS = (("INT", "map_side"), ("INT", "map_columns"))
PLANE_OUTPUT = (("VEC2", "out_plane"),)
MAPS = Gather(
    "imperfect shadow maps", "ism/gather.glsl", (("FLOAT_2D", "virtual_maps"),), (*MAP_CONSTANTS, ("INT", "rays"))
)
REGIONS = regions(MAPS)
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
        ("INT", "run_points"), ("FLOAT", "depth_unit"), ("INT", "lot"),
    ),
    defines=(("ENTRY_TEXELS", str(TEXELS)), ("DISC", "0.0"), ("CUT_DISC", "1.0"), ("TRIANGLE", "2.0")),
    writes_depth=True,
)  # fmt: skip
PULL = passes.fullscreen_program(
    "maps of half the side",
    "ism/pull.frag.glsl",
    textures=(("FLOAT_2D", "finer_maps"),),
    constants=(("INT", "map_side"), ("FLOAT", "threshold")),
    outputs=PLANE_OUTPUT,
)
PUSH = passes.fullscreen_program(
    "holes of maps",
    "ism/push.frag.glsl",
    textures=(("FLOAT_2D", "finer_maps"), ("FLOAT_2D", "coarser_maps")),
    constants=(("INT", "map_side"), ("FLOAT", "threshold")),
    outputs=PLANE_OUTPUT,
)


class VirtualMaps:
    """Maps of what virtual lights see. A technique owns one, calls `begin`, then `draw` in each sample, and binds what
    it gets."""

    def __init__(self):
        self._points = SurfacePoints()
        self._numbers = (0, None)  # how many points there are, and they
        self._atlas: list[images.Target] = []  # maps; maps of half the side, a quarter, …
        self._filled: list[images.Target] = []  # without holes: whole side, half, …
        self._borrowed: list[images.Image] = []

    def begin(self, frame: Frame, technique: Technique, points: int) -> None:
        """Spread runs of `points` points, a power of two, over the surfaces, unless they still lie there."""
        made = self._points.update(frame, points, frame.typical_distance)
        count = self._points.triangles + self._points.points
        if count != self._numbers[0]:
            self._numbers = (count, geometry.numbered_points(count) if count else None)
        frame.count(technique, "surface points made" if made else "surface points kept", count)

    def draw(self, frame: Frame, technique: Technique, lights: VirtualLightSet, side: int) -> BoundGather:
        """Maps of `side` texels, a power of two. Counts in the technique's row."""
        unit = frame.typical_distance
        columns = max(int(np.ceil(np.sqrt(len(lights)))), 1)
        rows = max(-(-len(lights) // columns), 1)
        self._prepare(side * columns, side * rows)
        self._atlas[0].clear()
        count, numbers = self._numbers
        if count and len(lights):
            shader = passes.get(SPLAT)
            with passes.drawing(self._atlas[0], depth_test="LESS"):
                shader.bind(
                    textures={"surface_points": self._points.image, "virtual_lights": lights.image},
                    constants={
                        "map_side": side, "map_columns": columns, "map_rows": rows,
                        "triangle_count": self._points.triangles, "run_points": self._points.points,
                        "first_run": frame.sample * len(lights) % RUNS, "run_count": RUNS, "depth_unit": unit,
                        "lot": frame.sample,
                    },
                )  # fmt: skip
                passes.draw_points(shader, numbers, len(lights))
        frame.count(technique, "maps", len(lights))
        frame.count(technique, "splats", count * len(lights))
        maps = self._fill(side) if self._points.points else self._atlas[0].colors[0]
        return BoundGather(MAPS, {"virtual_maps": maps}, {"map_side": side, "map_columns": columns})

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

    def _fill(self, side: int) -> images.Image:
        """The maps without holes: planes pulled up to smaller maps and pushed down again."""
        for level, (finer, coarser) in enumerate(zip(self._atlas, self._atlas[1:])):
            passes.fullscreen(
                PULL, coarser, textures={"finer_maps": finer.colors[0]},
                constants={"map_side": side >> (level + 1), "threshold": THRESHOLD * 2**level},
            )  # fmt: skip
        coarse = self._atlas[-1].colors[0]
        for level in reversed(range(FILL_LEVELS)):
            passes.fullscreen(
                PUSH, self._filled[level],
                textures={"finer_maps": self._atlas[level].colors[0], "coarser_maps": coarse},
                constants={"map_side": side >> level, "threshold": THRESHOLD * 2**level},
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


class ImperfectShadowMaps(MultiresRadiosity):
    name = "imperfect_shadow_maps"
    label = "Imperfect shadow maps"
    params = (
        Param(
            "virtual_lights", "Virtual lights", 256,
            "Virtual lights in each sample, each with a shadow map",
            1, 2048, draft=64,
        ),
        Param(
            "points", "Points", 512,
            "Points that stand for small geometry in each map; rounded to a power of two",
            16, 16384, draft=128,
        ),
        Param(
            "map_size", "Map size", 32,
            "Texels along each side of a map; rounded to a power of two",
            8, 128, draft=16,
        ),
        Param(
            "rays", "Rays", 4,
            "Pairs of rays per region and sample that correct the maps; 0: none",
            0, 128, draft=1,
        ),
        LEVELS,
        NEAR_BOUNCES,
    )  # fmt: skip

    def __init__(self):
        super().__init__()
        self.maps = VirtualMaps()

    def claims(self, snapshot: Snapshot, settings: Settings) -> bool:
        return False

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        return super().skip(snapshot, settings) or acceleration.too_many_copies(snapshot)

    def begin(self, frame: Frame) -> None:
        super().begin(frame)
        if frame.receivers is not None and len(frame.receivers.distance):
            self.maps.begin(frame, self, self._power_of_two(frame, "points"))

    def _power_of_two(self, frame: Frame, name: str) -> int:
        return 1 << round(np.log2(frame.settings.get(self, name)))

    def visibility(self, frame: Frame, lights: VirtualLightSet) -> BoundGather:
        bound = self.maps.draw(frame, self, lights, self._power_of_two(frame, "map_size"))
        return replace(bound, constants={**bound.constants, "rays": frame.settings.get(self, "rays")})

    def release(self) -> None:
        super().release()
        self.maps.release()
