"""Convolution soft shadow maps: blocker search and penumbra as filters of one depth map that was prefiltered.

The comparison of depths becomes a Fourier series whose terms can be averaged beforehand (addon/kernels/convolution.py).
The blocker search asks it for the share of nearer texels and their mean depth,

    z_avg = [W * f z] / [W * f],   f(d, z) = 1 where z < d,

the second step for the share of blockers in the kernel that this depth gives. Both cost the same whatever the size of
the kernel: for pictures with many lights. A single important light is better served by vssm, whose comparison has no
least distance.

Beyond the source, the kernel is cut into `cells` squared boxes, each compared with the receiver's plane at its place,
so that tilted receivers do not shadow themselves; kernels of a few texels read texels, so contacts close without the
source's sharpening; a min-max pyramid settles most pixels. All lights of a round share atlas and basis images.

| cost | per map of N x N texels, order M |
|---|---|
| basis, by table | passes as for one table (kernels/tables.py), 16 (M + 1) bytes per texel kept, as much borrowed |
| basis, by pyramid | log2 N dispatches, 4 (M + 1) bytes per texel |
| lookup | cells^2 boxes, each (M + 1) + M / 2 means: 4 fetches by table, 8 by pyramid |

Bias (direct diffuse and glossy light): that of vssm. Blockers nearer to the receiver than twice the series' offset (6.4
% of the depth range with order 4, 1.6 % with 16) block in part only where the kernel is wider than a few texels; this
goes to zero with order and samples. A box whose part of a steep receiver rises above a roof does not see the roof: up
to 11 % of the light passes it. Errors and times with every parameter: docs/soft_shadows.md.

Source: Annen, Dong, Mertens, Bekaert, Seidel, Kautz, "Real-time, all-frequency shadows in dynamic scenes", SIGGRAPH
2008.
"""

from __future__ import annotations

from dataclasses import replace

from ..frame.picture import Frame
from ..frame.technique import Param
from ..kernels import tables
from ..kernels.convolution import PYRAMID, TABLE, Basis, series
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
    soft_lookup,
    with_contacts,
)
from ..lighting.visibility import RESOLUTION, Lookup, Maps

ORDERS = (
    ("4", "4 Terms", 0, "Fast; shadows begin gradually behind what casts them"),
    ("8", "8 Terms", 1, "Shadows begin close behind what casts them"),
    ("16", "16 Terms", 2, "The sharpest contacts, for twice the memory of 8"),
)
PREFILTERS = (
    (PYRAMID, "Pyramid", 0, "Mip levels: fast, and a little blocky"),
    (TABLE, "Summed-Area Table", 1, "Exact means over boxes of any size; needs more memory"),
)
BASIS = {
    PYRAMID: ("RGBA16F", "basis_means"),
    TABLE: ("RGBA32UI", "basis_table"),
}
SEARCH_OFFSET = 0.42  # of the blocker search's tapered series, over its order: 0.105 with 4 terms


def _basis(order: int, prefilter: str) -> Basis:
    return Basis(
        f"convolution shadows, order {order}",
        '#include "cssm/basis.glsl"\n',
        order,
        prefilter,
        textures=(("RGBA32F", "depth_maps"), *LIMIT_TEXTURES),
        constants=LIMIT_CONSTANTS,
    )


def _lookup(order: int, prefilter: str, cells: int) -> Lookup:
    scale, offset = series(order)
    by_table = prefilter == TABLE
    return soft_lookup(
        f"convolution soft shadows, order {order}, {prefilter.lower()}, {cells} cells",
        "cssm/visibility.glsl",
        BASIS[prefilter],
        constants=(("IVEC2", "base_extent"), ("INT", "tile_columns"), ("INT", "basis_rows")),
        defines=(
            ("ORDER", str(order)), ("CELLS", str(cells)), ("SERIES_SCALE", f"{scale:.6f}"),
            ("SERIES_OFFSET", f"{offset:.6f}"), ("SEARCH_OFFSET", f"{SEARCH_OFFSET / order:.6f}"),
            *((("PREFILTER_TABLE", "1"),) if by_table else ()),
        ),
    )  # fmt: skip


DEFAULTS = tuple(_lookup(8, prefilter, 4) for prefilter, *_ in PREFILTERS)
LOOKUPS = tuple(lighting(one, False) for lookup in DEFAULTS for one in (lookup, with_contacts(lookup)))
SHARED = tuple(program for lookup in DEFAULTS for program in programs_of(with_contacts(lookup)))
BASIS_MEANS = tables.level_program(_basis(8, PYRAMID).source)
BASIS_VALUES = tables.values_program(_basis(8, TABLE).source)


class ConvolutionSoftShadows(SoftMaps):
    name = "cssm"
    label = "Convolution soft shadow maps"
    fills = ("shadow",)
    params = (
        RESOLUTION,
        CUTOFF,
        Param(
            "order", "Order", "8",
            "Terms of the Fourier series that approximates the depth comparison",
            items=ORDERS,
        ),
        Param("prefilter", "Prefilter", PYRAMID, "How averages over boxes of texels are precomputed", items=PREFILTERS),
        Param("cells", "Cells", 4, "Boxes along each side of the filter kernel", 1, 6),
        REFINE,
        CONTACTS,
        SPARSE,
    )  # fmt: skip

    def resolution(self, frame: Frame) -> int:
        """Half of what a plain map may have: basis images are several times as large."""
        return min(super().resolution(frame), 1024)

    def cells(self, frame: Frame) -> int:
        """Boxes along each side of a kernel."""
        return frame.settings.get(self, "cells")

    def filtered(self, frame: Frame, maps: Maps, size: tuple[int, int], drawn: bool) -> Maps:
        order, prefilter = int(frame.settings.get(self, "order")), frame.settings.get(self, "prefilter")
        basis = _basis(order, prefilter)
        image = self.kept("basis", *basis.image(*size))
        if drawn:
            bound = {"depth_maps": maps.atlas, **maps.textures}
            basis.build(image, size, maps.constants["top_level"], bound, maps.constants)
        return replace(
            maps,
            textures={**maps.textures, BASIS[prefilter][1]: image},
            constants={**maps.constants, **basis.constants_for(*size)},
        )

    def lookup(self, frame: Frame) -> Lookup:
        order, prefilter = int(frame.settings.get(self, "order")), frame.settings.get(self, "prefilter")
        return _lookup(order, prefilter, self.cells(frame))
