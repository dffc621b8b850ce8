"""Points of a camera's aperture, so that the mean over samples shows depth of field.

A thin lens maps every point of the plane in focus to one point of the film, whichever part of the aperture the light
takes. One sample looks through one point of it, the same for all pixels, with the frustum sheared about that plane
(Haeberli, Akeley 1990, "The Accumulation Buffer", section 4). Each sample is a sharp picture that any technique can
draw, and the mean converges to the truth at the rate of the sequence (sampling/sequence.py). With n samples a point
that is blurred over more than about n pixels shows as separate copies; more samples are the cure.
"""

from __future__ import annotations

import numpy as np

from ..snapshot.scene import Aperture

RIM = 6  # points that `rim` gives


def point_of(aperture: Aperture, u: float, v: float) -> tuple[float, float]:
    """The point of the aperture for two uniform numbers in [0, 1), metres to the right and up, uniform by area."""
    if aperture.blades < 3:
        radius, angle = np.sqrt(u), 2.0 * np.pi * v
        x, y = radius * np.cos(angle), radius * np.sin(angle)
    else:
        # A triangle between the middle and two corners; within it, sqrt makes the distribution uniform.
        sector = min(int(u * aperture.blades), aperture.blades - 1)
        u = np.sqrt(u * aperture.blades - sector)
        angles = aperture.rotation + np.pi * (2 * sector + np.array([-1.0, 1.0])) / aperture.blades
        x, y = (u * ((1.0 - v) * f(angles[0]) + v * f(angles[1])) for f in (np.cos, np.sin))
    return float(aperture.radius * x / aperture.ratio), float(aperture.radius * y)


def rim(aperture: Aperture) -> list[tuple[float, float]]:
    """Points around the edge of the aperture: what they see and the middle sees is about all that any point sees."""
    angles = 2.0 * np.pi * np.arange(RIM) / RIM
    return [(float(aperture.radius * np.cos(a) / aperture.ratio), float(aperture.radius * np.sin(a))) for a in angles]
