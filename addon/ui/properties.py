"""Blender properties, generated from the parameters that the techniques declare."""

from __future__ import annotations

import bpy

from ..frame.settings import OFF, AUTO, BOUNCES, SAMPLES, SEED, Settings
from ..frame.technique import Param
from ..techniques import REGISTRY
from .pass_tree import TREE, order_of

PREVIEW_SAMPLES = 8  # of material icons, which are drafts


def _redraw(group, context) -> None:
    """Tell Blender that the scene differs, whoever has changed it.

    A button's change does so by itself. A script's does not where an extension declares the property without `update`:
    the picture in the viewport would stay as it is until something else changes.
    """
    group.id_data.update_tag()


def _property(param: Param, **changes):
    """A bpy property for a declared parameter."""
    common = {"name": param.label, "description": param.description, "default": param.default, "update": _redraw}
    common |= changes
    if isinstance(param.default, bool):
        return bpy.props.BoolProperty(**common)
    if isinstance(param.default, str):
        items = [(identifier, label, "", number) for identifier, label, number in param.items]
        return bpy.props.EnumProperty(items=items, **common)
    limits = {}
    if param.minimum is not None:
        limits["min"] = param.minimum
    if param.maximum is not None:
        limits["max"] = param.maximum
    make = bpy.props.IntProperty if isinstance(param.default, int) else bpy.props.FloatProperty
    if param.unit:
        limits["subtype"] = param.unit
    return make(**common, **limits)


def identifier(technique: str, param: str) -> str:
    """Name of the scene property that holds a technique's parameter."""
    return f"{technique}_{param}"


def _slot_items(slot: str) -> list[tuple[str, str, str, int]]:
    items = [(AUTO, "Auto", "Let Candela choose by what the scene holds", 0)]
    for number, technique in enumerate((t for t in REGISTRY if t.slot == slot), 1):
        summary = (technique.__module__ and __import__(technique.__module__, fromlist=["_"]).__doc__) or ""
        items.append((technique.name, technique.label, summary.strip().splitlines()[0], number))
    items.append((OFF, "Off", "Leave out what techniques of this slot draw", 255))
    return items


def slots() -> list[str]:
    """Names of all slots, in the registry's order."""
    return list(dict.fromkeys(t.slot for t in REGISTRY if t.slot))


def _annotations() -> dict:
    out = {
        "samples": _property(SAMPLES),
        "viewport_samples": _property(SAMPLES, name="Viewport Samples", default=32),
        "seed": _property(SEED),
        "bounces": _property(BOUNCES),
    }
    out["pass_tree"] = bpy.props.PointerProperty(
        type=bpy.types.NodeTree, name="Pass Tree", poll=lambda _, tree: tree.bl_idname == TREE, update=_redraw,
        description="Render the passes of this tree; without one, Candela chooses them by slot and scene",
    )  # fmt: skip
    for slot in slots():
        out[f"slot_{slot}"] = bpy.props.EnumProperty(
            name=slot.capitalize(),
            description=f"Technique for the {slot} slot",
            items=_slot_items(slot),
            default=AUTO,
            update=_redraw,
        )
    for technique in REGISTRY:
        for param in technique.params:
            out[identifier(technique.name, param.name)] = _property(param)
    return out


CandelaSceneSettings = type(
    "CandelaSceneSettings",
    (bpy.types.PropertyGroup,),
    {"__annotations__": _annotations(), "__doc__": "Candela's settings of a scene.", "__module__": __name__},
)


def settings_of(scene, viewport: bool, preview: bool = False, layer=None) -> Settings:
    """The scene's Blender properties as plain settings; in a final render of a view layer, with its number of samples
    where it has one of its own."""
    group = scene.candela
    tree = group.pass_tree
    final = (layer.samples if layer is not None else 0) or group.samples
    samples = PREVIEW_SAMPLES if preview else (group.viewport_samples if viewport else final)
    settings = Settings(
        samples=samples,
        whole=not viewport,
        seed=group.seed,
        bounces=group.bounces,
        passes=None if tree is None else order_of(tree),
        slots={slot: getattr(group, f"slot_{slot}") for slot in slots()},
        values={
            (technique.name, param.name): getattr(group, identifier(technique.name, param.name))
            for technique in REGISTRY
            for param in technique.params
        },
    )
    return settings.as_draft() if preview else settings


def register() -> None:
    bpy.utils.register_class(CandelaSceneSettings)
    bpy.types.Scene.candela = bpy.props.PointerProperty(type=CandelaSceneSettings)


def unregister() -> None:
    del bpy.types.Scene.candela
    bpy.utils.unregister_class(CandelaSceneSettings)
