"""Meshes: what is read equals what Blender says of the same mesh, and broken geometry is mended or named."""

from types import SimpleNamespace

import bmesh
import bpy
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from addon.snapshot.meshes import _drop_broken

PENTAGON = [(np.cos(a), np.sin(a), 0) for a in np.linspace(0, 2 * np.pi, 5, endpoint=False)]


def only_mesh(snapshot):
    (mesh,) = snapshot.meshes.values()
    return mesh


def test_positions_are_those_after_modifiers(stage):
    placed = stage.link("O", stage.mesh())
    array = placed.modifiers.new("Array", "ARRAY")
    array.count, array.relative_offset_displace = 3, (2, 0, 0)
    mesh = only_mesh(stage.take())
    assert len(mesh.positions) == 9
    assert mesh.bounds_max[0] == pytest.approx(5.0)
    assert mesh.triangle_count == 3


@pytest.mark.parametrize("index", [-1, 4])
def test_a_triangle_of_a_vertex_that_is_not_there_is_dropped(index):
    """Before the first one and after the last one."""
    raw = SimpleNamespace(
        positions=np.eye(4, 3, dtype=np.float32), corner_vertices=np.array([1, 2, 3, 1, 2, index], np.int32)
    )
    _, triangles, slots, dropped = _drop_broken(raw, np.arange(6).reshape(2, 3), np.array([0, 1]))
    assert triangles.tolist() == [[0, 1, 2]] and slots.tolist() == [0] and dropped == 1


def test_triangles_of_polygons_are_those_of_blender(stage):
    vertices = [*PENTAGON, (3, 0, 0), (4, 0, 0), (3.2, 0.2, 0), (3, 1, 0), (6, 0, 0), (7, 0, 0), (6, 1, 0)]
    data = stage.mesh(vertices=vertices, faces=[(0, 1, 2, 3, 4), (5, 6, 7, 8), (9, 10, 11)])
    stage.link("O", data)
    mesh = only_mesh(stage.take())
    data.calc_loop_triangles()
    expected = sorted(tuple(triangle.loops) for triangle in data.loop_triangles)
    assert sorted(map(tuple, mesh.triangle_corners)) == expected


def test_triangle_mesh_needs_no_triangulation_and_keeps_its_corners(stage):
    stage.link("O", stage.mesh(vertices=[(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)], faces=[(0, 1, 2), (1, 3, 2)]))
    mesh = only_mesh(stage.take())
    assert mesh.corner_vertices[mesh.triangle_corners].tolist() == [[0, 1, 2], [1, 3, 2]]


def test_triangles_are_sorted_by_material_slot(stage):
    data = stage.grid(3)
    for name in "abc":
        data.materials.append(bpy.data.materials.new(name))
    data.polygons.foreach_set("material_index", [2, 0, 1, 2, 0, 1, 2, 0, 1])
    stage.link("O", data)
    snapshot = stage.take()
    mesh = only_mesh(snapshot)
    assert mesh.slots == 3
    assert mesh.triangle_slots.tolist() == [0] * 6 + [1] * 6 + [2] * 6
    # The quads of slot 0 are faces 1, 4, 7: the middle column.
    middle = mesh.positions[mesh.corner_vertices[mesh.triangle_corners[:6]]]
    assert middle[..., 0].min() == pytest.approx(1 / 3)
    assert middle[..., 0].max() == pytest.approx(2 / 3)
    assert [snapshot.materials[i].name for i in snapshot.instances[0].materials] == ["a", "b", "c"]


def test_material_index_beyond_the_slots_is_clamped(stage):
    data = stage.grid(1)
    for name in "ab":
        data.materials.append(bpy.data.materials.new(name))
    data.polygons.foreach_set("material_index", [7])
    stage.link("O", data)
    assert only_mesh(stage.take()).triangle_slots.tolist() == [1, 1]


def test_mesh_without_slots_has_the_default_material(stage):
    stage.link("O", stage.mesh())
    snapshot = stage.take()
    assert snapshot.instances[0].materials == (0,)
    graph = snapshot.materials[0].graph
    color = "Color" if bpy.app.version < (5, 0) else "Base Color"  # a Diffuse BSDF then, a Principled since
    assert graph.nodes[graph.surface[0]].inputs[color].value == pytest.approx((0.8, 0.8, 0.8, 1.0))


