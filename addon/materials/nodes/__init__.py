"""The node table: which Blender nodes are drawn, and how. One module per family, one entry per node and variant."""

from __future__ import annotations

from . import color, converter, image, inputs, shader, stand_in, texture, vector
from .entry import Entry

REGISTRY: tuple[Entry, ...] = (
    shader.ENTRIES
    + image.ENTRIES
    + texture.ENTRIES
    + inputs.ENTRIES
    + vector.ENTRIES
    + converter.ENTRIES
    + color.ENTRIES
    + stand_in.ENTRIES
)

_BY_TYPE: dict[str, tuple[Entry, ...]] = {}
for _entry in REGISTRY:
    _BY_TYPE[_entry.type] = (*_BY_TYPE.get(_entry.type, ()), _entry)


def known(node_type: str) -> bool:
    """Is any variant of this node type in the table?"""
    return node_type in _BY_TYPE


def find(node_type: str, properties: dict[str, object]) -> Entry | None:
    """The entry that draws a node of this type with these properties, or None."""
    for entry in _BY_TYPE.get(node_type, ()):
        if entry.matches(properties):
            return entry
    return None
