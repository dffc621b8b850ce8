"""Irradiance of the world by normal, in closed form: what direct light knows without drawing directions.

    E(n) = integral over directions w of  L(w) o(w) max(dot(n, w), 0)

with o, between 0 and 1, how open the scene is expected to be towards w, even in cells. The world's image is summed into
ROWS x COLUMNS cells, each kept as the vector  integral of L(w) w  over the cell: as long as a cell lies on one side of
the horizon, its part of E is exactly the dot product with n. The table holds E for normals on a grid of as many rows,
which meet the axes, to be read bilinearly; the few cells that bring most of it (a sun) stand beside it as directions,
since E has an edge at their horizons. The table is scaled so that its mean is exactly that of E over all normals.

Cells and normals stand on grids of the same step in azimuth, so that the sum over a row of cells is a circular
convolution: in a frame that turns with the cell, n depends on the difference of azimuths alone, and a cell counts while
its centre lies above the horizon. Fourier transforms along the rows leave a product of small matrices for each
frequency. Worlds that are tilted have no such grid and take the sum itself.

Error: cells that the horizon cuts, and the interpolation, below 0.3 % of the mean, 0.7 % where the horizon cuts a sun
(`test_irradiance.py`). 2 ms a table, 30 where the world is tilted; 20 once for each turn of a world.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

ROWS, COLUMNS = 48, 96  # cells; normals are asked at ROWS + 1 latitudes, poles among them
BRIGHT, MOST_BRIGHT = 0.01, 8  # share of the light from which a cell stands beside the table, and how many do
PART = 64  # normals at once: their dot products with all cells stay in a processor's cache


@dataclass(frozen=True)
class Irradiance:
    """Of a world; all in float64."""

    table: np.ndarray  # (ROWS + 1, COLUMNS, 3) by latitude from the south pole and azimuth from -pi on
    directions: np.ndarray  # (K, 3) unit, of single bright cells
    bright: np.ndarray  # (K, 3) irradiance of what faces them

    def at(self, normals: np.ndarray) -> np.ndarray:
        """(..., 3) for unit normals (..., 3), as shaders/lib/known_irradiance.glsl reads it."""
        row = (np.arcsin(np.clip(normals[..., 2], -1, 1)) / np.pi + 0.5) * ROWS
        column = (np.arctan2(normals[..., 1], normals[..., 0]) / (2 * np.pi) + 0.5) * COLUMNS
        y, x = np.clip(np.floor(row).astype(int), 0, ROWS - 1), np.floor(column).astype(int)
        ty, tx = (row - y)[..., None], (column - x)[..., None]
        left, right = x % COLUMNS, (x + 1) % COLUMNS
        below = self.table[y, left] * (1 - tx) + self.table[y, right] * tx
        above = self.table[y + 1, left] * (1 - tx) + self.table[y + 1, right] * tx
        facing = np.maximum(normals @ self.directions.T, 0.0)
        return below * (1 - ty) + above * ty + facing @ self.bright

    def texels(self) -> np.ndarray:
        """(ROWS + 2, COLUMNS, 4): the table, and in the last row direction and irradiance of each bright cell."""
        texels = np.zeros((ROWS + 2, COLUMNS, 4), np.float32)
        texels[:-1, :, :3] = self.table
        texels[-1, 0 : 2 * len(self.bright) : 2, :3] = self.directions
        texels[-1, 1 : 2 * len(self.bright) : 2, :3] = self.bright
        return texels


class WorldCells:
    """The light of an equirectangular image (H, W, 3), finite, bottom row first, at least ROWS x COLUMNS, by cell."""

    def __init__(self, pixels: np.ndarray):
        height, width = pixels.shape[:2]
        self._rows, self._columns = np.arange(ROWS) * height // ROWS, np.arange(COLUMNS) * width // COLUMNS
        self._size = (height, width)
        edges = np.sin((np.arange(height + 1) / height - 0.5) * np.pi)
        z = (edges[1:] + edges[:-1]) / 2
        solid_angle = np.diff(edges) * (2 * np.pi / width)
        ring = np.sqrt(np.maximum(1.0 - z * z, 0.0))
        azimuth = (0.5 - (np.arange(width) + 0.5) / width) * 2 * np.pi

        def summed(across: np.ndarray | None, down: np.ndarray) -> np.ndarray:
            weighted = pixels if across is None else pixels * across[None, :, None]
            narrow = np.add.reduceat(weighted, self._columns, axis=1, dtype=np.float64)
            return np.add.reduceat(narrow * down[:, None, None], self._rows, axis=0).reshape(-1, 3)

        sums = (
            summed(np.cos(azimuth), ring * solid_angle), summed(np.sin(azimuth), ring * solid_angle),
            summed(None, z * solid_angle),
        )  # fmt: skip
        self.vectors = np.stack(sums, axis=-1)  # (C, 3 colours, 3)
        self.light = summed(None, solid_angle)  # (C, 3)

    def of(self, directions: np.ndarray) -> np.ndarray:
        """Numbers of the cells that hold directions (..., 3) of the image's own frame."""
        height, width = self._size
        u = 0.5 - np.arctan2(directions[..., 1], directions[..., 0]) / (2 * np.pi)
        v = 0.5 + np.arcsin(np.clip(directions[..., 2], -1, 1)) / np.pi
        row = np.searchsorted(self._rows, np.minimum(np.floor(v * height), height - 1), side="right") - 1
        column = np.searchsorted(self._columns, np.minimum(np.floor(u * width), width - 1), side="right") - 1
        return row * COLUMNS + column

    @property
    def radiance(self) -> np.ndarray:
        """(C, 3) means."""
        height, width = self._size
        z = np.sin((np.append(self._rows, height) / height - 0.5) * np.pi)
        across = np.diff(np.append(self._columns, width)) * (2 * np.pi / width)
        return self.light / (np.diff(z)[:, None] * across).reshape(-1, 1)

    @staticmethod
    def centres() -> np.ndarray:
        """(C, 3) directions, of the image's own frame."""
        latitude = ((np.arange(ROWS) + 0.5) / ROWS - 0.5) * np.pi
        azimuth = (0.5 - (np.arange(COLUMNS) + 0.5) / COLUMNS) * 2 * np.pi
        return _directions(latitude, azimuth)

    @cached_property
    def _power(self) -> np.ndarray:
        """(C,) over all colours."""
        return np.linalg.norm(self.vectors, axis=2).sum(axis=1)

    @cached_property
    def _by_columns(self) -> np.ndarray:
        """(COLUMNS, ROWS, 3, 3 colours): the vectors along radius, east and north of their cells, whose azimuth grows
        with the column."""
        vectors = self.vectors.reshape(ROWS, COLUMNS, 3, 3)[:, ::-1].transpose(1, 0, 3, 2)
        latitude = ((np.arange(ROWS) + 0.5) / ROWS - 0.5) * np.pi
        azimuth = ((np.arange(COLUMNS) + 0.5) / COLUMNS - 0.5) * 2 * np.pi
        return _axes(latitude, azimuth) @ vectors

    def irradiance(self, to_world: np.ndarray, openness: np.ndarray | float = 1.0) -> Irradiance:
        """With the openness (C,) of each cell. `to_world` (3, 3) turns the image's directions into those of the
        world."""
        part = np.broadcast_to(np.asarray(openness, np.float64), len(self.light)).copy()
        power = self._power * part
        order = np.argsort(-power, kind="stable")[:MOST_BRIGHT]
        alone = order[power[order] > BRIGHT * power.sum()]
        vectors = self.vectors[alone] @ to_world.T * part[alone, None, None]
        directions = vectors.sum(axis=1)
        directions /= np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), 1e-300)
        bright = np.einsum("kci,ki->kc", vectors, directions)
        part[alone] = 0.0
        turn = _turn_of(to_world)
        table = self._table(to_world, part) if turn is None else self._table_by_rows(turn, part)
        # The mean of a cosine that is cut at 0 over all normals is a quarter.
        return Irradiance(_of_mean(table, np.cos(_latitudes()), part @ self.light / 4), directions, bright)

    def _table_by_rows(self, turn: float, part: np.ndarray) -> np.ndarray:
        """The table of all cells by `part` of their light, in a world that is turned about its axis."""
        counted = self._by_columns * part.reshape(ROWS, COLUMNS).T[::-1, :, None, None]
        light = np.fft.rfft(counted.reshape(COLUMNS, 3 * ROWS, 3), axis=0)
        return np.fft.irfft(_facing_spectra(turn) @ light, COLUMNS, axis=0).transpose(1, 0, 2)

    def _table(self, to_world: np.ndarray, part: np.ndarray) -> np.ndarray:
        """The same in any world."""
        rest = np.flatnonzero(self._power * part)
        vectors, light = self.vectors[rest] @ to_world.T * part[rest, None, None], self.light[rest]
        normals = _directions(_latitudes(), _azimuths()).astype(np.float32)
        table = np.empty((len(normals), 3))
        for channel in range(3):
            # Negative light (worlds may subtract) falls on what faces away from its vector.
            sign = np.where(light[:, channel] < 0, -1.0, 1.0).astype(np.float32)
            across = np.ascontiguousarray(vectors[:, channel].T, np.float32) * sign
            for first in range(0, len(normals), PART):
                facing = normals[first : first + PART] @ across
                np.maximum(facing, 0.0, out=facing)
                table[first : first + PART, channel] = facing @ sign
        return table.reshape(ROWS + 1, COLUMNS, 3)


