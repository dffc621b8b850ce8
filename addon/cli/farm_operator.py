"""The job for a render farm from Blender's window: Render > Candela Farm Job, what the verb `farm` does."""

from __future__ import annotations

import argparse
from pathlib import Path

import bpy

from ..ui import ENGINE
from . import farm
from .refused import Refused
from .verbs import Job


class CandelaFarmJob(bpy.types.Operator):
    """Write a folder with a job for render farms: Open Job Description (Deadline Cloud) and a job type of Flamenco"""

    bl_idname = "candela.farm_job"
    bl_label = "Candela Farm Job"

    directory: bpy.props.StringProperty(name="Folder", subtype="DIR_PATH", description="Folder for the job description")
    chunk: bpy.props.IntProperty(name="Frames per Task", default=5, min=1)
    split_samples: bpy.props.IntProperty(
        name="Slices",
        default=1,
        min=1,
        description="Number of parts into which a picture's samples are split, each a task of its own",
    )
    format: bpy.props.EnumProperty(name="Format", items=[("exr", "OpenEXR", ""), ("png", "PNG", "")], default="exr")
    gpu: bpy.props.BoolProperty(name="Nodes with a GPU", description="Ask the farm for nodes with a GPU")

    @classmethod
    def poll(cls, context):
        if not bpy.data.is_saved:
            cls.poll_message_set("Save the file first: the job renders what is on disk")
            return False
        return context.scene is not None and context.scene.render.engine == ENGINE

    def invoke(self, context, event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context):
        if bpy.data.is_dirty:
            self.report({"WARNING"}, "The file has changes that are not saved; the job renders what is on disk.")
        options = argparse.Namespace(
            file=Path(bpy.data.filepath), output=Path(bpy.path.abspath(self.directory)), results=None, frames=None,
            chunk=self.chunk, split_samples=self.split_samples, format=self.format, gpu=self.gpu, extensions=None,
            run_scripts=False, skip_existing=False, samples=None, size=None, scene=context.scene.name, view_layer=None,
            assignments=[], frame=None,
        )  # fmt: skip
        try:
            farm.write_job(Job(options, context.scene, None))
        except Refused as refusal:
            self.report({"ERROR"}, str(refusal))
            return {"CANCELLED"}
        self.report({"INFO"}, f"The job is in {self.directory}.")
        return {"FINISHED"}


def _in_menu(self, context):
    if context.scene.render.engine == ENGINE:
        self.layout.operator(CandelaFarmJob.bl_idname, icon="NETWORK_DRIVE")


def register() -> None:
    bpy.utils.register_class(CandelaFarmJob)
    bpy.types.TOPBAR_MT_render.append(_in_menu)


def unregister() -> None:
    bpy.types.TOPBAR_MT_render.remove(_in_menu)
    bpy.utils.unregister_class(CandelaFarmJob)
