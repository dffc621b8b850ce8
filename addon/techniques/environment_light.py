"""Environment light: the world as directional lights, sampled in proportion to its radiance, each with a depth map.

    L(x, v) = mean over samples of  f(x, v, w) cos(w) L_world(w) V(x, w) / p(w)

Directions w come from a low-discrepancy set warped by the world's luminance (addon/sources/environment.py) and by what
light probes found open (light_probes.py): a room lit through a window spends its directions on the window. V is an
orthographic depth map along w over what the camera sees, so it converges to the truth with any caster.

All pixels share a sample's directions, and with them their noise. What they bring unoccluded has a known mean, the
irradiance of a normal (addon/sources/irradiance.py). Diffuse surfaces subtract the difference, as much of it as light
arrived in the samples before (a control variate, shaders/lib/known_irradiance.glsl): an open floor has its exact light
in every sample. Directions count there by how open the probes found the scene.

Where many pixels see little of the world (a gallery behind columns), each pixel of a final picture traces rays drawn
from a table of its tile (addon/sources/world_tiles.py): as many as leave the noise of shared directions, in no more
time than their maps; the probes tell which leaves less error. The only sample of a picture does so wherever a ray
leaves less noise than a direction: hard shadows of few directions would pass through an animation with the camera.
Where rays cost less than maps, they answer for shared directions, too. Auto draws one to eight directions a sample, up
to 16 in pictures of few samples (addon/sources/rates.py).

| cost | per sample |
|---|---|
| maps | `directions` orthographic views (more where the picture is deep), or as many rays per pixel |
| passes | 2 over the screen |
| rays | per pixel, about 1 instead of each 4 or more maps |

Bias: the first sample takes its own share of the known light, an error that falls with directions and samples.

Fails: a mirror-like lobe sees single directions as dots; traced rays take its light instead (traced_glossy). Few
samples under an even sky show faint overlapping hard shadows. Figures: docs/log/2026-11-26-environment.md.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.technique import Param, Technique
from ..gfx import images, passes
from ..gfx.library import Program
from ..lighting import depth_maps
from ..lighting.caustic_casters import bright_world
from ..lighting.imperfect_maps import AS_CAUSTICS, IMPERFECT, ImperfectMaps, by_points, programs_by_points
from ..lighting.light_rates import LightRates, world_rate
from ..lighting.loop import DIRECT_WRITES, light_surfaces, lighting
from ..lighting.maps_or_rays import compared
from ..lighting.visibility import (
    HARD,
    NO_VIEWS,
    RAY_CONSTANTS,
    RAYS,
    RESOLUTION,
    LightPoint,
    Lookup,
    Maps,
    PlainMaps,
    Rays,
    VisibilityProvider,
    by_rays,
    glass_absorbs,
    map_resolution,
    ray_bindings,
)
from ..scene import acceleration
from ..snapshot.scene import Snapshot
from ..sources import environment, lights, world_tiles
from ..sources.rates import Rate
from ..surfaces.draw import LIT_SURFACES

WORLD_RAYS = Lookup(
    "world rays",
    "light/world_rays.glsl",
    textures=(
        *acceleration.HIERARCHY_TEXTURES, ("RGBA32F", "environment_map"),
        ("R32F", "environment_density_map"), ("R32F", "world_edges"),
    ),
    constants=(
        *RAY_CONSTANTS, ("IVEC2", "world_tiles"), ("IVEC2", "world_grid"),
    ),
    defines=(("OWN_POINTS", "1"),),
    blocks=((environment.WORLD, "world_light"),),
    maps=False,
)  # fmt: skip


def _with_known(lookup: Lookup) -> Lookup:
    """`lookup`, and what is missing of the world's irradiance."""
    return replace(
        lookup,
        name=f"{lookup.name}, irradiance known",
        textures=(*lookup.textures, ("RGBA32F", "irradiance_table"), ("RG32F", "openness")),
        constants=(*lookup.constants, ("FLOAT", "known_share"), ("INT", "bright_count")),
        defines=(*lookup.defines, ("KNOWN_IRRADIANCE", "1")),
    )


