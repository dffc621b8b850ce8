"""Points on all surfaces, spread by area, wherever the camera looks: where light is stored that others gather.

The largest triangles, up to half as many as there are points, are cut into pieces: one each, and what points are left
by area; always the longest edge of a piece and in proportion to the points on both sides. Each point stands for its
piece, anywhere in it. So light neither leaks between points nor overhangs where a thing ends. For the other triangles,
and those that let light through, points stand for discs (point_tree.py), as many as their area's share: laid end to
end, each as long as its area times its opacity, they have points at equal steps along that line; those of one triangle
are a stretch of the R2 sequence (Roberts 2018), which spreads 2 points as it does 2000. Of discs of 1.5 times the
area's radius about them, 0.4 % of a square is free. On meshes whose triangles have about one point each it is 1 to 4 %:
a stretch knows nothing of those beside it. A run takes other cuts, places and stretches.

A point knows its triangle and place in it: where a mesh has been deformed or moved, it moves along, and what it stands
for grows with its triangle.

What rays of the diffuse path cannot meet has no points, and neither has clear glass, which lets light pass.

Made on the CPU: about 2 us a point and 0.3 us a triangle. Points that follow a motion cost the same without the search.

Fails: a ground of a kilometre takes all the points of the room that stands on it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..sampling.sequence import bits
from ..snapshot.scene import Instance
from .on_gpu import SceneOnGpu
from .point_tree import arranged, parting
from .traced_triangles import coverage, world_triangles

PLASTIC = 1.3247179572447460  # the real root of x^3 = x + 1
ALONE = 0.7  # how much nearer to the middle of its triangle a point lies that is the only one
CYCLE = 1 << 20  # where stretches of the sequence begin
OPAQUE = 0.999  # opacity of what is cut into pieces


@dataclass(frozen=True)
class Surfaces:
    """Triangles of the instances `shown`: corners (T, 3, 3) relative to the render origin, opacity (T,), which of
    `shown` each belongs to and its number in the mesh; how many points they have for their area beside others (T,)."""

    shown: tuple[Instance, ...]
    corners: np.ndarray
    opacity: np.ndarray
    owner: np.ndarray
    number: np.ndarray
    rate: np.ndarray | float = 1.0

    @classmethod
    def of(cls, frame: SceneOnGpu) -> Surfaces:
        """Of the frame's snapshot."""
        shown, meshes = shown_of(frame), frame.geometry.placed[1]
        maps = frame.opacity_maps, frame.emission_maps
        corners, look = world_triangles(
            shown, meshes, frame.measured_materials, frame.geometry.origin, "diffuse", *maps
        )
        counts = [meshes[one.mesh].triangle_count for one in shown]
        clear = np.array([m.glass is not None for m in frame.materials.compiled] or [False])
        materials = [meshes[one.mesh].triangle_materials(one.materials) for one in shown]
        passes = clear[np.concatenate(materials)] if materials else np.zeros(0, bool)
        return cls(
            shown,
            corners.astype(np.float64),
            np.where(passes, 0.0, coverage(look[:, 0], maps[0])),
            np.repeat(np.arange(len(shown)), counts),
            np.concatenate([np.arange(count) for count in counts]) if counts else np.zeros(0, int),
        )

    def areas(self) -> np.ndarray:
        """(T,) m2; 0 where a corner is not finite."""
        across = np.cross(self.corners[:, 1] - self.corners[:, 0], self.corners[:, 2] - self.corners[:, 0])
        areas = np.linalg.norm(across, axis=1) / 2
        return np.where(np.isfinite(areas), areas, 0.0)


def shown_of(frame: SceneOnGpu) -> tuple[Instance, ...]:
    """Instances of the frame's snapshot that have points."""
    instances, meshes, _ = frame.geometry.placed
    return tuple(one for one in instances if one.visibility.diffuse and meshes[one.mesh].triangle_count)


