"""Principled Hair: its lobes beside the closed form of a single upright fibre."""

import bpy
import numpy as np
import pytest

RADIUS, SPAN = 0.3, 1.0
SUN = 3.0


def fibre(stage, points, radius, **inputs):
    """Strands through `points` (n, p, 3) of Chiang's model."""
    curves = bpy.data.hair_curves.new("Hair")
    curves.add_curves([len(one) for one in points])
    curves.attributes["position"].data.foreach_set("vector", np.ravel(points))
    radii = curves.attributes.get("radius") or curves.attributes.new("radius", "FLOAT", "POINT")
    radii.data.foreach_set("value", [radius] * len(radii.data))
    curves.materials.append(of_fibres(stage, **inputs))
    stage.link("Hair", curves)


def of_fibres(stage, **inputs):
    """A material of Chiang's model."""
    material = stage.material("ShaderNodeBsdfHairPrincipled")
    node = next(node for node in material.node_tree.nodes if node.type == "BSDF_HAIR_PRINCIPLED")
    node.parametrization = "MELANIN"
    if hasattr(node, "model"):
        node.model = "CHIANG"
    for name, value in inputs.items():
        node.inputs[name].default_value = value
    return material


def fresnel(cosine, ior):
    g = np.sqrt(ior**2 - 1 + cosine**2)
    a = (g - cosine) / (g + cosine)
    b = ((g + cosine) * cosine - 1) / ((g - cosine) * cosine + 1)
    return 0.5 * a**2 * (1 + b**2)


def chiang(h, turn, absorption, roughness=0.3, radial=0.3, ior=1.55, tilt=0.0349066):
    """f cos of light and view across a fibre, by R, TT and TRT of Chiang et al. 2016 (the rest is below .1 %)."""
    variance = (0.726 * roughness + 0.812 * roughness**2 + 3.7 * roughness**20) ** 2
    scale = (0.265 * radial + 1.194 * radial**2 + 5.372 * radial**22) * np.sqrt(np.pi / 8)
    inside, entry = np.arcsin(h / ior), np.arcsin(h)
    passing = np.exp(-2.0 * absorption * np.cos(inside))
    f = fresnel(np.cos(entry), ior)
    shares = f, (1 - f) ** 2 * passing, (1 - f) ** 2 * passing**2 * f
    total = 0.0
    for lobe, (share, wide, angle) in enumerate(
        zip(shares, (1.0, 0.25, 4.0), (2 * tilt, -tilt, -4 * tilt), strict=True)
    ):
        v = wide * variance
        along = np.exp(np.log(np.i0(np.cos(angle) / v)) - 1 / v) / (v * (1 - np.exp(-2 / v)))
        off = turn - (2 * lobe * inside - 2 * entry + lobe * np.pi)
        off = (off + np.pi) % (2 * np.pi) - np.pi
        falling, edge = np.exp(-np.abs(off) / scale), np.exp(-np.pi / scale)
        total = total + share * along * falling / (scale * (1 + falling) ** 2) * (1 + edge) / (1 - edge)
    return total


@pytest.mark.parametrize("turn", [0.0, 0.5, 0.9])
def test_a_fibre_scatters_across_itself_what_the_closed_form_says(stage, turn):
    """A sun `turn` half turns beside the viewer, around the fibre."""
    fibre(stage, [[(0, 0, z) for z in np.linspace(-1, 2, 6)]], RADIUS, Melanin=0.3)
    stage.camera((0, -5, 0.5), (np.pi / 2, 0, 0))
    stage.scene.camera.data.type, stage.scene.camera.data.ortho_scale = "ORTHO", SPAN
    stage.light("SUN", turn=(np.pi / 2, 0, np.pi * turn), energy=SUN)
    picture = stage.render(4, (48, 36))["combined"][14:22, :, :3].mean(axis=0)
    corners = np.pi / (12 * np.sin(np.pi / 12))  # radii from the axis to those of its tube, two of which are its edges
    h = (0.5 - (np.arange(48) + 0.5) / 48) * SPAN / (RADIUS * corners)  # as the sun goes around
    inner = np.abs(h) < 0.9
    eumelanin = -np.log(0.7) * np.array([0.343, 0.733, 1.924])  # redness 1
    for channel, absorption in enumerate(eumelanin):
        expected = SUN * chiang(h[inner], np.pi * turn, absorption)
        np.testing.assert_allclose(picture[inner, channel], expected, rtol=0.05, atol=0.02 * expected.max())


# Cycles, bounces 0: red of a card's half whose first edge is level, by the card's turn about it and the sun's, radians.
CARDS = {(0.5, -1.168): 0.2503, (0.5, 2.366): 1.484, (0.5, 0.403): 0.0, (1.0, -1.953): 0.692, (1.0, 2.366): 10.62}


@pytest.mark.parametrize(("turn", "sun"), CARDS)
def test_a_card_is_a_fibre_along_its_first_edge(stage, turn, sun):
    """Less what Cycles leaves out: light from the other side of the plane of view and edge than the normal says."""
    corners = [(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)]
    card = stage.mesh(corners, [(0, 1, 2, 3)], material=of_fibres(stage, Melanin=0.3))
    card.rotation_euler = (np.pi / 2 + turn, 0, 0)
    stage.camera((0, -6, 0), (np.pi / 2, 0, 0))
    stage.scene.camera.data.type, stage.scene.camera.data.ortho_scale = "ORTHO", 0.5
    stage.light("SUN", turn=(np.pi / 2 - sun, 0, 0), energy=SUN)
    red = stage.render(1, (16, 16))["combined"][:, :, 0]
    np.testing.assert_allclose(np.median(red[:5, 4:12]), CARDS[turn, sun], rtol=0.05, atol=1e-3)


def test_strands_light_each_other_through_themselves(stage):
    """Red of Cycles' ribbons, 512 samples; of it .1061 comes from the lamp straight."""
    rows = [[(-1 + 0.05 * k, 0.3 * (-1) ** k, z) for z in np.linspace(0, 1, 4)] for k in range(41)]
    fibre(stage, rows, 0.03, Melanin=0.25)
    stage.camera((0, -5, 0.5), (np.pi / 2, 0, 0))
    stage.scene.camera.data.type, stage.scene.camera.data.ortho_scale = "ORTHO", 2.0
    stage.light("AREA", (1, -4, 1.5), (np.pi / 2 - 0.24, 0, 0.24), energy=150.0, size=0.5)
    red = stage.render(8, (48, 36), bounces=2)["combined"][12:24, 8:40, 0]
    np.testing.assert_allclose(red.mean(), 0.1357, rtol=0.03)
