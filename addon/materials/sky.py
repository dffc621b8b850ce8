"""The Sky Texture's models: radiance of a clear sky by direction, as a table, and of the sun's disc.

    SINGLE_SCATTERING (NISHITA before 5.0)  light that is scattered once: Nishita et al., "Display of the Earth taking
                                            into account atmospheric scattering", SIGGRAPH 1993; with ozone
    MULTIPLE_SCATTERING                     four wavelengths and a fit of what is scattered more often: Garcia Linan,
                                            "Physically based sky" (fgarlin.com/posts/2024-12-06-spectral_sky)
    PREETHAM                                Preetham, Shirley & Smits, "A practical analytic model for daylight", 1999
    HOSEK_WILKIE                            Hosek & Wilkie, "An analytic model for full spectral sky-dome radiance",
                                            SIGGRAPH 2012, with the figures that they fitted (hosek_wilkie.npz)

The first two integrate, along the ray from the viewer's altitude to the end of the atmosphere,

    L(w) = integral of  T(x, viewer) sum over kinds of  beta(x) (p(w, sun) T(x, sun) + multiple) E_sun  dx

with T = exp(-optical depth), in the parameters that Blender's models have: exponential air (8 km) and aerosols
(1.2 km), a layer of ozone around 25 km. Tables are symmetric about the sun's azimuth, and finer towards the horizon:
rows run over elevation = +-(pi/2) l^2, l in [-1, 1]. Rays are integrated apart from the phase functions p, which alone
change quickly, so few azimuths suffice: about a second for a table of 512 x 256, kept per set of values.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache
from math import comb
from pathlib import Path

import numpy as np

from .working_space import WorkingSpace, current

WIDTH, HEIGHT = 512, 256  # columns over the azimuth from the sun, rows over elevation
XYZ_TO_RGB = np.array(
    [[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]]
)  # to linear Rec. 709, D65
AZIMUTHS = 25  # at which rays are integrated; without the phase functions, radiance changes slowly in between
LIMB = 0.6  # darkening of the sun's edge: 1 - LIMB (1 - cos of the angle at which its surface is seen)


@dataclass(frozen=True)
class Sky:
    """Settings of a Sky Texture. Angles in radians, altitude in metres, densities relative to a clear day."""

    model: str
    sun_elevation: float = 0.0
    sun_rotation: float = 0.0  # of the sun about z, from +Y towards +X
    sun_size: float = 0.0  # the disc's diameter; 0 without one
    sun_intensity: float = 1.0
    altitude: float = 0.0
    air: float = 1.0
    aerosol: float = 1.0
    ozone: float = 1.0
    turbidity: float = 2.2
    ground_albedo: float = 0.3
    level: bool = False  # the disc is seen down to the eye's level however high that is, as before Blender 5.0

    @property
    def name(self) -> str:
        """Equal for skies of equal tables."""
        return f"sky {self}"

    @property
    def scatters(self) -> bool:
        """Whether the atmosphere is integrated; else a fit gives its radiance."""
        return self.model in ("SINGLE_SCATTERING", "MULTIPLE_SCATTERING")

    @property
    def sun(self) -> np.ndarray:
        """(3,) unit vector towards the sun."""
        flat = np.cos(self.sun_elevation)
        return np.array(
            [flat * np.sin(self.sun_rotation), flat * np.cos(self.sun_rotation), np.sin(self.sun_elevation)]
        )


def sky_of(settings: dict[str, object]) -> Sky:
    """The sky of a node's settings, under the names of any Blender version."""
    model = settings.get("sky_type", "MULTIPLE_SCATTERING")
    if model in ("PREETHAM", "HOSEK_WILKIE"):
        direction = np.asarray(settings["sun_direction"], float)
        x, y, z = direction / max(float(np.linalg.norm(direction)), 1e-30)
        elevation, rotation = float(np.arcsin(np.clip(z, -1.0, 1.0))), float(np.arctan2(x, y))
        turbidity, albedo = float(settings.get("turbidity", 2.2)), float(settings.get("ground_albedo", 0.3))
        return Sky(model, elevation, rotation, turbidity=turbidity, ground_albedo=albedo)
    return Sky(
        "SINGLE_SCATTERING" if model == "NISHITA" else model,
        float(settings["sun_elevation"]),
        float(settings["sun_rotation"]),
        float(settings["sun_size"]) if settings["sun_disc"] else 0.0,
        float(settings["sun_intensity"]),
        float(settings["altitude"]),
        float(settings["air_density"]),
        float(settings.get("aerosol_density", settings.get("dust_density", 1.0))),
        float(settings["ozone_density"]),
        level=model == "NISHITA",
    )


