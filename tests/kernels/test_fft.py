"""Fourier transforms of images against numpy's, and convolution against sums written out."""

import numpy as np
import pytest

from addon.gfx import images
from addon.kernels import fft

SIZES = [(1, 1), (1, 64), (64, 1), (2, 8), (16, 4), (64, 64), (48, 32), (96, 128), (512, 256), (1024, 64)]


def uploaded(pixels, image_format="RGBA32F"):
    return images.Target((images.upload(pixels.astype(np.float32), image_format),))


def empty_like(target):
    return images.Target((images.create(*target.size, target.colors[0].format),))


def transformed(pixels, image_format="RGBA32F", **options):
    field = uploaded(pixels, image_format)
    result, _ = fft.transform(field, empty_like(field), **options)
    return images.read(result.colors[0]).astype(np.float64)


def noise(width, height, channels=4, seed=1):
    return np.random.default_rng(seed).normal(size=(height, width, channels)).astype(np.float32)


def relative_error(found, expected):
    return np.sqrt(np.mean(np.abs(found - expected) ** 2) / np.mean(np.abs(expected) ** 2))


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("inverse", [False, True])
def test_two_complex_images_are_transformed_as_by_numpy(gpu_context, size, inverse):
    pixels = noise(*size)
    found = transformed(pixels, inverse=inverse)
    for k in (0, 2):
        given = pixels[..., k] + 1j * pixels[..., k + 1].astype(np.float64)
        expected = (np.fft.ifft2 if inverse else np.fft.fft2)(given)
        assert relative_error(found[..., k] + 1j * found[..., k + 1], expected) < 1e-6


def test_one_complex_image_is_transformed_as_by_numpy(gpu_context):
    pixels = noise(256, 128, 2)
    found = transformed(pixels, "RG32F")
    expected = np.fft.fft2(pixels[..., 0] + 1j * pixels[..., 1].astype(np.float64))
    assert relative_error(found[..., 0] + 1j * found[..., 1], expected) < 1e-6


def test_there_and_back_is_the_image_itself(gpu_context):
    field = uploaded(noise(128, 192))
    before = images.read(field.colors[0])
    field, spare = fft.transform(field, empty_like(field))
    field, _ = fft.transform(field, spare, inverse=True)
    assert np.abs(images.read(field.colors[0]) - before).max() < 1e-5


def test_energy_is_kept_as_parseval_says(gpu_context):
    pixels = noise(256, 256)
    energy = (transformed(pixels) ** 2).sum() / (256 * 256)
    assert energy == pytest.approx((pixels.astype(np.float64) ** 2).sum(), rel=1e-5)


@pytest.mark.parametrize("extent", [(64, 40), (13, 64), (1, 1), (33, 7)])
def test_what_lies_beyond_the_extent_counts_as_zero_and_is_not_needed_back(gpu_context, extent):
    inside = np.s_[: extent[1], : extent[0]]
    pixels, clean = noise(64, 64), np.zeros((64, 64, 4), np.float32)
    clean[inside] = pixels[inside]
    found = transformed(pixels, extent=extent)
    np.testing.assert_allclose(found, transformed(clean), atol=1e-3)
    back = transformed(found, inverse=True, extent=extent)
    np.testing.assert_allclose(back[inside], pixels[inside], atol=1e-4)


def test_a_product_of_transforms_convolves_each_of_four_channels_with_its_own_kernel(gpu_context):
    pixels, kernel = noise(64, 32, seed=2), noise(64, 32, seed=3)
    field, factors = uploaded(pixels), uploaded(kernel)
    field, spare = fft.transform(field, empty_like(field))
    factors, _ = fft.transform(factors, empty_like(factors))
    fft.multiply(field.colors[0], factors.colors[0], spare)
    result, _ = fft.transform(spare, field, inverse=True)
    found = images.read(result.colors[0])
    expected = np.fft.ifft2(np.fft.fft2(pixels, axes=(0, 1)) * np.fft.fft2(kernel, axes=(0, 1)), axes=(0, 1)).real
    assert relative_error(found, expected) < 1e-5


def test_sides_fit_and_factor():
    assert [fft.fitting_side(n) for n in (1, 2, 3, 4, 5, 6, 7, 9, 13, 1025, 1537)] == [
        1, 2, 3, 4, 6, 6, 8, 12, 16, 1536, 2048,
    ]  # fmt: skip
    for side in (1, 2, 3, 4, 8, 16, 32, 48, 1024, 1536, 2048):
        assert np.prod(fft.factors(side), initial=1) == side
    with pytest.raises(ValueError, match="20 texels"):
        fft.factors(20)
