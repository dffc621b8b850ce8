"""Depth-map views contain every receiver that the light can reach, wherever the light stands."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from addon.lighting.depth_maps import directional_views, point_views
from addon.scene.receivers import Receivers

RESOLUTION = 256


def receivers(seed=1, count=40, near=0.1, far=100.0):
    """Boxes of screen tiles in front of a camera at the origin that looks along +Y, sorted by distance."""
    rng = np.random.default_rng(seed)
    distance = np.sort(near * (far / near) ** rng.uniform(0, 1, count))
    centre = np.column_stack([rng.uniform(-0.5, 0.5, (count, 2)) * distance[:, None], distance])[:, [0, 2, 1]]
    half = distance[:, None] * rng.uniform(0.0, 0.05, (count, 3))
    return Receivers(centre - half, centre + half, distance)


def around(boxes):
    """The scene that these receivers are part of, and a roof above it."""
    low, high = boxes.low.min(axis=0), boxes.high.max(axis=0) + (0, 0, 30.0)
    return SimpleNamespace(bounds_min=low, bounds_max=high, origin=np.zeros(3), size=float(np.linalg.norm(high - low)))


def contained(views, points):
    """For each point, whether some view has it inside of its rectangle and before its projection's centre."""
    h = np.column_stack([points, np.ones(len(points))])
    inside = np.zeros(len(points), bool)
    for view in views:
        x, y, w, _ = view.rows @ h.T
        with np.errstate(divide="ignore", invalid="ignore"):
            inside |= (w > 0) & (np.abs(x / w) < 1) & (np.abs(y / w) < 1)
    return inside


JITTERS = [(0.0, 0.0, 0.0, 0.0), (0.999, 0.001, 0.3, 0.7), (0.5, 0.5, 0.875, 0.1)]
DIRECTIONS = [(0, 0, 1), (0.6, 0.0, 0.8), (-0.9, 0.3, 0.1), (0, 1, 0), (0, 0, -1)]


@pytest.mark.parametrize("jitter", JITTERS)
@pytest.mark.parametrize("direction", DIRECTIONS)
def test_views_from_a_direction_contain_all_receivers(direction, jitter):
    boxes = receivers()
    direction = np.array(direction) / np.linalg.norm(direction)
    views = directional_views(direction, boxes, around(boxes), jitter, RESOLUTION)
    assert contained(views, boxes.corners.reshape(-1, 3)).all()


def reached(views, points):
    """For each point, whether the view that it asks, the first that contains it, draws casters as far as it lies."""
    h = np.column_stack([points, np.ones(len(points))])
    reaches = np.ones(len(points), bool)
    for view in reversed(views):
        x, y, w, q = view.rows @ h.T
        with np.errstate(divide="ignore", invalid="ignore"):
            inside = (w > 0) & (np.abs(x / w) < 1) & (np.abs(y / w) < 1)
            reaches = np.where(inside, q / w >= view.least_q * (1 - 1e-6), reaches)
    return reaches


@pytest.mark.parametrize("direction", [(0.0, -0.98, 0.17), (0.0, 0.98, 0.17), (0, 0, 1)])
def test_a_near_view_holds_what_shades_the_far_receivers_that_ask_it(direction):
    """A low sun behind the camera: the ground far away projects into the view of what is near."""
    boxes = receivers()
    direction = np.array(direction) / np.linalg.norm(direction)
    views = directional_views(direction, boxes, around(boxes), JITTERS[0], RESOLUTION)
    assert reached(views, boxes.corners.reshape(-1, 3)).all()
    views = point_views(-direction * -200.0, None, np.inf, boxes, around(boxes), JITTERS[0], RESOLUTION)
    assert reached(views, boxes.corners.reshape(-1, 3)).all()


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_views_from_a_direction_reach_from_the_lowest_receiver_to_the_top_of_the_scene(direction):
    boxes = receivers()
    scene = around(boxes)
    direction = np.array(direction) / np.linalg.norm(direction)
    view = directional_views(direction, boxes, scene, JITTERS[0], RESOLUTION)[0]
    corners = np.array(np.meshgrid(*zip(scene.bounds_min, scene.bounds_max))).reshape(3, -1).T
    top = corners[np.argmax(corners @ direction)]
    for point in (*boxes.corners.reshape(-1, 3), top):
        q = view.rows[3] @ (*point, 1.0)
        assert 0 < q < 1


