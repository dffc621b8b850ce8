"""Panels of parameters that techniques declare for cameras, worlds, lamps, materials and objects, and their lists.

All of it follows from the declarations (Param.scope, Param.many, Param.handle): a panel for each technique in the tab
of the data-block, a list with buttons to add, remove and order entries, and handles in the 3D viewport for the vectors
of the active entry.
"""

from __future__ import annotations

import bpy
from mathutils import Matrix, Quaternion, Vector

from ..frame.technique import CAMERA, LIGHT, MATERIAL, OBJECT, POINT, SCENE, WORLD, Param, identifier
from ..techniques import REGISTRY
from . import ENGINE
from .properties import titled

# Tab of the Properties editor, and the context's name for the data-block that it shows.
_TABS = {
    CAMERA: ("data", "camera"),
    WORLD: ("world", "world"),
    LIGHT: ("data", "light"),
    MATERIAL: ("material", "material"),
    OBJECT: ("object", "object"),
}

_WITH_SURFACES = {"MESH", "CURVE", "SURFACE", "META", "FONT", "CURVES", "POINTCLOUD", "VOLUME"}  # kinds of object


def scoped(technique) -> dict[str, list[Param]]:
    """A technique's parameters by scope, without the scene's."""
    found: dict[str, list[Param]] = {}
    for param in technique.params:
        if param.scope != SCENE:
            found.setdefault(param.scope, []).append(param)
    return found


def _panel(technique, scope: str, params: list[Param]) -> type:
    tab, name = _TABS[scope]

    @classmethod
    def poll(cls, context):
        block = getattr(context, name, None)
        return context.engine == ENGINE and block is not None and (scope != OBJECT or block.type in _WITH_SURFACES)

    def draw(self, context):
        group = getattr(context, name).candela
        self.layout.use_property_split = True
        for param in params:
            if param.many:
                _draw_list(self.layout, group, technique, scope, param)
            else:
                self.layout.prop(group, identifier(technique.name, param.name))

    body = {
        "__doc__": f"Settings of {technique.label} for this {scope.lower()}",
        "__module__": __name__,
        "bl_space_type": "PROPERTIES",
        "bl_region_type": "WINDOW",
        "bl_context": tab,
        "bl_label": titled(technique.label),
        "bl_options": {"DEFAULT_CLOSED"},
        "COMPAT_ENGINES": {ENGINE},
        "poll": poll,
        "draw": draw,
    }
    return type(f"CANDELA_{scope}_PT_{technique.name}", (bpy.types.Panel,), body)


class CANDELA_UL_entries(bpy.types.UIList):
    """Entries of a list of parameters, by name"""

    def draw_item(self, context, layout, data, item, icon, active_data, active_property, index=0, flt_flag=0):
        layout.prop(item, "name", text="", emboss=False)


def _draw_list(layout, group, technique, scope: str, param: Param) -> None:
    name = identifier(technique.name, param.name)
    layout.label(text=titled(param.label))
    row = layout.row()
    row.template_list("CANDELA_UL_entries", name, group, name, group, f"{name}_active", rows=3)
    buttons = row.column(align=True)
    for action, icon in (("ADD", "ADD"), ("REMOVE", "REMOVE"), ("UP", "TRIA_UP"), ("DOWN", "TRIA_DOWN")):
        button = buttons.operator("candela.edit_list", text="", icon=icon)
        button.scope, button.name, button.action = scope, name, action
    entry = active_entry(group, name)
    if entry is not None:
        column = layout.column()
        for own in param.many:
            column.prop(entry, own.name)


def active_entry(group, name: str):
    """The active entry of a list; None where it is empty."""
    entries, index = getattr(group, name), getattr(group, f"{name}_active")
    return entries[index] if 0 <= index < len(entries) else None


def _block(context, scope: str):
    block = getattr(context, _TABS[scope][1], None)
    if block is None and scope in (CAMERA, LIGHT) and context.object is not None:
        block = context.object.data
    return block


