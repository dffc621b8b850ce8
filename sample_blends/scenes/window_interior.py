"""A room in the morning: sun and sky come in through one window.

What it tests: light that reaches most of the room only through an opening (sun, sky image, an area light in the
window), sharp-to-soft bars of sunlight, image textures on UVs that repeat, a roughness image, closed geometry with thin
walls that must not leak, a point light within a lamp shade.
"""

import numpy as np

from .construct import camera, collection, data_image, diffuse, image, light, mesh, place, principled, solid, world
from .pictures import painting, planks, rug, sky
from .shapes import Shape, box, cylinder, extrude, grid, join, lathe, plane, tube

HALF_X, HALF_Y, HEIGHT = 2.3, 2.5, 2.7  # metres, inside
WALL = 0.22
WINDOW_Y, WINDOW_WIDTH, SILL, LINTEL = 0.35, 2.0, 0.72, 2.25  # in the left wall


def build() -> None:
    random = np.random.default_rng(11)
    plaster = diffuse("Plaster", (0.78, 0.73, 0.64))
    white = principled("White Paint", (0.80, 0.79, 0.75), roughness=0.45)
    oak = principled("Oak", (0.46, 0.27, 0.13), roughness=0.5)
    build_room(plaster, white, random)
    build_window(white)
    build_table(oak)
    build_armchair(oak)
    build_shelf(oak, random)
    build_decoration(white, random)
    build_lights()
    view = camera((1.98, -2.2, 1.50), (-0.72, 1.0, 0.86), lens=22)
    view.data.clip_start = 0.02
    light_of_sky = sky(64, (0.20, 0.38, 0.80), (0.85, 0.92, 1.0), (0.24, 0.22, 0.17), (1.1, 0.9, 0.6), 180.0)
    world(strength=0.9, picture=image("Morning Sky", light_of_sky, linear=True), turn_degrees=-20.0)


def build_room(plaster, white, random) -> None:
    into = collection("Room")
    color, rough = planks(512, 8, random)
    boards = principled(
        "Floor Boards",
        picture=image("Floor Boards", color),
        roughness_picture=data_image("Floor Boards Roughness", rough),
    )
    floor = plane(2 * HALF_X, 2 * HALF_Y, repeat=(2 * HALF_X / 1.6, 2 * HALF_Y / 1.6))
    solid("Floor", floor, boards, into=into)
    outer_x, outer_y = 2 * (HALF_X + WALL), 2 * (HALF_Y + WALL)
    solid("Ceiling", box(outer_x, outer_y, WALL).moved(z=HEIGHT), plaster, into=into)
    solid("Slab", box(outer_x, outer_y, WALL).moved(z=-WALL - 0.002), plaster, into=into)
    across = [box(outer_x, WALL, HEIGHT).moved(y=side * (HALF_Y + WALL / 2)) for side in (-1, 1)]
    right = box(WALL, 2 * HALF_Y, HEIGHT).moved(x=HALF_X + WALL / 2)
    solid("Walls", join([*across, right]), plaster, into=into)
    solid("Window Wall", window_wall(), plaster, into=into)
    skirting = [
        box(2 * HALF_X, 0.025, 0.11).moved(y=HALF_Y - 0.0125),
        box(0.025, 2 * HALF_Y - 0.05, 0.11).moved(x=-HALF_X + 0.0125),
        box(0.025, 2 * HALF_Y - 0.05, 0.11).moved(x=HALF_X - 0.0125),
    ]
    solid("Skirting", join(skirting), white, into=into)


def window_wall() -> Shape:
    """The left wall as four blocks about the opening."""
    x = -HALF_X - WALL / 2
    near, far = WINDOW_Y - WINDOW_WIDTH / 2, WINDOW_Y + WINDOW_WIDTH / 2
    parts = [
        box(WALL, WINDOW_WIDTH, SILL).moved(x, WINDOW_Y),
        box(WALL, WINDOW_WIDTH, HEIGHT - LINTEL).moved(x, WINDOW_Y, LINTEL),
        box(WALL, near + HALF_Y, HEIGHT).moved(x, (near - HALF_Y) / 2),
        box(WALL, HALF_Y - far, HEIGHT).moved(x, (far + HALF_Y) / 2),
    ]
    return join(parts)


