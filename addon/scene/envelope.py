"""How far a face lies above and below its own corners' tangent planes, for light on smooth-shaded faces.

Light begins where the curved surface would be that a face's normals speak of (shaders/light/terminator.glsl). A
parabola through the normals of a ball says where; of a face whose normals all lean the same way, as those of leaves on
cards that were taken from a ball around the crown, it says nothing. There the surface is the plane through the corner
that lies furthest along the normals (the local linear envelope of Cycles' shadow rays).
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ..snapshot.scene import Mesh

NOISE = 4e-6  # of a triangle's size, below which float32 says nothing
AT_ONCE = 1 << 16  # triangles, so that what is computed of them stays in the cache


def corner_shapes(meshes: Iterable[Mesh], places: np.ndarray, normals: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(C, 2) float32 the attribute `envelope` of the corners of all `meshes`, in their order: of strands what
    shaders/surface/strand.glsl reads, in place of what normal_envelope says."""
    out, first = normal_envelope(places, normals, triangles), 0
    for mesh in meshes:
        end = first + len(mesh.corner_vertices)
        if mesh.strands is not None:
            out[first:end] = mesh.strands[mesh.corner_vertices]
        first = end
    return out


def normal_envelope(places: np.ndarray, normals: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(C, 2) float32 in local metres, by corner: the least that its triangle reaches above it along the normals of its
    three corners, and below it. Both are 0 at most corners. A corner of two triangles has one of their values. Corners
    have `places` and `normals` (C, 3); `triangles` (T, 3) are numbers of corners."""
    out = np.zeros((len(places), 2), np.float32)
    for first in range(0, len(triangles), AT_ONCE):
        corners = triangles[first : first + AT_ONCE]
        start = places[corners[:, 0]]
        edges = [places[corners[:, k]] - start for k in (1, 2)]
        least = NOISE * np.maximum(*(_longest(edge) for edge in edges))
        above, below = [], []  # by normal, and within by corner
        for k in range(3):
            normal = normals[corners[:, k]]
            one, other = (np.einsum("tc,tc->t", normal, edge) for edge in edges)
            top, bottom = np.maximum(np.maximum(one, other), 0.0), np.minimum(np.minimum(one, other), 0.0)
            above.append((top, top - one, top - other))
            below.append((-bottom, one - bottom, other - bottom))
        for side, heights in enumerate((above, below)):
            for k, of_corner in enumerate(zip(*heights)):
                reach = np.minimum(np.minimum(of_corner[0], of_corner[1]), of_corner[2])
                out[corners[:, k], side] = np.where(reach > least, reach, 0.0)
    return out


def _longest(edges: np.ndarray) -> np.ndarray:
    """(T,) the largest coordinate of (T, 3), with any sign: along an axis of three numpy is slow."""
    x, y, z = np.abs(edges).T
    return np.maximum(np.maximum(x, y), z)
