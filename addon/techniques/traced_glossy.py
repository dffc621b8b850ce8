"""Traced glossy light: what narrow lobes and mirrors see of lights and world, by one ray per pixel and sample.

Light samples shared by all pixels (direct_light, environment_light) cannot serve a narrow lobe: it would show them as
dots, and a mirror would show nothing. Up to `roughness` four directions are drawn from the lobe's visible normals
instead, and one of them, chosen by what it would bring unblocked, is traced (resampled importance sampling, Talbot et
al. 2005): where nothing blocks, that is as good as four rays. Both estimators, lobe and light samples, are weighted
by the power heuristic (Veach 1997), so that rough lobes keep the noise-free one:

    sum over lights and world of  F G2/G1 * Le(w) * V(x, w) * (4 p_lobe)^2 / ((4 p_lobe)^2 + (n p_light)^2)

V comes from a bounding volume hierarchy (addon/scene/acceleration.py): no depth map has a view per pixel's direction.

| cost | per sample |
|---|---|
| rays | 1 per pixel with a lobe up to `roughness` |
| fetches per ray | about 6 per node and 10 per leaf visited |
| build | one sort of all triangles, when geometry changed |

Why rays: screen-space marching misses what is off screen or behind; prefiltered maps have no occlusion. Both are
faster on small GPUs and will fill the reflection slot beside this one.

Fails: above 4 million triangles (instances counted) nothing is traced and narrow lobes show dots.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.technique import Param, Technique
from ..gfx import passes
from ..lighting import linked, repeated_light
from ..lighting.asked import asked
from ..lighting.light_rates import EmissivePoints, PointsDrawn, rate_of
from ..lighting.loop import DIRECT_WRITES, TRACED_DEFINES
from ..lighting.path_sources import shaded_roughness
from ..lighting.repeated_light import Lit
from ..lighting.visibility import TracedLobes
from ..materials.compiler import may_emit
from ..scene import acceleration
from ..scene.emission_maps import EmissiveLevel
from ..scene.materials import may_be_glossy
from ..scene.view import VIEW
from ..snapshot.scene import Snapshot
from ..sources import lights
from ..sources.environment import WORLD
from ..surfaces.draw import LIT_SURFACES, NARROW_LOBE, SURFACE_TEXTURES, refracts
from .environment_light import directions_rate

TRACED = passes.fullscreen_program(
    "traced glossy",
    "light/traced.frag.glsl",
    textures=(
        *acceleration.HIERARCHY_TEXTURES, ("RGBA32F", "environment_map"), ("R32F", "environment_density_map"),
        *SURFACE_TEXTURES, ("RGBA32F", "energy_table"),
    ),
    blocks=((VIEW, "film_view"), (WORLD, "world_light"), (lights.SOURCES, "sources")),
    constants=(
        ("INT", "light_count"), ("FLOAT", "traced_roughness"), ("FLOAT", "offset_size"),
        ("INT", "world_glossy"), ("FLOAT", "world_samples"), ("FLOAT", "emissive_power"), ("FLOAT", "emissive_points"),
        ("FLOAT", "emissive_level"),
        ("FLOAT", "shaded_roughness"),
        ("INT", "glass_bends"),
    ),
    defines=TRACED_DEFINES,
    outputs=(("VEC4", "out_diffuse"), ("VEC4", "out_glossy")),
)  # fmt: skip


class TracedGlossy(Technique):
    name = "traced_glossy"
    label = "Traced glossy light"
    fills = ("reflection",)
    params = (
        Param(
            "roughness", "Roughness", 0.6,
            "Glossy lobes up to this roughness trace a ray in each sample; rougher ones use light samples only",
            0.0, 1.0,
        ),
    )  # fmt: skip
    reads = LIT_SURFACES
    writes = DIRECT_WRITES
    provides = (TracedLobes,)
    requests = (EmissivePoints, PointsDrawn)

    def __init__(self):
        self._sources = lights.Sources()
        self._rows: list[np.ndarray] = []

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        if not snapshot.instances:
            return "the scene has no surface"
        if not may_be_glossy(snapshot):
            return "no material has a glossy closure"
        lit = np.any(snapshot.world.color) and snapshot.world.visibility.glossy
        emits = any(may_emit(material.graph) for material in snapshot.materials)
        if not lit and not emits and not any(_has_extent(light) for light in snapshot.lights):
            return "no light has a size and the world is black: nothing that a ray could hit"
        return acceleration.too_many(snapshot)

    def begin(self, frame: Frame) -> None:
        """Tell the techniques that draw points of lights, which run before this one, what share the rays take over."""
        frame.provide(TracedLobes(frame.settings.get(self, "roughness")))
        shown = lights.traceable(frame.emitters)
        points = frame.service(PointsDrawn)  # whole lights have one point, whatever their rate
        drawn = points.per_sample if points else {}
        rates = [drawn.get(e.light.key, rate_of(frame, e.light.key).per_sample) for e in shown]
        self._rows = [emitter.row(emitter.centre, 0, 0, rate, rate) for emitter, rate in zip(shown, rates)]
        sampled = frame.plan.runs("environment_light")
        self._world_samples = directions_rate(frame).per_sample if sampled else 0.0

    def sample(self, frame: Frame) -> Iterator[None]:
        roughness = frame.settings.get(self, "roughness")
        world = frame.snapshot.world
        hierarchy = frame.hierarchy()
        emissive = frame.service(EmissivePoints) or EmissivePoints()
        frame.account.note(self, {"triangles": hierarchy.triangles})
        bindings = {
            "textures": {
                "energy_table": frame.materials.energy_table,
                "environment_map": frame.environment.map, "environment_density_map": frame.environment.density_map,
                **hierarchy.textures,
            },
            "blocks": {"world_light": frame.environment.block},
            "constants": {
                "light_count": len(self._rows), "traced_roughness": roughness,
                "offset_size": frame.offset_size,
                "world_glossy": int(bool(np.any(world.color)) and world.visibility.glossy),
                "world_samples": self._world_samples,
                "emissive_power": emissive.power, "emissive_points": emissive.count,
                "emissive_level": frame.shared(EmissiveLevel).value,
                "shaded_roughness": shaded_roughness(frame),
                "glass_bends": int(refracts(frame)),
            },
        }  # fmt: skip
        program = asked(frame, TRACED, bindings["textures"])
        program = linked.linked(frame, self, program, self._rows, bindings["textures"])
        yield from repeated_light.add(frame, self, self._sources, Lit(program, NARROW_LOBE, bindings, self._rows))
        frame.count(self, "passes")

    def release(self) -> None:
        self._sources.release()


def _has_extent(light) -> bool:
    if not np.any(light.strength) or not light.visibility.glossy:
        return False
    return light.kind == "AREA" or (light.angle if light.kind == "SUN" else light.radius) > 0
