"""Points by area and the tree over them: laws that hold for every cloud of points."""

from dataclasses import replace

import numpy as np
import pytest

from addon.gfx import images, passes
from addon.scene.area_points import AreaPoints, Surfaces, spread
from addon.scene.point_tree import COVER, FLAT, fitted, split

SOURCE = """
#include "lib/math.glsl"
#include "micro/warp.glsl"
void main()
{
  vec2 square = gl_FragCoord.xy / side * 2.0 - 1.0;
  vec2 disc = disc_of_square(square);
  out_places = vec4(disc, square_of_disc(disc) - square);
}
"""
WARP = passes.fullscreen_program(
    "warp there and back",
    "generated/warp",
    constants=(("FLOAT", "side"),),
    outputs=(("VEC4", "out_places"),),
    snippets=(("generated/warp", SOURCE),),
)


def surfaces(corners, opacity=1.0):
    corners = np.asarray(corners, float)
    return Surfaces((), corners, np.full(len(corners), opacity), np.zeros(len(corners), int), np.arange(len(corners)))


def square(z=0.0):
    a, b, c, d = (0, 0, z), (1, 0, z), (1, 1, z), (0, 1, z)
    return [(a, b, c), (a, c, d)]


def cloud(seed, count=256):
    drawn = np.random.default_rng(seed)
    normals = drawn.normal(size=(count, 3))
    return drawn.random((count, 3)), normals / np.linalg.norm(normals, axis=1, keepdims=True), drawn.random(count)


def ancestors(leaf):
    while leaf > 1:
        leaf //= 2
        yield leaf


def test_triangles_have_points_by_their_area_and_opacity():
    large, small = np.array(square()), np.array(square(1.0)) * (0.5, 0.5, 1)
    points = spread(surfaces(np.concatenate([large, small])), 1000, 0)
    assert np.bincount(points.triangle, minlength=4) == pytest.approx([400, 400, 100, 100], abs=1)
    _, _, areas = points.placed(surfaces(np.concatenate([large, small])))
    assert areas.sum() == pytest.approx(1.25)


@pytest.mark.parametrize("run", [0, 5])
def test_their_discs_leave_few_holes_and_lie_where_they_say(run):
    shown = surfaces(square(), opacity=0.99)
    position, normal, areas = spread(shown, 1024, run).placed(shown)
    assert (position[:, 2] == 0).all() and (normal == (0, 0, 1)).all()
    asked = np.random.default_rng(1).random((4000, 2)) * 0.9 + 0.05
    nearest = ((asked[:, None] - position[None, :, :2]) ** 2).sum(axis=2).min(axis=1)
    assert (nearest > COVER**2 * areas[0] / np.pi).mean() < 0.012


@pytest.mark.parametrize("run", [0, 3])
def test_pieces_cover_their_triangles_once(run):
    """As many as there are points; each place of two triangles lies in one piece, and each point in its own."""
    shown = surfaces(np.array(square()) * (3, 1, 1))
    points = spread(shown, 500, run)
    pieces, (position, _, areas) = points.pieces(shown), points.placed(shown)
    assert areas.sum() == pytest.approx(3.0) and areas.max() < 4.1 * areas.mean()
    asked = np.random.default_rng(run).random((500, 2)) * (3, 1)
    assert (inside(pieces, asked).sum(axis=1) == 1).all()
    assert inside(pieces, position[:, :2]).diagonal().all()


def inside(pieces, asked):
    """(asked, pieces): whether places lie in triangles of the plane."""
    e1, e2 = (pieces[:, k, :2] - pieces[:, 0, :2] for k in (1, 2))
    off = asked[:, None] - pieces[None, :, 0, :2]
    across = e1[:, 0] * e2[:, 1] - e1[:, 1] * e2[:, 0]
    u = (off[..., 0] * e2[:, 1] - off[..., 1] * e2[:, 0]) / across
    v = (e1[:, 0] * off[..., 1] - e1[:, 1] * off[..., 0]) / across
    return (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9)


