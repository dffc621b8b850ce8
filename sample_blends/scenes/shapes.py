"""Polygon shapes as numpy arrays, before they become Blender meshes.

Lengths are metres, z is up, faces wind counter-clockwise seen from outside. Every function returns a new Shape.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np


@dataclass(frozen=True)
class Shape:
    """Polygons over shared vertices; `uvs` holds one (u, v) per face corner, in face order, or nothing."""

    vertices: np.ndarray  # (V, 3) float64
    faces: list[tuple[int, ...]]
    uvs: list[tuple[float, float]] = field(default_factory=list)
    slots: list[int] = field(default_factory=list)  # material slot per face; empty: all 0

    def __add__(self, other: Shape) -> Shape:
        shift = len(self.vertices)
        faces = self.faces + [tuple(i + shift for i in face) for face in other.faces]
        slots = self.face_slots() + other.face_slots()
        return Shape(np.vstack([self.vertices, other.vertices]), faces, self.uvs + other.uvs, slots)

    def face_slots(self) -> list[int]:
        return self.slots or [0] * len(self.faces)

    def in_slot(self, slot: int) -> Shape:
        return Shape(self.vertices, self.faces, self.uvs, [slot] * len(self.faces))

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Shape:
        return Shape(self.vertices + (x, y, z), self.faces, self.uvs, self.slots)

    def scaled(self, x: float, y: float, z: float) -> Shape:
        return Shape(self.vertices * (x, y, z), self.faces, self.uvs, self.slots)

    def turned(self, axis: str, degrees: float) -> Shape:
        """Rotate about a coordinate axis through the origin, right-handed."""
        return Shape(self.vertices @ rotation(axis, degrees).T, self.faces, self.uvs, self.slots)


def rotation(axis: str, degrees: float) -> np.ndarray:
    """The 3x3 right-handed rotation about 'x', 'y' or 'z'."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    first, second = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    matrix = np.eye(3)
    matrix[first, first] = matrix[second, second] = c
    matrix[first, second], matrix[second, first] = -s, s
    return matrix


def join(shapes: list[Shape]) -> Shape:
    total = shapes[0]
    for shape in shapes[1:]:
        total = total + shape
    return total


def box(width: float, depth: float, height: float) -> Shape:
    """A box standing on z = 0, centred in x and y."""
    x, y, z = width / 2, depth / 2, height
    vertices = [(-x, -y, 0), (x, -y, 0), (x, y, 0), (-x, y, 0), (-x, -y, z), (x, -y, z), (x, y, z), (-x, y, z)]
    faces = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    return Shape(np.array(vertices, float), faces)


def plane(width: float, depth: float, repeat: tuple[float, float] = (1.0, 1.0)) -> Shape:
    """A rectangle at z = 0 facing up; its UVs span `repeat` tiles."""
    x, y = width / 2, depth / 2
    vertices = np.array([(-x, -y, 0), (x, -y, 0), (x, y, 0), (-x, y, 0)], float)
    u, v = repeat
    return Shape(vertices, [(0, 1, 2, 3)], [(0, 0), (u, 0), (u, v), (0, v)])


def grid(columns: int, rows: int, surface) -> Shape:
    """A patch of quads: `surface(u, v)` maps arrays in [0, 1] to (..., 3) points; UVs are (u, v)."""
    u, v = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1))
    vertices = np.asarray(surface(u, v), float).reshape(-1, 3)
    faces, uvs = [], []
    for row in range(rows):
        for column in range(columns):
            first = row * (columns + 1) + column
            face = (first, first + 1, first + columns + 2, first + columns + 1)
            faces.append(face)
            uvs += [(u.flat[i], v.flat[i]) for i in face]
    return Shape(vertices, faces, uvs)


def lathe(profile: list[tuple[float, float]], segments: int = 32) -> Shape:
    """Turn (radius, z) points about the z axis; points from bottom to top face outwards. Radius 0 makes a pole."""
    vertices, rings = [], []
    angles = np.linspace(0, 2 * np.pi, segments, endpoint=False)
    for radius, z in profile:
        start = len(vertices)
        if radius == 0:
            vertices.append((0, 0, z))
            rings.append([start] * segments)
        else:
            vertices += [(radius * np.cos(a), radius * np.sin(a), z) for a in angles]
            rings.append(list(range(start, start + segments)))
    faces = []
    for low, high in pairwise(rings):
        for i in range(segments):
            j = (i + 1) % segments
            face = tuple(dict.fromkeys((low[i], low[j], high[j], high[i])))
            if len(face) > 2:
                faces.append(face)
    return Shape(np.array(vertices, float), faces)


