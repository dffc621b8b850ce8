"""Error and time of reflections and refractions beside Cycles and EEVEE: `python -m bench reflections`.

Each scene of `bench/reflection_scenes.py` is rendered by Cycles with --reference samples (twice, with two seeds, whose
difference tells the reference's own noise), by Candela with 1, 16 and 64 samples, by Candela with mean colours in
reflections, by EEVEE with ray tracing and by Cycles with few samples, raw and denoised. The error is relMSE of the
picture and of what its glossy and transmission passes bring, net of the reference's noise; the mean is the entrant's
over the reference's. Times are those of whole renders after one that compiled, one after the other on the same machine:
on a software GPU they say little about a real one.

`--page` writes docs/reflections.md's tables, of the scenes that `--only` names or of all; `--pictures FOLDER` keeps PNG
files.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from . import ages, markdown

PAGE = Path(__file__).resolve().parent.parent / "docs" / "reflections.md"
COMMAND = "python -m bench reflections --page"
FEW_COMMAND = "python -m bench reflections --few --page"
FEW_HEAD = [
    "scene", "1 sample", "4", "16", "mean, 16", "isolated bright", "its seconds, 1, 4, 16", "Cycles 16 denoised",
    "its seconds", "least error in its time",
]  # fmt: skip
SIZE, SMALL = (96, 64), (64, 48)
PATHS = ("glossy", "transmission")  # that a scene is measured by, unless it names others


@dataclass(frozen=True)
class Entrant:
    """An engine with its settings. `means`: Candela shows mean colours in reflections."""

    label: str
    engine: str
    samples: int
    denoised: bool = False
    means: bool = False


ENTRANTS = (
    Entrant("Candela, 1", "CANDELA", 1),
    Entrant("Candela, 4", "CANDELA", 4),
    Entrant("Candela, 16", "CANDELA", 16),
    Entrant("Candela, 64", "CANDELA", 64),
    Entrant("Candela, 64, means", "CANDELA", 64, means=True),
    Entrant("EEVEE, 16, ray traced", "BLENDER_EEVEE", 16),
    Entrant("Cycles, 4", "CYCLES", 4),
    Entrant("Cycles, 4, denoised", "CYCLES", 4, denoised=True),
    Entrant("Cycles, 16", "CYCLES", 16),
    Entrant("Cycles, 16, denoised", "CYCLES", 16, denoised=True),
)
FEW = tuple(one for one in ENTRANTS if one.label in ("Candela, 1", "Candela, 4", "Candela, 16", "Cycles, 16, denoised"))


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--only", nargs="+", help="names of scenes")
    parser.add_argument("--reference", type=int, default=1024, help="samples of each of Cycles' two references")
    parser.add_argument("--few", action="store_true", help="pictures of few samples at equal time, one row a scene")
    parser.add_argument("--page", action="store_true", help="write docs/reflections.md's tables")
    parser.add_argument("--pictures", type=Path, help="folder for PNG files")


@dataclass(frozen=True)
class Result:
    """What an entrant made of a scene: relMSE net of the reference's noise and mean, by path, and seconds."""

    seconds: float
    errors: dict[str, float]
    means: dict[str, float]


def command(options: argparse.Namespace) -> int:
    import addon

    from . import glass_scenes, reflection_scenes

    addon.register()
    if options.few:
        return _few(options)
    order = [*reflection_scenes.SCENES, *glass_scenes.SCENES]
    for name in options.only or order:
        noise, results = _measure(reflection_scenes.make(name), name, options)
        table, row = _table(noise, results), _summary(name, results)
        print(f"### {name}", table, markdown.table([SUMMARY_HEAD, row]), sep="\n\n", flush=True)
        if options.page:
            _put(name, row, table, order)
    return 0


