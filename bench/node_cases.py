"""Every node that Candela draws, in settings that show what it does, and the pictures of them by both engines.

A case is one output of one node as the radiance of an emission, on a tile of one scene: a plane, or a sphere where the
node asks for the shape. Both engines take one sample, which stands at the pixel's centre, so that pictures are compared
pixel by pixel. Values that may be negative are shown as half the value plus one half.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import bpy
import numpy as np

from addon.compare.reference import render_passes

from .shading import tree_of

CELLS = "Cells"  # object coordinates rounded down to a grid: white noise tells numbers apart by their last bit


@dataclass(frozen=True)
class Case:
    """One output of a node. Inputs are named by identifier; `coordinate` feeds the node's `into` socket."""

    name: str
    node: str  # bl_idname without "ShaderNode"
    output: str
    settings: dict = field(default_factory=dict)
    inputs: dict = field(default_factory=dict)
    coordinate: str = ""  # output of Texture Coordinate, or CELLS
    into: str = "Vector"
    signed: bool = False
    scale: float = 1.0  # what the output is multiplied by, so that it fits a display
    procedural: bool = False  # bit patterns: 99 % of pixels count
    sphere: bool = False
    through: str = ""  # a node type that turns the output into a colour: Bump, Displacement
    since: tuple[int, int] = (4, 5)  # the first Blender that has it


@dataclass(frozen=True)
class Difference:
    """How far two pictures of one case are apart, in steps of 8 bits after the standard view transform."""

    case: Case
    ours: np.ndarray  # (H, W, 3) display values
    theirs: np.ndarray
    largest: float
    percentile_99: float

    @property
    def good(self) -> bool:
        return self.percentile_99 <= 2.0 if self.case.procedural else self.largest <= 1.0


def compare(cases: list[Case], pixels: int = 32) -> list[Difference]:
    """Render all cases on tiles of `pixels` x `pixels` with both engines."""
    scene, side = tile_scene(cases)
    size = (side * pixels, side * pixels)
    # The pixels' middles alone, as Cycles' first sample.
    scene.candela.film_points = 1
    scene.render.filter_size = 0.01
    ours, theirs = (render_passes(scene, engine, 1, size=size, direct_only=True) for engine in ("CANDELA", "CYCLES"))
    found = []
    # The lens sees a little more than the grid, and pixels where only one engine meets the object do not count.
    seen = [np.nan_to_num(passes.images["depth"][..., 0], posinf=1e10) < 1e9 for passes in (ours, theirs)]
    both = _eroded(seen[0] & seen[1])
    shown = [_display(passes.images["emission"][..., :3]) for passes in (ours, theirs)]
    for number, case in enumerate(cases):
        row, column = divmod(number, side)
        cut = np.s_[row * pixels : (row + 1) * pixels, column * pixels : (column + 1) * pixels]
        apart = 255.0 * np.abs(shown[0][cut] - shown[1][cut]).max(axis=-1)[both[cut]]
        largest = float(apart.max()) if apart.size else 255.0
        percentile = float(np.percentile(apart, 99)) if apart.size else 255.0
        found.append(Difference(case, shown[0][cut], shown[1][cut], largest, percentile))
    return found


def _display(linear: np.ndarray) -> np.ndarray:
    """The sRGB curve of what a display can show."""
    clipped = np.clip(np.nan_to_num(linear.astype(float)), 0.0, 1.0)
    return np.where(clipped < 0.0031308, 12.92 * clipped, 1.055 * clipped ** (1 / 2.4) - 0.055)


def _eroded(mask: np.ndarray) -> np.ndarray:
    """Without the pixels at the silhouette, where an engine may meet the facet beside."""
    inner = mask.copy()
    for axis in (0, 1):
        for step in (-1, 1):
            inner &= np.roll(mask, step, axis)
    return inner


# The scene --------------------------------------------------------------------------------------------------------


