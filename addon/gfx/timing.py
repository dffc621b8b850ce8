"""Time per named step. Blender offers no timer queries, so a step that is to be measured waits for the GPU at its end.

Waiting after every step slows a picture down, and not waiting tells only what it takes to submit: whatever happens to
wait next pays for all before it. So a picture of many samples is measured in some of them (`measured`), and what the
steps of those took stands for the others: their shares of it, scaled to what the whole picture took.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

from . import library
from .images import finish

EVERY = 16  # samples, one of which is measured
FEWEST = 4  # samples: of a picture of fewer none is measured, unless each step waits anyhow


class Stopwatch:
    """Seconds since it was made: what programs took to compile, and the rest."""

    def __init__(self):
        self._started, self._compiled = time.perf_counter(), library.compile_seconds

    @property
    def compiling(self) -> float:
        return library.compile_seconds - self._compiled

    @property
    def working(self) -> float:
        return time.perf_counter() - self._started - self.compiling


class Profiler:
    """Adds up seconds by step name, without those that programs took to compile.

    With `wait` a one-pixel readback after each step forces the GPU to finish it.
    """

    def __init__(self, wait: bool = False):
        self.seconds: dict[str, float] = {}
        self.calls: dict[str, int] = {}
        self.awaited = 0.0  # seconds between steps, for the GPU to catch up
        self.wait = wait
        self._measured: dict[str, float] = {}  # of the samples that were measured
        self._measured_samples = self._samples = 0

    @contextmanager
    def step(self, name: str):
        watch = Stopwatch()
        try:
            yield
        finally:
            if self.wait:
                finish()
            self.seconds[name] = self.seconds.get(name, 0.0) + watch.working
            self.calls[name] = self.calls.get(name, 0) + 1

    def steps(self, name: str, parts: Iterator) -> Iterator:
        """The parts of a step, each timed like a step; what happens between two is not."""
        end = object()
        while True:
            with self.step(name):
                part = next(parts, end)
            yield part
            if part is end:
                return

    @contextmanager
    def measured(self, sample: int, samples: int):
        """The steps of a sample; those of one in EVERY, from the second on, whose programs are compiled, wait."""
        before, waits = dict(self.seconds), self.wait
        chosen = waits or (samples >= FEWEST and sample % EVERY == 1)
        if chosen and not waits:
            finish()
            self.wait = True
        try:
            yield
        finally:
            self.wait = waits
            self._samples += 1
            if chosen:
                self._measured_samples += 1
                for name, seconds in self.seconds.items():
                    took = seconds - before.get(name, 0.0)
                    self._measured[name] = self._measured.get(name, 0.0) + took
            else:  # what it took to submit says nothing
                self.seconds = before

    @contextmanager
    def once(self, samples: int):
        """Steps that a picture has once: they wait where its samples are measured."""
        waits = self.wait
        self.wait = waits or samples >= FEWEST
        try:
            yield
        finally:
            self.wait = waits

    def shares(self, names: list[str], total: float) -> dict[str, float]:
        """Seconds of each of these steps in a picture that took `total`: what was measured of them, scaled to it. Where
        no sample was measured, the seconds that it took to submit them."""
        found = {name: self.seconds.get(name, 0.0) for name in names}
        if not self._measured_samples:
            return found
        for name in names:
            measured = self._measured.get(name, 0.0)
            found[name] += measured * (self._samples / self._measured_samples - 1.0)
        return {name: seconds * total / max(sum(found.values()), 1e-12) for name, seconds in found.items()}
