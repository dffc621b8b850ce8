"""Surfaces drawn by where they lie alone: one program for all materials that need no other to tell.

A view that looks past a caster, or for what a caster's light falls on, asks for depth, or places and normals. What a
material's own program finds there besides, with all of its textures, would be thrown away.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from ..frame.picture import Frame
from ..frame.technique import Technique
from ..gfx import images, passes
from ..gfx.library import Program
from ..gfx.struct import Block
from ..scene.culling import calls
from ..scene.joint_draws import JointDraws
from ..scene.materials import CAMERA_DEFINES
from ..scene.view import VIEW
from .draw import StandIns

PLACES = Program(
    name="places of surfaces",
    vertex="surface/places.vert.glsl",
    fragment="surface/places.frag.glsl",
    inputs=(("VEC3", "position"), ("INT", "local_instance")),
    varyings=(("smooth", "VEC3", "world_position"),),
    textures=(("RGBA32F", "instances"),),
    blocks=((VIEW, "film_view"),),
    constants=(("INT", "first_instance"),),
    defines=CAMERA_DEFINES,
    outputs=(("VEC4", "out_position"), ("VEC4", "out_normal")),
)


def told_by_place(frame: Frame, materials: Collection[int], alpha: bool) -> frozenset[int]:
    """Those of `materials` whose surfaces lie where their triangles do, and (`alpha`) hide what is behind them."""
    stand_ins = frame.shared(StandIns).of
    return frozenset(
        k for k in materials
        if (one := frame.materials.compiled[k]).own_surface is None and k not in stand_ins
        and not one.bounds_alone and not (alpha and one.transparent)
    )  # fmt: skip


def draw_places(
    frame: Frame, technique: Technique, target: images.Target, view: Block, rows: np.ndarray, materials: frozenset[int]
) -> None:
    """Draw `materials` (of told_by_place) as a view of fields `view` and `rows` x, y, w, q sees them, into images of
    place and normal with a depth buffer, which is not cleared."""
    geometry = frame.geometry
    joint = frame.kept(JointDraws).update(geometry, frame.materials)
    wanted = np.array([draw.material in materials for draw in geometry.draws], bool)
    seen = geometry.boxes.seen(rows) & wanted
    with passes.drawing(target):
        shader = passes.get(PLACES)
        constants = {"first_instance": 0}
        shader.bind(textures={"instances": geometry.instances}, blocks={"film_view": view}, constants=constants)
        if joint is not None:
            whole, left = joint.of(materials)
            seen &= left
            for part, runs in joint.calls(rows, whole):
                for first, count in runs:
                    passes.draw_range(shader, part.batch, first, count)
                    frame.count(technique, "triangles", count)
        for call in calls(geometry.draws, np.flatnonzero(seen)):
            shader.set_constant("first_instance", call.first)
            passes.draw(shader, call.draw.batch, call.count)
            frame.count(technique, "triangles", call.triangles)
    frame.count(technique, "passes")
