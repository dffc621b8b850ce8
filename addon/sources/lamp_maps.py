"""What lamps' node trees make of their light, as maps of factors that shaders/light/lamp_map.glsl reads.

The light of a lamp is a product: its strength, a factor by direction, one by place on an area lamp, one by distance.
Each is measured by scene/lamp_trees.py while the others stand where the light is brightest; what does not vary has no
map. Directions lie in an octahedral map of all (points), or in one of equal areas around the lamp's axis (spots, suns,
areas). Distances run from 0.1 mm to 1000 km in equal steps of their logarithm; the map holds the factor over 1 + d^2,
which is smooth for every falloff.

Maps are divided by their means, which go into the strength of the lamp, by which lights are chosen.

| cost | |
|---|---|
| image | 16 bytes a texel: side^2 of each map, 256 for distances |
| look-up | 5 fetches, 4 for each map, in programs of scenes with such trees alone |

Without such a tree nothing is compiled, bound or allocated. Bias: a tree that mixes direction, place and distance in
other ways than by products is drawn as the product of each, and says so; so is detail below a texel.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..gfx import images
from ..gfx.struct import Block
from ..materials.attributes import CAMERA, INSTANCE
from ..materials.working_space import current
from ..scene.lamp_trees import (
    AREA,
    CONE,
    DISTANCES,
    NEAREST,
    OCTAHEDRAL,
    PATHS,
    PLACES,
    ROUND,
    STEP,
    SUN,
    Asked,
    LampTree,
)
from ..snapshot.scene import Light, Note, Snapshot

TEXELS = 9  # of a lamp's row; shaders/light/lamp_map.glsl
MOST_MAPS = 2047  # that fit into the flags of a light
EVEN = 2e-3  # relative difference below which a map says nothing
ALIKE = 0.03  # of the brightest value, by which a product may differ from what it stands for
PROBES = (1.0, 0.1, 10.0, 100.0, 0.01, 1000.0)  # m: where a tree that knows the distance may be bright
AREA_SIDE = 64  # of the directions of area lamps, which textures seldom follow


@dataclass(frozen=True)
class LampFactors:
    """What one lamp's tree makes of its light."""

    scale: np.ndarray  # (3,) factor of the lamp's strength
    head: np.ndarray | None = None  # (TEXELS, 4) without places of tiles; None: nothing varies
    directions: np.ndarray | None = None  # (side + 2, side + 2, 3)
    places: np.ndarray | None = None
    paths: np.ndarray | None = None  # (DISTANCES, 3)
    notes: tuple[Note, ...] = ()


