"""OpenVDB objects: their grids as dense arrays, read through Blender's own `openvdb` module.

Blender writes a volume that modifiers made or changed to a temporary file, which is read and removed. Grids of one
object that share the first one's voxels are laid over a common box; others are read at its voxels' centres. Grids
longer than MOST_VOXELS on a side are averaged by whole factors first.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import bpy
import numpy as np

from . import vdb_header
from .cache import SnapshotCache, next_version
from .instances import Place
from .scene import Note, Volume, VolumeInstance

MOST_VOXELS = 192  # on a side
MOST_GRIDS = 6  # of one object
MOST_READ = 1 << 33  # voxels of a box, read in layers
MOST_RESAMPLED = 1 << 28  # of one that is held as a whole


def read_volumes(
    places: Sequence[Place],
    matrices: np.ndarray,
    shading,
    override,
    cache: SnapshotCache,
    notes: list[Note],
    final: bool,
) -> tuple[VolumeInstance, ...]:
    """The volumes at these places (N, 4, 4). Reads files only when they, or the objects, have changed.

    `override`: material of all, or None; `final`: modifiers are those of renders.
    """
    found, used = [], set()
    numbers: dict[int, list[int]] = {}  # addresses of the volumes that each object made, by its session_uid
    for place, matrix in zip(places, matrices, strict=True):
        source, facts = place.source, place.source.facts
        made_key = ""
        if not facts.data_uid or any(_is_on(one, final) for one in source.owner.original.modifiers):
            made = numbers.setdefault(facts.uid, [])
            if source.pointer not in made:
                made.append(source.pointer)
            made_key = f"volume {facts.uid} #{made.index(source.pointer)}"
        volume = _volume(source.data, facts.name, made_key, cache, notes)
        if volume is None:
            continue
        used.add(volume.key)
        material = shading.index_of_volume(override or next(iter(source.materials), None))
        density = _density(source.data, matrix)
        found.append(
            VolumeInstance(facts.name, volume, matrix, material, facts.visibility, place.key, density, facts.group)
        )
    for key in {key for key in cache.volumes if key.startswith("volume ")} - used:
        del cache.volumes[key]
    return tuple(found)


def _is_on(modifier, final: bool) -> bool:
    return modifier.show_render if final else modifier.show_viewport


def _density(data, matrix: np.ndarray) -> float:
    """Coefficients are per unit of the object's space, unless it says that they are per metre."""
    if data.render.space != "OBJECT":
        return 1.0
    scale = float(np.linalg.norm(matrix[:3, :3] @ np.full(3, 3**-0.5)))
    return 1.0 / scale if scale > 0 else 1.0


def _volume(data, name: str, made_key: str, cache: SnapshotCache, notes: list[Note]) -> Volume | None:
    """`made_key`: key of a volume that modifiers made, empty for the object's own, which its file tells all of."""
    subject = f"Object '{name}'"
    try:
        data.grids.load()
    except RuntimeError as error:
        notes.append(Note(subject, f"its volume cannot be read: {error}."))
        return None
    path = bpy.path.abspath(data.grids.frame_filepath or "", library=data.library)
    file = not made_key and bool(path) and Path(path).is_file()
    key = f"volume {path}" if file else made_key or f"volume {(data.original or data).session_uid}"
    stat = Path(path).stat() if path and Path(path).is_file() else None
    # What modifiers make is a new data-block, with a number of its own, whenever they are evaluated; what they let pass
    # is that of the file.
    made = 0 if file else data.session_uid
    state = (made, path, stat and stat.st_mtime_ns, stat and stat.st_size)
    known = cache.volumes.get(key)
    if known is not None and known[0] == state and (file or made):
        return known[1]
    grids = None
    try:
        if file:
            grids = _grids(path)
        elif len(data.grids):
            with tempfile.TemporaryDirectory(prefix="candela_") as folder:
                made = str(Path(folder) / "volume.vdb")
                data.grids.save(filepath=made)
                grids = _grids(made)
    except Exception as error:  # a foreign library reads a foreign file
        notes.append(Note(subject, f"its volume cannot be read: {error}."))
    if not grids:
        notes.append(Note(subject, "its volume has no grid with active voxels and is not drawn."))
        return None
    arrays, low, to_object = grids
    volume = Volume(key, next_version(), arrays, low, to_object)
    if known is not None and _alike(known[1], volume):
        volume = known[1]
    cache.volumes[key] = state, volume
    return volume


def _alike(one: Volume, other: Volume) -> bool:
    return (
        one.grids.keys() == other.grids.keys()
        and all(np.array_equal(values, other.grids[name]) for name, values in one.grids.items())
        and np.array_equal(one.low, other.low)
        and np.array_equal(one.to_object, other.to_object)
    )


def openvdb():
    """Blender's module. The wheel keeps it beside Blender's other modules, off the path."""
    try:
        import openvdb as module
    except ImportError:
        version = f"python{sys.version_info[0]}.{sys.version_info[1]}"
        places = [Path(bpy.utils.resource_path(kind)) / "python" / "lib" for kind in ("LOCAL", "SYSTEM")]
        places = [place / version / "site-packages" for place in places]
        sys.path += [str(place) for place in places if place.is_dir() and str(place) not in sys.path]
        import openvdb as module
    return module


