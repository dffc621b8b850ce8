"""What rays meet, triangle by triangle: corners, and what leaves of the hierarchy hold of their looks.

Whether a ray passes a triangle is one number, which holds the opacity of both sides, or where to look for that place by
place (opacity_maps.py), and which rays it is about. Instances of one kind look the same, so that all their triangles
are made together.

Cost: numpy over all triangles of all instances, some 0.3 us each.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import groupby
from types import MappingProxyType

import numpy as np

from ..materials.compiled import CompiledMaterial
from ..materials.energy import pane_passing
from ..snapshot.scene import LAST_GROUP, Instance, Mesh
from .emission_maps import EmissionMaps, TriangleEmission
from .glass_sheets import ALONE, NO_SHEETS, Sheets, open_parts
from .opacity_maps import OpacityMaps, TriangleOpacity, packed_tints

AT_ONCE = 1 << 16  # triangles of copies that are expanded together: one by one numpy's calls take longer than its work
# Which rays a triangle stops: all, all but those to lights, those alone, all and those to lights for certain.
ALL_RAYS, OPEN_TO_SHADOW, SHADOW_ALONE, WHOLE_SHADOW = range(4)
SHEET = WHOLE_SHADOW  # of glass, which stops none for certain: all rays, by the side that they meet
MAPPED = 4  # added to the above: what follows is a tile of OpacityMaps
FRONT_ALONE = 0.25  # added to the material's number
TINT_CODE = 1000.0  # taken from minus the colour of what passes, in the place of what is emitted
# In the place of red: green names the tile whose colours these are, or is minus a colour (packed_tints); 0: that of the
# record. Blue names the record of what the inside absorbs, negative where corners run the other way round, 0: nothing.
STAINED = -2.0 * TINT_CODE
NO_RECORDS: Mapping[int, int] = MappingProxyType({})
RECORD = 2  # texels of such a record: what is absorbed, 1/m; mean colour of what passes a face, over the chance to pass
# Above that number stand the groups of light linking, of receivers and of blockers, those beyond the last one as one:
# all of it, and the quarter, is exact in one float.
MATERIAL_BITS, GROUP_BITS = 14, 4
SIDE_STEPS = 2047  # of the opacity of a side: those of two, and the above, are exact in one float
NORMAL_STEPS = 4095  # of each octahedral coordinate: two of them are exact in one float


def world_triangles(
    instances: list[Instance],
    meshes: dict[str, Mesh],
    materials: list[CompiledMaterial],
    origin: np.ndarray,
    path: str,
    maps: OpacityMaps,
    glow: EmissionMaps,
    sheets: Sheets = NO_SHEETS,
    absorbing: Mapping[int, int] = NO_RECORDS,
) -> tuple[np.ndarray, np.ndarray]:
    """All triangles that rays of `path` (a name of Visibility), or from their ends to lights, can meet: corners
    (T, 3, 3) float32 relative to `origin`, and (T, 8) float32 opacity (_codes), mean emitted radiance, number of the
    material (with the side that emits, mean_emission) and packed corner normals. `sheets`: see
    glass_sheets.py; `absorbing`: see absorption_records."""
    look = {
        (rays, mirrored): np.array([
            (mean_code(m, rays), *(_absorption_code(absorbing[k], mirrored) if k in absorbing else radiance), k + side)
            for k, m in enumerate(materials)
            for radiance, side in [mean_emission(m, mirrored)]
        ])
        for rays in (ALL_RAYS, OPEN_TO_SHADOW, SHADOW_ALONE)
        for mirrored in (False, True)
    }  # fmt: skip
    shown = [one for one in instances if is_met(one, path) and meshes[one.mesh].triangle_count]
    total = sum(meshes[one.mesh].triangle_count for one in shown)
    corners, looks, made = np.empty((total, 3, 3), np.float32), np.empty((total, 8), np.float32), 0
    # Of instances with equal kinds all triangles look the same.
    matrices_of_all = np.array([one.matrix[:3] for one in shown], float).reshape(-1, 3, 4)
    turns = np.linalg.det(matrices_of_all[:, :, :3])
    cofactors_of_all, first_of_kind = _cofactors(matrices_of_all[:, :, :3]), 0
    kinds = zip(shown, (
        (*maps.kind_of(one), glow.kind_of(one), rays_met(one, path), links_code(one), turn < 0.0,
         sheets.get(id(one), frozenset()))
        for one, turn in zip(shown, turns)
    ))  # fmt: skip
    for (key, slots, _, _, rays, links, mirrored, single), group in groupby(kinds, lambda pair: pair[1]):
        mesh = meshes[key]
        of_triangle = mesh.triangle_materials(slots)
        look_of_triangle = look[rays, bool(mirrored)][of_triangle]
        copies, at_once = [one for one, _ in group], max(AT_ONCE // mesh.triangle_count, 1)
        known = maps.of(copies[0])
        if known is not None:
            _refine(look_of_triangle, of_triangle, materials, known, rays, bool(mirrored))
        if rays == ALL_RAYS and single:
            _let_leave(look_of_triangle, of_triangle, materials, single, mesh, bool(mirrored))
        shining = glow.of(copies[0])
        if shining is not None:
            _shine(look_of_triangle, of_triangle, shining, bool(mirrored))
        look_of_triangle[:, 4] += links
        for first in range(0, len(copies), at_once):
            own = slice(first_of_kind + first, first_of_kind + min(first + at_once, len(copies)))
            matrices = matrices_of_all[own]
            turned, moved = matrices[:, :, :3], (matrices[:, :, 3] - origin).astype(np.float32)
            world = mesh.positions @ turned.transpose(0, 2, 1).astype(np.float32) + moved[:, None]
            normals = _packed_normals(mesh.corner_normals @ cofactors_of_all[own].transpose(0, 2, 1))
            count, triangles = len(matrices), mesh.triangle_count
            new = slice(made, made + count * triangles)
            corners[new].reshape(count, triangles, 3, 3)[:] = world[:, mesh.corner_vertices[mesh.triangle_corners]]
            look_of_copies = looks[new].reshape(count, triangles, 8)
            look_of_copies[..., :5], look_of_copies[..., 5:] = look_of_triangle, normals[:, mesh.triangle_corners]
            made = new.stop
        first_of_kind += len(copies)
    return corners, looks


def absorption_records(
    materials: list[CompiledMaterial], shown: Iterable[Instance], maps: OpacityMaps
) -> tuple[np.ndarray, dict[int, int]]:
    """Texels (N, 4) that follow those of OpacityMaps, for materials of glass on `shown` whose inside absorbs; and where
    the record of each such material begins among all texels."""
    first = max(len(maps.texels), 1)  # 0 is none
    used = {0}.union(*{one.materials for one in shown})  # faces without a material have the first one
    own = {k: m for k, m in enumerate(materials) if k in used and any(m.absorbed_inside) and not m.emissive}
    texels = np.zeros((first - len(maps.texels) + RECORD * len(own) if own else 0, 4), np.float32)
    for row, material in zip(texels[first - len(maps.texels) :].reshape(-1, RECORD, 4), own.values()):
        row[0, :3], row[1, :3] = material.absorbed_inside, material.tint if material.tinted else 1.0
    return texels, {k: first + RECORD * number for number, k in enumerate(own)}


def _absorption_code(record: int, mirrored: bool) -> tuple[float, float, float]:
    """What stands for emission where the inside absorbs: that there is a record, no tile of colours, and where the
    record (absorption_records) begins among the texels; below 0 where corners run the other way round."""
    return STAINED, 0.0, -record if mirrored else record


def links_code(instance: Instance) -> int:
    """What is added to the material's number for the groups of an instance."""
    links = instance.links
    return (min(links.receiver, LAST_GROUP) + (min(links.blocker, LAST_GROUP) << GROUP_BITS)) << MATERIAL_BITS


