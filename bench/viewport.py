"""Viewport: time to the first picture and to rest, and uploads, for each edit: `python -m bench.viewport`.

The figures are written into docs/viewport.md. The viewport is driven without a window, at 640 x 360 pixels, as
Blender's redraws drive it: `draw_frame` again and again. Blender's own part of a redraw is not in the figures; what
`make test-window` noted of a real window is told too.

An edit is made several times, as by a drag, and each followed by a redraw; the first LEARNING teach the viewport how
coarse it has to be, of the others the slowest is told. After turning the view the picture comes to rest. Uploads are
counted where Candela hands data to Blender's `gpu` module: bytes of images and uniform blocks, and meshes. What an edit
itself uploads is told apart from what the sample after it does, such as this sample's points of lights. Processor
seconds (of all threads) stand beside wall time, because they are steadier on a busy machine; on a software GPU that has
two cores to itself a step takes somewhat more than half of them.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import bpy
import numpy as np

from addon import register, viewport
from addon.gfx import context, images, library
from addon.gfx.struct import Block
from addon.snapshot import camera_of_scene, take
from addon.ui.properties import settings_of

from . import markdown
from .quick import table

ROOT = Path(__file__).resolve().parent.parent
SCENES = ROOT / "sample_blends"
PAGE = ROOT / "docs" / "viewport.md"
HEAD = "scene", "edit", "slowest, ms", "CPU ms", "pixels", "scene read", "meshes", "bytes", "the sample's"
SIZE = (640, 360)
FIELD = 2000  # objects in the scene of the move
LEARNING, MOVES = 3, 12


class Traffic:
    """Counts bytes handed to the GPU."""

    def __init__(self):
        self.bytes = 0
        self._watch(images, "upload", lambda pixels, *_: np.asarray(pixels).size * 4)
        self._watch(Block, "_bytes", lambda block: block.struct.dtype.itemsize)

    def _watch(self, owner, name: str, size: Callable) -> None:
        original = getattr(owner, name)

        def counted(*arguments):
            self.bytes += size(*arguments)
            return original(*arguments)

        setattr(owner, name, counted)


@dataclass
class Edit:
    """Figures of one edit."""

    name: str
    seconds: float  # of the slowest redraw
    cpu: float  # of all processors, in the redraw that took most of it
    scale: int  # screen pixels per side of a drawn pixel
    read: bool  # whether the scene was read
    meshes: int  # uploaded
    uploaded: int  # bytes, for the edit
    sample: int  # and for the sample after it


@dataclass
class Rest:
    """Figures of a picture that comes to rest."""

    seconds: float
    cpu: float
    redraws: int
    slowest: float  # redraw, s


class Driver:
    """A viewport over the open file."""

    def __init__(self, samples: int):
        self.traffic = Traffic()
        self.viewport = viewport.Viewport()
        self.scene = bpy.context.scene
        self.scene.candela.viewport_samples = samples
        self.camera = camera_of_scene(self.scene, self.graph, *SIZE)
        self.reads = self.begun = 0
        self._watch_edits()

    @property
    def graph(self):
        graph = bpy.context.evaluated_depsgraph_get()
        graph.update()
        return graph

    def _watch_edits(self) -> None:
        """Note what has been uploaded when a frame has begun, and no sample yet."""
        beginning = self.viewport.renderer.beginning

        def noted(*arguments):
            frame = yield from beginning(*arguments)
            self.begun = self.traffic.bytes
            return frame

        self.viewport.renderer.beginning = noted

    def read(self, camera, width, height):
        self.reads += 1
        return take(self.graph, self.viewport.cache, width, height, view=camera)

    def draw(self):
        """One redraw; seconds that it took."""
        before = time.perf_counter()
        self.viewport.draw_frame(self.read, self.camera, SIZE, settings_of(self.scene, viewport=True))
        return time.perf_counter() - before

    def rest(self) -> Rest:
        """Redraw until nothing is left to be done."""
        time.sleep(viewport.REST_S)
        cpu, wall, redraws = time.process_time(), time.perf_counter(), []
        while not self.viewport.done:
            redraws.append(self.draw())
        seconds, cpu = time.perf_counter() - wall, time.process_time() - cpu
        return Rest(seconds, cpu, len(redraws), max(redraws, default=0.0))

    def turn(self) -> None:
        """The view moves by a little."""
        matrix = self.camera.matrix.copy()
        matrix[:3, 3] += 0.01 * matrix[:3, 0]
        self.camera = replace(self.camera, matrix=matrix)

    def _tell(self, _scene, graph) -> None:
        """What Blender calls a viewport for, while the updates still stand in the graph."""
        self.viewport.cache.invalidate(graph.updates)
        self.viewport.dirty = True

    def edit(self, name: str, change: Callable[[], None], scene: bool = True) -> Edit:
        """Make the change and redraw, MOVES times."""
        wall, processors = [], []
        for _ in range(MOVES):
            change()
            if scene:
                bpy.app.handlers.depsgraph_update_post.append(self._tell)
                bpy.context.view_layer.update()
                bpy.app.handlers.depsgraph_update_post.remove(self._tell)
            self.traffic.bytes = self.begun = 0
            uploads, reads, cpu = self.viewport.renderer.geometry.uploads, self.reads, time.process_time()
            wall.append(self.draw())
            processors.append(time.process_time() - cpu)
        return Edit(
            name, max(wall[LEARNING:]), max(processors[LEARNING:]), self.viewport.scale, self.reads > reads,
            self.viewport.renderer.geometry.uploads - uploads, self.begun, self.traffic.bytes - self.begun,
        )  # fmt: skip


def field_of_objects() -> None:
    """FIELD objects in rows, each with a matrix of its own, under a lamp."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.object.camera_add(location=(0, -40, 25), rotation=(1.0, 0, 0))
    bpy.context.scene.camera = bpy.context.object
    bpy.ops.object.light_add(type="POINT", location=(0, 0, 20))
    bpy.context.object.data.energy = 20000
    bpy.ops.mesh.primitive_cube_add(size=0.6)
    one = bpy.context.object
    one.data.materials.append(bpy.data.materials.new("Clay"))
    for k in range(1, FIELD):
        copy = bpy.data.objects.new(f"Cube {k}", one.data)
        copy.location = k % 50 - 25, k // 50 - 20, 0
        bpy.context.collection.objects.link(copy)


