"""Isolated bright pixels: `python -m bench bright`.

Counts pixels whose surroundings, the mean of the other eight of 3x3, and whose truth, the mean of 3x3 pixels of Cycles,
are both FIVE times darker. Such a pixel is light that is found rarely and then counts for all that was missed; glare
makes a star of it. Truth is rendered only where surroundings tell of some. The scenes of `bench reflections`, sample
files by name, and paths of .blend files.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from bench.markdown import table

FIVE = 5.0
LEAST = 0.02  # of the picture's mean: below it nobody sees a pixel
SIZE = (128, 96)
FILES = ("caustics_table", "caustics_rings", "emissive_lamp", "hdri_product", "window_interior")


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scenes", nargs="*", help="by name, or paths of .blend files; without: all")
    parser.add_argument("--samples", type=int, default=16)
    parser.add_argument("--truth-samples", type=int, default=512, help="of Cycles")
    parser.add_argument("--size", default="x".join(map(str, SIZE)), help="pixels")


def command(options: argparse.Namespace) -> int:
    import addon
    from addon.compare.reference import render_passes
    from bench import glass_scenes, reflection_scenes

    addon.register()
    size = tuple(int(side) for side in options.size.split("x"))
    rows, total = [["scene", "by surroundings", "and truth"]], 0
    for name in options.scenes or (*reflection_scenes.SCENES, *glass_scenes.SCENES, *FILES):
        scene = _opened(name)
        image = render_passes(scene, "CANDELA", options.samples, 1, size=size).images["combined"]
        alone, found = isolated(luminance(image)), 0
        if alone.any():
            truth = render_passes(scene, "CYCLES", options.truth_samples, 1, size=size).images["combined"]
            found = int((alone & brighter(luminance(image), around(luminance(truth), whole=True))).sum())
        rows.append([name, str(int(alone.sum())), str(found)])
        total += found
        print("  ".join(rows[-1]), flush=True)
    print(table(rows))
    print(f"{total} isolated bright pixels.")
    return 0


def luminance(image: np.ndarray) -> np.ndarray:
    return image[..., :3].astype(np.float64) @ np.array([0.2126, 0.7152, 0.0722])


def around(light: np.ndarray, whole: bool = False) -> np.ndarray:
    """Mean of the eight neighbours of each pixel, `whole`: of all nine; at the rim those that there are."""
    count, total = np.zeros_like(light), np.zeros_like(light)
    padded, known = np.pad(light, 1), np.pad(np.ones_like(light), 1)
    height, width = light.shape
    for y in range(3):
        for x in range(3):
            if whole or (y, x) != (1, 1):
                total += padded[y : y + height, x : x + width]
                count += known[y : y + height, x : x + width]
    return total / count


def brighter(light: np.ndarray, than: np.ndarray) -> np.ndarray:
    return light > np.maximum(FIVE * than, LEAST * light.mean())


def isolated(light: np.ndarray) -> np.ndarray:
    """(H, W) bool: pixels whose surroundings are five times darker."""
    return brighter(light, around(light))


def _opened(name: str):
    import bpy

    from bench import glass_scenes, reflection_scenes
    from bench.cells import ROOT

    if name in reflection_scenes.SCENES | glass_scenes.SCENES:
        return reflection_scenes.make(name)
    file = Path(name) if name.endswith(".blend") else ROOT / "sample_blends" / f"{name}.blend"
    bpy.ops.wm.open_mainfile(filepath=str(file))
    return bpy.context.scene
