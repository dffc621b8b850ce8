"""Penumbra wedge blending: areas in closed form, known values of unions of casters, and what it leaves alone."""

import bpy
import numpy as np
import pytest

from addon.gfx import images
from addon.lighting import edge_shadows, silhouettes
from addon.sources import lights

from .conftest import places
from .test_depth_complexity import fill, share
from .test_opacity_maps import with_alpha

NAME = "penumbra_wedges"


@pytest.fixture
def by_wedges(stage):
    stage.scene.candela.slot_shadow = NAME
    stage.scene.candela.light_probes_maps = 0.0
    return stage


def square(stage, turn=0.0, size=1.0):
    return stage.light("AREA", (0, 0, 4), (0, 0, turn), size=size, shape="SQUARE")


def half_plane(stage, x=0.0, z=2.0, turn=0.0):
    return stage.blocker((-20, -20), (x, 20), z, turn=(0, 0, turn))


def row(stage):
    return next(row for row in stage.ledger.rows if row.name == NAME)


def test_one_half_plane_is_exact(by_wedges):
    stage = by_wedges
    stage.floor()
    half_plane(stage)
    square(stage)
    stage.camera_above(span=2.0)
    size = (64, 4)
    x, _ = places(size, 2.0)
    assert np.abs(share(stage, size) - np.clip(0.5 + x, 0, 1)).max() < 1e-4


def test_a_square_lamp_turned_by_an_eighth_is_cut_at_its_corners(by_wedges):
    stage = by_wedges
    stage.floor()
    half_plane(stage)
    square(stage, np.pi / 4)
    stage.camera_above(span=2.0)
    size = (64, 4)
    x, _ = places(size, 2.0)
    half = np.sqrt(0.5)
    cut = np.clip(half - np.abs(x), 0, half) ** 2
    assert np.abs(share(stage, size) - np.where(x < 0, cut, 1 - cut)).max() < 2e-4


@pytest.mark.parametrize("union, expected", (("BOXES", 0.5), ("SUM", 0.0), ("PRODUCT", 0.25)))
def test_the_same_half_plane_twice(by_wedges, union, expected):
    """Along the lamp's sides boxes are exact; a sum takes the light away twice."""
    stage = by_wedges
    stage.floor()
    half_plane(stage)
    half_plane(stage, z=2.0001)
    square(stage)
    stage.scene.candela.penumbra_wedges_union = union
    stage.camera_above(span=0.002)
    assert share(stage, (4, 4)).mean() == pytest.approx(expected, abs=2e-3)


@pytest.mark.parametrize("union, expected", (("BOXES", 0.375), ("SUM", 0.0), ("PRODUCT", 0.25)))
def test_the_same_edge_across_the_lamp_twice_has_a_known_error(by_wedges, union, expected):
    """An edge at 45 degrees leaves one half; quarters that are half full, twice, are taken for three quarters."""
    stage = by_wedges
    stage.floor()
    half_plane(stage)
    half_plane(stage, z=2.0001)
    square(stage, np.pi / 4)
    stage.scene.candela.penumbra_wedges_union = union
    stage.camera_above(span=0.002)
    assert share(stage, (4, 4)).mean() == pytest.approx(expected, abs=5e-3)


@pytest.mark.parametrize("union, expected", (("BOXES", 1 / 3), ("SUM", 1 / 3), ("PRODUCT", 4 / 9)))
def test_casters_beside_each_other_hide_their_sum(by_wedges, union, expected):
    stage = by_wedges
    stage.floor()
    half_plane(stage, x=-1 / 12)
    stage.blocker((1 / 12, -20), (20, 20), 2.0)
    square(stage)
    stage.scene.candela.penumbra_wedges_union = union
    stage.camera_above(span=0.002)
    assert share(stage, (4, 4)).mean() == pytest.approx(expected, abs=5e-3)


