"""Edits of reflections: the solve against closed forms and numpy, distances along meshes, and pictures."""

import time

import bpy
import numpy as np
import pytest

from addon import engine
from addon.gfx import images, passes
from addon.snapshot.bound_points import bound
from addon.snapshot.own_settings import own_settings
from addon.surfaces import geodesic, reflection_edits
from addon.surfaces.reflection_edits import (
    EUCLIDEAN,
    MOST_LAYERS,
    PAINTED,
    SOLVE,
    Constraint,
    Region,
    edit_table,
    influence,
    mirrored,
)
from bench.reflection_costs import torus

UP = np.array([0.0, 0.0, 1.0])
EVERYWHERE = Region(EUCLIDEAN, np.zeros(3), 1e6, 0.0)


def unit(*v):
    return np.asarray(v, float) / np.linalg.norm(v)


def about(axis, degrees):
    """(3, 3) rotation about an axis."""
    x, y, z = unit(*axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = np.radians(degrees)
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def pair(place, before, after):
    return Constraint(np.asarray(place, float), np.asarray(before, float), np.asarray(after, float), UP)


def matrices(quaternions):
    """(N, 3, 3) of quaternions (N, 4), x y z w."""
    x, y, z, w = quaternions.T.astype(float)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def solved(constraints, places, directions, regions=(EVERYWHERE,), extent=1.0):
    """(N, 4) quaternions that the GPU finds."""
    places, directions = np.broadcast_arrays(np.atleast_2d(places), np.atleast_2d(directions))
    members = [
        sum(
            1 << n
            for n, one in enumerate(constraints)
            if reflection_edits.influence(region, np.linalg.norm(one.place - region.centre)) > 0
        )
        for region in regions
    ]
    table = edit_table(constraints, regions, members, extent)
    shaped = [np.pad(a, ((0, 0), (0, 1)))[None].astype(np.float32) for a in (places, directions)]
    with images.borrowed(len(places), 1, "RGBA32F") as target:
        passes.fullscreen(
            SOLVE,
            target,
            textures={"places": images.upload(shaped[0]), "directions": images.upload(shaped[1])},
            blocks={"edits": table.block},
            constants=table.constants,
        )
        return images.read(target.colors[0])[0]


def edited(constraints, places, directions, **options):
    """(N, 3) directions after the edit."""
    q = solved(constraints, places, directions, **options)
    turned = np.einsum("nij,nj->ni", matrices(q), np.broadcast_to(directions, (len(q), 3)))
    return np.where((q**2).sum(axis=1, keepdims=True) > 0, turned, directions)


def degrees_between(a, b):
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(axis=-1)))


pytestmark = pytest.mark.usefixtures("gpu_context")


def test_influence_falls_smoothly_from_one_to_zero_across_the_border():
    """1 - (3 t^2 - 2 t^3) across the border, with no slope at either end; without a border a step."""
    t = np.linspace(-1.0, 2.0, 61)
    inside = np.clip(t, 0.0, 1.0)
    found = influence(Region(EUCLIDEAN, np.zeros(3), 2.0, 0.5), 1.5 + 0.5 * t)
    assert found == pytest.approx(1.0 - 3.0 * inside**2 + 2.0 * inside**3, abs=1e-12)
    assert influence(Region(EUCLIDEAN, np.zeros(3), 2.0, 0.0), np.array([1.99, 2.01])).tolist() == [1.0, 0.0]
    assert influence(Region(PAINTED, np.zeros(3), 2.0, 0.5), np.array([-1.0, 0.25, 7.0])).tolist() == [0.0, 0.25, 1.0]


def test_one_constraint_is_the_shortest_way_everywhere():
    before, after = unit(0.2, -0.3, 1), unit(1, 0.5, 0.4)
    places = np.random.default_rng(1).normal(size=(50, 3))
    found = edited([pair((0, 0, 0), before, after)], places, before)
    assert degrees_between(found, after).max() < 0.03
    axis = np.cross(before, after)
    assert degrees_between(edited([pair((0, 0, 0), before, after)], places, unit(*axis)), unit(*axis)).max() < 0.03


def test_between_two_constraints_angles_blend_by_inverse_squares():
    turned = [about((0, 1, 0), angle) @ UP for angle in (20, 60)]
    constraints = [pair((x, 0, 0), UP, after) for x, after in zip((0, 1), turned)]
    places = np.stack([[0.1, 0.25, 0.5, 0.75, 0.9], np.zeros(5), np.zeros(5)], axis=1)
    found = degrees_between(edited(constraints, places, UP), UP)
    assert found == pytest.approx([20.45, 23.76, 40.0, 56.23, 59.55], abs=0.05)


def test_constraints_that_change_nothing_change_nothing():
    rng = np.random.default_rng(2)
    constraints = [pair(rng.normal(size=3), v, v) for v in (unit(*rng.normal(size=3)) for _ in range(5))]
    r = np.array([unit(*v) for v in rng.normal(size=(40, 3))])
    assert np.abs(edited(constraints, rng.normal(size=(40, 3)), r) - r).max() < 1e-5


def test_one_rotation_for_all_constraints_is_reproduced():
    turn, rng = about((1, 2, 3), 50), np.random.default_rng(3)
    before = [unit(*rng.normal(size=3)) for _ in range(4)]
    constraints = [pair(rng.normal(size=3), r, turn @ r) for r in before]
    r = np.array([unit(*v) for v in rng.normal(size=(40, 3))])
    # Where one constraint outweighs the others, what resolves its spin is of the prior's size.
    found = edited(constraints, rng.normal(size=(40, 3)), r)
    assert np.median(degrees_between(found, r @ turn.T)) < 0.05
    assert degrees_between(found, r @ turn.T).max() < 0.5


