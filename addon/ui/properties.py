"""Blender properties, generated from the parameters that the techniques declare."""

from __future__ import annotations

from functools import cache
from math import floor, log10

import bpy

from ..frame.schedule import AT_REST, FINAL
from ..frame.settings import (
    AUTO,
    BOUNCES,
    MOTION_STEPS,
    NOISE_THRESHOLD,
    OFF,
    SAMPLE_COUNT,
    SAMPLE_OFFSET,
    SAMPLES,
    SEED,
    TIME_LIMIT,
    Settings,
)
from ..frame.technique import (
    CAMERA,
    DIRECTION,
    LIGHT,
    MATERIAL,
    OBJECT,
    OF_A_PICTURE,
    POINT,
    SCENE,
    WORLD,
    Param,
    identifier,
)
from ..techniques import REGISTRY
from ..techniques.airlight import AS_IN_CYCLES, MOST_BOUNCES, Airlight
from ..techniques.denoise import Denoise
from .pass_tree import TREE, order_of

_VECTOR_OF_HANDLE = {POINT: "TRANSLATION", DIRECTION: "DIRECTION"}
OFF_NUMBER = 255  # of the item in slots' menus, beyond all techniques
PREVIEW_SAMPLES = 4  # of material icons, which are drafts


def _redraw(group, context) -> None:
    """Tell Blender that the scene differs, whoever has changed it.

    A button's change does so by itself. A script's does not where an extension declares the property without `update`:
    the picture in the viewport would stay as it is until something else changes.
    """
    group.id_data.update_tag()


_SMALL = {"a", "an", "and", "as", "at", "by", "for", "from", "in", "of", "on", "or", "per", "the", "to", "with", "x"}


def titled(label: str) -> str:
    """A label as Blender writes its own: Title Case but for small words in its middle."""
    words = [
        word if number and word in _SMALL else "-".join(part[:1].upper() + part[1:] for part in word.split("-"))
        for number, word in enumerate(label.split(" "))
    ]
    return " ".join(words)


def precision_of(default: float) -> int:
    """Digits behind the point with which a value like the default is not shown as zero."""
    if default >= 10.0:
        return 1
    return 3 if default == 0.0 or default >= 0.01 else min(2 - floor(log10(default)), 6)


def _property(param: Param, **changes):
    """A bpy property for a declared parameter."""
    common = {
        "name": titled(param.label),
        "description": param.description,
        "default": param.default,
        "update": _redraw,
    }
    common |= changes
    if param.many:
        del common["default"], common["update"]
        return bpy.props.CollectionProperty(type=entry_group(param), **common)
    if param.image or param.object:
        del common["default"]
        return bpy.props.PointerProperty(type=bpy.types.Image if param.image else bpy.types.Object, **common)
    if param.file:
        return bpy.props.StringProperty(**common, subtype="FILE_PATH")
    if isinstance(param.default, tuple):
        vector = {"size": len(param.default), "subtype": param.unit or _VECTOR_OF_HANDLE.get(param.handle, "NONE")}
        return bpy.props.FloatVectorProperty(**common, **vector)
    if isinstance(param.default, bool):
        return bpy.props.BoolProperty(**common)
    if isinstance(param.default, str):
        items = [(identifier, titled(label), about, number) for identifier, label, number, about in param.items]
        return bpy.props.EnumProperty(items=items, **common)
    limits = {}
    if param.minimum is not None:
        limits["min"] = param.minimum
    if param.maximum is not None:
        limits["max"] = param.maximum
    make = bpy.props.IntProperty if isinstance(param.default, int) else bpy.props.FloatProperty
    if param.unit:
        limits["subtype"] = param.unit
    # Lengths are shown in the scene's units.
    if isinstance(param.default, float) and param.unit != "DISTANCE" and "precision" not in common:
        limits["precision"] = precision_of(param.default)
    return make(**common, **limits)


def _slot_items(slot: str) -> list[tuple[str, str, str, int]]:
    items = [(AUTO, "Auto", "Let Candela choose by what the scene holds", 0)]
    for number, technique in enumerate((t for t in REGISTRY if slot in t.fills), 1):
        summary = (technique.__module__ and __import__(technique.__module__, fromlist=["_"]).__doc__) or ""
        items.append((technique.name, titled(technique.label), summary.strip().splitlines()[0], number))
    return [*items, (OFF, "Off", "Leave this light out", OFF_NUMBER)]


# Of Blender's bake operator.
BAKE_TYPES = (
    ("COMBINED", "Combined", "Light of all kinds that are chosen below"),
    ("AO", "Ambient Occlusion", "How open places are to the sky"),
    ("SHADOW", "Shadow", "Share of the lamps' light that arrives"),
    ("POSITION", "Position", "Places in the world"),
    ("NORMAL", "Normal", "Normals, with bumps"),
    ("UV", "UV", "Places in the map that renders"),
    ("ROUGHNESS", "Roughness", "Roughness of gloss"),
    ("EMIT", "Emit", "What surfaces emit"),
    ("ENVIRONMENT", "Environment", "The world, in the direction of a place from the origin"),
    ("DIFFUSE", "Diffuse", "Light of diffuse surfaces, or their colour"),
    ("GLOSSY", "Glossy", "Light that is mirrored, or its colour"),
    ("TRANSMISSION", "Transmission", "Light that shines through, or its colour"),
)  # fmt: skip


