"""Meshes that emit light: the same irradiance as an area light of their radiance, from both sides, with shadows."""

from types import SimpleNamespace

import bmesh
import bpy
import numpy as np
import pytest

from addon.lighting import emissive_triangles
from addon.lighting.emissive_triangles import along_curve, compact
from addon.materials.energy import pane_passing
from addon.snapshot.scene import Instance
from addon.techniques import emissive_light
from tests.techniques import light_model as model
from tests.techniques.conftest import places

SIZE, SPAN = (32, 32), 4.0
RADIANCE = 5.0


@pytest.fixture
def floor(stage):
    stage.floor()
    stage.camera_above(SPAN)
    stage.glow = stage.material("ShaderNodeEmission", Strength=RADIANCE, Color=(1, 1, 1, 1))
    return stage


def receivers(stride):
    x, y = (a[::stride, ::stride].ravel() for a in places(SIZE, SPAN))
    return np.column_stack([x, y, np.zeros_like(x)])


def panel(stage, z=2.0, half=0.5, cuts=1, **placement):
    """A square emitter of cuts x cuts faces, which the camera does not see."""
    edges = np.linspace(-half, half, cuts + 1)
    corners = [(x, y, z) for y in edges for x in edges]
    faces = [
        (j * (cuts + 1) + i, j * (cuts + 1) + i + 1, (j + 1) * (cuts + 1) + i + 1, (j + 1) * (cuts + 1) + i)
        for j in range(cuts)
        for i in range(cuts)
    ]
    made = stage.mesh(corners, faces, material=stage.glow, **placement)
    made.visible_camera = False
    return made


def irradiance(stage, samples=128):
    return stage.render(samples, SIZE)["diffuse_direct"][..., 0].astype(float) * np.pi


@pytest.mark.parametrize("cuts", [1, 7])
def test_an_emissive_square_gives_its_form_factor_however_it_is_cut(floor, cuts):
    panel(floor, cuts=cuts)
    source = model.area((0, 0, 2), (1, 0, 0), (0, 1, 0), RADIANCE * np.pi)
    expected = model.irradiance(source, receivers(4))
    found = irradiance(floor)[::4, ::4].ravel()
    np.testing.assert_allclose(found, expected, rtol=0.01)
    assert found.mean() == pytest.approx(expected.mean(), rel=0.005)


@pytest.mark.parametrize("cuts", [1, 7])
def test_close_to_a_mesh_few_samples_have_no_blotches(floor, cuts):
    """A quarter of a metre below a panel of a metre: each pixel draws points of its own there."""
    panel(floor, z=0.25, cuts=cuts)
    source = model.area((0, 0, 0.25), (1, 0, 0), (0, 1, 0), RADIANCE * np.pi)
    expected = model.irradiance(source, receivers(1))
    found = irradiance(floor, 16).ravel()
    assert "of each pixel's own" in str(floor.ledger.row("emissive_light").choices)
    assert found.mean() == pytest.approx(expected.mean(), rel=0.005)
    assert np.sqrt(np.mean((found / expected - 1) ** 2)) < 0.04


def test_rays_to_points_of_each_pixels_own_pass_glass(floor):
    """A single sheet of glass below the panel, whose light no caustics bring: what leaves the floor through the sheet,
    t = (1 - F) / n2. With bounces the floor has 7.85 there, in Cycles 7.78 (9.98 without the sheet)."""
    panel(floor, z=0.25)
    sheet = floor.material("ShaderNodeBsdfGlass", IOR=1.5, Roughness=0.0)
    floor.rectangle((-3, -3), (3, 3), 0.1, material=sheet).visible_camera = False
    found = floor.render(16, SIZE)["diffuse_direct"][12:20, 12:20, 0].mean() * np.pi
    assert "of each pixel's own" in str(floor.ledger.row("emissive_light").choices)
    source = model.area((0, 0, 0.25), (1, 0, 0), (0, 1, 0), RADIANCE * np.pi)
    whole = model.irradiance(source, receivers(1)).reshape(SIZE)[12:20, 12:20].mean()
    assert found == pytest.approx(pane_passing(1.5)[1] / 1.5**2 * whole, rel=0.05)


