"""Quality presets, as Blender's own: the six that come with Candela, and those that the artist adds.

A preset holds the scene's samples and parameters of the techniques: what costs time for less error, and not what is
rendered (slots, tree, seed, bounces). What it does not name gets its default. Its first line is its tooltip.
"""

import ast
from pathlib import Path

import bpy
from bl_operators.presets import AddPresetBase
from bl_ui.utils import PresetPanel

from ..frame.technique import SCENE, identifier
from ..techniques import REGISTRY

FOLDER = "candela/quality"
PATH = str(Path(__file__).parent)  # of the folder presets/


class CANDELA_OT_quality_preset_add(AddPresetBase, bpy.types.Operator):
    """Add or remove a quality preset"""

    bl_idname = "candela.quality_preset_add"
    bl_label = "Add Quality Preset"
    preset_menu = "CANDELA_PT_quality_presets"
    preset_subdir = FOLDER
    preset_defines = ("candela = bpy.context.scene.candela",)
    preset_values = tuple(
        f"candela.{name}"
        for name in (
            "samples",
            "viewport_samples",
            *(identifier(technique.name, param.name) for technique in REGISTRY for param in technique.params_of(SCENE)),
        )
    )


class CANDELA_OT_quality_preset(bpy.types.Operator):
    """Use a quality preset"""

    bl_idname = "candela.quality_preset"
    bl_label = "Use Quality Preset"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    filepath: bpy.props.StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})

    @classmethod
    def description(cls, context, properties):
        return about(Path(properties.filepath)) or "Set what this preset holds"

    def execute(self, context):
        if not Path(self.filepath).is_file():  # before anything is given up for it
            self.report({"ERROR"}, f"There is no preset at {self.filepath}: choose another one in the menu.")
            return {"CANCELLED"}
        own = context.scene.candela
        for name in CANDELA_OT_quality_preset_add.preset_values:
            own.property_unset(name.removeprefix("candela."))
        return bpy.ops.script.execute_preset(filepath=self.filepath, menu_idname=CANDELA_PT_quality_presets.__name__)


def about(path: Path) -> str:
    """What a preset's file says of itself, without the full stop; empty if it says nothing or cannot be read."""
    try:
        return (ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").rstrip(".")
    except (OSError, SyntaxError, ValueError):
        return ""


class CANDELA_PT_quality_presets(PresetPanel, bpy.types.Panel):
    bl_label = "Quality Presets"
    preset_subdir = FOLDER
    preset_operator = CANDELA_OT_quality_preset.bl_idname
    preset_add_operator = CANDELA_OT_quality_preset_add.bl_idname


_CLASSES = (CANDELA_OT_quality_preset_add, CANDELA_OT_quality_preset, CANDELA_PT_quality_presets)


def register() -> None:
    for made in _CLASSES:
        bpy.utils.register_class(made)
    bpy.utils.register_preset_path(PATH)


def unregister() -> None:
    bpy.utils.unregister_preset_path(PATH)
    for made in reversed(_CLASSES):
        bpy.utils.unregister_class(made)
