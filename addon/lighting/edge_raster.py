"""Layers before the points of a light by rasterised wedges: path A of depth complexity sampling, beside the gather.

Each silhouette edge's wedge is drawn as a prism of eight triangles, of which those that face away cover each pixel
once, wherever the eye stands. A fragment asks its pixel's receiver for 64 points, as the gather does, and adds the
edge's weight to the counters of those that it hides, by blending: four targets of four channels of four digits of base
64, exact in float32 as long as a counter stays between -BIAS and 63 - BIAS.

| cost | per light and sample |
|---|---|
| bytes | 64 per pixel of targets; 384 per edge |
| per fragment | what the gather takes per pixel and edge, without rejecting by boxes, and 64 bytes blended |

It is no technique: it says whether the gather is right (tests/techniques/test_edge_raster.py), from the same receivers
and records by other hardware, and what it would cost (docs/log/2026-11-26-edges.md). Orthographic eyes are left out.

Source: Forest, Barthe, Paulin, "Accurate shadows by depth complexity sampling", Computer Graphics Forum 27(2), 2008.
"""

from __future__ import annotations

import numpy as np

from ..frame.picture import Frame
from ..gfx import images, passes
from ..gfx.library import Program
from ..scene.view import VIEW
from . import edge_tiles
from .edge_tiles import LIGHT_BLOCK, Lit

POINTS, BIAS = 64, 24
CORNERS = 24  # of eight triangles
OUTWARDS = 2e-4  # by which prisms are widened, as a share of the way from any caster to any receiver
WEDGES = Program(
    name="layers by wedges",
    vertex="edges/wedges.vert.glsl",
    fragment="edges/wedges.frag.glsl",
    inputs=edge_tiles.COUNT_INPUTS,
    varyings=(("flat", "FLOAT", "flat_edge"),),
    outputs=tuple(("VEC4", f"out_{letter}") for letter in "abcd"),
    textures=tuple(("RGBA32F", name) for name in ("wedge_corners", "edge_records", "receivers", "light_pattern")),
    blocks=((VIEW, "film_view"), LIGHT_BLOCK),
)


def prisms(wedges: np.ndarray, reach: float) -> np.ndarray:
    """(E, CORNERS, 4) float32 corners of triangles around wedges (E, 4, 4: front, back, sides), turned outwards, as far
    as `reach`. w = 2: clip coordinates of a triangle over the whole picture, where there is no wedge."""
    n, o = wedges[..., :3].astype(np.float64), wedges[..., 3].astype(np.float64) - OUTWARDS * reach
    some = np.linalg.norm(n, axis=2).min(axis=1) > 0.5
    rows = np.zeros((len(wedges), CORNERS, 4), np.float32)
    rows[:, :, 3] = 2.0
    rows[:, 0, :2], rows[:, 1, :2], rows[:, 2, :2] = (-1, -1), (-1, 3), (3, -1)  # seen from behind
    n, o = n[some], o[some]
    front, back, left, right = n[:, 0], n[:, 1], n[:, 2], n[:, 3]

    def corner(side: int) -> np.ndarray:
        planes = np.stack([front, back, n[:, side]], axis=1)
        return np.linalg.solve(planes, -np.stack([o[:, 0], o[:, 1], o[:, side]], axis=1)[..., None])[..., 0]

    def away(one: np.ndarray, side: np.ndarray, other: np.ndarray) -> np.ndarray:
        way = np.cross(one, side)
        way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-300)
        return way * np.where((way * other).sum(axis=1, keepdims=True) <= 0.0, 1.0, -1.0)

    first, second, far = corner(2), corner(3), 4.0 * reach
    points = np.stack(
        [
            first, second,
            first + far * away(front, left, back), second + far * away(front, right, back),
            first + far * away(back, left, front), second + far * away(back, right, front),
        ], axis=1,
    )  # fmt: skip
    faces = np.array([(0, 1, 3), (0, 3, 2), (0, 1, 5), (0, 5, 4), (0, 2, 4), (1, 3, 5), (2, 3, 5), (2, 5, 4)])
    triangles = points[:, faces]
    normal = np.cross(triangles[:, :, 1] - triangles[:, :, 0], triangles[:, :, 2] - triangles[:, :, 0])
    outwards = (normal * (triangles.mean(axis=2) - points.mean(axis=1)[:, None])).sum(axis=2) >= 0.0
    turned = np.where(outwards[..., None, None], triangles, triangles[:, :, ::-1])
    rows[some, :, :3], rows[some, :, 3] = turned.reshape(-1, CORNERS, 3), 1.0
    return rows


def draw(frame: Frame, lit: Lit, corners: images.Image, pattern: images.Image, target: images.Target) -> None:
    """Add all edges of a light to four cleared targets. The block's shape must be IN_PLANE or a disc that faces."""
    textures = {
        "wedge_corners": corners, "edge_records": lit.records, "receivers": lit.receivers, "light_pattern": pattern,
    }  # fmt: skip
    blend = {"blend": "ADDITIVE_PREMULT", "depth_test": "NONE", "depth_write": False, "cull": "FRONT"}
    with passes.drawing(target, **blend):
        shader = passes.get(WEDGES)
        shader.bind(textures=textures, blocks={"film_view": frame.view_block, "edge_light": lit.block})
        passes.draw(shader, edge_tiles.corner_batch(CORNERS), lit.found.count)


def layers(counters: list[np.ndarray], centre: np.ndarray) -> np.ndarray:
    """(H, W, POINTS) layers before the points: the four targets (H, W, 4), cleared to digits of BIAS, and the layers
    before the light's centre (H, W)."""
    values = np.concatenate(counters, axis=-1).astype(np.float64)
    digits = [np.floor(values / 64.0**j) % 64 for j in range(4)]
    changes = np.stack(digits, axis=-1).reshape(*values.shape[:2], POINTS) - BIAS
    return changes + np.rint(centre)[..., None]


def cleared() -> float:
    """What a channel holds before any edge."""
    return float(BIAS * (64.0 ** np.arange(4)).sum())
