"""The table of indirect light: every technique of the slot has its lines, and motion comes to an end where it began."""

from types import SimpleNamespace

import bpy  # noqa: F401 (mathutils is its)
import numpy as np
import pytest
from mathutils import Matrix, Vector

from bench import indirect, indirect_page


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


def test_the_page_has_every_technique_and_the_peers_and_leaves_out_what_cannot_be_compared():
    labels = [(series.label, samples) for series, samples in indirect_page.entrants(["instant_radiosity", "ssdo"])]
    assert labels[:3] == [("Auto", samples) for samples in (1, 16, 64)]
    assert labels[3:5] == [("instant_radiosity", samples) for samples in (1, 16)]
    assert {("ssdo", 16), ("EEVEE, ray traced", 16), ("Cycles, denoised", 4)} < set(labels)
    combined = {"relmse": 0.03, "floor": 0.01, "bias": 1.0}
    cells = indirect_page.cells({"times": [3.0, 1.0, 2.0], "errors": {"combined": combined}})
    assert cells == ("2.00", "0.0200", "1.000", "–", "–")
    about = {"date": "today", "blender": "5.2", "device": "GPU", "cpu": "CPU"}
    text = indirect_page.page(about, (96, 72), 256, {"room": [("Auto", "1", *cells)]}, [], [], [])
    assert "## room" in text and "| Auto | 1 | 2.00 | 0.0200 | 1.000 | – | – |" in text
    assert "## Growth" not in text


@pytest.mark.slow
def test_gather_of_regions_is_compared_with_that_of_every_pixel(registered):
    untraced, traced = indirect_page.gathers(("cornell_box",), (96, 72), 64)
    for name, _, regions, share, coarse, fine, ratio, _ in (untraced, traced):
        assert name == "cornell_box" and 0 < int(regions) < 96 * 72
        assert float(coarse) > 0 and float(fine) > 0 and float(ratio) > 0
        assert share.endswith(" %")
    assert float(untraced[-1].removesuffix(" %")) < 6.0
    assert (untraced[1], traced[1], traced[-1]) == ("0", "64", "noise")
