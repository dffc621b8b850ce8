"""Bounds and means of what a tree computes, without running it: is anything transparent, how much does it emit.

A renderer must know before it draws whether a surface may let light pass and how bright it is on average. A constant
is known exactly, an image by its pixels, everything else by wide bounds and a neutral mean.
"""

from __future__ import annotations

import weakref
from dataclasses import dataclass, replace

import numpy as np

from .working_space import current

MOST_INTERFACES = 8  # of one material that rays tell apart
MEAN_SIZE = 256  # pixels along each side that the mean of a large image is taken from


def _weighted(value: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """The weighted sum of the channels, three times; infinite as soon as one channel is."""
    infinite = value[np.isinf(value)]
    return np.full(3, infinite[0] if infinite.size else value @ weights)


@dataclass(frozen=True)
class Estimate:
    """Lowest, mean and highest value per channel, each (3,) float64; a scalar has three equal channels."""

    low: np.ndarray
    mean: np.ndarray
    high: np.ndarray

    @property
    def constant(self) -> bool:
        return bool(np.all(self.low == self.high))

    @property
    def grey(self) -> bool:
        """Known to be the same in all channels."""
        return self.constant and bool(np.ptp(self.low) == 0.0)

    def map(self, function) -> Estimate:
        """The estimate of a rising function of this value."""
        return Estimate(function(self.low), function(self.mean), function(self.high))

    def clipped(self) -> Estimate:
        return self.map(lambda value: np.clip(value, 0.0, 1.0))

    def luminance(self) -> Estimate:
        return self.map(lambda value: _weighted(value, current().luminance))

    def average(self) -> Estimate:
        return self.map(lambda value: _weighted(value, np.full(3, 1.0 / 3.0)))

    def __mul__(self, other: Estimate) -> Estimate:
        with np.errstate(invalid="ignore"):
            corners = np.array([a * b for a in (self.low, self.high) for b in (other.low, other.high)])
        corners = np.nan_to_num(corners, nan=0.0, posinf=np.inf, neginf=-np.inf)
        return Estimate(corners.min(axis=0), self.mean * other.mean, corners.max(axis=0))

    def __add__(self, other: Estimate) -> Estimate:
        return Estimate(self.low + other.low, self.mean + other.mean, self.high + other.high)

    def complement(self) -> Estimate:
        """One minus the value."""
        return Estimate(1.0 - self.high, 1.0 - self.mean, 1.0 - self.low)


def constant(value) -> Estimate:
    """A known value: a number, or the first three components of a sequence."""
    number = np.asarray(value, float).ravel()
    channels = np.full(3, number[0]) if number.size == 1 else np.resize(number[:3], 3)
    return Estimate(channels, channels, channels)


def unknown(mean: float = 0.5) -> Estimate:
    return Estimate(np.full(3, -np.inf), np.full(3, float(mean)), np.full(3, np.inf))


ZERO = constant(0.0)


def _share(weight: Estimate) -> float:
    return float(np.clip(weight.mean.mean(), 0.0, 1.0))


@dataclass(frozen=True)
class Interface:
    """Means over a material of what bends light: for rays that meet it where no shader can be run."""

    color: tuple[float, float, float]  # of what passes, once
    ior: float
    roughness: float
    share: float  # of the material that is such an interface, 0..1
    fresnel: bool = True  # the rest is mirrored; False: nothing is
    multiple: bool = True  # gives back what it scatters more than once
    mirrors_color: bool = False  # what is mirrored has the colour, too
    others: tuple[Interface, ...] = ()  # that the material has beside, of other colours or indices (dispersion)

    def weighted(self, share: float) -> Interface:
        """The same of a part of the surface."""
        return replace(self, share=self.share * share, others=tuple(one.weighted(share) for one in self.others))

    def beside(self, other: Interface | None) -> Interface:
        """Both of them, the most first; of more than MOST_INTERFACES those are left out that are least."""
        if other is None:
            return self
        alone = [replace(one, others=()) for one in (self, *self.others, other, *other.others)]
        first, *rest = sorted(alone, key=lambda one: -one.share)[:MOST_INTERFACES]
        return replace(first, others=tuple(rest))


@dataclass(frozen=True)
class Summary:
    """What a shader leaf, or a whole surface, does with light."""

    transparency: Estimate = ZERO  # what passes straight through
    emission: Estimate = ZERO  # radiance
    diffuse: bool = False
    glossy: bool = False
    soft: bool = False  # a lobe of shaders/lib/soft_lobe.glsl
    tinted: bool = False  # what passes straight through may be coloured
    glass: Interface | None = None  # such lobes
    scatter: float = 0.0  # about how far light spreads below the surface, m; 0: it does not

    def weighted(self, weight: Estimate) -> Summary:
        seen = bool(np.any(weight.high > 0.0))
        return Summary(
            self.transparency * weight,
            self.emission * weight,
            self.diffuse and seen,
            self.glossy and seen,
            self.soft and seen,
            self.tinted and seen,
            self.glass.weighted(_share(weight)) if self.glass and seen else None,
            self.scatter if seen else 0.0,
        )

    def __add__(self, other: Summary) -> Summary:
        return Summary(
            self.transparency + other.transparency,
            self.emission + other.emission,
            self.diffuse or other.diffuse,
            self.glossy or other.glossy,
            self.soft or other.soft,
            self.tinted or other.tinted,
            self.glass.beside(other.glass) if self.glass else other.glass,
            max(self.scatter, other.scatter),
        )


def srgb_decode(encoded: np.ndarray) -> np.ndarray:
    """Inverse of the sRGB transfer curve (IEC 61966-2-1)."""
    encoded = np.asarray(encoded, float)
    curve = ((np.maximum(encoded, 0.04045) + 0.055) / 1.055) ** 2.4
    return np.where(encoded < 0.04045, np.maximum(encoded, 0.0) / 12.92, curve)


def between(factor: str, a: str, b: str, output: str):
    """For the node table: bounds of a blend, which lies between its ends if the factor stays within 0..1."""

    def estimate(sockets: dict[str, Estimate]) -> dict[str, Estimate]:
        share = sockets[factor].clipped()
        first, second = sockets[a], sockets[b]
        if share.constant:
            return {output: first * share.complement() + second * share}
        mean = first.mean * (1.0 - share.mean) + second.mean * share.mean
        low, high = np.minimum(first.low, second.low), np.maximum(first.high, second.high)
        return {output: Estimate(low, mean, high)}

    return estimate


def average(*names: str):
    """For the node table: no bounds, but the mean of the inputs as a better guess than a constant."""

    def estimate(sockets: dict[str, Estimate]) -> dict[str, Estimate]:
        guess = unknown()
        return {"*": Estimate(guess.low, np.mean([sockets[name].mean for name in names], axis=0), guess.high)}

    return estimate


# Estimates of images that are still alive: (identity of the pixels, clipped, output) -> (the pixels, weakly; estimate).
_image_estimates: dict[tuple[int, str, bool, str], tuple[weakref.ref, Estimate]] = {}


def image_estimate(image, clipped: bool, output: str) -> Estimate:
    """Bounds and mean of what an image gives at its output "Color" (while alpha is not used) or "Alpha".

    `clipped`: the lookup gives 0 outside of the image. Means are over at most 256 x 256 pixels, bounds over all.
    Remembered as long as the pixels exist.
    """
    key = (id(image.pixels), image.encoding + image.alpha_mode, clipped, output)
    alive, estimate = _image_estimates.get(key, (None, None))
    if alive is None or alive() is not image.pixels:
        estimate = _alpha_estimate(image, clipped) if output == "Alpha" else _color_estimate(image, clipped)
        forget = weakref.ref(image.pixels, lambda _: _image_estimates.pop(key, None))
        _image_estimates[key] = forget, estimate
    return estimate


def _some_pixels(image) -> np.ndarray:
    height, width = image.pixels.shape[:2]
    return image.pixels[:: -(-height // MEAN_SIZE), :: -(-width // MEAN_SIZE)].astype(float)


def _alpha_estimate(image, clipped: bool) -> Estimate:
    if image.alpha_mode == "NONE":
        low = mean = high = 1.0
    else:
        low, high = float(image.pixels[..., 3].min()), float(image.pixels[..., 3].max())
        mean = float(np.clip(_some_pixels(image)[..., 3], 0.0, 1.0).mean())
    return Estimate(np.full(3, min(low, 0.0) if clipped else low), np.full(3, mean), np.full(3, high))


def _color_estimate(image, clipped: bool) -> Estimate:
    def channels(pixels: np.ndarray) -> list[np.ndarray]:
        if image.alpha_mode == "STRAIGHT":
            return [pixels[..., k] * pixels[..., 3] for k in range(3)]
        return [pixels[..., k] for k in range(3)]

    all_pixels = channels(image.pixels)  # holes of a grille may lie between those that the mean looks at
    low, high = (np.array([float(end(channel)) for channel in all_pixels]) for end in (np.min, np.max))
    mean = np.stack(channels(_some_pixels(image)), axis=-1).reshape(-1, 3)
    if image.encoding == "SRGB":
        low, high, mean = srgb_decode(low), srgb_decode(high), srgb_decode(mean)
    return Estimate(np.minimum(low, 0.0) if clipped else low, mean.mean(axis=0), high)
