"""Error and time of reflections and refractions beside Cycles and EEVEE: `python -m bench reflections`.

Each scene of `bench/reflection_scenes.py` and `bench/glass_scenes.py` is rendered by Cycles with --reference samples
or more (twice, with two seeds, whose difference tells the reference's own noise; bench/reflection_truth.py), by Candela
with 1 to 64 samples, by EEVEE with ray tracing and by Cycles with few samples, raw and denoised. The error is relMSE of
the picture and of what its glossy and transmission passes bring, net of the reference's noise; the mean is the
entrant's over the reference's. Times are processor seconds of whole renders after one that compiled: on a software GPU
they say little about a real one.

`--few`: a row for each scene, whole pictures of 1, 4 and 16 samples, errors no less than a tenth of the reference's
noise, below which they are not known, and with what light carries the error of the last.
That is the share of light paths in the squared error of their sum, each pixel weighed as in relMSE: the mean of a
path's error times the whole error, over that of the whole error's square. Shares add up to one; one is negative where
its errors hide others'. A second table has the errors beside those of denoised Cycles in as many processor seconds,
where Cycles' own picture is a truth. `--size` other than 64x48: the second table alone.

`--page` writes docs/reflections.md's tables; rows of scenes that `--only` does not name stay. `--pictures FOLDER` keeps
PNG files.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from . import ages, equal_time, markdown, reflection_truth
from .figures import RESOLVED
from .study import size, size_of

PAGE = Path(__file__).resolve().parent.parent / "docs" / "reflections.md"
COMMAND = "python -m bench reflections --page"
SMALL = "64x48"
NOISE, NO_TRUTH = "noise of the truth", 0.02  # above it Cycles has not found the light, and nothing is compared in time
FEW_HEAD = [
    "scene", "1 sample", "4", "16", "mean, 16", NOISE, "carries the error, 16", "mean of that",
    "isolated bright", "its seconds, 1, 4, 16", "Cycles 16 denoised", "its seconds",
    "commit",
]  # fmt: skip
SAMPLES = (1, 4, 16)  # of `--few`
PATHS = ("glossy", "transmission")  # that a scene is measured by, unless it names others


@dataclass(frozen=True)
class Entrant:
    """An engine with its settings."""

    label: str
    engine: str
    samples: int
    denoised: bool = False


ENTRANTS = (
    Entrant("Candela, 1", "CANDELA", 1),
    Entrant("Candela, 4", "CANDELA", 4),
    Entrant("Candela, 16", "CANDELA", 16),
    Entrant("Candela, 64", "CANDELA", 64),
    Entrant("EEVEE, 16, ray traced", "BLENDER_EEVEE", 16),
    Entrant("Cycles, 4", "CYCLES", 4),
    Entrant("Cycles, 4, denoised", "CYCLES", 4, denoised=True),
    Entrant("Cycles, 16", "CYCLES", 16),
    Entrant("Cycles, 16, denoised", "CYCLES", 16, denoised=True),
)
DENOISED = (1, 4, 16, 64)  # samples of Cycles, from whose pictures errors in equal time are read
FEW = (
    *(one for one in ENTRANTS if one.engine == "CANDELA" and one.samples in SAMPLES),
    *(Entrant(f"Cycles, {n}, denoised", "CYCLES", n, denoised=True) for n in DENOISED),
)


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--only", nargs="+", help="names of scenes")
    parser.add_argument("--reference", type=int, default=1024, help="samples of each of Cycles' two references")
    parser.add_argument("--few", action="store_true", help="pictures of few samples, one row a scene")
    parser.add_argument("--size", **size(SMALL))
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
    order = [*reflection_scenes.SCENES, *glass_scenes.SCENES]
    if options.few:
        _few(order, options)
        return 0
    for name in options.only or order:
        noise, results = _measure(name, options)
        table, row = _table(noise, results), _summary(name, results)
        print(f"### {name}", table, markdown.table([SUMMARY_HEAD, row]), sep="\n\n", flush=True)
        if options.page:
            _put(name, row, table, order)
    return 0


def few_command(options: argparse.Namespace) -> str:
    """What writes the tables of `--few` of pictures of this size beside references of so many samples."""
    width, height = options.size
    sized = "" if options.size == size_of(SMALL) else f" --size {width}x{height}"
    return f"python -m bench reflections --few{sized} --reference {options.reference} --page"


def _few(order: list[str], options: argparse.Namespace) -> None:
    """Both tables of `--few`. On the page the rows of scenes that were not asked for stay."""
    page, command, small = PAGE.read_text(encoding="utf-8"), few_command(options), options.size == size_of(SMALL)
    if options.page and markdown.begin(command) not in page:
        raise ValueError(
            f"{PAGE.name} has no tables of `{command}`, so pictures of that size or reference have no place there."
        )
    rows, equal = (
        {one[0]: one for one in markdown.rows_of(page, command, head)} for head in (FEW_HEAD, equal_time.head(SAMPLES))
    )
    for name in options.only or order:
        rows[name], points = _few_of(name, options)
        print("  ".join(rows[name]), flush=True)
        equal.pop(name, None)
        if float(rows[name][FEW_HEAD.index(NOISE)]) <= NO_TRUTH:
            equal[name] = equal_time.row(name, points)
            print("  ".join(equal[name]), flush=True)
        shown, beside = ([found[one] for one in order if one in found] for found in (rows, equal))
        text = equal_time.table(beside, SAMPLES)
        text = f"{markdown.table([FEW_HEAD, *shown])}\n\n{text}" if small else text
        if options.page:
            markdown.put_between(PAGE, command, text)
    print(text)


def _few_of(name: str, options: argparse.Namespace) -> tuple[list[str], equal_time.Points]:
    """Errors of whole pictures, means, the light path that carries the error of the last one, isolated bright pixels
    and processor seconds, beside Cycles of 16 samples, denoised; and the points of all entrants."""
    import bpy

    from . import bright

    known = reflection_truth.reference(name, options.reference, options.size)
    scene = bpy.context.scene
    truth, noise = known.images["combined"][..., :3], _noise(known.images["combined"], known.half["combined"])
    _keep(options.pictures, name, "truth", truth)
    for count in (1, 4):
        _render(scene, replace(FEW[0], samples=count), 3, options.size)  # what compiles is not timed
    found = {one: _render(scene, one, 7, options.size) for one in FEW}
    pictures = {one: images["combined"][..., :3] for one, (images, _) in found.items()}
    errors = {one: max(error(picture, truth) - noise, RESOLVED * noise) for one, picture in pictures.items()}
    for one, picture in pictures.items():
        _keep(options.pictures, name, one.label, picture)
    ours = [one for one in FEW if one.engine == "CANDELA"]
    last, cycles = ours[-1], next(one for one in FEW if one.engine == "CYCLES" and one.samples == 16)
    alone = bright.wrong(*(bright.luminance(one) for one in (pictures[last], truth)))
    path, share, mean = carrier(found[last][0], known.images)
    return [
        name, *(f"{errors[one]:.4f}" for one in ours), f"{pictures[last].mean() / truth.mean():.3f}", f"{noise:.4f}",
        f"{path} ({share:.2f})", f"{mean:.3f}", str(int(alone.sum())),
        ", ".join(f"{found[one][1]:.1f}" for one in ours), f"{errors[cycles]:.4f}", f"{found[cycles][1]:.1f}",
        ages.commit(),
    ], [(one.engine, seconds, errors[one]) for one, (_, seconds) in found.items()]  # fmt: skip


def carrier(found: dict[str, np.ndarray], truth: dict[str, np.ndarray]) -> tuple[str, float, float]:
    """The light path with the largest share in the squared error of the sum of all, that share, and the ratio of its
    means. Passes by Candela's names, (H, W, C)."""
    from addon.compare.metrics import relative_squared_error
    from addon.compare.passes import light_paths

    paths = [{k: v.astype(np.float64) for k, v in light_paths(one).items()} for one in (found, truth)]
    names = [name for name in paths[0] if name in paths[1] and name != "direct_light"]
    errors = {name: paths[0][name] - paths[1][name] for name in names}
    whole, right = sum(errors.values()), sum(paths[1][name] for name in names)
    # The weight of a pixel in relMSE is what a squared error of one would add there.
    weight = relative_squared_error(right + 1.0, right)[..., None]
    square = float((weight * whole**2).sum())
    shares = {name: float((weight * one * whole).sum()) / max(square, 1e-30) for name, one in errors.items()}
    path = max(shares, key=shares.get)
    return path.replace("_", " "), shares[path], float(paths[0][path].mean() / max(paths[1][path].mean(), 1e-30))


