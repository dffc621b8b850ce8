"""Isolated bright pixels are counted where one stands alone, and not where light is bright over several."""

import argparse
from types import SimpleNamespace

import numpy as np
import pytest

import addon
from addon.compare import reference
from bench import bright
from bench.bright import around, came_by, isolated, wrong


def test_a_pixel_alone_counts_and_a_spot_does_not():
    light = np.full((8, 8), 0.1)
    light[2, 2] = 0.6
    light[5:7, 5:7] = 0.6
    light[0, 7] = 0.6
    assert np.argwhere(isolated(light)).tolist() == [[0, 7], [2, 2]]
    assert np.allclose(around(np.ones((3, 4)), whole=True), 1.0)


def test_a_small_lamp_that_the_truth_has_is_not_wrong():
    light = np.full((8, 8), 0.1)
    light[2, 2] = light[5, 5] = 5.0
    truth = np.full((8, 8), 0.1)
    truth[2, 2] = 4.0
    assert np.argwhere(wrong(light, truth)).tolist() == [[5, 5]]


def test_a_bright_pixel_is_of_the_path_that_its_surroundings_lack():
    images = {f"{lobe}_color": np.ones((4, 4, 3)) for lobe in ("diffuse", "glossy")}
    images |= {"diffuse_direct": np.full((4, 4, 3), 0.5), "glossy_indirect": np.full((4, 4, 3), 0.1)}
    images["glossy_indirect"][1, 2] = 5.0
    found = np.zeros((4, 4), bool)
    found[1, 2] = True
    assert came_by(images, found) == {"glossy indirect": 1}


@pytest.fixture
def counted(monkeypatch, tmp_path):
    """Runs `--before` of one scene whose pictures are given; whether the other process has been ended."""
    ended = []

    def counted(before, now, truth):
        def passes(light):
            combined = np.repeat(light[..., None], 4, axis=2)
            return {"combined": combined, "diffuse_color": np.ones_like(combined), "diffuse_direct": combined}

        pictures = {"CANDELA": now, "CYCLES": truth}
        older = SimpleNamespace(asked=lambda *_: SimpleNamespace(pixels=passes(before)["combined"]))
        older.end = lambda: ended.append(older)
        monkeypatch.setattr(bright, "Version", lambda tree: older)
        monkeypatch.setattr(bright, "_opened", lambda name: None)
        monkeypatch.setattr(addon, "register", lambda: None)
        monkeypatch.setattr(
            reference, "render_passes", lambda scene, engine, *_, **__: SimpleNamespace(images=passes(pictures[engine]))
        )
        parser = argparse.ArgumentParser()
        bright.add_options(parser)
        bright.command(parser.parse_args(["room", "--before", str(tmp_path)]))

    return counted, ended


def test_pixels_of_an_older_tree_are_counted_beside_those_of_this_one(counted, capsys):
    truth, before = np.full((8, 8), 0.1), np.full((8, 8), 0.1)
    before[2, 2] = before[5, 5] = 5.0
    now = truth.copy()
    now[2, 2] = 5.0
    counted[0](before, now, truth)
    assert "| room | 2 | 1 | diffuse direct 1 |" in capsys.readouterr().out
    assert len(counted[1]) == 1


def test_the_other_process_is_ended_after_an_error_too(counted):
    with pytest.raises(ValueError, match="mismatch"):
        counted[0](np.ones((8, 8)), np.ones((8, 8, 3)), np.ones((8, 8)))
    assert len(counted[1]) == 1
