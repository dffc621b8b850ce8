"""Painting translucency: new maps for a material, and which of them Texture Paint works on.

The maps are Blender's own images, painted with Blender's own brushes, undone and saved by Blender; Candela only makes
them, with values that change nothing, and reads them (materials/translucency.py).
"""

from __future__ import annotations

import bpy
import numpy as np

from ..frame.technique import MATERIAL, identifier
from ..materials import translucency
from ..techniques.image_space_subsurface import ImageSpaceSubsurface
from .texts import refusal

LABELS = {translucency.BLUR: "blur", translucency.TINT: "tint", translucency.TRANSLUCENCY: "translucency"}
SOFT_BRUSH = "brushes/essentials_brushes-mesh_texture.blend/Brush/Paint Soft"
OVERLAP_GRID = 64  # cells along each side of the unit square, for the check of texture coordinates
MOST_FACES = 2000  # of a mesh whose faces are looked at one by one


def property_of(name: str) -> str:
    """The Blender property that holds a map of a material."""
    return identifier(ImageSpaceSubsurface.name, name)


def overlapping(mesh) -> bool:
    """Whether faces of a mesh lie over one another in the active UV map, so that they would be painted together: more
    than a hundredth of the cells' middles lies in several. Of a mesh of many faces, from how full its cells are."""
    layer = mesh.uv_layers.active
    uv = np.zeros(2 * len(mesh.loops), np.float32)
    layer.uv.foreach_get("vector", uv)
    mesh.calc_loop_triangles()
    corners = np.zeros(3 * len(mesh.loop_triangles), np.int32)
    mesh.loop_triangles.foreach_get("loops", corners)
    a, b, c = uv.reshape(-1, 2)[corners.reshape(-1, 3)].transpose(1, 0, 2).astype(np.float64)
    double = _cross(b - a, c - a)
    if np.abs(double).sum() / 2 > 1.001:
        return True
    covered = np.zeros(OVERLAP_GRID**2)
    if len(a) <= MOST_FACES:
        middle = (np.stack(np.meshgrid(*[np.arange(OVERLAP_GRID)] * 2), axis=-1).reshape(-1, 2) + 0.5) / OVERLAP_GRID
        for p, q, r in zip(a, b, c):
            sides = [_cross(end - begin, middle - begin) for begin, end in ((p, q), (q, r), (r, p))]
            covered += (np.min(sides, axis=0) > 0.0) | (np.max(sides, axis=0) < 0.0)
        return float((covered > 1).mean()) > 0.01
    cell = np.clip(((a + b + c) / 3 * OVERLAP_GRID).astype(int), 0, OVERLAP_GRID - 1)
    np.add.at(covered, cell[:, 0] + OVERLAP_GRID * cell[:, 1], np.abs(double) / 2 * OVERLAP_GRID**2)
    return float((covered > 1.6).mean()) > 0.05


def _overlaps(edited) -> bool:
    """The same of an object's mesh, also in Edit Mode, in which Blender shows scripts no coordinates of it."""
    if not edited.data.is_editmode:
        return overlapping(edited.data)
    edited.update_from_editmode()
    copy = edited.data.copy()
    try:
        return overlapping(copy)
    finally:
        bpy.data.meshes.remove(copy)