def _put(name: str, row: list[str], table: str, order: list[str]) -> None:
    """Write a scene's row and table to the page; those of other scenes stay, each with when it was made."""
    page = PAGE.read_text(encoding="utf-8")
    _, *sections = page.partition(markdown.begin(COMMAND))[2].partition(markdown.END)[0].split("\n### ")
    rows = {cells[0]: cells for cells in markdown.rows_of(page, COMMAND, SUMMARY_HEAD)}
    tables = {section.partition("\n")[0].lower(): section.partition("\n")[2].strip() for section in sections}
    made = ages.now()
    rows[name], tables[name.lower()] = row, f"{made}\n\n{table}"
    shown = [one for one in order if one in rows]
    parts = [markdown.table([SUMMARY_HEAD, *(rows[one] for one in shown)])]
    parts += [f"### {one[:1].upper()}{one[1:]}\n\n{tables[one]}" for one in shown]
    markdown.put_between(PAGE, COMMAND, "\n\n".join(parts), stamped=False)


def _noise(mean: np.ndarray, half: np.ndarray) -> float:
    """relMSE of the mean of two renders by half their difference, (H, W, C)."""
    return error((mean + half)[..., :3], (mean - half)[..., :3]) / 4


def _measure(name: str, options: argparse.Namespace) -> tuple[dict[str, float], dict[Entrant, Result]]:
    """The reference's noise by path, and what each entrant made."""
    import bpy

    known = reflection_truth.reference(name, options.reference, options.size)
    scene = bpy.context.scene
    signed = ({key: mean + sign * known.half[key] for key, mean in known.images.items()} for sign in (1, -1))
    references = [_shown(scene, one) for one in signed]
    truth = {key: (references[0][key] + references[1][key]) / 2 for key in references[0]}
    shown = [key for key in truth if truth[key].mean() > 1e-3]
    noise = {key: error(*(one[key] for one in references)) / 4 for key in shown}
    _keep(options.pictures, name, "Cycles", truth["picture"])
    results, compiled = {}, set()
    for entrant in ENTRANTS:
        if entrant.engine not in compiled:
            _render(scene, replace(entrant, samples=1), 3, options.size)  # what compiles is not timed
            compiled.add(entrant.engine)
        images, seconds = _render(scene, entrant, 7, options.size)
        comparable = entrant.engine != "BLENDER_EEVEE" and not entrant.denoised  # only Combined is denoised
        found = _shown(scene, images if comparable else {"combined": images["combined"]})
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
                   if entrant.engine == "CANDELA" and one.seconds <= seconds]  # fmt: skip
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


