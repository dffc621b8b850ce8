"""Write addon/materials/spectra.npz: the colours of Cycles' Blackbody and Wavelength nodes, in each working space.

Each value is one pixel of a picture by Cycles: an emission of the node's colour on a tile. Needs Blender 5.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import bpy
import numpy as np

from addon.compare.reference import render_passes
from addon.materials.spectra import BLACKBODY, TABLE, WAVELENGTH
from addon.materials.working_space import REC709, SPACES
from bench.node_cases import Case, tile_scene


def measured(cases: list[Case], space: str) -> np.ndarray:
    """(cases, 3) radiance in the middle of each tile."""
    scene, side = tile_scene(cases)
    bpy.ops.wm.set_working_color_space(working_space=space, convert_colors=False)
    emission = render_passes(scene, "CYCLES", 1, size=(side * 4, side * 4), direct_only=True).images["emission"]
    return np.array([emission[4 * (n // side) + 1, 4 * (n % side) + 1, :3] for n in range(len(cases))], np.float32)


def main() -> None:
    kelvin = [Case("", "Blackbody", "Color", {}, {"Temperature": 1.0 / place}) for place in BLACKBODY.places()]
    tables = {}
    for space in SPACES:
        end = "" if space == REC709 else f" {space}"
        tables[f"blackbody{end}"] = measured(kelvin, space)
        tables[f"wavelength{end}"] = unclamped_wavelengths(space)
    np.savez_compressed(TABLE, **tables)


def unclamped_wavelengths(space: str) -> np.ndarray:
    """(81, 3) colours of wavelengths before Cycles cuts what is negative, which it does after interpolation.

    Between rows Cycles' colours are straight lines. Where a row is cut and its neighbour is not, the line from the
    neighbour, known by a point one nanometre off it, tells how far below zero the row is.
    """
    places = WAVELENGTH.places()
    at, before, behind = (
        measured([Case("", "Wavelength", "Color", {}, {"Wavelength": place + step}) for place in places], space)
        for step in (0.0, -1.0, 1.0)
    )
    rows = at.copy()
    for row in range(len(places)):
        for neighbour, beside in ((row - 1, behind), (row + 1, before)):
            if 0 <= neighbour < len(places):
                line = 5.0 * beside[neighbour] - 4.0 * at[neighbour]  # five steps from the neighbour
                cut = (at[row] == 0.0) & (at[neighbour] > 0.0) & (beside[neighbour] > 0.0)
                rows[row] = np.where(cut, np.minimum(line, 0.0), rows[row])
    return rows


main()