def areas(stage, every=13, across=24):
    """What some pixels see of the lamp's area, found and by asking all triangles from a grid of places. Light by rays
    would weigh the lamp's parts by their cosines, which a share of the area does not know."""
    own = next(one for one in stage.renderer.techniques if one.name == NAME)
    receivers = images.read(own.tiles._kept["receivers"]).reshape(-1, 4)
    found = images.read(own.tiles._kept["seen_share"]).reshape(-1)
    emitter = stage.renderer.frame.emitters[0]
    chosen = np.flatnonzero(receivers[:, 3] != 0)[::every]
    grid = (np.arange(across) + 0.5) / across * 2 - 1
    given = [emitter.centre + x * emitter.u[:3] + y * emitter.v[:3] for x in grid for y in grid]
    expected = [
        np.mean([not silhouettes.crossings(own._casters.corners, p, s).any() for s in given])
        for p in receivers[chosen, :3].astype(float)
    ]
    return found[chosen], np.array(expected)


def exact(stage, size, samples=256):
    settings = stage.scene.candela
    settings.slot_shadow, settings.accumulated_maps_by = "accumulated_maps", "RAYS"
    found = share(stage, size, samples=samples)
    settings.slot_shadow = NAME
    return found


@pytest.mark.slow
@pytest.mark.parametrize("thing", ("monkey", "torus", "cube"))
def test_one_group_is_the_area_that_it_hides(by_wedges, thing):
    """A cube, a ring with its hole, and an open head with eyes that are islands of their own."""
    stage = by_wedges
    stage.floor()
    mesh = bpy.ops.mesh
    if thing == "torus":
        mesh.primitive_torus_add(location=(0, 0, 1.5), rotation=(0.2, 0.1, 0), major_radius=0.4, minor_radius=0.1)
    elif thing == "cube":
        mesh.primitive_cube_add(location=(0, 0, 1.5), rotation=(0.4, 0.3, 0.1), size=0.7)
    else:
        mesh.primitive_monkey_add(location=(0, 0, 1.2), rotation=(0.3, 0.2, 0.4), size=0.8)
    bpy.context.object.visible_camera = False
    square(stage)
    stage.camera_above(span=3.0)
    stage.render(size=(24, 24))
    found, expected = areas(stage)
    error = np.abs(found - expected)
    assert expected.min() < 0.6
    assert error.mean() < (0.02 if thing == "monkey" else 0.002)
    assert error.max() < (0.3 if thing == "monkey" else 0.02)


@pytest.mark.parametrize("kind", ("ELLIPSE", "SUN", "POINT"))
def test_round_lights_count_as_squares_of_their_area(by_wedges, kind):
    stage = by_wedges
    stage.floor()
    half_plane(stage)
    if kind == "ELLIPSE":
        stage.light("AREA", (0, 0, 4), shape="DISK", size=1.0)
    elif kind == "SUN":
        stage.light("SUN", angle=0.25)
    else:
        stage.light("POINT", (0, 0, 4), shadow_soft_size=0.5)
    stage.camera_above(span=2.0)
    size = (32, 8)
    found, expected = share(stage, size), exact(stage, size)
    assert 0.2 < expected.mean() < 0.8
    assert np.abs(found - expected).max() < 0.09


@pytest.mark.slow
def test_the_camera_in_a_wedge_or_a_shadow_changes_nothing(by_wedges):
    """One group: the same receivers, seen from above and from within the shadow."""
    stage = by_wedges
    stage.floor()
    bpy.ops.mesh.primitive_cube_add(location=(0, 0, 1.5), size=0.7)
    square(stage)
    stage.camera((0.1, 0.1, 0.5), (0.5, 0, 0.3), 1.4)
    size = (24, 24)
    assert np.abs(share(stage, size) - exact(stage, size)).max() < 0.03


@pytest.mark.slow
def test_several_objects_err_half_as_much_as_their_product(by_wedges):
    """Random boxes between a lamp and the floor, against rays."""
    stage = by_wedges
    stage.floor()
    random = np.random.default_rng(3)
    for _ in range(12):
        centre = random.uniform((-0.8, -0.8, 1.0), (0.8, 0.8, 2.5))
        bpy.ops.mesh.primitive_cube_add(location=centre, rotation=random.uniform(0, 3, 3), size=0.35)
        bpy.context.object.visible_camera = False
    square(stage, size=1.5)
    stage.camera_above(span=2.0)
    errors = {}
    for union in ("BOXES", "PRODUCT", "SUM"):
        stage.scene.candela.penumbra_wedges_union = union
        stage.render(size=(24, 24))
        found, expected = areas(stage)
        errors[union] = float(np.sqrt(((found - expected) ** 2).mean()))
    assert errors["BOXES"] <= 0.5 * errors["PRODUCT"] < errors["SUM"]


