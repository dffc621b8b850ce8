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
