"""What colours light that passes straight through colours its shadow: lamps of every kind, and the world."""

import numpy as np
import pytest

from .conftest import agree

TINT = (0.9, 0.3, 0.2, 1)


def pane(stage, material, z=0.5):
    stage.rectangle((-1, -1), (1, 1), z, material=material).visible_camera = False


def mixed(stage):
    material = stage.material("ShaderNodeBsdfTransparent", Color=TINT)
    nodes, links = material.node_tree.nodes, material.node_tree.links
    mix, diffuse = nodes.new("ShaderNodeMixShader"), nodes.new("ShaderNodeBsdfDiffuse")
    links.new(nodes["Transparent BSDF"].outputs[0], mix.inputs[1])
    links.new(diffuse.outputs[0], mix.inputs[2])
    links.new(mix.outputs[0], nodes["Material Output"].inputs["Surface"])
    return material


def textured(stage):
    material = stage.material("ShaderNodeBsdfTransparent")
    checker = material.node_tree.nodes.new("ShaderNodeTexChecker")
    for name, value in (("Scale", 1.0), ("Color1", TINT), ("Color2", (0.1, 0.3, 0.9, 1))):
        checker.inputs[name].default_value = value
    material.node_tree.links.new(checker.outputs[0], material.node_tree.nodes["Transparent BSDF"].inputs[0])
    return material


MATERIALS = {
    "tinted": lambda stage: stage.material("ShaderNodeBsdfTransparent", Color=TINT),
    "mixed": mixed, "textured": textured,
}  # fmt: skip


def same(pictures, places=np.s_[8:24, 8:24]):
    own, cycles = (passes["combined"][places][..., :3].mean((0, 1)) for passes in pictures)
    agree(own, cycles, relative=0.03, absolute=0.005)


@pytest.mark.parametrize("material", MATERIALS)
@pytest.mark.parametrize(("kind", "settings"), [
    ("SUN", {"angle": 0.05}), ("POINT", {"shadow_soft_size": 0.2}), ("SPOT", {"spot_size": 2.0}),
    ("AREA", {"size": 1.0}),
])  # fmt: skip
def test_of_lamps(stage, beside, material, kind, settings):
    stage.floor()
    stage.camera_above()
    pane(stage, MATERIALS[material](stage))
    stage.light(kind, **settings)
    same(beside(32, bounces=0, reference=128))


def test_of_the_world(stage, beside):
    stage.floor()
    stage.camera_above()
    pane(stage, MATERIALS["tinted"](stage))
    stage.world()
    same(beside(32, bounces=0, reference=256))


def test_panes_behind_each_other_multiply(stage, beside):
    stage.floor()
    stage.camera_above()
    pane(stage, stage.material("ShaderNodeBsdfTransparent", Color=(0.9, 0.8, 0.2, 1)), 0.3)
    pane(stage, stage.material("ShaderNodeBsdfTransparent", Color=(0.2, 0.9, 0.9, 1)), 0.5)
    stage.light("SUN")
    same(beside(32, bounces=0))


@pytest.mark.slow
def test_glass_that_bends_no_light(stage, beside):
    stage.scene.cycles.caustics_refractive = stage.scene.cycles.caustics_reflective = False
    try:
        stage.floor()
        stage.camera_above()
        pane(stage, stage.material("ShaderNodeBsdfGlass", Color=TINT, IOR=1.0))
        stage.light("SUN")
        own, cycles = beside(32, bounces=4)
        assert np.isfinite(cycles["combined"]).all()
        agree(own["combined"][2:6, 2:6, :3].mean((0, 1)), cycles["combined"][2:6, 2:6, :3].mean((0, 1)))
    finally:
        stage.scene.cycles.caustics_refractive = stage.scene.cycles.caustics_reflective = True


def test_grey_casters_need_no_maps_by_channel(stage):
    stage.floor()
    stage.camera_above()
    grey = stage.see_through(0.5)
    pane(stage, grey)
    stage.light("POINT")
    stage.render(2)
    row = stage.ledger.row("direct_light")
    before = row.counters["light samples"]
    nodes, links = grey.node_tree.nodes, grey.node_tree.links
    tinted = nodes.new("ShaderNodeBsdfTransparent")
    tinted.inputs["Color"].default_value = TINT
    links.new(tinted.outputs[0], nodes["Material Output"].inputs["Surface"])
    stage.render(2)
    assert stage.ledger.row("direct_light").counters["light samples"] == 3 * before
