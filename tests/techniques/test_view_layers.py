"""What a view layer leaves out, overrides and asks for, beside Cycles."""

import bpy
import numpy as np
import pytest

from addon.compare.reference import render_passes

SIZE = (24, 24)
SURFACE, STRANDS, POINTS = 1, 2, 3  # pass indices


@pytest.fixture
def layer(stage):
    """Of a stage with a surface, thick strands and (from Blender 5.0 on) points side by side."""
    stage.rectangle((-2, -2), (-0.8, 2), material=stage.diffuse()).pass_index = SURFACE
    strands = bpy.data.hair_curves.new("Hair")
    strands.add_curves([2])
    strands.attributes["position"].data.foreach_set("vector", np.array([0, -2, 0, 0, 2, 0], np.float32))
    (strands.attributes.get("radius") or strands.attributes.new("radius", "FLOAT", "POINT")).data.foreach_set(
        "value", np.full(2, 0.4, np.float32)
    )
    stage.link("Hair", strands).pass_index = STRANDS
    cloud = bpy.data.pointclouds.new("Cloud")
    if hasattr(cloud, "resize"):
        cloud.resize(1)
        cloud.attributes["position"].data.foreach_set("vector", np.array([1.3, 0, 0], np.float32))
        (cloud.attributes.get("radius") or cloud.attributes.new("radius", "FLOAT", "POINT")).data.foreach_set(
            "value", np.full(1, 0.5, np.float32)
        )
        stage.link("Cloud", cloud).pass_index = POINTS
    stage.light("SUN", (0, 0, 5))
    stage.camera_above()
    found = stage.scene.view_layers[0]
    found.use_pass_object_index = True
    yield found
    found.use_pass_object_index, found.samples = False, 0
    for switch in ("use_solid", "use_strand"):
        setattr(found, switch, True)


@pytest.mark.parametrize("left_out", [(), ("use_solid",), ("use_strand",), ("use_solid", "use_strand")])
def test_surfaces_and_curves_can_be_left_out(stage, layer, left_out):
    for switch in left_out:
        setattr(layer, switch, False)
    own, cycles = (
        set(np.unique(render_passes(stage.scene, engine, 1, 1, direct_only=True, size=SIZE).images["object_index"]))
        for engine in ("CANDELA", "CYCLES")
    )
    assert own == cycles
    assert (SURFACE in own) == ("use_solid" not in left_out)
    assert (STRANDS in own) == ("use_strand" not in left_out)


@pytest.mark.slow
def test_a_number_of_samples_of_its_own_counts_in_final_renders(stage, layer):
    stage.scene.candela.samples = 2
    stage.scene.render.engine = "CANDELA"
    for own, expected in ((5, 5), (0, 2)):
        layer.samples = own
        bpy.ops.render.render(scene=stage.scene.name)
        assert stage.ledger.samples == expected


@pytest.mark.slow
def test_comparisons_have_the_number_of_samples_they_ask_for(stage, layer):
    layer.samples = 7
    render_passes(stage.scene, "CANDELA", 3, 1, size=SIZE)
    assert stage.ledger.samples == 3
    assert layer.samples == 7
