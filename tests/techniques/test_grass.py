"""Grass from patches: radiometry in closed form, depth, shadow, invariants, and real blades by Cycles."""

import math
from dataclasses import replace

import bmesh
import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

from addon import engine
from addon.frame import slices
from addon.frame.ledger import RAN, SKIPPED
from addon.grass import patch as patches
from addon.grass.blades import Recipe
from addon.grass.compression import LUMA
from addon.grass.directions import Rings
from addon.grass.generate import field_of
from addon.grass.table import finer_ratios
from addon.materials.compiled import Attribute
from addon.materials.compiler import compile_material
from addon.scene import uv_placed
from addon.snapshot.shading import empty_slot_graph
from addon.techniques.grass import SHIPPED

MEADOW = Recipe(0.4, 0.1, 1300, 3)  # of the shipped patch
ALBEDO = np.array([0.1, 0.3, 0.05])
VIEWS, LIGHTS = Rings((0.0, 50.0, 80.0), (1, 6, 8)), Rings((0.0, 35.0, 70.0), (1, 6, 8))
FINER = Rings((0.0, 20.0, 60.0), (1, 4, 8))


def flat_patch(path, height_seen, albedo=ALBEDO, finer=None):
    """A patch file of a Lambertian plane at `height_seen` (0 the ground, 1 the top) of a tile 0.4 m wide, 0.1 high."""
    cosines = LIGHTS.vectors[:, 2]
    picture = np.broadcast_to(cosines[:, None, None, None] * albedo, (LIGHTS.number, 8, 8, 3))
    heights = np.full((VIEWS.number, 8, 8), 0.1 * height_seen)
    means = None if finer is None else np.broadcast_to(finer(FINER.vectors)[..., None] * albedo, (VIEWS.number, 13, 3))
    known = {} if finer is None else {"finer_lights": FINER, "finer": means}
    patches.save(patches.compressed_patch(0.4, 0.1, VIEWS, LIGHTS, lambda view: picture, heights, **known), path)
    return path


def ground(stage, patch="MEADOW", half=4.0, **settings):
    material = stage.diffuse(0.5)
    if isinstance(patch, str):
        material.candela.grass_patch = patch
    else:
        material.candela.grass_patch, material.candela.grass_file = "FILE", str(patch)
    for name, value in settings.items():
        setattr(material.candela, f"grass_{name}", value)
    return stage.rectangle((-half, -half), (half, half), material=material)


def towards(stage, polar, azimuth, span, distance=5.0):
    """An orthographic camera that sees the origin from a direction, in degrees."""
    polar, azimuth = math.radians(polar), math.radians(azimuth)
    way = Vector((math.sin(polar) * math.cos(azimuth), math.sin(polar) * math.sin(azimuth), math.cos(polar)))
    data = bpy.data.cameras.new("Camera")
    data.type, data.ortho_scale = "ORTHO", span
    camera = stage.link("Camera", data, distance * way)
    camera.rotation_euler = way.to_track_quat("Z", "Y").to_euler()
    stage.scene.camera = camera
    return camera


def sun(stage, polar, azimuth, energy=3.0):
    polar, azimuth = math.radians(polar), math.radians(azimuth)
    way = Vector((math.sin(polar) * math.cos(azimuth), math.sin(polar) * math.sin(azimuth), math.cos(polar)))
    return stage.light("SUN", turn=way.to_track_quat("Z", "Y").to_euler(), energy=energy, angle=0.0)


def ball(stage, radius, location):
    mesh = bpy.data.meshes.new("Ball")
    made = bmesh.new()
    bmesh.ops.create_uvsphere(made, u_segments=32, v_segments=16, radius=radius)
    made.to_mesh(mesh)
    made.free()
    mesh.materials.append(stage.material("ShaderNodeEmission", Strength=1.0))
    return stage.link("Ball", mesh, location)


