"""Displaced materials of one topology, some drawn by moved vertices and some by relief, in one scene."""

import pytest

from bench.case_scenes import displacing

from .conftest import agree


@pytest.mark.slow
def test_relief_and_moved_vertices_of_one_topology(stage, beside):
    stage.rectangle((-1.8, -1.8), (1.8, 0), material=displacing(stage, "DISPLACEMENT", 1.0, 0.1))
    for k in range(2):
        side = [0.02 * n for n in range(71)]
        grid = [(x, y, 0.0) for y in side for x in side]
        faces = [(n + 71 * m, n + 1 + 71 * m, n + 72 + 71 * m, n + 71 + 71 * m) for m in range(70) for n in range(70)]
        material = displacing(stage, "DISPLACEMENT", 1.0 + k, 0.1)
        stage.mesh(grid, faces, material=material, location=(1.7 * k - 1.6, 0.2, 0)).data.shade_smooth()
    stage.camera_above()
    stage.light("SUN", turn=(0.5, 0.2, 0), energy=2.0)
    own, cycles = beside(8, (32, 32), 0, 32)
    agree(own["combined"][17:30, 3:29, :3].mean((0, 1)), cycles["combined"][17:30, 3:29, :3].mean((0, 1)))
