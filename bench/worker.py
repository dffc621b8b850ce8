"""Measures the cells of one scene in a process of its own: `python -m bench.worker`, spoken to by bench/run.py.

Each line on standard input is a request, each line on standard output its answer, both JSON. What Blender prints goes
to standard error's file. A fresh process per scene keeps one scene's memory, programs and crashes away from the next;
within it the engines take turns, so that whatever else the machine does falls on all of them alike.

A time is that of a whole render with Combined alone, from Blender's call to the finished picture. Light paths come from
another render with the same seed, which is not timed (Candela hands out the passes of the frame that it has). Errors
are against one reference with all bounces, so that what an engine leaves out shows as bias.

Candela's programs compile in a render of one sample that is reported apart; what pictures of more samples compile
besides, in one that is not counted. EEVEE's first render counts: on a software GPU its later ones of a scene take
longer than the first (see bench/quick.py). Cycles compiles nothing here.
"""

from __future__ import annotations

import json
import math
import os
import sys
import time
import traceback
from dataclasses import dataclass, replace
from pathlib import Path

from bench.cells import Scene, Series

SHORT = 2.0  # seconds: renders that take less are repeated
RUNS = 3
ALIKE = 4  # samples from which on Candela's pictures need the same programs
SEEDS_OF_ONE_SAMPLE = 6
PATHS = (
    "combined", "direct_light", "diffuse_direct", "glossy_direct", "diffuse_indirect", "glossy_indirect",
    "transmission_direct", "transmission_indirect",
)  # fmt: skip
MOST_PATH_SAMPLES = 64  # of Cycles: beyond, a second render only for its paths is not worth its time


@dataclass
class Open:
    """The scene that is open, and what is kept about it."""

    scene: object  # bpy Scene
    layer: object
    truth: object  # compare.cache.Reference
    warm: set  # of settings and numbers of samples: what Candela compiles for them is compiled


def main() -> int:
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    import bpy  # noqa: F401

    import addon

    addon.register()
    opened: Open | None = None
    for line in sys.stdin:
        request = json.loads(line)
        try:
            if request["ask"] == "about":
                answer = about()
            elif request["ask"] == "open":
                opened = open_scene(scene_of(request["scene"]), tuple(request["size"]), request["reference_samples"])
                answer = about_reference(opened.truth)
            else:
                answer = measure(opened, series_of(request["series"]), request["samples"], tuple(request["size"]))
        except Exception as error:  # the driver says which cell failed and goes on
            traceback.print_exc()
            answer = {"failed": f"{type(error).__name__}: {error}"}
        print(json.dumps(answer), file=answers, flush=True)
    return 0


def scene_of(data: dict) -> Scene:
    return Scene(**data)


def series_of(data: dict) -> Series:
    pairs = {name: tuple(map(tuple, data[name])) for name in ("slots", "values")}
    return Series(**{**data, "samples": tuple(data["samples"]), **pairs})


def about() -> dict:
    """Where it is measured."""
    import platform

    import bpy
    import numpy as np

    from addon.gfx import context
    from bench.quick import cpu_name

    context.ensure()
    return {
        "blender": bpy.app.version_string,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "device": context.describe(),
        "cpu": f"{cpu_name()}, {os.cpu_count()} threads",
        "threads": os.cpu_count(),
        "system": platform.platform(),
    }


def open_scene(scene: Scene, size: tuple[int, int], reference_samples: int) -> Open:
    """Open or build the scene and fetch its reference; without reference samples it has none."""
    import bpy

    from addon.compare import reference

    if scene.file:
        bpy.ops.wm.open_mainfile(filepath=str(scene.file))
    else:
        from bench.families import build

        build(scene.family, scene.dial)
    layer = reference.active_view_layer(bpy.context.scene)
    truth = reference.reference(bpy.context.scene, reference_samples, False, size, layer) if reference_samples else None
    return Open(bpy.context.scene, layer, truth, set())


def about_reference(truth) -> dict:
    """Noise floor of the reference per light path: the error that it has itself."""
    from addon.compare import metrics

    if truth is None:
        return {}
    paths, halves = truth.paths()
    paths["combined"], halves["combined"] = truth.images["combined"], truth.half["combined"]
    floors = {}
    for name in PATHS:
        if name in paths and paths[name][..., :3].mean() > metrics.BLACK:
            error = metrics.compare_radiance(name, paths[name], paths[name], halves[name])
            floors[name] = {"relmse": error.floor, "bias": error.bias_floor}
    mean = float(truth.images["combined"][..., :3].mean())
    share = {name: float(paths[name][..., :3].mean()) / max(mean, 1e-30) for name in floors}
    return {"samples": truth.samples, "seconds": truth.seconds, "cached": truth.cached, "floors": floors,
            "share": share}  # fmt: skip


# ------------------------------------------------------------------------------------------------------------ one cell