# Light ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("view", [(0, 0), (30, 77), (65, 200)])
@pytest.mark.parametrize("light", [(0, 0), (20, 33), (50, 110), (80, 250)])
def test_a_lambertian_tile_reflects_albedo_times_cosine(stage, tmp_path, view, light):
    ground(stage, flat_patch(tmp_path / "flat.grass", 0.5))
    sun(stage, *light)
    towards(stage, *view, 1.0)
    shown = stage.render(2, (8, 8))["combined"][..., :3]
    expected = 3.0 / np.pi * ALBEDO * math.cos(math.radians(light[0]))
    assert shown == pytest.approx(np.broadcast_to(expected, shown.shape), rel=0.01)


def test_a_lambertian_tile_under_a_uniform_sky_shows_its_albedo(stage, tmp_path):
    ground(stage, flat_patch(tmp_path / "flat.grass", 0.0))
    stage.world((1, 1, 1), 1.0)
    towards(stage, 40, 20, 0.5)
    shown = stage.render(64, (8, 8))["combined"][..., :3].mean(axis=(0, 1))
    assert shown == pytest.approx(ALBEDO, rel=0.03)


@pytest.mark.parametrize("light", [(20, 90), (60, 45), (40, 60)])
def test_between_lights_of_pictures_the_mean_is_the_one_that_was_rendered(stage, tmp_path, light):
    """A plane that were 1 + x / 2 times as bright where light comes from x, which the pictures do not show."""
    brighter = flat_patch(tmp_path / "flat.grass", 0.5, finer=lambda way: way[:, 2] * (1.0 + 0.5 * way[:, 0]))
    ground(stage, brighter)
    sun(stage, *light)
    towards(stage, 30, 77, 1.0)
    polar, azimuth = np.radians(light)
    way = np.array([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)])
    numbers, weights = FINER.weights(way)
    brightness = way[2] * (1.0 + 0.5 * weights @ FINER.vectors[numbers, 0])
    shown = stage.render(2, (8, 8))["combined"][..., :3]
    assert shown == pytest.approx(np.broadcast_to(3.0 / np.pi * ALBEDO * brightness, shown.shape), rel=0.01)


def test_light_from_below_is_none(stage):
    ground(stage)
    sun(stage, 100, 0)
    towards(stage, 30, 0, 1.0)
    assert np.abs(stage.render(2, (8, 8))["combined"][..., :3]).max() == 0.0


def test_two_suns_add_up(stage):
    ground(stage)
    towards(stage, 40, 70, 0.8)
    lamps = [sun(stage, 30, 10), sun(stage, 60, 200)]

    def render(*shown):
        for k, lamp in enumerate(lamps):
            lamp.hide_render = k not in shown
        return stage.render(1, (32, 32))["combined"][..., :3]

    assert render(0, 1) == pytest.approx(render(0) + render(1), rel=1e-4, abs=1e-6)


@pytest.mark.parametrize("between", [False, True])
def test_a_view_of_the_patch_is_shown_texel_by_texel(stage, between):
    """From above with the sun in a sampled direction: what numpy decodes, with the contrast that it lost. Halfway
    between two directions: the mean of both pictures, with the contrast that means of unlike pictures lose."""
    made = patches.load(SHIPPED)
    light = 5
    way = made.lights.vectors[light]
    if between:
        way = way + made.lights.vectors[light + 1]
        polar = np.radians(35.0)  # of the ring that both lie on
        way = np.array([*(way[:2] / np.linalg.norm(way[:2]) * np.sin(polar)), np.cos(polar)])
    ground(stage)
    stage.light("SUN", turn=Vector(way).to_track_quat("Z", "Y").to_euler(), energy=math.pi, angle=0.0)
    stage.camera_above(made.size)
    shown = stage.render(1, (64, 64))["combined"][..., :3]
    squares = 0.5 if between else 1.0  # sum of the squared weights of pictures
    lost = (squares + made.light_alike[0] * (1.0 - squares)) ** 0.5

    def decoded(light):
        picture = made.pictures(0)[light]
        more = made.contrast[0, light] / lost
        excess = made.excess[0, light] * max(more - 1.0, 0.0) ** 1.5
        more *= 1.0 + 2.3 * excess  # what cutting off takes from it
        mean = made.picture_mean[0, light]
        return np.maximum(mean + (picture - mean) * more, 0.0) / (1.0 + excess)

    expected = decoded(light)
    if between:
        numbers, weights = made.finer_lights.weights(way)
        expected = 0.5 * (expected + decoded(light + 1)) * (weights @ finer_ratios(made)[0, numbers])
    expected = np.roll(expected, (32, 32), axis=(0, 1))  # the picture's corner is half a tile off the origin
    assert np.abs(shown - expected).mean() < 0.01 * expected.mean()


