"""The bright part of the world: directions that shine so much more than the rest that what they send through glass
is a caustic.

A direction belongs to it if its luminance is more than BRIGHT times the mean over all directions. Where that holds only
a few hundredths of the world's light (an even or overcast sky), there is none, and glass lets the world's light pass
straight: light that comes from all sides alike is not changed by clear glass, which only exchanges directions.
"""

from __future__ import annotations

import numpy as np

from .environment import Environment
from .lights import LUMINANCE

BRIGHT = 4.0
LEAST_SHARE = 0.05  # of the world's light
FINEST = 256  # rows of cells that an image is cut into at least


class BrightPart:
    """Directions of the bright part, drawn in proportion to their luminance."""

    def __init__(self, environment: Environment, threshold: float):
        height, width = environment.pixels.shape[:2]
        self._environment = environment
        self._finer = max(1, -(-FINEST // height))  # cells of a pixel along each side: radiance is interpolated
        self.threshold = threshold  # luminance, W / (m2 sr)
        rows, columns = height * self._finer, width * self._finer
        if self._finer == 1:
            self.cells = np.flatnonzero(self._luminance(environment.pixels) > threshold)
        else:
            self.cells = np.arange(rows * columns)
        self._shape = rows, columns
        self._solid_angle = environment._cell_solid_angle(rows, 1)[:, 0] / columns
        light = self._luminance(environment.lookup(self._in_map(self.cells, 0.5, 0.5)))
        held = light > threshold
        self.cells, light = self.cells[held], light[held]
        mass = light * self._solid_angle[self.cells // columns]
        self._edges = np.concatenate([[0.0], np.cumsum(mass)])
        self.light = float(self._edges[-1])  # integral of luminance over it
        # A cap of one radiance has its own solid angle.
        effective = self.light**2 / max(float((light * mass).sum()), 1e-300)
        self.half_angle = float(np.arccos(1.0 - min(effective, np.pi) / (2.0 * np.pi)))

    def _luminance(self, radiance: np.ndarray) -> np.ndarray:
        return np.maximum(radiance @ (LUMINANCE * self._environment.color), 0.0)

    def _in_map(self, cells: np.ndarray, up: float, across: float) -> np.ndarray:
        """Directions (..., 3) of the map's own frame at a place of cells."""
        rows, columns = self._shape
        low, high = (np.sin(((cells // columns + side) / rows - 0.5) * np.pi) for side in (0, 1))
        z = low + up * (high - low)
        azimuth = (0.5 - (cells % columns + across) / columns) * 2 * np.pi
        ring = np.sqrt(np.maximum(1.0 - z * z, 0.0))
        return np.stack([ring * np.cos(azimuth), ring * np.sin(azimuth), z], axis=-1)

    def holds(self, radiance: np.ndarray) -> np.ndarray:
        """Whether directions of this radiance (..., 3), as the world has it, belong to it."""
        return radiance @ LUMINANCE > self.threshold

    def draw(self, x: float, y: float) -> tuple[np.ndarray, np.ndarray]:
        """From two uniform numbers: a unit direction (3,), and the irradiance across it that it stands for (3,)."""
        place = x * self.light
        k = int(np.clip(np.searchsorted(self._edges, place, side="right") - 1, 0, len(self.cells) - 1))
        mass = self._edges[k + 1] - self._edges[k]
        in_map = self._in_map(self.cells[k], y, min(max((place - self._edges[k]) / mass, 0.0), 1.0))
        radiance = self._environment.lookup(in_map) * self._environment.color
        density = mass / (self.light * self._solid_angle[self.cells[k] // self._shape[1]])
        direction = self._environment._to_world @ in_map
        return direction / np.linalg.norm(direction), radiance / density


def bright_part(environment: Environment) -> BrightPart | None:
    """The bright part of this world; None where it has none."""
    if environment.power <= 0:
        return None
    luminance = np.maximum(environment.pixels @ (LUMINANCE * environment.color), 0.0)
    light = luminance * environment._cell_solid_angle(*luminance.shape)
    total = float(light.sum())
    threshold = BRIGHT * total / (4 * np.pi)
    if not light[luminance > threshold].sum() > LEAST_SHARE * total:
        return None
    found = BrightPart(environment, threshold)
    return found if found.light > 0 else None
