"""Motion blur: what holds still while the shutter is open, as in Cycles.

Places, vertices and cameras move. What is there at all, what objects say of themselves and what surfaces show is that
of the frame, unless it changes evenly: values that jump once or twice within the shutter (constant keys, frames of an
image sequence) are cuts, and a picture must not show both sides of a cut. Evenly changing materials, lamps and worlds
are blurred, which Cycles does not do.

Objects say more (Object > Motion Blur): one whose blur is off stands at its place of the frame; one whose deformation
is off keeps its shape. A mesh or a point cloud with a `velocity` attribute, as fluids and caches have it, moves its
vertices along that instead: their number may differ from moment to moment.

    x(t) = x(frame) + velocity (t - frame) / fps

Steps per object are not read: each moment is evaluated, so that a path has as many corners as there are moments.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, is_dataclass, replace
from itertools import pairwise

import numpy as np

from .cache import next_version
from .scene import Image, Instance, Light, Mesh, Snapshot, Volume, VolumeInstance

CUT_SHARE = 4  # a value that changes between at most one of so many pairs of moments jumps
_VERSIONED = (Image, Mesh, Volume)  # equal if key and version are
_BY_IDENTITY = (Instance, VolumeInstance)  # the sync hands out the same object where nothing has changed


def held(central: Snapshot, found: Sequence[Snapshot], times: Sequence[float]) -> list[Snapshot]:
    """The snapshots `found` at `times`, frames from that of `central`, with what holds still from `central`."""
    materials = _materials(central, found)
    worlds = _chosen([(one.world, _image_state(one, _world_images(one))) for one in found], (
        central.world, _image_state(central, _world_images(central))
    ))  # fmt: skip
    lights = _lights(central, found)
    made, moved = [], {}
    for k, now in enumerate(found):
        own = tuple(one for one, _ in materials[k])
        images = dict(now.images)
        for _, state in (*materials[k], worlds[k]):
            images.update(state)
        meshes, instances = _instances(central, now, times[k], moved)
        made.append(
            replace(
                now, meshes=meshes, instances=instances, materials=own, images=images, lights=lights[k],
                world=worlds[k][0], volumes=_volumes(central, now),
            )
        )  # fmt: skip
    return made


def equal(a, b) -> bool:
    """Whether two parts of snapshots show the same."""
    if a is b:
        return True
    if type(a) is not type(b) or isinstance(a, _BY_IDENTITY):
        return False
    if isinstance(a, _VERSIONED):
        return (a.key, a.version) == (b.key, b.version)
    if isinstance(a, np.ndarray):
        return a.shape == b.shape and bool(np.array_equal(a, b))
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(equal(a[key], b[key]) for key in a)
    if isinstance(a, (tuple, list)):
        return len(a) == len(b) and all(map(equal, a, b))
    if is_dataclass(a):
        return all(equal(getattr(a, one.name), getattr(b, one.name)) for one in fields(a))
    return a == b


def _chosen(values: list, central, same: Callable = equal) -> list:
    """The values at the moments; `central` at all of them where they jump, or where there are none (None)."""
    values = [central if value is None or same(value, central) else value for value in values]
    changes = sum(not same(a, b) for a, b in pairwise(values))
    jumps = 0 < changes <= max(1, (len(values) - 1) // CUT_SHARE) and any(value is central for value in values)
    return [central] * len(values) if jumps or len(values) == 1 else values


def _materials(central: Snapshot, found: Sequence[Snapshot]) -> list[list[tuple]]:
    """By moment, of each of the frame's materials: itself and what its images are."""
    known = [{one.key: one for one in now.materials} for now in found]
    columns = []
    for one in central.materials:
        state = one, _image_state(central, _material_images(one))
        values = []
        for now, table in zip(found, known, strict=True):
            other = table.get(one.key)
            values.append(other and (other, _image_state(now, _material_images(other))))
        columns.append(_chosen(values, state))
    return [list(row) for row in zip(*columns, strict=True)]


