"""Materials that displace the surface: vertices moved at their own density, or relief in a shell over the mesh.

Cycles' setting of a material says what its displacement moves: the normal (Bump Only), the surface (Displacement Only),
or both. A normal is bent by the material's program itself. A surface is moved in one of two ways:

- **mesh**: every vertex by the vector that the tree gives there, before anything else sees the mesh, as Cycles does
  where it does not subdivide. The tree is known as a program only, so it runs on the GPU, once for each vertex, into a
  list that is read back. A vertex belongs to the first triangle that has it, normals are anew those of the moved
  triangles, and of smooth faces their mean at a vertex.
- **relief**: the mesh stays coarse and what is drawn is a shell over it, in which each fragment searches for the
  surface (shaders/surface/relief.glsl). Rays that run no shader meet the mesh at the relief's lowest level.

Auto moves vertices where the mesh is fine enough: where heights interpolated between its vertices differ from the
tree's at points within the triangles by no more than COARSE of the range of heights (root mean square).

| cost | once per material, mesh and shape of an instance |
|---|---|
| draws | 1 of all vertices, and 1 of SAMPLES points per kind of instance, as points of one pixel |
| readback | 16 bytes a point |
| bytes | a moved mesh has three corners of its own per triangle |

Bias: instances of one mesh share what its first one gives, as in Cycles. Of heights the least and most are those at
SAMPLES points and what the margin adds; what rises above is cut off. Bumps within the heights count as flat.

Fails: at sharp edges of a mesh shells part, as faces do that Cycles displaces along their own normals.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np

from ..gfx import geometry as gfx_geometry
from ..gfx import images, passes
from ..gfx.library import Program
from ..gfx.struct import Block
from ..materials.attributes import INSTANCE
from ..materials.compiled import Attribute, CompiledMaterial, OwnSurface
from ..materials.expressions import MAX_ATTRIBUTES
from ..materials.nodes.inputs import FLAT
from ..snapshot.scene import Instance, Mesh, Note, Snapshot
from .geometry import TEXELS_PER_INSTANCE, attribute_rows, corner_attribute, instance_facts
from .materials import EVERY_DEFINES, MATERIAL_SCENE, MaterialSet, caster_like
from .shells import corner_list
from .subdivision import subdivided

OWNER = "relief"  # the technique whose parameters these are
AUTO, BUMP, MESH, RELIEF = "AUTO", "BUMP", "MESH", "RELIEF"
PLACE_BEFORE, NORMAL_BEFORE = ".before", ".normal_before"  # attributes of corners, in object space
BEFORE = (Attribute("NAMED", PLACE_BEFORE), Attribute("NAMED", NORMAL_BEFORE))
FALSE_POSITION, INTERVAL, BISECTION = "FALSE_POSITION", "INTERVAL", "BISECTION"
DEFAULTS = {"mode": AUTO, "search": FALSE_POSITION, "steps": 64, "refinements": 4, "safe": False}
SEARCHES = {FALSE_POSITION: 0, INTERVAL: 1, BISECTION: 2}

SAMPLES = 1 << 14  # points of a kind of instance and material at which heights are looked at
COARSE = 0.04  # of the range of heights, see above
FEW_PIECES, MOST_PIECES = 500, 50_000  # triangles of a mesh that is cut for what scatters light below its surface
FINE = 0.01  # of the range of heights, by which such pieces err at most
MARGIN = 0.02  # of the range, above and below what was found
THINNEST = 5e-5  # of the extent of a mesh
APART = 8  # instances of a kind whose range is looked at
MIRRORING = ("Anisotropic", "Metallic", "Glass", "Refraction", "Principled")  # after ShaderNodeBsdf
SHARP = 0.15  # roughness up to which an outline in a mirror can be told
MOST_IMAGES = 11  # of a material, beside the list of the shell and what programs add


def own_of(own: tuple[tuple[str, object], ...], name: str):
    """A parameter of the relief technique, from a material's own settings."""
    return dict(own).get(f"{OWNER}_{name}", DEFAULTS[name])


