"""Micro-rendering beside its peers and Cycles' diffuse indirect pass: `python -m bench micro_rendering`.

Scenes x techniques x samples: squared error (relMSE, the noise of the reference taken off), bias, RMS beside the mean
and seconds of a whole render whose programs are compiled, by the clock and of the processor, which hold where others
use it, too. Each figure is kept in bench/results/points.json as soon as it is known, and tables are of all that are
kept of the same size: so what has changed can be measured by itself. The floor is what the error of the two largest
numbers of samples ends at, if the rest falls with their number. Then what error its peers have in the time of one
sample of it and of sixteen, between their nearest two; and error and time of micro-rendering by the side of its
micro-buffers, the number of points, regions and threshold in one scene, at one sample. The seconds are of the machine
that it runs on: where a GPU is drawn in software, a tree that is walked by each of eight lanes is what it does worst.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from bench import study
from bench.indirect import BOUNCES, PATH, ROOMS, reference, render
from bench.points_motion import bent_object
from bench.quick import size_of, table

PAGE = Path(__file__).resolve().parent.parent / "docs" / "micro_rendering.md"
COMMAND = "python -m bench micro_rendering --page"
NAME = "micro_rendering"
PEERS = ("implicit_visibility", "instant_radiosity", "imperfect_shadow_maps", "clustered_visibility", "ssdo")
RESULTS = Path(__file__).resolve().parent / "results" / "points.json"
BENDING = "bending object"  # the Cornell box with a block that is bent
FIGURES = ("seconds", "processor", "relMSE", "bias", "RMS")
HEAD = ("scene", "technique", "samples", *FIGURES)
EQUAL_HEAD = ("scene", "samples", "seconds", NAME, *PEERS)
FLOOR_HEAD = ("scene", NAME, *PEERS)
EQUAL_SAMPLES = (1, 16)
DIAL_HEAD = ("dial", "value", *HEAD[3:], "counters", "gathers a processor second")
DIALS = (
    ("side", (8, 12, 16, 24)),
    ("points", (2048, 4096, 8192, 16384)),
    ("levels", (0, 1, 2)),
    ("threshold", (0.25, 1.0, 4.0)),
)
DIAL_SCENE = "cornell_box"
BENT_FRAMES = 8
ALL_SCENES = (*ROOMS, BENDING)


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--scenes", nargs="*", default=ALL_SCENES, metavar="NAME")
    parser.add_argument("--techniques", nargs="+", default=(NAME, *PEERS), metavar="NAME")
    parser.add_argument("--samples", nargs="+", type=int, default=(1, 16, 64), metavar="N", help="default: 1 16 64")
    parser.add_argument("--most", type=int, default=64, metavar="N", help="samples of micro-rendering at most")
    parser.add_argument("--size", type=size_of, default=(60, 40), metavar="WxH", help="default 60x40")
    parser.add_argument("--reference", type=int, default=256, metavar="N", help="samples of each of two references")
    parser.add_argument("--results", type=Path, default=RESULTS, metavar="PATH", help="where figures are kept")
    parser.add_argument("--no-dials", action="store_true", help="leave out what its parameters cost")
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="write PNGs beside Cycles")
    parser.add_argument("--page", action="store_true", help="write the tables into docs/micro_rendering.md, too")


def measured(scene, technique: str, samples: int, size, truth) -> tuple[tuple[str, str, str], object]:
    """Seconds, error and bias; the picture."""
    from addon.compare.metrics import compare_radiance

    scene.candela.slot_indirect = technique
    render(scene, "CANDELA", 1, 7, size)  # compiles
    begun = time.perf_counter(), time.process_time()
    picture = render(scene, "CANDELA", samples, 1, size)
    seconds = time.perf_counter() - begun[0], time.process_time() - begun[1]
    found = compare_radiance(PATH, picture, *truth)
    return (
        f"{seconds[0]:.2f}", f"{seconds[1]:.2f}", f"{max(found.relmse - found.floor, 0.0):.4f}", f"{found.bias:.3f}",
        f"{rms(picture, *truth):.3f}",
    ), picture  # fmt: skip


def rms(picture: np.ndarray, truth: np.ndarray, noise: np.ndarray) -> float:
    """Root of the mean square of the error beside the mean of the picture, the reference's noise taken off."""
    return float(np.sqrt(max(((picture - truth) ** 2).mean() - (noise**2).mean(), 0.0)) / truth.mean())