def _grids(path: str):
    """(arrays by name, lowest voxel, (3, 4) from voxel indices to object space); None without active voxels."""
    vdb_header.check(path)
    grids, _ = openvdb().readAll(path)
    grids = [grid for grid in grids if hasattr(grid, "copyToArray") and grid.activeVoxelCount()][:MOST_GRIDS]
    if not grids:
        return None
    first = next((grid for grid in grids if grid.name == "density"), grids[0])
    rows = _rows(first)
    boxes = [grid.evalActiveVoxelBoundingBox() for grid in grids if np.allclose(_rows(grid), rows, rtol=1e-5)]
    low = np.min([box[0] for box in boxes], axis=0)
    high = np.max([box[1] for box in boxes], axis=0)
    size = high - low + 1
    _check(size, MOST_READ)
    factor = int(max(-(-size.max() // MOST_VOXELS), 1))
    arrays = {}
    for grid in grids:
        vector = isinstance(grid.background, tuple)
        if np.allclose(_rows(grid), rows, rtol=1e-5):
            arrays[grid.name] = _means(grid, low, size, vector, factor)
        else:
            arrays[grid.name] = _coarser(_finite(_resampled(grid, rows, low, size, vector)), factor)
    return arrays, *_frame(rows, low, factor)


def _frame(rows: np.ndarray, low: np.ndarray, factor: int) -> tuple[np.ndarray, np.ndarray]:
    """Lowest voxel and map of voxel indices where `factor` voxels along each axis became one."""
    if factor == 1:
        return low.astype(np.float64), rows
    scaled = rows.copy()
    scaled[:, 3] += rows[:, :3] @ (low + (factor - 1) / 2)
    scaled[:, :3] *= factor
    return np.zeros(3), scaled


def _check(size: np.ndarray, most: int) -> None:
    """ValueError where a box of so many voxels is more than `most`: two voxels far apart fill any memory."""
    if np.prod(size, dtype=np.float64) > most:
        sides = " x ".join(str(int(side)) for side in size)
        raise ValueError(f"voxels span a box of {sides}, more than can be read; split it, or resample it")


def _means(grid, low: np.ndarray, size: np.ndarray, vector: bool, factor: int) -> np.ndarray:
    """Means of `factor` voxels along each axis, read layer by layer: all at once may be more than memory holds."""
    parts, thick = [], int(size[0]) if factor == 1 else factor
    for x in range(0, int(size[0]), thick):
        layer = (min(thick, int(size[0]) - x), int(size[1]), int(size[2]))
        dense = np.zeros((*layer, 3) if vector else layer, np.float32)
        grid.copyToArray(dense, ijk=(int(low[0]) + x, int(low[1]), int(low[2])))
        parts.append(_coarser(_finite(dense), factor))
    return np.concatenate(parts)


def _finite(dense: np.ndarray) -> np.ndarray:
    return np.nan_to_num(dense, nan=0.0, posinf=0.0, neginf=0.0)


def _coarser(dense: np.ndarray, factor: int) -> np.ndarray:
    if factor == 1:
        return dense
    pad = [(0, -side % factor) for side in dense.shape[:3]] + [(0, 0)] * (dense.ndim - 3)
    dense = np.pad(dense, pad)
    x, y, z = (side // factor for side in dense.shape[:3])
    return dense.reshape(x, factor, y, factor, z, factor, *dense.shape[3:]).mean(axis=(1, 3, 5), dtype=np.float32)


def _rows(grid) -> np.ndarray:
    """(3, 4) from voxel indices to object space."""
    corner = np.array(grid.transform.indexToWorld((0, 0, 0)))
    axes = [np.array(grid.transform.indexToWorld(tuple(unit))) - corner for unit in np.eye(3, dtype=int).tolist()]
    return np.column_stack([*axes, corner])


def _resampled(grid, rows: np.ndarray, low: np.ndarray, size: np.ndarray, vector: bool) -> np.ndarray:
    """At the voxels' centres of another grid, the nearest voxel."""
    box = grid.evalActiveVoxelBoundingBox()
    own_low, own_size = np.array(box[0]), np.array(box[1]) - np.array(box[0]) + 1
    for side in (size, own_size):
        _check(side, MOST_RESAMPLED)
    dense = np.zeros((*own_size, 3) if vector else tuple(own_size), np.float32)
    grid.copyToArray(dense, ijk=tuple(int(x) for x in own_low))
    own = _rows(grid)
    places = np.stack(np.meshgrid(*(np.arange(side) + start for side, start in zip(size, low)), indexing="ij"), axis=-1)
    world = places @ rows[:, :3].T + rows[:, 3]
    index = np.rint((world - own[:, 3]) @ np.linalg.inv(own[:, :3]).T).astype(int) - own_low
    inside = ((index >= 0) & (index < own_size)).all(axis=-1)
    index = np.clip(index, 0, own_size - 1)
    values = dense[index[..., 0], index[..., 1], index[..., 2]]
    return np.where(inside[..., None] if vector else inside, values, 0.0).astype(np.float32)
