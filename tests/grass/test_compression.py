"""Principal components of a tile's pictures."""

import itertools

import numpy as np
import pytest

from addon.grass import compression
from addon.grass import patch as patches
from addon.grass.directions import Rings


def pictures(places=300, count=21, seed=0):
    rng = np.random.default_rng(seed)
    smooth = rng.random((places, 5, 1)) * rng.random((1, 5, count)) ** 2
    return np.clip(
        smooth.sum(axis=1)[..., None] * np.array([0.1, 0.2, 0.05]) + 0.02 * rng.random((places, count, 3)), 0, 9
    )


def test_encoding_is_undone():
    light = pictures()
    white = float(light.max())
    assert np.abs(compression.decoded(compression.encoded(light, white), white) - light).max() < 1e-12


def test_as_many_components_as_pictures_give_the_pictures_back():
    data = pictures()[..., 0]
    assert np.abs(compression.components(data, data.shape[1]).pictures() - data).max() < 1e-6


def test_components_are_orthogonal_and_within_one():
    found = compression.components(pictures()[..., 1], 4)
    gram = found.parts.T @ found.parts
    assert np.abs(gram - np.diag(np.diag(gram))).max() < 1e-8 * gram.max()
    assert np.abs(found.parts).max() <= 1.0 + 1e-12


def test_squared_error_is_the_energy_of_the_components_left_out():
    data = pictures()[..., 0]
    off = data - data.mean(axis=1, keepdims=True)
    values = np.sort(np.linalg.eigvalsh(off.T @ off))[::-1]
    for count in (1, 3, 8):
        left = ((compression.components(data, count).pictures() - data) ** 2).sum()
        assert left == pytest.approx(values[count:].sum(), rel=1e-6)


def test_error_falls_with_components_and_the_mean_stays():
    light = pictures()
    found = [compression.compressed(light, k, 2) for k in (1, 2, 4, 8)]
    falling = [compression.errors(light, one)["rgb"] for one in found]
    assert all(a > b for a, b in itertools.pairwise(falling))
    for one in found:
        assert one.mean(axis=0) == pytest.approx(light.mean(axis=0), rel=1e-9)


def test_weights_move_error_to_pictures_that_count_less():
    data = pictures()[..., 0]
    weight = np.where(np.arange(21) < 10, 4.0, 1.0)
    plain, weighted = (compression.components(data, 4, one).pictures() for one in (1.0, weight))
    of = [((one - data) ** 2).sum(axis=0) for one in (plain, weighted)]
    assert of[1][:10].sum() < of[0][:10].sum() and of[1][10:].sum() > of[0][10:].sum()
    assert np.abs(compression.components(data, 21, weight).pictures() - data).max() < 1e-6


def test_nothing_negative_is_decoded():
    rng = np.random.default_rng(3)
    assert compression.decoded(rng.normal(size=(100, 3)), 1.0).min() >= 0.0


def test_a_plane_of_one_colour_needs_no_component():
    """A Lambertian plane of albedo a: a cos(theta) for every texel and view."""
    lights = np.cos(np.radians([0.0, 30.0, 70.0]))
    light = np.broadcast_to((0.3 * lights)[None, :, None], (50, 3, 3)).copy()
    found = compression.compressed(light, 1, 1, white=1.0)
    assert np.abs(found - light).max() < 1e-9


def test_contrast_gives_pictures_the_deviation_back_that_they_lost():
    """As pixels see them: decoded pictures, with their means set right, times the contrast deviate as the true ones."""
    rng, lights = np.random.default_rng(5), Rings((0.0, 50.0), (1, 6))
    texels, brightness = 16, rng.random((16, 16, 3)) ** 3
    waves = [rng.random((texels, texels, 1)) ** 4 for _ in range(lights.number)]
    true = np.stack([brightness * (0.05 + 3.0 * one) for one in waves])
    made = patches.compressed_patch(
        0.4, 0.1, Rings((0.0,), (1,)), lights, lambda view: true, np.zeros((1, texels, texels)), luma=1, chroma=1
    )
    seen = [patches._seen(one @ compression.LUMA).std(axis=(1, 2)) for one in (true, made.pictures(0)[:-1])]
    contrast = made.contrast[0, :-1]
    assert np.abs(made.ratio[0, :-1] - 1).max() > 0.1 and (contrast > 0.5).all() and (contrast < 3.0).all()
    np.testing.assert_allclose(seen[1] * contrast, seen[0], rtol=1e-4)
