"""Surfels: all surfaces as discs of about equal area, and a tree of them. For light that is exchanged between surfaces.

Each mesh is covered by an even cloud of points in proportion to area, CLOUD for each surfel wanted. Farthest point
sampling picks centres out of it (distance in place and, so that thin sheets keep both faces, in normal); a cell is what
is nearest to a centre, its surfel stands at the point nearest to the cell's middle, and its disc covers all points of
the cell; where the mesh ends, or bends sharply, it ends too. So discs leave no holes wider than a seventh of a cell,
whatever the tessellation: a mesh of two triangles has as many surfels as one of a million with the same area. A disc
that reaches beyond its thing all the same (leaves, folds, legs) is met by the share of it that is surface: `filled`.

Meshes are sampled in their own space after stretching (M = rotation * stretch): what moves rigidly keeps its surfels,
instances share them, and the result does not depend on what was there before. Objects that would have fewer than FEWEST
surfels are sampled together. Area farther than `reach` from `eye` counts by (reach / distance)^4, as in
surface_points.py but steeper, so that a kilometre of ground does not take all. Triangles of which neither side sees
another surface (seen.py), such as outer faces of walls, count as UNSEEN of their area; where one side of a sheet sees
nothing, the other alone gathers light.

The tree is binary and lies depth first: a node's first child follows it, `skip` is where to go on beside it. Nodes of
up to PURE leaves are split by normal first, so that most small nodes are flat and may stand for their leaves.

| cost | |
|---|---|
| CPU, once for a mesh | about 100 us a surfel, half of it for how much of its disc is surface |
| CPU, when something moves | about 10 us a surfel: tree and upload |
| bytes | 80 a node, two nodes a surfel; 32 for each side that light reaches; 256 for points in a surfel's cell |

Sources: Dong, Kautz, Theobalt and Seidel 2007 (surfels and their hierarchy at vertices; here apart from the
tessellation, which the thesis names as future work); Eldar et al. 1997 (farthest point sampling)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..gfx import images
from ..sampling.sequence import bits
from .pieces import farthest, halved, octahedral
from .seen import UNSEEN, seen_sides
from .traced_triangles import coverage, world_triangles

MEMBERS = 8  # points of its cell at which a surfel is lit, in turn
CLOUD = 16  # points of the cloud for each surfel
BLOCK = 96  # surfels that are picked together
TURN = 2.0  # cell sizes by which two opposite faces count as apart: no cell goes round an edge
FEWEST = 6  # surfels of an object that is sampled by itself
MARGIN = 0.6  # spacings of the cloud that a disc reaches beyond the points of its cell
MOST_LEAVES = 64  # of a node that may stand for them
PURE = 32  # leaves of nodes from which on splits go by normal
FLAT, COHERENT = 0.35, 0.9  # thickness / radius, and length of the mean normal, of a node that may stand for its leaves
ROW = 256  # receivers in a row of the images of their light
NODE_TEXELS, RECEIVER_TEXELS = 5, 2
CLIPS = 2  # edges at which a disc ends
CREASE = 0.5  # cosine between the triangles at an edge, below which surfaces end there
MOST_EDGES, MOST_TRIANGLES = 4000, 30_000  # of a mesh whose discs end at its edges
FULL, BELOW = 0.75, 0.5  # share of a disc from which on it counts as filled; radii that surface may lie off its plane
ON_DISC = 48
NONE = 1e30
MOST_PIECES, ROUNDS = 100_000, 64  # of triangles that are halved, and how often


@dataclass(frozen=True)
class Cells:
    """Surfels of some surface: places (N, 3), unit normals (N, 3), radii (N,), areas (N,) m2, opacities (N,), MEMBERS
    places in the cell of each and normals there (N, MEMBERS, 3), CLIPS edges (N, CLIPS, 4) as unit direction and
    distance at which its disc ends, whether only the front is seen (N,) bool, and whether that is so since the back
    of a sheet sees nothing (N,) bool."""

    place: np.ndarray
    normal: np.ndarray
    radius: np.ndarray
    area: np.ndarray
    opacity: np.ndarray
    clips: np.ndarray
    members: np.ndarray
    member_normals: np.ndarray
    closed: np.ndarray
    sheet: np.ndarray

    def __len__(self) -> int:
        return len(self.place)

    def take(self, order: np.ndarray) -> Cells:
        return Cells(*(values[order] for values in vars(self).values()))

    @classmethod
    def joined(cls, parts: list[Cells]) -> Cells:
        parts = parts or [NOTHING]
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in vars(parts[0])))


NOTHING = Cells(
    np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0), np.zeros(0), np.zeros((0, CLIPS, 4)),
    np.zeros((0, MEMBERS, 3)),
    np.zeros((0, MEMBERS, 3)), np.zeros(0, bool), np.zeros(0, bool),
)  # fmt: skip


class Surfels:
    """The surfels of a renderer's scene. One for each renderer: `frame.kept(Surfels)`.

    Images are lists (shaders/implicit_visibility/surfels.glsl): `nodes`, `leaves` and `receivers`, the sides of surfels
    that light reaches. Sides of one surfel are two receivers.
    """

    def __init__(self):
        self._key: object = None
        self._known: dict[object, Cells] = {}
        self.cells: Cells = NOTHING  # in the order of the tree's leaves
        self.nodes: images.Image | None = None
        self.leaves: images.Image | None = None
        self.receivers: images.Image | None = None
        self.members: images.Image | None = None
        self.node_count = self.receiver_count = 0
        self.changes = 0

    def update(self, frame, budget: int, distance: float) -> bool:
        """About `budget` receivers, made anew where surfaces moved or `distance`, m, of what is seen differs much; True
        if so."""
        snapshot, materials, origin = frame.snapshot, frame.measured_materials, frame.geometry.origin
        reach, eye = _reach(frame, distance)
        shown = [i for i in snapshot.instances if i.visibility.diffuse and snapshot.meshes[i.mesh].triangle_count]
        key = (
            budget, reach, tuple(eye), tuple(origin),
            tuple((i.mesh, snapshot.meshes[i.mesh].version, i.matrix.tobytes(), i.materials) for i in shown),
            tuple((m.opacity if m.transparent else 1.0) for m in materials), frame.opacity_maps.changes,
        )  # fmt: skip
        if key == self._key:
            return False
        self._key = key
        shown = [one for one in shown if np.isfinite(one.matrix).all()]
        seen = seen_sides(frame)
        surfaces = [part for one in shown for part in _Surface.of(frame, one, materials).parted(seen.get(id(one)))]
        self._upload(self._sample(surfaces, budget, reach, eye))
        self.changes += 1
        return True

    def _sample(self, surfaces: list[_Surface], budget: int, reach: float, eye: np.ndarray) -> Cells:
        weights = np.array([one.weight(reach, eye) for one in surfaces])
        sides = np.array([1.0 if one.closed else 2.0 for one in surfaces])
        total = float((weights * sides).sum())
        if not total > 0.0 or not np.isfinite(total):
            return NOTHING
        wished = _rounded(weights / total * budget)
        known, parts, few = {}, [], []
        for one, weight, count in zip(surfaces, weights, wished):
            if not weight > 0.0:
                continue
            if count < FEWEST:
                few.append(one)
                continue
            parts.append(self._own(one, int(count), reach, eye, known))
        if few:
            rest = sum(one.weight(reach, eye) for one in few) / total * budget
            parts.append(_together(few, max(int(np.ceil(rest)), FEWEST), reach, eye))
        self._known = known
        return Cells.joined([part for part in parts if len(part)])

    def _own(self, one: _Surface, count: int, reach: float, eye: np.ndarray, known: dict) -> Cells:
        if one.far(reach, eye):
            cells = sampled(*one.world(), count, one.closed, reach, eye)
            return replace(cells, sheet=np.full(len(cells), one.sheet))
        key = (*one.key, count)
        cells = known.get(key) or self._known.get(key)
        if cells is None:
            cells = sampled(one.corners, one.opacity, count, one.closed)
        known[key] = cells
        clips = cells.clips.copy()
        clips[..., :3] = clips[..., :3] @ one.turn.T
        return Cells(
            cells.place @ one.turn.T + one.moved, cells.normal @ one.turn.T, cells.radius, cells.area, cells.opacity,
            clips, cells.members @ one.turn.T + one.moved, cells.member_normals @ one.turn.T, cells.closed,
            np.full(len(cells), one.sheet),
        )  # fmt: skip

    def _upload(self, cells: Cells) -> None:
        cells, nodes = tree(cells)
        self.cells, self.node_count = cells, len(nodes)
        count = len(cells)
        back = np.where(cells.closed, np.where(cells.sheet, -2, -1), count + np.cumsum(~cells.closed) - 1)
        leaves = np.zeros((count, 4))
        leaves[:, 0], leaves[:, 1], leaves[:, 2], leaves[:, 3] = cells.area, np.arange(count), back, cells.radius
        other = np.flatnonzero(~cells.closed)
        receivers = np.zeros((count + len(other), RECEIVER_TEXELS, 4))
        leaf = np.concatenate([np.arange(count), other])
        side = np.concatenate([np.ones(count), -np.ones(len(other))])[:, None]
        receivers[:, 0, :3], receivers[:, 0, 3] = cells.place[leaf], cells.radius[leaf]
        receivers[:, 1, :3], receivers[:, 1, 3] = cells.normal[leaf] * side, leaf
        self.receiver_count = len(receivers)
        self.nodes = images.upload_list(nodes.reshape(-1, 4).astype(np.float32))
        self.leaves = images.upload_list(leaves.astype(np.float32))
        members = np.zeros((count, MEMBERS, 2, 4), np.float32)
        members[:, :, 0, :3], members[:, :, 1, :3] = cells.members, cells.member_normals
        self.members = images.upload_list(members.reshape(-1, 4))
        self.receivers = images.upload_list(receivers.reshape(-1, 4).astype(np.float32))

    def release(self) -> None:
        self.__init__()


@dataclass(frozen=True)
class _Surface:
    """An instance's triangles in its own space after stretching, (T, 3, 3), their opacities (T,), and how it stands."""

    key: tuple
    corners: np.ndarray
    opacity: np.ndarray
    closed: bool
    turn: np.ndarray
    moved: np.ndarray
    sheet: bool = False
    share: float = 1.0  # of its area that counts

    @classmethod
    def of(cls, frame, instance, materials) -> _Surface:
        snapshot, maps = frame.snapshot, frame.opacity_maps
        mesh, linear = snapshot.meshes[instance.mesh], instance.matrix[:3, :3].astype(np.float64)
        left, scales, right = np.linalg.svd(linear)
        stretch = right.T @ np.diag(scales) @ right
        unit = max(float(scales.max()), 1e-30)
        stretch = np.round(stretch / unit, 5) * float(f"{unit:.5e}")  # of a rigid motion the same but for rounding
        turn = left @ right
        known = (instance,), snapshot.meshes, materials, frame.geometry.origin, "diffuse", maps, frame.emission_maps
        look = world_triangles(list(known[0]), *known[1:])[1]
        corners = mesh.positions[mesh.corner_vertices[mesh.triangle_corners]].astype(np.float64) @ stretch.T
        opacity = coverage(look[:, 0], maps) if len(look) == len(corners) else np.zeros(len(corners))
        closed = frame.geometry.is_closed(mesh)
        if np.linalg.det(linear) < 0.0:  # a mirrored mesh winds the other way, and so do its normals when turned
            corners = corners[:, ::-1]
        key = (instance.mesh, mesh.version, instance.materials, stretch.tobytes(), np.linalg.det(linear) < 0.0)
        key = (*key, opacity.astype(np.float32).tobytes() if opacity.min(initial=1.0) < 1.0 else b"")
        return cls(key, corners, opacity, closed, turn, instance.matrix[:3, 3] - frame.geometry.origin)

    def parted(self, seen: np.ndarray | None) -> Iterator[_Surface]:
        """Triangles by what their sides see, (T, 2) for front and back."""
        if seen is None or len(seen) != len(self.corners):
            yield self
            return
        front, back = seen.T
        if self.closed:
            kinds = (front, False, True, False, 1.0), (~front, False, True, False, UNSEEN)
        else:
            kinds = (
                (front & back, False, False, False, 1.0), (front & ~back, False, True, True, 1.0),
                (~front & back, True, True, True, 1.0), (~front & ~back, False, False, False, UNSEEN),
            )  # fmt: skip
        for number, (own, turned, closed, sheet, share) in enumerate(kinds):
            if own.any():
                corners = self.corners[own][:, ::-1] if turned else self.corners[own]
                key = self.key if own.all() else (*self.key, own.tobytes())
                yield replace(
                    self, key=(*key, number), corners=corners, opacity=self.opacity[own], closed=closed, sheet=sheet,
                    share=share,
                )  # fmt: skip

    def world(self) -> tuple[np.ndarray, np.ndarray]:
        return self.corners @ self.turn.T + self.moved, self.opacity

    def far(self, reach: float, eye: np.ndarray) -> bool:
        """Whether parts of it are farther than `reach`."""
        if not np.isfinite(reach):
            return False
        corners = self.world()[0].reshape(-1, 3)
        return bool(np.linalg.norm(corners - eye, axis=1).max(initial=0.0) > reach)

    def weight(self, reach: float, eye: np.ndarray) -> float:
        corners = self.corners if not self.far(reach, eye) else self.world()[0]
        areas = _areas(corners)[0]
        if self.far(reach, eye):
            pieces, _ = halved(corners, eye, reach, ROUNDS, MOST_PIECES)
            areas = _areas(pieces)[0] * _share(pieces, reach, eye)
        return self.share * float(areas.sum())


