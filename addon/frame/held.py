"""The images of a picture by name: which it writes, which add up over its samples, and which is shown for another."""

from __future__ import annotations

from functools import cached_property

from ..gfx import images, passes
from .plan import Plan
from .settings import Settings
from .technique import Write


class Held:
    """`images`: those that the picture has. `shown`: by sum over samples, the other sum that is shown instead.
    `carried`: ranked pairs of frames before, by name, that this one's are added to (time_steps.py)."""

    def __init__(self, plan: Plan, settings: Settings, size: tuple[int, int]):
        self.images: dict[str, images.Image] = {}
        self.shown: dict[str, str] = {}
        self.carried: dict[str, images.Image] = {}
        self._plan, self._settings, self._size = plan, settings, size
        self._more: list[Write] = []
        self._targets: dict[tuple[str, ...], images.Target] = {}

    @property
    def writes(self) -> list[Write]:
        """What the plan's techniques write, and what was added for this picture."""
        return [*(write for technique in self._plan.techniques for write in technique.writes), *self._more]

    @property
    def sums(self) -> set[str]:
        """Names of what adds up over samples."""
        return {write.name for write in self.writes if write.accumulates}

    def is_apart(self, name: str) -> bool:
        """Whether anybody looks at this sum over samples by itself: whoever asked for the picture, or a technique."""
        return self._settings.shows is None or name in self._looked_at

    @cached_property
    def _looked_at(self) -> frozenset[str]:
        needs = (technique.looks_at(self._settings) for technique in self._plan.techniques)
        return self._settings.shows.union(*needs)

    def take(self, write: Write) -> None:
        """Have the image of a write, with undefined content."""
        if write.name not in self.images:
            self.images[write.name] = images.pool.take(*self._size, write.format)

    def add(self, write: Write) -> images.Image:
        """An image that this picture alone has, as for passes that its view layer asks for by name; empty.
        In `begin`."""
        if write.name not in self.images:
            self.take(write)
            self._more.append(write)
        self.empty(write)
        return self.images[write.name]

    def empty(self, write: Write) -> None:
        """Make an image of a write ready for the first sample: without light, and with no pairs of ids and weights but
        those of the time steps before, since pairs of two images cannot be added pixel by pixel."""
        before = self.carried.get(write.name)
        if before is None:
            self.target(write.name).clear()
        else:
            passes.copy(before, self.target(write.name))

    def empty_sums(self) -> None:
        """The same of all that add up over samples."""
        for write in self.writes:
            if (write.accumulates or write.ranked) and write.name in self.images:
                self.empty(write)

    def to_show(self, name: str) -> images.Image:
        """The image of that name, or, of sums, the one that shows them better."""
        return self.images[self.shown.get(name, name)]

    def target(self, *names: str, depth: str = "") -> images.Target:
        """A render target over named images; kept with them."""
        key = (*names, "depth:" + depth)
        if key not in self._targets:
            self._targets[key] = images.Target(
                tuple(self.images[name] for name in names), self.images[depth] if depth else None
            )
        return self._targets[key]

    def drop(self) -> None:
        """Give the images back to the pool."""
        for image in self.images.values():
            images.pool.give(image)