@pytest.mark.slow
def test_emission_leaves_both_sides(floor):
    panel(floor, turn=(0, np.pi, 0), location=(0, 0, 4))
    source = model.area((0, 0, 2), (1, 0, 0), (0, 1, 0), RADIANCE * np.pi)
    assert irradiance(floor).mean() == pytest.approx(model.irradiance(source, receivers(1)).mean(), rel=0.01)


def test_the_scale_of_an_emitter_scales_its_light_with_its_area(floor):
    """Radiance stays what it is: a quarter of the area gives a quarter of the light, from far away."""
    far = panel(floor, z=0.0, half=0.2, location=(0, 0, 8))
    whole = irradiance(floor, 64).mean()
    far.scale = (0.5, 0.5, 1)
    assert irradiance(floor, 64).mean() == pytest.approx(whole / 4, rel=0.01)


@pytest.mark.slow
def test_a_blocker_before_an_emitter_casts_its_penumbra(floor):
    panel(floor)
    edge = ((-9.0, -9.0), (0.0, 9.0), 1.0)
    floor.blocker(*edge)
    source = model.area((0, 0, 2), (1, 0, 0), (0, 1, 0), RADIANCE * np.pi)
    points = receivers(2)
    whole = model.irradiance(source, points)
    expected = model.irradiance(source, points, [edge]) / whole
    found = irradiance(floor, 256)[::2, ::2].ravel() / whole
    assert np.sqrt(((found - expected) ** 2).mean()) < 0.015


@pytest.mark.slow
def test_an_emitter_in_the_plane_of_a_ceiling_is_not_shadowed_by_it(floor):
    """The lamp of a Cornell box that was not moved down."""
    panel(floor)
    alone = irradiance(floor)
    for low, high in [((-9, -9), (-0.5, 9)), ((0.5, -9), (9, 9)), ((-0.5, 0.5), (0.5, 9)), ((-0.5, -9), (0.5, -0.5))]:
        floor.blocker(low, high, 2.0)
    np.testing.assert_allclose(irradiance(floor), alone, rtol=0.02)


def test_a_mirror_shows_an_emitter_as_bright_as_it_is(stage):
    stage.floor(material=stage.material("ShaderNodeBsdfGlossy", Color=(1, 1, 1, 1), Roughness=0.0))
    stage.camera_above(SPAN)
    stage.glow = stage.material("ShaderNodeEmission", Strength=RADIANCE, Color=(1, 1, 1, 1))
    panel(stage)
    found = stage.render(4, SIZE)["glossy_direct"][..., 0]
    x, y = places(SIZE, SPAN)
    reach = np.maximum(np.abs(x), np.abs(y))
    np.testing.assert_allclose(found[reach < 0.45], RADIANCE, rtol=1e-4)
    assert (found[reach > 0.55] == 0).all()


def test_narrow_gloss_below_a_wide_emitter_is_as_bright_as_it(stage):
    """What points of the emitter and rays of the lobe find of it are shares of one whole."""
    metal = stage.material("ShaderNodeBsdfGlossy", Color=(1, 1, 1, 1), Roughness=0.2)
    stage.floor(material=metal)
    stage.camera_above(SPAN)
    stage.glow = stage.material("ShaderNodeEmission", Strength=RADIANCE, Color=(1, 1, 1, 1))
    panel(stage, half=4.0)
    found = stage.render(16, SIZE)["glossy_direct"][8:-8, 8:-8, 0]
    assert found.mean() == pytest.approx(RADIANCE, rel=0.01)


def test_without_emission_the_technique_says_so(stage):
    stage.floor()
    stage.camera_above(SPAN)
    stage.render(1)
    assert stage.ledger.row("emissive_light").reason == "no material emits light"


