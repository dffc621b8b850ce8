"""Lights in Cycles' meaning: power x colour x temperature x 2^exposure, sizes as Blender defines them."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix


def only_light(snapshot):
    (light,) = snapshot.lights
    return light


def test_strength_is_power_times_colour_times_two_to_the_exposure(stage):
    stage.light("POINT", energy=100.0, color=(1.0, 0.5, 0.25), exposure=2.0)
    assert only_light(stage.take()).strength == pytest.approx([400, 200, 100])


def test_temperature_multiplies_the_colour(stage):
    placed = stage.light("POINT", energy=2.0, color=(1.0, 0.5, 0.25))
    placed.data.use_temperature, placed.data.temperature = True, 3000.0
    tint = np.array(placed.data.temperature_color[:3])
    assert tint[0] > tint[2]
    assert only_light(stage.take()).strength == pytest.approx(tint * (2.0, 1.0, 0.5), rel=1e-6)


def test_negative_power_stays_and_zero_power_is_no_light(stage):
    stage.light("POINT", energy=-5.0)
    stage.light("SUN", energy=0.0)
    assert only_light(stage.take()).strength.tolist() == [-5, -5, -5]


def test_point_and_spot_have_a_radius_and_a_falloff(stage):
    stage.light("POINT", shadow_soft_size=0.3, use_soft_falloff=False, energy=1.0)
    stage.light("SPOT", shadow_soft_size=0.1, spot_size=1.0, spot_blend=0.4, energy=1.0, use_soft_falloff=True)
    point, spot = stage.take().lights
    assert (point.kind, point.radius, point.soft_falloff) == ("POINT", pytest.approx(0.3), False)
    assert (spot.kind, spot.radius, spot.soft_falloff) == ("SPOT", pytest.approx(0.1), True)
    assert (spot.spot_angle, spot.spot_blend) == (pytest.approx(1.0), pytest.approx(0.4))


def test_a_sun_has_an_angle(stage):
    stage.light("SUN", angle=0.2, energy=3.0)
    light = only_light(stage.take())
    assert (light.kind, light.angle) == ("SUN", pytest.approx(0.2))
    assert light.strength.tolist() == [3, 3, 3]


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        ("SQUARE", ("RECTANGLE", 2.0, 2.0)),
        ("RECTANGLE", ("RECTANGLE", 2.0, 0.5)),
        ("DISK", ("ELLIPSE", 2.0, 2.0)),
        ("ELLIPSE", ("ELLIPSE", 2.0, 0.5)),
    ],
)
def test_the_four_area_shapes(stage, shape, expected):
    stage.light("AREA", shape=shape, size=2.0, size_y=0.5, spread=1.5, energy=1.0)
    light = only_light(stage.take())
    assert (light.shape, *light.size) == expected
    assert light.spread == pytest.approx(1.5)


def test_the_matrix_keeps_the_scale(stage):
    stage.light("AREA", energy=1.0).matrix_world = Matrix.Translation((1, 2, 3)) @ Matrix.Diagonal((2, 3, 4, 1))
    assert only_light(stage.take()).matrix.tolist() == [[2, 0, 0, 1], [0, 3, 0, 2], [0, 0, 4, 3], [0, 0, 0, 1]]


def test_flags_of_shadow_normalisation_and_rays(stage):
    placed = stage.light("AREA", energy=1.0, use_shadow=False, normalize=False)
    placed.visible_camera, placed.visible_glossy = True, False
    light = only_light(stage.take())
    assert (light.cast_shadow, light.normalize) == (False, False)
    assert (light.visibility.camera, light.visibility.glossy, light.visibility.diffuse) == (True, False, True)


def test_portals_give_no_light(stage):
    placed = stage.light("AREA", energy=1.0)
    if not hasattr(placed.data, "cycles"):
        pytest.skip("this Blender has no Cycles")
    placed.data.cycles.is_portal = True
    assert stage.take().lights == ()


def test_instanced_lights_are_lights(stage):
    made = bpy.data.collections.new("Collection")
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    made.objects.link(lamp)
    for x in range(2):
        empty = stage.link("Empty", None, Matrix.Translation((x, 0, 0)))
        empty.instance_type, empty.instance_collection = "COLLECTION", made
    lights = stage.take().lights
    assert sorted(light.matrix[0, 3] for light in lights) == [0, 1]
    assert len({light.key for light in lights}) == 2


def emission_of(placed, stage):
    tree = stage.use_nodes(placed.data)
    return tree, next(node for node in tree.nodes if node.type == "EMISSION")


def test_a_constant_emission_multiplies(stage):
    placed = stage.light("POINT", energy=10.0, color=(1.0, 0.5, 1.0))
    _, emission = emission_of(placed, stage)
    emission.inputs["Color"].default_value = (0.5, 1.0, 0.1, 1.0)
    emission.inputs["Strength"].default_value = 3.0
    snapshot = stage.take()
    assert only_light(snapshot).strength == pytest.approx([15, 15, 3])
    assert snapshot.notes == ()


def test_values_linked_to_the_emission_are_followed(stage):
    placed = stage.light("POINT", energy=1.0)
    tree, emission = emission_of(placed, stage)
    rgb, value = tree.nodes.new("ShaderNodeRGB"), tree.nodes.new("ShaderNodeValue")
    rgb.outputs[0].default_value = (0.2, 0.4, 0.6, 1.0)
    value.outputs[0].default_value = 5.0
    tree.links.new(rgb.outputs[0], emission.inputs["Color"])
    tree.links.new(value.outputs[0], emission.inputs["Strength"])
    snapshot = stage.take()
    assert only_light(snapshot).strength == pytest.approx([1, 2, 3])
    assert snapshot.notes == ()


@pytest.mark.parametrize(("output", "smooth", "exact"), [("Quadratic", 0.0, True), ("Quadratic", 1.0, False),
                                                         ("Linear", 0.0, False)])  # fmt: skip
def test_light_falloff_with_the_square_is_its_strength_and_others_are_run(stage, output, smooth, exact):
    placed = stage.light("POINT", energy=2.0)
    tree, emission = emission_of(placed, stage)
    falloff = tree.nodes.new("ShaderNodeLightFalloff")
    falloff.inputs["Strength"].default_value, falloff.inputs["Smooth"].default_value = 30.0, smooth
    tree.links.new(falloff.outputs[output], emission.inputs["Strength"])
    snapshot = stage.take()
    light = only_light(snapshot)
    assert light.strength == pytest.approx([60, 60, 60] if exact else [2, 2, 2])
    assert (light.graph is None) == exact and snapshot.notes == ()


def test_a_tree_that_varies_over_the_light_comes_with_it(stage):
    placed = stage.light("SPOT", energy=1.0)
    tree, emission = emission_of(placed, stage)
    noise = tree.nodes.new("ShaderNodeTexNoise")
    tree.links.new(noise.outputs[0], emission.inputs["Strength"])
    snapshot = stage.take()
    light = only_light(snapshot)
    assert "ShaderNodeTexNoise" in {node.type for node in light.graph.nodes.values()}
    assert light.strength.tolist() == [1, 1, 1] and snapshot.notes == ()


@pytest.mark.skipif(bpy.app.version >= (5, 2), reason="lights always use nodes from Blender 5.2 on")
def test_nodes_that_are_switched_off_do_not_count(stage):
    placed = stage.light("POINT", energy=1.0)
    _, emission = emission_of(placed, stage)
    emission.inputs["Strength"].default_value = 9.0
    placed.data.use_nodes = False
    assert only_light(stage.take()).strength.tolist() == [1, 1, 1]


def test_a_light_whose_output_is_not_linked_is_dark(stage):
    placed = stage.light("POINT", energy=1.0)
    tree, _ = emission_of(placed, stage)
    tree.links.clear()
    assert stage.take().lights == ()
