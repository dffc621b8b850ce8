"""What a technique is: data about itself, and the passes it runs for one sample."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..snapshot.scene import Snapshot
    from .run import Frame
    from .settings import Settings


NEEDED = {bool: "on or off", int: "a whole number", float: "a number", str: "a word"}  # for messages, by type


@dataclass(frozen=True)
class Param:
    """One parameter, declared once. Blender property, command-line override, benchmark axis and manual derive from it.

    `default` fixes the type: bool, int, float, or str for a choice among `items` (identifier, label, number).
    """

    name: str
    label: str
    default: bool | int | float | str
    description: str
    minimum: float | None = None
    maximum: float | None = None
    unit: str = ""  # Blender property unit: PIXEL, FACTOR, …
    items: tuple[tuple[str, str, int], ...] = ()
    subtype: str = field(default="NONE")
    draft: bool | int | float | None = None  # its most in a draft: a picture of a moment, as of a view that moves

    def check(self, value):
        """`value` in this parameter's type and range, or ValueError with a sentence."""
        kind = type(self.default)
        try:
            value = _as_bool(value) if kind is bool else kind(value)
        except (TypeError, ValueError):
            raise ValueError(f"'{self.name}' needs {NEEDED[kind]}, not '{value}'.") from None
        if self.items and value not in [item[0] for item in self.items]:
            raise ValueError(f"'{self.name}' must be one of {', '.join(i[0] for i in self.items)}, not '{value}'.")
        if kind in (int, float):
            if value != value or (self.minimum is not None and value < self.minimum):
                raise ValueError(f"'{self.name}' must be at least {self.minimum}, not {value}.")
            if self.maximum is not None and value > self.maximum:
                raise ValueError(f"'{self.name}' must be at most {self.maximum}, not {value}.")
        return value


def _as_bool(value) -> bool:
    if isinstance(value, str):
        words = {
            "1": True,
            "true": True,
            "on": True,
            "yes": True,
            "0": False,
            "false": False,
            "off": False,
            "no": False,
        }
        return words[value.lower()] if value.lower() in words else _refuse(value)
    return bool(value)


def _refuse(value):
    raise ValueError(value)


@dataclass(frozen=True)
class Write:
    """An image that a technique writes: its format, what it holds, and whether what is drawn there adds up: of all
    samples, or of all techniques in one sample where a technique closes it."""

    name: str
    format: str
    description: str
    accumulates: bool = False


class Technique:
    """Base of all techniques. Instances live as long as a Renderer and may keep GPU resources of their own.

    `reads` and `writes` are checked by the plan; `slot` names the exclusive place a technique fills, if any.
    """

    name = ""
    label = ""
    slot = ""
    params: tuple[Param, ...] = ()
    reads: tuple[str, ...] = ()
    writes: tuple[Write, ...] = ()
    closes: tuple[str, ...] = ()  # of what it writes, sums that are taken up by it after all others have added to them
    offers: tuple[str, ...] = ()  # what others may ask for in frame.services or frame.rates, apart from its slot
    uses: tuple[str, ...] = ()  # what it asks for there, if a technique of the plan offers it

    @classmethod
    def offered(cls) -> tuple[str, ...]:
        """All that it offers to others: a technique without images that fills a slot offers that."""
        return (cls.slot, *cls.offers) if cls.slot and not cls.writes else cls.offers

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        """Why this scene does not need the technique, as a sentence; None if it does. Cheap, no GPU."""
        return None

    def claims(self, snapshot: Snapshot, settings: Settings) -> bool:
        """Whether Auto takes it for its slot in this scene, whatever the benchmark's means over scenes say."""
        return False

    def key(self, snapshot: Snapshot, settings: Settings) -> Hashable:
        """Equal keys in two frames mean that what `prepare` made still stands."""
        return None

    def prepare(self, frame: Frame) -> None:
        """Work that does not depend on the sample. Runs when the key has changed."""

    def run(self, frame: Frame) -> Iterator[None] | None:
        """The passes of sample `frame.sample`.

        Where that takes long, as a generator: at each `yield` a viewport may pause to answer its user.
        """
        raise NotImplementedError

    def end(self, frame: Frame) -> Iterator[None] | None:
        """What follows the last sample of a picture, once; a generator where that takes long."""

    def release(self) -> None:
        """Drop GPU resources."""
