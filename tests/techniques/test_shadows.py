"""Shadows against geometry: penumbrae as clipped areas, blockers that add up, alpha, no acne, no leaks."""

import numpy as np
import pytest

from addon import engine
from addon.techniques import direct_light
from tests.techniques import light_model as model
from tests.techniques.conftest import places

SPAN = 4.0
EVERYWHERE = 9.0


@pytest.fixture
def floor(stage):
    """A white floor seen from above. Shadows as they are summed up, not denoised."""
    stage.scene.candela.denoise_strength = 0.0
    stage.floor()
    stage.camera_above(SPAN)
    return stage


def irradiance(stage, samples, size, seed=0):
    return stage.render(samples, size, seed)["diffuse_direct"][..., 0].astype(float) * np.pi


def receivers(size):
    x, y = (a.ravel() for a in places(size, SPAN))
    return np.column_stack([x, y, np.zeros_like(x)])


HEIGHT = 2.0
LIGHTS = {  # kind, settings, the same for light_model
    "square": ("AREA", {"size": 1.0}, model.area((0, 0, HEIGHT), (1, 0, 0), (0, 1, 0), 100)),
    "rectangle": (
        "AREA", {"shape": "RECTANGLE", "size": 1.6, "size_y": 0.3},
        model.area((0, 0, HEIGHT), (1.6, 0, 0), (0, 0.3, 0), 100),
    ),
    "disc": ("AREA", {"shape": "DISK", "size": 1.2}, model.area((0, 0, HEIGHT), (1.2, 0, 0), (0, 1.2, 0), 100, True)),
    "sphere": (
        "POINT", {"shadow_soft_size": 0.5, "use_soft_falloff": False}, model.sphere((0, 0, HEIGHT), 0.5, 100),
    ),
    "soft point": ("POINT", {"shadow_soft_size": 0.4}, model.soft_point((0, 0, HEIGHT), 0.4, 100)),
    "sun": ("SUN", {"angle": 0.6}, model.sun((0, 0, 1), 0.6, 1.0)),
}  # fmt: skip

# Soft points are drawn from a ball, see accumulated_maps.py: their penumbra is exact to (radius / distance)^2 only.
PENUMBRA_RMS = {"soft point": 0.015}


@pytest.mark.parametrize("name", [pytest.param(n, marks=() if n == "disc" else pytest.mark.slow) for n in LIGHTS])
def test_the_penumbra_of_an_edge_is_the_clipped_area_of_the_light(floor, name):
    kind, settings, source = LIGHTS[name]
    floor.light(kind, (0, 0, HEIGHT), **settings)
    edge = ((-EVERYWHERE, -EVERYWHERE), (0.0, EVERYWHERE), 1.0)
    floor.blocker(*edge)
    size = (64, 4)
    points = receivers(size)
    whole = model.irradiance(source, points)
    expected = model.irradiance(source, points, [edge]) / whole
    found = irradiance(floor, 256, size).ravel() / whole
    assert ((expected > 0.05) & (expected < 0.95)).sum() > 10  # there is a penumbra
    assert np.sqrt(((found - expected) ** 2).mean()) < PENUMBRA_RMS.get(name, 0.01)
    assert (found[expected == 0] == 0).all()


@pytest.mark.parametrize("kind", ["POINT", "SUN"])
def test_rays_make_hard_edges_exact_whatever_the_resolution_of_the_map(floor, kind):
    floor.light(kind, (0.3, 0, HEIGHT), **({"angle": 0.0} if kind == "SUN" else {"shadow_soft_size": 0.0}))
    for x in np.arange(-1.5, 1.6, 0.5):
        floor.blocker((x, -EVERYWHERE), (x + 0.21, EVERYWHERE), 0.3)
    settings, size = floor.scene.candela, (64, 16)
    settings.accumulated_maps_by = "MAPS"
    shown = {}
    for texels, rays in ((16.0, True), (1.0, True), (1.0, False)):
        settings.accumulated_maps_texels_per_pixel, settings.accumulated_maps_edge_rays = texels, rays
        shown[texels, rays] = irradiance(floor, 1, size) > 0
    differ = {case: (shadow != shown[16.0, True]).mean() for case, shadow in shown.items()}
    assert differ[1.0, True] == 0.0
    assert differ[1.0, False] > 0.02


