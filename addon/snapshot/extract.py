"""`take`: one evaluated dependency graph becomes one Snapshot."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterable
from contextlib import contextmanager
from dataclasses import replace
from functools import reduce
from itertools import repeat
from operator import or_

import bpy
import numpy as np

from ..materials import working_space
from ..materials.nodes.inputs import ROUND
from . import camera as cameras
from . import motion as motions
from .cache import MeshEntry, Placed, SnapshotCache
from .images import ImageTable
from .instances import Place, Source, matrices, walk
from .lights import emission_of_graph, read_light, uses_nodes
from .linking import LinkTable, read_links, without_volumes
from .meshes import Wanted, build_mesh, read_mesh
from .motion import with_motion
from .object_attributes import of_places
from .scene import (
    CRYPTOMATTES,
    NO_LINKS,
    Aov,
    Camera,
    Film,
    Instance,
    Light,
    Links,
    Mesh,
    Mist,
    Moment,
    Note,
    Snapshot,
    Visibility,
    World,
)
from .shading import ShadingTable
from .smoke import read_smoke
from .volumes import read_volumes
from .world import constant_world, read_world, sun_of


@contextmanager
def uncollected():
    """Without Python's search for cycles: thousands of short-lived objects would set it off in the middle."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


@uncollected()
def take(
    depsgraph,
    cache: SnapshotCache,
    width: int,
    height: int,
    camera=None,
    view: Camera | None = None,
    border: tuple[int, int, int, int] | None = None,
    shown: Callable | None = None,
    around: tuple[motions.Moment, motions.Moment] | None = None,
) -> Snapshot:
    """Read the evaluated scene for a picture of `width` x `height` pixels.

    Which objects are visible is the dependency graph's business: one made for rendering leaves out what is disabled
    in renders, a viewport's leaves out what is hidden there. `camera`: object that overrides the scene's camera.
    `view`: a ready view (see `camera_of_view`), no camera is needed then. `border`: pixels (x0, y0, x1, y1);
    without one the scene's render border counts, unless `view` is given. `shown`: predicate on objects, for a
    viewport's local view. `around`: the frames before and after, for the Vector pass. Raises UnsupportedScene when
    there is nothing to look through.
    """
    start = time.perf_counter()
    scene = depsgraph.scene_eval
    notes: list[Note] = _simplified(scene)
    working_space.follow(getattr(getattr(bpy.data, "colorspace", None), "working_space", working_space.REC709))
    if view is None:
        camera = camera or scene.camera
        view = cameras.camera_of_scene(scene, depsgraph, width, height, camera)
        sheared = cameras.shear_note(camera.evaluated_get(depsgraph))
        notes += [] if sheared is None else [sheared]
        border = border or _scene_border(scene.render, width, height)

    images = ImageTable(cache, scene.frame_current)
    layer = depsgraph.view_layer_eval
    shading = ShadingTable(cache, images, aovs_of(layer), (scene, layer))
    places, light_places, volume_places, walk_notes = walk(depsgraph, cache, shown)
    notes += walk_notes
    links = _links(places, light_places)
    notes += links.notes
    places, placed = _at_a_place(places, notes)
    smoke = np.array([place.source.facts.smoke for place in places], bool)
    domains, domain_places = [place for place in places if place.source.facts.smoke], placed[smoke]
    if domains:
        places, placed = [place for place in places if not place.source.facts.smoke], placed[~smoke]
    meshes, instances, mesh_notes, stats = _meshes(places, placed, shading, cache, depsgraph, links)
    notes += mesh_notes
    lights = _lights(*_at_a_place(light_places, notes), shading, links)
    override = layer.material_override
    volume_facts = [place.source.facts for place in (*domains, *volume_places)]
    volumes = read_volumes(
        *_at_a_place(volume_places, notes), shading, override, cache, notes, depsgraph.mode == "RENDER"
    )
    volumes += read_smoke(domains, domain_places, shading, override, cache, notes)
    world, sun = _world(scene, depsgraph.view_layer_eval, shading, images, notes)
    lights = lights if sun is None else (*lights, sun)
    if links.unlit:
        lights, linked_notes = without_volumes(lights, _volume_groups(links, shading, world, instances, volume_facts))
        notes += linked_notes
    film = _film(scene, depsgraph.view_layer_eval, width, height, border)
    if view.panorama is not None and any(aov.kind == "VECTOR" for aov in film.aovs):
        film = replace(film, aovs=tuple(aov for aov in film.aovs if aov.kind not in ("VECTOR", "HIT")))
        notes.append(Note("Vector pass", "it stays empty: how surfaces move in a panoramic picture is not drawn."))
    notes += [*shading.notes, *images.notes]
    cache.finish(meshes, images.images, shading.graphs)
    stats.update(images_read=images.read, images_reused=images.reused)
    snapshot = Snapshot(
        meshes=meshes,
        instances=instances,
        materials=tuple(shading.materials),
        images=images.images,
        lights=lights,
        world=world,
        camera=view,
        film=film,
        notes=tuple(dict.fromkeys(notes)),
        scene_name=scene.name,
        moment=Moment(scene.frame_current_final, scene.render.fps / scene.render.fps_base),
        volumes=volumes,
        sync_stats=stats,
    )
    snapshot.sync_stats["seconds"] = time.perf_counter() - start
    return snapshot if around is None else with_motion(snapshot, *around)


