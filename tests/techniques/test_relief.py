"""Relief: the search by its table, surfaces in closed form, invariants, and Cycles' displaced meshes beside it."""

import bpy
import numpy as np
import pytest

from addon.frame.ledger import RAN, SKIPPED, latest
from addon.lighting import depth_maps
from addon.surfaces import draw
from bench import relief as figures
from bench import relief_scenes
from tests.techniques.conftest import places


def height_material(stage, build, scale=1.0, midlevel=0.0, method="DISPLACEMENT", mode="RELIEF", space="OBJECT", **own):
    """Diffuse, .5, displaced by what `build(nodes, join)` gives as an output socket, or by that constant."""
    made = stage.diffuse(0.5)
    made.displacement_method = method
    nodes, join = made.node_tree.nodes, made.node_tree.links.new
    node = nodes.new("ShaderNodeDisplacement")
    node.space = space
    node.inputs["Scale"].default_value, node.inputs["Midlevel"].default_value = scale, midlevel
    height = build(nodes, join) if callable(build) else build
    if isinstance(height, float):
        node.inputs["Height"].default_value = height
    else:
        join(height, node.inputs["Height"])
    join(node.outputs[0], next(one for one in nodes if one.type == "OUTPUT_MATERIAL").inputs["Displacement"])
    made.candela.relief_mode = mode
    for name, value in own.items():
        setattr(made.candela, f"relief_{name}", value)
    return made


def along_u(nodes, join):
    places, split = nodes.new("ShaderNodeTexCoord"), nodes.new("ShaderNodeSeparateXYZ")
    join(places.outputs["UV"], split.inputs[0])
    return split.outputs["X"]


def cone(nodes, join):
    """1 in the middle of the square, 0 from half its side on."""
    places, mapping, shape = (nodes.new(f"ShaderNode{kind}") for kind in ("TexCoord", "Mapping", "TexGradient"))
    shape.gradient_type = "SPHERICAL"
    mapping.inputs["Location"].default_value = (-1, -1, 0)
    mapping.inputs["Scale"].default_value = (2, 2, 1)
    join(places.outputs["UV"], mapping.inputs["Vector"])
    join(mapping.outputs["Vector"], shape.inputs["Vector"])
    return shape.outputs["Fac"] if "Fac" in shape.outputs else shape.outputs[1]


def noise(nodes, join):
    places, texture = nodes.new("ShaderNodeTexCoord"), nodes.new("ShaderNodeTexNoise")
    texture.inputs["Scale"].default_value = 4.0
    join(places.outputs["UV"], texture.inputs["Vector"])
    return texture.outputs[0]


def row_of(stage, name="relief"):
    return stage.ledger.row(name)


# The search ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ray", range(4))
@pytest.mark.parametrize("name", figures.ITERATION_FIELDS)
def test_iterations_are_those_of_the_table(name, ray):
    """Within a tenth of what the specification counted for the same fields, depth and rays."""
    expected = figures.EXPECTED[name][ray]
    found = figures.iterations(name, *figures.RAYS[ray])
    np.testing.assert_allclose(found, expected, rtol=0.1)
    assert found[1] < found[0]


def test_false_position_of_the_two_forms_is_the_same():
    """Lines through two surface points cut with the ray (Risser et al., 3.3-3.7), and the axis cut by a secant."""
    rng = np.random.default_rng(3)
    slope = rng.uniform(0.3, 3.0, 1000)  # of the ray, height per length
    upper, lower = rng.uniform(0.5, 1.0, 1000), rng.uniform(0.0, 0.4, 1000)  # places along it
    above = slope * upper - rng.uniform(0.01, 0.5, 1000)  # heights there: below the ray, and above it
    below = slope * lower + rng.uniform(0.01, 0.5, 1000)
    rise = (above - below) / (upper - lower)
    thesis = (above - rise * upper) / (slope - rise)
    f_upper, f_lower = slope * upper - above, slope * lower - below
    np.testing.assert_allclose(thesis, upper + (lower - upper) * f_upper / (f_upper - f_lower), rtol=1e-5)


