"""Shaded reflections: what mirrors, gloss and glass show of surfaces, shaded with their own materials.

A ray of each pixel's lobe is followed to what it meets; there the material's own program runs (surfaces/hits.py), and
light arrives as it does at pixels: of lamps, emissive surfaces and the world by points that this sample draws, one of
which is traced, of other surfaces by virtual lights. Where what is met is itself a mirror or glass, the ray goes on:

    L(v) = sum over k of  T_k ( emission + what lights and virtual lights bring there ),  T_k = product of f cos / p

Both a ray and a point may find the same light: they are weighted by the power heuristic (Veach 1997). What the first
surface reflects of lamps and the world is left to traced_glossy.py, and what it lets pass of them to
traced_refraction.py, whose walks by mean colours this technique replaces. Of smooth glass (Glass, and
Principled's Transmission; roughness up to BOTH_ROUGHNESS) both ways are followed in each sample: what it lets pass,
and what it mirrors; so are a thin coat and the lobe below it. In pictures of few samples so it is at up to MOST_THROUGH
surfaces of glass behind it, of which one is chosen that mirrors. Of other lobes one is kept, at hits, too.

| cost | per sample and bounce |
|---|---|
| rays | 1 per pixel that still has one, 1 to lights, 2 to 4 for light of other surfaces |
| passes | 5, and 1 for each program of materials (masked by depth), also where no ray is left |
| samples | as many as its share of the picture asks for, each bounce by itself (frame/shares.py); all, through glass |
| bytes per pixel | 258 while it runs, of the pool |

With one sample rays start from four points of each pixel, with two from two: a mirror shows edges.
Light at what they meet is asked for once by each. Corridor, one sample: relMSE .126 to .077 in 1.2 times the time.

Rougher lobes than `roughness` see means (instant_radiosity.py), and so do drafts, pictures whose indirect light is not
by virtual lights of that technique, and scenes above 4 million triangles.

Bias: that of hits.py and of virtual lights; light behind the last bounce is left out. Textures are averaged over
the footprint of the pixel, not over the width of a lobe.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from functools import cache

import numpy as np

from ..film.points import all_alike
from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.shares import Turns
from ..frame.technique import Param, Technique, Write
from ..gfx import images, passes
from ..gfx.library import Program
from ..lighting import caustic_maps, linked
from ..lighting.asked import lit_at_hits
from ..lighting.caustic_casters import Answered, bright_world, meshes_answered
from ..lighting.caustic_maps import CausticMaps
from ..lighting.glass_interfaces import clear_roughness
from ..lighting.light_rates import EmissivePoints
from ..lighting.loop import CANDIDATES
from ..lighting.media import LightOfMedia, MediaService, Rays
from ..lighting.path_sources import SHOWN, SHOWN_THROUGH, PathSources, ShadedLobes, shaded_roughness
from ..lighting.virtual_lights import PATH_TEXTURES
from ..lighting.visibility import TracedLobes, traced_roughness
from ..materials import gloss
from ..materials.compiler import least_roughness, may_refract
from ..scene import acceleration
from ..scene.materials import SURFACE_IMAGES, may_be_glossy
from ..scene.view import VIEW
from ..snapshot.scene import Snapshot
from ..sources import lights
from ..sources.environment import WORLD
from ..surfaces.draw import (
    ANY_SURFACE,
    LIT_SURFACES,
    MARKS,
    SOFT_DEFINES,
    SURFACE_TEXTURES,
    BothWays,
    draw_sample,
    goes_both_ways,
    keeps_coats,
    refracts,
    surface_bindings,
)
from ..surfaces.edits_at_hits import EditsAtHits
from ..surfaces.hits import (
    ANY_RAY,
    FROSTED_WITHIN,
    MET,
    SMOOTH_BOTH,
    Hits,
    Records,
    closure_bindings,
    take_closures,
)
from .environment_light import directions_rate
from .instant_radiosity import NEAR_CONSTANTS, GatherBindings

WORLD_DIRECTIONS = 8  # drawn per sample, shared by all hits
EMISSIVE_POINTS, FEW_EMISSIVE_POINTS = 4, 16  # the second in pictures of fewer than FEW samples
FEW = 4
GLASS_POINTS = 2.0  # that traced_refraction draws on emissive surfaces
STATE = (("RGBA32F", "ray_origin"), ("RGBA32F", "ray_direction"), ("RGBA32F", "met_path"), ("R32F", "ray_travelled"))
REACH = (
    ("INT", "mirrors"),
    ("INT", "interfaces"),
    ("FLOAT", "shaded_roughness"),
    ("INT", "ray_number"),
    ("INT", "rays"),
)
MORE_RAYS = 4  # of a pixel in a picture of one sample, each from another point of it, or to lights
POINT_IMAGES = ("position", "normal", "lobe")  # of SURFACE_IMAGES, at such a point
GATHERED_FROM = 0.4  # roughness from which lobes of the picture are gathered where no material is glass or smooth metal
ONWARD_ROUGHNESS = 0.3  # of lobes of what rays have met, up to which they go on: rougher ones see virtual lights
MOST_THROUGH = 4  # surfaces behind the first of which both ways are followed, as in shaders/hits/path.glsl
FEWEST_BY_CHANCE = 8  # samples, from which on those are left to chance: an eighth less time at the same error
BOTH_ROUGHNESS = 0.6  # of glass of which both ways are followed, as in lib/closure.glsl
LOBE = SURFACE_IMAGES.index("lobe")
ORDERS = ("direct", "indirect")
MOST_PARTS = 6  # bounces that have turns of their own (frame/shares.py); later ones have those of the last


# Where rays start: at lobes of what is seen at a pixel's own point, or elsewhere in it, or of what rays have met.
OWN, ELSEWHERE, ONWARD = "rays of lobes", "rays of lobes elsewhere", "rays onward"


@cache
def scatter_program(start: str) -> Program:
    onward = start == ONWARD
    before = ("met_origin", "met_direction", "met_path", "hit_place", "hit_passed") if onward else ()
    before += tuple(f"point_{name}" for name in POINT_IMAGES) if start == ELSEWHERE else ()
    return passes.fullscreen_program(
        start,
        "hits/scatter.frag.glsl",
        textures=(
            *SURFACE_TEXTURES, ("RGBA32F", "energy_table"), *(("RGBA32F", name) for name in before),
            *((("R32F", "met_travelled"),) if onward else ()),
        ),
        blocks=((VIEW, "film_view"),),
        constants=(
            *REACH,
            ("FLOAT", "traced_roughness"),
            ("FLOAT", "offset_size"),
            ("FLOAT", "clear_roughness"),
            ("FLOAT", "first_rays"),
            ("FLOAT", "ray_share"),
            ("INT", "way"),
            ("INT", "photons_shine"),
        ),
        defines={OWN: (), ELSEWHERE: (("ELSEWHERE", "1"),), ONWARD: (("ONWARD", "1"),)}[start],
        outputs=(
            ("VEC4", "out_origin"), ("VEC4", "out_direction"), ("VEC4", "out_path"), ("FLOAT", "out_travelled"),
        ),
    )  # fmt: skip


def _outputs(transmission: bool, orders: tuple[str, ...]) -> tuple[tuple[str, str], ...]:
    paths = ("glossy", "transmission") if transmission else ("glossy",)
    return tuple(("VEC4", f"out_{path}_{order}") for path in paths for order in orders)


@cache
def found_program(kinds: int, transmission: bool) -> Program:
    """For sources of these kinds (bits as in lights.LAMPS; -1: any)."""
    return passes.fullscreen_program(
        "light found by rays",
        "hits/found.frag.glsl",
        textures=(
            *STATE, *(("RGBA32F", name) for name in ("surface_position", "surface_emission", "hit_passed")),
            ("RGBA32F", "environment_map"), ("R32F", "environment_density_map"),
        ),
        blocks=((VIEW, "film_view"), (WORLD, "world_light"), (lights.SOURCES, "sources")),
        constants=(
            ("INT", "light_count"), ("INT", "world_glossy"), ("INT", "world_transmission"), ("FLOAT", "world_samples"),
            ("VEC4", "emissive"), ("VEC2", "glass_blocks"), ("INT", "ray_number"),
        ),
        defines=(("LIGHT_KINDS", str(kinds)), *((("TRANSMISSION", "1"),) if transmission else ())),
        outputs=_outputs(transmission, ORDERS),
    )  # fmt: skip


@cache
def received_program(kinds: int, transmission: bool, soft_lobes: bool, bounced: bool = False) -> Program:
    """For sources of these kinds (bits as in lights.LAMPS; -1: any). `bounced`: light of other surfaces."""
    textures = (("RGBA32F", "ray_direction"), ("RGBA32F", "met_path"), ("RGBA32F", "hit_passed"))
    return passes.fullscreen_program(
        "bounced light at hits" if bounced else "light at hits",
        "hits/bounced.frag.glsl" if bounced else "hits/received.frag.glsl",
        textures=(*PATH_TEXTURES, *((("RGBA32F", "virtual_lights"),) if bounced else ()), *textures),
        blocks=((VIEW, "film_view"), (lights.SOURCES, "sources")),
        constants=(
            ("INT", "light_count"), ("FLOAT", "offset_size"), ("INT", "repeats"), *REACH,
            *(NEAR_CONSTANTS if bounced else ()),
        ),
        defines=(
            ("LIGHT_KINDS", str(kinds)), *((("TRANSMISSION", "1"),) if transmission else ()), *SOFT_DEFINES[soft_lobes],
        ),
        outputs=_outputs(transmission, ("indirect",)),
    )  # fmt: skip


@cache
def guide_program(transmission: bool) -> Program:
    return passes.fullscreen_program(
        "what reflections show",
        "hits/guide.frag.glsl",
        textures=(*SURFACE_TEXTURES, ("RGBA32F", "met_path")),
        constants=(("FLOAT", "shaded_roughness"), ("FLOAT", "ray_share")),
        defines=(("TRANSMISSION", "1"),) if transmission else (),
        outputs=(("VEC4", "out_shown"), *((("VEC4", "out_through"),) if transmission else ())),
    )


PROGRAMS = (
    *(scatter_program(start) for start in (OWN, ELSEWHERE, ONWARD)),
    *(found_program(-1, transmission) for transmission in (False, True)),
    *(
        received_program(kinds, transmission, soft, bounced)
        for kinds, transmission, soft in ((-1, True, True), (0, False, False))
        for bounced in (False, True)
    ),
)
DECLARED = guide_program(False), guide_program(True)


class ShadedReflections(Technique, BothWays):
    name = "shaded_reflections"
    label = "Shaded reflections"
    params = (
        Param(
            "bounces", "Mirror bounces", 8,
            "Number of consecutive mirror reflections that are shaded; 0: reflections show each material in one "
            "average colour, without textures",
            0, 64, draft=0,
        ),
        Param(
            "roughness", "Roughness", 0.6,
            "Reflections up to this roughness show surfaces with their own materials; rougher ones show each material "
            "in one average colour, without textures; at most 0.4 where no material is glass or smooth metal",
            0.0, 1.0,
        ),
    )  # fmt: skip
    reads = LIT_SURFACES
    writes = (
        *(
            Write(f"radiance.glossy_{order}", "RGBA32F", f"Light that glossy surfaces receive, {order}", True)
            for order in ORDERS
        ),
        Write(SHOWN, "RGBA32F", "How much surfaces reflect that reflections show; its luminance squared", True),
        Write(SHOWN_THROUGH, "RGBA32F", "The same of what is seen through glass", True, by_need=True),
        *(
            Write(f"radiance.transmission_{order}", "RGBA32F", f"Light through glass, {order}", True, by_need=True)
            for order in ORDERS
        ),
    )
    provides = (ShadedLobes,)
    requests = (GatherBindings, EmissivePoints, TracedLobes, MediaService, LightOfMedia, EditsAtHits)

    def __init__(self):
        self._sources = PathSources(
            ("glossy", "transmission", "diffuse"), "hits", WORLD_DIRECTIONS, EMISSIVE_POINTS
        )  # fmt: skip
        self._active = False
        self._first_rays = 0.0
        self._turns = [Turns(self, MOST_PARTS) for _ in range(3)]  # of the ways of glass (hits/scatter.frag.glsl)
        self._any_ray = True  # whether some lobe has rays
        self._onward = True  # whether rays may go on from what they meet
        self._guides: tuple[str, ...] = (SHOWN,)
        self._into: dict[str, images.Image] = {}  # what this bounce adds to, by name
        self._rows: list[np.ndarray] = []  # lights of this sample

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        if not snapshot.instances:
            return "the scene has no surface"
        used = snapshot.used_materials
        if not may_be_glossy(snapshot) and not any(may_refract(snapshot.materials[slot].graph) for slot in used):
            return "no material mirrors or bends light"
        if settings.bounces == 0:
            return "the scene's bounces are set to 0"
        if settings.get(self, "bounces") == 0:
            return (
                "drafts show mean colours in reflections" if settings.schedule.is_draft else "its bounces are set to 0"
            )
        return acceleration.too_many(snapshot)

    def begin(self, frame: Frame) -> None:
        """Tell the techniques that gather indirect light and walk through glass what this one takes over."""
        self._active = self._follows(frame)
        if self._active:
            limit = self._roughness(frame)
            frame.provide(ShadedLobes(limit))
            self._sources.emissive_points = FEW_EMISSIVE_POINTS if frame.settings.samples < FEW else EMISSIVE_POINTS
            self._sources.begin(frame)
            sampled = frame.plan.runs("environment_light")  # of its directions rays of the first lobe leave a share
            of_first = directions_rate(frame).per_sample if sampled else 0.0
            self._first_rays = CANDIDATES * WORLD_DIRECTIONS / of_first if of_first else 0.0
            graphs = [frame.snapshot.materials[slot].graph for slot in frame.snapshot.used_materials]
            smoothest = min((0.0 if may_refract(one) else least_roughness(one) for one in graphs), default=np.inf)
            # In single precision, as shaders compare: there a socket's .4 is this .4, which it exceeds here.
            self._onward, self._any_ray = (smoothest <= np.float32(least) for least in (ONWARD_ROUGHNESS, limit))
            for rays, least, has in (("1 bounce", ONWARD_ROUGHNESS, self._onward), ("none", limit, self._any_ray)):
                if not has:
                    frame.account.chose(self, "rays", f"{rays}, because no material is smoother than {least:g}")
        self._guides = tuple(name for name in (SHOWN, SHOWN_THROUGH) if name in frame.images)
        guide = self._guides if frame.settings.samples > 1 else ()
        # Which surface behind glass mirrors is chance: a bounce that one sample shows nothing of may bring most.
        by_chance = refracts(frame)
        names = (*_names(by_chance, ORDERS), *guide)
        for way, turns in enumerate(self._turns):
            turns.begin(frame, names, may_rest=way == 1 or not by_chance)

    def follows_both_ways(self, frame: Frame) -> bool:
        """Where its rays are in use, glass is smooth, and no edit turns what that mirrors apart from what it bends."""
        glass = [one.glass for one in frame.materials.compiled if one.glass]
        smooth = any(one.fresnel and one.roughness <= BOTH_ROUGHNESS for one in glass)
        wide = frame.settings.get(self, "roughness") >= BOTH_ROUGHNESS
        return self._follows(frame) and smooth and wide and not frame.plan.runs("reflection_editing")

    def follows_coats(self, frame: Frame) -> bool:
        """Where its rays are in use, some material has a coat, and no edit turns what that mirrors apart."""
        coated = any(frame.materials.compiled[slot].coated for slot in frame.snapshot.used_materials)
        return coated and self._follows(frame) and not frame.plan.runs("reflection_editing")

    def _roughness(self, frame: Frame) -> float:
        """Up to which lobes are shaded. Those rougher than GATHERED_FROM are calmer if they are gathered with the
        virtual lights (a bronze of .42: glossy error .0066 to .0003), but then do not see through glass, and what
        smooth metal mirrors onto them is spread: a floor beside a polished ball had four fifths of it, and bright dots.
        """
        roughness = frame.settings.get(self, "roughness")
        if roughness <= GATHERED_FROM or not frame.plan.fills("indirect") or refracts(frame):
            return roughness
        graphs = (frame.snapshot.materials[k].graph for k in frame.snapshot.used_materials)
        narrow = GATHERED_FROM / 2  # lobes from here on are spread by less than the gathering lobe is wide
        if any(rough < narrow for graph in graphs for rough in gloss.mirrors(graph)):
            return roughness
        frame.account.chose(self, "roughness", f"{GATHERED_FROM:g}, because no material is glass or smooth metal")
        return GATHERED_FROM

    @staticmethod
    def _follows(frame: Frame) -> bool:
        gathers = any(GatherBindings in technique.provides for technique in frame.plan.techniques)
        return gathers or not frame.plan.fills("indirect")

    def sample(self, frame: Frame) -> Iterator[None]:
        if not self._active or frame.receivers is None or not len(frame.receivers.distance):
            return
        both, coats = goes_both_ways(frame), keeps_coats(frame)
        behind = both and frame.settings.samples < FEWEST_BY_CHANCE
        turns = self._turns[: 1 + (both or coats) + behind]
        ways = [(way, one) for way, one in enumerate(turns) if one.weight(frame)]
        if not ways or not self._any_ray:
            frame.kept(CausticMaps).done()
            return
        hits, transmission = frame.kept(Hits), refracts(frame)
        maps = frame.kept(CausticMaps)
        caustics = maps.ready(frame)
        self._rows = rows = self._sources.rows(frame, maps.lights if caustics else ())
        sources = self._sources.block(rows)
        mirrors = min(frame.settings.get(self, "bounces"), frame.settings.bounces)
        glass = next((t for t in frame.plan.techniques if "transmission" in t.fills), None)
        interfaces = frame.settings.get(glass, "interfaces") if glass else 0
        rounds = max(mirrors, interfaces + 1 if transmission else 0) if self._onward else 1
        reach = {
            "mirrors": mirrors, "interfaces": interfaces, "rays": rounds, "shaded_roughness": shaded_roughness(frame)
        }  # fmt: skip
        onward_roughness = min(reach["shaded_roughness"], ONWARD_ROUGHNESS)

        edits = frame.service(EditsAtHits)
        within = FROSTED_WITHIN * (edits is None)  # edits may turn what is mirrored apart from what is bent
        turned = edits.begin(frame, frame.images["surface.edit"]) if edits is not None else images.Target(())
        rays, onward = self._take(frame), self._take(frame)
        records = Records.take(frame.size)
        closures = take_closures(frame.size, records.target.depth)
        places = self._places(frame)

        def follow(way: int, turns: Turns, rays: images.Target, onward: images.Target, point: dict) -> Iterator[None]:
            first = {**reach, "ray_share": 1.0 / places}
            start, seen = ELSEWHERE if point else OWN, surface_bindings(frame)
            self._scatter(frame, rays, first, 0, frame.images[MARKS], seen, start, point, way)
            yield
            with turns.drawing(frame) as drawing:
                for number in range(rounds):
                    round_ = {**first, "ray_number": number, "shaded_roughness": onward_roughness}
                    met = hits.trace(frame, self, rays.colors[:2], records, number=number)
                    yield
                    yield from hits.shading(
                        frame, self, rays.colors[1], records, met, closures, number, masked=True,
                        path=rays.colors[2], both_ways=within + SMOOTH_BOTH * (behind and number < MOST_THROUGH),
                    )  # fmt: skip
                    yield
                    if edits is not None:
                        edits.solve(frame, self, turned, records, closures, rays)
                        closures.colors[LOBE].beside = {"surface_edit": turned.colors[0]}
                    self._into = drawing.images(number)
                    self._pass_media(frame, rays, records, closures, sources, len(rows), number, transmission)
                    yield
                    self._add_found(frame, rays, records, closures, sources, len(rows), round_, transmission)
                    yield
                    if not met:
                        drawing.done(number)
                        break
                    self._add_guide(frame, rays, records, closures, round_)
                    yield from self._add_received(
                        frame, rays, records, closures, sources, len(rows), round_, transmission
                    )
                    if caustics:
                        self._add_caustics(frame, caustics, rays, records, closures, transmission, onward_roughness)
                    drawing.done(number)
                    yield
                    if number + 1 == rounds or not turns.weight(frame, number + 1):
                        break
                    before = {
                        "met_origin": rays.colors[0], "met_direction": rays.colors[1], "met_path": rays.colors[2],
                        "met_travelled": rays.colors[3],
                        "hit_place": records.images["hit_place"], "hit_passed": records.images["hit_passed"],
                    }  # fmt: skip
                    bound = closure_bindings(closures)
                    if edits is not None:  # what bends light has its edit with the ray until that leaves
                        closures.colors[LOBE].beside["carried_edit"] = turned.colors[1]
                    self._scatter(frame, onward, round_, number + 1, records.target.depth, bound, ONWARD, before, way)
                    closures.colors[LOBE].beside = {}
                    rays, onward = onward, rays

        try:
            for place in range(places):
                with self._looking(frame, place, places) as point:
                    for way, turns in ways:
                        yield from follow(way, turns, rays, onward, point)
        finally:  # also where a viewport drops the sample
            closures.colors[LOBE].beside = {}
            for image in (*rays.colors, *onward.colors, *closures.colors, *turned.colors):
                images.pool.give(image)
            records.give()
            maps.done()
        frame.count(self, "light samples", len(rows))

    @staticmethod
    def _places(frame: Frame) -> int:
        """From how many points of a pixel rays start in a sample: what a mirror shows has edges that one ray does not
        average. Edits are known at the pixel's own point alone; other points are of the camera's picture, not of a
        bake's."""
        alone = all_alike(frame) or frame.service(EditsAtHits) is not None or frame.snapshot.baked is not None
        return 1 if alone else max(MORE_RAYS // frame.settings.samples, 1)

    @contextmanager
    def _looking(self, frame: Frame, place: int, places: int) -> Iterator[dict[str, images.Image]]:
        """Look at the pixels' own point (0) or at another one of the film, with what that shows for ELSEWHERE."""
        if place == 0:
            yield {}
            return
        with ExitStack() as stack:
            colors = [stack.enter_context(images.borrowed(*frame.size, "RGBA32F")).colors[0] for _ in SURFACE_IMAGES]
            depth = stack.enter_context(images.borrowed(*frame.size, "DEPTH_COMPONENT32F")).colors[0]
            try:
                # Those of the film's points that come behind the samples' own (film.py).
                frame.look(film=frame.settings.samples + frame.sample * (places - 1) + place - 1)
                draw_sample(frame, self, images.Target(tuple(colors), depth))
                shown = dict(zip(SURFACE_IMAGES, colors))
                yield {f"point_{name}": shown[name] for name in POINT_IMAGES}
            finally:
                frame.look()

    @staticmethod
    def _take(frame: Frame) -> images.Target:
        return images.Target(tuple(images.pool.take(*frame.size, layout) for layout, _ in STATE))

    def _scatter(self, frame: Frame, rays, reach, number, depth, surfaces, start: str, more, way: int) -> None:
        """Rays of the lobes of `surfaces`, into `rays`. `start`: the program, with `more` textures. `way`: of glass
        that goes both ways."""
        images.Target(rays.colors[1:2]).clear()  # a ray without direction is none, whatever else stands there
        edits = frame.service(EditsAtHits)
        with edits.entering(surfaces["surface_lobe"]) if edits is not None else nullcontext():
            passes.fullscreen(
                scatter_program(start),
                images.Target(rays.colors, depth),
                where=MET if start == ONWARD else ANY_SURFACE,
                textures={**surfaces, "energy_table": frame.materials.energy_table, **more},
                blocks={"film_view": frame.view_block},
                constants={
                    **reach, "ray_number": number, "offset_size": frame.offset_size,
                    "traced_roughness": traced_roughness(frame), "clear_roughness": clear_roughness(frame),
                    "first_rays": self._first_rays, "way": way,
                    "photons_shine": frame.shared(Answered).photons_shine,
                },
            )  # fmt: skip
        frame.count(self, "passes")

    def _pass_media(self, frame, rays, records, closures, sources, count, number, transmission) -> None:
        """Let media on the way to what was met take what passes there, and show their own light."""
        media, light = frame.service(MediaService), frame.service(LightOfMedia)
        if media is None:
            return
        textures = dict(zip(("lobe_start", "lobe_way", "met_path"), rays.colors))
        textures["surface_position"] = closure_bindings(closures)["surface_position"]
        passing = Rays(textures, number, ANY_RAY, transmission)
        depth = records.target.depth
        target = images.Target((records.images["hit_passed"],), depth)
        media.fade(frame, self, passing, target, sources, count if number else 0)  # the first ray finds no lamps here
        if light is not None:
            light.add(frame, self, passing, self._target(transmission, ORDERS, depth))

    def _add_found(self, frame, rays, records, closures, sources, count, reach, transmission) -> None:
        world = self._sources.world_flags
        emissive = frame.service(EmissivePoints) or EmissivePoints()
        bound, bright = closure_bindings(closures), bright_world(frame)
        passes.fullscreen(
            found_program(self._sources.kinds, transmission),
            self._target(transmission, ORDERS, records.target.depth),
            blend="ADDITIVE_PREMULT",
            where=ANY_RAY,
            textures={
                **_state(rays), "surface_position": bound["surface_position"],
                "surface_emission": bound["surface_emission"], "hit_passed": records.images["hit_passed"],
                "environment_map": frame.environment.map, "environment_density_map": frame.environment.density_map,
            },
            blocks={"film_view": frame.view_block, "world_light": frame.environment.block, "sources": sources},
            constants={
                "light_count": count, "world_samples": float(WORLD_DIRECTIONS),
                "world_glossy": int(bool(world & lights.GLOSSY_FLAG)),
                "world_transmission": int(bool(world & lights.TRANSMISSION_FLAG)),
                "emissive": self._emissive(emissive.power, emissive.count, reach["ray_number"]),
                "glass_blocks": (float(meshes_answered(frame)), bright.threshold if bright else 1e30),
                "ray_number": reach["ray_number"],
            },
        )  # fmt: skip
        frame.count(self, "passes")

    def _emissive(self, power: float, points: float, number: int) -> tuple[float, float, float, float]:
        """Power of emissive surfaces and points drawn on them in a sample: for glossy surfaces that the camera sees,
        and for all others."""
        others = float(self._sources.emissive_points) if number else GLASS_POINTS
        return power, points, self._sources.emissive_power, others

    def _add_guide(self, frame, rays, records, closures, reach) -> None:
        if frame.settings.samples > 1:
            passes.fullscreen(
                guide_program(len(self._guides) > 1),
                images.Target(tuple(self._into[name] for name in self._guides), records.target.depth),
                blend="ADDITIVE_PREMULT",
                where=MET,
                textures={**closure_bindings(closures), "met_path": rays.colors[2]},
                constants={"shaded_roughness": reach["shaded_roughness"], "ray_share": reach["ray_share"]},
            )
            frame.count(self, "passes")

    def _add_received(self, frame, rays, records, closures, sources, count, reach, transmission) -> Iterator[None]:
        """Light straight from sources, then that of other surfaces."""
        rays_of_pixel = round(frame.settings.samples / reach["ray_share"])
        repeats = max(-(-MORE_RAYS // rays_of_pixel), 1) if reach["ray_number"] < 2 else 1
        common = {
            **closure_bindings(closures), **frame.hierarchy("diffuse").textures,
            "energy_table": frame.materials.energy_table, "reflectance": frame.materials.energy_table,
            "ray_direction": rays.colors[1], "met_path": rays.colors[2], "hit_passed": records.images["hit_passed"],
        }  # fmt: skip
        known = {name: reach[name] for _, name in REACH}
        constants = {**known, "light_count": count, "offset_size": frame.offset_size, "repeats": repeats}
        provided = frame.service(GatherBindings)
        if provided is not None:
            common["reflectance"] = provided.bindings["textures"]["reflectance"]
        drawn = [(False, {}, {})]
        if provided is not None and provided.bindings["constants"]["glossy_radius"] > 0.0:
            lights_of = {"virtual_lights": provided.bindings["textures"]["virtual_lights"]}
            drawn.append((True, lights_of, {name: provided.bindings["constants"][name] for _, name in NEAR_CONSTANTS}))
        for bounced, more, near in drawn:
            textures = common | more
            program = received_program(self._sources.kinds, transmission, frame.materials.soft, bounced)
            program = lit_at_hits(frame, program, textures)
            passed = textures["hit_passed"]
            if not bounced:
                passed.beside = linked.groups_of_hits(frame, self, self._rows, records.images["hit_triangle"])
            passes.fullscreen(
                program,
                self._target(transmission, ("indirect",), records.target.depth),
                blend="ADDITIVE_PREMULT",
                where=MET,
                textures=textures,
                blocks={"film_view": frame.view_block, "sources": sources},
                constants=constants | near,
            )
            passed.beside = {}
            frame.count(self, "passes")
            yield

    def _add_caustics(self, frame, maps, rays, records, closures, transmission, roughness) -> None:
        textures = closure_bindings(closures) | {
            "met_path": rays.colors[2], "hit_passed": records.images["hit_passed"], "ray_direction": rays.colors[1],
        }  # fmt: skip
        target = self._target(transmission, ("indirect",), records.target.depth)
        caustic_maps.add_at_hits(frame, self, maps, target, transmission, MET, textures, roughness)

    def _target(self, transmission: bool, orders: tuple[str, ...], depth: images.Image) -> images.Target:
        return images.Target(tuple(self._into[name] for name in _names(transmission, orders)), depth)

    def release(self) -> None:
        self._sources.release()
        for turns in self._turns:
            turns.drop()


def _state(rays: images.Target) -> dict[str, images.Image]:
    return {name: image for (_, name), image in zip(STATE, rays.colors)}


def _names(transmission: bool, orders: tuple[str, ...]) -> tuple[str, ...]:
    paths = ("glossy", "transmission") if transmission else ("glossy",)
    return tuple(f"radiance.{path}_{order}" for path in paths for order in orders)