@pytest.mark.parametrize(
    "angle, expected", [(90, (33.69, 63.43, 80.54)), (30, (11.93, 20.10, 25.83)), (170, (18.6, 160.3, None))]
)
def test_fades_bend_as_the_closed_form_says(angle, expected):
    """psi(a) = atan2(2 a sin phi, 2 a cos phi + 1 - a) for rotations about an axis at right angles."""
    constraints = [pair((0, 0, 0), UP, about((0, 1, 0), angle) @ UP)]
    for a, psi in zip((0.25, 0.5, 0.75), expected):
        roots = np.roots([-2, 3, 0, -(1 - a)])  # of 1 - smoothstep = a
        t = float(next(root.real for root in roots if abs(root.imag) < 1e-9 and 0 <= root.real <= 1))
        region = Region(EUCLIDEAN, np.zeros(3), 2.0, 1.0)
        found = degrees_between(edited(constraints, [(1 + t, 0, 0)], UP, regions=(region,)), UP)[0]
        phi = np.radians(angle)
        assert found == pytest.approx(np.degrees(np.arctan2(2 * a * np.sin(phi), 2 * a * np.cos(phi) + 1 - a)), abs=0.3)
        if psi is not None and angle < 120:
            assert found == pytest.approx(psi, abs=0.1)


def test_outside_of_regions_nothing_is_solved():
    region = Region(EUCLIDEAN, np.zeros(3), 1.0, 0.5)
    constraints = [pair((0, 0, 0), UP, unit(1, 0, 1))]
    assert not solved(constraints, [(1.0001, 0, 0), (5, 0, 0)], UP, regions=(region,)).any()
    assert solved(constraints, [(0.9, 0, 0)], UP, regions=(region,)).any()


@pytest.mark.parametrize("away", [1e-2, 1e-4, 1e-6])
def test_edits_interpolate_at_their_constraints(away):
    rng = np.random.default_rng(4)
    constraints = [pair(p, unit(*rng.normal(size=3)), unit(*rng.normal(size=3))) for p in rng.normal(size=(8, 3)) * 3]
    for one in constraints:
        found = edited(constraints, [one.place + (away, 0, 0)], one.before, extent=1e-3)
        assert degrees_between(found, one.after).max() < max(0.05, 60 * away)


def test_turning_scaling_and_reordering_change_nothing():
    rng = np.random.default_rng(5)
    constraints = [pair(p, unit(*rng.normal(size=3)), unit(*rng.normal(size=3))) for p in rng.normal(size=(5, 3))]
    places, r = rng.normal(size=(30, 3)), np.array([unit(*v) for v in rng.normal(size=(30, 3))])
    plain = edited(constraints, places, r)
    turn = about((1, -1, 2), 75)
    turned = [pair(turn @ c.place, turn @ c.before, turn @ c.after) for c in constraints]
    assert np.abs(edited(turned, places @ turn.T, r @ turn.T) - plain @ turn.T).max() < 2e-3
    scaled = [pair(100 * c.place, c.before, c.after) for c in constraints]
    assert np.abs(edited(scaled, 100 * places, r, extent=100.0) - plain).max() < 2e-3
    assert np.abs(edited(constraints[::-1], places, r) - plain).max() < 2e-3


def test_the_solve_agrees_with_singular_values():
    rng = np.random.default_rng(6)
    constraints = [pair(p, unit(*rng.normal(size=3)), unit(*rng.normal(size=3))) for p in rng.normal(size=(32, 3))]
    places = rng.normal(size=(100, 3))
    found = matrices(solved(constraints, places, UP))
    assert np.linalg.det(found) == pytest.approx(1.0, abs=1e-4)
    worst = []
    for place, rotation in zip(places, found):
        weights = np.array([1 / ((c.place - place) @ (c.place - place)) for c in constraints])
        weights /= weights.max()
        b = sum(w * np.outer(c.after, c.before) for w, c in zip(weights, constraints)) + 1e-4 * np.eye(3)
        u, _, v = np.linalg.svd(b)
        best = u @ np.diag([1, 1, np.linalg.det(u @ v)]) @ v
        cost = [sum(w * ((r @ c.before - c.after) ** 2).sum() for w, c in zip(weights, constraints))
                for r in (rotation, best)]  # fmt: skip
        worst.append(cost[0] / cost[1] - 1)
    assert max(worst) < 1e-3


@pytest.mark.parametrize("case", ["opposite", "coincident", "empty region", "no border"])
def test_stress_stays_finite(case):
    before = unit(0.3, 0.1, 1)
    constraints, region = [pair((0, 0, 0), before, -before)], EVERYWHERE
    if case == "coincident":
        constraints = [pair((0, 0, 0), before, unit(1, 0, 0)), pair((0, 0, 0), before, unit(-1, 0, 0))]
    if case == "empty region":
        region = Region(EUCLIDEAN, np.zeros(3), 0.0, 0.5)
    if case == "no border":
        region = Region(EUCLIDEAN, np.zeros(3), 1.0, 0.0)
    places = [(0, 0, 0), (1e-6, 0, 0), (0.5, 0, 0), (0.999, 0, 0), (1.001, 0, 0)]
    q = solved(constraints, places, before, regions=(region,))
    size = np.linalg.norm(q, axis=1)
    assert np.isfinite(q).all() and (np.isclose(size, 1, atol=1e-5) | (size == 0)).all()
    if case == "opposite":
        assert degrees_between(edited(constraints, places, before), -before).max() < 1.0


# Distances along surfaces -------------------------------------------------------------------------------------------


def grid(n, height=0.0):
    axis = np.linspace(0, 1, n)
    positions = np.stack([*np.meshgrid(axis, axis, indexing="ij"), np.full((n, n), height)], axis=-1).reshape(-1, 3)
    k = np.arange(n * n).reshape(n, n)
    a, b, c, d = (part.reshape(-1) for part in (k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]))
    return positions, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def test_distances_on_a_grid_are_at_most_a_twelfth_too_long():
    positions, triangles = grid(41)
    middle = len(positions) // 2
    found = geodesic.distances(geodesic.neighbours(positions, triangles), np.array([middle]), np.zeros(1))
    straight = np.linalg.norm(positions - positions[middle], axis=1)
    assert (found >= straight - 1e-9).all()
    apart = straight > 0
    assert (found[apart] / straight[apart]).max() == pytest.approx(1.0824, abs=1e-3)


def test_sheets_that_no_path_joins_are_unreached_and_a_fold_is_gone_around():
    low, triangles = grid(11)
    both = np.concatenate([low, low + (0, 0, 0.01)])
    faces = np.concatenate([triangles, triangles + len(low)])
    found = geodesic.distances(geodesic.neighbours(both, faces), np.array([0]), np.zeros(1))
    assert (found[len(low) :] == geodesic.UNREACHED).all()
    edge = np.arange(110, 121)  # x = 1 of the lower sheet, and the same of the upper one
    seam = np.stack([edge[:-1], edge[1:], edge[1:] + len(low)], axis=1)
    joined = geodesic.distances(geodesic.neighbours(both, np.concatenate([faces, seam])), np.array([0]), np.zeros(1))
    assert joined[len(low)] == pytest.approx(2.0, rel=0.05)


