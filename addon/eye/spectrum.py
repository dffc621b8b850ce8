"""Colours of wavelengths: what each of them adds to a picture's red, green and blue for light of equal energy.

The colour matching functions are the fits of Wyman, Sloan and Shirley 2013 ("Simple analytic approximations to the CIE
XYZ color matching functions"); XYZ to linear Rec. 709 by IEC 61966-2-1. A diffraction pattern of one wavelength holds
for others scaled by their ratio, and its area grows as its square: `table` contains the factor (575 nm / wavelength)^2
that keeps its energy.

A lamp's own spectrum decides how far needles and rings disperse: `of_light` has those of a blackbody (Planck), of a
white LED (a blue line of 455 nm and its phosphor), of a fluorescent tube (lines of mercury, europium and terbium) and
of low-pressure sodium. Each channel's sum stays 1: a picture's own colours say how much red, green and blue a lamp has.

Where only a colour is known, it is upsampled: exp(b t + c t^2), t = (wavelength - 575 nm) / 195 nm, with b and c such
that its chromaticity is the colour's. Planck's law is nearly of that form between 400 and 700 nm, saturated colours
are narrow bands, purples have a dip.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

SHORTEST, RANGE, BASE = 380.0, 390.0, 575.0  # nm
LARGEST_LOOKUP = BASE / SHORTEST  # how much further out than a pixel the shortest wavelength is looked up
ENTRIES = 512
EQUAL, BLACKBODY, COLOUR = "EQUAL", "BLACKBODY", "COLOUR"
Light = tuple[str, object]  # what `of_light` takes
WHITE = (1.0, 1.0, 1.0)
STEPS_PER_OCTAVE, MOST_OCTAVES = 8, 5  # to which a colour's channels are rounded
NARROWEST = 12.0  # nm, standard deviation of an upsampled colour: half the step of 32 wavelengths and more
# Height, nm, standard deviation in nm: at least half the step of 32 wavelengths, which would miss narrower ones.
LINES = {
    "LED": ((1.0, 455.0, 10.0), (0.55, 560.0, 55.0)),
    "FLUORESCENT": ((0.5, 436.0, 6.0), (0.35, 487.0, 6.0), (1.0, 545.0, 6.0), (0.3, 585.0, 8.0), (1.0, 611.0, 6.0)),
    "SODIUM": ((1.0, 589.3, 6.0),),
}  # fmt: skip
LEAST_CHANNEL = 0.05  # of the luminance
TO_REC709 = np.array([
    [3.2404542, -1.5371385, -0.4985314],
    [-0.9692660, 1.8760108, 0.0415560],
    [0.0556434, -0.2040259, 1.0572252],
])  # fmt: skip
_X = ((1.056, 599.8, 0.0264, 0.0323), (0.362, 442.0, 0.0624, 0.0374), (-0.065, 501.1, 0.0490, 0.0382))
_Y = ((0.821, 568.8, 0.0213, 0.0247), (0.286, 530.9, 0.0613, 0.0322))
_Z = ((1.217, 437.0, 0.0845, 0.0278), (0.681, 459.0, 0.0385, 0.0725))


def wavelength(share) -> np.ndarray:
    """Nanometres at a share in [0, 1] of the range."""
    return SHORTEST + RANGE * np.asarray(share, np.float64)


def xyz(nanometres) -> np.ndarray:
    """(..., 3) values of the colour matching functions."""
    nanometres = np.asarray(nanometres, np.float64)[..., None]

    def lobes(fits) -> np.ndarray:
        height, middle, left, right = np.array(fits).T
        away = (nanometres - middle) * np.where(nanometres < middle, left, right)
        return (height * np.exp(-0.5 * away**2)).sum(-1)

    return np.stack([lobes(fits) for fits in (_X, _Y, _Z)], axis=-1)


def of_light(light: str, known, nanometres) -> np.ndarray:
    """Relative power of a kind of lamp at wavelengths. `known`: of a BLACKBODY its kelvin, of a COLOUR its linear
    Rec. 709 as a tuple. KeyError: no such kind."""
    nanometres = np.asarray(nanometres, np.float64)
    if light == EQUAL:
        return np.ones_like(nanometres)
    if light == BLACKBODY:
        exponent = 1.438777e7 / (nanometres * max(known, 100.0))  # hc / k, nm K
        away = exponent - exponent.min()
        return (BASE / nanometres) ** 5 * np.exp(-away) / (1.0 - np.exp(-exponent))
    if light == COLOUR:
        return _bell(nanometres, upsampled(known))[0]
    height, middle, width = np.array(LINES[light]).T
    return (height * np.exp(-0.5 * ((nanometres[..., None] - middle) / width) ** 2)).sum(-1)


def rounded(rgb) -> tuple[float, float, float]:
    """A colour whose largest channel is 1, in few steps: noise of a picture's samples does not make another of it."""
    rgb = np.nan_to_num(np.asarray(rgb, np.float64), nan=0.0, posinf=0.0, neginf=0.0).clip(0.0)
    if not rgb.any():
        return WHITE
    octaves = np.log2(np.maximum(rgb / rgb.max(), 2.0**-MOST_OCTAVES))
    return tuple(2.0 ** (np.round(octaves * STEPS_PER_OCTAVE) / STEPS_PER_OCTAVE))


