"""What shapes light on its way, in one list: passes are drawn for what of it the frame has and their shaders ask of."""

from __future__ import annotations

from ..frame.picture import Frame
from ..gfx import images
from ..gfx.interface import answer
from ..gfx.library import Program
from .grass import GRASS
from .leaving_light import LEAVES
from .linked import linked_at_hits
from .media import MEDIA

SHAPES = (GRASS, MEDIA, LEAVES)  # links are of single lights: lighting/linked.py


def asked(frame: Frame, program: Program, textures: dict[str, images.Image]) -> Program:
    """The same pass for what of SHAPES the frame has. Images of these are added to `textures`."""
    return answer(frame, program, textures, SHAPES)


def lit_at_hits(frame: Frame, program: Program, textures: dict[str, images.Image]) -> Program:
    """The same pass of shaders/indirect/path.glsl, for links that the frame's lights have, too."""
    return linked_at_hits(frame, asked(frame, program, textures))