def test_the_nearest_place_of_a_mesh():
    positions, triangles = grid(5)
    triangle, weights = geodesic.nearest(positions, triangles, np.array([0.3, 0.6, 0.5]))
    assert weights @ positions[triangles[triangle]] == pytest.approx([0.3, 0.6, 0.0])
    triangle, weights = geodesic.nearest(positions, triangles, np.array([-1.0, 0.6, 0.0]))
    assert weights @ positions[triangles[triangle]] == pytest.approx([0.0, 0.6, 0.0])


@pytest.mark.parametrize("reach", [0.0, 0.2, 1.0])
def test_a_search_with_an_end_finds_the_same_distances_up_to_it(reach):
    """Also at all corners of triangles that `reach` crosses, between which distances are interpolated."""
    positions, triangles = torus(60)
    graph = geodesic.neighbours(positions, triangles)
    seeds, at = triangles[40], np.array([0.01, 0.02, 0.03])
    whole = geodesic.distances(graph, seeds, at)
    found = geodesic.distances(graph, seeds, at, reach)
    crossed = (whole[triangles] <= reach).any(axis=1)
    assert np.array_equal(found[triangles[crossed]], whole[triangles[crossed]])
    assert (found >= whole).all() and (found == geodesic.UNREACHED).any()


def test_the_nearest_place_is_that_of_all_triangles_looked_at():
    rng = np.random.default_rng(8)
    positions, triangles = torus(24)
    stray = np.concatenate([positions, [[0.5, 0.5, 5.0]]])  # a vertex that no triangle uses
    for point in rng.normal(size=(30, 3)) * 1.5:
        weights = rng.dirichlet(np.ones(3), size=(400, 1))
        samples = (weights @ positions[triangles[rng.integers(len(triangles), size=400)]])[:, 0]
        triangle, place = geodesic.nearest(stray, triangles, point)
        away = np.linalg.norm(place @ stray[triangles[triangle]] - point)
        assert away <= np.linalg.norm(positions - point, axis=1).min() + 1e-12
        assert away <= np.linalg.norm(samples - point, axis=1).min() + 1e-12
        assert geodesic.nearest(stray, triangles, point, longest=100.0)[0] == triangle


def test_a_point_that_moves_leaves_distances_from_others_as_they_are():
    surface = geodesic.Surface(*torus(24))
    stays, moves = np.array([1.4, 0.0, 0.0]), np.array([0.0, 1.4, 0.0])
    first = surface.along(stays, 1.0)
    surface.along(moves, 1.0)
    surface.begin()
    assert surface.along(stays, 1.0) is first
    surface.begin()  # `moves` has not been asked for since: it is dropped
    assert surface.along(stays, 1.0) is first and len(surface._kept) == 1


def test_half_a_million_triangles_take_seconds_and_a_moved_point_much_less():
    """Bounds are ten times what two busy cores take: 2 s for the first search, .1 s for one of a tenth of the mesh."""
    surface = geodesic.Surface(*torus(500))
    assert len(surface.triangles) == 500_000
    start = time.perf_counter()
    surface.along(np.array([1.4, 0.0, 0.0]), np.inf)
    first = time.perf_counter() - start
    start = time.perf_counter()
    surface.along(np.array([1.4, 0.01, 0.0]), 0.7)
    moved = time.perf_counter() - start
    print(f"first {first:.2f} s, moved {moved:.3f} s")
    assert first < 20.0 and moved < 1.5


# Pictures -----------------------------------------------------------------------------------------------------------


def mirror_scene(stage, roughness=0.0):
    """A mirror on the ground before a wall of two emissive halves, seen from in front."""
    metal = stage.principled(Metallic=1.0, Roughness=roughness, Base_Color=(1, 1, 1, 1))
    mirror = stage.rectangle((-2, -2), (2, 2), material=metal)
    for name, x, color in (("left", -3, (1, 0.2, 0.1, 1)), ("right", 3, (0.1, 0.2, 1, 1))):
        light = stage.material("ShaderNodeEmission", Color=color, Strength=1.0)
        stage.rectangle((-3, -6), (3, 6), material=light, location=(x, 6, 0), turn=(np.pi / 2, 0, 0)).name = name
    stage.floor(material=stage.diffuse(0.5), z=-0.5)
    stage.light("AREA", location=(0, 0, 5), size=2.0)
    stage.camera((0, -6, 3), (np.radians(65), 0, 0), 0.7)
    return mirror


def constrain(mirror, point, target, viewer, radius=10.0, border=0.0):
    settings = mirror.candela
    one = settings.reflection_editing_constraints.add()
    one.point, one.target, one.viewer = point, target, viewer
    region = settings.reflection_editing_regions.add()
    region.radius, region.border = radius, border
    mirror.update_tag()


@pytest.mark.slow
def test_without_enabled_edits_pictures_are_the_same_to_the_bit(stage):
    mirror = mirror_scene(stage)
    plain = stage.render(2, bounces=4)
    constrain(mirror, (0, 0, 0), (-3, 6, 2), (0, -6, 3))
    mirror.candela.reflection_editing_constraints[0].enabled = False
    off = stage.render(2, bounces=4)
    assert all(np.array_equal(plain[name], off[name]) for name in plain)


@pytest.mark.slow
def test_a_plane_mirror_shows_what_one_leaning_by_half_the_angle_does(stage):
    """The axis of the edit lies in the mirror: every ray is as off a mirror that is turned by half as much."""
    mirror = mirror_scene(stage)
    viewer = np.array([0.0, -6.0, 3.0])
    before = mirrored(unit(*viewer), UP)
    after = about((1, 0, 0), 16) @ before
    plain = stage.render(4, (48, 48), bounces=2)
    constrain(mirror, (0, 0, 0), tuple(10 * after), tuple(viewer))
    found = stage.render(4, (48, 48), bounces=2)
    mirror.candela.reflection_editing_constraints.clear()
    lean = about((1, 0, 0), 8) @ UP
    mirror.data.normals_split_custom_set([tuple(lean)] * 4)
    expected = stage.render(4, (48, 48), bounces=2)
    difference = np.abs(found["combined"][..., :3] - expected["combined"][..., :3])
    assert np.median(difference) < 1e-3
    assert (difference.max(axis=-1) > 0.02).mean() < 0.02  # edges between colours
    assert np.array_equal(found["diffuse_direct"], plain["diffuse_direct"])


