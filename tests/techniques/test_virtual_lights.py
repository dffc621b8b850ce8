"""Which candidates become virtual lights: without bias, spread in space, and alike in pictures that are alike."""

from types import SimpleNamespace

import numpy as np
import pytest

from addon.gfx import images
from addon.kernels import ordered_lists
from addon.lighting import virtual_lights
from addon.lighting.light_choice import CELL, Choice
from addon.sources import lights

COUNT = 512
pytestmark = pytest.mark.usefixtures("gpu_context")


def _listed(values):
    """(N, C) in an image of one row."""
    row = np.zeros((1, len(values), 4))
    row[0, :, : values.shape[1]] = values
    return images.upload(row)


def _resample(points, radiance, count, u):
    """Numbers of the candidates that are kept, in an order in space, and how many candidates each stands for."""
    nothing = _listed(np.zeros_like(points))
    found = {
        "candidate_point": _listed(np.column_stack([points, np.ones(len(points))])),
        "candidate_radiance": _listed(radiance), "candidate_albedo": nothing, "next_radiance": nothing,
    }  # fmt: skip
    choice = Choice(len(points), len(points), (0.0, 0.0, 0.0, 1e3))
    choice.order(found["candidate_point"], nothing)
    choice.radiances(found, None)
    slots, kept = choice.keep(count, u)
    rows, total = images.read(slots)[0], images.read(kept)[choice.last[::-1]][0]
    choice.release()
    rows = rows[rows[:, 3] > 0]
    assert len(rows) == total
    return rows[:, 1].astype(int), rows[:, 2].astype(np.float64)


@pytest.mark.parametrize("count", (1, 127, 128, 700, 4224))
def test_lists_are_sorted_and_equal_keys_keep_their_order(count):
    keys = np.random.default_rng(count).integers(0, 200, count)  # of 256 cells
    columns, rows = ordered_lists.size_for(count)
    points = np.column_stack([keys + 0.5, np.zeros((count, 2)), np.ones(count)])
    choice = Choice(count, count, (0.0, 0.0, 0.0, 1e3))
    numbers = images.read(choice.order(_listed(points), _listed(np.zeros((count, 3))))).reshape(-1)
    choice.release()
    assert len(numbers) == columns * rows
    np.testing.assert_array_equal(numbers[:count], np.argsort(keys, kind="stable"))


def test_running_sums_are_those_of_all_entries_before():
    values = np.zeros((5, ordered_lists.COLUMNS, 2), np.float32)
    values[:] = np.random.default_rng(3).integers(0, 9, values.shape)
    sums = ordered_lists.take_running_sums(images.upload(values, "RG32F"))
    found = images.read(sums).reshape(-1, 2)
    images.pool.give(sums)
    np.testing.assert_array_equal(found[1:], np.cumsum(values.reshape(-1, 2), axis=0)[:-1])


@pytest.fixture
def candidates():
    """Points on a floor and a wall, and their radiances."""
    numbers = np.random.default_rng(2)
    points = numbers.random((1536, 3))
    points[:1000, 2] = 0.0
    points[1000:, 0] = 1.0
    return points, numbers.random((1536, 3)) ** 4


@pytest.mark.slow
def test_what_is_kept_stands_for_all_candidates(candidates):
    points, radiance = candidates
    mean = np.zeros(len(points))
    starts = (np.arange(1000) + 0.5) / 1000
    for u in starts:
        keep, weight = _resample(points, radiance, COUNT, u)
        mean[keep] += weight / len(starts)
    np.testing.assert_allclose(mean, 1.0, atol=0.01)


def test_about_as_many_are_kept_as_are_asked_for(candidates):
    for count in (1, 3, 64, COUNT):
        keep, _ = _resample(*candidates, count, 0.3)
        assert abs(len(keep) - count) <= max(0.05 * count, 1) + (count == COUNT) * CELL


def test_every_part_of_space_has_its_share(candidates):
    points, radiance = candidates
    keep, weight = _resample(points, radiance, COUNT, 0.7)
    for quarter in np.ndindex(2, 2, 1):
        inside = (np.floor(points * 2).clip(0, 1)[:, :2] == quarter[:2]).all(axis=1)
        assert abs(weight[inside[keep]].sum() / inside.sum() - 1) < 0.1


def test_other_candidates_change_what_is_kept_nearby(candidates):
    """One gone, one brighter, one elsewhere: few of those that are kept are others."""
    points, radiance = candidates
    keep, _ = _resample(points, radiance, COUNT, 0.3)
    points, radiance = points.copy(), radiance.copy()
    radiance[100] = 0.0
    radiance[700] *= 2.0
    points[1200] = 1.0 - points[1200]
    others, _ = _resample(points, radiance, COUNT, 0.3)
    assert len(set(keep) ^ set(others)) <= 6 * CELL


def test_where_nothing_has_light_nothing_is_kept(candidates):
    points, radiance = candidates
    keep, weight = _resample(points, np.zeros_like(radiance), COUNT, 0.3)
    assert not len(keep) and not len(weight)


def test_candidates_in_one_place_are_kept_in_proportion():
    points = np.full((100, 3), 0.5)
    _keep, weight = _resample(points, np.ones((100, 3)), 64, 0.1)
    assert abs(weight.sum() - 100) <= 2


def test_of_more_lamps_than_points_those_drawn_stand_for_all(monkeypatch):
    """Over all starts of the comb each lamp weighs 1 in the mean; weak ones are drawn now and then."""
    monkeypatch.setattr(virtual_lights, "answered", lambda frame, emitter: False)
    power = np.random.default_rng(5).random(24) ** 6 * 50 + 0.01
    lamp = SimpleNamespace(cast_shadow=True, links=SimpleNamespace(passing=()))

    def emitter(number):
        def row(sample, first, count, weight, points):
            return lights.LIGHT.rows(radiance=weight, radius=number)

        return SimpleNamespace(
            power=power[number], has_span=False, radius=0.0, is_narrow=lambda receivers: False,
            sample=lambda *numbers: None, row=row, light=lamp,
        )  # fmt: skip

    own = SimpleNamespace(_emitters=[emitter(k) for k in range(len(power))])
    mean, starts = np.zeros(len(power)), (np.arange(4000) + 0.5) / 4000
    for u in starts:
        frame = SimpleNamespace(
            uniform=lambda name, u=u: u, random_volume=lambda *name: np.zeros(3), sample=0, receivers=None,
            settings=SimpleNamespace(samples=1),
        )  # fmt: skip
        rows = virtual_lights.VirtualLights._light_rows(own, frame, 6)
        assert len(rows) <= 6
        for row in rows:
            mean[int(row[lights.LIGHT.at.radius])] += row[lights.LIGHT.at.radiance][0] / len(starts)
    np.testing.assert_allclose(mean, 1.0, atol=0.02)
