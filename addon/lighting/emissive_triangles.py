"""Triangles whose material emits, ready to draw points of light from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..frame.run import Frame
from ..materials.compiled import CompiledMaterial
from ..sources import lights

BOTH, FRONT, BEHIND = "both", "front", "behind"
SIDES = ((BOTH, 1.0), (FRONT, 1.0), (BEHIND, -1.0))  # with the sign of the normal

PATHS = {"diffuse": lights.DIFFUSE_FLAG, "glossy": lights.GLOSSY_FLAG, "transmission": lights.TRANSMISSION_FLAG}


class EmissiveTriangles:
    """World-space triangles that emit, ready to draw points from; of objects that any of these paths (names of
    Visibility) may see. As in Cycles, an object lights what its ray visibility says."""

    def __init__(self, frame: Frame, paths: Sequence[str]):
        corners, radiance, normals, sided, flags = [], [], [], [], []
        of_side = {side: np.array([_emission(m, side) for m in frame.measured_materials]) for side, _ in SIDES}
        emissive = {k for emission in of_side.values() for k in np.flatnonzero(emission.any(axis=1))}
        for instance in frame.snapshot.instances:
            mesh = frame.snapshot.meshes[instance.mesh]
            seen = sum(PATHS[path] * getattr(instance.visibility, path) for path in paths)
            if not seen or emissive.isdisjoint(instance.materials) or not mesh.triangle_count:
                continue
            slots = mesh.triangle_materials(instance.materials)
            for side, sign in SIDES:
                emission = of_side[side][slots]
                shining = np.abs(emission).max(axis=1) > 0
                if not shining.any():
                    continue
                matrix = instance.matrix.copy()
                matrix[:3, 3] -= frame.geometry.origin
                world = mesh.positions[mesh.corner_vertices[mesh.triangle_corners[shining]]] @ matrix[:3, :3].T
                corners.append(world + matrix[:3, 3])
                radiance.append(emission[shining])
                # A mirrored triangle's corners run the other way round.
                normals.append(np.full(len(world), sign * np.sign(np.linalg.det(matrix[:3, :3])) or 1.0))
                sided.append(np.full(len(world), side != BOTH))
                flags.append(np.full(len(world), seen))
        self.corners = np.concatenate(corners) if corners else np.zeros((0, 3, 3))
        self.radiance = np.concatenate(radiance) if radiance else np.zeros((0, 3))
        self.sided = np.concatenate(sided) if sided else np.zeros(0, bool)
        self.flags = np.concatenate(flags) if flags else np.zeros(0, int)  # of lights.py, for `paths`
        normal = np.cross(self.corners[:, 1] - self.corners[:, 0], self.corners[:, 2] - self.corners[:, 0])
        double_area = np.linalg.norm(normal, axis=1)
        self.normal = normal / np.maximum(double_area, 1e-30)[:, None]
        if normals:
            self.normal *= np.concatenate(normals)[:, None]
        weight = np.abs(self.radiance) @ lights.LUMINANCE * double_area / 2
        weight = np.where(np.isfinite(weight), weight, 0.0)
        self.power = float(weight.sum())
        self._edges = np.concatenate([[0.0], np.cumsum(weight)])

    def row(
        self, numbers: tuple[float, float, float], share: float, flags: int, views: int = 1, samples: float = np.inf
    ) -> np.ndarray:
        """Of a point drawn by three uniform numbers, one of `share` in each of `samples` samples; see lights.py. Flags
        of the paths that see it are added."""
        k, point, density = self.draw(*numbers)
        flags += int(self.flags[k]) + lights.SIDED_FLAG * bool(self.sided[k])
        normal, radiance = self.normal[k], self.radiance[k]
        return lights.surface_row(point, normal, radiance, density * share, flags, 0, views, samples)

    def draw(self, x: float, y: float, z: float) -> tuple[int, np.ndarray, float]:
        """From three uniform numbers: a triangle, a point on it, and the density per m2."""
        k = int(np.clip(np.searchsorted(self._edges, x * self.power, side="right") - 1, 0, len(self.radiance) - 1))
        root = np.sqrt(y)
        a, b, c = self.corners[k]
        point = (1 - root) * a + root * (1 - z) * b + root * z * c
        return k, point, float(np.abs(self.radiance[k]) @ lights.LUMINANCE) / self.power


def _emission(material: CompiledMaterial, side: str) -> tuple[float, float, float]:
    """What a material emits to one of its sides, or to both: it does either, or none."""
    if not material.emissive or (side == BOTH) != (material.emission == material.emission_behind):
        return 0.0, 0.0, 0.0
    return material.emission_behind if side == BEHIND else material.emission
