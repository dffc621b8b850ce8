"""Passes of techniques by themselves, against closed forms: what one draws of images that are made up."""

import numpy as np
import pytest

from addon.eye.scatter import BILLBOARDS
from addon.gfx import images, passes
from addon.gfx.library import Program
from addon.gfx.struct import Block
from addon.kernels.convolution import PYRAMID, Basis, series
from addon.lighting.edge_tiles import COUNT, EDGE_LIGHT
from addon.lighting.light_choice import Choice
from addon.scene.view import VIEW
from addon.surfaces import hits
from addon.techniques.caustics_mapping import APPLY
from tests.glsl import evaluated
from tests.techniques.test_shader_functions import drawn


def test_what_paths_reflect_again_counts_by_its_colour_on_the_surface(gpu_context):
    """Radiance of a candidate: what it sends by itself, and of the next surface's light what it reflects; w: luminance
    of that part of either which was reflected once more, which luminances of factors do not give."""
    random = np.random.default_rng(8)
    straight, albedo, later = random.random((3, 4, 4))
    points = np.zeros((1, 4, 4))
    points[0, :, 0], points[0, :, 3] = np.arange(4), 1.0
    choice = Choice(4, 4, (0.0, 0.0, 0.0, 1e9))
    point = images.upload(points)
    order = images.read(choice.order(point, images.upload(0 * points))).reshape(-1)[:4]
    found = {"candidate_radiance": straight, "candidate_albedo": albedo, "next_radiance": later}
    found = {name: images.upload(pixels[None]) for name, pixels in found.items()} | {"candidate_point": point}
    radiance = images.read(choice.radiances(found, None)).reshape(-1, 4)[:4]
    choice.release()
    weights = np.array([0.2126, 0.7152, 0.0722])
    reflected = albedo[:, :3] * later[:, :3]
    again = straight[:, 3] + albedo[:, 3] / (later[:, :3] @ weights) * (reflected @ weights)
    expected = np.column_stack([straight[:, :3] + reflected, again])
    np.testing.assert_allclose(radiance, expected[order], rtol=1e-5)


def test_materials_that_rays_met_are_flagged_and_the_leaders_of_their_programs(gpu_context):
    """Each at its place in rows of 256; not those of a ray that is none, or of one that left the scene."""
    numbers, leaders = np.array([0, 5, 255, 300, 7, 8]), {0: 0, 5: 300, 255: 255, 300: 600, 7: 7, 8: 8}
    place, rays, materials = np.ones((1, 6, 4)), np.ones((1, 6, 4)), np.zeros((hits.MET_ROWS, hits.ROW, 4))
    rays[0, 4], place[0, 5, 3] = 0.0, 0.0
    materials.reshape(-1, 4)[[*leaders], 3] = [*leaders.values()]
    read = {"hit_place": place, "rays": rays, "hit_materials": materials}
    textures = {name: images.upload(pixels) for name, pixels in read.items()}
    textures["hit_material"] = images.upload(numbers.reshape(1, 6, 1), "R32F")
    with images.borrowed(hits.ROW, 2 * hits.MET_ROWS, "R32UI") as met:
        met.colors[0].texture.clear(format="UINT", value=(0,))
        passes.compute(hits.MATERIALS_MET, (6, 1), textures=textures, images={"met": met.colors[0]})
        flags = images.read(met.colors[0]).reshape(2, -1)
    assert [np.flatnonzero(half).tolist() for half in flags] == [[0, 5, 255, 300], [0, 255, 300, 600]]