def _render(scene, entrant: Entrant, seed: int, size: tuple[int, int], extra=()) -> tuple[dict[str, np.ndarray], float]:
    """Passes by Candela's names, (H, W, C), and processor seconds of the render."""
    from addon.compare.reference import render_passes

    scene.eevee.use_raytracing = True
    settings = [*reflection_truth.bounces(scene), *extra]
    settings += [(scene.cycles, "use_denoising", True)] if entrant.denoised else []
    start = time.process_time()
    images = render_passes(scene, entrant.engine, entrant.samples, seed, size=size, extra=settings).images
    return images, time.process_time() - start


def _shown(scene, images: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The picture and what the scene's paths bring, (H, W, 3), of those that there are."""
    found = {"picture": images["combined"][..., :3]}
    for path in str(scene.get("paths", ",".join(PATHS))).split(","):
        kind, _, order = path.partition(" ")
        parts = [images.get(f"{kind}_{one}") for one in ([order] if order else ["direct", "indirect"])]
        color = images.get(f"{kind}_color")
        if color is not None and all(part is not None for part in parts):
            found[path] = sum(parts)[..., :3] * color[..., :3]
    return found


def _keep(folder: Path | None, name: str, label: str, pixels: np.ndarray) -> None:
    if folder is None:
        return
    from addon.compare.metrics import display
    from addon.compare.png import png

    folder.mkdir(parents=True, exist_ok=True)
    shown = (np.clip(display(pixels), 0, 1)[::-1] * 255 + 0.5).astype(np.uint8)
    (folder / f"{name} {label}.png".replace(" ", "_").replace(",", "")).write_bytes(png(shown))
