"""Points by area on all surfaces, shaded and lit, as trees.

A run is a set of points by area (scene/area_points.py) in the order of a tree (scene/point_tree.py). Each point has
two sides, entries 2 i and 2 i + 1 of the images here, ROW a row: the one that its triangle faces by its winding, and
the other one. Nothing asks for the inside of a closed object that is not entered; rooms are closed, too, and entered.
What points reflect and the light on them is of lit_points.py, once a picture and in each sample.

| cost | |
|---|---|
| points and tree | on the CPU, when geometry changes; in a viewport they move along and bounds are refitted |
| where they are few, where their light holds | rays of scene/seen.py and a readback; 3 rays for each side of each |
| closures, light | of 2 points, as lit_points.py |

Bias: one set of RUNS after the other, so what lies between points is never lit itself; of a mix of closures each point
has one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..frame.picture import Frame
from ..frame.technique import Technique
from ..gfx import images, passes
from ..materials.compiled import CompiledMaterial
from ..scene import acceleration
from ..scene.area_points import AreaPoints, Surfaces, shown_of, spread
from ..scene.pieces import octahedral
from ..scene.point_tree import PointTree, fitted
from ..scene.seen import UNSEEN, seen_triangles
from ..scene.view import VIEW
from ..surfaces.hits import Hits, Records
from .lit_points import NAMES, LitPoints

ROW = 128  # entries of a row of images of points
RUNS = 8
LEAST = 6  # levels of a tree, at least
LIGHTS, OTHERS = 4, 16  # points on each lamp in a picture of one sample; of the world and emissive meshes at least
TURN = "8.0"  # more than a turn: what bits of shaders/micro/clips.frag.glsl count beside an angle
CLIPS = passes.fullscreen_program(
    "where light of points holds",
    "micro/clips.frag.glsl",
    textures=(
        *acceleration.HIERARCHY_TEXTURES,
        *(("RGBA32F", name) for name in ("tree_nodes", "point_place", "point_facing")),
    ),
    blocks=((VIEW, "film_view"),),
    constants=(("INT", "leaf_count"), ("FLOAT", "offset_size")),
    defines=(("POINT_ROW", str(ROW)), ("TURN", TURN)),
    outputs=(("VEC4", "out_clips"),),
)  # fmt: skip
NOTHING_STANDS = 1e29  # less than NONE of shaders/micro/clips.frag.glsl
SHARPNESS = 64.0  # see PointLight: a bright spot is one of thousands of points that are gathered


@dataclass
class Run:
    """Points of one run on the GPU, and as a tree. `clips`: where on its piece light at a point holds; `shaded`: place,
    normals and albedo of both sides of all, and gloss apart where it is `directed` (lit_points.REFLECT_APART)."""

    points: AreaPoints
    tree: PointTree
    nodes: images.Image
    own: tuple[images.Image, ...]
    facing: images.Image
    clips: images.Image
    materials: frozenset[int]
    seen: np.ndarray  # (leaves, 2) bool: whether front and back of each point see any surface
    shaded: images.Target | None = None

    @property
    def size(self) -> tuple[int, int]:
        """Of images of the points."""
        return ROW, 2 * self.tree.leaves // ROW

    @property
    def directed(self) -> bool:
        """Whether gloss is apart."""
        return len(self.shaded.colors) > len(NAMES)

    @property
    def albedo(self) -> images.Image:
        """Of all that points reflect."""
        return self.shaded.colors[len(NAMES) if self.directed else 2]


class PointRuns:
    """The points of a renderer's scene for one technique: it calls `begin` in each picture, `run` and `light` in each
    sample."""

    def __init__(self, use: str):
        self._lit = LitPoints(use, few=LIGHTS, others=OTHERS, sharpness=SHARPNESS)
        self._runs: dict[int, Run] = {}
        self._surfaces: Surfaces | None = None
        self._seen: np.ndarray | None = None  # (T, 2), by triangle
        self._key: object = None
        self._moved = False  # points have followed a motion, and lie elsewhere than they would be spread now
        self.count = 0

    def begin(self, frame: Frame, technique: Technique, count: int) -> None:
        """Take over the scene as it is in this picture, for about `count` points, a power of two."""
        self.count = 1 << max(round(np.log2(count)), LEAST)
        kinds, exact = _keys(frame)
        key = (self.count, kinds), exact
        # A picture by itself does not depend on those before it: what has moved along is spread anew for it.
        if key != self._key or (self._moved and frame.settings.schedule.may_rebuild):
            follows = self._key is not None and self._key[0] == key[0] and not frame.settings.schedule.may_rebuild
            before = self._runs if follows else {}
            self._give()
            self._surfaces, self._key, self._moved = Surfaces.of(frame), key, follows
            if not follows:
                self._seen = seen_triangles(frame, self._surfaces)
                self._surfaces = replace(self._surfaces, rate=np.where(self._seen.any(axis=1), 1.0, UNSEEN))
            else:  # what has moved may see something by now
                self._seen = np.ones((len(self._surfaces.owner), 2), bool)
            for number, run in before.items():
                self._runs[number] = self._placed(frame, run.points)
            frame.count(technique, "trees refitted", len(before))
        else:
            # What keys do not tell apart, as a name or a pass index, makes another object of an instance, too.
            self._surfaces = replace(self._surfaces, shown=shown_of(frame))
            frame.count(technique, "trees kept", len(self._runs))
        for run in self._runs.values():
            self._unshade(run)
        self._lit.begin(frame)

    def run(self, frame: Frame, technique: Technique, number: int) -> Run | None:
        """The points of a run, shaded; None where no surface has any."""
        number %= RUNS
        if number not in self._runs:
            points = spread(self._surfaces, self.count, number)
            if not len(points):
                return None
            self._runs[number] = self._placed(frame, points)
            frame.count(technique, "trees made")
        run = self._runs[number]
        if run.shaded is None:
            self._shade(frame, technique, run)
        return run

    def light(self, frame: Frame, technique: Technique, run: Run) -> tuple[images.Image, ...]:
        """What both sides of all points reflect of this sample's direct light, images of the pool: radiance, and of a
        run that is `directed` without gloss, then what falls across its direction, and its ways (PointLight.add)."""
        target = images.Target(tuple(images.pool.take(*run.size, "RGBA32F") for _ in range(3 if run.directed else 2)))
        target.clear()
        self._lit.light(frame, technique, run.shaded.colors, target, 2 * run.tree.leaves)
        if run.directed:
            return target.colors
        images.pool.give(target.colors[1])
        return target.colors[:1]

    def _placed(self, frame: Frame, points: AreaPoints) -> Run:
        """The run of these points, which are in the order of a tree's leaves."""
        surfaces = self._surfaces
        position, normal, area = points.placed(surfaces)
        pieces = points.pieces(surfaces)
        tree = fitted(np.arange(len(points)), position, normal, area, pieces, points.sides(surfaces))
        hits, rows = frame.kept(Hits), {id(one): row for row, one in enumerate(frame.geometry.placed[0])}
        owner, number = surfaces.owner[points.triangle], surfaces.number[points.triangle]
        instance, of_material, material = (np.zeros(len(points)) for _ in range(3))
        shading = normal.copy()
        meshes = frame.geometry.placed[1]
        for k in np.unique(owner):
            one, own = surfaces.shown[k], owner == k
            mesh = meshes[one.mesh]
            instance[own] = rows[id(one)]
            of_material[own] = hits.numbers(frame, one)[number[own]]
            material[own] = mesh.triangle_materials(one.materials)[number[own]]
            shading[own] = _shading_normals(mesh, one.matrix[:3, :3], number[own], points.share[own])
        width = 2.0 * np.sqrt(area / np.pi)
        columns = (
            np.concatenate([position, width[:, None]], axis=1),
            np.concatenate([instance[:, None], of_material[:, None], points.share], axis=1),
            np.concatenate([octahedral(normal), octahedral(shading)], axis=1),
            np.stack([material, np.isfinite(position).all(axis=1), *np.zeros((2, len(points)))], axis=1),
        )
        own = tuple(images.upload(_both_sides(column)) for column in columns)
        facing = np.zeros((2 * len(points), 4), np.float32)
        facing[0::2, :3], facing[1::2, :3] = -normal, normal  # from in front, from behind
        nodes, facing = tree.upload(), images.upload(facing.reshape(-1, ROW, 4))
        clips = images.pool.take(*facing.size, "RGBA32F")
        passes.fullscreen(
            CLIPS, images.Target((clips,)), blocks={"film_view": frame.view_block},
            textures={
                **frame.hierarchy("diffuse").textures, "tree_nodes": nodes, "point_place": own[0],
                "point_facing": facing,
            },
            constants={"leaf_count": tree.leaves, "offset_size": frame.offset_size},
        )  # fmt: skip
        parted = _parted(images.read(clips))
        if parted.any():
            tree = tree.opened(parted)
            nodes = tree.upload()
        materials = frozenset(material[np.isfinite(position).all(axis=1)].astype(int).tolist())
        return Run(points, tree, nodes, own, facing, clips, materials, self._seen[points.triangle])

    def _shade(self, frame: Frame, technique: Technique, run: Run) -> None:
        def place(hits: Hits, records: Records) -> frozenset[int]:
            hits.place(frame, technique, run.own, records)
            return run.materials

        run.shaded = self._lit.shade(frame, technique, run.facing, place, frame.materials.glossy)
        frame.count(technique, "points shaded", 2 * run.tree.leaves)

    def _unshade(self, run: Run) -> None:
        for image in run.shaded.colors if run.shaded else ():
            images.pool.give(image)
        run.shaded = None

    def _give(self) -> None:
        for run in self._runs.values():
            self._unshade(run)
            images.pool.give(run.clips)
        self._runs = {}

    def release(self) -> None:
        """Drop GPU resources."""
        self._give()
        self._lit.release()
        self._surfaces = self._seen = self._key = None
        self._moved = False