@pytest.mark.slow
def test_shares_stay_between_plain_sum_and_all(by_wedges):
    stage = by_wedges
    fill(stage)
    square(stage)
    stage.camera((0, -4.2, 2.6), (1.13, 0, 0), 0.9)
    size = (32, 24)
    found = share(stage, size)
    stage.scene.candela.penumbra_wedges_union = "SUM"
    least = share(stage, size)
    assert (found <= 1 + 1e-5).all() and (found >= least - 1e-4).all()


def test_alpha_casters_before_a_solid_let_their_share_of_the_rest_pass(by_wedges):
    """A veil of half opacity before a plane: the product, where a sum would have black spots behind both."""
    stage = by_wedges
    stage.floor()
    half_plane(stage, x=-0.2)
    sheet = with_alpha(stage, np.full((4, 4), 0.5), "Closest")
    card = stage.card(sheet, 0, 1, location=(0, 0, 2), scale=(8, 8, 1))
    card.visible_camera = False
    square(stage)
    stage.camera_above(span=2.0)
    size = (64, 4)
    x, _ = places(size, 2.0)
    expected = 0.5 * np.clip(0.5 - np.maximum(-0.5, -0.4 - x), 0, 1)
    found = share(stage, size)  # noisy: each point of the lamp meets the veil or does not
    assert abs((found - expected).mean()) < 0.01
    stage.scene.candela.penumbra_wedges_union = "SUM"
    assert (expected - share(stage, size)).mean() > 0.05


@pytest.mark.parametrize("union", ["BOXES", "SUM"])
def test_alpha_casters_beside_a_solid_are_added(by_wedges, union):
    stage = by_wedges
    stage.scene.candela.penumbra_wedges_union = union
    stage.floor()
    half_plane(stage, x=-0.2)
    sheet = with_alpha(stage, np.arange(64)[None] * np.ones((64, 1)) < 32, "Closest")
    card = stage.card(sheet, 0, 1, location=(0, 0, 2), turn=(0, 0, np.pi), scale=(8, 8, 1))
    card.visible_camera = False
    square(stage)
    stage.camera_above(span=2.0)
    size = (64, 4)
    x, _ = places(size, 2.0)
    # From x the plane hides the lamp up to -0.4 - x, the opaque half of the card what lies beyond -x.
    expected = np.clip(np.minimum(0.5, -x) - np.maximum(-0.5, -0.4 - x), 0, 1)
    assert np.abs(share(stage, size) - expected).mean() < 0.02


@pytest.mark.slow
def test_leaves_about_a_trunk_count_by_where_on_the_light_they_lie(by_wedges):
    """RMS .041 of the mean by boxes beside 48 points, one by one; .042 by the product, .068 by the sum."""
    stage, random = by_wedges, np.random.default_rng(3)
    stage.floor()
    square_of = [(-0.12, -0.12), (0.12, -0.12), (0.12, 0.12), (-0.12, 0.12)]
    sides = [(k, (k + 1) % 4, 4 + (k + 1) % 4, 4 + k) for k in range(4)]
    trunk = stage.mesh([(*xy, z) for z in (0.0, 1.6) for xy in square_of], [*sides, (4, 5, 6, 7), (3, 2, 1, 0)])
    trunk.visible_camera = False
    leaf = with_alpha(stage, 1.0 * (np.hypot(*np.mgrid[-1:1:32j, -1:1:32j]) < 0.7), "Closest")
    for _ in range(40):
        place, turn = random.normal(0, 0.35, 3) + (0, 0, 1.3), random.uniform(0, 6, 3)
        stage.card(leaf, 0, 1, location=tuple(place), turn=tuple(turn), scale=(0.25, 0.25, 1)).visible_camera = False
    square(stage)
    stage.camera_above(span=2.5)
    settings, errors = stage.scene.candela, {}
    before, settings.slot_shadow = settings.slot_shadow, "accumulated_maps"
    expected = share(stage, (48, 48), samples=48)
    settings.slot_shadow = before
    for union in ("BOXES", "PRODUCT", "SUM"):
        settings.penumbra_wedges_union = union
        errors[union] = np.sqrt(((share(stage, (48, 48)) - expected) ** 2).mean()) / expected.mean()
    assert errors["BOXES"] < 0.05 and errors["PRODUCT"] < 0.05 < errors["SUM"]


