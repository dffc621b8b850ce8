"""The world as a few area lights: rectangles grown greedily on the faces of a cube over its energy.

The energy of a cube texel is radiance times solid angle. On each quarter of a face a light starts at the strongest
texel that no light has yet; in turn each side is pushed out by a texel, as long as that brings more than the share `t`
of the grown light's energy. The light takes what it covers, and the next one starts, until the quarter is covered: the
sum over the lights is the sum over the map. `t` is found by bisection so that the lights are at most as many as asked
for.

Against the source: lights do not overlap (there a part of the energy stays behind for others), are rectangles, and
quarters of faces bound them, since one depth map stands for each. A light points to the centroid of its energy and is
as wide as its energy is spread, Omega = (sum L dOmega)^2 / sum L^2 dOmega over the map's own pixels, so that a sun
within one texel keeps its sharp shadow.

Cost: once per world, on the CPU, below a second. Source: Annen et al., "Real-time, all-frequency shadows in dynamic
scenes", SIGGRAPH 2008.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .lights import LUMINANCE

SIDE = 32  # texels of a cube face
QUARTER = SIDE // 2  # no light is wider
LEAST_ROWS, MOST_ROWS = 128, 512  # of the map from which texels are summed


@dataclass(frozen=True)
class AreaLight:
    """A distant light of one colour and of the shape of a cone."""

    direction: np.ndarray  # (3,) unit, towards the light
    solid_angle: float  # steradians
    energy: np.ndarray  # (3,) radiance times solid angle

    @property
    def half_angle(self) -> float:
        """Of a cone of the same solid angle."""
        return float(2 * np.arcsin(np.sqrt(min(self.solid_angle / (4 * np.pi), 1.0))))


@dataclass(frozen=True)
class CubeEnergy:
    """Sums over the pixels of the map by cube texel, (6, SIDE, SIDE, …)."""

    color: np.ndarray  # (…, 3) radiance x solid angle
    power: np.ndarray  # luminance of that
    moment: np.ndarray  # (…, 3) luminance x solid angle x direction
    square: np.ndarray  # luminance squared x solid angle


def cube_energy(pixels: np.ndarray, to_map: np.ndarray) -> CubeEnergy:
    """From an equirectangular map (H, W, 3), row 0 at the bottom; `to_map` turns world directions into the map's."""
    pixels = _resized(np.maximum(pixels, 0.0))
    height, width = pixels.shape[:2]
    edges = np.sin((np.arange(height + 1) / height - 0.5) * np.pi)
    solid_angle = np.repeat(np.diff(edges)[:, None] * (2 * np.pi / width), width, axis=1)
    z = (edges[1:] + edges[:-1])[:, None] / 2
    azimuth = (0.5 - (np.arange(width) + 0.5) / width)[None] * 2 * np.pi
    ring = np.sqrt(1 - z * z)
    in_map = np.stack(np.broadcast_arrays(ring * np.cos(azimuth), ring * np.sin(azimuth), z), axis=-1)
    direction = (in_map @ to_map).reshape(-1, 3)  # the inverse of a rotation is its transpose
    texel = _texel_of(direction)
    luminance = (pixels @ LUMINANCE).ravel()
    weight = solid_angle.ravel()

    def summed(values: np.ndarray) -> np.ndarray:
        flat = values.reshape(len(texel), -1)
        sums = [np.bincount(texel, column, 6 * SIDE * SIDE) for column in flat.T]
        return np.stack(sums, axis=-1).reshape(6, SIDE, SIDE, -1)

    power = luminance * weight
    return CubeEnergy(
        summed(pixels.reshape(-1, 3) * weight[:, None]),
        summed(power)[..., 0],
        summed(direction * power[:, None]),
        summed(luminance * power)[..., 0],
    )


def fit(energy: CubeEnergy, budget: int) -> list[AreaLight]:
    """At most `budget` lights, but at least one per quarter of a face that has energy; together all of the map's."""
    low, high, best = 1e-3, 0.5, None
    for _ in range(8):
        t = np.sqrt(low * high)
        found = _fit_all(energy, t, budget)
        if found is None:
            high = t
        else:
            low, best = t, found
    best = best or _fit_all(energy, 1e-3, 10**9)
    return [_light(energy, box) for box in best if energy.power[box].sum() > 0]


