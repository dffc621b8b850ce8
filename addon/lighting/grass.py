"""The service of grass patches: passes that light surfaces look up in their table what grass reflects (ask/grass.glsl).
Without grass nothing of this is compiled.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..frame.picture import Frame
from ..frame.technique import Service
from ..gfx import images
from ..gfx.interface import Interface

TABLE = ("RGBA16F", "grass_table")


@dataclass
class GrassTable(Service):
    """Patches of the materials of a frame."""

    name = "grass"
    image: images.Image

    @property
    def bindings(self) -> dict[str, images.Image]:
        """Textures of GRASS."""
        return {TABLE[1]: self.image}


def _table(frame: Frame) -> dict[str, images.Image] | None:
    service = frame.service(GrassTable)
    return None if service is None else service.bindings


GRASS = Interface("grass", "grass/light.glsl", (TABLE,), _table)