@pytest.mark.parametrize(("path", "other"), [("diffuse", "glossy"), ("glossy", "diffuse")])
def test_ray_visibility_says_what_an_emitter_lights(floor, path, other):
    """As in Cycles: hidden from diffuse rays it lights no diffuse surface, yet still the glossy ones."""
    floor.clear()
    glow = floor.material("ShaderNodeEmission", Strength=RADIANCE, Color=(1, 1, 1, 1))
    floor.floor(material=floor.principled(Roughness=0.7))
    floor.camera_above(SPAN)
    corners = [(-0.5, -0.5, 2), (0.5, -0.5, 2), (0.5, 0.5, 2), (-0.5, 0.5, 2)]
    shade = floor.mesh(corners, [(0, 1, 2, 3)], material=glow)
    shade.visible_camera = False
    both = floor.render(16, SIZE)
    setattr(shade, f"visible_{path}", False)
    one = floor.render(16, SIZE)
    assert both[f"{path}_direct"].max() > 0 and not one[f"{path}_direct"].any()
    np.testing.assert_allclose(one[f"{other}_direct"].mean(), both[f"{other}_direct"].mean(), rtol=0.02)


def two_panels(stage):
    stage.blocker((-0.5, -0.5), (0.5, 0.5), 1.0)
    return [panel(stage, half=0.3, location=(x, 0, 0)) for x in (-1, 1)]


def maps_of(stage, by, samples=8):
    stage.scene.candela.accumulated_maps_by = by
    stage.render(samples, SIZE)
    return stage.ledger.row("emissive_light").counters.get("maps", 0)


def test_a_slice_of_later_samples_traces_where_the_picture_does(floor):
    two_panels(floor)
    assert maps_of(floor, "MAPS", 16) > 0
    floor.scene.candela.sample_offset = 8
    assert maps_of(floor, "RAYS", 16) == 0
    assert maps_of(floor, "MAPS", 16) > 0


def test_each_picture_decides_anew_between_maps_and_rays(floor):
    """Whichever of two panels the first point falls on, and with links, of which nothing is asked."""
    panels = two_panels(floor)
    links = bpy.data.collections.new("Links")
    links.objects.link(floor.blocker((-1.9, -1.9), (-1.8, -1.8), 0.5))
    links.collection_objects[0].light_linking.link_state = "EXCLUDE"
    try:
        for linked, other in (panels, panels[::-1]):
            linked.light_linking.blocker_collection, other.light_linking.blocker_collection = links, None
            assert maps_of(floor, "RAYS") == 0
            assert maps_of(floor, "MAPS") > 0
    finally:
        bpy.data.collections.remove(links)


def glowing_ball(stage, radius, height, columns=32, rows=16):
    """A ball of which the camera sees nothing, in the order in which Blender makes its faces."""
    made = bpy.data.meshes.new("ball")
    work = bmesh.new()
    bmesh.ops.create_uvsphere(work, u_segments=columns, v_segments=rows, radius=radius)
    work.to_mesh(made)
    work.free()
    made.materials.append(stage.glow)
    stage.link("ball", made, (0, 0, height)).visible_camera = False


def shares_of_a_ball(floor, samples):
    """The light of a glowing ball on the floor, of what there should be, for five seeds: E = L A cos / d^2 of its cross
    section A."""
    radius, height = 0.2, 1.2
    glowing_ball(floor, radius, height)
    squared = (receivers(1)[:, :2] ** 2).sum(axis=1) + height**2
    expected = (RADIANCE * np.pi * radius**2 * height / squared**1.5).mean()
    shares = []
    for seed in range(5):
        radiance = floor.render(samples, SIZE, seed=seed)["diffuse_direct"][..., 0]
        shares.append(float(radiance.mean()) * np.pi / expected)
    return np.array(shares)


def test_few_samples_find_all_sides_of_a_glowing_ball(floor):
    """Points drawn in the order of its faces leave sides of it out."""
    assert np.sqrt(np.mean(np.square(shares_of_a_ball(floor, 8) - 1))) < 0.1


@pytest.mark.slow
def test_a_glowing_ball_is_as_bright_with_each_seed(floor):
    """In the order of its faces 64 samples deviate by several percent, all pixels together."""
    shares = shares_of_a_ball(floor, 64)
    assert shares.std() < 0.01 and shares.mean() == pytest.approx(1.0, abs=0.02)  # its flat faces hold 1 % less


