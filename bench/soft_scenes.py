"""Six families of blockers for the benchmark of soft shadows (`bench/soft.py`): each is hard for another reason.

All stand on a white floor under one square light of 1 m, 4 m above it, and are seen in perspective. Everything is made
of numbers, so that a scene can be made at any size of picture and no file has to be kept.

| family | what is hard |
|---|---|
| thin poles | blockers thinner than the kernel, from the floor up: every penumbra from contact to 1 m |
| chain fence | wires of a texel, two layers close together |
| foliage | hundreds of leaves at all heights: no two blockers of a kernel at the same one |
| grid | bars across each other over the whole light: half of it is hidden nearly everywhere |
| far background | slats over a deep pit: kernels hold near blockers, the receiver and what lies far behind |
| stacked blockers | three plates above each other: what each hides alone does not add up |
"""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np

from .shading import one_shader

LIGHT_HEIGHT = 4.0
LIGHT_SIZE = 1.0


class Faces:
    """Quadrilaterals that grow into one mesh."""

    def __init__(self):
        self.vertices: list[np.ndarray] = []
        self.faces: list[tuple[int, ...]] = []

    def add(self, corners) -> None:
        """Four corners, (4, 3), in order around the face."""
        first = 4 * len(self.faces)
        self.vertices.extend(np.asarray(corners, float))
        self.faces.append((first, first + 1, first + 2, first + 3))

    def plate(self, low, high, z: float) -> None:
        (x0, y0), (x1, y1) = low, high
        self.add([(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)])

    def rod(self, start, end, half: float) -> None:
        """A prism of square section between two points."""
        start, end = np.asarray(start, float), np.asarray(end, float)
        axis = (end - start) / np.linalg.norm(end - start)
        helper = np.array([1.0, 0.0, 0.0]) if abs(axis[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
        u = np.cross(axis, helper)
        u *= half / np.linalg.norm(u)
        v = np.cross(axis, u)
        ring = [u + v, v - u, -u - v, u - v]
        for a, b in zip(ring, ring[1:] + ring[:1]):
            self.add([start + a, start + b, end + b, end + a])
        for point, order in ((start, ring), (end, ring[::-1])):
            self.add([point + corner for corner in order])


def _poles(blockers: Faces) -> None:
    for x, y in np.random.default_rng(1).uniform((-1.6, -0.9), (1.6, 1.2), (24, 2)):
        blockers.rod((x, y, 0.0), (x, y, 1.4), 0.012)


def _fence(blockers: Faces) -> None:
    for shift in np.arange(-4.0, 4.0, 0.14):
        for y, lean in ((0.0, 1.2), (0.03, -1.2)):
            low, high = np.array([shift - lean / 2, y, 0.05]), np.array([shift + lean / 2, y, 1.25])
            blockers.rod(low, high, 0.008)
    for x in (-1.8, 0.0, 1.8):
        blockers.rod((x, 0.015, 0.0), (x, 0.015, 1.3), 0.03)


def _foliage(blockers: Faces) -> None:
    random = np.random.default_rng(2)
    for _ in range(420):
        centre = random.normal((0.0, 0.0, 1.1), (0.55, 0.45, 0.35))
        centre[2] = max(centre[2], 0.25)
        turn, _ = np.linalg.qr(random.normal(size=(3, 3)))
        u, v = 0.09 * turn[0], 0.045 * turn[1]
        blockers.add([centre - u, centre - v, centre + u, centre + v])


def _grid(blockers: Faces) -> None:
    for place in np.arange(-2.4, 2.4, 0.24):
        blockers.plate((place, -2.4), (place + 0.1, 2.4), 1.2)
        blockers.plate((-2.4, place), (2.4, place + 0.1), 1.0)


def _slats(blockers: Faces) -> None:
    for x in np.arange(-1.2, 1.2, 0.22):
        blockers.plate((x, -1.5), (x + 0.07, 1.5), 1.2)


def _stack(blockers: Faces) -> None:
    for half, x, z in ((0.45, -0.2, 1.8), (0.55, 0.25, 1.1), (0.35, 0.0, 0.4)):
        blockers.plate((x - half, -half), (x + half, half), z)


def _floor(receivers: Faces) -> None:
    receivers.plate((-6.0, -6.0), (6.0, 6.0), 0.0)


def _pit(receivers: Faces) -> None:
    for x in np.arange(-3.0, 3.0, 0.4):
        receivers.plate((x, -6.0), (x + 0.26, 6.0), 0.0)
    receivers.plate((-8.0, -8.0), (8.0, 8.0), -9.0)


def _speck(below: Faces) -> None:
    below.plate((0.0, 0.0), (0.01, 0.01), -9.5)


FAMILIES: dict[str, tuple[Callable[[Faces], None], Callable[[Faces], None]]] = {
    "thin poles": (_poles, _floor),
    "chain fence": (_fence, _floor),
    "foliage": (_foliage, _floor),
    "grid": (_grid, _floor),
    "far background": (_slats, _pit),
    "stacked blockers": (_stack, _floor),
}


def build(family: str) -> bpy.types.Scene:
    """An empty Blender with the family's scene. Its light is the object "Light"; "Speck" lies where nobody sees it."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    white = one_shader("White", "ShaderNodeBsdfDiffuse", Color=(0.8, 0.8, 0.8, 1.0))
    for name, fill in zip(("Blockers", "Receivers", "Speck"), (*FAMILIES[family], _speck)):
        made = Faces()
        fill(made)
        mesh = bpy.data.meshes.new(name)
        mesh.from_pydata([tuple(vertex) for vertex in made.vertices], [], made.faces)
        mesh.materials.append(white)
        scene.collection.objects.link(bpy.data.objects.new(name, mesh))
    data = bpy.data.lights.new("Light", "AREA")
    data.size, data.energy = LIGHT_SIZE, 300.0
    light = bpy.data.objects.new("Light", data)
    light.location = (0.3, 0.2, LIGHT_HEIGHT)
    scene.collection.objects.link(light)
    data = bpy.data.cameras.new("Camera")
    data.angle = 0.75
    camera = bpy.data.objects.new("Camera", data)
    camera.location, camera.rotation_euler = (0.0, -4.6, 3.6), (0.92, 0.0, 0.0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.filter_size = 0.01  # a pixel is the value at its centre
    return scene
