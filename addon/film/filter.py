"""Film filter: what a sample sees goes to every pixel whose filter covers it.

A sample looks at the same place x of every pixel, so that its points are a grid one pixel apart. The filter w of a
pixel (Blackman-Harris, as in Cycles) is some pixels wide, and covers points of the pixels around as well. Where places
are drawn in proportion to w, a point at y from a pixel's middle may be the pixel's own or that of one k pixels away,
and the balance heuristic (Veach and Guibas, "Optimally combining sampling techniques for Monte Carlo rendering",
SIGGRAPH 1995) gives it in this pixel

    W(y) = w(y) / sum over k of w(y - k)

The weights of a sample's points in a pixel sum to one: what is even stays even, also in a single sample. Each pixel has
several times as many points, most of them in the filter's tails, where its own are few and each counted in full: there
lay the error at edges between very bright and dark.

Within twice the filter's reach of the picture's rim, where some of the pixels around are missing, only own points
count, along the axis that leads to the rim. So the mean of all samples is the filtered picture in every pixel.

relMSE of direct light at 256x192, own points alone, and so: 16 samples window .073 .019, hall .093 .041, instances .024
.0075, garden .0068 .0026, Cornell box .0019 .0003, foliage .0102 .0042, product .0076 .0042; 64 samples .0065 .0013,
.0039 .0022, .0024 .0008, .0008 .0003, .0002 .00005, .0012 .0005, .0008 .0003.

| cost | per point of the film |
|---|---|
| passes | 1 for up to 6 images |
| fetches per pixel and image | 9 (filters of up to 1.5 pixels' radius), 25 (up to 2.5), else 1 |

Bias: none. Wider and very narrow filters (below half a pixel) have own points only.
"""

from __future__ import annotations

from functools import cache, lru_cache

import numpy as np

from ..frame.light_paths import MEDIUM, TOGETHER, named
from ..frame.picture import Frame
from ..gfx import images, passes
from ..gfx.library import Program
from ..scene.view import blackman_harris

FARTHEST = 2  # pixels on each side: wider filters would cost more than samples
MOST_IMAGES = 6  # that Blender lets a pass draw into


def reach(width: float) -> int:
    """How many pixels on each side share a point with one, for a filter of that radius in pixels; 0: none do."""
    pixels = int(np.ceil(width - 0.5))
    return max(pixels, 0) if pixels <= FARTHEST else 0


def taps(place: float, width: float) -> tuple[int, np.ndarray]:
    """The pixel (counted from the own one) that `place`, in pixels from the own one's middle, lies in, and the weights
    (2 reach + 1) of the points in the pixels -reach..reach around any pixel, which sum to 1."""
    pixels = reach(width)
    if not pixels:
        return 0, np.ones(1)
    pixel = int(np.floor(place + 0.5))
    weights = blackman_harris((np.arange(-pixels, pixels + 1) + place - pixel) / width)
    return pixel, weights / weights.sum()


@lru_cache(maxsize=4096)
def _constants_of(place: float, width: float) -> tuple[int, tuple[float, ...], float]:
    """The pixel of `taps`, the first four of five weights, and the last."""
    pixel, weights = taps(place, width)
    padded = [*weights.tolist(), *[0.0] * (2 * FARTHEST + 1 - len(weights))]
    return pixel, tuple(padded[:4]), padded[4]


# What media let pass of an image on its way to the eye: nothing is lost of it, colours are, and of the image that holds
# the world what media hide counts as covered.
CLEAR, DIMMED, COVERED = range(3)
_SEEN = (
    "seen_{0}_fetch(place)", "vec4(passing.rgb, 1.0) * seen_{0}_fetch(place)",
    "film_dimmed(seen_{0}_fetch(place), passing.rgb)",
)  # fmt: skip


# Of programs that read shaders/film/filter_weights.glsl.
CONSTANTS = (
    ("FLOAT", "film_share"), ("IVEC2", "film_pixel"), ("VEC4", "weights_x"), ("VEC4", "weights_y"),
    ("VEC2", "last_weights"),
)  # fmt: skip


def place_constants(frame: Frame, place: tuple[float, float], share: float) -> dict:
    """Values of CONSTANTS for one point of the film, which counts `share` and lies at `place` of every pixel."""
    (x, *across), (y, *up) = (_constants_of(one, frame.snapshot.film.filter_width) for one in place)
    return {
        "film_share": share, "film_pixel": (x, y), "weights_x": across[0], "weights_y": up[0],
        "last_weights": (across[1], up[1]),
    }  # fmt: skip


@cache
def program(count: int, pixels: int, dimmed: tuple[int, ...] = ()) -> Program:
    """Adds `count` images of a sample to as many sums; `pixels` as of `reach`. `dimmed`: what media do to each; the
    image `through` then holds what they let pass."""
    each = range(count)
    seen = [_SEEN[kind] for kind in dimmed or (CLEAR,) * count]
    return passes.program_of_pixels(
        f"film filter, {count} images, {2 * pixels + 1} pixels wide",
        "film/filter.glsl",
        textures=(*(("RGBA32F", f"seen_{i}") for i in each), *((("RGBA32F", "through"),) if dimmed else ())),
        constants=CONSTANTS,
        defines=(
            ("PIXELS", str(pixels)),
            ("BEGIN_ALL", " ".join(f"vec4 sum_{i} = vec4(0.0);" for i in each)),
            (
                "GATHER_ALL",
                ("vec4 passing = through_fetch(place); " if dimmed else "")
                + " ".join(f"sum_{i} += weight * {seen[i].format(i)};" for i in each),
            ),
            ("END_ALL", " ".join(f"out_{i} = film_share * sum_{i};" for i in each)),
        ),
        outputs=tuple(("VEC4", f"out_{i}") for i in each),
    )  # fmt: skip


WORLD_SEEN = "radiance.environment"
PROGRAMS = tuple(program(count, pixels) for count in (1, MOST_IMAGES) for pixels in range(FARTHEST + 1))


def add(
    frame: Frame, seen: dict[str, images.Image], place: tuple[float, float], share: float,
    through: images.Image | None = None,
) -> int:  # fmt: skip
    """Add `share` of the images of one point of the film, which lies at `place` of every pixel (as Frame.film_offset),
    to the frame's images of these names. `through`: what media let pass there. Returns the number of passes."""
    width = frame.snapshot.film.filter_width
    constants = place_constants(frame, place, share)
    count = -(-len(seen) // MOST_IMAGES)
    for part in range(count):
        names = tuple(seen)[part::count]
        dimmed = () if through is None else tuple(_dimmed(name, WORLD_SEEN in seen) for name in names)
        passes.each_pixel(
            program(len(names), reach(width), dimmed),
            frame.target(*names),
            adds=True,
            textures={
                **{f"seen_{i}": seen[name] for i, name in enumerate(names)},
                **({"through": through} if dimmed else {}),
            },
            constants=constants,
        )
    return count


def _dimmed(name: str, world_apart: bool) -> int:
    """What media do to the image that is added to this sum. `world_apart`: the world has a sum of its own, and with it
    what covers it."""
    if name == "surface.normal_sum" or name.removeprefix("film.") in named(MEDIUM):
        return CLEAR
    return COVERED if name == WORLD_SEEN or (name == TOGETHER and not world_apart) else DIMMED