def _material_images(material) -> list[str]:
    own = [key for _, key in material.own_images]
    return [*(node.image for node in material.graph.nodes.values() if node.image), *own]


def _world_images(snapshot: Snapshot) -> list[str]:
    world = snapshot.world
    graphs = [graph for graph in (world.graph, world.volume) if graph is not None]
    named = [node.image for graph in graphs for node in graph.nodes.values() if node.image]
    return [*named, *([world.image.key] if world.image is not None else [])]


def _image_state(snapshot: Snapshot, keys: Sequence[str]) -> tuple[tuple[str, Image], ...]:
    return tuple((key, snapshot.images[key]) for key in dict.fromkeys(keys) if key in snapshot.images)


def _lights(central: Snapshot, found: Sequence[Snapshot]) -> list[tuple[Light, ...]]:
    """By moment: the frame's lights, each at its place of the moment."""
    tables = [{one.key: one for one in now.lights} for now in found]
    columns = []
    for one in central.lights:
        there = [table.get(one.key, one) for table in tables]
        chosen = _chosen([replace(light, matrix=one.matrix) for light in there], one)
        pairs = zip(chosen, there, strict=True)
        columns.append([
            light if equal(light.matrix, placed.matrix) else replace(light, matrix=placed.matrix)
            for light, placed in pairs
        ])  # fmt: skip
    return list(zip(*columns, strict=True)) if columns else [() for _ in found]


def _volumes(central: Snapshot, now: Snapshot) -> tuple[VolumeInstance, ...]:
    there = {one.key: one for one in now.volumes}
    made = []
    for one in central.volumes:
        other = there.get(one.key, one)
        same = equal(one.volume, other.volume) and equal(one.matrix, other.matrix)
        made.append(one if same else replace(one, volume=other.volume, matrix=other.matrix))
    return tuple(made)


def _instances(
    central: Snapshot, now: Snapshot, time: float, known: dict
) -> tuple[dict[str, Mesh], tuple[Instance, ...]]:
    """The frame's instances with matrices and meshes of the moment. `known`: instances that other moments have made."""
    there = {one.key: one for one in now.instances}
    meshes, made = {}, []
    flown: dict[str, Mesh] = {}
    for one in central.instances:
        other = there.get(one.key, one) if one.blurred else one
        still = central.meshes[one.mesh]
        if not one.blurred or not one.deforms:
            mesh = still
        elif still.velocity is not None:
            if one.mesh not in flown:
                flown[one.mesh] = _flown(still, time / central.moment.per_second)
            mesh = flown[one.mesh]
        else:
            mesh = now.meshes[other.mesh] if one.key in there else still  # the same instance may show another shape
        key = mesh.key
        if key in meshes and meshes[key].version != mesh.version:
            key = f"{key} at rest"
        if key not in meshes:
            meshes[key] = mesh if key == mesh.key else replace(mesh, key=key)
        if key == one.mesh and equal(other.matrix, one.matrix):
            made.append(one)
            continue
        name = one.key, key, other.matrix.tobytes()
        if name not in known:
            known[name] = replace(one, matrix=other.matrix, mesh=key)
        made.append(known[name])
    groups: dict[tuple, list[Instance]] = {}
    for one in made:
        groups.setdefault((one.mesh, one.materials), []).append(one)
    number = {key: k for k, key in enumerate(meshes)}
    ordered = sorted(groups, key=lambda group: number[group[0]])
    return meshes, tuple(one for group in ordered for one in groups[group])


def _flown(mesh: Mesh, seconds: float) -> Mesh:
    """The mesh after so many seconds on its way along its velocity."""
    step = (mesh.velocity * np.float32(seconds)).astype(np.float32)
    used = mesh.positions[mesh.corner_vertices] + step[mesh.corner_vertices]
    low, high = (used.min(axis=0), used.max(axis=0)) if len(used) else (mesh.bounds_min, mesh.bounds_max)
    return replace(
        mesh,
        version=next_version(),
        positions=mesh.positions + step,
        bounds_min=np.asarray(low, np.float64),
        bounds_max=np.asarray(high, np.float64),
    )
