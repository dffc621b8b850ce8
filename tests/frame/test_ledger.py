"""The ledger's rows and its text for the terminal."""

import pytest

from addon.frame import ledger
from addon.frame.ledger import RAN, REUSED, SKIPPED, Ledger, Row

FULL = Ledger(
    rows=[
        Row("surfaces", "Surfaces", RAN, milliseconds=12.34, counters={"passes": 2, "triangles": 100}),
        Row("maps", "Accumulated shadow maps", REUSED, "nothing changed"),
        Row("sky", "Environment light", SKIPPED, "the world is black"),
    ],
    times={"sync": 0.25, "passes": 1.5},
    samples=4,
)


def test_the_text_says_of_each_technique_what_became_of_it():
    lines = FULL.text().splitlines()
    assert lines[0].split() == ["Surfaces", "ran", "12.3", "ms", "2", "passes,", "100", "triangles"]
    assert lines[1].split() == ["Accumulated", "shadow", "maps", "reused", "nothing", "changed"]
    assert lines[2].split() == ["Environment", "light", "skipped", "the", "world", "is", "black"]
    assert lines[3].split() == ["sync", "250", "ms,", "passes", "1500", "ms"]


def test_the_columns_stand_below_each_other():
    lines = FULL.text().splitlines()[:3]
    assert len({line.index(word) for line, word in zip(lines, ("ran", "reused", "skipped"))}) == 1


def test_values_that_were_not_finite_are_told():
    assert "bad" not in FULL.text()
    assert "7 values were not finite" in Ledger(bad_pixels=7).text()


def test_an_empty_ledger_is_an_empty_text():
    assert Ledger().text() == ""


def test_rows_are_found_by_name_and_a_wrong_name_is_an_error():
    assert FULL.row("sky").reason == "the world is black"
    with pytest.raises(KeyError, match="The ledger has no row 'skies'"):
        FULL.row("skies")


def test_what_is_published_is_the_latest():
    before = ledger.latest()
    try:
        ledger.publish(FULL)
        assert ledger.latest() is FULL
    finally:
        ledger.publish(before)
