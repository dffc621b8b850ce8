"""Soft textured shadow volumes: soft shadows of triangles whose opacity varies, by their opacity maps.

A leaf or a fence on a card is two triangles and a picture, and edges see its outline alone. So each such triangle is
asked by the receivers that it can hide a part of a light from: every point of the light is projected through it onto
its plane, and the opacity there decides. The result is a set of points that are hidden, to be joined with what opaque
casters hide (depth_complexity.comp.glsl): where triangles overlap nothing counts twice.

Opacity is that of scene/opacity_maps.py, a tile of cells in the triangle's own axes, 256 levels each: no UVs, and any
material. What is partly opaque hides a point at random, so that two sheets of one half let a quarter pass.

Which triangles matter to a tile of pixels is told by balls: around the triangle, around the tile's receivers, and
around the light. This holds for triangles seen edge on, too, where a volume of planes would need a second one.

| cost | |
|---|---|
| record | 80 bytes a triangle, once until something moves |
| words | 4 bytes per 32 triangles and tile, 1 fetch per triangle and tile |
| pixel | per triangle in its tile 5 fetches; per point that is still seen 9 products, and 1 fetch where it is met |

Bias: opacity is constant in a cell, whose size opacity_maps.py chooses by area.

Source: Forest, Barthe, Paulin, "Soft textured shadow volume", CGF 28(4), 2009; corrections in shaders/edges/cards.glsl.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..frame.picture import Frame
from ..gfx import images
from ..gfx.library import Program
from ..scene.edges import NO_AREA
from ..scene.opacity_maps import TriangleOpacity
from .edge_tiles import LIGHT_BLOCK, TILE_TEXTURES

CARD_TEXELS = 5
CARD_TEXTURES = (("RGBA32F", "card_records"), ("RGBA32F", "card_tiles"), ("UINT_2D", "card_words"))
CARD_WORDS = Program(
    name="cards of tiles",
    compute="edges/card_words.comp.glsl",
    textures=(("RGBA32F", "card_records"), *TILE_TEXTURES),
    images=(("card_words", "R32UI", "UINT_2D", "WRITE"),),
    blocks=(LIGHT_BLOCK,),
)


@dataclass(frozen=True)
class Cards:
    """Triangles that pass light in places, on the GPU."""

    count: int
    records: images.Image
    tiles: images.Image  # texels of OpacityMaps


def card_records(corners: np.ndarray, opacity: np.ndarray) -> np.ndarray:
    """(T, CARD_TEXELS, 4) float32 of triangles (T, 3, 3) with `opacity` (T, 4): first texel of the tile or -1, half its
    row (negative: mirrored), opacity of front and back. Rows of the inverse of [e1 e2 -n], which are closed forms."""
    v = corners.astype(np.float64)
    e1, e2 = v[:, 1] - v[:, 0], v[:, 2] - v[:, 0]
    across = np.cross(e1, e2)
    area = np.linalg.norm(across, axis=1, keepdims=True)
    n = across / np.maximum(area, 1e-300)
    rows = np.zeros((len(v), CARD_TEXELS, 4), np.float32)
    rows[:, 0, :3] = np.cross(e2, n) / np.maximum(area, 1e-300)
    rows[:, 1, :3] = np.cross(n, e1) / np.maximum(area, 1e-300)
    rows[:, 2, :3] = -n
    rows[:, :3, 3] = v[:, 0]
    rows[:, 3] = opacity
    # The middle of the longest side, or of all corners where that reaches less far.
    middle = v.mean(axis=1)
    for a, b in ((0, 1), (1, 2), (2, 0)):
        other = (v[:, a] + v[:, b]) / 2
        better = _reach(v, other) < _reach(v, middle)
        middle = np.where(better[:, None], other, middle)
    rows[:, 4, :3] = middle
    rows[:, 4, 3] = _reach(v, middle) * (1.0 + 1e-5)
    return rows


def _reach(corners: np.ndarray, middle: np.ndarray) -> np.ndarray:
    return np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)


class CardCache:
    """The scene's cards until geometry, materials or their opacity changes."""

    def __init__(self):
        self._known: tuple[object, Cards | None] = ((), None)

    def cards(self, frame: Frame) -> Cards | None:
        """None where nothing passes light in places."""
        instances, meshes, materials = frame.geometry.placed
        stochastic = np.array([bool(material.casts_stochastically) for material in materials], bool)
        if not stochastic.any():
            return None
        maps = frame.opacity_maps
        opacity = tuple(material.opacity for material in materials)
        key = (frame.geometry.changes, maps.changes, tuple(frame.geometry.origin), stochastic.tobytes(), opacity)
        if self._known[0] != key:
            self._known = (key, self._made(frame, instances, meshes, materials, stochastic, maps))
        return self._known[1]

    def _made(self, frame, instances, meshes, materials, stochastic, maps) -> Cards | None:
        corners, opacity = [], []
        mean = np.array([material.opacity for material in materials], float)
        for instance in instances:
            mesh = meshes[instance.mesh]
            if not instance.visibility.shadow or not mesh.triangle_count or not np.isfinite(instance.matrix).all():
                continue
            material = mesh.triangle_materials(instance.materials)
            own = np.flatnonzero(stochastic[material])
            if not len(own):
                continue
            matrix = instance.matrix[:3].astype(np.float64)
            world = mesh.positions.astype(np.float64) @ matrix[:, :3].T + (matrix[:, 3] - frame.geometry.origin)
            placed = world[mesh.corner_vertices[mesh.triangle_corners[own]]]
            looks = _looks(own, mean[material[own]], maps.of(instance), maps.texels, np.linalg.det(matrix[:, :3]) < 0)
            doubled = np.linalg.norm(np.cross(placed[:, 1] - placed[:, 0], placed[:, 2] - placed[:, 0]), axis=1)
            kept = (doubled > NO_AREA * frame.geometry.size**2) & np.isfinite(doubled)
            kept &= (looks[:, 0] >= 0) | (looks[:, 2:].max(axis=1) > 0)  # what is empty all over hides nothing
            corners.append(placed[kept].astype(np.float32))
            opacity.append(looks[kept])
        count = sum(map(len, corners))
        if not count:
            return None
        records = card_records(np.concatenate(corners), np.concatenate(opacity))
        tiles = maps.texels if len(maps.texels) else np.zeros((1, 4), np.float32)
        return Cards(count, images.upload_list(records.reshape(-1, 4)), images.upload_list(tiles))

    def release(self) -> None:
        self._known = ((), None)


def _looks(own: np.ndarray, mean: np.ndarray, known: TriangleOpacity | None, texels, mirrored: bool) -> np.ndarray:
    """(N, 4) as card_records takes them, of triangles `own` of a mesh, whose material has the `mean` opacity (N,)."""
    looks = np.zeros((len(own), 4))
    looks[:, 0] = -1.0
    looks[:, 2:] = mean[:, None]
    if known is None:
        return looks
    measured = known.measured[own]
    sides = known.sides[own][:, ::-1] if mirrored else known.sides[own]
    looks[measured, 2:] = sides[measured]
    tiled = measured & (known.tile[own] > 0)
    tile = known.tile[own][tiled]
    looks[tiled, 0] = texels[tile, 0]
    looks[tiled, 1] = texels[tile, 1] * (-1.0 if mirrored else 1.0)
    return looks