@pytest.mark.slow
def test_pixels_outside_of_regions_do_not_change(stage):
    mirror = mirror_scene(stage)
    stage.scene.candela.denoise_strength = 0.0
    plain = stage.render(1, (48, 48), bounces=2)
    constrain(mirror, (0.1, 0, 0), (-3, 6, 3), (0, -6, 3), radius=0.5, border=0.2)
    found = stage.render(1, (48, 48), bounces=2)
    changed = np.any(found["combined"] != plain["combined"], axis=-1)
    assert 0 < changed.mean() < 0.25
    assert np.array_equal(found["diffuse_direct"], plain["diffuse_direct"])


@pytest.mark.slow
def test_an_edited_mirror_shows_what_cycles_does_off_one_that_leans(stage):
    """Scene A of the specification, with Cycles: normals turned by half the edit's angle are exact for every ray."""
    mirror = mirror_scene(stage)
    viewer = np.array([0.0, -6.0, 3.0])
    after = about((1, 0, 0), 16) @ mirrored(unit(*viewer), UP)
    constrain(mirror, (0, 0, 0), tuple(10 * after), tuple(viewer))
    found = stage.render(4, (48, 48), bounces=2)
    mirror.candela.reflection_editing_constraints.clear()
    mirror.data.normals_split_custom_set([tuple(about((1, 0, 0), 8) @ UP)] * 4)
    expected = stage.render(32, (48, 48), engine="CYCLES", bounces=2)
    seen = (found["glossy_color"][..., 0] > 0.99) & (expected["glossy_color"][..., 0] > 0.99)  # the mirror alone
    found, expected = (one["combined"][..., :3] for one in (found, expected))
    difference = np.abs(found - expected).max(axis=-1)
    steps = [np.abs(expected - np.roll(expected, shift, axis)).max(axis=-1) for axis in (0, 1) for shift in (-1, 1)]
    even = seen & (np.max(steps, axis=0) < 0.1)  # beside edges, one of the two may see the one colour and one the other
    print(
        f"median {np.median(difference[seen]):.5f}, {(difference[even] > 0.02).mean():.4f} of {even.mean():.2f} differ"
    )
    assert even.mean() > 0.2 and np.median(difference[seen]) < 2e-3
    assert (difference[even] > 0.02).mean() < 0.01


def world_of_directions(stage, turn=None):
    """A world whose colour is the direction, from 0 to 1; or that of a direction turned by (3, 3) `turn`."""
    world = stage.world()
    nodes, links = world.node_tree.nodes, world.node_tree.links
    place, scale = nodes.new("ShaderNodeTexCoord"), nodes.new("ShaderNodeVectorMath")
    direction = place.outputs["Generated"]
    if turn is not None:
        rows = [nodes.new("ShaderNodeVectorMath") for _ in range(3)]
        joined = nodes.new("ShaderNodeCombineXYZ")
        for k, row in enumerate(rows):
            row.operation = "DOT_PRODUCT"
            row.inputs[1].default_value = turn[k]
            links.new(direction, row.inputs[0])
            links.new(row.outputs["Value"], joined.inputs[k])
        direction = joined.outputs[0]
    scale.operation = "MULTIPLY_ADD"
    scale.inputs[1].default_value = scale.inputs[2].default_value = (0.5, 0.5, 0.5)
    links.new(direction, scale.inputs[0])
    background = next(node for node in nodes if node.type == "BACKGROUND")
    links.new(scale.outputs[0], background.inputs["Color"])


def sphere(stage, material, rings=64):
    """A smooth sphere of radius 1."""
    theta, phi = np.linspace(0, np.pi, rings), np.linspace(0, 2 * np.pi, 2 * rings + 1)[:-1]
    around = [
        np.outer(np.sin(theta), np.cos(phi)),
        np.outer(np.sin(theta), np.sin(phi)),
        np.outer(np.cos(theta), phi**0),
    ]
    k = np.arange(rings * 2 * rings).reshape(rings, -1)
    faces = np.stack([k[:-1], k[1:], np.roll(k[1:], -1, axis=1), np.roll(k[:-1], -1, axis=1)], axis=-1).reshape(-1, 4)
    made = stage.mesh(np.stack(around, axis=-1).reshape(-1, 3).tolist(), faces.tolist(), material=material)
    made.data.shade_smooth()
    return made


@pytest.mark.slow
def test_a_sphere_under_a_world_shows_what_cycles_does_under_the_turned_world(stage):
    """Scene C of the specification. One constraint over all of a convex mirror turns all that it reflects alike, which
    is the same as a world that is turned back: an exact reference without an own shader."""
    white = stage.principled(Metallic=1.0, Roughness=0.0, Base_Color=(1, 1, 1, 1))
    ball = sphere(stage, white)
    world_of_directions(stage)
    stage.camera((0, -6, 0), (np.pi / 2, 0, 0), 0.36)
    viewer, point = np.array([0.0, -6.0, 0.0]), unit(0.3, -1, 0.4)
    before = mirrored(unit(*(viewer - point)), point)
    axis = unit(*np.cross(before, (0.2, 0.3, 1.0)))
    after = about(axis, 30) @ before
    constrain(ball, tuple(point), tuple(point + 5 * after), tuple(viewer))
    found = stage.render(4, (64, 64), bounces=2)["combined"][..., :3]
    y, x = (np.mgrid[0:64, 0:64] + 0.5 - 32) / 32
    inside = np.hypot(x, y) < 0.8
    ball.candela.reflection_editing_constraints.clear()
    world_of_directions(stage, about(axis, 30))
    expected = stage.render(16, (64, 64), engine="CYCLES", bounces=2)["combined"][..., :3]
    wrong = np.sqrt(np.mean((found - expected)[inside] ** 2))
    print(f"RMS {wrong:.5f}")
    assert wrong < 0.01