def _few(options: argparse.Namespace) -> int:
    """A row for each scene, at SMALL pixels: errors of whole pictures, means, isolated bright pixels and processor
    seconds, beside Cycles of 16 samples, denoised. `--page`: rows of scenes that were not asked for stay."""
    from . import bright, glass_scenes, reflection_scenes

    order = [*glass_scenes.SCENES, *reflection_scenes.SCENES]
    text = PAGE.read_text(encoding="utf-8").partition(markdown.begin(FEW_COMMAND))[2].partition(markdown.END)[0]
    rows = {cells[0]: cells for cells in map(_cells, text.splitlines()) if cells and cells[0] in order}
    for name in options.only or order:
        scene = reflection_scenes.make(name)
        references = [_render(scene, Entrant("", "CYCLES", options.reference), seed, SMALL)[0] for seed in (0, 1)]
        first, second = (one["picture"] for one in references)
        truth, noise = (first + second) / 2, error(first, second) / 4
        _keep(options.pictures, name, "truth", truth)
        _render(scene, FEW[0], 3, SMALL)  # what compiles is not timed
        found = {one: _render(scene, one, 7, SMALL) for one in FEW}
        errors = {one: max(error(images["picture"], truth) - noise, 0.0) for one, (images, _) in found.items()}
        for one, (images, _) in found.items():
            _keep(options.pictures, name, one.label, images["picture"])
        *ours, cycles = FEW
        picture, limit = found[ours[-1]][0]["picture"], found[cycles][1]
        light = bright.luminance(picture)
        alone = bright.isolated(light) & bright.brighter(light, bright.around(bright.luminance(truth), whole=True))
        least = min(((errors[one], one.samples) for one in ours if found[one][1] <= limit), default=None)
        rows[name] = [
            name, *(f"{errors[one]:.4f}" for one in ours),
            f"{picture.mean() / truth.mean():.3f}", str(int(alone.sum())),
            ", ".join(f"{found[one][1]:.1f}" for one in ours), f"{errors[cycles]:.4f}", f"{limit:.1f}",
            "none as fast" if least is None else "{:.4f} ({})".format(*least),
        ]  # fmt: skip
        print("  ".join(rows[name]), flush=True)
        if options.page:
            shown = [rows[one] for one in order if one in rows]
            markdown.put_between(PAGE, FEW_COMMAND, markdown.table([FEW_HEAD, *shown]))
    return 0


def _put(name: str, row: list[str], table: str, order: list[str]) -> None:
    """Write a scene's row and table to the page; those of other scenes stay, each with when it was made."""
    text = PAGE.read_text(encoding="utf-8").partition(markdown.begin(COMMAND))[2].partition(markdown.END)[0]
    head, *sections = text.split("\n### ")
    rows = {cells[0]: cells for cells in map(_cells, head.splitlines()) if cells and cells[0] in order}
    tables = {section.partition("\n")[0].lower(): section.partition("\n")[2].strip() for section in sections}
    made = ages.now()
    rows[name], tables[name.lower()] = row, f"{made}\n\n{table}"
    shown = [one for one in order if one in rows]
    parts = [markdown.table([SUMMARY_HEAD, *(rows[one] for one in shown)])]
    parts += [f"### {one[:1].upper()}{one[1:]}\n\n{tables[one]}" for one in shown]
    markdown.put_between(PAGE, COMMAND, "\n\n".join(parts), stamped=False)


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip().strip("|").split("|")] if line.startswith("|") else []


def _measure(scene, name: str, options: argparse.Namespace) -> tuple[dict[str, float], dict[Entrant, Result]]:
    """The reference's noise by path, and what each entrant made."""
    references = [_render(scene, Entrant("", "CYCLES", options.reference), seed)[0] for seed in (0, 1)]
    truth = {key: (references[0][key] + references[1][key]) / 2 for key in references[0]}
    shown = [key for key in truth if truth[key].mean() > 1e-3]
    noise = {key: error(*(one[key] for one in references)) / 4 for key in shown}
    _keep(options.pictures, name, "Cycles", truth["picture"])
    results, compiled = {}, set()
    for entrant in ENTRANTS:
        if (entrant.engine, entrant.means) not in compiled:
            _render(scene, replace(entrant, samples=1), 3)  # what compiles is not timed
            compiled.add((entrant.engine, entrant.means))
        found, seconds = _render(scene, entrant, 7)
        there = [key for key in shown if key in found]
        results[entrant] = Result(
            seconds,
            {key: max(error(found[key], truth[key]) - noise[key], 0.0) for key in there},
            {key: float(found[key].mean() / truth[key].mean()) for key in there},
        )
        _keep(options.pictures, name, entrant.label, found["picture"])
    return noise, results


