"""Candela's panels in the Properties editor, and what the last frame did.

The panels of the techniques are made from the parameters that they declare.
"""

from __future__ import annotations

import bpy

from ..frame import ledger as ledgers
from ..frame.settings import AUTO
from ..frame.technique import SCENE, identifier
from ..techniques import REGISTRY
from . import ENGINE, bake_panel, blender_panels, notes, pass_panels
from .passes import PASSES
from .properties import titled
from .quality import CANDELA_PT_quality_presets
from .technique_groups import GROUPS, OTHERS, Group, group_of, is_expert, members
from .texts import wrapped

TAB_S, TAB_TRIES = 0.05, 40  # between tries to show a tab that the editor may not have yet, and how many
MOST_NOTES = 12  # more than these are counted only
_PARENTS = dict.fromkeys(("denoise", "history"), "CANDELA_RENDER_PT_sampling")  # where artists look; else by group
# Bounces by kind of light, as far as techniques limit them themselves.
_BOUNCES = (
    ("shaded_reflections", "bounces", "Glossy"),
    ("traced_refraction", "interfaces", "Transmission"),
    ("airlight", "bounces", "Volume"),
)
_SIMPLIFY = (
    ("simplify_subdivision", "Max Subdivision"),
    ("simplify_child_particles", "Max Child Particles"),
    ("simplify_volumes", "Volume Resolution"),
    ("use_simplify_normals", "Normals"),
)
_SIMPLIFY_RENDER = (
    ("simplify_subdivision_render", "Max Subdivision"),
    ("simplify_child_particles_render", "Max Child Particles"),
)
_WITH_OTHERS = {"film"}  # techniques whose parameters stand in a panel of Blender's settings
_STATE_ICONS = {ledgers.RAN: "CHECKMARK", ledgers.REUSED: "LOOP_BACK", ledgers.SKIPPED: "REMOVE"}


class _CandelaPanel:
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    COMPAT_ENGINES = {ENGINE}

    @classmethod
    def poll(cls, context):
        return context.engine in cls.COMPAT_ENGINES


def _columns(panel, animatable: bool = True):
    """The panel's layout as Blender's own: names left, values right."""
    panel.layout.use_property_split = True
    panel.layout.use_property_decorate = animatable
    return panel.layout.column()


class CANDELA_RENDER_PT_sampling(_CandelaPanel, bpy.types.Panel):
    bl_label = "Sampling"

    def draw_header_preset(self, context):
        CANDELA_PT_quality_presets.draw_panel_header(self.layout)

    def draw(self, context):
        settings = context.scene.candela
        column = _columns(self)
        column.prop(settings, "samples", text="Render Samples")
        column.prop(settings, "noise_threshold")
        column.prop(settings, "time_limit")
        column.prop(settings, "viewport_samples", text="Viewport Samples")
        column.prop(settings, "navigation")
        column.prop(context.scene.render, "preview_pixel_size")
        column.prop(settings, "seed")


class CANDELA_RENDER_PT_light_paths(_CandelaPanel, bpy.types.Panel):
    """How often light is reflected, by kind; those of the techniques stand among their parameters, too"""

    bl_label = "Light Paths"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        column, settings = _columns(self), context.scene.candela
        column.prop(settings, "bounces", text="Max Bounces")
        for technique, param, text in _BOUNCES:
            column.prop(settings, identifier(technique, param), text=text)


class CANDELA_RENDER_PT_simplify(_CandelaPanel, bpy.types.Panel):
    """Blender's own settings, behind Candela's: its panel would come before them"""

    bl_label = "Simplify"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context):
        self.layout.prop(context.scene.render, "use_simplify", text="")

    def draw(self, context):
        column, render = _columns(self), context.scene.render
        column.active = render.use_simplify
        for heading, names in (("Viewport", _SIMPLIFY), ("Render", _SIMPLIFY_RENDER)):
            part = column.column(align=True, heading=heading)
            for name, text in names:
                part.prop(render, name, text=text)


class CANDELA_RENDER_PT_performance(_CandelaPanel, bpy.types.Panel):
    """What Blender itself keeps between frames: Candela keeps its own data in any case"""

    bl_label = "Final Render"  # as in Cycles' panel Performance
    bl_parent_id = "CANDELA_RENDER_PT_techniques"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        _columns(self, animatable=False).prop(context.scene.render, "use_persistent_data", text="Persistent Data")


class CANDELA_RENDER_PT_techniques(_CandelaPanel, bpy.types.Panel):
    """Which passes make a picture, and settings for a given time"""

    bl_label = "Performance"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        _columns(self).prop(context.scene.candela, "pass_tree")


