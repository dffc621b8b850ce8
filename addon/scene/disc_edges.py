"""Where discs of surfels end: at the edges of their surface, and what share of each has surface below it.

Up to CLIPS edges end a disc: open edges of the mesh, and sharp ones. A disc that reaches beyond its thing all the same
(leaves, folds, legs) is met by the share of it that is surface: `filled`.

CPU: about 50 us a disc."""

from __future__ import annotations

import numpy as np

from .pieces import areas_and_normals

CLIPS = 2  # edges at which a disc ends
CREASE = 0.5  # cosine between the triangles at an edge, below which surfaces end there
MOST_EDGES, MOST_TRIANGLES = 4000, 30_000  # of a mesh whose discs end at its edges
FULL, BELOW = 0.75, 0.5  # share of a disc from which on it counts as filled; radii that surface may lie off its plane
ON_DISC = 48
NONE = 1e30


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
    normal = areas_and_normals(corners)[1]
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


def clipped(place, normal, radius, ends, outwards, normals) -> np.ndarray:
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
        nearest_two(clips[some], distance, outwards[None].repeat(len(distance), axis=0))
    return clips


def nearest_two(clips: np.ndarray, distance: np.ndarray, direction: np.ndarray) -> None:
    """Fill in (N, CLIPS, 4) from candidates (N, K) that run in different directions (N, K, 3)."""
    rows = np.arange(len(distance))
    for k in range(CLIPS):
        chosen = distance.argmin(axis=1)
        found = np.isfinite(distance[rows, chosen])
        clips[found, k, :3] = direction[rows, chosen][found]
        clips[found, k, 3] = distance[rows, chosen][found]
        alike = np.einsum("nki,ni->nk", direction, direction[rows, chosen]) > 0.9
        distance = np.where(alike, np.inf, distance)