@dataclass(frozen=True)
class AreaPoints:
    """Points by triangle (of Surfaces) and barycentric coordinates (N, 2) of its second and third corner; `density`:
    of discs, the points that fall on a square metre of the triangle (N,), when they were spread; `piece` (N, 3, 2): the
    corners of what each stands for, by the same coordinates, NaN: a disc."""

    triangle: np.ndarray
    share: np.ndarray
    density: np.ndarray
    areas: np.ndarray  # (N,) of the triangle then
    piece: np.ndarray

    def __len__(self) -> int:
        return len(self.triangle)

    def joined(self, other: AreaPoints) -> AreaPoints:
        return AreaPoints(*(np.concatenate(pair) for pair in zip(vars(self).values(), vars(other).values())))

    def placed(self, surfaces: Surfaces) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions (N, 3), unit normals by the triangles' winding (N, 3) and the area, m2, that each stands for."""
        corners = surfaces.corners[self.triangle]
        e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        across = np.cross(e1, e2)
        double = np.linalg.norm(across, axis=1)
        position = corners[:, 0] + self.share[:, :1] * e1 + self.share[:, 1:] * e2
        area = double / 2 / np.maximum(self.areas, 1e-300) / np.maximum(self.density, 1e-300)
        own = np.isfinite(self.piece[:, 0, 0])
        area[own] = double[own] * _share_of(self.piece[own])
        return position, across / np.maximum(double, 1e-300)[:, None], area

    def pieces(self, surfaces: Surfaces) -> np.ndarray:
        """Corners (N, 3, 3) of what points stand for, NaN where that is a disc."""
        corners = surfaces.corners[self.triangle][:, None]
        e1, e2 = corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0]
        return corners[:, :, 0] + self.piece[..., :1] * e1 + self.piece[..., 1:] * e2

    def sides(self, surfaces: Surfaces) -> np.ndarray:
        """(N, 3) the second longest edge of each point's triangle, which of half a rectangle is a side of it."""
        corners = surfaces.corners[self.triangle]
        edges = np.roll(corners, -1, axis=1) - corners
        return edges[np.arange(len(edges)), np.argsort(np.linalg.norm(edges, axis=2), axis=1)[:, 1]]


