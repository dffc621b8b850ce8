"""The one low-discrepancy sequence that all techniques draw from, indexed by sample number.

Sobol' points, Owen-scrambled by hashing. Two scrambles of one dimension are functions of each other: what is integrated
together needs dimensions of its own. Every use but these three takes dimensions 1 to 3 with a scramble of its own: the
lens takes 4 and 5, since each point of it sees all lights, and numbers that choose one of many (`uniform`) take 8.
The first two are the perfect pair: every prefix of 2^k points has one in each cell of any shape. The film takes this
pair, too, but with its index turned by a matrix over the bits (FILM_ORDER): each prefix of 2^k points is then the same
set, perfect at edges, in another order, chosen so that the film and any one use form a net together as well. At an
edge, where only some of the samples see a surface, those still cover the light evenly. (Pairs shuffled independently
leave a random subset there, and the error at edges falls only like 1 / sqrt(n).) With dimensions 4 and 5 for the film,
16 points err 1.8 times as much (mean square) in how far an edge covers a pixel. Shaders get dimensions 1, 2, 5 and 6
unscrambled and scramble them per pixel.

The first point of the film is its filter's middle, and that of the lens the aperture's: the set is shifted bit by bit
to bring it there, which leaves a point in every cell. (Put there alone, it would leave its own cell empty: 16 points
would err 1.35 times as much at edges, mean square, and 64 points 1.17 times.)

Sources: Burley, "Practical Hash-based Owen Scrambling", JCGT 9(4), 2020; Joe & Kuo, "Constructing Sobol sequences
with better two-dimensional projections", SIAM J. Sci. Comput. 30, 2008 (direction numbers);
Appleby, MurmurHash3 (`_mixed`).
"""

from __future__ import annotations

import zlib
from functools import lru_cache

import numpy as np

_U32 = np.uint64(0xFFFFFFFF)
FILM, LENS = "film", "lens"
_FIRST = {FILM: (1 << 31, 1 << 31), LENS: (0, 0)}  # where the first point lies, as 32-bit fractions


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


def _mixed(salt: int) -> int:
    """A hash of 32 bits, each of which depends on all of the salt. The first bits of a scrambled number come from the
    last bits of its scramble's seed alone: of two seeds that are multiples of one salt, the first points of a pair
    would lie on a curve (a single point of a sky gave .72 of its light in the mean over seeds, 32 points .96)."""
    salt &= 0xFFFFFFFF
    for factor, shift in ((0x85EBCA6B, 16), (0xC2B2AE35, 13)):
        salt ^= salt >> shift
        salt = salt * factor & 0xFFFFFFFF
    return salt ^ salt >> 16


def _owen(x: np.ndarray, seed: int) -> np.ndarray:
    return _reverse_bits(_laine_karras(_reverse_bits(x), seed))


# Primitive polynomials and initial numbers of dimensions 2 to 8 (Joe & Kuo 2008, new-joe-kuo-6): degree, a, m.
_JOE_KUO = ((1, 0, (1,)), (2, 1, (1, 3)), (3, 1, (1, 3, 1)), (3, 2, (1, 1, 1)), (4, 1, (1, 1, 3, 3)),
            (4, 4, (1, 3, 5, 13)), (5, 2, (1, 1, 5, 5, 17)))  # fmt: skip
DIMENSIONS = 1 + len(_JOE_KUO)


def _direction_numbers() -> np.ndarray:
    """(DIMENSIONS, 32) uint64 direction numbers, as 32-bit fractions."""
    out = np.zeros((DIMENSIONS, 32), np.uint64)
    out[0] = [1 << (31 - k) for k in range(32)]
    for dimension, (degree, a, initial) in enumerate(_JOE_KUO, 1):
        v = [m << (31 - k) for k, m in enumerate(initial)]
        for k in range(degree, 32):
            new = v[k - degree] ^ (v[k - degree] >> degree)
            for j in range(1, degree):
                if (a >> (degree - 1 - j)) & 1:
                    new ^= v[k - j]
            v.append(new)
        out[dimension] = v
    return out


_DIRECTIONS = _direction_numbers()
# Row k: the bits of the index that sum up (modulo 2) to bit k of the film's index. Of random upper triangular matrices
# one with small t values (Niederreiter 1987) of the film with the pair, for 8 to 1024 samples of 1, 2, 4 or 8 points.
FILM_ORDER = (553, 846, 932, 424, 1008, 160, 960, 128, 256, 512)