def _reach(frame, distance: float) -> tuple[float, np.ndarray]:
    """Beyond what distance from which place area counts less; of scenes no larger than what is seen, nowhere."""
    reach = float(np.exp2(np.ceil(np.log2(1.5 * max(distance, 1e-30)))))
    if not frame.geometry.size > 8.0 * reach:
        return np.inf, np.zeros(3)
    eye = frame.snapshot.camera.matrix[:3, 3] - frame.geometry.origin
    return reach, np.round(eye / reach) * reach if np.isfinite(eye).all() else np.zeros(3)


def _rounded(counts: np.ndarray) -> np.ndarray:
    """Counts in steps of a tenth, so that those of others stay as they are where one object's area changes a little."""
    logs = np.round(np.log(np.maximum(counts, 1e-9)) / 0.1) * 0.1
    return np.round(np.exp(logs))


def _areas(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Areas of triangles, 0 where they are not finite, and unit normals."""
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    double = np.linalg.norm(across, axis=1)
    finite = np.isfinite(double)
    return np.where(finite, double / 2, 0.0), np.where(
        finite[:, None], across / np.maximum(double, 1e-300)[:, None], 0.0
    )


def _share(pieces: np.ndarray, reach: float, eye: np.ndarray) -> np.ndarray:
    return (reach / np.maximum(np.linalg.norm(pieces.mean(axis=1) - eye, axis=1), reach)) ** 4


def _together(surfaces: list[_Surface], count: int, reach: float, eye: np.ndarray) -> Cells:
    """Small objects sampled as one; some of them may have no surfel."""
    parts = []
    for closed, sheet in ((True, False), (True, True), (False, False)):
        some = [one.world() for one in surfaces if one.closed is closed and one.sheet is sheet]
        if some:
            number = max(round(count * len(some) / len(surfaces)), 1)
            corners, opacity = (np.concatenate(values) for values in zip(*some))
            cells = sampled(corners, opacity, number, closed, reach, eye)
            parts.append(replace(cells, sheet=np.full(len(cells), sheet)))
    return Cells.joined([part for part in parts if len(part)])


def sampled(
    corners: np.ndarray, opacity: np.ndarray, count: int, closed: bool, reach: float = np.inf, eye=None
) -> Cells:
    """`count` surfels of triangles (T, 3, 3), by area or, beyond `reach`, by how large it looks from `eye`."""
    edges_of_mesh = borders(corners)
    triangle = np.arange(len(corners))
    if np.isfinite(reach):
        corners, triangle = halved(corners, eye, reach, ROUNDS, MOST_PIECES)
    areas, normals = _areas(corners)
    share = _share(corners, reach, eye) if np.isfinite(reach) else np.ones(len(corners))
    edges = np.concatenate([[0.0], np.cumsum(areas * share)])
    if not edges[-1] > 0.0 or count < 1:
        return NOTHING
    number = count * CLOUD
    u, v, w = (bits(np.arange(number), dimension) / 2.0**32 for dimension in range(3))
    chosen = np.clip(np.searchsorted(edges, u * edges[-1], side="right") - 1, 0, len(areas) - 1)
    root, w = np.sqrt(v)[:, None], w[:, None]
    a, b, c = corners[chosen].transpose(1, 0, 2)
    place, normal = (1 - root) * a + root * (1 - w) * b + root * w * c, normals[chosen]
    area = edges[-1] / number / share[chosen]  # that each point of the cloud stands for
    size = np.sqrt(area * CLOUD)[:, None]
    parts = [
        _cells(block, place, normal, area, opacity[triangle[chosen]], TURN / 2 * size * normal)
        for block in _blocks(place, number)
    ]
    *out, members, turned = (np.concatenate(values) for values in zip(*parts))
    clips = _clips(*out[:3], *edges_of_mesh)
    out[4] = out[4] * filled(*out[:3], clips, place, normal, area)
    kinds = np.full(len(members), closed), np.zeros(len(members), bool)
    return Cells(*out, clips, members, turned, *kinds)


def filled(place, normal, radius, clips, cloud, cloud_normal, cloud_area) -> np.ndarray:
    """The share of each disc that has surface below it, (N,): the cloud's area within it beside the disc's own, up to
    where clips (N, CLIPS, 4) end it. 1 where that is more than FULL, as on all that is wide and smooth."""
    cell = max(float(radius.max(initial=0.0)), 1e-30)
    low = np.minimum(cloud.min(axis=0), place.min(axis=0)) - cell
    size = np.ceil((np.maximum(cloud.max(axis=0), place.max(axis=0)) - low) / cell).astype(np.int64) + 2
    strides = np.array([size[1] * size[2], size[2], 1])
    number = lambda points: np.floor((points - low) / cell).astype(np.int64) @ strides  # noqa: E731
    keys = number(cloud)
    order = np.argsort(keys, kind="stable")
    keys = keys[order]
    steps = np.stack(np.meshgrid(*[np.arange(-1, 2)] * 3, indexing="ij"), axis=-1).reshape(-1, 3) @ strides
    found = np.zeros(len(place))
    for start in range(0, len(place), 1024):
        some = slice(start, start + 1024)
        wanted = (number(place[some])[:, None] + steps).reshape(-1)
        first, last = np.searchsorted(keys, wanted, "left"), np.searchsorted(keys, wanted, "right")
        count = last - first
        disc = np.repeat(np.repeat(np.arange(len(place))[some], len(steps)), count)
        entry = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count) + np.repeat(first, count)
        point = order[entry]
        off = cloud[point] - place[disc]
        height = (off * normal[disc]).sum(axis=1)
        cosine = (cloud_normal[point] * normal[disc]).sum(axis=1)
        flat = (off * off).sum(axis=1) - height * height
        kept = (flat < radius[disc] ** 2) & (np.abs(height) < BELOW * radius[disc]) & (cosine > 0.0)
        for k in range(CLIPS):
            kept &= (off * clips[disc, k, :3]).sum(axis=1) <= clips[disc, k, 3]
        found += np.bincount(disc[kept], (cloud_area[point] * cosine)[kept], minlength=len(place))
    share = found / (np.pi * radius**2 * _left(normal, radius, clips))
    return np.where(share > FULL, 1.0, share)


def _left(normal, radius, clips) -> np.ndarray:
    """The share of each disc that its clips leave, (N,), by points on it."""
    turn, far = 2.399963 * np.arange(ON_DISC), np.sqrt((np.arange(ON_DISC) + 0.5) / ON_DISC)
    first = np.cross(normal, np.where(np.abs(normal[:, :1]) < 0.5, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]]))
    first /= np.maximum(np.linalg.norm(first, axis=1), 1e-30)[:, None]
    second = np.cross(normal, first)
    u, v = far * np.cos(turn), far * np.sin(turn)
    off = (first[:, None] * u[:, None] + second[:, None] * v[:, None]) * radius[:, None, None]
    inside = np.ones(off.shape[:2], bool)
    for k in range(CLIPS):
        inside &= (off * clips[:, None, k, :3]).sum(axis=2) <= clips[:, None, k, 3]
    return np.maximum(inside.mean(axis=1), 1.0 / ON_DISC)


def borders(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where surfaces end, at open edges and sharp ones: ends (E, 2, 3), unit directions outwards in the triangle's
    plane and the triangle's normals (E, 3). None of a mesh of more than MOST_TRIANGLES or MOST_EDGES such edges."""
    nothing = np.zeros((0, 2, 3)), np.zeros((0, 3)), np.zeros((0, 3))
    if not 0 < len(corners) <= MOST_TRIANGLES:
        return nothing
    normal = _areas(corners)[1]
    number = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)[1].reshape(-1, 3)
    first, second = number.reshape(-1), np.roll(number, -1, axis=1).reshape(-1)
    key = np.minimum(first, second) * (number.max() + 1) + np.maximum(first, second)
    _, edge, times = np.unique(key, return_inverse=True, return_counts=True)
    edge = edge.reshape(-1)
    sums = np.stack([np.bincount(edge, np.repeat(normal[:, k], 3)) for k in range(3)], axis=1)
    # Of two unit vectors with cosine c the sum has the squared length 2 + 2 c; of what winds the other way 2 - 2 c.
    bend = np.abs((sums * sums).sum(axis=1) / 2 - 1)
    sharp = (times != 2) | (bend < CREASE)
    chosen = np.flatnonzero(sharp[edge])
    if len(chosen) > MOST_EDGES:
        return nothing
    ends = np.stack([corners.reshape(-1, 3), np.roll(corners, -1, axis=1).reshape(-1, 3)], axis=1)[chosen]
    normal = np.repeat(normal, 3, axis=0)[chosen]
    outwards = np.cross(ends[:, 1] - ends[:, 0], normal)
    length = np.linalg.norm(outwards, axis=1)
    good = length > 0.0
    return ends[good], outwards[good] / length[good, None], normal[good]


