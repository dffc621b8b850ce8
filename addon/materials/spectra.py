"""Colours of glowing bodies and of single wavelengths as Blender has them; `tools/measure_spectra.py` wrote the table.

A black body's colour runs evenly over the reciprocal of its temperature (Wien's law puts its peak there); below 800 K
and above 12000 K Blender's own fit stays at its ends. Wavelengths stand 5 nm apart, as in the CIE's tables.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from .working_space import current

TABLE = Path(__file__).with_name("spectra.npz")


@dataclass(frozen=True)
class Spectrum:
    """A table of scene-linear colours over [start, start + extent]."""

    name: str
    start: float
    extent: float
    count: int

    def places(self) -> np.ndarray:
        """(count,) what the rows stand for."""
        return self.start + self.extent * np.arange(self.count) / (self.count - 1)

    def rows(self) -> list[tuple[float, float, float, float]]:
        """In the current working space."""
        space = current()
        stored = _colors()[self.name if space.usual else f"{self.name} {space.name}"]
        return [(*map(float, color), 1.0) for color in stored]


BLACKBODY = Spectrum("blackbody", 1.0 / 12000.0, 1.0 / 800.0 - 1.0 / 12000.0, 129)  # over 1 / kelvin
WAVELENGTH = Spectrum("wavelength", 380.0, 400.0, 81)  # over nanometres


@cache
def _colors() -> dict[str, np.ndarray]:
    with np.load(TABLE) as stored:
        return {name: stored[name] for name in stored.files}
