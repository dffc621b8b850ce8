"""Tuning from the render panel: an operator that measures, and another that applies what was found."""

import bpy
import pytest

from addon.cli import tuning as saved
from addon.compare import reference, tune
from addon.frame import ledger
from addon.ui import tuning
from addon.ui.pass_run import render_steps


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


def layers_with_samples(scene):
    other = scene.view_layers.new("Other")
    scene.view_layers[0].samples, other.samples = 64, 0
    return list(scene.view_layers)


def test_applied_samples_count_in_view_layers_that_had_their_own(floor, monkeypatch):
    layers = layers_with_samples(floor)
    trial = tune.Trial(tune.Candidate(7), tune.Picture(0.1, 0.1, ()))
    monkeypatch.setattr(tuning, "_found", tuning.Found(floor.session_uid, [trial], trial, 0.2))
    row = (f"Samples of view layer {layers[0].name}", "64", "the scene's")
    assert tuning.changes(floor, trial.candidate) == [("Samples", "1000", "7"), row]
    assert bpy.ops.candela.tune_apply() == {"FINISHED"}
    assert [tuning.settings_of(floor, False, layer=layer).samples for layer in layers] == [7, 7]
    assert tuning.changes(floor, trial.candidate) == []


def test_saved_samples_count_in_view_layers_that_had_their_own(floor, tmp_path):
    layers_with_samples(floor)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "before.blend"))
    saved.save(tmp_path / "before.blend", floor.name, tune.Candidate(7), tmp_path / "after.blend")
    for name, expected in (("before", [64, 1000]), ("after", [7, 7])):
        bpy.ops.wm.open_mainfile(filepath=str(tmp_path / f"{name}.blend"))
        scene = bpy.context.scene
        found = [tuning.settings_of(scene, False, layer=layer).samples for layer in scene.view_layers]
        assert found == expected


def test_auto_is_a_choice_of_its_own_and_what_is_off_stays_off(floor):
    floor.candela.slot_shadow, floor.candela.slot_indirect = "vssm", "OFF"
    found = tuning.choices(floor)
    assert "indirect" not in found
    assert found["shadow"][0] == "vssm" and found["shadow"].count("vssm") == 1
    assert "AUTO" not in found["shadow"] and len(found["shadow"]) > 1
    floor.candela.slot_shadow = "AUTO"
    named = [technique.name for technique in tuning.REGISTRY if "shadow" in technique.fills]
    assert tuning.choices(floor)["shadow"] == ["AUTO", *named]
    own = {slot: names[0] for slot, names in tuning.choices(floor).items()}
    assert tuning.changes(floor, tune.Candidate(floor.candela.samples, tuple(own.items()))) == []


@pytest.mark.slow
@pytest.mark.timing  # within 12 seconds it is to come to parameters
def test_a_scene_with_relief_glare_and_ends_of_its_own_is_tuned_by_numbers_of_the_scene(floor, monkeypatch):
    """Relief's numbers are the material's, those of glare the camera's; neither is tried."""
    plane = next(thing for thing in floor.objects if thing.type == "MESH")
    plane.data.materials.append(displaced())
    dazzling(floor)
    floor.candela.time_limit, floor.candela.noise_threshold = 0.001, 1.0
    floor.candela.sample_offset, floor.candela.sample_count = 1, 1
    monkeypatch.setattr(tuning, "choices", lambda _: {})  # so that the phase of the parameters is reached soon
    options = bpy.context.window_manager.candela_tuning
    options.milliseconds, options.budget = 300, 12
    assert bpy.ops.candela.tune() == {"FINISHED"}
    found = tuning.latest(floor)
    assert {"relief", "glare"} <= set(found.best.picture.ran)
    assert any(trial.candidate.values for trial in found.trials)
    for name, _ in tuning.properties(found.best.candidate):
        assert name in floor.candela.bl_rna.properties
    assert bpy.ops.candela.tune_apply() == {"FINISHED"}


def dazzling(scene):
    """A small bright square, and a camera that it dazzles."""
    bpy.ops.mesh.primitive_plane_add(size=0.2, location=(1, 1, 3))
    material = bpy.data.materials.new("Glow")
    if bpy.app.version < (5, 0):
        material.use_nodes = True
    shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    shader.inputs["Emission Color"].default_value = (1, 1, 1, 1)
    shader.inputs["Emission Strength"].default_value = 1e4
    bpy.context.object.data.materials.append(material)
    scene.camera.data.candela.glare_mode = "CONVOLUTION"


def displaced():
    material = bpy.data.materials.new("Waves")
    if bpy.app.version < (5, 0):
        material.use_nodes = True  # later versions have it on and warn about the property
    material.candela.relief_mode, material.displacement_method = "RELIEF", "DISPLACEMENT"
    nodes, links = material.node_tree.nodes, material.node_tree.links
    noise, lift = nodes.new("ShaderNodeTexNoise"), nodes.new("ShaderNodeDisplacement")
    links.new(noise.outputs[0], lift.inputs["Height"])
    output = next(node for node in nodes if node.type == "OUTPUT_MATERIAL")
    links.new(lift.outputs[0], output.inputs["Displacement"])
    return material


def test_a_measured_picture_has_all_samples_that_are_asked_for(floor):
    floor.candela.time_limit, floor.candela.noise_threshold = 0.001, 1.0
    floor.candela.sample_offset, floor.candela.sample_count = 1, 1
    settings = tuning.changed(tuning.settings_of(floor, viewport=False), tune.Candidate(3), 1)
    steps = render_steps(floor, bpy.context.evaluated_depsgraph_get(), (32, 24), settings)
    with pytest.raises(StopIteration) as ended:
        while True:
            next(steps)
    assert ended.value.value.ledger.samples == 3
    passes = reference.render_passes(floor, "CANDELA", 3)
    assert passes.samples == ledger.latest().samples == 3
    assert (floor.candela.sample_offset, floor.candela.sample_count) == (1, 1)
    assert floor.candela.time_limit > 0.0 and floor.candela.noise_threshold == 1.0