def test_the_smallest_of_many_triangles_and_what_lets_light_pass_have_discs():
    small = np.array(square()) * 1e-2 + (5, 0, 0)
    shown = surfaces(np.concatenate([square(), *(small + (k, 0, 0) for k in range(40))]))
    points = spread(shown, 64, 0)
    assert len(points) == 64
    whole = np.isfinite(points.piece[:, 0, 0])
    assert len(np.unique(points.triangle[whole])) == 32 and {0, 1} <= set(points.triangle[whole])
    assert whole.sum() == 63  # all others have a thousandth of the area
    assert np.isnan(spread(surfaces(square(), opacity=0.5), 64, 0).piece).all()


@pytest.mark.parametrize("opacity", [1.0, 0.5])
def test_what_nothing_sees_has_few_points_that_stand_for_all_of_it(opacity):
    both = np.concatenate([square(), square(1.0)])
    shown = replace(surfaces(both, opacity), rate=np.array([1, 1, 1 / 16, 1 / 16]))
    points = spread(shown, 1024, 0)
    assert (points.triangle >= 2).sum() == pytest.approx(1024 / 17, abs=2)
    _, _, area = points.placed(shown)
    own = points.triangle >= 2
    assert area[own].sum() == pytest.approx(opacity, rel=0.05) and area[~own].sum() == pytest.approx(opacity, rel=0.05)


def test_every_triangle_of_few_has_a_piece():
    small = np.array(square()) * 1e-2 + (5, 0, 0)
    shown = surfaces(np.concatenate([square(), *(small + (k, 0, 0) for k in range(10))]))
    points = spread(shown, 64, 0)
    assert set(points.triangle) == set(range(22))
    assert points.placed(shown)[2].sum() == pytest.approx(shown.areas().sum())


def tree_of(shown, count, run=0):
    points = spread(shown, count, run)
    return points, fitted(np.arange(count), *points.placed(shown), points.pieces(shown), points.sides(shown))


def test_groups_of_a_turned_wall_are_its_halves_halved():
    """All groups of one triangle's points are drawn as the triangle that they cover; of both as the rectangle."""
    turn = np.array([[np.cos(0.6), np.sin(0.6), 0], [-np.sin(0.6), np.cos(0.6), 0], [0, 0, 1.0]])
    shown = surfaces((np.array(square()) * (2, 1, 1)) @ turn)
    _, tree = tree_of(shown, 512, run=1)  # of run 0 one triangle has a point of the other
    assert tree.flat[1] and tree.piece[2:].all()
    np.testing.assert_allclose(tree.disc[2:] * tree.half[2:, 1], tree.area[2:], rtol=1e-9)
    across = np.cross(tree.axis, tree.along)
    corners = (
        tree.centre - tree.disc[:, None] * tree.along,
        tree.centre + tree.disc[:, None] * tree.along,
        tree.centre + tree.half[:, :1] * tree.along + tree.half[:, 1:] * across,
    )
    for corner in corners:
        back = corner[2:] @ turn.T
        assert np.maximum(np.maximum(-back, back - (2, 1, 0)), 0).max() < 1e-9


@pytest.mark.parametrize("run", [0, 3])
def test_groups_of_a_triangle_with_any_number_of_points_are_pieces_of_it(run):
    """Beside others of other sizes: where a heap parts its leaves, there the triangle is cut."""
    shown = surfaces(
        np.concatenate([square(), np.array(square(1.0)) * (0.7, 0.6, 1), np.array(square(2.0)) * (0.3, 1, 1)])
    )
    points, tree = tree_of(shown, 512, run)
    assert points.placed(shown)[2].sum() == pytest.approx(shown.areas().sum())
    for node in range(1, 512):
        level = node.bit_length() - 1
        below = points.triangle[(node << 9 >> level) - 512 : ((node + 1) << 9 >> level) - 512]
        if (below == below[0]).all():
            assert tree.piece[node]
            assert tree.disc[node] * tree.half[node, 1] == pytest.approx(tree.area[node], rel=1e-6)


def test_runs_do_not_repeat_each_other():
    shown = surfaces(square())
    first, second = (spread(shown, 64, run).placed(shown)[0] for run in (0, 1))
    assert not (first[:, None] == second[None]).all(axis=2).any()


