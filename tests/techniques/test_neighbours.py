"""Single samples that are shown alone: neighbours lend each other light, not colour, and not across edges."""

from types import SimpleNamespace

import numpy as np
import pytest

from addon.compare.passes import light_paths
from addon.film.neighbours import FEW, means, shown_sum, smooth
from addon.frame.schedule import AT_REST, FINAL
from addon.frame.settings import Settings
from addon.gfx import images
from addon.gfx.struct import Block
from addon.scene.view import VIEW
from tests.techniques.conftest import places
from tests.techniques.test_instant_radiosity import corner

SIZE = 48
SPAN = 4.0


@pytest.fixture
def frame_of(gpu_context):
    """A sample of a plane two metres wide under an orthographic camera, with light on it, (H, W)."""

    def frame_of(reflected, albedo=0.5, height=0.0, samples=1, whole=True):
        x, y = places((SIZE, SIZE), SPAN)
        full = np.ones((SIZE, SIZE))
        layers = {
            "surface.position": [x, y, full * height, full],
            "surface.normal": [0 * x] * 4,  # octahedral: straight up
            "surface.diffuse": [full * albedo] * 4,
            "color.diffuse": [full * albedo] * 4,
            "radiance.light": [reflected] * 3 + [0 * x],
        }
        values = {name: np.zeros(4) if kind == "vec4" else 0 for name, (kind, _) in VIEW.fields.items()}
        values |= {"eye": (0, 0, 5, 1), "frame": (-SPAN / 2, SPAN / 2) * 2, "film": (SIZE, SIZE, 0.1, 100)}
        frame = SimpleNamespace(
            size=(SIZE, SIZE), is_first=True, samples_done=1,
            settings=Settings(samples, schedule=FINAL if whole else AT_REST),
            plan=SimpleNamespace(techniques=()), materials=SimpleNamespace(soft=False),
            images={name: images.upload(np.dstack(layer).astype(np.float32)) for name, layer in layers.items()},
            view_block=Block(VIEW, **values), count=lambda *counter: None,
        )  # fmt: skip
        frame.target = lambda name: images.Target((frame.images[name],))
        frame.held = SimpleNamespace(to_show=lambda name: frame.images[name])
        return frame

    return frame_of


@pytest.fixture
def filtered(frame_of):
    """The light of such a sample after the filter."""

    def filtered(reflected, **options):
        frame = frame_of(reflected, **options)
        smooth(frame, None, "radiance.light")
        return images.read(frame.images["radiance.light"])[..., 0]

    return filtered


@pytest.fixture
def grain():
    return np.random.default_rng(1).exponential(1.0, (SIZE, SIZE))


def test_grain_on_a_plane_falls_as_by_two_hundred_samples(filtered, grain):
    inner = filtered(grain)[8:-8, 8:-8]
    assert inner.mean() == pytest.approx(grain.mean(), rel=0.05)
    assert inner.std() < 2 * grain.std() / 16


def test_means_of_light_alone_leave_the_colour_of_surfaces_out(frame_of, filtered, grain):
    """What history joins: the wider mean is that of a sample by itself, before the surface reflects it."""
    frame = frame_of(grain, albedo=0.5)
    near, far = (images.Target((images.create(SIZE, SIZE, "RGBA32F"),)) for _ in range(2))
    for _ in means(frame, frame.images["radiance.light"], near, far):
        pass
    few, many = (images.read(one.colors[0])[8:-8, 8:-8, 0] for one in (near, far))
    np.testing.assert_allclose(many, filtered(grain, albedo=0.5)[8:-8, 8:-8], rtol=1e-4)
    assert few.std() == pytest.approx(grain.std() / 4, rel=0.2) and many.std() < few.std() / 2


def test_textures_stay_to_the_pixel(filtered, grain):
    albedo = np.where(np.indices((SIZE, SIZE)).sum(axis=0) % 2, 0.9, 0.1)
    even = filtered(np.ones((SIZE, SIZE)))
    np.testing.assert_allclose(filtered(albedo, albedo=albedo), even * albedo, rtol=1e-4)


def test_light_does_not_cross_a_step_in_depth(filtered):
    x, _ = places((SIZE, SIZE), SPAN)
    light = np.where(x > 0, 1.0, 0.1)
    np.testing.assert_allclose(filtered(light, height=np.where(x > 0, 1.0, 0.0)), light, rtol=1e-4)


def test_the_border_of_a_shade_widens_by_a_few_pixels_only(filtered):
    x, _ = places((SIZE, SIZE), SPAN)
    light = np.where(x > 0, 1.0, 0.1)
    error = np.abs(filtered(light) - light)
    assert error[np.abs(x) > 10 * SPAN / SIZE].max() < 1e-4
    assert error.mean() < 0.03


