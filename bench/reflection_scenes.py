"""Scenes for the benchmark of reflections (`bench/reflections.py`): each is hard for another reason.

| scene | what is hard |
|---|---|
| corridor | a mirror shows textured walls that stand behind the camera |
| roughness map | gloss of a chequered roughness over a tiled floor |
| glass ball | a smooth ball bends the view of a metal ball and of tiles |
| two mirrors | each shows the other: eight bounces of a patterned box |
| car paint | a coat over coloured metal under lamps of three sizes |
| window pane | glass that shows a room behind it and what stands before it |
| water | a wavy surface that mirrors a picture and bends the view of the ground |
| patterned floor | diffuse light that a floor of large tiles sends to a wall: what indirect rays meet |
| picture off screen | the same of a picture on a wall behind the camera |

Light comes from areas and a dim world, so that a reference of a thousand samples is one: no caustics of small lamps.
"""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np

from .shading import chequer, even_world, principled
from .shapes import area, ball, cube, look, plane

TURNED = np.pi / 2
MIRROR = {"Metallic": 1.0, "Roughness": 0.0}


def corridor() -> None:
    even_world((0.1, 0.12, 0.15))
    plane(principled("Floor", (0.7, 0.6, 0.5, 1), 12, (0.2, 0.15, 0.1, 1)), (0, 0, 0), scale=(2, 6, 1))
    plane(principled("Left", (0.8, 0.2, 0.1, 1), 10, (0.8, 0.8, 0.7, 1)), (-2, 0, 1.5), (0, TURNED, 0), (1.5, 6, 1))
    plane(principled("Right", (0.1, 0.3, 0.8, 1), 10, (0.8, 0.8, 0.7, 1)), (2, 0, 1.5), (0, -TURNED, 0), (1.5, 6, 1))
    plane(principled("Back", (0.1, 0.6, 0.2, 1), 6, (0.9, 0.9, 0.3, 1)), (0, -6, 1.5), (-TURNED, 0, 0), (2, 1.5, 1))
    plane(principled("Mirror", (0.9, 0.9, 0.9, 1), **MIRROR), (0, 3, 1.5), (TURNED, 0, 0), (1.8, 1.4, 1))
    ball(principled("Ball", (0.8, 0.7, 0.2, 1), Roughness=0.6), (-0.8, -3.5, 0.6), 0.6)
    area((0, -1, 4), 150, 3, (0, -1, 0))
    look((0.4, -1.5, 1.4), (0, 3, 1.3))


