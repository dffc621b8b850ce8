"""Drafts of a moving view with history and without: `python -m bench orbit`.

A camera goes around, an object moves, a lamp moves, or its power is edited in the middle; each for so many steps. Each
step is one draft, as the viewport draws it (one sample, draft parameters), and one of every few is compared with its
own converged picture: full parameters, many samples, each at the middle of its pixel, and seen through the film of a
draft, in which the middles of neighbouring pixels count, too (addon/film/filter.py).

    error           mean over steps of relMSE (bench/moving.py) on what is seen, ended at 1 for a pixel
    fresh           the same where history holds nothing: what came into view, edges, what has moved away
    after the edit  the same in the three steps after the lamp's edit
    steps/s         by processor seconds, of all threads

With history all steps are drawn one after the other. Without it the steps that are compared are drawn once more, each
with the seed that it had there: a viewport without history draws all with one, whose luck decides more than all else
(camera, five seeds: .044 to .089). Errors are means over `--seeds`.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from bench.cells import ROOT
from bench.markdown import put_between, rows_of, table

COMMAND = "python -m bench orbit"
PAGE = ROOT / "docs" / "flicker.md"
WAYS = ("camera", "object", "lamp", "edit")
HEAD = ("scene", "what moves", "error without", "with history", "ratio", "fresh: without", "with", "steps/s", "with")
MOST = 1.0  # error of a pixel that counts
POINT = 1e-3  # pixels, half the width of a filter that does not spread
AFTER = 3  # steps after an edit
STRIP = 5  # steps that a picture shows


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--scenes", nargs="+", default=["cornell_box"], help="sample files, or paths of .blend files")
    parser.add_argument("--ways", nargs="+", default=list(WAYS), choices=WAYS)
    parser.add_argument("--steps", type=int, default=48)
    parser.add_argument("--every", type=int, default=4, help="of so many steps one is compared")
    parser.add_argument("--size", default="96x72", help="pixels of the draft")
    parser.add_argument("--seeds", type=int, default=3, help="figures are means over so many")
    parser.add_argument("--truth", type=int, default=64, help="samples of a converged picture")
    parser.add_argument(
        "--strip",
        type=Path,
        help="write a picture for each row, named by scene and way: converged, without history, with it, by step",
    )
    parser.add_argument("--page", action="store_true", help=f"write rows into docs/{PAGE.name}; others stay")


def command(options: argparse.Namespace) -> int:
    import addon

    if too_few(options):
        print(f"--steps is at least {2 * AFTER - 1}, for the {AFTER} steps after the edit.")
        return 2
    addon.register()
    rows = [HEAD]
    for scene in options.scenes:
        for way in options.ways:
            rows.append(row_of(scene, way, options))
            print("  ".join(rows[-1]), flush=True)
    print(table(rows))
    if options.page:
        measured = {row[:2] for row in rows}
        written = rows_of(PAGE.read_text(encoding="utf-8"), COMMAND, HEAD)
        kept = [row for row in written if tuple(row[:2]) not in measured]
        put_between(PAGE, COMMAND, table([HEAD, *kept, *rows[1:]]))
    return 0


def too_few(options: argparse.Namespace) -> bool:
    """Whether the steps after the edit are not all among those that are drawn."""
    return "edit" in options.ways and options.steps // 2 + AFTER > options.steps


def row_of(name: str, way: str, options: argparse.Namespace) -> tuple[str, ...]:
    """A row of the table."""
    import bpy

    path = Path(name) if name.endswith(".blend") else ROOT / "sample_blends" / f"{name}.blend"
    bpy.ops.wm.open_mainfile(filepath=str(path))
    size = tuple(int(edge) for edge in options.size.split("x"))
    steps = Steps(bpy.context.scene, way, options.steps, size)
    edit = options.steps // 2
    measured = range(edit, edit + AFTER) if way == "edit" else range(1, options.steps, options.every)
    truths = [steps.truth(number, options.truth) for number in measured]
    drawn = [steps.drawn(seed, measured) for seed in range(options.seeds)]
    better, seen = (
        np.array(
            [
                [errors(picture, truth) for picture, truth in zip(getattr(one, name), truths, strict=True)]
                for one in drawn
            ]
        )
        for name in ("joined", "alone")
    )
    masks = np.array([one.fresh for one in drawn])
    slow, quick = np.mean([one.speed for one in drawn], axis=0)
    if options.strip:
        several = len(options.scenes) * len(options.ways) > 1
        row = f"{options.strip.stem}_{path.stem}_{way}" if several else options.strip.stem
        write_strip(options.strip.with_stem(row), truths, drawn[0].alone, drawn[0].joined)
    before, after = float(seen.mean()), float(better.mean())
    new = [float(one[masks].mean()) if masks.any() else 0.0 for one in (seen, better)]
    return (
        path.stem.replace("_", " "), "lamp's power, 3 steps after" if way == "edit" else way, f"{before:.4f}",
        f"{after:.4f}", f"{after / before:.2f}", f"{new[0]:.4f}", f"{new[1]:.4f}", f"{slow:.2f}", f"{quick:.2f}",
    )  # fmt: skip


def write_strip(path: Path, *rows: list[np.ndarray]) -> None:
    """STRIP of the steps side by side, one row of pictures (H, W, 3) below the other."""
    from addon.compare.metrics import display
    from bench.strips import stacked, write_picture

    exposure = float(-np.log2(max(np.percentile(rows[0][0], 95), 1e-6)))
    chosen = np.linspace(0, len(rows[0]) - 1, STRIP).astype(int)
    height, width = rows[0][0].shape[:2]
    columns = [stacked([display(row[k], exposure) for row in rows], width, height) for k in chosen]
    write_picture(path, np.concatenate(columns, axis=1))


def errors(shown: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """(H, W) squared errors in units of what is seen, each at most MOST."""
    luminance = truth.mean(axis=2)
    squared = np.square(shown - truth).mean(axis=2) / (luminance**2 + (0.1 * luminance.mean()) ** 2)
    return np.minimum(squared, MOST)


def through_film(middles: np.ndarray, width: float) -> np.ndarray:
    """(H, W, C) what a film of a filter of this width, in pixels, shows of one sample at the middle of each pixel."""
    from addon.film.filter import reach, taps

    pixels, (_, weights), seen = reach(width), taps(0.0, width), middles
    for axis in (0, 1):
        number = np.arange(middles.shape[axis])
        near = [np.clip(number + k, 0, len(number) - 1) for k in range(-pixels, pixels + 1)]
        blurred = sum(weight * np.take(seen, index, axis=axis) for weight, index in zip(weights, near))
        inside = (number >= 2 * pixels) & (number < len(number) - 2 * pixels)  # at the rim own points alone count
        seen = np.where(inside[:, None, None] if axis == 0 else inside[None, :, None], blurred, seen)
    return seen


@dataclass
class Drawn:
    """Drafts of the measured steps."""

    joined: list[np.ndarray] = field(default_factory=list)  # (H, W, 3) with history
    alone: list[np.ndarray] = field(default_factory=list)  # (H, W, 3) the same without it
    fresh: list[np.ndarray] = field(default_factory=list)  # (H, W) where there is no history
    speed: tuple[float, float] = (0.0, 0.0)  # steps a processor second, without history and with it


class Steps:
    """A scene that moves step by step, seen by drafts and by converged pictures."""

    def __init__(self, scene, way: str, count: int, size: tuple[int, int]):
        from addon.snapshot import SnapshotCache

        self.scene, self.way, self.count, self.size = scene, way, count, size
        self.cache = SnapshotCache()
        self.camera = scene.camera.matrix_world.copy()
        lamps = [one for one in scene.objects if one.type == "LIGHT"]
        meshes = [one for one in scene.objects if one.type == "MESH" and len(one.data.polygons) > 1]
        self.lamp = max(lamps, key=lambda one: one.data.energy, default=None)
        inside = [one for one in meshes if max(one.dimensions) < 0.5 * max(max(m.dimensions) for m in meshes)]
        self.thing = max(inside or meshes, key=lambda one: max(one.dimensions))
        self.places = {one: one.matrix_world.copy() for one in (self.lamp, self.thing) if one is not None}
        self.energy = self.lamp.data.energy if self.lamp else 0.0
        self._truth = None

    def snapshot(self, number: int):
        """The scene at a step."""
        import bpy
        from mathutils import Matrix, Vector

        from addon.snapshot import camera_of_scene, take

        scene, turn = self.scene, 2.0 * np.pi * number / self.count
        away = 0.6 * np.sin(turn)
        thing_reach = 0.5 * max(self.thing.dimensions)
        if self.way == "camera":  # around a point five metres before it
            centre = self.camera @ Vector((0.0, 0.0, -5.0))
            around = Matrix.Translation(centre) @ Matrix.Rotation(0.25 * away, 4, "Z") @ Matrix.Translation(-centre)
            scene.camera.matrix_world = around @ self.camera
        elif self.way == "object":
            self.thing.matrix_world = Matrix.Translation((away * thing_reach, 0.0, 0.0)) @ self.places[self.thing]
        elif self.way == "lamp" and self.lamp is not None:
            self.lamp.matrix_world = Matrix.Translation((away, 0.0, 0.0)) @ self.places[self.lamp]
        elif self.way == "edit" and self.lamp is not None:
            self.lamp.data.energy = self.energy * (0.3 if number >= self.count // 2 else 1.0)
            around = Matrix.Translation((0.01 * number, 0.0, 0.0))
            scene.camera.matrix_world = around @ self.camera
        bpy.context.view_layer.update()
        graph = bpy.context.evaluated_depsgraph_get()
        graph.update()
        self.cache.doubt()
        return take(graph, self.cache, *self.size, view=camera_of_scene(scene, graph, *self.size))

    def settings(self, **changed):
        """Of the viewport."""
        from addon.ui.properties import settings_of

        settings = settings_of(self.scene, viewport=True)
        return replace(settings, **changed)

    def truth(self, number: int, samples: int) -> np.ndarray:
        """(H, W, 3) the converged picture of a step."""
        from addon import techniques
        from addon.frame.run import Renderer
        from addon.frame.schedule import FINAL

        self._truth = self._truth or Renderer(techniques.make_registry)
        settings = self.settings(samples=samples, schedule=FINAL, seed=77, shows=frozenset())
        snapshot = self.snapshot(number)
        film = replace(snapshot.film, filter_width=POINT)
        drawn = _picture(self._truth, replace(snapshot, film=film), settings, samples)[..., :3]
        return through_film(drawn, snapshot.film.filter_width)

    def drawn(self, seed: int, measured: Sequence[int]) -> Drawn:
        """Drafts of all steps with history, and of those that are measured without it."""
        from addon import techniques
        from addon.frame.run import Renderer
        from addon.gfx import images

        joined, alone = (Renderer(techniques.make_registry) for _ in range(2))
        settings = self.settings(samples=1, shows=frozenset(), seed=seed).as_draft()
        drafts = {
            history: replace(settings, values={**settings.values, ("history", "drafts"): history})
            for history in (False, True)
        }
        found, took = Drawn(), ([], [])
        for number in range(self.count):
            snapshot, started = self.snapshot(number), time.process_time()
            picture = _picture(joined, snapshot, drafts[True], 1)[..., :3]
            took[1].append(time.process_time() - started)
            if number not in measured:
                continue
            found.joined.append(picture)
            found.fresh.append(images.read(joined.frame.images["history.place"])[..., 3] == 1.0)
            own, started = replace(drafts[False], seed=joined.frame.settings.seed), time.process_time()
            found.alone.append(_picture(alone, snapshot, own, 1)[..., :3])
            took[0].append(time.process_time() - started)
        joined.release()
        alone.release()
        found.speed = tuple(1.0 / float(np.median(one)) for one in took)
        return found


def _picture(renderer, snapshot, settings, samples: int) -> np.ndarray:
    from addon.gfx import images

    frame = renderer.begin(snapshot, settings)
    while frame.samples_done < samples:
        renderer.advance(frame)
    return images.read(renderer.show(frame))
