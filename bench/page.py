"""The page of the benchmark, and its part of the README and of docs/performance.md: `python -m bench page`.

Reads bench/results/bench.json, and growth.json, profile.json and again.json beside it where they are; renders nothing.
"""

from __future__ import annotations

import argparse
import base64
import html
import json
import statistics
from pathlib import Path
from string import Template

from bench import again, ages, markdown, plots, profile
from bench import growth as growth_of_cost
from bench.cells import NO_TRUTH, RAW, ROOT
from bench.figures import (
    MIDDLE,
    OWN,
    Results,
    against,
    at_fault,
    bias_floor,
    geometric_mean,
    load,
    without_noise,
)
from bench.run import OUT, RESULTS

REMEDIES = {  # of the paths that figures.at_fault ranks
    "diffuse_direct": "more points of each light a sample, or filtering of the picture",
    "glossy_direct": "lobes and lights sampled together for more of the roughness' range, or filtering the picture",
    "diffuse_indirect": "virtual lights that are shared among more pixels, or filtering of indirect light apart from "
    "the surfaces' colours",
    "glossy_indirect": "rays by the surface's lobe that reuse those of neighbours, where virtual lights are too few",
    "transmission_indirect": "more than one path through glass a sample",
}
FEWEST_SCENES = 5  # of which a mean is shown
WORDS = 28  # letters from which on a cell of a table is text that may be broken
BUSY = 2.0  # processes that want each thread, from which on times say little; the benchmark itself wants about one
PEERS = ("EEVEE", "EEVEE, ray traced", "Cycles", "Cycles, denoised")
README, PERFORMANCE = ROOT / "README.md", ROOT / "docs" / "performance.md"
PICTURE = ROOT / "docs" / "images" / "bench.png"
COMMAND = "python -m bench page"  # whose part of a document is written

PAGE = Template("""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>Candela: time against error</title>
<style>
body { margin: 0; background: #f6f5f2; color: #1d1c1a; font: 15px/1.5 system-ui, "Segoe UI", sans-serif; }
main { max-width: 1240px; margin: 0 auto; padding: 28px 20px 60px; }
h1 { font-size: 26px; margin: 0; } h2 { font-size: 19px; margin: 40px 0 8px; }
p { max-width: 86ch; margin: 6px 0; } .dim { color: #6b675f; }
img { max-width: 100%; background: #fff; border: 1px solid #e3dfd7; border-radius: 8px; }
.wide { overflow-x: auto; } table { border-collapse: collapse; background: #fff; font-size: 14px; margin: 8px 0; }
th, td { padding: 5px 12px; border-bottom: 1px solid #e3dfd7; text-align: right; vertical-align: top;
  font-variant-numeric: tabular-nums; }
td { white-space: nowrap; } td.words { text-align: left; white-space: normal; min-width: 26ch; }
th { color: #6b675f; font-weight: 550; vertical-align: bottom; }
th:first-child, td:first-child { text-align: left; }
.good { color: #2f7d4f; } .bad { color: #b3261e; } details { margin: 8px 0; } summary { cursor: pointer; }
</style></head><body><main>
<h1>Time against error</h1>
<p class="dim">$facts</p>$reserve
<h2>All scenes</h2>
<p>$reading</p>
<img src="$overview" alt="Time against error of every scene">
$tables
$scenes
$growth
$left_out
</main></body></html>
""")

READING = (
    "Seconds of a whole render to the right, relMSE of the picture upwards, both logarithmic: lower left is better. "
    "A marker is one setting, its line the staircase of settings that no other of its series beats. The grey band is "
    "the noise of the reference, below which no error is quoted; a dotted line is the error that a series tends to. "
    "Peers are held against Candela's curves together, by its defaults and by its Fast and Draft presets."
)
PROFILE = (
    "A render of 16 samples: cold, with compiled programs, and again with nothing changed; shares of a render under "
    "Python's profiler."
)
GROWTH = (
    "Each dial from small to large: seconds of a whole render, and by which power of the dial they grow between its "
    "two largest values."
)


# -------------------------------------------------------------------------------------------------------------- tables

Table = list[tuple[str, ...]]  # the first row is the head


