"""Albedos of lobes: tables against closed forms, the GPU's lookups against the tables, layering against Cycles."""

import numpy as np
import pytest

from addon.materials import energy
from addon.materials.compiler import compile_material
from addon.materials.reader import read_graph
from tests.materials.cycles import render_patches, shader_material
from tests.materials.graphs import graph, principled
from tests.materials.probe import points

BASE = (0.8, 0.5, 0.2, 1.0)


def ours(evaluate, material, incoming):
    compiled = compile_material(material.name, read_graph(material, lambda image, user: "")[0])
    return evaluate(compiled, points(incoming=incoming))


def test_a_mirror_loses_nothing_and_reflects_by_fresnel():
    stored = energy.tables()
    assert stored["energy"][0] == pytest.approx(1.0, abs=1e-3)
    # For roughness 0 the half vector is the normal, so the mean is the Fresnel term itself.
    axis = np.linspace(0.0, 1.0, energy.LAYER_SIZE)
    for k in (4, 9, 14):
        ior = energy.ior_from_f0(axis[k] ** 4)
        f0 = ((ior - 1.0) / (ior + 1.0)) ** 2
        fresnel = energy.fresnel_dielectric(np.maximum(axis, 1e-4), ior)
        expected = np.clip((fresnel - f0) / (1.0 - f0), 0.0, 1.0)
        assert stored["dielectric"][0, 1:, k] == pytest.approx(expected[1:], abs=2e-3)


def test_the_fine_table_of_a_mirror_is_fresnel_at_its_own_nodes():
    stored, axis = energy.tables()["dielectric_fine"], np.linspace(0.0, 1.0, energy.FINE_SIZE)
    for k in (8, 18, 28):
        ior = energy.ior_from_f0(axis[k] ** 4)
        f0 = ((ior - 1.0) / (ior + 1.0)) ** 2
        fresnel = energy.fresnel_dielectric(np.maximum(axis**2, 1e-4), ior)
        assert stored[0, 1:, k] == pytest.approx(np.clip((fresnel - f0) / (1.0 - f0), 0.0, 1.0)[1:], abs=2e-3)


