"""Hair curves and point clouds as meshes: where they lie, how wide they look, and Cycles' picture of them."""

import bpy
import numpy as np
import pytest

from addon.materials.nodes.inputs import ROUND
from addon.snapshot import SnapshotCache
from addon.snapshot.strands import AXIS_STEPS, ROUND_SIDES, STEPS, spheres, strand_shape, tubes


def shadow_width(positions, triangles, direction):
    """Mean over points of a silhouette: area of a closed surface projected along `direction`."""
    corners = positions[triangles].astype(float)
    faces = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return 0.5 * np.abs(faces @ direction).sum()


def test_a_straight_hair_is_a_tube_of_its_radius_and_mean_width():
    points = np.array([[0, 0, 0], [0, 0, 1], [0, 0, 3]], np.float32)
    positions, normals, triangles, source = tubes(points, np.full(3, 0.1), np.array([0, 3]))
    assert len(positions) == (2 * STEPS + 1) * ROUND_SIDES[0]
    assert positions[:, 2].min() == 0.0 and positions[:, 2].max() == 3.0
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-6)
    np.testing.assert_allclose(normals[:, 2], 0.0, atol=1e-6)
    turns = np.linspace(0, np.pi, 64, endpoint=False)
    width = [shadow_width(positions, triangles, np.array([np.cos(a), np.sin(a), 0])) / 3.0 for a in turns]
    assert np.mean(width) == pytest.approx(0.2, rel=1e-3)
    np.testing.assert_allclose(width, 0.2, rtol=0.03)  # from every side
    assert sorted(set(source)) == [0, 1, 2]


@pytest.mark.parametrize("sides", [9, 7, 5, 3])
def test_many_hairs_have_their_width_from_every_side(monkeypatch, sides):
    """One of them within what the sides allow, two hundred side by side within .5 %."""
    monkeypatch.setattr("addon.snapshot.strands.ROUND_SIDES", (sides,))
    points = np.array([[x, 0, z] for x in range(200) for z in (0, 1)], np.float32)
    positions, _, triangles, source = tubes(points, np.full(400, 0.1), 2 * np.arange(201))
    first = triangles[(source[triangles] < 2).all(axis=1)]
    least, most = {9: (0.989, 1.006), 7: (0.982, 1.009), 5: (0.966, 1.018), 3: (0.9, 1.05)}[sides]
    for turn in np.linspace(0, np.pi, 16, endpoint=False):
        side = np.array([np.cos(turn), np.sin(turn), 0])
        assert shadow_width(positions, triangles, side) / 200 == pytest.approx(0.2, rel=5e-3)
        assert least < shadow_width(positions, first, side) / 0.2 < most


def test_a_curve_passes_through_its_points_and_does_not_reach_into_the_next():
    rng = np.random.default_rng(3)
    points = rng.uniform(-1, 1, (9, 3)).astype(np.float32)
    offsets = np.array([0, 4, 5, 9])  # the second has one point: nothing to draw
    positions, _, triangles, source = tubes(points, np.full(9, 1e-4), offsets)
    for k in (0, 1, 2, 3, 5, 6, 7, 8):
        assert np.linalg.norm(positions - points[k], axis=1).min() < 2e-4
    assert 4 not in source
    curve = np.searchsorted(offsets, source, side="right")
    assert (np.ptp(curve[triangles], axis=1) == 0).all()


