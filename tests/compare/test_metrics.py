"""Error figures against closed forms."""

import importlib.util
import math

import numpy as np
import pytest

from addon.compare import metrics
from addon.compare.metrics import compare_depth, compare_normal, compare_radiance, display, flips, table, with_flip


def grey(value, height=8, width=10):
    return np.full((height, width, 3), value, np.float32)


def test_a_picture_equals_itself():
    picture = np.random.default_rng(1).random((8, 10, 3), np.float32)
    error = compare_radiance("Combined", picture, picture)
    assert (error.relmse, error.relmse_trimmed, error.bias) == (0, 0, 1)


@pytest.mark.parametrize("factor", [0.5, 0.99, 1.01, 3.0])
def test_a_scaled_constant_has_the_closed_form_error(factor):
    # |f r - r|^2 / (r^2 + (0.1 r)^2) = (f - 1)^2 / 1.01, whatever r is
    error = compare_radiance("Combined", grey(0.37) * np.float32(factor), grey(0.37))
    assert error.relmse == pytest.approx((factor - 1) ** 2 / 1.01, rel=1e-5)
    assert error.bias == pytest.approx(factor, rel=1e-6)


def test_relmse_weighs_by_luminance_and_the_dark_by_a_tenth_of_the_mean():
    reference = grey(0.0)
    reference[:, :5] = (1.0, 0.5, 0.25)
    luminance = 0.2126 + 0.7152 * 0.5 + 0.0722 * 0.25
    dark = 0.1 * luminance / 2
    x = reference + np.float32(0.01)
    expected = (0.0001 / (luminance**2 + dark**2) + 0.0001 / dark**2) / 2
    assert compare_radiance("Combined", x, reference).relmse == pytest.approx(expected, rel=1e-4)


def test_the_trimmed_figure_forgives_one_firefly_and_the_other_does_not():
    reference = grey(1.0, 40, 50)  # 2000 pixels: 0.1 % are two
    x = reference.copy()
    x[3, 4] = x[20, 7] = 1000.0
    error = compare_radiance("Combined", x, reference)
    assert error.relmse == pytest.approx(2 / 2000 * 999**2 / 1.01, rel=1e-5)
    assert error.relmse_trimmed == 0


def test_a_pixel_that_is_not_finite_is_counted_and_never_averaged_away():
    for value in (np.nan, np.inf, -np.inf):
        x = grey(1.0)
        x[2, 3, 1] = value
        error = compare_radiance("Combined", x, grey(1.0))
        assert error.relmse == math.inf and error.not_finite == 1
        assert error.remark == "1 pixel not finite"


def test_negative_radiance_is_counted():
    x = grey(1.0)
    x[0, :4, 2] = -0.1
    error = compare_radiance("Combined", x, grey(1.0))
    assert error.negative == 4 and error.remark == "4 pixels of negative radiance"


def test_sizes_that_differ_are_said_and_not_compared():
    error = compare_radiance("Combined", grey(1.0, 8, 10), grey(1.0, 8, 12))
    assert math.isnan(error.relmse) and error.remark == "sizes differ: 10x8 against 12x8"


def test_black_against_black_is_no_error():
    error = compare_radiance("Emission", grey(0.0), grey(0.0))
    assert (error.relmse, error.bias, error.flip, error.remark) == (0, 1, 0, "both black")


def test_light_where_the_reference_is_black_is_an_infinite_error():
    error = compare_radiance("Emission", grey(0.5), grey(0.0))
    assert error.relmse == math.inf and "the reference is black, this picture is not" in error.remark


def test_a_missing_picture_is_named():
    assert compare_radiance("Emission", None, grey(1.0)).remark == "missing in this picture"
    assert compare_radiance("Emission", grey(1.0), None).remark == "missing in the reference"


def test_no_error_below_the_noise_floor_is_reported():
    noise = np.where(np.indices((8, 10)).sum(axis=0) % 2, 0.1, -0.1).astype(np.float32)[..., None] * np.ones(
        3, np.float32
    )
    error = compare_radiance("Combined", grey(1.0) * np.float32(1.01), grey(1.0), noise)
    assert error.floor == pytest.approx(0.01 / 1.01, rel=1e-5)
    assert error.below_floor and error.reported_relmse == error.floor
    assert f"≤ {error.floor:.2e}" in table([error])
    worse = compare_radiance("Combined", grey(1.5), grey(1.0), noise)
    assert not worse.below_floor and worse.reported_relmse == worse.relmse


