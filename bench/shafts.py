"""Volume caustics beside light tracing, and what their stage costs: `python -m bench media --shafts`.

The specification's scenes W1 (ball of glass), W2 (ring of metal), W3 (W1 with forward and backward scattering) and W4
(light through waves), whose truth is shaft_truth.py: Cycles' paths do not find lamps through them. The profile is the
light of beams across the picture, the mean over the rows below the caster, its root mean squared difference over the
truth's peak. Times are differences between whole pictures with and without the stage, of one sample.
"""

from __future__ import annotations

import time
from functools import cache

import numpy as np

from bench import markdown, media_scenes, shaft_truth
from bench.shaft_truth import Fog

COMMAND = "python -m bench media --shafts --page"
SIZE, SAMPLES, TRACED = 48, 4, 20_000
RAYS = 32, 64  # a side of the lamp's square
SIDES, SCREENS = (16, 32, 64), (64, 128)  # of rays and of the picture, for costs
HEAD = ("scene", "rays", "profile, % of peak", "energy")
CUBE = np.full(3, -2.0), np.full(3, 2.0)
SPOT = 1 / (4 * np.pi)  # W/sr of a watt


def nothing_hides(place, to_eye):
    return np.zeros(len(place), bool)


def lens_truth(anisotropy: float, matrix, angle: float, size: int) -> np.ndarray:
    fog, centre = Fog(*CUBE, 0.15, 0.17, anisotropy), np.array([0.0, 0.0, 0.5])
    rng, lamp = np.random.default_rng(0), np.array([0.0, 0.0, 3.4])
    rays = shaft_truth.cone(lamp, centre, np.arcsin(0.52 / 2.9), 400 * SPOT, 0.05, TRACED, rng)

    def behind(place, to_eye):
        offset = place - centre
        middle = (offset * to_eye).sum(axis=1)
        return (middle < 0) & ((offset**2).sum(axis=1) - middle**2 < 0.25)

    stretches = shaft_truth.through_ball(fog, rays, centre, 0.5, 1.5)
    return shaft_truth.picture(fog, stretches, matrix, angle, size, behind)


def ring_truth(matrix, angle: float, size: int) -> np.ndarray:
    fog, lamp = Fog(*CUBE, 0.15, 0.17), np.array([2.6, 0.0, 1.3])
    rng, half = np.random.default_rng(0), 0.35
    axis = np.array([-np.sin(1.1), 0.0, -np.cos(1.1)])
    start, way, flux = shaft_truth.cone(lamp, lamp + axis, half, 300 * SPOT, 0.05, 4 * TRACED, rng)
    edge = np.cos(half)
    flux = flux * smooth(((way @ axis) - edge) / ((1 - edge) * 0.15))  # blend of .15

    def behind(place, to_eye):
        return np.isfinite(shaft_truth.band_distance(place, to_eye, -0.5, 0.0, 1.0))

    stretches, ends = shaft_truth.off_band(fog, (start, way, flux), -0.5, 0.0, 0.9)
    return shaft_truth.picture(fog, stretches, matrix, angle, size, behind, ends)


def smooth(x: np.ndarray) -> np.ndarray:
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3 - 2 * x)


def waves_truth(matrix, angle: float, size: int) -> np.ndarray:
    fog = Fog(np.array(media_scenes.POOL_FOG[0]), np.array(media_scenes.POOL_FOG[1]), 0.15, 0.17)
    rng, half, count = np.random.default_rng(0), media_scenes.POOL_HALF, 4 * TRACED
    start = np.concatenate([rng.uniform(-half, half, (count, 2)), np.full((count, 1), 5.0)], axis=1)
    rays = start, np.broadcast_to((0.0, 0.0, -1.0), start.shape), np.full(count, 2.0 * (2 * half) ** 2 / count)
    stretches = shaft_truth.through_pane(
        rays, media_scenes.POOL_BOTTOM, 1.33, media_scenes.wave_height, media_scenes.wave_slope
    )
    return shaft_truth.picture(fog, stretches, matrix, angle, size, nothing_hides)


TRUTHS = {
    "W1 glass ball": lambda *view: lens_truth(0.0, *view), "W2 metal ring": ring_truth,
    "W3 g = .7": lambda *view: lens_truth(0.7, *view), "W3 g = -.7": lambda *view: lens_truth(-0.7, *view),
    "W4 waves": waves_truth,
}  # fmt: skip
ROWS = {"W2 metal ring": (0.05, 0.6)}  # of the picture's height; of others those below the caster
BELOW = (0.125, 0.4)


