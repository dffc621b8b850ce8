"""Accumulated hard shadow maps: each sample, one point on each light and one depth map seen from it.

Every single map gives the exact hard shadow of one point of the light; the mean over the points is the exact soft
shadow. It converges to the truth for any light shape and any occluder, so all other shadow techniques are measured
against it. The points form a low-discrepancy set over the light, the error of a penumbra falls nearly like 1/n.

Maps are fitted to what the camera sees (addon/lighting/depth_maps.py) and compared without a bias in metres by planes
stored per texel (shaders/lib/shadow.glsl). Casters with alpha are drawn stochastically, texel by texel.

| cost | per sample |
|---|---|
| maps | 1 view per light whose receivers lie within 68 degrees, up to 6 faces otherwise; more where depth asks for it |
| vertices | those of all casters, once per view |
| lookup per pixel and light | 1 texel of the map, 3 to 5 of the view list; with edge rays 4 texels |
| edge rays | 1 per pixel and light where the four texels do not agree and the penumbra is narrower than 4 texels |
| bytes | 20 per texel, (2 texels per picture pixel)^2 by default; 4 where light passes casters, from 64 samples on |

Where a ray of each pixel costs less than the maps of a light, or of the world's directions, or of points on emissive
surfaces, rays take their place (addon/lighting/ray_costs.py): the same points of the light, without texels. Seconds and
relMSE of direct light, 256x192, 16 samples, llvmpipe, by maps and by rays: instances 2.95 .0214 and 2.16 .0212, garden
1.79 .0067 and 1.60 .0066, Cornell box .82 .0019 and .44 .0018, door 1.10 .0329 and .53 .0319, window 1.80 .0652 and
1.46 .0643; with all light, where points of the film at edges ask again, Cornell box 3.1 and 2.4, door 4.2 and 3.1,
garden and window alike.

Edge rays (shaders/lib/edge_visibility.glsl; Lauterbach, Mo, Manocha 2009) take the map's resolution out of sharp edges
and of contacts: without them a pixel just behind a blocker that it touches is lit at every resolution. relMSE of direct
light at 64 samples, before and after: fence 0.0152 and 0.0016, poles 0.0031 and 0.0005, foliage 0.077 and 0.023, grid
0.0058 and 0.0034 (128x96); garden 0.0017 and 0.0009, instances 0.0039 and 0.0032, hall 0.0055 and 0.0045 (256x192), in
1.35, 0.95 and 1.05 times the processor time.

Fails: with few samples penumbrae show steps; casters thinner than a texel are missed in single samples (their mean
is right but for edge rays); a receiver that no fitted view contains counts as lit. With rays faces that are shaded
smoothly but drawn flat have the shadow of their own edges, as in Cycles.

Bias: none for the diffuse path. On soft-edged point and spot lights the depth map is drawn from a point in the ball
while light arrives from its projection onto the disc that faces the receiver (as in Cycles): the difference is of
the order of (radius / distance)^2; where that is more than 1/16, direct_light traces rays. Where a light brings less
than `cutoff` of the picture's median light, it is left unshadowed: at most that share of light too much, for views and
casters that a picture with many lights need not draw. Under edge rays sharp shadows of casters narrower than half a
texel, f texels, are 2 f^2 instead of f wide: at most an eighth of a texel is missing.
"""

from __future__ import annotations

from ..lighting.point_maps import CUTOFF, EDGE_RAYS, PointMaps
from ..lighting.visibility import RESOLUTION, SHADOWS_BY


class AccumulatedMaps(PointMaps):
    name = "accumulated_maps"
    label = "Accumulated shadow maps"
    params = (RESOLUTION, CUTOFF, EDGE_RAYS, SHADOWS_BY)
