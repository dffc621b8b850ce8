"""Views of all surfaces of a material laid over one another, from which means over them are taken.

Two slanted directions that between them see every face from the front or from behind at about the angle from which
diffuse light comes (55 degrees for the faces of a box).
"""

from __future__ import annotations

import numpy as np

from .geometry import Draw

DIRECTIONS = np.array([[1.0, 0.9, 0.8], [-0.8, 1.0, 0.9]])
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1)[:, None]
ENOUGH = 4096  # triangles of one mesh: its instances differ by little but their place


def some(numbers: list[int], draws: list[Draw]) -> list[int]:
    """Of a mesh that is shown in many groups of instances as many groups, evenly, as hold about ENOUGH triangles."""
    by_batch: dict[int, list[int]] = {}
    for k in numbers:
        by_batch.setdefault(draws[k].batch.number, []).append(k)
    chosen = []
    for groups in by_batch.values():
        chosen += groups[:: max(sum(draws[k].triangles for k in groups) // ENOUGH, 1)]
    return sorted(chosen)


def overview(low: np.ndarray, high: np.ndarray, backward: np.ndarray) -> dict[str, object]:
    """An orthographic view of a box from the unit direction `backward`: the fields of VIEW that say where it looks."""
    right = np.cross([0.0, 0.0, 1.0], backward)
    right /= np.linalg.norm(right)
    up = np.cross(backward, right)
    centre, radius = (low + high) / 2, max(float(np.linalg.norm(high - low)) / 2, 1e-30)
    eye = centre + 2 * radius * backward
    one = np.array([0.0, 0.0, 0.0, 1.0])
    return {
        "row_x": np.append(right, -right @ centre) / radius, "row_y": np.append(up, -up @ centre) / radius,
        "row_w": one, "row_q": 0.5 * one, "eye": (*eye, 1.0), "right": (*right, 0.0), "up": (*up, 0.0),
        "backward": (*backward, 1.0), "frame": (-radius, radius, -radius, radius),
    }  # fmt: skip