@pytest.mark.slow
@pytest.mark.parametrize("roughness", [0.0, 0.2])
def test_a_ring_with_a_fading_region_stays_continuous(stage, roughness):
    """Scene D of the specification: no step between neighbouring pixels twice as large as without the edit. The world's
    colour is the direction, so that steps of a sharp ring are angles; a rough one is smoother, and noisy."""
    metal = stage.principled(Metallic=1.0, Roughness=roughness, Base_Color=(1, 1, 1, 1))
    n, m = 96, 32
    u, v = np.meshgrid(2 * np.pi * np.arange(n) / n, 2 * np.pi * np.arange(m) / m, indexing="ij")
    wide = 1.0 + 0.35 * np.cos(v)
    k = np.arange(n * m).reshape(n, m)
    right, up = np.roll(k, -1, axis=0), np.roll(k, -1, axis=1)
    faces = np.stack([k, right, np.roll(right, -1, axis=1), up], axis=-1).reshape(-1, 4)
    positions = np.stack([wide * np.cos(u), wide * np.sin(u), 0.35 * np.sin(v)], axis=-1).reshape(-1, 3)
    ring = stage.mesh(positions.tolist(), faces.tolist(), material=metal)
    ring.data.shade_smooth()
    ring.visible_glossy = False  # edges of itself in itself are no steps of the edit
    world_of_directions(stage)
    stage.camera((0, -2.5, 6), (np.radians(22), 0, 0), 0.5)
    stage.scene.candela.denoise_strength = 0.0
    samples = 1 if roughness == 0.0 else 64
    plain = stage.render(samples, (96, 96), bounces=2)
    viewer = np.array([0.0, -2.5, 6.0])
    for place, turn in (((0.0, -1.0, 0.35), 25), ((0.7, -0.7, 0.35), -25)):
        before = mirrored(unit(*(viewer - place)), UP)
        target = np.asarray(place) + 4 * (about((0, 1, 0), turn) @ before)
        constrain(ring, place, tuple(target), tuple(viewer), radius=1.1, border=0.8)
    ring.candela.reflection_editing_regions.remove(1)
    ring.candela.reflection_editing_regions[0].centre = (0.35, -0.85, 0.35)
    found = stage.render(samples, (96, 96), bounces=2)
    covered = plain["glossy_color"][..., 0] > 0.5
    facing = covered.copy()  # two pixels from every rim, where directions change fast by themselves
    for axis in (0, 1):
        for shift in (-2, -1, 1, 2):
            facing &= np.roll(covered, shift, axis)
    steps = []
    for shown in (plain, found):
        direction = 2.0 * shown["combined"][..., :3] - 1.0
        direction /= np.maximum(np.linalg.norm(direction, axis=-1, keepdims=True), 1e-6)
        largest = 0.0
        for axis in (0, 1):
            both = facing & np.roll(facing, 1, axis)
            largest = max(largest, degrees_between(direction, np.roll(direction, 1, axis))[both].max())
        steps.append(largest)
    changed = np.abs(found["combined"] - plain["combined"]).max(axis=-1)[facing] > 0.02
    print(f"largest steps {steps[0]:.2f}, {steps[1]:.2f} degrees; {changed.mean():.2f} of pixels changed")
    assert 0.1 < changed.mean() < 0.9
    assert steps[1] < 2.0 * steps[0]


def test_fades_grow_with_their_share():
    """At every angle up to 175 degrees: more of the edit is more of its angle."""
    for angle in (30, 90, 150, 175):
        constraints = [pair((0, 0, 0), UP, about((0, 1, 0), angle) @ UP)]
        region = Region(EUCLIDEAN, np.zeros(3), 2.0, 1.0)
        places = np.stack([np.linspace(1, 1.999, 80), np.zeros(80), np.zeros(80)], axis=1)
        found = degrees_between(edited(constraints, places, UP, regions=(region,)), UP)
        assert (np.diff(found) < 1e-2).all() and found[0] == pytest.approx(angle, abs=0.05)


@pytest.mark.slow
def test_an_island_without_a_constraint_stays_as_it_is(stage):
    """Distances along the surface do not reach it, however near it stands."""
    metal = stage.principled(Metallic=1.0, Roughness=0.0, Base_Color=(1, 1, 1, 1))
    corners = [(-2, -2, 0), (0, -2, 0), (0, 2, 0), (-2, 2, 0), (0.001, -2, 0), (2, -2, 0), (2, 2, 0), (0.001, 2, 0)]
    both = stage.mesh(corners, [(0, 1, 2, 3), (4, 5, 6, 7)], material=metal)
    world_of_directions(stage)
    stage.camera_above()
    stage.scene.candela.denoise_strength = 0.0
    plain = stage.render(1, (32, 32), bounces=2)["combined"]
    constrain(both, (-1, 0, 0), (3, 0, 4), (0, 0, 10), radius=50.0)
    both.candela.reflection_editing_regions[0].kind = "GEODESIC"
    both.candela.reflection_editing_regions[0].centre = (-1, 0, 0)
    changed = np.any(stage.render(1, (32, 32), bounces=2)["combined"] != plain, axis=-1)
    assert changed[:, :15].all() and not changed[:, 17:].any()


@pytest.mark.slow
def test_where_black_is_painted_nothing_is_edited_however_many_constraints_there_are(stage):
    """Distances from 16 constraints along the surface are as many layers as there are, without that of the paint."""
    mirror = mirror_scene(stage)
    paint = mirror.data.color_attributes.new("Paint", "FLOAT_COLOR", "POINT")
    paint.data.foreach_set("color", [0.0, 0.0, 0.0, 1.0] * len(paint.data))
    plain = stage.render(1, (32, 32), bounces=2)["combined"]
    for x in np.linspace(-1.5, 1.5, MOST_LAYERS):
        constrain(mirror, (x, 0, 0), (-3, 6, 3), (0, -6, 3))
    regions = mirror.candela.reflection_editing_regions
    while len(regions) > 2:
        regions.remove(2)
    regions[0].kind, regions[0].centre, regions[0].radius = "GEODESIC", (2, 2, 0), 1e-6
    regions[1].kind = "PAINTED"
    mirror.update_tag()
    assert np.array_equal(stage.render(1, (32, 32), bounces=2)["combined"], plain)
    regions[1].kind = "EUCLIDEAN"
    mirror.update_tag()
    assert not np.array_equal(stage.render(1, (32, 32), bounces=2)["combined"], plain)


