"""Casters of caustics: the materials, objects and lights that techniques of the slot `caustics` take over.

A material is a caster if it bends light (glass, of any roughness) or mirrors it with no diffuse part to speak of and is
no rougher than gloss.THROWS (materials/gloss.py), by the socket's own value. What a varnish over a diffuse surface
mirrors stays with indirect light.

A light is answered for if it casts shadows and diffuse surfaces see it, however wide it is. So are emissive meshes,
and, where there is glass, the bright part of the world (sources/bright_world.py): the rest of it is wide light, which
clear glass leaves as it is. Shadow rays of what is answered for take glass as opaque: what passes it arrives as
photons of it. All glass counts there, so a pane beside a lens is a caster, too. A scene in which all glass is flat
panes and no metal is smooth is left to straight light, as is right for panes.

Of lamps that light linking keeps from all casters nothing is bent or mirrored.

Where all casters are closed convex meshes that only mirror, and no lamp stands among them, their light never
converges (`spreads`): few photons have all of it.

Blender's switches (Cycles' Light Paths) are about what diffuse surfaces see: with Reflective or Refractive caustics off
they do without the light that the last surface on its way mirrors or lets pass, but for glass with Shadow Caustics:
objects set to cast them, under lights set to give them. Glass stops light all the same, and gloss sees all of it. Where
the Cycles add-on is off, the switches do not exist and all is on. Whether an object is to receive such caustics is not
followed: all surfaces do.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ..frame.light_paths import LIGHT_SPECULAR_DIFFUSE
from ..frame.picture import Frame
from ..materials import gloss
from ..materials.compiler import may_emit, may_refract
from ..materials.graph import Graph
from ..snapshot.scene import Instance, Mesh, Snapshot
from ..sources import lights
from ..sources.bright_world import BrightPart, bright_part
from .light_views import REFLECTED, REFRACTED, groups

SLOT = "caustics"
MESHES, WORLD = "emissive meshes", "the world"  # keys beside those of lamps, which are none of these
MARGIN = 0.02  # of a caster's box, for what its float32 bounds miss
FLAT = 0.999  # cosine between normals of a pane's faces
MOST_LOOKED_AT = 200_000  # triangles of a mesh of which it is asked whether it is convex
LEAST_BENT = 0.4  # share of a convex mesh's edges at which it bends: a cube's faces would throw patches with edges
_FEWEST_EDGES = 100
PHOTONS_ON_GLOSS, PHOTONS_ON_SOFT = 1, 2  # as in shaders/caustics/gloss.glsl
_BUMPS = ("ShaderNodeBump", "ShaderNodeNormalMap", "ShaderNodeDisplacement", "ShaderNodeVectorDisplacement")
_CLEAR = ("ShaderNodeBsdfTransparent", "ShaderNodeEeveeSpecular", "ShaderNodeHoldout", "ShaderNodeBsdfRayPortal")


def mirror_roughness(graph: Graph) -> float | None:
    """Roughness of a material that mirrors photons; None if it does not."""
    return min((rough for rough in gloss.mirrors(graph) if rough <= gloss.THROWS), default=None)


@dataclass(frozen=True)
class Casters:
    """What throws caustics in a scene: materials by number, and boxes of the objects that show them."""

    refracting: frozenset[int]
    mirrors: dict[int, float]  # roughness by material
    low: np.ndarray  # (K, 3) world space
    high: np.ndarray
    lights: frozenset[str]  # keys of the lights that are answered for
    bent: frozenset[str]  # of those whose refracted light is wanted on diffuse surfaces
    mirrored: bool  # whether reflected light is
    spreads: bool = False  # nothing here makes light converge
    dark: frozenset[str] = frozenset()  # keys of lamps that, by light linking, light no caster

    @property
    def materials(self) -> frozenset[int]:
        return self.refracting | frozenset(self.mirrors)

    @property
    def going_on(self) -> dict[int, float]:
        """Roughness of the mirrors from which photons go on that come from others."""
        return {number: rough for number, rough in self.mirrors.items() if rough <= gloss.SMOOTH}

    def wanted(self, key: str) -> int:
        """REFRACTED and REFLECTED, a sum, of what diffuse surfaces are to have of a light."""
        return REFRACTED * (key in self.bent) + REFLECTED * self.mirrored


def casters_of(snapshot: Snapshot) -> Casters | str:
    """The casters, or, as a sentence, why there are none."""
    film = snapshot.film
    glass, mirrors = set(), {}
    by_flags = not film.caustics_refractive
    for number in snapshot.used_materials:
        graph = snapshot.materials[number].graph
        if may_refract(graph):
            glass.add(number)
        rough = mirror_roughness(graph)
        if rough is not None and film.caustics_reflective:
            mirrors[number] = rough
    if not glass and not mirrors:
        if film.caustics_reflective and film.caustics_refractive:
            return f"no material is glass or metal of roughness {gloss.THROWS:g} or less"
        return "caustics are switched off in the scene's Light Paths, and no material is glass"
    shown = [
        one
        for one in snapshot.instances
        if one.visibility.diffuse and snapshot.meshes[one.mesh].triangle_count and np.isfinite(one.matrix).all()
        if not glass.union(mirrors).isdisjoint(one.materials)
    ]
    flagged = by_flags and any(one.caustics_caster for one in shown)
    if flagged:
        shown = [one for one in shown if one.caustics_caster or not set(mirrors).isdisjoint(one.materials)]
    if not shown:
        return "no object that throws caustics is visible to light from surfaces"
    smooth = any(rough <= gloss.SMOOTH for rough in mirrors.values())
    of_glass = {one.mesh for one in shown if not glass.isdisjoint(one.materials)}
    if film.caustics_refractive and of_glass and not smooth and all(_is_pane(snapshot.meshes[k]) for k in of_glass):
        return "all glass is flat panes, which light passes straight"
    lamps = (light for light in snapshot.lights if light.cast_shadow and light.visibility.diffuse)
    given = [light for light in lamps if np.any(light.strength)]
    others = _other_sources(snapshot, glass, mirrors)
    if not given and not others:
        return "no lamp that casts shadows, no emissive mesh and no bright part of the world lights them"
    boxes = np.array([_box(one, snapshot.meshes[one.mesh]) for one in shown])
    low, high = groups(*grown(boxes[:, 0], boxes[:, 1]))
    keys = frozenset(light.key for light in given).union(others)
    bent = frozenset(light.key for light in given if light.caustics and flagged) if by_flags else keys
    # Light that a lamp does not send to any caster throws none, and glass still stops it.
    receivers = {one.links.receiver for one in shown}
    dark = frozenset(light.key for light in given if receivers <= set(light.links.unlit))
    spreads = not glass and _only_spread(snapshot, shown, mirrors, given, boxes)
    reflective = film.caustics_reflective
    return Casters(frozenset(glass), mirrors, low, high, keys, bent, reflective, spreads, dark)


def _other_sources(snapshot: Snapshot, glass: set[int], mirrors: dict[int, float]) -> tuple[str, ...]:
    """Keys of what may light casters and is no lamp. The world's light is left to straight ways where nothing is glass:
    what metal mirrors of it is wide mostly, and virtual lights bring it."""
    world, found = snapshot.world, []
    shining = {k for k in snapshot.used_materials if may_emit(snapshot.materials[k].graph)} - glass - set(mirrors)
    if any(one.visibility.diffuse and not shining.isdisjoint(one.materials) for one in snapshot.instances):
        found.append(MESHES)
    if glass and np.any(world.color) and not world.even and world.visibility.diffuse and snapshot.casts_shadows:
        found.append(WORLD)
    return tuple(found)


class Answered:
    """The casters of a picture that a technique answers for; None where none does."""

    def __init__(self):
        self.casters: Casters | None = None
        self.known = False
        self.bright: BrightPart | None = None  # of the world
        self.on_gloss = False  # rough glossy lobes get light of lamps and the world by way of smooth glass as photons
        self.on_soft = False  # lobes without microfacets get what diffuse surfaces get

    @property
    def photons_shine(self) -> int:
        """On which lobes photons shine: a sum of PHOTONS_ON_GLOSS and PHOTONS_ON_SOFT (shaders/caustics/gloss.glsl)."""
        return PHOTONS_ON_GLOSS * bool(self.on_gloss) + PHOTONS_ON_SOFT * bool(self.on_soft)


def of(frame: Frame) -> Casters | None:
    """The casters that a technique of this picture answers for; None where the slot is empty."""
    shared = frame.shared(Answered)
    if not shared.known:
        found = casters_of(frame.snapshot) if frame.plan.owns(LIGHT_SPECULAR_DIFFUSE) else None
        shared.casters, shared.known = found if isinstance(found, Casters) else None, True
        if shared.casters is not None and WORLD in shared.casters.lights and frame.plan.runs("environment_light"):
            shared.bright = bright_part(frame.environment)
    return shared.casters


def bright_world(frame: Frame) -> BrightPart | None:
    """The part of the world whose light arrives by the slot where it passes casters."""
    return frame.shared(Answered).bright if of(frame) is not None else None


def answered(frame: Frame, emitter: lights.Emitter) -> bool:
    """Whether light of this lamp that passes casters arrives by the slot: to its shadows glass is opaque."""
    found = of(frame)
    return found is not None and key_of(emitter) in found.lights


def key_of(emitter: lights.Emitter) -> str:
    """Of a lamp, or of what emissive meshes or the world are to photons."""
    if emitter.light is not None:
        return emitter.light.key
    return MESHES if emitter.kind == lights.SURFACE else getattr(emitter, "key", "")


def meshes_answered(frame: Frame) -> bool:
    """The same for light of emissive meshes."""
    found = of(frame)
    return found is not None and MESHES in found.lights


def glass_alone(frame: Frame) -> frozenset[int]:
    """Casters that let light pass as glass and in no other way: opaque to shadows of lamps that are answered for."""
    found, graphs = of(frame), frame.snapshot.materials
    return frozenset(k for k in found.refracting if not _may_be_clear(graphs[k].graph)) if found else frozenset()


def stopped_by_all(frame: Frame) -> frozenset[int]:
    """The same where all light is answered for; nothing where some lamp, mesh or the world shines through glass."""
    materials = frame.snapshot.materials
    emits = any(may_emit(materials[k].graph) for k in frame.snapshot.used_materials)
    if frame.environment.power > 0 or (emits and not meshes_answered(frame)):
        return frozenset()
    lamps = [one for one in frame.emitters if one.light.cast_shadow]
    return glass_alone(frame) if all(answered(frame, one) for one in lamps) else frozenset()


def _may_be_clear(graph: Graph) -> bool:
    """Whether something besides glass may let light pass."""
    return any(
        node.type in _CLEAR or (node.type == "ShaderNodeBsdfPrincipled" and gloss.value(node, "Alpha") < 1.0)
        for node in graph.nodes.values()
    )


def _box(instance: Instance, mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    centre, half = (mesh.bounds_min + mesh.bounds_max) / 2, (mesh.bounds_max - mesh.bounds_min) / 2
    world = instance.matrix[:3, :3] @ centre + instance.matrix[:3, 3]
    reach = np.abs(instance.matrix[:3, :3]) @ half
    return world - reach, world + reach


def grown(low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Boxes with a margin. They are grown before they are grouped, so that no photon is in two groups."""
    pad = MARGIN * (high - low) + 1e-5 * np.linalg.norm(high.max(axis=0) - low.min(axis=0))
    return low - pad, high + pad


