"""Panels of the passes that a view layer has by name, and of what lights belong to which light group: Blender's own."""

from __future__ import annotations

import bpy
from bl_ui.properties_view_layer import (
    ViewLayerAOVPanelHelper,
    ViewLayerButtonsPanel,
    ViewLayerCryptomattePanelHelper,
    ViewLayerLightgroupsPanelHelper,
)

from . import ENGINE


class CANDELA_VIEWLAYER_PT_passes_aov(ViewLayerAOVPanelHelper, bpy.types.Panel):
    bl_parent_id = "CANDELA_VIEWLAYER_PT_passes"
    COMPAT_ENGINES = {ENGINE}

    def draw(self, context):
        super().draw(context)
        column = self.layout.column()
        column.use_property_split = True
        column.use_property_decorate = False
        column.prop(context.view_layer, "pass_alpha_threshold")


class CANDELA_VIEWLAYER_PT_passes_denoising(ViewLayerButtonsPanel, bpy.types.Panel):
    """Of a switch that Cycles brings: it is there while that is enabled."""

    bl_label = "Denoising Data"
    bl_parent_id = "CANDELA_VIEWLAYER_PT_passes"
    COMPAT_ENGINES = {ENGINE}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and getattr(context.view_layer, "cycles", None) is not None

    def draw(self, context):
        column = self.layout.column()
        column.use_property_split = True
        column.use_property_decorate = False
        column.prop(context.view_layer.cycles, "denoising_store_passes", text="Albedo, Normal, Depth")


class CANDELA_VIEWLAYER_PT_passes_cryptomatte(ViewLayerCryptomattePanelHelper, bpy.types.Panel):
    bl_parent_id = "CANDELA_VIEWLAYER_PT_passes"
    COMPAT_ENGINES = {ENGINE}


class CANDELA_VIEWLAYER_PT_passes_lightgroups(ViewLayerLightgroupsPanelHelper, bpy.types.Panel):
    bl_parent_id = "CANDELA_VIEWLAYER_PT_passes"
    COMPAT_ENGINES = {ENGINE}

    def draw(self, context):
        super().draw(context)
        self.layout.prop(context.scene.candela, "split_light_groups")


class _GroupPanel:
    """Where an object or a world is put into a light group."""

    bl_label = "Light Group"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_options = {"DEFAULT_CLOSED"}
    COMPAT_ENGINES = {ENGINE}

    @classmethod
    def poll(cls, context):
        return context.engine in cls.COMPAT_ENGINES and cls.owner(context) is not None

    @classmethod
    def owner(cls, context):
        return getattr(context, cls.bl_context)

    def draw(self, context):
        owner, layer = self.owner(context), context.view_layer
        self.layout.use_property_split = True
        row = self.layout.row(align=True)
        row.use_property_decorate = False
        row.prop_search(owner, "lightgroup", layer, "lightgroups", text="Light Group", results_are_suggestions=True)
        add = row.column(align=True)
        add.enabled = bool(owner.lightgroup) and owner.lightgroup not in layer.lightgroups
        add.operator("scene.view_layer_add_lightgroup", icon="ADD", text="").name = owner.lightgroup


class CANDELA_OBJECT_PT_light_group(_GroupPanel, bpy.types.Panel):
    bl_context = "object"
    bl_parent_id = "OBJECT_PT_shading"


class CANDELA_WORLD_PT_light_group(_GroupPanel, bpy.types.Panel):
    bl_context = "world"


CLASSES = (
    CANDELA_VIEWLAYER_PT_passes_aov,
    CANDELA_VIEWLAYER_PT_passes_cryptomatte,
    CANDELA_VIEWLAYER_PT_passes_denoising,
    CANDELA_VIEWLAYER_PT_passes_lightgroups,
    CANDELA_OBJECT_PT_light_group,
    CANDELA_WORLD_PT_light_group,
)
