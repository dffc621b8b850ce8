"""Materials on the GPU: one program per topology and use, one uniform block per material, images by content."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import wraps

import numpy as np

from ..gfx import images, library
from ..gfx.context import to_hold
from ..gfx.library import Program
from ..gfx.struct import Block, Struct
from ..materials.atlas import keys_of
from ..materials.attributes import CAMERA, INSTANCE
from ..materials.compiled import CompiledMaterial
from ..materials.compiler import compile_material
from ..materials.energy import energy_texture
from ..materials.reader import DEPTH_FROM_CAMERA, FINE_LAYERS
from ..materials.working_space import current
from ..snapshot.scene import Image, Note, Snapshot
from . import uv_placed
from .geometry import SceneGeometry
from .projection import PROJECTION_CONSTANTS, PROJECTION_DEFINES
from .textures import upload_texture
from .view import VIEW, View

# The camera as node trees see it. Positions are relative to the render origin.
MATERIAL_SCENE = Struct(
    "MaterialScene",
    ("vec4", "origin"),  # the render origin in world space; w = 1 for an orthographic camera
    ("vec4", "camera_position"),
    ("vec4", "camera_right"),  # w: width of a pixel one unit before the camera
    ("vec4", "camera_up"),
    ("vec4", "camera_backward"),
    ("vec4", "window"),  # the picture one unit before the camera: left, bottom, width, height
)

CAMERA_DEFINES = (
    ("PROJECTION", "film_view.row_x, film_view.row_y, film_view.row_w, film_view.row_q, film_view.backward.w"),
    ("VISIBILITY_FLAG", "film_view.visibility"),
)
# Where lookups of textures average over what a pixel of the view sees (materials/averages.py).
AVERAGING_DEFINES = (
    ("FOOTPRINT_OF_EXACT", "film_view.footprint_exact"),
    ("FOOTPRINT_OF_FIRST", "film_view.footprint_first"),
)
SHARED_ROWS = 1024  # of values in a block that materials of one program share: 16 KiB, what every GPU allows
FIRST_VALUE = "first_value"  # constant of programs of such materials: where in the block those of a draw begin
MOST_DECLARED = 4096  # materials whose programs are remembered
SURFACE_IMAGES = ("position", "normal", "diffuse", "tint", "lobe", "emission")


class MaterialSet:
    """The snapshot's materials, compiled and ready to bind. `update` recompiles only what has another topology."""

    def __init__(self):
        self.compiled: list[CompiledMaterial] = []
        self._in_use: frozenset[int] = frozenset()  # numbers of those that instances show
        self.notes: tuple[Note, ...] = ()
        self.energy_table: images.Image | None = None
        self._energy_space = ""  # the working space that it was made for
        self._scene: Block | None = None
        self._view: tuple = ()
        self._cache: dict[str, tuple[object, CompiledMaterial]] = {}
        self._blocks: dict[str, Block] = {}
        self._images: dict[tuple[str, int, bool], images.Image] = {}  # by key, version, and whether it has levels
        self._keys_of_images: dict[str, tuple[str, int, bool]] = {}  # of `_images`, by name
        self._sources: dict[str, Image] = {}  # by name
        self._used: list[str] = []
        # By material: the first one of those that share its program and block, and where in that its values begin.
        self.leaders: list[int] = []
        self.first_rows: list[int] = []
        self.sharing = 0  # changes of these
        self._shared: dict[int, Block] = {}  # by leader
        self.own_images: dict[int, dict[str, images.Image]] = {}  # by material: textures of its own surface program

    def update(self, snapshot: Snapshot) -> None:
        """Compile what changed, and upload it but for textures, which `upload_textures` does."""
        if self.energy_table is None or self._energy_space != current().name:
            self.energy_table = images.upload(energy_texture(FINE_LAYERS))
            self._energy_space = current().name
        before, self._in_use = self.compiled, snapshot.used_materials
        cache, self.compiled, notes, self.own_images = {}, [], [], {}
        of_strands = _on_strands(snapshot)
        for k, material in enumerate(snapshot.materials):
            versions = tuple((node.image, _version(snapshot, node.image)) for node in material.graph.nodes.values())
            cached = self._cache.get(material.key)
            by_map = uv_placed.asks(material.own)
            key = material.graph, versions, current().name, by_map, k in of_strands
            if cached is None or cached[0] != key:
                lean = to_hold(True, False)
                compiled = compile_material(material.name, material.graph, snapshot.images, lean=lean)
                compiled = replace(compiled, strands=k in of_strands)
                cached = key, uv_placed.with_map(compiled) if by_map else compiled
            cache[material.key] = cached
            compiled = cached[1]
            self.compiled.append(compiled)
            notes += [
                Note(f"Material '{material.name}'", text, material.name, node) for node, text in compiled.fallbacks
            ]
        self._cache = cache
        self.notes = tuple(notes)
        levels: dict[str, bool] = {}
        for compiled in self.compiled:
            for name in compiled.images:
                levels[name] = levels.get(name, False) or name in compiled.averaging
        self._keys_of_images = {name: (name, _version(snapshot, name), levels[name]) for name in levels}
        self._sources = snapshot.images
        self._blocks = {key: block for key, block in self._blocks.items() if key in cache}
        self._keys = [material.key for material in snapshot.materials]
        for key, compiled in zip(self._keys, self.compiled):
            block = self._blocks.get(key)
            values = np.asarray(compiled.values, np.float32)
            if block is None or block.struct is not _struct(len(values)):
                self._blocks[key] = Block(_struct(len(values)), value=values)
            else:
                block.update(value=values)

        if len(before) != len(self.compiled) or any(one is not other for one, other in zip(before, self.compiled)):
            self.share()

    def upload_textures(self) -> None:
        """Upload those that are not there yet, and free those that no material has any more. Not while anything is
        drawn, and before anything that `bindings` gives is: this draws their levels."""
        for _ in self.uploading():
            pass

    def uploading(self) -> Iterator[None]:
        """The same in parts, one for each texture."""
        wanted = set(self._keys_of_images.values())
        self._images = {key: image for key, image in self._images.items() if key in wanted}
        missing = [key for key in self._keys_of_images.values() if key not in self._images]
        for key in missing:
            self._images[key] = upload_texture(self._sources, key[0], key[2])
            yield

    def share(self) -> None:
        """Find which materials can be drawn by one program with one block."""
        self.sharing += 1
        self.leaders, self.first_rows = list(range(len(self.compiled))), [0] * len(self.compiled)
        rows: dict[int, list[np.ndarray]] = {}
        open_groups: dict[tuple, int] = {}
        for k, compiled in enumerate(self.compiled):
            if not may_share(compiled):
                continue
            key = (compiled.program_key, compiled.strands, *_layer_defines(compiled))
            leader = open_groups.setdefault(key, k)
            used = sum(map(len, rows.get(leader, ())))
            if used + len(compiled.values) > SHARED_ROWS:
                leader, used = k, 0
                open_groups[key] = k
            self.leaders[k], self.first_rows[k] = leader, used
            rows.setdefault(leader, []).append(np.asarray(compiled.values, np.float32))
        shared, self._shared = self._shared, {}
        for leader, parts in rows.items():
            values = np.zeros((SHARED_ROWS, 4), np.float32)
            values[: sum(map(len, parts))] = np.concatenate(parts)
            block = self._shared[leader] = shared.get(leader) or Block(_struct(SHARED_ROWS), value=values)
            block.update(value=values)

    def set_view(self, view: View) -> None:
        """Tell the node trees from where the scene is seen."""
        camera, (left, right, bottom, top) = view.camera, view.camera.frame
        values = {
            "origin": (*view.origin, float(camera.kind == "ORTHOGRAPHIC")),
            "camera_position": (*(camera.matrix[:3, 3] - view.origin), 0.0),
            "camera_right": (*camera.matrix[:3, 0], (right - left) / view.film.width),
            "camera_up": (*camera.matrix[:3, 1], 0.0),
            "camera_backward": (*camera.matrix[:3, 2], 0.0),
            "window": (left, bottom, right - left, top - bottom),
        }
        self._view = tuple(np.asarray(value, float).tobytes() for value in values.values())
        if self._scene is None:
            self._scene = Block(MATERIAL_SCENE, **values)
        else:
            self._scene.update(**values)

    @property
    def scene_block(self) -> Block:
        """From where the scene is seen, for node trees; once `set_view` was called."""
        return self._scene

    @property
    def view_key(self) -> tuple:
        """Equal in two frames if they are seen alike."""
        return self._view

    @property
    def layers_in_order(self) -> frozenset[int]:
        """Materials whose layers are taken apart, so that what one emits has the colours of those before it: all that
        emit or are coloured, where there are both."""
        glowing = {k for k, one in enumerate(self.compiled) if one.glows}
        colored = {k for k, one in enumerate(self.compiled) if one.colors_behind}
        return frozenset(glowing | colored) if glowing and colored else frozenset()

    @property
    def soft(self) -> bool:
        """Some material has a lobe of shaders/lib/soft_lobe.glsl, so that programs which light surfaces need it."""
        return any(compiled.soft for compiled in self._shown())

    @property
    def glossy(self) -> bool:
        """Some material has a lobe of microfacets, of mirrors or glass."""
        return any(compiled.glossy or compiled.glass for compiled in self._shown())

    def _shown(self) -> Iterator[CompiledMaterial]:
        """Those of instances: what stands for empty slots may be in none."""
        return (compiled for k, compiled in enumerate(self.compiled) if k in self._in_use)

    def fingerprint(self) -> tuple:
        """Equal in two frames if all materials shade alike."""
        return tuple(
            (c.program_key, c.values.tobytes(), c.images, c.medium and c.medium.key) for c in self.compiled
        ) + tuple(self._keys_of_images.values())

    def around(self, index: int, geometry: SceneGeometry) -> tuple:
        """Equal in two frames if what material `index` reads of the instances that show it, and of the camera, is."""
        reads = self.compiled[index].reads
        rows = geometry.rows_showing(index) if INSTANCE in reads else b""
        origin = tuple(geometry.origin) if reads else ()
        return rows, origin, self._view if CAMERA in reads else ()

    def surface_program(self, index: int) -> Program:
        """Draws material `index` into the surface images."""
        return _surface_program(self.compiled[index])

    def lobe_program(self, index: int) -> Program:
        """Draws one lobe of material `index` into the surface images, as the light of a view meets it: what it
        refracts (`wanted_lobe` 1) or reflects (2). Of several such lobes `lobe_choice` keeps one, the same for all
        texels."""
        return _lobe_program(self.compiled[index])

    def tint_program(self, index: int) -> Program:
        """Multiplies what lies behind material `index`, which has coloured transparency, by its colour."""
        return _tint_program(self.compiled[index])

    def scatter_program(self, index: int) -> Program:
        """Draws what of material `index` light enters elsewhere, where the surface images show it."""
        return _scatter_program(self.compiled[index])

    def aov_program(self, index: int, layout: AovLayout) -> Program:
        """Draws what AOV Output nodes of material `index` give."""
        return _aov_program(self.compiled[index], layout)

    def glow_program(self, index: int) -> Program:
        """Adds what layers of material `index` emit that this sample passes."""
        return _glow_program(self.compiled[index])

    def layer_program(self, index: int) -> Program:
        """Draws the farthest layer of material `index` that this sample passes (surfaces/layers.py)."""
        return _layer_program(self.compiled[index])

    def caster_program(self, index: int) -> Program:
        """Draws material `index`, which has alpha, into a depth map."""
        return _caster_program(self.compiled[index])

    def opacity_program(self, index: int) -> Program:
        """Adds up how much of their tiles triangles of material `index` cover, for both sides."""
        return _opacity_program(self.compiled[index])

    def emission_map_program(self, index: int) -> Program:
        """Adds up what places of triangles of material `index` emit, for both sides."""
        return _emission_map_program(self.compiled[index])

    def emission_program(self, index: int) -> Program:
        """Adds up what material `index` emits."""
        return _emission_program(self.compiled[index])

    def bindings(self, index: int, instances: images.Image, own: bool = True, shared: bool = False) -> dict:
        """Textures and blocks that programs of a material need; without `own` of those that draw its mesh as it is;
        `shared`: of those that draw all materials that share its block."""
        compiled = self.compiled[index]
        textures = {"instances": instances, "energy_table": self.energy_table}
        for slot, name in enumerate(compiled.images):
            textures[f"material_image{slot}"] = self._images[self._keys_of_images[name]]
        if compiled.own_surface and own:
            textures |= self.own_images[index]
        values = self._shared[self.leaders[index]] if shared else self._blocks[self._keys[index]]
        return {"textures": textures, "blocks": {"material_values": values, "material_scene": self._scene}}

    def drawing(self, index: int, program: Program, instances: images.Image) -> tuple[dict, dict[str, int]]:
        """What a program that draws the mesh of a material binds: as `bindings`, and constants."""
        shared = ("INT", FIRST_VALUE) in program.constants
        constants = {FIRST_VALUE: self.first_rows[index]} if shared else {}
        return self.bindings(index, instances, shared=shared), constants

    def in_shell(self, index: int) -> bool:
        """Whether material `index` is drawn by a shell over its mesh."""
        own = self.compiled[index].own_surface
        return own is not None and own.shell

    def release(self) -> None:
        self.__init__()


