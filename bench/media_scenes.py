"""Small scenes of fog, smoke, fire and volume caustics for `python -m bench media`, built from nothing."""

from __future__ import annotations

import tempfile
from pathlib import Path

import bpy
import numpy as np

from .shading import node_of, one_shader

FACES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
SIDE_VIEW = (np.pi / 2, 0, 0)


def begin() -> None:
    """An empty scene with a camera that looks along +Y."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    camera("Camera", (0, -6, 1.5), SIDE_VIEW)
    bpy.context.scene.world = bpy.data.worlds.new("World")
    background().inputs["Color"].default_value = (0, 0, 0, 1)


def background():
    return node_of(bpy.context.scene.world, "BACKGROUND")


def link(name: str, data, location=(0, 0, 0), turn=(0, 0, 0), scale=(1, 1, 1)):
    placed = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(placed)
    placed.location, placed.rotation_euler, placed.scale = location, turn, scale
    return placed


def camera(name: str, location, turn, angle: float = 0.8):
    data = bpy.data.cameras.new(name)
    data.angle = angle
    bpy.context.scene.camera = link(name, data, location, turn)


def material(node: str, socket: str = "Surface", **inputs):
    return one_shader(node, node, socket, **inputs)


def volume(node: str = "ShaderNodeVolumeScatter", **inputs):
    return material(node, "Volume", **inputs)


def diffuse(*color: float):
    return material("ShaderNodeBsdfDiffuse", Color=(*color, 1))


def box(low, high, filled, **placement):
    corners = [(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    mesh = bpy.data.meshes.new("Box")
    mesh.from_pydata(corners, [], FACES)
    mesh.materials.append(filled)
    return link("Box", mesh, **placement)


def floor(shade=0.8, half=6.0):
    return box((-half, -half, -0.2), (half, half, 0.0), diffuse(shade, shade, shade))


def lamp(kind: str, location, energy: float, turn=(0, 0, 0), **settings):
    data = bpy.data.lights.new(kind, kind)
    data.energy = energy
    for name, value in settings.items():
        setattr(data, name, value)
    return link(kind, data, location, turn)


def world_medium(node: str = "ShaderNodeVolumeScatter", **inputs) -> None:
    tree = bpy.context.scene.world.node_tree
    shader = tree.nodes.new(node)
    output = next(one for one in tree.nodes if one.type == "OUTPUT_WORLD")
    tree.links.new(shader.outputs[0], output.inputs["Volume"])
    for key, value in inputs.items():
        shader.inputs[key.replace("_", " ")].default_value = value


def noise_density(made, scale: float, low: float, strength: float) -> None:
    """Density (noise - low) x strength, in object space, of a material with a Principled Volume."""
    tree = made.node_tree
    noise, minus, times = (tree.nodes.new(f"ShaderNode{name}") for name in ("TexNoise", "Math", "Math"))
    place = tree.nodes.new("ShaderNodeTexCoord")
    noise.inputs["Scale"].default_value = scale
    minus.operation, minus.inputs[1].default_value = "SUBTRACT", low
    times.operation, times.inputs[1].default_value = "MULTIPLY", strength
    shader = next(node for node in tree.nodes if node.type == "PRINCIPLED_VOLUME")
    for source, target in (
        (place.outputs["Object"], noise.inputs["Vector"]), (noise.outputs[0], minus.inputs[0]),
        (minus.outputs[0], times.inputs[0]), (times.outputs[0], shader.inputs["Density"]),
    ):  # fmt: skip
        tree.links.new(source, target)


def spot_in_fog() -> None:
    floor()
    lamp("SPOT", (-1.5, 0, 3), 400, (0, 0.5, 0), spot_size=0.6, shadow_soft_size=0.1)
    box((-0.4, -0.4, 0.6), (0.4, 0.4, 1.2), diffuse(0.6, 0.2, 0.2))
    world_medium(Density=0.08, Color=(0.9, 0.9, 0.9, 1), Anisotropy=0.3)


def window_in_haze() -> None:
    wall = diffuse(0.7, 0.65, 0.6)
    floor()
    box((-3, 2, 0), (3, 2.2, 3.2), wall)
    box((-3.2, -3, 0), (-3, 2, 1), wall)
    box((-3.2, -3, 2.2), (-3, 2, 3.2), wall)
    box((-3.2, -3, 1), (-3, -1, 2.2), wall)
    box((-3.2, 0.5, 1), (-3, 2, 2.2), wall)
    box((-3, -3, 3), (3, 2, 3.2), wall)
    lamp("SUN", (0, 0, 5), 12, (0, -1.1, 0), angle=0.02)
    box((-2.99, -2.9, 0.01), (3, 1.99, 2.99), volume(Density=0.12, Color=(0.95, 0.95, 0.95, 1)))


def procedural_smoke() -> None:
    floor()
    lamp("POINT", (1, -1, 3), 300, shadow_soft_size=0.2)
    made = volume("ShaderNodeVolumePrincipled", Color=(0.85, 0.85, 0.85, 1))
    noise_density(made, 1.5, 0.4, 12.0)
    box((-1.25, -1.25, 0.02), (1.25, 1.25, 2.5), made)


def cloud_grid(temperature: bool = False) -> str:
    """A ball of density that grows to its middle, as a file."""
    from addon.snapshot.volumes import openvdb

    vdb, side = openvdb(), 40
    x, y, z = np.mgrid[0:side, 0:side, 0:side] / (side - 1) * 2 - 1
    radius = np.sqrt(x * x + y * y + z * z) + 0.12 * np.sin(7 * x) * np.sin(6 * y + 1) * np.sin(8 * z)
    values = np.clip(1 - radius, 0, 1).astype(np.float32)
    grids = []
    for name, grid_values in (("density", values), ("temperature", values))[: 1 + temperature]:
        grid = vdb.FloatGrid()
        grid.name = name
        grid.copyFromArray(grid_values, ijk=(-side // 2, -side // 2, 0))
        grid.transform = vdb.createLinearTransform(voxelSize=2.4 / side)
        grids.append(grid)
    path = Path(tempfile.gettempdir()) / f"candela_cloud_{int(temperature)}.vdb"
    vdb.write(str(path), grids)
    return str(path)


def _volume_object(path: str, made, location) -> None:
    data = bpy.data.volumes.new("Cloud")
    data.filepath = path
    data.materials.append(made)
    link("Cloud", data, location)


def vdb_cloud() -> None:
    floor()
    lamp("POINT", (1.5, -1, 3), 300, shadow_soft_size=0.2)
    made = volume("ShaderNodeVolumePrincipled", Density=6.0, Color=(0.9, 0.9, 0.9, 1), Anisotropy=0.2)
    _volume_object(cloud_grid(), made, (0, 0, 0.2))


def nested_boxes() -> None:
    floor()
    lamp("AREA", (0, 0, 4), 200, size=1.5)
    box((-1.4, -1, 0.02), (1.4, 1, 2.2), volume("ShaderNodeVolumeAbsorption", Density=0.5, Color=(0.9, 0.4, 0.2, 1)))
    box((-0.7, -0.5, 0.4), (0.7, 0.5, 1.6), volume(Density=1.0, Color=(0.3, 0.6, 0.9, 1)))
    box((0.2, -0.6, 0.8), (2.0, 0.6, 2.0), volume("ShaderNodeVolumeAbsorption", Density=0.8, Color=(0.3, 0.9, 0.4, 1)))


def fire() -> None:
    floor()
    lamp("POINT", (2, -2, 3), 30, shadow_soft_size=0.2)
    made = volume(
        "ShaderNodeVolumePrincipled", Density=4.0, Color=(0.3, 0.3, 0.3, 1), Blackbody_Intensity=1.0, Temperature=2600.0
    )
    _volume_object(cloud_grid(True), made, (0, 0, 0.1))


def foggy_world() -> None:
    floor()
    background().inputs["Color"].default_value = (0.5, 0.6, 0.8, 1)
    box((-0.5, 0.5, 0), (0.5, 1.5, 2.0), diffuse(0.7, 0.3, 0.2))
    box((-2, -1, 0), (-1.2, -0.2, 1.0), diffuse(0.2, 0.5, 0.3))
    box((-5, -5, 0.01), (5, 5, 2.5), volume(Density=0.15, Color=(0.9, 0.9, 0.9, 1)))


def blinds() -> None:
    """The sun between the slats of a window."""
    wall = diffuse(0.7, 0.65, 0.6)
    floor()
    box((-3, 2, 0), (3, 2.2, 3.2), wall)
    box((-3, -3, 3), (3, 2, 3.2), wall)
    for y, z in (((-3, 2), (0, 0.8)), ((-3, 2), (2.4, 3.2)), ((-3, -1.5), (0.8, 2.4)), ((1, 2), (0.8, 2.4))):
        box((-3.2, y[0], z[0]), (-3, y[1], z[1]), wall)
    for k in range(8):
        box((-3.12, -1.5, 0.8 + 0.2 * k), (-3.08, 1, 0.9 + 0.2 * k), wall)
    lamp("SUN", (0, 0, 5), 15, (0, -1.1, 0), angle=0.01)
    box((-2.99, -2.9, 0.01), (3, 1.99, 2.99), volume(Density=0.1, Color=(0.95, 0.95, 0.95, 1)))


def headlights() -> None:
    """Two narrow spots that shine past a post in a foggy night."""
    floor(0.3, 12.0)
    for x in (-0.7, 0.7):
        lamp("SPOT", (x, 5, 0.8), 400, (np.pi / 2 - 0.05, 0, np.pi + 0.15), spot_size=0.5, shadow_soft_size=0.06)
    box((0.1, 2.5, 0), (0.3, 2.7, 1.6), diffuse(0.5, 0.5, 0.5))
    world_medium(Density=0.05, Color=(0.9, 0.9, 0.9, 1), Anisotropy=0.5)


def thin_smoke() -> None:
    """Smoke of sharp noise before a wall, lit from the side."""
    floor()
    box((-3, 2, 0), (3, 2.2, 4), diffuse(0.5, 0.5, 0.55))
    lamp("AREA", (-2.5, -1, 2.5), 250, (0, -0.9, 0), size=0.6)
    made = volume("ShaderNodeVolumePrincipled", Color=(0.7, 0.7, 0.7, 1))
    noise_density(made, 3.0, 0.5, 20.0)
    box((-1.0, -0.8, 0.02), (1.0, 0.8, 2.8), made)


def spot_through_glass() -> None:
    floor()
    box((-2, -2, 0.01), (2, 2, 3.6), volume(Density=0.15, Color=(0.9, 0.9, 0.9, 1)))
    ball(0.5, material("ShaderNodeBsdfGlass", IOR=1.5, Roughness=0.0), (0, 0, 1.8))
    lamp("SPOT", (0, 0, 3.5), 300, spot_size=0.7, shadow_soft_size=0.05)


def camera_inside() -> None:
    """In a cave of thick fog, with a lamp and a box before the eye."""
    wall = diffuse(0.5, 0.45, 0.4)
    floor()
    box((-3, 3, 0), (3, 3.2, 3.2), wall)
    box((0.4, 0.2, 0), (1.0, 0.8, 1.4), diffuse(0.2, 0.4, 0.7))
    lamp("POINT", (-0.8, 0.5, 2.0), 200, shadow_soft_size=0.15)
    box((-6, -8, -0.1), (6, 4, 4), volume(Density=0.2, Color=(0.85, 0.9, 0.95, 1), Anisotropy=0.2))


def ball(radius: float, shade, location) -> None:
    bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32, radius=radius, location=location)
    made = bpy.context.object
    for face in made.data.polygons:
        face.use_smooth = True
    made.data.materials.append(shade)


def _fog_cube(anisotropy: float) -> None:
    made = volume("ShaderNodeVolumeCoefficients", Absorption_Coefficients=(0.02,) * 3, Scatter_Coefficients=(0.15,) * 3,
                  Anisotropy=anisotropy)  # fmt: skip
    box((-2, -2, -2), (2, 2, 2), made)


def _lens(anisotropy: float) -> None:
    camera("Side", (0, -7, 0), SIDE_VIEW, 0.55)
    _fog_cube(anisotropy)
    ball(0.5, material("ShaderNodeBsdfGlass", IOR=1.5, Roughness=0.0), (0, 0, 0.5))
    lamp("SPOT", (0, 0, 3.4), 400, spot_size=0.7, shadow_soft_size=0.05)


def glass_ball() -> None:
    _lens(0.0)


def glass_ball_forward() -> None:
    _lens(0.7)


def glass_ball_backward() -> None:
    _lens(-0.7)


def metal_ring() -> None:
    camera("Above", (0, -5, 3.5), (0.95, 0, 0), 0.6)
    _fog_cube(0.0)
    angle = np.linspace(0, 2 * np.pi, 97)[:-1]
    corners = [(np.cos(a), np.sin(a), z) for a in angle for z in (-0.5, 0.0)]
    faces = [(2 * k, 2 * k + 1, (2 * k + 3) % 192, (2 * k + 2) % 192) for k in range(96)]
    mesh = bpy.data.meshes.new("Ring")
    mesh.from_pydata(corners, [], faces)
    for face in mesh.polygons:
        face.use_smooth = True
    mesh.materials.append(
        material("ShaderNodeBsdfPrincipled", Metallic=1.0, Roughness=0.0, Base_Color=(0.9, 0.9, 0.9, 1))
    )
    link("Ring", mesh)
    lamp("SPOT", (2.6, 0, 1.3), 300, (0, 1.1, 0), spot_size=0.7, shadow_soft_size=0.05)


POOL_HALF, POOL_TOP, POOL_BOTTOM = 1.2, 1.6, 1.3  # of a pane with waves, above a box of fog, m
POOL_FOG = (-1.8, -1.8, -1.8), (1.8, 1.8, 1.25)
WAVES = (
    (0.03, 3.0, 1.0, 0.3),
    (0.02, -1.5, 4.0, 1.7),
    (0.012, 7.0, 2.5, 0.9),
)  # height; per metre of x, y; phase


def wave_height(x, y):
    return POOL_TOP + sum(height * np.sin(a * x + b * y + phase) for height, a, b, phase in WAVES)


def wave_slope(x, y):
    """Of the height along x and along y."""
    slopes = [(height * np.cos(a * x + b * y + phase), a, b) for height, a, b, phase in WAVES]
    return sum(s * a for s, a, _ in slopes), sum(s * b for s, _, b in slopes)


def waves(side: int = 96) -> None:
    """W4: the sun straight down through a pane whose top has waves."""
    camera("Side", (0, -7, 0), SIDE_VIEW, 0.55)
    made = volume("ShaderNodeVolumeCoefficients", Absorption_Coefficients=(0.02,) * 3, Scatter_Coefficients=(0.15,) * 3)
    box(*POOL_FOG, made)
    line = np.linspace(-POOL_HALF, POOL_HALF, side)
    x, y = (values.ravel() for values in np.meshgrid(line, line))
    corners = [*zip(x, y, wave_height(x, y))]
    top = [(r * side + c, r * side + c + 1, (r + 1) * side + c + 1, (r + 1) * side + c)
           for r in range(side - 1) for c in range(side - 1)]  # fmt: skip
    rim = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    first = len(corners)
    corners += [(a * POOL_HALF, b * POOL_HALF, POOL_BOTTOM) for a, b in rim]
    mesh = bpy.data.meshes.new("Waves")
    mesh.from_pydata(corners, [], [*top, (first + 3, first + 2, first + 1, first)])
    for face in mesh.polygons[: len(top)]:
        face.use_smooth = True
    mesh.materials.append(material("ShaderNodeBsdfGlass", IOR=1.33, Roughness=0.0))
    link("Waves", mesh)
    lamp("SUN", (0, 0, 5), 2.0, angle=0.0)


MEDIA = {
    "spot in fog": spot_in_fog, "window in haze": window_in_haze, "procedural smoke": procedural_smoke,
    "VDB cloud": vdb_cloud, "nested boxes": nested_boxes, "fire": fire, "foggy world": foggy_world,
}  # fmt: skip
# Scenes of the page, with the scatterings before the one towards the eye: none in a new file, some for what is white.
ROOMS = {
    "window in haze": (window_in_haze, 0), "blinds": (blinds, 0), "headlights": (headlights, 0),
    "VDB cloud": (vdb_cloud, 4), "smoke": (thin_smoke, 0), "fire": (fire, 0),
    "spot through glass": (spot_through_glass, 0), "foggy world": (foggy_world, 0), "camera inside": (camera_inside, 4),
}  # fmt: skip
CAUSTICS = {
    "W1 glass ball": glass_ball, "W2 metal ring": metal_ring, "W3 g = .7": glass_ball_forward,
    "W3 g = -.7": glass_ball_backward, "W4 waves": waves,
}  # fmt: skip