def test_a_huge_scene_around_them_opens_no_contact(floor):
    """Where a ray would start beyond the blocker that it looks for, the map decides."""
    floor.light("POINT", (0, 0, HEIGHT), shadow_soft_size=0.0)
    floor.blocker((-0.5, -EVERYWHERE), (0.5, EVERYWHERE), 0.01)
    x = abs(receivers((32, 8))[:, 0])
    for _ in range(2):
        lit = irradiance(floor, 1, (32, 8)).ravel() > 0
        assert not lit[x < 0.4].any() and lit[x > 0.6].all()
        floor.rectangle((-1e6, -1e6), (1e6, 1e6), -1.0)


@pytest.mark.slow
def test_the_width_of_a_penumbra_follows_from_similar_triangles(floor):
    """A light of width w at height H over an edge at height h: w h / (H - h)."""
    floor.light("AREA", (0, 0, HEIGHT), size=0.8)
    source = model.area((0, 0, HEIGHT), (0.8, 0, 0), (0, 0.8, 0), 100)
    for edge_height in (0.25, 0.5, 1.0):
        blocker = floor.blocker((-EVERYWHERE, -EVERYWHERE), (0, EVERYWHERE), edge_height)
        size = (128, 4)
        share = irradiance(floor, 256, size)[0] / model.irradiance(source, receivers(size)[:128])
        width = ((share > 0.01) & (share < 0.99)).sum() * SPAN / 128
        expected = 0.8 * edge_height / (HEIGHT - edge_height)
        assert width == pytest.approx(expected, rel=0.05, abs=2 * SPAN / 128)
        blocker.hide_render = True


@pytest.mark.slow
@pytest.mark.parametrize("name", ["square", "sphere", "sun"])
def test_blockers_at_two_heights_block_together_what_either_blocks(floor, name):
    """Two edges that leave a slit: shadows are united per point of the light, not multiplied."""
    kind, settings, source = LIGHTS[name]
    floor.light(kind, (0, 0, HEIGHT), **settings)
    edges = [
        ((-EVERYWHERE, -EVERYWHERE), (-0.1, EVERYWHERE), 1.2),
        ((0.15, -EVERYWHERE), (EVERYWHERE, EVERYWHERE), 0.5),
    ]
    for edge in edges:
        floor.blocker(*edge)
    size = (64, 4)
    points = receivers(size)
    whole = model.irradiance(source, points)
    expected = model.irradiance(source, points, edges) / whole
    separate = np.prod([model.irradiance(source, points, [edge]) / whole for edge in edges], axis=0)
    found = irradiance(floor, 256, size).ravel() / whole
    error = np.sqrt(((found - expected) ** 2).mean())
    assert error < 0.015
    assert error < 0.5 * np.sqrt(((separate - expected) ** 2).mean())


@pytest.mark.slow
def test_a_grid_of_bars_at_two_heights_blocks_as_the_union_of_its_bars(floor):
    floor.light("AREA", (0, 0, HEIGHT), size=0.6)
    floor.scene.candela.accumulated_maps_texels_per_pixel = 8.0  # narrow bars: texels blur what lies within them
    bars = [((x, -EVERYWHERE), (x + 0.2, EVERYWHERE), 0.8) for x in np.arange(-1.4, 1.4, 0.4)]
    bars += [((-EVERYWHERE, y), (EVERYWHERE, y + 0.2), 0.6) for y in np.arange(-1.4, 1.4, 0.4)]
    for bar in bars:
        floor.blocker(*bar)
    source, size = model.area((0, 0, HEIGHT), (0.6, 0, 0), (0, 0.6, 0), 100), (32, 32)
    points = receivers(size).reshape(*size[::-1], 3)[1::3, 1::3].reshape(-1, 3)
    expected = model.irradiance(source, points, bars) / model.irradiance(source, points)
    found = irradiance(floor, 256, size)[1::3, 1::3].ravel() / model.irradiance(source, points)
    assert np.sqrt(((found - expected) ** 2).mean()) < 0.015  # a dozen edges, each of 0.005 at 256 samples
    assert found.mean() == pytest.approx(expected.mean(), rel=0.01)