def _version(snapshot: Snapshot, name: str) -> int | tuple[int, ...]:
    versions = tuple(snapshot.images[key].version if key in snapshot.images else 0 for key in keys_of(name))
    return versions if len(versions) > 1 else versions[0]


def _on_strands(snapshot: Snapshot) -> frozenset[int]:
    """Materials of objects that are hair."""
    hair = {key for key, mesh in snapshot.meshes.items() if mesh.strands is not None}
    shown = (one.materials for one in snapshot.instances if one.mesh in hair) if hair else ()
    return frozenset(k for materials in shown for k in materials)


def may_share(compiled: CompiledMaterial) -> bool:
    """Whether a material can be drawn together with others of its program: it binds nothing of its own but values."""
    alone = compiled.images or compiled.attributes or compiled.own_surface
    return not alone and len(compiled.values) <= SHARED_ROWS


def shared_struct() -> Struct:
    """The block of materials that are drawn together."""
    return _struct(SHARED_ROWS)


def values_struct(compiled: CompiledMaterial) -> Struct:
    """The block in which a compiled tree finds its values."""
    return _struct(len(compiled.values))


def values_block(compiled: CompiledMaterial) -> Block:
    """A block that holds them."""
    return Block(values_struct(compiled), value=np.asarray(compiled.values, np.float32))