def _group_panels(group: Group) -> list[type]:
    """The panel of a group with a choice for each of its slots, and below it the part for its techniques."""

    def draw(self, context):
        column = _columns(self)
        column.active = context.scene.candela.pass_tree is None  # a tree decides by its nodes
        for slot, text in group.slots:
            column.prop(context.scene.candela, f"slot_{slot}", text=text)

    def nothing(self, context):
        pass

    name = f"CANDELA_RENDER_PT_group_{group.name}"
    made = [
        (name, {"bl_label": group.label, "draw": draw}),
        (f"{name}_advanced", {"bl_label": "Advanced", "bl_parent_id": name, "draw": nothing}),
    ]
    common = {"__module__": __name__, "bl_options": {"DEFAULT_CLOSED"}}
    return [type(name, (_CandelaPanel, bpy.types.Panel), common | body) for name, body in made]


def _shows_expert(context) -> bool:
    """What the extension's preferences say; everything where Candela is no extension."""
    own = getattr(context.preferences, "addons", {}).get(__package__.removesuffix(".ui").removesuffix(".addon"))
    return own is None or getattr(own.preferences, "show_expert", True)


def _reason_skipped(technique) -> str:
    """Why the last picture did without a technique; empty where it did not."""
    rows = (row for row in _rows() if row.name == technique.name and row.state == ledgers.SKIPPED)
    return next((row.reason for row in rows), "")


def _technique_panel(technique) -> type:
    """The sub-panel with a technique's parameters; it is gone while its slot holds another technique, or where all that
    it has is for experts. It is grey, and says why, where the last picture did without the technique."""

    def shown(context) -> list:
        experts = _shows_expert(context)
        return [param for param in technique.params_of(SCENE) if experts or not is_expert(param)]

    @classmethod
    def poll(cls, context):
        chosen = {getattr(context.scene.candela, f"slot_{slot}") for slot in technique.fills} or {technique.name}
        asked = not chosen.isdisjoint((AUTO, technique.name)) and bool(shown(context))
        return _CandelaPanel.poll.__func__(cls, context) and asked

    def draw(self, context):
        column = _columns(self)
        if technique.name == "denoise":
            switches = column.column(align=True, heading="Denoise")
            switches.prop(context.scene.candela, "use_denoise", text="Render")
            switches.prop(context.scene.candela, "use_viewport_denoise", text="Viewport")
        reason = _reason_skipped(technique)
        if reason:
            wrapped(column, context, reason, dim=True)
        column.active = not reason
        for param in shown(context):
            column.prop(context.scene.candela, identifier(technique.name, param.name))

    body = {
        "__doc__": f"Parameters of {technique.label}",
        "__module__": __name__,
        "bl_label": titled(technique.label),
        "bl_parent_id": _PARENTS.get(technique.name, f"CANDELA_RENDER_PT_group_{group_of(technique).name}_advanced"),
        "bl_options": set() if technique.name == "denoise" else {"DEFAULT_CLOSED"},
        "poll": poll,
        "draw": draw,
    }
    return type(f"CANDELA_RENDER_PT_{technique.name}", (_CandelaPanel, bpy.types.Panel), body)


class CANDELA_RENDER_PT_film(_CandelaPanel, bpy.types.Panel):
    bl_label = "Film"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        column = _columns(self)
        column.prop(context.scene.render, "filter_size", text="Filter Size")
        column.prop(context.scene.render, "film_transparent", text="Transparent")
        cycles = getattr(context.scene, "cycles", None)  # there while the Cycles add-on is enabled
        if cycles is not None:
            glass = column.column()
            glass.active = context.scene.render.film_transparent
            glass.prop(cycles, "film_transparent_glass", text="Transparent Glass")
            glass.prop(cycles, "film_transparent_roughness", text="Roughness Threshold")
            column.prop(cycles, "film_exposure", text="Exposure")
        column.prop(context.scene.candela, "film_points")
        column.prop(context.scene.candela, "film_edges")
        column.prop(context.scene.candela, "film_clamp_direct")
        column.prop(context.scene.candela, "film_clamp_indirect")


class CANDELA_RENDER_PT_motion_blur(_CandelaPanel, bpy.types.Panel):
    """Of final renders"""

    bl_label = "Motion Blur"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context):
        self.layout.prop(context.scene.render, "use_motion_blur", text="")

    def draw(self, context):
        render = context.scene.render
        column = _columns(self)
        column.active = render.use_motion_blur
        column.prop(render, "motion_blur_position", text="Position")
        column.prop(render, "motion_blur_shutter")
        column.prop(context.scene.candela, "motion_steps")


