"""Keys from reads: what is made stands while what was read is the same, and no field is forgotten."""

from dataclasses import dataclass, fields, replace

import numpy as np
import pytest

from addon.frame.reads import Reads, same
from addon.frame.run import IN_TREES, NO_LIGHT, lights_key
from addon.lighting.glass_interfaces import interface_table
from addon.snapshot.scene import Light, Links, Visibility
from tests.frame.test_plan import lamp, room


@dataclass(frozen=True)
class Inner:
    width: float
    table: np.ndarray


@dataclass(frozen=True)
class Record:
    size: float
    name: str
    inner: Inner
    map: np.ndarray | None = None


def record(**changes):
    return replace(Record(1.0, "one", Inner(2.0, np.zeros(3))), **changes)


def test_what_is_made_stands_while_what_was_read_is_the_same():
    made = Reads(lambda records: object.__new__(Made).of(sum(one.size * one.inner.width for one in records)))
    first = made.of([record(), record()])
    assert first.value == 4.0
    assert made.of([record(name="other"), record(map=np.ones(4))]) is first  # which nobody has read
    assert made.of([record(), record(inner=Inner(2.0, np.zeros(3)))]) is first
    assert made.of([record(), record(inner=Inner(3.0, np.zeros(3)))]).value == 5.0
    assert made.of([record(size=2.0)]).value == 4.0
    once = made.of([])
    made.forget()
    assert made.of([]) is not once


class Made:
    def of(self, value):
        self.value = value
        return self


@pytest.mark.parametrize("other", [1.0, np.ones(3), np.zeros(4), (0.0,), None, np.array([0.0, 0.0, 1e-9])])
def test_arrays_are_the_same_in_all_numbers(other):
    assert same(np.zeros(3), np.zeros(3)) and same((np.zeros(3), 1), (np.zeros(3), 1))
    assert not same(np.zeros(3), other)


OTHER = {
    bool: lambda value: not value, str: lambda value: value + "x", float: lambda value: value + 0.5,
    int: lambda value: value + 1, np.ndarray: lambda value: value + 0.5, Visibility: lambda value: Visibility(False),
    Links: lambda value: Links(unlit=frozenset({3})), tuple: lambda value: (*value, 7.0),
}  # fmt: skip


@pytest.mark.parametrize("field", [one.name for one in fields(Light)])
def test_every_field_of_a_lamp_counts_but_those_that_tell_nothing_of_its_light(field):
    value = getattr(lamp(graph="a tree"), field)
    given = {"graph": "another"} if field == "graph" else {"graph": "a tree", field: OTHER[type(value)](value)}
    changed = lamp(**given)
    alike = lights_key(room(lights=(lamp(graph="a tree"),))) == lights_key(room(lights=(changed,)))
    assert alike == (field in NO_LIGHT)
    if field in IN_TREES:
        bare = lights_key(room(lights=(replace(changed, graph=None),)))
        assert bare == lights_key(room(lights=(lamp(),)))


def test_the_table_of_interfaces_reads_glass_and_what_it_absorbs_alone():
    from addon.materials.compiler import compile_material, default_graph

    tables = []
    made = Reads(lambda compiled: tables.append(interface_table(compiled)) or tables[-1])
    plain = compile_material("plain", default_graph())
    made.of([plain])
    made.of([replace(plain, name="other", color=(0.1, 0.2, 0.3))])
    assert len(tables) == 1