@pytest.mark.slow
def test_a_camera_inside_a_region_sees_the_same_edit(stage):
    mirror = mirror_scene(stage)
    constrain(mirror, (0.1, 0, 0), (-3, 6, 3), (0, -6, 3), radius=5.0)  # less than to the camera
    outside = stage.render(1, (32, 32), bounces=2)["combined"]
    mirror.candela.reflection_editing_regions[0].radius = 50.0
    mirror.update_tag()
    assert np.array_equal(stage.render(1, (32, 32), bounces=2)["combined"], outside)


@pytest.mark.slow
def test_a_bound_constraint_follows_its_triangle(stage):
    """The mesh is bent; a constraint on a triangle's middle is where that has gone to."""
    mirror = mirror_scene(stage)
    constrain(mirror, (0, 0, 0), (-3, 6, 3), (0, -6, 3), radius=3.0, border=1.0)
    one = mirror.candela.reflection_editing_constraints[0]
    one.triangle, one.weights = 0, (1 / 3, 1 / 3, 1 / 3)
    for vertex in mirror.data.vertices:
        vertex.co.z += 0.3 + 0.1 * vertex.co.x
    mirror.data.update()
    mirror.update_tag()
    bound = stage.render(1, (32, 32), bounces=2)["combined"]
    corners = [mirror.data.vertices[k].co for k in mirror.data.loop_triangles[0].vertices]
    one.triangle, one.point = -1, sum(corners, corners[0] * 0) / 3
    mirror.update_tag()
    placed = stage.render(1, (32, 32), bounces=2)["combined"]
    assert np.abs(bound - placed).max() < 1e-3
    one.point = (0, 0, 0)
    mirror.update_tag()
    assert np.abs(stage.render(1, (32, 32), bounces=2)["combined"] - bound).max() > 0.05


def test_an_edit_of_glass_follows_its_index(stage):
    """In one session, as if it had been that of glass from the start."""
    glass = stage.material("ShaderNodeBsdfGlass", IOR=1.1, Roughness=0.0)
    pane = mirror_scene(stage)
    pane.data.materials[0] = glass
    constrain(pane, (0, 0, 0), (1, 2, -1), (0, -6, 3))
    pane.candela.reflection_editing_constraints[0].of = "REFRACTION"
    first = stage.render(1, bounces=2)["combined"]
    glass.node_tree.nodes["Glass BSDF"].inputs["IOR"].default_value = 1.8
    second = stage.render(1, bounces=2)["combined"]
    engine.free_sessions()
    assert np.array_equal(second, stage.render(1, bounces=2)["combined"])
    assert not np.array_equal(first, second)


def test_a_glass_ball_shows_a_target_where_its_constraint_lies(stage):
    """What leaves the ball is turned: the target is seen at the constraint, and an even world stays even."""
    ball = sphere(stage, stage.material("ShaderNodeBsdfGlass", IOR=1.5, Roughness=0.0), rings=32)
    stage.camera((0, -4, 0), (np.pi / 2, 0, 0), 0.6)
    target = np.array([3.0, 5.0, 2.0])
    place = np.array([0.3, 0.0, 0.2])
    place[1] = -np.sqrt(1.0 - place @ place)
    constrain(ball, tuple(place), tuple(target), (0, -4, 0))
    ball.candela.reflection_editing_constraints[0].of = "REFRACTION"
    ball.candela.reflection_editing_constraints[0].triangle = -1
    stage.world((1, 1, 1), 1.0)
    even = stage.render(2, (48, 48), bounces=2)["combined"][..., :3]
    assert even.mean() == pytest.approx(1.0, abs=5e-3)
    stage.world((0, 0, 0), 0.0)
    lamp = stage.material("ShaderNodeEmission", Strength=1.0)
    side = 0.35
    facing = [target + np.array(v) * side for v in ((-1, -0.3, -1), (1, -0.3, -1), (1, -0.3, 1), (-1, -0.3, 1))]
    stage.mesh([tuple(p) for p in facing], [(0, 1, 2, 3)], material=lamp)
    lit = stage.render(4, (48, 48), bounces=2)["combined"][..., 0]
    rows, columns = np.mgrid[0:48, 0:48]
    inside = np.hypot(rows - 23.5, columns - 23.5) < 12
    shown = np.average(np.stack([columns, rows])[:, inside], axis=1, weights=lit[inside])
    depth = 4.0 + place[1]
    expected = 23.5 + 24 * place[[0, 2]] / (depth * np.tan(0.3))
    assert np.abs(shown - expected).max() < 0.8


def test_what_freeze_does_not_keep_of_glass_is_told(stage):
    ball = sphere(stage, stage.material("ShaderNodeBsdfGlass", IOR=1.5, Roughness=0.0), rings=8)
    stage.camera((0, -4, 0), (np.pi / 2, 0, 0), 0.6)
    stage.world((1, 1, 1), 1.0)
    constrain(ball, (0, -1, 0), (3, 5, 2), (0, -4, 0))
    stage.render(1, (16, 12), bounces=1)
    assert not any("Freeze" in str(note) for note in stage.ledger.notes)
    ball.candela.reflection_editing_freeze = True
    stage.render(1, (16, 12), bounces=1)
    assert any("Freeze" in note.text and ball.name in note.subject for note in stage.ledger.notes)


