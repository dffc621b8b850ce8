"""What is added to, or mixed with, a Transparent BSDF is drawn, without noise where it emits: fire, beams."""

import numpy as np
import pytest

from .conftest import agree


def shader(tree, kind, **inputs):
    node = tree.nodes.new(kind)
    for name, value in inputs.items():
        node.inputs[name.replace("_", " ")].default_value = value
    return node.outputs[0]


def layered(stage, combine, *parts, fac=0.5):
    """A material of two shaders by an Add or Mix Shader."""
    made = stage.material("ShaderNodeBsdfTransparent")
    tree = made.node_tree
    tree.nodes.remove(tree.nodes["Transparent BSDF"])
    node = tree.nodes.new(combine)
    if combine == "ShaderNodeMixShader":
        node.inputs[0].default_value = fac
    sockets = [socket for socket in node.inputs if socket.type == "SHADER"]
    for socket, (kind, inputs) in zip(sockets, parts):
        tree.links.new(shader(tree, kind, **inputs), socket)
    output = next(one for one in tree.nodes if one.type == "OUTPUT_MATERIAL")
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    return made


CLEAR = ("ShaderNodeBsdfTransparent", {"Color": (1, 1, 1, 1)})
TINTED = ("ShaderNodeBsdfTransparent", {"Color": (0.2, 0.9, 0.6, 1)})
DARK = ("ShaderNodeBsdfTransparent", {"Color": (0, 0, 0, 1)})
FIRE = ("ShaderNodeEmission", {"Color": (1, 0.4, 0.1, 1), "Strength": 1.5})
PAINT = ("ShaderNodeBsdfDiffuse", {"Color": (0.1, 0.3, 0.8, 1)})
GLOSS = ("ShaderNodeBsdfAnisotropic", {"Color": (0.5, 0.5, 0.5, 1), "Roughness": 0.6})
ADD, MIX = "ShaderNodeAddShader", "ShaderNodeMixShader"


def corner_means(pixels):
    height, width, channels = pixels.shape
    return pixels.reshape(4, height // 4, 4, width // 4, channels).mean((1, 3))


def background(stage):
    stage.rectangle((-2, -2), (2, 0), -1.0, material=stage.material("ShaderNodeEmission", Color=(0.2, 0.5, 0.3, 1)))
    stage.light("SUN", turn=(0.2, 0, 0), energy=2.0)
    stage.camera_above()


@pytest.mark.parametrize(
    ("clear", "over"), [(CLEAR, False), (CLEAR, True), (DARK, False), (DARK, True), (TINTED, False), (TINTED, True)]
)
def test_emission_added_to_transparency_is_drawn(stage, beside, clear, over):
    background(stage)
    stage.rectangle((-1, -2), (1.5, 2), material=layered(stage, ADD, FIRE, clear))
    if over:  # twice behind one another, and one behind a wall
        stage.rectangle((-2, -2), (0, 2), 0.3, material=layered(stage, ADD, CLEAR, FIRE))
        stage.rectangle((-2, -2), (2, 2), -2.0, material=layered(stage, ADD, CLEAR, FIRE))
    own, cycles = beside(16)
    agree(corner_means(own["combined"]), corner_means(cycles["combined"]))


@pytest.mark.parametrize("count", [2, 6])
def test_what_shines_behind_coloured_layers_has_their_colours(stage, count):
    """A stack of layers that are drawn in one call, by its closed form, exact with one sample; layers nearer than the
    fourth from behind colour what is farther, but not each other."""
    stage.camera_above()
    material = layered(stage, ADD, FIRE, TINTED)
    for k in range(count):
        stage.rectangle((-3, -3), (3, 3), 0.3 * ((5 * k) % count), material=material)
    tint, fire = np.array([0.2, 0.9, 0.6]), np.array([1.5, 0.6, 0.15])
    if count > 4:  # faint ones, so that what is left out of order is small
        tree = material.node_tree
        tree.nodes["Transparent BSDF"].inputs["Color"].default_value = (0.9, 0.98, 0.95, 1)
        tint = np.array([0.9, 0.98, 0.95])
    seen = np.zeros(3)
    for _ in range(count):
        seen = seen * tint + fire
    found = stage.render(128)["combined"][..., :3].mean((0, 1))
    assert np.allclose(found, seen, rtol=0.03), found / seen


def test_the_film_stays_transparent_behind_a_flame(stage, beside):
    stage.camera_above()
    stage.scene.render.film_transparent = True
    stage.rectangle((-1, -2), (1.5, 2), material=layered(stage, ADD, FIRE, CLEAR))
    own, cycles = beside(8, bounces=0)
    agree(corner_means(own["combined"]), corner_means(cycles["combined"]))


def test_a_flame_lights_what_is_around_it(stage, beside):
    stage.floor(material=stage.diffuse(0.8))
    flame = stage.rectangle((-0.3, -0.3), (0.3, 0.3), 0.5, material=layered(stage, ADD, CLEAR, FIRE))
    flame.data.materials[0].node_tree.nodes["Emission"].inputs["Strength"].default_value = 10
    stage.camera_above()
    own, cycles = beside(32, bounces=0)
    agree(corner_means(own["diffuse_direct"]), corner_means(cycles["diffuse_direct"]))


@pytest.mark.parametrize("clear", [CLEAR, TINTED], ids=["clear", "tinted"])
@pytest.mark.parametrize("lobe", [PAINT, GLOSS], ids=["paint", "gloss"])
def test_a_lobe_added_to_transparency_is_drawn(stage, beside, lobe, clear):
    background(stage)
    stage.rectangle((-1, -2), (1.5, 2), material=layered(stage, ADD, lobe, clear))
    own, cycles = beside(64, bounces=0)
    agree(corner_means(own["combined"]), corner_means(cycles["combined"]))


@pytest.mark.parametrize("fac", [0.1, 0.5])
def test_transparency_mixed_with_emission_is_no_noisier_than_emission(stage, fac):
    """Eight samples: exact where nothing is behind."""
    stage.camera_above()
    stage.rectangle((-3, -3), (3, 3), material=layered(stage, MIX, CLEAR, FIRE, fac=fac))
    found = stage.render(8)["combined"][..., :3]
    assert np.allclose(found, np.array([1.5, 0.6, 0.15]) * fac, rtol=1e-3)
