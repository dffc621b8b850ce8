"""Fog, smoke and volume caustics beside Cycles and EEVEE: `python -m bench media`.

Scenes are those of media_scenes.py. The reference is the mean of two renders by Cycles with as many bounces as Candela
has; errors (relMSE) have its noise taken off. EEVEE's and Cycles' own pictures of few samples stand in the same table,
those of Cycles denoised. Seconds are of a second render, with another seed, so that nothing is compiled in them.
Caustics: the profile of light in the medium across the picture below (behind) the caster, averaged over rows, its root
mean squared difference over the reference's peak.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from bench import markdown
from bench.quick import size_of, table

HEAD = ("scene", "engine", "samples", "seconds", "relMSE", "bias", "volume direct", "bias", "volume indirect", "bias")
SEED = 5
PAGE = Path(__file__).resolve().parent.parent / "docs" / "media.md"
COMMAND = "python -m bench media --page"


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--scenes", nargs="+", default=None, metavar="NAME", help="default: all")
    parser.add_argument("--size", type=size_of, default=(64, 64), metavar="WxH", help="default 64x64")
    parser.add_argument("--reference", type=int, default=1024, metavar="N", help="samples of each of two references")
    parser.add_argument("--bounces", type=int, default=4, metavar="N", help="default 4")
    parser.add_argument("--no-eevee", action="store_true", help="leave EEVEE out")
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="write PNGs of each scene beside Cycles")
    parser.add_argument("--page", action="store_true", help="write the tables into docs/media.md, scene by scene")


def command(options: argparse.Namespace) -> int:
    import bpy

    import addon
    from bench import media_scenes

    addon.register()
    scenes = media_scenes.MEDIA | media_scenes.CAUSTICS
    rows: list[tuple[str, ...]] = []
    profiles: list[tuple[str, ...]] = []
    for name in options.scenes or scenes:
        media_scenes.begin()
        scenes[name]()
        added, profile = measured(bpy.context.scene, name, options, name in media_scenes.CAUSTICS)
        print(table([HEAD, *added]), flush=True)
        rows += added
        profiles += profile
        if profile:
            print(table([PROFILE_HEAD, *profile]), flush=True)
        if options.page:  # after each scene: what is measured stays when the run is ended
            markdown.put_between(PAGE, COMMAND, page(rows, profiles, options))
    return 0


PROFILE_HEAD = ("scene", "rays", "profile, % of peak", "energy", "seconds of beams")


def measured(scene, name: str, options, caustics: bool):
    """Rows of both tables for the open scene."""
    from addon.compare.reference import render_passes

    def render(engine: str, samples: int, seed: int, denoised: bool = False):
        bounces = None if "EEVEE" in engine else options.bounces
        if denoised:
            return _denoised(scene, samples, seed, options)
        return render_passes(scene, engine, samples, seed, size=options.size, bounces=bounces)

    first, second = (render("CYCLES", options.reference, seed).images for seed in (1, 2))
    mean = {key: (first[key] + second[key]) / 2 for key in first}
    half = {key: (first[key] - second[key]) / 2 for key in first}
    rows = []
    entrants = [("Candela", "CANDELA", 1, False), ("Candela", "CANDELA", 16, False)]
    entrants += [("Cycles", "CYCLES", 16, False)]
    entrants += [("Cycles denoised", "CYCLES", samples, True) for samples in (4, 16)]
    entrants += [] if options.no_eevee else [("EEVEE", "BLENDER_EEVEE", 16, False)]
    picture = None
    for label, engine, samples, denoised in entrants:
        if engine != "CYCLES":
            render(engine, samples, SEED + 1)  # what compiles
        seen = render(engine, samples, SEED, denoised)
        if (engine, samples) == ("CANDELA", 16):
            picture = seen.images
        figures = [f"{seen.seconds:.2f}"]
        for path in ("combined", "volume_direct", "volume_indirect"):
            alone = engine == "BLENDER_EEVEE" or denoised
            figures += _figures(seen.images, mean, half, path) if path == "combined" or not alone else ("", "")
        rows.append((name if not rows else "", label, str(samples), *figures))
    profiles = _profiles(scene, name, mean, options, render) if caustics else []
    if options.pictures:
        _save(options.pictures / f"{name.replace(' ', '_')}.png", picture["combined"], mean["combined"])
    return rows, profiles


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


def _profiles(scene, name: str, mean: dict, options, render) -> list[tuple[str, ...]]:
    from addon.frame import ledger

    def light(images: dict) -> np.ndarray:
        return (images["volume_direct"] + images["volume_indirect"])[..., :3].mean(axis=2)

    height = options.size[1]
    rows = slice(height // 8, height * 2 // 5)  # below the caster
    truth = light(mean)[rows].mean(axis=0)
    found = []
    for rays in (96, 192, 384):
        scene.candela.volume_caustics_rays = rays
        render("CANDELA", 16, SEED + 2)
        seen = light(render("CANDELA", 16, SEED).images)[rows].mean(axis=0)
        row = ledger.latest().row("volume_caustics")
        error = np.sqrt(((seen - truth) ** 2).mean()) / truth.max()
        found.append(
            (
                name,
                f"{rays}²",
                f"{100 * error:.1f}",
                f"{seen.mean() / truth.mean():.3f}",
                f"{row.milliseconds / 16e3:.4f}",
            )
        )
    scene.candela.property_unset("volume_caustics_rays")
    return found


def _save(path: Path, ours: np.ndarray, theirs: np.ndarray) -> None:
    from addon.compare.metrics import display
    from addon.compare.png import png

    path.parent.mkdir(parents=True, exist_ok=True)
    exposure = float(-np.log2(max(np.percentile(theirs[..., :3], 98), 1e-6)))
    both = np.concatenate([ours[..., :3], theirs[..., :3]], axis=1)
    shown = np.repeat(np.repeat(display(both, exposure), 4, axis=0), 4, axis=1)[::-1]
    path.write_bytes(png((np.clip(shown, 0, 1) * 255 + 0.5).astype(np.uint8)))


def page(rows: list[tuple[str, ...]], profiles: list[tuple[str, ...]], options) -> str:
    """Both tables, and what they are of."""
    width, height = options.size
    text = f"""Pictures of {width} x {height} pixels, {options.bounces} bounces in all engines but EEVEE, against two
renders of {options.reference} samples by Cycles, whose noise is taken off the errors (relMSE). Candela and EEVEE draw
on a software GPU. EEVEE has no such bounces: its bias is partly that.

"""
    text += markdown.table([HEAD, *rows])
    if profiles:
        text += "\n\n**Volume caustics**: profile of the light in the medium below the caster, 16 samples.\n\n"
        text += markdown.table([PROFILE_HEAD, *profiles])
    return text
