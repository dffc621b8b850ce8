"""Light paths that nobody looks at apart are summed up before the film filter, which then filters one image for all.

    together = sum over these paths of their light,  alpha = coverage - what of the world shows through clear glass

A pass that is asked for, and what a technique filters by itself (Denoise), keep their paths apart (Held.is_apart). The
pass that collects what needs no light adds the sample's light on its way, so that summing costs no pass of its own; at
other points of the film light is summed where it is carried over (shaders/film/between.frag.glsl).

| per point of the film, Cornell box, picture alone | apart | together |
|---|---|---|
| images filtered | 6 | 1 |
| texels fetched by the filter and written per pixel | 54, 6 | 9, 1 |
| images written before that | 10 | 2 |

Kept apart in any case: light in media, which the media before a surface do not dim, and light through glass where there
are media, since what of the world shows through it is not dimmed either.

Bias: none. Sums differ from those of paths by rounding: floats are added in another order.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache

from ..frame.light_paths import IN_MEDIA, LIGHT_PATHS, MEDIUM, SEEN, SURFACE, TOGETHER, LightPath
from ..frame.picture import Frame
from ..gfx import images, passes
from ..gfx.library import Program

SUM = TOGETHER.rpartition(".")[2]  # beside names of paths
BESIDE = ("color.diffuse", "color.glossy", "color.transmission", "surface.normal_sum")  # sums that are no light
COLLECTED = (*(path.image for path in LIGHT_PATHS if path.origin == SEEN), *BESIDE)  # what a point shows without light
MOST_FOLDED = 16  # textures that a pass may read
MOST_COLLECTED = 5  # beside the sum: a pass draws into six images


class Held:
    """What a picture holds (frame.shared), found when first asked for."""

    def __init__(self):
        self.collected: tuple[str, ...] | None = None


def collected(frame: Frame) -> tuple[str, ...]:
    """Images of what each point of the film shows without light, and of the sum of all that is not held apart."""
    known = frame.shared(Held)
    if known.collected is None:
        known.collected = _collected(frame)
    return known.collected


def _collected(frame: Frame) -> tuple[str, ...]:
    held = tuple(name for name in COLLECTED if frame.held.is_apart(name))
    summed = any(path.origin != MEDIUM and not frame.held.is_apart(path.image) for path in LIGHT_PATHS)
    return (TOGETHER, *held) if summed and len(held) <= MOST_COLLECTED else held


def held_apart(frame: Frame, path: LightPath) -> bool:
    """Whether a picture's light of this path has sums of its own."""
    if path.origin == MEDIUM or frame.held.is_apart(path.image) or TOGETHER not in collected(frame):
        return True
    return path.lobe == "transmission" and frame.plan.owns(IN_MEDIA)


def apart_of(frame: Frame, origin: str = SURFACE) -> tuple[str, ...]:
    """Names of the paths of this origin that a picture holds apart, in the table's order."""
    return tuple(path.name for path in LIGHT_PATHS if path.origin == origin and held_apart(frame, path))


def terms(names: Sequence[str], read: str) -> str:
    """GLSL: the sum of these paths' light, where `read` gives one of them by its name; SUM: of what is summed up."""
    lobes = {path.name: path.lobe for path in LIGHT_PATHS}
    found = []
    for name in names:
        light = read.format(name)
        if name == SUM:
            found.append(light)
        elif lobes[name] == "transmission":  # its alpha is what of the world shows through
            found.append(f"{light} * vec4(1.0, 1.0, 1.0, -1.0)")
        else:
            found.append(f"vec4({light}.rgb, 0.0)")
    return " + ".join(found) or "vec4(0.0)"


@cache
def folding_program(names: tuple[str, ...]) -> Program:
    """Sums up the light of these paths."""
    return passes.fullscreen_program(
        "film light summed up",
        "film/folded.frag.glsl",
        textures=tuple(("RGBA32F", name) for name in names),
        defines=(("FOLDED", terms(names, "{0}_fetch(pixel)")),),
        outputs=(("VEC4", "out_sum"),),
    )


FOLDING = folding_program((SUM, LIGHT_PATHS[0].name))


@contextmanager
def folded(light: dict[str, images.Image], most: int) -> Iterator[dict[str, images.Image]]:
    """`light`, by names of paths, in at most `most` images, so that a pass can read it beside others: where there are
    more, what is over is summed up with SUM."""
    if len(light) <= most:
        yield light
        return
    ordered = {name: light[name] for name in (SUM, *light) if name in light}
    first = tuple(ordered)[: len(light) - most + 1]
    with images.borrowed(*ordered[first[0]].size, "RGBA32F") as target:
        for start in range(0, len(first), MOST_FOLDED):
            part = first[start : start + MOST_FOLDED]
            how = {"blend": "ADDITIVE_PREMULT"} if start else {}
            passes.fullscreen(folding_program(part), target, textures={name: light[name] for name in part}, **how)
        yield {SUM: target.colors[0], **{name: light[name] for name in light if name not in first}}
