"""What techniques tell of their work in a picture: rows of the ledger are made of it.

Amounts that only the GPU knows add up in an image, and are read with the picture, so that none of them stops the queue:
each is a texel of an image of MOST x 1. What is counted is the first number of a texel of some image, drawn there by
blending. One read holds the picture and, in a row below, the sums.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..gfx import images
from ..gfx.readback import put
from .ledger import RAN, SKIPPED, Row
from .technique import Technique

MOST = 16

Counter = tuple[str, str, int]  # technique, name, and what a count stands for


class _Texels:
    """Those of a picture. `drop` gives the image back."""

    def __init__(self):
        self._counters: list[Counter] = []
        self._sums: images.Target | None = None

    def add(self, counter: Counter, image: images.Image, at: tuple[int, int]) -> None:
        """Add the first number of the texel `at` of an image. ValueError beyond MOST counters."""
        if self._sums is None:
            self._sums = images.Target((images.pool.take(MOST, 1, "RGBA32F"),))
        if counter not in self._counters:
            if len(self._counters) == MOST:
                raise ValueError(f"More than {MOST} counters are kept in images.")
            if not self._counters:
                self._sums.clear()
            self._counters.append(counter)
        put(image, self._sums, self._counters.index(counter), 0, "ADDITIVE_PREMULT", (*at, 1, 1))

    def read(self, image: images.Image | None) -> tuple[np.ndarray | None, list[tuple[Counter, float]]]:
        """An image's pixels (None: of none), and the sums, which begin anew."""
        if not self._counters:
            return None if image is None else images.read(image), []
        sums = self._sums.colors[0]
        width = max(image.width if image else 0, sums.width)
        height = image.height if image else 0
        if image is not None and image.format != "RGBA32F":  # floats of another format: not worth a program
            pixels, image, height = images.read(image), None, 0
        else:
            pixels = None
        with images.borrowed(width, height + 1, "RGBA32F") as target:
            if image is not None:
                put(image, target, 0, 0)
            put(sums, target, 0, height)
            found = images.read(target.colors[0])
        counted = list(zip(self._counters, found[height, :, 0].tolist()))
        self._counters.clear()
        return found[:height, : image.width] if image is not None else pixels, counted

    def drop(self) -> None:
        """Give the image back to the pool."""
        if self._sums is not None:
            images.pool.give(self._sums.colors[0])
            self._sums = None


class Account:
    """Of one picture. `counters`: by technique and name. `needless`: why a technique found nothing to do, by name."""

    def __init__(self):
        self.counters: dict[str, dict[str, int]] = {}
        self.needless: dict[str, str] = {}
        self._choices: dict[str, dict[str, str]] = {}
        self._texels = _Texels()

    def note(self, technique: Technique, amounts: Mapping[str, int]) -> None:
        """Set counters of the technique's ledger row."""
        self.counters.setdefault(technique.name, {}).update(amounts)

    def count(self, technique: Technique, name: str, amount: int = 1) -> None:
        """Add to a counter of the technique's ledger row."""
        self._add(technique.name, name, amount)

    def _add(self, name: str, counter: str, amount: int) -> None:
        row = self.counters.setdefault(name, {})
        row[counter] = row.get(counter, 0) + amount

    def chose(self, technique: Technique, of: str, why: str) -> None:
        """Between methods, by what they cost on this device: the ledger's row says it."""
        self._choices.setdefault(technique.name, {})[of] = why

    def leave(self, technique: Technique, reason: str) -> None:
        """The picture itself shows that the technique is not needed: its ledger row says skipped, and why."""
        self.needless[technique.name] = reason

    def count_texel(
        self, technique: Technique, name: str, image: images.Image, factor: int = 1, at: tuple[int, int] = (0, 0)
    ) -> None:
        """Add the first number of an image's texel, times `factor`, to a counter, without reading it now: it comes with
        the picture. Sums below 2^24 are exact."""
        self._texels.add((technique.name, name, factor), image, at)

    def read(self, image: images.Image | None) -> np.ndarray | None:
        """An image's pixels; what `count_texel` has counted is read with them, and added to the counters."""
        pixels, found = self._texels.read(image)
        for (technique, name, factor), amount in found:
            if amount > 0.0:  # as with `count`: what did not happen is not counted
                self._add(technique, name, factor * round(amount))
        return pixels

    def row(self, technique: Technique, slot: str, seconds: float) -> Row:
        """Of the ledger, for a technique that ran."""
        if technique.name in self.needless:
            return Row(technique.name, technique.label, SKIPPED, self.needless[technique.name], slot=slot)
        counters = self.counters.get(technique.name, {})
        chosen = tuple(f"{of}: {why}" for of, why in self._choices.get(technique.name, {}).items())
        return Row(technique.name, technique.label, RAN, "", 1000 * seconds, slot, counters, chosen)

    def drop(self) -> None:
        """Give back what is held on the GPU."""
        self._texels.drop()