@pytest.mark.parametrize("method, factor", [("BISECTION", 2.0), ("FALSE_POSITION", 1.2), ("INTERVAL", 1.2)])
def test_errors_fall_with_iterations(method, factor):
    """Root mean square of t on stones at 45 degrees after 10 steps: bisection halves it, false position is ahead."""
    field = relief_scenes.field("stones")
    truth = figures.search(field, np.pi / 4, 10, "BISECTION", most=40, enough=0.0)
    found = figures.search(field, np.pi / 4, 10, method, most=4, enough=0.0)
    error = np.sqrt(np.mean((found.t - truth.t[-1]) ** 2, axis=1))
    assert (error[:-1] / error[1:] > factor * 0.95).all()
    if method != "BISECTION":
        assert error[0] < 0.01


# Closed forms --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("turn", [0.0, 0.9])
def test_a_constant_height_is_a_moved_plane_without_shadows(stage, turn):
    def shown(material, z):
        stage.clear()
        stage.floor(half=2.0, material=material(), location=(0, 0, z))
        stage.light("SUN", turn=(0.4, 0.7, 0), angle=0.0)
        stage.camera((0, -8 * np.sin(turn), 8 * np.cos(turn)), (turn, 0, 0), 0.4)
        return stage.render()

    relief = shown(lambda: height_material(stage, 0.75, 0.4), 0.0)
    assert row_of(stage).state == RAN
    plane = shown(lambda: stage.diffuse(0.5), 0.3)
    np.testing.assert_allclose(relief["depth"], plane["depth"], rtol=1e-4)
    np.testing.assert_allclose(relief["combined"], plane["combined"], atol=1e-4)


