"""Principled Hair: its lobes beside the closed form of a single upright fibre."""

import bpy
import numpy as np
import pytest

RADIUS, SPAN = 0.3, 1.0
SUN = 3.0


def fibre(stage, points, radius, **inputs):
    """Strands through `points` (n, p, 3) of Chiang's model."""
    material = stage.material("ShaderNodeBsdfHairPrincipled")
    node = next(node for node in material.node_tree.nodes if node.type == "BSDF_HAIR_PRINCIPLED")
    node.parametrization = "MELANIN"
    if hasattr(node, "model"):
        node.model = "CHIANG"
    for name, value in inputs.items():
        node.inputs[name].default_value = value
    curves = bpy.data.hair_curves.new("Hair")
    curves.add_curves([len(one) for one in points])
    curves.attributes["position"].data.foreach_set("vector", np.ravel(points))
    radii = curves.attributes.get("radius") or curves.attributes.new("radius", "FLOAT", "POINT")
    radii.data.foreach_set("value", [radius] * len(radii.data))
    curves.materials.append(material)
    stage.link("Hair", curves)


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
