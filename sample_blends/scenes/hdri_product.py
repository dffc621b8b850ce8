"""Headphones on a stand in a photo studio: nothing but an environment image lights them.

What it tests: importance sampling of an HDR environment with small bright softboxes (up to radiance 50) under a turned
Mapping, its shadows, and reflections in plastic and metal from rough (0.6) to nearly smooth (0.08).

Built in centimetres, shown in metres (true size).
"""

import numpy as np

from .construct import camera, collection, diffuse, glossy, image, principled, solid, world
from .pictures import Softbox, studio
from .shapes import Shape, cylinder, grid, join, lathe, ring, tube

CENTIMETRE = 0.01
BAND_CENTRE, BAND_RADIUS = 17.5, 8.8
CUP_X, CUP_Z = 8.1, 13.2

CUP = [
    (0, 0),
    (3.6, 0),
    (4.1, 0.25),
    (4.35, 0.8),
    (4.35, 1.5),
    (4.1, 2.2),
    (3.5, 2.65),
    (2.9, 2.8),
    (2.9, 2.62),
    (0, 2.62),
]
STAND = [(0, 0), (6.4, 0), (6.6, 0.2), (6.6, 0.7), (6.4, 0.9), (1.6, 1.05), (0.9, 1.4), (0.62, 2.4), (0.55, 6.0),
         (0.55, 24.6), (0.9, 25.1), (0.9, 25.4), (0, 25.4)]  # fmt: skip


def build() -> None:
    ivory = principled("Ivory Plastic", (0.78, 0.72, 0.62), roughness=0.42)
    graphite = principled("Graphite Plastic", (0.035, 0.038, 0.045), roughness=0.55)
    brass = principled("Brushed Brass", (0.86, 0.60, 0.27), roughness=0.27, metallic=1.0)
    steel = glossy("Satin Steel", (0.62, 0.62, 0.64), roughness=0.38)
    leather = diffuse("Tan Leather", (0.20, 0.08, 0.035), roughness=0.4)
    lacquer = principled("Black Lacquer", (0.012, 0.012, 0.016), roughness=0.08)

    build_studio()
    build_stand(steel, graphite)
    build_band(ivory, leather, brass)
    for side in (-1, 1):
        build_cup(side, ivory, brass, leather, lacquer)
    build_cable(graphite, brass)
    view = camera((0.30, -0.66, 0.27), (0.012, 0.0, 0.128), lens=52)
    view.data.clip_start = 0.01
    world(strength=1.0, picture=image("Studio Softboxes", studio_light(), linear=True), turn_degrees=35.0)


def metres(shape: Shape) -> Shape:
    return shape.scaled(CENTIMETRE, CENTIMETRE, CENTIMETRE)


def studio_light() -> np.ndarray:
    boxes = [
        Softbox(200, 38, 40, 34, (7.0, 6.6, 6.0)),  # key, from the left
        Softbox(20, 22, 10, 62, (15.0, 17.0, 20.0), fade=2),  # tall cool strip, from the right
        Softbox(95, 60, 60, 16, (5.5, 5.0, 4.4)),  # over the back
        Softbox(285, 48, 9, 9, (50.0, 43.0, 34.0), fade=1, is_round=True),  # small and hard, beside the camera
    ]
    return studio(256, boxes, floor=(0.10, 0.085, 0.07), ceiling=(0.22, 0.24, 0.28))


def build_studio() -> None:
    paper = diffuse("Apricot Paper", (0.72, 0.33, 0.17))

    def sweep(u, v):
        """Flat from y = -160 to 30, a quarter turn of radius 40, then upright."""
        along = v * 380 - 160
        angle = np.clip((along - 30) / 40, 0, np.pi / 2)
        y = np.minimum(along, 30) + 40 * np.sin(angle)
        z = 40 * (1 - np.cos(angle)) + np.maximum(along - 30 - 20 * np.pi, 0)
        return np.stack([(u - 0.5) * 420, y, z], axis=-1)

    solid("Paper Sweep", metres(grid(1, 76, sweep)), paper, smooth_below=60, into=collection("Studio"))


def build_stand(steel, graphite) -> None:
    into = collection("Stand")
    solid("Stand", metres(lathe(STAND, 56)), steel, smooth_below=35, into=into)
    saddle = tube([(x, 0, 25.7 - 0.055 * x * x) for x in np.linspace(-3, 3, 13)], 0.55, 14)
    solid("Saddle", metres(saddle.scaled(1, 2.0, 1)), graphite, smooth_below=50, into=into)


