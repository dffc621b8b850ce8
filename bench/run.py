"""Time against error over scenes, techniques and samples, beside EEVEE and Cycles: `python -m bench run`.

Every cell (bench/cells.py) is measured by a worker, a fresh process per scene, and kept at once in out/bench: a run
that is interrupted goes on where it was. What was measured becomes one file, bench/results/bench.json, and what that
file has of the same sources, Blender, device and processor is not measured again, unless `--anew` says so.

`--budget` gives the minutes that the whole may take. What a page needs (bench/cells.py: NEEDED) is measured of all
scenes before anything else. How long each cell will take is predicted from what has been measured, and of what does not
fit the dearest cells of the lowest rank are left out. References, which no figure's time depends on, may be rendered
before with `--references`, on a busy machine too.
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
import uuid
from collections.abc import Callable, Iterable
from dataclasses import asdict
from pathlib import Path

from bench import ages
from bench.cells import (
    DRAFT,
    EXTRA,
    FAST,
    MAIN,
    NEEDED,
    NEEDED_SAMPLES,
    OWN,
    PEERS,
    RAW,
    ROOT,
    Cell,
    Scene,
    Series,
    Store,
    in_turns,
)
from bench.markdown import write_whole

RESULTS = ROOT / "bench" / "results" / "bench.json"
OUT = ROOT / "out" / "bench"
GUESS = {"CANDELA": (0.5, 0.3), "BLENDER_EEVEE": (5.0, 0.1), "CYCLES": (2.5, 0.03)}  # seconds: fixed, per sample
GUESSED_SIZE = 128 * 96  # pixels at which these hold; what is paid per sample grows with the pixels
OPENING = 4.0  # seconds to start a worker and open a scene
REFERENCE = 0.015  # seconds of a sample of the reference at that size


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


class Known:
    """Seconds of measured cells over the guess for them: by scene and series, by scene and engine, and by engine."""

    def __init__(self):
        self.ratios: dict[tuple, list[tuple[int, float]]] = {}

    def add(self, cell: Cell, seconds: float) -> None:
        found = cell.samples, seconds / guess(cell.series, cell.samples, cell.size)
        for like in self._alike(cell):
            self.ratios.setdefault(like, []).append(found)

    @staticmethod
    def _alike(cell: Cell) -> tuple[tuple, ...]:
        engine = cell.series.engine
        return (cell.scene, cell.series), (cell.scene, engine), (engine,)

    def predicted(self, cell: Cell) -> float:
        """Seconds that a cell will take: from what is most alike, and of that from the nearest number of samples.

        Of several the median counts. One scene says little about the next (EEVEE takes ten times longer where leaves
        cover each other), so that the guess itself counts beside other scenes.
        """
        own = guess(cell.series, cell.samples, cell.size)
        for like in self._alike(cell):
            found = self.ratios.get(like)
            if found:
                nearest = min(abs(math.log(n / cell.samples)) for n, _ in found)
                ratios = [ratio for n, ratio in found if abs(math.log(n / cell.samples)) == nearest]
                return own * statistics.median(ratios if cell.scene in like else [*ratios, 1.0])
        return own


def guess(series: Series, samples: int, size: tuple[int, int]) -> float:
    """Seconds of a cell on two cores."""
    fixed, each = GUESS[series.engine]
    return fixed + each * samples * size[0] * size[1] / GUESSED_SIZE


def needed_seconds(scenes: int, size: tuple[int, int]) -> float:
    """Guessed seconds of what a page needs of so many scenes; without their references."""
    main = [one for one in (OWN, FAST, DRAFT, RAW, *PEERS) if one.main]
    needed = [(one, samples) for one in main for samples in one.samples if samples in NEEDED_SAMPLES[one.engine]]
    return scenes * (OPENING + sum(guess(one, samples, size) for one, samples in needed))


def that_fit(cells: list[Cell], cost: Callable[[Cell], float], seconds: float) -> list[Cell]:
    """The cells, in their order, without what the time does not allow: first the extra ones go, the dearest first."""
    costs = {cell: cost(cell) for cell in cells}
    total = sum(costs.values())
    dropped = set()
    for cell in sorted(cells, key=lambda cell: (cell.rank, costs[cell]), reverse=True):
        if total <= seconds:
            break
        dropped.add(cell)
        total -= costs[cell]
    return [cell for cell in cells if cell not in dropped]


# ------------------------------------------------------------------------------------------------------------- the run


class Run:
    """One run: what is known, what is left, and the worker of the scene that is being measured.

    `bar` is told predicted seconds of work done (a tqdm bar, or anything with total, n, update, set_postfix_str).
    """

    def __init__(self, cells: Iterable[Cell], budget: float | None, store: Store, bar):
        self.started = time.monotonic()
        self.budget, self.store, self.bar = budget, store, bar
        self.cells = in_turns(cells)
        first = Worker(OUT / "worker.log")
        self.about = first.ask(ask="about")
        first.end()
        if "failed" in self.about:
            raise Failed(f"Blender's GPU module could not be used: {self.about['failed']}")
        self.machine = " ".join(self.about[name] for name in ("blender", "device", "cpu"))
        self.references: dict[str, dict] = {}
        self.failures: list[str] = []
        self.known, self.left = Known(), []
        for cell in self.cells:
            row = store.found.get(cell.key(self.machine))
            if row is None:
                self.left.append(cell)
            else:
                self.known.add(cell, row["wall"])

    def measure(self) -> None:
        """Measure what the store lacks: first what a page needs, of all scenes, and then the rest.

        Each scene gets an equal share of the time that is left, and what the others did not need of theirs goes into
        further rounds.
        """
        for last in (NEEDED, EXTRA):
            progress = True
            while progress:
                progress = False
                scenes = list(dict.fromkeys(cell.scene for cell in self.left if cell.rank <= last))
                for number, scene in enumerate(scenes):
                    progress |= self._measure_scene(scene, last, self._time_left() / (len(scenes) - number))

    @property
    def missing(self) -> list[Cell]:
        return [cell for cell in self.cells if cell.key(self.machine) not in self.store.found]

    def _time_left(self) -> float:
        return float("inf") if self.budget is None else self.started + self.budget - time.monotonic()

    def _opening(self, cell: Cell) -> float:
        """Predicted seconds to open a cell's scene, with a reference that may have to be rendered."""
        if cell.scene.name in self.references or (
            self.references and all(one.get("cached") for one in self.references.values())
        ):
            return OPENING
        return OPENING + 2 * cell.reference_samples * REFERENCE * cell.size[0] * cell.size[1] / GUESSED_SIZE

    def _measure_scene(self, scene: Scene, last: int, share: float) -> bool:
        """Measure the cells of a scene, up to the rank `last`, that fit into `share` seconds; whether there was any."""
        end = time.monotonic() + share
        worker, any_measured = None, False
        try:
            while True:
                mine = [cell for cell in self.left if cell.scene == scene and cell.rank <= last]
                opening = 0.0 if worker or not mine else self._opening(mine[0])
                kept = that_fit(mine, self.known.predicted, end - time.monotonic() - opening)
                if not kept:
                    return any_measured
                self._tell(kept[0])
                worker = worker or self._open(kept[0])
                if worker is None:
                    return any_measured
                any_measured = True
                if not self._measure_cell(worker, kept[0]):
                    worker = None
        finally:
            if worker:
                worker.end()

    def _open(self, cell: Cell) -> Worker | None:
        """A worker with the cell's scene open; None where that failed."""
        worker = Worker(OUT / "worker.log")
        opened = open_in(worker, cell)
        if "failed" in opened:
            self.failures.append(f"{cell.scene.name} could not be opened: {opened['failed']}")
            self.left = [other for other in self.left if other.scene != cell.scene]
            worker.end()
            return None
        self.references[cell.scene.name] = opened
        return worker

    def _measure_cell(self, worker: Worker, cell: Cell) -> bool:
        """Measure and keep a cell; whether the worker still lives."""
        begun = time.monotonic()
        self.left.remove(cell)
        alive = True
        try:
            figures = ask_for(worker, cell.series, cell.samples, cell.size)
        except Failed as failure:
            figures, alive = {"failed": str(failure)}, False
        if "failed" in figures:
            self.failures.append(f"{cell.scene.name}, {cell.series.label}, {cell.samples}: {figures['failed']}")
            return alive
        wall = time.monotonic() - begun
        self.known.add(cell, wall)
        self.store.add(cell.key(self.machine), {**described(cell), "wall": wall, "load": load(), **figures})
        return True

    def _tell(self, cell: Cell) -> None:
        now = time.monotonic() - self.started
        fitting = that_fit(self.left, self.known.predicted, self._time_left())
        scenes = len({other.scene for other in fitting})
        self.bar.total = round(now + sum(map(self.known.predicted, fitting)) + OPENING * scenes)
        self.bar.update(round(now) - self.bar.n)
        self.bar.set_postfix_str(f"{cell.scene.name}: {cell.series.label}, {cell.samples}")