def _simplified(scene) -> list[Note]:
    """What of Simplify is left out."""
    cycles = getattr(scene, "cycles", None)  # there while the Cycles add-on is enabled
    if scene.render.use_simplify and (
        getattr(cycles, "use_camera_cull", False) or getattr(cycles, "use_distance_cull", False)
    ):
        return [
            Note("Simplify", "what is outside of the view or far away is drawn all the same: culling is Cycles' own.")
        ]
    return []


def _at_a_place(places: list[Place], notes: list[Note]) -> tuple[list[Place], np.ndarray]:
    """With their matrices, without the objects whose matrix holds a NaN or infinity, as a driver may make it."""
    placed = matrices(places)
    finite = np.isfinite(placed).all(axis=(1, 2))
    if finite.all():
        return places, placed
    for index in np.flatnonzero(~finite):
        text = "its position is not a finite number and it is not drawn; check its drivers and constraints."
        notes.append(Note(f"Object '{places[index].source.facts.name}'", text))
    return [place for place, good in zip(places, finite, strict=True) if good], placed[finite]


def _links(places: list[Place], light_places: list[Place]) -> LinkTable:
    """Light linking, which objects have that give light, or what instances them."""
    sources = dict.fromkeys([place.source for place in (*places, *light_places)])
    owners = [one.owner for one in sources if one.facts.linked]
    owners += [one.parent for one in sources if one.facts.linked and one.parent is not None]
    return read_links(owners)


def _volume_groups(links: LinkTable, shading: ShadingTable, world: World, instances, of_grids: list) -> set[int]:
    """Groups of receivers that volumes belong to, those of grids by the facts of their objects."""
    filled = {k for k, one in enumerate(shading.materials) if one.graph.volume is not None}
    groups = {one.links.receiver for one in instances if not filled.isdisjoint(one.materials)}
    groups |= {links.of(facts.uid, facts.parent_uid).receiver for facts in of_grids}
    return groups | ({links.others[0]} if world.medium is not None else set())


def _meshes(
    places: list[Place], transforms: np.ndarray, shading: ShadingTable, cache: SnapshotCache, depsgraph,
    links: LinkTable,
):  # fmt: skip
    """(meshes by key, instances, notes, counts). Instances stand in order of their mesh's first appearance."""
    override = depsgraph.view_layer_eval.material_override
    shown_with: dict[int, set[int]] = {}  # materials, by address of the mesh
    materials: dict[int, tuple[int, ...]] = {}  # by identity of the source, which all its instances share
    first: dict[int, Source] = {}
    sources = dict.fromkeys([place.source for place in places])
    for source in sources:
        slots = source.materials or (None,)
        chosen = tuple([shading.index_of(override or material) for material in slots])
        materials[id(source)] = chosen
        pointer = source.pointer
        first.setdefault(pointer, source)
        shown_with.setdefault(pointer, set()).update(chosen)
    wanted = {
        pointer: reduce(or_, (shading.wanted[index] for index in sorted(used))) for pointer, used in shown_with.items()
    }

    meshes: dict[str, Mesh] = {}
    by_pointer: dict[int, Mesh] = {}
    notes: list[Note] = []
    read = 0
    keys = _mesh_keys(first)
    for pointer, source in first.items():
        entry, was_read = _sync_mesh(keys[pointer], source, wanted[pointer], cache)
        read += was_read
        notes += entry.notes
        meshes[entry.mesh.key] = by_pointer[pointer] = entry.mesh

    notes += _fibres_without_strands(shading, shown_with, by_pointer)
    resolved: dict[int, tuple[str, tuple[int, ...], Links]] = {}
    for source in sources:
        mesh = by_pointer[source.pointer]
        own_links = links.of(source.facts.uid, source.facts.parent_uid)
        resolved[id(source)] = mesh.key, _fitted(materials[id(source)], mesh.slots), own_links
    attributes = repeat(())
    reading = {k for k in range(len(shading.materials)) if shading.reads_instances(k)} if cache.columns else set()
    if reading:
        attributes = of_places(places, cache.columns, lambda source: not reading.isdisjoint(materials[id(source)]))
    instances = _instances(places, transforms, resolved, attributes, list(meshes), cache)
    stats = {"meshes_read": read, "meshes_reused": len(meshes) - read, "instances": len(instances)}
    return meshes, instances, notes, stats