def _film_directions() -> np.ndarray:
    """(2, 32) uint64 direction numbers of the film: those of the first pair with the index turned by FILM_ORDER."""
    out = _DIRECTIONS[:2].copy()
    for k in range(len(FILM_ORDER)):
        turned = [_DIRECTIONS[:2, j] for j, row in enumerate(FILM_ORDER) if row >> k & 1]
        out[:, k] = np.bitwise_xor.reduce(turned, axis=0)
    return out


_FILM_DIRECTIONS = _film_directions()
_PLACES = np.arange(32, dtype=np.uint64)


def bits(index: np.ndarray, dimension: int) -> np.ndarray:
    """Unscrambled Sobol' numbers of `dimension` as 32-bit fractions (uint64)."""
    return _bits(index, _DIRECTIONS[dimension])


def _bits(index: np.ndarray, directions: np.ndarray) -> np.ndarray:
    index = np.asarray(index, np.uint64)
    taken = (index[..., None] >> _PLACES) & np.uint64(1)
    return np.bitwise_xor.reduce(taken * directions, axis=-1)


def points(first: int, count: int, use: str, seed: int = 0) -> np.ndarray:
    """Points `first` ... `first + count - 1` of the sequence for `use`, (count, 2) float64 in [0, 1)."""
    salt = zlib.crc32(f"{use}/{seed}".encode())
    index = np.arange(first, first + count, dtype=np.uint64)
    pair = {FILM: _FILM_DIRECTIONS, LENS: _DIRECTIONS[3:5]}.get(use, _DIRECTIONS[:2])
    numbers = [_mixed(salt + 1), _mixed(salt + 2)]
    scrambled = np.stack([_owen(_bits(index, axis), number) for axis, number in zip(pair, numbers)], axis=-1)
    if use in _FIRST:
        now = [_owen(np.zeros(1, np.uint64), number)[0] for number in numbers]
        scrambled ^= np.bitwise_xor(now, np.array(_FIRST[use], np.uint64))
    return scrambled.astype(np.float64) / 4294967296.0


BLOCK = 64  # numbers that are made at once: an array of so many costs hardly more than one of a single number


@lru_cache(maxsize=1024)
def _block(number: int, use: str, seed: int) -> list[tuple[float, float]]:
    return [(x, y) for x, y in points(number * BLOCK, BLOCK, use, seed).tolist()]


@lru_cache(maxsize=1024)
def _axis(number: int, dimension: int, use: str, seed: int) -> list[float]:
    salt = zlib.crc32(f"{use}/{seed}".encode())
    scrambled = _owen(bits(_indices(number), dimension), _mixed(salt + 3))
    return (scrambled.astype(np.float64) / 4294967296.0).tolist()


@lru_cache(maxsize=64)
def _unscrambled(number: int) -> list[tuple[int, int, int, int]]:
    found = [bits(_indices(number), dimension).astype(np.uint32).view(np.int32) for dimension in (0, 1, 5, 6)]
    return list(zip(*(values.tolist() for values in found)))


def _indices(block: int) -> np.ndarray:
    return np.arange(block * BLOCK, (block + 1) * BLOCK, dtype=np.uint64)


def point(index: int, use: str, seed: int = 0) -> tuple[float, float]:
    """One point of the sequence for `use`."""
    return _block(index // BLOCK, use, seed)[index % BLOCK]


def third(index: int, use: str, seed: int = 0) -> float:
    """A third number that goes with `point`, for uses that fill a volume."""
    return _axis(index // BLOCK, 2, use, seed)[index % BLOCK]


def uniform(index: int, use: str, seed: int = 0) -> float:
    """A number that chooses among things, of which the chosen one then takes a `point`."""
    return _axis(index // BLOCK, 7, use, seed)[index % BLOCK]


def alike(index: int, use: str, seed: int = 0) -> tuple[float, float, float]:
    """`point` and `third`, shifted alike in place of scrambled: of the first 2^k points each lies at the same place of
    its cell. So parts of a light lie as far apart as they can, where each point stands for the part around it."""
    salt = zlib.crc32(f"{use}/{seed}".encode())
    numbers = [int(bits(np.uint64(index), axis)) ^ _mixed(salt + axis + 1) for axis in range(3)]
    return tuple(number / 4294967296.0 for number in numbers)


def pixel_bits(index: int) -> tuple[int, int, int, int]:
    """Dimensions 1, 2, 6, 7 of point `index` as signed 32-bit integers, for shaders to scramble per pixel."""
    return _unscrambled(index // BLOCK)[index % BLOCK]
