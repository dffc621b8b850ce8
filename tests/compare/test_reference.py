"""Renders through Blender: pass names, Cycles as a reference, settings put back, the cache."""

import os
import sys
import time
from pathlib import Path

import bpy
import numpy as np
import pytest

from addon import whole_files
from addon.compare import beside, cache, reference
from addon.compare.passes import PASS_NAMES, light_paths
from addon.compare.reference import RenderFailed, render_passes


def settings_of(scene):
    """Every simple property of everything that a render may touch: owner and name -> value, and whether it is set."""
    owners = {
        "scene": scene,
        "render": scene.render,
        "image": scene.render.image_settings,
        "cycles": scene.cycles,
        "eevee": scene.eevee,
        **{f"layer {layer.name}": layer for layer in scene.view_layers},
        **{f"layer {layer.name} cycles": layer.cycles for layer in scene.view_layers},
    }
    values = {}
    for label, owner in owners.items():
        for prop in owner.bl_rna.properties:
            if (
                prop.type in {"BOOLEAN", "INT", "FLOAT", "STRING", "ENUM"} and prop.identifier != "use_nodes"
            ):  # deprecated
                value = getattr(owner, prop.identifier)
                value = tuple(value) if getattr(prop, "is_array", False) else value
                values[label, prop.identifier] = value, owner.is_property_set(prop.identifier)
    return values


