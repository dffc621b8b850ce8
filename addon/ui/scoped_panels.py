"""Panels of parameters that techniques declare for cameras, worlds, lamps, materials and objects, and their lists.

All of it follows from the declarations (Param.scope, Param.many, Param.handle): a panel for each technique in the tab
of the data-block, a list with buttons to add, remove and order entries, and handles in the 3D viewport for the vectors
of the active entry.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy
from mathutils import Matrix, Quaternion, Vector

from ..frame.technique import CAMERA, LIGHT, MATERIAL, OBJECT, POINT, SCENE, WORLD, Param, identifier
from ..techniques import REGISTRY
from . import ENGINE
from .properties import titled
from .snapping import snapped
from .texts import refusal

# Tab of the Properties editor, and the context's name for the data-block that it shows.
_TABS = {
    CAMERA: ("data", "camera"),
    WORLD: ("world", "world"),
    LIGHT: ("data", "light"),
    MATERIAL: ("material", "material"),
    OBJECT: ("object", "object"),
}

OFF = {"NONE", "OFF", "BUMP"}  # items of a technique's first parameter that leave the others nothing to do
SWITCHED_BY = {"eye": "glare_mode"}  # techniques of a camera that another one's parameter asks for
DISPLACES = "relief"  # the technique whose panel shows Blender's own choice of what displacement moves
_WITH_SURFACES = {"MESH", "CURVE", "SURFACE", "META", "FONT", "CURVES", "POINTCLOUD", "VOLUME"}  # kinds of object


def scoped(technique) -> dict[str, list[Param]]:
    """A technique's parameters by scope, without the scene's."""
    found: dict[str, list[Param]] = {}
    for param in technique.params:
        if param.scope != SCENE:
            found.setdefault(param.scope, []).append(param)
    return found


def is_off(block, technique, switch: Param) -> bool:
    """Whether the first of a technique's parameters of a data-block says that the others have nothing to say."""
    if technique.name in SWITCHED_BY:
        return getattr(block.candela, SWITCHED_BY[technique.name]) in OFF
    value = getattr(block.candela, identifier(technique.name, switch.name)) if switch.items else None
    if technique.name == DISPLACES and value == "AUTO":
        return block.displacement_method == "BUMP"
    return value in OFF


def _panel(technique, scope: str, params: list[Param]) -> type:
    tab, name = _TABS[scope]

    @classmethod
    def poll(cls, context):
        block = getattr(context, name, None)
        return context.engine == ENGINE and block is not None and (scope != OBJECT or block.type in _WITH_SURFACES)

    def draw(self, context):
        block = getattr(context, name)
        group, column = block.candela, self.layout
        column.use_property_split = True
        if scope == MATERIAL and technique.name == DISPLACES:
            column.prop(block, "displacement_method", text="Displacement Method")
        column = self.layout.column()
        column.active = technique.name not in SWITCHED_BY or not is_off(block, technique, params[0])
        for number, param in enumerate(params):
            if param.many:
                _draw_list(column, group, technique, scope, param)
            else:
                column.prop(group, identifier(technique.name, param.name))
            if number == 0 and is_off(block, technique, param):
                column = self.layout.column()
                column.active = False

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
        if refused := refusal(block):
            self.report({"ERROR"}, refused)
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


@dataclass(frozen=True)
class Place:
    """Where a vector with a handle is found on an object. Found anew whenever it is asked for: undo and edits of lists
    free what a handle would hold on to."""

    name: str
    param: Param
    entries: str = ""  # the list whose entry has it; else it is the object's own
    index: int = 0

    def settings(self, shown):
        """What holds the vector; None where it is gone."""
        if shown is None or not self.entries:
            return shown.candela if shown is not None else None
        entries = getattr(shown.candela, self.entries)
        return entries[self.index] if self.index < len(entries) else None


def _handles(shown) -> list[Place]:
    """All vectors of an object that have a handle: its own, and those of the active entries of lists."""
    found = []
    for technique in REGISTRY:
        for param in scoped(technique).get(OBJECT, ()):
            name = identifier(technique.name, param.name)
            if param.many and active_entry(shown.candela, name) is not None:
                index = getattr(shown.candela, f"{name}_active")
                found += [Place(own.name, own, name, index) for own in param.many if own.handle]
            elif param.handle:
                found.append(Place(name, param))
    return found


