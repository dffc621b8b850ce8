"""Motion blur: what moves while the shutter is open is seen at several moments, beside Cycles and closed forms."""

import json
from itertools import pairwise

import bpy
import numpy as np
import pytest

from addon import engine
from addon.compare.metrics import relative_squared_error
from addon.frame import slices, time_steps
from addon.frame.bands import samples_in_parts
from addon.frame.settings import Settings
from addon.kernels.ranks import ids_of
from addon.snapshot import shutter

SIZE = (64, 48)
SHUTTER = 0.5


def keyed(block, path, values, frames=(0, 2)):
    """A property that goes from one value to another at even speed."""
    for frame, value in zip(frames, values):
        setattr(block, path, value)
        block.keyframe_insert(path, frame=frame)
    owner = getattr(block, "id_data", block)
    for curve in curves_of(owner):
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"


def curves_of(block):
    data = block.animation_data
    if hasattr(data.action, "layers") and data.action.layers:
        return [curve for bag in data.action.layers[0].strips[0].channelbags for curve in bag.fcurves]
    return list(data.action.fcurves)


@pytest.fixture
def blurred(stage):
    render = stage.scene.render
    stage.scene.frame_set(1)
    render.use_motion_blur, render.motion_blur_shutter, render.motion_blur_position = True, SHUTTER, "CENTER"
    yield stage
    render.use_motion_blur = False
    stage.scene.frame_set(1)


def lit_floor(stage):
    stage.scene.render.filter_size = 1.5
    stage.floor(6.0, material=stage.diffuse(0.6))
    stage.world(strength=0.4)
    stage.light("SUN", (0, 0, 5), turn=(0.5, 0.3, 0), angle=0.1)


