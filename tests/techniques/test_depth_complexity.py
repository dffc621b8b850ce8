"""Depth complexity sampling: layers against brute force, penumbrae in closed form, and what it leaves alone."""

import bpy
import numpy as np
import pytest

from addon.gfx import images
from addon.lighting import silhouettes
from addon.sources import lights

from .conftest import places

NAME = "depth_complexity"


@pytest.fixture
def by_edges(stage):
    stage.scene.candela.slot_shadow = NAME
    stage.scene.candela.light_probes_maps = 0.0
    return stage


def row(stage):
    return next(one for one in stage.ledger.rows if one.name == NAME)


def technique(stage):
    return next(one for one in stage.renderer.techniques if one.name == NAME)


def share(stage, size=(32, 32), samples=1, **options):
    """What each pixel sees of the light: lit with and without shadows."""
    with_shadow = stage.render(samples=samples, size=size, **options)["diffuse_direct"][..., 0]
    casters = [thing for thing in stage.scene.objects if thing.type == "MESH"]
    kept = [thing.visible_shadow for thing in casters]
    for thing in casters:
        thing.visible_shadow = False
    speck = stage.rectangle((0, 0), (1e-3, 1e-3), z=-50.0)
    free = stage.render(samples=samples, size=size, **options)["diffuse_direct"][..., 0]
    stage.remove(speck)
    for thing, value in zip(casters, kept):
        thing.visible_shadow = value
    return np.divide(with_shadow, free, out=np.ones_like(free), where=free > 1e-6)


