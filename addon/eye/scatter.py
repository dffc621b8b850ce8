"""A picture's bright light scattered by a kernel of hundreds of pixels: by Fourier transforms, or by billboards.

    out = I - s w H + s (H * kernel)     H what exceeds white, w the kernel's sum, s the strength (s w at most 1)

Only what exceeds white is scattered, so that the rest stays sharp to the bit of its colour; energy is kept up to what
leaves the picture. Nothing wraps around: the transform's sides reach over the picture by the kernel's half.

By transforms, with P x Q the padded size, R the share of its rows that the picture fills:

| pass | reads per texel | |
|---|---|---|
| what exceeds white | 1 | of R P Q |
| transform of the picture | 24 for 1024 per axis | x: R P Q, y: P Q |
| the kernel's, once per kernel | 24 per axis | and one pass that lays it out |
| product | 4 | P Q |
| back | 24 per axis | y: P Q, x: R P Q |
| sum | 2 | of the picture |

Bytes: 48 per padded texel borrowed, 16 of them kept for the kernel. `factor` 2 or 4 scatters in pixels as much larger
and reads the result bilinearly: a quarter or a sixteenth of all that, needles a little softer.

Billboards add the kernel once for each tile of 16 x 16 pixels that holds bright light, about its centre of gravity:
fast for few small sources, wrong in shape within a tile for extended ones (needles stay needles where the convolution
washes them out); energy is kept.

A picture of few samples holds pixels that one lucky path made bright. `plausible` is the picture without them, in one
pass of 25 x 4 fetches; given as `dazzling`, it alone scatters, and what is left out stays in its pixel.

Source: Ritschel et al. 2009, which convolves the whole picture with the whole kernel; the split is ours.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass

from ..gfx import images, library, passes
from ..gfx.library import Program
from ..kernels import fft, reduction
from .point_spread import Kernel, unit_square

FACTORS = (1, 2, 4)
TILE = 16
# Most contrast of indirect light in a pixel to the fourth brightest of 5x5 in a picture of one sample; of n samples n²
# times as much: a path found once counts an n-th there, and by chance less often. From UNLIMITED on none is left out.
CONTRAST = 4.0
UNLIMITED = 16
MOST_LIGHT = 1e6  # of the picture's unit; what is brighter counts as that, so that infinity scatters something finite
_WHITE = (("FLOAT", "white"), ("FLOAT", "most_light"))
BRIGHT = tuple(
    passes.fullscreen_program(
        f"glare: what exceeds white, {factor}",
        "glare/bright.frag.glsl",
        textures=(("RGBA32F", "picture"),),
        constants=_WHITE,
        defines=(("FACTOR", str(factor)),),
        outputs=(("VEC4", "out_light"),),
    )
    for factor in FACTORS
)
COMBINE = tuple(
    passes.fullscreen_program(
        f"glare: sum, {factor}",
        "glare/combine.frag.glsl",
        textures=(("RGBA32F", "picture"), ("RGBA32F", "dazzling"), ("RGBA32F", "scattered"), ("RGBA32F", "share")),
        constants=(*_WHITE, ("FLOAT", "strength"), ("FLOAT", "dimming")),
        defines=(("FACTOR", str(factor)),),
        outputs=(("VEC4", "out_combined"),),
    )
    for factor in FACTORS
)
PLAUSIBLE = passes.fullscreen_program(
    "glare: plausible light",
    "glare/plausible.frag.glsl",
    textures=tuple(("RGBA32F", name) for name in ("picture", "emission", "environment", "reflected")),
    constants=(("FLOAT", "white"), ("FLOAT", "scale"), ("FLOAT", "world"), ("FLOAT", "most_contrast")),
    outputs=(("VEC4", "out_plausible"),),
)
WRAP = passes.fullscreen_program(
    "glare: kernel about the corner",
    "glare/wrap.frag.glsl",
    textures=(("RGBA32F", "weights"),),
    constants=(("IVEC2", "extent"), ("INT", "reach")),
    outputs=(("VEC4", "out_light"),),
)
TILES = passes.fullscreen_program(
    "glare: light of tiles",
    "glare/tiles.frag.glsl",
    textures=(("RGBA32F", "picture"),),
    constants=_WHITE,
    defines=(("SIDE", str(TILE)),),
    outputs=(("VEC4", "out_light"), ("VEC4", "out_place")),
)
BILLBOARDS = Program(
    name="glare: billboards",
    vertex="glare/billboard.vert.glsl",
    fragment="glare/billboard.frag.glsl",
    inputs=(("VEC2", "corner"),),
    varyings=(("flat", "VEC4", "light"), ("flat", "VEC2", "middle")),
    textures=(("FLOAT_2D", "tile_light"), ("FLOAT_2D", "tile_place"), ("FLOAT_2D", "weights")),
    constants=(("INT", "reach"), ("VEC2", "extent")),
    outputs=(("VEC4", "out_light"),),
)
BRIGHTNESS = reduction.ReductionSource(
    "brightness",
    """#include "glare/excess.glsl"
