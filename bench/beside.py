"""Whether whole renders got slower: `python -m bench beside CHECKOUT`, this version and another one by turns.

CHECKOUT is a working tree of an older commit (`git worktree add`). Both render with all bounces and 1, 4 and 16 samples
the sample scenes and ten that are no samples (bench/beside_scenes.py), each version in a process of its own, by turns:
whatever else the machine does falls on both. What counts is the least processor time of all threads, of which a
software driver is most; it depends on the machine's load far less than seconds do. Seeds change from run to run,
because a finished picture is kept. Beside it stands the error of both, the mean over the runs of relMSE beside Cycles.

`--drafts` adds drafts of a viewport of 96x64 pixels that turns, and for which time stands still. `--keep` appends the
means, with the names of both commits, to bench/results/beside.json, scene by scene: the last ten commits that mattered.
Quick, while something is being changed: `--only cornell_box columns --samples 16 --runs 1 --truth 0`.
"""

from __future__ import annotations

import argparse
import datetime as dt
import json
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench.ages import now
from bench.markdown import table, write_whole
from bench.quick import size_of

ROOT = Path(__file__).resolve().parents[1]
SAMPLES = ROOT / "sample_blends"
FOLDER = ROOT / "out" / "beside"
HISTORY = ROOT / "bench" / "results" / "beside.json"
KEPT = 10  # commits of the history
MOST = 1.05  # times the other's processor time
STEPS = 20  # of a viewport that turns
TURN = "turn"  # asked for in place of samples
ANSWER = "took "  # begins the lines that are meant for us: Blender writes others
# Runs in the other tree, too: it asks nothing but what bench-quick there has.
SERVED = f"""
import sys, time
sys.path.insert(0, ".")
import addon, bpy
import numpy as np
from addon.compare import reference
from addon.gfx import images
from bench import quick
from tests.viewport.region import Region
addon.register()

def turned():
    region = Region(samples=1)
    for step in range(4 + {STEPS}):
        if step == 4:
            images.finish()
            start = time.process_time(), time.perf_counter()
        region.camera = region.moved(1e-3)
        region.draw()
    images.finish()
    spent = [(now - then) / {STEPS} for now, then in zip((time.process_time(), time.perf_counter()), start)]
    region.viewport.release()
    return spent

for line in sys.stdin:
    path, samples, seed, width, height, picture = line.rstrip("\\n").split("\\t")
    if bpy.data.filepath != path:
        bpy.ops.wm.open_mainfile(filepath=path)
    scene = bpy.context.scene
    if samples == "{TURN}":
        spent = turned()
    else:
        size, entrant = (int(width), int(height)), quick.Entrant("Candela", "CANDELA", int(samples))
        made = quick.render(scene, reference.active_view_layer(scene), entrant, int(seed), size)
        np.save(picture, made.pixels)
        spent = made.cpu, made.seconds
    print("{ANSWER}%r %r" % tuple(spent), flush=True)
"""


@dataclass(frozen=True)
class Taken:
    """Of one render, or of a step of a TURN: seconds of all threads' processor time, of the clock, and the picture."""

    cpu: float
    seconds: float
    pixels: np.ndarray | None = None


