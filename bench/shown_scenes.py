"""Scenes of the pictures on the pages of edits, glare and edges (`python -m bench strips edits sun sheet`)."""

from __future__ import annotations

import bpy
import numpy as np

from .auto_scenes import Walls
from .shading import one_shader


def _constrain(thing, point, target, viewer, of: str = "REFLECTION") -> None:
    """One constraint for the whole object, in its own space."""
    one = thing.candela.reflection_editing_constraints.add()
    one.point, one.target, one.viewer, one.of = point, target, viewer, of
    region = thing.candela.reflection_editing_regions.add()
    region.radius, region.border = 10.0, 0.0


def edits(name: str, edited: bool = True) -> None:
    """A chrome head that looks at a red wall instead of the floor, a glass ball that shows a lamp in its middle, and
    both in a mirror behind them."""
    eye, at = ((0, -4.2, 1.7), (0, 0, 0.75)) if name != "in a mirror" else ((0.3, 1.6, 1.5), (0, 4, 0.6))
    made = Walls(eye, at, 0.75 if name != "in a mirror" else 0.9)
    made.scene.render.filter_size = 1.5
    chrome = one_shader("Chrome", "ShaderNodeBsdfPrincipled", Base_Color=(1, 1, 1, 1), Metallic=1.0, Roughness=0.02)
    glass = one_shader("Glass", "ShaderNodeBsdfGlass", IOR=1.5, Roughness=0.0)
    made.room(3, 5, 3, ((0.7, 0.1, 0.08, 1), (0.1, 0.3, 0.7, 1)))
    made.floor(6, one_shader("Floor", "ShaderNodeBsdfDiffuse", Color=(0.4, 0.4, 0.38, 1)))
    made.block((1.6, 3.5, 0), (2.2, 4.1, 1.2), (0.9, 0.7, 0.05, 1))
    if name in ("head", "in a mirror"):
        head = made.add("monkey", (0, 0, 0.8), (-0.3, 0, 0), material=chrome, size=1.4)
        bpy.ops.object.shade_smooth()
        if edited:
            _constrain(head, (0.0, -0.6, 0.1), (-3.0, 0.5, 0.4), (0, -4.2, 0.9))
    if name == "glass ball":
        ball = made.add("uv_sphere", (0, 0, 0.8), radius=0.8, segments=64, ring_count=32, material=glass)
        bpy.ops.object.shade_smooth()
        if edited:
            _constrain(ball, (0.0, -0.79, 0.1), (1.9, 3.8, 0.0), (0, -4.2, 0.9), "REFRACTION")
    if name == "in a mirror":
        made.add("plane", (0, 4.95, 1.4), (np.pi / 2, 0, 0), (3, 2.4, 1), material=chrome, size=1.0)
    made.lamp("AREA", (0.5, -1, 2.9), size=1.0, energy=140.0)


def sun(name: str) -> None:
    """A low sun behind a wall, as the camera takes it and as an eye sees it."""
    made = Walls((0, -6, 1.5), (0, 0, 1.7), 0.8)
    made.scene.render.filter_size = 1.5
    made.floor(60)
    made.block((-2.2, 1, 0), (-0.9, 1.5, 2.0), (0.5, 0.3, 0.2, 1))
    sky = one_shader(
        "Sun", "ShaderNodeEmission", Color=(1.0, 0.85, 0.6, 1), Strength=20000.0 if name == "sun" else 300.0
    )
    made.add("uv_sphere", (6, 40, 11), radius=0.19, segments=24, ring_count=12, material=sky)
    made.sky((0.35, 0.45, 0.6), 0.3)
    made.sun((-0.15, -1, 0.28), 0.53, 2.0)
    data = made.scene.camera.data.candela
    data.glare_mode = "CONVOLUTION"
    if name == "pupil of 3 mm":
        data.eye_pupil = 3.0


def sheet(name: str) -> None:
    """A finely meshed sheet over a floor, and three panes that colour what they let pass."""
    made = Walls((0, -3.6, 2.4), (0, 0, 0.2), 0.8)
    made.scene.render.filter_size = 1.5
    made.floor(8)
    if name == "sheet":
        bpy.ops.mesh.primitive_grid_add(x_subdivisions=24, y_subdivisions=24, size=1.6, location=(0, 0, 0.8))
        thing = bpy.context.object
        for vertex in thing.data.vertices:
            vertex.co.z = 0.12 * np.sin(5 * vertex.co.x) * np.cos(4 * vertex.co.y)
        thing.data.materials.append(made.plain)
    else:
        for k, color in enumerate(((1, 0.1, 0.1, 1), (0.1, 1, 0.2, 1), (0.15, 0.2, 1, 1))):
            pane = one_shader(f"Pane {k}", "ShaderNodeBsdfTransparent", Color=color)
            made.add("plane", (0.8 * (k - 1), 0, 0.8), (0.2, 0, 0), (0.7, 1.2, 1), material=pane, size=1.0)
    made.lamp("AREA", (0.3, 0.3, 3), size=0.6, energy=120.0)