@lru_cache(maxsize=16)
def sky_pixels(sky: Sky) -> np.ndarray:
    """(HEIGHT + 1, WIDTH, 4) float32: scene-linear radiance, and a last row for the shader (material/sky.glsl).

    That row holds: the sun's lowest and highest radiance; direction to the sun; rotation, half angle and elevation of
    the sun; elevation of the horizon.
    """
    row = ((np.arange(HEIGHT) + 0.5) / HEIGHT) * 2.0 - 1.0
    elevation = np.sign(row) * row * row * np.pi / 2
    azimuth = (np.arange(WIDTH // 2) + 0.5) / WIDTH * 2.0 * np.pi
    half = _radiance(sky, elevation, azimuth)
    pixels = np.zeros((HEIGHT + 1, WIDTH, 4), np.float32)
    pixels[:HEIGHT, :, :3] = np.concatenate([half, half[:, ::-1]], axis=1)
    low, high = sun_radiance(sky)
    pixels[HEIGHT, 0, :3], pixels[HEIGHT, 1, :3], pixels[HEIGHT, 2, :3] = low, high, sky.sun
    pixels[HEIGHT, 3, :3] = sky.sun_rotation, sky.sun_size / 2, sky.sun_elevation
    pixels[HEIGHT, 4, 0] = horizon(sky)
    pixels.setflags(write=False)
    return pixels


@lru_cache(maxsize=8)
def _turned(sky: Sky, space: WorkingSpace) -> np.ndarray:
    pixels = sky_pixels(sky).copy()
    pixels[:HEIGHT, :, :3] = np.maximum(pixels[:HEIGHT, :, :3] @ space.from_rec709.T, 0.0)
    pixels[HEIGHT, :2, :3] = pixels[HEIGHT, :2, :3] @ space.from_rec709.T
    pixels.setflags(write=False)
    return pixels


def working_sky_pixels(sky: Sky) -> np.ndarray:
    """The same in the current working space."""
    return sky_pixels(sky) if current().usual else _turned(sky, current())


def horizon(sky: Sky) -> float:
    """Elevation above which the sun's disc shows, radians."""
    if sky.level:
        return 0.0
    return float(np.arcsin(RADIUS_KM / (RADIUS_KM + sky.altitude / 1000.0)) - np.pi / 2)


def sun_radiance(sky: Sky) -> tuple[np.ndarray, np.ndarray]:
    """Radiance of the disc at its lowest and highest point, (3,) each, without the darkening of its edge."""
    if not sky.scatters or sky.sun_size <= 0.0:
        return np.zeros(3), np.zeros(3)
    half = sky.sun_size / 2
    solid_angle = 2.0 * np.pi * (1.0 - np.cos(half))
    ends = np.array([sky.sun_elevation - half, sky.sun_elevation + half])
    if sky.model == "SINGLE_SCATTERING":
        if ends[1] <= 0.0:
            return np.zeros(3), np.zeros(3)
        spectrum = _sun_once(sky, np.maximum(ends, 0.0)) / solid_angle
        xyz = spectrum @ MATCHING * STEP_NM
    else:
        place = np.full(2, np.clip(sky.altitude, 1.0, 99999.0) / 1000.0)
        xyz = SUN_FOUR * _transmittance(sky, np.sin(ends), place) / solid_angle @ XYZ_FOUR
    low, high = _rgb(xyz) * sky.sun_intensity
    return low, high


def disc_radiance(sky: Sky) -> np.ndarray:
    """(3,) mean radiance over the whole disc, in the current working space; what the horizon hides counts as dark."""
    low, high = (radiance @ current().from_rec709.T for radiance in sun_radiance(sky))
    half = sky.sun_size / 2
    reach = np.clip((sky.sun_elevation - horizon(sky)) / max(half, 1e-9), -1.0, 1.0)
    seen = 1.0 - (np.arccos(reach) - reach * np.sqrt(1.0 - reach * reach)) / np.pi
    return 0.5 * (low + high) * (1.0 - LIMB / 3.0) * seen


def _rgb(xyz: np.ndarray) -> np.ndarray:
    return np.maximum(xyz @ XYZ_TO_RGB.T, 0.0)


def _radiance(sky: Sky, elevation: np.ndarray, azimuth: np.ndarray) -> np.ndarray:
    """(E, A, 3) for elevations and azimuths from the sun."""
    directions = _directions(elevation, azimuth)
    if not sky.scatters:
        return (_hosek_wilkie if sky.model == "HOSEK_WILKIE" else _preetham)(sky, directions)
    mu = directions @ np.array([np.cos(sky.sun_elevation), 0.0, np.sin(sky.sun_elevation)])
    nodes = np.linspace(0.0, np.pi, AZIMUTHS)
    if sky.model == "MULTIPLE_SCATTERING":
        parts = _four_wavelengths(sky, _directions(elevation, nodes)) @ XYZ_FOUR
        phases = np.stack([_rayleigh_phase(mu), _forward_phase(mu, FORWARD_FOUR), np.ones_like(mu)])
    else:
        # Below the horizon the lowest row of the sky goes on and fades: black 24 degrees down.
        parts = _once(sky, _directions(np.maximum(elevation, 0.0), nodes)) @ MATCHING * STEP_NM
        parts *= (np.clip(1.0 + 2.5 * np.minimum(np.sin(elevation), 0.0), 0.0, 1.0) ** 3)[:, None, None]
        level = _directions(np.maximum(elevation, 0.0), azimuth)
        mu = level @ np.array([np.cos(sky.sun_elevation), 0.0, np.sin(sky.sun_elevation)])
        cornette = 1.5 * (1.0 + mu * mu) / (2.0 + FORWARD * FORWARD)
        phases = np.stack([_rayleigh_phase(mu), _forward_phase(mu, FORWARD) * cornette])
    place = azimuth / np.pi * (AZIMUTHS - 1)
    lower = np.minimum(place.astype(int), AZIMUTHS - 2)
    share = (place - lower)[:, None]
    between = parts[:, :, lower] * (1.0 - share) + parts[:, :, lower + 1] * share
    return _rgb(np.sum(phases[..., None] * between, axis=0))


def _directions(elevation: np.ndarray, azimuth: np.ndarray) -> np.ndarray:
    """(E, A, 3) unit vectors in the sun's frame: its azimuth is +X."""
    e, a = np.meshgrid(elevation, azimuth, indexing="ij")
    return np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], axis=-1)


