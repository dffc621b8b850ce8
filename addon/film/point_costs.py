"""How many points of the film share a sample's light, by what both cost on this device.

With K points a sample the error has a part that they lower, and one that the light has whatever they are:

    error x time = (L + E / K) (light + K point),    least at  K = sqrt(E / L  light / point)

E / L is SPREAD, the most that pictures of one sample showed (garden: relMSE .033 of one point and .015 of eight); with
more samples it falls as the points do that each is asked for, and so does K. The nanoseconds are those of a pixel, by
the device's figures (gfx/device.py):

    point = POINT_READS x read + triangles x triangle / pixels
    light = LIGHT_READS x read + RAYS x log2(triangles) x ray_level + DRAWS x triangles x triangle / pixels

Reads stand for all that a program does for a pixel; their numbers come from two threads of llvmpipe (Cornell box and
garden, one sample, with and without points). Within a factor of two of K the product hardly changes, so it is a power
of two. It is at most MOST, and at most what the artist asks for.

Fails: where few pixels show something, light that a technique draws in them alone is cheaper than this; and on a card
whose arithmetic costs more beside its reads light takes longer than it says.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..gfx import device
from ..gfx.device import milliseconds
from ..snapshot.scene import Snapshot

MOST = 8  # points of the film that share a sample's light
SPREAD = 1.7
POINT_READS = 300
LIGHT_READS = {True: 7000, False: 900}  # with and without indirect light
RAYS = {True: 46, False: 1}
DRAWS = {True: 8, False: 2}  # of all triangles: what the sample sees, and depth maps


@dataclass(frozen=True)
class PointCosts:
    """Nanoseconds of a sample: of one of its points, and of its light."""

    point: float
    light: float

    @property
    def best(self) -> int:
        """Points that make the most of the time of a picture of one sample."""
        ideal = math.sqrt(SPREAD * self.light / max(self.point, 1e-9))
        return min(2 ** round(math.log2(max(ideal, 1.0))), MOST)

    def count(self, asked: int) -> int:
        """Points of a sample that is `asked` for so many."""
        return -(-asked * self.best // MOST)

    def why(self, asked: int) -> str:
        """For the ledger and the terminal."""
        count = self.count(asked)
        cost = f"one takes {milliseconds(self.point)} beside {milliseconds(self.light)} of light here"
        return f"{count} a sample of {asked}, because {cost}" if count < asked else f"{count} a sample; {cost}"


def costs_of(pixels: int, triangles: int, indirect: bool) -> PointCosts:
    """Of a picture of so many pixels, whose camera may see so many triangles."""
    figures = device.current()
    read = min(figures.fetch, figures.load)
    ray = figures.ray_level * math.log2(triangles + 2)
    drawn = triangles * figures.triangle
    light = pixels * (LIGHT_READS[indirect] * read + RAYS[indirect] * ray) + DRAWS[indirect] * drawn
    return PointCosts(pixels * POINT_READS * read + drawn, light)


def count_of(points: int, samples: int) -> int:
    """How many points of the film a sample is to show where the picture is to have that many in all."""
    return min(max(-(-points // max(samples, 1)), 1), MOST)


def foreseen(snapshot: Snapshot, points: int, samples: int, indirect: bool) -> list[str]:
    """What is to be expected before anything is drawn, as sentences; none where samples show their own point alone."""
    asked = count_of(points, samples)
    if asked == 1:
        return []
    costs = costs_of(snapshot.film.width * snapshot.film.height, snapshot.triangle_count, indirect)
    return [f"Film points: {costs.why(asked)}"]
