"""Direct light at 64 samples beside Cycles, by light path, on every sample scene: `python -m bench direct`.

Both engines render without bounces and are compared with the mean of two renders by Cycles. Their squared errors
(relMSE) have the reference's own noise taken off, so they are those of the pictures; the noise stands beside them.
Without the worst 0.1 % of the pixels, a highlight of a few pixels in a path that is black elsewhere does not decide
alone: one pixel where the reference found nothing and the other picture did would outweigh all that is seen.
Cycles with as many samples shows what the scene asks for at this number of samples. Two pictures by Candela of other
points tell how much of its error is noise, and what stays without it: a bias, whose sign the light as a whole shows.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

from bench import ages, markdown
from bench.markdown import write_whole
from bench.quick import size_of, table

SCENES = Path(__file__).resolve().parent.parent / "sample_blends"
PATHS = {"direct_light": "all", "diffuse_direct": "diffuse", "glossy_direct": "glossy"}
SEEDS = (3, 4)  # unlike those of the reference
HEAD = (
    "scene", "light", "relMSE", "without the worst 0.1 %", "of it noise", "bias",
    "Cycles", "without the worst 0.1 %", "Cycles' bias", "reference's noise",
)  # fmt: skip


def lines(scene, name: str, samples: int, size: tuple[int, int], reference_samples: int) -> list[tuple[str, ...]]:
    """Of the table, for the open scene."""
    from addon.compare.metrics import compare_radiance, relative_squared_error, trimmed_mean
    from addon.compare.passes import light_paths
    from addon.compare.reference import reference, render_passes

    mean, half = reference(scene, reference_samples, direct_only=True, size=size).paths()
    pictures = [
        light_paths(render_passes(scene, engine, samples, seed, direct_only=True, size=size).images)
        for engine, seed in (("CANDELA", SEEDS[0]), ("CANDELA", SEEDS[1]), ("CYCLES", SEEDS[0]))
    ]
    found = []
    for path, label in PATHS.items():
        if not mean[path].any():
            continue
        first, second, cycles = (picture[path] for picture in pictures)
        noise = trimmed_mean(relative_squared_error(mean[path] + half[path], mean[path]))
        # Half of what two pictures differ by, squared, is what either errs by chance.
        own_noise = trimmed_mean(relative_squared_error(mean[path] + (first - second) / np.sqrt(2.0), mean[path]))
        row = [name, label]
        for picture, by_chance in ((first, [f"{own_noise:.4f}"]), (cycles, [])):
            error = compare_radiance(path, picture, mean[path], half[path])
            net = max(error.relmse - error.floor, 0.0), max(error.relmse_trimmed - noise, 0.0)
            row += [f"{net[0]:.4f}", f"{net[1]:.4f}", *by_chance, f"{error.bias:.3f}"]
        found.append((*row, f"{error.floor:.4f}"))
        name = ""
    return found


def page(rows: list[tuple[str, ...]], samples: int, size: tuple[int, int], reference_samples: int) -> str:
    """The rows as a page of the documentation."""
    return "\n".join([
        f"# Direct light at {samples} samples", "",
        f"Written by `python -m bench direct --page PATH`; do not edit. Pictures of {size[0]} x {size[1]} pixels",
        f"without bounces against two renders of {reference_samples} samples by Cycles, whose noise is taken off the",
        "errors (relMSE). Without the worst 0.1 %: without the pixels with the largest error. Of it noise: what two",
        "pictures by Candela differ by, without their worst 0.1 %; what is left of the column before it is bias.",
        "Single pixels of a path that is black elsewhere: finding 110 of [performance.md](performance.md).",
        "Light that goes through glass is no direct light, so that Cycles without bounces has black shadows below it;",
        "Candela's are grey where nothing brings caustics, which is what scenes named caustics differ by.", "",
        ages.now(), "",
        markdown.table([HEAD, *rows]), "",
    ])  # fmt: skip


def scene_names() -> list[str]:
    return sorted(path.stem for path in SCENES.glob("*.blend"))


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--scenes", nargs="+", default=scene_names(), metavar="NAME", help="default: all of sample_blends"
    )
    parser.add_argument("--samples", type=int, default=64, metavar="N", help="default 64")
    parser.add_argument("--size", type=size_of, default=(256, 192), metavar="WxH", help="default 256x192")
    parser.add_argument("--reference", type=int, default=512, metavar="N", help="of each of two (default 512)")
    parser.add_argument("--page", type=Path, metavar="PATH", help="write the table as Markdown, too")


def command(options: argparse.Namespace) -> int:
    missing = [name for name in options.scenes if not (SCENES / f"{name}.blend").is_file()]
    if missing:
        print(
            f"There is no scene '{missing[0]}' in {SCENES.name}; it holds {', '.join(scene_names())}.", file=sys.stderr
        )
        return 2
    import bpy

    import addon

    addon.register()
    rows: list[tuple[str, ...]] = []
    for name in options.scenes:
        bpy.ops.wm.open_mainfile(filepath=str(SCENES / f"{name}.blend"))
        added = lines(bpy.context.scene, name, options.samples, options.size, options.reference)
        print(table([HEAD, *added]), flush=True)
        rows += added
        if options.page:  # after each scene: what is measured stays when the run is ended
            write_whole(options.page, page(rows, options.samples, options.size, options.reference))
    return 0