def is_met(instance: Instance, path: str) -> bool:
    return getattr(instance.visibility, path) or instance.visibility.shadow


def rays_met(instance: Instance, path: str) -> int:
    """Which rays meet an instance."""
    if not getattr(instance.visibility, path):
        return SHADOW_ALONE
    return ALL_RAYS if instance.visibility.shadow else OPEN_TO_SHADOW


def mean_code(material: CompiledMaterial, rays: int = ALL_RAYS) -> float:
    """The code of triangles of a material of which no more is known than its mean opacity."""
    if not material.transparent:
        return float(_codes(rays, np.ones(2), False, False))
    stopped, whole = _stopped(material, rays)
    opacity = 1.0 if whole else min(material.opacity, 1.0 - 1.0 / SIDE_STEPS)  # some ray may pass, however few
    return float(_codes(stopped, _of_glass(material, opacity), False, material.glass is not None))


def _of_glass(material: CompiledMaterial, opacity: np.ndarray | float) -> np.ndarray:
    """(..., 2) opacity of two sides that are alike. Those of glass have the places of opacity for rays from lamps and
    for others, whose light comes from all sides."""
    both = np.stack([np.asarray(opacity, float)] * 2, axis=-1)
    if material.glass is not None and material.glass.fresnel:
        from_lamps, evenly = pane_passing(material.glass.ior)
        both[..., 1] = 1.0 - (1.0 - both[..., 1]) * evenly / from_lamps
    return both


