"""The point spread function of an eye on the GPU: aperture, diffraction, colours, and a kernel over a picture's pixels.

The steps and their formulas are those of addon/eye/optics.py, which is the reference in numpy. The aperture is drawn at
twice the side (else the transform turns its jagged edges into light), obstacles as boxes that multiply what is there.

| pass, pattern of N x N | reads per texel | writes |
|---|---|---|
| pupil and lids | – | R16F 2N x 2N |
| strokes (300 to 3000 instances) | 2 per vertex | R16F, multiplied |
| amplitude | 4 | RG32F N x N |
| transform, 2 x 3 to 4 passes | 12 to 12.5 per axis | RG32F |
| intensity | 1 | R32F N x N |
| colours, within 1/1.51 of the radius | 5 x 32 up to 5 x .68 radius | RGBA32F N x N |
| over pixels | 4 per pixel, or about 4 N^2 in all | RGBA32F, kernel |
| three sums, tail | 4 in all | RGBA32F, kernel |

Bytes: 60 N^2 borrowed while it runs, 16 per texel of the kernel kept.

Bias: one plane of scatterers, one defocus for all wavelengths, what light lies beyond the pattern (6 degrees times
magnification / 10 at N = 2048) is missing. Aperture in half floats: 5e-4 of an opacity.

Source: Ritschel, Ihrke, Frisvad, Coppens, Myszkowski and Seidel, "Temporal glare: real-time dynamic simulation of the
scattering in the human eye", Eurographics 2009; Ritschel 2009, chapter 8.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np

from ..gfx import geometry, images, library, passes
from ..gfx.context import on_release
from ..gfx.library import Program
from ..kernels import fft, reduction
from . import lids, optics, spectrum
from .aperture import WINDOW, Aperture

SUPERSAMPLING = 2
PUPIL = passes.fullscreen_program(
    "eye: pupil and lids",
    "eye/aperture.frag.glsl",
    constants=(
        ("FLOAT", "pupil_radius_mm"), ("VEC2", "lid_upper"), ("VEC2", "lid_lower"), ("FLOAT", "texel_mm"),
        ("FLOAT", "window_mm"),
    ),
    outputs=(("VEC4", "out_open"),),
)  # fmt: skip
STROKES = Program(
    name="eye: particles, fibres and lashes",
    vertex="eye/stroke.vert.glsl",
    fragment="eye/stroke.frag.glsl",
    inputs=(("VEC2", "corner"),),
    varyings=(("flat", "VEC4", "ends"), ("flat", "VEC4", "brush"), ("smooth", "VEC2", "place_mm")),
    textures=(("FLOAT_2D", "strokes"),),
    constants=(("FLOAT", "texel_mm"), ("FLOAT", "window_mm")),
    outputs=(("VEC4", "out_open"),),
)
FIELD = passes.fullscreen_program(
    "eye: amplitude",
    "eye/field.frag.glsl",
    textures=(("FLOAT_2D", "aperture"),),
    constants=(("FLOAT", "spacing_mm"), ("FLOAT", "window_mm"), ("FLOAT", "phase_per_mm2")),
    outputs=(("VEC4", "out_field"),),
)
CARRY = passes.fullscreen_program(
    "eye: field carried to the next plane",
    "eye/carry.frag.glsl",
    textures=(("RG32F", "field"),),
    constants=(("FLOAT", "phase_per_step2"),),
    outputs=(("VEC4", "out_field"),),
)
THROUGH = passes.fullscreen_program(
    "eye: field behind a plane",
    "eye/through.frag.glsl",
    textures=(("RG32F", "field"), ("FLOAT_2D", "aperture")),
    outputs=(("VEC4", "out_field"),),
)
INTENSITY = passes.fullscreen_program(
    "eye: intensity",
    "eye/intensity.frag.glsl",
    textures=(("RG32F", "field"),),
    constants=(("FLOAT", "scale"),),
    outputs=(("VEC4", "out_intensity"),),
)
COLOURS = passes.fullscreen_program(
    "eye: colours of diffraction",
    "eye/colours.frag.glsl",
    textures=(("R32F", "pattern"), ("RGBA32F", "spectrum")),
    constants=(
        ("INT", "least"), ("INT", "most"), ("FLOAT", "usable"), ("FLOAT", "fade_from"), ("FLOAT", "steps_per_texel"),
    ),
    outputs=(("VEC4", "out_colour"),),
)  # fmt: skip
OVER_PIXELS = passes.fullscreen_program(
    "eye: pattern over pixels",
    "eye/over_pixels.frag.glsl",
    textures=(("RGBA32F", "pattern"),),
    constants=(("INT", "reach"), ("INT", "steps"), ("FLOAT", "texels_per_pixel")),
    outputs=(("VEC4", "out_weight"),),
)
TAIL = passes.fullscreen_program(
    "eye: kernel without its core",
    "eye/tail.frag.glsl",
    textures=(("RGBA32F", "weights"), ("RGBA32F", "kernel_sum"), ("RGBA32F", "rim_sum")),
    constants=(("INT", "reach"), ("FLOAT", "core"), ("FLOAT", "rim"), ("FLOAT", "per_rim_texel")),
    outputs=(("VEC4", "out_weight"),),
)

RIM_LIGHT = reduction.ReductionSource(
    "rim of the core",
    """vec4 reduction_source(ivec2 texel)
{
  float radius = length(vec2(texel - ivec2(reach)));
  bool on_rim = radius >= core && radius < rim * core;
  return on_rim ? vec4(weights_fetch(texel).rgb, 0.0) : vec4(0.0);
}
""",
    textures=(("RGBA32F", "weights"),),
    constants=(("INT", "reach"), ("FLOAT", "core"), ("FLOAT", "rim")),
)
RIM_SUM = reduction.block_program(RIM_LIGHT)


@dataclass(eq=False)
class Kernel:
    """Weights over pixels, in the picture's three channels, and their sum: RGBA32F images of the pool."""

    weights: images.Image  # (extent, extent), straight direction in the middle
    share: images.Image  # one texel: how much of the light leaves the straight way
    scale: optics.Scale

    def release(self) -> None:
        images.pool.give(self.weights)
        images.pool.give(self.share)