class CANDELA_RENDER_PT_motion_blur_curve(_CandelaPanel, bpy.types.Panel):
    bl_label = "Shutter Curve"
    bl_parent_id = "CANDELA_RENDER_PT_motion_blur"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        render = context.scene.render
        self.layout.active = render.use_motion_blur
        self.layout.template_curve_mapping(render, "motion_blur_shutter_curve")


class CANDELA_RENDER_PT_frame(_CandelaPanel, bpy.types.Panel):
    """What ran for the last picture, and what of it was reused"""

    bl_label = "Last Picture"

    def draw(self, context):
        ledger = ledgers.latest()
        if ledger is None:
            self.layout.label(text="Nothing was rendered yet.")
            return
        column = self.layout.column(align=True)
        times = ", ".join(f"{name} {_seconds(seconds)}" for name, seconds in ledger.times.items() if seconds >= 0.0005)
        wrapped(column, context, f"{ledger.samples} samples" + (f": {times}" if times else ""))
        column.separator()
        rows = by_time(ledger.rows)
        for row in rows:
            _ledger_row(column, context, row)
            if row is rows[0] and row.state == ledgers.RAN:
                column.prop(context.scene.candela, bound_of(row.name))


class CANDELA_RENDER_PT_frame_skipped(_CandelaPanel, bpy.types.Panel):
    """What the last picture did without, and why"""

    bl_label = "Skipped"
    bl_parent_id = "CANDELA_RENDER_PT_frame"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and any(row.state == ledgers.SKIPPED for row in _rows())

    def draw(self, context):
        column = self.layout.column(align=True)
        for row in _rows():
            if row.state == ledgers.SKIPPED:
                _ledger_row(column, context, row)


def by_time(rows: list[ledgers.Row]) -> list[ledgers.Row]:
    """What was not skipped, the longest first."""
    return sorted((row for row in rows if row.state != ledgers.SKIPPED), key=lambda row: -row.milliseconds)


def bound_of(name: str) -> str:
    """The property of the setting that bounds what a technique costs: the first of its own that drafts bound, too, or
    the number of samples."""
    own = next((technique for technique in REGISTRY if technique.name == name), None)
    bounding = (param for param in own.params_of(SCENE) if param.draft is not None) if own is not None else ()
    return next((identifier(name, param.name) for param in bounding), "samples")


def _rows() -> list:
    ledger = ledgers.latest()
    return ledger.rows if ledger is not None else []


def _ledger_row(column, context, row) -> None:
    line = column.row()
    line.active = row.state == ledgers.RAN
    line.label(text=row.label, icon=_STATE_ICONS[row.state])
    value = line.row()
    value.alignment = "RIGHT"
    value.label(text=_seconds(row.milliseconds / 1000) if row.state == ledgers.RAN else row.state)
    if row.reason:
        wrapped(column, context, row.reason, dim=True, indent=True)
    for choice in ledgers.some_of(row.choices):
        wrapped(column, context, choice, dim=True, indent=True)


class CANDELA_RENDER_PT_frame_notes(_CandelaPanel, bpy.types.Panel):
    """What is drawn otherwise than it is set up, with a click to the culprit; what is missing comes first"""

    bl_label = "Warnings"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and (bool(_notes()) or _bad_pixels() > 0)

    def draw_header(self, context):
        self.layout.label(text=str(len(_notes()) + (_bad_pixels() > 0)), icon="ERROR")

    def draw(self, context):
        if _bad_pixels():
            wrapped(self.layout, context, f"{_bad_pixels()} values were not finite and were set to 0.", icon="ERROR")
        for note in notes.by_weight(_notes())[:MOST_NOTES]:
            row = self.layout.row()
            wrapped(row.column(align=True), context, str(note), icon="ERROR", room=2)
            kind, name = notes.target(note)
            if kind:
                button = row.operator("candela.select_culprit", text="", icon="RESTRICT_SELECT_OFF")
                button.kind, button.name = kind, name
        left = len(_notes()) - MOST_NOTES
        if left > 0:
            self.layout.label(text=f"and {left} more")


class CANDELA_VIEWLAYER_PT_passes(_CandelaPanel, bpy.types.Panel):
    bl_label = "Passes"
    bl_context = "view_layer"

    def draw(self, context):
        column = _columns(self, animatable=False)
        for number, render_pass in enumerate(PASSES):
            part = column.column(align=True, heading="Include" if number == 0 else "")
            *owner, switch = render_pass.switch.split(".")
            holder = getattr(context.view_layer, owner[0], None) if owner else context.view_layer
            if hasattr(holder, switch):  # those that Cycles brings are there while it is enabled
                part.prop(holder, switch, text=render_pass.name)


