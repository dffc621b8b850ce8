"""Jobs whose scene or view layer the artist leaves or removes between two steps."""

from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from addon.ui import compare_editor, jobs, pass_operators, tuning


@pytest.fixture
def chosen(lit_floor):
    """The scene with its second view layer shown, and another scene."""
    bpy.context.window.view_layer = lit_floor.view_layers.new("Chosen")
    lit_floor.candela.samples = 1
    bpy.data.scenes.new("Other")
    return lit_floor


def begun(operator, **options):
    """The work of an operator as in a window, with what it would report."""
    reported = []
    own = {name: getattr(operator, name) for name in ("_search", "_show") if hasattr(operator, name)}
    stand_in = SimpleNamespace(report=lambda kind, text: reported.append(text), **options)
    for name, function in own.items():
        setattr(stand_in, name, function.__get__(stand_in))
    return operator.work(stand_in, bpy.context)


def compare():
    bpy.context.window_manager.candela_comparison.samples = 1
    return begun(compare_editor.CANDELA_OT_compare)


def run_and_compare():
    bpy.ops.candela.passes_from_auto(tree="Passes")
    tree = bpy.data.node_groups["Passes"]
    tree.samples = 1
    return begun(pass_operators.CANDELA_OT_passes_run, tree="Passes", node="", compare=True)


class Enough(Exception):
    pass


@pytest.mark.parametrize("begin, module", [(compare, compare_editor), (run_and_compare, pass_operators)])
def test_the_reference_is_of_the_scene_and_layer_of_the_start(chosen, monkeypatch, begin, module):
    def asked(scene, samples, direct_only, size, view_layer):
        assert scene == chosen and view_layer.id_data == scene and view_layer.name == "Chosen"
        raise Enough

    monkeypatch.setattr(module, "reference_steps", asked)
    steps = begin()
    next(steps)
    bpy.context.window.scene = bpy.data.scenes["Other"]
    with pytest.raises(Enough):
        list(steps)


@pytest.mark.parametrize("begin", [compare, run_and_compare])
def test_a_layer_that_is_removed_meanwhile_is_a_sentence(chosen, begin):
    steps = begin()
    next(steps)
    chosen.view_layers.remove(chosen.view_layers["Chosen"])
    with pytest.raises(ValueError, match=r"has no view layer 'Chosen' any more\.$"):
        list(steps)


def test_tune_measures_the_scene_of_the_start(chosen, monkeypatch):
    def reference(*_):
        yield 0.0, "reference"
        mean = np.ones((4, 4, 3), np.float32)
        return SimpleNamespace(images={"combined": mean}, half={"combined": mean})

    def asked(scene, depsgraph, size, settings, profile):
        assert scene == chosen and depsgraph.scene.name == scene.name and depsgraph.view_layer.name == "Chosen"
        raise Enough

    monkeypatch.setattr(tuning, "reference_steps", reference)
    monkeypatch.setattr(tuning, "render_steps", asked)
    steps = begun(tuning.CANDELA_OT_tune)
    next(steps)
    bpy.context.window.scene = bpy.data.scenes["Other"]
    with pytest.raises(Enough):
        list(steps)
    assert bpy.context.scene.name == "Other"


def test_a_layer_is_found_by_name_in_its_scene_only(chosen):
    assert jobs.layer_named(chosen, "Chosen").id_data == chosen
    with pytest.raises(ValueError, match="Scene 'Other' has no view layer 'Chosen'"):
        jobs.layer_named(bpy.data.scenes["Other"], "Chosen")


@pytest.mark.parametrize("operator", ["passes_run", "passes_compare"])
def test_what_is_missing_is_one_sentence(registered, empty_scene, operator):
    with pytest.raises(RuntimeError, match=r"^Error: No pass tree is open: choose New from Auto first\.\s*$"):
        getattr(bpy.ops.candela, operator)()


def test_a_job_that_cannot_clean_up_has_ended_all_the_same(monkeypatch):
    def work():
        try:
            yield 0.0, "begun"
        finally:
            raise OSError("in use")

    ended = []
    job = SimpleNamespace(_work=work(), _end=ended.append, report=None)
    next(job._work)
    with pytest.raises(OSError, match="in use"):
        jobs.Job.modal(job, "context", SimpleNamespace(type="ESC", value="PRESS"))
    assert ended == ["context"]
    job._work = work()
    next(job._work)
    monkeypatch.setattr(jobs.Job, "running", job)
    with pytest.raises(OSError, match="in use"):
        jobs.Job.cancel(job, "context")
    assert jobs.Job.running is None
