"""Differences between viewport and render.

Python can ask Blender for the scene as the viewport has it alone; a render evaluates it anew, with its own levels of
modifiers and its own hidden objects. Comparisons in the interface take Candela's picture from the one and Cycles' from
the other, and say so where that makes a difference.
"""

from __future__ import annotations

from collections.abc import Iterator

import bpy

DRAWN = ("MESH", "CURVE", "SURFACE", "FONT", "META", "CURVES", "POINTCLOUD", "VOLUME", "LIGHT")


def objects_shown_otherwise(layer: bpy.types.ViewLayer) -> list[str]:
    """Names of the layer's objects that a render hides, shows or modifies otherwise than the viewport."""
    rendered = set(_in_rendered_collections(layer.layer_collection))
    drawn = [thing for thing in layer.objects if thing.type in DRAWN or thing.instance_collection]
    return [thing.name for thing in drawn if _differs(thing, layer, thing in rendered and not thing.hide_render)]


def warn(operator: bpy.types.Operator, layer: bpy.types.ViewLayer) -> None:
    """Report such objects, if there are any."""
    names = objects_shown_otherwise(layer)
    if names:
        some = ", ".join(f"'{name}'" for name in names[:3]) + (", …" if len(names) > 3 else "")
        operator.report(
            {"WARNING"},
            f"The viewport shows {some} otherwise than a render: Candela's picture is of the former, Cycles' of the "
            "latter. Give modifiers the same levels, and hide objects in both.",
        )


def _in_rendered_collections(collection: bpy.types.LayerCollection) -> Iterator[bpy.types.Object]:
    if not collection.exclude and not collection.collection.hide_render:
        yield from collection.collection.objects
        for child in collection.children:
            yield from _in_rendered_collections(child)


def _differs(thing: bpy.types.Object, layer: bpy.types.ViewLayer, rendered: bool) -> bool:
    shown = thing.visible_get(view_layer=layer)
    return shown != rendered or (shown and any(_modifies_otherwise(modifier) for modifier in thing.modifiers))


def _modifies_otherwise(modifier: bpy.types.Modifier) -> bool:
    if modifier.show_viewport != modifier.show_render:
        return True
    levels = getattr(modifier, "render_levels", None)
    return modifier.show_render and levels is not None and levels != modifier.levels
