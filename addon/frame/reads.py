"""Keys from reads: what is made of frozen records stands while all that its making has read of them is the same.

A key that is written by hand forgets what somebody reads later. `Reads` hands the records on so that it sees which of
their fields are asked for, and compares those alone; `content` is a key of all fields of a record but those that are
left out by name, so that a field that is new counts.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any, Generic, TypeVar

import numpy as np

Made = TypeVar("Made")


@cache
def _names(kind: type, without: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(one.name for one in fields(kind) if one.name not in without)


def content(record: object, without: tuple[str, ...] = ()) -> Hashable:
    """Equal for two records of a class with equal fields, but for those `without`; arrays by their bytes."""
    values = [getattr(record, name) for name in _names(type(record), without)]
    return tuple(value.tobytes() if isinstance(value, np.ndarray) else value for value in values)


def same(one: object, other: object) -> bool:
    """Whether two values of frozen records are equal, arrays in all of their numbers."""
    if one is other:
        return True
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray):
        return one.shape == other.shape and one.tobytes() == other.tobytes()
    if isinstance(one, (tuple, list)):
        return len(one) == len(other) and all(map(same, one, other))
    if is_dataclass(one):
        return all(same(getattr(one, name), getattr(other, name)) for name in _names(type(one), ()))
    return bool(one == other)


class _Watched:
    """A record that notes which of its fields are read."""

    def __init__(self, record: object):
        self.noted: dict[str, object] = {}
        self._record = record

    def __getattr__(self, name: str) -> object:
        value = self.noted[name] = getattr(self._record, name)
        return value


class Reads(Generic[Made]):
    """What `make` makes of a sequence of records; it must keep none of them, and read nothing else that changes."""

    def __init__(self, make: Callable[[Sequence[Any]], Made]):
        self._make = make
        self._made: tuple[Made, list[dict[str, object]]] | None = None

    def of(self, records: Sequence[object]) -> Made:
        """That of these records, made anew only where something that was read of one differs."""
        if self._made is None or not self._stands(records):
            watched = [_Watched(one) for one in records]
            made = self._make(watched)
            self._made = made, [one.noted for one in watched]
        return self._made[0]

    def _stands(self, records: Sequence[object]) -> bool:
        before = self._made[1]
        return len(before) == len(records) and all(
            same(value, getattr(one, name)) for one, noted in zip(records, before) for name, value in noted.items()
        )

    def forget(self) -> None:
        """Make it anew when it is asked for next."""
        self._made = None
