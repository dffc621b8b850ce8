"""From an aperture to the point spread function and to a picture, in numpy: the reference for what the GPU does, step
by step with the same definitions (addon/eye/point_spread.py, addon/eye/scatter.py).

    field      T exp(i pi dD (x^2 + y^2) / lambda)        a residual defocus of dD dioptres; Fraunhofer for 0
    planes     field of the cornea, carried on to the pupil and from there to the vitreous body, what stands there
               multiplied with it (Fresnel propagation, as the reference of the source has it), if asked for
    intensity  |F{field}|^2 at 575 nm, one texel = lambda / window in angle
    colours    sum over wavelengths of rgb(lambda) intensity(x 575 / lambda)
    kernel     the colours over the picture's pixels, box-averaged, each channel over its whole sum, and beneath the
               core no more than at its rim
    picture    I - s w H + s (H * kernel), H what exceeds white, w the kernel's sum, s the strength

The lens of an eye cancels the quadratic phase of free space over 20 mm, which no grid could hold; what is left of it is
the defocus. `magnification` enlarges angles: 200 drawn fibres put the halo at a third of a degree, the eye's own 2000
at three degrees.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from . import lids, spectrum
from .aperture import MIDDLE, WINDOW, Aperture

NANOMETRE = 1e-6  # mm
FADE_FROM = 0.5  # of the usable radius, where the pattern begins to fade out
MOST_WAVELENGTHS = 256
STEPS_PER_TEXEL = 0.68  # wavelengths per texel of radius that leave no gap between a ring and the next
LEAST_CORE = 1.5  # pixels
NO_EDGE = 100.0  # mm, of a pupil, and a closure of lids, that are beyond all that is drawn
RIM = 1.5  # of the core's radius, where the tail has taken over


@dataclass(frozen=True)
class Scale:
    """How a pattern of `side` texels lies on a picture."""

    side: int  # texels of the pattern
    per_pixel: float  # texels of the pattern along one pixel
    core: float  # radius in pixels within which light counts as unscattered
    reach: int  # pixels from the kernel's middle to its rim

    @property
    def extent(self) -> int:
        """Pixels along the kernel's side."""
        return 2 * self.reach + 1


def usable_radius(side: int) -> float:
    """Texels from the middle up to which all wavelengths are inside of the pattern."""
    return 0.5 * side / spectrum.LARGEST_LOOKUP - 1.0


def degrees_per_texel() -> float:
    return float(np.degrees(spectrum.BASE * NANOMETRE / WINDOW))


def scale_of(
    side: int, degrees_per_pixel: float, magnification: float, diameter: float, defocus: float, longest: int
) -> Scale:
    """`diameter` of the pupil in mm, `defocus` in dioptres; `longest`: pixels beyond which no kernel reaches."""
    per_pixel = max(degrees_per_pixel / (degrees_per_texel() * magnification), 1e-3)
    blur = 0.5 * diameter * 1e-3 * defocus  # radians, radius of the disc of confusion
    core = 1.3 * (1.22 * WINDOW / diameter + np.degrees(blur) / degrees_per_texel())
    reach = int(np.clip(np.ceil(usable_radius(side) / per_pixel), 1, longest))
    return Scale(side, per_pixel, max(core / per_pixel, LEAST_CORE), reach)


# ------------------------------------------------------------------------------------------------------------ aperture


def transmittance(aperture: Aperture, side: int, supersampling: int = 2) -> np.ndarray:
    """(side, side) float64, 1 where the aperture is open, row 0 at the bottom."""
    fine = side * supersampling
    texel = WINDOW / fine
    place = (np.arange(fine) + 0.5) * texel - WINDOW / 2
    x, y = np.meshgrid(place, place)
    upper, lower = lids.edges(x, aperture.closed)
    open_part = np.clip(0.5 + (aperture.diameter / 2 - np.hypot(x, y)) / texel, 0, 1)
    open_part *= np.clip(0.5 + (upper - y) / texel, 0, 1) * np.clip(0.5 + (y - lower) / texel, 0, 1)
    for stroke in aperture.strokes.astype(np.float64):
        ends, radii, opacity = stroke[:4].reshape(2, 2), stroke[4:6], stroke[6]
        reach = max(radii.max(), 0.5 * texel) + texel
        low = np.clip(np.floor((ends.min(0) - reach + WINDOW / 2) / texel), 0, fine).astype(int)
        high = np.clip(np.ceil((ends.max(0) + reach + WINDOW / 2) / texel) + 1, 0, fine).astype(int)
        box = np.s_[low[1] : high[1], low[0] : high[0]]
        open_part[box] *= 1.0 - opacity * _coverage(x[box], y[box], ends, radii, texel)
    return open_part.reshape(side, supersampling, side, supersampling).mean(axis=(1, 3))


