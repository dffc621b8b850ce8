"""Light below surfaces: closed forms of planes, invariants, what the methods mean in Cycles, and stress."""

from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from addon import engine
from addon.gfx import images
from addon.kernels import diffusion
from addon.lighting import walked_light
from addon.techniques import instant_radiosity
from bench import subsurface
from bench.subsurface_splats import edge
from tests.techniques.conftest import places
from tests.techniques.foggy_stage import box

COLOR = (0.8, 0.5, 0.2)
PATH = 0.25 / np.pi  # of a radius: Burley's d
WALK = 1.0 if bpy.app.version >= (5, 2) else 1.0 / PATH  # by what Random Walk's radii are free paths


def scattering(stage, method="BURLEY", scale=1.0, radius=(1, 1, 1), color=COLOR, weight=1.0):
    made = stage.principled(
        Base_Color=(*color, 1), Subsurface_Weight=weight, Subsurface_Radius=radius, Subsurface_Scale=scale,
        Specular_IOR_Level=0.0,
    )  # fmt: skip
    made.node_tree.nodes[0].subsurface_method = method
    return made


def slab(stage, material, half=10.0, cuts=1):
    """A block whose upper face is the plane z = 0."""
    grid = np.linspace(-half, half, cuts + 1)
    corners = [(x, y, 0.0) for y in grid for x in grid] + [
        (x, y, -2 * half) for y in (-half, half) for x in (-half, half)
    ]
    n = cuts + 1
    faces = [(j * n + i, j * n + i + 1, (j + 1) * n + i + 1, (j + 1) * n + i) for j in range(cuts) for i in range(cuts)]
    b, t = n * n, (0, cuts, n * n - n, n * n - 1)
    faces += [(b, b + 2, b + 3, b + 1)]
    faces += [(t[0], b, b + 1, t[1]), (t[1], b + 1, b + 3, t[3]), (t[3], b + 3, b + 2, t[2]), (t[2], b + 2, b, t[0])]
    return stage.mesh(corners, faces, material=material)


def sphere(stage, material, radius=1.0, **placement):
    bpy.ops.mesh.primitive_uv_sphere_add(segments=48, ring_count=24, radius=radius, **placement)
    made = bpy.context.object
    for polygon in made.data.polygons:
        polygon.use_smooth = True
    made.data.materials.append(material)
    return made


def shown(images):
    return images["combined"][..., :3]


@pytest.mark.slow
def test_an_evenly_lit_plane_has_its_albedo(stage):
    slab(stage, scattering(stage, scale=0.3))
    stage.light("SUN", energy=np.pi)
    stage.camera_above(1.0)
    assert shown(stage.render(4)).mean(axis=(0, 1)) == pytest.approx(COLOR, rel=0.015)


@pytest.mark.slow
def test_a_half_lit_plane_has_the_profile_of_an_edge(stage):
    slab(stage, scattering(stage))
    stage.blocker((-50, -50), (0, 50), 1.0)
    stage.light("SUN", energy=np.pi, angle=0.0)
    stage.camera_above(4.0)
    x = places((32, 32))[0][0]
    expected = diffusion.burley(PATH).edge(x)
    found = shown(stage.render(16)).mean(axis=0) / COLOR
    for channel in range(3):
        assert found[:, channel] == pytest.approx(expected, abs=0.015)
    assert found[:, 0] + found[::-1, 0] == pytest.approx(1.0, abs=0.015)


def test_light_that_comes_in_along_a_ball_does_not_pass_the_wall_before_it(stage):
    """In the shadow of a board the ball is black: so are its points where light would come in along the surface."""
    sphere(stage, scattering(stage, "RANDOM_WALK_SKIN", 2.0))
    stage.blocker((-1.2, -1.2), (1.2, 1.2), 1.1)
    stage.light("SUN", energy=100.0, angle=0.0)
    stage.camera((0, -4, 0), (np.pi / 2, 0, 0), 0.6)
    assert shown(stage.render(1, size=(12, 12))).max() == 0.0


