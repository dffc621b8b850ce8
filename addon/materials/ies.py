"""Light profiles (IES files, IESNA LM-63) as tables that the IES Texture node looks up by direction.

A file lists candela by vertical and horizontal angle. Blender means watts of a lamp that shines alike in all
directions, so candela are turned by 4 pi / 177.83, the efficacy of daylight (D65). Between angles the profile is
interpolated by Catmull-Rom splines along both, and is not negative; outside of the vertical angles that the file has
there is no light. Type C files measure vertical angles from straight down (-Z); types A and B lie on their side.

The table has half a degree a texel: columns over 0 to 360 degrees of the horizontal angle, rows over 0 to 180 of the
vertical one. Source of the format: ANSI/IESNA LM-63.
"""

from __future__ import annotations

import re
import zlib
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

WIDTH, HEIGHT = 721, 361
WATTS_PER_CANDELA = 4 * np.pi / 177.83
UNREADABLE = 100.0  # what Cycles' node gives, times its strength, where there is no profile
TYPE_C, TYPE_B, TYPE_A = 1, 2, 3


@dataclass(frozen=True)
class Profile:
    """The text of an IES file; empty where there is none."""

    text: str

    @property
    def name(self) -> str:
        """Equal for equal files."""
        return f"profile {zlib.crc32(self.text.encode()):08x} {len(self.text)}"


@lru_cache(maxsize=32)
def profile_pixels(profile: Profile) -> tuple[np.ndarray, str]:
    """(HEIGHT, WIDTH, 4) float32, grey, and what has to be said about it."""
    try:
        vertical, horizontal, watts, kind = _measured(profile.text)
    except (ValueError, IndexError):
        text = "the light profile is missing or cannot be read; the node gives 100 times its strength, as in Cycles."
        return np.full((HEIGHT, WIDTH, 4), UNREADABLE, np.float32), text
    asked = np.linspace(0.0, 180.0, HEIGHT)
    rows = np.stack([_along(vertical, line, asked, wraps=False) for line in watts])
    table = np.stack([_along(horizontal, column, np.linspace(0, 360, WIDTH), wraps=True) for column in rows.T])
    table = np.maximum(table, 0.0)
    table[(asked < vertical[0]) | (asked > vertical[-1])] = 0.0
    remark = "" if kind == TYPE_C else "light profiles of the types A and B may be turned; use one of type C."
    return np.repeat(table[..., None], 4, axis=2).astype(np.float32), remark


def _measured(text: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """Vertical angles (V) and horizontal ones from 0 to 360 (H), degrees, watts (H, V), type. Raises ValueError."""
    tilt = re.search(r"^\s*TILT\s*=\s*(\S+).*$", text, re.MULTILINE)
    if tilt is None:
        raise ValueError("no TILT line")
    numbers = [float(word) for word in re.split(r"[\s,]+", text[tilt.end() :].strip()) if word]
    if tilt.group(1) == "INCLUDE":
        numbers = numbers[2 + 2 * int(numbers[1]) :]
    factor = numbers[2] * numbers[10] * numbers[11] * WATTS_PER_CANDELA
    count, lines, kind = (int(numbers[k]) for k in (3, 4, 5))
    if count < 2 or lines < 1 or kind not in (TYPE_A, TYPE_B, TYPE_C):
        raise ValueError("no angles")
    start = 13
    vertical = np.array(numbers[start : start + count])
    horizontal = np.array(numbers[start + count : start + count + lines])
    values = np.array(numbers[start + count + lines : start + count + lines + count * lines])
    watts = values.reshape(lines, count) * factor
    if kind == TYPE_C:
        return *_around(vertical, horizontal, watts), kind
    return *_on_its_side(vertical, horizontal, watts, kind), kind


def _around(vertical, horizontal, watts):
    """Of type C: horizontal angles of a quadrant or half are mirrored to the whole round."""
    if horizontal[0] == 90.0:
        horizontal = horizontal - 90.0
    if horizontal[0] != 0.0:
        raise ValueError("horizontal angles that do not begin at 0")
    if len(horizontal) == 1:
        return vertical, np.array([0.0, 360.0]), np.repeat(watts, 2, axis=0)
    for edge in (90.0, 180.0):
        if horizontal[-1] == edge:
            horizontal = np.concatenate([horizontal, 2 * edge - horizontal[-2::-1]])
            watts = np.concatenate([watts, watts[-2::-1]])
    if horizontal[-1] < 360.0:
        horizontal, watts = np.append(horizontal, 360.0), np.concatenate([watts, watts[:1]])
    return vertical, horizontal, watts


def _on_its_side(vertical, horizontal, watts, kind: int):
    """Of types A and B: a grid about a horizontal axis, whose halves are mirrored, as one of type C about that axis."""
    if kind == TYPE_B:
        vertical, horizontal, watts = horizontal, vertical, watts.T
    if horizontal[-1] != 90.0 or vertical[-1] != 90.0:
        raise ValueError("angles that do not end at 90")
    if horizontal[0] == 0.0:
        horizontal, watts = np.concatenate([-horizontal[:0:-1], horizontal]), np.concatenate([watts[:0:-1], watts])
    if vertical[0] == 0.0:
        vertical = np.concatenate([-vertical[:0:-1], vertical])
        watts = np.concatenate([watts[:, :0:-1], watts], axis=1)
    return vertical + 90.0, np.append(horizontal + 90.0, 360.0), np.concatenate([watts, watts[:1]])


def _along(angles: np.ndarray, values: np.ndarray, asked: np.ndarray, wraps: bool) -> np.ndarray:
    """Catmull-Rom spline through values at angles, as if those were evenly spaced."""
    k = np.clip(np.searchsorted(angles, asked, side="right") - 1, 0, len(angles) - 2)
    t = np.clip((asked - angles[k]) / np.maximum(angles[k + 1] - angles[k], 1e-9), 0.0, 1.0)
    last = len(angles) - 1

    def value(at: np.ndarray) -> np.ndarray:
        if wraps:  # the last one is the first
            return values[np.where(at < 0, last - 1, np.where(at > last, 1, at))]
        low = values[1] if angles[0] < 0.1 else 0.0  # beyond a pole the profile comes back
        high = values[last - 1] if angles[-1] > 179.9 else 0.0
        return np.where(at < 0, low, np.where(at > last, high, values[np.clip(at, 0, last)]))

    a, b, c, d = (value(k + shift) for shift in (-1, 0, 1, 2))
    return 0.5 * (d + 3 * (b - c) - a) * t**3 + (a - 2.5 * b + 2 * c - 0.5 * d) * t**2 + 0.5 * (c - a) * t + b
