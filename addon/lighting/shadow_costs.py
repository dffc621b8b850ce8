"""Points of a light, soft maps or its edges in a picture of one sample: what has the least error times time.

Light probes measure the variance V that one point of a light leaves (relMSE of the light at the probes). Then

| kind | error that is left of the light | nanoseconds |
|---|---|---|
| n points | SHARED V / n^1.5 | n times the less of a ray of each pixel and a depth map |
| edges | SHARED V / 64^1.5 | of edges before pixels (edge_costs.py), and of finding silhouettes |
| soft map | SOFT V | of the map, its table and pyramid, a lookup and short rays of each pixel |

beside the error and time of everything else in the picture: outlines, whose share of the pixels falls with the
picture's side, what other lights leave, and what Python, surfaces and film take. So penumbrae of a pixel or two, beside
which the film errs more, are not worth a map, and the same penumbrae in a larger picture are.

Costs are the device's (gfx/device.py) in units of what it measures. The constants were read from whole renders of three
scenes at 64x48 to 256x192 pixels, and the film's error from the mean of fifteen: good for choices between factors, not
for forecasts. Indirect light adds to errors and times alike and is left out of both.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..gfx import device
from .edge_costs import edges_ns
from .light_rates import LightRates
from .maps_or_rays import Compared

FILM = 2.0  # relMSE that one sample leaves at outlines, times the picture's side in pixels
SHARED = 0.5  # of a light's variance that is left where filters reach over neighbouring pixels
SOFT = 0.04  # of a light's variance that filtered depths leave as bias
EDGE_POINTS = 64
PICTURE = 3e7  # ns that Python takes for a picture, whatever its size
PIXEL_LOADS = 1500  # texels' worth of a pixel's surfaces, film and light
TEXEL_LOADS, LOOKUP_LOADS, CONTACTS = 35, 500, 8  # of a soft map: of a texel, of a pixel; rays of a pixel
FIND = 2e3  # ns a triangle, to find silhouettes
POINTS, EDGES, MAPS = "points", "edges", "soft maps"


@dataclass(frozen=True)
class Foreseen:
    """relMSE of the whole picture and nanoseconds of it with one kind of shadow for a light."""

    error: float
    ns: float

    @property
    def product(self) -> float:
        return self.error * self.ns

    def __str__(self) -> str:
        return f"{self.error:.2g} x {self.ns / 1e6:.0f} ms"


@dataclass(frozen=True)
class Weighed:
    """What lights cost and leave in a picture of `size` pixels, as far as it is known before they are drawn."""

    size: tuple[int, int]
    rates: LightRates

    @property
    def pixels(self) -> int:
        return self.size[0] * self.size[1]

    def points(self, key: str, each: Compared) -> Foreseen:
        """`each`: a ray of each pixel beside maps."""
        count = self.rates.of_points[key].per_sample
        return self._foreseen(key, self._left(key), count * min(each.rays, each.maps))

    def edges(self, key: str, before_pixel: float, triangles: int) -> Foreseen:
        left = SHARED * self.rates.variance[key] * EDGE_POINTS**-1.5
        return self._foreseen(key, left, edges_ns(self.pixels, before_pixel) + FIND * triangles)

    def maps(self, key: str, each: Compared, texels: float) -> Foreseen:
        costs = device.current()
        drawn = each.maps + texels * TEXEL_LOADS * costs.load
        asked = self.pixels * LOOKUP_LOADS * costs.load + CONTACTS * each.rays
        return self._foreseen(key, SOFT * self.rates.variance[key], drawn + asked)

    def _foreseen(self, key: str, left: float, ns: float) -> Foreseen:
        others = sum(self._left(one) for one in self.rates.variance if one != key)
        film = FILM / max(sum(self.size) / 2, 1.0)
        rest = PICTURE + self.pixels * PIXEL_LOADS * device.current().load
        return Foreseen(film + others + left, rest + ns)

    def _left(self, key: str) -> float:
        """Error of a light by the points that it would have."""
        return SHARED * self.rates.variance[key] * self.rates.of_points[key].per_sample ** -1.5
