"""The lens: particles and fibres that the ciliary muscle's tremor moves.

The lens is a solid of revolution. Half of its section, (radius, axis), is a grid of 17 x 17 masses with springs along
edges and diagonals. The muscle pulls one of them, at the equator, by u(t), some tens of micrometres; so little that the
grid answers linearly. What it answers to a pull of one unit, g(radius, axis), is solved once, and the section at any
time is x + u(t) g(x), without a history. Its own oscillations (10 Hz and more) are damped within a tenth of a second;
they are left out, and `MassSpring.step` is there to show that they die.

    u(t) = amplitude (power noise(1.2 t) + 0.5 sum of three sines between 1.3 and 2.1 Hz)

`power` grows with the pupil as in the source; the measurements it cites are usually quoted the other way round.

Particles are uniform in the volume. The source draws the section's point uniformly, which would crowd them around the
axis like a cataract of the nucleus.

Source: Ritschel et al. 2009. Masses, stiffness and amplitude are not printed there.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from .noise import at_integers, value_noise

SIDE = 17
RADIUS, THICKNESS = 4.5, 4.0  # mm
STIFFNESS = 1e4  # of a spring over a mass, 1/s2
DAMPING = 50.0  # 1/s
AMPLITUDE = 0.03  # mm
FIBRES = 200
FIBRES_FROM, FIBRES_TO = 2.5, 4.4  # mm from the axis: the cortex
_MUSCLE, _NARROW = 2, 3  # streams of noise


@dataclass(frozen=True)
class MassSpring:
    """The linear grid: stiffness (2 n, 2 n) over mass in 1/s2, which coordinates are free, the driven one."""

    rest: np.ndarray  # (SIDE, SIDE, 2) mm, radius and axis
    stiffness: np.ndarray
    free: np.ndarray  # (2 n,) bool
    driven: int  # coordinate that the muscle moves

    def pulled(self) -> np.ndarray:
        """Displacements (SIDE, SIDE, 2) at rest under a pull of one unit."""
        at = self.free.copy()
        shift = np.zeros(len(at))
        shift[self.driven] = 1.0
        force = -self.stiffness @ shift
        shift[at] = np.linalg.solve(self.stiffness[np.ix_(at, at)], force[at])
        return shift.reshape(self.rest.shape)

    def step(self, shift: np.ndarray, speed: np.ndarray, seconds: float) -> tuple[np.ndarray, np.ndarray]:
        """Displacements and speeds (2 n,) after a time step, semi-implicitly; the driven mass is held at rest."""
        speed = (speed - seconds * (self.stiffness @ shift)) / (1.0 + seconds * DAMPING)
        speed = np.where(self.free, speed, 0.0)
        return shift + seconds * speed, speed

    def energy(self, shift: np.ndarray, speed: np.ndarray) -> float:
        """Elastic and kinetic, over mass."""
        return 0.5 * float(shift @ self.stiffness @ shift + speed @ speed)


@cache
def grid() -> MassSpring:
    """The half section: springs along edges and diagonals, masses on the axis that stay on it."""
    radius, axis = np.meshgrid(np.linspace(0, RADIUS, SIDE), np.linspace(-0.5, 0.5, SIDE) * THICKNESS, indexing="ij")
    # Narrower towards the equator, where the muscle's fibres pull.
    axis = axis * np.sqrt(1.0 - 0.96 * (radius / RADIUS) ** 2)
    rest = np.stack([radius, axis], axis=-1)
    stiffness = np.zeros((2 * SIDE * SIDE,) * 2)
    number = np.arange(SIDE * SIDE).reshape(SIDE, SIDE)
    for i, j in ((1, 0), (0, 1), (1, 1), (1, -1)):
        first = number[: SIDE - i, max(-j, 0) : SIDE - max(j, 0)].ravel()
        second = number[i:, max(j, 0) : SIDE + min(j, 0)].ravel()
        for a, b in zip(first, second, strict=True):
            along = rest.reshape(-1, 2)[b] - rest.reshape(-1, 2)[a]
            along = along / np.linalg.norm(along)
            block = STIFFNESS * np.outer(along, along)
            for p, q, sign in ((a, a, 1), (b, b, 1), (a, b, -1), (b, a, -1)):
                stiffness[2 * p : 2 * p + 2, 2 * q : 2 * q + 2] += sign * block
    free = np.ones(2 * SIDE * SIDE, bool)
    free[2 * number[0]] = False  # radius on the axis
    driven = int(2 * number[-1, SIDE // 2])
    free[[driven, driven + 1]] = False
    return MassSpring(rest, stiffness, free, driven)


@cache
def _pulled() -> np.ndarray:
    return grid().pulled()


def deform(radius: np.ndarray, axis: np.ndarray, pull: float) -> np.ndarray:
    """Distance from the axis after a pull of the muscle, mm, of points of the section."""
    half = 0.5 * THICKNESS * np.sqrt(1.0 - 0.96 * np.clip(radius / RADIUS, 0, 1) ** 2)
    i = np.clip(radius / RADIUS * (SIDE - 1), 0, SIDE - 1 - 1e-9)
    j = np.clip((axis / half * 0.5 + 0.5) * (SIDE - 1), 0, SIDE - 1 - 1e-9)
    a, b = i.astype(int), j.astype(int)
    u, v = i - a, j - b
    shift = _pulled()[..., 0]
    near = shift[a, b] * (1 - v) + shift[a, b + 1] * v
    far = shift[a + 1, b] * (1 - v) + shift[a + 1, b + 1] * v
    return radius + pull * (near * (1 - u) + far * u)


def muscle(seconds: float, seed: int, pupil: float, tremor: float = 1.0) -> float:
    """The pull u(t), mm, at a mean pupil diameter in mm."""
    power = np.clip(pupil / 5.0, 0.2, 1.6)
    slow = power * float(value_noise(1.2 * seconds, seed, _MUSCLE))
    drawn = at_integers(np.arange(6), seed, 64 * _NARROW)
    frequencies, phases = 1.3 + 0.8 * drawn[:3], 2.0 * np.pi * drawn[3:]
    narrow = float(np.sin(2.0 * np.pi * frequencies * seconds + phases).mean())
    return tremor * AMPLITUDE * (slow + 0.5 * narrow)


@cache
def particles(count: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Distance from the axis, place along it (mm) and angle of particles that are uniform in the volume, (count,)."""
    random = np.random.default_rng((seed, 11))
    kept = np.zeros((0, 3))
    while len(kept) < count:
        drawn = random.random((4 * count, 3)) * (2 * RADIUS, 2 * RADIUS, THICKNESS) - (RADIUS, RADIUS, THICKNESS / 2)
        inside = (drawn[:, :2] ** 2).sum(1) / RADIUS**2 + (2 * drawn[:, 2] / THICKNESS) ** 2 < 1
        kept = np.concatenate([kept, drawn[inside]])
    x, y, z = kept[:count].T
    return np.hypot(x, y), z, np.arctan2(y, x)
