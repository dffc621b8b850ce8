"""Scenes in which an artist edits reflections: pictures of docs/reflections.md, and what edits must not do to light.

| scene | what is edited |
|---|---|
| car | a softbox is pulled down to the door of a lacquered body, and fades out over it |
| room | a mirror on a wall shows the ball that stands beside the camera in its middle |
| bottle | the highlight of a lamp is moved to the shoulder of a hollow glass bottle |
"""

from __future__ import annotations

import bpy
import numpy as np

from . import shapes
from .shading import even_world, glass, one_shader, principled


def car(around) -> tuple:
    even_world((0.25, 0.27, 0.3))
    eye = (-3.4, -5.0, 1.5)
    shapes.plane(around("Floor", (0.4, 0.4, 0.4, 1)), (0, 0, 0), scale=(12, 12, 1))
    shapes.plane(around("Wall", (0.5, 0.5, 0.52, 1)), (0, 6, 3), (np.pi / 2, 0, 0), (12, 3, 1))
    shapes.plane(around("Softbox", (1, 1, 1, 1), 5.0), (0, -1, 4.5), (np.pi, 0, 0), (2.2, 0.5, 1))
    shapes.plane(around("Strip", (0.5, 0.7, 1, 1), 4.0), (-4.5, 1, 2), (0, np.pi / 2, 0), (1.5, 0.4, 1))
    lacquer = principled("Lacquer", (0.6, 0.05, 0.04, 1), Metallic=0.7, Roughness=0.25, Coat_Weight=1.0)
    body = _body(lacquer)
    shapes.look(eye, (0, 0, 0.55), 40)
    return body, {"point": (-0.4, -0.85, 0.6), "target": (0, -1, 4.5), "radius": 1.3, "border": 0.7}


def room(around) -> tuple:
    even_world((0.3, 0.3, 0.3))
    eye = (-0.6, -2.2, 1.5)
    shapes.plane(around("Floor", (0.5, 0.35, 0.2, 1)), (0, 0, 0), scale=(3, 3, 1))
    shapes.plane(around("Back", (0.7, 0.68, 0.6, 1)), (0, 3, 1.5), (np.pi / 2, 0, 0), (3, 1.5, 1))
    shapes.plane(around("Left", (0.2, 0.4, 0.6, 1)), (-3, 0, 1.5), (0, np.pi / 2, 0), (1.5, 3, 1))
    shapes.plane(around("Right", (0.6, 0.2, 0.15, 1)), (3, 0, 1.5), (0, np.pi / 2, 0), (1.5, 3, 1))
    shapes.ball(around("Ball", (0.9, 0.7, 0.05, 1)), (1.6, -1.8, 0.7), 0.7)
    shapes.plane(around("Lamp", (1, 0.95, 0.85, 1), 6.0), (0, 0, 3.2), (np.pi, 0, 0), (0.8, 0.8, 1))
    silver = principled("Silver", (0.95, 0.95, 0.95, 1), Metallic=1.0, Roughness=0.0)
    corners = [(-1.3, 2.9, 0.6), (1.3, 2.9, 0.6), (1.3, 2.9, 2.4), (-1.3, 2.9, 2.4)]
    mirror = shapes.solid("Mirror", silver, corners, [(0, 1, 2, 3)])
    shapes.look(eye, (0, 3, 1.4), 30)
    return mirror, {"point": (0, 2.9, 1.5), "target": (1.6, -1.8, 0.7), "radius": 10.0, "border": 0.0}


def bottle(around) -> tuple:
    even_world((0.3, 0.32, 0.36))
    shapes.plane(around("Table", (0.45, 0.3, 0.2, 1)), (0, 0, 0), scale=(6, 6, 1))
    shapes.plane(around("Wall", (0.5, 0.55, 0.5, 1)), (0, 3, 1.5), (np.pi / 2, 0, 0), (6, 3, 1))
    shapes.plane(around("Lamp", (1, 0.9, 0.7, 1), 15.0), (-2.5, -2.5, 2.6), (0.9, 0, -0.8), (0.35, 0.35, 1))
    outer = [(0.34, 0.0), (0.4, 0.05), (0.4, 0.95), (0.36, 1.1), (0.22, 1.28), (0.15, 1.4), (0.14, 1.7)]
    inner = [(0.11, 1.7), (0.12, 1.4), (0.19, 1.26), (0.33, 1.08), (0.37, 0.95), (0.37, 0.1), (0.33, 0.06)]
    profile = [(0, 0.0), *outer, *inner, (0, 0.06)]
    thing = shapes.lathe(glass("Glass", (0.85, 1.0, 0.9, 1)), profile)
    shapes.look((0, -4.2, 1.2), (0, 0, 0.85), 50)
    return thing, {"point": (0.12, -0.26, 1.19), "target": (-2.5, -2.5, 2.6), "radius": 0.6, "border": 0.2}


SCENES = {"car": car, "room": room, "bottle": bottle}


def make(name: str, edited: bool = True, even: bool = False) -> bpy.types.Object:
    """The scene in an empty file, and the object that is edited. `even`: all around it has a radiance of one."""
    bpy.ops.wm.read_factory_settings(use_empty=True)

    def around(name: str, color, strength: float = 0.0):
        if even:
            return one_shader(name, "ShaderNodeEmission", Color=(1, 1, 1, 1), Strength=1.0)
        if strength:
            return one_shader(name, "ShaderNodeEmission", Color=color, Strength=strength)
        return one_shader(name, "ShaderNodeBsdfDiffuse", Color=color)

    thing, edit = SCENES[name](around)
    if even:
        even_world((1, 1, 1))
    if edited:
        one = thing.candela.reflection_editing_constraints.add()
        one.point, one.target, one.viewer = edit["point"], edit["target"], bpy.context.scene.camera.location
        region = thing.candela.reflection_editing_regions.add()
        region.centre, region.radius, region.border = edit["point"], edit["radius"], edit["border"]
    return thing


def _body(material, rows: int = 40, segments: int = 48) -> bpy.types.Object:
    """A closed body along x: superellipses whose height follows bonnet, cabin and boot."""
    along = np.linspace(-1, 1, rows + 2)[1:-1]
    wide = 0.9 * (1 - np.abs(along) ** 8) ** 0.25
    cabin = np.clip(1.2 - 2.4 * np.abs(along - 0.1), 0, 1)
    high = 0.32 + 0.3 * cabin * cabin * (3 - 2 * cabin)
    turn = 2 * np.pi * np.arange(segments) / segments
    y, z = (np.sign(v) * np.abs(v) ** 0.6 for v in (np.cos(turn), np.sin(turn)))
    rounded = (1 - np.abs(along) ** 8) ** 0.25
    places = np.stack(
        [2.1 * along[:, None] + 0 * turn, wide[:, None] * y, 0.2 + high[:, None] + (high * rounded)[:, None] * z], -1
    )
    vertices = [(-2.1, 0, 0.52), (2.1, 0, 0.52), *places.reshape(-1, 3)]
    k = 2 + np.arange(rows * segments).reshape(rows, segments)
    after = np.roll(k, -1, axis=1)
    sides = np.stack([k[:-1], after[:-1], after[1:], k[1:]], axis=-1).reshape(-1, 4).tolist()
    ends = [(0, a, b) for b, a in zip(k[0], after[0])] + [(1, a, b) for a, b in zip(k[-1], after[-1])]
    return shapes.solid("Body", material, vertices, sides + ends, smooth=True)
