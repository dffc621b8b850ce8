"""Light between surfels: closed forms of radiosity, invariants of links and of their tree, what is kept, and Cycles."""

from itertools import pairwise

import bpy
import numpy as np
import pytest

from addon import engine
from addon.compare.passes import light_paths
from addon.compare.reference import render_passes
from addon.frame import ledger
from addon.gfx import images
from addon.scene.surfel_cells import Cells, sampled
from addon.scene.surfel_surfaces import Surface
from addon.scene.surfel_tree import tree
from addon.scene.surfels import Surfels
from tests.techniques.test_instant_radiosity import corner, sphere, wall_irradiance

NAME = "implicit_visibility"


@pytest.fixture
def render(stage):
    """Radiance of diffuse indirect light by so many bounces; further arguments are the technique's parameters."""

    def render(bounces=1, samples=1, size=(32, 32), surfels=1024, **params):
        settings = stage.scene.candela
        settings.slot_indirect = NAME
        for name, value in {"surfels": surfels, **params}.items():
            setattr(settings, f"{NAME}_{name}", value)
        found = render_passes(stage.scene, "CANDELA", samples, 0, size=size, bounces=bounces).images
        assert ledger.latest().bad_pixels == 0
        return light_paths(found)["diffuse_indirect"].astype(float)

    return render


def counters():
    return ledger.latest().row(NAME).counters


def solved(stage, number=0):
    """Surfels, and what arrives at their front and back sides, (N, 4) each: radiance, share of bins that are linked."""
    renderer = stage.renderer
    technique = next(one for one in renderer.techniques if one.name == NAME)
    surfels = renderer._lasting[Surfels]
    arriving = images.read(technique._solutions[number].arriving).reshape(-1, 4)[: surfels.receiver_count]
    cells, count = surfels.cells, len(surfels.cells)
    back = np.zeros((count, 4))
    back[~cells.closed] = arriving[count:]
    return cells, arriving[:count].astype(float), back


def towards(stage, direction, number=0):
    """Of the surfels' sides that face a direction: places, areas, what arrives."""
    cells, front, back = solved(stage, number)
    cosine = cells.normal @ np.asarray(direction, float)
    own = np.abs(cosine) > 0.9
    return cells.place[own], cells.area[own], np.where(cosine[own, None] > 0, front[own], back[own])


# Closed forms ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("bounces", [1, 2, 8])
def test_a_sphere_lit_from_its_centre_reflects_the_series_of_its_albedo(stage, render, bounces):
    sphere(stage, stage.diffuse(0.5))
    stage.light("POINT", (0, 0, 0), energy=4 * np.pi**2, shadow_soft_size=0.0)
    light = render(bounces, size=(24, 24))
    assert light.mean() == pytest.approx(0.5 * (1 - 0.5**bounces), rel=0.01)
    assert light.std() < 0.01 * light.mean()


@pytest.mark.parametrize("bins", [8, 14, 21])
def test_bins_of_a_closed_room_leave_no_holes_and_no_light_is_lost(stage, render, bins):
    """A box of side 2 with a lamp in it: of its flux, 4 pi^2 W, reflected once over 24 m2, the mean stays."""
    bpy.ops.mesh.primitive_cube_add(size=2)
    bpy.context.object.data.materials.append(stage.diffuse(0.5))
    bpy.context.object.data.flip_normals()
    stage.light("POINT", (0, 0, 0), energy=4 * np.pi**2, shadow_soft_size=0.0)
    stage.camera((0, 0, 0), (1.2, 0, 0.5), angle=1.5)
    render(1, size=(16, 16), bins=bins)
    cells, front, back = solved(stage)
    inner = np.einsum("ni,ni->n", cells.normal, cells.place) < 0
    arriving = np.where(inner[:, None], front, back)
    linked = np.average(arriving[:, 3], weights=cells.area)
    assert linked > 0.995
    assert arriving[:, 3].min() > 0.9
    assert np.average(arriving[:, 0], weights=cells.area) == pytest.approx(0.5 * 4 * np.pi / 24, rel=0.02)


