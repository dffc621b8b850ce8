"""Tiles rendered by Cycles: geometry, light, files, and runs that were stopped."""

import errno
import zipfile

import bpy
import numpy as np
import pytest

from addon.grass import generate, patch
from addon.grass.blades import SOIL, Recipe, blades_of
from addon.grass.directions import Rings
from addon.grass.table import finer_ratios

FEW_VIEWS, FEW_LIGHTS = Rings((0.0, 45.0), (1, 8)), Rings((0.0, 50.0), (1, 4))
TINY = generate.Order(Recipe(0.25, 0.1, 60), 16, FEW_VIEWS, FEW_LIGHTS, 4, finer=False)


def run(order, path):
    return list(generate.generate(order, path))


@pytest.fixture(scope="module")
def tiny(tmp_path_factory):
    path = tmp_path_factory.mktemp("grass") / "tiny.grass"
    run(TINY, path)
    return path


def render(view, light, recipe=TINY.recipe, texels=16, samples=4, change=None):
    order = generate.Order(recipe, texels, FEW_VIEWS, FEW_LIGHTS, samples, finer=False)
    with generate.studio(order) as stage:
        if change:
            change(stage.scene)
        pictures, heights = stage.render(np.asarray(view), np.asarray([light]))
    return pictures[0], heights


def only_ground(scene):
    for thing in list(scene.objects):
        if thing.instance_type == "COLLECTION":
            bpy.data.objects.remove(thing)


def unit(polar, azimuth=0.0):
    polar, azimuth = np.radians([polar, azimuth])
    return np.array([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)])


def test_blades_are_no_higher_than_the_tile_says():
    made = blades_of(Recipe(0.25, 0.1, 300))
    assert 0.05 < made.vertices[:, 2].max() <= 0.1 and made.vertices[:, 2].min() >= 0.0
    assert set(np.unique(made.materials)) == {0, 1, 2}


@pytest.mark.parametrize("polar, light", [(0, 0), (60, 30), (75, 70)])
def test_bare_ground_is_albedo_times_cosine(polar, light):
    """A Lambertian texel stores its albedo times the light's cosine, from all directions; height is 0."""
    picture, heights = render(unit(polar, 40), unit(light, 200), change=only_ground)
    assert picture == pytest.approx(np.broadcast_to(np.array(SOIL) * np.cos(np.radians(light)), (16, 16, 3)), rel=2e-3)
    assert np.abs(heights).max() < 1e-5


def test_texels_are_places_of_the_plane_on_top():
    """A small square in that plane covers the same texels from every direction, row 0 at the smallest y."""

    def square(scene):
        only_ground(scene)
        made = bpy.data.meshes.new("Square")
        x, y, z, half = 0.25 * 3 / 16, 0.25 * 11 / 16, 0.1, 0.25 / 16
        made.from_pydata(
            [(x - half, y - half, z), (x + half, y - half, z), (x + half, y + half, z), (x - half, y + half, z)],
            [], [(0, 1, 2, 3)],
        )  # fmt: skip
        scene.collection.objects.link(bpy.data.objects.new("Square", made))

    for polar, azimuth in ((0, 0), (45, 70), (75, 310)):
        _, heights = render(unit(polar, azimuth), unit(0), change=square)
        found = np.argwhere(heights > 0.09)
        assert found.tolist() == [[10, 2], [10, 3], [11, 2], [11, 3]]


def test_the_mean_of_a_tile_is_reciprocal():
    """Light and view may be exchanged: mean F(light; view) / cos(light) stays."""
    recipe = Recipe(0.25, 0.1, 500)
    a, b = unit(45, 0), unit(65, 70)
    there, _ = render(a, b, recipe, 32, 32)
    back, _ = render(b, a, recipe, 32, 32)
    assert there.mean(axis=(0, 1)) / b[2] == pytest.approx(back.mean(axis=(0, 1)) / a[2], rel=0.02)


def test_the_file_has_what_was_rendered(tiny):
    made = patch.load(tiny)
    assert (made.texels, made.views, made.lights) == (16, FEW_VIEWS, FEW_LIGHTS)
    with generate.studio(TINY) as stage:
        view = 3
        pictures, heights = stage.render(FEW_VIEWS.vectors[view], FEW_LIGHTS.vectors)
    shown = made.pictures(view)[:-1]  # the last one is that under the sky
    assert shown.mean(axis=(1, 2)) == pytest.approx(pictures.mean(axis=(1, 2)), rel=0.01)
    assert np.sqrt(((shown - pictures) ** 2).mean()) < 0.25 * pictures.mean()
    assert np.abs(made.heights[view] * made.height - heights).max() < 1e-4


