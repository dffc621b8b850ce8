"""The world as area lights: all of its energy, as wide as it is, and shadows from one map of each."""

import numpy as np
import pytest

from addon.sources import area_fit
from tests.techniques.conftest import places

IDENTITY = np.eye(3)


def gradient_with_sun():
    """A sky that brightens towards the zenith over dark ground, with a sun in one pixel."""
    rise = np.linspace(-1, 1, 64)[:, None, None]
    pixels = np.where(rise > 0, 0.5 + rise, 0.1) * np.array([0.6, 0.8, 1.0]) * np.ones((64, 128, 1))
    pixels[50, 40] = 4000.0
    return pixels


@pytest.mark.parametrize("budget", [30, 45, 60])
def test_the_lights_hold_all_the_energy_of_the_map(budget):
    pixels = gradient_with_sun()
    edges = np.sin((np.arange(65) / 64 - 0.5) * np.pi)
    expected = (pixels.sum(axis=1) * np.diff(edges)[:, None]).sum(axis=0) * 2 * np.pi / 128
    lights = area_fit.fit(area_fit.cube_energy(pixels, IDENTITY), budget)
    assert len(lights) <= budget
    assert sum(light.energy for light in lights) == pytest.approx(expected, rel=1e-5)


def test_an_even_world_lights_all_sides_alike():
    lights = area_fit.fit(area_fit.cube_energy(np.ones((1, 1, 3)), IDENTITY), 60)
    normals = np.random.default_rng(1).normal(size=(50, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    irradiance = [sum(light.energy[0] * max(n @ light.direction, 0) for light in lights) for n in normals]
    assert np.array(irradiance) == pytest.approx(np.pi, rel=0.05)


def test_a_sun_becomes_one_light_of_its_own_size():
    pixels = gradient_with_sun()
    solid_angle = np.diff(np.sin((np.array([50, 51]) / 64 - 0.5) * np.pi))[0] * 2 * np.pi / 128
    brightest = max(area_fit.fit(area_fit.cube_energy(pixels, IDENTITY), 45), key=lambda light: light.energy[0])
    azimuth, height = (0.5 - 40.5 / 128) * 2 * np.pi, (50.5 / 64 - 0.5) * np.pi
    towards = [np.cos(height) * np.cos(azimuth), np.cos(height) * np.sin(azimuth), np.sin(height)]
    assert brightest.direction @ towards > np.cos(np.radians(1.5))
    assert brightest.solid_angle == pytest.approx(solid_angle, rel=0.25)


def test_turning_world_and_lights_is_the_same():
    """By a quarter about the vertical, which maps the cube onto itself."""
    quarter = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # world to map
    still, turned = (area_fit.fit(area_fit.cube_energy(gradient_with_sun(), m), 45) for m in (IDENTITY, quarter))
    assert len(still) == len(turned)
    brightest = [max(lights, key=lambda light: light.energy[0]) for lights in (still, turned)]
    assert quarter @ brightest[1].direction == pytest.approx(brightest[0].direction, abs=1e-6)


@pytest.fixture
def plain(stage):
    stage.floor()
    stage.camera_above(4.0)
    stage.world()
    stage.scene.candela.slot_environment = "environment_area_lights"
    return stage


def irradiance(stage, size=(16, 16), seed=0):
    return stage.render(1, size, seed)["diffuse_direct"][..., 0].astype(float) * np.pi


def test_an_open_floor_gets_pi_from_a_white_world(plain):
    plain.blocker((30, 30), (31, 31), 0.5)
    assert irradiance(plain) == pytest.approx(np.pi, rel=0.05)


def test_a_disc_above_the_floor_hides_its_part_of_the_sky(plain):
    """On the axis of a disc of radius r at height h the even sky loses r^2 / (r^2 + h^2)."""
    turn = np.linspace(0, 2 * np.pi, 33)[:-1]
    ring = [(0.8 * np.cos(t), 0.8 * np.sin(t), 0.5) for t in turn]
    plain.mesh(ring, [tuple(range(32))]).visible_camera = False
    found = irradiance(plain, (32, 32)) / np.pi
    x, y = places((32, 32))
    centre = np.hypot(x, y) < 0.15
    assert found[centre].mean() == pytest.approx(1 - 0.64 / (0.64 + 0.25), abs=0.05)
    assert found[np.hypot(x, y) > 1.9].mean() > 0.85


def test_the_fit_is_kept_while_the_world_stays(plain):
    plain.world(strength=0.7)
    irradiance(plain)
    assert plain.ledger.row("environment_area_lights").counters["fits"] == 1
    plain.rectangle((-1, -1), (0, 0), z=0.4)
    irradiance(plain)
    assert "fits" not in plain.ledger.row("environment_area_lights").counters


def test_auto_leaves_it_out_and_says_why(plain):
    plain.scene.candela.slot_environment = "AUTO"
    plain.render(1, (8, 8))
    row = plain.ledger.row("environment_area_lights")
    assert (row.state, "rooms" in row.reason) == ("skipped", True)


def test_a_large_map_is_averaged_by_solid_angle():
    """1,024 rows become 512: of two rows that become one, each counts by its width in the sine of latitude."""
    rows = np.random.default_rng(1).random((1024, 1, 3))
    found = area_fit._resized(np.repeat(rows, 2 * area_fit.LEAST_ROWS, axis=1))
    assert found.shape == (512, 256, 3)
    width = np.diff(np.sin((np.arange(1025) / 1024 - 0.5) * np.pi))[:, None]
    pairs = (rows[:, 0] * width).reshape(512, 2, 3).sum(axis=1) / width.reshape(512, 2, 1).sum(axis=1)
    assert found[:, 0] == pytest.approx(pairs, rel=1e-9)
    assert found[:, 200] == pytest.approx(pairs, rel=1e-9)
