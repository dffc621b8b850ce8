"""Light of the world with what the picture shows before it, against skies and blockers in closed form."""

import bpy
import numpy as np
import pytest

from addon.frame.picture import ORTHOGRAPHIC_DISTANCE
from addon.techniques.directional_occlusion import blurred
from tests.techniques.conftest import places
from tests.techniques.test_environment_light import sky

SIZE = (48, 48)


@pytest.fixture
def render(stage):
    """Direct diffuse radiance, which on a white surface is the mean of the sky it sees."""

    def render(samples=16, **params):
        settings = stage.scene.candela
        settings.slot_environment = "directional_occlusion"
        for name, value in params.items():
            setattr(settings, f"directional_occlusion_{name}", value)
        return stage.render(samples, SIZE)["diffuse_direct"].astype(float)

    return render


def ball(stage, radius=0.5, rings=24):
    """A white sphere that lies on the ground at the origin."""
    bpy.ops.mesh.primitive_uv_sphere_add(segments=2 * rings, ring_count=rings, radius=radius, location=(0, 0, radius))
    bpy.context.object.data.materials.append(stage.diffuse(1.0))


@pytest.mark.parametrize("visibility", ["BITS", "POINTS"])
@pytest.mark.parametrize("tilt", [0.0, 0.7, 1.3])
def test_an_open_plane_has_all_the_light_of_the_sky_at_every_tilt_and_in_every_sample(stage, render, tilt, visibility):
    stage.floor(200)
    stage.world((0.2, 0.5, 1.0), strength=3.0)
    stage.camera((0, -5 * np.sin(tilt), 5 * np.cos(tilt)), (tilt, 0, 0))
    light = render(samples=1, visibility=visibility)
    floor = light[light[..., 2] > 0]
    np.testing.assert_allclose(floor, np.broadcast_to([0.6, 1.5, 3.0], floor.shape), rtol=1e-3)


@pytest.mark.parametrize("elevation", [30, 45, 60])
def test_a_wall_hides_its_form_factor_of_the_sky(stage, render, elevation):
    """Height 1 at distance d hides (1 - cos a) / 2 of the sky, tan a = 1 / d; a hundredth of it is off the screen."""
    elevation = np.radians(elevation)
    stage.world()
    stage.rectangle((0, -20), (20, 20), material=stage.diffuse(1.0))
    stage.mesh([(0, -20, 0), (0, 20, 0), (0, 20, 1), (0, -20, 1)], [(0, 1, 2, 3)], material=stage.diffuse(1.0))
    place = (5 * np.cos(elevation) + 0.5, 0, 5 * np.sin(elevation))
    camera = stage.camera(place, (np.pi / 2 - elevation, 0, np.pi / 2))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 4.0
    light = render(radius=100.0, rays=False)[:, 20:28].mean(axis=(1, 2))
    distance = 0.5 - ((np.arange(SIZE[1]) + 0.5) / SIZE[1] - 0.5) * 4 / np.sin(elevation)
    floor = (distance > 0.05) & (distance < 1.9)
    expected = 0.5 + 0.5 * distance[floor] / np.hypot(1.0, distance[floor])
    np.testing.assert_allclose(light[floor], expected, rtol=0.05)
    assert light[floor].mean() == pytest.approx(expected.mean(), rel=0.02)


def test_points_miss_a_wall_with_the_chance_that_the_thesis_gives_them(stage, render):
    """A blocker at the share t of the radius is met by 1 - t of the points: 0.69 and 0.95 are left at 0.1 and 0.5."""
    stage.world()
    stage.rectangle((0, -20), (20, 20), material=stage.diffuse(1.0))
    stage.mesh([(0, -20, 0), (0, 20, 0), (0, 20, 20), (0, -20, 20)], [(0, 1, 2, 3)], material=stage.diffuse(1.0))
    camera = stage.camera((14, 0, 14), (np.pi / 4, 0, np.pi / 2))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 4.0
    light = render(visibility="POINTS", radius=0.6 / (ORTHOGRAPHIC_DISTANCE * 4.0))[:, 16:32].mean(axis=(1, 2))
    distance = -((np.arange(SIZE[1]) + 0.5) / SIZE[1] - 0.5) * 4 / np.sin(np.pi / 4) / 0.6
    share, left = [0.02, 0.1, 0.25, 0.5, 0.75], [0.559, 0.691, 0.832, 0.948, 0.992]
    floor = (distance > 0.02) & (distance < 0.75)
    ahead = light[floor] - np.interp(distance[floor], share, left)
    assert (ahead > -0.03).all()
    assert (ahead < 0.15).all(), "what is near the border of the half ball fades"