_structs: dict[int, Struct] = {}


def _struct(length: int) -> Struct:
    return _structs.setdefault(length, Struct("MaterialValues", ("vec4", f"value[{length}]")))


def _shared(compiled: CompiledMaterial, is_camera: bool = False) -> dict:
    """`is_camera`: of programs that draw what the camera sees."""
    count, own = len(compiled.attributes), compiled.own_surface
    copy = "".join(f"  varying_attribute{k} = attribute{k};\n" for k in range(count))
    head = "void fill_attributes(inout SurfacePoint point, vec2 steps_x, vec2 steps_y)"
    fill = "  vec4 along_x;\n  vec4 along_y;\n" + "".join(
        f"  point.attributes[{k}] = varying_attribute{k};\n"
        f"  along_x = dFdx(varying_attribute{k});\n"
        f"  along_y = dFdy(varying_attribute{k});\n"
        f"  point.attributes_dx[{k}] = steps_x.x * along_x + steps_x.y * along_y;\n"
        f"  point.attributes_dy[{k}] = steps_y.x * along_x + steps_y.y * along_y;\n"
        for k in range(count)
    )
    inputs = (("VEC2", "envelope"), *(("VEC4", f"attribute{k}") for k in range(count)))
    varyings = tuple(("smooth", "VEC4", f"varying_attribute{k}") for k in range(count))
    if own is not None and own.shell:  # which finds what corners have in a list
        fill, inputs, varyings = "", (("VEC2", "shell"),), (("flat", "INT", "shell_triangle"),)
    wide = is_camera and _strand_defines(compiled)
    return {
        "vertex": "surface/shell.vert.glsl" if own is not None and own.shell else "surface/surface.vert.glsl",
        "inputs": (("VEC3", "position"), ("VEC3", "normal"), ("INT", "local_instance"), *inputs),
        "varyings": (
            ("smooth", "VEC3", "world_position"), ("smooth", "VEC3", "world_normal"),
            ("smooth", "VEC3", "normal_heights"), ("flat", "IVEC2", "instance_flat"), *varyings,
            *(STRAND_VARYINGS if wide else ()),
        ),
        "textures": (
            ("RGBA32F", "instances"), ("RGBA32F", "energy_table"),
            *(("FLOAT_2D", f"material_image{k}") for k in range(len(compiled.images))),
            *(own.textures if own else ()),
        ),
        "writes_depth": own is not None or bool(wide),
        "snippets": (
            ("generated/own_surface", own.glsl if own else ""),
            ("generated/strands", STRANDS * compiled.strands + WIDE * bool(wide)),
            ("generated/attributes", f"void copy_attributes()\n{{\n{copy}}}\n"),
            (
                "generated/material",
                f"{compiled.glsl}\n{head}\n{{\n{fill}}}\n",
            ),
        ),
    }  # fmt: skip


