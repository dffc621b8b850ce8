"""What the benchmark of shadows by edges computes, and the scenes that it makes."""

import numpy as np
import pytest

from bench import edge_scenes, edges


def test_samples_are_read_off_between_powers_of_four():
    errors = [0.2, 0.1, 0.05, 0.025]  # falls with the square root
    assert edges.samples_for(0.1, errors) == pytest.approx(4)
    assert edges.samples_for(0.0707107, errors) == pytest.approx(8, rel=1e-3)
    assert edges.samples_for(0.0125, errors) == pytest.approx(256)  # beyond what was measured, as before
    assert edges.samples_for(0.9, errors) == 1


def test_an_error_that_stays_is_never_reached():
    assert np.isinf(edges.samples_for(0.01, [0.2, 0.1, 0.05, 0.0499]))


@pytest.mark.parametrize("name", ("open and closed", "fence card", "crossed bars"))
def test_scenes_have_a_camera_a_lamp_and_things(name):
    scene = edge_scenes.build(name)
    kinds = [thing.type for thing in scene.objects]
    assert scene.camera is not None and kinds.count("LIGHT") == 1 and kinds.count("MESH") >= 2


def test_wires_have_the_triangles_of_the_fence():
    scene = edges.boxes(4, 0.2)
    edges._wires(scene)
    assert edges._count(scene.objects["Blockers"]) == 233_280
    assert scene.objects["Light"].data.size == pytest.approx(0.2)
