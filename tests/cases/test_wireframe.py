"""Wireframe nodes: edges of triangles, in metres and in pixels, beside Cycles."""

import numpy as np
import pytest

from addon.snapshot.shape import corner_numbers

from .conftest import agree


@pytest.mark.parametrize("corners", [3, 4, 5, 9])
def test_corners_of_every_triangle_have_three_numbers(corners):
    """Fans and strips of faces of one kind: corners are shared within a face alone."""
    fan = np.array([(0, k + 1, k + 2) for k in range(corners - 2)])
    strip = [(k, k + 1, k + 2) for k in range(corners - 2)]
    faces = np.concatenate([fan, np.array(strip) + corners, np.flip(fan, axis=0) + 2 * corners])
    numbers = corner_numbers(faces, 3 * corners)
    assert (np.sort(numbers[faces], axis=1) == (0, 1, 2)).all()


def wires(stage, size, in_pixels):
    material = stage.material("ShaderNodeEmission")
    tree = material.node_tree
    node = tree.nodes.new("ShaderNodeWireframe")
    node.use_pixel_size, node.inputs["Size"].default_value = in_pixels, size
    tree.links.new(node.outputs[0], tree.nodes["Emission"].inputs["Color"])
    return material


@pytest.mark.parametrize(("size", "in_pixels"), [(0.12, False), (2.5, True)])
@pytest.mark.parametrize("tilted", [False, True])
def test_wires_as_wide_as_in_cycles(stage, beside, size, in_pixels, tilted):
    material = wires(stage, size, in_pixels)
    # A quad, a pentagon, a folded quad, a triangle, scaled.
    places = [(-1.6, -1.6, 0), (0.1, -1.7, 0), (0.2, 0.1, 0), (-1.5, 0.3, 0), (0.4, -1.6, 0), (1.7, -1.2, 0),
              (1.6, 0.2, 0), (1.0, 0.7, 0), (0.4, 0.2, 0), (-1.6, 0.6, 0), (-0.2, 0.5, 0.5), (0.0, 1.7, 0),
              (-1.7, 1.6, 0.6), (0.4, 1.0, 0), (1.7, 0.9, 0), (1.0, 1.7, 0)]  # fmt: skip
    faces = [(0, 1, 2, 3), (4, 5, 6, 7, 8), (9, 10, 11, 12), (13, 14, 15)]
    stage.mesh(places, faces, material=material, turn=(0.7, 0.2, 0.3) if tilted else (0, 0, 0), scale=(1.1, 0.9, 1.0))
    if tilted and not in_pixels:  # towards the edges of a wide lens Cycles' pixels are up to 6 % smaller
        stage.camera((0.3, -0.5, 5), (0.1, 0.05, 0), 0.8)
    else:
        stage.camera_above()
    own, cycles = (one["combined"][..., :3] for one in beside(16, (64, 64), 0, 16))
    assert cycles.mean() > 0.05
    agree(own.reshape(8, 8, 8, 8, 3).mean((1, 3)), cycles.reshape(8, 8, 8, 8, 3).mean((1, 3)))
    agree(own.mean((0, 1)), cycles.mean((0, 1)), 0.02, 0.0)


def test_wires_light_what_is_near(stage, beside):
    material = wires(stage, 0.2, False)
    stage.rectangle((-1.5, -1.5), (1.5, 1.5), 1.0, material=material).visible_camera = False
    stage.rectangle((-2, -2), (2, 2), material=stage.diffuse(0.8))
    stage.camera_above()
    own, cycles = (one["combined"][..., :3].reshape(4, 8, 4, 8, 3).mean((1, 3)) for one in beside(32, (32, 32), 0, 256))
    agree(own, cycles)
