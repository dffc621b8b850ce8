"""Points of the film in all pixels whose filter covers them: the filtered picture, with less noise, up to the rim."""

from types import SimpleNamespace

import numpy as np
import pytest

from addon.compare.passes import light_paths
from addon.film import filter as film_filter
from addon.gfx import images, passes
from addon.scene.view import blackman_harris, blackman_harris_offset

SPAN = 4.0


@pytest.mark.parametrize("width", [0.01, 0.4, 0.7, 1.0, 1.5, 2.0, 2.5, 3.0, 10.0])
def test_weights_of_a_point_sum_to_one_and_make_the_filter(width):
    """Over all places, what a pixel gets from points at a distance is the filter there."""
    edges = np.linspace(-width, width, 21)
    got = np.zeros(20)
    count = 4000
    for u in (np.arange(count) + 0.5) / count:
        place = blackman_harris_offset(u, width)
        pixel, weights = film_filter.taps(place, width)
        assert weights.sum() == pytest.approx(1.0) and (weights >= -1e-6).all()
        around = np.arange(len(weights)) - len(weights) // 2 + place - pixel
        got += np.histogram(np.clip(around, -width, width), edges, weights=weights)[0] / count
    fine = np.linspace(-1, 1, 20 * 200 + 1)
    density = blackman_harris((fine[1:] + fine[:-1]) / 2)
    np.testing.assert_allclose(got, density.reshape(20, -1).sum(axis=1) / density.sum(), atol=2e-3)


def test_pixels_share_points_where_their_filters_overlap():
    assert [film_filter.reach(width) for width in (0.01, 0.5, 0.51, 1.5, 1.51, 2.5, 2.6)] == [0, 0, 1, 1, 2, 2, 0]


@pytest.mark.parametrize("width", [0.4, 1.0, 1.5, 2.0, 2.5])
@pytest.mark.parametrize("place", [(0.3, -0.2), (-0.45, 0.9), (-1.2, 1.4)], ids=str)
def test_one_point_goes_to_each_pixel_as_by_numpy(gpu_context, width, place):
    """Of an image whose pixels all differ: weights of `taps`, and the own point alone within twice the reach of a rim,
    along the axis that leads there."""
    place = tuple(np.clip(place, -width, width))
    seen = np.random.default_rng(3).random((9, 13, 4)).astype(np.float32)
    frame = SimpleNamespace(snapshot=SimpleNamespace(film=SimpleNamespace(filter_width=width)))
    constants = film_filter.place_constants(frame, place, 0.25)
    pixels = film_filter.reach(width)
    with images.borrowed(13, 9, "RGBA32F") as target:
        passes.each_pixel(
            film_filter.program(1, pixels), target, textures={"seen_0": images.upload(seen)}, constants=constants
        )
        found = images.read(target.colors[0])

    def along(count, at):  # (count, count): what each pixel takes of each point
        own, weights = film_filter.taps(at, width)
        takes = np.eye(count)
        for k in range(2 * pixels, count - 2 * pixels):
            takes[k] = 0.0
            takes[k, k - pixels - own : k + pixels - own + 1] = weights
        return takes

    across, up = (along(count, at) for count, at in zip((13, 9), place))
    np.testing.assert_allclose(found, 0.25 * np.einsum("yj,xi,jic->yxc", up, across, seen), rtol=2e-5, atol=1e-6)


def test_media_dim_a_point_and_count_as_cover_of_the_world(gpu_context):
    """Colours times what is let through; alpha, of the image that holds the world, as of a layer over it."""
    seen, through = np.random.default_rng(4).random((2, 3, 5, 4)).astype(np.float32)
    frame = SimpleNamespace(snapshot=SimpleNamespace(film=SimpleNamespace(filter_width=0.4)))
    kinds = (film_filter.CLEAR, film_filter.DIMMED, film_filter.COVERED)
    drawn = [images.create(5, 3, "RGBA32F") for _ in kinds]
    passes.each_pixel(
        film_filter.program(3, 0, kinds), images.Target(tuple(drawn)),
        textures={f"seen_{k}": images.upload(seen) for k in range(3)} | {"through": images.upload(through)},
        constants=film_filter.place_constants(frame, (0.0, 0.0), 1.0),
    )  # fmt: skip
    clear, dimmed, covered = map(images.read, drawn)
    passing = np.concatenate([through[..., :3], np.ones((3, 5, 1))], axis=2)
    np.testing.assert_allclose(clear, seen, rtol=1e-6)
    np.testing.assert_allclose(dimmed, seen * passing, rtol=1e-5)
    np.testing.assert_allclose(covered[..., :3], dimmed[..., :3], rtol=1e-5)
    hidden = 1 - through[..., :3].mean(axis=2)
    np.testing.assert_allclose(covered[..., 3], seen[..., 3] + hidden * (1 - seen[..., 3]), rtol=1e-5)


