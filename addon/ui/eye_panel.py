"""The eye in the camera's tab: presets of observers, and previews of the pupil and of its glare.

The pictures are image data-blocks, "Candela Pupil" and "Candela Glare": the Image Editor shows them, and the compositor
convolves with the second one (Convolve node, or an Image node for older ones), which sums up to 1 in each channel. They
show the eye at the scene's frame when they were made; a final render does not need them.
"""

from __future__ import annotations

import bpy
import numpy as np

from ..eye import optics, point_spread
from ..eye.presets import PRESETS
from ..frame.technique import CAMERA, identifier
from ..gfx import context as gpu_context
from ..gfx import images
from ..gfx.context import turn
from ..snapshot.camera import camera_of_scene
from ..techniques.eye import THREE, EyeModel, aperture_of
from ..techniques.temporal_glare import TemporalGlare, degrees_per_pixel
from . import ENGINE, shown_images
from .properties import block_of, settings_of
from .texts import refusal

PUPIL, GLARE = "Candela Pupil", "Candela Glare"
_PARENT = f"CANDELA_CAMERA_PT_{EyeModel.name}"
_ICON_SCALE = 7.0


class CANDELA_OT_eye_preset(bpy.types.Operator):
    """Set the eye of this camera to a preset observer; keyframes of its settings are kept"""

    bl_idname = "candela.eye_preset"
    bl_label = "Observer"
    bl_options = {"REGISTER", "UNDO"}

    preset: bpy.props.EnumProperty(
        name="Observer",
        items=[(name, one.label, one.description, number) for number, (name, one) in enumerate(PRESETS.items())],
    )

    @classmethod
    def poll(cls, context):
        return _camera(context) is not None

    def execute(self, context):
        camera = _camera(context)
        if refused := refusal(camera):
            self.report({"ERROR"}, refused)
            return {"CANCELLED"}
        named = PRESETS[self.preset].values
        for param in EyeModel.params:
            if param.name in named or param.name in _OF_OBSERVERS:
                setattr(camera.candela, identifier(EyeModel.name, param.name), named.get(param.name, param.default))
        camera.update_tag()
        return {"FINISHED"}


_OF_OBSERVERS = {name for preset in PRESETS.values() for name in preset.values}


class CANDELA_OT_eye_pictures(bpy.types.Operator):
    """Make images of the pupil and of the glare of a point of light, at this frame, with this camera's settings"""

    bl_idname = "candela.eye_pictures"
    bl_label = "Update Pictures"
    bl_options = {"REGISTER", "UNDO"}

    whole: bpy.props.BoolProperty(
        name="With Core", default=True,
        description="Include the light that is not scattered, so that convolution with the image preserves energy",
    )  # fmt: skip

    @classmethod
    def poll(cls, context):
        return _camera(context) is not None and context.scene.camera is not None

    def execute(self, context):
        try:
            gpu_context.ensure()
        except RuntimeError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        pupil, glare = pictures(context.scene, context.evaluated_depsgraph_get(), whole=self.whole)
        for name, pixels in ((PUPIL, pupil), (GLARE, glare)):
            _keep(name, pixels)
        return {"FINISHED"}


def pictures(scene, depsgraph, whole: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """(pupil, kernel) of the scene's camera at its frame: (n, n, 4) float32, row 0 at the bottom.

    The kernel is over the pixels of a final render, and each of its channels sums up to 1 (without its core: to the
    share that is scattered).
    """
    settings = settings_of(scene, viewport=False, depsgraph=depsgraph)
    technique, glare = EyeModel(), TemporalGlare()
    render = scene.render
    width, height = (max(side * render.resolution_percentage // 100, 1) for side in
                     (render.resolution_x, render.resolution_y))  # fmt: skip
    camera = camera_of_scene(scene, depsgraph, width, height)
    seconds = scene.frame_current_final * render.fps_base / render.fps
    # Nothing was measured here: the picture's own mean may differ, and with it an automatic pupil.
    aperture = aperture_of(settings, seconds, settings.get(glare, "luminance") * 0.18)
    side, defocus = technique.sides(settings)[0], settings.get(technique, "defocus")
    scale = optics.scale_of(
        side, degrees_per_pixel(camera, width, height), settings.get(glare, "magnification"), aperture.diameter,
        defocus, max(width, height),
    )  # fmt: skip
    with turn:
        pattern = point_spread.make_pattern(
            aperture, side, defocus, settings.get(technique, "wavelengths"),
            planes=settings.get(technique, "planes") == THREE,
            light=technique.light(settings),
        )  # fmt: skip
        kernel = point_spread.make_kernel(pattern.colours, scale, sharp=not whole)
        weights = images.read(kernel.weights)
        fine = images.read(pattern.aperture)[..., :1]
        kernel.release()
        pattern.release()
    weights[..., 3] = 1.0
    open_part = fine.reshape(side, 2, side, 2).mean(axis=(1, 3))
    return np.concatenate([np.repeat(open_part[..., None], 3, axis=2), np.ones((side, side, 1))], axis=2), weights


def _keep(name: str, pixels: np.ndarray) -> None:
    """As a float image data-block of the file, in place of the one that was kept before."""
    image = shown_images.write(name, pixels)
    image.pack()
    preview = image.preview_ensure()
    shown = _as_preview(pixels, 128)
    preview.image_size = shown.shape[1], shown.shape[0]
    preview.image_pixels_float.foreach_set(shown.ravel())


def _as_preview(pixels: np.ndarray, side: int) -> np.ndarray:
    """(side, side, 4) float32 for an icon; light of many decades by its logarithm."""
    rows = ((np.arange(side) + 0.5) / side * len(pixels)).astype(int)
    taken = pixels[np.ix_(rows, rows)].astype(np.float64)
    light = taken[..., :3]
    peak = light.max()
    if peak > 0.0 and np.median(light) < 0.01 * peak:
        light = 1.0 + np.log10(np.maximum(light / peak, 1e-12)) / 5.0
    return np.concatenate([light.clip(0.0, 1.0), np.ones((side, side, 1))], axis=2).astype(np.float32)


def _camera(context):
    """The camera whose tab is shown, or the scene's."""
    return getattr(context, "camera", None) or block_of(CAMERA, context.scene)


class CANDELA_CAMERA_PT_eye_pictures(bpy.types.Panel):
    """Presets of observers, the pupil, and the glare of a point of light"""

    bl_label = "Observer"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "data"
    bl_parent_id = _PARENT
    COMPAT_ENGINES = {ENGINE}

    @classmethod
    def poll(cls, context):
        return context.engine == ENGINE and context.camera is not None

    def draw(self, context):
        layout = self.layout
        layout.operator_menu_enum("candela.eye_preset", "preset", text="Observers")
        row = layout.row()
        for name in (PUPIL, GLARE):
            image = shown_images.written(name)
            if image is not None and image.preview is not None:
                row.template_icon(icon_value=image.preview.icon_id, scale=_ICON_SCALE)
        layout.operator("candela.eye_pictures", icon="FILE_REFRESH")


_CLASSES = (CANDELA_OT_eye_preset, CANDELA_OT_eye_pictures, CANDELA_CAMERA_PT_eye_pictures)


register, unregister = bpy.utils.register_classes_factory(_CLASSES)
