"""The render passes that Candela writes, under Blender's own names: those of light from frame/light_paths.py."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from ..frame.light_paths import LIGHT_PATHS
from ..frame.technique import CAMERA
from .properties import block_of


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
_SURFACES = (
    ("use_pass_z", "Depth", "Depth", "Z", "VALUE", "film.depth"),
    ("use_pass_mist", "Mist", "Mist", "Z", "VALUE", "color.diffuse", 3),
    ("use_pass_position", "Position", "Position", "XYZ", "VECTOR", "film.position"),
    ("use_pass_normal", "Normal", "Normal", "XYZ", "VECTOR", "surface.normal_sum"),
    ("use_pass_diffuse_color", "Diffuse Color", "DiffCol", "RGB", "COLOR", "color.diffuse"),
    ("use_pass_glossy_color", "Glossy Color", "GlossCol", "RGB", "COLOR", "color.glossy"),
    ("use_pass_transmission_color", "Transmission Color", "TransCol", "RGB", "COLOR", "color.transmission"),
    ("use_pass_object_index", "Object Index", "IndexOB", "X", "VALUE", "film.index"),
    ("use_pass_material_index", "Material Index", "IndexMA", "X", "VALUE", "film.index", 1),
)
_LIGHT = tuple(
    (path.switch, path.label, path.before_5, "RGB", "COLOR", " / ".join(filter(None, (path.image, path.color))))
    for path in LIGHT_PATHS
)


def _in_blenders_order(rows: tuple) -> list:
    """Data passes, then each lobe's light followed by its colour, as Blender's panel lists them."""
    first = [row for row in rows if row[5].startswith(("film.depth", "film.position", "surface.")) or row[1] == "Mist"]
    last = [row for row in rows if row[5] == "film.index"]
    by_lobe = sorted((row for row in rows if row not in first and row not in last), key=lambda row: _place(row[1]))
    return [*first, *by_lobe, *last]


def _place(name: str) -> int:
    order = ("Diffuse", "Glossy", "Transmission", "Volume", "Emission", "Environment")
    parts = ("Direct", "Indirect", "Color")
    lobe, _, part = name.partition(" ")
    return 4 * order.index(lobe) + (parts.index(part) if part in parts else 0)


PASSES = tuple(
    RenderPass(switch, name if bpy.app.version >= (5, 0) else old, channels, kind, source, *first)
    for switch, name, old, channels, kind, source, *first in _in_blenders_order((*_SURFACES, *_LIGHT))
)


# What things change of the light on shadow catchers: 1 where nothing (film/catcher.py).
CATCHER = RenderPass("cycles.use_pass_shadow_catcher", "Shadow Catcher", "RGB", "COLOR", "film.catcher")
PASSES = (*PASSES, CATCHER)

# The picture as an eye sees it, beside a Combined that stays as it is; written where glare is on.
GLARE = RenderPass("", "Glare", "RGBA", "COLOR", "film.lens")


def wanted_passes(layer: bpy.types.ViewLayer, scene: bpy.types.Scene | None = None) -> list[RenderPass]:
    """The passes that a view layer asks for, and that of the scene's camera where it sees with an eye."""
    wanted = [render_pass for render_pass in PASSES if _ticked(layer, render_pass.switch)]
    return [*wanted, GLARE] if scene is not None and glare_is_on(scene) else wanted


def glare_is_on(scene: bpy.types.Scene) -> bool:
    """Whether pictures of the scene's camera are shown with glare."""
    camera = block_of(CAMERA, scene)
    return camera is not None and camera.candela.glare_mode != "OFF"


# Passes of Blender and Cycles that Candela does not write: switch of the view layer or of what it has of Cycles.
_OTHERS = (
    ("use_pass_vector", "Vector"), ("use_pass_uv", "UV"),
    ("use_pass_shadow", "Shadow"), ("use_pass_ambient_occlusion", "Ambient Occlusion"),
    ("use_pass_subsurface_direct", "Subsurface Direct"), ("use_pass_subsurface_indirect", "Subsurface Indirect"),
    ("use_pass_subsurface_color", "Subsurface Color"),
    ("use_pass_cryptomatte_object", "Cryptomatte Object"), ("use_pass_cryptomatte_material", "Cryptomatte Material"),
    ("use_pass_cryptomatte_asset", "Cryptomatte Asset"),
    ("cycles.denoising_store_passes", "Denoising Data"),
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
