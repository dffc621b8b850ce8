"""Quality presets, as Blender's own: the four that come with Candela, and those that the artist adds.

A preset holds the scene's samples and every parameter of the techniques: what costs time for less error, and not what
is rendered (slots, tree, seed, bounces).
"""

from __future__ import annotations

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


class CANDELA_PT_quality_presets(PresetPanel, bpy.types.Panel):
    bl_label = "Quality Presets"
    preset_subdir = FOLDER
    preset_operator = "script.execute_preset"
    preset_add_operator = "candela.quality_preset_add"


_CLASSES = (CANDELA_OT_quality_preset_add, CANDELA_PT_quality_presets)


def register() -> None:
    for made in _CLASSES:
        bpy.utils.register_class(made)
    bpy.utils.register_preset_path(PATH)


def unregister() -> None:
    bpy.utils.unregister_preset_path(PATH)
    for made in reversed(_CLASSES):
        bpy.utils.unregister_class(made)