def _parted(clips: np.ndarray) -> np.ndarray:
    """(leaves,) whether something stands on the piece of a point, on either side."""
    lines = clips.reshape(-1, 4)[:, 1::2]
    return (lines < NOTHING_STANDS).any(axis=1).reshape(-1, 2).any(axis=1)


def _keys(frame: Frame) -> tuple[tuple, tuple]:
    """What points must be spread anew for if it differs, and what moves them."""
    instances, meshes, _ = frame.geometry.placed
    kinds = tuple((i.mesh, meshes[i.mesh].triangle_count, i.materials, i.visibility.diffuse) for i in instances)
    opacity = tuple(_opacity(material) for material in frame.measured_materials)
    exact = tuple((meshes[i.mesh].version, i.matrix.tobytes()) for i in instances)
    return (kinds, opacity, frame.opacity_maps.changes), (exact, tuple(frame.geometry.origin))


def _opacity(material: CompiledMaterial) -> float:
    return 0.0 if material.glass else material.opacity if material.transparent else 1.0


def _shading_normals(mesh, linear: np.ndarray, triangles: np.ndarray, share: np.ndarray) -> np.ndarray:
    """(N, 3) at places in triangles of a mesh, outwards in the world also where an object is mirrored."""
    a, b, c = linear.T
    turn = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
    turn = turn * (-1.0 if np.linalg.det(linear) < 0.0 else 1.0)
    normals = mesh.corner_normals[mesh.triangle_corners[triangles]].astype(np.float64) @ turn.T
    weights = np.concatenate([1.0 - share.sum(axis=1, keepdims=True), share], axis=1)
    blended = (weights[:, :, None] * normals).sum(axis=1)
    return blended / np.maximum(np.linalg.norm(blended, axis=1, keepdims=True), 1e-300)


def _both_sides(rows: np.ndarray) -> np.ndarray:
    """(2 n / ROW, ROW, 4): each row of (n, 4) twice."""
    return np.repeat(rows, 2, axis=0).astype(np.float32).reshape(-1, ROW, 4)
