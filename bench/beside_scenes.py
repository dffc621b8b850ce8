"""Scenes of `python -m bench beside` that are no samples: nothing was tuned on them. Each is a few objects with what
Blender gives a new one (Principled, roughness .5, specular .5) unless its name says otherwise."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np

from bench.media_scenes import SIDE_VIEW, begin, box, camera, diffuse, lamp, link, material, volume
from bench.shading import node_of

PRINCIPLED = "ShaderNodeBsdfPrincipled"


def plain(*color: float, **inputs):
    return material(PRINCIPLED, Base_Color=(*color, 1), **inputs)


def ball(radius: float, place, filled) -> None:
    bpy.ops.mesh.primitive_uv_sphere_add(radius=radius, location=place, segments=48, ring_count=24)
    bpy.ops.object.shade_smooth()
    bpy.context.object.data.materials.append(filled)


def world(*color: float) -> None:
    node_of(bpy.context.scene.world, "BACKGROUND").inputs["Color"].default_value = (*color, 1)


def room(wall, pane=None) -> None:
    """Five metres wide and deep, three high, with a window to the left."""
    for low, high in (
        ((-2.5, -6.5, -0.1), (2.5, 2.5, 0)), ((-2.5, -6.5, 3), (2.5, 2.5, 3.1)), ((-2.5, 2.5, 0), (2.5, 2.6, 3)),
        ((2.5, -6.5, 0), (2.6, 2.5, 3)), ((-2.6, -6.5, 0), (-2.5, -1, 3)), ((-2.6, 1, 0), (-2.5, 2.5, 3)),
        ((-2.6, -1, 0), (-2.5, 1, 1)), ((-2.6, -1, 2.2), (-2.5, 1, 3)),
    ):  # fmt: skip
        box(low, high, wall)
    box((-0.5, 0, 0), (0.5, 1, 0.8), plain(0.6, 0.2, 0.1))
    if pane is not None:
        box((-2.57, -1, 1), (-2.55, 1, 2.2), pane)
    world(0.6, 0.8, 1.0)
    lamp("SUN", (0, 0, 5), 6, (0, -1.0, 0.3), angle=0.01)


def window() -> None:
    room(plain(0.8, 0.78, 0.75))


def window_pane() -> None:
    room(plain(0.8, 0.78, 0.75), material("ShaderNodeBsdfGlass", IOR=1.45, Roughness=0.0))


def columns() -> None:
    stone = plain(0.7, 0.65, 0.55)
    box((-8, -8, -0.2), (8, 8, 0), stone)
    for x in range(-3, 4):
        for y in (1, 3):
            bpy.ops.mesh.primitive_cylinder_add(radius=0.3, depth=3, location=(1.3 * x, y, 1.5), vertices=32)
            bpy.ops.object.shade_smooth()
            bpy.context.object.data.materials.append(stone)
    world(0.3, 0.5, 0.9)
    lamp("SUN", (0, 0, 5), 4, (0.5, -0.7, 0), angle=0.01)


def on_table(*filled) -> None:
    """Balls on a table, under an area lamp and a grey sky."""
    box((-4, -4, -0.2), (4, 4, 0), plain(0.5, 0.5, 0.5))
    for k, one in enumerate(filled):
        ball(0.6, (1.4 * (k - (len(filled) - 1) / 2), 0.5, 0.6), one)
    world(0.2, 0.2, 0.2)
    lamp("AREA", (-2, -2, 4), 300, (0.4, -0.4, 0), size=1.5)


def metals() -> None:
    on_table(*(plain(0.9, 0.7, 0.4, Metallic=1.0, Roughness=rough) for rough in (0.05, 0.25, 0.5)))


def coats() -> None:
    on_table(*(plain(0.6, 0.1, 0.1, Coat_Weight=weight, Roughness=0.6) for weight in (0.02, 0.2, 1.0)))


def glass() -> None:
    on_table(material("ShaderNodeBsdfGlass", IOR=1.45, Roughness=0.0), plain(0.2, 0.4, 0.7),
             material("ShaderNodeBsdfGlass", IOR=1.45, Roughness=0.2))  # fmt: skip


def skin() -> None:
    on_table(*(plain(0.8, 0.6, 0.5, Subsurface_Weight=1.0, Subsurface_Scale=scale) for scale in (0.05, 0.3)))


def lamps() -> None:
    """A floor that nothing but many small lamps light."""
    box((-5, -5, -0.2), (5, 5, 0), diffuse(0.7, 0.7, 0.7))
    draw = np.random.default_rng(1)
    for k in range(40):
        x, y = draw.uniform(-3, 3, 2)
        lamp("POINT", (x, y, 0.5), 4, color=(1.0, 0.5 + 0.5 * (k % 2), 0.6))
        if k % 3 == 0:
            ball(0.25, (-x, y, 0.25), plain(0.7, 0.7, 0.7))


def haze() -> None:
    room(plain(0.8, 0.78, 0.75))
    box((-2.49, -6.4, 0.01), (2.49, 2.49, 2.99), volume(Density=0.08, Color=(0.95, 0.95, 0.95, 1)))


def crowd() -> None:
    """Copies of one mesh of two materials."""
    box((-20, -5, -0.2), (20, 40, 0), plain(0.4, 0.45, 0.3))
    bpy.ops.mesh.primitive_monkey_add(size=0.8)
    head = bpy.context.object.data
    head.materials.append(plain(0.7, 0.4, 0.3))
    head.materials.append(plain(0.1, 0.1, 0.1, Roughness=0.2))
    for k, polygon in enumerate(head.polygons):
        polygon.material_index = k % 2
    for k in range(120):
        link("Copy", head, (1.2 * (k % 12) - 6.6, 1.2 * (k // 12), 0.4), (0, 0, k))
    world(0.5, 0.6, 0.8)
    lamp("SUN", (0, 0, 5), 3, (0.5, 0.5, 0), angle=0.05)


SCENES: dict[str, Callable[[], None]] = {
    one.__name__: one for one in (window, window_pane, columns, metals, coats, glass, skin, lamps, haze, crowd)
}


def written(name: str, folder: Path) -> Path:
    """The file of a scene below `folder`, built now."""
    begin()
    camera("Camera", (0, -6, 1.7), (SIDE_VIEW[0] - 0.08, 0, 0))
    SCENES[name]()
    path = folder / f"{name}.blend"
    folder.mkdir(parents=True, exist_ok=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True)
    return path
