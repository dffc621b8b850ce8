"""Principled Hair as a stand-in: a single fibre sends on about as much of even light as in Cycles."""

import bpy
import numpy as np
import pytest

from .conftest import agree


@pytest.mark.slow
@pytest.mark.parametrize(("parametrization", "inputs"), [
    ("COLOR", {}), ("COLOR", {"Color": (0.8, 0.4, 0.1, 1)}), ("MELANIN", {"Melanin": 0.5, "Melanin Redness": 0.3}),
    ("ABSORPTION", {"Absorption Coefficient": (0.2, 0.5, 1.3)}),
])  # fmt: skip
def test_a_fibre_in_a_white_room(stage, beside, parametrization, inputs):
    material = stage.material("ShaderNodeBsdfHairPrincipled")
    node = material.node_tree.nodes["Principled Hair BSDF"]
    node.parametrization = parametrization
    for name, value in inputs.items():
        node.inputs[name].default_value = value
    hair = bpy.data.hair_curves.new("Hair")
    hair.add_curves([2])
    hair.attributes["position"].data.foreach_set("vector", [0, -3, 0, 0, 3, 0])
    radius = hair.attributes.get("radius") or hair.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", [0.5, 0.5])
    hair.materials.append(material)
    stage.link("Hair", hair)
    stage.world()
    stage.camera_above()
    own, cycles = beside(64, (32, 32), reference=256)
    inside = np.s_[8:24, 13:19, :3]
    agree(own["combined"][inside].mean((0, 1)), cycles["combined"][inside].mean((0, 1)), relative=0.15, absolute=0.03)
