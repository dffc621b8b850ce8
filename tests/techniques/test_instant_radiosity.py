"""Indirect light by virtual lights against closed forms: rooms whose light is known to the last reflection."""

from types import SimpleNamespace

import numpy as np
import pytest

from addon.compare.passes import light_paths
from addon.compare.reference import render_passes
from addon.frame import ledger
from addon.frame.schedule import AT_REST, DRAFT, FINAL
from addon.frame.settings import Settings
from addon.gfx import images
from addon.lighting import probes
from addon.sampling.sequence import point
from addon.surfaces.reflectance import BANDS, COLUMNS, MIRRORS, SKY_ROWS, Reflectance
from addon.techniques.instant_radiosity import DEEPER, InstantRadiosity, deeper_weight
from tests.numerics import trapezoid
from tests.techniques.foggy_stage import box

SAMPLES = 32


@pytest.fixture
def render(stage):
    """Radiance per light path of the stage, by a number of bounces."""

    def render(bounces, samples=SAMPLES, size=(24, 24), seed=0):
        images = render_passes(stage.scene, "CANDELA", samples, seed, size=size, bounces=bounces).images
        assert ledger.latest().bad_pixels == 0
        return light_paths(images)

    return render


def sphere(stage, material, rings=24):
    """The unit sphere from inside, seen from a point off its centre."""
    turn = np.linspace(0, 2 * np.pi, 2 * rings, endpoint=False)
    height = np.linspace(0, np.pi, rings + 1)[1:-1]
    vertices = [(np.sin(h) * np.cos(a), np.sin(h) * np.sin(a), np.cos(h)) for h in height for a in turn]
    count, last = 2 * rings, (rings - 2) * 2 * rings
    faces = [
        (r * count + k, r * count + (k + 1) % count, (r + 1) * count + (k + 1) % count, (r + 1) * count + k)
        for r in range(rings - 2)
        for k in range(count)
    ]
    vertices += [(0, 0, 1), (0, 0, -1)]
    top, bottom = len(vertices) - 2, len(vertices) - 1
    faces += [(top, (k + 1) % count, k) for k in range(count)]
    faces += [(bottom, last + k, last + (k + 1) % count) for k in range(count)]
    stage.camera((0.3, 0.2, -0.1), (1.2, 0.3, 0.4), angle=1.4)
    return stage.mesh(vertices, faces, material=material)


@pytest.mark.slow
@pytest.mark.parametrize("bounces", [1, 2, 3, 8])
def test_a_sphere_lit_from_its_centre_follows_the_series_of_reflections(stage, render, bounces):
    """Albedo 1/2 under irradiance pi: 1/2 straight, and half as much again with every bounce, the same everywhere."""
    sphere(stage, stage.diffuse(0.5))
    stage.light("POINT", (0, 0, 0), energy=4 * np.pi**2, shadow_soft_size=0.0)
    light = render(bounces)["diffuse_indirect"]
    # The facets are nearer to the lamp than the sphere by up to half a percent, which is in the direct light too.
    assert light.mean() == pytest.approx(0.5 * (1 - 0.5**bounces), rel=0.02)
    assert light.mean(axis=2).std() < 0.06 * light.mean()


@pytest.mark.slow
def test_a_sphere_that_shines_itself_reflects_its_own_light(stage, render):
    """Radiance 1 and albedo 1/2: 1 / (1 - 1/2) in all, half of the first reflection is direct light."""
    shining = stage.principled(Base_Color=(0.5, 0.5, 0.5, 1), IOR=1.0, Emission_Strength=1.0)
    shining.node_tree.nodes["Principled BSDF"].inputs["Emission Color"].default_value = (1, 1, 1, 1)
    sphere(stage, shining, rings=12)
    assert render(12)["diffuse_indirect"].mean() == pytest.approx(0.5, rel=0.03)


