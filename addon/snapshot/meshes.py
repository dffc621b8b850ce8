"""Evaluated meshes, hair curves and point clouds to arrays, in bulk.

Blender's attributes are copied whole, no Python loop runs over elements.

Reading and building are apart, because an unchanged mesh must be recognised (`RawMesh.digest`) before the dearer
half, triangulation and tangents, is done again. Per million triangles reading takes some 100 ms, the triangle
list of a quad mesh another 100 ms (Blender copies it element by element).
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ..materials.nodes.inputs import CORNER, FLAT, ISLAND, MARK, PLACE, POINTINESS, ROUND, STRAND, WAY
from .cache import next_version
from .hair import HairSystem, read_hair
from .scene import Mesh, Note
from .shape import corner_numbers, island_numbers, pointiness
from .strands import (
    HAIR_RADIUS,
    POINT_RADIUS,
    between,
    point_facts,
    spheres,
    strand_facts,
    strand_places,
    strand_shape,
    tubes,
)
from .tangents import corner_tangents

# Metres. Beyond it the squared length of a position overflows float32 on the GPU; such a vertex is as broken as NaN.
FARTHEST = 1e18
FOLDED = 1e-5  # 1 less the cosine between normals of a face and of its triangle, from which on they differ


@dataclass(frozen=True)
class Wanted:
    """What the materials of a mesh ask for beyond the standard arrays.

    `tangents`: UV map names, "" for the one that renders. `attributes`: names for attribute nodes. `generated`:
    coordinates of the undeformed shape.
    """

    tangents: frozenset[str] = frozenset()
    attributes: frozenset[str] = frozenset()
    generated: bool = False

    def __or__(self, other: Wanted) -> Wanted:
        return Wanted(
            self.tangents | other.tangents, self.attributes | other.attributes, self.generated or other.generated
        )

    @property
    def names(self) -> frozenset:
        names = {("tangent", name) for name in self.tangents} | {("attribute", name) for name in self.attributes}
        return frozenset(names | ({("generated", "")} if self.generated else set()))


@dataclass
class RawMesh:
    """Blender's arrays, not yet cleaned or triangulated. V vertices, C corners, F faces."""

    positions: np.ndarray  # (V, 3) float32
    corner_vertices: np.ndarray  # (C,) int32
    corner_normals: np.ndarray  # (C, 3) float32
    face_starts: np.ndarray  # (F,) int32, first corner of each face
    face_slots: np.ndarray | None  # (F,) int32; None: all faces use slot 0
    slots: int
    uv_maps: dict[str, np.ndarray] = field(default_factory=dict)
    active_uv: str = ""
    colors: dict[str, np.ndarray] = field(default_factory=dict)
    active_color: str = ""
    generated: np.ndarray | None = None  # (V, 3) float32
    flat: bool = False  # no face is smooth
    velocity: np.ndarray | None = None  # (V, 3) float32, m/s
    strands: np.ndarray | None = None  # (V, 2) float32, see strands.strand_shape

    def digest(self) -> bytes:
        """128 bits over everything that `build_mesh` uses; equal digests mean equal content."""
        state = hashlib.blake2b(digest_size=16)
        head = (self.slots, self.flat, self.active_uv, self.active_color, tuple(self.uv_maps), tuple(self.colors))
        state.update(repr((head, len(self.positions), len(self.corner_vertices), len(self.face_starts))).encode())
        arrays = [self.positions, self.corner_vertices, self.corner_normals, self.face_starts]
        arrays += [
            array for array in (self.face_slots, self.generated, self.velocity, self.strands) if array is not None
        ]
        for array in [*arrays, *self.uv_maps.values(), *self.colors.values()]:
            state.update(array.data if array.size else b"")
        return state.digest()


