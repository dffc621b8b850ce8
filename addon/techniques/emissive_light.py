"""Emissive light: meshes whose material emits, as light sources of other surfaces.

Points on emissive triangles are drawn in proportion to area times luminance, a few per sample (in pictures of few
samples so many that the picture has FEWEST_POINTS), each with depth maps. All are of one low-discrepancy set:

    L(x, v) = mean over samples of  f(x, v, w) cos(w) Le |cos_y| V(x, y) / (|x - y|^2 p(y)),   p(y) = lum(Le) / power

As in Cycles, emission leaves both sides of a surface. Narrow lobes find emissive triangles by their own rays
(traced_glossy), weighted against these points.

| cost | per sample |
|---|---|
| maps | `points` x (1 view, or up to 6 cube faces), or a ray per pixel for each where that costs less |
| passes | 1 over the screen |

Fails: emission that varies is taken at its mean over the surfaces that show the material; very many small emitters
need many samples.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..frame import depth_maps, lights
from ..frame.run import Frame
from ..frame.settings import Settings
from ..frame.technique import Param, Technique
from ..materials.compiled import CompiledMaterial
from ..materials.compiler import may_emit
from ..snapshot.scene import Snapshot
from .accumulated_maps import RESOLUTION, DepthMapService, by_rays, map_resolution, rounds, traced_shadows
from .direct_light import DIRECT_WRITES, shade
from .surfaces import LIT_SURFACES

BOTH, FRONT, BEHIND = "both", "front", "behind"
SIDES = ((BOTH, 1.0), (FRONT, 1.0), (BEHIND, -1.0))  # with the sign of the normal
FEWEST_POINTS, MOST_POINTS = 32, 16  # in a whole picture, and in one of its samples


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


class EmissiveLight(Technique):
    name = "emissive_light"
    label = "Emissive surfaces"
    params = (
        Param("points", "Points", 4, "Points on emissive surfaces that are drawn per sample", 1, 64),
        replace(RESOLUTION, default=1.0),
    )
    reads = LIT_SURFACES
    writes = DIRECT_WRITES
    offers = ("emissive",)

    def __init__(self):
        self.service = DepthMapService()
        self._sources = lights.Sources()
        self._triangles: EmissiveTriangles | None = None
        self._traced = False  # rays take the place of maps

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        used = {slot for instance in snapshot.instances for slot in instance.materials}
        if not any(may_emit(snapshot.materials[slot].graph) for slot in used):
            return "no material emits light"
        return None

    def run(self, frame: Frame) -> Iterator[None]:
        if frame.receivers is None or not len(frame.receivers.distance):
            return
        if frame.sample == 0:
            self._triangles = EmissiveTriangles(frame, ("diffuse", "glossy"))
        count = self._count(frame.settings)
        frame.services["emissive"] = (self._triangles.power, float(count))
        if not self._triangles.power > 0:
            return
        resolution = map_resolution(frame, frame.settings.get(self, "texels_per_pixel"))
        flags = lights.SHADOW_FLAG + lights.TRACED_FLAG
        items = []
        for k in range(count):
            number = frame.sample * count + k
            numbers = frame.random_volume_at(number, "emissive")
            point = self._triangles.draw(*numbers)[1]
            if number == 0:
                self._traced = by_rays(frame, lambda place=point: _views(frame, place, 0, resolution), resolution)
            views = [] if self._traced else _views(frame, point, number, resolution)
            row = self._triangles.row(numbers, count, flags, len(views) or self._traced, frame.settings.samples)
            items.append((row, views))
        for rows, views in rounds(frame, items, resolution):
            maps = traced_shadows(frame) if self._traced else self.service.draw(frame, self, views, resolution)
            yield from maps.drawing
            yield
            yield from shade(frame, self, rows, 1 << lights.SURFACE, self._sources, maps)

    def _count(self, settings: Settings) -> int:
        """Points per sample: more where a picture of few samples would have few in all."""
        points = settings.get(self, "points")
        return max(points, min(FEWEST_POINTS // settings.samples, MOST_POINTS)) if settings.whole else points

    def release(self) -> None:
        self.service.release()
        self._sources.release()
        self._triangles = None


def _views(frame: Frame, point: np.ndarray, number: int, resolution: int) -> list[depth_maps.MapView]:
    """Of the map of a point, which is the picture's point `number`."""
    jitter = (*frame.random_at(number, "map/emissive"), *frame.random_at(number, "map/emissive/turn"))
    return depth_maps.point_views(point, None, np.inf, frame.receivers, frame.geometry, jitter, resolution)
