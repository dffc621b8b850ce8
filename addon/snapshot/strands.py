"""Hair curves as tubes and point clouds as spheres: triangles with the mean width and area of the round shape.

Cycles draws hair as ribbons that face the viewer with the normals of a tube, along a Catmull-Rom spline through the
points, and point clouds as spheres. Here both become meshes, so that every technique sees them like any other. A tube
is a little wider than the hair: its mean width over all directions, perimeter / pi by Cauchy, is the hair's. As it is
turned, its width is .977 to 1.011 of that with twelve sides, where hairs are few, .990 to 1.005 with nine, .983 to
1.008 with seven, .967 to 1.017 with five: odd numbers, since the width of a polygon of n sides varies no more than
that of one of 2 n where n is odd. Tubes of fewer than ten sides are turned each by itself, so that hairs side by side
have the mean width from every side. A sphere of triangles is a little larger (its mean shadow, area / 4, is the
sphere's); normals are the round ones.

Bias: a facet that turns away from a lamp shadows a rim that a round strand would light, 1 to 2 % of a tuft's light.

Bulk numpy; the only loop runs along the points of the longest curve, for all curves at once. 10,000 hairs of 8 points
are 1.4 million triangles and take 0.5 s. Of more the tubes become coarser: one piece a segment, then three sides, then
every other point.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ..materials.nodes.inputs import MARK, PLACE, ROUND, STRAND, WAY

SIDES = 5
STEPS = 2  # pieces per segment of the spline, as many as Cycles draws by default
FINENESS = ((STEPS, SIDES), (1, SIDES), (1, 3))  # pieces and sides: the first that is not too much
ROUND_SIDES = 12, 9, 7  # sides before those: the first that makes no more than
FEW_TRIANGLES = 300_000  # of them
HAIR_RADIUS = 0.005  # metres, where a curve or point has none: Cycles' defaults
POINT_RADIUS = 0.01
TURNED = 10  # sides, from which on all tubes may be turned alike
GOLDEN = (5**0.5 - 1) / 2  # whose multiples fill a turn evenly, however many there are
AXIS_STEPS = 1024  # of a strand's direction: .1 degrees
MOST_TRIANGLES = 1_500_000  # of a point cloud or of hair, before its spheres or tubes become coarser


def tubes(points: np.ndarray, radii: np.ndarray, offsets: np.ndarray):
    """Curves as tubes, coarser ones where there are many.

    `points` (P, 3) float32, `radii` (P,), `offsets` (C + 1,) int: curve k holds the points from offsets[k] up to
    offsets[k + 1].
    Returns positions (V, 3), normals (V, 3), triangles (T, 3) and the point that each vertex belongs to (V,).
    """
    segments = int(np.maximum(np.diff(offsets) - 1, 0).sum())
    finest = next((sides for sides in ROUND_SIDES if 2 * STEPS * sides * segments <= FEW_TRIANGLES), SIDES)
    choices = ((STEPS, finest), *FINENESS)
    steps, sides = next((f for f in choices if 2 * f[0] * f[1] * segments <= MOST_TRIANGLES), FINENESS[-1])
    if 2 * steps * sides * segments <= MOST_TRIANGLES:
        return _tubes(points, radii, offsets, steps, sides)
    kept = np.arange(len(points))
    while 2 * sides * segments > MOST_TRIANGLES and (np.diff(offsets) > 2).any():
        kept, offsets = _every_other(kept, offsets)
        segments = int(np.maximum(np.diff(offsets) - 1, 0).sum())
    positions, normals, triangles, source = _tubes(points[kept], radii[kept], offsets, steps, sides)
    return positions, normals, triangles, kept[source]


def _every_other(points: np.ndarray, offsets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Half the points of each curve, ends included, and the offsets of what is left."""
    curves = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    place = np.arange(len(points)) - offsets[curves]
    keep = (place % 2 == 0) | (np.arange(len(points)) == offsets[curves + 1] - 1)
    counts = np.bincount(curves[keep], minlength=len(offsets) - 1)
    return points[keep], np.concatenate([[0], np.cumsum(counts)])


