"""Light that leaves surfaces below which it scatters, for whoever sees them but the camera: bounces, mirrors, fog.

In samples in which somebody asks, walks from points of the mesh (scene/scatter_points.py) find what leaves there of
the direct light of all points: from all of them in the first such samples, later from every `stride`-th row in turn.
Their mean over the walks so far and over points around, within some .7 of a free path, of colours 2.5 times that,
stands with a grid of voxels around each object in one list, an image, so that rays find it where they meet a surface
(shaders/subsurface/leaving.glsl), in place of what a diffuse surface would send. The list is written anew when the
number of samples has doubled, or grown by RENEWED. Of indirect light they send on what leaves on the side where it came
from.

| cost | per sample |
|---|---|
| rays | a point: 1 / `stride`, at first WALKS, times about 2 / (1 - albedo)^(1/2) + 2 |
| passes | 1, and 1 where the list is written |
| bytes | 176 a point, up to 32 for each of 64^3 voxels an instance |

Bias: even over a point's cell; colours and radii are the means of their material; of indirect light what leaves on the
other side is lost. Burley's method sends as a diffuse surface does: so it does in Cycles, but in glass, where only the
light that glass mirrors back is added here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..frame.picture import Frame
from ..frame.technique import Service
from ..gfx import images, passes
from ..gfx.interface import Interface
from ..scene import acceleration
from ..scene.scatter_points import RANGE, ROW, ScatterPoints
from ..scene.view import VIEW
from ..surfaces.hits import Hits

WALKS = 4  # of a point in a picture's first sample, 1 in later ones: the list of early samples is shown most often
WHOLE = 8  # times first that all points have walks
RENEWED = 16  # samples after which the list is written anew, at most
WIDTH, CELL_TEXELS, FIRST_CELL = images.LIST_WIDTH, 5, images.LIST_WIDTH
LEFT = ("sent", "slope", "same", "red", "green", "blue")
LEAVING = passes.fullscreen_program(
    "light that leaves points",
    "subsurface/leaving.frag.glsl",
    textures=(
        *acceleration.HIERARCHY_TEXTURES,
        ("RG32F", "trace_owners"),
        *(("RGBA32F", name) for name in (
            "point_position", "point_normal", "point_instances", "cell_direct", "cell_shapes", "scatter_objects",
            "scatter_near", "scatter_means", "walk_lobes", "surface_position", "cell_coat",
        )),
    ),
    blocks=((VIEW, "film_view"),),
    constants=(
        ("INT", "first_object"), ("INT", "first_leaf"), ("INT", "walks"), ("INT", "first_walk"), ("INT", "stride"),
        ("INT", "draw_number"), ("INT", "in_glass"),
        ("FLOAT", "offset_size"),
    ),
    defines=(("WALK_LOBES", "1"), ("RANGE", str(RANGE))),
    outputs=tuple(("VEC4", f"out_{name}") for name in LEFT),
)  # fmt: skip
LIST = passes.fullscreen_program(
    "list of light that leaves points",
    "subsurface/leaving_list.frag.glsl",
    textures=tuple(
        ("RGBA32F", name)
        for name in (
            *(f"cell_{name}" for name in LEFT),
            "cells",
            "point_position",
            "point_normal",
            "point_instances",
            "scatter_objects",
            "scatter_means",
        )
    ),
    constants=(("INT", "first_object"),),
    outputs=(("VEC4", "out_texel"),),
)
PROGRAMS = (LEAVING, LIST)


@dataclass(frozen=True)
class LeavingService(Service):
    """What leaves surfaces in the sample that runs; `image` makes it when first asked."""

    name = "light that leaves surfaces"
    image: Callable[[], images.Image | None]


def stride_of(drawn: int) -> int:
    """Of how many rows of points one has walks, where this was `drawn` so often before: all of them at first, of 64
    times an eighth. It goes by what was drawn: how many samples follow may be unknown. After N times points have about
    2 N^(1/2) walks, from 8 on, and WALKS - 1 more; all rows have two turns and more before the stride grows."""
    return 1 if drawn < WHOLE else int(drawn**0.5)


def _leaving(frame: Frame) -> dict[str, images.Image] | None:
    service = frame.service(LeavingService)
    image = None if service is None else service.image()
    return None if image is None else {"leaving_light": image}


LEAVES = Interface("leaving", "subsurface/leaving.glsl", (("RGBA32F", "leaving_light"),), _leaving)


class LeavingLight:
    """The list of a picture. `update` when points have changed, `draw` in each sample."""

    def __init__(self):
        self.image: images.Image | None = None
        self._rows = 0  # of the image, that points take
        self._sums: images.Target | None = None  # of LEFT, over the samples so far
        self._drawn = self._walked = 0  # samples in these, walks of a point in which none is passed over

    def begin(self) -> None:
        """A picture begins."""
        self._give()

    def update(self, points: ScatterPoints, walked: Any) -> None:
        """Lay out the list for these points. `walked`: numbers of the materials whose light is walked."""
        self._rows = -(-points.rows * ROW * CELL_TEXELS // WIDTH)
        cells = np.zeros((self._rows * WIDTH, 4), np.float32)
        first = FIRST_CELL + len(cells)
        instances = np.array([row for grid in points.grids for row in grid], np.float32).reshape(-1, 4)
        head = np.zeros((WIDTH, 4), np.float32)
        head[0] = first, len(instances) // 2, first + len(instances), 0
        flags = head[1:].reshape(-1)
        flags[[k for k in walked if k < len(flags)]] = 1.0
        self.image = images.upload_list(np.concatenate([head, cells, instances, points.voxels]))

    def draw(self, frame: Frame, points: ScatterPoints, textures: dict[str, images.Image], coated: bool = False) -> int:
        """Find what leaves in this sample; returns the number of passes. `textures`: cell_direct, cell_shapes,
        scatter_means, walk_lobes and cell_coat, which says by how much more light enters in glass where `coated`."""
        hierarchy, settings = frame.hierarchy("shadow"), frame.settings
        owners, first_leaf = frame.kept(Hits).owners(frame, hierarchy)
        position, normal = points.surface(frame.sample)
        walks = WALKS if self._drawn == 0 and not settings.schedule.is_draft else 1
        if self._sums is None:
            self._sums = images.Target(tuple(images.pool.take(ROW, points.rows, "RGBA32F") for _ in LEFT))
            self._sums.clear()
        passes.fullscreen(
            LEAVING, self._sums, blend="ADDITIVE_PREMULT",
            textures={
                **hierarchy.textures, **textures, "trace_owners": owners, "point_position": position,
                "point_normal": normal, "point_instances": points.instances, "scatter_objects": points.table,
                "scatter_near": points.near, "surface_position": frame.images["surface.position"],
            },
            blocks={"film_view": frame.view_block},
            constants={
                "first_object": points.first_object, "first_leaf": first_leaf, "offset_size": frame.offset_size,
                "in_glass": int(coated),
                "walks": walks, "first_walk": self._walked,
                "stride": stride_of(self._drawn), "draw_number": self._drawn,
            },
        )  # fmt: skip
        self._drawn, self._walked = self._drawn + 1, self._walked + walks
        if self._drawn % RENEWED and self._drawn & (self._drawn - 1):
            return 1
        passes.fullscreen(
            LIST, images.Target((self.image,)), viewport=(0, 1, WIDTH, self._rows),
            textures={
                **{f"cell_{name}": image for name, image in zip(LEFT, self._sums.colors)}, "point_position": position,
                "point_normal": normal, "point_instances": points.instances, "scatter_objects": points.table,
                "scatter_means": textures["scatter_means"], "cells": points.cells[frame.sample % len(points.cells)],
            },
            constants={"first_object": points.first_object},
        )  # fmt: skip
        return 2

    def _give(self) -> None:
        if self._sums is not None:
            for image in self._sums.colors:
                images.pool.give(image)
        self._sums, self._drawn, self._walked = None, 0, 0

    def release(self) -> None:
        """Drop GPU resources."""
        self._give()
        self.__init__()