def open_in(worker: Worker, cell: Cell) -> dict:
    """Open the cell's scene in a worker: what is known of its reference, or a failure."""
    return worker.ask(ask="open", scene=asdict(cell.scene), size=cell.size, reference_samples=cell.reference_samples)


def ask_for(worker: Worker, series: Series, samples: int, size: tuple[int, int]) -> dict:
    """The figures of a cell of the scene that the worker has opened. Raises Failed when the process is gone."""
    return worker.ask(ask="cell", series=asdict(series), samples=samples, size=size)


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


def name_of(row: dict) -> str:
    """Of a cell, in words."""
    return f"{row['scene']}, {row['series']['label']}, {row['samples']}"


def beside(rows: list[dict], before: list[dict]) -> list[dict]:
    """The rows of a run of some cells, and those of the results so far whose cells this run did not measure."""
    new = {name_of(row): row for row in rows}
    return [new.pop(name_of(row), row) for row in before] + list(new.values())


def write_results(path: Path, about: dict, references: dict, rows: list[dict], left_out: list[str]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    data = {"about": about, "references": references, "left_out": left_out, "cells": rows}
    write_whole(path, one_row_per_line(data))


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
    parser.add_argument("--anew", action="store_true", help="measure what the results have from elsewhere, too")
    parser.add_argument("--list", action="store_true", help="print the cells and end")
    parser.add_argument(
        "--references", action="store_true", help="render the references alone, which may be done while others work"
    )


def size_of(text: str) -> tuple[int, int]:
    from bench.quick import size_of as parse

    return parse(text)


def chosen(options: argparse.Namespace) -> list[Cell]:
    """The cells that the options ask for. Raises ValueError with a sentence."""
    import bpy  # noqa: F401  (the registry's programs need Blender's gpu module)

    from addon.techniques import REGISTRY
    from bench.cells import PEERS, named_scenes, own_series

    scenes = named_scenes(options.scenes)
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
        for one in series
        for samples in one.samples
        if not options.samples or samples in options.samples
    ]


