"""Film: samples that need no light (emission, visible world, colours, normals), depth, and the sum of all.

Colours are what Cycles puts into its colour passes: diffuse albedo with all layer weights, and the estimated albedo
of the glossy lobe. Light is stored with its colour; engine.py divides, after the mean, as Cycles does. Lights with
extent that the camera may see are intersected analytically and land in emission.

Techniques add the light of one sample to the images `radiance.*`, all at one point of each pixel's filter. When all
have done so it goes into the sums of all pixels whose filter covers that point (film/filter.py), at several such points
where the picture has few samples (film/points.py). Light paths that nobody looks at apart are one sum
(film/together.py).
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cache

from ..film import clamping, together
from ..film import filter as film_filter
from ..film import points as film_points
from ..film.point_costs import count_of
from ..film.resolve import COMBINED, resolve
from ..frame.light_paths import LIGHT_PATHS, SEEN, TOGETHER
from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.technique import Technique, Write
from ..gfx import images, library, passes
from ..gfx.context import to_hold
from ..gfx.library import Program
from ..lighting import repeated_light
from ..lighting.media import AroundEye, MediaEmission, MediaService, passing_view
from ..scene.materials import SURFACE_IMAGES, may_be_glossy
from ..scene.view import VIEW
from ..sources import lights
from ..sources.environment import WORLD
from ..surfaces.draw import (
    SOFT_DEFINES,
    STOCHASTIC,
    SURFACE_TEXTURES,
    SURFACES,
    add_glow,
    data_mode,
    draw_indices,
    draw_sample,
    draw_surfaces,
    refracts,
    surface_bindings,
)

# Each is made where somebody looks at it, and drawn by this output of the program.
SUMS = {
    "radiance.emission": ("out_emission", "Emission of surfaces and lights seen by the camera"),
    "radiance.environment": ("out_environment", "The world seen by the camera; alpha: coverage"),
    "color.diffuse": ("out_diffuse_color", "Albedo of diffuse closures; alpha: mist, where a pass asks for it"),
    "color.glossy": ("out_glossy_color", "Albedo of glossy closures"),
    "color.transmission": ("out_transmission_color", "Share of light that glass lets through"),
    "surface.normal_sum": ("out_normal", "World-space shading normal; alpha: hits"),
    TOGETHER: ("out_together", "Light of all paths that nobody looks at apart; alpha: coverage"),
}
MOST_LIGHT = 6  # images that the pass which collects reads beside others
EMISSION, WORLD_SEEN = "radiance.emission", film_filter.WORLD_SEEN
LIGHT = tuple(path for path in LIGHT_PATHS if path.origin != SEEN)  # what techniques add to in each sample


@dataclass(frozen=True)
class Seen:
    """What the camera may see besides diffuse surfaces. Drivers that mask instead of branching compute all that a
    program holds, so it holds no more."""

    soft: bool  # lobes of shaders/lib/soft_lobe.glsl
    glossy: bool  # lobes of microfacets
    world: bool
    kinds: int  # of lights, bits as in lights.LAMPS


@dataclass(frozen=True)
class Collected:
    """What a point of the film is collected into: the names of SUMS that a picture holds, and which paths of light,
    each an image, are added to TOGETHER (together.SUM: of what is summed up already)."""

    held: tuple[str, ...]
    light: tuple[str, ...] = ()
    world: bool = True  # whether the sum holds the world

    @property
    def defines(self) -> tuple[tuple[str, str], ...]:
        outputs = {name: SUMS[name][0] for name in SUMS}
        left_out = [output for name, output in outputs.items() if name not in self.held]
        parts = [together.terms(self.light, "light_{0}_fetch(pixel)")]
        if EMISSION not in self.held:
            parts.append(f"vec4({outputs[EMISSION]}.rgb, 0.0)")
        if WORLD_SEEN not in self.held:
            parts.append(outputs[WORLD_SEEN] if self.world else f"vec4(vec3(0.0), {outputs[WORLD_SEEN]}.a)")
        summed = f"{outputs[TOGETHER]} = {' + '.join(parts)};" if TOGETHER in self.held else ""
        return ("NOT_DRAWN", " ".join(f"vec4 {output};" for output in left_out)), ("SUM_ALL", summed)


EVERYTHING = Collected(tuple(name for name in SUMS if name != TOGETHER))
PICTURE_ALONE = Collected((TOGETHER,), film_points.PATHS)


@cache
def collect_program(seen: Seen, into: Collected = EVERYTHING) -> Program:
    shown = (("GLOSSY", seen.glossy), ("WORLD", seen.world))
    return passes.fullscreen_program(
        "film collect",
        "film/collect.frag.glsl",
        textures=(
            *SURFACE_TEXTURES, ("RGBA32F", "energy_table"), ("RGBA32F", "environment_map"),
            ("R32F", "environment_density_map"), *(("RGBA32F", f"light_{name}") for name in into.light),
        ),
        blocks=((VIEW, "film_view"), (WORLD, "world_light"), (lights.SOURCES, "sources")),
        constants=(("INT", "light_count"), ("VEC4", "mist")),
        defines=(
            *SOFT_DEFINES[seen.soft], *((name, "1") for name, is_seen in shown if is_seen),
            ("LIGHT_KINDS", str(seen.kinds)), *into.defines,
        ),
        outputs=tuple(("VEC4", SUMS[name][0]) for name in into.held),
    )  # fmt: skip


COLLECT = tuple(
    collect_program(seen, into)
    for seen in (Seen(True, True, True, -1), Seen(False, False, False, 0))
    for into in (EVERYTHING, PICTURE_ALONE)
)
DEPTH = passes.fullscreen_program(
    "film depth",
    "film/depth.frag.glsl",
    textures=(("RGBA32F", "surface_position"),),
    blocks=((VIEW, "film_view"),),
    outputs=(("VEC4", "out_depth"),),
)
POSITION = passes.fullscreen_program(
    "film position",
    "film/position.frag.glsl",
    textures=(("RGBA32F", "surface_position"),),
    constants=(("VEC3", "render_origin"),),
    outputs=(("VEC4", "out_position"),),
)


class Film(Technique):
    name = "film"
    label = "Film"
    params = (
        film_points.POINTS,
        repeated_light.EDGES,
        *clamping.LIMITS.values(),
    )
    reads = SURFACES
    finishes = tuple(path.image for path in LIGHT)
    requests = (MediaService, AroundEye, MediaEmission, *film_points.AT_POINTS)
    writes = (
        *(Write(name, "RGBA32F", description, True, by_need=True) for name, (_, description) in SUMS.items()),
        *(Write(path.image, "RGBA32F", path.description, True, path.by_need) for path in LIGHT),
        Write("film.depth", "RGBA32F", "Depth along the camera axis at the pixel's centre, m; 1e10 for nothing"),
        Write("film.combined", "RGBA32F", "The picture, premultiplied by alpha"),
    )

    def __init__(self):
        self._sources = lights.Sources()
        self._repeated = lights.Sources()

    def looks_at(self, settings: Settings) -> tuple[str, ...]:
        # A viewport at rest shows its first samples filtered (film/neighbours.py).
        filtered = ("radiance.diffuse_indirect", "color.diffuse") if settings.schedule.shows_each else ()
        return (*filtered, *clamping.CLAMPED) if clamping.limits(settings, self) else filtered

    def begin(self, frame: Frame) -> None:
        self._paths, self._pixel_paths = film_points.lit_paths(frame), film_points.pixel_paths(frame)
        apart, shown = together.apart_of(frame), film_points.shown_paths(frame)
        self._apart = tuple(path for path in self._paths if path in apart)
        self._summed = tuple(path for path in self._paths if path not in apart and path in shown)
        self._held = together.collected(frame)
        self._limits = clamping.limits(frame.settings, self)
        light = (tuple(f"film.{path}" for path in paths) for paths in (self._apart, self._pixel_paths))
        for names in (self._held, *light):
            _clear(frame, names)
        emitters = frame.emitters
        seen = lights.traceable([e for e in emitters if e.flags & lights.CAMERA_FLAG])
        self._lights = self._sources.set([emitter.row(emitter.centre, 0, 0) for emitter in seen])
        self._light_count = len(seen)
        self._shown = self._not_black(frame, bool(seen))
        shown = frame.snapshot.world.visibility.camera and frame.environment.power > 0
        world = frame.environment.tree is None and shown
        glossy, world = to_hold((frame.materials.glossy, world), (True, True))
        self._seen = Seen(frame.materials.soft, glossy, world, lights.kinds_of(seen))
        if TOGETHER in self._held:
            paths = ", ".join(path.label for path in LIGHT_PATHS if path.name in self._apart)
            frame.account.chose(self, "light paths", f"summed before the filter{f', but for {paths}' if paths else ''}")
        self._first_seen(frame)

    def sample(self, frame: Frame) -> Iterator[None]:
        points = frame.settings.get(self, film_points.POINTS.name)
        asked, count = count_of(points, frame.settings.samples), film_points.points_of_sample(frame, points)
        with _borrowed(frame, len(self._held)) as collected:
            light = {path: frame.images[f"radiance.{path}"] for path in (*self._paths, *self._pixel_paths)}
            known = library.news()
            self._collect(frame, surface_bindings(frame), collected, {path: light[path] for path in self._summed})
            if library.news() != known:  # the filter has programs of its own
                yield
            self._filter(frame, collected, light, surface_bindings(frame), frame.sample, 1.0 / count)
        shining = frame.service(MediaEmission)
        if shining is not None:
            emission = {EMISSION if EMISSION in self._held else TOGETHER: frame.images[shining.image]}
            with clamping.clamped(emission, self._limits) as shown:
                frame.count(self, "passes", film_filter.add(frame, shown, frame.film_offset(frame.sample), 1.0))
        frame.count(self, "points", count)
        if frame.is_first and asked > 1 and film_points.by_costs(frame):
            frame.account.chose(self, "points", film_points.costs(frame).why(asked))
        for path in (*self._apart, *self._pixel_paths):
            frame.held.shown[f"radiance.{path}"] = f"film.{path}"
        if count > 1:
            try:
                frame.part_done = 0.0 if frame.samples_done else 1.0 / count
                yield
                yield from self._between(frame, count)
            finally:
                frame.part_done = 0.0
        for paths in (self._paths, self._pixel_paths):
            _clear(frame, tuple(f"radiance.{path}" for path in paths))
        repeated_light.forget(frame)

    def show(self, frame: Frame) -> None:
        if frame.plan.last_writer(COMBINED) is self:
            resolve(frame)

    def _first_seen(self, frame: Frame) -> None:
        """What passes ask for of the surfaces in the first sample, as Cycles has it: depth, positions and indices."""
        film, mode, whole = frame.snapshot.film, data_mode(frame), frame.settings.schedule.has_passes
        anew = whole and mode != STOCHASTIC and (film.position or frame.held.is_apart("film.depth"))
        position = frame.images["surface.position"]
        with ExitStack() as stack:
            drawn = depth = None
            if whole and (film.indices or anew):
                drawn = stack.enter_context(_borrowed(frame, len(SURFACES)))
                (depth,) = stack.enter_context(_borrowed(frame, 1, "DEPTH_COMPONENT32F"))
            if anew:
                draw_surfaces(frame, self, images.Target(drawn, depth), mode, refracts(frame))
                position = dict(zip(SURFACE_IMAGES, drawn))["position"]
            passes.fullscreen(
                DEPTH,
                frame.target("film.depth"),
                textures={"surface_position": position},
                blocks={"film_view": frame.view_block},
            )
            if film.position:
                passes.fullscreen(
                    POSITION,
                    _target(frame, "film.position"),
                    textures={"surface_position": position},
                    constants={"render_origin": tuple(frame.geometry.origin)},
                )
            if film.indices and whole:  # a viewport does not show them
                draw_indices(frame, self, images.Target(drawn, depth))
                passes.copy(drawn[0], _target(frame, "film.index"))
        frame.count(self, "passes", film.position + (film.indices and whole))

    def _between(self, frame: Frame, count: int) -> Iterator[None]:
        """The same sample's light at other points of the film."""
        # The first numbers are those of the samples' own points, so that all together are a prefix of the sequence.
        first = frame.settings.samples + frame.sample * (count - 1)
        repeated = frame.settings.get(self, "edges") and repeated_light.possible(frame)
        own = repeated_light.PATHS if repeated else ()  # which are added to after the others
        first_round, *more = film_points.rounds(self._paths)
        paths = tuple(first_round)
        alone = tuple(path for path in paths if path in self._apart or path in own)
        carried = (*alone, together.SUM) if set(self._summed).intersection(paths) - set(alone) else alone
        further = tuple(path for carriers in more for path in carriers.values())
        with (
            _borrowed(frame, len(SURFACES)) as drawn,
            _borrowed(frame, len(self._held)) as collected,
            _borrowed(frame, len(carried)) as light,
            _borrowed(frame, len(further)) as more_light,
            _borrowed(frame, 1, "DEPTH_COMPONENT32F") as (depth,),
        ):
            target, marked = images.Target(drawn, depth), images.Target(light, depth)
            surfaces, by_path = dict(zip(SURFACE_IMAGES, drawn)), dict(zip((*carried, *further), (*light, *more_light)))
            added = {path: image for path, image in by_path.items() if path not in self._apart}
            direct = images.Target(tuple(by_path[path] for path in own), depth) if repeated else None
            try:
                for point in range(first, first + count - 1):
                    known = library.news()
                    frame.look(film=point)
                    draw_sample(frame, self, target)
                    bindings = {f"surface_{name}": image for name, image in surfaces.items()}
                    film_points.light_between(frame, paths, carried, marked, surfaces, point, repeated)
                    for carriers in more:
                        into = images.Target(tuple(by_path[path] for path in carriers.values()))
                        how = (paths, tuple(carriers), into, surfaces, point, False)
                        film_points.light_between(frame, *how, carried=carriers)
                    frame.count(self, "passes", 1 + len(more))
                    if library.news() != known:  # what follows has programs of its own
                        yield
                    if repeated:
                        repeated_light.repeat(frame, self._repeated, bindings, direct)
                        frame.count(self, "passes", len(frame.shared(repeated_light.KeptLight).passes))
                    self._collect(frame, bindings, collected, added)
                    by_pixel = {path: frame.images[f"radiance.{path}"] for path in self._pixel_paths}
                    self._filter(frame, collected, by_path | by_pixel, bindings, point, 1.0 / count)
                    frame.part_done = 0.0 if frame.samples_done else (point - first + 2) / count
                    yield
            finally:
                frame.look()

    def _collect(
        self,
        frame: Frame,
        surfaces: dict[str, images.Image],
        collected: tuple[images.Image, ...],
        light: dict[str, images.Image],
    ) -> None:
        """Draw what needs no light, at the point of the film that is looked at, into an image for each sum that is
        held; into that of all paths together with the `light` of those that are not apart."""
        by_name, world = dict(zip(self._held, collected)), not frame.snapshot.film.transparent
        with together.folded(light, MOST_LIGHT) as read:
            passes.fullscreen(
                collect_program(self._seen, Collected(self._held, tuple(read), world)),
                images.Target(collected),
                textures={
                    **surfaces, **{f"light_{path}": image for path, image in read.items()},
                    "energy_table": frame.materials.energy_table, "environment_map": frame.environment.map,
                    "environment_density_map": frame.environment.density_map,
                },
                blocks={
                    "film_view": frame.view_block, "world_light": frame.environment.block, "sources": self._lights,
                },
                constants={"light_count": self._light_count, "mist": _mist_constant(frame)},
            )  # fmt: skip
        frame.count(self, "passes")
        add_glow(frame, self, surfaces["surface_position"], by_name.get(EMISSION) or by_name[TOGETHER])
        shown = by_name.get(WORLD_SEEN) or (by_name[TOGETHER] if world else None)
        if frame.environment.tree is not None and frame.snapshot.world.visibility.camera and shown is not None:
            frame.environment.tree.add_background(images.Target((shown,)), frame.view, frame.view_block, surfaces)
            frame.count(self, "passes")

    def _filter(
        self,
        frame: Frame,
        collected: tuple[images.Image, ...],
        light: dict[str, images.Image],
        surfaces: dict[str, images.Image],
        point: int,
        share: float,
    ) -> None:
        """Add what one point of the film shows to the sums."""
        seen = dict(zip(self._held, collected))
        seen |= {f"film.{path}": image for path, image in light.items()}
        seen = {name: image for name, image in seen.items() if name in self._shown}
        frame.count(self, "images filtered", len(seen))
        offset = frame.film_offset(point)
        for service in map(frame.service, film_points.AT_POINTS):
            if service is not None:
                service.add(frame, surfaces, offset, share)
        with ExitStack() as stack:
            if self._limits:
                seen = stack.enter_context(clamping.clamped(seen, self._limits))
            through = stack.enter_context(passing_view(frame, surfaces, self._lights, self._light_count))
            drawn = len(self._limits) + (through is not None) + film_filter.add(frame, seen, offset, share, through)
            frame.count(self, "passes", drawn)

    def _not_black(self, frame: Frame, lights_seen: bool) -> frozenset[str]:
        """Those of SUMS and of the sums of light in which something may be seen."""
        alone = {*self._apart, *self._pixel_paths}
        shown = {f"film.{path}" for path in film_points.shown_paths(frame) if path in alone}
        shown |= {WORLD_SEEN, "color.diffuse", "surface.normal_sum", TOGETHER}
        if lights_seen or any(material.emissive for material in frame.materials.compiled):
            shown.add(EMISSION)
        if "transmission_direct" in self._paths:
            shown.add("color.transmission")
        if may_be_glossy(frame.snapshot):
            shown.add("color.glossy")
        return frozenset(shown)

    def release(self) -> None:
        self._sources.release()
        self._repeated.release()


