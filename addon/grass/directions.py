"""Directions of view and light over a surface, on rings of equal polar angle, and weights between them.

A direction lies between two rings and, on each, between two azimuths: four weights, which sum to one, are continuous
and are 1 at the directions themselves. Beyond the last ring its own polar angle counts. The 81 views and 21 lights are
those of measured bidirectional texture functions (Suykens et al. 2003); the thesis (docs/grass.md) names their number.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Rings:
    """Polar angles in degrees from the normal, rising, and how many azimuths each has."""

    polar: tuple[float, ...]
    counts: tuple[int, ...]

    def __post_init__(self):
        rising = all(a < b for a, b in zip(self.polar, self.polar[1:]))
        if not self.polar or len(self.polar) != len(self.counts) or not rising or min(self.counts) < 1:
            raise ValueError("Rings of directions need rising polar angles, and one count of at least 1 for each.")
        if self.polar[0] < 0.0 or self.polar[-1] >= 90.0:
            raise ValueError("Polar angles of directions lie from 0 to less than 90 degrees.")

    @property
    def number(self) -> int:
        """Of directions."""
        return sum(self.counts)

    @property
    def firsts(self) -> tuple[int, ...]:
        """The number of the first direction of each ring."""
        return tuple(int(n) for n in np.cumsum((0, *self.counts))[:-1])

    @property
    def vectors(self) -> np.ndarray:
        """(number, 3) unit vectors, z along the normal."""
        found = []
        for polar, count in zip(np.radians(self.polar), self.counts):
            azimuth = 2.0 * np.pi * np.arange(count) / count
            ring = np.broadcast_to(np.cos(polar), azimuth.shape)
            found.append(np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), ring], axis=1))
        return np.concatenate(found)

    def weights(self, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Numbers (..., 4) of the directions around unit vectors (..., 3), and their weights."""
        direction = np.asarray(direction, float)
        polar = np.degrees(np.arccos(np.clip(direction[..., 2], -1.0, 1.0)))
        azimuth = np.arctan2(direction[..., 1], direction[..., 0]) / (2.0 * np.pi)
        angles, counts, firsts = np.array(self.polar), np.array(self.counts), np.array(self.firsts)
        low = np.clip(np.searchsorted(angles, polar, side="right") - 1, 0, max(len(angles) - 2, 0))
        high = np.minimum(low + 1, len(angles) - 1)
        span = np.where(high > low, angles[high] - angles[low], 1.0)
        outer = np.clip((polar - angles[low]) / span, 0.0, 1.0)
        numbers, shares = [], []
        for ring, share in ((low, 1.0 - outer), (high, outer)):
            place = (azimuth % 1.0) * counts[ring]
            before = np.floor(place)
            within = place - before
            for step, part in ((0, 1.0 - within), (1, within)):
                numbers.append(firsts[ring] + (before.astype(int) + step) % counts[ring])
                shares.append(share * part)
        return np.stack(numbers, axis=-1), np.stack(shares, axis=-1)

    def neighbours(self) -> list[tuple[int, int]]:
        """Pairs of directions side by side on a ring, and of each direction with the next one farther out."""
        pairs = []
        for first, count in zip(self.firsts, self.counts):
            pairs += [(first + k, first + (k + 1) % count) for k in range(count if count > 2 else count - 1)]
        for inner in range(len(self.counts) - 1):
            for k in range(self.counts[inner + 1]):
                beside = round(k / self.counts[inner + 1] * self.counts[inner]) % self.counts[inner]
                pairs.append((self.firsts[inner] + beside, self.firsts[inner + 1] + k))
        return pairs

    def solid_angles(self) -> np.ndarray:
        """(number,) of the cells around the directions that divide the hemisphere; their sum is 2 pi."""
        polar = np.radians(self.polar)
        borders = np.concatenate([[0.0], 0.5 * (polar[1:] + polar[:-1]), [0.5 * np.pi]])
        rings = 2.0 * np.pi * (np.cos(borders[:-1]) - np.cos(borders[1:]))
        return np.repeat(rings / np.array(self.counts), self.counts)


VIEWS = Rings((0.0, 15.0, 30.0, 45.0, 60.0, 75.0), (1, 6, 12, 18, 20, 24))
LIGHTS = Rings((0.0, 35.0, 70.0), (1, 8, 12))
GRAZING = 85.0  # of a further ring: most of a meadow is seen from there


def finer(rings: Rings) -> Rings:
    """These directions and others between them and beyond, about 24 a ring: lights of which the mean alone is kept."""
    polar, counts = [], []
    ends = (*rings.polar, min(rings.polar[-1] + 10.0, 0.5 * (rings.polar[-1] + 90.0)))
    for k, (angle, count) in enumerate(zip(rings.polar, rings.counts)):
        last = k == len(rings.polar) - 1
        between = ends[k + 1] if last else 0.5 * (angle + ends[k + 1])
        polar += [angle, between]
        counts += [count * max(round(24 / count), 1) if count > 1 else 1, 24 if between > 20.0 else 12]
    return Rings(tuple(polar), tuple(counts))


def thinned(rings: Rings, number: int) -> Rings:
    """About as many directions as asked for, on as few rings as that needs, as far out as before."""
    if number >= rings.number:
        return rings
    share = number / rings.number
    count = max(round(len(rings.polar) * share**0.5), 2)
    polar = np.linspace(rings.polar[0], rings.polar[-1], count)
    inner = np.sin(np.radians(polar[1:]))
    spread = np.maximum(np.round((number - 1) * inner / inner.sum()), 3).astype(int)
    return Rings(tuple(float(p) for p in polar), (1, *(int(n) for n in spread)))
