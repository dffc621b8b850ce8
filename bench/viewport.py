"""Viewport: time to the first picture and to rest, and uploads, for each edit: `python -m bench.viewport`.

The viewport is driven without a window, at 640 x 360 pixels, as Blender's redraws drive it: `draw_frame` again and
again. Blender's own part of a redraw is not in the figures; `make test-window` notes those of a real window.

An edit is made, then redrawn until the picture rests. Uploads are counted where Candela hands data to Blender's `gpu`
module: images, uniform blocks and vertex buffers. Processor seconds (of all threads) stand beside wall time, because
they are steadier on a busy machine; on a software GPU that has two cores to itself a step takes somewhat more than half
of them.
"""

from __future__ import annotations

import argparse
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

from .quick import table

SCENES = Path(__file__).resolve().parent.parent / "sample_blends"
SIZE = (640, 360)
FIELD = 2000  # objects in the scene of the move
MOVES = 6


class Traffic:
    """Counts bytes handed to the GPU, by kind."""

    def __init__(self):
        self.bytes: dict[str, int] = {}
        self._watch(images, "upload", "images", lambda pixels, *_: np.asarray(pixels).size * 4)
        self._watch(Block, "_bytes", "blocks", lambda block: block.struct.dtype.itemsize)

    def _watch(self, owner, name: str, kind: str, size: Callable) -> None:
        original = getattr(owner, name)

        def counted(*arguments):
            self.bytes[kind] = self.bytes.get(kind, 0) + size(*arguments)
            return original(*arguments)

        setattr(owner, name, counted)


@dataclass
class Edit:
    """Figures of one edit: seconds of wall time and of all processors, pixels a side, bytes."""

    name: str
    first: float
    first_cpu: float
    scale: int
    rest: float
    rest_cpu: float
    uploaded: dict[str, int]
    meshes: int
    read: bool
    slowest: float  # redraw at rest, s


class Driver:
    """A viewport over the open file."""

    def __init__(self, samples: int):
        self.traffic = Traffic()
        self.viewport = viewport.Viewport()
        self.scene = bpy.context.scene
        self.scene.candela.viewport_samples = samples
        self.camera = camera_of_scene(self.scene, self.graph, *SIZE)
        self.reads = 0

    @property
    def graph(self):
        graph = bpy.context.evaluated_depsgraph_get()
        graph.update()
        return graph

    def read(self, camera, width, height):
        self.reads += 1
        return take(self.graph, self.viewport.cache, width, height, view=camera)

    def draw(self):
        """One redraw; seconds that it took."""
        before = time.perf_counter()
        self.viewport.draw_frame(self.read, self.camera, SIZE, settings_of(self.scene, viewport=True))
        return time.perf_counter() - before

    def rest(self) -> float:
        """Redraw until nothing is left; the slowest redraw."""
        time.sleep(viewport.REST_S)
        slowest = 0.0
        while not self.viewport.done:
            slowest = max(slowest, self.draw())
        return slowest

    def turn(self) -> None:
        """The view moves by a little."""
        matrix = self.camera.matrix.copy()
        matrix[:3, 3] += 0.01 * matrix[:3, 0]
        self.camera = replace(self.camera, matrix=matrix)

    def edit(self, name: str, change: Callable[[], None], scene: bool = True) -> Edit:
        """Make the change, and wait for the first picture and for rest. The change is made MOVES times, as by a drag;
        what is told is the last, when the viewport knows how coarse it has to be."""
        for _ in range(MOVES):
            change()
            if scene:
                self.viewport.cache.invalidate(self.graph.updates)
                self.viewport.dirty = True
            self.traffic.bytes.clear()
            uploads, reads = self.viewport.renderer.geometry.uploads, self.reads
            cpu, wall = time.process_time(), time.perf_counter()
            self.draw()
            first, first_cpu = time.perf_counter() - wall, time.process_time() - cpu
        uploaded, scale = dict(self.traffic.bytes), self.viewport.scale
        meshes, read = self.viewport.renderer.geometry.uploads - uploads, self.reads > reads
        slowest = self.rest()
        rest, rest_cpu = time.perf_counter() - wall, time.process_time() - cpu
        return Edit(name, first, first_cpu, scale, rest, rest_cpu, uploaded, meshes, read, slowest)


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
        driver.edit("turn the view", driver.turn, scene=False),
        driver.edit("move an object", move),
        driver.edit("a light's power", brighten),
        driver.edit("a material's slider", slide),
        driver.edit("select", select),
    ]


def measure(name: str, samples: int) -> list[tuple[str, ...]]:
    """Rows of the table for a sample scene, or for the field of objects."""
    if name == "field":
        field_of_objects()
    else:
        bpy.ops.wm.open_mainfile(filepath=str(SCENES / f"{name}.blend"))
    bpy.context.scene.render.engine = "CANDELA"
    driver = Driver(samples)
    compiled, started = library.compile_count, time.perf_counter()
    driver.draw()
    print(f"{name}: first picture after {time.perf_counter() - started:.1f} s, "
          f"{library.compile_count - compiled} programs compiled")  # fmt: skip
    driver.rest()
    rows = []
    for one in edits(driver):
        rows.append((
            name, one.name, f"{1000 * one.first:.0f}", f"{1000 * one.first_cpu:.0f}", f"1/{one.scale}",
            f"{one.rest:.1f}", f"{one.rest_cpu:.1f}", f"{1000 * one.slowest:.0f}", "yes" if one.read else "no",
            str(one.meshes), str(one.uploaded.get("blocks", 0)), str(one.uploaded.get("images", 0)),
        ))  # fmt: skip
    driver.viewport.release()
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("scenes", nargs="*", default=["soft_shadow_garden", "window_interior", "field"])
    parser.add_argument("--samples", type=int, default=4, help="samples until the picture rests")
    options = parser.parse_args()
    register()
    context.ensure()
    head = (
        "scene", "edit", "first ms", "CPU ms", "pixels", "rest s", "CPU s", "slowest ms", "scene read", "meshes",
        "block bytes", "image bytes",
    )  # fmt: skip
    rows = [row for name in options.scenes for row in measure(name, options.samples)]
    print(table([head, *rows]))


if __name__ == "__main__":
    main()
