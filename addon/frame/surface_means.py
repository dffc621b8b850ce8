"""Means of materials over the surfaces that show them, for what runs no shader: opacity that rays meet, and emission.

The mean of an image says little about that: a wall that shows the opaque corner of a sheet of sprites blocks all light,
and of a colour ramp over noise nothing is known at all. A node tree is only known as a program, so the surfaces of each
material that varies are drawn over one another from the directions of overview.py: by lot as into a depth map and all
of them whole, of which the share of fragments that are left is the opacity; and with what they emit, added up.

| cost | once per set of materials and geometry |
|---|---|
| draws | of each such material's meshes (not of all of their instances), 4 for opacity, 2 for emission |
| readback | 2 x SIDE x SIDE pixels of each |

Against Cycles: a room textured from a sheet of which some is transparent had .28 of its indirect light, now .98.

Fails: a material has one mean wherever it is; a leaf of which much is cut away blocks as much as one that is whole.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..gfx import images, passes
from ..gfx.library import Program
from ..materials.compiled import CompiledMaterial
from .culling import calls
from .depth_maps import OPAQUE
from .geometry import SceneGeometry
from .materials import MaterialSet
from .overview import DIRECTIONS, overview, some

SIDE = 32  # pixels of one view
BY_LOT = 2.0  # what shaders/depth_map/alpha.frag.glsl marks what it has drawn with; opaque.frag.glsl: 1
Measure = Callable[[MaterialSet, SceneGeometry, int, list[int]], dict[str, object]]


class SurfaceMeans:
    """What was measured of a renderer's materials, kept until a material or what shows it changes."""

    def __init__(self):
        self._known: dict[object, dict[str, object]] = {}

    def of(self, materials: MaterialSet, geometry: SceneGeometry) -> list[CompiledMaterial]:
        """The scene's materials, with opacity and emission of those that vary as their surfaces have them."""
        shown: dict[int, list[int]] = {}
        for number, draw in enumerate(geometry.draws):
            if _measures(materials.compiled[draw.material]):
                shown.setdefault(draw.material, []).append(number)
        if not shown:
            return materials.compiled
        prints, count, found, known = materials.fingerprint(), len(materials.compiled), list(materials.compiled), {}
        for material, numbers in shown.items():
            places = tuple(
                (draw.batch.number, draw.first, draw.count) for draw in map(geometry.draws.__getitem__, numbers)
            )
            for measure in _measures(found[material]):
                key = measure, prints[material], prints[count:], places
                known[key] = self._known.get(key) or measure(materials, geometry, material, numbers)
                found[material] = replace(found[material], **known[key])
        self._known = known
        return found


def _measures(material: CompiledMaterial) -> list[Measure]:
    return [
        measure for measure, needed in ((_opacity, material.uneven), (_emission, material.uneven_emission)) if needed
    ]


def _opacity(materials: MaterialSet, geometry: SceneGeometry, material: int, numbers: list[int]) -> dict[str, object]:
    by_lot = materials.caster_program(material), materials.bindings(material, geometry.instances)
    whole = OPAQUE, {"textures": {"instances": geometry.instances}}
    kept = _sum(geometry, numbers, *by_lot, by_material=True)[3] / BY_LOT
    drawn = _sum(geometry, numbers, *whole, by_material=False)[3]
    return {"opacity": float(np.clip(kept / drawn, 0.0, 1.0)) if drawn > 0 else materials.compiled[material].opacity}


def _emission(materials: MaterialSet, geometry: SceneGeometry, material: int, numbers: list[int]) -> dict[str, object]:
    bindings = materials.bindings(material, geometry.instances)
    *radiance, drawn = _sum(geometry, numbers, materials.emission_program(material), bindings, by_material=True)
    if not (drawn > 0 and np.isfinite(radiance).all()):
        return {"emission": materials.compiled[material].emission}
    return {"emission": tuple(float(channel / drawn) for channel in radiance)}


def _sum(
    geometry: SceneGeometry, numbers: list[int], program: Program, bindings: dict, by_material: bool
) -> np.ndarray:
    """(4,) what a program draws in all pixels of all views together."""
    own = some(numbers, geometry.draws)
    draws = [geometry.draws[k] for k in own]
    low, high = np.min([draw.low for draw in draws], axis=0), np.max([draw.high for draw in draws], axis=0)
    shader = passes.get(program)
    with images.borrowed(SIDE, len(DIRECTIONS) * SIDE, "RGBA32F") as target:
        target.clear()
        for number, backward in enumerate(DIRECTIONS):
            view = overview(low, high, backward)
            constants = {name: view[name] for name in ("row_x", "row_y", "row_w", "row_q")}
            constants |= {"near": 0.5, "first_instance": 0}
            if by_material:
                constants |= {"light_point": (*backward, 0.0), "sample_index": number}
            state = {"blend": "ADDITIVE_PREMULT", "depth_test": "NONE", "depth_write": False}
            with passes.drawing(target, viewport=(0, number * SIDE, SIDE, SIDE), **state):
                shader.bind(**bindings, constants=constants)
                for call in calls(geometry.draws, own):
                    shader.set_constant("first_instance", call.first)
                    passes.draw(shader, call.draw.batch, call.count)
        return images.read(target.colors[0]).astype(float).sum(axis=(0, 1))
