"""Whether the light of a picture depends on its number of samples: `python -m bench bias`.

A sample more makes a picture calmer, and must not make it brighter. Of each scene and each light path that carries at
least LEAST of the light: the mean of the picture over that of Cycles by number of samples, mean over seeds with its
standard error. The standard error of the reference's own mean, known from its two renders, stands beside. Pictures of
many samples need fewer seeds: as many as have `--seeds` times FULL samples in all, at least FEWEST. `--page` writes the
table on docs/flicker.md; rows of other scenes stay.
"""

from __future__ import annotations

import argparse

import numpy as np

from bench import ages
from bench.bright import luminance
from bench.cells import ROOT
from bench.flicker import bias_of, opened
from bench.markdown import put_between, rows_of, table
from bench.quick import size_of

COMMAND = "python -m bench bias --page"
PAGE = ROOT / "docs" / "flicker.md"
SCENES = ("window_interior", "cornell_box", "hdri_product", "colonnade_hall", "meadow", "soft_shadow_garden")
SAMPLES = (1, 2, 4, 16)
SIZE = (96, 72)
LEAST = 0.01  # of the picture's light
FULL, FEWEST = 4, 3
HEAD = ("scene", "light path", "share", "noise of the truth", *map(str, SAMPLES), "commit")


def seeds_of(samples: int, seeds: int) -> int:
    return min(seeds, max(FEWEST, seeds * FULL // samples))


def lights(combined: np.ndarray, paths: dict[str, np.ndarray]) -> dict[str, float]:
    """Mean luminance of the picture ("combined") and of each light path. All (H, W, 3 or more)."""
    images = {"combined": combined, **paths}
    return {name: float(luminance(image).mean()) for name, image in images.items() if name != "direct_light"}


def rows_of_scene(
    name: str, found: dict[int, list[dict[str, float]]], truth: dict[str, float], noise: dict[str, float]
):
    """Table rows, without the commit. `found`: by number of samples the means by light path of each seed."""
    for path, light in truth.items():
        if light >= LEAST * truth["combined"]:
            ratios = [bias_of([one.get(path, 0.0) / light for one in found[n]]) if n in found else "" for n in SAMPLES]
            share = f"{light / truth['combined']:.2f}"
            yield [name, path.replace("_", " "), share, f"{abs(noise.get(path, 0.0)) / light:.3f}", *ratios]


# ------------------------------------------------------------------------------------------------------------- command


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--scenes", nargs="+", default=list(SCENES), help="samples, or .blend files")
    parser.add_argument("--samples", nargs="+", type=int, default=list(SAMPLES), choices=SAMPLES)
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--reference", type=int, default=512, help="samples of each of two renders by Cycles")
    parser.add_argument("--size", type=size_of, default=SIZE, metavar="WxH")
    parser.add_argument("--page", action="store_true", help=f"write the table into docs/{PAGE.name}")


def command(options: argparse.Namespace) -> int:
    import bpy

    import addon
    from addon.compare.passes import light_paths
    from addon.compare.reference import reference, render_passes

    if options.page and (set(options.samples), options.size) != (set(SAMPLES), SIZE):
        raise ValueError(f"Rows of {PAGE.name} are of {SAMPLES} samples and {SIZE} pixels: leave --page out.")
    addon.register()
    rows: list[list[str]] = []
    for scene in options.scenes:
        shown_as, opened_scene = opened(scene), bpy.context.scene
        kept = reference(opened_scene, options.reference, size=options.size)
        truth, noise = (
            lights(images["combined"], paths) for images, paths in zip((kept.images, kept.half), kept.paths())
        )
        found = {}
        for samples in options.samples:
            seeds = range(1, 1 + seeds_of(samples, options.seeds))
            made = (render_passes(opened_scene, "CANDELA", samples, seed, size=options.size) for seed in seeds)
            found[samples] = [lights(one.images["combined"], light_paths(one.images)) for one in made]
        rows += ([*row, ages.commit()] for row in rows_of_scene(shown_as, found, truth, noise))
        print(table([HEAD, *(row for row in rows if row[0] == shown_as)]), flush=True)
        if options.page:
            measured = {row[0] for row in rows}
            kept_rows = [
                row for row in rows_of(PAGE.read_text(encoding="utf-8"), COMMAND, HEAD) if row[0] not in measured
            ]
            put_between(PAGE, COMMAND, table([HEAD, *kept_rows, *rows]))
    return 0
