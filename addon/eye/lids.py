"""Lids and lashes: where the lids' edges are at a closure between open (0) and shut (1), the lashes that hang from
them, and when an eye blinks by itself.

    upper(x) = lerp(5.0, -2.4, closure) - x^2 / 24       lower(x) = lerp(-5.0, -2.2, closure) + x^2 / 40   (mm)

Open lids leave a pupil of 9 mm free. A blink takes 0.1 s down, 0.05 s shut and 0.2 s up. Lashes look longer the further
the lid has come down, since they then stand across the line of sight.

Source: Ritschel et al. 2009 moves bitmaps of lids and lashes; curves need none, and are sharp at any size.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from .noise import at_integers

UPPER_OPEN, UPPER_SHUT, UPPER_BEND = 5.0, -2.4, 24.0
LOWER_OPEN, LOWER_SHUT, LOWER_BEND = -5.0, -2.2, 40.0
SQUINT = 0.6  # closure of the tightest squint
CLOSING, SHUT, OPENING = 0.1, 0.05, 0.2  # seconds
UPPER_LASHES, LOWER_LASHES = 90, 45
PARTS = 3  # straight pieces of a lash
ROOT, TIP = 0.05, 0.012  # radius, mm
_BLINKS = 5  # stream of noise


def closure(squint: float, blink: float) -> float:
    """How far the lids are closed, 0 to 1, by a lasting squint and a blink, both 0 to 1."""
    return 1.0 - (1.0 - SQUINT * np.clip(squint, 0.0, 1.0)) * (1.0 - np.clip(blink, 0.0, 1.0))


def heights(closed: float) -> tuple[float, float]:
    """Of the edges' middles, upper and lower, mm."""
    return UPPER_OPEN + (UPPER_SHUT - UPPER_OPEN) * closed, LOWER_OPEN + (LOWER_SHUT - LOWER_OPEN) * closed


def edges(x, closed: float) -> tuple[np.ndarray, np.ndarray]:
    """Heights of the upper and the lower edge at x, mm."""
    upper, lower = heights(closed)
    x2 = np.square(x)
    return upper - x2 / UPPER_BEND, lower + x2 / LOWER_BEND


def open_share(diameter: float, closed: float) -> float:
    """Share of a pupil's area that the lids leave free."""
    x = (np.arange(256) + 0.5) / 256 * diameter - diameter / 2
    half = np.sqrt(diameter**2 / 4 - x * x)
    upper, lower = edges(x, closed)
    free = np.clip(np.minimum(upper, half) - np.maximum(lower, -half), 0.0, None)
    return float(free.sum() / (2 * half).sum())


def blinking(seconds: float, per_minute: float, seed: int) -> float:
    """Blinks that come by themselves: 0 (open) to 1 (shut)."""
    if per_minute <= 0.0:
        return 0.0
    interval = max(60.0 / per_minute, 2.0 * (CLOSING + SHUT + OPENING))
    number = int(np.floor(seconds / interval))
    room = interval - (CLOSING + SHUT + OPENING)
    since = seconds - number * interval - room * float(at_integers(number, seed, 64 * _BLINKS))
    if since < 0.0 or since > CLOSING + SHUT + OPENING:
        return 0.0
    down = min(since / CLOSING, 1.0)
    up = np.clip((since - CLOSING - SHUT) / OPENING, 0.0, 1.0)
    share = min(down, 1.0 - up)
    return float(share * share * (3.0 - 2.0 * share))


@cache
def _drawn(count: int, seed: int, row: int) -> np.ndarray:
    return np.random.default_rng((seed, 13, row)).random((count, 4))


def lashes(closed: float, seed: int) -> np.ndarray:
    """(n, 6) straight pieces: both ends (x, y, x, y) and radii there, mm."""
    pieces = []
    for row, (count, down, length) in enumerate(((UPPER_LASHES, -1.0, 2.6), (LOWER_LASHES, 1.0, 1.4))):
        place, size, fan, bend = _drawn(count, seed, row).T
        x = (np.arange(count) + 0.2 + 0.6 * place) / count * 13.0 - 6.5
        y = edges(x, closed)[row]
        reach = length * (0.7 + 0.6 * size) * (0.3 + 0.9 * closed)
        slope = 0.09 * x + 0.5 * (fan - 0.5)
        along = np.linspace(0.0, 1.0, PARTS + 1)[:, None]
        points_x = x + reach * (slope * along + (0.25 * (bend - 0.5) + 0.02 * x) * along**2)
        points_y = y + down * reach * (along - 0.25 * along**2)
        radius = np.broadcast_to(ROOT + (TIP - ROOT) * along, points_x.shape)
        ends = np.stack([points_x[:-1], points_y[:-1], points_x[1:], points_y[1:], radius[:-1], radius[1:]], axis=-1)
        pieces.append(ends.reshape(-1, 6))
    return np.concatenate(pieces)
