"""Wall time of whole renders beside EEVEE and Cycles, on the sample scenes: `python -m bench.quick`.

Each scene is opened once. Every engine renders it once cold (shaders compile; reported apart), then the engines take
turns, so that whatever else the machine does falls on all of them alike. A time is that of a whole render, from
Blender's call to the finished picture: reading the scene, drawing, reading back. All render Combined alone. Seeds
change from run to run, because Candela keeps a finished frame that nothing has changed.

On a software GPU most of EEVEE's time is a constant that hardly depends on the size of the picture, and its later
renders of a scene take longer than the first. Ratios are therefore given for both: of the medians, and of the cold
renders.

Error is relMSE against Cycles without bounces, the light that Candela is told to render. EEVEE and full Cycles render
bounces too, so their pictures are not comparable with that reference and have no figure; a Cycles without bounces
stands beside them for a comparison of like with like.
"""

from __future__ import annotations

import argparse
import datetime as dt
import json
import os
import platform
import sys
import tempfile
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from bench.markdown import write_whole
from bench.study import size_of

ROOT = Path(__file__).resolve().parent.parent
SCENES = ROOT / "sample_blends"
SLOW = 30.0  # seconds of a cold render; what is slower is timed once instead of several times
STAGES = ("sync", "upload", "compile", "passes", "readback")  # of Candela's ledger; what is left is "other"


@dataclass(frozen=True)
class Entrant:
    """An engine with its settings."""

    label: str
    engine: str
    samples: int
    denoised: bool = False
    bounces: bool = True

    @property
    def comparable(self) -> bool:
        """Whether its Combined holds the light that the reference holds."""
        return not self.bounces


CANDELA = Entrant("Candela", "CANDELA", 16, bounces=False)
EEVEE = Entrant("EEVEE", "BLENDER_EEVEE", 16)
ENTRANTS = (
    CANDELA,
    EEVEE,
    Entrant("Cycles", "CYCLES", 4),
    Entrant("Cycles, denoised", "CYCLES", 4, denoised=True),
    Entrant("Cycles", "CYCLES", 16),
    Entrant("Cycles, denoised", "CYCLES", 16, denoised=True),
    Entrant("Cycles, no bounces", "CYCLES", 16, bounces=False),
)


@dataclass
class Result:
    """One entrant on one scene. Times in seconds."""

    entrant: Entrant
    cold: float = float("nan")
    times: list[float] = field(default_factory=list)
    cpu: list[float] = field(default_factory=list)  # processor seconds of all threads: steadier on a busy machine
    relmse: list[float] = field(default_factory=list)  # of each run; empty where it is not comparable
    trimmed: list[float] = field(default_factory=list)  # the same without the worst 0.1 % of the pixels
    stages: list[dict[str, float]] = field(default_factory=list)  # of each run; Candela alone

    @property
    def median(self) -> float:
        return float(np.median(self.times))

    @property
    def p95(self) -> float:
        return float(np.percentile(self.times, 95))

    @property
    def error(self) -> float | None:
        return float(np.mean(self.relmse)) if self.relmse else None

    @property
    def trimmed_error(self) -> float | None:
        return float(np.mean(self.trimmed)) if self.trimmed else None


# -------------------------------------------------------------------------------------------------------------- figures


def shares(stages: list[dict[str, float]], times: list[float]) -> dict[str, float]:
    """Share of the wall time per stage, over all runs; sums to 1 with "other", what no stage accounts for."""
    total = sum(times)
    found = {name: sum(run.get(name, 0.0) for run in stages) / total for name in STAGES}
    return {**found, "other": 1.0 - sum(found.values())}


def ratio(results: list[Result], cold: bool = False) -> float:
    """How many times EEVEE's median (or cold render) is Candela's."""
    seconds = {result.entrant: result.cold if cold else result.median for result in results}
    return seconds[EEVEE] / seconds[CANDELA]


