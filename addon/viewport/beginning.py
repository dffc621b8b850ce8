"""A viewport's picture while it is begun: why, in which pixels, and with which settings."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace
from math import ceil, floor

from ..frame.picture import Frame
from ..frame.settings import OFF, Settings
from ..snapshot.scene import Camera, Film, Snapshot
from ..techniques.film import EMISSION

CHECKS, MOVES, CLIMBS, LIGHTS = "checks", "moves", "climbs", "lights"  # why a frame is begun
AT_REST = (CLIMBS, LIGHTS)


@dataclass
class Beginning:
    """A frame that is being begun."""

    parts: Generator[tuple[int, int], None, Frame]
    camera: Camera
    size: tuple[int, int]
    border: tuple[int, int, int, int]
    scale: int
    # CHECKS: whether anything drawn has changed; MOVES: it has; CLIMBS: the same in finer pixels; LIGHTS: the same with
    # indirect light, which was left out
    why: str
    samples: int
    reading: float = 0.0  # seconds that the scene took to be read
    seconds: float = 0.0
    placed: bool = False  # geometry and materials are there
    left: int = 0  # programs that it still has to compile, as far as known
    direct: bool = False  # as `only_direct` says: another process compiles the programs of the rest
    caught: Snapshot | None = None  # the scene, where its shadow catchers are drawn as such


def coarser(film: Film, scale: int) -> Film:
    """The same film in pixels of `scale` times the size; its border is that of whole ones."""
    width, height = (max(-(-extent // scale), 1) for extent in (film.width, film.height))
    x, y = width / film.width, height / film.height
    x0, y0, x1, y1 = film.border
    return replace(film, width=width, height=height, border=(floor(x0 * x), floor(y0 * y), ceil(x1 * x), ceil(y1 * y)))


def drawn_with(settings: Settings, scale: int, waits: bool) -> Settings:
    """The settings of a picture at a scale. `waits`: a part is done when the GPU has done it; a draft of a moving view
    is drawn as one, whose passes need not wait for each other. Drafts hold apart what emits, for `Display.refine`."""
    drawn = replace(settings, profile=waits)
    if scale == 1:
        return drawn
    shows = drawn.shows if drawn.shows is None else drawn.shows | {EMISSION}
    return replace(drawn.as_draft(), shows=shows)


def only_direct(settings: Settings) -> Settings:
    """The same without indirect light, rays of gloss, and what glass lets through, which have the largest programs.
    Points of lights then light narrow lobes, too."""
    return replace(settings, bounces=0, slots={**settings.slots, "reflection": OFF, "transmission": OFF})