@pytest.mark.slow
def test_dipole_splats_of_a_half_lit_plane_are_the_edge_of_the_dipole(stage):
    """By the specification of the source: sigma_a .1, sigma_s 2, here for an index of 1."""
    medium = diffusion.Medium(0.1, 2.0, 0.0, 1.0)
    color = (diffusion.dipole_total(medium),) * 3
    free = WALK * medium.depths[0]
    stage.scene.candela.image_space_subsurface_form = "SPLATS"
    slab(stage, scattering(stage, "RANDOM_WALK", free, color=color), half=9.0)
    stage.light("SUN", energy=np.pi, angle=0.0)
    stage.camera_above(2.0)
    whole = shown(stage.render(4, size=(8, 8)))
    assert whole == pytest.approx(0.99 * color[0], rel=0.01)  # of the dipole 1 % lies beyond a splat
    stage.blocker((-50, -50), (0, 50), 1.0)
    half = shown(stage.render(4, size=(8, 8)))[..., 0].mean(axis=0) / whole.mean()
    assert half == pytest.approx([edge(medium, x) for x in places((8, 8), 2.0)[0][0]], abs=0.02)


@pytest.mark.parametrize("turn", [0.0, np.pi])
def test_light_enters_beside_the_picture_too(stage, turn):
    """The camera sees the shadow up to its edge; what is lit, or dark, lies outside."""
    slab(stage, scattering(stage, scale=0.5), half=1.5)
    blocker = stage.blocker((-50, -50), (0, 50), 1.0)
    blocker.rotation_euler = (0, 0, turn)
    stage.light("SUN", energy=np.pi, angle=0.0)
    stage.camera_above(0.5).location.x = -0.25
    x = places((32, 32))[0][0] / 8.0 - 0.25
    expected = diffusion.burley(0.5 * PATH).edge(x if turn == 0.0 else -x)
    found = shown(stage.render(16)).mean(axis=0) / COLOR
    assert found[:, 0] == pytest.approx(expected, abs=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["BURLEY", "RANDOM_WALK", "RANDOM_WALK_SKIN"])
def test_each_method_means_what_it_means_in_cycles(stage, method):
    slab(stage, scattering(stage, method, scale=0.1 if method == "RANDOM_WALK" else 1.0))
    stage.blocker((-50, -50), (0, 50), 1.0)
    stage.light("SUN", energy=np.pi, angle=0.0)
    stage.camera_above(4.0)
    cycles = shown(stage.render(128, engine="CYCLES")).mean(axis=0)
    assert shown(stage.render(16)).mean(axis=0) == pytest.approx(cycles, abs=0.025)


def test_a_range_within_a_pixel_is_the_local_limit_to_the_bit(stage):
    slab(stage, scattering(stage, scale=1e-5))
    stage.light("AREA", energy=100)
    stage.camera_above(4.0)
    scattered = shown(stage.render(2))
    stage.clear()
    slab(stage, scattering(stage, weight=0.0))
    stage.light("AREA", energy=100)
    stage.camera_above(4.0)
    assert np.abs(scattered - shown(stage.render(2))).max() < 1e-5


def test_a_channel_without_range_leaves_walks_where_it_enters(stage):
    pictures = []
    for radius in (0.0, 0.02):
        stage.clear()
        sphere(stage, scattering(stage, "RANDOM_WALK", 0.15, (1, 0.2, radius)), 0.8)
        stage.light("SUN", energy=2)
        stage.camera_above(2.0)
        pictures.append(shown(stage.render(4, size=(12, 12))).mean(axis=(0, 1)))
    assert pictures[0] == pytest.approx(pictures[1], rel=0.1)


@pytest.mark.parametrize("method", ["BURLEY", "RANDOM_WALK"])
def test_light_takes_the_colour_of_what_it_passes_before_it_enters(stage, method):
    """Of a Transparent BSDF; without its colour, what came from beside the picture had as much of each channel."""
    sphere(stage, scattering(stage, method, 0.15, (1, 1, 1)), 0.8)
    filtering = stage.material("ShaderNodeBsdfTransparent", Color=(1, 0.1, 0.0, 1))
    stage.light("SUN", energy=2)
    stage.camera_above(2.0)
    free = shown(stage.render(32, size=(12, 12))).mean(axis=(0, 1))
    stage.blocker((-3, -3), (3, 3), 1.5, material=filtering)
    filtered = shown(stage.render(32, size=(12, 12))).mean(axis=(0, 1))
    assert filtered / free == pytest.approx([1, 0.1, 0.0], abs=0.03)


def test_without_scattering_materials_it_is_skipped_with_a_reason(stage):
    stage.floor()
    stage.light("SUN")
    stage.camera_above()
    stage.render(1)
    row = next(row for row in stage.ledger.rows if row.name == "image_space_subsurface")
    assert row.reason == "no material scatters light below its surface"
    assert "surface.scatter_share" not in stage.renderer.frame.images