def _tubes(points: np.ndarray, radii: np.ndarray, offsets: np.ndarray, pieces: int, sides: int):
    curves = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    keep = np.diff(offsets)[curves] >= 2
    last = offsets[curves + 1] - 1
    number = np.arange(len(points))
    start = number[keep & (number < last)]  # of each segment
    first, final = offsets[curves[start]], last[start]
    before, after = np.maximum(start - 1, first), np.minimum(start + 2, final)
    # Rings: one for each piece of a segment and one at each curve's tip.
    steps = np.arange(pieces) / pieces
    shape = (len(start), pieces)
    places = _catmull_rom(*(points[k].astype(np.float64) for k in (before, start, start + 1, after)), steps)
    width = radii[start][:, None] * (1 - steps) + radii[start + 1][:, None] * steps
    nearest = np.where(steps < 0.5, start[:, None], start[:, None] + 1)
    tips = np.unique(final)
    order = np.argsort(np.concatenate([(start[:, None] + steps).reshape(-1), tips.astype(np.float64)]), kind="stable")
    ring_place = np.concatenate([places.reshape(-1, 3), points[tips]])[order]
    ring_width = np.concatenate([width.reshape(-1), radii[tips]])[order]
    ring_point = np.concatenate([nearest.reshape(np.prod(shape)), tips])[order]
    ring_curve = curves[ring_point]
    if not len(ring_place):
        return np.zeros((0, 3), np.float32), np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32), ring_point
    u, v = _frames(ring_place, ring_curve)
    turn = ring_curve * GOLDEN % 1.0 if sides < TURNED else np.zeros(len(ring_curve))
    angle = 2.0 * np.pi / sides * (np.arange(sides) + turn[:, None])
    wider = np.pi / (sides * np.sin(np.pi / sides))  # circumradius of a polygon whose perimeter is the circle's
    normals = np.cos(angle)[:, :, None] * u[:, None] + np.sin(angle)[:, :, None] * v[:, None]
    positions = ring_place[:, None] + normals * (wider * ring_width)[:, None, None]
    ring = np.flatnonzero(ring_curve[:-1] == ring_curve[1:])
    side = np.arange(sides)
    a, b = ring[:, None] * sides + side, ring[:, None] * sides + (side + 1) % sides
    triangles = np.stack([a, b, b + sides, a, b + sides, a + sides], axis=-1).reshape(-1, 3)
    return (
        positions.reshape(-1, 3).astype(np.float32), normals.reshape(-1, 3).astype(np.float32),
        triangles.astype(np.int32), np.repeat(ring_point, sides),
    )  # fmt: skip


def spheres(points: np.ndarray, radii: np.ndarray):
    """Points (P, 3) of `radii` (P,) as spheres; returns what `tubes` does."""
    level = 2
    while level > 0 and len(points) * 20 * 4**level > MOST_TRIANGLES:
        level -= 1
    unit, faces = _icosphere(level)
    edges = unit[faces[:, 1:]] - unit[faces[:, :1]]
    area = 0.5 * np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1).sum()
    grown = np.sqrt(4.0 * np.pi / area)
    positions = points[:, None] + (grown * radii)[:, None, None] * unit
    triangles = (np.arange(len(points)) * len(unit))[:, None, None] + faces
    return (
        positions.reshape(-1, 3).astype(np.float32), np.tile(unit, (len(points), 1)).astype(np.float32),
        triangles.reshape(-1, 3).astype(np.int32), np.repeat(np.arange(len(points)), len(unit)),
    )  # fmt: skip


def _catmull_rom(before, start, end, after, t) -> np.ndarray:
    """(S, len(t), 3) points of the uniform spline between `start` and `end`, each (S, 3)."""
    t = t[None, :, None]
    before, start, end, after = (p[:, None] for p in (before, start, end, after))
    slope, bend = end - before, 2.0 * before - 5.0 * start + 4.0 * end - after
    return start + 0.5 * t * (slope + t * (bend + t * (3.0 * (start - end) + after - before)))


