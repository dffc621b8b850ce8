"""Light groups: shares of the picture beside Cycles', their sum, and what they cost where there are none."""

import bpy
import numpy as np
import pytest

from addon.materials.graph import Graph, Input, Node
from addon.snapshot.light_groups import without_light

SPAN = 4.0


def group(stage, *names):
    for name in names:
        stage.layer.lightgroups.add(name=name)


def room(stage):
    """A floor and a wall, lit by two lamps, a glowing plate that shares its material with another, and the world."""
    stage.camera_above(SPAN)
    stage.floor(material=stage.principled(Base_Color=(0.8, 0.6, 0.4, 1), Roughness=0.4))
    stage.rectangle((-2, -2), (2, 2), material=stage.diffuse(0.7), turn=(0, np.pi / 2, 0), location=(1.9, 0, 1))
    key = stage.light("AREA", (-0.8, 0.3, 1.5), size=0.6, energy=20.0)
    fill = stage.light("POINT", (0.9, -0.8, 1.2), energy=15.0)
    fill.data.color = (0.2, 0.5, 1.0)
    glow = stage.material("ShaderNodeEmission", Strength=3.0, Color=(1.0, 0.4, 0.1, 1.0))
    plates = [
        stage.rectangle((-0.3, -0.3), (0.3, 0.3), material=glow, location=(x, y, 0.8))
        for x, y in ((0.2, 1.0), (-1, -1))
    ]
    stage.world((0.1, 0.15, 0.3))
    key.lightgroup, fill.lightgroup = "Key", "Fill"
    plates[0].lightgroup, plates[1].lightgroup = "Plate", "Fill"
    stage.scene.world.lightgroup = "Sky"
    return stage


@pytest.fixture
def grouped(written):
    yield room(written)
    written.scene.candela.split_light_groups = False
    for thing in (*written.scene.objects, written.scene.world):
        thing.lightgroup = ""


def share(passes, name):
    return passes[f"Combined_{name}"]


@pytest.mark.slow
def test_shares_are_those_of_cycles_and_sum_to_combined(grouped):
    stage = grouped
    names = ("Key", "Fill", "Plate", "Sky")
    group(stage, *names, "Nobody")
    own, cycles = stage.both(32, 512, bounces=4)
    total = sum(share(own, name) for name in names)
    np.testing.assert_allclose(total, own["Combined"][..., :3], rtol=1e-5, atol=1e-6)
    assert not share(own, "Nobody").any()
    for name in names:
        ours, theirs = share(own, name), share(cycles, name)
        error = ((ours - theirs) ** 2 / (theirs**2 + 1e-4)).mean()
        print(f"{name}: mean {ours.mean():.4f} and {theirs.mean():.4f}, relMSE {error:.5f}")
        assert abs(ours.mean() / theirs.mean() - 1.0) < 0.02
        assert error < 0.02


@pytest.mark.slow
def test_lights_of_no_group_are_in_combined_alone(grouped):
    stage = grouped
    group(stage, "Key")
    with_groups = stage.written("CANDELA", 4, bounces=1)
    stage.layer.lightgroups.remove(stage.layer.lightgroups[0])
    without = stage.written("CANDELA", 4, bounces=1)
    assert "Combined_Key" in with_groups and "Combined_Key" not in without
    ours, plain = with_groups["Combined"][..., :3], without["Combined"][..., :3]
    assert (share(with_groups, "Key") <= ours + 1e-5).all()
    assert abs(ours.mean() / plain.mean() - 1.0) < 0.02
    np.testing.assert_array_equal(with_groups["Combined"][..., 3], without["Combined"][..., 3])