def _fit_all(energy: CubeEnergy, t: float, budget: int) -> list | None:
    """Index arrays (face, rows, columns) of the texels of each light; None if they are more than the budget."""
    lights = []
    for face, top, left in np.ndindex(6, 2, 2):
        first = top * QUARTER, left * QUARTER
        power = energy.power[face, first[0] : first[0] + QUARTER, first[1] : first[1] + QUARTER]
        if power.any():
            grown = _fit_quarter(power, t, budget - len(lights))
            if grown is None:
                return None
            lights += [(np.full(len(rows), face), rows + first[0], columns + first[1]) for rows, columns in grown]
    return lights


def _fit_quarter(power: np.ndarray, t: float, budget: int) -> list | None:
    """Rows and columns of the texels of each light on a quarter of a face."""
    rest, free, lights = power.copy(), np.ones(power.shape, bool), []
    while free.any():
        if len(lights) >= budget:
            return None
        y, x = np.unravel_index(np.argmax(np.where(free, rest, -1.0)), rest.shape)
        low, high = [int(y), int(x)], [int(y) + 1, int(x) + 1]
        total, grew = rest[y, x], True
        while grew:
            grew = False
            for axis in (0, 1):
                for end, step in ((low, -1), (high, 1)):
                    if not 0 <= end[axis] + step <= QUARTER:
                        continue
                    end[axis] += step
                    grown = rest[low[0] : high[0], low[1] : high[1]].sum()
                    # Without any light left, all that is free becomes one light of no energy.
                    if grown - total > t * grown or not rest.any():
                        total, grew = grown, True
                    else:
                        end[axis] -= step
        rows, columns = np.nonzero(free[low[0] : high[0], low[1] : high[1]])
        lights.append((rows + low[0], columns + low[1]))
        rest[low[0] : high[0], low[1] : high[1]] = 0.0
        free[low[0] : high[0], low[1] : high[1]] = False
    return lights


def _light(energy: CubeEnergy, texels) -> AreaLight:
    moment = energy.moment[texels].sum(axis=0)
    solid_angle = energy.power[texels].sum() ** 2 / energy.square[texels].sum()
    return AreaLight(moment / np.linalg.norm(moment), float(solid_angle), energy.color[texels].sum(axis=0))


def _texel_of(direction: np.ndarray) -> np.ndarray:
    """Flat index of the cube texel that each direction (N, 3) meets."""
    axis = np.abs(direction).argmax(axis=1)
    along = np.take_along_axis(direction, axis[:, None], 1)[:, 0]
    u = np.take_along_axis(direction, (axis[:, None] + 1) % 3, 1)[:, 0] / np.abs(along)
    v = np.take_along_axis(direction, (axis[:, None] + 2) % 3, 1)[:, 0] / np.abs(along)
    column, row = (np.clip((w * 0.5 + 0.5) * SIDE, 0, SIDE - 1).astype(int) for w in (u, v))
    return ((2 * axis + (along < 0)) * SIDE + row) * SIDE + column


def _resized(pixels: np.ndarray) -> np.ndarray:
    """Repeated or averaged over whole blocks, so that cube texels get pixels and the sums are quick."""
    height, width = pixels.shape[:2]
    repeat = -(-LEAST_ROWS // height), -(-2 * LEAST_ROWS // width)
    pixels = np.repeat(np.repeat(pixels, repeat[0], axis=0), repeat[1], axis=1)
    height, width = pixels.shape[:2]
    rows, columns = max(height // MOST_ROWS, 1), max(width // (2 * MOST_ROWS), 1)
    if rows * columns == 1 or height % rows or width % columns:
        return pixels
    # Solid angle falls towards the poles within a block, too.
    weight = np.diff(np.sin((np.arange(height + 1) / height - 0.5) * np.pi))
    weighted = (pixels * weight[:, None, None]).reshape(height // rows, rows, width // columns, columns, 3)
    return weighted.sum(axis=(1, 3)) / (weight.reshape(-1, rows).sum(axis=1)[:, None, None] * columns)