# Transparent casters -------------------------------------------------------------------------------------------------

POINT = ("POINT", {"shadow_soft_size": 0.0}, model.point((0, 0, HEIGHT), 100))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("light", "opacities"),
    [
        (POINT, (0.0,)),
        (POINT, (0.5,)),
        (POINT, (1.0, 0.5)),
        (POINT, (0.2, 0.7, 0.4)),
        (LIGHTS["square"], (0.5,)),
        (LIGHTS["sun"], (0.5, 0.5)),
    ],
    ids=["clear", "half", "opaque", "three layers", "half of a square", "two layers of a sun"],
)
def test_layers_with_alpha_let_the_product_of_their_transparencies_pass(floor, light, opacities):
    kind, settings, source = light
    floor.light(kind, (0, 0, HEIGHT), **settings)
    for k, opacity in enumerate(opacities):
        corner = (EVERYWHERE, EVERYWHERE)
        floor.blocker((-EVERYWHERE, -EVERYWHERE), corner, 0.4 + 0.3 * k, material=floor.see_through(opacity))
    size, samples = (24, 24), 128
    through = np.prod([1 - opacity for opacity in opacities])
    found = irradiance(floor, samples, size).ravel() / model.irradiance(source, receivers(size))
    # Each texel and sample lets light pass or not: independent coins, 576 x 128 of them.
    spread = np.sqrt(through * (1 - through) / samples)
    assert found.mean() == pytest.approx(through, abs=0.004 + 4 * spread / 24)
    assert found.std() <= 1.3 * spread + 0.004


def test_an_object_without_shadow_visibility_casts_none(floor):
    floor.light("POINT", shadow_soft_size=0)
    free = floor.render(1)["combined"]
    blocker = floor.blocker((-1, -1), (1, 1), 1.0)
    blocked = floor.render(1)["combined"]
    blocker.visible_shadow = False
    np.testing.assert_allclose(floor.render(1)["combined"], free, rtol=1e-6)
    assert blocked[..., :3].mean() < 0.5 * free[..., :3].mean()


def test_a_round_light_near_a_part_of_the_floor_has_rays_there_and_maps_elsewhere(floor):
    """Its penumbra is the clipped area on both sides of where the one kind of visibility takes over from the other."""
    place = (-1.6, 0.0, 1.0)
    floor.light("POINT", place, shadow_soft_size=0.4, use_soft_falloff=False)
    floor.blocker((-EVERYWHERE, 0.4), (EVERYWHERE, EVERYWHERE), 0.4)
    size = (32, 32)
    source, points = model.sphere(place, 0.4, 100), receivers(size)
    near = np.linalg.norm(points - place, axis=1) < 0.4 / direct_light.NEAR
    assert 0.1 < near.mean() < 0.5
    whole = model.irradiance(source, points)
    expected = model.irradiance(source, points, [((-EVERYWHERE, 0.4), (EVERYWHERE, EVERYWHERE), 0.4)]) / whole
    found = irradiance(floor, 64, size).ravel() / whole
    for part in (near, ~near):
        assert np.sqrt(np.mean((found - expected)[part] ** 2)) < 0.015


def test_a_light_without_shadow_passes_through_everything(floor):
    light = floor.light("POINT", shadow_soft_size=0.2)
    free = floor.render(16)["combined"]
    floor.blocker((-9, -9), (9, 9), 1.0)
    assert not floor.render(16)["combined"][..., :3].any()
    light.data.use_shadow = False
    np.testing.assert_allclose(floor.render(16)["combined"], free, rtol=1e-5)