def settings_for(opened: Open, series: Series, samples: int, seed: int, size: tuple[int, int], passes: bool) -> list:
    """What is changed for a render. Peers keep their own quality settings: only what the series names is set."""
    from addon.compare import reference

    scene, layer = opened.scene, opened.layer
    engine = reference.engine_identifier(scene, series.engine)
    chosen = reference.render_settings(scene, layer, engine, samples, seed, series.bounces, size)
    own = {scene.render, scene.render.image_settings, scene.eevee, scene.candela}
    settings = [one for one in chosen if one[0] in own or (passes and one[1].startswith("use_pass"))]
    if series.engine == "CYCLES":
        cycles = scene.cycles
        settings += [
            (cycles, "samples", samples),
            (cycles, "seed", seed),
            (cycles, "device", "CPU"),
            (cycles, "use_adaptive_sampling", False),
            (cycles, "use_denoising", series.denoised),
        ]
        if series.bounces is not None:
            settings.append((cycles, "max_bounces", series.bounces))
    elif series.engine == "BLENDER_EEVEE":
        settings.append((scene.eevee, "use_raytracing", series.ray_traced))
    else:
        settings += [(scene.candela, f"slot_{slot}", technique) for slot, technique in series.slots]
        settings += [(scene.candela, name, value) for name, value in series.values]
    return settings


def render(opened: Open, series: Series, samples: int, seed: int, size: tuple[int, int], passes: bool = False) -> dict:
    """One whole render: seconds, processor seconds, and its images by Candela's names."""
    import tempfile

    import bpy

    from addon.compare import reference
    from addon.snapshot.exr import read_exr

    scene, layer = opened.scene, opened.layer
    with reference.overridden(settings_for(opened, series, samples, seed, size, passes)):
        start, cpu_start = time.perf_counter(), time.process_time()
        bpy.ops.render.render(scene=scene.name, layer=layer.name)
        seconds, cpu = time.perf_counter() - start, time.process_time() - cpu_start
        result = next(image for image in bpy.data.images if image.type == "RENDER_RESULT")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "picture.exr"
            result.save_render(str(path), scene=scene)
            images = reference.named_images(read_exr(path), layer.name)
        transparent = scene.render.film_transparent
    return {"seconds": seconds, "cpu": cpu, "images": images, "transparent": transparent}


def measure(opened: Open, series: Series, samples: int, size: tuple[int, int]) -> dict:
    """Times, errors per light path and, for Candela, stages and counters of one cell."""
    figures: dict = {"cold": None}
    kind = replace(series, label="", samples=(), main=False)
    if series.own:
        for count in dict.fromkeys((1, min(samples, ALIKE))):
            if (kind, count) not in opened.warm:
                seconds = render(opened, series, count, 1000, size)["seconds"]
                figures["cold"] = seconds if count == 1 else figures["cold"]
                opened.warm.add((kind, count))
    times, cpu, combined = [], [], []
    for run in range(RUNS):
        made = render(opened, series, samples, run + 1, size)
        times.append(made["seconds"])
        cpu.append(made["cpu"])
        combined.append(made["images"])
        if run == 0 and series.own:
            figures |= of_ledger()
        if sum(times) > SHORT:
            break
    figures |= {"times": times, "cpu": cpu}
    if opened.truth is not None:
        figures["errors"] = errors(opened, series, samples, size, combined)
    return figures


def of_ledger() -> dict:
    """Seconds by stage, and per technique its time and counters, of Candela's last frame."""
    from addon.frame import ledger

    latest = ledger.latest()
    rows = [
        {"name": row.name, "label": row.label, "state": row.state, "ms": row.milliseconds, "counters": row.counters}
        for row in latest.rows
        if row.state == "ran"
    ]
    return {"stages": dict(latest.times), "techniques": rows, "bad_pixels": latest.bad_pixels}


def errors(opened: Open, series: Series, samples: int, size: tuple[int, int], combined: list[dict]) -> dict:
    """Error by light path: mean of relMSE over the runs, which differ in their seed.

    The single passes are rendered once more: with as many seeds as a picture needs to tell more than its luck.
    """
    from addon.compare import metrics
    from addon.compare.passes import light_paths

    truth = opened.truth
    each = [
        metrics.compare_radiance("combined", images["combined"], truth.images["combined"], truth.half["combined"])
        for images in combined
    ]
    found = {"combined": as_data(each)}
    if series.paths and (series.own or samples <= MOST_PATH_SAMPLES):
        seeds = range(1, SEEDS_OF_ONE_SAMPLE + 1) if series.own and samples == 1 else (len(combined),)
        made = (render(opened, series, samples, seed, size, passes=True) for seed in seeds)
        mine = [light_paths(one["images"], one["transparent"]) for one in made]
        theirs, halves = truth.paths()
        for name in PATHS[1:]:
            if name in theirs and theirs[name].mean() > metrics.BLACK:
                found[name] = as_data(
                    [metrics.compare_radiance(name, paths.get(name), theirs[name], halves[name]) for paths in mine]
                )
    return found


def as_data(each: list) -> dict:
    """Figures of one path, the mean over the runs; what is not a number is None."""
    values = {name: [getattr(error, name) for error in each] for name in ("relmse", "relmse_trimmed", "bias", "floor")}
    means = {name: sum(some) / len(some) for name, some in values.items()}
    found = {name: value if math.isfinite(value) else None for name, value in means.items()}
    if each[0].remark:
        found["remark"] = each[0].remark
    return found


if __name__ == "__main__":
    code = main()
    sys.stderr.flush()
    os._exit(code)  # Blender 4.5 as a module waits forever in its exit handlers once a GPU was used
