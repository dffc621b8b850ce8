"""A camera as shaders read it, who make its rays of that: one projection for perspective and orthographic views."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property, lru_cache

import numpy as np

from ..gfx.struct import Struct
from ..sampling.sequence import pixel_bits
from ..snapshot.panorama import PROJECTIONS
from ..snapshot.scene import Camera, Film
from .geometry import CAMERA_FLAG

# `q` is the depth measure of every projection in Candela: it is an affine function of window coordinates on any
# plane (1/distance for perspective, distance along the axis for orthographic), and grows towards the viewer.
PANORAMA_FIELDS = "panorama", "panorama_more", "panorama_eye", "panorama_stereo", "panorama_film"
VIEW = Struct(
    "View",
    ("vec4", "row_x"),  # clip = dot(row, vec4(position, 1))
    ("vec4", "row_y"),
    ("vec4", "row_w"),
    ("vec4", "row_q"),
    ("vec4", "eye"),  # xyz position relative to the render origin; w: TO_VIEWER of shaders/lib/gbuffer.glsl
    ("vec4", "right"),  # w = jitter x, in pixels
    ("vec4", "up"),  # w = jitter y, in pixels
    ("vec4", "backward"),  # w = near distance of the depth buffer
    ("vec4", "frame"),  # left, right, bottom, top one unit before the eye, without jitter
    ("vec4", "film"),  # width, height in pixels; clip start, clip end in metres
    ("int", "sample_index"),
    ("int", "seed"),
    ("int", "bits_x"),  # this sample's Sobol' numbers, to be scrambled per pixel (lib/random.glsl)
    ("int", "bits_y"),
    ("int", "bits_z"),
    ("int", "bits_w"),
    ("int", "visibility"),  # flag of the instances that this view shows (addon/scene/geometry.py)
    # Pixels over which lookups of textures average (materials/averages.py); 0: what stands at the point.
    ("float", "footprint_exact"),
    ("float", "footprint_first"),
    # Of a panoramic camera: see shaders/view/panorama.glsl.
    *(("vec4", name) for name in PANORAMA_FIELDS),
)
STRAIGHT = dict.fromkeys(PANORAMA_FIELDS, (0.0, 0.0, 0.0, 0.0))  # those of any other view


@dataclass(frozen=True)
class View:
    """One camera over one pixel grid. `origin` is subtracted from all world positions before they reach the GPU."""

    camera: Camera
    film: Film
    origin: np.ndarray  # (3,) float64

    @property
    def size(self) -> tuple[int, int]:
        return self.film.border_size

    def frame(self) -> tuple[float, float, float, float]:
        """Left, right, bottom, top of the rendered rectangle (the border) one unit before the eye."""
        left, right, bottom, top = self.camera.frame
        x0, y0, x1, y1 = self.film.border
        width, height = right - left, top - bottom
        return (
            left + width * x0 / self.film.width,
            left + width * x1 / self.film.width,
            bottom + height * y0 / self.film.height,
            bottom + height * y1 / self.film.height,
        )

    def values(
        self,
        sample: int,
        seed: int,
        jitter: tuple[float, float],
        scene_size: float,
        lens: tuple[float, float] = (0, 0),
        footprints: tuple[float, float] = (0.0, 0.0),
    ) -> dict:
        """Fields of VIEW for one sample. `jitter` in pixels; `scene_size` in metres bounds the near plane below;
        `footprints`: as the last fields of VIEW.

        `lens`: the point of the aperture that is looked through, metres to the right and up. The frustum is sheared
        so that the plane in focus stays where it is.
        """
        orthographic = self.camera.kind == "ORTHOGRAPHIC"
        panorama = self._panorama(lens)
        lens = (0.0, 0.0) if self.camera.panorama else lens
        shear, frame, (right_axis, up, backward, eye), (x, y, depth) = self._looking(tuple(lens))
        left, right, bottom, top = frame
        width, height = self.size
        dx, dy = jitter[0] * (right - left) / width, jitter[1] * (top - bottom) / height
        left, right, bottom, top = left + dx, right + dx, bottom + dy, top + dy
        one = np.array([0.0, 0.0, 0.0, 1.0])
        start, end = self.camera.clip_start, self.camera.clip_end
        if orthographic:
            w, centre = one, one
            far = max(end, start + 1e-6)
            q = (one * far - depth) / (far - start)
            near = 1.0
            x, y = x + shear[0] * depth, y + shear[1] * depth
            # What the shaders take for the axis is the direction from which the picture's parallel rays come.
            backward = backward + shear[0] * right_axis + shear[1] * up
            backward = backward / np.linalg.norm(backward)
        else:
            w, centre, q = depth, depth, one
            # A tiny clip start would leave the depth buffer no precision; geometry closer than three
            # millionths of the scene's size is given up for it: .1 m under a sky of 10 km.
            near = max(start, 3e-6 * scene_size)
        row_x = (2.0 * x - (left + right) * centre) / (right - left)
        row_y = (2.0 * y - (bottom + top) * centre) / (top - bottom)
        seen = 2.0 if self.camera.from_above else float(orthographic)
        if self.camera.bends:
            seen = 1.25 if orthographic else -1.0
        return {
            "row_x": row_x, "row_y": row_y, "row_w": w, "row_q": q,
            "eye": (*eye.tolist(), seen), "right": (*right_axis.tolist(), jitter[0]),
            "up": (*up.tolist(), jitter[1]), "backward": (*backward.tolist(), near), "frame": frame,
            "film": (width, height, start, end),
            "sample_index": sample, "seed": seed,
            "visibility": CAMERA_FLAG, "footprint_exact": footprints[0], "footprint_first": footprints[1],
            **dict(zip(("bits_x", "bits_y", "bits_z", "bits_w"), pixel_bits(sample))), **panorama,
        }  # fmt: skip

    def _panorama(self, lens: tuple[float, float]) -> dict:
        """Fields of VIEW that only a panoramic camera has."""
        panorama, camera = self.camera.panorama, self.camera
        if panorama is None:
            return STRAIGHT
        values = (*panorama.values, *(0.0,) * 9)
        focus = camera.aperture.focus if camera.aperture and any(lens) else 0.0
        stereo = panorama.stereo
        if panorama.projection == "FISHEYE_LENS_POLYNOMIAL":
            values = (values[0], values[4], values[2], values[3], *values[5:])
        left, bottom = panorama.film(self.film.border[0] / self.film.width, self.film.border[1] / self.film.height)
        right, top = panorama.film(1.0 / self.film.width, 1.0 / self.film.height)
        return {
            "panorama": values[:4], "panorama_more": values[4:8],
            "panorama_eye": (*lens, focus, float(PROJECTIONS[panorama.projection])),
            "panorama_stereo": (0.0,) * 4 if stereo is None else (
                stereo.offset, stereo.convergence if np.isfinite(stereo.convergence) else 0.0,
                stereo.merge_from, stereo.merge_to,
            ),
            "panorama_film": (left, bottom, right - panorama.window[0], top - panorama.window[1]),
        }  # fmt: skip

    def _looking(self, lens: tuple[float, float]) -> tuple:
        """What all places of the film share that are looked at through a point of the aperture: how the frustum is
        sheared and its frame; right, up, backward and the eye; and as affine forms x, y and the distance along the
        axis. Kept for the last point."""
        last = self._last
        if last and last[0] == lens:
            return last[1]
        left, right, bottom, top = self.frame()
        shear = np.divide(lens, self.camera.aperture.focus) if any(lens) else np.zeros(2)
        if self.camera.kind != "ORTHOGRAPHIC":
            left, right, bottom, top = left - shear[0], right - shear[0], bottom - shear[1], top - shear[1]
        right_axis, up, backward, eye = (self.camera.matrix[:3, i] for i in range(4))
        eye = eye - self.origin + lens[0] * right_axis + lens[1] * up

        def affine(direction):
            return np.array((*direction.tolist(), 0.0 - float(direction @ eye)))

        found = (
            shear, (left, right, bottom, top), (right_axis, up, backward, eye),
            (affine(right_axis), affine(up), affine(-backward)),
        )  # fmt: skip
        last[:] = lens, found
        return found

    @cached_property
    def _last(self) -> list:
        return []


def blackman_harris(t: np.ndarray) -> np.ndarray:
    """The pixel filter at places t, whose support is -1..1; 1 in the middle."""
    phase = np.pi * (np.clip(t, -1.0, 1.0) + 1.0)
    return 0.35875 - 0.48829 * np.cos(phase) + 0.14128 * np.cos(2 * phase) - 0.01168 * np.cos(3 * phase)


@cache
def _blackman_harris() -> tuple[np.ndarray, np.ndarray]:
    """2,049 places in -1..1, and the filter's integral up to each."""
    t = np.linspace(-1.0, 1.0, 2049)
    density = blackman_harris(t)
    cumulative = np.cumsum((density[1:] + density[:-1]) * 0.5)
    return t, np.concatenate([[0.0], cumulative / cumulative[-1]])


@lru_cache(maxsize=4096)
def blackman_harris_offset(u: float, width: float) -> float:
    """Film offset in pixels for a uniform number, distributed as the Blackman-Harris filter of support +-width."""
    places, cumulative = _blackman_harris()
    return float(np.interp(u, cumulative, places) * width)