def read_mesh(mesh, wanted: Wanted, groups: Mapping[str, int] | None = None) -> RawMesh:
    """Copy the arrays of an evaluated Mesh, Curves or PointCloud, or of a HairSystem. A mesh must hold data, not an
    edit-mode wrapper. `groups`: indices of its object's vertex groups, which Attribute nodes may name."""
    if mesh.id_type == "HAIR":
        return _read_particle_hair(mesh, wanted)
    if mesh.id_type != "MESH":
        return _read_strands(mesh, wanted)
    corners, faces = len(mesh.loops), len(mesh.polygons)
    positions = _attribute(mesh, "position", "vector", len(mesh.vertices), np.float32, 3)
    corner_vertices = _attribute(mesh, ".corner_vert", "value", corners, np.int32, 1)
    corner_normals = np.empty((corners, 3), np.float32)
    if corners:
        mesh.corner_normals.foreach_get("vector", corner_normals.reshape(-1))
    if corners == 3 * faces:
        face_starts = np.arange(0, corners, 3, dtype=np.int32)
    else:
        face_starts = np.empty(faces, np.int32)
        mesh.polygons.foreach_get("loop_start", face_starts)
    face_slots = None
    if "material_index" in mesh.attributes:
        face_slots = _attribute(mesh, "material_index", "value", faces, np.int32, 1)
    colors, active_color = _read_colors(mesh, wanted, corner_vertices, face_starts, groups or {})
    return RawMesh(
        positions,
        corner_vertices,
        corner_normals,
        face_starts,
        face_slots,
        slots=max(1, len(mesh.materials)),
        uv_maps={
            layer.name: _finite(_attribute(mesh, layer.name, "vector", corners, np.float32, 2))
            for layer in mesh.uv_layers
        },
        active_uv=next((layer.name for layer in mesh.uv_layers if layer.active_render), ""),
        colors=colors,
        active_color=active_color,
        generated=_read_generated(mesh) if wanted.generated else None,
        flat=mesh.normals_domain == "FACE",
        velocity=_velocity(mesh, len(mesh.vertices)),
    )


def _velocity(data, count: int) -> np.ndarray | None:
    """(count, 3) of points, m/s; None where there is none."""
    attribute = data.attributes.get("velocity")
    if attribute is None or (attribute.domain, attribute.data_type) != ("POINT", "FLOAT_VECTOR") or not count:
        return None
    return _finite(_attribute(data, "velocity", "vector", count, np.float32, 3))


def _read_strands(data, wanted: Wanted) -> RawMesh:
    """Hair curves or a point cloud as triangles (see strands.py)."""
    hair = data.id_type == "CURVES"
    points = _finite(_attribute(data, "position", "vector", len(data.points), np.float32, 3))
    radii = np.full(len(points), HAIR_RADIUS if hair else POINT_RADIUS, np.float32)
    if "radius" in data.attributes:
        radii = np.maximum(_finite(_attribute(data, "radius", "value", len(points), np.float32, 1)), 0.0)
    offsets = np.zeros(1, np.int32)
    if hair:
        offsets = np.zeros(len(data.curves) + 1, np.int32)
        if len(data.curves):
            data.curve_offset_data.foreach_get("value", offsets)
        positions, normals, triangles, source = tubes(points, radii, offsets)
    else:
        positions, normals, triangles, source = spheres(points, radii)
    corners = triangles.reshape(-1)
    facts = (
        (lambda: strand_facts((positions, normals, triangles, source), points, radii, offsets))
        if hair
        else (lambda: point_facts(source, points, radii))
    )
    colors = _facts(wanted, facts, corners)
    places = strand_places(positions, source, points, offsets) if hair and wanted.attributes else None
    for name in sorted(wanted.attributes):
        attribute = data.attributes.get(name)
        values = None if attribute is None else _as_rgba(attribute)
        if values is not None:
            if attribute.domain == "CURVE":
                values = np.repeat(values, np.diff(offsets), axis=0)
            between_points = hair and attribute.domain == "POINT"
            at_vertices = between(values, places) if between_points else values[source]
            colors[name] = np.ascontiguousarray(_finite(at_vertices[corners].astype(np.float32)))
    uv_maps = {}
    if hair:  # as in Cycles, the first of them is where a strand grows, however it is called
        curve = np.searchsorted(offsets, source, side="right") - 1
        count = len(data.curves)
        for layer in data.attributes:
            if layer.data_type == "FLOAT2" and layer.domain == "CURVE" and count:
                places = _finite(_attribute(data, layer.name, "vector", count, np.float32, 2))
                uv_maps[layer.name] = np.ascontiguousarray(places[curve[corners]])
    velocity = _velocity(data, len(points))
    if velocity is not None:
        velocity = np.ascontiguousarray(velocity[source])
    generated = None
    if wanted.generated and len(positions):
        low, high = positions.min(axis=0), positions.max(axis=0)
        generated = ((positions - low) / np.maximum(high - low, 1e-30)).astype(np.float32)
    return RawMesh(
        positions, corners, normals[corners], np.arange(0, len(corners), 3, dtype=np.int32), None, slots=1,
        uv_maps=uv_maps, active_uv=next(iter(uv_maps), ""), colors=colors, generated=generated, velocity=velocity,
        strands=strand_shape((positions, normals, triangles, source), points, radii, offsets) if hair else None,
    )  # fmt: skip