def moving_box(stage):
    lit_floor(stage)
    box = stage.mesh(
        [(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (0.0, 1.0)],
        [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (1, 5, 7, 3), (0, 2, 6, 4)],
        material=stage.diffuse(0.05),
    )
    keyed(box, "location", [(-2, 0, 0), (2, 0.5, 0)])
    stage.camera((0, -6, 5), (0.87, 0, 0))


def moving_camera(stage):
    moving_box(stage)
    stage.scene.objects["Mesh.001"].animation_data_clear()
    keyed(stage.scene.camera, "location", [(-1.5, -6, 5), (1.5, -6, 5.4)])


def growing_shape(stage):
    lit_floor(stage)
    card = stage.rectangle((-0.8, -0.8), (0.8, 0.8), 0.6, material=stage.diffuse(0.05))
    card.shape_key_add(name="Basis")
    key = card.shape_key_add(name="Wide")
    for point, place in zip(key.data, [(-3.6, -0.4, 0.6), (3.6, -0.4, 0.6), (3.6, 0.4, 1.2), (-3.6, 0.4, 1.2)]):
        point.co = place
    keyed(key, "value", [0.0, 1.0])
    stage.camera((0, -6, 5), (0.87, 0, 0))


@pytest.mark.slow
@pytest.mark.parametrize("scene", [moving_box, moving_camera, growing_shape])
def test_beside_cycles(blurred, scene):
    scene(blurred)
    own = blurred.render(64, SIZE, bounces=1)["combined"][..., :3]
    truth = blurred.render(1024, SIZE, engine="CYCLES", bounces=1)["combined"][..., :3]
    still = relative_squared_error(unblurred(blurred), truth).mean()
    error = relative_squared_error(own, truth).mean()
    print(f"relMSE {error:.5f}, without blur {still:.5f}")
    assert error <= 0.01 and error < still / 2


def unblurred(stage):
    stage.scene.render.use_motion_blur = False
    found = stage.render(64, SIZE, bounces=1)["combined"][..., :3]
    stage.scene.render.use_motion_blur = True
    return found


def lamp_that_moves(stage, along=2.0):
    card = stage.rectangle((-0.25, -0.25), (0.25, 0.25), material=stage.material("ShaderNodeEmission", Strength=1.0))
    keyed(card, "location", [(-along, 0, 0), (along, 0, 0)])
    stage.camera_above(4.0)
    return card


def middle_of(picture):
    weight = picture[..., 0].astype(np.float64)
    return (weight * (np.arange(weight.shape[1]) + 0.5)).sum() / weight.sum() / weight.shape[1] * 4.0 - 2.0


@pytest.mark.parametrize(("position", "middle"), [("START", 0.5), ("CENTER", 0.0), ("END", -0.5)])
def test_where_the_shutter_stands(blurred, position, middle):
    """At two metres a frame, half a frame is one metre."""
    blurred.scene.render.motion_blur_position = position
    lamp_that_moves(blurred)
    assert middle_of(blurred.render(64, SIZE)["emission"]) == pytest.approx(middle, abs=0.03)


def test_light_is_spread_evenly_over_the_way(blurred):
    lamp_that_moves(blurred)
    blurred.scene.render.filter_size = 1.5
    row = blurred.render(256, SIZE)["emission"][24, :, 0]
    x = (np.arange(SIZE[0]) + 0.5) / SIZE[0] * 4.0 - 2.0
    seen = np.clip(np.minimum(x + 0.25, 0.5) - np.maximum(x - 0.25, -0.5), 0.0, None)  # of a way of one metre
    np.testing.assert_allclose(row, seen, atol=0.06)


def test_one_sample_has_the_middle(blurred):
    lamp_that_moves(blurred)
    moved = blurred.render(1, SIZE)
    blurred.scene.render.use_motion_blur = False
    still = blurred.render(1, SIZE)
    for name in moved:
        np.testing.assert_array_equal(moved[name], still[name])


def test_a_scene_at_rest_is_the_picture_without_motion_blur(blurred):
    lit_floor(blurred)
    blurred.camera_above(4.0)
    with_blur = blurred.render(4, SIZE)
    compiled = engine.session(blurred.scene, "final").renderer.geometry.uploads
    blurred.scene.render.use_motion_blur = False
    without = blurred.render(4, SIZE)
    assert engine.session(blurred.scene, "final").renderer.geometry.uploads == compiled
    for name in with_blur:
        np.testing.assert_array_equal(with_blur[name], without[name])


def test_the_scene_stands_at_its_frame_afterwards(blurred):
    card = lamp_that_moves(blurred)
    blurred.render(4, SIZE)
    assert blurred.scene.frame_current == 1 and blurred.scene.frame_subframe == 0.0
    assert card.matrix_world.translation.x == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("parts", [(8,), (5, 11), (4, 8, 12)])
def test_slices_are_the_samples_of_the_whole(blurred, parts):
    moving_box(blurred)
    blurred.scene.candela.denoise_strength = 0.0
    whole = sums_of(blurred, 0, 0)
    bounds = (0, *parts, 16)
    merged = slices.merged([sums_of(blurred, a, b - a) for a, b in pairwise(bounds)])
    for name, pixels in merged.items():
        scale = np.abs(whole.images[name]).max()
        np.testing.assert_allclose(pixels, whole.images[name], atol=2e-5 * max(scale, 1e-3), err_msg=name)


def sums_of(stage, first, count, finite=True):
    settings = stage.scene.candela
    settings.sample_offset, settings.sample_count = first, count
    engine.taken = {}
    try:
        stage.render(16, (32, 24), finite=finite)
        return next(iter(engine.taken.values()))
    finally:
        engine.taken = None
        settings.sample_offset = settings.sample_count = 0


def test_a_merged_picture_is_the_whole(blurred):
    moving_box(blurred)
    whole = blurred.render(16, (32, 24))
    parts = slices.merged([sums_of(blurred, 0, 6), sums_of(blurred, 6, 10)])
    engine.given = {bpy.context.view_layer.name: parts}
    try:
        merged = blurred.render(16, (32, 24))
    finally:
        engine.given = {}
    for name in whole:
        np.testing.assert_allclose(merged[name], whole[name], rtol=1e-3, atol=1e-4, err_msg=name)


def named_things(stage):
    """A cube that moves before a plane, which both give a colour of 1, a UV map and a matte."""
    moving_box(stage)
    stage.camera_above(5.0)
    stage.scene.objects["Mesh"].name = "Plane"
    stage.scene.objects["Mesh.001"].name = "Cube"
    made = stage.layer.aovs.add()
    made.name, made.type = "one", "COLOR"
    for thing in ("Plane", "Cube"):
        mesh = stage.scene.objects[thing].data
        mesh.uv_layers.new(name="UVMap")
        output = mesh.materials[0].node_tree.nodes.new("ShaderNodeOutputAOV")
        output.aov_name, output.inputs["Color"].default_value = "one", (1.0, 1.0, 1.0, 1.0)
    stage.layer.use_pass_uv = stage.layer.use_pass_cryptomatte_object = True
    stage.layer.cycles.denoising_store_passes = True


def test_values_of_surfaces_and_mattes_are_those_of_all_moments(blurred, written):
    named_things(blurred)
    found = written.written("CANDELA", 8, (32, 24))
    np.testing.assert_allclose(found["one"], 1.0, atol=1e-4)
    np.testing.assert_allclose(found["UV"][..., 2], 1.0, atol=1e-4)
    plane, cube = (written.coverage(found, "Object", name) for name in ("Plane", "Cube"))
    np.testing.assert_allclose(plane + cube, 1.0, atol=1e-4)
    assert plane.max() == pytest.approx(1.0, abs=1e-4) and ((plane > 0.1) & (plane < 0.9)).mean() > 0.05
    depth = found["Denoising Depth"][..., 0][plane > 0.999]
    np.testing.assert_allclose(depth, 10.0, atol=0.11)  # where rays begin, by Blender's version up to 0.1 nearer


def test_what_is_seen_for_a_part_of_the_time_has_a_name(blurred, written):
    """The cube stands before the camera at the end of the shutter alone."""
    named_things(blurred)
    cube = blurred.scene.objects["Cube"]
    cube.animation_data_clear()
    keyed(cube, "location", [(-9, 0, 0), (0, 0, 0)], (1, 1.25))
    found = written.written("CANDELA", 4, (32, 24))
    assert 0.1 < written.coverage(found, "Object", "Cube").max() < 0.9
    (names,) = (text for field, text in found["header"].items() if field.endswith("/manifest"))
    assert set(json.loads(names)) == {"Plane", "Cube"}


def jumping(block, path, before, after):
    """A property that changes at frame 1."""
    for frame, value in ((0, before), (1, after)):
        setattr(block, path, value)
        block.keyframe_insert(path, frame=frame)
    for curve in curves_of(block.id_data):
        for key in curve.keyframe_points:
            key.interpolation = "CONSTANT"
    bpy.context.scene.frame_set(1)


def cut_between_cameras(stage, card):
    other = bpy.data.objects.new("other", stage.scene.camera.data)
    other.location = (40, 0, 10)
    stage.scene.collection.objects.link(other)
    for frame, camera in ((0, other), (1, stage.scene.camera)):
        stage.scene.timeline_markers.new("cut", frame=frame).camera = camera
    stage.scene.frame_set(1)


def cut_to_an_object(stage, card):
    jumping(card, "hide_render", True, False)


def cut_to_a_colour(stage, card):
    node = next(one for one in card.data.materials[0].node_tree.nodes if one.type == "EMISSION")
    jumping(node.inputs["Strength"], "default_value", 5.0, 1.0)


@pytest.mark.parametrize("cut", [cut_between_cameras, cut_to_an_object, cut_to_a_colour])
def test_cuts_are_hard(blurred, cut):
    """As in Cycles, a frame shows what is there at its own time, and nothing of what was a moment before."""
    card = blurred.rectangle((-5, -5), (5, 5), material=blurred.material("ShaderNodeEmission", Strength=1.0))
    blurred.camera_above(4.0)
    cut(blurred, card)
    try:
        np.testing.assert_allclose(blurred.render(8, (8, 6))["emission"][..., 0], 1.0, atol=1e-3)
    finally:
        blurred.scene.timeline_markers.clear()


def test_an_object_may_leave_its_motion_out(blurred):
    card = lamp_that_moves(blurred)
    card.cycles.use_motion_blur = False
    row = blurred.render(8, SIZE)["emission"][24, :, 0]
    x = (np.arange(SIZE[0]) + 0.5) / SIZE[0] * 4.0 - 2.0
    np.testing.assert_allclose(row[np.abs(x) < 0.2], 1.0, atol=1e-3)
    assert not row[np.abs(x) > 0.4].any()


def test_an_object_may_leave_its_deformation_out(blurred):
    card = blurred.rectangle((-0.5, -0.5), (0.5, 0.5), material=blurred.material("ShaderNodeEmission", Strength=1.0))
    card.shape_key_add(name="Basis")
    key = card.shape_key_add(name="Moved")
    for point in key.data:
        point.co.x += 4.0
    key.slider_min = -1.0
    keyed(key, "value", [-0.5, 0.5])
    card.cycles.use_deform_motion = False
    blurred.camera_above(4.0)
    assert (blurred.render(8, SIZE)["emission"][24, 26:38, 0] > 0.999).all()
    card.cycles.use_deform_motion = True
    assert blurred.render(8, SIZE)["emission"][24, 26:38, 0].min() < 0.9


@pytest.mark.parametrize("kind", ["mesh", "points"])
def test_a_velocity_stands_for_motion(blurred, kind):
    """At 48 m/s and 24 frames a second half a frame is one metre; what is half a metre wide is seen for half of it."""
    glow = blurred.material("ShaderNodeEmission", Strength=1.0)
    if kind == "mesh":
        card = blurred.rectangle((-0.25, -0.25), (0.25, 0.25), material=glow)
        card.data.attributes.new("velocity", "FLOAT_VECTOR", "POINT").data.foreach_set("vector", [48.0, 0, 0] * 4)
    else:
        cloud = bpy.data.pointclouds.new("points")
        if not hasattr(cloud, "resize"):
            pytest.skip("this Blender fills point clouds by geometry nodes alone")
        cloud.resize(1)
        for name, type_name in (("radius", "FLOAT"), ("velocity", "FLOAT_VECTOR")):
            if name not in cloud.attributes:
                cloud.attributes.new(name, type_name, "POINT")
        cloud.attributes["radius"].data[0].value = 0.25
        cloud.attributes["velocity"].data[0].vector = (48.0, 0, 0)
        cloud.materials.append(glow)
        blurred.link("points", cloud)
    blurred.camera_above(4.0)
    row = blurred.render(16, SIZE)["emission"][24, :, 0]
    x = (np.arange(SIZE[0]) + 0.5) / SIZE[0] * 4.0 - 2.0
    assert row[np.abs(x) < 0.1].mean() == pytest.approx(0.5, abs=0.07)
    assert row[np.abs(x) > 0.8].max() == 0.0 and row[np.abs(x) < 0.6].min() > 0.0


def test_a_rolling_shutter_is_warned_of(blurred):
    lamp_that_moves(blurred)
    blurred.scene.cycles.rolling_shutter_type = "TOP"
    try:
        blurred.render(2, (8, 6))
        assert any("rolling shutter" in str(note) for note in blurred.ledger.notes)
    finally:
        blurred.scene.cycles.rolling_shutter_type = "NONE"


def test_mattes_and_values_of_slices_are_those_of_the_whole(blurred, written):
    named_things(blurred)
    whole = sums_of(blurred, 0, 0, finite=False).images
    bounds = (0, 5, 11, 16)
    merged = slices.merged([sums_of(blurred, a, b - a, finite=False) for a, b in pairwise(bounds)])
    values = [name for name in whole if name.startswith("aov.")]
    assert len(values) == 3
    for name in values:
        np.testing.assert_allclose(merged[name], whole[name], rtol=1e-5, atol=1e-4, err_msg=name)
    mattes = [name for name in whole if name.startswith("crypto.")]
    one, other = ([images[name] for name in mattes] for images in (whole, merged))
    for thing in ("Plane", "Cube"):
        weights = [weight_of(thing, images) for images in (one, other)]
        np.testing.assert_allclose(*weights, atol=1e-4)
        assert weights[0].max() > 4.0


def weight_of(name, mattes):
    pairs = np.concatenate(mattes, axis=-1)
    return np.where(pairs[..., 0::2] == ids_of([name])[0], pairs[..., 1::2], 0.0).sum(axis=-1)


@pytest.mark.parametrize("samples", [1, 4])
def test_vector_is_zero_and_other_values_keep_their_places(blurred, written, samples):
    """As in Cycles, which leaves it out. START: a single moment is not the frame's own."""
    blurred.scene.render.motion_blur_position = "START"
    named_things(blurred)
    made = blurred.layer.aovs.add()
    made.name, made.type = "two", "VALUE"
    output = blurred.scene.objects["Plane"].data.materials[0].node_tree.nodes.new("ShaderNodeOutputAOV")
    output.aov_name, output.inputs["Value"].default_value = "two", 2.0
    without = written.written("CANDELA", samples, (32, 24))
    assert not any("Vector" in str(note) for note in blurred.ledger.notes)
    blurred.layer.use_pass_vector = True
    found = written.written("CANDELA", samples, (32, 24))
    assert any("Vector pass is zero" in str(note) for note in blurred.ledger.notes)
    assert found["Vector"].shape == (24, 32, 4) and not found["Vector"].any()
    assert found["two"].max() == pytest.approx(2.0, abs=1e-4) and found["two"].min() < 1.5
    for name in without.keys() - {"header"}:
        if without[name] is not None:
            np.testing.assert_array_equal(found[name], without[name], err_msg=name)


def test_a_scene_at_rest_has_no_vector_either(blurred, written):
    lit_floor(blurred)
    blurred.camera_above(4.0)
    blurred.layer.use_pass_vector = True
    keyed(blurred.scene.camera, "location", [(0, 0, 10), (0.5, 0, 10)], (1.5, 2))  # while the shutter is closed
    assert not written.written("CANDELA", 2, (32, 24))["Vector"].any()
    blurred.scene.render.use_motion_blur = False
    assert np.abs(written.written("CANDELA", 2, (32, 24))["Vector"]).max() > 1.0


def test_parts_for_a_window_draw_the_same_picture(blurred, monkeypatch):
    moving_box(blurred)
    whole = blurred.render(8, (32, 24))
    monkeypatch.setattr(engine, "_whole_samples", samples_in_parts)
    in_parts = blurred.render(8, (32, 24))
    for name in whole:
        np.testing.assert_allclose(in_parts[name], whole[name], atol=1e-6, err_msg=name)


def test_images_are_given_back(blurred):
    from addon.gfx import images

    moving_box(blurred)
    blurred.render(8, SIZE)
    before = images.pool.allocated_bytes
    for _ in range(3):
        blurred.render(8, SIZE)
    assert images.pool.allocated_bytes <= before


def test_a_time_limit_ends_with_a_whole_picture(blurred):
    moving_box(blurred)
    blurred.scene.candela.time_limit = 1e-6
    images = blurred.render(64, SIZE)
    blurred.scene.candela.time_limit = 0.0
    assert blurred.ledger.samples >= 1
    assert images["combined"][..., 3].min() == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize(("samples", "steps"), [(1, 1), (2, 2), (3, 3), (16, 16), (20, 16), (64, 16), (65, 8)])
def test_both_halves_of_the_samples_see_all_of_the_motion(samples, steps):
    taken = [time_steps.step_of(number, samples, steps) for number in range(samples)]
    assert set(taken) == set(range(steps)) or samples < 2 * steps
    mean = (steps - 1) / 2
    assert np.mean(taken) == pytest.approx(mean, abs=0.5)
    half = samples // 2
    if half:
        assert np.mean(taken[:half]) == pytest.approx(mean, abs=max(1.0, steps / samples))
        assert np.mean(taken[half:]) == pytest.approx(mean, abs=max(1.0, steps / samples))


def test_each_sample_is_drawn_once_whatever_the_slice():
    everything = []
    for offset, count in ((0, 10), (10, 3), (13, 0)):
        settings = Settings(samples=40, sample_offset=offset, sample_count=count)
        for step in time_steps.shared_out(list("abcdefgh"), range(8), settings):
            everything += [(number, step.snapshot) for number in step.numbers]
    whole = time_steps.shared_out(list("abcdefgh"), range(8), Settings(samples=40))
    assert sorted(everything) == sorted((number, step.snapshot) for step in whole for number in step.numbers)
    assert whole[-1].snapshot == "e"


def test_shutter_times_follow_the_curve(blurred):
    render = blurred.scene.render
    np.testing.assert_allclose(
        shutter.shutter_times(blurred.scene, 4), np.array([-3, -1, 1, 3]) / 8 * SHUTTER, atol=1e-6
    )
    curve = render.motion_blur_shutter_curve
    curve.initialize()
    before = [tuple(point.location) for point in curve.curves[0].points]
    try:
        for point in curve.curves[0].points:  # open in its second half alone
            point.location.y = float(point.location.x > 0.9)
        curve.update()
        times = shutter.shutter_times(blurred.scene, 4)
    finally:
        for point, place in zip(curve.curves[0].points, before):
            point.location = place
        curve.update()
    assert np.mean(times) > 0.05 * SHUTTER and np.all(np.diff(times) > 0)
