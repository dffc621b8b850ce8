"""Textures as numbers: light environments, wood, leaves. Arrays are (H, W, channels), bottom row first.

Light is in radiance; colour for surfaces is sRGB-encoded, as an 8-bit image stores it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


def smoothstep(low: float, high: float, x: np.ndarray) -> np.ndarray:
    t = np.clip((x - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def encode(linear) -> np.ndarray:
    """Linear light to the sRGB curve."""
    linear = np.clip(np.asarray(linear, float), 0, 1)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def blend(low, high, share: np.ndarray) -> np.ndarray:
    """Between two colours, per pixel."""
    return np.asarray(low) + (np.asarray(high) - np.asarray(low)) * share[..., None]


# Environments


def sphere_directions(height: int) -> np.ndarray:
    """Unit directions (height, 2 height, 3) of an equirectangular image's pixel centres, as Blender maps them."""
    azimuth = -((np.arange(2 * height) + 0.5) / (2 * height) - 0.5) * 2 * np.pi
    elevation = ((np.arange(height) + 0.5) / height - 0.5) * np.pi
    azimuth, elevation = np.meshgrid(azimuth, elevation)
    level = np.cos(elevation)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], axis=-1)


@dataclass(frozen=True)
class Softbox:
    """A glowing rectangle or disc far away, with edges that fade over `fade` degrees."""

    azimuth: float  # degrees, counter-clockwise from +x
    elevation: float  # degrees above the horizon
    width: float  # degrees
    height: float  # degrees
    radiance: tuple[float, float, float]
    fade: float = 3.0
    is_round: bool = False

    def glow(self, directions: np.ndarray) -> np.ndarray:
        a, e = np.radians(self.azimuth), np.radians(self.elevation)
        front = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        up = np.cross(front, right)
        depth = directions @ front
        safe = np.maximum(depth, 1e-3)
        x = np.degrees(np.arctan(np.abs(directions @ right) / safe)) / (self.width / 2)
        y = np.degrees(np.arctan(np.abs(directions @ up) / safe)) / (self.height / 2)
        edge = np.hypot(x, y) if self.is_round else np.maximum(x, y)
        fade = 2 * self.fade / min(self.width, self.height)
        share = (1 - smoothstep(1 - fade, 1, edge)) * (depth > 0)
        return share[..., None] * np.array(self.radiance)


def studio(height: int, boxes: list[Softbox], floor, ceiling) -> np.ndarray:
    """A dim room that runs from one colour at the floor to another at the ceiling, and the boxes in it."""
    directions = sphere_directions(height)
    light = blend(floor, ceiling, smoothstep(-0.6, 1.0, directions[..., 2]))
    for box in boxes:
        light = light + box.glow(directions)
    return light


def sky(height: int, zenith, horizon, ground, glow, glow_azimuth: float) -> np.ndarray:
    """A clear sky with a brighter, wide glow at one azimuth (degrees), above plain ground."""
    directions = sphere_directions(height)
    up = directions[..., 2]
    light = blend(horizon, zenith, np.clip(up, 0, 1) ** 0.55)
    a = np.radians(glow_azimuth)
    nearness = np.clip(directions @ np.array([np.cos(a), np.sin(a), 0.25]) / np.hypot(1, 0.25), 0, 1)
    light = light + nearness[..., None] ** 6 * np.array(glow)
    return blend_images(np.broadcast_to(np.array(ground), light.shape), light, smoothstep(-0.03, 0.03, up))


def blend_images(low: np.ndarray, high: np.ndarray, share: np.ndarray) -> np.ndarray:
    return low + (high - low) * share[..., None]


# Surfaces


def noise(shape: tuple[int, int], cells: tuple[int, int], random: np.random.Generator) -> np.ndarray:
    """Smooth random values in [0, 1] that repeat at the edges; `cells` lattice points down and across."""
    lattice = random.random(cells)

    def steps(size: int, count: int):
        position = np.arange(size) * count / size
        low = position.astype(int)
        return low, (low + 1) % count, smoothstep(0, 1, position - low)

    y0, y1, v = steps(shape[0], cells[0])
    x0, x1, u = steps(shape[1], cells[1])
    low = lattice[y0][:, x0] * (1 - u) + lattice[y0][:, x1] * u
    high = lattice[y1][:, x0] * (1 - u) + lattice[y1][:, x1] * u
    return low * (1 - v[:, None]) + high * v[:, None]