def _coverage(x, y, ends, radii, texel: float) -> np.ndarray:
    along = ends[1] - ends[0]
    length2 = float(along @ along)
    px, py = x - ends[0, 0], y - ends[0, 1]
    share = np.clip((px * along[0] + py * along[1]) / length2, 0, 1) if length2 > 0 else np.zeros_like(px)
    distance = np.hypot(px - share * along[0], py - share * along[1])
    radius = radii[0] + (radii[1] - radii[0]) * share
    drawn = np.maximum(radius, 0.5 * texel)
    fade = radius / drawn if length2 > 0 else radius**2 / (drawn**2 + texel**2 / 12)
    return fade * np.clip(0.5 + (drawn - distance) / texel, 0, 1)


# --------------------------------------------------------------------------------------------------------- diffraction


def field(open_part: np.ndarray, defocus: float, nanometres: float = spectrum.BASE) -> np.ndarray:
    """Complex amplitude behind the aperture. `defocus` in dioptres (1/m)."""
    side = len(open_part)
    place = ((np.arange(side) + 0.5) / side - 0.5) * WINDOW
    r2 = place[None] ** 2 + place[:, None] ** 2
    return open_part * np.exp(1j * np.pi * defocus * 1e-3 * r2 / (nanometres * NANOMETRE))


# How far the planes of aperture.py lie apart, mm, as in a beam that does not converge: dz fp^2 / (f1 f2) over the index
# 1.336, f1 and f2 their distances from the retina (24, 20 and 10 mm), fp that of the pupil, in whose size all is drawn.
APART = (4.0 * 20.0 / 24.0 / 1.336, 10.0 * 20.0 / 10.0 / 1.336)


def carried(amplitude: np.ndarray, distance: float, nanometres: float = spectrum.BASE) -> np.ndarray:
    """The field a distance (mm) further on, by Fresnel's transfer function."""
    side = len(amplitude)
    step = np.fft.fftfreq(side, WINDOW / side)
    squared = step[None] ** 2 + step[:, None] ** 2
    transfer = np.exp(-1j * np.pi * nanometres * NANOMETRE * distance * squared)
    return np.fft.ifft2(np.fft.fft2(amplitude) * transfer)


def through_planes(planes: Sequence[np.ndarray], defocus: float) -> np.ndarray:
    """The amplitude behind the last of the planes' transmittances, each (side, side)."""
    amplitude = field(planes[0], defocus)
    for distance, open_part in zip(APART, planes[1:]):
        amplitude = carried(amplitude, distance) * open_part
    return amplitude


def plane_of(aperture: Aperture, plane: int) -> Aperture:
    """What stands in one plane: its strokes, and in the middle one pupil and lids."""
    strokes = aperture.strokes[aperture.strokes[:, 7] == plane]
    return replace(aperture, strokes=strokes) if plane == MIDDLE else Aperture(NO_EDGE, -NO_EDGE, strokes, 1.0)


def intensity(amplitude: np.ndarray) -> np.ndarray:
    """|F|^2, the straight direction at (side / 2, side / 2); unnormalised."""
    return np.abs(np.fft.fftshift(np.fft.fft2(amplitude))) ** 2


