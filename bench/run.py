"""Time against error over scenes, techniques and samples, beside EEVEE and Cycles: `python -m bench run`.

Every cell (bench/cells.py) is measured by a worker, a fresh process per scene, and kept at once in out/bench: a run
that is interrupted goes on where it was. `--budget` gives the minutes that the whole may take: how long each cell will
take is predicted from what has been measured, and the dearest cells that do not fit are left out; those of the engines
as they come, at 1, 4, 16 and 64 samples, may cost more. What was measured becomes one file, bench/results/bench.json.
"""

from __future__ import annotations

import argparse
import datetime as dt
import json
import math
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import asdict
from pathlib import Path

from bench.cells import ROOT, Cell, Scene, Series, Store, in_turns

RESULTS = ROOT / "bench" / "results" / "bench.json"
OUT = ROOT / "out" / "bench"
GUESS = {"CANDELA": (0.3, 0.15), "BLENDER_EEVEE": (8.0, 0.02), "CYCLES": (0.4, 0.06)}  # seconds: fixed, per sample
MAIN_WORTH = 4.0  # a cell of the engines as they come may cost so many times more than another before it is left out
OPENING = 4.0  # seconds to start a worker and open a scene


class Failed(RuntimeError):
    """The worker ended; the message says where its log is."""


class Worker:
    """A process that measures the cells of one scene."""

    def __init__(self, log: Path):
        log.parent.mkdir(parents=True, exist_ok=True)
        self.log = log
        with log.open("a", encoding="utf-8") as file:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "bench.worker"], cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                stderr=file, text=True,
            )  # fmt: skip

    def ask(self, **request) -> dict:
        """The worker's answer. Raises Failed when the process is gone."""
        try:
            print(json.dumps(request), file=self.process.stdin, flush=True)
            line = self.process.stdout.readline()
        except BrokenPipeError:
            line = ""
        if not line:
            raise Failed(f"The process that measures ended; what it said is in {self.log}.")
        return json.loads(line)

    def end(self) -> None:
        self.process.stdin.close()
        self.process.wait(timeout=60)


# -------------------------------------------------------------------------------------------------------------- budget


def predicted(cell: Cell, known: dict[tuple[Scene, Series, int], float]) -> float:
    """Seconds that a cell will take: from the same series and scene, else from its engine in this scene, else in all.

    What is known of others is scaled by the guess for both; of several, the median counts.
    """
    for like in (
        lambda scene, series: (scene, series) == (cell.scene, cell.series),
        lambda scene, series: (scene, series.engine) == (cell.scene, cell.series.engine),
        lambda scene, series: series.engine == cell.series.engine,
    ):
        found = [
            (n, seconds / guess(series, n)) for (scene, series, n), seconds in known.items() if like(scene, series)
        ]
        if found:
            nearest = min(abs(math.log(n / cell.samples)) for n, _ in found)
            ratios = [ratio for n, ratio in found if abs(math.log(n / cell.samples)) == nearest]
            return statistics.median(ratios) * guess(cell.series, cell.samples)
    return guess(cell.series, cell.samples)


def guess(series: Series, samples: int) -> float:
    """Seconds of a cell on two cores at 128x96 pixels."""
    fixed, each = GUESS[series.engine]
    return fixed + each * samples


def that_fit(cells: list[Cell], cost: Callable[[Cell], float], seconds: float) -> list[Cell]:
    """The cells, in their order, without the dearest ones that the time does not allow; main cells weigh less."""
    costs = {cell: cost(cell) for cell in cells}
    total = sum(costs.values())
    dropped = set()
    for cell in sorted(cells, key=lambda cell: costs[cell] / (MAIN_WORTH if cell.main else 1.0), reverse=True):
        if total <= seconds:
            break
        dropped.add(cell)
        total -= costs[cell]
    return [cell for cell in cells if cell not in dropped]


# ------------------------------------------------------------------------------------------------------------- the run


