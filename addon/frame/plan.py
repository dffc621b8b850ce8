"""From settings and what the scene holds to an ordered list of techniques, and the reasons for the rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from ..snapshot.scene import Snapshot, one_line
from .ledger import SKIPPED, Row
from .light_paths import TRANSPORTS
from .settings import AUTO, OFF, Settings
from .technique import Technique


class PlanError(ValueError):
    """Techniques that do not fit together; a sentence says which and why."""


@dataclass(frozen=True)
class Plan:
    """Techniques in running order, and a ledger row for each one that is left out."""

    techniques: tuple[Technique, ...]
    skipped: tuple[Row, ...]
    filled: dict[str, str] = field(default_factory=dict)  # name of the technique that fills a slot

    def fills(self, slot: str) -> bool:
        """Whether a technique that runs stands in the slot."""
        return slot in self.filled

    def runs(self, name: str) -> bool:
        """Whether the technique of this name is part of the plan."""
        return any(technique.name == name for technique in self.techniques)

    def owner(self, transport: str) -> Technique | None:
        """The technique that owns a kind of transport (light_paths.TRANSPORTS), if one does."""
        return next((technique for technique in self.techniques if transport in technique.owns), None)

    def owns(self, transport: str) -> bool:
        """Whether a technique that runs takes over this kind of transport."""
        return self.owner(transport) is not None

    def shown_with(self, snapshot: Snapshot, settings: Settings) -> tuple:
        """What decides how the samples so far are shown: where it differs, `show` shows them otherwise."""
        showing = [technique for technique in self.techniques if technique.only_shows]
        return tuple((t.name, settings.of(t), snapshot.moment) for t in showing)

    def last_writer(self, image: str) -> Technique | None:
        """The technique that writes an image after all others."""
        writers = [t for t in self.techniques if any(write.name == image for write in t.writes)]
        return writers[-1] if writers else None

    def slots_of(self, technique: Technique) -> list[str]:
        """The slots that a technique of the plan fills."""
        return [slot for slot, name in self.filled.items() if name == technique.name]

    def text(self) -> str:
        """As a list for the terminal."""
        slots = {t: f" (slot {', '.join(self.slots_of(t))})" if t.fills else "" for t in self.techniques}
        lines = [f"  {t.label:<28} runs{slots[t]}" for t in self.techniques]
        lines += [f"  {row.label:<28} skipped: {one_line(row.reason)}" for row in self.skipped]
        return "\n".join(lines)


def make_plan(registry: Sequence[Technique], snapshot: Snapshot, settings: Settings) -> Plan:
    """Choose by slot or by pass tree, skip what is not needed, order by what is read and written. Raises PlanError."""
    chosen, skipped = [], []
    filled: dict[str, str] = {}
    tree = settings.passes
    if tree is not None:  # its techniques come first, in its order; the first one listed wins its slot
        place = {name: number for number, name in enumerate(tree)}
        registry = sorted(registry, key=lambda technique: place.get(technique.name, len(place)))
    reasons = {technique: technique.skip(snapshot, settings) for technique in registry}
    wishes = {} if tree is not None else _wishes(reasons, snapshot, settings)
    labels = {technique.name: technique.label for technique in registry}
    for technique, reason in reasons.items():
        if tree is not None and technique.name not in tree:
            reason = "it is not in the pass tree"
        taken = [] if reason else [slot for slot in technique.fills if _is_free(slot, technique, wishes, filled)]
        if not reason and technique.fills and not taken:
            reason = _taken_by(technique.fills[0], wishes, filled, settings, labels)
        if reason:
            skipped.append(Row(technique.name, technique.label, SKIPPED, reason, slot=", ".join(technique.fills)))
            continue
        filled |= dict.fromkeys(taken, technique.name)
        chosen.append(technique)
    _check_owners(chosen)
    return Plan(_ordered(chosen, skipped), tuple(skipped), filled)


def _is_free(slot: str, technique: Technique, wishes: dict[str, str], filled: dict[str, str]) -> bool:
    """Whether a technique may take a slot: nobody has it yet, and nobody else is wished for."""
    return slot not in filled and wishes.get(slot, AUTO) in (AUTO, technique.name)


def _taken_by(slot: str, wishes: dict[str, str], filled: dict[str, str], settings: Settings, labels) -> str:
    """Why a slot is not to be had, as a sentence."""
    wish = wishes.get(slot, AUTO)
    if wish == OFF:
        return f"the {slot} slot is off"
    if wish != AUTO:
        asked = settings.slots.get(slot, AUTO) != AUTO
        return f"the {slot} slot is {'set to' if asked else 'filled by'} {labels.get(wish, wish)}"
    return f"the {slot} slot is filled by {labels[filled[slot]]}"


def _check_owners(techniques: list[Technique]) -> None:
    """PlanError where two techniques own the same light, or one owns what is no kind of transport."""
    owners: dict[str, Technique] = {}
    for technique in techniques:
        for transport in technique.owns:
            if transport not in TRANSPORTS:
                raise PlanError(f"{technique.label} owns '{transport}', which is not in light_paths.TRANSPORTS.")
            if transport in owners:
                both = f"{owners[transport].label} and {technique.label}"
                raise PlanError(f"{both} both bring {TRANSPORTS[transport]}: turn one of them off.")
            owners[transport] = technique


def _wishes(reasons: dict[Technique, str | None], snapshot: Snapshot, settings: Settings) -> dict[str, str]:
    """Technique by slot: the one that is set, or, where that is Auto, the first that claims the scene, else the first
    of the registry."""
    able: dict[str, list[Technique]] = {}
    for technique, reason in reasons.items():
        if technique.fills and not reason:  # Auto takes it for its first slot; for others it is chosen by hand
            able.setdefault(technique.fills[0], []).append(technique)
    found = {}
    for slot, techniques in able.items():
        claimed = (technique for technique in techniques if technique.claims(snapshot, settings))
        found[slot] = next(claimed, techniques[0]).name
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
            asked = (*technique.reads, *technique.finishes)
            needed = {w for name in asked for w in writers[name] if w is not technique and name not in w.finishes}
            needed |= {other for other in techniques if set(other.provides) & set(technique.requests)} - {technique}
            if needed.issubset(done):
                done.append(technique)
                left.remove(technique)
                break
        else:
            raise PlanError(f"These techniques wait for each other: {', '.join(t.label for t in left)}.")
    return tuple(done)
