"""The hierarchy that rays search, on the CPU's side: triangles that move keep their places, and boxes follow them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from addon.frame.settings import Settings
from addon.gfx import images
from addon.materials.compiler import compile_material
from addon.scene import acceleration, instance_tree
from addon.scene.acceleration import HierarchyCache
from addon.scene.emission_maps import EmissionMaps
from addon.scene.opacity_maps import OpacityMaps
from addon.snapshot.scene import Material
from tests.frame.test_plan import room
from tests.materials.graphs import graph, node


@pytest.fixture
def triangles(gpu_context):
    rng = np.random.default_rng(4)
    corners = rng.uniform(-1, 1, (300, 1, 3)) + rng.uniform(-0.1, 0.1, (300, 3, 3))
    return corners.astype(np.float32), rng.uniform(0, 1, (300, 8))


def test_moved_triangles_keep_their_places_and_boxes_follow_them(triangles):
    corners, look = triangles
    numbers = np.arange(40, 70)
    moved = corners.copy()
    moved[numbers] += np.float32(2.5)
    trees = acceleration.build(corners, look)
    order = trees.world.place.copy()
    assert trees.move(numbers, (moved[numbers], look[numbers]), {}) and trees.moved
    tree = trees.world
    assert np.array_equal(tree.place, order)
    leaf, slot = order // acceleration.LEAF, order % acceleration.LEAF
    assert np.array_equal(tree.leaves[leaf, :3, slot], moved[:, 0])
    assert np.array_equal(tree.leaves[leaf, 3:6, slot], moved[:, 1] - moved[:, 0])
    assert np.array_equal(tree.low[order], moved.min(axis=1))
    assert np.array_equal(tree.high[order], moved.max(axis=1))


def test_nodes_above_what_moved_are_those_of_boxes_made_anew(triangles):
    corners, look = triangles
    trees = acceleration.build(corners, look)
    rng = np.random.default_rng(5)
    for _ in range(3):
        numbers = rng.choice(300, 20, replace=False)
        corners[numbers] += rng.uniform(-1, 1, (20, 1, 3)).astype(np.float32)
        assert trees.move(numbers, (corners[numbers], look[numbers]), {})
    boxes = trees.world.boxes
    whole = acceleration.NodeBoxes(boxes.tree, *acceleration._of_leaves(trees.world.low, trees.world.high))
    assert np.array_equal(boxes.low, whole.low) and np.array_equal(boxes.high, whole.high)
    assert boxes.cost() == whole.cost() > trees.world.cost
    # The images hold the same as the CPU's side.
    nodes = images.read(trees.hierarchy.nodes).reshape(-1, 4)[: 4 * len(boxes.rows)]
    assert np.array_equal(nodes.reshape(boxes.rows.shape), boxes.rows)
    leaves = images.read(trees.hierarchy.leaves).reshape(-1, 4)[: trees.world.leaves.size // 4]
    assert np.array_equal(leaves.ravel(), trees.world.leaves.ravel())


def test_triangle_that_is_not_finite_is_left_out_and_not_moved(triangles):
    corners, look = triangles
    corners[3, 1, 2] = np.nan
    trees = acceleration.build(corners, look)
    assert trees.hierarchy.triangles == 299
    place = trees.world.place
    assert place[3] == -1 and len(set(np.delete(place, 3))) == 299
    assert not trees.move(np.array([3]), (np.zeros((1, 3, 3), np.float32), look[:1]), {})
    assert not trees.move(np.array([4]), (corners[3:4], look[:1]), {})


def seen_by(snapshot):
    """What a hierarchy asks of a draft's frame."""
    return SimpleNamespace(
        snapshot=snapshot, geometry=SimpleNamespace(origin=np.zeros(3)), settings=Settings().as_draft(),
        measured_materials=[compile_material(one.name, one.graph) for one in snapshot.materials],
        opacity_maps=OpacityMaps(), emission_maps=EmissionMaps(),
    )  # fmt: skip


@pytest.mark.parametrize("before", [0.0, np.nan])
def test_copy_that_grows_from_a_point_is_met(gpu_context, monkeypatch, before):
    monkeypatch.setattr(instance_tree, "OWN_TREE", 1)
    snapshot, matrices = room(), np.repeat(np.eye(4)[None], 8, axis=0)
    matrices[:, 0, 3] = np.arange(8)
    matrices[7, :3, :3] *= before

    def with_copies():
        copies = tuple(replace(snapshot.instances[0], matrix=matrix.copy()) for matrix in matrices)
        return seen_by(replace(snapshot, instances=copies))

    cache = HierarchyCache()
    first = cache.get(with_copies(), "glossy")
    matrices[6, 1, 3] = 1.0
    assert cache.get(with_copies(), "glossy").nodes is first.nodes  # boxes have followed
    matrices[7, :3, :3] = np.eye(3)
    grown, fresh = (one.get(with_copies(), "glossy") for one in (cache, HierarchyCache()))
    assert np.array_equal(images.read(grown.nodes), images.read(fresh.nodes))


@pytest.mark.parametrize("own_tree", [1, 1000])
def test_open_glass_is_a_sheet_unless_another_face_lies_behind_it(gpu_context, monkeypatch, own_tree):
    """Two open faces that look apart, one behind the other, are a pane, also while one of them moves, or in a tree of
    their own; once one of them is turned, or moved aside, both are sheets."""
    monkeypatch.setattr(instance_tree, "OWN_TREE", own_tree)
    glass = graph(
        node("Glass", "ShaderNodeBsdfGlass", {"BSDF": "SHADER"}, Color=(1, 1, 1, 1), Roughness=0.0, IOR=1.5),
        surface=("Glass", "BSDF"),
    )
    whole = room()
    opaque, away = replace(whole.instances[0], materials=(1,)), np.diag([1, 1, -1, 1.0])[[1, 0, 2, 3]]
    clear, mesh = Material("glass", "glass", glass), whole.meshes["mesh"]
    flat = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    whole = replace(
        whole, materials=(clear, *whole.materials),
        meshes={"mesh": replace(mesh, positions=flat), "wall": replace(mesh, key="wall")},
    )  # fmt: skip

    def with_second(matrix, height, aside=0.0):
        matrix = matrix.copy()
        matrix[0, 3], matrix[2, 3] = aside, height
        two = whole.instances[0], replace(whole.instances[0], matrix=matrix)
        rest = tuple(replace(opaque, mesh="wall") for _ in range(8))
        return seen_by(replace(whole, instances=(*two, *rest)))

    def is_sheet(cache, *placed):
        return ("GLASS_SHEETS", "1") in cache.get(with_second(*placed), "glossy").leaves.defines

    cache = HierarchyCache()
    assert not is_sheet(cache, away, -0.1)
    assert not is_sheet(cache, away, -0.2)  # a draft moves what has moved alone
    assert is_sheet(cache, np.eye(4), -0.2)
    assert not is_sheet(cache, away, -0.2)
    assert is_sheet(cache, away, -0.2, 5.0)
