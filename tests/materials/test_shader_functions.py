"""Functions of shaders by themselves, against closed forms."""

import colorsys

import numpy as np
import pytest

from addon.gfx import images
from addon.materials.energy import energy_texture
from addon.materials.sky import XYZ_TO_RGB
from addon.materials.thin_film import _matching
from tests.glsl import evaluated


def test_the_edge_of_the_sun_is_darker_by_the_law_of_its_limb(gpu_context):
    """1 - .6 (1 - cos of the angle at which its surface is seen), the coefficient of visible light that Cycles has."""
    half = 0.1
    disc = f"sky_sun(vec3(cos({half} * k), sin({half} * k), 0.0), vec3(0.0, {half}, 0.0), vec3(1.0), vec3(1.0), "
    found = evaluated("material/sky.glsl", f"vec4({disc}vec3(1.0, 0.0, 0.0), -1.0), k)")
    across = found[:-1, 3]
    np.testing.assert_allclose(found[:-1, 0], 1 - 0.6 * (1 - np.sqrt(1 - across**2)), atol=2e-3)


@pytest.mark.parametrize("albedo", [0.2, 0.8, 0.98])
def test_light_that_a_half_space_returns_is_chandrasekhars(gpu_context, albedo):
    """1 - sqrt(1 - w) H(mu) of isotropic scattering, H by iteration of its integral equation."""
    absorption = np.sqrt(1.0 - albedo)
    nodes, weights = np.polynomial.legendre.leggauss(64)
    nodes, weights = (nodes + 1) / 2, weights / 2
    h = np.ones(64)
    for _ in range(400):
        h = 1 / (absorption + 0.5 * albedo * (nodes * h * weights / (nodes[:, None] + nodes)).sum(axis=1))
    found = evaluated("subsurface/profile.glsl", f"vec4(walk_returned(vec3({absorption}), k), k)")
    cosine = found[1:, 3]
    exact = 1 / (absorption + 0.5 * albedo * (nodes * h * weights / (cosine[:, None] + nodes)).sum(axis=1))
    apart = found[1:, 0] - (1 - absorption * exact)
    print(f"mean {apart.mean():.5f}, most {np.abs(apart).max():.5f}")
    assert abs((2 * cosine * apart).mean()) < 1e-3 and np.abs(apart).max() < 6e-3


@pytest.mark.parametrize("aspect", [1.0, 4.0])
def test_the_level_of_an_image_has_texels_as_wide_as_the_footprint_is_across(gpu_context, aspect):
    """log2 of the footprint's narrower side in texels, averaged by as many lookups as it is longer than wide."""
    side = 256
    footprint = f"mat2({aspect} * (1.0 + 31.0 * k) / {side}.0, 0.0, 0.0, (1.0 + 31.0 * k) / {side}.0)"
    probes = f"image_probes({footprint}, ivec2({side}), IMAGE_LEVELS)"
    found = evaluated("material/image.glsl", f"vec4({probes}.mip, float({probes}.count), k, 0.0)")
    np.testing.assert_allclose(found[:, 0], np.log2(1 + 31 * found[:, 2]), atol=1e-3)
    np.testing.assert_array_equal(found[:, 1], aspect)