def prepared(name: str):
    """The scene of that name, of which beams alone are drawn."""
    import bpy

    media_scenes.begin()
    media_scenes.CAUSTICS[name]()
    scene = bpy.context.scene
    scene.candela.slot_volume = scene.candela.slot_indirect = scene.candela.slot_caustics = "OFF"
    return scene


@cache
def truth_of(name: str, matrix: tuple[float, ...], angle: float, size: int) -> np.ndarray:
    """(size, size) radiance; `matrix`: the camera's, row by row."""
    return TRUTHS[name](np.array(matrix).reshape(4, 4), angle, size)


def profiles(name: str, rays: int, samples: int = SAMPLES, size: int = SIZE):
    """(size,) of the beams and of their truth across the picture, and both pictures."""
    from addon.compare.reference import render_passes

    scene = prepared(name)
    scene.candela.volume_caustics_rays = rays
    shown = render_passes(scene, "CANDELA", samples, 1, size=(size, size), bounces=1).images["volume_indirect"][..., 0]
    truth = truth_of(name, tuple(np.array(scene.camera.matrix_world).ravel()), scene.camera.data.angle, size)
    low, high = (round(share * size) for share in ROWS.get(name, BELOW))
    return shown[low:high].mean(axis=0), truth[low:high].mean(axis=0), shown, truth


def figures(seen: np.ndarray, truth: np.ndarray) -> tuple[float, float]:
    """Root mean squared difference over the peak, and the ratio of the sums."""
    return float(np.sqrt(((seen - truth) ** 2).mean()) / truth.max()), float(seen.sum() / truth.sum())


def stage_milliseconds(scene, rays: int, size: int, samples: int = 16) -> float:
    """Of one sample of the stage: whole pictures with it and without, which differ in nothing else, the least of three
    each. Without: no lamp is seen by media."""
    from addon.compare.reference import render_passes

    scene.candela.volume_caustics_rays = rays
    lamps = [one for one in scene.objects if one.type == "LIGHT"]
    times = []
    for shown in (True, False):
        for lamp in lamps:
            lamp.visible_volume_scatter = shown
        taken = []
        for seed in range(4):  # the first one compiles
            started = time.perf_counter()
            render_passes(scene, "CANDELA", samples, seed, size=(size, size), bounces=1)
            taken.append(time.perf_counter() - started)
        times.append(min(taken[1:]))
    return 1e3 * (times[0] - times[1]) / samples


def page(pictures=None, with_costs: bool = False) -> str:
    """The table of profiles, and on a machine that is idle those of costs."""
    rows = [HEAD]
    for name in TRUTHS:
        for rays in RAYS:
            seen, truth, shown, expected = profiles(name, rays)
            error, energy = figures(seen, truth)
            rows.append((name if rays == RAYS[0] else "", f"{rays}²", f"{100 * error:.1f}", f"{energy:.3f}"))
            print(*rows[-1], sep="  ", flush=True)
        if pictures is not None:
            from bench.cases import write_pictures

            both = (np.repeat(image[..., None], 3, axis=2) for image in (shown, expected))
            write_pictures(pictures, f"shaft {name}".replace(" ", "_"), *both)
    text = f"{SIZE} x {SIZE} pixels, {SAMPLES} samples, beams alone.\n\n{markdown.table(rows)}"
    return text + costs() if with_costs else text


def costs() -> str:
    """The tables of the stage's time by rays, pixels and lamps."""
    rows = [("rays", *(f"{screen}² pixels" for screen in SCREENS))]
    scene = prepared("W1 glass ball")
    for side in SIDES:
        rows.append((f"{side}²", *(f"{stage_milliseconds(scene, side, screen):.0f}" for screen in SCREENS)))
        print(*rows[-1], sep="  ", flush=True)
    lamps = [("lamps", "ms")]
    for count in (1, 2, 4):
        while sum(one.type == "LIGHT" for one in scene.objects) < count:
            first = next(one for one in scene.objects if one.type == "LIGHT")
            copy = first.copy()
            scene.collection.objects.link(copy)
            copy.location.x += 0.4 * sum(one.type == "LIGHT" for one in scene.objects)
        lamps.append((str(count), f"{stage_milliseconds(scene, 32, 64):.0f}"))
        print(*lamps[-1], sep="  ", flush=True)
    text = "\n\nMilliseconds of the stage, one sample of W1 on a software GPU, by rays and by pixels:\n\n"
    text += markdown.table(rows) + "\n\nand by lamps, 32² rays each, 64² pixels:\n\n" + markdown.table(lamps)
    return text
