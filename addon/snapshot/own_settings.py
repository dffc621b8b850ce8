"""Candela's own settings of a data-block (lamp, material, object): the parameters that techniques declare for it.

The property groups `BLOCK.candela` are generated from those declarations (ui/properties.py), so what is read here is
whatever has been set, by the property's identifier; what was never touched has the declared default and is left out.
"""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Callable, Iterator
from pathlib import Path
from weakref import WeakKeyDictionary

import bpy

Own = tuple[tuple[str, object], ...]  # (identifier, value), in the properties' order; hashable


def own_settings(block) -> Own:
    """What has been set on an evaluated data-block; values are bool, int, float, str, tuples of numbers, names of
    data-blocks, and for lists a tuple of such tuples, one for each entry."""
    group = getattr(block, "candela", None)
    return () if group is None else _values(group, False, getattr(block, "library", None))


def all_settings(block) -> Own:
    """All settings of a data-block, whether set or not; of a file what it holds, wherever it lies."""
    return _values(block.candela, True, block.library, _content)


def _content(path: str) -> str:
    with contextlib.suppress(OSError, ValueError):  # the ledger says what is missing
        if Path(path).is_file():  # to open a pipe would wait
            with Path(path).open("rb") as file:
                return hashlib.file_digest(file, "blake2b").hexdigest()
    return ""


def own_images(block) -> Iterator[tuple[str, bpy.types.Image]]:
    """What has been set on an evaluated data-block that is an image, by identifier."""
    group = getattr(block, "candela", None)
    for name, kind, *_ in () if group is None else _properties(type(group)):
        image = getattr(group, name) if kind == "POINTER" else None
        if isinstance(image, bpy.types.Image):
            yield name, image


def _values(group, every: bool, library=None, of_file: Callable[[str], str] = str) -> Own:
    found = []
    for name, kind, is_array, is_path in _properties(type(group)):
        if kind == "COLLECTION":
            entries = tuple(_values(entry, True, library, of_file) for entry in getattr(group, name))
            if entries:
                found.append((name, entries))
        elif every or group.is_property_set(name):
            value = getattr(group, name)
            if kind == "POINTER":
                value = value.name if value is not None else ""
            elif is_path:
                value = of_file(bpy.path.abspath(value, library=library)) if value else ""
            elif is_array:
                value = tuple(value)
            found.append((name, value))
    return tuple(found)


def _properties(group: type) -> list[tuple[str, str, bool, bool]]:
    """Of each property that says something: name, type, whether it is an array, whether a path. Kept by class, since
    each object of a scene has such a group; when the add-on is registered anew there is another class."""
    known = _known.get(group)
    if known is None:
        known = _known[group] = []
        for prop in group.bl_rna.properties:
            name = prop.identifier
            if name in ("rna_type", "name") or (prop.is_runtime and name.endswith("_active")):
                continue
            is_path = prop.type == "STRING" and prop.subtype == "FILE_PATH"
            known.append((name, prop.type, bool(getattr(prop, "is_array", False)), is_path))
    return known


_known: WeakKeyDictionary[type, list[tuple[str, str, bool, bool]]] = WeakKeyDictionary()