def test_a_body_of_many_layers_hides_the_light(by_wedges):
    """A comb with 30 teeth: 60 triangles before the lamp."""
    stage = by_wedges
    stage.floor()
    outline = [(-1.0, 1.0)]
    for z in 1.0 + 0.02 * np.arange(30):
        outline += [(1.0, z), (1.0, z + 0.01), (-0.9, z + 0.01), (-0.9, z + 0.02)]
    outline[-1] = (-1.0, outline[-2][1])
    outline.pop(-2)
    count = len(outline)
    corners = [(x, y, z) for y in (-1.0, 1.0) for x, z in outline]
    sides = [(k, (k + 1) % count, count + (k + 1) % count, count + k) for k in range(count)]
    ends = [tuple(range(count))[::-1], tuple(range(count, 2 * count))]
    stage.mesh(corners, [*sides, *ends]).visible_camera = False
    for x in (2.0, 2.3, 2.6):  # nearer to the lamp, so that the comb's place among groups is the fourth
        stage.blocker((x, -0.5), (x + 0.2, 0.5), 3.0)
    stage.light("AREA", (0, 0, 4), size=0.2, shape="SQUARE")
    stage.camera_above(span=8.0)
    stage.render(size=(32, 32))
    assert row(stage).counters["groups"] == 5  # and the floor
    found = share(stage, (32, 32))
    assert found[15:17, 14:18].max() < 0.02
    assert found[2:4, 2:4].min() > 0.98


def test_a_finely_meshed_sheet_is_no_body(by_wedges):
    """Of a sheet of 30 x 30 squares 6 % of the edges are borders; it hides the lamp all the same, once."""
    stage = by_wedges
    stage.floor()
    side = np.linspace(-1.0, 1.0, 31)
    corners = [(x, y, 2.0 + 0.1 * np.sin(3 * x)) for x in side for y in side]
    faces = [(31 * j + k, 31 * j + k + 1, 31 * j + k + 32, 31 * j + k + 31) for j in range(30) for k in range(30)]
    stage.mesh(corners, faces).visible_camera = False
    square(stage, size=0.5)
    stage.camera_above(span=1.0)
    assert share(stage, (16, 16)).max() < 0.01


def test_lights_through_coloured_panes_have_maps(by_wedges):
    """A share of the light has no colour, so that shadows of edges would be grey."""
    stage = by_wedges
    stage.floor()
    stage.blocker((-1, -1), (1, 1), 2.0, material=stage.material("ShaderNodeBsdfTransparent", Color=(0.9, 0.2, 0.1, 1)))
    square(stage)
    stage.camera_above(span=1.0)
    red, _, blue = stage.render(16, (8, 8))["diffuse_direct"].mean(axis=(0, 1))
    assert row(stage).counters["lights that coloured panes tint: rays or maps"] == 1
    assert blue / red == pytest.approx(0.1 / 0.9, rel=0.3)  # what passes a pane is drawn by chance; grey would be 1


def test_lights_before_too_many_cards_have_maps(by_wedges, monkeypatch):
    stage = by_wedges
    stage.floor()
    card = stage.card(
        with_alpha(stage, np.arange(64)[None] * np.ones((64, 1)) < 32, "Closest"), 0, 1, location=(0, 0, 2)
    )
    card.visible_camera = False
    square(stage)
    stage.camera_above(span=2.0)
    monkeypatch.setattr(edge_shadows.EdgeShadows, "_card_count", lambda *_: 10**9)
    stage.render(size=(16, 16))
    assert row(stage).counters["lights with too many cards: rays or maps"] == 1


