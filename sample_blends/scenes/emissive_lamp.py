"""A corner of a room at night, lit by one lamp whose paper shade is an emissive mesh.

What it tests: meshes as sources of indirect light. There is no light object and the world is black; what lies below the
table and behind the stool is lit by way of ceiling, walls and floor.
"""

from .construct import camera, collection, diffuse, emission, principled, solid, world
from .shapes import box, join, lathe, plane, tube

HALF, HEIGHT = 1.9, 2.4


def build() -> None:
    build_room()
    build_lamp()
    build_things()
    world((0, 0, 0))
    camera((-1.45, -1.6, 1.35), (0.55, 0.9, 0.85), lens=24)


def build_room() -> None:
    into = collection("Room")
    wall, warm = diffuse("Grey Wall", (0.62, 0.62, 0.60)), diffuse("Terracotta Wall", (0.60, 0.26, 0.16))
    solid("Floor", plane(2 * HALF, 2 * HALF), diffuse("Parquet", (0.36, 0.22, 0.12)), into=into)
    solid("Ceiling", box(2 * HALF, 2 * HALF, 0.1).moved(z=HEIGHT), diffuse("Ceiling", (0.78, 0.78, 0.76)), into=into)
    solid("Back Wall", box(2 * HALF, 0.1, HEIGHT).moved(y=HALF + 0.05), wall, into=into)
    solid("Right Wall", box(0.1, 2 * HALF, HEIGHT).moved(x=HALF + 0.05), warm, into=into)
    solid("Left Wall", box(0.1, 2 * HALF, HEIGHT).moved(x=-HALF - 0.05), wall, into=into)
    solid("Front Wall", box(2 * HALF, 0.1, HEIGHT).moved(y=-HALF - 0.05), wall, into=into)


def build_lamp() -> None:
    into = collection("Lamp")
    spot = (0.95, 1.05, 0.62)
    foot = lathe([(0, 0), (0.11, 0), (0.11, 0.02), (0.02, 0.05), (0.016, 0.34), (0, 0.34)], 24)
    dark = diffuse("Lamp Foot", (0.05, 0.05, 0.05))
    solid("Lamp Foot", foot, dark, smooth_below=40, location=spot, into=into)
    shade = lathe([(0, 0.30), (0.20, 0.30), (0.12, 0.56), (0, 0.56)], 32)
    glow = emission("Paper Shade", (1.0, 0.62, 0.32), 9.0)
    solid("Paper Shade", shade, glow, smooth_below=40, location=spot, into=into)


def build_things() -> None:
    into = collection("Things")
    wood = diffuse("Walnut", (0.25, 0.13, 0.07))
    legs = [tube([(x, y, 0), (x, y, 0.58)], (0.02, 0.024), 8) for x in (-0.42, 0.42) for y in (-0.3, 0.3)]
    table = join([box(1.0, 0.75, 0.04).moved(z=0.58), *legs])
    solid("Table", table, wood, location=(0.95, 1.1, 0), into=into)
    solid("Vase", lathe([(0, 0), (0.06, 0), (0.1, 0.1), (0.05, 0.24), (0.07, 0.27), (0, 0.25)], 24),
          principled("Green Glaze", (0.10, 0.32, 0.20), roughness=0.5), smooth_below=60, location=(0.62, 0.92, 0.62),
          into=into)  # fmt: skip
    solid("Book", box(0.22, 0.16, 0.04), diffuse("Book", (0.10, 0.18, 0.42)), location=(1.22, 0.88, 0.62),
          rotation_degrees=(0, 0, 25), into=into)  # fmt: skip
    stool = join([box(0.4, 0.4, 0.05).moved(z=0.42), *(box(0.04, 0.04, 0.42).moved(x, y)
                  for x in (-0.16, 0.16) for y in (-0.16, 0.16))])  # fmt: skip
    solid("Stool", stool, wood, location=(-0.35, 0.75, 0), rotation_degrees=(0, 0, 30), into=into)
    solid("Picture", box(0.7, 0.03, 0.5), diffuse("Picture", (0.55, 0.50, 0.18)), location=(-0.6, HALF - 0.02, 1.2),
          into=into)  # fmt: skip
