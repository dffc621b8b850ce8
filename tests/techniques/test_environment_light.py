"""The world as a light: irradiance and occlusion of the sky in closed form, images, visibility."""

from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from addon.frame.settings import Settings
from addon.lighting.maps_or_rays import Compared
from addon.sources import environment
from addon.sources.rates import Rate
from addon.techniques import environment_light
from tests.techniques.conftest import places

SPAN = 4.0


@pytest.fixture
def floor(stage):
    stage.floor(200.0)
    stage.camera_above(SPAN)
    stage.scene.camera.data.clip_end = 1000
    return stage


def diffuse(stage, samples, size=(32, 32)):
    """Radiance of a white floor; under an open sky of radiance 1 it is 1."""
    return stage.render(samples, size)["diffuse_direct"].astype(float)


def sky(stage, pixels):
    """A world with an equirectangular image, (H, W, 3) linear radiance, bottom row first."""
    height, width = pixels.shape[:2]
    image = bpy.data.images.new("Sky", width, height, float_buffer=True)
    image.colorspace_settings.name = "Linear Rec.709"
    image.pixels.foreach_set(np.dstack([pixels, np.ones((height, width))]).astype(np.float32).ravel())
    image.update()
    tree = stage.world().node_tree
    node = tree.nodes.new("ShaderNodeTexEnvironment")
    node.image = image
    background = next(node for node in tree.nodes if node.type == "BACKGROUND")
    tree.links.new(node.outputs["Color"], background.inputs["Color"])


def directions(height, width):
    """Unit vectors of an equirectangular image's texel centres, and their solid angles."""
    v, u = (np.mgrid[0:height, 0:width] + 0.5) / np.array([height, width])[:, None, None]
    latitude, azimuth = (v - 0.5) * np.pi, (0.5 - u) * 2 * np.pi
    ring = np.cos(latitude)
    direction = np.stack([ring * np.cos(azimuth), ring * np.sin(azimuth), np.sin(latitude)], axis=-1)
    return direction, ring * np.pi / height * 2 * np.pi / width


def test_an_open_floor_under_an_even_sky_has_the_skys_colour(floor):
    floor.world((0.2, 0.5, 1.0), strength=3.0)
    np.testing.assert_allclose(diffuse(floor, 64), np.broadcast_to([0.6, 1.5, 3.0], (32, 32, 3)), rtol=0.005)


@pytest.mark.slow
def test_a_long_wall_hides_its_form_factor_of_the_sky(floor):
    """Height h at distance d: the wall fills (1 - cos a) / 2 of the sky, tan a = h / d."""
    floor.world()
    wall = floor.mesh([(0, -300, 0), (0, 300, 0), (0, 300, 1), (0, -300, 1)], [(0, 1, 2, 3)])
    wall.visible_camera = False
    x, _ = places((64, 4), SPAN)
    expected = 0.5 + 0.5 * np.abs(x) / np.hypot(1.0, x)
    found = diffuse(floor, 256, (64, 4))[..., 0]
    assert np.sqrt(((found - expected) ** 2).mean()) < 0.01
    assert found.mean() == pytest.approx(expected.mean(), rel=0.005)


def test_the_only_sample_has_no_hard_shadows_of_single_directions(floor):
    """A wall's form factor as above, in means of columns of pixels, in which hard shadows would stay."""
    floor.world()
    wall = floor.mesh([(0, -300, 0), (0, 300, 0), (0, 300, 1), (0, -300, 1)], [(0, 1, 2, 3)])
    wall.visible_camera = False
    x, _ = places((64, 48), SPAN)
    expected = (0.5 + 0.5 * np.abs(x) / np.hypot(1.0, x)).mean(axis=0)
    found = diffuse(floor, 1, (64, 48))[..., 0].mean(axis=0)
    assert floor.ledger.row("environment_light").counters["rays per pixel"] > 1
    assert np.sqrt(((found - expected) ** 2).mean()) < 0.02


def test_a_roof_over_everything_leaves_darkness(floor):
    floor.world()
    floor.blocker((-300, -300), (300, 300), 0.5)
    assert diffuse(floor, 16).max() < 0.01