def _once(make: Callable[[CompiledMaterial], Program]) -> Callable[[CompiledMaterial], Program]:
    """Declare the program of a compiled material once: it is asked for at each draw."""
    made: dict[int, tuple[CompiledMaterial, Program]] = {}

    @wraps(make)
    def program(compiled: CompiledMaterial) -> Program:
        known = made.get(id(compiled))
        if known is None or known[0] is not compiled:
            if len(made) >= MOST_DECLARED:
                made.clear()
            known = made[id(compiled)] = (compiled, make(compiled))
        return known[1]

    return program


@_once
def _surface_program(compiled: CompiledMaterial) -> Program:
    shares = may_share(compiled)
    return Program(
        name=f"surface {compiled.program_key[:8]}",
        fragment="surface/surface.frag.glsl",
        outputs=tuple(("VEC4", f"out_{name}") for name in SURFACE_IMAGES),
        blocks=(
            (VIEW, "film_view"),
            (shared_struct() if shares else values_struct(compiled), "material_values"),
            (MATERIAL_SCENE, "material_scene"),
        ),
        constants=(
            ("INT", "first_instance"),
            ("INT", "transparent_mode"),
            ("INT", "glass_bends"),
            ("INT", "index_shown"),
            *((("INT", FIRST_VALUE),) if shares else ()),
        ),
        defines=(
            *CAMERA_DEFINES, *AVERAGING_DEFINES, *_layer_defines(compiled),
            *((("MATERIAL_BASE", "(instance_flat.y >> 1)"),) if shares else ()), *_strand_defines(compiled),
        ),
        **_shared(compiled, True),
    )  # fmt: skip


