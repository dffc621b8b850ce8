"""Multi-resolution instant radiosity: hundreds of virtual lights, gathered by regions of the picture instead of pixels.

Irradiance varies slowly over a surface, so that it is gathered once for each region of 1 x 1 to 2^L x 2^L pixels and
interpolated in between. A region may not hold a silhouette, a range of depths above 5 % or of normals above 0.4 per
axis (by min-max pyramids), nor the border of the picture, and neighbours differ by one level at most:

    S(q, l) = range(q, l) too large, or S of any of the 4 x 4 regions around q's quarter at level l - 1
    gathered: not S(q, l) and S(parent, l + 1)            (every pixel lies in exactly one such region)

From the coarsest level down, a region that a larger one covers interpolates its four coarser neighbours, weighted
bilinearly, by exp(-(distance off the plane / 2 % of the depth)^2) and (n . n')^8.

Virtual lights, their bound near surfaces, the short rays that give back what the bound takes, and glossy light are
those of instant_radiosity.py. A region serves many pixels, so it can evaluate and trace many more virtual lights: at
one sample the error is that of the set of virtual lights, which falls with their number. The grid shifts in every
sample.

Sources: Nichols & Wyman 2009 (multi-resolution splatting); Nichols, Shopf & Wyman 2009; Le Hoang Quyen 2014.

| cost | per sample |
|---|---|
| arithmetic | 2 kernels per region and virtual light; regions are 8 to 27 % of the pixels at 640 x 360 |
| rays | `rays` per region; 1 short one per pixel, + 2 for each surface within the bound; glossy surfaces as there |
| virtual lights | see virtual_lights.py: 4 candidates each, 192 rays each for the density |
| passes | 4 x `levels` + 2 |

Bias (diffuse indirect light): that of instant_radiosity.py; indirect shadows narrower than a region are blurred over
it; rough diffuse counts as Lambertian; without `near_bounces` light reflected more than once between surfaces closer
than the bound is missing. Fails: grass, hair and stochastic alpha split every region: the cost is then that of every
pixel. Auto takes it for pictures of one sample, up to 60 000 pixels. Figures: docs/log/2026-11-26-indirect-light.md.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from functools import cache

from ..film.neighbours import shown_alone, smooth
from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.technique import Param
from ..gfx import context, images, passes
from ..gfx.library import Program
from ..kernels import lists
from ..lighting.asked import asked, lit_at_hits
from ..lighting.virtual_lights import PATH_BLOCKS, PATH_CONSTANTS, TRACED, BoundGather, Gather, VirtualLightSet
from ..scene.view import VIEW
from ..snapshot.scene import Snapshot
from ..surfaces.draw import ANY_SURFACE, MARKS, surface_bindings
from .instant_radiosity import (
    GATHER_TEXTURES,
    InstantRadiosity,
    gather_bindings,
    lobes_of,
    near_program,
)

# From here on maps of clusters, which do not grow with the picture, cost less than rays of regions.
MANY_PIXELS = 60_000
DEPTH_STEP, NORMAL_STEP = 0.05, 0.4  # ranges within a region: share of its depth, and of each axis of unit normals
FARTHER = 3.0  # times as far as elsewhere rays of pixels look: their grain is filtered here, and blots of lights boil
LEVELS = Param(
    "levels", "Levels", 3, "Largest regions have 2^levels pixels a side; 0: gather light at every pixel", 0, 5
)
NEAR_BOUNCES = Param(
    "near_bounces", "Near bounces", True,
    "Follow light that close surfaces reflect to each other more than once; slower, brighter corners",
    draft=False,
)  # fmt: skip
BOUNDS_CONSTANTS = (
    ("IVEC2", "grid_offset"), ("FLOAT", "depth_scale"), ("FLOAT", "depth_step"), ("FLOAT", "normal_step"),
)  # fmt: skip
BOUNDS_OUTPUTS = (("VEC4", "out_low"), ("VEC4", "out_high"), ("VEC2", "out_flags"))
BOUNDS_FORMATS = ("RGBA32F", "RGBA32F", "RG32F")
FIRST_BOUNDS = passes.fullscreen_program(
    "region bounds of pixels",
    "indirect/region_bounds.frag.glsl",
    textures=(("RGBA32F", "surface_position"), ("RGBA32F", "surface_normal")),
    blocks=((VIEW, "film_view"),),
    constants=BOUNDS_CONSTANTS,
    outputs=BOUNDS_OUTPUTS,
    defines=(("PIXELS", ""),),
)
BOUNDS = passes.fullscreen_program(
    "region bounds",
    "indirect/region_bounds.frag.glsl",
    textures=tuple(("FLOAT_2D", f"finer_{name}") for name in ("low", "high", "flags")),
    blocks=((VIEW, "film_view"),),
    constants=BOUNDS_CONSTANTS,
    outputs=BOUNDS_OUTPUTS,
)


REGION_BITS = 14  # of each axis, in an entry
RUNS = (*lists.DEFINES, ("REGION_BITS", str(REGION_BITS)))
GRID = (("IVEC2", "grid_offset"), ("IVEC2", "atlas_size"))  # of what includes shaders/indirect/regions.glsl
LIST = Program(
    name="list of regions",
    compute="indirect/region_list.comp.glsl",
    textures=(("RGBA32F", "surface_position"), ("FLOAT_2D", "region_flags"), ("FLOAT_2D", "coarser_flags")),
    images=lists.FILLED,
    constants=(*GRID, ("INT", "level"), ("INT", "levels")),
    defines=RUNS,
)


def _fill(name: str, textures: tuple[str, ...], defines=()) -> Program:
    return passes.fullscreen_program(
        name,
        "indirect/region_fill.frag.glsl",
        textures=tuple(
            ("FLOAT_2D", texture)
            for texture in ("surface_position", "surface_normal", "gathered", "region_flags", *textures)
        ),
        blocks=((VIEW, "film_view"),),
        constants=(*GRID, ("INT", "level"), ("INT", "levels"), ("FLOAT", "depth_scale")),
        outputs=(("VEC4", "out_irradiance"),),
        defines=(*RUNS, *defines),
    )  # fmt: skip


PULL = _fill("split regions from finer ones", ("finer_flags", "finer_irradiance"), (("PULL", ""),))
FILL = _fill("regions from coarser ones", ("coarser_flags", "coarser_irradiance", "pulled"))


REGION_CONSTANTS = (*PATH_CONSTANTS, ("INT", "virtual_count"), ("FLOAT", "near_radius"))  # of GATHER_CONSTANTS


@cache
def regions(gather: Gather, listed: bool = True) -> Program:
    """The gather of regions, those of the list or those of one level, with what tells which lights are hidden."""
    if listed:
        textures, constants = lists.READ, (("INT", "columns"),)
    else:
        textures = (("FLOAT_2D", "region_flags"), ("FLOAT_2D", "coarser_flags"))
        constants = (("INT", "level"), ("INT", "levels"))
    return Program(
        name=f"regions{'' if listed else ' of a level'}, {gather.name}",
        compute="indirect/region_gather.comp.glsl",
        textures=(*GATHER_TEXTURES, *textures, *gather.textures),
        images=(("gathered", "RGBA32F", "FLOAT_2D", "WRITE"),),
        blocks=PATH_BLOCKS,
        constants=(*REGION_CONSTANTS, *GRID, ("INT", "first_row"), *constants, *gather.constants),
        snippets=(("generated/gather", f'#include "{gather.file}"\n'),),
        defines=(*RUNS, *gather.defines, *(() if listed else (("BY_LEVEL", ""),))),
        group=(lists.RUN, 1, 1),
        leaves_out=(("leaving", "regions gather virtual lights and look at no surface that sends light"),),
    )


TRACED_REGIONS = regions(TRACED)


GATHERS_SHARED = near_program(-1, True, True, shared=True), near_program(0, False, False, shared=True)


def pixels_shown_alone(snapshot: Snapshot, settings: Settings) -> int:
    """How many pixels a picture of one sample has; 0 if more samples follow, or if it is a draft."""
    width, height = snapshot.film.border_size
    return width * height if settings.samples == 1 and not settings.schedule.is_draft else 0


class MultiresRadiosity(InstantRadiosity):
    name = "multires_radiosity"
    label = "Multi-resolution radiosity"
    params = (
        Param("virtual_lights", "Virtual lights", 1024, "Virtual lights in each sample", 1, 2048, draft=128),
        Param(
            "rays", "Rays", 64,
            "Shadow rays to virtual lights per region and sample; 0: no shadows of indirect light",
            0, 1024, draft=8,
        ),
        LEVELS,
        NEAR_BOUNCES,
    )  # fmt: skip

    def claims(self, snapshot: Snapshot, settings: Settings) -> bool:
        return 0 < pixels_shown_alone(snapshot, settings) < MANY_PIXELS

    def sample(self, frame: Frame) -> Iterator[None]:
        if frame.receivers is None or not len(frame.receivers.distance):
            return
        levels = fitting_levels(frame.size, frame.settings.get(self, "levels"))
        offset = tuple(int(u * (1 << levels)) for u in frame.random("regions"))
        scale = frame.typical_distance
        lights = yield from self.virtual_lights.make(frame, self, frame.settings.get(self, "virtual_lights"))
        bindings = gather_bindings(frame, self.virtual_lights, lights)
        if shown_alone(frame):
            bindings["constants"]["near_radius"] *= FARTHER
        if not frame.settings.get(self, "near_bounces"):
            bindings["constants"]["deeper"] = -1.0  # but over mirrors
        yield
        bound = self.visibility(frame, lights)
        yield
        irradiance = yield from self.irradiance(frame, levels, offset, scale, bindings, bound)
        target = frame.target("radiance.diffuse_indirect", "radiance.glossy_indirect", depth=MARKS)
        bindings["textures"]["shared_irradiance"] = irradiance
        bindings["constants"]["grid_offset"] = offset
        program = near_program(self.virtual_lights.kinds, *lobes_of(frame), shared=True)
        program = lit_at_hits(frame, program, bindings["textures"])
        for rows in frame.bands(self):
            passes.fullscreen(program, target, blend="ADDITIVE_PREMULT", where=ANY_SURFACE, rows=rows, **bindings)
            yield
        smooth(frame, self, "radiance.diffuse_indirect")
        images.pool.give(irradiance)
        frame.count(self, "passes", 4 * levels + 2)

    def visibility(self, frame: Frame, lights: VirtualLightSet) -> BoundGather:
        """What tells which of the virtual lights are hidden from a region."""
        return BoundGather(TRACED, constants={"rays": frame.settings.get(self, "rays")})

    def _bounds(self, frame: Frame, levels: int, offset: tuple[int, int], scale: float) -> list[images.Target]:
        """Bounds and flags of the regions of levels 1 to `levels`."""
        pyramid: list[images.Target] = []
        for level in range(1, levels + 1):
            size = _level_size(frame.size, level, levels)
            target = images.Target(tuple(images.pool.take(*size, form) for form in BOUNDS_FORMATS))
            if pyramid:
                program = BOUNDS
                textures = dict(zip(("finer_low", "finer_high", "finer_flags"), pyramid[-1].colors))
            else:
                program = FIRST_BOUNDS
                surface = surface_bindings(frame)
                textures = {name: surface[name] for name in ("surface_position", "surface_normal")}
            passes.fullscreen(
                program, target, textures=textures, blocks={"film_view": frame.view_block},
                constants={
                    "grid_offset": offset, "depth_scale": scale, "depth_step": DEPTH_STEP, "normal_step": NORMAL_STEP,
                },
            )  # fmt: skip
            pyramid.append(target)
        return pyramid

    def irradiance(
        self, frame: Frame, levels: int, offset, scale: float, bindings, bound
    ) -> Generator[None, None, images.Image]:
        """Irradiance at every pixel: an image of the picture's size or larger, whose pixel `offset` is its first."""
        grid = {"grid_offset": offset, "atlas_size": _level_size(frame.size, 0, levels)}
        atlas = images.pool.take(*_atlas_size(frame.size, levels), "RGBA32F")
        pyramid = self._bounds(frame, levels, offset, scale)
        flags = [target.colors[2] for target in pyramid]
        held = [atlas, *(image for target in pyramid for image in target.colors)]
        try:
            yield
            if levels and context.counts_in_images():
                listed = self._listed(frame, flags, grid)
                held += listed.values()
                yield from self._gather_listed(frame, bindings, bound, grid, atlas, listed)
                if frame.is_first:
                    frame.account.count_texel(self, "regions", listed["entry_count"])
            else:
                yield from self._gather_levels(frame, bindings, bound, grid, atlas, flags)
                if levels == 0 and frame.is_first:
                    frame.count(self, "regions", frame.size[0] * frame.size[1])
            if levels == 0:
                held.remove(atlas)
                return atlas
            found = self._fill(frame, atlas, flags, {**grid, "levels": levels, "depth_scale": scale})
            held.append(found)
            yield
            held.remove(found)
            return found
        finally:
            for image in held:
                images.pool.give(image)

    def _listed(self, frame: Frame, flags: list[images.Image], grid: dict) -> dict[str, images.Image]:
        """The list of the regions that gather, and how many they are."""
        listed = lists.take(frame.size)
        position = surface_bindings(frame)["surface_position"]
        for level, (own, coarser) in enumerate(zip(flags, (*flags[1:], flags[-1])), 1):
            passes.compute(
                LIST, own.size,
                textures={"surface_position": position, "region_flags": own, "coarser_flags": coarser},
                images=listed, constants={**grid, "level": level, "levels": len(flags)},
            )  # fmt: skip
        return listed

    def _fill(self, frame: Frame, atlas: images.Image, flags: list[images.Image], constants: dict) -> images.Image:
        """Irradiance at every pixel from that of the regions that have gathered."""
        levels = len(flags)
        surface = surface_bindings(frame)
        known = {name: surface[name] for name in ("surface_position", "surface_normal")} | {"gathered": atlas}

        def filled(program: Program, level: int, **textures) -> images.Image:
            image = images.pool.take(*_level_size(frame.size, level, levels), "RGBA32F")
            passes.fullscreen(
                program, images.Target((image,)),
                textures={**known, "region_flags": flags[max(level, 1) - 1], **textures},
                blocks={"film_view": frame.view_block}, constants={**constants, "level": level},
            )  # fmt: skip
            return image

        anything = atlas  # for what a level does not look at
        pulled: dict[int, images.Image] = {}
        for level in range(2, levels + 1):
            finer = pulled.get(level - 1, anything)
            pulled[level] = filled(PULL, level, finer_flags=flags[level - 2], finer_irradiance=finer)
        found = None
        for level in range(levels, -1, -1):
            coarser = found
            found = filled(
                FILL, level, coarser_flags=flags[min(level, levels - 1)], coarser_irradiance=coarser or anything,
                pulled=pulled.get(level, anything),
            )  # fmt: skip
            if coarser is not None:
                images.pool.give(coarser)
        for image in pulled.values():
            images.pool.give(image)
        return found

    def _gather_listed(
        self, frame: Frame, bindings, bound: BoundGather, grid: dict, atlas: images.Image, listed: dict
    ) -> Iterator[None]:
        columns = lists.columns(frame.size, 8)
        textures = bindings["textures"] | bound.textures | listed
        program = asked(frame, regions(bound.gather), textures)
        constants = _region_constants(bindings, bound, grid) | {"columns": columns}
        for first, last in frame.bands(self, "regions"):
            passes.compute(
                program, (columns, last - first), textures=textures, images={"gathered": atlas},
                blocks=bindings["blocks"], constants={**constants, "first_row": first},
            )  # fmt: skip
            yield

    def _gather_levels(
        self, frame: Frame, bindings, bound: BoundGather, grid: dict, atlas: images.Image, flags: list[images.Image]
    ) -> Iterator[None]:
        """The same level by level, without a list; with no levels, all pixels."""
        levels = len(flags)
        program = asked(frame, regions(bound.gather, listed=False), textures := {})
        anything = bindings["textures"]["virtual_lights"]  # for what a level does not look at
        for level in range(levels, -1, -1):
            width, height = _level_size(frame.size, level, levels)
            textures |= bindings["textures"] | bound.textures
            textures["region_flags"] = flags[level - 1] if level > 0 else anything
            textures["coarser_flags"] = flags[level] if level < levels else anything
            constants = _region_constants(bindings, bound, grid) | {"level": level, "levels": levels}
            for first, last in frame.bands(self, "regions") if level == 0 else ((0, height),):
                last = height if last == frame.size[1] else last  # the grid is shifted, and has more rows
                passes.compute(
                    program, (width, last - first), textures=textures, images={"gathered": atlas},
                    blocks=bindings["blocks"], constants={**constants, "first_row": first},
                )  # fmt: skip
                yield


def _region_constants(bindings: dict[str, dict], bound: BoundGather, grid: dict) -> dict[str, object]:
    return {name: bindings["constants"][name] for _, name in REGION_CONSTANTS} | bound.constants | grid


def fitting_levels(size: tuple[int, int], asked: int) -> int:
    """No levels where the atlas of all regions would be larger than an image may be, or an entry's bits can tell."""
    most = min(images.most_side(), 1 << REGION_BITS)
    return asked if max(_atlas_size(size, asked)) <= most else 0


def _level_size(size: tuple[int, int], level: int, levels: int) -> tuple[int, int]:
    """Regions of a level: whole ones of the coarsest level, wherever the grid is shifted to."""
    side = 1 << levels
    return tuple((-(-(extent + side - 1) // side) * side) >> level for extent in size)


def _atlas_size(size: tuple[int, int], levels: int) -> tuple[int, int]:
    """Pixels, and to their right the regions of all levels, see shaders/indirect/regions.glsl."""
    width, height = _level_size(size, 0, levels)
    return (width + (width >> 1) if levels else width), height
