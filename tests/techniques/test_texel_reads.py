"""GPUs fetch texels from textures, software rasterisers load them from images: the picture is the same."""

import numpy as np
import pytest

from addon.gfx import library


@pytest.mark.slow
def test_the_picture_does_not_depend_on_how_texels_are_read(stage, monkeypatch):
    stage.floor(material=stage.principled(Roughness=0.3))
    stage.rectangle((-0.5, -0.3), (0.5, 0.3), 0.5, material=stage.diffuse(0.5))
    stage.light("AREA", (0.5, 0.7, 2), size=1.0)
    stage.world()
    stage.camera_above(4.0)
    pictures = []
    for loads in (False, True):
        monkeypatch.setattr(library, "loads_beat_fetches", lambda loads=loads: loads)
        monkeypatch.setattr(library, "_shaders", {})
        stage.render(seed=1)  # another picture, so that none is kept
        pictures.append(stage.render(2, bounces=2)["combined"])
        assert library._shaders
    assert pictures[0].any() and np.array_equal(*pictures)