@_once
def _lobe_program(compiled: CompiledMaterial) -> Program:
    like = _surface_program(compiled)
    return replace(
        like,
        name=f"one lobe {compiled.program_key[:8]}",
        constants=(*like.constants, ("INT", "wanted_lobe"), ("FLOAT", "lobe_choice")),
        defines=(*like.defines, ("ONE_LOBE", "1")),
    )


def _layer_defines(compiled: CompiledMaterial) -> tuple[tuple[str, str], ...]:
    """How layers of a material are drawn, see surface.frag.glsl."""
    kinds = {"GLOWS": compiled.glows, "ADDED_LOBES": compiled.added, "LAYER_COLORS": compiled.colors_behind}
    return tuple((name, "") for name, is_so in kinds.items() if is_so) + _own_defines(compiled)


STRAND_VARYINGS = tuple(
    ("smooth", kind, f"strand_{name}") for kind, name in (("VEC4", "across"), ("VEC3", "along"), ("VEC4", "aside"))
)
STRANDS, WIDE = "#define STRANDS\n", '#include "surface/strand.glsl"\n'


def _strand_defines(compiled: CompiledMaterial) -> tuple[tuple[str, str], ...]:
    """Whether a material has strands that may be drawn wider than they are (surface/strand.glsl): not where layers
    before and behind one another add up. What no strand shows pays nothing for them."""
    layered = compiled.transparent or compiled.glows or compiled.colors_behind or compiled.own_surface
    return () if layered or not compiled.strands else (("WIDENS_STRANDS", ""),)


