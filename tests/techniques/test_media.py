"""Media against closed forms: Beer-Lambert, airlight's integral, phase functions, furnace; and stress."""

from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from addon.frame.settings import Settings
from addon.gfx import images, passes
from addon.lighting.media import MediaService
from addon.materials.graph import Graph
from addon.materials.volume import PHASES, Medium
from addon.scene.media import BOX, CORNERS, Filled, box_rows, phase_values
from addon.snapshot.volumes import openvdb
from addon.surfaces import seen_layers
from addon.techniques.airlight import SPREAD, Airlight
from addon.ui.properties import settings_of
from tests.materials.graphs import transparent
from tests.numerics import trapezoid
from tests.techniques.foggy_stage import absorber, box, fill, fog, glowing_floor, volume
from tests.techniques.test_image_space_subsurface import sphere

# Transmittance ------------------------------------------------------------------------------------------------------


def test_a_slab_absorbs_by_beer_and_lambert(stage):
    stage.camera_above()
    glowing_floor(stage)
    box(stage, absorber(stage, (0.8, 0.5, 0.1)))
    seen = stage.render(size=(16, 16))["combined"]
    assert seen[8, 8, :3] == pytest.approx(2 * np.exp([-0.8, -0.5, -0.1]), rel=1e-4)
    assert seen[1, 1, :3] == pytest.approx(2.0, rel=1e-6)


@pytest.mark.parametrize("rays", ["camera", "shadow"])
def test_media_take_light_of_the_rays_that_see_them_alone(stage, rays):
    """A slab above a lit floor, on both legs of the light's way, then on one."""
    stage.camera_above()
    stage.floor()
    stage.light("SUN", (0, 0, 5), energy=np.pi)
    slab = box(stage, absorber(stage, (0.5, 0.5, 0.5)), (-2, -2, 1), (2, 2, 2))
    stage.scene.candela.slot_indirect = "OFF"
    both = stage.render(size=(8, 8))["combined"][4, 4, 0]
    setattr(slab, f"visible_{rays}", False)
    assert stage.render(size=(8, 8))["combined"][4, 4, 0] == pytest.approx(both * np.exp(0.5), rel=1e-3)


def test_nested_and_overlapping_media_add_their_coefficients(stage):
    stage.camera_above()
    glowing_floor(stage)
    box(stage, absorber(stage, (0.3, 0.3, 0.3)), (-1, -1, -1), (1, 1, 1))
    box(stage, absorber(stage, (0.5, 0.0, 0.0)))  # within the first
    box(stage, absorber(stage, (0.0, 0.4, 0.0)), (-0.5, -0.5, 0.0), (0.5, 0.5, 1.5))  # half out of it
    seen = stage.render(size=(16, 16))["combined"][8, 8, :3]
    assert seen == pytest.approx(2 * np.exp(-np.array([0.6 + 0.5, 0.6 + 0.4 * 1.5, 0.6])), rel=1e-3)


def test_boxes_are_told_from_other_boundaries():
    medium = Medium(np.zeros(3), np.ones(3), np.zeros(3), 0.0, 0.0, 0.0, True)
    place = np.array([[0, 2.0, 0, 3], [-1, 0, 0.5, 1], [0, 0, 4, 0]], float)  # sheared and turned
    corners = (CORNERS @ place[:, :3].T + place[:, 3])[BOX]

    def rows(corners):
        return box_rows(Filled(medium, None, corners, place, place, "box"))

    assert rows(corners) @ (*place[:, 3], 1) == pytest.approx(np.zeros(3), abs=1e-9)
    halved = np.concatenate([corners[1:], [[corners[0, 0], corners[0, 1], corners[0, 1:].mean(axis=0)]]])
    for other in (corners[:, ::-1], corners[1:], halved, corners + np.eye(3)[0] * 0.1):
        assert rows(other) is None


@pytest.mark.slow
@pytest.mark.parametrize("others", [(), ((-0.2, -0.9, -0.9), (0.9, 0.3, 0.4))])
def test_boxes_of_fog_are_as_other_meshes_of_their_shape_are(stage, others):
    """Turned boxes, which programs meet by their planes, and the same meshes with turned vertices, met by a tree."""
    stage.camera_above()
    stage.light("SPOT", (1, 0, 4), (0, 0.25, 0), energy=300, spot_size=1.0, shadow_soft_size=0.0)
    stage.floor()
    scattering = volume(stage, Density=0.5, Color=(0.9, 0.8, 0.6, 1), Anisotropy=0.3)
    boxes = [box(stage, scattering, (-0.9, -0.6, -0.8), (0.7, 0.8, 0.9))]
    boxes += [box(stage, absorber(stage, (0.2, 0.4, 0.6)), *others)] if others else []
    for one in boxes:
        one.rotation_euler = (0.3, 0.4, 0.7)
        one.scale = (1.0, -1.0, 1.2)
    names = ("combined", "volume_direct")
    seen = stage.render(size=(16, 16), samples=2)
    assert (
        stage.renderer.frame.service(MediaService)
        .media.textures["media_table"]
        .defines.count(("MEDIA_BOXES", str(len(boxes))))
    )
    for one in boxes:
        bpy.context.view_layer.update()
        one.data.transform(one.matrix_world)
        one.data.flip_normals()  # it was mirrored
        one.rotation_euler, one.scale = (0, 0, 0), (1, 1, 1)
    turned = stage.render(size=(16, 16), samples=2)
    assert "MEDIA_BOXES" not in dict(stage.renderer.frame.service(MediaService).media.textures["media_table"].defines)
    for name in names:
        assert turned[name][..., :3].mean() == pytest.approx(seen[name][..., :3].mean(), rel=2e-3)
        assert np.median(np.abs(turned[name] - seen[name])) < 1e-4 * seen[name].mean()