def light_thrown_by_a_board(card, height, across):
    """Irradiance on a floor `height` below a white board of 2 x 2 m by what that reflects of an emissive sheet of
    radiance 1, `card` m high and 2 m long, that hangs from its middle; at `across` m from below the sheet, and halfway
    along it. The board is lit as by an endless sheet: by pi / 2 times 1 - sine of the angle at which that ends."""
    y = np.concatenate([-np.geomspace(1, 1e-5, 2000), np.geomspace(1e-5, 1, 2000)])
    board = np.pi / 2 * (1 - np.abs(y) / np.hypot(y, card))
    with np.errstate(invalid="ignore"):
        hidden = (y * across < 0) & (height * np.abs(y) < card * (np.abs(y) + abs(across)))
    x = np.linspace(-1, 1, 401)
    squared = x[:, None] ** 2 + (y - across) ** 2 + height**2
    return trapezoid(trapezoid(height**2 / squared**2, x, axis=0) * np.where(hidden, 0, board) / np.pi, y)


def test_a_thin_lamp_on_a_board_lights_that_where_they_touch(stage, render):
    """Each of the points of light that all surfaces share stands for more than the sheet is high."""
    card = 0.01
    shining = stage.material("ShaderNodeEmission", Strength=100.0)
    stage.mesh([(-1, 0, 1), (1, 0, 1), (1, 0, 1 - card), (-1, 0, 1 - card)], [(0, 1, 2, 3)], material=shining)
    stage.mesh([(-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)], [(0, 1, 2, 3)], material=stage.diffuse(1.0))
    stage.rectangle((-1, -1), (1, 1), material=stage.diffuse(1.0))
    camera = stage.camera((0, 0, 0.5), (0, 0, 0))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 0.2
    found = [render(1, 1, size=(12, 12), seed=seed)["diffuse_indirect"].mean() for seed in range(16)]
    across = (np.arange(12) + 0.5) / 60 - 0.1
    expected = np.mean([light_thrown_by_a_board(card, 1.0, place) for place in across])
    assert np.mean(found) * np.pi == pytest.approx(100 * expected, rel=0.12)  # standard error of 16 pictures: 5 %


def wall_irradiance(height):
    """At the middle of a unit wall, `height` above a floor of radiosity 8: the form factor to a unit square."""
    far = np.sqrt(1 + height**2)
    return 8 / np.pi * (np.arctan(0.5 / height) - height / far * np.arctan(0.5 / far))


def test_a_floor_in_the_sun_lights_the_wall_beside_it_by_their_form_factor(stage, render):
    """The unit squares share an edge; the sun stands straight above, so the wall gets the floor's light alone."""
    stage.rectangle((0, 0), (1, 1), material=stage.diffuse(0.8))
    corners = [(0, 0, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1)]
    stage.mesh(corners, [(0, 1, 2, 3)], material=stage.diffuse(1.0))
    stage.light("SUN", energy=10.0, angle=0.0)
    camera = stage.camera((3, 0.5, 0.5), (np.pi / 2, 0, np.pi / 2))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 1.0
    irradiance = render(1, samples=64, size=(20, 20))["diffuse_indirect"].mean(axis=2) * np.pi
    assert irradiance.mean() == pytest.approx(8 * 0.200044, rel=0.02)
    height = (np.arange(20) + 0.5) / 20
    np.testing.assert_allclose(irradiance[:, 9:11].mean(axis=1), wall_irradiance(height), rtol=0.06)


@pytest.mark.slow
@pytest.mark.parametrize("side", [-1, 1], ids=["towards the sun", "away from it"])
@pytest.mark.parametrize("floor_in_view", [True, False])
def test_a_glossy_floor_lights_the_wall_that_its_lobe_meets(stage, render, side, floor_in_view):
    """Sun from 35 degrees above the horizon on a brushed floor: a fiftieth of what the wall ahead gets goes back."""
    brushed = stage.material("ShaderNodeBsdfAnisotropic", Color=(0.8, 0.8, 0.8, 1), Roughness=0.6)
    stage.rectangle((-1, -1), (1, 1), material=brushed)
    corners = [(-1, side, 0.02), (1, side, 0.02), (1, side, 0.5), (-1, side, 0.5)]
    stage.mesh(corners, [(0, 1, 2, 3)], material=stage.diffuse(0.8))
    stage.light("SUN", turn=(np.radians(55), 0, 0), energy=3.0, angle=0.0)
    tilt = np.pi / 2 - (0.5 if floor_in_view else 0.0)
    stage.camera((0, -side * 2.5, 1.8 if floor_in_view else 0.8), (tilt, 0, 0 if side == 1 else np.pi), angle=0.9)
    expected = light_paths(stage.render(1024, (24, 24), engine="CYCLES", bounces=1))["diffuse_indirect"]
    light = render(1, samples=64)["diffuse_indirect"]
    assert light.mean() == pytest.approx(expected.mean(), rel=0.04 if side == 1 else 0.15)


