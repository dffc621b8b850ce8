"""The benchmark's cells, their keys, what a budget leaves out, and the file that keeps what was measured."""

from dataclasses import replace

import pytest

from bench import cells, run
from bench.cells import PEERS, Cell, Scene, Series, Store, in_turns

OWN = Series("Candela", "CANDELA", (1, 4), main=True)
EEVEE, CYCLES = PEERS[1], PEERS[2]
ROOM, HALL = Scene("cornell_box"), Scene("colonnade_hall")


def cell(series=OWN, samples=1, scene=ROOM, size=(64, 48)):
    return Cell(scene, series, samples, size, 16)


def test_engines_take_turns_and_scenes_do_not():
    order = in_turns([cell(s, n, scene) for scene in (ROOM, HALL) for s in (OWN, CYCLES) for n in (1, 4)])
    assert [c.scene for c in order] == [ROOM] * 4 + [HALL] * 4
    assert [(c.series.label, c.samples) for c in order[:4]] == [
        ("Candela", 1), ("Cycles", 1), ("Candela", 4), ("Cycles", 4)
    ]  # fmt: skip


def test_key_changes_with_whatever_the_figures_depend_on(monkeypatch):
    monkeypatch.setattr(cells, "sources", lambda: "before")
    first = cell()
    others = [
        cell(samples=4),
        cell(scene=HALL),
        cell(size=(64, 64)),
        cell(replace(OWN, bounces=0)),
        replace(first, reference_samples=32),
    ]
    keys = {one.key("machine") for one in [first, *others]} | {first.key("another machine")}
    assert len(keys) == 7
    peer = cell(CYCLES).key("machine")
    monkeypatch.setattr(cells, "sources", lambda: "after")
    assert cell().key("machine") not in keys
    assert cell(CYCLES).key("machine") == peer


def test_key_does_not_depend_on_what_else_is_measured():
    assert cell(replace(OWN, samples=(1, 2, 64), main=False)).key("m") == cell(OWN).key("m")


def test_store_keeps_each_cell_at_once_and_survives_half_a_line(tmp_path):
    path = tmp_path / "cells.jsonl"
    Store(path).add("a", {"wall": 1.0})
    with path.open("a") as file:
        file.write('{"key": "b", "wa')
    assert Store(path).found == {"a": {"key": "a", "wall": 1.0}}


def test_rows_of_a_results_file_fill_what_the_store_lacks(tmp_path):
    store = Store(tmp_path / "cells.jsonl")
    store.add("a", {"wall": 1.0})
    store.remember([{"key": "a", "wall": 9.0}, {"key": "b", "wall": 2.0}])
    assert store.found == {"a": {"key": "a", "wall": 1.0}, "b": {"key": "b", "wall": 2.0}}
    assert Store(store.path).found.keys() == {"a"}


def test_dearest_cells_of_the_lowest_rank_are_left_out():
    own, ray_traced, main, extra = cell(OWN, 1), cell(EEVEE, 16), cell(CYCLES, 256), cell(CYCLES, 128)
    assert [one.rank for one in (own, ray_traced, main, extra)] == [cells.NEEDED, cells.NEEDED, cells.MAIN, cells.EXTRA]
    costs = {own: 1.0, ray_traced: 20.0, main: 8.0, extra: 2.0}
    wanted = list(costs)
    assert run.that_fit(wanted, costs.get, 31.0) == wanted
    assert run.that_fit(wanted, costs.get, 30.0) == [own, ray_traced, main]
    assert run.that_fit(wanted, costs.get, 28.0) == [own, ray_traced]
    assert run.that_fit(wanted, costs.get, 5.0) == [own]
    assert run.that_fit(wanted, costs.get, 0.0) == []


def test_time_is_predicted_from_what_is_most_alike():
    known = run.Known()
    for one, seconds in ((cell(OWN, 4), 2.0), (cell(OWN, 16), 6.0), (cell(CYCLES, 4), 1.0)):
        known.add(one, seconds)

    def guess(series, samples):
        return run.guess(series, samples, (64, 48))

    assert known.predicted(cell(OWN, 4)) == pytest.approx(2.0)
    assert known.predicted(cell(OWN, 32)) == pytest.approx(6.0 * guess(OWN, 32) / guess(OWN, 16))
    between = (2.0 + guess(OWN, 4)) / 2  # another scene counts as much as the guess
    assert known.predicted(cell(OWN, 4, HALL)) == pytest.approx(between)
    other = replace(CYCLES, denoised=True)
    assert known.predicted(cell(other, 4)) == pytest.approx(1.0)
    assert known.predicted(cell(EEVEE, 16)) == guess(EEVEE, 16)


def test_choice_of_techniques_comes_from_the_registry():
    class One:
        fills, name, label = ("shadow",), "one", "One"

    class Two(One):
        name, label = "two", "Two"

    class Alone(One):
        fills, name, label = ("indirect",), "alone", "Alone"

    series = cells.own_series([One, Two, Alone])
    assert [(one.label, one.slots) for one in series] == [
        ("Candela", ()), ("Candela, Fast preset", ()), ("Candela, Draft preset", ()), ("Candela, no bounces", ()),
        (cells.FIRST, (("shadow", "one"),)),
        ("Candela, two", (("shadow", "two"),)),
    ]  # fmt: skip


