"""Scenes of glass and gloss for `bench/reflections.py`, as products are shown: each is hard for another reason.

| scene | what is hard |
|---|---|
| softbox | a lamp of 1 m above a ball of glass: a wide caustic and a shadow that it fills |
| tumbler | a thick glass with a floor of its own, seen directly: four faces one behind the other |
| bottle | coloured glass with liquid in it |
| ice | cubes of glass that touch, with rough faces |
| perfume | a cut bottle before a lit screen, a cap of metal |
| facing mirrors | two mirrors that face each other show a ball again and again |
| puddle | a flat sheet of water on dark ground mirrors small lamps by night |
| screen | an emissive screen just above a glossy floor |
| softboxes of the world | two in an image of the world, above a ball and a green glass |
| layers | coats over rough bases: both are of one surface |
| gloss below glass | a small lamp shines through a ball onto a floor of roughness .5 |
| metal below glass | the same onto brushed metal, .3 |
| stained slab | thick glass of two colours, which its caustic shows |
| prism | a bar of a red, a green and a blue glass that are added, of three indices |
| liquid | wine that reaches into the wall of a thick glass, as artists model it |
"""

from __future__ import annotations

from functools import partial

import bpy
import numpy as np

from .reflection_scenes import MIRROR, TURNED
from .shading import chequer, dispersing, even_world, glass, node_of, one_shader, principled
from .shapes import area, ball, cube, lathe, look, plane, solid

TILES = (0.8, 0.75, 0.7, 1), 16, (0.3, 0.3, 0.35, 1)


def _table(strength: float = 0.3) -> None:
    even_world((strength, strength * 1.05, strength * 1.1))
    plane(principled("Tiles", *TILES), (0, 0, 0), scale=(4, 4, 1))


def softbox() -> None:
    _table(0.1)
    ball(glass(), (0, 0, 0.5), 0.4)
    area((0, 0, 1.8), 60, 1.0, (0, 0, 0))
    look((0, -3.2, 1.8), (0, 0, 0.3), 50)


def tumbler() -> None:
    _table()
    wall = [(0, 0.01), (0.38, 0.01), (0.42, 1.0), (0.36, 1.0), (0.33, 0.16), (0, 0.16)]
    lathe(glass(), wall)
    area((-1.5, -1.5, 3), 80, 2.0)
    look((0, -3.2, 1.1), (0, 0, 0.45), 60)


def bottle() -> None:
    _table()
    outside = [(0, 0.01), (0.3, 0.01), (0.3, 0.8), (0.1, 1.1), (0.1, 1.4)]
    inside = [(0.07, 1.4), (0.07, 1.1), (0.25, 0.78), (0.25, 0.06), (0, 0.06)]
    lathe(glass("Green", (0.55, 0.85, 0.6, 1)), outside + inside)
    area((1.5, -1.5, 3), 80, 2.0)
    look((0, -4.0, 1.2), (0, 0, 0.6), 60)


def ice() -> None:
    _table()
    cubes = glass("Ice", (0.95, 0.98, 1, 1), 0.05, 1.31)
    for place, turn in (((-0.35, 0, 0.3), 0.4), ((0.4, 0.1, 0.3), -0.5), ((0.05, 0.05, 0.87), 0.1)):
        cube(cubes, place, 0.56).rotation_euler = (0, 0, turn)
    area((-1.5, -1.5, 3), 80, 2.0)
    look((0, -3.2, 1.4), (0, 0, 0.5), 55)


def perfume() -> None:
    _table(0.15)
    cut = [(0, 0.01), (0.45, 0.01), (0.5, 0.2), (0.45, 0.7), (0.15, 0.8), (0, 0.8)]
    lathe(glass("Cut", (1, 0.9, 0.75, 1)), cut, segments=8, smooth=False)
    cap = principled("Cap", (0.9, 0.75, 0.4, 1), Metallic=1.0, Roughness=0.15)
    lathe(cap, [(0, 0.82), (0.16, 0.82), (0.16, 1.1), (0, 1.1)])
    screen = one_shader("Screen", "ShaderNodeEmission", Color=(1, 0.95, 0.9, 1), Strength=3.0)
    plane(screen, (0, 2.0, 1.0), (TURNED, 0, 0), (1.2, 0.9, 1))
    look((0, -3.2, 1.2), (0, 0, 0.5), 60)


