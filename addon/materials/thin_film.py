"""What colours see of waves that interfere in a thin film: a table by the difference of their paths.

A film reflects a wave of length l by a series of cosines of 2 pi m D / l, D the difference of the paths of what both
its faces reflect. A colour is the mean of that over the wavelengths, weighed by its matching function c(l); so of each
term it sees the Fourier transform S(mD) = integral of c(l) exp(-2 pi i m D / l) dl, over that of c. Cycles does so
from the same functions, those of the CIE (1931).

Source: Belcour & Barla, "A practical extension to microfacet theory for the modeling of varying iridescence", 2017.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from .sky import MATCHING, STEP_NM, XYZ_TO_RGB
from .working_space import current

PATHS = 512  # rows of the table
FARTHEST = 60000.0 / (2.0 * np.pi)  # of the differences of paths, nm; of farther ones no colour is left
SHORTEST = 380.0
FINER = 20  # parts into which the steps of the matching functions are cut


def sensitivity() -> np.ndarray:
    """(PATHS, 2, 3) float32: real and imaginary part of S for red, green and blue of the current working space, at
    differences of paths from 0 to FARTHEST."""
    return _sensitivity(current().name, current().from_rec709.tobytes())


@cache
def _sensitivity(space: str, turn: bytes) -> np.ndarray:
    to_rgb = np.frombuffer(turn).reshape(3, 3) @ XYZ_TO_RGB
    wavelengths, matching = _matching()
    colors = matching @ to_rgb.T
    colors = colors / colors.sum(axis=0)
    waves = np.exp(-2j * np.pi * np.linspace(0.0, FARTHEST, PATHS)[:, None] / wavelengths)
    found = waves @ colors
    return np.stack([found.real, found.imag], axis=1).astype(np.float32)


def _matching() -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths, nm, and the matching functions there, (count, 3): cubics through the tabulated ones."""
    values = np.pad(MATCHING, ((2, 2), (0, 0)))
    place = np.arange((len(values) - 3) * FINER) / FINER
    row, t = place.astype(int) + 1, (place % 1.0)[:, None]
    a, b, c, d = (values[row + step] for step in (-1, 0, 1, 2))
    cubic = b + 0.5 * t * (c - a + t * (2 * a - 5 * b + 4 * c - d + t * (3 * (b - c) + d - a)))
    return SHORTEST + STEP_NM * (place - 1.0), cubic
