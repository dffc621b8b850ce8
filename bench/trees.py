"""The trees that rays search: `python -m bench trees --page`, about two minutes, writes docs/trees.md.

Rays: those of a camera and as many that leave a surface in any direction, through the same triangles in one tree and
with trees of meshes' own. Moves: one of 2,000 objects of 500 triangles each moves in a viewport's draft, and the view
comes to rest; what the hierarchy takes of that, and what one built anew takes. Scenes: from reading 10^6 triangles out
of Blender to the first picture, of which the hierarchy. Copies: 10^5 instances of a mesh of 10^4 triangles.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from bench.study import Study

SIDE = 256  # rays along a side of their image
OBJECTS, EACH = 2000, 500  # of the scene of a million triangles
MAIN = """
#include "trace/hierarchy.glsl"
void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  ivec2 hit;
  float t = trace_nearest(origins_fetch(pixel).xyz, directions_fetch(pixel).xyz, 1e30, 0u, hit);
  vec3 normal = (hit.x >= 0) ? triangle_normal(hit) : vec3(0.0);
  imageStore(found, pixel, vec4(normal, t));
}
"""


# Triangles ------------------------------------------------------------------------------------------------------------


def bumpy(triangles: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A ball with bumps: vertices (V, 3) and about so many triangles (T, 3)."""
    rings = max(int(np.sqrt(triangles / 4)), 3)
    around = 2 * rings
    lat, lon = np.meshgrid(np.linspace(0, np.pi, rings + 1), np.arange(around) * 2 * np.pi / around, indexing="ij")
    rng = np.random.default_rng(seed)
    a, b = rng.integers(2, 7, 2)
    radius = 1.0 + 0.15 * np.sin(a * lat) * np.cos(b * lon)
    places = np.stack([np.sin(lat) * np.cos(lon), np.sin(lat) * np.sin(lon), np.cos(lat)], -1) * radius[..., None]
    k, j = np.meshgrid(np.arange(rings), np.arange(around), indexing="ij")
    corner = [(k + x) * around + (j + y) % around for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    faces = np.concatenate([np.stack([corner[p] for p in some], -1).reshape(-1, 3) for some in ((0, 1, 2), (0, 2, 3))])
    return places.reshape(-1, 3), faces


def placed(rng, count: int, apart: float) -> np.ndarray:
    """(N, 4, 4) turned and scaled places on a square, so many radii apart."""
    side = apart * np.sqrt(count)
    found = np.tile(np.eye(4), (count, 1, 1))
    for matrix in found:
        matrix[:3, :3] = np.linalg.qr(rng.normal(size=(3, 3)))[0] * rng.uniform(0.6, 1.2)
        matrix[:3, 3] = *rng.uniform(-side / 2, side / 2, 2), rng.uniform(0, 2)
    return found


def look_of(count: int) -> np.ndarray:
    from addon.scene.traced_triangles import opaque_code

    look = np.zeros((count, 8))
    look[:, 0] = opaque_code()
    return look


def of_copies(meshes: list[np.ndarray], matrices: list[np.ndarray]):
    """Trees of meshes' own, (T, 3, 3) each, with instances at (N, 4, 4)."""
    from addon.scene.acceleration import Tree, Trees
    from addon.scene.instance_tree import Copies
    from addon.snapshot.scene import Instance

    found, number = [], 0
    for corners, some in zip(meshes, matrices):
        tree = Tree(corners, look_of(len(corners)))
        instances = [Instance("thing", "mesh", matrix, (0,)) for matrix in some]
        numbers = list(range(number, number + len(some)))
        found.append(Copies(tree, instances, numbers, *tree.boxes.around(64)))
        number += len(some)
    nothing = Tree(np.zeros((0, 3, 3), np.float32), np.zeros((0, 8)))
    return Trees(nothing, copies=found)


def in_one(meshes: list[np.ndarray], matrices: list[np.ndarray]):
    """The same in one tree."""
    from addon.scene import acceleration

    parts = [corners @ matrix[:3, :3].T + matrix[:3, 3] for corners, some in zip(meshes, matrices) for matrix in some]
    corners = np.concatenate(parts).astype(np.float32)
    return acceleration.build(corners, look_of(len(corners)))


# Rays -----------------------------------------------------------------------------------------------------------------


def program():
    from addon.gfx.library import Program
    from addon.scene import acceleration

    return Program(
        name="rays through trees", compute="generated/main",
        textures=(*acceleration.HIERARCHY_TEXTURES, ("RGBA32F", "origins"), ("RGBA32F", "directions")),
        images=(("found", "RGBA32F", "FLOAT_2D", "WRITE"),), snippets=(("generated/main", MAIN),), group=(8, 8, 1),
    )  # fmt: skip


class Rays:
    """SIDE x SIDE rays and what they meet."""

    def __init__(self, origins: np.ndarray, directions: np.ndarray, side: int):
        from addon.gfx import images

        self.side = side
        self.sent = [
            images.upload(np.pad(some, ((0, 0), (0, 1))).reshape(side, side, 4).astype(np.float32))
            for some in (origins, directions)
        ]
        self.found = images.create(side, side, "RGBA32F")

    def follow(self, trees) -> None:
        from addon.gfx import passes

        bound = {**trees.hierarchy.textures, "origins": self.sent[0], "directions": self.sent[1]}
        passes.compute(program(), (self.side, self.side), textures=bound, images={"found": self.found})

    def seconds(self, *some: object) -> list[float]:
        """Least times through each of these trees, taken by turns."""
        from addon.gfx import images

        best = [np.inf] * len(some)
        for turn in range(6):
            for k, trees in enumerate(some):
                images.finish()
                started = time.perf_counter()
                self.follow(trees)
                images.finish()
                if turn:
                    best[k] = min(best[k], time.perf_counter() - started)
        return best


def from_camera(reach: float, side: int) -> tuple[np.ndarray, np.ndarray]:
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, side), np.linspace(-0.5, 0.5, side))
    directions = np.stack([x, np.ones_like(x), y - 0.45], -1).reshape(-1, 3)
    origins = np.broadcast_to((0.0, -0.6 * reach, 0.35 * reach), directions.shape)
    return origins, directions / np.linalg.norm(directions, axis=1, keepdims=True)


