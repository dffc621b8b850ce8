"""The render passes that Candela writes, under Blender's own names: one table for the engine and the interface."""

from __future__ import annotations

from dataclasses import dataclass

import bpy


@dataclass(frozen=True)
class RenderPass:
    """One of Blender's passes. `source` names the frame's image it is made from, and one to divide it by, if any."""

    switch: str  # property of the view layer
    name: str
    channels: str
    kind: str  # of the values, as Blender calls it
    source: str


# Switch of the view layer, Blender's name since 5.0 and before, channels, type, source.
_TABLE = (
    ("use_pass_z", "Depth", "Depth", "Z", "VALUE", "film.depth"),
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
    ("use_pass_emit", "Emission", "Emit", "RGB", "COLOR", "radiance.emission"),
    ("use_pass_environment", "Environment", "Env", "RGB", "COLOR", "radiance.environment"),
)  # fmt: skip

PASSES = tuple(
    RenderPass(switch, name if bpy.app.version >= (5, 0) else old, channels, kind, source)
    for switch, name, old, channels, kind, source in _TABLE
)


def wanted_passes(layer: bpy.types.ViewLayer) -> list[RenderPass]:
    """The passes that a view layer asks for."""
    return [render_pass for render_pass in PASSES if getattr(layer, render_pass.switch)]
