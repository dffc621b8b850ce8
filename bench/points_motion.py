"""Light gathered at points while something moves, frame by frame beside Cycles: `python -m bench points_motion`.

For micro-rendering, implicit visibility and instant radiosity, one sample a frame of the Cornell box while the camera
turns, the lamp moves, the smallest object turns or the tallest bends: what the ledger says was redone and kept from the
second frame on, the error of a frame, and how much of it is new: half the mean square of the error's change from one
frame to the next, 0 where errors stand still. `--others` adds peers. `--page` writes each technique's rows into its
page.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from bench import indirect, markdown
from bench.moving import new_in_it, of_frame, scale_of

DOCS = Path(__file__).resolve().parent.parent / "docs"
COMMAND = "python -m bench points_motion --page"
TECHNIQUES = ("micro_rendering", "implicit_visibility")
OTHERS = ("instant_radiosity",)
PEERS = ("imperfect_shadow_maps", "clustered_visibility", "ssdo")
SCENE, SIZE, REFERENCE = "cornell_box", (48, 32), 64
REDONE, KEPT = ("made", "shaded", "refitted", "rays", "gathers"), ("kept",)
HEAD = ("what moves", "redone, a frame", "kept", "error of a frame", "new error")
BENT = 3.0  # degrees a frame


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--frames", type=int, default=24, metavar="N", help="default 24")
    parser.add_argument("--techniques", nargs="+", default=TECHNIQUES, metavar="NAME")
    parser.add_argument("--moves", nargs="+", default=tuple(MOVES), choices=tuple(MOVES))
    parser.add_argument("--others", nargs="*", default=OTHERS, metavar="NAME", help=f"more: {', '.join(PEERS)}")
    parser.add_argument("--page", action="store_true", help="write the rows into the techniques' pages")


def command(options: argparse.Namespace) -> int:
    import addon

    addon.register()
    head = (*HEAD, *(word for other in options.others for word in (other.replace("_", " "), "new error")))
    rows: dict[str, list[tuple[str, ...]]] = {name: [head] for name in options.techniques}
    for label in options.moves:
        for name, row in of_motion(label, options).items():
            rows[name].append(row)
            print(name, *row, sep="  ", flush=True)
    if options.page:
        for name, found in rows.items():
            text = f"{options.frames} frames.\n\n{markdown.table(found)}"
            markdown.put_between(DOCS / f"{name}.md", COMMAND, text)
    return 0


def moved_camera(scene) -> None:
    from mathutils import Matrix

    scene.camera.matrix_world = scene.camera.matrix_world @ Matrix.Rotation(np.radians(indirect.TURN), 4, "Y")


def moved_light(scene) -> None:
    light = next(thing for thing in scene.objects if thing.type == "LIGHT")
    light.location.x += 0.02


def moved_object(scene) -> None:
    """The smallest mesh turns."""
    meshes = [thing for thing in scene.objects if thing.type == "MESH"]
    min(meshes, key=lambda thing: thing.dimensions.length).rotation_euler.z += 0.05


def bent_object(scene) -> None:
    """The tallest mesh that is no wall bends a little further, with enough faces to do so."""
    import bpy

    meshes = sorted((thing for thing in scene.objects if thing.type == "MESH"), key=lambda thing: thing.dimensions.z)
    room = max(thing.dimensions.length for thing in meshes)
    tall = [thing for thing in meshes if thing.dimensions.length < 0.5 * room][-1]
    if "Bend" not in tall.modifiers:
        fine = tall.modifiers.new("Fine", "SUBSURF")
        fine.subdivision_type, fine.levels, fine.render_levels = "SIMPLE", 3, 3
        bend = tall.modifiers.new("Bend", "SIMPLE_DEFORM")
        bend.deform_method, bend.deform_axis, bend.angle = "BEND", "X", 0.0
        bpy.context.view_layer.update()
    tall.modifiers["Bend"].angle += np.radians(BENT)


MOVES = {"camera": moved_camera, "light": moved_light, "object": moved_object, "bending object": bent_object}


def of_motion(label: str, options: argparse.Namespace) -> dict[str, tuple[str, ...]]:
    """A row for each technique."""
    techniques, move = options.techniques, MOVES[label]
    errors: dict[str, list[np.ndarray]] = {name: [] for name in (*techniques, *options.others)}
    counters: dict[str, list[dict]] = {name: [] for name in techniques}
    truths = []
    for pictures, counted, truth in frames(move, techniques, options.others, options.frames):
        for name, picture in pictures.items():
            errors[name].append(picture - truth)
        for name in techniques:
            counters[name].append(counted[name])
        truths.append(truth)
    scale = scale_of(truths)
    figures = {
        name: (f"{of_frame(found, scale):.4f}", f"{new_in_it(found, scale):.4f}") for name, found in errors.items()
    }
    others = [figure for other in options.others for figure in figures[other]]
    return {
        name: (label, told(counters[name][1:], REDONE), told(counters[name][1:], KEPT), *figures[name], *others)
        for name in techniques
    }


def told(counted: list[dict], words: tuple[str, ...]) -> str:
    """Counters that hold one of these words, as means over the frames."""
    names = sorted({name for one in counted for name in one if any(word in name for word in words)})
    means = {name: sum(one.get(name, 0) for one in counted) / max(len(counted), 1) for name in names}
    return ", ".join(f"{mean:.0f} {name}" for name, mean in means.items() if mean > 0.0) or "nothing"


def frames(move: Callable, techniques, others, count: int) -> Iterator[tuple[dict, dict, np.ndarray]]:
    """Pictures and counters by technique, and Cycles' picture. Each technique renders its frames one after the other,
    so that what it keeps is that of its last frame."""
    import bpy

    from addon.frame import ledger

    pictures: list[dict] = [{} for _ in range(count)]
    counted: list[dict] = [{} for _ in range(count)]
    truths = []
    for name in (None, *techniques, *others):
        bpy.ops.wm.open_mainfile(filepath=str(indirect.SCENES / f"{SCENE}.blend"))
        scene = bpy.context.scene
        for number in range(count):
            if number:
                move(scene)
            if name is None:
                truths.append(indirect.reference(scene, REFERENCE, SIZE)[0])
                continue
            scene.candela.slot_indirect = name
            pictures[number][name] = indirect.render(scene, "CANDELA", 1, 1, SIZE)
            counted[number][name] = dict(ledger.latest().row(name).counters)
    yield from zip(pictures, counted, truths)
