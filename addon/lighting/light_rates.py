"""Sampling rates: the number of points of each light in a sample, as light probes found it, for the light loop."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..frame.picture import Frame
from ..frame.technique import Service
from ..sources.rates import Rate

WORLD = "world"  # its name among the rates


@dataclass
class LightRates(Service):
    """Rates of lights by key, where it is not one point per sample; and what each probe of a grid sees of the world,
    (rows, columns, guide rows, guide columns), None where nobody has looked.

    `variance`: relMSE that one point of a light leaves; `of_points`: rates with which points of every light would be
    drawn. Both by key, empty where nobody has measured."""

    name = "rates"
    by_light: dict[str, Rate] = field(default_factory=dict)
    world_seen: np.ndarray | None = None
    variance: dict[str, float] = field(default_factory=dict)
    of_points: dict[str, Rate] = field(default_factory=dict)


def rate_of(frame: Frame, key: str) -> Rate:
    """How often the light `key`, or WORLD, is sampled; once per sample where nothing else was found."""
    rates = frame.service(LightRates)
    return Rate() if rates is None else rates.by_light.get(key, Rate())


def world_rate(frame: Frame) -> Rate | None:
    """The rate of directions of the world, where probes have found one."""
    rates = frame.service(LightRates)
    return None if rates is None else rates.by_light.get(WORLD)


@dataclass
class PointsDrawn(Service):
    """Points of each lamp per sample, by its light's key, as direct light draws them."""

    name = "points_drawn"
    per_sample: dict[str, float] = field(default_factory=dict)


@dataclass
class EmissivePoints(Service):
    """Power of all emissive triangles, and how many points of them a sample draws."""

    name = "emissive"
    power: float = 0.0
    count: float = 1.0
