"""The surface of an object that scatters: its sides, its cells, and a grid that finds them (scatter_points.py)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..kernels.morton import morton_codes
from ..sampling.sequence import bits
from ..snapshot.scene import Instance, Mesh
from .envelope import NOISE, normal_envelope
from .mesh_parts import parts_of
from .pieces import farthest

ROW = 64  # cells
RUNS = 8  # points of the cloud for each cell
TURN = 2.0  # cell sizes by which two opposite faces count as apart: those that meet at an edge share no cell
FEWEST_BEHIND = 0.125  # of an object's points, on the other side of a part that is nearly closed
NEARLY = 0.1  # of a part's surface: a disc with the rim of its holes, up to which it counts as a body
MOST_VOXELS = 64  # along an axis
VOXEL = 0.75  # of the distance between points
AXES = np.concatenate([[axis, -axis] for axis in np.eye(3)])


@dataclass(frozen=True)
class Surface:
    """Triangles of an instance that scatter: corners and corner normals (T, 3, 3), areas (T,), texture coordinates
    (T, 3, 2), numbers of materials (T,), how far light spreads and the mean thickness of what is closed, m, the
    share of the points it asks for that it has, whether it is the other side of a sheet, and whether its light begins
    where smooth shading says that it runs (the object's Shadow Terminator, Geometry Offset)."""

    corners: np.ndarray
    normals: np.ndarray
    areas: np.ndarray
    uv: np.ndarray
    materials: np.ndarray
    reach: float
    thickness: float
    share: float = 1.0
    behind: bool = False
    lifted: bool = True

    @property
    def area(self) -> float:
        return float(self.areas.sum())

    @classmethod
    def sides(cls, instance: Instance, mesh: Mesh, reach: tuple, origin: np.ndarray) -> list[Surface]:
        """The outside of what is closed, and with it the front of what is open; then, if anything is, the same with its
        back. Front is where faces are wound anticlockwise and normals point to, as for the viewer."""
        material = mesh.triangle_materials(instance.materials)
        linear, moved = instance.matrix[:3, :3], instance.matrix[:3, 3] - origin
        all_corners = mesh.positions[mesh.corner_vertices[mesh.triangle_corners]].astype(np.float64) @ linear.T + moved
        parts = parts_of(mesh.positions, mesh.corner_vertices[mesh.triangle_corners])
        a, b, c = linear.T
        turn = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
        normals = mesh.corner_normals[mesh.triangle_corners].astype(np.float64) @ turn.T
        if np.linalg.det(linear) < 0.0:
            normals = -normals
        across = np.cross(all_corners[:, 1] - all_corners[:, 0], all_corners[:, 2] - all_corners[:, 0])
        areas = np.linalg.norm(across, axis=1) / 2
        finite = np.isfinite(all_corners).all(axis=(1, 2)) & np.isfinite(areas)
        facing = np.einsum("ni,ni->n", across, normals.sum(axis=1))
        across = across * np.where(facing < 0.0, -1.0, 1.0)[:, None]
        middle = all_corners.mean(axis=1)
        base = middle[finite].mean(axis=0) if finite.any() else np.zeros(3)
        volume = np.where(finite, np.einsum("ni,ni->n", middle - base, across) / 6.0, 0.0)
        count = len(parts.closed)
        volumes = np.bincount(parts.of_triangle, weights=volume, minlength=count)
        by_part = np.bincount(parts.of_triangle, weights=np.where(finite, areas, 0.0), minlength=count)
        closed = parts.closed[parts.of_triangle]
        inside_out = closed & (volumes < 0.0)[parts.of_triangle]
        normals = np.where(inside_out[:, None, None], -normals, normals)
        of_triangle = np.asarray(reach)[material]
        kept = finite & (of_triangle > 0.0)
        positive = of_triangle[of_triangle > 0.0]
        layer = mesh.uv_maps.get(mesh.active_uv)
        shown = mesh.triangle_corners[kept]
        uv = np.zeros((len(shown), 3, 2)) if layer is None else layer[shown].astype(np.float64)
        # Of a part that is nearly closed its other side is hardly ever seen.
        scale = abs(np.linalg.det(linear)) ** (1.0 / 3.0)
        gaps = (scale * parts.rim) ** 2 / np.maximum(4.0 * np.pi * by_part, 1e-30)
        bodies = gaps < NEARLY
        solid = float(by_part[bodies].sum())
        thickness = 4.0 * float(np.abs(volumes[bodies]).sum()) / solid if solid > 0.0 else np.inf
        front = cls(
            all_corners[kept], normals[kept], areas[kept], uv, material[kept],
            float(positive.min()) if len(positive) else 0.0, thickness if thickness > 0.0 else np.inf,
            lifted=instance.terminator > 0.0,
        )  # fmt: skip
        open_parts = ~closed[kept]
        if not open_parts.any():
            return [front]
        gap = np.average(gaps, weights=np.where(parts.closed, 0.0, by_part) + 1e-30)
        share = float(np.clip(gap / NEARLY, FEWEST_BEHIND, 1.0))
        turned = np.where(open_parts[:, None, None], -front.normals, front.normals)
        return [front, replace(front, normals=turned, share=share, behind=True)]

    def cells(self, count: int) -> tuple[np.ndarray, ...]:
        """Points (count, RUNS, 3), shading normals and triangles' normals of the same shape, how high above their
        triangles smooth shading puts them, m (count, RUNS), areas and radii of
        curvature (count,), by how much normals differ in a cell for how much places do; numbers of
        triangles (count, RUNS), texture coordinates (count, RUNS, 2), and the cloud: places, triangles' normals and the
        cell of each."""
        place, normal, face, lift, triangle, uv = self._cloud(count * RUNS)
        size = np.sqrt(self.area / count)
        centre, owner = farthest(np.concatenate([place, TURN / 2 * size * face], axis=1).astype(np.float32), count)
        sums = np.bincount(owner, minlength=count)
        order = np.argsort(owner, kind="stable")
        first = np.concatenate([[0], np.cumsum(sums)[:-1]])
        # The centre, then others evenly out of its cell.
        spread = (bits(np.arange(RUNS), 0) * sums[:, None] // 2**32).astype(np.int64)
        member = order[np.minimum(first[:, None] + spread, len(order) - 1)]
        member[:, 0] = centre
        along = np.argsort(morton_codes(place[centre]), kind="stable")
        member, sums = member[along], sums[along]
        areas = sums * (self.area / len(place))
        cell = np.argsort(along, kind="stable")[owner]
        radius = np.sqrt(_spreads(place, cell, count) / np.maximum(_spreads(face, cell, count), 1e-9))
        found = place[member], normal[member], face[member], lift[member], areas, radius
        return *found, triangle[member], uv[member], (place, face, cell)

    def _cloud(self, count: int) -> tuple[np.ndarray, ...]:
        """Evenly spread points, with shading normals, those of their triangles, lifts, the triangles' numbers and
        texture coordinates."""
        edges = np.concatenate([[0.0], np.cumsum(self.areas)])
        u, v, w = (bits(np.arange(count), dimension) / 2.0**32 for dimension in range(3))
        triangle = np.clip(np.searchsorted(edges, u * edges[-1], side="right") - 1, 0, len(self.areas) - 1)
        root = np.sqrt(v)
        share = np.stack([1 - root, root * (1 - w), root * w], axis=1)[:, :, None]
        corners = self.corners[triangle]
        normal = _unit((share * self.normals[triangle]).sum(axis=1))
        face = _unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
        face *= np.where((face * normal).sum(axis=1) < 0.0, -1.0, 1.0)[:, None]
        normal = np.where((normal * normal).sum(axis=1, keepdims=True) > 0.5, normal, face)
        place = (share * corners).sum(axis=1)
        lift = self._lifts(triangle, share, place) if self.lifted else np.zeros(count)
        return place, normal, face, lift, triangle, (share * self.uv[triangle]).sum(axis=1)

    def _lifts(self, triangle: np.ndarray, share: np.ndarray, place: np.ndarray) -> np.ndarray:
        """How high above their triangles the smooth surface is meant to run at places with these shares of corners:
        smooth_lift of shaders/surface/point.glsl."""
        count = len(self.corners)
        corners = self.corners - self.corners[:, :1]
        normals = _unit(self.normals.reshape(-1, 3)).reshape(-1, 3, 3)
        flat = np.arange(3 * count).reshape(-1, 3)
        above = normal_envelope(corners.reshape(-1, 3), normals.reshape(-1, 3), flat)[:, 0].reshape(-1, 3, 1)
        mean = (share * normals[triangle]).sum(axis=1)
        reach = np.linalg.norm(mean, axis=1)
        own = (share[..., 0] * (corners * normals).sum(axis=2)[triangle]).sum(axis=1)
        height = own - ((place - self.corners[triangle, 0]) * mean).sum(axis=1)
        lift = np.maximum(height, (share * above[triangle]).sum(axis=1)[:, 0]) / np.maximum(reach, 1e-30)
        size = np.abs(corners).max(axis=(1, 2))[triangle]
        return np.where((reach > 0.0) & (lift > NOISE * size), lift, 0.0)


@dataclass(frozen=True)
class Voxels:
    """A grid around an object: its corner and voxels' size, m, voxels along each axis, and two texels of each voxel:
    1 + numbers of the cells that face along +x, -x, +y, and -y, +z, -z; 0: none near."""

    low: np.ndarray
    size: float
    shape: tuple[int, int, int]
    texels: np.ndarray

    @classmethod
    def of(cls, clouds: list[tuple]) -> Voxels:
        """Of clouds (of an object's two sides): places, normals, cells, which count from `first` in the image, `first`,
        and the distance between cells, m."""
        every = np.concatenate([cloud[0] for cloud in clouds])
        low, high = every.min(axis=0), every.max(axis=0)
        spacing = max(cloud[4] for cloud in clouds)
        size = max(VOXEL * spacing, float((high - low).max()) / (MOST_VOXELS - 3), 1e-30)
        low = low - size
        shape = tuple((np.floor((high - low) / size).astype(int) + 2).tolist())
        found = np.zeros((6, *shape), np.int64)
        # What faces along the axis more than along others comes first, then what does at all; in either, the front of
        # thin parts before the inside of the face across.
        for mostly in (True, False):
            for place, face, cell, first, _ in clouds:
                own = np.zeros_like(found)
                at = (place - low) / size
                voxel = np.floor(at).astype(int)
                off = np.linalg.norm(at - voxel - 0.5, axis=1)
                along = face @ AXES.T
                most = along.argmax(axis=1)
                for axis in range(6):
                    of_axis = (most == axis) if mostly else (along[:, axis] > 0.3)
                    best = np.argsort(-off, kind="stable")
                    best = best[of_axis[best]]  # the last one written stays
                    own[axis][tuple(voxel[best].T)] = 1 + first + cell[best]
                for _ in range(2):
                    own = _spread(own)
                found = np.where(found == 0, own, found)
        packed = np.moveaxis(found, 0, -1).reshape(-1, 2, 3)
        texels = np.concatenate([packed, np.zeros((len(packed), 2, 1))], axis=2).reshape(-1, 4)
        return cls(low, size, shape, texels.astype(np.float32))


def _spread(found: np.ndarray) -> np.ndarray:
    """The same with what is 0 taken from a voxel beside."""
    out = found.copy()
    for axis in (1, 2, 3):
        for way in (1, -1):
            into, of = [slice(None)] * 4, [slice(None)] * 4
            into[axis] = slice(1, None) if way > 0 else slice(None, -1)
            of[axis] = slice(None, -1) if way > 0 else slice(1, None)
            beside = out[tuple(into)]
            out[tuple(into)] = np.where(beside == 0, found[tuple(of)], beside)
    return out


def _spreads(values: np.ndarray, owner: np.ndarray, count: int) -> np.ndarray:
    """(count,) mean squared distance of the values (N, 3) of each owner from their mean."""
    each = np.maximum(np.bincount(owner, minlength=count), 1)
    mean = np.stack([np.bincount(owner, weights=axis, minlength=count) for axis in values.T], axis=1) / each[:, None]
    return np.bincount(owner, weights=((values - mean[owner]) ** 2).sum(axis=1), minlength=count) / each


def _unit(v: np.ndarray) -> np.ndarray:
    return v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-30)