def _clips(place, normal, radius, ends, outwards, normals) -> np.ndarray:
    """The nearest edges within the disc of each surfel, (N, CLIPS, 4)."""
    clips = np.full((len(place), CLIPS, 4), NONE)
    clips[..., :3] = 0.0
    if not len(ends):
        return clips
    along = ends[:, 1] - ends[:, 0]
    for first in range(0, len(place), 256):
        some = slice(first, first + 256)
        off = place[some, None] - ends[None, :, 0]
        share = (off * along).sum(axis=2) / np.maximum((along * along).sum(axis=1), 1e-300)
        away = -(off * outwards).sum(axis=2)  # of the edge's line from the surfel
        beside = np.abs((off * normals).sum(axis=2))
        own = np.abs(normal[some] @ normals.T) > 0.9
        limit = radius[some, None]
        near = own & (share > -1e-3) & (share < 1.001) & (away >= 0.0) & (away < limit) & (beside < 0.2 * limit)
        distance = np.where(near, away, np.inf)
        _nearest_two(clips[some], distance, outwards[None].repeat(len(distance), axis=0))
    return clips


def _nearest_two(clips: np.ndarray, distance: np.ndarray, direction: np.ndarray) -> None:
    """Fill in (N, CLIPS, 4) from candidates (N, K) that run in different directions (N, K, 3)."""
    rows = np.arange(len(distance))
    for k in range(CLIPS):
        chosen = distance.argmin(axis=1)
        found = np.isfinite(distance[rows, chosen])
        clips[found, k, :3] = direction[rows, chosen][found]
        clips[found, k, 3] = distance[rows, chosen][found]
        alike = np.einsum("nki,ni->nk", direction, direction[rows, chosen]) > 0.9
        distance = np.where(alike, np.inf, distance)


