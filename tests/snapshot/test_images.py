"""Images arrive as Blender stores them, with what it takes to decode them."""

import os
from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.materials import atlas
from addon.snapshot import SnapshotCache, images


def shown(stage, image):
    """Put the image on a material, with its colour and alpha in use."""
    material = stage.material()
    tree = material.node_tree
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    shader = next(one for one in tree.nodes if one.type == "BSDF_PRINCIPLED")
    tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
    data = stage.mesh()
    data.materials.append(material)
    stage.link("O", data)
    return node


def only_image(snapshot):
    (image,) = snapshot.images.values()
    return image


def generated(width=2, height=3, **options):
    made = bpy.data.images.new("made", width, height, alpha=True, **options)
    values = (np.arange(width * height * 4, dtype=np.float32) % 256) / 255
    made.pixels.foreach_set(values)
    return made, values.reshape(height, width, 4)


def test_generated_bytes_are_kept_as_stored_bottom_row_first(stage):
    image, values = generated()
    node = shown(stage, image)
    snapshot = stage.take()
    taken = only_image(snapshot)
    assert np.allclose(taken.pixels, values, atol=1e-6)
    assert (taken.encoding, taken.alpha_mode, taken.name) == ("SRGB", "STRAIGHT", "made")
    graph = snapshot.materials[1].graph
    (texture,) = (one for one in graph.nodes.values() if one.type == node.bl_idname)
    assert texture.image == taken.key


@pytest.mark.parametrize("space", ["Non-Color", "Linear Rec.709"])
def test_linear_and_data_bytes_need_no_decoding(stage, space):
    image, values = generated()
    image.colorspace_settings.name = space
    image.pixels.foreach_set(values.reshape(-1))
    shown(stage, image)
    taken = only_image(stage.take())
    assert taken.encoding == "LINEAR"
    assert taken.alpha_mode == (
        "CHANNEL_PACKED" if space == "Non-Color" else "STRAIGHT"
    )  # data is not covered by alpha
    assert np.allclose(taken.pixels, values, atol=1e-6)


def test_float_images_are_linear_with_alpha_multiplied_in(stage):
    image, values = generated(float_buffer=True)
    shown(stage, image)
    taken = only_image(stage.take())
    assert (taken.encoding, taken.alpha_mode) == ("LINEAR", "PREMUL")
    assert np.array_equal(taken.pixels, values)


def saved(tmp_path, name="file.png"):
    image, values = generated()
    values[..., 3] = 1.0
    image.pixels.foreach_set(values.reshape(-1))
    image.filepath_raw, image.file_format = str(tmp_path / name), "PNG"
    image.save()
    bpy.data.images.remove(image)
    return str(tmp_path / name), values


def test_a_file_is_loaded_on_demand(stage, tmp_path):
    path, values = saved(tmp_path)
    shown(stage, bpy.data.images.load(path))
    assert np.allclose(only_image(stage.take()).pixels, values, atol=1e-6)


def test_a_packed_image_needs_no_file(stage, tmp_path):
    path, values = saved(tmp_path)
    image = bpy.data.images.load(path)
    image.pack()
    (tmp_path / "file.png").unlink()
    shown(stage, image)
    assert np.allclose(only_image(stage.take()).pixels, values, atol=1e-6)


def test_a_missing_image_is_magenta_and_named(stage, tmp_path):
    path, _ = saved(tmp_path)
    image = bpy.data.images.load(path)
    (tmp_path / "file.png").unlink()
    image.reload()
    shown(stage, image)
    snapshot = stage.take()
    assert only_image(snapshot).pixels.tolist() == [[[1, 0, 1, 1]]]
    assert only_image(snapshot).missing
    (note,) = snapshot.notes
    assert "file.png" in note.subject
    assert "missing" in note.text


def test_other_colour_spaces_are_converted_before_filtering(stage):
    image, values = generated()
    image.colorspace_settings.name = "Linear Rec.2020" if bpy.app.version >= (5, 0) else "Filmic sRGB"
    image.pixels.foreach_set(values.reshape(-1))
    shown(stage, image)
    snapshot = stage.take()
    assert not snapshot.notes
    taken = only_image(snapshot)
    assert taken.encoding == "LINEAR"
    assert np.allclose(taken.pixels[..., 3], values[..., 3], atol=1e-6)
    assert not np.allclose(taken.pixels[..., :3], values[..., :3], atol=1e-3)


def test_tiles_of_a_udim_image_lie_in_one(stage, tmp_path):
    path, _ = saved(tmp_path, "tile.1001.png")
    saved(tmp_path, "tile.1002.png")
    image = bpy.data.images.load(path)
    image.source, image.filepath_raw = "TILED", str(tmp_path / "tile.<UDIM>.png")
    image.reload()
    if len(image.tiles) < 2:
        image.tiles.new(1002)
    shown(stage, image)
    snapshot = stage.take()
    assert not snapshot.notes
    assert [tile[0] for tile in only_image(snapshot).tiles] == [1001, 1002]


