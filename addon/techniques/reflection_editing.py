"""Reflection editing: mirrors, gloss, highlights and glass show what an artist wants, where the artist wants it.

Constraints of an object say that a place of it is to show another target than it would; regions say where that acts.
In every pixel of the object the rotation of reflected directions is solved from them (surfaces/reflection_edits.py),
and turns the frame of the surface's lobe after the view has been taken into it (shaders/lib/brdf.glsl): rays, points
of lights and highlights then follow, while Fresnel's terms keep the angle that they had. Diffuse light and shadows
never change, and pixels outside of all regions are what they are without this technique.

| cost | per sample, of edited objects |
|---|---|
| draws | 1 per object |
| arithmetic per pixel | 4 Jacobi sweeps of a 4x4 matrix per region, once more where it fades; 2 distances each |
| bytes per pixel | 16 |
| geodesic distances, once per change | a shortest-path search per region and constraint, as far as regions reach |

Bias: directions are exact for the view in which a constraint was made; in other views they turn along with what the
surface mirrors there. Where rays of mirrors or glass meet an edited object, they are turned, too
(surfaces/edits_at_hits.py), but not in drafts and where reflections are mean colours. A mirrored ray that an edit sends
into its own closed object begins where it leaves that. Edits of more than 120 degrees fold over: the ledger tells the
largest one. Drafts show glass without its edits.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.technique import OBJECT, POINT, Param, Technique, Write, own_value
from ..gfx import geometry, images, passes
from ..gfx.library import Program
from ..scene.culling import closed
from ..scene.materials import CAMERA_DEFINES, SURFACE_IMAGES
from ..scene.view import VIEW
from ..snapshot.panorama import bends_lines
from ..snapshot.scene import Instance, Mesh, Note, Snapshot
from ..surfaces import geodesic, reflection_edits
from ..surfaces.draw import SURFACE_TEXTURES, SurfaceStages
from ..surfaces.edits_at_hits import EditedObject, EditsAtHits
from ..surfaces.reflection_edits import MOST_CONSTRAINTS, MOST_LAYERS, MOST_REGIONS, Constraint, Region

REFLECTION, REFRACTION = "REFLECTION", "REFRACTION"
KINDS = {
    "EUCLIDEAN": reflection_edits.EUCLIDEAN, "GEODESIC": reflection_edits.GEODESIC,
    "PAINTED": reflection_edits.PAINTED,
}  # fmt: skip
MOST_FROZEN = 511  # eyes that shaders/edit/frozen.glsl has numbers for
NOTHING_EDITED = "no object has an edit of its reflections"
EDIT, EDIT_AT_POINT = "surface.edit", "surface.edit_at_point"
CONSTRAINT = (
    Param("enabled", "Enabled", True, "Whether the constraint acts"),
    Param("point", "Point", (0.0, 0.0, 0.0), "Point of the surface that shows the target", handle=POINT),
    Param("target", "Target", (0.0, 0.0, 1.0), "Point that is seen there, in object space", handle=POINT),
    Param(
        "target_object", "Target Object", "",
        "Object whose origin is the target, as an empty, a lamp or the child of a bone, wherever it moves", object=True,
    ),
    Param(
        "viewer", "Viewer", (0.0, -5.0, 0.0), "Viewpoint from which the constraint was made", unit="TRANSLATION"
    ),
    Param(
        "of", "Of", REFLECTION, "Which light the edit redirects",
        items=(
            (REFLECTION, "Reflection", 0, "What the surface mirrors, and highlights of lamps"),
            (REFRACTION, "Refraction", 1, "What is seen through the surface"),
        ),
    ),
    Param("triangle", "Triangle", -1, "Triangle that the point follows under deformation; -1: none", -1, 2**31 - 1),
    Param("weights", "Weights", (1.0, 0.0, 0.0), "Barycentric coordinates of the point on that triangle"),
)  # fmt: skip
REGION = (
    Param("enabled", "Enabled", True, "Whether constraints act in the region"),
    Param(
        "kind", "Kind", "EUCLIDEAN", "How distance from the centre is measured",
        items=(
            ("EUCLIDEAN", "Ball", 0, "All of the object within a radius"),
            ("GEODESIC", "Along Surface", 1, "As far as the radius, measured along the surface"),
            ("PAINTED", "Painted", 2, "Where the active color attribute is bright"),
        ),
    ),
    Param("centre", "Centre", (0.0, 0.0, 0.0), "Centre of the region", handle=POINT),
    Param("radius", "Radius", 1.0, "Radius of the region", 0.0, 1e6, "DISTANCE"),
    Param("border", "Border", 0.25, "Width inside the radius over which edits fade out", 0.0, 1e6, "DISTANCE"),
)  # fmt: skip


@cache
def edit_program(layers: int) -> Program:
    """Draws an edited object; `layers` of distances come with its vertices, four to an attribute."""
    count = -(-layers // 4)
    cases = "".join(
        f"  if (k < {4 * k + 4}) {{\n    return varying_layers{k}[k - {4 * k}];\n  }}\n" for k in range(count)
    )
    copied = "".join(f"  varying_layers{k} = layers{k};\n" for k in range(count))
    return Program(
        name="edits of an object",
        vertex="edit/surface.vert.glsl",
        fragment="edit/surface.frag.glsl",
        inputs=(("VEC3", "position"), *(("VEC4", f"layers{k}") for k in range(count))),
        varyings=(
            ("smooth", "VEC3", "world_position"), *(("smooth", "VEC4", f"varying_layers{k}") for k in range(count)),
        ),
        outputs=(("VEC4", "out_edit"),),
        textures=(("RGBA32F", "instances"), *SURFACE_TEXTURES),
        blocks=((VIEW, "film_view"), (reflection_edits.EDITS, "edits")),
        constants=(("INT", "instance_row"), *reflection_edits.SOLVE_CONSTANTS),
        defines=CAMERA_DEFINES,
        snippets=(
            ("generated/copied", f"void copy_distances()\n{{\n{copied}}}\n"),
            ("generated/distances", f"float distance_layer(int k)\n{{\n{cases}  return 0.0;\n}}\n"),
        ),
    )  # fmt: skip


PROGRAMS = (edit_program(0), edit_program(MOST_LAYERS))


class _Edited:
    """An object with its edits on the GPU."""

    def __init__(self, at_hits: EditedObject, batch: geometry.Batch, layers: int, largest: float, eye: int):
        self.at_hits, self.batch, self.layers, self.largest = at_hits, batch, layers, largest
        self.eye = eye  # number of the view that stays in what is seen through it; 0: none
        self.row, self.table = at_hits.row, at_hits.table


class ReflectionEditing(Technique):
    name = "reflection_editing"
    label = "Reflection edits"
    params = (
        Param(
            "freeze", "Freeze Reflections", False,
            "Keep the reflections of the view in which the object's first constraint was made",
            scope=OBJECT,
        ),
        Param("constraints", "Constraints", (),
            "Which target each constrained point of the surface should show", scope=OBJECT, many=CONSTRAINT),
        Param("regions", "Regions", (), "Regions of the surface in which constraints act", scope=OBJECT, many=REGION),
    )  # fmt: skip
    reads = ("surface.position",)
    writes = (
        Write(EDIT, "RGBA32F", "Rotation of reflected directions as a quaternion; 0: none"),
        Write(EDIT_AT_POINT, "RGBA32F", "The same at another point of the film"),
        Write("surface.lobe", "RGBA32F", "Where lobes point: turned by the edit that goes with it", by_need=True),
    )

    provides = (EditsAtHits,)

    def __init__(self):
        self._edited: list[_Edited] = []
        self._kept: dict[object, _Edited] = {}
        self._surfaces: dict[object, tuple[geodesic.Surface, bool]] = {}  # and whether it is closed

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        if not has_edits(snapshot):
            return NOTHING_EDITED
        return bends_lines(snapshot)

    def begin(self, frame: Frame) -> None:
        rows = {id(instance): row for row, instance in enumerate(frame.geometry.placed[0])}
        kept: dict[object, _Edited] = {}
        surfaces: dict[object, tuple[geodesic.Surface, bool]] = {}
        eyes: list[np.ndarray] = []  # of views that stay in what is seen through closed objects, a number each
        for instance in frame.snapshot.instances:
            constraints, regions = _edits(instance)
            mesh = frame.snapshot.meshes[instance.mesh]
            if not constraints or not regions or not mesh.triangle_count:
                continue
            row = rows[id(instance)]
            origin = tuple(frame.geometry.origin)
            where = (instance.mesh, mesh.version, instance.matrix.tobytes(), row, origin)
            surfaces[where] = self._surfaces.get(where) or (_surface(frame, instance, mesh), _is_closed(mesh))
            number = 0
            if surfaces[where][1] and own_value(instance.own, ReflectionEditing, "freeze") and _bends(constraints):
                eyes.append(_moved(_placed(frame, instance), constraints[0]["viewer"]))
                number = len(eyes)
            key = (*where, instance.own, instance.materials, _indices(frame, instance), number)
            kept[key] = self._kept.get(key) or _made(frame, instance, mesh, row, *surfaces[where], number)
        self._kept, self._edited, self._surfaces = kept, list(kept.values()), surfaces
        frame.ledger.notes = (*frame.ledger.notes, *self._unfrozen(frame))
        frame.shared(SurfaceStages).apply.append(self._at_film_point)
        frame.provide(EditsAtHits([one.at_hits for one in self._edited], np.reshape(eyes, (-1, 3))))

    def _unfrozen(self, frame: Frame) -> list[Note]:
        """What Freeze does not keep: of glass one of its two ways is edited."""
        mirrors, shows = "what the glass mirrors", "what is seen through it"
        found, later = [], [one.at_hits.instance.object_name for one in self._edited if one.eye > MOST_FROZEN]
        if later:
            text = f"Freeze Reflections keeps what is seen through {MOST_FROZEN} closed objects, not through more."
            others = f" and {len(later) - 1} more" if len(later) > 1 else ""
            found.append(Note(f"Object '{later[0]}'{others}", text))
        for one in (one.at_hits.instance for one in self._edited if one.eye <= MOST_FROZEN):
            glass = any(frame.materials.compiled[slot].glass for slot in one.materials)
            if glass and own_value(one.own, ReflectionEditing, "freeze"):
                kept, left, other = (
                    (shows, mirrors, "Reflection") if _bends(_edits(one)[0]) else (mirrors, shows, "Refraction")
                )
                text = f"Freeze Reflections keeps {kept}, not {left}: that is for constraints of {other} alone."
                found.append(Note(f"Object '{one.object_name}'", text))
        return found

    def sample(self, frame: Frame) -> None:
        self._edit(frame, {name: frame.images[f"surface.{name}"] for name in SURFACE_IMAGES}, EDIT)
        folded = max((one.largest for one in self._edited), default=0.0)
        frame.account.note(self, {"largest angle, degrees": round(folded)})
        frame.count(self, "passes", len(self._edited))

    def _at_film_point(self, frame: Frame, surfaces: images.Target) -> None:
        self._edit(frame, dict(zip(SURFACE_IMAGES, surfaces.colors)), EDIT_AT_POINT)

    def _edit(self, frame: Frame, surfaces: dict[str, images.Image], name: str) -> None:
        """Solve the edits of these surfaces into an image that then stands beside their lobes."""
        surfaces["lobe"].beside = {}
        target = frame.target(name)
        target.clear()
        with passes.drawing(target, depth_test="NONE", depth_write=False):
            for one in self._edited:
                self._draw(frame, one, surfaces)
        surfaces["lobe"].beside = {"surface_edit": frame.images[name]}

    def _draw(self, frame: Frame, one: _Edited, surfaces: dict[str, images.Image]) -> None:
        shader = passes.get(edit_program(one.layers))
        shader.bind(
            textures={
                "instances": frame.geometry.instances,
                **{f"surface_{name}": image for name, image in surfaces.items()},
            },
            blocks={"film_view": frame.view_block, "edits": one.table.block},
            constants={"instance_row": one.row, **one.table.constants},
        )
        passes.draw(shader, one.batch)

    def release(self) -> None:
        self._edited, self._kept, self._surfaces = [], {}, {}


def has_edits(snapshot: Snapshot) -> bool:
    """Whether an object has a constraint that is enabled."""
    return any(_edits(instance)[0] for instance in snapshot.instances if instance.own)


def _edits(instance: Instance) -> tuple[list[dict], list[dict]]:
    """Enabled constraints and regions of an object, as many as are solved."""
    if not instance.own:
        return [], []
    constraints = [one for one in own_value(instance.own, ReflectionEditing, "constraints") if one["enabled"]]
    regions = [one for one in own_value(instance.own, ReflectionEditing, "regions") if one["enabled"]]
    return constraints[:MOST_CONSTRAINTS], regions[:MOST_REGIONS]


def _bends(constraints: list[dict]) -> bool:
    """Whether some edit what is seen through the surface."""
    return any(one["of"] == REFRACTION for one in constraints)


def _indices(frame: Frame, instance: Instance) -> tuple[float, ...]:
    """Refractive indices of the glass in an instance's slots, by which constraints know what is seen without them."""
    compiled = [frame.materials.compiled[slot] for slot in instance.materials]
    return tuple(one.glass.ior if one.glass else 1.0 for one in compiled)


