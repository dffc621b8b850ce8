"""Relief beside Cycles' displaced meshes: `python -m bench relief --page`.

Four scenes (relief_scenes.py) under a sun, an area light and the world, each as a coarse mesh drawn by relief and as a
mesh subdivided to the detail of its heights (a face for each texel), displaced by Candela and by Cycles. Direct light.

Error is relMSE of Combined, of all pixels and of those that are farther than a pixel from an edge: where Cycles'
depth jumps, or its direct light ends, in a picture of one ray a pixel. Outlines are compared as the border of what
covers half a pixel, and where a box stands in the floor as the border of what is red: the mean distance, in pixels, of
places of one border to the other, over both. Times are seconds of the wall of whole renders, sync to picture, the
shortest of three after a first one (EEVEE: the second); before each the scene is built anew, so that nothing is known
of its mesh.

How time grows with detail is measured with as many texels of heights as the mesh has faces along a side: the shortest
of up to three renders in turn. Processor seconds, of all threads, tell about the same on a machine that others use.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from . import relief_scenes
from .relief_scenes import LAMPS, SCENES
from .study import PICTURES, Study, some_of

SIZE = (96, 64)
SAMPLES = 16
OWN_SAMPLES = {"SUN": 32, "AREA": 8, "WORLD": 16}
REFERENCE_SAMPLES = {"SUN": 64, "AREA": 256, "WORLD": 256}
TITLES = {
    "errors": "Beside Cycles' displaced mesh",
    "times": "Seconds from sync to picture, under the sun, 16 samples",
    "detail": "Seconds by detail, under the sun, 16 samples",
    "iterations": "Iterations to a height within .01, bisection / false position",
}
JUMP = 0.05  # m: twice a pixel's width


@dataclass(frozen=True)
class Figures:
    """Of a picture beside the reference."""

    error: float  # relMSE
    away: float  # the same away from edges
    outline: float  # pixels
    intersection: float  # pixels; nan without a box


def error_table(options: argparse.Namespace) -> list[list[str]]:
    rows = [["scene", "light", "drawn by", "relMSE", "away from edges", "outline, px", "intersection, px"]]
    for name in options.scenes:
        for lamp in options.lamps:
            for label, figures in errors(name, lamp, options.pictures):
                row = [SCENES[name].label, lamp.lower(), label, *(cell(value) for value in vars(figures).values())]
                rows.append(row)
                print("  ".join(row), flush=True)
    return rows


def time_table(options: argparse.Namespace) -> list[list[str]]:
    rows = [["scene", *(label for label, *_ in TIMED), "mesh / relief", "by processor seconds"]]
    for name in options.scenes:
        spent = [timed(name, *how) for _, *how in TIMED]
        ratios = (f"{spent[2][k] / spent[0][k]:.1f}" for k in range(2))
        rows.append([SCENES[name].label, *(f"{seconds:.2f}" for seconds, _ in spent), *ratios])
        print("  ".join(rows[-1]), flush=True)
    return rows


def cell(value: float) -> str:
    return "–" if value != value else f"{value:.4f}" if value < 0.1 else f"{value:.3f}"


def render(
    name: str, lamp: str, engine: str, detail: int, mode: str, samples: int, sharp: bool = False
) -> dict[str, np.ndarray]:
    """Passes of a scene; `sharp`: by rays through the middles of pixels."""
    import bpy

    from addon.compare.reference import render_passes

    relief_scenes.build(name, lamp, detail, mode)
    if sharp:
        bpy.context.scene.render.filter_size = 0.01
    if hasattr(bpy.context.scene, "candela"):
        bpy.context.scene.candela.denoise_strength = 0.0
    return render_passes(bpy.context.scene, engine, samples, 0, size=SIZE, bounces=0).images


def errors(name: str, lamp: str, pictures: Path | None = None):
    """(label, Figures) of relief and of the displaced mesh."""
    detail = SCENES[name].detail
    truth = render(name, lamp, "CYCLES", detail, "AUTO", REFERENCE_SAMPLES[lamp])
    sharp = edges(render(name, lamp, "CYCLES", detail, "AUTO", 1, sharp=True))
    shown = [("Cycles", truth)]
    for label, own_detail, mode in (("relief", 0, "RELIEF"), ("mesh", detail, "MESH")):
        picture = render(name, lamp, "CANDELA", own_detail, mode, OWN_SAMPLES[lamp])
        shown.append((label, picture))
        yield label, compare(picture, truth, sharp, name == "box")
    if pictures is not None:
        from addon.compare.png import png

        pictures.mkdir(parents=True, exist_ok=True)
        level = np.concatenate([np.clip(one["combined"][..., :3], 0, 1) ** (1 / 2.2) for _, one in shown], axis=1)
        level = (np.repeat(np.repeat(level, 3, axis=0), 3, axis=1) * 255 + 0.5).astype(np.uint8)
        (pictures / f"{name}_{lamp.lower()}.png").write_bytes(png(level[::-1]))


def compare(picture: dict, truth: dict, at_edges: np.ndarray, box: bool) -> Figures:
    from addon.compare.metrics import relative_squared_error

    x, r = picture["combined"][..., :3].astype(np.float64), truth["combined"][..., :3].astype(np.float64)
    error = relative_squared_error(x, r)
    away = ~at_edges
    between = border_distance(seen(picture), seen(truth))
    red = border_distance(is_red(picture), is_red(truth)) if box else float("nan")
    return Figures(float(error.mean()), float(error[away].mean()), between, red)


def seen(picture: dict) -> np.ndarray:
    return picture["combined"][..., 3] > 0.5


def is_red(picture: dict) -> np.ndarray:
    color = picture["diffuse_color"]
    return color[..., 0] > 2.0 * color[..., 1]


def edges(picture: dict) -> np.ndarray:
    """Pixels at most one away from where depth jumps or direct light ends, as a mask."""
    depth = np.minimum(picture["depth"][..., 0].astype(np.float64), 1e3)
    lit = picture["combined"][..., :3].max(axis=-1) > 1e-4
    found = np.zeros(depth.shape, bool)
    for axis in (0, 1):
        # A surface, however steep, has the same second differences on both sides of a pixel; a jump has not.
        step = np.diff(depth, axis=axis)
        bend = np.abs(np.diff(step, axis=axis))
        middle = [slice(None), slice(None)]
        middle[axis] = slice(1, -1)
        found[tuple(middle)] |= bend > JUMP
        changed = np.diff(lit.astype(np.int8), axis=axis) != 0
        for part in (slice(0, -1), slice(1, None)):
            side = [slice(None), slice(None)]
            side[axis] = part
            found[tuple(side)] |= changed
    return widened(found)


def widened(mask: np.ndarray) -> np.ndarray:
    """With the eight neighbours of each pixel."""
    padded = np.pad(mask, 1)
    return np.any([padded[y : y + mask.shape[0], x : x + mask.shape[1]] for y in range(3) for x in range(3)], axis=0)


def border(mask: np.ndarray) -> np.ndarray:
    """(N, 2) middles of the sides between pixels that are in the mask and pixels that are not."""
    places = []
    for axis in (0, 1):
        found = np.argwhere(np.diff(mask.astype(np.int8), axis=axis) != 0).astype(float)
        found[:, axis] += 0.5
        places.append(found)
    return np.concatenate(places)


def border_distance(a: np.ndarray, b: np.ndarray) -> float:
    """Mean distance in pixels of each place of either border to the other; inf where only one has any."""
    one, other = border(a), border(b)
    if not len(one) or not len(other):
        return 0.0 if len(one) == len(other) else float("inf")
    distance = np.linalg.norm(one[:, None] - other[None], axis=2)
    return float(np.concatenate([distance.min(axis=1), distance.min(axis=0)]).mean())


TIMED = (
    ("relief", "CANDELA", False, "RELIEF"),
    ("relief, thin features", "CANDELA", False, "RELIEF", True),
    ("mesh", "CANDELA", True, "MESH"),
    ("Cycles", "CYCLES", True, "AUTO"),
    ("EEVEE", "BLENDER_EEVEE", True, "AUTO"),
)


def timed(name: str, engine: str, subdivided: bool, mode: str, safe: bool = False) -> tuple[float, float]:
    """Seconds of the wall and of processors, the least of some renders of a scene that has just been built, after a
    first one."""
    detail = SCENES[name].detail if subdivided else 0
    again = 1 if engine == "BLENDER_EEVEE" else 3
    spent = [once(name, engine, detail, mode, relief_scenes.IMAGE, safe) for _ in range(1 + again)]
    seconds, work = (min(column) for column in zip(*spent[1:], strict=True))
    return seconds, work


def once(name: str, engine: str, detail: int, mode: str, size: int, safe: bool = False) -> tuple[float, float]:
    """Seconds of a render of a scene that has just been built, and of processors meanwhile."""
    import bpy

    from addon.compare.reference import render_passes

    relief_scenes.build(name, "SUN", detail, mode, size, safe)
    start, work = time.perf_counter(), time.process_time()
    render_passes(bpy.context.scene, engine, SAMPLES, 0, size=SIZE, bounces=0)
    return time.perf_counter() - start, time.process_time() - work


DETAILS = (64, 128, 256, 512, 1024)
GROWN = ("stones", "cylinder")
LARGE = 512  # from which on a mesh is rendered once: it takes a minute


def growth_table(options: argparse.Namespace) -> list[list[str]]:
    """Relief and mesh by detail."""
    details = options.details
    rows = [["scene", "faces", "relief", "mesh", "mesh / relief", "by processor seconds"]]
    for name in GROWN:
        for how in (0, "RELIEF"), (details[0], "MESH"):  # programs
            once(name, "CANDELA", *how, details[0])
        for detail in details:
            relief, mesh = [], []
            for turn in range(3):
                relief.append(once(name, "CANDELA", 0, "RELIEF", detail))
                if not turn or detail < LARGE:
                    mesh.append(once(name, "CANDELA", detail, "MESH", detail))
            (fast, work), (slow, more) = (np.min(one, axis=0) for one in (relief, mesh))
            columns, lines = (3 * detail, detail // 2) if name == "cylinder" else (detail, detail)
            ratios = f"{slow / fast:.1f}", f"{more / work:.1f}"
            rows.append([SCENES[name].label, f"{columns} x {lines}", f"{fast:.2f}", f"{slow:.2f}", *ratios])
            print("  ".join(rows[-1]), flush=True)
    return rows


# The search as arrays, for the table of iterations -------------------------------------------------------------------


def heights_at(field: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Bilinear, wrapped."""
    size = len(field)
    x, y = u * size - 0.5, v * size - 0.5
    i, j = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = x - i, y - j
    i0, i1, j0, j1 = i % size, (i + 1) % size, j % size, (j + 1) % size
    below = field[j0, i0] * (1 - fx) + field[j0, i1] * fx
    return below * (1 - fy) + (field[j1, i0] * (1 - fx) + field[j1, i1] * fx) * fy