KNOWN = {lookup: _with_known(lookup) for lookup in (HARD, RAYS, IMPERFECT)}
KNOWN_LIGHTING = tuple(
    lighting(KNOWN[lookup], soft_lobes, 1 << lights.DIRECTION) for lookup in KNOWN for soft_lobes in (False, True)
)
OPENNESS = passes.fullscreen_program(
    "openness to the world",
    "light/openness.frag.glsl",
    textures=(("RG32F", "openness"), ("RGBA32F", "diffuse"), ("RGBA32F", "glossy")),
    outputs=(("VEC4", "out_openness"),),
)
RAY_LIGHTING = tuple(lighting(WORLD_RAYS, soft_lobes, 1 << lights.DIRECTION) for soft_lobes in (False, True))
UNSHARED = 1.5  # times less of the noise of rays than of shared directions remains after denoising
USUAL = 4.0  # shared directions of a sample that rays are compared with: with more of both the same one wins
WIDEST_PATCH = np.pi  # steradians of the world that one soft map stands for, at most
FRAGMENTED = 3.0  # variance of a single shared direction below which a low-discrepancy set of them does better still
# Texels a side of maps in drafts, at least. In maps as coarse as their pixels a crease lies within a texel, and the
# world's light from behind it comes through. 9 % of a draft of 40 x 22 pixels more than 64 texels.
LEAST_IN_DRAFTS = 256


def directions_rate(frame: Frame) -> Rate:
    """How many directions of the world a sample draws. Auto asks the probes, or shares six maps with the lights."""
    asked = frame.settings.values.get((EnvironmentLight.name, "directions"), 0)
    probed = world_rate(frame)
    if not asked and probed is not None:
        return probed
    return Rate(int(np.log2(asked or max(2, 6 - len(frame.snapshot.lights)))))


def no_environment_light(snapshot: Snapshot) -> str | None:
    """Why the world lights nothing, as a sentence; None if it does. For every technique of the slot."""
    world = snapshot.world
    if not np.any(world.color) or (world.image is not None and not np.any(world.image.pixels[..., :3])):
        return "the world is black"
    if not (world.visibility.diffuse or world.visibility.glossy):
        return "the world is hidden from all surfaces"
    if not snapshot.instances:
        return "the scene has no surface"
    fog = world.medium  # it fills all space, and what shines from infinitely far passes all of it
    if fog is not None and fog.even and (fog.absorption + fog.scattering > 0).all():
        return "the world's fog lets none of its light through"
    return None