def fresnel(cosine, index=1.5):
    """Of light that is not polarised, from outside."""
    c, g = cosine, np.sqrt(index**2 - 1 + cosine**2)
    return 0.5 * ((g - c) / (g + c)) ** 2 * (1 + ((c * (g + c) - 1) / (c * (g - c) + 1)) ** 2)


@pytest.mark.parametrize("metal", [False, True], ids=["alone", "beside what throws caustics"])
def test_a_polished_floor_throws_what_fresnel_says_at_grazing_incidence(stage, render, metal):
    """A lamp low above black polish, mirrored onto a wall: lobes are widened, and wide ones reflect half of that.
    Where photons bring what metal throws, polish is left to virtual lights all the same."""
    if metal:
        polished = stage.principled(Metallic=1.0, Roughness=0.1)
        stage.rectangle((-0.1, -0.1), (0.1, 0.1), z=0.1, material=polished, location=(3.8, 1.0, 0))
    stage.rectangle((-20, -20), (20, 2), material=stage.principled(Base_Color=(0, 0, 0, 1), Roughness=0.05))
    stage.mesh([(-4, 2, 0), (4, 2, 0), (4, 2, 6), (-4, 2, 6)], [(0, 1, 2, 3)], material=stage.diffuse(1.0))
    stage.light("POINT", (0, -3, 0.8), energy=100 * np.pi, shadow_soft_size=0.05)  # intensity 25
    camera = stage.camera((0, -8, 1.5), (np.pi / 2, 0, 0))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 3.0
    across, height = np.meshgrid((np.arange(12) + 0.5) / 4 - 1.5, (np.arange(12) + 0.5) / 4)
    far = np.sqrt(across**2 + 5**2 + (height + 0.8) ** 2)
    mirrored = 25 / np.pi / far**2 * (5 / far) * fresnel((height + 0.8) / far)
    light = render(1, samples=8, size=(12, 12))["diffuse_indirect"]
    assert light.mean() == pytest.approx(mirrored.mean(), rel=0.12)


def corner(stage, albedo=0.7, energy=60.0, lamps=1):
    """A floor, a wall and a ceiling with a lamp between them."""
    material = stage.diffuse(albedo)
    stage.rectangle((-1, -1), (1, 1), material=material)
    stage.rectangle((-1, -1), (1, 1), z=2.0, material=material)
    stage.mesh([(-1, 1, 0), (1, 1, 0), (1, 1, 2), (-1, 1, 2)], [(0, 1, 2, 3)], material=material)
    for _ in range(lamps):
        stage.light("POINT", (0.2, 0, 1.2), energy=energy / lamps, shadow_soft_size=0.1)
    stage.camera((0, -3, 1), (np.pi / 2, 0, 0), angle=0.8)


def test_no_bounces_mean_no_indirect_light_and_no_work(stage, render):
    corner(stage)
    assert not render(0, samples=1)["diffuse_indirect"].any()
    row = next(row for row in ledger.latest().rows if row.name == "instant_radiosity")
    assert (row.state, row.reason) == ("skipped", "the scene's bounces are set to 0")


def test_a_surface_alone_gets_no_indirect_light(stage, render):
    stage.floor()
    stage.light("POINT", (0, 0, 2))
    stage.camera_above()
    assert not render(4, samples=4)["diffuse_indirect"].any()


def test_light_is_linear_and_two_half_lamps_are_one(stage, render):
    corner(stage)
    once = render(3, samples=4)["diffuse_indirect"]
    stage.clear()
    corner(stage, energy=120.0)
    np.testing.assert_allclose(render(3, samples=4)["diffuse_indirect"], 2 * once, rtol=1e-3, atol=1e-5)
    stage.clear()
    corner(stage, lamps=2)
    assert render(3)["diffuse_indirect"].mean() == pytest.approx(once.mean(), rel=0.05)


