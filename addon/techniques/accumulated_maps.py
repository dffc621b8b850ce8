"""Accumulated hard shadow maps: in each sample one point on each light, and one depth map seen from it.

A single map gives the exact hard shadow of one point of the light; the mean over the points is the exact soft shadow.
It converges to the truth for any light shape and any caster, so all other shadow techniques are measured against it.
The points form a low-discrepancy set over the light: the error of a penumbra falls nearly like 1/n.

Maps are fitted to what the camera sees (addon/lighting/depth_maps.py) and compared, without a bias in metres, by planes
stored per texel (shaders/lib/shadow.glsl). Casters with alpha are drawn stochastically, texel by texel. Edge rays
(shaders/lib/edge_visibility.glsl; Lauterbach, Mo, Manocha 2009) settle pixels whose four texels disagree, which removes
the map's resolution from sharp edges and contacts. Where a ray of each pixel costs less than the maps of a light, of
the world's directions or of points on emissive surfaces, rays replace maps (addon/lighting/maps_or_rays.py): the same
points of the light, without texels.

| cost | per sample |
|---|---|
| maps | 1 view per light whose receivers lie within 68 degrees, up to 6 faces otherwise; more where depth asks for it |
| vertices | those of all casters, once per view |
| lookup per pixel and light | 1 texel of the map, 3 to 5 of the view list; with edge rays 4 texels |
| edge rays | 1 per pixel and light where the four texels disagree and the penumbra is narrower than 4 texels |
| bytes | 20 per texel, (2 texels per picture pixel)^2 by default; 4 where light passes casters, from 64 samples on |

Bias: lights that bring less than `cutoff` of the picture's median light are left unshadowed. On soft-edged point and
spot lights the map starts in the ball while light arrives from the disc that faces the receiver, as in Cycles: an error
of the order of (radius / distance)^2 (above 1/16 direct_light traces rays). Under edge rays, casters f < 1/2 texels
wide have shadows 2 f^2 wide.

Fails: few samples show steps in penumbrae; casters thinner than a texel are missed in single samples; a receiver in no
fitted view counts as lit. With rays, smooth-shaded facets shadow themselves, as in Cycles. Figures of rays and edge
rays: docs/log/2026-11-26-soft-shadows.md.
"""

from __future__ import annotations

from ..frame.picture import Frame
from ..frame.settings import Settings
from ..gfx.library import Program
from ..lighting.imperfect_maps import ImperfectMaps, by_points, programs_by_points
from ..lighting.point_maps import CUTOFF, EDGE_RAYS, PointMaps
from ..lighting.visibility import RESOLUTION, SHADOWS_BY, VisibilityProvider
from ..snapshot.scene import Snapshot
from ..sources import lights


class AccumulatedMaps(PointMaps):
    name = "accumulated_maps"
    label = "Accumulated shadow maps"
    params = (RESOLUTION, CUTOFF, EDGE_RAYS, SHADOWS_BY)

    def __init__(self):
        super().__init__()
        self._imperfect = ImperfectMaps()
        self._by_points: frozenset[str] = frozenset()  # keys of wide lights that have small maps from points

    def programs(self, snapshot: Snapshot, settings: Settings) -> tuple[Program, ...]:
        return programs_by_points(settings)

    def begin(self, frame: Frame) -> None:
        super().begin(frame)
        seen = frame.receivers is not None and len(frame.receivers.distance) > 0
        served = frame.emitters if seen and by_points(frame, self) else ()
        self._by_points = frozenset(one.light.key for one in served if self._imperfect.serves(frame, self, one))
        if self._by_points:
            self._imperfect.begin(frame, self)

    def serving(self, emitter: lights.Emitter) -> VisibilityProvider:
        return self._imperfect if emitter.light.key in self._by_points else self

    def release(self) -> None:
        super().release()
        self._imperfect.release()
