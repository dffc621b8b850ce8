"""How much of each place of a triangle is covered, for rays that run no shader: leaves, fences, sheets of sprites.

A node tree is only known as a program, so each triangle whose material has an opacity that varies is drawn on a tile of
its own (the idea of opacity micromaps: Gruen, Benthin & Woop 2020, with 256 levels in place of two). A tile has M x M
cells in the triangle's own axes, of which the half on the triangle's side of the diagonal counts; each cell is asked at
four places, from four directions, for the front and for the back. Larger triangles have more cells.

Where a triangle is equally opaque all over it has no tile, which makes rays as fast as without maps: much of a leaf's
card is empty or whole. What is empty all over is left out of the hierarchy.

| cost | once per set of materials and meshes |
|---|---|
| draws | 1 of each mesh with such a material (up to INSTANCES of those that share it) |
| cells | CELLS in all, 8 evaluations each; 4 bytes |
| rays | 11 fetches where they meet a triangle with a tile; 15 % of the time of alpha_foliage on a software GPU |

Against Cycles: glossy direct light on leaves and the ground below them (alpha_foliage) has relMSE .0104 at 64 samples
and .0046 at 256, where one opacity for all of a material left .0209 and .0167: what remains is noise.

Instances of a mesh whose opacity depends on the object or on where it is are measured one by one, up to APART of them.

Fails: more of those share the mean over some of them, and opacity that depends on the direction is that of four
directions together. What passes has its material's mean colour (traced_triangles.py) over the cell's luminance: of
stained panes with two faces, which light passes at the same colour twice, diffuse indirect light is .78 of Cycles'.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..gfx import geometry as gfx_geometry
from ..gfx import images, passes
from ..snapshot.scene import Instance, Mesh
from .geometry import SceneGeometry, corner_attribute
from .materials import MaterialSet

CELLS = 1 << 19  # about; more where there are many triangles, of which each has at least SMALLEST squared
SMALLEST, LARGEST = 2, 1024  # cells along a side of a tile, powers of two
WIDTH = 2048  # of the image that tiles are drawn into
SAMPLES = 4  # of each cell and side, as shaders/surface/opacity_map.vert.glsl places them
INSTANCES = 4  # of those that share a mesh
STEPS = 255  # of a cell's opacity
ALIKE = 0.5 / STEPS
APART = 256  # instances that are measured one by one
MOST_MEASURED = 4_000_000  # triangles, not counting instances; more have their material's mean
MOST_TILES = 1 << 19  # numbers that an opacity code holds (acceleration.py)


Kind = tuple[str, tuple[int, ...], str]  # mesh, materials, and the instance's key, or nothing for all such instances


def kinds_of(instances: list[Instance], materials: MaterialSet, varied: set[int], apart: int) -> dict[Kind, list[int]]:
    """Numbers of the instances of each kind that shows a material of `varied`. Where one of those reads what is around
    it, as many as `apart` of a mesh are kinds of their own."""
    found: dict[Kind, list[int]] = {}
    for number, instance in enumerate(instances):
        if varied.intersection(instance.materials):
            found.setdefault((instance.mesh, instance.materials, ""), []).append(number)
    alone = {k for k in varied if materials.compiled[k].reads}
    for kind, numbers in [*found.items()]:
        if len(numbers) <= apart and alone.intersection(kind[1]):
            del found[kind]
            found |= {(*kind[:2], instances[number].key): [number] for number in numbers}
    return found


@dataclass(frozen=True)
class TriangleOpacity:
    """Of the triangles of a mesh with given materials in its slots."""

    measured: np.ndarray  # (T,) whose material has an opacity that varies
    sides: np.ndarray  # (T, 2) mean opacity 0..1 of front and back, of those
    tile: np.ndarray  # (T,) number among the tiles, 0 where the mean says all


class OpacityMaps:
    """What was measured of a renderer's scene, kept until a material or mesh changes.

    `texels` (N, 4) is what rays read, texel k of it for tile k: where its cells begin and half how many stand in a row;
    then the cells, two rows of two in a texel, each front * 256 + back. `means` (K,) of both sides of each tile.
    """

    def __init__(self):
        self.texels = np.zeros((0, 4), np.float32)
        self.means = np.zeros(0)
        self.changes = 0
        self._of: dict[Kind, TriangleOpacity] = {}
        self._key: object = ()

    def of(self, instance: Instance) -> TriangleOpacity | None:
        """Of an instance's triangles; None where no material of it varies."""
        return self._of.get(self.kind_of(instance))

    def kind_of(self, instance: Instance) -> Kind:
        """Equal for instances whose triangles are equally opaque, as far as is known."""
        alone = instance.mesh, instance.materials, instance.key
        return alone if alone in self._of else (instance.mesh, instance.materials, "")

    def update(self, materials: MaterialSet, geometry: SceneGeometry) -> None:
        """Measure anew if materials or meshes differ."""
        instances, meshes, _ = geometry.placed
        varied = {k for k, material in enumerate(materials.compiled) if material.uneven}
        kinds = kinds_of(instances, materials, varied, APART) if varied else {}
        prints, count = materials.fingerprint() if kinds else (), len(materials.compiled)
        key = (
            tuple((mesh, meshes[mesh].version, slots, name) for mesh, slots, name in kinds),
            tuple((prints[k], materials.around(k, geometry)) for k in sorted(varied) if kinds), prints[count:],
        )  # fmt: skip
        if key == self._key:
            return
        self._key = key
        self.changes += 1
        self.texels, self.means, self._of = np.zeros((0, 4), np.float32), np.zeros(0), {}
        if kinds:
            self._measure(materials, geometry, kinds, varied)

    def _measure(self, materials: MaterialSet, geometry: SceneGeometry, kinds: dict, varied: set[int]) -> None:
        instances, meshes, _ = geometry.placed
        parts: list[Part] = []
        count = 0
        for (key, slots, name), numbers in kinds.items():
            material = meshes[key].triangle_materials(slots)
            for k in sorted(varied.intersection(np.unique(material).tolist())):
                triangles = np.flatnonzero(material == k)
                own = slice(count, count + len(triangles))
                parts.append(Part(meshes[key], (key, slots, name), k, triangles, own, numbers))
                count = own.stop
        if not 0 < count <= MOST_MEASURED:
            return
        area = np.concatenate([areas(part, instances[part.numbers[0]]) for part in parts])
        sides = _tile_sides(area)
        corners, height = layout(sides)
        covered, drawn = self._drawn(materials, geometry, parts, sides, corners, height)
        self._keep(parts, sides, corners, covered, drawn)

    def _drawn(self, materials, geometry, parts, sides, corners, height) -> tuple[np.ndarray, np.ndarray]:
        """(height, WIDTH, 2) how much of each cell is covered, of how many samples, for front and back."""
        image = images.create(WIDTH, height, "RGBA16F")  # not of the pool: its height is that of this scene alone
        target = images.Target((image,))
        target.clear()
        state = {"blend": "ADDITIVE_PREMULT", "depth_test": "NONE", "depth_write": False}
        for part in parts:
            attributes = materials.compiled[part.material].attributes
            batch = flat_batch(part, attributes, sides[part.own], corners[part.own])
            shader = passes.get(materials.opacity_program(part.material))
            bindings = materials.bindings(part.material, geometry.instances, own=False)
            with passes.drawing(target, **state):
                for number in part.numbers[:: -(-len(part.numbers) // INSTANCES)]:
                    constants = {"first_instance": number, "tile_scale": (2 / WIDTH, 2 / height)}
                    shader.bind(**bindings, constants=constants)
                    passes.draw(shader, batch, 2 * SAMPLES)
        found = images.read(image)
        return found[..., 0::2], found[..., 1::2]

    def _keep(self, parts, sides, corners, covered, drawn) -> None:
        """Put what was drawn into tiles, the largest first, and say of each triangle where its own is."""
        count = len(sides)
        mean, order, start, cells = np.zeros((count, 2)), np.zeros(count, np.int64), np.zeros(count, np.int64), []
        texels, tiles = 0, 0
        for side in np.unique(sides)[::-1]:
            own = np.flatnonzero(sides == side)
            place = corners[own][:, None, None] + np.stack(np.meshgrid(np.arange(side), np.arange(side)), -1)
            total, asked = covered[place[..., 1], place[..., 0]], drawn[place[..., 1], place[..., 0]]
            # What is not drawn lies beyond the diagonal, or is not finite.
            opacity = np.where(asked > 0, total / np.maximum(asked, 1), np.nan)
            weight = asked.sum(axis=(1, 2))
            mean[own] = np.where(weight > 0, total.sum(axis=(1, 2)) / np.maximum(weight, 1), 1.0)
            away = np.nanmax(np.abs(opacity - mean[own][:, None, None]), axis=(1, 2, 3), initial=0.0)
            kept = away > ALIKE
            kept &= np.cumsum(kept) < MOST_TILES - tiles
            if kept.any():
                order[own[kept]] = tiles + 1 + np.arange(kept.sum())
                levels = np.rint(np.nan_to_num(opacity[kept], nan=1.0) * STEPS)
                packed = levels[..., 0] * (STEPS + 1) + levels[..., 1]
                half = side // 2
                packed = packed.reshape(-1, half, 2, half, 2).transpose(0, 1, 3, 2, 4).reshape(-1, 4)
                start[own[kept]] = texels + half * half * np.arange(kept.sum())
                cells.append(packed.astype(np.float32))
                texels, tiles = texels + len(packed), tiles + int(kept.sum())
        table = np.zeros((tiles + 1 if tiles else 0, 4), np.float32)
        self.means = np.zeros(len(table))
        mapped = order > 0
        table[order[mapped], 0] = start[mapped] + len(table)
        table[order[mapped], 1] = sides[mapped] // 2
        self.means[order[mapped]] = mean[mapped].mean(axis=1)
        self.texels = np.concatenate([table, *cells])
        for part in parts:
            count = part.mesh.triangle_count
            nothing = TriangleOpacity(np.zeros(count, bool), np.ones((count, 2)), np.zeros(count, np.int64))
            known = self._of.setdefault(part.kind, nothing)
            known.measured[part.triangles], known.sides[part.triangles] = True, mean[part.own]
            known.tile[part.triangles] = order[part.own]


@dataclass(frozen=True)
class Part:
    """Triangles of one material of a mesh."""

    mesh: Mesh
    kind: Kind
    material: int
    triangles: np.ndarray
    own: slice  # which they are among all that are measured
    numbers: list[int]  # of the instances that show it


def areas(part: Part, instance: Instance) -> np.ndarray:
    """(T,) of an instance's triangles, m2."""
    matrix = instance.matrix[:3, :3].astype(np.float64)
    a, b, c = np.moveaxis(part.mesh.positions[part.mesh.corner_vertices[_corners(part)]] @ matrix.T, 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    return np.where(np.isfinite(area), area, 0.0)


def _corners(part: Part) -> np.ndarray:
    return part.mesh.triangle_corners[part.triangles]


def _tile_sides(area: np.ndarray) -> np.ndarray:
    """(T,) cells along a side of each tile, so that cells are about equally large."""
    wanted = np.sqrt(np.maximum(area, 1e-300) * (CELLS / max(area.sum(), 1e-300)))
    return np.exp2(np.clip(np.rint(np.log2(wanted)), np.log2(SMALLEST), np.log2(LARGEST))).astype(np.int64)


def layout(sides: np.ndarray) -> tuple[np.ndarray, int]:
    """(T, 2) where tiles stand in an image of WIDTH, equal ones side by side; and the image's height."""
    corners, height = np.zeros((len(sides), 2), np.int64), 0
    for side in np.unique(sides)[::-1]:
        own = np.flatnonzero(sides == side)
        row, column = np.divmod(np.arange(len(own)), WIDTH // side)
        corners[own, 0], corners[own, 1] = column * side, height + row * side
        height += int(row[-1] + 1) * int(side)
    return corners, height


def flat_batch(part: Part, attributes, sides: np.ndarray, corners: np.ndarray) -> gfx_geometry.Batch:
    """The triangles with corners of their own, and where each corner stands on the tiles."""
    mesh, triangles = part.mesh, _corners(part).reshape(-1)
    cell = corners[:, None] + sides[:, None, None] * np.array([[0, 0], [1, 0], [0, 1]])
    own = {f"attribute{k}": corner_attribute(mesh, one)[triangles] for k, one in enumerate(attributes)}
    vertices = gfx_geometry.vertex_buffer(
        position=mesh.positions[mesh.corner_vertices[triangles]], normal=mesh.corner_normals[triangles],
        cell=cell.reshape(-1, 2).astype(np.float32), **own,
    )  # fmt: skip
    return gfx_geometry.triangle_batch(vertices, np.arange(len(triangles)))
