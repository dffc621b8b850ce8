"""How often each light is sampled: points go where the error is, not evenly over the lights.

With points from a low-discrepancy set the squared error that light k leaves in a picture falls like V_k / n_k^1.5;
V_k is the variance of one point's contribution, relative to the light in the picture. A budget of points is spent best
if it goes, doubling by doubling, to the light whose error per added point falls most. A lamp without size or one whose
shadows nobody sees then costs a map every few samples; the window that lights the room gets several maps in each.

A light that misses samples misses their points of the film, too: where it gives much of the light, edges and textures
are as ragged as with fewer samples. That error, F_k / n_k^1.5 up to one point per sample, counts beside the other.

The budget itself grows with the samples where that does not suffice. What a sample shows of edges and textures comes
from film points that are spread evenly and converges faster than light through small openings: the more samples, the
larger the part of the error that points on lights could take away. As fast as the samples, it would not pay: with four
times the points at 64 samples whole pictures of hall, window and garden took 1.18, 1.19 and 1.09 times the processor
time and had 0.98, 0.92 and 0.93 of the error, the rest being edges and indirect light.

A picture of few samples costs what it costs, whatever its maps: surfaces, hierarchy, virtual lights, film. Directions
of the world, one cheap map each, are then drawn beyond the budget. relMSE and seconds of 256x192 pixels by the Fast
preset with one sample, by 1 or 2 directions and by 16: product .44 in 0.51 s, .063 in 0.60; courtyard .52 in 0.47, .075
in 0.56; foliage .091 in 1.6, .037 in 2.2; instances .23 in 2.6, .11 in 2.9. With four samples, product by 4 and 8: .031
and .012, both in 2.1 s; courtyard by 2 and 4 rays of each pixel .019 and .012.

A sample without indirect light costs little more than its maps. Up to the usual number of samples it shares out fewer,
and directions of the world are doubled only where they leave much. relMSE times seconds, 16 samples without indirect
light, by 8 maps and twice the directions of the world, by 5 and as many, and by 3: foliage .025 .017 .016, hall .057
.041 .055, product .0081 .0071 .0084, instances .071 .061 .107, garden .0114 .0107 .0158, window .111 .108 .122.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

FEWEST_POINTS = 4  # of a light in a whole picture, whatever its variance: it was estimated from few probes
MOST_EXPONENT = 3  # sequence.py orders the film for up to 8 points of a light per sample
USUAL_SAMPLES = 16  # up to here a sample has the budget that was asked for
MOST_ALONE = 5.0  # points per sample that up to here pay in pictures without indirect light
LITTLE = 1e-4  # squared error that is left, relative: with it a budget is enough
FEWEST_DIRECTIONS, MOST_DIRECTIONS = 32, 16  # of the world: in a whole picture, and in one of its samples
PER_POINT = 4.0  # directions of a picture of few samples
LITTLE_OF_WORLD = 2e-4  # squared error by directions of the world for which any picture draws twice as many
LITTLE_OF_FEW = 1e-2  # squared error by directions of the world that goes unseen in a picture of few samples


@dataclass(frozen=True)
class Rate:
    """2^exponent points per sample of the picture."""

    exponent: int = 0

    @property
    def per_sample(self) -> float:
        return 2.0**self.exponent

    def points(self, sample: int) -> range:
        """Numbers of the points that belong to a sample: several, one, or in some samples none."""
        if self.exponent >= 0:
            count = 1 << self.exponent
            return range(sample * count, (sample + 1) * count)
        every = 1 << -self.exponent
        return range(sample // every, sample // every + (sample % every == 0))


def paying(asked: float, samples: int, alone: bool) -> float:
    """Points per sample to begin with, of those `asked` for. `alone`: the picture has no indirect light."""
    return min(asked, MOST_ALONE * max(samples / USUAL_SAMPLES, 1.0) ** 0.5) if alone else asked


def budget_for(variance: Sequence[float], samples: int, asked: float, film: Sequence[float] = ()) -> float:
    """Points per sample that leave little error: what was asked for, doubled at most half as often as the samples are
    doubled beyond the usual number, or halved below it."""
    few = samples < USUAL_SAMPLES
    most = asked * (USUAL_SAMPLES / samples if few else samples / USUAL_SAMPLES) ** 0.5
    budget = asked
    while 2 * budget <= most and left(variance, samples, budget, film) > (LITTLE_OF_FEW if few else LITTLE):
        budget *= 2
    return budget


def directions_for(variance: float, samples: int, rate: Rate, asked: float, alone: bool = False) -> Rate:
    """`rate` of the world, doubled where a picture of few samples would see too little of it, and once where any
    picture would. `asked`: points of lights that a sample shares out, of which directions are PER_POINT times as many
    at most; `alone`: the picture has no indirect light."""
    few = min(MOST_DIRECTIONS, FEWEST_DIRECTIONS / samples, PER_POINT * asked)
    little = LITTLE_OF_FEW if alone and samples <= USUAL_SAMPLES else LITTLE_OF_WORLD
    most, little = (few, LITTLE_OF_FEW) if few > rate.per_sample else (2 * rate.per_sample, little)
    while rate.per_sample < min(most, MOST_DIRECTIONS) and variance * (rate.per_sample * samples) ** -1.5 > little:
        rate = Rate(rate.exponent + 1)
    return rate


def left(variance: Sequence[float], samples: int, budget: float, film: Sequence[float] = ()) -> float:
    """Squared error of a picture of so many samples by points on lights of these variances, with this budget."""
    points = np.array([rate.per_sample * samples for rate in allocate(variance, samples, budget, film)])
    return float((np.nan_to_num(np.asarray(variance, np.float64), posinf=1e30) * points**-1.5).sum())


def allocate(variance: Sequence[float], samples: int, budget: float, film: Sequence[float] = ()) -> list[Rate]:
    """Rates for lights of these variances that sum to about `budget` points per sample. `film`: by light, the squared
    error of one sample's points of the film.

    No light gets fewer than FEWEST_POINTS points in all, nor a rate that does not come out even over `samples`.
    """
    least = 0
    while least > -3 and samples % (1 << (1 - least)) == 0 and samples >> (1 - least) >= FEWEST_POINTS:
        least -= 1
    exponents = [least] * len(variance)
    variance = np.nan_to_num(np.asarray(variance, np.float64), nan=0.0, posinf=1e30)
    gain = 1.0 - 2.0**-1.5
    edges = np.asarray(film, np.float64) if len(film) else np.zeros(len(variance))
    while True:
        rates = np.exp2(exponents)
        benefit = (variance + np.where(rates < 1.0, edges, 0.0)) * rates**-1.5 * gain / rates
        affordable = (rates.sum() + rates <= budget) & (np.asarray(exponents) < MOST_EXPONENT) & (benefit > 0)
        if not affordable.any():
            return [Rate(int(exponent)) for exponent in exponents]
        exponents[int(np.argmax(np.where(affordable, benefit, -1.0)))] += 1
