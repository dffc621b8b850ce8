"""What the last frame could not draw as the artist meant it, kept as data so that the interface can select the culprit.

The ledger holds the same notes as sentences; here each still names its data-blocks.
"""

from __future__ import annotations

import re

from ..snapshot.scene import Note

_latest: tuple[Note, ...] = ()
_SUBJECT = re.compile(r"(Object|Material|Light|Camera|World) '(.*)'", re.DOTALL)


def publish(notes: tuple[Note, ...]) -> None:
    """Make these the notes that the panels show; of several alike the first is kept."""
    global _latest
    _latest = tuple(dict.fromkeys(notes))


def latest() -> tuple[Note, ...]:
    """The notes of the last frame that was begun in this process."""
    return _latest


def target(note: Note) -> tuple[str, str]:
    """Kind ('OBJECT', 'MATERIAL', 'WORLD') and name of what the note is about; ('', '') for the scene as a whole."""
    if note.material:
        return "MATERIAL", note.material
    found = _SUBJECT.fullmatch(note.subject)
    if not found:
        return ("WORLD", "") if note.subject == "World" else ("", "")
    kind, name = found.groups()
    return ("OBJECT" if kind in ("Light", "Camera") else kind.upper()), name
