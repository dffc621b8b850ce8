"""Variance soft shadow maps: one depth map serves all of a light, or the part of it that a sample stands for.

A blocker at height h (in the map's depth measure q) above a receiver hides those points of the light that lie in a box
(a disc) of half extents e h around the receiver in the map (shaders/lib/soft_kernel.glsl). First the mean height of
the blockers in the largest kernel that matters is found, then the share of blockers in the kernel of that height:

    f = mean(h)^2 / mean(h^2),   h = mean(h^2) / mean(h)

for a cell of the kernel that holds the receiver's plane and one height. Both means come from a summed-area table of
q, q^2, q x and q y: with the last two, heights above a tilted plane are as exact as above a parallel one.

Cells are classified by a min-max pyramid (`rule` BOUNDS): all above the receiver, all lit, nothing far behind the
receiver (the moments hold), else a few texels are looked at, staggered so that edges along rows are told as finely. The
source's own rule (`rule` MEAN) takes the moments wherever the mean lies above the receiver, and leaks where a far
background lies behind near blockers. Kernels of a few texels look at every texel and see the caster's plane too, so
contacts stay closed.

With n samples of the light, the map of each stands for 1 / n of it: the kernel's extents shrink by sqrt(n), steps
between the points are filled, and the error goes to that of accumulated maps and to zero. Rectangles are cut into 2^k
parts that tile them. With one sample, and for each such part, the point is the middle, and the unblocked light has a
closed form (shaders/light/whole.glsl). Blockers much lower than the mean are looked for by short rays, or, without
them, in smaller windows.

Source: Yang, Dong, Feng, Seidel, Kautz, "Variance soft shadow mapping", Computer Graphics Forum 29(7), 2010; the
classification by bounds and the plane-relative moments are ours.

| cost | per map of N x N texels |
|---|---|
| pyramid | a pass and log2 N - 1 dispatches; 4 bytes per texel |
| table | 4 log8 N - 1 passes (log8 N rounded up) over blocks of 2 x 2 texels, from 16 samples on over texels |
| lookup, lit or all blocked pixels | up to 27 loads |
| lookup, penumbra | grids of 3 x 3 and 4 x 4 cells: 64 loads of 16 bytes, 225 of 8; up to 8 more per mixed cell |
| contact rays | 4, or 8 where those disagree, per pixel that is not settled and map; from 16 samples on 1 |
| bytes | 8 per texel and 4 borrowed, beside the map's 20; from 16 samples on 20 and 16 |

Bias (direct diffuse and glossy light): blockers at several heights are flattened to their mean height; what the light's
middle does not see, beyond the reach of contact rays, blocks nothing; visibility multiplies the unblocked light, as if
every part of the light counted the same for the receiver; parts of a refined light reach beyond its edge by half their
width. All of it goes to zero with the samples, where they refine. Parts of the light below a receiver's horizon count
neither as lit nor as blocked, also where the map's own point is among them. Fails: blockers so close to a wide light
that the kernel is larger than the view (a lamp right behind muntins: half of the light is lost at one sample); kernels
wider than 512 texels are cut to that.

Measured, RMS of the visibility behind an edge half way to the light, one map: square 0.012, rectangle 5:1 0.029, disc
0.021, sphere 0.003, sun 0.005. Refined, 16 and 64 points: square 0.0024 and 0.0007, where points alone leave 0.014 and
0.0031.

Errors and times on six families of blockers, with every parameter, stand in docs/soft_shadows.md.
"""

from __future__ import annotations

from dataclasses import replace

from ..frame.run import Frame
from ..frame.technique import Param
from ..kernels import tables
from ..lighting.loop import lighting
from ..lighting.point_maps import CUTOFF
from ..lighting.shared_visibility import programs_of
from ..lighting.soft_maps import (
    CONTACTS,
    LIMIT_CONSTANTS,
    LIMIT_TEXTURES,
    REFINE,
    SPARSE,
    SoftMaps,
    few_samples,
    soft_lookup,
    with_contacts,
)
from ..lighting.visibility import RESOLUTION, Lookup, Maps

RULES = (
    ("BOUNDS", "Bounds", 0, "The nearest and farthest depths of a cell tell whether its moments hold"),
    ("MEAN", "Mean", 1, "The mean depth of a cell alone tells: faster, with light at some contacts"),
)
FINE, COARSE = 1, 2  # texels along each side of the blocks that a table has entries for
MOMENTS = {
    block: tables.TableSource(
        f"depth moments of blocks of {block}",
        '#include "vssm/moments.glsl"\n',
        textures=(("RGBA32F", "depth_maps"), *LIMIT_TEXTURES),
        constants=LIMIT_CONSTANTS,
        defines=(("TABLE_BLOCK", str(block)),),
        integer=True,
    )
    for block in (FINE, COARSE)
}


def _lookup(rule: str, cells: int, block: int) -> Lookup:
    return soft_lookup(
        f"variance soft shadows, {rule.lower()}, {cells} cells, blocks of {block}",
        "vssm/visibility.glsl",
        ("RGBA32UI", "depth_table"),
        defines=(
            ("CELLS", str(cells)), ("TABLE_BLOCK", str(block)), *((("MEAN_RULE", "1"),) if rule == "MEAN" else ()),
        ),
    )  # fmt: skip


DEFAULTS = tuple(_lookup(rule, 3, block) for rule, *_ in RULES for block in MOMENTS)
LOOKUPS = tuple(lighting(one, False) for lookup in DEFAULTS for one in (lookup, with_contacts(lookup)))
SHARED = programs_of(with_contacts(_lookup("BOUNDS", 3, COARSE)))
MOMENT_VALUES = tuple(tables.values_program(source) for source in MOMENTS.values())


class VarianceSoftShadows(SoftMaps):
    name = "vssm"
    label = "Variance soft shadow maps"
    fills = ("shadow",)
    params = (
        RESOLUTION,
        CUTOFF,
        Param("cells", "Cells", 3, "Cells along each side of the kernel in which blockers are looked for", 2, 8),
        Param(
            "rule", "Rule", "BOUNDS", "What tells whether the moments of a cell can be trusted", items=RULES,
        ),
        REFINE,
        CONTACTS,
        SPARSE,
    )  # fmt: skip

    def filtered(self, frame: Frame, maps: Maps, size: tuple[int, int], drawn: bool) -> Maps:
        block = _block(frame)
        table = self.kept("table", (size[0] // block, size[1] // block), "RGBA32UI")
        if drawn:
            bound = {"depth_maps": maps.atlas, **maps.textures}
            tables.build_table(MOMENTS[block], table, textures=bound, constants=maps.constants)
        return replace(maps, textures={**maps.textures, "depth_table": table})

    def lookup(self, frame: Frame) -> Lookup:
        return _lookup(frame.settings.get(self, "rule"), frame.settings.get(self, "cells"), _block(frame))


def _block(frame: Frame) -> int:
    """Pictures of few samples take a quarter of the table; those of many, which show parts of lights, have kernels of a
    few texels, whose edges blocks would blur."""
    return COARSE if few_samples(frame) else FINE
