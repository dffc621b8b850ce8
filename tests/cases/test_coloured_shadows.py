"""What colours light that passes straight through colours its shadow: lamps of every kind, and the world."""

import bpy
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


def blocked_alone(stage, lamp):
    """The lamp's shadows are those of what stands here alone, and of nothing else."""
    blockers = bpy.data.collections.new("Blockers")
    for one in stage.scene.objects:
        if one.type == "MESH":
            blockers.objects.link(one)
    lamp.light_linking.blocker_collection = blockers
    stage.rectangle((8, 8), (9, 9), 3.0, material=stage.diffuse())


@pytest.mark.parametrize("material", ["tinted", "mixed"])
@pytest.mark.parametrize("case", ["near", "narrow", "linked"])
def test_of_lamps_whose_visibility_rays_tell(stage, case, material):
    """A ball of light beside the floor, a beam narrower than a pixel, and shadow linking: as bright as through a clear
    pane times the pane's colour."""
    found = []
    for made in (None, MATERIALS[material]):
        stage.clear()
        stage.floor()
        stage.camera_above(0.02 if case == "narrow" else 1.0)
        if made is not None:
            stage.blocker((-9, -9), (9, 9), 0.3, material=made(stage))
        size = {"near": 0.5, "narrow": 0.0, "linked": 0.05}[case]
        beam = {"spot_size": 0.02, "spot_blend": 0.0} if case == "narrow" else {}
        lamp = stage.light("SPOT" if beam else "POINT", (0, 0, 1.0), shadow_soft_size=size, **beam)
        if case == "linked":
            blocked_alone(stage, lamp)
        found.append(stage.render(64, (16, 16))["combined"][5:11, 5:11, :3].mean((0, 1)))
    assert found[0].min() > 0
    passes = np.array(TINT[:3]) * (0.5 if material == "mixed" else 1.0)
    assert found[1] == pytest.approx(found[0] * passes, rel=0.05)


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