def build_window(white) -> None:
    into = collection("Window")
    tall, x = LINTEL - SILL, -HALF_X - WALL * 0.55
    edge = 0.06
    frame = [box(0.07, WINDOW_WIDTH, edge).moved(z=z) for z in (0, tall - edge)]
    frame += [box(0.07, edge, tall).moved(y=side * (WINDOW_WIDTH - edge) / 2) for side in (-1, 1)]
    frame += [box(0.06, 0.09, tall)]
    frame += [box(0.035, 0.028, tall).moved(y=side * WINDOW_WIDTH / 4) for side in (-1, 1)]
    frame += [box(0.034, WINDOW_WIDTH, 0.028).moved(z=tall * part) for part in (0.36, 0.68)]
    solid("Window Frame", join(frame), white, location=(x, WINDOW_Y, SILL), into=into)
    solid("Sill Board", box(0.34, WINDOW_WIDTH + 0.16, 0.035), white, bevel=0.008,
          location=(-HALF_X + 0.06, WINDOW_Y, SILL - 0.01), into=into)  # fmt: skip
    linen = diffuse("Linen", (0.66, 0.58, 0.46), roughness=0.5)

    def folds(phase: float):
        def surface(u, v):
            spread = 1 - 0.25 * np.sin(np.pi * v) ** 2
            x = 0.045 * np.sin(u * 7.5 * 2 * np.pi + phase) * (0.6 + 0.4 * v)
            return np.stack([x, (u - 0.5) * 0.62 * spread, 0.04 + v * 2.38], axis=-1)

        return grid(60, 8, surface)

    for name, side in (("Near Curtain", -1), ("Far Curtain", 1)):
        where = (-HALF_X + 0.12, WINDOW_Y + side * (WINDOW_WIDTH / 2 + 0.22), 0)
        solid(name, folds(side), linen, smooth_below=80, location=where, into=into)
    rail = tube([(-HALF_X + 0.12, WINDOW_Y + s * 1.62, 2.44) for s in np.linspace(-1, 1, 3)], 0.014, 8)
    solid("Curtain Rail", rail, principled("Brass", (0.8, 0.56, 0.25), roughness=0.3, metallic=1.0), into=into)


def build_table(oak) -> None:
    into = collection("Table")
    where = {"location": (-0.75, 0.35, 0), "into": into}
    top = [(0, 0.70), (0.60, 0.70), (0.62, 0.715), (0.62, 0.73), (0.61, 0.738), (0, 0.738)]
    solid("Table Top", lathe(top, 48), oak, smooth_below=40, **where)
    legs = [tube([(0.20 * c, 0.20 * s, 0.70), (0.43 * c, 0.43 * s, 0.0)], (0.028, 0.018), 12)
            for c, s in ((np.cos(a), np.sin(a)) for a in np.radians([45, 135, 225, 315]))]  # fmt: skip
    solid("Table Legs", join(legs), oak, smooth_below=50, **where)
    bowl = lathe([(0, 0.738), (0.07, 0.738), (0.15, 0.78), (0.185, 0.84), (0.175, 0.84), (0.14, 0.79), (0, 0.76)], 32)
    glazed = principled("Blue Glaze", (0.06, 0.17, 0.32), roughness=0.2)
    solid("Fruit Bowl", bowl, glazed, smooth_below=60, location=(-0.62, 0.20, 0), into=into)
    orange = principled("Orange", (0.80, 0.28, 0.03), roughness=0.45)
    fruit = mesh("Orange", lathe([(0, -0.05), *[(0.052 * np.cos(a), 0.05 * np.sin(a))
                 for a in np.linspace(-1.3, 1.3, 9)], (0, 0.05)], 18), orange, smooth_below=70)  # fmt: skip
    for i, (x, y, z) in enumerate(
        [(-0.68, 0.22, 0.825), (-0.57, 0.25, 0.825), (-0.61, 0.14, 0.825), (-0.62, 0.20, 0.90)]
    ):
        place(fruit, f"Orange {i + 1}", location=(x, y, z), into=into)
    jug = [
        (0, 0.738),
        (0.055, 0.738),
        (0.08, 0.79),
        (0.075, 0.86),
        (0.042, 0.95),
        (0.052, 0.99),
        (0.045, 0.99),
        (0, 0.9),
    ]
    solid("Jug", lathe(jug, 28), principled("Cream Glaze", (0.78, 0.72, 0.60), roughness=0.25), smooth_below=60,
          location=(-1.02, 0.42, 0), into=into)  # fmt: skip
    build_chair("Chair 1", oak, (0.12, 0.62), 75, into)
    build_chair("Chair 2", oak, (-0.95, -0.55), -15, into)