# Place ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seen", [0.0, 0.3, 1.0])
def test_depth_is_that_of_what_is_seen(stage, tmp_path, seen):
    ground(stage, flat_patch(tmp_path / "flat.grass", seen))
    sun(stage, 0, 0)
    towards(stage, 60, 90, 0.5)
    depth = stage.render(1, (8, 8))["depth"]
    rows = (np.arange(8) + 0.5 - 4) / 8 * 0.5  # up the picture, in metres
    # Along the view: 5 m to the origin; rows higher up see farther by tan 60, and what is higher is nearer by 1 / cos.
    expected = 5.0 + rows * math.tan(math.radians(60)) - 0.1 * seen / math.cos(math.radians(60))
    found = depth.reshape(8, 8, -1)[..., 0]
    assert found == pytest.approx(np.broadcast_to(expected[:, None], found.shape), abs=1e-3)


def test_a_height_of_its_own_moves_what_is_seen(stage, tmp_path):
    ground(stage, flat_patch(tmp_path / "flat.grass", 1.0), height=0.4)
    sun(stage, 0, 0)
    towards(stage, 0, 0, 0.5)
    assert stage.render(1, (4, 4))["depth"] == pytest.approx(5.0 - 0.4, abs=2e-3)


def test_without_density_the_ground_is_seen_where_it_is(stage):
    bare = ground(stage, "NONE")
    sun(stage, 30, 0)
    towards(stage, 50, 40, 0.5)
    expected = stage.render(1, (16, 16))
    bare.data.materials[0].candela.grass_patch = "MEADOW"
    bare.data.materials[0].candela.grass_density = 0.0
    shown = stage.render(1, (16, 16))
    assert shown["combined"] == pytest.approx(expected["combined"], rel=1e-3)
    assert shown["depth"] == pytest.approx(expected["depth"], abs=1e-4)


def test_a_map_says_where_grass_grows(stage, tmp_path):
    """Over the square of 2 m around the origin: bare where x < 0, and so is all beyond. The picture's right is -x."""
    image = bpy.data.images.new("Where", 2, 4, float_buffer=True, is_data=True)
    image.pixels.foreach_set(np.tile(np.array([0, 0, 0, 1, 1, 1, 1, 1], np.float32), 4))
    image.pack()
    patch = flat_patch(tmp_path / "flat.grass", 1.0)
    ground(stage, patch, density_map=image, map_size=2.0)
    stage.world((1, 1, 1), 1.0)
    towards(stage, 0, 0, 6.0)
    shown = stage.render(16, (24, 24))["combined"][..., :3]
    assert shown[:, 15:] == pytest.approx(np.full((24, 9, 3), 0.5), rel=0.03)
    assert shown[:, :9] == pytest.approx(np.broadcast_to(ALBEDO, (24, 9, 3)), rel=0.03)


def test_density_is_the_share_that_is_covered(stage, tmp_path):
    ground(stage, flat_patch(tmp_path / "flat.grass", 1.0), density=0.5)
    sun(stage, 0, 0)
    towards(stage, 0, 0, 4.0)
    depth = stage.render(1, (64, 64))["depth"]
    assert 0.35 < (depth < 4.95).mean() < 0.65


