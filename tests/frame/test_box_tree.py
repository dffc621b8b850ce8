"""The tree of boxes that rays search: complete, tight, bounded in depth, and good."""

import time

import numpy as np
import pytest

from addon.scene import box_tree

RNG = np.random.default_rng(7)


def random_boxes(count):
    low = RNG.uniform(-1, 1, (count, 3)).astype(np.float32)
    return low, low + RNG.uniform(0, 0.1, (count, 3)).astype(np.float32)


def nested(count, factor):
    """Boxes around one corner, each `factor` times as large as the one before."""
    size = np.float32(factor) ** np.arange(count, dtype=np.float32)
    return np.zeros((count, 3), np.float32), np.repeat(size[:, None], 3, axis=1)


def grid(side):
    low = np.stack(np.meshgrid(*[np.arange(side, dtype=np.float32)] * 2, [0.0]), axis=-1).reshape(-1, 3)
    return low, low + np.array([1, 1, 0], np.float32)


CASES = {
    "none": random_boxes(0),
    "one": random_boxes(1),
    "one leaf": random_boxes(4),
    "two leaves": random_boxes(5),
    "many": random_boxes(5000),
    "nested": nested(120, 1.9),
    "grid": grid(64),
    "all alike": tuple(np.repeat(corner, 3000, axis=0) for corner in random_boxes(1)),
    "points": (np.zeros((77, 3), np.float32), np.zeros((77, 3), np.float32)),
    "huge": tuple(1e30 * corner for corner in random_boxes(300)),
}


def corners(tree, low, high):
    """Corners of every node's children, from those of the boxes."""
    slots = tree.leaf_count * box_tree.LEAF
    leaf_low, leaf_high = np.full((slots, 3), np.inf, np.float32), np.full((slots, 3), -np.inf, np.float32)
    leaf_low[tree.place], leaf_high[tree.place] = low, high
    leaf_low, leaf_high = (c.reshape(-1, box_tree.LEAF, 3) for c in (leaf_low, leaf_high))
    return (
        tree.of_children(leaf_low.min(axis=1), np.minimum, np.inf),
        tree.of_children(leaf_high.max(axis=1), np.maximum, -np.inf),
    )


@pytest.mark.parametrize("case", CASES)
def test_every_box_has_one_slot_that_the_root_leads_to(case):
    low, high = CASES[case]
    tree = box_tree.build(low, high)
    assert len(set(tree.place)) == len(low)
    assert sum(tree.levels) == len(tree.nodes) and len(tree.levels) <= box_tree.DEEPEST
    seen_nodes, seen_leaves = [0], []
    for node in seen_nodes:
        seen_nodes += range(tree.first_node[node], tree.first_node[node] + tree.nodes[node])
        seen_leaves += range(tree.first_leaf[node], tree.first_leaf[node] + tree.leaves[node])
    assert seen_nodes == list(range(len(tree.nodes)))
    assert sorted(seen_leaves) == list(range(tree.leaf_count))
    assert (tree.nodes + tree.leaves <= box_tree.WIDTH).all()
    if len(low):
        first, last = corners(tree, low, high)
        assert np.array_equal(first[0].min(axis=0), low.min(axis=0))
        assert np.array_equal(last[0].max(axis=0), high.max(axis=0))


def test_same_boxes_give_the_same_tree():
    low, high = CASES["grid"]
    a, b = box_tree.build(low, high), box_tree.build(low, high)
    assert np.array_equal(a.place, b.place) and a.levels == b.levels


def test_where_clusters_would_be_too_deep_halves_of_the_order_are_taken(monkeypatch):
    low, high = CASES["many"]
    monkeypatch.setattr(box_tree, "MOST_CLUSTERED", 0)
    tree = box_tree.build(low, high)
    assert len(set(tree.place)) == len(low) and len(tree.levels) <= 11
    assert tree.leaf_count < 0.6 * len(low)


def test_large_boxes_among_small_ones_do_not_enlarge_their_nodes():
    """A floor under thousands of small things: what a ray is expected to visit hardly grows."""
    visits = []
    small = random_boxes(4000)
    for large in (0, 8):
        walls = np.full((large, 3), -1, np.float32), np.full((large, 3), 1.1, np.float32)
        low, high = (np.concatenate(pair) for pair in zip(small, walls))
        first, last = corners(box_tree.build(low, high), low, high)
        extent = np.maximum(last - first, 0)
        area = extent[..., 0] * extent[..., 1] + extent[..., 1] * extent[..., 2] + extent[..., 2] * extent[..., 0]
        visits.append(area.sum() / area[0].max())
    assert visits[1] < visits[0] + 16


@pytest.mark.timing
def test_building_takes_few_microseconds_per_box():
    low, high = random_boxes(100_000)
    started = time.perf_counter()
    box_tree.build(low, high)
    assert time.perf_counter() - started < 1.0  # 0.1 s on a quiet machine
