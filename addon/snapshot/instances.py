"""The walk over `depsgraph.object_instances`: what is placed where, with each object's facts asked only once.

Blender hands out every instance of a collection, geometry node, particle system or vertex/face instancer here, and
also the meshes of curves, texts, surfaces and metaballs, as instances of their own object. The iterator's objects
are temporary, so nothing of them is kept but the data-block of the mesh, which lives as long as the evaluation: or of
hair curves or a point cloud, which strands.py makes a mesh, a volume (volumes.py), or the particle system that grows
hair (hair.py). What an
object says of itself is taken over from the last walk where the updates since then cannot concern it (see cache.py).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from operator import and_

import bpy
import numpy as np

from .bound_points import bound, targets
from .cache import SnapshotCache
from .hair import HairSystem, hair_systems
from .own_settings import Own, own_settings
from .scene import Note, Visibility

_DRAWN = ("MESH", "CURVES", "POINTCLOUD")
_UNUSED_ID = 2147483647  # what Blender fills persistent_id with


@dataclass(slots=True)
class Place:
    """A mesh, light or volume as found in one place; `source` is shared by all places of one object in one parent."""

    source: Source
    key: str
    random: float
    matrix: np.ndarray  # (4, 4) float32
    generated: tuple[float, float, float] = (0.0, 0.0, 0.0)  # where on its instancer an instance stands
    uv: tuple[float, float] = (0.0, 0.0)
    ids: list[int] = ()  # Blender's persistent id of an instance, the innermost first; unused ones too

    @property
    def numbers(self) -> list[int]:
        """Those of the ids that are used."""
        return [number for number in self.ids if number != _UNUSED_ID]


@dataclass(slots=True, eq=False)
class Source:
    """What is shown, as Blender has it during this walk."""

    facts: ObjectFacts
    data: object  # evaluated mesh, light or volume data-block, or a HairSystem
    pointer: int  # its address
    owner: object  # evaluated object that owns the data: the instanced one, not the iterator's temporary
    materials: tuple  # evaluated bpy materials (or None), one per slot
    parent: object = None  # evaluated instancer
    own: str = ""  # end of its places' keys
    kind: str = "MESH"  # type of the object that is shown


LEFT_OUT = object()  # in place of the source of what is not drawn


@dataclass(frozen=True, slots=True)
class ObjectFacts:
    """What holds for all instances of one object's data in one parent; the same object as long as nothing differs."""

    shown: bool
    name: str
    uid: int  # of the original object
    parent_uid: int  # of the original instancer, 0 for none
    data_uid: int  # session_uid of the original data-block, 0 for generated geometry
    visibility: Visibility
    holdout: bool
    pass_index: int
    random: float
    color: tuple[float, float, float, float]
    terminator: float
    own: Own
    caustics_caster: bool
    shadow_catcher: bool
    smoke: bool  # a gas domain of a fluid simulation, whose mesh is not drawn
    linked: bool  # it, or its instancer, has collections of light linking
    asset: str  # name of the last ancestor
    ancestors: tuple[int, ...]  # uids of the original parent, its parent, and so on, and of objects that it aims at
    group: str
    blurred: bool  # whether motion blur shows that it moves, or that its vertices do
    deforms: bool
    notes: tuple[Note, ...]