@pytest.mark.slow
def test_half_a_sky_from_an_image_gives_half_the_light(floor):
    """Radiance 2 where x > 0: irradiance pi, whatever the seam between the halves does."""
    direction, _ = directions(32, 64)
    floor_light = np.where(direction[..., :1] > 0, 2.0, 0.0) * np.ones(3)
    sky(floor, floor_light)
    assert diffuse(floor, 128).mean() == pytest.approx(1.0, rel=0.005)


@pytest.mark.slow
def test_the_light_of_an_image_is_the_integral_over_its_texels(floor):
    direction, solid_angle = directions(16, 32)
    pixels = np.random.default_rng(4).uniform(0, 1, (16, 32, 3)) ** 4
    pixels[12, 5] = 40.0  # a lamp of one texel
    sky(floor, pixels)
    floor.scene.candela.environment_light_directions = 8  # 2048 in all: their error is about 0.7 %
    # Bilinear filtering moves light between rows of different cosine; 16 x finer texels of the filtered image do not.
    fine = filtered(pixels, 16)
    direction, solid_angle = directions(*fine.shape[:2])
    weight = (np.maximum(direction[..., 2], 0) * solid_angle)[..., None]
    np.testing.assert_allclose(
        diffuse(floor, 256).mean(axis=(0, 1)), (fine * weight).sum(axis=(0, 1)) / np.pi, rtol=0.01
    )


def filtered(pixels, times):
    """The image between its texel centres, as a bilinear lookup sees it."""
    height, width = pixels.shape[:2]
    y, x = (np.arange(height * times) + 0.5) / times - 0.5, (np.arange(width * times) + 0.5) / times - 0.5
    y0, x0 = np.floor(y).astype(int), np.floor(x).astype(int)
    ty, tx = (y - y0)[:, None, None], (x - x0)[None, :, None]
    rows, columns = np.clip([y0, y0 + 1], 0, height - 1), np.array([x0, x0 + 1]) % width
    a, b = pixels[rows[0]], pixels[rows[1]]
    lower = a[:, columns[0]] * (1 - tx) + a[:, columns[1]] * tx
    upper = b[:, columns[0]] * (1 - tx) + b[:, columns[1]] * tx
    return lower * (1 - ty) + upper * ty


def test_k_times_the_worlds_strength_is_k_times_the_picture(floor):
    floor.blocker((-0.5, -0.5), (0.5, 0.5), 0.5)
    world = floor.world((0.2, 0.5, 1.0))
    one = floor.render(4)["combined"][..., :3]
    next(n for n in world.node_tree.nodes if n.type == "BACKGROUND").inputs["Strength"].default_value = 4.0
    np.testing.assert_allclose(floor.render(4)["combined"][..., :3], one * 4, rtol=1e-5)


def test_no_light_of_the_sky_comes_in_through_the_corners_of_walls_without_thickness(stage, monkeypatch):
    """One open box within another that is open on the other side: what the camera sees inside has no way to the sky."""
    monkeypatch.setattr(Compared, "by_rays", False)
    for half, lacking in ((0.5, 1), (0.65, -1)):
        corners = [(x, y, z) for x in (-half, half) for y in (-half, half) for z in (-half, half)]
        faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 2, 6, 4), (1, 5, 7, 3), (2, 3, 7, 6) if lacking < 0 else (0, 4, 5, 1)]
        stage.mesh(corners, faces, material=stage.diffuse())
    stage.camera((0.03, 0.3, 0.01), (np.pi / 2, 0, np.pi), angle=1.6)
    stage.world()
    assert stage.render(16, (64, 48))["combined"][..., :3].max() == 0


def test_a_world_hidden_from_the_camera_still_gives_light(stage):
    stage.rectangle((-1, -2), (1, 2), material=stage.diffuse())
    stage.camera_above(SPAN)
    world = stage.world()
    shown = stage.render(16)
    world.cycles_visibility.camera = False
    hidden = stage.render(16)
    x, _ = places((32, 32), SPAN)
    assert (shown["combined"][np.abs(x) > 1.1, :3] == 1).all()
    assert (hidden["combined"][np.abs(x) > 1.1, :3] == 0).all()
    np.testing.assert_allclose(hidden["diffuse_direct"], shown["diffuse_direct"], rtol=1e-5)


