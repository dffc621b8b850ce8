"""Clustered visibility: all virtual lights shine, some tens of clusters of them cast soft shadows, rays correct those.

    irradiance = sum over clusters m of  V_m U_m   +   sum over groups of them of  (D / D_m) (v_i u_i / p_i - V_m U_m)
    U_m = sum of u_i,  u_i = L_i G_i s(d_i),  over members i of m

Members are virtual lights (virtual_lights.py); their kernels G, their bound s near surfaces, the short rays that give
back what the bound takes, and gathering by regions are those of multires_radiosity.py. What differs is visibility. Each
cluster (addon/sources/clusters.py: k-means over place and normal) has one map of what it sees from its middle, and is
an area light with its members' extent in it: V_m. That alone is the source's method: smooth, but what only some members
of a cluster see, through the gap of a door, all of them light or none.

So the clusters are a guess, a control variate. They are split into `rays` groups; in each, one cluster m is drawn in
proportion to its doubt D_m = |U_m| sqrt(V_m (1 - V_m)), at least a tenth of |U_m| (D: the group's sum), one member i by
the chance p_i = |u_i| / |U_m|, and a ray finds v_i, whether that is seen. In the mean the guess cancels: the estimate
is that of tracing every virtual light, whatever the maps show, and its noise is that of what the maps do not know. An
eighth of the rays that multires_radiosity traces gives its error (below).

The map is a paraboloid's, in the stereographic projection: conformal, one map per half space and a little more. It is
traced, not rasterised: rays hit walls of two triangles exactly, whose straight edges a paraboloid bends, and the cost
does not grow with M draws of the scene. A receiver at distance d sees a cluster with half sides e past blockers at
distance z through the kernel e' (1/z - 1/d), e' being e across the line of sight, taken into the map by the
projection's derivative. First the mean z of blockers in the kernel of those half-way, then the share that is blocked in
the kernel of that z:

- texels: 4 x 4 texels of the kernel, each compared with the receiver's plane and, the other way, the caster's plane
  with the receiver, so that no bias in metres is needed and walls close;
- convolution: the series of cssm.py over 2 x 2 boxes of the prefiltered map, as in the source. It leaks where blockers
  stand nearer to the receiver than 6 % of the map's range, and costs twice as much.

With more samples each stands for smaller parts of the clusters: a map is drawn from a member, chosen by its strength,
and the extent shrinks by sqrt(n). Without `refine`, clusters and maps of the first sample stand, and later virtual
lights join the nearest cluster. Maps are kept, too, over frames in which neither clusters nor geometry change.

Source: Dong, Grosch, Ritschel, Kautz, Seidel, "Real-time indirect illumination with clustered visibility", VMV 2009.
Ours: traced maps, exact comparison of planes, the kernel's shape, correction by rays, bounces, refinement, regions.

| cost | per sample, N virtual lights, M clusters, maps of S x S |
|---|---|
| maps | M S^2 rays, 16 bytes per texel; convolution: + 4 (order + 1) bytes per texel, log2 S dispatches |
| per region | N kernels, M lookups of 16 to 32 texels (convolution: 4 boxes of 200 fetches with order 8), `rays` rays |
| rays per pixel, virtual lights | as multires_radiosity.py |

Fails: the guess is poor, and so rays leave grain, where the members of a cluster see different things, and for blockers
narrower than a texel of the map (3 degrees with 64 texels).

Bias, in diffuse indirect light: that of multires_radiosity.py. Sums that rays take below zero are cut there, unless a
lamp has negative power: + 0.8 % in the hall, + 1.9 % beyond the door. Without rays, besides: within a cluster light and
visibility are taken as independent. Against tracing the same virtual lights, one sample, RMS over the mean: in the
Cornell box 7 % with 64 clusters (11 % with 8, 24 % with 2; unshadowed 25 %), mean + 0.7 %, with 8 rays - 0.8 %; beyond
a door ajar, mean + 16 % without rays, - 0.1 % with 8.

Measured at 96x72 against Cycles' diffuse indirect pass, 16 bounces: relMSE over the reference's noise of one sample
(mean of six seeds, filtered) and of 64 (denoised); processor time over that of instant radiosity with 128 virtual
lights and 4 rays; -: not measured in this way.

| | Cornell box | courtyard | lamp | hall | door | window |
|---|---|---|---|---|---|---|
| instant radiosity, 1 sample | 0.071 | 0.037 | 0.025 | 0.063 | 0.115 | 0.095 |
| multires radiosity, 1 sample | 0.049 | 0.037 | 0.016 | 0.050 | 0.071 | 0.079 |
| this, 1 sample | 0.050 | 0.037 | 0.017 | 0.050 | 0.067 | 0.079 |
| its bias | 0.995 | 1.056 | 0.987 | 0.925 | 0.955 | 0.915 |
| instant radiosity with 4 rays, 64 samples | 0.0027 | - | - | 0.0113 | 0.0149 | 0.0149 |
| instant radiosity, 64 samples | - | - | - | 0.0103 | 0.0120 | 0.0197 |
| multires radiosity, 64 samples | - | - | - | 0.0060 | 0.0081 | 0.0086 |
| this, 64 samples | 0.0016 | - | - | 0.0083 | 0.0217 | - |
| time at 256x192, 4 samples | 1.3 | - | - | 1.8 | - | - |
| multires radiosity's | 2.2 | - | - | 3.6 | - | - |

The biases of one sample are those of its set of virtual lights: light that few probes meet. Beyond the door the cut of
negative sums shows at 64 samples (bias 1.012). While camera and light move slowly in the Cornell box, 0.073 of a
frame's error of 0.152 is new (instant radiosity: 0.132 of 0.230; both before what reflects was drawn at several points
of a pixel).

At 160x120 the time is 1.7 to 2.4 times that of instant radiosity, since the maps cost the same, and at 640x360 0.9
(Cornell box) and 1.2 (hall). Auto takes this technique for pictures of one sample from 60 000 pixels on, where the
error falls by more than the time rises in all scenes but the window (smaller ones: multires_radiosity.py, which has the
same error in less time there). With more samples it takes instant radiosity: the
same time spent on more of its samples leaves less error than multires radiosity in the hall and than this beyond the
door and in the hall; multires radiosity is the one that has less per sample.
"""

