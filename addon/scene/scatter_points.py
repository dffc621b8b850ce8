"""Points on the surfaces of objects below which light scatters, as a surface image that light passes can shade.

Each object's surface is cut into cells of about equal size: of a dense even cloud of its points, `count` centres are
picked so that each is as far as can be from those before (farthest point sampling; distance in place and, so that both
faces of a thin sheet are told apart, in normal), and each point of the cloud belongs to the nearest. A cell stands for
the area of its points. In every sample one point of each cell is lit, the centre first: one sample has evenly spread
points, and many samples see all of the cloud.

Cells stand along a curve through space, 64 to a row of the image; a row has a bounding sphere, so that pixels pass over
rows which are too far away. Objects begin with a row of their own.

A mesh whose parts are closed has points on its outside, told by their volumes. An open part is a sheet with two sides
(mesh_parts.py): such an instance is two objects, one of each side, with the points of its closed parts in both, and a
pixel belongs to that which it sees. Points lie as densely as the profile asks, and where an object is thinner than
that, as its mean thickness does (4 volume / surface).

Where a ray through an object leaves it, `near` tells the cell: a grid of voxels around the instance, each with the cell
of the nearest point that faces along either way of each axis (6 numbers in 2 texels).

Made on the CPU when geometry or what scatters changes: 40 us a cell. On the GPU: 2 images of 16 bytes a cell and run,
and up to 32 bytes for each of 64^3 voxels an instance.

Bias: the cloud is finite: what lies between its points (a seventh of a cell) is never lit itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..gfx import images
from ..materials import translucency
from ..materials.compiler import may_walk
from ..materials.translucency import maps_of
from ..materials.working_space import current
from ..snapshot.scene import Instance, Snapshot
from .on_gpu import SceneOnGpu
from .pieces import octahedral, octahedral_with_lift
from .scatter_surface import ROW, RUNS, Surface, Voxels

FEWEST, FEWEST_WALKED = 256, 1024  # cells of an object
WALKED = 0.25  # of the distance between points: where walks look light up, it is not spread by a profile beside
RANGE = 2.5  # distances between points: where pixels stop and points begin
SPACING = 0.7  # of the longest scale of the profile, or the mean thickness: how far apart points are wished


@dataclass(frozen=True)
class ScatteringObject:
    """An instance that scatters, or one side of it: its row in the image of instances, rows of cells, distance between
    cells, m, and mean thickness, m."""

    instance: int
    first_row: int
    rows: int
    spacing: float
    area: float
    thickness: float


class ScatterPoints:
    """The points of a renderer's scene."""

    def __init__(self):
        self._key: object = None
        self.objects: list[ScatteringObject] = []
        self.rows = 0
        self._positions: list[images.Image] = []  # by run: place relative to the render origin, w = 1 (0: unused)
        self._normals: list[images.Image] = []
        self._entries: list[images.Image] = []  # by run: painted tint and translucency
        self._instances: images.Image | None = None
        self.curves: images.Image | None = None  # radius of curvature, m
        # By run: place, w = area of the cell, m2; after the cells of a row its bounding sphere.
        self.cells: list[images.Image] = []
        # By row of instances: 1 + number of the object in front, or 0, and of that behind; then the objects.
        self.table: images.Image | None = None
        self.grids: list[tuple] = []  # of each instance: corner and voxel's size; voxels, first of its texels
        self.voxels = np.zeros((0, 4), np.float32)  # what `near` holds
        self._materials = np.zeros(0)  # of each cell
        self.near: images.Image | None = None  # voxels: 1 + number of the cell that faces +x, -x, +y; -y, +z, -z

    def update(self, frame: SceneOnGpu, most: int) -> bool:
        """Make points anew if surfaces moved or scatter otherwise; True if so. At most `most` cells in all."""
        snapshot, materials = frame.snapshot, frame.materials.compiled
        placed = frame.geometry.placed[0]  # shaders look objects up by rows of the geometry's image
        walked = tuple(may_walk(material.graph) for material in snapshot.materials)
        reach = tuple(m.scatter * (WALKED if by_walks else 1.0) for m, by_walks in zip(materials, walked))
        shown = [k for k, instance in enumerate(placed) if any(reach[m] > 0.0 for m in instance.materials)]
        maps = [maps_of(material.graph) for material in snapshot.materials]
        painted = [(k, *one, snapshot.images[one[1]].version) for k, found in enumerate(maps) for one in found.items()]
        moved = [
            (k, one.mesh, snapshot.meshes[one.mesh].version, one.matrix.tobytes(), one.materials, one.terminator > 0.0)
            for k, one in ((k, placed[k]) for k in shown)
        ]
        origin = tuple(frame.geometry.origin)
        key = (most, tuple(painted), origin, reach, len(placed), tuple(moved))
        if key == self._key:
            return False
        self._key = key
        self._make(snapshot, placed, shown, (reach, walked), maps, frame.geometry.origin, most)
        return True

    def entries(self, run: int) -> images.Image:
        """Painted tint and translucency of a run's points."""
        return self._entries[run % RUNS]

    def surface(self, run: int) -> tuple[images.Image, images.Image]:
        """Positions and normals of a run, as shaders/lib/gbuffer.glsl reads them."""
        return self._positions[run % RUNS], self._normals[run % RUNS]

    @property
    def instances(self) -> images.Image:
        """x: number of a point's object; z: row of its instance in the geometry's image; w: material; for all runs."""
        if self._instances is None:
            values = np.zeros((self.rows, ROW, 4), np.float32)
            for number, one in enumerate(self.objects):
                values[one.first_row : one.first_row + one.rows, :, 0] = number
                values[one.first_row : one.first_row + one.rows, :, 2] = one.instance
            values[..., 3] = self._materials.reshape(-1, ROW)
            self._instances = images.upload(values)
        return self._instances

    def _make(
        self, snapshot: Snapshot, placed: list[Instance], shown: list[int], scatters: tuple, maps: list,
        origin: np.ndarray, most: int,
    ) -> None:  # fmt: skip
        sides, fewest = [], []
        reach, walked = scatters
        for k in shown:
            sides += [(k, one) for one in Surface.sides(placed[k], snapshot.meshes[placed[k].mesh], reach, origin)]
            by_walks = any(walked[m] and reach[m] > 0.0 for m in placed[k].materials)
            fewest += [FEWEST_WALKED if by_walks else FEWEST] * (len(sides) - len(fewest))
        counts = _counts([one for _, one in sides], np.array(fewest), most)
        self.objects, blocks, row = [], [], 0
        materials = []
        table = np.zeros((max(len(placed), 1), 4), np.float32)
        clouds: dict[int, list] = {}
        for (k, surface), count in zip(sides, counts):
            if not count or not surface.area > 0.0:
                continue
            *block, triangle, uv, cloud = surface.cells(int(count))
            materials.append(surface.materials[triangle[:, 0]])
            blocks.append((*block, _painted(surface.materials[triangle], uv, maps, snapshot.images)))
            spacing = float(np.sqrt(surface.area / count))
            rows = int(count) // ROW
            self.objects.append(ScatteringObject(k, row, rows, spacing, surface.area, surface.thickness))
            table[k, int(surface.behind) : 2] = len(self.objects)
            clouds.setdefault(k, []).append((*cloud, row * ROW, spacing))
            row += rows
        grids = {k: Voxels.of(found) for k, found in clouds.items()}
        starts = dict(zip(grids, np.cumsum([0] + [len(grid.texels) for grid in grids.values()])))
        listed = []
        for one in self.objects:
            grid = grids[one.instance]
            listed += [(one.first_row, one.rows, one.spacing, one.instance), (*grid.low, grid.size)]
            listed += [(*grid.shape, starts[one.instance])]
        self.rows = row
        objects = np.array(listed, np.float32).reshape(-1, 4)
        self.table = images.upload_list(np.concatenate([table, objects]))
        texels = [grid.texels for grid in grids.values()]
        self.voxels = np.concatenate(texels) if texels else np.zeros((0, 4), np.float32)
        self.near = images.upload_list(self.voxels)
        self.grids = [((*grid.low, grid.size), (*grid.shape, starts[k])) for k, grid in grids.items()]
        self._materials = np.concatenate(materials) if materials else np.zeros(0)
        self.first_object = len(table)
        self._upload(blocks)

    def _upload(self, blocks: list) -> None:
        self._positions, self._normals, self._entries, self.cells = [], [], [], []
        self._instances = None
        if not blocks:
            return
        place, normal, face, lift, area, curve, entry = (np.concatenate(parts) for parts in zip(*blocks))
        rows = len(place) // ROW
        by_row = place.reshape(rows, ROW * RUNS, 3)
        low, high = by_row.min(axis=1), by_row.max(axis=1)
        centre = (low + high) / 2
        radius = np.linalg.norm(by_row - centre[:, None], axis=2).max(axis=1)
        bounds = np.concatenate([centre, 1.0001 * radius[:, None]], axis=1)
        one = np.ones((len(place), 1))
        self.curves = _image(np.repeat(curve[:, None], 4, axis=1))
        for run in range(RUNS):
            self._positions.append(_image(np.concatenate([place[:, run], one], axis=1)))
            packed = np.concatenate(
                [octahedral(normal[:, run]), octahedral_with_lift(face[:, run], lift[:, run])], axis=1
            )
            self._normals.append(_image(packed))
            self._entries.append(_image(entry[:, run]))
            cells = np.concatenate([place[:, run], area[:, None]], axis=1).reshape(rows, ROW, 4)
            self.cells.append(images.upload(np.concatenate([cells, bounds[:, None]], axis=1).astype(np.float32)))

    def release(self) -> None:
        self.__init__()


