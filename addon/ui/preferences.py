"""The extension's preferences: what this device was measured to do, by which Candela chooses between methods, and
which settings are shown."""

from __future__ import annotations

import bpy

from ..frame import device_probe
from ..gfx import context, device


class CANDELA_OT_measure_device(bpy.types.Operator):
    """Measure the costs of this device again, for example after a change of its clocks; takes a fraction of a second"""

    bl_idname = "candela.measure_device"
    bl_label = "Measure Again"

    def execute(self, _context):
        try:
            context.ensure()
            with context.turn:
                device.forget(device_probe.folder())
                device_probe.ensure()
        except (RuntimeError, ValueError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


class CandelaPreferences(bpy.types.AddonPreferences):
    bl_idname = __package__.removesuffix(".ui").removesuffix(".addon")  # the extension's own name

    show_expert: bpy.props.BoolProperty(
        name="Show Expert Settings",
        description="Show parameters of techniques that trade one error for another, in the parts Advanced",
    )

    compiles_ahead: bpy.props.BoolProperty(
        name="Compile Shaders in a Second Process",
        description="Let a second Blender without a window compile what a viewport needs, so that this one goes on "
        "answering. It begins when Candela is chosen as the engine, a file that has it is opened, or the extension is "
        "enabled. It takes memory for a second copy of the scene, and ends two minutes after the last shader",
        default=True,
    )

    def draw(self, _context):
        column = self.layout.column()
        column.prop(self, "show_expert")
        column.prop(self, "compiles_ahead")
        for line in device_lines():
            column.label(text=line)
        self.layout.operator(CANDELA_OT_measure_device.bl_idname, icon="FILE_REFRESH")


def device_lines() -> list[str]:
    """The device and its figures, as sentences."""
    if not device.known():
        return ["What this device does is measured when it first draws."]
    return [f"Choices between methods follow what this device does: {context.describe()}", *device.current().lines()]


_CLASSES = (CANDELA_OT_measure_device, CandelaPreferences)


register, unregister = bpy.utils.register_classes_factory(_CLASSES)