class EnvironmentLight(Technique):
    name = "environment_light"
    label = "Environment light"
    fills = ("environment",)
    params = (
        Param(
            "directions",
            "Directions",
            0,
            "Directions of the world in each sample, rounded to a power of two; 0: chosen by the expected error",
            0,
            64,
        ),
        # One of many directions, of light that comes from all sides: what a coarser map gets wrong nobody sees.
        replace(RESOLUTION, default=1.0),
    )
    reads = LIT_SURFACES
    writes = DIRECT_WRITES
    requests = (LightRates, VisibilityProvider)

    def __init__(self):
        self._maps, self._rays = PlainMaps(self._resolution), Rays()
        self._sources = lights.Sources()
        self._edges: images.Image | None = None  # of the tiles' tables; None: directions are shared
        self._rays_for_direction = 1.0  # rays of a pixel that leave as little noise as a shared direction does
        self._traced = False  # directions are shared, and rays take the place of their maps
        self._imperfect = ImperfectMaps()
        self._by_points = False  # directions are many, and have small maps from points
        self._openness: list[images.Target] = []  # sums before this sample, and a place for those after it

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        return no_environment_light(snapshot)

    def programs(self, snapshot: Snapshot, settings: Settings) -> tuple[Program, ...]:
        return programs_by_points(settings)

    def begin(self, frame: Frame) -> None:
        if frame.receivers is None or not len(frame.receivers.distance):
            return
        self._give_openness()
        patches = self._patches(frame) is not None
        self._by_points = not patches and _cast_shadows(frame) and by_points(frame, self)
        if self._by_points and bright_world(frame) is not None:
            self._by_points = False
            frame.account.chose(self, "the world", AS_CAUSTICS)
        if self._by_points:
            self._imperfect.begin(frame, self)
        self._edges = None if patches or self._by_points else self._tables(frame, directions_rate(frame))
        own = not patches and self._edges is None
        self._traced = own and _cast_shadows(frame) and self._traces(frame, self._resolution(frame))

    def sample(self, frame: Frame) -> Iterator[None]:
        if frame.receivers is None or not len(frame.receivers.distance):
            return
        seen = frame.snapshot.world.visibility
        flags = (
            lights.SHADOW_FLAG
            + lights.TRACED_FLAG
            + lights.DIFFUSE_FLAG * seen.diffuse
            + lights.GLOSSY_FLAG * seen.glossy
            + lights.EVEN_FLAG * frame.snapshot.world.even
        )
        resolution = self._resolution(frame)
        rate = directions_rate(frame)
        rate = self._imperfect.rate(frame, rate) if self._by_points else rate
        if self._edges is not None:
            # Direction, radiance and density are each pixel's own; the rate is what narrow lobes take it for.
            row = lights.direction_row((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), 1.0, flags, 0, 1, rate.per_sample)
            affordable = min(self._maps_per_ray(frame, resolution), 1.0)
            rays = max(1, int(min(rate.per_sample * affordable, self._needed(rate))))
            points = [LightPoint(row, self._rays)] * rays
            yield from light_surfaces(
                frame, self, points, 1 << lights.DIRECTION, self._sources, lambda *_: self._own_rays(frame)
            )
            frame.count(self, "rays per pixel", rays)
            return
        shadows = _cast_shadows(frame)
        points, patches = [], self._patches(frame)
        bright = bright_world(frame)
        numbers = list(rate.points(frame.sample))
        chosen = np.array([frame.random("environment", number) for number in numbers]).reshape(-1, 2)
        for number, direction, radiance, density in zip(numbers, *frame.environment.draw(*chosen.T), strict=True):
            blocked = bright is not None and bright.holds(radiance)
            asked = flags + lights.GLASS_BLOCKS_FLAG * blocked
            if patches is not None:
                points.append(_patch(frame, patches, asked, rate, number, direction, radiance, density, shadows))
                continue
            views = []
            if self._by_points:
                views = [self._imperfect.eye_along(frame, direction)]
            elif shadows and not self._traced:
                jitter = (
                    *frame.random("map/environment", number), *frame.random("map/environment/turn", number)
                )  # fmt: skip
                views = depth_maps.directional_views(direction, frame.receivers, frame.geometry, jitter, resolution)
                views = [replace(view, glass_blocks=True) for view in views] if blocked else views
            row = lights.direction_row(
                direction, radiance / density, density, asked, 0, len(views) or self._traced, rate.per_sample,
                float(frame.environment.openness(direction)),
            )  # fmt: skip
            maps = self._imperfect if self._by_points else self._maps
            points.append(LightPoint(row, self._rays if self._traced else maps, views))
        if patches is not None:
            yield from light_surfaces(frame, self, points, 1 << lights.SUN, self._sources)
            return

        def known(maps: Maps, count: int) -> Maps:
            return self._known(frame, maps, count / (len(points) * min(rate.per_sample, 1.0)))

        yield from light_surfaces(frame, self, points, 1 << lights.DIRECTION, self._sources, known)
        if self._openness and points and frame.sample + 1 < frame.settings.samples:
            self._sum_openness(frame)

    def _needed(self, rate: Rate) -> float:
        """Rays of a pixel in a sample that leave as little noise as the shared directions do."""
        return float(np.ceil(rate.per_sample * self._rays_for_direction))

    def _resolution(self, frame: Frame) -> int:
        side = map_resolution(frame, frame.settings.get(self, "texels_per_pixel"))
        return max(side, LEAST_IN_DRAFTS) if frame.settings.schedule.is_draft else side

    @staticmethod
    def _patches(frame: Frame) -> VisibilityProvider | None:
        """What tells the visibility of patches of the world, each the share of it that a direction stands for; None
        where directions are single."""
        provider = frame.service(VisibilityProvider)
        return provider if provider is not None and provider.serves_every_source(frame) else None

    def _traces(self, frame: Frame, resolution: int) -> bool:
        """Whether rays take the place of maps."""
        needed = _has_sheets(frame) or glass_absorbs(frame)
        return by_rays(frame, lambda: self._usual_views(frame, resolution), resolution, self, "the world", needed)

    @staticmethod
    def _usual_views(frame: Frame, resolution: int) -> list:
        """Of a direction such as the world's are."""
        direction, *_ = frame.environment.draw(*frame.random("environment", 0))
        middle = (0.5, 0.5, 0.0, 0.0)
        return depth_maps.directional_views(direction, frame.receivers, frame.geometry, middle, resolution)

    def _maps_per_ray(self, frame: Frame, resolution: int) -> float:
        """How many rays of each pixel take the time of the map of one direction, on this device."""
        found = compared(frame, self._usual_views(frame, resolution), resolution, 0)
        return found.maps / max(found.rays, 1e-9)

    def _known(self, frame: Frame, maps: Maps, share: float) -> Maps:
        """The same maps, asked for what is missing of `share` of the world's irradiance, too."""
        if not self._openness:
            self._openness = [images.Target((images.pool.take(*frame.size, "RG32F"),)) for _ in range(2)]
            self._openness[0].clear()
        table, bright = frame.environment.known_irradiance()
        return replace(
            maps, lookup=KNOWN[maps.lookup],
            textures={**maps.textures, "irradiance_table": table, "openness": self._openness[0].colors[0]},
            constants={**maps.constants, "known_share": share, "bright_count": bright},
        )  # fmt: skip

    def _sum_openness(self, frame: Frame) -> None:
        before, after = self._openness
        light = {path: frame.images[f"radiance.{path}_direct"] for path in ("diffuse", "glossy")}
        passes.fullscreen(OPENNESS, after, textures={"openness": before.colors[0], **light})
        self._openness = [after, before]

    def _give_openness(self) -> None:
        for target in self._openness:
            images.pool.give(target.colors[0])
        self._openness = []

    def _tables(self, frame: Frame, rate: Rate) -> images.Image | None:
        """Tables of directions by tile, where rays by them leave less noise than `rate` shared directions."""
        rates = frame.service(LightRates)
        useful = None if rates is None else rates.world_seen
        asked = frame.settings.values.get((self.name, "directions"), 0)
        denoised = frame.plan.runs("denoise")
        # Maps ask the material of a layer itself; rays know it by cells.
        layered = any(material.transparent for material in frame.materials.compiled)
        told_apart = bright_world(frame) is not None  # a row stands for all directions, and glass stops some of them
        only = frame.settings.samples == 1  # nothing is denoised, and shadows of shared directions lie over each other
        known = frame.settings.schedule.known_total
        if useful is None or asked or layered or told_apart or not (denoised or only) or not known:
            return None
        moments = frame.environment.guide_moments()
        own, shared = world_tiles.variances(useful, moments)
        worth = 1.0 if only else UNSHARED / min(rate.per_sample, USUAL)
        if (shared < FRAGMENTED and not only) or own >= worth * shared or frame.hierarchy("shadow") is None:
            return None
        self._rays_for_direction = 1.0 if only else own / (UNSHARED * shared)
        if only and self._maps_per_ray(frame, self._resolution(frame)) < own / shared:
            return None
        chance = world_tiles.tables(world_tiles.arriving(useful, moments[0]), moments[0])
        self._tiles = (useful.shape[1], useful.shape[0])
        return images.upload(world_tiles.lower_edges(chance), "R32F")

    def _own_rays(self, frame: Frame) -> Maps:
        world, (textures, constants) = frame.environment, ray_bindings(frame)
        return Maps(
            None, NO_VIEWS, WORLD_RAYS,
            textures={
                **textures, "environment_map": world.map,
                "environment_density_map": world.density_map, "world_edges": self._edges,
            },
            constants={
                **constants, "world_tiles": self._tiles,
                "world_grid": (environment.GUIDE_COLUMNS, environment.GUIDE_ROWS),
            },
            blocks={"world_light": world.block},
        )  # fmt: skip

    def release(self) -> None:
        self._edges = None
        self._give_openness()
        self._maps.release()
        self._imperfect.release()
        self._sources.release()