def test_the_fast_series_sets_what_the_preset_sets_and_sweeps_its_samples():
    values = dict(cells.FAST.values)
    assert values["instant_radiosity_virtual_lights"] < 256 and values["accumulated_maps_texels_per_pixel"] == 1.0
    assert not any(name.endswith("samples") for name in values)


def test_a_run_of_some_cells_leaves_the_others_as_they_are():
    def row(scene, samples, seconds):
        return {"scene": scene, "series": {"label": "Candela"}, "samples": samples, "times": [seconds]}

    before = [row("a", 1, 1.0), row("a", 4, 2.0), row("b", 1, 3.0)]
    after = run.beside([row("c", 1, 7.0), row("a", 4, 9.0)], before)
    assert after == [row("a", 1, 1.0), row("a", 4, 9.0), row("b", 1, 3.0), row("c", 1, 7.0)]


def test_results_hold_five_digits_and_one_cell_per_line():
    text = run.one_row_per_line({"about": {"load": 1.23456789}, "cells": [{"a": [0.000123456789]}, {"a": None}]})
    assert '{"a": [0.00012346]},\n{"a": null}' in text
    assert "1.2346" in text


class FakeWorker:
    """Answers at once; a cell takes as many seconds of the fake clock as `costs` says."""

    clock, costs, opened = 0.0, {}, []

    def __init__(self, log):
        pass

    def ask(self, ask, **request):
        if ask == "about":
            return {"blender": "5", "device": "none", "cpu": "one"}
        if ask == "open":
            FakeWorker.opened.append(request["scene"]["name"])
            return {"samples": 1, "floors": {}, "share": {}}
        if request["samples"] == 13:
            return {"failed": "no luck"}
        FakeWorker.clock += FakeWorker.costs[request["series"]["label"]]
        return {"times": [1.0]}

    def end(self):
        pass


class Bar:
    n = total = 0

    def update(self, step):
        self.n += step

    def set_postfix_str(self, text):
        pass


@pytest.fixture
def fake(monkeypatch, tmp_path):
    FakeWorker.clock, FakeWorker.costs, FakeWorker.opened = 0.0, {"Candela": 1.0, EEVEE.label: 20.0, "Cycles": 1.0}, []
    monkeypatch.setattr(run, "Worker", FakeWorker)
    monkeypatch.setattr(run, "GUESS", {"CANDELA": (1.5, 0.01), "BLENDER_EEVEE": (15.0, 0.1), "CYCLES": (2.0, 0.01)})
    monkeypatch.setattr(run.time, "monotonic", lambda: FakeWorker.clock)
    return Store(tmp_path / "cells.jsonl")


def test_every_scene_gets_what_a_page_needs_before_any_gets_more(fake):
    samples = {OWN: (1, 4, 16, 64), EEVEE: (16, 4, 1), CYCLES: (1, 4, 16, 64, 256)}
    wanted = [cell(s, n, scene) for scene in (ROOM, HALL) for s, counts in samples.items() for n in counts]
    needed = {(one.scene.name, one.series.label, one.samples) for one in wanted if one.rank == cells.NEEDED}
    run.Run(wanted, 150.0, fake, Bar()).measure()
    assert FakeWorker.clock <= 150.0
    measured = [(row["scene"], row["series"]["label"], row["samples"]) for row in fake.found.values()]
    assert needed == set(measured[: len(needed)])
    assert len(measured) > len(needed)


def test_a_budget_that_is_too_short_is_kept_and_shared(fake):
    wanted = [cell(series, 16, scene) for scene in (ROOM, HALL) for series in (OWN, EEVEE, CYCLES)]
    run.Run(wanted, 30.0, fake, Bar()).measure()
    assert FakeWorker.clock <= 30.0
    measured = {(row["scene"], row["series"]["label"]) for row in fake.found.values()}
    assert {(scene.name, label) for scene in (ROOM, HALL) for label in ("Candela", "Cycles")} <= measured


def test_without_a_budget_all_is_measured_and_a_second_run_measures_nothing(fake):
    wanted = [cell(series, 16) for series in (OWN, EEVEE, CYCLES)]
    first = run.Run(wanted, None, fake, Bar())
    first.measure()
    assert not first.missing and not first.failures
    FakeWorker.opened.clear()
    run.Run(wanted, None, fake, Bar()).measure()
    assert FakeWorker.opened == []


def test_a_cell_that_fails_is_named_and_the_rest_goes_on(fake):
    done = run.Run([cell(OWN, 13), cell(OWN, 16)], None, fake, Bar())
    done.measure()
    assert done.failures == ["cornell_box, Candela, 13: no luck"]
    assert [one.samples for one in done.missing] == [13]