# Contact, acne, leaks ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_a_shadow_starts_where_its_caster_touches_the_floor(stage, scale):
    """At any size of the scene: no gap of light at the foot of a wall, no dark rim before it."""
    stage.floor(20 * scale)
    stage.camera_above(SPAN * scale, height=10 * scale)
    stage.scene.camera.data.clip_end = 100 * scale
    stage.scene.camera.data.clip_start = 0.1 * scale
    corners = np.array([(0, -9, 0), (0, 9, 0), (0, 9, 1), (0, -9, 1)]) * scale
    stage.mesh([tuple(c) for c in corners], [(0, 1, 2, 3)]).visible_camera = False
    place = np.array((2.0, 0.0, 2.0)) * scale
    stage.light("POINT", place, shadow_soft_size=0, energy=100 * scale**2)
    size = (64, 8)
    x, y = (a * scale for a in places(size, SPAN))
    found = irradiance(stage, 1, size)
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    expected = model.irradiance(model.point(place, 100 * scale**2), points).reshape(x.shape)
    assert (found[(x < 0) & (x > -1.9 * scale)] == 0).all()  # at -2 the shadow ends
    np.testing.assert_allclose(found[x > 0], expected[x > 0], rtol=2e-3)


@pytest.mark.parametrize("tilt", [45.0, 80.0, 89.0, 89.9])
def test_a_plane_under_a_grazing_sun_does_not_shadow_itself(floor, tilt):
    floor.light("SUN", turn=(np.radians(tilt), 0.1, 0), angle=0.0)
    cosine = np.cos(np.radians(tilt)) * np.cos(0.1)
    np.testing.assert_allclose(irradiance(floor, 4, (32, 32)), cosine, rtol=5e-3)


@pytest.mark.parametrize("position", [(0, 0, 1.0), (1.9, 0, 0.1), (0.0, 0.0, 0.02)])
def test_a_plane_under_a_point_close_to_it_does_not_shadow_itself(floor, position):
    floor.light("POINT", position, shadow_soft_size=0)
    expected = model.irradiance(model.point(position, 100), receivers((32, 32)))
    np.testing.assert_allclose(irradiance(floor, 1, (32, 32)).ravel(), expected, rtol=5e-3)


def test_a_smooth_sphere_is_lit_up_to_its_terminator(stage):
    """The light side of a finely divided sphere: radiance S cos / pi, without stripes or missing triangles."""
    import bmesh
    import bpy

    stage.scene.candela.denoise_strength = 0.0
    data, shape = bpy.data.meshes.new("Sphere"), bmesh.new()
    bmesh.ops.create_icosphere(shape, subdivisions=5, radius=1.5)
    for face in shape.faces:
        face.smooth = True
    shape.to_mesh(data)
    shape.free()
    data.materials.append(stage.diffuse())
    stage.link("Sphere", data)
    stage.camera_above(SPAN)
    stage.light("SUN", turn=(0.7, 0, 0), angle=0.0)
    images = stage.render(4, (48, 48))
    towards = np.array([0.0, -np.sin(0.7), np.cos(0.7)])
    normal = images["normal"].astype(float)
    inside = np.linalg.norm(normal, axis=-1) > 0.999
    cosine = normal @ towards
    found = images["diffuse_direct"][..., 0] * np.pi
    np.testing.assert_allclose(found[inside & (cosine > 0.1)], cosine[inside & (cosine > 0.1)], atol=0.01)
    assert (found[inside & (cosine < -0.05)] == 0).all()


def test_no_light_leaks_under_a_closed_box(stage):
    """A lamp inside of a box lights the box from inside and nothing else."""
    stage.floor()
    stage.camera_above(SPAN)
    low, high = -0.5, 0.5
    corners = [(x, y, z) for z in (0.3, 1.3) for y in (low, high) for x in (low, high)]
    faces = [(0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5)]
    stage.mesh(corners, faces).visible_camera = False
    stage.light("POINT", (0.1, 0.2, 0.8), shadow_soft_size=0.05)
    assert not stage.render(16)["combined"][..., :3].any()


