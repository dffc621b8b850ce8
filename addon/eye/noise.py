"""Random numbers by place, and smooth noise of time: the same for the same seed, wherever one begins."""

from __future__ import annotations

import numpy as np


def at_integers(index, seed: int, stream: int) -> np.ndarray:
    """Uniform numbers in [0, 1) for whole numbers `index` of any sign; streams are independent. Shape of `index`.

    Source: SplitMix64 (Steele, Lea, Flood 2014) as a hash.
    """
    with np.errstate(over="ignore"):
        x = np.atleast_1d(np.asarray(index, np.int64)).astype(np.uint64)
        x += np.uint64(((seed & 0xFFFFFFFF) << 32 | (stream & 0xFFFFFFFF)) ^ 0x9E3779B97F4A7C15)
        for _ in range(2):  # once leaves neighbours alike in some bits
            x += np.uint64(0x9E3779B97F4A7C15)
            x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
            x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
            x ^= x >> np.uint64(31)
    unit = (x >> np.uint64(11)).astype(np.float64) * 2.0**-53
    return unit.reshape(np.shape(index))


def value_noise(time, seed: int, stream: int = 0, octaves: int = 3) -> np.ndarray:
    """Smooth noise in [-1, 1], of mean 0; octave o has 2^o values per second and 2^-o of the first one's size."""
    time = np.asarray(time, np.float64)
    total, weight = np.zeros(time.shape), 0.0
    for octave in range(octaves):
        place = time * 2.0**octave
        whole = np.floor(place)
        share = place - whole
        share = share * share * (3.0 - 2.0 * share)
        low, high = (
            2.0 * at_integers((whole + step).astype(np.int64), seed, 64 * stream + octave) - 1.0 for step in (0, 1)
        )
        total = total + (low + (high - low) * share) * 2.0**-octave
        weight += 2.0**-octave
    return total / weight