def ball(radius: float, segments: int = 32, rings: int = 16) -> Shape:
    """A sphere about the origin."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, rings + 1)
    profile = [(radius * np.cos(a), radius * np.sin(a)) for a in angles]
    profile[0], profile[-1] = (0, -radius), (0, radius)
    return lathe(profile, segments)


def cylinder(radius: float, height: float, segments: int = 24) -> Shape:
    """A closed cylinder standing on z = 0."""
    return lathe([(0, 0), (radius, 0), (radius, height), (0, height)], segments)


def ring(radius: float, thickness: float, segments: int = 48, sides: int = 12) -> Shape:
    """A torus in the x-y plane; `thickness` is the radius of its tube."""
    angles = np.linspace(0, 2 * np.pi, segments, endpoint=False)
    path = np.stack([radius * np.cos(angles), radius * np.sin(angles), 0 * angles], axis=1)
    return tube(path, thickness, sides, closed=True)


def tube(path, radius, sides: int = 8, closed: bool = False) -> Shape:
    """Sweep a circle along `path` (N, 3) without twist; `radius` is one number or one per point."""
    path = np.asarray(path, float)
    count = len(path)
    radius = np.broadcast_to(radius, count)
    if closed:
        tangents = np.roll(path, -1, 0) - np.roll(path, 1, 0)
    else:
        tangents = np.gradient(path, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    side = np.cross(tangents[0], np.eye(3)[np.argmin(np.abs(tangents[0]))])
    sides_along = []
    for tangent in tangents:  # carry the frame along: remove what the new tangent no longer is square to
        side = side - tangent * (side @ tangent)
        side /= np.linalg.norm(side)
        sides_along.append(side)
    turn = np.zeros(count)
    if closed:  # spread the frame's closing error evenly over the loop
        other = np.cross(tangents[0], sides_along[0])
        last = side - tangents[0] * (side @ tangents[0])
        turn = -np.arctan2(last @ other, last @ sides_along[0]) * np.arange(count) / count
    vertices = []
    for point, tangent, side, size, offset in zip(path, tangents, sides_along, radius, turn, strict=True):
        other = np.cross(tangent, side)
        angles = np.linspace(0, 2 * np.pi, sides, endpoint=False)[:, None] + offset
        vertices.append(point + size * (np.cos(angles) * side + np.sin(angles) * other))
    faces = []
    for i in range(count if closed else count - 1):
        j = (i + 1) % count
        for k in range(sides):
            m = (k + 1) % sides
            faces.append((i * sides + k, i * sides + m, j * sides + m, j * sides + k))
    if not closed:
        faces.append(tuple(range(sides))[::-1])
        faces.append(tuple(range((count - 1) * sides, count * sides)))
    return Shape(np.vstack(vertices), faces)


def extrude(outline, depth: float) -> Shape:
    """Give thickness to a counter-clockwise outline of (x, z) points; it stands upright, centred on y = 0."""
    outline = np.asarray(outline, float)
    count = len(outline)
    near = np.stack([outline[:, 0], np.full(count, -depth / 2), outline[:, 1]], axis=1)
    far = near + (0, depth, 0)
    faces = [tuple(range(count)), tuple(range(count, 2 * count))[::-1]]
    for i in range(count):
        j = (i + 1) % count
        faces.append((j, i, i + count, j + count))
    return Shape(np.vstack([near, far]), faces)


def arch(width: float, height: float, opening: float, spring: float, depth: float, segments: int = 20) -> Shape:
    """A wall with a round-headed opening that starts to curve at the height `spring`."""
    angles = np.linspace(np.pi, 0, segments + 1)
    curve = [(opening / 2 * np.cos(a), spring + opening / 2 * np.sin(a)) for a in angles]
    inside = [(-opening / 2, 0.0), *curve, (opening / 2, 0.0)]
    outside = [(width / 2, 0.0), (width / 2, height), (-width / 2, height), (-width / 2, 0.0)]
    return extrude(inside + outside, depth)