def spread(surfaces: Surfaces, count: int, run: int) -> AreaPoints:
    """`count` points of this run; none where there is no area."""
    areas = surfaces.areas()
    rate = np.broadcast_to(surfaces.rate, areas.shape)
    weights = areas * surfaces.opacity * rate
    total = float(weights.sum())
    if not total > 0:
        return AreaPoints(np.zeros(0, int), np.zeros((0, 2)), np.zeros(0), np.zeros(0), np.zeros((0, 3, 2)))
    whole = np.flatnonzero((surfaces.opacity > OPAQUE) & (areas > 0.0))
    if len(whole) > count // 2:
        whole = np.sort(whole[np.argsort(-weights[whole], kind="stable")[: count // 2]])
    rest = np.ones(len(areas), bool)
    rest[whole] = False
    left = np.where(rest, weights, 0.0)
    discs = min(max(round(count * left.sum() / total), int(left.any())), count - len(whole)) if len(whole) else count
    number = _numbers(weights[whole], count - discs, run)
    return _ordered(surfaces, areas, whole, number, _discs(areas, left, rate, discs, run), run)


def _numbers(weights: np.ndarray, count: int, run: int) -> np.ndarray:
    """How many of `count` pieces each triangle has: one, and more by what it has beyond a point's share."""
    more = np.maximum(weights - weights.sum() / max(count, 1), 0.0)
    more = more if more.any() else weights
    return 1 + np.bincount(_marked(more, count - len(weights), run), minlength=len(weights))


def _ordered(
    surfaces: Surfaces, areas: np.ndarray, whole: np.ndarray, number: np.ndarray, discs: AreaPoints, run: int
) -> AreaPoints:
    """Points for `number` (W,) pieces of the triangles `whole` and for discs, in the order of a tree's leaves."""
    corners = surfaces.corners[whole]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    position, normal, _ = discs.placed(surfaces)
    leaves = np.concatenate([number, np.ones(len(discs), int)])
    order = arranged(
        np.concatenate([corners.mean(axis=1), position]),
        np.concatenate([across / np.maximum(np.linalg.norm(across, axis=1), 1e-300)[:, None], normal]),
        np.concatenate([np.zeros((len(whole), 3)), discs.sides(surfaces)]),
        leaves,
    )
    first = np.zeros(len(order), int)
    first[order] = np.cumsum(leaves[order]) - leaves[order]
    count = int(leaves.sum())
    found = AreaPoints(
        np.zeros(count, int), np.zeros((count, 2)), np.ones(count), np.zeros(count), np.full((count, 3, 2), np.nan)
    )
    for name in ("triangle", "share", "density"):
        getattr(found, name)[first[len(whole) :]] = getattr(discs, name)
    own, leaf, piece = _cut(corners, first[: len(whole)], number)
    a, b, c = piece.transpose(1, 0, 2)
    v, w = (bits(leaf + run * count, dimension)[:, None] / 2.0**32 for dimension in (0, 1))
    root = np.sqrt(v)
    found.triangle[leaf], found.piece[leaf] = whole[own], piece
    found.share[leaf] = (1 - root) * a + root * (1 - w) * b + root * w * c
    found.areas[:] = areas[found.triangle]
    return found


def _discs(areas: np.ndarray, weights: np.ndarray, rate: np.ndarray, count: int, run: int) -> AreaPoints:
    """`count` points for discs on triangles by weight."""
    triangle = _marked(weights, count, run)
    within = np.arange(count) - np.searchsorted(triangle, triangle)  # number of a point among those of its triangle
    number = within + (triangle * 7919 + run * count) % CYCLE
    v, w = np.mod(0.5 + number / PLASTIC, 1.0), np.mod(0.5 + number / PLASTIC**2, 1.0)
    root = np.sqrt(v)
    share = np.stack([root * (1 - w), root * w], axis=1)
    # Where a triangle has one or few, they keep from its rim, so that they do not crowd at that of a neighbour.
    few = np.bincount(triangle, minlength=len(areas))[triangle]
    share = 1 / 3 + (share - 1 / 3) * (1.0 - ALONE / few**1.5)[:, None]
    # Where half the light passes, half as many points stand for their own discs.
    density = count / max(float(weights.sum()), 1e-300) * rate[triangle]
    return AreaPoints(triangle, share, density, areas[triangle], np.full((count, 3, 2), np.nan))


def _marked(weights: np.ndarray, count: int, run: int) -> np.ndarray:
    """(count,) numbers in order: where equal steps fall along weights laid end to end."""
    edges = np.concatenate([[0.0], np.cumsum(weights)])
    marks = (np.arange(count) + bits(run, 0) / 2.0**32) / max(count, 1)
    return np.clip(np.searchsorted(edges, marks * edges[-1], side="right") - 1, 0, max(len(weights) - 1, 0))


def _cut(corners: np.ndarray, first: np.ndarray, count: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pieces of triangles (W, 3, 3), `count` of each for leaves from `first` on: whose (N,), for which leaf (N,), and
    their corners (N, 3, 2). Leaves are parted where nodes of a heap are, each node of one triangle's leaves a piece."""
    own = np.arange(len(corners))
    place = np.zeros((len(own), 3, 2))
    place[:] = (0, 0), (1, 0), (0, 1)
    found = []
    while len(own):
        done = count == 1
        found.append((own[done], first[done], place[done]))
        own, first, count, place = own[~done], first[~done], count[~done], place[~done]
        world = corners[own]
        at = (
            world[:, :1]
            + place[..., :1] * (world[:, 1:2] - world[:, :1])
            + place[..., 1:] * (world[:, 2:] - world[:, :1])
        )
        longest = np.linalg.norm(at - np.roll(at, -1, axis=1), axis=2).argmax(axis=1)
        a, b, c = (place[np.arange(len(place)), (longest + k) % 3] for k in range(3))
        half = parting(first, count)
        middle = a + (b - a) * (half / np.maximum(count, 1))[:, None]
        place = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
        own, first = np.concatenate([own, own]), np.concatenate([first, first + half])
        count = np.concatenate([half, count - half])
    return tuple(np.concatenate(parts) for parts in zip(*found)) if found else (first, first, place)


def _share_of(piece: np.ndarray) -> np.ndarray:
    """Of the triangle's area that pieces have, halved: their areas in barycentric coordinates."""
    e1, e2 = piece[:, 1] - piece[:, 0], piece[:, 2] - piece[:, 0]
    return np.abs(e1[:, 0] * e2[:, 1] - e1[:, 1] * e2[:, 0]) / 2
