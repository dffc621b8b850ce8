"""Frames of an animation in one process: none depends on those before it, and memory stays flat."""

import numpy as np
import pytest

from addon import engine
from bench.memory import resident_bytes

FRAMES = 48


@pytest.fixture
def moving(stage):
    """A box that crosses the light of a lamp, on a floor with a wall."""
    stage.floor(material=stage.diffuse(0.6))
    stage.rectangle((-3, 0), (3, 3), material=stage.principled(Roughness=0.2), location=(0, 2, 0), turn=(1.5708, 0, 0))
    box = stage.rectangle((-0.5, -0.5), (0.5, 0.5), 0.8, material=stage.diffuse(0.8))
    for frame, x in ((1, -1.5), (FRAMES, 1.5)):
        box.location.x = x
        box.keyframe_insert("location", index=0, frame=frame)
    stage.light("AREA", (0, 0, 3), size=0.5)
    stage.camera((0, -5, 2.5), (1.15, 0, 0))

    def rendered(frame):
        stage.scene.frame_set(frame)
        return stage.render(1, (32, 24), bounces=2)["combined"]

    yield rendered
    stage.scene.frame_set(1)


def test_a_frame_is_the_same_after_others_and_alone(moving):
    *_, after = (moving(frame) for frame in (1, 2, 3))
    engine.free_sessions()
    np.testing.assert_array_equal(after, moving(3))


@pytest.mark.slow
def test_memory_stays_flat_over_an_animation(moving):
    sizes = []
    for frame in range(1, FRAMES + 1):
        moving(frame)
        sizes.append(resident_bytes())
    assert sizes[-1] - sizes[FRAMES // 4] < 32 * 2**20