def test_slices_are_denoised_as_the_whole(stage, tmp_path):
    """The filter goes by where the last sample saw grass, not the first, which draws the merged picture's surfaces."""
    ground(stage, flat_patch(tmp_path / "flat.grass", 1.0), density=0.5)
    stage.light("AREA", (0, 0, 3), size=3.0)
    stage.blocker((-0.5, -0.5), (0.5, 0.5), 1.0)
    towards(stage, 0, 0, 4.0)
    settings = stage.scene.candela

    def render(first, count):
        settings.sample_offset, settings.sample_count = first, count
        return stage.render(4, (24, 24))

    parts = []
    try:
        for first in (0, 2):
            engine.taken = {}
            render(first, 2)
            parts += engine.taken.values()
        engine.taken = None
        whole = render(0, 0)
        engine.given = dict.fromkeys([bpy.context.view_layer.name], slices.merged(parts))
        found = render(0, 0)
    finally:
        engine.taken, engine.given = None, {}
    assert stage.ledger.row("denoise").state == RAN
    for name in whole:
        np.testing.assert_allclose(found[name], whole[name], rtol=1e-3, atol=1e-4, err_msg=name)


@pytest.mark.slow
def test_a_ball_stands_in_the_grass(stage):
    """Blades cover the lower part of what stands in them, and nothing higher. The view is 80 degrees from above."""
    ball(stage, 0.11, (0, 0, 0.11))
    towards(stage, 80, 270, 0.5)

    def seen():
        return stage.render(16, (64, 64))["emission"][..., 0].sum(axis=1)

    alone = seen()
    ground(stage)
    sun(stage, 30, 0)
    within = seen()
    # The picture's middle is the ground; the ball's middle is 14 pixels above it, the plane on top of the grass 13.
    assert within[46:].sum() == pytest.approx(alone[46:].sum(), rel=0.01)
    assert 0.1 < within[32:44].sum() / alone[32:44].sum() < 0.95


def test_other_things_cast_shadows_on_it(stage):
    ground(stage)
    stage.blocker((-0.5, -4), (4, 4), 0.6)
    sun(stage, 0, 0)
    stage.camera_above(4.0)
    shown = stage.render(2, (32, 32))["combined"][..., :3]
    assert shown[:, 20:].max() == 0.0 and shown[:, :10].mean() > 0.02


def test_it_casts_shadows_beside_it(stage, tmp_path):
    """Leaves that all lie on top, 0.1 m high, where x < 0; a sun at 45 degrees: soil is dark up to x = 0.1."""
    image = bpy.data.images.new("Half", 64, 64, float_buffer=True, is_data=True)
    grown = np.ones((64, 64, 4), np.float32)
    grown[:, 32:, :3] = 0.0
    image.pixels.foreach_set(grown.ravel())
    ground(stage, flat_patch(tmp_path / "flat.grass", 1.0), density_map=image, map_size=0.8)
    sun(stage, 45, 180)
    towards(stage, 0, 0, 0.8)
    camera = stage.scene.camera
    camera.rotation_euler = (0, 0, 0)
    shown = stage.render(8, (64, 64))["combined"][..., 0].mean(axis=0)
    lit = 0.5 / np.pi * 3.0 * np.sqrt(0.5)
    x = (np.arange(64) + 0.5) / 80 - 0.4
    np.testing.assert_allclose(shown[x > 0.13], lit, rtol=0.02)
    assert shown[(x > 0.02) & (x < 0.08)].max() < 0.05 * lit
    grass = ALBEDO[0] / np.pi * 3.0 * np.sqrt(0.5)
    np.testing.assert_allclose(shown[x < -0.05], grass, rtol=0.05)  # it shows its own shadows alone


