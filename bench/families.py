"""Procedural scenes with a size dial, each for the light path whose cost and error the dial drives.

`build(name, dial)` makes one in an empty Blender. A dial changes one thing and leaves the rest as near as it can: more
lamps share the same power, finer terrain keeps its shape, more slats keep the share of light that passes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import bpy
import numpy as np

from sample_blends.scenes.construct import camera, diffuse, finish, glossy, light, place, solid, world
from sample_blends.scenes.construct import mesh as mesh_of
from sample_blends.scenes.shapes import Shape, ball, box, grid, join, plane


@dataclass(frozen=True)
class Family:
    """Scenes that differ in one dial. `path` is the light path that they test."""

    name: str
    path: str
    dial: str  # what the dial counts
    values: tuple[float, ...]
    build: Callable[[float], None]

    @property
    def middle(self) -> float:
        return self.values[len(self.values) // 2]


def _stage(height: float = 6.0) -> None:
    """A floor, seen from above and in front."""
    solid("Floor", plane(24, 24), diffuse("Floor", (0.6, 0.6, 0.6)))
    camera((0.0, -9.0, height), (0.0, 0.0, 0.4), lens=36)
    world((0.0, 0.0, 0.0), strength=0.0)


def lights(count: float) -> None:
    """`count` small disc lights over balls, of 300 W together."""
    _stage()
    shape = mesh_of("Ball", ball(0.4, 24, 12), diffuse("Ball", (0.7, 0.5, 0.35)), smooth_below=60)
    for x in np.linspace(-3, 3, 5):
        for y in np.linspace(-2, 3, 4):
            place(shape, "Ball", location=(x, y, 0.4))
    count = int(count)
    around = np.arange(count)
    radius, angle = 3.5 * np.sqrt((around + 0.5) / count), around * np.pi * (3 - np.sqrt(5))  # Vogel's spiral
    for number, (x, y) in enumerate(zip(radius * np.cos(angle), radius * np.sin(angle))):
        light(
            f"Lamp {number}", "AREA", (x, y + 0.5, 3.0), (x, y + 0.5, 0.0), 300 / count, (1.0, 0.9, 0.8),
            shape="DISK", size=0.4,
        )  # fmt: skip


def triangles(count: float) -> None:
    """A terrain of about `count` triangles under a low sun with a width."""
    world((0.05, 0.07, 0.1), strength=1.0)
    side = max(2, round(np.sqrt(count / 2)))

    def terrain(u, v):
        x, y = 12 * (u - 0.5), 12 * (v - 0.5)
        z = 0.5 * np.sin(1.7 * x) * np.cos(1.3 * y) + 0.16 * np.sin(5.1 * x + 1) * np.sin(4.7 * y)
        return np.stack([x, y, z], axis=-1)

    solid("Terrain", grid(side, side, terrain), diffuse("Earth", (0.5, 0.42, 0.3)), smooth_below=180)
    light("Sun", "SUN", (-6, -2, 3), (0, 0, 0), 4.0, (1.0, 0.85, 0.7), angle=np.radians(3))
    camera((0.0, -9.5, 5.5), (0.0, 0.0, 0.0), lens=36)


def layers(count: float) -> None:
    """`count` layers of slats between a square light and the floor: depth complexity of the light's maps."""
    _stage()
    count = int(count)
    paint = diffuse("Slat", (0.3, 0.25, 0.2))
    gap = 1.0 - 0.5 ** (1.0 / count)  # what one layer blocks, so that half of the light passes all of them
    generator = np.random.default_rng(1)
    for layer in range(count):
        height = 0.8 + 2.2 * (layer + 0.5) / count
        step = 0.5
        shifts = generator.uniform(-0.5, 0.5)
        slats = [box(gap * step, 6.0, 0.01).moved(x=step * (k + shifts)) for k in range(-7, 8)]
        whole = join(slats).turned("z", 37.0 * layer)
        solid(f"Layer {layer}", whole, paint, location=(0, 0, height))
    light("Ceiling", "AREA", (0, 0, 4.5), (0, 0, 0), 500, shape="SQUARE", size=1.5)


def roughness(value: float) -> None:
    """Metal plates of the given roughness, each tilted so that it mirrors strip lights into the camera (Veach 1997)."""
    _stage()
    metal = glossy("Metal", (0.9, 0.85, 0.75), value)
    eye, strips = np.array([0.0, -9.0, 6.0]), np.array([0.0, 3.5, 4.0])
    for number in range(4):
        middle = np.array([0.0, 2.0 - 1.3 * number, 1.2 - 0.3 * number])
        half = sum((to - middle) / np.linalg.norm(to - middle) for to in (eye, strips))
        tilt = np.degrees(np.arctan2(-half[1], half[2]))
        solid(f"Plate {number}", plane(5.5, 1.1), metal, location=middle, rotation_degrees=(tilt, 0, 0))
    for x, width in zip((-2.4, -0.8, 0.8, 2.4), (0.05, 0.2, 0.5, 1.0)):
        light(f"Strip {x}", "AREA", (x, strips[1], strips[2]), (x, 0, 1.0), 60, shape="SQUARE", size=width)


def bounces(count: float) -> None:
    """A white closed room whose lamp shines at the ceiling: nearly all light is reflected, up to `count` times."""
    paint = diffuse("White", (0.8, 0.8, 0.8))
    solid("Room", _inside(box(6, 8, 4)), paint)
    solid("Table", box(1.6, 1.0, 0.8), diffuse("Red", (0.7, 0.15, 0.1)), location=(-0.8, 1.2, 0.0))
    solid("Shelf", box(0.8, 0.8, 2.2), diffuse("Blue", (0.15, 0.2, 0.6)), location=(1.6, 1.8, 0.0))
    light("Uplight", "SPOT", (0, 0.5, 2.6), (0, 0.5, 4.0), 250, spot_size=np.radians(120), shadow_soft_size=0.1)
    camera((0.0, -3.7, 1.8), (0.0, 1.0, 1.4), lens=22)
    world((0.0, 0.0, 0.0), strength=0.0)
    bpy.context.scene.candela.bounces = int(count)


def _inside(shape: Shape) -> Shape:
    """The shape seen from inside: faces turned round."""
    return Shape(shape.vertices, [tuple(face)[::-1] for face in shape.faces])


FAMILIES = {
    family.name: family
    for family in (
        Family("lights", "diffuse direct", "lamps", (1, 4, 16, 64, 256), lights),
        Family("triangles", "diffuse direct", "triangles", (2e3, 16e3, 128e3, 1e6), triangles),
        Family("layers", "diffuse direct", "layers of blockers", (1, 4, 16, 64), layers),
        Family("roughness", "glossy direct", "roughness", (0.05, 0.1, 0.2, 0.4, 0.8), roughness),
        Family("bounces", "diffuse indirect", "bounces", (1, 2, 4, 8, 16), bounces),
    )
}


def build(name: str, dial: float) -> None:
    """Empty Blender and make a member of a family. KeyError if there is no such family."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.scene.name = f"{name} {dial:g}"
    FAMILIES[name].build(dial)
    finish()
