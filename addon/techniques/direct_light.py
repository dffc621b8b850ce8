"""Direct light: point, spot, sun and area lights, by one point on each light per sample.

For a point x with view v and a light sample y of density p (per steradian) in direction w,

    L(x, v) = mean over samples of  f(x, v, w) cos(w) Le(y, -w) V(x, y) / p

with Cycles' light shapes and units (addon/sources/lights.py) and Cycles' closures (shaders/lib/brdf.glsl). V comes from
the technique in the shadow slot. All pixels share y, so there is no noise, only the quadrature error of a
low-discrepancy set; where a narrow lobe would see dots, traced rays take over part of the light (see traced_glossy).

Where the picture is only shown whole, light_probes shares out points among the lights by the error that each leaves.
More lights than `lights_per_sample` are drawn at random, in proportion to power, each weighted by the inverse of its
chance (systematic sampling); every light keeps a minimum chance.

| cost | per sample |
|---|---|
| passes | 1 over the screen per round of lights (a round fills the depth-map atlas) |
| fetches per pixel | 6 surface + per light: 5 to 8 list, 4 to 6 shadow |

Where the radius of a round light is more than a quarter of its distance, its visibility comes from rays.

A point that stands for an area a of its light gives a receiver nearer than sqrt(a / pi) no more than at that distance:
otherwise single points beside a surface would outshine the whole light. What that leaves out beside area lights each
pixel adds by a point of its own (light/lamp_rays.glsl): 1 pass more for these, and rays where receivers are that near.

Bias: none that remains as samples grow; what is left out where lamps are narrow, round or have linked blockers.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.technique import Param, Technique
from ..lighting import shared_visibility
from ..lighting.caustic_casters import answered
from ..lighting.light_rates import LightRates, PointsDrawn, rate_of
from ..lighting.loop import DIRECT_WRITES, NEAR, RAYS_WHERE_NEAR, light_surfaces, lighting
from ..lighting.visibility import (
    EDGES,
    HARD,
    NO_VIEWS,
    RAY_CONSTANTS,
    RAYS,
    LightPoint,
    Lookup,
    Maps,
    PlainMaps,
    Rays,
    ShadowLinks,
    VisibilityProvider,
    ray_bindings,
)
from ..scene import acceleration
from ..snapshot.scene import Snapshot
from ..sources import lights
from ..sources.rates import Rate
from ..surfaces.draw import LIT_SURFACES

LAMP_RAYS = Lookup(
    "lamp rays",
    "light/lamp_rays.glsl",
    textures=acceleration.HIERARCHY_TEXTURES,
    constants=RAY_CONSTANTS,
    defines=(("OWN_POINTS", "1"),),
    maps=False,
)
LIGHTING = tuple(
    lighting(lookup, soft_lobes)
    for lookup in (HARD, EDGES, RAYS_WHERE_NEAR, RAYS, LAMP_RAYS, shared_visibility.BETWEEN)
    for soft_lobes in (False, True)
)


class DirectLight(Technique):
    name = "direct_light"
    label = "Direct light"
    params = (
        Param(
            "lights_per_sample", "Lights per sample", 16,
            "If the scene has more lights, each sample picks this many of them at random",
            1, 256,
        ),
    )  # fmt: skip
    reads = LIT_SURFACES
    writes = DIRECT_WRITES
    provides = (PointsDrawn,)
    requests = (VisibilityProvider, LightRates)

    def __init__(self):
        self._emitters: list[lights.Emitter] = []
        self._by_rays: dict[str, bool] = {}  # lights by key, of this frame
        self._unshadowed, self._rays = PlainMaps(lambda frame: 16), Rays()
        self._sources = lights.Sources()
        self._beside: dict[str, float] = {}  # area lights by key: least squared distance from a receiver, m2

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        if not any(np.any(light.strength) for light in snapshot.lights):
            return "the scene has no light with power"
        if not snapshot.instances:
            return "the scene has no surface"
        return None

    def begin(self, frame: Frame) -> None:
        self._emitters = frame.emitters
        self._traced = {emitter.light.key for emitter in lights.traceable(self._emitters)}
        self._near = {emitter.light.key for emitter in self._emitters if _is_near(frame, emitter)}
        self._by_rays, self._beside = {}, _squared_distances(frame, self._emitters)
        drawn, provider = PointsDrawn(), frame.service(VisibilityProvider)
        for emitter, weight in zip(self._emitters, 1.0 / self._chances(frame)):
            rate = self._rate(frame, emitter, weight, provider.serving(emitter) if provider else self._unshadowed)
            drawn.per_sample[emitter.light.key] = rate.per_sample
        frame.provide(drawn)

    def sample(self, frame: Frame) -> Iterator[None]:
        if not self._emitters or frame.receivers is None or not len(frame.receivers.distance):
            return
        points, left_out = self._points(frame)
        yield from light_surfaces(frame, self, points, lights.kinds_of(self._emitters), self._sources)
        if left_out:
            kinds = lights.kinds_of(self._emitters) & (1 << lights.RECTANGLE | 1 << lights.ELLIPSE)
            yield from light_surfaces(frame, self, left_out, kinds, self._sources, lambda *_: _lamp_rays(frame))
            frame.count(self, "lamps by points of pixels, too", len(left_out))

    def _points(self, frame: Frame) -> tuple[list[LightPoint], list[LightPoint]]:
        """This sample's points on the lamps, and lamps of which these leave something out that pixels add."""
        service, found, left_out = frame.service(VisibilityProvider), [], []
        for emitter, weight in self._chosen(frame):
            provider = service.serving(emitter) if service else self._unshadowed
            rate = self._rate(frame, emitter, weight, provider)
            points = rate.per_sample * frame.settings.samples / weight
            narrow = emitter.is_narrow(frame.receivers) and not acceleration.too_many(frame.snapshot)
            among = self._blockers(frame, emitter) if service else None
            if among is not None:
                provider = among
            elif service and (narrow or self._has_rays(frame, emitter, provider)):
                provider = self._rays
            flags = lights.TRACED_FLAG * (emitter.light.key in self._traced)
            flags += lights.GLASS_BLOCKS_FLAG * answered(frame, emitter)
            numbers, wholes = rate.points(frame.sample), []
            for number in numbers:
                part, cell, whole = _stands_for(frame, emitter, provider, number, points)
                wholes.append(whole)
                shown, share = (part, part.area / emitter.area) if part else (emitter, 1.0)
                drawn = frame.random_volume("light", number, evenly=0.0 < cell < 1.0 and emitter.is_flat)
                # The same numbers for all lights: then two half lights are one, and names and order change nothing.
                sample = shown.middle() if whole else shown.sample(*drawn)
                near = bool(service) and provider.asks_views and cell == 0.0 and emitter.light.key in self._near
                views = provider.views(frame, shown, sample, number, cell)
                asked = len(views) or near or not provider.asks_views
                sample = shown.narrow_sample(*drawn[:2]) if narrow else sample
                row = shown.row(sample, 0, asked, weight, rate.per_sample * share, points * share)
                row[lights.LIGHT.at.flags] += lights.WHOLE_FLAG * whole + flags + lights.NEAR_FLAG * near
                row[lights.LIGHT.at.flags] += lights.NARROW_FLAG * narrow
                found.append(LightPoint(row, provider, views))
            squared = self._beside.get(emitter.light.key, np.inf)
            if squared < lights.footprint(emitter.area, points) and not (narrow or emitter.light.links.passing):
                # A sample without a point of the light leaves out what its next one does.
                wholes = wholes or [_stands_for(frame, emitter, provider, numbers.start, points)[-1]]
                if all(wholes):
                    continue
                shadowed, each = int(bool(service) and emitter.light.cast_shadow), rate.per_sample
                share = weight * wholes.count(False) / len(wholes)
                row = emitter.row(emitter.centre, 0, shadowed, share * each, each, points)
                row[lights.LIGHT.at.flags] += flags
                left_out.append(LightPoint(row, self._rays))
        return found, left_out

    def _blockers(self, frame: Frame, emitter: lights.Emitter) -> VisibilityProvider | None:
        """What tells the visibility of a lamp with shadow linking, if it has any."""
        passing = emitter.light.links.passing
        if not passing or not emitter.light.cast_shadow:
            return None
        found = frame.shared(ShadowLinks).of(frame, passing)
        of = f"blockers of {emitter.light.name}"
        if found is None:
            frame.account.chose(self, of, f"all objects, since {acceleration.too_many(frame.snapshot)}")
        else:
            frame.account.chose(self, of, "rays among its own, whatever technique draws shadows")
        return found

    def _has_rays(self, frame: Frame, emitter: lights.Emitter, shadow: VisibilityProvider) -> bool:
        """Whether the light has rays in place of maps; asked when it is first drawn, as one of many may never be."""
        key = emitter.light.key
        if key not in self._by_rays:
            self._by_rays[key] = shadow.traces(frame, emitter)
        return self._by_rays[key]

    def _rate(self, frame: Frame, emitter: lights.Emitter, weight: float, shadow) -> Rate:
        """Points per sample: one where each would be the whole light, seen from its middle again and again."""
        rate = shadow.rate(frame, rate_of(frame, emitter.light.key))
        points = rate.per_sample * frame.settings.samples / weight
        alike = emitter.extended and rate.per_sample > 1
        if alike and shadow.cell(frame, 0, points) >= 1.0 and shadow.part(frame, emitter, 0, points) is None:
            return Rate()
        return rate

    def _chances(self, frame: Frame) -> np.ndarray:
        """Chance of each light to be drawn in a sample: in proportion to power where there are many."""
        most = frame.settings.get(self, "lights_per_sample")
        if len(self._emitters) <= most:
            return np.ones(len(self._emitters))
        power = np.array([emitter.power for emitter in self._emitters])
        share = 0.8 * power / max(power.sum(), 1e-300) + 0.2 / len(power)
        return np.minimum(share * most, 1.0)

    def _chosen(self, frame: Frame) -> list[tuple[lights.Emitter, float]]:
        """Lights of this sample with the inverse of their chance."""
        chance = self._chances(frame)
        if (chance >= 1.0).all():
            return [(emitter, 1.0) for emitter in self._emitters]
        edges = np.concatenate([[0.0], np.cumsum(chance)])
        marks = np.arange(int(np.ceil(edges[-1]))) + frame.uniform("choose lights")
        picked = np.unique(np.searchsorted(edges, marks[marks < edges[-1]], side="right") - 1)
        return [(self._emitters[k], 1.0 / chance[k]) for k in picked]

    def release(self) -> None:
        self._unshadowed.release()
        self._sources.release()
        self._emitters = []


