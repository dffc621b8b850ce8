"""The shader library: GLSL files with include-once, programs from one declaration, errors with file and line.

A `Program` declares everything a shader sees; Blender's create-info, the binding checks and the cache key come from
it. Sources stand under shaders/ and hold plain functions and `main`; they declare no resources.
"""

from __future__ import annotations

import os
import re
import sys
import tempfile
import time
import weakref
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import gpu

from . import context, images
from .context import on_picture, on_release
from .device import loads_beat_fetches
from .stripping import without_unused
from .struct import Struct

FULLSCREEN_VERTEX = "lib/fullscreen.vert.glsl"
SHADER_ROOT = Path(__file__).resolve().parents[2] / "shaders"
_INCLUDE = re.compile(r'^\s*#include\s+"([^"]+)"\s*$')
# What Blender prints of the driver's complaints: 5.2 "python_shader.glsl:4:10: Error: …", 5.0 "| :4:10: Error: …", both
# with lines of our source; 4.5 quotes the line, "251 |   return x;", with its number in the text it generated.
_ERROR_LINE = re.compile(r"(?:python_shader\.glsl|\|\s*):(\d+)(?::\d+)?:\s*(.*)")
_QUOTED_LINE = re.compile(r"^\s*\d+ \| (.*\S)")

# Types of a texture: the format of its texels, or, where that is not known beforehand, only what they are read as.
_FORMATS = dict.fromkeys(("RGBA32F", "RG32F", "R32F", "RGBA16F"), "FLOAT_2D")
_FORMATS |= dict.fromkeys(("RGBA32UI", "R32UI"), "UINT_2D")
_SAMPLERS = {"FLOAT_2D", "UINT_2D", "INT_2D", "DEPTH_2D", *_FORMATS}
MOST_TEXTURES = 16  # of a program
MOST_IMAGES = 8  # that Blender binds at once
_PUSH_BYTES = {"FLOAT": 4, "VEC2": 8, "VEC3": 12, "VEC4": 16, "INT": 4, "IVEC2": 8, "IVEC4": 16, "MAT4": 64, "BOOL": 4}
_MOST_PUSH_BYTES = 128  # that every Vulkan driver has; of more, Blender complains


class ShaderError(RuntimeError):
    """A shader that does not compile, or a binding that the program does not declare."""


def push_bytes(kinds: Iterable[str]) -> int:
    """Bytes that constants of these types, in this order, take as push constants.

    Counted as Blender does before it prints that they are too many (`constants_calc_size` in
    source/blender/python/gpu/gpu_py_shader_create_info.cc): never fewer than std430 needs, and up to some 30 % more.
    """
    total = last = 0
    for kind in kinds:
        size, padding = _PUSH_BYTES[kind], 0
        if last not in (0, size):
            pack = 8 if size == 8 else 16
            padding = pack - last % pack if last < size else total % pack
        elif size == 12:
            padding = 4
        total += padding + size
        last = size
    return total + total % 16