@pytest.mark.slow
def test_tessellation_changes_nothing_that_is_seen(stage):
    pictures = []
    for cuts in (1, 12):
        stage.clear()
        slab(stage, scattering(stage), half=2.0, cuts=cuts)
        stage.blocker((-50, -50), (0, 50), 1.0)
        stage.light("SUN", energy=np.pi, angle=0.0)
        stage.camera_above(3.0)
        pictures.append(shown(stage.render(8)))
    assert np.abs(pictures[0] - pictures[1]).mean() < 0.006


def test_scale_changes_nothing(stage):
    pictures = []
    for scale in (1.0, 100.0):
        stage.clear()
        slab(stage, scattering(stage, scale=scale), half=10.0 * scale)
        stage.blocker((-50 * scale, -50 * scale), (0, 50 * scale), scale)
        stage.light("SUN", energy=np.pi, angle=0.0)
        camera = stage.camera_above(4.0 * scale, 10 * scale)
        camera.data.clip_end = 1000 * scale
        pictures.append(shown(stage.render(4)))
    assert np.abs(pictures[0] - pictures[1]).max() < 0.01


def test_objects_do_not_exchange_light(stage):
    material = scattering(stage, scale=2.0)
    for x in (-1.001, 1.001):
        stage.mesh(
            [(x + a, b, c) for c in (-2, 0) for b in (-4, 4) for a in (-1, 1)],
            [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (1, 3, 7, 5), (3, 2, 6, 7), (2, 0, 4, 6)], material=material,
        )  # fmt: skip
    stage.blocker((-50, -50), (0, 50), 1.0)
    stage.light("SUN", energy=np.pi, angle=0.0)
    stage.camera_above(3.0)
    picture = shown(stage.render(4))
    assert picture[:, :15].max() < 0.01 and picture[:, 18:30].min() > 0.1


def bumped(material):
    """The material, its normal turned as by a bump of an even slope."""
    nodes = material.node_tree.nodes
    turned = nodes.new("ShaderNodeNormalMap")
    turned.space = "WORLD"
    turned.inputs["Color"].default_value = (0.8, 0.5, 0.9, 1.0)
    material.node_tree.links.new(turned.outputs[0], nodes[0].inputs["Normal"])
    return material


def partly_held_out(material):
    """A mix of the material and of 0.7 holdout."""
    nodes, links = material.node_tree.nodes, material.node_tree.links
    shader, output = nodes[:2]
    mix = nodes.new("ShaderNodeMixShader")
    mix.inputs[0].default_value = 0.7
    links.new(shader.outputs[0], mix.inputs[1])
    links.new(nodes.new("ShaderNodeHoldout").outputs[0], mix.inputs[2])
    links.new(mix.outputs[0], output.inputs["Surface"])
    return material


@pytest.mark.parametrize("weight", [0.0, 1.0])
@pytest.mark.parametrize("changed", [bumped, partly_held_out])
def test_bumped_and_held_out_surfaces_hide_what_scatters_behind_them(stage, weight, changed):
    """Bumps and holdout stand beside the place that a pixel sees (surface.position): none is the mark of any place."""
    pictures = []
    for behind in (1.0, 0.0):
        stage.clear()
        front = changed(scattering(stage, scale=1e-5, color=(0.2, 0.5, 0.8), weight=weight))
        box(stage, front, (-2, -2, 0.1), (2, 2, 0.2))
        box(stage, scattering(stage, weight=behind), (-2, -2, -1), (2, 2, 0))
        stage.light("SUN", energy=np.pi)
        stage.camera_above(1.0)
        pictures.append(stage.render(2, size=(8, 8))["diffuse_direct"][..., :3])
    assert pictures[1].min() > 0.01
    assert pictures[0] == pytest.approx(pictures[1], rel=0.01)


@pytest.mark.parametrize("empty", [False, True])
def test_copies_of_one_mesh_have_their_own_light_in_any_order(stage, empty):
    """Rows of the geometry's image are ordered by place, and meshes without faces have none."""
    if empty:
        stage.mesh([])
    sheet = box(stage, scattering(stage), (-1, -1, 0), (1, 1, 0.1), location=(3, 0, 0))
    stage.link("copy", sheet.data)
    stage.light("SUN", turn=(np.pi, 0, 0), energy=np.pi)
    stage.camera((1.5, 0, 10), (0, 0, 0), 0.4)
    picture = shown(stage.render(4, size=(32, 8)))
    left, right = picture[:, 4:8].mean(axis=(0, 1)), picture[:, -8:-4].mean(axis=(0, 1))
    assert left.min() > 0.05 and right == pytest.approx(left, rel=0.05)