def table(rows: list[tuple[str, ...]]) -> str:
    """Lines with aligned columns: words to the left, figures to the right."""
    widths = [max(map(len, column)) for column in zip(*rows)]
    numeric = [all(cell[:1].isdigit() or cell == "–" for cell in column[1:]) for column in zip(*rows)]
    return "\n".join(
        "  ".join(
            cell.rjust(width) if right else cell.ljust(width) for cell, width, right in zip(row, widths, numeric)
        ).rstrip()
        for row in rows
    )


def report(found: dict[str, list[Result]]) -> str:
    """All tables, for the terminal."""
    rows = [
        ("scene", "engine", "samples", "runs", "median s", "p95 s", "CPU s", "cold s", "relMSE", "trimmed", "× Candela")
    ]
    for scene, results in found.items():
        own = next(result.median for result in results if result.entrant == CANDELA)
        rows += [
            (
                scene,
                result.entrant.label,
                str(result.entrant.samples),
                str(len(result.times)),
                f"{result.median:.3f}",
                f"{result.p95:.3f}",
                f"{np.median(result.cpu):.2f}",
                "–" if np.isnan(result.cold) else f"{result.cold:.2f}",
                *("–" if error is None else f"{error:.1e}" for error in (result.error, result.trimmed_error)),
                f"{result.median / own:.1f}",
            )
            for result in results
        ]
    parts = [("scene", "EEVEE / Candela", "cold", *STAGES, "other")]
    for scene, results in found.items():
        own = next(result for result in results if result.entrant == CANDELA)
        share = shares(own.stages, own.times)
        ratios = (f"{ratio(results):.1f}", f"{ratio(results, cold=True):.1f}")
        parts.append((scene, *ratios, *(f"{value * 100:.0f} %" for value in share.values())))
    return f"{table(rows)}\n\nEEVEE's time over Candela's, and the shares of Candela's own time\n{table(parts)}"


def as_json(found: dict[str, list[Result]], about: dict) -> str:
    """Everything that was measured, for other programs."""
    scenes = {}
    for scene, results in found.items():
        own = next(result for result in results if result.entrant == CANDELA)
        scenes[scene] = {
            "eevee_over_candela": ratio(results),
            "eevee_over_candela_cold": ratio(results, cold=True),
            "candela_shares": shares(own.stages, own.times),
            "results": [
                {
                    **asdict(result.entrant),
                    "median_s": result.median,
                    "p95_s": result.p95,
                    "cold_s": None if np.isnan(result.cold) else result.cold,
                    "times_s": result.times,
                    "cpu_s": result.cpu,
                    "relmse": result.error,
                    "relmse_trimmed": result.trimmed_error,
                    "stages_s": result.stages,
                }
                for result in results
            ],
        }
    return json.dumps({**about, "scenes": scenes}, indent=1, ensure_ascii=False) + "\n"


# -------------------------------------------------------------------------------------------------------------- picture

COLORS = {"Candela": "#c8501e", "EEVEE": "#3f6fb5", "Cycles": "#8a8a8a"}


