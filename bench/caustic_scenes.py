"""Six scenes of caustics on what an orthographic camera sees from above, built from numbers in an empty Blender.

Casters are hidden from the camera, so that all of their light on the floor is seen, and receivers are diffuse, .8.
Lamps have a size, so that Cycles can find them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import bpy
import numpy as np

from . import shapes
from .shading import glass, one_shader
from .shapes import lamp, look_down, plane, solid

ALBEDO = 0.8


@dataclass(frozen=True)
class Scene:
    """How to build one, and the square that its camera sees, metres."""

    label: str
    build: Callable[[], None]
    span: float
    centre: tuple[float, float] = (0.0, 0.0)


def clear() -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)


def mirror():
    return one_shader("Mirror", "ShaderNodeBsdfAnisotropic", Color=(1, 1, 1, 1), Roughness=0.0)


def white():
    return one_shader("White", "ShaderNodeBsdfDiffuse", Color=(ALBEDO, ALBEDO, ALBEDO, 1))


def floor(half: float = 3.0, height: float = 0.0, surface=None):
    return plane(surface or white(), (0, 0, height), scale=(half, half, 1))


def ball(radius: float, place, surface, segments: int = 96):
    hidden(shapes.ball(surface, place, radius, segments))


def hidden(caster) -> None:
    """From the camera, which sees all of its light on the floor."""
    caster.visible_camera = False


def ring(radius: float, height: float, bottom: float, surface, segments: int = 192):
    """A band without thickness, which mirrors on both sides."""
    turns = np.linspace(0, 2 * np.pi, segments, endpoint=False)
    rim = [(radius * np.cos(t), radius * np.sin(t), bottom + z) for z in (0.0, height) for t in turns]
    faces = [(k, (k + 1) % segments, segments + (k + 1) % segments, segments + k) for k in range(segments)]
    hidden(solid("Ring", surface, rim, faces, True))


def spot(place, target, intensity: float, degrees: float = 60.0, radius: float = 0.05, color=(1, 1, 1)):
    return lamp(
        "SPOT", place, target, energy=4 * np.pi * intensity, spot_size=np.radians(degrees), spot_blend=0.0,
        shadow_soft_size=radius, color=color,
    )  # fmt: skip


def sphere() -> None:
    floor()
    ball(0.5, (0, 0, 0.75), glass())
    spot((0.9, 0.3, 3.2), (0, 0, 0.75), 10.0, 40.0)


def mirror_ring() -> None:
    floor(2.0)
    ring(0.5, 0.25, 0.0, mirror())
    spot((1.3, 0.0, 1.6), (0, 0, 0.1), 1.0, 50.0)


def water() -> None:
    floor(2.0)
    count, half = 160, 1.6
    place = np.linspace(-half, half, count)
    y, x = np.meshgrid(place, place, indexing="ij")
    z = 0.6 + 0.02 * np.sin(2 * np.pi * x / 0.6) + 0.02 * np.sin(2 * np.pi * (0.6 * x + 0.8 * y) / 0.5)
    vertices = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    faces = [
        (r * count + c, r * count + c + 1, (r + 1) * count + c + 1, (r + 1) * count + c)
        for r in range(count - 1)
        for c in range(count - 1)
    ]
    hidden(solid("Water", glass(ior=1.33), vertices, faces, True))
    lamp("SUN", (1.2, 0, 2.0), energy=2.0, angle=np.radians(2.0))


def suzanne() -> None:
    floor()
    bpy.ops.mesh.primitive_monkey_add(size=1.2, location=(0, 0, 0.85), rotation=(-0.6, 0, 0.4))
    head = bpy.context.object
    head.modifiers.new("Smooth", "SUBSURF").render_levels = 2
    head.modifiers["Smooth"].levels = 2
    for polygon in head.data.polygons:
        polygon.use_smooth = True
    head.data.materials.append(glass())
    hidden(head)
    spot((1.2, -0.6, 3.2), (0, 0, 0.8), 10.0, 40.0)


def two_lights() -> None:
    floor()
    ball(0.4, (-0.35, 0, 0.6), glass())
    ring(0.3, 0.2, 0.0, mirror(), segments=128)
    spot((1.2, 0.4, 2.6), (0, 0, 0.4), 8.0, 50.0, color=(1.0, 0.8, 0.5))
    spot((-1.0, 1.2, 2.4), (0, 0, 0.4), 6.0, 50.0, color=(0.5, 0.7, 1.0))


def occluded_ring() -> None:
    surface = white()
    floor(2.0, surface=surface)
    half, top = 0.8, 0.6
    table = [(x * half, y * half, top - d) for d in (0.05, 0.0) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    sides = [(0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    solid("Platform", surface, table, [(3, 2, 1, 0), (4, 5, 6, 7), *sides])
    for turn in range(4):
        c, s = np.cos(turn * np.pi / 2), np.sin(turn * np.pi / 2)
        wall = [(half, y, top + z) for y, z in ((-half, 0), (half, 0), (half, 0.7), (-half, 0.7))]
        solid("Wall", surface, [(c * x - s * y, s * x + c * y, z) for x, y, z in wall], [(0, 1, 2, 3)])
    ring(0.5, 0.25, top, mirror())
    spot((0.6, 0.0, 2.2), (0, 0, 0.7), 1.0, 50.0)


SCENES = {
    "sphere": Scene("glass ball", sphere, 2.4, (-0.2, 0.0)),
    "ring": Scene("mirror ring", mirror_ring, 1.6),
    "water": Scene("water, sun", water, 2.0, (-0.2, 0.0)),
    "suzanne": Scene("head of glass", suzanne, 2.4, (-0.3, 0.2)),
    "lights": Scene("two lights", two_lights, 2.4),
    "occluded": Scene("ring in a box", occluded_ring, 1.6),
}


def camera(span: float, centre: tuple[float, float] = (0.0, 0.0)) -> None:
    """An orthographic camera above, with pixels that are points."""
    look_down(span, centre)
    bpy.context.scene.render.filter_size = 0.01


def make(name: str) -> Scene:
    """Build a scene in an empty Blender, with its camera."""
    clear()
    made = SCENES[name]
    made.build()
    camera(made.span, made.centre)
    return made
