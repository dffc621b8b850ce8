"""A hall between two colonnades, lit by a sun that comes in at one side.

What it tests: indirect light far from where it enters. The sun reaches part of the floor and a few columns; vault,
aisles and the far wall live on several reflections. Columns hide most of the hall from any one point.
"""

import numpy as np

from .construct import camera, collection, diffuse, light, mesh, place, solid, world
from .shapes import arch, box, join, lathe, plane

BAYS = 6
BAY = 3.0  # metres from column to column
HALF_NAVE = 2.6  # from the middle of the hall to the columns
AISLE = 2.4
SPRING, HEIGHT = 3.2, 6.2
LENGTH = BAYS * BAY


def build() -> None:
    stone = diffuse("Limestone", (0.62, 0.55, 0.45))
    plaster = diffuse("Plaster", (0.72, 0.69, 0.63))
    red = diffuse("Red Cloth", (0.52, 0.05, 0.04))
    blue = diffuse("Blue Cloth", (0.06, 0.12, 0.42))
    tiles = diffuse("Floor Tiles", (0.42, 0.36, 0.30))
    build_shell(plaster, tiles)
    build_columns(stone)
    build_cloths(red, blue)
    light("Sun", "SUN", (9, 0, 12), (0, 1.0, 0), 9.0, (1.0, 0.92, 0.8), angle=np.radians(1.5))
    world((0.35, 0.5, 0.8), 0.6)
    camera((-0.9, -LENGTH / 2 + 0.7, 1.7), (0.5, 3.0, 2.3), lens=24)


def build_shell(plaster, tiles) -> None:
    """Floor, outer walls, ends and roofs. The side towards the sun is open between its piers."""
    into = collection("Shell")
    width = 2 * (HALF_NAVE + AISLE)
    solid("Floor", plane(width + 6, LENGTH + 2), tiles, into=into)
    solid("Dark Side", box(0.3, LENGTH, HEIGHT).moved(x=-HALF_NAVE - AISLE - 0.15), plaster, into=into)
    piers = [box(0.5, 0.9, SPRING + 0.6).moved(HALF_NAVE + AISLE + 0.25, y) for y in bay_ends()]
    solid("Bright Side Piers", join(piers), plaster, into=into)
    ends = [box(width + 1.0, 0.3, HEIGHT).moved(y=side * (LENGTH / 2 + 0.15)) for side in (-1, 1)]
    solid("End Walls", join(ends), plaster, into=into)
    roof = box(2 * HALF_NAVE + 0.7, LENGTH, 0.25).moved(z=HEIGHT)
    aisles = [box(AISLE + 0.6, LENGTH, 0.25).moved(side * (HALF_NAVE + AISLE / 2), z=SPRING + 0.6) for side in (-1, 1)]
    solid("Roofs", join([roof, *aisles]), plaster, into=into)
    clerestory = [box(0.3, LENGTH, 0.9).moved(side * HALF_NAVE, z=HEIGHT - 0.9) for side in (-1, 1)]
    solid("Clerestory", join(clerestory), plaster, into=into)


def bay_ends() -> np.ndarray:
    return (np.arange(BAYS + 1) - BAYS / 2) * BAY


def build_columns(stone) -> None:
    into = collection("Colonnades")
    profile = [(0, 0), (0.42, 0), (0.42, 0.16), (0.33, 0.2), (0.36, 0.3), (0.29, 0.36), (0.25, 2.7), (0.31, 2.78),
               (0.29, 2.86), (0.42, 3.08), (0.42, SPRING), (0, SPRING)]  # fmt: skip
    column = mesh("Column", lathe(profile, 20), stone, smooth_below=40)
    span = mesh("Arch", arch(BAY, 1.75, 2.3, 0.35, 0.5, 12), stone, smooth_below=40)
    for side, label in ((-1, "Dark"), (1, "Bright")):
        for number, y in enumerate(bay_ends()):
            place(column, f"{label} Column {number + 1}", location=(side * HALF_NAVE, y, 0), into=into)
        for number, y in enumerate(bay_ends()[:-1] + BAY / 2):
            spot = (side * HALF_NAVE, y, SPRING)
            place(span, f"{label} Arch {number + 1}", location=spot, rotation_degrees=(0, 0, 90), into=into)


def build_cloths(red, blue) -> None:
    into = collection("Cloths")
    for number, (y, cloth) in enumerate(((-4.5, red), (1.5, blue), (4.5, red))):
        hanging = box(0.04, 1.3, 2.2).moved(-HALF_NAVE + 0.1, y, SPRING - 0.6)
        solid(f"Cloth {number + 1}", hanging, cloth, into=into)
