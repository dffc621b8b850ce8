"""The scene's working space: what the three numbers of a scene-linear colour mean.

Blender 5 lets a file choose Linear Rec.709, Linear Rec.2020 or ACEScg. Colours of sockets, lamps, float images and
whatever else Blender hands out are in that space already, and pictures are shown from it. What is made of Rec.709
tables here (8-bit images, skies, spectra) is turned by `from_rec709`, and luminance has other weights.

It belongs to the whole process, as in Blender: `follow` is called at each sync.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

REC709 = "Linear Rec.709"


@dataclass(frozen=True, eq=False)
class WorkingSpace:
    """A space of Blender's colour configuration, relative to a white of D65."""

    name: str
    from_rec709: np.ndarray  # (3, 3), column vectors
    luminance: np.ndarray  # (3,)

    @property
    def usual(self) -> bool:
        """Whether nothing has to be turned."""
        return self.name == REC709


_FROM_REC709 = {
    REC709: np.eye(3),
    "Linear Rec.2020": np.array(
        [[0.6274039, 0.3292831, 0.0433131], [0.0690973, 0.9195403, 0.0113622], [0.0163915, 0.0880133, 0.8955953]]
    ),
    "ACEScg": np.array(
        [[0.6130974, 0.3395232, 0.0473795], [0.0701937, 0.9163539, 0.0134524], [0.0206156, 0.1095698, 0.8698146]]
    ),
}
_LUMINANCE = np.array([0.2126390, 0.7151687, 0.0721923])  # of Rec.709
SPACES = {
    name: WorkingSpace(name, matrix, _LUMINANCE if name == REC709 else _LUMINANCE @ np.linalg.inv(matrix))
    for name, matrix in _FROM_REC709.items()
}
_current = [SPACES[REC709]]


def current() -> WorkingSpace:
    """The space of the last sync."""
    return _current[0]


def follow(name: str) -> WorkingSpace:
    """Take the space of that name for the current one. One that is not known counts as Rec.709."""
    _current[0] = SPACES.get(name, SPACES[REC709])
    return _current[0]
