"""Blender's bake operator with Candela: texels of a target as places of an object's surface, lit as in any picture.

Blender itself finds which place of which triangle each texel shows, also from a cage and from selected objects to the
active one, fills margins and turns normals into the target's space. Here these places become the surface of a picture
(surfaces/baked.py), whose light by path is put together as the operator asks. Of BakePrimitive, two numbers are weights
of the triangle's first two corners, and the third is its number among all triangles of the mesh, -1 for none.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from . import final
from .frame.run import Renderer
from .frame.schedule import FINAL
from .frame.settings import Settings
from .materials.graph import Graph, Input, Node
from .snapshot.scene import (
    NO_LINKS,
    BakedPoints,
    Camera,
    Film,
    Instance,
    Material,
    Mesh,
    Snapshot,
    Visibility,
    World,
)
from .ui.passes import RenderPass

EMIT, DIFFUSE, GLOSSY, TRANSMISSION, DIRECT, INDIRECT, COLOR = (1 << k for k in (1, 2, 3, 4, 6, 7, 8))  # of pass_filter
LOBES = {"diffuse": DIFFUSE, "glossy": GLOSSY, "transmission": TRANSMISSION}
ORDERS = {"direct": DIRECT, "indirect": INDIRECT}
SIZE = 1e-3  # of the film's filter, pixels: each texel is by itself
DATA_SAMPLES = 4  # at most, of what is no light
PARAMS = {("film", "points"): 1}
GLASS = ("ShaderNodeBsdfGlass", "ShaderNodeBsdfRefraction")
SUBSURFACE = "ShaderNodeSubsurfaceScattering"
MIRROR = Graph(
    {
        "mirror": Node(
            "mirror", "Mirror", "ShaderNodeBsdfAnisotropic",
            {"Color": Input("COLOR", (1.0, 1.0, 1.0, 1.0)), "Roughness": Input("FLOAT", 0.0)}, {"BSDF": "SHADER"},
        )
    },
    ("mirror", "BSDF"),
)  # fmt: skip

Draw = Callable[[Snapshot, Settings, tuple[str, ...]], dict[str, np.ndarray]]


def places(primitive: np.ndarray, differential: np.ndarray, rows: np.ndarray, key: str) -> BakedPoints:
    """What Blender says of texels, (H, W, 3) and (H, W, 4) float32. `rows`: (T,) of each triangle of Blender's mesh the
    row in ours, -1 for none."""
    number = primitive[..., 2].copy().view(np.int32)
    there = (number >= 0) & (number < len(rows))
    triangle = np.where(there, rows[np.where(there, number, 0)] if len(rows) else -1, -1)
    first, second = (np.where(there, primitive[..., k], 0.0).astype(np.float64) for k in (0, 1))
    along = np.where(there[..., None], differential, 0.0).astype(np.float64)
    step = np.stack([along[..., 2:], -along[..., :2] - along[..., 2:]], axis=-1)
    return BakedPoints(key, triangle, np.stack([second, 1.0 - first - second], axis=-1), step)


def rows_of(mesh: Mesh, corners: np.ndarray) -> np.ndarray:
    """(T,) row in `mesh` of triangles given by their corners, (T, 3); -1 for those that it lacks."""
    known = {tuple(three): row for row, three in enumerate(mesh.triangle_corners.tolist())}
    return np.array([known.get(tuple(three), -1) for three in corners.tolist()], np.int64)


def left_out(instance: Instance, snapshot: Snapshot) -> list[str]:
    """Sentences about what a bake of an object does not show as a picture does."""
    found = []
    for material in {snapshot.materials[slot].name: snapshot.materials[slot] for slot in instance.materials}.values():
        nodes = material.graph.nodes.values()
        if any(node.type in GLASS or _weighs(node, "Transmission Weight") for node in nodes):
            found.append(f"Material '{material.name}': what glass shows is too bright in a bake.")
        if any(node.type == SUBSURFACE or _weighs(node, "Subsurface Weight") for node in nodes):
            found.append(f"Material '{material.name}': light below the surface leaves where it entered, in a bake.")
    if snapshot.world.medium is not None or snapshot.volumes:
        found.append("Fog is left out of bakes.")
    return found


def _weighs(node: Node, name: str) -> bool:
    socket = node.inputs.get(name)
    return socket is not None and (socket.link is not None or bool(socket.value))


def seen_from_above(instance: Instance, mesh: Mesh, width: int, height: int) -> Camera:
    """A camera that has the object before it; of what it sees only the direction of view counts, which it has from each
    place."""
    ends = np.stack([mesh.bounds_min, mesh.bounds_max])
    corners = np.array([[ends[i, 0], ends[j, 1], ends[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    placed = corners @ instance.matrix[:3, :3].T + instance.matrix[:3, 3]
    low, high = placed.min(axis=0), placed.max(axis=0)
    reach = max(float(np.linalg.norm(high - low)), 1e-3)
    matrix = np.eye(4)
    matrix[:3, 3] = 0.5 * (low + high) + (0.0, 0.0, reach)
    half = 0.5 * reach
    tall = half * height / max(width, 1)
    return Camera(matrix, "ORTHOGRAPHIC", (-half, half, -tall, tall), 0.0, 2.0 * reach, "Bake", from_above=True)


def prepared(snapshot: Snapshot, points: BakedPoints, width: int, height: int) -> Snapshot:
    """The scene as a picture of these places. A camera that the snapshot has is the one to be looked from."""
    instance = next(one for one in snapshot.instances if one.key == points.instance)
    camera = snapshot.camera
    if not points.through_camera or camera is None:
        camera = seen_from_above(instance, snapshot.meshes[instance.mesh], width, height)
    # Of a panoramic camera, too, only where it stands counts.
    straight = {} if camera.panorama is None else {"kind": "PERSPECTIVE", "panorama": None}
    film = Film(
        width, height, (0, 0, width, height), SIZE, caustics_reflective=snapshot.film.caustics_reflective,
        caustics_refractive=snapshot.film.caustics_refractive,
    )  # fmt: skip
    world = replace(snapshot.world, medium=None, volume=None)  # what would lie between a surface and its viewer
    return replace(
        snapshot,
        camera=replace(camera, aperture=None, bends=points.through_camera, **straight),
        film=film,
        baked=points,
        motion=None,
        world=world,
        volumes=(),
    )


LIT = ("COMBINED", "DIFFUSE", "GLOSSY", "TRANSMISSION")
BY_MESH = ("POSITION", "UV")  # what the mesh says without its materials


def by_mesh(kind: str, instance: Instance, mesh: Mesh, points: BakedPoints) -> np.ndarray:
    """(H, W, 4) float32 at the middles of texels: where they lie in the world, or in the map that renders."""
    there = points.triangle >= 0
    corners = mesh.triangle_corners[points.triangle[there]]
    share = points.share[there]
    weights = np.concatenate([1.0 - share.sum(axis=1, keepdims=True), share], axis=1)
    made = np.zeros((*points.triangle.shape, 4), np.float32)
    made[there, 3] = 1.0
    if kind == "POSITION":
        places = (weights[:, :, None] * mesh.positions[mesh.corner_vertices[corners]]).sum(axis=1)
        made[there, :3] = places @ instance.matrix[:3, :3].T + instance.matrix[:3, 3]
    elif mesh.active_uv in mesh.uv_maps:
        made[there, :2] = (weights[:, :, None] * mesh.uv_maps[mesh.active_uv][corners]).sum(axis=1)
        made[there, 2] = 1.0
    return made


def drawing(renderer: Renderer, parts: Callable, taken: Callable, broken: Callable[[], bool]) -> Draw:
    """A function that draws a snapshot and returns mean images by name. `taken` runs steps where a GPU may be used."""

    def draw(snapshot: Snapshot, settings: Settings, names: tuple[str, ...]) -> dict[str, np.ndarray]:
        wanted = [RenderPass("", name, "RGBA", "COLOR", name) for name in names]
        order = final.Order(renderer, snapshot, settings, wanted, parts=parts)
        steps = taken(final.steps(order))
        while True:
            try:
                next(steps)
            except StopIteration as end:
                return end.value[0]
            if broken():
                steps.close()
                raise InterruptedError

    return draw


def baked(kind: str, what: int, snapshot: Snapshot, settings: Settings, draw: Draw) -> np.ndarray:
    """(H, W, 4) float32: what a bake of a kind, with these bits of a pass filter, has at the places of a snapshot."""
    values = {**settings.values, **PARAMS}
    settings = replace(settings, values=values, schedule=FINAL, time_limit=0.0, noise_threshold=0.0)
    few = replace(settings, samples=min(settings.samples, DATA_SAMPLES))
    if kind == "COMBINED":
        wanted = [f"radiance.{lobe}_{order}" for lobe, bit in LOBES.items() if what & bit
                  for order, own in ORDERS.items() if what & own]  # fmt: skip
        wanted += ["radiance.emission"] if what & EMIT else []
        return _opaque(_sum(draw(snapshot, settings, tuple(wanted)), wanted))
    if kind in ("DIFFUSE", "GLOSSY", "TRANSMISSION"):
        return _opaque(_lobe(kind.lower(), what, snapshot, settings, few, draw))
    if kind == "EMIT":
        return _opaque(_sum(draw(snapshot, few, ("radiance.emission",)), ["radiance.emission"]))
    if kind == "AO":
        return _opaque(_occlusion(snapshot, settings, draw))
    if kind == "SHADOW":
        return _opaque(_shadow(snapshot, settings, draw))
    if kind == "NORMAL":
        normal = draw(snapshot, few, ("surface.normal_sum",))["surface.normal_sum"][..., :3]
        length = np.linalg.norm(normal, axis=-1, keepdims=True)
        return _opaque(np.where(length > 0.0, normal / np.maximum(length, 1e-20), 0.0))
    if kind == "ROUGHNESS":
        arrays = draw(snapshot, few, ("surface.emission", "surface.tint"))
        rough = np.where(arrays["surface.tint"][..., :3].any(axis=-1), arrays["surface.emission"][..., 3], 1.0)
        return _opaque(np.repeat(rough[..., None], 3, axis=-1))
    if kind == "ENVIRONMENT":
        return _opaque(_environment(snapshot, few, draw))
    raise ValueError(f"Candela does not bake {kind.capitalize()}.")


def _sum(arrays: dict[str, np.ndarray], names: list[str]) -> np.ndarray:
    return np.sum([arrays[name][..., :3] for name in names], axis=0)


def _lobe(lobe: str, what: int, snapshot: Snapshot, settings: Settings, few: Settings, draw: Draw) -> np.ndarray:
    """Light of one lobe, with or without the surface's colour, or the colour alone."""
    color, orders = f"color.{lobe}", [order for order, bit in ORDERS.items() if what & bit]
    if not orders:
        return draw(snapshot, few, (color,))[color][..., :3]
    names = [f"radiance.{lobe}_{order}" for order in orders]
    arrays = draw(snapshot, settings, (*names, color))
    light = _sum(arrays, names)
    if what & COLOR:
        return light
    own = arrays[color][..., :3]
    return np.where(own > 0.0, light / np.maximum(own, 1e-20), 0.0)


