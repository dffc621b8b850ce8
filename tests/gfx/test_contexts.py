"""What OpenGL's contexts share, and what each of them remembers by itself."""

import ctypes

import bpy
import gpu
import numpy as np
import pytest

from addon.gfx import images, passes
from addon.gfx.library import MOST_TEXTURES

TEXTURE_0, BINDING_2D = 0x84C0, 0x8069  # GL_TEXTURE0, GL_TEXTURE_BINDING_2D
NAMES = ("first", "second", "third")
THREE = passes.fullscreen_program(
    "three textures", "generated/main", textures=tuple(("FLOAT_2D", name) for name in NAMES),
    outputs=(("VEC4", "out_color"),),
    snippets=(
        (
            "generated/main",
            f"void main() {{ out_color = vec4({', '.join(f'{name}_fetch(ivec2(0)).x' for name in NAMES)}, 1.0); }}",
        ),
    ),
)  # fmt: skip
NONE = passes.fullscreen_program(
    "no textures", "generated/main", outputs=(("VEC4", "out_color"),),
    snippets=(("generated/main", "void main() { out_color = vec4(1.0); }"),),
)  # fmt: skip


@pytest.fixture
def target(gpu_context):
    return images.Target((images.create(4, 4, "RGBA32F"),))


@pytest.fixture
def elsewhere(gpu_context):
    """Runs a function in the GPU context of a final render."""
    todo = []

    class Other(bpy.types.RenderEngine):
        bl_idname, bl_label, bl_use_gpu_context = "CANDELA_OTHER", "Other", True

        def render(self, depsgraph):
            with images.passing_context():
                todo.pop()()

    def run(function):
        todo.append(function)
        bpy.ops.render.render()

    bpy.ops.wm.read_factory_settings()
    bpy.utils.register_class(Other)
    render = bpy.context.scene.render
    render.engine, render.resolution_x, render.resolution_y = Other.bl_idname, 16, 16
    yield run
    bpy.utils.unregister_class(Other)


def three(value):
    return {name: images.upload(np.full((4, 4, 4), value + k, np.float32)) for k, name in enumerate(NAMES)}


def bound():
    """OpenGL's names of the textures that the current context has bound, by unit."""
    try:
        library = ctypes.CDLL("libGL.so.1")
    except OSError:
        pytest.skip("no libGL.so.1, of which the names are asked")
    names = []
    for unit in range(MOST_TEXTURES):
        name = ctypes.c_int()
        library.glActiveTexture(TEXTURE_0 + unit)
        library.glGetIntegerv(BINDING_2D, ctypes.byref(name))
        names.append(name.value)
    library.glActiveTexture(TEXTURE_0)
    return names


def test_whoever_comes_to_a_context_and_leaves_it_has_bound_no_texture_that_may_be_freed_elsewhere(target):
    """A new texture has the name of one that was freed, with most drivers, and Blender binds none whose name is bound:
    the old one would be read in its place."""
    if gpu.platform.backend_type_get() != "OPENGL":
        pytest.skip("names are OpenGL's")
    textures = three(1.0)
    passes.fullscreen(THREE, target, textures=textures)
    before = bound()[:3]
    with images.lasting_context():
        passes.fullscreen(NONE, target)
        found = bound()
        passes.fullscreen(THREE, target, textures=textures)
        again = bound()[:3]
    after = bound()
    assert len({*before}) == 3 and again == before
    assert len({*found}) == 1 and not {*found} & {*before}
    assert after == found


def test_an_image_is_read_itself_where_another_context_freed_one_and_made_it(target, elsewhere):
    held = {}

    def seen():
        with images.lasting_context():
            passes.fullscreen(THREE, target, textures=held)
            return images.read(target.colors[0])[0, 0, :3].tolist()

    def made(value):
        held.clear()
        held.update(three(value))

    for value in (10.0, 20.0, 30.0):
        elsewhere(lambda value=value: made(value))
        assert seen() == [value, value + 1.0, value + 2.0]
