"""What a depth map leaves out cannot change it: hidden boxes, far casters, back faces of closed meshes."""

from types import SimpleNamespace

import numpy as np
import pytest

from addon.scene import casters, culling
from addon.scene.culling import Boxes, calls, closed, closed_triangles


def mesh(positions, triangles):
    triangles = np.asarray(triangles, np.int32).reshape(-1, 3)
    return SimpleNamespace(
        positions=np.asarray(positions, np.float32), corner_vertices=triangles.reshape(-1),
        triangle_corners=np.arange(triangles.size, dtype=np.int32).reshape(-1, 3),
    )  # fmt: skip


def surface(triangles, positions=None):
    """Arguments of `closed`."""
    return np.array(TETRAHEDRON if positions is None else positions, np.float32), np.array(triangles).reshape(-1, 3)


TETRAHEDRON = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
OUTWARD = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)]


def test_a_tetrahedron_that_faces_outwards_is_closed():
    assert closed(*surface(OUTWARD))


@pytest.mark.parametrize(
    "triangles",
    [OUTWARD[:3], [t[::-1] for t in OUTWARD], [OUTWARD[0][::-1], *OUTWARD[1:]], [(0, 1, 1)], []],
    ids=["open", "inside out", "one face turned", "degenerate", "empty"],
)
def test_what_is_open_or_turned_is_not(triangles):
    assert not closed(*surface(triangles))


def test_two_shells_in_one_mesh_are_closed_together():
    shifted = np.array(TETRAHEDRON) + 5.0
    both = OUTWARD + [tuple(k + 4 for k in t) for t in OUTWARD]
    assert closed(*surface(both, np.concatenate([TETRAHEDRON, shifted])))


def test_a_mesh_is_taken_apart_into_closed_parts_and_others():
    """A tree: a closed crown, a trunk without a bottom, a leaf."""
    positions = np.concatenate([TETRAHEDRON, np.array(TETRAHEDRON) + 5.0, np.array(TETRAHEDRON) + 9.0])
    trunk = [tuple(k + 4 for k in t) for t in OUTWARD[1:]]
    leaf = [(8, 9, 10), (8, 10, 9), (8, 9, 11)]
    found = closed_triangles(mesh(positions, [*trunk, *OUTWARD, *leaf]))
    assert found.tolist() == [False] * 3 + [True] * 4 + [False] * 3


@pytest.mark.parametrize(
    ("light", "one_sided"), [(None, [True, True]), ((9, 9, 9), [True, True]), ((0.5, 0.5, 0.5), [False, True])]
)
def test_back_faces_count_where_the_light_stands_within_an_object(light, one_sided):
    boxes = Boxes.between([(0, 0, 0), (5, 0, 0)], [(1, 1, 1), (6, 1, 1)])
    clusters = casters.Clusters(None, boxes, boxes, np.array([0, 1]), np.array([0, 1]))
    assert clusters.one_sided(None if light is None else np.array(light)).tolist() == one_sided


def perspective(least_q=-np.inf):
    """Rows x, y, w, q of a camera at the origin that looks along +Z with 45 degrees to each side."""
    return np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])


@pytest.mark.parametrize(
    ("low", "high", "seen"),
    [
        ((-1, -1, 2), (1, 1, 3), True),
        ((-1, -1, -3), (1, 1, -2), False),  # behind the eye
        ((4, -1, 2), (5, 1, 3), False),  # beside the view
        ((2.5, -1, 2), (5, 1, 3), True),  # partly in it
        ((-9, -9, -9), (9, 9, 9), True),  # around the eye
    ],
)
def test_boxes_are_seen_as_far_as_they_reach_into_the_view(low, high, seen):
    assert Boxes.between([low], [high]).seen(perspective())[0] == seen


def test_casters_behind_all_receivers_are_not_drawn():
    boxes = Boxes.between([(-1, -1, 2), (-1, -1, 6), (-1, -1, -1)], [(1, 1, 3), (1, 1, 7), (1, 1, 9)])
    assert boxes.seen(perspective(), least_q=1 / 5.0).tolist() == [True, False, True]


def test_no_box_with_a_corner_in_view_is_left_out():
    rng = np.random.default_rng(3)
    low = rng.uniform(-5, 5, (500, 3))
    high = low + rng.uniform(0, 3, (500, 3))
    corners = low[:, None] + np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, -1).T * (high - low)[:, None]
    x, y, w = np.moveaxis(corners, -1, 0)
    visible = ((w > 0) & (np.abs(x) <= w) & (np.abs(y) <= w) & (1 / np.where(w > 0, w, 1) >= 0.25)).any(axis=1)
    assert visible.any()
    assert Boxes.between(low, high).seen(perspective(), least_q=0.25)[visible].all()


def test_neighbouring_groups_of_one_batch_are_one_call():
    a, b = SimpleNamespace(triangles=10), SimpleNamespace(triangles=1)
    draws = [SimpleNamespace(batch=x, first=f, count=c) for x, f, c in ((a, 0, 2), (a, 2, 3), (a, 9, 1), (b, 0, 1))]
    found = [(call.draw.batch is a, call.first, call.count) for call in calls(draws, [0, 1, 2, 3])]
    assert found == [(True, 0, 5), (True, 9, 1), (False, 0, 1)]


def test_what_lies_between_two_runs_is_drawn_where_a_call_costs_more(monkeypatch):
    first, seen = np.array([0, 10, 20, 520, 530]), np.array([True, False, True, True])
    for triangle, expected in ((1.0, [(0, 530)]), (100.0, [(0, 10), (20, 510)])):
        costs = SimpleNamespace(triangle=triangle, python=500.0)
        monkeypatch.setattr(culling.device, "current", lambda costs=costs: costs)
        assert culling.joined(first, seen) == expected
    assert culling.joined(first, np.zeros(4, bool)) == []


def test_runs_of_clusters_cover_exactly_what_is_seen():
    batch = SimpleNamespace(triangles=2 * casters.CLUSTER + 7)
    clusters = casters.Clusters(batch, None)
    size = casters.CLUSTER
    assert list(clusters.runs(np.array([True, True, True]))) == [(0, 2 * size + 7)]
    assert list(clusters.runs(np.array([True, False, True]))) == [(0, size), (2 * size, 7)]
    assert list(clusters.runs(np.array([False, False, False]))) == []