def test_the_texture_of_the_gpu_holds_the_fine_table_where_cycles_has_it():
    coarse, fine = energy.energy_texture(fine=False), energy.energy_texture(fine=True)
    assert np.array_equal(coarse, fine[:64])
    stored = energy.tables()["dielectric_fine"]
    for k in (0, 7, 15, 16, 30):
        column, row, channel = 32 * (k % 16 % 6), 64 + 32 * (k % 16 // 6), 2 * (k // 16)
        assert np.array_equal(fine[row : row + 32, column : column + 32, channel], stored[:, :, k].T)
        assert np.array_equal(fine[row : row + 32, column : column + 32, channel + 1], stored[:, :, k + 1].T)


def test_fresnel_has_its_known_values():
    assert energy.fresnel_dielectric(np.array(1.0), 1.5) == pytest.approx(0.04)
    assert energy.fresnel_dielectric(np.array(1e-9), 1.5) == pytest.approx(1.0)
    # Brewster's angle, tan = ior: only the s-polarised half is reflected, ((n^2 - 1) / (n^2 + 1))^2 / 2.
    brewster = np.cos(np.arctan(1.5))
    assert energy.fresnel_dielectric(np.array(brewster), 1.5) == pytest.approx(0.5 * (1.25 / 3.25) ** 2)


def test_quadrature_has_converged():
    for mu, roughness in ((0.05, 0.3), (0.5, 0.7), (1.0, 1.0)):
        assert energy.ggx_energy(mu, roughness) == pytest.approx(energy.ggx_energy(mu, roughness, 1024), abs=6e-4)


def test_stored_tables_are_what_the_command_makes():
    stored = energy.tables()
    axis = np.linspace(0.0, 1.0, energy.ENERGY_SIZE)
    for i, j in ((31, 31), (7, 20), (15, 2)):
        assert stored["energy"][i, j] == pytest.approx(energy.ggx_energy(axis[j], axis[i]), abs=1e-6)


def test_average_is_the_integral_of_the_energy():
    stored = energy.tables()
    mu = np.linspace(0.0, 1.0, energy.ENERGY_SIZE)
    for i in (5, 16, 31):
        values = 2.0 * stored["energy"][i] * mu
        integral = np.sum(0.5 * (values[1:] + values[:-1]) * np.diff(mu))
        assert stored["energy_average"][i] == pytest.approx(integral, abs=3e-3)


def test_a_rough_white_metal_reflects_everything(evaluate):
    """With multiple scattering a lobe of reflectance 1 has albedo 1 at any roughness."""
    white = principled(Base_Color=(1.0, 1.0, 1.0, 1.0), Metallic=1.0, Roughness=0.9)
    material = compile_material("Test", graph(white, surface=("Principled", "BSDF")))
    for cosine in (0.1, 0.5, 1.0):
        closures = evaluate(material, points(incoming=(np.sqrt(1.0 - cosine**2), 0.0, cosine)))
        assert closures["glossy_albedo"][0] == pytest.approx(1.0, abs=1e-4)
        assert closures["diffuse"][0] == pytest.approx(0.0, abs=1e-6)


def principled_patches():
    patches = [
        shader_material("ShaderNodeBsdfPrincipled", Base_Color=BASE, Roughness=roughness, IOR=ior)
        for roughness in (0.05, 0.2, 0.5, 1.0)
        for ior in (1.1, 1.5, 2.0)
    ]
    for level in (0.0, 0.25, 1.0):
        patches.append(
            shader_material(
                "ShaderNodeBsdfPrincipled", Base_Color=BASE, Specular_IOR_Level=level, Specular_Tint=(0.9, 0.3, 0.1, 1)
            )
        )
    for metallic, alpha in ((0.3, 1.0), (0.9, 0.4), (0.0, 0.4)):
        patches.append(shader_material("ShaderNodeBsdfPrincipled", Base_Color=BASE, Metallic=metallic, Alpha=alpha))
    for weight, roughness in ((0.3, 0.03), (1.0, 0.5)):
        patches.append(
            shader_material(
                "ShaderNodeBsdfPrincipled", Base_Color=BASE, Coat_Weight=weight, Coat_Roughness=roughness,
                Coat_Tint=(1.0, 0.7, 0.3, 1.0),
            )
        )  # fmt: skip
    patches.append(shader_material("ShaderNodeBsdfPrincipled", Base_Color=BASE, Roughness=0.8, distribution="GGX"))
    return patches


@pytest.mark.parametrize("cosine", [0.95, 0.5, 0.15])
def test_diffuse_under_its_layers_matches_cycles(evaluate, empty_scene, cosine):
    patches = principled_patches()
    passes, incoming = render_patches(patches, cosine)
    reference = passes["diffuse_color"].mean(axis=(1, 2))[:, :3]
    measured = np.array([ours(evaluate, material, incoming)["diffuse"][0] for material in patches])
    assert reference.max() > 0.1
    assert np.abs(measured - reference).max() < 0.005 * reference.max()


@pytest.mark.parametrize("cosine", [0.9, 0.3])
def test_glossy_color_matches_cycles(evaluate, empty_scene, cosine):
    """Only materials of one glossy lobe: of several, one is drawn by chance."""
    patches = [
        *(shader_material("ShaderNodeBsdfAnisotropic", Color=BASE, Roughness=r) for r in (0.1, 0.5, 1.0)),
        *(shader_material("ShaderNodeBsdfPrincipled", Roughness=r, IOR=1.6) for r in (0.1, 0.5, 1.0)),
        *(shader_material("ShaderNodeBsdfPrincipled", Base_Color=BASE, Metallic=1.0, Roughness=r) for r in (0.1, 0.8)),
        *(shader_material("ShaderNodeBsdfMetallic", Base_Color=BASE, Roughness=r) for r in (0.1, 0.8)),
        shader_material("ShaderNodeBsdfPrincipled", Metallic=1.0, Roughness=0.6, Specular_Tint=(0.5, 0.8, 0.2, 1.0)),
    ]
    passes, incoming = render_patches(patches, cosine)
    reference = passes["glossy_color"].mean(axis=(1, 2))[:, :3]
    measured = np.array([ours(evaluate, material, incoming)["glossy_albedo"][0] for material in patches])
    assert np.abs(measured - reference).max() < 0.005


def test_single_scattering_energy_matches_cycles(empty_scene):
    """A white Glossy node without multiple scattering in a white furnace shows the energy of GGX itself."""
    roughness = (0.2, 0.5, 1.0)
    patches = [
        shader_material("ShaderNodeBsdfAnisotropic", Color=(1, 1, 1, 1), Roughness=r, distribution="GGX")
        for r in roughness
    ]
    passes, _ = render_patches(patches, 0.5, samples=512, resolution=12)
    # The pixel filter reaches 1.5 pixels far: the middle of a patch shows nothing of its neighbours.
    shown = passes["combined"][:, 4:8, 4:8, 0].mean(axis=(1, 2))
    assert shown == pytest.approx([energy.ggx_energy(0.5, r) for r in roughness], abs=0.005)


@pytest.mark.parametrize("cosine", [0.9, 0.3])
def test_coat_metal_and_specular_add_up_as_in_cycles(evaluate, empty_scene, cosine):
    """Several lobes in one shader: the mean over their random choice, and the emission below the coat."""
    common = {"Base_Color": BASE, "Emission_Strength": 1.0}
    patches = [
        shader_material(
            "ShaderNodeBsdfPrincipled", **common, Coat_Weight=1.0, Coat_Roughness=0.2, Coat_IOR=1.8,
            Coat_Tint=(1.0, 0.7, 0.3, 1.0),
        ),
        shader_material(
            "ShaderNodeBsdfPrincipled", **common, Coat_Weight=0.5, Coat_Roughness=0.5, Metallic=0.5, Alpha=0.7
        ),
        shader_material("ShaderNodeBsdfPrincipled", **common, Metallic=0.5, Specular_IOR_Level=2.0, IOR=0.8),
    ]  # fmt: skip
    passes, incoming = render_patches(patches, cosine)
    count = 4000
    for i, material in enumerate(patches):
        compiled = compile_material("Test", read_graph(material, lambda image, user: "")[0])
        at = points(count, incoming=incoming, random=(np.arange(count) + 0.5) / count)
        closures = evaluate(compiled, at)
        for field, name in (("glossy_albedo", "glossy_color"), ("emission", "emission"), ("diffuse", "diffuse_color")):
            expected = passes[name][i].mean(axis=(0, 1))[:3]
            assert closures[field].mean(axis=0) == pytest.approx(expected, abs=2e-3), (i, field)