def _turn_of(to_world: np.ndarray) -> float | None:
    """By how much a world is turned about its axis; None where it is turned otherwise."""
    upright = np.allclose(to_world[2], (0.0, 0.0, 1.0), atol=1e-6) and np.linalg.det(to_world) > 0
    return round(float(np.arctan2(to_world[1, 0], to_world[0, 0])), 9) if upright else None


@lru_cache(maxsize=4)
def _facing_spectra(turn: float) -> np.ndarray:
    """(COLUMNS / 2 + 1, ROWS + 1, 3 x ROWS): of normals' components along the axes of cells above their horizon, by
    the difference of azimuths."""
    latitude = ((np.arange(ROWS) + 0.5) / ROWS - 0.5) * np.pi
    normals = _directions(_latitudes(), (np.arange(COLUMNS) - 0.5) / COLUMNS * 2 * np.pi - turn)
    along = np.einsum("nk,rak->nra", normals, _axes(latitude, np.zeros(1))[0])
    along[along[..., 0] <= 0.0] = 0.0
    return np.fft.rfft(along.reshape(ROWS + 1, COLUMNS, 3 * ROWS).transpose(1, 0, 2), axis=0)


def _latitudes() -> np.ndarray:
    return (np.arange(ROWS + 1) / ROWS - 0.5) * np.pi