def test_rays_of_hits_ask_no_far_side_of_a_glowing_ball(stage, monkeypatch):
    """A mirror shows a wall beside the ball: every second ray from there to it was lost. Its light stays."""
    stage.glow = stage.material("ShaderNodeEmission", Strength=RADIANCE, Color=(1, 1, 1, 1))
    stage.rectangle((-9, -9), (9, 9), material=stage.principled(Metallic=1.0, Roughness=0.0))
    stage.rectangle((-4, -4), (4, 4), material=stage.principled(Roughness=1.0), location=(0, 0, 8), turn=(np.pi, 0, 0))
    glowing_ball(stage, 0.5, 7.0)
    bpy.data.objects["ball"].visible_camera = True
    stage.camera((2.5, 0.0, 5.0), (0.0, 0.0, 0.0), angle=0.3)
    found = []
    for outwards in (emissive_triangles._outwards, lambda *_: 0.0):
        monkeypatch.setattr(emissive_triangles, "_outwards", outwards)
        shown = [stage.render(1, (16, 16), bounces=2, seed=seed)["glossy_indirect"][..., 0] for seed in range(3)]
        found.append((np.mean(shown), np.mean([np.diff(one, axis=1).std() for one in shown])))
    (light, noise), (light_before, noise_before) = found
    assert light == pytest.approx(light_before, rel=0.04)
    assert noise < 0.7 * noise_before


def test_a_glowing_ball_around_the_camera_lights_what_is_in_it(stage):
    """A floor that sees half of its inside: E = pi L."""
    stage.glow = stage.material("ShaderNodeEmission", Strength=RADIANCE, Color=(1, 1, 1, 1))
    stage.floor()
    glowing_ball(stage, 30.0, 0.0)
    stage.camera_above(SPAN)
    assert irradiance(stage, 32).mean() == pytest.approx(np.pi * RADIANCE, rel=0.03)


@pytest.mark.parametrize("scale", [(0, 0, 0), (1, 1, 0)])
def test_a_glowing_ball_scaled_to_nothing_leaves_the_picture_alone(floor, scale):
    """Its matrix has no inverse: pictures ended with an error."""
    floor.light("SUN", energy=np.pi, angle=0.0)
    glowing_ball(floor, 0.5, 1.0)
    ball = bpy.data.objects["ball"]
    ball.scale, ball.location.x, ball.visible_camera = scale, 50.0, True
    lit = floor.render(2, (8, 8), bounces=1)["diffuse_direct"][..., 0]
    assert lit == pytest.approx(np.ones((8, 8)), rel=0.03)


@pytest.mark.parametrize(("distance", "facing"), [(0.05, 0.0), (0.15, 1.0)])
def test_a_flat_ball_is_entered_by_the_distance_in_space(distance, facing):
    """A camera that clips nearer than .1 m, before the flat side of a ball: by the ball's mean scale its distance was
    taken for 22 times as much."""
    matrix, eye = np.diag([0.01, 1, 1, 1]), np.eye(4)
    eye[0, 3] = 0.01 + distance
    camera = SimpleNamespace(from_above=False, bends=False, clip_start=0.1, matrix=eye)
    frame = SimpleNamespace(
        snapshot=SimpleNamespace(camera=camera),
        materials=SimpleNamespace(compiled=[SimpleNamespace(transparent=False)]),
    )
    instance = Instance("ball", "ball", matrix, (0,))
    assert emissive_triangles._outwards(frame, instance, ball_mesh()) == facing
    assert emissive_triangles._outwards(frame, instance, ball_mesh(inwards=True)) == -facing


def ball_mesh(inwards=False):
    work = bmesh.new()
    bmesh.ops.create_icosphere(work, subdivisions=2, radius=1.0)
    positions = np.array([one.co for one in work.verts], np.float32)
    triangles = np.array([[corner.index for corner in one.verts] for one in work.faces])[:, :: -1 if inwards else 1]
    work.free()
    return SimpleNamespace(
        key=f"ball {inwards}", version=0, positions=positions, bounds_min=positions.min(axis=0),
        bounds_max=positions.max(axis=0), corner_vertices=triangles.ravel(),
        triangle_corners=np.arange(triangles.size).reshape(-1, 3), triangle_count=len(triangles),
    )  # fmt: skip


