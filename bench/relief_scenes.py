"""Scenes of displaced surfaces, each as a coarse mesh and as one subdivided to the detail of its heights.

Heights are images: the specification's fields (stones, sines, pyramids, fractal) and bricks. Built from numbers in an
empty Blender; albedos .5, a box that stands in the floor is red. `detail` is the number of faces along a side of two
metres; 0 is the coarse mesh of two triangles (the cylinder: 48 facets).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .shading import even_world, one_shader

SIZE = 512  # texels along a side of a field
IMAGE = 256  # of a height image: as many as the subdivided mesh has faces
DEPTH = 0.1  # m, of the relief of the plane
BRICK_DEPTH = 0.05
STONES = 40


def sines(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    return 0.5 + 0.25 * (np.sin(8 * np.pi * u) + np.sin(8 * np.pi * v))


def stones(u: np.ndarray, v: np.ndarray, seed: int = 1) -> np.ndarray:
    """Hemispheres of radius a tenth of the tile at random places, tiling."""
    height = np.zeros(np.broadcast(u, v).shape)
    for x, y in np.random.default_rng(seed).random((STONES, 2)):
        du, dv = (u - x + 0.5) % 1.0 - 0.5, (v - y + 0.5) % 1.0 - 0.5
        height = np.maximum(height, np.sqrt(np.maximum(0.0, 1.0 - (du * du + dv * dv) / 0.01)))
    return height


def pyramids(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    return 1.0 - 2.0 * np.maximum(np.abs((4 * u) % 1.0 - 0.5), np.abs((4 * v) % 1.0 - 0.5))


def fractal(size: int, seed: int = 1) -> np.ndarray:
    """White noise filtered by k^-1.6 below 60 periods, from 0 to 1."""
    noise = np.fft.fft2(np.random.default_rng(seed).standard_normal((size, size)))
    k = np.hypot(*np.meshgrid(np.fft.fftfreq(size, 1 / size), np.fft.fftfreq(size, 1 / size)))
    noise *= np.where((k > 0) & (k < 60), np.maximum(k, 1.0) ** -1.6, 0.0)
    height = np.fft.ifft2(noise).real
    return (height - height.min()) / np.ptp(height)


def bricks(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Rows of bricks, 12 around and 4 high, with joints whose sides slope."""
    row = np.floor(v * 4)
    x, y = (u * 12 + 0.5 * (row % 2)) % 1.0, (v * 4) % 1.0
    rim = np.minimum(np.minimum(x, 1 - x) * 2.0, np.minimum(y, 1 - y))
    return np.clip((rim - 0.05) / 0.08, 0.0, 1.0)


def texels(size: int = SIZE) -> tuple[np.ndarray, np.ndarray]:
    """u and v of the centres of texels, (size, size) each."""
    at = (np.arange(size) + 0.5) / size
    u, v = np.meshgrid(at, at)
    return u, v


def field(name: str, size: int = SIZE) -> np.ndarray:
    """(size, size) heights in 0..1, row 0 at v = 0."""
    if name == "fractal":
        return fractal(size)
    return {"sines": sines, "stones": stones, "pyramids": pyramids, "bricks": bricks}[name](*texels(size))


@dataclass(frozen=True)
class Scene:
    """What to build; `lamp` SUN, AREA or WORLD."""

    label: str
    surface: Callable[[int, int], None]  # of a detail, and texels along a side of its height image
    camera: tuple[tuple[float, float, float], tuple[float, float, float], float]
    detail: int  # of the mesh that Cycles displaces


def clear() -> None:
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.film_transparent = True


def link(name: str, data, location=(0, 0, 0), turn=(0, 0, 0)):
    import bpy

    made = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(made)
    made.location, made.rotation_euler = location, turn
    return made


def plain(color=(0.5, 0.5, 0.5)):

    return one_shader("Plain", "ShaderNodeBsdfDiffuse", Color=(*color, 1))


def displaced(heights: np.ndarray, depth: float, midlevel: float = 0.0, method: str = "DISPLACEMENT", **scale):
    """A diffuse material whose displacement is an image of heights over the UV map."""
    import bpy

    made = plain()
    made.name, made.displacement_method = "Relief", method
    size = heights.shape[0]
    image = bpy.data.images.new("Heights", size, size, float_buffer=True, is_data=True)
    pixels = np.ones((size, size, 4), np.float32)
    pixels[..., :3] = heights[..., None]
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    nodes, join = made.node_tree.nodes, made.node_tree.links.new
    texture, node = nodes.new("ShaderNodeTexImage"), nodes.new("ShaderNodeDisplacement")
    texture.image = image
    node.inputs["Scale"].default_value, node.inputs["Midlevel"].default_value = depth, midlevel
    join(texture.outputs["Color"], node.inputs["Height"])
    output = next(one for one in nodes if one.type == "OUTPUT_MATERIAL")
    join(node.outputs[0], output.inputs["Displacement"])
    if scale:
        places, mapping = nodes.new("ShaderNodeTexCoord"), nodes.new("ShaderNodeMapping")
        mapping.inputs["Scale"].default_value = (scale["repeat"], scale["repeat"], 1.0)
        join(places.outputs["UV"], mapping.inputs["Vector"])
        join(mapping.outputs["Vector"], texture.inputs["Vector"])
    return made