@dataclass(eq=False)
class Pattern:
    """White light's pattern at infinity, RGBA32F side x side, and the aperture it comes from (R16F, twice the side)."""

    colours: images.Image
    aperture: images.Image

    def release(self) -> None:
        images.pool.give(self.colours)
        images.pool.give(self.aperture)


_kept: dict[str, object] = {}


def draw_aperture(aperture: Aperture, target: images.Target) -> None:
    """The transmittance over the whole window into an R16F target."""
    texel = WINDOW / target.size[0]
    upper, lower = lids.heights(aperture.closed)
    size = {"texel_mm": texel, "window_mm": WINDOW}
    passes.fullscreen(
        PUPIL, target,
        constants={
            "pupil_radius_mm": 0.5 * aperture.diameter, "lid_upper": (upper, lids.UPPER_BEND),
            "lid_lower": (lower, lids.LOWER_BEND), **size,
        },
    )  # fmt: skip
    if not len(aperture.strokes):
        return
    entries = images.upload_list(aperture.strokes.reshape(-1, 4))
    shader = library.get(STROKES)
    with passes.drawing(target, blend="MULTIPLY", depth_test="NONE", depth_write=False):
        shader.bind(textures={"strokes": entries}, constants=size)
        passes.draw(shader, unit_square(), len(aperture.strokes))


def unit_square() -> geometry.Batch:
    if "square" not in _kept:
        corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
        _kept["square"] = geometry.triangle_batch(
            geometry.vertex_buffer(corner=corners), np.array([[0, 1, 2], [0, 2, 3]])
        )
    return _kept["square"]


def _spectrum(light: spectrum.Light) -> images.Image:
    """Its table, of which that of the last light is kept: temperatures and colours may change from frame to frame."""
    if _kept.get("light") != light:
        _kept["light"], _kept["spectrum"] = light, images.upload(spectrum.table(*light)[None])
    return _kept["spectrum"]


@on_release
def _release() -> None:
    _kept.clear()


def diffract(aperture: images.Image, defocus: float, target: images.Target, *behind: images.Image) -> None:
    """|F|^2 of an aperture (R16F, twice the side) into an R32F target, over the open square's light; see optics.
    `behind`: what stands in planes behind it, optics.APART."""
    side = target.size[0]
    phase = np.pi * defocus * 1e-3 / (spectrum.BASE * optics.NANOMETRE)
    with images.borrowed(side, side, "RG32F") as field, images.borrowed(side, side, "RG32F") as spare:
        passes.fullscreen(
            FIELD, field, textures={"aperture": aperture},
            constants={"spacing_mm": WINDOW / side, "window_mm": WINDOW, "phase_per_mm2": phase},
        )  # fmt: skip
        found, spare = fft.transform(field, spare)
        for distance, plane in zip(optics.APART, behind):
            phase = np.pi * spectrum.BASE * optics.NANOMETRE * distance / WINDOW**2
            passes.fullscreen(
                CARRY, spare, textures={"field": found.colors[0]}, constants={"phase_per_step2": phase}
            )  # fmt: skip
            field, spare = fft.transform(spare, found, inverse=True)
            passes.fullscreen(THROUGH, spare, textures={"field": field.colors[0], "aperture": plane})
            found, spare = fft.transform(spare, field)
        # Within the range of floats whatever the side: the brightest texel is at most 1.
        constants = {"scale": float(side) ** -4}
        passes.fullscreen(INTENSITY, target, textures={"field": found.colors[0]}, constants=constants)


