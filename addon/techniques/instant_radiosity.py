"""Instant radiosity: indirect light by virtual lights and traced visibility. Converges to the truth.

Indirect light at x is the integral over surfaces y of f(x) L(y) G(x, y) V(x, y), G = cos_x cos_y / d^2. Virtual lights
(virtual_lights.py; Keller 1997) are points of this integral, shared by all pixels; alone they leave bright blots in
corners, where G has no bound. So the integral is split by a share s(d) = min(1, d^2 / r^2):

    L_ind(x) = sum over virtual lights of  f L/n G s V   +   mean over rays of  f pi / cos * (1 - s) L(y)

The first kernel is bounded by cos_x cos_y / r^2. The second needs rays of length r only (bias compensation, Kollig &
Keller 2004). Both shares add to one at every distance: nothing is counted twice, nothing is lost. L at the end of a ray
is estimated on the spot: light sources by one traced point, the virtual lights by one of them, and what is nearer than
r to that point by another short ray. r is a fifth of the median distance of what is seen; in drafts and pictures of few
samples it shrinks with the spacing of the virtual lights.

Each pixel evaluates every second virtual light, in a chequered pattern that changes with each sample, and traces `rays`
of them, drawn in proportion to what they would bring: noise comes from visibility alone. Pixels choose all lights
before they trace, so that neighbouring rays run together. Glossy surfaces trace a ray of their lobe, metals LOBE_RAYS
of them; sheen, toon and translucent lobes one of the cosine's density. Where a material is smooth metal, rays have no
bound: what metal mirrors of other surfaces comes along them alone, followed over up to `bounces` mirrors.

| cost | per sample |
|---|---|
| virtual lights | see virtual_lights.py: 2112 candidates, `virtual_lights` kept |
| rays per pixel | `rays` + 1 short one, + 2 for a surface within r and, in every other sample, for each after it |
| of glossy surfaces | + 1 to 3, on metal + 4 to 12 |
| arithmetic per pixel | 1 kernel for every other virtual light, and one 32nd of that again for each ray |

Bias (diffuse and glossy indirect light): that of virtual_lights.py; near corners the last bounces before the limit may
be counted once more than allowed. Fails: grain in few samples where virtual lights are partly hidden; caustics are
spread as by roughness 0.5 or more; no indirect light above 4 million triangles (docs/log/2026-11-26-indirect-light.md).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np

from ..film.neighbours import smooth
from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.shares import clamped, plans_samples
from ..frame.technique import Param, Service, Technique, Write
from ..gfx import images, passes
from ..gfx.context import to_hold
from ..gfx.library import Program
from ..lighting.asked import asked, lit_at_hits
from ..lighting.caustic_casters import Answered
from ..lighting.path_sources import shaded_roughness
from ..lighting.virtual_lights import (
    PATH_BLOCKS,
    PATH_CONSTANTS,
    PATH_TEXTURES,
    TRACED,
    VirtualLights,
    VirtualLightSet,
    near_radius,
)
from ..materials.compiler import may_emit, may_reflect
from ..materials.graph import Graph
from ..sampling.interleaved import Interleaving, interleaving
from ..scene import acceleration
from ..snapshot.scene import Snapshot
from ..surfaces.draw import ANY_SURFACE, LIT_SURFACES, MARKS
from ..surfaces.reflectance import Reflectance

DEEPER = 2  # samples, one of which looks for light that close surfaces reflect to each other again and again
DEEPER_ORDER = (0, 0, 1, 1, 1, 1, 0, 0)  # which of each two: of 16, all numbers of the sequence in each quarter twice
SUBSETS = 2  # of the virtual lights, of which each pixel looks at one
SEVERAL = 2  # samples, from which on Denoise runs, and rays of pixels look farther
FARTHER = 0.2  # median distances of what is seen: their reach then
MORE_RAYS = 4  # times, in a picture of one sample
FEWEST_LIGHTS = 64  # of a light group's, where several share out the pixels
LOBE_RAYS = 4  # of a pixel in a sample, where a glossy lobe is most of what is seen
GATHER_TEXTURES = (("RGBA32F", "virtual_lights"), *PATH_TEXTURES)
NEAR_CONSTANTS = (
    ("INT", "bounces"), ("INT", "virtual_count"), ("FLOAT", "near_radius"), ("FLOAT", "glossy_radius"),
    ("FLOAT", "deeper"), ("VEC3", "mirrors_low"), ("VEC3", "mirrors_high"),
)  # fmt: skip
NOTHING_NEAR = {name: (0.0, 0.0, 0.0) if kind == "VEC3" else 0 for kind, name in NEAR_CONSTANTS}  # no light, no bounce
LOBE_CONSTANTS = (("INT", "lobe_rays"), ("INT", "photons_shine"))
GATHER_CONSTANTS = (
    *dict.fromkeys((*PATH_CONSTANTS, *NEAR_CONSTANTS)),
    *LOBE_CONSTANTS,
    ("FLOAT", "shaded_roughness"),
)


@dataclass(frozen=True)
class GatherBindings(Service):
    """Virtual lights of this sample that others may gather, too: bindings with that texture and NEAR_CONSTANTS."""

    name = "virtual_lights"
    bindings: dict[str, dict]


RECTANGLE = (("IVEC2", "rectangle"), ("IVEC2", "place_within"))
SPREAD = passes.fullscreen_program(
    "light of interleaved pixels",
    "indirect/interleaved.frag.glsl",
    textures=(("RGBA32F", "gathered_diffuse"), ("RGBA32F", "gathered_glossy")),
    constants=(*RECTANGLE, ("FLOAT", "weight")),
    outputs=(("VEC4", "out_diffuse"), ("VEC4", "out_glossy")),
)


@cache
def gather_program(interleaved: bool = False) -> Program:
    """Virtual lights at pixels; `interleaved`: at one pixel of each rectangle."""
    return passes.fullscreen_program(
        "instant radiosity",
        "indirect/gather.frag.glsl",
        textures=GATHER_TEXTURES,
        blocks=PATH_BLOCKS,
        constants=(*GATHER_CONSTANTS, *TRACED.constants, *(RECTANGLE if interleaved else ())),
        defines=(("SUBSETS", str(SUBSETS)), *((("INTERLEAVED", "1"),) if interleaved else ())),
        outputs=(("VEC4", "out_diffuse"),),
        leaves_out=(("leaving", "pixels gather virtual lights and look at no surface that sends light"),),
    )


@cache
def near_program(kinds: int, glossy: bool, soft: bool, interleaved: bool = False, shared: bool = False) -> Program:
    """Rays of pixels, for light sources of these kinds (bits as in lights.LAMPS), and surfaces that may be glossy, or
    have a lobe of lib/soft_lobe.glsl. `shared`: with the light of virtual lights that regions have gathered."""
    lobes = (("GLOSSY", glossy), ("SOFT", soft), ("INTERLEAVED", interleaved), ("SHARED", shared))
    return passes.fullscreen_program(
        "instant radiosity of regions" if shared else "instant radiosity, rays",
        "indirect/near.frag.glsl",
        textures=(*GATHER_TEXTURES, *((("RGBA32F", "shared_irradiance"),) if shared else ())),
        blocks=PATH_BLOCKS,
        constants=(
            *GATHER_CONSTANTS, *(RECTANGLE if interleaved else ()), *((("IVEC2", "grid_offset"),) if shared else ()),
        ),
        # Drivers that mask instead of branching would compute what a scene does not need.
        defines=(("LIGHT_KINDS", str(kinds)), *((name, "1") for name, needed in lobes if needed)),
        outputs=(("VEC4", "out_diffuse"), ("VEC4", "out_glossy")),
    )  # fmt: skip


def lobes_of(frame: Frame) -> tuple[bool, bool]:
    """Which lobes the frame's programs gather for: of microfacets, and those of lib/soft_lobe.glsl."""
    return to_hold((frame.materials.glossy, frame.materials.soft), (True, True))


