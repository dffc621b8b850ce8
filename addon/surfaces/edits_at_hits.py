"""Edits of reflections where rays meet edited objects: mirrors and glass show them edited.

The rotation is solved as for what the camera sees (shaders/edit/lobe.glsl), at the records of hits (hits.py), one pass
for each edited object and material of it. Distances along the surface come with the corners of triangles, in the order
in which hits number them. What enters an edited solid takes its edit along until it leaves (`carried`); where Freeze
keeps another view of it, it enters as it does in that (`entering`).

| cost | per round of rays |
|---|---|
| passes | 1 for each material of an edited object, and 2 |
| bytes per pixel | 32 |
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from ..frame.picture import Frame
from ..frame.technique import Service, Technique
from ..gfx import images, passes
from ..gfx.library import Program
from ..snapshot.scene import Instance
from . import reflection_edits
from .draw import SURFACE_TEXTURES
from .hits import MET, Hits, Records, closure_bindings
from .reflection_edits import EditTable

CARRY = passes.fullscreen_program(
    "edits that go with rays",
    "edit/carry.frag.glsl",
    textures=(("RGBA32F", "met_edit"),),
    outputs=(("VEC4", "out_edit"),),
)


@cache
def hit_program(texels: int) -> Program:
    """For objects whose corners have `texels` of distances."""
    return passes.fullscreen_program(
        "edits where rays meet them",
        "edit/hit.frag.glsl",
        textures=(
            *SURFACE_TEXTURES, *(("RGBA32F", name) for name in ("hit_triangle", "hit_normals")),
            ("RGBA32F", "ray_direction"), ("RGBA32F", "met_path"),
            ("R32F", "hit_material"), *((("RGBA32F", "hit_layers"),) if texels else ()),
        ),
        blocks=((reflection_edits.EDITS, "edits"),),
        constants=(
            ("INT", "instance_row"), ("INT", "material_number"), ("INT", "first_number"), ("FLOAT", "outward"),
            *reflection_edits.SOLVE_CONSTANTS,
        ),
        defines=(("LAYER_TEXELS", str(texels)),) if texels else (),
        outputs=(("VEC4", "out_edit"),),
    )  # fmt: skip


EDIT_HIT = (hit_program(0), hit_program(1))


@dataclass
class EditedObject:
    """An object of the scene with its edits, as hits find them."""

    row: int  # of its instance
    instance: Instance
    table: EditTable
    outward: float  # 1 or -1, as normals of its triangles point out of it or into it; 0: it is open
    layers: np.ndarray  # (V, 4 k) float32, distances of the vertices
    _lists: dict[int, images.Image] = field(default_factory=dict)  # by material

    def bound(self, frame: Frame) -> list[tuple[Program, dict]]:
        """For each of its materials the program, and what it binds of the object."""
        found, texels = [], self.layers.shape[1] // 4
        mesh = frame.snapshot.meshes[self.instance.mesh]
        for material, first, triangles in frame.kept(Hits).numbered(frame, self.instance):
            textures = {}
            if texels:
                if material not in self._lists:
                    vertices = mesh.corner_vertices[mesh.triangle_corners][triangles]
                    self._lists[material] = images.upload_list(self.layers[vertices].reshape(-1, 4))
                textures["hit_layers"] = self._lists[material]
            constants = {
                "instance_row": self.row, "material_number": material, "first_number": first, "outward": self.outward
            }  # fmt: skip
            found.append((hit_program(texels), {
                "textures": textures, "constants": constants | self.table.constants,
                "blocks": {"edits": self.table.block},
            }))  # fmt: skip
        return found


class EditsAtHits(Service):
    """Turns what rays meet, in one picture."""

    name = "edits_at_hits"

    def __init__(self, objects: Sequence[EditedObject], eyes: np.ndarray):
        """`eyes`: (E, 3) of views that edits keep, by their numbers."""
        self._objects = objects
        self._eyes = images.upload_list(np.pad(eyes, ((0, 0), (0, 1)))) if len(eyes) else None
        self._bound: list[tuple[Program, dict]] | None = None

    @contextmanager
    def entering(self, lobe: images.Image) -> Iterator[None]:
        """Passes by which light enters these surfaces know the eyes of views that edits keep."""
        if self._eyes is not None:
            lobe.beside["frozen_eyes"] = self._eyes
        try:
            yield
        finally:
            lobe.beside.pop("frozen_eyes", None)

    def begin(self, frame: Frame, first: images.Image) -> images.Target:
        """Two images of the pool: the edits at hits, and those that go with rays, at first those of the picture."""
        taken = images.Target(tuple(images.pool.take(*frame.size, "RGBA32F") for _ in range(2)))
        passes.copy(first, images.Target(taken.colors[1:]))
        return taken

    def solve(
        self, frame: Frame, technique: Technique, taken: images.Target, records: Records, closures: images.Target,
        rays: images.Target,
    ) -> None:  # fmt: skip
        """The edits of what was met; `rays`: origins, directions and paths that have met it."""
        if self._bound is None:
            self._bound = [one for made in self._objects for one in made.bound(frame)]
        at_hits = images.Target(taken.colors[:1], records.target.depth)
        images.Target(taken.colors[:1]).clear()
        met = {name: records.images[name] for name in ("hit_triangle", "hit_normals", "hit_material")}
        met |= {"ray_direction": rays.colors[1], "met_path": rays.colors[2], **closure_bindings(closures)}
        for program, bound in self._bound:
            passes.fullscreen(program, at_hits, where=MET, **bound | {"textures": met | bound["textures"]})
        passes.fullscreen(CARRY, images.Target(taken.colors[1:]), textures={"met_edit": taken.colors[0]})
        frame.count(technique, "passes", len(self._bound) + 1)
