"""Blender's own panels, shown for Candela too: what Candela reads from them works as it does everywhere in Blender."""

from __future__ import annotations

from collections.abc import Iterator

import bpy

# Panels of EEVEE, and of engines in general, whose settings Candela reads.
_TAKEN = {
    "DATA_PT_EEVEE_light",
    "DATA_PT_camera_dof",
    "DATA_PT_camera_dof_aperture",
    "EEVEE_MATERIAL_PT_context_material",
    "EEVEE_MATERIAL_PT_displacement",
    "EEVEE_MATERIAL_PT_surface",
    "EEVEE_MATERIAL_PT_volume",
    "EEVEE_WORLD_PT_mist",
    "EEVEE_WORLD_PT_surface",
    "EEVEE_WORLD_PT_volume",
    "MATERIAL_PT_preview",
    "NODE_DATA_PT_EEVEE_light",
    "VIEWLAYER_PT_filter",
    "VIEWLAYER_PT_override",
}
# Panels for every engine whose settings Candela does not read, or that have a better one in _TAKEN.
_LEFT = {
    "DATA_PT_light",
    "NODE_DATA_PT_light",
    "RENDER_PT_simplify",
    "RENDER_PT_simplify_greasepencil",
    "RENDER_PT_simplify_render",
    "RENDER_PT_simplify_viewport",
}
_LEFT_FAMILIES = ("lightprobe",)


def _shown() -> Iterator[type]:
    for panel in bpy.types.Panel.__subclasses__():
        engines = getattr(panel, "COMPAT_ENGINES", None)
        if engines is None:
            continue
        name = panel.__name__
        left = name in _LEFT or any(family in name for family in _LEFT_FAMILIES)
        if name in _TAKEN or ("BLENDER_RENDER" in engines and not left):
            yield panel


def show(engine: str) -> None:
    """Show Blender's panels while `engine` is chosen."""
    for panel in _shown():
        panel.COMPAT_ENGINES.add(engine)


def withdraw(engine: str) -> None:
    """Undo `show`, in every panel there is: what counts as one of them may have changed since. The extension's own
    panels keep the engine: they are registered again with the same classes."""
    own = __package__.rpartition(".")[0]
    for panel in bpy.types.Panel.__subclasses__():
        if not panel.__module__.startswith(own) and engine in getattr(panel, "COMPAT_ENGINES", ()):
            panel.COMPAT_ENGINES.remove(engine)
