"""The shader library: includes, declarations, errors that name file and line, and the cache."""

import ctypes
import os
import re
import threading
from dataclasses import replace

import gpu
import pytest

from addon.gfx import context, library
from addon.gfx.library import SHADER_ROOT, Program, ShaderError, push_bytes, resolve
from addon.gfx.struct import Struct
from tests.gfx.declared import programs

TRIVIAL = "void main() { imageStore(seen, ivec2(0), vec4(1.0)); }"


def compute_program(source=TRIVIAL, name="test", snippets=(), **declared):
    return Program(
        name=name,
        compute="generated/main",
        snippets=(("generated/main", source), *snippets),
        images=(("seen", "RGBA32F", "FLOAT_2D", "WRITE"),),
        **declared,
    )


# Includes ------------------------------------------------------------------------------------------------------------


def test_an_include_reached_twice_stands_in_the_text_once_and_before_its_users():
    snippets = {
        "main": '#include "left"\n#include "right"\nlast',
        "left": '#include "shared"\nleft text',
        "right": '#include "shared"\nright text',
        "shared": "shared text",
    }
    text, origin = resolve("main", snippets)
    assert text.split("\n")[:-1] == ["shared text", "left text", "right text", "last"]
    assert origin == [("shared", 1), ("left", 2), ("right", 2), ("main", 3)]


def test_files_that_include_each_other_are_an_error_that_shows_the_circle():
    snippets = {"a": '#include "b"', "b": '#include "c"', "c": '#include "a"'}
    with pytest.raises(ShaderError, match=r"include each other: a -> b -> c -> a"):
        resolve("a", snippets)


def test_an_unknown_include_is_an_error_that_names_the_file():
    with pytest.raises(ShaderError, match=r"'lib/no_such_file\.glsl' cannot be read"):
        resolve("a", {"a": '#include "lib/no_such_file.glsl"'})


# Declarations --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"textures": (("CUBE", "sky"),)}, "texture 'sky' has the unknown type CUBE"),
        ({"constants": (("VEC7", "size"),)}, "constant 'size' has the unknown type VEC7"),
        ({"constants": tuple(("MAT4", f"m{k}") for k in range(3))}, "192 bytes of constants"),
        (
            {"constants": (*(("FLOAT", f"x{k}") for k in range(10)), ("MAT4", "m"), ("VEC4", "v"))},
            "144 bytes of constants",
        ),
        ({"textures": tuple(("FLOAT_2D", f"t{k}") for k in range(17))}, "17 textures; Metal allows 16"),
        ({"fragment": "x"}, "give either compute, or vertex and fragment"),
    ],
)
def test_a_declaration_that_cannot_work_is_refused_before_it_is_compiled(changes, sentence):
    with pytest.raises(ShaderError, match=sentence):
        replace(compute_program(), **changes)


@pytest.mark.skipif(os.name == "nt", reason="the C library that Blender prints by is not the process's own")
@pytest.mark.parametrize(
    "kinds", [("FLOAT", "VEC3"), ("INT", "IVEC2", "VEC3", "VEC3", "FLOAT"), ("VEC2", "INT", "MAT4")]
)
def test_constants_take_as_many_bytes_as_blender_says_where_they_are_too_many(kinds, capfd):
    info = gpu.types.GPUShaderCreateInfo()
    kinds = kinds * 8
    for k, kind in enumerate(kinds):
        info.push_constant(kind, f"constant_{k}")
    ctypes.CDLL(None).fflush(None)  # what C printed
    told = [int(size) for size in re.findall(r"already reach (\d+) bytes", capfd.readouterr().out)]
    sizes = [push_bytes(kinds[: k + 1]) for k in range(len(kinds))]
    assert told == [size for size in sizes if size > 128]


@pytest.fixture
def bound(gpu_context):
    """A program with one of each resource, and a right set of bindings."""
    from addon.gfx import images
    from addon.gfx.struct import Block

    struct = Struct("Options", ("vec4", "factor"))
    source = "void main() { imageStore(seen, ivec2(0), picture_fetch(ivec2(0)) * options.factor * scale); }"
    program = compute_program(
        source, textures=(("FLOAT_2D", "picture"),), constants=(("FLOAT", "scale"),), blocks=((struct, "options"),)
    )
    given = {
        "textures": {"picture": images.create(1, 1, "RGBA32F")},
        "images": {"seen": images.create(1, 1, "RGBA32F")},
        "blocks": {"options": Block(struct, factor=(1, 1, 1, 1))},
        "constants": {"scale": 1.0},
    }
    return library.get(program), given