def facing_mirrors() -> None:
    even_world((0.05, 0.05, 0.06))
    plane(principled("Floor", (0.7, 0.7, 0.7, 1), 8, (0.3, 0.3, 0.35, 1)), (0, 0, 0), scale=(3, 2, 1))
    mirror = principled("Mirror", (0.95, 0.95, 0.95, 1), **MIRROR)
    plane(mirror, (0, 1.0, 1.0), (TURNED, 0, 0), (1.5, 0.95, 1))
    plane(mirror, (0, -1.0, 1.0), (-TURNED, 0, 0), (1.5, 0.95, 1))
    ball(principled("Ball", (0.8, 0.2, 0.1, 1), Roughness=0.7), (-0.3, 0.2, 0.4), 0.35)
    area((0, 0, 3), 60, 1.0, (0, 0, 0))
    look((0.5, -0.85, 1.0), (-0.2, 1.0, 0.8), 24)


def puddle() -> None:
    even_world((0.004, 0.005, 0.01))
    ground = principled("Ground", (0.08, 0.08, 0.08, 1), 20, (0.12, 0.11, 0.1, 1), Roughness=0.9)
    plane(ground, (0, 0, 0), scale=(5, 5, 1))
    plane(principled("Puddle", (0.02, 0.02, 0.02, 1), Roughness=0.0, IOR=1.33), (0, 0.5, 0.005), scale=(1.5, 1.0, 1))
    for x, color in ((-1.0, (1, 0.6, 0.2)), (1.2, (0.3, 0.6, 1))):
        ball(one_shader("Lamp", "ShaderNodeEmission", Color=(*color, 1), Strength=30.0), (x, 3.0, 1.4), 0.15)
    plane(principled("Wall", (0.5, 0.4, 0.35, 1), 10, (0.4, 0.35, 0.3, 1)), (0, 4, 1.5), (TURNED, 0, 0), (4, 1.5, 1))
    look((0, -3.5, 1.0), (0, 1.5, 0.4), 40)


def screen() -> None:
    even_world((0.02, 0.02, 0.02))
    plane(principled("Floor", (0.3, 0.3, 0.32, 1), 10, (0.2, 0.2, 0.22, 1), Roughness=0.25), (0, 0, 0), scale=(4, 4, 1))
    shown = one_shader("Screen", "ShaderNodeEmission", Color=(0.5, 0.8, 1, 1), Strength=4.0)
    plane(shown, (0, 0.5, 0.55), (TURNED, 0, 0), (0.9, 0.5, 1))
    look((0, -3.2, 1.2), (0, 0, 0.3), 45)


def layers() -> None:
    even_world((0.25, 0.27, 0.3))
    plane(principled("Tiles", *TILES), (0, 0, 0), scale=(4, 4, 1))
    coat = {"Coat_Weight": 1.0, "Coat_Roughness": 0.0}
    ball(principled("Red", (0.6, 0.02, 0.03, 1), Metallic=0.8, Roughness=0.35, **coat), (-0.75, 0, 0.6), 0.6)
    ball(principled("Lacquer", (0.05, 0.1, 0.5, 1), Roughness=0.3, **coat), (0.75, 0, 0.6), 0.6)
    area((-2, -2, 3), 60, 1.0)
    look((0, -4, 1.4), (0, 0, 0.5), 50)


def softboxes_of_the_world() -> None:
    _table()
    rows = 64
    pixels = np.ones((rows, 2 * rows, 4), np.float32)
    pixels[..., :3] = 0.15
    pixels[44:50, 20:28, :3], pixels[40:52, 80:100, :3] = (60, 55, 50), (3, 3.5, 4)
    image = bpy.data.images.new("World", 2 * rows, rows, float_buffer=True)
    image.pixels.foreach_set(pixels.ravel())
    tree = bpy.context.scene.world.node_tree
    node = tree.nodes.new("ShaderNodeTexEnvironment")
    node.image = image
    shader = next(one for one in tree.nodes if one.type == "BACKGROUND")
    shader.inputs["Strength"].default_value = 1.0
    tree.links.new(node.outputs["Color"], shader.inputs["Color"])
    ball(glass(), (-0.5, 0, 0.5), 0.4)
    wall = [(0, 0.01), (0.3, 0.01), (0.3, 0.9), (0.25, 0.9), (0.25, 0.1), (0, 0.1)]
    lathe(glass("Green", (0.6, 0.9, 0.7, 1)), wall, (0.6, 0.2, 0))
    look((0, -3.4, 1.6), (0, 0, 0.4), 45)


