"""Variance soft shadow maps: one depth map serves all of a light, or the part of it that a sample stands for.

A blocker at height h (in the map's depth measure q) above a receiver hides those points of the light that lie in a box
(a disc) of half extents e h around the receiver in the map (shaders/lib/soft_kernel.glsl). First the mean height of the
blockers in the largest kernel that matters is found, then the share f of blockers in the kernel of that height:

    f = mean(h)^2 / mean(h^2),   h = mean(h^2) / mean(h)

Both means come from a summed-area table of q, q^2, q x and q y, so that heights above a tilted plane are exact. A
min-max pyramid classifies cells (`rule` BOUNDS): all above the receiver, all lit, or nothing far behind it, where the
moments hold; in other cells some texels are read. `rule` MEAN is the source's: moments wherever the mean is above.

With n samples each map stands for 1 / n of the light: the kernel's extents shrink by sqrt(n), and the error goes to
zero as that of accumulated maps. With one sample the map's point is the middle of the light or of each of 2^k parts,
and the unblocked light has a closed form (shaders/light/whole.glsl).

| cost | per map of N x N texels |
|---|---|
| pyramid | a pass and log2 N - 1 dispatches; 4 bytes per texel |
| table | 4 log8 N - 1 passes (log8 N rounded up) over blocks of 2 x 2 texels, from 16 samples on over texels |
| lookup | lit or all blocked: up to 27 loads; penumbra: 64 loads of 16 bytes, 225 of 8, 8 more per mixed cell |
| contact rays | 4 or 8 per unsettled pixel and map; from 16 samples on 1 |
| bytes | 8 per texel and 4 borrowed, beside the map's 20; from 16 samples on 20 and 16 |

Bias (direct diffuse and glossy light; to zero with samples): several heights are flattened to their mean; blockers that
the light's middle does not see, beyond the reach of contact rays, are missed; all parts of the light count the same,
and parts below the receiver's horizon not at all. Fails: blockers so close to a wide light that the kernel exceeds the
view (half of the light is lost at one sample). Errors and times: docs/soft_shadows.md.

Source: Yang, Dong, Feng, Seidel, Kautz, "Variance soft shadow mapping", Computer Graphics Forum 29(7), 2010.
"""

from __future__ import annotations

from dataclasses import replace

from ..frame.picture import Frame
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
        Param("cells", "Cells", 3, "Cells along each side of the blocker search kernel", 2, 8),
        Param(
            "rule", "Rule", "BOUNDS",
            "How to decide whether the depth moments of a cell are reliable: by its depth bounds, or by its mean "
            "depth alone",
            items=RULES,
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
