"""Bands: a pass over all pixels in rows that fit into a viewport's redraw, so that Blender answers while one is drawn.

A scissor cuts a full-screen pass without changing a pixel of it. How many rows fit is learned from what the last band
took, for each technique apart: a pixel of indirect light costs a thousand times one of the film. On a GPU that draws
a whole pass in time there is soon one band again.
"""

from __future__ import annotations

from collections.abc import Iterator

FIRST = 16  # rows of a technique's first band: even rays of all its pixels end soon
MOST_GROWTH = 4.0
MOST_ROWS = 1 << 16


class Bands:
    """Sizes of bands by technique. Lives longer than a frame."""

    def __init__(self):
        self._rows: dict[str, int] = {}
        self._drawing = ("", 0)  # technique and rows of the band that is being drawn

    def split(self, name: str, height: int) -> Iterator[tuple[int, int]]:
        """Rows (from, to) that technique `name` draws one after the other, up to `height`."""
        row = 0
        while row < height:
            end = min(row + self._rows.get(name, FIRST), height)
            self._drawing = name, end - row
            yield row, end
            row = end
        self._drawing = "", 0

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
