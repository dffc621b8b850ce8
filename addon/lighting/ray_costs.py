"""What tells a picture which points of a light it sees at less cost: depth maps, or a ray of each pixel.

A map costs its triangles, texels and calls, a ray the hierarchy's nodes on its way, and each pixel needs one.
Nanoseconds by which the two are compared, as measured with two threads of llvmpipe at 256x192 pixels (whole renders of
16 samples of direct light, by maps and by rays): a triangle 110 to 160, a texel 20, a view .8 ms (Python's thread and
the driver's calls), a ray 60 in rooms and 200 in a town of 100,000 triangles. On GPUs only the order is known, from
what others publish: a triangle .2 to .5, a texel .02, a ray 1 to 3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..frame.run import Frame
from ..gfx import context
from .depth_maps import MapView


@dataclass(frozen=True)
class Costs:
    """Nanoseconds."""

    triangle: float
    texel: float
    view: float
    level: float  # of the hierarchy, which doubles the triangles, for a ray


IN_SOFTWARE, ON_GPU = Costs(130.0, 20.0, 8e5, 8.0), Costs(0.3, 0.02, 5e3, 0.15)
REPEATED = 0.15  # share of the pixels in which light is asked again for another point of the film, as rays cost there


def rays_cost_less(frame: Frame, views: list[MapView], resolution: int, repeats: int) -> bool:
    """Whether a ray of each pixel costs less than these views of a light, drawn with `resolution`. `repeats`: so many
    times their light is asked again at edges (lighting/repeated_light.py)."""
    costs = IN_SOFTWARE if context.draws_slowly() else ON_GPU
    boxes, triangles = frame.geometry.caster_boxes, frame.geometry.caster_triangles
    drawn = sum(float(triangles[boxes.seen(view.rows, view.least_q)].sum()) for view in views)
    texels = sum((resolution // view.scale) ** 2 for view in views)
    width, height = frame.size
    ray = costs.level * float(np.log2(frame.geometry.triangles + 2)) * (1.0 + REPEATED * repeats)
    return ray * width * height < costs.triangle * drawn + costs.texel * texels + costs.view * len(views)
