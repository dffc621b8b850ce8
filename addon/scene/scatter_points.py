"""Points on the surfaces of objects below which light scatters, as a surface image that light passes can shade.

Each object's surface is cut into cells of about equal size: of a dense even cloud of its points, `count` centres are
picked so that each is as far as can be from those before (farthest point sampling; distance in place and, so that both
faces of a thin sheet are told apart, in normal), and each point of the cloud belongs to the nearest. A cell stands for
the area of its points. In every sample one point of each cell is lit, the centre first: one sample has evenly spread
points, and many samples see all of the cloud.

Cells stand along a curve through space, 64 to a row of the image; a row has a bounding sphere, so that pixels pass over
rows which are too far away. Objects begin with a row of their own.

Made on the CPU when geometry or what scatters changes: 40 us a cell. On the GPU: 2 images of 16 bytes a cell and run.

Bias: the cloud is finite: what lies between its points (a seventh of a cell) is never lit itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..gfx import images
from ..kernels.morton import morton_codes
from ..materials import translucency
from ..materials.translucency import maps_of
from ..materials.working_space import current
from ..sampling.sequence import bits
from ..snapshot.scene import Instance, Mesh, Snapshot
from .pieces import farthest, octahedral

ROW = 64  # cells
RUNS = 8  # points of the cloud for each cell
FEWEST = 64  # cells of an object
TURN = 0.7  # cell sizes by which two opposite faces count as apart
SPACING = 0.7  # of the longest scale of the profile: how far apart points are wished


@dataclass(frozen=True)
class ScatteringObject:
    """An instance that scatters: its row in the image of instances, rows of cells, distance between cells, m."""

    instance: int
    first_row: int
    rows: int
    spacing: float
    area: float


class ScatterPoints:
    """The points of a renderer's scene."""

    def __init__(self):
        self._key: object = None
        self.objects: list[ScatteringObject] = []
        self.rows = 0
        self._positions: list[images.Image] = []  # by run: place relative to the render origin, w = 1 (0: unused)
        self._normals: list[images.Image] = []
        self._entries: list[images.Image] = []  # by run: painted tint and translucency
        self.cells: list[images.Image] = []  # by run: place, w = area of the cell, m2
        self.bounds: images.Image | None = None  # by row: centre and radius
        self.table: images.Image | None = None  # by row of instances: 1 + number of the object, or 0; then the objects

    def update(self, frame, most: int) -> bool:
        """Make points anew if surfaces moved or scatter otherwise; True if so. At most `most` cells in all."""
        snapshot, materials = frame.snapshot, frame.materials.compiled
        placed = frame.geometry.placed[0]  # shaders look objects up by rows of the geometry's image
        reach = tuple(m.scatter for m in materials)
        shown = [k for k, instance in enumerate(placed) if any(reach[m] > 0.0 for m in instance.materials)]
        maps = [maps_of(material.graph) for material in snapshot.materials]
        painted = [(k, *one, snapshot.images[one[1]].version) for k, found in enumerate(maps) for one in found.items()]
        moved = [
            (k, one.mesh, snapshot.meshes[one.mesh].version, one.matrix.tobytes(), one.materials)
            for k, one in ((k, placed[k]) for k in shown)
        ]
        origin = tuple(frame.geometry.origin)
        key = (most, tuple(painted), origin, reach, len(placed), tuple(moved))
        if key == self._key:
            return False
        self._key = key
        self._make(snapshot, placed, shown, reach, maps, frame.geometry.origin, most)
        return True

    def entries(self, run: int) -> images.Image:
        """Painted tint and translucency of a run's points."""
        return self._entries[run % RUNS]

    def surface(self, run: int) -> tuple[images.Image, images.Image]:
        """Positions and normals of a run, as shaders/lib/gbuffer.glsl reads them."""
        return self._positions[run % RUNS], self._normals[run % RUNS]

    def _make(
        self, snapshot: Snapshot, placed: list[Instance], shown: list[int], reach: tuple, maps: list,
        origin: np.ndarray, most: int,
    ) -> None:  # fmt: skip
        surfaces = [_Surface.of(placed[k], snapshot.meshes[placed[k].mesh], reach, origin) for k in shown]
        wished = np.array([one.area / max(SPACING * one.reach, 1e-30) ** 2 for one in surfaces])
        wished = np.maximum(np.nan_to_num(wished, posinf=1e12), FEWEST)
        if wished.sum() > most:
            # What is left of a few large wishes goes to those.
            fair = np.sort(wished)
            before = np.concatenate([[0.0], np.cumsum(fair)[:-1]])
            caps = (most - before) / np.arange(len(fair), 0, -1)
            fits = np.flatnonzero(caps <= fair)
            wished = np.minimum(wished, max(caps[fits[0]], 1.0) if len(fits) else wished)
        counts = np.maximum(np.ceil(wished / ROW).astype(int) * ROW, ROW)
        if counts.sum() > most:  # a row each is too much: what comes first has one
            counts[np.cumsum(counts) > most] = 0
        self.objects, blocks, row = [], [], 0
        table = np.zeros((max(len(placed), 1), 4), np.float32)
        for k, surface, count in zip(shown, surfaces, counts):
            if not count or not surface.area > 0.0:
                continue
            *block, triangle, uv = surface.cells(int(count))
            blocks.append((*block, _painted(surface.materials[triangle], uv, maps, snapshot.images)))
            spacing = float(np.sqrt(surface.area / count))
            self.objects.append(ScatteringObject(k, row, int(count) // ROW, spacing, surface.area))
            table[k] = len(self.objects), 0.0, 0.0, 0.0
            row += int(count) // ROW
        self.rows = row
        listed = np.array([(o.first_row, o.rows, o.spacing, 0.0) for o in self.objects], np.float32).reshape(-1, 4)
        self.table = images.upload_list(np.concatenate([table, listed]))
        self.first_object = len(table)
        self._upload(blocks)

    def _upload(self, blocks: list) -> None:
        self._positions, self._normals, self._entries, self.cells, self.bounds = [], [], [], [], None
        if not blocks:
            return
        place, normal, face, area, entry = (np.concatenate(parts) for parts in zip(*blocks))
        rows = len(place) // ROW
        by_row = place.reshape(rows, ROW * RUNS, 3)
        low, high = by_row.min(axis=1), by_row.max(axis=1)
        centre = (low + high) / 2
        radius = np.linalg.norm(by_row - centre[:, None], axis=2).max(axis=1)
        bounds = np.concatenate([centre, 1.0001 * radius[:, None]], axis=1)
        self.bounds = images.upload(bounds.astype(np.float32).reshape(rows, 1, 4))
        one = np.ones((len(place), 1))
        for run in range(RUNS):
            self._positions.append(_image(np.concatenate([place[:, run], one], axis=1)))
            packed = np.concatenate([octahedral(normal[:, run]), octahedral(face[:, run])], axis=1)
            self._normals.append(_image(packed))
            self._entries.append(_image(entry[:, run]))
            self.cells.append(_image(np.concatenate([place[:, run], area[:, None]], axis=1)))

    def release(self) -> None:
        self.__init__()


@dataclass(frozen=True)
class _Surface:
    """Triangles of an instance that scatter: corners and corner normals (T, 3, 3), areas (T,), texture coordinates
    (T, 3, 2), numbers of materials (T,), and how far light spreads, m."""

    corners: np.ndarray
    normals: np.ndarray
    areas: np.ndarray
    uv: np.ndarray
    materials: np.ndarray
    reach: float

    @property
    def area(self) -> float:
        return float(self.areas.sum())

    @classmethod
    def of(cls, instance: Instance, mesh: Mesh, reach: tuple, origin: np.ndarray) -> _Surface:
        material = mesh.triangle_materials(instance.materials)
        of_triangle = np.asarray(reach)[material]
        shown = mesh.triangle_corners[of_triangle > 0.0]
        linear, moved = instance.matrix[:3, :3], instance.matrix[:3, 3] - origin
        corners = mesh.positions[mesh.corner_vertices[shown]].astype(np.float64) @ linear.T + moved
        a, b, c = linear.T
        turn = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
        normals = mesh.corner_normals[shown].astype(np.float64) @ turn.T
        if np.linalg.det(linear) < 0.0:
            normals = -normals
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        areas = np.linalg.norm(across, axis=1) / 2
        # Normals of a shell that is inside out are turned round, as the viewer's side turns those of pixels.
        facing = np.einsum("ni,ni->n", across, normals.sum(axis=1))
        across = across * np.where(facing < 0.0, -1.0, 1.0)[:, None]
        middle = corners.mean(axis=1)
        volume = float(np.einsum("ni,ni->", middle - middle.mean(axis=0), across)) / 6.0 if len(middle) else 0.0
        if volume < -1e-3 * float(areas.sum()) ** 1.5:
            normals = -normals
        finite = np.isfinite(corners).all(axis=(1, 2)) & np.isfinite(areas)
        positive = of_triangle[of_triangle > 0.0]
        layer = mesh.uv_maps.get(mesh.active_uv)
        uv = np.zeros((len(shown), 3, 2)) if layer is None else layer[shown].astype(np.float64)
        own = material[of_triangle > 0.0]
        return cls(
            corners[finite],
            normals[finite],
            areas[finite],
            uv[finite],
            own[finite],
            float(positive.min()) if len(positive) else 0.0,
        )

    def cells(self, count: int) -> tuple[np.ndarray, ...]:
        """Points (count, RUNS, 3), shading normals and triangles' normals of the same shape, areas (count,), numbers of
        triangles (count, RUNS) and texture coordinates (count, RUNS, 2)."""
        place, normal, face, triangle, uv = self._cloud(count * RUNS)
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
        return place[member], normal[member], face[member], areas, triangle[member], uv[member]

    def _cloud(self, count: int) -> tuple[np.ndarray, ...]:
        """Evenly spread points, with shading normals, those of their triangles, the triangles' numbers and texture
        coordinates."""
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
        return (share * corners).sum(axis=1), normal, face, triangle, (share * self.uv[triangle]).sum(axis=1)


def _painted(material: np.ndarray, uv: np.ndarray, maps: list, pictures: dict) -> np.ndarray:
    """(cells, RUNS, 4) tint and translucency at points with these materials and texture coordinates."""
    out = np.ones((*material.shape, 4))
    for number in np.unique(material):
        for name, image in maps[number].items():
            own = material == number
            if name == translucency.TINT:
                out[own, :3] = translucency.sampled(pictures[image], uv[own])
            elif name == translucency.TRANSLUCENCY:
                color = translucency.sampled(pictures[image], uv[own])
                out[own, 3] = np.clip(color @ current().luminance, 0.0, 1.0)
    return out


def _unit(v: np.ndarray) -> np.ndarray:
    return v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-30)


def _image(values: np.ndarray) -> images.Image:
    return images.upload(values.astype(np.float32).reshape(-1, ROW, 4))