def build_chair(name: str, oak, spot, turn: float, into) -> None:
    """A plain chair that looks along -x before it is turned."""
    seat = extrude([(-0.20, 0.43), (0.20, 0.43), (0.20, 0.46), (-0.20, 0.46)], 0.42)
    legs = [tube([(x, y, 0.0), (0.85 * x, 0.85 * y, 0.44)], (0.014, 0.019), 8)
            for x in (-0.18, 0.18) for y in (-0.18, 0.18)]  # fmt: skip
    posts = [tube([(0.18, y, 0.45), (0.25, y, 0.88)], (0.017, 0.013), 8) for y in (-0.18, 0.18)]
    rails = [box(0.022, 0.40, 0.07).moved(x, 0, z) for x, z in ((0.228, 0.74), (0.205, 0.60), (0.245, 0.84))]
    chair = join([seat, *legs, *posts, *rails]).turned("z", turn - 90)
    solid(name, chair, oak, smooth_below=40, location=(*spot, 0), into=into)


def build_armchair(oak) -> None:
    into = collection("Armchair")
    wool = diffuse("Green Wool", (0.10, 0.22, 0.17), roughness=0.8)
    where = {"location": (1.22, 1.45, 0), "rotation_degrees": (0, 0, 215), "into": into}
    solid("Armchair Seat", box(0.56, 0.62, 0.20).moved(x=0.02, z=0.24), wool, bevel=0.05, **where)
    back = box(0.16, 0.62, 0.62).turned("y", -12).moved(x=-0.33, z=0.28)
    solid("Armchair Back", back, wool, bevel=0.05, **where)
    arms = [box(0.62, 0.13, 0.36).moved(x=-0.02, y=y, z=0.22) for y in (-0.38, 0.38)]
    solid("Armchair Arms", join(arms), wool, bevel=0.045, **where)
    feet = [cylinder(0.022, 0.24, 10).moved(x, y) for x in (-0.28, 0.24) for y in (-0.34, 0.34)]
    solid("Armchair Feet", join(feet), oak, **where)


def build_shelf(oak, random) -> None:
    into = collection("Shelf")
    where = {"location": (-0.95, HALF_Y - 0.15, 0), "into": into}
    levels = (0.08, 0.46, 0.84, 1.22, 1.60)
    boards = [box(1.30, 0.26, 0.025).moved(z=z) for z in levels]
    sides = [box(0.025, 0.27, 1.66).moved(x=x) for x in (-0.6625, 0.6625)]
    solid("Shelf", join([*boards, *sides]), oak, bevel=0.004, **where)
    colors = [(0.34, 0.07, 0.05), (0.07, 0.13, 0.24), (0.55, 0.40, 0.16), (0.10, 0.22, 0.15), (0.62, 0.56, 0.46)]
    covers = [diffuse(f"Book Cover {i + 1}", color) for i, color in enumerate(colors)]
    books = []
    for level in levels[:4]:
        x = -0.63
        while x < 0.58:
            thick, tall, deep = random.uniform(0.022, 0.05), random.uniform(0.18, 0.29), random.uniform(0.15, 0.2)
            if random.random() > 0.13:
                book = box(thick - 0.002, deep, tall).moved(x + thick / 2, 0.1 - deep / 2, level + 0.025)
                books.append(book.in_slot(int(random.integers(len(covers)))))
            else:
                thick = random.uniform(0.1, 0.2)
            x += thick
    solid("Books", join(books), *covers, **where)
    vase = [(0, 0), (0.06, 0), (0.09, 0.08), (0.07, 0.17), (0.03, 0.24), (0.045, 0.28), (0, 0.26)]
    terracotta = diffuse("Terracotta", (0.52, 0.20, 0.10))
    solid("Vase", lathe(vase, 24), terracotta, smooth_below=60, location=(-1.3, HALF_Y - 0.16, 1.625), into=into)