def test_a_thin_sheet_glows_where_it_is_lit_from_behind(stage):
    stage.rectangle((-2, -2), (2, 2), material=scattering(stage, scale=1.0))
    sheet = stage.scene.objects[-1].modifiers.new("Solidify", "SOLIDIFY")
    sheet.thickness = 0.1
    stage.light("SUN", turn=(np.pi, 0, 0), energy=np.pi)
    stage.camera_above(2.0)
    ours, cycles = shown(stage.render(16)), shown(stage.render(128, engine="CYCLES"))
    assert ours.mean(axis=(0, 1)) == pytest.approx(cycles.mean(axis=(0, 1)), rel=0.1)


@pytest.mark.parametrize("thickness", [0.05, 0.2])
def test_light_through_a_thin_slab_is_the_integral_of_the_profile(stage, thickness):
    """Cycles finds the far side by lines along the normal: 2 pi r R(r) over their distances, r to the far side."""
    stage.rectangle((-2, -2), (2, 2), material=scattering(stage, scale=1.0))
    stage.scene.objects[-1].modifiers.new("Solidify", "SOLIDIFY").thickness = thickness
    stage.light("SUN", turn=(np.pi, 0, 0), energy=np.pi)
    stage.camera_above(1.0)
    profile = diffusion.burley(PATH)
    away = (np.arange(40000) + 0.5) * 1e-4
    far = np.hypot(away, thickness)
    expected = (profile.at(far) * 2.0 * np.pi * far).sum() * 1e-4
    assert shown(stage.render(16))[..., 0].mean() / COLOR[0] == pytest.approx(expected, rel=0.03)


@pytest.mark.parametrize("light", ["world", "sun", "emissive"])
def test_a_sphere_of_burleys_is_as_in_cycles_under_every_light(stage, light):
    sphere(stage, scattering(stage, radius=(1, 0.5, 0.2)))
    stage.camera((0, -4, 0), (np.pi / 2, 0, 0), 0.6)
    if light == "world":
        stage.world()
    elif light == "sun":
        stage.light("SUN", turn=(1.2, 0, 0.6), energy=np.pi, angle=0.1)
    else:
        stage.rectangle((-1, -1), (1, 1), 3.0, material=stage.material("ShaderNodeEmission", Strength=20.0))
    ours, cycles = shown(stage.render(16)), shown(stage.render(256, engine="CYCLES"))
    assert ours.mean(axis=(0, 1)) == pytest.approx(cycles.mean(axis=(0, 1)), rel=0.04)


@pytest.mark.slow
def test_contours_finer_than_points_add_to_burleys_light_as_in_cycles(stage):
    """Waves as long as a point's cell: Cycles counts more of the profile there than of a plane. Beyond the window of
    pixels cells alone tell, so that .17 of it is missing still; .24 without lines through the mesh."""
    at = np.linspace(-1, 1, 97)
    corners = [(x, y, 0.02 * np.sin(40 * x) * np.sin(40 * y)) for y in at for x in at]
    faces = [(k, k + 1, k + 98, k + 97) for k in range(96 * 97) if k % 97 < 96]
    stage.mesh(corners, faces, material=scattering(stage, scale=0.6))
    stage.scene.objects[-1].modifiers.new("Solidify", "SOLIDIFY").thickness = 0.5
    stage.light("SUN", energy=np.pi)
    stage.camera_above(0.8)
    found, right = (
        shown(stage.render(samples, size=(12, 12), bounces=0, engine=engine)).mean(axis=(0, 1))
        for engine, samples in (("CANDELA", 8), ("CYCLES", 256))
    )
    assert found == pytest.approx(right, rel=0.2)


@pytest.mark.slow
def test_indirect_light_enters_too(stage):
    slab(stage, scattering(stage, scale=0.3), half=3.0)
    wall = stage.rectangle((-3, -3), (3, 3), 0.0, material=stage.diffuse(0.8))
    wall.location, wall.rotation_euler = (1.5, 0, 1), (0, -np.pi / 2, 0)
    stage.light("SUN", turn=(0, -0.9, 0), energy=np.pi)
    stage.camera_above(2.0)
    ours = stage.render(32, bounces=1)["diffuse_indirect"][..., :3].mean()
    cycles = stage.render(256, bounces=1, engine="CYCLES")["diffuse_indirect"][..., :3].mean()
    assert instant_radiosity.SUBSETS and ours == pytest.approx(cycles, rel=0.1)


