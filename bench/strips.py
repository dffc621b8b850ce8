"""Pictures of technique pages, scene by scene beside Cycles: `python -m bench strips`.

Each page has one picture: a row for each entrant, a column for each scene, written to docs/images/NAME.png. Scenes are
sample files or those of the page's own benchmark; all entrants of a scene share its exposure, by Cycles' picture.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
GAP = 4  # pixels between pictures


@dataclass(frozen=True)
class Entrant:
    engine: str
    samples: int
    settings: tuple[tuple[str, object], ...] = ()


@dataclass(frozen=True)
class Strip:
    size: tuple[int, int]
    scenes: tuple[str, ...]
    make: Callable[[str], None]  # leaves the scene of that name open
    entrants: tuple[Entrant, ...]  # the last is Cycles, and sets the exposure


def _sample_file(name: str) -> None:
    import bpy

    bpy.ops.wm.open_mainfile(filepath=str(ROOT / "sample_blends" / f"{name}.blend"))


def _medium(name: str) -> None:
    from bench import media_scenes

    media_scenes.begin()
    (media_scenes.MEDIA | media_scenes.CAUSTICS)[name]()


def _reflection(name: str) -> None:
    from bench import reflection_scenes

    reflection_scenes.make(name)


NO_BOUNCES = ("slot_indirect", "OFF")
CYCLES = Entrant("CYCLES", 128)
STRIPS = {
    "caustics": Strip(
        (240, 135),
        ("caustics_table", "caustics_pool", "caustics_rings"),
        _sample_file,
        (
            Entrant("CANDELA", 8, (NO_BOUNCES, ("slot_caustics", "OFF"))),
            Entrant("CANDELA", 8, (NO_BOUNCES, ("slot_caustics", "screen_space_photons"))),
            CYCLES,
        ),
    ),
    "media": Strip(
        (128, 128),
        ("spot in fog", "window in haze", "VDB cloud", "fire", "W1 glass ball"),
        _medium,
        (Entrant("CANDELA", 1), Entrant("CANDELA", 16), Entrant("CYCLES", 256)),
    ),
    "reflections": Strip(
        (128, 96),
        ("corridor", "roughness map", "glass ball", "car paint", "window pane", "water"),
        _reflection,
        (Entrant("CANDELA", 1), Entrant("CANDELA", 16), CYCLES),
    ),
}


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(STRIPS)}; default all")


def command(options: argparse.Namespace) -> int:
    import addon

    addon.register()
    unknown = [name for name in options.names if name not in STRIPS]
    if unknown:
        print(f"No picture is called {', '.join(unknown)}: there are {', '.join(STRIPS)}.")
        return 2
    for name in options.names or STRIPS:
        path = ROOT / "docs" / "images" / f"{name}.png"
        _write(path, np.concatenate([_column(scene, STRIPS[name]) for scene in STRIPS[name].scenes], axis=1))
        print(path.relative_to(ROOT))
    return 0


def _column(scene: str, strip: Strip) -> np.ndarray:
    """The scene by each entrant, from top to bottom, (H, W, 3) of displayed values; row 0 at the top."""
    import bpy

    from addon.compare.metrics import display
    from addon.compare.reference import render_passes

    pictures = []
    for one in strip.entrants:
        strip.make(scene)
        settings = bpy.context.scene.candela
        for key, value in one.settings:
            setattr(settings, key, value)
        found = render_passes(bpy.context.scene, one.engine, one.samples, 1, size=strip.size)
        pictures.append(found.images["combined"][..., :3])
    exposure = float(-np.log2(max(np.percentile(pictures[-1], 97), 1e-6)))
    width, height = strip.size
    column = np.ones(((height + GAP) * len(pictures) - GAP, width + GAP, 3))
    for row, picture in enumerate(pictures):
        top = row * (height + GAP)
        column[top : top + height, :width] = display(picture, exposure)[::-1]
    return column


def _write(path: Path, shown: np.ndarray) -> None:
    from addon.compare.png import png

    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(png((np.clip(shown[:, :-GAP], 0, 1) * 255 + 0.5).astype(np.uint8)))