def test_lights_with_too_many_groups_have_depth_complexity(by_wedges):
    stage = by_wedges
    stage.floor()
    for k in range(70):
        stage.blocker((0.02 * k, 0), (0.02 * k + 0.01, 0.5), 1.0)
    square(stage)
    stage.camera_above()
    stage.render()
    assert row(stage).counters["lights with too many groups of edges: depth complexity"] == 1


def test_boxes_hold_what_a_group_hides():
    """The rule for boxes without order, in numpy, on random triangles before a quarter of a light: never too small."""
    random = np.random.default_rng(1)
    grid = (np.stack(np.meshgrid(np.arange(48), np.arange(48)), axis=-1).reshape(-1, 2) + 0.5) / 48
    for _ in range(150):
        points = random.uniform(-1.5, 1.5, (3, 2))
        inside = _inside(points, grid)
        centre = bool(_inside(points, np.zeros((1, 2)))[0])
        low, high = (np.zeros(2), np.ones(2)) if centre else (np.ones(2), np.zeros(2))
        area, border, far = float(centre), 2.0 * centre, np.zeros(2)
        for a, b in zip(points, np.roll(points, -1, axis=0)):
            clipped = _clip(a, b)
            if clipped is None:
                continue
            a, b = clipped
            outer = _turn(points) * np.sign(a[0] * b[1] - a[1] * b[0]) < 0
            sign = 1.0 if outer else -1.0
            area += sign * (abs(_swept(a) - _swept(b)) - 0.5 * abs(a[0] * b[1] - a[1] * b[0]))
            border += sign * abs(_along(a) - _along(b))
            far = np.maximum(far, np.maximum(a, b))
            if outer:
                low = np.minimum(low, np.minimum(a, b))
                corner = (a[0] >= a[1]) != (b[0] >= b[1])
                high = np.maximum(high, np.ones(2) if corner else np.maximum(a / a.max(), b / b.max()))
        assert area == pytest.approx(inside.mean(), abs=0.02)
        if inside.any():
            high = np.minimum(high, far) if border < 1e-4 else high
            assert (grid[inside] >= low - 0.02).all() and (grid[inside] <= high + 0.02).all()


def _turn(points):
    (ax, ay), (bx, by) = points[1] - points[0], points[2] - points[0]
    return np.sign(ax * by - ay * bx)


def _inside(points, places):
    sides = []
    for a, b in zip(points, np.roll(points, -1, axis=0)):
        way, off = b - a, places - a
        sides.append(way[0] * off[:, 1] - way[1] * off[:, 0])
    sides = np.stack(sides)
    return (sides >= 0).all(axis=0) | (sides <= 0).all(axis=0)


def _clip(a, b):
    """The part of a segment within the unit square; None without any."""
    low, high = 0.0, 1.0
    for axis in range(2):
        for at_a, at_b in ((a[axis], b[axis]), (1 - a[axis], 1 - b[axis])):
            if at_a < 0 and at_b < 0:
                return None
            if at_a < 0:
                low = max(low, at_a / (at_a - at_b))
            elif at_b < 0:
                high = min(high, at_a / (at_a - at_b))
    return (a + low * (b - a), a + high * (b - a)) if low < high else None


def _swept(q):
    return 0.5 * q[1] / q[0] if q[0] >= q[1] else 1 - 0.5 * q[0] / q[1]


def _along(q):
    return q[1] / q[0] if q[0] >= q[1] else 2 - q[0] / q[1]


def test_extent_of_a_sun_is_its_cone():
    emitter = lights.Emitter(
        None,
        lights.SUN,
        0,
        np.array([0, 0, 1.0]),
        0.1,
        np.ones(3),
        1.0,
        np.array([0, 0, -1.0]),
        0.0,
        *[np.zeros(3)] * 3,
    )
    assert silhouettes.Extent.of(emitter).radius == pytest.approx(2 * np.sin(0.05))
