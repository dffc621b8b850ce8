"""The three kinds of work on the GPU: a full-screen pass, a draw of meshes, a compute dispatch."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import replace
from functools import lru_cache

import gpu
import numpy as np

from . import library
from .context import is_only_one, on_enter, on_leave, on_picture, on_release, overtakes_draws
from .device import computes_beat_fragments
from .geometry import Batch, vertex_buffer
from .images import Image, Target, borrowed, finish, lasts, upload
from .library import FULLSCREEN_VERTEX, MOST_IMAGES, MOST_TEXTURES, Program, Shader, get

FULLSCREEN_INPUTS = (("VEC2", "corner"),)
FULLSCREEN_VARYINGS = (("smooth", "VEC2", "screen"),)

QUAD_INPUTS = FULLSCREEN_INPUTS

# Programs and the names of images beside those that they read, for which they have no room: since it was emptied last.
left_out: set[tuple[str, str]] = set()

OF_PIXELS = "pixels/"  # sources of fragment programs that call a body for their pixel begin so

_triangle: list[gpu.types.GPUBatch] = []
_quad: list[gpu.types.GPUBatch] = []


def fullscreen_program(name: str, fragment: str, **declared) -> Program:
    """A program that runs once per pixel; `screen` is the position in 0..1."""
    return Program(
        name=name, vertex=FULLSCREEN_VERTEX, fragment=fragment, inputs=FULLSCREEN_INPUTS, varyings=FULLSCREEN_VARYINGS,
        **declared,
    )  # fmt: skip


def program_of_pixels(name: str, body: str, **declared) -> Program:
    """A program for `each_pixel`: the source `body` defines `void run(ivec2 pixel)`, which sets all outputs."""
    main = f'#include "{body}"\n\nvoid main()\n{{\n  run(ivec2(gl_FragCoord.xy));\n}}\n'
    return fullscreen_program(name, OF_PIXELS + body, snippets=((OF_PIXELS + body, main),), **declared)


@lru_cache(maxsize=256)
def computed(program: Program, formats: tuple[str, ...], adds: bool = False) -> Program:
    """The same program of pixels as a compute program, which puts its outputs into images of these formats, or adds
    them there."""
    body, names = program.fragment.removeprefix(OF_PIXELS), [name for _, name in program.outputs]
    source = f"computed/{body}, {'added' if adds else 'put'}"
    outputs = "".join(f"vec4 {name};\n" for name in names)
    before = [f"imageLoad(to_{name}, pixel) + " if adds else "" for name in names]
    stored = "".join(f"  imageStore(to_{name}, pixel, {old}{name});\n" for name, old in zip(names, before))
    main = (
        f'{outputs}#include "{body}"\n\nvoid main()\n{{\n'
        "  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + ivec2(0, rows.x);\n"
        f"  if (pixel.x >= imageSize(to_{names[0]}).x || pixel.y >= rows.y) {{\n    return;\n  }}\n"
        f"  run(pixel);\n{stored}}}\n"
    )
    access = "READ_WRITE" if adds else "WRITE"
    return Program(
        name=f"{program.name}, computed{' and added' if adds else ''}", compute=source, snippets=((source, main),),
        images=tuple((f"to_{name}", kind, "FLOAT_2D", access) for name, kind in zip(names, formats)),
        textures=program.textures, constants=(*program.constants, ("IVEC2", "rows")), blocks=program.blocks,
        defines=program.defines,
    )  # fmt: skip


def each_pixel(program: Program, target: Target, *, adds: bool = False, rows=None, **bindings) -> None:
    """Put what a program of pixels (`program_of_pixels`) gives into a target's images, or add it there: by fragments or
    by a compute program of the same body, whichever this device runs faster. Of some `rows` (from, to) or of all."""
    if not computes_beat_fragments():
        fullscreen(program, target, blend="ADDITIVE_PREMULT" if adds else "NONE", rows=rows, **bindings)
        return
    images = {f"to_{name}": image for (_, name), image in zip(program.outputs, target.colors)}
    first, end = rows or (0, target.size[1])
    constants = {**bindings.pop("constants", {}), "rows": (first, end)}
    made = computed(program, tuple(image.format for image in target.colors), adds)
    compute(made, (target.size[0], end - first), images=images, constants=constants, **bindings)


COPY = fullscreen_program(
    "copy", "lib/copy.frag.glsl", textures=(("FLOAT_2D", "original"),), outputs=(("VEC4", "out_copy"),)
)


def copy(image: Image, target: Target) -> None:
    """Put an image into a target of the same size."""
    fullscreen(COPY, target, textures={"original": image})


def fullscreen(
    program: Program, target: Target, *, blend="NONE", where="NONE", rows=None, viewport=None, **bindings
) -> None:
    """Run a full-screen program over the target, or over some `rows` (from, to) of it. `bindings` as in Shader.bind.

    With a `viewport` (x, y, width, height) that rectangle is the screen. `where` is a depth test against the target's
    depth image, in which the program stands at 0.5: a driver leaves out whole blocks of pixels that fail it, which
    branches in the program cannot save where they are masked. A program that writes depth marks such pixels.
    """
    shader = _for_images(program, bindings)
    if program.writes_depth:
        where = "ALWAYS"
    with _state(target, viewport, blend=blend, depth_test=where, depth_write=program.writes_depth, rows=rows):
        shader.bind(**bindings)
        (_triangle[0] if _triangle else _fullscreen_batch()).draw(shader.handle)
    gpu.shader.unbind()


# All units of textures and of images: no program reads more.
_TEXTURES = tuple(f"texture_{k}" for k in range(MOST_TEXTURES))
_IMAGES = tuple(f"image_{k}" for k in range(MOST_IMAGES))
_SUM = " + ".join(
    (*(f"{name}_fetch(ivec2(0))" for name in _TEXTURES), *(f"imageLoad({name}, ivec2(0))" for name in _IMAGES))
)
# Two, of which one has not been drawn last, whatever happened in between.
LAST_DRAWN = tuple(
    fullscreen_program(
        f"last drawn {k}", "generated/main", textures=tuple(("FLOAT_2D", name) for name in textures),
        images=tuple((name, "RGBA32F", "FLOAT_2D", "READ") for name in images), outputs=(("VEC4", "out_color"),),
        snippets=(("generated/main", f"void main() {{ out_color = {value}; }}"),),
    )
    for k, (textures, images, value) in enumerate(((_TEXTURES, _IMAGES, _SUM), ((), (), "vec4(1.0)")))
)  # fmt: skip
_last: list[Shader] = []
_blank: list[Image] = []


@on_enter
@on_leave
def _let_go() -> None:
    """Draw programs and images that stay until all are released. OpenGL's contexts hold the program that they drew last
    until they draw another: freed meanwhile elsewhere it would end here, in a context that may not free it (see
    library.py). They hold what is bound to units of textures and images, too. A new texture has the name of one that
    was freed, and neither Blender nor Mesa binds one where that name is bound already: the old one, which another
    context freed, would be read in its place."""
    if gpu.platform.backend_type_get() != "OPENGL":
        return
    if not _last:
        _last.extend(Shader(program) for program in LAST_DRAWN)
        _blank.append(upload(np.zeros((1, 1, 4), np.float32)))
    units = {"textures": dict.fromkeys(_TEXTURES, _blank[0]), "images": dict.fromkeys(_IMAGES, _blank[0])}
    with borrowed(1, 1, "RGBA32F") as target, _state(target):
        for shader, bound in zip(_last, (units, {})):
            shader.kept.lasts = shader.kept.lasts or lasts()
            shader.bind(**bound)
            _fullscreen_batch().draw(shader.handle)
    gpu.shader.unbind()


@on_picture
def _let_go_beside_renders() -> None:
    """The same where contexts of final renders come and go beside one that nobody enters."""
    if _last and is_only_one():
        _let_go()


@contextmanager
def drawing(target: Target, *, viewport=None, blend="NONE", depth_test="LESS_EQUAL", depth_write=True, cull="NONE"):
    """State for mesh draws into `target`; inside, use `draw`. `viewport` = (x, y, width, height) in pixels."""
    with _state(target, viewport, blend, depth_test, depth_write, cull):
        yield
    gpu.shader.unbind()


def draw(shader: Shader, batch: Batch, instances: int = 1) -> None:
    """Draw a batch with the bound shader. Only inside `drawing`."""
    batch.handle.draw_instanced(shader.handle, instance_start=0, instance_count=instances)


def set_culling(cull: str) -> None:
    """Which faces the next draws leave out: BACK or NONE. Only inside `drawing` of all faces; NONE at its end."""
    gpu.state.face_culling_set(cull)


def write_alpha_alone() -> None:
    """Let the next draws change nothing but alpha and depth. Only inside `drawing`, to whose end it lasts."""
    gpu.state.color_mask_set(False, False, False, True)


def draw_screen(shader: Shader) -> None:
    """Draw a triangle over the whole viewport with the bound shader, whose inputs are FULLSCREEN_INPUTS. Only inside
    `drawing`."""
    _fullscreen_batch().draw(shader.handle)


def draw_range(shader: Shader, batch: Batch, first: int, count: int) -> None:
    """Draw `count` triangles of a batch from the `first` on. Only inside `drawing`."""
    batch.handle.draw_range(shader.handle, elem_start=3 * first, elem_count=3 * count)


def draw_points(shader: Shader, batch: gpu.types.GPUBatch, instances: int = 1) -> None:
    """Draw points as squares of gl_PointSize pixels, at least up to 255 on any desktop. Only inside `drawing`."""
    gpu.state.program_point_size_set(True)
    batch.draw_instanced(shader.handle, instance_start=0, instance_count=instances)
    gpu.state.program_point_size_set(False)


def draw_quads(shader: Shader, instances: int) -> None:
    """Draw instances of a square of two triangles whose attribute `corner` runs from -1 to 1. Only inside `drawing`."""
    if not _quad:
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, -1], [1, 1], [-1, 1]], np.float32)
        _quad.append(gpu.types.GPUBatch(type="TRIS", buf=vertex_buffer(corner=corners)))
    _quad[0].draw_instanced(shader.handle, instance_start=0, instance_count=instances)


def get_for(program: Program, textures: dict[str, Image]) -> Shader:
    """The shader of a program for mesh or quad draws that read these images, with what they define."""
    return _for_images(program, {"textures": textures})


# Between any two others where a flush may have ended what is bound (`compute`).
NOTHING = Program(name="nothing", compute="generated/main", snippets=(("generated/main", "void main() {}"),))


def compute(program: Program, size: tuple[int, int], **bindings) -> None:
    """Dispatch enough groups for `size` threads. Blender issues texture and image barriers after it."""
    shader = _for_images(program, bindings)
    if overtakes_draws():
        finish()
        # Mesa 22.3 frees, at a flush, the programs of a context that another one has dropped. It unbinds what is bound
        # to the driver and still takes it for bound: the same one again ends with a segmentation fault.
        if library.has_freed:
            between = get(NOTHING)
            between.bind()
            gpu.compute.dispatch(between.handle, 1, 1, 1)
    shader.bind(**bindings)
    groups = [-(-extent // group) for extent, group in zip((*size, 1), program.group)]
    gpu.compute.dispatch(shader.handle, *groups)
    gpu.shader.unbind()


def _for_images(program: Program, bindings: dict) -> Shader:
    """The shader of a program, with what the images that it reads define and bring along, if it has room for that, and
    with what its blocks answer."""
    read, blocks = bindings.get("textures") or {}, bindings.get("blocks") or {}
    for image in read.values():
        if image.beside or image.defines:
            break
    else:
        for block in blocks.values():
            if block.beside or block.answers:
                break
        else:
            return get(program)
    bound = (*read.values(), *blocks.values())
    known = {*read, *program.has_no_use}
    beside = {name: image for one in bound for name, image in one.beside.items() if name not in known}
    room = MOST_TEXTURES - len(program.textures)
    if len(beside) > room:  # the first ones are those that can be spared least
        kept = dict(list(beside.items())[: max(room, 0)])
        left_out.update((program.name, name) for name in beside if name not in kept)
        beside = kept
    if beside:
        bindings["textures"] = {**read, **beside}
    defines = tuple(one for image in read.values() for one in image.defines)
    answers = tuple(one for block in blocks.values() for one in block.answers)
    return get(_with_images(program, defines, tuple((image.format, name) for name, image in beside.items()), answers))


@lru_cache(maxsize=1024)
def _with_images(
    program: Program, defines: tuple[tuple[str, str], ...], beside: tuple[tuple[str, str], ...],
    answers: tuple[tuple[str, str], ...],
) -> Program:  # fmt: skip
    if not (defines or beside or answers):
        return program
    there = tuple((f"HAS_{name.upper()}", "1") for _, name in beside)
    textures = (*program.textures, *beside)
    snippets = (*program.snippets, *(one for one in answers if one not in program.snippets))
    return replace(program, defines=(*program.defines, *defines, *there), textures=textures, snippets=snippets)


class _state:
    """What is set around draws into a target, and afterwards set back. A class, since it is entered for each pass."""

    __slots__ = ("_blend", "_bound", "_cull", "_depth_test", "_depth_write", "_rows", "_target", "_viewport")

    def __init__(
        self, target: Target, viewport=None, blend="NONE", depth_test="NONE", depth_write=False, cull="NONE", rows=None
    ):
        self._target, self._viewport, self._blend, self._depth_test = target, viewport, blend, depth_test
        self._depth_write, self._cull, self._rows = depth_write, cull, rows

    def __enter__(self) -> None:
        state, target = gpu.state, self._target
        self._bound = target.framebuffer.bind()
        self._bound.__enter__()
        # Of the bound framebuffer. GPUFrameBuffer.viewport_set says the same but takes no arguments before Blender 5.2.
        if self._viewport:
            state.viewport_set(*self._viewport)
        else:
            image = target.colors[0] if target.colors else target.depth
            state.viewport_set(0, 0, image.width, image.height)
        state.blend_set(self._blend)
        state.depth_test_set(self._depth_test)
        state.depth_mask_set(self._depth_write)
        state.face_culling_set(self._cull)
        state.color_mask_set(True, True, True, True)
        if self._rows:
            state.scissor_test_set(True)
            state.scissor_set(0, self._rows[0], target.size[0], self._rows[1] - self._rows[0])

    def __exit__(self, *raised):
        state = gpu.state
        if self._rows:
            state.scissor_test_set(False)
        if self._blend != "NONE":
            state.blend_set("NONE")
        if self._depth_test != "NONE" or self._depth_write:
            state.depth_test_set("NONE")
            state.depth_mask_set(False)
        if self._cull != "NONE":
            state.face_culling_set("NONE")
        self._bound.__exit__(*raised)


def _fullscreen_batch() -> gpu.types.GPUBatch:
    if not _triangle:
        layout = gpu.types.GPUVertFormat()
        layout.attr_add(id="corner", comp_type="F32", len=2, fetch_mode="FLOAT")
        vertices = gpu.types.GPUVertBuf(format=layout, len=3)
        vertices.attr_fill(id="corner", data=np.array([[-1, -1], [3, -1], [-1, 3]], np.float32))
        _triangle.append(gpu.types.GPUBatch(type="TRIS", buf=vertices))
    return _triangle[0]


@on_release
def _release() -> None:
    _triangle.clear()
    _quad.clear()
    _last.clear()
    _blank.clear()