def _facts(wanted: Wanted, made: Callable[[], dict[str, np.ndarray]], corners: np.ndarray) -> dict[str, np.ndarray]:
    """By corner what nodes about strands and points ask for, where they do."""
    if wanted.attributes.isdisjoint((STRAND, WAY, ROUND, PLACE, MARK)):
        return {}
    return {name: np.ascontiguousarray(_finite(values[corners])) for name, values in made().items()}


def _read_particle_hair(system: HairSystem, wanted: Wanted) -> RawMesh:
    """Strands of a particle system as triangles (see hair.py, strands.py)."""
    strands = read_hair(system)
    positions, normals, triangles, source = tubes(strands.points, strands.radii, strands.offsets)

    def facts() -> dict[str, np.ndarray]:
        return strand_facts((positions, normals, triangles, source), strands.points, strands.radii, strands.offsets)

    corners = triangles.reshape(-1)
    curve = np.searchsorted(strands.offsets, source, side="right") - 1
    return RawMesh(
        positions, corners, normals[corners], np.arange(0, len(corners), 3, dtype=np.int32), None, slots=1,
        uv_maps={name: np.ascontiguousarray(values[curve[corners]]) for name, values in strands.uv_maps.items()},
        active_uv=strands.active_uv, colors=_facts(wanted, facts, corners),
        generated=np.ascontiguousarray(strands.generated[curve]),
        strands=strand_shape((positions, normals, triangles, source), strands.points, strands.radii, strands.offsets),
    )  # fmt: skip


def build_mesh(key: str, raw: RawMesh, mesh, wanted: Wanted, subject: str) -> tuple[Mesh, tuple[Note, ...]]:
    """Triangulate, sort by material slot, clean; `mesh` is the Blender mesh that `raw` was read from.

    Triangles that touch a vertex which is not finite are left out, with a Note about `subject`.
    """
    triangles, slots = _triangulate(raw, mesh)
    positions, triangles, slots, broken = _drop_broken(raw, triangles, slots)
    notes = (_broken_note(subject, broken),) if broken else ()
    order = None if _ascending(slots) else np.argsort(slots, kind="stable")
    if order is not None:
        triangles, slots = triangles[order], slots[order]
    normals = _unit(raw.corner_normals)
    if raw.flat:
        raw, normals, triangles = _folded(raw, positions, normals, triangles)
    if ROUND in wanted.attributes and mesh.id_type == "MESH":
        raw, normals, triangles = _with_first_edges(raw, positions, normals, triangles)
    low, high = _bounds(positions, raw.corner_vertices, triangles)
    if CORNER in wanted.attributes and mesh.id_type == "MESH":
        colors = np.ones((len(raw.corner_vertices), 4), np.float32)
        colors[:, :3] = np.eye(3, dtype=np.float32)[corner_numbers(triangles, len(raw.corner_vertices))]
        raw = replace(raw, colors={**raw.colors, CORNER: colors})
    tangents = {}
    for name in sorted({name or raw.active_uv for name in wanted.tangents}):
        if name in raw.uv_maps:
            tangents[name] = corner_tangents(positions, raw.corner_vertices, normals, raw.uv_maps[name], triangles)
    made = Mesh(
        key=key,
        version=next_version(),
        positions=positions,
        corner_vertices=raw.corner_vertices,
        corner_normals=normals,
        triangle_corners=np.ascontiguousarray(triangles),
        triangle_slots=slots,
        slots=raw.slots,
        uv_maps=raw.uv_maps,
        active_uv=raw.active_uv,
        colors=raw.colors,
        active_color=raw.active_color,
        tangents=tangents,
        generated=raw.generated,
        velocity=raw.velocity,
        strands=raw.strands,
        bounds_min=low,
        bounds_max=high,
    )
    return made, notes


