"""What each place of a triangle emits, for what runs no shader: the choice of light sources, and rays.

A screen, a map of glowing windows, bulbs coloured by their object: the mean over all that shows a material is the wrong
light for each of them. So the triangles of each material whose emission varies are drawn as opacity_maps.py draws them:
flat, on a tile of their own, each cell asked at four places and from four directions, for the front and for the back.
Instances of a mesh are measured one by one where their material reads what is around it (the object, its place, the
camera), up to APART of them; of more some stand for all.

Where cells of a triangle differ, it is cut into the triangles of its cells, from which points of light are drawn. Rays
take the mean over the triangle.

| cost | once per set of materials, meshes and what materials read of their instances |
|---|---|
| draws | 1 for each instance of such a material that is measured |
| cells | CELLS in all, more where there are many triangles; 8 evaluations each |
| readback | 32 bytes a cell |

Fails: emission that depends on the direction is that of four directions together; triangles beyond MOST_MEASURED have
their material's mean.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..gfx import images, passes
from ..snapshot.scene import Instance
from .geometry import SceneGeometry
from .materials import MaterialSet
from .opacity_maps import INSTANCES, SAMPLES, WIDTH, Kind, Part, areas, flat_batch, kinds_of, layout

CELLS = 1 << 16  # about
SMALLEST, LARGEST = 2, 32  # cells along a side of a tile, powers of two
APART = 4096  # instances that are measured one by one
MOST_MEASURED = 100_000  # triangles, counting instances that are measured apart
ROWS = 512  # of cells that are drawn and read back at once
ALIKE = 0.05  # share of the brightest cell by which those of a triangle that is not cut differ at most
SAME_SIDES = 0.1  # relative difference of the sides' emission that the directions alone may make


class EmissiveLevel:
    """Luminance that is added to that of each emissive triangle where points are drawn (frame.shared): the mean of all,
    0 where nothing emits."""

    def __init__(self):
        self.value = 0.0


@dataclass(frozen=True)
class TriangleEmission:
    """Of the triangles of a mesh with given materials in its slots. Radiance is that of front and back."""

    measured: np.ndarray  # (T,) whose material has an emission that varies
    mean: np.ndarray  # (T, 2, 3) of those
    triangle: np.ndarray  # (S,) which triangle each piece is of; a triangle that is even is one piece
    places: np.ndarray  # (S, 3, 2) where the piece's corners lie along the triangle's first and second edge, 0..1
    radiance: np.ndarray  # (S, 2, 3)


class EmissionMaps:
    """What was measured of a renderer's scene, kept until a material, mesh, or what materials read changes."""

    def __init__(self):
        self.changes = 0
        self._of: dict[Kind, TriangleEmission] = {}
        self._key: object = None

    def of(self, instance: Instance) -> TriangleEmission | None:
        """Of an instance's triangles; None where no material of it varies."""
        return self._of.get(self.kind_of(instance))

    def kind_of(self, instance: Instance) -> Kind:
        """Equal for instances whose triangles emit alike, as far as is known."""
        alone = instance.mesh, instance.materials, instance.key
        return alone if alone in self._of else (instance.mesh, instance.materials, "")

    def update(self, materials: MaterialSet, geometry: SceneGeometry) -> None:
        """Measure anew if materials, meshes or what is read of instances and camera differ."""
        instances, meshes, _ = geometry.placed
        varied = {k for k, material in enumerate(materials.compiled) if material.emissive and material.uneven_emission}
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
        self._of = {}
        if kinds:
            self._measure(materials, geometry, kinds, varied)

    def _measure(self, materials: MaterialSet, geometry: SceneGeometry, kinds: dict, varied: set[int]) -> None:
        instances, meshes, _ = geometry.placed
        # Kinds of one mesh lie flat in the same way: together they are one batch of triangles, drawn for each.
        alike: dict[tuple, list[Kind]] = {}
        for kind in kinds:
            alike.setdefault(kind[:2], []).append(kind)
        parts: list[tuple[Part, list[Kind]]] = []
        count = 0
        for (mesh, slots), own in alike.items():
            material = meshes[mesh].triangle_materials(slots)
            for k in sorted(varied.intersection(np.unique(material).tolist())):
                triangles = np.flatnonzero(material == k)
                fitting = own[: max(MOST_MEASURED - count, 0) // len(triangles)]
                count += len(triangles) * len(fitting)
                if fitting:
                    parts.append((Part(meshes[mesh], own[0], k, triangles, slice(0), kinds[own[0]]), fitting))
        if not parts:
            return
        sizes = [areas(part, instances[part.numbers[0]]) for part, _ in parts]
        whole = max(sum(len(fitting) * area.sum() for area, (_, fitting) in zip(sizes, parts)), 1e-300)
        for area, (part, fitting) in zip(sizes, parts):
            wanted = np.sqrt(np.maximum(area, 1e-300) * (CELLS / whole))
            sides = np.exp2(np.clip(np.rint(np.log2(wanted)), np.log2(SMALLEST), np.log2(LARGEST))).astype(np.int64)
            self._draw(materials, geometry, part, fitting, kinds, sides)

    def _draw(self, materials, geometry, part: Part, own: list[Kind], kinds: dict, sides: np.ndarray) -> None:
        """Draw the triangles of a part for each kind, as many at once as ROWS hold, and keep what they emit."""
        corners, height = layout(sides)
        width = int(min(WIDTH, (corners[:, 0] + sides).max()))
        attributes = materials.compiled[part.material].attributes
        batch = flat_batch(part, attributes, sides, corners)
        shader = passes.get(materials.emission_map_program(part.material))
        bindings = materials.bindings(part.material, geometry.instances, own=False)
        at_once = max(ROWS // height, 1)
        for start in range(0, len(own), at_once):
            some = own[start : start + at_once]
            rows = height * len(some)
            with images.borrowed(width, 2 * rows, "RGBA32F") as target:
                target.clear()
                constants = {"tile_scale": (2 / width, 1 / rows), "other_side": float(rows)}
                state = {"blend": "ADDITIVE_PREMULT", "depth_test": "NONE", "depth_write": False}
                with passes.drawing(target, **state):
                    for k, kind in enumerate(some):
                        numbers = kinds[kind]
                        for number in numbers[:: -(-len(numbers) // INSTANCES)]:
                            placed = {"first_instance": number, "shift": (0.0, float(k * height))}
                            shader.bind(**bindings, constants={**constants, **placed})
                            passes.draw(shader, batch, 2 * SAMPLES)
                found = images.read(target.colors[0]).reshape(2, len(some), height, width, 4)
            for k, kind in enumerate(some):
                made = _pieces(found[:, k], sides, corners)
                self._of[kind] = _joined(self._of.get(kind), part, *made)

    def release(self) -> None:
        self._of, self._key = {}, None


def _pieces(sums: np.ndarray, sides: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, ...]:
    """Of tiles (2, H, W, 4) of T triangles: mean (T, 2, 3), and pieces as in TriangleEmission."""
    mean = np.zeros((len(sides), 2, 3))
    pieces, places, radiance = [], [], []
    for side in np.unique(sides):
        own = np.flatnonzero(sides == side)
        grid = np.stack(np.meshgrid(np.arange(side), np.arange(side)), -1)  # (v, u, 2)
        at = corners[own][:, None, None] + grid
        total = sums[:, at[..., 1], at[..., 0]].astype(float).transpose(1, 2, 3, 0, 4)  # (N, v, u, 2, 4)
        weight = total[..., 3:].sum(axis=(1, 2))
        mean[own] = total[..., :3].sum(axis=(1, 2)) / np.maximum(weight, 1)
        cells = np.where(total[..., 3:] > 0, total[..., :3] / np.maximum(total[..., 3:], 1), mean[own][:, None, None])
        away = np.abs(cells - mean[own][:, None, None]).max(axis=(1, 2, 3, 4))
        cut = away > ALIKE * np.abs(cells).max(axis=(1, 2, 3, 4))
        whole = own[~cut]
        pieces.append(whole)
        places.append(np.broadcast_to(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), (len(whole), 3, 2)))
        radiance.append(mean[whole])
        if cut.any():
            # Each cell within the triangle is one triangle, and the other half of it where it does not cross the edge.
            u, v = grid[..., 0].reshape(-1), grid[..., 1].reshape(-1)
            halves = (u + v < side, ((0, 0), (1, 0), (0, 1))), (u + v < side - 1, ((1, 0), (1, 1), (0, 1)))
            for half, corner in halves:
                place = (np.stack([u, v], -1)[half][:, None] + np.array(corner)) / side
                found = cells[cut].reshape(cut.sum(), side * side, 2, 3)[:, half]
                pieces.append(np.repeat(own[cut], half.sum()))
                places.append(np.tile(place, (int(cut.sum()), 1, 1)))
                radiance.append(found.reshape(-1, 2, 3))
    means = _sides_as_one(mean)
    return means, np.concatenate(pieces), np.concatenate(places), _sides_as_one(np.concatenate(radiance))


def _sides_as_one(radiance: np.ndarray) -> np.ndarray:
    """(N, 2, 3) with the mean for both sides where they differ by no more than the directions may make."""
    middle = radiance.mean(axis=1, keepdims=True)
    reach = np.abs(radiance).max(axis=(1, 2), keepdims=True)
    alike = (np.abs(radiance - middle) <= SAME_SIDES * reach).all(axis=(1, 2), keepdims=True)
    return np.where(alike, middle, radiance)


def _joined(before: TriangleEmission | None, part: Part, mean, pieces, places, radiance) -> TriangleEmission:
    """What is known of a mesh, with another material's triangles."""
    count = part.mesh.triangle_count
    measured, means = np.zeros(count, bool), np.zeros((count, 2, 3))
    pieces = part.triangles[pieces]
    if before is not None:
        measured, means = before.measured.copy(), before.mean.copy()
        pieces, places = np.concatenate([before.triangle, pieces]), np.concatenate([before.places, places])
        radiance = np.concatenate([before.radiance, radiance])
    measured[part.triangles], means[part.triangles] = True, mean
    return TriangleEmission(measured, means, pieces, places, radiance)
