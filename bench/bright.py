"""Isolated bright pixels: `python -m bench bright`.

Counts pixels whose surroundings, the mean of the other eight of 3x3, and whose truth, the pixel of Cycles and the mean
of its 3x3, are FIVE times darker (a small lamp stands alone in both). Such a pixel is light that is found rarely and
then counts for all that was missed; glare makes a star of it. Said of each is the light path that most of what it has
more than its surroundings came by. Truth is rendered only where surroundings tell of some. Pictures of ten pages
(sample files and scenes of glare), the scenes of `bench reflections`, and paths of .blend files. `--before CHECKOUT`
counts them in the pictures of an older working tree, too, and writes no page. `--page` writes docs/reflections.md's
table; rows of others stay.
"""

from __future__ import annotations

import argparse
import contextlib
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

from bench import ages, markdown
from bench.beside import Version
from bench.cells import ROOT

PAGE = ROOT / "docs" / "reflections.md"
COMMAND = "python -m bench bright --page"
HEAD = ["scene", "by surroundings", "and truth", "of", "commit"]
BEFORE_HEAD = ["scene", "before", "now", "of", "commit"]
FIVE = 5.0
LEAST = 0.02  # of the picture's mean: below it nobody sees a pixel
SAMPLES, SIZE = 16, (96, 72)
FILES = (
    "caustics_table", "caustics_rings", "emissive_lamp", "hdri_product", "window_interior", "cornell_box",
    "soft_shadow_garden",
)  # fmt: skip
BUILT = ("street", "candle", "car")  # of bench/glare_scenes.py


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scenes", nargs="*", help="by name, or paths of .blend files; without: all")
    parser.add_argument("--samples", type=int, default=SAMPLES)
    parser.add_argument("--truth-samples", type=int, default=512, help="of Cycles")
    parser.add_argument("--size", default="x".join(map(str, SIZE)), help="pixels")
    parser.add_argument("--before", type=Path, metavar="CHECKOUT", help="a working tree of an older commit, to compare")
    parser.add_argument("--page", action="store_true", help="write docs/reflections.md's table")


def command(options: argparse.Namespace) -> int:
    import addon

    addon.register()
    size = tuple(int(side) for side in options.size.split("x"))
    if options.page and (options.before or (options.samples, size) != (SAMPLES, SIZE)):
        raise ValueError(f"{PAGE.name} has {SAMPLES} samples, {SIZE} pixels and nothing of --before: leave --page out.")
    with contextlib.ExitStack() as ends:
        older = Version(options.before) if options.before else None
        if older:
            ends.callback(older.end)
        print(_counted(options, size, older))
    return 0


def _counted(options: argparse.Namespace, size: tuple[int, int], older: Version | None) -> str:
    """What the page says, which is written after each scene. `older` renders with the other working tree."""
    from addon.compare.reference import render_passes
    from bench import glass_scenes, reflection_scenes

    head = BEFORE_HEAD if older else HEAD
    rows = markdown.rows_of(PAGE.read_text(encoding="utf-8"), COMMAND, head) if options.page else []
    for name in options.scenes or (*FILES, *BUILT, *reflection_scenes.SCENES, *glass_scenes.SCENES):
        scene = _opened(name)
        before = luminance(_by(older, options.samples, size)) if older else None
        images = render_passes(scene, "CANDELA", options.samples, 1, size=size).images
        light = luminance(images["combined"])
        alone = found = isolated(light)
        stood = isolated(before) if older else np.zeros_like(alone)
        if alone.any() or stood.any():
            truth = luminance(render_passes(scene, "CYCLES", options.truth_samples, 1, size=size).images["combined"])
            found, stood = wrong(light, truth), wrong(before, truth) if older else stood
        counts = [str(int(one.sum())) for one in ((stood, found) if older else (alone, found))]
        row = [name, *counts, _told(came_by(images, found)), ages.commit()]
        rows = [*(one for one in rows if one[0] != name), row]
        print("  ".join(row), flush=True)
        sums = [sum(int(one[k]) for one in rows) for k in (1, 2)]
        commit = ages.git("-C", str(options.before.resolve()), "log", "-1", "--format=%h of %cs") if older else ""
        told = f"{sums[0]} before, at commit {commit}, {sums[1]} now" if older else str(sums[1])
        text = f"Isolated bright pixels: {told}.\n\n{markdown.table([head, *rows])}"
        if options.page:
            markdown.put_between(PAGE, COMMAND, text)
    return text


def _by(older: Version, samples: int, size: tuple[int, int]) -> np.ndarray:
    """The open scene, (H, W, 4), as the other working tree shows it."""
    import bpy

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.blend"
        bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
        return older.asked(path, samples, 1, size).pixels


def came_by(images: dict[str, np.ndarray], found: np.ndarray) -> Counter[str]:
    """How many of the pixels (H, W) have most of what their surroundings lack by which light path. `images`: passes by
    Candela's names, (H, W, C)."""
    from addon.compare.passes import light_paths

    paths = {name: luminance(light) for name, light in light_paths(images).items() if name != "direct_light"}
    if not paths:
        return Counter()
    names, more = list(paths), np.stack([light - around(light) for light in paths.values()])
    return Counter(names[k].replace("_", " ") for k in more.argmax(axis=0)[found])


def _told(counted: Counter[str]) -> str:
    return ", ".join(f"{path} {count}" for path, count in counted.most_common())


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


def wrong(light: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """(H, W) bool: isolated pixels where the truth is five times darker, too, the pixel as well as its 3x3."""
    return isolated(light) & brighter(light, np.maximum(truth, around(truth, whole=True)))


def _opened(name: str):
    import bpy

    from bench import glare_scenes, glass_scenes, reflection_scenes

    if name in BUILT:
        return getattr(glare_scenes, name)()
    if name in reflection_scenes.SCENES | glass_scenes.SCENES:
        return reflection_scenes.make(name)
    file = Path(name) if name.endswith(".blend") else ROOT / "sample_blends" / f"{name}.blend"
    bpy.ops.wm.open_mainfile(filepath=str(file))
    return bpy.context.scene