def walk(
    depsgraph, cache: SnapshotCache, shown: Callable | None = None
) -> tuple[list[Place], list[Place], list[Place], tuple[Note, ...]]:
    """All instances of meshes, of lights and of volumes, in Blender's order. `shown(object)` may hide some (a
    viewport's local view)."""
    meshes: list[Place] = []
    lights: list[Place] = []
    volumes: list[Place] = []
    of_kind = {"LIGHT": lights, "VOLUME": volumes}
    notes: dict[Note, None] = {}
    known: dict[tuple, Source] = {}
    before, kept = cache.facts, {}
    told = cache.informed and not cache.arranged
    changed = cache.changed
    view_layer = depsgraph.view_layer_eval
    hairy, final = len(bpy.data.particles) > 0, depsgraph.mode == "RENDER"
    strands, solid, use_volumes = view_layer.use_strand, view_layer.use_solid, view_layer.use_volumes
    # Point clouds always are, as in Cycles. Domains of smoke are meshes but count as volumes.
    included = {"MESH": solid or use_volumes, "CURVES": strands, "VOLUME": use_volumes}
    # Asked of each object only where some collection says so: these two are slower than all else.
    indirect_only, holdout = _collections_say(view_layer.layer_collection)
    listed = _listed(depsgraph.object_instances)
    for instance, is_instance, shows_self, placed, numbers, random, orco, uv in zip(
        depsgraph.object_instances, *listed, strict=True
    ):
        found = instance.object
        owner, parent = (instance.instance_object, instance.parent) if is_instance else (found, None)
        own_mesh = found.data if shows_self else None
        shells = () if own_mesh is None else (own_mesh,)
        if hairy and instance.show_particles and found.type == "MESH":
            shells = (*shells, *hair_systems(owner, final))
        for data in shells:
            # Blender's objects are as good as their addresses here, and asking each for its own takes longer.
            identity = owner, parent, data.pointer if hairy and isinstance(data, HairSystem) else data
            source = known.get(identity)
            if source is None:
                kind = found.type
                hair = isinstance(data, HairSystem)
                drawn = kind in _DRAWN or kind in of_kind
                if not drawn or not (strands if hair else included.get(kind, True)):
                    known[identity] = LEFT_OUT
                    continue
                original = owner.original
                parent_uid = parent.original.session_uid if parent is not None else 0
                own_data = original.data
                pointer = data.pointer if hair else data.as_pointer()
                # Geometry that a modifier instances has no data-block of its own in the file.
                is_own = own_data is not None and (
                    not is_instance or (owner.data is not None and owner.data.as_pointer() == pointer)
                )
                data_uid = own_data.session_uid if is_own else 0
                name = original.session_uid, parent_uid, data_uid
                facts, visible = before.get(name), shown is None or bool(shown(found))
                if facts is None or not told or not (changed.isdisjoint(name) and changed.isdisjoint(facts.ancestors)):
                    top = owner if parent is None else parent
                    ancestors = _ancestors(owner)
                    cuts = _is_holdout(top, view_layer if holdout else None)
                    own = own_settings(owner)
                    # A holdout is one for the camera too, wherever it stands.
                    unseen = indirect_only and not cuts and top.indirect_only_get(view_layer=view_layer)
                    made = ObjectFacts(
                        shown=visible,
                        name=original.name,
                        uid=name[0],
                        parent_uid=parent_uid,
                        data_uid=data_uid,
                        visibility=_visibility(owner, parent, unseen),
                        holdout=cuts,
                        pass_index=owner.pass_index,
                        random=_random_of_name(original.name),
                        color=tuple(owner.color),
                        terminator=owner.shadow_terminator_geometry_offset,
                        own=bound(own, owner, depsgraph),
                        caustics_caster=getattr(getattr(owner, "cycles", None), "is_caustics_caster", False),
                        smoke=domain_of(owner) is not None,
                        shadow_catcher=owner.is_shadow_catcher or (parent is not None and parent.is_shadow_catcher),
                        linked=_is_linked(owner) or (parent is not None and _is_linked(parent)),
                        asset=ancestors[-1].name if ancestors else "",
                        ancestors=tuple(one.original.session_uid for one in (*ancestors, *targets(own, owner))),
                        group=owner.lightgroup,
                        blurred=_says(owner, parent, "use_motion_blur"),
                        deforms=_says(owner, parent, "use_deform_motion"),
                        notes=_object_notes(owner, original.name),
                    )
                    if made != facts:
                        facts = made
                elif facts.shown != visible:  # no update tells of what a viewport alone hides
                    facts = replace(facts, shown=visible)
                kept[name] = facts
                if kind == "MESH" and not hair and not (use_volumes if facts.smoke else solid):
                    known[identity] = LEFT_OUT
                    continue
                materials = _materials(found)
                if hair and materials:
                    materials = (materials[min(max(data.slot, 0), len(materials) - 1)],)
                own = f"/hair {data.number}" if hair else ""
                source = known[identity] = Source(facts, data, pointer, owner, materials, parent, own, kind)
                for note in facts.notes:
                    notes[note] = None
            if source is LEFT_OUT or not source.facts.shown:
                continue
            facts = source.facts
            if is_instance:
                if numbers[2] == _UNUSED_ID and numbers[0] != _UNUSED_ID:  # nearly always
                    first, second = numbers[0], numbers[1]
                    ids = str(first) if second == _UNUSED_ID else f"{first}-{second}"
                else:
                    ids = "-".join([str(number) for number in numbers if number != _UNUSED_ID])
                key = f"{facts.uid}/{facts.parent_uid}/{ids}{source.own}"
                place = Place(source, key, random, placed, orco, uv, numbers)
            else:
                place = Place(source, f"{facts.uid}{source.own}", facts.random, placed)
            of_kind.get(source.kind, meshes).append(place)
    cache.facts = kept
    return meshes, lights, volumes, tuple(notes)