@dataclass(frozen=True)
class Program:
    """What a shader is made of. Sources are file names below shaders/.

    `snippets` are generated texts, included by their name like files. `images` are (name, format, sampler type,
    access) with access in READ, WRITE, READ_WRITE. `varyings` are (interpolation, GLSL type, name).

    Sources read a texture `picture` by `picture_fetch(texel)` and `picture_size()`. Where loads from images are faster
    than fetches, as many as may be of those with a format are bound as images, the first ones first. Not for meshes,
    whose programs alternate: llvmpipe ends all draws before it binds an image that they load from, too (27 materials:
    8.2 ms a picture, and 2.4 by fetches).
    """

    name: str
    vertex: str = ""
    fragment: str = ""
    compute: str = ""
    inputs: tuple[tuple[str, str], ...] = ()
    varyings: tuple[tuple[str, str, str], ...] = ()
    outputs: tuple[tuple[str, str], ...] = ()
    textures: tuple[tuple[str, str], ...] = ()
    images: tuple[tuple[str, str, str, str], ...] = ()
    constants: tuple[tuple[str, str], ...] = ()
    blocks: tuple[tuple[Struct, str], ...] = ()
    defines: tuple[tuple[str, str], ...] = ()
    snippets: tuple[tuple[str, str], ...] = ()
    group: tuple[int, int, int] = (8, 8, 1)
    writes_depth: bool = False  # the fragment shader sets gl_FragDepth
    leaves_out: tuple[tuple[str, str], ...] = ()  # interfaces (gfx/interface.py) that it does not ask, and why
    has_no_use: tuple[str, ...] = ()  # for images of these names beside those that it reads (gfx/images.py)

    def __post_init__(self):
        for kind, name in self.textures:
            if kind not in _SAMPLERS:
                raise ShaderError(f"Program {self.name}: texture '{name}' has the unknown type {kind}.")
        for kind, name in self.constants:
            if kind not in _PUSH_BYTES:
                raise ShaderError(f"Program {self.name}: constant '{name}' has the unknown type {kind}.")
        size = push_bytes(kind for kind, _ in self.constants)
        if size > _MOST_PUSH_BYTES:
            raise ShaderError(
                f"Program {self.name}: {size} bytes of constants; above {_MOST_PUSH_BYTES} put them into a block."
            )
        if len(self.textures) > MOST_TEXTURES:
            raise ShaderError(f"Program {self.name}: {len(self.textures)} textures; Metal allows {MOST_TEXTURES}.")
        if bool(self.compute) == bool(self.fragment):
            raise ShaderError(f"Program {self.name}: give either compute, or vertex and fragment.")
        values = (getattr(self, name) for name in self.__dataclass_fields__)
        object.__setattr__(self, "_hash", hash(tuple(values)))  # asked for at each draw, over all its texts

    def __hash__(self) -> int:
        return self._hash

    @property
    def loaded(self) -> tuple[str, ...]:
        """Textures that are bound as images, because this driver loads faster than it fetches."""
        if not loads_beat_fetches() or self.vertex not in ("", FULLSCREEN_VERTEX):
            return ()
        return tuple(name for kind, name in self.textures if kind in _FORMATS)[: MOST_IMAGES - len(self.images)]


GENERATED: dict[str, str] = {}  # texts that sources include like files, by name: see records.py


@cache
def _read(name: str) -> str:
    if name in GENERATED:
        return GENERATED[name]
    path = SHADER_ROOT / name
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise ShaderError(f"Shader file '{name}' cannot be read: {error.strerror}.") from error


def resolve(name: str, snippets: dict[str, str]) -> tuple[str, list[tuple[str, int]]]:
    """Text of a source with each include once, and for every line of it the (file, line) that it came from."""
    lines: list[str] = []
    origin: list[tuple[str, int]] = []
    seen: set[str] = set()

    def add(current: str, chain: tuple[str, ...]) -> None:
        if current in chain:
            raise ShaderError(f"Shader files include each other: {' -> '.join((*chain, current))}.")
        if current in seen:
            return
        text = snippets[current] if current in snippets else _read(current)
        for number, line in enumerate(text.splitlines(), 1):
            found = _INCLUDE.match(line)
            if found:
                add(found.group(1), (*chain, current))
            else:
                lines.append(line)
                origin.append((current, number))
        seen.add(current)

    add(name, ())
    return "\n".join(lines) + "\n", origin


@dataclass
class _Kept:
    """What the driver holds of a program, which outlives its Shader until it may be freed."""

    handle: object
    lasts: bool  # compiled or drawn in a context that lasts

    @property
    def is_alone(self) -> bool:
        """Whether nothing else holds the handle. Blender's batches hold the program that they drew last, until they
        draw with another one, in whichever context that is."""
        return sys.getrefcount(self.handle) <= _ALONE


_nothing = _Kept(object(), True)
_ALONE = sys.getrefcount(_nothing.handle)  # what Python counts where there is no other holder