@dataclass(frozen=True)
class Searched:
    """Of rays that found the field: iterations, and where each stood after so many."""

    iterations: np.ndarray
    t: np.ndarray  # (k, N) after 1 to k iterations


def search(
    field: np.ndarray, angle: float, steps: int, method: str, rays: int = 20_000, most: int = 10,
    enough: float = 0.01, seed: int = 7,
) -> Searched:  # fmt: skip
    """Random rays at `angle` radians from the normal into a field a tenth of its tile deep: a linear search and then
    FALSE_POSITION (Illinois), INTERVAL (plain false position) or BISECTION, as shaders/surface/relief.glsl has them."""
    rng = np.random.default_rng(seed)
    u0, v0, turn = rng.random(rays), rng.random(rays), 2 * np.pi * rng.random(rays)
    du, dv = (0.1 * np.tan(angle) * trig(turn) for trig in (np.cos, np.sin))

    def f(t):
        return 1.0 - t - heights_at(field, u0 + t * du, v0 + t * dv)

    t0, f0 = np.zeros(rays), f(np.zeros(rays))
    t1, f1 = t0.copy(), f0.copy()
    found = f0 <= 0.0
    outside = ~found
    for i in range(1, steps + 1):
        t, now = np.full(rays, i / steps), f(np.full(rays, i / steps))
        hit = ~found & (now <= 0.0)
        t1, f1 = np.where(hit, t, t1), np.where(hit, now, f1)
        found |= hit
        t0, f0 = np.where(found, t0, t), np.where(found, f0, now)
    good = found & outside
    count, done, kept, t, path = np.zeros(rays), ~good, np.zeros(rays), t1.copy(), []
    for _ in range(most):
        gap = f0 - f1
        part = np.where((method == "BISECTION") | (gap < 1e-30), 0.5, f0 / np.where(gap < 1e-30, 1.0, gap))
        now = t0 + (t1 - t0) * part
        height = f(now)
        active = ~done
        t = np.where(active, now, t)
        count += active
        done |= np.abs(height) <= enough
        upper = height > 0.0
        half = np.where(method == "FALSE_POSITION", 0.5, 1.0)
        f1_next = np.where(upper & (kept > 0), f1 * half, f1)
        f0_next = np.where(~upper & (kept < 0), f0 * half, f0)
        t0, f0 = np.where(upper, now, t0), np.where(upper, height, f0_next)
        t1, f1 = np.where(upper, t1, now), np.where(upper, f1_next, height)
        kept = np.where(upper, 1.0, -1.0)
        path.append(t.copy())
    return Searched(count[good], np.array(path)[:, good])


