"""Which object or material a note is about, so that the interface can select it."""

from __future__ import annotations

import re

from ..snapshot.scene import Note

_SUBJECT = re.compile(r"(Object|Material|Light|Camera|World) '(.*)'", re.DOTALL)


# What the artist misses in the picture comes before what differs a little.
_MISSING = re.compile(r"not (be )?(drawn|followed|supported|read)|magenta|pink|missing|is left out|not finite")


def by_weight(notes: tuple[Note, ...]) -> list[Note]:
    """Notes on what is missing from the picture first, else in their order."""
    return sorted(notes, key=lambda note: _MISSING.search(note.text) is None)


def losses(notes: tuple[Note, ...]) -> list[Note]:
    """Notes on what is missing from the picture."""
    return [note for note in notes if _MISSING.search(note.text) is not None]


def target(note: Note) -> tuple[str, str]:
    """Kind ('OBJECT', 'MATERIAL', 'WORLD') and name of what the note is about; ('', '') for the scene as a whole."""
    if note.material:
        return "MATERIAL", note.material
    found = _SUBJECT.fullmatch(note.subject)
    if not found:
        return ("WORLD", "") if note.subject == "World" else ("", "")
    kind, name = found.groups()
    return ("OBJECT" if kind in ("Light", "Camera") else kind.upper()), name
