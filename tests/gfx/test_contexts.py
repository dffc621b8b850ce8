"""What OpenGL's contexts share, and what each of them remembers by itself."""

import ctypes
import gc
from itertools import pairwise

import bpy
import gpu
import numpy as np
import pytest

from addon.gfx import images, library, passes
from addon.gfx.library import MOST_IMAGES, MOST_TEXTURES

TEXTURE_0, TEXTURE_BINDING, IMAGE_BINDING = (
    0x84C0,
    0x8069,
    0x8F3A,
)  # GL_TEXTURE0, _TEXTURE_BINDING_2D, _IMAGE_BINDING_NAME
NAMES = ("first", "second", "third")
MAIN = f"void main() {{ out_color = vec4({', '.join(f'{name}_fetch(ivec2(0)).x' for name in NAMES)}, 1.0); }}"
# Fetched, and loaded as from images where that is faster.
THREE, LOADED = (
    passes.fullscreen_program(
        f"three of {kind}", "generated/main", textures=tuple((kind, name) for name in NAMES),
        outputs=(("VEC4", "out_color"),), snippets=(("generated/main", MAIN),),
    )
    for kind in ("FLOAT_2D", "RGBA32F")
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


def library_of_opengl():
    try:
        return ctypes.CDLL("libGL.so.1")
    except OSError:
        pytest.skip("no libGL.so.1, which is asked what Blender does not tell")


def bound():
    """OpenGL's names of the textures that the current context has bound to its units, and of those bound as images."""
    opengl = library_of_opengl()
    textures, images_of = (ctypes.c_int * MOST_TEXTURES)(), (ctypes.c_int * MOST_IMAGES)()
    for unit in range(MOST_TEXTURES):
        opengl.glActiveTexture(TEXTURE_0 + unit)
        opengl.glGetIntegerv(TEXTURE_BINDING, ctypes.byref(textures, 4 * unit))
    opengl.glActiveTexture(TEXTURE_0)
    for unit in range(MOST_IMAGES):
        opengl.glGetIntegeri_v(IMAGE_BINDING, unit, ctypes.byref(images_of, 4 * unit))
    return [*textures, *images_of]


@pytest.mark.parametrize("program", [THREE, LOADED], ids=["fetched", "loaded"])
def test_whoever_comes_to_a_context_and_leaves_it_has_bound_no_texture_that_may_be_freed_elsewhere(
    target, program, monkeypatch
):
    """A new texture has the name of one that was freed, with most drivers, and none is bound whose name is bound: the
    old one would be read in its place."""
    if gpu.platform.backend_type_get() != "OPENGL":
        pytest.skip("names are OpenGL's")
    monkeypatch.setattr(library, "loads_beat_fetches", lambda: program is LOADED)
    textures = three(1.0)
    passes.fullscreen(program, target, textures=textures)
    before = bound()
    with images.lasting_context():
        found = bound()
        passes.fullscreen(program, target, textures=textures)
        again = bound()
    after = bound()
    own = {*before} - {*found, 0}
    assert len(own) == 3 and own <= {*again}
    assert len({*found}) == 1 and after == found


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


def writes(value):
    main = f"void main() {{ imageStore(result, ivec2(gl_GlobalInvocationID.xy), vec4({value})); }}"
    return library.Program(
        name=f"writes {value}", compute="generated/main", images=(("result", "RGBA32F", "FLOAT_2D", "WRITE"),),
        snippets=(("generated/main", main),),
    )  # fmt: skip


def test_a_context_dispatches_on_where_another_one_has_freed_what_it_linked(gpu_context, elsewhere):
    """Mesa 22.3 then unbinds what is bound at the next flush, takes it for bound, and ended the process: whole runs of
    tests ended so."""
    if gpu.platform.backend_type_get() != "OPENGL":
        pytest.skip("flushes are OpenGL's")
    flush = library_of_opengl().glFlush
    image = images.upload(np.zeros((8, 8, 4), np.float32))
    freed, kept, other = writes(1.0), writes(2.0), writes(3.0)
    found = []

    def written(program):
        passes.compute(program, (8, 8), images={"result": image})
        found.append(images.read(image).mean())

    def flushed():
        for _ in range(3):
            written(kept)
            flush()

    elsewhere(lambda: [written(freed), written(kept)])
    with images.lasting_context():
        written(freed)
        del library._shaders[freed]
        gc.collect()
        library._free_dropped()
        written(other)
    elsewhere(flushed)
    assert found == [1.0, 2.0, 1.0, 3.0, 2.0, 2.0, 2.0]


@pytest.mark.parametrize("freed", [False, True])
def test_once_a_program_was_freed_none_is_dispatched_twice_in_a_row(gpu_context, monkeypatch, freed):
    """Mesa 22.3 may have unbound it at a flush in between, and takes it for bound: whole runs of tests ended there."""
    if not passes.overtakes_draws():
        pytest.skip("OpenGL in software is meant")
    dispatched, dispatch = [], gpu.compute.dispatch
    monkeypatch.setattr(gpu.compute, "dispatch", lambda *given: (dispatched.append(given[0]), dispatch(*given)))
    monkeypatch.setattr(library, "has_freed", freed)
    image = images.upload(np.zeros((8, 8, 4), np.float32))
    program = writes(3.0)
    for _ in range(3):
        passes.compute(program, (8, 8), images={"result": image})
    assert len(dispatched) == (6 if freed else 3)
    assert not freed or all(one != other for one, other in pairwise(dispatched))
    assert (images.read(image) == 3.0).all()
