"""Tangents agree with Blender's own, which come from Mikkelsen's reference code."""

import bpy
import numpy as np
import pytest

from addon.snapshot.tangents import corner_tangents


def normal_mapped(stage, data, uv_map=""):
    material = stage.material()
    tree = material.node_tree
    node = tree.nodes.new("ShaderNodeNormalMap")
    node.uv_map = uv_map
    shader = next(one for one in tree.nodes if one.type == "BSDF_PRINCIPLED")
    tree.links.new(node.outputs[0], shader.inputs["Normal"])
    data.materials.append(material)
    stage.link("O", data)


def sphere(stage):
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3, calc_uvs=True)
    placed = bpy.context.object
    data = placed.data
    data.shade_smooth()
    bpy.data.objects.remove(placed)
    return data


def blenders(data, name):
    data.calc_tangents(uvmap=name)
    tangents, signs = np.empty(len(data.loops) * 3, np.float32), np.empty(len(data.loops), np.float32)
    data.loops.foreach_get("tangent", tangents)
    data.loops.foreach_get("bitangent_sign", signs)
    data.free_tangents()
    return tangents.reshape(-1, 3), signs


def only_mesh(snapshot):
    (mesh,) = snapshot.meshes.values()
    return mesh


def test_tangents_of_a_smooth_sphere_are_blenders(stage):
    data = sphere(stage)
    name = data.uv_layers[0].name
    normal_mapped(stage, data)
    ours = only_mesh(stage.take()).tangents[name]
    tangents, signs = blenders(data, name)
    cosine = np.einsum("ij,ij->i", ours[:, :3], tangents)
    assert np.array_equal(ours[:, 3], signs)
    assert np.quantile(cosine, 0.02) > 0.999
    assert cosine.min() > 0.8  # fans that only touch in a vertex are summed here


def test_tangents_follow_u_on_a_plane_and_turn_with_a_mirrored_map():
    positions = np.array([(0, 0, 0), (2, 0, 0), (0, 3, 0)], np.float32)
    corners = np.arange(3, dtype=np.int32)
    normals = np.tile(np.float32((0, 0, 1)), (3, 1))
    triangles = corners.reshape(1, 3)
    straight = np.array([(0, 0), (1, 0), (0, 1)], np.float32)
    tangents = corner_tangents(positions, corners, normals, straight, triangles)
    assert np.allclose(tangents, [[1, 0, 0, 1]] * 3)
    tangents = corner_tangents(positions, corners, normals, straight * np.float32((-1, 1)), triangles)
    assert np.allclose(tangents, [[-1, 0, 0, -1]] * 3)


@pytest.mark.parametrize("size", [1e-15, 1e-3, 1e6, 1e17])
def test_tangents_do_not_depend_on_the_size_of_the_mesh(size):
    positions = np.array([(0, 0, 0), (2, 0, 0), (0, 3, 0)], np.float32) * np.float32(size)
    corners = np.arange(3, dtype=np.int32)
    normals = np.tile(np.float32((0, 0, 1)), (3, 1))
    uv = np.array([(0, 0), (1, 0.5), (0, 1)], np.float32)
    tangents = corner_tangents(positions, corners, normals, uv, corners.reshape(1, 3))
    # dP/du = (2, -1.5, 0): one step in u alone goes from the first corner to (2, -1.5, 0).
    assert np.allclose(tangents, [[0.8, -0.6, 0, 1]] * 3, atol=1e-6)


@pytest.mark.parametrize("normal", [(0, 0, 1), (1, 2, 3), (-2, 1, 0.3), (1, 0, 0)])
def test_a_map_without_area_gives_the_x_axis_in_the_plane(normal):
    """As Cycles has it, but where that has no tangent, on what faces x."""
    normal = np.float32(normal) / np.linalg.norm(normal).astype(np.float32)
    across = np.cross(normal, np.roll(normal, 1) + np.float32([0.3, 0.1, 0]))
    positions = np.stack([0 * across, across, np.cross(normal, across)])
    corners = np.arange(3)
    tangents = corner_tangents(
        positions, corners, np.tile(normal, (3, 1)), np.zeros((3, 2), np.float32), corners[None]
    )[:, :3]  # fmt: skip
    expected = np.array([1, 0, 0]) - normal[0] * normal if normal[0] < 1 else np.array([0, 1, 0])
    assert tangents == pytest.approx(np.tile(expected / np.linalg.norm(expected), (3, 1)), abs=1e-6)


def test_polygons_that_blender_refuses_have_tangents_too(stage):
    angle = np.linspace(0, 2 * np.pi, 6, endpoint=False)
    around = np.stack([np.cos(angle), np.sin(angle), np.zeros(6)], axis=1)
    data = stage.mesh(vertices=around.tolist(), faces=[tuple(range(6))])
    data.uv_layers.new(name="uv").data.foreach_set("uv", around[:, :2].astype(np.float32).reshape(-1))
    normal_mapped(stage, data)
    assert np.allclose(only_mesh(stage.take()).tangents["uv"], [[1, 0, 0, 1]] * 6, atol=1e-6)


def test_only_the_maps_that_are_asked_for_have_tangents(stage):
    data = stage.grid(1)
    for name in ("first", "second"):
        data.uv_layers.new(name=name)
    normal_mapped(stage, data, uv_map="second")
    assert set(only_mesh(stage.take()).tangents) == {"second"}


def test_meshes_without_normal_maps_have_no_tangents(stage):
    data = stage.grid(1)
    data.uv_layers.new()
    stage.link("O", data)
    assert only_mesh(stage.take()).tangents == {}


def test_asking_later_gives_tangents_then(stage):
    from addon.snapshot import SnapshotCache

    cache = SnapshotCache()
    data = stage.grid(1)
    data.uv_layers.new(name="uv")
    placed = stage.link("O", data)
    old = only_mesh(stage.take(cache))
    bpy.data.objects.remove(placed)
    normal_mapped(stage, data)
    new = only_mesh(stage.take(cache))
    assert set(new.tangents) == {"uv"}
    assert new.version > old.version


def test_triangles_count_by_their_angle_at_the_corner():
    """Two triangles of 30 and 120 degrees at the vertex they share, whose maps run in other directions."""
    turn = np.radians([0.0, 30.0, 150.0])
    positions = np.concatenate([np.zeros((1, 3)), np.stack([np.cos(turn), np.sin(turn), 0 * turn], 1)]).astype(
        np.float32
    )
    corner_vertices = np.array([0, 1, 2, 0, 2, 3], np.int32)
    triangles = np.arange(6, dtype=np.int32).reshape(2, 3)
    uv = np.array([(0, 0), (1, 0), (0.9, 0.5), (0, 0), (0.9, 0.5), (0.1, 0.9)], np.float32)
    directions = []
    for corners in triangles:
        edges = positions[corner_vertices[corners]][1:] - positions[0]
        along = np.linalg.inv(uv[corners][1:]) @ edges  # dP/du, dP/dv
        directions.append(along[0] / np.linalg.norm(along[0]))
    expected = 30 * directions[0] + 120 * directions[1]
    normals = np.tile(np.float32([0, 0, 1]), (6, 1))
    found = corner_tangents(positions, corner_vertices, normals, uv, triangles)
    np.testing.assert_allclose(found[0, :3], expected / np.linalg.norm(expected), atol=1e-6)
    assert abs(np.dot(found[0, :3], sum(directions) / np.linalg.norm(sum(directions)))) < 0.999, "or angles are nothing"
