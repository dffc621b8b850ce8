"""Error and time of reflections and refractions beside Cycles and EEVEE: `python -m bench reflections`.

Each scene of `bench/reflection_scenes.py` is rendered by Cycles with --reference samples (twice, with two seeds, whose
difference tells the reference's own noise), by Candela with 1, 16 and 64 samples, by Candela with mean colours in
reflections, by EEVEE with ray tracing and by Cycles with few samples, denoised. The error is relMSE of the picture
and of what its glossy and transmission passes bring; the mean is Candela's over the reference's. Times are those of
whole renders, one after the other on the same machine: on a software GPU they say little about a real one.

`--page` writes docs/reflections.md's tables, `--only NAME` takes scenes by name, `--pictures FOLDER` keeps PNG files.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from . import markdown

PAGE = Path(__file__).resolve().parent.parent / "docs" / "reflections.md"
COMMAND = "python -m bench reflections --page"
SIZE = (96, 64)
PATHS = ("glossy", "transmission")


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
    Entrant("Candela, 16", "CANDELA", 16),
    Entrant("Candela, 64", "CANDELA", 64),
    Entrant("Candela, 64, means", "CANDELA", 64, means=True),
    Entrant("EEVEE, 16, ray traced", "BLENDER_EEVEE", 16),
    Entrant("Cycles, 4, denoised", "CYCLES", 4, denoised=True),
    Entrant("Cycles, 16, denoised", "CYCLES", 16, denoised=True),
)


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--only", nargs="+", help="names of scenes")
    parser.add_argument("--reference", type=int, default=1024, help="samples of each of Cycles' two references")
    parser.add_argument("--page", action="store_true", help="write docs/reflections.md's tables")
    parser.add_argument("--pictures", type=Path, help="folder for PNG files")


def command(options: argparse.Namespace) -> int:
    import addon

    from . import reflection_scenes

    addon.register()
    names = options.only or list(reflection_scenes.SCENES)
    tables = []
    for name in names:
        scene = reflection_scenes.make(name)
        tables.append(f"### {name[:1].upper()}{name[1:]}\n\n{_measure(scene, name, options)}")
        print(tables[-1], flush=True)
    if options.page:
        markdown.put_between(PAGE, COMMAND, "\n\n".join(tables))
    return 0


def _measure(scene, name: str, options: argparse.Namespace) -> str:
    references = [_render(scene, Entrant("", "CYCLES", options.reference), seed)[0] for seed in (0, 1)]
    truth = {key: (references[0][key] + references[1][key]) / 2 for key in references[0]}
    shown = [key for key in truth if truth[key].mean() > 1e-3]
    noise = {key: error(*(one[key] for one in references)) / 4 for key in shown}
    rows = [["", "seconds", *(title for key in shown for title in (f"{key}: relMSE", "mean"))]]
    rows.append(["reference's noise", "", *(text for key in shown for text in (f"{noise[key]:.4f}", ""))])
    _keep(options.pictures, name, "Cycles", truth["picture"])
    for entrant in ENTRANTS:
        found, seconds = _render(scene, entrant, 7)
        cells = []
        for key in shown:
            there = key in found
            cells.append(f"{max(error(found[key], truth[key]) - noise[key], 0.0):.4f}" if there else "–")
            cells.append(f"{found[key].mean() / truth[key].mean():.3f}" if there else "–")
        rows.append([entrant.label, f"{seconds:.1f}", *cells])
        _keep(options.pictures, name, entrant.label, found["picture"])
    return markdown.table(rows)


def error(found: np.ndarray, truth: np.ndarray) -> float:
    """relMSE, all pixels counted."""
    from addon.compare.metrics import relative_squared_error

    return float(relative_squared_error(found.astype(np.float64), truth.astype(np.float64)).mean())


def _render(scene, entrant: Entrant, seed: int) -> tuple[dict[str, np.ndarray], float]:
    """The picture and what its paths bring, (H, W, 3), and seconds of the render."""
    from addon.compare.reference import render_passes

    settings = scene.candela
    settings.property_unset("shaded_reflections_bounces")
    if entrant.means:
        settings.shaded_reflections_bounces = 0
    scene.eevee.use_raytracing = True
    start = time.perf_counter()
    images = render_passes(scene, entrant.engine, entrant.samples, seed, size=SIZE).images
    seconds = time.perf_counter() - start
    if entrant.denoised:
        images["combined"], seconds = _denoised(scene, entrant, seed)
        return {"picture": images["combined"]}, seconds
    found = {"picture": images["combined"][..., :3]}
    for path in PATHS:
        parts = [images.get(f"{path}_{order}") for order in ("direct", "indirect")]
        color = images.get(f"{path}_color")
        if entrant.engine != "BLENDER_EEVEE" and color is not None and all(part is not None for part in parts):
            found[path] = (parts[0] + parts[1])[..., :3] * color[..., :3]
    return found, seconds


def _denoised(scene, entrant: Entrant, seed: int) -> tuple[np.ndarray, float]:
    """Combined as Cycles' denoiser leaves it, and the time of that render."""
    import tempfile

    import bpy

    from addon.compare.exr import read_exr

    render, cycles = scene.render, scene.cycles
    kept = render.engine, cycles.samples, cycles.use_denoising, cycles.seed, render.resolution_x, render.resolution_y
    render.engine, cycles.samples, cycles.use_denoising, cycles.seed = "CYCLES", entrant.samples, True, seed
    render.resolution_x, render.resolution_y = SIZE
    try:
        start = time.perf_counter()
        bpy.ops.render.render(scene=scene.name)
        seconds = time.perf_counter() - start
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "denoised.exr"
            image_settings = render.image_settings
            image_settings.file_format, image_settings.color_depth = "OPEN_EXR", "32"
            bpy.data.images["Render Result"].save_render(str(path), scene=scene)
            pixels = read_exr(path)
    finally:
        (
            render.engine, cycles.samples, cycles.use_denoising, cycles.seed, render.resolution_x, render.resolution_y,
        ) = kept  # fmt: skip
    return next(layer[..., :3] for layer in pixels.values() if layer.shape[-1] >= 3), seconds


def _keep(folder: Path | None, name: str, label: str, pixels: np.ndarray) -> None:
    if folder is None:
        return
    from addon.compare.metrics import display
    from addon.compare.png import png

    folder.mkdir(parents=True, exist_ok=True)
    shown = (np.clip(display(pixels), 0, 1)[::-1] * 255 + 0.5).astype(np.uint8)
    (folder / f"{name} {label}.png".replace(" ", "_").replace(",", "")).write_bytes(png(shown))
