"""Film: gathers the samples that need no light (emission, the visible world, colours, normals), depth, and the sum.

Colours are what Cycles puts into its colour passes: diffuse albedo with all layer weights, and the estimated albedo
of the glossy lobe. Light is stored with its colour; engine.py divides, after the mean, as Cycles does. Lights with
extent that the camera may see are intersected analytically and land in emission.

Techniques add the light of one sample to the images `radiance.*`, all at one point of each pixel's filter. When all
have done so it goes into the sums, at several such points where the picture has few samples (film_points.py).
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import cache

from ..frame import lights
from ..frame.environment import WORLD
from ..frame.materials import SURFACE_IMAGES
from ..frame.run import Frame
from ..frame.technique import Technique, Write
from ..frame.view import VIEW
from ..gfx import images, passes
from ..gfx.context import to_hold
from ..gfx.library import Program
from . import film_points, repeated_light
from .film_points import PATHS
from .neighbours import shown_sum
from .surfaces import SOFT_DEFINES, SURFACE_TEXTURES, SURFACES, draw_sample, surface_bindings

SUMS = (
    Write("radiance.emission", "RGBA32F", "Emission of surfaces and lights seen by the camera", True),
    Write("radiance.environment", "RGBA32F", "The world seen by the camera; alpha: coverage", True),
    Write("color.diffuse", "RGBA32F", "Albedo of diffuse closures", True),
    Write("color.glossy", "RGBA32F", "Albedo of glossy closures", True),
    Write("color.transmission", "RGBA32F", "Share of light that glass lets through", True),
    Write("surface.normal_sum", "RGBA32F", "World-space shading normal; alpha: hits", True),
)
LIGHT = tuple(f"radiance.{path}" for path in PATHS)


@dataclass(frozen=True)
class Seen:
    """What the camera may see besides diffuse surfaces. Drivers that mask instead of branching compute all that a
    program holds, so it holds no more."""

    soft: bool  # lobes of shaders/lib/soft_lobe.glsl
    glossy: bool  # lobes of microfacets
    world: bool
    kinds: int  # of lights, bits as in lights.LAMPS


@cache
def collect_program(seen: Seen) -> Program:
    shown = (("GLOSSY", seen.glossy), ("WORLD", seen.world))
    return passes.fullscreen_program(
        "film collect",
        "film/collect.frag.glsl",
        textures=(
            *SURFACE_TEXTURES, ("RGBA32F", "energy_table"), ("RGBA32F", "environment_map"),
            ("R32F", "environment_density_map"),
        ),
        blocks=((VIEW, "film_view"), (WORLD, "world_light"), (lights.SOURCES, "sources")),
        constants=(("INT", "light_count"), ("FLOAT", "film_share")),
        defines=(
            *SOFT_DEFINES[seen.soft], *((name, "1") for name, is_seen in shown if is_seen),
            ("LIGHT_KINDS", str(seen.kinds)),
        ),
        outputs=tuple(
            ("VEC4", name)
            for name in ("out_emission", "out_environment", "out_diffuse_color", "out_glossy_color",
                         "out_transmission_color", "out_normal")
        ),
    )  # fmt: skip


COLLECT = (collect_program(Seen(True, True, True, -1)), collect_program(Seen(False, False, False, 0)))
DEPTH = passes.fullscreen_program(
    "film depth",
    "film/depth.frag.glsl",
    textures=(("RGBA32F", "surface_position"),),
    blocks=((VIEW, "film_view"),),
    outputs=(("VEC4", "out_depth"),),
)
RESOLVE = passes.fullscreen_program(
    "film resolve",
    "film/resolve.frag.glsl",
    textures=tuple(("RGBA32F", name) for name in (*PATHS, "emission", "environment")),
    constants=(("FLOAT", "scale"), ("FLOAT", "exposure"), ("INT", "transparent")),
    outputs=(("VEC4", "out_combined"),),
)  # fmt: skip


class Film(Technique):
    name = "film"
    label = "Film"
    params = (
        film_points.POINTS,
        repeated_light.EDGES,
    )
    reads = SURFACES
    closes = LIGHT
    writes = (
        *SUMS,
        *(Write(name, "RGBA32F", "Cleared here, so that a scene without such light has it", True) for name in LIGHT),
        Write("film.depth", "RGBA32F", "Depth along the camera axis at the pixel's centre, m; 1e10 for nothing"),
        Write("film.combined", "RGBA32F", "The picture, premultiplied by alpha"),
    )

    def __init__(self):
        self._sources = lights.Sources()
        self._repeated = lights.Sources()

    def run(self, frame: Frame) -> Iterator[None]:
        if frame.sample == 0:
            self._paths = film_points.lit_paths(frame)
            for path in self._paths:
                if f"film.{path}" not in frame.images:
                    frame.images[f"film.{path}"] = images.pool.take(*frame.size, "RGBA32F")
            frame.target(*(f"film.{path}" for path in self._paths)).clear()
            emitters = frame.emitters
            seen = lights.traceable([e for e in emitters if e.flags & lights.CAMERA_FLAG])
            self._lights = self._sources.set([emitter.row(emitter.centre, 0, 0) for emitter in seen])
            self._light_count = len(seen)
            shown = frame.snapshot.world.visibility.camera and frame.environment.power > 0
            world = frame.environment.tree is None and shown
            glossy, world = to_hold((frame.materials.glossy, world), (True, True))
            self._collecting = collect_program(Seen(frame.materials.soft, glossy, world, lights.kinds_of(seen)))
            passes.fullscreen(
                DEPTH,
                frame.target("film.depth"),
                textures={"surface_position": frame.images["surface.position"]},
                blocks={"film_view": frame.view_block},
            )
        count = film_points.points_of_sample(frame, frame.settings.get(self, film_points.POINTS.name))
        sums = frame.target(*(f"film.{path}" for path in self._paths))
        self._collect(frame, surface_bindings(frame), 1.0 / count)
        film_points.add(frame, self._paths, sums, 1.0 / count)
        frame.count(self, "passes", 2)
        frame.count(self, "points", count)
        if count > 1:
            yield
            yield from self._between(frame, count, sums)
        frame.target(*(f"radiance.{path}" for path in self._paths)).clear()
        repeated_light.forget(frame)
        for path in self._paths:
            frame.shown[f"radiance.{path}"] = f"film.{path}"

    def _between(self, frame: Frame, count: int, sums: images.Target) -> Iterator[None]:
        """The same sample's light at other points of the film."""
        drawn = [images.pool.take(*frame.size, "RGBA32F") for _ in SURFACES]
        depth = images.pool.take(*frame.size, "DEPTH_COMPONENT32F")
        target = images.Target(tuple(drawn), depth)
        surfaces = dict(zip(SURFACE_IMAGES, drawn))
        # The first numbers are those of the samples' own points, so that all together are a prefix of the sequence.
        first = frame.settings.samples + frame.sample * (count - 1)
        repeated = frame.settings.get(self, "edges") and repeated_light.possible(frame)
        marked = images.Target(sums.colors, depth)
        direct = images.Target(tuple(frame.images[f"film.{path}"] for path in repeated_light.PATHS), depth)
        share = 1.0 / count
        try:
            for point in range(first, first + count - 1):
                frame.look(film=point)
                draw_sample(frame, self, target)
                bindings = {f"surface_{name}": image for name, image in surfaces.items()}
                self._collect(frame, bindings, share)
                into = marked if repeated else sums
                film_points.add_between(frame, self._paths, into, surfaces, share, point, repeated)
                frame.count(self, "passes", 2)
                if repeated:
                    repeated_light.repeat(frame, self._repeated, bindings, direct, share)
                    frame.count(self, "passes", len(frame.services["lit"]))
                yield
        finally:
            frame.look()
            for image in (*drawn, depth):
                images.pool.give(image)

    def _collect(self, frame: Frame, surfaces: dict[str, images.Image], share: float) -> None:
        """Add what needs no light, at the point of the film that the frame looks at."""
        passes.fullscreen(
            self._collecting,
            frame.target(*(write.name for write in SUMS)),
            blend="ADDITIVE_PREMULT",
            textures={
                **surfaces, "energy_table": frame.materials.energy_table,
                "environment_map": frame.environment.map, "environment_density_map": frame.environment.density_map,
            },
            blocks={
                "film_view": frame.view_block, "world_light": frame.environment.block, "sources": self._lights,
            },
            constants={"light_count": self._light_count, "film_share": share},
        )  # fmt: skip
        if frame.environment.tree is not None and frame.snapshot.world.visibility.camera:
            frame.environment.tree.add_background(
                frame.target("radiance.environment"), frame.view, frame.view_block, surfaces, share
            )
            frame.count(self, "passes")

    def release(self) -> None:
        self._sources.release()
        self._repeated.release()


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
