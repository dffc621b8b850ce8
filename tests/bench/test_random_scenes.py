"""Scenes made at random: the same number makes the same scene, and what differs is said."""

import argparse
from types import SimpleNamespace

import numpy as np
import pytest

from bench import long_runs, random_scenes


def test_a_number_makes_one_scene():
    scene, notes = random_scenes.build(3)
    placed = [(one.type, tuple(one.matrix_basis.translation)) for one in scene.objects]
    again, same = random_scenes.build(3)
    assert same == notes
    assert [(one.type, tuple(one.matrix_basis.translation)) for one in again.objects] == placed
    assert random_scenes.build(4)[1] != notes


def test_scenes_in_a_row_may_share_their_materials():
    """So that ten thousand of them do not compile for a day."""

    def described(number):
        scene, _ = random_scenes.build(number, alike=8)
        bases = [
            [
                tuple(node.inputs["Base Color"].default_value)
                for node in one.node_tree.nodes
                if node.type == "BSDF_PRINCIPLED"
            ]
            for one in scene.objects[0].data.materials
        ]
        return bases, [tuple(one.location) for one in scene.objects]

    (first, places), (second, others), (third, _) = (described(number) for number in (8, 15, 16))
    assert first == second != third
    assert places != others


@pytest.mark.parametrize("number", range(0, 40, 4))
def test_every_scene_holds_what_is_rendered(number):
    scene, notes = random_scenes.build(number)
    kinds = [one.type for one in scene.objects]
    assert scene.camera is not None and "LIGHT" in kinds and len(kinds) >= 5
    assert "material:" in notes


def picture(value):
    return {"direct_light": np.full((8, 8, 3), value, np.float32)}


@pytest.mark.parametrize(("value", "off"), [(1.0, False), (1.01, False), (1.05, True), (np.nan, True)])
def test_what_differs_by_more_than_noise_is_off(value, off):
    found, is_off = random_scenes.differences(picture(value), picture(1.0), picture(1.0), 0.01)
    assert is_off == off
    assert found[0].startswith("direct_light")


def test_worst_pixels_do_not_decide():
    own = picture(1.0)
    own["direct_light"][0, 0] = 1.02
    assert not random_scenes.differences(own, picture(1.0), picture(1.0), 1e-6)[1]


@pytest.fixture
def rendered(monkeypatch, tmp_path):
    """Numbers of the scenes that a command line of --alone would render, with so many bad pixels in each."""
    from addon.compare import reference
    from addon.frame import ledger

    seeds = []
    monkeypatch.setattr(long_runs, "KEPT", tmp_path)
    monkeypatch.setattr(reference, "render_passes", lambda scene, engine, samples, seed, **options: seeds.append(seed))

    def rendered(*arguments, bad=0):
        monkeypatch.setattr(ledger, "latest", lambda: SimpleNamespace(bad_pixels=bad))
        parser = argparse.ArgumentParser()
        random_scenes.add_options(parser)
        seeds.clear()
        options = parser.parse_args(["--alone", "0.2", "--size", "16x12", "--every", "1", *arguments])
        return list(seeds) if long_runs.alone(options) == int(bad > 0) else None

    return rendered


@pytest.mark.parametrize(("bad", "said"), [(0, "0 wrong"), (3, "3 pixels are not finite")])
def test_scenes_by_candela_alone_are_counted_and_what_is_wrong_is_said(rendered, capsys, tmp_path, bad, said):
    assert set(rendered("--same", bad=bad)) == {0}
    printed = capsys.readouterr().out
    assert said in printed and "1 scenes, " in printed and "MiB of images" in printed
    assert not list(tmp_path.iterdir())


def test_a_run_that_is_kept_goes_on_where_the_last_one_ended_and_figures_add_up(rendered, capsys, tmp_path):
    first = rendered("--keep", "--first", "7")
    second = rendered("--keep", bad=1)
    assert first[0] == 7 and first + second == list(range(7, 7 + len(first) + len(second)))
    (place,) = tmp_path.glob("*.json")
    runs = long_runs.read(place)
    assert [one.count for one in runs] == [len(first), len(second)] and all(one.ended for one in runs)
    assert [*runs[1].wrong] == [str(number) for number in second] and runs[0].resident[-1][0] == len(first)
    capsys.readouterr()
    assert rendered("--keep", "--alone", "0") == []
    assert f"{len(first) + len(second)} scenes in 2 runs, {len(second)} wrong" in capsys.readouterr().out


def raises_at_two(error):
    """In place of long_runs._render: it counts, and ends a run at its third scene."""

    def render(run, options):
        if run.count == 2:
            raise error
        run.count += 1

    return render


def test_a_scene_at_which_the_process_dies_is_wrong_and_the_next_run_begins_after_it(rendered, capsys, monkeypatch):
    with monkeypatch.context() as changed:
        changed.setattr(long_runs, "_render", raises_at_two(SystemExit))
        with pytest.raises(SystemExit):
            rendered("--keep", "--alone", "60")
    assert rendered("--keep")[0] == 3
    told = capsys.readouterr().out
    assert "1 wrong: [2]" in told and "1 runs without an end, at [2]" in told


def test_a_run_that_is_stopped_by_a_key_has_an_end(rendered, capsys, monkeypatch):
    with monkeypatch.context() as changed:
        changed.setattr(long_runs, "_render", raises_at_two(KeyboardInterrupt))
        rendered("--keep", "--alone", "60")
    assert "2 scenes in 1 runs, 0 wrong" in capsys.readouterr().out
    assert rendered("--keep")[0] == 2


def test_only_runs_that_drew_alike_are_joined(rendered, capsys):
    first = rendered("--keep")
    others = [rendered("--keep", *words)[0] for words in (["--size", "24x18"], ["--alike", "5"], ["--samples", "2"])]
    assert others == [0, 0, 0] and rendered("--keep")[0] == len(first)
    told = capsys.readouterr().out
    assert "random_opengl, 24x18, 1 alike, of 64 samples" in told and "in 2 runs" in told


def test_two_processes_do_not_keep_runs_in_one_file(rendered, capsys, tmp_path):
    rendered("--keep")
    (place,) = tmp_path.glob("*.json")
    before = place.read_text()
    with long_runs.only_here(place):
        assert rendered("--keep", bad=1) == []
    assert "Another process keeps its runs" in capsys.readouterr().out and place.read_text() == before
    assert rendered("--keep", "--same", bad=1) == []
