"""GPU work of a final render in a window: in Blender's main loop, while the render's job waits for it.

Blender gives a job of its own a GPU context if the engine asks for one, and then every 3D viewport waits until the
job ends, and all of Blender with it. So in a window the engine asks for none. Its job only talks to Blender (results,
progress, Esc), and hands the steps that draw to a timer of the main loop, which works on them for a moment at a time,
between the events and redraws of the window. In background mode, or where a script renders from the main loop itself,
the steps are simply taken one after the other.

What a step yields comes to the job. A job that is cancelled does not wait for the step that runs: its steps are closed
by the next call of the timer, or before another file is opened.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Generator

import bpy

from .gfx import context, images

BUDGET_S = 0.05  # one call of the timer works until this is spent; what it has begun by then is finished
MOST_BUDGET_S = 0.2  # where the window itself takes long to be drawn, as with a software GPU, work as long as it
IDLE_S = 0.1  # between two looks for work
AWAKE_S = 1.0  # after the last work: the next frame of an animation does not wait for the timer
POLL_S = 0.05  # between two looks of a job at what has come, and at Esc


class Errand:
    """Steps that one job has handed over."""

    def __init__(self, steps: Generator):
        self._steps = steps
        self.news: deque = deque()  # what the steps have yielded and the job has not taken yet
        self.result = None
        self.error: BaseException | None = None
        self.cancelled = False
        self.ended = threading.Event()

    def work(self, budget: float) -> None:
        """Take steps until the budget is spent; in the main loop."""
        started = time.perf_counter()
        with images.passing_context():
            while not self.ended.is_set():
                if self.cancelled:
                    self.close()
                    return
                try:
                    news = next(self._steps)
                except StopIteration as end:
                    self.result = end.value
                    self.ended.set()
                except BaseException as error:  # it is the job's, which raises it
                    self.error = error
                    self.ended.set()
                else:
                    if news is not None:
                        self.news.append(news)
                if time.perf_counter() - started > budget:
                    return

    def close(self) -> None:
        """Give up what is left to be done; in the main loop."""
        self.cancelled = True
        self._steps.close()
        self.ended.set()


_errands: deque[Errand] = deque()
_left_at = _worked_at = 0.0


def taken(steps: Generator) -> Generator:
    """What the steps yield, wherever they have to be taken; yields None while there is nothing new. Returns what they
    return, raises what they raise. Closed, it gives up the rest."""
    if _is_at_hand():
        with images.passing_context():
            return (yield from steps)
    errand = Errand(steps)
    _errands.append(errand)
    try:
        while not errand.ended.wait(POLL_S):
            yield from _all(errand.news) or (None,)
        yield from _all(errand.news)
    finally:
        errand.cancelled = True
    if errand.error is not None:
        raise errand.error
    return errand.result


def _is_at_hand() -> bool:
    """Whether the GPU may be used where this is asked, for as long as it takes."""
    return bpy.app.background or threading.current_thread() is threading.main_thread()


def _all(news: deque) -> list:
    return [news.popleft() for _ in range(len(news))]


def _tick() -> float:
    global _left_at, _worked_at
    now = time.perf_counter()
    if not _errands:
        return 0.0 if now - _worked_at < AWAKE_S else IDLE_S
    if not context.available():
        return IDLE_S  # no window is drawn into right now
    errand = _errands[0]
    errand.work(min(max(now - _left_at, BUDGET_S), MOST_BUDGET_S))
    if errand.ended.is_set():
        _errands.popleft()
    _left_at = _worked_at = time.perf_counter()
    return 0.0


def close_all() -> None:
    """Give up all that jobs wait for; in the main loop."""
    while _errands:
        _errands.popleft().close()


def register() -> None:
    if not bpy.app.background:
        bpy.app.timers.register(_tick, first_interval=IDLE_S, persistent=True)


def unregister() -> None:
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
    close_all()
