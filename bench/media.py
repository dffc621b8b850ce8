"""Fog, smoke and volume caustics beside Cycles and EEVEE: `python -m bench media`.

Rooms of media_scenes.py at 256x192 with 1, 4 and 16 samples, rows of foggy.py. With `--shafts`, volume caustics instead
(shafts.py); with `--motion`, a spot in fog that moves 2 cm a frame, one sample each, against more samples of each
frame: error of a frame, and what is new in it (moving.py).
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

from bench import foggy, markdown
from bench.moving import new_in_it, of_frame, scale_of, shifted
from bench.quick import size_of

PAGE = Path(__file__).resolve().parent.parent / "docs" / "media.md"
COMMAND = "python -m bench media --page"
MOTION = "python -m bench media --motion 24 --page"
STEP, TRUTH_SAMPLES = 0.02, 32  # metres a frame; of the truth of each frame


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--scenes", nargs="+", default=None, metavar="NAME", help="default: all")
    parser.add_argument("--size", type=size_of, default=(256, 192), metavar="WxH", help="default 256x192")
    parser.add_argument("--reference", type=int, default=96, metavar="N", help="samples of each of two references")
    parser.add_argument("--engines", nargs="+", metavar="NAME", help="default: all")
    parser.add_argument("--no-eevee", action="store_true", help="leave EEVEE out")
    parser.add_argument("--again", action="store_true", help="measure what is known, too")
    parser.add_argument("--page", action="store_true", help="write table and pictures into docs/media.md")
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="with --shafts: write PNGs")
    parser.add_argument("--motion", type=int, default=0, metavar="FRAMES", help="frames of a moving lamp instead")
    parser.add_argument("--shafts", action="store_true", help="volume caustics beside light tracing instead")
    parser.add_argument("--costs", action="store_true", help="with --shafts: their times, too")


def command(options: argparse.Namespace) -> int:
    if options.costs and not options.shafts:
        print("--costs is about --shafts: give both.", file=sys.stderr)
        return 2

    import addon

    addon.register()
    if options.motion or options.shafts:
        from bench import shafts

        mark = MOTION if options.motion else shafts.COMMAND
        text = motion(options.motion) if options.motion else shafts.page(options.pictures, options.costs)
        print(text)
        if options.page:
            markdown.put_between(PAGE, mark, text)
        return 0
    known = foggy.go_on(options)
    text = foggy.page(known)
    print(text)
    if options.page:
        markdown.put_between(PAGE, COMMAND, text)
        foggy.sheet(known)
    return 0


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