@pytest.mark.parametrize("number", [0, 5, 255, 300])
def test_a_material_is_evaluated_where_a_ray_has_met_its_program(gpu_context, number):
    """By one flag for each in rows of 256; where it is not set the triangle lies beside the screen."""
    flag = f"""void main()
{{
  ivec2 place = ivec2(gl_FragCoord.xy);
  out_met = uint(place == ivec2({number % hits.ROW}, {hits.MET_ROWS + number // hits.ROW}));
}}"""
    flags = passes.fullscreen_program(
        "a flag", "generated/main", outputs=(("UINT", "out_met"),), snippets=(("generated/main", flag),)
    )
    shown = Program(
        name="where a material was met", vertex=hits.MASKED["vertex"], fragment="generated/main",
        inputs=passes.FULLSCREEN_INPUTS, varyings=passes.FULLSCREEN_VARYINGS, outputs=(("VEC4", "out_place"),),
        textures=(("UINT_2D", "materials_met"),), constants=(("FLOAT", "material_depth"), ("INT", "material_number")),
        defines=(("ASKS_IF_MET", str(hits.MET_ROWS)),),
        snippets=(("generated/main", "void main() { out_place = vec4(screen, gl_FragCoord.z, 1.0); }"),),
    )  # fmt: skip
    with images.borrowed(hits.ROW, 2 * hits.MET_ROWS, "R32UI") as met, images.borrowed(4, 2, "RGBA32F") as target:
        passes.fullscreen(flags, met)
        for asked in (number, number + 1):
            target.clear()
            passes.fullscreen(
                shown, target, textures={"materials_met": met.colors[0]},
                constants={"material_depth": 0.75, "material_number": asked},
            )  # fmt: skip
            found = images.read(target.colors[0])
            if asked != number:
                assert not found.any()
                continue
            y, x = np.mgrid[:2, :4]
            expected = [(x + 0.5) / 4, (y + 0.5) / 2, np.full((2, 4), 0.75), np.ones((2, 4))]
            np.testing.assert_allclose(found, np.stack(expected, axis=-1), atol=1e-6)


def test_a_triangle_that_the_eye_looks_through_counts_where_it_hides_the_light_and_no_longer_from_there(gpu_context):
    """Of receivers on both sides of its plane those on the eye's are not asked; one that is none has no count."""
    program = COUNT["triangles"]
    receivers = np.array([[[0, 0, 2, 1], [0, 0, 0, 1], [0, 0, -3, 1], [0, 0, 0, 0]]], float)
    light = Block(EDGE_LIGHT, **dict.fromkeys(EDGE_LIGHT.fields, 0))
    for centre, expected in ((1.0, [0, 1, 1, 0]), (-1.0, [0, -1, -1, 0])):
        sides = (("flat_a", "vec4(0.0, 0.0, 1.0, -1.0)"), ("flat_b", f"vec4({centre}, 1.0, 0.0, 0.0)"))
        own = passes.fullscreen_program(
            "count of a triangle", program.fragment, textures=(("RGBA32F", "receivers"),), outputs=program.outputs,
            blocks=((EDGE_LIGHT, "edge_light"),), defines=sides,
        )  # fmt: skip
        found = drawn(own, {"receivers": receivers}, blocks={"edge_light": light})
        np.testing.assert_array_equal(found[0, :, 0], expected)


def test_a_billboard_has_the_kernel_between_its_texels(gpu_context):
    """A kernel that is a product of two slopes, read bilinearly about a place between pixels; beyond it is nothing."""
    reach, middle = 3, (5.3, 4.8)
    y, x = np.mgrid[: 2 * reach + 1, : 2 * reach + 1]
    weights = np.stack([1.0 + x, 2.0 + y, (1.0 + x) * (2.0 + y), 0.0 * x], axis=-1)
    program = passes.fullscreen_program(
        "one billboard", BILLBOARDS.fragment, textures=(("FLOAT_2D", "weights"),), constants=(("INT", "reach"),),
        defines=(("light", "vec4(2.0, 3.0, 4.0, 0.0)"), ("middle", f"vec2{middle}")), outputs=BILLBOARDS.outputs,
    )  # fmt: skip
    found = drawn(program, {"weights": weights}, (12, 10), constants={"reach": reach})
    y, x = np.mgrid[:10, :12]
    y, x = y + 0.5 - middle[1] + reach, x + 0.5 - middle[0] + reach
    inside = (x >= 0) & (x <= 2 * reach) & (y >= 0) & (y <= 2 * reach)
    expected = np.stack([2 * (1 + x), 3 * (2 + y), 4 * (1 + x) * (2 + y)], axis=-1)
    np.testing.assert_allclose(found[inside][:, :3], expected[inside], rtol=1e-5)
    beyond = (x <= -1) | (x >= 2 * reach + 1) | (y <= -1) | (y >= 2 * reach + 1)
    assert beyond.any() and not found[beyond][:, :3].any()


ORDER, SIDE = 4, 32  # of a map whose basis is averaged