@pytest.mark.parametrize("scale", [1e-3, 1e4])
def test_light_does_not_depend_on_the_scale_of_the_scene(stage, render, scale):
    corner(stage)
    unit = render(3, samples=8)["diffuse_indirect"]
    stage.clear()
    corner(stage, energy=60.0 * scale**2)
    stage.enlarge(scale)
    scaled = render(3, samples=8)["diffuse_indirect"]
    assert scaled.mean() == pytest.approx(unit.mean(), rel=0.02)


@pytest.mark.slow
def test_what_a_mirror_shows_of_lit_surfaces_is_glossy_indirect_light(stage, render):
    """A mirror on the floor shows the ceiling, whose direct light is known from the picture of the ceiling itself."""
    stage.rectangle(
        (-5, -5), (5, 5), material=stage.material("ShaderNodeBsdfAnisotropic", Color=(1, 1, 1, 1), Roughness=0.0)
    )
    stage.rectangle((-5, -5), (5, 5), z=2.0, material=stage.diffuse(0.6))
    stage.light("AREA", (0, 0, 0.5), (np.pi, 0, 0), energy=50.0, size=0.5)
    stage.camera((0, 0, 1.0), (np.pi / 4, 0, 0), angle=0.3)
    shown = render(1, samples=64)["glossy_indirect"].mean()
    stage.scene.camera.rotation_euler = (3 * np.pi / 4, 0, 0)
    stage.scene.camera.location = (0, 0, -1.0)
    stage.scene.objects["Mesh"].visible_camera = False
    assert shown == pytest.approx(render(1, samples=64)["diffuse_direct"].mean(), rel=0.03)


def light_of_a_card_out_of_sight(stage, half, alpha):
    """Mean light that a standing card, seen edge-on, throws onto a floor of `half` width; the sun shines on both."""
    stage.clear()
    stage.floor(half=half, material=stage.diffuse(0.8))
    paint = stage.principled(Base_Color=(0.8, 0.8, 0.8, 1), Alpha=alpha, Roughness=1.0, Specular_IOR_Level=0.0)
    stage.mesh([(-1, 0.6, 0), (1, 0.6, 0), (1, 0.6, 1.5), (-1, 0.6, 1.5)], [(0, 1, 2, 3)], material=paint)
    stage.light("SUN", turn=(0.9, 0, 0), energy=3.0)
    stage.camera_above(3.0)
    return float(stage.render(16, bounces=1)["diffuse_indirect"].mean())


@pytest.mark.slow
def test_light_of_a_small_thing_out_of_sight_does_not_depend_on_how_wide_the_scene_is(stage):
    narrow = light_of_a_card_out_of_sight(stage, 3.0, 1.0)
    assert narrow > 0.01
    assert light_of_a_card_out_of_sight(stage, 40.0, 1.0) == pytest.approx(narrow, rel=0.05)


@pytest.mark.slow
def test_a_half_transparent_card_reflects_half_of_the_light(stage):
    whole = light_of_a_card_out_of_sight(stage, 3.0, 1.0)
    assert light_of_a_card_out_of_sight(stage, 3.0, 0.5) == pytest.approx(whole / 2, rel=0.05)


@pytest.mark.parametrize("switched_off", ["visible_shadow", "visible_diffuse"])
def test_a_card_that_some_rays_pass_dims_the_bounce_as_in_cycles(stage, render, switched_off):
    """Between a lamp and the floor below: without shadow the floor is lit and the card, too, reflects; unseen by
    diffuse rays the card casts its shadow and reflects nothing."""
    corner(stage)
    card = stage.rectangle((-0.5, -0.5), (0.5, 0.5), z=0.8, material=stage.diffuse(0.7))
    setattr(card, switched_off, False)
    expected = light_paths(stage.render(256, (24, 24), engine="CYCLES", bounces=3))["diffuse_indirect"]
    assert render(3)["diffuse_indirect"].mean() == pytest.approx(expected.mean(), rel=0.04)


