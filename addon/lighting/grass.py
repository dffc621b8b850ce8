"""The service of grass patches: passes that light surfaces look up in their table what grass reflects.

A pass is compiled with `grown`, which adds the table and GRASS to it. Without grass nothing of this is compiled.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

from ..frame.technique import Service
from ..gfx import images
from ..gfx.library import Program

TABLE = ("RGBA16F", "grass_table")


@dataclass
class GrassTable(Service):
    """Patches of the materials of a frame."""

    name = "grass"
    image: images.Image

    @property
    def bindings(self) -> dict[str, images.Image]:
        """Textures of passes made by `grown`."""
        return {TABLE[1]: self.image}


@cache
def grown(program: Program) -> Program:
    """The same pass for a scene with grass."""
    return replace(
        program, name=f"{program.name}, grass", textures=(*program.textures, TABLE),
        defines=(*program.defines, ("GRASS", "1")),
    )  # fmt: skip