def _fibres_without_strands(
    shading: ShadingTable, shown_with: dict[int, set[int]], meshes: dict[int, Mesh]
) -> list[Note]:
    """What is to be said of materials of fibres on points, which have no direction."""
    bare = [used for pointer, used in shown_with.items() if ROUND not in meshes[pointer].colors]
    text = (
        "Principled Hair is drawn as fibres on strands and meshes alone; a point cloud with it is a diffuse surface "
        "that lets half of its light through. Use hair curves, or Principled BSDF on points."
    )
    notes = []
    for index in sorted(set().union(*bare)):
        if ROUND not in shading.wanted[index].attributes:
            continue
        material = shading.materials[index]
        fibres = [node.label for node in material.graph.nodes.values() if node.type == "ShaderNodeBsdfHairPrincipled"]
        notes += [Note(f"Material '{material.name}'", text, material.name, label) for label in fibres]
    return notes


def _instances(
    places: list[Place], transforms: np.ndarray, resolved: dict, attributes: Iterable[tuple], order: list[str],
    cache: SnapshotCache,
):  # fmt: skip
    """The instances, by mesh in `order`; those of the last sync where nothing has changed. `resolved`: key of the mesh
    materials and links, by identity of the source. `attributes` of each place."""
    keys = [place.key for place in places]
    facts = [place.source.facts for place in places]
    looks = [
        (place.random, place.generated, place.uv, own, *resolved[id(place.source)])
        for place, own in zip(places, attributes)
    ]
    before = cache.placed
    known = before is not None and before.keys == keys
    same = (transforms == before.matrices).all(axis=(1, 2)).tolist() if known else ()
    if known and all(same) and (before.order, before.facts, before.looks) == (order, facts, looks):
        return before.ordered
    made = []
    like: dict[int, dict[str, object]] = {}  # fields of an instance of each source
    for k, place in enumerate(places):
        if known and same[k] and before.facts[k] is facts[k] and before.looks[k] == looks[k]:
            made.append(before.made[k])
            continue
        *_, own, mesh, chosen, links = looks[k]
        of_object = facts[k]
        alike = like.get(id(place.source))
        if alike is None:
            alike = like[id(place.source)] = vars(
                Instance(
                    of_object.name, mesh, transforms[k], chosen, of_object.visibility, place.random,
                    of_object.pass_index, of_object.holdout, of_object.color, place.generated, place.uv, place.key,
                    of_object.terminator, of_object.own, of_object.caustics_caster, of_object.asset,
                    of_object.group, links, of_object.shadow_catcher, blurred=of_object.blurred,
                    deforms=of_object.deforms,
                )
            )  # fmt: skip
        # A copy of the source's first one: a frozen dataclass's constructor takes half of a large sync's time.
        one = object.__new__(Instance)
        vars(one).update(
            alike,
            matrix=transforms[k],
            random=place.random,
            generated=place.generated,
            uv=place.uv,
            key=place.key,
            attributes=own,
        )
        made.append(one)
    groups: dict[tuple, list[Instance]] = {}
    for one in made:
        groups.setdefault((one.mesh, one.materials), []).append(one)
    number = {key: k for k, key in enumerate(order)}
    ordered = sorted(groups, key=lambda group: number[group[0]])
    instances = tuple(instance for group in ordered for instance in groups[group])
    if known and instances == before.ordered:
        instances = before.ordered
    cache.placed = Placed(keys, transforms, facts, looks, made, order, instances)
    return instances


