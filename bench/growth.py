"""How cost grows over dials, in counters and seconds: `python -m bench growth`.

The dials are those of the procedural scenes (bench/families.py), and of one sample scene the size of the picture, the
samples and the virtual lights. Each value is rendered cold once, then once waiting for the GPU after each step, which
gives the times by technique, and then `--runs` times; a whole render's time is the median of all warm ones. The
exponent is that of time over the dial between its two largest values: 1 is in proportion, 0 is free. Counters hold on
every machine. Within a budget the dials are measured from their small values on, as long as there is time.
"""

from __future__ import annotations

import argparse
import datetime as dt
import json
import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bench.cells import ROOT, SCENES, Series
from bench.markdown import write_whole

RESULTS = ROOT / "bench" / "results" / "growth.json"
SAMPLES, SIZE = 4, (128, 96)
SAMPLE = "soft_shadow_garden"
SERIES = Series("Candela", "CANDELA", ())


@dataclass(frozen=True)
class Dial:
    """What is turned, the light path that it tests, and how a value is set up; `open` is given the value."""

    name: str
    path: str
    values: tuple[float, ...]
    open: Callable[[float], None]
    samples: Callable[[float], int] = lambda value: SAMPLES
    size: Callable[[float], tuple[int, int]] = lambda value: SIZE


def dials() -> tuple[Dial, ...]:
    from bench import families

    def member(name: str) -> Callable[[float], None]:
        return lambda value: families.build(name, value)

    own = [Dial(f.name, f.path, f.values, member(f.name)) for f in families.FAMILIES.values()]
    return (
        *own,
        Dial("width", "all", (64, 128, 256), _open_sample, size=lambda value: (int(value), int(value * 3 / 4))),
        Dial("samples", "all", (1, 4, 16), _open_sample, samples=int),
        Dial("virtual lights", "diffuse indirect", (8, 32, 128), _open_with_virtual_lights),
    )


def _open_sample(_: float) -> None:
    import bpy

    bpy.ops.wm.open_mainfile(filepath=str(SCENES / f"{SAMPLE}.blend"))


def _open_with_virtual_lights(count: float) -> None:
    import bpy

    _open_sample(count)
    bpy.context.scene.candela.instant_radiosity_virtual_lights = int(count)


@contextmanager
def profiled(scene) -> Iterator[None]:
    """Renders inside wait for the GPU after each technique, so that the ledger's times are true."""
    from addon import engine

    renderer = engine.session(scene, "final").renderer
    begin = renderer.begin
    renderer.begin = lambda snapshot, settings, *rest: begin(snapshot, replace(settings, profile=True), *rest)
    try:
        yield
    finally:
        del renderer.begin


def measure(dial: Dial, value: float, runs: int) -> dict:
    """Seconds, and per technique time and counters, at one value of a dial."""
    import bpy

    from addon import engine
    from bench import worker

    engine.free_sessions()
    dial.open(value)
    scene = bpy.context.scene
    opened = worker.Open(scene, scene.view_layers[0], None, set())
    samples, size = dial.samples(value), dial.size(value)
    cold = worker.render(opened, SERIES, samples, 1000, size)["seconds"]
    with profiled(scene):
        times = [worker.render(opened, SERIES, samples, 0, size)["seconds"]]
    ledger = worker.of_ledger()["techniques"]
    times += [worker.render(opened, SERIES, samples, run + 1, size)["seconds"] for run in range(runs)]
    return {
        "dial": dial.name, "path": dial.path, "value": value, "samples": samples, "size": list(size), "cold": cold,
        "seconds": float(np.median(times)),
        "techniques": {row["label"]: row["ms"] for row in ledger},
        "counters": {row["label"]: row["counters"] for row in ledger if row["counters"]},
    }  # fmt: skip


