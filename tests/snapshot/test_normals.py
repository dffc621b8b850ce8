"""Smooth normals in a fixed order: the same sum as Blender's, but for its last bits."""

import bpy
import numpy as np
import pytest

from addon.snapshot.meshes import Wanted, read_mesh
from addon.snapshot.normals import AGREE, in_fixed_order


def evaluated(make, smooth=True, **given):
    make(**given)
    data = bpy.context.object.data
    if smooth:
        data.shade_smooth()
    return data


@pytest.mark.parametrize(
    "make, given",
    [
        (bpy.ops.mesh.primitive_uv_sphere_add, {"segments": 12, "ring_count": 7}),
        (bpy.ops.mesh.primitive_monkey_add, {}),
        (bpy.ops.mesh.primitive_cone_add, {"vertices": 9, "end_fill_type": "NGON"}),
        (bpy.ops.mesh.primitive_torus_add, {"major_segments": 9, "minor_segments": 5}),
    ],
)
def test_all_smooth_normals_are_found_again(empty_scene, make, given):
    data = evaluated(make, **given)
    raw = read_mesh(data, Wanted())
    noisy = raw.corner_normals + np.random.default_rng(3).normal(0, 1e-7, raw.corner_normals.shape).astype(np.float32)
    ordered = [
        in_fixed_order(raw.positions, raw.corner_vertices, raw.face_starts, normals)
        for normals in (raw.corner_normals, noisy)
    ]
    np.testing.assert_array_equal(*ordered)
    np.testing.assert_allclose(ordered[0], raw.corner_normals, atol=5e-5)  # Blender's arc cosine is an approximation
    np.testing.assert_array_equal(read_mesh(data, Wanted(), fixed_order=True).corner_normals, ordered[0])


def test_sharp_edges_and_custom_normals_stay_blenders(empty_scene):
    data = evaluated(bpy.ops.mesh.primitive_cube_add)
    data.edges[0].use_edge_sharp = True
    data.normals_split_custom_set([(0.0, 0.6, 0.8)] * 4 + [(0.0, 0.0, 0.0)] * 20)
    raw = read_mesh(data, Wanted())
    ordered = in_fixed_order(raw.positions, raw.corner_vertices, raw.face_starts, raw.corner_normals)
    assert np.linalg.norm(ordered - raw.corner_normals, axis=1).max() < AGREE
    np.testing.assert_array_equal(ordered[:4], raw.corner_normals[:4])


def test_broken_meshes_keep_what_blender_gives():
    normals = np.ones((3, 3), np.float32)
    corners, starts = np.arange(3, dtype=np.int32), np.zeros(1, np.int32)
    for positions in (np.full((3, 3), np.nan, np.float32), np.zeros((3, 3), np.float32)):
        np.testing.assert_array_equal(in_fixed_order(positions, corners, starts, normals), normals)
    assert len(in_fixed_order(positions[:0], corners[:0], starts[:0], normals[:0])) == 0
