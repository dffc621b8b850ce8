"""Whole scenes as plain data, and how Blender gets them: what hypothesis draws, shrinks and prints."""

from __future__ import annotations

from dataclasses import dataclass, field

import bpy
import numpy as np

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Shape:
    """A mesh by name (see SHAPES) and where it stands."""

    kind: str
    location: Vector = (0.0, 0.0, 0.0)
    turn: Vector = (0.0, 0.0, 0.0)
    scale: Vector = (1.0, 1.0, 1.0)
    material: int = 0  # modulo the number of materials
    copies: int = 1
    casts_shadow: bool = True
    seen: bool = True

    def place(self, copy: int) -> np.ndarray:
        """(3,) location of a copy."""
        return np.array(self.location) + (0.37 * copy, 0.11 * copy, 0.0)


@dataclass(frozen=True)
class Surface:
    """A shader node's type and inputs (colours have four numbers)."""

    node: str = "ShaderNodeBsdfPrincipled"
    inputs: tuple[tuple[str, float | tuple[float, ...]], ...] = ()


@dataclass(frozen=True)
class Lamp:
    kind: str
    location: Vector
    turn: Vector = (0.0, 0.0, 0.0)
    energy: float = 10.0
    color: Vector = (1.0, 1.0, 1.0)
    size: float = 0.1  # metres; radians for suns
    shape: str = "SQUARE"
    cone: float = 1.0
    blend: float = 0.2
    spread: float = np.pi
    casts_shadow: bool = True


@dataclass(frozen=True)
class Viewer:
    location: Vector = (3.0, -4.0, 2.5)
    orthographic: bool = False
    angle: float = 0.8
    span: float = 5.0


@dataclass(frozen=True)
class Scene:
    shapes: tuple[Shape, ...] = ()
    surfaces: tuple[Surface, ...] = (Surface(),)
    lamps: tuple[Lamp, ...] = ()
    world: tuple[float, float, float, float] | None = None  # colour and strength
    viewer: Viewer = field(default_factory=Viewer)
    unit: float = 1.0  # metres to one unit of everything above
    transparent: bool = False
    slots: tuple[tuple[str, str], ...] = ()  # technique by slot, where not Auto
    shadows_by: str = "COST"  # maps or rays
    bounces: int = 0
    samples: int = 2


def _box():
    corners = [(x, y, z) for z in (0, 1) for y in (-0.5, 0.5) for x in (-0.5, 0.5)]
    return corners, [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]


def _ball():
    around, up = 10, 6
    vertices = [
        (np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t) + 1)
        for t in np.linspace(0, np.pi, up)
        for p in np.arange(around) * 2 * np.pi / around
    ]
    faces = [
        (k * around + j, (k + 1) * around + j, (k + 1) * around + (j + 1) % around, k * around + (j + 1) % around)
        for k in range(up - 1)
        for j in range(around)
    ]  # the poles are faces of zero area
    return vertices, faces


SHAPES = {
    "floor": lambda: ([(-4, -4, 0), (4, -4, 0), (4, 4, 0), (-4, 4, 0)], [(0, 1, 2, 3)]),
    "box": _box,
    "ball": _ball,
    "sheet": lambda: ([(-1, 0, 0), (1, 0, 0), (1, 0, 1), (-1, 0, 1)], [(0, 1, 2, 3)]),
    "needle": lambda: ([(0, 0, 0), (1e-5, 0, 0), (0, 0, 3)], [(0, 1, 2)]),
    "point": lambda: ([(0, 0, 1)] * 3, [(0, 1, 2)]),
    "concave": lambda: ([(0, 0, 1), (2, 0, 1), (2, 2, 1), (1, 0.1, 1), (0, 2, 1)], [(0, 1, 2, 3, 4)]),
    "twice": lambda: ([(x, y, 1) for y in (0, 1) for x in (0, 1)] * 2, [(0, 1, 3, 2), (5, 4, 6, 7)]),
    "not a number": lambda: ([(0, 0, 1), (1, 0, 1), (float("nan"), 1, 1), (1, 1, 2)], [(0, 1, 2), (0, 1, 3)]),
    "empty": lambda: ([], []),
    "loose": lambda: ([(0, 0, 1), (1, 0, 1)], []),
}


def build(stage, scene: Scene) -> None:
    """Fill the stage (tests/techniques/conftest.py) with `scene`."""
    stage.clear()
    unit = scene.unit
    materials = [_material(stage, surface) for surface in scene.surfaces]
    for shape in scene.shapes:
        data = bpy.data.meshes.new(shape.kind)
        vertices, faces = SHAPES[shape.kind]()
        data.from_pydata(vertices, [], faces)
        if materials:
            data.materials.append(materials[shape.material % len(materials)])
        for k in range(shape.copies):
            place = shape.place(k) * unit
            made = stage.link(shape.kind, data, place, shape.turn, np.array(shape.scale) * unit)
            made.visible_shadow, made.visible_camera = shape.casts_shadow, shape.seen
    for lamp in scene.lamps:
        _lamp(stage, lamp, unit)
    if scene.world is not None:
        stage.world(scene.world[:3], scene.world[3])
    else:
        stage.scene.world = None
    _camera(stage, scene.viewer, unit)
    stage.scene.render.film_transparent = scene.transparent
    stage.scene.candela.bounces = scene.bounces
    stage.scene.candela.accumulated_maps_by = scene.shadows_by
    for slot, technique in scene.slots:
        setattr(stage.scene.candela, f"slot_{slot}", technique)


def _material(stage, surface: Surface):
    made = stage.material(surface.node)
    node = next(node for node in made.node_tree.nodes if node.bl_idname == surface.node)
    for name, value in surface.inputs:
        if name in node.inputs:
            node.inputs[name].default_value = value
    return made


def _lamp(stage, lamp: Lamp, unit: float) -> None:
    settings = {"color": lamp.color, "use_shadow": lamp.casts_shadow}
    # Powers follow the unit's square, so that the picture does not depend on it.
    settings["energy"] = lamp.energy * (1.0 if lamp.kind == "SUN" else unit * unit)
    if lamp.kind == "SUN":
        settings["angle"] = min(lamp.size, np.pi)
    elif lamp.kind == "AREA":
        settings |= {"shape": lamp.shape, "size": lamp.size * unit, "size_y": lamp.size * unit * 0.5}
        settings["spread"] = lamp.spread
    else:
        settings["shadow_soft_size"] = lamp.size * unit
        if lamp.kind == "SPOT":
            settings |= {"spot_size": lamp.cone, "spot_blend": lamp.blend}
    stage.light(lamp.kind, np.array(lamp.location) * unit, lamp.turn, **settings)


def _camera(stage, viewer: Viewer, unit: float) -> None:
    from mathutils import Vector

    place = Vector(np.array(viewer.location) * unit)
    aim = Vector((0.0, 0.0, 0.4 * unit)) - place
    turn = aim.to_track_quat("-Z", "Y").to_euler() if aim.length > 0 else (0.0, 0.0, 0.0)
    made = stage.camera(place, turn, viewer.angle)
    made.data.clip_start, made.data.clip_end = 0.01 * unit, 1000 * unit
    if viewer.orthographic:
        made.data.type, made.data.ortho_scale = "ORTHO", viewer.span * unit
