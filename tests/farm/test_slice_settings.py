"""Slices of one picture have the same settings of Candela: which of them count, and what becomes of other slices."""

import bpy
import pytest

from addon.cli import slices
from addon.cli.refused import Refused
from addon.cli.slices import settings_hash


@pytest.fixture
def scene(registered, empty_scene):
    """A cube with a material, a lamp, a camera and a world."""
    scene = empty_scene
    mesh = bpy.data.meshes.new("Cube")
    mesh.materials.append(bpy.data.materials.new("Skin"))
    camera = bpy.data.cameras.new("Camera")
    for name, data in (("Cube", mesh), ("Lamp", bpy.data.lights.new("Lamp", "POINT")), ("Camera", camera)):
        scene.collection.objects.link(bpy.data.objects.new(name, data))
    scene.camera = scene.objects["Camera"]
    scene.world = bpy.data.worlds.new("World")
    return scene


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("bounces", 0),
        ("seed", 5),
        ("samples", 16),
        ("motion_steps", 4),
        ("use_denoise", False),
        ("denoise_strength", 0.5),
        ("slot_shadow", "OFF"),
        ("split_light_groups", True),
    ],
)
def test_settings_of_the_scene_count(scene, name, value):
    before = settings_hash(scene)
    default = getattr(scene.candela, name)
    setattr(scene.candela, name, value)
    assert settings_hash(scene) != before
    setattr(scene.candela, name, default)
    assert settings_hash(scene) == before


def test_which_samples_are_drawn_does_not_count(scene):
    before = settings_hash(scene)
    settings = scene.candela
    settings.time_limit, settings.noise_threshold = 3.0, 0.1
    assert settings_hash(scene) == before
    settings.sample_offset, settings.sample_count = 8, 8
    assert settings_hash(scene) == before
    settings.viewport_samples, settings.use_viewport_denoise = 5, False
    assert settings_hash(scene) == before


def test_settings_of_data_blocks_count(scene, tmp_path):
    skin, cube = bpy.data.materials["Skin"].candela, scene.objects["Cube"].candela
    seen = [settings_hash(scene)]
    skin.grass_patch = "FILE"
    seen.append(settings_hash(scene))
    skin.grass_file = str(tmp_path / "a.grass")
    assert settings_hash(scene) == seen[-1]  # no file
    (tmp_path / "a.grass").write_bytes(b"a meadow")
    seen.append(settings_hash(scene))
    cube.reflection_editing_constraints.add()
    seen.append(settings_hash(scene))
    scene.camera.data.candela.glare_mode = "CONVOLUTION"
    seen.append(settings_hash(scene))
    assert len(set(seen)) == len(seen)
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "a.grass").rename(tmp_path / "elsewhere" / "b.grass")
    skin.grass_file = str(tmp_path / "elsewhere" / "b.grass")
    assert settings_hash(scene) == seen[-1]  # another machine may have it at another place


def test_slices_of_other_settings_are_refused(tmp_path):
    alike = {"scene_hash": "a", "settings_hash": "b", "total": 16}
    parts = [slices.Part(tmp_path / f"{k}.exr", dict(alike)) for k in range(2)]
    slices.of_one_picture(parts)
    parts[1].about["settings_hash"] = "c"
    with pytest.raises(Refused, match=r"0.exr and 1.exr are slices of different pictures: settings of Candela"):
        slices.of_one_picture(parts)