def test_half_the_difference_of_two_seeds_is_the_noise_of_their_mean():
    generator = np.random.default_rng(3)
    truth = grey(1.0, 200, 200)
    a, b = (truth + generator.normal(0, 0.2, truth.shape).astype(np.float32) for _ in range(2))
    against_truth = compare_radiance("Combined", truth, (a + b) / 2, (a - b) / 2)
    assert against_truth.relmse == pytest.approx(against_truth.floor, rel=0.02)


def test_depth_is_compared_where_both_see_a_surface():
    reference = np.full((4, 4, 1), 10.0, np.float32)
    reference[0] = 1e10
    x = reference * np.float32(1.02)
    x[1, 0] = 1e10
    error = compare_depth("Depth", x, reference)
    assert error.median == pytest.approx(0.02, rel=1e-4)
    assert error.remark == "1 pixel with a surface in only one of the two"


def test_normals_are_compared_by_their_distance():
    reference = np.zeros((2, 2, 3), np.float32)
    reference[..., 2] = 1
    x = reference.copy()
    angle = 0.01
    x[..., 0], x[..., 2] = np.sin(angle), np.cos(angle)
    assert compare_normal("Normal", x, reference).median == pytest.approx(2 * np.sin(angle / 2), rel=1e-4)


def test_display_is_the_srgb_curve():
    linear = np.array([[[0.0, 0.0031308, 0.21404114], [1.0, 2.0, -1.0]]], np.float32)
    np.testing.assert_allclose(display(linear), [[[0, 0.04045, 0.5], [1, 1, 0]]], atol=1e-5)


@pytest.mark.skipif(importlib.util.find_spec("flip_evaluator") is None, reason="flip-evaluator is not installed")
def test_flip_of_black_and_white_and_of_a_black_reference():
    same, opposite, black = flips([(grey(0.3), grey(0.3)), (grey(0.0), grey(1.0)), (grey(0.5), grey(0.0))])
    assert same == 0
    assert 0.9 < opposite <= 1
    assert black > 0.5


def test_without_the_flip_package_the_column_says_so(monkeypatch):
    monkeypatch.setattr(metrics, "flip_installed", lambda: False)
    errors = with_flip([compare_radiance("Combined", grey(1.1), grey(1.0))], [(grey(1.1), grey(1.0))])
    assert errors[0].flip is None
    assert "not installed" in table(errors)


def test_the_table_keeps_surface_rows_apart():
    lines = table(
        [compare_radiance("Combined", grey(1.1), grey(1.0)), compare_normal("Normal", grey(1.0), grey(1.0))]
    ).splitlines()
    assert [line.split()[0] for line in lines] == ["path", "Combined", "surface", "Normal"]
    assert "1.1000" in lines[1]


def test_exactly_a_thousandth_of_the_pixels_is_trimmed():
    """4000 pixels: the four worst are dropped, and the fifth counts."""
    reference = grey(1.0, 50, 80)
    for worst, left in ((4, 0), (5, 1)):
        x = reference.copy()
        x[0, :worst] = 11.0
        trimmed = compare_radiance("Combined", x, reference).relmse_trimmed
        assert trimmed == pytest.approx(left * 100 / 1.01 / 3996, rel=1e-5)
    every = compare_radiance("Combined", reference + np.float32(1.0), reference)
    assert every.relmse_trimmed == pytest.approx(every.relmse, rel=1e-6)


def test_flip_imports_nothing_from_the_working_folder(tmp_path, monkeypatch):
    """A folder of pictures may come from anyone, with modules in it."""
    for name in ("numpy", "flip_evaluator"):
        (tmp_path / f"{name}.py").write_text(f"open({str(tmp_path / 'ran')!r}, 'w')")
    monkeypatch.chdir(tmp_path)
    picture = np.full((16, 16, 3), 0.5, np.float32)
    assert metrics.flips([(picture, picture)]) == [0.0]
    assert not (tmp_path / "ran").exists()
