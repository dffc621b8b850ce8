"""Write addon/materials/spectra.npz: the colours that Cycles' Blackbody and Wavelength nodes give.

Each value is one pixel of a picture by Cycles: an emission of the node's colour on a tile.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

from addon.compare.reference import render_passes
from addon.materials.spectra import BLACKBODY, TABLE, WAVELENGTH
from bench.node_cases import Case, tile_scene


def measured(cases: list[Case]) -> np.ndarray:
    """(cases, 3) radiance in the middle of each tile."""
    scene, side = tile_scene(cases)
    emission = render_passes(scene, "CYCLES", 1, size=(side * 4, side * 4), direct_only=True).images["emission"]
    return np.array([emission[4 * (n // side) + 1, 4 * (n % side) + 1, :3] for n in range(len(cases))], np.float32)


def main() -> None:
    kelvin = [Case("", "Blackbody", "Color", {}, {"Temperature": 1.0 / place}) for place in BLACKBODY.places()]
    nanometres = [Case("", "Wavelength", "Color", {}, {"Wavelength": place}) for place in WAVELENGTH.places()]
    np.savez_compressed(TABLE, blackbody=measured(kelvin), wavelength=measured(nanometres))


main()
