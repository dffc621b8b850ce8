"""A ball of three coloured glasses above a floor, beside light tracing in numpy: `python -m bench prism`.

Red, green and blue Glass nodes of other indices are added: the common way to build dispersion. Green has its focus on
the floor, red below and blue above. Paths from the floor to a small lamp are so rare that a path tracer's picture lacks
the halo of light that is mirrored inside, so truth is traced from the lamp: two refractions and up to four reflections
inside, by Fresnel's laws. Printed are the error of means over 4x4 pixels of floor, the ratio of means, and both by
rings about the shadow's middle.
"""

from __future__ import annotations

import argparse
from itertools import pairwise

import numpy as np

from bench.markdown import table

INDICES = (1.35, 1.5, 1.65)  # of red, green and blue glass
LAMP, LAMP_RADIUS, POWER = np.array([-0.5, 0.4, 2.6]), 0.12, 200.0
MIDDLE, RADIUS = np.array([0.0, 0.0, 0.6]), 0.4
ALBEDO, SPAN, SIDE = 0.8, 2.4, 96  # of the floor; what is shown of it, m and pixels
CENTRE = MIDDLE[:2] + (MIDDLE - LAMP)[:2] * MIDDLE[2] / (LAMP - MIDDLE)[2]  # of the shadow
RINGS = (0.0, 0.05, 0.1, 0.2, 0.35)  # m


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--samples", type=int, nargs="+", default=[1, 4, 16])
    parser.add_argument("--photons", type=int, default=2_000_000, help="of each colour")


def command(options: argparse.Namespace) -> int:
    import addon
    from addon.compare.reference import render_passes

    addon.register()
    truth = np.stack([traced(ior, options.photons, k) for k, ior in enumerate(INDICES)], axis=-1)
    scene = _scene()
    rings = [f"{low:g} to {high:g} m" for low, high in pairwise(RINGS)]
    rows = [["samples", "relMSE of 4x4", "mean", *rings]]
    place = ((np.arange(SIDE) + 0.5) / SIDE - 0.5) * SPAN
    away = np.hypot(place[None, :] - CENTRE[0], place[:, None] - CENTRE[1])
    for samples in options.samples:
        passes = render_passes(scene, "CANDELA", samples, 1, size=(SIDE, SIDE)).images
        shown = passes["diffuse_indirect"][..., :3] * passes["diffuse_color"][..., :3]
        found, right = _blocks(shown), _blocks(truth)
        light = right.mean(axis=-1)
        error = ((found - right) ** 2).mean(axis=-1) / (light**2 + (0.1 * light.mean()) ** 2)
        within = [(low <= away) & (away < high) for low, high in pairwise(RINGS)]
        ratios = [" ".join(f"{c:.2f}" for c in shown[one].mean(axis=0) / truth[one].mean(axis=0)) for one in within]
        rows.append([str(samples), f"{error.mean():.4f}", f"{shown.mean() / truth.mean():.3f}", *ratios])
    print(table(rows))
    return 0


def traced(ior: float, photons: int, seed: int) -> np.ndarray:
    """(SIDE, SIDE), y upwards: radiance of the floor by light that the ball mirrors or bends, of one index."""
    rng = np.random.default_rng(seed)
    axis = MIDDLE - LAMP
    far = np.linalg.norm(axis)
    axis = axis / far
    start = rng.normal(size=(photons, 3))
    start /= np.linalg.norm(start, axis=1, keepdims=True)
    least = np.cos(1.02 * np.arcsin((RADIUS + LAMP_RADIUS) / far))
    cosine, turn = 1.0 - rng.random(photons) * (1.0 - least), 2 * np.pi * rng.random(photons)
    u = np.cross(axis, (1.0, 0.0, 0.0))
    u /= np.linalg.norm(u)
    around = np.cos(turn)[:, None] * u + np.sin(turn)[:, None] * np.cross(axis, u)
    way = cosine[:, None] * axis + np.sqrt(1.0 - cosine**2)[:, None] * around
    # The lamp's radiance is P / (4 pi^2 r^2), on 4 pi r^2, into the cone.
    flux = np.maximum((way * start).sum(axis=1), 0.0) * 2 * np.pi * (1.0 - least) * POWER / (np.pi * photons)
    place = LAMP + LAMP_RADIUS * start
    offset = place - MIDDLE
    along = (offset * way).sum(axis=1)
    inside = along**2 - (offset**2).sum(axis=1) + RADIUS**2
    hit = (inside > 0) & (flux > 0)
    place, way, flux = place[hit], way[hit], flux[hit]
    place = place - (along[hit] + np.sqrt(inside[hit]))[:, None] * way
    normal = (place - MIDDLE) / RADIUS
    cosine = -(way * normal).sum(axis=1)
    share = _fresnel(cosine, ior)
    floor = _landed(place, way + 2 * cosine[:, None] * normal, flux * share)
    way, flux = _bent(way, normal, cosine, 1 / ior), flux * (1 - share)
    for _ in range(4):
        place = place - 2 * ((place - MIDDLE) * way).sum(axis=1)[:, None] * way
        normal = (MIDDLE - place) / RADIUS
        cosine = -(way * normal).sum(axis=1)
        share = _fresnel(cosine, 1 / ior)
        floor += _landed(place, _bent(way, normal, cosine, ior), flux * (1 - share))
        way, flux = way + 2 * cosine[:, None] * normal, flux * share
    return floor * (SIDE / SPAN) ** 2 * ALBEDO / np.pi


def _fresnel(cosine: np.ndarray, ior: float) -> np.ndarray:
    squared = ior * ior - 1 + cosine * cosine
    g = np.sqrt(np.maximum(squared, 0.0))
    a, b = (g - cosine) / (g + cosine), ((g + cosine) * cosine - 1) / ((g - cosine) * cosine + 1)
    return np.where(squared <= 0, 1.0, 0.5 * a * a * (1 + b * b))


def _bent(way: np.ndarray, normal: np.ndarray, cosine: np.ndarray, ratio: float) -> np.ndarray:
    root = np.sqrt(np.maximum(1 - ratio * ratio * (1 - cosine * cosine), 0.0))
    return ratio * way + (ratio * cosine - root)[:, None] * normal


def _landed(place: np.ndarray, way: np.ndarray, flux: np.ndarray) -> np.ndarray:
    down = way[:, 2] < 0
    end = place[down] - (place[down, 2] / way[down, 2])[:, None] * way[down]
    edges = [[-SPAN / 2, SPAN / 2]] * 2
    return np.histogram2d(end[:, 1], end[:, 0], bins=SIDE, range=edges, weights=flux[down])[0]


def _blocks(image: np.ndarray) -> np.ndarray:
    return image.reshape(SIDE // 4, 4, SIDE // 4, 4, 3).mean(axis=(1, 3))


def _scene():
    import bpy

    from bench import shapes
    from bench.shading import dispersing, one_shader

    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    colors = ((1, 0, 0, 1), (0, 1, 0, 1), (0, 0, 1, 1))
    floor = one_shader("Floor", "ShaderNodeBsdfDiffuse", Color=(ALBEDO, ALBEDO, ALBEDO, 1))
    shapes.plane(floor, (0, 0, 0), scale=(4, 4, 1))
    shapes.ball(dispersing(tuple(zip(colors, INDICES))), MIDDLE, RADIUS, 96).visible_camera = False
    shapes.lamp("POINT", LAMP, energy=POWER, shadow_soft_size=LAMP_RADIUS)
    shapes.look_down(SPAN, height=5.0)
    scene.candela.slot_indirect = "OFF"
    return scene
