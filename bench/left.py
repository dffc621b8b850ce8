"""The time that a final render says is left, beside what was left: `python -m bench left`.

Each scene is drawn as F12 draws it in a window: in parts, with sentences. Programs are compiled by a picture before. Of
each scene: what was told at the first sentence after a tenth of the render's time, and how long it really took from
there; the largest factor between the two while at least a tenth was left; and the longest time in which the sentence or
the share did not change.
"""

from __future__ import annotations

import argparse
import itertools
import time
from types import SimpleNamespace

import bpy

from bench.beside import scenes_of
from bench.markdown import table
from bench.quick import size_of

SCENES = ("cornell_box", "window_interior", "hdri_product", "soft_shadow_garden", "caustics_table")
HEAD = ("scene", "samples", "took, s", "told at, s", "left as told, s", "left, s", "factor", "worst factor", "stood, s")
SHARE = 0.1  # of the time, from which on the sentence counts, and up to which


def told_of(samples: int, size: tuple[int, int], clock) -> tuple[float, list[tuple[float, float | None, str]]]:
    """Seconds of a render of the open file, and (second, seconds left or None, sentence) of all that was told."""
    from addon import final
    from addon.frame.bands import samples_in_parts
    from addon.frame.run import Renderer
    from addon.gfx import context
    from addon.snapshot import SnapshotCache, take
    from addon.techniques import make_registry
    from addon.ui.passes import wanted_passes
    from addon.ui.properties import settings_of

    scene = bpy.context.scene
    scene.render.engine, scene.candela.samples = "CANDELA", samples
    context.ensure()
    graph = bpy.context.evaluated_depsgraph_get()
    renderer, told = Renderer(make_registry), []
    layer = bpy.context.view_layer
    final.time = SimpleNamespace(perf_counter=clock)
    for _ in range(2):
        renderer.forget()
        told.clear()
        started = clock()
        settings = settings_of(scene, viewport=False, layer=layer, depsgraph=graph)
        order = final.Order(
            renderer, take(graph, SnapshotCache(), *size), settings, wanted_passes(layer, scene), samples_in_parts,
            shows=True, started=started,
        )  # fmt: skip
        for progress in final.steps(order):
            if progress is not None:
                told.append((clock() - started, progress.left, f"{progress.text} {progress.share}"))
        took = clock() - started
    final.time = time
    renderer.release()
    return took, told


def row(scene: str, samples: int, took: float, told: list[tuple[float, float | None, str]]) -> tuple[str, ...]:
    def factor(at: float, left: float) -> float:
        really = max(took - at, 1e-3)
        return max(left / really, really / max(left, 1e-3))

    counted = [(at, left) for at, left, _ in told if left is not None and at >= SHARE * took]
    changes = [0.0, *(at for k, (at, _, text) in enumerate(told) if k == 0 or text != told[k - 1][2]), took]
    stood = max(after - before for before, after in itertools.pairwise(changes))
    if not counted:
        return scene, str(samples), f"{took:.1f}", "-", "-", "-", "-", "-", f"{stood:.1f}"
    at, left = counted[0]
    worst = max(factor(at, left) for at, left in counted if took - at >= SHARE * took)
    return (
        scene, str(samples), f"{took:.1f}", f"{at:.1f}", f"{left:.1f}", f"{took - at:.1f}", f"{factor(at, left):.2f}",
        f"{worst:.2f}", f"{stood:.1f}",
    )  # fmt: skip


# ------------------------------------------------------------------------------------------------------------- command


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--only", nargs="+", default=SCENES, metavar="NAME", help="scenes, as of `bench beside`")
    parser.add_argument("--size", default=(256, 192), type=size_of, metavar="WxH", help="default 256x192")
    parser.add_argument("--samples", type=int, default=8)
    parser.add_argument(
        "--processor",
        action="store_true",
        help="seconds of all threads in place of the clock's: for software drivers, where other work runs beside",
    )


def command(options: argparse.Namespace) -> int:
    import addon
    from addon.cli.terminal import quiet

    addon.register()
    rows, clock = [], time.process_time if options.processor else time.perf_counter
    with quiet() as terminal:
        for scene in scenes_of(list(options.only)):
            bpy.ops.wm.open_mainfile(filepath=str(scene))
            rows.append(row(scene.stem, options.samples, *told_of(options.samples, options.size, clock)))
            print(*rows[-1], sep=" | ", file=terminal, flush=True)
    print(table([HEAD, *rows]))
    return 0
