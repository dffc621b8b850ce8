"""Where the time of a whole render goes, and what a second one saves: `python -m bench profile`.

Per sample scene: a cold render (programs compile), a warm one of a changed seed, one of the unchanged scene, and one
more under Python's profiler, which tells calls into Blender's GPU module apart from everything else. Shares are of that
profiled render; the profiler slows Python and not the GPU, so the share of Python is an upper bound. "GPU" is drawing
and waiting for it, "readback" is fetching pixels after the last sample, "Blender" is its own evaluation and result.

On a busy machine, where whoever is interrupted looks slow, the processor seconds of the warm render still tell: those
of Python's own thread (which also hands draws to the driver) beside those of all threads, a software GPU's included.

A run of some scenes leaves the rows of the others.

Targets: Python and sync together below 15 % of a render of 16 samples; an unchanged scene at least twice as fast.
"""

from __future__ import annotations

import argparse
import cProfile
import datetime as dt
import json
import pstats
import sys
import time
from pathlib import Path

from bench.cells import ROOT, Scene, Series, named_scenes
from bench.markdown import write_whole

RESULTS = ROOT / "bench" / "results" / "profile.json"
MOST_PYTHON = 0.15
LEAST_REUSE = 2.0
GPU_NAMES = ("gpu.", "'GPU", "gpu_extras")  # how the profiler names functions of Blender's GPU module
SERIES = Series("Candela", "CANDELA", ())


def is_gpu(function: tuple[str, int, str]) -> bool:
    """Whether a function of the profile is one of Blender's GPU module: drawing, uploading, reading back."""
    file, _, name = function
    return file == "~" and any(part in name for part in GPU_NAMES)


def is_compiling(function: tuple[str, int, str]) -> bool:
    return function[0] == "~" and "create_from_info" in function[2]


def is_blender(function: tuple[str, int, str]) -> bool:
    """Blender's own part of the render, outside the engine."""
    return function[0] == "~" and "_bpy" in function[2]


def shares(stats: dict, stages: dict[str, float]) -> dict[str, float]:
    """Shares of a profiled render by what the time was spent on. `stats` are pstats': seconds of a function alone."""
    alone = {function: row[2] for function, row in stats.items()}
    total = sum(alone.values())
    compiling = sum(seconds for function, seconds in alone.items() if is_compiling(function))
    gpu = sum(seconds for function, seconds in alone.items() if is_gpu(function)) - compiling
    blender = sum(seconds for function, seconds in alone.items() if is_blender(function))
    readback = min(stages.get("readback", 0.0), gpu)
    sync = min(stages.get("sync", 0.0), total)
    python = max(total - compiling - gpu - blender - sync, 0.0)
    parts = {"sync": sync, "compile": compiling, "GPU": gpu - readback, "readback": readback, "Python": python}
    return {name: value / total for name, value in {**parts, "Blender": blender}.items()}


def dearest(stats: dict, count: int) -> list[tuple[str, float]]:
    """Python functions by the seconds that they take alone, calls that a function makes into numpy with it."""
    found: dict[str, float] = {}
    for function, (_, _, seconds, _, callers) in stats.items():
        if is_gpu(function) or is_blender(function) or is_compiling(function):
            continue
        if "/addon/" in function[0].replace("\\", "/"):
            found[place(function)] = found.get(place(function), 0.0) + seconds
            continue
        for caller, row in callers.items():
            if "/addon/" in caller[0].replace("\\", "/"):
                found[place(caller)] = found.get(place(caller), 0.0) + row[2]
    return sorted(found.items(), key=lambda item: -item[1])[:count]


def place(function: tuple[str, int, str]) -> str:
    """`scene/culling.py: seen`."""
    file = function[0].replace("\\", "/").rpartition("/addon/")[2]
    return f"{file}: {function[2]}"


def profile(scene: Scene, samples: int, size: tuple[int, int]) -> dict:
    """All figures of one scene."""
    import bpy

    from addon.compare import reference
    from addon.frame import ledger
    from bench import worker

    opened = worker.open_scene(scene, size, 0)

    def seconds(seed: int, profiler: cProfile.Profile | None = None) -> float:
        with reference.overridden(worker.settings_for(opened, SERIES, samples, seed, size, False)):
            started = time.perf_counter()
            if profiler:
                profiler.enable()
            bpy.ops.render.render(scene=opened.scene.name, layer=opened.layer.name)
            if profiler:
                profiler.disable()
            return time.perf_counter() - started

    cold = seconds(1)
    own, all_threads = time.thread_time(), time.process_time()
    warm = seconds(2)
    own, all_threads = time.thread_time() - own, time.process_time() - all_threads
    unchanged = seconds(2)
    profiler = cProfile.Profile()
    profiled = seconds(3, profiler)
    stats = pstats.Stats(profiler).stats
    return {
        "scene": scene.name, "cold": cold, "warm": warm, "unchanged": unchanged, "profiled": profiled,
        "cpu": {"own thread": own, "all threads": all_threads},
        "shares": shares(stats, ledger.latest().times),
        "dearest": [[name, value / profiled] for name, value in dearest(stats, 6)],
    }  # fmt: skip