EYE = "vec4(film_view.eye.xyz, 1.0 - film_view.eye.w)"


def _own_defines(compiled: CompiledMaterial, rays_begin: str = EYE) -> tuple[tuple[str, str], ...]:
    """Whether programs look for the surface themselves, see surface/point.glsl; `rays_begin`: a place, w 1, or a
    direction to infinity, w 0."""
    return (("OWN_SURFACE", ""), ("RAYS_BEGIN", rays_begin)) if compiled.own_surface else ()


BEFORE_CONSTANTS = (("INT", "first_instance"), ("INT", "glass_bends"))  # of programs that draw before known surfaces


@_once
def _tint_program(compiled: CompiledMaterial) -> Program:
    shared = _shared(compiled)
    return Program(
        name=f"tint {compiled.program_key[:8]}",
        fragment="surface/tint.frag.glsl",
        outputs=tuple(("VEC4", f"out_{name}") for name in ("diffuse", "tint", "emission")),
        blocks=(
            (VIEW, "film_view"),
            (_struct(len(compiled.values)), "material_values"),
            (MATERIAL_SCENE, "material_scene"),
        ),
        constants=(*BEFORE_CONSTANTS, ("INT", "transparent_mode")),
        defines=(*CAMERA_DEFINES, *AVERAGING_DEFINES, *_layer_defines(compiled)),
        **{**shared, "textures": (*shared["textures"], ("RGBA32F", "surface_position"))},
    )


SCATTER_IMAGES = ("length", "share", "entry", "walk")  # layout: shaders/subsurface/image.glsl


@_once
def _scatter_program(compiled: CompiledMaterial) -> Program:
    like = _tint_program(compiled)
    return replace(
        like,
        name=f"subsurface {compiled.program_key[:8]}",
        fragment="surface/scatter.frag.glsl",
        outputs=tuple(("VEC4", f"out_{name}") for name in SCATTER_IMAGES),
        constants=BEFORE_CONSTANTS,
        textures=(*like.textures, ("RGBA32F", "scatter_objects")),
        **{name: _shared(compiled, True)[name] for name in ("snippets", "varyings")},
        defines=(
            *CAMERA_DEFINES,
            *AVERAGING_DEFINES,
            ("SUBSURFACE", "1"),
            *_own_defines(compiled),
            *_strand_defines(compiled),
        ),
    )


AOV_GROUP = 6  # images that Blender lets a pass draw into
AovLayout = tuple[tuple[tuple[str, str], ...], ...]  # by image, what its channels hold: name and kind
_aov_programs: dict[tuple[int, AovLayout], tuple[CompiledMaterial, Program]] = {}