class CANDELA_VIEWLAYER_PT_override(_CandelaPanel, bpy.types.Panel):
    """In Blender before 5.1, where the panel of these settings is one of Cycles."""

    bl_label = "Override"
    bl_context = "view_layer"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and not hasattr(bpy.types, "VIEWLAYER_PT_override")

    def draw(self, context):
        column = _columns(self, animatable=False)
        column.prop(context.view_layer, "material_override")
        if hasattr(context.view_layer, "world_override"):
            column.prop(context.view_layer, "world_override")
        column.prop(context.view_layer, "samples")


class CANDELA_LIGHT_PT_beam_shape(_CandelaPanel, bpy.types.Panel):
    bl_label = "Beam Shape"
    bl_context = "data"
    bl_parent_id = "DATA_PT_EEVEE_light"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.light and context.light.type == "AREA"

    def draw(self, context):
        _columns(self).prop(context.light, "spread")


class CANDELA_LIGHT_PT_shadow(_CandelaPanel, bpy.types.Panel):
    bl_label = "Shadow"
    bl_context = "data"
    bl_parent_id = "DATA_PT_EEVEE_light"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.light

    def draw(self, context):
        _columns(self).prop(context.light, "use_shadow", text="Cast Shadow")


class CANDELA_OBJECT_PT_ray_visibility(_CandelaPanel, bpy.types.Panel):
    bl_label = "Ray Visibility"
    bl_context = "object"
    bl_parent_id = "OBJECT_PT_visibility"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.object

    def draw(self, context):
        column = _columns(self)
        for name in (
            "camera",
            "diffuse",
            "glossy",
            "transmission",
            "volume_scatter",
            "shadow",
        ):  # visible_camera and so on
            column.prop(context.object, f"visible_{name}", text=name.replace("_", " ").title())
        if context.object.type != "LIGHT":
            column.prop(context.object, "is_shadow_catcher")


class CANDELA_WORLD_PT_ray_visibility(_CandelaPanel, bpy.types.Panel):
    bl_label = "Ray Visibility"
    bl_context = "world"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        # The settings are Cycles': there while its add-on is enabled.
        return super().poll(context) and context.world and hasattr(context.world, "cycles_visibility")

    def draw(self, context):
        column = _columns(self)
        for name in ("camera", "diffuse", "glossy", "transmission", "scatter"):
            text = "Volume Scatter" if name == "scatter" else name.title()
            column.prop(context.world.cycles_visibility, name, text=text)


class CANDELA_MATERIAL_PT_settings(_CandelaPanel, bpy.types.Panel):
    bl_label = "Settings"
    bl_context = "material"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.material

    def draw(self, context):
        column = _columns(self)
        column.prop(context.material, "pass_index")
        column.prop(context.material, "use_transparent_shadow", text="Transparent Shadows")
        column.prop(context.scene.candela, "use_backface_culling", text="Cull Back Faces")
        part = column.column(heading="Backface Culling")
        part.active = context.scene.candela.use_backface_culling
        part.prop(context.material, "use_backface_culling", text="Camera")
        part.prop(context.material, "use_backface_culling_shadow", text="Shadow")


class CANDELA_OBJECT_PT_shadow_terminator(_CandelaPanel, bpy.types.Panel):
    bl_label = "Shadow Terminator"
    bl_context = "object"
    bl_parent_id = "OBJECT_PT_shading"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.object and context.object.type != "LIGHT"

    def draw(self, context):
        _columns(self).prop(context.object, "shadow_terminator_geometry_offset", text="Geometry Offset")


class CANDELA_OT_select_culprit(bpy.types.Operator):
    """Select what the warning is about, and show it in the Properties editor"""

    bl_idname = "candela.select_culprit"
    bl_label = "Select"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    kind: bpy.props.StringProperty(options={"SKIP_SAVE"})
    name: bpy.props.StringProperty(options={"SKIP_SAVE"})

    def execute(self, context):
        if self.kind == "WORLD":
            _show_tab(context, "WORLD")
            return {"FINISHED"}
        shown = None
        if self.kind == "OBJECT":
            shown = context.view_layer.objects.get(self.name)
        elif self.kind == "MATERIAL":
            shown = _show_material(context.view_layer, self.name)
        if shown is None:
            self.report({"WARNING"}, f"No object of this view layer is or uses '{self.name}'.")
            return {"CANCELLED"}
        if context.mode != "OBJECT" and bpy.ops.object.mode_set.poll():
            bpy.ops.object.mode_set(mode="OBJECT")
        for other in context.view_layer.objects.selected:
            other.select_set(False)
        shown.select_set(True)
        context.view_layer.objects.active = shown
        _show_tab(context, "MATERIAL" if self.kind == "MATERIAL" else "OBJECT")
        return {"FINISHED"}


