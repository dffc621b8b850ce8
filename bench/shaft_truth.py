"""Shafts of light behind lenses, mirrors and waves, traced with numpy: the truth of `python -m bench media --shafts`.

Rays of a lamp are bent and mirrored by exact shapes (a ball, a band of a cylinder, a wavy pane) with Fresnel's shares,
all of them followed by weight, and leave `steps` points on each stretch that lies in the cube of fog. A point sends to
its pixel the radiance

    flux * sigma_s p(cosine) exp(-sigma_t path) * length / steps / (solid angle of the pixel * distance squared)

Fog fills the glass, too. Nothing of it is shared with the engine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Fog:
    low: np.ndarray
    high: np.ndarray
    scattering: float
    extinction: float
    anisotropy: float = 0.0


@dataclass(frozen=True)
class Stretch:
    """Rays after an interface: places, directions, watts."""

    start: np.ndarray
    way: np.ndarray
    flux: np.ndarray


def meet(way: np.ndarray, normal: np.ndarray, eta: float):
    """Directions bent and mirrored at normals that face the rays, and Fresnel's share of what is mirrored; `eta`: index
    before over index behind."""
    cosine = -(way * normal).sum(axis=1)
    squared = 1 - eta**2 * (1 - cosine**2)
    inside = np.sqrt(np.maximum(squared, 0.0))
    s = (eta * cosine - inside) / (eta * cosine + inside)
    p = (cosine - eta * inside) / (cosine + eta * inside)
    bent = eta * way + (eta * cosine - inside)[:, None] * normal
    share = np.where(squared > 0, (s * s + p * p) / 2, 1.0)
    return bent, way + 2 * cosine[:, None] * normal, share


def cone(lamp, target, half_angle: float, intensity: float, radius: float, rays: int, rng):
    """Rays evenly in a cone, from a disc of the lamp that faces the target."""
    axis = np.asarray(target, float) - lamp
    axis /= np.linalg.norm(axis)
    u = np.cross(axis, (0.0, 1.0, 0.0))
    u /= np.linalg.norm(u)
    v = np.cross(axis, u)
    cosine = 1 - rng.random(rays) * (1 - np.cos(half_angle))
    turn = 2 * np.pi * rng.random(rays)
    across = np.sqrt(1 - cosine**2)
    way = cosine[:, None] * axis + across[:, None] * (np.cos(turn)[:, None] * u + np.sin(turn)[:, None] * v)
    far, round_ = radius * np.sqrt(rng.random(rays)), 2 * np.pi * rng.random(rays)
    start = lamp + far[:, None] * (np.cos(round_)[:, None] * u + np.sin(round_)[:, None] * v)
    return start, way, np.full(rays, intensity * 2 * np.pi * (1 - np.cos(half_angle)) / rays)


def in_fog(fog: Fog, start: np.ndarray, way: np.ndarray, until: np.ndarray | float = np.inf):
    """Distances at which rays enter and leave the fog, from their start on; equal where they miss it."""
    with np.errstate(divide="ignore", invalid="ignore"):
        near, far = (fog.low - start) / way, (fog.high - start) / way
    first = np.nanmax(np.minimum(near, far), axis=1)
    last = np.minimum(np.nanmin(np.maximum(near, far), axis=1), until)
    first = np.maximum(first, 0.0)
    return first, np.maximum(last, first)


def passed(fog: Fog, start, way, until) -> np.ndarray:
    first, last = in_fog(fog, start, way, until)
    return np.exp(-fog.extinction * (last - first))


def through_ball(fog: Fog, rays, centre, radius: float, ior: float, bounces: int = 3) -> list[Stretch]:
    """What a ball of glass mirrors and bends, with up to `bounces` reflections within."""
    start, way, flux = rays
    offset = start - centre
    middle = (offset * way).sum(axis=1)
    inside = middle**2 - ((offset**2).sum(axis=1) - radius**2)
    hit = inside > 0
    start, way, flux, middle, inside = (x[hit] for x in (start, way, flux, middle, inside))
    t = -middle - np.sqrt(inside)
    flux = flux * passed(fog, start, way, t)
    place = start + t[:, None] * way
    normal = (place - centre) / radius
    bent, mirrored, share = meet(way, normal, 1 / ior)
    found = [Stretch(place, mirrored, flux * share)]
    way, flux = bent, flux * (1 - share)
    chord = -2 * radius * (bent * normal).sum(axis=1)
    for _ in range(bounces + 1):
        place = place + chord[:, None] * way
        flux = flux * np.exp(-fog.extinction * chord)
        normal = (place - centre) / radius
        bent, mirrored, share = meet(way, -normal, ior)
        found.append(Stretch(place, bent, flux * (1 - share)))
        way, flux = mirrored, flux * share
    return found


def band_distance(start, way, low: float, high: float, radius: float) -> np.ndarray:
    """To a band of the cylinder around Z; infinite where it is missed."""
    a = (way[:, :2] ** 2).sum(axis=1)
    b = (start[:, :2] * way[:, :2]).sum(axis=1)
    root = b * b - a * ((start[:, :2] ** 2).sum(axis=1) - radius**2)
    nearest = np.full(len(start), np.inf)
    for sign in (1, -1):
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (-b + sign * np.sqrt(np.maximum(root, 0.0))) / a
        z = start[:, 2] + t * way[:, 2]
        nearest = np.where((root > 0) & (t > 1e-6) & (z > low) & (z < high), np.minimum(t, nearest), nearest)
    return nearest


def off_band(fog: Fog, rays, low: float, high: float, albedo: float, radius: float = 1.0, bounces: int = 8):
    """What a band of metal mirrors, from both of its sides; Schlick's reflectance. Stretches end at the band."""
    start, way, flux = rays
    found, ends = [], []
    for number in range(bounces + 1):
        t = band_distance(start, way, low, high, radius)
        if number:
            found.append(Stretch(start, way, flux))
            ends.append(t)
        hit = np.isfinite(t)
        start, way, flux, t = start[hit], way[hit], flux[hit], t[hit]
        if not len(t):
            break
        flux = flux * passed(fog, start, way, t)
        start = start + t[:, None] * way
        normal = start * (1, 1, 0) / radius
        cosine = (way * normal).sum(axis=1)
        way = way - 2 * cosine[:, None] * normal
        flux = flux * (albedo + (1 - albedo) * (1 - np.abs(cosine)) ** 5)
    return found, ends


