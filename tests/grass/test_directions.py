"""Weights among directions of view and light."""

import numpy as np
import pytest

from addon.grass.directions import GRAZING, LIGHTS, VIEWS, Rings, thinned

RINGS = (VIEWS, LIGHTS, Rings((*VIEWS.polar, GRAZING), (*VIEWS.counts, 24)), Rings((10.0,), (5,)))


def hemisphere(count: int) -> np.ndarray:
    rng = np.random.default_rng(0)
    v = rng.normal(size=(count, 3))
    v[:, 2] = np.abs(v[:, 2])
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def test_there_are_81_views_and_21_lights():
    assert (VIEWS.number, LIGHTS.number) == (81, 21)


@pytest.mark.parametrize("rings", RINGS)
def test_weights_are_not_negative_and_sum_to_one(rings):
    numbers, weights = rings.weights(hemisphere(5000))
    assert (weights >= 0.0).all() and np.abs(weights.sum(axis=-1) - 1.0).max() < 1e-12
    assert numbers.min() >= 0 and numbers.max() < rings.number


@pytest.mark.parametrize("rings", RINGS)
def test_a_direction_of_the_rings_is_its_own(rings):
    numbers, weights = rings.weights(rings.vectors)
    own = np.where(numbers == np.arange(rings.number)[:, None], weights, 0.0).sum(axis=1)
    assert np.abs(own - 1.0).max() < 1e-6


@pytest.mark.parametrize("rings", RINGS)
def test_weights_are_continuous(rings):
    rng = np.random.default_rng(1)
    near = hemisphere(2000)
    near = near[near[:, 2] < 0.999]
    moved = near + 1e-6 * rng.normal(size=near.shape)
    moved /= np.linalg.norm(moved, axis=1, keepdims=True)
    spread = np.zeros((2, len(near), rings.number))
    for k, directions in enumerate((near, moved)):
        numbers, weights = rings.weights(directions)
        np.add.at(spread[k], (np.arange(len(near))[:, None], numbers), weights)
    assert np.abs(spread[0] - spread[1]).max() < 2e-3


@pytest.mark.parametrize("rings", RINGS)
def test_cells_divide_the_hemisphere(rings):
    assert rings.solid_angles().sum() == pytest.approx(2.0 * np.pi)


def test_beyond_the_last_ring_its_own_angle_counts():
    grazing = np.array([[0.9999, 0.0, 0.01], [1.0, 0.0, 0.0], [0.99, 0.0, -0.1]])
    numbers, weights = VIEWS.weights(grazing / np.linalg.norm(grazing, axis=1, keepdims=True))
    assert (numbers[weights > 0.5] == VIEWS.firsts[-1]).all()


@pytest.mark.parametrize("number", [7, 21, 50, 81, 500])
def test_fewer_directions_reach_as_far_out(number):
    fewer = thinned(VIEWS, number)
    assert fewer.polar[-1] == VIEWS.polar[-1] and abs(fewer.number - min(number, 81)) <= 3


@pytest.mark.parametrize("polar, counts", [((), ()), ((0.0, 10.0), (1,)), ((10.0, 5.0), (1, 1)), ((95.0,), (1,))])
def test_rings_that_cannot_be_are_refused(polar, counts):
    with pytest.raises(ValueError):
        Rings(polar, counts)
