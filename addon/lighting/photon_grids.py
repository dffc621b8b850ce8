"""How many photons a light sends towards a box of casters: what the picture could show of them, and what they carry.

A side of the grid has at most PER_PIXEL photons for each pixel that the box is wide, seen from as near as its caustic
may lie: footprints far below a pixel show nothing more. And a light that brings a box less power than another brings
one has a coarser grid. With footprints as wide as the distance of photons the squared error of a bundle falls as the
fourth power of that, so that a given number of photons leaves the least of it if

    side ~ power^(1/3)

Neither changes the mean: only the footprints' width, which falls with samples as photons.py says.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..frame.picture import Frame
from ..sources import lights

PER_PIXEL = 2.0
NEARER = 2.0  # diagonals of a box by which its caustic may lie nearer to the camera
FEWEST_SIDE = 64
FAINTEST = 0.5  # of the side that the brightest has: that one may be hidden where the faint one shines


def sides(frame: Frame, sources: Sequence, boxes: Sequence, side: int) -> np.ndarray:
    """(lights, boxes): photons along each side of the grids, `side` at most."""
    low, high = (np.array([box[k] for box in boxes]) for k in range(2))
    across, centre = np.linalg.norm(high - low, axis=1), (low + high) / 2
    shown = PER_PIXEL * across / _pixel(frame, centre, across)
    carried = np.array([[_power(one, *box) for box in zip(centre, across)] for one in sources]).reshape(-1, len(low))
    brightest = max(carried[np.isfinite(carried)].max(initial=0.0), 1e-30)
    share = np.clip(np.minimum(carried / brightest, 1.0) ** (1.0 / 3.0), FAINTEST, 1.0)
    least = min(side, FEWEST_SIDE)
    found = share * np.clip(shown, least, side)
    return np.nan_to_num(np.clip(found, least, side), nan=side).round().astype(int)


def _pixel(frame: Frame, centre: np.ndarray, across: np.ndarray) -> np.ndarray:
    """Metres that a pixel shows where caustics of the boxes may be nearest to the camera."""
    camera, film = frame.view.camera, frame.view.film
    if camera.from_above:
        return np.full(len(across), 1e-30)  # a bake: what a texel shows is not known here
    one = (camera.frame[1] - camera.frame[0]) / film.width
    if camera.kind == "ORTHOGRAPHIC":
        return np.full(len(across), one)
    eye = camera.matrix[:3, 3] - frame.view.origin
    away = np.linalg.norm(centre - eye, axis=1) - NEARER * across
    return one * np.maximum(away, 1e-30)


def _power(source, centre: np.ndarray, across: float) -> float:
    """What a light brings to a box that large, W; of what is no lamp as much as any."""
    if getattr(source, "light", None) is None:
        return np.inf
    if source.kind == lights.SUN:
        return source.power * across**2
    squared = float(np.sum((centre - source.position(source.middle())) ** 2))
    return source.power / (4.0 * np.pi) * across**2 / max(squared, across**2 / 4.0)
