"""The snapshot's geometry on the GPU: vertex buffers by mesh, transforms in one image, draws by material.

Meshes that are shown many times are drawn as instances. Meshes shown once would cost one draw call each in every
pass, so neighbours are joined: one vertex buffer, one draw per material, and each vertex knows its instance.
Instances, too, are drawn in groups of neighbours, so that a depth map leaves out the groups that it does not see.
Transforms always come from the instance image, so moving an object uploads a few numbers: what few instances have that
moved is drawn into the image, as parts of a texture cannot be uploaded through Blender. Their order is kept meanwhile.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from ..gfx import geometry as gfx_geometry
from ..gfx import images, passes
from ..gfx.struct import Block, Struct
from ..kernels.morton import morton_codes
from ..materials.compiled import Attribute, CompiledMaterial
from ..snapshot.scene import Instance, Mesh, Snapshot
from . import casters
from .corners import corner_attribute
from .culling import Boxes, closed
from .envelope import corner_shapes
from .shells import prisms

LARGE, STEPS = 256.0, 16  # m: scenes beyond it are cut into so many places for the origin
CAMERA_FLAG, SHADOW_FLAG, DIFFUSE_FLAG, GLOSSY_FLAG, HOLDOUT_FLAG = 1, 2, 4, 8, 16
TRANSMISSION_FLAG = 32  # no shader asks for it, but the frame begins anew when it changes
TEXELS_PER_INSTANCE = 8  # layout in shaders/lib/instance.glsl
MOST_MOVED = 32  # instances; for more the whole list is uploaded, sorted anew
JOINED_TRIANGLES = 2000  # about so many triangles of joined meshes make one draw: enough to fill a GPU, few to cull
FEW_DRAWS = 4  # of casters, which need not be joined
GROUP_TRIANGLES = 600  # the same for groups of instances


MOVED = Struct("MovedInstance", ("vec4", f"texel[{TEXELS_PER_INSTANCE}]"))
MOVE = passes.fullscreen_program(
    "moved instance",
    "surface/moved_instance.frag.glsl",
    blocks=((MOVED, "moved"),),
    constants=(("INT", "first"),),
    outputs=(("VEC4", "out_texel"),),
)


@dataclass(frozen=True)
class Draw:
    """Triangles of one material: `count` instances from `first` on (joined meshes: one draw, instance per vertex)."""

    material: int
    batch: gfx_geometry.Batch
    first: int
    count: int
    low: np.ndarray  # (3,) bounds relative to the render origin
    high: np.ndarray
    closed: bool = False  # casters only: every mesh in it bounds a volume and faces outwards
    prisms: bool = False  # a shell (shells.py) of objects that are not mirrored: back faces show where rays leave it

    @property
    def triangles(self) -> int:
        return self.batch.triangles * self.count


@dataclass
class _Buffers:
    """Corner arrays of one mesh, or of several joined ones, ready for the GPU."""

    positions: np.ndarray  # (C, 3)
    normals: np.ndarray
    instance: np.ndarray  # (C,) int32 instance within the draw
    meshes: list[Mesh]


class SceneGeometry:
    """Geometry of a snapshot on the GPU. `update` brings it to a new snapshot and uploads what differs."""

    def __init__(self):
        self.origin = np.zeros(3)
        self.bounds_min = np.zeros(3)  # of all instances, world space, float64
        self.bounds_max = np.zeros(3)
        self.size = 1.0  # diagonal of the bounds in metres; 1 for an empty scene
        self.instances: images.Image | None = None
        self.draws: list[Draw] = []  # by material, corner attributes: surfaces, and casters with alpha
        self.opaque_casters: list[Draw] = []  # positions only, materials ignored
        self.boxes = self.caster_boxes = Boxes.of([])  # of the draws, and of the opaque casters
        self.caster_triangles = np.zeros(0)  # of each opaque caster
        # Instances with triangles, by their rows in `instances`; meshes; materials.
        self.placed: tuple[list[Instance], dict[str, Mesh], list[CompiledMaterial]] = ([], {}, [])
        self.changes = 0  # updates that changed anything: what was drawn of the same number still stands
        self.drawn = 0  # the same for which meshes and materials instances show, wherever they stand
        self.uploads = 0  # meshes uploaded since the start; tests assert on its growth
        self._draw_key = None
        self._any = False  # whether there is any instance
        self._told: tuple = (None, ())  # the instances of the last update, and what of meshes and materials was asked
        self.instance_rows = np.zeros((0, TEXELS_PER_INSTANCE, 4), np.float32)
        self.attribute_rows = np.zeros((0, 4), np.float32)  # behind them, what nodes read of objects and instancers
        self._order: list[int] = []  # of the snapshot's instances with triangles
        self._kinds: tuple = ()
        self._matrices = np.zeros((0, 4, 4))
        self._written: list[Instance] = []  # those whose facts stand in `instance_rows`
        self._moved: list[Block] = []
        self._mesh_draws: dict = {}
        self._closed: dict[tuple[str, int], bool] = {}
        self._together: tuple[int, list[casters.Together]] = (-1, [])
        self._chunks: tuple[int, tuple | None] = (-1, None)
        self._counted = (-1, 0)
        self._clusters: tuple[int, list[casters.Clusters] | None] = (-1, None)

    @property
    def triangles(self) -> int:
        if self._counted[0] != self.drawn:
            self._counted = (self.drawn, sum(draw.triangles for draw in self.draws))
        return self._counted[1]

    def update(self, snapshot: Snapshot, materials: list[CompiledMaterial]) -> bool:
        """True if anything was uploaded. `materials` runs parallel to snapshot.materials."""
        told = (
            tuple((key, mesh.version) for key, mesh in snapshot.meshes.items()),
            tuple((m.attributes, m.casts_stochastically, _in_shell(m)) for m in materials),
        )
        known = snapshot.instances is self._told[0] and told == self._told[1]
        if known and np.array_equal(self.origin, self._origin(snapshot.camera)):  # the camera alone has moved
            self.placed = (self.placed[0], snapshot.meshes, materials)
            return False
        self._told = (None, ())  # until they are there
        changed = self._update(snapshot, materials)
        self._told = (snapshot.instances, told)
        return changed

    def _update(self, snapshot: Snapshot, materials: list[CompiledMaterial]) -> bool:
        instances = [i for i in snapshot.instances if snapshot.meshes[i.mesh].triangle_count]
        instances = self._ordered(instances)
        changed = self._update_transforms(instances, snapshot)
        key = (
            tuple((i.mesh, snapshot.meshes[i.mesh].version, i.materials) for i in instances),
            tuple((m.attributes, m.casts_stochastically, _in_shell(m)) for m in materials),
        )
        self.placed = (instances, snapshot.meshes, materials)
        self.changes += changed or key != self._draw_key
        if key == self._draw_key:
            if changed:
                self._set_bounds()
            return changed
        self._draw_key = None  # until they are there
        self.drawn += 1
        self._make_draws(instances, snapshot.meshes, materials)
        self._draw_key = key
        return True

    @property
    def instance_bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """(N, 3) ends of the boxes of the placed instances, relative to the origin."""
        return self._low - self.origin, self._high - self.origin

    def rows_showing(self, material: int) -> bytes:
        """What the instance image holds of the instances that show a material."""
        shown = [k for k, instance in enumerate(self.placed[0]) if material in instance.materials]
        return self.instance_rows[shown].tobytes() + self.attribute_rows.tobytes()

    def resting_casters(self, make: bool = True) -> list[casters.Clusters] | None:
        """Opaque casters in world space; None where there are too many. They are made when first asked for; without
        `make` None where they have not been."""
        if self._clusters[0] != self.changes:
            if not make:
                return None
            self._clusters = (self.changes, casters.clusters(*self.placed, self.origin))
        return self._clusters[1]

    def casters_together(self) -> tuple[list[tuple[casters.Together, slice]], Boxes, np.ndarray] | None:
        """Opaque casters in few batches, each with its part of all chunks; the boxes of those, and (C,) whether back
        faces of a chunk may be left out. None where there are too many triangles, or few draws anyhow."""
        if len(self.opaque_casters) <= FEW_DRAWS:
            return None
        if self._together[0] != self.drawn:
            self._together = (self.drawn, casters.together(*self.placed, self._shell))
            self._chunks = (-1, None)
        if not self._together[1]:
            return None
        if self._chunks[0] != self.changes:
            low, high, count = *self.instance_bounds, 0
            lows, highs, closed, parts = [], [], [], []
            for one in self._together[1]:
                lows.append(np.minimum.reduceat(low[one.rows], one.edges))
                highs.append(np.maximum.reduceat(high[one.rows], one.edges))
                closed.append(~np.maximum.reduceat(self._mirrored[one.rows], one.edges) & one.closed)
                parts.append((one, slice(count, count + len(one.edges))))
                count += len(one.edges)
            boxes = Boxes.between(np.concatenate(lows), np.concatenate(highs))
            self._chunks = (self.changes, (parts, boxes, np.concatenate(closed)))
        return self._chunks[1]

    def is_closed(self, mesh: Mesh) -> bool:
        """Whether a mesh that is shown bounds a volume and faces outwards."""
        return self._closed[mesh.key, mesh.version]

    def _ordered(self, instances: list[Instance]) -> list[Instance]:
        """Equal ones together, neighbours beside each other; as before while only a few have moved."""
        kinds = tuple((i.mesh, i.materials) for i in instances)
        matrices = _stacked([i.matrix for i in instances], (4, 4))
        if kinds != self._kinds or (matrices != self._matrices).any(axis=(1, 2)).sum() > MOST_MOVED:
            place = _neighbourhood(instances)
            # Not by the mesh's name, which holds a number of this session: random choices depend on the order.
            first = {mesh: k for k, mesh in enumerate(dict.fromkeys(mesh for mesh, _ in kinds))}
            of_kind = {kind: (first[kind[0]], kind[1]) for kind in set(kinds)}
            rank = {kind: k for k, kind in enumerate(sorted(of_kind, key=of_kind.__getitem__))}
            self._order = np.lexsort((place, [rank[kind] for kind in kinds])).tolist()
            self._kinds, self._matrices = kinds, matrices
        return [instances[k] for k in self._order]

    def _where_seen(self, camera) -> np.ndarray:
        """The camera's place; of an orthographic one, which may stand anywhere, before the middle of the scene."""
        middle = (self.bounds_min + self.bounds_max) / 2
        if camera is None:
            return middle
        place, forward = camera.matrix[:3, 3], -camera.matrix[:3, 2]
        if camera.kind != "ORTHOGRAPHIC" or not np.isfinite(middle).all():
            return place
        return place + forward * np.clip((middle - place) @ forward, camera.clip_start, camera.clip_end)

    def _origin(self, camera) -> np.ndarray:
        """Near the camera, where float32 has most digits; snapping keeps the origin, and with it all uploads, over
        small moves. In a landscape the steps are smaller: at its rim float32 knows a place to .2 mm only."""
        step = np.clip(self.size / STEPS, min(self.size, LARGE), self.size)
        grid = 2.0 ** np.ceil(np.log2(step)) if self._any else 1.0
        return np.round(self._where_seen(camera) / grid) * grid

    def _update_transforms(self, instances: list[Instance], snapshot: Snapshot) -> bool:
        if not instances:
            self.bounds_min = self.bounds_max = np.zeros(3)
            matrices = np.zeros((0, 4, 4))
            self._mirrored = np.zeros(0, bool)
        else:
            matrices = _stacked([i.matrix for i in instances], (4, 4)).astype(np.float64)
            finite = np.isfinite(matrices).all(axis=(1, 2))
            matrices[~finite] = np.diag([0.0, 0.0, 0.0, 1.0])
            number = {mesh: k for k, mesh in enumerate(dict.fromkeys(i.mesh for i in instances))}
            own = np.array([number[i.mesh] for i in instances])
            low, high = (
                np.stack([getattr(snapshot.meshes[mesh], name) for mesh in number])[own]
                for name in ("bounds_min", "bounds_max")
            )
            centre, half = (low + high) / 2, (high - low) / 2
            world = np.einsum("nij,nj->ni", matrices[:, :3, :3], centre) + matrices[:, :3, 3]
            reach = np.einsum("nij,nj->ni", np.abs(matrices[:, :3, :3]), half)
            self._low, self._high = world - reach, world + reach  # per instance
            self.bounds_min, self.bounds_max = self._low.min(axis=0), self._high.max(axis=0)
        diagonal = float(np.linalg.norm(self.bounds_max - self.bounds_min))
        self.size = diagonal if diagonal > 0.0 else 1.0
        self._any = bool(instances)
        self.origin = self._origin(snapshot.camera)
        rows = np.zeros((max(len(instances), 1), TEXELS_PER_INSTANCE, 4), np.float32)
        if len(self._written) == len(instances) and len(self.instance_rows) == len(rows):
            rows[:, 3:] = self.instance_rows[:, 3:]
        else:
            self._written = [None] * len(instances)
        new = [k for k, (instance, written) in enumerate(zip(instances, self._written)) if instance is not written]
        if new:
            rows[new, 3:7] = instance_facts([instances[k] for k in new])
            rows[new, 7, 0] = [instances[k].links.receiver for k in new]
        self._written = instances
        attributes, rows[: len(instances), 7, 1] = attribute_rows(instances, len(rows))
        if len(instances):
            users = Counter(instance.mesh for instance in instances)
            rows[:, 6, 2] = [users[instance.mesh] > 1 for instance in instances]
            relative = matrices[:, :3, :].copy()
            relative[:, :, 3] -= self.origin
            rows[:, :3] = relative
            self._mirrored = np.linalg.det(matrices[:, :3, :3]) < 0.0
            rows[:, 3, 3] = np.where(self._mirrored, -1.0, 1.0)
        before, self.instance_rows = self.instance_rows, rows
        attributes_before, self.attribute_rows = self.attribute_rows, attributes
        listed = np.concatenate([rows.reshape(-1, 4), attributes])
        if rows.shape != before.shape or not np.array_equal(attributes, attributes_before):
            self.instances = images.upload_list(listed)
            return True
        changed = np.flatnonzero((rows != before).any(axis=(1, 2)))
        if len(changed) > MOST_MOVED:
            self.instances = images.upload_list(listed)
        else:
            self._move(changed)
        return len(changed) > 0

    def _move(self, changed: np.ndarray) -> None:
        """Draw the rows of these instances into the list."""
        target = images.Target((self.instances,))
        while len(self._moved) < len(changed):
            self._moved.append(Block(MOVED, texel=np.zeros((TEXELS_PER_INSTANCE, 4))))
        for k, block in zip(changed, self._moved):
            block.update(texel=self.instance_rows[k])
            y, x = divmod(int(k) * TEXELS_PER_INSTANCE, images.LIST_WIDTH)
            viewport = (x, y, TEXELS_PER_INSTANCE, 1)
            passes.fullscreen(MOVE, target, viewport=viewport, blocks={"moved": block}, constants={"first": x})

    def _make_draws(self, instances: list[Instance], meshes: dict[str, Mesh], materials: list[CompiledMaterial]):
        runs: list[tuple[int, int]] = []  # first, count of equal (mesh, materials)
        for k, instance in enumerate(instances):
            if runs and (instances[runs[-1][0]].mesh, instances[runs[-1][0]].materials) == (
                instance.mesh,
                instance.materials,
            ):
                runs[-1] = (runs[-1][0], runs[-1][1] + 1)
            else:
                runs.append((k, 1))
        shell = self._shells(instances, meshes, materials)
        joined = [first for first, count in runs if count == 1]
        made: dict = {}  # key -> (parts for the buffers, [(first, count, instances covered)])
        closed_groups = _by_size([k for k in joined if shell[k]], instances, meshes)
        for group in closed_groups + _by_size([k for k in joined if not shell[k]], instances, meshes):
            parts = [(k, meshes[instances[k].mesh], instances[k].materials) for k in group]
            key = ("joined", tuple((k, mesh.key, mesh.version, slots) for k, mesh, slots in parts))
            made[key] = (parts, [(0, 1, group)])
        for first, count in runs:
            if count > 1:
                mesh, slots = meshes[instances[first].mesh], instances[first].materials
                step = max(1, GROUP_TRIANGLES // mesh.triangle_count)
                starts = range(first, first + count, step)
                spans = [(k, min(step, first + count - k)) for k in starts]
                made[(mesh.key, mesh.version, slots)] = (
                    [(0, mesh, slots)],
                    [(k, length, list(range(k, k + length))) for k, length in spans],
                )
        attributes = tuple((m.attributes, m.casts_stochastically, _in_shell(m)) for m in materials)
        self._shell = shell
        self._plan: list[tuple[list[int], int, object, int, int, bool]] = []
        kept = {}
        for key, (parts, spans) in made.items():
            cached = self._mesh_draws.get((key, attributes))
            if cached is None:
                self.uploads += len(parts)
                cached = _draws_of(parts, materials)
            kept[(key, attributes)] = cached
            surfaces, casters = cached
            for first, count, covered in spans:
                for material, batch in surfaces:
                    shown = [k for k in covered if material in instances[k].materials]
                    self._plan.append((shown or covered, material, batch, first, count, False))
                self._plan += [(covered, -1, batch, first, count, True) for batch in casters]
        self._plan.sort(key=lambda entry: entry[1])
        self._mesh_draws = kept
        self._set_bounds()

    def _set_bounds(self) -> None:
        """Make the draws with the bounds of the instances that each covers."""
        self.draws, self.opaque_casters = [], []
        materials = self.placed[2]
        for covered, material, batch, first, count, caster in self._plan:
            low = self._low[covered].min(axis=0) - self.origin
            high = self._high[covered].max(axis=0) - self.origin
            if caster:
                one_sided = bool(self._shell[covered].all() and not self._mirrored[covered].any())
                self.opaque_casters.append(Draw(material, batch, first, count, low, high, one_sided))
            else:
                prisms = _in_shell(materials[material]) and not self._mirrored[covered].any()
                self.draws.append(Draw(material, batch, first, count, low, high, prisms=prisms))
        self.boxes, self.caster_boxes = Boxes.of(self.draws), Boxes.of(self.opaque_casters)
        self.caster_triangles = np.array([draw.triangles for draw in self.opaque_casters], float)

    def _shells(self, instances: list[Instance], meshes: dict[str, Mesh], materials: list[CompiledMaterial]):
        """(N,) whether an instance is opaque all over and its mesh bounds a volume."""
        kept = {}
        shell = np.zeros(len(instances), bool)
        of_kind: dict[tuple, bool] = {}
        for k, instance in enumerate(instances):
            kind = instance.mesh, instance.materials
            if kind not in of_kind:
                mesh = meshes[instance.mesh]
                key = (mesh.key, mesh.version)
                if key not in kept:
                    kept[key] = self._closed[key] if key in self._closed else _closed(mesh)
                of_kind[kind] = kept[key] and not any(
                    materials[slot].casts_stochastically for slot in instance.materials
                )
            shell[k] = of_kind[kind]
        self._closed = kept
        return shell

    def release(self) -> None:
        self.__init__()


def instance_facts(instances: list[Instance]) -> np.ndarray:
    """(N, 4, 4) what the instance image holds of each beside its matrix; what depends on others is 0."""
    rows = np.zeros((len(instances), 4, 4), np.float32)
    flags: dict[tuple[int, bool], int] = {}
    for one in {(id(i.visibility), i.holdout): i for i in instances}.values():
        seen = one.visibility
        flags[id(seen), one.holdout] = (
            CAMERA_FLAG * seen.camera + SHADOW_FLAG * seen.shadow + DIFFUSE_FLAG * seen.diffuse
            + GLOSSY_FLAG * seen.glossy + HOLDOUT_FLAG * one.holdout + TRANSMISSION_FLAG * seen.transmission
        )  # fmt: skip
    rows[:, 0, :3] = [(i.random, i.pass_index, flags[id(i.visibility), i.holdout]) for i in instances]
    rows[:, 1] = [i.color for i in instances]
    rows[:, 2, :3] = [i.generated for i in instances]
    rows[:, 2, 3], rows[:, 3, 0] = np.array([i.uv for i in instances], np.float64).T
    rows[:, 3, 1] = [i.terminator for i in instances]
    return rows


def attribute_rows(instances: list[Instance], after: int) -> tuple[np.ndarray, np.ndarray]:
    """(T, 4) attributes of instances, alike ones once, and (N,) where those of each begin, behind the rows of `after`
    instances; 0 for instances without."""
    first: dict[tuple, int] = {(): 0}
    texels: list[tuple] = []
    for own in {instance.attributes: None for instance in instances}:
        if own:
            first[own] = after * TEXELS_PER_INSTANCE + len(texels)
            texels += own
    if not texels:
        return np.zeros((0, 4), np.float32), np.zeros(len(instances))
    return np.array(texels, np.float32), np.array([first[instance.attributes] for instance in instances])


def _stacked(arrays: list[np.ndarray], shape: tuple[int, ...]) -> np.ndarray:
    """np.stack, faster for thousands of small arrays."""
    return np.concatenate(arrays).reshape(-1, *shape) if arrays else np.zeros((0, *shape))


def _closed(mesh: Mesh) -> bool:
    return closed(mesh.positions, mesh.corner_vertices[mesh.triangle_corners])


def _neighbourhood(instances: list[Instance]) -> np.ndarray:
    """(N,) numbers that are close for instances that are close: Morton codes of their places."""
    if not instances:
        return np.zeros(0)
    places = np.stack([instance.matrix[:3, 3] for instance in instances])
    return morton_codes(np.nan_to_num(places, posinf=0.0, neginf=0.0))


def _by_size(indices: list[int], instances: list[Instance], meshes: dict[str, Mesh]) -> list[list[int]]:
    """Groups of neighbours among `indices` of about JOINED_TRIANGLES triangles each."""
    place = _neighbourhood([instances[k] for k in indices])
    groups, size = [], JOINED_TRIANGLES
    for position in np.argsort(place, kind="stable"):
        k = indices[position]
        if size >= JOINED_TRIANGLES:
            groups.append([])
            size = 0
        groups[-1].append(k)
        size += meshes[instances[k].mesh].triangle_count
    return groups


def _draws_of(parts: list[tuple[int, Mesh, tuple[int, ...]]], materials: list[CompiledMaterial]):
    """GPU batches of meshes in one buffer: [(material, batch)], and position-only batches of what is opaque."""
    corner_start = np.cumsum([0] + [len(mesh.corner_vertices) for _, mesh, _ in parts])
    vertex_start = np.cumsum([0] + [len(mesh.positions) for _, mesh, _ in parts])
    triangle_material = np.concatenate([mesh.triangle_materials(slots) for _, mesh, slots in parts])
    corners = np.concatenate([mesh.triangle_corners + start for (_, mesh, _), start in zip(parts, corner_start)])
    places = np.concatenate([mesh.positions[mesh.corner_vertices] for _, mesh, _ in parts])
    normals = np.concatenate([mesh.corner_normals for _, mesh, _ in parts])
    surface_vertices = gfx_geometry.vertex_buffer(
        position=places,
        normal=normals,
        envelope=corner_shapes((mesh for _, mesh, _ in parts), places, normals, corners),
        local_instance=np.concatenate([np.full(len(mesh.corner_vertices), k, np.int32) for k, mesh, _ in parts]),
    )
    surfaces = []
    extra: dict[tuple[int, Attribute], object] = {}
    for material in np.unique(triangle_material):
        if _in_shell(materials[material]):
            surfaces.append((int(material), _shell_batch(parts, int(material))))
            continue
        batch = gfx_geometry.triangle_batch(surface_vertices, corners[triangle_material == material])
        for slot, attribute in enumerate(materials[material].attributes):
            if (slot, attribute) not in extra:
                data = np.concatenate([corner_attribute(mesh, attribute) for _, mesh, _ in parts])
                extra[slot, attribute] = gfx_geometry.vertex_buffer(**{f"attribute{slot}": data})
            batch.handle.vertbuf_add(extra[slot, attribute])
        surfaces.append((int(material), batch))

    opaque = ~np.array([material.casts_stochastically for material in materials])[triangle_material]
    if not opaque.any():
        return surfaces, []
    vertices = gfx_geometry.vertex_buffer(
        position=np.concatenate([mesh.positions for _, mesh, _ in parts]),
        local_instance=np.concatenate([np.full(len(mesh.positions), k, np.int32) for k, mesh, _ in parts]),
    )
    indices = np.concatenate(
        [mesh.corner_vertices[mesh.triangle_corners] + start for (_, mesh, _), start in zip(parts, vertex_start)]
    )
    return surfaces, [gfx_geometry.triangle_batch(vertices, indices[opaque])]


def _in_shell(material: CompiledMaterial) -> bool:
    return material.own_surface is not None and material.own_surface.shell


def _shell_batch(parts: list[tuple[int, Mesh, tuple[int, ...]]], material: int) -> gfx_geometry.Batch:
    """Prisms over the triangles of a material, as the undisplaced mesh has them."""
    vertices, triangles, count = [], [], 0
    for k, mesh, slots in parts:
        own = mesh.triangle_materials(slots) == material
        if own.any():
            made, faces = prisms(mesh.undisplaced or mesh, own, dict(mesh.shells).get(material, 0))
            made["local_instance"] = np.full(len(made["position"]), k, np.int32)
            vertices.append(made)
            triangles.append(faces + count)
            count += len(made["position"])
    joined = {name: np.concatenate([one[name] for one in vertices]) for name in vertices[0]}
    return gfx_geometry.triangle_batch(gfx_geometry.vertex_buffer(**joined), np.concatenate(triangles))
