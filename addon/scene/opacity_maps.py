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
| cells | CELLS in all, 8 evaluations each; 4 bytes, 8 where colours vary |
| rays | 11 fetches where they meet a triangle with a tile; 15 % of the time of alpha_foliage on a software GPU |
| | 11 more where they pass one whose colour varies |

What passes has a colour: of a triangle, or of each cell where cells differ (a stained pane, painted glass), over the
chance to pass. Both faces of a thick pane are asked, so that light has the square of the colour there, as in Cycles.

Against Cycles: glossy direct light on leaves and the ground below them (alpha_foliage) has relMSE .0104 at 64 samples
and .0046 at 256, where one opacity for all of a material left .0209 and .0167: what remains is noise.

Instances of a mesh whose opacity depends on the object or on where it is are measured one by one, up to APART of them.

Fails: more of those share the mean over some of them, and opacity that depends on the direction is that of four
directions together. Colours are those of both sides together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..gfx import geometry as gfx_geometry
from ..gfx import images, passes
from ..materials.energy import fresnel_dielectric, pane_passing
from ..materials.estimate import Interface
from ..snapshot.scene import Instance, Mesh
from .geometry import SceneGeometry, corner_attribute
from .materials import MaterialSet

CELLS = 1 << 19  # about; more where there are many triangles, of which each has at least SMALLEST squared
SMALLEST, LARGEST = 2, 1024  # cells along a side of a tile, powers of two
WIDTH = 2048  # of the image that tiles are drawn into
SAMPLES = 4  # of each cell and side, as shaders/surface/opacity_map.vert.glsl places them
INSTANCES = 4  # of those that share a mesh
STEPS = 255  # of a cell's opacity, and of each channel of its colour
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
    tint: np.ndarray  # (T, 3) mean colour of what passes, over the chance to pass
    stained: np.ndarray  # (T,) whose tile has colours of its own
    to_lamps: np.ndarray  # (T,) by how much more passes of light from lamps than of light from all sides, as measured


