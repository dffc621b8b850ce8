"""Light at surfels: what they reflect, and the light of sources there. In images of receivers (scene/surfels.py), ROW
wide.

A short ray back to the surface finds each receiver's triangle, and lit_points.py shades it there and lights it: at
several points of each surfel's cell, others in each solution, over white surfaces: irradiance over pi. A patch of sun
is then as large as it is, not as many surfels as have their middle in it.

| cost | |
|---|---|
| when materials or surfaces change | 9 rays a receiver, 2 passes and 1 for each material met; 112 bytes a receiver |
| direct light | LIT POINTS rays to each lamp, the world and emissive meshes, for each receiver and solution |

Bias: as lit_points.py.
"""

from __future__ import annotations

from ..frame.picture import Frame
from ..frame.technique import Technique
from ..gfx import images, passes
from ..scene import acceleration
from ..scene.surfels import MEMBERS, ROW, Surfels
from ..scene.view import VIEW
from . import lit_points
from .lit_points import LitPoints

LIT = 4  # points in the cell of a surfel that are lit in a solution
POINTS = 8  # on each source for each of them
RAYS = passes.fullscreen_program(
    "rays to surfels",
    "implicit_visibility/rays.frag.glsl",
    textures=(("RGBA32F", "receivers"),),
    constants=(("INT", "receiver_count"), ("FLOAT", "offset_size")),
    outputs=(("VEC4", "out_origin"), ("VEC4", "out_direction")),
)
FREE = passes.fullscreen_program(
    "free ground around surfels",
    "implicit_visibility/free.frag.glsl",
    textures=(*acceleration.HIERARCHY_TEXTURES, ("RGBA32F", "receivers")),
    blocks=((VIEW, "film_view"),),
    constants=(("INT", "receiver_count"), ("FLOAT", "offset_size")),
    outputs=(("VEC4", "out_free_a"), ("VEC4", "out_free_b")),
)
MEMBER = passes.fullscreen_program(
    "points of surfels",
    "implicit_visibility/members.frag.glsl",
    textures=tuple(("RGBA32F", name) for name in ("receivers", "members", "shaded")),
    constants=(("INT", "receiver_count"), ("INT", "member")),
    defines=(("MEMBERS", str(MEMBERS)),),
    outputs=(("VEC4", "out_position"), ("VEC4", "out_normal")),
)
PROGRAMS = (RAYS, FREE, MEMBER, *lit_points.PROGRAMS)


class SurfelLight:
    """What the receivers of a technique's surfels reflect, and the direct light that they get."""

    def __init__(self):
        self._key: object = None
        self._held: list[images.Image] = []
        self._lit = LitPoints("surfels", each=POINTS)
        self.reflectance: images.Image | None = None
        self.free: dict[str, images.Image] = {}  # how far surfaces run freely around receivers
        self._there: images.Image | None = None  # w: whether there is a surface
        self._white: images.Image | None = None

    @staticmethod
    def size(surfels: Surfels) -> tuple[int, int]:
        """Of images of receivers."""
        return ROW, max(-(-surfels.receiver_count // ROW), 1)

    def update(self, frame: Frame, technique: Technique, surfels: Surfels) -> bool:
        """Shade the receivers anew if surfaces or materials changed; True if so. In the stage `sample`."""
        key = (surfels.changes, frame.materials.fingerprint())
        if key == self._key:
            return False
        self._give()
        self._key = key
        size = self.size(surfels)
        self._white = self._take(size)
        images.Target((self._white,)).clear((1.0 / LIT, 1.0 / LIT, 1.0 / LIT, 0.0))
        rays = images.Target(tuple(images.pool.take(*size, "RGBA32F") for _ in range(2)))
        passes.fullscreen(
            RAYS, rays, textures={"receivers": surfels.receivers},
            constants={"receiver_count": surfels.receiver_count, "offset_size": frame.offset_size},
        )  # fmt: skip
        trace = lambda hits, records: hits.trace(frame, technique, rays.colors, records, path="diffuse")  # noqa: E731
        self._there, unused, self.reflectance = self._lit.shade(frame, technique, rays.colors[1], trace).colors
        self._held += [self._there, self.reflectance]
        self.free = {name: self._take(size) for name in ("free_a", "free_b")}
        passes.fullscreen(
            FREE, images.Target(tuple(self.free.values())),
            textures={**frame.hierarchy("diffuse").textures, "receivers": surfels.receivers},
            blocks={"film_view": frame.view_block},
            constants={"receiver_count": surfels.receiver_count, "offset_size": frame.offset_size},
        )  # fmt: skip
        for image in (*rays.colors, unused):
            images.pool.give(image)
        frame.count(technique, "passes", 2)
        return True

    def begin(self, frame: Frame) -> None:
        self._lit.begin(frame)

    def add_direct(
        self, frame: Frame, technique: Technique, surfels: Surfels, target: images.Target, number: int
    ) -> None:
        """Irradiance over pi of solution `number`, mean over LIT points of each cell, into the first of two images."""
        target.clear()
        size = target.size
        placed = images.Target(tuple(images.pool.take(*size, "RGBA32F") for _ in range(2)))
        for k in range(number * LIT, (number + 1) * LIT):
            passes.fullscreen(
                MEMBER, placed,
                textures={"receivers": surfels.receivers, "members": surfels.members, "shaded": self._there},
                constants={"receiver_count": surfels.receiver_count, "member": k % MEMBERS},
            )  # fmt: skip
            self._lit.light(
                frame, technique, (*placed.colors, self._white), target, surfels.receiver_count, number=k
            )  # fmt: skip
            frame.count(technique, "passes")
        for image in placed.colors:
            images.pool.give(image)

    def _take(self, size: tuple[int, int]) -> images.Image:
        self._held.append(images.pool.take(*size, "RGBA32F"))
        return self._held[-1]

    def _give(self) -> None:
        for image in self._held:
            images.pool.give(image)
        self._held = []

    def release(self) -> None:
        self._give()
        self._lit.release()
        self.__init__()
