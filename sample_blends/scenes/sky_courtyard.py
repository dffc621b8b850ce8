"""A narrow courtyard under the open sky, with coloured walls and an arcade.

What it tests: the world as a source of indirect light. There is no lamp and no sun: the sky lights the upper walls and
a part of the ground, and what the arcade receives has come by way of them.
"""

from .construct import camera, collection, diffuse, image, mesh, place, solid, world
from .pictures import sky
from .shapes import arch, ball, box, cylinder, join, lathe, plane

HALF_X, HALF_Y, HEIGHT = 2.6, 4.2, 6.5
ARCADE, ARCADE_HEIGHT = 1.8, 2.9


def build() -> None:
    ochre = diffuse("Ochre Wall", (0.66, 0.45, 0.20))
    rose = diffuse("Rose Wall", (0.62, 0.30, 0.24))
    white = diffuse("Whitewash", (0.76, 0.74, 0.70))
    paving = diffuse("Paving", (0.40, 0.38, 0.36))
    build_walls(ochre, rose, white, paving)
    build_arcade(white)
    build_well(diffuse("Well Stone", (0.50, 0.47, 0.42)), diffuse("Leaves", (0.10, 0.24, 0.07)))
    world(picture=image("Evening Sky", sky(64, (0.25, 0.45, 1.0), (1.0, 0.85, 0.7), (0.25, 0.22, 0.2),
          (5.0, 3.4, 1.8), 35), linear=True), strength=1.0)  # fmt: skip
    camera((-1.9, -HALF_Y + 0.4, 1.6), (1.1, 1.4, 1.5), lens=22)


def build_walls(ochre, rose, white, paving) -> None:
    into = collection("Walls")
    solid("Ground", plane(2 * HALF_X + 2 * ARCADE + 2, 2 * HALF_Y + 2), paving, into=into)
    solid("West Wall", box(0.4, 2 * HALF_Y, HEIGHT).moved(-HALF_X - 0.2), ochre, into=into)
    solid("East Upper Wall", box(0.4, 2 * HALF_Y, HEIGHT - 3.6).moved(HALF_X + 0.2, z=3.6), rose, into=into)
    ends = [box(2 * HALF_X + ARCADE + 1.2, 0.4, HEIGHT).moved(0.5 * ARCADE, side * (HALF_Y + 0.2)) for side in (-1, 1)]
    solid("End Walls", join(ends), white, into=into)
    solid("Arcade Back Wall", box(0.3, 2 * HALF_Y, 3.6).moved(HALF_X + ARCADE + 0.15), white, into=into)
    solid("Arcade Ceiling", box(ARCADE + 0.4, 2 * HALF_Y, 0.2).moved(HALF_X + ARCADE / 2, z=3.4), white, into=into)


def build_arcade(white) -> None:
    into = collection("Arcade")
    pillar = mesh("Pillar", cylinder(0.17, 2.3, 18), white, smooth_below=40)
    span = mesh("Arcade Arch", arch(2.1, 1.3, 1.7, 0.2, 0.4, 12), white, smooth_below=40)
    for number in range(5):
        place(pillar, f"Pillar {number + 1}", location=(HALF_X + 0.2, (number - 2) * 2.1, 0), into=into)
    for number in range(4):
        place(span, f"Arcade Arch {number + 1}", location=(HALF_X + 0.2, (number - 1.5) * 2.1, 2.3),
              rotation_degrees=(0, 0, 90), into=into)  # fmt: skip


def build_well(stone, green) -> None:
    into = collection("Well")
    rim = [(0, 0), (0.62, 0), (0.62, 0.7), (0.68, 0.72), (0.68, 0.82), (0.48, 0.82), (0.48, 0.2), (0, 0.2)]
    solid("Well", lathe(rim, 32), stone, smooth_below=40, location=(-0.1, 0.9, 0), into=into)
    for number, (x, y) in enumerate(((-1.9, 2.9), (1.6, 3.3))):
        solid(f"Tub {number + 1}", lathe([(0, 0), (0.24, 0), (0.33, 0.5), (0.28, 0.5), (0, 0.44)], 24), stone,
              smooth_below=40, location=(x, y, 0), into=into)  # fmt: skip
        solid(f"Shrub {number + 1}", ball(0.42, 20, 12), green, smooth_below=80, location=(x, y, 0.85), into=into)
