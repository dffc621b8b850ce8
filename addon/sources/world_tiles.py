"""Directions of the world for single tiles of the picture: a table per tile, made from what its probe sees.

One density for the whole picture sends directions to every opening that any pixel sees; a pixel behind columns sees a
tenth of them. Rays have a direction per pixel and may follow the table of their tile instead. With f = visibility x
cosine x radiance in cells of equal solid angle, normalised per probe, the table is

    m = (1 - BLIND) ((1 - SHARED) (smoothed f^p)^(1/p) + SHARED (mean of f^p)^(1/p)) + BLIND radiance,   p = POWER

smoothed over neighbouring tiles and cells, since a probe is one pixel of its tile and one direction of each cell; the
mean is over all probes. With p = 2 that is the density which leaves least variance to a group of pixels.
Within a cell directions are even, so the density is m / (solid angle of a cell) and never zero where light may come
from. Bright spots smaller than a cell are what such a table cannot know; `variances` says what that costs.
"""

from __future__ import annotations

import numpy as np

TILES = 0.3  # weight of each of the two neighbouring tiles along an axis
CELLS = 0.25  # of each of the two neighbouring cells
SHARED = 0.35
POWER = 2.0
BLIND = 0.05


def arriving(useful: np.ndarray, radiance: np.ndarray) -> np.ndarray:
    """Light of the world at probes by cell, relative to each probe's sum; 0 at probes without any.

    `useful`: (tile rows, tile columns, cell rows, cell columns) visibility x cosine; `radiance`: by cell.
    """
    light = useful.astype(np.float64) * radiance
    return light / np.maximum(light.sum(axis=(2, 3), keepdims=True), 1e-300)


def tables(light: np.ndarray, radiance: np.ndarray, with_own: bool = True) -> np.ndarray:
    """Chance of each cell in each tile, of the shape of `light` (see `arriving`); sums to 1 over the cells.

    `with_own=False` leaves out what the tile's own probe saw: then the table can be judged by that probe.
    """
    powers = light**POWER
    smooth = _over_tiles(powers)
    if not with_own:
        alone = np.zeros((9, 9, 1, 1))
        alone[4, 4] = 1.0
        smooth = np.maximum(smooth - _over_tiles(alone)[4, 4] * powers, 0.0)
    smooth = _over_cells(smooth) ** (1 / POWER)
    own = smooth.sum(axis=(2, 3), keepdims=True)
    shared = _over_cells(powers.mean(axis=(0, 1), keepdims=True)) ** (1 / POWER)
    shared /= max(float(shared.sum()), 1e-300)
    blind = np.maximum(radiance, 0.0) / max(float(np.maximum(radiance, 0.0).sum()), 1e-300)
    known = np.where(own > 0, (1 - SHARED) * smooth / np.maximum(own, 1e-300) + SHARED * shared, shared)
    chance = (1 - BLIND) * known + BLIND * blind
    total = chance.sum(axis=(2, 3), keepdims=True)
    return np.where(total > 0, chance / np.maximum(total, 1e-300), 1.0 / radiance.size)


def lower_edges(chance: np.ndarray) -> np.ndarray:
    """(tiles, cells) float32: sum of the chances of all cells before each, for a search by one uniform number."""
    flat = chance.reshape(chance.shape[0] * chance.shape[1], -1)
    return np.concatenate([np.zeros((len(flat), 1)), np.cumsum(flat, axis=1)[:, :-1]], axis=1).astype(np.float32)


def variances(useful: np.ndarray, moments: np.ndarray) -> tuple[float, float]:
    """Variance that one ray by the table, and one direction shared by all pixels, leave, relative as relMSE counts.

    `moments`: (3, cell rows, cell columns) means over a cell of the world's radiance, of its square, and of its square
    over the density of the shared directions. The table is judged by probes that it does not hold.
    """
    radiance, square, shared_square = moments
    solid_angle = 4 * np.pi / radiance.size
    chance = tables(arriving(useful, radiance), radiance, with_own=False)
    useful = useful.astype(np.float64)
    light = (useful * radiance).sum(axis=(2, 3)) * solid_angle
    of_table = (useful**2 * square / np.maximum(chance, 1e-300)).sum(axis=(2, 3)) * solid_angle**2
    of_shared = (useful**2 * shared_square).sum(axis=(2, 3)) * solid_angle
    scale = np.maximum(light**2 + (0.1 * light.mean()) ** 2, 1e-300)
    return tuple(float((np.maximum(second - light**2, 0.0) / scale).mean()) for second in (of_table, of_shared))


def _over_tiles(values: np.ndarray) -> np.ndarray:
    """Two rounds: a probe is seldom on the very surface that a pixel of its tile shows."""
    for axis in (0, 1, 0, 1):
        values = _blurred(values, axis, TILES)
    return values


def _over_cells(values: np.ndarray) -> np.ndarray:
    """Rows end at the poles, columns go round."""
    return _blurred(_blurred(values, 2, CELLS), 3, CELLS, wrap=True)


def _blurred(values: np.ndarray, axis: int, weight: float, wrap: bool = False) -> np.ndarray:
    before, after = np.roll(values, 1, axis), np.roll(values, -1, axis)
    if not wrap:
        first, last = [slice(None)] * values.ndim, [slice(None)] * values.ndim
        first[axis], last[axis] = 0, -1
        before[tuple(first)], after[tuple(last)] = values[tuple(first)], values[tuple(last)]
    return (1 - 2 * weight) * values + weight * (before + after)
