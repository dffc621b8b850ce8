"""The walk over `depsgraph.object_instances`: what is placed where, with each object's facts asked only once.

Blender hands out every instance of a collection, geometry node, particle system or vertex/face instancer here, and
also the meshes of curves, texts, surfaces and metaballs, as instances of their own object. The iterator's objects
are temporary, so nothing of them is kept but the data-block of the mesh (or of hair curves or a point cloud, which
strands.py makes a mesh), which lives as long as the evaluation.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from .scene import Note, Visibility

_DRAWN = ("MESH", "CURVES", "POINTCLOUD")
# Object types that Cycles draws and we do not, as an artist calls them.
_NOT_DRAWN = {
    "VOLUME": "volume",
    "GREASEPENCIL": "grease pencil",
    "GPENCIL": "grease pencil",
}
_UNUSED_ID = 2147483647  # what Blender fills persistent_id with


@dataclass
class MeshPlace:
    """A mesh instance as found; `facts` is shared by all instances of the same object in the same parent."""

    facts: ObjectFacts
    key: str
    random: float
    matrix: object  # mathutils.Matrix, a copy; many are converted at once
    generated: tuple[float, float, float] = (0.0, 0.0, 0.0)  # where on its instancer an instance stands
    uv: tuple[float, float] = (0.0, 0.0)


@dataclass
class LightPlace:
    """A light instance as found."""

    facts: ObjectFacts
    key: str
    matrix: object


@dataclass
class ObjectFacts:
    """What holds for all instances of one object's data in one parent."""

    shown: bool
    name: str
    uid: int  # of the original object
    parent_uid: int  # of the original instancer, 0 for none
    data: object  # evaluated mesh or light data-block
    data_uid: int  # session_uid of the original data-block, 0 for generated geometry
    owner: object  # evaluated object that owns the data: the instanced one, not the iterator's temporary
    materials: tuple  # evaluated bpy materials (or None), one per slot
    visibility: Visibility
    holdout: bool
    pass_index: int
    random: float
    color: tuple[float, float, float, float]


def walk(depsgraph, shown: Callable | None = None) -> tuple[list[MeshPlace], list[LightPlace], tuple[Note, ...]]:
    """All mesh and light instances in Blender's order. `shown(object)` may hide some (a viewport's local view)."""
    meshes: list[MeshPlace] = []
    lights: list[LightPlace] = []
    notes: dict[Note, None] = {}
    known: dict[tuple[int, int, int], ObjectFacts] = {}
    view_layer = depsgraph.view_layer_eval
    for instance in depsgraph.object_instances:
        found = instance.object
        kind = found.type
        if kind not in _DRAWN and kind != "LIGHT":
            if kind in _NOT_DRAWN and instance.show_self:
                notes[_not_drawn(found, kind)] = None
            continue
        is_instance = instance.is_instance
        if not is_instance and instance.show_particles:
            _hair_notes(found, notes)
        if not instance.show_self:
            continue
        data = found.data
        if data is None:
            continue
        owner, parent = (instance.instance_object, instance.parent) if is_instance else (found, None)
        identity = (owner.as_pointer(), parent.as_pointer() if parent else 0, data.as_pointer())
        facts = known.get(identity)
        if facts is None:
            facts = known[identity] = _facts(found, owner, parent, data, view_layer, shown)
            _object_notes(owner, kind, notes)
        if not facts.shown:
            continue
        key = f"{facts.uid}"
        random = facts.random
        generated, uv = (0.0, 0.0, 0.0), (0.0, 0.0)
        if is_instance:
            ids = "-".join(str(number) for number in instance.persistent_id if number != _UNUSED_ID)
            key = f"{facts.uid}/{facts.parent_uid}/{ids}"
            random = (instance.random_id & 0xFFFFFFFF) / 0xFFFFFFFF
            generated, uv = tuple(instance.orco), tuple(instance.uv)
        matrix = instance.matrix_world.copy()
        if kind in _DRAWN:
            meshes.append(MeshPlace(facts, key, random, matrix, generated, uv))
        else:
            lights.append(LightPlace(facts, key, matrix))
    return meshes, lights, tuple(notes)