@pytest.fixture
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("CANDELA_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def renders(monkeypatch):
    """Counts the renders that really happen."""
    calls = []
    real = reference.render_passes

    def counted(*arguments, **named):
        calls.append(arguments)
        return real(*arguments, **named)

    monkeypatch.setattr(reference, "render_passes", counted)
    return calls


def test_every_pass_of_the_name_map_comes_out_of_a_render(room):
    passes = render_passes(room, "CYCLES", 4)
    assert passes.images.keys() == {row.image for row in PASS_NAMES}
    assert passes.size == (16, 12)
    assert {name: image.shape[-1] for name, image in passes.images.items() if image.shape[-1] != 3} == {
        "combined": 4,
        "depth": 1,
    }
    for name in ("diffuse_direct", "glossy_direct", "glossy_indirect", "emission", "environment"):
        assert passes.images[name].max() > 0, name
    assert passes.seconds > 0


def test_light_paths_add_up_to_the_picture(room):
    passes = render_passes(room, "CYCLES", 8)
    paths = light_paths(passes.images)
    total = sum(image for name, image in paths.items() if name != "direct_light")
    np.testing.assert_allclose(total, passes.images["combined"][..., :3], rtol=1e-4, atol=1e-5)


def test_a_render_without_bounces_keeps_every_direct_pass(room):
    full, direct = (render_passes(room, "CYCLES", 16, direct_only=only) for only in (False, True))
    for name in (
        "diffuse_direct",
        "glossy_direct",
        "transmission_direct",
        "emission",
        "environment",
        "depth",
        "normal",
    ):
        np.testing.assert_array_equal(direct.images[name], full.images[name], err_msg=name)
    assert full.images["glossy_indirect"].max() > 0 and direct.images["glossy_indirect"].max() == 0


def test_the_sum_of_direct_paths_is_the_picture_without_bounces(room):
    full, direct = (render_passes(room, "CYCLES", 16, direct_only=only) for only in (False, True))
    paths = light_paths(full.images)
    np.testing.assert_allclose(paths["direct_light"], direct.images["combined"][..., :3], rtol=1e-4, atol=1e-5)


def test_the_world_behind_a_transparent_film_is_not_part_of_the_picture(room):
    room.render.film_transparent = True
    full, direct = (render_passes(room, "CYCLES", 4, direct_only=only) for only in (False, True))
    assert full.film_transparent and full.images["environment"].max() > 0
    paths = light_paths(full.images, full.film_transparent)
    np.testing.assert_allclose(paths["direct_light"], direct.images["combined"][..., :3], rtol=1e-4, atol=1e-5)


def test_the_same_seed_gives_the_same_picture_and_another_seed_another_one(room):
    one, again, other = (render_passes(room, "CYCLES", 4, seed).images["combined"] for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, again)
    assert np.abs(one - other).max() > 0


def test_seeds_differ_in_where_they_meet_a_pixel_too(room):
    one, other = (render_passes(room, "CYCLES", 4, seed).images["environment"] for seed in (1, 2))
    assert np.abs(one - other).max() > 0  # else the noise floor would not hold the error of the edges


def user_settings(scene, media, file_format):
    image = scene.render.image_settings
    if hasattr(image, "media_type"):
        image.media_type = media
    image.file_format = file_format


@pytest.mark.parametrize(
    ("media", "file_format", "more"),
    [
        ("IMAGE", "PNG", {"color_mode": "BW", "color_depth": "16"}),
        ("IMAGE", "JPEG", {"quality": 31}),
        ("IMAGE", "OPEN_EXR", {"color_depth": "16", "exr_codec": "DWAA"}),
        ("MULTI_LAYER_IMAGE", "OPEN_EXR_MULTILAYER", {"color_depth": "16", "exr_codec": "PIZ"}),
    ],
)
@pytest.mark.parametrize("fails", [False, True])
def test_every_setting_is_put_back(room, media, file_format, more, fails):
    user_settings(room, media, file_format)
    for name, value in more.items():
        setattr(room.render.image_settings, name, value)
    room.view_layers.new("Second").use_pass_normal = True
    room.render.use_border, room.render.border_max_x = True, 0.5
    room.render.use_multiview = True
    room.cycles.samples, room.cycles.sample_clamp_indirect = 777, 3.0
    if fails:
        room.camera = None
    before = settings_of(room)
    if fails:
        with pytest.raises(RenderFailed):
            render_passes(room, "CYCLES", 1, size=(20, 10))
    else:
        render_passes(room, "CYCLES", 1, size=(20, 10))
    assert settings_of(room) == before


def test_a_render_border_gives_the_bordered_rectangle_alone(room):
    whole = render_passes(room, "CYCLES", 1).images["depth"]
    room.render.use_border = True
    room.render.border_min_x, room.render.border_max_x = 0.25, 0.75
    room.render.border_min_y, room.render.border_max_y = 0.0, 0.5
    for crop in (False, True):
        room.render.use_crop_to_border = crop
        passes = render_passes(room, "CYCLES", 1)
        assert passes.size == (8, 6)
        np.testing.assert_allclose(passes.images["depth"], whole[:6, 4:12], rtol=0.1)


def test_the_view_layer_that_is_asked_for_is_rendered_alone(room):
    second = room.view_layers.new("Second")
    second.layer_collection.exclude = False
    other = bpy.data.collections.new("Other")
    room.collection.children.link(other)
    second.material_override = bpy.data.materials["Wall"]
    first, changed = (render_passes(room, "CYCLES", 2, view_layer=layer).images for layer in room.view_layers)
    assert first["diffuse_color"].max() > 0 and changed["diffuse_color"].max() == 0


def test_a_scene_without_camera_fails_with_a_sentence(room):
    room.camera = None
    with pytest.raises(RenderFailed, match=r"CYCLES could not render scene '.*': .*camera.*\.$"):
        render_passes(room, "CYCLES", 1)


def test_an_unknown_engine_fails_with_a_sentence(room):
    with pytest.raises(RenderFailed, match="The render engine LUXCORE is not available in this Blender"):
        render_passes(room, "LUXCORE", 1)
    assert room.render.engine == "CYCLES"


def test_eevee_has_one_name_in_every_version(room):
    names = {reference.engine_identifier(room, name) for name in reference.EEVEE}
    assert len(names) == 1 and names <= set(reference.EEVEE)


# The cache


def test_a_reference_is_the_mean_of_two_seeds(room, own_cache):
    one, other = (render_passes(room, "CYCLES", 4, seed).images for seed in reference.SEEDS)
    made = reference.reference(room, 4, use_cache=False)
    np.testing.assert_allclose(made.images["combined"], (one["combined"] + other["combined"]) / 2, rtol=1e-6)
    np.testing.assert_allclose(made.half["combined"], (one["combined"] - other["combined"]) / 2, rtol=1e-6)
    np.testing.assert_array_equal(made.images["depth"], one["depth"])
    assert not own_cache.exists()


def test_a_reference_that_was_made_is_not_rendered_again(room, own_cache, renders):
    made = reference.reference(room, 4)
    assert len(renders) == 2 and not made.cached
    found = reference.reference(room, 4)
    assert len(renders) == 2 and found.cached
    assert found.seconds == made.seconds and found.size == (16, 12)
    for name, image in made.images.items():
        np.testing.assert_array_equal(found.images[name], image)
        np.testing.assert_allclose(found.half[name], made.half[name], rtol=1e-3, atol=1e-6)


def test_the_file_opened_anew_finds_its_reference(room, own_cache, renders, tmp_path):
    path = str(tmp_path / "room.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    for _ in range(2):
        bpy.ops.wm.open_mainfile(filepath=path)
        reference.reference(bpy.context.scene, 2)
    assert len(renders) == 2


def test_what_the_user_set_for_output_and_engine_does_not_matter(room, own_cache, renders):
    reference.reference(room, 2)
    room.render.engine = "BLENDER_WORKBENCH"
    room.render.filepath = "//elsewhere.png"
    room.render.image_settings.file_format = "JPEG"
    room.cycles.samples = 9
    room.cycles.use_denoising = True
    reference.reference(room, 2)
    assert len(renders) == 2


def move_lamp(scene):
    bpy.data.objects["Lamp"].location.x += 0.001


def change_color(scene):
    shader = next(n for n in bpy.data.materials["Floor"].node_tree.nodes if n.type == "BSDF_PRINCIPLED")
    shader.inputs["Base Color"].default_value[0] += 0.001


def move_vertex(scene):
    bpy.data.meshes["Wall"].vertices[2].co.z += 0.001


def next_frame(scene):
    scene.frame_set(scene.frame_current + 1)


def other_filter(scene):
    scene.render.filter_size = 2.0


def paint_without_saving(scene):
    image = bpy.data.images.get("Painted") or bpy.data.images.new("Painted", 2, 2)
    image.use_fake_user = True
    image.pixels[0] = image.pixels[0] + 0.25


@pytest.mark.parametrize(
    "change", [move_lamp, change_color, move_vertex, next_frame, other_filter, paint_without_saving]
)
def test_a_changed_scene_is_rendered_again(room, own_cache, renders, change):
    change(room)
    reference.reference(room, 1)
    change(room)
    reference.reference(room, 1)
    assert len(renders) == (2 if change is other_filter else 4)  # the filter was changed once only


@pytest.mark.parametrize("name", ["caustics_reflective", "caustics_refractive"])
@pytest.mark.parametrize("on", [True, False])
def test_a_reference_has_caustics_where_the_scene_has(room, name, on):
    """Candela follows these switches, too."""
    setattr(room.cycles, name, on)
    assert dict(one[1:] for one in reference.cycles_settings(room, 1, 0, 4))[name] == on


def test_samples_size_and_bounces_are_part_of_the_key(room):
    layer = room.view_layers[0]
    keys = {
        reference.reference_key(room, samples, direct, size, layer)
        for samples in (1, 2)
        for direct in (False, True)
        for size in (None, (16, 12), (32, 24))
    }
    assert len(keys) == 2 * 2 * 2  # no size and the scene's own size are the same


def test_candelas_own_settings_leave_the_reference_valid(registered, room, own_cache, renders):
    reference.reference(room, 1)
    room.candela.samples = 5
    reference.reference(room, 1)
    assert len(renders) == 2


def test_a_damaged_entry_is_made_again(room, own_cache, renders):
    made = reference.reference(room, 1)
    path = cache.entry(own_cache, made.key)
    data = path.read_bytes()
    for damaged in (b"", data[: len(data) // 2], b"not a zip file", data[:-200] + bytes(200)):
        renders.clear()
        path.write_bytes(damaged)
        assert not reference.reference(room, 1).cached
        assert len(renders) == 2
        assert reference.reference(room, 1).cached


def test_a_cache_that_cannot_be_written_does_not_stop_the_comparison(room, own_cache, capsys):
    own_cache.write_text("a file where the folder should be")
    assert reference.reference(room, 1).images["combined"].shape == (12, 16, 4)
    assert "could not be kept" in capsys.readouterr().out


def test_nothing_half_written_stays_behind(room, own_cache):
    made = reference.reference(room, 1)
    assert [path for path in own_cache.rglob("*") if path.is_file()] == [cache.entry(own_cache, made.key)]


def kept_file(folder, name, age=0.0):
    """A file of 100 bytes beside the entries, last used `age` seconds ago."""
    path = folder / cache.FOLDER / name
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(bytes(100))
    os.utime(path, (time.time() - age,) * 2)
    return path


def names(folder):
    return sorted(path.name for path in (folder / cache.FOLDER).iterdir())


def test_the_oldest_references_make_room(tmp_path):
    for number in range(4):
        kept_file(tmp_path, f"{cache.MARK}{number}.npz", age=60.0 * (4 - number))
    cache.make_room(tmp_path, limit=250)
    assert names(tmp_path) == ["candela_2.npz", "candela_3.npz"]


def test_what_another_process_writes_is_left_alone(tmp_path):
    """Entries in the making are not counted and not deleted, unless their process was ended long ago."""
    kept_file(tmp_path, f"{whole_files.WRITING}now.npz")
    kept_file(tmp_path, f"{whole_files.WRITING}then.npz", age=2 * whole_files.ABANDONED_S)
    kept_file(tmp_path, "candela_old.npz", age=60.0)
    kept_file(tmp_path, "candela_new.npz")
    cache.make_room(tmp_path, limit=150)
    assert names(tmp_path) == [f"{whole_files.WRITING}now.npz", "candela_new.npz"]


def test_files_of_others_are_neither_counted_nor_deleted(tmp_path):
    """The folder may be one that holds arrays of somebody's own, however large and old."""
    mine = tmp_path / "simulation.npz"
    mine.write_bytes(bytes(1000))
    os.utime(mine, (0, 0))
    kept_file(tmp_path, "simulation.npz", age=1e6)
    (tmp_path / cache.FOLDER / "candela_link.npz").symlink_to(mine)
    kept_file(tmp_path, "candela_old.npz", age=60.0)
    kept_file(tmp_path, "candela_new.npz")
    cache.make_room(tmp_path, limit=150)
    assert mine.stat().st_size == 1000
    assert names(tmp_path) == ["candela_link.npz", "candela_new.npz", "simulation.npz"]


def test_where_references_are_kept(monkeypatch, tmp_path):
    monkeypatch.setenv("CANDELA_CACHE", str(tmp_path))
    assert reference.cache_folder() == tmp_path
    monkeypatch.delenv("CANDELA_CACHE")
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert reference.cache_folder() == tmp_path / "candela" / "references"
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    assert reference.cache_folder().is_relative_to(Path.home())


def test_the_second_blender_runs_no_scripts_of_the_file(tmp_path, monkeypatch):
    """A file that was opened as untrusted is handed on as a copy, of which Blender's preferences know nothing."""
    started = []

    class Ended:
        returncode = 0

        def __init__(self, command, **_):
            started.append(command)

        def __enter__(self):
            return self

        def __exit__(self, *_):
            pass

        def poll(self):
            return 0

    monkeypatch.setattr(beside.subprocess, "Popen", Ended)
    assert list(beside._watched(tmp_path / "scene.blend", tmp_path / "output.txt", {"samples": 1})) == []
    (command,) = started
    assert command.index("--disable-autoexec") < command.index(str(tmp_path / "scene.blend")), (
        "it holds for what follows"
    )


@pytest.mark.parametrize(
    ("output", "share", "said"),
    [
        ("Blender 5.2.2 LTS\n", 0.0, "1 of 2: Blender starts"),
        (
            "00:01.335  render           | Fra: 1 | Mem: 0M | Synchronizing object | Tall Block\n", 0.0,
            "1 of 2: Synchronizing object, Tall Block",
        ),
        ("00:02.4  render  | Fra: 1 | Mem: 1M | Sample 16/64\n", 0.125, "1 of 2: Sample 16/64"),
        ("x | Fra: 1 | Sample 64/64\nx | Fra: 1 | Mem: 1M | Sample 1/64\n", 0.5078125, "2 of 2: Sample 1/64"),
        (
            "Fra:1 Mem:9.5M (Peak 9.8M) | Time:00:00.11 | Mem:0.0M, Peak:0.0M | Scene, ViewLayer | Updating Lights\n",
            0.0, "1 of 2: Updating Lights",
        ),
    ],
)  # fmt: skip
def test_what_cycles_does_is_told_from_what_it_prints(output, share, said):
    assert beside.progress_of(output, 64, 2) == (share, f"Cycles renders the reference, {said}")