@pytest.mark.slow
@pytest.mark.parametrize("passes", [False, True])
def test_a_transparent_card_may_block_what_comes_from_lamps_only(stage, render, passes):
    """Material setting "Transparent Shadows": off, the floor below is dark, but light of the wall still passes."""
    corner(stage)
    card = stage.see_through(0.2)
    card.use_transparent_shadow = passes
    stage.rectangle((-0.5, -0.5), (0.5, 0.5), z=0.8, material=card)
    expected = light_paths(stage.render(256, (24, 24), engine="CYCLES", bounces=3))["diffuse_indirect"]
    assert render(3)["diffuse_indirect"].mean() == pytest.approx(expected.mean(), rel=0.04)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("technique", "kind", "light", "settings"),
    [
        ("instant_radiosity", "ShaderNodeBsdfTranslucent", "diffuse_indirect", {}),
        ("instant_radiosity", "ShaderNodeBsdfSheen", "diffuse_indirect", {"distribution": "MICROFIBER"}),
        ("instant_radiosity", "ShaderNodeBsdfSheen", "glossy_indirect", {"distribution": "ASHIKHMIN"}),
        ("instant_radiosity", "ShaderNodeBsdfToon", "diffuse_indirect", {"component": "DIFFUSE"}),
        ("multires_radiosity", "ShaderNodeBsdfTranslucent", "diffuse_indirect", {}),  # lobes are shared between the two
    ],
)
def test_lobes_without_microfacets_get_the_light_of_other_surfaces_as_in_cycles(
    stage, render, kind, light, settings, technique
):
    """A card before a room, which lights it from behind; from the front a low wall does, which a lamp shines at."""
    corner(stage)
    stage.mesh([(-1, -2, 0), (1, -2, 0), (1, -2, 0.8), (-1, -2, 0.8)], [(0, 1, 2, 3)], material=stage.diffuse(0.7))
    stage.light("POINT", (0.0, -1.2, 0.4), energy=40.0, shadow_soft_size=0.1)
    cloth = stage.material(kind, Color=(0.8, 0.8, 0.8, 1.0))
    node = next(node for node in cloth.node_tree.nodes if node.bl_idname == kind)
    for name, value in settings.items():
        setattr(node, name, value)
    if settings.get("distribution"):
        node.inputs["Roughness"].default_value = 0.6
    stage.mesh(
        [(-0.4, -0.5, 0.6), (0.4, -0.5, 0.6), (0.4, -0.5, 1.4), (-0.4, -0.5, 1.4)], [(0, 1, 2, 3)], material=cloth
    )
    expected = light_paths(stage.render(2048, (24, 24), engine="CYCLES", bounces=3))[light]
    on_card = (slice(9, 15), slice(9, 15))
    stage.scene.candela.slot_indirect = technique
    stage.scene.candela.denoise_strength = 0.0  # the card is as wide as its filter
    found = light_paths(stage.render(256, (24, 24), bounces=3))[light]
    assert expected[on_card].mean() > 0.005
    assert found[on_card].mean() == pytest.approx(expected[on_card].mean(), rel=0.05)


def test_cloth_of_two_colours_sends_its_front_back_and_its_translucency_on(stage):
    """A sun along the floor meets a red sheet that shines blue: the floor before it is red, that behind it blue."""
    cloth = stage.material("ShaderNodeAddShader")
    tree = cloth.node_tree
    add = next(node for node in tree.nodes if node.type == "ADD_SHADER")
    for k, (kind, color) in enumerate((("Diffuse", (0.6, 0, 0, 1)), ("Translucent", (0, 0, 0.6, 1)))):
        node = tree.nodes.new("ShaderNodeBsdf" + kind)
        node.inputs["Color"].default_value = color
        tree.links.new(node.outputs[0], add.inputs[k])
    stage.floor(half=1.5, material=stage.diffuse(0.8))
    stage.mesh([(0, -1.5, 0), (0, 1.5, 0), (0, 1.5, 1.5), (0, -1.5, 1.5)], [(0, 1, 2, 3)], material=cloth)
    stage.light("SUN", turn=(0, -np.pi / 2, 0), energy=3.0, angle=0.0)  # towards +x
    stage.camera_above(3.0)
    stage.scene.candela.denoise_strength = 0.0  # which knows one floor alone
    found = light_paths(stage.render(16, (24, 24), bounces=1))["diffuse_indirect"]
    before, behind = found[:, :11].mean((0, 1)), found[:, 13:].mean((0, 1))
    assert before[0] > 0.01 and before[2] < 1e-3 * before[0]
    assert behind[2] > 0.01 and behind[0] < 1e-3 * behind[2]