def averaged(source, expression, before=""):
    """A GLSL expression of `k`, of means by pyramid of what `source` says of `tile` and `at` (a texel's centre)."""
    glsl = f"""#include "lib/convolution.glsl"
vec4 basis_source(ivec2 place)
{{
  ivec2 cell = place / base_extent;
  vec2 at = vec2(place - cell * base_extent) + 0.5;
  int tile = cell.x + cell.y * tile_columns;
  return {source};
}}
"""
    basis = Basis("a map", glsl, ORDER, PYRAMID)
    size, image_format = basis.image(SIDE, SIDE)
    scale, _ = series(ORDER)
    with images.borrowed(*size, image_format) as means:
        basis.build(means.colors[0], (SIDE, SIDE), 4, {}, {})
        constants = basis.constants_for(SIDE, SIDE) | {"top_level": 4}
        kinds = {"base_extent": "IVEC2"}
        return evaluated(
            "cssm/filter.glsl", expression, before=before, bound={"basis_means": means.colors[0]},
            textures=((image_format, "basis_means"),),
            constants={(kinds.get(name, "INT"), name): value for name, value in constants.items()},
            defines=(("ORDER", str(ORDER)), ("SERIES_SCALE", f"{scale:.6f}")),
        )  # fmt: skip


@pytest.mark.parametrize(("width", "height"), [(4.0, 4.0), (16.0, 4.0), (3.0, 12.0)])
def test_the_mean_of_a_box_lies_in_its_middle(gpu_context, width, height):
    """Of what grows evenly over the map, whether the box is read at once or in parts along its longer side."""
    box = f"vec2(6.0 + 4.0 * k, 9.0 - 2.0 * k), vec2(6.0 + 4.0 * k, 9.0 - 2.0 * k) + vec2({width}, {height})"
    whole = f"vec4(0.0, 0.0, {SIDE}.0, 0.0)"
    found = averaged(f"vec4(at / {SIDE}.0, at.x * 0.01, float(tile))", f"basis_mean({whole}, {box}, 3)")
    k = np.arange(64) / 63
    x, y = 6 + 4 * k + width / 2, 9 - 2 * k + height / 2
    np.testing.assert_allclose(found, np.stack([x / SIDE, y / SIDE, 0.01 * x, 3 + 0 * x], axis=1), atol=2e-3)


def test_a_box_of_one_depth_is_nearer_than_what_lies_beyond_and_to_nothing_before_it(gpu_context):
    """Exactly so from the offset of the series on."""
    offset = series(ORDER)[1]
    whole = f"vec4(0.0, 0.0, {SIDE}.0, 0.0), vec2(8.0), vec2(16.0, 12.0)"
    found = averaged("basis_values(tile, 0.5)", f"vec4(basis_nearer({whole}, 0.05 + 0.9 * k), k, 0.0, 0.0)")
    beyond = 0.05 + 0.9 * np.arange(64) / 63 - 0.5
    apart = np.abs(beyond) > offset + 0.005
    np.testing.assert_allclose(found[apart, 0], beyond[apart] > 0, atol=5e-3)
    assert apart.sum() > 40


def test_a_caustic_map_is_read_between_its_texels(gpu_context):
    """Irradiance that grows evenly over a map of the square from -1 to 1, as a parallel view shows it."""
    random, side = np.random.default_rng(5), 8
    at = (np.arange(side) + 0.5) * 2 / side - 1
    x, y = np.meshgrid(at, at)
    texels = np.stack([x, y, 0 * x, 0 * x + 1], axis=-1)
    places = np.zeros((3, 4, 4))
    places[..., :2], places[..., 3] = random.uniform(at[0], at[-1], (3, 4, 2)), 1.0
    fields = {name: np.zeros(4) if kind == "vec4" else 0 for name, (kind, _) in VIEW.fields.items()}
    fields |= {"row_x": np.eye(4)[0], "row_y": np.eye(4)[1], "row_w": np.eye(4)[3], "eye": np.eye(4)[3]}
    fields |= {"frame": (-1.0, 1.0, -1.0, 1.0), "film": (side, side, 0.0, 2.0)}
    read = {
        "surface_position": places, "surface_normal": 0 * places, "surface_diffuse": 0 * places + 0.5,
        "receiver_position": texels, "receiver_normal": 0 * texels,
        "caustic_map": np.stack([x + 2, y + 2, x + y + 4, 0 * x], axis=-1),
    }  # fmt: skip
    with images.borrowed(4, 3, "RGBA32F") as found:
        textures = {name: images.upload(pixels) for name, pixels in read.items()}
        passes.fullscreen(APPLY, found, textures=textures, blocks={"map_view": Block(VIEW, **fields)})
        light = images.read(found.colors[0])[..., :3]
    x, y = places[..., 0], places[..., 1]
    np.testing.assert_allclose(light, np.stack([x + 2, y + 2, x + y + 4], axis=-1) * 0.5 / np.pi, rtol=1e-3)
