"""A tile of grass blades as a mesh: seeded, tapering, bent strips, in three materials.

The tile repeats: blades may lean out of it, since a copy of it stands at each side. Lengths are metres.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SEGMENTS = 5
WIDTHS = (0.002, 0.005)  # m, of blades 0.1 m high
COLORS = ((0.045, 0.13, 0.018), (0.075, 0.17, 0.026), (0.23, 0.19, 0.065))  # two greens, and a dry one
SHARES = (0.5, 0.4, 0.1)
SOIL = (0.11, 0.075, 0.045)
TRANSLUCENT = 0.3  # share of the light that a blade passes on


@dataclass(frozen=True)
class Recipe:
    """What a tile is made of. `size` of its side and `height` of its longest blades in metres."""

    size: float = 0.25
    height: float = 0.1
    blades: int = 500
    seed: int = 1

    def __post_init__(self):
        if not (0.0 < self.height <= 4.0 * self.size) or not 1 <= self.blades <= 100_000:
            raise ValueError("A tile of grass needs a height up to 4 times its size, and 1 to 100,000 blades.")


@dataclass(frozen=True)
class Blades:
    """(V, 3) vertices in metres, (F, 4) corners and (F,) numbers of materials."""

    vertices: np.ndarray
    faces: np.ndarray
    materials: np.ndarray


def blades_of(recipe: Recipe) -> Blades:
    """The blades of a tile whose corner is the origin. None is higher than `recipe.height`."""
    rng = np.random.default_rng(recipe.seed)
    n = recipe.blades
    root = rng.random((n, 2)) * recipe.size
    turn = rng.random(n) * 2.0 * np.pi
    length = recipe.height * rng.uniform(0.5, 1.0, n)
    width = rng.uniform(*WIDTHS, n) * (recipe.height / 0.1)
    bend = rng.uniform(0.2, 0.8, n)
    twist = turn + 0.5 * np.pi + rng.normal(0.0, 0.3, n)
    material = np.searchsorted(np.cumsum(SHARES)[:-1], rng.random(n), side="right")
    along = np.linspace(0.0, 1.0, SEGMENTS + 1)
    out = (length * bend)[:, None] * along**2  # a parabola: upright at the root
    up = length[:, None] * along * np.sqrt(np.maximum(1.0 - 0.45 * (bend[:, None] * along) ** 2, 0.1))
    centre = np.stack(
        [root[:, :1] + out * np.cos(turn)[:, None], root[:, 1:] + out * np.sin(turn)[:, None], up], axis=-1
    )
    half = 0.5 * width[:, None] * np.maximum(1.0 - along**1.5, 0.06)
    across = np.stack([np.cos(twist), np.sin(twist), np.zeros(n)], axis=-1)[:, None, :] * half[..., None]
    vertices = np.stack([centre - across, centre + across], axis=2)  # (n, SEGMENTS + 1, 2, 3)
    first = (np.arange(n) * 2 * (SEGMENTS + 1))[:, None] + 2 * np.arange(SEGMENTS)[None, :]
    faces = np.stack([first, first + 1, first + 3, first + 2], axis=-1)
    return Blades(vertices.reshape(-1, 3), faces.reshape(-1, 4), np.repeat(material, SEGMENTS))