@pytest.mark.parametrize("sun", [-1.0, 1.0])
def test_rough_diffuse_surfaces_send_on_what_they_do_in_cycles(stage, sun):
    """A floor in the sun lights a wall: rough, it sends less there than its colour says, and more back to the sun."""
    rough = stage.material("ShaderNodeBsdfDiffuse", Color=(0.3, 0.3, 0.3, 1.0), Roughness=1.0)
    stage.rectangle((-2, -4), (2, 0), material=rough)
    stage.rectangle((-2, 0), (2, 0.5), material=rough, turn=(np.pi / 2, 0, 0))
    stage.light("SUN", turn=(sun, 0.0, 0.0), energy=3.0)
    camera = stage.camera_above(4.0)
    camera.location, camera.rotation_euler = (0, -8, 2), (1.4, 0, 0)

    def light(samples, **options):
        return light_paths(stage.render(samples, (24, 24), bounces=2, **options))["diffuse_indirect"].mean()

    expected = light(512, engine="CYCLES")
    assert expected > 1e-4
    assert light(64) == pytest.approx(expected, rel=0.06)


def test_mean_of_a_material_that_nothing_shows_is_black_whatever_the_image_held_before(stage, gpu_context):
    """Material 0 stands for slots without one, of which there are none here."""
    stage.floor(material=stage.diffuse(0.5))
    stage.camera_above(4.0)
    stage.render(1)
    frame = stage.renderer.frame
    assert len(frame.materials.compiled) == 2
    used = images.pool.take(COLUMNS, BANDS + SKY_ROWS, "RGBA32F")
    images.Target((used,)).clear((7.0, 7.0, 7.0, 7.0))
    images.pool.give(used)
    means = Reflectance()
    means.update(frame)
    found = images.read(means.image)
    of_all = found[0, :, :3]
    assert means.image is used and not found[-SKY_ROWS:].any()  # the world's rows, which nothing here shows
    assert of_all[1] == pytest.approx(0.5, rel=0.01) and not of_all[0].any() and not of_all[2:].any()
    means.release()


def mirrored_by_metal(stage, rougher, roughness):
    """(share that is a mirror, sum of its alpha) of the mean of a floor of metal, of which the share `rougher` has the
    second of two values of roughness."""
    material = stage.material("ShaderNodeMixShader", Fac=rougher)
    tree = material.node_tree
    for place, one in enumerate(roughness, 1):
        lobe = tree.nodes.new("ShaderNodeBsdfAnisotropic")
        lobe.inputs["Roughness"].default_value = one
        tree.links.new(lobe.outputs[0], tree.nodes["Mix Shader"].inputs[place])
    stage.floor(material=material)
    stage.camera_above(4.0)
    stage.render(1)
    means = Reflectance()
    means.update(stage.renderer.frame)
    found = images.read(means.image)
    means.release()
    return found[0, 1, 3], found[1, 1, 3]


def test_mean_of_a_mirror_among_other_lobes_keeps_the_width_of_the_mirror(stage, gpu_context):
    """Seven tenths of the pixels keep the smooth one of two lobes of metal, of alpha .2^2."""
    share, alpha = mirrored_by_metal(stage, 0.3, (0.2, 0.9))
    assert 0.55 < share < 0.85
    assert alpha / share == pytest.approx(0.04, rel=0.01)


def test_some_places_of_metal_that_are_rougher_do_not_end_its_mirror(stage, gpu_context):
    """Of two lobes of metal of roughness .1 and .34 a tenth of the pixels keep the rougher one: mean alpha .021."""
    share, alpha = mirrored_by_metal(stage, 0.1, (0.1, 0.34))
    print(f"{share:.3f} {alpha:.4f}")
    assert share == pytest.approx(1.0, abs=0.01)
    assert 0.01 < alpha < 0.04 and alpha <= float(dict(MIRRORS)["SMOOTH_MIRRORS"]) * share


@pytest.mark.parametrize(("samples", "whole"), [(1, True), (3, True), (64, False), (4, True), (30, True), (64, True)])
def test_light_between_close_surfaces_counts_once_in_the_mean(samples, whole):
    frame = SimpleNamespace(settings=Settings(samples, schedule=FINAL if whole else AT_REST), sample=0)
    weights = []
    for frame.sample in range(samples):
        weights.append(deeper_weight(frame))
    assert np.mean(weights) == 1.0
    assert set(weights) == ({0.0, float(DEEPER)} if samples >= 8 and whole else {1.0})


