"""Panoramic cameras: which direction each place of the film sees, by Cycles' conventions.

Sources: the projections of Cycles' `camera/projection.h`; Bourke's notes on fisheyes (equidistant r = f theta,
equisolid r = 2 f sin(theta / 2)); Debevec 1998 for the mirror ball. Directions are unit vectors (right, up, forward) of
the camera; places of the film run from 0 to 1 over its width and height. Shaders have the same functions
(shaders/view/panorama.glsl).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# By Blender's name; the number is that of shaders/view/panorama.glsl.
PROJECTIONS = {
    "EQUIRECTANGULAR": 1,
    "FISHEYE_EQUIDISTANT": 2,
    "FISHEYE_EQUISOLID": 3,
    "FISHEYE_LENS_POLYNOMIAL": 4,
    "MIRRORBALL": 5,
    "EQUIANGULAR_CUBEMAP_FACE": 6,
    "CENTRAL_CYLINDRICAL": 7,
}


@dataclass(frozen=True)
class Stereo:
    """An eye of a spherical pair: `offset` metres to the right, which fades from the altitude `merge_from` to
    `merge_to`, radians (0: it does not); `convergence` is where both eyes look at the same place, m, infinite if they
    look in parallel."""

    offset: float
    convergence: float = np.inf
    merge_from: float = 0.0
    merge_to: float = 0.0


@dataclass(frozen=True)
class Panorama:
    """`values`, by projection:

    EQUIRECTANGULAR      longitude from, to, latitude from, to, radians
    FISHEYE_EQUIDISTANT  field of view, radians
    FISHEYE_EQUISOLID    field of view, focal length, width and height of the sensor, mm
    FISHEYE_LENS_POLYNOMIAL  the same with 0 for the focal length, then five coefficients
    CENTRAL_CYLINDRICAL  longitude from, to, height from, to at a distance of 1

    `window`: left, bottom, right and top of what the picture shows of the film; a viewport also shows what lies beyond.
    """

    projection: str
    values: tuple[float, ...] = ()
    stereo: Stereo | None = None
    window: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0)

    def film(self, u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Places of the film from shares of the picture's width and height."""
        left, bottom, right, top = self.window
        return left + (right - left) * u, bottom + (top - bottom) * v

    def directions(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        """(..., 3) of places of the film; 0 where it sees nothing."""
        u, v = np.broadcast_arrays(np.asarray(u, np.float64), np.asarray(v, np.float64))
        with np.errstate(invalid="ignore", divide="ignore"):
            found = getattr(self, "_" + self.projection.lower())(u, v, self.values)
        length = np.linalg.norm(found, axis=-1, keepdims=True)
        return np.where(length > 0.0, found / np.maximum(length, 1e-30), 0.0)

    @staticmethod
    def _equirectangular(u, v, values):
        longitude = values[0] + (values[1] - values[0]) * u
        latitude = values[2] + (values[3] - values[2]) * v
        across = np.cos(latitude)
        return np.stack([across * np.sin(longitude), np.sin(latitude), across * np.cos(longitude)], axis=-1)

    @staticmethod
    def _fisheye_equidistant(u, v, values):
        x, y = 2.0 * u - 1.0, 2.0 * v - 1.0
        radius = np.hypot(x, y)
        return _fisheye(x, y, radius, np.where(radius > 1.0, np.nan, 0.5 * values[0] * radius))

    @staticmethod
    def _fisheye_equisolid(u, v, values):
        fov, lens, width, height = values
        x, y = (u - 0.5) * width, (v - 0.5) * height
        radius = np.hypot(x, y)
        seen = radius <= 2.0 * lens * np.sin(0.25 * fov)
        return _fisheye(x, y, radius, np.where(seen, 2.0 * np.arcsin(radius / (2.0 * lens)), np.nan))

    @staticmethod
    def _fisheye_lens_polynomial(u, v, values):
        fov, _, width, height, *terms = values
        x, y = (u - 0.5) * width, (v - 0.5) * height
        radius = np.hypot(x, y)
        angle = -np.polynomial.polynomial.polyval(radius, terms)
        return _fisheye(x, y, radius, np.where(np.abs(angle) <= 0.5 * fov, angle, np.nan))

    @staticmethod
    def _mirrorball(u, v, values):
        x, y = 2.0 * u - 1.0, 2.0 * v - 1.0
        z = np.sqrt(np.maximum(1.0 - x * x - y * y, 0.0))
        seen = (x * x + y * y <= 1.0)[..., None]
        return np.where(seen, np.stack([2.0 * z * x, 2.0 * z * y, 2.0 * z * z - 1.0], axis=-1), 0.0)

    @staticmethod
    def _equiangular_cubemap_face(u, v, values):
        x, y = (np.tan(0.25 * np.pi * (2.0 * place - 1.0)) for place in (u, v))
        return np.stack([x, y, np.ones_like(x)], axis=-1)

    @staticmethod
    def _central_cylindrical(u, v, values):
        longitude = values[0] + (values[1] - values[0]) * u
        height = values[2] + (values[3] - values[2]) * v
        return np.stack([np.sin(longitude), height, np.cos(longitude)], axis=-1)


def _fisheye(x, y, radius, angle):
    """Directions at an angle to the axis, towards a place of the film; 0 where the angle is not a number."""
    away = np.where(radius > 0.0, np.sin(angle) / np.maximum(radius, 1e-30), 0.0)
    found = np.stack([x * away, y * away, np.cos(angle)], axis=-1)
    return np.where(np.isnan(angle)[..., None], 0.0, found)


def panorama_of(data, width: float, height: float, eye: str = "") -> Panorama:
    """That of a camera's data; `width` and `height` of the picture in square pixels; `eye` as of camera_of_scene.

    Raises ValueError, a sentence without its subject, where it is of a kind that is not drawn.
    """
    projection = data.panorama_type
    if projection not in PROJECTIONS:
        raise ValueError(f"panorama type {projection.replace('_', ' ').title()} is not supported; choose another.")
    values: tuple[float, ...] = ()
    if projection == "EQUIRECTANGULAR":
        values = data.longitude_min, data.longitude_max, data.latitude_min, data.latitude_max
    elif projection == "FISHEYE_EQUIDISTANT":
        values = (data.fisheye_fov,)
    elif projection.startswith("FISHEYE"):
        fit = data.sensor_fit
        if fit == "AUTO":
            fit = "HORIZONTAL" if width >= height else "VERTICAL"
        side = data.sensor_height if data.sensor_fit == "VERTICAL" else data.sensor_width
        sensor = (side, side * height / width) if fit == "HORIZONTAL" else (side * width / height, side)
        values = data.fisheye_fov, data.fisheye_lens, *sensor
        if projection == "FISHEYE_LENS_POLYNOMIAL":
            values = data.fisheye_fov, 0.0, *sensor, *(getattr(data, f"fisheye_polynomial_k{k}") for k in range(5))
    elif projection == "CENTRAL_CYLINDRICAL":
        radius = data.central_cylindrical_radius or 1.0
        values = (
            data.central_cylindrical_range_u_min, data.central_cylindrical_range_u_max,
            data.central_cylindrical_range_v_min / radius, data.central_cylindrical_range_v_max / radius,
        )  # fmt: skip
    return Panorama(projection, tuple(float(value) for value in values), _stereo(data.stereo, eye) if eye else None)


def _stereo(stereo, eye: str) -> Stereo:
    merges = stereo.use_pole_merge
    return Stereo(
        (-0.5 if eye == "left" else 0.5) * stereo.interocular_distance,
        np.inf if stereo.convergence_mode == "PARALLEL" else stereo.convergence_distance,
        stereo.pole_merge_angle_from if merges else 0.0, stereo.pole_merge_angle_to if merges else 0.0,
    )  # fmt: skip


def bends_lines(snapshot) -> str | None:
    """Why what is drawn as straight lines into the picture, or looked for along them, is left out; else None."""
    if snapshot.camera is None or snapshot.camera.panorama is None:
        return None
    return "a panoramic camera shows straight lines bent"