vec4 reduction_source(ivec2 texel)
{
  vec3 light = picture_fetch(texel).rgb;
  vec3 kept = clamp(finite_light(light), vec3(0.0), vec3(most_light));
  return vec4(luminance(kept), max_component(excess_of(light, white, most_light)), 0.0, max_component(kept));
}
""",
    textures=(("RGBA32F", "picture"),),
    constants=_WHITE,
)
DAZZLING = reduction.ReductionSource(
    "light that dazzles",
    """#include "glare/excess.glsl"
vec4 reduction_source(ivec2 texel)
{
  return vec4(excess_of(picture_fetch(texel).rgb, white, most_light), 0.0);
}
""",
    textures=(("RGBA32F", "picture"),),
    constants=_WHITE,
)
DAZZLES = reduction.block_program(DAZZLING)
MEASURE, BLOCKS = reduction.block_program(BRIGHTNESS), reduction.BLOCKS


@dataclass(frozen=True)
class Brightness:
    """Of a picture: the mean of its luminance, the sum of what exceeds white, the brightest channel of any pixel."""

    mean: float
    excess: float
    most: float


def measure(picture: images.Image, white: float) -> Brightness:
    """Waits for the GPU, and copies one texel."""
    with images.borrowed(1, 1, "RGBA32F") as target:
        constants = {"white": white, "most_light": MOST_LIGHT}
        reduction.reduce(BRIGHTNESS, picture.size, target, {"picture": picture}, constants)
        mean, excess, _, most = images.read(target.colors[0])[0, 0]
    return Brightness(float(mean) / (picture.width * picture.height), float(excess), float(most))


def plausible(
    picture: images.Image, straight: Mapping[str, images.Image], target: images.Target, *,
    scale: float, world: float, white: float, samples: int,
) -> int:  # fmt: skip
    """The picture, where light by way of other surfaces counts for no more than its surroundings and the number of
    samples hold plausible. Returns the number of passes.

    `straight`: sums over samples of what is seen straight, *emission*, *environment* and *reflected* (lamps in one
    reflection); `scale` times these is the picture's; `world`: 1 where the picture shows the environment, else 0.
    """
    constants = {"white": white, "scale": scale, "world": world, "most_contrast": CONTRAST * samples**2}
    passes.fullscreen(PLAUSIBLE, target, textures={"picture": picture, **straight}, constants=constants)
    return 1


def colour(picture: images.Image, white: float) -> tuple[float, float, float]:
    """Sum of what exceeds white, linear Rec. 709. Waits for the GPU, and copies one texel."""
    with images.borrowed(1, 1, "RGBA32F") as target:
        constants = {"white": white, "most_light": MOST_LIGHT}
        reduction.reduce(DAZZLING, picture.size, target, {"picture": picture}, constants)
        return tuple(float(channel) for channel in images.read(target.colors[0])[0, 0, :3])


def measure_passes(picture: images.Image) -> int:
    """Passes of `measure`, and of `colour`."""
    return reduction.pass_count(picture.size)


def dim(picture: images.Image, target: images.Target, dimming: float) -> int:
    """The picture with less light, and no glare. Returns the number of passes."""
    with images.borrowed(1, 1, "RGBA32F") as nothing:
        nothing.clear()
        passes.fullscreen(
            COMBINE[0], target,
            textures={"picture": picture, "dazzling": picture, "scattered": picture, "share": nothing.colors[0]},
            constants={"strength": 0.0, "dimming": dimming, "white": MOST_LIGHT, "most_light": MOST_LIGHT},
        )  # fmt: skip
    return 1


@dataclass(eq=False)
class Scatter:
    """Keeps the transform of the kernel it used last."""

    _kernel: Kernel | None = None
    _transformed: images.Target | None = None

    def convolve(
        self, picture: images.Image, kernel: Kernel, target: images.Target, *, white: float, strength: float,
        dimming: float = 1.0, factor: int = 1, dazzling: images.Image | None = None,
    ) -> int:  # fmt: skip
        """The picture with its glare into `target`; the kernel is of pixels `factor` times as large as the picture's.
        `dazzling`: the picture as far as it scatters, where that is not all.

        Returns the number of passes.
        """
        dazzling = dazzling or picture
        size = tuple(-(-side // factor) for side in picture.size)
        padded = tuple(fft.fitting_side(side + kernel.scale.reach) for side in size)
        number = FACTORS.index(factor)
        limits = {"white": white, "most_light": MOST_LIGHT}
        with images.borrowed(*padded, "RGBA32F") as bright, images.borrowed(*padded, "RGBA32F") as spare:
            transformed = self._transform_of(kernel, padded)
            passes.fullscreen(
                BRIGHT[number], bright, viewport=(0, 0, *size), textures={"picture": dazzling}, constants=limits
            )
            found, other = fft.transform(bright, spare, extent=size)
            fft.multiply(found.colors[0], transformed.colors[0], other)
            found, _ = fft.transform(other, found, inverse=True, extent=size)
            self._combine(number, picture, dazzling, found.colors[0], kernel, target, strength, dimming, limits)
        return 3 + 2 * fft.pass_count(*padded)

    def _transform_of(self, kernel: Kernel, padded: tuple[int, int]) -> images.Target:
        if self._kernel is kernel and self._transformed.size == padded:
            return self._transformed
        self.release()
        first, second = (images.Target((images.pool.take(*padded, "RGBA32F"),)) for _ in range(2))
        passes.fullscreen(
            WRAP, first, textures={"weights": kernel.weights},
            constants={"extent": padded, "reach": kernel.scale.reach},
        )  # fmt: skip
        self._transformed, other = fft.transform(first, second)
        self._kernel = kernel
        images.pool.give(other.colors[0])
        return self._transformed

    def billboards(
        self, picture: images.Image, kernel: Kernel, target: images.Target, *, white: float, strength: float,
        dimming: float = 1.0, dazzling: images.Image | None = None,
    ) -> int:  # fmt: skip
        """The same by a kernel for each tile that holds bright light."""
        dazzling = dazzling or picture
        tiles = tuple(-(-side // TILE) for side in picture.size)
        limits = {"white": white, "most_light": MOST_LIGHT}
        with ExitStack() as stack:
            light, place = (stack.enter_context(images.borrowed(*tiles, "RGBA32F")).colors[0] for _ in range(2))
            added = stack.enter_context(images.borrowed(*picture.size, "RGBA32F"))
            passes.fullscreen(TILES, images.Target((light, place)), textures={"picture": dazzling}, constants=limits)
            added.clear()
            shader = library.get(BILLBOARDS)
            with passes.drawing(added, blend="ADDITIVE_PREMULT", depth_test="NONE", depth_write=False):
                shader.bind(
                    textures={"tile_light": light, "tile_place": place, "weights": kernel.weights},
                    constants={"reach": kernel.scale.reach, "extent": picture.size},
                )
                passes.draw(shader, unit_square(), tiles[0] * tiles[1])
            self._combine(0, picture, dazzling, added.colors[0], kernel, target, strength, dimming, limits)
        return 3

    def _combine(self, number, picture, dazzling, scattered, kernel: Kernel, target, strength, dimming, limits) -> None:
        passes.fullscreen(
            COMBINE[number], target,
            textures={"picture": picture, "dazzling": dazzling, "scattered": scattered, "share": kernel.share},
            constants={"strength": strength, "dimming": dimming, **limits},
        )  # fmt: skip

    def release(self) -> None:
        if self._transformed is not None:
            images.pool.give(self._transformed.colors[0])
        self._transformed = self._kernel = None