def _aov_program(compiled: CompiledMaterial, layout: AovLayout) -> Program:
    known = _aov_programs.get((id(compiled), layout))
    if known is None or known[0] is not compiled:
        if len(_aov_programs) >= MOST_DECLARED:
            _aov_programs.clear()
        layered = (("LAYERED", "1"),) * compiled.transparent
        shared = _shared(compiled, True)
        moving = any(kind == "VECTOR" for held in layout for _, kind in held)
        program = Program(
            name=f"AOVs {compiled.program_key[:8]}",
            fragment="surface/aov.frag.glsl",
            outputs=tuple(("VEC4", f"out_{k}") for k in range(len(layout))),
            blocks=(
                (VIEW, "film_view"),
                (_struct(len(compiled.values)), "material_values"),
                (MATERIAL_SCENE, "material_scene"),
            ),
            constants=(("INT", "first_instance"), ("INT", "layers"), ("FLOAT", "alpha_threshold")),
            defines=(
                *CAMERA_DEFINES,
                *layered,
                *((("MOTION", "1"),) if moving else ()),
                *_own_defines(compiled),
                *_strand_defines(compiled),
            ),
            **{
                **shared,
                "textures": (
                    *shared["textures"],
                    ("RGBA32F", "surface_position"),
                    *((("RGBA32F", "motion_table"),) if moving else ()),
                ),
                "snippets": (*shared["snippets"], ("generated/aovs", AOV_NEAR + _aov_texts(compiled.aovs, layout))),
            },
        )
        known = _aov_programs[id(compiled), layout] = (compiled, program)
    return known[1]


def _aov_texts(given: tuple[tuple[str, str], ...], layout: AovLayout) -> str:
    """GLSL that sets the images of a layout from the AOVs that a material gives."""
    none = " ".join(f"out_{k} = vec4(0.0);" for k in range(len(layout)))
    written = []
    for k, held in enumerate(layout):
        for channel, aov in enumerate(held):
            if aov not in given:
                continue
            value, to = f"material_aov{given.index(aov)}", f"out_{k}.{'xyzw'[channel]}"
            written.append(
                {
                    "VALUE": f"{to} = {value}(point);",
                    "HIT": f"{to} = surface;",
                    "DISTANCE": f"{to} = surface * aov_distance(point.position);",
                    "UV": f"out_{k} = surface * vec4({value}(point), 1.0);",
                    "VECTOR": f"out_{k} = surface * motion_vector(point.position, instance_flat.x, {value}(point), "
                    f"{value}_after(point));",
                }.get(aov[1], f"out_{k} = vec4({value}(point), 1.0);")
            )
    return f"#define AOV_NONE {none}\n#define AOV_WRITE {' '.join(written)}\n"


# Where Denoising Depth begins, as Cycles of this Blender has it (shaders/surface/aov.frag.glsl).
AOV_NEAR = f"#define AOV_NEAR {'0.0' if DEPTH_FROM_CAMERA else 'film_view.film.z'}\n"


@_once
def _glow_program(compiled: CompiledMaterial) -> Program:
    return replace(
        _tint_program(compiled),
        name=f"glow {compiled.program_key[:8]}",
        fragment="surface/glow.frag.glsl",
        outputs=(("VEC4", "out_emission"),),
        constants=BEFORE_CONSTANTS,
        defines=(*CAMERA_DEFINES, *AVERAGING_DEFINES, *_own_defines(compiled)),
    )


@_once
def _layer_program(compiled: CompiledMaterial) -> Program:
    return replace(
        _tint_program(compiled),
        name=f"layer {compiled.program_key[:8]}",
        fragment="surface/layer.frag.glsl",
        outputs=tuple(("VEC4", f"out_{name}") for name in ("position", "tint", "emission")),
    )


@_once
def _caster_program(compiled: CompiledMaterial) -> Program:
    return Program(
        name=f"alpha caster {compiled.program_key[:8]}",
        fragment="depth_map/alpha.frag.glsl",
        outputs=(("VEC4", "out_depth"),),
        blocks=((_struct(len(compiled.values)), "material_values"), (MATERIAL_SCENE, "material_scene")),
        constants=(
            *PROJECTION_CONSTANTS,
            ("INT", "caster_sample"),
            ("VEC4", "light_point"),
            ("INT", "glass_blocks"),
            ("INT", "channel_asked"),
        ),
        defines=(*PROJECTION_DEFINES, *_own_defines(compiled, "light_point"), *_whole_defines(compiled)),
        **_shared(compiled),
    )


