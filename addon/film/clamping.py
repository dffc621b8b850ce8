"""Clamp: no sample's light is brighter than a limit, as Clamp Direct and Clamp Indirect of Cycles have it.

    light := light * min(1, 3 limit / (|r| + |g| + |b|))

The limits are of the film (0: none, as set at first). What one point of the film shows is clamped before the filter
gathers it, so that a limit acts on single samples, not on their mean: light that varies from sample to sample loses
what stands out, and even light up to the limit stays what it is.

Light is clamped as Cycles' contributions are: what reaches the seen surface straight (the sum of its diffuse, glossy
and transmitted light, whose colour stays), what is bounced to it (in the same way), light that media send straight and
after bounces, emission that is seen, the world that is seen. Clamp Indirect holds for what is bounced, Clamp Direct for
the rest.

| cost | per point of the film, while a limit is set |
|---|---|
| passes | 1 for each of the two limits |
| images | light paths are held apart (film/together.py); a copy of each |

Bias: what it takes away, which is its use. Beside Cycles': a sample's light comes from all lamps, where Cycles looks at
one of them and multiplies its light by their number; light behind media is clamped before they dim it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import ExitStack, contextmanager
from functools import cache

from ..frame.light_paths import DIRECT, INDIRECT, LIGHT_PATHS, SURFACE, LightPath
from ..frame.settings import Settings
from ..frame.technique import Param
from ..gfx import images, passes
from ..gfx.library import Program

CLAMP_DIRECT = Param(
    "clamp_direct", "Clamp Direct", 0.0,
    "Most that a single sample shows of light that reaches what is seen straight, of emission and of the world, as the "
    "mean of its colour; 0 does not clamp. Reduces noise, and the brightness of highlights",
    0.0, 1e8,
)  # fmt: skip
CLAMP_INDIRECT = Param(
    "clamp_indirect", "Clamp Indirect", 0.0,
    "Most that a single sample shows of light that was bounced before, as the mean of its colour; 0 does not clamp. "
    "Reduces noise, and bounced light that is bright",
    0.0, 1e8,
)  # fmt: skip
LIMITS = {DIRECT: CLAMP_DIRECT, INDIRECT: CLAMP_INDIRECT}
MOST_IMAGES = 6  # that Blender lets a pass draw into
CLAMPED = tuple(path.image for path in LIGHT_PATHS)  # held apart while a limit is set


def limits(settings: Settings, technique) -> dict[str, float]:
    """By order of light, the limits that are set in this technique's parameters."""
    found = {order: float(settings.get(technique, limit.name)) for order, limit in LIMITS.items()}
    return {order: limit for order, limit in found.items() if limit > 0}


def groups_of(paths: tuple[LightPath, ...]) -> list[list[LightPath]]:
    """Paths that are one contribution: those of the lobes of a surface; each other path is one of its own."""
    lobes = [path for path in paths if path.origin == SURFACE]
    return [*([lobes] if lobes else []), *([path] for path in paths if path.origin != SURFACE)]


@cache
def clamp_program(names: tuple[str, ...], drawn: tuple[str, ...]) -> Program:
    """Copies the images of those of these light paths, of one order, that are `drawn`, with no contribution above the
    limit."""
    lines = []
    for group in groups_of(tuple(path for path in LIGHT_PATHS if path.name in names)):
        together = " + ".join(f"{path.name}_fetch(pixel).rgb" for path in group)
        lines.append(f"kept = share_below({together}, most);")
        lines += [
            f"out_{path.name} = {path.name}_fetch(pixel) * vec4(vec3(kept), 1.0);"
            for path in group if path.name in drawn
        ]  # fmt: skip
    return passes.fullscreen_program(
        "film clamp",
        "film/clamp.frag.glsl",
        textures=tuple(("RGBA32F", name) for name in names),
        constants=(("FLOAT", "most"),),
        defines=(("CLAMP_ALL", " ".join(lines)),),
        outputs=tuple(("VEC4", f"out_{name}") for name in drawn),
    )


def _of_order(order: str, among: Collection[str]) -> tuple[str, ...]:
    return tuple(path.name for path in LIGHT_PATHS if path.order == order and path.name in among)


_DECLARED = [_of_order(order, [path.name for path in LIGHT_PATHS]) for order in LIMITS]
CLAMP = tuple(clamp_program(names, names[:MOST_IMAGES]) for names in _DECLARED)


@contextmanager
def clamped(seen: dict[str, images.Image], most: dict[str, float]) -> Iterator[dict[str, images.Image]]:
    """`seen` with light paths (images named radiance.PATH, film.PATH) that are not brighter than the limits of their
    order; the copies are given back in the end. Draws a pass for each limit."""
    by_path = {name.partition(".")[2]: name for name in seen if name.startswith(("radiance.", "film."))}
    with ExitStack() as stack:
        copies = {}
        for order, limit in most.items():
            paths = _of_order(order, by_path)
            if not paths:
                continue
            size = seen[by_path[paths[0]]].size
            targets = [stack.enter_context(images.borrowed(*size, "RGBA32F")).colors[0] for _ in paths]
            for part in range(0, len(paths), MOST_IMAGES):
                passes.fullscreen(
                    clamp_program(paths, paths[part : part + MOST_IMAGES]),
                    images.Target(tuple(targets[part : part + MOST_IMAGES])),
                    textures={path: seen[by_path[path]] for path in paths},
                    constants={"most": 3.0 * limit},
                )
            copies |= {by_path[path]: target for path, target in zip(paths, targets)}
        yield {**seen, **copies}
