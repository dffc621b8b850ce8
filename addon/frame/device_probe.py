"""Measures what the device does: a few kernels at the first use, in less than 0.2 s and what it takes to compile them.

Blender has no timer queries, so each kernel is asked for, waited for by a texel that is read back, and timed on the
clock, less what the wait alone takes. A kernel begins small and grows fourfold until it takes LEAST_S: then the wait is
a small part of it on a software driver and on a fast card alike. Of REPEATS runs at that size the least counts, since
whatever else the machine does can only add.

Kernels are those of the choices that ask: shadow rays between towers (trace/hierarchy.glsl, the same code as pictures
run), small triangles and whole quads into a depth map, views with nothing in them, passes of one pixel, texels far
apart from a texture and from an image, edges of a shadow, and steps of arithmetic in a fragment and in a compute
program. What they leave out: caches that a whole picture fills, divergence of scenes with deep trees, alpha. They are
good for choices between methods that differ by a factor, not for forecasts.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from ..gfx import device, geometry, images, passes
from ..gfx.device import Device
from ..gfx.library import Program
from ..gfx.user_folder import user_folder
from ..scene import acceleration
from ..scene.culling import Boxes
from ..scene.projection import ROWS
from ..scene.traced_triangles import opaque_code

LEAST_S, REPEATS = 0.002, 2
SIDE = 1024  # of the target
SMALLEST = 32
TRIANGLES = 4096  # of the hierarchy and of the mesh
VIEWS, BOXES = 8, 64
READS, READ_SIDE = 64, 512
EDGES = 32  # of a shadow
STEPS = 64  # of arithmetic
DIGITS = 2  # to which figures are rounded, so that noise turns no choice

RAY = passes.fullscreen_program(
    "probe of rays", "probe/ray.frag.glsl", textures=acceleration.HIERARCHY_TEXTURES, constants=(("INT", "side"),),
    outputs=(("VEC4", "out_color"),),
)  # fmt: skip
DEPTH = Program(
    name="probe of depth maps",
    vertex="probe/depth.vert.glsl",
    fragment="depth_map/opaque.frag.glsl",
    inputs=(("VEC3", "position"),),
    varyings=(("smooth", "VEC2", "depth_terms"),),
    outputs=(("VEC4", "out_depth"),),
    constants=(*ROWS,),
)
FLAT = {"row_x": (1.0, 0.0, 0.0, 0.0), "row_y": (0.0, 1.0, 0.0, 0.0), "row_w": (0.0, 0.0, 0.0, 1.0),
        "row_q": (0.0, 0.0, 1.0, 0.0), "near": 0.5}  # fmt: skip


def _texels_read(name: str, read: str, **declared) -> Program:
    defines = (("READS", str(READS)), ("SIDE", str(READ_SIDE)), ("PROBED(texel)", read))
    return passes.fullscreen_program(
        f"probe of {name}", "probe/texels.frag.glsl", outputs=(("VEC4", "out_color"),), defines=defines, **declared
    )


# The type without a format keeps the texture from being bound as an image where those are faster (gfx/library.py).
FETCH = _texels_read("fetches", "texelFetch(probed, texel, 0)", textures=(("FLOAT_2D", "probed"),))
LOAD = _texels_read("loads", "imageLoad(probed, texel)", images=(("probed", "RGBA32F", "FLOAT_2D", "READ"),))

EDGE = passes.fullscreen_program(
    "probe of edges", "probe/edges.frag.glsl", textures=(("RGBA32F", "edge_records"), ("RGBA32F", "light_pattern")),
    constants=(("INT", "side"),), outputs=(("VEC4", "out_color"),), defines=(("EDGES", str(EDGES)),),
)  # fmt: skip

STEP = passes.program_of_pixels(
    "probe of steps", "probe/steps.glsl", outputs=(("VEC4", "out_color"),), defines=(("STEPS", str(STEPS)),)
)


def folder() -> Path:
    """Where the figures of drivers are kept."""
    return user_folder("devices")


def ensure(measures: bool = True) -> Device:
    """The figures of this device: given, known, kept, or measured now, which takes a second; without `measures` made up
    instead. A GPU context must be active."""
    if not device.known():
        found = device.given() or device.read(folder())
        if found is None and not measures:
            return device.current()
        if found is None:
            found = measure()
            device.write(folder(), found)
        device.use(found)
    return device.current()


def measure() -> Device:
    """Measure now."""
    started = time.perf_counter()
    target = images.Target((images.create(SIDE, SIDE, "RGBA32F"),), images.create(SIDE, SIDE, "DEPTH_COMPONENT32F"))
    wait = _least(lambda: None)
    found = {
        "fetch": _reads(target, FETCH, "textures", wait),
        "load": _reads(target, LOAD, "images", wait),
    }
    # Rays read the hierarchy in the way that is faster here.
    device.use(replace(device.MADE_UP["card"], **{name: 1e9 * seconds for name, seconds in found.items()}))
    found |= {
        "ray_level": _rays(target, wait) / math.log2(TRIANGLES),
        "triangle": _triangles(target, wait),
        "texel": _texels(target, wait),
        "view": _views(target, wait),
    }
    found["edge"] = _edges(target, wait)
    found["fragment"], found["compute"] = _steps(target, wait)
    found["render_pass"], found["python"] = _passes(target, wait)
    device.measured_s = time.perf_counter() - started
    return Device(**{field.name: _rounded(1e9 * found[field.name]) for field in fields(Device)})


def _rounded(value: float) -> float:
    value = max(value, 1e-3)
    return float(f"{value:.{DIGITS - 1}e}")


def _least(work: Callable[[], None]) -> float:
    """Seconds until the GPU has done it."""
    best = math.inf
    for _ in range(REPEATS):
        images.finish()
        started = time.perf_counter()
        work()
        images.finish()
        best = min(best, time.perf_counter() - started)
    return best


def _each(work: Callable[[int], None], sizes: list[int], units: Callable[[int], int], wait: float) -> float:
    """Seconds of one of `units(size)` things that `work(size)` does, at the first size that takes long enough."""
    work(sizes[0])  # compiles
    for size in sizes:
        seconds = _least(lambda n=size: work(n)) - wait
        if seconds >= LEAST_S:
            break
    return max(seconds, 0.0) / units(size)


def _sides() -> list[int]:
    return [SMALLEST << k for k in range(int(math.log2(SIDE // SMALLEST)) + 1)]


def _town() -> np.ndarray:
    """(T, 3, 3) float32: towers of twelve triangles on a unit square, as dense as a town's."""
    random = np.random.default_rng(0)
    columns = math.isqrt(TRIANGLES // 12)
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = np.array([(f[0], f[k], f[k + 1]) for f in faces for k in (1, 2)])
    places = np.stack(np.meshgrid(*[np.arange(columns) / columns] * 2, [0.0]), axis=-1).reshape(-1, 1, 3)
    sizes = random.uniform((0.3, 0.3, 0.3), (0.8, 0.8, 3.0), (len(places), 3))[:, None] / columns
    return (places + corners * sizes)[:, triangles].reshape(-1, 3, 3).astype(np.float32)


def _rays(target: images.Target, wait: float) -> float:
    corners = _town()
    look = np.zeros((len(corners), 8))
    look[:, 0] = opaque_code()
    hierarchy = acceleration.build(corners, look).hierarchy

    def work(side: int) -> None:
        view = (0, 0, side, side)
        passes.fullscreen(RAY, target, viewport=view, textures=hierarchy.textures, constants={"side": side})

    return _each(work, _sides(), lambda side: side * side, wait)


def _triangles(target: images.Target, wait: float) -> float:
    places = np.random.default_rng(1).random((TRIANGLES, 1, 3)) * (2.0, 2.0, 1.0) - (1.0, 1.0, 0.0)
    corners = places + np.array([[0, 0, 0], [2, 0, 0], [0, 2, 0]]) / SIDE
    batch = _batch(corners)

    def work(times: int) -> None:
        shader = passes.get(DEPTH)
        with passes.drawing(target):
            shader.bind(constants=FLAT)
            for _ in range(times):
                passes.draw(shader, batch)

    return _each(work, [1, 4, 16, 64, 256], lambda times: times * TRIANGLES, wait)


def _texels(target: images.Target, wait: float) -> float:
    batch = _batch(np.array([[[-1, -1, 0], [3, -1, 0], [-1, 3, 0]]]))

    def work(times: int) -> None:
        shader = passes.get(DEPTH)
        for _ in range(times):
            target.clear()
            with passes.drawing(target, viewport=(0, 0, SIDE // 4, SIDE // 4)):
                shader.bind(constants=FLAT)
                passes.draw(shader, batch)

    # The whole target is cleared, a sixteenth of it drawn: clearing is far cheaper on GPUs, and dearer in software.
    return _each(work, [1, 4, 16, 64], lambda times: times * SIDE * SIDE // 4, wait)


def _views(target: images.Target, wait: float) -> float:
    """A view as lighting/depth_maps.py draws it: boxes tested, two states, constants, and here nothing that is seen."""
    batch = _batch(np.full((1, 3, 3), 2.0))
    boxes = Boxes.between(np.zeros((BOXES, 3)), np.ones((BOXES, 3)))
    rows = np.stack([FLAT[name] for name in ("row_x", "row_y", "row_w", "row_q")])

    def work(times: int) -> None:
        shader = passes.get(DEPTH)
        for number in range(times * VIEWS):
            seen = boxes.seen(rows)
            for cull in ("BACK", "NONE"):
                with passes.drawing(target, viewport=(number % 4, 0, 8, 8), cull=cull):
                    shader.bind(constants=FLAT)
                    if np.flatnonzero(seen).size:
                        passes.draw(shader, batch)

    return _each(work, [1, 4, 16], lambda times: times * VIEWS, wait)


def _reads(target: images.Target, program: Program, kind: str, wait: float) -> float:
    probed = images.upload(np.ones((READ_SIDE, READ_SIDE, 4), np.float32))

    def work(side: int) -> None:
        passes.fullscreen(program, target, viewport=(0, 0, side, side), **{kind: {"probed": probed}})

    return _each(work, _sides(), lambda side: side * side * READS, wait)


def _edges(target: images.Target, wait: float) -> float:
    """Edges over a floor before a square lamp, of which every pixel is asked about all."""
    random = np.random.default_rng(2)
    ends = np.zeros((2 * EDGES, 4), np.float32)
    ends[:, :3] = np.repeat(random.uniform((0, 0, 0.4), (1, 1, 0.6), (EDGES, 3)), 2, axis=0)
    ends[:, :3] += random.normal(0, 0.1, (2 * EDGES, 3))
    textures = {
        "edge_records": images.upload(ends[None]),
        "light_pattern": images.upload(random.uniform(-1, 1, (1, 32, 4)).astype(np.float32)),
    }

    def work(side: int) -> None:
        passes.fullscreen(EDGE, target, viewport=(0, 0, side, side), textures=textures, constants={"side": side})

    return _each(work, _sides(), lambda side: side * side * EDGES, wait)


def _steps(target: images.Target, wait: float) -> tuple[float, float]:
    """Of a pixel, by a fragment and by a compute program of the same body."""
    computed = passes.computed(STEP, (target.colors[0].format,))

    def draw(side: int) -> None:
        passes.fullscreen(STEP, target, viewport=(0, 0, side, side))

    def compute(side: int) -> None:
        passes.compute(computed, (side, side), images={"to_out_color": target.colors[0]}, constants={"rows": (0, side)})

    # Large from the start: software drivers wait before each dispatch.
    drawn, found = (_each(work, _sides()[3:], lambda side: side * side, wait) for work in (draw, compute))
    return drawn, found


def _passes(target: images.Target, wait: float) -> tuple[float, float]:
    """Seconds of a pass over one pixel that depends on the one before it, and until it is asked for."""
    one, other = (images.Target((images.create(1, 1, "RGBA32F"),)) for _ in range(2))
    count = 2 * VIEWS

    def work() -> None:
        for number in range(count):
            source, shown = (one, other) if number % 2 else (other, one)
            passes.copy(source.colors[0], shown)

    work()
    whole, asked = math.inf, math.inf
    for _ in range(REPEATS):
        images.finish()
        started = time.perf_counter()
        work()
        ended = time.perf_counter()
        images.finish()
        asked, whole = min(asked, ended - started), min(whole, time.perf_counter() - started)
    return max(whole - wait, asked) / count, asked / count


def _batch(corners: np.ndarray) -> geometry.Batch:
    vertices = geometry.vertex_buffer(position=corners.reshape(-1, 3).astype(np.float32))
    return geometry.triangle_batch(vertices, np.arange(3 * len(corners)).reshape(-1, 3))