def tile_scene(cases: list[Case]) -> tuple[bpy.types.Scene, int]:
    """The cases' materials on tiles of one metre, row by row from below, and how many tiles stand side by side."""
    side = math.ceil(math.sqrt(len(cases)))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    plane, sphere = _plane(), _sphere()
    guide = bpy.data.objects.new("Guide", None)
    guide.location, guide.rotation_euler, guide.scale = (0.3, -0.2, 0.5), (0.2, 0.4, 0.6), (1.5, 0.8, 1.2)
    scene.collection.objects.link(guide)
    for number, case in enumerate(cases):
        row, column = divmod(number, side)
        shape = bpy.data.objects.new(f"Tile {number}", sphere if case.sphere else plane)
        shape.location = (column + 0.5, row + 0.5, 0.0)
        if case.sphere:
            shape.rotation_euler, shape.scale = (0.5, 0.3, 0.2), (0.42, 0.36, 0.45)
        shape.color, shape.pass_index = (0.2, 0.5, 0.9, 0.7), 1
        # The slot belongs to the object, so that all tiles share two meshes.
        scene.collection.objects.link(shape)
        shape.material_slots[0].link = "OBJECT"
        shape.material_slots[0].material = _material(case)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.type, camera.data.ortho_scale = "ORTHO", side
    camera.location = (0.5 * side, 0.5 * side, 10.0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    bpy.context.view_layer.update()
    return scene, side


def _plane() -> bpy.types.Mesh:
    mesh = bpy.data.meshes.new("Plane")
    corners = [(x, y, 0.0) for y in (-0.5, 0.5) for x in (-0.5, 0.5)]
    mesh.from_pydata(corners, [], [(0, 1, 3, 2)])
    layer = mesh.uv_layers.new(name="UVMap")
    for loop, place in zip(layer.data, ((0, 0), (1, 0), (1, 1), (0, 1))):
        loop.uv = place
    _paint(mesh)
    mesh.materials.append(None)
    return mesh


def _sphere() -> bpy.types.Mesh:
    """A unit sphere of 48 x 24 smooth faces with the usual UVs."""
    around, down = 48, 24
    angles = [(2 * math.pi * i / around, math.pi * j / down) for j in range(down + 1) for i in range(around)]
    places = [(math.sin(t) * math.cos(p), math.sin(t) * math.sin(p), math.cos(t)) for p, t in angles]
    faces, uvs = [], []
    for j in range(down):
        for i in range(around):
            right = (i + 1) % around
            ring = [j * around + i, (j + 1) * around + i, (j + 1) * around + right, j * around + right]
            uv = [(i, j), (i, j + 1), (i + 1, j + 1), (i + 1, j)]
            keep = [0, 1, 2] if j == 0 else [0, 1, 3] if j == down - 1 else [0, 1, 2, 3]
            faces.append([ring[k] for k in keep])
            uvs += [(uv[k][0] / around, 1.0 - uv[k][1] / down) for k in keep]
    mesh = bpy.data.meshes.new("Sphere")
    mesh.from_pydata(places, [], faces)
    layer = mesh.uv_layers.new(name="UVMap")
    layer.data.foreach_set("uv", np.array(uvs, np.float32).ravel())
    _paint(mesh)
    mesh.shade_smooth()
    mesh.materials.append(None)
    return mesh


def _paint(mesh: bpy.types.Mesh) -> None:
    """A colour and a number per vertex, from the vertex's place."""
    places = np.empty((len(mesh.vertices), 3), np.float32)
    mesh.vertices.foreach_get("co", places.ravel())
    colors = np.concatenate([0.5 + 0.5 * places, np.full((len(places), 1), 0.6)], axis=1).astype(np.float32)
    mesh.color_attributes.new("Paint", "FLOAT_COLOR", "POINT").data.foreach_set("color", colors.ravel())
    # A new layer may move the others: nothing of the first is kept.
    numbers = (0.5 + 0.3 * places[:, 0]).astype(np.float32)
    mesh.attributes.new("Number", "FLOAT", "POINT").data.foreach_set("value", numbers)


def picture() -> bpy.types.Image:
    """Eight by four pixels of random colours with some alpha, the same in each run."""
    found = bpy.data.images.get("Picture")
    if found is None:
        found = bpy.data.images.new("Picture", 8, 4, alpha=True)
        found.colorspace_settings.name = "sRGB"
        found.alpha_mode = "CHANNEL_PACKED"
        pixels = np.round(np.random.default_rng(3).random((4, 8, 4)) * 255.0) / 255.0
        found.pixels.foreach_set(pixels.astype(np.float32).ravel())
        found.update()
        found.pack()
    return found


# Materials --------------------------------------------------------------------------------------------------------


def new_material(name: str) -> bpy.types.Material:
    """An empty tree, on every Blender."""
    material = bpy.data.materials.new(name)
    tree_of(material).nodes.clear()
    return material


def _material(case: Case) -> bpy.types.Material:
    material = new_material(case.name)
    material.pass_index = 1
    tree = material.node_tree
    nodes, link = tree.nodes, tree.links.new
    node = nodes.new("ShaderNode" + case.node)
    for name, value in case.settings.items():
        _set(node, name, value)
    for name, value in case.inputs.items():
        socket(node.inputs, name).default_value = value
    if case.coordinate:
        coordinates = nodes.new("ShaderNodeTexCoord")
        source = socket(coordinates.outputs, "Object" if case.coordinate == CELLS else case.coordinate)
        if case.coordinate == CELLS:
            snap = nodes.new("ShaderNodeVectorMath")
            snap.operation = "SNAP"
            snap.inputs[1].default_value = (0.13, 0.13, 0.13)
            link(source, snap.inputs[0])
            source = snap.outputs[0]
        if case.into in ("Fac", "Value", "W"):  # one number of the coordinate
            split = nodes.new("ShaderNodeSeparateXYZ")
            link(source, split.inputs[0])
            source = split.outputs[0]
        link(source, socket(node.inputs, case.into))
    shown = socket(node.outputs, case.output)
    emission, output = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
    if case.through == "Displacement":
        lift = nodes.new("ShaderNodeDisplacement")
        lift.inputs["Scale"].default_value = 0.05
        link(shown, lift.inputs["Height"])
        link(lift.outputs[0], output.inputs["Displacement"])
        shown = nodes.new("ShaderNodeNewGeometry").outputs["Normal"]
    if case.through == "Bump":
        bump = nodes.new("ShaderNodeBump")
        bump.inputs["Distance"].default_value = 0.05
        link(shown, bump.inputs["Height"])
        shown = bump.outputs["Normal"]
    if case.signed or case.through or case.scale != 1.0:
        half = nodes.new("ShaderNodeVectorMath")
        half.operation = "MULTIPLY_ADD"
        middle = 0.5 if case.signed or case.through else 0.0
        half.inputs[1].default_value = ((0.5 if middle else 1.0) * case.scale,) * 3
        half.inputs[2].default_value = (middle,) * 3
        link(shown, half.inputs[0])
        shown = half.outputs[0]
    link(shown, emission.inputs["Color"])
    link(emission.outputs[0], output.inputs["Surface"])
    return material


def _set(node, name: str, value) -> None:
    if name == "image":
        node.image = picture()
    elif name == "object":
        node.object = bpy.data.objects["Guide"]
    elif name == "stops":
        ramp = node.color_ramp
        for element, (position, color) in zip(
            [ramp.elements[0], ramp.elements[1], *(ramp.elements.new(0.5) for _ in value[2:])], value
        ):
            element.position, element.color = position, color
    elif name == "curves":
        for number, points in value.items():
            curve = node.mapping.curves[number]
            for place, point in zip(curve.points, points):
                place.location = point
            for point in points[len(curve.points) :]:
                curve.points.new(*point)
        node.mapping.update()
    elif name in ("color_mode", "ramp_interpolation", "hue_interpolation"):
        setattr(node.color_ramp, name.removeprefix("ramp_"), value)
    elif name == "direction":
        node.outputs["Normal"].default_value = value
    else:
        setattr(node, name, value)


def socket(sockets, identifier: str):
    """A socket by identifier, the visible one where several share it."""
    return next(one for one in sockets if one.identifier == identifier)