def test_points_follow_a_triangle_that_grows():
    shown = surfaces(square())
    points = spread(shown, 128, 0)
    grown = surfaces(np.array(square()) * (2, 1, 1))
    before, after = points.placed(shown), points.placed(grown)
    np.testing.assert_allclose(after[0], before[0] * (2, 1, 1))
    np.testing.assert_allclose(after[2], 2 * before[2])


@pytest.mark.parametrize("corners", [np.zeros((0, 3, 3)), np.zeros((2, 3, 3)), np.full((1, 3, 3), np.nan)])
def test_what_has_no_area_has_no_points(corners):
    assert len(spread(surfaces(corners), 64, 0)) == 0


def test_a_group_holds_the_discs_and_normals_of_its_points():
    positions, normals, areas = cloud(1)
    order = split(positions, normals)
    assert sorted(order) == list(range(256))
    tree = fitted(order, positions, normals, areas)
    for leaf in range(256, 512):
        for group in ancestors(leaf):
            away = np.linalg.norm(tree.centre[leaf] - tree.centre[group])
            assert away + tree.disc[leaf] <= tree.radius[group] + 1e-9
            assert tree.axis[leaf] @ tree.axis[group] >= tree.cone[group] - 1e-9
    assert tree.area[1] == pytest.approx(areas.sum())


def test_a_tree_that_is_refitted_after_a_rigid_motion_is_the_tree_that_moved():
    positions, normals, areas = cloud(2)
    order = split(positions, normals)
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    before = fitted(order, positions, normals, areas)
    after = fitted(order, positions + (3, -1, 2), normals, areas)
    np.testing.assert_allclose(after.centre[1:], before.centre[1:] + (3, -1, 2))
    np.testing.assert_allclose(after.radius, before.radius, atol=1e-12)
    turned = fitted(order, positions, normals @ turn.T, areas)
    np.testing.assert_allclose(turned.cone, before.cone, atol=1e-9)


def test_two_walls_that_meet_part_into_flat_groups():
    """Medians cut beside the edge, not at it: some group stays bent on each level, and has an ever smaller share."""
    wall = np.array(square())
    shown = surfaces(np.concatenate([wall, wall[..., [2, 0, 1]]]))
    positions, normals, areas = spread(shown, 1024, 0).placed(shown)
    tree = fitted(split(positions, normals), positions, normals, areas)
    for level in (16, 64, 256):
        own = slice(level, 2 * level)
        assert tree.area[own][tree.cone[own] < FLAT].sum() < 3.0 / np.sqrt(level) * tree.area[1]


@pytest.mark.parametrize("places", [np.zeros((64, 3)), np.array([[1.0, 0, 0]] * 32 + [[0, 1, 0]] * 32)])
def test_points_in_one_place_make_a_tree(places):
    tree = fitted(split(places, np.array([[0, 0, 1.0]] * 64)), places, np.array([[0, 0, 1.0]] * 64), np.ones(64))
    assert np.isfinite(tree.packed()).all()
    assert (tree.cone[1:] > 0.999).all()


def test_points_of_nothing_are_none():
    points = AreaPoints(np.zeros(0, int), np.zeros((0, 2)), np.zeros(0), np.zeros(0), np.zeros((0, 3, 2)))
    assert len(points.placed(surfaces(np.zeros((0, 3, 3))))[0]) == 0


def test_a_square_and_a_disc_are_mapped_to_each_other_in_equal_areas(gpu_context):
    """The shares of rings and sectors of the disc, and the way back."""
    with images.borrowed(1024, 1024, "RGBA32F") as target:
        passes.fullscreen(WARP, target, constants={"side": 1024.0})
        places = images.read(target.colors[0]).reshape(-1, 4)
    assert np.abs(places[:, 2:]).max() < 1e-4
    radius, turn = np.hypot(*places[:, :2].T), np.arctan2(places[:, 1], places[:, 0])
    assert radius.max() <= 1.0
    rings = np.histogram(radius**2, 16, (0, 1))[0] / len(places)
    sectors = np.histogram(turn, 16, (-np.pi, np.pi))[0] / len(places)
    np.testing.assert_allclose(rings, 1 / 16, rtol=0.05)
    np.testing.assert_allclose(sectors, 1 / 16, rtol=0.05)
