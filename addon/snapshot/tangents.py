"""Tangents for normal maps, in numpy, as Blender and Cycles define them (Mikkelsen's tangent space).

Source: M. Mikkelsen, "Simulation of Wrinkled Surfaces Revisited", 2008, and the behaviour of his reference code:
the tangent of a corner is the sum over the triangles around its vertex of the triangle's unit dP/du, projected on
the corner's normal plane, weighted with the triangle's angle at the vertex. Triangles share a tangent where
position, normal and UV agree and the UV map is not mirrored between them; the sign of the bitangent is -1 where it
is mirrored. Changed: triangles that meet in a vertex but share no edge are summed too (the reference keeps
such fans apart), and the triangles are ours, as in Cycles, where Blender's own `calc_tangents` works on quads
and refuses larger polygons.
"""

from __future__ import annotations

import numpy as np


def corner_tangents(positions, corner_vertices, corner_normals, uv, triangles) -> np.ndarray:
    """(C, 4) float32: unit tangent in the normal plane, and the sign of the bitangent cross(n, t) * w.

    positions (V, 3), corner_vertices (C,), corner_normals (C, 3) unit, uv (C, 2), triangles (T, 3) corners.
    A corner whose UVs have no area gets some tangent of its normal plane and sign +1.
    """
    count = len(corner_vertices)
    normals = corner_normals.astype(np.float64)
    result = np.empty((count, 4), np.float32)
    result[:, :3] = _any_perpendicular(normals)
    result[:, 3] = 1.0
    if len(triangles) == 0:
        return result
    points = positions[corner_vertices[triangles]].astype(np.float64)  # (T, 3 corners, 3)
    texture = np.nan_to_num(uv[triangles].astype(np.float64))
    du1, dv1 = (texture[:, 1] - texture[:, 0]).T
    du2, dv2 = (texture[:, 2] - texture[:, 0]).T
    area = du1 * dv2 - du2 * dv1
    direction = (points[:, 1] - points[:, 0]) * dv2[:, None] - (points[:, 2] - points[:, 0]) * dv1[:, None]
    direction = _normalized(direction * np.sign(area)[:, None])
    corners = triangles.reshape(-1)
    at = normals[corners]
    tangent = np.repeat(direction, 3, axis=0)
    tangent = _normalized(tangent - at * np.einsum("ij,ij->i", at, tangent)[:, None])
    tangent *= _angles(points).reshape(-1)[:, None]
    mirrored = np.repeat(area < 0.0, 3)
    group = _groups(positions, corner_vertices, corner_normals, uv, corners, mirrored)
    total = np.stack([np.bincount(group, weights=tangent[:, axis]) for axis in range(3)], axis=1)
    summed = total[group]
    valid = np.einsum("ij,ij->i", summed, summed) > 0.0
    result[corners[valid], :3] = _normalized(summed[valid])
    result[corners, 3] = np.where(mirrored, -1.0, 1.0)
    return result


def _groups(positions, corner_vertices, corner_normals, uv, corners, mirrored) -> np.ndarray:
    """A number per triangle corner, equal where the corners share a tangent.

    Keyed by a 64-bit mix of the eight floats instead of sorting the rows themselves, which is ten times as slow.
    """
    values = np.concatenate([positions[corner_vertices], corner_normals, uv], axis=1)[corners]
    bits = np.ascontiguousarray(values + np.float32(0.0)).view(np.uint32).astype(np.uint64)  # + 0: one kind of zero
    key = mirrored.astype(np.uint64)
    for column in range(bits.shape[1]):
        key = (key ^ bits[:, column]) * np.uint64(0x9E3779B97F4A7C15)
        key ^= key >> np.uint64(29)
    return np.unique(key, return_inverse=True)[1].reshape(-1)


def _angles(points: np.ndarray) -> np.ndarray:
    """(T, 3) angle of each triangle at each of its corners, radians."""
    edges = _normalized(np.roll(points, -1, axis=1) - points)  # corner i to corner i + 1
    cosine = -np.einsum("tij,tij->ti", edges, np.roll(edges, 1, axis=1))
    return np.arccos(np.clip(cosine, -1.0, 1.0))


def _normalized(vectors: np.ndarray) -> np.ndarray:
    """Unit vectors; zero stays zero."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0.0, length, 1.0)


def _any_perpendicular(normals: np.ndarray) -> np.ndarray:
    """A unit vector in each normal's plane: the world axis that leans least on the normal, projected."""
    axis = np.eye(3)[np.argmin(np.abs(normals), axis=1)] if len(normals) else np.zeros((0, 3))
    return _normalized(axis - normals * np.einsum("ij,ij->i", axis, normals)[:, None])