def _rayleigh_phase(mu: np.ndarray) -> np.ndarray:
    return 3.0 / (16.0 * np.pi) * (1.0 + mu * mu)


def _forward_phase(mu: np.ndarray, g: float) -> np.ndarray:
    """Henyey & Greenstein 1941."""
    return (1.0 - g * g) / (4.0 * np.pi * (1.0 + g * g - 2.0 * g * mu) ** 1.5)


def _to_sphere(points: np.ndarray, directions: np.ndarray, radius: float) -> np.ndarray:
    """Distance along unit directions from points inside a sphere around the origin to it."""
    b = np.sum(points * directions, axis=-1)
    c = np.sum(points * points, axis=-1) - radius * radius
    return -b + np.sqrt(np.maximum(b * b - c, 0.0))


# ------------------------------------------------------------------------------------------------- scattered once

RADIUS, TOP = 6360e3, 6420e3  # of the earth and of its atmosphere, m
AIR_HEIGHT, AEROSOL_HEIGHT = 8e3, 1.2e3  # scale heights, m
AEROSOL = 2e-5  # scattered by aerosols, per m at the ground; 1.11 times that is lost
FORWARD = 0.76  # asymmetry of aerosols
STEPS = 32
STEP_NM = 20.0
NM = np.arange(380.0, 781.0, STEP_NM)
RAYLEIGH = 1.13115e-30 / (NM * 1e-9) ** 4  # scattered by air, per m at the ground
# The sun outside the atmosphere, W/m2/nm: a black body of 5772 K that covers 6.8e-5 sr.
SUN = 6.8e-5 * 1e-9 * 1.191043e-16 / (NM * 1e-9) ** 5 / np.expm1(0.01438777 / (NM * 1e-9 * 5772.0))
# Absorbed by ozone where it is densest, per m: cross sections of Serdyuchenko et al. 2014 in steps of 20 nm.
OZONE = 1e-9 * np.array([
    3.251, 5.854, 19.77, 73.10, 200.8, 403.8, 635.5, 967.1, 1548.0, 2090.4, 2461.3, 2735.5, 2151.3, 1590.5, 1123.6,
    735.3, 464.5, 331.0, 225.1, 148.8, 168.3,
])  # fmt: skip
# CIE 1931 colour matching functions x, y, z in steps of 20 nm.
MATCHING = np.array([
    (0.001368, 0.000039, 0.00645), (0.01431, 0.000396, 0.06785), (0.13438, 0.004, 0.6456), (0.34828, 0.023, 1.74706),
    (0.2908, 0.06, 1.6692), (0.09564, 0.13902, 0.81295), (0.0049, 0.323, 0.272), (0.06327, 0.71, 0.07825),
    (0.2904, 0.954, 0.0203), (0.5945, 0.995, 0.0039), (0.9163, 0.87, 0.00165), (1.0622, 0.631, 0.0008),
    (0.85445, 0.381, 0.00019), (0.4479, 0.175, 0.00002), (0.1649, 0.061, 0.0), (0.04677, 0.017, 0.0),
    (0.011359, 0.004102, 0.0), (0.002899, 0.001047, 0.0), (0.00069, 0.000249, 0.0), (0.000166, 0.00006, 0.0),
    (0.0000415, 0.000015, 0.0),
])  # fmt: skip