def _folded(raw: RawMesh, positions: np.ndarray, normals: np.ndarray, triangles: np.ndarray):
    """`raw`, its normals and triangles, with corners of their own for triangles of flat faces that are not planar.

    A face that is not smooth has the normal of its whole polygon in Blender; Cycles shades each of its triangles by the
    triangle's own.
    """
    if len(triangles) == len(raw.face_starts):
        return raw, normals, triangles
    a, b, c = np.moveaxis(positions[raw.corner_vertices[triangles]], 1, 0)
    across = np.cross(b - a, c - a)
    own = _unit(across)
    folded = (np.einsum("ij,ij->i", own, normals[triangles[:, 0]]) < 1.0 - FOLDED) & across.any(axis=1)
    if not folded.any():
        return raw, normals, triangles
    count = len(normals)
    source = np.concatenate([np.arange(count), triangles[folded].reshape(-1)])
    normals = np.concatenate([normals, np.repeat(own[folded], 3, axis=0)])
    triangles = triangles.copy()
    triangles[folded] = count + np.arange(len(source) - count, dtype=triangles.dtype).reshape(-1, 3)
    return _with_corners(raw, source), normals, triangles


def _with_corners(raw: RawMesh, source: np.ndarray) -> RawMesh:
    """`raw` with the corners `source` (C',) of its own."""
    return replace(
        raw,
        corner_vertices=raw.corner_vertices[source],
        uv_maps={name: values[source] for name, values in raw.uv_maps.items()},
        colors={name: values[source] for name, values in raw.colors.items()},
    )


def _with_first_edges(raw: RawMesh, positions: np.ndarray, normals: np.ndarray, triangles: np.ndarray):
    """`raw`, its normals and triangles, with corners of their own for all triangles, whose ROUND is the first edge.

    Along it Principled Hair has its fibre on a mesh: Cycles takes the derivative by a triangle's own first coordinate.
    """
    source = triangles.reshape(-1)
    a, b = np.moveaxis(positions[raw.corner_vertices[triangles[:, :2]]], 1, 0)
    edges = np.zeros((len(triangles), 4), np.float32)
    edges[:, :3] = b - a
    raw = _with_corners(raw, source)
    colors = {**raw.colors, ROUND: np.repeat(edges, 3, axis=0)}
    return replace(raw, colors=colors), normals[source], np.arange(len(source), dtype=triangles.dtype).reshape(-1, 3)


def _broken_note(subject: str, count: int) -> Note:
    text = f"{count} triangle(s) have a corner that is infinitely far or not a number, and are not drawn;"
    return Note(subject, f"{text} check the modifiers, or delete those vertices.")


def _attribute(mesh, name: str, field_name: str, count: int, dtype, width: int) -> np.ndarray:
    array = np.zeros(count * width, dtype)
    if count and name in mesh.attributes:
        mesh.attributes[name].data.foreach_get(field_name, array)
    return array.reshape(count, width) if width > 1 else array


def _read_generated(mesh) -> np.ndarray:
    """(V, 3) places before deformation, the mesh's texture space mapped to 0..1; an axis without extent gives 0.5."""
    places = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("undeformed_co", places)
    centre, size = np.array(mesh.texspace_location), np.array(mesh.texspace_size)
    scale = np.divide(0.5, size, out=np.zeros(3), where=size != 0.0)
    return _finite(((places.reshape(-1, 3) - centre) * scale + 0.5).astype(np.float32))


def _finite(values: np.ndarray) -> np.ndarray:
    """Zero where a geometry node has left a NaN or infinity, which a texture look-up would spread over the picture."""
    return values if np.isfinite(values).all() else np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0)