@pytest.mark.slow
def test_in_a_hollow_nothing_is_seen_below_the_ground(stage):
    """A bowl of three metres' radius seen at a slant, where rays meet rising ground ahead. With lengths as on flat
    ground 5 % of the pixels lie more than a centimetre below it, and 9 % are dark."""

    def depth(patch):
        stage.clear()
        mesh = bpy.data.meshes.new("Bowl")
        made = bmesh.new()
        bmesh.ops.create_uvsphere(made, u_segments=96, v_segments=96, radius=3.0)
        bmesh.ops.delete(made, geom=[vertex for vertex in made.verts if vertex.co.z > -2.6], context="VERTS")
        bmesh.ops.reverse_faces(made, faces=made.faces)
        for face in made.faces:
            face.smooth = True
        made.to_mesh(mesh)
        made.free()
        material = stage.diffuse(0.5)
        material.candela.grass_patch = patch
        mesh.materials.append(material)
        stage.link("Bowl", mesh, (0, 0, 3))
        sun(stage, 0, 0)
        towards(stage, 62, 30, 1.2)
        shown = stage.render(4, (48, 48))
        return shown["depth"][..., 0], shown["combined"][..., :3].mean(axis=2)

    ground_depth, _ = depth("NONE")
    found, light = depth("MEADOW")
    within = np.maximum(found, ground_depth) < 1e9  # the field has no sides where its mesh ends
    assert within.mean() > 0.5
    assert ((found - ground_depth)[within] > 0.01).mean() < 0.005  # a pixel at the rim
    assert (light[within] < 0.1 * light[within].mean()).mean() < 0.02


def test_in_a_hollow_of_flat_faces_nothing_is_seen_below_them(stage, tmp_path):
    """A gutter of three metres' radius whose faces are 10 degrees apart, and soil that is seen through blades 0.1 m
    high: by the bend alone it would lie up to 22 mm below the next face."""

    def depth(patch):
        stage.clear()
        angles = np.radians(np.arange(-40, 41, 10))
        places = [(x, 3.0 * math.sin(a), 3.0 - 3.0 * math.cos(a)) for a in angles for x in (-2.0, 2.0)]
        mesh = bpy.data.meshes.new("Gutter")
        mesh.from_pydata(places, [], [(2 * k, 2 * k + 1, 2 * k + 3, 2 * k + 2) for k in range(len(angles) - 1)])
        mesh.shade_smooth()
        material = stage.diffuse(0.5)
        material.candela.grass_patch = patch
        material.candela.grass_file = str(flat_patch(tmp_path / "ground.grass", 0.0))
        mesh.materials.append(material)
        stage.link("Gutter", mesh)
        sun(stage, 0, 0)
        towards(stage, 60, -90, 1.6)
        shown = stage.render(4, (48, 48))
        return shown["depth"][..., 0], shown["combined"][..., :3].mean(axis=2)

    ground_depth, _ = depth("NONE")
    found, light = depth("FILE")
    within = np.maximum(found, ground_depth) < 1e9
    below = (found - ground_depth)[within]
    assert within.mean() > 0.6
    assert below.max() < 1e-4  # 22 mm by the bend alone
    assert below.min() > -0.03 and abs(np.median(below)) < 2e-3
    assert (light[within] < 0.5 * np.median(light[within])).mean() < 0.01


# UV maps ------------------------------------------------------------------------------------------------------------


def with_map(thing, place):
    """Give a mesh a UV map of what `place` (matrix of 2 x 3) makes of x, y, 1 at its vertices."""
    mesh = thing.data
    layer = mesh.uv_layers.new(name="Map")
    for loop in mesh.loops:
        x, y, _ = mesh.vertices[loop.vertex_index].co
        layer.data[loop.index].uv = np.asarray(place) @ (x, y, 1.0)
    return thing


SIDE = {"size": 0.4, "height": 0.1, "tiles": 5.0}  # of the tile, m, and as many along a map of 2 m


def seen(stage, samples=4, size=32):
    return stage.render(samples, (size, size))["combined"][..., :3]