def test_a_transparent_film_shows_the_world_as_alpha_and_in_its_own_pass(stage):
    stage.rectangle((-1, -2), (1, 2), material=stage.diffuse())
    stage.camera_above(SPAN)
    stage.world((0.25, 0.5, 1.0))
    stage.scene.render.film_transparent = True
    images = stage.render(16)
    outside = np.abs(places((32, 32), SPAN)[0]) > 1.1
    assert (images["combined"][outside] == 0).all()
    assert (images["environment"][outside] == [0.25, 0.5, 1.0]).all()
    assert (images["combined"][~outside & (np.abs(places((32, 32), SPAN)[0]) < 0.9), 3] == 1).all()


def gallery(stage):
    """A floor below a low roof with holes far apart: each place sees the sky through another one."""
    stage.floor(6.0)
    stage.camera_above(SPAN)
    stage.world((0.3, 0.6, 1.0))
    for x in range(-3, 3):
        for y in range(-3, 3):
            stage.rectangle((x, y), (x + 1, y + 0.6), z=0.4).visible_camera = False
            stage.rectangle((x, y + 0.6), (x + 0.6, y + 1), z=0.4).visible_camera = False


def test_what_is_known_of_an_uneven_sky_needs_no_directions(floor):
    """Each sample of an open floor has the irradiance of its normal, whatever directions it drew."""
    height, width = 32, 64
    direction, solid_angle = directions(height, width)
    pixels = np.repeat((0.1 + np.maximum(direction[..., 2], 0) + 5.0 * (direction[..., 0] > 0.8))[..., None], 3, 2)
    sky(floor, pixels)
    known = (pixels[..., 0] * solid_angle * np.maximum(direction[..., 2], 0)).sum() / np.pi
    for seed in (1, 2):
        found = floor.render(1, seed=seed)["diffuse_direct"]
        np.testing.assert_allclose(found, known, rtol=0.02)  # the map is seen interpolated


@pytest.mark.parametrize("exponent", [-2, 0, 3])
def test_known_light_counts_once_however_often_directions_are_drawn(floor, monkeypatch, exponent):
    height, width = 32, 64
    direction, solid_angle = directions(height, width)
    pixels = np.repeat((0.1 + np.maximum(direction[..., 2], 0) + 5.0 * (direction[..., 0] > 0.8))[..., None], 3, 2)
    sky(floor, pixels)
    known = (pixels[..., 0] * solid_angle * np.maximum(direction[..., 2], 0)).sum() / np.pi
    monkeypatch.setattr(environment_light, "directions_rate", lambda frame: Rate(exponent))
    np.testing.assert_allclose(diffuse(floor, 8), known, rtol=0.02)


@pytest.mark.slow
def test_known_light_leaves_the_mean_where_things_stand_in_the_way(floor, monkeypatch):
    """A wall beside the floor under an uneven sky: the same mean with what is known taken off and without."""
    height, width = 32, 64
    direction, _ = directions(height, width)
    pixels = np.repeat((0.1 + 2.0 * (direction[..., 0] > 0.5) + (direction[..., 1] < -0.8))[..., None], 3, 2)
    sky(floor, pixels)
    wall = floor.mesh([(0, -300, 0), (0, 300, 0), (0, 300, 1), (0, -300, 1)], [(0, 1, 2, 3)])
    wall.visible_camera = False
    floor.scene.candela.environment_light_directions = 4

    def mean_and_noise():
        pictures = []
        for seed in range(6):
            pictures.append(floor.render(16, seed=seed)["diffuse_direct"][..., 0].mean(axis=0, dtype=float))
        return np.mean(pictures, axis=0), np.std(pictures, axis=0, ddof=1)

    mean, noise = mean_and_noise()
    monkeypatch.setattr(environment_light.EnvironmentLight, "_known", lambda self, frame, maps, share: maps)
    plain, plain_noise = mean_and_noise()
    np.testing.assert_allclose(mean, plain, atol=0.01 * plain.mean() + 3 * np.hypot(noise, plain_noise).max() / 6**0.5)
    assert (noise**2).mean() < 0.7 * (plain_noise**2).mean()