def _read_colors(
    mesh, wanted: Wanted, corner_vertices, face_starts, groups: Mapping[str, int]
) -> tuple[dict[str, np.ndarray], str]:
    """Colour attributes, other attributes and vertex groups that a node asks for, as RGBA per corner.

    Blender's `color` field already decodes byte colours from sRGB. Numbers and vectors become colours as in
    Cycles' Attribute node: a number fills RGB, a vector is RGB, alpha is 1.
    """
    colors = {}
    names = [attribute.name for attribute in mesh.color_attributes]
    index = mesh.color_attributes.render_color_index
    active = names[index] if 0 <= index < len(names) else ""
    for name in [*names, *sorted(wanted.attributes - set(names) - {layer.name for layer in mesh.uv_layers})]:
        if name in (POINTINESS, ISLAND):
            colors[name] = np.repeat(_shape(mesh, name)[corner_vertices][:, None], 4, axis=1)
            continue
        if name == FLAT:
            sharp = _attribute(mesh, "sharp_face", "value", len(face_starts), bool, 1)
            sizes = np.diff(face_starts, append=len(corner_vertices))
            colors[name] = np.repeat(np.repeat(sharp.astype(np.float32), sizes)[:, None], 4, axis=1)
            continue
        attribute = mesh.attributes.get(name)
        if attribute is None and name in groups:
            colors[name] = np.ones((len(corner_vertices), 4), np.float32)
            colors[name][:, :3] = _group_weights(mesh, groups[name])[corner_vertices][:, None]
            continue
        values = None if attribute is None else _as_rgba(attribute)
        if values is None:
            continue
        if attribute.domain == "POINT":
            values = values[corner_vertices]
        elif attribute.domain == "FACE":
            sizes = np.diff(face_starts, append=len(corner_vertices))
            values = np.repeat(values, sizes, axis=0)
        elif attribute.domain == "EDGE":
            values = _at_vertices(mesh, values, attribute.data_type)[corner_vertices]
        elif attribute.domain != "CORNER":
            continue
        colors[name] = np.ascontiguousarray(_finite(values))
    return colors, active


def _group_weights(mesh, index: int) -> np.ndarray:
    """(V,) float32 weights of a vertex group; Blender hands them out vertex by vertex: a second for a million."""
    weights = (next((one.weight for one in vertex.groups if one.group == index), 0.0) for vertex in mesh.vertices)
    return np.fromiter(weights, np.float32, len(mesh.vertices))


def _at_vertices(mesh, values: np.ndarray, kind: str) -> np.ndarray:
    """(V, 4) what edges have, (E, 4), at their vertices: means, rounded for integers; whether any does for booleans."""
    edges = np.zeros(2 * len(mesh.edges), np.int32)
    mesh.edges.foreach_get("vertices", edges)
    total = np.zeros((len(mesh.vertices), 4))
    np.add.at(total, edges, np.repeat(values, 2, axis=0))
    count = np.bincount(edges, minlength=len(total))
    means = total / np.maximum(count, 1)[:, None]
    if kind == "BOOLEAN":
        means[:, :3] = total[:, :3] > 0
    elif kind in ("INT", "INT8"):
        means = np.rint(means)
    return means.astype(np.float32)


def _shape(mesh, name: str) -> np.ndarray:
    """(V,) what the Geometry node asks about the whole mesh."""
    count = len(mesh.vertices)
    edges = np.zeros(2 * len(mesh.edges), np.int32)
    mesh.edges.foreach_get("vertices", edges)
    edges = edges.reshape(-1, 2)
    if name == ISLAND:
        return island_numbers(count, edges)
    places, normals = np.zeros((2, 3 * count), np.float32)
    mesh.vertices.foreach_get("co", places)
    mesh.vertex_normals.foreach_get("vector", normals)
    return pointiness(_finite(places.reshape(-1, 3)), _finite(normals.reshape(-1, 3)), edges)


# data type of an attribute -> (field that foreach_get reads, numbers per element, dtype)
_ATTRIBUTE_FIELDS = {
    "FLOAT_COLOR": ("color", 4, np.float32),
    "BYTE_COLOR": ("color", 4, np.float32),
    "QUATERNION": ("value", 4, np.float32),
    "FLOAT_VECTOR": ("vector", 3, np.float32),
    "FLOAT2": ("vector", 2, np.float32),
    "FLOAT": ("value", 1, np.float32),
    "INT": ("value", 1, np.int32),
    "INT8": ("value", 1, np.int32),
    "BOOLEAN": ("value", 1, bool),
}