def through_pane(rays, bottom: float, ior: float, height: Callable, slope: Callable) -> list[Stretch]:
    """Rays straight down through a wavy top (height and slopes at x, y) and a flat bottom."""
    start, way, flux = rays
    x, y = start[:, 0], start[:, 1]
    place = np.stack([x, y, height(x, y)], axis=1)
    dx, dy = slope(x, y)
    normal = np.stack([-dx, -dy, np.ones_like(dx)], axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    bent, _, share = meet(way, normal, 1 / ior)
    flux = flux * (1 - share)
    place = place + ((bottom - place[:, 2]) / bent[:, 2])[:, None] * bent
    bent, _, share = meet(bent, np.broadcast_to((0.0, 0.0, 1.0), bent.shape), ior)
    return [Stretch(place, bent, flux * (1 - share))]


def picture(
    fog: Fog, stretches: list[Stretch], camera: np.ndarray, angle: float, size: int, hidden: Callable,
    ends: list[np.ndarray] | None = None, steps: int = 64, seed: int = 1,
) -> np.ndarray:  # fmt: skip
    """(size, size) radiance, row 0 low. `camera`: its matrix; `hidden(places, ways to the eye)`: what does not show."""
    rng = np.random.default_rng(seed)
    eye, axes = camera[:3, 3], camera[:3, :3]
    focal = 0.5 * size / np.tan(angle / 2)  # pixels
    image = np.zeros(size * size)
    for number, one in enumerate(stretches):
        until = np.inf if ends is None else ends[number]
        first, last = in_fog(fog, one.start, one.way, until)
        keep = (last > first) & (one.flux > 0)
        start, way, flux = one.start[keep], one.way[keep], one.flux[keep]
        first, last = first[keep], last[keep]
        for step in range(steps):
            t = first + (step + rng.random(len(first))) / steps * (last - first)
            place = start + t[:, None] * way
            to_eye = eye - place
            distance = np.linalg.norm(to_eye, axis=1)
            to_eye = to_eye / distance[:, None]
            seen = (place - eye) @ axes
            column = np.floor(size / 2 + focal * seen[:, 0] / -seen[:, 2]).astype(int)
            row = np.floor(size / 2 + focal * seen[:, 1] / -seen[:, 2]).astype(int)
            inside = (seen[:, 2] < 0) & (column >= 0) & (column < size) & (row >= 0) & (row < size)
            inside &= ~hidden(place, to_eye)
            mu, g = (way * to_eye).sum(axis=1), fog.anisotropy
            phase = (1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * mu) ** 1.5)
            pixel = (-seen[:, 2] / distance) ** 3 / focal**2  # solid angle
            light = flux * fog.scattering * phase * np.exp(-fog.extinction * (t - first))
            light *= passed(fog, place, to_eye, distance) * (last - first) / steps / (pixel * distance**2)
            np.add.at(image, row[inside] * size + column[inside], light[inside])
    return image.reshape(size, size)
