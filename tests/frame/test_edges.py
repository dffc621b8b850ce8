"""Edge tables, silhouettes and wedges, against counts of all triangles by brute force."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from addon.lighting import silhouettes
from addon.lighting.silhouettes import Extent
from addon.scene import edges
from addon.snapshot.scene import Visibility
from addon.sources import lights

CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
CUBE_TRIANGLES = np.array([t for a, b, c, d in QUADS for t in ((a, b, c), (a, c, d))])


def casters(*parts):
    """World edges of (positions, triangles) as they stand."""
    made = []
    for positions, triangles in parts:
        table = edges.table(np.asarray(positions, np.float32), np.asarray(triangles))
        instance = SimpleNamespace(matrix=np.eye(4), visibility=Visibility())
        made.append(edges._placed(table, instance, np.zeros(len(table.triangles), bool), np.zeros(3)))
    return edges._joined(made)


def soup(random, count=12, closed=True):
    """Random tetrahedra (closed) or lone triangles (open) between a receiver below and a light above."""
    parts = []
    for _ in range(count):
        points = random.normal(0, 0.6, (4, 3)) + random.uniform((-1, -1, 0.5), (1, 1, 2.5))
        faces = [(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)] if closed else [(0, 1, 2)]
        parts.append((points, faces))
    return casters(*parts)


def lamp(kind=lights.RECTANGLE, centre=(0.0, 0.0, 4.0), u=(0.5, 0, 0), v=(0, 0.4, 0.1), radius=0.0):
    """An emitter that is nothing but its shape."""
    axis = -np.cross(u, v) / np.linalg.norm(np.cross(u, v))
    centre = np.array(centre, float)
    if kind == lights.SUN:
        centre = centre / np.linalg.norm(centre)
    return lights.Emitter(
        None, kind, lights.SHADOW_FLAG, centre, radius, np.ones(3), 1.0, axis, 0.0, np.array(u, float),
        np.array(v, float), np.zeros(3),
    )  # fmt: skip


def layers(scene, p, s, infinite=False):
    """Triangles between p and s, by asking each."""
    return int(silhouettes.crossings(scene.corners, p, s, infinite).sum())


def sign(x):
    return 1 if x >= 0 else -1


def layers_by_edges(scene, found, extent, p, s):
    """The same by D(p, c) and the edges in the triangle (p, c, s), as depth_complexity.comp.glsl has it."""
    c = extent.centre if extent.infinite else extent.centre - p
    count = layers(scene, p, extent.centre, extent.infinite)
    offset = s - extent.centre
    for edge in found.numbers:
        v0, v1 = scene.ends[edge].astype(float)
        a, b = v0 - p, v1 - p
        n = np.cross(a, b)
        n_centre = n @ c
        if abs(n_centre) > extent.radius * np.linalg.norm(n):
            continue
        weight = 0
        for face, turn in zip(scene.faces[edge], scene.orient[edge]):
            if face >= 0:
                weight += int(turn) * sign(scene.planes[face, :3].astype(float) @ p + scene.planes[face, 3])
        q = np.cross(v1 - v0, extent.centre if extent.infinite else extent.centre - v0)
        side = n_centre >= 0
        crossed = (n_centre + n @ offset >= 0) != side
        crossed &= (np.cross(a, c) @ offset >= 0) != (np.cross(b, c) @ offset >= 0)
        crossed &= (q @ offset >= 0) == side
        if crossed:
            count += weight if side else -weight
    return count


def test_a_cube_has_eighteen_edges_and_is_closed():
    made = edges.table(CUBE, CUBE_TRIANGLES)
    assert len(made.triangles) == 12 and len(made.ends) == 18
    assert (made.faces >= 0).all() and made.closed.tolist() == [True]


def test_equal_positions_are_one_vertex_and_parts_stay_apart():
    split = CUBE[CUBE_TRIANGLES].reshape(-1, 3)
    made = edges.table(np.concatenate([split, split + 5]), np.arange(72).reshape(-1, 3))
    assert len(made.vertices) == 16 and len(made.ends) == 36
    assert made.closed.tolist() == [True, True] and np.bincount(made.island).tolist() == [12, 12]


def test_an_edge_of_three_triangles_has_two_records():
    points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1)]
    made = edges.table(np.array(points), np.array([(0, 1, 2), (0, 1, 3), (1, 0, 4)]))
    own = [k for k, ends in enumerate(made.ends) if np.allclose(made.vertices[ends][:, 1:], 0)]
    assert len(own) == 2 and sorted((made.faces[own] >= 0).sum(axis=1)) == [1, 2]
    assert not made.closed[0]


def test_triangles_without_area_are_dropped():
    points = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0.5, 0, 0), (np.nan, 0, 0)])
    made = edges.table(points, np.array([(0, 1, 2), (0, 3, 1), (0, 0, 1), (0, 1, 4)]))
    assert made.source.tolist() == [0]
    assert len(edges.table(np.zeros((0, 3)), np.zeros((0, 3), int)).ends) == 0


@pytest.mark.parametrize("closed", (True, False), ids=("closed", "open"))
def test_a_record_says_which_way_each_triangle_runs_along_its_edge(closed):
    """As shaders/edges/edge_record.glsl takes the code apart: none, where there is no second triangle."""
    scene = soup(np.random.default_rng(4), closed=closed)
    code = silhouettes.records_of(scene, np.arange(len(scene.ends)), np.zeros(len(scene.ends)))[:, 0, 3].astype(int)
    np.testing.assert_array_equal(np.stack([code % 3, code // 3], axis=1) - 1, scene.orient)
    assert (scene.orient != 0).all() == closed


def test_weights_do_not_depend_on_winding():
    random = np.random.default_rng(3)
    points = random.normal(size=(4, 3))
    faces = np.array([(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)])
    turned = faces.copy()
    turned[[0, 2]] = turned[[0, 2]][:, ::-1]
    extent = Extent.of(lamp())
    one, other = (silhouettes.silhouettes(casters((points, some)), extent) for some in (faces, turned))
    assert np.array_equal(one.numbers, other.numbers) and np.array_equal(one.weight, other.weight)


def test_an_object_that_moves_keeps_its_table():
    mesh = SimpleNamespace(
        key="cube", version=1, positions=CUBE, corner_vertices=np.arange(8), triangle_corners=CUBE_TRIANGLES,
        triangle_count=12, triangle_materials=lambda slots: np.zeros(12, int),
    )  # fmt: skip
    place = SimpleNamespace(mesh="cube", matrix=np.eye(4), visibility=Visibility(), materials=(0,))
    material = SimpleNamespace(casts_stochastically=False, transparent=False)
    cache = edges.EdgeCache()
    first = cache.casters([place], {"cube": mesh}, [material], np.zeros(3), 1)
    known = list(cache._tables.values())
    moved = SimpleNamespace(**{**vars(place), "matrix": np.array(np.eye(4))})
    moved.matrix[0, 3] = 2.0
    second = cache.casters([moved], {"cube": mesh}, [material], np.zeros(3), 2)
    assert [id(one) for one in cache._tables.values()] == [id(one) for one in known]
    assert np.allclose(second.ends - first.ends, (2, 0, 0))


@pytest.mark.parametrize("closed", (True, False), ids=("closed", "open"))
@pytest.mark.parametrize("kind", (lights.RECTANGLE, lights.SUN), ids=("rectangle", "sun"))
def test_layers_by_edges_are_those_by_brute_force(closed, kind):
    """No tolerance: the numbers of layers are integers."""
    random = np.random.default_rng(5 + closed)
    checked = 0
    for _ in range(6):
        scene = soup(random, closed=closed)
        light = lamp() if kind == lights.RECTANGLE else lamp(lights.SUN, (0.3, 0.1, 1.0), radius=0.2)
        extent = Extent.of(light)
        found = silhouettes.silhouettes(scene, extent)
        for _ in range(8):
            p = random.uniform((-2, -2, -0.5), (2, 2, 0.2))
            for _ in range(6):
                s = light.sample(*random.random(3))
                cut = silhouettes.crossings(scene.corners, extent.centre, s) if not extent.infinite else np.zeros(1)
                if not cut.any():
                    infinite = extent.infinite
                    assert layers_by_edges(scene, found, extent, p, s) == layers(scene, p, s, infinite)
                    checked += 1
    assert checked > 200


def test_nested_boxes_count_two_each_and_a_sheet_one():
    boxes = [(CUBE * size + (0, 0, 2), CUBE_TRIANGLES) for size in (0.2, 0.4, 0.6)]
    sheet = ([(-9, -9, 1), (9, -9, 1), (9, 9, 1), (-9, 9, 1)], [(0, 1, 2), (0, 2, 3)])
    extent = Extent.of(lamp(u=(0.05, 0, 0), v=(0, 0.05, 0)))
    p, s = np.array((0.02, 0.03, 0.0)), np.array((0.021, -0.017, 4.0))
    for parts, expected in ((boxes, 6), ([*boxes, sheet], 7)):
        scene = casters(*parts)
        found = silhouettes.silhouettes(scene, extent)
        assert layers_by_edges(scene, found, extent, p, s) == layers(scene, p, s) == expected


def test_an_open_sheet_seen_edge_on_needs_the_accurate_edges():
    sheet = ([(0, -1, 1), (0, 1, 1), (0, 1, 2), (0, -1, 2)], [(0, 1, 2), (0, 2, 3)])
    scene = casters(sheet)
    extent = Extent.of(lamp(v=(0, 0.4, 0)))
    accurate = silhouettes.silhouettes(scene, extent)
    for x in (-0.2, 0.2):  # either side
        p, s = np.array((x, 0.0, 0.0)), np.array((-0.4 * np.sign(x), 0.0, 4.0))
        assert layers_by_edges(scene, accurate, extent, p, s) == layers(scene, p, s) == 1


def test_candidates_hold_every_edge_that_any_point_of_the_light_sees_as_silhouette():
    random = np.random.default_rng(9)
    scene = soup(random, 60)
    light = lamp(u=(0.8, 0, 0), v=(0, 0.8, 0))
    found = set(silhouettes.silhouettes(scene, Extent.of(light)).numbers.tolist())
    centre = Extent.of(light)
    for _ in range(200):
        at = replace(centre, centre=light.sample(*random.random(3)))
        weight = (np.where(scene.faces >= 0, at.side(scene.planes)[scene.faces], 0) * scene.orient).sum(axis=1)
        assert set(np.flatnonzero(weight).tolist()) <= found


@pytest.mark.parametrize("kind", (lights.RECTANGLE, lights.SUN, lights.SPHERE), ids=("rectangle", "sun", "sphere"))
def test_wedges_hold_all_receivers_of_their_edges_shadow(kind):
    random = np.random.default_rng(11)
    scene = soup(random, 40)
    light = {
        lights.RECTANGLE: lamp(), lights.SUN: lamp(lights.SUN, (0.2, -0.3, 1.0), radius=0.1),
        lights.SPHERE: lamp(lights.SPHERE, radius=0.4),
    }[kind]  # fmt: skip
    extent = Extent.of(light, 3.0)
    found = silhouettes.silhouettes(scene, extent)
    tested = 0
    for edge, planes in zip(found.numbers, found.wedges.astype(float)):
        if not planes.any():
            continue
        for _ in range(60):
            v0, v1 = scene.ends[edge].astype(float)
            on_edge = v0 + random.random() * (v1 - v0)
            if kind == lights.SPHERE:
                s = extent.centre + lights._ball_offset(*random.random(3)) * 0.4
            else:
                s = light.sample(*random.random(3))
            way = -s if extent.infinite else on_edge - s
            p = on_edge + way * random.uniform(0.01, 3.0)
            tested += 1
            assert (planes[:, :3] @ p + planes[:, 3] <= 1e-5).all()
    assert tested > 2000


def test_no_casters_have_no_silhouettes():
    found = silhouettes.silhouettes(edges.NO_EDGES, Extent.of(lamp()))
    assert found.count == 0 and found.wedges.shape == (0, 4, 4)
    assert not silhouettes.hidden_from_eye(edges.NO_EDGES, Extent.of(lamp()), np.array([0, 0, 0, 0.0])).any()