def lattice(columns: int, rows: int, place: Callable[[np.ndarray, np.ndarray], np.ndarray], material, name="Surface"):
    """A smooth mesh of quads over the unit square, (u, v) at `place` (N, 3), with the square as its UV map."""
    import bpy

    v, u = np.mgrid[0 : rows + 1, 0 : columns + 1]
    u, v = u.ravel() / columns, v.ravel() / rows
    k = np.arange(columns)[None] + (columns + 1) * np.arange(rows)[:, None]
    k = k.ravel()
    mesh = bpy.data.meshes.new(name)
    faces = np.stack([k, k + 1, k + columns + 2, k + columns + 1], axis=1)
    mesh.from_pydata(place(u, v).tolist(), [], faces.tolist())
    vertices = np.zeros(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("vertex_index", vertices)
    layer = mesh.uv_layers.new(name="UVMap")
    layer.data.foreach_set("uv", np.stack([u, v], axis=1)[vertices].astype(np.float32).ravel())
    mesh.shade_smooth()
    mesh.materials.append(material)
    return link(name, mesh)


def flat(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    return np.stack([2 * u - 1, 2 * v - 1, 0 * u], axis=1)


def round_about(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    angle = 2 * np.pi * u
    return np.stack([np.cos(angle), np.sin(angle), 2 * v - 1], axis=1)


def stone_floor(detail: int, size: int) -> None:
    lattice(max(detail, 1), max(detail, 1), flat, displaced(field("stones", size), DEPTH))


def stone_floor_with_box(detail: int, size: int) -> None:
    import bpy

    stone_floor(detail, size)
    bpy.ops.mesh.primitive_cube_add(size=0.7, location=(0.1, -0.1, 0.05), rotation=(0.3, 0.2, 0.5))
    bpy.context.object.data.materials.append(plain((0.6, 0.1, 0.1)))


def cylinder(detail: int, size: int) -> None:
    columns, rows = (3 * detail, detail // 2) if detail else (48, 1)
    lattice(columns, rows, round_about, displaced(field("bricks", size), BRICK_DEPTH))


ABOVE = ((0.0, -2.3, 2.3), (np.pi / 4, 0.0, 0.0), 0.69)
SCENES = {
    "stones": Scene("stones", stone_floor, ABOVE, 256),
    "grazing": Scene("grazing plane", stone_floor, ((0.0, -3.0, 0.58), (np.radians(79.5), 0.0, 0.0), 0.69), 256),
    "box": Scene("box in the floor", stone_floor_with_box, ABOVE, 256),
    "cylinder": Scene("brick cylinder", cylinder, ((0.0, -4.2, 1.2), (np.radians(74.0), 0.0, 0.0), 0.69), 256),
}
LAMPS = ("SUN", "AREA", "WORLD")


def build(name: str, lamp: str, detail: int, mode: str = "AUTO", size: int = IMAGE, safe: bool = False) -> None:
    """Scene `name` under one lamp; `mode` of the displaced material and whether thin features are safe, as Candela has
    it; `size`: texels along a side of the heights."""
    import bpy

    clear()
    scene = SCENES[name]
    scene.surface(detail, size)
    for material in bpy.data.materials:
        if material.name.startswith("Relief") and hasattr(material, "candela"):
            material.candela.relief_mode, material.candela.relief_safe = mode, safe
    place, turn, angle = scene.camera
    camera = bpy.data.cameras.new("Camera")
    camera.angle = angle
    bpy.context.scene.camera = link("Camera", camera, place, turn)
    if lamp == "WORLD":
        even_world((0.8, 0.9, 1.0))
        return
    light = bpy.data.lights.new(lamp, lamp)
    if lamp == "SUN":
        light.energy, light.angle = 3.0, 0.0
        link("Sun", light, turn=(0.5, -0.6, 0.0))
    else:
        light.energy, light.size = 150.0, 1.0
        link("Area", light, (-2.0, -2.0, 2.5), (0.8, 0.0, -0.785))
