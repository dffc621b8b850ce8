"""Tuning from the render panel: an operator that measures, and another that applies what was found."""

import warnings

import bpy
import pytest

from addon import engine
from addon.compare import tune
from addon.ui import ENGINE, tuning


@pytest.fixture
def lit_floor(registered, gpu_context, empty_scene, tmp_path, monkeypatch):
    """A floor under a wide lamp, and options that make tuning quick."""
    monkeypatch.setenv("CANDELA_CACHE", str(tmp_path))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        bpy.ops.mesh.primitive_plane_add(size=8)
        bpy.ops.object.light_add(type="AREA", location=(0, 0, 4))
        bpy.context.object.data.energy = 400
        bpy.ops.object.camera_add(location=(0, 0, 8))
    scene = empty_scene
    scene.camera, scene.render.engine = bpy.context.object, ENGINE
    scene.render.resolution_x, scene.render.resolution_y = 64, 48
    scene.candela.bounces, scene.candela.samples = 0, 1000
    options = bpy.context.window_manager.candela_tuning
    options.milliseconds, options.reference_samples, options.percentage, options.budget = 200, 4, 50, 2
    yield scene
    engine.free_sessions()


def test_tuning_finds_a_curve_changes_nothing_and_applies_when_it_is_told(lit_floor):
    assert bpy.ops.candela.tune() == {"FINISHED"}
    found = tuning.latest(lit_floor)
    assert found.best in tune.front(found.trials)
    assert lit_floor.candela.samples == 1000
    assert any(name == "Samples" and now == "1000" for name, now, _ in tuning.changes(lit_floor, found.best.candidate))
    assert bpy.ops.candela.tune_apply() == {"FINISHED"}
    assert lit_floor.candela.samples == found.best.candidate.samples
    assert tuning.changes(lit_floor, found.best.candidate) == []
    fastest = tune.front(found.trials)[0]
    bpy.ops.candela.tune_apply(number=0)
    assert lit_floor.candela.samples == fastest.candidate.samples


def test_what_was_found_belongs_to_one_scene(lit_floor, monkeypatch):
    trial = tune.Trial(tune.Candidate(4), tune.Picture(0.1, 0.1, ()))
    monkeypatch.setattr(tuning, "_found", tuning.Found(lit_floor.session_uid, [trial], trial, 0.2))
    assert tuning.latest(lit_floor) is not None
    assert tuning.latest(bpy.data.scenes.new("Another")) is None


def test_a_scene_with_a_pass_tree_is_refused_with_a_sentence(lit_floor):
    bpy.ops.candela.passes_from_auto()
    with pytest.raises(RuntimeError, match="needs a scene without one"):
        bpy.ops.candela.tune()


def test_a_candidate_becomes_settings_and_properties_alike(lit_floor):
    name = ("instant_radiosity", "virtual_lights")
    candidate = tune.Candidate(7, (("shadow", "vssm"),), ((name, 12),))
    for own, value in tuning.properties(candidate):
        setattr(lit_floor.candela, own, value)
    applied = tuning.settings_of(lit_floor, viewport=False)
    asked = tuning.changed(applied, candidate, applied.seed)
    assert asked == applied
    assert (applied.samples, applied.slots["shadow"], applied.values[name]) == (7, "vssm", 12)
