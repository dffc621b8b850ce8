"""The pass that lights surfaces by a batch of points of lights, with the visibility that a lookup tells."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np

from ..frame.run import Frame
from ..frame.technique import Technique, Write
from ..gfx import passes
from ..gfx.library import Program
from ..scene.view import VIEW
from ..sources import lights
from ..surfaces.draw import ANY_SURFACE, SOFT_DEFINES, SURFACE_TEXTURES
from . import repeated_light, shared_visibility
from .repeated_light import Lit
from .visibility import Lookup, Maps, traced_roughness

CANDIDATES = 4  # directions that traced_glossy draws from a lobe per sample, of which it traces one
TRACED_DEFINES = (("CANDIDATES", str(CANDIDATES)),)


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
        snippets=(("generated/visibility", f'#include "{lookup.file}"\n'),),
        outputs=(("VEC4", "out_diffuse"), ("VEC4", "out_glossy")),
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
    bindings = {
        "textures": {**drawn, "energy_table": frame.materials.energy_table, **maps.textures},
        "blocks": maps.blocks,
        "constants": {
            "light_count": len(rows), "traced_roughness": traced_roughness(frame),
            **maps.constants,
        },
    }  # fmt: skip
    program = lighting(maps.lookup, frame.materials.soft, kinds)
    lit = Lit(program, ANY_SURFACE, bindings, rows, maps.views)
    if maps.sparse:
        between = lighting(shared_visibility.BETWEEN, frame.materials.soft, kinds)
        yield from shared_visibility.add(frame, technique, sources, lit, kinds, maps, between)
    else:
        yield from repeated_light.add(frame, technique, sources, lit)
        frame.count(technique, "passes")
    frame.count(technique, "light samples", len(rows))