class LampMaps:
    """Factors of all lamps with node trees; kept from picture to picture."""

    def __init__(self):
        self._trees: dict[str, tuple[object, LampTree]] = {}
        self._factors: dict[str, tuple[object, LampFactors]] = {}
        self._numbers: dict[str, int] = {}
        self.image: images.Image | None = None
        self.changes = 0  # how often something was measured

    def update(self, snapshot: Snapshot, origin: np.ndarray, materials) -> None:
        """Measure what differs. `materials`: the renderer's MaterialSet, which has the view and shared images."""
        lights = [light for light in snapshot.lights if light.graph is not None][:MOST_MAPS]
        trees, factors = {}, {}
        for light in lights:
            named = [
                snapshot.images[node.image] for node in light.graph.nodes.values() if node.image in snapshot.images
            ]
            key = light.graph, tuple((image.key, image.version) for image in named), current().name
            kept = self._trees.get(light.key)
            if kept is None or kept[0] != key:
                kept = key, LampTree(light, snapshot.images, materials.energy_table)
            trees[light.key] = kept
            reads = kept[1].compiled.reads
            around = (
                light.kind, light.radius, light.soft_falloff, light.angle, light.shape, light.size, light.spot_angle,
                light.random, light.pass_index, light.color, light.matrix.tobytes(),
                materials.view_key if CAMERA in reads else (), tuple(origin) if INSTANCE in reads else (),
            )  # fmt: skip
            known = self._factors.get(light.key)
            if known is None or known[0] != (id(kept[1]), around):
                self.changes += 1
                known = (id(kept[1]), around), measure(light, kept[1], origin, materials.scene_block)
            factors[light.key] = known
        fresh = {key: value[0] for key, value in factors.items()}
        moved = fresh != {key: value[0] for key, value in self._factors.items()}
        self._trees, self._factors = trees, factors
        if moved or (self.image is not None and self._origin != tuple(origin)):
            self._pack(lights, origin)
        self._origin = tuple(origin)

    def of(self, light: Light) -> tuple[np.ndarray, int]:
        """Factor of the lamp's strength, (3,), and the number of its map, -1 where nothing varies."""
        if light.key not in self._factors:
            return np.ones(3), -1
        return self._factors[light.key][1].scale, self._numbers.get(light.key, -1)

    def textured(self, light: Light) -> bool:
        """Whether places on the lamp shine differently."""
        return light.key in self._factors and self._factors[light.key][1].places is not None

    def varies_by_place_alone(self, light: Light) -> bool:
        """Whether the lamp as a whole, at its mean, lights what is diffuse as its places together do."""
        one = self._factors[light.key][1] if light.key in self._factors else LampFactors(np.ones(3))
        return one.directions is None and one.paths is None

    @property
    def notes(self) -> tuple[Note, ...]:
        """What of lamps is drawn otherwise than Cycles would."""
        found = [*(note for _, tree in self._trees.values() for note in tree.notes)]
        return (*found, *(note for _, one in self._factors.values() for note in one.notes))

    def release(self) -> None:
        self._trees, self._factors, self._numbers, self.image = {}, {}, {}, None

    def _pack(self, lights: list[Light], origin: np.ndarray) -> None:
        """One image of all maps: a row of TEXELS for each lamp, and the tiles above."""
        varied = [
            (light, self._factors[light.key][1]) for light in lights if self._factors[light.key][1].head is not None
        ]
        self._numbers = {light.key: number for number, (light, _) in enumerate(varied)}
        if not varied:
            self.image = None
            return
        tiles = []  # lamp, texel of its row, pixels
        for number, (_, one) in enumerate(varied):
            tiles += [(number, 3, one.directions)] if one.directions is not None else []
            tiles += [(number, 4, one.places)] if one.places is not None else []
            tiles += [(number, 5, one.paths[None])] if one.paths is not None else []
        tiles.sort(key=lambda tile: -tile[2].shape[0])
        width = max(DISTANCES, *(tile[2].shape[1] for tile in tiles))
        width = max(width, min(4096, int(np.sqrt(sum(tile[2].shape[0] * tile[2].shape[1] for tile in tiles)) * 1.2)))
        heads = np.stack([one.head for _, one in varied])
        x, y, shelf = 0, len(varied), 0
        places = []
        for _, _, pixels in tiles:
            if x + pixels.shape[1] > width:
                x, y, shelf = 0, y + shelf, 0
            places.append((x, y))
            x, shelf = x + pixels.shape[1], max(shelf, pixels.shape[0])
        atlas = np.zeros((y + shelf, width, 4), np.float32)
        for (number, texel, pixels), (x, y) in zip(tiles, places):
            atlas[y : y + pixels.shape[0], x : x + pixels.shape[1], :3] = np.clip(pixels, -3e37, 3e37)
            heads[number, texel, :2] = x, y
        for number, (light, _) in enumerate(varied):
            heads[number, 8, :3] = light.matrix[:3, 3] - origin
        atlas[: len(varied), :TEXELS] = heads
        self.image = images.upload(atlas)


