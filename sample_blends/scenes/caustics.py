"""Three scenes whose light comes by way of glass, water and metal: a set table, a pool in the sun, rings on a desk.

What they test: light that specular surfaces focus on diffuse ones (the slot `caustics`), and the shadows of what throws
it. Without that slot, glass casts grey straight shadows and metal casts nothing.
"""

import numpy as np

from .construct import camera, diffuse, glossy, light, principled, solid, world
from .shapes import ball, box, grid, lathe, plane, ring


def glass(name: str, color=(1.0, 1.0, 1.0), ior: float = 1.45):
    return principled(name, color, roughness=0.0, Transmission_Weight=1.0, IOR=ior)


def build_table() -> None:
    """A tumbler, a ball and a decanter under one lamp."""
    solid("Table", plane(3.0, 3.0), diffuse("Linen", (0.72, 0.68, 0.60)))
    solid("Wall", box(3.0, 0.1, 2.0).moved(y=1.3), diffuse("Wall", (0.55, 0.58, 0.62)))
    solid("Ball", ball(0.16, 64, 32).moved(z=0.161), glass("Crystal", ior=1.6), smooth_below=60,
          location=(-0.42, -0.1, 0))  # fmt: skip
    tumbler = [(0, 0.002), (0.11, 0.002), (0.13, 0.30), (0.12, 0.30), (0.102, 0.03), (0, 0.03)]
    solid("Tumbler", lathe(tumbler, 64), glass("Glass", (0.95, 1.0, 0.97)), smooth_below=40, location=(0.05, 0.15, 0))
    decanter = [(0, 0.002), (0.14, 0.002), (0.17, 0.06), (0.16, 0.16), (0.05, 0.28), (0.045, 0.40), (0, 0.40)]
    solid("Decanter", lathe(decanter, 64), glass("Amber", (1.0, 0.66, 0.22)), smooth_below=50,
          location=(0.48, -0.05, 0))  # fmt: skip
    light("Lamp", "SPOT", (1.3, 0.9, 1.9), (0.05, 0, 0.1), energy=160, shadow_soft_size=0.03, spot_size=0.9,
          spot_blend=0.3)  # fmt: skip
    world((0.02, 0.025, 0.03))
    camera((-0.2, -1.9, 1.15), (0, 0.05, 0.1), lens=38)


def build_pool() -> None:
    """Waves over a tiled basin, in low sun."""
    solid("Ground", plane(4.0, 4.0).moved(z=-0.8), diffuse("Tiles", (0.42, 0.66, 0.70)))
    side = diffuse("Basin", (0.66, 0.72, 0.72))
    for name, x, y, width, depth in (
        ("Left", -2.05, 0, 0.1, 4.2), ("Right", 2.05, 0, 0.1, 4.2), ("Back", 0, 2.05, 4.0, 0.1),
    ):  # fmt: skip
        solid(name, box(width, depth, 1.1).moved(x=x, y=y, z=-0.8), side)

    def surface(u, v):
        x, y = 4.0 * (u - 0.5), 4.0 * (v - 0.5)
        height = (
            0.02 * np.sin(5.0 * x + 1.0 * y) + 0.016 * np.sin(3.0 * x - 6.0 * y) + 0.008 * np.sin(11.0 * y + 4.0 * x)
        )
        return np.stack([x, y, height], axis=-1)

    solid("Water", grid(120, 120, surface), glass("Water", (0.97, 1.0, 1.0), ior=1.33), smooth_below=180)
    solid("Post", box(0.25, 0.25, 1.4).moved(x=0.9, y=0.7, z=-0.8), diffuse("Post", (0.75, 0.45, 0.28)))
    light("Sun", "SUN", (0, 0, 5), (-2.4, 1.2, 0), energy=4.0, angle=0.009)
    world((0.12, 0.18, 0.26))
    camera((-0.6, -4.6, 2.6), (0, 0.2, -0.5), lens=32)


def build_rings() -> None:
    """A metal ring and a wine glass on a desk."""
    solid("Desk", plane(2.0, 2.0), diffuse("Desk", (0.58, 0.44, 0.32)))
    wide = [(0.20, 0.0), (0.215, 0.0), (0.215, 0.09), (0.20, 0.09), (0.20, 0.0)]
    solid("Band", lathe(wide, 128), glossy("Silver", (0.95, 0.93, 0.88), 0.0), smooth_below=40, location=(-0.28, 0, 0))
    solid("Ring", ring(0.10, 0.018, 96, 16).moved(z=0.018), principled("Gold", (1.0, 0.72, 0.30), 0.08, 1.0),
          smooth_below=60, location=(-0.28, -0.02, 0))  # fmt: skip
    cup = [
        (0, 0.002), (0.10, 0.002), (0.10, 0.008), (0.014, 0.02), (0.010, 0.15), (0.03, 0.17), (0.10, 0.24),
        (0.105, 0.32), (0.085, 0.42), (0.081, 0.42), (0.10, 0.32), (0.095, 0.245), (0.02, 0.18), (0, 0.178),
    ]  # fmt: skip
    solid("Wine Glass", lathe(cup, 96), glass("Goblet", ior=1.5), smooth_below=50, location=(0.26, 0.08, 0))
    light("Lamp", "SPOT", (0.75, 0.55, 0.95), (0, 0, 0.05), energy=40, shadow_soft_size=0.012, spot_size=1.1,
          spot_blend=0.2)  # fmt: skip
    world((0.02, 0.02, 0.022))
    camera((-0.05, -1.15, 0.85), (0, 0.02, 0.08), lens=38)
