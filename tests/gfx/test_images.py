"""Images: what is uploaded comes back, sizes are checked, and the pool hands out what was given back."""

import numpy as np
import pytest

from addon.gfx import images

FORMATS = [("RGBA32F", 4), ("RGBA16F", 4), ("RG32F", 2), ("R32F", 1), ("R16F", 1)]


@pytest.mark.parametrize("size", [(1, 1), (7, 3), (64, 33)])
@pytest.mark.parametrize(("image_format", "channels"), FORMATS)
def test_an_image_comes_back_as_it_was_uploaded(gpu_context, image_format, channels, size):
    width, height = size
    pixels = np.random.default_rng(1).uniform(-100, 100, (height, width, channels)).astype(np.float32)
    if "16F" in image_format:
        pixels = pixels.astype(np.float16).astype(np.float32)  # what the format can hold
    image = images.upload(pixels, image_format)
    assert image.size == size
    np.testing.assert_array_equal(images.read(image), pixels)


def test_a_half_float_image_clamps_instead_of_overflowing(gpu_context):
    image = images.upload(np.array([[1e30, -1e30]], np.float32), "R16F")
    np.testing.assert_array_equal(images.read(image).ravel(), [65504.0, -65504.0])


def test_full_floats_keep_what_half_floats_cannot(gpu_context):
    pixels = np.array([[1e30, -1e-30, 16777217.0, np.inf]], np.float32)
    np.testing.assert_array_equal(images.read(images.upload(pixels, "R32F")).ravel(), pixels.ravel())


def test_two_dimensions_are_one_channel(gpu_context):
    pixels = np.arange(6, dtype=np.float32).reshape(2, 3)
    np.testing.assert_array_equal(images.read(images.upload(pixels, "R32F"))[..., 0], pixels)


def test_channels_that_do_not_fit_the_format_are_refused(gpu_context):
    with pytest.raises(ValueError, match="3 channels do not fit into RGBA32F"):
        images.upload(np.zeros((2, 2, 3), np.float32), "RGBA32F")


@pytest.mark.parametrize("size", [(0, 4), (4, 0), (10**6, 1)])
def test_a_size_that_the_gpu_does_not_allow_is_refused_with_the_limit(gpu_context, size):
    with pytest.raises(ValueError, match=r"cannot be made: this GPU allows 1 to \d+"):
        images.create(*size, "R32F")


@pytest.mark.parametrize("count", [0, 1, images.LIST_WIDTH, images.LIST_WIDTH + 1])
def test_entry_i_of_a_list_stands_where_shaders_look_for_it(gpu_context, count):
    rows = np.random.default_rng(2).normal(size=(count, 4)).astype(np.float32)
    texels = images.read(images.upload_list(rows))
    i = np.arange(count)
    np.testing.assert_array_equal(texels[i >> 11, i & 2047], rows)


@pytest.mark.parametrize("image_format", ["RGBA32F", "R32F", "RG32F"])
def test_clearing_sets_every_texel(gpu_context, image_format):
    image = images.create(5, 3, image_format)
    images.Target((image,)).clear((0.5, -2.0, 1e6, 0.25))
    texels = images.read(image)
    np.testing.assert_array_equal(texels, np.broadcast_to([0.5, -2.0, 1e6, 0.25][: texels.shape[2]], texels.shape))


def test_clearing_sets_colours_and_depth_apart(gpu_context):
    color, depth = images.create(4, 4, "RGBA32F"), images.create(4, 4, "DEPTH_COMPONENT32F")
    images.Target((color,), depth).clear((1, 2, 3, 4), 0.5)
    assert (images.read(color) == [1, 2, 3, 4]).all()
    images.Target((), depth).clear(depth=0.25)
    assert (images.read(depth) == 0.25).all()
    assert (images.read(color) == [1, 2, 3, 4]).all()


def test_the_pool_hands_out_again_what_was_given_back(gpu_context):
    pool = images.Pool()
    first = pool.take(8, 4, "R32F")
    assert pool.allocated_bytes == first.bytes == 8 * 4 * 4
    pool.give(first)
    assert pool.take(8, 4, "R32F") is first
    assert pool.allocated_bytes == first.bytes


def test_the_pool_never_hands_out_an_image_that_is_in_use(gpu_context):
    pool = images.Pool()
    assert pool.take(8, 4, "R32F") is not pool.take(8, 4, "R32F")
    other = pool.take(4, 8, "R32F"), pool.take(8, 4, "RG32F")
    assert [image.size for image in other] == [(4, 8), (8, 4)]


def test_trimming_frees_what_nobody_holds_and_counts_it(gpu_context):
    pool = images.Pool()
    held, idle = pool.take(8, 8, "RGBA32F"), pool.take(8, 8, "RGBA32F")
    pool.give(idle)
    pool.trim()
    assert pool.allocated_bytes == held.bytes
    assert pool.take(8, 8, "RGBA32F") is not idle


def test_what_varies_in_size_never_has_a_power_of_two_as_a_side(gpu_context):
    for height, width in ((1, 1), (3, 128), (16, 17), (5, 6)):
        pixels = np.random.default_rng(1).uniform(size=(height, width, 4)).astype(np.float32)
        image = images.upload_varying(pixels)
        assert all(side & (side - 1) for side in image.size)
        np.testing.assert_array_equal(images.read(image)[:height, :width], pixels)