def _target(frame: Frame, *names: str) -> images.Target:
    """Of images that only some pictures have; those that this one lacks are taken."""
    for name in names:
        if name not in frame.images:
            frame.images[name] = images.pool.take(*frame.size, "RGBA32F")
    return frame.target(*names)


def _clear(frame: Frame, names: tuple[str, ...]) -> None:
    """Without light, by as many images as a target has."""
    for part in range(0, len(names), film_filter.MOST_IMAGES):
        _target(frame, *names[part : part + film_filter.MOST_IMAGES]).clear()


def _mist_constant(frame: Frame) -> tuple[float, float, float, float]:
    """Where mist begins, one over how far on it ends, the exponent, and whether it is asked for."""
    mist = frame.snapshot.film.mist
    if mist is None:
        return 0.0, 0.0, 0.0, 0.0
    return mist.start, 1.0 / mist.depth if mist.depth > 0 else 0.0, mist.exponent, 1.0


@contextmanager
def _borrowed(frame: Frame, count: int, image_format="RGBA32F") -> Iterator[tuple[images.Image, ...]]:
    with ExitStack() as stack:
        targets = [stack.enter_context(images.borrowed(*frame.size, image_format)) for _ in range(count)]
        yield tuple(target.colors[0] for target in targets)


def check_tree(names: Collection[str] | None) -> None:
    """ValueError if these are the techniques of a pass tree that makes no picture. None: no tree, Auto."""
    if names is not None and Film.name not in names:
        raise ValueError("The pass tree holds no Film, which makes the picture: add it, or use New from Auto.")