def mode_of(material) -> str:
    """What a material of the snapshot is to be displaced by: BUMP, MESH, RELIEF or, by its mesh, AUTO."""
    if material.graph.displacement is None:
        return BUMP
    mode = own_of(material.own, "mode")
    return mode if mode != AUTO or material.graph.displacement_method != "BUMP" else BUMP


def _mirrors(graph) -> bool:
    """Whether a tree has a node that shows sharp reflections of other things."""
    return any(
        node.type.removeprefix("ShaderNodeBsdf") in MIRRORING
        and (rough := node.inputs.get("Roughness")) is not None
        and rough.link is None
        and isinstance(rough.value, (int, float))
        and rough.value < SHARP
        for node in graph.nodes.values()
    )


@dataclass(frozen=True)
class Measured:
    """What a material does to the triangles of one kind of instance that have it."""

    vertices: np.ndarray  # (N,) of the mesh
    offsets: np.ndarray  # (N, 3) float32 displacement in object space
    low: float  # least and most height, m in world space
    high: float
    error: float  # of heights between vertices, root mean square, of that range
    slope: float  # steepest rise between neighbouring samples, m per m
    thinnest: float  # m, that float32 tells apart with room to spare: what a shell around a plane has for thickness


_versions = itertools.count(1 << 40)  # of displaced meshes: no mesh that is read from Blender ever has one of these
Kind = tuple[str, tuple[int, ...]]  # mesh and materials