def measure(light: Light, tree: LampTree, origin: np.ndarray, scene: Block) -> LampFactors:
    """The factors of one lamp. Waits for the GPU."""
    matrix = light.matrix
    axes = np.stack([_unit(matrix[:3, k]) for k in range(3)], axis=1)
    kind = {"SUN": SUN, "AREA": AREA}.get(light.kind, ROUND)
    ball = kind == ROUND and light.radius > 0 and not light.soft_falloff
    angle = {"SUN": light.angle, "AREA": np.pi, "SPOT": light.spot_angle}.get(light.kind, 2 * np.pi)
    half = max(min(angle, np.pi) / 2, 1e-6)
    even = np.ptp(np.linalg.norm(matrix[:3, :3], axis=0)) < 1e-3 * np.linalg.norm(matrix[:3, :3])
    what = OCTAHEDRAL if light.kind == "POINT" or (light.kind == "SPOT" and not even) else CONE
    edge = 2 * np.sin(min(half * 1.02, np.pi) / 2)
    cotangent = (0.5 if light.kind == "SPOT" else 1.0) / np.tan(half)
    half_u, half_v = (matrix[:3, k] * light.size[k] / 2 for k in (0, 1))
    lamp = {
        "kind": kind, "rows": np.column_stack([matrix[:3, :3], matrix[:3, 3] - origin]),
        "axis_x": (*axes[:, 0], light.radius if ball else 0.0),
        "axis_y": (*axes[:, 1], cotangent if light.kind in ("SPOT", "SUN") else 0.0), "axis_z": (*axes[:, 2], 0.0),
        "half_u": (*half_u, light.random), "half_v": (*half_v, light.pass_index), "color": light.color,
    }  # fmt: skip

    def bake(asked: int, side: int, at: Asked) -> np.ndarray:
        return tree.bake(asked, side, at, lamp, edge, scene)

    side = AREA_SIDE if kind == AREA else 16 if kind == SUN else tree.side
    along = [Asked(path=path) for path in (PROBES if tree.reads_path and kind != SUN else (1.0,))]
    if kind == SUN:
        along = [Asked(path=3.4e38)]
    first = max(((np.abs(bake(what, 16, at)).max() / (1 + at.path**2), -k) for k, at in enumerate(along)))
    at = along[-first[1]]
    directions = bake(what, side, at)
    brightest = _brightest(np.abs(directions).sum(axis=2))
    notes = []
    places = None
    if kind == AREA:
        at = replace(at, direction=_direction(what, brightest, side, edge))
        places = bake(PLACES, tree.side, at)
        if not np.any(places):
            at = replace(at, direction=np.array([0.0, 0.0, -1.0]))
            places = bake(PLACES, tree.side, at)
        row, column = _brightest(np.abs(places).sum(axis=2))
        at = replace(at, place=((column - 0.5) / tree.side, (row - 0.5) / tree.side))
        directions = bake(what, side, at)
    means, maps = [], []
    for one in (directions, places):
        mean, found = _relative(one)
        means.append(mean)
        maps.append(found)
    scale = means[0]
    if places is not None:
        reference = directions[_texel(what, at.direction, side, edge)]
        scale = np.divide(means[0] * means[1], reference, out=np.zeros(3), where=reference != 0)
    paths = None
    if tree.reads_path and kind != SUN:
        paths = np.ones((DISTANCES, 3))
        distance = NEAREST * np.exp(STEP * np.arange(DISTANCES))
        for channel in range(3):
            where = _brightest(np.abs(directions[..., channel]))
            value = directions[where][channel]
            if value:
                asked = replace(at, direction=_direction(what, where, side, edge))
                paths[:, channel] = bake(PATHS, 0, asked)[:, channel] / value
        paths /= (1 + distance**2)[:, None]
        other = replace(at, path=3 * at.path)
        near = np.log(other.path / NEAREST) / STEP
        factor = [np.interp(near, np.arange(DISTANCES), paths[:, c]) * (1 + other.path**2) for c in range(3)]
        elsewhere = bake(what, side, other)
        if np.abs(elsewhere - directions * factor).max() > ALIKE * max(np.abs(elsewhere).max(), 1e-30):
            text = "its node tree mixes direction and distance; each is drawn as a factor of its own."
            notes.append(Note(f"Light '{light.name}'", text))
        if np.ptp(paths * (1 + distance**2)[:, None], axis=0).max() < EVEN:
            paths = None
    if maps[0] is None and maps[1] is None and paths is None:
        return LampFactors(scale, notes=tuple(notes))
    head = np.zeros((TEXELS, 4))
    head[:3, :3] = axes.T
    if maps[0] is not None:
        head[0, 3], head[1, 3], head[3, 2] = what, 1 / edge, side
        head[2, 3] = float(ball)
    if maps[1] is not None:
        head[4, 2:] = tree.side, 1.0
        head[6, :3], head[7, :3] = (half / max(half @ half, 1e-30) for half in (half_u, half_v))
    if paths is not None:
        head[5, 2:] = DISTANCES, np.log(NEAREST)
        head[6, 3] = 1 / STEP
    return LampFactors(scale, head, maps[0], maps[1], paths, tuple(notes))


def _brightest(values: np.ndarray) -> tuple[int, int]:
    """Row and column of the largest value of a map, (side + 2, side + 2), within its border."""
    row, column = np.unravel_index(values[1:-1, 1:-1].argmax(), (len(values) - 2,) * 2)
    return int(row) + 1, int(column) + 1


def _relative(values: np.ndarray | None) -> tuple[np.ndarray, np.ndarray | None]:
    """The mean of a map by channel, and the map divided by it; none where it is even."""
    if values is None:
        return np.ones(3), None
    inner = values[1:-1, 1:-1].reshape(-1, 3)
    if (np.ptp(inner, axis=0) <= EVEN * np.abs(inner).max(axis=0)).all():
        return inner.mean(axis=0), None
    mean = np.abs(inner).mean(axis=0)
    return mean, np.divide(values, mean, out=np.zeros_like(values), where=mean > 0)


def _direction(what: int, texel: tuple[int, int], side: int, edge: float) -> np.ndarray:
    """(3,) in the lamp's axes, of a texel (row, column) of a map of directions; as shaders/lamp/bake.frag.glsl."""
    row, column = (int(np.clip(k, 1, side)) for k in texel)
    p = 2 * (np.array([column, row]) - 0.5) / side - 1
    if what == CONE:
        p = p * edge
        squared = min(p @ p, 4.0)
        return np.array([*(p * np.sqrt(max(1 - squared / 4, 0.0))), squared / 2 - 1])
    d = np.array([*p, 1 - np.abs(p).sum()])
    if d[2] < 0:
        d[:2] = (1 - np.abs(d[1::-1])) * np.where(d[:2] >= 0, 1, -1)
    return d / np.linalg.norm(d)


def _texel(what: int, direction: np.ndarray, side: int, edge: float) -> tuple[int, int]:
    """The texel (row, column) of a map of directions in which one lies; of cones alone."""
    p = direction[:2] / np.sqrt(max(0.5 - 0.5 * direction[2], 1e-12)) / edge
    column, row = np.clip(((0.5 + 0.5 * p) * side).astype(int) + 1, 1, side)
    return int(row), int(column)


def _unit(v: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(v)
    return v / length if length > 0 else v