def slots() -> list[str]:
    """Names of all slots, in the registry's order."""
    return list(dict.fromkeys(slot for t in REGISTRY for slot in t.fills))


def _annotations() -> dict:
    out = {
        "samples": _property(SAMPLES),
        "viewport_samples": _property(SAMPLES, name="Viewport Samples", default=32),
        "seed": _property(SEED),
        "bounces": _property(BOUNCES),
        "sample_offset": _property(SAMPLE_OFFSET),
        "sample_count": _property(SAMPLE_COUNT),
        "time_limit": _property(TIME_LIMIT, subtype="TIME_ABSOLUTE"),
        "noise_threshold": _property(NOISE_THRESHOLD, precision=3),
        "motion_steps": _property(MOTION_STEPS),
        "split_light_groups": bpy.props.BoolProperty(
            name="Direct and Indirect", update=_redraw,
            description="Write two more passes for each light group: its direct light with what is seen of it, and its "
            "indirect light",
        ),
        "use_denoise": bpy.props.BoolProperty(
            name="Denoise Render", default=True, update=_redraw,
            description="Filter the remaining noise of final renders after the last sample",
        ),
        "use_viewport_denoise": bpy.props.BoolProperty(
            name="Denoise Viewport", default=True, update=_redraw,
            description="Filter the remaining noise of the viewport after its last sample",
        ),
        "navigation": bpy.props.EnumProperty(
            name="Navigation", default="10", update=_redraw,
            description="Frame rate to aim for while the view or the scene changes. The resolution is lowered as far "
            "as that takes, but never below 64 pixels along the height of the camera's frame",
            items=(
                ("10", "10 fps", "Finer pixels"), ("20", "20 fps", "Smoother"), ("30", "30 fps", "Smoothest"),
            ),
        ),
        "use_backface_culling": bpy.props.BoolProperty(
            name="Backface Culling", default=False, update=_redraw,
            description="Leave out back faces of materials that EEVEE would leave out, for the camera and for shadows. "
            "Cycles draws them",
        ),
        "bake_type": bpy.props.EnumProperty(
            name="Bake Type", default="COMBINED", description="What is baked of objects", update=_redraw,
            items=BAKE_TYPES,
        ),
        "viewport_pause": bpy.props.BoolProperty(
            name="Pause Viewport", default=False, update=_redraw,
            description="Stop updating rendered viewports, so that the GPU is free for other work",
        ),
    }  # fmt: skip
    out["pass_tree"] = bpy.props.PointerProperty(
        type=bpy.types.NodeTree, name="Pass Tree", poll=lambda _, tree: tree.bl_idname == TREE, update=_redraw,
        description="Render the passes of this node tree; without one, Candela chooses techniques by the menus of the "
        "panels above and by the scene",
    )  # fmt: skip
    for slot in slots():
        out[f"slot_{slot}"] = bpy.props.EnumProperty(
            name=slot.capitalize(),
            description=f"Technique for this part of the light ({slot}); Auto chooses by what the scene holds",
            items=_slot_items(slot),
            default=AUTO,
            update=_redraw,
        )
    return out | _declared(SCENE)


def _declared(scope: str) -> dict:
    """Properties of all parameters that techniques declare for a kind of data-block; lists have an active entry."""
    out = {}
    for technique in REGISTRY:
        for param in technique.params:
            if param.scope == scope:
                name = identifier(technique.name, param.name)
                out[name] = _property(param)
                if param.many:
                    out[f"{name}_active"] = bpy.props.IntProperty(
                        name=f"Active of {titled(param.label)}", options={"HIDDEN"}
                    )
    return out


@cache
def entry_group(param: Param) -> type:
    """The property group of one entry of a list; an entry has a name beside the parameters."""
    annotations = {"name": bpy.props.StringProperty(name="Name", update=_redraw)}
    annotations |= {own.name: _property(own) for own in param.many}
    title = "".join(word.title() for word in param.name.split("_"))
    return _group(f"Candela{title}Entry", annotations, f"One of {param.label}.")


def _group(name: str, annotations: dict, text: str) -> type:
    return type(
        name, (bpy.types.PropertyGroup,), {"__annotations__": annotations, "__doc__": text, "__module__": __name__}
    )


def _entry_groups() -> list[type]:
    return [entry_group(param) for technique in REGISTRY for param in technique.params if param.many]


_ENTRIES = _entry_groups()  # made first: the groups below refer to them
CandelaSceneSettings = _group("CandelaSceneSettings", _annotations(), "Candela's settings of a scene.")
# Of the other kinds of data-block: (type, its group), by scope.
GROUPS = {
    scope: (block, _group(f"Candela{scope.title()}Settings", _declared(scope), f"Settings of a {scope.lower()}."))
    for scope, block in (
        (CAMERA, bpy.types.Camera), (WORLD, bpy.types.World), (LIGHT, bpy.types.Light),
        (MATERIAL, bpy.types.Material), (OBJECT, bpy.types.Object),
    )
}  # fmt: skip