def opaque_code() -> float:
    """The code of triangles that stop every ray."""
    return float(_codes(ALL_RAYS, np.ones(2), False, False))


def _stopped(material: CompiledMaterial, rays: int) -> tuple[int, bool]:
    """Which rays a transparent material's triangles stop, and whether they stop those wherever they meet them."""
    if material.casts_stochastically or material.glass:
        return rays, False
    return (WHOLE_SHADOW if rays == ALL_RAYS else rays), rays == SHADOW_ALONE


def _codes(stopped: int, sides: np.ndarray, mirrored: bool, glass: bool, tile=0) -> np.ndarray:
    """What decides whether rays pass triangles, as shaders/trace/hierarchy.glsl reads it: coverage (..., 2) of front
    and back by which they pass at random, or, where it is not 0, the `tile` (...) that tells it for each place, and
    which rays that is about; negative where rays may also be bent: then the first side is for rays from lamps and the
    second one for others; but of a sheet (SHEET, which is WHOLE_SHADOW where nothing is bent) they are its sides.
    `mirrored`: corners run the other way round."""
    sides = sides[..., ::-1] if mirrored and not glass else sides
    steps = np.rint(np.clip(sides, 0.0, 1.0) * SIDE_STEPS)
    even = (stopped * (SIDE_STEPS + 1) + steps[..., 0]) * (SIDE_STEPS + 1) + steps[..., 1]
    # Twice a whole number: beyond 2^24 every second one is a float.
    tiled = (MAPPED + stopped) * (SIDE_STEPS + 1) ** 2 + 2 * (2 * np.asarray(tile) + mirrored)
    codes = np.where(np.asarray(tile) > 0, tiled, even).astype(float)
    return -np.maximum(codes, 1.0) if glass else codes


def _refine(
    look: np.ndarray,
    of_triangle: np.ndarray,
    materials: list[CompiledMaterial],
    known: TriangleOpacity,
    rays: int,
    mirrored: bool,
) -> None:
    """Put what OpacityMaps found of an instance's triangles, `known`, into their rows of `look`."""
    for number in np.unique(of_triangle[known.measured]):
        material = materials[number]
        stopped, whole = _stopped(material, rays)
        if not whole:
            own = np.flatnonzero(known.measured & (of_triangle == number))
            glass = material.glass is not None
            even = known.sides[own].mean(axis=-1)
            sides = np.stack([1.0 - (1.0 - even) * known.to_lamps[own], even], axis=-1) if glass else known.sides[own]
            look[own, 0] = _codes(stopped, sides, mirrored, glass, known.tile[own])
            if material.tinted and not material.emissive:
                look[own, 3] = look[own, 3] if any(material.absorbed_inside) else 0.0
                look[own, 1] = STAINED
                look[own, 2] = np.where(known.stained[own], known.tile[own], -packed_tints(known.tint[own]))


def _let_leave(
    look: np.ndarray, of_triangle: np.ndarray, materials: list[CompiledMaterial], single: frozenset[int], mesh: Mesh,
    mirrored: bool,
) -> None:  # fmt: skip
    """Of the parts `single` of a mesh let pass from within what is left of even light there: it has spread over n2 as
    many directions, and total reflection keeps the rest."""
    size = SIDE_STEPS + 1
    of_sheet = np.isin(open_parts(mesh), [*single]) & (np.abs(look[:, 0]) < MAPPED * size**2)
    for number in np.unique(of_triangle[of_sheet]):
        glass = materials[number].glass
        if glass is None or glass.share <= ALONE:
            continue
        own = np.flatnonzero(of_sheet & (of_triangle == number))
        passing = 1.0 - np.abs(look[own, 0]) % size / SIDE_STEPS  # of even light, the second side
        leaving = passing / max(glass.ior, 1.0) ** 2
        look[own, 0] = -_codes(SHEET, 1.0 - np.stack([passing, leaving], axis=-1), mirrored, False)


