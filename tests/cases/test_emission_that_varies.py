"""Light of what varies within a material or over its instances: coloured bulbs, screens, moving lamps."""

import bpy
import numpy as np
import pytest

from .conftest import agree


def bulb(stage, output="Color", strength=5.0, node="ShaderNodeObjectInfo"):
    """An emission whose colour is what a node says."""
    made = stage.material("ShaderNodeEmission", Strength=strength)
    tree = made.node_tree
    tree.links.new(tree.nodes.new(node).outputs[output], tree.nodes["Emission"].inputs["Color"])
    return made


def hidden_card(stage, material, half, place, color=(1, 1, 1, 1)):
    card = stage.rectangle((-half, -half), (half, half), material=material, location=place)
    card.visible_camera, card.color = False, color
    return card


def thirds(pixels):
    """(3, 3) colours of the left, middle and right third, around the middle row."""
    height, width = pixels.shape[:2]
    middle = pixels[height // 3 : -height // 3, :, :3]
    return np.stack([middle[:, k * width // 3 : (k + 1) * width // 3].mean((0, 1)) for k in range(3)])


@pytest.mark.slow
@pytest.mark.parametrize("roughness", [1.0, 0.3])
def test_bulbs_of_one_material_shine_in_their_objects_colours(stage, beside, roughness):
    stage.floor(2.0, material=stage.principled(Base_Color=(0.8, 0.8, 0.8, 1), Roughness=roughness))
    shade = bulb(stage)
    mesh = None
    for x, color in ((-1.3, (1, 0, 0, 1)), (0, (0, 1, 0, 1)), (1.3, (0, 0, 1, 1))):
        card = hidden_card(stage, shade, 0.2, (x, 0, 0.4), color)
        mesh = mesh or card.data
        card.data = mesh  # instances
    stage.camera_above()
    own, cycles = beside(32, reference=256)
    agree(thirds(own["combined"]), thirds(cycles["combined"]))


@pytest.mark.parametrize("output", ["Random", "Object Index", "Location"])
def test_lamps_may_differ_by_anything_that_the_object_says(stage, beside, output):
    stage.floor(2.0, material=stage.diffuse(0.8))
    shade = bulb(stage, output, 3.0)
    for index, x in enumerate((-1.3, 0.0, 1.3)):
        hidden_card(stage, shade, 0.2, (x, 0.2, 0.4)).pass_index = index
    stage.camera_above()
    own, cycles = beside(32, bounces=0, reference=256)
    agree(thirds(own["combined"]), thirds(cycles["combined"]))


@pytest.mark.slow
def test_a_screen_lights_by_what_it_shows_where_it_shows_it(stage, beside):
    image = bpy.data.images.new("Screen", 4, 4, float_buffer=True)
    pixels = np.zeros((4, 4, 4), np.float32)
    pixels[..., 3], pixels[:, 0, 0], pixels[:, 3, 2], pixels[1:3, 1:3, 1] = 1, 6, 6, 2
    image.pixels.foreach_set(pixels.reshape(-1))
    made = stage.material("ShaderNodeEmission")
    tree = made.node_tree
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image, texture.interpolation = image, "Closest"
    tree.links.new(texture.outputs["Color"], tree.nodes["Emission"].inputs["Color"])
    card = stage.card(made, 0.0, 1.0, location=(0, 0, 0.3))
    card.visible_camera = False
    stage.floor(2.0, material=stage.diffuse(0.8))
    stage.camera_above()
    own, cycles = beside(256, bounces=0, reference=256)
    agree(thirds(own["combined"]), thirds(cycles["combined"]))


def test_an_animated_object_colour_is_followed(stage, beside):
    stage.floor(2.0, material=stage.diffuse(0.8))
    card = hidden_card(stage, bulb(stage), 0.4, (0, 0, 0.5))
    stage.camera_above()
    for color in ((1, 0, 0, 1), (0, 1, 0, 1), (0, 0, 1, 1)):
        card.color = color
        own, cycles = beside(16, (16, 16), bounces=0)
        agree(thirds(own["combined"]), thirds(cycles["combined"]))


def test_emission_by_place_follows_a_moving_lamp(stage, beside):
    stage.floor(2.0, material=stage.diffuse(0.8))
    card = hidden_card(stage, bulb(stage, "Position", 4.0, "ShaderNodeNewGeometry"), 0.3, (0.2, 0.2, 0.5))
    stage.camera_above()
    for x in (0.3, 1.2):
        card.location.x = x
        own, cycles = beside(32, (16, 16), bounces=0, reference=128)
        agree(thirds(own["combined"]), thirds(cycles["combined"]))


@pytest.mark.slow
def test_the_bounce_of_an_animated_object_colour_is_followed(stage, beside):
    stage.floor(1.0, material=stage.diffuse(0.8))
    paint = stage.principled()
    tree = paint.node_tree
    tree.links.new(
        tree.nodes.new("ShaderNodeObjectInfo").outputs["Color"], tree.nodes["Principled BSDF"].inputs["Base Color"]
    )
    wall = stage.rectangle((-0.9, -0.9), (0.9, 0.9), material=paint, turn=(0, 1.5708, 0), location=(-0.3, 0, 0.9))
    stage.light("SUN", turn=(0, 0.9, 0), energy=5.0)
    stage.camera_above(2.0, 5.0)
    for color in ((0.9, 0, 0, 1), (0, 0.9, 0, 1), (0, 0, 0.9, 1)):
        wall.color = color
        own, cycles = beside(32, (64, 64))
        cell = np.s_[26:38, 24:30, :3]
        agree(own["combined"][cell].mean((0, 1)), cycles["combined"][cell].mean((0, 1)))


@pytest.mark.slow
def test_the_opacity_of_animated_objects_is_followed_by_light_of_the_world(stage, beside):
    """Two lids of one mesh and material, whose alphas go opposite ways."""
    fading = stage.material("ShaderNodeBsdfTransparent")
    tree = fading.node_tree
    mix, dark = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new("ShaderNodeBsdfDiffuse")
    dark.inputs["Color"].default_value = (0, 0, 0, 1)
    tree.links.new(tree.nodes.new("ShaderNodeObjectInfo").outputs["Alpha"], mix.inputs[0])
    tree.links.new(tree.nodes["Transparent BSDF"].outputs[0], mix.inputs[1])
    tree.links.new(dark.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], next(n for n in tree.nodes if n.type == "OUTPUT_MATERIAL").inputs["Surface"])
    stage.floor(2.0, material=stage.diffuse(0.8))
    lids = [hidden_card(stage, fading, 0.9, (x, 0, 0.3)) for x in (-1.1, 1.1)]
    lids[1].data = lids[0].data
    stage.world()
    stage.camera_above()
    for alpha in (1.0, 0.5, 0.0):
        lids[0].color, lids[1].color = (1, 1, 1, alpha), (1, 1, 1, 1 - alpha)
        own, cycles = beside(32, (24, 24), bounces=0, reference=128)
        agree(thirds(own["combined"]), thirds(cycles["combined"]))