class Shader:
    """A compiled program. `bind` sets everything it declares; forgetting a name or adding one is an error."""

    def __init__(self, program: Program):
        self.program = program
        self.handle = _compile(program)
        self.kept = _Kept(self.handle, images.lasts())
        weakref.finalize(self, _dropped.append, self.kept).atexit = False
        self.used = 0  # the last picture that asked for it
        self._fresh = True  # never bound: some drivers do most of their work at the first draw
        handle, loaded = self.handle, program.loaded
        # By kind and name, how each is set; one that the driver dropped is not set again.
        self._textures = {
            name: handle.image if name in loaded else handle.uniform_sampler for _, name in program.textures
        }
        self._images = {name: handle.image for name, *_ in program.images}
        self._blocks = {name: handle.uniform_block for _, name in program.blocks}
        self._constants = {name: _constant_setter(handle, kind) for kind, name in program.constants}
        self._count = len(self._textures) + len(self._images) + len(self._blocks) + len(self._constants)

    def bind(self, textures=None, images=None, blocks=None, constants=None) -> None:
        """Bind the shader and all its resources. Values: gfx Images, gfx Blocks, numbers or arrays."""
        textures, images, blocks, constants = textures or {}, images or {}, blocks or {}, constants or {}
        if self._fresh:
            self._fresh = False
            _count_first_use()
        if len(textures) + len(images) + len(blocks) + len(constants) != self._count:
            self._refuse(textures, images, blocks, constants)
        self.handle.bind()
        try:
            setters = self._blocks
            for name, block in blocks.items():
                setters[name](name, block.buffer)
            setters = self._textures
            for name, image in textures.items():
                setters[name](name, image.texture)
            if images:
                setters = self._images
                for name, image in images.items():
                    setters[name](name, image.texture)
            setters = self._constants
            for name, value in constants.items():
                setters[name](name, value)
        except KeyError:
            self._refuse(textures, images, blocks, constants)
            raise
        except ValueError:  # some are not used, which `change` finds out
            self.change(textures, blocks, constants)
            _set_all(self._images, [(name, image.texture) for name, image in images.items()])

    def change(self, textures=None, blocks=None, constants=None) -> None:
        """Bind some of what `bind` has bound anew, between draws."""
        if blocks:
            _set_all(self._blocks, [(name, block.buffer) for name, block in blocks.items()])
        if textures:
            _set_all(self._textures, [(name, image.texture) for name, image in textures.items()])
        if constants:
            _set_all(self._constants, constants.items())

    def set_constant(self, name: str, value) -> None:
        """Set one push constant between draws."""
        _set_all(self._constants, ((name, value),))

    def _refuse(self, *given: dict) -> None:
        """ShaderError that says which names are missing or too many."""
        declared = (self._textures, self._images, self._blocks, self._constants)
        for what, names, found in zip(("texture", "image", "block", "constant"), declared, given):
            wrong = sorted(names.keys() ^ found.keys())
            if wrong:
                raise ShaderError(f"Program {self.program.name}: {what} {', '.join(wrong)} is missing or not declared.")


def _constant_setter(handle, kind: str):
    if kind in ("INT", "IVEC2", "IVEC4"):
        return handle.uniform_int
    if kind == "BOOL":
        return lambda name, value: handle.uniform_bool(name, bool(value))
    return handle.uniform_float


def _set_all(setters: dict, values) -> None:
    for name, value in values:
        try:
            setters[name](name, value)
        except ValueError:
            # Declared but unused: the driver dropped it, which is no fault of the caller.
            setters[name] = _leave


def _leave(_name: str, _value) -> None:
    pass


MOST_PROGRAMS = 128  # kept for later; a picture of usual scenes has 30 to 120
MOST_IN_LAVAPIPE = 64  # Mesa's Vulkan in software holds each in 10 to 30 MB of this process; llvmpipe in 6

_shaders: dict[Program, Shader] = {}
# Handles of shaders that are no more. Python may collect garbage in any thread, and Blender 4.5 ends with a
# segmentation fault where a thread without a GPU context frees a program: they wait here for one that draws.
# Those that a lasting context has compiled or drawn wait for such a one, the others for one that passes, and all until
# no batch holds them. Freed by another context they are put aside for their own (Mesa 22.3, where drivers do not share
# programs: already linking makes something that is the current context's), and at its next flush that one takes away
# what is bound without remembering: where the same program draws again, it ends with a segmentation fault.
_dropped: list[_Kept] = []
compile_count = 0  # how many programs this process compiled; tests assert on its growth
compile_seconds = 0.0  # what that took
first_uses = 0  # how many programs were drawn with for the first time
has_freed = False  # whether this process has freed any