@pytest.mark.parametrize("mirrored", [False, True])
def test_freeze_keeps_what_is_seen_through_closed_glass(stage, mirrored):
    """Every place of a ball shows from another eye, also by a mirror, what it shows from that of its constraint."""
    ball = sphere(stage, stage.material("ShaderNodeBsdfRefraction", IOR=1.4, Roughness=0.0), rings=32)
    nodes, links = stage.world((1, 1, 1), 1.0).node_tree.nodes, stage.scene.world.node_tree.links
    where = nodes.new("ShaderNodeTexCoord").outputs["Generated"]
    links.new(where, nodes["Background"].inputs["Color"])
    constrain(ball, (0, -1, 0), (3, 5, 2), (0, -4, 0))
    ball.candela.reflection_editing_constraints[0].of = "REFRACTION"
    angle = np.radians(35)
    eyes = [np.array([0.0, -4.0, 0.0]), 4.0 * np.array([np.sin(angle), -np.cos(angle), 0.0])]
    if mirrored:  # the second eye is behind a mirror that the camera looks at
        silver = stage.principled(Metallic=1.0, Roughness=0.0, Base_Color=(1, 1, 1, 1))
        stage.rectangle((-4, -4), (4, 4), material=silver, location=(2, 0, 0), turn=(0, -np.pi / 2, 0))

    def shown(turn, frozen, towards):
        """At some places of the ball, from an eye."""
        ball.candela.reflection_editing_freeze = frozen
        eye = eyes[turn] * [-1, 1, 1] + [4, 0, 0] if mirrored and turn else eyes[turn]
        stage.camera(tuple(eye), (np.pi / 2, 0, (angle if not mirrored else -angle) * turn), 0.6)
        picture = stage.render(2, (64, 64), bounces=4)["combined"][..., :3]
        found = []
        for place in towards:
            away = place - eyes[turn]
            forward = -eyes[turn] / 4.0
            right = np.cross(forward, (0, 0, 1)) * (-1 if mirrored and turn else 1)
            x, y = (31.5 + 32 * (away @ side) / (away @ forward) / np.tan(0.3) for side in (right, np.array((0, 0, 1))))
            found.append(picture[round(y), round(x)])
        return np.array(found)

    turns, rises = np.meshgrid(np.radians([5, 15, 25]), np.radians([-20, 0, 20]))
    places = np.stack([np.cos(rises) * np.sin(turns), -np.cos(rises) * np.cos(turns), np.sin(rises)], -1).reshape(-1, 3)
    expected = shown(0, False, places)
    assert np.abs(shown(1, True, places) - expected).max() < 0.06
    assert np.abs(shown(1, False, places) - expected).max() > 0.3


@pytest.mark.slow
def test_freeze_keeps_the_lamps_that_are_seen_through_frosted_glass(stage):
    """Light samples through a rough ball that casts no shadow are about as bright; lobes keep the shape of the view."""
    ball = sphere(stage, stage.material("ShaderNodeBsdfRefraction", IOR=1.4, Roughness=0.5), rings=32)
    ball.visible_shadow = False
    stage.light("AREA", (1, 4, 1), turn=(-np.pi / 2, 0, 0), size=1.0, energy=1000)
    constrain(ball, (0, -1, 0), (3, 5, 2), (0, -4, 0))
    ball.candela.reflection_editing_constraints[0].of = "REFRACTION"
    shown = []
    for angle, frozen in (
        (0.0, False),
        (np.radians(30), True),
        (np.radians(30), False),
    ):  # the same place of the ball, near the middle of both pictures
        ball.candela.reflection_editing_freeze = frozen
        stage.camera((4 * np.sin(angle), -4 * np.cos(angle), 0), (np.pi / 2, 0, angle), 0.6)
        x = round(15.5 + 16 * np.sin(np.radians(15) - angle) / (4 - np.cos(np.radians(15) - angle)) / np.tan(0.3))
        shown.append(stage.render(4, (32, 32), bounces=2)["transmission_direct"][14:18, x - 1 : x + 2].mean())
    assert shown[1] == pytest.approx(shown[0], rel=0.3) and shown[2] < 0.1 * shown[0], shown


def test_the_edit_of_glass_stays_however_many_views_are_frozen(stage, monkeypatch):
    """Of the 512th frozen view and later ones the eye is not known, the edit of what passes is."""
    from addon.techniques import reflection_editing

    ball = sphere(stage, stage.material("ShaderNodeBsdfRefraction", IOR=1.4, Roughness=0.0), rings=16)
    nodes, links = stage.world((1, 1, 1), 1.0).node_tree.nodes, stage.scene.world.node_tree.links
    links.new(nodes.new("ShaderNodeTexCoord").outputs["Generated"], nodes["Background"].inputs["Color"])
    constrain(ball, (0, -1, 0), (3, 5, 2), (0, -4, 0))
    ball.candela.reflection_editing_constraints[0].of = "REFRACTION"
    stage.camera((0, -4, 0), (np.pi / 2, 0, 0), 0.4)
    plain = stage.render(1, (16, 16), bounces=2)["combined"]
    ball.candela.reflection_editing_freeze = True
    table = reflection_editing.reflection_edits.edit_table
    monkeypatch.setattr(
        reflection_editing.reflection_edits, "edit_table", lambda *given: table(*given[:-1], given[-1] + 599)
    )
    found = stage.render(1, (16, 16), bounces=2)["combined"]
    assert np.abs(found - plain).max() < 1e-3


def test_freeze_says_which_closed_glass_is_too_many(stage, monkeypatch):
    """Closed objects with a constraint of Refraction take a number each; mirrors and open glass take none."""
    from addon.techniques import reflection_editing

    monkeypatch.setattr(reflection_editing, "MOST_FROZEN", 2)
    glass = stage.material("ShaderNodeBsdfRefraction", IOR=1.4, Roughness=0.0)
    stage.world((1, 1, 1), 1.0)
    stage.camera((0, -4, 0), (np.pi / 2, 0, 0), 0.4)

    def told():
        stage.render(1, (16, 16), bounces=2)
        return [note for note in stage.ledger.notes if "not through more" in note.text]

    balls = [sphere(stage, glass, rings=8) for _ in range(4)]
    for k, ball in enumerate(balls):
        ball.name = f"Ball {k}"
        constrain(ball, (0, -1, 0), (3, 5, 2), (0, -4, 0))
        ball.candela.reflection_editing_freeze = True
    pane = stage.rectangle((-1, -1), (1, 1), material=glass)
    constrain(pane, (0, 0, 0), (3, 5, 2), (0, -4, 0))
    pane.candela.reflection_editing_freeze = True
    for one in (*balls[2:], pane):
        one.candela.reflection_editing_constraints[0].of = "REFRACTION"
    assert not told()
    for one in balls:
        one.candela.reflection_editing_constraints[0].of = "REFRACTION"
    (note,) = told()
    assert note.subject == "Object 'Ball 2' and 1 more"