def is_sheet(codes: np.ndarray) -> np.ndarray:
    """(...) whether these are codes of glass that is no closed solid."""
    return (codes < 0) & (np.abs(codes) // (SIDE_STEPS + 1) ** 2 == SHEET)


def mean_emission(material: CompiledMaterial, mirrored: bool = False) -> tuple[tuple[float, float, float], float]:
    """Mean radiance that a triangle emits, and what is added to the number of its material where it does so to one side
    only: FRONT_ALONE or -FRONT_ALONE. Of two sides that both shine the mean stands for either. What is dark and colours
    light that passes has minus its colour over the chance to pass, less TINT_CODE."""
    front, behind = material.emission, material.emission_behind
    if not material.emissive:
        return tuple(-TINT_CODE - channel for channel in material.tint) if material.tinted else (0.0, 0.0, 0.0), 0.0
    if front == behind or (any(front) and any(behind)):
        return tuple((a + b) / 2 for a, b in zip(front, behind)), 0.0
    side = FRONT_ALONE if any(front) else -FRONT_ALONE
    return (front if any(front) else behind), -side if mirrored else side


def _shine(look: np.ndarray, of_triangle: np.ndarray, known: TriangleEmission, mirrored: bool) -> None:
    """Put what EmissionMaps found of an instance's triangles, `known`, into their rows of `look`, as mean_emission
    does."""
    own = np.flatnonzero(known.measured)
    front, behind = known.mean[own, 0], known.mean[own, 1]
    lit, lit_behind = front.any(axis=1), behind.any(axis=1)
    both = (lit & lit_behind)[:, None]
    look[own, 1:4] = np.where(both, (front + behind) / 2, front + behind)
    side = FRONT_ALONE * (lit.astype(float) - lit_behind)
    look[own, 4] = of_triangle[own] + (-side if mirrored else side)


def coverage(codes: np.ndarray, maps: OpacityMaps) -> np.ndarray:
    """(N,) mean of the two sides' opacity, of what world_triangles says of (N,) triangles."""
    codes = codes.astype(np.float64)  # whole numbers: exact in single precision, too
    sides = np.abs(codes) % (SIDE_STEPS + 1) ** 2
    mean = (sides // (SIDE_STEPS + 1) + sides % (SIDE_STEPS + 1)) / (2 * SIDE_STEPS)
    tiled = np.abs(codes) >= MAPPED * (SIDE_STEPS + 1) ** 2
    if tiled.any():
        mean[tiled] = maps.means[(sides[tiled] / 4).astype(int)]
    return mean


def is_empty(codes: np.ndarray) -> np.ndarray:
    """(N,) triangles that no ray can meet."""
    return (codes >= 0) & (codes % (SIDE_STEPS + 1) ** 2 == 0) & (codes < WHOLE_SHADOW * (SIDE_STEPS + 1) ** 2)


def _cofactors(matrices: np.ndarray) -> np.ndarray:
    """(K, 3, 3) that take normals to world space, outwards where an object is mirrored; also where it is flattened."""
    a, b, c = np.moveaxis(matrices, 2, 0)
    columns = np.cross(b, c), np.cross(c, a), np.cross(a, b)
    mirrored = (a * columns[0]).sum(axis=1) < 0
    return np.stack(columns, axis=2) * np.where(mirrored, -1.0, 1.0)[:, None, None]


def _packed_normals(normals: np.ndarray) -> np.ndarray:
    """(..., 3) of any length as (...) numbers: octahedral coordinates side by side; unpacked in shaders/trace."""
    x, y, z = (normals[..., axis] for axis in range(3))
    size = np.maximum(np.abs(x) + np.abs(y) + np.abs(z), 1e-30)
    x, y, front = x / size, y / size, z >= 0.0
    steps = [
        np.floor((np.where(front, one, (1.0 - np.abs(other)) * np.where(one >= 0.0, 1.0, -1.0)) * 0.5 + 0.5)
                 * NORMAL_STEPS + 0.5)
        for one, other in ((x, y), (y, x))
    ]  # fmt: skip
    packed = steps[0] + (NORMAL_STEPS + 1) * steps[1]
    packed[np.isnan(packed)] = 0.0
    return packed