def _count_first_use() -> None:
    global first_uses
    first_uses += 1


def news() -> int:
    """Grows with each program that is compiled or first drawn with: what either of it took says little of the next."""
    return compile_count + first_uses


def get(program: Program) -> Shader:
    """The compiled program, from the cache if an equal declaration was compiled before."""
    global compile_seconds
    shader = _shaders.get(program)
    if shader is None:
        started = time.perf_counter()
        shader = _shaders[program] = Shader(program)
        compile_seconds += time.perf_counter() - started
    shader.used = context.pictures
    if not shader.kept.lasts:
        shader.kept.lasts = images.lasts()
    return shader


def has(program: Program) -> bool:
    """Whether an equal declaration is compiled; this picture uses it then."""
    shader = _shaders.get(program)
    if shader is not None:
        shader.used = context.pictures
    return shader is not None


def has_drawn(program: Program) -> bool:
    """Whether an equal declaration is compiled and has been drawn with."""
    shader = _shaders.get(program)
    return shader is not None and not shader._fresh


def kept() -> int:
    """Compiled programs that this process holds."""
    return len(_shaders)


def most_programs() -> int:
    """How many programs are kept for later by this driver."""
    lavapipe = context.available() and context.is_lavapipe()
    return min(MOST_PROGRAMS, MOST_IN_LAVAPIPE) if lavapipe else MOST_PROGRAMS


@on_picture
def _free_old() -> None:
    """Of more than `most_programs` free those that were asked for the longest ago, but none that a recent picture used:
    a scene of very many materials keeps them all."""
    surplus = len(_shaders) - most_programs()
    if surplus > 0:
        old = [program for program, shader in _shaders.items() if shader.used < context.pictures - context.RECENT]
        for program in sorted(old, key=lambda one: _shaders[one].used)[:surplus]:
            del _shaders[program]
    _free_dropped()


def _free_dropped() -> None:
    """Free what waits for a context like this one and is held by nothing else."""
    global has_freed
    if not _dropped:
        return
    gpu.shader.unbind()  # the last one that drew may be among them
    lasts = images.lasts()
    for _ in range(len(_dropped)):  # others may come to the end meanwhile
        one = _dropped.pop(0)
        if one.lasts != lasts or not one.is_alone:
            _dropped.append(one)
        else:
            has_freed = True


def free_lasting(most: int) -> None:
    """Between pictures, in a context that lasts: where more than `most` programs of such contexts are held or wait to
    be freed, free them all. What final renders alone have compiled and drawn is left to them."""
    held = [program for program, shader in _shaders.items() if shader.kept.lasts]
    waiting = sum(one.lasts for one in _dropped)
    if len(held) + waiting > most and images.lasts() and context.available():
        for program in held:
            del _shaders[program]
        _free_dropped()


@on_release
def _release() -> None:
    _shaders.clear()
    if context.available():
        _free_dropped()


