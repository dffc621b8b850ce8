"""Time per named step. Blender offers no timer queries, so a profiled step waits for the GPU at its end."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

from .images import finish


class Profiler:
    """Adds up seconds by step name. With `wait=False` it measures what the CPU spends to submit, at no cost.

    With `wait=True` a one-pixel readback after each step forces the GPU to finish it: true times, slower frames.
    """

    def __init__(self, wait: bool = False):
        self.seconds: dict[str, float] = {}
        self.calls: dict[str, int] = {}
        self.awaited = 0.0  # seconds between steps, for the GPU to catch up
        self.wait = wait

    @contextmanager
    def step(self, name: str):
        start = time.perf_counter()
        try:
            yield
        finally:
            if self.wait:
                finish()
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start
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
