"""Samples that a technique takes part in, where it is not drawn in all of them: few, spread evenly, each with a weight.

Sample 0 always takes part with weight 1: how often the others are worth their time is learned from it, and a decision
that depends on a sample must not change that sample's weight. Each half of the samples has m turns more, whose weights
sum up to the half's number of samples: techniques/denoise.py compares what the halves estimate.

    mean = (1 / n) sum over turns of  w_s g_s,   w_0 = 1,  then (n / 2 - 1) / m, in the second half (n / 2) / m

Of each run of neighbouring samples that one is taken whose points (sequence.py) lie where those taken
before leave most room: every k-th sample would lie in one k-th of the first dimension.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from types import MappingProxyType

import numpy as np

from .sequence import FILM, bits, points

FEWEST = 2  # turns of each half of the samples, besides sample 0
MOST_APART = 32  # samples from one turn to the next, in the mean
_CELL_BITS = 32


def most_apart(samples: int, fewest: int = FEWEST) -> int:
    """Samples from one turn to the next, a power of two, at most, if each half is to have `fewest` turns."""
    return max(1, min(MOST_APART, 1 << max((samples // (2 * fewest)).bit_length() - 1, 0)))


@lru_cache(maxsize=256)
def turns(samples: int, apart: tuple[int, ...]) -> Mapping[int, float]:
    """Weights by sample, of `samples`, where turns are apart[-1] samples apart in the mean (powers of two, rising).
    Turns of apart[:-1] hold those of `apart`, so that what follows on something has a turn where that has one."""
    if not apart or apart[-1] <= 1:
        return MappingProxyType(dict.fromkeys(range(samples), 1.0))
    before = turns(samples, apart[:-1])
    if apart[:-1] and apart[-1] == apart[-2]:
        return before
    half, found = samples // 2, {0: 1.0}
    for first, end in ((1, half), (half, samples)):
        among = [sample for sample in range(first, end) if sample in before]
        count = min(max(half // apart[-1], 1), len(among))
        taken = _spread(among, count)
        found |= dict.fromkeys(taken, (end - first) / count) if count else {}
    return MappingProxyType(found)


def _spread(among: Sequence[int], count: int) -> list[int]:
    """One of each of `count` runs of the samples: the one whose points have the fewest taken ones in their cells."""
    if count >= len(among):
        return list(among)
    index = np.asarray(among, np.uint64)
    axes = [bits(index, dimension) / 2.0**_CELL_BITS for dimension in (0, 1, 5, 6)]
    axes += list(np.array([points(int(k), 1, FILM)[0] for k in among]).T)
    cells = [np.minimum((axis * count).astype(int), count - 1) for axis in axes]
    taken_in = np.zeros((len(axes), count), int)
    found = []
    for run in np.array_split(np.arange(len(among)), count):
        crowd = sum(taken_in[axis][cells[axis][run]] for axis in range(len(axes)))
        best = int(run[np.argmin(crowd)])
        found.append(among[best])
        for axis in range(len(axes)):
            taken_in[axis, cells[axis][best]] += 1
    return found
