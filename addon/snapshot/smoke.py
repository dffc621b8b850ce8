"""Smoke and fire of Blender's fluid simulation: the grids of gas domains, as volumes beside those of OpenVDB objects.

A domain is a mesh with a fluid modifier. What stands in its evaluated grids (density, color, flame, temperature, heat)
is laid over its mesh's texture space, as Cycles does, and its mesh itself is not drawn. Colours are stored multiplied
by density; they are divided by it here. A domain that has not been simulated at this frame is empty, and says so.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence

import numpy as np

from .cache import SnapshotCache, next_version
from .instances import Place, domain_of
from .scene import Note, Volume, VolumeInstance

GRIDS = ("density", "flame", "temperature", "heat")  # attributes of Cycles, one number a cell


def read_smoke(
    places: Sequence[Place], matrices: np.ndarray, shading, override, cache: SnapshotCache, notes: list[Note]
) -> tuple[VolumeInstance, ...]:
    """What stands in the domains at these places (N, 4, 4). `override`: material of all, or None."""
    found, used = [], set()
    for place, matrix in zip(places, matrices, strict=True):
        facts = place.source.facts
        volume = _volume(place.source, f"smoke {facts.uid}", cache)
        if volume is None:
            text = "its smoke is not drawn: nothing has been simulated or baked for this frame."
            notes.append(Note(f"Object '{facts.name}'", text))
            continue
        used.add(volume.key)
        material = shading.index_of(override or next(iter(place.source.materials), None))
        found.append(
            VolumeInstance(
                facts.name, volume, matrix.astype(np.float64), material, facts.visibility, place.key, 1.0, facts.group
            )
        )
    for key in {key for key in cache.volumes if key.startswith("smoke ")} - used:
        del cache.volumes[key]
    return tuple(found)


def _volume(source, key: str, cache: SnapshotCache) -> Volume | None:
    settings = domain_of(source.owner)
    if settings is None:
        return None
    grids = domain_grids(settings)
    if not grids:
        return None
    to_object = _to_object(source.data, next(iter(grids.values())).shape[:3])
    state = tuple((name, values.shape, zlib.crc32(values)) for name, values in grids.items()), to_object.tobytes()
    known = cache.volumes.get(key)
    if known is not None and known[0] == state:
        return known[1]
    volume = Volume(key, next_version(), grids, np.zeros(3), to_object)
    cache.volumes[key] = state, volume
    return volume


def domain_grids(settings) -> dict[str, np.ndarray]:
    """Arrays (X, Y, Z), of color (X, Y, Z, 3), by the names of their attributes; none where nothing was simulated."""
    density = _flat(settings.density_grid)
    size = tuple(int(side) for side in settings.domain_resolution)
    if settings.use_noise and density.size != np.prod(size):
        size = tuple(side * settings.noise_scale for side in size)
    if density.size != np.prod(size) or not (density.any() or _flat(settings.flame_grid).any()):
        return {}
    grids = {}
    for name in GRIDS:
        values = density if name == "density" else _flat(getattr(settings, f"{name}_grid"))
        if values.size == density.size:
            grids[name] = _dense(values, size)
    color = _flat(settings.color_grid)
    if color.size == 4 * density.size:
        color = color.reshape(-1, 4)
        alpha = color[:, 3:]
        color = np.where(alpha > 0, color[:, :3] / np.where(alpha > 0, alpha, 1.0), 0.0)
        grids["color"] = np.stack([_dense(color[:, k], size) for k in range(3)], axis=-1)
    return {name: np.ascontiguousarray(values) for name, values in grids.items()}


def _flat(values) -> np.ndarray:
    found = np.zeros(len(values), np.float32)
    if len(found) and hasattr(values, "foreach_get"):
        values.foreach_get(found)
    elif len(found):
        found[:] = values
    return np.nan_to_num(found, nan=0.0, posinf=0.0, neginf=0.0)


def _dense(values: np.ndarray, size: tuple[int, int, int]) -> np.ndarray:
    """(X, Y, Z) of values whose x runs fastest."""
    return values.reshape(size[::-1]).transpose(2, 1, 0)


def _to_object(mesh, size: tuple[int, int, int]) -> np.ndarray:
    """(3, 4) from voxel indices to object space: the voxels fill the texture space of the domain's mesh."""
    middle, half = np.array(mesh.texspace_location, float), np.array(mesh.texspace_size, float)
    step = 2 * half / np.array(size)
    return np.column_stack([np.diag(step), middle - half + step / 2])