@pytest.mark.parametrize("samples", [1, 8])
def test_a_panel_lights_what_it_nearly_touches_beside_a_stronger_one(floor, samples):
    """The stronger one, below the floor, takes nearly all points; those left stand for parts of the panel that are
    wider than its distance (.12 and .31 of the light before)."""
    panel(floor, z=0.02)
    floor.glow = floor.material("ShaderNodeEmission", Strength=100 * RADIANCE, Color=(1, 1, 1, 1))
    panel(floor, z=-5.0)
    source = model.area((0, 0, 0.02), (1, 0, 0), (0, 1, 0), RADIANCE * np.pi)
    expected = model.irradiance(source, receivers(1))
    found = irradiance(floor, samples)
    assert "of each pixel's own" in str(floor.ledger.row("emissive_light").choices)
    assert found.mean() == pytest.approx(expected.mean(), rel=0.03)


def beside_a_strong_one(stage):
    """A panel 2 cm above the floor beside one of a hundred times its radiance, to which nearly all points go."""
    made = panel(stage, z=0.02)
    stage.glow = stage.material("ShaderNodeEmission", Strength=100 * RADIANCE, Color=(1, 1, 1, 1))
    return made, panel(stage, z=-5.0)


def test_a_panel_without_a_shadow_lights_what_it_nearly_touches(floor):
    made, _ = beside_a_strong_one(floor)
    made.visible_shadow = False
    source = model.area((0, 0, 0.02), (1, 0, 0), (0, 1, 0), RADIANCE * np.pi)
    expected = model.irradiance(source, receivers(1))
    assert irradiance(floor, 4).mean() == pytest.approx(expected.mean(), rel=0.03)


def test_a_panel_that_diffuse_and_glossy_paths_do_not_see_adds_no_light_close_by(floor):
    """Beside one that they see: it is dark to the floor, and casts a shadow."""
    hidden = panel(floor, z=0.02, location=(-1, 0, 0))
    hidden.visible_diffuse = hidden.visible_glossy = False
    made, _ = beside_a_strong_one(floor)
    made.location.x = 1.0
    found = irradiance(floor, 4)
    assert found[14:18, 22:26].mean() > 0.8 * RADIANCE * np.pi and found[14:18, 6:10].mean() < 0.01 * RADIANCE * np.pi


def test_panels_that_diffuse_paths_do_not_see_add_no_diffuse_light_close_by(floor):
    for made in beside_a_strong_one(floor):
        made.visible_diffuse = False
    assert irradiance(floor, 4).max() == 0.0


def test_light_close_by_ends_at_glass_where_photons_bring_what_passes(floor, monkeypatch):
    """Here none does."""
    monkeypatch.setattr(emissive_light, "meshes_answered", lambda frame: True)
    beside_a_strong_one(floor)
    sheet = floor.material("ShaderNodeBsdfGlass", IOR=1.5, Roughness=0.0)
    floor.rectangle((-3, -3), (3, 3), 0.01, material=sheet).visible_camera = False
    assert irradiance(floor, 4).max() == 0.0


def test_a_faint_lamp_near_by_is_found_beside_a_strong_one_far_away(floor):
    """It has a thousandth of the power and most of the light: points drawn by power alone miss it in most pictures."""
    panel(floor, z=1.0, half=0.1).visible_shadow = False
    floor.glow = floor.material("ShaderNodeEmission", Strength=1000 * RADIANCE, Color=(1, 1, 1, 1))
    panel(floor, z=40.0, half=0.1)
    square = (0.1, 0, 0), (0, 0.1, 0)
    near, far = (model.area((0, 0, z), *square, scale * RADIANCE * 0.04 * np.pi) for z, scale in ((1, 1), (40, 1000)))
    expected = model.irradiance(near, receivers(1)) + model.irradiance(far, receivers(1))
    found = irradiance(floor, 8)
    assert found.mean() == pytest.approx(expected.mean(), rel=0.02)
    np.testing.assert_allclose(found[::4, ::4].ravel(), expected.reshape(found.shape)[::4, ::4].ravel(), rtol=0.1)