def test_a_frame_that_a_sequence_lacks_is_named(stage, tmp_path):
    path, _ = saved(tmp_path, "frame0001.png")
    image = bpy.data.images.load(path)
    image.source = "SEQUENCE"
    user = shown(stage, image).image_user
    user.frame_duration, user.frame_offset = 1, 6
    (note,) = stage.take().notes
    assert "frame 7" in note.text


@pytest.mark.parametrize("before", ["SEQUENCE", "FILE"])
def test_a_frame_of_a_sequence_is_no_other_one_at_the_next_sync(stage, tmp_path, before):
    path, _ = saved(tmp_path, "frame0007.png")
    image, cache = bpy.data.images.load(path), SnapshotCache()
    image.source = before
    user = shown(stage, image).image_user
    user.frame_duration, user.frame_offset = 1, 6
    stage.take(cache)
    for read in (before != "SEQUENCE", 0):
        with stage.telling(cache):
            stage.scene.camera.location.x += 1.0
            image.source = "SEQUENCE"
        snapshot = stage.take(cache)
        assert snapshot.notes == ()
        assert list(snapshot.images) == [f"image {image.session_uid} frame 7"]
        assert snapshot.sync_stats["images_read"] == read


def test_an_unchanged_image_is_not_read_again(stage, tmp_path):
    path, _ = saved(tmp_path)
    shown(stage, bpy.data.images.load(path))
    cache = SnapshotCache()
    first, second = stage.take(cache), stage.take(cache)
    assert (first.sync_stats["images_read"], second.sync_stats["images_read"]) == (1, 0)
    assert only_image(second) is only_image(first)


@pytest.mark.parametrize("change", ["paint", "alpha", "space", "reload", "repack"])
def test_changed_images_are_read_even_though_blender_tells_no_one(stage, tmp_path, change):
    path, _ = saved(tmp_path)
    image = bpy.data.images.load(path)
    if change == "repack":
        image.pack()
    shown(stage, image)
    cache = SnapshotCache()
    before = only_image(stage.take(cache))
    with stage.telling(cache):
        stage.scene.camera.location.x += 1.0  # some news, but none of the image
        if change in ("paint", "repack"):
            image.pixels[0] = 0.5
        if change == "repack":
            image.pack()
        elif change == "alpha":
            image.alpha_mode = "NONE"
        elif change == "space":
            image.colorspace_settings.name = "Non-Color"
        elif change == "reload":
            other = bpy.data.images.new("other", 5, 5)
            other.filepath_raw, other.file_format = path, "PNG"
            other.save()
            image.reload()
    after = only_image(stage.take(cache))
    assert after.version > before.version


def test_painting_without_change_keeps_the_version(stage):
    image, _ = generated()
    shown(stage, image)
    cache = SnapshotCache()
    before = only_image(stage.take(cache))
    image.update()
    assert only_image(stage.take(cache)) is before


def overwrite(path, value):
    """Another program writes pixels of one grey to the file, at another time."""
    other = bpy.data.images.new("other", 2, 3)
    other.pixels.foreach_set(np.array([value, value, value, 1.0] * 6, np.float32))
    other.filepath_raw, other.file_format = path, "PNG"
    other.save()
    bpy.data.images.remove(other)
    made = Path(path).stat().st_mtime_ns + 10**9
    os.utime(path, ns=(made, made))


def test_reload_takes_back_what_was_painted(stage, tmp_path):
    path, values = saved(tmp_path)
    image, cache = bpy.data.images.load(path), SnapshotCache()
    shown(stage, image)
    stage.take(cache)
    image.pixels.foreach_set(np.full(24, 0.5, np.float32))
    assert not np.allclose(only_image(stage.take(cache)).pixels, values, atol=1e-6)
    image.reload()
    assert np.allclose(only_image(stage.take(cache)).pixels, values, atol=1e-6)


# Where no sync was before the writing and an editor loads the file, nothing tells that the pixels were older than it.
@pytest.mark.parametrize(("synced", "elsewhere"), [(False, False), (True, False), (True, True)])
def test_reload_shows_what_another_program_wrote(stage, tmp_path, synced, elsewhere):
    """`synced`: also before it was written. `elsewhere`: an editor of Blender's asks for the pixels first."""
    path, values = saved(tmp_path)
    image, cache = bpy.data.images.load(path), SnapshotCache()
    shown(stage, image)
    assert len(image.pixels)  # Blender holds the file
    if synced:
        stage.take(cache)
    overwrite(path, 0.2)
    for _ in range(2):
        assert np.allclose(only_image(stage.take(cache)).pixels, values, atol=1e-6)
    image.reload()
    if elsewhere:
        assert len(image.pixels)
    assert np.allclose(only_image(stage.take(cache)).pixels, (0.2, 0.2, 0.2, 1.0), atol=1e-6)