class Version:
    """A process that renders with the add-on of one tree."""

    def __init__(self, tree: Path):
        self._tree = tree
        self._folder = tempfile.TemporaryDirectory()
        self._start()

    def _start(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-c", SERVED], cwd=self._tree, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def asked(self, scene: Path, samples: int | str, seed: int, size: tuple[int, int]) -> Taken:
        """One render with this seed. EOFError if the process has ended; the next call has another one."""
        picture = Path(self._folder.name) / "picture.npy"
        words = (scene, samples, seed, *size, picture)
        self._process.stdin.write("\t".join(map(str, words)) + "\n")
        self._process.stdin.flush()
        for line in self._process.stdout:
            if line.startswith(ANSWER):
                cpu, seconds = map(float, line[len(ANSWER) :].split())
                return Taken(cpu, seconds, None if samples == TURN else np.load(picture))
        self._start()
        raise EOFError(f"{self._tree.name} gave no picture of {scene.stem}")

    def end(self) -> None:
        self._process.kill()  # its own exit handlers may wait for ever
        self._folder.cleanup()


@dataclass(frozen=True)
class Row:
    """One scene with so many samples (or TURN): of the other version and of this one processor seconds, seconds and
    relMSE (None: without a truth)."""

    scene: str
    samples: int | str
    cpu: tuple[float, float]
    seconds: tuple[float, float]
    errors: tuple[float, float] | None

    @property
    def ratio(self) -> float:
        return self.cpu[1] / self.cpu[0]


def measured(versions, scene: Path, samples: int | str, options: argparse.Namespace, truth) -> Row:
    """Both versions by turns; the first picture of each compiles and does not count."""
    from addon.compare import metrics

    for version in versions:
        version.asked(scene, samples, 1000, options.size)
    taken = [
        [version.asked(scene, samples, run + 1, options.size) for version in versions] for run in range(options.runs)
    ]
    cpu, seconds, errors = [], [], []
    for runs in zip(*taken):
        cpu.append(min(run.cpu for run in runs))
        seconds.append(min(run.seconds for run in runs))
        if truth is not None and samples != TURN:
            found = [metrics.compare_radiance("Combined", run.pixels, truth) for run in runs]
            errors.append(float(np.mean([one.relmse_trimmed for one in found])))
    return Row(scene.stem, samples, tuple(cpu), tuple(seconds), tuple(errors) if errors else None)


def truth_of(scene: Path, options: argparse.Namespace) -> np.ndarray | None:
    """Combined by Cycles with all bounces, from the cache where it is; None without `--truth`."""
    if not options.truth:
        return None
    import bpy

    from addon.compare import reference

    bpy.ops.wm.open_mainfile(filepath=str(scene))
    opened = bpy.context.scene
    layer = reference.active_view_layer(opened)
    return reference.reference(opened, options.truth, False, options.size, layer).images["combined"]


def geometric(values) -> float:
    return float(np.exp(np.mean(np.log(list(values)))))


def cells(row: Row) -> tuple[str, ...]:
    unit = 1000.0 if row.samples == TURN else 1.0
    errors = ("–",) * 3
    if row.errors:
        errors = (*(f"{error:.2g}" for error in row.errors), f"{row.errors[1] / max(row.errors[0], 1e-12):.2f}")
    what = "a draft, ms" if row.samples == TURN else str(row.samples)
    spent = (f"{unit * one:.3g}" for one in row.cpu)
    return (row.scene, what, *spent, f"{row.ratio:.2f}", f"{row.seconds[1] / row.seconds[0]:.2f}", *errors)


HEAD = ("scene", "samples", "other, s of processor", "this", "ratio", "ratio of seconds",
        "other, error", "this", "ratio")  # fmt: skip


def summary(rows: list[Row]) -> list[dict]:
    """By number of samples: geometric means of the ratios."""
    found = []
    for samples in dict.fromkeys(row.samples for row in rows):
        own = [row for row in rows if row.samples == samples]
        with_error = [row.errors for row in own if row.errors]
        found.append({
            "samples": samples, "scenes": len(own), "time": geometric(row.ratio for row in own),
            "error": geometric(max(b, 1e-12) / max(a, 1e-12) for a, b in with_error) if with_error else None,
        })  # fmt: skip
    return found


def sentence(one: dict) -> str:
    what = "Drafts" if one["samples"] == TURN else f"{one['samples']} samples"
    error = "" if one["error"] is None else f", {one['error']:.2f} times the error"
    return f"{what}: {one['time']:.2f} times the processor time{error}, in the mean of {one['scenes']} scenes."


def commit_of(tree: Path) -> str:
    asked = ["git", "-C", str(tree), "log", "-1", "--format=%h %cs %s"]
    return subprocess.run(asked, capture_output=True, text=True, check=False).stdout.strip()


def keep(rows: list[Row], options: argparse.Namespace, began: str) -> None:
    """Append to the history, of which the last KEPT stay, or replace what this run, which `began` then, has kept: one
    that is ended early leaves the scenes that it has measured."""
    before = json.loads(HISTORY.read_text(encoding="utf-8")) if HISTORY.is_file() else []
    before = [one for one in before if one.get("began") != began]
    one = {
        "made": now(), "began": began, "this": commit_of(ROOT), "other": commit_of(options.checkout),
        "size": list(options.size), "means": summary(rows), "rows": [list(cells(row)) for row in rows],
    }  # fmt: skip
    write_whole(HISTORY, json.dumps([*before, one][-KEPT:], indent=1, ensure_ascii=False) + "\n")


# ------------------------------------------------------------------------------------------------------------- command


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("checkout", type=Path, metavar="CHECKOUT", help="a working tree of another commit")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="scenes, of sample_blends and of bench/beside_scenes")
    parser.add_argument("--samples", nargs="+", default=[1, 4, 16], type=int, metavar="N", help="default 1 4 16")
    parser.add_argument("--runs", default=2, type=int, metavar="N", help="of each version on each scene (default 2)")
    parser.add_argument("--size", default=(128, 96), type=size_of, metavar="WxH", help="default 128x96")
    parser.add_argument("--truth", default=64, type=int, metavar="N", help="twice as many samples of Cycles; 0: none")
    parser.add_argument("--drafts", action="store_true", help="of a viewport that turns, too")
    parser.add_argument("--keep", action="store_true", help="append the means to bench/results/beside.json")


