"""Virtual lights: points on surfaces that light the picture with the radiance they reflect, for any gatherer.

Candidates are found from the picture, as in bidirectional instant radiosity (Segovia 2006): at P points of what it
shows, in cells of space ("probes", probes.py), R cosine-distributed rays start; where one meets a surface, at y, is a
candidate. It has the direct light that y reflects, and what a path on from y finds in up to `bounces` reflections:

    L(y) = rho / pi * (E(y) + sum over further bounces of their albedos x E there)

From its second reflection on a path ends by Russian roulette. GROUP neighbouring candidates that face alike share the
next vertices of their paths, weighted by the balance heuristic (path reuse, Bekaert et al. 2002). Any probe could
have found y, so the density of candidates is the sum over all probes x:

    n(y) = sum over x of  R cos_x cos_y V(x, y) / (pi |x - y|^2)      per m2

A candidate has the intensity L / n. `count` of them are kept by systematic resampling in proportion to L, cell by
cell along a space-filling curve (after Georgiev & Slusallek 2010), so that one candidate more or less changes only
what is kept nearby. Densities are traced for those kept alone. Surfaces have the picture's colours where the camera
sees them, else their material's mean (reflectance.py), and a lobe of microfacets towards the probe that found them
(of smooth metal for direct light alone, near.glsl).

| cost | per sample, with P = 192 probes and N virtual lights |
|---|---|
| candidates, rays | max(1152, 4 N); 2 per bounce (3 if meshes emit) + 19 for each, then 192 for each light |
| passes, readbacks | 24, most over the candidates or a grid of pixels alone (light_choice.py, probes.py); none |

Bias (diffuse and glossy indirect light): what brings less than half a hundredth of the light is missed where no probe
comes near. A virtual light for the area A in one of n samples is clamped at sqrt(A / (pi n)); the loss falls with n.
Points on emissive triangles are clamped likewise, and short rays bring the rest (emission_close_by in path.glsl). Gloss
is spread evenly. Normals are the triangles', but for direct light. Figures: docs/log/2026-11-26-indirect-light.md.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, field
from functools import cache, cached_property

import numpy as np

from ..frame.picture import Frame
from ..gfx import images, passes
from ..gfx.context import to_hold
from ..gfx.library import Program
from ..gfx.struct import Block
from ..kernels import ordered_lists
from ..materials.compiler import may_emit
from ..scene import acceleration
from ..scene.view import VIEW
from ..sources import lights
from ..surfaces.draw import SURFACE_TEXTURES, surface_bindings
from ..surfaces.reflectance import Reflectance
from . import probes
from .asked import lit_at_hits
from .caustic_casters import answered, bright_world, meshes_answered
from .emissive_triangles import EmissiveTriangles
from .light_choice import GROUP, Choice, seen_middle
from .media import MediaService

PROBES, DRAFT_PROBES = (16, 12), (12, 8)
LEAST_RAYS, DRAFT_RAYS = 6, 3  # per probe
CHOICE = 4  # candidates at least, for each virtual light that is kept
NEAR = 0.1  # the bound of 128 virtual lights, in median distances of what is seen
LAMP_POINTS = 16  # on all lamps, which the paths of a sample look for
OTHER_POINTS = (32, 24)  # of emissive surfaces and of the world: of one of them, or of each of both
ONLY_POINTS = lights.MOST_LIGHTS - LAMP_POINTS  # of one of them in the only sample of a picture

PATH_TEXTURES = (
    *acceleration.HIERARCHY_TEXTURES, *SURFACE_TEXTURES, ("RGBA32F", "energy_table"), ("RGBA32F", "reflectance"),
)  # fmt: skip
PATH_BLOCKS = ((VIEW, "film_view"), (lights.SOURCES, "sources"))
PATH_CONSTANTS = (
    ("INT", "light_count"), ("FLOAT", "offset_size"), ("INT", "bounces"),
)  # fmt: skip
RAYS = (("INT", "rays"),)  # of each probe


# Of each candidate: its place; its normal; radiance of what its own path alone says, w: luminance of the part that was
# reflected at least once less than allowed; diffuse albedo, w: that luminance of what comes from the next surface; the
# place of that; what comes from there. Two numbers of the next surface's normal stand in w of normal and next_radiance,
# the third one's sign in w of next_point: a framebuffer has six images at most.
FOUND = ("point", "normal", "radiance", "albedo", "next_point", "next_radiance")


@cache
def candidates_program(kinds: int) -> Program:
    """For sources of these kinds (bits as in lights.LAMPS)."""
    return passes.fullscreen_program(
        "virtual light candidates",
        "indirect/candidates.frag.glsl",
        textures=(*PATH_TEXTURES, *probes.TEXTURES),
        blocks=PATH_BLOCKS,
        constants=(*PATH_CONSTANTS, *RAYS),
        defines=(("LIGHT_KINDS", str(kinds)),),
        outputs=tuple(("VEC4", f"out_{name}") for name in FOUND),
    )


CANDIDATES = tuple(candidates_program(kinds) for kinds in (-1, 0))
DENSITY = passes.fullscreen_program(
    "virtual light density",
    "indirect/density.frag.glsl",
    textures=(
        *acceleration.HIERARCHY_TEXTURES, *probes.TEXTURES, ("RGBA32F", "candidate_point"),
        ("RGBA32F", "candidate_normal"), ("RGBA32F", "slots"),
    ),
    blocks=((VIEW, "film_view"),),
    constants=(("FLOAT", "offset_size"), *RAYS),
    outputs=(("FLOAT", "out_density"),),
)  # fmt: skip
PAIRS = passes.fullscreen_program(
    "virtual light pairs",
    "indirect/pairs.frag.glsl",
    textures=(
        *PATH_TEXTURES, ("RGBA32F", "candidate_point"), ("RGBA32F", "candidate_normal"), ("RGBA32F", "next_point"),
        ("RGBA32F", "next_radiance"), ("R32UI", "sorted_order"),
    ),
    blocks=PATH_BLOCKS,
    constants=(*PATH_CONSTANTS, ("INT", "rays"), ("INT", "candidate_count")),
    defines=(*ordered_lists.DEFINES, ("GROUP", str(GROUP))),
    outputs=(("FLOAT", "out_density"),),
    leaves_out=(("leaving", "densities ask for no light"),),
)  # fmt: skip

LIGHTS = passes.fullscreen_program(
    "virtual lights",
    "indirect/choice_lights.frag.glsl",
    textures=(
        ("RGBA32F", "slots"), ("RGBA32F", "candidate_point"), ("RGBA32F", "candidate_normal"),
        ("RGBA32F", "radiances"), ("R32F", "densities"),
    ),
    constants=(
        ("INT", "rays"), ("INT", "candidate_count"), ("VEC4", "seen_middle"), ("INT", "probe_count"),
        ("FLOAT", "total_samples"),
    ),
    defines=ordered_lists.DEFINES,
    outputs=(("VEC4", "out_light"),),
)  # fmt: skip


@dataclass(frozen=True)
class Gather:
    """GLSL file with `vec3 virtual_gather(Surface, vec3 to_viewer, bool reflected, vec3 origin, float u, uint salt)`,
    the light by all virtual lights and what hides them, and what else it binds."""

    name: str
    file: str
    textures: tuple[tuple[str, str], ...] = ()
    constants: tuple[tuple[str, str], ...] = ()
    defines: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class BoundGather:
    """A way to gather with what it binds for the virtual lights of a sample."""

    gather: Gather
    textures: dict[str, images.Image] = field(default_factory=dict)
    constants: dict[str, object] = field(default_factory=dict)


TRACED = Gather("rays", "indirect/traced_gather.glsl", constants=(("INT", "rays"),))


@dataclass
class VirtualLightSet:
    """The virtual lights of one sample: the image that shaders/indirect/lights.glsl reads, a column each. Some of them
    at the end have no light."""

    image: images.Image
    wanted: int

    def __len__(self) -> int:
        """Columns."""
        return self.image.width

    @cached_property
    def rows(self) -> np.ndarray:
        """(3, N, 4) those with light, as they stand in the image. Waits for the GPU."""
        found = images.read(self.image).astype(np.float64)
        return found[:, found[0, :, 3] > 0]


class VirtualLights:
    """Finds the virtual lights of each sample. A technique owns one, calls `begin`, then `make` in each sample,
    and binds `path_bindings`."""

    def __init__(self):
        self._sources = lights.Sources()
        self._source_block: Block | None = None
        self._source_count = 0
        self._emissive: EmissiveTriangles | None = None
        self._image: images.Image | None = None
        self.kinds = 0  # of the sources, as bits

    def make(self, frame: Frame, technique, count: int) -> Generator[None, None, VirtualLightSet]:
        """About `count` virtual lights for this sample, in parts. Counts rays in the technique's ledger row."""
        self.draw_sources(frame)
        grid = Grid.of(frame, count)
        candidates = grid.count * grid.rays
        choice = Choice(grid.rays, candidates, seen_middle(frame))
        views = probes.find(frame, grid.probes, self.path_bindings(frame))
        held = [*views.values()]
        try:
            yield  # what finds probes and what traces from them are several programs each
            found = self._candidates(frame, grid, views)
            held += found.values()
            yield
            order = choice.order(found["candidate_point"], found["candidate_normal"])
            yield
            pairs = None
            if frame.settings.bounces > 1 and not frame.settings.schedule.is_draft:
                pairs = self._pairs(frame, grid, found, order)
                held.append(pairs)
                yield
            radiances = choice.radiances(found, pairs, frame.service(MediaService))
            slots, kept_before = choice.keep(count, frame.random("virtual lights/keep")[0])
            yield
            densities = self._densities(frame, grid, views, found, slots)
            held.append(densities)
            yield
            self._make_image(frame, grid, {**found, "slots": slots, "radiances": radiances, "densities": densities})
            frame.account.count_texel(technique, "virtual lights", kept_before, at=choice.last)
            frame.account.count_texel(technique, "density rays", kept_before, grid.count, at=choice.last)
        finally:
            for image in held:
                images.pool.give(image)
            choice.release()
        bounces = frame.settings.bounces
        close_by = (1 + bounces) * (self._emissive is not None)  # short ones, at each surface
        frame.count(technique, "path rays", candidates * (4 + 2 * bounces + close_by))
        return VirtualLightSet(self._image, count)

    def _make_image(self, frame: Frame, grid: Grid, textures: dict[str, images.Image]) -> None:
        size = textures["slots"].width, 3
        if self._image is None or self._image.size != size:
            self._give()
            self._image = images.pool.take(*size, "RGBA32F")
        passes.fullscreen(
            LIGHTS, images.Target((self._image,)),
            textures={name: textures[name] for _, name in LIGHTS.textures},
            constants={
                "rays": grid.rays, "candidate_count": grid.count * grid.rays, "seen_middle": (0.0, 0.0, 0.0, 0.0),
                "probe_count": grid.count, "total_samples": float(frame.settings.samples),
            },
        )  # fmt: skip

    def draw_sources(self, frame: Frame) -> None:
        """Points on light sources for this sample's paths, and what materials reflect: what `path_bindings` needs."""
        rows = self._source_rows(frame)
        self._source_block, self._source_count = self._sources.set(rows), len(rows)

    def path_bindings(self, frame: Frame) -> dict:
        """What shaders/indirect/path.glsl needs: textures, blocks and constants of this sample."""
        hierarchy, reflectance = frame.hierarchy("diffuse"), frame.kept(Reflectance)
        if hierarchy.has_sheets or reflectance.mirrors_glass:
            bright, seen = bright_world(frame), frame.snapshot.world.visibility.diffuse
            reflectance.show_sky(frame.environment, (bright.threshold if bright else np.inf) if seen else -1.0)
        return {
            "textures": {
                **surface_bindings(frame), "energy_table": frame.materials.energy_table,
                **hierarchy.textures, "reflectance": reflectance.image,
            },
            "blocks": {"film_view": frame.view_block, "sources": self._source_block},
            "constants": {
                "light_count": self._source_count, "offset_size": frame.offset_size,
                "bounces": frame.settings.bounces,
            },
        }  # fmt: skip

    def begin(self, frame: Frame) -> None:
        """Find the light sources of this picture and what its materials reflect. Called in the stage of that name."""
        frame.kept(Reflectance).update(frame)
        emitters = frame.emitters
        self._emitters = [e for e in emitters if e.light.bounces and e.light.visibility.diffuse]
        self._emissive = None
        used = frame.snapshot.used_materials
        if any(may_emit(frame.snapshot.materials[slot].graph) for slot in used):
            triangles = EmissiveTriangles(frame, ("diffuse",))
            self._emissive = triangles if triangles.power > 0 else None
        self._world = frame.environment.power > 0 and frame.snapshot.world.visibility.diffuse
        others = (self._emissive is not None) << lights.SURFACE | bool(self._world) << lights.DIRECTION
        self.kinds = to_hold(lights.kinds_of(self._emitters) | others, -1)

    def _source_rows(self, frame: Frame) -> list[np.ndarray]:
        """Points of this sample on lights, emissive surfaces and the world."""
        rows = self._light_rows(frame, LAMP_POINTS) if self._emitters else []
        seen = lights.SHADOW_FLAG + lights.DIFFUSE_FLAG
        both = self._emissive is not None and bool(self._world)
        is_only = frame.settings.schedule.known_total and frame.settings.samples == 1
        share = ONLY_POINTS if is_only and not both else OTHER_POINTS[both]
        total = share * frame.settings.samples
        numbers = range(frame.sample * share, (frame.sample + 1) * share)
        if self._emissive is not None:
            flags = lights.SHADOW_FLAG + lights.GLASS_BLOCKS_FLAG * meshes_answered(frame)
            for index in numbers:
                drawn = frame.random_volume("virtual lights/emissive", index)
                rows.append(self._emissive.row(drawn, share, flags, samples=total / share, at_hits=True))
        if self._world:
            chosen = np.array([frame.random("virtual lights/world", index) for index in numbers])
            bright = bright_world(frame)
            # What the camera's places see is another thing in each frame: all directions would move with it.
            for direction, radiance, density in zip(*frame.environment.draw(*chosen.T, frame.environment.is_shut_out)):
                blocked = lights.GLASS_BLOCKS_FLAG * (bright is not None and bright.holds(radiance))
                light = radiance / (density * share)
                rows.append(lights.direction_row(direction, light, density, seen + blocked, 0, 1))
        return rows

    def _light_rows(self, frame: Frame, share: int) -> list[np.ndarray]:
        """`share` points in all; several on each light, or one on each of some, drawn in proportion to power."""
        chosen = [(emitter, 1.0) for emitter in self._emitters]
        if len(chosen) > share:
            power = np.array([emitter.power for emitter in self._emitters])
            chance = np.minimum(share * (0.8 * power / max(power.sum(), 1e-300) + 0.2 / len(power)), 1.0)
            edges = np.concatenate([[0.0], np.cumsum(chance)])
            marks = np.arange(share) + frame.uniform("virtual lights/choose")
            picked = np.unique(np.searchsorted(edges, marks[marks < edges[-1]], side="right") - 1)
            chosen = [(self._emitters[k], 1.0 / chance[k]) for k in picked]
        each = max(share // max(len(chosen), 1), 1)
        rows = []
        for emitter, weight in chosen:
            # A light without extent is one point however often it is drawn.
            points = each if emitter.has_span or emitter.radius > 0 else 1
            narrow = emitter.is_narrow(frame.receivers)
            for k in range(points):
                drawn = frame.random_volume("virtual lights/light", frame.sample * points + k)
                sample = emitter.narrow_sample(*drawn[:2]) if narrow else emitter.sample(*drawn)
                total = points * frame.settings.samples / weight
                shadowed = int(emitter.light.cast_shadow)
                row = emitter.row(sample, 0, shadowed, weight / points, points=total)
                row[lights.LIGHT.at.flags] += lights.NARROW_FLAG * narrow
                row[lights.LIGHT.at.flags] += lights.GLASS_BLOCKS_FLAG * answered(frame, emitter)
                row[lights.LIGHT.at.first_view] = lights.passing_bits(emitter.light.links.passing)
                rows.append(row)
        return rows

    def _candidates(self, frame: Frame, grid: Grid, views: dict[str, images.Image]) -> dict[str, images.Image]:
        """Images of the pool by the names of FOUND, a row per probe."""
        size = (grid.rays, grid.count)
        found = images.Target(tuple(images.pool.take(*size, "RGBA32F") for _ in FOUND))
        bindings = self.path_bindings(frame)
        bindings["constants"]["rays"] = grid.rays
        bindings["textures"] |= views
        program = lit_at_hits(frame, candidates_program(self.kinds), bindings["textures"])
        passes.fullscreen(program, found, **bindings)
        return {name if "next" in name else f"candidate_{name}": image for name, image in zip(FOUND, found.colors)}

    def _pairs(self, frame: Frame, grid: Grid, found: dict[str, images.Image], order: images.Image) -> images.Image:
        """How densely each candidate of a group (row) draws directions to what each of them (column) met next."""
        bindings = self.path_bindings(frame)
        count = grid.count * grid.rays
        bindings["constants"] |= {"rays": grid.rays, "candidate_count": count}
        names = ("candidate_point", "candidate_normal", "next_point", "next_radiance")
        bindings["textures"] |= {name: found[name] for name in names} | {"sorted_order": order}
        pairs = images.pool.take(GROUP, order.width * order.height, "R32F")
        passes.fullscreen(PAIRS, images.Target((pairs,)), rows=(0, count), **bindings)
        return pairs

    def _densities(
        self,
        frame: Frame,
        grid: Grid,
        views: dict[str, images.Image],
        found: dict[str, images.Image],
        slots: images.Image,
    ) -> images.Image:
        """How many rays of each probe (row) fall on a square metre around each candidate that is kept (column)."""
        names = ("candidate_point", "candidate_normal")
        densities = images.pool.take(slots.width, grid.count, "R32F")
        passes.fullscreen(
            DENSITY, images.Target((densities,)),
            textures={
                **frame.hierarchy("diffuse").textures, **views, **{name: found[name] for name in names}, "slots": slots,
            },
            blocks={"film_view": frame.view_block},
            constants={"offset_size": frame.offset_size, "rays": grid.rays},
        )  # fmt: skip
        return densities

    def _give(self) -> None:
        if self._image is not None:
            images.pool.give(self._image)
        self._image = None

    def release(self) -> None:
        self._sources.release()
        self._source_block = self._emissive = None
        self._give()


@dataclass(frozen=True)
class Grid:
    """Where candidates are looked for: probes along each side of the picture, and rays of each."""

    probes: tuple[int, int]
    rays: int

    @classmethod
    def of(cls, frame: Frame, count: int) -> Grid:
        """For `count` virtual lights."""
        if frame.settings.schedule.is_draft:
            return cls(DRAFT_PROBES, DRAFT_RAYS)
        return cls(PROBES, max(LEAST_RAYS, -(-CHOICE * count // (PROBES[0] * PROBES[1]))))

    @property
    def count(self) -> int:
        """Of probes."""
        return self.probes[0] * self.probes[1]


def near_radius(frame: Frame, count: int) -> float:
    """Distance below which `count` virtual lights leave light to short rays, m: in proportion to their spacing."""
    return NEAR * float(np.sqrt(128 / max(count, 1)) * frame.typical_distance)
