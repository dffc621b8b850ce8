"""Fog, smoke and volume caustics beside Cycles and EEVEE: `python -m bench media`.

Scenes are those of media_scenes.py. The reference is the mean of two renders by Cycles with as many bounces as Candela
has; errors (relMSE) have its noise taken off. EEVEE's and Cycles' own pictures of few samples stand in the same table,
those of Cycles denoised. Seconds are of a second render, with another seed, so that nothing is compiled in them.
With `--shafts`, volume caustics instead (shafts.py); with `--motion`, a spot in fog that moves 2 cm a frame, one sample
each, against more samples of each frame: error of a frame, and what is new in it (moving.py).
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

from bench import markdown
from bench.moving import new_in_it, of_frame, scale_of, shifted
from bench.quick import size_of, table

HEAD = ("scene", "engine", "samples", "seconds", "relMSE", "bias", "volume direct", "bias", "volume indirect", "bias")
SEED = 5
PAGE = Path(__file__).resolve().parent.parent / "docs" / "media.md"
COMMAND = "python -m bench media --page"
MOTION = "python -m bench media --motion 24 --page"
STEP, TRUTH_SAMPLES = 0.02, 32  # metres a frame; of the truth of each frame


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--scenes", nargs="+", default=None, metavar="NAME", help="default: those without casters")
    parser.add_argument("--size", type=size_of, default=(64, 64), metavar="WxH", help="default 64x64")
    parser.add_argument("--reference", type=int, default=1024, metavar="N", help="samples of each of two references")
    parser.add_argument("--bounces", type=int, default=4, metavar="N", help="default 4")
    parser.add_argument("--no-eevee", action="store_true", help="leave EEVEE out")
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="write PNGs of each scene beside Cycles")
    parser.add_argument("--page", action="store_true", help="write the tables into docs/media.md, scene by scene")
    parser.add_argument("--motion", type=int, default=0, metavar="FRAMES", help="frames of a moving lamp instead")
    parser.add_argument("--shafts", action="store_true", help="volume caustics beside light tracing instead")
    parser.add_argument("--costs", action="store_true", help="with --shafts: their times, too")


def command(options: argparse.Namespace) -> int:
    if options.costs and not options.shafts:
        print("--costs is about --shafts: give both.", file=sys.stderr)
        return 2
    import bpy

    import addon
    from bench import media_scenes

    addon.register()
    if options.motion or options.shafts:
        from bench import shafts

        mark = MOTION if options.motion else shafts.COMMAND
        text = motion(options.motion) if options.motion else shafts.page(options.pictures, options.costs)
        print(text)
        if options.page:
            markdown.put_between(PAGE, mark, text)
        return 0
    scenes = media_scenes.MEDIA | media_scenes.CAUSTICS
    for name in options.scenes or media_scenes.MEDIA:
        media_scenes.begin()
        scenes[name]()
        added = measured(bpy.context.scene, name, options)
        print(table([HEAD, *added]), flush=True)
        if options.page:  # after each scene: what is measured stays when the run is ended
            markdown.put_between(PAGE, COMMAND, page(kept(PAGE.read_text(encoding="utf-8"), added), options))
    return 0


def measured(scene, name: str, options) -> list[tuple[str, ...]]:
    """Rows of the table for the open scene."""
    from addon.compare.metrics import compare_radiance
    from addon.compare.reference import render_passes

    def render(engine: str, samples: int, seed: int, denoised: bool = False):
        bounces = None if "EEVEE" in engine else options.bounces
        if denoised:
            return _denoised(scene, samples, seed, options)
        return render_passes(scene, engine, samples, seed, size=options.size, bounces=bounces)

    first, second = (render("CYCLES", options.reference, seed).images for seed in (1, 2))
    mean = {key: (first[key] + second[key]) / 2 for key in first}
    half = {key: (first[key] - second[key]) / 2 for key in first}
    truth = mean["combined"][..., :3]
    noise = compare_radiance("combined", truth, truth, half["combined"][..., :3]).floor
    width, height = options.size
    scene_name = f"{name} ({width} x {height}, {options.reference}, {noise:.4f})"
    rows = []
    entrants = [("Candela", "CANDELA", 1, False), ("Candela", "CANDELA", 16, False)]
    entrants += [("Cycles", "CYCLES", 16, False)]
    entrants += [("Cycles denoised", "CYCLES", samples, True) for samples in (4, 16)]
    entrants += [] if options.no_eevee else [("EEVEE", "BLENDER_EEVEE", 16, False)]
    picture = None
    for label, engine, samples, denoised in entrants:
        if engine != "CYCLES":
            render(engine, 1 if "EEVEE" in engine else samples, SEED + 1)  # what compiles
        seen = render(engine, samples, SEED, denoised)
        if (engine, samples) == ("CANDELA", 16):
            picture = seen.images
        figures = [f"{seen.seconds:.2f}"]
        for path in ("combined", "volume_direct", "volume_indirect"):
            alone = engine == "BLENDER_EEVEE" or denoised
            figures += _figures(seen.images, mean, half, path) if path == "combined" or not alone else ("", "")
        rows.append((scene_name if not rows else "", label, str(samples), *figures))
    if options.pictures:
        _save(options.pictures / f"{name.replace(' ', '_')}.png", picture["combined"], mean["combined"])
    return rows


def _figures(seen: dict, mean: dict, half: dict, path: str) -> tuple[str, str]:
    from addon.compare.metrics import compare_radiance

    truth = mean.get(path)
    if truth is None or not truth[..., :3].any():
        return "", ""
    error = compare_radiance(path, seen[path][..., :3], truth[..., :3], half[path][..., :3])
    return f"{max(error.relmse - error.floor, 0.0):.4f}", f"{error.bias:.3f}"


def _denoised(scene, samples: int, seed: int, options):
    import time

    import bpy

    from addon.compare import reference

    class Seen:
        images: dict = {}
        seconds = 0.0

    before = reference.cycles_settings

    def settings(scene, samples, seed, bounces):
        kept = before(scene, samples, seed, bounces)
        return [(owner, key, True if key == "use_denoising" else value) for owner, key, value in kept]

    reference.cycles_settings = settings
    try:
        started = time.perf_counter()
        made = reference.render_passes(scene, "CYCLES", samples, seed, size=options.size, bounces=options.bounces)
        seen = Seen()
        seen.images, seen.seconds = made.images, time.perf_counter() - started
        return seen
    finally:
        reference.cycles_settings = before
        del bpy


def _save(path: Path, ours: np.ndarray, theirs: np.ndarray) -> None:
    from addon.compare.metrics import display
    from addon.compare.png import png

    path.parent.mkdir(parents=True, exist_ok=True)
    exposure = float(-np.log2(max(np.percentile(theirs[..., :3], 98), 1e-6)))
    both = np.concatenate([ours[..., :3], theirs[..., :3]], axis=1)
    shown = np.repeat(np.repeat(display(both, exposure), 4, axis=0), 4, axis=1)[::-1]
    path.write_bytes(png((np.clip(shown, 0, 1) * 255 + 0.5).astype(np.uint8)))


def motion(count: int, size: tuple[int, int] = (48, 48)) -> str:
    """The table of a lamp that moves in fog."""
    import bpy

    from addon.compare.reference import render_passes
    from bench import media_scenes

    media_scenes.begin()
    media_scenes.MEDIA["spot in fog"]()
    scene = bpy.context.scene
    lamps = [one for one in scene.objects if one.type == "LIGHT"]
    paths = "volume_direct", "volume_indirect", "combined"
    errors: dict[str, list[np.ndarray]] = {path: [] for path in paths}
    truths: dict[str, list[np.ndarray]] = {path: [] for path in paths}
    for _ in shifted(lamps, count, STEP):
        one, many = (
            render_passes(scene, "CANDELA", samples, 1, size=size, bounces=4).images for samples in (1, TRUTH_SAMPLES)
        )
        for path in paths:
            truths[path].append(many[path][..., :3].astype(np.float64))
            errors[path].append(one[path][..., :3] - truths[path][-1])
    rows = [["", "of a frame", "new in it", "of a frame, but the worst pixels", "new in it"]]
    for path in paths:
        scale, found = scale_of(truths[path]), np.array(errors[path])
        worst = (np.square(found) / scale).mean(axis=(0, 3))
        kept = worst <= np.quantile(worst, 0.99)
        row = [of_frame(found, scale), new_in_it(found, scale)]
        row += [of_frame(found[:, kept], scale[kept]), new_in_it(found[:, kept], scale[kept])]
        rows.append([path.replace("_", " "), *(f"{value:.4f}" for value in row)])
    return (
        f"A spot in fog that moves {100 * STEP:.0f} cm a frame, {count} frames of {size[0]} x {size[1]} pixels, one"
        f" sample each, against {TRUTH_SAMPLES} samples of each; relMSE, of all pixels and without the worst hundredth."
        f"\n\n{markdown.table(rows)}"
    )


def kept(document: str, added: list[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """Rows of the document's table with those of one scene put in their place, or after the others."""
    part = document.partition(markdown.begin(COMMAND))[2].partition(markdown.END)[0]
    lines = [line for line in part.splitlines() if line.startswith("| ")][1:]
    scenes: dict[str, list[tuple[str, ...]]] = {}
    for line in lines:
        row = tuple(cell.strip() for cell in line.strip("|").split("|"))
        name = row[0].partition(" (")[0] or list(scenes)[-1]
        scenes.setdefault(name, []).append(row)
    scenes[added[0][0].partition(" (")[0]] = added
    return [row for rows in scenes.values() for row in rows]


def page(rows: list[tuple[str, ...]], options) -> str:
    """The table, and what it is of."""
    text = f"""{options.bounces} bounces in all engines but EEVEE, against the mean of two renders by Cycles. Behind
the scene's name: pixels, samples of each of the two, and the relMSE of their mean by its own noise, which is taken off
the errors; what is below it says little. Candela and EEVEE draw on a software GPU. EEVEE has no such bounces: its bias
is partly that.

"""
    return text + markdown.table([HEAD, *rows])