def summary(results: Results) -> Table:
    """Per scene and peer: speed-up at equal error and error ratio at equal time; the last row is the mean.

    Bounds that say nothing (faster than something below 1, slower than something above) are not part of the mean.
    """
    head = ("scene", *(f"{peer}: {what}" for peer in PEERS for what in ("speed-up", "error ratio")))
    rows: Table = [head]
    columns: list[list[float]] = [[] for _ in range(2 * len(PEERS))]
    bounds = [0] * len(columns)
    for scene in results.scenes:
        cells = [scene.replace("_", " ")]
        own = results.own_curve(scene)
        for number, peer in enumerate(PEERS):
            found = against(own, results.curve(scene, peer), peer)
            for place, value, bound in ((2 * number, found.speed_up, found.bound), (2 * number + 1, found.gain, "")):
                cells.append(f"{bound} {times(value)}".strip())
                if value is not None and not vague(value, bound):
                    columns[place].append(value)
                    bounds[place] += bool(bound)
        rows.append(tuple(cells))
    rows.append(("geometric mean", *map(mean_of, columns, bounds)))
    return rows


def mean_of(values: list[float], bounds: int) -> str:
    """The geometric mean with the number of scenes, and of bounds among them; of few scenes it says nothing."""
    scenes = f"{len(values)} scene{'s' * (len(values) != 1)}" + (f", {bounds} of them bounds" if bounds else "")
    return f"{times(geometric_mean(values))} ({scenes})" if len(values) >= FEWEST_SCENES else f"– ({scenes})"


def vague(value: float, bound: str) -> bool:
    """Whether a bound leaves open which of the two is better."""
    return (bound == ">" and value < 1) or (bound == "<" and value > 1)


def claims(results: Results) -> list[str]:
    """What the benchmark was made to show, with the figures found."""
    sentences = []
    scenes = results.scenes
    tenth = []
    for scene in scenes:
        own, peer = results.own_curve(scene), results.curve(scene, "EEVEE, ray traced")
        sixteen = next((point for point in peer if point.samples == MIDDLE), None)
        if own and sixteen:
            first = min((p.seconds for p in own if p.error <= sixteen.error), default=None)
            tenth.append((scene, None if first is None else sixteen.seconds / first))
    if tenth:
        reached = [scene for scene, ratio in tenth if ratio is not None and ratio >= 10]
        sentences.append(
            f"The error of EEVEE with ray tracing and 16 samples is reached in a tenth of its time or less on "
            f"{len(reached)} of {len(tenth)} scenes"
            + listed("; not on", [f"{s} ({times(r)})" for s, r in tenth if s not in reached])
            + "."
        )
    gains, late, net = [], [], []
    for scene in scenes:
        own, peer = results.own_curve(scene), results.curve(scene, "Cycles, denoised")
        found = against(own, peer, "")
        if found.gain is not None:
            gains.append((scene, found.gain))
            late.append((scene, found.late_gain))
            noise = results.floor(scene)
            net.append((scene, against(without_noise(own, noise), without_noise(peer, noise), "").gain))
    if gains:
        lost = [(scene, gain) for scene, gain in gains if gain <= 1]
        sentences.append(
            f"In equal time, that of Candela's {MIDDLE} samples or of the slowest picture of Cycles with its denoiser "
            "that was measured, Candela has less error on "
            f"{len(gains) - len(lost)} of {len(gains)} scenes"
            + listed("; not on", [f"{scene} ({times(gain)})" for scene, gain in lost])
            + "."
        )
        behind = [f"{scene} ({times(gain)})" for scene, gain in late if gain <= 1]
        sentences.append(
            "In the time of the longest picture that both have, mostly that of Candela's largest number of samples, it "
            f"has less error on {len(late) - len(behind)} of {len(late)}{listed('; not on', behind)}."
        )
        apart = [f"{scene} {times(gain)}" for scene, gain in net]
        sentences.append(
            "The reference's noise is part of both errors and makes them more alike than they are. With it taken off, "
            f"the ratios in equal time are{listed('', apart)}; geometric mean "
            f"{times(geometric_mean([gain for _, gain in net]))}."
        )
        sentences += remedies(results, [scene for scene, _ in lost])
    return sentences