@pytest.mark.parametrize("jitter", JITTERS)
@pytest.mark.parametrize("position", [(0, 50, 200), (0, 20, 5), (3, 10, 1), (0, -5, 0), (-40, 60, 2)])
def test_views_from_a_point_contain_all_receivers(position, jitter):
    boxes = receivers()
    views = point_views(np.array(position, float), None, np.inf, boxes, around(boxes), jitter, RESOLUTION)
    assert contained(views, boxes.corners.reshape(-1, 3)).all()


def test_views_from_a_point_among_the_receivers_contain_all_of_them():
    boxes = receivers()
    position = (boxes.low[20] + boxes.high[20]) / 2
    views = point_views(position, None, np.inf, boxes, around(boxes), JITTERS[1], RESOLUTION)
    corners = boxes.corners.reshape(-1, 3)
    assert contained(views, corners).all()
    assert len(views) <= 6
    # A view tells directions apart: what it shows side by side and one above the other are two axes.
    assert all(np.linalg.matrix_rank(view.rows[:3, :3]) == 3 for view in views)


def within(boxes, count=64):
    """Points all over the boxes, not only at their corners."""
    share = np.random.default_rng(3).uniform(0, 1, (count, 1, 3))
    return (boxes.low + share * (boxes.high - boxes.low)).reshape(-1, 3)


def lit_points(boxes, position, axis, tangent):
    """Points of the boxes before the light and inside of its cone."""
    points = within(boxes)
    offset = points - position
    along = offset @ axis
    across = np.linalg.norm(offset - along[:, None] * axis, axis=1)
    return points[(along > 1e-3) & (across < tangent * along)]


@pytest.mark.parametrize("jitter", JITTERS)
@pytest.mark.parametrize("position", [(0, 50, 200), (0, 20, 5), (-40, 60, 2)])
@pytest.mark.parametrize("tangent", [np.inf, 2.0, 0.2])
def test_views_of_a_light_with_an_axis_contain_what_lies_in_its_cone(position, tangent, jitter):
    boxes, position = receivers(), np.array(position, float)
    axis = (boxes.low[30] + boxes.high[30]) / 2 - position
    axis /= np.linalg.norm(axis)
    views = point_views(position, axis, tangent, boxes, around(boxes), jitter, RESOLUTION)
    lit = lit_points(boxes, position, axis, tangent)
    assert len(lit)
    assert contained(views, lit).all()


@pytest.mark.parametrize("tangent", [np.inf, 2.0, 0.2])
def test_a_box_that_reaches_behind_the_light_is_contained_as_far_as_it_is_lit(tangent):
    """A tile at the edge of a near object spans from it to what lies far behind: lights may stand in between."""
    tile = Receivers(np.array([[-1.0, -1.0, -10.0]]), np.array([[1.0, 1.0, 1.0]]), np.array([5.0]))
    axis = np.array([0.0, 0.0, -1.0])
    views = point_views(np.zeros(3), axis, tangent, tile, around(tile), JITTERS[0], RESOLUTION)
    lit = lit_points(tile, np.zeros(3), axis, tangent)
    assert len(lit)
    assert contained(views, lit).all()


def test_a_light_that_faces_away_from_all_receivers_needs_no_view():
    boxes = receivers()
    axis = np.array([0.0, -1.0, 0.0])
    assert point_views(np.array([0.0, -1.0, 0.0]), axis, np.inf, boxes, around(boxes), JITTERS[0], RESOLUTION) == []


def test_without_receivers_there_are_no_views():
    nothing = Receivers(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
    scene = around(receivers())
    assert directional_views(np.array([0, 0, 1.0]), nothing, scene, JITTERS[0], RESOLUTION) == []
    assert point_views(np.zeros(3), None, np.inf, nothing, scene, JITTERS[0], RESOLUTION) == []


def test_groups_of_receivers_are_a_partition_from_near_to_far():
    boxes = receivers(count=200)
    groups = boxes.groups()
    assert sorted(np.concatenate(groups)) == list(range(200))
    spans = [(boxes.distance[g].min(), boxes.distance[g].max()) for g in groups]
    assert all(a[1] <= b[0] for a, b in pairwise(spans))


def test_the_near_part_of_a_deep_picture_gets_finer_texels():
    """From 0.1 to 100 m one view would leave near receivers a texel of half a metre."""
    boxes = receivers()
    views = directional_views(np.array([0.0, 0.0, 1.0]), boxes, around(boxes), JITTERS[0], RESOLUTION)
    texels = [2 / np.linalg.norm(view.rows[0, :3]) / RESOLUTION for view in views]
    assert len(views) > 1
    assert texels[0] < texels[-1] / 3
    nearest = boxes.corners[0]
    assert contained(views[:1], nearest).all()