def _compile(program: Program):
    global compile_count
    compile_count += 1
    info = gpu.types.GPUShaderCreateInfo()
    for key, value in program.defines:
        info.define(key, value)
    structs = {struct.name: struct.glsl for struct, _ in program.blocks}
    if structs:
        info.typedef_source("".join(structs.values()))
    for slot, (struct, name) in enumerate(program.blocks):
        info.uniform_buf(slot, struct.name, name)
    images, loaded, samplers = list(program.images), program.loaded, 0
    for kind, name in program.textures:
        if name in loaded:
            info.define(f"{name}_fetch(texel)", f"imageLoad({name}, texel)")
            info.define(f"{name}_size()", f"imageSize({name})")
            images.append((name, kind, _FORMATS[kind], "READ"))
        else:
            info.define(f"{name}_fetch(texel)", f"texelFetch({name}, texel, 0)")
            info.define(f"{name}_size()", f"textureSize({name}, 0)")
            info.sampler(samplers, _FORMATS.get(kind, kind), name)
            samplers += 1
    for slot, (name, image_format, kind, access) in enumerate(images):
        qualifiers = {"READ", "WRITE"} if access == "READ_WRITE" else {access}
        info.image(slot, image_format, kind, name, qualifiers=qualifiers)
    for kind, name in program.constants:
        info.push_constant(kind, name)

    snippets = dict(program.snippets)
    words = frozenset(re.findall(r"\w+", " ".join(value for _, value in program.defines)))

    def used(file: str) -> tuple[str, list[tuple[str, int]]]:
        return without_unused(*resolve(file, snippets), words)

    sources = []
    if program.compute:
        info.local_group_size(*program.group)
        sources.append(used(program.compute))
        info.compute_source(sources[0][0])
    else:
        for slot, (kind, name) in enumerate(program.inputs):
            info.vertex_in(slot, kind, name)
        if program.varyings:
            # Keep a reference until the shader is made: Blender's create-info does not hold its own.
            interface = gpu.types.GPUStageInterfaceInfo(re.sub(r"\W", "_", program.name) + "_varyings")
            for mode, kind, name in program.varyings:
                getattr(interface, mode)(kind, name)
            info.vertex_out(interface)
        if program.writes_depth:
            info.depth_write("ANY")
        for slot, (kind, name) in enumerate(program.outputs):
            info.fragment_out(slot, kind, name)
        sources = [used(program.vertex), used(program.fragment)]
        info.vertex_source(sources[0][0])
        info.fragment_source(sources[1][0])

    with _CapturedOutput() as captured:
        try:
            handle = gpu.shader.create_from_info(info)
            failure = None
        except Exception as error:  # Blender raises a bare Exception
            handle, failure = None, error
    if failure is not None:
        raise ShaderError(_explain(program, captured.text, sources)) from failure
    return handle


def _explain(program: Program, log: str, sources: list[tuple[str, list[tuple[str, int]]]]) -> str:
    """The driver's complaints with the file and line of the source that each is about."""
    text, origin = sources[-1 if "FragShader" in log or "fragment:" in log else 0]  # OpenGL's and Vulkan's words
    places = [f"{file}:{line}" for file, line in origin]
    out = [f"Program {program.name} does not compile."]
    for line in log.splitlines():
        found = _ERROR_LINE.search(line)
        if found:
            number = int(found.group(1)) - 1
            out.append(f"  {places[number] if 0 <= number < len(places) else program.name}: {found.group(2)}")
    if len(out) == 1:  # Blender 4.5: the quoted lines tell the place, if no other line reads the same
        lines = [line.strip() for line in text.splitlines()]
        for quoted in dict.fromkeys(
            match.group(1).strip() for match in map(_QUOTED_LINE.match, log.splitlines()) if match
        ):
            if lines.count(quoted) == 1:
                out.append(f"  {places[lines.index(quoted)]}: {quoted}")
        out.append(log)
    return "\n".join(out)


class _CapturedOutput:
    """Collects what C code prints to stdout and stderr: compile logs reach Python in no other way."""

    text = ""

    def __enter__(self):
        sys.stdout.flush()
        sys.stderr.flush()
        self._file = tempfile.TemporaryFile()
        try:
            self._saved = os.dup(1), os.dup(2)
        except OSError:  # a windowed Blender on Windows has no console
            self._saved = None
            return self
        os.dup2(self._file.fileno(), 1)
        os.dup2(self._file.fileno(), 2)
        return self

    def __exit__(self, *_exception):
        if self._saved is not None:
            sys.stdout.flush()
            sys.stderr.flush()
            os.dup2(self._saved[0], 1)
            os.dup2(self._saved[1], 2)
            os.close(self._saved[0])
            os.close(self._saved[1])
        self._file.seek(0)
        self.text = self._file.read().decode("utf-8", "replace")
        self._file.close()
