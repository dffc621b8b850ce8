"""Shapes, lamps and cameras of the bench's scenes of mirrors, glass and caustics, made of numbers.

The same in every process, so that references of scenes made of them are found again by their content: Blender's own
sphere begins its faces elsewhere each time.
"""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Vector


def linked(name: str, data, location, turn=(0, 0, 0), scale=(1, 1, 1)) -> bpy.types.Object:
    """An object of the scene."""
    made = bpy.data.objects.new(name, data)
    made.location, made.rotation_euler, made.scale = location, turn, scale
    bpy.context.scene.collection.objects.link(made)
    return made


def aimed(name: str, data, location, target) -> bpy.types.Object:
    """A lamp or camera that looks from a place at another."""
    turn = (Vector(target) - Vector(location)).to_track_quat("-Z", "Y").to_euler()
    return linked(name, data, location, turn)


def solid(name: str, material, vertices, faces, smooth: bool = False, uv=None, place=(0, 0, 0), **how):
    """A mesh of (x, y, z) and lists of vertices; `uv`: (u, v) by corner of its faces; `how`: see `linked`."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([tuple(one) for one in vertices], [], [tuple(map(int, one)) for one in faces])
    if uv is not None:
        mesh.uv_layers.new(name="UVMap").uv.foreach_set("vector", np.asarray(uv, np.float32).ravel())
    mesh.materials.append(material)
    if smooth:
        mesh.shade_smooth()
    return linked(name, mesh, place, **how)


def plane(material, location, turn=(0, 0, 0), scale=(1, 1, 1)):
    """A square of two metres with a UV map."""
    corners = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    uv = [(0, 0), (1, 0), (1, 1), (0, 1)]
    return solid("Plane", material, corners, [(0, 1, 2, 3)], uv=uv, place=location, turn=turn, scale=scale)


def cube(material, location, size: float):
    bpy.ops.mesh.primitive_cube_add(size=size, location=location)
    bpy.context.object.data.materials.append(material)
    return bpy.context.object


def ball(material, location, radius: float, segments: int = 48):
    """A smooth sphere of half as many rings as segments, with a UV map: longitude and latitude."""
    rings = segments // 2
    high = np.pi * np.arange(1, rings) / rings
    vertices, faces, uv = _turned(radius * np.sin(high), -radius * np.cos(high), (-radius, radius), segments)
    return solid("Ball", material, vertices, faces, True, uv, location)


def lathe(material, profile, place=(0, 0, 0), segments: int = 48, smooth: bool = True):
    """A closed body: a line of (radius, height), from axis to axis, turned about z."""
    radii, heights = np.array(profile[1:-1], float).T
    vertices, faces, _ = _turned(radii, heights, (profile[0][1], profile[-1][1]), segments)
    made = solid("Lathe", material, vertices, faces, smooth, place=place)
    if smooth:
        made.data.set_sharp_from_angle(angle=0.6)
    return made


def _turned(radii: np.ndarray, heights: np.ndarray, poles: tuple[float, float], segments: int):
    """Vertices, faces and UV of rows of circles about z between two poles."""
    turn = 2 * np.pi * np.arange(segments) / segments
    x, y, z = radii[:, None] * np.cos(turn), radii[:, None] * np.sin(turn), heights[:, None] + 0 * turn
    vertices = [(0, 0, poles[0]), (0, 0, poles[1]), *np.stack([x, y, z], axis=-1).reshape(-1, 3)]
    faces, uv, rows = [], [], len(radii)
    for k in range(segments):
        after, left, right = (k + 1) % segments, k / segments, (k + 1) / segments
        low, last = 2, 2 + (rows - 1) * segments
        faces += [(0, low + after, low + k), (1, last + k, last + after)]
        v = 1 / (rows + 1)
        uv += [(left, 0), (right, v), (left, v), (left, 1), (left, 1 - v), (right, 1 - v)]
        for row in range(rows - 1):
            low, v = 2 + row * segments, (row + 1) / (rows + 1)
            faces.append((low + k, low + after, low + segments + after, low + segments + k))
            above = v + 1 / (rows + 1)
            uv += [(left, v), (right, v), (right, above), (left, above)]
    return vertices, faces, uv


def lamp(kind: str, location, target=(0, 0, 0), **settings):
    data = bpy.data.lights.new(kind.capitalize(), kind)
    for name, value in settings.items():
        setattr(data, name, value)
    return aimed(data.name, data, location, target)


def area(location, energy: float, size: float, target=(0, 0, 0.5)):
    return lamp("AREA", location, target, energy=energy, size=size)


def look(location, target, lens: float = 35.0):
    """The scene's camera."""
    data = bpy.data.cameras.new("Camera")
    data.lens = lens
    bpy.context.scene.camera = aimed("Camera", data, location, target)


def look_down(span: float, centre: tuple[float, float] = (0.0, 0.0), height: float = 10.0) -> None:
    """An orthographic camera above that sees so many metres."""
    data = bpy.data.cameras.new("Camera")
    data.type, data.ortho_scale = "ORTHO", span
    bpy.context.scene.camera = linked("Camera", data, (*centre, height))
