"""Silhouettes of a light: which edges can hide a part of it, in which wedge of space, and what hides its centre.

The number D(p, s) of triangles between a receiver p and a point s of a light is known at every s once it is known at
the light's centre c: it changes by an edge's weight where the edge lies in the triangle (p, c, s). So each edge is
asked once by the receivers that it can matter to:

| step | what | where |
|---|---|---|
| candidates | edges with w(c) != 0, or with a face whose plane cuts the light | here, numpy |
| wedges | four planes around all receivers for which the edge can hide a part of the light | here, numpy |
| count | D(p, c) = D(eye, c) - crossings of shadow quads between eye and p | draw, additive |
| words | which edges matter to a tile of pixels, 32 to a word | compute (edge_tiles.py) |
| gather | per pixel, over the words of its tile | compute, by each technique |

The wedge is tangent to the ball around the light (radius r): the shadow quad of the edge, its farther end pulled
towards the light, turned about the edge until it touches the ball on either side, and about its ends likewise. Where
the edge's line meets the ball there is no wedge, and the edge is asked everywhere. Testing only that the weight is zero
from every corner of the light would lose edges; a face's plane must be proven not to cut it.

Sources: Forest, Barthe, Paulin, "Accurate shadows by depth complexity sampling", CGF 27(2), 2008, and Forest's thesis,
Toulouse 2008; Assarsson, Akenine-Moeller, ToG 22(3), 2003 (wedges); Laine et al., ToG 24, 2005 (silhouettes).
Wedges by tangent planes, the predicate on a triangle (p, c, s) and the count from the eye instead of capped volumes are
ours: the published wedge lets 1.2 % of shadows fall outside.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..gfx import images
from ..kernels.morton import morton_codes
from ..scene.edges import CasterEdges
from ..sources import lights

RECORD_TEXELS, WEDGE_TEXELS = 4, 4
WIDEST_IN_PLANE = 1.4  # half angle of a sun, radians
SMALLEST_SUN = 1e-9  # sine of a half angle


@dataclass(frozen=True)
class Extent:
    """A light as edges see it: its centre, and a ball (or cone) around all of its points."""

    emitter: lights.Emitter
    centre: np.ndarray  # (3,) float64; at infinity the unit direction towards it
    infinite: bool
    radius: float  # of the ball around all points, metres; at infinity the largest |s - centre| of its directions
    corners: np.ndarray  # (K, 3) s - centre, whose hull holds all points; empty: a ball or cone of `radius`
    disc: float  # radius of the disc that faces the receiver, at its least; 0: the points are the same for all

    @classmethod
    def of(cls, emitter: lights.Emitter, nearest: float = np.inf) -> Extent:
        """`nearest`: distance of the nearest receiver from the centre, metres, which must lie outside of a sphere."""
        centre = np.asarray(emitter.centre, np.float64)
        none = np.zeros((0, 3))
        if emitter.kind == lights.SUN:
            return cls(emitter, centre, True, 2.0 * float(np.sin(emitter.radius / 2)), none, 0.0)
        if emitter.has_span:
            u, v = np.asarray(emitter.u[:3], float), np.asarray(emitter.v[:3], float)
            if emitter.kind == lights.RECTANGLE:
                corners = np.array([su * u + sv * v for su in (-1, 1) for sv in (-1, 1)])
                return cls(emitter, centre, False, float(np.linalg.norm(corners, axis=1).max()), corners, 0.0)
            reach = max(np.linalg.norm(u), np.linalg.norm(v))
            turn = np.arange(12) * (np.pi / 6)  # a polygon around the ellipse
            around = np.cos(turn)[:, None] * u + np.sin(turn)[:, None] * v
            return cls(emitter, centre, False, float(reach), around / np.cos(np.pi / 12), 0.0)
        radius = emitter.radius
        seen = radius
        if emitter.kind == lights.SPHERE and radius > 0:
            seen = radius / float(np.sqrt(max(1.0 - min(radius / max(nearest, 1e-30), 0.999) ** 2, 1e-6)))
        return cls(emitter, centre, False, seen, none, radius)

    @property
    def half_axes(self) -> tuple[np.ndarray, np.ndarray]:
        """Of a rectangle around the centre (at infinity: at a distance of 1) that holds all points; zeros where it
        turns with the receiver, or would be too wide to be told by."""
        emitter = self.emitter
        if emitter.has_span:
            return np.asarray(emitter.u[:3], float), np.asarray(emitter.v[:3], float)
        if not self.infinite or not self.in_plane:
            return np.zeros(3), np.zeros(3)
        u, v = across(self.centre)
        reach = float(np.tan(emitter.radius))
        return u * reach, v * reach

    @property
    def in_plane(self) -> bool:
        """Whether its points lie in one plane, of its own or before each receiver."""
        return self.emitter.kind != lights.SUN or self.emitter.radius <= WIDEST_IN_PLANE

    def never_blocks(self, corners: np.ndarray) -> np.ndarray:
        """(T,) triangles (T, 3, 3) that lie in the light, or behind one that shines to one side. Light does not pass
        them, and layers could not be counted from a centre that lies on one."""
        if self.infinite:
            return np.zeros(len(corners), bool)
        offset = corners.astype(np.float64) - self.centre
        if self.emitter.has_span:
            before = offset @ np.asarray(self.emitter.axis, np.float64)
            return (before <= 1e-6 * np.linalg.norm(offset, axis=2) + 1e-6 * self.radius).all(axis=1)
        return (np.linalg.norm(offset, axis=2) <= self.emitter.radius).all(axis=1)

    def side(self, planes: np.ndarray) -> np.ndarray:
        """(T,) +1 or -1: the side of planes (T, 4) on which the centre lies; 0 counts as +1."""
        offset = planes[:, :3].astype(np.float64) @ self.centre + (0.0 if self.infinite else planes[:, 3])
        return np.where(offset >= 0.0, 1, -1).astype(np.int8)

    def cuts(self, planes: np.ndarray) -> np.ndarray:
        """(T,) whether a plane has points of the light on both sides."""
        normal = planes[:, :3].astype(np.float64)
        middle = normal @ self.centre + (0.0 if self.infinite else planes[:, 3])
        if len(self.corners):
            reach = normal @ self.corners.T
            return (middle + reach.min(axis=1) < 0.0) & (middle + reach.max(axis=1) >= 0.0)
        return np.abs(middle) < self.radius * np.linalg.norm(normal, axis=1) * (1.0 + 1e-6)


def across(axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors that with a unit `axis` (3,) are at right angles to each other."""
    helper = np.array([1.0, 0.0, 0.0]) if abs(axis[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    u = np.cross(helper, axis)
    u /= np.linalg.norm(u)
    return u, np.cross(axis, u)


@dataclass(frozen=True)
class Silhouettes:
    """The candidate edges of a light, sorted; what is drawn and what is gathered."""

    numbers: np.ndarray  # (E,) of the scene's edges
    weight: np.ndarray  # (E,) w(c)
    drawn: np.ndarray  # numbers of the E with w(c) != 0: those with shadow quads
    records: np.ndarray  # (E, RECORD_TEXELS, 4) float32
    wedges: np.ndarray  # (E, WEDGE_TEXELS, 4) float32: n . x + o <= 0 inside of all four

    @property
    def count(self) -> int:
        return len(self.numbers)


def silhouettes(casters: CasterEdges, extent: Extent, accurate: bool = True, by_group: bool = False) -> Silhouettes:
    """Candidate edges of a light. Not `accurate`: those of its centre alone, which misses silhouettes of other points.
    `by_group`: sorted by group, else by place."""
    facing = extent.side(casters.planes)
    faces, orient = casters.faces, casters.orient.astype(np.int64)
    taken = faces >= 0
    weight = (np.where(taken, facing[faces], 0) * orient).sum(axis=1)
    wanted = weight != 0
    if accurate:
        wanted |= (taken & extent.cuts(casters.planes)[faces]).any(axis=1)
    ends = casters.ends
    found = np.isfinite(ends).all(axis=(1, 2)) & (ends[:, 0] != ends[:, 1]).any(axis=1)
    numbers = np.flatnonzero(wanted & found)
    middle = ends[numbers].mean(axis=1)
    place = morton_codes(middle) if len(numbers) else np.zeros(0, np.int64)
    order = np.lexsort((place, casters.group[numbers])) if by_group else np.argsort(place, kind="stable")
    numbers = numbers[order]
    records = records_of(casters, numbers, weight[numbers])
    wedges = wedges_of(ends[numbers].astype(np.float64), extent)
    return Silhouettes(numbers, weight[numbers], np.flatnonzero(weight[numbers]), records, wedges)


def records_of(casters: CasterEdges, numbers: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """(E, RECORD_TEXELS, 4): ends with orientations ((o_1 + 1) + 3 (o_2 + 1)) and w(c), planes of the two faces. A face
    that is missing has no orientation, and the plane of the other one."""
    rows = np.zeros((len(numbers), RECORD_TEXELS, 4), np.float32)
    faces = casters.faces[numbers]
    orient = casters.orient[numbers].astype(np.int64)
    rows[:, 0, :3], rows[:, 1, :3] = casters.ends[numbers, 0], casters.ends[numbers, 1]
    rows[:, 0, 3] = (orient[:, 0] + 1) + 3 * (orient[:, 1] + 1)
    rows[:, 1, 3] = weight
    rows[:, 2] = casters.planes[faces[:, 0]]
    rows[:, 3] = casters.planes[np.where(faces[:, 1] >= 0, faces[:, 1], faces[:, 0])]
    return rows


def wedges_of(ends: np.ndarray, extent: Extent) -> np.ndarray:
    """(E, WEDGE_TEXELS, 4) float32 planes n, o of edges (E, 2, 3): the receivers for which the edge can hide a part of
    the light have n . x + o <= 0 for all of them. Zeros where there is no wedge: every receiver is inside."""
    if not len(ends):
        return np.zeros((0, WEDGE_TEXELS, 4), np.float32)
    centre = extent.centre
    if extent.infinite:
        a = b = np.broadcast_to(-centre, (len(ends), 3))  # along the light's travel
        along = ends[:, 1] - ends[:, 0]
        depth = along @ -centre
        x = along + depth[:, None] * centre
        # The end that is farther along the light is moved back, against it, to the other's height.
        back = np.stack([np.maximum(-depth, 0.0), np.maximum(depth, 0.0)], axis=1)
        w = ends + back[:, :, None] * centre
        x_length = np.linalg.norm(x, axis=1)
        near = distance = np.full(len(ends), 1.0)
        sine_front = sine_side = np.full(len(ends), min(extent.radius, 1.0))
    else:
        a, b = ends[:, 0] - centre, ends[:, 1] - centre
        la, lb = np.linalg.norm(a, axis=1), np.linalg.norm(b, axis=1)
        distance = np.minimum(la, lb)
        a = a * (distance / np.maximum(la, 1e-300))[:, None]
        b = b * (distance / np.maximum(lb, 1e-300))[:, None]
        w = np.stack([centre + a, centre + b], axis=1)
        x = b - a
        x_length = np.linalg.norm(x, axis=1)
        near = None
    # An edge that points at the light: any axis across does.
    thin = x_length < 1e-9 * np.maximum(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), 1e-300)
    helper = np.where(np.abs(a[:, :1]) < 0.9 * np.linalg.norm(a, axis=1, keepdims=True), [[1.0, 0, 0]], [[0, 1.0, 0]])
    x = np.where(thin[:, None], np.cross(helper, a), x)
    x = x / np.maximum(np.linalg.norm(x, axis=1, keepdims=True), 1e-300)
    if near is None:
        near = np.linalg.norm(np.cross(a, x), axis=1)
        with np.errstate(divide="ignore"):
            sine_front, sine_side = extent.radius / near, extent.radius / distance
    y = _unit(np.cross(b, x))
    m = _unit(a + b)
    none = (sine_front > 0.999) | (sine_side > 0.999)
    sf, ss = np.minimum(sine_front, 0.999)[:, None], np.minimum(sine_side, 0.999)[:, None]
    cf, cs = np.sqrt(1.0 - sf**2), np.sqrt(1.0 - ss**2)
    pa, pb = _unit(np.cross(y, a)), _unit(np.cross(y, b))
    pa *= np.where((pa * x).sum(axis=1) >= 0, 1.0, -1.0)[:, None]
    pb *= np.where((pb * x).sum(axis=1) >= 0, 1.0, -1.0)[:, None]
    normals = np.stack([y * cf - m * sf, -y * cf - m * sf, -pa * cs - _unit(a) * ss, pb * cs - _unit(b) * ss], axis=1)
    through = w[:, [0, 0, 0, 1]]
    offset = -(normals * through).sum(axis=2)
    planes = np.concatenate([normals, offset[:, :, None]], axis=2)
    planes[none | ~np.isfinite(planes).all(axis=(1, 2))] = 0.0
    return planes.astype(np.float32)


def _unit(v: np.ndarray) -> np.ndarray:
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-300)


def crossings(corners: np.ndarray, start: np.ndarray, end: np.ndarray, infinite: bool = False) -> np.ndarray:
    """(T,) whether the segment from `start` to `end` crosses triangles (T, 3, 3), in float64; `infinite`: `end` is a
    direction."""
    a, b, c = np.moveaxis(corners.astype(np.float64) - np.asarray(start, np.float64), 1, 0)
    way = np.asarray(end, np.float64) - (0.0 if infinite else np.asarray(start, np.float64))
    ab, bc, ca = np.cross(a, b), np.cross(b, c), np.cross(c, a)
    sides = np.stack([ab @ way >= 0, bc @ way >= 0, ca @ way >= 0])
    inside = sides.all(axis=0) | ~sides.any(axis=0)
    normal = ab + bc + ca
    at_start = -np.einsum("ti,ti->t", normal, a)
    along = normal @ way
    at_end = np.where(along == 0.0, at_start, along) if infinite else at_start + along
    return inside & ((at_start >= 0) != (at_end >= 0))


def hidden_from_eye(casters: CasterEdges, extent: Extent, eye: np.ndarray) -> np.ndarray:
    """(T,) which triangles lie between the eye and the light's centre. `eye` (4,): w = 1 a direction towards it."""
    eye, at_infinity = np.asarray(eye[:3], np.float64), bool(eye[3] > 0.5)
    if not len(casters.corners):
        return np.zeros(0, bool)
    if not at_infinity:
        return crossings(casters.corners, eye, extent.centre, extent.infinite)
    if not extent.infinite:
        return crossings(casters.corners, extent.centre, eye, True)
    # Both at infinity: from any place beyond the scene on one side of it to the other, all around there is nothing.
    return np.zeros(len(casters.corners), bool)


def upload(found: Silhouettes) -> tuple[images.Image, images.Image]:
    """Records and wedges as lists on the GPU."""
    return images.upload_list(found.records.reshape(-1, 4)), images.upload_list(found.wedges.reshape(-1, 4))
