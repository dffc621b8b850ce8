"""How each material scatters light below its surface, in the mean: for points that the camera does not see.

As reflectances (reflectance.py): materials that scatter are drawn once, all their surfaces over one another, from two
directions, by the programs that draw how far light spreads where the camera looks.

| cost | once per set of materials and geometry |
|---|---|
| draws | 2 of the meshes of each material that scatters, into 16 x 16 pixels each |

Fails: colour or radius that vary over a surface are their means here.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from ..frame.picture import Frame
from ..gfx import images, passes
from ..scene.materials import SCATTER_IMAGES
from ..scene.overview import DIRECTIONS
from .draw import refracts
from .reflectance import COLUMNS, SIDE, draw_overview, keys_of

BANDS = 3  # of rows in the result, see shaders/subsurface/means.frag.glsl
ANY_PLACE = -1.0  # w of the image of places: where nothing is compared (shaders/surface/scatter.frag.glsl)
MEANS = passes.fullscreen_program(
    "means of scattering",
    "subsurface/means.frag.glsl",
    textures=tuple(("RGBA32F", name) for name in ("spread_length", "scatter_share", "scatter_walk")),
    constants=(("IVEC2", "extent"), ("INT", "rows")),
    outputs=(("VEC4", "out_means"),),
)


class ScatterMeans:
    """The image of means: material m stands at (m & 15, m >> 4) of each of its bands of rows."""

    def __init__(self):
        self._key: object = None
        self.drawings = 0  # how often it was drawn: a number for what the image says
        self.image: images.Image | None = None

    def update(self, frame: Frame, materials: Collection[int]) -> None:
        """Draw `materials` anew if one has changed or its surfaces have."""
        keys = keys_of(frame)
        shown = sorted(set(materials) & set(keys))
        key = len(frame.materials.compiled), len(frame.geometry.placed[0]), [(k, keys[k]) for k in shown]
        if key == self._key:
            return
        self.release()
        self._key = key
        self.drawings += 1
        rows = -(-len(frame.materials.compiled) // COLUMNS)
        self.image = images.pool.take(COLUMNS, BANDS * rows, "RGBA32F")
        size = (COLUMNS * SIDE, 2 * rows * SIDE)
        seen = [images.pool.take(*size, "RGBA32F") for _ in SCATTER_IMAGES]
        target = images.Target(tuple(seen))
        target.clear((0.0, 0.0, 0.0, 0.0))
        anywhere = images.pool.take(*size, "RGBA32F")
        images.Target((anywhere,)).clear((0.0, 0.0, 0.0, ANY_PLACE))
        every = images.upload_list(np.ones((max(len(frame.geometry.placed[0]), 1), 4), np.float32))
        for number, direction in enumerate(DIRECTIONS):
            for k in shown:
                corner = (k % COLUMNS * SIDE, (2 * (k // COLUMNS) + number) * SIDE)
                draw_overview(
                    frame, target, (*corner, SIDE, SIDE), k, direction, frame.materials.scatter_program(k),
                    {"surface_position": anywhere, "scatter_objects": every}, {"glass_bends": int(refracts(frame))},
                )  # fmt: skip
        names = ("spread_length", "scatter_share", "scatter_walk")
        passes.fullscreen(
            MEANS, images.Target((self.image,)),
            textures=dict(zip(names, (seen[0], seen[1], seen[3]))),
            constants={"extent": (SIDE, 2 * SIDE), "rows": rows},
        )  # fmt: skip
        for image in (*seen, anywhere):
            images.pool.give(image)

    def release(self) -> None:
        """Drop GPU resources."""
        if self.image is not None:
            images.pool.give(self.image)
        self.image = self._key = None
