"""What a picture asks of the GPU, and Python's own time in it, counted: `python -m bench counted`, which needs no GPU.

Of each scene, at 16x12 pixels and one sample after a move of the camera: readbacks, draws, dispatches, uploads,
programs bound, framebuffers, files, climbs, and the functions that take the longest themselves. A climb is a file that
calls one of a room that stands below its own in docs/architecture.md, so that it may not import it: by what was handed
down. Pairs of files count once; methods of the contract of techniques do not. Of several pictures each function's least
time counts, so that what else the machine does adds little.

Calls into Blender's GPU module are counted by Python's profiler, framebuffers where `gfx` makes them. Own time is what
the add-on's functions take themselves, without what they call in numpy, Blender and the driver; Python's is all but the
calls into Blender, with the profiler, which at least doubles what such short functions take.
"""

from __future__ import annotations

import argparse
import cProfile
import pstats
import re
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path

from addon.frame.technique import Technique
from bench.profile import is_blender, is_gpu

DRAWS = ("draw", "draw_instanced", "draw_range")


@dataclass(frozen=True)
class Counts:
    """Of one call. `waits` are texels read for the sake of waiting, `readbacks` all other reads of images."""

    readbacks: int
    waits: int
    draws: int
    dispatches: int
    uploads: int  # images made with content, and uniform blocks written
    framebuffers: int
    passes: int  # programs bound: full-screen passes, and materials and views of meshes
    files: int  # of the add-on that are at work
    climbs: int
    python_ms: float
    own_ms: float


def counted(work: Callable[[], object]) -> Counts:
    """Run `work` under the profiler and count."""
    stats, framebuffers = _profiled(work)
    return of_stats(stats, framebuffers)


def counted_often(work: Callable[[], object], times: int) -> tuple[Counts, list[tuple[float, int, str]]]:
    """The same of the last of several runs, with the least time of each function among them; and the add-on's functions
    as (milliseconds, calls, name), those first that take the longest."""
    least: dict[tuple, float] = {}
    for _ in range(times):
        stats, framebuffers = _profiled(work)
        for function, (_, _, own, *_) in stats.items():
            least[function] = min(own, least.get(function, own))
    found = {function: (row[0], row[1], least[function], *row[3:]) for function, row in stats.items()}
    rows = [(1000 * row[2], row[1], _name(function)) for function, row in found.items() if _is_own(function)]
    return of_stats(found, framebuffers), sorted(rows, reverse=True)


def _profiled(work: Callable[[], object]) -> tuple[dict, int]:
    """pstats' rows of a run, and how many framebuffers it made."""
    from addon.gfx import images

    made = [0]
    original = images.gpu
    images.gpu = _Watched(original, made)
    profiler = cProfile.Profile()
    try:
        profiler.enable()
        work()
    finally:
        profiler.disable()
        images.gpu = original
    return pstats.Stats(profiler).stats, made[0]


def _is_own(function: tuple[str, int, str]) -> bool:
    return "/addon/" in function[0].replace("\\", "/")


def _name(function: tuple[str, int, str]) -> str:
    file, _, name = function
    return f"{file.replace(chr(92), '/').rpartition('/addon/')[2]}:{name}" if _is_own(function) else name


def of_stats(stats: dict, framebuffers: int) -> Counts:
    """The same from pstats' rows."""
    calls: dict[str, int] = {}
    own = python = 0.0
    for function, (_, count, seconds, *_) in stats.items():
        own += seconds if _is_own(function) else 0.0
        python += 0.0 if is_gpu(function) or is_blender(function) else seconds
        name = _name(function)
        calls[name] = calls.get(name, 0) + count

    files, climbs = files_and_climbs(stats)

    def gpu_calls(kind: str, method: str) -> int:
        return sum(count for name, count in calls.items() if f"method '{method}'" in name and kind in name)

    waits = calls.get("gfx/images.py:finish", 0)
    return Counts(
        readbacks=gpu_calls("GPUTexture", "read") - waits,
        waits=waits,
        draws=sum(gpu_calls("GPUBatch", method) for method in DRAWS),
        dispatches=sum(count for name, count in calls.items() if name.startswith("<built-in") and "dispatch" in name),
        uploads=calls.get("gfx/images.py:upload", 0) + gpu_calls("GPUUniformBuf", "update"),
        framebuffers=framebuffers,
        passes=calls.get("gfx/library.py:bind", 0),
        files=len(files),
        climbs=len(climbs),
        python_ms=1000 * python,
        own_ms=1000 * own,
    )


