"""How fast a device runs the same steps in fragment and in compute programs: part of `python -m bench gpu`.

Three loops: arithmetic that depends on the step before, fetches far apart, and fetches of neighbours. A card built for
computing may have few units that draw: one H100 runs arithmetic 32 times as fast in compute programs as in fragment
programs, since 4 of its 132 multiprocessors draw. Milliseconds of pictures on such a card say little of others.
"""

from __future__ import annotations

import time
from collections.abc import Callable

SIDE = 1024  # threads along each side
PICTURE = 512  # texels along each side
LEAST_S, MOST_STEPS = 0.05, 1 << 21
STEPS = {
    "arithmetic": "r.x = r.x * 0.999 + r.y; r.y = r.y * 0.998 - r.x * 0.01;",
    "fetches far apart": "at = (at * ivec2(5, 7) + ivec2(i, 3)) & ivec2(511); r += picture_fetch(at);",
    "fetches of neighbours": "r += picture_fetch((at + ivec2(i & 7, (i >> 3) & 7)) & ivec2(511));",
}
FRAGMENT = "void main()\n{{\n  ivec2 at = ivec2(gl_FragCoord.xy);\n{body}  out_color = r;\n}}\n"
COMPUTE = (
    "void main()\n{{\n  ivec2 at = ivec2(gl_GlobalInvocationID.xy);\n  ivec2 place = at;\n{body}"
    "  imageStore(found, place, r);\n}}\n"
)
BODY = "  vec4 r = vec4(vec2(at) * 0.001, 0.0, 1.0);\n  for (int i = 0; i < count; i++) {{\n    {step}\n  }}\n"


def speeds() -> list[dict]:
    """Picoseconds of a step of one thread, all threads together, by kind of step: fragment and compute programs."""
    from addon.gfx import images

    with images.borrowed(PICTURE, PICTURE, "RGBA32F") as picture, images.borrowed(SIDE, SIDE, "RGBA32F") as target:
        picture.clear((0.1, 0.2, 0.3, 0.4))
        target.clear()
        return [{"steps": name, **_of(name, step, picture.colors[0], target)} for name, step in STEPS.items()]


def _of(name: str, step: str, picture, target) -> dict[str, float]:
    from addon.gfx import passes
    from addon.gfx.library import Program

    body = BODY.format(step=step)
    reads = "picture" in step
    declared = {"textures": (("FLOAT_2D", "picture"),) if reads else (), "constants": (("INT", "count"),)}
    bound = {"picture": picture} if reads else {}
    drawn = passes.fullscreen_program(
        f"speed of {name}, fragments", "speed/fragment", outputs=(("VEC4", "out_color"),),
        snippets=(("speed/fragment", FRAGMENT.format(body=body)),), **declared,
    )  # fmt: skip
    computed = Program(
        name=f"speed of {name}, compute", compute="speed/compute", images=(("found", "RGBA32F", "FLOAT_2D", "WRITE"),),
        snippets=(("speed/compute", COMPUTE.format(body=body)),), **declared,
    )  # fmt: skip
    return {
        "fragment": _ps(lambda count: passes.fullscreen(drawn, target, textures=bound, constants={"count": count})),
        "compute": _ps(
            lambda count: passes.compute(
                computed, (SIDE, SIDE), textures=bound, images={"found": target.colors[0]}, constants={"count": count}
            )
        ),
    }


def _ps(run: Callable[[int], None]) -> float:
    from addon.gfx import images

    count = 4
    run(count)  # compiles
    images.finish()
    while True:
        started = time.perf_counter()
        run(count)
        images.finish()
        seconds = time.perf_counter() - started
        if seconds >= LEAST_S or count >= MOST_STEPS:
            return 1e12 * seconds / (SIDE * SIDE * count)
        count *= 4