def _whole_defines(compiled: CompiledMaterial) -> tuple[tuple[str, str], ...]:
    """Casters that light does not pass where their own surface is need not be asked for their closures there."""
    own = compiled.own_surface
    return (("CASTS_WHOLE", ""),) if own is not None and not own.lets_pass else ()


def caster_like(compiled: CompiledMaterial) -> Program:
    """The program of casters, to be changed into one that asks a material something else."""
    return _caster_program(compiled)


# What casts no shadow shines, too.
EVERY_DEFINES = tuple((name, "-1" if name == "VISIBILITY_FLAG" else value) for name, value in PROJECTION_DEFINES)


def _emission_program(compiled: CompiledMaterial) -> Program:
    like = _caster_program(compiled)
    return replace(
        like,
        name=f"emission {compiled.program_key[:8]}",
        fragment="surface/emission.frag.glsl",
        outputs=(("VEC4", "out_emission"),),
        constants=tuple(one for one in like.constants if one[1] not in ("glass_blocks", "channel_asked")),
        defines=(*EVERY_DEFINES, *_own_defines(compiled, "light_point")),
    )


def _opacity_program(compiled: CompiledMaterial) -> Program:
    """See opacity_maps.py; with a second output where what passes may be coloured."""
    compiled = replace(compiled, own_surface=None)
    like = _caster_program(compiled)
    return replace(
        like,
        name=f"opacity {compiled.program_key[:8]}",
        vertex="surface/opacity_map.vert.glsl",
        fragment="surface/opacity_map.frag.glsl",
        inputs=(*(one for one in like.inputs if one[1] not in ("envelope", "local_instance")), ("VEC2", "cell")),
        varyings=(*like.varyings, ("flat", "INT", "sample_flat")),
        outputs=(("VEC4", "out_opacity"), *([("VEC4", "out_passing")] if compiled.tinted else [])),
        constants=(("INT", "first_instance"), ("VEC2", "tile_scale")),
        defines=(*EVERY_DEFINES, *([("COLORED", "")] if compiled.tinted else [])),
    )


def _emission_map_program(compiled: CompiledMaterial) -> Program:
    """See emission_maps.py."""
    return replace(
        _opacity_program(compiled),
        name=f"emission map {compiled.program_key[:8]}",
        vertex="surface/emission_map.vert.glsl",
        fragment="surface/emission_map.frag.glsl",
        outputs=(("VEC4", "out_emission"),),
        constants=(("INT", "first_instance"), ("VEC2", "tile_scale"), ("VEC2", "shift"), ("FLOAT", "other_side")),
        defines=EVERY_DEFINES,
    )


def may_be_glossy(snapshot: Snapshot) -> bool:
    """Whether a material that is shown may have a glossy lobe; that of empty slots has one since Blender 5.0."""
    shown = {index for slots in snapshot.material_sets for index in slots or (0,)}
    return any(_material_may_be_glossy(snapshot.materials[index]) for index in shown)


def _material_may_be_glossy(material) -> bool:
    return any("Bsdf" in node.type and node.type not in _NEVER_GLOSSY for node in material.graph.nodes.values())


_NEVER_GLOSSY = {"ShaderNodeBsdfDiffuse", "ShaderNodeBsdfTransparent", "ShaderNodeBsdfTranslucent"}


def compiling(programs: list[Program]) -> Iterator[tuple[int, int]]:
    """Compile what is not compiled yet; yields (done, total) of those after each."""
    fresh = [program for program in programs if not library.has(program)]
    for done, program in enumerate(fresh, 1):
        library.get(program)
        yield done, len(fresh)
