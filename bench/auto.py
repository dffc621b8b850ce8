"""What Auto takes of the shadow and the indirect slot, beside all that it could: `python -m bench auto`.

Twenty-five scenes that are no samples (bench/auto_scenes.py), 64x48 pixels. Each technique of a slot renders two
seeds, and five where that is fast; its error is the mean relMSE beside Cycles (net of that reference's noise, and at
least as much as that), its time the least processor seconds of those after the first, which compiles, and of ROUNDS
more in which fast techniques take turns, since what else a machine does only adds. Shadows are rendered without
bounces, the indirect slot with all.

Error x time does not depend on the samples of a method without bias; Auto holds where its product is at most 1.1 times
the least of the slot, or where the same technique is what it took. What is measured is kept at once in
bench/results/auto.json, by scene, slot and samples, so that an interrupted run goes on; `--page` writes docs/auto.md.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from pathlib import Path

from bench.auto_scenes import SCENES
from bench.markdown import put_between, table, write_whole
from bench.run import ROOT

RESULTS = ROOT / "bench" / "results" / "auto.json"
PAGE = ROOT / "docs" / "auto.md"
SIZE = 64, 48
SLOTS = {"shadow": 0, "indirect": 16}  # bounces
REFERENCE = 1024
SEEDS = 5
ROUNDS = 6
FAST = 0.3  # seconds
SLOW = 8.0  # times what Auto takes: slower techniques are rendered once, and not with more samples
NEAR = 1.1  # of the best product, up to which Auto holds
AUTO = "AUTO"


def techniques(slot: str) -> list[str]:
    from addon.techniques import REGISTRY

    return [technique.name for technique in REGISTRY if slot in technique.fills]


def rendered(scene, engine: str, samples: int, seed: int, bounces: int):
    """(H, W, 3) Combined, and processor seconds."""
    from addon.compare.reference import render_passes

    before = time.process_time()
    found = render_passes(scene, engine, samples, seed, size=SIZE, bounces=bounces).images["combined"][..., :3]
    return found, time.process_time() - before


def measured(scene, slot: str, wish: str, samples: int, truth, most: float = math.inf) -> dict:
    """Error and seconds of a technique (or Auto), and what filled the slot. `most`: seconds, above which one picture
    has to do."""
    from addon.compare.metrics import compare_radiance
    from addon.frame import ledger

    setattr(scene.candela, f"slot_{slot}", wish)
    errors, seconds = [], []
    for seed in range(1, SEEDS + 1):
        picture, took = rendered(scene, "CANDELA", samples, seed, SLOTS[slot])
        found = compare_radiance("combined", picture, *truth)
        errors.append(max(found.relmse - found.floor, found.floor, 1e-6))
        seconds.append(took)
        if (seed > 1 and took > FAST) or took > most:
            break
    setattr(scene.candela, f"slot_{slot}", AUTO)
    filled = [row for row in ledger.latest().rows if slot in row.slot.split(", ") and row.state != "skipped"]
    return {
        "error": sum(errors) / len(errors), "seconds": min(seconds[1:] or seconds),
        "filled": filled[0].name if filled else "nothing",
    }  # fmt: skip


def timed(scene, slot: str, samples: int, rows: dict[str, dict]) -> None:
    """Lower the seconds of the fast ones among `rows` to the least of ROUNDS, by turns."""
    fast = [
        name for name, row in rows.items() if row["seconds"] < FAST and row["filled"] in (name, rows[AUTO]["filled"])
    ]
    for seed in range(SEEDS + 1, SEEDS + 2 + ROUNDS):
        for name in fast:
            setattr(scene.candela, f"slot_{slot}", name)
            took = rendered(scene, "CANDELA", samples, seed, SLOTS[slot])[1]
            if seed > SEEDS + 1:  # the first may compile
                rows[name]["seconds"] = min(rows[name]["seconds"], took)
    setattr(scene.candela, f"slot_{slot}", AUTO)


def product(row: dict) -> float:
    return row["error"] * row["seconds"]


def verdict(rows: dict[str, dict]) -> tuple[str, float]:
    """The best technique by error x time, and how many times as much Auto's choice has, measured as that technique."""
    able = {name: row for name, row in rows.items() if name != AUTO and row["filled"] == name}
    best = min(able, key=lambda name: product(able[name]))
    took = rows[AUTO]["filled"]
    own = product(able[took]) if took in able else product(rows[AUTO])
    return best, own / product(able[best])


