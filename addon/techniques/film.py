"""Film: gathers the samples that need no light (emission, the visible world, colours, normals), depth, and the sum.

Colours are what Cycles puts into its colour passes: diffuse albedo with all layer weights, and the estimated albedo
of the glossy lobe. A picture of one sample has the mean diffuse albedo of several points of each pixel (neighbours.py):
direct light of its single point, divided by that, is right again only when it is multiplied. Direct light is stored
with its colour; engine.py divides, after the mean, as Cycles does. Lights with extent that the camera may see are
intersected analytically and land in emission.
"""

from __future__ import annotations

from collections.abc import Collection

from ..frame import lights
from ..frame.environment import WORLD
from ..frame.run import Frame
from ..frame.technique import Technique, Write
from ..frame.view import VIEW
from ..gfx import images, passes
from .neighbours import COLORS_BETWEEN, shown_sum
from .surfaces import SOFT_DEFINES, SURFACE_TEXTURES, SURFACES, surface_bindings

SUMS = (
    Write("radiance.emission", "RGBA32F", "Emission of surfaces and lights seen by the camera", True),
    Write("radiance.environment", "RGBA32F", "The world seen by the camera; alpha: coverage", True),
    Write("color.diffuse", "RGBA32F", "Albedo of diffuse closures", True),
    Write("color.glossy", "RGBA32F", "Albedo of glossy closures", True),
    Write("color.transmission", "RGBA32F", "Share of light that glass lets through", True),
    Write("surface.normal_sum", "RGBA32F", "World-space shading normal; alpha: hits", True),
)
PATHS = tuple(f"{lobe}_{order}" for order in ("direct", "indirect") for lobe in ("diffuse", "glossy", "transmission"))
COLLECT = tuple(
    passes.fullscreen_program(
        "film collect",
        "film/collect.frag.glsl",
        textures=(
            *SURFACE_TEXTURES, ("FLOAT_2D", "energy_table"), ("FLOAT_2D", "environment_map"),
            ("FLOAT_2D", "environment_density_map"),
        ),
        blocks=((VIEW, "film_view"), (WORLD, "world_light"), (lights.SOURCES, "sources")),
        constants=(("INT", "light_count"),),
        defines=soft_defines,
        outputs=tuple(
            ("VEC4", name)
            for name in ("out_emission", "out_environment", "out_diffuse_color", "out_glossy_color",
                         "out_transmission_color", "out_normal")
        ),
    )
    for soft_defines in SOFT_DEFINES
)  # fmt: skip
DEPTH = passes.fullscreen_program(
    "film depth",
    "film/depth.frag.glsl",
    textures=(("FLOAT_2D", "surface_position"),),
    blocks=((VIEW, "film_view"),),
    outputs=(("VEC4", "out_depth"),),
)
RESOLVE = passes.fullscreen_program(
    "film resolve",
    "film/resolve.frag.glsl",
    textures=tuple(("FLOAT_2D", name) for name in (*PATHS, "emission", "environment")),
    constants=(("FLOAT", "scale"), ("FLOAT", "exposure"), ("INT", "transparent")),
    outputs=(("VEC4", "out_combined"),),
)  # fmt: skip


class Film(Technique):
    name = "film"
    label = "Film"
    reads = SURFACES
    writes = (
        *SUMS,
        *(
            Write(f"radiance.{path}", "RGBA32F", "Cleared here, so that a scene without such light has it", True)
            for path in PATHS
        ),
        Write("film.depth", "RGBA32F", "Depth along the camera axis at the pixel's centre, m; 1e10 for nothing"),
        Write("film.combined", "RGBA32F", "The picture, premultiplied by alpha"),
    )

    def __init__(self):
        self._sources = lights.Sources()

    def run(self, frame: Frame) -> None:
        if frame.sample == 0:
            emitters = frame.emitters
            seen = lights.traceable([e for e in emitters if e.flags & lights.CAMERA_FLAG])
            self._lights = self._sources.set([emitter.row(emitter.centre, 0, 0) for emitter in seen])
            self._light_count = len(seen)
            passes.fullscreen(
                DEPTH,
                frame.target("film.depth"),
                textures={"surface_position": frame.images["surface.position"]},
                blocks={"film_view": frame.view_block},
            )
        passes.fullscreen(
            COLLECT[frame.materials.soft],
            frame.target(*(write.name for write in SUMS)),
            blend="ADDITIVE_PREMULT",
            textures={
                **surface_bindings(frame), "energy_table": frame.materials.energy_table,
                "environment_map": frame.environment.map, "environment_density_map": frame.environment.density_map,
            },
            blocks={
                "film_view": frame.view_block, "world_light": frame.environment.block, "sources": self._lights,
            },
            constants={"light_count": self._light_count},
        )  # fmt: skip
        frame.count(self, "passes")
        if COLORS_BETWEEN in frame.images and not frame.materials.soft:  # the colours of soft lobes are not among them
            passes.copy(frame.images[COLORS_BETWEEN], frame.target("color.diffuse"))
        if frame.environment.tree is not None and frame.snapshot.world.visibility.camera:
            frame.environment.tree.add_background(
                frame.target("radiance.environment"), frame.view, frame.view_block, surface_bindings(frame)
            )
            frame.count(self, "passes")

    def release(self) -> None:
        self._sources.release()


def check_tree(names: Collection[str] | None) -> None:
    """ValueError if these are the techniques of a pass tree that makes no picture. None: no tree, Auto."""
    if names is not None and Film.name not in names:
        raise ValueError("The pass tree holds no Film, which makes the picture: add it, or use New from Auto.")


def resolve(frame: Frame, target: images.Target | None = None) -> images.Image:
    """The mean of all samples so far as one picture, scene-linear, premultiplied: in `target`, or film.combined.

    Needs a plan with a film.
    """
    target = target or frame.target("film.combined")
    with shown_sum(frame, "diffuse_indirect") as indirect:
        textures = {name: frame.to_show(f"radiance.{name}") for name in (*PATHS, "emission", "environment")}
        passes.fullscreen(
            RESOLVE,
            target,
            textures={**textures, "diffuse_indirect": indirect},
            constants={
                "scale": 1.0 / max(frame.samples_done, 1), "exposure": frame.snapshot.film.exposure,
                "transparent": int(frame.snapshot.film.transparent),
            },
        )  # fmt: skip
    return target.colors[0]