def build_decoration(white, random) -> None:
    into = collection("Decoration")
    carpet = diffuse("Kilim", (1, 1, 1), picture=image("Kilim", rug(192, 256)))
    top = plane(2.1, 1.58).moved(z=0.012)
    solid("Rug", top, carpet, location=(0.62, -0.25, 0), rotation_degrees=(0, 0, 8), into=into)
    canvas = diffuse("Hills at Sunrise", (1, 1, 1), picture=image("Hills at Sunrise", painting(192, 256)))
    picture = plane(0.96, 0.72).turned("x", 90)
    solid("Painting", picture, canvas, location=(0.72, HALF_Y - 0.03, 1.62), into=into)
    frame = join([box(1.06, 0.05, 0.05).moved(z=z) for z in (-0.41, 0.36)]
                 + [box(0.05, 0.05, 0.72).moved(x=x, z=-0.36) for x in (-0.505, 0.505)])  # fmt: skip
    solid("Picture Frame", frame, principled("Gilt", (0.78, 0.55, 0.24), roughness=0.4, metallic=1.0),
          location=(0.72, HALF_Y - 0.03, 1.62), into=into)  # fmt: skip
    shade = lathe([(0.27, 0.0), (0.22, 0.11), (0.12, 0.2), (0.035, 0.23), (0, 0.23)], 36)
    hanging = (-0.75, 0.35, 1.58)
    lining = lathe([(0.262, 0.0), (0.213, 0.105), (0.115, 0.193), (0.0, 0.222)][::-1], 36)
    enamel = principled("Red Enamel", (0.45, 0.06, 0.035), roughness=0.28)
    solid(
        "Lamp Shade", shade.in_slot(0) + lining.in_slot(1), enamel, white, smooth_below=50, location=hanging, into=into
    )
    cord = tube([(0, 0, 0.23), (0, 0, 0.7), (0, 0, HEIGHT - hanging[2])], 0.006, 6)
    solid("Lamp Cord", cord, diffuse("Cord", (0.04, 0.04, 0.04)), location=hanging, into=into)
    build_plant(into, random)


def build_plant(into, random) -> None:
    """A rubber plant in a pot, of long arching leaves."""
    spot = (1.86, -0.1, 0)
    pot = [(0, 0), (0.14, 0), (0.19, 0.3), (0.205, 0.3), (0.205, 0.34), (0.18, 0.34), (0.17, 0.29), (0, 0.29)]
    solid("Plant Pot", lathe(pot, 28), diffuse("Pot", (0.62, 0.58, 0.52)), smooth_below=40, location=spot, into=into)
    leaves = []
    for i in range(26):
        length, rise = random.uniform(0.38, 0.62), random.uniform(45, 85)

        def surface(u, v, length=length):
            width = 0.075 * np.sin(np.pi * np.clip(v, 0, 1) ** 0.75)
            x = length * v
            fold = np.abs(u - 0.5) * 0.05
            return np.stack([x, (u - 0.5) * 2 * width, fold - 0.62 * length * v**2], axis=-1)

        leaf = grid(2, 7, surface).turned("y", -rise).turned("z", i * 137.5)
        leaves.append(leaf.moved(z=0.3 + 0.022 * i))
    stem = tube([(0, 0, 0.28), (0.01, 0, 0.6), (0, 0.01, 0.92)], (0.014, 0.012, 0.008), 8)
    blades = join(leaves)
    leafy = Shape(blades.vertices, blades.faces)  # without UVs, as the stem has none
    green = principled("Rubber Plant", (0.05, 0.15, 0.045), roughness=0.3)
    solid("Plant", leafy.in_slot(0) + stem.in_slot(1), green, diffuse("Stem", (0.18, 0.12, 0.06)), smooth_below=80,
          location=spot, into=into)  # fmt: skip


def build_lights() -> None:
    into = collection("Lights")
    light("Morning Sun", "SUN", (-6, 1.4, 4.1), (-0.6, 0.15, 0.6), 15.0, (1.0, 0.80, 0.55), into, angle=np.radians(1.0))
    light("Window Fill", "AREA", (-HALF_X - WALL - 0.1, WINDOW_Y, (SILL + LINTEL) / 2), (0, WINDOW_Y, 0.9), 22,
          (0.72, 0.86, 1.0), into, shape="RECTANGLE", size=WINDOW_WIDTH, size_y=LINTEL - SILL)  # fmt: skip
    light("Pendant", "POINT", (-0.75, 0.35, 1.66), None, 9, (1.0, 0.66, 0.34), into, shadow_soft_size=0.04)
