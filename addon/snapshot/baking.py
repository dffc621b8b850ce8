"""What a bake asks of Blender's scene beside the snapshot."""

from __future__ import annotations

import numpy as np

from .errors import UnsupportedScene
from .scene import Camera, Instance, Snapshot


def seen_by_nobody() -> Camera:
    """A camera for a snapshot of which no picture is made as it is."""
    return Camera(np.eye(4), "ORTHOGRAPHIC", (-1.0, 1.0, -1.0, 1.0), 0.0, 1.0, "Bake")


def instance_of(snapshot: Snapshot, thing) -> Instance:
    """The object itself in a snapshot, not what instances it; raises UnsupportedScene if it shows no surface."""
    own = np.array(thing.matrix_world, np.float64)
    named = [one for one in snapshot.instances if one.object_name == thing.name]
    if not named:
        raise UnsupportedScene(f"Object '{thing.name}' has no surface to be baked: is it disabled in renders?")
    return min(named, key=lambda one: float(np.abs(one.matrix - own).max()))


def triangles_of(thing, depsgraph) -> np.ndarray:
    """(T, 3) int32 corners of an object's triangles in the order in which Blender counts them."""
    evaluated = thing.original.evaluated_get(depsgraph)
    mesh = evaluated.to_mesh(preserve_all_data_layers=True, depsgraph=depsgraph)
    try:
        mesh.calc_loop_triangles()
        corners = np.empty(3 * len(mesh.loop_triangles), np.int32)
        mesh.loop_triangles.foreach_get("loops", corners)
        return corners.reshape(-1, 3)
    finally:
        evaluated.to_mesh_clear()
