"""Pictures about pictures: what their values are, where closed forms say it."""

import numpy as np
import pytest

from addon.compare import pictures
from addon.compare.metrics import display


def flat(value, size=(4, 6), channels=3):
    return np.full((*size, channels), value, np.float32)


def encoded(color):
    return display(color) * 255


def test_difference_is_absolute_and_per_channel():
    x, r = flat(1.0), flat(1.0)
    r[..., 1] = 3.0
    assert np.array_equal(pictures.difference(x, r)[0, 0], [0.0, 2.0, 0.0])


def test_equal_pictures_have_the_lowest_error_colour():
    assert np.allclose(encoded(pictures.error_map(flat(0.5), flat(0.5))), pictures.SCALE[0], atol=0.6)


def test_error_scale_is_logarithmic_and_ends_where_it_says():
    """A relative error e has a squared error of about e^2 / 1.01: the mean itself counts for a tenth."""
    middle = 10 ** (np.log10(pictures.ERROR_RANGE).mean() / 2) * np.sqrt(1.01)
    shown = encoded(pictures.error_map(flat(1 + middle), flat(1.0)))
    assert np.allclose(shown, pictures.SCALE[len(pictures.SCALE) // 2], atol=1)
    assert np.allclose(encoded(pictures.error_map(flat(100.0), flat(1.0))), pictures.SCALE[-1], atol=0.6)


def test_false_colour_counts_in_stops():
    assert np.allclose(encoded(pictures.false_color(flat(2.0**-8), -8, 4)), pictures.SCALE[0], atol=0.6)
    assert np.allclose(encoded(pictures.false_color(flat(0.25), -8, 4)), pictures.SCALE[3], atol=0.6)
    assert np.allclose(encoded(pictures.false_color(flat(16.0, channels=1), -8, 4)), pictures.SCALE[-1], atol=0.6)


def test_split_shows_each_on_its_side():
    shown = pictures.split_view(flat(0.2, (2, 10)), flat(0.8, (2, 10)), 0.4)
    assert np.allclose(shown[0, :, 0], [0.2] * 4 + [1.0] + [0.8] * 5)


@pytest.mark.parametrize("share", [-1.0, 0.0, 1.0, 2.0])
def test_split_at_an_end_shows_one_picture(share):
    shown = pictures.split_view(flat(0.2), flat(0.8), share)
    assert np.allclose(shown, 0.8 if share <= 0 else 0.2)


@pytest.mark.parametrize("make", [pictures.difference, pictures.error_map, lambda a, b: pictures.split_view(a, b, 0.5)])
def test_whatever_the_size_channels_and_values_the_result_is_finite(make):
    x = flat(np.nan, (3, 9), 1)
    x[0] = np.inf
    out = make(x, np.nan_to_num(flat(0.0, (5, 4), 4)))
    assert out.shape == (3, 4, 3)
    assert make is not pictures.error_map or np.isfinite(out).all()


def test_thumbnail_is_small_and_in_display_values():
    small = pictures.thumbnail(flat(0.5, (300, 200)), 100)
    assert small.shape == (100, 67, 4)
    assert np.allclose(small[0, 0], [*display(flat(0.5))[0, 0], 1.0])
