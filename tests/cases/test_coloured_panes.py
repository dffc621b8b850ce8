"""Panes that do nothing but let light pass, seen by the camera: free of noise, and their alpha is what they take."""

import numpy as np
import pytest

from .conftest import agree

TINT = (0.9, 0.3, 0.1, 1)
GREY = (0.5, 0.5, 0.5, 1)


def transparent(stage, color):
    return stage.material("ShaderNodeBsdfTransparent", Color=color)


def mixed(stage, kind, fac=0.5, **inputs):
    material = transparent(stage, TINT)
    nodes, links = material.node_tree.nodes, material.node_tree.links
    mix, other = nodes.new("ShaderNodeMixShader"), nodes.new(kind)
    for name, value in {"Fac": fac, **inputs}.items():
        node = mix if name == "Fac" else other
        node.inputs[name].default_value = value
    links.new(nodes["Transparent BSDF"].outputs[0], mix.inputs[1])
    links.new(other.outputs[0], mix.inputs[2])
    links.new(mix.outputs[0], nodes["Material Output"].inputs["Surface"])
    return material


def wall(stage):
    stage.floor(material=stage.material("ShaderNodeEmission", Color=(1, 1, 1, 1)))
    stage.camera_above()


PANES = {
    "tinted": lambda stage: transparent(stage, TINT),
    "grey": lambda stage: transparent(stage, GREY),
    "shining": lambda stage: mixed(stage, "ShaderNodeEmission", Color=(0.2, 0.4, 1, 1)),
}
SEEN = {"tinted": TINT, "grey": GREY, "shining": (0.55, 0.35, 0.55)}


@pytest.mark.parametrize("count", [1, 2])
@pytest.mark.parametrize("pane", PANES)
def test_one_sample_is_free_of_noise(stage, pane, count):
    wall(stage)
    for k in range(count):
        stage.rectangle((-9, -9), (9, 9), 0.5 + k, material=PANES[pane](stage))
    found = stage.render(1)["combined"][..., :3]
    seen = np.array(SEEN[pane][:3])
    glow = np.array([0.1, 0.2, 0.5]) if pane == "shining" else 0.0
    expected = seen if count == 1 else (seen * (seen - glow) + glow)
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), rtol=2e-3)


@pytest.mark.parametrize("pane", [*PANES, "added"])
@pytest.mark.parametrize("behind", [False, True])
def test_alpha_of_a_transparent_film_is_what_panes_take_away(stage, beside, pane, behind):
    stage.camera_above()
    stage.scene.render.film_transparent = True
    stage.world((0.3, 0.5, 0.2))
    made = PANES[pane](stage) if pane in PANES else mixed(stage, "ShaderNodeBsdfDiffuse", 0.4, Color=(0.5, 0.5, 0.5, 1))
    stage.rectangle((-1, -2), (1.5, 2), 0.5, material=made)
    if behind:
        stage.rectangle((-2, -1), (2, 1), 0.3, material=transparent(stage, (0.2, 0.8, 0.6, 1)))
    own, cycles = beside(1 if pane in PANES else 64, bounces=0)
    places = np.s_[2::4, 2::4]
    agree(own["combined"][places], cycles["combined"][places], absolute=0.03 if pane in PANES else 0.08)


@pytest.mark.parametrize("holds", ["object", "material"])
def test_panes_that_hold_out_cut_their_share(stage, beside, holds):
    wall(stage)
    stage.scene.render.film_transparent = True
    material = mixed(stage, "ShaderNodeHoldout") if holds == "material" else transparent(stage, TINT)
    stage.rectangle((-1, -9), (1, 9), 0.5, material=material).is_holdout = holds == "object"
    own, cycles = beside(64)
    agree(own["combined"].mean((0, 1)), cycles["combined"].mean((0, 1)))


def test_a_card_of_two_shaders_has_its_colours(stage, beside):
    wall(stage)
    stage.light("SUN", energy=2.0)
    paint = mixed(stage, "ShaderNodeBsdfDiffuse", 0.4, Color=(0.1, 0.6, 0.2, 1))
    stage.rectangle((-9, -9), (9, 9), 0.5, material=paint)
    own, cycles = beside(64)
    agree(own["combined"][..., :3].mean((0, 1)), cycles["combined"][..., :3].mean((0, 1)))