@pytest.mark.slow
def test_an_object_is_thinner_where_another_stands_inside(stage):
    sphere(stage, scattering(stage, "RANDOM_WALK", scale=0.3))
    inside = box(stage, stage.diffuse(0.0), location=(5, 0, 0))
    stage.floor(z=-2.0)
    stage.light("SUN", energy=np.pi)
    stage.camera_above(4.0)

    def thickness():
        stage.render(size=(16, 16))
        techniques = stage.renderer.techniques
        shapes = next(one for one in techniques if one.name == "image_space_subsurface")._shapes
        return images.read(shapes)[..., 2]

    whole = thickness()
    inside.location = 0, 0, 0
    seen = thickness()
    engine.free_sessions()
    np.testing.assert_array_equal(seen, thickness())
    assert seen.mean() < 0.9 * whole.mean()


def test_one_sample_is_smooth(stage):
    sphere(stage, scattering(stage, scale=2.0))
    stage.world()
    stage.camera((0, -4, 0), (np.pi / 2, 0, 0), 0.6)
    picture = shown(stage.render(1, size=(64, 64)))[24:40, 24:40, 0]
    assert picture.std() / picture.mean() < 0.03


@pytest.mark.parametrize(
    "change",
    [
        {"Subsurface_Radius": (0, 0, 0)}, {"Subsurface_Scale": 1e6}, {"Base_Color": (1, 1, 1, 1)},
        {"Base_Color": (0, 0, 0, 1)}, {"Subsurface_Anisotropy": 0.99}, {"Subsurface_Radius": (1e30, 1, 0)},
        {"Thin_Wall": True},
    ],
)  # fmt: skip
@pytest.mark.parametrize("method", ["BURLEY", "RANDOM_WALK", "RANDOM_WALK_SKIN"])
def test_extreme_settings_stay_finite(stage, method, change):
    material = scattering(stage, method)
    for name, value in change.items():
        socket = material.node_tree.nodes[0].inputs.get(name.replace("_", " "))
        if socket is not None:
            socket.default_value = value
    sphere(stage, material)
    stage.light("POINT", (0, 0, 0.5), energy=10)  # inside
    stage.light("SUN")
    stage.camera((0, -1.02, 0), (np.pi / 2, 0, 0), 1.2)  # the near plane cuts the range
    picture = shown(stage.render(2, size=(16, 16)))
    assert picture.min() >= 0.0