def render_references(cells: list[Cell]) -> int:
    """Render and keep what the cells are compared with; the exit code."""
    from tqdm import tqdm

    failed = 0
    first = {cell.scene: cell for cell in cells}
    for cell in tqdm(first.values(), disable=not sys.stderr.isatty(), unit="scene"):
        worker = Worker(OUT / "worker.log")
        made = open_in(worker, cell)
        worker.end()
        if "failed" in made:
            failed = 1
            print(f"{cell.scene.name}: {made['failed']}", file=sys.stderr)
        else:
            print(f"{cell.scene.name}: {'found' if made['cached'] else 'rendered'}", flush=True)
    return failed


def command(options: argparse.Namespace) -> int:
    from tqdm import tqdm

    try:
        cells = chosen(options)
    except ValueError as error:
        print(error, file=sys.stderr)
        return 2
    if options.list:
        for cell in in_turns(cells):
            rank = {NEEDED: "needed", MAIN: "main"}.get(cell.rank, "")
            print(f"{cell.scene.name:<20} {cell.series.label:<34} {cell.samples:4}  {rank}")
        return 0
    if options.references:
        return render_references(cells)
    store = Store(OUT / "cells.jsonl")
    before = json.loads(options.results.read_text(encoding="utf-8")) if options.results.exists() else {}
    if not options.anew:
        store.remember(before.get("cells", ()))
    budget = None if options.budget is None else 60.0 * options.budget
    form = "{desc}{percentage:3.0f}% |{bar}| {elapsed}, {remaining} left, {postfix}"
    with tqdm(total=1, bar_format=form, disable=not sys.stderr.isatty()) as bar:
        done = Run(cells, budget, store, bar)
        done.measure()
    about = done.about | {
        "date": dt.datetime.now(dt.UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "commit": ages.git("rev-parse", "--short=10", "HEAD") or "",
        "run": uuid.uuid4().hex,  # what repeats it or is joined to it says so
        "size": list(options.size),
        "reference_samples": options.reference_samples,
        "load": load(),
    }
    rows = gathered(cells, done.machine, store)
    references = {**before.get("references", {}), **done.references}  # those first that this run had no need to open
    left_out = [name_of(described(cell)) for cell in done.missing]
    measured_alike = all(before.get("about", {}).get(name) == about[name] for name in ("size", "reference_samples"))
    if measured_alike and (options.scenes or options.series or options.samples or options.no_peers):
        left_out += [name for name in before["left_out"] if name not in {name_of(described(cell)) for cell in cells}]
        rows = beside(rows, before["cells"])
    write_results(options.results, about, references, rows, left_out)
    for failure in done.failures:
        print(failure, file=sys.stderr)
    print(f"{len(rows)} cells in {options.results}; {len(left_out)} left out")
    return 1 if done.failures else 0
