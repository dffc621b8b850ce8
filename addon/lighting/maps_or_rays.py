"""The choice between depth maps and a ray per pixel for the points of a light, by cost.

A map costs its triangles, texels and calls, a ray the hierarchy's levels on its way, and each pixel needs one:

    maps = triangles drawn x triangle + texels x texel + views x view
    rays = pixels x log2(triangles) x ray_level x (1 + REPEATED x repeats)

with the nanoseconds of this device (gfx/device.py). On two threads of llvmpipe at 256x192 pixels (whole renders of 16
samples of direct light) a ray took 60 ns in rooms and 200 in a town of 100,000 triangles, which the levels follow.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..frame.picture import Frame
from ..gfx import device
from ..gfx.device import milliseconds
from .depth_maps import MapView

REPEATED = 0.15  # share of the pixels in which light is asked again for another point of the film, as rays cost there


@dataclass(frozen=True)
class Compared:
    """Nanoseconds of a sample's visibility of one point of a light, either way."""

    rays: float
    maps: float

    @property
    def by_rays(self) -> bool:
        return self.rays < self.maps

    @property
    def name(self) -> str:
        """Of what costs less."""
        return "rays" if self.by_rays else "maps"

    @property
    def why(self) -> str:
        """For the ledger and the terminal."""
        chosen, other = (self.rays, self.maps) if self.by_rays else (self.maps, self.rays)
        return f"{self.name}, because {milliseconds(chosen)} against {milliseconds(other)} here"


def rays_ns(pixels: int, triangles: int, repeats: int = 0) -> float:
    """Of a ray of each pixel. `repeats`: so many times light is asked again at edges (lighting/repeated_light.py)."""
    ray = device.current().ray_level * float(np.log2(triangles + 2)) * (1.0 + REPEATED * repeats)
    return ray * pixels


def maps_ns(drawn: float, texels: float, views: int) -> float:
    """Of depth maps: `drawn` triangles over all views."""
    costs = device.current()
    return costs.triangle * drawn + costs.texel * texels + costs.view * views


def compared(frame: Frame, views: list[MapView], resolution: int, repeats: int) -> Compared:
    """A ray of each pixel beside these views of a light, drawn with `resolution`."""
    boxes, triangles = frame.geometry.caster_boxes, frame.geometry.caster_triangles
    drawn = sum(float(triangles[boxes.seen(view.rows, view.least_q)].sum()) for view in views)
    texels = sum((resolution // view.scale) ** 2 for view in views)
    width, height = frame.size
    rays = rays_ns(width * height, frame.geometry.triangles, repeats)
    return Compared(rays, maps_ns(drawn, texels, len(views)))