def test_fog_takes_light_on_both_legs_of_its_way(stage):
    """From a lamp 2 m above a white floor, and from there to a camera at 4 m."""
    stage.floor()
    stage.light("POINT", (0, 0, 2), energy=100, shadow_soft_size=0.0)
    camera = stage.camera((0, 0, 4), (0, 0, 0), angle=0.02)
    camera.data.clip_end = 100
    clear = stage.render(size=(8, 8))["diffuse_direct"][4, 4, 0]
    fog(stage, node="ShaderNodeVolumeAbsorption", Color=(0.5, 0.5, 0.5, 1), Density=0.2)
    images_seen = stage.render(size=(8, 8))
    light = images_seen["combined"][4, 4, 0]
    assert light == pytest.approx(clear * np.exp(-0.1 * (2 + 4 - camera.data.clip_start)), rel=2e-3)
    # The light pass is divided by the colour that is seen, as in Cycles: it has lost on one leg only.
    assert images_seen["diffuse_direct"][4, 4, 0] == pytest.approx(clear * np.exp(-0.1 * 2), rel=2e-3)


def test_a_camera_inside_a_medium_sees_what_is_left_from_there(stage):
    """From the camera's clip start on, where Cycles' rays begin."""
    camera = stage.camera((0, 0, 0.25), (0, 0, 0), angle=0.1)
    glowing_floor(stage)
    box(stage, absorber(stage, (0.8, 0.8, 0.8)))
    for start in (0.05, 0.3, 0.75):
        camera.data.clip_start = start
        seen = stage.render(size=(8, 8))["combined"][4, 4, 0]
        assert seen == pytest.approx(2 * np.exp(-0.8 * (0.75 - start)), rel=1e-3)


def test_a_camera_on_a_boundary_sees_a_slab_or_none(stage):
    stage.camera((0, 0, 0.5), (0, 0, 0), angle=0.1)
    glowing_floor(stage)
    box(stage, absorber(stage, (0.8, 0.8, 0.8)))
    seen = stage.render(size=(8, 8))["combined"][..., 0]
    assert (2 * np.exp(-0.81) < seen).all() and (seen < 2.01).all()
    assert seen.std() < 1e-3  # all pixels alike


@pytest.mark.parametrize("scale", [1e-4, 1e5])
def test_size_changes_nothing_where_densities_follow(stage, scale):
    stage.camera_above(span=4 * scale, height=10 * scale)
    stage.scene.camera.data.clip_start, stage.scene.camera.data.clip_end = 0.01 * scale, 100 * scale
    half, deep = 5 * scale, -2 * scale
    stage.rectangle((-half, -half), (half, half), z=deep, material=stage.material("ShaderNodeEmission", Strength=2.0))
    box(stage, volume(stage, "ShaderNodeVolumeAbsorption", Color=(0, 0, 0, 1), Density=0.7 / scale), scale=(scale,) * 3)
    assert stage.render(size=(16, 16))["combined"][8, 8, 0] == pytest.approx(2 * np.exp(-0.7), rel=2e-3)


def test_a_ray_through_more_media_than_it_keeps_crossings_sees_the_sky(stage):
    stage.world((1, 1, 1))
    made = absorber(stage, (0.01, 0.01, 0.01))
    for x in range(8):
        box(stage, made, location=(2.0 * x, 0, 0))
    stage.camera((0, 0, 0), (np.pi / 2, 0, -np.pi / 2), angle=0.05)
    # Between those that it does not know one by one it stays where it is: a metre more than it should.
    assert stage.render(size=(8, 8))["combined"][..., 0] == pytest.approx(np.exp(-0.01 * 7.5), abs=0.01)


def test_the_fog_around_the_camera_stays_however_much_stands_in_it(stage):
    stage.world((1, 1, 1))
    box(stage, absorber(stage, (0.05, 0.05, 0.05)), (-1, -1, -1), (20, 1, 1))
    made = absorber(stage, (0.001, 0.001, 0.001))
    for x in range(7):
        box(stage, made, location=(2.0 * x + 1, 0, 0))
    stage.camera((0, 0, 0), (np.pi / 2, 0, -np.pi / 2), angle=0.05)
    assert stage.render(size=(8, 8))["combined"][..., 0] == pytest.approx(np.exp(-0.05 * (20 - 0.1) - 0.007), rel=3e-3)


# Light of media -----------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_medium_shines_as_the_integral_of_what_it_emits(stage):
    stage.camera_above()
    made = volume(stage, "ShaderNodeVolumeCoefficients", Absorption_Coefficients=(0.5, 0.5, 0.5),
                  Scatter_Coefficients=(0, 0, 0), Emission_Coefficients=(3.0, 2.0, 1.0))  # fmt: skip
    box(stage, made, (-1, -1, -1), (1, 1, 1))
    seen = stage.render(size=(16, 16))["emission"][8, 8, :3]
    assert seen == pytest.approx(np.array([3, 2, 1]) / 0.5 * (1 - np.exp(-1.0)), rel=1e-3)


def test_media_scatter_once_what_they_shine_on_themselves(stage):
    """A thin box that shines and scatters, without bounces of volumes: from its middle, evenly in all directions."""
    stage.camera((0, 0, 6), (0, 0, 0), angle=0.02)
    stage.scene.cycles.volume_bounces = 0
    scattered, sent = 0.02, 3.0
    made = volume(stage, "ShaderNodeVolumeCoefficients", Absorption_Coefficients=(0, 0, 0),
                  Scatter_Coefficients=(scattered,) * 3, Emission_Coefficients=(sent,) * 3)  # fmt: skip
    box(stage, made)
    seen = stage.render(size=(8, 8), samples=16, bounces=1)["volume_direct"][..., :3].mean()
    z = np.linspace(-0.5, 0.5, 22)[1:-1, None]
    golden = np.arange(4000) + 0.5
    height, turn = 1 - golden / 2000, golden * np.pi * (1 + 5**0.5)
    across = np.sqrt(1 - height**2)
    far = np.minimum(0.5 / np.abs(across * np.cos(turn)), 0.5 / np.abs(across * np.sin(turn)))
    far = np.minimum(far, np.where(height > 0, 0.5 - z, 0.5 + z) / np.abs(height))
    assert seen == pytest.approx(scattered * sent * far.mean(), rel=0.05)