def scenes_of(names: list[str] | None) -> list[Path]:
    """Files, those that are no samples built now. ValueError for a name that there is none of."""
    from bench import beside_scenes

    samples = {path.stem: path for path in sorted(SAMPLES.glob("*.blend"))}
    wanted = names or [*samples, *beside_scenes.SCENES]
    unknown = [name for name in wanted if name not in samples and name not in beside_scenes.SCENES]
    if unknown:
        there = ", ".join([*samples, *beside_scenes.SCENES])
        raise ValueError(f"There is no scene {', '.join(unknown)}; there are {there}.")
    return [samples.get(name) or beside_scenes.written(name, FOLDER) for name in wanted]


def command(options: argparse.Namespace) -> int:
    if not (options.checkout / "addon").is_dir():
        print(f"{options.checkout} is no working tree of Candela: make one by `git worktree add`.", file=sys.stderr)
        return 2
    import addon
    from addon.cli.terminal import quiet

    addon.register()
    with quiet() as terminal:
        try:
            scenes = scenes_of(options.only)
        except ValueError as error:
            print(error, file=terminal)
            return 2
        began = dt.datetime.now(dt.UTC).isoformat(timespec="seconds")
        versions = Version(options.checkout.resolve()), Version(ROOT)
        rows, failed = [], []
        print(*HEAD, sep=", ", file=terminal, flush=True)
        for scene in scenes:
            truth = truth_of(scene, options)
            for samples in (*options.samples, *([TURN] if options.drafts else [])):
                try:
                    rows.append(measured(versions, scene, samples, options, truth))
                except EOFError as error:
                    failed.append(str(error))
                    continue
                print(*cells(rows[-1]), sep=", ", file=terminal, flush=True)
            if options.keep and rows:
                keep(rows, options, began)
        for version in versions:
            version.end()
    print(table([HEAD, *map(cells, rows)]), "", *map(sentence, summary(rows)), *failed, sep="\n")
    slower = [f"{row.scene} ({row.samples})" for row in rows if row.ratio > MOST]
    print(f"Slower by more than {100 * (MOST - 1):.0f} %: {', '.join(slower) or 'none'}.")
    return 0
