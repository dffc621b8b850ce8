"""Light linking: which pixels a light leaves out, by the group of receivers of the object that each shows.

Groups stand in the instance image (snapshot/linking.py) and groups that a light does not light beside its kind
(sources/lights.py). Where any light of a pass has such bits, surfaces are drawn once more in the sample, with the
numbers of their instances in the place of where they lie, whose groups the pass asks for (ask/links.glsl). Scenes
without links compile and draw nothing of this.

| cost | per sample with linked lights |
|---|---|
| passes | 1 of surfaces and 1 of groups, and a fetch more per pixel in each linked pass |
| memory | 7 images of 16 bytes a pixel while it draws, 1 of 4 that stays |

Light that rays find at other surfaces (shaders/indirect/path.glsl) follows links, too: triangles of the hierarchy know
the groups of their object, and what mirrors and glass show has its receivers' groups drawn beside it. Lamps that light
no volume's group shine into none (snapshot/linking.py). Not followed: light of other kinds of bounces, photons, shadow
links in volumes, mirrors and glass; emissive meshes in mirrors.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from functools import cache

import numpy as np

from ..frame.picture import Frame
from ..frame.technique import Technique
from ..gfx import images, passes
from ..gfx.interface import Interface, answered
from ..gfx.library import Program
from ..sources import lights
from ..surfaces.draw import SURFACES, draw_indices
from . import repeated_light

GROUPS = "surface.group"


def _groups_program(number: str) -> Program:
    """`number`: component in which instances' numbers stand."""
    return passes.fullscreen_program(
        "groups of receivers",
        "light/groups.frag.glsl",
        textures=(("RGBA32F", "surface_object"), ("RGBA32F", "instances")),
        defines=(("VISIBILITY_FLAG", "FLAG_CAMERA"), ("NUMBER", number)),
        outputs=(("FLOAT", "out_group"),),
    )


FIND_GROUPS, FIND_GROUPS_AT_HITS = _groups_program("z"), _groups_program("x")


LINKS = Interface("links", "light/links.glsl", (("R32F", "receiver_groups"),), lambda frame: None)  # by `linked`


def has_links(rows: list[np.ndarray]) -> bool:
    """Whether any of these lights, (TEXELS, 4) each, leaves out receivers, or any emissive mesh where one of them is a
    point on such a mesh."""
    at = lights.LIGHT.at
    return any(
        row[at.kind] >= lights.KIND_STEPS or (row[at.kind] == lights.SURFACE and row[at.cone] > 0.0) for row in rows
    )


def linked(
    frame: Frame, technique: Technique, program: Program, rows: list[np.ndarray], textures: dict[str, images.Image]
) -> Program:
    """The same pass for what these lights, (TEXELS, 4) each, leave out of what the camera sees in this sample. The
    image of groups is added to `textures`."""
    if not has_links(rows):
        return program
    textures["receiver_groups"] = frame.shared(Groups).image(frame, technique)
    return answered(program, (LINKS,))


def groups_of_hits(
    frame: Frame, technique: Technique, rows: list[np.ndarray], triangles: images.Image
) -> dict[str, images.Image]:
    """Groups of receivers of what rays have met (`triangles`: records of it, surfaces/hits.py), as an image beside what
    a pass reads that lights it by these lights, (TEXELS, 4) each; none where no light leaves out receivers."""
    if not has_links(rows):
        return {}
    name = f"{GROUPS}_at_hits"
    if name not in frame.images:
        frame.images[name] = images.pool.take(*frame.size, "R32F")
    find_groups(frame, triangles, frame.target(name), at_hits=True)
    frame.count(technique, "passes")
    return {"receiver_groups": frame.images[name]}


def find_groups(frame: Frame, numbers: images.Image, groups: images.Target, at_hits: bool = False) -> None:
    """From the numbers of instances (z, `at_hits` x: rows of the geometry's image) their groups of receivers."""
    program = FIND_GROUPS_AT_HITS if at_hits else FIND_GROUPS
    passes.fullscreen(program, groups, textures={"surface_object": numbers, "instances": frame.geometry.instances})


def linked_at_hits(frame: Frame, program: Program) -> Program:
    """The same pass of shaders/indirect/path.glsl, for the links that the frame's lights have: what rays meet is lit by
    those that light it, through what does not block them."""
    return _linked_at_hits(program) if frame.snapshot.lights_are_linked else program


@cache
def _linked_at_hits(program: Program) -> Program:
    return replace(program, name=f"{program.name}, linked", defines=(*program.defines, ("HIT_LINKS", "1")))


class Groups:
    """The sample whose groups are drawn (frame.shared)."""

    def __init__(self):
        self._sample = -1

    def image(self, frame: Frame, technique: Technique) -> images.Image:
        """The image of groups of the sample that is running. Its light cannot be repeated at other points."""
        if self._sample != frame.sample:
            self._sample = frame.sample
            if GROUPS not in frame.images:
                frame.images[GROUPS] = images.pool.take(*frame.size, "R32F")
            with ExitStack() as stack:
                drawn = [stack.enter_context(images.borrowed(*frame.size, "RGBA32F")) for _ in SURFACES]
                depth = stack.enter_context(images.borrowed(*frame.size, "DEPTH_COMPONENT32F"))
                target = images.Target(tuple(one.colors[0] for one in drawn), depth.colors[0])
                draw_indices(frame, technique, target)
                find_groups(frame, drawn[0].colors[0], frame.target(GROUPS))
            frame.count(technique, "passes", 2)
        repeated_light.forbid(frame)
        return frame.images[GROUPS]