def equal_time(rows: list[tuple[str, ...]], figure: str = "relMSE") -> list[tuple[str, ...]]:
    """By scene and EQUAL_SAMPLES: processor seconds of micro-rendering, its error, and its peers' in as long."""
    found, column = [], HEAD.index(figure)
    for scene in dict.fromkeys(row[0] for row in rows):
        own = [row for row in rows if row[0] == scene]
        for samples in EQUAL_SAMPLES:
            mine = next((row for row in own if row[1:3] == (NAME, str(samples))), None)
            if mine is None:
                continue
            seconds, told = float(mine[4]), [mine[column]]
            for peer in PEERS:
                known = sorted((float(row[4]), max(float(row[column]), 1e-5)) for row in own if row[1] == peer)
                told.append(at_time(known, seconds) if known else "")
            found.append((scene, str(samples), f"{seconds:.2f}", *told))
    return found


def floors(rows: list[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """By scene and technique: what the error ends at with many samples, if what is above it falls with their number."""
    found = []
    for scene in dict.fromkeys(row[0] for row in rows):
        told = []
        for technique in (NAME, *PEERS):
            known = sorted((int(row[2]), float(row[5])) for row in rows if row[:2] == (scene, technique))
            if len(known) < 2:
                told.append("")
                continue
            (few, first), (many, last) = known[-2:]
            told.append(f"{max((many * last - few * first) / (many - few), 0.0):.4f}")
        found.append((scene, *told))
    return found


def at_time(known: list[tuple[float, float]], seconds: float) -> str:
    """The error after so long, of (seconds, error) in order: along lines in logarithms; the first's where that takes
    longer, and how long; of more time than the last takes it is at most the last's."""
    if seconds < known[0][0]:
        return f"{known[0][1]:.4f} in {known[0][0]:.2f} s"
    times, errors = np.log(known).T
    error = f"{float(np.exp(np.interp(np.log(seconds), times, errors))):.4f}"
    return error if seconds <= known[-1][0] else f"{error} or less"


def of_scene(name: str, options: argparse.Namespace) -> None:
    """Measure and keep the figures of one scene."""
    scene = opened(name)
    truth = reference(scene, options.reference, options.size)
    shown = [truth[0]]
    for technique in options.techniques:
        for samples in options.samples:
            if technique != NAME or samples <= options.most:
                figures, picture = measured(scene, technique, samples, options.size, truth)
                print(name, technique, samples, *figures, flush=True)
                keep(options.results, options.size, (name, technique, samples), figures)
                shown += [picture] if samples == options.samples[0] else []
    if options.pictures:
        write_picture(options.pictures / f"{name}.png", shown)


def keep(path: Path, size: tuple[int, int], key: tuple[str, str, int], figures: tuple[str, ...]) -> None:
    """Put the figures of a scene, technique and number of samples among those that are kept."""
    from bench import ages, markdown

    kept = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    scene, technique, samples = key
    row = dict(zip(FIGURES, figures)) | {"made": ages.now()}
    kept["/".join((scene, technique, str(samples), "x".join(map(str, size))))] = row
    markdown.write_whole(path, json.dumps(kept, indent=1, sort_keys=True) + "\n")


def kept_rows(path: Path, size: tuple[int, int]) -> tuple[list[tuple[str, ...]], list[str]]:
    """Lines of the table of what is kept of this size, in the order of scenes, techniques and samples; by technique,
    when its oldest was made."""
    kept = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    rows, made = [], {}
    for key, figures in kept.items():
        scene, technique, samples, own_size = key.split("/")
        if own_size == "x".join(map(str, size)):
            rows.append((scene, technique, samples, *(figures[name] for name in FIGURES)))
            made[technique] = min(made.get(technique, figures["made"]), figures["made"])
    order = (*ALL_SCENES,), (NAME, *PEERS)
    rows.sort(key=lambda row: (order[0].index(row[0]), order[1].index(row[1]), int(row[2])))
    return rows, [f"{technique}: {when}" for technique, when in sorted(made.items())]


def dials(options: argparse.Namespace) -> Iterator[tuple[str, ...]]:
    """What parameters cost and bring, one at a time."""
    from addon.frame import ledger

    scene = opened(DIAL_SCENE)
    truth = reference(scene, options.reference, options.size)
    for dial, values in DIALS:
        for value in values:
            setattr(scene.candela, f"{NAME}_{dial}", value)
            figures, _ = measured(scene, NAME, 1, options.size, truth)
            counted = ledger.latest().row(NAME).counters
            told = ("regions", "gathers of points", "light rays", "passes")
            gathers = (counted.get("regions", 0) + counted.get("gathers of points", 0)) / float(figures[1])
            counters = ", ".join(f"{counted[one]} {one}" for one in told if one in counted)
            yield dial, str(value), *figures, counters, f"{gathers:.0f}"
        scene.candela.property_unset(f"{NAME}_{dial}")


def opened(name: str):
    scene = study.opened(DIAL_SCENE if name == BENDING else name)
    if name == BENDING:
        for _ in range(BENT_FRAMES):
            bent_object(scene)
    return scene


def write_picture(path: Path, pictures: list) -> None:
    """Cycles and the techniques side by side, one scale of light for all."""
    from addon.compare.png import png

    scale = max(float(np.percentile(pictures[0], 97)), 1e-30)
    row = np.concatenate([np.clip(picture / scale, 0, 1) ** (1 / 2.2) for picture in pictures], axis=1)
    large = np.repeat(np.repeat(row, 3, axis=0), 3, axis=1)[::-1]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(png((large * 255 + 0.5).astype(np.uint8)))


def tables(rows: list[tuple[str, ...]]) -> str:
    from bench import markdown

    equal = "in the processor seconds of one sample and of sixteen of micro-rendering:"
    floor = "The floor, what relMSE ends at with many samples:"
    by_measure = [
        f"{figure} {equal}\n\n{markdown.table([EQUAL_HEAD, *equal_time(rows, figure)])}" for figure in ("relMSE", "RMS")
    ]
    ends = f"{floor}\n\n{markdown.table([FLOOR_HEAD, *floors(rows)])}"
    return "\n\n".join((markdown.table([HEAD, *rows]), *by_measure, ends))


def page(turned: list, options: argparse.Namespace) -> None:
    """Write the tables into the technique's page."""
    from bench import markdown

    size = "x".join(map(str, options.size))
    rows, made = kept_rows(options.results, options.size)
    if rows:
        text = f"{size} pixels, {BOUNCES} bounces, two references of {options.reference} samples.\n\n" + "\n".join(
            f"- {one}" for one in made
        )
        markdown.put_between(PAGE, f"{COMMAND} --no-dials", f"{text}\n\n{tables(rows)}", stamped=False)
    if turned:
        text = f"One sample, {DIAL_SCENE}.\n\n"
        markdown.put_between(PAGE, f"{COMMAND} --scenes", text + markdown.table([DIAL_HEAD, *turned]))


def command(options: argparse.Namespace) -> int:
    import addon

    addon.register()
    turned: list[tuple[str, ...]] = []
    steps = [lambda name=name: of_scene(name, options) for name in options.scenes]
    if not options.no_dials:
        steps.append(lambda: turned.extend(dials(options)))
    for step in steps:
        step()
        if options.page:  # after each scene: what is measured stays when the run is ended
            page(turned, options)
    rows, _ = kept_rows(options.results, options.size)
    if rows and options.scenes:
        print(f"{table([HEAD, *rows])}\n\n{table([EQUAL_HEAD, *equal_time(rows)])}\n", flush=True)
        print(table([FLOOR_HEAD, *floors(rows)]), flush=True)
    if turned:
        print(table([DIAL_HEAD, *turned]), flush=True)
    if options.page and not options.scenes and options.no_dials:
        page(turned, options)
    return 0
