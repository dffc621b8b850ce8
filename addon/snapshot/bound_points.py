"""Points that settings of an object name: those of its surface follow it when it is deformed, targets follow objects.

An entry of a list that has `target` and `target_object` aims at that object's origin. One with `point`, in the space of
the object, and `triangle` names a point of the surface. Where no triangle is given, the point belongs to the place of
the undeformed mesh that is nearest to it, as it stands in the file before shape keys, armatures and other modifiers
that keep the vertices, and is taken to where that place is now.
"""

from __future__ import annotations

import bpy
import numpy as np
from mathutils.bvhtree import BVHTree

from .own_settings import Own


def targets(own: Own, owner) -> tuple[bpy.types.Object, ...]:
    """Objects at which entries of an evaluated object's settings aim."""
    return tuple(
        entry.target_object
        for name, value in own
        if _is_list(value) and "target_object" in dict(value[0])
        for entry in getattr(owner.candela, name)
        if entry.target_object is not None
    )


def bound(own: Own, owner, depsgraph) -> Own:
    """The settings with points where the evaluated object `owner`, or objects that are aimed at, have taken them."""
    if targets(own, owner):
        own = tuple((name, _aimed(name, value, owner, depsgraph)) for name, value in own)
    if not any(_asks(dict(entry)) for _, value in own if _is_list(value) for entry in value):
        return own
    before, now = _deformed(owner)
    if before is None:
        return own
    triangles = _triangles(owner.original.data)
    tree = BVHTree.FromPolygons(before.tolist(), triangles.tolist(), all_triangles=True)
    return tuple(
        (name, tuple(_moved(entry, tree, triangles, before, now) for entry in value) if _is_list(value) else value)
        for name, value in own
    )


def _aimed(name: str, value, owner, depsgraph):
    """A setting of `owner` with the targets of its entries, in its space, where the objects are that they name."""
    if not _is_list(value) or "target_object" not in dict(value[0]):
        return value
    inverse, found = owner.matrix_world.inverted_safe(), []
    for entry, given in zip(value, getattr(owner.candela, name)):
        if given.target_object is not None:
            there = inverse @ given.target_object.evaluated_get(depsgraph).matrix_world.translation
            entry = tuple((key, tuple(there) if key == "target" else one) for key, one in entry)
        found.append(entry)
    return tuple(found)


def _is_list(value) -> bool:
    """Whether it holds entries, each of (identifier, value)."""
    return isinstance(value, tuple) and bool(value) and isinstance(value[0], tuple)


def _asks(entry: dict) -> bool:
    return "point" in entry and entry.get("triangle", 0) < 0


def _deformed(owner) -> tuple[np.ndarray | None, np.ndarray | None]:
    """(V, 3) positions in the file and as evaluated; None where nothing is deformed or vertices are others."""
    if owner.type != "MESH" or len(owner.original.data.vertices) != len(owner.data.vertices):
        return None, None
    found = []
    for mesh in (owner.original.data, owner.data):
        positions = np.empty(3 * len(mesh.vertices), np.float32)
        mesh.vertices.foreach_get("co", positions)
        found.append(positions.reshape(-1, 3))
    return (None, None) if np.array_equal(*found) else (found[0], found[1])


def _triangles(mesh) -> np.ndarray:
    """(T, 3) vertices."""
    mesh.calc_loop_triangles()
    found = np.empty(3 * len(mesh.loop_triangles), np.int32)
    mesh.loop_triangles.foreach_get("vertices", found)
    return found.reshape(-1, 3)


def _moved(entry: Own, tree: BVHTree, triangles: np.ndarray, before: np.ndarray, now: np.ndarray) -> Own:
    values = dict(entry)
    if not _asks(values):
        return entry
    place, _, number, _ = tree.find_nearest(values["point"])
    if place is None:
        return entry
    corners = triangles[number]
    edges = (before[corners][1:] - before[corners][0]).astype(np.float64)
    second, third = np.linalg.lstsq(edges.T, np.asarray(place) - before[corners][0], rcond=None)[0]
    point = np.array([1 - second - third, second, third]) @ now[corners]
    return tuple((name, tuple(point.tolist()) if name == "point" else value) for name, value in entry)
