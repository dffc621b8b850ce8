"""Functions of shaders by themselves, against closed forms."""

import numpy as np
import pytest

from addon.gfx import images, passes


def evaluated(include: str, expression: str, count: int = 64, **given) -> np.ndarray:
    """(count, 4) a GLSL expression of `k`, 0 to 1 over the pixels, with functions of a shader file."""
    source = f'''#include "{include}"
void main()
{{
  float k = (gl_FragCoord.x - 0.5) / {count - 1}.0;
  out_value = {expression};
}}'''
    program = passes.fullscreen_program(
        f"probe of {include}", "generated/main", outputs=(("VEC4", "out_value"),),
        snippets=(("generated/main", source),), **given,
    )  # fmt: skip
    with images.borrowed(count, 1, "RGBA32F") as target:
        passes.fullscreen(program, target)
        return images.read(target.colors[0])[0].astype(np.float64)


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
