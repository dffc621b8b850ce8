"""The ledger: what ran, what was reused, what was skipped and why, and how long it took. Data, never text to parse."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..snapshot.scene import Note, one_line

RAN, REUSED, SKIPPED = "ran", "reused", "skipped"


@dataclass
class Row:
    """One technique in one frame."""

    name: str
    label: str
    state: str  # ran, reused, skipped
    reason: str = ""
    milliseconds: float = 0.0
    slot: str = ""
    counters: dict[str, int] = field(default_factory=dict)  # passes, triangles, views, … per frame
    choices: tuple[str, ...] = ()  # between methods, by what they cost on this device


@dataclass
class Ledger:
    """All rows of a frame in order, the times of its stages in seconds, and the notes for the artist."""

    rows: list[Row] = field(default_factory=list)
    times: dict[str, float] = field(default_factory=dict)  # sync, compile, passes, readback, total
    notes: tuple[Note, ...] = ()  # what is drawn otherwise than it is set up, each with its culprit
    samples: int = 0
    bad_pixels: int = 0  # non-finite values that the sanitizer replaced

    def row(self, name: str) -> Row:
        """The row of a technique; KeyError if it was neither planned nor skipped."""
        for row in self.rows:
            if row.name == name:
                return row
        raise KeyError(f"The ledger has no row '{name}'.")

    @property
    def ran(self) -> tuple[str, ...]:
        """Names of the techniques that ran."""
        return tuple(row.name for row in self.rows if row.state == RAN)

    def text(self) -> str:
        """As a table for the terminal."""
        width = max((len(row.label) for row in self.rows), default=0)
        lines = []
        for row in self.rows:
            time = f"{row.milliseconds:9.1f} ms" if row.state == RAN else " " * 12
            counters = ", ".join(f"{value} {key}" for key, value in row.counters.items())
            lines.append(f"  {row.label:<{width}}  {row.state:<7} {time}  {one_line(row.reason or counters)}".rstrip())
            lines += [f"  {'':<{width}}    {one_line(choice)}" for choice in some_of(row.choices)]
        if self.times:
            lines.append("  " + ", ".join(f"{name} {seconds * 1000:.0f} ms" for name, seconds in self.times.items()))
        if self.bad_pixels:
            lines.append(f"  {self.bad_pixels} values were not finite and were set to 0: please report this scene.")
        return "\n".join(lines)


MOST_CHOICES = 4  # of a row that are told one by one


def some_of(choices: tuple[str, ...]) -> list[str]:
    """The first choices, and how many more there are."""
    more = len(choices) - MOST_CHOICES
    return [*choices[:MOST_CHOICES], *([f"{more} more"] if more > 0 else [])]


_latest: Ledger | None = None


def publish(ledger: Ledger) -> None:
    """Make a finished frame's ledger the one that the interface, the CLI and tests see."""
    global _latest
    _latest = ledger


def forget() -> None:
    """Another file is open: what was drawn says nothing about it."""
    global _latest
    _latest = None


def latest() -> Ledger | None:
    """The ledger of the last finished or cancelled frame in this process."""
    return _latest