def found_bits(stage, samples=1, points=64):
    """Receivers (N, 3), and (N, points) which points of the one light each sees, as the last sample left them; and the
    light's points, and all casters."""
    own = technique(stage)
    frame = stage.renderer.frame
    width, height = frame.size
    receivers = images.read(own.tiles._kept["receivers"]).reshape(-1, 4)
    words = images.read(own.tiles._kept["seen_points"])[..., 0].reshape(-1, height, width)
    valid = receivers[:, 3] != 0
    bits = np.stack([(words[k // 32].reshape(-1) >> (k % 32)) & 1 for k in range(points)], axis=1)[valid].astype(bool)
    counts = images.read(own.tiles._kept["count"])[..., 0].reshape(-1)[valid]
    emitter = frame.emitters[0]
    numbers = range((samples - 1) * points, samples * points)
    samples_of = [emitter.sample(*frame.random_volume("light", k)) for k in numbers]
    return receivers[valid, :3].astype(float), bits, counts, emitter, samples_of, own._casters


def expected_bits(stage, samples=1, points=64, every=7):
    """Which pixels to compare, and what each of them sees by asking all triangles."""
    receivers, bits, counts, emitter, given, casters = found_bits(stage, samples, points)
    chosen = np.arange(0, len(receivers), every)
    extent = silhouettes.Extent.of(emitter)
    seen = np.zeros((len(chosen), len(given)), bool)
    layers = np.zeros(len(chosen))
    for row, k in enumerate(chosen):
        p = receivers[k]
        layers[row] = silhouettes.crossings(casters.corners, p, extent.centre, extent.infinite).sum()
        for column, offset in enumerate(given):
            end = offset
            if emitter.kind in (lights.POINT, lights.SPHERE):
                end = _on_disc(emitter, p, offset)
            seen[row, column] = not silhouettes.crossings(casters.corners, p, end, extent.infinite).any()
    return bits[chosen], seen, counts[chosen], layers


def _on_disc(emitter, p, offset):
    to_centre = emitter.centre - p
    away = np.linalg.norm(to_centre)
    axis = to_centre / away
    across = offset - axis * (offset @ axis)
    if emitter.kind == lights.SPHERE:
        spread = 1 - np.sqrt(1 - (emitter.radius / away) ** 2)
        cosine = 1 - (across @ across) / emitter.radius**2 * spread
        across *= np.sqrt(1 - cosine**2) / cosine * away / max(np.linalg.norm(across), 1e-30)
    return emitter.centre + across


def fill(stage):
    """The scene of the specification: an open monkey, a closed cube, an open sheet, a thin ring, over a floor."""

    material = stage.diffuse(0.8)

    def add(operator, location, turn, **options):
        operator(location=location, rotation=turn, **options)
        thing = bpy.context.object
        thing.data.materials.append(material)
        return thing

    mesh = bpy.ops.mesh
    monkey = add(mesh.primitive_monkey_add, (0, 0, 1.1), (0.3, 0.2, 0.4), size=1.2)
    add(mesh.primitive_cube_add, (1.1, 0.3, 0.6), (0.4, 0.3, 0.1), size=0.7)
    add(mesh.primitive_plane_add, (-1.1, 0.2, 1.2), (0.5, 0.3, 0), size=0.8)
    ring = {"major_radius": 0.35, "minor_radius": 0.1, "major_segments": 20, "minor_segments": 8}
    add(mesh.primitive_torus_add, (0.3, -0.9, 0.7), (0.8, 0.2, 0), **ring)
    stage.rectangle((-6, -6), (6, 6))
    return monkey


def lamp(stage, kind, **options):
    if kind == "RECTANGLE":
        made = stage.light("AREA", (0.6, 0.5, 3.6), (0.2, 0.1, 0), shape="RECTANGLE", size=1.0, size_y=0.8)
    elif kind == "ELLIPSE":
        made = stage.light("AREA", (0.6, 0.5, 3.6), shape="ELLIPSE", size=1.0, size_y=0.6)
    elif kind.endswith("SUN"):
        made = stage.light("SUN", turn=(0.4, 0.3, 0), angle=2.9 if kind == "WIDE SUN" else 0.2)
    else:
        made = stage.light("POINT", (0.6, 0.5, 3.9), shadow_soft_size=0.3)
        made.data.use_soft_falloff = kind == "POINT"
    return made


@pytest.mark.slow
@pytest.mark.parametrize("kind", ("RECTANGLE", "ELLIPSE", "SUN", "WIDE SUN", "SPHERE", "POINT"))
def test_every_bit_is_what_brute_force_says(by_edges, kind):
    """Exact integers: no tolerance but for the rounding of float32 where a way meets an edge."""
    stage = by_edges
    fill(stage)
    lamp(stage, kind)
    stage.camera((0, -4.2, 2.6), (1.13, 0, 0), 0.9)
    stage.scene.candela.depth_complexity_mode = "POINTS"
    stage.render(size=(48, 32))
    bits, seen, counts, layers = expected_bits(stage)
    assert len(bits) > 150 and 0.1 < seen.mean() < 0.95
    assert (counts != layers).sum() == 0
    assert (bits != seen).mean() <= 1e-4
    rows = {row.name: row for row in stage.ledger.rows}
    assert rows[NAME].counters["edges"] > 200


@pytest.mark.parametrize("view", ("orthographic", "in shadow", "near plane", "hidden", "behind the light"))
def test_counts_do_not_depend_on_where_the_camera_stands(by_edges, view):
    stage = by_edges
    monkey = fill(stage)
    lamp(stage, "RECTANGLE")
    if view == "orthographic":
        camera = stage.camera((0, -4.2, 2.6), (1.0, 0, 0))
        camera.data.type, camera.data.ortho_scale = "ORTHO", 4.0
    elif view == "in shadow":
        stage.camera((0.1, 0.1, 0.35), (0.9, 0, 0.3), 1.4)
    elif view == "near plane":
        stage.camera((0, -4.2, 2.6), (1.13, 0, 0)).data.clip_start = 3.7
    elif view == "behind the light":
        stage.camera((1.2, 1.2, 6.5), (-0.15, 0.15, 0), 0.9)
    else:
        stage.camera((0, -4.2, 2.6), (1.13, 0, 0))
        monkey.visible_camera = False
    stage.scene.candela.depth_complexity_mode = "POINTS"
    stage.scene.candela.depth_complexity_points = "16"
    stage.render(size=(40, 32))
    bits, seen, counts, layers = expected_bits(stage, points=16)
    assert len(bits) > 60
    assert (counts != layers).sum() == 0
    assert (bits != seen).mean() <= 2e-4


@pytest.mark.parametrize("height, width", ((2.0, 1.0), (1.0, 1.0 / 3.0)))
def test_the_penumbra_of_a_half_plane_is_linear(by_edges, height, width):
    stage = by_edges
    stage.floor()
    stage.blocker((-20, -20), (0, 20), height)
    stage.light("AREA", (0, 0, 4), size=1.0, shape="SQUARE")
    stage.camera_above(span=2.0)
    size = (64, 4)
    found = share(stage, size)
    x, _ = places(size, 2.0)
    expected = np.clip(0.5 + x / width, 0, 1)
    assert np.abs(found - expected).mean() < 0.005
    assert np.abs(found - expected).max() < 0.05


@pytest.mark.parametrize("points, error", ((64, 0.0174), (16, 0.049)))
def test_noise_of_one_edge_is_that_of_a_stratified_pattern(by_edges, points, error):
    """Jittered points have this error at edges of any angle; a net has less, never more than 15 % more."""
    stage = by_edges
    stage.floor()
    stage.blocker((-20, -20), (0, 20), 2.0, turn=(0, 0, 0.6))
    stage.light("AREA", (0, 0, 4), size=1.0, shape="SQUARE")
    stage.camera_above(span=1.6)
    settings = stage.scene.candela
    settings.depth_complexity_points, settings.depth_complexity_smooth = str(points), False
    settings.depth_complexity_mode = "SHARE"
    size = (48, 48)
    one = share(stage, size)
    settings.depth_complexity_points = "64"
    many = share(stage, size, samples=16)
    inside = (many > 0.02) & (many < 0.98)
    rms = float(np.sqrt(((one - many)[inside] ** 2).mean()))
    assert rms < 1.15 * error


def test_smaller_tiles_change_no_bit(by_edges, monkeypatch):
    """Which words an edge stands in decides nothing: one list for all pixels gives the same bits."""
    from addon.lighting import edge_tiles

    stage = by_edges
    fill(stage)
    lamp(stage, "RECTANGLE")
    stage.camera((0, -4.2, 2.6), (1.13, 0, 0), 0.9)
    stage.scene.candela.depth_complexity_mode = "POINTS"
    stage.render(size=(48, 32))
    small = found_bits(stage)[1]
    monkeypatch.setattr(edge_tiles, "TILES", (64,))
    stage.render(size=(48, 32), seed=1)
    stage.render(size=(48, 32))
    assert np.array_equal(found_bits(stage)[1], small)


def test_an_open_sheet_seen_edge_on_shadows_both_sides(by_edges):
    stage = by_edges
    stage.floor()
    sheet = stage.mesh([(0, -9, 1), (0, 9, 1), (0, 9, 2), (0, -9, 2)], [(0, 1, 2, 3)])
    sheet.visible_camera = False
    stage.light("AREA", (0, 0, 4), size=1.0, shape="SQUARE")
    stage.camera_above(span=1.0)
    size = (32, 4)
    x, _ = places(size, 1.0)
    # From x the edges at z = 1 and 2 are seen before the light's places -3 x and -x, and the sheet between.
    expected = 1 - np.clip(3 * np.abs(x), 0, 0.5) + np.clip(np.abs(x), 0, 0.5)
    assert np.abs(share(stage, size) - expected).max() < 0.06


def test_standard_edges_miss_silhouettes_of_other_points_of_the_light(by_edges):
    """A cube below the middle of a large lamp: seen from there its sides are dark, but not from the lamp's rim."""
    stage = by_edges
    stage.floor()
    bpy.ops.mesh.primitive_cube_add(location=(0, 0, 0.5), size=0.4)
    bpy.context.object.visible_camera = False
    stage.light("AREA", (0, 0, 1.5), size=2.0, shape="SQUARE")
    stage.camera_above(span=2.0)
    settings = stage.scene.candela
    settings.depth_complexity_mode = "POINTS"
    accurate = stage.render(size=(32, 32))["diffuse_direct"][..., 0]
    settings.depth_complexity_accurate = False
    standard = stage.render(size=(32, 32))["diffuse_direct"][..., 0]
    settings.slot_shadow, settings.accumulated_maps_by = "accumulated_maps", "RAYS"
    expected = stage.render(samples=256, size=(32, 32))["diffuse_direct"][..., 0]
    scale = expected.max()
    assert np.sqrt(((accurate - expected) ** 2).mean()) < 0.02 * scale
    assert np.abs(standard - expected).max() > 0.15 * scale > 2 * np.abs(accurate - expected).max()


def test_more_casters_never_brighten(by_edges):
    stage = by_edges
    fill(stage)
    lamp(stage, "RECTANGLE")
    stage.camera((0, -4.2, 2.6), (1.13, 0, 0), 0.9)
    stage.scene.candela.depth_complexity_smooth = False
    before = stage.render(size=(32, 24))["diffuse_direct"]
    hidden = stage.blocker((-0.5, -0.5), (0.5, 0.5), 2.2)
    after = stage.render(size=(32, 24))["diffuse_direct"]
    assert (after <= before + 1e-6).all() and (after < before - 1e-3).any()
    stage.remove(hidden)


def test_direct_light_converges_to_that_of_rays(by_edges):
    stage = by_edges
    fill(stage)
    lamp(stage, "RECTANGLE")
    stage.camera((0, -4.2, 2.6), (1.13, 0, 0), 0.9)
    found = stage.render(samples=8, size=(32, 24))["diffuse_direct"]
    stage.scene.candela.slot_shadow = "accumulated_maps"
    stage.scene.candela.accumulated_maps_by = "RAYS"
    expected = stage.render(samples=256, size=(32, 24))["diffuse_direct"]
    scale = expected.mean()
    assert abs(found.mean() / expected.mean() - 1) < 2e-3
    assert np.sqrt(((found - expected) ** 2).mean()) < 0.02 * scale


def test_thousands_of_edges_before_a_pixel_are_all_asked(by_edges):
    """Software drivers end all loops of a thread after 65,536 turns: single points would take 64 an edge."""
    stage = by_edges
    stage.floor()
    random = np.random.default_rng(2)
    vertices = random.uniform((-0.7, -0.7, 0.5), (0.7, 0.7, 1.5), (900, 1, 3)) + random.normal(0, 0.03, (900, 3, 3))
    sheets = stage.mesh(
        [tuple(one) for one in vertices.reshape(-1, 3)], [(3 * k, 3 * k + 1, 3 * k + 2) for k in range(900)]
    )
    sheets.visible_camera = False
    stage.light("AREA", (0, 0, 3), size=3.0, shape="SQUARE")
    stage.camera_above(span=1.0)
    stage.scene.candela.depth_complexity_mode = "POINTS"
    stage.render(size=(16, 16))
    bits, seen, counts, layers = expected_bits(stage, every=11)
    assert row(stage).counters["edges"] > 2000 and 0.1 < seen.mean() < 0.9
    assert (counts != layers).sum() == 0 and (bits != seen).mean() <= 5e-4


def in_two_colours(light):
    """Give a lamp red on its left and blue on its right."""
    if bpy.app.version < (5, 2):
        light.use_nodes = True
    tree = light.node_tree
    emission = next(node for node in tree.nodes if node.type == "EMISSION")
    place, split = tree.nodes.new("ShaderNodeNewGeometry"), tree.nodes.new("ShaderNodeSeparateXYZ")
    ramp = tree.nodes.new("ShaderNodeMix")
    ramp.data_type = "RGBA"
    ramp.inputs["A"].default_value, ramp.inputs["B"].default_value = (1, 0.05, 0, 1), (0, 0.05, 1, 1)
    tree.links.new(place.outputs["Parametric"], split.inputs[0])
    tree.links.new(split.outputs["X"], ramp.inputs["Factor"])
    tree.links.new(ramp.outputs["Result"], emission.inputs["Color"])


@pytest.mark.slow
def test_shadows_of_a_textured_lamp_have_its_colours(by_edges):
    """A lamp whose left and right halves differ in colour, behind the edge of a plate: one sample as many rays."""
    stage = by_edges
    stage.floor()
    stage.blocker((0, -9), (9, 9), 1.0)
    in_two_colours(stage.light("AREA", (0, 0, 3), size=2.0, shape="SQUARE").data)
    stage.camera_above(span=2.0)
    found = stage.render(samples=1, size=(24, 24))["diffuse_direct"][..., :3]
    assert stage.ledger.row(NAME).counters["lights by edges"] == 1
    stage.scene.candela.depth_complexity_mode = "SHARE"
    share_of_all = stage.render(samples=1, size=(24, 24))["diffuse_direct"][..., :3]
    stage.scene.candela.slot_shadow = "accumulated_maps"
    truth = stage.render(samples=256, size=(24, 24))["diffuse_direct"][..., :3]
    lit = truth.mean(axis=2) > 0.05 * truth.mean(axis=2).max()
    assert np.ptp(truth[lit][:, 0] / truth[lit].sum(axis=1)) > 0.15
    errors = [np.sqrt(((picture - truth) ** 2).mean()) for picture in (found, share_of_all)]
    assert errors[0] < 0.03 * truth.mean(axis=2).max() and errors[0] < 0.5 * errors[1]


def test_a_light_without_extent_has_maps(by_edges):
    stage = by_edges
    stage.floor()
    stage.blocker((-0.5, -0.5), (0.5, 0.5), 1.0)
    stage.light("AREA", (0, 0, 4), size=0.5, shape="SQUARE")
    stage.light("POINT", (1, 0, 3), shadow_soft_size=0.0)
    stage.camera_above()
    stage.render()
    row = next(row for row in stage.ledger.rows if row.name == NAME)
    assert row.counters["lights by edges"] == 1 and row.counters["lights without extent"] == 1


def test_lights_with_too_many_edges_have_maps(by_edges):
    stage = by_edges
    fill(stage)
    lamp(stage, "RECTANGLE")
    stage.camera((0, -4.2, 2.6), (1.13, 0, 0), 0.9)
    stage.scene.candela.depth_complexity_most_edges = 100
    stage.render(size=(16, 16))
    row = next(row for row in stage.ledger.rows if row.name == NAME)
    assert row.counters["lights with too many edges: rays or maps"] == 1 and "edges" not in row.counters


def test_scenes_that_need_none_say_so(by_edges):
    stage = by_edges
    stage.floor()
    stage.light("POINT", (0, 0, 3), shadow_soft_size=0.0)
    stage.camera_above()
    stage.render()
    row = next(row for row in stage.ledger.rows if row.name == NAME)
    assert row.state == "skipped" and "extent" in row.reason


def test_odd_casters_are_survived(by_edges):
    """A caster that meets the light, a triangle without area, three faces at an edge, an edge on a line with the light,
    an object flattened to nothing, one mirrored: finite light, and shadows where they must be."""
    stage = by_edges
    stage.floor()
    stage.light("AREA", (0, 0, 4), size=1.0, shape="SQUARE")
    stage.rectangle((-0.2, -0.2), (0.2, 0.2), z=4.0)
    stage.mesh([(0, 0, 1), (1, 0, 1), (2, 0, 1)], [(0, 1, 2)])
    stage.mesh([(0, 0, 1), (0.5, 0, 1), (0, 1, 1), (0, -1, 1), (0, 0, 2)], [(0, 1, 2), (0, 1, 3), (1, 0, 4)])
    stage.mesh([(0, 0, 1), (0, 0, 2), (0.5, 0, 1)], [(0, 1, 2)])
    stage.rectangle((-1, -1), (1, 1), z=1.0, scale=(1, 0, 1))
    stage.blocker((1.0, -0.5), (1.9, 0.5), 0.5, scale=(-1, 1, 1))
    stage.camera_above()
    found = stage.render(size=(32, 32))["diffuse_direct"][..., 0]
    assert (found >= 0).all()
    assert found[16, 4] < 0.2 * found[16, 28]  # under the mirrored blocker


@pytest.mark.parametrize("technique", ["depth_complexity", "penumbra_wedges"])
def test_lights_that_coloured_panes_tint_are_left_to_maps(stage, technique):
    stage.scene.candela.slot_shadow = technique
    stage.floor(2.0)
    red = stage.material("ShaderNodeBsdfTransparent", Color=(1, 0.1, 0.1, 1))
    pane = stage.blocker((-0.5, -0.5), (0.5, 0.5), 1.0, material=red)
    stage.light("AREA", (0, 0, 3), size=0.5)
    stage.camera_above(2.0)
    stage.render(1, (12, 12))
    said = "lights that coloured panes tint: rays or maps"
    assert stage.ledger.row(technique).counters[said] == 1
    pane.data.materials[0] = stage.see_through(0.5)
    stage.render(1, (12, 12))
    assert said not in stage.ledger.row(technique).counters
