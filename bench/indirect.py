"""Diffuse indirect light of every technique of its slot beside Cycles' own pass: `python -m bench indirect`.

For scenes x techniques x samples: squared error (relMSE, the noise of the reference taken off), bias, milliseconds of
the technique, and its counters. With `--temporal`, the camera and the first light of each scene move slowly over some
frames of one sample each. The table then holds, beside the mean error of a frame, what is new in it: half the mean
square of the error's change from one frame to the next. If errors stood still, that would be 0; if every frame drew its
own, it would be their variance. With `--page` all of this, beside the other engines, becomes a page.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from bench.moving import new_in_it, of_frame, scale_of

SCENES = Path(__file__).resolve().parent.parent / "sample_blends"
ROOMS = ("cornell_box", "window_interior", "colonnade_hall", "door_ajar", "sky_courtyard", "emissive_lamp")
PATH = "diffuse_indirect"
BOUNCES = 16
TURN, SHIFT = (
    0.5,
    0.01,
)  # degrees of the camera, and share of its distance to the origin by which a light moves, a frame


def techniques() -> list[str]:
    from addon.techniques import REGISTRY

    return [technique.name for technique in REGISTRY if "indirect" in technique.fills]


def render(scene, engine: str, samples: int, seed: int, size: tuple[int, int]) -> np.ndarray:
    """The pass times the surfaces' colour, (H, W, 3)."""
    from addon.compare.passes import light_paths
    from addon.compare.reference import render_passes

    return light_paths(render_passes(scene, engine, samples, seed, size=size, bounces=BOUNCES).images)[PATH]


def reference(scene, samples: int, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Mean and half the difference of two renders by Cycles."""
    first, second = (render(scene, "CYCLES", samples, seed, size) for seed in (1, 2))
    return (first + second) / 2, (first - second) / 2


def measured(scene, technique: str, samples: int, size: tuple[int, int], truth) -> tuple[str, ...]:
    """One line of the table."""
    from addon.compare.metrics import compare_radiance
    from addon.frame import ledger

    scene.candela.slot_indirect = technique
    found = compare_radiance(PATH, render(scene, "CANDELA", samples, 1, size), *truth)
    row = next(row for row in ledger.latest().rows if row.name == technique)
    counted = ", ".join(f"{value // samples} {name}" for name, value in row.counters.items() if value >= samples)
    net = max(found.relmse - found.floor, 0.0)
    return technique, str(samples), f"{net:.4f}", f"{found.bias:.3f}", f"{row.milliseconds / samples:.0f}", counted


def frames(scene, count: int) -> Iterator[None]:
    """Move camera and first light a little further before each frame; back at the end."""
    from mathutils import Matrix

    light = next((thing for thing in scene.objects if thing.type == "LIGHT"), None)
    camera, place = scene.camera, scene.camera.matrix_world.copy()
    lit = light.location.copy() if light else None
    for number in range(count):
        camera.matrix_world = place @ Matrix.Rotation(np.radians(TURN * number), 4, "Y")
        if light:
            light.location.x = lit.x + SHIFT * number * place.translation.length
        yield
    camera.matrix_world = place
    if light:
        light.location = lit


def moving(scene, names: list[str], count: int, samples: int, size: tuple[int, int]) -> Iterator[tuple[str, ...]]:
    """Lines of the table of motion: technique, what is new in the error of a frame, error of a frame."""
    errors: dict[str, list[np.ndarray]] = {name: [] for name in names}
    truths = []
    for _ in frames(scene, count):
        truth, _ = reference(scene, samples, size)
        truths.append(truth)
        for name in names:
            scene.candela.slot_indirect = name
            errors[name].append(render(scene, "CANDELA", 1, 1, size) - truth)
    scale = scale_of(truths)
    for name, error in errors.items():
        yield name, f"{new_in_it(error, scale):.4f}", f"{of_frame(error, scale):.4f}"


def table(rows: list[tuple[str, ...]]) -> str:
    widths = [max(map(len, column)) for column in zip(*rows)]
    return "\n".join("  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip() for row in rows)


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--scenes", nargs="+", default=ROOMS, metavar="NAME", help=f"default: {', '.join(ROOMS)}")
    parser.add_argument("--techniques", nargs="+", metavar="NAME", help="default: all of the slot")
    parser.add_argument(
        "--samples", nargs="+", type=int, default=(1, 4, 16, 64), metavar="N", help="default: 1 4 16 64"
    )
    parser.add_argument("--size", nargs=2, type=int, default=(96, 72), metavar=("W", "H"), help="pixels, default 96 72")
    parser.add_argument("--reference", type=int, default=256, metavar="N", help="samples of each Cycles render")
    parser.add_argument("--page", type=Path, metavar="PATH", help="all, with peers, growth and motion, as Markdown")
    parser.add_argument("--temporal", type=int, default=0, metavar="FRAMES", help="frames of slow motion instead")


def command(options: argparse.Namespace) -> int:
    import bpy

    import addon

    addon.register()
    names = options.techniques or techniques()
    size = tuple(options.size)
    if options.page:
        from bench import indirect_page

        indirect_page.write(options.page, options.scenes, names, size, options.reference)
        return 0
    for name in options.scenes:
        bpy.ops.wm.open_mainfile(filepath=str(SCENES / f"{name}.blend"))
        scene = bpy.context.scene
        if options.temporal:
            rows = [("technique", "new error", "error")]
            rows += moving(scene, names, options.temporal, options.reference, size)
        else:
            truth = reference(scene, options.reference, size)
            rows = [("technique", "samples", "relMSE", "bias", "ms", "counters, each sample")]
            rows += [measured(scene, own, count, size, truth) for own in names for count in options.samples]
        print(f"\n{name}\n{table(rows)}", flush=True)
    return 0