@pytest.mark.parametrize("search", ["FALSE_POSITION", "INTERVAL", "BISECTION"])
def test_a_ramp_is_a_tilted_plane(stage, search):
    made = height_material(stage, along_u, 0.8, 0.5, search=search, refinements=8)
    stage.card(made, 0, 1)
    stage.light("SUN", angle=0.0)
    stage.camera_above(1.6)
    shown = stage.render()
    x, _ = places((32, 32), 1.6)
    tolerance = 1e-3 if search != "BISECTION" else 5e-3
    np.testing.assert_allclose(shown["depth"][..., 0], 10.0 - 0.4 * x, atol=tolerance)
    normal = np.array([-0.4, 0.0, 1.0]) / np.sqrt(1.16)
    np.testing.assert_allclose(shown["normal"], np.broadcast_to(normal, shown["normal"].shape), atol=5e-3)
    np.testing.assert_allclose(shown["combined"][..., 0], 0.5 / np.pi * normal[2], rtol=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize("safe", [False, True])
def test_first_hits_on_a_cone_are_those_of_a_fine_search(stage, safe):
    """Seen at 30 degrees above the plane, so that its tip stands before what lies behind it."""
    stage.card(height_material(stage, cone, 0.8, safe=safe), 0, 1)
    stage.light("SUN", angle=0.0)
    eye, turn = np.array([0.0, -4.0, 2.3]), np.radians(60)
    stage.camera(eye, (turn, 0, 0), 0.5)
    depth = stage.render(size=(48, 48))["depth"][..., 0]
    tangent = np.tan(0.25)
    grid = (np.arange(48) + 0.5) / 24 - 1
    x, y = np.meshgrid(grid * tangent, grid * tangent)
    direction = x[..., None] * [1, 0, 0] + y[..., None] * [0, np.cos(turn), np.sin(turn)]
    direction = direction + [0, np.sin(turn), -np.cos(turn)]  # one unit along the axis, as depth counts
    t = np.linspace(2.0, 6.5, 9001)
    place = eye + direction[..., None, :] * t[:, None]
    above = place[..., 2] - 0.8 * np.maximum(0.0, 1.0 - np.hypot(place[..., 0], place[..., 1]))
    inside = np.abs(place[..., :2]).max(axis=-1) <= 1.0
    change = (above[..., :-1] * above[..., 1:] <= 0.0) & inside[..., 1:] & inside[..., :-1]
    first = np.where(change.any(axis=-1), t[np.argmax(change, axis=-1)], np.inf)
    both = np.isfinite(first) & (depth < 1e9)
    # A pixel more or less at the outline, none elsewhere.
    assert (np.isfinite(first) != (depth < 1e9)).sum() <= 6
    assert both.sum() > 300
    wrong = np.abs(depth - first)[both] > 4e-3
    assert wrong.mean() < 0.01


# Invariants ----------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_without_height_it_is_the_plain_surface(stage):
    def shown(mode, scale):
        stage.clear()
        stage.card(height_material(stage, noise, scale, 0.5, mode=mode), 0, 1)
        stage.light("SUN", turn=(0.4, 0.5, 0), angle=0.0)
        stage.camera_above(1.8)
        return stage.render()["combined"]

    np.testing.assert_allclose(shown("RELIEF", 1e-7), shown("BUMP", 1e-7), atol=1e-4)


def test_below_half_a_pixel_it_is_bump(stage):
    def shown(mode):
        stage.clear()
        stage.card(height_material(stage, noise, 0.01, 0.5, mode=mode), 0, 1)
        stage.light("SUN", turn=(0.4, 0.5, 0), angle=0.0)
        stage.camera_above(1.8)
        return stage.render(size=(32, 32))["combined"][..., :3]

    np.testing.assert_allclose(shown("RELIEF"), shown("BUMP"), atol=2e-3)


@pytest.mark.slow
def test_mirrored_maps_give_the_same_relief(stage):
    def shown(left, right, build):
        stage.clear()
        stage.card(height_material(stage, build, 0.5), left, right)
        stage.light("SUN", turn=(0.4, 0.9, 0), angle=0.0)
        stage.camera((0, -3, 2), (0.98, 0, 0), 0.7)
        return stage.render()["combined"]

    def backwards(nodes, join):
        turned = nodes.new("ShaderNodeMath")
        turned.operation = "SUBTRACT"
        turned.inputs[0].default_value = 1.0
        join(along_u(nodes, join), turned.inputs[1])
        return turned.outputs[0]

    np.testing.assert_allclose(shown(0, 1, along_u), shown(1, 0, backwards), atol=1e-4)


@pytest.mark.slow
def test_a_tile_border_leaves_no_seam(stage):
    """A card of one colour whose UV runs over three tiles of waves, lit from above: as bright as slopes make it."""

    def waves(nodes, join):
        wave = nodes.new("ShaderNodeMath")
        wave.operation = "SINE"
        turned = nodes.new("ShaderNodeMath")
        turned.operation, turned.inputs[1].default_value = "MULTIPLY", 2 * np.pi
        join(along_u(nodes, join), turned.inputs[0])
        join(turned.outputs[0], wave.inputs[0])
        return wave.outputs[0]

    stage.card(height_material(stage, waves, 0.05), 0, 3)
    stage.light("SUN", angle=0.0)
    stage.camera_above(1.8)
    light = stage.render(size=(96, 96))["combined"][:, :, 0]
    x, _ = places((96, 96), 1.8)
    slope = 0.05 * 2 * np.pi * 1.5 * np.cos(2 * np.pi * 1.5 * (x + 1))
    np.testing.assert_allclose(light, 0.5 / np.pi / np.sqrt(1 + slope**2), rtol=0.02)


@pytest.mark.parametrize(
    "case", ["no map", "flat map", "no number", "beyond all bounds", "within the shell", "no area", "mirrored object"]
)
def test_hard_cases_stay_finite(stage, case):
    def broken(nodes, join):
        root = nodes.new("ShaderNodeMath")
        root.operation = "LOGARITHM" if case == "no number" else "POWER"
        join(along_u(nodes, join), root.inputs[0])
        root.inputs[1].default_value = -1.0
        return root.outputs[0]

    build = broken if case in ("no number", "beyond all bounds") else noise
    made = height_material(stage, build, 0.4)
    placed = stage.card(made, 0, 1)
    layer = placed.data.uv_layers[0]
    if case == "no map":
        placed.data.uv_layers.remove(layer)
    elif case == "flat map":
        for k in range(4):
            layer.uv[k].vector = (0.3, 0.3)
    elif case == "no area":
        placed.scale = (1, 0, 1)
    elif case == "mirrored object":
        placed.scale = (-1, 1, 1)
    stage.light("SUN", turn=(0.4, 0.5, 0), angle=0.0)
    height = 0.2 if case == "within the shell" else 2.0
    stage.camera((0, -0.5 * height, height), (0.46, 0, 0), 0.9)
    shown = stage.render()  # which asks whether all is finite
    assert (shown["combined"] >= 0.0).all()
    again = stage.render()
    np.testing.assert_array_equal(shown["combined"], again["combined"])


def test_a_camera_within_the_shell_sees_the_relief_below_it(stage):
    """A ramp from 0 to 1 is .5 high in the middle, and the camera stands .2 above that."""
    stage.card(height_material(stage, along_u, 1.0), 0, 1)
    stage.light("SUN", angle=0.0)
    stage.camera((0, 0, 0.7), (0, 0, 0), 0.6)
    depth = stage.render()["depth"][..., 0]
    slope = (np.arange(32) + 0.5 - 16) / 16 * np.tan(0.3)
    # z = .5 + x / 2 and x = depth * slope, z = .7 - depth
    np.testing.assert_allclose(depth, np.broadcast_to(0.2 / (1 + 0.5 * slope), depth.shape), rtol=2e-3)


# What is chosen ------------------------------------------------------------------------------------------------------


def lattice(stage, material, count):
    made = relief_scenes.lattice(count, count, relief_scenes.flat, material)
    return made


@pytest.mark.parametrize(
    "method, count, mode, expected",
    [
        ("BUMP", 1, "AUTO", None), ("DISPLACEMENT", 1, "AUTO", "RELIEF"), ("BOTH", 1, "AUTO", "RELIEF"),
        ("DISPLACEMENT", 64, "AUTO", "MESH"), ("DISPLACEMENT", 1, "MESH", "MESH"), ("BUMP", 1, "RELIEF", "RELIEF"),
        ("DISPLACEMENT", 1, "BUMP", None),
    ],
)  # fmt: skip
def test_what_draws_the_displacement(stage, method, count, mode, expected):
    made = height_material(stage, noise, 0.3, method=method, mode=mode)
    lattice(stage, made, count)
    stage.light("SUN", angle=0.0)
    stage.camera_above(1.8)
    stage.render()
    assert set(stage.renderer.displacement.modes.values()) == ({expected} if expected else set())
    if expected is None:
        assert row_of(stage).state == SKIPPED
        assert row_of(stage).reason == "no material displaces its surface"


def test_more_steps_draw_anew_and_an_unchanged_scene_measures_nothing(stage):
    made = height_material(stage, cone, 0.8)
    stage.card(made, 0, 1)
    stage.light("SUN", angle=0.0)
    stage.camera_above(1.8)
    stage.render()
    known = dict(stage.renderer.displacement._measured)
    stage.render()
    assert row_of(stage).state == "reused"
    made.candela.relief_steps = 5
    stage.render()
    assert row_of(stage).state == RAN
    assert stage.renderer.displacement._measured == known


def test_an_object_that_moves_and_turns_is_measured_once(stage):
    placed = stage.card(height_material(stage, cone, 0.8), 0, 1)
    stage.light("SUN", angle=0.0)
    stage.camera_above(3.0)
    stage.render()
    known = dict(stage.renderer.displacement._measured)
    placed.location, placed.rotation_euler = (0.3, 0, 0), (0, 0, 0.5)
    moved = stage.render()["depth"][..., 0]
    assert list(stage.renderer.displacement._measured.values()) == list(known.values())
    x, y = places((32, 32), 3.0)
    inside = np.hypot(x - 0.3, y) < 0.7
    np.testing.assert_allclose(moved[inside], 9.2 + 0.8 * np.hypot(x - 0.3, y)[inside], atol=4e-3)


# Beside Cycles -------------------------------------------------------------------------------------------------------


def both(stage, samples=1, size=(32, 32)):
    return stage.render(samples, size), stage.render(samples, size, engine="CYCLES")


def vector(nodes, join):
    texture = nodes.new("ShaderNodeTexNoise")
    places = nodes.new("ShaderNodeTexCoord")
    join(places.outputs["UV"], texture.inputs["Vector"])
    return texture.outputs["Color"]


@pytest.mark.parametrize("smooth", [True, False])
@pytest.mark.parametrize("space, scale", [("OBJECT", (1, 1, 1)), ("OBJECT", (1.5, 1, 0.5)), ("WORLD", (1.5, 1, 0.5))])
def test_moved_vertices_are_those_of_cycles(stage, smooth, space, scale):
    made = height_material(stage, noise, 0.5, 0.5, mode="MESH", space=space)
    placed = lattice(stage, made, 24)
    placed.scale = scale
    if not smooth:
        placed.data.shade_flat()
    stage.light("SUN", turn=(0.4, 0.6, 0), angle=0.0)
    stage.camera((0, -3, 2.5), (0.87, 0, 0), 0.7)
    own, cycles = both(stage)
    hit = (own["depth"][..., 0] < 1e9) & (cycles["depth"][..., 0] < 1e9)
    assert ((own["depth"][..., 0] < 1e9) == (cycles["depth"][..., 0] < 1e9)).mean() > 0.99
    np.testing.assert_allclose(own["depth"][hit], cycles["depth"][hit], rtol=2e-3)
    difference = np.abs(own["combined"] - cycles["combined"])[hit][:, 0]
    assert np.mean(difference > 0.02 * cycles["combined"][hit][:, 0] + 1e-3) < 0.02


def test_detail_between_moved_vertices_is_bump_as_in_cycles(stage):
    """Displacement and Bump on a mesh that is too coarse for the noise: shape of the vertices, normals of the tree."""
    placed = lattice(stage, height_material(stage, noise, 0.3, 0.5, method="BOTH", mode="MESH"), 10)
    placed.rotation_euler = (0.1, 0.2, 0.3)
    stage.light("SUN", turn=(0.2, 0.3, 0), angle=0.0)
    stage.camera_above(1.6)
    own, cycles = both(stage)
    normals = np.einsum("hwc,hwc->hw", own["normal"], cycles["normal"])
    assert np.quantile(normals, 0.05) > np.cos(0.03)
    difference = np.abs(own["combined"] - cycles["combined"])[..., 0]
    assert np.mean(difference > 0.02 * cycles["combined"][..., 0] + 1e-3) < 0.05


@pytest.mark.parametrize("space", ["TANGENT", "OBJECT", "WORLD"])
def test_vertices_moved_by_vectors_are_those_of_cycles(stage, space):
    made = stage.diffuse(0.5)
    made.displacement_method = "DISPLACEMENT"
    nodes, join = made.node_tree.nodes, made.node_tree.links.new
    node = nodes.new("ShaderNodeVectorDisplacement")
    node.space = space
    node.inputs["Midlevel"].default_value, node.inputs["Scale"].default_value = 0.5, 0.6
    join(vector(nodes, join), node.inputs["Vector"])
    join(node.outputs[0], next(one for one in nodes if one.type == "OUTPUT_MATERIAL").inputs["Displacement"])
    lattice(stage, made, 32)
    stage.light("SUN", turn=(0.4, 0.6, 0), angle=0.0)
    stage.camera((0, -3, 2.5), (0.87, 0, 0), 0.7)
    own, cycles = both(stage)
    hit = (own["depth"][..., 0] < 1e9) & (cycles["depth"][..., 0] < 1e9)
    assert hit.sum() > 300
    np.testing.assert_allclose(own["depth"][hit], cycles["depth"][hit], rtol=2e-3)


def test_one_of_two_materials_moves_its_part(stage):
    made = height_material(stage, 1.0, 0.5, mode="MESH")
    placed = lattice(stage, made, 16)
    placed.data.materials.append(stage.diffuse(0.2))
    middles = np.zeros(3 * len(placed.data.polygons), np.float32)
    placed.data.polygons.foreach_get("center", middles)
    slots = (middles.reshape(-1, 3)[:, 0] > 0).astype(np.int32)
    placed.data.polygons.foreach_set("material_index", slots)
    stage.light("SUN", turn=(0.4, 0.6, 0), angle=0.0)
    stage.camera_above(1.9)
    own, cycles = both(stage)
    np.testing.assert_allclose(own["depth"], cycles["depth"], rtol=1e-4)


def test_relief_shadows_others_as_it_should(stage):
    """A cone of .8 metres under a low sun casts on the card that stands beside it as a cone of triangles does."""

    def shown(relief):
        stage.clear()
        made = height_material(stage, cone, 0.8, mode="RELIEF" if relief else "MESH")
        placed = stage.card(made, 0, 1) if relief else lattice(stage, made, 96)
        placed.location = (-1, 0, 0)
        stage.rectangle((0, -1), (1.5, 1), 0.0, material=stage.diffuse(0.5))
        stage.light("SUN", turn=(0, -1.15, 0), angle=0.0)
        stage.camera_above(3.0)
        return stage.render(16, (48, 48))["combined"][..., 0]

    relief, mesh = shown(True), shown(False)
    receiver = (slice(16, 32), slice(26, 44))
    assert (mesh[receiver] < 1e-3).any()
    assert (mesh[receiver] > 0.02).any()
    assert np.abs(relief - mesh)[receiver].mean() < 0.02 * mesh[receiver].max()


@pytest.mark.slow
def test_a_mirror_shows_the_relief(stage):
    """A cone of .8 metres seen in a mirror above it, aslant, as one of triangles is seen there."""

    def shown(mode):
        stage.clear()
        made = height_material(stage, cone, 0.8, mode="RELIEF" if mode == "relief" else "MESH")
        made = stage.diffuse(0.5) if mode == "flat" else made
        lattice(stage, made, 96) if mode == "mesh" else stage.card(made, 0, 1)
        mirror = stage.material("ShaderNodeBsdfGlossy", Color=(1, 1, 1, 1), Roughness=0.0)
        stage.rectangle((-3, -6), (3, 6), 4.0, material=mirror)
        stage.light("SUN", turn=(0, -1.1, 0), angle=0.0)
        stage.camera((0, -4.11, 2), (np.pi - 0.6, 0, 0), 0.45)
        image = stage.render(16, (48, 48), bounces=1)["combined"][..., 0]
        said[mode] = any("without outline" in note.text for note in latest().notes)
        return image

    said = {}
    relief, mesh, flat = shown("relief"), shown("mesh"), shown("flat")
    assert mesh.max() > 0.05
    assert [mode for mode in said if said[mode]] == ["relief"]
    # What the cone casts on itself rays do not see: the half that looks away from the sun is dark without.
    assert np.abs(relief - mesh).mean() < 0.25 * np.abs(flat - mesh).mean()


def test_back_faces_of_shells_show_nothing_from_outside(stage, monkeypatch):
    """What is left out of a shell that is seen from outside changes no pixel, mirrored objects included."""

    def shown():
        stage.clear()
        material = height_material(stage, cone, 0.8)
        stage.card(material, 0, 1)
        mirrored = stage.card(material, 0, 1)
        mirrored.location, mirrored.scale = (2.2, 0.0, 0.0), (-1.0, 1.0, 1.0)
        stage.light("SUN", turn=(0.4, 0.7, 0), angle=0.0)
        stage.camera((0.5, -5.0, 3.0), (np.radians(58), 0, 0), 0.6)
        return stage.render(2, (48, 32))

    left_out = shown()
    for module in (depth_maps, draw):
        monkeypatch.setattr(module, "entered", lambda draws, boxes, rows: frozenset())
    drawn = shown()
    for name in ("combined", "depth", "normal"):
        np.testing.assert_array_equal(left_out[name], drawn[name])


def test_a_wall_before_it_and_behind_it(stage):
    """A ramp that rises through a horizontal card: the border is where their heights are equal."""
    stage.card(height_material(stage, along_u, 1.0), 0, 1)
    red = stage.material("ShaderNodeBsdfDiffuse", Color=(0.8, 0.1, 0.1, 1))
    stage.rectangle((-1, -1), (1, 1), 0.3, material=red)
    stage.light("SUN", angle=0.0)
    stage.camera_above(1.8)
    color = stage.render(size=(64, 64))["diffuse_color"]
    x, _ = places((64, 64), 1.8)
    is_red = color[..., 0] > 2 * color[..., 1]
    step = 1.8 / 64
    assert is_red[x < -0.4 - step].all()
    assert not is_red[x > -0.4 + step].any()


def test_settings_of_the_material_are_in_its_panel(stage):
    from addon.techniques.relief import Relief

    made = bpy.data.materials.new("Any")
    for param in Relief.params:
        assert getattr(made.candela, f"relief_{param.name}") == param.default