def run(cells: Iterable[Cell], budget: float | None, store: Store, bar) -> tuple[dict, dict, list[str], list[Cell]]:
    """Measure what the store lacks. Returns about, references by scene name, failures, and cells that were left out.

    `bar` is told predicted seconds of work done (a tqdm bar, or anything with total, update and set_postfix_str).
    """
    started = time.monotonic()
    cells = in_turns(cells)
    first = Worker(OUT / "worker.log")
    about = first.ask(ask="about")
    first.end()
    if "failed" in about:
        raise Failed(f"Blender's GPU module could not be used: {about['failed']}")
    machine = f"{about['blender']} {about['device']} {about['cpu']}"
    references: dict[str, dict] = {}
    failures: list[str] = []
    known = {
        (cell.scene, cell.series, cell.samples): store.found[cell.key(machine)]["wall"]
        for cell in cells
        if cell.key(machine) in store.found
    }
    left = [cell for cell in cells if cell.key(machine) not in store.found]
    worker, scene = None, None
    try:
        while left:
            now = time.monotonic() - started
            scenes_left = len({cell.scene for cell in left} - {scene})
            time_left = float("inf") if budget is None else budget - now - OPENING * scenes_left
            kept = that_fit(left, lambda cell: predicted(cell, known), time_left)
            bar.total = round(now + sum(predicted(cell, known) for cell in kept) + OPENING * scenes_left)
            bar.update(round(now) - bar.n)
            if not kept:
                break
            cell = next((cell for cell in kept if cell.scene == scene), kept[0])
            if cell.scene != scene:
                if worker:
                    worker.end()
                scene = cell.scene
                worker = Worker(OUT / "worker.log")
                bar.set_postfix_str(f"{scene.name}: reference")
                size, samples = cell.size, cell.reference_samples
                opened = worker.ask(ask="open", scene=asdict(scene), size=size, reference_samples=samples)
                if "failed" in opened:
                    failures.append(f"{scene.name} could not be opened: {opened['failed']}")
                    left = [other for other in left if other.scene != scene]
                    continue
                references[scene.name] = opened
            bar.set_postfix_str(f"{scene.name}: {cell.series.label}, {cell.samples}")
            begun = time.monotonic()
            left.remove(cell)
            try:
                figures = worker.ask(ask="cell", series=asdict(cell.series), samples=cell.samples, size=cell.size)
            except Failed as failure:
                figures, scene = {"failed": str(failure)}, None
            if "failed" in figures:
                failures.append(f"{cell.scene.name}, {cell.series.label}, {cell.samples}: {figures['failed']}")
                continue
            wall = time.monotonic() - begun
            known[cell.scene, cell.series, cell.samples] = wall
            store.add(cell.key(machine), {**described(cell), "wall": wall, "load": load(), **figures})
    finally:
        if worker and worker.process.poll() is None:
            worker.end()
    missing = [cell for cell in cells if cell.key(machine) not in store.found]
    return {**about, "machine": machine}, references, failures, missing


def load() -> float | None:
    """Processes that want a core, so that figures from a busy machine can be told."""
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else None


def described(cell: Cell) -> dict:
    """Which cell it is, in the row that keeps its figures."""
    series = {name: value for name, value in asdict(cell.series).items() if name != "samples"}
    return {"scene": cell.scene.name, "series": series, "samples": cell.samples, "size": list(cell.size)}


def gathered(cells: list[Cell], machine: str, store: Store) -> list[dict]:
    """The rows of these cells that were measured."""
    return [store.found[key] for key in (cell.key(machine) for cell in cells) if key in store.found]