def _patch(
    frame: Frame, provider: VisibilityProvider, flags: int, rate: Rate, number: int, direction: np.ndarray,
    radiance: np.ndarray, density: float, shadows: bool,
) -> LightPoint:  # fmt: skip
    """The cap of the world around a direction that the picture's directions leave to this one, as a sun."""
    count = rate.per_sample * frame.settings.samples if frame.settings.schedule.known_total else number + 1.0
    steradians = min(1.0 / (density * count), WIDEST_PATCH)
    half = float(np.arccos(1.0 - steradians / (2.0 * np.pi)))
    zero = np.zeros(3)
    sun = lights.Emitter(
        None, lights.SUN, flags, direction, half, radiance, 1.0 / density, -direction, 0.0, zero, zero, zero
    )
    views = provider.views(frame, sun, direction, number, 1.0) if shadows else []
    if flags & lights.GLASS_BLOCKS_FLAG:
        views = [replace(view, glass_blocks=True) if hasattr(view, "glass_blocks") else view for view in views]
    return LightPoint(sun.row(direction, 0, len(views), rate=rate.per_sample), provider, views)


def _has_sheets(frame: Frame) -> bool:
    """Whether some glass is a single sheet, which lets pass less of the world's light than its faces do."""
    glass = any(frame.materials.compiled[k].glass is not None for k in frame.snapshot.used_materials)
    hierarchy = frame.hierarchy("shadow") if glass else None
    return hierarchy is not None and hierarchy.has_sheets


def _cast_shadows(frame: Frame) -> bool:
    return frame.snapshot.casts_shadows