def edge(stage, width):
    """A glowing half of the plane, whose slanting edge crosses the picture."""
    glow = stage.material("ShaderNodeEmission", Color=(1, 1, 1, 1), Strength=1.0)
    stage.mesh([(-9, -9, 0), (-0.9, -9, 0), (0.9, 9, 0), (-9, 9, 0)], [(0, 1, 2, 3)], material=glow)
    stage.camera_above(SPAN)
    stage.scene.render.filter_size = width


@pytest.mark.parametrize("width", [0.4, 1.0, 1.5, 2.0, 3.0])
@pytest.mark.parametrize("size", [(16, 12), (5, 4)], ids=str)
def test_an_edge_has_its_coverage_up_to_the_rim(stage, width, size):
    edge(stage, width)
    seen = stage.render(1024, size)["emission"][..., 0].astype(np.float64)
    pixel = SPAN / max(size)
    places = np.linspace(-1, 1, 129)
    weights = blackman_harris(places)
    weights = np.outer(weights, weights) / weights.sum() ** 2
    x, y = (pixel * (np.arange(n) + 0.5 - n / 2) for n in size)
    across = x[:, None] + pixel * width * places  # (pixels, places of the filter)
    up = y[:, None] + pixel * width * places
    covered = across[None, :, None, :] < 0.1 * up[:, None, :, None]
    truth = (covered * weights).sum(axis=(2, 3))
    np.testing.assert_allclose(seen, truth, atol=0.012)
    assert abs(seen.mean() - truth.mean()) < 2e-3


@pytest.mark.parametrize("samples", [1, 3, 16])
def test_what_is_even_stays_even(stage, samples):
    glow = stage.material("ShaderNodeEmission", Color=(1, 0.5, 0.25, 1), Strength=3.0)
    stage.rectangle((-9, -9), (9, 9), material=glow)
    stage.camera_above(SPAN)
    stage.scene.render.filter_size = 1.5
    seen = stage.render(samples, (12, 9))["emission"]
    np.testing.assert_allclose(seen, np.broadcast_to([3.0, 1.5, 0.75], seen.shape), rtol=1e-5)


@pytest.mark.slow
def test_the_dark_side_of_edges_has_half_the_error_at_most(stage, monkeypatch):
    """Most of the relative error of points that each count in full, since few lie in the filter's tails."""
    edge(stage, 1.5)
    stage.world((1, 1, 1), 0.01)

    def dark(samples, seed=0):
        images = stage.render(samples, (32, 32), seed=seed)
        return (images["emission"] + images["environment"][..., :3])[2:-2, 2:-2].astype(np.float64)

    truth = dark(1024)
    shared = np.mean([((dark(16, seed) - truth) / truth) ** 2 for seed in range(1, 5)])
    monkeypatch.setattr(film_filter, "reach", lambda width: 0)
    own = np.mean([((dark(16, seed) - truth) / truth) ** 2 for seed in range(5, 9)])
    assert shared < 0.5 * own


@pytest.mark.slow
def test_noise_that_pixels_have_by_themselves_is_halved(stage, monkeypatch):
    """Points on a lamp that each pixel draws, in a penumbra as wide as the picture."""
    stage.floor(material=stage.diffuse(0.8))
    stage.blocker((-9, -9), (0, 9), 1.0)
    stage.light("AREA", (0, 0, 2), energy=30.0, size=2.0)
    stage.camera_above(1.0)
    stage.scene.render.filter_size = 1.5
    stage.scene.candela.accumulated_maps_by = "RAYS"

    def direct(samples, seed=0):
        light = light_paths(stage.render(samples, (32, 32), seed=seed))["diffuse_direct"]
        return light[2:-2, 2:-2, :3].astype(np.float64)

    truth = direct(1024)
    shared = np.mean([(direct(4, seed) - truth) ** 2 for seed in (1, 2)])
    monkeypatch.setattr(film_filter, "reach", lambda width: 0)
    own = np.mean([(direct(4, seed) - truth) ** 2 for seed in (3, 4)])
    assert shared < 0.5 * own


def test_other_pixels_points_count_in_every_pass(stage):
    """Passes of one sample are filtered alike, so that light by colour stays the light."""
    stage.floor(material=stage.diffuse(0.8))
    stage.rectangle((-0.5, -0.5), (0.5, 0.5), 0.01, material=stage.diffuse(0.1))
    stage.light("SUN", energy=3.0)
    stage.camera_above(SPAN)
    stage.scene.render.filter_size = 1.5
    images = stage.render(4, (24, 24))
    lit = light_paths(images)["diffuse_direct"][..., 0] / images["diffuse_color"][..., 0]
    inside = lit[4:-4, 4:-4]
    assert inside.max() == pytest.approx(inside.min(), rel=0.02)
