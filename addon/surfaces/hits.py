"""Shading of hits: what rays meet, as closures of the materials there, laid out like the surface images.

A draw of meshes evaluates materials where the camera sees them; a ray meets what no view shows. So a hit is a record
per pixel (shaders/hits/trace.frag.glsl): place, footprint, instance, triangle, barycentric coordinates, normals. For
each material met, one pass over the screen runs *its own* program at its records (textures, procedurals, bumps, vertex
colours, emission, alpha) into six images like those of surfaces/draw.py. The trace writes the material as depth and the
pass tests for EQUAL, so a driver skips blocks of other pixels. Whatever reads surface images then reads hits.

The first picture flags the materials that were met and compiles those programs alone. Reading flags stops the queue, so
where rays can meet no more than MOST_UNASKED materials, later pictures compile the rest (in a viewport one each) and
draw all of them without asking; of many programs the vertices of one that was not met leave the screen by the same
flags. Scenes of more materials read the flags in each round. Materials that differ in values alone are one pass: the
trace writes the first one's depth for all, and a pixel finds its own values in their block (scene/materials.py).

`owners` gives for each triangle of the hierarchy its instance and its number within its material, and each material has
a list of corner attributes by that number, made when it is first met. Bumps use the derivatives of the ray's footprint.

    rays (origin, direction)  --trace-->  Records  --shade-->  closures

| cost | per round of rays |
|---|---|
| passes | 1 trace, 1 for each program; of many, 1 that flags those met, and the others end at their vertices |
| readback | none; with many materials, and in the first pictures, one flag for each material of the scene |
| bytes per pixel | 4 x 16 + 4 + 4 for records, 6 x 16 for closures |
| per material met, once | a program; 48 bytes a triangle and attribute, and 48 more where it has any |

Bias: alpha is as fine as the tiles of opacity maps (scene/opacity_maps.py). The Light Path node sees a glossy ray.
Images have no mip levels: footprints filter bumps, not textures. Normals of corners have 12 bits. Relief goes on over
the edges of its mesh (shaders/hits/relief.glsl); grass is its ground. A material with more than MOST_IMAGES images is
its mean reflectance instead.
"""

from __future__ import annotations

import weakref
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from ..frame.picture import Frame
from ..frame.technique import Technique
from ..gfx import images, passes
from ..gfx.library import Program
from ..materials.compiled import CompiledMaterial
from ..scene import acceleration
from ..scene.acceleration import Hierarchy
from ..scene.emission_maps import EmissiveLevel
from ..scene.geometry import corner_attribute
from ..scene.materials import (
    AVERAGING_DEFINES,
    CAMERA_DEFINES,
    MATERIAL_SCENE,
    SURFACE_IMAGES,
    may_share,
    shared_struct,
    values_struct,
)
from ..scene.view import VIEW
from ..snapshot.scene import Instance, Mesh
from .draw import refracts
from .reflectance import Reflectance

