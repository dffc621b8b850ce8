"""The table of indirect light: every technique of the slot has its lines, and motion comes to an end where it began."""

from types import SimpleNamespace

import numpy as np
import pytest
from mathutils import Matrix, Vector

from bench import indirect


def test_every_technique_of_the_slot_is_measured():
    assert indirect.techniques()[:2] == ["instant_radiosity", "multires_radiosity"]


def test_camera_and_light_move_with_every_frame_and_stand_again_where_they_were():
    camera = SimpleNamespace(matrix_world=Matrix.Translation((3.0, 4.0, 0.0)))
    light = SimpleNamespace(type="LIGHT", location=Vector((1.0, 0.0, 2.0)))
    scene = SimpleNamespace(camera=camera, objects=[SimpleNamespace(type="CAMERA"), light])
    places = [(light.location.x, np.array(camera.matrix_world)[0, 0]) for _ in indirect.frames(scene, 3)]
    assert [x for x, _ in places] == pytest.approx([1.0, 1.05, 1.1])
    assert len({turn for _, turn in places}) == 3
    assert light.location.x == 1.0
    assert camera.matrix_world == Matrix.Translation((3.0, 4.0, 0.0))


def test_errors_that_stand_still_bring_nothing_new(monkeypatch):
    truth = np.ones((4, 4, 3))
    monkeypatch.setattr(indirect, "reference", lambda *_: (truth, 0 * truth))
    monkeypatch.setattr(indirect, "frames", lambda _, count: iter(range(count)))
    steady = {"still": lambda: truth * 1.1, "flicker": lambda: truth * (1 + next(turns))}
    turns = iter([0.1, -0.1, 0.1, -0.1])
    scene = SimpleNamespace(candela=SimpleNamespace())
    monkeypatch.setattr(indirect, "render", lambda scene, *_: steady[scene.candela.slot_indirect]())
    still, flicker = indirect.moving(scene, list(steady), 4, 1, (4, 4))
    assert (float(still[1]), float(flicker[1])) == pytest.approx((0.0, 0.02 / 1.01), abs=1e-4)
    assert float(still[2]) == pytest.approx(0.01 / 1.01, abs=1e-4)