def _blocks(place: np.ndarray, number: int) -> list[np.ndarray]:
    """Numbers of points in boxes of up to BLOCK surfels, each split in the middle of its longest side."""
    done, open_ = [], [np.arange(number)]
    while open_:
        block = open_.pop()
        if len(block) <= BLOCK * CLOUD:
            done.append(block)
            continue
        axis = np.ptp(place[block], axis=0).argmax()
        order = block[np.argsort(place[block, axis], kind="stable")]
        half = len(order) // 2 // CLOUD * CLOUD
        open_ += [order[:half], order[half:]]
    return done


def _cells(block, place, normal, area, opacity, turned) -> tuple[np.ndarray, ...]:
    """Places, normals, radii, areas, opacities and members of the surfels of a block of the cloud."""
    count = max(len(block) // CLOUD, 1)
    place, normal, area, opacity = place[block], normal[block], area[block], opacity[block]
    keys = np.concatenate([place, turned[block]], axis=1)
    _, owner = farthest(keys - keys.mean(axis=0), count)
    owner = np.unique(owner, return_inverse=True)[1].reshape(-1)
    count = int(owner.max()) + 1
    members = np.maximum(np.bincount(owner, minlength=count), 1)
    middle = np.stack([np.bincount(owner, place[:, k], minlength=count) for k in range(3)], axis=1) / members[:, None]
    off = np.linalg.norm(place - middle[owner], axis=1)
    order = np.lexsort((off, owner))
    first = np.concatenate([[0], np.cumsum(np.bincount(owner, minlength=count))[:-1]])
    stands = order[np.minimum(first, len(order) - 1)]  # the member nearest to the cell's middle
    radius = np.zeros(count)
    np.maximum.at(radius, owner, np.linalg.norm(place - place[stands][owner], axis=1))
    # The middle, then others evenly out of the cell.
    spread = first[:, None] + (bits(np.arange(MEMBERS), 0) * members[:, None] // 2**32).astype(np.int64)
    some = order[np.minimum(spread, len(order) - 1)]
    sums = np.bincount(owner, area, minlength=count)
    radius = np.maximum(radius + MARGIN * np.sqrt(sums / members), np.sqrt(sums / np.pi))
    cover = np.bincount(owner, opacity * area, minlength=count) / np.maximum(sums, 1e-300)
    return place[stands], normal[stands], radius, sums, cover, place[some], normal[some]


def tree(cells: Cells) -> tuple[Cells, np.ndarray]:
    """The surfels in the order of a tree's leaves, and its nodes (M, NODE_TEXELS, 4), depth first:

    - middle, radius of a ball that holds the discs of all its leaves
    - mean normal (octahedral), how far its discs lie off the plane through its middle, negative where no disc may stand
      for it; node to go on with
    - first leaf, number of leaves, 0 for both sides or 1 where only fronts are seen, 2 of sheets, opacity
    - two edges at which the disc ends: direction in its plane, distance from its middle
    """
    count = len(cells)
    if not count:
        return cells, np.zeros((0, NODE_TEXELS, 4))
    # In an order of their own, whatever order objects came in.
    cells = cells.take(np.lexsort((*cells.normal.T, *cells.place.T)))
    depth = int(np.ceil(np.log2(count)))
    order = np.arange(count)
    for level in range(depth):
        start = _starts(count, level)
        order = order[_halves(cells, order, start, count)]
    cells = cells.take(order)
    spans = [_spans(count, level) for level in range(depth + 1)]
    # Nodes of each level that hold something and are not alike their only child.
    kept = [(first, last) if level == depth else _split(first, last) for level, (first, last) in enumerate(spans)]
    first = np.concatenate([one[0] for one in kept])
    last = np.concatenate([one[1] for one in kept])
    # Depth first: by first leaf, larger nodes before those that they hold.
    order = np.lexsort((-last, first))
    first, last = first[order], last[order]
    skip = np.searchsorted(first, last, side="left")
    return cells, _describe(cells, first, last, np.where(last - first == 1, np.arange(len(first)) + 1, skip))


def _starts(count: int, level: int) -> np.ndarray:
    return np.arange((1 << level) + 1) * count >> level


def _spans(count: int, level: int) -> tuple[np.ndarray, np.ndarray]:
    edges = _starts(count, level)
    held = edges[1:] > edges[:-1]
    return edges[:-1][held], edges[1:][held]


def _split(first: np.ndarray, last: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    inner = last - first > 1
    return first[inner], last[inner]


def _halves(cells: Cells, order: np.ndarray, edges: np.ndarray, count: int) -> np.ndarray:
    """Order of the leaves within each node by the axis of its split, so that its halves are its children."""
    held = edges[1:] > edges[:-1]
    first, last = edges[:-1][held], edges[1:][held]
    place, normal = cells.place[order], cells.normal[order]
    extent = np.maximum.reduceat(place, first) - np.minimum.reduceat(place, first)
    turn = np.maximum.reduceat(normal, first) - np.minimum.reduceat(normal, first)
    leaves = last - first
    by_turn = (turn.max(axis=1) > 1.0) & (leaves <= PURE) & (leaves > PURE // 4)
    axis = np.where(by_turn, 3 + turn.argmax(axis=1), extent.argmax(axis=1))
    segment = np.repeat(np.arange(len(first)), leaves)
    values = np.concatenate([place, normal], axis=1)
    return np.lexsort((values[np.arange(count), axis[segment]], segment))


def _describe(cells: Cells, first: np.ndarray, last: np.ndarray, skip: np.ndarray) -> np.ndarray:
    sums = lambda values: _range_sums(values, first, last)  # noqa: E731
    area = np.maximum(sums(cells.area), 1e-300)
    middle = sums(cells.place * cells.area[:, None]) / area[:, None]
    mean = sums(cells.normal * cells.area[:, None]) / area[:, None]
    length = np.linalg.norm(mean, axis=1)
    normal = mean / np.maximum(length, 1e-30)[:, None]
    radius, thickness = np.zeros(len(first)), np.zeros(len(first))
    closed = sums(cells.closed.astype(float))
    leaves = last - first
    for number in np.unique(leaves):  # nodes with as many leaves at a time
        same = np.flatnonzero(leaves == number)
        rows = first[same][:, None] + np.arange(number)
        off = cells.place[rows] - middle[same][:, None]
        radius[same] = (np.linalg.norm(off, axis=2) + cells.radius[rows]).max(axis=1)
        height = np.abs(np.einsum("nki,ni->nk", off, normal[same]))
        cosine = np.einsum("nki,ni->nk", cells.normal[rows], normal[same])
        tilt = cells.radius[rows] * np.sqrt(np.maximum(1.0 - cosine * cosine, 0.0))
        thickness[same] = (height + tilt * (number > 1)).max(axis=1)
    stands = (leaves <= MOST_LEAVES) & (length > COHERENT) & (thickness < FLAT * radius)
    stands &= (closed == 0) | (closed == leaves)
    leaf = leaves == 1
    nodes = np.zeros((len(first), NODE_TEXELS, 4))
    nodes[:, 0, :3], nodes[:, 0, 3] = middle, radius * (1 + 1e-5)
    slab = np.maximum(thickness * (1 + 1e-3), 1e-6 * radius)
    nodes[:, 1, :2], nodes[:, 1, 2], nodes[:, 1, 3] = octahedral(normal), np.where(stands | leaf, slab, -slab), skip
    sheets = sums(cells.sheet.astype(float)) == leaves
    nodes[:, 2, 0], nodes[:, 2, 1], nodes[:, 2, 2] = first, leaves, (closed == leaves) * 1.0 + sheets
    nodes[:, 2, 3] = sums(cells.opacity * cells.area) / area
    nodes[:, 3:, 3] = NONE
    nodes[leaf, 3:] = cells.clips[first[leaf]]
    clipped = sums((cells.clips[:, :, 3] < NONE).any(axis=1).astype(float)) > 0
    for number in np.unique(leaves[stands & ~leaf & clipped]):
        same = np.flatnonzero(stands & clipped & (leaves == number))
        rows = first[same][:, None] + np.arange(number)
        direction = cells.clips[rows][..., :3].reshape(len(same), -1, 3)
        at = (cells.clips[rows][..., :3] * cells.place[rows][:, :, None]).sum(axis=3) + cells.clips[rows][..., 3]
        at = at.reshape(len(same), -1)
        inside = np.einsum("nki,nmi->nkm", direction, cells.place[rows]).max(axis=2) <= at + 1e-6 * radius[same, None]
        distance = at - np.einsum("nki,ni->nk", direction, middle[same])
        level = np.abs(np.einsum("nki,ni->nk", direction, normal[same])) < 0.3
        known = cells.clips[rows][..., 3].reshape(len(same), -1) < NONE
        distance = np.where(inside & level & known & (distance < radius[same, None]), distance, np.inf)
        own = nodes[same, 3:]
        _nearest_two(own, distance, direction)
        nodes[same, 3:] = own
    return nodes


def _range_sums(values: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Sums of rows first..last of each range (not empty), one by one: differences of running sums lose small ones."""
    padded = np.concatenate([values, np.zeros((1, *values.shape[1:]))])  # a range may end after the last row
    return np.add.reduceat(padded, np.column_stack([first, last]).reshape(-1), axis=0)[::2]
