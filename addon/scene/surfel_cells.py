"""Cells of surfaces: triangles as discs of about equal area, whatever their tessellation.

Triangles are covered by an even cloud of points in proportion to area, CLOUD for each surfel wanted. Farthest point
sampling picks centres out of it (distance in place and, so that thin sheets keep both faces, in normal); a cell is what
is nearest to a centre, its surfel stands at the point nearest to the cell's middle, and its disc covers all points of
the cell; where the mesh ends, or bends sharply, it ends too (disc_edges.py). So discs leave no holes wider than a
seventh of a cell: a mesh of two triangles has as many surfels as one of a million with the same area.

Area farther than `reach` from an eye counts by (reach / distance)^4, as in surface_points.py but steeper, so that a
kilometre of ground does not take all.

CPU: about 100 us a surfel, half of it for how much of its disc is surface.

Sources: Dong, Kautz, Theobalt and Seidel 2007 (surfels and their hierarchy at vertices; here apart from the
tessellation, which the thesis names as future work); Eldar et al. 1997 (farthest point sampling)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..sampling.sequence import bits
from .disc_edges import CLIPS, borders, clipped, filled
from .pieces import areas_and_normals, farthest, halved

MEMBERS = 8  # points of its cell at which a surfel is lit, in turn
CLOUD = 16  # points of the cloud for each surfel
BLOCK = 96  # surfels that are picked together
TURN = 2.0  # cell sizes by which two opposite faces count as apart: no cell goes round an edge
MARGIN = 0.6  # spacings of the cloud that a disc reaches beyond the points of its cell
MOST_PIECES, ROUNDS = 100_000, 64  # of triangles that are halved, and how often


@dataclass(frozen=True)
class Cells:
    """Surfels of some surface: places (N, 3), unit normals (N, 3), radii (N,), areas (N,) m2, opacities (N,), MEMBERS
    places in the cell of each and normals there (N, MEMBERS, 3), CLIPS edges (N, CLIPS, 4) as unit direction and
    distance at which its disc ends, whether only the front is seen (N,) bool, and whether that is so since the back
    of a sheet sees nothing (N,) bool."""

    place: np.ndarray
    normal: np.ndarray
    radius: np.ndarray
    area: np.ndarray
    opacity: np.ndarray
    clips: np.ndarray
    members: np.ndarray
    member_normals: np.ndarray
    closed: np.ndarray
    sheet: np.ndarray

    def __len__(self) -> int:
        return len(self.place)

    def take(self, order: np.ndarray) -> Cells:
        return Cells(*(values[order] for values in vars(self).values()))

    @classmethod
    def joined(cls, parts: list[Cells]) -> Cells:
        parts = parts or [NOTHING]
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in vars(parts[0])))


NOTHING = Cells(
    np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0), np.zeros(0), np.zeros((0, CLIPS, 4)),
    np.zeros((0, MEMBERS, 3)),
    np.zeros((0, MEMBERS, 3)), np.zeros(0, bool), np.zeros(0, bool),
)  # fmt: skip


def sampled(
    corners: np.ndarray, opacity: np.ndarray, count: int, closed: bool, reach: float = np.inf, eye=None
) -> Cells:
    """`count` surfels of triangles (T, 3, 3), by area or, beyond `reach`, by how large it looks from `eye`."""
    edges_of_mesh = borders(corners)
    triangle = np.arange(len(corners))
    if np.isfinite(reach):
        corners, triangle = halved(corners, eye, reach, ROUNDS, MOST_PIECES)
    areas, normals = areas_and_normals(corners)
    share = distance_share(corners, reach, eye) if np.isfinite(reach) else np.ones(len(corners))
    edges = np.concatenate([[0.0], np.cumsum(areas * share)])
    if not edges[-1] > 0.0 or count < 1:
        return NOTHING
    number = count * CLOUD
    u, v, w = (bits(np.arange(number), dimension) / 2.0**32 for dimension in range(3))
    chosen = np.clip(np.searchsorted(edges, u * edges[-1], side="right") - 1, 0, len(areas) - 1)
    root, w = np.sqrt(v)[:, None], w[:, None]
    a, b, c = corners[chosen].transpose(1, 0, 2)
    place, normal = (1 - root) * a + root * (1 - w) * b + root * w * c, normals[chosen]
    area = edges[-1] / number / share[chosen]  # that each point of the cloud stands for
    size = np.sqrt(area * CLOUD)[:, None]
    parts = [
        _cells(block, place, normal, area, opacity[triangle[chosen]], TURN / 2 * size * normal)
        for block in _blocks(place, number)
    ]
    *out, members, turned = (np.concatenate(values) for values in zip(*parts))
    clips = clipped(*out[:3], *edges_of_mesh)
    out[4] = out[4] * filled(*out[:3], clips, place, normal, area)
    kinds = np.full(len(members), closed), np.zeros(len(members), bool)
    return Cells(*out, clips, members, turned, *kinds)


def distance_share(pieces: np.ndarray, reach: float, eye: np.ndarray) -> np.ndarray:
    return (reach / np.maximum(np.linalg.norm(pieces.mean(axis=1) - eye, axis=1), reach)) ** 4


def _blocks(place: np.ndarray, number: int) -> list[np.ndarray]:
    """Numbers of points in boxes of up to BLOCK surfels, each split in the middle of its longest side."""
    done, open_ = [], [np.arange(number)]
    while open_:
        block = open_.pop()
        if len(block) <= BLOCK * CLOUD:
            done.append(block)
            continue
        axis = np.ptp(place[block], axis=0).argmax()
        order = block[np.argsort(place[block, axis], kind="stable")]
        half = len(order) // 2 // CLOUD * CLOUD
        open_ += [order[:half], order[half:]]
    return done


def _cells(block, place, normal, area, opacity, turned) -> tuple[np.ndarray, ...]:
    """Places, normals, radii, areas, opacities and members of the surfels of a block of the cloud."""
    count = max(len(block) // CLOUD, 1)
    place, normal, area, opacity = place[block], normal[block], area[block], opacity[block]
    keys = np.concatenate([place, turned[block]], axis=1)
    _, owner = farthest(keys - keys.mean(axis=0), count)
    owner = np.unique(owner, return_inverse=True)[1].reshape(-1)
    count = int(owner.max()) + 1
    members = np.maximum(np.bincount(owner, minlength=count), 1)
    middle = np.stack([np.bincount(owner, place[:, k], minlength=count) for k in range(3)], axis=1) / members[:, None]
    off = np.linalg.norm(place - middle[owner], axis=1)
    order = np.lexsort((off, owner))
    first = np.concatenate([[0], np.cumsum(np.bincount(owner, minlength=count))[:-1]])
    stands = order[np.minimum(first, len(order) - 1)]  # the member nearest to the cell's middle
    radius = np.zeros(count)
    np.maximum.at(radius, owner, np.linalg.norm(place - place[stands][owner], axis=1))
    # The middle, then others evenly out of the cell.
    spread = first[:, None] + (bits(np.arange(MEMBERS), 0) * members[:, None] // 2**32).astype(np.int64)
    some = order[np.minimum(spread, len(order) - 1)]
    sums = np.bincount(owner, area, minlength=count)
    radius = np.maximum(radius + MARGIN * np.sqrt(sums / members), np.sqrt(sums / np.pi))
    cover = np.bincount(owner, opacity * area, minlength=count) / np.maximum(sums, 1e-300)
    return place[stands], normal[stands], radius, sums, cover, place[some], normal[some]