GATHERS = (
    *(gather_program(interleaved) for interleaved in (False, True)),
    near_program(-1, True, True), near_program(0, False, False), near_program(-1, True, True, interleaved=True),
)  # fmt: skip
INDIRECT_WRITES = (
    Write("radiance.diffuse_indirect", "RGBA32F", "Light that diffuse surfaces receive from other surfaces", True),
    Write("radiance.glossy_indirect", "RGBA32F", "Light that glossy surfaces receive from other surfaces", True),
)


def no_indirect_light(snapshot: Snapshot, settings: Settings) -> str | None:
    """Why the picture has no indirect light, as a sentence; None if it has. For every technique of the slot."""
    if settings.bounces == 0:
        return "the scene's bounces are set to 0"
    if not snapshot.instances:
        return "the scene has no surface"
    if not any(may_reflect(graph) for graph in _used(snapshot)):
        return "no material reflects light"
    return no_diffuse_light(snapshot)


def no_diffuse_light(snapshot: Snapshot) -> str | None:
    """Why nothing lights diffuse surfaces, as a sentence; None if something does."""
    lit = any(np.any(light.strength) and light.visibility.diffuse for light in snapshot.lights)
    lit = lit or (np.any(snapshot.world.color) and snapshot.world.visibility.diffuse)
    if not lit and not any(may_emit(graph) for graph in _used(snapshot)):
        return "no light reaches any surface"
    return None


