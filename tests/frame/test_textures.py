"""Textures on the GPU: formats, bytes, levels. Expected values are means by numpy and in closed form."""

import numpy as np
import pytest

from addon.gfx import images, readback
from addon.materials.atlas import level_sizes, rows_with_levels, texture_layout
from addon.materials.estimate import srgb_decode
from addon.scene.textures import stored_as, upload_texture
from addon.snapshot.scene import Image

pytestmark = pytest.mark.usefixtures("gpu_context")


def image(pixels, encoding="LINEAR", alpha="NONE", bits=8, tiles=()):
    return Image("image", 1, np.asarray(pixels, np.float32), encoding, alpha, tiles=tiles, bits=bits)


def opaque(values):
    """(H, W, 4) grey pixels of alpha 1."""
    return np.concatenate([np.repeat(np.asarray(values, float)[..., None], 3, 2), np.ones((*values.shape, 1))], 2)


def texels(texture):
    with images.borrowed(*texture.size, "RGBA32F") as target:
        readback.put(texture, target, 0, 0)
        return images.read(target.colors[0])


def level(found, width, height, number, corner=(0, 0)):
    """Texels of a level as (H, W, 4), taken out of those of the texture."""
    x, y = corner
    first = y + height + sum(-(-rows >> n) for n, (_, rows) in enumerate(level_sizes(width, height)[: number - 1], 1))
    own_width, own_height = width >> number, height >> number
    out = np.empty((own_height, own_width, 4))
    for row in range(own_height):
        left = x + (row % 2**number) * own_width
        out[row] = found[first + (row >> number), left : left + own_width]
    return out


def test_bytes_are_kept_as_they_are():
    values = np.arange(256, dtype=np.float32).reshape(16, 16) / np.float32(255)
    texture = upload_texture({"a": image(opaque(values), "SRGB")}, "a")
    assert texture.format == "RGBA8"
    np.testing.assert_array_equal(np.round(texels(texture)[..., 0] * 255), np.round(values * 255))


def test_fewest_bits_that_hold_the_pixels():
    grey = opaque(np.full((4, 4), 128 / 255))
    assert stored_as(image(grey)) == "RGBA8"
    assert stored_as(image(grey * 1.001)) == "RGBA16F"  # no bytes, whatever it was said to be
    assert stored_as(image(grey, bits=16)) == "RGBA16F"
    assert stored_as(image(grey * 1e6, bits=16)) == "RGBA32F"
    assert stored_as(image(grey * np.nan, bits=16)) == "RGBA32F"
    assert stored_as(image(grey, bits=32)) == "RGBA32F"


def test_a_large_texture_of_bytes_with_levels_takes_a_third_of_what_floats_took():
    (_, (width, height), fits) = texture_layout([(4096, 4096)])
    assert fits and width * height * 4 <= 90e6
    small = upload_texture({"a": image(opaque(np.zeros((64, 64))))}, "a", levels=True)
    assert small.size == (64, rows_with_levels(64, 64)) and small.bytes == 4 * 64 * rows_with_levels(64, 64)


@pytest.mark.parametrize(
    ("size", "levels"), [((1024, 2), False), ((2, 1024), False), ((1024, 1), True), ((1024, 32), True)]
)
def test_levels_of_long_images_would_mix_their_few_rows(size, levels):
    """A level halves both sides; a single row stays what it is."""
    assert texture_layout([size])[2] == levels


def test_an_image_too_high_for_its_levels_has_none():
    assert not texture_layout([(16, 14000)])[2]
    assert texture_layout([(14000, 16)])[2]


@pytest.mark.parametrize("size", [(16, 16), (12, 20), (7, 9), (1, 8), (33, 5)])
def test_a_level_is_the_mean_of_an_equal_share(size):
    width, height = size
    values = np.random.default_rng(3).uniform(0, 1, (height, width)).astype(np.float32)
    # Between texels lookups interpolate; of what is linear that has the mean of the texels around.
    found = texels(upload_texture({"a": image(opaque(values), bits=32)}, "a", levels=True))
    np.testing.assert_array_equal(found[:height, :, 0], values)
    for number, (w, h) in enumerate(level_sizes(width, height), 1):
        own = level(found, width, height, number)[..., 0]
        assert own.shape == (h, w)
        assert own.mean() == pytest.approx(values.mean(), rel=1e-5)
        assert own.min() >= values.min() and own.max() <= values.max()


def test_levels_hold_the_mean_of_decoded_lookups():
    """Between black and white a lookup interpolates stored values and decodes: the integral of the sRGB curve of
    x + y - 2 x y over the unit square is .2463, not 1/2."""
    y, x = np.mgrid[0:32, 0:32]
    found = texels(upload_texture({"a": image(opaque((x + y) % 2), "SRGB")}, "a", levels=True))
    t = (np.arange(400) + 0.5) / 400
    expected = srgb_decode(t + t[:, None] - 2 * t * t[:, None]).mean()
    for number in (1, 3, 5):
        np.testing.assert_allclose(level(found, 32, 32, number)[..., 0] ** 2, expected, atol=1.5 / 255)


def test_colour_counts_as_far_as_alpha_covers():
    """Green leaves on what is transparent and red: levels are green, at the density of the leaves."""
    pixels = np.zeros((16, 16, 4), np.float32)
    pixels[:] = (1, 0, 0, 0)
    pixels[::2, ::2] = (0, 1, 0, 1)
    found = texels(upload_texture({"a": image(pixels, "SRGB", "STRAIGHT")}, "a", levels=True))
    own = level(found, 16, 16, 2)
    assert own[..., 0].max() == 0.0 and own[..., 1].min() > 0.9
    np.testing.assert_allclose(own[..., 3], 0.25, atol=1 / 255)


def test_parts_of_an_atlas_have_levels_of_their_own():
    one, two = opaque(np.full((8, 16), 1.0)), opaque(np.full((16, 8), 0.0))
    known = {"a": image(one), "b": image(two)}
    texture = upload_texture(known, "atlas a|b", levels=True)
    corners, whole, _ = texture_layout([(16, 8), (8, 16)])
    assert texture.size == whole
    found = texels(texture)
    for corner, (width, height), value in zip(corners, [(16, 8), (8, 16)], (1.0, 0.0)):
        for number in range(1, len(level_sizes(width, height)) + 1):
            assert (level(found, width, height, number, corner)[..., 0] == value).all()


def test_a_texel_that_is_no_number_does_not_spread():
    values = opaque(np.full((8, 8), 0.5))
    values[3, 3] = np.nan
    found = texels(upload_texture({"a": image(values, bits=16)}, "a", levels=True))
    assert np.isfinite(level(found, 8, 8, 3)).all()
