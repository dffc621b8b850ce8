"""Light profiles (IES files, IESNA LM-63) as tables that the IES Texture node looks up by direction.

A file lists candela by vertical and horizontal angle. Blender means watts of a lamp that shines alike in all
directions, so candela are turned by 4 pi / 177.83, the efficacy of daylight (D65). Between angles the profile is
interpolated by Catmull-Rom splines along both, and is not negative; outside of the angles that the file has there is no
light. Type C files measure vertical angles from straight down (-Z). Types A and B lie on their side; they are placed as
Cycles places them, by angles alone: 90 degrees further, of type B with the two angles changed for one another, so that
B fills half of the round only. A lamp of these types is turned by hand, in both engines alike.

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
MOST_ANGLES = 3600  # along either way: a tenth of a degree
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
def profile_pixels(profile: Profile, fades: bool = False) -> tuple[np.ndarray, str]:
    """(HEIGHT, WIDTH, 4) float32, grey, and what has to be said about it. `fades`: whether splines end as if there was
    no light beyond the first and last angle, as in Blender before 5.0; else as if it went on."""
    try:
        vertical, horizontal, watts = _measured(profile.text)
    except (ValueError, IndexError, OverflowError):
        text = "the light profile is missing or cannot be read; the node gives 100 times its strength, as in Cycles."
        return np.full((HEIGHT, WIDTH, 4), UNREADABLE, np.float32), text
    rows, columns = np.linspace(0.0, 180.0, HEIGHT), np.linspace(0.0, 360.0, WIDTH)
    closed = horizontal[0] < 1e-4 and horizontal[-1] > 359.9999
    # Beyond a pole the profile comes back; where the round is closed, it goes on.
    ends = [1 if vertical[0] < 1e-4 else None, len(vertical) - 2 if vertical[-1] > 179.9999 else None]
    around = [len(horizontal) - 2, 1] if closed else [None, None]
    table = np.stack([_along(vertical, line, rows, *ends, -1, fades) for line in watts])
    table = np.stack([_along(horizontal, line, columns, *around, -2, fades) for line in table.T])
    table *= _inside(rows, vertical, (0.0, 180.0))[:, None] * _inside(columns, horizontal, (0.0, 360.0))
    return np.repeat(np.maximum(table, 0.0)[..., None], 4, axis=2).astype(np.float32), ""


def _measured(text: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertical angles (V) and horizontal ones (H), degrees as of the table, watts (H, V). Raises ValueError."""
    tilt = re.search(r"^\s*TILT\s*=\s*(\S+).*$", text, re.MULTILINE)
    if tilt is None:
        raise ValueError("no TILT line")
    numbers = [float(word) for word in re.split(r"[\s,]+", text[tilt.end() :].strip()) if word]
    if tilt.group(1) == "INCLUDE":
        numbers = numbers[2 + 2 * int(numbers[1]) :]
    factor = numbers[2] * numbers[10] * numbers[11] * WATTS_PER_CANDELA
    count, lines, kind = (int(numbers[k]) for k in (3, 4, 5))
    if not (2 <= count <= MOST_ANGLES and 1 <= lines <= MOST_ANGLES) or kind not in (TYPE_A, TYPE_B, TYPE_C):
        raise ValueError("no angles, or too many")
    start = 13
    vertical = np.array(numbers[start : start + count])
    horizontal = np.array(numbers[start + count : start + count + lines])
    values = np.array(numbers[start + count + lines : start + count + lines + count * lines])
    watts = values.reshape(lines, count) * factor
    if not all(np.isfinite(one).all() for one in (vertical, horizontal, watts)) or np.abs(watts).max() > 1e30:
        raise ValueError("no finite values")
    if kind == TYPE_A:
        if horizontal[0] != 0.0:
            horizontal, watts = -horizontal[::-1], watts[::-1]
        horizontal, watts = _mirrored(horizontal, watts)
        return vertical + 90.0, horizontal + 180.0, watts
    if kind == TYPE_B:
        across, watts = _mirrored(vertical, watts.T)
        up, watts = _mirrored(horizontal, watts.T)
        return up + 90.0, across + 90.0, watts.T
    return _around(vertical, horizontal, watts)


def _mirrored(angles, values):
    """Angles (N) that begin at 0, and values (N, ...), continued to the other side of it; others as they are."""
    if angles[0] != 0.0:
        return angles, values
    return np.concatenate([-angles[:0:-1], angles]), np.concatenate([values[:0:-1], values])


def _around(vertical, horizontal, watts):
    """Of type C: horizontal angles of a quadrant or half are mirrored to the whole round."""
    if horizontal[0] == 90.0:
        horizontal = horizontal - 90.0
    if len(horizontal) == 1:
        return vertical, np.array([0.0, 360.0]), np.repeat(watts, 2, axis=0)
    for edge in (90.0, 180.0):
        if horizontal[-1] == edge:
            horizontal = np.concatenate([horizontal, 2 * edge - horizontal[-2::-1]])
            watts = np.concatenate([watts, watts[-2::-1]])
    gap, steps = 360.0 - horizontal[-1], np.diff(horizontal)
    if horizontal[0] == 0.0 and np.abs(steps[[0, -1]] - gap).min() < 1e-4:  # the file leaves out the first one's like
        horizontal, watts = np.append(horizontal, 360.0), np.concatenate([watts, watts[:1]])
    return vertical, horizontal, watts


def _inside(asked: np.ndarray, angles: np.ndarray, ends: tuple[float, float]) -> np.ndarray:
    """1 between the first and the last of the angles, 0 beyond them, where nothing shines, and half between both: so
    what is read between texels has its right mean. Not at `ends`, which have nothing beyond them."""
    known = (asked >= angles[0]) & (asked <= angles[-1])
    edge = ((asked == angles[0]) & (angles[0] != ends[0])) | ((asked == angles[-1]) & (angles[-1] != ends[1]))
    return known - 0.5 * edge


def _along(angles, values, asked, before: int | None, after: int | None, last: int, fades: bool) -> np.ndarray:
    """Catmull-Rom spline through values at angles, as if those were evenly spaced. `before`, `after`: numbers of the
    values that stand beyond the first and the last angle. None: nothing does; the spline then ends as `fades` says, or
    with the first value before, and after with value number `last` (Cycles takes the last one of vertical angles, that
    before it of horizontal ones)."""
    k = np.clip(np.searchsorted(angles, asked, side="right") - 1, 0, len(angles) - 2)
    t = np.clip((asked - angles[k]) / np.maximum(angles[k + 1] - angles[k], 1e-9), 0.0, 1.0)
    first = (0.0 if fades else values[0]) if before is None else values[before]
    final = (0.0 if fades else values[last]) if after is None else values[after]
    padded = np.concatenate([[first], values, [final]])
    a, b, c, d = (padded[k + shift] for shift in range(4))
    return 0.5 * (d + 3 * (b - c) - a) * t**3 + (a - 2.5 * b + 2 * c - 0.5 * d) * t**2 + 0.5 * (c - a) * t + b
