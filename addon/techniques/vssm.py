"""Variance soft shadow maps: one depth map serves all of a light, or the part of it that a sample stands for.

A blocker at height h (in the map's depth measure q) above a receiver hides those points of the light that lie in a box
(a disc) of half extents e h around the receiver in the map (shaders/lib/soft_kernel.glsl). First the mean height of
the blockers in the largest kernel that matters is found, then the share of blockers in the kernel of that height:

    f = mean(h)^2 / mean(h^2),   h = mean(h^2) / mean(h)

for a cell of the kernel that holds the receiver's plane and one height. Both means come from a summed-area table of
q, q^2, q x and q y: with the last two, heights above a tilted plane are as exact as above a parallel one.

Cells are classified by a min-max pyramid (`rule` BOUNDS): all above the receiver, all lit, nothing far behind the
receiver (the moments hold), else a few texels are looked at. The source's own rule (`rule` MEAN) takes the moments
wherever the mean lies above the receiver, and leaks where a far background lies behind near blockers. Kernels of a
few texels look at every texel and see the caster's plane too, so contacts stay closed.

With n samples of the light, the map of each stands for 1 / n of it: the kernel's extents shrink by sqrt(n), steps
between the points are filled, and the error goes to that of accumulated maps and to zero. With one sample the point
is the light's middle, and the unblocked light has a closed form (shaders/light/whole.glsl).

Source: Yang, Dong, Feng, Seidel, Kautz, "Variance soft shadow mapping", Computer Graphics Forum 29(7), 2010; the
classification by bounds and the plane-relative moments are ours.

| cost | per map of N x N texels |
|---|---|
| pyramid, table | log2 N + 4 dispatches, 20 bytes per texel written |
| lookup, lit or all blocked pixels | up to 45 fetches |
| lookup, penumbra | 2 grids: up to 130 fetches of 16 bytes and 450 of 8, usually a third; 9 more per mixed cell |
| bytes | 36 per texel and 16 borrowed, beside the map's 20 |

Bias (direct diffuse and glossy light): blockers at several heights are flattened to their mean height; what the
light's middle does not see blocks nothing; visibility multiplies the unblocked light, as if every part of the light
counted the same for the receiver; parts of a refined light reach beyond its edge by half their width. All of it goes
to zero with the samples. Parts of the light below a receiver's horizon count neither as lit nor as blocked, also where
the map's own point is among them. Fails: blockers so close to a wide light that the kernel is larger than the view (a
lamp right behind muntins: half of the light is lost at one sample); kernels wider than 512 texels are cut to that.

Measured, RMS of the visibility behind an edge half way to the light, one map: square 0.012, rectangle 5:1 0.029, disc
0.021, sphere 0.003, sun 0.005. Refined, 16 and 64 points: square 0.006 and 0.0015, where points alone leave 0.015 and
0.0039. Against Cycles, relMSE of direct diffuse light at 128x96 (accumulated maps in brackets):

| scene | 1 sample | 16 samples |
|---|---|---|
| Cornell box | 0.051 (0.061) | 0.0038 (0.0042) |
| garden of soft shadows | 0.127 (0.182) | 0.0205 (0.0171) |
| room behind muntins | 1.08 (0.83) | 0.32 (0.23) |

Most of the first column is the pixels' edges, which one sample does not smooth. RMS of the visibility of one map on the
families of `python -m bench.soft`, against 1,024 accumulated maps (one, four and 16 of which leave 0.26, 0.098, 0.041
in the mean): thin poles 0.031, chain fence 0.078, foliage 0.056, grid 0.056, far background 0.050, stacked plates
0.019; with twice as many texels the grid has 0.038 and the far background 0.023.

On a software rasteriser a refined sample costs about 2 to 4 times one of points alone. Hence Auto keeps accumulated
maps.
"""

from __future__ import annotations

import weakref
from dataclasses import replace

import numpy as np

from ..frame import depth_maps, lights, tables
from ..frame.run import Frame
from ..frame.technique import Param
from ..gfx import images
from .accumulated_maps import CUTOFF, RESOLUTION, AccumulatedMaps, Lookup, Maps, map_resolution
from .direct_light import lighting

RULES = (("BOUNDS", "Bounds", 0), ("MEAN", "Mean", 1))
# A blocker so much nearer to the light than the farthest receiver counts as if it stood there: its kernel is smaller
# than it should be, but receivers keep 10 of the table's 15 bits.
MOST_RANGE = 32.0
_RANGE = {"textures": (("FLOAT_2D", "depth_bounds"), ("FLOAT_2D", "depth_limits"))}
_CONSTANTS = (("INT", "bounds_rows"), ("INT", "top_level"))
BOUNDS = tables.PyramidSource(
    "depth bounds",
    "vec2 bounds_source(ivec2 texel)\n{\n  vec4 caster = texelFetch(depth_maps, texel, 0);\n"
    "  return (caster.w > 0.0) ? caster.xx : vec2(0.0);\n}\n",
    textures=(("FLOAT_2D", "depth_maps"),),
)
MOMENTS = tables.TableSource(
    "depth moments",
    '#include "vssm/moments.glsl"\n',
    textures=(("FLOAT_2D", "depth_maps"), *_RANGE["textures"]),
    constants=_CONSTANTS,
    integer=True,
)