@pytest.mark.parametrize(("degrees", "roughness"), [(15, 0.0), (60, 0.0), (60, 0.5)])
def test_a_ball_in_an_even_world_stays_white_up_to_its_rim(stage, degrees, roughness):
    """Edited rays that point into the ball show what is behind it; samples of the world take no part."""
    ball = sphere(stage, stage.principled(Metallic=1.0, Roughness=roughness, Base_Color=(1, 1, 1, 1)), rings=24)
    stage.world((1, 1, 1), 1.0)
    stage.camera((0, -4, 0), (np.pi / 2, 0, 0), 0.6)
    after = about((0, 0, 1), degrees) @ np.array([0.0, -1.0, 0.0])
    constrain(ball, (0, -1, 0), tuple(np.array([0, -1, 0]) + 5 * after), (0, -4, 0))
    found = stage.render(4 if roughness else 2, (48, 48), bounces=2)["combined"][..., :3]
    assert found.mean() == pytest.approx(1.0, abs=2e-3) and found.min() > (0.8 if roughness else 0.9)  # noise of gloss


def test_an_edit_of_frosted_glass_loses_no_light(stage):
    """An even world looks the same through a rough ball whose light is turned by 60 degrees where it leaves."""
    ball = sphere(stage, stage.material("ShaderNodeBsdfRefraction", IOR=1.4, Roughness=0.5), rings=24)
    stage.world((1, 1, 1), 1.0)
    stage.camera((0, -4, 0), (np.pi / 2, 0, 0), 0.6)
    plain = stage.render(16, (32, 32), bounces=4)["combined"][..., :3].mean()
    after = about((0, 0, 1), 60) @ np.array([0.0, 1.0, 0.0])
    constrain(ball, (0, -1, 0), tuple(np.array([0, -1, 0]) + 5 * after), (0, -4, 0))
    ball.candela.reflection_editing_constraints[0].of = "REFRACTION"
    ball.candela.reflection_editing_constraints[0].triangle = -1
    edited = stage.render(16, (32, 32), bounces=4)["combined"][..., :3].mean()
    assert edited == pytest.approx(plain, rel=0.02)


def test_a_target_follows_the_object_that_it_is_bound_to(stage):
    """In one session, to the bit what a target at that place shows."""
    mirror = mirror_scene(stage)
    constrain(mirror, (0, 0, 0), (0, 0, 1), (0, -6, 3))
    one = mirror.candela.reflection_editing_constraints[0]
    empty = stage.link("Aim", None, (-3, 6, 2))
    mirror.location.z, one.target_object = 0.1, empty
    stage.render(1, (16, 16), bounces=2)
    empty.location = (2, 5, 3)
    bound = stage.render(1, (16, 16), bounces=2)["combined"]
    one.target_object, one.target = None, (2, 5, 2.9)
    assert np.array_equal(bound, stage.render(1, (16, 16), bounces=2)["combined"])
    one.target = (-3, 6, 1.9)
    assert not np.array_equal(bound, stage.render(1, (16, 16), bounces=2)["combined"])


def test_a_constraint_follows_a_shape_key(stage):
    """Without a triangle it belongs to a place of the undeformed mesh: a ball that is moved takes it along."""
    ball = sphere(stage, stage.principled(Metallic=1.0, Roughness=0.0), rings=16)
    constrain(ball, (0, -1, 0), (0, -5, 1), (0, -4, 0))
    ball.shape_key_add(name="Basis")
    key = ball.shape_key_add(name="Grown")
    for one in key.data:
        one.co = (one.co.x, one.co.y + 0.5 * one.co.x + 2.0, one.co.z)
    bpy.context.view_layer.update()
    places = []
    for value in (0.0, 1.0):
        key.value = value
        bpy.context.view_layer.update()
        depsgraph = bpy.context.evaluated_depsgraph_get()
        own = bound(own_settings(ball), ball.evaluated_get(depsgraph), depsgraph)
        places.append(dict(dict(own)["reflection_editing_constraints"][0])["point"])
    assert places[0] == pytest.approx((0, -1, 0)) and places[1] == pytest.approx((0, 1, 0), abs=0.02)


def test_a_mirror_shows_an_edited_mirror_edited(stage):
    """As the mirror whose normals lean by half the angle, both seen in another; by distances along the surface, too."""
    mirror = mirror_scene(stage)
    silver = stage.principled(Metallic=1.0, Roughness=0.0, Base_Color=(1, 1, 1, 1))
    stage.rectangle((-9, -9), (9, 9), material=silver, location=(0, -8, 0), turn=(-np.pi / 2, 0, 0))
    stage.camera((0, -6, 3), (np.radians(73), 0, np.pi), 0.25)
    after = about((0, 1, 0), 16) @ UP
    plain = stage.render(2, (32, 32), bounces=3)["combined"]
    constrain(mirror, (0, 0, 0), tuple(1000 * after), (0, 0, 5))
    found = stage.render(2, (32, 32), bounces=3)["combined"]
    mirror.candela.reflection_editing_regions[0].kind = "GEODESIC"
    mirror.update_tag()
    along = stage.render(2, (32, 32), bounces=3)["combined"]
    mirror.candela.reflection_editing_constraints.clear()
    mirror.data.normals_split_custom_set([tuple(about((0, 1, 0), 8) @ UP)] * 4)
    expected = stage.render(2, (32, 32), bounces=3)["combined"]
    assert np.abs(plain - expected).mean() > 0.02
    assert np.abs(found - expected).mean() < 0.1 * np.abs(plain - expected).mean()
    assert np.abs(along - found).max() < 1e-3


def test_the_heat_map_shows_how_far_an_edit_turns(stage):
    """Yellow where the mirror is turned by 60 degrees, grey elsewhere; the picture itself stays."""
    mirror = mirror_scene(stage)
    after = about((1, 0, 0), 60) @ mirrored(unit(0, -6, 3), UP)
    constrain(mirror, (0, 0, 0), tuple(10 * after), (0, -6, 3))
    plain = stage.render(1, (24, 24), bounces=1)["combined"]
    stage.scene.candela.edit_heat_shown = True
    assert np.array_equal(plain, stage.render(1, (24, 24), bounces=1)["combined"])
    frame = engine.session(stage.scene, "final").renderer.frame
    assert frame.picture == "film.turned"
    map_ = images.read(frame.images["film.turned"])
    middle, corner = map_[11, 12], map_[23, 0]
    assert middle[0] > 1.1 * middle[1] > 20 * middle[2]
    assert corner[0] == corner[1] == corner[2]