def _fitted(materials: tuple[int, ...], slots: int) -> tuple[int, ...]:
    """One material per slot of the mesh: missing ones are the default, surplus ones are never referred to."""
    return (*materials[:slots], *(0,) * (slots - len(materials)))


def _mesh_keys(first: dict[int, Source]) -> dict[int, str]:
    """A lasting name for each evaluated mesh: its data-block where it is shown as it is, else its object.

    One object may own several (geometry nodes): they are numbered in Blender's order.
    """
    keys: dict[int, str] = {}
    taken: dict[str, int] = {}
    for pointer, source in first.items():
        facts = source.facts
        if source.data.id_type == "HAIR":
            keys[pointer] = f"hair {facts.uid} {source.data.number}"
            continue
        unmodified = facts.data_uid and not len(source.owner.original.modifiers)
        base = f"mesh {facts.data_uid}" if unmodified else f"object {facts.uid}"
        taken[base] = taken.get(base, 0) + 1
        keys[pointer] = base if taken[base] == 1 else f"{base} #{taken[base]}"
    return keys


def _sync_mesh(key: str, source: Source, wanted: Wanted, cache: SnapshotCache) -> tuple[MeshEntry, bool]:
    """The mesh as it is now, and whether its content is new."""
    facts = source.facts
    mesh, entry = source.data, cache.meshes.get(key)
    asked = wanted.names
    # Hair is dear to read, and never changes without a new evaluation.
    named = mesh.id_type != "HAIR" and (facts.uid in cache.changed or facts.data_uid in cache.changed)
    # In edit mode the evaluated mesh is a shell around the edit mesh, which changes without a new evaluation.
    editing = mesh.id_type == "MESH" and mesh.is_editmode
    known = entry is not None and entry.asked == asked and not named and not editing
    if known and mesh.session_uid and entry.evaluation == mesh.session_uid:
        return entry, False
    if editing:
        mesh = source.owner.to_mesh()  # asking it to preserve all layers would give the mesh before the edits
    try:
        groups = getattr(source.owner, "vertex_groups", ()) if wanted.attributes else ()
        raw = read_mesh(mesh, wanted, {group.name: group.index for group in groups})
        digest = raw.digest()
        if entry is not None and entry.digest == digest and entry.asked == asked:
            entry.evaluation = source.data.session_uid
            return entry, False
        made, notes = build_mesh(key, raw, mesh, wanted, f"Object '{facts.name}'")
    finally:
        if editing:
            source.owner.to_mesh_clear()
    entry = cache.meshes[key] = MeshEntry(made, source.data.session_uid, digest, asked, notes)
    return entry, True


def _lights(places: list[Place], transforms: np.ndarray, shading: ShadingTable, links: LinkTable) -> tuple[Light, ...]:
    made = []
    for place, matrix in zip(places, transforms, strict=True):
        facts, block = place.source.facts, place.source.data
        tint, of_tree = np.ones(3), {}
        if uses_nodes(block):
            key = f"light {(block.original or block).session_uid}"
            graph = shading.graph_of(block, key, f"Light '{facts.name}'")
            tint = emission_of_graph(graph)
            if tint is None:
                tint = np.ones(3)
                of_tree = {
                    "graph": graph, "random": place.random, "pass_index": facts.pass_index, "color": facts.color,
                }  # fmt: skip
        light = read_light(block, place.key, facts.name, matrix, facts.visibility, tint, **of_tree)
        if light is not None:
            own_links = links.of(facts.uid, facts.parent_uid)
            if facts.group or own_links is not NO_LINKS:
                light = replace(light, group=facts.group, links=own_links)
            made.append(light)
    return tuple(made)