def lit_floor(stage, size=1.0):
    """A unit square at z = 0 of radiosity 8, lit from straight above whatever is above it."""
    half = size / 2
    stage.rectangle((-half, -half), (half, half), material=stage.diffuse(0.8))
    stage.light("SUN", energy=10.0, angle=0.0, use_shadow=False)


def test_parallel_squares_exchange_light_by_their_form_factor(stage, render):
    lit_floor(stage)
    stage.rectangle((-0.5, -0.5), (0.5, 0.5), z=1.0, material=stage.diffuse(1.0))
    stage.camera((0, -3, 0.5), (np.pi / 2, 0, 0))
    render(1)
    place, area, arriving = towards(stage, (0, 0, -1))
    above = place[:, 2] > 0.5
    mean = np.average(arriving[above, 0], weights=area[above])
    assert mean * np.pi == pytest.approx(8 * 0.19982, rel=0.02)


@pytest.mark.slow
def test_perpendicular_squares_exchange_light_by_their_form_factor(stage, render):
    """Beside the mean, .20004, the wall's irradiance by height, and the picture's."""
    stage.rectangle((0, 0), (1, 1), material=stage.diffuse(0.8))
    stage.mesh([(0, 0, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1)], [(0, 1, 2, 3)], material=stage.diffuse(1.0))
    stage.light("SUN", energy=10.0, angle=0.0)
    camera = stage.camera((3, 0.5, 0.5), (np.pi / 2, 0, np.pi / 2))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 1.0
    light = render(1, samples=8, size=(32, 32), surfels=2048) * np.pi
    _, area, arriving = towards(stage, (1, 0, 0))
    assert np.average(arriving[:, 0], weights=area) * np.pi == pytest.approx(8 * 0.20004, rel=0.03)
    rows = np.arange(3, 31)
    found = light[rows, 13:19].mean(axis=(1, 2))
    np.testing.assert_allclose(found, wall_irradiance((rows + 0.5) / 32), rtol=0.06)


@pytest.mark.slow
def test_what_stands_behind_a_blocker_gets_nothing(stage, render):
    lit_floor(stage)
    stage.rectangle((-0.3, -0.3), (0.3, 0.3), z=2.0, material=stage.diffuse(1.0))
    stage.camera((0, -5, 1), (np.pi / 2, 0, 0))
    render(1, surfels=2048)
    place, _, arriving = towards(stage, (0, 0, -1))
    assert arriving[place[:, 2] > 1.5, 0].min() > 0.1
    stage.rectangle((-1.2, -1.2), (1.2, 1.2), z=1.0, material=stage.diffuse(0.0))
    render(1, surfels=2048)
    place, _, arriving = towards(stage, (0, 0, -1))
    assert arriving[place[:, 2] > 1.5, 0].max() == 0.0


# Invariants -----------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_groups_of_surfels_bring_what_single_ones_do(stage, render, monkeypatch):
    """The hierarchy beside brute force: links to leaves alone."""
    corner(stage)
    grouped = render(2)
    engine.free_sessions()
    monkeypatch.setattr("addon.techniques.implicit_visibility.REFINE", 1e9)
    single = render(2)
    assert np.abs(grouped - single).mean() < 0.01 * single.mean()
    assert not np.array_equal(grouped, single)


@pytest.mark.slow
def test_more_bounces_never_darken_and_black_surfaces_send_nothing(stage, render):
    corner(stage)
    pictures = [render(bounces, size=(16, 16)) for bounces in (1, 2, 4)]
    for fewer, more in pairwise(pictures):
        assert (more >= fewer - 1e-6).all()
        assert more.mean() > fewer.mean()
    for placed in stage.scene.objects:
        if placed.type == "MESH":
            placed.data.materials[0] = stage.diffuse(0.0)
    stage.rectangle((-0.3, -1), (0.3, 0), z=1.0, material=stage.diffuse(1.0))
    light = render(4, size=(16, 16))
    assert light.max() < 0.05 * pictures[0].max()  # what the white one sends to the black ones, and they reflect none


