"""Full-screen passes, draws and dispatches: blending, viewports, thread counts, shared memory."""

from dataclasses import replace

import numpy as np
import pytest

from addon.gfx import geometry, images, library, passes
from addon.gfx.library import Program

CONSTANT = passes.fullscreen_program(
    "constant",
    "generated/main",
    constants=(("VEC4", "value"),),
    outputs=tuple(("VEC4", f"out{k}") for k in range(4)),
    snippets=(
        ("generated/main", "void main() { out0 = value; out1 = -value; out2 = value * 0.5; out3 = vec4(1.0); }"),
    ),
)
PLACE = passes.fullscreen_program(
    "place",
    "generated/main",
    outputs=(("VEC4", "out_place"),),
    snippets=(("generated/main", "void main() { out_place = vec4(gl_FragCoord.xy, screen); }"),),
)
TRIANGLE = Program(
    name="triangle",
    vertex="generated/vertex",
    fragment="generated/fragment",
    inputs=(("VEC3", "position"), ("INT", "number")),
    varyings=(("flat", "IVEC2", "who"),),
    outputs=(("VEC4", "out_who"),),
    constants=(("INT", "first"),),
    snippets=(
        (
            "generated/vertex",
            "void main() { who = ivec2(number, first + gl_InstanceID); gl_Position = vec4(position, 1.0); }",
        ),
        ("generated/fragment", "void main() { out_who = vec4(vec2(who), 0.0, 1.0); }"),
    ),
)


def compute_program(name, source, **declared):
    return Program(name=name, compute="generated/main", snippets=(("generated/main", source),), **declared)


def targets(count, size=(5, 3)):
    target = images.Target(tuple(images.create(*size, "RGBA32F") for _ in range(count)))
    target.clear()
    return target


def test_additive_blending_into_four_float_targets_is_exact(gpu_context):
    target = targets(4)
    values = [(2.0**24 - 3, 1.0, 0.1, 0.0), (1.0, -1e-7, 0.2, 5.0), (1.0, 3.0, 0.7, -7.0)]
    for value in values:
        passes.fullscreen(CONSTANT, target, blend="ADDITIVE_PREMULT", constants={"value": value})
    total = np.zeros(4, np.float32)
    for value in values:
        total += np.array(value, np.float32)
    for image, expected in zip(target.colors, (total, -total, total * 0.5, np.full(4, 3.0))):
        np.testing.assert_array_equal(images.read(image), np.broadcast_to(expected, (3, 5, 4)))


def test_without_blending_the_last_pass_stands(gpu_context):
    target = targets(4)
    for value in ((1, 2, 3, 4), (5, 6, 7, 8)):
        passes.fullscreen(CONSTANT, target, constants={"value": value})
    assert (images.read(target.colors[0]) == [5, 6, 7, 8]).all()


@pytest.mark.parametrize("size", [(1, 1), (7, 1), (5, 3), (33, 17)])
def test_a_full_screen_pass_reaches_every_pixel_once_and_row_0_is_the_bottom(gpu_context, size):
    target = targets(1, size)
    passes.fullscreen(PLACE, target, blend="ADDITIVE_PREMULT")
    y, x = np.mgrid[0 : size[1], 0 : size[0]] + 0.5
    found = images.read(target.colors[0])
    np.testing.assert_array_equal(found[..., 0], x)
    np.testing.assert_array_equal(found[..., 1], y)
    np.testing.assert_allclose(found[..., 2:], np.dstack([x / size[0], y / size[1]]), atol=1e-6)


def quad(depth=0.0, number=1):
    """Two triangles over the whole viewport."""
    position = np.array([[-1, -1, depth], [1, -1, depth], [1, 1, depth], [-1, 1, depth]], np.float32)
    vertices = geometry.vertex_buffer(position=position, number=np.full(4, number, np.int32))
    return geometry.triangle_batch(vertices, np.array([[0, 1, 2], [0, 2, 3]]))


def draw_quads(target, *drawn, **state):
    shader = library.get(TRIANGLE)
    with passes.drawing(target, **state):
        shader.bind(constants={"first": 0})
        for batch, instances in drawn:
            passes.draw(shader, batch, instances)
    return images.read(target.colors[0])


def with_depth(size=(8, 6)):
    target = images.Target((images.create(*size, "RGBA32F"),), images.create(*size, "DEPTH_COMPONENT32F"))
    target.clear()
    return target


def test_a_viewport_bounds_what_is_drawn(gpu_context):
    covered = draw_quads(with_depth(), (quad(), 1), viewport=(2, 1, 3, 4))[..., 3]
    expected = np.zeros((6, 8))
    expected[1:5, 2:5] = 1
    np.testing.assert_array_equal(covered, expected)


def test_a_viewport_does_not_outlast_its_draw(gpu_context):
    target = with_depth()
    draw_quads(target, (quad(), 1), viewport=(0, 0, 2, 2))
    assert draw_quads(target, (quad(), 1))[..., 3].all()


def test_the_nearer_surface_wins_in_any_order_and_the_far_plane_is_behind_everything(gpu_context):
    near, far = quad(-0.5, 1), quad(0.5, 2)
    for order in ((near, far), (far, near)):
        assert (draw_quads(with_depth(), *((batch, 1) for batch in order))[..., 0] == 1).all()


def test_integer_attributes_and_instance_numbers_arrive_unchanged(gpu_context):
    seen = draw_quads(with_depth(), (quad(number=2**24 - 1), 3), depth_test="NONE")
    assert (seen[..., 0] == 2**24 - 1).all()
    assert (seen[..., 1] == 2).all()  # the last of three instances