def test_triangles_stand_along_a_curve_by_place_and_side():
    """Lamps that are far apart for what is lit stand together whole, and their sides together within them."""
    lamp, side = np.repeat(np.arange(8), 4), np.tile([0, 1, 0, 1], 8)
    shuffled = np.random.default_rng(1).permutation(32)
    places = np.column_stack([10.0 * lamp, 0.01 * np.arange(32) % 0.04, np.zeros(32)])[shuffled]
    normals = np.column_stack([np.zeros((32, 2)), 2.0 * side - 1.0])[shuffled]
    order = along_curve(places, normals, 1.0)
    assert np.count_nonzero(np.diff(lamp[shuffled][order])) == 7
    assert np.count_nonzero(np.diff(side[shuffled][order])) <= 15


def test_long_triangles_are_halved():
    corners = np.array([[[0, 0, 0], [20, 0, 0], [20, 1, 0]], [[0, 0, 5], [1, 0, 5], [1, 1, 5.0]]])
    parts, source = compact(corners, np.ones((2, 3)))
    sides = np.roll(parts, -1, axis=1) - parts
    areas = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / 2
    assert np.bincount(source, areas) == pytest.approx([10.0, 0.5])
    assert np.linalg.norm(sides, axis=2).max() < 3.0 and np.count_nonzero(source == 1) == 1


def test_beside_a_strip_that_is_near_to_few_pixels_few_samples_have_no_blotches(floor):
    """A strip of 1.5 m above the floor: close by, pixels add what points of all leave out."""
    half, z = (0.75, 0.01), 0.1
    corners = [(x * half[0], y * half[1], z) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    floor.mesh(corners, [(0, 1, 2, 3)], material=floor.glow).visible_camera = False
    area = 4 * half[0] * half[1]
    source = model.area((0, 0, z), (half[0] * 2, 0, 0), (0, half[1] * 2, 0), RADIANCE * area * np.pi)
    expected = model.irradiance(source, receivers(1)).reshape(SIZE)
    found = np.array([floor.render(4, SIZE, seed=seed)["diffuse_direct"][..., 0] for seed in range(4)]) * np.pi
    ratio = found / expected
    assert "farther off the picture's" in str(floor.ledger.row("emissive_light").choices)
    assert found.mean() == pytest.approx(expected.mean(), rel=0.005)
    assert np.sqrt(((ratio - 1) ** 2).mean()) < 0.035  # .052 with points of all alone
    assert np.sqrt(((ratio - 1) ** 2)[:, 12:20, 8:24].mean()) < 0.07  # .119


def test_a_coloured_pane_colours_light_of_points_of_each_pixels_own(floor):
    """Rays take the colours of what they pass, where all light of a near panel comes by them."""
    passed = (0.9, 0.6, 0.3)
    panel(floor, z=0.25)
    pane = floor.material("ShaderNodeBsdfTransparent", Color=(*passed, 1))
    sheet = [(x, y, 0.1) for x, y in ((-3, -3), (3, -3), (3, 3), (-3, 3))]
    floor.mesh(sheet, [(0, 1, 2, 3)], material=pane).visible_camera = False
    source = model.area((0, 0, 0.25), (1, 0, 0), (0, 1, 0), RADIANCE * np.pi)
    expected = model.irradiance(source, receivers(1)).reshape((*SIZE, 1)) * np.array(passed)
    found = floor.render(8, SIZE)["diffuse_direct"][..., :3] * np.pi
    assert "of each pixel's own" in str(floor.ledger.row("emissive_light").choices)
    np.testing.assert_allclose(found.mean((0, 1)), expected.mean((0, 1)), rtol=0.015)
    assert np.sqrt(((found - expected) ** 2).mean((0, 1)) / (expected**2).mean((0, 1))).max() < 0.4