def denoising(results: Results) -> list[str]:
    """What denoising Candela's picture brings, and what it costs, at 16 samples."""
    errors, seconds = [], []
    for scene in results.scenes:
        with_it, without = (
            next((point for point in results.curve(scene, label) if point.samples == MIDDLE), None)
            for label in (OWN, RAW.label)
        )
        if with_it and without:
            errors.append(without.error / with_it.error)
            seconds.append(with_it.seconds / without.seconds)
    if not errors:
        return []
    return [
        (
            f"Candela's own denoising divides the error of {MIDDLE} samples by {geometric_mean(errors):.2f} and "
            f"multiplies their time by {geometric_mean(seconds):.2f} (geometric means of {len(errors)} scenes)."
        )
    ]


def said(results: Results, repeated: list[dict]) -> list[str]:
    """The claims, what denoising brings, and whether figures came out again."""
    return claims(results) + denoising(results) + ([again.sentence(repeated)] if repeated else [])


def remedies(results: Results, scenes: list[str]) -> list[str]:
    """For scenes by the light path that is most at fault in them: what would mend it."""
    by_path: dict[str, list[str]] = {}
    for scene in scenes:
        paths = at_fault(results, scene)
        if paths:
            by_path.setdefault(paths[0][0], []).append(scene)
    return [
        f"On {', '.join(some).replace('_', ' ')} most of the error is {path.replace('_', ' ')} light: {REMEDIES[path]}."
        for path, some in by_path.items()
    ]


def listed(before: str, names: list[str]) -> str:
    return f"{before} {', '.join(name.replace('_', ' ') for name in names)}" if names else ""


def faults(results: Results) -> Table:
    """Per scene: error at 16 and at the most samples, bias, floor of the reference, and the path at fault."""
    rows: Table = [("scene", "relMSE at 16", "at most", "samples", "bias", "tends to", "noise floor", "path at fault")]
    for scene in results.scenes:
        points = results.curve(scene, OWN)
        if not points:
            continue
        last, floor = points[-1], results.floor(scene)
        cell = results.cell(scene, OWN, last.samples)
        middle = next((point.error for point in points if point.samples == MIDDLE), None)
        tends, paths = bias_floor(points, floor), at_fault(results, scene)
        said = ", ".join(f"{path.replace('_', ' ')} {100 * share:.0f} %" for path, share in paths[:2])
        rows.append((
            scene.replace("_", " "), scientific(middle), scientific(last.error), str(last.samples),
            f"{cell['errors']['combined']['bias']:.3f}", "still falling" if tends is None else scientific(tends),
            scientific(floor), said or "–",
        ))  # fmt: skip
    return rows


def pass_times(results: Results, scene: str) -> Table:
    """Per technique at 16 samples: share of the passes' time, and what it counted."""
    cell = results.cell(scene, OWN, MIDDLE) or next(
        (c for c in results.cells if c["scene"] == scene and c.get("techniques")), None
    )
    if cell is None or not cell.get("techniques"):
        return []
    total = sum(row["ms"] for row in cell["techniques"]) or 1.0
    rows: Table = [("technique", "ms", "share", "counted in the frame")]
    for row in sorted(cell["techniques"], key=lambda row: -row["ms"]):
        counted = ", ".join(f"{value} {name}" for name, value in row["counters"].items())
        rows.append((row["label"], f"{row['ms']:.0f}", f"{100 * row['ms'] / total:.0f} %", counted or "–"))
    return rows


def times(value: float | None) -> str:
    if value is None:
        return "–"
    return f"{value:.0f} ×" if value >= 9.95 else f"{value:.1f} ×" if value >= 1 else f"{value:.2f} ×"


def scientific(value: float | None) -> str:
    return "–" if value is None else f"{value:.1e}"


# --------------------------------------------------------------------------------------------------------------- texts


def as_html(table: Table) -> str:
    if not table:
        return ""
    head, *rows = table
    lines = ["<tr>" + "".join(f"<th>{html.escape(cell)}</th>" for cell in head) + "</tr>"]
    lines += ["<tr>" + "".join(_cell(cell) for cell in row) + "</tr>" for row in rows]
    return f'<div class="wide"><table>{"".join(lines)}</table></div>'