def rays(size: float) -> list[tuple[str, ...]]:
    """Times of the same rays."""
    from addon.gfx import images

    rng = np.random.default_rng(3)
    side = int(SIDE * np.sqrt(size))
    scenes = {
        "500 objects, each of its own mesh": (500, 500, 500, 2.5),
        "40 copies of a mesh, side by side": (1, 40, 10_000, 3.0),
        "40 copies of a mesh, in each other": (1, 40, 10_000, 1.0),
        "500 copies of a small mesh": (1, 500, 500, 2.5),
    }
    rows = [("scene", "triangles", "rays", "one tree, ms", "trees of meshes, ms", "ratio", "MB", "MB")]
    for name, (kinds, count, triangles, apart) in scenes.items():
        kinds, count = max(int(kinds * size), 1), max(int(count * size), 1)
        matrices = np.array_split(placed(rng, count, apart), kinds)
        meshes = []
        for k in range(kinds):
            places, faces = bumpy(triangles, k)
            meshes.append(places[faces].astype(np.float32))
        flat, own = in_one(meshes, matrices), of_copies(meshes, matrices)
        first = Rays(*from_camera(apart * np.sqrt(count), side), side)
        first.follow(flat)
        met = images.read(first.found).reshape(-1, 4)
        origins, directions = from_camera(apart * np.sqrt(count), side)
        hits = np.flatnonzero(met[:, 3] < 1e29)
        chosen = hits[rng.integers(len(hits), size=side * side)]
        normal = np.where(
            (met[chosen, :3] * directions[chosen]).sum(1, keepdims=True) > 0, -met[chosen, :3], met[chosen, :3]
        )
        away = normal + rng.normal(size=normal.shape) / 1.5
        away *= np.sign((away * normal).sum(1, keepdims=True))
        away /= np.linalg.norm(away, axis=1, keepdims=True)
        start = origins[chosen] + met[chosen, 3:] * directions[chosen] + 1e-3 * normal
        for kind, sent in (("of the camera", first), ("from surfaces", Rays(start, away, side))):
            a, b = sent.seconds(flat, own)
            rows.append((
                name, f"{count * len(meshes[0]):,}", kind, f"{1e3 * a:.1f}", f"{1e3 * b:.1f}", f"{b / a:.2f}",
                f"{flat.hierarchy.bytes / 1e6:.1f}", f"{own.hierarchy.bytes / 1e6:.1f}",
            ))  # fmt: skip
            print(*rows[-1], sep=", ", flush=True)
    return rows


# Copies ---------------------------------------------------------------------------------------------------------------


def copies(size: float) -> list[tuple[str, ...]]:
    """10^5 instances of 10^4 triangles."""
    rng = np.random.default_rng(4)
    places, faces = bumpy(10_000)
    count = int(1e5 * size)
    matrices = placed(rng, count, 2.5)
    started = time.perf_counter()
    trees = of_copies([places[faces].astype(np.float32)], [matrices])
    built = time.perf_counter() - started
    sent = Rays(*from_camera(2.5 * np.sqrt(count), 256), 256)
    seconds = sent.seconds(trees)[0]
    moved = replace(trees.upper.instances[7], matrix=trees.upper.instances[7].matrix + np.eye(4)[3] * 0.5)
    nothing = np.zeros((0, 3, 3), np.float32), np.zeros((0, 8))
    times = []
    for _ in range(5):
        started = time.perf_counter()
        assert trees.move(np.zeros(0, int), nothing, {7: moved})
        times.append(time.perf_counter() - started)
    expanded = count * len(faces) * trees.hierarchy.leaves.bytes / trees.hierarchy.triangles
    return [
        (
            "instances", "triangles of each", "MB", "MB of leaves if expanded", "built, s", "one moves, ms",
            "ms for 65,536 rays",
        ),
        (
            f"{count:,}", f"{len(faces):,}", f"{trees.hierarchy.bytes / 1e6:.1f}", f"{expanded / 1e6:,.0f}",
            f"{built:.2f}", f"{1e3 * min(times):.1f}", f"{1e3 * seconds:.0f}",
        ),
    ]  # fmt: skip