ITERATION_FIELDS = ("sines", "stones", "pyramids", "fractal")
RAYS = tuple((angle, steps) for angle in (45, 75) for steps in (5, 16))
# Mean iterations of bisection and of false position that the specification gives for these fields and rays.
EXPECTED = {
    "sines": ((3.00, 1.00), (1.96, 1.00), (3.99, 2.02), (2.69, 1.01)),
    "stones": ((3.72, 1.37), (2.38, 1.08), (4.48, 3.03), (3.00, 1.57)),
    "pyramids": ((3.10, 1.17), (2.01, 1.02), (4.09, 1.77), (2.75, 1.13)),
    "fractal": ((3.03, 1.43), (1.93, 1.00), (3.71, 2.30), (2.53, 1.57)),
}


def iterations(name: str, angle: int, steps: int) -> tuple[float, float]:
    """Mean iterations of bisection and of false position over rays at `angle` degrees."""
    field = relief_scenes.field(name)
    means = [search(field, np.radians(angle), steps, how).iterations.mean() for how in ("BISECTION", "INTERVAL")]
    return float(means[0]), float(means[1])


def iteration_table(options: argparse.Namespace) -> list[list[str]]:
    rows = [["field", *(f"{angle}°, {steps} steps" for angle, steps in RAYS)]]
    for name in ITERATION_FIELDS:
        found = [iterations(name, *ray) for ray in RAYS]
        rows.append([name, *(f"{a:.2f} / {b:.2f}" for a, b in found)])
    return rows


STUDY = Study(
    "relief",
    dict(zip(TITLES, (error_table, time_table, growth_table, iteration_table), strict=True)),
    {
        "--scenes": some_of(SCENES),
        "--lamps": some_of(LAMPS),
        "--details": {"nargs": "*", "type": int, "default": DETAILS, "help": "of the table by detail"},
        "--pictures": PICTURES,
    },
    TITLES,
)
add_options, command = STUDY.add_options, STUDY.command
