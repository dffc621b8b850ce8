"""What throws caustics and is no lamp: emissive meshes and the bright part of the world, as photons.py asks lights.

Each sample has photons of one point or of a few: of a place on a mesh, drawn by power, or of a direction of the world.
Points of both take glass as opaque in the same pictures, so no light is lost and none counted twice.
"""

from __future__ import annotations

import numpy as np

from ..frame.picture import Frame
from ..sources import lights
from . import caustic_casters
from .caustic_casters import MESHES, WORLD, Casters
from .emissive_triangles import EmissiveTriangles


class MeshSource:
    """All emissive meshes, as one light. A sample of it are the numbers that a point is drawn by."""

    light, has_span, flags, kind, key = None, False, 0, lights.SURFACE, MESHES
    is_flat = True

    def __init__(self, triangles: EmissiveTriangles, samples: float):
        self._triangles, self._samples = triangles, samples
        self.radius, self.reach = triangles.reach * np.sqrt(2.0 / np.pi), triangles.reach
        self.centre = triangles.centre

    def middle(self) -> np.ndarray:
        return np.full(3, 0.5)

    def sample(self, x: float, y: float, z: float) -> np.ndarray:
        return self._triangles.stretched(x, y)

    def position(self, sample: np.ndarray) -> np.ndarray:
        return self._triangles.draw(*sample)[1]

    def row(self, sample: np.ndarray, first_view: int, view_count: int, weight: float = 1.0) -> np.ndarray:
        return self._triangles.row(tuple(sample), 1.0 / weight, self.flags, view_count, self._samples)


class WorldSource:
    """Directions of the world's bright part, as suns without extent."""

    light, has_span, flags, kind, key = None, False, 0, lights.SUN, WORLD
    is_flat = True

    def __init__(self, bright):
        self._bright = bright
        self.radius = bright.half_angle
        self._arriving: dict[bytes, np.ndarray] = {}

    def middle(self) -> np.ndarray:
        return self.sample(0.5, 0.5, 0.5)

    def sample(self, x: float, y: float, z: float) -> np.ndarray:
        direction, arriving = self._bright.draw(x, y)
        self._arriving = {direction.tobytes(): arriving}
        return direction

    def row(self, sample: np.ndarray, first_view: int, view_count: int, weight: float = 1.0) -> np.ndarray:
        return lights.LIGHT.rows(
            kind=lights.SUN, flags=0, centre=sample, point=sample, rate=1.0, area=1.0,
            radiance=weight * self._arriving[sample.tobytes()],
        )  # fmt: skip


def sources_of(frame: Frame, casters: Casters) -> list[MeshSource | WorldSource]:
    """Of the picture, those that are answered for."""
    found = []
    if MESHES in casters.lights:
        triangles = EmissiveTriangles(frame, ("diffuse",))
        if triangles.power > 0:
            found.append(
                MeshSource(triangles, frame.settings.samples if frame.settings.schedule.known_total else np.inf)
            )
    bright = caustic_casters.bright_world(frame)
    return found if bright is None else [*found, WorldSource(bright)]