KIND_COLOURS = ((1.0, 0.7, 0.2), (0.3, 0.75, 1.0), (0.5, 1.0, 0.4))  # of handles, by the list whose entry they move


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
        self.shown = None
        self.refresh(context)

    def refresh(self, context):
        """Make the handles that there should be. Those that are there stay: one of them may be the one that is being
        dragged, which Blender goes on using."""
        shown, places = context.object, tuple(_handles(context.object))
        wanted = shown.session_uid, places
        if wanted == self.shown or any(gizmo.is_modal for gizmo in self.gizmos):
            return
        self.shown = wanted
        self.gizmos.clear()
        kinds = list(dict.fromkeys(place.entries for place in places))
        for place in places:
            if place.param.handle == POINT:
                gizmo = self.gizmos.new("GIZMO_GT_move_3d")
                gizmo.draw_options = {"FILL_SELECT", "ALIGN_VIEW"}  # a ring is hardly seen from its side
                gizmo.target_set_handler("offset", get=_reader(place), set=_writer(place, gizmo))
            else:
                gizmo = self.gizmos.new("GIZMO_GT_dial_3d")
                gizmo.target_set_handler("offset", get=lambda: 0.0, set=_turner(place, gizmo, _vector(place)))
            kind = kinds.index(place.entries)
            gizmo.color, gizmo.alpha = KIND_COLOURS[kind % len(KIND_COLOURS)], 0.8
            gizmo.color_highlight, gizmo.alpha_highlight = (1.0, 0.9, 0.6), 1.0
            gizmo.scale_basis = 0.3
            gizmo.select_bias = float(len(kinds) - kind)  # of handles that overlap, that of the first list is taken

    def draw_prepare(self, context):
        """Dials stand where their object is."""
        for gizmo, place in zip(self.gizmos, self.shown[1] if self.shown else ()):
            if place.param.handle != POINT and not gizmo.is_modal:
                gizmo.matrix_basis = _turned(context.object, _vector(place))


DRAG_S = 0.05  # between two looks whether a drag goes on


class _Drag:
    """Makes a step for undo when a drag of a handle has ended, as Blender does for its own handles alone."""

    def __init__(self, gizmo):
        self._gizmo, self._goes_on = gizmo, False

    def moved(self) -> None:
        if not self._goes_on:
            self._goes_on = True
            bpy.app.timers.register(self._look, first_interval=DRAG_S)

    def _look(self) -> float | None:
        try:
            if self._gizmo.is_modal:
                return DRAG_S
        except ReferenceError:
            pass  # it has gone since
        self._goes_on = False
        bpy.ops.ed.undo_push(message="Drag Handle")
        return None


def _vector(place: Place) -> Vector:
    settings = place.settings(bpy.context.object)
    return Vector(getattr(settings, place.name)) if settings is not None else Vector((0.0, 0.0, 1.0))


def _reader(place: Place):
    return lambda: bpy.context.object.matrix_world @ _vector(place)


def _writer(place: Place, gizmo):
    drag = _Drag(gizmo)

    def write(value):
        shown = bpy.context.object
        settings = place.settings(shown)
        if settings is not None:
            setattr(settings, place.name, shown.matrix_world.inverted_safe() @ snapped(bpy.context, Vector(value)))
            drag.moved()

    return write


def _turned(shown, direction: Vector) -> Matrix:
    """A frame at the object's origin whose Z axis is at right angles to the direction, around which it is turned."""
    axis = (shown.matrix_world.to_3x3() @ direction).normalized().orthogonal()
    return Matrix.Translation(shown.matrix_world.translation) @ axis.to_track_quat("Z", "Y").to_matrix().to_4x4()


def _turner(place: Place, gizmo, began: Vector):
    drag = _Drag(gizmo)

    def write(angle):
        settings = place.settings(bpy.context.object)
        if settings is not None:
            setattr(settings, place.name, Quaternion(began.orthogonal().normalized(), angle) @ began)
            drag.moved()

    return write


_CLASSES = (
    CANDELA_UL_entries,
    CANDELA_OT_edit_list,
    *(_panel(technique, scope, params) for technique in REGISTRY for scope, params in scoped(technique).items()),
    CANDELA_GGT_handles,
)


register, unregister = bpy.utils.register_classes_factory(_CLASSES)