def _show_material(layer, name: str):
    """The first object that uses a material of this name, with that slot made active; None if there is none."""
    for candidate in layer.objects:
        for index, slot in enumerate(candidate.material_slots):
            if slot.material is not None and slot.material.name == name:
                candidate.active_material_index = index
                return candidate
    return None


def _show_tab(context, tab: str) -> None:
    space = context.space_data
    if space is None or space.type != "PROPERTIES":
        return
    if _shows_tab(space, tab):
        return
    # The editor learns of another active object, and of its tabs, only when it is drawn again. Until then it has no
    # such tab; where none comes, it is hidden, or of no use for the kind of object.
    left = iter(range(TAB_TRIES))

    def again() -> float | None:
        return None if _shows_tab(space, tab) or next(left, None) is None else TAB_S

    bpy.app.timers.register(again, first_interval=TAB_S)


def _shows_tab(space, tab: str) -> bool:
    """Whether a Properties editor shows this tab now, or is gone."""
    try:
        space.context = tab
    except TypeError:
        return False
    except ReferenceError:
        pass
    return True


def _notes() -> tuple:
    ledger = ledgers.latest()
    return ledger.notes if ledger is not None else ()


def _bad_pixels() -> int:
    ledger = ledgers.latest()
    return ledger.bad_pixels if ledger is not None else 0


def _seconds(seconds: float) -> str:
    if seconds >= 1:
        return f"{seconds:.1f} s"
    return f"{seconds * 1000:.1f} ms" if seconds < 0.1 else f"{seconds * 1000:.0f} ms"


def _draw_pause(self, context):
    """The button in the header of a rendered viewport, as Cycles has one."""
    space = context.space_data
    if context.engine == ENGINE and space is not None and space.shading.type == "RENDERED":
        paused = context.scene.candela.viewport_pause
        self.layout.prop(context.scene.candela, "viewport_pause", icon="PLAY" if paused else "PAUSE", text="")


def _panels_of_groups() -> list[type]:
    """The panels of all groups that hold something, each before those below it."""
    made = []
    for group in (*GROUPS, OTHERS):
        own = [one for one in members(group) if one.name not in {*_WITH_OTHERS, *_PARENTS}]
        if group.slots or own:
            made += [*_group_panels(group), *map(_technique_panel, own)]
    return made


_CLASSES = (
    CANDELA_OT_select_culprit,
    CANDELA_RENDER_PT_frame_notes,  # first: panels stand in this order
    CANDELA_RENDER_PT_sampling,
    CANDELA_RENDER_PT_light_paths,
    *(_technique_panel(technique) for technique in REGISTRY if technique.name in _PARENTS),
    *_panels_of_groups(),
    CANDELA_RENDER_PT_film,
    CANDELA_RENDER_PT_motion_blur,
    CANDELA_RENDER_PT_motion_blur_curve,
    CANDELA_RENDER_PT_techniques,
    CANDELA_RENDER_PT_simplify,
    CANDELA_RENDER_PT_performance,
    CANDELA_RENDER_PT_frame,
    CANDELA_RENDER_PT_frame_skipped,
    CANDELA_VIEWLAYER_PT_passes,
    *pass_panels.CLASSES,
    *bake_panel.CLASSES,
    CANDELA_VIEWLAYER_PT_override,
    CANDELA_LIGHT_PT_beam_shape,
    CANDELA_LIGHT_PT_shadow,
    CANDELA_OBJECT_PT_ray_visibility,
    CANDELA_WORLD_PT_ray_visibility,
    CANDELA_MATERIAL_PT_settings,
    CANDELA_OBJECT_PT_shadow_terminator,
)


def register() -> None:
    for made in _CLASSES:
        bpy.utils.register_class(made)
    bpy.types.VIEW3D_HT_header.append(_draw_pause)
    blender_panels.show(ENGINE)


def unregister() -> None:
    blender_panels.withdraw(ENGINE)
    bpy.types.VIEW3D_HT_header.remove(_draw_pause)
    for made in reversed(_CLASSES):
        bpy.utils.unregister_class(made)
