"""How far a face lies above and below its own corners' tangent planes, for light on smooth-shaded faces.

Light begins where the curved surface would be that a face's normals speak of (shaders/light/terminator.glsl). A
parabola through the normals of a ball says where; of a face whose normals all lean the same way, as those of leaves on
cards that were taken from a ball around the crown, it says nothing. There the surface is the plane through the corner
that lies furthest along the normals (the local linear envelope of Cycles' shadow rays).
"""

from __future__ import annotations

import numpy as np

from ..snapshot.scene import Mesh

NOISE = 4e-6  # of a triangle's size, below which float32 says nothing
AT_ONCE = 1 << 16  # triangles, so that what is computed of them stays in the cache


def normal_envelope(mesh: Mesh) -> np.ndarray:
    """(C, 2) float32 in local metres, by corner: the least that the triangle reaches above it along the normals of its
    three corners, and below it. Both are 0 at most corners. A corner of two triangles has one of their values."""
    out = np.zeros((len(mesh.corner_vertices), 2), np.float32)
    for first in range(0, mesh.triangle_count, AT_ONCE):
        corners = mesh.triangle_corners[first : first + AT_ONCE]
        places = mesh.positions[mesh.corner_vertices[corners]]
        edges = [places[:, k] - places[:, 0] for k in (1, 2)]
        least = NOISE * np.maximum(*(np.abs(edge).max(axis=1) for edge in edges))
        above, below = [], []  # by normal, and within by corner
        for k in range(3):
            normal = mesh.corner_normals[corners[:, k]]
            one, other = (np.einsum("tc,tc->t", normal, edge) for edge in edges)
            top, bottom = np.maximum(np.maximum(one, other), 0.0), np.minimum(np.minimum(one, other), 0.0)
            above.append((top, top - one, top - other))
            below.append((-bottom, one - bottom, other - bottom))
        for side, heights in enumerate((above, below)):
            for k, of_corner in enumerate(zip(*heights)):
                reach = np.minimum(np.minimum(of_corner[0], of_corner[1]), of_corner[2])
                out[corners[:, k], side] = np.where(reach > least, reach, 0.0)
    return out
