"""Surfels: all surfaces as discs of about equal area, and a tree of them. For light that is exchanged between surfaces.

Each object's surface (surfel_surfaces.py) is parted into cells (surfel_cells.py), whose discs end where it does
(disc_edges.py); over all discs lies a tree (surfel_tree.py). Objects that would have fewer than FEWEST surfels are
sampled together. Cells of an object are kept as long as it and its share of the surfels stay, wherever it moves.

| cost | |
|---|---|
| CPU, once for a mesh | about 100 us a surfel |
| CPU, when something moves | about 10 us a surfel: tree and upload |
| bytes | 80 a node, two nodes a surfel; 32 for each side that light reaches; 256 for points in a surfel's cell |

Source: Dong, Kautz, Theobalt and Seidel 2007."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..gfx import images
from .on_gpu import SceneOnGpu
from .seen import seen_sides
from .surfel_cells import MEMBERS, NOTHING, Cells, sampled
from .surfel_surfaces import Surface, together
from .surfel_tree import tree

FEWEST = 6  # surfels of an object that is sampled by itself
ROW = 256  # receivers in a row of the images of their light
RECEIVER_TEXELS = 2


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

    def update(self, frame: SceneOnGpu, budget: int, distance: float) -> bool:
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
        surfaces = [part for one in shown for part in Surface.of(frame, one, materials).parted(seen.get(id(one)))]
        self._upload(self._sample(surfaces, budget, reach, eye))
        self.changes += 1
        return True

    def _sample(self, surfaces: list[Surface], budget: int, reach: float, eye: np.ndarray) -> Cells:
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
            parts.append(together(few, max(int(np.ceil(rest)), FEWEST), reach, eye))
        self._known = known
        return Cells.joined([part for part in parts if len(part)])

    def _own(self, one: Surface, count: int, reach: float, eye: np.ndarray, known: dict) -> Cells:
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


def _reach(frame: SceneOnGpu, distance: float) -> tuple[float, np.ndarray]:
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