def missed(row: dict) -> list[str]:
    """What the scene's figures miss, as sentences."""
    found = []
    python = row["shares"]["Python"] + row["shares"]["sync"]
    if python > MOST_PYTHON:
        names = ", ".join(f"{name} {100 * share:.0f} %" for name, share in row["dearest"][:3])
        found.append(f"{row['scene']}: Python and sync take {100 * python:.0f} % ({names}).")
    if row["warm"] < LEAST_REUSE * row["unchanged"]:
        found.append(f"{row['scene']}: an unchanged scene is only {row['warm'] / row['unchanged']:.1f} times faster.")
    return found


def table(rows: list[dict]) -> list[tuple[str, ...]]:
    names = list(rows[0]["shares"])
    found = [("scene", "cold s", "warm s", "unchanged s", "faster", "CPU own s", "CPU all s", *names)]
    for row in rows:
        seconds = (row["cold"], row["warm"])
        found.append((
            row["scene"].replace("_", " "), *(f"{value:.2f}" for value in seconds), f"{row['unchanged']:.3f}",
            f"{row['warm'] / row['unchanged']:.0f} ×", *(f"{value:.2f}" for value in row["cpu"].values()),
            *(f"{100 * row['shares'][name]:.1f} %" for name in names),
        ))  # fmt: skip
    return found


# ------------------------------------------------------------------------------------------------------------- command


def add_options(parser: argparse.ArgumentParser) -> None:
    from bench.run import size_of

    parser.add_argument("--scenes", nargs="+", metavar="NAME", help="default: all of sample_blends")
    parser.add_argument("--samples", default=16, type=int, metavar="N", help="default 16")
    parser.add_argument("--size", default=(128, 96), type=size_of, metavar="WxH", help="default 128x96")
    parser.add_argument("--budget", type=float, metavar="MINUTES", help="leave out the scenes that do not fit")
    parser.add_argument("--results", default=RESULTS, type=Path, metavar="PATH")


def kept(results: Path, about: dict) -> list[dict]:
    """Rows of an earlier run that can stand beside those of this one: of the same machine, size and samples."""
    if not results.is_file():
        return []
    earlier = json.loads(results.read_text(encoding="utf-8"))
    alike = ("device", "cpu", "samples", "size")
    return earlier["rows"] if all(earlier["about"].get(name) == about.get(name) for name in alike) else []


def joined(earlier: list[dict], rows: list[dict]) -> list[dict]:
    """Both by scene, of the same scene the later."""
    found = {row["scene"]: row for row in (*earlier, *rows)}
    return [found[name] for name in sorted(found)]


def command(options: argparse.Namespace) -> int:
    import bpy  # noqa: F401
    from tqdm import tqdm

    import addon
    from addon.cli.terminal import quiet
    from bench import worker
    from bench.quick import table as aligned
    from bench.run import load, rounded

    try:
        scenes = named_scenes(options.scenes)
    except ValueError as error:
        print(error, file=sys.stderr)
        return 2
    addon.register()
    with quiet() as terminal:
        about = worker.about()
        bar = tqdm(scenes, file=terminal, disable=not terminal.isatty(), unit="scene")
        end = float("inf") if options.budget is None else time.monotonic() + 60 * options.budget
        rows = [profile(scene, options.samples, options.size) for scene in bar if time.monotonic() < end]
    about |= {"date": dt.datetime.now(dt.UTC).strftime("%Y-%m-%d %H:%M UTC"), "load": load()}
    about |= {"samples": options.samples, "size": list(options.size)}
    options.results.parent.mkdir(parents=True, exist_ok=True)
    rows = joined(kept(options.results, about), rows)
    text = json.dumps(rounded({"about": about, "rows": rows}), indent=1, ensure_ascii=False)
    write_whole(options.results, text + "\n")
    print(aligned(table(rows)))
    misses = [sentence for row in rows for sentence in missed(row)]
    print("\n".join(misses) or "Both targets are met on every scene.")
    print(options.results)
    return 0