@pytest.mark.slow
def test_what_shines_behind_media_that_vary_is_seen(stage):
    """Those before it leave room among a ray's bins."""
    stage.camera_above()
    thin = volume(stage, "ShaderNodeVolumeAbsorption", Color=(0, 0, 0, 1))
    nodes = thin.node_tree.nodes
    noise, scaled = nodes.new("ShaderNodeTexNoise"), nodes.new("ShaderNodeMath")
    scaled.operation, scaled.inputs[1].default_value = "MULTIPLY", 1e-4
    thin.node_tree.links.new(noise.outputs[0], scaled.inputs[0])
    thin.node_tree.links.new(scaled.outputs[0], nodes["Volume Absorption"].inputs["Density"])
    shining = volume(stage, "ShaderNodeVolumeCoefficients", Absorption_Coefficients=(0, 0, 0),
                     Scatter_Coefficients=(0, 0, 0), Emission_Coefficients=(3.0, 2.0, 1.0))  # fmt: skip
    box(stage, shining, (-1, -1, -1), (1, 1, 1))
    for z in (2.0, 4.0):
        box(stage, thin, (-1, -1, z), (1, 1, z + 1))
    seen = stage.render(size=(16, 16))["emission"][8, 8, :3]
    assert seen == pytest.approx([6.0, 4.0, 2.0], rel=5e-3)


@pytest.mark.slow
def test_a_medium_that_only_shines_lights_a_floor_as_lamps_do(stage):
    stage.camera_above(span=1.0)
    stage.floor(material=stage.diffuse(0.5))
    made = volume(stage, "ShaderNodeVolumeCoefficients", Absorption_Coefficients=(0, 0, 0),
                  Scatter_Coefficients=(0, 0, 0), Emission_Coefficients=(2.0, 2.0, 2.0))  # fmt: skip
    low, high = np.array([0.5, -0.5, 0.5]), np.array([1.5, 0.5, 1.5])
    box(stage, made, low, high)
    seen = stage.render(64, size=(16, 16), bounces=1)
    places = (np.indices((40, 40, 40)).reshape(3, -1).T + 0.5) / 40 * (high - low) + low
    squared = (places**2).sum(axis=1)
    irradiance = (2.0 * places[:, 2] / squared**1.5).mean() * np.prod(high - low)
    middle = seen["diffuse_direct"][6:10, 6:10, :3].mean()  # without the surface's colour, as in files
    assert middle == pytest.approx(irradiance / np.pi, rel=0.05)
    assert not seen["diffuse_indirect"][..., :3].any()


@pytest.mark.slow
def test_light_of_media_goes_on_from_surface_to_surface(stage):
    """In a ball of air that shines, each reflection brings the walls their albedo of what the last one did."""
    emission, radius, albedo, bounces = 0.3, 2.0, 0.5, 4
    sphere(stage, stage.diffuse(albedo), radius)
    made = volume(stage, "ShaderNodeVolumeCoefficients", Absorption_Coefficients=(0, 0, 0),
                  Scatter_Coefficients=(0, 0, 0), Emission_Coefficients=(emission,) * 3)  # fmt: skip
    box(stage, made, (-3, -3, -3), (3, 3, 3))
    stage.camera((0, 0, 0), (0, 0, 0))
    seen = stage.render(16, size=(12, 12), bounces=bounces)
    straight = 4 / 3 * emission * radius
    reflected = straight * sum(albedo**k for k in range(1, bounces))
    assert seen["diffuse_direct"][..., :3].mean() == pytest.approx(straight, rel=0.03)
    assert seen["diffuse_indirect"][..., :3].mean() == pytest.approx(reflected, rel=0.03)


def airlight(origin, direction, far, light, intensity, scattering, extinction, steps=20001):
    """Single scattering of an isotropic point light in even isotropic fog, by quadrature in the angle."""
    along = (light - origin) @ direction
    apart = np.linalg.norm(origin + along * direction - light)
    angle = np.linspace(np.arctan2(-along, apart), np.arctan2(far - along, apart), steps)
    t = along + apart * np.tan(angle)
    away = apart / np.cos(angle)
    values = (
        scattering / (4 * np.pi) * intensity * np.exp(-extinction * (t + away)) / apart
    )  # dt / away^2 = d angle / apart
    return trapezoid(values, angle)


@pytest.mark.slow
@pytest.mark.parametrize(("samples", "mean_error", "pixel_error"), [(64, 0.01, 0.05), (1, 0.05, 0.10)])
def test_airlight_of_a_point_light_is_its_integral(stage, samples, mean_error, pixel_error):
    """With one sample, too: the peak at the lamp, which the camera sees, is not spread over its neighbours."""
    start = stage.camera((0, -6, 0), (np.pi / 2, 0, 0), angle=0.8).data.clip_start
    stage.light("POINT", (0.3, 0.5, 0.2), energy=4 * np.pi**2, shadow_soft_size=0.0)  # intensity pi W/sr
    fog(stage, Color=(0.75, 0.75, 0.75, 1), Density=0.2)
    box_far = stage.rectangle((-50, -50), (50, 50), material=stage.diffuse(0.0), location=(0, 10, 0))
    box_far.rotation_euler = (np.pi / 2, 0, 0)
    fog_light = stage.render(samples, size=(12, 12), bounces=0)["volume_direct"][..., 0]
    place = np.tan(0.4) * (np.arange(12) + 0.5 - 6) / 6
    expected = np.zeros((12, 12))
    for y, up in enumerate(place):
        for x, right in enumerate(place):
            direction = np.array([right, 1.0, up])
            far = (16.0 - start) * np.linalg.norm(direction)
            eye = np.array([0, -6.0, 0]) + start * direction
            direction /= np.linalg.norm(direction)
            light = np.array([0.3, 0.5, 0.2])
            expected[y, x] = airlight(eye, direction, far, light, np.pi, 0.15, 0.15)
    # Volume Scatter absorbs nothing: extinction is scattering.
    assert fog_light.mean() == pytest.approx(expected.mean(), rel=mean_error)
    assert np.abs(fog_light / expected - 1).mean() < pixel_error


LAMP = np.zeros(3)
CORNER = 0.75  # of pixel 5 of 8 over a span of 4, along x and y