def _bell(nanometres: np.ndarray, shape) -> tuple[np.ndarray, np.ndarray]:
    """(power, at most 1; (..., 2) what it grows by with the logarithm's two coefficients, over itself)."""
    along = (nanometres - BASE) / (0.5 * RANGE)
    powers = np.stack([along, along**2], axis=-1)
    exponent = powers @ np.asarray(shape)
    return np.exp(exponent - exponent.max()), powers


@lru_cache(maxsize=64)
def upsampled(rgb: tuple[float, float, float]) -> tuple[float, float]:
    """The two coefficients of a smooth spectrum of this chromaticity (linear Rec. 709, no channel below 0), by damped
    least squares; the nearest where none has it."""
    nanometres = wavelength((np.arange(ENTRIES) + 0.5) / ENTRIES)
    matched, wanted = xyz(nanometres), np.linalg.solve(TO_REC709, np.asarray(rgb, np.float64))
    wanted = wanted[:2] / wanted.sum()
    least = -0.5 * (0.5 * RANGE / NARROWEST) ** 2

    def away(shape) -> tuple[np.ndarray, np.ndarray]:
        """(x and y beside those wanted, (2, 2) what they change by with the coefficients)."""
        power, powers = _bell(nanometres, shape)
        seen, slope = power @ matched, (power[:, None] * powers).T @ matched
        share = seen[:2] / seen.sum()
        return share - wanted, (slope[:, :2] - slope.sum(axis=1)[:, None] * share) / seen.sum()

    shape, damping = np.zeros(2), 1e-3
    error, change = away(shape)
    for _ in range(100):
        step = np.linalg.solve(change @ change.T + damping * np.eye(2), change @ error)
        tried = shape - step
        tried[1] = max(tried[1], least)
        found, slope = away(tried)
        if found @ found < error @ error:
            shape, error, change, damping = tried, found, slope, 0.3 * damping
        else:
            damping *= 4.0
        if error @ error < 1e-12 or damping > 1e3:
            break
    return float(shape[0]), float(shape[1])


@lru_cache(maxsize=64)
def table(light: str = EQUAL, known=6500.0) -> np.ndarray:
    """(ENTRIES, 4) float32 at the middles of equal steps of the range: linear RGB with the factor of the area, and
    575 nm over the wavelength. `light`: as of_light takes it."""
    nanometres = wavelength((np.arange(ENTRIES) + 0.5) / ENTRIES)
    scale = BASE / nanometres
    power = of_light(light, known, nanometres)[:, None]
    matched = xyz(nanometres)
    rgb = power * (matched @ TO_REC709.T)
    if light != EQUAL:  # a channel that the lamp has hardly any of is as its luminance
        seen = power * matched[:, 1:2]
        rgb = np.where(rgb.sum(axis=0) > LEAST_CHANNEL * seen.sum(), rgb, seen)
    rgb = rgb / rgb.sum(axis=0) * ENTRIES  # the light itself is this picture's white
    return np.concatenate([rgb * (scale**2)[:, None], scale[:, None]], axis=1).astype(np.float32)


def entry(number, count: int) -> np.ndarray:
    """Entry of the table for wavelength `number` of `count`."""
    return ((np.asarray(number) + 0.5) / count * ENTRIES).astype(int)
