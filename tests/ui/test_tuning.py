"""Tuning from the render panel: an operator that measures, and another that applies what was found."""

import bpy
import pytest

from addon.compare import tune
from addon.ui import tuning


@pytest.fixture
def floor(lit_floor):
    """The floor with many samples, and options that make tuning quick."""
    lit_floor.candela.samples = 1000
    options = bpy.context.window_manager.candela_tuning
    options.milliseconds, options.reference_samples, options.percentage, options.budget = 200, 4, 50, 2
    return lit_floor


@pytest.mark.slow
def test_tuning_finds_a_curve_changes_nothing_and_applies_when_it_is_told(floor):
    assert bpy.ops.candela.tune() == {"FINISHED"}
    found = tuning.latest(floor)
    assert found.best in tune.front(found.trials)
    assert floor.candela.samples == 1000
    assert any(name == "Samples" and now == "1000" for name, now, _ in tuning.changes(floor, found.best.candidate))
    assert bpy.ops.candela.tune_apply() == {"FINISHED"}
    assert floor.candela.samples == found.best.candidate.samples
    assert tuning.changes(floor, found.best.candidate) == []
    fastest = tune.front(found.trials)[0]
    bpy.ops.candela.tune_apply(number=0)
    assert floor.candela.samples == fastest.candidate.samples


def test_what_was_found_belongs_to_one_scene(floor, monkeypatch):
    trial = tune.Trial(tune.Candidate(4), tune.Picture(0.1, 0.1, ()))
    monkeypatch.setattr(tuning, "_found", tuning.Found(floor.session_uid, [trial], trial, 0.2))
    assert tuning.latest(floor) is not None
    assert tuning.latest(bpy.data.scenes.new("Another")) is None


def test_a_scene_with_a_pass_tree_is_refused_with_a_sentence(floor):
    bpy.ops.candela.passes_from_auto(use=True)
    with pytest.raises(RuntimeError, match="needs a scene without one"):
        bpy.ops.candela.tune()


def test_a_candidate_becomes_settings_and_properties_alike(floor):
    name = ("instant_radiosity", "virtual_lights")
    candidate = tune.Candidate(7, (("shadow", "vssm"),), ((name, 12),))
    for own, value in tuning.properties(candidate):
        setattr(floor.candela, own, value)
    applied = tuning.settings_of(floor, viewport=False)
    asked = tuning.changed(applied, candidate, applied.seed)
    assert asked == applied
    assert (applied.samples, applied.slots["shadow"], applied.values[name]) == (7, "vssm", 12)
