"""Where a handle lands that is dragged while Blender's snapping (the magnet in the header) is on.

Blender snaps its own handles only. Here a point goes to the surface that is seen at its place, and on to the nearest
corner of the face there where *Vertex* is one of the magnet's elements and a corner is within REACH.
"""

from __future__ import annotations

import bpy
from bpy_extras import view3d_utils
from mathutils import Vector

REACH = 0.04  # of the distance to the viewer, about two degrees


def snapped(context: bpy.types.Context, place: Vector) -> Vector:
    """`place`, in the world, as the region's view and the scene's snapping have it; as it is without either."""
    tools, view = context.scene.tool_settings, context.region_data
    if not tools.use_snap or view is None:
        return place
    seen = view3d_utils.location_3d_to_region_2d(context.region, view, place)
    if seen is None:
        return place
    eye = view3d_utils.region_2d_to_origin_3d(context.region, view, seen)
    return on_surface(context.evaluated_depsgraph_get(), eye, place, "VERTEX" in tools.snap_elements)


def on_surface(depsgraph: bpy.types.Depsgraph, eye: Vector, place: Vector, corners: bool) -> Vector:
    """What is seen of the scene from `eye` towards `place`, both in the world; `corners`: or a corner near by."""
    hit, location, _, face, thing, matrix = depsgraph.scene.ray_cast(depsgraph, eye, (place - eye).normalized())
    if not hit:
        return place
    mesh = thing.evaluated_get(depsgraph).data
    # In Edit Mode the ray meets faces of the edited mesh, which the evaluated one may not have.
    if corners and thing.type == "MESH" and face < len(mesh.polygons):
        vertices = [matrix @ mesh.vertices[k].co for k in mesh.polygons[face].vertices]
        nearest = min(vertices, key=lambda corner: (corner - location).length)
        if (nearest - location).length < REACH * (location - eye).length:
            return nearest
    return location