def write_results(path: Path, about: dict, references: dict, rows: list[dict], left_out: list[str]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    data = {"about": about, "references": references, "left_out": left_out, "cells": rows}
    path.write_text(one_row_per_line(data), encoding="utf-8")


def one_row_per_line(data: dict) -> str:
    """JSON with a cell per line, so that two runs can be told apart by line."""
    head = {name: value for name, value in data.items() if name != "cells"}
    rows = ",\n".join(json.dumps(rounded(row), ensure_ascii=False) for row in data["cells"])
    return json.dumps(rounded(head), indent=1, ensure_ascii=False)[:-2] + f',\n "cells": [\n{rows}\n]}}\n'


def rounded(value):
    """Floats with five digits: more are not in a measurement."""
    if isinstance(value, float):
        return float(f"{value:.5g}")
    if isinstance(value, dict):
        return {name: rounded(one) for name, one in value.items()}
    return [rounded(one) for one in value] if isinstance(value, list | tuple) else value


# ------------------------------------------------------------------------------------------------------------- command


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--scenes", nargs="+", metavar="NAME", help="default: all of sample_blends")
    parser.add_argument("--series", nargs="+", metavar="TEXT", help="only series whose label has one of these texts")
    parser.add_argument("--samples", nargs="+", type=int, metavar="N", help="only these numbers of samples")
    parser.add_argument("--no-peers", action="store_true", help="Candela alone")
    parser.add_argument("--size", default=(128, 96), type=size_of, metavar="WxH", help="default 128x96")
    parser.add_argument("--reference-samples", default=512, type=int, metavar="N", help="of each of two (default 512)")
    parser.add_argument("--budget", type=float, metavar="MINUTES", help="leave out the dearest cells beyond this time")
    parser.add_argument("--results", default=RESULTS, type=Path, metavar="PATH")
    parser.add_argument("--list", action="store_true", help="print the cells and end")


def size_of(text: str) -> tuple[int, int]:
    from bench.quick import size_of as parse

    return parse(text)


def chosen(options: argparse.Namespace) -> list[Cell]:
    """The cells that the options ask for. Raises ValueError with a sentence."""
    import bpy  # noqa: F401  (the registry's programs need Blender's gpu module)

    from addon.techniques import REGISTRY
    from bench.cells import PEERS, own_series, sample_scenes

    scenes = sample_scenes()
    names = options.scenes or [scene.name for scene in scenes]
    unknown = set(names) - {scene.name for scene in scenes}
    if unknown:
        known = ", ".join(scene.name for scene in scenes)
        raise ValueError(f"There is no scene {', '.join(sorted(unknown))}; there is {known}.")
    series = own_series(REGISTRY) + (() if options.no_peers else PEERS)
    if options.series:
        wanted = [text.lower() for text in options.series]
        series = tuple(one for one in series if any(text in one.label.lower() for text in wanted))
        if not series:
            labels = ", ".join(one.label for one in own_series(REGISTRY) + PEERS)
            raise ValueError(f"No series is called like that; there is {labels}.")
    return [
        Cell(scene, one, samples, options.size, options.reference_samples)
        for scene in scenes
        if scene.name in names
        for one in series
        for samples in one.samples
        if not options.samples or samples in options.samples
    ]


def command(options: argparse.Namespace) -> int:
    from tqdm import tqdm

    try:
        cells = chosen(options)
    except ValueError as error:
        print(error, file=sys.stderr)
        return 2
    if options.list:
        for cell in in_turns(cells):
            print(f"{cell.scene.name:<20} {cell.series.label:<34} {cell.samples:4}{'  main' if cell.main else ''}")
        return 0
    store = Store(OUT / "cells.jsonl")
    budget = None if options.budget is None else 60.0 * options.budget
    form = "{desc}{percentage:3.0f}% |{bar}| {elapsed}, {remaining} left, {postfix}"
    with tqdm(total=1, bar_format=form, disable=not sys.stderr.isatty()) as bar:
        about, references, failures, missing = run(cells, budget, store, bar)
    about |= {
        "date": dt.datetime.now(dt.UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "size": list(options.size),
        "reference_samples": options.reference_samples,
        "load": load(),
    }
    rows = gathered(cells, about.pop("machine"), store)
    if options.results.exists():  # references that this run found no need to open
        references = {**json.loads(options.results.read_text(encoding="utf-8"))["references"], **references}
    left_out = [f"{cell.scene.name}, {cell.series.label}, {cell.samples}" for cell in missing]
    write_results(options.results, about, references, rows, left_out)
    for failure in failures:
        print(failure, file=sys.stderr)
    print(f"{len(rows)} cells in {options.results}; {len(left_out)} left out")
    return 1 if failures else 0