MOST_IMAGES = 9  # of a material: 16 textures less those of records
MOST_UNASKED = 64  # materials that are all evaluated, without a readback that tells which were met
MOST_UNFLAGGED = 12  # programs that are drawn over the screen without a flag for each that tells whether it was met
MOST_MATERIALS = 8000  # that depth tells apart, see trace.frag.glsl
ROW = 256  # of lists by material
MET_ROWS = -(-MOST_MATERIALS // ROW)
SMOOTH_BOTH, FROSTED_WITHIN = 1, 2  # glass that is kept as one lobe of both ways
LEADER_BITS = 13  # of numbers that hold two, as in hits/shared.glsl
RECORDS = ("place", "triangle", "normals", "passed")
RECORD_TEXTURES = tuple(("RGBA32F", f"hit_{name}") for name in RECORDS[:3])
RAYS = (("RGBA32F", "ray_origin"), ("RGBA32F", "ray_direction"))
# `where` of passes.fullscreen with the depth of records: rays that met something, and all rays.
MET, ANY_RAY = "LESS", "LESS_EQUAL"
TRACE = passes.fullscreen_program(
    "trace hits",
    "hits/trace.frag.glsl",
    textures=(*acceleration.HIERARCHY_TEXTURES, *RAYS, ("RG32F", "trace_owners"), ("RGBA32F", "hit_materials")),
    blocks=((VIEW, "film_view"),),
    constants=(
        ("INT", "ray_number"),
        ("INT", "glass_bends"),
        ("INT", "first_leaf"),
        ("FLOAT", "spread"),
        ("FLOAT", "offset_size"),
        ("FLOAT", "emissive_level"),
    ),
    outputs=(*(("VEC4", f"out_{name}") for name in RECORDS), ("FLOAT", "out_material")),
    writes_depth=True,
)
MATERIALS_MET = Program(
    name="materials met",
    compute="hits/met.comp.glsl",
    textures=(
        ("RGBA32F", "hit_place"),
        ("R32F", "hit_material"),
        ("RGBA32F", "rays"),
        ("RGBA32F", "hit_materials"),
    ),
    images=(("met", "R32UI", "UINT_2D", "WRITE"),),
)
COUNT_MET = passes.fullscreen_program(
    "number of materials met", "hits/met_count.frag.glsl", textures=(("R32UI", "materials_met"),),
    constants=(("INT", "material_count"),), outputs=(("FLOAT", "out_count"),),
)  # fmt: skip
PLACE = passes.fullscreen_program(
    "points as hits",
    "hits/place.frag.glsl",
    textures=(
        *(("RGBA32F", f"point_{name}") for name in ("place", "triangle", "normals", "material")),
        ("RGBA32F", "hit_materials"),
    ),
    outputs=(*(("VEC4", f"out_{name}") for name in RECORDS), ("FLOAT", "out_material")),
    writes_depth=True,
)
MASKED = {
    "vertex": "hits/material.vert.glsl",
    "inputs": passes.FULLSCREEN_INPUTS,
    "varyings": passes.FULLSCREEN_VARYINGS,
    "outputs": tuple(("VEC4", f"out_{name}") for name in SURFACE_IMAGES),
    "defines": CAMERA_DEFINES,
}
MEAN = Program(
    name="mean of a hit",
    fragment="hits/mean.frag.glsl",
    textures=(*RECORD_TEXTURES, RAYS[1], ("RGBA32F", "instances"), ("RGBA32F", "reflectance")),
    blocks=((VIEW, "film_view"),),
    constants=(("FLOAT", "material_depth"), ("INT", "material_number")),
    **MASKED,
)


def depth_of(material: int) -> float:
    """Of records of a material; exact in a float."""
    return 0.5 + (material + 1) / 16384


def _program_key(compiled: CompiledMaterial) -> str:
    if len(compiled.images) > MOST_IMAGES:
        return MEAN.name
    return f"{compiled.program_key} relief" if _has_relief(compiled) else compiled.program_key


def _has_relief(compiled: CompiledMaterial) -> bool:
    """Whether its heights are looked for at hits (shaders/hits/relief.glsl)."""
    own = compiled.own_surface
    return own is not None and own.shell and len(compiled.images) + bool(compiled.attributes) <= MOST_IMAGES


def hit_program(compiled: CompiledMaterial) -> Program:
    """Evaluates a material where rays met it."""
    key = _program_key(compiled)
    if key not in _programs:
        if len(_programs) >= MOST_PROGRAMS:
            del _programs[next(iter(_programs))]
        _programs[key] = _hit_program(compiled)
    return _programs[key]


def _hit_program(compiled: CompiledMaterial) -> Program:
    listed = (("RGBA32F", "hit_attributes"),) if compiled.attributes else ()
    relief = (("RGBA32F", "shell_corners"),) if _has_relief(compiled) else ()
    shared = may_share(compiled)
    free = MOST_IMAGES + 1 - len(compiled.images) - len(listed) - len(relief)
    room, path = free > 0, free > 1 + 2 * shared
    return Program(
        name=f"hits {compiled.program_key[:8]}{' relief' * len(relief)}",
        fragment="hits/surface.frag.glsl",
        textures=(
            *RECORD_TEXTURES, RAYS[1], ("RGBA32F", "instances"), ("RGBA32F", "energy_table"), *listed,
            *relief, *(("FLOAT_2D", f"material_image{k}") for k in range(len(compiled.images))),
            *((("UINT_2D", "materials_met"),) if room else ()), *((("RGBA32F", "met_path"),) if path else ()),
            *((("R32F", "hit_material"), ("RGBA32F", "hit_materials")) if shared else ()),
        ),
        blocks=(
            (VIEW, "film_view"), (shared_struct() if shared else values_struct(compiled), "material_values"),
            (MATERIAL_SCENE, "material_scene"),
        ),
        constants=(
            ("INT", "ray_number"), ("INT", "glass_bends"), ("FLOAT", "material_depth"), ("INT", "material_number"),
            *((("INT", "path_known"),) if path else ()),
        ),
        snippets=(("generated/material", f"{compiled.glsl}\n{_fill(len(compiled.attributes))}"),),
        **{
            **MASKED,
            "defines": (
                *MASKED["defines"], *AVERAGING_DEFINES, *((("ASKS_IF_MET", str(MET_ROWS)),) if room else ()),
                *((("SHARED_VALUES", "1"), ("MATERIAL_BASE", "MET_MATERIAL_BASE")) if shared else ()),
                *((("OWN_SURFACE", ""),) if relief else ()), *((("PATH_COLOR", ""),) if path else ()),
            ),
        },
    )  # fmt: skip


def _fill(count: int) -> str:
    """`fill_attributes` for records, of `count` attributes."""
    head = "void fill_attributes(inout SurfacePoint point, Instance instance, vec4 record)\n{\n"
    if not count:
        return head + "}\n"
    lines = [
        f"  int base = int(record.y) * {3 * (count + 1)};",
        "  vec3 corner = corner_texel(base).xyz;",
        f"  vec3 e1 = turned_by(instance, corner_texel(base + {count + 1}).xyz - corner);",
        f"  vec3 e2 = turned_by(instance, corner_texel(base + {2 * (count + 1)}).xyz - corner);",
        "  vec2 steps_x = edge_steps(point.position_dx, e1, e2);",
        "  vec2 steps_y = edge_steps(point.position_dy, e1, e2);",
        "  vec4 first;", "  vec4 along_first;", "  vec4 along_second;",
    ]  # fmt: skip
    for k in range(count):
        lines += [
            f"  first = corner_texel(base + {1 + k});",
            f"  along_first = corner_texel(base + {count + 2 + k}) - first;",
            f"  along_second = corner_texel(base + {2 * count + 3 + k}) - first;",
            f"  point.attributes[{k}] = first + record.z * along_first + record.w * along_second;",
            f"  point.attributes_dx[{k}] = steps_x.x * along_first + steps_x.y * along_second;",
            f"  point.attributes_dy[{k}] = steps_y.x * along_first + steps_y.y * along_second;",
        ]
    return '#include "hits/attributes.glsl"\n' + head + "\n".join(lines) + "\n}\n"


@dataclass
class Records:
    """What rays of a round met: RECORDS, the number of the material, and that as depth. The images stand until `give`;
    of these fields `all_met` alone changes, with what is drawn into `met` (Hits.trace)."""

    target: images.Target
    # By material, in rows of ROW: 1 if any ray has met it; in the second half, if any has met one of its program.
    met: images.Image
    all_met: bool = False  # whether `met` holds 1 for all materials

    @classmethod
    def take(cls, size: tuple[int, int]) -> Records:
        """Images of the pool, undefined."""
        colors = [images.pool.take(*size, "RGBA32F") for _ in RECORDS] + [images.pool.take(*size, "R32F")]
        met = images.pool.take(ROW, 2 * MET_ROWS, "R32UI")
        return cls(images.Target(tuple(colors), images.pool.take(*size, "DEPTH_COMPONENT32F")), met)

    @property
    def images(self) -> dict[str, images.Image]:
        return {f"hit_{name}": image for name, image in zip((*RECORDS, "material"), self.target.colors)}

    def give(self) -> None:
        """Back to the pool."""
        for image in (*self.target.colors, self.target.depth, self.met):
            images.pool.give(image)


def take_closures(size: tuple[int, int], depth: images.Image) -> images.Target:
    """Six images of the pool for closures, with the depth of the records that they are of."""
    return images.Target(tuple(images.pool.take(*size, "RGBA32F") for _ in SURFACE_IMAGES), depth)


def closure_bindings(closures: images.Target) -> dict[str, images.Image]:
    """Closures of hits under the names that shaders/lib/gbuffer.glsl reads."""
    return {f"surface_{name}": image for name, image in zip(SURFACE_IMAGES, closures.colors)}


@dataclass(frozen=True)
class _Kind:
    """Triangles of one material in one mesh."""

    mesh: Mesh
    slots: tuple[int, ...]
    first: int  # number of the first one among those of the material


def _leaves_of_rows(hierarchy: Hierarchy) -> int:
    """How many leaves' place the rows of its instances take in the list of owners."""
    return -(-len(hierarchy.instances) // acceleration.LEAF) if hierarchy.shared else 0


class Hits:
    """The triangles of a scene as its rays find them. One for each renderer: `frame.kept(Hits)`."""

    def __init__(self):
        # By hierarchy and instances: rows of those, what triangles are numbered by, and the list.
        self._owners: dict[object, tuple[bytes, object, images.Image]] = {}
        self._kinds: dict[int, list[_Kind]] = {}  # by material
        self._numbers: dict[tuple, np.ndarray] = {}  # by mesh, version and slots: of each triangle
        self._numbers_key: object = None
        self._attributes: dict[int, tuple[object, images.Image]] = {}
        self._absorption: tuple[object, images.Image] | None = None
        self._possible: tuple[object, set[int]] | None = None
        self._rays: images.Image | None = None  # of the last records; zero where there is none
        self._flagged = False  # which materials they met is told by flags
        self._compiled: set[str] = set()  # keys of programs that have been drawn with
        self._asked: weakref.ref[Frame] | None = None  # the first picture
        self._ahead: object = None  # the view of the last picture that compiled a program ahead

    def trace(
        self, frame: Frame, technique: Technique, rays: tuple[images.Image, images.Image], records: Records,
        path: str = "glossy", number: int = 0,
    ) -> set[int]:  # fmt: skip
        """Follow rays (RGBA32F origin, w: width of the footprint, m; unit direction, 0: no ray) of a path to what
        they meet, and return the materials that may be there. `number` below 20 tells rounds of a sample apart."""
        hierarchy = frame.hierarchy(path)
        owners = self._owners_of(frame, hierarchy)
        images.Target((), records.target.depth).clear(depth=0.0)
        passes.fullscreen(
            TRACE,
            records.target,
            textures={
                **hierarchy.textures, "ray_origin": rays[0], "ray_direction": rays[1],
                "trace_owners": owners, "hit_materials": self._absorption_of(frame),
            },
            blocks={"film_view": frame.view_block},
            constants={
                "ray_number": number, "glass_bends": int(refracts(frame)),
                "first_leaf": hierarchy.first_leaf - _leaves_of_rows(hierarchy),
                "spread": pixel_spread(frame), "offset_size": frame.offset_size,
                "emissive_level": frame.shared(EmissiveLevel).value,
            },
        )  # fmt: skip
        frame.count(technique, "passes")
        self._rays = rays[1]
        return self._to_shade(frame, hierarchy, records, path)

    def place(
        self, frame: Frame, technique: Technique, points: tuple[images.Image, ...], records: Records
    ) -> None:  # fmt: skip
        """Take points that are known as hits: images as the first three of RECORDS, and one of the number of the
        material (x; y: 0 where there is no point), as `numbers` tells those of triangles."""
        textures = {name: image for (_, name), image in zip(PLACE.textures, points)}
        passes.fullscreen(PLACE, records.target, textures={**textures, "hit_materials": self._absorption_of(frame)})
        frame.count(technique, "passes")
        self._rays = records.images["hit_place"]
        self._flag_met(frame, records)

    def numbers(self, frame: Frame, instance: Instance) -> np.ndarray:
        """(T,) of each triangle of an instance's mesh, its number among those of its material: y of the record
        `triangle`."""
        self._number(frame)
        return self._numbers[instance.mesh, frame.geometry.placed[1][instance.mesh].version, instance.materials]

    def shade(self, *arguments, **named) -> None:
        """`shading` at once."""
        for _ in self.shading(*arguments, **named):
            pass

    def shading(
        self, frame: Frame, technique: Technique, ray_direction: images.Image, records: Records, materials: set[int],
        closures: images.Target, number: int = 0, masked: bool = False, path: images.Image | None = None,
        both_ways: int = 0,
    ) -> Iterator[None]:  # fmt: skip
        """Evaluate these materials at the records into `closures` (take_closures), which is cleared before; `masked`:
        of it the place alone, since whoever reads it does so where something was met, and nothing if its w is 0;
        `path`: what the rays' paths let pass (rgb), by which lobes are chosen; `both_ways`: which glass is one lobe,
        SMOOTH_BOTH (as goes_both_ways has it) and FROSTED_WITHIN added up. In parts: after each program that draws for
        the first time, which takes the driver long."""
        images.Target(closures.colors[:1] if masked else closures.colors).clear()
        leaders = {frame.materials.leaders[k] for k in materials}
        # One program after the other: between materials that share one, only what differs is bound.
        order = sorted(leaders, key=lambda k: (_program_key(frame.materials.compiled[k]), k))
        fresh = [k for k in order if _program_key(frame.materials.compiled[k]) not in self._compiled]
        for material in fresh:
            self._draw(frame, ray_direction, path, records, [material], closures, number, both_ways)
            yield
        self._draw(
            frame, ray_direction, path, records, [k for k in order if k not in fresh], closures, number, both_ways
        )
        if self._flagged:
            with images.borrowed(1, 1, "R32F") as count:
                number_of_all = {"material_count": len(frame.materials.compiled)}
                passes.fullscreen(COUNT_MET, count, textures={"materials_met": records.met}, constants=number_of_all)
                frame.account.count_texel(technique, "materials", count.colors[0])
        frame.count(technique, "programs", len(leaders))
        frame.count(technique, "passes", len(leaders) + 1)

    def _draw(
        self, frame: Frame, ray_direction: images.Image, path: images.Image | None, records: Records, order: list[int],
        closures: images.Target, number: int, both_ways: int,
    ) -> None:  # fmt: skip
        """Evaluate materials, by their leaders, in this order."""
        if not order:
            return
        found = records.images
        shared = {f"hit_{name}": found[f"hit_{name}"] for name in RECORDS[:3]}
        shared |= {"ray_direction": ray_direction, "instances": frame.geometry.instances}
        lists = {"hit_material": found["hit_material"], "hit_materials": self._absorption_of(frame)}
        view, shader = {"film_view": frame.view_block}, None
        with passes.drawing(closures, depth_test="EQUAL", depth_write=False):
            for material in order:
                program, own = self._own_bindings(frame, material, number, both_ways)
                if ("INT", "path_known") in program.constants:
                    own["constants"]["path_known"] = int(path is not None)
                if program.textures and ("UINT_2D", "materials_met") in program.textures:
                    own["textures"]["materials_met"] = records.met
                wanted = passes.get_for(program, own["textures"])
                if wanted is shader:
                    shader.change(**own)
                else:
                    shader = wanted
                    textures, blocks = own["textures"] | shared, own["blocks"] | view
                    if ("R32F", "hit_material") in program.textures:
                        textures |= lists
                    if ("RGBA32F", "met_path") in program.textures:
                        textures["met_path"] = path or ray_direction
                    shader.bind(textures=textures, blocks=blocks, constants=own["constants"])
                passes.draw_screen(shader)
                self._compiled.add(_program_key(frame.materials.compiled[material]))

    def _own_bindings(self, frame: Frame, material: int, number: int, both_ways: int) -> tuple[Program, dict]:
        """The program of a material, and what it binds besides records, rays, instances and the view."""
        compiled = frame.materials.compiled[material]
        constants: dict[str, object] = {"material_depth": depth_of(material), "material_number": material}
        if len(compiled.images) > MOST_IMAGES:
            textures = {"reflectance": self._mean_reflectance(frame)}
            return MEAN, {"textures": textures, "blocks": {}, "constants": constants}
        bound = frame.materials.bindings(
            material, frame.geometry.instances, own=False, shared=may_share(compiled)
        )  # fmt: skip
        textures = {name: image for name, image in bound["textures"].items() if name != "instances"}
        if _has_relief(compiled):
            textures |= frame.materials.own_images[material]
        if compiled.attributes:
            textures["hit_attributes"] = self._attributes_of(material, compiled)
        constants |= {"ray_number": number, "glass_bends": (1 + both_ways) * int(refracts(frame))}
        return hit_program(compiled), {"textures": textures, "blocks": bound["blocks"], "constants": constants}

    # What is shaded ---------------------------------------------------------------------------------------------------

    def _to_shade(self, frame: Frame, hierarchy: Hierarchy, records: Records, path: str) -> set[int]:
        """Materials that are to be evaluated at these records: all that the rays may have met, without asking which,
        once their programs exist; else those that they have met."""
        possible = self._possible_of(frame, hierarchy, path)
        if len(possible) <= MOST_UNASKED:
            unknown = {_program_key(frame.materials.compiled[k]) for k in possible} - self._compiled
            if self._asked is None:
                self._asked = weakref.ref(frame)
            elif (
                unknown
                and self._asked() is not frame
                and (frame.settings.schedule.may_rebuild or self._ahead is not frame.view)
            ):
                self._ahead = frame.view  # one for each picture that has to move at once
                unknown -= unknown if frame.settings.schedule.may_rebuild else {min(unknown)}
            if not unknown:
                if len({frame.materials.leaders[k] for k in possible}) > MOST_UNFLAGGED:
                    self._flag_met(frame, records)
                else:
                    if not records.all_met:
                        records.met.texture.clear(format="UINT", value=(1,))
                    records.all_met, self._flagged = True, False
                return possible
        self._flag_met(frame, records)
        # Beyond the scene's materials the image holds what others left there, where a driver clears late.
        return possible & set(np.flatnonzero(images.read(records.met)[:MET_ROWS]).tolist())

    def _flag_met(self, frame: Frame, records: Records) -> None:
        """Write flags of the materials of these records."""
        self._flagged, records.all_met = True, False
        records.met.texture.clear(format="UINT", value=(0,))
        textures = {name: records.images[name] for name in ("hit_place", "hit_material")}
        textures |= {"rays": self._rays, "hit_materials": self._absorption_of(frame)}
        passes.compute(MATERIALS_MET, records.target.size, textures=textures, images={"met": records.met})

    def _possible_of(self, frame: Frame, hierarchy: Hierarchy, path: str) -> set[int]:
        """Materials of triangles that rays of a path can meet."""
        key = (path, hierarchy.leaves, frame.geometry.changes, frame.materials.fingerprint())
        if self._possible is None or self._possible[0] != key:
            meshes, found = frame.geometry.placed[1], set()
            for mesh, slots in {
                (one.mesh, one.materials) for one in hierarchy.instances if getattr(one.visibility, path)
            }:
                found.update(np.unique(meshes[mesh].triangle_materials(slots)).tolist())
            shown = {k for k in found if not frame.materials.compiled[k].bounds_alone}
            self._possible = (key, shown)
        return self._possible[1]

    def owners(self, frame: Frame, hierarchy: Hierarchy) -> tuple[images.Image, int]:
        """For shaders that ask which instance a triangle is of: the image of `owners`, and the leaf that it begins
        with."""
        return self._owners_of(frame, hierarchy), hierarchy.first_leaf - _leaves_of_rows(hierarchy)

    def numbered(self, frame: Frame, instance: Instance) -> list[tuple[int, int, np.ndarray]]:
        """Of each material of an instance: which, the number of its first triangle, and which triangles those are."""
        self._number(frame)
        mesh = frame.geometry.placed[1][instance.mesh]
        of_triangle = mesh.triangle_materials(instance.materials)
        return [
            (material, kind.first, np.flatnonzero(of_triangle == material))
            for material, kinds in self._kinds.items()
            for kind in kinds
            if kind.mesh is mesh and kind.slots == instance.materials
        ]

    # What stands behind triangles -----------------------------------------------------------------------------------

    def _owners_of(self, frame: Frame, hierarchy: Hierarchy) -> images.Image:
        """The instance's row and the triangle's number, by slot of the leaves; before them, where trees are shared,
        the rows of the hierarchy's instances."""
        key = (hierarchy.leaves, hierarchy.instances, frame.geometry.changes)
        known = self._owners.get(key)
        if known is None:
            self._number(frame)
            rows = {id(instance): row for row, instance in enumerate(frame.geometry.placed[0])}
            of_instances = np.array([rows.get(id(one), 0) for one in hierarchy.instances], np.float32)
            # Where an object has moved it is another instance, in the same row.
            same = [k for k in self._owners if k[0] is hierarchy.leaves and self._owners[k][:2] == (
                of_instances.tobytes(), self._numbers_key
            )]  # fmt: skip
            image = self._owners.pop(same[0])[2] if same else self._owners_image(frame, hierarchy, of_instances)
            known = of_instances.tobytes(), self._numbers_key, image
            self._owners = dict([*self._owners.items()][-3:]) | {key: known}
        return known[2]

    def _owners_image(self, frame: Frame, hierarchy: Hierarchy, of_instances: np.ndarray) -> images.Image:
        meshes, parts = frame.geometry.placed[1], []
        row = dict(zip(map(id, hierarchy.instances), of_instances))
        shown = [one for one in hierarchy.expanded if meshes[one.mesh].triangle_count]
        for kind, group in groupby(shown, lambda one: (one.mesh, meshes[one.mesh].version, one.materials)):
            numbers, copies = self._numbers[kind], [row[id(one)] for one in group]
            of_copies = np.empty((len(copies), len(numbers), 2), np.float32)
            of_copies[:, :, 0], of_copies[:, :, 1] = np.array(copies)[:, None], numbers
            parts.append(of_copies.reshape(-1, 2))
        slots = [hierarchy.slots, *(of_mesh for _, of_mesh in hierarchy.shared)]
        for one, _ in hierarchy.shared:
            numbers = self._numbers[one.mesh, meshes[one.mesh].version, one.materials]
            parts.append(np.stack([np.zeros_like(numbers), numbers], axis=1))
        found = np.concatenate(parts) if parts else np.zeros((0, 2), np.float32)
        slots, first = np.concatenate(slots), acceleration.LEAF * _leaves_of_rows(hierarchy)
        height = max(-(-(first + int(slots.max(initial=0)) + 1) // images.LIST_WIDTH), 1)
        listed = np.zeros((height * images.LIST_WIDTH, 2), np.float32)
        if first:
            listed[: len(of_instances), 0] = of_instances
        listed[first + slots[slots >= 0]] = found[slots >= 0]
        return images.upload(listed.reshape(height, images.LIST_WIDTH, 2), "RG32F")

    def _number(self, frame: Frame) -> None:
        """Number the triangles of each material over all meshes that show it."""
        instances, meshes, _ = frame.geometry.placed
        wanted = dict.fromkeys((one.mesh, meshes[one.mesh].version, one.materials) for one in instances)
        if self._numbers_key == tuple(wanted):
            return
        counts: dict[int, int] = {}
        self._numbers, self._kinds = {}, {}
        for key, _, slots in wanted:
            mesh = meshes[key]
            of_triangle = mesh.triangle_materials(slots)
            numbers = np.zeros(len(of_triangle))
            for material in np.unique(of_triangle):
                own = of_triangle == material
                first = counts.get(int(material), 0)
                numbers[own] = first + np.arange(own.sum())
                counts[int(material)] = first + int(own.sum())
                self._kinds.setdefault(int(material), []).append(_Kind(mesh, slots, first))
            self._numbers[key, mesh.version, slots] = numbers
        self._numbers_key = tuple(wanted)

    def _attributes_of(self, material: int, compiled: CompiledMaterial) -> images.Image:
        """Places and attributes of the corners of all triangles of a material, by their number."""
        kinds = self._kinds[material]
        key = (compiled.attributes, tuple((kind.mesh.key, kind.mesh.version, kind.slots) for kind in kinds))
        known = self._attributes.get(material)
        if known is None or known[0] != key:
            rows = []
            for kind in kinds:
                mesh = kind.mesh
                corners = mesh.triangle_corners[mesh.triangle_materials(kind.slots) == material]
                places = np.zeros((len(mesh.corner_vertices), 4), np.float32)
                places[:, :3] = mesh.positions[mesh.corner_vertices]
                values = [places, *(corner_attribute(mesh, attribute) for attribute in compiled.attributes)]
                rows.append(np.stack(values, axis=1)[corners].reshape(-1, 4))
            known = self._attributes[material] = (key, images.upload_list(np.concatenate(rows)))
        return known[1]

    def _absorption_of(self, frame: Frame) -> images.Image:
        """By material: what insides of solids absorb, per metre; which material leads those of its program, and where
        its values begin among theirs."""
        materials = frame.materials
        inside = [absorbed_inside(material) for material in materials.compiled]
        key = (*inside, *materials.leaders, *materials.first_rows)
        if self._absorption is None or self._absorption[0] != key:
            table = np.zeros((-(-max(len(inside), 1) // ROW) * ROW, 4), np.float32)
            for k, absorbed in enumerate(inside[:MOST_MATERIALS]):
                table[k, :3] = absorbed
                table[k, 3] = materials.leaders[k] + (materials.first_rows[k] << LEADER_BITS)
            image = images.upload(table.reshape(-1, ROW, 4))
            image.defines = defines_of_absorption(table[:, :3])
            self._absorption = (key, image)
        return self._absorption[1]

    @staticmethod
    def _mean_reflectance(frame: Frame) -> images.Image:
        frame.kept(Reflectance).update(frame)
        return frame.kept(Reflectance).image

    def release(self) -> None:
        """Drop GPU resources."""
        self.__init__()


def absorbed_inside(material: CompiledMaterial) -> tuple[float, float, float]:
    """What solids of a material absorb, per metre, as shaders/trace/solid.glsl asks for it: -1 of clear glass."""
    absorbed = material.absorbed_inside
    return absorbed if any(absorbed) else (-1.0 if material.glass else 0.0,) * 3


def defines_of_absorption(per_metre: np.ndarray) -> tuple[tuple[str, str], ...]:
    """What programs that follow rays define where solids absorb: they look back from what stands in one, by a ray."""
    return (("ABSORBING", "1"),) if (per_metre > 0.0).any() else ()


def pixel_spread(frame: Frame) -> float:
    """How much wider a pixel's footprint is a metre farther away; of an orthographic camera it stays."""
    left, right, _, _ = frame.view.frame()
    return 0.0 if frame.snapshot.camera.kind == "ORTHOGRAPHIC" else (right - left) / frame.size[0]


MOST_PROGRAMS = 1024  # of which the texts are kept
_programs: dict[str, Program] = {}  # by topology
