"""Soap, oil and tempered metal: surfaces under a film that is as thin as waves of light are long, beside Cycles."""

import bpy
import pytest

from .conftest import agree


@pytest.mark.slow
def test_thin_films_have_the_colours_that_cycles_gives_them(stage, beside):
    """A dielectric, a metal of two colours, one by its index, and glass, lit by world and sun; smooth and rough."""
    film = {"Thin_Film_Thickness": 450.0, "Thin_Film_IOR": 1.4}
    metallic = {"Base_Color": (0.9, 0.7, 0.4, 1), "Metallic": 1.0}
    materials = [
        stage.principled(Base_Color=(0.1, 0.1, 0.1, 1), Roughness=0.3, **film),
        stage.principled(Roughness=0.0, **metallic, **film),
    ]
    if bpy.app.version >= (5, 0):
        materials += [
            stage.material("ShaderNodeBsdfMetallic", Roughness=0.5, **film),
            stage.material("ShaderNodeBsdfGlass", Roughness=0.0, IOR=1.1, **film),
        ]
    for k, material in enumerate(materials):
        stage.rectangle((k - 2, -1), (k - 1, 1), material=material, turn=(0.6, 0, 0))
    stage.world((1, 1, 1), 0.5)
    stage.light("SUN", angle=0.6, energy=2.0, turn=(-0.5, 0, 0))
    stage.camera((0, 0, 6), (0, 0, 0), 0.65)
    own, cycles = beside(8, size=(32, 16), bounces=0)
    for k in range(len(materials)):
        agree(
            *(passes["combined"][6:10, 8 * k + 2 : 8 * k + 6, :3].mean((0, 1)) for passes in (own, cycles)), 0.03, 0.01
        )
