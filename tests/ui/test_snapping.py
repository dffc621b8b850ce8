"""Handles that snap: to the surface that is seen where they are dragged to, and to its corners."""

import bpy
import pytest
from mathutils import Vector

from addon.ui.snapping import on_surface, snapped


@pytest.fixture
def table(registered, empty_scene):
    """A square in the plane z = 1."""
    mesh = bpy.data.meshes.new("Table")
    mesh.from_pydata([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [], [(0, 1, 2, 3)])
    made = bpy.data.objects.new("Table", mesh)
    made.location.z = 1.0
    empty_scene.collection.objects.link(made)
    bpy.context.view_layer.update()
    return made


@pytest.mark.parametrize(("place", "corners", "expected"), [
    ((0.2, 0.3, 3.0), True, (0.4, 0.6, 1.0)),  # no corner is near
    ((0.2, 0.1, 3.0), False, (0.4, 0.2, 1.0)),
    ((0.475, 0.48, 3.0), True, (1.0, 1.0, 1.0)),
    ((0.475, 0.48, 3.0), False, (0.95, 0.96, 1.0)),
    ((4.0, 0.0, 3.0), True, (4.0, 0.0, 3.0)),  # nothing is seen there
])  # fmt: skip
def test_a_point_goes_to_the_surface_or_corner_that_is_seen_there(table, place, corners, expected):
    depsgraph = bpy.context.evaluated_depsgraph_get()
    found = on_surface(depsgraph, Vector((0, 0, 5)), Vector(place), corners)
    assert tuple(found) == pytest.approx(expected, abs=1e-4)


def test_a_face_of_a_mesh_that_is_edited_and_not_evaluated_yet_has_no_corners(table):
    """In Edit Mode Blender tells faces that the evaluated mesh does not have."""
    bpy.context.view_layer.objects.active = table
    bpy.ops.object.mode_set(mode="EDIT")
    try:
        depsgraph = bpy.context.evaluated_depsgraph_get()
        found = on_surface(depsgraph, Vector((0, 0, 5)), Vector((0.475, 0.48, 3.0)), True)
    finally:
        bpy.ops.object.mode_set(mode="OBJECT")
    assert tuple(found) == pytest.approx((0.95, 0.96, 1.0), abs=1e-4)


@pytest.mark.parametrize("magnet", [False, True])
def test_without_the_magnet_or_a_view_a_point_stays(table, magnet):
    bpy.context.scene.tool_settings.use_snap = magnet
    assert snapped(bpy.context, Vector((0.2, 0.1, 3.0))) == Vector((0.2, 0.1, 3.0))
