"""What `bench beside` says of figures that are made up, and that its own scenes can be built."""

import argparse
import json

import bpy
import pytest

from bench import beside, beside_scenes


def rows():
    return [
        beside.Row("a", 16, (1.0, 0.5), (1.0, 1.0), (0.01, 0.02)),
        beside.Row("b", 16, (1.0, 2.0), (2.0, 1.0), (0.02, 0.01)),
        beside.Row("a", beside.TURN, (0.001, 0.002), (1.0, 1.0), None),
    ]


def test_means_are_geometric_and_by_number_of_samples():
    of_pictures, of_drafts = beside.summary(rows())
    assert of_pictures["time"] == pytest.approx(1.0) and of_pictures["error"] == pytest.approx(1.0)
    assert of_drafts["time"] == pytest.approx(2.0) and of_drafts["error"] is None
    assert beside.sentence(of_drafts) == "Drafts: 2.00 times the processor time, in the mean of 1 scenes."


def test_rows_as_cells():
    assert beside.cells(rows()[0]) == ("a", "16", "1", "0.5", "0.50", "1.00", "0.01", "0.02", "2.00")
    assert beside.cells(rows()[2])[1:5] == ("a draft, ms", "1", "2", "2.00")


def test_history_keeps_the_last(tmp_path, monkeypatch):
    monkeypatch.setattr(beside, "HISTORY", tmp_path / "beside.json")
    options = argparse.Namespace(checkout=tmp_path, size=(16, 12))
    for number in range(beside.KEPT + 2):
        beside.keep(rows(), options, str(number))
    beside.keep(rows()[:1], options, str(number))  # the same run, further on
    kept = json.loads(beside.HISTORY.read_text(encoding="utf-8"))
    assert [one["began"] for one in kept] == [str(number) for number in range(2, beside.KEPT + 2)]
    assert [len(one["rows"]) for one in kept[-2:]] == [3, 1]


@pytest.mark.parametrize("name", beside_scenes.SCENES)
def test_scenes_can_be_built(name, tmp_path):
    path = beside_scenes.written(name, tmp_path)
    assert path.is_file() and bpy.context.scene.camera is not None


def test_unknown_scenes_are_named():
    with pytest.raises(ValueError, match="no scene nowhere; there are alpha_foliage"):
        beside.scenes_of(["nowhere"])
