"""Whom a note is about, so that the interface can select the culprit."""

from __future__ import annotations

import re

from ..snapshot.scene import Note

_SUBJECT = re.compile(r"(Object|Material|Light|Camera|World) '(.*)'", re.DOTALL)


def target(note: Note) -> tuple[str, str]:
    """Kind ('OBJECT', 'MATERIAL', 'WORLD') and name of what the note is about; ('', '') for the scene as a whole."""
    if note.material:
        return "MATERIAL", note.material
    found = _SUBJECT.fullmatch(note.subject)
    if not found:
        return ("WORLD", "") if note.subject == "World" else ("", "")
    kind, name = found.groups()
    return ("OBJECT" if kind in ("Light", "Camera") else kind.upper()), name