def lit_cube(stage, scale=1.0, density=0.5):
    """A cube of fog of 2 m, times scale, below a camera, with a lamp of pi W/sr, times scale squared, in its middle."""
    stage.camera_above(span=4 * scale, height=10 * scale)
    stage.scene.camera.data.clip_start, stage.scene.camera.data.clip_end = 0.01 * scale, 100 * scale
    stage.light("POINT", energy=4 * np.pi**2 * scale**2, location=(0, 0, 0), shadow_soft_size=0.0)
    fog_in_it = volume(stage, Color=(1, 1, 1, 1), Density=density / scale)
    return box(stage, fog_in_it, (-1, -1, -1), (1, 1, 1), scale=(scale,) * 3)


def airlight_of_cube(down=True, density=0.5):
    side = 1.0 if down else -1.0
    start = np.array([CORNER, CORNER, side])
    return airlight(start, np.array([0, 0, -side]), 2.0, LAMP, np.pi, density, density)


def of_corners(seen):
    """Mean of the four pixels that are as far from the lamp as each other."""
    return seen[[2, 2, 5, 5], [2, 5, 2, 5], 0].mean()


def test_light_of_media_is_spread_by_its_guide_and_stays_where_that_met_nothing(stage):
    """Behind a slab of even opacity: light over opacity of the pixel that is known, times what the guide has here over
    what it has there, but at most eight times as much, in the channels where it has met anything."""
    stage.camera_above()
    glowing_floor(stage)
    box(stage, absorber(stage, (0.7, 0.7, 0.7)), (-3, -3, -0.5), (3, 3, 0.5))
    stage.render(size=(8, 8))
    frame, opacity, known_opacity = stage.renderer.frame, 1 - np.exp(-0.7), 0.8
    limit = stage.scene.camera.location.z + 2.0 - stage.scene.camera.data.clip_start
    light, fire = np.array([3.0, 0.5, 2.0]), np.array([0.2, 0.4, 0.6])
    there, here = np.array([2.0, 1.0, 0.0]), np.array([3.0, 100.0, 0.0])
    guide = np.zeros((8, 8, 4), np.float32)
    guide[..., :3] = here
    guide[::2, ::2, :3] = there  # at the pixels that are known
    known = [np.full((4, 4, 4), (*of_it, last)) for of_it, last in ((light, limit), (fire, known_opacity))]
    drawn = [images.create(8, 8, "RGBA32F") for _ in SPREAD.outputs]
    passes.fullscreen(
        SPREAD, images.Target(tuple(drawn)),
        textures={
            "surface_position": frame.images["surface.position"], "airlight_guide": images.upload(guide),
            "coarse_direct": images.upload(known[0]), "coarse_emission": images.upload(known[1]),
            **frame.service(MediaService).media.attenuation(),
        },
        blocks={"film_view": frame.view_block}, constants={"shown_pixel": (0, 0), "stride": 2},
    )  # fmt: skip
    direct, emission = map(images.read, drawn)
    share = opacity / known_opacity
    for at in ((4, 5), (5, 4), (3, 3)):
        expected = np.where(there > 0, light * here / np.maximum(there, 1e-9), light * share)
        assert direct[at][:3] == pytest.approx(np.minimum(expected, 8 * light * share), rel=1e-3), at
        assert emission[at][:3] == pytest.approx(fire * share, rel=1e-3)
    assert direct[4, 4, :3] == pytest.approx(np.where(there > 0, light, light * share), rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e5])
def test_airlight_is_the_same_at_any_size(stage, scale):
    lit_cube(stage, scale)
    seen = stage.render(64, size=(8, 8))["volume_direct"][5, 5, 0]
    assert seen == pytest.approx(airlight_of_cube(), rel=0.03)


@pytest.mark.parametrize("tint", [(1.0, 1.0, 1.0), (1.0, 0.5, 0.1)])
def test_the_program_of_layers_before_media_is_compiled_ahead_where_something_tints(tint):
    pane = transparent(Color=(*tint, 1.0))
    made = Graph({pane.key: pane}, (pane.key, "BSDF"))
    seen = SimpleNamespace(materials=[SimpleNamespace(graph=made)])
    assert (seen_layers.AWAY in Airlight().programs(seen, Settings())) == (len({*tint}) > 1)


def mirrored_alone(stage):
    """No diffuse light, no caustics, no walks: none of it reaches these mirrors and panes."""
    candela = stage.scene.candela
    candela.slot_caustics, candela.slot_indirect, candela.airlight_bounces = "OFF", "OFF", 0


@pytest.mark.slow
def test_a_mirror_shows_the_fog_before_it(stage):
    lit_cube(stage)
    mirror = stage.material("ShaderNodeBsdfGlossy", Roughness=0.0, Color=(1, 1, 1, 1))
    stage.rectangle((-2, -2), (2, 2), z=-1.01, material=mirror)
    mirrored_alone(stage)
    seen = stage.render(64, size=(8, 8), bounces=1)
    assert of_corners(seen["glossy_indirect"]) == pytest.approx(airlight_of_cube(down=False), rel=0.03)
    assert seen["volume_direct"][5, 5, 0] == pytest.approx(airlight_of_cube(), rel=0.03)


@pytest.mark.slow
def test_glass_shows_the_fog_behind_it(stage):
    lit_cube(stage)
    box(stage, stage.material("ShaderNodeBsdfGlass", IOR=1.0001, Roughness=0.0), (-2, -2, 1.2), (2, 2, 1.4))
    mirrored_alone(stage)
    seen = stage.render(64, size=(8, 8), bounces=1)
    assert of_corners(seen["transmission_indirect"]) == pytest.approx(airlight_of_cube(), rel=0.03)


