"""Twenty-five scenes on which Auto's choices are checked (`bench/auto.py`). None is a sample scene of the project.

One constant of Auto's weighing, the film's error at outlines (FILM in `addon/lighting/shadow_costs.py`), was fitted to
the mean of fifteen of them, so that these do not test it independently.

Twelve are rooms, where light arrives by walls, and thirteen stand in the open, where shadows decide. All are made of
numbers.
"""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np

from .edge_scenes import Set, _material
from .shading import one_shader

WHITE, RED, GREEN = (0.75, 0.73, 0.7, 1), (0.6, 0.12, 0.1, 1), (0.15, 0.5, 0.2, 1)


def _painted(color) -> bpy.types.Material:
    return one_shader("Paint", "ShaderNodeBsdfDiffuse", Color=color)


class Walls(Set):
    """A scene of boxes, of which each may have a colour."""

    def block(self, low, high, color=WHITE):
        low, high = np.array(low, float), np.array(high, float)
        return self.add("cube", tuple((low + high) / 2), scale=tuple(high - low), size=1.0, material=_painted(color))

    def room(self, x: float, y: float, z: float, sides=(RED, GREEN), front=True, roof=True):
        """Walls of .2 m around (-x, x) x (-y, y) x (0, z)."""
        self.block((-x - 0.2, -y - 0.2, -0.2), (x + 0.2, y + 0.2, 0))
        if roof:
            self.block((-x - 0.2, -y - 0.2, z), (x + 0.2, y + 0.2, z + 0.2))
        self.block((-x - 0.2, -y, 0), (-x, y, z), sides[0])
        self.block((x, -y, 0), (x + 0.2, y, z), sides[1])
        self.block((-x - 0.2, y, 0), (x + 0.2, y + 0.2, z))
        if front:
            self.block((-x - 0.2, -y - 0.2, 0), (x + 0.2, -y, z))

    def sky(self, color, strength: float):
        world = self.scene.world = bpy.data.worlds.new("World")
        if hasattr(world, "use_nodes") and world.node_tree is None:
            world.use_nodes = True
        background = next(node for node in world.node_tree.nodes if node.type == "BACKGROUND")
        background.inputs["Color"].default_value, background.inputs["Strength"].default_value = (*color, 1), strength

    def sun(self, place, degrees: float, energy=4.0):
        self.lamp("SUN", place, (0, 0, 0), energy=energy, angle=np.radians(degrees))

    def cards(self, count: int, centre, spread, size: float, color, seed: int):
        """Quadrilaterals at random, as one mesh."""
        random = np.random.default_rng(seed)
        corners = []
        for _ in range(count):
            turn, _ = np.linalg.qr(random.normal(size=(3, 3)))
            place = random.normal(centre, spread)
            place[2] = max(place[2], 0.1 + size)
            corners += [place + size * (a * turn[0] + b * turn[1]) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        mesh = bpy.data.meshes.new("Leaves")
        mesh.from_pydata([tuple(p) for p in corners], [], [tuple(range(4 * k, 4 * k + 4)) for k in range(count)])
        mesh.materials.append(_painted(color))
        self.scene.collection.objects.link(bpy.data.objects.new("Leaves", mesh))


def corridor() -> Set:
    made = Walls((0, -4.6, 1.5), (0, 4, 1.2), 1.0)
    made.room(1, 5, 2.6, (WHITE, WHITE))
    for thing in [one for one in made.scene.objects if one.type == "MESH" and one.location.x > 1.05]:
        bpy.data.objects.remove(thing)
    for low, high in (((1, -5, 0), (1.2, 1, 2.6)), ((1, 2, 0), (1.2, 5, 2.6)), ((1, 1, 2.1), (1.2, 2, 2.6))):
        made.block(low, high)
    for low, high in (
        ((1.2, 0, -0.2), (3.2, 3, 0)), ((1.2, 0, 2.6), (3.2, 3, 2.8)), ((3.2, 0, 0), (3.4, 3, 2.6)),
        ((1.2, -0.2, 0), (3.4, 0, 2.6)), ((1.2, 3, 0), (3.4, 3.2, 2.6)),
    ):  # fmt: skip
        made.block(low, high, (0.7, 0.55, 0.35, 1))
    made.lamp("AREA", (2.2, 1.5, 2.5), size=0.6, energy=90.0)
    return made


def closet() -> Set:
    made = Walls((0, -1.9, 1.3), (0, 1, 1.0), 1.1)
    made.room(1.2, 2, 2.4)
    made.block((-0.9, 0.4, 0), (-0.2, 1.1, 1.4))
    made.block((0.2, -0.2, 0), (0.9, 0.5, 0.7))
    made.lamp("AREA", (0, 0.3, 2.35), size=0.5, energy=60.0)
    return made


def attic() -> Set:
    made = Walls((0, -2.8, 1.4), (0, 2, 1.0), 1.1)
    made.room(2, 3, 2.4, (WHITE, WHITE), roof=False)
    for low, high in (
        ((-2.2, -3.2, 2.4), (0, 3.2, 2.6)),
        ((0, -3.2, 2.4), (2.2, 0.5, 2.6)),
        ((0, 1.5, 2.4), (2.2, 3.2, 2.6)),
    ):
        made.block(low, high)
    made.block((-1.5, 1, 0), (-0.7, 1.8, 0.8), RED)
    made.sun((1.5, 0.3, 5), 1.0, 12.0)
    return made


def cellar() -> Set:
    made = Walls((0, -2.4, 1.4), (0, 1, 0.8), 1.1)
    made.room(1.8, 2.5, 2.2, (WHITE, WHITE))
    for thing in [one for one in made.scene.objects if one.type == "MESH" and one.location.x > 1.85]:
        bpy.data.objects.remove(thing)
    for low, high in (
        ((1.8, -2.5, 0), (2, 2.5, 1.5)), ((1.8, -2.5, 1.5), (2, 0, 2.2)), ((1.8, 1.2, 1.5), (2, 2.5, 2.2))
    ):  # fmt: skip
        made.block(low, high)
    made.block((-1.2, 0.8, 0), (-0.3, 1.6, 0.9), (0.5, 0.35, 0.2, 1))
    made.sky((0.6, 0.8, 1.0), 6.0)
    return made


def shelf() -> Set:
    made = Walls((0, -2.6, 1.2), (0, 1.5, 1.0), 1.0)
    made.room(1.6, 2.8, 2.4, (WHITE, WHITE))
    for z in (0.4, 0.9, 1.4, 1.9):
        made.block((-1.4, 2.2, z), (1.4, 2.8, z + 0.04), (0.5, 0.35, 0.2, 1))
        for k, x in enumerate(np.linspace(-1.2, 1.1, 7)):
            made.block((x, 2.3, z + 0.04), (x + 0.14, 2.7, z + 0.2 + 0.03 * (k % 4)), (RED, GREEN, WHITE)[k % 3])
    made.lamp("POINT", (0.3, 0, 2.0), shadow_soft_size=0.12, energy=80.0, use_soft_falloff=False)
    return made


def pillars() -> Set:
    made = Walls((0, -4.5, 1.8), (0, 2, 1.2), 1.0)
    made.room(3, 5, 3.2)
    for x in (-1.5, 1.5):
        for y in (-2, 0, 2, 4):
            made.add("cylinder", (x, y, 1.6), vertices=20, radius=0.25, depth=3.2, material=_painted(WHITE))
    made.lamp("AREA", (0, 1, 3.1), shape="RECTANGLE", size=0.4, size_y=4.0, energy=150.0)
    return made


def lampshade() -> Set:
    made = Walls((0, -2.6, 1.2), (0, 1.5, 1.1), 1.0)
    made.room(1.8, 2.8, 2.4)
    made.add("cylinder", (0.3, 0.8, 1.3), vertices=24, radius=0.35, depth=0.5, end_fill_type="NOTHING",
             material=_painted((0.6, 0.5, 0.3, 1)))  # fmt: skip
    made.lamp("POINT", (0.3, 0.8, 1.3), shadow_soft_size=0.06, energy=60.0, use_soft_falloff=False)
    return made


def glossy_room() -> Set:
    made = Walls((0, -2.6, 1.4), (0, 1, 0.8), 1.0)
    made.room(2, 2.8, 2.4)
    made.add("plane", (0, 0, 0.002), size=3.9, material=_material("Gloss", 0.25))
    made.add("uv_sphere", (-0.5, 0.8, 0.5), radius=0.5, segments=32, ring_count=16, material=_material("Ball", 0.4))
    made.block((0.5, 0.6, 0), (1.1, 1.2, 1.1), RED)
    made.lamp("AREA", (0, 0.5, 2.35), size=0.8, energy=80.0)
    return made


def stairs() -> Set:
    made = Walls((0, -2.6, 2.0), (0, 1.5, 1.0), 1.1)
    made.room(1.4, 2.8, 3.4, (WHITE, (0.6, 0.5, 0.2, 1)))
    for k in range(9):
        made.block((-0.8, -0.4 + 0.3 * k, 0), (0.8, -0.1 + 0.3 * k, 0.2 * (k + 1)), (0.55, 0.4, 0.3, 1))
    made.lamp("SPOT", (0.9, -2, 3.2), (0, 1, 0.8), spot_size=1.1, shadow_soft_size=0.15, energy=400.0)
    return made


def tubes() -> Set:
    made = Walls((0, -3.6, 1.5), (0, 2, 0.9), 1.1)
    made.room(2.6, 4, 2.6, (WHITE, WHITE))
    for x, y in ((-1.2, 0), (0.2, 0.6), (1.3, -0.4), (0, 2)):
        made.block((x - 0.4, y - 0.3, 0), (x + 0.4, y + 0.3, 0.75), (0.45, 0.3, 0.2, 1))
    for x in (-1.5, -0.5, 0.5, 1.5):
        made.lamp("AREA", (x, 1, 2.55), shape="RECTANGLE", size=0.08, size_y=1.5, energy=25.0)
    return made


def tree() -> Set:
    made = Walls((0, -6, 2.2), (0, 0, 1.4), 0.8)
    made.floor(20)
    made.add("cylinder", (0, 0, 0.8), vertices=12, radius=0.12, depth=1.6, material=_painted((0.3, 0.2, 0.1, 1)))
    made.cards(300, (0, 0, 1.9), (0.5, 0.5, 0.35), 0.09, (0.15, 0.4, 0.1, 1), 3)
    made.sun((2, -2, 4), 2.0)
    made.sky((0.5, 0.7, 1), 0.3)
    return made


def hedge() -> Set:
    made = Walls((0, -4, 1.8), (0, 0, 0.5), 0.8)
    made.floor(12)
    made.cards(350, (0, 0.3, 0.6), (1.3, 0.2, 0.3), 0.07, (0.1, 0.35, 0.1, 1), 4)
    made.lamp("POINT", (0.8, 1.6, 2.6), shadow_soft_size=0.3, energy=200.0, use_soft_falloff=False)
    return made


def fence() -> Set:
    made = Walls((1, -4, 1.6), (0, 0, 0.4), 0.8)
    made.floor(16)
    for x in np.arange(-3, 3, 0.22):
        made.block((x, -0.02, 0), (x + 0.1, 0.02, 0.9), WHITE)
    made.block((-3, 0.02, 0.5), (3, 0.05, 0.58), RED)
    made.sun((-1.5, 2, 1.8), 0.53)
    made.sky((0.5, 0.7, 1), 0.4)
    return made


def canyon() -> Set:
    made = Walls((0, -14, 2), (0, 4, 4), 1.0)
    made.floor(60, _painted((0.3, 0.3, 0.32, 1)))
    random = np.random.default_rng(5)
    for k in range(8):
        for side in (-1, 1):
            x, height = side * 4.0, random.uniform(5, 11)
            made.block((x - 1.5, -9 + 4 * k, 0), (x + 1.5, -5.4 + 4 * k, height), ((0.6, 0.5, 0.4, 1), RED)[k % 2])
    made.sun((3, -1, 5), 0.53, 5.0)
    made.sky((0.4, 0.6, 1), 0.8)
    return made


def pergola() -> Set:
    made = Walls((0, -4.5, 1.6), (0, 0, 0.8), 0.9)
    made.floor(16)
    for x in np.arange(-2, 2.01, 0.4):
        made.block((x - 0.05, -1.5, 2.2), (x + 0.05, 1.5, 2.35))
    for x, y in ((-1.9, -1.4), (1.9, -1.4), (-1.9, 1.4), (1.9, 1.4)):
        made.block((x - 0.08, y - 0.08, 0), (x + 0.08, y + 0.08, 2.2))
    made.lamp("AREA", (1, -0.5, 5), (0, 0, 0), size=1.6, energy=900.0)
    return made


def rocks() -> Set:
    made = Walls((0, -5, 2.2), (0, 0, 0.4), 0.8)
    made.floor(16)
    random = np.random.default_rng(6)
    for _ in range(30):
        x, y, size = random.uniform(-2, 2), random.uniform(-1.5, 2.5), random.uniform(0.1, 0.45)
        made.add("ico_sphere", (x, y, 0.6 * size), tuple(random.uniform(0, 6, 3)), (size, 0.8 * size, 0.7 * size),
                 subdivisions=2, radius=1.0, material=_painted((0.45, 0.4, 0.35, 1)))  # fmt: skip
    made.sun((3, 1, 2), 4.0)
    made.sky((0.7, 0.8, 1), 0.5)
    return made


def ball() -> Set:
    made = Walls((0, -4, 1.8), (0, 0, 0.5), 0.7)
    made.floor(10)
    made.add("uv_sphere", (0, 0, 0.55), radius=0.5, segments=32, ring_count=16)
    made.lamp("POINT", (1.2, -0.6, 2.2), shadow_soft_size=0.4, energy=150.0, use_soft_falloff=False)
    return made


def rings() -> Set:
    made = Walls((0, -4, 2.4), (0, 0, 0.4), 0.8)
    made.floor(10, _material("Gloss", 0.35))
    for k in range(5):
        made.add("torus", (-1.4 + 0.7 * k, 0.2 * k, 0.45), (1.2, 0.3 * k, 0.5 * k), major_radius=0.35,
                 minor_radius=0.07, major_segments=28, minor_segments=10)  # fmt: skip
    made.lamp("AREA", (0, -1, 3), (0, 0, 0), shape="RECTANGLE", size=3.0, size_y=0.15, energy=180.0)
    return made


def heads() -> Set:
    made = Walls((0, -4.4, 1.6), (0, 0, 0.5), 0.8)
    made.floor(12)
    for k, x in enumerate((-1.4, -0.3, 0.8, 1.7)):
        made.add("monkey", (x, 0.4 * (k % 2), 0.5), (0, 0, 0.5 * k - 0.7), size=0.9)
    made.lamp("AREA", (-2, -2, 3), (0, 0, 0.4), size=0.8, energy=200.0)
    made.lamp("AREA", (2.5, 1, 2), (0, 0, 0.4), size=0.4, energy=80.0)
    return made


def stage() -> Set:
    made = Walls((0, -6, 2), (0, 0, 0.8), 0.8)
    made.floor(16, _painted((0.4, 0.4, 0.4, 1)))
    for k in range(6):
        made.add("cylinder", (-2 + 0.8 * k, 0.3 * (k % 3), 0.6), vertices=16, radius=0.15, depth=1.2)
        made.lamp("SPOT", (-2.5 + k, -2.5, 4), (-2 + 0.8 * k, 0.3 * (k % 3), 0.4), spot_size=0.6, spot_blend=0.4,
                  shadow_soft_size=0.15, energy=350.0)  # fmt: skip
    return made


def blinds() -> Set:
    made = Walls((0, -2.6, 1.4), (0, 1, 0.8), 1.1)
    made.room(1.8, 2.6, 2.4, (WHITE, WHITE), roof=False)
    for y in np.arange(-2.6, 2.6, 0.26):
        made.block((-1.8, y, 2.4), (1.8, y + 0.14, 2.42), (0.5, 0.4, 0.3, 1))
    made.block((-0.6, 0.6, 0), (0.4, 1.2, 0.7), RED)
    made.sun((1, 0.6, 4), 1.5, 8.0)
    return made


def chairs() -> Set:
    made = Walls((0, -3.2, 1.6), (0, 0.8, 0.5), 1.0)
    made.room(2.4, 3.4, 2.6)
    for x, y in ((-1.4, 0), (-0.2, 0.8), (1.1, 0.1), (0.4, -0.9)):
        for dx, dy in ((0, 0), (0.4, 0), (0, 0.4), (0.4, 0.4)):
            made.block((x + dx, y + dy, 0), (x + dx + 0.05, y + dy + 0.05, 0.45), (0.4, 0.25, 0.15, 1))
        made.block((x, y, 0.45), (x + 0.45, y + 0.45, 0.5), (0.4, 0.25, 0.15, 1))
        made.block((x, y + 0.4, 0.5), (x + 0.45, y + 0.45, 1.0), (0.4, 0.25, 0.15, 1))
    made.lamp("AREA", (-1, 0, 2.55), size=0.5, energy=50.0)
    made.lamp("AREA", (1, 0.8, 2.55), size=0.5, energy=50.0)
    return made


def arcade() -> Set:
    made = Walls((-1.5, -6, 1.7), (1, 2, 1.2), 0.9)
    made.floor(30)
    for y in np.arange(-4, 9, 1.6):
        made.add("cylinder", (2, y, 1.3), vertices=24, radius=0.2, depth=2.6, material=_painted(WHITE))
    made.block((1.7, -4.5, 2.6), (2.3, 9, 3.1))
    made.block((4, -4.5, 0), (4.3, 9, 3.1), (0.6, 0.5, 0.4, 1))
    made.sun((-3, -1, 3), 2.5)
    made.sky((0.5, 0.7, 1), 0.5)
    return made


def crates() -> Set:
    made = Walls((0, -6, 2.4), (0, 0, 0.6), 0.8)
    made.floor(16, _painted((0.5, 0.5, 0.5, 1)))
    random = np.random.default_rng(8)
    for _ in range(14):
        x, y, side = random.uniform(-2.2, 2.2), random.uniform(-1.5, 2.5), random.uniform(0.3, 0.8)
        made.add("cube", (x, y, side / 2), (0, 0, random.uniform(0, 3)), size=side, material=_painted(RED))
    made.lamp("AREA", (2.5, -1, 4), (0, 0, 0), shape="DISK", size=1.2, energy=500.0)
    return made


def lanterns() -> Set:
    made = Walls((0, -5, 1.8), (0, 0, 0.6), 0.9)
    made.floor(16)
    for x in (-1.6, 0.0, 1.6):
        made.add("cone", (x, 0.6, 0.5), vertices=20, radius1=0.3, depth=1.0, material=_painted(GREEN))
        made.lamp("POINT", (x - 0.5, -0.6, 1.6), shadow_soft_size=0.1, energy=60.0, use_soft_falloff=False)
    return made


ROOMS: dict[str, Callable[[], Set]] = {
    one.__name__: one
    for one in (corridor, closet, attic, cellar, shelf, pillars, lampshade, glossy_room, stairs, tubes, blinds, chairs)
}
OPEN: dict[str, Callable[[], Set]] = {
    one.__name__: one
    for one in (tree, hedge, fence, canyon, pergola, rocks, ball, rings, heads, stage, arcade, crates, lanterns)
}
SCENES = ROOMS | OPEN


def build(name: str) -> bpy.types.Scene:
    """The only scene of an empty Blender, with the usual filter."""
    scene = SCENES[name]().scene
    scene.render.filter_size = 1.5
    return scene