def _counts(surfaces: list[Surface], fewest: np.ndarray, most: int) -> np.ndarray:
    """Cells of each object, whole rows, at most `most` in all."""
    wished = np.array([one.area / max(SPACING * min(one.reach, one.thickness), 1e-30) ** 2 for one in surfaces])
    wished = np.maximum(np.nan_to_num(wished, posinf=1e12), fewest)
    shares = np.array([one.share for one in surfaces])
    if (wished * shares).sum() > most:
        # What is left of a few large wishes goes to those.
        order = np.argsort(wished)
        fair, part = wished[order], shares[order]
        before = np.concatenate([[0.0], np.cumsum(fair * part)[:-1]])
        caps = (most - before) / np.cumsum(part[::-1])[::-1]
        fits = np.flatnonzero(caps <= fair)
        wished = np.minimum(wished, max(caps[fits[0]], 1.0) if len(fits) else wished)
    wished = np.maximum(wished * shares, 1.0)
    counts = np.maximum(np.ceil(wished / ROW).astype(int) * ROW, ROW)
    if counts.sum() > most:
        counts = np.maximum(np.floor(wished / ROW).astype(int) * ROW, ROW)
    if counts.sum() > most:  # a row each is too much: what comes first has one
        counts[np.cumsum(counts) > most] = 0
    return counts


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


def _image(values: np.ndarray) -> images.Image:
    return images.upload(values.astype(np.float32).reshape(-1, ROW, 4))