@pytest.mark.slow
def test_glass_shows_what_fog_scatters_more_than_once(stage):
    """A pane that bends nothing changes nothing; a third of this fog's light has been scattered more than once."""
    lit_cube(stage, density=1.0)
    mirrored_alone(stage)
    once = stage.render(64, size=(8, 8), bounces=4)["combined"][..., 0].mean()
    stage.scene.candela.airlight_bounces = 4
    bare = stage.render(64, size=(8, 8), bounces=4)["combined"][..., 0].mean()
    box(stage, stage.material("ShaderNodeBsdfGlass", IOR=1.0001, Roughness=0.0), (-2, -2, 1.2), (2, 2, 1.4))
    seen = stage.render(64, size=(8, 8), bounces=4)["combined"][..., 0].mean()
    assert bare > 1.2 * once and seen == pytest.approx(bare, rel=0.03)


@pytest.mark.slow
def test_fog_fades_what_a_mirror_shows(stage):
    stage.camera_above()
    mirror = stage.material("ShaderNodeBsdfGlossy", Roughness=0.0, Color=(1, 1, 1, 1))
    stage.rectangle((-2, -2), (2, 2), z=-1.0, material=mirror)
    glowing_floor(stage, z=3.0).visible_camera = False
    mirrored_alone(stage)
    box(stage, absorber(stage, (0.8, 0.5, 0.1)))
    seen = stage.render(4, size=(16, 16), bounces=1)["combined"]
    assert seen[8, 8, :3] == pytest.approx(2 * np.exp(-2 * np.array([0.8, 0.5, 0.1])), rel=0.01)
    assert seen[1, 1, :3] == pytest.approx(2.0, rel=0.01)
    bpy.context.scene.objects[-1].visible_glossy = False
    seen = stage.render(4, size=(16, 16), bounces=1)["combined"]
    assert seen[8, 8, :3] == pytest.approx(2 * np.exp([-0.8, -0.5, -0.1]), rel=0.01)


PHASE = passes.fullscreen_program(
    "phase functions",
    "generated/phase_test",
    constants=(("INT", "kind"), ("FLOAT", "g"), ("VEC4", "values")),
    snippets=((
        "generated/phase_test",
        '#include "media/phase.glsl"\n'  # noqa: ISC004
        "void main() { out_value = vec4(phase_value(kind, g, values, 2.0 * screen.x - 1.0)); }\n",
    ),),
    outputs=(("VEC4", "out_value"),),
)  # fmt: skip


def phase(kind, g=0.0, values=(1.33, 0.1, 0.5, 20.0)):
    """2,048 x 4 values of a phase function over the cosine, and the cosines."""
    medium = Medium(np.zeros(3), np.ones(3), np.zeros(3), g, 0.0, 0.0, True, phase=kind, phase_values=values)
    with images.borrowed(8192, 1, "RGBA32F") as target:
        passes.fullscreen(PHASE, target, constants={
            "kind": PHASES.index(kind), "g": g, "values": phase_values(medium),
        })  # fmt: skip
        return images.read(target.colors[0])[0, :, 0], (np.arange(8192) + 0.5) / 4096 - 1


@pytest.mark.parametrize(
    ("kind", "g", "values"),
    [
        ("HENYEY_GREENSTEIN", 0.0, ()), ("HENYEY_GREENSTEIN", 0.7, ()), ("HENYEY_GREENSTEIN", -0.7, ()),
        ("RAYLEIGH", 0.0, ()), ("DRAINE", 0.5, (1.33, 0.1, 2.0, 20.0)), ("MIE", 0.0, (1.33, 0.1, 0.5, 0.08)),
        ("MIE", 0.0, (1.33, 0.1, 0.5, 1.0)), ("MIE", 0.0, (1.33, 0.1, 0.5, 3.0)),
    ],
)  # fmt: skip
def test_phase_functions_integrate_to_one(stage, kind, g, values):
    stage.camera_above()
    stage.render(size=(2, 2))  # a GPU context
    found, _ = phase(kind, g, values or (1.33, 0.1, 0.5, 20.0))
    assert (found >= 0).all()
    assert found.mean() * 4 * np.pi == pytest.approx(1.0, abs=3e-3)


@pytest.mark.parametrize("share", [0.02, 0.1, 0.2])
def test_fournier_and_forand_scatter_backwards_what_they_are_told(stage, share):
    """Their peak forwards is a singularity, which no even quadrature finds: up to 42 % lie in one cosine of 8,192."""
    stage.camera_above()
    stage.render(size=(2, 2))
    found, mu = phase("FOURNIER_FORAND", 0.0, (1.33, share, 0.5, 20.0))
    assert (found >= 0).all()
    assert found[mu < 0].sum() / 4096 * 2 * np.pi == pytest.approx(share, rel=1e-3)
    assert found.mean() * 4 * np.pi < 1.001


def test_henyey_and_greenstein_mirrors_with_the_sign_of_g(stage):
    stage.camera_above()
    stage.render(size=(2, 2))
    forward, mu = phase("HENYEY_GREENSTEIN", 0.7)
    assert forward == pytest.approx(phase("HENYEY_GREENSTEIN", -0.7)[0][::-1], rel=1e-3)
    assert forward[-1] == pytest.approx(0.51 / (4 * np.pi * 0.3**3), rel=0.01)
    assert 2 * np.pi * (forward * mu).sum() / 4096 == pytest.approx(0.7, abs=2e-3)  # g is the mean cosine


@pytest.mark.slow
def test_a_cloud_of_albedo_one_in_even_light_is_hardly_to_be_seen(stage):
    """A white furnace: what is missing is light of more bounces than are asked."""
    stage.camera_above(span=1.0)
    stage.world((1, 1, 1))
    box(stage, volume(stage, Color=(1, 1, 1, 1), Density=1.0))
    missing = []
    for bounces in (0, 1, 8):
        missing.append(1.0 - stage.render(32, size=(4, 4), bounces=bounces)["combined"][..., :3].mean())
    assert missing[0] > missing[1] > 0.02
    assert missing[2] == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("lamp", ["sun", "point"])
