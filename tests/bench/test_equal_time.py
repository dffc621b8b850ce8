"""Errors in equal time are read from what was measured, between points and not beyond them."""

import pytest

from bench import equal_time


def test_errors_are_read_between_points_and_not_beyond_them():
    known = [(1.0, 0.1), (10.0, 0.2), (100.0, 0.001)]
    assert equal_time.at_time(known, 0.5) == pytest.approx(0.1)
    assert equal_time.at_time(known, 5.0) == pytest.approx(0.1)  # the longer picture was worse: nobody takes it
    assert equal_time.at_time(known, 10**1.5) == pytest.approx(0.01)
    assert equal_time.at_time(known, 1e4) == pytest.approx(0.001)


def test_a_row_and_how_many_scenes_have_less_error():
    points = [("CANDELA", 2.0, 0.01), ("CANDELA", 32.0, 0.01)]
    points += [("CYCLES", 2.0 * n, 0.1 / n) for n in (64, 1, 4, 16)]
    row = equal_time.row("a room", points)
    assert row == ["a room", "2.00", "0.0100", "0.1000", "32.00", "0.0100", "0.0063"]
    assert equal_time.table([row], (1, 16)).startswith(
        "Less error than denoised Cycles in equal time: with 1 in 1 of 1 scenes, with 16 in 0 of 1 scenes.\n\n| scene |"
    )