def _is_pane(mesh: Mesh) -> bool:
    """Whether a mesh is a slab between two flat faces, by area; its rim does not count."""
    corners = mesh.positions[mesh.corner_vertices[mesh.triangle_corners]].astype(np.float64)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(across, axis=1)
    if not area.sum() > 0:
        return False
    axis = across[np.argmax(area)] / area.max()
    cosine = across @ axis / np.maximum(area, 1e-300)
    front, back = area[cosine > FLAT].sum(), area[cosine < -FLAT].sum()
    return bool(front + back > 0.8 * area.sum() and abs(front - back) < 0.1 * (front + back))


def _only_spread(snapshot: Snapshot, shown: list[Instance], mirrors: Iterable[int], given, boxes: np.ndarray) -> bool:
    """Whether casters without glass make no light converge."""
    if any(node.type in _BUMPS for k in mirrors for node in snapshot.materials[k].graph.nodes.values()):
        return False
    places = np.array([light.matrix[:3, 3] for light in given if light.kind != "SUN"]).reshape(-1, 3)
    among = (boxes[:, 0, None] <= places) & (places <= boxes[:, 1, None])
    return not among.all(axis=2).any() and all(is_convex(snapshot.meshes[mesh]) for mesh in {one.mesh for one in shown})


_facing: dict[tuple, float] = {}  # by what tells a mesh's content