def _table(noise: dict[str, float], results: dict[Entrant, Result]) -> str:
    rows = [["", "seconds", *(title for key in noise for title in (f"{key}: relMSE", "mean"))]]
    rows.append(["reference's noise", "", *(text for key in noise for text in (f"{noise[key]:.4f}", ""))])
    for entrant, one in results.items():
        cells = []
        for key in noise:
            cells += [f"{one.errors[key]:.4f}", f"{one.means[key]:.3f}"] if key in one.errors else ["–", "–"]
        rows.append([entrant.label, f"{one.seconds:.1f}", *cells])
    return markdown.table(rows)


SUMMARY_HEAD = [
    "scene",
    "picture, 1 sample",
    "picture, 64",
    "worst path, 64",
    "mean of it",
    "EEVEE",
    "least error in EEVEE's time / 10",
    "Cycles 16 denoised",
    "least error in its time",
]


def _summary(name: str, results: dict[Entrant, Result]) -> list[str]:
    """The aims in one row: errors at 1 and 64 samples, and the least error in the time of others."""
    by_label = {entrant.label: one for entrant, one in results.items()}
    at_most = by_label["Candela, 64"]
    worst = max((key for key in at_most.errors if key != "picture"), key=at_most.errors.get, default="picture")
    eevee, denoised = by_label["EEVEE, 16, ray traced"], by_label["Cycles, 16, denoised"]

    def least(seconds: float) -> str:
        candela = [(one.errors["picture"], entrant.samples) for entrant, one in results.items()
                   if entrant.engine == "CANDELA" and not entrant.means and one.seconds <= seconds]  # fmt: skip
        return "{:.4f} ({} samples)".format(*min(candela)) if candela else "none as fast"

    return [
        name,
        f"{by_label['Candela, 1'].errors['picture']:.4f}",
        f"{at_most.errors['picture']:.4f}",
        f"{at_most.errors[worst]:.4f} ({worst})",
        f"{at_most.means[worst]:.3f}",
        f"{eevee.errors['picture']:.4f} in {eevee.seconds:.1f} s",
        least(eevee.seconds / 10),
        f"{denoised.errors['picture']:.4f} in {denoised.seconds:.1f} s",
        least(denoised.seconds),
    ]


def error(found: np.ndarray, truth: np.ndarray) -> float:
    """relMSE, all pixels counted."""
    from addon.compare.metrics import relative_squared_error

    return float(relative_squared_error(found.astype(np.float64), truth.astype(np.float64)).mean())


def _render(scene, entrant: Entrant, seed: int, size: tuple[int, int] = SIZE) -> tuple[dict[str, np.ndarray], float]:
    """The picture and what its paths bring, (H, W, 3), and seconds of the render: of SMALL ones of the processors."""
    from addon.compare.reference import render_passes

    settings = scene.candela
    settings.property_unset("shaded_reflections_bounces")
    if entrant.means:
        settings.shaded_reflections_bounces = 0
    scene.eevee.use_raytracing = True
    extra = [(scene.cycles, "use_denoising", True)] if entrant.denoised else []
    if "glossy_bounces" in scene:
        extra.append((scene.cycles, "glossy_bounces", scene["glossy_bounces"]))
    clock = time.process_time if size == SMALL else time.perf_counter
    start = clock()
    images = render_passes(scene, entrant.engine, entrant.samples, seed, size=size, extra=extra).images
    seconds = clock() - start
    found = {"picture": images["combined"][..., :3]}
    for path in str(scene.get("paths", ",".join(PATHS))).split(","):
        kind, _, order = path.partition(" ")
        parts = [images.get(f"{kind}_{one}") for one in ([order] if order else ["direct", "indirect"])]
        color = images.get(f"{kind}_color")
        comparable = entrant.engine != "BLENDER_EEVEE" and not entrant.denoised  # only Combined is denoised
        if comparable and color is not None and all(part is not None for part in parts):
            found[path] = sum(parts)[..., :3] * color[..., :3]
    return found, seconds


def _keep(folder: Path | None, name: str, label: str, pixels: np.ndarray) -> None:
    if folder is None:
        return
    from addon.compare.metrics import display
    from addon.compare.png import png

    folder.mkdir(parents=True, exist_ok=True)
    shown = (np.clip(display(pixels), 0, 1)[::-1] * 255 + 0.5).astype(np.uint8)
    (folder / f"{name} {label}.png".replace(" ", "_").replace(",", "")).write_bytes(png(shown))