def _facts(found, owner, parent, data, view_layer, shown) -> ObjectFacts:
    original = owner.original
    own_data = original.data
    # Geometry that a modifier instances has no data-block of its own in the file.
    is_own = own_data is not None and owner.data is not None and owner.data.as_pointer() == data.as_pointer()
    return ObjectFacts(
        shown=shown is None or bool(shown(found)),
        name=original.name,
        uid=original.session_uid,
        parent_uid=parent.original.session_uid if parent is not None else 0,
        data=data,
        data_uid=own_data.session_uid if is_own else 0,
        owner=owner,
        materials=tuple(slot.material for slot in found.material_slots),
        visibility=_visibility(owner, parent, view_layer),
        holdout=any(one.holdout_get(view_layer=view_layer) for one in (owner, parent) if one is not None),
        pass_index=owner.pass_index,
        random=_random_of_name(original.name),
        color=tuple(owner.color),
    )


def _visibility(owner, parent, view_layer) -> Visibility:
    """Ray visibility of an object, and of what instances it: Cycles lets a ray see it only where both do."""
    flags = [
        (
            one.visible_camera and not one.indirect_only_get(view_layer=view_layer),
            one.visible_diffuse,
            one.visible_glossy,
            one.visible_transmission,
            one.visible_volume_scatter,
            one.visible_shadow,
        )
        for one in (owner, parent)
        if one is not None
    ]
    camera, diffuse, glossy, transmission, volume, shadow = (all(column) for column in zip(*flags, strict=True))
    return Visibility(camera, diffuse, glossy, transmission, volume, shadow)


def _not_drawn(found, kind: str) -> Note:
    return Note(f"Object '{found.original.name}'", f"a {_NOT_DRAWN[kind]} object is not drawn.")


def _hair_notes(found, notes: dict) -> None:
    for system in found.particle_systems:
        settings = system.settings
        if settings.type == "HAIR" and settings.render_type == "PATH":
            text = f"hair of particle system '{system.name}' is not drawn."
            notes[Note(f"Object '{found.original.name}'", text)] = None


def _object_notes(owner, kind: str, notes: dict) -> None:
    subject = f"Object '{owner.original.name}'"
    linking = getattr(owner, "light_linking", None)
    if linking is not None and (linking.receiver_collection or linking.blocker_collection):
        notes[Note(subject, "light linking is not followed: its light reaches and is blocked by every object.")] = None
    if kind not in _DRAWN:
        return
    if owner.is_shadow_catcher:
        notes[Note(subject, "is a shadow catcher, which is drawn as an ordinary surface.")] = None
    for modifier in owner.modifiers:
        domain = getattr(modifier, "domain_settings", None)
        if domain is not None and modifier.fluid_type == "DOMAIN" and domain.domain_type == "GAS":
            notes[Note(subject, "smoke and fire are not drawn; only the domain's surface is.")] = None


@lru_cache(maxsize=1 << 16)
def _random_of_name(name: str) -> float:
    """0..1, Object Info > Random of an object that is no instance.

    Cycles hashes the name (times 37 plus each byte) and mixes it with zero by Bob Jenkins' final(), public domain.
    """
    text = 0
    for byte in name.encode():
        text = (text * 37 + byte) & 0xFFFFFFFF
    return _jenkins(text, 0) / 0xFFFFFFFF


def _jenkins(x: int, y: int) -> int:
    mask = 0xFFFFFFFF
    a = b = c = (0xDEADBEEF + (2 << 2) + 13) & mask
    a, b = (a + x) & mask, (b + y) & mask

    def rotated(value: int, bits: int) -> int:
        return ((value << bits) | (value >> (32 - bits))) & mask

    c = ((c ^ b) - rotated(b, 14)) & mask
    a = ((a ^ c) - rotated(c, 11)) & mask
    b = ((b ^ a) - rotated(a, 25)) & mask
    c = ((c ^ b) - rotated(b, 16)) & mask
    a = ((a ^ c) - rotated(c, 4)) & mask
    b = ((b ^ a) - rotated(a, 14)) & mask
    return ((c ^ b) - rotated(b, 24)) & mask


def matrices(places) -> np.ndarray:
    """(N, 4, 4) float64 of the places' matrices."""
    if not places:
        return np.zeros((0, 4, 4))
    return np.array([place.matrix for place in places], np.float64)
