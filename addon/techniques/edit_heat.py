"""How much reflections are turned where: colours over the picture, in viewports that are asked to show them.

The rotation that edits have found at each pixel (reflection_editing.py, of the last sample) is drawn as a heat map over
the grey picture: blue little, green 30 degrees, yellow 60, red 120, from where edits fold over. A render keeps its
picture; `render --set edit_heat.shown=true --show film.turned` writes the map in its place.

| cost | when the picture is shown |
|---|---|
| passes | 1 |
| bytes per pixel | 16 |
"""

from __future__ import annotations

import weakref

from ..film.resolve import COMBINED
from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.technique import Param, Technique, Write
from ..gfx import passes
from ..snapshot.panorama import bends_lines
from ..snapshot.scene import Snapshot
from .reflection_editing import EDIT, NOTHING_EDITED, has_edits

TURNED = "film.turned"
HEAT = passes.fullscreen_program(
    "how far edits turn",
    "edit/heat.frag.glsl",
    textures=(("RGBA32F", "picture"), ("RGBA32F", "edit")),
    outputs=(("VEC4", "out_turned"),),
)


class EditHeat(Technique):
    name = "edit_heat"
    label = "Heat map of edits"
    params = (
        Param(
            "shown", "Show Turns of Edits", False,
            "In viewports, show by colours how far reflections are turned: blue little, green 30°, yellow 60°, "
            "red 120°",
        ),
    )  # fmt: skip
    reads = (COMBINED, EDIT)
    writes = (Write(TURNED, "RGBA32F", "How far edits turn reflections, as colours over the grey picture"),)

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        if not settings.get(self, "shown"):
            return "nobody asks to see how far edits turn"
        if not has_edits(snapshot):
            return NOTHING_EDITED
        return bends_lines(snapshot)

    def __init__(self):
        self._shown: tuple = (lambda: None, 0)  # the frame whose picture is drawn, and of how many samples

    def show(self, frame: Frame) -> None:
        frame.picture = TURNED
        drawn, samples = self._shown
        if drawn() is frame and samples == frame.samples_done:
            return
        self._shown = weakref.ref(frame), frame.samples_done
        passes.fullscreen(
            HEAT, frame.target(TURNED), textures={"picture": frame.images[COMBINED], "edit": frame.images[EDIT]}
        )
        frame.count(self, "passes")
