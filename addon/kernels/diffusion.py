"""Profiles of subsurface scattering: how much of the light that enters a surface leaves it at distance r.

Four models, all per channel, in closed form where one is known:

- **Dipole** (Jensen et al. 2001) and **multipole** for slabs (Donner and Jensen 2005), from scattering coefficients.
- **Christensen-Burley** (2015): R(r) = (exp(-r/d) + exp(-r/3d)) / (8 pi d r), of total 1. Cycles' d is radius / 4 pi,
  whatever the albedo; the paper's follows from it (`burley_length`).
- **Random walk**: what a path in an index-matched half-space brings, isotropic after similarity. Its distances are
  a mixture of three exponentials for each single-scattering albedo, fitted by expectation maximisation to 100,000 walks
  that entered at a cosine of 0.9 (RANDOM_WALK; the largest difference of the cumulative distributions is 0.006, and
  0.010 for the least absorption; `tools/fit_walk.py` makes it anew).

Burley's profile and the walk have one form, a mixture of lobes exp(-r / s) / (2 pi s r) of total 1, which is what
shaders/subsurface/profile.glsl evaluates: three exponentials a channel, cumulative distribution 1 - sum w exp(-r / s).

Albedo to coefficients: the dipole's by bisection on its total; the walk's by d'Eon, "A Hitchhiker's Guide to Multiple
Scattering", eq. 53.7, as in Cycles. A walk that enters in a given direction returns 1 - g H(mu) with Chandrasekhar's H
(Hapke's approximation, 2002, corrected by a fit to the equation's solution: within 0.3 %), less than its albedo where
it enters steeply.

Fails: all distances are those of a plane; thin and strongly curved parts differ (docs/subsurface.md has figures).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

FOUR_PI = 4.0 * np.pi
LEAST_ABSORPTION = 1e-4  # of the reduced extinction: with less the dipole's range has no bound


@dataclass(frozen=True)
class Medium:
    """Coefficients of a homogeneous medium in one channel, per metre; `anisotropy` g, `ior` relative to the outside."""

    absorption: float
    scattering: float
    anisotropy: float = 0.0
    ior: float = 1.3

    @property
    def reduced_scattering(self) -> float:
        return self.scattering * (1.0 - self.anisotropy)

    @property
    def reduced_extinction(self) -> float:
        return max(self.absorption, 0.0) + self.reduced_scattering

    @property
    def reduced_albedo(self) -> float:
        return self.reduced_scattering / self.reduced_extinction

    @property
    def transport(self) -> float:
        """Effective transport coefficient sigma_tr, 1/m; absorption counts as LEAST_ABSORPTION at least."""
        least = LEAST_ABSORPTION * self.reduced_extinction
        return float(np.sqrt(3.0 * max(self.absorption, least) * self.reduced_extinction))

    @property
    def boundary(self) -> float:
        """A of the boundary condition, (1 + F) / (1 - F) with the mean internal reflectance F."""
        reflected = internal_reflectance(self.ior)
        return (1.0 + reflected) / (1.0 - reflected)

    @property
    def depths(self) -> tuple[float, float]:
        """Depth of the real source and height of the virtual one, m."""
        real = 1.0 / self.reduced_extinction
        return real, real * (1.0 + 4.0 / 3.0 * self.boundary)

    def scaled(self, factor: float) -> Medium:
        """The same with mean free paths 1 / factor times as long."""
        return Medium(factor * self.absorption, factor * self.scattering, self.anisotropy, self.ior)


def internal_reflectance(ior: float) -> float:
    """Mean diffuse Fresnel reflectance from inside (Egan and Hilgeman's fit); none at or below an index of 1."""
    if ior <= 1.0:
        return 0.0
    return -1.440 / ior**2 + 0.710 / ior + 0.668 + 0.0636 * ior


def dipole(medium: Medium, r: np.ndarray) -> np.ndarray:
    """Diffuse reflectance R_d at distances r (m), per m2."""
    r = np.asarray(r, float)
    transport, total = medium.transport, 0.0
    for depth in medium.depths:
        d = np.sqrt(r * r + depth * depth)
        total = total + depth * (transport + 1.0 / d) * np.exp(-transport * d) / (d * d)
    return medium.reduced_albedo / FOUR_PI * total


def dipole_total(medium: Medium) -> float:
    """Integral of R_d over the plane."""
    return 0.5 * medium.reduced_albedo * float(sum(np.exp(-medium.transport * z) for z in medium.depths))


def dipole_within(medium: Medium, radius: np.ndarray) -> np.ndarray:
    """Integral of R_d over a disc of `radius`, m."""
    radius, transport = np.asarray(radius, float), medium.transport
    out = 0.0
    for z in medium.depths:
        d = np.sqrt(radius * radius + z * z)
        out = out + np.exp(-transport * z) - z / d * np.exp(-transport * d)
    return 0.5 * medium.reduced_albedo * out


def dipole_hankel(medium: Medium, k: np.ndarray) -> np.ndarray:
    """Hankel transform of R_d at spatial frequencies k, 1/m."""
    q = np.sqrt(np.square(k) + medium.transport**2)
    return 0.5 * medium.reduced_albedo * sum(np.exp(-z * q) for z in medium.depths)


def dipole_range(medium: Medium, missing: float = 0.01) -> float:
    """Smallest radius, m, beyond which less than the share `missing` of the total lies."""
    total, low, high = dipole_total(medium), 0.0, 1.0 / medium.transport
    while 1.0 - float(dipole_within(medium, high)) / total > missing:
        high *= 2.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        if 1.0 - float(dipole_within(medium, middle)) / total > missing:
            low = middle
        else:
            high = middle
    return high


def multipole(medium: Medium, thickness: float, k: np.ndarray = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Hankel transforms (reflected, transmitted) of a slab of `thickness` m at frequencies k; k = 0: the totals."""
    k = np.asarray(k, float)
    length = 1.0 / medium.reduced_extinction
    margin = 2.0 * medium.boundary * length / 3.0
    q = np.sqrt(k * k + medium.transport**2)
    far = np.exp(-2.0 * q * (thickness + 2.0 * margin))
    half = 0.5 * medium.reduced_albedo / (1.0 - far)
    # far * exp(q x) as one exponential: its parts leave the range of floats apart.
    period = 2.0 * (thickness + 2.0 * margin)

    def folded(x):
        return np.exp(q * (x - period))

    reflected = half * (
        np.exp(-q * length) + np.exp(-q * (length + 2 * margin)) - folded(length) - folded(length + 2 * margin)
    )
    transmitted = half * (
        np.exp(-q * (thickness - length)) - folded(thickness - length)
        - np.exp(-q * (thickness + length + 2 * margin)) + folded(thickness + length + 2 * margin)
    )  # fmt: skip
    return reflected, transmitted


def stacked(first: tuple, second: tuple) -> tuple[np.ndarray, np.ndarray]:
    """Hankel transforms (reflected, transmitted) of two slabs on each other, each alike on both sides."""
    (r1, t1), (r2, t2) = first, second
    return r1 + t1 * r2 * t1 / (1.0 - r1 * r2), t1 * t2 / (1.0 - r1 * r2)


# Christensen-Burley and the random walk: mixtures of lobes ------------------------------------------------------------


@dataclass(frozen=True)
class Lobes:
    """A profile sum over lobes of share * exp(-r / scale) / (2 pi scale r), of one channel; shares sum to 1."""

    shares: np.ndarray  # (3,)
    scales: np.ndarray  # (3,) m

    def at(self, r: np.ndarray) -> np.ndarray:
        """The profile at distances r > 0, per m2."""
        r = np.asarray(r, float)[..., None]
        return (self.shares * np.exp(-r / self.scales) / (2.0 * np.pi * self.scales * r)).sum(axis=-1)

    def within(self, radius: np.ndarray) -> np.ndarray:
        """Share of the light that leaves within `radius`, m."""
        return 1.0 - (self.shares * np.exp(-np.asarray(radius, float)[..., None] / self.scales)).sum(axis=-1)

    def hankel(self, k: np.ndarray) -> np.ndarray:
        """Hankel transform at frequencies k, 1/m: each lobe's is 1 / sqrt(1 + (k s)^2)."""
        return (self.shares / np.sqrt(1.0 + np.square(np.asarray(k, float)[..., None] * self.scales))).sum(axis=-1)

    def edge(self, x: np.ndarray) -> np.ndarray:
        """Light at signed distances x, m, from the edge of a half-plane that is lit evenly: 1/2 there, 1 inside.

        Along a line the lobe is K0(|x| / s) / (pi s) (its integral across); integrated by quadrature.
        """
        x = np.atleast_1d(np.asarray(x, float))
        out = np.zeros_like(x)
        for share, scale in zip(self.shares, self.scales):
            # Integral of K0(t) from a on is the integral over u >= 0 of exp(-a cosh u) / cosh u.
            u = np.linspace(0.0, 24.0, 8001)
            tail = np.exp(-np.abs(x[:, None]) / scale * np.cosh(u)) / np.cosh(u)
            beyond = _trapezoid(tail, u, axis=1) / np.pi
            out += share * np.where(x >= 0.0, 1.0 - beyond, beyond)
        return out


def burley_length(albedo: np.ndarray, mean_free_path: np.ndarray) -> np.ndarray:
    """d of Christensen-Burley's profile (2015, eq. 6: light from all sides), m."""
    albedo = np.asarray(albedo, float)
    return np.asarray(mean_free_path, float) / (1.9 - albedo + 3.5 * np.square(albedo - 0.8))


def burley(length: float) -> Lobes:
    """Christensen-Burley's profile of length d, m."""
    return Lobes(np.array([0.25, 0.75, 0.0]), np.array([length, 3.0 * length, length]))


def walk_absorption(albedo: np.ndarray) -> np.ndarray:
    """sqrt(1 - single-scattering albedo) of the isotropic walk with this albedo under diffuse light (d'Eon)."""
    albedo = np.clip(albedo, 0.0, 1.0)
    root = np.sqrt(9.59217 + 41.6808 * albedo + 17.7126 * np.square(albedo))
    return np.clip(4.20863 * albedo - root + 4.09712, 0.0, 1.0)


def walk(absorption: float, mean_free_path: float) -> Lobes:
    """Profile of the isotropic random walk; `absorption` is sqrt(1 - single-scattering albedo), path in m."""
    at = np.sqrt(np.clip(absorption, RANDOM_WALK[0, 0], RANDOM_WALK[-1, 0]))
    row = np.array([np.interp(at, np.sqrt(RANDOM_WALK[:, 0]), column) for column in RANDOM_WALK[:, 1:].T])
    shares = np.array([row[0], row[1], 1.0 - row[0] - row[1]])
    return Lobes(shares, row[2:5] * mean_free_path)


def walk_returned(absorption: np.ndarray, cosine: np.ndarray) -> np.ndarray:
    """Share of light that entered at this cosine and comes out again, 1 - g H(cosine)."""
    g, mu = np.asarray(absorption, float), np.asarray(cosine, float)
    r0 = (1.0 - g) / (1.0 + g)
    series = np.log((1.0 + mu) / np.maximum(mu, 1e-6))
    h = 1.0 / (1.0 - (1.0 - g * g) * mu * (r0 + (0.5 - r0 * mu) * series))
    return (1.0 - g * h) * (1.0 - 0.033 * g + 0.021 * g * g)


def skin_scale(albedo: np.ndarray, ior: float = 1.4) -> np.ndarray:
    """sqrt(3 (1 - alpha')) with the dipole's alpha' of that albedo: by what the method for skin multiplies radii."""
    reflected = internal_reflectance(ior)
    slope = 4.0 / 3.0 * (1.0 + reflected) / (1.0 - reflected)
    low, high = np.zeros_like(np.asarray(albedo, float)), np.ones_like(np.asarray(albedo, float))
    for _ in range(24):
        middle = 0.5 * (low + high)
        s = np.sqrt(3.0 * (1.0 - middle))
        below = 0.5 * middle * (1.0 + np.exp(-slope * s)) * np.exp(-s) < albedo
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return np.sqrt(3.0 * (1.0 - 0.5 * (low + high)))


def table(width: int = 64) -> np.ndarray:
    """(2, width, 4) float32 for shaders/subsurface/profile.glsl: shares and scales of the walk at sqrt(absorption) =
    i / (width - 1): row 0 shares 1, 2 and scales 1, 2; row 1 scale 3."""
    out = np.zeros((2, width, 4), np.float32)
    for i, at in enumerate(np.linspace(0.0, 1.0, width)):
        lobes = walk(at * at, 1.0)
        out[0, i] = *lobes.shares[:2], *lobes.scales[:2]
        out[1, i, 0] = lobes.scales[2]
    return out


# sqrt(1 - single-scattering albedo); shares of the first two lobes; scales of three, in mean free paths.
RANDOM_WALK = np.array([
    (0.005, 0.4812, 0.4338, 1.4614, 5.7700, 35.3175),
    (0.01, 0.4008, 0.4946, 1.2446, 4.7513, 25.8059),
    (0.02, 0.3337, 0.5330, 1.1159, 3.9192, 15.9244),
    (0.03, 0.2249, 0.6015, 0.8301, 3.1139, 11.3323),
    (0.04, 0.2030, 0.6194, 0.7846, 2.9052, 9.3833),
    (0.06, 0.1860, 0.6136, 0.7375, 2.6236, 6.9029),
    (0.09, 0.1810, 0.5615, 0.7304, 2.2291, 4.8546),
    (0.12, 0.1486, 0.5372, 0.6349, 1.9144, 3.7694),
    (0.16, 0.1411, 0.4875, 0.5523, 1.7248, 2.9244),
    (0.2, 0.0992, 0.4914, 0.3514, 1.5005, 2.4362),
    (0.25, 0.1170, 0.4662, 0.3655, 1.4196, 2.0380),
    (0.3, 0.0915, 0.4802, 0.2635, 1.2080, 1.8146),
    (0.36, 0.1297, 0.4510, 0.3042, 1.1559, 1.5656),
    (0.42, 0.1348, 0.4488, 0.2751, 1.0315, 1.4044),
    (0.5, 0.1614, 0.4331, 0.2772, 0.8928, 1.2773),
    (0.6, 0.1778, 0.4292, 0.2560, 0.7661, 1.1148),
    (0.7, 0.1636, 0.4406, 0.1968, 0.6469, 0.9781),
    (0.8, 0.1831, 0.4436, 0.1954, 0.5590, 0.9030),
    (0.9, 0.1393, 0.4916, 0.1202, 0.4550, 0.8162),
])  # fmt: skip


def _trapezoid(values: np.ndarray, place: np.ndarray, axis: int = -1) -> np.ndarray:
    """The integral by trapezoids along the last axis; numpy has had a function for it by this name only since 2.0."""
    assert axis in (-1, values.ndim - 1)
    return (0.5 * (values[..., 1:] + values[..., :-1]) * np.diff(place)).sum(axis=-1)
