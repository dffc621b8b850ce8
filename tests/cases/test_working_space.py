"""Scenes whose colours are Rec. 2020 or ACEScg, beside Cycles: textures, spectra, skies, luminance, lamps."""

import bpy
import numpy as np
import pytest

from addon.compare.metrics import relative_squared_error
from addon.materials import working_space

from .conftest import agree

pytestmark = pytest.mark.skipif(bpy.app.version < (5, 0), reason="working spaces of Blender 5")


@pytest.fixture(params=["Linear Rec.2020", "ACEScg"])
def space(request, stage):
    def choose(name):
        bpy.ops.wm.set_working_color_space(working_space=name, convert_colors=False)

    choose(request.param)
    yield request.param
    choose("Linear Rec.709")
    working_space.follow(working_space.REC709)  # as the next picture would


def shown(stage, kind, output, **inputs):
    """A rectangle under the camera that emits what a node gives; the node and its tree."""
    stage.camera_above()
    material = stage.material("ShaderNodeEmission")
    stage.rectangle((-3, -3), (3, 3), material=material)
    tree = material.node_tree
    node = tree.nodes.new(kind)
    for name, value in inputs.items():
        node.inputs[name].default_value = value
    tree.links.new(node.outputs[output], tree.nodes["Emission"].inputs["Color"])
    return tree, node


def same(pictures, relative=0.01):
    own, cycles = (passes["combined"][..., :3] for passes in pictures)
    assert cycles.max() > 0.01
    assert relative_squared_error(own, cycles).mean() <= 0.01
    agree(own.mean((0, 1)), cycles.mean((0, 1)), relative, 0.003)


@pytest.mark.parametrize("kelvin", [1200.0, 3000.0, 6500.0, 11000.0])
def test_blackbody(stage, beside, space, kelvin):
    shown(stage, "ShaderNodeBlackbody", "Color", Temperature=kelvin)
    same(beside(1, (4, 4), 0, 1))


@pytest.mark.parametrize("nanometres", [450.0, 500.0, 530.0, 620.0])
def test_wavelength(stage, beside, space, nanometres):
    shown(stage, "ShaderNodeWavelength", "Color", Wavelength=nanometres)
    same(beside(1, (4, 4), 0, 1))


@pytest.mark.parametrize("kind", ["ShaderNodeRGBToBW", "ShaderNodeMath", "ShaderNodeClamp"])
def test_luminance(stage, beside, space, kind):
    tree, node = shown(stage, kind, 0)
    color = tree.nodes.new("ShaderNodeRGB")
    color.outputs[0].default_value = (0.7, 0.2, 0.1, 1)
    if kind == "ShaderNodeMath":
        node.operation = "ABSOLUTE"
    tree.links.new(color.outputs[0], node.inputs[0])
    same(beside(1, (4, 4), 0, 1))


@pytest.mark.parametrize("floats", [False, True])
@pytest.mark.parametrize("named", ["sRGB", "Linear Rec.709", "Non-Color"])
def test_texture(stage, beside, space, floats, named):
    _, node = shown(stage, "ShaderNodeTexImage", "Color")
    image = bpy.data.images.new("Texture", 4, 4, float_buffer=floats)
    image.colorspace_settings.name = named
    image.pixels.foreach_set(np.tile(np.array([0.9, 0.3, 0.1, 1.0], np.float32), 16))
    image.update()
    image.pack()
    node.image = image
    same(beside(1, (4, 4), 0, 1))


@pytest.mark.slow
def test_sky(stage, beside, space):
    stage.camera((0, 0, 1), (np.pi / 2 + 0.3, 0, 0), 1.2)
    tree = stage.world().node_tree
    sky = tree.nodes.new("ShaderNodeTexSky")
    sky.sun_disc = False
    background = next(node for node in tree.nodes if node.type == "BACKGROUND")
    tree.links.new(sky.outputs[0], background.inputs["Color"])
    same(beside(16, (24, 16), 0, 64), 0.02)


def test_sun_of_the_sky(stage, beside, space):
    stage.camera_above()
    stage.floor()
    tree = stage.world().node_tree
    sky = tree.nodes.new("ShaderNodeTexSky")
    sky.sun_elevation = 0.2
    background = next(node for node in tree.nodes if node.type == "BACKGROUND")
    background.inputs["Strength"].default_value = 0.05
    tree.links.new(sky.outputs[0], background.inputs["Color"])
    same(beside(32, (8, 8), 0, 256), 0.03)


@pytest.mark.parametrize("nodes", [False, True])
def test_lamp_of_a_temperature(stage, beside, space, nodes):
    stage.camera_above()
    stage.floor()
    light = stage.light("POINT").data
    if nodes:
        if bpy.app.version < (5, 2):
            light.use_nodes = True
        tree = light.node_tree
        color = tree.nodes.new("ShaderNodeBlackbody")
        color.inputs["Temperature"].default_value = 2500.0
        tree.links.new(color.outputs[0], next(n for n in tree.nodes if n.type == "EMISSION").inputs["Color"])
    else:
        light.use_temperature, light.temperature = True, 2500.0
    same(beside(8, (8, 8), 0, 64), 0.02)


def test_a_changed_space_is_seen(stage):
    shown(stage, "ShaderNodeBlackbody", "Color", Temperature=2000.0)
    before = stage.render(size=(4, 4))["combined"]
    bpy.ops.wm.set_working_color_space(working_space="ACEScg", convert_colors=False)
    try:
        assert not np.allclose(stage.render(size=(4, 4))["combined"], before, rtol=0.01)
    finally:
        bpy.ops.wm.set_working_color_space(working_space="Linear Rec.709", convert_colors=False)
    assert np.array_equal(stage.render(size=(4, 4))["combined"], before)