@pytest.mark.parametrize("kind", ["textures", "images", "blocks", "constants"])
def test_forgetting_a_binding_is_an_error_that_names_it(bound, kind):
    shader, given = bound
    name = next(iter(given[kind]))
    with pytest.raises(ShaderError, match=rf"Program test: {kind[:-1]} {name} is missing or not declared"):
        shader.bind(**{**given, kind: {}})


@pytest.mark.parametrize("kind", ["textures", "images", "blocks", "constants"])
def test_a_binding_that_is_not_declared_is_an_error_that_names_it(bound, kind):
    shader, given = bound
    with pytest.raises(ShaderError, match=rf"{kind[:-1]} misspelt is missing or not declared"):
        shader.bind(**{**given, kind: {**given[kind], "misspelt": next(iter(given[kind].values()))}})


# Compiling -----------------------------------------------------------------------------------------------------------

WRONG = ("generated/wrong", "// One line above\nfloat f()\n{\n  return no_such_variable + 1.0;\n}\n")


def test_a_compile_error_names_file_and_line_of_the_include(gpu_context):
    source = '#include "generated/wrong"\nvoid main() { imageStore(seen, ivec2(0), vec4(f())); }'
    with pytest.raises(ShaderError, match=r"Program broken does not compile.(?s:.)*generated/wrong:4: ") as caught:
        library.get(compute_program(source, name="broken", snippets=(WRONG,)))
    assert "no_such_variable" in str(caught.value)


def test_an_error_in_a_fragment_shader_is_not_blamed_on_the_vertex_shader(gpu_context):
    from addon.gfx import passes

    source = '\n\n#include "generated/wrong"\nvoid main() { out_color = vec4(f()); }'
    program = passes.fullscreen_program(
        "broken", "generated/main", outputs=(("VEC4", "out_color"),), snippets=(("generated/main", source), WRONG)
    )
    with pytest.raises(ShaderError, match=r"generated/wrong:4: "):
        library.get(program)


def test_an_equal_declaration_is_compiled_once(gpu_context):
    before = library.compile_count
    first = library.get(compute_program(name="cached"))
    assert library.get(compute_program(name="cached")) is first
    assert library.compile_count == before + 1
    assert library.get(compute_program(name="cached", defines=(("OTHER", "1"),))) is not first
    assert library.compile_count == before + 2


def test_a_program_that_goes_in_another_thread_is_freed_in_one_that_draws(gpu_context):
    """As when Python collects garbage there: Blender 4.5 ended with a segmentation fault."""
    context.begin_picture()
    held = [library.Shader(compute_program(name="dropped"))]
    kept = held[0].kept
    thread = threading.Thread(target=held.clear)
    thread.start()
    thread.join()
    assert any(one is kept for one in library._dropped)
    context.begin_picture()
    assert not any(one is kept for one in library._dropped)


def test_a_program_is_not_freed_while_a_batch_holds_it(gpu_context):
    """Blender's batches hold the program that they drew last: the next draw would free it, in whichever context."""
    from addon.gfx import images, passes

    def drawn(name):
        program = passes.fullscreen_program(
            name, "generated/main", outputs=(("VEC4", "out_color"),),
            snippets=(("generated/main", "void main() { out_color = vec4(1.0); }"),),
        )  # fmt: skip
        passes.fullscreen(program, images.Target((images.create(4, 4, "RGBA32F"),)))
        return program

    kept = library._shaders.pop(drawn("held")).kept
    is_held = not kept.is_alone  # not by batches of 4.5
    library._free_dropped()
    assert any(one is kept for one in library._dropped) == is_held
    drawn("another")
    library._free_dropped()
    assert not any(one is kept for one in library._dropped)


def test_a_program_that_goes_in_a_final_renders_context_is_freed_where_it_was_drawn(gpu_context):
    """Or compiled: Mesa ends with a segmentation fault otherwise, some draws later."""
    import bpy

    from addon.gfx import images, passes

    def drawn(name):
        program = passes.fullscreen_program(
            name, "generated/main", outputs=(("VEC4", "out_color"),),
            snippets=(("generated/main", f"void main() {{ out_color = vec4({len(name)}.0); }}"),),
        )  # fmt: skip
        passes.fullscreen(program, target)
        return program

    class Other(bpy.types.RenderEngine):
        bl_idname, bl_label, bl_use_gpu_context = "CANDELA_OTHER", "Other", True

        def render(self, depsgraph):
            with images.passing_context():
                waiting.extend(library._shaders.pop(program).kept for program in (goes, only_compiled))
                library._free_dropped()
                waits.append(waiting_of() == len(waiting))

    def waiting_of():
        return sum(any(one is kept for one in library._dropped) for kept in waiting)

    library._free_dropped()
    waits, waiting, target = [], [], images.Target((images.create(4, 4, "RGBA32F"),))
    bpy.ops.wm.read_factory_settings()
    bpy.utils.register_class(Other)
    try:
        render = bpy.context.scene.render
        render.engine, render.resolution_x, render.resolution_y = Other.bl_idname, 16, 16
        for _ in range(3):
            only_compiled = compute_program(name="only compiled")
            library.get(only_compiled)
            goes, stays = drawn("other"), drawn("same")
            images.read(target.colors[0])
            bpy.ops.render.render()
            images.read(target.colors[0])
            drawn(stays.name)
            assert images.read(target.colors[0])[0, 0, 0] == len(stays.name)
    finally:
        bpy.utils.unregister_class(Other)
    library._free_dropped()
    assert waits == [True] * 3 and waiting_of() == 0


