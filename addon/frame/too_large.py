"""What a scene's size costs its picture, in words: a technique that is skipped for it leaves something out."""

from __future__ import annotations

from ..scene import acceleration
from ..snapshot.scene import Note, Snapshot
from .plan import Plan

# By slot, or by name of a technique without one: what is missing where nobody brings it.
BRINGS = {
    "indirect": "bounced light",
    "reflection": "what gloss shows of lights and of the world",
    "shaded_reflections": "what mirrors and glass show of the scene",
    "transmission": "how glass bends light",
    "volume": "light in volumes",
    "caustics": "caustics",
    "volume_caustics": "caustics in volumes",
    "subsurface": "light below surfaces",
}


def notes_of(plan: Plan, snapshot: Snapshot) -> tuple[Note, ...]:
    """A note on what is left out since the scene has too many triangles for it; none for most scenes."""
    found, traces = [], acceleration.too_many(snapshot) is None
    for reason in (acceleration.too_many(snapshot), acceleration.too_many_copies(snapshot)):
        rows = [row for row in plan.skipped if reason is not None and row.reason == reason]
        open_slots = [row.slot or row.name for row in rows if row.slot not in plan.filled]
        missing = list(dict.fromkeys(BRINGS[name] for name in open_slots if name in BRINGS))
        if missing:
            text = f"{reason}: {_together(missing)} {'are' if len(missing) > 1 else 'is'} missing from the picture. "
            found.append(Note("Scene", text + "Give meshes fewer faces, or use copies of one mesh in place of many."))
        if not traces and any(row.name == "instant_radiosity" for row in rows) and "indirect" in plan.filled:
            text = f"{reason}: bounced light is missing where it comes from what the camera does not see."
            found.append(Note("Scene", text))
    return tuple(found)


def _together(words: list[str]) -> str:
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