def _densities(height: np.ndarray) -> np.ndarray:
    """(…, 3): air, aerosols and ozone relative to where each is densest."""
    return np.stack([
        np.exp(-height / AIR_HEIGHT), np.exp(-height / AEROSOL_HEIGHT),
        np.maximum(0.0, 1.0 - np.abs(height - 25e3) / 15e3),
    ], axis=-1)  # fmt: skip


def _depths(points: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """(…, 3): densities along rays to the end of the atmosphere, m. Gauss-Laguerre quadrature of eight nodes, spread so
    that the last one is still inside."""
    nodes, weights = np.polynomial.laguerre.laggauss(8)
    length = _to_sphere(points, directions, TOP)
    depth = 0.0
    for node, weight in zip(nodes / 25.0, weights * np.exp(nodes) / 25.0):
        place = points + (node * length)[..., None] * directions
        depth = depth + weight * _densities(np.linalg.norm(place, axis=-1) - RADIUS)
    return depth * length[..., None]


def _once(sky: Sky, directions: np.ndarray) -> np.ndarray:
    """(2, E, A, 21): spectral radiance of unit directions, by air and by aerosols, each over its phase function."""
    viewer = np.array([0.0, 0.0, RADIUS + np.clip(sky.altitude, 1.0, 59999.0)])
    sun = np.array([np.cos(sky.sun_elevation), 0.0, np.sin(sky.sun_elevation)])
    amounts = np.array([sky.air, sky.aerosol, sky.ozone])
    lost = np.stack([RAYLEIGH, np.full_like(NM, 1.11 * AEROSOL), OZONE])
    step = _to_sphere(np.broadcast_to(viewer, directions.shape), directions, TOP) / STEPS
    depth, air, aerosol = 0.0, 0.0, 0.0
    for k in range(STEPS):
        place = viewer + ((k + 0.5) * step)[..., None] * directions
        radius = np.linalg.norm(place, axis=-1)
        density = amounts * _densities(radius - RADIUS)
        depth = depth + density * step[..., None]
        toward = place @ sun
        lit = (toward >= 0.0) | (radius * radius - toward * toward > RADIUS * RADIUS)
        total = depth + amounts * _depths(place, np.broadcast_to(sun, place.shape))
        arriving = np.exp(-(total @ lost)) * (step * lit)[..., None]
        air = air + density[..., :1] * arriving
        aerosol = aerosol + density[..., 1:2] * arriving
    return np.stack([air * (RAYLEIGH * SUN), aerosol * (AEROSOL * SUN)])


def _sun_once(sky: Sky, elevation: np.ndarray) -> np.ndarray:
    """(N, 21) W/m2/nm that arrive straight from the sun. As in Blender, ozone takes nothing of it."""
    viewer = np.array([0.0, 0.0, RADIUS + np.clip(sky.altitude, 1.0, 59999.0)])
    directions = np.stack([np.cos(elevation), np.zeros_like(elevation), np.sin(elevation)], axis=-1)
    depth = _depths(np.broadcast_to(viewer, directions.shape), directions) * np.array([sky.air, sky.aerosol, 0.0])
    return SUN * np.exp(-(depth @ np.stack([RAYLEIGH, np.full_like(NM, 1.11 * AEROSOL), OZONE])))


# ------------------------------------------------------------------------------------------ scattered several times

RADIUS_KM, THICKNESS_KM = 6371.0, 100.0
FOUR_STEPS = 64
ALBEDO = 0.3  # of the ground
FORWARD_FOUR = 0.8
# At 630, 560, 490 and 430 nm: the sun in W/m2/nm; per km and per particle what air, ozone and urban aerosols take.
SUN_FOUR = np.array([1.679, 1.828, 1.986, 1.307])
AIR_FOUR = np.array([6.605e-3, 1.067e-2, 1.842e-2, 3.156e-2])
OZONE_FOUR = 334.5 * np.array([3.472e-25, 3.914e-25, 1.349e-25, 1.103e-26])
ABSORBED_FOUR = np.array([2.8722e-24, 4.6168e-24, 7.9706e-24, 1.3578e-23])
SCATTERED_FOUR = np.array([1.5908e-22, 1.7711e-22, 2.0942e-22, 2.4033e-22])
MULTIPLE_FOUR = 0.02 * np.array([0.217, 0.347, 0.594, 1.0])
XYZ_FOUR = np.array([
    (53.386918, 22.981338, 0.0), (43.904844, 71.347796, 0.102507), (1.613728, 18.42296, 31.742921),
    (20.762669, 2.361421, 110.480096),
])  # fmt: skip


def _coefficients(sky: Sky, height_km: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Per km, (…, 4) each: what air scatters, what aerosols scatter, and what is lost in all."""
    air = sky.air * AIR_FOUR * np.exp(-0.07771971 * height_km**1.16364243)[..., None]
    log_height = np.log(np.maximum(height_km, 1e-4))
    ozone = 3.78547397e20 * np.exp(-((log_height - 3.22261) ** 2) * 5.55555555 - log_height)
    particles = sky.aerosol * (1.3681e20 * np.exp(-height_km / 0.73) + 2e6)
    scattered = SCATTERED_FOUR * particles[..., None]
    lost = air + scattered + ABSORBED_FOUR * particles[..., None] + sky.ozone * OZONE_FOUR * ozone[..., None]
    return air, scattered, lost


def _transmittance(sky: Sky, sine: np.ndarray, height_km: np.ndarray) -> np.ndarray:
    """(…, 4) from a height towards directions of the given sine of elevation to the end of the atmosphere."""
    start = RADIUS_KM + height_km
    top = RADIUS_KM + THICKNESS_KM
    length = -start * sine + np.sqrt(np.maximum((start * sine) ** 2 + top * top - start * start, 0.0))
    step = length / FOUR_STEPS
    depth = 0.0
    for k in range(FOUR_STEPS):
        t = (k + 0.5) * step
        height = np.sqrt(start * start + t * t + 2.0 * start * sine * t) - RADIUS_KM
        depth = depth + _coefficients(sky, np.maximum(height, 0.0))[2] * step[..., None]
    return np.exp(-depth)


TABLE_SINES, TABLE_HEIGHTS = 256, 64  # of the table of transmittance, over sine -1…1 and height 0…100 km


def _lookup(table: np.ndarray, sine: np.ndarray, height: np.ndarray) -> np.ndarray:
    """Bilinear; `height` as a share of the atmosphere's."""
    x = np.clip(sine * 0.5 + 0.5, 0.0, 1.0) * (TABLE_SINES - 1)
    y = np.clip(height, 0.0, 1.0) * (TABLE_HEIGHTS - 1)
    x0, y0 = np.minimum(x.astype(int), TABLE_SINES - 2), np.minimum(y.astype(int), TABLE_HEIGHTS - 2)
    fx, fy = (x - x0)[..., None], (y - y0)[..., None]
    low = table[y0, x0] * (1 - fx) + table[y0, x0 + 1] * fx
    high = table[y0 + 1, x0] * (1 - fx) + table[y0 + 1, x0 + 1] * fx
    return low * (1 - fy) + high * fy


def _four_wavelengths(sky: Sky, directions: np.ndarray) -> np.ndarray:
    """(3, E, A, 4): spectral radiance of unit directions, by air and by aerosols over their phase functions, and what
    was scattered before."""
    sines, heights = np.linspace(-1.0, 1.0, TABLE_SINES), np.linspace(0.0, THICKNESS_KM, TABLE_HEIGHTS)
    table = _transmittance(sky, *np.meshgrid(sines, heights))
    viewer = np.array([0.0, 0.0, RADIUS_KM + np.clip(sky.altitude, 1.0, 99999.0) / 1000.0])
    sun = np.array([np.cos(sky.sun_elevation), 0.0, np.sin(sky.sun_elevation)])
    start = np.broadcast_to(viewer, directions.shape)
    b = start[..., 2] * directions[..., 2]
    inside = b * b - (viewer[2] ** 2 - RADIUS_KM**2)
    grounded = (inside > 0.0) & (b < 0.0)
    to_ground = -b - np.sqrt(np.maximum(inside, 0.0))
    step = np.where(grounded, to_ground, _to_sphere(start, directions, RADIUS_KM + THICKNESS_KM)) / FOUR_STEPS
    passed, radiance = 1.0, 0.0
    straight_up = _lookup(table, np.ones(1), np.zeros(1))
    for k in range(FOUR_STEPS):
        place = viewer + ((k + 0.5) * step)[..., None] * directions
        radius = np.linalg.norm(place, axis=-1)
        height = np.maximum(radius - RADIUS_KM, 0.0)
        sine = place @ sun / radius
        air, aerosol, lost = _coefficients(sky, height)
        to_sun = _lookup(table, sine, height / THICKNESS_KM)
        # Second order from the ground: sun on the ground, its share of all directions, and on to this height.
        share = 0.5 * (1.0 - np.sqrt(np.maximum(1.0 - (RADIUS_KM / np.maximum(radius, RADIUS_KM)) ** 2, 0.0)))
        rising = straight_up / _lookup(table, np.ones_like(sine), height / THICKNESS_KM)
        ground = (ALBEDO / np.pi * share * sine)[..., None] * _lookup(table, sine, np.zeros_like(sine)) * rising
        multiple = ground + MULTIPLE_FOUR / (1.0 + 5.0 * np.exp(-17.92 * sine))[..., None]
        source = np.stack([air * to_sun, aerosol * to_sun, (air + aerosol) * multiple])
        survives = np.exp(-lost * step[..., None])
        radiance = radiance + passed * source * (1.0 - survives) / np.maximum(lost, 1e-7)  # Hillaire 2016
        passed = passed * survives
    return radiance * SUN_FOUR


# ----------------------------------------------------------------------------------------------------- Preetham

# Coefficients of Perez' formula for luminance Y and chromaticities x and y: each of A…E is a T + b in turbidity T.
PEREZ = np.array([
    [(0.1787, -1.4630), (-0.3554, 0.4275), (-0.0227, 5.3251), (0.1206, -2.5771), (-0.0670, 0.3703)],
    [(-0.0193, -0.2592), (-0.0665, 0.0008), (-0.0004, 0.2125), (-0.0641, -0.8989), (-0.0033, 0.0452)],
    [(-0.0167, -0.2608), (-0.0950, 0.0092), (-0.0079, 0.2102), (-0.0441, -1.6537), (-0.0109, 0.0529)],
])  # fmt: skip
# Chromaticity of the zenith: rows T^2, T, 1; columns powers 3 to 0 of the sun's distance from it.
ZENITH_X = np.array([[0.00166, -0.00375, 0.00209, 0], [-0.02903, 0.06377, -0.03202, 0.00394], [0.11693, -0.21196, 0.06052, 0.25886]])  # fmt: skip  # noqa: E501
ZENITH_Y = np.array([[0.00275, -0.00610, 0.00317, 0], [-0.04214, 0.08970, -0.04153, 0.00516], [0.15346, -0.26756, 0.06670, 0.26688]])  # fmt: skip  # noqa: E501
KILOCANDELA = 0.06  # radiance in Blender's units for a kilocandela per m2


def _preetham(sky: Sky, directions: np.ndarray) -> np.ndarray:
    """(…, 3) scene-linear radiance of unit directions in the sun's frame."""
    turbidity, sun_angle = sky.turbidity, np.pi / 2 - sky.sun_elevation
    powers = np.array([sun_angle**3, sun_angle**2, sun_angle, 1.0])
    turbidities = np.array([turbidity**2, turbidity, 1.0])
    chi = (4.0 / 9.0 - turbidity / 120.0) * (np.pi - 2.0 * sun_angle)
    zenith = np.array([
        KILOCANDELA * ((4.0453 * turbidity - 4.9710) * np.tan(chi) - 0.2155 * turbidity + 2.4192),
        turbidities @ ZENITH_X @ powers, turbidities @ ZENITH_Y @ powers,
    ])  # fmt: skip
    angle = np.minimum(np.arccos(np.clip(directions[..., 2], -1.0, 1.0)), np.pi / 2 - 0.001)
    sun = np.array([np.cos(sky.sun_elevation), 0.0, np.sin(sky.sun_elevation)])
    gamma = np.arccos(np.clip(directions @ sun, -1.0, 1.0))
    a, b, c, d, e = (PEREZ @ np.array([turbidity, 1.0])).T

    def perez(angle, gamma):
        angle, gamma = np.asarray(angle)[..., None], np.asarray(gamma)[..., None]
        return (1.0 + a * np.exp(b / np.cos(angle))) * (1.0 + c * np.exp(d * gamma) + e * np.cos(gamma) ** 2)

    y_luminance, x, y = np.moveaxis(zenith * perez(angle, gamma) / perez(0.0, sun_angle), -1, 0)
    xyz = np.stack([x / y * y_luminance, y_luminance, (1.0 - x - y) / y * y_luminance], axis=-1)
    return _rgb(xyz)


# ----------------------------------------------------------------------------------------------- Hosek and Wilkie

# terms (3, 2, 10, 6, 9) and radiance (3, 2, 10, 6) for X, Y and Z, ground albedos 0 and 1, turbidities 1 to 10, points
# of a Bezier curve over the cube root of the sun's elevation: (c) 2012 Lukas Hosek and Alexander Wilkie, under the
# 3-clause BSD licence.
FITTED = Path(__file__).with_name("hosek_wilkie.npz")
LUMENS = 683.0  # of a watt at 555 nm


@cache
def _fitted() -> dict[str, np.ndarray]:
    with np.load(FITTED) as stored:
        return {name: stored[name].astype(float) for name in stored.files}


def _hosek_terms(sky: Sky) -> tuple[np.ndarray, np.ndarray]:
    """(9, 3) terms of the formula and (3,) mean radiance for X, Y and Z."""
    share = (max(sky.sun_elevation, 0.0) / (np.pi / 2)) ** (1.0 / 3.0)
    curve = np.array([comb(5, k) * share**k * (1.0 - share) ** (5 - k) for k in range(6)])
    albedo = float(np.clip(sky.ground_albedo, 0.0, 1.0))
    turbidity = float(np.clip(sky.turbidity, 1.0, 10.0)) - 1.0
    low = min(int(turbidity), 8)
    weights = np.zeros((2, 10))
    weights[:, low : low + 2] = np.outer([1.0 - albedo, albedo], [1.0 - (turbidity - low), turbidity - low])
    fitted = _fitted()
    return (
        np.einsum("cabet,ab,e->tc", fitted["terms"], weights, curve),
        np.einsum("cabe,ab,e->c", fitted["radiance"], weights, curve),
    )


def _hosek_wilkie(sky: Sky, directions: np.ndarray) -> np.ndarray:
    """(…, 3) scene-linear radiance of unit directions in the sun's frame (equation 8 of the paper)."""
    (a, b, c, d, e, f, g, i, h), mean = _hosek_terms(sky)
    cosine = np.maximum(directions[..., 2], np.sin(0.001))[..., None]
    elevation = max(sky.sun_elevation, 0.0)
    sun = np.array([np.cos(elevation), 0.0, np.sin(elevation)])
    near = np.clip(directions @ sun, -1.0, 1.0)[..., None]
    gamma = np.arccos(near)
    forward = (1.0 + near * near) / (1.0 + h * h - 2.0 * h * near) ** 1.5
    zenith = 1.0 + a * np.exp(b / (cosine + 0.01))
    around = c + d * np.exp(e * gamma) + f * near * near + g * forward + i * np.sqrt(cosine)
    return _rgb(zenith * around * mean * (2.0 * np.pi / LUMENS))
