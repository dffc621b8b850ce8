"""Multi-resolution instant radiosity: hundreds of virtual lights per picture, gathered by regions instead of pixels.

Irradiance varies slowly over a surface, so that it is gathered once for each region of 1 x 1 to 2^L x 2^L pixels and
interpolated in between. A region may not hold a silhouette, a range of depths above 5 % or of normals above 0.1 per
axis (by min-max pyramids), nor the border of the picture, and neighbours differ by one level at most:

    S(q, l) = range(q, l) too large, or S of any of the 4 x 4 regions around q's quarter at level l - 1
    gathered: not S(q, l) and S(parent, l + 1)            (every pixel lies in exactly one such region)

From the coarsest level down, a region that a larger one covers interpolates bilinearly between its four coarser
neighbours, those without data left out, the others weighted by exp(-(distance off the plane / 2 % of the depth)^2) and
(n . n')^8. Virtual lights, their bound near surfaces, and the short rays that give back what the bound takes are those
of instant_radiosity.py, as is glossy light; nothing is doubled and nothing is lost. As a region is gathered for many
pixels, it can look at many more virtual lights and trace more of them: at one sample the error of a picture is that of
the set of virtual lights, which falls with their number. In every sample the grid of regions is shifted. A sample that
is shown alone is filtered over neighbouring pixels (neighbours.py), which takes the grain of the short rays.

Sources: Nichols & Wyman 2009 (multi-resolution splatting); Nichols, Shopf & Wyman 2009; Le Hoang Quyen 2014.

| cost | per sample |
|---|---|
| arithmetic | 2 kernels per region and virtual light; regions are 10 to 40 % of the pixels at 640 x 360 |
| rays | `rays` per region; 1 short one per pixel, + 2 for each surface within the bound; glossy surfaces as there |
| virtual lights | see virtual_lights.py: 4 candidates each, 192 rays each for the density |
| passes | 2 x `levels` + 2 |

Fails: grass and hair split every region, and then it costs as much as gathering for every pixel. Alpha that is drawn by
lot does the same.

Bias, all in diffuse indirect light: that of instant_radiosity.py; shadows of indirect light that are narrower than a
region are blurred over it (the shift of the grid averages the blocks, not the blur); rough diffuse reflection counts as
Lambertian.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np

from ..frame.run import Frame
from ..frame.technique import Param
from ..frame.view import VIEW
from ..gfx import images, passes
from ..gfx.library import Program
from .instant_radiosity import GATHER_CONSTANTS, GATHER_TEXTURES, InstantRadiosity, gather_bindings
from .neighbours import smooth
from .surfaces import surface_bindings
from .virtual_lights import PATH_BLOCKS, TRACED, BoundGather, Gather, VirtualLightSet

DEPTH_STEP, NORMAL_STEP = 0.05, 0.1  # ranges within a region: share of its depth, and of each axis of unit normals
LEVELS = Param("levels", "Levels", 3, "Regions have up to 2^levels pixels a side; 0: every pixel gathers", 0, 5)
BOUNDS_CONSTANTS = (
    ("IVEC2", "grid_offset"), ("FLOAT", "depth_scale"), ("FLOAT", "depth_step"), ("FLOAT", "normal_step"),
)  # fmt: skip
BOUNDS_OUTPUTS = (("VEC4", "out_low"), ("VEC4", "out_high"), ("VEC2", "out_flags"))
BOUNDS_FORMATS = ("RGBA32F", "RGBA32F", "RG32F")
FIRST_BOUNDS = passes.fullscreen_program(
    "region bounds of pixels",
    "indirect/region_bounds.frag.glsl",
    textures=(("FLOAT_2D", "surface_position"), ("FLOAT_2D", "surface_normal")),
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


@cache
def regions(gather: Gather) -> Program:
    """The pass over the regions of a level, with what tells which virtual lights are hidden."""
    return passes.fullscreen_program(
        f"regions, {gather.name}",
        "indirect/regions.frag.glsl",
        textures=(
            *GATHER_TEXTURES, ("FLOAT_2D", "region_flags"), ("FLOAT_2D", "coarser_flags"),
            ("FLOAT_2D", "coarser_irradiance"), *gather.textures,
        ),
        blocks=PATH_BLOCKS,
        constants=(
            *GATHER_CONSTANTS, ("IVEC2", "grid_offset"), ("INT", "level"), ("INT", "levels"), ("FLOAT", "depth_scale"),
            *gather.constants,
        ),
        snippets=(("generated/gather", f'#include "{gather.file}"\n'),),
        outputs=(("VEC4", "out_irradiance"),),
        defines=gather.defines,
    )  # fmt: skip


TRACED_REGIONS = regions(TRACED)
GATHER_SHARED = passes.fullscreen_program(
    "instant radiosity of regions",
    "indirect/gather.frag.glsl",
    textures=(*GATHER_TEXTURES, ("FLOAT_2D", "shared_irradiance")),
    blocks=PATH_BLOCKS,
    constants=(*GATHER_CONSTANTS, ("IVEC2", "grid_offset")),
    outputs=(("VEC4", "out_diffuse"), ("VEC4", "out_glossy")),
    defines=(("SHARED", ""),),
)


class MultiresRadiosity(InstantRadiosity):
    name = "multires_radiosity"
    label = "Multi-resolution radiosity"
    params = (
        Param(
            "virtual_lights", "Virtual lights", 1024, "Points of surfaces that light the picture in a sample", 1, 2048,
            draft=128,
        ),
        Param(
            "rays", "Rays", 64, "How many of the virtual lights each region traces in a sample; 0: light passes walls",
            0, 1024, draft=8,
        ),
        LEVELS,
    )  # fmt: skip

    def run(self, frame: Frame) -> Iterator[None]:
        if frame.receivers is None or not len(frame.receivers.distance):
            return
        levels = frame.settings.get(self, "levels")
        offset = tuple(int(u * (1 << levels)) for u in frame.random("regions"))
        scale = float(np.median(frame.receivers.distance))
        lights = self.virtual_lights.make(frame, self, frame.settings.get(self, "virtual_lights"))
        bindings = gather_bindings(frame, self.virtual_lights, lights)
        bindings["constants"]["grid_offset"] = offset
        yield
        bound = self.visibility(frame, lights)
        yield
        pyramid = self._bounds(frame, levels, offset, scale)
        if frame.sample == 0:
            frame.count(self, "regions", _count([images.read(target.colors[2]) for target in pyramid], frame.size))
        irradiance = None
        for level in range(levels, -1, -1):
            irradiance = self._gather(level, levels, pyramid, irradiance, bindings, bound, scale, frame.size)
            yield
        target = frame.target("radiance.diffuse_indirect", "radiance.glossy_indirect")
        bindings["textures"]["shared_irradiance"] = irradiance
        for rows in frame.bands(self):
            passes.fullscreen(GATHER_SHARED, target, blend="ADDITIVE_PREMULT", rows=rows, **bindings)
            yield
        smooth(frame, self, "radiance.diffuse_indirect")
        images.pool.give(irradiance)
        for level in pyramid:
            for image in level.colors:
                images.pool.give(image)
        frame.count(self, "passes", 2 * levels + 2)

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

    def _gather(self, level, levels, pyramid, coarser, bindings, bound, scale, size) -> images.Image:
        """Irradiance at the regions of a level, from that of the `coarser` one, which goes back to the pool."""
        found = images.pool.take(*_level_size(size, level, levels), "RGBA32F")
        anything = bindings["textures"]["virtual_lights"]  # for what this level does not look at
        textures = {
            **bindings["textures"],
            "region_flags": pyramid[level - 1].colors[2] if level > 0 else anything,
            "coarser_flags": pyramid[level].colors[2] if level < levels else anything,
            "coarser_irradiance": coarser or anything,
            **bound.textures,
        }
        constants = {
            **bindings["constants"], **bound.constants, "level": level, "levels": levels, "depth_scale": scale,
        }  # fmt: skip
        passes.fullscreen(
            regions(bound.gather), images.Target((found,)), textures=textures, blocks=bindings["blocks"],
            constants=constants,
        )  # fmt: skip
        if coarser is not None:
            images.pool.give(coarser)
        return found


def _level_size(size: tuple[int, int], level: int, levels: int) -> tuple[int, int]:
    """Regions of a level: whole ones of the coarsest level, wherever the grid is shifted to."""
    side = 1 << levels
    return tuple((-(-(extent + side - 1) // side) * side) >> level for extent in size)


def _count(flags: list[np.ndarray], size: tuple[int, int]) -> int:
    """How many regions gather, from the flags of levels 1 and above; of single pixels those of all split regions."""
    if not flags:
        return size[0] * size[1]
    count = 4 * int(flags[0][..., 0].sum())
    for level, own in enumerate(flags):
        whole = (own[..., 0] < 0.5) & (own[..., 1] == 1.0)
        if level + 1 < len(flags):
            whole &= flags[level + 1][..., 0].repeat(2, axis=0).repeat(2, axis=1) > 0.5
        count += int(whole.sum())
    return count