def _world(
    scene, view_layer, shading: ShadingTable, images: ImageTable, notes: list[Note]
) -> tuple[World, Light | None]:
    """The world, and the sun of its sky as a lamp, if it has one."""
    block = getattr(view_layer, "world_override", None) or scene.world  # the override exists since Blender 5.0
    if block is None or not view_layer.use_sky:
        return constant_world((0.0, 0.0, 0.0), Visibility()), None
    rays = getattr(block, "cycles_visibility", None)  # there while the Cycles add-on is enabled
    visibility = Visibility()
    if rays is not None:
        # The world casts no shadow; its `shadow` switch does not exist.
        visibility = Visibility(rays.camera, rays.diffuse, rays.glossy, rays.transmission, rays.scatter)
    key = f"world {(block.original or block).session_uid}"
    graph = shading.graph_of(block, key, f"World '{block.name}'")
    graph, sun = sun_of(graph, visibility)
    world, remarks = read_world(graph, block.name, images.images, visibility)
    notes.extend(remarks)
    return replace(world, group=block.lightgroup), sun and replace(sun, group=block.lightgroup)


# Exponents of the Mist pass, as Cycles has them.
FALLOFF = {"QUADRATIC": 2.0, "LINEAR": 1.0, "INVERSE_QUADRATIC": 0.5}


def _film(scene, layer, width: int, height: int, border) -> Film:
    cycles = getattr(scene, "cycles", None)  # there while the Cycles add-on is enabled
    return Film(
        width=width,
        height=height,
        border=border or (0, 0, width, height),
        filter_width=scene.render.filter_size,
        transparent=scene.render.film_transparent,
        clear_glass=_clear_glass(cycles),
        exposure=getattr(cycles, "film_exposure", 1.0),
        caustics_reflective=getattr(cycles, "caustics_reflective", True),
        caustics_refractive=getattr(cycles, "caustics_refractive", True),
        mist=_mist(scene.world) if layer.use_pass_mist else None,
        position=layer.use_pass_position,
        indices=layer.use_pass_object_index or layer.use_pass_material_index,
        aovs=aovs_of(layer),
        alpha_threshold=layer.pass_alpha_threshold,
        cryptomattes=tuple(kind for kind in CRYPTOMATTES if getattr(layer, f"use_pass_cryptomatte_{kind}")),
        cryptomatte_levels=layer.pass_cryptomatte_depth,
        light_groups=tuple(group.name for group in layer.lightgroups),
        open_within=_open_within(scene.world) if layer.use_pass_ambient_occlusion else None,
    )


def aovs_of(layer) -> tuple[Aov, ...]:
    """What a view layer asks for of the surfaces seen, passes without a name first."""
    named = [Aov(aov.name, aov.type) for aov in layer.aovs if aov.is_valid]
    vector, cycles = layer.use_pass_vector, getattr(layer, "cycles", None)  # there while the Cycles add-on is enabled
    denoising = getattr(cycles, "denoising_store_passes", False)
    wanted = (("UV", layer.use_pass_uv), ("VECTOR", vector), ("HIT", vector), ("DISTANCE", denoising))
    return (*(Aov("", kind) for kind, asked in wanted if asked), *named)


def _open_within(world) -> float:
    """The Distance of the world's Ambient Occlusion; without a world, as a new one has it."""
    return world.light_settings.distance if world is not None else 10.0


def _clear_glass(cycles) -> float:
    if not getattr(cycles, "film_transparent_glass", False):
        return -1.0
    return cycles.film_transparent_roughness


def _mist(world) -> Mist:
    """Of the scene's world; without one, as a new world has it."""
    if world is None:
        return Mist(5.0, 25.0, FALLOFF["QUADRATIC"])
    settings = world.mist_settings
    return Mist(settings.start, settings.depth, FALLOFF[settings.falloff])


def _scene_border(render, width: int, height: int) -> tuple[int, int, int, int] | None:
    """The render border in pixels, rounded down as Blender rounds it, and at least one pixel wide."""
    if not render.use_border:
        return None
    x0, x1 = sorted(_border_pixel(share, width) for share in (render.border_min_x, render.border_max_x))
    y0, y1 = sorted(_border_pixel(share, height) for share in (render.border_min_y, render.border_max_y))
    x0, y0 = min(x0, width - 1), min(y0, height - 1)
    return x0, y0, max(x1, x0 + 1), max(y1, y0 + 1)


def _border_pixel(share: float, extent: int) -> int:
    """In single precision, as Blender works it out: .7 of 100 pixels are 70 there, and 69 in double precision."""
    return int(np.float32(share) * np.float32(extent))