def band_path(degrees, radius: float) -> np.ndarray:
    angles = np.radians(degrees)
    x, z = radius * np.cos(angles), BAND_CENTRE + (radius + 0.25) * np.sin(angles)
    return np.stack([x, 0 * x, z], axis=1)


def build_band(ivory, leather, brass) -> None:
    into = collection("Headphones")
    shell = tube(band_path(np.linspace(12, 168, 49), BAND_RADIUS), 0.36, 14).scaled(1, 4.2, 1)
    solid("Headband", metres(shell), ivory, smooth_below=50, into=into)
    size = 0.52 * np.sin(np.linspace(0.12, np.pi - 0.12, 41)) ** 0.35
    pad = tube(band_path(np.linspace(38, 142, 41), BAND_RADIUS - 0.62), size, 14).scaled(1, 2.3, 1)
    solid("Headband Pad", metres(pad), leather, smooth_below=50, into=into)
    rods = [tube(band_path(np.linspace(a, b, 9), BAND_RADIUS), 0.19, 12) for a, b in ((-3, 13), (167, 183))]
    solid("Sliders", metres(join(rods)), brass, smooth_below=50, into=into)


def build_cup(side: int, ivory, brass, leather, lacquer) -> None:
    """One ear cup; its axis lies along x, outwards. The yoke that holds it hangs from the slider."""
    name = "Right" if side > 0 else "Left"
    into = collection(f"{name} Cup")
    placing = {"location": np.array((side * CUP_X, 0, CUP_Z)) * CENTIMETRE,
               "rotation_degrees": (0, 90 * side + 7, 0), "into": into}  # fmt: skip
    solid(f"{name} Shell", metres(lathe(CUP, 56)), ivory, smooth_below=40, **placing)
    cushion = ring(3.25, 1.05, 56, 16).scaled(1, 1, 0.95).moved(z=-0.7)
    solid(f"{name} Cushion", metres(cushion), leather, smooth_below=80, **placing)
    solid(f"{name} Trim", metres(ring(2.9, 0.16, 56, 10).moved(z=2.75)), brass, smooth_below=80, **placing)
    disc = lathe([(2.75, 2.62), (2.7, 2.75), (1.4, 2.92), (0, 2.97)], 56)
    solid(f"{name} Inlay", metres(disc), lacquer, smooth_below=50, **placing)
    angles = np.radians(np.linspace(0, 180, 33))
    arc = np.stack([4.75 * np.sin(angles) * -side, 4.75 * np.cos(angles), 0 * angles + 1.1], axis=1)
    yoke = tube(arc, 0.2, 10)
    pins = [cylinder(0.28, 0.9, 14).turned("x", 90).moved(y=y, z=1.1) for y in (4.9, -4.0)]
    solid(f"{name} Yoke", metres(join([yoke, *pins])), brass, smooth_below=50, **placing)


def build_cable(graphite, brass) -> None:
    """A coiled cable from the left cup to a jack plug on the paper."""
    into = collection("Cable")
    t = np.linspace(0, 1, 420)[:, None]
    corners = [
        np.array(p, float) for p in [(-8.6, 0, 9.2), (-10.5, -1.0, 2.0), (-17.5, -3.5, -2.6), (-3.0, -11.5, 0.6)]
    ]
    weights = [(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3]
    spine = sum(w * c for w, c in zip(weights, corners, strict=True))
    spine[:, 2] = np.maximum(spine[:, 2], 0.55)
    forward = np.gradient(spine, axis=0)
    forward /= np.linalg.norm(forward, axis=1, keepdims=True)
    across = np.cross(forward, (0, 0, 1))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    other = np.cross(across, forward)
    coil = 0.38 * np.clip(np.minimum(t - 0.16, 0.94 - t) * 14, 0, 1)
    phase = 2 * np.pi * 34 * t
    path = spine + coil * (np.cos(phase) * across + np.sin(phase) * other)
    solid("Coiled Cable", metres(tube(path, 0.15, 8)), graphite, smooth_below=70, into=into)
    plug = lathe([(0, -0.2), (0.34, -0.2), (0.42, 0.2), (0.42, 1.9), (0.3, 2.1), (0.3, 2.2)], 20).in_slot(0)
    tip = lathe([(0.3, 2.2), (0.3, 4.4), (0.2, 4.7), (0.28, 5.0), (0.12, 5.5), (0, 5.55)], 20).in_slot(1)
    ahead = spine[-1] - spine[-8]
    heading = float(np.degrees(np.arctan2(ahead[1], ahead[0])))
    solid("Jack Plug", metres(plug + tip), graphite, brass, smooth_below=40, into=into,
          location=spine[-1] * CENTIMETRE, rotation_degrees=(0, 90, heading))  # fmt: skip
