"""Documents and results that commands write."""

import os

import pytest

from bench.markdown import write_whole


def test_a_file_is_replaced_as_a_whole_or_not_at_all(tmp_path, monkeypatch):
    place = tmp_path / "results.json"
    write_whole(place, "before")
    monkeypatch.setattr(os, "fdopen", lambda *_, **__: (_ for _ in ()).throw(OSError(28, "No space left")))
    with pytest.raises(OSError, match="No space"):
        write_whole(place, "after")
    assert place.read_text() == "before"
    assert [path.name for path in tmp_path.iterdir()] == ["results.json"]
