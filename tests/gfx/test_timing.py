"""Times of steps: what was measured in some samples stands for all, and sums to what the picture took."""

from types import SimpleNamespace

import pytest

from addon.gfx import timing
from addon.gfx.timing import EVERY, Profiler


@pytest.fixture
def profiler(monkeypatch):
    """Steps that take what they say; waiting for the GPU is counted."""
    waits, clock = [], [0.0]
    monkeypatch.setattr(timing, "finish", lambda: waits.append(1))
    monkeypatch.setattr(timing, "time", SimpleNamespace(perf_counter=lambda: clock[0]))
    made = Profiler()
    made.waits, made.clock = waits, clock
    return made


def step(profiler, name, seconds):
    with profiler.step(name):
        profiler.clock[0] += seconds


def test_one_sample_in_a_while_is_measured_and_stands_for_the_others(profiler):
    samples = EVERY + 4
    for sample in range(samples):
        with profiler.measured(sample, samples):
            step(profiler, "a", 0.001 if sample % EVERY == 1 else 0.0)
            step(profiler, "b", 0.003 if sample % EVERY == 1 else 0.0)
    assert len(profiler.waits) == 2 * 3  # before the measured samples, and after each of their steps
    shares = profiler.shares(["a", "b"], 8.0)
    assert sum(shares.values()) == pytest.approx(8.0)
    assert shares["b"] / shares["a"] == pytest.approx(3.0)


def test_a_picture_of_one_sample_waits_for_nothing(profiler):
    with profiler.once(0), profiler.measured(0, 0):
        step(profiler, "a", 0.0)
    assert not profiler.waits and profiler.shares(["a"], 5.0) == {"a": 0.0}


def test_where_each_step_waits_all_are_measured(profiler):
    profiler.wait = True
    for sample in range(3):
        with profiler.measured(sample, 3):
            step(profiler, "a", 0.001)
    assert len(profiler.waits) == 3 and profiler.shares(["a", "b"], 3.0) == {"a": pytest.approx(3.0), "b": 0.0}