def _listed(found) -> list:
    """What Blender says of all instances in numbers, of all at once: asked one by one that takes most of the walk."""
    count = len(found)

    def values(name: str, width: int, kind) -> np.ndarray:
        out = np.zeros(count * width, kind)
        found.foreach_get(name, out)
        return out.reshape(count, width) if width > 1 else out

    def tuples(rows: np.ndarray) -> list[tuple[float, ...]]:
        """A row each: faster than to make them of lists."""
        return rows.view([(f"f{k}", rows.dtype) for k in range(rows.shape[1])]).ravel().tolist()

    return [
        values("is_instance", 1, bool).tolist(), values("show_self", 1, bool).tolist(),
        values("matrix_world", 16, np.float32).reshape(-1, 4, 4).transpose(0, 2, 1),
        values("persistent_id", 8, np.int32).tolist(),
        (values("random_id", 1, np.int32).view(np.uint32) / 0xFFFFFFFF).tolist(),
        tuples(values("orco", 3, np.float32)), tuples(values("uv", 2, np.float32)),
    ]  # fmt: skip


def _collections_say(top) -> tuple[bool, bool]:
    """Whether any collection of the view layer is for indirect light alone, and whether any is a holdout."""
    indirect_only, holdout, waiting = False, False, [top]
    while waiting:
        one = waiting.pop()
        indirect_only |= one.indirect_only
        holdout |= one.holdout
        waiting += one.children
    return indirect_only, holdout


def _ancestors(owner) -> list:
    """An object's parent, its parent, and so on."""
    found = []
    while owner.parent is not None:
        owner = owner.parent
        found.append(owner)
    return found


def _is_holdout(top, view_layer) -> bool:
    """Whether `top` cuts a hole: an object, or what instances it, which alone decides of its instances.

    `view_layer`: None where no collection of it is a holdout.
    """
    return top.is_holdout if view_layer is None else top.holdout_get(view_layer=view_layer)


def _visibility(owner, parent, indirect_only: bool) -> Visibility:
    """Ray visibility of an object, and of what instances it: Cycles lets a ray see it only where both do."""
    flags = _flags(owner)
    if parent is not None:
        flags = tuple(map(and_, flags, _flags(parent)))
    return _visibility_of((flags[0] and not indirect_only, *flags[1:]))


def _says(owner, parent, name: str) -> bool:
    """A switch of Cycles' of an object and of what instances it: on where it is on of both."""
    return all(getattr(getattr(one, "cycles", None), name, True) for one in (owner, parent) if one is not None)


def _flags(one) -> tuple[bool, ...]:
    return (
        one.visible_camera,
        one.visible_diffuse,
        one.visible_glossy,
        one.visible_transmission,
        one.visible_volume_scatter,
        one.visible_shadow,
    )


@lru_cache
def _visibility_of(flags: tuple[bool, ...]) -> Visibility:
    return Visibility(*flags)


def domain_of(owner):
    """Settings of the gas domain of a fluid simulation that an object is; None of others."""
    for modifier in owner.modifiers:
        settings = modifier.domain_settings if modifier.type == "FLUID" and modifier.fluid_type == "DOMAIN" else None
        if settings is not None and settings.domain_type == "GAS":
            return settings
    return None


def _materials(found) -> tuple:
    """Materials of an evaluated object's slots, None where one is empty. An empty slot that is linked to the object is
    empty, as Cycles has it: of the evaluated object Blender's Python says the mesh's material there."""
    slots = found.material_slots
    if all(slot.link == "DATA" for slot in slots):
        return tuple([slot.material for slot in slots])
    empty = {
        k for k, slot in enumerate(found.original.material_slots) if slot.link == "OBJECT" and slot.material is None
    }
    return tuple([None if k in empty else slot.material for k, slot in enumerate(slots)])


def _is_linked(owner) -> bool:
    linking = getattr(owner, "light_linking", None)
    return linking is not None and bool(linking.receiver_collection or linking.blocker_collection)


def _object_notes(owner, name: str) -> tuple[Note, ...]:
    """What of the object is not drawn as Cycles draws it."""
    said = []
    if _is_linked(owner):
        said.append(
            "light linking counts for light that reaches surfaces straight or from virtual lights, for what mirrors "
            "and glass show, and for whether a lamp shines into volumes and throws caustics; other bounced light does "
            "not follow it, and volumes, mirrors and caustics do not follow shadow linking."
        )
    return tuple(Note(f"Object '{name}'", text) for text in said)


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


def matrices(places: list[Place]) -> np.ndarray:
    """(N, 4, 4) float64 of the places' matrices."""
    if not places:
        return np.zeros((0, 4, 4))
    return np.stack([place.matrix for place in places]).astype(np.float64)
