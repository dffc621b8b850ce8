"""The menu Render Pass of a 3D view's shading: one pass in place of the picture, as Cycles' and EEVEE's menus offer."""

import bpy

from ..frame.light_paths import LIGHT_PATHS
from . import ENGINE
from .passes import PASSES, RenderPass

COMBINED = "COMBINED"
_LIGHT = {path.switch: path.label for path in LIGHT_PATHS}
_DATA = {
    "use_pass_z": "Depth", "use_pass_position": "Position", "use_pass_normal": "Normal",
    "use_pass_diffuse_color": "Diffuse Color", "use_pass_glossy_color": "Glossy Color",
    "use_pass_transmission_color": "Transmission Color",
}  # fmt: skip
_LABELS = _DATA | _LIGHT  # by the switch of the view layer, as Blender calls them since 5.0
OFFERED = {_LABELS[one.switch].upper().replace(" ", "_"): one for one in PASSES if one.switch in _LABELS}


ITEMS = [
    (COMBINED, "Combined", "The picture"),
    *((key, _LABELS[one.switch], f"The pass {_LABELS[one.switch]}") for key, one in OFFERED.items()),
]


class CandelaShading(bpy.types.PropertyGroup):
    render_pass: bpy.props.EnumProperty(
        name="Render Pass",
        description="What this view shows: the picture, or one of the passes that it is made of",
        items=ITEMS,
        default=COMBINED,
    )


def shown_pass(space) -> RenderPass | None:
    """The pass that a 3D view shows in its picture's place; None for the picture."""
    own = getattr(getattr(space, "shading", None), "candela", None)
    return OFFERED.get(own.render_pass) if own is not None else None


class CANDELA_VIEW3D_PT_render_pass(bpy.types.Panel):
    bl_label = "Render Pass"
    bl_space_type = "VIEW_3D"
    bl_region_type = "HEADER"
    bl_parent_id = "VIEW3D_PT_shading"

    @classmethod
    def poll(cls, context):
        return context.engine == ENGINE and context.space_data.shading.type == "RENDERED"

    def draw(self, context):
        self.layout.prop(context.space_data.shading.candela, "render_pass", text="")


_CLASSES = (CandelaShading, CANDELA_VIEW3D_PT_render_pass)


def register() -> None:
    for one in _CLASSES:
        bpy.utils.register_class(one)
    bpy.types.View3DShading.candela = bpy.props.PointerProperty(type=CandelaShading)


def unregister() -> None:
    del bpy.types.View3DShading.candela
    for one in reversed(_CLASSES):
        bpy.utils.unregister_class(one)
