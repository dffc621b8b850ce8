"""Resolve: the mean of all samples so far as one picture, scene-linear and premultiplied by alpha.

    combined = exposure / n * (direct + indirect + emission + world)

    alpha    = coverage - what of the world shows through clear glass (Film > Transparent Glass)

summed over the light paths of the table (frame/light_paths.py) that the picture has, and the sum of those that it does
not hold apart (film/together.py). With a transparent film the world shows in its own pass only. While a viewport has
few samples, indirect diffuse light is shown filtered (film/neighbours.py); the sums stay as they are. One pass, a fetch
for each light path.
"""

from __future__ import annotations

from functools import cache

from ..frame.light_paths import DIRECT, INDIRECT, LIGHT_PATHS, SEEN, TOGETHER
from ..frame.picture import Frame
from ..gfx import images, passes
from ..gfx.library import Program
from .neighbours import shown_sum
from .together import SUM, folded, held_apart

COMBINED = "film.combined"
MOST_READ = 16  # images, by a pass


@cache
def resolve_program(names: tuple[str, ...]) -> Program:
    """Sums up the light paths of these names, SUM among them where some are summed up already."""
    of_order = {
        order: [p.name for p in LIGHT_PATHS if p.name in names and p.origin != SEEN and p.order == order]
        for order in (DIRECT, INDIRECT)
    }
    sums = "".join(
        f"vec3 {order}_light(ivec2 pixel)\n{{\n  return "
        + (" + ".join(f"{name}_fetch(pixel).rgb" for name in paths) or "vec3(0.0)")
        + ";\n}\n"
        for order, paths in of_order.items()
    )
    through = [p.name for p in LIGHT_PATHS if p.name in names and p.lobe == "transmission"]
    sums += "float seen_through_glass(ivec2 pixel)\n{\n  return "
    sums += (" + ".join(f"{name}_fetch(pixel).a" for name in through) or "0.0") + ";\n}\n"
    for name in ("emission", "environment", SUM):
        sums += f"vec4 seen_{name}(ivec2 pixel)\n{{\n  return "
        sums += (f"{name}_fetch(pixel)" if name in names else "vec4(0.0)") + ";\n}\n"
    return passes.fullscreen_program(
        "film resolve",
        "film/resolve.frag.glsl",
        textures=tuple(("RGBA32F", name) for name in names),
        constants=(("FLOAT", "scale"), ("FLOAT", "exposure"), ("INT", "transparent")),
        snippets=(("generated/light_sums", sums),),
        outputs=(("VEC4", "out_combined"),),
    )


RESOLVE = (
    resolve_program((SUM,)),
    *(
        resolve_program(tuple(path.name for path in LIGHT_PATHS if all_of_them or not path.by_need)[:MOST_READ])
        for all_of_them in (False, True)
    ),
)


def resolve(frame: Frame) -> images.Image:
    """Draw the picture into film.combined. Needs a plan with a film."""
    target = frame.target(COMBINED)
    paths = tuple(
        path.name
        for path in LIGHT_PATHS
        if path.image in frame.held.shown or (path.image in frame.images and held_apart(frame, path))
    )
    with shown_sum(frame, "diffuse_indirect") as indirect:
        textures = {name: frame.held.to_show(f"radiance.{name}") for name in paths}
        if "diffuse_indirect" in paths:
            textures["diffuse_indirect"] = indirect
        if TOGETHER in frame.images:
            textures[SUM] = frame.images[TOGETHER]
        with folded(textures, MOST_READ) as read:
            passes.fullscreen(
                resolve_program(tuple(name for name in (*paths, SUM) if name in read)),
                target,
                textures=read,
                constants={
                    "scale": 1.0 / (frame.samples_done + frame.part_done or 1.0),
                    "exposure": frame.snapshot.film.exposure,
                    "transparent": int(frame.snapshot.film.transparent),
                },
            )  # fmt: skip
    return target.colors[0]