from __future__ import annotations

import weakref
from dataclasses import replace
from functools import cache

import numpy as np

from ..frame.run import Frame
from ..frame.settings import Settings
from ..frame.technique import Param
from ..gfx import images, passes
from ..kernels.convolution import PYRAMID, Basis, series
from ..kernels.tables import level_program
from ..lighting.soft_maps import REFINE
from ..lighting.virtual_lights import PATH_BLOCKS, PATH_CONSTANTS, PATH_TEXTURES, BoundGather, Gather, VirtualLightSet
from ..snapshot.scene import Snapshot
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
        Param(
            "virtual_lights", "Virtual lights", 1024, "Points of surfaces that light the picture in a sample", 1, 2048,
            draft=128,
        ),
        Param(
            "clusters", "Clusters", 64, "Groups of virtual lights that share a shadow map, at most", 1, 256, draft=16
        ),
        Param("map_size", "Map size", 64, "Texels along each side of a shadow map", 8, 256, draft=32),
        Param("shadows", "Shadows", TEXELS, "How the share of a kernel that is blocked is found", items=FILTERS),
        Param("order", "Order", "8", "Terms of the series that compares depths, for convolution", items=ORDERS),
        Param("rays", "Rays", 8, "Rays of a region that correct the clusters in a sample; 0: none", 0, 64, draft=4),
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

    def visibility(self, frame: Frame, found: VirtualLightSet) -> BoundGather:
        side, filtered = frame.settings.get(self, "map_size"), frame.settings.get(self, "shadows") == CONVOLUTION
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
        varies = any(compiled.transparent for compiled in frame.materials.compiled)  # alpha is met by lot
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
            part = (frame.settings.samples if frame.settings.whole else frame.sample + 1) ** -0.5
            if part < 1.0:
                middle = _drawn_middles(members(groups.label, len(groups)), weight, frame.random("clusters")[0])
        areas = np.zeros((len(groups), AREA_ROWS, 4))
        areas[:, 0, :3] = points[middle]
        corners = frame.receivers.corners.reshape(-1, 3)
        for area in areas:
            area[0, 3] = np.linalg.norm(corners - area[0, :3], axis=1).max()
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