def _azimuths() -> np.ndarray:
    return (np.arange(COLUMNS) / COLUMNS - 0.5) * 2 * np.pi


def _axes(latitude: np.ndarray, azimuth: np.ndarray) -> np.ndarray:
    """(columns, rows, 3, 3): unit vectors along radius, east and north."""
    shape = (len(azimuth), len(latitude))
    x, y = (np.broadcast_to(part[:, None], shape) for part in (np.cos(azimuth), np.sin(azimuth)))
    ring, z = (np.broadcast_to(part, shape) for part in (np.cos(latitude), np.sin(latitude)))
    axes = ((ring * x, ring * y, z), (-y, x, np.zeros(shape)), (-z * x, -z * y, ring))
    return np.stack([np.stack(axis, axis=-1) for axis in axes], axis=-2)


def _of_mean(table: np.ndarray, weight: np.ndarray, mean: np.ndarray) -> np.ndarray:
    """The table scaled by colour so that its mean, rows by their weight, is `mean`, from which it hardly differs."""
    own = (table.mean(axis=1) * weight[:, None]).sum(axis=0) / weight.sum()
    close = np.abs(own - mean) < 0.02 * np.abs(own)  # not where light of both signs cancels
    return table * np.where(close, mean / np.where(own == 0, 1.0, own), 1.0)


def _directions(latitude: np.ndarray, azimuth: np.ndarray) -> np.ndarray:
    """(rows x columns, 3)"""
    ring, z = np.cos(latitude)[:, None], np.repeat(np.sin(latitude)[:, None], len(azimuth), axis=1)
    return np.stack([ring * np.cos(azimuth), ring * np.sin(azimuth), z], axis=-1).reshape(-1, 3)