def _cell(text: str) -> str:
    kind = ' class="words"' if len(text) > WORDS else ""
    if text.endswith("×"):
        bound, _, number = text.removesuffix(" ×").rpartition(" ")
        value = float(number)
        kind = "" if vague(value, bound) else ' class="good"' if value > 1 else ' class="bad"'
    return f"<td{kind}>{html.escape(text)}</td>"


def facts(results: Results) -> str:
    about = results.about
    width, height = about["size"]
    return (
        f"{about['date']}, {width} × {height} pixels, Blender {about['blender']}, {about['device']}, "
        f"{about['cpu']}. Reference: Cycles with all bounces, 2 × {about['reference_samples']} samples."
    )


def reserve(results: Results) -> list[str]:
    """What a reader must know before believing the figures: what is missing, and whether the machine had rest."""
    pages = ", ".join(f"{name.replace('_', ' ')} ({page})" for name, page in NO_TRUTH.items())
    sentences = [f"Sample scenes of which Cycles gives no truth are not here: {pages}."]
    cells = [cell for cell in results.cells if cell["scene"] not in NO_TRUTH]
    left_out = [name for name in results.left_out if name.partition(",")[0] not in NO_TRUTH]
    measured, asked = len(cells), len(cells) + len(left_out)
    if left_out:
        absent = sorted({name.partition(",")[0] for name in left_out} - set(results.scenes))
        sentences.append(
            f"{measured} of {asked} points were measured within the time that was given"
            + listed("; nothing of", absent) + ". Another run of the command goes on with the rest."
        )  # fmt: skip
    loads = [cell["load"] for cell in results.cells if cell.get("load") is not None]
    threads = results.about.get("threads")
    if loads and threads and statistics.median(loads) > BUSY * threads:
        sentences.append(
            f"The machine was busy with other things (a load of {statistics.median(loads):.0f} on {threads} threads): "
            "times are too long, of all engines alike."
        )
    return sentences


def paragraphs(sentences: list[str]) -> str:
    return "".join(f"<p>{html.escape(sentence)}</p>" for sentence in sentences)


def image(path: Path) -> str:
    return "data:image/png;base64," + base64.b64encode(path.read_bytes()).decode()


def make_page(results: Results, grown: list[dict], profiled: list[dict], repeated: list[dict], folder: Path) -> Path:
    """Write index.html and its pictures into the folder."""
    plots.overview(results, folder / "overview.png")
    scenes = []
    for scene in results.scenes:
        if not results.paths(scene):
            continue
        plots.scene_figure(results, scene, folder / f"{scene}.png")
        table = as_html(pass_times(results, scene))
        scenes.append(
            f"<h2>{scene.replace('_', ' ')}</h2><img src='{image(folder / f'{scene}.png')}' alt='{scene}'>"
            f"<details><summary>Passes at {MIDDLE} samples</summary>{table}</details>"
        )
    growth = ""
    if profiled:
        growth += f"<h2>Where a render's time goes</h2><p>{PROFILE}</p>{as_html(profile.table(profiled))}"
    if grown:
        plots.growth(grown, folder / "growth.png")
        growth += (
            f"<h2>Growth of cost</h2><p>{GROWTH} The dashed line grows in proportion.</p>"
            f"<img src='{image(folder / 'growth.png')}' alt='Growth of cost'>{as_html(growth_of_cost.table(grown))}"
        )
    left_out = ""
    if results.left_out:
        rows = "".join(f"<li>{html.escape(name)}</li>" for name in results.left_out)
        count = f"{len(results.left_out)} of the cells that were asked for"
        left_out = f"<h2>Not measured</h2><details><summary>{count}</summary><ul>{rows}</ul></details>"
    sentences = paragraphs(said(results, repeated))
    tables = (
        f"<h2>Candela against the others</h2><p>Speed-up: at equal error, the least that both reach. Error ratio: the "
        f"other's error over Candela's at equal time. More than 1 is in favour of Candela. With > or <, the fastest "
        f"picture of one has less error than the best of the other.</p>{sentences}"
        f"{as_html(summary(results))}<h2>What is left, and where</h2>{as_html(faults(results))}"
    )
    page = folder / "index.html"
    page.write_text(
        PAGE.substitute(
            facts=html.escape(facts(results)), reserve=paragraphs(reserve(results)), reading=html.escape(READING),
            overview=image(folder / "overview.png"),
            tables=tables, scenes="".join(scenes), growth=growth, left_out=left_out,
        ),
        encoding="utf-8",
    )  # fmt: skip
    return page