@pytest.mark.slow
def test_many_materials_and_no_light(stage):
    for k in range(16):
        sphere(stage, scattering(stage, color=(0.1 + 0.05 * k, 0.5, 0.3)), 0.2, location=(k % 4 - 1.5, k // 4 - 1.5, 0))
    stage.camera_above(4.0)
    assert shown(stage.render(1)).max() == 0.0
    stage.light("SUN")
    assert shown(stage.render(1)).max() > 0.0


def _map(name, color):
    """An image of 64 x 64 pixels, scene-linear, by a function of u."""
    image = bpy.data.images.new(name, 64, 64, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    u = (np.arange(64) + 0.5) / 64
    pixels = np.ones((64, 64, 4), np.float32)
    pixels[..., :3] = np.array([color(x) for x in u], np.float32)[None]
    image.pixels.foreach_set(pixels.ravel())
    return image


def _painted_plane(stage, **maps):
    material = scattering(stage)
    plane = stage.card(material, 0.0, 1.0)
    plane.scale = (2, 2, 1)
    for name, image in maps.items():
        setattr(material.candela, f"image_space_subsurface_{name}", image)
    stage.light("SUN", energy=np.pi, angle=0.0)
    stage.camera_above(2.0)
    return stage.render(16)


@pytest.mark.slow
def test_neutral_maps_equal_no_maps_to_the_bit(stage):
    plain = shown(_painted_plane(stage))
    stage.clear()
    maps = {"blur_map": 0.5, "tint_map": 1.0, "translucency_map": 1.0}
    painted = {name: _map(name, lambda x, value=value: (value,) * 3) for name, value in maps.items()}
    assert np.array_equal(shown(_painted_plane(stage, **painted)), plain)


@pytest.mark.slow
def test_the_edge_of_a_painted_tint_is_as_soft_as_the_range(stage):
    tint = _map("tint", lambda x: (0.25, 1.0, 1.0) if x > 0.5 else (1.0, 1.0, 1.0))
    picture = shown(_painted_plane(stage, tint_map=tint)).mean(axis=0)
    x = places((32, 32), 2.0)[0][0]
    beside = diffusion.burley(PATH).edge(x)
    assert picture[:, 0] / COLOR[0] == pytest.approx(1.0 - 0.75 * beside, abs=0.03)
    assert picture[:, 1] / COLOR[1] == pytest.approx(1.0, abs=0.03)


@pytest.mark.slow
def test_where_nothing_is_translucent_it_is_diffuse_and_gives_nothing(stage):
    mask = _map("mask", lambda x: (0.0, 0.0, 0.0))
    assert shown(_painted_plane(stage, translucency_map=mask)) == pytest.approx(
        np.broadcast_to(COLOR, (32, 32, 3)), abs=1e-5
    )


@pytest.mark.parametrize("bend", [-0.4, 0.4])
def test_an_open_sheet_is_the_same_on_either_side_and_as_in_cycles(stage, bend):
    """It bends up or down, so that its signed volume, which means nothing, has either sign."""
    pictures = []
    for winding in (1, -1):
        stage.clear()
        grid = np.linspace(-1, 1, 9)
        corners = [(x, y, bend * x * x) for y in grid for x in grid]
        faces = [(k, k + 1, k + 10, k + 9)[::winding] for k in range(71) if k % 9 < 8]
        stage.mesh(corners, faces, material=scattering(stage, "RANDOM_WALK", 0.05))
        stage.light("SUN", energy=np.pi)
        stage.camera_above(0.8)
        pictures.append(shown(stage.render(4)).mean(axis=(0, 1)))
    assert pictures[0] == pytest.approx(pictures[1], rel=0.01)
    assert pictures[0] == pytest.approx(shown(stage.render(64, engine="CYCLES")).mean(axis=(0, 1)), rel=0.06)


@pytest.mark.parametrize("up", [-0.2, 0.2])
def test_a_waved_sheet_has_its_light_below_whichever_way_its_middle_bends(stage, up):
    """Ridges .2 high, two radii apart, whose middle is a crest or a trough; an open sheet has no inside."""
    grid = np.linspace(-1, 1, 41)
    corners = [(x, y, up * np.cos(10 * x)) for y in grid for x in grid]
    faces = [(k, k + 1, k + 42, k + 41) for k in range(41 * 40) if k % 41 < 40]
    stage.mesh(corners, faces, material=scattering(stage, "RANDOM_WALK", 0.2))
    stage.light("SUN", energy=np.pi)
    stage.camera_above(1.2)
    own, cycles = (shown(stage.render(n, engine=e)).mean(axis=(0, 1)) for n, e in ((8, "CANDELA"), (128, "CYCLES")))
    print(f"middle {'up' if up > 0 else 'down'}: {own.round(4)}, Cycles {cycles.round(4)}")
    assert own == pytest.approx(cycles, rel=0.06)


@pytest.mark.slow
def test_relief_over_wax_is_a_mesh_of_its_heights(stage):
    """Light enters and leaves where triangles are: a coarse slab is cut as finely as its displacement asks for, and
    looks as one that was fine before."""
    wax = scattering(stage, scale=0.5)
    nodes, links = wax.node_tree.nodes, wax.node_tree.links
    waves, displacement = nodes.new("ShaderNodeTexWave"), nodes.new("ShaderNodeDisplacement")
    links.new(nodes.new("ShaderNodeTexCoord").outputs["Object"], waves.inputs["Vector"])
    waves.inputs["Scale"].default_value, displacement.inputs["Scale"].default_value = 0.5, 0.3
    links.new(waves.outputs["Fac"], displacement.inputs["Height"])
    output = next(one for one in nodes if one.type == "OUTPUT_MATERIAL")
    links.new(displacement.outputs[0], output.inputs["Displacement"])
    wax.displacement_method, wax.candela.relief_mode = "DISPLACEMENT", "RELIEF"
    slab(stage, wax, half=1.0)
    body = stage.scene.objects[-1]
    stage.light("SUN", turn=(0.6, 0, 0.4))
    stage.camera_above(1.0)
    coarse = shown(stage.render(4, (16, 16)))
    assert any(note.material == wax.name and "cut finer" in note.text for note in stage.ledger.notes)
    fine = body.modifiers.new("Subdivision", "SUBSURF")
    fine.subdivision_type, fine.levels, fine.render_levels = "SIMPLE", 6, 6
    assert coarse.mean(axis=(0, 1)) == pytest.approx(shown(stage.render(4, (16, 16))).mean(axis=(0, 1)), rel=0.03)


def walked_through(paths, albedo, walks=200_000):
    """Shares of walks, straight into a slab of so many free paths, that leave it in front and behind: a plain walk."""
    random = np.random.default_rng(1)
    z, along, alive = np.zeros(walks), np.ones(walks), np.ones(walks, bool)
    left = np.zeros(2)
    while alive.any():
        z = z + along * -np.log(random.random(walks))
        out = alive & ((z < 0.0) | (z > paths))
        left += (out & (z < 0.0)).sum(), (out & (z > paths)).sum()
        alive &= ~out & (random.random(walks) < albedo)
        along = random.uniform(-1.0, 1.0, walks)
    return left / walks


@pytest.mark.parametrize(("paths", "color"), [(0.5, 0.8), (3.0, 0.8), (8.0, 0.8), (8.0, 0.95)])
@pytest.mark.parametrize("behind", [True, False])
def test_walks_through_a_slab_are_plain_walks(stage, paths, color, behind):
    """Of a colour of .95 a seventh of what comes through eight free paths was lost when walks had 64 steps."""
    material = scattering(stage, "RANDOM_WALK", 0.1 * WALK, color=(color,) * 3)
    material.node_tree.nodes[0].inputs["Roughness"].default_value = 0.0
    stage.rectangle((-3, -3), (3, 3), material=material)
    stage.scene.objects[-1].modifiers.new("Solidify", "SOLIDIFY").thickness = 0.1 * paths
    stage.light("SUN", turn=(np.pi if behind else 0.0, 0, 0), energy=np.pi, angle=0.0)
    stage.camera_above(0.5)
    root = np.sqrt(9.59217 + 41.6808 * color + 17.7126 * color**2)
    expected = walked_through(paths, 1.0 - (4.20863 * color + 4.09712 - root) ** 2)[int(behind)]
    assert shown(stage.render(4, size=(24, 24))).mean() == pytest.approx(expected, rel=0.03)


@pytest.mark.parametrize(("color", "scale"), [(0.8, 1.0), (0.95, 3.0), (1.0, 10.0)])
def test_light_skin_has_the_free_paths_of_cycles(stage, color, scale):
    """Random Walk (Skin), light through a slab: 1.04, .82 and 4.6 of Cycles' with the limit of its 12 bisections."""
    stage.rectangle((-1.5, -1.5), (1.5, 1.5), 1.0, scattering(stage, "RANDOM_WALK_SKIN", scale, color=(color,) * 3))
    stage.scene.objects[-1].modifiers.new("Solidify", "SOLIDIFY").thickness = 0.15
    stage.light("SUN", energy=np.pi)
    stage.camera((0, 0, -2), (np.pi, 0, 0), 0.05)
    own, cycles = (shown(stage.render(n, size=(8, 8), engine=e)).mean() for n, e in ((16, "CANDELA"), (512, "CYCLES")))
    assert own == pytest.approx(cycles, rel=0.03)


def test_walks_in_a_white_body_under_an_even_world_lose_nothing(stage):
    sphere(stage, scattering(stage, "RANDOM_WALK", 0.3 * WALK, color=(1, 1, 1)), radius=1.0)
    stage.world((1, 1, 1))
    stage.camera_above(0.5, 5.0)
    assert shown(stage.render(16, size=(24, 24))).mean() == pytest.approx(1.0, abs=0.03)
    # Its far side is lit from where the camera sees nothing: directions by what it sees left .046.
    few = [shown(stage.render(4, size=(8, 8), seed=seed)).mean() for seed in range(6)]
    assert np.std(few, ddof=1) < 0.025


def test_walks_light_a_ball_from_behind_as_in_cycles(stage):
    sphere(stage, scattering(stage, "RANDOM_WALK", 0.4 * WALK, radius=(1, 0.6, 0.3)), radius=1.0)
    stage.light("SUN", turn=(2.4, 0, 0), energy=np.pi, angle=0.1)
    stage.camera_above(0.9, 5.0)
    cycles = shown(stage.render(512, size=(24, 24), engine="CYCLES")).mean(axis=(0, 1))
    assert shown(stage.render(16, size=(24, 24))).mean(axis=(0, 1)) == pytest.approx(cycles, rel=0.05, abs=2e-4)


def test_walks_find_light_behind_the_rim_of_a_thin_body(stage):
    """A lens lit from behind: what leaves beyond its silhouette, bright, is in no pixel, whose mean is dark."""
    lens = sphere(stage, scattering(stage, "RANDOM_WALK", 0.15 * WALK, radius=(1, 0.6, 0.3)), radius=1.0)
    lens.scale = (1.0, 1.0, 0.4)
    stage.light("SUN", turn=(np.pi - 0.6, 0, 0), energy=np.pi, angle=0.1)
    stage.camera_above(2.2, 5.0)
    cycles = shown(stage.render(512, size=(16, 16), engine="CYCLES")).mean(axis=(0, 1))
    assert shown(stage.render(16, size=(16, 16))).mean(axis=(0, 1)) == pytest.approx(cycles, rel=0.04, abs=2e-4)


@pytest.mark.slow
def test_the_dark_rim_of_a_block_gets_no_light_of_pixels_further_in(stage, monkeypatch):
    """A block of wax lit from behind, dim pixels of its outline: a mean over pixels on their one side alone made their
    red 1.27 of Cycles' (pictures of 1.17 to 1.35)."""
    subsurface.block("RANDOM_WALK")
    monkeypatch.setattr(stage.scene.render, "filter_size", 1.5)
    cycles = shown(stage.render(4096, size=(32, 24), engine="CYCLES"))  # to 1 %: of 512 two seeds are 13 % apart
    ours = np.mean([shown(stage.render(64, size=(32, 24), seed=seed)) for seed in range(1, 5)], axis=0)
    bright = cycles @ [0.2126, 0.7152, 0.0722]
    dim = (bright > 0.002) & (bright < 0.02)
    print(f"dim {(ours[dim].sum(axis=0) / cycles[dim].sum(axis=0)).round(3)}")
    # Pictures of 64 samples differ by 3 % (of 16 by 7 %), the mean of four by half of that: 1.04, 1.16 with that fault.
    assert ours[dim, 0].sum() == pytest.approx(cycles[dim, 0].sum(), rel=0.1)


def test_small_pictures_have_as_many_walks_a_free_path_as_large_ones(stage):
    """Relative noise of eight samples of a ball whose pixels are as wide as free paths: .32 with one walk in each."""
    sphere(stage, scattering(stage, "RANDOM_WALK", 0.1 * WALK, radius=(1, 1, 1)), radius=0.5)
    stage.light("SUN", turn=(1.9, 0, 0), energy=np.pi, angle=0.1)
    stage.camera_above(0.9, 5.0)
    pictures = np.array([shown(stage.render(8, size=(8, 8), seed=k)) for k in range(6)])[:, 2:6, 2:6]
    noise = (pictures.std(axis=0, ddof=1) / pictures.mean(axis=0)).mean()
    assert noise < 0.22


@pytest.mark.parametrize("method", ["BURLEY", "RANDOM_WALK", "RANDOM_WALK_SKIN"])
def test_what_is_painted_opaque_lets_no_light_through(stage, method):
    material = scattering(stage, method, 0.1 * WALK if method == "RANDOM_WALK" else 1.0)
    card = stage.card(material, 0.0, 1.0)
    card.modifiers.new("Solidify", "SOLIDIFY").thickness = 0.05
    mask = _map("opaque on the right", lambda u: (float(u < 0.5),) * 3)
    material.candela.image_space_subsurface_translucency_map = mask
    stage.light("SUN", turn=(np.pi, 0, 0), energy=np.pi)
    stage.camera_above(1.6)
    picture = shown(stage.render(4, size=(24, 24)))[..., 0]
    assert picture[:, :9].mean() > 0.3 and picture[:, 14:].max() < 0.02


def test_walks_of_a_pixel_are_those_of_the_whole_picture():
    """A pixel as wide as a free path had 16 walks in every sample, however many samples there were."""

    def dense(samples, draft=False):
        schedule = SimpleNamespace(is_draft=draft)
        settings = SimpleNamespace(samples=samples, schedule=schedule)
        return walked_light.walks_of(SimpleNamespace(settings=settings))["dense_walks"]

    assert dense(1) == dense(16) == walked_light.FEW_DENSE
    assert 128 * dense(128) == 1024 * dense(1024) == walked_light.DENSE
    assert dense(1, draft=True) == 1.0