def test_a_painted_image_that_is_saved_is_not_read_again(stage, tmp_path):
    path, _ = saved(tmp_path)
    image, cache = bpy.data.images.load(path), SnapshotCache()
    shown(stage, image)
    stage.take(cache)
    image.pixels.foreach_set(np.full(24, 0.5, np.float32))
    before = stage.take(cache)
    image.save()
    assert only_image(stage.take(cache)) is only_image(before)
    state = next(iter(cache.images.values())).state
    assert only_image(stage.take(cache)) is only_image(before)
    assert next(iter(cache.images.values())).state is state


def test_what_is_larger_than_gpus_take_is_scaled_with_a_warning(stage, monkeypatch):
    monkeypatch.setattr(images, "WIDEST", 8)
    image, values = generated(20, 4, float_buffer=True)
    shown(stage, image)
    snapshot = stage.take()
    taken = only_image(snapshot).pixels
    assert taken.shape == (4, 8, 4)
    # A pixel is the mean of two and a half: of the first two whole ones and half of the third.
    expected = (values[:, 0] + values[:, 1] + 0.5 * values[:, 2]) / 2.5
    np.testing.assert_allclose(taken[:, 0], expected, atol=1e-5)
    np.testing.assert_allclose(taken.mean(axis=1), values.mean(axis=1), atol=1e-5)
    assert any("'made': its 20 x 4 pixels" in str(note) for note in snapshot.notes)


def test_tiles_are_scaled_until_they_fit(monkeypatch):
    monkeypatch.setattr(images, "WIDEST", 8)
    monkeypatch.setattr(atlas, "WIDEST", 8)
    tiles = [(1001 + k, np.full((8, 8, 4), float(k), np.float32)) for k in range(3)]
    scaled, notes = images._tiles_that_fit(tiles, "Image 'made'")
    assert [(number, pixels.shape, pixels.mean()) for number, pixels in scaled] == [
        (1001 + k, (4, 4, 4), float(k)) for k in range(3)
    ]
    assert "1/2 of their width" in str(notes[0])


def movie_of(tmp_path, colors):
    """The file of a movie of one frame for each colour, which Blender's sequencer writes."""
    scene = bpy.data.scenes.new("movie")
    render = scene.render
    if hasattr(render.image_settings, "media_type"):
        render.image_settings.media_type = "VIDEO"
    render.image_settings.file_format = "FFMPEG"
    render.ffmpeg.format, render.ffmpeg.codec, render.ffmpeg.constant_rate_factor = "MPEG4", "H264", "LOSSLESS"
    render.resolution_x = render.resolution_y = 16
    render.filepath, scene.frame_end = str(tmp_path / "movie.mp4"), len(colors)
    scene.view_settings.view_transform = "Standard"
    editor = scene.sequence_editor_create()
    strips = editor.strips if hasattr(editor, "strips") else editor.sequences
    for k, color in enumerate(colors):
        length = {"length": 1} if bpy.app.version >= (5, 0) else {"frame_end": k + 2}
        strip = strips.new_effect(name=str(k), type="COLOR", channel=1, frame_start=k + 1, **length)
        strip.color = color
    bpy.ops.render.render(animation=True, scene=scene.name)
    bpy.data.scenes.remove(scene)
    (path,) = tmp_path.glob("*.mp4")
    return str(path)


def test_frames_of_movies_are_read_as_blender_reads_them(stage, tmp_path):
    colors = [(0.0, 0.5, 1.0), (0.5, 0.5, 0.0), (1.0, 0.0, 0.5)]
    image, cache = bpy.data.images.load(movie_of(tmp_path, colors)), SnapshotCache()
    assert image.source == "MOVIE"
    user = shown(stage, image).image_user
    user.frame_duration = 3
    for offset, frame in ((0, 0), (1, 1), (9, 2), (9, 2)):  # after its end a movie shows its last frame
        user.frame_offset = offset
        snapshot = stage.take(cache)
        assert not snapshot.notes
        taken = only_image(snapshot)
        assert taken.encoding == "SRGB"
        assert np.allclose(taken.pixels[8, 8, :3], colors[frame], atol=0.02)
    assert snapshot.sync_stats["images_read"] == 0


def test_a_movie_that_is_not_there_is_named(stage, tmp_path):
    image = bpy.data.images.load(movie_of(tmp_path, [(1.0, 1.0, 1.0)]))
    image.filepath_raw = str(tmp_path / "other.mp4")
    image.reload()
    shown(stage, image).image_user.frame_duration = 1
    snapshot = stage.take()
    assert only_image(snapshot).missing
    (note,) = snapshot.notes
    assert "of the movie" in note.text
