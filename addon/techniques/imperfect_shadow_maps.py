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

import numpy as np

from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.technique import Param
from ..lighting.imperfect_maps import MAP_CONSTANTS, SmallMaps
from ..lighting.virtual_lights import BoundGather, Gather, VirtualLightSet
from ..scene import acceleration
from ..snapshot.scene import Snapshot
from .multires_radiosity import LEVELS, NEAR_BOUNCES, MultiresRadiosity, regions

MAPS = Gather(
    "imperfect shadow maps", "ism/gather.glsl", (("FLOAT_2D", "virtual_maps"),), (*MAP_CONSTANTS, ("INT", "rays"))
)
REGIONS = regions(MAPS)


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
        self.maps = SmallMaps()

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
        maps, constants = self.maps.draw(frame, self, lights.image, self._power_of_two(frame, "map_size"))
        return BoundGather(MAPS, {"virtual_maps": maps}, {**constants, "rays": frame.settings.get(self, "rays")})

    def release(self) -> None:
        super().release()
        self.maps.release()
