"""Whether the figures come out again: `python -m bench again`, after `python -m bench run` on the same machine.

For each scene that has them, Candela, Cycles and Cycles with its denoiser are measured once more at 16 samples, in a
fresh process, without their errors, which depend on the seed alone. What must hold is the ratio of a peer's time to
Candela's: the time itself changes with whatever else the machine does. Written to bench/results/again.json, from which
the page takes a sentence. Target: no ratio differs by more than 15 %.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from pathlib import Path

from bench.cells import OWN, PEERS, Series
from bench.figures import MIDDLE, Results, load
from bench.markdown import write_whole
from bench.run import OUT, RESULTS, Worker, ask_for, rounded

AGAIN = (OWN, *(peer for peer in PEERS if peer.engine == "CYCLES" and peer.main))
MOST = 0.15


def measured(results: Results, scene: str, series: Series) -> float | None:
    """Median seconds at 16 samples; None where that was not measured."""
    cell = results.cell(scene, series.label, MIDDLE)
    return statistics.median(cell["times"]) if cell else None


def rows_of(scene: str, before: dict[str, float], after: dict[str, float]) -> list[dict]:
    """For each peer its time over Candela's, before and after."""
    return [
        {"scene": scene, "peer": label, "before": before[label] / before[OWN.label],
         "after": after[label] / after[OWN.label]}
        for label in before
        if label != OWN.label
    ]  # fmt: skip


def difference(row: dict) -> float:
    """By how much the larger of both ratios exceeds the other."""
    return max(row["after"] / row["before"], row["before"] / row["after"]) - 1


def sentence(rows: list[dict]) -> str:
    """For the page."""
    worst = max(rows, key=difference)
    within = sum(difference(row) <= MOST for row in rows)
    return (
        f"Measured again, {within} of {len(rows)} ratios of Cycles' time to Candela's at {MIDDLE} samples came out "
        f"within {100 * MOST:.0f} %; the one that differs most, {worst['peer']} on {worst['scene'].replace('_', ' ')}, "
        f"is {worst['after']:.2g} after {worst['before']:.2g}."
    )


# ------------------------------------------------------------------------------------------------------------- command


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--scenes", nargs="+", metavar="NAME", help="default: all that were measured")
    parser.add_argument("--budget", type=float, metavar="MINUTES", help="leave out the scenes that do not fit")
    parser.add_argument("--results", default=RESULTS, type=Path, metavar="PATH")


def command(options: argparse.Namespace) -> int:
    results = load(options.results)
    end = float("inf") if options.budget is None else time.monotonic() + 60 * options.budget
    rows = []
    for scene in options.scenes or results.scenes:
        before = {one.label: measured(results, scene, one) for one in AGAIN}
        if None in before.values() or time.monotonic() > end:
            continue
        worker, after = Worker(OUT / "worker.log"), {}
        worker.ask(ask="open", scene={"name": scene}, size=results.about["size"], reference_samples=0)
        for one in AGAIN:
            after[one.label] = statistics.median(ask_for(worker, one, MIDDLE, results.about["size"])["times"])
        worker.end()
        rows += rows_of(scene, before, after)
        for row in rows[-len(AGAIN) + 1 :]:
            print(
                f"{scene:<20} {row['peer']:<18} {row['before']:8.3f} {row['after']:8.3f} {100 * difference(row):5.0f} %"
            )
    if not rows:
        print("No scene has Candela and Cycles at 16 samples yet: run `python -m bench run` first.")
        return 1
    path = options.results.with_name("again.json")
    write_whole(
        path, json.dumps({"run": results.about.get("run"), "rows": rounded(rows)}, indent=1, ensure_ascii=False) + "\n"
    )
    print(sentence(rows))
    return 0