@pytest.mark.parametrize("size", [(1, 1), (7, 5), (8, 8), (9, 17), (64, 1)])
def test_a_dispatch_runs_one_thread_per_texel_of_any_size(gpu_context, size):
    program = compute_program(
        "threads",
        """
        void main()
        {
          ivec2 p = ivec2(gl_GlobalInvocationID.xy);
          imageStore(seen, p, imageLoad(seen, p) + vec4(vec2(p), 1.0, 0.0));
        }
        """,
        images=(("seen", "RGBA32F", "FLOAT_2D", "READ_WRITE"),),
    )
    target = targets(1, size)
    passes.compute(program, size, images={"seen": target.colors[0]})
    found = images.read(target.colors[0])
    y, x = np.mgrid[0 : size[1], 0 : size[0]]
    np.testing.assert_array_equal(found[..., :3], np.dstack([x, y, np.ones_like(x)]))


def test_shared_memory_is_spelt_so_that_every_blender_keeps_it(gpu_context):
    """Blender 5.1 and later strip the word `shared` from sources; a define brings it through."""
    program = compute_program(
        "shared memory",
        """
        SHARED_MEM float row[64];
        void main()
        {
          int i = int(gl_LocalInvocationID.x);
          row[i] = float(i * i);
          barrier();
          imageStore(seen, ivec2(i, 0), vec4(row[63 - i]));
        }
        """,
        defines=(("SHARED_MEM", "shared"),),
        images=(("seen", "R32F", "FLOAT_2D", "WRITE"),),
        group=(64, 1, 1),
    )
    seen = images.create(64, 1, "R32F")
    passes.compute(program, (64, 1), images={"seen": seen})
    np.testing.assert_array_equal(images.read(seen).ravel(), np.arange(63, -1, -1.0) ** 2)


def test_vertex_attributes_of_different_lengths_are_refused():
    with pytest.raises(ValueError, match="Vertex attribute 'normal' has 3 entries, the others have 4"):
        geometry.vertex_buffer(position=np.zeros((4, 3)), normal=np.zeros((3, 3)))


def test_profiled_steps_add_up_by_name_and_count_calls(gpu_context):
    from addon.gfx.timing import Profiler

    for wait in (False, True):
        profiler = Profiler(wait)
        for _ in range(3):
            with profiler.step("pass"):
                passes.fullscreen(CONSTANT, targets(4), constants={"value": (1, 1, 1, 1)})
        assert profiler.calls == {"pass": 3}
        assert profiler.seconds["pass"] > 0


SLOW_SOURCE = """void main()
{
  float x = screen.x + imageLoad(shown, ivec2(gl_FragCoord.xy)).x;
  for (int k = 0; k < 1000; k++) { x = fract(x * 1.7 + 0.3); }
  out_value = vec4(x);
}
"""
SLOW = passes.fullscreen_program(
    "slow",
    "generated/main",
    outputs=(("VEC4", "out_value"),),
    images=(("shown", "RGBA32F", "FLOAT_2D", "READ"),),
    snippets=(("generated/main", SLOW_SOURCE),),
)
TAKEN = compute_program(
    "taken",
    "void main()\n{\n  ivec2 texel = ivec2(gl_GlobalInvocationID.xy);\n"
    "  imageStore(copied, texel, texelFetch(drawn, texel, 0));\n}",
    textures=(("FLOAT_2D", "drawn"),),
    images=(("copied", "RGBA32F", "FLOAT_2D", "WRITE"),),
)


def test_dispatch_finds_what_was_drawn_before_it(gpu_context):
    """Also while the GPU still works on a pass that reads what was there before (seen with llvmpipe)."""
    size = (256, 256)
    busy, drawn = targets(1, size), targets(4, size)
    copied = images.create(*size, "RGBA32F")
    for k in range(1, 5):
        passes.fullscreen(SLOW, busy, images={"shown": drawn.colors[0]})
        passes.fullscreen(CONSTANT, drawn, constants={"value": (k, k, k, k)})
        passes.compute(TAKEN, size, textures={"drawn": drawn.colors[0]}, images={"copied": copied})
        assert (images.read(copied) == k).all()


def test_an_image_beside_others_is_said_to_be_left_out_where_a_program_has_no_room(gpu_context):
    names = tuple(f"picture{k}" for k in range(library.MOST_TEXTURES))
    total = " + ".join(f"{name}_fetch(ivec2(0))" for name in names)
    crowded = passes.fullscreen_program(
        "crowded",
        "generated/main",
        textures=tuple(("RGBA32F", name) for name in names),
        outputs=(("VEC4", "out_sum"),),
        snippets=(("generated/main", f"void main() {{ out_sum = {total}; }}"),),
    )
    one = images.upload(np.ones((1, 1, 4), np.float32))
    beside = images.upload(np.ones((1, 1, 4), np.float32))
    beside.beside = {"lamp_maps": one}
    passes.left_out.clear()
    target = images.Target((images.create(1, 1, "RGBA32F"),))
    passes.fullscreen(crowded, target, textures=dict.fromkeys(names, beside))
    assert passes.left_out == {("crowded", "lamp_maps")}
    assert images.read(target.colors[0])[0, 0, 0] == len(names)
    passes.left_out.clear()
    passes.fullscreen(
        replace(crowded, has_no_use=("lamp_maps",)), target, textures=dict.fromkeys(names, beside)
    )  # what has no use for it says nothing
    assert not passes.left_out
