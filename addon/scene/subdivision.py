"""Triangles of a mesh cut into four, so that its vertices can carry displacement that it was too coarse for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..materials.nodes.inputs import FLAT
from ..snapshot.scene import Mesh


def subdivided(mesh: Mesh) -> Mesh:
    """The mesh with each triangle cut into four at the middles of its edges, which neighbours share: it stays closed.
    What corners and vertices hold is interpolated. Pieces of flat faces count as smooth; their normals stay the face's
    until vertices are moved. Key and version are the mesh's own.
    Tubes of hair lose what they are."""
    corners = mesh.triangle_corners
    ends = mesh.corner_vertices[corners]
    sides = np.stack([ends, np.roll(ends, -1, axis=1)], axis=2).reshape(-1, 2)
    edges, of_side = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True)
    count = len(mesh.positions)
    middle = (count + of_side.reshape(-1, 3)).astype(np.int32)  # of the side that begins at each corner

    def of_vertices(values: np.ndarray | None) -> np.ndarray | None:
        if values is None:
            return None
        return np.concatenate([values, 0.5 * (values[edges[:, 0]] + values[edges[:, 1]])]).astype(values.dtype)

    def of_corners(values: np.ndarray) -> np.ndarray:
        """Of each triangle its corners, then the middles of the sides that begin there."""
        own = values[corners]
        return np.concatenate([own, 0.5 * (own + np.roll(own, -1, axis=1))], axis=1).reshape(-1, values.shape[1])

    first = 6 * np.arange(len(corners), dtype=np.int32)[:, None]
    pieces = np.array([(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)], np.int32)
    normals = of_corners(mesh.corner_normals)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    colors = {name: of_corners(values) for name, values in mesh.colors.items()}
    if FLAT in colors:
        colors[FLAT] = np.zeros_like(colors[FLAT])
    return replace(
        mesh,
        positions=of_vertices(mesh.positions),
        corner_vertices=np.concatenate([ends, middle], axis=1).reshape(-1).astype(np.int32),
        corner_normals=normals.astype(np.float32),
        triangle_corners=(first[:, None] + pieces).reshape(-1, 3).astype(np.int32),
        triangle_slots=np.repeat(mesh.triangle_slots, 4),
        uv_maps={name: of_corners(values) for name, values in mesh.uv_maps.items()},
        colors=colors,
        tangents={name: of_corners(values) for name, values in mesh.tangents.items()},
        generated=of_vertices(mesh.generated),
        motion=None if mesh.motion is None else tuple(of_vertices(one) for one in mesh.motion),
        velocity=of_vertices(mesh.velocity),
        strands=None,
    )