def draw(found: dict[str, list[Result]], about: dict, path: Path) -> None:
    """Median time per scene and engine on a logarithmic axis, with the span of the runs."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(9, 1.4 + 0.75 * len(found)), layout="constrained")
    for row, results in enumerate(found.values()):
        for place, result in enumerate(results):
            entrant, y = result.entrant, row + (place - (len(results) - 1) / 2) * 0.11
            color = COLORS[entrant.label.split(",")[0]]
            hollow = entrant.denoised or (entrant.engine == "CYCLES" and not entrant.bounces)
            marker = {"CANDELA": "D", "BLENDER_EEVEE": "s"}.get(entrant.engine, "^" if entrant.samples == 4 else "o")
            if entrant.engine == "CYCLES" and not entrant.bounces:
                marker = "X"
            which = "all bounces" if entrant.bounces else "no bounces"
            named = entrant.label if which in entrant.label else f"{entrant.label}, {which}"
            label = f"{named}, {entrant.samples} samples" if row == 0 else None
            axes.plot([min(result.times), max(result.times)], [y, y], color=color, linewidth=1.2)
            face = "white" if hollow else color
            axes.plot(result.median, y, marker, color=color, markerfacecolor=face, markersize=7, label=label, zorder=3)
    axes.set_yticks(range(len(found)), [name.replace("_", " ") for name in found])
    axes.set_ylim(len(found) - 0.5, -0.5)
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.set_xlabel("seconds for a whole render, median of the runs")
    width, height = about["size"]
    axes.set_title(f"{width} × {height} pixels, {about['device']}", fontsize=9, loc="left", color="#555555")
    axes.grid(axis="x", which="both", color="#e4e4e4", linewidth=0.6)
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.tick_params(axis="y", length=0)
    figure.legend(loc="outside upper center", ncols=3, frameon=False, fontsize=9)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=150)
    plt.close(figure)


# ------------------------------------------------------------------------------------------------------------ rendering


def settings_for(scene, layer, entrant: Entrant, seed: int, size: tuple[int, int]) -> list:
    """What is changed for a render; quality settings of Cycles and EEVEE other than samples stay the file's."""
    from addon.compare import reference

    engine = reference.engine_identifier(scene, entrant.engine)
    chosen = reference.render_settings(
        scene, layer, engine, entrant.samples, seed, None if entrant.bounces else 0, size
    )
    own = {scene.render, scene.render.image_settings, scene.eevee, scene.candela}
    settings = [setting for setting in chosen if setting[0] in own]
    cycles = scene.cycles
    settings += [
        (cycles, "samples", entrant.samples),
        (cycles, "seed", seed),
        (cycles, "device", "CPU"),
        (cycles, "use_adaptive_sampling", False),
        (cycles, "use_denoising", entrant.denoised),
    ]
    if not entrant.bounces:
        settings.append((cycles, "max_bounces", 0))
    return settings


@dataclass(frozen=True)
class Render:
    """One whole render: times in seconds, Combined as (H, W, 4), bottom row first."""

    seconds: float
    cpu: float
    stages: dict[str, float]  # of Candela's ledger
    pixels: np.ndarray


def render(scene, layer, entrant: Entrant, seed: int, size: tuple[int, int]) -> Render:
    """Render the view layer with an entrant's settings."""
    import bpy

    from addon.compare import reference
    from addon.frame import ledger
    from addon.snapshot.exr import read_exr

    with reference.overridden(settings_for(scene, layer, entrant, seed, size)):
        start, cpu_start = time.perf_counter(), time.process_time()
        bpy.ops.render.render(scene=scene.name, layer=layer.name)
        seconds, cpu = time.perf_counter() - start, time.process_time() - cpu_start
        result = next(image for image in bpy.data.images if image.type == "RENDER_RESULT")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "picture.exr"
            result.save_render(str(path), scene=scene)
            pixels = reference.named_images(read_exr(path), layer.name)["combined"]
    stages = {}
    if entrant.engine == "CANDELA":
        times = ledger.latest().times
        stages = {name: times[name] for name in STAGES if name in times}
    return Render(seconds, cpu, stages, pixels)


