"""Media on the GPU: a table of what fills each volume, their boundaries as a tree, and grids of those that vary.

A medium is the world's, that of a mesh (one for each instance and volume material), or an OpenVDB object. What is the
same everywhere is a row of the table. A tree that varies is evaluated once at the centres of a grid of cells over its
object (shaders/media/bake.frag.glsl) and read interpolated: `RESOLUTION` cells along the longest side of a mesh, the
voxels themselves of an OpenVDB object. Any number of media may overlap or stand in each other: their coefficients add.

Media of glass are left to the technique that follows light through it (techniques/traced_refraction.py).

| cost | |
|---|---|
| bake | one evaluation of the tree per cell, when tree or object change |
| memory | 48 bytes per cell; 13 texels per medium; the boundaries' tree as in acceleration.py |

Bias: detail finer than a cell is lost; a tree of the world is known within the scene's bounds, and goes on beyond them
as at their rim. More than MOST_MEDIA are not drawn.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import numpy as np

from ..gfx import images, passes
from ..gfx.library import Program
from ..gfx.struct import Block, Struct
from ..materials.compiled import CompiledMaterial
from ..materials.graph import Graph
from ..materials.volume import PHASES, Medium
from ..materials.volume_program import CompiledVolume, compile_volume, reads_camera
from ..snapshot.scene import Instance, Note, Snapshot, Visibility, Volume
from .acceleration import Tree
from .materials import MATERIAL_SCENE, values_block, values_struct
from .textures import upload_texture

MOST_MEDIA = 30
MEDIUM_TEXELS = 13  # layout in shaders/media/media.glsl
MOST_BOXES = 4  # of boundaries, up to which programs meet planes in place of a tree
LARGEST_COEFFICIENT, LARGEST_EMISSION = 1e10, 1e20  # per metre: what float32 can still multiply by distances
MOST_FLAT, EVEN = 1e4, 1e-4  # a box's longest side over its shortest; parts of its sides by which it may be off
MOST_CELLS = 2**23  # of all grids
MEDIA_TEXTURES = tuple(("RGBA32F", f"media_{name}") for name in ("table", "scattering", "emission"))
ATTENUATION_TEXTURES = MEDIA_TEXTURES[:1]  # what asks for transmittance alone reads these
JOIN = passes.fullscreen_program(
    "list of media and extinction",
    "media/join.frag.glsl",
    textures=(("RGBA32F", "media_list"), ("RGBA32F", "extinction")),
    constants=(("INT", "first_row"),),
    outputs=(("VEC4", "out_texel"),),
)
PLACE = Struct(
    "MediumPlace",
    *(("vec4", f"cell_{axis}") for axis in "xyz"),  # from a cell's coordinates to a place relative to the origin
    *(("vec4", f"object_{axis}") for axis in "xyz"),  # the object's matrix
    ("vec4", "color"),
    ("vec4", "facts"),  # random number, pass index, factor of all coefficients
)
_CHANGES = itertools.count(1)
CORNERS = np.array([(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
BOX = np.array([
    (0, 2, 3), (0, 3, 1), (4, 5, 7), (4, 7, 6), (0, 1, 5), (0, 5, 4),
    (2, 6, 7), (2, 7, 3), (0, 4, 6), (0, 6, 2), (1, 3, 7), (1, 7, 5),
])  # fmt: skip


ALL_RAYS = Visibility()


@dataclass(frozen=True, eq=False)
class Filled:
    """What fills one volume. `corners`: (T, 3, 3) of its boundary relative to the render origin; None: all space."""

    medium: Medium
    graph: Graph | None
    corners: np.ndarray | None
    to_world: np.ndarray  # (3, 4) from the unit box of its grid to places relative to the origin
    matrix: np.ndarray  # (3, 4) of the object
    name: str
    volume: Volume | None = None
    instance: Instance | None = None
    density: float = 1.0  # factor of all coefficients
    visibility: Visibility = ALL_RAYS  # which rays see it

    @property
    def varies(self) -> bool:
        return self.graph is not None

    @property
    def scatters(self) -> bool:
        return self.varies or bool(np.any(self.medium.scattering > 0))

    @property
    def emits(self) -> bool:
        return self.varies or bool(np.any(self.medium.emission > 0)) or self.medium.glow > 0

    @property
    def takes(self) -> bool:
        return self.scatters or bool(np.any(self.medium.absorption > 0))

    @property
    def empty(self) -> bool:
        return not (self.takes or self.emits)


def has_media(snapshot: Snapshot) -> bool:
    """Whether anything of the scene is a volume. Cheap, no GPU."""
    if snapshot.world.medium is not None or snapshot.volumes:
        return True
    used = snapshot.used_materials
    return any(snapshot.materials[k].graph.volume is not None for k in used)


def volumes_key(snapshot: Snapshot) -> tuple:
    """Equal in two snapshots if their volumes are alike, but for the places of meshes and what materials say of media
    that are the same everywhere."""
    world = snapshot.world
    return (
        world.medium and world.medium.key, world.volume,
        tuple(material.graph for material in snapshot.materials if material.graph.volume is not None),
        tuple(
            (one.volume.version, one.matrix.tobytes(), one.material, one.density, one.visibility)
            for one in snapshot.volumes
        ),
    )  # fmt: skip


def filled(snapshot: Snapshot, compiled: list[CompiledMaterial], origin: np.ndarray) -> tuple[list[Filled], list[Note]]:
    """All media of the scene, the world's first, and what is left out."""
    found, notes = [], []
    world = snapshot.world
    if world.medium is not None:
        low, high = _bounds(snapshot, origin)
        box = np.column_stack([np.diag(high - low), low])
        graph = None if world.medium.even else world.volume
        found.append(Filled(world.medium, graph, None, box, np.column_stack([np.eye(3), -origin]), "World"))
    for one in snapshot.instances:
        for material in dict.fromkeys(one.materials):
            medium, mesh = compiled[material].medium, snapshot.meshes[one.mesh]
            if medium is None or compiled[material].glass is not None or not mesh.triangle_count:
                continue
            matrix = one.matrix[:3].copy()
            matrix[:, 3] -= origin
            own = mesh.triangle_materials(one.materials) == material
            places = mesh.positions @ matrix[:, :3].T + matrix[:, 3]
            corners = places[mesh.corner_vertices[mesh.triangle_corners[own]]]
            if np.linalg.det(matrix[:, :3]) < 0:
                corners = corners[:, ::-1]
            low, high = np.asarray(mesh.bounds_min, float), np.asarray(mesh.bounds_max, float)
            box = _affine(matrix, np.column_stack([np.diag(np.maximum(high - low, 1e-12)), low]))
            graph = None if medium.even else snapshot.materials[material].graph
            made = Filled(medium, graph, corners, box, matrix, one.object_name, None, one, 1.0, one.visibility)
            if not made.empty and len(corners):
                found.append(made)
    for one in snapshot.volumes:
        medium, volume = compiled[one.material].medium, one.volume
        graph = snapshot.materials[one.material].graph
        if medium is None or graph.volume is None:
            continue
        read = {attribute.name for attribute in compile_volume(one.object_name, graph, snapshot.images).attributes}
        if read.isdisjoint(volume.grids):
            text = "its material reads none of its grids: it is not drawn, as in Cycles. Name one in an Attribute node."
            notes.append(Note(f"Object '{one.object_name}'", text))
            continue
        matrix = one.matrix[:3].copy()
        matrix[:, 3] -= origin
        size, start = np.array(volume.size, float), volume.low - 0.5
        box = _affine(matrix, _affine(volume.to_object, np.column_stack([np.diag(size), start])))
        places = CORNERS @ box[:, :3].T + box[:, 3]
        corners = places[BOX]
        if np.linalg.det(box[:, :3]) < 0:
            corners = corners[:, ::-1]
        found.append(
            Filled(medium, graph, corners, box, matrix, one.object_name, volume, None, one.density, one.visibility)
        )
    if len(found) > MOST_MEDIA:
        text = f"{len(found)} volumes are more than the {MOST_MEDIA} that are drawn; the last ones are left out."
        notes.append(Note("Scene", text))
    return found[:MOST_MEDIA], notes


