"""Operators for edits of reflections: place a constraint by script or by a click on a surface, go back to its view."""

from __future__ import annotations

import math

import bpy
from bpy_extras import view3d_utils
from mathutils import Vector
from mathutils.interpolate import poly_3d_calc

from ..frame.technique import identifier
from ..techniques.edit_heat import EditHeat
from ..techniques.reflection_editing import ReflectionEditing
from . import ENGINE
from .scoped_panels import active_entry
from .texts import refusal

CONSTRAINTS, REGIONS = "reflection_editing_constraints", "reflection_editing_regions"
PANEL = f"CANDELA_OBJECT_PT_{ReflectionEditing.name}"
LARGE = math.radians(120.0)


def place(context, edited, point: Vector, normal: Vector, viewer: Vector):
    """Add a constraint at a point of an object's surface (world space) that changes nothing yet: its target is what is
    mirrored there. A first one gets a region around the whole object. Returns the constraint."""
    view = (viewer - point).normalized()
    mirrored = (2.0 * view.dot(normal) * normal - view).normalized()
    start = point + 1e-4 * max(edited.dimensions.length, 1e-6) * normal
    hit, target, *_ = context.scene.ray_cast(context.evaluated_depsgraph_get(), start, mirrored)
    if not hit:
        target = point + 2.0 * max(edited.dimensions.length, 1.0) * mirrored
    inverse, settings = edited.matrix_world.inverted_safe(), edited.candela
    entries = getattr(settings, CONSTRAINTS)
    entry = entries.add()
    entry.name = f"Constraint {len(entries)}"
    entry.point, entry.target, entry.viewer = inverse @ point, inverse @ target, inverse @ viewer
    setattr(settings, f"{CONSTRAINTS}_active", len(entries) - 1)
    regions = getattr(settings, REGIONS)
    if not regions:
        region = regions.add()
        region.name = "Region 1"
        corners = [Vector(corner) for corner in edited.bound_box]
        region.centre = sum(corners, Vector()) / 8
        region.radius = 1.01 * max((corner - region.centre).length for corner in corners)
        region.border = 0.0
    edited.update_tag()
    return entry


def nearest(edited, place: Vector) -> tuple[Vector, Vector] | None:
    """Point of an object's surface that is nearest to a place, and the normal there, all in its own space. None where
    Blender keeps no surface to ask: without faces, in Edit Mode, and while the object is disabled in viewports."""
    try:
        found, point, normal, face = edited.closest_point_on_mesh(place)
    except RuntimeError:
        return None
    return (point, shading_normal(evaluated_mesh(edited), face, point, normal)) if found else None


def evaluated_mesh(edited):
    """What the viewport shows of an object; None where it shows no mesh."""
    data = edited.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    return data if isinstance(data, bpy.types.Mesh) else None


def shading_normal(mesh, face: int, point: Vector, flat: Vector) -> Vector:
    """The normal that reflections have at a point of a face: between those of its corners, on the side of `flat`."""
    if mesh is None or not 0 <= face < len(mesh.polygons):
        return flat
    corners = [*mesh.polygons[face].loop_indices]
    places = [mesh.vertices[mesh.loops[k].vertex_index].co for k in corners]
    weights = poly_3d_calc(places, point)
    normal = sum((w * mesh.corner_normals[k].vector for w, k in zip(weights, corners)), Vector())
    return normal.normalized() if normal.dot(flat) > 0.0 else flat


def angle_of(entry, edited) -> float | None:
    """Radians by which a constraint turns what its point mirrors; None where that is not known."""
    point, viewer, target = (Vector(getattr(entry, name)) for name in ("point", "viewer", "target"))
    if entry.target_object is not None:
        target = edited.matrix_world.inverted_safe() @ entry.target_object.matrix_world.translation
    there = nearest(edited, point)
    if there is None:
        return None
    if entry.of != "REFLECTION" or not (target - point).length or not (viewer - point).length:
        return 0.0
    normal = there[1]
    view = (viewer - point).normalized()
    mirrored = 2.0 * view.dot(normal) * normal - view
    return mirrored.angle(target - point, 0.0)


def clicked(layer, met):
    """The object to edit of what a ray has met. ValueError with a sentence where it is none."""
    if met is None:
        raise ValueError("There is no surface where you clicked.")
    edited = met.original or met
    if edited.type != "MESH":
        raise ValueError(f"'{edited.name}' is no mesh.")
    if all(one != edited for one in layer.objects):
        raise ValueError(f"'{edited.name}' is only shown as an instance here: make the instance real to edit it.")
    if refused := refusal(edited):
        raise ValueError(refused)
    return edited


_NO_SURFACE = (
    "'{}' has no surface to place a constraint on: it needs faces, has to be enabled in viewports, and in Object Mode."
)


class _OfAnObject:
    @classmethod
    def poll(cls, context):
        return context.engine == ENGINE and context.object is not None and context.object.type == "MESH"


class CANDELA_OT_place_reflection(_OfAnObject, bpy.types.Operator):
    """Add a constraint to the active object at the point of its surface nearest to a place, as seen from a viewer"""

    bl_idname = "candela.place_reflection"
    bl_label = "Place Reflection"
    bl_options = {"REGISTER", "UNDO"}

    location: bpy.props.FloatVectorProperty(name="Location", description="In world space", subtype="XYZ")
    viewer: bpy.props.FloatVectorProperty(name="Viewer", description="In world space", subtype="XYZ")

    def execute(self, context):
        edited = context.object
        if refused := refusal(edited):
            self.report({"ERROR"}, refused)
            return {"CANCELLED"}
        inverse = edited.matrix_world.inverted_safe()
        there = nearest(edited, inverse @ Vector(self.location))
        if there is None:
            self.report({"ERROR"}, _NO_SURFACE.format(edited.name))
            return {"CANCELLED"}
        point, normal = there
        normal = (inverse.to_3x3().transposed() @ normal).normalized()
        place(context, edited, edited.matrix_world @ point, normal, Vector(self.viewer))
        return {"FINISHED"}


