"""Bands: they cover a picture once, and their size follows the time they take."""

from types import SimpleNamespace

import pytest

from addon.frame import bands as bands_module
from addon.frame.bands import FIRST, Bands, QueueLimit


def drawn(bands, height, seconds_per_row, wanted=0.02, name="gather"):
    """The bands of one pass, each drawn in the time of its rows."""
    found = []
    for first, last in bands.split(name, height):
        found.append((first, last))
        bands.learn((last - first) * seconds_per_row, wanted)
    return found


@pytest.mark.parametrize("height", [1, 5, 16, 17, 1080])
@pytest.mark.parametrize("seconds_per_row", [0.0, 1e-6, 1e-3, 1.0])
def test_every_row_is_drawn_once(height, seconds_per_row):
    bands = Bands()
    for _ in range(3):
        rows = [row for first, last in drawn(bands, height, seconds_per_row) for row in range(first, last)]
        assert rows == list(range(height))


def test_slow_pass_is_cut_until_a_band_takes_what_it_should():
    bands = Bands()
    drawn(bands, 1080, 0.002)
    assert all(last - first == 10 for first, last in drawn(bands, 1080, 0.002))


def test_fast_pass_becomes_one_band():
    bands = Bands()
    drawn(bands, 1080, 1e-6)
    assert drawn(bands, 1080, 1e-6) == [(0, 1080)]


def test_techniques_learn_apart():
    bands = Bands()
    drawn(bands, 1080, 0.02, name="slow")
    assert next(iter(bands.split("other", 1080))) == (0, FIRST)


def test_what_is_not_drawn_in_bands_teaches_nothing():
    bands = Bands()
    bands.learn(10.0, 0.02)
    drawn(bands, 16, 1e-3)
    bands.learn(10.0, 0.02)
    assert next(iter(bands.split("gather", 1080)))[1] >= FIRST


class SlowGpu:
    """Takes `seconds` for each sample that was asked of it, once it is waited for; asking takes a tenth of that."""

    def __init__(self, seconds, monkeypatch):
        self.now, self.seconds, self.asked, self.awaited = 0.0, seconds, 0, 0.0
        self.longest = 0
        monkeypatch.setattr(bands_module.time, "perf_counter", lambda: self.now)
        monkeypatch.setattr(bands_module.images, "finish", self.finish)

    def draw(self):
        self.asked += 1
        self.now += 0.1 * self.seconds

    def finish(self):
        self.longest = max(self.longest, self.asked)
        self.now += 0.9 * self.seconds * self.asked
        self.asked = 0


@pytest.mark.parametrize(("seconds", "most"), [(1.0, 1), (0.05, 10), (0.001, 500)])
def test_gpu_is_behind_by_no_more_than_it_may(monkeypatch, seconds, most):
    gpu = SlowGpu(seconds, monkeypatch)
    limit = QueueLimit(gpu, 0.5)
    for _ in range(3000):
        gpu.draw()
        limit.sample()
    assert most / 2 <= gpu.longest <= most
    assert gpu.awaited == pytest.approx(0.9 * seconds * (3000 - gpu.asked))


def test_the_queue_is_asked_after_as_many_samples_as_fit(monkeypatch):
    """Samples of a tenth of a second, where ten may lie between two waits: twice as many each time, up to those."""
    clock, asked = [0.0], []
    monkeypatch.setattr(bands_module.time, "perf_counter", lambda: clock[0])
    limit = QueueLimit(SimpleNamespace(awaited=0.0), 1.0 + 1e-6)
    monkeypatch.setattr(bands_module.images, "finish", lambda: asked.append(round(clock[0] / 0.1)))
    for _ in range(39):
        clock[0] += 0.1
        limit.sample()
    assert asked == [1, 3, 7, 15, 25, 35]
