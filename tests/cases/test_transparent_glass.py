"""Film > Transparent Glass: clear glass shows that nothing is behind it, up to a roughness."""

import bpy
import pytest

from .conftest import agree


@pytest.fixture
def hole(stage):
    """A transparent film before a grey world; a function that makes a pane of glass."""
    scene = stage.scene
    scene.render.film_transparent = scene.cycles.film_transparent_glass = True
    stage.world((0.5, 0.5, 0.5))
    stage.camera_above()

    def pane(**inputs):
        glass = stage.principled(**{"Transmission_Weight": 1.0, "Roughness": 0.0, **inputs})
        stage.rectangle((-1, -1), (1, 1), 0.05, material=glass)
        stage.rectangle((-1, -1), (1, 1), material=glass, turn=(3.14159, 0, 0))
        return glass

    yield pane
    scene.render.film_transparent = scene.cycles.film_transparent_glass = False
    scene.cycles.film_transparent_roughness = 0.1


def middle(passes):
    return passes["combined"][10:22, 10:22].mean((0, 1))


@pytest.mark.slow
@pytest.mark.parametrize("samples", [16, 64])
@pytest.mark.parametrize("through", [True, False])
def test_a_pane_is_as_transparent_as_in_cycles(stage, hole, beside, through, samples):
    hole()
    stage.scene.cycles.film_transparent_glass = through
    own, cycles = beside(samples)
    agree(middle(own), middle(cycles))
    assert (middle(own)[3] < 0.5) == through


@pytest.mark.slow
@pytest.mark.parametrize("inputs", [
    {"Base_Color": (0.9, 0.5, 0.2, 1)}, {"Roughness": 0.2}, {"Roughness": 0.08}, {"Transmission_Weight": 0.5},
])  # fmt: skip
def test_kinds_of_glass_are_as_in_cycles(stage, hole, beside, inputs):
    hole(**inputs)
    stage.scene.cycles.film_transparent_roughness = 0.1
    own, cycles = beside(128, reference=256)
    agree(middle(own), middle(cycles))


@pytest.mark.slow
def test_what_stands_behind_glass_is_there(stage, hole, beside):
    hole()
    stage.rectangle((-1, -1), (0, 1), -1.0, material=stage.material("ShaderNodeEmission", Color=(1, 0.5, 0.2, 1)))
    own, cycles = beside(64)
    for cell in (slice(9, 15), slice(18, 24)):
        agree(own["combined"][12:20, cell].mean((0, 1)), cycles["combined"][12:20, cell].mean((0, 1)))


@pytest.mark.slow
def test_a_ball_of_glass_has_a_hole(stage, hole, beside):
    bpy.ops.mesh.primitive_uv_sphere_add(radius=1.2, segments=64, ring_count=32)
    bpy.context.object.data.shade_smooth()
    bpy.context.object.data.materials.append(stage.principled(Transmission_Weight=1.0, Roughness=0.0))
    own, cycles = beside(64, reference=256)
    agree(middle(own), middle(cycles))
    agree(own["combined"].mean((0, 1)), cycles["combined"].mean((0, 1)))
