"""The render passes that Candela writes, under Blender's own names: one table for the engine and the interface."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np


@dataclass(frozen=True)
class RenderPass:
    """One of Blender's passes. `source` names the frame's image it is made from, and one to divide it by, if any."""

    switch: str  # property of the view layer
    name: str
    channels: str
    kind: str  # of the values, as Blender calls it
    source: str
    first: int = 0  # channel of the image

    @property
    def images(self) -> list[str]:
        """Names of the frame's images that it is made from."""
        return self.source.split(" / ")

    def pixels(self, arrays: dict[str, np.ndarray], exposure: float) -> np.ndarray:
        """The pass, (H, W, channels) float32, from the frame's mean images."""
        image, *color = self.images
        pixels = arrays[image][..., self.first : self.first + len(self.channels)]
        if color:
            pixels = divide_by_color(pixels, arrays[color[0]][..., :3])
        return pixels * exposure if image.startswith("radiance.") else pixels


# Switch of the view layer, Blender's name since 5.0 and before, channels, type, source, first channel if not 0.
_TABLE = (
    ("use_pass_z", "Depth", "Depth", "Z", "VALUE", "film.depth"),
    ("use_pass_mist", "Mist", "Mist", "Z", "VALUE", "color.diffuse", 3),
    ("use_pass_position", "Position", "Position", "XYZ", "VECTOR", "film.position"),
    ("use_pass_normal", "Normal", "Normal", "XYZ", "VECTOR", "surface.normal_sum"),
    ("use_pass_diffuse_direct", "Diffuse Direct", "DiffDir", "RGB", "COLOR", "radiance.diffuse_direct / color.diffuse"),
    (
        "use_pass_diffuse_indirect", "Diffuse Indirect", "DiffInd", "RGB", "COLOR",
        "radiance.diffuse_indirect / color.diffuse",
    ),
    ("use_pass_diffuse_color", "Diffuse Color", "DiffCol", "RGB", "COLOR", "color.diffuse"),
    ("use_pass_glossy_direct", "Glossy Direct", "GlossDir", "RGB", "COLOR", "radiance.glossy_direct / color.glossy"),
    (
        "use_pass_glossy_indirect", "Glossy Indirect", "GlossInd", "RGB", "COLOR",
        "radiance.glossy_indirect / color.glossy",
    ),
    ("use_pass_glossy_color", "Glossy Color", "GlossCol", "RGB", "COLOR", "color.glossy"),
    (
        "use_pass_transmission_direct", "Transmission Direct", "TransDir", "RGB", "COLOR",
        "radiance.transmission_direct / color.transmission",
    ),
    (
        "use_pass_transmission_indirect", "Transmission Indirect", "TransInd", "RGB", "COLOR",
        "radiance.transmission_indirect / color.transmission",
    ),
    (
        "use_pass_transmission_color", "Transmission Color", "TransCol", "RGB", "COLOR", "color.transmission",
    ),
    ("cycles.use_pass_volume_direct", "Volume Direct", "VolumeDir", "RGB", "COLOR", "radiance.volume_direct"),
    ("cycles.use_pass_volume_indirect", "Volume Indirect", "VolumeInd", "RGB", "COLOR", "radiance.volume_indirect"),
    ("use_pass_emit", "Emission", "Emit", "RGB", "COLOR", "radiance.emission"),
    ("use_pass_environment", "Environment", "Env", "RGB", "COLOR", "radiance.environment"),
    ("use_pass_object_index", "Object Index", "IndexOB", "X", "VALUE", "film.index"),
    ("use_pass_material_index", "Material Index", "IndexMA", "X", "VALUE", "film.index", 1),
)  # fmt: skip

PASSES = tuple(
    RenderPass(switch, name if bpy.app.version >= (5, 0) else old, channels, kind, source, *first)
    for switch, name, old, channels, kind, source, *first in _TABLE
)


def wanted_passes(layer: bpy.types.ViewLayer) -> list[RenderPass]:
    """The passes that a view layer asks for."""
    return [render_pass for render_pass in PASSES if _ticked(layer, render_pass.switch)]


# Passes of Blender and Cycles that Candela does not write: switch of the view layer or of what it has of Cycles.
_OTHERS = (
    ("use_pass_vector", "Vector"), ("use_pass_uv", "UV"),
    ("use_pass_shadow", "Shadow"), ("use_pass_ambient_occlusion", "Ambient Occlusion"),
    ("use_pass_subsurface_direct", "Subsurface Direct"), ("use_pass_subsurface_indirect", "Subsurface Indirect"),
    ("use_pass_subsurface_color", "Subsurface Color"),
    ("use_pass_cryptomatte_object", "Cryptomatte Object"), ("use_pass_cryptomatte_material", "Cryptomatte Material"),
    ("use_pass_cryptomatte_asset", "Cryptomatte Asset"),
    ("cycles.denoising_store_passes", "Denoising Data"),
    ("cycles.use_pass_shadow_catcher", "Shadow Catcher"),
)  # fmt: skip


def missing_passes(layer: bpy.types.ViewLayer) -> list[str]:
    """Names of the passes that a view layer asks for in vain, so that what reads them will find nothing."""
    names = [name for switch, name in _OTHERS if _ticked(layer, switch)]
    names += [f"AOV '{aov.name}'" for aov in layer.aovs]
    return names + [f"light group '{group.name}'" for group in layer.lightgroups]


def _ticked(layer: bpy.types.ViewLayer, switch: str) -> bool:
    thing = layer
    for name in switch.split("."):
        thing = getattr(thing, name, False)
    return bool(thing)


def divide_by_color(light: np.ndarray, color: np.ndarray) -> np.ndarray:
    """Light over colour per channel, as Cycles writes its passes: a channel without colour takes the mean of others."""
    has = color != 0.0
    quotient = np.where(has, light / np.where(has, color, 1.0), 0.0)
    count = has.sum(axis=-1, keepdims=True)
    mean = quotient.sum(axis=-1, keepdims=True) / np.maximum(count, 1)
    return np.where(has, quotient, mean).astype(np.float32)