def bilinear(image: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Between texels of (H, W, …), whose centres are whole numbers here; zero outside."""
    i, j = np.floor(x).astype(int), np.floor(y).astype(int)
    u, v = x - i, y - j
    extra = (1,) * (image.ndim - 2)
    total = np.zeros((*x.shape, *image.shape[2:]))
    for a, b, weight in ((0, 0, (1 - u) * (1 - v)), (1, 0, u * (1 - v)), (0, 1, (1 - u) * v), (1, 1, u * v)):
        inside = (i + a >= 0) & (i + a < image.shape[1]) & (j + b >= 0) & (j + b < image.shape[0])
        taken = image[np.clip(j + b, 0, image.shape[0] - 1), np.clip(i + a, 0, image.shape[1] - 1)]
        total += (weight * inside).reshape(*x.shape, *extra) * taken
    return total


def wavelengths_at(radius: np.ndarray, least: int, most: int = MOST_WAVELENGTHS) -> np.ndarray:
    """How many are summed at a distance of texels from the middle."""
    return np.clip(np.ceil(STEPS_PER_TEXEL * radius), least, max(most, least)).astype(int)


def colours(pattern: np.ndarray, least: int = 32, most: int = MOST_WAVELENGTHS) -> np.ndarray:
    """(side, side, 3) linear RGB, not negative, from |F|^2 at 575 nm."""
    side = len(pattern)
    y, x = np.mgrid[0:side, 0:side] - side // 2
    radius = np.hypot(x, y)
    usable = usable_radius(side)
    fade = np.clip((usable - radius) / ((1 - FADE_FROM) * usable), 0, 1)
    fade = fade * fade * (3 - 2 * fade)
    count = wavelengths_at(radius, least, most)
    out = np.zeros((side, side, 3))
    for number in range(count.max()):
        on = (number < count) & (fade > 0)
        row = spectrum.table()[((number + 0.5) / count[on] * spectrum.ENTRIES).astype(int)].astype(np.float64)
        found = bilinear(pattern, x[on] * row[:, 3] + side // 2, y[on] * row[:, 3] + side // 2)
        out[on] += row[:, :3] * (found / count[on])[:, None]
    return np.maximum(out, 0.0) * fade[..., None]


def over_pixels(pattern: np.ndarray, scale: Scale) -> np.ndarray:
    """(extent, extent, 3) the pattern over the picture's pixels, each channel's sum 1 (or 0 where nothing is open)."""
    steps = max(int(np.ceil(scale.per_pixel)), 1)
    inside = (np.arange(steps) + 0.5) / steps - 0.5
    place = (np.arange(-scale.reach, scale.reach + 1)[:, None] + inside).ravel() * scale.per_pixel + scale.side // 2
    x, y = np.meshgrid(place, place)
    fine = bilinear(pattern, x, y)
    kernel = fine.reshape(scale.extent, steps, scale.extent, steps, 3).mean(axis=(1, 3))
    return kernel / np.maximum(kernel.sum(axis=(0, 1)), 1e-30)


def rim(scale: Scale) -> np.ndarray:
    """(extent, extent) True where the core ends, between once and one and a half times its radius."""
    offset = np.arange(-scale.reach, scale.reach + 1)
    radius = np.hypot(offset[None], offset[:, None])
    return (radius >= scale.core) & (radius < RIM * scale.core)


def tail(kernel: np.ndarray, scale: Scale) -> np.ndarray:
    """A kernel without the light of its core: scattered light goes on beneath it, as much as at its rim."""
    offset = np.arange(-scale.reach, scale.reach + 1)
    radius = np.hypot(offset[None], offset[:, None])
    share = np.clip((radius / scale.core - 1.0) / (RIM - 1.0), 0, 1)
    share = (share * share * (3 - 2 * share))[..., None]
    at_rim = rim(scale)
    beneath = kernel[at_rim].mean(axis=0) if at_rim.any() else np.zeros(3)
    return share * kernel + (1.0 - share) * beneath


# ------------------------------------------------------------------------------------------------------------- picture


def excess(picture: np.ndarray, white: float, most: float) -> np.ndarray:
    """What scatters visibly: of each pixel what its brightest channel exceeds white by, in its own colour."""
    light = np.where(np.isfinite(picture[..., :3]), picture[..., :3], 0.0).clip(0.0, most)
    peak = light.max(axis=-1, keepdims=True)
    return light * np.maximum(peak - white, 0.0) / np.maximum(peak, 1e-30)


def convolve(picture: np.ndarray, kernel: np.ndarray) -> np.ndarray:
    """Sum over places of light times kernel, none coming from outside of the picture; shapes (h, w, 3), (k, k, 3)."""
    height, width = picture.shape[:2]
    reach = len(kernel) // 2
    shape = (height + 2 * reach, width + 2 * reach)
    product = np.fft.rfft2(picture, shape, axes=(0, 1)) * np.fft.rfft2(kernel, shape, axes=(0, 1))
    return np.fft.irfft2(product, shape, axes=(0, 1))[reach : reach + height, reach : reach + width]


def glare(picture: np.ndarray, kernel: np.ndarray, strength: float, white: float, most: float) -> np.ndarray:
    """(h, w, 3) the picture with what exceeds white scattered by a kernel of sum up to 1 per channel."""
    bright = excess(picture, white, most)
    share = np.minimum(strength * kernel.sum(axis=(0, 1)), 1.0)
    factor = share / np.maximum(kernel.sum(axis=(0, 1)), 1e-30)
    light = np.where(np.isfinite(picture[..., :3]), picture[..., :3], 0.0)
    return np.maximum(light - share * bright + factor * convolve(bright, kernel), 0.0)