def _used(snapshot: Snapshot) -> list[Graph]:
    return [snapshot.materials[m].graph for m in snapshot.used_materials]


def gather_bindings(frame: Frame, finder: VirtualLights, lights: VirtualLightSet, **constants) -> dict[str, dict]:
    """What shaders/indirect/near.glsl needs: textures, blocks and constants of this sample, with these `constants` of
    the technique. Provides it to others; what is returned is the caller's own."""
    bindings = finder.path_bindings(frame)
    bindings["textures"]["virtual_lights"] = lights.image
    near = near_radius(frame, lights.wanted)
    bindings["constants"] |= {"virtual_count": len(lights), "near_radius": near, "glossy_radius": near}
    bindings["constants"] |= {
        "deeper": deeper_weight(frame),
        **dict(zip(("mirrors_low", "mirrors_high"), frame.kept(Reflectance).mirrors_box)),
        "lobe_rays": 1 if frame.settings.schedule.is_draft else LOBE_RAYS,
        "photons_shine": frame.shared(Answered).photons_shine,
    }
    bindings["constants"] |= {"shaded_roughness": shaded_roughness(frame), **constants}
    frame.provide(GatherBindings(bindings))
    return {kind: dict(bound) for kind, bound in bindings.items()}


def deeper_weight(frame: Frame) -> float:
    """Weight in this sample of light that was reflected more than once between close surfaces (near.frag.glsl).

    One of DEEPER samples has it, not always the first of them, whose numbers all lie in one half (sequence.py).
    Pictures of few samples, and those that are shown while they grow, have it in each.
    """
    samples = frame.settings.samples
    if not frame.settings.schedule.known_total or samples < 4 * DEEPER or samples % DEEPER:
        return 1.0
    chosen = DEEPER_ORDER[frame.sample // DEEPER % len(DEEPER_ORDER)]
    return float(DEEPER) if frame.sample % DEEPER == chosen else 0.0


def _deeper_turn(number: int, count: int) -> float:
    """The same weight, where only `count` samples have a turn: both halves of the picture have as many of them."""
    if count % (2 * DEEPER):
        return 1.0
    return float(DEEPER) if number % DEEPER == DEEPER_ORDER[number // DEEPER % len(DEEPER_ORDER)] else 0.0


class InstantRadiosity(Technique):
    name = "instant_radiosity"
    label = "Instant radiosity"
    fills = ("indirect",)
    params = (
        Param(
            "virtual_lights", "Virtual lights", 512,
            "Virtual lights in each sample; a pixel evaluates every second one",
            1, 1024, draft=64,
        ),
        Param(
            "rays", "Rays", 2,
            "Shadow rays to virtual lights per pixel and sample; pictures of few samples use up to four times as many",
            1, 64, draft=1,
        ),
    )  # fmt: skip
    reads = LIT_SURFACES
    writes = INDIRECT_WRITES
    provides = (GatherBindings,)

    def __init__(self):
        self.virtual_lights = VirtualLights()
        self._interleaving: Interleaving | None = None

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        return no_indirect_light(snapshot, settings) or acceleration.too_many(snapshot)

    def begin(self, frame: Frame) -> None:
        self.virtual_lights.begin(frame)
        settings = frame.settings
        shared = plans_samples(frame) and not clamped(frame)
        self._interleaving = interleaving(settings.takes, settings.samples, settings.take) if shared else None
        if self._interleaving is not None:
            why = f"in one of {self._interleaving.count} pixels, because {settings.takes} light groups are added up"
            frame.account.chose(self, "its light", why)

    def sample(self, frame: Frame) -> Iterator[None]:
        if frame.receivers is None or not len(frame.receivers.distance):
            return
        wanted = frame.settings.get(self, "virtual_lights")
        part = self._interleaving if self._interleaving and self._interleaving.is_part(frame.sample) else None
        if part is not None:  # those of all groups together are as many as a picture has
            wanted = max(wanted // part.count, min(wanted, FEWEST_LIGHTS))
        lights = yield from self.virtual_lights.make(frame, self, wanted)
        reach = self._reach(frame, -(-lights.wanted // SUBSETS))
        bindings = gather_bindings(frame, self.virtual_lights, lights, **reach)
        if self._interleaving is not None:  # turns are those of each pixel; what has no block looks in each sample
            deeper = _deeper_turn(part.visit(frame.sample), part.visits) if part is not None else 1.0
            bindings["constants"]["deeper"] = deeper
        yield
        if part is None:
            target = frame.target(*(write.name for write in INDIRECT_WRITES), depth=MARKS)
            yield from self._draw(frame, bindings, target, where=ANY_SURFACE)
        else:
            yield from self._draw_part(frame, part, bindings)
        smooth(frame, self, "radiance.diffuse_indirect")
        frame.count(self, "passes", 2)

    def _draw(
        self, frame: Frame, bindings: dict, target: images.Target, part: Interleaving | None = None, **drawing
    ) -> Iterator[None]:
        """Virtual lights, then rays, of each band of rows, of all pixels or of a `part`."""
        lights = {kind: dict(bound) for kind, bound in bindings.items()}
        lights["constants"]["rays"] = self._rays(frame)
        gather = asked(frame, gather_program(part is not None), lights["textures"])
        near = near_program(self.virtual_lights.kinds, *lobes_of(frame), part is not None)
        near = lit_at_hits(frame, near, bindings["textures"])
        diffuse = images.Target(target.colors[:1], target.depth)
        for first, end in frame.bands(self):
            rows = (-(-first // part.rows), -(-end // part.rows)) if part else (first, end)
            for program, into, bound in ((gather, diffuse, lights), (near, target, bindings)):
                if rows[0] < rows[1]:
                    passes.fullscreen(program, into, blend="ADDITIVE_PREMULT", rows=rows, **bound, **drawing)
                yield

    def _draw_part(self, frame: Frame, part: Interleaving, bindings: dict) -> Iterator[None]:
        """Draw one pixel of each rectangle, in an image of these alone: processors skip groups of pixels, but no
        single ones."""
        place = {"rectangle": (part.columns, part.rows), "place_within": part.place(frame.sample)}
        bindings = {**bindings, "constants": {**bindings["constants"], **place}}
        size = part.size(*frame.size)
        with images.borrowed(*size, "RGBA32F") as diffuse, images.borrowed(*size, "RGBA32F") as glossy:
            drawn = images.Target((*diffuse.colors, *glossy.colors))
            drawn.clear()
            yield from self._draw(frame, bindings, drawn, part)
            passes.fullscreen(
                SPREAD, frame.target(*(write.name for write in INDIRECT_WRITES)), blend="ADDITIVE_PREMULT",
                textures=dict(zip(("gathered_diffuse", "gathered_glossy"), drawn.colors)),
                constants={**place, "weight": float(part.count)},
            )  # fmt: skip

    def _rays(self, frame: Frame) -> int:
        """Noise of the choice is that of the pixel alone, and averages out over samples while that of the virtual
        lights, which all pixels share, is still there."""
        rays, settings = frame.settings.get(self, "rays"), frame.settings
        return rays if settings.schedule.is_draft else max(rays, -(-MORE_RAYS * rays // settings.samples))

    def _reach(self, frame: Frame, count: int) -> dict[str, float]:
        """Up to where rays look for light, m: those of all pixels, and those behind glossy lobes. What they find is
        grain, which a mean over neighbours takes out; what virtual lights leave is not."""
        near = near_radius(frame, count)
        several = frame.settings.samples >= SEVERAL and not frame.settings.schedule.is_draft
        far = FARTHER * frame.typical_distance
        return {"near_radius": far if several else near, "glossy_radius": near}

    def release(self) -> None:
        self.virtual_lights.release()
