"""Four scenes to be dazzled by, or not: a street at night, a candle, a car in the sun, a room in daylight.

Each is a few objects that Cycles renders cleanly with few samples, so that its frame can stand as the HDR picture that
both Candela's passes and numpy scatter.
"""

from __future__ import annotations

import bpy
import numpy as np

from .shading import node_of, one_shader


def clear() -> bpy.types.Scene:
    """An empty scene with a black world."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("World")
    return scene


def background(scene, color, strength: float) -> None:
    node = node_of(scene.world, "BACKGROUND")
    node.inputs["Color"].default_value, node.inputs["Strength"].default_value = (*color, 1.0), strength


def _emission(color, strength: float):
    return one_shader("Light", "ShaderNodeEmission", Color=(*color, 1.0), Strength=strength)


def _principled(color, roughness: float, metallic: float = 0.0):
    return one_shader(
        "Surface", "ShaderNodeBsdfPrincipled", Base_Color=(*color, 1.0), Roughness=roughness, Metallic=metallic
    )


def _add(material, make, **options):
    make(**options)
    made = bpy.context.object
    made.data.materials.append(material)
    return made


def _camera(scene, location, turn, lens: float = 35.0):
    data = bpy.data.cameras.new("Camera")
    data.lens = lens
    scene.camera = bpy.data.objects.new("Camera", data)
    scene.collection.objects.link(scene.camera)
    scene.camera.location, scene.camera.rotation_euler = location, turn


def street() -> bpy.types.Scene:
    """Twelve lamps of 1 to 50 times the display's white along a dark street, and a pair of headlights."""
    scene = clear()
    background(scene, (0.5, 0.6, 1.0), 0.002)
    floor = _add(_principled((0.05, 0.05, 0.055), 0.5), bpy.ops.mesh.primitive_plane_add, size=200)
    floor.location.z = 0.0
    for number in range(12):
        side, row = (-1) ** number, number // 2
        warm = 0.3 + 0.7 * (number % 3) / 2
        place = (side * 5.0, 10.0 + 9.0 * row, 5.0)
        light = _emission((1.0, 0.55 + 0.35 * warm, 0.2 + 0.7 * warm), 100.0 * 50.0 ** (number / 11) / 4)
        _add(light, bpy.ops.mesh.primitive_uv_sphere_add, radius=0.16, location=place, segments=16, ring_count=8)
        _add(
            _principled((0.2, 0.2, 0.2), 0.6), bpy.ops.mesh.primitive_cylinder_add, radius=0.07, depth=5.0,
            location=(place[0], place[1], 2.5),
        )  # fmt: skip
    for x in (-1.2, 0.2):
        _add(_emission((1.0, 0.95, 0.85), 4000.0), bpy.ops.mesh.primitive_uv_sphere_add, radius=0.09,
             location=(x, 22.0, 0.8), segments=16, ring_count=8)  # fmt: skip
    _camera(scene, (0.0, -2.0, 1.7), (np.radians(88.0), 0.0, 0.0), 32.0)
    return scene


def candle() -> bpy.types.Scene:
    """A flame, extended, before a dark wall."""
    scene = clear()
    background(scene, (0.4, 0.4, 0.5), 0.02)
    wall = _add(_principled((0.3, 0.22, 0.18), 0.9), bpy.ops.mesh.primitive_plane_add, size=20)
    wall.location, wall.rotation_euler = (0.0, 3.0, 0.0), (np.radians(90), 0, 0)
    flame = _add(_emission((1.0, 0.62, 0.25), 120.0), bpy.ops.mesh.primitive_uv_sphere_add, radius=0.1,
                 location=(0.0, 0.0, 0.35), segments=24, ring_count=16)  # fmt: skip
    flame.scale = (0.5, 0.5, 2.2)
    _add(_principled((0.8, 0.75, 0.65), 0.5), bpy.ops.mesh.primitive_cylinder_add, radius=0.2, depth=1.2,
         location=(0.0, 0.0, -0.5))  # fmt: skip
    _camera(scene, (0.0, -4.0, 0.2), (np.radians(90.0), 0.0, 0.0), 50.0)
    return scene


def car() -> bpy.types.Scene:
    """Rounded lacquer in the sun: glints of few pixels a thousand times as bright as white."""
    scene = clear()
    background(scene, (0.35, 0.5, 0.9), 0.6)
    _add(_principled((0.25, 0.24, 0.22), 0.8), bpy.ops.mesh.primitive_plane_add, size=60)
    body = _add(_principled((0.6, 0.02, 0.02), 0.08, 0.4), bpy.ops.mesh.primitive_uv_sphere_add, radius=1.0,
                location=(0.0, 0.0, 0.7), segments=96, ring_count=48)  # fmt: skip
    body.scale = (2.2, 1.0, 0.6)
    top = _add(_principled((0.02, 0.02, 0.03), 0.05), bpy.ops.mesh.primitive_uv_sphere_add, radius=0.8,
               location=(-0.2, 0.0, 1.15), segments=96, ring_count=48)  # fmt: skip
    top.scale = (1.2, 0.9, 0.6)
    for x in (-1.3, 1.3):
        wheel = _add(_principled((0.9, 0.9, 0.9), 0.12, 1.0), bpy.ops.mesh.primitive_torus_add, major_radius=0.32,
                     minor_radius=0.07, location=(x, -0.95, 0.4), major_segments=64, minor_segments=24)  # fmt: skip
        wheel.rotation_euler = (np.radians(90), 0, 0)
    for thing in scene.objects:
        if thing.type == "MESH":
            for polygon in thing.data.polygons:
                polygon.use_smooth = True
    sun = bpy.data.lights.new("Sun", "SUN")
    sun.energy, sun.angle = 8.0, np.radians(0.53)
    placed = bpy.data.objects.new("Sun", sun)
    placed.rotation_euler = (np.radians(40), np.radians(-15), np.radians(-20))
    scene.collection.objects.link(placed)
    _camera(scene, (2.5, -6.0, 2.2), (np.radians(76.0), 0.0, np.radians(22.0)), 40.0)
    return scene


def interior() -> bpy.types.Scene:
    """A room in daylight through an opening behind the camera; nothing exceeds white by much."""
    scene = clear()
    background(scene, (0.8, 0.9, 1.0), 1.0)
    wall = _principled((0.7, 0.68, 0.6), 0.9)
    for location, turn in (
        ((0, 0, 0), (0, 0, 0)), ((0, 2, 2), (90, 0, 0)), ((-2, 0, 2), (0, 90, 0)), ((2, 0, 2), (0, 90, 0)),
        ((0, 0, 4), (180, 0, 0)),
    ):  # fmt: skip
        _add(wall, bpy.ops.mesh.primitive_plane_add, size=4, location=location,
             rotation=tuple(np.radians(turn)))  # fmt: skip
    _add(_principled((0.2, 0.4, 0.7), 0.4), bpy.ops.mesh.primitive_uv_sphere_add, radius=0.6, location=(0.3, 0.5, 0.6))
    _camera(scene, (0.0, -5.0, 1.8), (np.radians(88.0), 0.0, 0.0), 35.0)
    return scene


SCENES = {"street": street, "candle": candle, "car": car, "interior": interior}
