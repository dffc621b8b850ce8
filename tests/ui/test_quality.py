"""Quality presets: they are found by Blender, set what they name, and cost more the finer they are."""

import ast

import bpy
import pytest

from addon.frame.settings import SAMPLES
from addon.frame.technique import SCENE, identifier
from addon.techniques import REGISTRY
from addon.ui import quality

NAMES = ("Draft", "Fast", "Balanced", "Fine")  # from coarse to fine
KINDS = ("Night", "Product")  # of scenes


def files():
    found = {}
    for folder in bpy.utils.preset_paths(quality.FOLDER):
        found |= {path.stem: path for path in quality.Path(folder).glob("*.py")}
    return found


def values(scene, name):
    assert bpy.ops.candela.quality_preset(filepath=str(files()[name])) == {"FINISHED"}
    return set_by_presets(scene)


def set_by_presets(scene):
    own = scene.candela
    return (
        own.samples, own.viewport_samples, own.accumulated_maps_texels_per_pixel, own.instant_radiosity_virtual_lights,
        own.instant_radiosity_rays, own.light_probes_maps, own.multires_radiosity_virtual_lights,
        own.multires_radiosity_rays, own.clustered_visibility_virtual_lights,
    )  # fmt: skip


def declared():
    """What a preset may set, by the name of its property: parameters of the scene as techniques declare them."""
    own = {
        identifier(technique.name, param.name): param for technique in REGISTRY for param in technique.params_of(SCENE)
    }
    return own | {"samples": SAMPLES, "viewport_samples": SAMPLES}


def written(path):
    """name -> value of a preset's file, read without running it."""
    found = {}
    for line in ast.parse(path.read_text(encoding="utf-8")).body[3:]:
        (target,) = line.targets
        assert target.value.id == "candela" and target.attr not in found
        found[target.attr] = ast.literal_eval(line.value)
    return found


@pytest.mark.parametrize("name", (*NAMES, *KINDS))
def test_presets_set_what_techniques_declare_to_values_that_they_allow(name):
    params = declared()
    for own, value in written(quality.Path(quality.PATH, "presets", quality.FOLDER) / f"{name}.py").items():
        assert own in params, f"{name} sets {own}, which no technique declares."
        assert type(value) is type(params[own].default), own
        assert params[own].check(value) == value


def test_presets_set_the_same_parameters():
    names = [set(written(quality.Path(quality.PATH, "presets", quality.FOLDER) / f"{name}.py")) for name in NAMES]
    assert all(own == names[0] for own in names)


@pytest.fixture
def scene(registered, empty_scene):
    return empty_scene


def test_presets_come_with_candela(scene):
    assert {*NAMES, *KINDS} <= set(files())


def test_finer_presets_take_more_of_everything(scene):
    draft, fast, balanced, fine = (values(scene, name) for name in NAMES)
    assert all(a < b < c for a, b, c in zip(fast, balanced, fine, strict=True))
    assert all(a <= b for a, b in zip(draft, fast, strict=True)) and sum(a < b for a, b in zip(draft, fast)) >= 6


def test_fast_presets_have_no_soft_maps_nor_near_bounces_and_fine_has_finer_maps_of_the_world(scene):
    soft_maps, texels, bounces = [], [], []
    for name in NAMES:
        values(scene, name)
        soft_maps.append(scene.candela.shadows_by_light_soft_maps)
        texels.append(scene.candela.environment_light_texels_per_pixel)
        bounces.append(scene.candela.multires_radiosity_near_bounces)
        assert scene.candela.clustered_visibility_near_bounces == bounces[-1]
    assert soft_maps == bounces == [False, False, True, True]
    assert texels == [1.0, 1.0, 1.0, 2.0]


def test_balanced_is_what_a_new_scene_has(scene):
    new = set_by_presets(scene)
    assert values(scene, "Balanced") == new


def test_what_a_preset_does_not_name_gets_its_default(scene):
    values(scene, "Night")
    assert scene.candela.direct_light_lights_per_sample == 48
    values(scene, "Product")
    assert scene.candela.direct_light_lights_per_sample == 16 and scene.candela.traced_refraction_interfaces == 16


def test_a_preset_that_is_not_there_loses_nothing(scene, tmp_path):
    scene.candela.samples = 77
    with pytest.raises(RuntimeError, match="There is no preset at"):
        bpy.ops.candela.quality_preset(filepath=str(tmp_path / "gone.py"))
    assert scene.candela.samples == 77


def test_each_preset_says_in_its_tooltip_what_it_is_for(scene):
    said = [quality.about(files()[name]) for name in (*NAMES, *KINDS)]
    assert all(20 < len(text) < 130 for text in said) and len(set(said)) == len(said)
    assert quality.about(quality.Path("nowhere.py")) == ""


def test_a_preset_of_the_artist_may_hold_every_parameter(scene):
    for name in quality.CANDELA_OT_quality_preset_add.preset_values:
        assert name.removeprefix("candela.") in scene.candela.bl_rna.properties
