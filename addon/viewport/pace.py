"""How coarse pixels are while a picture changes, so that it keeps its rate, and how one at rest gets finer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ..gfx import library

STEP_S = 0.08  # what a step may take while the picture changes, to stay below 0.1 s: coarser pixels are drawn for it
STEP_SHARE = 0.8  # of the time between two pictures that Candela's own work may take
SCALES = (1, 2, 4, 8, 16)  # screen pixels per side of a drawn pixel; all but the first are drafts
LONG_S = 1.5  # a sample in full resolution that takes no longer is waited for without finer drafts before it
SHORT_S = 0.2  # of drafts that take no longer only the finest is drawn


@dataclass
class Pace:
    """Which scale keeps a step below its time, learned from what steps took."""

    cost: dict[int, float] = field(default_factory=dict)  # seconds of a sample, by scale

    def learn(self, scale: int, seconds: float) -> None:
        """Take note of a sample's time; single slow ones count less than lasting ones."""
        known = self.cost.get(scale, seconds)
        self.cost[scale] = 0.5 * (known + seconds)

    def expected(self, scale: int) -> float | None:
        """Seconds of a sample: measured, and never more than a finer one took. None if nothing is known yet.

        Drafts do less for a pixel than full resolution, so they tell nothing about it.
        """
        guesses = [self.cost[finer] for finer in SCALES if finer <= scale and finer in self.cost]
        if scale > 1 and scale not in self.cost:
            guesses += [seconds / (scale / other) ** 2 for other, seconds in self.cost.items()]
        return min(guesses, default=None)

    def scale(self, before: float = 0.0, step: float = STEP_S, coarsest: int = SCALES[-1]) -> int:
        """The finest scale that is fast enough for a step when `before` seconds of it are spent already, but never more
        than the coarsest allowed; for a scene never drawn the last but one."""
        if not self.cost:
            return min(SCALES[-2], coarsest)
        left = step - before
        fitting = (scale for scale in SCALES if (self.expected(scale) or np.inf) <= left)
        return min(next(fitting, SCALES[-1]), coarsest)

    def finer(self, scale: int) -> int:
        """The scale that a picture at rest is drawn in after this one."""
        whole = self.expected(1)
        if whole is not None and whole <= LONG_S:
            return 1
        finer = [one for one in SCALES if 1 < one < scale]
        quick = (one for one in finer if (self.expected(one) or np.inf) <= SHORT_S)
        return next(quick, max(finer, default=1))


class Redraw:
    """One redraw: it works until a time is spent."""

    def __init__(self, clock: Callable[[], float], budget: float):
        self.clock, self.budget = clock, budget  # seconds
        self.began, self._known = clock(), library.news()

    @property
    def is_fresh(self) -> bool:
        """Programs have been compiled in it, or were first drawn with."""
        return library.news() != self._known

    def is_over(self, ahead: float = 0.0) -> bool:
        """Whether its time is spent, with so many seconds more, or with as many as each new program took in it: the
        next one may take as long."""
        spent, new = self.clock() - self.began, library.news() - self._known
        return spent + max(ahead, spent / new if new else 0.0) > self.budget


GUIDE_SHARE = 0.35  # of a step, or of the draft where that takes longer, that finding its shapes may take


@dataclass
class GuidePace:
    """In which pixels the shapes of a draft are found, learned from what that took."""

    by_pixel: float | None = None  # seconds

    def learn(self, seconds: float, pixels: int) -> None:
        """Take note of how long it took."""
        now = seconds / max(pixels, 1)
        self.by_pixel = now if self.by_pixel is None else 0.5 * (self.by_pixel + now)

    def scale(self, pixels: int, draft: int, step: float) -> int | None:
        """Screen pixels per side of one; None where not even half the draft's own scale is quick enough."""
        if self.by_pixel is None:
            return max(draft // 2, 1)
        fitting = (one for one in SCALES if one < draft and self.by_pixel * pixels / one**2 <= GUIDE_SHARE * step)
        return next(fitting, None)


def coarsest_for(height: float, least: int = 64) -> int:
    """The coarsest scale that leaves a height in pixels at least so many drawn ones."""
    return max((scale for scale in SCALES if height / scale >= least), default=1)
