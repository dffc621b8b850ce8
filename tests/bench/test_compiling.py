"""What `bench compiling` says of redraws, and that it waits for no process for ever."""

import time

import pytest

from bench import compiling


def test_the_longest_redraws_are_told_of_drafts_and_of_pictures_in_full():
    drafts = [(0.1 * k, True, {}) for k in range(5)] + [(2.0, True, {"film": 0.25, "surfaces": 1.5})]
    rows = compiling.rows_of_redraws("room", *drafts, (1.5, False, {"film": 1.0}))
    assert len(rows) == compiling.TOLD + 1 and {len(row) for row in rows} == {len(compiling.REDRAWS_HEAD)}
    assert rows[0] == ("room", "drafts", "6", "1", "2.00", "surfaces 1.50, film 0.25")
    assert [row[4] for row in rows[1:3]] == ["0.40", "0.30"]
    assert rows[-1] == ("room", "in full", "1", "1", "1.50", "film 1.00")


def test_what_a_process_answers_counts_though_it_does_not_end(tmp_path):
    script = f"import sys, time; print('other'); print('{compiling.ANSWER}[1, 2]', flush=True); time.sleep(100)"
    began = time.monotonic()
    assert compiling.measured(script, tmp_path / "room.blend", (8, 6)) == [1, 2]
    assert time.monotonic() - began < 50


@pytest.mark.parametrize("script", ["", "import time; time.sleep(100)"], ids=["ends", "hangs"])
def test_a_process_that_does_not_answer_is_ended(script, tmp_path):
    began = time.monotonic()
    with pytest.raises(RuntimeError, match="room: the process that draws it gave no answer"):
        compiling.measured(script, tmp_path / "room.blend", (8, 6), 2.0)
    assert time.monotonic() - began < 50
