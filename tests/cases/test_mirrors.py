"""Mirrors that stand opposite one another, and what stands beside them."""

import math

import pytest

from .conftest import agree


@pytest.mark.slow
@pytest.mark.parametrize(("floor", "wall"), [(0.5, 0.5), (0.5, 0.0)])
def test_a_highlight_that_one_mirror_sees_in_another_lights_nothing_else(stage, beside, floor, wall):
    """A sun over two mirrors, and a wall beside them that only the dim sides of their lobes light: it had up to seven
    times as much."""

    def mirror(roughness):
        return stage.principled(Metallic=1.0, Base_Color=(0.9, 0.9, 0.9, 1), Roughness=roughness)

    low, high = (-2, -2), (2, 2)
    stage.rectangle(low, high, material=mirror(floor))
    stage.rectangle(low, high, material=mirror(wall), location=(0, 2, 2), turn=(math.pi / 2, 0, 0))
    stage.rectangle(low, high, material=stage.diffuse(0.6), location=(2, 0, 2), turn=(0, -math.pi / 2, 0))
    stage.light("SUN", angle=0.1, energy=10.0, turn=(0.6, 0.3, 0))
    stage.camera((-2.5, -4, 2.2), (1.45, 0, -0.5))
    own, cycles = beside(8, size=(24, 24), bounces=1, reference=128)
    agree(*(passes["diffuse_indirect"][6:18, 18:22].mean((0, 1)) for passes in (own, cycles)))


@pytest.mark.slow
def test_highlights_of_lamps_behind_glass_are_as_bright_as_they_are(stage, beside):
    """Rays find the lamp through the pane, and so do points on it: they shared it as if the lamp stood at the pane's
    distance, and the highlight was a fifth too bright."""
    stage.rectangle((-1, -1), (1, 1), material=stage.principled(Metallic=1.0, Roughness=0.25), turn=(math.pi / 2, 0, 0))
    corners = [(x, y, z) for x in (-4, 4) for y in (-2, -1.9) for z in (-3, 3)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    stage.mesh(corners, faces, material=stage.material("ShaderNodeBsdfGlass", Roughness=0.0, IOR=1.2))
    shine = stage.material("ShaderNodeEmission", Strength=20.0)
    stage.rectangle((-1, -1), (1, 1), material=shine, location=(2, -4, 1), turn=(math.pi / 2, 0, 0.45))
    stage.camera((0, -6, 0), (math.pi / 2, 0, 0), 0.3)
    own, cycles = beside(16, size=(16, 16), reference=512)
    agree(*(passes["combined"][..., :3].mean((0, 1)) for passes in (own, cycles)))
