"""Clustered visibility: virtual lights shine one by one, clusters of them cast soft shadows, and rays correct those.

    irradiance = sum over clusters m of  V_m U_m   +   sum over groups of them of  (D / D_m) (v_i u_i / p_i - V_m U_m)
    U_m = sum of u_i,  u_i = L_i G_i s(d_i),  over members i of m

Virtual lights, kernels G, the bound s near surfaces with its short rays, and regions are those of
multires_radiosity.py. Each cluster (addon/sources/clusters.py: k-means over place and normal) has one map seen from its
middle and is an area light of its members' extent: V_m, the source's method. V_m is used as a control variate: clusters
form `rays` groups; in each, one cluster is drawn in proportion to D_m = |U_m| sqrt(V_m (1 - V_m)), at least a tenth of
|U_m| (D: the group's sum), one member by p_i = |u_i| / |U_m|, and a ray finds its visibility v_i. The mean is that of
tracing every virtual light; the noise is that of what the maps do not know.

Maps are traced stereographic half spaces. Blockers at distance z from a cluster with half extents e shadow a receiver
at distance d by the kernel e (1/z - 1/d): first the mean z, then the share blocked, by 4 x 4 texels compared by planes,
or by the Fourier series of cssm.py, as in the source. With n samples the extent shrinks by sqrt(n), where `refine` is
on.

| cost | per sample, N virtual lights, M clusters, maps of S x S |
|---|---|
| maps | M S^2 rays, 16 bytes per texel; convolution: + 4 (order + 1) bytes per texel, log2 S dispatches |
| per region | N kernels, M lookups of 16 to 32 texels (convolution: 4 boxes of 200 fetches with order 8), `rays` rays |
| else | as multires_radiosity.py |

Bias (diffuse indirect light): that of multires_radiosity.py; sums that rays take below zero are cut there (up to + 2
%). Without rays, light and visibility are taken as independent within a cluster, so gaps of doors leak.
With volumes, "Convolution" is "Texels".
Fails: grain where members of a cluster see different things and for blockers narrower than a texel (3 degrees with 64).

Auto takes it for pictures of one sample from 60 000 pixels on. Figures: docs/log/2026-11-26-indirect-light.md. Source:
Dong, Grosch, Ritschel, Kautz, Seidel, "Real-time indirect illumination with clustered visibility", VMV 2009.
"""

from __future__ import annotations

import weakref
from dataclasses import replace
from functools import cache

import numpy as np

from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.technique import Param
from ..gfx import images, passes
from ..kernels.convolution import PYRAMID, Basis, series
from ..kernels.tables import level_program
from ..lighting.media import MediaService
from ..lighting.soft_maps import REFINE
from ..lighting.virtual_lights import PATH_BLOCKS, PATH_CONSTANTS, PATH_TEXTURES, BoundGather, Gather, VirtualLightSet
from ..snapshot.scene import Note, Snapshot
from ..sources import lights
from ..sources.clusters import Clusters, cluster, members
from .cssm import ORDERS, SEARCH_OFFSET
from .multires_radiosity import LEVELS, MANY_PIXELS, NEAR_BOUNCES, MultiresRadiosity, pixels_shown_alone, regions

TEXELS, CONVOLUTION = "TEXELS", "CONVOLUTION"
FILTERS = (
    (TEXELS, "Texels", 0, "Compare the depths of some texels of the kernel one by one"),
    (CONVOLUTION, "Convolution", 1, "Look up a filtered map, whose cost does not depend on the kernel's size"),
)
TAPS, CELLS = 4, 2  # along each side of a kernel: texels that are looked at; boxes of the filtered map
AREA_ROWS = 5  # texels of a cluster, see shaders/cluster/lights.glsl
MAPS = passes.fullscreen_program(
    "maps of clusters",
    "cluster/map.frag.glsl",
    textures=(("RGBA32F", "virtual_lights"), *PATH_TEXTURES),
    blocks=PATH_BLOCKS,
    constants=(*PATH_CONSTANTS, ("INT", "cluster_count"), ("INT", "map_side"), ("INT", "map_columns")),
    outputs=(("VEC4", "out_seen"),),
)
BY_TEXELS = Gather(
    "clusters, texels",
    "cluster/gather.glsl",
    textures=(("FLOAT_2D", "cluster_maps"),),
    constants=(("INT", "cluster_count"), ("INT", "map_side"), ("INT", "rays")),
    defines=(("TAPS", str(TAPS)),),
)


def _basis(order: int) -> Basis:
    return Basis(
        f"maps of clusters, order {order}", '#include "cluster/basis.glsl"\n', order, PYRAMID,
        textures=(("FLOAT_2D", "cluster_maps"),),
    )  # fmt: skip


