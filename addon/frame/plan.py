"""From settings and what the scene holds to an ordered list of techniques, and the reasons for the rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..snapshot.scene import Snapshot
from . import costs
from .ledger import SKIPPED, Row
from .settings import AUTO, OFF, Settings
from .technique import Technique


class PlanError(ValueError):
    """Techniques that do not fit together; a sentence says which and why."""


@dataclass(frozen=True)
class Plan:
    """Techniques in running order, and a ledger row for each one that is left out."""

    techniques: tuple[Technique, ...]
    skipped: tuple[Row, ...]

    def fills(self, slot: str) -> bool:
        """Whether a technique that runs stands in the slot."""
        return any(technique.slot == slot for technique in self.techniques)

    def text(self) -> str:
        """As a list for the terminal."""
        lines = [f"  {t.label:<28} runs" + (f" (slot {t.slot})" if t.slot else "") for t in self.techniques]
        lines += [f"  {row.label:<28} skipped: {row.reason}" for row in self.skipped]
        return "\n".join(lines)


def make_plan(registry: Sequence[Technique], snapshot: Snapshot, settings: Settings) -> Plan:
    """Choose by slot or by pass tree, skip what is not needed, order by what is read and written. Raises PlanError."""
    chosen, skipped = [], []
    filled: dict[str, str] = {}
    tree = settings.passes
    if tree is not None:  # its techniques first, in its order; of those that fill a slot the first one does
        place = {name: number for number, name in enumerate(tree)}
        registry = sorted(registry, key=lambda technique: place.get(technique.name, len(place)))
    reasons = {technique: technique.skip(snapshot, settings) for technique in registry}
    wishes = {} if tree is not None else _wishes(reasons, snapshot, settings)
    labels = {technique.name: technique.label for technique in registry}
    for technique, reason in reasons.items():
        if tree is not None and technique.name not in tree:
            reason = "it is not in the pass tree"
        wish = wishes.get(technique.slot, AUTO)
        if not reason and wish == OFF:
            reason = f"the {technique.slot} slot is off"
        if not reason and wish not in (AUTO, technique.name):
            asked = settings.slots.get(technique.slot, AUTO) != AUTO
            reason = f"the {technique.slot} slot is {'set to' if asked else 'filled by'} {labels.get(wish, wish)}"
        if not reason and technique.slot in filled:
            reason = f"the {technique.slot} slot is filled by {labels[filled[technique.slot]]}"
        if reason:
            skipped.append(Row(technique.name, technique.label, SKIPPED, reason, slot=technique.slot))
            continue
        if technique.slot:
            filled[technique.slot] = technique.name
        chosen.append(technique)
    return Plan(_ordered(chosen, skipped), tuple(skipped))


def _wishes(reasons: dict[Technique, str | None], snapshot: Snapshot, settings: Settings) -> dict[str, str]:
    """Technique by slot: the one that is set, or, where that is Auto, the one that claims the scene or that the
    measurements favour.
    """
    able: dict[str, list[Technique]] = {}
    for technique, reason in reasons.items():
        if technique.slot and not reason:
            able.setdefault(technique.slot, []).append(technique)
    found = {}
    for slot, techniques in able.items():
        names = [technique.name for technique in techniques]
        claimed = [technique.name for technique in techniques if technique.claims(snapshot, settings)]
        found[slot] = claimed[0] if claimed else costs.preferred(costs.known(), slot, names, settings.samples)
    return found | {slot: wish for slot, wish in settings.slots.items() if wish != AUTO}


def _ordered(techniques: list[Technique], skipped: list[Row]) -> tuple[Technique, ...]:
    """Writers before readers; among free ones the registry's order. Images without any writer are an error."""
    writers: dict[str, list[Technique]] = {}
    for technique in techniques:
        for write in technique.writes:
            writers.setdefault(write.name, []).append(technique)
    left, done = list(techniques), []
    for technique in techniques:
        for name in technique.reads:
            if name not in writers:
                without = ", ".join(row.label for row in skipped) or "none"
                raise PlanError(f"{technique.label} reads {name}, which nothing writes (skipped: {without}).")
    while left:
        for technique in left:
            asked = (*technique.reads, *technique.closes)
            needed = {w for name in asked for w in writers[name] if w is not technique and name not in w.closes}
            needed |= {other for other in techniques if set(other.offered()) & set(technique.uses)}
            if needed.issubset(done):
                done.append(technique)
                left.remove(technique)
                break
        else:
            raise PlanError(f"These techniques wait for each other: {', '.join(t.label for t in left)}.")
    return tuple(done)