def test_a_map_along_the_axes_shows_what_the_axes_show(stage):
    """And a mesh without a map, or with one of no area, is placed by the axes, whatever it asks for."""
    plain = ground(stage, **SIDE)
    sun(stage, 40, 20)
    towards(stage, 55, 100, 1.0)
    expected = seen(stage)
    own = plain.data.materials[0].candela
    own.grass_placement = "UV"
    assert seen(stage) == pytest.approx(expected, abs=1e-6)
    with_map(plain, [(0, 0, 0.3), (0, 0, 0.3)])
    assert seen(stage) == pytest.approx(expected, abs=1e-6)
    plain.data.uv_layers.remove(plain.data.uv_layers[0])
    with_map(plain, [(0.5, 0, 0), (0, 0.5, 0)])
    assert np.abs(seen(stage) - expected).mean() < 0.02 * expected.mean()


def test_the_map_is_one_more_attribute_if_there_is_room():
    compiled = compile_material("Soil", empty_slot_graph())
    placed = uv_placed.with_map(compiled)
    assert placed.attributes[uv_placed.map_of(placed)] == uv_placed.ACTIVE
    assert placed.program_key != compiled.program_key
    assert uv_placed.with_map(placed) is placed
    full = replace(compiled, attributes=tuple(Attribute("NAMED", f"{k}") for k in range(8)))
    refused = uv_placed.with_map(full)
    assert uv_placed.map_of(refused) == -1
    assert refused.fallbacks[-1][1].startswith("The material reads 8 attributes, so that none is left")


def test_a_turned_map_is_a_turned_object(stage):
    """Light and view turn in the tile as the map does."""
    c, s = math.cos(0.7), math.sin(0.7)
    field = ground(stage, half=6.0, **SIDE)
    field.rotation_euler.z = 0.7
    sun(stage, 50, 20)
    towards(stage, 55, 100, 1.0)
    expected = seen(stage)
    stage.scene.collection.objects.unlink(field)
    with_map(ground(stage, half=6.0, placement="UV", **SIDE), [(0.5 * c, 0.5 * s, 0), (-0.5 * s, 0.5 * c, 0)])
    assert np.abs(seen(stage) - expected).mean() < 0.02 * expected.mean()


def test_a_mirrored_map_mirrors_the_picture(stage):
    """Map, light and view are mirrored along x: so is the picture."""
    field = with_map(ground(stage, half=6.0, placement="UV", **SIDE), [(0.5, 0, 0), (0, 0.5, 0)])
    lamp, camera = sun(stage, 50, 20), towards(stage, 45, 90, 1.0)
    expected = seen(stage, 16)
    for thing in (field, lamp, camera):
        stage.scene.collection.objects.unlink(thing)
    with_map(ground(stage, half=6.0, placement="UV", **SIDE), [(-0.5, 0, 0), (0, 0.5, 0)])
    sun(stage, 50, 160)
    towards(stage, 45, 90, 1.0)
    found = seen(stage, 16)[:, ::-1]
    # Which of four views a pixel takes is drawn anew.
    assert found.mean() == pytest.approx(expected.mean(), rel=0.01)
    assert np.corrcoef(found.ravel(), expected.ravel())[0, 1] > 0.9


@pytest.mark.parametrize("place", [[(0.5, 0, 0), (0, 0.5, 0)], [(-0.25, 0.1, 0.2), (0.3, 0.7, 0)]])
def test_grass_grows_on_a_wall_as_on_the_ground(stage, tmp_path, place):
    """A wall, whose map is stretched, sheared and mirrored: depth stays, a Lambertian tile is as bright."""
    wall = with_map(ground(stage, flat_patch(tmp_path / "flat.grass", 0.5), placement="UV", **SIDE), place)
    wall.rotation_euler = (math.radians(90), 0, 0)
    way = Vector((0.3, -1.0, 0.2)).normalized()
    stage.light("SUN", turn=way.to_track_quat("Z", "Y").to_euler(), energy=3.0, angle=0.0)
    towards(stage, 90, 270, 0.5)
    shown = stage.render(2, (8, 8))
    expected = 3.0 / np.pi * ALBEDO * -way.y
    assert shown["combined"][..., :3] == pytest.approx(np.broadcast_to(expected, (8, 8, 3)), rel=0.01)
    assert shown["depth"] == pytest.approx(5.0 - 0.05, abs=1e-3)


