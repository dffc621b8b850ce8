"""Media: coefficients out of volume trees, as the manual's formulas say."""

import numpy as np
import pytest

from addon.materials.compiler import compile_material
from addon.materials.graph import Graph, Input, Node
from addon.materials.volume import medium_of

SHADER = {"Volume": "SHADER"}


def node(key, kind, inputs=(), **values):
    sockets = {name.replace("_", " "): Input("COLOR" if "Color" in name else "FLOAT", value)
               for name, value in values.items()}  # fmt: skip
    return Node(key, key, f"ShaderNode{kind}", {**sockets, **dict(inputs)}, SHADER)


def linked(*keys):
    return [(name, Input("SHADER", None, (key, "Volume"))) for name, key in zip(("Shader", "Shader_001"), keys)]


def graph(*nodes, surface=None):
    return Graph({one.key: one for one in nodes}, surface, volume=(nodes[0].key, "Volume"))


def test_a_tree_without_volume_has_no_medium():
    assert medium_of(Graph()) is None


def test_absorption_takes_what_the_colour_lacks():
    medium = medium_of(graph(node("a", "VolumeAbsorption", Color=(0.75, 0.5, 0.25, 1.0), Density=2.0)))
    assert medium.absorption == pytest.approx([0.5, 1.0, 1.5])
    assert not medium.scattering.any()
    assert medium.even


def test_scattering_is_colour_times_density():
    medium = medium_of(graph(node("s", "VolumeScatter", Color=(0.75, 0.5, 0.25, 1.0), Density=2.0, Anisotropy=0.4)))
    assert medium.scattering == pytest.approx([1.5, 1.0, 0.5])
    assert medium.anisotropy == 0.4


def test_principled_volume_absorbs_what_neither_colour_keeps():
    values = {"Color": (0.5, 0.5, 0.5, 1.0), "Density": 4.0, "Absorption_Color": (0.25, 0.0, 1.0, 1.0)}
    emission = {"Emission_Color": (1.0, 0.5, 0.0, 1.0), "Emission_Strength": 3.0, "Blackbody_Intensity": 0.5}
    medium = medium_of(graph(node("p", "VolumePrincipled", **values, **emission, Temperature=1500.0)))
    assert medium.scattering == pytest.approx([2.0, 2.0, 2.0])
    assert medium.absorption == pytest.approx([1.0, 2.0, 0.0])
    assert medium.emission == pytest.approx([3.0, 1.5, 0.0])
    assert (medium.temperature, medium.glow) == (1500.0, 0.5)


def test_mixed_media_weigh_coefficients_and_share_their_phase():
    forward = node("f", "VolumeScatter", Color=(1.0, 1.0, 1.0, 1.0), Density=3.0, Anisotropy=0.8)
    even = node("e", "VolumeScatter", Color=(1.0, 1.0, 1.0, 1.0), Density=1.0, Anisotropy=0.0)
    mixed = medium_of(graph(node("m", "MixShader", linked("f", "e"), Fac=0.25), forward, even))
    assert mixed.scattering == pytest.approx([2.5, 2.5, 2.5])
    assert mixed.anisotropy == pytest.approx(0.8 * 2.25 / 2.5)
    added = medium_of(graph(node("m", "AddShader", linked("f", "e")), forward, even))
    assert added.scattering == pytest.approx([4.0, 4.0, 4.0])


def test_a_texture_in_the_density_makes_a_medium_uneven():
    noise = ("Density", Input("FLOAT", 1.5, ("Noise", "Fac")))
    medium = medium_of(graph(node("s", "VolumeScatter", [noise], Color=(1.0, 1.0, 1.0, 1.0))))
    assert not medium.even
    assert medium.scattering == pytest.approx(np.full(3, 1.5))


@pytest.mark.parametrize(
    ("surface", "volume", "said"),
    [
        ("BsdfDiffuse", node("v", "VolumeAbsorption", Density=1.0), ""),
        ("BsdfGlass", node("v", "VolumeAbsorption", Density=1.0), ""),
        ("BsdfGlass", node("v", "VolumeScatter", Density=1.0), "only what it absorbs"),
    ],
    ids=["diffuse", "absorbing", "scattering"],
)
def test_what_is_not_drawn_of_a_volume_is_said(surface, volume, said):
    shader = Node("s", "s", f"ShaderNode{surface}", {}, {"BSDF": "SHADER"})
    compiled = compile_material("Test", graph(volume, shader, surface=("s", "BSDF")))
    texts = " ".join(text for _, text in compiled.fallbacks)
    assert (said in texts) if said else not texts
