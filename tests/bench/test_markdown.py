"""Documents and results that commands write."""

from pathlib import Path

import pytest

from bench.markdown import END, begin, rows_of, table, write_whole


def test_a_file_is_replaced_as_a_whole_or_not_at_all(tmp_path, monkeypatch):
    place = tmp_path / "results.json"
    write_whole(place, "before")
    monkeypatch.setattr(Path, "replace", lambda *_: (_ for _ in ()).throw(OSError(28, "No space left")))
    with pytest.raises(OSError, match="No space"):
        write_whole(place, "after")
    assert place.read_text() == "before"
    assert [path.name for path in tmp_path.iterdir()] == ["results.json"]


def test_rows_of_a_page_are_those_of_one_command_and_one_head():
    head, rows = ["scene", "error"], [["a room", "1"], ["b", "2"]]
    other = [["scene", "time", "note"], ["a room", "3 s", ""]]
    part = f"Made on 1 January.\n\n{table([head, *rows])}\n\nBeside it:\n\n{table(other)}"
    page = f"{begin('one')}\n\n{part}\n\n{END}\n{begin('two')}\n\n{table([head, ['c', '4']])}\n\n{END}\n"
    assert rows_of(page, "one", head) == rows
    assert rows_of(page, "one", other[0]) == other[1:]
    assert rows_of(page, "two", head) == [["c", "4"]]
    assert rows_of(page, "three", head) == []
