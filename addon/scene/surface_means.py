"""Means over surfaces of what their materials emit, for what runs no shader: the choice of light sources, and rays.

The mean of an image says little about that: a wall shows a part of a sheet of sprites, and of a colour ramp over noise
nothing is known at all. A node tree is only known as a program, so the surfaces of each material that varies are drawn
over one another from the directions of overview.py, with what they emit added up, for the two sides apart: a panel may
shine to one side only.

| cost | once per set of materials and geometry |
|---|---|
| draws | 8 of each such material's meshes (not of all of their instances) |
| readback | 8 x SIDE x SIDE pixels of each |

Fails: a material emits the same a side wherever it is.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..gfx import images, passes
from ..gfx.library import Program
from ..materials.compiled import CompiledMaterial
from .culling import calls
from .geometry import SceneGeometry
from .materials import MaterialSet
from .overview import DIRECTIONS, overview, some

SIDE = 32  # pixels of one view
VIEWS = np.concatenate([DIRECTIONS, -DIRECTIONS])  # of both sides
ALIKE = 0.1  # relative difference of the sides' emission that the views alone may make


class SurfaceMeans:
    """What was measured of a renderer's materials, kept until a material or what shows it changes."""

    def __init__(self):
        self._known: dict[object, dict[str, object]] = {}

    def of(self, materials: MaterialSet, geometry: SceneGeometry) -> list[CompiledMaterial]:
        """The scene's materials, with the emission of those that vary as their surfaces have it."""
        shown: dict[int, list[int]] = {}
        for number, draw in enumerate(geometry.draws):
            if materials.compiled[draw.material].uneven_emission:
                shown.setdefault(draw.material, []).append(number)
        if not shown:
            return materials.compiled
        prints, count, found, known = materials.fingerprint(), len(materials.compiled), list(materials.compiled), {}
        for material, numbers in shown.items():
            places = tuple(
                (draw.batch.number, draw.first, draw.count) for draw in map(geometry.draws.__getitem__, numbers)
            )
            key = prints[material], prints[count:], places, materials.around(material, geometry)
            known[key] = self._known.get(key) or _emission(materials, geometry, material, numbers)
            found[material] = replace(found[material], **known[key])
        self._known = known
        return found


def _emission(materials: MaterialSet, geometry: SceneGeometry, material: int, numbers: list[int]) -> dict[str, object]:
    program, bindings = materials.emission_program(material), materials.bindings(material, geometry.instances)
    sums = [_sum(geometry, numbers, program, bindings, side) for side in (0, 1)]
    means = [tuple(map(float, of[:3] / of[3])) if of[3] > 0 and np.isfinite(of).all() else None for of in sums]
    front, behind = means[0] or means[1], means[1] or means[0]
    if front is None:
        return {}
    if np.allclose(front, behind, rtol=ALIKE, atol=ALIKE * max(map(abs, (*front, *behind)))):
        front = behind = tuple((a + b) / 2 for a, b in zip(front, behind))
    return {"emission": front, "emission_behind": behind}


def _sum(geometry: SceneGeometry, numbers: list[int], program: Program, bindings: dict, side: int) -> np.ndarray:
    """(4,) what a program draws in all pixels of all views together; `side` as emission.frag.glsl reads it."""
    own = some(numbers, geometry.draws)
    draws = [geometry.draws[k] for k in own]
    low, high = np.min([draw.low for draw in draws], axis=0), np.max([draw.high for draw in draws], axis=0)
    shader = passes.get(program)
    with images.borrowed(SIDE, len(VIEWS) * SIDE, "RGBA32F") as target:
        target.clear()
        for number, backward in enumerate(VIEWS):
            view = overview(low, high, backward)
            constants = {name: view[name] for name in ("row_x", "row_y", "row_w", "row_q")}
            constants |= {"near": 0.5, "first_instance": 0, "light_point": (*backward, 0.0), "caster_sample": side}
            state = {"blend": "ADDITIVE_PREMULT", "depth_test": "NONE", "depth_write": False}
            with passes.drawing(target, viewport=(0, number * SIDE, SIDE, SIDE), **state):
                shader.bind(**bindings, constants=constants)
                for call in calls(geometry.draws, own):
                    shader.set_constant("first_instance", call.first)
                    passes.draw(shader, call.draw.batch, call.count)
        return images.read(target.colors[0]).astype(float).sum(axis=(0, 1))
