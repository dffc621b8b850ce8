"""A meadow over gentle hills with a ball, stones and posts in the sun: grass that is a picture, not blades.

What it tests: things that stand in grass, their shadows on it, its outline on hills, and distance. Cycles, which does
not know the patch, shows the ground.
"""

import sys
from pathlib import Path

import numpy as np

from .construct import camera, diffuse, light, solid, world
from .shapes import ball, box, grid

GROUND = (0.11, 0.075, 0.045)


def height(x, y):
    """Metres above the valley."""
    return 0.35 * np.sin(0.55 * x + 0.4) * np.cos(0.42 * y) + 0.9 / (1.0 + np.exp(-(y - 7.0))) + 0.03 * x


def build() -> None:
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent.parent))
    from addon.ui import properties

    if not hasattr(properties.bpy.types.Material, "candela"):
        properties.register()

    def surface(u, v):
        x, y = 24.0 * (u - 0.5), 24.0 * v - 4.0
        return np.stack([x, y, height(x, y)], axis=-1)

    soil = diffuse("Meadow", GROUND)
    soil.candela.grass_patch = "MEADOW"
    solid("Meadow", grid(96, 96, surface), soil, smooth_below=180)

    def at(x, y, above=0.0):
        return (x, y, float(height(x, y)) + above)

    solid("Ball", ball(0.11, 32, 16), diffuse("Ball", (0.75, 0.74, 0.7)), smooth_below=60, location=at(-0.25, 1.0, 0.1))
    stone = diffuse("Stone", (0.33, 0.31, 0.29))
    for k, (x, y, size) in enumerate(((0.7, 1.7, 0.3), (0.95, 1.45, 0.16), (-1.5, 3.2, 0.45))):
        solid(f"Stone {k + 1}", ball(size, 12, 7), stone, smooth_below=50, location=at(x, y, 0.15 * size))
    wood = diffuse("Wood", (0.36, 0.24, 0.14))
    for k in range(7):
        x, y = -4.5 + 1.5 * k, 5.2 + 0.15 * k
        solid(f"Post {k + 1}", box(0.1, 0.1, 1.0), wood, location=at(x, y, -0.05))
    light("Sun", "SUN", (0, 0, 8), (-3.0, 2.5, 2.0), energy=3.2, angle=0.009, color=(1.0, 0.94, 0.84))
    world((0.32, 0.45, 0.70))
    camera((0.1, -2.0, float(height(0.1, -2.0)) + 1.45), (0.0, 2.6, 0.35), lens=32)