def box_rows(one: Filled) -> np.ndarray | None:
    """(3, 4) rows that take a place into the box of a medium's grid, 0..1 there, if its boundary is this box and faces
    outwards; else None."""
    if np.linalg.cond(one.to_world[:, :3]) > MOST_FLAT:
        return None
    rows = np.linalg.inv(np.vstack([one.to_world, (0, 0, 0, 1)]))[:3]
    corners = one.corners @ rows[:, :3].T + rows[:, 3]
    area = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area *= np.sign(np.linalg.det(rows[:, :3]))
    on_none = np.ones(len(corners), bool)
    for axis, side in itertools.product(range(3), (0, 1)):
        on = np.all(np.abs(corners[:, :, axis] - side) < EVEN, axis=1)
        on_none &= ~on
        outwards = (2 * side - 1) * area[on, axis]
        if np.any(outwards < -EVEN) or abs(outwards.sum() - 1.0) > EVEN:
            return None
    return None if on_none.any() else rows


def _affine(outer: np.ndarray, inner: np.ndarray) -> np.ndarray:
    """(3, 4) of one map after the other."""
    made = outer[:, :3] @ inner
    made[:, 3] += outer[:, 3]
    return made


def _bounds(snapshot: Snapshot, origin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Around all objects and the camera, relative to the origin."""
    matrices = np.array([one.matrix[:3] for one in snapshot.instances], float).reshape(-1, 3, 4)
    meshes = [snapshot.meshes[one.mesh] for one in snapshot.instances]
    low, high = (
        np.array([getattr(mesh, name) for mesh in meshes], float).reshape(-1, 3)
        for name in ("bounds_min", "bounds_max")
    )
    centre = np.einsum("nij,nj->ni", matrices[:, :, :3], (low + high) / 2) + matrices[:, :, 3]
    reach = np.einsum("nij,nj->ni", np.abs(matrices[:, :, :3]), (high - low) / 2)
    eye = np.zeros((0, 3)) if snapshot.camera is None else snapshot.camera.matrix[None, :3, 3]
    places = np.concatenate([centre - reach, centre + reach, eye])
    places = (places if len(places) else np.zeros((1, 3))) - origin
    low, high = places.min(axis=0), places.max(axis=0)
    spare = max(0.05 * float((high - low).max()), 1e-3)
    return low - spare, high + spare


def phase_values(medium: Medium) -> tuple[float, float, float, float]:
    """What shaders/media/phase.glsl needs of a medium beside its anisotropy."""
    index, backscatter, alpha, diameter = medium.phase_values
    if medium.phase == "DRAINE":
        return alpha, 0.0, 0.0, 0.0
    if medium.phase == "FOURNIER_FORAND":
        return fournier_forand(index, backscatter)
    return mie(diameter) if medium.phase == "MIE" else (0.0, 0.0, 0.0, 0.0)


def fournier_forand(index: float, backscatter: float) -> tuple[float, float, float, float]:
    """Index, exponent and weight of the tail from the share that is scattered backwards (Fournier & Jonasz 1999)."""
    index = max(index, 1.0 + 1e-4)
    square = (index - 1.0) ** 2
    d90, d180 = 2.0 / (3.0 * square), 4.0 / (3.0 * square)
    share = float(np.clip(backscatter, 1e-4, 0.499))
    exponent = -np.log(max(2.0 * share * (d90 - 1.0) + 1.0, 1e-9)) / np.log(d90)
    return index, float(exponent), float((d180**-exponent - 1.0) / (d180 - 1.0)), 0.0


def mie(diameter: float) -> tuple[float, float, float, float]:
    """Anisotropy of Henyey & Greenstein's lobe, anisotropy and alpha of Draine's, its weight, for droplets of a
    diameter in micrometres (Jendersie & d'Eon 2023, equations 4 to 16)."""
    d = float(np.clip(diameter, 0.0, 50.0))
    if d <= 0.1:
        weight = 0.252977 - 312.983 * d**4.3
        return 13.8 * d * d, 1.1456 * d * np.sin(9.29044 * d), 250.0, weight
    log = np.log(d)
    if d < 1.5:
        turn = (log - 0.238604) * (log + 1.00667) / (0.507522 - 0.15677 * log)
        return (
            0.862 - 0.143 * log * log,
            0.379685 * np.cos(1.19692 * np.cos(turn) + 1.37932 * log + 0.0625835) + 0.344213,
            250.0,
            0.146209 * np.cos(3.38707 * log + 2.11193) + 0.316072 + 0.0778917 * log,
        )
    if d < 5.0:
        return (
            0.0604931 * np.log(log) + 0.940256,
            0.500411 - 0.081287 / (-2.0 * log + np.tan(log) + 1.27551),
            7.30354 * log + 6.31675,
            0.026914 * (log - np.cos(5.68947 * (np.log(log) - 0.0292149))) + 0.376475,
        )
    return (
        np.exp(-0.0990567 / (d - 1.67154)),
        np.exp(-2.20679 / (d + 3.91029) - 0.428934),
        np.exp(3.62489 - 8.29288 / (d + 5.52825)),
        np.exp(-0.599085 / (d - 0.641583) - 0.665888),
    )


def bake_program(compiled: CompiledVolume, grids: tuple[str, ...]) -> Program:
    """Evaluates a volume tree at the cells of a grid; `grids` names the attributes that the object has."""
    fill = ""
    for k, attribute in enumerate(compiled.attributes):
        if attribute.kind == "GENERATED":
            fill += f"  point.attributes[{k}] = vec4(place, 1.0);\n"
        elif attribute.name in grids:
            slot = grids.index(attribute.name)
            fill += f"  point.attributes[{k}] = volume_grid{slot}_fetch(ivec2(gl_FragCoord.xy) - ivec2(0, grid.w));\n"
    head = "void fill_attributes(inout SurfacePoint point, vec3 place)"
    return passes.fullscreen_program(
        f"volume bake {compiled.program_key[:8]}",
        "media/bake.frag.glsl",
        textures=(
            *(("FLOAT_2D", f"material_image{slot}") for slot in range(len(compiled.images))),
            *(("RGBA32F", f"volume_grid{slot}") for slot in range(len(grids))),
        ),
        blocks=(
            (PLACE, "medium_place"), (values_struct(compiled), "material_values"), (MATERIAL_SCENE, "material_scene"),
        ),
        constants=(("IVEC4", "grid"),),
        snippets=(("generated/material", f"{compiled.glsl}\n{head}\n{{\n{fill}}}\n"),),
        outputs=(("VEC4", "out_extinction"), ("VEC4", "out_scattering"), ("VEC4", "out_emission")),
    )  # fmt: skip


@dataclass
class Media:
    """Images of the scene's media, made anew by `update` when they change."""

    found: list[Filled] = field(default_factory=list)
    notes: tuple[Note, ...] = ()
    textures: dict[str, images.Image] = field(default_factory=dict)
    cells: int = 0
    first_row: int = 0  # of the cells' extinction in the image of the table
    _key: object = None

    @property
    def scatters(self) -> bool:
        return any(one.scatters for one in self.found)

    @property
    def emits(self) -> bool:
        return any(one.emits for one in self.found)

    @property
    def endless(self) -> bool:
        """Whether one has no end and takes light everywhere: nothing comes from infinity then."""
        return any(one.corners is None and not one.varies and one.takes for one in self.found)

    def attenuation(self) -> dict[str, images.Image]:
        """What ATTENUATION_TEXTURES bind."""
        return {name: self.textures[name] for _, name in ATTENUATION_TEXTURES}

    def update(self, snapshot: Snapshot, compiled: list[CompiledMaterial], origin: np.ndarray, resolution: int) -> None:
        """Bring the images to this snapshot. `resolution`: cells along the longest side of what varies."""
        world = snapshot.world
        bound = [
            one
            for one in snapshot.instances
            if any(compiled[k].medium and not compiled[k].glass for k in one.materials)
        ]
        used = {k for one in bound for k in one.materials} | {one.material for one in snapshot.volumes}
        uneven_world = world.medium is not None and not world.medium.even
        trees = [snapshot.materials[k].graph for k in used if compiled[k].medium and not compiled[k].medium.even]
        trees += [world.volume] if uneven_world else []
        follows = snapshot.camera is not None and any(reads_camera(tree) for tree in trees)
        key = (
            world.medium and world.medium.key, world.volume if uneven_world else None,
            # Where its grid lies: a camera that moves among the objects changes nothing.
            np.concatenate(_bounds(snapshot, origin)).tobytes() if uneven_world else None,
            snapshot.camera.matrix.tobytes() if follows else None,
            tuple(id(one) for one in (snapshot.instances if uneven_world else bound)),
            tuple(
                (one.volume.key, one.volume.version, one.matrix.tobytes(), one.material, one.density, one.visibility)
                for one in snapshot.volumes
            ),
            tuple((k, _key_of(compiled[k]), snapshot.materials[k].graph) for k in sorted(used)),
            tuple((key, image.version) for key, image in snapshot.images.items()),
            tuple((key, mesh.version) for key, mesh in snapshot.meshes.items()), origin.tobytes(), resolution,
        )  # fmt: skip
        if self._key is not None and self._key[0] == key:
            return
        self._key = (key, snapshot)  # the snapshot keeps alive what is told apart by identity
        self.changes = next(_CHANGES)
        self.found, notes = filled(snapshot, compiled, origin)
        table = np.zeros((images.LIST_WIDTH, 4), np.float32)
        varying = [k for k, one in enumerate(self.found) if one.varies]
        sizes = {k: _grid_size(self.found[k], resolution) for k in varying}
        total = sum(int(np.prod(size)) for size in sizes.values())
        if total > MOST_CELLS:  # the same share of each side for all
            share = (MOST_CELLS / total) ** (1 / 3)
            sizes = {
                k: size if self.found[k].volume is not None else np.maximum((size * share).astype(int), 1)
                for k, size in sizes.items()
            }
        # Bit 0 is the world's: without one, the first number stays free.
        first = 0 if self.found and self.found[0].corners is None else 1
        tree = self._boundaries(first)
        nodes, leaves = tree.boxes.rows.reshape(-1, 4), tree.leaves.reshape(-1, 4)
        self.first_row = -(-(len(table) + len(nodes) + len(leaves)) // images.LIST_WIDTH)
        boxes = [box_rows(one) for one in self.found if one.corners is not None]
        are_boxes = 0 < len(boxes) <= MOST_BOXES and all(rows is not None for rows in boxes)
        for k, box in enumerate(boxes if are_boxes else ()):
            table[(k + 1) * MEDIUM_TEXELS + 10 : (k + 2) * MEDIUM_TEXELS] = box
        rows, self.cells = 0, 0
        jobs = []
        for k, one in enumerate(self.found):
            row = table[(k + first) * MEDIUM_TEXELS : (k + first + 1) * MEDIUM_TEXELS]
            _fill_row(row, one)
            if k in sizes:
                size = sizes[k]
                inverse = np.linalg.inv(np.vstack([one.to_world, (0, 0, 0, 1)]))[:3] * np.array(size)[:, None]
                row[4:7] = inverse
                row[7] = *size, self.first_row + rows
                row[8, 0] = min(np.linalg.norm(one.to_world[:, axis]) / size[axis] for axis in range(3))
                row[8, 1] = self.first_row
                row[0, 3] = 1.0
                jobs.append((one, size, rows))
                rows += -(-int(np.prod(size)) // images.LIST_WIDTH)
                self.cells += int(np.prod(size))
        apart = _list_seen(table, self.found, first)
        table[-1, 0] = images.LIST_WIDTH + len(nodes)  # where the leaves begin
        listed = images.upload_list(np.concatenate([table, nodes, leaves]))
        notes += self._bake(jobs, rows, listed, snapshot, origin)
        self.textures["media_table"].defines = (
            *((("MEDIA_WORLD", "1"),) if first == 0 else ()),
            *((("MEDIA_BOUNDED", "1"),) if any(one.corners is not None for one in self.found) else ()),
            *((("MEDIA_BOXES", str(len(boxes))),) if are_boxes else ()),
            *((("MEDIA_GRIDS", "1"),) if jobs else ()),
            *((("MEDIA_ONE_LOBE", "1"),) if all(one.medium.phase == PHASES[0] for one in self.found) else ()),
            *((("MEDIA_APART", "1"),) if apart else ()),
        )
        self.notes = tuple(notes)

    def _boundaries(self, first: int) -> Tree:
        bounded = [(k + first, one.corners) for k, one in enumerate(self.found) if one.corners is not None]
        corners = np.concatenate([c for _, c in bounded]) if bounded else np.zeros((0, 3, 3))
        look = np.zeros((len(corners), 8))
        look[:, 0] = 1.0  # any opacity: what is empty would be left out
        look[:, 4] = np.concatenate([np.full(len(c), k) for k, c in bounded]) if bounded else 0.0
        return Tree(corners.astype(np.float32), look)

    def _bake(
        self, jobs: list, rows: int, listed: images.Image, snapshot: Snapshot, origin: np.ndarray
    ) -> list[Note]:  # fmt: skip
        """Evaluate what varies; `listed`: table and boundaries, above which its extinction comes to stand."""
        notes: list[Note] = []
        side = (images.LIST_WIDTH, rows) if rows else (1, 1)
        extinction, scattering, emission = (images.create(*side, "RGBA32F") for _ in range(3))
        self.textures |= {"media_table": listed, "media_scattering": scattering, "media_emission": emission}
        target = images.Target((extinction, scattering, emission))
        if not rows:
            target.clear()
        for one, size, row in jobs:
            compiled = compile_volume(one.name, one.graph, snapshot.images)
            notes += [Note(f"Volume of '{one.name}'", text, node=node) for node, text in compiled.fallbacks]
            grids = tuple(one.volume.grids) if one.volume is not None else ()
            read = {attribute.name for attribute in compiled.attributes}
            grids = tuple(name for name in grids if name in read)
            textures = {
                f"material_image{k}": upload_texture(snapshot.images, key) for k, key in enumerate(compiled.images)
            }
            textures |= {f"volume_grid{k}": _upload_grid(one.volume.grids[name]) for k, name in enumerate(grids)}
            cell = one.to_world.copy()
            cell[:, :3] /= np.asarray(size, float)
            facts = one.instance
            camera = snapshot.camera.matrix[:3] if snapshot.camera is not None else np.eye(3, 4)
            axes = {"right": camera[:, 0], "up": camera[:, 1], "backward": camera[:, 2]}
            passes.fullscreen(
                bake_program(compiled, grids),
                target,
                viewport=(0, row, images.LIST_WIDTH, -(-int(np.prod(size)) // images.LIST_WIDTH)),
                textures=textures,
                blocks={
                    "medium_place": Block(
                        PLACE, cell_x=cell[0], cell_y=cell[1], cell_z=cell[2], object_x=one.matrix[0],
                        object_y=one.matrix[1], object_z=one.matrix[2], color=facts.color if facts else (1, 1, 1, 1),
                        facts=(facts.random if facts else 0, facts.pass_index if facts else 0, one.density, 0),
                    ),
                    "material_values": values_block(compiled),
                    "material_scene": Block(
                        MATERIAL_SCENE, origin=(*origin, 0.0), camera_position=(*(camera[:, 3] - origin), 0.0),
                        window=(-1, -1, 2, 2), **{f"camera_{name}": (*axis, 0.0) for name, axis in axes.items()},
                    ),
                },
                constants={"grid": (*(int(x) for x in size), row)},
            )  # fmt: skip
        if rows:
            self.textures["media_table"] = images.create(images.LIST_WIDTH, self.first_row + rows, "RGBA32F")
            passes.fullscreen(
                JOIN, images.Target((self.textures["media_table"],)),
                textures={"media_list": listed, "extinction": extinction}, constants={"first_row": self.first_row},
            )  # fmt: skip
        return notes

    def release(self) -> None:
        self.__init__()


def _key_of(material: CompiledMaterial) -> tuple | None:
    return material.medium and material.medium.key


RAYS = "camera", "shadow", "diffuse", "glossy", "transmission", "volume"  # as in shaders/media/boundary.glsl


def _list_seen(table: np.ndarray, found: list[Filled], first: int) -> bool:
    """Write into the table which media each kind of ray sees; whether any sees less than all. Bit 0 is the world's."""
    apart = False
    for kind, name in enumerate(RAYS):
        bits = 1 | sum(1 << (k + first) for k, one in enumerate(found) if getattr(one.visibility, name))
        table[-2 - kind, :2] = bits & 0x7FFF, bits >> 15
        apart |= not all(getattr(one.visibility, name) for one in found)
    return apart


def _grid_size(one: Filled, resolution: int) -> np.ndarray:
    if one.volume is not None:
        return np.array(one.volume.size)
    sides = np.linalg.norm(one.to_world[:, :3], axis=0)
    return np.clip(np.ceil(sides / max(sides.max(), 1e-30) * resolution), 1, resolution).astype(int)


def _upload_grid(grid: np.ndarray) -> images.Image:
    """(X, Y, Z) or (X, Y, Z, 3) as a list of texels, x running fastest."""
    values = grid[..., None].repeat(3, axis=-1) if grid.ndim == 3 else grid
    texels = np.ones((grid.size if grid.ndim == 3 else grid.size // 3, 4), np.float32)
    texels[:, :3] = values.transpose(2, 1, 0, 3).reshape(-1, 3)
    return images.upload_list(texels)


def _fill_row(row: np.ndarray, one: Filled) -> None:
    medium = one.medium

    def clean(values, most: float) -> np.ndarray:
        return np.clip(np.nan_to_num(np.asarray(values, float), nan=0.0, posinf=most, neginf=0.0), 0.0, most)

    scattering = clean(medium.scattering, LARGEST_COEFFICIENT)
    row[0, :3] = scattering + clean(medium.absorption, LARGEST_COEFFICIENT)
    row[1, :3] = scattering
    row[1, 3] = np.clip(np.nan_to_num(medium.anisotropy), -0.999, 0.999)
    row[2, :3] = clean(medium.emission, LARGEST_EMISSION) + clean(medium.glowing, LARGEST_EMISSION)
    row[2, 3] = PHASES.index(medium.phase)
    row[3] = phase_values(medium)
