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
    A corner whose UVs have no area gets the object's x axis in its normal plane, as in Cycles, and sign +1.
    """
    result = np.zeros((len(corner_vertices), 4), np.float32)
    result[:, 3] = 1.0
    if len(triangles):
        # In units of the mesh's own size, so that no product over- or underflows float32.
        points = (positions / max(np.abs(positions).max(), 1e-30))[corner_vertices[triangles]]  # (T, 3 corners, 3)
        direction, mirrored = _texture_directions(points, uv[triangles])
        corners = triangles.reshape(-1)
        at = corner_normals[triangles]
        along = np.einsum("tcx,tx->tc", at, direction)[..., None]
        tangent = _normalized(direction[:, None, :] - at * along) * _angles(points)[..., None]
        group = _groups(positions, corner_vertices, corner_normals, uv, corners, np.repeat(mirrored, 3))
        flat = tangent.reshape(-1, 3)
        total = np.stack([np.bincount(group, weights=flat[:, axis]) for axis in range(3)], axis=1)
        result[corners, :3] = _normalized(total).astype(np.float32)[group]
        result[corners, 3] = np.repeat(np.where(mirrored, np.float32(-1.0), np.float32(1.0)), 3)
    lost = np.flatnonzero(np.einsum("ij,ij->i", result[:, :3], result[:, :3]) < 0.5)
    result[lost, :3] = _along_x(corner_normals[lost])
    return result


def _texture_directions(points, texture) -> tuple[np.ndarray, np.ndarray]:
    """(T, 3) unit dP/du of each triangle, zero without UV area, and (T,) whether its map is mirrored."""
    first, second = texture[:, 1] - texture[:, 0], texture[:, 2] - texture[:, 0]
    area = first[:, 0] * second[:, 1] - second[:, 0] * first[:, 1]
    along, across = points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]
    sign = np.sign(area)
    direction = along * (second[:, 1] * sign)[:, None] - across * (first[:, 1] * sign)[:, None]
    return _normalized(direction), area < 0.0


def _groups(positions, corner_vertices, corner_normals, uv, corners, mirrored) -> np.ndarray:
    """A number per triangle corner, equal where the corners share a tangent.

    Keyed by a 64-bit mix of the eight floats instead of sorting the rows themselves, which is ten times as slow.
    """
    key = _mixed(np.zeros(len(positions), np.uint64), positions)[corner_vertices]
    key = _mixed(_mixed(key, corner_normals), uv)
    return np.unique(key[corners] ^ mirrored, return_inverse=True)[1].reshape(-1)


def _mixed(key: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Fold the columns of float32 `values` (N, K) into 64-bit keys (N,); both zeros count as one number."""
    bits = np.ascontiguousarray(values + np.float32(0.0)).view(np.uint32)
    for column in bits.T:
        key = (key ^ column) * np.uint64(0x9E3779B97F4A7C15)
        key ^= key >> np.uint64(29)
    return key


def _angles(points: np.ndarray) -> np.ndarray:
    """(T, 3) angle of each triangle at each of its corners, radians."""
    edges = [_normalized(points[:, (i + 1) % 3] - points[:, i]) for i in range(3)]  # corner i to corner i + 1
    cosine = [-np.einsum("tx,tx->t", edges[i], edges[i - 1]) for i in range(3)]
    return np.arccos(np.clip(np.stack(cosine, axis=1), -1.0, 1.0))


def _normalized(vectors: np.ndarray) -> np.ndarray:
    """Unit vectors; zero stays zero."""
    length = np.sqrt(np.einsum("...x,...x->...", vectors, vectors))
    return vectors / np.where(length > 0.0, length, 1.0)[..., None]


def _along_x(normals: np.ndarray) -> np.ndarray:
    """The object's x axis in each normal's plane, as a unit vector; its y axis where the normal is x itself."""
    axis = np.where(np.abs(normals[:, :1]) < 0.9999, np.float32([1, 0, 0]), np.float32([0, 1, 0]))
    return _normalized(axis - normals * np.einsum("ij,ij->i", axis, normals)[:, None])