class CANDELA_OT_edit_list(bpy.types.Operator):
    """Add, remove or move an entry of a list of Candela's settings"""

    bl_idname = "candela.edit_list"
    bl_label = "Edit List"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    scope: bpy.props.StringProperty(options={"SKIP_SAVE"})
    name: bpy.props.StringProperty(options={"SKIP_SAVE"})
    action: bpy.props.EnumProperty(
        items=[
            ("ADD", "Add", "Add an entry behind the last one", 0),
            ("REMOVE", "Remove", "Remove the active entry", 1),
            ("UP", "Move Up", "Move the active entry before the one above it", 2),
            ("DOWN", "Move Down", "Move the active entry behind the one below it", 3),
        ],
        options={"SKIP_SAVE"},
    )

    def execute(self, context):
        block = _block(context, self.scope) if self.scope in _TABS else None
        group = getattr(block, "candela", None)
        if group is None or not hasattr(group, f"{self.name}_active"):
            self.report({"ERROR"}, f"There is no list '{self.name}' of {self.scope.lower() or 'nothing'}.")
            return {"CANCELLED"}
        entries, index = getattr(group, self.name), getattr(group, f"{self.name}_active")
        if self.action == "ADD":
            entries.add()
            entries[-1].name = str(len(entries))
            index = len(entries) - 1
        elif not 0 <= index < len(entries):
            return {"CANCELLED"}
        elif self.action == "REMOVE":
            entries.remove(index)
            index = min(index, len(entries) - 1)
        else:
            other = index + (-1 if self.action == "UP" else 1)
            if not 0 <= other < len(entries):
                return {"CANCELLED"}
            entries.move(index, other)
            index = other
        setattr(group, f"{self.name}_active", max(index, 0))
        block.update_tag()
        return {"FINISHED"}


def _handles(block_object) -> list[tuple[object, Param, str]]:
    """(settings, parameter, property) of all vectors with a handle: the object's, and of active entries of lists."""
    found = []
    for technique in REGISTRY:
        for param in scoped(technique).get(OBJECT, ()):
            name = identifier(technique.name, param.name)
            if param.many:
                entry = active_entry(block_object.candela, name)
                found += [(entry, own, own.name) for own in param.many if own.handle and entry is not None]
            elif param.handle:
                found.append((block_object.candela, param, name))
    return found


class CANDELA_GGT_handles(bpy.types.GizmoGroup):
    """Handles of the active object's points and directions: drag a point, turn a direction"""

    bl_idname = "CANDELA_GGT_handles"
    bl_label = "Candela Handles"
    bl_space_type = "VIEW_3D"
    bl_region_type = "WINDOW"
    bl_options = {"3D", "PERSISTENT", "SHOW_MODAL_ALL"}

    @classmethod
    def poll(cls, context):
        return context.engine == ENGINE and context.object is not None and bool(_handles(context.object))

    def setup(self, context):
        self.refresh(context)

    def refresh(self, context):
        self.gizmos.clear()
        shown = context.object
        for settings, param, name in _handles(shown):
            if param.handle == POINT:
                gizmo = self.gizmos.new("GIZMO_GT_move_3d")
                gizmo.target_set_handler(
                    "offset", get=_reader(settings, name, shown), set=_writer(settings, name, shown)
                )
            else:
                gizmo = self.gizmos.new("GIZMO_GT_dial_3d")
                gizmo.matrix_basis = _turned(shown, Vector(getattr(settings, name)))
                gizmo.target_set_handler(
                    "offset", get=lambda: 0.0, set=_turner(settings, name, Vector(getattr(settings, name)))
                )
            gizmo.color, gizmo.alpha = (1.0, 0.7, 0.2), 0.8
            gizmo.scale_basis = 0.3


def _reader(settings, name: str, shown):
    return lambda: shown.matrix_world @ Vector(getattr(settings, name))


def _writer(settings, name: str, shown):
    def write(value):
        setattr(settings, name, shown.matrix_world.inverted_safe() @ Vector(value))

    return write


def _turned(shown, direction: Vector) -> Matrix:
    """A frame at the object's origin whose Z axis is at right angles to the direction, around which it is turned."""
    axis = (shown.matrix_world.to_3x3() @ direction).normalized().orthogonal()
    return Matrix.Translation(shown.matrix_world.translation) @ axis.to_track_quat("Z", "Y").to_matrix().to_4x4()


def _turner(settings, name: str, began: Vector):
    def write(angle):
        setattr(settings, name, Quaternion(began.orthogonal().normalized(), angle) @ began)

    return write


_CLASSES = (
    CANDELA_UL_entries,
    CANDELA_OT_edit_list,
    *(_panel(technique, scope, params) for technique in REGISTRY for scope, params in scoped(technique).items()),
    CANDELA_GGT_handles,
)


def register() -> None:
    for made in _CLASSES:
        bpy.utils.register_class(made)


def unregister() -> None:
    for made in reversed(_CLASSES):
        bpy.utils.unregister_class(made)
