"""Functions of techniques' shaders by themselves, against closed forms."""

import numpy as np
import pytest

from addon.film.resolve import resolve_program
from addon.film.together import SUM
from addon.gfx import images, passes
from addon.gfx.struct import Block
from addon.lighting.caustic_maps import KEEP
from addon.lighting.edge_tiles import EDGE_LIGHT
from addon.lighting.imperfect_maps import PULL as PULL_MAP
from addon.lighting.light_choice import Choice
from addon.lighting.media_bounces import surfaces_program
from addon.materials.energy import energy_texture
from addon.scene.view import VIEW
from addon.surfaces import hits
from addon.surfaces.scatter_means import MEANS
from addon.techniques.multires_radiosity import PULL
from tests.glsl import evaluated


def with_table() -> dict:
    """Of programs that read the energy of microfacets."""
    table = images.upload(energy_texture(False))
    return {"bound": {"energy_table": table}, "textures": (("RGBA32F", "energy_table"),)}


def test_a_block_of_pixels_has_each_step_of_the_dither_once(gpu_context):
    """Bayer's matrix: each sixteenth once in 4 x 4 pixels, and one of each quarter in each 2 x 2."""
    found = evaluated("media/dither.glsl", "vec4(dither(ivec2(gl_FragCoord.x) >> ivec2(0, 2)))", 16)[:, 0]
    np.testing.assert_allclose(np.sort(found), (np.arange(16) + 0.5) / 16, atol=1e-7)
    quarters = np.floor(4 * found).reshape(2, 2, 2, 2).transpose(0, 2, 1, 3).reshape(4, 4)
    np.testing.assert_array_equal(np.sort(quarters), np.tile(np.arange(4), (4, 1)))


def test_what_of_a_lobe_lies_in_the_window_is_its_integral(gpu_context):
    """Integral over 0..a of (1 - (t / a)^2)^2 exp(-t), by quadrature; below 1 the shader sums a series."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    for reach, within in ((1.0, 1e-5), (30.0, 5e-4)):
        found = evaluated("subsurface/profile.glsl", f"vec4(lobe_near({reach} * k), {reach} * k, 0.0, 0.0)")
        a = found[1:, 1:2] * (1.0 - 1e-9)
        t = a * (nodes + 1) / 2
        exact = ((1 - (t / a) ** 2) ** 2 * np.exp(-t) * weights).sum(axis=1) * a[:, 0] / 2
        np.testing.assert_allclose(found[1:-1, 0], exact[:-1], rtol=within)


def test_a_share_of_a_rough_surface_reflects_that_share(gpu_context):
    """Albedo is linear in the weight of the closure: of half a surface it is half of the whole one's."""
    color = "vec3(0.9 * k, 0.8, 0.1)"
    for rough in (0.3, 1.0):
        whole, half = (
            evaluated(
                "lib/gbuffer.glsl lib/brdf.glsl indirect/albedo.glsl",
                f"vec4(rough_albedo({w} * {color}, {w}, {rough}), 0.0)",
                **with_table(),
            )
            for w in (1.0, 0.5)
        )
        assert (whole[1:, :3] < [1.0, 0.8, 0.1]).all()
        np.testing.assert_allclose(half[1:], 0.5 * whole[1:], rtol=1e-5)


def test_a_fibre_runs_at_its_angle_across_the_normal(gpu_context):
    """Half turns about the normal from the first axis of its frame; the lowest bit of what holds its narrowing says in
    which way."""
    for level, way in ((81.0, 1.0), (80.0, -1.0)):
        before = f"""Surface s; SoftLobe lobe; vec3 side; vec3 up;
  s.glossy_normal = normalize(vec3(0.3, -0.5, 0.8)); s.tangent_angle = k; s.glossy_roughness = 0.3;
  s.glossy_anisotropy = 0.4; s.glossy_edge = vec3(0.5); s.glossy_ior = 0.5; float root = {level} / 255.0;
  s.glossy_tint = vec3(0.25, 0.25, root * root); lobe.view = vec3(0.0, 0.0, 1.0); lobe.normal = s.glossy_normal;
  lobe.weight = vec3(1.0); orthonormal_basis(s.glossy_normal, side, up); soft_fibre(lobe, s);"""
        way_of = "dot(lobe.tangent, side), dot(lobe.tangent, up), dot(lobe.tangent, s.glossy_normal), lobe.scales.y"
        found = evaluated(
            "lib/soft_lobe.glsl", f"vec4({way_of})", before=before,
            **with_table(),
        )  # fmt: skip
        turn = np.pi * np.arange(64) / 63
        np.testing.assert_allclose(found[:, :2], way * np.stack([np.cos(turn), np.sin(turn)], axis=1), atol=2e-6)
        np.testing.assert_allclose(found[:, 2], 0.0, atol=1e-6)
        np.testing.assert_allclose(found[:, 3], 40.0 / 63.0, atol=1e-6)


