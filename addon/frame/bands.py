"""Bands: a pass over all pixels in rows that fit into a viewport's redraw, so that Blender answers while one is drawn.

A scissor cuts a full-screen pass without changing a pixel of it. How many rows fit is learned from what the last band
took, for each technique apart: a pixel of indirect light costs a thousand times one of the film. On a GPU that draws
a whole pass in time there is soon one band again.
"""

from __future__ import annotations

import time
from collections.abc import Iterator

from ..gfx import images
from ..gfx.context import turn
from ..gfx.timing import Profiler

PART_S = 0.05  # of a sample, between which Blender answers
FIRST = 16  # rows of a technique's first band: even rays of all its pixels end soon
MOST_GROWTH = 4.0
MOST_ROWS = 1 << 16


class Bands:
    """Sizes of bands by technique. Lives longer than a frame."""

    def __init__(self):
        self._rows: dict[str, int] = {}
        self._drawing = ("", 0)  # technique and rows of the band that is being drawn
        self.part = 0.0  # of the pass that is drawn in bands, how much is done

    def split(self, name: str, height: int) -> Iterator[tuple[int, int]]:
        """Rows (from, to) that technique `name` draws one after the other, up to `height`."""
        row = 0
        while row < height:
            end = min(row + self._rows.get(name, FIRST), height)
            self._drawing, self.part = (name, end - row), row / height
            yield row, end
            row = end
        self._drawing, self.part = ("", 0), 0.0

    def learn(self, seconds: float, wanted: float) -> None:
        """The part of a sample that was drawn last took `seconds`, and should have taken `wanted`."""
        name, drawn = self._drawing
        if not name:
            return
        growth = min(max(wanted / max(seconds, 1e-9), 1 / MOST_GROWTH), MOST_GROWTH)
        rows = round(drawn * growth)
        if growth > 1.0:
            rows = max(rows, self._rows.get(name, FIRST))  # the last band of a picture may be thin
        self._rows[name] = min(max(rows, 1), MOST_ROWS)


class QueueLimit:
    """Keeps the GPU from falling behind: waits for it after so many samples that `seconds` lie between two waits.

    What is only asked of a GPU and not waited for, some drivers put off without end: it takes memory, and a render that
    is cancelled goes on until all of it is drawn.
    """

    def __init__(self, profiler: Profiler, seconds: float):
        self._profiler, self._seconds = profiler, seconds
        self._samples, self._drawn, self._since = 1, 0, time.perf_counter()

    def sample(self) -> None:
        """Called after each sample, while it is this render's turn on the GPU."""
        self._drawn += 1
        if self._drawn < self._samples:
            return
        began = time.perf_counter()
        images.finish()
        now = time.perf_counter()
        self._profiler.awaited += now - began
        fitting = int(self._samples * self._seconds / max(now - self._since, 1e-9))
        self._samples = min(max(fitting, 1), 2 * self._samples)
        self._drawn, self._since = 0, now


def samples_in_parts(renderer, frame) -> Iterator[None]:
    """Draw all samples of a frame, in parts short enough for a window that goes on answering; yields after each.

    Each part takes a turn. That a part has ended is known by waiting for the GPU, which costs it some of its speed: a
    GPU that draws whole samples in the time of a part is not waited for any more.
    """
    end, limit = object(), None
    frame.shared_out = bands = Bands()
    frame.profiler.wait = True
    while frame.samples_done < frame.samples_to_draw:
        parts, part, began = renderer.steps(frame), None, time.perf_counter()
        while part is not end:
            with turn:
                started = time.perf_counter()
                part = next(parts, end)
                bands.learn(time.perf_counter() - started, PART_S)
                if part is end and limit is not None:
                    limit.sample()
            yield
        if limit is None and time.perf_counter() - began < PART_S:
            frame.shared_out, frame.profiler.wait = None, frame.settings.profile
            limit = QueueLimit(frame.profiler, PART_S)