@pytest.mark.parametrize("technique", ["accumulated_maps", "vssm", "cssm"])
@pytest.mark.parametrize("kind", ["SUN", "AREA"])
def test_a_roof_shades_faces_that_lights_see_edge_on(stage, kind, technique):
    """Whose shading normals face them: their own slope in the map is without bounds, that of the roof is not."""
    corners = [(x, y, -abs(x)) for x in (-2, 0, 2) for y in (-2, 2)]
    ridge = stage.mesh(corners, [(0, 2, 3, 1), (2, 4, 5, 3)])
    for face in ridge.data.polygons:
        face.use_smooth = True
    stage.blocker((-99, -99), (99, 99), 3.0)
    stage.camera_above(SPAN)
    stage.scene.candela.slot_shadow = technique
    for side in (-1, 1):
        shape = {"angle": 0.03} if kind == "SUN" else {"size": 0.4}
        stage.light(kind, (8 * side, 0, 8), turn=(0, 0.25 * np.pi * side, 0), **shape)
    for samples in (1, 4, 16):
        assert stage.render(samples, (48, 16))["diffuse_direct"].max() <= (0.01 if technique == "cssm" else 1e-5)


@pytest.mark.parametrize("kind", ["SUN", "POINT", "AREA"])
def test_casters_at_rest_give_the_maps_that_instances_give(stage, monkeypatch, kind):
    """Closed, mirrored and open casters: written out in world space or drawn as instances, the picture is the same."""
    import bpy

    from addon.lighting import depth_maps
    from addon.scene import casters

    drawn = []

    def keep(*arguments, draw=depth_maps._draw_resting):
        drawn.append(draw(*arguments))
        return drawn[-1]

    monkeypatch.setattr(depth_maps, "_draw_resting", keep)
    stage.scene.candela.slot_shadow, stage.scene.candela.accumulated_maps_by = "accumulated_maps", "MAPS"
    stage.floor()
    stage.camera_above(SPAN)
    bpy.ops.mesh.primitive_cube_add(size=0.6, location=(0.5, 0.4, 0.5))
    cube = bpy.context.object
    stage.link("Mirrored", cube.data, (-0.7, 0.3, 0.6), (0.3, 0.4, 0.5), (-1, 1, 0.5))
    stage.link("Turned", cube.data, (-0.5, -0.8, 0.5), (0.8, 0.1, 0.5))
    stage.rectangle((0.2, -1.2), (0.9, -0.5), 0.7)
    stage.light(kind, (0.4, -0.2, 2.5), turn=(0.2, 0.1, 0))
    written_out = stage.render(4, (48, 48))["diffuse_direct"]
    assert sum(drawn) > 0
    drawn.clear()
    monkeypatch.setattr(casters, "LARGEST", 0)
    engine.free_sessions()
    as_instances = stage.render(4, (48, 48))["diffuse_direct"]
    assert not drawn
    assert (written_out < 0.5 * written_out.max()).any()
    np.testing.assert_allclose(written_out, as_instances, atol=1e-4 * float(written_out.max()))


@pytest.mark.slow
@pytest.mark.parametrize("soft_falloff", [True, False], ids=["disc", "sphere"])
def test_round_light_larger_than_its_distance_does_not_shine_through_a_roof(stage, soft_falloff):
    """The floor is as near as the ball is large: points in it are no places to draw a map from."""
    stage.floor()
    stage.blocker((-99, -99), (99, 99), 1.0)
    stage.light("POINT", (0, 0, 4), shadow_soft_size=2.9, use_soft_falloff=soft_falloff)
    stage.camera_above(SPAN)
    images = stage.render(16, (16, 16), bounces=2)
    assert images["diffuse_direct"].max() == 0.0
    assert images["diffuse_indirect"].max() == 0.0


@pytest.mark.parametrize("technique", ["accumulated_maps", "shadows_by_light"])
def test_a_material_without_transparent_shadows_casts_a_whole_one(floor, technique):
    """Its "Transparent Shadows" switched off: light is blocked, while the camera still sees through."""
    floor.scene.candela.slot_shadow = technique
    card = floor.see_through(0.25)
    card.use_transparent_shadow = False
    floor.rectangle((-1, -1), (1, 1), z=1.0, material=card)
    floor.light("SUN", energy=np.pi)
    images = floor.render(16, (32, 32))
    assert images["diffuse_direct"][12:20, 12:20].max() == 0.0
    assert images["diffuse_color"][12:20, 12:20, 0].mean() == pytest.approx(0.75, abs=0.02)
    card.use_transparent_shadow = True
    lit = floor.render(16, (32, 32))["diffuse_direct"][12:20, 12:20, 0].mean()
    assert lit == pytest.approx(0.75, abs=0.05)
