"""Scenes of the specifications of shadows by edges, small, for the comparison with Cycles (`bench/edges.py`).

| scene | what it is about |
|---|---|
| open and closed | monkey with open borders, cube, sheet, ring under a rectangle |
| strip on gloss | three poles on a glossy floor under a strip: highlights are hidden in part |
| picket fence | boxes before a sphere |
| fence card | wires as a mask on one card |
| leaves | 200 leaf cards at random, also edge on, under a sphere |
| grass at sunset | upright cards under a sun 3 degrees high: shadows of ten metres |
| spheres | fifty spheres in two layers: groups overlap before the lamp |
| crossed bars | two boxes whose shadows cross |
| cube | one group, and a contact |
| large lamp | silhouettes that the lamp's centre does not see |
"""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np

from .shading import one_shader


def _material(name: str, roughness: float | None = None) -> bpy.types.Material:
    """Diffuse .8, or a glossy one of a roughness."""
    grey = (0.8, 0.8, 0.8, 1)
    if roughness is None:
        return one_shader(name, "ShaderNodeBsdfDiffuse", Color=grey)
    return one_shader(name, "ShaderNodeBsdfAnisotropic", Color=grey, Roughness=roughness)


def _masked(mask: np.ndarray) -> bpy.types.Material:
    """A diffuse material that is there where a mask of texels says so."""
    made = _material("Mask")
    tree = made.node_tree
    image = bpy.data.images.new("Mask", *mask.shape[::-1], alpha=True)
    pixels = np.ones((*mask.shape, 4), np.float32)
    pixels[..., 3] = mask
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    texture, mix = tree.nodes.new("ShaderNodeTexImage"), tree.nodes.new("ShaderNodeMixShader")
    texture.image, texture.interpolation = image, "Closest"
    clear = tree.nodes.new("ShaderNodeBsdfTransparent")
    shader = next(node for node in tree.nodes if node.type == "BSDF_DIFFUSE")
    output = next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
    tree.links.new(texture.outputs["Alpha"], mix.inputs[0])
    tree.links.new(clear.outputs[0], mix.inputs[1])
    tree.links.new(shader.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], output.inputs["Surface"])
    return made


class Set:
    """A scene in the making."""

    def __init__(self, eye, at, angle: float):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.scene = bpy.context.scene
        self.plain = _material("Plain")
        camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
        camera.data.angle = angle
        self._aim(camera, eye, at)
        self.scene.collection.objects.link(camera)
        self.scene.camera = camera
        self.scene.render.filter_size = 0.01

    def _aim(self, thing, place, at) -> None:
        from mathutils import Vector

        thing.location = place
        thing.rotation_euler = (Vector(at) - Vector(place)).to_track_quat("-Z", "Y").to_euler()

    def add(self, operator: str, location, turn=(0, 0, 0), scale=(1, 1, 1), material=None, **options):
        getattr(bpy.ops.mesh, f"primitive_{operator}_add")(location=location, rotation=turn, **options)
        thing = bpy.context.object
        thing.scale = scale
        thing.data.materials.append(material or self.plain)
        return thing

    def floor(self, size: float, material=None):
        self.add("plane", (0, 0, 0), size=size, material=material)

    def box(self, low, high):
        low, high = np.array(low, float), np.array(high, float)
        self.add("cube", tuple((low + high) / 2), scale=tuple(high - low), size=1.0)

    def lamp(self, kind: str, place, at=None, energy: float = 100.0, **settings):
        data = bpy.data.lights.new("Lamp", kind)
        data.energy = energy
        for name, value in settings.items():
            setattr(data, name, value)
        thing = bpy.data.objects.new("Lamp", data)
        self.scene.collection.objects.link(thing)
        self._aim(thing, place, at or (*place[:2], place[2] - 1))
        return thing


def _open_and_closed() -> Set:
    made = Set((0, -4.2, 2.6), (0, 0, 0.6), 1.0)
    made.add("monkey", (0, 0, 1.1), (0.3, 0.2, 0.4), size=1.2)
    made.add("cube", (1.1, 0.3, 0.6), (0.4, 0.3, 0.1), size=0.7)
    made.add("plane", (-1.1, 0.2, 1.2), (0.5, 0.3, 0), size=0.8)
    ring = {"major_radius": 0.35, "minor_radius": 0.1, "major_segments": 20, "minor_segments": 8}
    made.add("torus", (0.3, -0.9, 0.7), (0.8, 0.2, 0), **ring)
    made.floor(12)
    made.lamp("AREA", (0.6, 0.5, 3.6), (0.6, 0.55, 3.4), shape="RECTANGLE", size=1.0, size_y=0.825)
    return made


