"""The Cornell box from its published measurements: an area light in a closed room of diffuse walls.

What it tests: one rectangular area light against diffuse surfaces, its penumbrae behind two turned blocks, and
later colour bleeding. The walls are not parallel, as measured.

Source: Cornell University Program of Computer Graphics, "The Cornell Box: data" (vertices, camera, lamp spectrum).
Measured in millimetres, x to the left, y up, z away from the camera; here 1 unit = 100 mm.
Colours are the usual linear-sRGB values of the published spectra.
"""

import bpy
import numpy as np

from .construct import collection, diffuse, light, place, solid, world
from .shapes import Shape

MILLIMETRES_PER_UNIT = 100.0
MIDDLE_X = 278.0  # the camera's x; becomes x = 0

WHITE = (0.725, 0.71, 0.68)
GREEN = (0.14, 0.45, 0.091)
RED = (0.63, 0.065, 0.05)
LAMP_RADIANCE = np.array([17.0, 12.0, 4.0])  # W/(sr m2), of the published 0, 8, 15.6, 18.4 at 400…700 nm

LAMP_LOWERED = 0.01  # units; as measured, the lamp lies in the plane of the ceiling, which would hide it

WALLS = {
    "Floor": (WHITE, [(552.8, 0, 0), (0, 0, 0), (0, 0, 559.2), (549.6, 0, 559.2)]),
    "Ceiling": (WHITE, [(556, 548.8, 0), (556, 548.8, 559.2), (0, 548.8, 559.2), (0, 548.8, 0)]),
    "Back Wall": (WHITE, [(549.6, 0, 559.2), (0, 0, 559.2), (0, 548.8, 559.2), (556, 548.8, 559.2)]),
    "Right Wall": (GREEN, [(0, 0, 559.2), (0, 0, 0), (0, 548.8, 0), (0, 548.8, 559.2)]),
    "Left Wall": (RED, [(552.8, 0, 0), (549.6, 0, 559.2), (556, 548.8, 559.2), (556, 548.8, 0)]),
}
BLOCKS = {  # each block's four corners in order around, and its height; both stand open on the floor
    "Short Block": ([(130, 65), (82, 225), (240, 272), (290, 114)], 165.0),
    "Tall Block": ([(423, 247), (265, 296), (314, 456), (472, 406)], 330.0),
}
LAMP_X, LAMP_Z, LAMP_Y = (213.0, 343.0), (227.0, 332.0), 548.8


def to_blender(points) -> np.ndarray:
    """Measured millimetres (x left, y up, z away) to units (x right, y away, z up)."""
    points = np.asarray(points, float)
    return np.stack([MIDDLE_X - points[..., 0], points[..., 2], points[..., 1]], axis=-1) / MILLIMETRES_PER_UNIT


def block_shape(corners, height: float) -> Shape:
    low = [(x, 0.0, z) for x, z in corners]
    high = [(x, height, z) for x, z in corners]
    faces = [(7, 6, 5, 4)] + [(i, i + 4, (i + 1) % 4 + 4, (i + 1) % 4) for i in range(4)]
    return Shape(to_blender(low + high), faces)


def build() -> None:
    paint = {WHITE: diffuse("White", WHITE), GREEN: diffuse("Green", GREEN), RED: diffuse("Red", RED)}
    room = collection("Room")
    for name, (color, corners) in WALLS.items():
        solid(name, Shape(to_blender(corners), [(0, 1, 2, 3)]), paint[color], into=room)
    blocks = collection("Blocks")
    for name, (corners, height) in BLOCKS.items():
        solid(name, block_shape(corners, height), paint[WHITE], into=blocks)
    build_lamp()
    build_camera()
    world((0, 0, 0))
    bpy.context.scene.view_settings.exposure = 0.9  # for display only
    bpy.context.scene["note"] = "Cornell box from its published measurements; 1 unit = 100 mm"


def build_lamp() -> None:
    width = (LAMP_X[1] - LAMP_X[0]) / MILLIMETRES_PER_UNIT
    depth = (LAMP_Z[1] - LAMP_Z[0]) / MILLIMETRES_PER_UNIT
    middle = to_blender((sum(LAMP_X) / 2, LAMP_Y, sum(LAMP_Z) / 2)) - (0, 0, LAMP_LOWERED)
    strongest = LAMP_RADIANCE.max()
    lamp = light(
        "Lamp",
        "AREA",
        location=middle,
        energy=np.pi * width * depth * strongest,  # Lambertian: power = pi x area x radiance
        color=LAMP_RADIANCE / strongest,
        shape="RECTANGLE",
        size=width,
        size_y=depth,
    )
    lamp.visible_camera = True  # Blender makes lights without
    lamp["note"] = f"Lowered by {LAMP_LOWERED} units: as measured, it lies in the plane of the ceiling"


def build_camera() -> None:
    data = bpy.data.cameras.new("Camera")
    data.sensor_fit = "VERTICAL"
    data.sensor_height = 25.0
    data.lens = 35.0  # 2 atan(25 / 70) = 39.3077 degrees from bottom to top
    data.clip_start, data.clip_end = 0.1, 100.0
    view = place(data, "Camera", location=to_blender((278, 273, -800)), rotation_degrees=(90, 0, 0))
    bpy.context.scene.camera = view
