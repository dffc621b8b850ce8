"""Discrete Fourier transforms of images, and products of transforms: convolution of pictures with large kernels.

A texel of an RGBA32F image holds two complex numbers, (xy) and (zw); of an RG32F image one. Real images go in pairs, as
real and imaginary part of one complex image, so that RGBA32F takes four real channels at once; `multiply` takes the
pairs apart by the symmetry of real images' transforms, F(-k) = conj F(k).

    forward   F(k) = sum over x of f(x) exp(-2 pi i k x / N)     as numpy.fft.fft2
    inverse   f(x) = 1 / N sum over k of F(k) exp(2 pi i k x / N)   as numpy.fft.ifft2

Stockham's order (each pass writes where the next one reads, nothing is reversed in the end) needs no shared memory and
no store to scattered places, so that every pass is a plain draw: on a software rasteriser an image store takes 20 ns, a
pixel of a draw 3 to 7. A texel computes its own output of a butterfly as a polynomial in one twiddle factor.

| cost of N x N texels | |
|---|---|
| passes | per axis one for each factor: 1024 = 8 x 8 x 4 x 4 takes 4, in all 8 |
| fetches, writes per texel | sum of the factors per axis: 24 for 1024; one write per pass |
| bytes per texel | 16 (RG32F: 8), and as many of a second image |

Sides are 2^a or 3 * 2^a (`fitting_side`). A picture in the corner of a larger image need not be padded: what lies
beyond counts as zero and is not read, rows that are zero before, or that nobody reads after, are left out (`extent`).

Bias: none; float32 leaves 2e-7 of the root mean square of the transform. Fails for other sides: ValueError.

Source: Govindaraju, Lloyd, Dotsenko, Smith and Manferdelli, "High performance discrete Fourier transforms on graphics
processors", SC 2008, listing 1.
"""

from __future__ import annotations

from ..gfx import passes
from ..gfx.images import Image, Target

RADICES = (8, 4, 3, 2)
FORMATS = ("RG32F", "RGBA32F")
_STEPS = ("ivec2(1, 0)", "ivec2(0, 1)")
_CONSTANTS = (("INT", "done"), ("INT", "apart"), ("INT", "filled"), ("FLOAT", "direction"), ("FLOAT", "scale"))
PASSES = {
    (radix, axis, kind): passes.fullscreen_program(
        f"Fourier transform, radix {radix}, axis {axis}, {kind}",
        "fft/pass.frag.glsl",
        textures=((kind, "field"),),
        constants=_CONSTANTS,
        defines=(("RADIX", str(radix)), ("STEP", _STEPS[axis]), *((("TWO", "1"),) if kind == "RGBA32F" else ())),
        outputs=(("VEC4", "out_field"),),
    )
    for radix in RADICES
    for axis in (0, 1)
    for kind in FORMATS
}
PROGRAMS = tuple(PASSES.values())
MULTIPLY = passes.fullscreen_program(
    "product of Fourier transforms",
    "fft/multiply.frag.glsl",
    textures=(("RGBA32F", "field"), ("RGBA32F", "factors")),
    outputs=(("VEC4", "out_field"),),
)


def fitting_side(least: int) -> int:
    """The smallest side that can be transformed and is not below `least`: 2^a or 3 * 2^a."""
    power = 1 << max(least - 1, 0).bit_length()
    return power * 3 // 4 if power >= 4 and power * 3 // 4 >= least else power


def factors(side: int) -> list[int]:
    """The radices of the passes along an axis of this length. Raises ValueError if there are none."""
    found, left = [], side
    if left % 3 == 0:
        found, left = [3], left // 3
    power = left.bit_length() - 1
    if left != 1 << power:
        raise ValueError(f"A side of {side} texels cannot be transformed; it must be 2^a or 3 * 2^a.")
    eights, rest = divmod(power, 3)
    if rest == 1 and eights:  # 16 as 4 x 4 costs fewer fetches than as 8 x 2
        return [*[8] * (eights - 1), 4, 4, *found]
    return [*[8] * eights, *([1 << rest] if rest else []), *found]


def transform(
    field: Target, spare: Target, *, inverse: bool = False, extent: tuple[int, int] | None = None
) -> tuple[Target, Target]:
    """Transform the image of `field`; `spare` is a target of the same size and format.

    Returns them in the order (result, other). `extent`: the rectangle from the corner that is not zero (forward), or
    that is read afterwards (inverse); what the image holds beyond does not matter. Raises ValueError for a side that
    cannot be transformed.
    """
    size = field.size
    extent = extent or size
    steps = [(axis, radix) for axis in ((1, 0) if inverse else (0, 1)) for radix in factors(size[axis])]
    done = 1
    for number, (axis, radix) in enumerate(steps, 1):
        side = size[axis]
        passes.fullscreen(
            PASSES[radix, axis, field.colors[0].format], spare,
            rows=(0, extent[1]) if axis == 0 else None,  # the others are zero, or nobody reads them
            textures={"field": field.colors[0]},
            constants={
                "done": done, "apart": side // radix, "direction": 1.0 if inverse else -1.0,
                "filled": extent[axis] if done == 1 and not inverse else side,
                "scale": 1.0 / (size[0] * size[1]) if inverse and number == len(steps) else 1.0,
            },
        )  # fmt: skip
        field, spare = spare, field
        done = 1 if done * radix == side else done * radix
    return field, spare


def pass_count(width: int, height: int) -> int:
    """Passes of one transform."""
    return len(factors(width)) + len(factors(height))


def multiply(field: Image, transformed: Image, target: Target) -> None:
    """The product of the transforms of four real images each, as pairs, into `target`: circular convolution."""
    passes.fullscreen(MULTIPLY, target, textures={"field": field, "factors": transformed})