def _as_rgba(attribute) -> np.ndarray | None:
    """(N, 4) float32 of an attribute in its own domain; None for types that have no colour meaning."""
    if attribute.data_type not in _ATTRIBUTE_FIELDS:
        return None
    name, width, dtype = _ATTRIBUTE_FIELDS[attribute.data_type]
    count = len(attribute.data)
    values = np.zeros(count * width, dtype)
    if count:
        attribute.data.foreach_get(name, values)
    rgba = np.zeros((count, 4), np.float32)
    rgba[:, 3] = 1.0
    rgba[:, : max(width, 3) if width == 1 else width] = values.reshape(count, width)
    if width == 2:
        rgba[:, 3] = 2.0  # see material/input.glsl
    return rgba


def _triangulate(raw: RawMesh, mesh) -> tuple[np.ndarray, np.ndarray]:
    """(T, 3) corners and (T,) material slots. Blender chooses the diagonals: its rule is part of the shape."""
    corners, faces = len(raw.corner_vertices), len(raw.face_starts)
    if corners == 3 * faces:
        triangles = np.arange(corners, dtype=np.int32).reshape(-1, 3)
        face_of_triangle = slice(None)
    else:
        mesh.calc_loop_triangles()
        count = len(mesh.loop_triangles)
        triangles = np.empty(count * 3, np.int32)
        mesh.loop_triangles.foreach_get("loops", triangles)
        triangles = triangles.reshape(-1, 3)
        face_of_triangle = np.empty(count, np.int32)
        mesh.loop_triangle_polygons.foreach_get("value", face_of_triangle)
    if raw.face_slots is None or raw.slots == 1:
        return triangles, np.zeros(len(triangles), np.int32)
    # Out of range indices are clamped as in Cycles.
    return triangles, np.clip(raw.face_slots, 0, raw.slots - 1)[face_of_triangle]


def _drop_broken(raw: RawMesh, triangles, slots):
    """Positions made finite, and only the triangles whose vertices exist and lie at a place (see FARTHEST)."""
    positions, vertices = raw.positions, raw.corner_vertices
    finite = None
    if len(positions) and not np.abs(positions).max() < FARTHEST:
        with np.errstate(invalid="ignore"):
            finite = (np.abs(positions) < FARTHEST).all(axis=1)
    in_range = len(vertices) == 0 or (vertices.min() >= 0 and vertices.max() < len(positions))
    if finite is None and in_range:
        return positions, triangles, slots, 0
    if finite is None:
        finite = np.ones(len(positions), bool)
    good_corner = (vertices >= 0) & (vertices < len(positions))
    good_corner[good_corner] = finite[vertices[good_corner]]
    good = good_corner[triangles].all(axis=1)
    positions = np.where(finite[:, None], positions, np.float32(0.0))
    vertices[~good_corner] = 0
    return positions, triangles[good], slots[good], int(len(good) - good.sum())


def _ascending(slots: np.ndarray) -> bool:
    return len(slots) < 2 or bool((slots[1:] >= slots[:-1]).all())


def _unit(normals: np.ndarray) -> np.ndarray:
    """Normals of length one; what has no direction (faces without area, broken vertices) points up."""
    squared = np.einsum("ij,ij->i", normals, normals)
    if bool(((squared > 0.999) & (squared < 1.001)).all()):
        return normals
    with np.errstate(divide="ignore", invalid="ignore"):
        unit = normals / np.sqrt(squared)[:, None]
    lost = ~(np.isfinite(unit).all(axis=1) & (squared > 1e-12))
    unit[lost] = (0.0, 0.0, 1.0)
    return unit.astype(np.float32)


def _bounds(positions, corner_vertices, triangles) -> tuple[np.ndarray, np.ndarray]:
    """Box around what is drawn: loose vertices do not widen it. Zeros when there is no triangle."""
    if len(triangles) == 0:
        return np.zeros(3), np.zeros(3)
    used = np.zeros(len(positions), bool)
    whole = len(triangles) * 3 >= len(corner_vertices)
    used[corner_vertices if whole else corner_vertices[triangles]] = True
    shown = positions if used.all() else positions[used]
    return shown.min(axis=0).astype(np.float64), shown.max(axis=0).astype(np.float64)
