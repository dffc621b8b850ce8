"""Patches as one list of half floats for shaders, laid out as shaders/grass/table.glsl reads it.

For each view one picture more than there are lights is listed: what the tile reflects of a uniform sky, by the same
components. It is the albedo that indirect light and the colour passes ask for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .compression import LUMA
from .patch import MOST_LUMA, MOST_RINGS, Patch

WIDTH = 2048  # texels a row
ENTRY, PICTURE, PLACE = 27, 5, 4  # texels
VIEW_RINGS, LIGHT_RINGS, MAP, VARIED, HEIGHT_MAP, FINER_RINGS = 3, 11, 16, 17, 18, 19
MOST_MAP = 256  # texels along a side of a density map
ALIGNED = 16  # rows: the number of the first one is exact in a half float


@dataclass(frozen=True)
class Field:
    """How a material shows a patch. `size` of the tile and `height` of the blades in metres, `density` 0..1, and what
    it is multiplied by: `density_map` (H, W), row 0 at the lowest y, over a square of `map_size` metres; None for 1.
    `height_map`: the same for the height. `varied`: places show the tile shifted at random (grass/surface.glsl).
    `tiles`: along the unit of a UV map, whose square the maps then cover; 0 where the object's axes place tiles."""

    patch: Patch
    size: float
    height: float
    density: float
    density_map: np.ndarray | None = None
    map_size: float = 0.0
    varied: bool = False
    height_map: np.ndarray | None = None
    tiles: float = 0.0