def test_contexts_of_renders_do_not_hold_the_program_that_they_drew_last(gpu_context):
    """It would end where they draw the next one; Mesa ends with a segmentation fault then."""
    import bpy

    from addon.gfx import images, passes

    programs = [
        passes.fullscreen_program(
            name, "generated/main", outputs=(("VEC4", "out_color"),),
            snippets=(("generated/main", "void main() { out_color = vec4(1.0); }"),),
        )
        for name in ("of both", "of this one", "of the render")
    ]  # fmt: skip
    of_both, here, there = programs
    turns = iter((of_both, there, there))

    class Other(bpy.types.RenderEngine):
        bl_idname, bl_label, bl_use_gpu_context = "CANDELA_OTHER", "Other", True

        def render(self, depsgraph):
            with images.passing_context():
                passes.fullscreen(next(turns), target)

    target = images.Target((images.create(4, 4, "RGBA32F"),))
    bpy.ops.wm.read_factory_settings()
    bpy.utils.register_class(Other)
    try:
        render = bpy.context.scene.render
        render.engine, render.resolution_x, render.resolution_y = Other.bl_idname, 16, 16
        passes.fullscreen(of_both, target)
        bpy.ops.render.render()  # its context draws it last
        passes.fullscreen(here, target)
        del library._shaders[of_both]
        library._free_dropped()
        for _ in range(2):  # in these it would end, and what this context has bound be taken away
            bpy.ops.render.render()
            passes.fullscreen(here, target)
            assert images.read(target.colors[0])[0, 0, 0] == 1.0
    finally:
        bpy.utils.unregister_class(Other)


def test_a_program_that_failed_is_tried_again(gpu_context):
    for _ in range(2):
        with pytest.raises(ShaderError):
            library.get(compute_program("void main() { nonsense(); }", name="fails"))


@pytest.fixture(params=[False, True], ids=["fetched", "loaded"])
def loads(request, monkeypatch):
    """Programs as they are where texels are fetched from textures, and where they are loaded from images."""
    monkeypatch.setattr(library, "loads_beat_fetches", lambda: request.param)
    monkeypatch.setattr(library, "_shaders", {})
    return request.param


def test_a_texture_is_read_alike_from_a_texture_and_from_an_image(gpu_context, loads):
    import numpy as np

    from addon.gfx import images, passes

    pixels = np.random.default_rng(3).uniform(-1e9, 1e9, (3, 5, 4)).astype(np.float32)
    names = [f"part{k}" for k in range(10)]
    total = " + ".join(f"{name}_fetch(texel)" for name in names)
    source = f"void main() {{ ivec2 texel = part9_size() - 1 - ivec2(gl_FragCoord.xy); out_color = {total}; }}"
    program = passes.fullscreen_program(
        "many", "generated/main", outputs=(("VEC4", "out_color"),), snippets=(("generated/main", source),),
        textures=tuple(("RGBA32F", name) for name in names),
    )  # fmt: skip
    assert program.loaded == (tuple(names[:8]) if loads else ())
    parts = {name: images.upload(pixels if k == 4 else 0 * pixels) for k, name in enumerate(names)}
    with images.borrowed(5, 3, "RGBA32F") as target:
        passes.fullscreen(program, target, textures=parts)
        assert np.array_equal(images.read(target.colors[0]), pixels[::-1, ::-1])


# The project's shaders -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("program", programs(), ids=lambda p: p.name)
def test_every_declared_program_compiles(program, gpu_context, loads):
    library.get(program)


def test_every_shader_file_is_part_of_a_program():
    used = set()
    for program in programs():
        for source in filter(None, (program.vertex, program.fragment, program.compute)):
            _, origin = resolve(source, dict(program.snippets))
            used |= {file for file, _ in origin}
    files = {path.relative_to(SHADER_ROOT).as_posix() for path in SHADER_ROOT.rglob("*.glsl")}
    assert not sorted(files - used), "these shader files are in no program: no test compiles them"
