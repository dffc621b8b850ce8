"""Ranked coverage: for each pixel pairs (id, weight), the heaviest first, as Cryptomatte stores which objects cover it.

Images hold two pairs each, (id, weight, id, weight); an id of 0 is none. Ids are hashes of names, MurmurHash3 of 32
bits, whose bits are those of a float: "Cryptomatte Specification" 1.2 (Friedman and Jones, Psyop, 2015-2016). Weights
of slices of one picture are added by id, not by rank; what has no room in the end is the lightest.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence

import numpy as np

_MASK = 0xFFFFFFFF


def murmur_hash(text: str) -> int:
    """MurmurHash3_x86_32 of a name's UTF-8 bytes, seed 0 (Appleby, public domain)."""
    data, value = text.encode(), 0
    blocks = len(data) // 4
    for k in range(blocks):
        value ^= _mixed(int.from_bytes(data[4 * k : 4 * k + 4], "little"))
        value = (_rotated(value, 13) * 5 + 0xE6546B64) & _MASK
    value ^= _mixed(int.from_bytes(data[4 * blocks :], "little"))  # of no bytes 0, which changes nothing
    value ^= len(data)
    for shift, factor in ((16, 0x85EBCA6B), (13, 0xC2B2AE35)):
        value = ((value ^ (value >> shift)) * factor) & _MASK
    return value ^ (value >> 16)


def _mixed(block: int) -> int:
    return (_rotated((block * 0xCC9E2D51) & _MASK, 15) * 0x1B873593) & _MASK


def _rotated(value: int, bits: int) -> int:
    return ((value << bits) | (value >> (32 - bits))) & _MASK


def id_bits(name: str) -> int:
    """The 32 bits of a name's id: its hash, but of a float that is neither infinite, nor none, nor denormal."""
    value = murmur_hash(name)
    return value ^ (1 << 23) if (value >> 23) & 255 in (0, 255) else value


def ids_of(names: Sequence[str]) -> np.ndarray:
    """(N,) float32 ids."""
    return np.array([id_bits(name) for name in names], np.uint32).view(np.float32)


def manifest(names: Iterable[str]) -> str:
    """JSON of names and their ids in hexadecimal."""
    return json.dumps({name: f"{id_bits(name):08x}" for name in names}, ensure_ascii=False, separators=(",", ":"))


def ranked(images: Sequence[np.ndarray]) -> list[np.ndarray]:
    """The same pairs, (H, W, 4) two of them, in order of falling weight."""
    return merged([images])


def merged(parts: Sequence[Sequence[np.ndarray]]) -> list[np.ndarray]:
    """Images of pairs of several parts as one: weights of equal ids added. As many images as each part has."""
    stacked = np.concatenate([np.concatenate(images, axis=-1) for images in parts], axis=-1)
    ids, weights = stacked[..., 0::2], stacked[..., 1::2].astype(np.float64)
    if len(parts) > 1:
        order = np.argsort(ids, axis=-1, kind="stable")
        ids, weights = (np.take_along_axis(one, order, axis=-1).copy() for one in (ids, weights))
        for k in range(1, ids.shape[-1]):
            same = ids[..., k] == ids[..., k - 1]
            weights[..., k] += np.where(same, weights[..., k - 1], 0.0)
            weights[..., k - 1] = np.where(same, 0.0, weights[..., k - 1])
    ids = np.where(weights > 0.0, ids, np.float32(0.0))
    order = np.argsort(-weights, axis=-1, kind="stable")[..., : 2 * len(parts[0])]
    pairs = np.stack([np.take_along_axis(one, order, axis=-1) for one in (ids, weights)], axis=-1).astype(np.float32)
    return [
        np.ascontiguousarray(pairs[..., k : k + 2, :]).reshape(*ids.shape[:2], 4) for k in range(0, pairs.shape[2], 2)
    ]
