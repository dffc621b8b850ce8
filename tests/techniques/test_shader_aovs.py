"""Shader AOVs and the UV pass beside Cycles' own, read back by OpenEXR."""

import numpy as np
import pytest

from addon.frame.ledger import RAN, SKIPPED

SPAN = 4.0
ONE_STEP = 1.0 / 255.0


def ask(stage, **aovs):
    for name, kind in aovs.items():
        made = stage.layer.aovs.add()
        made.name, made.type = name, kind


def give(stage, material, name, socket, value=None, link=None):
    """An AOV Output node in a material, of a constant or fed by a node's output (node type, output)."""
    tree = material.node_tree
    output = tree.nodes.new("ShaderNodeOutputAOV")
    output.aov_name = name
    if value is not None:
        output.inputs[socket].default_value = value
    if link is not None:
        tree.links.new(tree.nodes.new(link[0]).outputs[link[1]], output.inputs[socket])
    return output


def all_or_none(values, most):
    """Where a pixel holds one surface alone: edges are another test."""
    return (np.abs(values) < 1e-5) | (np.abs(values - most) < 1e-5)


def steps(stage):
    """A floor with UV seen at an angle, and a pane before its left half."""
    stage.camera((0, -3, 4), (0.6, 0, 0), angle=1.0)
    floor = stage.rectangle((-2, -2), (2, 2), material=stage.diffuse(0.4))
    uv = floor.data.uv_layers.new(name="UVMap")
    for corner, place in enumerate([(0, 0), (1, 0), (1, 2), (0, 2)]):
        uv.uv[corner].vector = place
    return floor


def test_colour_value_and_uv_are_those_of_cycles(written):
    stage = written
    floor = steps(stage)
    plain = stage.rectangle((-0.4, -0.4), (0.4, 0.4), 0.8, material=stage.diffuse(0.8))
    ask(stage, tint="COLOR", height="VALUE", level="VALUE", nothing="COLOR")
    stage.layer.use_pass_uv = True
    material = floor.data.materials[0]
    give(stage, material, "tint", "Color", link=("ShaderNodeTexCoord", "UV"))
    give(stage, material, "height", "Value", link=("ShaderNodeNewGeometry", "Position"))
    give(stage, plain.data.materials[0], "level", "Value", value=2.5)
    give(stage, plain.data.materials[0], "tint", "Color", value=(0.1, 0.2, 3.0, 1.0))
    give(stage, plain.data.materials[0], "not asked for", "Value", value=9.0)
    own, cycles = stage.both(16, 256)
    for name in ("tint", "height", "level", "nothing", "UV"):
        assert own[name].shape == cycles[name].shape, name
    inside = all_or_none(cycles["UV"][..., 2], 1.0)
    for passes in (own, cycles):
        inside &= all_or_none(passes["level"][..., 0], 2.5)
    assert inside.mean() > 0.7 and abs(own["UV"][..., 2].max() - 1.0) < 1e-5
    for name in ("tint", "height", "level", "nothing", "UV"):
        difference = np.abs(own[name] - cycles[name])[inside]
        print(f"{name}: {difference.max():.1e}")
        assert difference.max() < ONE_STEP, name
    assert stage.ledger.row("shader_aovs").state == RAN


@pytest.mark.slow
def test_aovs_at_edges_have_the_pixel_filter(written):
    stage = written
    stage.scene.render.filter_size = 1.5
    stage.camera_above(SPAN)
    shown = stage.diffuse(0.5)
    stage.rectangle((-1.03, -1.21), (0.71, 0.93), material=shown, turn=(0, 0, 0.3))
    ask(stage, level="VALUE")
    give(stage, shown, "level", "Value", value=1.0)
    own, cycles = stage.both(1024, 4096)
    difference = np.abs(own["level"] - cycles["level"])
    print(f"edges: {difference.max():.4f} at most, {np.sqrt((difference**2).mean()):.5f} in the mean")
    assert difference.max() < 2 * ONE_STEP and np.sqrt((difference**2).mean()) < ONE_STEP


@pytest.mark.slow
@pytest.mark.parametrize("threshold", [0.5, 0.2, 0.0])
def test_layers_show_as_in_cycles(written, threshold):
    """Of opacity 0.4 and 0.7, before a floor: which of them hide the rest depends on the alpha threshold."""
    stage = written
    stage.camera_above(SPAN)
    stage.layer.pass_alpha_threshold = threshold
    ask(stage, level="VALUE")
    for z, opacity, low, level in ((0.0, 1.0, -9, 1.0), (1.0, 0.7, -0.5, 2.0), (2.0, 0.4, 0.0, 4.0)):
        # Cycles passes a thin layer by the weights of its closures: with a white one beside it by the opacity.
        material = stage.principled(Base_Color=(1, 1, 1, 1), Specular_IOR_Level=0.0, Alpha=opacity)
        give(stage, material, "level", "Value", value=level)
        stage.rectangle((low, -9), (9, 9), z, material=material)
    own, cycles = stage.both(64, 2048, bounces=8)
    for columns in (slice(0, 17), slice(19, 23), slice(26, 48)):
        ours, theirs = own["level"][:, columns].mean(), cycles["level"][:, columns].mean()
        print(f"threshold {threshold}: {ours:.4f} {theirs:.4f}")
        assert abs(ours - theirs) < 4 * ONE_STEP


def test_groups_of_nodes_and_more_than_six_images(written):
    import bpy

    stage = written
    stage.camera_above(SPAN)
    material = stage.diffuse(0.5)
    stage.floor(material=material)
    names = [f"c{k}" for k in range(8)]
    ask(stage, **dict.fromkeys(names, "COLOR"), **{f"v{k}": "VALUE" for k in range(5)})
    inner = bpy.data.node_groups.new("Inner", "ShaderNodeTree")
    for k, name in enumerate(names):
        node = inner.nodes.new("ShaderNodeOutputAOV")
        node.aov_name, node.inputs["Color"].default_value = name, (k, 0.5, 0.25, 1.0)
    material.node_tree.nodes.new("ShaderNodeGroup").node_tree = inner
    for k in range(5):
        give(stage, material, f"v{k}", "Value", value=10.0 + k)
    own, cycles = stage.both(2)
    for k, name in enumerate(names):
        np.testing.assert_allclose(own[name], cycles[name], atol=1e-5)
        np.testing.assert_allclose(own[name][..., 0], k, atol=1e-5)
    for k in range(5):
        np.testing.assert_allclose(own[f"v{k}"], 10.0 + k, rtol=1e-6)


def test_nothing_runs_where_none_is_asked_for_and_the_picture_is_the_same(written):
    stage = written
    floor = steps(stage)
    stage.light("POINT", (0.5, 0, 2))
    give(stage, floor.data.materials[0], "level", "Value", value=2.0)
    before = stage.written("CANDELA", 4)
    row = stage.ledger.row("shader_aovs")
    assert row.state == SKIPPED and "asks for no AOV" in row.reason
    ask(stage, level="VALUE")
    after = stage.written("CANDELA", 4)
    assert stage.ledger.row("shader_aovs").counters["passes"] > 0
    assert "level" in after and "level" not in before
    np.testing.assert_array_equal(before["Combined"], after["Combined"])