def planks(size: int, rows: int, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Floor boards along u that tile: colour, and roughness in [0, 1]."""
    y, x = np.mgrid[0:size, 0:size] / size
    row = (y * rows).astype(int)
    joint = random.random(rows)[row]  # where along u each row's boards end; two boards to a row
    along = (x - joint) % 1.0
    board = row * 2 + (along > 0.5)
    tone = random.random(2 * rows)[board]
    hue = random.random(2 * rows)[board]
    drift = noise((size, size), (rows * 3, 4), random) + 0.5 * noise((size, size), (rows * 6, 12), random)
    rings = 0.5 + 0.5 * np.sin((y * rows * 5.5 + 1.7 * drift + 9.0 * tone) * 2 * np.pi)
    fibre = noise((size, size), (size // 3, 10), random)
    value = 0.62 + 0.22 * (tone - 0.5) - 0.13 * rings**2 - 0.12 * (fibre - 0.5)
    color = blend((0.30, 0.15, 0.07), (0.66, 0.42, 0.22), np.clip((value - 0.3) / 0.5, 0, 1))
    color = color * blend((1.0, 0.94, 0.88), (0.94, 1.0, 1.02), hue)
    to_edge = np.minimum(np.abs((y * rows) % 1.0 - 0.5) * -1 + 0.5, 0.5) / rows
    to_end = np.minimum(along % 0.5, 0.5 - along % 0.5)
    gap = np.minimum(smoothstep(0.0005, 0.0035, to_edge), smoothstep(0.0005, 0.0030, to_end))
    rough = 0.34 + 0.14 * rings + 0.10 * fibre + 0.3 * (1 - gap)
    return encode(color * (0.25 + 0.75 * gap[..., None])), np.clip(rough, 0, 1)


def rug(height: int, width: int) -> np.ndarray:
    """A woven rug of stripes and stepped diamonds."""
    y, x = np.mgrid[0:height, 0:width] / width
    y = np.floor(y * 64) / 64
    x = np.floor(x * 64) / 64
    diamonds = np.abs((x * 4) % 1 - 0.5) + np.abs((y * 4) % 1 - 0.5)
    indigo, madder, wool, ochre = (0.07, 0.11, 0.22), (0.42, 0.09, 0.06), (0.66, 0.58, 0.45), (0.55, 0.32, 0.08)
    color = np.broadcast_to(np.array(madder), (height, width, 3)).copy()
    color[diamonds < 0.40] = wool
    color[diamonds < 0.28] = indigo
    color[diamonds < 0.12] = ochre
    border = np.minimum(np.minimum(x, 1 - 1 / 64 - x), np.minimum(y, y.max() - y))
    color[border < 0.09] = indigo
    color[border < 0.06] = wool
    color[border < 0.03] = madder
    thread = 0.92 + 0.08 * ((np.mgrid[0:height, 0:width].sum(0)) % 2)
    return encode(color * thread[..., None])


def painting(height: int, width: int) -> np.ndarray:
    """Hills in layers under a low sun."""
    y, x = np.mgrid[0:height, 0:width] / np.array([height, width])[:, None, None]
    color = blend((0.92, 0.62, 0.34), (0.22, 0.42, 0.52), smoothstep(0.35, 1.0, y))
    sun = np.hypot((x - 0.66) * width / height, y - 0.62)
    color = blend_images(color, np.broadcast_to((0.98, 0.86, 0.62), color.shape), 1 - smoothstep(0.115, 0.125, sun))
    layers = [(0.52, 0.06, 2.2, 0.4, (0.55, 0.40, 0.38)), (0.40, 0.07, 1.6, 2.1, (0.30, 0.27, 0.33)),
              (0.26, 0.06, 2.9, 4.0, (0.14, 0.17, 0.22)), (0.12, 0.05, 1.9, 5.2, (0.06, 0.08, 0.10))]  # fmt: skip
    for level, swing, waves, phase, hill in layers:
        ridge = level + swing * np.sin(waves * 2 * np.pi * x + phase) + 0.3 * swing * np.sin(7 * waves * x + phase)
        share = 1 - smoothstep(-0.004, 0.004, y - ridge)
        color = blend_images(color, np.broadcast_to(hill, color.shape), share)
    return encode(color)


# Leaves: (H, W, 4) with straight alpha


@dataclass(frozen=True)
class Leaf:
    """One leaf of a drawn spray, in units of the image's width: it grows from (x, y) along `angle` degrees."""

    x: float
    y: float
    angle: float
    length: float
    width: float  # half of it
    tone: float  # 0 dark … 1 light
    blunt: float = 0.75  # below 1: broadest near the stalk; above: near the tip


def draw_leaves(height: int, width: int, leaves: list[Leaf], dark, light, vein) -> np.ndarray:
    """Paint leaves over each other; where none covers, alpha is 0 and the colour their mean, so edges stay clean."""
    y, x = np.mgrid[0:height, 0:width]
    x, y = (x + 0.5) / width, (y + 0.5) / width
    color = np.broadcast_to((np.array(dark) + np.array(light)) / 2, (height, width, 3)).copy()
    alpha = np.zeros((height, width))
    for leaf in leaves:
        c, s = np.cos(np.radians(leaf.angle)), np.sin(np.radians(leaf.angle))
        along = ((x - leaf.x) * c + (y - leaf.y) * s) / leaf.length
        across = (y - leaf.y) * c - (x - leaf.x) * s
        inside = np.clip(along, 0, 1)
        half = leaf.width * np.sin(np.pi * inside**leaf.blunt) ** 0.85
        share = smoothstep(-1.0, 1.0, (half - np.abs(across)) * width) * (along > 0) * (along < 1)
        tint = blend(dark, light, np.clip(leaf.tone + 0.25 * np.sign(across) * 0.5 - 0.15 * along, 0, 1))
        middle = np.exp(-((across * width / 1.3) ** 2))
        ribs = 0.35 * (np.sin((along * 9 - np.abs(across) / max(leaf.width, 1e-6) * 1.2) * 2 * np.pi) > 0.75)
        tint = blend_images(tint, np.broadcast_to(np.array(vein), tint.shape), np.clip(0.7 * middle + ribs * 0.5, 0, 1))
        color = blend_images(color, tint, share)
        alpha = alpha + (1 - alpha) * share
    return np.concatenate([encode(color), alpha[..., None]], axis=2)


def leaf_spray(size: int, random: np.random.Generator) -> np.ndarray:
    """A twig with pointed leaves on both sides; the twig starts at the middle of the lower edge."""
    leaves = [Leaf(0.5, 0.0, 90, 0.9, 0.009, 0.1, blunt=0.4)]
    for i in range(11):
        height = 0.06 + 0.068 * i
        side = 1 if i % 2 else -1
        angle = 90 - side * random.uniform(38, 62)
        leaves.append(
            Leaf(0.5, height, angle, random.uniform(0.36, 0.45), random.uniform(0.062, 0.08), random.random())
        )
    leaves.append(Leaf(0.5, 0.70, 90, 0.29, 0.06, 0.8))
    return draw_leaves(size, size, leaves, (0.035, 0.11, 0.015), (0.16, 0.30, 0.035), (0.26, 0.36, 0.09))


def blossom_spray(size: int, random: np.random.Generator) -> np.ndarray:
    """Blunt dark leaves with a few five-petalled flowers over them."""
    leaves = []
    for _ in range(16):
        x, y = random.uniform(0.25, 0.75), random.uniform(0.15, 0.7)
        angle = np.degrees(np.arctan2(y - 0.3, x - 0.5)) + random.uniform(-40, 40)
        leaves.append(Leaf(x, y, angle, random.uniform(0.2, 0.26), 0.06, random.random(), blunt=1.2))
    green = draw_leaves(size, size, leaves, (0.02, 0.07, 0.02), (0.07, 0.19, 0.05), (0.14, 0.26, 0.10))
    petals = []
    for x, y in ((0.34, 0.62), (0.66, 0.68), (0.5, 0.36), (0.74, 0.34)):
        start = random.uniform(0, 72)
        petals += [Leaf(x, y, start + 72 * k, 0.125, 0.055, random.uniform(0.3, 1), blunt=1.6) for k in range(5)]
    flowers = draw_leaves(size, size, petals, (0.45, 0.06, 0.14), (0.80, 0.34, 0.42), (0.85, 0.62, 0.2))
    share = flowers[..., 3]
    color = blend_images(green[..., :3], flowers[..., :3], share)
    alpha = green[..., 3] + (1 - green[..., 3]) * share
    return np.concatenate([color, alpha[..., None]], axis=2)


def grass_tuft(height: int, width: int, random: np.random.Generator) -> np.ndarray:
    """Blades that rise from the lower edge."""
    blades = []
    for _ in range(30):
        x = random.uniform(0.08, 0.92)
        lean = 90 + random.uniform(-20, 20) - (x - 0.5) * 30
        length = random.uniform(0.5, 0.96) * height / width
        blades.append(Leaf(x, -0.03, lean, length, random.uniform(0.012, 0.02), random.random(), blunt=0.5))
    return draw_leaves(height, width, blades, (0.06, 0.12, 0.02), (0.28, 0.36, 0.07), (0.34, 0.40, 0.12))