def measure(path: Path, size: tuple[int, int], runs: int, reference_samples: int, tick) -> list[Result]:
    """All entrants on one scene. `tick(what)` is called before each render."""
    import bpy

    from addon.compare import metrics, reference

    bpy.ops.wm.open_mainfile(filepath=str(path))
    scene = bpy.context.scene
    layer = reference.active_view_layer(scene)
    tick("reference")
    truth = reference.reference(scene, reference_samples, True, size, layer)
    results = [Result(entrant) for entrant in ENTRANTS]
    for result in results:
        if result.entrant.engine != "CYCLES":  # Cycles compiles nothing here
            tick(f"{result.entrant.label}, cold")
            result.cold = render(scene, layer, result.entrant, 1000, size).seconds
    for run in range(runs):
        for result in results:
            tick(f"{result.entrant.label}, {result.entrant.samples}")
            if run > 0 and result.cold > SLOW:
                continue
            made = render(scene, layer, result.entrant, run + 1, size)
            result.times.append(made.seconds)
            result.cpu.append(made.cpu)
            if made.stages:
                result.stages.append(made.stages)
            if result.entrant.comparable:
                error = metrics.compare_radiance("Combined", made.pixels, truth.images["combined"])
                result.relmse.append(error.relmse)
                result.trimmed.append(error.relmse_trimmed)
    return results


def about_run(size: tuple[int, int], runs: int, reference_samples: int) -> dict:
    """Where and how it was measured."""
    import bpy

    from addon.gfx import context

    return {
        "date": dt.datetime.now(dt.UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "blender": bpy.app.version_string,
        "python": platform.python_version(),
        "device": context.describe(),
        "cpu": f"{cpu_name()}, {os.cpu_count()} threads",
        "load_before": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,  # processes that wanted a core
        "size": list(size),
        "runs": runs,
        "reference": f"Cycles without bounces, 2 × {reference_samples} samples",
    }


def cpu_name() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), platform.machine())


# -------------------------------------------------------------------------------------------------------------- command


def parse(arguments: list[str]) -> argparse.Namespace:
    names = sorted(path.stem for path in SCENES.glob("*.blend"))
    parser = argparse.ArgumentParser(prog="python -m bench.quick", description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", nargs="+", choices=names, default=names, metavar="NAME", help=", ".join(names))
    parser.add_argument("--size", default="256x192", type=size_of, metavar="WxH")
    parser.add_argument("--runs", default=3, type=int, metavar="N", help="of each engine on each scene (default 3)")
    parser.add_argument("--reference-samples", default=128, type=int, metavar="N", help="default 128")
    parser.add_argument("--json", default=ROOT / "bench" / "results" / "quick.json", type=Path, metavar="PATH")
    parser.add_argument("--picture", default=ROOT / "docs" / "images" / "quick.png", type=Path, metavar="PATH")
    return parser.parse_args(arguments)


def main(arguments: list[str]) -> int:
    options = parse(arguments)
    from tqdm import tqdm

    import addon
    from addon.cli.terminal import quiet
    from addon.gfx import context

    addon.register()
    found: dict[str, list[Result]] = {}
    with quiet():
        context.ensure()
        about = about_run(options.size, options.runs, options.reference_samples)
    print(f"Blender {about['blender']}, {about['device']}, {about['cpu']}, load {about['load_before']}")
    print(f"{about['size'][0]} × {about['size'][1]} pixels, {options.runs} runs; relMSE against {about['reference']}")
    renders = 1 + sum(entrant.engine != "CYCLES" for entrant in ENTRANTS) + options.runs * len(ENTRANTS)
    for name in options.scenes:
        with quiet() as terminal:
            hidden = not terminal.isatty()
            with tqdm(total=renders, desc=name, file=terminal, leave=False, disable=hidden, unit="render") as bar:

                def tick(what: str, bar=bar) -> None:
                    bar.set_postfix_str(what)
                    bar.update()

                path = SCENES / f"{name}.blend"
                found[name] = measure(path, options.size, options.runs, options.reference_samples, tick)
        print(f"{name}: EEVEE / Candela {ratio(found[name]):.1f}", flush=True)
        options.json.parent.mkdir(parents=True, exist_ok=True)
        write_whole(options.json, as_json(found, about))
        draw(found, about, options.picture)
    print(f"\n{report(found)}")
    print(f"\n{options.json}\n{options.picture}")
    return 0


if __name__ == "__main__":
    code = main(sys.argv[1:])
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)  # Blender 4.5 as a module waits forever in its exit handlers once a GPU was used