def _lookup(rule: str, cells: int) -> Lookup:
    return Lookup(
        f"variance soft shadows, {rule.lower()}, {cells} cells",
        "vssm/visibility.glsl",
        textures=(*_RANGE["textures"], ("UINT_2D", "depth_table")),
        constants=_CONSTANTS,
        defines=(("CELLS", str(cells)), *((("MEAN_RULE", "1"),) if rule == "MEAN" else ())),
    )


LOOKUPS = tuple(lighting(_lookup(rule, 5), False) for rule, _, _ in RULES)
MOMENT_ROWS, MOMENT_COLUMNS = tables.table_programs(MOMENTS)  # chunk sums and scan of each
DEPTH_BOUNDS = tables.level_program(BOUNDS)


class VarianceSoftShadows(AccumulatedMaps):
    name = "vssm"
    label = "Variance soft shadow maps"
    slot = "shadow"
    params = (
        RESOLUTION,
        CUTOFF,
        Param("cells", "Cells", 5, "Cells along each side of the kernel in which blockers are looked for", 2, 8),
        Param(
            "rule", "Rule", "BOUNDS", "What tells whether the moments of a cell can be trusted", items=RULES,
        ),
        Param(
            "refine", "Refine", True,
            "With more samples, each stands for a smaller part of the light, so that the error goes to zero; else "
            "every sample shows the whole light from its middle",
        ),
    )  # fmt: skip

    def __init__(self):
        super().__init__()
        self._drawn: tuple[weakref.ref, tuple, Maps] | None = None
        self._bounds: images.Image | None = None
        self._table: images.Image | None = None

    def cell(self, frame: Frame, number: int, points: float) -> float:
        if not frame.settings.get(self, "refine"):
            return 1.0
        # What is shown while it grows has `number` + 1 points up to here.
        return float((points if frame.settings.whole else number + 1) ** -0.5)

    def resolution(self, frame: Frame) -> int:
        """A power of two, so that no entry of the pyramid lies in two views."""
        return 1 << round(np.log2(map_resolution(frame, frame.settings.get(self, "texels_per_pixel"))))

    def jitter(self, frame: Frame, emitter: lights.Emitter, number: int) -> tuple[float, float, float, float]:
        if not frame.settings.get(self, "refine"):
            number = 0
        shift_x, shift_y, turn, other = super().jitter(frame, emitter, number)
        if emitter.has_span:
            turn = depth_maps.turn_along(-emitter.axis, emitter.u[:3])  # boxes of texels are the light's shape
        return shift_x, shift_y, turn, other

    def views(self, frame: Frame, emitter: lights.Emitter, sample: np.ndarray, number: int, cell: float = 0.0) -> list:
        return [replace(view, cell=cell) for view in super().views(frame, emitter, sample, number, cell)]

    def draw(self, frame: Frame, views: list) -> Maps:
        key = tuple((view.rows.tobytes(), view.cell) for view in views)
        compiled = frame.materials.compiled
        varies = any(compiled[draw.material].transparent for draw in frame.geometry.draws)  # alpha is drawn by lot
        if not varies and self._drawn is not None and self._drawn[0]() is frame and self._drawn[1] == key:
            frame.count(self, "maps kept", len(views))
            return self._drawn[2]
        maps = self._prepared(frame, views, super().draw(frame, views))
        self._drawn = (weakref.ref(frame), key, maps)
        return maps

    def _prepared(self, frame: Frame, views: list, maps: Maps) -> Maps:
        """Pyramid and table of the part of the atlas that holds views."""
        side = self.resolution(frame) if views else 1
        rectangles = maps.views[:, 4] if len(maps.views) else np.zeros((1, 4))
        width, height = (int(-(-(rectangles[:, k] + rectangles[:, 2]).max() // side)) * side for k in (0, 1))
        width, height = max(width, 2), max(height, 2)
        levels = max(int(np.log2(side)), 1)
        bounds_size = tables.pyramid_size(width, height)
        self._bounds = _grown(self._bounds, bounds_size, "RG32F")
        self._table = _grown(self._table, (width, height), "RGBA32UI")
        limits = np.zeros((height // max(side, 2), width // max(side, 2)), np.float32)
        for view, (x, y, _, _) in zip(views, rectangles):
            place = (int(y) // side, int(x) // side)
            limits[place] = max(limits[place], 1.0 if not view.light_point[3] else MOST_RANGE * view.least_q)
        constants = {"bounds_rows": height, "top_level": levels}
        if views:
            tables.build_pyramid(BOUNDS, self._bounds, levels, textures={"depth_maps": maps.atlas})
        shared = {"depth_bounds": self._bounds, "depth_limits": images.upload(np.maximum(limits, 1e-30), "R32F")}
        if views:
            bound = {"depth_maps": maps.atlas, **shared}
            tables.build_table(MOMENTS, self._table, textures=bound, constants=constants)
        lookup = _lookup(frame.settings.get(self, "rule"), frame.settings.get(self, "cells"))
        return replace(maps, lookup=lookup, textures={**shared, "depth_table": self._table}, constants=constants)

    def release(self) -> None:
        super().release()
        for image in (self._bounds, self._table):
            if image is not None:
                images.pool.give(image)
        self._bounds = self._table = self._drawn = None


def _grown(image: images.Image | None, size: tuple[int, int], image_format: str) -> images.Image:
    """The image if it has the size, else another one of the pool."""
    if image is not None and image.size == size:
        return image
    if image is not None:
        images.pool.give(image)
    return images.pool.take(*size, image_format)