# Moves ----------------------------------------------------------------------------------------------------------------


def million(size: float):
    """A Blender scene of OBJECTS meshes of EACH triangles on a floor below a sun."""
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    rng = np.random.default_rng(5)
    count = int(OBJECTS * size)
    for k, matrix in enumerate(placed(rng, count, 2.5)):
        places, faces = bumpy(EACH, k)
        mesh = bpy.data.meshes.new(f"mesh {k}")
        mesh.from_pydata(places.tolist(), [], faces.tolist())
        thing = bpy.data.objects.new(f"thing {k}", mesh)
        thing.matrix_world = matrix.tolist()
        scene.collection.objects.link(thing)
    side = 2.5 * np.sqrt(count)
    bpy.ops.mesh.primitive_plane_add(size=2 * side)
    bpy.ops.object.light_add(type="SUN", rotation=(0.5, 0.3, 0.0))
    bpy.ops.object.camera_add(location=(0, -0.6 * side, 0.35 * side), rotation=(1.0, 0, 0))
    scene.camera = bpy.context.object
    return scene


class Timed:
    """Seconds in calls of HierarchyCache.get, and of the processor's time, which a busy machine changes less."""

    def __init__(self):
        from addon.gfx import images
        from addon.scene.acceleration import HierarchyCache

        self.seconds = np.zeros(2)
        original = HierarchyCache.get

        def get(cache, *arguments):
            for measured in ("measured_materials", "opacity_maps", "emission_maps"):  # no part of it
                getattr(arguments[0], measured)
            images.finish()
            started = time.perf_counter(), time.process_time()
            found = original(cache, *arguments)
            images.finish()
            self.seconds += np.subtract((time.perf_counter(), time.process_time()), started)
            return found

        HierarchyCache.get = get

    def take(self) -> tuple[float, float]:
        """Since the last time."""
        seconds, self.seconds = self.seconds, np.zeros(2)
        return tuple(seconds.tolist())


def moves(size: float) -> list[tuple[str, ...]]:
    """One object moves among many, and a new scene of a million triangles."""
    import bpy

    from addon.frame.run import Renderer
    from addon.gfx import images
    from addon.snapshot import SnapshotCache, take
    from addon.techniques import make_registry
    from addon.ui.properties import settings_of

    scene = million(size)
    timed, cache = Timed(), SnapshotCache()
    settings = replace(settings_of(scene, viewport=True), samples=1)

    def step(renderer, draft: bool) -> tuple[float, ...]:
        """Seconds of reading the scene, of the rest of the picture, and, both ways, of the hierarchy in it."""
        timed.take()
        started = time.perf_counter()
        snapshot = take(bpy.context.evaluated_depsgraph_get(), cache, 64, 48)
        read = time.perf_counter()
        frame = renderer.begin(snapshot, settings.as_draft() if draft else settings)
        renderer.advance(frame)
        renderer.show(frame)
        images.finish()
        return read - started, time.perf_counter() - read, *timed.take()

    first = Renderer(make_registry)
    step(first, False)  # compiles
    first.release()
    cache = SnapshotCache()
    renderer = Renderer(make_registry)
    rows = [
        (
            "what happens", "reading the scene, ms", "the rest of the picture, ms", "of which the hierarchy, ms",
            "of the processor, ms",
        )
    ]  # fmt: skip

    def said(name: str, seconds: tuple[float, ...]) -> None:
        rows.append((name, *(f"{1e3 * one:.0f}" if one >= 0.01 else f"{1e3 * one:.1f}" for one in seconds)))
        print(*rows[-1], sep=", ", flush=True)

    said("the scene is opened", step(renderer, False))
    step(renderer, True)
    drafts, rests = [], []
    thing = bpy.data.objects["thing 7"]
    for _ in range(3):
        thing.location.x += 0.4
        drafts.append(step(renderer, True))
        rests.append(step(renderer, False))
    said(f"one of {int(OBJECTS * size):,} objects moves, draft", tuple(np.median(drafts, axis=0)))
    said("the view rests", tuple(np.median(rests, axis=0)))
    renderer.release()
    return rows


PARTS = {"rays": rays, "moves": moves, "copies": copies}
STUDY = Study(
    "trees",
    {name: lambda options, part=part: part(0.1 if options.small else 1.0) for name, part in PARTS.items()},
    {"--small": {"action": "store_true", "help": "a tenth of everything, of which nothing is written"}},
    flag="--page --part",
)
add_options = STUDY.add_options


def command(options) -> int:
    options.page = options.page and not options.small
    return STUDY.command(options)