def test_maps_lie_in_the_square_of_the_uv_map(stage, tmp_path):
    """Bare where u < 0.5, half as high where v < 0.5: seen from above, the picture's right is -x."""
    patch = flat_patch(tmp_path / "flat.grass", 1.0)
    share, height = (bpy.data.images.new(name, 2, 2, float_buffer=True, is_data=True) for name in ("Share", "Height"))
    share.pixels.foreach_set(np.tile(np.array([0, 0, 0, 1, 1, 1, 1, 1], np.float32), 2))
    height.pixels.foreach_set(np.repeat(np.array([[0.5] * 3 + [1], [1] * 4], np.float32), 2, axis=0).ravel())
    for image in (share, height):
        image.pack()
    field = ground(stage, patch, half=2.0, placement="UV", density_map=share, height_map=height, **SIDE)
    with_map(field, [(0.25, 0, 0.5), (0, 0.25, 0.5)])
    sun(stage, 0, 0)
    towards(stage, 0, 0, 4.0)
    depth = stage.render(1, (16, 16))["depth"][..., 0]
    assert depth[:, 13:] == pytest.approx(5.0, abs=1e-3)
    assert sorted(float(depth[row, 1]) for row in (1, -2)) == pytest.approx([4.9, 4.95], abs=2e-3)


def test_a_lower_height_is_a_lower_field(stage):
    """A map of one half everywhere is the field of half the height, seen at a slant."""
    image = bpy.data.images.new("Half", 2, 2, float_buffer=True, is_data=True)
    image.pixels.foreach_set(np.tile(np.array([0.5, 0.5, 0.5, 1], np.float32), 4))
    image.pack()
    field = ground(stage, height=0.1)
    sun(stage, 50, 20)
    towards(stage, 60, 100, 1.0)
    expected = seen(stage)
    own = field.data.materials[0].candela
    own.grass_height, own.grass_height_map = 0.2, image
    assert np.abs(seen(stage) - expected).mean() < 0.02 * expected.mean()


# Invariants ----------------------------------------------------------------------------------------------------------


def test_moving_by_whole_tiles_changes_nothing(stage):
    field = ground(stage, half=6.0, size=0.5)
    sun(stage, 40, 20)
    towards(stage, 45, 100, 1.0)
    expected = stage.render(1, (32, 32))["combined"]
    field.location = (1.0, -0.5, 0.0)
    assert np.abs(stage.render(1, (32, 32))["combined"] - expected).mean() < 0.02 * expected.mean()


def test_turning_all_together_changes_nothing(stage):
    field = ground(stage, half=6.0)
    lamp = sun(stage, 40, 20)
    camera = towards(stage, 45, 100, 1.0)
    expected = stage.render(4, (32, 32))["combined"][..., :3]
    turn = Matrix.Rotation(math.radians(50), 4, "Z")
    for thing in (field, lamp, camera):
        thing.matrix_world = turn @ thing.matrix_world
    found = stage.render(4, (32, 32))["combined"][..., :3]
    assert found.mean() == pytest.approx(expected.mean(), rel=0.005)
    assert np.abs(found - expected).mean() < 0.05 * expected.mean()


def test_flat_ground_has_no_outline_of_its_own(stage):
    ground(stage, half=50.0)
    sun(stage, 40, 20)
    towards(stage, 80, 10, 1.0)
    assert stage.render(1, (32, 32))["combined"][..., 3].min() == 1.0


