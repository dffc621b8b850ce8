"""The vitreous body: particles fixed in a gel that turns with the eye's jumps (saccades) and swings back.

    theta'' + 2 g theta' + (g^2 + w^2) theta = sum of impulses v_k at times t_k
    theta(t) = sum over k of v_k exp(-g (t - t_k)) sin(w (t - t_k)) / w

Each third to one and a third of a second the eye jumps and turns the gel by 5 to 20 degrees per second about a random
axis. The source lets the body turn freely with a damped speed, by forward Euler steps; a gel also springs back, so that
the state is bounded and depends on the last seconds only: closed at any time, without those before it.

Source: Ritschel et al. 2009; viscoelastic, after Zimmerman 1980. Damping and impulses are not printed there.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from .noise import at_integers

RADIUS = 8.0  # mm
DECAY = 0.5  # seconds until a swing is down to 1/e
FREQUENCY = 0.8  # swings per second
INTERVAL = 2.0 / 3.0  # seconds between jumps, on average
MEMORY = 12.0 * DECAY  # seconds after which an impulse is below 1e-5
SLOWEST, FASTEST = np.radians(5.0), np.radians(20.0)  # per second
_JUMPS = 4  # stream of noise


def impulses(seconds: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Times (k,) and turns per second (k, 3) of the jumps that are still felt."""
    number = np.arange(np.floor((seconds - MEMORY) / INTERVAL) - 1, np.floor(seconds / INTERVAL) + 1).astype(np.int64)
    drawn = [at_integers(number, seed, 64 * _JUMPS + k) for k in range(4)]
    when = (number + drawn[0]) * INTERVAL
    felt = (when < seconds) & (when > seconds - MEMORY)
    up, around = 2.0 * drawn[1] - 1.0, 2.0 * np.pi * drawn[2]
    flat = np.sqrt(1.0 - up * up)
    axes = np.stack([flat * np.cos(around), flat * np.sin(around), up], axis=-1)
    speed = SLOWEST + (FASTEST - SLOWEST) * drawn[3]
    return when[felt], (axes * speed[:, None])[felt]


def response(age: np.ndarray) -> np.ndarray:
    """Turn after a jump of one turn per second, `age` seconds ago."""
    swing = 2.0 * np.pi * FREQUENCY
    return np.exp(-age / DECAY) * np.sin(swing * age) / swing


def turn_at(seconds: float, seed: int, movement: float = 1.0) -> np.ndarray:
    """(3,) rotation vector in radians."""
    when, speed = impulses(seconds, seed)
    return movement * (response(seconds - when)[:, None] * speed).sum(axis=0)


def rotation(vector: np.ndarray) -> np.ndarray:
    """(3, 3) matrix of a rotation vector (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross)


@cache
def particles(count: int, seed: int) -> np.ndarray:
    """(count, 3) places at rest, uniform in a ball."""
    random = np.random.default_rng((seed, 12))
    direction = random.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return RADIUS * direction * np.cbrt(random.random((count, 1)))
