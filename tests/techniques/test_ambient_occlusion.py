"""The pass Ambient Occlusion beside the form factor of a square, and within its distance."""

import numpy as np
import pytest

OPEN = ("Ambient Occlusion", "AO")  # the latter before Blender 5.0


def seen_of_square(half, height):
    """Share of the cosine-weighted hemisphere that a square covers, centred above a point that faces it."""
    x = half / height
    return 4 / np.pi * x / np.sqrt(1 + x * x) * np.arctan(x / np.sqrt(1 + x * x))


@pytest.mark.parametrize("distance", [10.0, 0.4])
def test_a_floor_under_a_square(written, distance):
    written.camera_above(0.1)
    written.floor()
    written.blocker((-1, -1), (1, 1), 0.8)
    written.world((0, 0, 0))
    written.scene.world.light_settings.distance = distance
    written.layer.use_pass_ambient_occlusion = True
    images = written.written("CANDELA", 16, size=(24, 16), bounces=0)
    (name,) = [name for name in OPEN if name in images]
    expected = 1.0 - seen_of_square(1.0, 0.8) if distance > 1.0 else 1.0
    assert images[name].mean() == pytest.approx(expected, abs=0.01)
    assert written.ledger.row("ambient_occlusion").state == "ran"
    assert images["header"]["candela.ViewLayer.samples"] == "16"
    assert images["Combined"].max() <= 1.0 and not images["Combined"][..., :3].any()
