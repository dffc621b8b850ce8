"""The light loop: points of lights, what tells from where they are seen, and the pass that lights surfaces by them.

Every source of direct light (lamps, directions of the world, emissive triangles, areas fitted to the world) draws
points of it for a sample, each with the provider that tells its visibility. The loop groups them by provider, lets each
make batches of them with depth maps, rays or images to be asked, and runs one pass for a batch:

    L(x, v) = sum over points  f(x, v, w) cos(w) Le(y, -w) V(x, y) / p

A lighting program is compiled for a lookup, with or without soft lobes, and for kinds of light sources.

| cost | per batch of at most 64 points |
|---|---|
| passes | 1 over the screen, and what the provider draws |
| fetches per pixel | 6 surface + per point 5 to 8 of its row, and those of the lookup |

Where a round light's radius is more than a quarter of its distance, points that ask maps are asked by rays: in its ball
a point is drawn, and light arrives from the ball's projection towards the receiver, so that a map from the point shows
what blocks it only as long as the ball is small beside its distance.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache

import numpy as np

from ..frame.picture import Frame
from ..frame.technique import Technique, Write
from ..gfx import images, passes
from ..gfx.library import Program
from ..scene import acceleration
from ..scene.view import VIEW
from ..sources import lights
from ..surfaces.draw import ANY_SURFACE, SOFT_DEFINES, SURFACE_TEXTURES
from . import linked, repeated_light, shared_visibility
from .asked import asked
from .caustic_casters import glass_alone
from .repeated_light import Lit
from .visibility import (
    OF_LAYERS,
    RAY_CONSTANTS,
    LightPoint,
    Lookup,
    Maps,
    VisibilityProvider,
    drawn_stochastically,
    ray_bindings,
    source_of,
    traced_roughness,
)

CANDIDATES = 4  # directions that traced_glossy draws from a lobe per sample, of which it traces one
TRACED_DEFINES = (("CANDIDATES", str(CANDIDATES)),)
NEAR = 0.25  # radius / distance of a round light from which rays are traced instead of asking maps
RAYS_WHERE_NEAR = Lookup(
    "rays where near",
    "light/near_visibility.glsl",
    textures=acceleration.HIERARCHY_TEXTURES,
    constants=(*RAY_CONSTANTS, ("FLOAT", "near_share")),
    defines=OF_LAYERS,
)


OUTPUTS = (("VEC4", "out_diffuse"), ("VEC4", "out_glossy"))


@cache
def lighting(lookup: Lookup, soft_lobes: bool, kinds: int = -1) -> Program:
    """The lighting pass with the visibility of a technique, for scenes with or without soft lobes, and for lights of
    these kinds (bits as in lights.LAMPS; -1: any light)."""
    return passes.fullscreen_program(
        f"direct light, {lookup.name}",
        "light/direct.frag.glsl",
        textures=(
            *lookup.textures,
            *((("RGBA32F", "depth_maps"),) if lookup.maps else ()),
            ("RGBA32F", "energy_table"),
            *SURFACE_TEXTURES,
        ),
        blocks=((VIEW, "film_view"), (lights.SOURCES, "sources"), *lookup.blocks),
        constants=(("INT", "light_count"), ("FLOAT", "traced_roughness"), *lookup.constants),
        defines=(
            *TRACED_DEFINES,
            *SOFT_DEFINES[soft_lobes],
            *lookup.defines,
            ("LIGHT_KINDS", str(kinds)),
        ),
        snippets=source_of(lookup),
        outputs=OUTPUTS,
    )


DIRECT_WRITES = (
    Write("radiance.diffuse_direct", "RGBA32F", "Light that diffuse surfaces receive straight from sources", True),
    Write("radiance.glossy_direct", "RGBA32F", "Light that glossy surfaces receive straight from sources", True),
)


def shade(
    frame: Frame, technique: Technique, rows: list[np.ndarray], kinds: int, sources: lights.Sources, maps: Maps
) -> Iterator[None]:
    """Add the light of `rows` (each (TEXELS, 4)), of these `kinds`, to the radiance images, in
    parts."""
    drawn = {} if maps.atlas is None else {"depth_maps": maps.atlas}

    def answering(lookup: Lookup, textures: dict[str, images.Image]) -> tuple[Program, dict[str, images.Image]]:
        """The pass with this lookup for what the scene has, and what it reads then beside the surfaces."""
        textures = {"energy_table": frame.materials.energy_table, **textures}
        program = asked(frame, lighting(lookup, frame.materials.soft, kinds), textures)
        return linked.linked(frame, technique, program, rows, textures), textures

    constants = {"light_count": len(rows), "traced_roughness": traced_roughness(frame), **maps.constants}
    program, textures = answering(maps.lookup, {**drawn, **maps.textures})
    bindings = {"textures": textures, "blocks": maps.blocks, "constants": constants}
    lit = Lit(program, ANY_SURFACE, bindings, rows, maps.views)
    if maps.sparse:
        yield from shared_visibility.add(frame, technique, sources, lit, kinds, maps, answering)
    else:
        yield from repeated_light.add(frame, technique, sources, lit)
        frame.count(technique, "passes")
    frame.count(technique, "light samples", len(rows))


def light_surfaces(
    frame: Frame,
    technique: Technique,
    points: list[LightPoint],
    kinds: int,
    sources: lights.Sources,
    adjust: Callable[[Maps, float], Maps] | None = None,
) -> Iterator[None]:
    """Add the light of these points, of light sources of these `kinds`, to the radiance images, in parts. `adjust`:
    changes what tells the visibility of a batch of so many points."""
    by_provider: dict[VisibilityProvider, list[LightPoint]] = {}
    glass_tints = not tinted_casters(frame, glass_alone(frame))
    for point in _by_channel(points, glass_tints) if tinted_casters(frame) else points:
        by_provider.setdefault(point.provider, []).append(point)
        kinds |= bool(point.flags & lights.WHOLE_FLAG) << lights.WHOLE
    for provider, own in sorted(by_provider.items(), key=lambda group: group[0].asks_views):
        for batch, maps in provider.batches(frame, technique, own):
            yield from maps.drawing
            yield
            maps = adjust(maps, sum(map(_share, batch))) if adjust else maps
            near = [point.row for point in batch if point.flags & lights.NEAR_FLAG]
            others = [point.row for point in batch if not point.flags & lights.NEAR_FLAG]
            if others:
                yield from shade(frame, technique, others, kinds, sources, maps)
            if near:
                yield from shade(frame, technique, near, kinds, sources, _with_rays(frame, maps))


def tinted_casters(frame: Frame, stopped: frozenset[int] = frozenset()) -> bool:
    """Whether something that is drawn colours the light that it lets pass, besides the materials `stopped`."""
    return any(frame.materials.compiled[draw.material].tinted for draw in drawn_stochastically(frame, stopped))


def _share(point: LightPoint) -> float:
    """Of a point that was drawn: those of one channel are a third."""
    return 1 / 3 if any(getattr(view, "channel", 0) for view in point.views) else 1.0


def _by_channel(points: list[LightPoint], glass_tints: bool) -> Iterator[LightPoint]:
    """The same light as points of red, green and blue alone, each with maps of what passes casters of that channel: a
    lookup says how much arrives, not in which colour. Three times the maps, where casters are coloured. `glass_tints`:
    they are all glass, which lets nothing pass to maps that hold it as opaque."""
    for point in points:
        stopped = glass_tints and all(getattr(view, "glass_blocks", False) for view in point.views)
        if stopped or not any(hasattr(view, "channel") for view in point.views):
            yield replace(point, row=point.row.copy())
            continue
        for channel in range(3):
            row = point.row.copy()
            row[lights.LIGHT.at.radiance] *= np.arange(3) == channel
            yield replace(point, row=row, views=[replace(view, channel=channel + 1) for view in point.views])


def _with_rays(frame: Frame, maps: Maps) -> Maps:
    """The same maps, asked only where the light is small beside its distance."""
    textures, constants = ray_bindings(frame)
    constants["near_share"] = NEAR
    return replace(maps, lookup=RAYS_WHERE_NEAR, textures=textures, constants=constants)
