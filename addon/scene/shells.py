"""Shells over triangles: prisms between a mesh at the lowest level of its relief and at the highest, for drawing.

Each triangle is extruded along the normals at its corners; prisms of neighbours share their sides, so together they
fill the space in which the surface may be. A fragment knows its triangle by a number, under which a list holds the
corners with all that the material reads there (layout in shaders/surface/shell.glsl). How far a vertex is moved along
its normal is the vertex shader's, so heights may change without a new mesh.

Costs 8 triangles and 6 vertices of 40 bytes for each triangle, and 96 bytes and 48 an attribute in the list.
"""

from __future__ import annotations

import numpy as np

from ..materials.compiled import Attribute
from ..snapshot.scene import Mesh
from .corners import corner_attribute


def outward(mesh: Mesh, own: np.ndarray) -> np.ndarray:
    """(T, 3) corners of the triangles `own` (a mask), anticlockwise seen from where normals point."""
    corners = mesh.triangle_corners[own].copy()
    a, b, c = np.moveaxis(mesh.positions[mesh.corner_vertices[corners]].astype(np.float64), 1, 0)
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), mesh.corner_normals[corners].sum(axis=1)) < 0.0
    corners[inward] = corners[inward][:, ::-1]
    return corners


def corner_list(mesh: Mesh, own: np.ndarray, attributes: tuple[Attribute, ...]) -> np.ndarray:
    """(T * 3 * (2 + A), 4) float32: of each corner of each triangle its place, its normal and the attributes."""
    corners = outward(mesh, own)
    places = np.zeros((len(mesh.corner_vertices), 2, 4), np.float32)
    places[:, 0, :3] = mesh.positions[mesh.corner_vertices]
    places[:, 1, :3] = mesh.corner_normals
    values = [places, *(corner_attribute(mesh, attribute)[:, None] for attribute in attributes)]
    return np.concatenate(values, axis=1)[corners].reshape(-1, 4)


def prisms(mesh: Mesh, own: np.ndarray, first: int) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Vertices by attribute and (8 T, 3) triangles, all facing outwards, of the prisms over the triangles `own`, which
    have numbers from `first` on. `shell` of a vertex: 0 at the lowest level and 1 at the highest, and the number."""
    corners = outward(mesh, own)
    count = len(corners)
    places = mesh.positions[mesh.corner_vertices[corners]]
    normals = mesh.corner_normals[corners]
    shell = np.zeros((count, 6, 2), np.float32)
    shell[:, 3:, 0] = 1.0
    shell[:, :, 1] = (first + np.arange(count))[:, None]
    vertices = {
        "position": np.concatenate([places, places], axis=1).reshape(-1, 3),
        "normal": np.concatenate([normals, normals], axis=1).reshape(-1, 3),
        "shell": shell.reshape(-1, 2),
    }
    of_corner = mesh.corner_vertices[corners]
    faces = np.empty((count, 8, 3), np.int64)
    faces[:, 0] = (3, 4, 5)
    faces[:, 1] = (0, 2, 1)
    for k in range(3):
        a, b = k, (k + 1) % 3
        # Neighbours cut the side that they share, which need not be plane, along the same diagonal.
        rising = (of_corner[:, a] < of_corner[:, b])[:, None, None]
        faces[:, 2 + 2 * k : 4 + 2 * k] = np.where(
            rising, [[(a, b, b + 3), (a, b + 3, a + 3)]], [[(a, b, a + 3), (b, b + 3, a + 3)]]
        )
    faces += 6 * np.arange(count)[:, None, None]
    return vertices, faces.reshape(-1, 3)