class CANDELA_OT_pick_reflection(_OfAnObject, bpy.types.Operator):
    """Click on a surface: what is seen there becomes a constraint, whose target can then be dragged"""

    bl_idname = "candela.pick_reflection"
    bl_label = "Pick Reflection"
    bl_options = {"REGISTER", "UNDO"}

    def invoke(self, context, event):
        if not any(area.type == "VIEW_3D" for area in context.screen.areas):
            self.report({"ERROR"}, "There is no 3D viewport in this window to click in.")
            return {"CANCELLED"}
        context.window_manager.modal_handler_add(self)
        context.window.cursor_modal_set("EYEDROPPER")
        context.workspace.status_text_set("Click on the surface that is to show something else. Escape: cancel.")
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type in {"RIGHTMOUSE", "ESC"}:
            self._end(context)
            return {"CANCELLED"}
        if event.type != "LEFTMOUSE" or event.value != "PRESS":
            return {"PASS_THROUGH"}
        region, view = _viewport_at(context.screen, event.mouse_x, event.mouse_y)
        if region is None:
            return {"PASS_THROUGH"}  # a click on another editor is that editor's
        self._end(context)
        place_on_region = (event.mouse_x - region.x, event.mouse_y - region.y)
        start = view3d_utils.region_2d_to_origin_3d(region, view, place_on_region)
        direction = view3d_utils.region_2d_to_vector_3d(region, view, place_on_region)
        graph = context.evaluated_depsgraph_get()
        hit, point, normal, face, met, matrix = context.scene.ray_cast(graph, start, direction)
        try:
            edited = clicked(context.view_layer, met if hit else None)
        except ValueError as error:
            self.report({"WARNING"}, str(error))
            return {"CANCELLED"}
        for other in context.view_layer.objects.selected:
            other.select_set(False)
        edited.select_set(True)
        context.view_layer.objects.active = edited
        inverse = matrix.inverted_safe()
        flat = (matrix.to_3x3().transposed() @ normal).normalized()
        smooth = shading_normal(evaluated_mesh(edited), face, inverse @ point, flat)
        normal = (inverse.to_3x3().transposed() @ smooth).normalized()
        normal = normal if normal.dot(direction) < 0 else -normal
        place(context, edited, point, normal, start)
        return {"FINISHED"}

    def cancel(self, context):
        self._end(context)

    def _end(self, context) -> None:
        context.window.cursor_modal_restore()
        context.workspace.status_text_set(None)


def _viewport_at(screen, x: int, y: int):
    """Region and view of the 3D viewport under a point of the window; (None, None) where another editor is."""
    for area in screen.areas:
        if area.type != "VIEW_3D":
            continue
        under = [r for r in area.regions if r.x <= x < r.x + r.width and r.y <= y < r.y + r.height]
        if any(region.type in {"UI", "HEADER", "TOOL_HEADER"} for region in under):
            continue
        main = next((region for region in under if region.type == "WINDOW"), None)
        if main is not None:
            return main, main.data
    return None, None


class CANDELA_OT_return_to_view(_OfAnObject, bpy.types.Operator):
    """Look from where the active constraint was made"""

    bl_idname = "candela.return_to_view"
    bl_label = "Return to View"

    def execute(self, context):
        entry = active_entry(context.object.candela, CONSTRAINTS)
        view = getattr(context.space_data, "region_3d", None) or _largest_view(context.screen)
        if entry is None or view is None:
            missing = "The object has no constraint." if entry is None else "There is no 3D viewport in this window."
            self.report({"ERROR"}, missing)
            return {"CANCELLED"}
        matrix = context.object.matrix_world
        point, viewer = matrix @ Vector(entry.point), matrix @ Vector(entry.viewer)
        view.view_perspective = "PERSP"
        view.view_location = point
        view.view_distance = (viewer - point).length
        view.view_rotation = (viewer - point).to_track_quat("Z", "Y")
        return {"FINISHED"}


def _largest_view(screen):
    """View of the largest 3D viewport; None without one."""
    areas = [area for area in screen.areas if area.type == "VIEW_3D"] if screen is not None else []
    if not areas:
        return None
    return max(areas, key=lambda area: area.width * area.height).spaces.active.region_3d


def _draw(self, context):
    edited = context.object
    row = self.layout.row(align=True)
    row.operator("candela.pick_reflection", icon="EYEDROPPER")
    row.operator("candela.return_to_view", icon="LOOP_BACK")
    self.layout.prop(context.scene.candela, identifier(EditHeat.name, "shown"), toggle=True, icon="COLOR")
    entry = active_entry(edited.candela, CONSTRAINTS)
    turned = angle_of(entry, edited) if entry is not None and edited.type == "MESH" else None
    if turned is not None:
        icon = "ERROR" if turned > LARGE else "NONE"
        text = f"Turns reflections by {math.degrees(turned):.0f}°"
        self.layout.label(text=f"{text}: beyond 120° they fold over" if turned > LARGE else text, icon=icon)


_CLASSES = (CANDELA_OT_place_reflection, CANDELA_OT_pick_reflection, CANDELA_OT_return_to_view)


def register() -> None:
    for made in _CLASSES:
        bpy.utils.register_class(made)
    getattr(bpy.types, PANEL).append(_draw)


def unregister() -> None:
    getattr(bpy.types, PANEL).remove(_draw)
    for made in reversed(_CLASSES):
        bpy.utils.unregister_class(made)