def test_the_table_of_the_worlds_irradiance_is_read_between_its_latitudes_and_azimuths(gpu_context):
    """A table that holds the numbers of its rows and columns gives where a normal points, and one bright texel adds the
    cosine to its direction."""
    rows, columns = 8, 16
    table = np.zeros((rows + 2, columns, 4))
    table[: rows + 1, :, 0] = np.arange(rows + 1)[:, None]
    table[: rows + 1, :, 1] = np.abs(np.arange(columns) - columns // 2)
    table[rows + 1, 0, :3], table[rows + 1, 1, :3] = (0.0, 0.0, 1.0), (0.0, 0.0, 5.0)
    normal = "vec3(cos(2.0 * k - 1.0) * vec2(cos(6.0 * k - 3.0), sin(6.0 * k - 3.0)), sin(2.0 * k - 1.0))"
    found = evaluated(
        "lib/known_irradiance.glsl", f"vec4(known_irradiance({normal}), 0.0)", constants={("INT", "bright_count"): 1},
        bound={"irradiance_table": images.upload(table), "openness": images.upload(np.zeros((1, 1, 2)), "RG32F")},
        textures=(("RGBA32F", "irradiance_table"), ("RG32F", "openness")),
    )  # fmt: skip
    k = np.arange(64) / 63
    latitude, azimuth = 2 * k - 1, 6 * k - 3
    np.testing.assert_allclose(found[:, 0], (latitude / np.pi + 0.5) * rows, atol=2e-3)  # asin of a driver
    np.testing.assert_allclose(found[:, 1], np.abs(azimuth) / (2 * np.pi) * columns, atol=2e-3)
    np.testing.assert_allclose(found[:, 2], 5.0 * np.maximum(np.sin(latitude), 0.0), atol=1e-5)


def test_a_lamps_map_is_read_at_the_place_the_light_leaves(gpu_context):
    """Tiles that hold their own places: half widths of .5 and 2 m; and a factor by distance in steps of an octave."""
    pixels = np.zeros((6, 12, 4))
    pixels[0, 4] = (0, 1, 2, 1)  # tile at (0, 1), two texels wide with a border of one around them
    pixels[0, 5] = (6, 2, 3, 0.0)  # three distances from 1 m on
    pixels[0, 6] = (2.0, 0, 0, 1 / np.log(2.0))
    pixels[0, 7], pixels[0, 8] = (0, 0.5, 0, 0), (0.1, 0.2, 0.3, 0)
    ramp = (np.arange(4) - 0.5) / 2
    pixels[1:5, :4, 0], pixels[1:5, :4, 1], pixels[1:5, :4, 2] = ramp[None, :], ramp[:, None], 1.0
    pixels[2, 6:9, :3] = np.array([1.0, 2.0, 4.0])[:, None]
    place = "vec3(0.1 - 0.5 + k, 0.2 + 1.5 - 3.0 * k, 0.9)"
    found = evaluated(
        "light/lamp_map.glsl", f"vec4(lamp_map(0, vec3(0.0, 0.0, -1.0), {place}, 2.0 + k), k)",
        bound={"lamp_maps": images.upload(pixels)}, textures=(("RGBA32F", "lamp_maps"),),
    )  # fmt: skip
    k = np.arange(64) / 63
    path = 2.0 + k
    by_distance = np.interp(np.log2(path), [0, 1, 2], [1, 2, 4]) * (1 + path**2)
    np.testing.assert_allclose(found[:, 0], k * by_distance, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(found[:, 1], (0.875 - 0.75 * k) * by_distance, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(found[:, 2], by_distance, rtol=1e-5)


def test_light_along_a_triangle_begins_where_the_curved_surface_is(gpu_context):
    """Lifted wholly up to a cosine of .05, by 2 - 20 cos from there to .1, not at all above; nor where light comes from
    behind the shading normal, or where nothing is lifted."""
    direction = "vec3(sqrt(1.0 - z * z), 0.0, z)"
    call = f"light_start(vec3(1.0, 2.0, 3.0), vec3(0.0, 0.0, 1.0), vec3(0.0, 0.0, 1.0), lift, {direction}, facing)"
    for lift in (0.5, 0.0):
        found = evaluated(
            "lib/gbuffer.glsl light/terminator.glsl", f"vec4({call}, z)",
            before=f"float z = 0.3 * k - 0.1; float lift = {lift}; vec3 facing = vec3(0.0);",
        )  # fmt: skip
        z = found[:, 3]
        expected = np.where((z > 0) & (z < 0.1), lift * np.clip(2 - 20 * z, 0, 1), 0.0)
        np.testing.assert_allclose(found[:, :2], np.tile([1.0, 2.0], (64, 1)))
        np.testing.assert_allclose(found[:, 2] - 3.0, expected, atol=1e-5)


def test_what_is_known_around_a_receiver_ends_at_the_wall(gpu_context):
    """Walls at 1 m on all sides: all of it up to .9 m, none from 1 m on, linear between; no wall: all of it."""
    off = "vec3(1.2 * k * cos(9.0 * k), 1.2 * k * sin(9.0 * k), 0.7)"
    for sides, wall in (("vec4(1.0), vec4(1.0)", 1.0), ("vec4(0.0), vec4(0.0)", np.inf)):
        found = evaluated(
            "lib/math.glsl implicit_visibility/around.glsl",
            f"vec4(seen_around({sides}, vec3(0.0, 0.0, 1.0), {off}, 2.0))",
        )[:, 0]
        np.testing.assert_allclose(found, np.clip(10 * (1 - 1.2 * np.arange(64) / 63 / wall), 0, 1), atol=2e-5)


def test_only_what_exceeds_white_scatters_in_its_own_colour(gpu_context):
    """1 - threshold / peak of a colour, and nothing of what is not brighter; what is not finite counts as black."""
    color = "vec3(4.0 * k, 2.0 * k, 0.0)"
    found = evaluated("glare/excess.glsl", f"vec4(excess_of({color}, 1.0, 3.0), 0.0)")
    k = np.arange(64) / 63
    kept = np.stack([4 * k, 2 * k, 0 * k], axis=1).clip(0, 3)
    share = np.where(kept[:, :1] > 1, 1 - 1 / np.maximum(kept[:, :1], 1e-9), 0.0)
    np.testing.assert_allclose(found[:, :3], kept * share, atol=1e-6)
    broken = evaluated("glare/excess.glsl", "vec4(excess_of(vec3(1.0 / (0.0 * k), 3.0, 0.0), 1.0, 9.0), 0.0)")
    np.testing.assert_allclose(broken[:, :3], np.tile([0.0, 2.0, 0.0], (64, 1)), atol=1e-6)


def test_codes_of_paths_say_what_was_put_into_them(gpu_context):
    """All 64 sums of bits: glossy where the two lowest are 1, clear and with photons by the same bit."""
    of = "float({0}(int(gl_FragCoord.x)))"
    names = ("path_is_glossy", "path_is_bent", "path_is_clear", "path_has_photons")
    found = evaluated("hits/path.glsl", f"vec4({', '.join(of.format(name) for name in names)})")
    code = np.arange(64)
    glossy, eight = code % 4 == 1, code & 8 != 0
    np.testing.assert_array_equal(found, np.stack([glossy, code & 4 != 0, eight & ~glossy, eight & glossy], axis=1))


def test_places_on_maps_of_clusters_are_stereographic(gpu_context):
    """The place of a direction at the angle a from the normal lies .4 tan(a / 2) from the middle, and leads back."""
    before = "float a = 1.7 * k; float b = 20.0 * k; vec3 d = vec3(sin(a) * cos(b), sin(a) * sin(b), cos(a));"
    given = {"before": before, "bound": {"virtual_lights": images.upload(np.zeros((1, 1, 4)))},
             "textures": (("RGBA32F", "virtual_lights"),)}  # fmt: skip
    found = evaluated("cluster/lights.glsl", "vec4(map_place(d), distance(map_direction(map_place(d)), d), k)", **given)
    k = np.arange(64)[:, None] / 63
    expected = 0.5 + 0.4 * np.tan(0.85 * k) * np.concatenate([np.cos(20 * k), np.sin(20 * k)], axis=1)
    np.testing.assert_allclose(found[:, :2], expected, atol=2e-5)
    np.testing.assert_allclose(found[:, 2], 0.0, atol=2e-6)


def test_weights_of_four_pictures_of_grass_are_squared_and_summed(gpu_context):
    """Of two rings, and of two azimuths on each (grass/table.glsl)."""
    inside, outside = 0.3, 0.8
    found = evaluated(
        "grass/table.glsl", f"vec4(grass_squares(k, {inside}, {outside}))",
        bound={"grass_table": images.upload(np.zeros((1, 1, 4)))}, textures=(("RGBA32F", "grass_table"),),
    )[:, 0]  # fmt: skip
    k = np.arange(64) / 63
    weights = [(1 - k) * (1 - inside), (1 - k) * inside, k * (1 - outside), k * outside]
    np.testing.assert_allclose(found, np.sum(np.square(weights), axis=0), atol=1e-6)


def test_a_disc_stands_for_a_sphere_of_which_as_much_is_seen(gpu_context):
    """From 1 to 5 m a sphere of half a metre is seen in a cone, of which the disc at its centre is a section
    (edges/samples.glsl)."""
    light = Block(EDGE_LIGHT, **(dict.fromkeys(EDGE_LIGHT.fields, 0) | {"shape": 2, "size": (0.0, 0.5, 0.0, 0.0)}))
    found = evaluated(
        "lib/math.glsl edges/samples.glsl", "vec4(length(f.u), length(f.v), f.spread, f.away)",
        before="LightFrame f = light_frame((1.0 + 4.0 * k) * vec3(0.36, 0.48, 0.8));", blocks={"edge_light": light},
    )  # fmt: skip
    away = 1 + 4 * np.arange(64) / 63
    cone = np.arcsin(0.5 / away)
    expected = np.stack([away * np.tan(cone), away * np.tan(cone), 1 - np.cos(cone), away], axis=1)
    np.testing.assert_allclose(found, expected, rtol=1e-4)


def test_air_is_as_deep_where_distances_differ_by_an_eighth_or_less(gpu_context):
    """Pixels two steps apart weigh less, in proportion to the difference of their distances, and nothing from a quarter
    of the larger one on (denoise/alike.glsl)."""
    found = evaluated(
        "lib/math.glsl denoise/alike.glsl", "vec4(alike(Shown(3.0 + 3.0 * k, vec3(1.0)), Shown(3.0, vec3(1.0)), 2), "
        "alike(Shown(3.0, vec3(1.0)), Shown(3.0 + 3.0 * k, vec3(1.0)), 2), 0.0, 0.0)", defines=(("OF_MEDIA", "1"),),
    )  # fmt: skip
    k = np.arange(64) / 63
    expected = np.maximum(1 - 4 * k / (1 + k), 0)
    np.testing.assert_allclose(found[:, :2], np.stack([expected, expected], axis=1), atol=1e-5)


def drawn(program, textures, size=(4, 1), **bindings) -> np.ndarray:
    """What a fullscreen program writes into its first output, which has `size`; of what it reads, an image of one value
    has that size, too."""
    bound = {
        name: images.upload(pixels if np.ndim(pixels) == 3 else np.broadcast_to(pixels, (*size[::-1], 4)))
        for name, pixels in textures.items()
    }
    with images.borrowed(*size, "RGBA32F") as target:
        passes.fullscreen(program, target, textures=bound, **bindings)
        return images.read(target.colors[0]).astype(np.float64)


def view_from_above(width, height, **fields) -> Block:
    """A view block of an eye 5 m above the plane z = 0."""
    frame = {"eye": (0.0, 0.0, 5.0, 1.0), "frame": (-1.0, 1.0, -1.0, 1.0), "film": (width, height, 0.1, 100.0)}
    return Block(VIEW, **(dict.fromkeys(VIEW.fields, 0) | {"backward": (0.0, 0.0, 1.0, 0.0)} | frame | fields))


def flat_surface(width, height) -> dict[str, np.ndarray]:
    """Images of a plane that faces the eye, of which pixel (x, y) shows the place (x, y, 0)."""
    place = np.zeros((height, width, 4))
    place[..., 1], place[..., 0] = np.mgrid[:height, :width]
    place[..., 3] = 1.0
    return {"surface_position": place, "surface_normal": np.zeros((height, width, 4))}


def test_light_of_fog_that_few_surfaces_know_reaches_all_between_them(gpu_context):
    """Known at every fourth pixel from (1, 2) on and linear in place, it is that everywhere, times the albedo."""
    stride, shown, (width, height) = 4, (1, 2), (40, 36)
    rows, columns = np.mgrid[: height // stride, : width // stride]
    known = np.stack([0.2 + columns, 0.5 + rows, 1.0 + 0.0 * rows, 0.0 * rows], axis=-1)
    albedo = np.array([0.2, 0.5, 0.8])
    nothing = dict.fromkeys(("surface_tint", "surface_lobe", "surface_emission"), (0.0, 0.0, 0.0, 0.0))
    found = drawn(
        surfaces_program(False),
        {
            **flat_surface(width, height), **nothing, "surface_diffuse": (*albedo, 0.0), "known_light": known,
            "energy_table": energy_texture(False),
        },
        (width, height), constants={"shown_pixel": shown, "stride": stride, "shaded_roughness": 0.5},
        blocks={"film_view": view_from_above(width, height)},
    )[10:-12, 10:-12, :3]  # fmt: skip
    y, x = np.mgrid[:height, :width][:, 10:-12, 10:-12]
    expected = np.stack([0.2 + (x - shown[0]) / stride, 0.5 + (y - shown[1]) / stride, 1.0 + 0.0 * x], axis=-1)
    np.testing.assert_allclose(found / albedo, expected, atol=0.02)


def test_a_split_region_has_the_mean_of_what_its_quarters_gathered_and_nothing_where_none_did(gpu_context):
    size, atlas = 8, np.zeros((8, 12, 4))
    rows, columns = np.mgrid[:4, :4]
    atlas[:4, 8:, 0], atlas[:4, 8:, 1], atlas[:4, 8:, 3] = columns, 10.0 * rows, 1.0
    gathered = np.where((columns < 2)[..., None], (0.0, 1.0, 0.0, 0.0), 0.0)  # of two regions all quarters
    found = drawn(
        PULL,
        {
            **flat_surface(size, size),
            "gathered": atlas, "region_flags": (1.0, 0.0, 0.0, 0.0), "finer_flags": gathered,
            "finer_irradiance": (7.0, 7.0, 7.0, 1.0),
        },
        (2, 2), blocks={"film_view": view_from_above(size, size)},
        constants={"grid_offset": (0, 0), "atlas_size": (size, size), "level": 2, "levels": 2, "depth_scale": 1.0},
    )  # fmt: skip
    np.testing.assert_allclose(found[:, 0], [[0.5, 5.0, 0.0, 1.0], [0.5, 25.0, 0.0, 1.0]], rtol=1e-5)
    np.testing.assert_array_equal(found[:, 1], 0.0)


def test_gloss_of_paths_is_in_proportion_to_its_weight(gpu_context):
    """At grazing angles it reflects all that its weight allows, straight on its tint of that: a faint coat a little."""
    before = """Surface s; s.diffuse = vec3(0.0); s.diffuse_weight = 1.0; s.diffuse_roughness = 0.0;
  float weight = 0.001 + k; s.kind = FRESNEL_F82; s.glossy_weight = vec3(weight); s.glossy_tint = vec3(0.6);
  s.glossy_edge = vec3(1.0); s.glossy_ior = 1.5; s.glossy_roughness = 0.6; s.glossy_anisotropy = 0.0;
  s.glossy_normal = vec3(0.0, 0.0, 1.0);
  Reflection r = surface_reflection(s, 0.5);"""
    found = evaluated(
        "lib/gbuffer.glsl lib/brdf.glsl indirect/albedo.glsl",
        "vec4(r.straight.x, r.grazing.x, r.grazing.x / weight, 0.0)", before=before, **with_table(),
    )  # fmt: skip
    np.testing.assert_allclose(found[:, 0], 0.6 * found[:, 1], rtol=1e-5)
    np.testing.assert_allclose(found[:, 2], found[-1, 2], rtol=1e-5)
    assert 1.0 <= found[0, 2] < 1.5


def test_the_film_is_as_opaque_as_what_was_seen(gpu_context):
    """Sums over samples, scaled; alpha from 0 to 1, whatever filters leave of it."""
    summed = np.array([[[8.0, 4.0, 2.0, alpha] for alpha in (0.0, 2.0, 4.0, 4.1)]])
    found = drawn(
        resolve_program((SUM,)), {SUM: summed}, constants={"scale": 0.25, "exposure": 2.0, "transparent": 1}
    )  # fmt: skip
    np.testing.assert_allclose(found[0, :, :3], np.tile([4.0, 2.0, 1.0], (4, 1)), rtol=1e-6)
    np.testing.assert_allclose(found[0, :, 3], [0.0, 0.5, 1.0, 1.0], rtol=1e-6)


def test_of_a_caustic_map_is_kept_what_lies_on_surfaces(gpu_context):
    """Its light, and how far along the view's axis the surface lies; nothing where there is none."""
    place = np.array([[[1.0, 2.0, 3.0, 1.0], [0.0, 0.0, 0.0, 0.0], [9.0, 9.0, -1.0, 1.0], [0.0, 0.0, 0.0, 0.0]]])
    found = drawn(
        KEEP, {"caustic_map": (0.5, 0.25, 2.0, 1.0), "receiver_position": place}, constants={"cell_corner": (0, 0)},
        blocks={"map_view": view_from_above(4, 1)},
    )  # fmt: skip
    expected = [[0.5, 0.25, 2.0, 2.0], [0.0] * 4, [0.5, 0.25, 2.0, 6.0], [0.0] * 4]
    np.testing.assert_allclose(found[0], expected, rtol=1e-6)


SAMPLED = """
  float sum = 0.0; float most = 0.0; float blunt = 0.0;
  for (int i = 0; i < 64 * 64; i++) {
    vec2 u = (vec2(i % 64, i / 64) + 0.5) / 64.0; vec3 weight;
    reflection_sample(r, normal, viewer, u, weight);
    sum += weight.x / (64.0 * 64.0); most = max(most, weight.x);
    blunt = max(blunt, PI * reflection_of(r, normal, cosine_direction(normal, u), viewer).x);
  }"""
SLANT = 0.02 + 0.98 * np.arange(64) / 63


def drawn_weights(lobe, viewer):
    """(64, 3): of 64 x 64 directions that `reflection_sample` draws of a Reflection `r`, as `lobe` sets it, the mean
    weight, the largest, and the largest by the cosine alone; the viewer at each of SLANT."""
    lobe = f"Reflection r; {lobe} float slant = 0.02 + 0.98 * k; vec3 normal = vec3(0.0, 0.6, 0.8);"
    return evaluated(
        "lib/gbuffer.glsl lib/brdf.glsl indirect/albedo.glsl",
        "vec4(sum, most, blunt, 0.0)",
        before=f"{lobe} vec3 viewer = {viewer};{SAMPLED}",
        **with_table(),
    )


def hemisphere():
    """Cosines (400, 1) to the normal and turns (400,), 0..pi, of light from one half, and weights (400,) of the former,
    which sum to 2."""
    nodes, weights = np.polynomial.legendre.leggauss(400)
    return (nodes[:, None] + 1) / 2, np.pi * np.arange(0.5, 400) / 400, weights


def test_paths_leave_by_the_lobe_with_its_energy_and_never_far_too_bright(gpu_context):
    """What a point draws of light from all sides is, in the mean, its integral over directions, at every slant; and no
    direction weighs much more than the mean, of which the cosine's own density made hundreds at grazing views."""
    found = drawn_weights(
        "r.diffuse = vec3(0.1); r.through = vec3(0.0); r.rough = 0.0; r.straight = vec3(0.6); r.grazing = vec3(0.9);"
        "r.alpha = 0.25;",
        "slant * normal + sqrt(max(1.0 - slant * slant, 0.0)) * vec3(1.0, 0.0, 0.0)",
    )
    high, turn, weights = hemisphere()
    for k in (0, 1, 5, 20, 63):
        viewer = np.array([np.sqrt(1 - min(SLANT[k], 1.0) ** 2), 0.0, SLANT[k]])
        aside = np.sqrt(1 - high**2)
        light = np.stack([aside * np.cos(turn), aside * np.sin(turn), high + 0 * turn], axis=-1)
        middle = light + viewer
        middle /= np.linalg.norm(middle, axis=-1, keepdims=True)
        squared = 0.25**2
        distribution = squared / np.pi / (middle[..., 2] ** 2 * (squared - 1) + 1) ** 2
        nl, nv = light[..., 2], SLANT[k]
        masked = nl * np.sqrt(nv**2 * (1 - squared) + squared) + nv * np.sqrt(nl**2 * (1 - squared) + squared)
        fresnel = 0.6 + 0.3 * np.clip(1 - (light * middle).sum(axis=-1), 0, 1) ** 5
        reflected = 0.1 / np.pi + fresnel * distribution * 0.5 / masked
        exact = ((reflected * nl).mean(axis=1) * weights).sum() * np.pi  # half of 2 pi: nodes span 2
        np.testing.assert_allclose(found[k, 0], exact, rtol=0.01)
    assert found[:, 1].max() < 1.5 < 30.0 < found[:, 2].max()


def test_paths_through_strands_leave_ahead_and_never_far_too_bright(gpu_context):
    """Behind a strand that light shines through: the mean of what is drawn is the integral over directions, at every
    slant of the view, and no weight is twice as large as all that arrives, where the cosine's own density makes 4.5."""
    n = 9.0
    found = drawn_weights(
        "r.diffuse = vec3(1.0); r.through = vec3(1.0); r.rough = -0.01; r.straight = vec3(0.0); r.grazing = vec3(0.0);"
        f"r.alpha = {n};",
        "sqrt(max(1.0 - slant * slant, 0.0)) * vec3(1.0, 0.0, 0.0) - slant * normal",
    )
    high, turn, weights = hemisphere()
    aside = np.sqrt(1 - high**2)
    for k in (0, 5, 20, 63):
        ahead = SLANT[k] * high - np.sqrt(1 - min(SLANT[k], 1.0) ** 2) * aside * np.cos(turn)
        scattered = (1 + 0.39 * n) * (0.5 + 0.5 * ahead) ** n * high
        np.testing.assert_allclose(found[k, 0], (scattered.mean(axis=1) * weights).sum(), rtol=0.01)
    assert found[:, 1].max() < 2.0 < 4.4 < found[:, 2].max()


def test_a_map_of_half_the_side_has_the_nearest_of_four_planes_where_most_lie_alike(gpu_context):
    """A map of parallel rays: planes across them at these distances, in blocks of four texels."""

    side, half = 4, 1.0  # to distances of a map of directions, 64 times its half side is added
    block = np.arange(side * side).reshape(side, side)
    z = np.repeat(np.repeat(64.0 + 3.0 + block, 2, axis=0), 2, axis=1)
    z += np.tile([[0.05, 0.02], [0.03, 0.0]], (side, side))
    z[-2:, -2:] = 64.0 + np.array([[5.0, 7.0], [5.05, 9.0]])  # two alike are too few
    normal = evaluated("ism/paraboloid.glsl", "vec4(plane_pack(Plane(1.0, vec3(0, 0, 1), false)), 0.0, 0.0)", 2)[0, 1]
    found = drawn(
        PULL_MAP, {"finer_maps": np.stack([z, np.full_like(z, normal), 0 * z, 0 * z], axis=-1)}, (side, side),
        constants={"map_side": side, "threshold": 0.1, "half_extent": half},
    )[..., 0]  # fmt: skip
    expected = 67.0 + block
    expected[-1, -1] = 0.0
    np.testing.assert_allclose(found, expected, atol=1e-4)


def test_what_scatters_below_a_cell_of_pixels_is_its_mean_over_those_that_do(gpu_context):
    """Two materials side by side, of 2 x 2 pixels each; in bands the length of the profile, its colour, the share."""
    scatters = np.array([[1, 0, 1, 1], [1, 0, 1, 1]], bool)
    length, share, walk = np.random.default_rng(2).random((3, 2, 4, 4))
    length[..., 3] = 0.0
    share[..., 3] = np.where(scatters, 4.0 * 3 + 2, 0.0)  # of object 3, by method 2
    walk[..., 0], walk[..., 1] = 0.25, 1.4
    found = drawn(MEANS, {"spread_length": length, "scatter_share": share, "scatter_walk": walk}, (2, 3), constants={
        "extent": (2, 2), "rows": 1,
    })  # fmt: skip
    for column in range(2):
        own = (slice(None), slice(2 * column, 2 * column + 2))
        np.testing.assert_allclose(found[0, column], [*length[own][scatters[own]].mean(axis=0)[:3], 2.0], rtol=1e-5)
        assert found[1, column, 3] == pytest.approx(0.25)
        np.testing.assert_allclose(found[2, column], [*share[own][scatters[own]].mean(axis=0)[:3], 1.4], rtol=1e-5)


def test_candidates_are_ordered_within_the_bounds_of_those_that_are_there_and_count_once(gpu_context):
    """Six of which two are none, far away; of the others one sends nothing."""
    points = np.zeros((2, 4, 4))
    points[0] = [(1, 2, 3, 1), (1e6, 0, 0, 0), (-1, 0, 2, -1), (0, 5, -4, 1)]
    points[1, :2] = [(0, -1e6, 1e6, 0), (2, 1, 1, 1)]
    sends = np.array([[0.5, 9.0, 2.0, 0.0], [9.0, 3.0, 0.0, 0.0]])
    choice = Choice(4, 6, (0.0, 0.0, 0.0, 1e9))
    point, black = images.upload(points), images.upload(np.zeros((2, 4, 4)))
    choice.order(point, images.upload(np.zeros((2, 4, 4))))
    low, high = (images.read(one)[0, :, :3] for one in choice._held[:2])
    assert low.min(axis=0).tolist() == [-1, 0, -4] and high.max(axis=0).tolist() == [2, 5, 3]
    radiance = images.upload(np.repeat(sends[..., None], 4, axis=2))
    choice.radiances(
        {"candidate_point": point, "candidate_radiance": radiance, "candidate_albedo": black, "next_radiance": black},
        None,
    )
    importance = images.read(choice.importance)[..., :2].reshape(-1, 2)
    assert sorted(value for value in importance[:, 0] if value) == pytest.approx([0.5, 2.0, 3.0])
    np.testing.assert_array_equal(importance[:, 1], importance[:, 0] > 0)
    choice.release()


def test_luminance_is_the_second_row_of_the_primaries_matrix(gpu_context):
    """Of Rec. 709 with the white point D65."""
    primaries = np.array([[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]])
    columns = np.column_stack([primaries, 1 - primaries.sum(axis=1)]).T / primaries[:, 1]
    exact = np.linalg.solve(columns, np.array([0.3127, 0.3290, 1 - 0.6417]) / 0.3290)
    channels = ", ".join(f"luminance(vec3({c}))" for c in ("1.0, 0.0, 0.0", "0.0, 1.0, 0.0", "0.0, 0.0, 1.0", "1.0"))
    found = evaluated("lib/math.glsl", f"vec4({channels})", 2)[0]
    np.testing.assert_allclose(found, [*exact, 1.0], atol=1e-4)


def test_records_of_a_material_are_marked_by_who_leads_its_program(gpu_context):
    """Who leads, and where values begin, come out of one float; with the first goes the depth of the mask."""
    leader, base = np.array([0, 1, 255, 256, 8000, 8191]), np.array([0, 3, 511, 17, 1000, 1023])
    packed = np.zeros((1, 256, 4))
    packed[0, : len(leader), 3] = leader + (base << hits.LEADER_BITS)
    found = evaluated(
        "hits/shared.glsl", "vec4(shared_leader(m), shared_base(m), shared_depth(m), 0.0)", len(leader),
        before="int m = int(gl_FragCoord.x);", bound={"hit_materials": images.upload(packed)},
        textures=(("RGBA32F", "hit_materials"),),
    )  # fmt: skip
    np.testing.assert_array_equal(found[:, :2], np.stack([leader, base], axis=1))
    np.testing.assert_array_equal(found[:, 2], [np.float32(hits.depth_of(int(k))) for k in leader])