def test_corner_normals_are_blenders(stage):
    data = stage.mesh(
        vertices=[(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], faces=[(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)]
    )
    data.polygons.foreach_set("use_smooth", [True, True, False, False])
    stage.link("O", data)
    mesh = only_mesh(stage.take())
    expected = np.array([normal.vector for normal in data.corner_normals])
    assert np.allclose(mesh.corner_normals, expected, atol=1e-6)
    assert len({tuple(row) for row in np.round(expected, 4)}) > 4  # flat and smooth corners are both there


@pytest.mark.parametrize("smooth", [False, True])
def test_triangles_of_a_flat_face_that_is_folded_have_normals_of_their_own(stage, smooth):
    """As in Cycles. Faces that are planar, or smooth, keep their corners."""
    data = stage.mesh(
        vertices=[(0, 0, 0), (1, 0, 0), (1, 1, 1), (0, 1, 0), (2, 0, 0), (2, 1, 1)], faces=[(0, 1, 2, 3), (1, 4, 5, 2)]
    )
    data.polygons.foreach_set("use_smooth", [smooth, smooth])
    layer = data.uv_layers.new(name="map")
    layer.data.foreach_set("uv", np.arange(16, dtype=np.float32))
    stage.link("O", data)
    mesh = only_mesh(stage.take())
    corners = mesh.triangle_corners
    a, b, c = np.moveaxis(mesh.positions[mesh.corner_vertices[corners]], 1, 0)
    own = np.cross(b - a, c - a)
    own /= np.linalg.norm(own, axis=1, keepdims=True)
    assert np.allclose(mesh.corner_normals[corners], own[:, None], atol=1e-5) != smooth
    assert len(mesh.corner_vertices) == len(mesh.corner_normals) == len(mesh.uv_maps["map"]) == (8 if smooth else 14)
    expected = {(vertex, *layer.data[k].uv) for k, vertex in enumerate(loop.vertex_index for loop in data.loops)}
    found = {(int(v), *map(float, uv)) for v, uv in zip(mesh.corner_vertices, mesh.uv_maps["map"])}
    assert found == expected


def test_custom_normals_are_kept(stage):
    data = stage.grid(1)
    wished = np.array([(0.6, 0.0, 0.8)] * 4, np.float32)
    data.normals_split_custom_set(wished)
    stage.link("O", data)
    assert np.allclose(only_mesh(stage.take()).corner_normals, wished, atol=1e-3)


def test_uv_maps_and_the_one_that_renders(stage):
    data = stage.grid(1)
    first, second = data.uv_layers.new(name="first"), data.uv_layers.new(name="second")
    wished = np.arange(8, dtype=np.float32)
    first.data.foreach_set("uv", wished)
    second.active_render = True
    stage.link("O", data)
    mesh = only_mesh(stage.take())
    assert set(mesh.uv_maps) == {"first", "second"}
    assert mesh.uv_maps["first"].tolist() == wished.reshape(4, 2).tolist()
    assert mesh.active_uv == "second"


def test_byte_colors_are_linear_and_point_colors_spread_to_corners(stage):
    data = stage.grid(1)
    stored = data.color_attributes.new("bytes", "BYTE_COLOR", "CORNER")
    stored.data.foreach_set("color_srgb", [0.5, 0.25, 1.0, 1.0] * 4)
    points = data.color_attributes.new("points", "FLOAT_COLOR", "POINT")
    values = np.arange(16, dtype=np.float32).reshape(4, 4)
    points.data.foreach_set("color", values.reshape(-1))
    stage.link("O", data)
    mesh = only_mesh(stage.take())
    encoded = np.round(np.array([0.5, 0.25]) * 255) / 255
    linear = ((encoded + 0.055) / 1.055) ** 2.4
    assert np.allclose(mesh.colors["bytes"][:, :2], linear, atol=1e-4)
    assert mesh.colors["points"].tolist() == values[mesh.corner_vertices].tolist()
    assert mesh.active_color == "bytes"


def test_attributes_that_a_node_asks_for_are_read_as_colors(stage):
    data = stage.grid(2)
    heat = data.attributes.new("heat", "FLOAT", "FACE")
    heat.data.foreach_set("value", [0.1, 0.2, 0.3, 0.4])
    data.attributes.new("unused", "FLOAT", "POINT")
    material = stage.material()
    node = material.node_tree.nodes.new("ShaderNodeAttribute")
    node.attribute_name = "heat"
    data.materials.append(material)
    shader = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
    material.node_tree.links.new(node.outputs["Fac"], shader.inputs["Roughness"])
    stage.link("O", data)
    colors = only_mesh(stage.take()).colors
    assert set(colors) == {"heat"}
    assert colors["heat"][::4, :].tolist() == pytest.approx(np.array([[h, h, h, 1] for h in (0.1, 0.2, 0.3, 0.4)]))


@pytest.mark.parametrize("case", ["no vertices", "no faces", "loose edges"])
def test_meshes_without_faces_are_empty_and_finite(stage, case):
    vertices = [] if case == "no vertices" else [(0, 0, 0), (5, 0, 0)]
    edges = [(0, 1)] if case == "loose edges" else []
    stage.link("O", stage.mesh(vertices=vertices, faces=[], edges=edges))
    mesh = only_mesh(stage.take())
    assert mesh.triangle_count == 0
    assert mesh.triangle_corners.shape == (0, 3)
    assert mesh.bounds_min.tolist() == mesh.bounds_max.tolist() == [0, 0, 0]


def test_loose_vertices_do_not_widen_the_bounds(stage):
    stage.link("O", stage.mesh(vertices=[(0, 0, 0), (1, 0, 0), (0, 1, 0), (99, 0, 0)]))
    assert only_mesh(stage.take()).bounds_max.tolist() == [1, 1, 0]


@pytest.mark.parametrize("broken", [np.nan, np.inf, -np.inf, 1e30])
def test_triangles_at_a_broken_vertex_are_left_out_and_named(stage, broken):
    data = stage.mesh("Torn", vertices=[(0, 0, 0), (1, 0, 0), (0, 1, 0), (2, 2, 2)], faces=[(0, 1, 2), (1, 3, 2)])
    stage.link("Torn", data)
    stage.take()
    flat = np.array([0, 0, 0, 1, 0, 0, 0, 1, 0, broken, 0, 0], np.float32)
    data.attributes["position"].data.foreach_set("vector", flat)  # assigning to vertices clamps infinity
    data.update()
    snapshot = stage.take()
    mesh = only_mesh(snapshot)
    assert mesh.corner_vertices[mesh.triangle_corners].tolist() == [[0, 1, 2]]
    assert np.isfinite(mesh.positions).all()
    assert np.isfinite(mesh.corner_normals).all()
    assert mesh.bounds_max.tolist() == [1, 1, 0]
    (note,) = snapshot.notes
    assert note.subject == "Object 'Torn'"
    assert "1 triangle" in note.text


def test_triangles_without_area_stay_and_their_normals_are_unit(stage):
    stage.link("O", stage.mesh(vertices=[(0, 0, 0), (1, 0, 0), (2, 0, 0)]))
    mesh = only_mesh(stage.take())
    assert mesh.triangle_count == 1
    assert np.linalg.norm(mesh.corner_normals, axis=1) == pytest.approx([1, 1, 1])


def test_uvs_and_colors_that_are_not_numbers_become_zero(stage):
    data = stage.mesh()
    data.uv_layers.new(name="uv").data.foreach_set("uv", np.array([np.nan, np.inf, 1, 2, 3, 4], np.float32))
    data.color_attributes.new("c", "FLOAT_COLOR", "POINT").data.foreach_set("color", np.full(12, np.nan, np.float32))
    stage.link("O", data)
    mesh = only_mesh(stage.take())
    assert mesh.uv_maps["uv"].tolist() == [[0, 0], [1, 2], [3, 4]]
    assert mesh.colors["c"].tolist() == [[0, 0, 0, 0]] * 3


NUMBERS = st.one_of(st.floats(-10, 10, width=32), st.sampled_from([0.0, np.nan, np.inf, 1e30]))


@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_mesh_gives_arrays_that_are_safe_to_draw(stage, data):
    count = data.draw(st.integers(0, 8))
    points = data.draw(st.lists(st.tuples(NUMBERS, NUMBERS, NUMBERS), min_size=count, max_size=count))
    vertex = st.integers(0, max(count - 1, 0))
    face = st.lists(vertex, min_size=3, max_size=5, unique=True)
    faces = data.draw(st.lists(face, max_size=5)) if count >= 5 else []
    made = stage.mesh(vertices=np.zeros((count, 3)).tolist(), faces=faces)
    for name in "ab":
        made.materials.append(bpy.data.materials.new(name))
    slots = data.draw(st.lists(st.integers(-3, 5), min_size=len(faces), max_size=len(faces)))
    if faces:
        made.attributes.new("material_index", "INT", "FACE").data.foreach_set("value", slots)
    if count:
        made.attributes["position"].data.foreach_set("vector", np.array(points, np.float32).reshape(-1))
    made.update()
    placed = stage.link("O", made)
    mesh = only_mesh(stage.take())
    bpy.data.objects.remove(placed)
    assert mesh.triangle_corners.size == 0 or mesh.triangle_corners.max() < len(mesh.corner_vertices)
    assert mesh.corner_vertices.size == 0 or mesh.corner_vertices.max() < len(mesh.positions)
    assert np.isfinite(mesh.positions).all()
    assert np.linalg.norm(mesh.corner_normals, axis=1) == pytest.approx(np.ones(len(mesh.corner_normals)), abs=1e-3)
    assert (np.diff(mesh.triangle_slots) >= 0).all()
    assert set(mesh.triangle_slots) <= {0, 1}
    assert (mesh.bounds_min <= mesh.bounds_max).all()
    assert np.isfinite([mesh.bounds_min, mesh.bounds_max]).all()


def test_a_mesh_in_edit_mode_shows_its_unsaved_edits(stage):
    data = stage.mesh()
    data.uv_layers.new(name="uv")
    for name in "ab":
        data.materials.append(bpy.data.materials.new(name))
    data.polygons[0].material_index = 1
    placed = stage.link("O", data)
    bpy.context.view_layer.objects.active = placed
    bpy.ops.object.mode_set(mode="EDIT")
    try:
        edit = bmesh.from_edit_mesh(data)
        edit.verts.ensure_lookup_table()
        edit.verts[1].co.x = 7.0
        bmesh.update_edit_mesh(data)
        mesh = only_mesh(stage.take())
    finally:
        bpy.ops.object.mode_set(mode="OBJECT")
    assert mesh.bounds_max.tolist() == [7, 1, 0]
    assert set(mesh.uv_maps) == {"uv"}
    assert mesh.triangle_slots.tolist() == [1]


def test_curves_texts_surfaces_and_metaballs_are_drawn_through_their_meshes(stage):
    curve = bpy.data.curves.new("curve", "CURVE")
    curve.dimensions, curve.bevel_depth = "3D", 0.1
    curve.splines.new("BEZIER").bezier_points.add(1)
    curve.splines[0].bezier_points[1].co = (1, 0, 0)
    text = bpy.data.curves.new("text", "FONT")
    text.body = "Hi"
    ball = bpy.data.metaballs.new("ball")
    ball.elements.new()
    for name, data in (("curve", curve), ("text", text), ("ball", ball)):
        stage.link(name, data)
    bpy.ops.surface.primitive_nurbs_surface_sphere_add()
    bpy.context.object.name = "surface"
    snapshot = stage.take()
    drawn = {one.object_name: snapshot.meshes[one.mesh].triangle_count for one in snapshot.instances}
    assert set(drawn) == {"curve", "text", "ball", "surface"}
    assert all(count > 0 for count in drawn.values())


@pytest.mark.timing
def test_the_million_triangle_mesh_syncs_in_time(stage):
    data = stage.grid(708)
    data.uv_layers.new()
    stage.link("O", data)
    snapshot = stage.take()
    seconds = snapshot.sync_stats["seconds"]
    print(f"\n{only_mesh(snapshot).triangle_count} triangles: {seconds:.3f} s")
    assert only_mesh(snapshot).triangle_count > 1_000_000
    assert seconds < 1.5
