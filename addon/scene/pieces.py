"""Triangles in pieces, well-spaced points and octahedral directions, for spreading points over surfaces."""

from __future__ import annotations

import numpy as np


def halved(
    corners: np.ndarray, eye: np.ndarray, reach: float, rounds: int = 256, most: int = 1_000_000
) -> tuple[np.ndarray, np.ndarray]:
    """Triangles (N, 3, 3), those halved at their longest edge that are longer than both `reach` and their distance from
    `eye`; and which triangle each piece is of. At most `rounds` times, into at most about `most` pieces. Those that are
    not finite are left out."""
    triangle = np.flatnonzero(np.isfinite(corners).all(axis=(1, 2)))
    corners = corners[triangle]
    done, numbers, pieces = [], [], 0
    for _ in range(rounds):
        edges = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
        longest = edges.max(axis=1, initial=0.0)
        away = np.linalg.norm(corners.mean(axis=1) - eye, axis=1) - longest
        large = longest > np.maximum(away, reach)
        done.append(corners[~large])
        numbers.append(triangle[~large])
        pieces += int((~large).sum())
        corners, triangle = corners[large], triangle[large]
        if not len(corners) or pieces + 2 * len(corners) > most:
            break
        first = edges[large].argmax(axis=1)
        a, b, c = (corners[np.arange(len(corners)), (first + k) % 3] for k in range(3))
        middle = (a + b) / 2
        corners = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
        triangle = np.concatenate([triangle, triangle])
    return np.concatenate([*done, corners]), np.concatenate([*numbers, triangle])


def areas_and_normals(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Areas of triangles, 0 where they are not finite, and unit normals."""
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    double = np.linalg.norm(across, axis=1)
    finite = np.isfinite(double)
    return np.where(finite, double / 2, 0.0), np.where(
        finite[:, None], across / np.maximum(double, 1e-300)[:, None], 0.0
    )


def octahedral(normal: np.ndarray) -> np.ndarray:
    """(N, 2) numbers in -1..1 of unit vectors; octahedral_decode in shaders/lib/math.glsl."""
    flat = normal / np.maximum(np.abs(normal).sum(axis=1, keepdims=True), 1e-30)
    folded = (1.0 - np.abs(flat[:, 1::-1])) * np.where(flat[:, :2] >= 0.0, 1.0, -1.0)
    return np.where(flat[:, 2:] >= 0.0, flat[:, :2], folded)


# Numbers beside a direction, in the last bits of both of its own; shaders/lib/gbuffer.glsl has the same.
BESIDE_GRID, BESIDE_BITS = 65536.0, 128.0
LIFT_STEPS, LIFT_OCTAVES, LIFT_FIRST = BESIDE_BITS**2 - 1.0, 64.0, 40.0


def octahedral_with_lift(normal: np.ndarray, lift: np.ndarray) -> np.ndarray:
    """(N, 2) float32 of unit vectors and lengths (N,), m, 0 for none: lift_encode in shaders/lib/gbuffer.glsl.
    Directions without a length must be stored so, too: `octahedral` alone leaves any length in their last bits."""
    with np.errstate(divide="ignore"):
        code = np.floor((np.log2(lift) + LIFT_FIRST) * (LIFT_STEPS / LIFT_OCTAVES) + 0.5)
    code = np.where(lift > 0.0, np.clip(code, 1.0, LIFT_STEPS), 0.0)
    high = np.floor(code / BESIDE_BITS)
    numbers = np.stack([high, code - high * BESIDE_BITS], axis=1)
    snapped = np.floor(octahedral(normal) * BESIDE_GRID + 0.5)
    return ((snapped + numbers / BESIDE_BITS) / BESIDE_GRID).astype(np.float32)


def farthest(points: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """(count,) numbers of points (N, D), each the farthest from those before, and (N,) the nearest centre of each, by
    its place among them. In the precision of `points`; Eldar et al. 1997."""
    squares = (points * points).sum(axis=1)
    distance = np.full(len(points), np.inf, points.dtype)
    owner = np.zeros(len(points), np.int64)
    centres = np.zeros(count, np.int64)
    chosen = 0
    for k in range(count):
        centres[k] = chosen
        to_chosen = squares - 2.0 * (points @ points[chosen]) + squares[chosen]
        nearer = to_chosen < distance
        distance[nearer] = to_chosen[nearer]
        owner[nearer] = k
        distance[chosen] = -1.0
        owner[chosen] = k
        chosen = int(distance.argmax())
    return centres, owner