def _environment(snapshot: Snapshot, settings: Settings, draw: Draw) -> np.ndarray:
    """The world, as Cycles bakes it: in the direction in which a place lies from the world's origin. A mirror that
    faces there and stands alone shows it."""
    instance = next(one for one in snapshot.instances if one.key == snapshot.baked.instance)
    alone = replace(instance, visibility=Visibility(glossy=False, shadow=False), links=NO_LINKS)
    world = replace(snapshot.world, visibility=Visibility())
    mirrors = replace(
        snapshot, instances=(alone,), lights=(), world=world,
        materials=(Material("mirror", "Mirror", MIRROR), *snapshot.materials[1:]),
        baked=replace(snapshot.baked, plain=True, outward=True),
    )  # fmt: skip
    names = ("radiance.glossy_direct", "radiance.glossy_indirect")
    return _sum(draw(mirrors, settings, names), list(names))


def _occlusion(snapshot: Snapshot, settings: Settings, draw: Draw) -> np.ndarray:
    """What a white world would light a grey surface with, over what it would without things around."""
    white = World(np.ones(3))
    bare = replace(
        snapshot, lights=(), world=white, baked=replace(snapshot.baked, plain=True)
    )  # fmt: skip
    arrays = draw(bare, replace(settings, bounces=0), ("radiance.diffuse_direct", "color.diffuse"))
    own = arrays["color.diffuse"][..., :3]
    return np.clip(np.where(own > 0.0, arrays["radiance.diffuse_direct"][..., :3] / np.maximum(own, 1e-20), 0.0), 0, 1)


def _shadow(snapshot: Snapshot, settings: Settings, draw: Draw) -> np.ndarray:
    """What lamps light a grey surface with, over what they would if nothing cast shadows."""
    names = ("radiance.diffuse_direct",)
    lit = replace(snapshot, world=World(np.zeros(3)), baked=replace(snapshot.baked, plain=True))
    direct = replace(settings, bounces=0)
    shaded = draw(lit, direct, names)[names[0]][..., :3]
    clear = tuple(replace(one, visibility=replace(one.visibility, shadow=False)) for one in lit.instances)
    whole = draw(replace(lit, instances=clear), direct, names)[names[0]][..., :3]
    return np.clip(np.where(whole > 1e-7, shaded / np.maximum(whole, 1e-7), 1.0), 0.0, 1.0)


def _opaque(colors: np.ndarray) -> np.ndarray:
    made = np.ones((*colors.shape[:2], 4), np.float32)
    made[..., :3] = np.nan_to_num(colors, posinf=0.0, neginf=0.0)
    return made