def page(results: dict) -> str:
    """Tables by slot and number of samples."""
    parts = []
    for slot in SLOTS:
        for samples in sorted({int(key.split("/")[2]) for key in results if key.split("/")[1] == slot}):
            names = techniques(slot)
            head = ["scene", *(name.replace("_", " ") for name in names), "best", "Auto took", "its error x time"]
            rows, ratios = [head], []
            for scene in SCENES:
                found = results.get(f"{scene}/{slot}/{samples}")
                if found is None:
                    continue
                best, ratio = verdict(found)
                ratios.append(ratio)
                cells = [
                    f"{found[name]['error']:.4f}, {found[name]['seconds']:.2f} s"
                    if name in found and found[name]["filled"] == name else "–"
                    for name in names
                ]  # fmt: skip
                took = found[AUTO]["filled"].replace("_", " ")
                rows.append([scene.replace("_", " "), *cells, best.replace("_", " "), took, f"{ratio:.2f}"])
            held = sum(ratio <= NEAR for ratio in ratios)
            mean = math.exp(sum(map(math.log, ratios)) / len(ratios))
            parts.append(
                f"### {slot.capitalize()} slot, {samples} sample{'s' if samples > 1 else ''}\n\n{table(rows)}\n\n"
                f"Auto is within {100 * (NEAR - 1):.0f} % of the best in {held} of {len(ratios)} scenes; its error "
                f"x time is {mean:.2f} times the best one's in the (geometric) mean, {max(ratios):.2f} times at worst."
            )
    return "\n\n".join(parts)


# ------------------------------------------------------------------------------------------------------------- command


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--scenes", nargs="*", default=[], metavar="NAME")
    parser.add_argument("--slots", nargs="*", default=[*SLOTS], choices=[*SLOTS])
    parser.add_argument("--samples", nargs="*", type=int, default=[1, 4])
    parser.add_argument("--leave-out", nargs="*", default=[], metavar="NAME", help="techniques that are not measured")
    parser.add_argument("--anew", action="store_true", help="measure again what is known")
    parser.add_argument(
        "--only-auto", action="store_true", help="ask anew what Auto takes; techniques stay as measured"
    )
    parser.add_argument("--only-times", action="store_true", help="time fast techniques again; errors stay as measured")
    parser.add_argument("--page", action="store_true", help="write docs/auto.md from what was measured")
    parser.add_argument("--results", type=Path, default=RESULTS)


def command(options: argparse.Namespace) -> int:
    results = json.loads(options.results.read_text()) if options.results.exists() else {}
    if not options.page or options.scenes:
        import bpy  # noqa: F401

        import addon

        addon.register()
        for name in options.scenes or SCENES:
            _measure(name, options, results)
    if options.page:
        put_between(PAGE, "python -m bench auto --page", page(results))
    else:
        print(page(results))
    return 0


def _slow(rows: dict[str, dict]) -> set[str]:
    """Techniques that took far longer than Auto."""
    return {name for name, row in rows.items() if name != AUTO and row["seconds"] > SLOW * rows[AUTO]["seconds"]}


def _measure(name: str, options: argparse.Namespace, results: dict) -> None:
    from addon import engine
    from bench.auto_scenes import build

    wanted = [(slot, n) for slot in options.slots for n in options.samples if f"{name}/{slot}/{n}" not in results
              or options.anew or options.only_auto or options.only_times]  # fmt: skip
    if not wanted:
        return
    scene = build(name)
    lit = any(thing.type == "LIGHT" for thing in scene.objects)
    wanted = [(slot, n) for slot, n in wanted if slot != "shadow" or lit]
    truths: dict[str, tuple] = {}
    for slot, samples in wanted:
        known = results.get(f"{name}/{slot}/{samples}")
        if options.only_times:
            if known:
                timed(scene, slot, samples, known)
                write_whole(options.results, json.dumps(results, indent=1) + "\n")
                print(f"{name} {slot} {samples}: {verdict(known)[1]:.2f}", flush=True)
            continue
        if slot not in truths:
            first, second = (rendered(scene, "CYCLES", REFERENCE // 2, seed, SLOTS[slot])[0] for seed in (1, 2))
            truths[slot] = (first + second) / 2, (first - second) / 2
        found = dict(known or {}) if options.only_auto else {}
        slow = _slow(results.get(f"{name}/{slot}/1", {})) if samples > 1 else set()
        for wish in (AUTO, *(() if options.only_auto else techniques(slot))):
            if wish not in slow and wish not in options.leave_out:
                most = SLOW * found[AUTO]["seconds"] + 2.0 if AUTO in found else math.inf
                found[wish] = measured(scene, slot, wish, samples, truths[slot], most)
        timed(scene, slot, samples, found)
        results[f"{name}/{slot}/{samples}"] = found
        best, ratio = verdict(found)
        print(f"{name} {slot} {samples}: Auto took {found[AUTO]['filled']}, best {best}, {ratio:.2f}", flush=True)
        write_whole(options.results, json.dumps(results, indent=1) + "\n")
    engine.free_sessions()