@pytest.mark.parametrize(
    ("thickness", "film", "below"), [(120.0, 1.38, 1.52), (550.0, 1.33, 1.0), (300.0, 1.9, 2.0 + 3.0j)]
)
def test_a_thin_film_reflects_what_airys_formula_says(gpu_context, thickness, film, below):
    """Waves of each wavelength by Airy's closed form, seen with the matching functions of red, green and blue.
    At grazing angles the sum, which as in Cycles ends after three paths, has not yet come to its end."""
    wavelengths, matching = _matching()
    colors = matching @ XYZ_TO_RGB.T
    colors = colors / colors.sum(axis=0)
    conducts = str(isinstance(below, complex)).lower()
    values = f"{thickness}, {film}, {conducts}, vec3({np.real(below)}), vec3({np.imag(below)})"
    f0 = abs((1 - below) / (1 + below)) ** 2
    source = f"film_over({values})"
    if not isinstance(below, complex):
        source = f"film_on_dielectric({thickness}, {film}, {below}, vec3({f0}))"
    table = images.upload(energy_texture(False))
    found = evaluated(
        "material/thin_film.glsl", f"vec4(film_reflectance({source}, 0.2 + 0.8 * k), 0.2 + 0.8 * k)",
        bound={"energy_table": table}, textures=(("RGBA32F", "energy_table"),),
    )  # fmt: skip
    cosine = found[1:, 3][:, None]
    inside = np.sqrt(1 - (1 - cosine**2) / film**2 + 0j)
    last = np.sqrt(1 - (1 - cosine**2) / below**2 + 0j)
    turn = np.exp(2j * np.pi * 2 * film * thickness * inside / wavelengths)
    total = 0.0
    for upper, lower in (
        (
            (cosine - film * inside) / (cosine + film * inside),
            (film * inside - below * last) / (film * inside + below * last),
        ),
        (
            (film * cosine - inside) / (film * cosine + inside),
            (below * inside - film * last) / (below * inside + film * last),
        ),
    ):
        total = total + 0.5 * np.abs((upper + lower * turn) / (1 + upper * lower * turn)) ** 2
    apart = np.abs(found[1:, :3] - total @ colors)
    print(f"mean {apart.mean():.5f}, most {apart.max():.5f}")
    assert apart.mean() < 2e-3 and apart.max() < 0.02


@pytest.mark.parametrize("model", ["hsv", "hsl"])
def test_colours_go_to_models_of_hue_and_back(gpu_context, model):
    """By Python's colorsys, over colours in which each channel is the largest, and the least."""
    color = "(vec3(0.5) + 0.45 * cos(vec3(0.0, 2.1, 4.2) + 13.0 * k))"
    there = evaluated("material/color_models.glsl", f"vec4(rgb_to_{model}({color}), k)")
    back = evaluated("material/color_models.glsl", f"vec4({model}_to_rgb(rgb_to_{model}({color})), k)")
    rgb = 0.5 + 0.45 * np.cos(np.array([0.0, 2.1, 4.2]) + 13.0 * there[:, 3:])
    if model == "hsv":
        expected = [colorsys.rgb_to_hsv(*one) for one in rgb]
    else:
        expected = [np.array(colorsys.rgb_to_hls(*one))[[0, 2, 1]] for one in rgb]
    np.testing.assert_allclose(there[:, :3], expected, atol=1e-4)
    np.testing.assert_allclose(back[:, :3], rgb, atol=1e-5)


@pytest.mark.parametrize("dimensions", [2, 3])
def test_the_scale_of_gabor_noise_multiplies_places(gpu_context, dimensions):
    """Noise of scale 3 is that of scale 1 at three times the place, bit for bit where both are exact."""

    def noise(place, scale):
        given = f"{place}, {scale}, 2.0, 0.7, 0.5, vec3(0.6, 0.0, 0.8), a, b, c"
        return evaluated(
            "material/gabor.glsl", "vec4(a, b, c, 0.0)",
            before=f"float at = floor(63.0 * k + 0.5) / 32.0; float a; float b; float c;"
                   f"texture_gabor_{dimensions}d({given});",
        )  # fmt: skip

    small = noise("vec3(at, 0.25 + at, 0.5 - at)", 3.0)
    assert small[:, 0].std() > 0.02
    np.testing.assert_array_equal(small, noise("3.0 * vec3(at, 0.25 + at, 0.5 - at)", 1.0))


def test_displacement_is_what_lies_above_the_middle_times_the_scale(gpu_context):
    """(value - midlevel) scale, of heights along the normal, of vectors as they are."""
    for call, expected in (
        ("vector_displacement_world(vec3(k, 2.0 * k, -k), 0.25, 3.0, d)", [[3, -0.75], [6, -0.75], [-3, -0.75]]),
        ("displacement_along_normal(k, 0.25, 3.0, vec3(0.6, 0.0, 0.8), d)", [[1.8, -0.45], [0, 0], [2.4, -0.6]]),
    ):
        found = evaluated("lib/surface_point.glsl material/bump.glsl", "vec4(d, k)", before=f"vec3 d; {call};")
        slope, start = np.array(expected).T
        np.testing.assert_allclose(found[:, :3], slope * found[:, 3:] + start, atol=1e-6)