def _surface(frame: Frame, instance: Instance, mesh: Mesh) -> geodesic.Surface:
    matrix = _placed(frame, instance)
    return geodesic.Surface(
        mesh.positions @ matrix[:3, :3].T + matrix[:3, 3], mesh.corner_vertices[mesh.triangle_corners]
    )


def _placed(frame: Frame, instance: Instance) -> np.ndarray:
    """Its matrix, relative to the render origin."""
    matrix = instance.matrix.copy()
    matrix[:3, 3] -= frame.geometry.origin
    return matrix


def _made(
    frame: Frame, instance: Instance, mesh: Mesh, row: int, surface: geodesic.Surface, closed: bool, eye: int
) -> _Edited:  # fmt: skip
    """`eye`: number of the view that stays in what is seen through it, from 1; 0: none."""
    matrix, world, corners = _placed(frame, instance), surface.positions, surface.triangles
    surface.begin()
    wanted_constraints, wanted_regions = _edits(instance)
    layers: list[np.ndarray] = []

    def along(point: np.ndarray, reach: float) -> int:
        """A layer with distances from a point; -1 where there is no room for it."""
        if len(layers) >= MOST_LAYERS:
            return -1
        layers.append(surface.along(point, reach))
        return len(layers) - 1

    scale = abs(np.linalg.det(matrix[:3, :3])) ** (1 / 3)
    # What is painted is the same for all regions; it comes first, since nothing can stand for it.
    if any(one["kind"] == "PAINTED" for one in wanted_regions):
        layers.append(_painted(mesh))
    found = [_constraint(frame, instance, mesh, matrix, surface, closed, one) for one in wanted_constraints]
    widest = max((scale * one["radius"] for one in wanted_regions if one["kind"] == "GEODESIC"), default=0.0)
    if widest > 0.0:  # places of a region are within two radii of its constraints, and edges that paths begin with
        reach = 2.0 * (widest + surface.longest)
        found = [replace(one, layer=along(one.place, reach)) for one in found]
    regions, members = [], []
    for one in wanted_regions:
        kind, centre, layer = KINDS[one["kind"]], _moved(matrix, one["centre"]), -1
        if kind == reflection_edits.GEODESIC:
            layer = along(centre, scale * one["radius"])
            kind = kind if layer >= 0 else reflection_edits.EUCLIDEAN
        elif kind == reflection_edits.PAINTED:
            layer = 0
        region = Region(kind, centre, scale * one["radius"], scale * one["border"], layer)
        regions.append(region)
        members.append(sum(1 << n for n, c in enumerate(found) if _inside(region, c, layers, surface)))
    frozen = None
    if own_value(instance.own, ReflectionEditing, "freeze"):
        frozen = _moved(matrix, wanted_constraints[0]["viewer"])
    extent = float(np.linalg.norm(np.ptp(world, axis=0)))
    table = reflection_edits.edit_table(found, regions, members, extent, frozen, closed, eye)
    count = -(-len(layers) // 4)
    packed = np.zeros((len(world), 4 * count), np.float32)
    for k, layer in enumerate(layers):
        packed[:, k] = layer
    vertices = geometry.vertex_buffer(
        position=mesh.positions, **{f"layers{k}": packed[:, 4 * k : 4 * k + 4] for k in range(count)}
    )
    batch = geometry.triangle_batch(vertices, corners)
    outward = np.sign(_volume(surface)) if closed else 0.0
    at_hits = EditedObject(row, instance, table, float(outward), packed)
    return _Edited(at_hits, batch, len(layers), max(one.angle for one in found), eye)


def _moved(matrix: np.ndarray, point) -> np.ndarray:
    return matrix[:3, :3] @ np.asarray(point, float) + matrix[:3, 3]


def _constraint(
    frame: Frame, instance, mesh: Mesh, matrix, surface: geodesic.Surface, closed: bool, one: dict
) -> Constraint:
    """What passes an open surface is turned there; what passes a solid is turned where it leaves it, beyond."""
    point = _moved(matrix, one["point"])
    triangle, weights = one["triangle"], np.asarray(one["weights"], float)
    if not 0 <= triangle < len(surface.triangles):
        triangle, weights = surface.nearest(point)
    point = weights @ surface.positions[surface.triangles[triangle]]
    cofactors = np.linalg.det(matrix[:3, :3]) * np.linalg.pinv(matrix[:3, :3]).T
    normal = reflection_edits.unit(cofactors @ (weights @ mesh.corner_normals[mesh.triangle_corners[triangle]]))
    view = reflection_edits.unit(_moved(matrix, one["viewer"]) - point)
    normal = normal if normal @ view >= 0 else -normal
    bends, turned_at = one["of"] == REFRACTION, point
    if bends:
        material = frame.materials.compiled[int(mesh.triangle_materials(instance.materials)[triangle])]
        ior = material.glass.ior if material.glass else 1.0
        before = reflection_edits.bent(view, normal, ior)
        if closed:
            offset = 1e-4 * float(np.linalg.norm(np.ptp(surface.positions, axis=0)))
            normals = mesh.corner_normals[mesh.triangle_corners] @ cofactors.T
            turned_at, before = reflection_edits.leaving(surface, normals, point, before, ior, offset)
    else:
        before = reflection_edits.mirrored(view, normal)
    after = _moved(matrix, one["target"]) - turned_at
    after = reflection_edits.unit(after) if np.linalg.norm(after) > 0 else before
    return Constraint(point, before, after, normal, bends)


def _is_closed(mesh: Mesh) -> bool:
    """Whether the mesh bounds a solid, whichever way it is wound. Vertices at one place (to a millionth of its size)
    are taken for one: those of seams and poles."""
    step = max(float(np.ptp(mesh.positions, axis=0).max()), 1e-30) / 2**20
    places, number = np.unique(np.round(mesh.positions / step), axis=0, return_inverse=True)
    triangles = number.reshape(-1)[mesh.corner_vertices[mesh.triangle_corners]]
    triangles = triangles[(triangles != np.roll(triangles, 1, axis=1)).all(axis=1)]
    return closed(places, triangles) or closed(places, triangles[:, ::-1])


def _volume(surface: geodesic.Surface) -> float:
    """Of a closed surface, m3; below zero where normals of its triangles point into it."""
    a, b, c = (surface.positions[surface.triangles[:, k]] - surface.positions.mean(axis=0) for k in range(3))
    return float((a * np.cross(b, c)).sum()) / 6.0


def _painted(mesh: Mesh) -> np.ndarray:
    """Weights of vertices: the luminance of the active colour attribute, where a material reads it; else 0."""
    weights = np.zeros(len(mesh.positions))
    colors = mesh.colors.get(mesh.active_color)
    if colors is not None:
        np.maximum.at(weights, mesh.corner_vertices, colors[:, :3].mean(axis=1))
    return weights


def _inside(region: Region, one: Constraint, layers, surface: geodesic.Surface) -> bool:
    if region.layer >= 0:
        triangle, weights = surface.nearest(one.place)
        value = weights @ layers[region.layer][surface.triangles[triangle]]
    else:
        value = np.linalg.norm(one.place - region.centre)
    return bool(reflection_edits.influence(region, value) > 0.0)
