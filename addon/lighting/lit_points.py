"""Lit points: points on surfaces with reflectance and direct light, for techniques that gather from them.

Whatever spreads points over surfaces (points by area: point_runs.py; surfels: surfels.py) has them shaded and lit here.
Points are records of hits, known beforehand or found by rays; the material's own program is run at each
(surfaces/hits.py): textures, procedurals and vertex colours of what no camera sees. What is kept is the share of even
light that leaves again. Gloss counts as diffuse there: what it reflects of even light is right, its direction is not.
Who looks at directions has it kept apart (`directed`). Light of lamps, the world and emissive meshes comes from the
light loop with traced shadows (point_light.py).

| cost | |
|---|---|
| closures | 1 pass, and 1 for each material; 13 x 16 bytes a point while it runs, 3 x 16 are kept |
| light | as point_light.py: 1 ray for each point and point of a light source in front of it |

Bias: as surfaces/hits.py and point_light.py; mirrors send light to all sides unless gloss is apart; light through glass
does not arrive.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..frame.picture import Frame
from ..frame.technique import Technique
from ..gfx import images, passes
from ..materials import gloss
from ..scene.view import VIEW
from ..surfaces.draw import SURFACE_TEXTURES
from ..surfaces.hits import Hits, Records, closure_bindings, take_closures
from . import caustic_casters
from .point_light import LIGHTING, LIGHTING_WITH_WAYS, PointLight

NAMES = ("position", "normal", "diffuse")  # of the images of shaded points, as surface images are laid out
REFLECT = passes.fullscreen_program(
    "what points reflect",
    "hits/reflect.frag.glsl",
    textures=(*SURFACE_TEXTURES, ("RGBA32F", "energy_table")),
    blocks=((VIEW, "film_view"),),
    outputs=(("VEC4", "out_position"), ("VEC4", "out_normal"), ("VEC4", "out_albedo")),
)
# The diffuse part alone, the albedo of all, and that of gloss with its roughness in w (below 0: a caster's).
REFLECT_APART = replace(
    REFLECT,
    name="what points reflect, gloss apart",
    textures=(*REFLECT.textures, ("R32F", "hit_material"), ("R32F", "thrown_materials")),
    defines=(*REFLECT.defines, ("GLOSS", "1"), ("SMOOTH_MIRROR", f"{gloss.THROWS + 1e-4:.4f}")),
    outputs=tuple(("VEC4", f"out_{name}") for name in (*NAMES, "albedo", "gloss")),
)
PROGRAMS = (REFLECT, LIGHTING)
DIRECTED_PROGRAMS = (REFLECT_APART, LIGHTING_WITH_WAYS)  # where gloss is apart


class LitPoints:
    """Shades and lights images of points. A technique owns one: `begin` once a picture, `light` in each sample."""

    def __init__(self, use: str, **light):
        """`light`: how many points on light sources, as PointLight takes them."""
        self._light = PointLight(use, reflected=True, **light)
        self._black: images.Image | None = None

    def begin(self, frame: Frame) -> None:
        """Find what emits."""
        self._light.begin(frame)

    def shade(
        self, frame: Frame, technique: Technique, facing: images.Image, find: Callable[[Hits, Records], set[int]],
        directed: bool = False,
    ) -> images.Target:  # fmt: skip
        """Place, normals and albedo of points, images of the pool in the order of NAMES; position.w is 0 where there is
        none. `directed`: gloss apart, in the order of REFLECT_APART. `facing`: the direction in which each is looked
        at; `find` fills in the records and returns the materials that may be there (Hits.trace, Hits.place)."""
        hits, records = frame.kept(Hits), Records.take(facing.size)
        closures = take_closures(facing.size, records.target.depth)
        hits.shade(frame, technique, facing, records, find(hits, records), closures)
        program = REFLECT_APART if directed else REFLECT
        textures = {**closure_bindings(closures), "energy_table": frame.materials.energy_table}
        if directed:
            textures |= {"hit_material": records.images["hit_material"], "thrown_materials": _thrown_materials(frame)}
        shaded = images.Target(tuple(images.pool.take(*facing.size, "RGBA32F") for _ in program.outputs))
        passes.fullscreen(program, shaded, blocks={"film_view": frame.view_block}, textures=textures)
        for image in closures.colors:
            images.pool.give(image)
        records.give()
        frame.count(technique, "passes")
        return shaded

    def light(
        self, frame: Frame, technique: Technique, points: tuple[images.Image, ...], target: images.Target, count: int,
        number: int | None = None,
    ) -> None:  # fmt: skip
        """Add the direct light of this sample, or of sample `number`, that `count` points (images in the order of
        NAMES) reflect to the first of the images of `target`: radiance. Of three images the others get what falls on
        the points across its direction, and its ways (PointLight.add)."""
        if self._black is None or self._black.size != target.size:
            self._give()
            self._black = images.pool.take(*target.size, "RGBA32F")
            images.Target((self._black,)).clear()
        surfaces = dict(zip(NAMES, points)) | dict.fromkeys(("tint", "lobe", "emission"), self._black)
        drawn, rays = self._light.add(frame, surfaces, target, number, photons=len(target.colors) > 2)
        frame.count(technique, "passes", drawn)
        frame.count(technique, "light rays", rays * count)

    def _give(self) -> None:
        if self._black is not None:
            images.pool.give(self._black)
        self._black = None

    def release(self) -> None:
        """Drop GPU resources."""
        self._give()
        self._light.release()


def _thrown_materials(frame: Frame) -> images.Image:
    """1 at (m & 255, m >> 8) of each material m that photons answer for as a mirror."""
    table = np.zeros((len(frame.snapshot.materials) // 256 + 1, 256, 1), np.float32)
    found = caustic_casters.of(frame)
    for material in found.mirrors if found is not None else ():
        table[material >> 8, material & 255] = 1.0
    return images.upload(table, "R32F")
