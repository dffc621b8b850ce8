"""Points go to the light whose error falls most per point, within the budget, and come out even."""

import numpy as np
import pytest

from addon.sources.rates import FEWEST_POINTS, LITTLE, Rate, allocate, budget_for, directions_for, left, paying


@pytest.mark.parametrize(("exponent", "numbers"), [(0, [[0], [1], [2], [3]]), (1, [[0, 1], [2, 3], [4, 5], [6, 7]])])
def test_points_are_numbered_without_gap(exponent, numbers):
    assert [list(Rate(exponent).points(sample)) for sample in range(4)] == numbers


def test_a_low_rate_skips_samples_and_no_point():
    assert [list(Rate(-1).points(sample)) for sample in range(6)] == [[0], [], [1], [], [2], []]


def test_equal_lights_get_equal_rates():
    assert len({rate.exponent for rate in allocate([0.3, 0.3, 0.3, 0.3], 64, 4.0)}) == 1


def test_the_light_that_errs_most_gets_most_points():
    rates = [rate.per_sample for rate in allocate([1.0, 0.01, 0.0], 64, 6.0)]
    assert rates[0] > rates[1] > rates[2]
    assert sum(rates) <= 6.0


def test_no_other_sharing_of_the_budget_leaves_less_error():
    """Against all rates in powers of two that cost no more."""
    variance = np.array([0.5, 0.08, 0.003])
    found = np.array([rate.per_sample for rate in allocate(variance, 64, 6.0)])
    choices = 2.0 ** np.arange(-3, 4)
    grid = np.stack(np.meshgrid(choices, choices, choices), axis=-1).reshape(-1, 3)
    errors = (variance * grid**-1.5).sum(axis=1)
    best = errors[grid.sum(axis=1) <= found.sum()].min()
    assert (variance * found**-1.5).sum() <= 1.001 * best


@pytest.mark.parametrize("samples", [1, 7, 8, 12, 16, 64, 100])
def test_every_light_has_whole_rounds_of_points_and_enough_of_them(samples):
    for rate in allocate([1.0, 0.0], samples, 1.0):
        assert samples * rate.per_sample == int(samples * rate.per_sample)
        assert samples * rate.per_sample >= min(samples, FEWEST_POINTS)


def test_variances_that_are_no_numbers_do_no_harm():
    assert len(allocate([np.nan, np.inf, 1.0], 16, 6.0)) == 3
    assert allocate([], 16, 6.0) == []


@pytest.mark.parametrize(
    ("samples", "most"), [(1, 24.0), (4, 12.0), (5, 6.0), (16, 6.0), (63, 6.0), (64, 12.0), (256, 24.0)]
)
def test_the_budget_grows_half_as_fast_as_samples_leave_their_usual_number_and_only_where_error_is_left(samples, most):
    assert budget_for([100.0], samples, 6.0) == most
    assert budget_for([1e-6], samples, 6.0) == 6.0
    assert budget_for([], samples, 6.0) == 6.0


def test_error_that_is_left_falls_with_the_budget():
    errors = [left([1.0, 0.2], 64, budget) for budget in (4.0, 8.0, 16.0)]
    assert errors[0] > errors[1] > errors[2] > 0
    assert budget_for([1.0, 0.2], 64, 4.0) == 8.0 and errors[0] > LITTLE


def test_a_light_that_gives_most_of_the_picture_is_in_every_sample_though_its_shadows_are_sharp():
    assert [rate.exponent for rate in allocate([0.0, 0.0], 64, 6.0)] == [-3, -3]
    assert [rate.exponent for rate in allocate([0.0, 0.0], 64, 1.2, film=[0.04, 1e-6])] == [0, -3]


def test_points_of_the_film_ask_for_no_more_than_one_point_in_a_sample():
    assert [rate.exponent for rate in allocate([0.0], 64, 16.0, film=[1.0])] == [0]


@pytest.mark.parametrize(
    ("variance", "samples", "exponent", "expected"),
    [
        (0.8, 1, 1, 4),
        (0.8, 4, 2, 3),
        (0.8, 16, 2, 3),
        (0.8, 64, 2, 2),
        (0.01, 1, 0, 0),
        (1e30, 1, 0, 4),
        (0.0, 1, 3, 3),
    ],
)
def test_pictures_that_would_see_too_little_of_the_world_draw_more_of_it(variance, samples, exponent, expected):
    assert directions_for(variance, samples, Rate(exponent), 8.0) == Rate(expected)


@pytest.mark.parametrize(
    ("variance", "samples", "exponent", "expected"),
    [(0.8, 1, 1, 4), (0.8, 16, 2, 2), (20.0, 16, 2, 3), (0.8, 64, 1, 2)],
)
def test_without_indirect_light_directions_of_the_world_are_doubled_where_they_leave_much(
    variance, samples, exponent, expected
):
    assert directions_for(variance, samples, Rate(exponent), 8.0, alone=True) == Rate(expected)


def test_samples_without_indirect_light_share_out_fewer_maps_while_they_are_few():
    assert [paying(8.0, samples, alone=True) for samples in (1, 16, 64)] == [5.0, 5.0, 8.0]
    assert paying(3.0, 16, alone=True) == 3.0 and paying(8.0, 16, alone=False) == 8.0