def _strip() -> Set:
    made = Set((0, -3.5, 1.4), (0, 0, 0.3), 0.7)
    made.floor(6, _material("Gloss", 0.2))
    for x, y in ((-0.5, 0), (0, 0.3), (0.5, 0)):
        made.box((x - 0.05, y - 0.05, 0), (x + 0.05, y + 0.05, 1))
    made.lamp("AREA", (0, 1.5, 2), shape="RECTANGLE", size=2.0, size_y=0.2)
    return made


def _pickets() -> Set:
    made = Set((0, -3, 0.5), (0, 0, 0.4), 0.87)
    made.floor(8)
    for x in 0.1 * (np.arange(40) - 19.5):
        made.box((x - 0.025, -0.025, 0), (x + 0.025, 0.025, 0.8))
    made.lamp("POINT", (0, 2, 2), shadow_soft_size=0.3, use_soft_falloff=False)
    return made


def _fence_card() -> Set:
    made = Set((0, -4, 3), (0, 0, 0), 0.79)
    made.floor(6)
    wires = np.arange(64) % 16 < 4
    made.add("plane", (0, 0, 1.5), size=2.0, material=_masked(wires[:, None] | wires[None]))
    made.lamp("AREA", (0, 0, 4), shape="SQUARE", size=0.5)
    return made


def _leaves() -> Set:
    made = Set((0, -4, 2.5), (0, 0, 0.6), 0.79)
    made.floor(6)
    y, x = np.mgrid[0:64, 0:64] / 63.0 * 2 - 1
    leaf = _masked((x / (0.9 - 0.4 * y)) ** 2 + y**2 < 0.8)
    random = np.random.default_rng(1)
    for _ in range(200):
        way = random.normal(size=3)
        place = way / np.linalg.norm(way) * 1.5 * random.random() ** (1 / 3) * (0.6, 0.6, 0.5) + (0, 0, 1.2)
        made.add("plane", tuple(place), tuple(random.uniform(0, 6.3, 3)), size=0.15, material=leaf)
    made.lamp("POINT", (1, -1, 3.5), shadow_soft_size=0.3, use_soft_falloff=False)
    return made


def _grass() -> Set:
    made = Set((6, -6, 3), (4, 0, 0), 0.87)
    made.floor(40)
    y, x = np.mgrid[0:64, 0:64] / 63.0
    blade = _masked(np.abs(x - 0.5) < 0.45 * (1 - y))
    for k in range(30):
        made.add(
            "plane", (0.3, 0.21 * (k - 15), 0.25), (np.pi / 2, 0, 0.4 * k), (0.2, 0.5, 1), size=1.0, material=blade
        )
    high = np.radians(3.0)
    place = (-10 * np.cos(high), 0, 10 * np.sin(high))
    made.lamp("SUN", place, (0, 0, 0), energy=10.0, angle=np.radians(0.53))
    return made


def _spheres() -> Set:
    made = Set((0, -5, 4), (0, 0, 0.5), 0.79)
    made.floor(8)
    for x in range(5):
        for y in range(5):
            for z in (1.0, 1.5):
                place = (0.5 * (x - 2), 0.5 * (y - 2), z)
                made.add("uv_sphere", place, radius=0.18, segments=16, ring_count=8)
    made.lamp("AREA", (0, 0, 5), shape="SQUARE", size=1.0, energy=200.0)
    return made


def _bars() -> Set:
    made = Set((0, -4, 4), (0, 0, 0), 0.79)
    made.floor(6)
    made.box((-1.5, -0.05, 1.45), (1.5, 0.05, 1.55))
    made.box((-0.05, -1.5, 1.65), (0.05, 1.5, 1.75))
    made.lamp("AREA", (0, 0, 4), shape="SQUARE", size=1.0)
    return made


def _cube() -> Set:
    made = Set((3, -4, 3), (0, 0, 0.4), 0.79)
    made.floor(6)
    made.box((-0.5, -0.5, 0), (0.5, 0.5, 1))
    made.lamp("AREA", (1.5, -1, 3), (0, 0, 0), shape="SQUARE", size=0.5)
    return made


def _large_lamp() -> Set:
    made = Set((0, -2, 1.2), (0, 0, 0.2), 0.79)
    made.floor(6)
    made.box((-0.15, -0.15, 0), (0.15, 0.15, 0.3))
    made.lamp("AREA", (0, 0, 1.3), shape="SQUARE", size=2.0)
    return made


SCENES: dict[str, Callable[[], Set]] = {
    "open and closed": _open_and_closed,
    "strip on gloss": _strip,
    "picket fence": _pickets,
    "fence card": _fence_card,
    "leaves": _leaves,
    "grass at sunset": _grass,
    "spheres": _spheres,
    "crossed bars": _bars,
    "cube": _cube,
    "large lamp": _large_lamp,
}


def build(name: str) -> bpy.types.Scene:
    """The only scene of an empty Blender."""
    return SCENES[name]().scene
