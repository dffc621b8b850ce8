"""Materials whose own surface lies by a UV map that no node reads: the map is one more attribute of their programs.

What a mesh hands to a program is settled by the material's nodes (materials/attributes.py), and grass has none: it is a
setting of the material. Where that asks for the active UV map, the compiled material gets it as its last attribute;
techniques find it there by `map_of`. A mesh without a map has zeros, of which no place can be told.

Cost: 16 bytes a corner, one varying. Fails where nodes have taken all attributes: the object's axes place it then.
"""

from __future__ import annotations

from dataclasses import replace

from ..materials.compiled import Attribute, CompiledMaterial
from ..materials.expressions import MAX_ATTRIBUTES

OWNER, PLACEMENT, UV = "grass", "placement", "UV"
ACTIVE = Attribute("UV", "")


def asks(own: tuple[tuple[str, object], ...]) -> bool:
    """Whether a material's own settings ask for its mesh's UV map."""
    return dict(own).get(f"{OWNER}_{PLACEMENT}") == UV


def with_map(compiled: CompiledMaterial) -> CompiledMaterial:
    """The material with the active UV map among its attributes."""
    if ACTIVE in compiled.attributes:
        return compiled
    if len(compiled.attributes) >= MAX_ATTRIBUTES:
        text = f"The material reads {MAX_ATTRIBUTES} attributes, so that none is left for the UV map of its grass."
        return replace(compiled, fallbacks=(*compiled.fallbacks, ("", text)))
    return replace(compiled, attributes=(*compiled.attributes, ACTIVE), program_key=f"u{compiled.program_key}")


def map_of(compiled: CompiledMaterial) -> int:
    """The number of that attribute; -1 where there is none."""
    return compiled.attributes.index(ACTIVE) if ACTIVE in compiled.attributes else -1