def test_thin_fog_above_a_lit_floor_scatters_what_the_floor_sends(stage, lamp):
    """Half of all directions see the floor's radiance, so that fog of optical depth t sends half of t of it."""
    stage.floor(half=500.0, material=stage.diffuse(0.8))
    if lamp == "sun":
        stage.light("SUN", energy=np.pi, angle=0.0)
    else:  # so far off that the floor below the fog is lit evenly; its rays are followed to where they end
        stage.light("POINT", (0, 0, 200), energy=4 * np.pi**2 * 200**2, shadow_soft_size=0.0)
    box(stage, volume(stage, Color=(1, 1, 1, 1), Density=0.02), (-0.5, -0.5, 1.0), (0.5, 0.5, 1.5))
    stage.camera_above(span=0.5)
    stage.scene.candela.slot_indirect = "OFF"
    seen = stage.render(16, size=(16, 16), bounces=1)["volume_indirect"][..., :3].mean()
    assert seen == pytest.approx(0.02 * 0.5 * 0.8 / 2, rel=0.05)


def test_fog_without_light_is_attenuation_alone(stage):
    stage.camera_above()
    glowing_floor(stage)
    box(stage, absorber(stage, (0.5, 0.5, 0.5)))
    stage.render(size=(8, 8))
    assert "absorb alone" in stage.ledger.row("airlight").reason
    assert "radiance.volume_direct" not in stage.renderer.frame.images


def test_a_scene_without_a_medium_pays_nothing(stage):
    stage.camera_above()
    stage.floor()
    stage.light("POINT")
    seen = stage.render(size=(8, 8))
    for name in ("media", "airlight", "volume_caustics"):
        assert stage.ledger.row(name).state == "skipped"
    assert not any("volume" in name for name in stage.renderer.frame.images)
    assert not seen["volume_direct"].any()


# What breaks things -------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("density", [0.0, 1e6, -3.0, 1e38])
def test_any_density_gives_a_finite_picture(stage, density):
    stage.camera_above()
    glowing_floor(stage)
    stage.light("POINT", (0, 0, 0), energy=10, shadow_soft_size=0.0)  # in the middle of it
    box(stage, volume(stage, "ShaderNodeVolumePrincipled", Density=density, Emission_Strength=0.1))
    seen = stage.render(2, size=(8, 8))["combined"]
    assert (seen[..., :3] >= 0).all()
    if density == 1e6:
        assert seen[4, 4, 0] < 1.0


@pytest.mark.slow
def test_open_meshes_and_flat_ones_give_a_finite_picture(stage):
    stage.camera_above()
    glowing_floor(stage)
    stage.light("POINT", (0, 0, 1), energy=10)
    made = volume(stage, Density=0.5)
    stage.rectangle((-1, -1), (0, 1), z=0.0, material=made)
    box(stage, made, (0.2, -1, 0), (1, 1, 0))
    stage.render(2, size=(8, 8))


@pytest.mark.slow
def test_a_grid_of_any_numbers_gives_a_finite_picture(stage, tmp_path):
    vdb = openvdb()
    rng = np.random.default_rng(1)
    values = rng.random((8, 8, 8), np.float32)
    values[2, 3, 4], values[4, 4, 4], values[1, 1, 1] = np.nan, np.inf, -5.0
    grid = vdb.FloatGrid()
    grid.name = "density"
    grid.copyFromArray(values, ijk=(-4, -4, -4))
    grid.transform = vdb.createLinearTransform(voxelSize=0.25)
    vdb.write(str(tmp_path / "cloud.vdb"), [grid])
    cloud = bpy.data.volumes.new("cloud")
    cloud.filepath = str(tmp_path / "cloud.vdb")
    cloud.materials.append(volume(stage, "ShaderNodeVolumePrincipled", Density=1.0))
    stage.link("cloud", cloud)
    stage.camera_above()
    glowing_floor(stage)
    stage.light("POINT", (0, 0, 2))
    seen = stage.render(2, size=(8, 8))
    assert seen["combined"][4, 4, 0] > 0.05
    assert seen["volume_direct"].max() > 0