def _frames(places: np.ndarray, curve: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors across each ring's direction, carried along every curve without twist (parallel transport)."""
    joined = curve[:-1] == curve[1:]
    step = np.where(joined[:, None], np.diff(places, axis=0), 0.0)
    along = np.zeros_like(places)
    along[:-1] += step
    along[1:] += step
    along = _unit(along, (0.0, 0.0, 1.0))
    helper = np.eye(3)[np.abs(along).argmin(axis=1)]
    u = _unit(np.cross(along, helper), (1.0, 0.0, 0.0))
    starts = np.concatenate([[0], np.flatnonzero(~joined) + 1])
    lengths = np.diff(np.append(starts, len(places)))
    for number in range(1, int(lengths.max())):
        ring = starts[lengths > number] + number
        carried = u[ring - 1] - along[ring] * np.einsum("ij,ij->i", u[ring - 1], along[ring])[:, None]
        length = np.linalg.norm(carried, axis=1)
        good = length > 1e-6
        u[ring[good]] = carried[good] / length[good, None]
    return u, np.cross(along, u)


def _unit(vectors: np.ndarray, otherwise) -> np.ndarray:
    length = np.linalg.norm(vectors, axis=1)
    good = length > 0.0
    return np.where(good[:, None], vectors / np.where(good, length, 1.0)[:, None], otherwise)


@lru_cache
def _icosphere(level: int) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors (V, 3) and triangles (20 * 4^level, 3), counter-clockwise from outside."""
    golden = (1.0 + 5.0**0.5) / 2.0
    corners = [(s, t * golden, 0.0) for s in (-1, 1) for t in (-1, 1)]
    unit = np.array([np.roll(corner, turn) for turn in range(3) for corner in corners])
    length = np.linalg.norm(unit[:, None] - unit[None], axis=2)
    near = np.isclose(length, 2.0)
    faces = np.array([
        (a, b, c) for a in range(12) for b in range(a + 1, 12) for c in range(b + 1, 12)
        if near[a, b] and near[b, c] and near[a, c]
    ])  # fmt: skip
    for _ in range(level):
        ends = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
        edges, which = np.unique(ends, axis=0, return_inverse=True)
        middle = len(unit) + which.reshape(3, -1)
        unit = np.concatenate([unit, unit[edges].sum(axis=1)])
        a, b, c = faces.T
        ab, bc, ca = middle
        faces = np.concatenate([np.stack(new, axis=1) for new in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))])
    unit = unit / np.linalg.norm(unit, axis=1)[:, None]
    outward = np.einsum(
        "ij,ij->i", np.cross(unit[faces[:, 1]] - unit[faces[:, 0]], unit[faces[:, 2]] - unit[faces[:, 0]]),
        unit[faces[:, 0]],
    )  # fmt: skip
    faces[outward < 0] = faces[outward < 0][:, ::-1]
    return unit, faces


def strand_places(
    positions: np.ndarray, source: np.ndarray, points: np.ndarray, offsets: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Between which points (V,), (V,) of their strands the vertices (V, 3) of tubes lie, and the share (V,) of the way.
    `source` (V,): the nearest point; where points are not finite, the vertices lie at it."""
    curve = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    first, last, number = offsets[curve], offsets[curve + 1] - 1, np.arange(len(points))
    onward = points[np.minimum(number + 1, last)] - points[number]
    back = points[number] - points[np.maximum(number - 1, first)]
    off = positions - points[source]

    def share(step: np.ndarray) -> np.ndarray:
        return np.einsum("ij,ij->i", off, step) / np.maximum(np.einsum("ij,ij->i", step, step), 1e-30)

    ahead, behind = share(onward[source]), share(back[source])
    place = source + np.where(ahead > 0, np.clip(ahead, 0.0, 0.5), np.clip(behind, -0.5, 0.0))
    place = np.clip(np.where(np.isnan(place), source, place), first[source], last[source])
    low = np.floor(place).astype(int)
    return low, np.minimum(low + 1, last[source]), place - low


def between(values: np.ndarray, places: tuple[np.ndarray, np.ndarray, np.ndarray]) -> np.ndarray:
    """What points have (P, n), at the places of strand_places."""
    low, high, share = places
    return values[low] + (values[high] - values[low]) * share[:, None]


def strand_facts(
    tube: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    points: np.ndarray,
    radii: np.ndarray,
    offsets: np.ndarray,
) -> dict[str, np.ndarray]:
    """What Curves Info and Principled Hair ask of the V vertices of tubes (as `tubes` returns them), in object space.

    STRAND (V, 4): 1, the share of the way from root to tip, the strand's length, the thickness there. WAY (V, 4): the
    strand's direction and a random number. ROUND (V, 4): how far the vertex lies off the strand's axis, in radii, and
    the tube's sides.
    """
    positions, normals, _, source = tube
    sides = _sides(tube, offsets)
    wider = np.pi / (sides * np.sin(np.pi / sides))
    places = strand_places(positions, source, points, offsets)
    curve = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    first, last, number = offsets[curve], offsets[curve + 1] - 1, np.arange(len(points))
    onward = points[np.minimum(number + 1, last)] - points[number]
    length = np.bincount(curve, np.linalg.norm(onward, axis=1), len(offsets) - 1)
    way = points[np.minimum(number + 1, last)] - points[np.maximum(number - 1, first)]
    way /= np.maximum(np.linalg.norm(way, axis=1), 1e-30)[:, None]
    share = (number - first) / np.maximum(last - first, 1)
    strand = np.stack([np.ones(len(points)), share, length[curve], 2.0 * radii], axis=1)
    along = np.concatenate([way, random_numbers(len(offsets) - 1)[curve][:, None]], axis=1)
    off = np.concatenate([wider * normals, np.full((len(normals), 1), sides)], axis=1)
    return {
        STRAND: between(strand, places).astype(np.float32), WAY: along[source].astype(np.float32),
        ROUND: off.astype(np.float32),
    }  # fmt: skip


def strand_shape(
    tube: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    points: np.ndarray,
    radii: np.ndarray,
    offsets: np.ndarray,
) -> np.ndarray:
    """(V, 2) float32 what shaders/surface/strand.glsl reads of the vertices of tubes (as `tubes` returns them): the
    strand's radius, and, as a negative whole number that float32 holds exactly, the tube's sides and the strand's
    direction on an octahedron of AXIS_STEPS steps a side."""
    positions, _, _, source = tube
    sides = _sides(tube, offsets)
    number, curve = np.arange(len(points)), np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    first, last = offsets[curve], offsets[curve + 1] - 1
    finite = np.nan_to_num(points.astype(np.float64), posinf=0.0, neginf=0.0)  # broken points lie anywhere
    way = finite[np.minimum(number + 1, last)] - finite[np.maximum(number - 1, first)]
    way = _unit(way, (0.0, 0.0, 1.0))[source]
    way /= np.abs(way).sum(axis=1, keepdims=True)
    x, y, z = way.T
    folded = np.stack([(1 - np.abs(y)) * np.where(x < 0, -1, 1), (1 - np.abs(x)) * np.where(y < 0, -1, 1)], axis=1)
    flat = np.where(z[:, None] < 0, folded, way[:, :2])
    steps = np.rint((0.5 * flat + 0.5) * (AXIS_STEPS - 1))
    packed = (min(round(sides), 15) * AXIS_STEPS + steps[:, 0]) * AXIS_STEPS + steps[:, 1]
    radius = between(radii[:, None], strand_places(positions, source, points, offsets))[:, 0]
    return np.stack([np.nan_to_num(radius, posinf=0.0, neginf=0.0), -packed], axis=1).astype(np.float32)


def _sides(tube: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray], offsets: np.ndarray) -> float:
    """Of each tube: a ring has as many vertices, and each step from ring to ring twice as many triangles."""
    positions, _, triangles, _ = tube
    curves = max(int((np.diff(offsets) >= 2).sum()), 1)
    return max((len(positions) - len(triangles) / 2) / curves, 3.0)


