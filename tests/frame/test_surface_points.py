"""The stand-in for a scene: what its points and triangles cover, where they lie, and what they are never made of."""

from types import SimpleNamespace

import numpy as np
import pytest

from addon.scene.surface_points import COVER, RUNS, Surfaces, spread
from addon.scene.surfels import _reach

POINTS = 64
EYE = np.zeros(3)


def surfaces(corners, opacity=1.0, front=0):
    corners = np.asarray(corners, np.float32)
    count = len(corners)
    return Surfaces(corners, np.full(count, opacity), np.zeros(count, int), np.full(min(count, 1), front))


def grid(side, size=1.0):
    """A square in z = 0 around the origin of 2 x side x side triangles that face up."""
    y, x = np.mgrid[0:side, 0:side] / side - 0.5
    low = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 1, 3)
    step = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]]) / side
    return (low[:, None] + step).reshape(-1, 3, 3) * size


def test_discs_of_each_run_have_the_area_of_the_surface():
    large, small = spread(surfaces(grid(32)), POINTS, EYE, 10.0)
    assert len(large) == 0 and len(small) == RUNS * POINTS
    area = np.pi * small[:, 0, 3].reshape(RUNS, POINTS).sum(axis=1) / COVER**2
    np.testing.assert_allclose(area, 1.0, rtol=1e-5)


def test_each_run_is_spread_evenly():
    """A quarter of the square has a quarter of the points, which at random would be off by 3.5 of 16."""
    _, small = spread(surfaces(grid(32)), POINTS, EYE, 10.0)
    x, y = small[:, 0, 0].reshape(RUNS, POINTS), small[:, 0, 1].reshape(RUNS, POINTS)
    quarter = ((x < 0) & (y < 0)).sum(axis=1)
    assert quarter.mean() == pytest.approx(POINTS / 4, rel=0.03)
    assert quarter.std() < 2.0


def test_large_triangles_stand_for_themselves_and_leave_the_points_to_small_ones():
    floor, thing = grid(1, size=4.0), grid(32, size=0.5)
    large, small = spread(surfaces(np.concatenate([floor, thing + [0, 0, 1]])), POINTS, EYE, 10.0)
    np.testing.assert_allclose(large[:, 2:, :3], floor)
    assert (large[:, 2, 3] == 1).all() and (small[:, 2, 3] == 0).all()
    assert (small[:, 0, 2] == 1.0).all()


def test_what_is_far_is_stood_for_by_less():
    """Of a floor of 400 km2 in small triangles, half of the points lie within 20 times the reach."""
    large, small = spread(surfaces(grid(200, size=20_000.0)), POINTS, EYE, 100.0)
    away = np.linalg.norm(np.concatenate([large, small])[:, 0, :3], axis=1)
    assert np.median(away) < 2000
    radius = np.sqrt(small[:, 0, 3])
    assert radius[np.linalg.norm(small[:, 0, :3], axis=1) > 5000].min() > 10 * radius.min()


def test_a_floor_that_is_one_large_square_is_halved_around_the_eye():
    large, small = spread(surfaces(grid(1, size=1e6)), 16384, EYE, 1.0)
    assert len(small) == 0
    area = np.linalg.norm(np.cross(large[:, 3, :3] - large[:, 2, :3], large[:, 4, :3] - large[:, 2, :3]), axis=1) / 2
    assert area.sum() == pytest.approx(1e12, rel=1e-3)
    edges = np.linalg.norm(large[:, 2, :3] - large[:, 3, :3], axis=1)
    assert edges.min() < 3.0 and edges.max() > 1e4


@pytest.mark.parametrize("scale", [2.0**-10, 2.0**13])
def test_points_grow_with_the_scene(scale):
    one = spread(surfaces(grid(32)), POINTS, EYE, 10.0)[1]
    other = spread(surfaces(grid(32) * scale), POINTS, EYE, 10.0 * scale)[1]
    np.testing.assert_allclose(other[:, 0, :3], one[:, 0, :3] * scale, atol=1e-6 * scale)
    np.testing.assert_allclose(other[:, 0, 3], one[:, 0, 3] * scale**2, rtol=1e-4)


def test_triangles_without_area_or_number_are_never_chosen():
    bad = [[(0, 0, 2)] * 3, [(0, 0, 2), (1, 0, 2), (2, 0, 2)], [(0, 0, np.nan), (1, 0, 2), (0, 1, 2)]]
    for large, small in (
        spread(surfaces(np.concatenate([grid(32), np.array(bad)])), POINTS, EYE, 10.0),
        spread(surfaces(bad), POINTS, EYE, 10.0),
        spread(surfaces(np.zeros((0, 3, 3))), POINTS, EYE, 10.0),
    ):
        both = np.concatenate([large, small])
        assert np.isfinite(both).all()
        assert (both[:, 0, 2] == 0).all()


def test_normals_and_numbers_tell_which_side_is_seen():
    up = spread(surfaces(grid(32), front=1), POINTS, EYE, 10.0)[1]
    mirrored = spread(surfaces(grid(32), front=-1), POINTS, EYE, 10.0)[1]
    both = spread(surfaces(grid(32), opacity=0.25), POINTS, EYE, 10.0)[1]
    assert (up[:, 1, 3] < 0).all() and (mirrored[:, 1, 3] < 0).all() and (both[:, 1, 3] > 0).all()
    np.testing.assert_allclose(up[:, 1, :2], 0.0, atol=1e-6)  # octahedral: the middle is up, the corners are down
    np.testing.assert_allclose(np.abs(mirrored[:, 1, :2]), 1.0, atol=1e-6)
    assert (both[:, 1, 2] == 0.25).all()


def test_of_large_scenes_area_counts_less_far_from_the_eye():
    """From one and a half times the distance of what is seen on, as a power of two, from a place on a grid of such
    steps; in a scene of eight times that or less, nowhere."""
    matrix = np.eye(4)
    matrix[:3, 3] = (103.0, -7.0, 1.0)
    frame = SimpleNamespace(
        geometry=SimpleNamespace(size=100.0, origin=np.array([3.0, 0.0, 0.0])),
        snapshot=SimpleNamespace(camera=SimpleNamespace(matrix=matrix)),
    )
    reach, eye = _reach(frame, 5.0)
    assert reach == 8.0 and eye.tolist() == [96.0, -8.0, 0.0]
    frame.geometry.size = 64.0
    assert _reach(frame, 5.0)[0] == np.inf