def test_the_order_of_objects_changes_nothing(stage, render):
    def build(turns):
        stage.clear()
        material = stage.diffuse(0.7)
        places = [((-1, -1), (1, 1), 0.0), ((-0.5, -0.5), (0.2, 0.4), 0.7), ((-1, -1), (0.8, 1), 2.0)]
        for low, high, z in places[::turns]:
            stage.rectangle(low, high, z=z, material=material)
        stage.light("POINT", (0.5, 0, 1.2))
        stage.camera((0, -3, 1), (np.pi / 2, 0, 0))
        engine.free_sessions()
        return render(2)

    np.testing.assert_array_equal(build(1), build(-1))


@pytest.mark.parametrize("scale", [1e-3, 1e4])
def test_light_does_not_depend_on_units(stage, render, scale):
    corner(stage)
    light = render(2, surfels=512, size=(16, 16))
    stage.enlarge(scale)
    for placed in stage.scene.objects:
        if placed.type == "LIGHT":
            placed.data.energy *= scale * scale
    engine.free_sessions()
    np.testing.assert_allclose(render(2, surfels=512, size=(16, 16)), light, rtol=0.05, atol=1e-3 * light.max())


@pytest.mark.slow
def test_a_picture_is_the_same_each_time(stage, render):
    corner(stage)
    first = render(3, samples=3)
    engine.free_sessions()
    np.testing.assert_array_equal(first, render(3, samples=3))


@pytest.mark.slow
def test_error_falls_with_orientations(stage, render):
    """Few bins, so that what is wrong is theirs: eight solutions beside one, both beside many bins."""
    corner(stage)
    truth = render(2, samples=8, bins=32, surfels=2048)
    engine.free_sessions()

    def error(samples):
        return np.sqrt(np.square(render(2, samples=samples, bins=5, surfels=2048) - truth).mean())

    assert error(8) < 0.6 * error(1)


# The tree -------------------------------------------------------------------------------------------------------------