@pytest.mark.slow
def test_rays_by_tiles_have_the_mean_of_shared_directions(stage, monkeypatch):
    monkeypatch.setattr(environment_light, "UNSHARED", np.inf)  # rays, whatever they leave,
    monkeypatch.setattr(
        environment_light.EnvironmentLight, "_needed", lambda self, rate: np.inf
    )  # and all there may be
    gallery(stage)
    stage.scene.candela.light_probes_maps = (
        3.0  # 64 samples double it, and the world has twice of that, for the error it would leave
    )
    by_rays = stage.render(64, (64, 48))["diffuse_direct"].astype(float)
    assert stage.ledger.row("environment_light").counters["rays per pixel"] == 512  # a ray costs less than a map
    stage.scene.candela.environment_light_directions = 16
    shared = stage.render(64, (64, 48))["diffuse_direct"].astype(float)
    assert "rays per pixel" not in stage.ledger.row("environment_light").counters
    np.testing.assert_allclose(by_rays.mean(axis=(0, 1)), shared.mean(axis=(0, 1)), rtol=0.01)
    halves = [picture.reshape(4, 12, 4, 16, 3).mean(axis=(1, 3)) for picture in (by_rays, shared)]
    np.testing.assert_allclose(halves[0], halves[1], rtol=0.06)


def test_rays_by_tiles_are_as_many_as_leave_the_noise_of_shared_directions():
    technique, rate = environment_light.EnvironmentLight(), Rate(4)
    technique._rays_for_direction = 0.2
    assert technique._needed(rate) == 4.0
    technique._rays_for_direction = 0.01
    assert technique._needed(rate) == 1.0


@pytest.mark.parametrize("turn", [0.0, 1.0, 2.5, -2.0])
def test_the_camera_sees_the_texel_that_it_looks_at(stage, turn):
    """Azimuth grows from +X towards +Y, against the image's u."""
    direction, _ = directions(32, 64)
    azimuth = np.arctan2(direction[..., 1], direction[..., 0])
    sky(stage, np.stack([2 + np.cos(azimuth), 2 + np.sin(azimuth), 0 * azimuth], axis=-1))
    stage.camera((0, 0, 0), (np.pi / 2, 0, turn - np.pi / 2), angle=0.05)
    seen = stage.render(size=(8, 8))["environment"].mean(axis=(0, 1))
    assert seen == pytest.approx((2 + np.cos(turn), 2 + np.sin(turn), 0), abs=0.02)


def test_directions_that_are_not_guided_are_the_same_whatever_the_camera_sees(stage):
    """Those of bounced light, in the open: guided by what the camera's places see they would move with it."""
    stage.floor()
    stage.world((0.25, 0.5, 1.0))
    stage.camera_above()
    stage.render(size=(8, 8), bounces=1)
    world = stage.renderer.frame.environment
    numbers = np.random.default_rng(1).random((2, 64))
    plain = world.draw(*numbers, guided=False)
    for half in (slice(0, environment.GUIDE_ROWS // 2), slice(environment.GUIDE_ROWS // 2, None)):
        seen = np.zeros((environment.GUIDE_ROWS, environment.GUIDE_COLUMNS))
        seen[half] = 1.0
        world.guide(seen, seen)
        assert world.open_share == pytest.approx(0.5, abs=0.02)
        assert all(np.array_equal(one, other) for one, other in zip(world.draw(*numbers, guided=False), plain))
        assert not np.allclose(world.draw(*numbers)[0], plain[0])
    world.guide(None)
    assert np.array_equal(world.draw(*numbers)[0], plain[0]) and world.open_share == 1.0


def test_maps_of_drafts_are_not_as_coarse_as_their_pixels():
    """A draft of 40 x 30 pixels had maps of 64 texels: lit squares stood in the crease of a backdrop in the shadow."""
    for drawn, side in ((Settings(), 64), (Settings().as_draft(), environment_light.LEAST_IN_DRAFTS)):
        frame = SimpleNamespace(size=(40, 30), settings=drawn)
        assert environment_light.EnvironmentLight()._resolution(frame) == side
