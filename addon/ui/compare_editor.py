"""The comparison with Cycles in the Image Editor: one image that shows either engine, their difference or the error.

The pictures of all light paths are kept as arrays; the image of this name is rewritten when another is chosen, so that
one key press (or a click) swaps the two engines in place.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import bpy
import numpy as np

from ..compare import metrics, pictures
from ..compare.beside import reference_steps
from ..compare.comparison import Picture, compare_passes
from ..compare.report import shown_pixels
from . import shown_images, shown_otherwise
from .jobs import Job, draw_progress, layer_named, part
from .pass_run import render_steps
from .properties import settings_of, titled
from .texts import wrapped

IMAGE = "Candela Comparison"
NAMES_SHARE = 0.46  # of the table's width
VIEWS = (
    ("CANDELA", "Candela", "The picture by Candela", 0),
    ("CYCLES", "Cycles", "The reference by Cycles: the mean of two renders", 1),
    ("DIFFERENCE", "Difference", "Absolute difference, channel by channel", 2),
    ("ERROR", "Error", "Relative squared error of each pixel, from dark (1e-5) to light (10)", 3),
)


_rows: tuple[Picture, ...] = ()
_asked_in = 0  # while a comparison shows what came out: the Image Editor in which it was begun, by its address


def latest() -> tuple[Picture, ...]:
    """The rows of the last comparison; empty before the first."""
    return _rows


def table_of(rows: tuple[Picture, ...]) -> list[tuple[int, Picture]]:
    """(number, row) of those that the panel lists: light as Blender's passes have it, divided by colour, is left to the
    command line where the same light stands there as it is seen."""
    names = {picture.row.label for picture in rows}
    return [
        (number, picture)
        for number, picture in enumerate(rows)
        if picture.row.label.removesuffix(" pass") not in names - {picture.row.label}
    ]


def picture_of(row: Picture, view: str, gain: float = 1.0) -> np.ndarray:
    """What the image shows of a row, (H, W, 3) linear; a difference is multiplied by the gain."""
    if row.x is None or row.reference is None:
        return np.zeros((1, 1, 3), np.float32)
    if row.row.name in ("depth", "normal"):
        x, reference = (shown_pixels(row.row.name, image, row.reference) for image in (row.x, row.reference))
    else:
        x, reference = row.x, row.reference
    made = {
        "CANDELA": lambda: x,
        "CYCLES": lambda: reference,
        "DIFFERENCE": lambda: gain * pictures.difference(x, reference),
        "ERROR": lambda: pictures.error_map(x, reference),
    }
    return np.nan_to_num(made[view]()[..., :3]).astype(np.float32)


def _show(self, context) -> None:
    rows = latest()
    if rows:
        picture = picture_of(rows[min(self.row, len(rows) - 1)], self.view, self.gain)
        shown_images.show(context, IMAGE, picture, _asked_in or shown_images.editor_of(context))


class CandelaComparison(bpy.types.PropertyGroup):
    """What the Image Editor shows of the last comparison."""

    samples: bpy.props.IntProperty(
        name="Samples", description="Samples of Candela's picture", default=32, min=1, max=65536
    )
    reference_samples: bpy.props.IntProperty(
        name="Reference Samples", description="Samples of each of the two renders by Cycles", default=128, min=1,
        max=65536,
    )  # fmt: skip
    percentage: bpy.props.IntProperty(
        name="Resolution", description="Size of the compared pictures, in percent of the render resolution",
        default=50, min=1, max=100,
        subtype="PERCENTAGE",
    )  # fmt: skip
    view: bpy.props.EnumProperty(name="View", description="What the image shows", items=VIEWS, update=_show)
    gain: bpy.props.FloatProperty(
        name="Gain", description="Factor by which differences are brightened", default=8.0, min=0.01,
        soft_max=64.0, update=_show,
    )  # fmt: skip
    row: bpy.props.IntProperty(name="Light Path", description="Light path that the image shows", min=0, update=_show)


class CANDELA_OT_compare(Job, bpy.types.Operator):
    """Render this scene with Candela and with Cycles, and compare every light path. The reference is kept"""

    bl_idname = "candela.compare"
    bl_label = "Compare with Cycles"

    def work(self, context) -> Iterator[tuple[float, str]]:
        editor = shown_images.editor_of(context)
        scene, options = context.scene, context.window_manager.candela_comparison
        share = scene.render.resolution_percentage * options.percentage / 10000
        size = tuple(max(int(side * share), 1) for side in (scene.render.resolution_x, scene.render.resolution_y))
        settings = replace(settings_of(scene, viewport=False), samples=options.samples)
        layer = context.view_layer.name
        shown_otherwise.warn(self, context.view_layer)
        rendered = yield from part(render_steps(scene, context.evaluated_depsgraph_get(), size, settings), 0.0, 0.5)
        chosen = layer_named(scene, layer)
        steps = reference_steps(scene, options.reference_samples, settings.bounces == 0, size, chosen)
        reference = yield from part(steps, 0.5, 1.0)
        global _rows, _asked_in
        _rows, _asked_in = compare_passes(rendered.passes(), reference, with_flip=False), editor
        try:
            _show(options, context)
        finally:
            _asked_in = 0
        yield 1.0, "done"


class CANDELA_OT_compare_show(bpy.types.Operator):
    """Show this light path"""

    bl_idname = "candela.compare_show"
    bl_label = "Show Light Path"
    bl_options = {"INTERNAL"}

    row: bpy.props.IntProperty(options={"SKIP_SAVE"})

    def execute(self, context):
        context.window_manager.candela_comparison.row = self.row
        return {"FINISHED"}


class CANDELA_OT_compare_swap(bpy.types.Operator):
    """Switch between Candela's and Cycles' picture in place"""

    bl_idname = "candela.compare_swap"
    bl_label = "Swap Candela and Cycles"

    @classmethod
    def poll(cls, context):
        return bool(latest())

    def execute(self, context):
        options = context.window_manager.candela_comparison
        options.view = "CYCLES" if options.view == "CANDELA" else "CANDELA"
        return {"FINISHED"}


class IMAGE_PT_candela_compare(bpy.types.Panel):
    bl_label = "Compare with Cycles"
    bl_space_type = "IMAGE_EDITOR"
    bl_region_type = "UI"
    bl_category = "Candela"

    def draw(self, context):
        layout, options = self.layout, context.window_manager.candela_comparison
        column = layout.column()
        column.use_property_split, column.use_property_decorate = True, False
        column.prop(options, "samples")
        column.prop(options, "reference_samples", text="Reference")
        column.prop(options, "percentage")
        layout.operator("candela.compare", icon="PLAY")
        draw_progress(layout)
        if not latest():
            return
        column = layout.column(align=True)
        for pair in (("CANDELA", "CYCLES"), ("DIFFERENCE", "ERROR")):
            row = column.row(align=True)
            for view in pair:
                row.prop_enum(options, "view", view)
        if options.view == "DIFFERENCE":
            column.prop(options, "gain")
        layout.operator("candela.compare_swap", icon="ARROW_LEFTRIGHT")
        table = layout.column(align=True)
        head = table.split(factor=NAMES_SHARE)
        head.label(text="")
        row = head.row()
        row.label(text="relMSE")
        row.label(text="Bias")
        for number, made in table_of(latest()):
            line = table.split(factor=NAMES_SHARE, align=True)
            line.operator(
                "candela.compare_show", text=titled(made.row.label), depress=number == options.row
            ).row = number
            row = line.row()
            if metrics.is_surface(made.error):
                row.label(text="see below" if made.error.remark else f"{made.error.median:.1e}")
            else:
                relmse, _, _, bias, _ = metrics.figures(made.error)
                row.label(text=relmse)
                row.label(text=bias)
        for _, made in table_of(latest()):
            if made.error.remark:
                wrapped(layout, context, f"{titled(made.row.label)}: {made.error.remark}.", dim=True)


_CLASSES = (
    CandelaComparison,
    CANDELA_OT_compare,
    CANDELA_OT_compare_show,
    CANDELA_OT_compare_swap,
    IMAGE_PT_candela_compare,
)


@bpy.app.handlers.persistent
def _another_file(*_) -> None:
    global _rows
    _rows = ()


def register() -> None:
    for made in _CLASSES:
        bpy.utils.register_class(made)
    bpy.app.handlers.load_post.append(_another_file)
    bpy.types.WindowManager.candela_comparison = bpy.props.PointerProperty(type=CandelaComparison)


def unregister() -> None:
    bpy.app.handlers.load_post.remove(_another_file)
    del bpy.types.WindowManager.candela_comparison
    for made in reversed(_CLASSES):
        bpy.utils.unregister_class(made)
