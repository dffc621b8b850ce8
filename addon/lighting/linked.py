"""Light linking: which pixels a light leaves out, by the group of receivers of the object that each shows.

Groups stand in the instance image (snapshot/linking.py) and groups that a light does not light beside its kind
(sources/lights.py). Where any light of a pass has such bits, surfaces are drawn once more in the sample, with the
numbers of their instances in the place of where they lie, and the pass asks for them. Scenes without links compile and
draw nothing of this.

| cost | per sample with linked lights |
|---|---|
| passes | 1 of surfaces and a copy, and a fetch more per pixel in each linked pass |
| memory | 7 images while it draws, 1 that stays: 16 bytes a pixel each |

Not followed: light that reaches a surface by way of others, through glass, or in a volume; emissive meshes in mirrors.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace

import numpy as np

from ..frame.picture import Frame
from ..frame.technique import Technique
from ..gfx import images, passes
from ..gfx.library import Program
from ..sources import lights
from ..surfaces.draw import SURFACES, draw_indices
from . import repeated_light

GROUPS = "surface.object"


def has_links(rows: list[np.ndarray]) -> bool:
    """Whether any of these lights, (TEXELS, 4) each, leaves out receivers."""
    return any(int(row[0, 0]) >= lights.KIND_STEPS for row in rows)


def linked(program: Program) -> Program:
    """The same pass for lights that leave out receivers."""
    return replace(
        program, name=f"{program.name}, linked",
        textures=(*program.textures, ("RGBA32F", "surface_object"), ("RGBA32F", "instances")),
        defines=(*program.defines, ("LIGHT_LINKS", "1")),
    )  # fmt: skip


class Groups:
    """The sample whose groups are drawn (frame.shared)."""

    def __init__(self):
        self._sample = -1

    def bindings(self, frame: Frame, technique: Technique) -> dict[str, images.Image]:
        """The image of groups of the sample that is running. Its light cannot be repeated at other points."""
        if self._sample != frame.sample:
            self._sample = frame.sample
            if GROUPS not in frame.images:
                frame.images[GROUPS] = images.pool.take(*frame.size, "RGBA32F")
            with ExitStack() as stack:
                drawn = [stack.enter_context(images.borrowed(*frame.size, "RGBA32F")) for _ in SURFACES]
                depth = stack.enter_context(images.borrowed(*frame.size, "DEPTH_COMPONENT32F"))
                target = images.Target(tuple(one.colors[0] for one in drawn), depth.colors[0])
                draw_indices(frame, technique, target)
                passes.copy(drawn[0].colors[0], frame.target(GROUPS))
            frame.count(technique, "passes", 2)
        repeated_light.forbid(frame)
        return {"surface_object": frame.images[GROUPS], "instances": frame.geometry.instances}