def test_samples_that_look_for_it_have_numbers_from_all_quarters():
    """Every other sample alone has numbers from one half of the sequence."""
    frame = SimpleNamespace(settings=Settings(16, schedule=FINAL), sample=0)
    chosen = []
    for frame.sample in range(16):
        if deeper_weight(frame):
            chosen.append(point(frame.sample, "any"))
    quarters = (4 * np.array(chosen)).astype(int)
    assert all(sorted(axis) == [0, 0, 1, 1, 2, 2, 3, 3] for axis in quarters.T)


def test_pictures_of_few_samples_trace_more_of_the_virtual_lights():
    technique = InstantRadiosity()

    def rays(samples, draft=False, asked=2):
        settings = SimpleNamespace(samples=samples, schedule=DRAFT if draft else FINAL, get=lambda *name: asked)
        return technique._rays(SimpleNamespace(settings=settings))

    assert [rays(samples) for samples in (1, 2, 3, 4, 64)] == [8, 4, 3, 2, 2]
    assert rays(1, draft=True) == 2 and rays(16, asked=5) == 5


@pytest.mark.slow
def test_where_an_orthographic_camera_stands_changes_nothing(stage):
    """Blender's orthographic viewport looks from half a kilometre away."""
    stage.floor(half=1.0, material=stage.diffuse(0.8))
    stage.rectangle((-0.5, -0.5), (0.5, 0.5), material=stage.diffuse(0.8), turn=(0.0, 1.2, 0.0), location=(0.6, 0, 0.4))
    stage.light("AREA", (-0.5, 0.2, 1.5), size=0.5)
    camera = stage.camera_above(2.0, height=3.0)
    near = stage.render(8, (32, 32), bounces=2)["diffuse_indirect"]
    camera.location.z, camera.data.clip_end = 500.0, 1000.0
    far = stage.render(8, (32, 32), bounces=2)["diffuse_indirect"]
    assert near.mean() > 0.0
    np.testing.assert_allclose(far.mean(), near.mean(), rtol=0.01)
    assert np.sqrt(((far - near) ** 2).mean()) < 0.05 * near.mean()


def test_no_light_is_passed_on_through_a_wall(stage, render):
    """A board in the sun of a lamp, and a high wall between it and half of the floor."""
    stage.floor(material=stage.diffuse(0.5))
    stage.mesh([(0, -20, 0), (0, 20, 0), (0, 20, 20), (0, -20, 20)], [(0, 1, 2, 3)], material=stage.diffuse(0.0))
    stage.mesh([(1.5, -1, 0), (1.5, 1, 0), (1.5, 1, 1), (1.5, -1, 1)], [(0, 1, 2, 3)], material=stage.diffuse(0.8))
    stage.light("POINT", (0.7, 0, 0.5), energy=100)
    stage.camera_above(3.0, height=30.0)
    light = render(1, samples=8)["diffuse_indirect"][..., 0]
    half = light.shape[1] // 2
    assert light[:, : half - 2].max() < 0.01 * light[:, half + 2 :].mean()