def table_of(fields: Sequence[Field]) -> np.ndarray:
    """(rows, WIDTH, 4) float32; entry i is that of fields[i]. Fields may share a patch; each has its own map."""
    first = _aligned(-(-ENTRY * len(fields) // WIDTH))
    parts, rows, begins = [], first, {}
    for field in fields:
        if id(field.patch) not in begins:
            begins[id(field.patch)] = rows
            listed = np.concatenate([_pictures(field.patch), _places(field.patch), _finer(field.patch)])
            taken = _aligned(-(-len(listed) // WIDTH))
            parts.append(np.zeros((taken * WIDTH, 4), np.float32))
            parts[-1][: len(listed)] = listed
            rows += taken
    head = np.zeros((first * WIDTH, 4), np.float32)
    for k, field in enumerate(fields):
        head[k * ENTRY : (k + 1) * ENTRY] = _entry(field, begins[id(field.patch)])
        for texel, values in ((MAP, field.density_map), (HEIGHT_MAP, field.height_map)):
            if values is None:
                continue
            shown = reduced(values)
            taken = _aligned(-(-shown.size // WIDTH))
            parts.append(np.zeros((taken * WIDTH, 4), np.float32))
            parts[-1][: shown.size, 0] = shown.ravel()
            head[k * ENTRY + texel] = rows, shown.shape[1], shown.shape[0], field.map_size
            rows += taken
    return np.concatenate([head, *parts]).reshape(-1, WIDTH, 4)


def reduced(values: np.ndarray) -> np.ndarray:
    """The map with at most MOST_MAP texels a side, means of whole blocks of it, within 0..1 and finite."""
    values = np.clip(np.nan_to_num(values, posinf=1.0, neginf=0.0), 0.0, 1.0)
    for axis in (0, 1):
        step = -(-values.shape[axis] // MOST_MAP)
        edges = np.arange(0, values.shape[axis], step)
        counts = np.diff([*edges, values.shape[axis]])
        values = np.add.reduceat(values, edges, axis=axis) / np.expand_dims(counts, 1 - axis)
    return values


def _aligned(rows: int) -> int:
    return -(-rows // ALIGNED) * ALIGNED


def _entry(field: Field, row: int) -> np.ndarray:
    patch = field.patch
    slope = patch.height / patch.size
    rows = np.zeros((ENTRY, 4))
    rows[0] = row, patch.texels, patch.views.number, patch.lights.number
    finer = patch.finer_lights
    rows[1] = field.size, field.height, field.density, 0 if finer is None else len(finer.polar)
    rows[2] = patch.white, slope, len(patch.views.polar), len(patch.lights.polar)
    rows[VARIED, :3] = field.varied, field.tiles, 0 if finer is None else finer.number
    mean = patch.mean_heights()
    for start, rings, most in ((VIEW_RINGS, patch.views, MOST_RINGS[0]), (LIGHT_RINGS, patch.lights, MOST_RINGS[1])):
        for k, (polar, count, first) in enumerate(list(zip(rings.polar, rings.counts, rings.firsts))[:most]):
            own = float(mean[first : first + count].mean()) if rings is patch.views else float(k)
            rows[start + k] = polar, count, first, own
    if finer is not None:
        rows[FINER_RINGS : FINER_RINGS + len(finer.polar), :3] = np.stack([finer.polar, finer.counts, finer.firsts], 1)
    return rows


def _finer(patch: Patch) -> np.ndarray:
    rows = np.zeros((0 if patch.finer is None else patch.finer[..., 0].size, 4), np.float32)
    rows[:, :3] = finer_ratios(patch).reshape(-1, 3)
    return rows


def finer_ratios(patch: Patch) -> np.ndarray:
    """(V, M, 3): the tile's mean under each of the finer lights over what its pictures give there."""
    if patch.finer is None:
        return np.zeros((patch.views.number, 0, 3))
    lights, wanted = patch.lights, patch.finer_lights.vectors
    numbers, shares = lights.weights(wanted)  # (M, 4)
    seen, cosines = patch.views.vectors[:, 2, None, None], lights.vectors[:, 2]
    ring = np.searchsorted(np.array(lights.firsts), numbers[:, 0], side="right") - 1
    power = powers(patch)[:, np.minimum(ring, MOST_RINGS[1] - 2)][..., None]
    law = ((cosines[numbers] + seen) / (wanted[:, 2, None] + seen)) ** power
    share = shares * law * wanted[:, 2, None] / cosines[numbers]  # (V, M, 4)
    given = np.einsum("vmk,vmkc->vmc", share, patch.picture_mean[:, numbers])
    found = np.clip(patch.finer / np.maximum(given, 1e-8), 0.2, 5.0)
    return np.where((shares.max(axis=1) > 1.0 - 1e-6)[:, None], 1.0, found)  # pictures have less noise than small ones


def powers(patch: Patch) -> np.ndarray:
    """(V, MOST_RINGS - 1) p for each pair of rings of lights: a view's mean over them runs as i / (i + v)^p with the
    cosines i of light and v of view; 0 as a plane's, 1 as that of leaves which scatter once. What rises towards the
    normal, as light from behind the viewer does, has no such law and is 0."""
    lights, means = patch.lights, patch.picture_mean[:, :-1] @ LUMA
    rings = [means[:, first : first + count].mean(axis=1) for first, count in zip(lights.firsts, lights.counts)]
    cosines = np.cos(np.radians(lights.polar))
    seen = patch.views.vectors[:, 2]
    found = np.zeros((patch.views.number, MOST_RINGS[1] - 1))
    for k in range(len(rings) - 1):
        (a, b), (i, j) = rings[k : k + 2], cosines[k : k + 2]
        higher = np.log(np.maximum(b / j, 1e-9) / np.maximum(a / i, 1e-9))
        found[:, k] = np.clip(higher / np.log((i + seen) / (j + seen)), 0.0, 1.5)
    return found


def _places(patch: Patch) -> np.ndarray:
    k, c = patch.luma, patch.chroma
    rows = np.zeros((patch.views.number, patch.texels, patch.texels, PLACE, 4), np.float32)
    rows[..., 0, :3], rows[..., 0, 3] = patch.mean, patch.heights
    luma = np.zeros((*patch.parts.shape[:3], MOST_LUMA), np.float32)
    luma[..., :k] = patch.parts[..., :k]
    rows[..., 1, :], rows[..., 2, :] = luma[..., :4], luma[..., 4:]
    for start in (0, 1):
        rows[..., 3, 2 * start : 2 * start + c] = patch.parts[..., k + start * c : k + (start + 1) * c]
    return rows.reshape(-1, 4)


def _pictures(patch: Patch) -> np.ndarray:
    k, c = patch.luma, patch.chroma
    weights = patch.weights.transpose(0, 2, 1)  # (V, P, K + 2C)
    rows = np.zeros((*weights.shape[:2], PICTURE, 4), np.float32)
    luma = np.zeros((*weights.shape[:2], MOST_LUMA), np.float32)
    luma[..., :k] = weights[..., :k]
    rows[..., 0, :], rows[..., 1, :] = luma[..., :4], luma[..., 4:]
    for start in (0, 1):
        rows[..., 2, 2 * start : 2 * start + c] = weights[..., k + start * c : k + (start + 1) * c]
    rows[..., 3, :3], rows[..., 3, 3] = patch.picture_mean, patch.contrast
    rows[..., 4, :3], rows[..., 4, 3] = patch.ratio, patch.excess
    about = np.zeros((len(rows), 1, PICTURE, 4), np.float32)
    about[:, 0, 0, 0], about[:, 0, 0, 1] = patch.view_alike, patch.light_alike
    about[:, 0, 0, 2] = patch.views.vectors[:, 2]
    about[:, 0, 0, 3] = patch.view_alike if patch.view_alike_far is None else patch.view_alike_far
    about[:, 0, 1, : MOST_RINGS[1] - 1] = powers(patch)
    return np.concatenate([rows, about], axis=1).reshape(-1, 4)
