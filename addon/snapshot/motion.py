"""Where things were a frame ago and will be in a frame, for the Vector pass: places of instances, cameras and vertices.

Read while Blender's scene stands at those frames (engine.py). Vertices with a `velocity` move along it; others count as
the same where a mesh has as many of them in all three frames, as in Cycles; what appears or goes does not move. Hair
and points without one move with their objects.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from . import camera as cameras
from .cache import SnapshotCache, next_version
from .instances import matrices, walk
from .scene import Camera, Motion, Snapshot

STEPS = (-1, 1)  # frames


@dataclass(frozen=True)
class Moment:
    """A scene at another frame."""

    camera: Camera
    matrices: dict[str, np.ndarray]  # (4, 4), by key of the instance
    positions: dict[str, np.ndarray]  # (V, 3) float32 of the mesh that it shows, one array for all that show it


def read_moment(depsgraph, width: int, height: int, camera=None) -> Moment:
    """The evaluated scene at the frame at which it stands."""
    scene = depsgraph.scene_eval
    view = cameras.camera_of_scene(scene, depsgraph, width, height, camera or scene.camera)
    places, *_ = walk(depsgraph, SnapshotCache())
    by_mesh: dict[int, np.ndarray] = {}
    positions = {}
    for place in places:
        source = place.source
        if getattr(source.data, "id_type", "") != "MESH" or source.data.is_editmode:
            continue
        if source.pointer not in by_mesh:
            found = np.empty(3 * len(source.data.vertices), np.float32)
            source.data.vertices.foreach_get("co", found)
            by_mesh[source.pointer] = found.reshape(-1, 3)
        positions[place.key] = by_mesh[source.pointer]
    return Moment(view, dict(zip([place.key for place in places], matrices(places))), positions)


def with_motion(snapshot: Snapshot, before: Moment, after: Moment) -> Snapshot:
    """The snapshot with how everything moves from the frame before to the one after."""
    placed, meshes = {}, dict(snapshot.meshes)
    deforming: set[str] = set()
    for one in snapshot.instances:
        placed[one.key] = tuple(moment.matrices.get(one.key, one.matrix) for moment in (before, after))
        mesh = snapshot.meshes[one.mesh]
        if one.mesh in deforming:
            continue
        deforming.add(one.mesh)
        if mesh.velocity is not None:
            step = mesh.velocity / np.float32(snapshot.moment.per_second)
            deltas = [step * np.float32(frames) for frames in STEPS]
        else:
            deltas = [_delta(mesh.positions, moment.positions.get(one.key)) for moment in (before, after)]
        if any(delta is not None for delta in deltas):
            still = np.zeros_like(mesh.positions)
            moved = tuple(still if delta is None else delta for delta in deltas)
            meshes[one.mesh] = replace(mesh, motion=moved, version=next_version())
    motion = Motion((before.camera, after.camera), placed)
    return replace(snapshot, meshes=meshes, motion=motion)


def _delta(now: np.ndarray, then: np.ndarray | None) -> np.ndarray | None:
    """How far vertices are from where they are now; None where they are there, or are others."""
    if then is None or then.shape != now.shape or np.array_equal(now, then):
        return None
    return np.nan_to_num(then - now, posinf=0.0, neginf=0.0)
