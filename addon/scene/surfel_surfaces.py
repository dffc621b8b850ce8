"""Surfaces that surfels are spread over: an instance's triangles in its own space, by what their sides see.

Meshes are sampled in their own space after stretching (M = rotation * stretch): what moves rigidly keeps its surfels,
instances share them, and the result does not depend on what was there before. Triangles of which neither side sees
another surface (seen.py), such as outer faces of walls, count as UNSEEN of their area; where one side of a sheet sees
nothing, the other alone gathers light."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from .on_gpu import SceneOnGpu
from .pieces import areas_and_normals, halved
from .seen import UNSEEN
from .surfel_cells import MOST_PIECES, ROUNDS, Cells, distance_share, sampled
from .traced_triangles import coverage, world_triangles


@dataclass(frozen=True)
class Surface:
    """An instance's triangles in its own space after stretching, (T, 3, 3), their opacities (T,), and how it stands."""

    key: tuple
    corners: np.ndarray
    opacity: np.ndarray
    closed: bool
    turn: np.ndarray
    moved: np.ndarray
    sheet: bool = False
    share: float = 1.0  # of its area that counts

    @classmethod
    def of(cls, frame: SceneOnGpu, instance, materials) -> Surface:
        snapshot, maps = frame.snapshot, frame.opacity_maps
        mesh, linear = snapshot.meshes[instance.mesh], instance.matrix[:3, :3].astype(np.float64)
        left, scales, right = np.linalg.svd(linear)
        stretch = right.T @ np.diag(scales) @ right
        unit = max(float(scales.max()), 1e-30)
        stretch = np.round(stretch / unit, 5) * float(f"{unit:.5e}")  # of a rigid motion the same but for rounding
        turn = left @ right
        known = (instance,), snapshot.meshes, materials, frame.geometry.origin, "diffuse", maps, frame.emission_maps
        look = world_triangles(list(known[0]), *known[1:])[1]
        corners = mesh.positions[mesh.corner_vertices[mesh.triangle_corners]].astype(np.float64) @ stretch.T
        opacity = coverage(look[:, 0], maps) if len(look) == len(corners) else np.zeros(len(corners))
        closed = frame.geometry.is_closed(mesh)
        key = (instance.mesh, mesh.version, instance.materials, stretch.tobytes())
        key = (*key, opacity.astype(np.float32).tobytes() if opacity.min(initial=1.0) < 1.0 else b"")
        return cls(key, corners, opacity, closed, turn, instance.matrix[:3, 3] - frame.geometry.origin)

    @property
    def mirrored(self) -> bool:
        """Whether fronts by the winding of its triangles are backs in the world; normals turn along all the same."""
        return bool(np.linalg.det(self.turn) < 0.0)

    def parted(self, seen: np.ndarray | None) -> Iterator[Surface]:
        """Triangles by what their sides see, (T, 2) for front and back by their winding in the world."""
        if seen is None or len(seen) != len(self.corners):
            yield self
            return
        front, back = seen.T[::-1] if self.mirrored else seen.T
        if self.closed:
            kinds = (front, False, True, False, 1.0), (~front, False, True, False, UNSEEN)
        else:
            kinds = (
                (front & back, False, False, False, 1.0), (front & ~back, False, True, True, 1.0),
                (~front & back, True, True, True, 1.0), (~front & ~back, False, False, False, UNSEEN),
            )  # fmt: skip
        for number, (own, turned, closed, sheet, share) in enumerate(kinds):
            if own.any():
                corners = self.corners[own][:, ::-1] if turned else self.corners[own]
                key = self.key if own.all() else (*self.key, own.tobytes())
                yield replace(
                    self, key=(*key, number), corners=corners, opacity=self.opacity[own], closed=closed, sheet=sheet,
                    share=share,
                )  # fmt: skip

    def world(self) -> tuple[np.ndarray, np.ndarray]:
        """Its triangles with the fronts that they have in its own space, and their opacities."""
        corners = self.corners[:, ::-1] if self.mirrored else self.corners
        return corners @ self.turn.T + self.moved, self.opacity

    def far(self, reach: float, eye: np.ndarray) -> bool:
        """Whether parts of it are farther than `reach`."""
        if not np.isfinite(reach):
            return False
        corners = self.world()[0].reshape(-1, 3)
        return bool(np.linalg.norm(corners - eye, axis=1).max(initial=0.0) > reach)

    def weight(self, reach: float, eye: np.ndarray) -> float:
        corners = self.corners if not self.far(reach, eye) else self.world()[0]
        areas = areas_and_normals(corners)[0]
        if self.far(reach, eye):
            pieces, _ = halved(corners, eye, reach, ROUNDS, MOST_PIECES)
            areas = areas_and_normals(pieces)[0] * distance_share(pieces, reach, eye)
        return self.share * float(areas.sum())


def together(surfaces: list[Surface], count: int, reach: float, eye: np.ndarray) -> Cells:
    """Small objects sampled as one; some of them may have no surfel."""
    parts = []
    for closed, sheet in ((True, False), (True, True), (False, False)):
        some = [one.world() for one in surfaces if one.closed is closed and one.sheet is sheet]
        if some:
            number = max(round(count * len(some) / len(surfaces)), 1)
            corners, opacity = (np.concatenate(values) for values in zip(*some))
            cells = sampled(corners, opacity, number, closed, reach, eye)
            parts.append(replace(cells, sheet=np.full(len(cells), sheet)))
    return Cells.joined([part for part in parts if len(part)])