@cache
def _by_means(order: int) -> Gather:
    scale, offset = series(order)
    return replace(
        BY_TEXELS,
        name=f"clusters, order {order}",
        textures=(*BY_TEXELS.textures, ("RGBA16F", "basis_means")),
        constants=(
            *BY_TEXELS.constants, ("IVEC2", "base_extent"), ("INT", "tile_columns"), ("INT", "basis_rows"),
            ("INT", "top_level"),
        ),
        defines=(
            ("FILTER_MEANS", "1"), ("ORDER", str(order)), ("CELLS", str(CELLS)), ("SERIES_SCALE", f"{scale:.6f}"),
            ("SERIES_OFFSET", f"{offset:.6f}"), ("SEARCH_OFFSET", f"{SEARCH_OFFSET / order:.6f}"),
        ),
    )  # fmt: skip


PROGRAMS = (regions(BY_TEXELS), regions(_by_means(8)), level_program(_basis(8).source))


class ClusteredVisibility(MultiresRadiosity):
    name = "clustered_visibility"
    label = "Clustered visibility"
    params = (
        Param("virtual_lights", "Virtual lights", 1024, "Virtual lights in each sample", 1, 2048, draft=128),
        Param(
            "clusters", "Clusters", 64,
            "Maximum number of clusters of virtual lights; each has one shadow map",
            1, 256, draft=16,
        ),
        Param("map_size", "Map size", 64, "Texels along each side of a shadow map", 8, 256, draft=32),
        Param("shadows", "Shadows", TEXELS, "How the blocked share of a filter kernel is found", items=FILTERS),
        Param(
            "order", "Order", "8",
            "Terms of the Fourier series that approximates the depth comparison, for convolution",
            items=ORDERS,
        ),
        Param(
            "rays", "Rays", 8,
            "Rays per region and sample that correct the clusters' shadows; 0: none",
            0, 64, draft=4,
        ),
        REFINE,
        LEVELS,
        NEAR_BOUNCES,
    )  # fmt: skip

    def __init__(self):
        super().__init__()
        self._kept: dict[str, images.Image] = {}
        self._drawn: tuple[weakref.ref, tuple] | None = None
        self._built = 0  # order of the means of what the maps hold; 0: none
        self._standing: tuple[Clusters, np.ndarray] | None = None  # of this frame's last sample that made clusters

    def claims(self, snapshot: Snapshot, settings: Settings) -> bool:
        return pixels_shown_alone(snapshot, settings) >= MANY_PIXELS

    def begin(self, frame: Frame) -> None:
        super().begin(frame)
        self._standing = None
        if frame.settings.get(self, "shadows") == CONVOLUTION and frame.service(MediaService) is not None:
            text = "its shadows are looked up texel by texel: convolution is not made for scenes with volumes."
            frame.ledger.notes = (*frame.ledger.notes, Note(self.label, text))

    def visibility(self, frame: Frame, found: VirtualLightSet) -> BoundGather:
        # Maps of means and media are more images together than a program may have.
        filtered = frame.settings.get(self, "shadows") == CONVOLUTION and frame.service(MediaService) is None
        side = frame.settings.get(self, "map_size")
        if filtered:
            side = 1 << round(np.log2(side))
        label, areas = self._areas(frame, found)
        count = len(areas)
        columns = max(int(np.ceil(np.sqrt(count))), 1)
        extent = columns * side, max(-(-count // columns), 1) * side
        areas[:, 4, 0], areas[:, 4, 1] = np.arange(count) % columns * side, np.arange(count) // columns * side
        lights_image = images.upload_varying(_packed(found, label, areas))
        maps = self._image("maps", extent, "RGBA32F")
        self._draw(frame, lights_image, maps, areas, side, columns)
        bound = BoundGather(
            BY_TEXELS, {"virtual_lights": lights_image, "cluster_maps": maps},
            {"cluster_count": count, "map_side": side, "rays": frame.settings.get(self, "rays")},
        )  # fmt: skip
        return self._filtered(frame, bound, extent) if filtered else bound

    def _draw(self, frame: Frame, lights_image, maps, areas: np.ndarray, side: int, columns: int) -> None:
        """Trace the maps, unless they hold these clusters among this geometry."""
        count, hierarchy = len(areas), frame.hierarchy("diffuse")
        key = areas.tobytes(), side
        varies = any(compiled.transparent for compiled in frame.materials.compiled)  # alpha is met at random
        if not varies and self._drawn is not None and self._drawn[0]() is hierarchy and self._drawn[1] == key:
            frame.count(self, "maps kept", count)
            return
        self._drawn, self._built = (weakref.ref(hierarchy), key), 0
        bindings = self.virtual_lights.path_bindings(frame)
        bindings["textures"]["virtual_lights"] = lights_image
        bindings["constants"] |= {"cluster_count": count, "map_side": side, "map_columns": columns}
        passes.fullscreen(MAPS, images.Target((maps,)), **bindings)
        frame.count(self, "maps", count)
        frame.count(self, "map rays", count * side * side)

    def _filtered(self, frame: Frame, bound: BoundGather, extent: tuple[int, int]) -> BoundGather:
        """The same with means of the basis functions of what the maps hold."""
        order = int(frame.settings.get(self, "order"))
        basis = _basis(order)
        means = self._image("means", *basis.image(*extent))
        levels = int(np.log2(bound.constants["map_side"]))
        if self._built != order:
            basis.build(means, extent, levels, {"cluster_maps": bound.textures["cluster_maps"]}, {})
            self._built = order
        return BoundGather(
            _by_means(order),
            {**bound.textures, "basis_means": means},
            {**bound.constants, **basis.constants_for(*extent), "top_level": levels},
        )

    def _areas(self, frame: Frame, found: VirtualLightSet) -> tuple[np.ndarray, np.ndarray]:
        """Cluster of each virtual light, (N,), and the clusters' rows for the shaders, (K, AREA_ROWS, 4), without
        members and place in the atlas."""
        points, normals, sent = (row[:, :3] for row in found.rows)
        if not len(points):
            return np.zeros(0, int), np.zeros((0, AREA_ROWS, 4))
        refine = frame.settings.get(self, "refine")
        if not refine and self._standing is not None:
            groups, areas = self._standing
            return groups.nearest(points, normals), areas
        weight = np.abs(sent) @ lights.LUMINANCE
        groups = cluster(points, normals, weight, frame.settings.get(self, "clusters"))
        frame.count(self, "clusters", len(groups))
        middle, part = groups.middle, 1.0
        if refine:
            part = (frame.settings.samples if frame.settings.schedule.known_total else frame.sample + 1) ** -0.5
            if part < 1.0:
                middle = _drawn_middles(members(groups.label, len(groups)), weight, frame.random("clusters")[0])
        areas = np.zeros((len(groups), AREA_ROWS, 4))
        areas[:, 0, :3] = points[middle]
        corners = frame.receivers.corners.reshape(-1, 3)
        farthest = ((corners - areas[:, None, 0, :3]) ** 2).sum(axis=2).max(axis=1)
        areas[:, 0, 3] = np.sqrt(farthest)
        areas[:, 1, :3], areas[:, 1, 3] = groups.across, part * groups.half[:, 0]
        areas[:, 2, :3], areas[:, 2, 3] = np.cross(groups.normal, groups.across), part * groups.half[:, 1]
        areas[:, 3, :3] = normals[middle]
        self._standing = groups, areas
        return groups.label, areas

    def _image(self, name: str, size: tuple[int, int], image_format: str) -> images.Image:
        image = self._kept.get(name)
        if image is None or image.size != size or image.format != image_format:
            if image is not None:
                images.pool.give(image)
            image = self._kept[name] = images.pool.take(*size, image_format)
            if name == "maps":
                self._drawn = None
            else:
                self._built = 0
        return image

    def release(self) -> None:
        super().release()
        for image in self._kept.values():
            images.pool.give(image)
        self._kept.clear()
        self._drawn = self._standing = None


def _packed(found: VirtualLightSet, label: np.ndarray, areas: np.ndarray) -> np.ndarray:
    """Virtual lights in the order of their clusters, and the clusters below them, (3 + AREA_ROWS, columns, 4)."""
    packed = np.zeros((3 + AREA_ROWS, max(len(found), len(areas)), 4))
    order = np.argsort(label, kind="stable")
    packed[:3, : len(order)] = found.rows[:, order]
    counts = np.bincount(label, minlength=len(areas))
    packed[3:, : len(areas)] = areas.transpose(1, 0, 2)
    packed[6, : len(areas), 3] = np.cumsum(counts) - counts
    packed[7, : len(areas), 2] = counts
    return packed


def _drawn_middles(groups: list[np.ndarray], weight: np.ndarray, u: float) -> np.ndarray:
    """A member of each cluster, drawn in proportion to weight."""
    passed = [np.cumsum(weight[own]) for own in groups]
    return np.array([own[np.searchsorted(sums, u * sums[-1], side="right")] for own, sums in zip(groups, passed)])