def test_between_lights_the_mean_is_kept(tmp_path):
    """At lights of pictures it is theirs; between, of which pictures know nothing, it is as rendered."""
    order = generate.Order(Recipe(0.25, 0.1, 60), 16, Rings((60.0,), (2,)), FEW_LIGHTS, 4)
    run(order, tmp_path / "finer.grass")
    made = patch.load(tmp_path / "finer.grass")
    assert made.finer_lights.polar == (0.0, 25.0, 50.0, 60.0) and made.finer_lights.counts == (1, 24, 24, 24)
    assert made.finer[:, 25:49:6] == pytest.approx(made.picture_mean[:, 1:5], rel=0.05)
    ratios = finer_ratios(made)
    assert ratios[:, 25:49:6] == pytest.approx(np.ones((2, 4, 3)), abs=1e-6)
    assert ratios.min() > 0.5 and ratios.max() < 2.0
    arrays = patch.read_arrays(tmp_path / "finer.grass")
    patch.write_arrays(tmp_path / "wrong.grass", arrays | {"finer": arrays["finer"][:, 1:]})
    with pytest.raises(patch.PatchError, match=r"wrong.grass is no grass patch, or it is damaged\.$"):
        patch.load(tmp_path / "wrong.grass")


def test_nothing_is_left_in_the_open_file(tiny):
    before = {kind: len(getattr(bpy.data, kind)) for kind in ("scenes", "objects", "meshes", "materials", "lights")}
    with generate.studio(TINY):
        pass
    assert before == {kind: len(getattr(bpy.data, kind)) for kind in before}


def test_what_the_artist_makes_meanwhile_stays(tmp_path):
    """A run in a window gives way to events after each view."""
    steps = generate.generate(TINY, tmp_path / "tiny.grass")
    next(steps), next(steps)
    before = generate._blocks()
    mesh, lamp = bpy.data.meshes.new("Own mesh"), bpy.data.lights.new("Own lamp", "POINT")
    mesh.materials.append(bpy.data.materials.new("Own material"))
    for data in (mesh, lamp):
        bpy.context.scene.collection.objects.link(bpy.data.objects.new(f"Object of {data.name}", data))
    own = {one.name for uid, one in generate._blocks().items() if uid not in before}
    steps.close()
    left = {one.name for one in generate._blocks().values()}
    assert len(own) == 5 and own <= left and "Grass tile" not in left


def test_what_the_artist_removes_meanwhile_is_no_error(tmp_path):
    steps = generate.generate(TINY, tmp_path / "tiny.grass")
    before = {kind: len(getattr(bpy.data, kind)) for kind in generate._KINDS}
    next(steps), next(steps)
    tile = bpy.data.scenes["Grass tile"]
    tile.render.use_persistent_data = False  # Blender itself may crash later where such a scene is removed
    bpy.data.objects.remove(tile.camera)
    bpy.data.scenes.remove(tile)
    with pytest.raises(ReferenceError):
        next(steps)
    assert before == {kind: len(getattr(bpy.data, kind)) for kind in before}


def test_a_tile_as_the_only_scene_stays(empty_scene):
    with generate.studio(TINY):
        bpy.data.scenes.remove(empty_scene)
    assert [scene.name for scene in bpy.data.scenes] == ["Grass tile"] and not bpy.data.scenes[0].objects
    assert not bpy.data.scenes[0].render.use_persistent_data  # freed before the scene would be, see remove_left
    bpy.data.scenes.new("Own")
    generate.remove_left()
    assert [scene.name for scene in bpy.data.scenes] == ["Own"]


def test_undo_to_a_step_made_meanwhile_brings_no_tile_back(registered, empty_scene, tmp_path):
    def push(name):
        bpy.context.scene.collection.objects.link(bpy.data.objects.new(name, None))
        bpy.ops.ed.undo_push(message=name)

    def objects():
        return [one.name for one in bpy.data.objects]

    push("First")
    with generate.studio(TINY):
        push("Meanwhile")
    push("Afterwards")
    bpy.ops.ed.undo()
    assert objects() == ["First", "Meanwhile"] and "Grass tile" not in bpy.data.scenes
    bpy.ops.ed.undo()
    assert objects() == ["First"]
    for _ in range(2):
        bpy.ops.ed.redo()
        assert "Grass tile" not in bpy.data.scenes and "Meanwhile" in objects()
    assert sorted(objects()) == ["Afterwards", "First", "Meanwhile"]


