"""Meshes cut for displacement: closed as before, of the same surface, with what corners held in between."""

from dataclasses import replace

import numpy as np

from addon.scene.mesh_parts import parts_of
from addon.scene.subdivision import subdivided
from addon.snapshot.scene import Mesh


def tetrahedron() -> Mesh:
    places = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], np.float32)
    faces = np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)], np.int32)
    at = places[faces].astype(np.float64)
    normals = np.cross(at[:, 1] - at[:, 0], at[:, 2] - at[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Mesh(
        "tetrahedron", 1, places, faces.reshape(-1), np.repeat(normals, 3, axis=0).astype(np.float32),
        np.arange(12, dtype=np.int32).reshape(-1, 3), np.array([0, 0, 1, 1], np.int32), 2,
        uv_maps={"map": places[faces.reshape(-1), :2]}, generated=places,
    )  # fmt: skip


def test_pieces_close_and_hold_what_was_there():
    mesh = replace(tetrahedron(), strands=np.zeros((4, 2), np.float32))
    cut = subdivided(subdivided(mesh))
    assert cut.strands is None  # what says so runs over the vertices before
    assert cut.triangle_count == 16 * mesh.triangle_count
    triangles = cut.corner_vertices[cut.triangle_corners]
    assert parts_of(cut.positions, triangles).closed.tolist() == [True]
    assert len(cut.positions) == 34  # Euler: edges - faces + 2, three edges for two faces
    a, b, c = np.moveaxis(cut.positions[triangles].astype(np.float64), 1, 0)
    across = np.cross(b - a, c - a)
    np.testing.assert_allclose(np.linalg.norm(across, axis=1).sum() / 2, 1.5 + np.sqrt(0.75), rtol=1e-6)
    facing = np.einsum("ti,ti->t", across, cut.corner_normals[cut.triangle_corners[:, 0]])
    assert facing.min() > 0.0 and cut.triangle_slots.tolist() == sorted(cut.triangle_slots)
    np.testing.assert_allclose(cut.uv_maps["map"], cut.positions[cut.corner_vertices, :2], atol=1e-6)
    np.testing.assert_array_equal(cut.generated, cut.positions)
