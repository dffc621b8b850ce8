"""What the glass or water absorbs that the camera is in.

A walk through glass takes away what the inside absorbs from interface to interface (techniques/traced_refraction.py);
the first stretch of each view ray, up to the first surface, belongs to the solid that the eye is in. As Cycles does, a
ray straight up tells: the eye is in each object of which that ray meets the back first, closed or not. It starts where
view rays begin, at the camera's clip start.

Bias: one place for all of the picture: an orthographic camera half in water counts by its middle.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..materials.compiled import CompiledMaterial
from ..snapshot.scene import Snapshot

UP = np.array([0.0, 0.0, 1.0])


def absorbed_around_eye(snapshot: Snapshot, compiled: Sequence[CompiledMaterial]) -> np.ndarray:
    """(3,) 1/m, the sum over all solids of glass that the camera is in; insides that vary count by their mean."""
    total = np.zeros(3)
    absorbing = [bool(one.glass and one.medium and np.any(one.medium.absorption > 0)) for one in compiled]
    if snapshot.camera is None or not any(absorbing):
        return total
    camera = snapshot.camera
    eye = camera.matrix[:3, 3] - camera.clip_start * camera.matrix[:3, 2]
    for one in snapshot.instances:
        if not any(absorbing[k] for k in one.materials) or not np.isfinite(one.matrix).all():
            continue
        mesh, linear = snapshot.meshes[one.mesh], one.matrix[:3, :3]
        if not mesh.triangle_count or abs(np.linalg.det(linear)) < 1e-30:
            continue
        inverse = np.linalg.inv(linear)
        origin, direction = inverse @ (eye - one.matrix[:3, 3]), inverse @ UP
        if not _may_meet(origin, direction, np.asarray(mesh.bounds_min), np.asarray(mesh.bounds_max)):
            continue
        corners = mesh.positions[mesh.corner_vertices[mesh.triangle_corners]].astype(np.float64)
        found = _first_met(corners, origin, direction)
        if found is None:
            continue
        triangle, leaves = found
        material = mesh.triangle_materials(one.materials)[triangle]
        # A mirrored object keeps its inside, and its faces are wound the other way.
        if leaves and absorbing[material]:
            total += np.clip(compiled[material].medium.absorption, 0.0, 1e10)
    return total


def _may_meet(origin: np.ndarray, direction: np.ndarray, low: np.ndarray, high: np.ndarray) -> bool:
    """Whether a ray may meet a box."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.stack([(low - origin) / direction, (high - origin) / direction])
    ends = np.where(np.isnan(ends), np.array([[-np.inf], [np.inf]]), ends)
    enter, leave = ends.min(axis=0).max(), ends.max(axis=0).min()
    tolerance = 1e-6 * abs(leave) if np.isfinite(leave) else 0.0
    return bool(np.isfinite(max(enter, 0.0)) and leave >= max(enter, 0.0) - tolerance)


def _first_met(corners: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> tuple[int, bool] | None:
    """The nearest of the triangles (T, 3, 3) that a ray meets, and whether at its back (Moeller & Trumbore)."""
    a, first, second = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    across = np.cross(direction, second)
    slope = np.einsum("ni,ni->n", first, across)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.einsum("ni,ni->n", origin - a, across) / slope
        beside = np.cross(origin - a, first)
        v = beside @ direction / slope
        t = np.einsum("ni,ni->n", second, beside) / slope
        met = (slope != 0.0) & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (t > 0.0)
    if not met.any():
        return None
    nearest = int(np.argmin(np.where(met, t, np.inf)))
    return nearest, bool(slope[nearest] < 0.0)