class Displacement:
    """Applies what materials displace to snapshots, and keeps what it has made until something changes."""

    def __init__(self):
        self._measured: dict[object, Measured] = {}
        self._meshes: dict[object, Mesh] = {}
        self._pieces: dict[object, tuple[Measured, Mesh]] = {}
        self._cut: set[int] = set()  # materials whose meshes are cut into pieces that carry their heights
        self._instances: dict[int, tuple[Instance, Instance]] = {}
        self._lists: dict[int, tuple[object, images.Image]] = {}
        self._scene: Block | None = None
        self.modes: dict[int, str] = {}  # by material: MESH or RELIEF
        self.errors: dict[int, float] = {}  # the worst, see Measured
        self.notes: tuple[Note, ...] = ()

    def apply(self, snapshot: Snapshot, materials: MaterialSet) -> Snapshot:
        """The snapshot with displaced meshes. In `materials` the programs of what is displaced are changed to fit."""
        asked = {k: mode_of(m) for k, m in enumerate(snapshot.materials) if materials.compiled[k].displaces}
        asked = {k: mode for k, mode in asked.items() if mode != BUMP}
        self.modes, self.errors, self.notes = {}, {}, ()
        kinds = self._kinds(snapshot, set(asked))
        if not kinds:
            self._measured, self._meshes, self._instances, self._lists, self._pieces = {}, {}, {}, {}, {}
            return snapshot
        materials.upload_textures()
        measured = self._measure(snapshot, materials, kinds, set(asked))
        self._decide(snapshot, materials, asked, measured)
        if self._cut:
            before = self._measured
            snapshot = self._with_pieces(snapshot, materials, kinds, measured)
            measured = self._measure(snapshot, materials, kinds, set(asked))
            self._measured = before | self._measured
        return self._applied(snapshot, materials, kinds, measured)

    def release(self) -> None:
        """Drop GPU resources."""
        self.__init__()

    @staticmethod
    def _kinds(snapshot: Snapshot, asked: set[int]) -> dict[Kind, list[Instance]]:
        """Instances that show such a material, by kind."""
        found: dict[Kind, list[Instance]] = {}
        for one in snapshot.instances if asked else ():
            if asked.intersection(one.materials) and np.isfinite(one.matrix).all():
                found.setdefault((one.mesh, one.materials), []).append(one)
        return {kind: ones for kind, ones in found.items() if snapshot.meshes[kind[0]].triangle_count}

    def _measure(self, snapshot: Snapshot, materials: MaterialSet, kinds, asked: set[int]) -> dict:
        """Measured by (kind, material)."""
        prints, found, known = materials.fingerprint(), {}, {}
        count = len(materials.compiled)
        for kind, instances in kinds.items():
            mesh = snapshot.meshes[kind[0]]
            of_triangle = mesh.triangle_materials(kind[1])
            for k in sorted(asked.intersection(np.unique(of_triangle).tolist())):
                compiled = materials.compiled[k]
                some = _different(instances, INSTANCE in compiled.reads)
                turned = not compiled.along_normal  # a vector may keep its direction when the object turns
                places = tuple(
                    one.matrix.tobytes() if compiled.reads else one.matrix[:3, :3].tobytes() if turned
                    else _shape_of(one) for one in some
                )  # fmt: skip
                facts = tuple((one.random, one.color, one.pass_index) for one in some) if compiled.reads else ()
                key = (mesh.key, mesh.version, kind[1], k, prints[k], prints[count:], places, facts)
                known[key] = self._measured.get(key) or self._measured_of(materials, k, mesh, of_triangle == k, some)
                found[kind, k] = known[key]
        self._measured = known
        return found

    def _measured_of(self, materials, k: int, mesh: Mesh, own: np.ndarray, instances: list[Instance]) -> Measured:
        corners = mesh.triangle_corners[own].reshape(-1)
        vertices, first = np.unique(mesh.corner_vertices[corners], return_index=True)
        attributes = [corner_attribute(mesh, attribute) for attribute in materials.compiled[k].attributes]
        at_corners = [mesh.positions[mesh.corner_vertices], mesh.corner_normals, *attributes]
        moved = self._evaluated(materials, k, instances[0], [values[corners[first]] for values in at_corners])
        triangle, weights = _samples(mesh, own)
        between = [np.einsum("nc,ncd->nd", weights, values[triangle]) for values in at_corners]
        sampled = [self._evaluated(materials, k, one, between) for one in instances]
        heights = np.concatenate([moved[:, 3], *(one[:, 3] for one in sampled)])
        low, high = float(heights.min()), float(heights.max())
        at_vertex = np.zeros(len(mesh.positions), np.float32)
        at_vertex[vertices] = moved[:, 3]
        across = np.einsum("nc,nc->n", weights, at_vertex[mesh.corner_vertices[triangle]])
        error = float(np.sqrt(np.mean((across - sampled[0][:, 3]) ** 2))) / max(high - low, 1e-30)
        slope = self._slope(materials, k, mesh, instances[0], at_corners, triangle, weights)
        turned = np.linalg.pinv(instances[0].matrix[:3, :3])
        offsets = (moved[:, :3] @ turned.T).astype(np.float32)
        return Measured(vertices, offsets, low, high, error, slope, THINNEST * _extent(mesh, instances))

    def _slope(self, materials, k: int, mesh: Mesh, instance: Instance, at_corners, triangle, weights) -> float:
        """Steepest rise found over steps of a hundredth of a triangle."""
        step = np.array([0.01, -0.01, 0.0])
        inside = np.clip(weights, 0.02, None)
        inside /= inside.sum(axis=1, keepdims=True)
        ends = []
        for weight in (inside, inside + step, inside + step[[2, 0, 1]]):
            values = [np.einsum("nc,ncd->nd", weight, one[triangle]) for one in at_corners]
            place = values[0] @ instance.matrix[:3, :3].T
            ends.append((place, self._evaluated(materials, k, instance, values)[:, 3]))
        (here, h), *others = ends
        rises = [np.abs(g - h) / np.maximum(np.linalg.norm(p - here, axis=1), 1e-30) for p, g in others]
        return float(np.max(rises)) if len(triangle) else 0.0

    def _evaluated(self, materials: MaterialSet, k: int, instance: Instance, values: list[np.ndarray]) -> np.ndarray:
        """(N, 4) displacement in world space and its part along the normal, at places, normals and attributes."""
        count = len(values[0])
        height = max(-(-count // images.LIST_WIDTH), 1)
        names = ("position", "normal", *(f"attribute{n}" for n in range(len(values) - 2)))
        buffer = gfx_geometry.vertex_buffer(**dict(zip(names, values)), number=np.arange(count, dtype=np.int32))
        batch = gfx_geometry.point_batch(buffer)
        rows = np.zeros((1, TEXELS_PER_INSTANCE, 4), np.float32)
        rows[0, :3], rows[0, 3:7] = instance.matrix[:3], instance_facts([instance])[0]
        rows[0, 3, 3] = -1.0 if np.linalg.det(instance.matrix[:3, :3]) < 0.0 else 1.0
        attributes, rows[:, 7, 1] = attribute_rows([instance], 1)
        listed = np.concatenate([rows.reshape(-1, 4), attributes])
        if self._scene is None:
            self._scene = Block(MATERIAL_SCENE, **dict.fromkeys(MATERIAL_SCENE.fields, np.zeros(4)))
        bindings = materials.bindings(k, images.upload_list(listed), own=False)
        bindings["blocks"]["material_scene"] = self._scene
        shader = passes.get(displacement_program(materials.compiled[k]))
        with images.borrowed(images.LIST_WIDTH, height, "RGBA32F") as target:
            with passes.drawing(target, depth_test="NONE", depth_write=False):
                shader.bind(**bindings, constants={"list_size": (images.LIST_WIDTH, height)})
                passes.draw_points(shader, batch)
            return images.read(target.colors[0]).reshape(-1, 4)[:count].astype(np.float64)

    def _decide(self, snapshot: Snapshot, materials: MaterialSet, asked: dict[int, str], measured: dict) -> None:
        notes, self._cut = [], set()
        for (_, k), one in measured.items():
            self.errors[k] = max(self.errors.get(k, 0.0), one.error)
        for k, error in self.errors.items():
            compiled, mode = materials.compiled[k], asked[k]
            if mode != MESH and compiled.scatter > 0.0:  # light enters and leaves where triangles are
                if error > COARSE:
                    text = "Its mesh is too coarse for its displacement and is cut finer, since light scatters below"
                    text += (
                        " it; Cycles moves only the vertices there are. Subdivide it, or choose Mesh, for its picture."
                    )
                    notes.append(Note(f"Material '{compiled.name}'", text, compiled.name))
                    self._cut.add(k)
                mode = MESH
            elif mode == AUTO:
                mode = RELIEF if error > COARSE and compiled.along_normal else MESH
                if mode == RELIEF:
                    text = "Its mesh is too coarse for its displacement and is drawn as relief, with all detail; Cycles"
                    text += " moves only the vertices there are. Subdivide it, or choose Mesh, for the same picture."
                    notes.append(Note(f"Material '{compiled.name}'", text, compiled.name))
            elif mode == RELIEF and not compiled.along_normal:
                text = "Relief needs a Displacement node without a normal of its own; its vertices are moved instead."
                notes.append(Note(f"Material '{compiled.name}'", text, compiled.name))
                mode = MESH
            if mode == RELIEF and len(compiled.images) > MOST_IMAGES:
                text = f"Relief has room for {MOST_IMAGES} images; the material's vertices are moved instead."
                notes.append(Note(f"Material '{compiled.name}'", text, compiled.name))
                mode = MESH
            if mode == RELIEF and any(_mirrors(snapshot.materials[index].graph) for index in snapshot.used_materials):
                text = "Mirrors and glass show its relief without outline and shadow: subdivide its mesh for both."
                notes.append(Note(f"Material '{compiled.name}'", text, compiled.name))
            self.modes[k] = mode
        self.notes = tuple(notes)

    def _with_pieces(self, snapshot: Snapshot, materials: MaterialSet, kinds, measured: dict) -> Snapshot:
        """The snapshot with meshes of `_cut` subdivided until heights between vertices err by FINE at most, or there
        are MOST_PIECES."""
        meshes, kept = dict(snapshot.meshes), {}
        for (kind, k), one in measured.items():
            if k not in self._cut or one.error <= COARSE:
                continue
            mesh = snapshot.meshes[kind[0]]
            key = (mesh.key, mesh.version, id(one))
            made, error = mesh, one.error
            if key in self._pieces:
                made = self._pieces[key][1]
                error = 0.0
            while error > FINE and 4 * made.triangle_count <= MOST_PIECES:
                made = replace(subdivided(made), version=next(_versions))
                if made.triangle_count >= FEW_PIECES:
                    own = made.triangle_materials(kind[1]) == k
                    error = self._measured_of(materials, k, made, own, kinds[kind][:1]).error
            kept[key] = (one, made)
            if made.triangle_count > meshes[mesh.key].triangle_count:
                meshes[mesh.key] = made
        self._pieces = kept
        return replace(snapshot, meshes=meshes)

    def _applied(self, snapshot: Snapshot, materials: MaterialSet, kinds, measured) -> Snapshot:
        self._change_programs(snapshot, materials, measured)
        numbers, parts = self._numbers(snapshot, kinds, measured)
        meshes, made, taken = dict(snapshot.meshes), {}, set()
        users: dict[str, set] = {}
        for one in snapshot.instances:
            users.setdefault(one.mesh, set()).add(one.materials)
        names: dict[Kind, str] = {}
        for kind in kinds:
            mesh = snapshot.meshes[kind[0]]
            own = {k: measured[kind, k] for k in kind[1] if (kind, k) in measured}
            name = mesh.key if len(users[mesh.key]) == 1 else f"{mesh.key} displaced {len(taken)}"
            taken.add(name)
            first = tuple((k, numbers[kind, k]) for k in own if (kind, k) in numbers)
            levels = tuple((k, self.modes[k], self._levels[k]) for k in own)
            key = (name, mesh.version, kind[1], first, levels, tuple(id(one) for one in own.values()))
            made[key] = self._meshes.get(key) or self._moved(name, mesh, kind, own, first, kinds[kind][0])
            meshes[name], names[kind] = made[key], name
        self._meshes = made
        self._upload(materials, parts)
        instances = tuple(self._renamed(one, names) for one in snapshot.instances)
        alive = {id(one) for one in snapshot.instances}
        self._instances = {key: pair for key, pair in self._instances.items() if key in alive}
        shown = {one.mesh for one in instances}
        meshes = {key: mesh for key, mesh in meshes.items() if key in shown or key in snapshot.meshes}
        return replace(snapshot, meshes=meshes, instances=instances, notes=(*snapshot.notes, *self.notes))

    def _renamed(self, one: Instance, names: dict[Kind, str]) -> Instance:
        name = names.get((one.mesh, one.materials), one.mesh)
        if name == one.mesh:
            return one
        known = self._instances.get(id(one))
        if known is None or known[0] is not one or known[1].mesh != name:
            known = self._instances[id(one)] = (one, replace(one, mesh=name))
        return known[1]

    def _change_programs(self, snapshot: Snapshot, materials: MaterialSet, measured) -> None:
        ranges: dict[int, list[Measured]] = {}
        for (_, k), one in measured.items():
            ranges.setdefault(k, []).append(one)
        self._levels: dict[int, tuple[float, float, float]] = {}
        for k, ones in ranges.items():
            low, high = min(one.low for one in ones), max(one.high for one in ones)
            margin = MARGIN * (high - low) + max(one.thinnest for one in ones)
            self._levels[k] = low - margin, high + margin, max(one.slope for one in ones)
            compiled = materials.compiled[k]
            if self.modes[k] == MESH:
                materials.compiled[k] = _moved_program(compiled, self._bumps(snapshot, materials, k))
            else:
                materials.compiled[k] = replace(
                    compiled, own_surface=relief_surface(compiled), casts_stochastically=True
                )
        self._settings = {k: snapshot.materials[k].own for k in ranges}
        if ranges:
            materials.share()  # what is moved or relief is drawn by other programs than before

    @staticmethod
    def _bumps(snapshot: Snapshot, materials: MaterialSet, k: int) -> bool:
        """Whether moved vertices have the normals of the tree's own detail, for which there must be room."""
        room = len(materials.compiled[k].attributes) + len(BEFORE) <= MAX_ATTRIBUTES
        return snapshot.materials[k].graph.displacement_method == "BOTH" and room

    def _numbers(self, snapshot: Snapshot, kinds, measured) -> tuple[dict, dict[int, list]]:
        """First number of the triangles of (kind, material) in the material's list; (mesh, triangles) by material."""
        numbers, parts, count = {}, {}, {}
        for kind in kinds:
            mesh = snapshot.meshes[kind[0]]
            of_triangle = mesh.triangle_materials(kind[1])
            for k in dict.fromkeys(kind[1]):
                if (kind, k) in measured and self.modes[k] == RELIEF:
                    own = of_triangle == k
                    numbers[kind, k] = count.get(k, 0)
                    count[k] = numbers[kind, k] + int(own.sum())
                    parts.setdefault(k, []).append((mesh, own, kind))
        return numbers, parts

    def _upload(self, materials: MaterialSet, parts: dict[int, list]) -> None:
        kept = {}
        for k, of_material in parts.items():
            low, high, slope = self._levels[k]
            own = self._settings[k]
            search = SEARCHES[own_of(own, "search")]
            head = np.array(
                [(low, high, own_of(own, "steps"), search), (own_of(own, "refinements"), 0.0, slope, 0.0)], np.float32
            )
            head[1, 1] = float(bool(own_of(own, "safe")))
            attributes = materials.compiled[k].attributes
            key = (head.tobytes(), attributes, tuple((m.key, m.version, kind) for m, _, kind in of_material))
            known = self._lists.get(k)
            if known is None or known[0] != key:
                rows = [corner_list(mesh, own, attributes) for mesh, own, _ in of_material]
                known = (key, images.upload_list(np.concatenate([head, *rows])))
            kept[k] = known
            materials.own_images[k] = {"shell_corners": known[1]}
        self._lists = kept

    def _moved(self, name: str, mesh: Mesh, kind: Kind, own: dict[int, Measured], first, instance: Instance) -> Mesh:
        """The mesh with its vertices where they are displaced to, and those of relief at its lowest level."""
        offsets = np.zeros(mesh.positions.shape, np.float32)
        high = np.zeros_like(offsets)
        normals = None
        # Of a vertex that several materials share the first one decides.
        for k, one in sorted(own.items(), reverse=True):
            if self.modes[k] == MESH:
                offsets[one.vertices] = high[one.vertices] = one.offsets
                continue
            normals = vertex_means(mesh) if normals is None else normals
            world = _world_normals(instance, normals[one.vertices])
            back = np.linalg.pinv(instance.matrix[:3, :3]).T
            offsets[one.vertices] = (world * self._levels[k][0]) @ back
            high[one.vertices] = (world * self._levels[k][1]) @ back
        positions = (mesh.positions + offsets).astype(np.float32)
        used = mesh.corner_vertices[mesh.triangle_corners].reshape(-1)
        ends = [mesh.positions[used], positions[used], (mesh.positions + high)[used]]
        low_end = np.min([end.min(axis=0) for end in ends], axis=0).astype(np.float64)
        high_end = np.max([end.max(axis=0) for end in ends], axis=0).astype(np.float64)
        moved = replace(
            mesh, key=name, version=next(_versions), positions=positions, bounds_min=low_end, bounds_max=high_end
        )
        if any(self.modes[k] == MESH for k in own):
            before = {PLACE_BEFORE: mesh.positions[mesh.corner_vertices], NORMAL_BEFORE: mesh.corner_normals}
            before = {name: np.pad(values, ((0, 0), (0, 1))) for name, values in before.items()}
            moved = replace(moved, colors=moved.colors | before)
            moved = with_new_normals(moved, np.any(offsets != 0.0, axis=1))
        return replace(moved, undisplaced=mesh, shells=first) if first else moved


def _different(instances: list[Instance], apart: bool) -> list[Instance]:
    """Those of a kind whose heights are looked at: the first, the smallest and the largest, or as many as APART."""
    if apart and len(instances) > 1:
        return instances[:APART]
    size = [abs(np.linalg.det(one.matrix[:3, :3])) for one in instances]
    chosen = dict.fromkeys((0, int(np.argmin(size)), int(np.argmax(size))))
    return [instances[k] for k in chosen if k == 0 or abs(size[k] - size[0]) > 1e-3 * size[0]]


def _shape_of(instance: Instance) -> tuple[float, ...]:
    """Equal for instances that differ in where they stand and how they are turned: lengths and angles of their axes."""
    axes = instance.matrix[:3, :3]
    gram = axes.T @ axes
    size = float(np.trace(gram)) or 1.0
    shape = (gram / size)[np.triu_indices(3)]
    return (*np.round(shape, 6).tolist(), float(f"{size:.6g}"), float(np.sign(np.linalg.det(axes))))


def _extent(mesh: Mesh, instances: list[Instance]) -> float:
    """Of the largest of the instances, or how far off it is, as far as that costs digits, m."""
    size = np.linalg.norm(mesh.bounds_max - mesh.bounds_min)
    scales = [np.linalg.norm(one.matrix[:3, :3], 2) for one in instances]
    off = [np.abs(one.matrix[:3, 3]).max() for one in instances]
    return float(max(size * max(scales), 0.01 * max(off), 1e-30))


def _samples(mesh: Mesh, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) corners of triangles chosen by area, and barycentric weights of a point of each: the same every time."""
    corners = mesh.triangle_corners[own]
    a, b, c = np.moveaxis(mesh.positions[mesh.corner_vertices[corners]].astype(np.float64), 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    total = np.cumsum(area)
    # Additive recurrences, evenly spread at any count (golden ratio's relatives of one and two dimensions).
    n = np.arange(SAMPLES)
    if total[-1] > 0.0:
        chosen = np.minimum(np.searchsorted(total, (n + 0.5) / SAMPLES * total[-1]), len(area) - 1)
    else:
        chosen = n % len(area)
    u, v = (n * 0.7548776662466927) % 1.0, (n * 0.5698402909980532) % 1.0
    root = np.sqrt(u)
    weights = np.stack([1.0 - root, root * (1.0 - v), root * v], axis=1)
    return corners[chosen], weights


def vertex_means(mesh: Mesh) -> np.ndarray:
    """(V, 3) mean normals of the corners at each vertex."""
    total = np.zeros(mesh.positions.shape)
    corners = mesh.triangle_corners.reshape(-1)
    for axis in range(3):
        total[:, axis] = np.bincount(
            mesh.corner_vertices[corners], mesh.corner_normals[corners, axis], len(mesh.positions)
        )
    return total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-30)


def _world_normals(instance: Instance, normals: np.ndarray) -> np.ndarray:
    turned = normals @ np.linalg.pinv(instance.matrix[:3, :3])
    return turned / np.maximum(np.linalg.norm(turned, axis=1, keepdims=True), 1e-30)


def with_new_normals(mesh: Mesh, moved: np.ndarray) -> Mesh:
    """The mesh with three corners of its own for each triangle, and normals of where its vertices are now: of flat
    faces the triangle's, of smooth ones the mean over the triangles at a vertex, all of the same weight, as in Cycles.
    What touches none of the `moved` (V,) vertices keeps its normals."""
    source = mesh.triangle_corners.reshape(-1)
    vertices = mesh.corner_vertices[source]
    a, b, c = np.moveaxis(mesh.positions[vertices].reshape(-1, 3, 3).astype(np.float64), 1, 0)
    across = np.cross(b - a, c - a)
    length = np.linalg.norm(across, axis=1, keepdims=True)
    own = np.repeat(across / np.where(length > 0.0, length, 1.0), 3, axis=0)
    mean = np.zeros(mesh.positions.shape)
    for axis in range(3):
        mean[:, axis] = np.bincount(vertices, own[:, axis], len(mesh.positions))
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-30)
    flat = mesh.colors[FLAT][source, 0] > 0.5 if FLAT in mesh.colors else np.zeros(len(source), bool)
    near = np.repeat(moved[vertices].reshape(-1, 3).any(axis=1), 3)
    # A smooth face beside a moved one turns with the vertex that they share.
    touched = np.zeros(len(mesh.positions), bool)
    touched[vertices[near]] = True
    normals = np.where(flat[:, None], own, mean[vertices])
    keep = ~np.where(flat, near, touched[vertices]) | ~normals.any(axis=1)
    normals = np.where(keep[:, None], mesh.corner_normals[source], normals).astype(np.float32)
    return replace(
        mesh,
        corner_vertices=np.ascontiguousarray(vertices),
        corner_normals=normals,
        triangle_corners=np.arange(len(source), dtype=np.int32).reshape(-1, 3),
        uv_maps={name: values[source] for name, values in mesh.uv_maps.items()},
        colors={name: values[source] for name, values in mesh.colors.items()},
        tangents={name: values[source] for name, values in mesh.tangents.items()},
    )


def _moved_program(compiled: CompiledMaterial, bumps: bool) -> CompiledMaterial:
    """Of a material whose vertices have been moved."""
    count, lines, attributes = len(compiled.attributes), ["#define DISPLACED 1"], compiled.attributes
    if bumps:
        lines += [f"#define UNDISPLACED_PLACE {count}", f"#define UNDISPLACED_NORMAL {count + 1}"]
        attributes = (*attributes, *BEFORE)
    key = f"{'b' if bumps else 'm'}{compiled.program_key}"
    return replace(compiled, glsl="\n".join([*lines, compiled.glsl]), attributes=attributes, program_key=key)


def displacement_program(compiled: CompiledMaterial) -> Program:
    """Asks a material for its displacement at points of a list."""
    like = caster_like(replace(compiled, own_surface=None))
    return replace(
        like,
        name=f"displacement {compiled.program_key[:8]}",
        vertex="surface/displacement.vert.glsl",
        fragment="surface/displacement.frag.glsl",
        inputs=(*(one for one in like.inputs if one[1] not in ("envelope", "local_instance")), ("INT", "number")),
        outputs=(("VEC4", "out_displacement"),),
        constants=(("VEC2", "list_size"),),
        defines=EVERY_DEFINES,
    )


def relief_surface(compiled: CompiledMaterial) -> OwnSurface:
    """The search in the shell for a material's surface."""
    count = len(compiled.attributes)
    lines = [
        f"#define SHELL_STRIDE {3 * (2 + count)}", "", "void shell_attributes(inout SurfacePoint point, int base)", "{",
    ]  # fmt: skip
    for k in range(count):
        lines += [
            f"  point.attributes[{k}] = shell_texel(base + {2 + k});",
            f"  point.attributes_dx[{k}] = shell_texel(base + {4 + count + k}) - point.attributes[{k}];",
            f"  point.attributes_dy[{k}] = shell_texel(base + {6 + 2 * count + k}) - point.attributes[{k}];",
        ]
    lines += ["}", '#include "surface/relief.glsl"']
    text = '#include "surface/shell.glsl"\n' + "\n".join(lines) + "\n"
    return OwnSurface(text, (("RGBA32F", "shell_corners"),), shell=True, lets_pass=compiled.casts_stochastically)