def edits(driver: Driver) -> list[Edit]:
    """The edits of the scene that is open."""
    light = next(one for one in driver.scene.objects if one.type == "LIGHT")
    mesh = next(one for one in driver.scene.objects if one.type == "MESH" and one.active_material)
    material = mesh.active_material
    tree = material.node_tree
    shader = next(node for node in tree.nodes if node.type.startswith("BSDF"))

    def move():
        mesh.location.z += 0.01

    def brighten():
        light.data.energy *= 1.01

    def slide():
        shader.inputs["Roughness"].default_value = (shader.inputs["Roughness"].default_value + 0.01) % 1.0

    def select():
        mesh.select_set(not mesh.select_get())

    return [
        driver.edit("move an object", move),
        driver.edit("a light's power", brighten),
        driver.edit("a material's slider", slide),
        driver.edit("select", select),
    ]


def measure(name: str, samples: int, bounces: int) -> tuple[list[tuple[str, ...]], list[str]]:
    """Rows of the table for a sample scene, or for the field of objects, and sentences."""
    if name == "field":
        field_of_objects()
    else:
        bpy.ops.wm.open_mainfile(filepath=str(SCENES / f"{name}.blend"))
    bpy.context.scene.render.engine = "CANDELA"
    bpy.context.scene.candela.bounces = bounces
    driver = Driver(max(samples, 1))
    compiled, started = library.compile_count, time.perf_counter()
    driver.draw()
    seconds, programs = time.perf_counter() - started, library.compile_count - compiled
    told = [f"{name}: the first redraw took {seconds:.1f} s and compiled {programs} programs"]
    while driver.viewport.looks:  # the programs of a draft come in over many redraws
        driver.draw()
    drafted, compiled = time.perf_counter() - started, library.compile_count - compiled
    told.append(f"{name}: the first draft was there after {drafted:.1f} s and {compiled} programs")
    found = [driver.edit("turn the view", driver.turn, scene=False)]
    if samples:
        rest = driver.rest()
        told.append(
            f"{name}: at rest with {samples} samples {rest.seconds:.1f} s (CPU {rest.cpu:.1f} s) after the view has "
            f"turned, in {rest.redraws} redraws; the slowest took {1000 * rest.slowest:.0f} ms"
        )
    found += edits(driver)
    driver.viewport.release()
    rows = [
        (
            name, one.name, f"{1000 * one.seconds:.0f}", f"{1000 * one.cpu:.0f}", f"1/{one.scale}",
            "yes" if one.read else "no", str(one.meshes), str(one.uploaded), str(one.sample),
        )
        for one in found
    ]  # fmt: skip
    return rows, told


def in_a_window() -> list[str]:
    """What the last `make test-window` noted of real windows."""
    told = []
    for path in sorted(ROOT.glob("build/window/drive-*/result.json")):
        found = json.loads(path.read_text())
        moving = found.get("moving")
        if moving is None:
            continue
        width, height = found["viewport"][2:]
        told.append(
            f"window, {path.parent.name.removeprefix('drive-')}, {width} x {height}: first picture after "
            f"{found['first_picture_s']:.1f} s, at rest after {found['rest_s']:.0f} s ({found['status']}); while the "
            f"view turns {moving['steps_per_s']:.1f} steps per second, of which half take less than "
            f"{1000 * moving['median_step_s']:.0f} ms and all less than {1000 * moving['slowest_step_s']:.0f} ms, at "
            f"1/{', 1/'.join(map(str, moving['scales']))} resolution, and {moving['meshes_uploaded']} meshes are "
            "uploaded"
        )
    return told


def write_page(rows: list[tuple[str, ...]], told: list[str]) -> None:
    """Replace the figures of docs/viewport.md."""
    figures = "\n".join([markdown.table([HEAD, *rows]), "", *(f"- {sentence}" for sentence in told)])
    markdown.put_between(PAGE, "python -m bench.viewport", figures)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("scenes", nargs="*", default=["soft_shadow_garden", "window_interior", "field"])
    parser.add_argument("--samples", type=int, default=2, help="samples until the picture rests; 0: edits alone")
    parser.add_argument("--bounces", type=int, default=16)
    parser.add_argument("--dry", action="store_true", help="print the figures alone")
    options = parser.parse_args()
    register()
    context.ensure()
    rows, told = [], []
    for name in options.scenes:
        found, sentences = measure(name, options.samples, options.bounces)
        rows += found
        told += sentences
    told += in_a_window()
    print(*told, table([HEAD, *rows]), sep="\n")
    if not options.dry:
        write_page(rows, told)


if __name__ == "__main__":
    main()