def test_a_sphere_hides_the_sky_above_the_floor_it_lies_on(stage, render):
    """(R / d)^3 of it at distance d from the centre. From above its lower half is guessed by `thickness`."""
    stage.world()
    stage.floor(30)
    ball(stage)
    stage.camera_above(4.0)
    x, y = places(SIZE)
    beside = np.hypot(x, y) > 0.6
    expected = 1 - (0.25 / (x * x + y * y + 0.25)) ** 1.5
    for thickness, bias in ((0.0, 0.06), (0.02, 0.02), (0.2, -0.04)):
        error = (render(radius=100.0, thickness=thickness, rays=False).mean(axis=2) - expected)[
            beside & (np.hypot(x, y) < 1)
        ]
        assert error.mean() == pytest.approx(bias, abs=0.03), thickness


def test_rays_find_what_the_screen_does_not_show(stage, render):
    """A roof that the camera does not see hides its form factor of the sky; a sphere its lower half too."""
    stage.world()
    stage.floor(300)
    ball(stage)
    stage.camera_above(4.0)
    x, y = places(SIZE)
    distance = np.hypot(x, y)
    expected = 1 - (0.25 / (x * x + y * y + 0.25)) ** 1.5
    beside = (distance > 0.6) & (distance < 1)
    assert (render().mean(axis=2) - expected)[beside].mean() == pytest.approx(0.0, abs=0.02)
    stage.blocker((-300, -300), (300, 300), 5.0)
    assert render().mean() < 0.005


def test_shade_lies_opposite_to_where_the_light_is_and_has_the_others_colour(stage, render):
    """Red light comes from +X and blue from -X, in equal parts: beside a sphere one of both is missing."""
    pixels = np.zeros((16, 32, 3))
    pixels[8:, 8:24] = (2, 0, 0)  # azimuths around +X
    pixels[8:, :8] = pixels[8:, 24:] = (0, 0, 2)
    sky(stage, pixels)
    stage.floor(30)
    ball(stage)
    stage.camera_above(4.0)
    light = render(radius=100.0)
    x, y = places(SIZE)
    right, left = ((np.abs(y) < 0.3) & (side * x > 0.55) & (side * x < 0.9) for side in (1, -1))
    open_floor = np.hypot(x, y) > 1.8
    red, blue = light[..., 0], light[..., 2]
    assert red[open_floor].mean() == pytest.approx(1.0, abs=0.05)
    assert red[left].mean() < 0.75 * red[right].mean()
    assert blue[right].mean() < 0.75 * blue[left].mean()
    assert red[right].mean() > 0.9
    assert blue[left].mean() > 0.9


def test_what_is_farther_than_the_radius_hides_nothing(stage, render):
    stage.world()
    stage.floor(30)
    ball(stage)
    stage.camera_above(4.0)
    x, y = places(SIZE)
    assert render(radius=0.01, rays=False)[np.hypot(x, y) > 0.7].min() > 0.99


def test_a_blurred_sky_has_the_same_power():
    pixels = np.random.default_rng(1).uniform(0, 1, (300, 700, 3)) ** 8
    edges = np.diff(np.sin((np.arange(301) / 300 - 0.5) * np.pi))[:, None, None]
    cells = blurred(pixels)
    assert cells.shape == (32, 64, 3)
    rows = np.add.reduceat(edges[:, 0, 0], np.arange(32) * 300 // 32)
    columns = np.diff([k * 700 // 64 for k in range(65)])
    power = (cells * rows[:, None, None] * columns[None, :, None]).sum(axis=(0, 1))
    np.testing.assert_allclose(power, (pixels * edges).sum(axis=(0, 1)), rtol=1e-5)


def test_a_world_without_light_for_diffuse_surfaces_is_skipped_with_a_reason(stage, render):
    stage.floor()
    stage.camera_above()
    stage.light("POINT")
    render(samples=1)
    assert stage.ledger.row("directional_occlusion").reason == "the world is black"
    stage.world().cycles_visibility.diffuse = False
    render(samples=1)
    assert stage.ledger.row("directional_occlusion").reason == "the world is hidden from diffuse surfaces"
