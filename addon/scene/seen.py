"""Which sides of triangles see any other surface: what sees none exchanges no light, and nothing sees it.

POINTS points are spread over all surfaces by area (area_points.py), and from both sides of each RAYS rays go out evenly
in cosine-weighted directions. A side of a triangle counts as unseen where less than LEAST of all the rays from it meet
something. Triangles without a point are small, and see what either of their neighbours in the mesh's order sees. The
walls of a room in an empty world have outer faces that see nothing: half of their area.

| cost, when something moves | |
|---|---|
| rays | 2 POINTS x RAYS, one pass, and a readback of 2 POINTS numbers |

Fails: an outer face that sees one thin thing far away, a mast or a wire, counts as unseen.
"""

from __future__ import annotations

import numpy as np

from ..gfx import images, passes
from . import acceleration
from .area_points import Surfaces, spread
from .on_gpu import SceneOnGpu
from .view import VIEW

POINTS, RAYS, LEAST = 4096, 24, 0.01
UNSEEN = 1 / 16  # what area counts that sees nothing from either side, where points or surfels are shared out
ROW = 128
SEES = passes.fullscreen_program(
    "what sides of triangles see",
    "trace/sees.frag.glsl",
    textures=(*acceleration.HIERARCHY_TEXTURES, ("RGBA32F", "places"), ("RGBA32F", "normals")),
    blocks=((VIEW, "film_view"),),
    constants=(("FLOAT", "offset_size"),),
    defines=(("RAYS", str(RAYS)),),
    outputs=(("FLOAT", "out_seen"),),
)


def seen_sides(frame: SceneOnGpu) -> dict[int, np.ndarray]:
    """By id of the instance (T, 2) bool, for each triangle of its mesh whether its front, by its winding in the world,
    and its back see anything. Instances that rays of the diffuse path do not meet are left out."""
    surfaces = Surfaces.of(frame)
    counts = [int((surfaces.owner == k).sum()) for k in range(len(surfaces.shown))]
    parts = np.split(seen_triangles(frame, surfaces), np.cumsum(counts)[:-1])
    return {id(one): part for one, part in zip(surfaces.shown, parts)}


def seen_triangles(frame: SceneOnGpu, surfaces: Surfaces) -> np.ndarray:
    """The same of all triangles, (T, 2)."""
    points = spread(surfaces, POINTS, 0)
    seen = np.ones((len(surfaces.owner), 2), bool)
    if len(points):
        position, normal, _ = points.placed(surfaces)
        good = np.isfinite(position).all(axis=1) & np.isfinite(normal).all(axis=1)
        hits = _share_that_meets(frame, np.where(good[:, None], position, 0.0), np.where(good[:, None], normal, 0.0))
        asked = np.bincount(points.triangle, good, minlength=len(seen))
        for side in range(2):
            sums = np.bincount(points.triangle, hits[:, side] * good, minlength=len(seen))
            seen[:, side] = sums / np.maximum(asked, 1) >= LEAST
        _fill(seen, asked > 0, surfaces.owner)
    return seen


def _fill(seen: np.ndarray, known: np.ndarray, owner: np.ndarray) -> None:
    """What is not known is as the known triangles of the same instance before it and behind it; True where none is."""
    unknown, places = np.flatnonzero(~known), np.flatnonzero(known)
    if not len(places):
        seen[unknown] = True
        return
    behind = np.minimum(np.searchsorted(places, unknown), len(places) - 1)
    beside = [places[np.maximum(behind - 1, 0)], places[behind]]
    own = [owner[one] == owner[unknown] for one in beside]
    found = [seen[one] & same[:, None] for one, same in zip(beside, own)]
    seen[unknown] = found[0] | found[1] | ~(own[0] | own[1])[:, None]


def _share_that_meets(frame: SceneOnGpu, position: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """(N, 2) of the rays from the front and the back of points."""
    size = (ROW, 2 * POINTS // ROW)
    rows = [np.zeros((2 * POINTS, 4), np.float32) for _ in range(2)]
    count = len(position)
    rows[0][0 : 2 * count, :3] = np.repeat(position, 2, axis=0)
    rows[1][0 : 2 * count : 2, :3], rows[1][1 : 2 * count : 2, :3] = normal, -normal
    places, normals = (images.upload(values.reshape(size[1], size[0], 4)) for values in rows)
    with images.borrowed(*size, "R32F") as target:
        passes.fullscreen(
            SEES, target, textures={**frame.hierarchy("diffuse").textures, "places": places, "normals": normals},
            blocks={"film_view": frame.view_block}, constants={"offset_size": frame.offset_size},
        )  # fmt: skip
        return images.read(target.colors[0]).reshape(-1)[: 2 * count].reshape(count, 2).astype(np.float64)