def voxels(stage, tmp_path, values, material, side=0.25):
    """An OpenVDB object of these densities, its middle in the origin."""
    vdb = openvdb()
    grid = vdb.FloatGrid()
    grid.name = "density"
    grid.copyFromArray(values, ijk=tuple(-n // 2 for n in values.shape))
    grid.transform = vdb.createLinearTransform(voxelSize=side)
    vdb.write(str(tmp_path / "voxels.vdb"), [grid])
    cloud = bpy.data.volumes.new("cloud")
    cloud.filepath = str(tmp_path / "voxels.vdb")
    cloud.materials.append(material)
    return stage.link("cloud", cloud)


def test_a_wall_of_one_voxel_leaks_nothing(stage, tmp_path):
    """Optical depth 25; neither the camera nor the lamp sees through it."""
    values = np.full((16, 16, 16), 1e-4, np.float32)
    values[..., 7] = 100.0
    wall = volume(stage, "ShaderNodeVolumePrincipled", Density=1.0, Color=(0, 0, 0, 1))
    cloud = voxels(stage, tmp_path, values, wall)
    stage.camera_above()
    stage.floor(z=-3.0)
    stage.light("SUN", (0, 0, 5), (0.3, 0.2, 0), energy=np.pi)
    stage.scene.candela.slot_indirect = stage.scene.candela.slot_volume = "OFF"
    assert stage.render(4, size=(12, 12))["combined"][3:9, 3:9, 0].max() < 1e-8
    cloud.visible_camera = False
    assert stage.render(4, size=(12, 12))["combined"][5:7, 5:7, 0].max() < 1e-8


def test_a_volume_object_whose_material_reads_no_grid_is_not_drawn(stage, tmp_path):
    even = volume(stage, "ShaderNodeVolumeAbsorption", Color=(0, 0, 0, 1), Density=1.0)
    voxels(stage, tmp_path, np.ones((4, 4, 4), np.float32), even)
    stage.camera_above()
    glowing_floor(stage)
    assert stage.render(size=(8, 8))["combined"][4, 4, 0] == pytest.approx(2.0, rel=1e-5)


@pytest.mark.slow
def test_voxels_absorb_what_stands_in_them(stage, tmp_path):
    """An even grid of 8 voxels of 0.25 m, lifted by a voxel: two metres of extinction 0.4."""
    vdb = openvdb()
    grid = vdb.FloatGrid()
    grid.name = "density"
    grid.copyFromArray(np.full((8, 8, 8), 0.4, np.float32), ijk=(-4, -4, -3))
    grid.transform = vdb.createLinearTransform(voxelSize=0.25)
    vdb.write(str(tmp_path / "even.vdb"), [grid])
    cloud = bpy.data.volumes.new("even")
    cloud.filepath = str(tmp_path / "even.vdb")
    made = volume(stage, "ShaderNodeVolumePrincipled", Density=1.0, Color=(0, 0, 0, 1))
    cloud.materials.append(made)
    stage.link("even", cloud)
    stage.camera_above()
    glowing_floor(stage)
    stage.scene.candela.slot_volume = "OFF"
    seen = stage.render(4, size=(16, 16))["combined"]
    assert seen[8, 8, 0] == pytest.approx(2 * np.exp(-0.8), rel=0.01)
    # Interpolated linearly, the grid fades out over the voxel beyond its rim, which is pixel 3; the next is free of it.
    assert 2 * np.exp(-0.8) < seen[8, 3, 0] < 2.0
    assert seen[8, 2, 0] == pytest.approx(2.0, rel=0.01)
    cloud.materials.clear()  # leaves a Principled Volume of density 1
    assert stage.render(4, size=(16, 16))["combined"][8, 8, 0] == pytest.approx(2 * np.exp(-0.8), rel=0.01)


def test_a_change_of_fog_alone_begins_the_picture_anew(stage):
    stage.camera_above()
    glowing_floor(stage)
    made = box(stage, absorber(stage, (0.8, 0.8, 0.8)))
    seen = []
    for density in (1.0, 2.0):
        node = next(n for n in made.data.materials[0].node_tree.nodes if n.type == "VOLUME_ABSORPTION")
        node.inputs["Density"].default_value = density
        seen.append(stage.render(size=(8, 8))["combined"][4, 4, 0])
    assert seen == pytest.approx([2 * np.exp(-0.8), 2 * np.exp(-1.6)], rel=1e-3)
    fog(stage, node="ShaderNodeVolumeAbsorption", Color=(0, 0, 0, 1), Density=0.1)
    thin = stage.render(size=(8, 8))["combined"][0, 0, 0]
    node = next(n for n in stage.scene.world.node_tree.nodes if n.type == "VOLUME_ABSORPTION")
    node.inputs["Density"].default_value = 0.2
    assert stage.render(size=(8, 8))["combined"][0, 0, 0] == pytest.approx(thin * np.exp(-0.1 * (12 - 0.1)), rel=2e-3)


@pytest.mark.slow
def test_fog_in_a_scene_without_any_mesh(stage):
    stage.camera((0, -6, 0), (np.pi / 2, 0, 0))
    stage.light("POINT", (0, 0, 0), energy=100, shadow_soft_size=0.0)
    fog(stage, Density=0.2)
    assert stage.render(2, size=(8, 8))["volume_direct"].min() > 0


def test_endless_fog_lets_no_light_of_the_world_through(stage):
    """Nor does it leave noise about nothing, half of it below zero."""
    fog(stage, (1, 1, 1), Density=0.05)
    stage.floor()
    stage.camera_above()
    assert not stage.render(4, (16, 16), bounces=0)["combined"][..., :3].any()
    assert stage.ledger.row("environment_light").reason == "the world's fog lets none of its light through"


def test_a_lamp_in_endless_fog_is_seen_as_far_as_it_is(stage):
    stage.camera((0, -6, 0), (np.pi / 2, 0, 0), angle=0.2)
    stage.light("POINT", (0, 0, 0), energy=100, shadow_soft_size=0.4)
    clear = stage.render(8, size=(9, 9))["emission"][4, 4, 0]
    fog(stage, node="ShaderNodeVolumeAbsorption", Color=(0, 0, 0, 1), Density=0.2)
    seen = stage.render(8, size=(9, 9))["emission"][4, 4, 0]
    assert seen == pytest.approx(clear * np.exp(-0.2 * 6.0), rel=0.01)


@pytest.mark.slow
def test_walks_in_endless_fog_begin_where_they_are_seen(stage):
    """Drawn evenly by the logarithm of the distance to a lamp, nine of ten lay behind thousands of metres of fog."""
    stage.camera((0, -6, 0), (np.pi / 2, 0, 0), angle=0.8)
    stage.light("POINT", (0, 0, 0), energy=100, shadow_soft_size=0.1)
    fog(stage, Density=0.2)
    seen = stage.render(4, size=(16, 16), bounces=1)["volume_indirect"][..., 0]
    sides = [turned for one in (seen, seen.T) for turned in (one, one[::-1])]
    alike = np.array([turned for one in sides for turned in (one, one[:, ::-1])])
    assert np.mean(alike.var(axis=0) / alike.mean(axis=0) ** 2) < 0.2


@pytest.mark.slow
def test_a_medium_before_another_dims_its_airlight_by_beer_and_lambert(stage):
    """1 m that absorbs .7 of red, .2 of green and no blue, before fog that a sun lights from the side."""
    box(stage, volume(stage, Density=0.4), (-0.5, -0.5, -1.0), (0.5, 0.5, 0.0))
    box(stage, absorber(stage, (0.7, 0.2, 0.0)), (-0.5, -0.5, 1.0), (0.5, 0.5, 2.0))
    stage.light("SUN", turn=(0, np.pi / 2, 0), energy=3.0, angle=0.0)
    stage.camera_above(0.5)
    seen = stage.render(16, size=(16, 16), bounces=0)["volume_direct"][..., :3].mean((0, 1))
    np.testing.assert_allclose(seen / seen[2], np.exp(-np.array([0.7, 0.2, 0.0])), rtol=0.01)


def test_volume_bounces_are_those_of_the_scene(stage):
    """Of its light paths for Cycles, but where Candela's own number is set."""
    scene = stage.scene
    before = scene.cycles.volume_bounces
    try:
        for own, cycles, wanted in ((-1, 0, 0), (-1, 3, 3), (-1, 100, 12), (2, 3, 2)):
            scene.candela.airlight_bounces, scene.cycles.volume_bounces = own, cycles
            assert settings_of(scene, viewport=False).values["airlight", "bounces"] == wanted
    finally:
        scene.cycles.volume_bounces = before


def test_denoising_keeps_the_light_of_a_shaft_and_takes_its_noise(stage):
    """A round lamp behind a plate with a hole, before a black backdrop in part: what is not noise stays."""
    candela = stage.scene.candela
    candela.slot_indirect, candela.airlight_bounces = "OFF", 0
    stage.camera((0, -6, 1), (np.pi / 2, 0, 0), angle=0.6)
    fog(stage, Density=0.1)
    for low, high in (((-2, -2), (-0.3, 2)), ((0.3, -2), (2, 2))):
        stage.rectangle(low, high, 2.0, material=stage.diffuse(0.0))
    stage.light("POINT", (0, 0, 3.5), energy=100, shadow_soft_size=0.5)
    light = {}
    for name, samples, strength in (("noisy", 8, 0.0), ("denoised", 8, 1.0), ("truth", 64, 0.0)):
        candela.denoise_strength = strength
        light[name] = stage.render(samples, size=(32, 32), seed=samples)["volume_direct"][..., 0]
    assert light["denoised"].mean() == pytest.approx(light["truth"].mean(), rel=0.03)
    error = {name: np.square(light[name] - light["truth"]).mean() for name in ("noisy", "denoised")}
    assert error["denoised"] < 0.8 * error["noisy"]


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_a_camera_in_water_sees_what_the_water_leaves(stage, turn):
    """What stands in it through one stretch, what stands behind its face through that and the interface.

    Both begin at the camera's clip start, as in Cycles.
    """
    water = stage.material("ShaderNodeBsdfGlass", IOR=1.33, Roughness=0.0)
    fill(water.node_tree, "ShaderNodeVolumeAbsorption", Color=(0.1, 0.6, 0.8, 1), Density=0.5)
    camera = stage.camera((0, 0, 0), (0, 0, 0), angle=0.02)  # looks down
    camera.data.clip_start = start = 0.2
    wall = glowing_floor(stage, z=-1.5, strength=1.0)
    box(stage, water, (-1, -1, -1), (1, 1, 1), turn=(0, 0, turn))
    absorbed = 0.5 * np.array([0.9, 0.4, 0.2])
    seen = stage.render(4, size=(8, 8))["combined"][..., :3].mean(axis=(0, 1))
    interface = 1 - ((1.33 - 1) / (1.33 + 1)) ** 2
    left = np.exp(-(1 - start) * absorbed)
    assert seen == pytest.approx(interface * left, rel=0.01)  # what is mirrored is chosen at random
    wall.location.z = 0.9  # in the water, 0.6 m below the camera
    seen = stage.render(1, size=(8, 8))["combined"][4, 4, :3]
    assert seen == pytest.approx(np.exp(-(0.6 - start) * absorbed), rel=1e-3)


def test_air_is_lit_by_the_meshes_that_volumes_may_see(stage):
    """Of a glowing mesh the ray visibility Volume Scatter alone decides."""
    stage.camera_above()
    fog(stage, Color=(1, 1, 1, 1), Density=0.05)
    lamp = stage.rectangle((3, -1), (4, 1), z=1.0, material=stage.material("ShaderNodeEmission", Strength=20.0))
    lit = stage.render(1, (12, 12))["volume_direct"].mean()
    lamp.visible_diffuse = False
    assert stage.render(1, (12, 12))["volume_direct"].mean() == pytest.approx(lit, rel=1e-3)
    lamp.visible_diffuse, lamp.visible_volume_scatter = True, False
    assert lit > 0.01 and not stage.render(1, (12, 12))["volume_direct"].any()


@pytest.mark.slow
def test_air_keeps_the_light_of_a_floor_whose_lamp_it_does_not_see(stage):
    """In thin air what a floor reflects into it is all of its indirect light, whoever lights the floor."""
    stage.camera((0, -6, 1.5), (np.pi / 2, 0, 0), angle=0.4)
    fog(stage, Density=1e-3)
    stage.floor(material=stage.diffuse(0.8))
    lamp = stage.light("POINT", (0, 0, 2), energy=1000, shadow_soft_size=0.1)
    stage.scene.candela.airlight_bounces = 1
    found = {}
    for name, hidden in (("seen", None), ("unseen by air", "volume_scatter"), ("unseen by floor", "diffuse")):
        lamp.visible_volume_scatter, lamp.visible_diffuse = hidden != "volume_scatter", hidden != "diffuse"
        found[name] = stage.render(4, size=(32, 32), bounces=1)
    direct, indirect = (
        {name: one[f"volume_{path}"][20:, :, 0].mean() for name, one in found.items()}
        for path in ("direct", "indirect")
    )
    assert direct["unseen by air"] == 0 and direct["unseen by floor"] == pytest.approx(direct["seen"], rel=1e-3)
    assert indirect["unseen by air"] == pytest.approx(indirect["seen"], rel=0.05)
    assert indirect["unseen by floor"] < 0.02 * indirect["seen"]


@pytest.mark.parametrize("samples", [4, 16])
def test_rough_gloss_in_fog_shows_its_light(stage, samples):
    """As Cycles has it: a rough metal floor in a white fog below a sun, which mirrors no surface."""
    stage.camera((0, -4, 1.5), (1.2, 0, 0), angle=0.6)
    stage.floor(6.0, material=stage.principled(Metallic=1.0, Roughness=0.8, Base_Color=(0.9, 0.6, 0.3, 1)))
    stage.light("SUN", turn=(0.4, 0.3, 0), energy=3.0, angle=0.1)
    box(stage, volume(stage, Color=(0.9, 0.9, 0.9, 1), Density=0.1), (-6, -6, 0.01), (6, 6, 3))
    own, cycles = (
        stage.render(count, size=(24, 20), bounces=1, engine=engine)["glossy_indirect"][2:8, 2:-2, :3].mean((0, 1))
        for count, engine in ((samples, "CANDELA"), (512, "CYCLES"))
    )
    assert own == pytest.approx(cycles, rel=0.15)
