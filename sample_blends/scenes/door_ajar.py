"""A room that is lit only through a door which stands ajar, after Veach's scene.

What it tests: indirect light through a narrow opening. The lamp stands in the next room; nothing of it reaches this one
straight, all light here has been reflected at least once, most of it twice and more.

Source: the idea is Eric Veach's ("Robust Monte Carlo Methods for Light Transport Simulation", 1997); numbers are ours.
"""

from .construct import camera, collection, diffuse, light, place, principled, solid, world
from .shapes import ball, box, join, lathe, plane, tube

ROOM_X, ROOM_Y, HEIGHT = 4.2, 3.6, 2.5
NEXT_Y = 3.0  # depth of the next room
DOOR, DOOR_HEIGHT, DOOR_X = 0.95, 2.05, 0.7
WALL = 0.12
AJAR_DEGREES = 38


def build() -> None:
    white = diffuse("Wall Paint", (0.74, 0.72, 0.68))
    wood = diffuse("Floor Boards", (0.45, 0.28, 0.15))
    build_rooms(white, wood)
    build_door(diffuse("Door Paint", (0.30, 0.42, 0.36)))
    build_table(wood)
    light("Lamp", "AREA", (-0.3, ROOM_Y / 2 + NEXT_Y - 0.6, HEIGHT - 0.05), (-0.3, ROOM_Y / 2 + NEXT_Y - 0.6, 0), 160,
          (1.0, 0.86, 0.66), shape="RECTANGLE", size=0.8, size_y=0.4)  # fmt: skip
    world((0, 0, 0))
    camera((-0.5, -ROOM_Y / 2 + 0.12, 1.45), (0.15, ROOM_Y / 2, 1.0), lens=22)


def build_rooms(white, wood) -> None:
    into = collection("Rooms")
    depth = ROOM_Y + NEXT_Y + WALL
    middle = (NEXT_Y + WALL) / 2
    solid("Floor", plane(ROOM_X, depth).moved(y=middle), wood, into=into)
    solid("Ceiling", box(ROOM_X, depth, WALL).moved(y=middle, z=HEIGHT), white, into=into)
    sides = [box(WALL, depth, HEIGHT).moved(side * (ROOM_X + WALL) / 2, middle) for side in (-1, 1)]
    end_places = (-(ROOM_Y + WALL) / 2, middle + (depth + WALL) / 2)
    ends = [box(ROOM_X + 2 * WALL, WALL, HEIGHT).moved(y=y) for y in end_places]
    solid("Walls", join([*sides, *ends]), white, into=into)
    left, right = DOOR_X - DOOR / 2, DOOR_X + DOOR / 2
    between = [
        box(left + ROOM_X / 2, WALL, HEIGHT).moved((left - ROOM_X / 2) / 2),
        box(ROOM_X / 2 - right, WALL, HEIGHT).moved((right + ROOM_X / 2) / 2),
        box(DOOR, WALL, HEIGHT - DOOR_HEIGHT).moved(DOOR_X, z=DOOR_HEIGHT),
    ]
    solid("Wall Between", join(between).moved(y=(ROOM_Y + WALL) / 2), white, into=into)


def build_door(paint) -> None:
    into = collection("Door")
    leaf = box(DOOR - 0.01, 0.045, DOOR_HEIGHT - 0.01).moved(x=-DOOR / 2)
    hinge = (DOOR_X + DOOR / 2, ROOM_Y / 2 - 0.02, 0.005)
    solid("Door Leaf", leaf, paint, location=hinge, rotation_degrees=(0, 0, AJAR_DEGREES), into=into)
    knob = place(None, "Knob", location=hinge, rotation_degrees=(0, 0, AJAR_DEGREES), into=into)
    brass = principled("Brass", (0.8, 0.58, 0.28), roughness=0.3, metallic=1.0)
    for side in (-1, 1):
        one = solid("Door Knob", ball(0.03, 16, 8).moved(-DOOR + 0.08, side * 0.06, 1.02), brass, smooth_below=60,
                    into=into)  # fmt: skip
        one.parent = knob


def build_table(wood) -> None:
    into = collection("Table")
    spot = {"location": (-0.85, 0.55, 0), "into": into}
    legs = [tube([(x, y, 0.0), (x, y, 0.7)], (0.022, 0.028), 8) for x in (-0.5, 0.5) for y in (-0.28, 0.28)]
    solid("Table", join([box(1.2, 0.75, 0.035).moved(z=0.7), *legs]), wood, **spot)
    pots = ((-0.28, 0.05, (0.62, 0.60, 0.55)), (0.02, -0.08, (0.14, 0.30, 0.48)), (0.3, 0.06, (0.60, 0.22, 0.10)))
    outline = [(0, 0), (0.07, 0), (0.12, 0.07), (0.11, 0.14), (0.06, 0.18), (0.07, 0.2), (0, 0.2)]
    for number, (x, y, color) in enumerate(pots):
        solid(f"Pot {number + 1}", lathe(outline, 24), diffuse(f"Pot {number + 1}", color), smooth_below=50,
              location=(-0.85 + x, 0.55 + y, 0.735), into=into)  # fmt: skip
