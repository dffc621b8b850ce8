"""All surfaces as a few discs and triangles: a scene for those who need many small, coarse pictures of it.

Triangles that are large beside the spacing of the points stand for themselves, once; the rest is stood for by points,
each for a disc of its surface. Those triangles are laid end to end, each as long as its area; point i of a Sobol'
sequence says where on that line, and where in the triangle, it lies. So any aligned run of 2^m points is itself evenly
spread: one map takes one run, another map the next, and their errors differ.

A floor a kilometre wide would take all points of the room that stands on it. Area that is farther than `reach` from the
eye therefore counts by (reach / distance)^2, which is how large it looks; triangles that are long beside their distance
are halved until the share is nearly even over each piece. Points there stand for larger discs.

Made on the CPU, kept until geometry, alpha, the number of points or, by powers of two, the reach changes. Cost: about
1 us per point and 0.3 us per triangle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..gfx import images
from ..sampling.sequence import bits
from .on_gpu import SceneOnGpu
from .pieces import halved, octahedral
from .traced_triangles import coverage, world_triangles

RUNS = 32
COVER = 1.2  # radius of a disc beside that of the area which its point stands for
LARGE = 2.0  # from so many times the area of a point on, a triangle stands for itself
# Middle, squared radius; normal (octahedral), opacity, number of the triangle from 1 on, negative where only its front
# is seen; three corners of the triangle (w of the first is 1), or two of the bounds of the point's object (w is 0).
TEXELS = 5


@dataclass(frozen=True)
class Surfaces:
    """Triangles (T, 3, 3) with the opacity (T,) of each, and with the number (T,) of the object that it belongs to.
    Of objects, `fronts` (O,) says where they show only one side: 1 counter-clockwise, -1 clockwise, 0 both."""

    corners: np.ndarray
    opacity: np.ndarray
    owner: np.ndarray
    fronts: np.ndarray


class SurfacePoints:
    """The points of a renderer's scene: entry i stands at texels 5 i to 5 i + 4 of the list `image`, `triangles` that
    stand for themselves first, then RUNS runs of `points`."""

    def __init__(self):
        self.image: images.Image | None = None
        self.triangles = self.points = 0
        self._key: object = None

    def update(self, frame: SceneOnGpu, points: int, distance: float, path: str = "diffuse") -> bool:
        """Make runs of `points` points of what rays of `path` meet anew if geometry or alpha differ, or `distance`, m,
        of what is seen does much. True if so."""
        reach = float(np.exp2(np.ceil(np.log2(4 * max(distance, 1e-30)))))
        eye = frame.snapshot.camera.matrix[:3, 3] - frame.geometry.origin
        eye = np.round(eye / reach) * reach if np.isfinite(eye).all() else np.zeros(3)
        snapshot, materials, origin = frame.snapshot, frame.measured_materials, frame.geometry.origin
        maps = frame.opacity_maps
        key = (
            tuple((i.mesh, snapshot.meshes[i.mesh].version, i.matrix.tobytes(), i.materials,
                   getattr(i.visibility, path)) for i in snapshot.instances),
            tuple(m.opacity if m.transparent else 1.0 for m in materials), maps.changes,
            tuple(origin), tuple(eye), reach, points, path,
        )  # fmt: skip
        if key == self._key:
            return False
        shown = [
            i for i in snapshot.instances if getattr(i.visibility, path) and snapshot.meshes[i.mesh].triangle_count
        ]
        known = maps, frame.emission_maps
        corners, look = world_triangles(shown, snapshot.meshes, materials, origin, path, *known)
        meshes = [snapshot.meshes[i.mesh] for i in shown]
        surfaces = Surfaces(
            corners, coverage(look[:, 0], maps),
            np.repeat(np.arange(len(shown)), [mesh.triangle_count for mesh in meshes]),
            np.array([np.sign(np.linalg.det(i.matrix[:3, :3])) * frame.geometry.is_closed(m)
                      for i, m in zip(shown, meshes)]),
        )  # fmt: skip
        large, small = spread(surfaces, points, eye, reach)
        self.image = images.upload_list(np.concatenate([large, small]).reshape(-1, 4))
        self.triangles, self.points = len(large), len(small) // RUNS
        self._key = key
        return True

    def release(self) -> None:
        self.__init__()


def spread(surfaces: Surfaces, points: int, eye: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Triangles that stand for themselves, (L, TEXELS, 4), and RUNS x `points` points for the rest, or none."""
    pieces, triangle = halved(surfaces.corners.astype(np.float64), eye, reach)
    across = np.cross(pieces[:, 1] - pieces[:, 0], pieces[:, 2] - pieces[:, 0])
    double = np.linalg.norm(across, axis=1)
    share = (reach / np.maximum(np.linalg.norm(pieces.mean(axis=1) - eye, axis=1), reach)) ** 2
    weight = double / 2 * share
    weight = np.where(np.isfinite(weight), weight, 0.0)
    order = np.argsort(-weight, kind="stable")[:points]
    rest = np.maximum(weight.sum() - np.cumsum(weight[order]), 0.0)
    large = np.flatnonzero((weight[order] > LARGE * rest / points) & (weight[order] > 0))
    stands = order[: large[-1] + 1] if len(large) else order[:0]  # the largest, until the rest is small beside them
    weight[stands] = 0.0
    own = np.zeros((len(stands), TEXELS, 4))
    _describe(own, surfaces, triangle[stands], across[stands], double[stands])
    middle = pieces[stands].mean(axis=1)
    own[:, 0, :3] = middle
    own[:, 0, 3] = (np.linalg.norm(pieces[stands] - middle[:, None], axis=2) ** 2).max(axis=1, initial=0.0)
    own[:, 2:, :3], own[:, 2, 3] = pieces[stands], 1.0

    edges = np.concatenate([[0.0], np.cumsum(weight)])
    if not edges[-1] > 0:
        return own.astype(np.float32), np.zeros((0, TEXELS, 4), np.float32)
    u, v, w = (bits(np.arange(RUNS * points), dimension) / 2.0**32 for dimension in range(3))
    piece = np.clip(np.searchsorted(edges, u * edges[-1], side="right") - 1, 0, len(pieces) - 1)
    root, w = np.sqrt(v)[:, None], w[:, None]
    a, b, c = pieces[piece].transpose(1, 0, 2)
    out = np.zeros((len(piece), TEXELS, 4))
    _describe(out, surfaces, triangle[piece], across[piece], double[piece])
    out[:, 0, :3] = (1 - root) * a + root * (1 - w) * b + root * w * c
    out[:, 0, 3] = COVER**2 * edges[-1] / points / share[piece] / np.pi
    owner = surfaces.owner[triangle]
    low = np.full((len(surfaces.fronts), 3), np.inf)
    high = -low
    np.minimum.at(low, owner, pieces.min(axis=1))
    np.maximum.at(high, owner, pieces.max(axis=1))
    out[:, 2, :3], out[:, 3, :3] = low[owner[piece]], high[owner[piece]]
    return own.astype(np.float32), out.astype(np.float32)


def _describe(rows: np.ndarray, surfaces: Surfaces, triangle, across: np.ndarray, double: np.ndarray) -> None:
    """Fill in what tells which side of a surface is seen, and in how many maps."""
    front = surfaces.fronts[surfaces.owner[triangle]] if len(triangle) else np.zeros(0)
    normal = across / np.maximum(double, 1e-300)[:, None] * np.where(front < 0, -1.0, 1.0)[:, None]
    rows[:, 1, :2], rows[:, 1, 2] = octahedral(normal), surfaces.opacity[triangle]
    rows[:, 1, 3] = (triangle + 1) * np.where(front != 0, -1.0, 1.0)