def generated_part(results: Results, grown: list[dict], profiled: list[dict], repeated: list[dict]) -> str:
    """The part of docs/performance.md that this command writes."""
    ratios = (
        "Speed-up: at equal error, the least that both reach, the other's time over Candela's. Error ratio: at equal "
        "time, the other's error over Candela's. More than 1 is in favour of Candela. With > or <, the fastest picture "
        "of one has less error than the best of the other."
    )
    rest = (
        f"Candela's own error against the reference: at {MIDDLE} samples, at the most samples, and the light path that "
        "adds most to it."
    )
    picture = "![Time against error of every scene](images/bench.png)"
    parts = [
        facts(results),
        *reserve(results),
        picture,
        READING,
        *said(results, repeated),
        ratios,
        markdown.table(summary(results)),
        rest,
    ]
    parts.append(markdown.table(faults(results)))
    if profiled:
        parts += ["### Where a render's time goes", PROFILE, markdown.table(profile.table(profiled))]
    if grown:
        parts += ["### Growth of cost", GROWTH, markdown.table(growth_of_cost.table(grown))]
    return "\n\n".join(parts)


def readme_part(results: Results) -> str:
    """The part of the README: the picture, and the means of the table."""
    means = summary(results)[-1]
    rows = [("geometric mean over the scenes", "time for equal error", "error in equal time")]
    for number, peer in sorted(enumerate(PEERS), key=lambda one: "denoised" not in one[1]):  # like with like first
        if any(results.curve(scene, peer) for scene in results.scenes):
            rows.append((f"{peer}, over Candela", means[1 + 2 * number], means[2 + 2 * number]))
    picture = "![Time against error of every sample scene](docs/images/bench.png)"
    more = (
        f"More than 1 is in favour of Candela; of fewer than {FEWEST_SCENES} scenes no mean is given. "
        "[docs/performance.md](docs/performance.md) has every scene."
    )
    return "\n\n".join([facts(results), *reserve(results), picture, markdown.table(rows), more])


# ------------------------------------------------------------------------------------------------------------- command


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--results", default=RESULTS, type=Path, metavar="PATH")
    parser.add_argument("--output", default=OUT / "page", type=Path, metavar="FOLDER")
    parser.add_argument("--no-docs", action="store_true", help="leave README.md, docs/performance.md and the picture")


def rows_beside(path: Path, name: str) -> list[dict]:
    """Rows of another results file in the same folder; none where it is not there."""
    beside = path.with_name(name)
    return json.loads(beside.read_text(encoding="utf-8"))["rows"] if beside.exists() else []


def repeated_rows(path: Path, about: dict) -> list[dict]:
    """Rows of again.json, if it repeats this very run; a sentence on the terminal if it repeats another."""
    beside = path.with_name("again.json")
    if not beside.exists():
        return []
    data = json.loads(beside.read_text(encoding="utf-8"))
    if data.get("run") is None or data.get("run") != about.get("run"):
        print(
            f"{beside.name} repeats another run than {path.name} and is left out; `python -m bench again` repeats it."
        )
        return []
    return data["rows"]


def command(options: argparse.Namespace) -> int:
    results = load(options.results)
    beside = [rows_beside(options.results, f"{name}.json") for name in ("growth", "profile")]
    beside.append(repeated_rows(options.results, results.about))
    page = make_page(results, *beside, options.output)
    print(page)
    if not options.no_docs:
        plots.overview(results, PICTURE)
        made = ages.stamp(results.about["date"][:10], results.about.get("commit", ""))
        markdown.put_between(PERFORMANCE, COMMAND, generated_part(results, *beside), made=made)
        markdown.put_between(README, COMMAND, readme_part(results), made=made)
        print(f"{PERFORMANCE}\n{README}")
    return 0
