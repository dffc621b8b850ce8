"""Blender's bake settings, with its own bake operator (addon/bake.py does what it asks)."""

from __future__ import annotations

import bpy

from . import ENGINE

LIT = ("DIFFUSE", "GLOSSY", "TRANSMISSION")
SEEN = ("COMBINED", *LIT, "SHADOW", "EMIT")  # kinds that may be seen from the camera


class CANDELA_RENDER_PT_bake(bpy.types.Panel):
    """Light, colours or shapes of objects as images"""

    bl_label = "Bake"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    bl_options = {"DEFAULT_CLOSED"}
    COMPAT_ENGINES = {ENGINE}

    @classmethod
    def poll(cls, context):
        return context.engine in cls.COMPAT_ENGINES

    def draw(self, context):
        layout, kind, settings = self.layout, context.scene.candela.bake_type, context.scene.render.bake
        layout.use_property_split, layout.use_property_decorate = True, False
        layout.operator("object.bake", icon="RENDER_STILL").type = kind
        layout.prop(context.scene.candela, "bake_type")
        if kind in SEEN:
            layout.prop(settings, "view_from")
        self._influence(layout, kind, settings)
        column = layout.column()
        column.prop(settings, "use_selected_to_active")
        part = column.column()
        part.active = settings.use_selected_to_active
        part.prop(settings, "use_cage", text="Cage")
        if settings.use_cage:
            part.prop(settings, "cage_object")
        part.prop(settings, "cage_extrusion", text="Extrusion")
        part.prop(settings, "max_ray_distance")
        column = layout.column()
        column.prop(settings, "target")
        if settings.target == "IMAGE_TEXTURES":
            column.prop(settings, "use_clear", text="Clear Image")
            column.prop(settings, "margin_type", text="Margin")
            column.prop(settings, "margin", text="Size")

    @staticmethod
    def _influence(layout, kind: str, settings) -> None:
        if kind == "NORMAL":
            column = layout.column(align=True)
            for name, text in (("space", "Space"), ("r", "Swizzle R"), ("g", "G"), ("b", "B")):
                column.prop(settings, f"normal_{name}", text=text)
        elif kind == "COMBINED" or kind in LIT:
            lobes = ("diffuse", "glossy", "transmission", "emit") if kind == "COMBINED" else ("color",)
            column = layout.column(heading="Contributions", align=True)
            for name in ("direct", "indirect", *lobes):
                column.prop(settings, f"use_pass_{name}")


CLASSES = (CANDELA_RENDER_PT_bake,)