@pytest.fixture
def cells():
    """Surfels of the unit cube, both sides seen, and of a small closed tetrahedron in it."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = np.array([corners[[a, b, c]] for a, b, c, d in faces for a, b, c in ((a, b, c), (a, c, d))])
    points = 0.5 + 0.1 * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    solid = points[[[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]]
    parts = [
        sampled(triangles, np.ones(12), 300, False),
        sampled(solid, np.ones(4), 40, True),
    ]
    return Cells.joined(parts)


def test_surfels_stand_for_the_whole_area_and_stand_evenly(cells):
    assert cells.area[:300].sum() == pytest.approx(6.0, rel=1e-6)
    spacing = np.sqrt(6.0 / 300)
    apart = np.linalg.norm(cells.place[:300, None] - cells.place[None, :300], axis=2)
    np.fill_diagonal(apart, np.inf)
    assert apart.min(axis=1).mean() > 0.6 * spacing
    assert cells.radius[:300].max() < 1.6 * spacing
    np.testing.assert_allclose(np.linalg.norm(cells.normal, axis=1), 1.0, atol=1e-9)


def test_every_cut_through_the_tree_holds_each_surfel_once(cells):
    _, nodes = tree(cells)
    first, count = nodes[:, 2, 0].astype(int), nodes[:, 2, 1].astype(int)
    skip = nodes[:, 1, 3].astype(int)
    for most in (1, 2, 7, 40, 1000):
        held, node = np.zeros(len(cells), int), 0
        while node < len(nodes):
            if count[node] <= most:
                held[first[node] : first[node] + count[node]] += 1
                node = skip[node]
            else:
                node += 1
        assert (held == 1).all()


def test_nodes_hold_the_discs_of_their_surfels(cells):
    ordered, nodes = tree(cells)
    for node in nodes:
        own = slice(int(node[2, 0]), int(node[2, 0] + node[2, 1]))
        off = np.linalg.norm(ordered.place[own] - node[0, :3], axis=1) + ordered.radius[own]
        assert off.max() <= node[0, 3] * (1 + 1e-9)
        if node[1, 2] > 0.0 and node[2, 1] > 1:  # may stand for them: all of one kind, and facing alike
            assert len(set(ordered.closed[own])) == 1
            assert (ordered.normal[own] @ ordered.normal[own].mean(axis=0)).min() > 0.0


def test_outer_faces_that_see_nothing_have_few_surfels(stage, render):
    """A room of thick walls: half of its area lies outside. A sheet has no receivers where its back sees nothing."""
    for low, high in (((-1.2, -1.2, -1.2), (1.2, 1.2, -1)), ((-1.2, -1.2, 1), (1.2, 1.2, 1.2))):
        slab(stage, low, high)
    for side in (-1, 1):
        slab(stage, (min(side, 1.2 * side), -1.2, -1), (max(side, 1.2 * side), 1.2, 1))
        slab(stage, (-1, min(side, 1.2 * side), -1), (1, max(side, 1.2 * side), 1))
    stage.light("POINT", (0, 0, 0), shadow_soft_size=0.1)
    stage.camera((0.3, 0.2, -0.1), (1.2, 0.3, 0.4), angle=1.4)
    render(1, surfels=1024, size=(8, 8))
    cells, _, _ = solved(stage)
    outside = np.abs(cells.place).max(axis=1) > 1.199
    assert cells.area[outside].sum() > 0.4 * cells.area.sum()
    assert outside.sum() < 0.15 * len(cells)


def slab(stage, low, high):
    corners = [(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return stage.mesh(corners, faces, material=stage.diffuse(0.5))


def test_the_back_of_a_sheet_that_sees_nothing_is_dark(stage, render):
    corner(stage)
    render(2, size=(8, 8))
    cells, _, _ = solved(stage)
    assert cells.sheet.all()
    stage.camera((0, 6, 1), (-np.pi / 2, 0, np.pi), angle=0.4)  # from behind the wall
    assert not render(2, size=(8, 8)).any()


@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_surfels_of_closed_meshes_face_outwards(stage, render, turn):
    slab(stage, (-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)).scale.x = turn
    stage.light("POINT", (2, 1, 3))
    stage.camera_above()
    render(1, size=(8, 8), surfels=200)
    cells, _, _ = solved(stage)
    assert len(cells) > 100 and cells.closed.all()
    assert (((cells.place + stage.renderer.geometry.origin) * cells.normal).sum(axis=1) > 0.49).all()


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_a_sheet_faces_what_one_of_its_sides_sees(turn, side):
    """Sampled in its own space or where it stands in the world."""
    corners = np.array([[(0, 0, 0), (1, 0, 0), (1, 1, 0)], [(0, 0, 0), (1, 1, 0), (0, 1, 0)]], float)
    whole = Surface((), corners, np.ones(2), False, np.diag([turn, 1.0, 1.0]), np.zeros(3))
    front = turn  # z of normals by winding in the world
    (part,) = whole.parted(np.arange(2)[None].repeat(2, axis=0) == side)
    for cells in (Surfels()._own(part, 20, np.inf, np.zeros(3), {}), sampled(*part.world(), 20, part.closed)):
        assert cells.closed.all()
        np.testing.assert_allclose(cells.normal, np.array([(0, 0, -front if side else front)]).repeat(len(cells), 0))


@pytest.mark.slow
def test_a_mirrored_sphere_reflects_as_much_light(stage, render):
    found = []
    for turn in (1.0, -1.0):
        stage.clear()
        bpy.ops.mesh.primitive_uv_sphere_add(segments=32, ring_count=16, radius=0.5, location=(0, 0, 0.7))
        bpy.context.object.scale.x = turn
        bpy.context.object.data.materials.append(stage.diffuse(0.8))
        stage.floor(half=2.0)
        stage.light("SUN", turn=(0, 1.2, 0), energy=10.0, angle=0.0)
        stage.camera_above()
        found.append(render(1, size=(16, 16)).mean())
    assert found[0] > 0.01
    assert found[1] == pytest.approx(found[0], rel=0.1)


# What is kept ---------------------------------------------------------------------------------------------------------


def test_a_camera_that_moves_redoes_nothing_but_the_picture(stage, render):
    corner(stage)
    render(2)
    before = solved(stage)[1]
    stage.scene.camera.location.x += 0.2
    render(2)
    found = counters()
    assert {"surfels kept", "links kept", "light kept"} <= found.keys()
    assert not {"surfels made", "links made", "light made", "surfels shaded"} & found.keys()
    np.testing.assert_array_equal(before, solved(stage)[1])


def test_a_light_that_changes_keeps_links_and_a_material_too(stage, render):
    corner(stage)
    first = render(2)
    light = next(placed for placed in stage.scene.objects if placed.type == "LIGHT")
    light.data.energy *= 2
    second = render(2)
    found = counters()
    assert {"surfels kept", "links kept", "shading kept", "light made"} <= found.keys()
    assert "links made" not in found
    np.testing.assert_allclose(second, 2 * first, rtol=1e-4, atol=1e-6)
    material = next(p for p in stage.scene.objects if p.type == "MESH").data.materials[0]
    shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_DIFFUSE")
    shader.inputs["Color"].default_value = (0.2, 0.2, 0.2, 1)
    assert render(2).mean() < 0.3 * second.mean()
    assert {"links kept", "surfels shaded", "light made"} <= counters().keys()


def test_what_moves_is_linked_anew_and_is_what_a_new_session_finds(stage, render):
    corner(stage)
    moved = stage.rectangle((-0.3, -0.3), (0.3, 0.3), z=0.5, material=stage.diffuse(0.5))
    render(2)
    moved.location.z, moved.rotation_euler.x = 0.4, 0.6
    after = render(2)
    assert {"surfels made", "links made", "light made"} <= counters().keys()
    engine.free_sessions()
    np.testing.assert_array_equal(after, render(2))


def test_a_blocker_that_casts_no_shadow_any_more_lets_the_light_be_made_anew(stage, render):
    corner(stage)
    blocker = stage.rectangle((-0.5, -0.5), (0.5, 0.5), z=0.8, material=stage.diffuse(0.0))
    shadowed = render(2)
    blocker.visible_shadow = False
    after = render(2)
    assert np.abs(after - shadowed).max() > 0.01 * after.mean()
    engine.free_sessions()
    np.testing.assert_array_equal(after, render(2))


def test_a_lamp_that_allows_no_bounces_is_not_reflected(stage, render):
    corner(stage)
    assert render(1).mean() > 0.0
    lamp = next(placed for placed in stage.scene.objects if placed.type == "LIGHT")
    lamp.data.cycles.max_bounces = 0
    assert render(1).max() == 0.0


# What is skipped, and stress ------------------------------------------------------------------------------------------


def reason():
    row = ledger.latest().row(NAME)
    return row.reason


def test_what_needs_no_indirect_light_says_why(stage, render):
    corner(stage)
    render(0)
    assert reason() == "the scene's bounces are set to 0"
    for placed in stage.scene.objects:
        placed.hide_render = placed.type == "LIGHT"
    render(1)
    assert reason() == "no light reaches any surface"
    for placed in stage.scene.objects:
        placed.hide_render = placed.type == "MESH"
    render(1)
    assert reason() == "the scene has no surface"


def test_one_triangle_a_loose_edge_and_nothing_at_all(stage, render):
    stage.light("POINT")
    stage.camera_above()
    stage.mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)], material=stage.diffuse())
    assert render(2).max() == 0.0
    stage.mesh([(0, 0, 1), (1, 0, 1)], edges=[(0, 1)])
    stage.mesh([(0, 0, 1), (1, 0, 1), (2, 0, 1)], [(0, 1, 2)], material=stage.diffuse())  # without an area
    assert render(2).max() == 0.0


def test_coincident_and_many_surfaces_stay_finite(stage, render):
    material = stage.diffuse(0.8)
    for z in (0.0, 0.0, 1e-6, 1.0):
        stage.rectangle((-1, -1), (1, 1), z=z, material=material)
    for k in range(60):  # fewer surfels each than an object is sampled by itself
        stage.rectangle((-0.02, -0.02), (0.02, 0.02), material=material, location=(0.03 * k - 0.9, 0, 0.3))
    stage.light("POINT", (0, 0, 0.6))
    stage.world((0.1, 0.1, 0.1))
    stage.camera((0, -3, 0.5), (np.pi / 2, 0, 0))
    light = render(4, surfels=256, samples=2)
    assert np.isfinite(light).all()
    assert light.min() >= 0.0
    assert light.max() > 0.0


@pytest.mark.slow
def test_a_kilometre_of_ground_leaves_the_room_its_surfels(stage, render):
    corner(stage)
    for placed in stage.scene.objects:
        placed.location.z += 0.01
    stage.rectangle((-1000, -1000), (1000, 1000), material=stage.diffuse(0.5))
    render(1, surfels=2048)
    cells = solved(stage)[0]
    near = np.linalg.norm(cells.place - np.median(cells.place, axis=0), axis=1) < 4.0
    assert near.sum() > 100  # of 2048; by area alone none


# Beside Cycles --------------------------------------------------------------------------------------------------------


def cornell(stage):
    """A box of 2 m with a red and a green wall, two boxes and a lamp below the ceiling."""
    white, red, green = (
        stage.material("ShaderNodeBsdfDiffuse", Color=(*color, 1))
        for color in ((0.7, 0.7, 0.7), (0.7, 0.1, 0.1), (0.1, 0.7, 0.1))
    )
    for vertices, material in (
        ([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], white),
        ([(-1, -1, 2), (-1, 1, 2), (1, 1, 2), (1, -1, 2)], white),
        ([(-1, 1, 0), (1, 1, 0), (1, 1, 2), (-1, 1, 2)], white),
        ([(-1, -1, 0), (-1, 1, 0), (-1, 1, 2), (-1, -1, 2)], red),
        ([(1, -1, 0), (1, -1, 2), (1, 1, 2), (1, 1, 0)], green),
    ):
        stage.mesh(vertices, [(0, 1, 2, 3)], material=material)
    for location, turn, height in (((-0.35, 0.3, 0.6), 0.3, 1.2), ((0.35, -0.3, 0.3), -0.3, 0.6)):
        bpy.ops.mesh.primitive_cube_add(size=0.6, location=location, rotation=(0, 0, turn))
        bpy.context.object.scale.z = height / 0.6
        bpy.context.object.data.materials.append(white)
    stage.light("AREA", (0, 0, 1.98), size=0.6, energy=30.0)
    stage.camera((0, -4.4, 1), (np.pi / 2, 0, 0), angle=0.6)


@pytest.mark.slow
def test_irradiance_of_a_cornell_box_is_that_of_cycles(stage, render):
    """With as many bins as cube maps of 12: within 8 % of the mean at one sample, and less at four, by one bounce and
    by four over the same links.

    Half of the surfels' sides are on the outside of the walls: some 4,000 are within, as many as the 20 x 20 squares a
    wall and 12 x 12 a box side have corners for which that figure is expected.
    """
    cornell(stage)
    size = (32, 32)
    for bounces in (1, 4):
        both = [render_passes(stage.scene, "CYCLES", 256, seed, size=size, bounces=bounces).images for seed in (1, 2)]
        truth = [light_paths(one)["diffuse_indirect"] for one in both]
        color = both[0]["color.diffuse"] if "color.diffuse" in both[0] else both[0]["diffuse_color"]
        known = color[..., :3].min(axis=2) > 0.05
        noise = np.square((truth[0] - truth[1])[known] / 2 / color[known][:, :3]).mean()
        mean = (truth[0] + truth[1])[known] / 2 / color[known][:, :3]
        errors = []
        for samples in (1, 4):
            found = render(bounces, samples=samples, size=size, surfels=8192)[known] / color[known][:, :3]
            errors.append(np.sqrt(max(np.square(found - mean).mean() - noise, 0.0)) / mean.mean())
        print(f"{bounces} bounces: {errors[0]:.4f} at one sample, {errors[1]:.4f} at four, of the mean")
        assert errors[0] < 0.08
        assert errors[1] < errors[0]