def block_of(scope: str, scene, depsgraph=None):
    """The data-block of a scope that a picture has one of: the scene, its camera's data or its world; None if missing.
    With the dependency graph, as it is evaluated: keyframes and drivers of a final render change nothing else."""
    if scope == CAMERA:
        camera = scene.camera
        if camera is None or camera.type != "CAMERA":
            return None
        return (camera.evaluated_get(depsgraph) if depsgraph is not None else camera).data
    block = scene.world if scope == WORLD else scene
    return block.evaluated_get(depsgraph) if depsgraph is not None and block is not None else block


def put_values(scene, values: dict[tuple[str, str], object]) -> None:
    """Set parameters of which a picture has one value each, by (technique, parameter): in the scene and its world, and
    in all cameras that markers make active. ValueError with a sentence where there is no such data-block."""
    marked = [marker.camera for marker in scene.timeline_markers if marker.camera and marker.camera.type == "CAMERA"]
    for scope, key, name, _ in _of_a_picture(REGISTRY):
        if key not in values:
            continue
        blocks = [block_of(scope, scene), *(camera.data for camera in marked if scope == CAMERA)]
        if blocks == [None]:
            raise ValueError(f"'{'.'.join(key)}' is a setting of the {scope.lower()}, and the scene has none.")
        for block in filter(None, blocks):
            setattr(block.candela, name, values[key])


def _values(scene, depsgraph) -> dict[tuple[str, str], object]:
    """What is set of the parameters of which a picture has one value each."""
    values = {}
    blocks = {scope: block_of(scope, scene, depsgraph) for scope in OF_A_PICTURE}
    groups = {scope: block.candela for scope, block in blocks.items() if block is not None}
    for scope, key, name, is_tuple in _of_a_picture(REGISTRY):
        if scope in groups:
            value = getattr(groups[scope], name)
            values[key] = tuple(value) if is_tuple else value
    return values


@cache
def _of_a_picture(registry: tuple) -> list[tuple[str, tuple[str, str], str, bool]]:
    """Scope, key in the settings and property of each parameter of which a picture has one value; whether that is a
    tuple."""
    return [
        (
            param.scope,
            (technique.name, param.name),
            identifier(technique.name, param.name),
            isinstance(param.default, tuple),
        )
        for technique in registry
        for param in technique.params
        if param.scope in OF_A_PICTURE and not (param.many or param.image)
    ]


def _volume_bounces(scene) -> int:
    """Of the scene's light paths; there while the Cycles add-on is enabled."""
    return min(getattr(getattr(scene, "cycles", None), "volume_bounces", 0), MOST_BOUNCES)


def settings_of(scene, viewport: bool, preview: bool = False, layer=None, depsgraph=None) -> Settings:
    """The Blender properties of the scene, its camera and world as plain settings; in a final render of a view layer,
    with its number of samples where it has one of its own. With a dependency graph, as they are evaluated."""
    group = block_of(SCENE, scene, depsgraph).candela
    tree = group.pass_tree
    values = _values(scene, depsgraph)
    if values.get((Airlight.name, "bounces")) == AS_IN_CYCLES:
        values[Airlight.name, "bounces"] = _volume_bounces(block_of(SCENE, scene, depsgraph))
    if not (group.use_viewport_denoise if viewport else group.use_denoise):
        values[Denoise.name, "strength"] = 0.0
    final = (layer.samples if layer is not None else 0) or group.samples
    samples = PREVIEW_SAMPLES if preview else (group.viewport_samples if viewport else final)
    alone = not (viewport or preview or group.sample_offset or group.sample_count)  # a whole picture, by one machine
    settings = Settings(
        samples=samples,
        schedule=AT_REST if viewport else FINAL,
        seed=group.seed,
        bounces=group.bounces,
        sample_offset=0 if viewport or preview else group.sample_offset,
        sample_count=0 if viewport or preview else group.sample_count,
        time_limit=group.time_limit if alone else 0.0,
        noise_threshold=group.noise_threshold if alone else 0.0,
        motion_steps=group.motion_steps,
        passes=None if tree is None else order_of(tree),
        slots={slot: getattr(group, f"slot_{slot}") for slot in slots()},
        values=values,
    )
    return settings.as_draft() if preview else settings


def register() -> None:
    for group in _ENTRIES:
        bpy.utils.register_class(group)
    for block, group in ((bpy.types.Scene, CandelaSceneSettings), *GROUPS.values()):
        bpy.utils.register_class(group)
        block.candela = bpy.props.PointerProperty(type=group)


def unregister() -> None:
    for block, group in reversed(((bpy.types.Scene, CandelaSceneSettings), *GROUPS.values())):
        del block.candela
        bpy.utils.unregister_class(group)
    for group in reversed(_ENTRIES):
        bpy.utils.unregister_class(group)