def test_broken_points_leave_whole_numbers_as_axes():
    points, radii = np.array([[0, 0, 0], [0, np.nan, 1], [np.inf, 0, 2], [0, 0, 3]], np.float32), np.full(4, 0.1)
    radii[2], offsets = np.nan, np.array([0, 4])
    with np.errstate(invalid="ignore"):
        shape = strand_shape(tubes(points, radii, offsets), points, radii, offsets)
    assert np.isfinite(shape).all() and (shape[:, 1] == np.rint(shape[:, 1])).all()
    assert (-shape[:, 1] // AXIS_STEPS**2 == ROUND_SIDES[0]).all()


def test_triangles_face_outwards():
    points = np.array([[0, 0, 0], [1, 0.3, 0], [1.5, 1, 0.2]], np.float32)
    for positions, normals, triangles, _ in (
        tubes(points, np.full(3, 0.05), np.array([0, 3])),
        spheres(points, np.array([0.1, 0.2, 0.3])),
    ):
        corners = positions[triangles]
        faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert (np.einsum("ij,ij->i", faces, normals[triangles].mean(axis=1)) > 0).all()


@pytest.mark.parametrize("count", [1, 10_000])
def test_points_are_spheres_with_the_mean_shadow_of_theirs(count):
    points = np.zeros((count, 3), np.float32)
    positions, _, triangles, _ = spheres(points, np.full(count, 0.5))
    corners = positions[triangles].astype(float)
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
    assert area / 4 / count == pytest.approx(np.pi * 0.25, rel=1e-5)


def test_nothing_to_draw_is_no_triangle():
    none = np.zeros((0, 3), np.float32)
    assert not len(tubes(none, np.zeros(0), np.zeros(1, int))[2])
    assert not len(tubes(np.zeros((2, 3), np.float32), np.ones(2), np.array([0, 1, 2]))[2])
    assert not len(spheres(none, np.zeros(0))[2])


def hair(stage, curves, radius):
    data = bpy.data.hair_curves.new("Hair")
    data.add_curves([len(curve) for curve in curves])
    data.attributes["position"].data.foreach_set("vector", np.concatenate(curves).astype(np.float32).ravel())
    widths = data.attributes.get("radius") or data.attributes.new("radius", "FLOAT", "POINT")
    widths.data.foreach_set("value", np.full(sum(map(len, curves)), radius, np.float32))
    stage.link("Hair", data)
    return data


def test_hair_and_points_are_meshes_of_the_snapshot(stage):
    hair(stage, [[(0, 0, 0), (0, 0, 1), (0, 1, 2)]], 0.02)
    cache = SnapshotCache()
    snapshot = stage.take(cache)
    (mesh,) = snapshot.meshes.values()
    assert len(mesh.triangle_corners) == 2 * STEPS * ROUND_SIDES[0] * 2
    assert mesh.bounds_max[2] == pytest.approx(2.0, abs=0.03)
    assert snapshot.instances[0].object_name == "Hair"
    again = stage.take(cache)
    assert next(iter(again.meshes.values())).version == mesh.version


def test_strands_know_where_they_grow(stage):
    """As in Cycles the first pair of numbers per curve is the UV map, and the others go by their names."""
    data = hair(stage, [[(x, 0, 0), (x, 0, 1)] for x in (0.0, 1.0, 2.0)], 0.02)
    places = np.float32([[0.1, 0.2], [0.5, 0.6], [0.9, 0.3]])
    for name, scale in (("surface_uv_coordinate", 1.0), ("other", 2.0)):
        layer = data.attributes.new(name, "FLOAT2", "CURVE")
        layer.data.foreach_set("vector", (scale * places).ravel())
    (mesh,) = stage.take().meshes.values()
    strand = np.rint(mesh.positions[mesh.corner_vertices][:, 0]).astype(int)
    assert mesh.active_uv == "surface_uv_coordinate"
    np.testing.assert_allclose(mesh.uv_maps["surface_uv_coordinate"], places[strand])
    np.testing.assert_allclose(mesh.uv_maps["other"], 2.0 * places[strand])


def test_fibres_on_a_mesh_lie_along_first_edges(stage):
    """All triangles have corners of their own, with the edge from their first corner to the second; a note is for
    points, which have no direction."""
    material = stage.material()
    tree = material.node_tree
    node = tree.nodes.new("ShaderNodeBsdfHairPrincipled")
    node.model = "CHIANG"
    output = next(one for one in tree.nodes if one.type == "OUTPUT_MATERIAL")
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    hair = bpy.data.hair_curves.new("Hair")
    hair.add_curves([2])
    hair.attributes["position"].data.foreach_set("vector", [0, -3, 0, 0, 3, 0])
    hair.materials.append(material)
    stage.link("Hair", hair)
    assert not stage.take().notes
    data = bpy.data.meshes.new("Card")
    data.from_pydata([(0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0)], [], [(0, 1, 2, 3)])
    data.materials.append(material)
    stage.link("Card", data)
    taken = stage.take()
    assert not taken.notes
    card = next(mesh for mesh in taken.meshes.values() if len(mesh.positions) == 4)
    edges = card.colors[ROUND][card.triangle_corners]
    np.testing.assert_array_equal(edges[:, :, :3], np.repeat([[(2, 0, 0)], [(2, 1, 0)]], 3, axis=1))
    assert not edges[:, :, 3].any()
    points = bpy.data.pointclouds.new("Points")
    if not hasattr(points, "resize"):
        return  # before 5.0 points cannot be made
    points.resize(1)
    points.materials.append(material)
    stage.link("Points", points)
    (note,) = stage.take().notes
    assert note.material == material.name and "point cloud" in note.text