def test_far_away_it_is_the_tiles_mean(stage):
    ground(stage, half=200.0)
    sun(stage, 35, 45)
    towards(stage, 40, 72, 100.0, 100.0)
    far = stage.render(1, (16, 16))["combined"][..., :3]
    made = patches.load(SHIPPED)
    numbers, weights = made.views.weights(np.array([math.sin(math.radians(40)) * math.cos(math.radians(72)),
                                                    math.sin(math.radians(40)) * math.sin(math.radians(72)),
                                                    math.cos(math.radians(40))]))  # fmt: skip
    own = made.lights.weights(np.array([math.sin(math.radians(35)) * math.cos(math.radians(45)),
                                        math.sin(math.radians(35)) * math.sin(math.radians(45)),
                                        math.cos(math.radians(35))]))  # fmt: skip
    mean = sum(w * v * made.picture_mean[n, m] for n, w in zip(numbers, weights) for m, v in zip(*own))
    assert far.mean(axis=(0, 1)) == pytest.approx(3.0 / math.pi * mean, rel=0.02)


# Sentences -----------------------------------------------------------------------------------------------------------


def test_a_material_without_a_file_is_left_as_it_is(stage):
    ground(stage, "FILE")
    sun(stage, 30, 0)
    stage.camera_above(1.0)
    stage.render(1, (8, 8))
    row = stage.ledger.row("grass")
    assert row.state == SKIPPED and "names no file of a grass patch" in row.reason


def test_a_wrong_file_is_a_sentence_of_the_ledger(stage, tmp_path):
    wrong = tmp_path / "wrong.grass"
    wrong.write_bytes(b"nothing")
    ground(stage, wrong)
    sun(stage, 30, 0)
    stage.camera_above(1.0)
    stage.render(1, (8, 8))
    row = stage.ledger.row("grass")
    assert row.state == SKIPPED and "wrong.grass is no grass patch, or it is damaged" in row.reason


def test_several_patches_in_one_picture(stage, tmp_path):
    ground(stage, flat_patch(tmp_path / "flat.grass", 0.0), half=2.0)
    other = ground(stage, half=2.0)
    other.location.x = 4.0
    sun(stage, 0, 0)
    stage.camera_above(8.0)
    shown = stage.render(2, (32, 32))["combined"][..., :3]
    assert stage.ledger.row("grass").state == RAN and stage.ledger.row("grass").counters["patches"] == 2
    assert shown[12:20, 10:14] == pytest.approx(np.broadcast_to(3.0 / np.pi * ALBEDO, (8, 4, 3)), rel=0.01)
    assert shown[12:20, 26:30].std() > 0.0


# Real blades ---------------------------------------------------------------------------------------------------------


def real_field(stage, tiles):
    field_of(MEADOW, stage.scene, range(-tiles, tiles))


@pytest.mark.slow
@pytest.mark.parametrize("view, light", [((40, 72), (35, 45)), ((60, 30), (35, 225)), ((75, 257.142857), (0, 0))])
def test_from_sampled_directions_it_is_the_field_of_blades(stage, view, light):
    """Mean of the tile within 3 %, contrast within 5 %."""
    pictures = []
    for name in ("CANDELA", "CYCLES"):
        stage.clear()
        stage.scene.render.filter_size = 1.5
        ground(stage) if name == "CANDELA" else real_field(stage, 10)
        sun(stage, *light)
        towards(stage, *view, 0.8)
        both = [stage.render(64, (48, 48), seed, name, bounces=None)["combined"][..., :3] @ LUMA for seed in (1, 2)]
        pictures.append(np.stack(both))
    # Noise is contrast, too: what two pictures have in common has none.
    (mine, std), (true, true_std) = ((both.mean(), np.sqrt(np.cov(*both.reshape(2, -1))[0, 1])) for both in pictures)
    assert mine == pytest.approx(true, rel=0.03)
    assert std == pytest.approx(true_std, rel=0.05)