def point_facts(source: np.ndarray, points: np.ndarray, radii: np.ndarray) -> dict[str, np.ndarray]:
    """What Point Info tells: PLACE (V, 4) the point's place and radius, MARK (V, 4) 1 and a random number."""
    place = np.concatenate([points, radii[:, None]], axis=1)
    mark = np.zeros((len(points), 4))
    mark[:, 0], mark[:, 1] = 1.0, random_numbers(len(points))
    return {PLACE: place[source].astype(np.float32), MARK: mark[source].astype(np.float32)}


def random_numbers(count: int) -> np.ndarray:
    """(count,) 0..1, Cycles' random number of each strand or point: its number mixed with zero by Bob Jenkins' final(),
    public domain."""

    def rotated(value: np.ndarray, bits: int) -> np.ndarray:
        return (value << np.uint32(bits)) | (value >> np.uint32(32 - bits))

    start = np.uint32(0xDEADBEEF + (2 << 2) + 13)
    with np.errstate(over="ignore"):
        a = start + np.arange(count, dtype=np.uint32)
        b = np.full(count, start)
        c = (np.full(count, start) ^ b) - rotated(b, 14)
        a = (a ^ c) - rotated(c, 11)
        b = (b ^ a) - rotated(a, 25)
        c = (c ^ b) - rotated(b, 16)
        a = (a ^ c) - rotated(c, 4)
        b = (b ^ a) - rotated(a, 14)
        c = (c ^ b) - rotated(b, 24)
    return c / np.float64(0xFFFFFFFF)
