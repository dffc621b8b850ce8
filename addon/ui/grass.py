"""Rendering a patch of grass from Blender's window: Render > Candela Grass Patch, what the verb `grass` does."""

from __future__ import annotations

from pathlib import Path

import bpy

from ..grass import directions
from ..grass.blades import Recipe
from ..grass.generate import Order, generate, remove_left
from ..grass.patch import SUFFIX
from . import ENGINE
from .jobs import Job


class CandelaGrassPatch(Job, bpy.types.Operator):
    """Render a tile of grass with Cycles from all directions, as a patch for materials; continues after a stop"""

    bl_idname = "candela.grass_patch"
    bl_label = "Candela Grass Patch"

    filepath: bpy.props.StringProperty(name="Patch", subtype="FILE_PATH", default=f"//meadow{SUFFIX}")
    tile: bpy.props.FloatProperty(
        name="Tile", default=0.25, min=0.01, unit="LENGTH", description="Side length of the tile"
    )
    height: bpy.props.FloatProperty(
        name="Height", default=0.1, min=0.001, unit="LENGTH", description="Height of the longest blades"
    )
    blades: bpy.props.IntProperty(name="Blades", default=500, min=1, max=100_000)
    seed: bpy.props.IntProperty(name="Seed", default=1, min=0)
    texels: bpy.props.IntProperty(
        name="Texels", default=64, min=4, max=256, description="Texels along each side of the tile"
    )
    views: bpy.props.IntProperty(name="Views", default=81, min=7, max=81)
    grazing: bpy.props.BoolProperty(
        name="Grazing Views", default=True, description="Add 24 views at 85 degrees from the normal"
    )
    lights: bpy.props.IntProperty(name="Lights", default=21, min=5, max=21)
    samples: bpy.props.IntProperty(name="Samples", default=16, min=1, max=65536)
    luma: bpy.props.IntProperty(name="Components", default=8, min=1, max=8)

    def draw(self, context):
        self.layout.use_property_split = True
        for name in (
            "filepath",
            "tile",
            "height",
            "blades",
            "seed",
            "texels",
            "views",
            "grazing",
            "lights",
            "samples",
            "luma",
        ):
            self.layout.prop(self, name)

    def invoke(self, context, event):
        if bpy.app.background:
            return Job.execute(self, context)
        self._from_dialog = True
        return context.window_manager.invoke_props_dialog(self, width=400)

    def execute(self, context):
        step_by_step = getattr(self, "_from_dialog", False)
        return Job.invoke(self, context, None) if step_by_step else Job.execute(self, context)

    def work(self, context):
        views = directions.thinned(directions.VIEWS, self.views)
        if self.grazing:
            views = directions.Rings((*views.polar, directions.GRAZING), (*views.counts, 24))
        order = Order(
            Recipe(self.tile, self.height, self.blades, self.seed), self.texels, views,
            directions.thinned(directions.LIGHTS, self.lights), self.samples, self.luma,
        )  # fmt: skip
        path = Path(bpy.path.abspath(self.filepath)).with_suffix(SUFFIX)
        for done, whole in generate(order, path):
            yield done / whole, f"{done} of {whole} views"
        self.report({"INFO"}, f"The patch is {path}.")


def _in_menu(self, context):
    if context.scene.render.engine == ENGINE:
        self.layout.operator(CandelaGrassPatch.bl_idname, icon="FORCE_TURBULENCE")


@bpy.app.handlers.persistent
def _after_undo(*_) -> None:
    """Steps that were made while a tile was rendered hold it."""
    remove_left()


def register() -> None:
    bpy.utils.register_class(CandelaGrassPatch)
    bpy.app.handlers.undo_post.append(_after_undo)
    bpy.app.handlers.redo_post.append(_after_undo)
    bpy.types.TOPBAR_MT_render.append(_in_menu)


def unregister() -> None:
    bpy.types.TOPBAR_MT_render.remove(_in_menu)
    bpy.app.handlers.redo_post.remove(_after_undo)
    bpy.app.handlers.undo_post.remove(_after_undo)
    bpy.utils.unregister_class(CandelaGrassPatch)