class OpacityMaps:
    """What was measured of a renderer's scene, kept until a material or mesh changes.

    `texels` (N, 4) is what rays read, texel k of it for tile k: where its cells begin and half how many stand in a row;
    then the cells, two rows of two in a texel, each front * 256 + back; and of tiles whose colours vary, from where the
    third number of theirs says, colours in the same order (packed_tints). The fourth number: by how much more passes of
    light from lamps than of light from all sides. `means` (K,) of both sides of each tile.
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
        drawn = self._drawn(materials, geometry, parts, sides, corners, height)
        scales = np.repeat(
            [_glass_scales(materials.compiled[part.material].glass) for part in parts],
            [len(part.triangles) for part in parts], axis=0,
        )  # fmt: skip
        self._keep(parts, sides, corners, scales, *drawn)

    def _drawn(
        self, materials, geometry, parts, sides, corners, height
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        """(height, WIDTH, 2) how much of each cell is covered, of how many samples, for front and back; and
        (height, WIDTH, 4) the sum of what passes both, of so many, or None where nothing is coloured."""
        tinted = {part.material for part in parts if materials.compiled[part.material].tinted}
        # Not of the pool: their height is that of this scene alone.
        drawn = [images.create(WIDTH, height, "RGBA16F") for _ in range(2 if tinted else 1)]
        targets = {False: images.Target(tuple(drawn[:1])), True: images.Target(tuple(drawn))}
        targets[bool(tinted)].clear()
        state = {"blend": "ADDITIVE_PREMULT", "depth_test": "NONE", "depth_write": False}
        for part in parts:
            attributes = materials.compiled[part.material].attributes
            batch = flat_batch(part, attributes, sides[part.own], corners[part.own])
            shader = passes.get(materials.opacity_program(part.material))
            bindings = materials.bindings(part.material, geometry.instances, own=False)
            with passes.drawing(targets[part.material in tinted], **state):
                for number in part.numbers[:: -(-len(part.numbers) // INSTANCES)]:
                    constants = {"first_instance": number, "tile_scale": (2 / WIDTH, 2 / height)}
                    shader.bind(**bindings, constants=constants)
                    passes.draw(shader, batch, 2 * SAMPLES)
        found = images.read(drawn[0])
        return found[..., 0::2], found[..., 1::2], images.read(drawn[1]) if tinted else None

    def _keep(self, parts, sides, corners, scales, covered, drawn, passing) -> None:
        """Put what was drawn into tiles, the largest first, and say of each triangle where its own is. Of the T
        triangles of `parts`: `sides` (T,) and `corners` (T, 2), cells, of `layout`; `scales` (T, 2), of _glass_scales.
        Of `_drawn`: `covered` and `drawn` (height, WIDTH, 2), `passing` (height, WIDTH, 4) or None."""
        count = len(sides)
        mean, order, start, cells = np.zeros((count, 2)), np.zeros(count, np.int64), np.zeros(count, np.int64), []
        texels, tiles = 0, 0
        tint, stained, colors = np.ones((count, 3)), np.zeros(count, bool), np.zeros(count, np.int64)
        for side in np.unique(sides)[::-1]:
            own = np.flatnonzero(sides == side)
            place = corners[own][:, None, None] + np.stack(np.meshgrid(np.arange(side), np.arange(side)), -1)
            total, asked = covered[place[..., 1], place[..., 0]], drawn[place[..., 1], place[..., 0]]
            # What is not drawn lies beyond the diagonal, or is not finite.
            even = scales[own, 0]
            opacity = np.where(asked > 0, total / np.maximum(asked, 1), np.nan)
            opacity = 1.0 - (1.0 - opacity) * even[:, None, None, None]
            weight = asked.sum(axis=(1, 2))
            mean[own] = np.where(weight > 0, total.sum(axis=(1, 2)) / np.maximum(weight, 1), 1.0)
            mean[own] = 1.0 - (1.0 - mean[own]) * even[:, None]
            away = np.nanmax(np.abs(opacity - mean[own][:, None, None]), axis=(1, 2, 3), initial=0.0)
            kept = away > ALIKE
            if passing is not None:
                of_cells, tint[own], differs = _tints(passing[place[..., 1], place[..., 0]])
                stained[own] = differs
                kept |= differs
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
            stained[own] &= kept
            if stained[own].any():
                packed = packed_tints(of_cells[stained[own]])
                packed = packed.reshape(-1, half, 2, half, 2).transpose(0, 1, 3, 2, 4).reshape(-1, 4)
                colors[own[stained[own]]] = texels + half * half * np.arange(stained[own].sum())
                cells.append(packed.astype(np.float32))
                texels += len(packed)
        table = np.zeros((tiles + 1 if tiles else 0, 4), np.float32)
        self.means = np.zeros(len(table))
        mapped = order > 0
        table[order[mapped], 0] = start[mapped] + len(table)
        table[order[mapped], 1] = sides[mapped] // 2
        table[order[stained], 2] = colors[stained] + len(table)
        table[order[mapped], 3] = scales[mapped, 1]
        self.means[order[mapped]] = mean[mapped].mean(axis=1)
        self.texels = np.concatenate([table, *cells])
        for part in parts:
            count = part.mesh.triangle_count
            nothing = TriangleOpacity(
                np.zeros(count, bool), np.ones((count, 2)), np.zeros(count, np.int64), np.ones((count, 3)),
                np.zeros(count, bool), np.ones(count),
            )  # fmt: skip
            known = self._of.setdefault(part.kind, nothing)
            known.measured[part.triangles], known.sides[part.triangles] = True, mean[part.own]
            known.tile[part.triangles] = order[part.own]
            known.tint[part.triangles], known.stained[part.triangles] = tint[part.own], stained[part.own]
            known.to_lamps[part.triangles] = scales[part.own, 1]


def _glass_scales(glass: Interface | None) -> tuple[float, float]:
    """What light from all sides has of what the directions of a cell let pass, and light from lamps of that again."""
    if glass is None or not glass.fresnel:
        return 1.0, 1.0
    from_lamps, evenly = pane_passing(glass.ior)
    cosines = np.sqrt(1.0 - (np.arange(SAMPLES) + 0.5) / SAMPLES)  # shaders/surface/tile_view.glsl
    asked = 1.0 - fresnel_dielectric(cosines, glass.ior).mean() if glass.ior > 1.0 else evenly
    return float(evenly / asked), float(from_lamps / evenly)


def _tints(passing: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of sums of what passes cells, and of how many (N, S, S, 4): colours of the cells (N, S, S, 3) and of all cells
    together (N, 3) over the chance to pass; and which of N have cells that differ by more than an opacity can say."""
    passing = np.where(np.isfinite(passing).all(axis=-1, keepdims=True), passing, 0.0).astype(float)
    mean = _over_chance(passing[..., :3].sum(axis=(1, 2)))
    cells = passing[..., :3] / np.maximum(passing[..., 3:], 1.0)
    own = _over_chance(cells)
    away = np.abs(own - mean[:, None, None]) * cells.mean(axis=-1, keepdims=True)
    return own, mean, away.max(axis=(1, 2, 3)) > ALIKE


def _over_chance(passing: np.ndarray) -> np.ndarray:
    """(..., 3) over its mean, which is the chance to pass; ones where nothing does."""
    chance = passing.mean(axis=-1, keepdims=True)
    return np.where(chance > 1e-4, passing / np.maximum(chance, 1e-4), 1.0)


def packed_tints(tint: np.ndarray) -> np.ndarray:
    """(...) numbers for colours (..., 3) that sum to 3: square roots of a third in steps of 1 / STEPS, red in the low
    byte. `unpack_tint` of shaders/trace/hierarchy.glsl is the inverse."""
    steps = np.rint(np.sqrt(np.clip(tint / 3.0, 0.0, 1.0)) * STEPS)
    return steps @ ((STEPS + 1) ** np.arange(3))


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