def _below_glass(floor) -> None:
    even_world((0.05, 0.05, 0.05))
    plane(floor, (0, 0, 0), scale=(4, 4, 1))
    ball(glass(), (0, 0, 0.55), 0.45)
    area((0.8, 1.2, 2.5), 80, 0.6, (0, 0, 0))
    look((0, -3.2, 1.5), (0, 0, 0.2), 50)


def gloss_below_glass() -> None:
    _below_glass(principled("Floor", (0.3, 0.3, 0.3, 1), Roughness=0.5))


def metal_below_glass() -> None:
    _below_glass(principled("Floor", (0.7, 0.7, 0.7, 1), Metallic=1.0, Roughness=0.3))


def stained_slab() -> None:
    _table(0.1)
    stained = glass("Stained")
    links, color = stained.node_tree.links, node_of(stained, "BSDF_GLASS").inputs["Color"]
    links.new(chequer(stained, 4.0, (0.9, 0.15, 0.1, 1), (0.1, 0.3, 0.9, 1), "Object"), color)
    cells, shift = node_of(stained, "TEX_CHECKER"), stained.node_tree.nodes.new("ShaderNodeMapping")
    shift.inputs["Location"].default_value = (0.013, 0.017, 0.06)  # no face lies between two cells
    links.new(node_of(stained, "TEX_COORD").outputs["Object"], shift.inputs["Vector"])
    links.new(shift.outputs["Vector"], cells.inputs["Vector"])
    cube(stained, (0, 0, 0.6), 1.0).scale = (1.0, 1.0, 0.06)
    area((0, 0, 3), 80, 0.5, (0, 0, 0))
    look((0, -3.2, 1.8), (0, 0, 0.2), 50)


PRIMARIES = (((1, 0, 0, 1), 1.35), ((0, 1, 0, 1), 1.5), ((0, 0, 1, 1), 1.65))  # glass that lets each pass, its index


def prism(primaries=PRIMARIES) -> None:
    _table(0.1)
    bar = dispersing(primaries)
    edge = [(-0.45, 0.15), (0.45, 0.15), (0.0, 0.93)]
    corners = [(x, y, z) for y in (-0.6, 0.6) for x, z in edge]
    solid("Prism", bar, corners, [(0, 1, 2), (5, 4, 3), (1, 0, 3, 4), (2, 1, 4, 5), (0, 2, 5, 3)])
    area((-2.2, 0, 2.2), 80, 2.0)
    look((0.9, -3.0, 1.9), (0.2, 0, 0.25), 50)


def liquid() -> None:
    _table()
    wall = [(0, 0.01), (0.38, 0.01), (0.38, 1.0), (0.33, 1.0), (0.33, 0.1), (0, 0.1)]
    lathe(glass(), wall)
    wine = glass("Wine", (0.75, 0.08, 0.1, 1), ior=1.33)
    lathe(wine, [(0, 0.09), (0.34, 0.09), (0.34, 0.6), (0, 0.6)])
    area((-1.5, -1.5, 3), 80, 2.0)
    look((0, -3.2, 1.3), (0, 0, 0.45), 60)


# By channel of the picture the scene that has the same light there, but glass for no other: of several that are added
# a path tracer takes one at each face and lets it count for all, so few of its paths end, and those weigh much.
CHANNELS = {"prism": tuple(partial(prism, (one,)) for one in PRIMARIES)}
SCENES = {
    "softbox": softbox, "softboxes of the world": softboxes_of_the_world,
    "tumbler": tumbler, "bottle": bottle, "ice": ice, "perfume": perfume,
    "facing mirrors": facing_mirrors, "puddle": puddle, "screen": screen, "layers": layers,
    "gloss below glass": gloss_below_glass, "metal below glass": metal_below_glass, "stained slab": stained_slab,
    "prism": prism, "liquid": liquid,
}  # fmt: skip