def _cross(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


class CANDELA_OT_new_translucency_maps(bpy.types.Operator):
    """Make the maps that this material lacks, with values that change nothing, ready for Texture Paint"""

    bl_idname = "candela.new_translucency_maps"
    bl_label = "New Maps"
    bl_options = {"REGISTER", "UNDO"}

    size: bpy.props.IntProperty(name="Size", description="Pixels along each side", default=1024, min=16, max=8192)

    @classmethod
    def poll(cls, context):
        return getattr(context, "material", None) is not None or (
            context.object is not None and context.object.active_material is not None
        )

    def execute(self, context):
        material = getattr(context, "material", None) or context.object.active_material
        if refused := refusal(material):
            self.report({"ERROR"}, refused)
            return {"CANCELLED"}
        mesh = context.object.data if context.object is not None and context.object.type == "MESH" else None
        if mesh is not None and not mesh.uv_layers:
            self.report({"ERROR"}, f"'{mesh.name}' has no UV map: unwrap it first, then make maps.")
            return {"CANCELLED"}
        if mesh is not None and _overlaps(context.object):
            self.report({"WARNING"}, "Parts of the UV map lie over one another: they will be painted together.")
        made = []
        for name in translucency.MAPS:
            if getattr(material.candela, property_of(name)) is not None:
                continue
            image = bpy.data.images.new(f"{material.name} {LABELS[name]}", self.size, self.size, float_buffer=True)
            if name != translucency.TINT:
                image.colorspace_settings.name = "Non-Color"
            image.generated_color = (*translucency.NEUTRAL[name], 1.0)
            setattr(material.candela, property_of(name), image)
            made.append(LABELS[name])
        material.update_tag()
        self.report({"INFO"}, f"Made {', '.join(made)}." if made else "The material has all three maps.")
        return {"FINISHED"}


class CANDELA_OT_paint_translucency_map(bpy.types.Operator):
    """Paint this map in Texture Paint, with a soft brush where Blender has one"""

    bl_idname = "candela.paint_translucency_map"
    bl_label = "Paint"
    bl_options = {"REGISTER", "UNDO"}

    name: bpy.props.StringProperty(options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context):
        return context.object is not None and context.object.type == "MESH"

    def execute(self, context):
        material = context.object.active_material
        image = getattr(material.candela, property_of(self.name), None) if material and self.name in LABELS else None
        if image is None:
            self.report({"ERROR"}, f"There is no {LABELS.get(self.name, self.name)} map: make new maps first.")
            return {"CANCELLED"}
        if not bpy.ops.object.mode_set.poll():
            told = (
                f"'{context.object.name}' cannot be painted: enable it in viewports, or make it local if it is linked."
            )
            self.report({"ERROR"}, told)
            return {"CANCELLED"}
        settings = context.scene.tool_settings.image_paint
        settings.mode, settings.canvas = "IMAGE", image
        if context.object.mode != "TEXTURE_PAINT":
            bpy.ops.object.mode_set(mode="TEXTURE_PAINT")
            _take_soft_brush()
        return {"FINISHED"}


def _take_soft_brush() -> None:
    """Blender's own brush with a soft edge, an asset since 4.3; where there is none the brush stays as it is."""
    try:
        bpy.ops.brush.asset_activate(asset_library_type="ESSENTIALS", relative_asset_identifier=SOFT_BRUSH)
    except (AttributeError, RuntimeError):
        return


@bpy.app.handlers.persistent
def _before_save(*_) -> None:
    """Put what was painted into the file: Blender saves an image that was made in it as it was before painting."""
    for material in bpy.data.materials:
        if material.library is not None:
            continue
        for name in translucency.MAPS:
            image = getattr(material.candela, property_of(name))
            if image is not None and image.is_dirty and (image.source == "GENERATED" or image.packed_file is not None):
                image.pack()


def _draw_maps(self, context):
    column = self.layout.column()
    column.operator("candela.new_translucency_maps", icon="IMAGE_DATA")
    row = column.row(align=True)
    for name, label in LABELS.items():
        row.operator("candela.paint_translucency_map", text=f"Paint {label.title()}", icon="TPAINT_HLT").name = name


_CLASSES = (CANDELA_OT_new_translucency_maps, CANDELA_OT_paint_translucency_map)
_PANEL = f"CANDELA_{MATERIAL}_PT_{ImageSpaceSubsurface.name}"


def register() -> None:
    for made in _CLASSES:
        bpy.utils.register_class(made)
    getattr(bpy.types, _PANEL).append(_draw_maps)
    bpy.app.handlers.save_pre.append(_before_save)


def unregister() -> None:
    bpy.app.handlers.save_pre.remove(_before_save)
    getattr(bpy.types, _PANEL).remove(_draw_maps)
    for made in reversed(_CLASSES):
        bpy.utils.unregister_class(made)