def measured(chosen: list[Dial], runs: int, budget: float | None, terminal) -> list[dict]:
    """Rows by dial; within `budget` minutes, the small values of all dials first.

    A value that is likely to outlast the time, taking as much longer than the one before as that one did, ends its
    dial.
    """
    from tqdm import tqdm

    end = float("inf") if budget is None else time.monotonic() + 60 * budget
    work = [(dial, value) for dial in chosen for value in dial.values]
    if budget is not None:
        work.sort(key=lambda one: one[0].values.index(one[1]))
    walls: dict[Dial, list[float]] = {}
    rows = []
    for dial, value in tqdm(work, file=terminal, disable=not terminal.isatty(), unit="scene"):
        past = walls.setdefault(dial, [])
        likely = past[-1] * max(past[-1] / past[-2], 1.0) if len(past) > 1 else sum(past)
        begun = time.monotonic()
        if begun + likely > end:
            continue
        rows.append(measure(dial, value, runs))
        past.append(time.monotonic() - begun)
    return sorted(rows, key=lambda row: [dial.name for dial in chosen].index(row["dial"]))


def exponent(rows: list[dict]) -> float:
    """Growth of time between the two largest values, as a power of the dial."""
    before, last = rows[-2:]
    return math.log(last["seconds"] / before["seconds"]) / math.log(last["value"] / before["value"])


def table(rows: list[dict]) -> list[tuple[str, ...]]:
    """One line per dial: its values and seconds, the exponent, and the technique that takes most at the end."""
    found = [("dial", "light path", "from", "to", "seconds", "exponent", "dearest at the end", "what grows with it")]
    for name in dict.fromkeys(row["dial"] for row in rows):
        some = sorted((row for row in rows if row["dial"] == name), key=lambda row: row["value"])
        if len(some) < 2:
            continue
        first, last = some[0], some[-1]
        dearest = max(last["techniques"], key=last["techniques"].get)
        share = last["techniques"][dearest] / max(sum(last["techniques"].values()), 1e-9)
        found.append((
            name, first["path"], f"{first['value']:g}", f"{last['value']:g}",
            f"{first['seconds']:.2f} to {last['seconds']:.2f}", f"{exponent(some):.2f}",
            f"{dearest} ({100 * share:.0f} %)", grown_counters(first, last),
        ))  # fmt: skip
    return found


def grown_counters(first: dict, last: dict) -> str:
    """Counters that changed over the dial, from its smallest to its largest value."""
    said = []
    for label, counters in last["counters"].items():
        for name, value in counters.items():
            before = first["counters"].get(label, {}).get(name, 0)
            if value != before:
                said.append(f"{name} {before} to {value}")
    return ", ".join(said[:3]) or "–"


# ------------------------------------------------------------------------------------------------------------- command


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--dials", nargs="+", metavar="NAME", help="default: all")
    parser.add_argument("--runs", default=2, type=int, metavar="N", help="default 2")
    parser.add_argument("--budget", type=float, metavar="MINUTES", help="leave out the large values that do not fit")
    parser.add_argument("--results", default=RESULTS, type=Path, metavar="PATH")


def command(options: argparse.Namespace) -> int:
    import bpy  # noqa: F401

    import addon
    from addon.cli.terminal import quiet
    from bench import worker
    from bench.quick import table as aligned
    from bench.run import load, rounded

    addon.register()
    with quiet():
        about = worker.about()
    chosen = [dial for dial in dials() if not options.dials or dial.name in options.dials]
    with quiet() as terminal:
        rows = measured(chosen, options.runs, options.budget, terminal)
    about |= {"date": dt.datetime.now(dt.UTC).strftime("%Y-%m-%d %H:%M UTC"), "load": load()}
    options.results.parent.mkdir(parents=True, exist_ok=True)
    lines = ",\n".join(json.dumps(rounded(row), ensure_ascii=False) for row in rows)
    write_whole(options.results, f'{{"about": {json.dumps(rounded(about))},\n"rows": [\n{lines}\n]}}\n')
    print(aligned(table(rows)))
    print(options.results)
    return 0