def test_a_lone_pixel_takes_the_light_of_what_is_near(filtered):
    """A wire's pixel has no neighbour on its surface; what a single ray brought it stands out like a spark."""
    light = np.ones((SIZE, SIZE))
    light[20, 20] = 100.0
    height = np.zeros((SIZE, SIZE))
    height[20, 20] = 0.3
    assert filtered(light, height=height)[20, 20] < 10


def test_samples_that_are_averaged_are_left_alone(filtered, grain):
    np.testing.assert_array_equal(filtered(grain, samples=2), grain.astype(np.float32))


def test_a_viewport_shows_its_first_samples_filtered_and_keeps_their_sums(frame_of, filtered, grain):
    frame = frame_of(grain, samples=16, whole=False)
    with shown_sum(frame, "light") as shown:
        np.testing.assert_allclose(images.read(shown)[..., 0], filtered(grain), rtol=1e-5)
    np.testing.assert_array_equal(images.read(frame.images["radiance.light"])[..., 0], grain.astype(np.float32))
    frame.samples_done = FEW
    with shown_sum(frame, "light") as shown:
        assert shown is frame.images["radiance.light"]


@pytest.mark.slow
@pytest.mark.parametrize("technique", ["instant_radiosity", "ssdo"])
def test_a_picture_of_one_sample_is_filtered_and_the_ledger_says_so(stage, technique):
    corner(stage)
    stage.scene.candela.slot_indirect = technique
    one = stage.render(1, (24, 24), bounces=2)["diffuse_indirect"]
    assert stage.ledger.row(technique).counters["filtered samples"] >= 1
    many = stage.render(16, (24, 24), bounces=2)["diffuse_indirect"]
    assert "filtered samples" not in stage.ledger.row(technique).counters
    assert one.mean() == pytest.approx(many.mean(), rel=0.2)


@pytest.mark.slow
def test_a_picture_of_one_sample_shows_indirect_light_on_stripes_as_smooth_as_many_samples_do(stage):
    """Slanting stripes, a pixel and a half wide, before a wall in the sun: one point per pixel would tear them."""
    stage.scene.render.filter_size = 1.5
    dark, bright = stage.diffuse(0.1), stage.diffuse(0.9)
    for k in range(-24, 24):
        x = k / 8
        stage.mesh(
            [(x, -2, 0), (x + 1 / 8, -2, 0), (x + 9 / 8, 2, 0), (x + 1, 2, 0)], [(0, 1, 2, 3)],
            material=(dark, bright)[k % 2],
        )  # fmt: skip
    wall = stage.mesh([(-3, 1, 0), (3, 1, 0), (3, 1, 2), (-3, 1, 2)], [(0, 1, 2, 3)], material=stage.diffuse(0.8))
    wall.visible_camera = False
    stage.light("SUN", turn=(0.9, 0, 0), energy=3.0)
    stage.camera_above(2.0)
    stage.scene.candela.slot_indirect = "multires_radiosity"
    many, one = (stage.render(samples, (24, 24), bounces=1) for samples in (64, 1))
    stage.scene.candela.film_points = 1
    torn = stage.render(1, (24, 24), bounces=0)["diffuse_color"] / many["diffuse_color"]
    light = [light_paths(picture)["diffuse_indirect"][..., :3] for picture in (one, many)]
    smooth_light = light[0] / light[1]
    assert smooth_light.mean() == pytest.approx(1.0, abs=0.15)
    assert (smooth_light / smooth_light.mean()).std() < 0.5 * torn.std()
    assert (one["diffuse_color"] / many["diffuse_color"]).std() < 0.5 * torn.std()  # what the passes multiply by


@pytest.mark.slow
def test_light_of_what_is_thinner_than_a_pixel_is_in_the_passes_of_one_sample(stage):
    """Wires that most pixels' own points miss: the product of colour and light has what the picture has."""
    stage.scene.render.filter_size = 1.5
    for k in range(-12, 13):
        x = k / 6
        corners = [(x, -2, 0), (x + 0.03, -2, 0), (x + 1.03, 2, 0), (x + 1, 2, 0)]
        stage.mesh(corners, [(0, 1, 2, 3)], material=stage.diffuse(0.8))
    wall = stage.mesh([(-3, 1, 0), (3, 1, 0), (3, 1, 2), (-3, 1, 2)], [(0, 1, 2, 3)], material=stage.diffuse(0.8))
    wall.visible_camera = False
    stage.light("SUN", turn=(0.9, 0, 0), energy=3.0)
    stage.camera_above(2.0)
    stage.scene.candela.slot_indirect = "multires_radiosity"
    one, many = (light_paths(stage.render(n, (24, 24), bounces=1))["diffuse_indirect"][..., :3] for n in (1, 64))
    assert (one.mean(axis=2) > 0).mean() > 0.7 * (many.mean(axis=2) > 0).mean()
    assert one.mean() == pytest.approx(many.mean(), rel=0.25)
