"""Repeated light: direct light of a sample once more, where a point of the film shows another surface.

Points of the film that share a sample's light (film/points.py) take it from pixels whose own point lies on the same
surface. At edges that is a guess: on what is thinner than a pixel, on a leaf half in shadow, on an outline that alone
shows a highlight. So pixels are marked whose own point lies elsewhere, unless the direct light of two or more
neighbours on the surface differs by less than 30 %, and the passes of light run again in them alone: the same points
on lights, the same depth maps, which hold until the next sample.

relMSE at 256x192, four samples of two points each, all light, by the guess and repeated: garden .0080 and .0072, window
.0184 and .0176. Before points went to all pixels whose filter covers them, direct light at 16 samples (4 points each),
with seconds of the render:

| | guess | repeated | every edge repeated |
|---|---|---|---|
| `instances` | .0114, 6.4 s | .0059, 7.7 s | .0056, 8.3 s |
| `soft_shadow_garden` | .0043, 3.1 s | .0031, 3.6 s | .0030, 4.0 s |
| `window_interior` | .0252, 3.5 s | .0214, 4.0 s | .0208, 4.4 s |

The glossy light of outlines has its mean again: garden .963 to .996, product 1.019 to 1.005.

| cost | per point of the film beside the sample's own |
|---|---|
| passes | those of direct light, over the marked pixels |

Direct light is added by `add`, which keeps what it needs to be repeated. Who adds such light in another way, or draws
maps over maps of the same sample, says `forbid`: then the guess stays. Indirect light is smooth, and always guessed.
What is kept is the frame's one `KeptLight`, for all techniques.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from ..frame.picture import Frame
from ..frame.technique import Param, Technique
from ..gfx import images, passes
from ..gfx.library import Program
from ..sources import lights
from ..surfaces.draw import MARKS, surface_bindings

EDGES = Param(
    "edges", "Light edges", True,
    "From four samples on, light filter points separately where they show another surface than the pixel's centre",
)  # fmt: skip
FEWEST = 4  # samples: fewer err by light, not by edges
PATHS = ("diffuse_direct", "glossy_direct")
MARKED = "LESS"  # `where` of passes.fullscreen: the marks are 1 of 0


@dataclass(frozen=True)
class Lit:
    """A pass of light over the surfaces of a sample. `bindings` lack the surfaces, the view and the block
    `sources`, which is filled from `rows` and `views`."""

    program: Program
    where: str
    bindings: dict[str, dict]
    rows: list[np.ndarray]
    views: np.ndarray | None = None

    def bound(self, frame: Frame, sources: lights.Sources, surfaces: dict[str, images.Image]) -> dict[str, dict]:
        """All bindings of the pass that adds the light on `surfaces` (by their bindings)."""
        block = sources.set(self.rows, self.views)
        return {
            "textures": {**surfaces, **self.bindings["textures"]},
            "blocks": {"film_view": frame.view_block, "sources": block, **self.bindings["blocks"]},
            "constants": self.bindings["constants"],
        }


def add(frame: Frame, technique: Technique, sources: lights.Sources, lit: Lit, keeps: bool = True) -> Iterator[None]:
    """Add this light to the sample's radiance, in parts, and, if it `keeps`, keep it for other points of the film."""
    target = frame.target(*(f"radiance.{path}" for path in PATHS), depth=MARKS)
    bindings = lit.bound(frame, sources, surface_bindings(frame))
    for band in frame.bands(technique):
        passes.fullscreen(lit.program, target, blend="ADDITIVE_PREMULT", where=lit.where, rows=band, **bindings)
        yield
    if keeps:
        keep(frame, lit)


@dataclass
class KeptLight:
    """The direct light of the sample that is running, to be repeated; `complete`: there is none that cannot be."""

    passes: list[Lit] = field(default_factory=list)
    complete: bool = True


def keep(frame: Frame, lit: Lit) -> None:
    """This light, which was added to the sample's radiance, may be repeated."""
    frame.shared(KeptLight).passes.append(lit)


def forbid(frame: Frame) -> None:
    """Of this sample there is direct light that cannot be repeated."""
    frame.shared(KeptLight).complete = False


def possible(frame: Frame) -> bool:
    """Whether this sample's direct light can be repeated, and is worth it, after all techniques have added theirs."""
    kept = frame.shared(KeptLight)
    return frame.settings.samples >= FEWEST and kept.complete and bool(kept.passes)


def repeat(frame: Frame, sources: lights.Sources, surfaces: dict[str, images.Image], target: images.Target) -> None:
    """Add the sample's direct light on `surfaces` where the depth of `target` marks it."""
    for lit in frame.shared(KeptLight).passes:
        bindings = lit.bound(frame, sources, surfaces)
        passes.fullscreen(lit.program, target, blend="ADDITIVE_PREMULT", where=MARKED, **bindings)


def forget(frame: Frame) -> None:
    """The sample ends."""
    kept = frame.shared(KeptLight)
    kept.passes, kept.complete = [], True