@pytest.mark.parametrize(("seen", "both"), [(False, False), (False, True), (True, False)])
def test_a_floor_whose_normals_are_turned_throws_the_light_that_it_reflects(stage, seen, both):
    """Under a sun overhead a normal map of one colour leaves the cosine of its tilt, seen by the camera or not; so does
    one that turns normals to `both` sides and in the mean nowhere."""
    color, strength = np.array([1.0, 0.5, 1.0]), 1.5
    turned = (2 * color - 1) * (strength, strength, 1.0)
    found = []
    for mapped in (False, True):
        stage.clear()
        floor = stage.diffuse(0.8)
        if mapped:
            nodes = floor.node_tree.nodes
            turning = nodes.new("ShaderNodeNormalMap")
            turning.inputs["Color"].default_value, turning.inputs["Strength"].default_value = (*color, 1), strength
            floor.node_tree.links.new(turning.outputs[0], nodes["Diffuse BSDF"].inputs["Normal"])
            if both:
                checker = nodes.new("ShaderNodeTexChecker")
                checker.inputs["Scale"].default_value = 12.0
                checker.inputs[1].default_value, checker.inputs[2].default_value = (*color, 1), (0, 0.5, 1, 1)
                floor.node_tree.links.new(checker.outputs[0], turning.inputs["Color"])
                floor.node_tree.links.new(nodes.new("ShaderNodeUVMap").outputs[0], checker.inputs[0])
        layer = stage.floor(3.0, material=floor).data.uv_layers.new(name="UVMap")
        for corner, place in enumerate([(0, 0), (1, 0), (1, 1), (0, 1)]):
            layer.uv[corner].vector = place
        stage.rectangle((-1, -1), (1, 1), turn=(np.pi / 2, 0, 0), location=(0, 1, 1), material=stage.diffuse(0.8))
        stage.light("SUN", (0, 0, 5), angle=0.0)
        stage.camera((0, -2 if seen else 0.5, 1), (np.pi / 2, 0, 0), angle=1.6 if seen else 0.9)
        image = stage.render(4, (16, 16), bounces=1)["diffuse_indirect"][..., 0]
        found.append(image[7:9, 7:9].mean())
    assert found[1] / found[0] == pytest.approx(turned[2] / np.linalg.norm(turned), rel=0.06)


def test_probes_stand_on_the_surface_that_is_seen_one_in_each_cell(stage, render, monkeypatch):
    """On a tilted floor that nothing else sees: nearly as many as the picture has room for, all in its plane, though
    most stand between pixels, and no two at one place."""
    found = []

    def keep(frame, grid, bindings, find=probes.find):
        made = find(frame, grid, bindings)
        found.append((images.read(made["probe_places"])[0], grid[0] * grid[1]))
        return made

    monkeypatch.setattr(probes, "find", keep)
    stage.floor(half=3.0, turn=(0.4, 0.3, 0.0))
    stage.light("SUN", turn=(0.2, 0.1, 0.0))
    stage.camera_above(2.0)
    stage.scene.candela.slot_indirect = "instant_radiosity"
    render(1, samples=4)
    assert found
    for places, room in found:
        stand = places[places[:, 3] > 0, :3].astype(float)
        assert 0.3 * room < len(stand) <= room
        apart = stand - stand.mean(axis=0)
        assert np.linalg.svd(apart, compute_uv=False)[-1] / len(stand) ** 0.5 < 1e-5
        between = np.linalg.norm(stand[:, None] - stand, axis=2) + np.eye(len(stand))
        assert between.min() > 1e-3


def pane(stage):
    """A solid pane of glass that stands on the floor."""
    glass = stage.material("ShaderNodeBsdfGlass", Color=(1, 1, 1, 1), IOR=1.5, Roughness=0.0)
    box(stage, glass, (-1, 0, 0.001), (1, 0.05, 1.0))


def test_a_pane_mirrors_a_wide_lamp_onto_the_floor_at_its_foot_alone(stage, render):
    """The lamp's image shines through the pane's upper edge on what is nearer than 0.5 m. The floor is farther."""
    stage.floor(material=stage.diffuse(0.6))
    pane(stage)
    stage.light("AREA", (0, -0.5, 3), energy=100, size=1.0)
    stage.world((0, 0, 0))
    stage.scene.candela.slot_caustics = "OFF"
    camera = stage.camera((0, -1.6, 5), (0, 0, 0))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 1.2
    light = render(1, 8, size=(16, 16))
    assert light["diffuse_indirect"].mean() < 0.002 * light["diffuse_direct"].mean()


def test_a_pane_beside_a_plate_takes_none_of_an_even_worlds_light(stage, render):
    """What it mirrors is as bright as what it hides."""
    stage.rectangle((-0.1, -0.5), (0.1, -0.3), z=0.2, material=stage.diffuse(0.5))
    pane(stage)
    stage.world((1, 1, 1))
    stage.scene.candela.slot_caustics = "OFF"
    camera = stage.camera((0, -0.4, 5), (0, 0, 0))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 0.18
    light = render(2, 32, size=(16, 16))
    assert (light["diffuse_direct"] + light["diffuse_indirect"]).mean() == pytest.approx(0.5, rel=0.006)