def _stands_for(frame: Frame, emitter: lights.Emitter, provider, number: int, points: float):
    """Which part of a light point `number` is drawn on, if not on all of it; of that the share that the point stands
    for; and whether it does so in closed form (WHOLE_FLAG)."""
    part = provider.part(frame, emitter, number, points)
    cell = 1.0 if part else provider.cell(frame, number, points)
    # One point of a textured lamp would give the whole picture the brightness of its place.
    all_of_it = part is None or part.area >= emitter.area
    even = emitter.maps is None or (all_of_it and frame.lamp_maps.varies_by_place_alone(emitter.light))
    return part, cell, cell >= 1.0 and emitter.extended and even


def _is_near(frame: Frame, emitter: lights.Emitter) -> bool:
    """Whether a round light is so large beside its distance that its visibility needs rays (see NEAR)."""
    receivers = frame.receivers
    if emitter.kind not in (lights.POINT, lights.SPHERE) or not emitter.radius > 0.0 or not emitter.light.cast_shadow:
        return False
    if receivers is None or not len(receivers.distance) or acceleration.too_many(frame.snapshot):
        return False
    nearest = np.clip(emitter.centre, receivers.low, receivers.high)
    return emitter.radius > NEAR * float(np.linalg.norm(nearest - emitter.centre, axis=1).min())


def _squared_distances(frame: Frame, emitters: list[lights.Emitter]) -> dict[str, float]:
    """Of area lights by key: least squared distance of their box from those of receivers, m2; none in drafts, or where
    nothing is traced."""
    receivers = frame.receivers
    if receivers is None or not len(receivers.distance) or frame.settings.schedule.is_draft:
        return {}
    if acceleration.too_many(frame.snapshot):
        return {}
    found = {}
    for one in emitters:
        if one.has_span:
            half = np.abs(one.u[:3]) + np.abs(one.v[:3])
            apart = np.maximum(np.maximum(receivers.low - one.centre, one.centre - receivers.high) - half, 0.0)
            found[one.light.key] = float((apart**2).sum(axis=1).min())
    return found


def _lamp_rays(frame: Frame) -> Maps:
    textures, constants = ray_bindings(frame)
    return Maps(None, NO_VIEWS, LAMP_RAYS, textures=textures, constants=constants)