def test_a_stopped_run_goes_on_and_gives_the_same_file(tiny, tmp_path):
    path = tmp_path / "tiny.grass"
    steps = generate.generate(TINY, path)
    for _ in range(5):
        done, whole = next(steps)
    steps.close()
    assert not path.exists() and (done, whole) == (4, 9)
    assert run(TINY, path)[0] == (4, 9)
    assert path.read_bytes() == tiny.read_bytes()
    assert not generate.views_folder(path).exists()


def test_views_of_other_settings_are_rendered_anew(tmp_path):
    path = tmp_path / "tiny.grass"
    steps = generate.generate(TINY, path)
    next(steps), next(steps)
    steps.close()
    other = generate.Order(Recipe(0.25, 0.1, 61), 16, FEW_VIEWS, FEW_LIGHTS, 4, finer=False)
    assert next(generate.generate(other, path)) == (0, 9)
    assert next(generate.generate(TINY, path)) == (1, 9)


def test_a_damaged_view_is_rendered_anew(tmp_path):
    path = tmp_path / "tiny.grass"
    steps = generate.generate(TINY, path)
    next(steps), next(steps), next(steps)
    steps.close()
    first = generate.view_file(generate.views_folder(path), 0)
    first.write_bytes(first.read_bytes()[:500])
    assert next(generate.generate(TINY, path)) == (1, 9)


def test_a_full_disk_is_a_sentence(tiny, tmp_path, monkeypatch):
    def full(*_, **__):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(zipfile.ZipFile, "writestr", full)
    with pytest.raises(patch.PatchError, match=r"view_0000.npz could not be written: No space left on device\.$"):
        run(TINY, tmp_path / "tiny.grass")
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_a_link_of_the_name_that_patches_once_had_meanwhile_is_not_written_through(tiny, tmp_path):
    """What is not finished has a name that nobody can foresee."""
    (tmp_path / "mine").write_text("mine")
    (tmp_path / "tiny.grass.unfinished").symlink_to(tmp_path / "mine")
    made = patch.load(tiny)
    patch.save(made, tmp_path / "tiny.grass")
    assert (tmp_path / "mine").read_text() == "mine" and patch.load(tmp_path / "tiny.grass").views == made.views


@pytest.mark.parametrize("content", [b"", b"text", b"PK\x03\x04 cut off"])
def test_a_wrong_file_is_a_sentence(content, tmp_path):
    path = tmp_path / "wrong.grass"
    path.write_bytes(content)
    with pytest.raises(patch.PatchError, match=r"wrong.grass is no grass patch, or it is damaged\.$"):
        patch.load(path)


def test_a_missing_file_is_a_sentence(tmp_path):
    with pytest.raises(patch.PatchError, match=r"none.grass could not be read: No such file or directory\.$"):
        patch.kept(tmp_path / "none.grass")


def test_truncated_and_changed_files_are_sentences(tiny, tmp_path):
    path, whole = tmp_path / "damaged.grass", tiny.read_bytes()
    rng = np.random.default_rng(0)
    for _ in range(40):
        content = bytearray(whole)
        content[int(rng.integers(len(content)))] ^= 1 << int(rng.integers(8))
        path.write_bytes(content[: int(rng.integers(1, len(content)))])
        with pytest.raises(patch.PatchError, match=r"damaged.grass .*\.$"):
            patch.load(path)


def test_arrays_of_another_shape_are_refused(tiny, tmp_path):
    arrays = patch.read_arrays(tiny)
    for name, changed in (
        ("weights", arrays["weights"][:, :1]), ("mean", arrays["mean"][:, :, :4]),
        ("ratio", np.full_like(arrays["ratio"], np.nan)), ("about", arrays["about"][:10]),
    ):  # fmt: skip
        path = tmp_path / f"{name}.grass"
        patch.write_arrays(path, arrays | {name: changed})
        with pytest.raises(patch.PatchError):
            patch.load(path)