def roughness_map() -> None:
    even_world((0.25, 0.28, 0.35))
    plane(principled("Tiles", (0.8, 0.75, 0.7, 1), 16, (0.15, 0.1, 0.25, 1)), (0, 0, 0), scale=(4, 4, 1))
    metal = principled("Metal", (0.9, 0.85, 0.8, 1), Metallic=1.0)
    shader = next(node for node in metal.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    rough = chequer(metal, 8, (0.05, 0.05, 0.05, 1), (0.4, 0.4, 0.4, 1))
    metal.node_tree.links.new(rough, shader.inputs["Roughness"])
    ball(metal, (0, 0, 1.0), 1.0)
    area((-2, -3, 4), 200, 2)
    look((0, -5, 1.8), (0, 0, 0.9), 50)


def glass_ball() -> None:
    even_world((0.4, 0.45, 0.5))
    plane(principled("Tiles", (0.8, 0.75, 0.7, 1), 16, (0.2, 0.3, 0.2, 1)), (0, 0, 0), scale=(4, 4, 1))
    ball(principled("Glass", (1, 1, 1, 1), Roughness=0.0, IOR=1.45, Transmission_Weight=1.0), (-0.3, -1.2, 0.7), 0.7)
    ball(principled("Copper", (0.9, 0.5, 0.3, 1), Metallic=1.0, Roughness=0.25), (0.5, 0.8, 0.9), 0.9)
    area((-2, -2, 4), 60, 3)
    look((0, -5, 1.6), (0, 0, 0.7), 50)


def two_mirrors() -> None:
    even_world((0.05, 0.05, 0.06))
    plane(principled("Floor", (0.7, 0.7, 0.7, 1), 8, (0.3, 0.3, 0.35, 1)), (0, 0, 0), scale=(3, 2, 1))
    mirror = principled("Mirror", (0.9, 0.9, 0.9, 1), **MIRROR)
    plane(mirror, (0, 1.5, 1.2), (TURNED, 0, 0), (2, 1.1, 1))
    plane(mirror, (0, -1.5, 1.2), (-TURNED, 0, 0), (2, 1.1, 1))
    cube(principled("Box", (0.8, 0.2, 0.1, 1), 4, (0.9, 0.8, 0.3, 1), Roughness=0.7), (-0.5, 0.4, 0.4), 0.8)
    area((0, 0, 4), 120, 2, (0, 0, 0))
    look((1.4, -1.2, 1.5), (-0.6, 1.5, 1.0), 24)


def car_paint() -> None:
    even_world((0.15, 0.17, 0.2))
    plane(principled("Floor", (0.4, 0.4, 0.4, 1), 10, (0.2, 0.2, 0.2, 1)), (0, 0, 0), scale=(5, 5, 1))
    paint = principled(
        "Paint", (0.6, 0.02, 0.03, 1), Metallic=0.8, Roughness=0.45, Coat_Weight=1.0, Coat_Roughness=0.03
    )
    ball(paint, (0, 0, 0.8), 0.8).scale = (1.6, 1.0, 1.0)
    for x, size in ((-2, 0.3), (0, 1.0), (2, 2.0)):
        area((x, -2, 3.5), 80, size)
    look((0.5, -5, 1.8), (0, 0, 0.7), 50)


def window_pane() -> None:
    even_world((0.5, 0.55, 0.65))
    plane(principled("Ground", (0.5, 0.5, 0.45, 1), 20, (0.3, 0.35, 0.25, 1)), (0, 0, 0), scale=(6, 6, 1))
    glass = principled("Glass", (1, 1, 1, 1), Roughness=0.0, IOR=1.5, Transmission_Weight=1.0)
    pane = cube(glass, (0, 0, 1.2), 1)
    pane.scale = (3, 0.04, 2.2)
    cube(principled("Red", (0.8, 0.1, 0.1, 1), 4, (0.9, 0.7, 0.7, 1)), (-0.7, 1.5, 0.5), 1.0)
    cube(principled("Yellow", (0.9, 0.7, 0.1, 1), 4, (0.3, 0.2, 0.1, 1)), (1.5, -2.2, 0.6), 1.2)
    look((-1.6, -3.5, 1.6), (0.2, 0, 1.0), 35)


def water() -> None:
    even_world((0.4, 0.5, 0.7))
    plane(principled("Ground", (0.8, 0.7, 0.5, 1), 12, (0.5, 0.4, 0.3, 1)), (0, 0, -0.6), scale=(5, 5, 1))
    plane(principled("Picture", (0.9, 0.2, 0.1, 1), 6, (0.9, 0.9, 0.8, 1)), (0, 4, 1.5), (TURNED, 0, 0), (3, 1.8, 1))
    water_like = principled("Water", (1, 1, 1, 1), Roughness=0.0, IOR=1.33, Transmission_Weight=1.0)
    nodes, links = water_like.node_tree.nodes, water_like.node_tree.links
    waves, bump, place = (nodes.new(f"ShaderNode{name}") for name in ("TexNoise", "Bump", "TexCoord"))
    waves.inputs["Scale"].default_value = 1.5
    bump.inputs["Strength"].default_value = 0.2
    links.new(place.outputs["Object"], waves.inputs["Vector"])
    links.new(waves.outputs[0], bump.inputs["Height"])
    shader = next(node for node in nodes if node.type == "BSDF_PRINCIPLED")
    links.new(bump.outputs["Normal"], shader.inputs["Normal"])
    plane(water_like, (0, 0, 0), scale=(5, 5, 1))
    look((0, -4, 1.2), (0, 2, 0.2), 35)


def patterned_floor() -> None:
    even_world((0.0, 0.0, 0.0))
    plane(principled("Tiles", (0.9, 0.1, 0.05, 1), 4, (0.05, 0.2, 0.9, 1), Roughness=1.0), (0, 0, 0), scale=(2, 2, 1))
    plane(_white(), (0, 2, 1), (TURNED, 0, 0), (2, 1, 1))
    area((0, 0.5, 3.5), 150, 0.5, (0, 0.5, 0))
    look((0, -3.5, 1.6), (0, 2, 0.6), 40)


def picture_off_screen() -> None:
    even_world((0.0, 0.0, 0.0))
    picture = principled("Picture", (0.9, 0.8, 0.1, 1), 2, (0.02, 0.05, 0.6, 1), Roughness=1.0)
    plane(picture, (-2.5, 1.2, 1), (0, TURNED, 0), (1, 1, 1))
    plane(_white(), (0, 0, 0), scale=(2.6, 4, 1))
    plane(_white(), (0, 2.2, 1), (TURNED, 0, 0), (2.6, 1, 1))
    area((1.5, 0.5, 1.5), 100, 0.5, (-2.5, 1.2, 1))
    look((0.9, -3.0, 1.2), (0.2, 2.2, 0.6), 45)


def _white():
    return principled("White", (0.8, 0.8, 0.8, 1), Roughness=1.0, Specular_IOR_Level=0.0)


PATHS = {"patterned floor": ("diffuse indirect",), "picture off screen": ("diffuse indirect",)}  # of the others: all
BOUNCES = {"two mirrors": 8, "facing mirrors": 8}  # that Cycles' glossy rays may have, as many as Candela shades
SCENES: dict[str, Callable[[], None]] = {
    "corridor": corridor,
    "roughness map": roughness_map,
    "glass ball": glass_ball,
    "two mirrors": two_mirrors,
    "car paint": car_paint,
    "window pane": window_pane,
    "water": water,
    "patterned floor": patterned_floor,
    "picture off screen": picture_off_screen,
}


def make(name: str) -> bpy.types.Scene:
    """The scene of this name in an empty file; what it is measured by and Cycles' bounces stand in its properties."""
    from .glass_scenes import SCENES as GLASS

    return begun(name, (SCENES | GLASS)[name])


def begun(name: str, fill: Callable[[], None]) -> bpy.types.Scene:
    """An empty file with what `fill` puts into it, measured as the scene of this name."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    fill()
    scene = bpy.context.scene
    if name in PATHS:
        scene["paths"] = ",".join(PATHS[name])
    if name in BOUNCES:
        scene["glossy_bounces"] = BOUNCES[name]
    return scene