@pytest.mark.slow
def test_direct_and_indirect_light_of_a_group_sum_to_its_share(grouped):
    stage = grouped
    group(stage, "Key", "Fill")
    stage.scene.candela.split_light_groups = True
    own = stage.written("CANDELA", 4, bounces=2)
    for name in ("Key", "Fill"):
        direct, indirect = own[f"Combined_{name} Direct"], own[f"Combined_{name} Indirect"]
        assert direct.mean() > 0.0 and indirect.mean() > 0.0
        np.testing.assert_allclose(direct + indirect, share(own, name), rtol=1e-4, atol=1e-5)
    alone = stage.written("CANDELA", 4, bounces=0)
    np.testing.assert_allclose(alone["Combined_Key Direct"].mean(), own["Combined_Key Direct"].mean(), rtol=0.02)


@pytest.mark.slow
def test_passes_of_light_are_those_of_all_groups(grouped):
    """Colours, depth and light by path beside groups: as without them."""
    stage = grouped
    plain = stage.written("CANDELA", 16, bounces=1)
    group(stage, "Key", "Plate")
    own = stage.written("CANDELA", 16, bounces=1)
    color, *light = (
        ("Diffuse Color", "Diffuse Direct", "Glossy Direct", "Emission", "Environment")
        if bpy.app.version >= (5, 0)
        else ("DiffCol", "DiffDir", "GlossDir", "Emit", "Env")
    )
    for name in ("Depth", "Normal", color) if "Depth" in own else ():
        np.testing.assert_array_equal(own[name], plain[name])
    for name in light:
        if name in own:
            np.testing.assert_allclose(own[name].mean(), plain[name].mean(), rtol=0.03)


@pytest.mark.slow
def test_groups_share_out_the_pixels_of_bounced_light(grouped):
    """So that their sum has the noise of one picture, and none of its light is lost."""
    stage = grouped
    plain = stage.written("CANDELA", 16, bounces=2)
    names = ("Key", "Fill", "Plate", "Sky")
    group(stage, *names)
    own = stage.written("CANDELA", 16, bounces=2)
    (said,) = stage.ledger.row("instant_radiosity").choices
    assert said == "its light: in one of 4 pixels, because 4 light groups are added up"
    np.testing.assert_allclose(own["Combined"].mean(axis=(0, 1)), plain["Combined"].mean(axis=(0, 1)), rtol=0.02)


@pytest.mark.slow
def test_a_picture_without_groups_is_drawn_once(grouped, monkeypatch):
    from addon.frame.run import Renderer

    begun = []
    beginning = Renderer.beginning
    monkeypatch.setattr(Renderer, "beginning", lambda self, *given: begun.append(1) or beginning(self, *given))
    grouped.written("CANDELA", 1, bounces=0)
    assert len(begun) == 1
    group(grouped, "Key", "Fill", "Nobody")
    grouped.written("CANDELA", 1, bounces=0)
    assert len(begun) == 1 + 3  # two groups that shine, and the rest


def test_a_tree_that_does_not_shine_stays_the_same():
    shader = Node(
        "D", "D", "ShaderNodeBsdfDiffuse", {"Color": Input("COLOR", (1.0, 1.0, 1.0, 1.0))}, {"BSDF": "SHADER"}
    )
    graph = Graph({"D": shader}, ("D", "BSDF"))
    assert without_light(graph) is graph
    principled = Node(
        "P", "P", "ShaderNodeBsdfPrincipled",
        {"Emission Strength": Input("FLOAT", 0.0), "Emission Color": Input("COLOR", (1.0, 1.0, 1.0, 1.0))},
        {"BSDF": "SHADER"},
    )  # fmt: skip
    assert without_light(Graph({"P": principled}, ("P", "BSDF"))).surface == ("P", "BSDF")


def test_a_colour_where_a_shader_belongs_is_an_emission_and_goes():
    color = Node("C", "C", "ShaderNodeRGB", {"Color": Input("COLOR", (1.0, 1.0, 1.0, 1.0))}, {"Color": "COLOR"})
    dark = without_light(Graph({"C": color}, ("C", "Color")))
    assert dark.nodes[dark.surface[0]].inputs["Strength"].value == 0.0
