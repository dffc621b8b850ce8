"""The one low-discrepancy sequence that all techniques draw from, indexed by sample number.

Sobol' (0,2)-points, Owen-scrambled by hashing; each use ("dimension") has its own scramble and its own shuffle of
the order, so that pairs of uses are independent while every prefix of each is well spread.
Source: Burley, "Practical Hash-based Owen Scrambling", JCGT 9(4), 2020 (method; the code is our own).
"""

from __future__ import annotations

import zlib

import numpy as np

_U32 = np.uint64(0xFFFFFFFF)


def _reverse_bits(x: np.ndarray) -> np.ndarray:
    x = x.astype(np.uint64)
    for shift, mask in ((1, 0x55555555), (2, 0x33333333), (4, 0x0F0F0F0F), (8, 0x00FF00FF)):
        mask, shift = np.uint64(mask), np.uint64(shift)
        x = ((x >> shift) & mask) | ((x & mask) << shift)
    return ((x >> np.uint64(16)) | (x << np.uint64(16))) & _U32


def _laine_karras(x: np.ndarray, seed: int) -> np.ndarray:
    x = (x + np.uint64(seed & 0xFFFFFFFF)) & _U32
    for factor in (0x6C50B47C, 0xB82F1E52, 0xC7AFE638, 0x8D22F6E6):
        x = (x ^ ((x * np.uint64(factor)) & _U32)) & _U32
    return x


def _owen(x: np.ndarray, seed: int) -> np.ndarray:
    return _reverse_bits(_laine_karras(_reverse_bits(x), seed))


def _sobol_second(index: np.ndarray) -> np.ndarray:
    """Second Sobol' dimension: direction numbers v_k = v_{k-1} ^ (v_{k-1} >> 1)."""
    result = np.zeros_like(index)
    direction = np.uint64(0x80000000)
    bits = index.copy()
    while bits.any():
        result = np.where(bits & np.uint64(1), result ^ direction, result)
        bits >>= np.uint64(1)
        direction ^= direction >> np.uint64(1)
    return result


def points(first: int, count: int, use: str, seed: int = 0) -> np.ndarray:
    """Points `first` … `first + count - 1` of the sequence for `use`, (count, 2) float64 in [0, 1)."""
    salt = zlib.crc32(f"{use}/{seed}".encode())
    index = np.arange(first, first + count, dtype=np.uint64)
    shuffled = _owen(index, salt)
    x = _owen(_reverse_bits(shuffled), salt * 2654435761 + 1)
    y = _owen(_sobol_second(shuffled), salt * 2246822519 + 2)
    return np.stack([x, y], axis=-1).astype(np.float64) / 4294967296.0


def point(index: int, use: str, seed: int = 0) -> tuple[float, float]:
    """One point of the sequence for `use`."""
    x, y = points(index, 1, use, seed)[0]
    return float(x), float(y)