CONTRACT = frozenset(dir(Technique))
ROOMS = re.compile(r"^    addon/(\w+)/ ", re.MULTILINE)


def files_and_climbs(stats: dict) -> tuple[set[str], set[tuple[str, str]]]:
    """Files of the add-on that are at work, and pairs of them of which the first calls the second, above it."""
    rooms = ROOMS.findall((Path(__file__).parents[1] / "docs" / "architecture.md").read_text(encoding="utf-8"))

    def level(file: str) -> int:
        room = file.partition("/")[0]
        return rooms.index(room) if room in rooms else len(rooms)

    files, climbs = set(), set()
    for function, (*_, callers) in stats.items():
        if _is_own(function):
            called = _name(function).partition(":")[0]
            files.add(called)
            for caller in filter(_is_own, callers):
                calling = _name(caller).partition(":")[0]
                if level(calling) < level(called) and function[2] not in CONTRACT:
                    climbs.add((calling, called))
    return files, climbs


class _Watched:
    """Blender's GPU module, with a count of the framebuffers that are made."""

    def __init__(self, module, made: list[int]):
        self._module, self._made = module, made

    def __getattr__(self, name: str):
        if name == "types":
            return _Watched(self._module.types, self._made)
        if name == "GPUFrameBuffer":
            self._made[0] += 1
        return getattr(self._module, name)


# ------------------------------------------------------------------------------------------------------------- command


COUNTED = ("cornell_box", "window_interior", "alpha_foliage", "soft_shadow_garden", "instances")
SIZE = (16, 12)
PICTURES, BEFORE = 8, 4  # that are profiled, and drawn before


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scenes", nargs="*", default=list(COUNTED), metavar="SCENE", help="of sample_blends")
    parser.add_argument("--top", type=int, default=0, metavar="N", help="list the N functions that take the longest")
    parser.add_argument("--climbs", action="store_true", help="list them")


def command(options: argparse.Namespace) -> int:
    import bpy

    import addon
    from addon.cli.terminal import quiet
    from bench.cells import SCENES

    addon.register()
    with quiet() as terminal:
        for name in options.scenes:
            bpy.ops.wm.open_mainfile(filepath=str(SCENES / f"{name}.blend"))
            scene = bpy.context.scene
            scene.render.engine, scene.candela.samples = "CANDELA", 1
            scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = *SIZE, 100

            def moved(scene=scene) -> None:
                scene.camera.location.x += 1e-3
                bpy.ops.render.render(scene=scene.name)

            for _ in range(BEFORE):
                moved()
            counts, functions = counted_often(moved, PICTURES)
            figures = ", ".join(f"{field.name} {getattr(counts, field.name)}" for field in fields(Counts)[:-2])
            times = f"Python {counts.python_ms:.1f} ms, its own {counts.own_ms:.1f}"
            print(f"{name}: {figures}; {times}", file=terminal, flush=True)
            if options.climbs:
                found = files_and_climbs(_profiled(moved)[0])[1]
                print("".join(f"  {low} calls {high}\n" for low, high in sorted(found)), end="", file=terminal)
            for milliseconds, calls, function in functions[: options.top]:
                print(f"  {milliseconds:7.2f} ms {calls:6}  {function}", file=terminal, flush=True)
    return 0