def colour(
    pattern: images.Image, target: images.Target, least: int = 32, most: int = optics.MOST_WAVELENGTHS,
    light: spectrum.Light = (spectrum.EQUAL, None),
) -> None:  # fmt: skip
    """A light's pattern from that of 575 nm; at least `least` wavelengths each, more further out up to `most`. `light`:
    as spectrum.of_light takes it."""
    passes.fullscreen(
        COLOURS, target, textures={"pattern": pattern, "spectrum": _spectrum(light)},
        constants={
            "least": least, "most": max(most, least), "usable": optics.usable_radius(pattern.width),
            "fade_from": optics.FADE_FROM, "steps_per_texel": optics.STEPS_PER_TEXEL,
        },
    )  # fmt: skip


def make_pattern(
    aperture: Aperture, side: int, defocus: float, least: int = 32, most=optics.MOST_WAVELENGTHS,
    light: spectrum.Light = (spectrum.EQUAL, None), planes: bool = False,
) -> Pattern:  # fmt: skip
    """Everything up to the colours. `planes`: what scatters stands in three planes instead of one."""
    fine = SUPERSAMPLING * side
    made = Pattern(images.pool.take(side, side, "RGBA32F"), images.pool.take(fine, fine, "R16F"))
    draw_aperture(aperture, images.Target((made.aperture,)))
    with images.borrowed(side, side, "R32F") as pattern:
        with ExitStack() as taken:
            apart = [taken.enter_context(images.borrowed(fine, fine, "R16F")) for _ in range(3 if planes else 0)]
            for plane, target in enumerate(apart):
                draw_aperture(optics.plane_of(aperture, plane), target)
            diffract(*([one.colors[0] for one in apart[:1]] or [made.aperture]), defocus, pattern,
                     *(one.colors[0] for one in apart[1:]))  # fmt: skip
        colour(pattern.colors[0], images.Target((made.colours,)), least, most, light)
    return made


def make_kernel(pattern: images.Image, scale: optics.Scale, sharp: bool = True) -> Kernel:
    """The pattern over a picture's pixels; `sharp`: without its core."""
    extent = scale.extent
    made = Kernel(images.pool.take(extent, extent, "RGBA32F"), images.pool.take(1, 1, "RGBA32F"), scale)
    core = {"reach": scale.reach, "core": scale.core if sharp else 0.0, "rim": optics.RIM}
    rim_texels = int(optics.rim(scale).sum()) if sharp else 0
    with (
        images.borrowed(extent, extent, "RGBA32F") as whole,
        images.borrowed(1, 1, "RGBA32F") as total,
        images.borrowed(1, 1, "RGBA32F") as rim,
    ):
        passes.fullscreen(
            OVER_PIXELS, whole, textures={"pattern": pattern},
            constants={
                "reach": scale.reach, "steps": max(int(np.ceil(scale.per_pixel)), 1),
                "texels_per_pixel": scale.per_pixel,
            },
        )  # fmt: skip
        reduction.reduce(reduction.TEXELS, (extent, extent), total, {"reduced": whole.colors[0]})
        rim.clear()
        if rim_texels:
            reduction.reduce(RIM_LIGHT, (extent, extent), rim, {"weights": whole.colors[0]}, core)
        passes.fullscreen(
            TAIL, images.Target((made.weights,)),
            textures={"weights": whole.colors[0], "kernel_sum": total.colors[0], "rim_sum": rim.colors[0]},
            constants={**core, "per_rim_texel": 1.0 / rim_texels if rim_texels else 0.0},
        )  # fmt: skip
    reduction.reduce(reduction.TEXELS, (extent, extent), images.Target((made.share,)), {"reduced": made.weights})
    return made


def pass_count(side: int, planes: bool = False) -> int:
    """Passes of `make_pattern`."""
    return 5 + fft.pass_count(side, side) * (5 if planes else 1) + (10 if planes else 0)
