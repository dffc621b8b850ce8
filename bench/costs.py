"""The table that Auto reads, out of the benchmark's results: `python -m bench costs`.

For each slot with several techniques and each number of samples: error and time of each technique relative to the first
of the slot, as geometric means over the scenes that have both. Which technique ran in a cell is taken from the ledger
of that cell, so that a cell in which Auto chose counts for what it chose. Scenes whose picture does not depend on the
slot (both ran, and the error is the same to four digits) say something about time only, and count all the same.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from bench.cells import choices
from bench.figures import Results, geometric_mean, load
from bench.markdown import write_whole
from bench.run import RESULTS, rounded


def slots_of(registry: Iterable) -> dict[str, list[str]]:
    """Slots with a choice: names of their techniques in the registry's order."""
    return {slot: [technique.name for technique in techniques] for slot, techniques in choices(registry).items()}


def measured(
    results: Results, slot: str, slots: dict[str, list[str]]
) -> dict[tuple[str, int, str], tuple[float, float]]:
    """(scene, samples, technique) -> (error, seconds), of cells where every other slot has its first technique."""
    others = {name for other, names in slots.items() if other != slot for name in names[1:]}
    found = {}
    for cell in results.cells:
        if cell["series"]["engine"] != "CANDELA" or cell["series"]["bounces"] is not None:
            continue
        ran = {row["name"] for row in cell["techniques"]}
        mine, error = ran & set(slots[slot]), cell["errors"]["combined"]["relmse"]
        if len(mine) == 1 and not ran & others and error:
            found[cell["scene"], cell["samples"], mine.pop()] = (error, float(np.median(cell["times"])))
    return found


def costs(results: Results, slots: dict[str, list[str]]) -> dict[str, dict[str, dict[str, list[float]]]]:
    """The table, as technique_costs.json holds it: slot -> technique -> samples -> [error, seconds]."""
    table = {}
    for slot, names in slots.items():
        found = measured(results, slot, slots)
        rows: dict[str, dict[str, list[float]]] = {}
        for samples in sorted({n for _, n, _ in found}):
            scenes = {scene for scene, n, name in found if n == samples and name == names[0]}
            for name in names:
                both = [scene for scene in sorted(scenes) if (scene, samples, name) in found]
                ratios = [
                    [a / b for a, b in zip(found[scene, samples, name], found[scene, samples, names[0]])]
                    for scene in both
                ]
                if ratios:
                    rows.setdefault(name, {})[str(samples)] = [
                        geometric_mean([ratio[k] for ratio in ratios]) for k in range(2)
                    ]
        if len(rows) > 1:
            table[slot] = rows
    return table


def text(results: Results, table: dict) -> str:
    """technique_costs.json: a technique's row per line."""
    about = {name: results.about[name] for name in ("date", "size", "blender", "device", "cpu")}
    about["scenes"] = results.scenes
    lines = []
    for slot, techniques in table.items():
        rows = ",\n".join(f'   "{name}": {json.dumps(rounded(rows))}' for name, rows in techniques.items())
        lines.append(f'  "{slot}": {{\n{rows}\n  }}')
    return f'{{\n "about": {json.dumps(about, ensure_ascii=False)},\n "slots": {{\n' + ",\n".join(lines) + "\n }\n}\n"


# ------------------------------------------------------------------------------------------------------------- command


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--results", default=RESULTS, type=Path, metavar="PATH")


def command(options: argparse.Namespace) -> int:
    import bpy  # noqa: F401

    from addon.frame import technique_costs as auto
    from addon.techniques import REGISTRY

    results = load(options.results)
    slots = slots_of(REGISTRY)
    table = costs(results, slots)
    missing = sorted(set(slots) - set(table))
    if missing:
        print(f"Nothing was measured for the slot {', '.join(missing)}; its row stays away.")
    write_whole(auto.PATH, text(results, table))
    for slot, names in slots.items():
        for samples in (1, 4, 16, 64):
            print(f"{slot}, {samples} samples: {auto.preferred(auto.read(auto.PATH), slot, names, samples)}")
    print(auto.PATH)
    return 0