def is_convex(mesh: Mesh) -> bool:
    """Whether a mesh is closed, and bends away from itself at many edges and towards itself at none."""
    return convex_facing(mesh) != 0.0


def convex_facing(mesh: Mesh) -> float:
    """Of a convex mesh (is_convex) 1 where its triangles face outwards, -1 where inwards; of others 0."""
    key = (mesh.key, mesh.version, mesh.triangle_count, mesh.bounds_min.tobytes(), mesh.bounds_max.tobytes())
    if key not in _facing:
        if len(_facing) > 256:
            _facing.clear()
        _facing[key] = _convex_facing(mesh) if mesh.triangle_count <= MOST_LOOKED_AT else 0.0
    return _facing[key]


def _convex_facing(mesh: Mesh) -> float:
    triangles = mesh.corner_vertices[mesh.triangle_corners].astype(np.int64)  # (T, 3)
    edges = np.sort(np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1)
    opposite = np.concatenate([triangles[:, (k + 2) % 3] for k in range(3)])
    owner = np.tile(np.arange(len(triangles)), 3)
    order = np.argsort(edges[:, 0] * len(mesh.positions) + edges[:, 1], kind="stable")
    if len(order) < 2 * _FEWEST_EDGES or len(order) % 2:
        return 0.0
    one, other = order[::2], order[1::2]
    third = np.r_[order[2::2], order[:1]]
    if (edges[one] != edges[other]).any() or (edges[other] == edges[third]).all(axis=1).any():
        return 0.0  # an edge of one triangle, or of more than two
    places = mesh.positions.astype(np.float64)
    corners = places[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1)
    if not (length > 0).all():
        return 0.0
    offset = places[opposite[other]] - places[edges[one, 0]]
    sine = np.einsum("ij,ij->i", (normals / length[:, None])[owner[one]], offset) / np.linalg.norm(offset, axis=1)
    facing = -float(np.sign(sine.sum()))  # normals may all point inwards
    sine *= facing
    return facing if (sine < 1e-4).all() and (sine < -1e-4).mean() >= LEAST_BENT else 0.0


def boxes_of(frame: Frame, found: Casters) -> Iterable[tuple[np.ndarray, np.ndarray]]:
    """The casters' boxes relative to the render origin."""
    return zip(found.low - frame.geometry.origin, found.high - frame.geometry.origin)
