"""Mean opacity of materials whose alpha varies, over the surfaces that show them: what rays meet that run no shader.

The mean of an image says little about that: a wall that shows the opaque corner of a sheet of sprites blocks all
light. A node tree is only known as a program, so the surfaces of each such material are drawn over one another from the
directions of overview.py, by lot as into a depth map, and all of them whole: the share of fragments that are left is
the opacity. A corner of a room textured from such a sheet had .29 of the indirect light that it has in Cycles, now .98.

| cost | once per set of materials and geometry |
|---|---|
| draws | 4 of each such material's meshes (not of all of their instances), into SIDE x SIDE pixels each |
| readback | 2 x SIDE x SIDE pixels of each |

Fails: a material has one opacity wherever it is; a leaf of which much is cut away blocks as much as one that is whole.
"""

from __future__ import annotations

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


class Coverage:
    """Measured opacities of a renderer's materials, kept until a material or what shows it changes."""

    def __init__(self):
        self._known: dict[object, float] = {}

    def of(self, materials: MaterialSet, geometry: SceneGeometry) -> list[CompiledMaterial]:
        """The scene's materials, with the opacity of those whose alpha varies as their surfaces have it."""
        shown: dict[int, list[int]] = {}
        for number, draw in enumerate(geometry.draws):
            if materials.compiled[draw.material].uneven:
                shown.setdefault(draw.material, []).append(number)
        if not shown:
            return materials.compiled
        prints, count, found, known = materials.fingerprint(), len(materials.compiled), list(materials.compiled), {}
        for material, numbers in shown.items():
            places = tuple(
                (id(draw.batch), draw.first, draw.count) for draw in map(geometry.draws.__getitem__, numbers)
            )
            key = prints[material], prints[count:], places
            known[key] = self._known[key] if key in self._known else _measured(materials, geometry, material, numbers)
            found[material] = replace(found[material], opacity=known[key])
        self._known = known
        return found


def _measured(materials: MaterialSet, geometry: SceneGeometry, material: int, numbers: list[int]) -> float:
    own = some(numbers, geometry.draws)
    draws = [geometry.draws[k] for k in own]
    low, high = np.min([draw.low for draw in draws], axis=0), np.max([draw.high for draw in draws], axis=0)
    by_lot = materials.bindings(material, geometry.instances)
    whole = {"textures": {"instances": geometry.instances}}
    with images.borrowed(2 * SIDE, 2 * SIDE, "RGBA32F") as target:
        target.clear()
        for row, backward in enumerate(DIRECTIONS):
            view = overview(low, high, backward)
            rows = {name: view[name] for name in ("row_x", "row_y", "row_w", "row_q")}
            constants = {**rows, "near": 0.5}
            lot = {"light_point": (*backward, 0.0), "sample_index": row}
            for column, (program, bindings, more) in enumerate(
                ((materials.caster_program(material), by_lot, lot), (OPAQUE, whole, {}))
            ):
                viewport = (column * SIDE, row * SIDE, SIDE, SIDE)
                _draw(target, viewport, program, geometry, own, {**bindings, "constants": {**constants, **more}})
        counts = images.read(target.colors[0])[..., 3].astype(float)
    kept, drawn = counts[:, :SIDE].sum() / BY_LOT, counts[:, SIDE:].sum()
    return float(np.clip(kept / drawn, 0.0, 1.0)) if drawn > 0 else materials.compiled[material].opacity


def _draw(target, viewport, program: Program, geometry: SceneGeometry, own: list[int], bindings: dict) -> None:
    """Add up what is drawn in each pixel."""
    shader = passes.get(program)
    with passes.drawing(target, viewport=viewport, blend="ADDITIVE_PREMULT", depth_test="NONE", depth_write=False):
        constants = bindings["constants"] | {"first_instance": 0}
        shader.bind(**{**bindings, "constants": constants})
        for call in calls(geometry.draws, own):
            shader.set_constant("first_instance", call.first)
            passes.draw(shader, call.draw.batch, call.count)
