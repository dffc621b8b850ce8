"""The pupil's obstacles at one time, as one list of translucent strokes: discs, fibres and lashes.

    T(x, y) = pupil(x, y) lids(x, y) product over strokes of (1 - opacity where the stroke is)

Shares of the scattering, after the source's table: cornea 25 to 30 %, lens 40 %, vitreous 10 %, retina 20 %, which is
static like the cornea and counted there. `scatter` is the share of the pupil's area that particles cover; by Babinet's
principle it is the share of light that leaves the straight way. The lens scatters more with age, by 1 + (age/62.5)^4
(Vos 2003, the CIE's disability glare).

Particles are of varying size (one half to one and a half of the mean). Strokes thinner than a texel are drawn a texel
wide and as much fainter, so that none vanishes between texels.

Source: Ritschel et al. 2009. Its particles are drawn equally large; its sizes are not printed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from . import crystalline, lids, pupil, vitreous

WINDOW = 10.0  # mm, side of the square that is transformed
CORNEA, LENS, VITREOUS = 0.49, 0.41, 0.10  # shares of the scattering
CORNEA_COUNT, LENS_COUNT, VITREOUS_COUNT = 400, 750, 1700
YOUNG = 25.0  # years, to which `scatter` refers
FIBRE_RADIUS = 0.012  # mm
STROKE = 8  # floats of one: x, y, x, y, radius, radius, opacity, plane
FRONT, MIDDLE, BACK = 0, 1, 2  # planes: cornea and lids; pupil and lens; vitreous body


@dataclass(frozen=True)
class Eye:
    """An observer. All that an artist may set, and keyframe."""

    seed: int = 0
    age: float = 30.0  # years
    pupil: float = 0.0  # mean diameter, mm; 0: by the luminance of what is seen
    before: float = 0.0  # cd/m2 that it saw until `changed`; 0: what it sees now
    changed: float = 0.0  # seconds: when light changed
    restlessness: float = 1.0  # of the pupil (hippus); 1: as measured
    tremor: float = 1.0  # of the lens
    movement: float = 1.0  # of the vitreous body
    scatter: float = 0.1  # share of the pupil that particles cover, at 25 years
    fibres: float = 0.3  # opacity of the lens' fibres
    lashes: float = 1.0  # opacity
    squint: float = 0.0  # 0 to 1
    blink: float = 0.0  # 0 to 1
    blinks_per_minute: float = 0.0


@dataclass(frozen=True, eq=False)
class Aperture:
    """What stands in the way at one time."""

    diameter: float  # of the pupil, mm
    closed: float  # closure of the lids
    strokes: np.ndarray  # (n, STROKE) float32, mm
    light: float  # share of the light that a blink leaves, 0 to 1

    @property
    def obstructed(self) -> float:
        """Share of the pupil that strokes cover, as if none lay over another."""
        x0, y0, x1, y1, r0, r1, opacity, _ = self.strokes.T
        area = np.pi * 0.5 * (r0 * r0 + r1 * r1) + (r0 + r1) * np.hypot(x1 - x0, y1 - y0)
        area = np.minimum(area, np.pi * self.diameter**2 / 4)
        inside = np.hypot(0.5 * (x0 + x1), 0.5 * (y0 + y1)) < 0.5 * self.diameter
        return float(np.minimum((area * opacity)[inside].sum() / (np.pi * self.diameter**2 / 4), 1.0))


def older(age: float) -> float:
    """How much more the lens scatters than at 25 years."""
    return (1.0 + (age / 62.5) ** 4) / (1.0 + (YOUNG / 62.5) ** 4)


def aperture_at(eye: Eye, seconds: float, luminance: float) -> Aperture:
    """The eye at a time, looking at a field of a mean luminance in cd/m2."""
    mean = eye.pupil or float(pupil.mean_diameter(luminance, eye.age))
    if eye.before > 0.0 and not eye.pupil:
        mean = pupil.adapting(seconds - eye.changed, float(pupil.mean_diameter(eye.before, eye.age)), mean)
    diameter = float(pupil.diameter_at(seconds, mean, eye.seed, eye.restlessness))
    blink = max(eye.blink, lids.blinking(seconds, eye.blinks_per_minute, eye.seed))
    closed = float(lids.closure(eye.squint, blink))
    open_before = lids.open_share(diameter, float(lids.closure(eye.squint, 0.0)))
    light = lids.open_share(diameter, closed) / max(open_before, 1e-6)
    strokes = [_discs(*one, plane) for plane, one in enumerate(_particles(eye, seconds, mean))]
    strokes += [_fibres(eye, seconds, mean), _lashes(eye, closed)]
    every = np.concatenate(strokes)
    half = 0.5 * diameter
    lowest = np.minimum(every[:, :2], every[:, 2:4]) - every[:, 4:5].clip(0)
    highest = np.maximum(every[:, :2], every[:, 2:4]) + every[:, 4:5].clip(0)
    seen = (every[:, 6] > 0) & (lowest < half).all(1) & (highest > -half).all(1)
    return Aperture(diameter, closed, every[seen].astype(np.float32), float(min(light, 1.0)))


def _particles(eye: Eye, seconds: float, mean: float):
    """(x, y, radius) of the particles of cornea, lens and vitreous body, mm."""
    full = np.pi * (0.5 * pupil.LARGEST) ** 2
    spread = np.sqrt(13.0 / 12.0)  # root mean square of the sizes in `_sizes`

    def radius(share: float, count: float) -> float:
        return float(np.sqrt(max(eye.scatter * share, 0.0) * full / (np.pi * count))) / spread

    x, y = _cornea(CORNEA_COUNT, eye.seed)
    yield x, y, radius(CORNEA, CORNEA_COUNT) * _sizes(CORNEA_COUNT, eye.seed, 0)
    distance, axis, angle = crystalline.particles(LENS_COUNT, eye.seed)
    pull = crystalline.muscle(seconds, eye.seed, mean, eye.tremor)
    moved = crystalline.deform(distance, axis, pull)
    size = radius(LENS * older(eye.age), LENS_COUNT) * _sizes(LENS_COUNT, eye.seed, 1)
    yield moved * np.cos(angle), moved * np.sin(angle), size
    turn = vitreous.rotation(vitreous.turn_at(seconds, eye.seed, eye.movement))
    x, y, _ = turn @ vitreous.particles(VITREOUS_COUNT, eye.seed).T
    before = VITREOUS_COUNT * (1.0 - (1.0 - (0.5 * pupil.LARGEST / vitreous.RADIUS) ** 2) ** 1.5)
    yield x, y, radius(VITREOUS, before) * _sizes(VITREOUS_COUNT, eye.seed, 2)


@cache
def _cornea(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng((seed, 10))
    distance = 0.5 * pupil.LARGEST * np.sqrt(random.random(count))
    angle = 2.0 * np.pi * random.random(count)
    return distance * np.cos(angle), distance * np.sin(angle)


@cache
def _sizes(count: int, seed: int, layer: int) -> np.ndarray:
    return 0.5 + np.random.default_rng((seed, 14, layer)).random(count)


def _discs(x: np.ndarray, y: np.ndarray, radius: np.ndarray, plane: int) -> np.ndarray:
    return np.stack([x, y, x, y, radius, radius, np.ones_like(x), np.full_like(x, plane)], axis=-1)


def _fibres(eye: Eye, seconds: float, mean: float) -> np.ndarray:
    count = crystalline.FIBRES
    pull = crystalline.muscle(seconds, eye.seed, mean, eye.tremor)
    ends = crystalline.deform(np.array([crystalline.FIBRES_FROM, crystalline.FIBRES_TO]), np.zeros(2), pull)
    angle = 2.0 * np.pi * np.arange(count) / count
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    out = np.zeros((count, STROKE))
    out[:, 0:2], out[:, 2:4] = direction * ends[0], direction * ends[1]
    out[:, 4:6], out[:, 6], out[:, 7] = FIBRE_RADIUS, eye.fibres, MIDDLE
    return out


def _lashes(eye: Eye, closed: float) -> np.ndarray:
    pieces = lids.lashes(closed, eye.seed)
    return np.concatenate([pieces, np.full((len(pieces), 1), eye.lashes), np.zeros((len(pieces), 1))], axis=1)
