"""Light linking and shadow linking: which objects a lamp or a shining mesh lights, and which ones block its light.

Blender has two collections at an object that gives light, of receivers and of blockers, whose objects and children are
each marked to be included or left out. As in Cycles, a collection that includes anything stands for that alone, and one
that only leaves out for all the rest; instances follow their instancer where it stands in any such collection.

Objects that all lights treat alike form a group, so that a light's links are a few numbers. Of more than MOST_GROUPS
groups of receivers those beyond are lit by everything, with a note.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from .scene import NO_LINKS, Light, Links, Note

MOST_GROUPS = 12  # of receivers: a bit each beside a light's flags, see sources/lights.py


@dataclass(frozen=True)
class _Named:
    """Objects of a collection, by session_uid."""

    included: frozenset[int]
    left_out: frozenset[int]

    def holds(self, uid: int) -> bool:
        return uid in self.included if self.included else uid not in self.left_out


@dataclass
class LinkTable:
    """Links of all objects of a scene."""

    receivers: dict[int, int] = field(default_factory=dict)  # group by session_uid of those in some collection
    blockers: dict[int, int] = field(default_factory=dict)
    others: tuple[int, int] = (0, 0)  # groups of all others
    unlit: dict[int, tuple[int, ...]] = field(default_factory=dict)  # by session_uid of what gives light
    passing: dict[int, frozenset[int]] = field(default_factory=dict)
    notes: tuple[Note, ...] = ()

    def of(self, uid: int, parent_uid: int) -> Links:
        """Of an object, or an instance of it by a parent (0: none)."""
        if not (self.unlit or self.passing):
            return NO_LINKS
        groups = []
        for known, other in zip((self.receivers, self.blockers), self.others):
            groups.append(known.get(parent_uid, known.get(uid, other)))
        giver = parent_uid if parent_uid in self.unlit or parent_uid in self.passing else uid
        return Links(*groups, self.unlit.get(giver, ()), self.passing.get(giver, frozenset()))


def read_links(owners: Iterable) -> LinkTable:
    """The links of `owners`, evaluated objects of lamps and meshes and their instancers."""
    receivers, blockers = {}, {}
    for owner in owners:
        linking = getattr(owner.original, "light_linking", None)
        if linking is None:
            continue
        uid = owner.original.session_uid
        if linking.receiver_collection is not None:
            receivers[uid] = _named(linking.receiver_collection)
        if linking.blocker_collection is not None:
            blockers[uid] = _named(linking.blocker_collection)
    table = LinkTable()
    if not receivers and not blockers:
        return table
    table.receivers, other_receivers, sets = _groups(receivers)
    table.unlit = {uid: tuple(k for k, lit in enumerate(found) if not lit) for uid, found in sets.items()}
    if max([other_receivers, *table.receivers.values()]) >= MOST_GROUPS:
        text = f"light linking makes more than {MOST_GROUPS} kinds of receivers; the last ones are lit by all lights."
        table.notes = (Note("Light linking", text),)
        table.unlit = {uid: tuple(k for k in found if k < MOST_GROUPS) for uid, found in table.unlit.items()}
    table.blockers, other_blockers, sets = _groups(blockers)
    table.passing = {uid: frozenset(k for k, held in enumerate(found) if not held) for uid, found in sets.items()}
    table.others = other_receivers, other_blockers
    return table


def without_volumes(lights: tuple[Light, ...], volumes: set[int]) -> tuple[tuple[Light, ...], list[Note]]:
    """The same lamps, of which those shine into no volume that light none of the groups of receivers `volumes`; and a
    note of each that lights some of them alone: it shines into all."""
    found, notes = [], []
    for light in lights:
        dark = volumes.intersection(light.links.unlit)
        if dark and dark != volumes:
            text = "by light linking it lights some volumes and others not; it lights all of them."
            notes.append(Note(f"Object '{light.name}'", text))
        elif dark:
            light = replace(light, visibility=replace(light.visibility, volume=False))
        found.append(light)
    return tuple(found), notes


def _groups(collections: dict[int, _Named]) -> tuple[dict[int, int], int, dict[int, list[bool]]]:
    """(group of each named object, group of all others, which groups each collection holds)."""
    different = list(dict.fromkeys(collections.values()))
    named = set().union(*(one.included | one.left_out for one in different)) if different else set()
    signature = {uid: tuple(one.holds(uid) for one in different) for uid in named}
    rest = tuple(not one.included for one in different)  # of an object that no collection names
    number = {found: k for k, found in enumerate(dict.fromkeys([rest, *sorted(set(signature.values()))]))}
    held = {uid: [found[different.index(one)] for found in number] for uid, one in collections.items()}
    return {uid: number[found] for uid, found in signature.items()}, number[rest], held


def _named(collection) -> _Named:
    """What a collection's items say; objects of its children follow the mark of the child."""
    found = {"INCLUDE": set(), "EXCLUDE": set()}
    for child, item in zip(collection.children, collection.collection_children):
        found[item.light_linking.link_state].update(one.session_uid for one in child.all_objects)
    for one, item in zip(collection.objects, collection.collection_objects):
        found[item.light_linking.link_state].add(one.session_uid)
    return _Named(frozenset(found["INCLUDE"]), frozenset(found["EXCLUDE"]))
