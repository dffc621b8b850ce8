"""A tree, a flowering bush and grass of leaf cards before a white wall, in afternoon sun.

What it tests: transparency from an image's alpha (Principled alpha, and a Mix with Transparent), seen directly, in
shadows that dapple the wall and the bench, and against the sky; many cards one behind the other.
"""

import numpy as np

from .construct import camera, collection, cutout, diffuse, image, light, principled, solid, world
from .pictures import blossom_spray, grass_tuft, leaf_spray, sky
from .shapes import Shape, box, cylinder, extrude, grid, join, tube

TREE_SPOT = np.array([-1.15, 0.9, 0.0])
WALL_Y = 3.0
LEAF_CARDS, BLOSSOM_CARDS, GRASS_CARDS = 1050, 340, 620


def build() -> None:
    random = np.random.default_rng(23)
    build_ground()
    build_wall()
    build_bench()
    build_tree(random)
    build_bush(random)
    build_grass(random)
    light("Afternoon Sun", "SUN", (-5.5, -4.2, 6.4), (0, 0.6, 0.4), 5.2, (1.0, 0.88, 0.70), angle=np.radians(1.2))
    camera((1.0, -7.4, 1.75), (0.02, 1.0, 1.62), lens=38)
    blue = sky(64, (0.16, 0.36, 0.86), (0.70, 0.82, 0.98), (0.20, 0.22, 0.12), (0.8, 0.65, 0.45), 215.0)
    world(strength=0.85, picture=image("Afternoon Sky", blue, linear=True), turn_degrees=0.0)


# Cards


def card(width: float, height: float, fold: float = 0.0) -> Shape:
    """An upright card that stands on the origin and faces -y; `fold` bends it along its middle. UVs span the image."""
    x, z = width / 2, height
    if not fold:
        corners = np.array([(-x, 0, 0), (x, 0, 0), (x, 0, z), (-x, 0, z)])
        return Shape(corners, [(0, 1, 2, 3)], [(0, 0), (1, 0), (1, 1), (0, 1)])
    corners = np.array([(-x, fold, 0), (0, 0, 0), (x, fold, 0), (x, fold, z), (0, 0, z), (-x, fold, z)])
    uvs = [(0, 0), (0.5, 0), (0.5, 1), (0, 1), (0.5, 0), (1, 0), (1, 1), (0.5, 1)]
    return Shape(corners, [(0, 1, 4, 5), (1, 2, 3, 4)], uvs)


def oriented(shape: Shape, direction: np.ndarray, spin: float) -> Shape:
    """Turn a card so that its stalk points along `direction`, spun by `spin` degrees about it."""
    up = direction / np.linalg.norm(direction)
    side = np.cross(up, (0.31, -0.52, 0.8))
    side /= np.linalg.norm(side)
    frame = np.stack([side, np.cross(up, side), up], axis=1)
    spun = shape.turned("z", spin)
    return Shape(spun.vertices @ frame.T, spun.faces, spun.uvs)


# The tree


def build_tree(random: np.random.Generator) -> None:
    into = collection("Tree")
    wood: list[Shape] = []
    twigs: list[tuple[np.ndarray, np.ndarray]] = []  # where leaves grow, and which way

    def grow(start, direction, length: float, radius: float, level: int) -> None:
        steps = 6 if level == 0 else 4
        points, point, heading = [start], start, direction
        for _ in range(steps):
            lift = np.array([0, 0, 0.10 if level else 0.0])
            heading = heading + random.normal(0, 0.10 + 0.05 * level, 3) + lift
            heading /= np.linalg.norm(heading)
            point = point + heading * length / steps
            points.append(point)
        taper = radius * np.linspace(1, 0.55 if level < 3 else 0.3, steps + 1)
        if level == 0:
            taper[0] *= 1.45
        wood.append(tube(points, taper, (10, 7, 5, 3)[level]))
        if level >= 2:
            twigs.extend((p, heading) for p in points[1:])
        if level == 3:
            return
        count = (6, 4, 3)[level]
        first = random.uniform(0, 360)
        for i in range(count):
            at = points[-1 - (i % 2 if level == 0 else i % 3)]
            around = np.radians(first + i * 360 / count + random.uniform(-15, 15))
            side = np.array([np.cos(around), np.sin(around), 0])
            branch = heading * random.uniform(0.35, 0.7) + side * random.uniform(0.75, 1.0)
            branch[2] = max(branch[2], 0.12)
            grow(at, branch / np.linalg.norm(branch), length * random.uniform(0.62, 0.78), taper[-1] * 0.72, level + 1)

    grow(TREE_SPOT, np.array([0.06, -0.04, 1.0]), 1.75, 0.135, 0)
    bark = diffuse("Bark", (0.20, 0.14, 0.09), roughness=0.6)
    solid("Trunk and Branches", join(wood), bark, smooth_below=60, into=into)

    cards = []
    for _ in range(LEAF_CARDS):
        at, heading = twigs[random.integers(len(twigs))]
        outwards = at - TREE_SPOT - (0, 0, 2.1)
        direction = 0.6 * heading + 0.5 * outwards / np.linalg.norm(outwards) + random.normal(0, 0.45, 3)
        size = random.uniform(0.26, 0.40)
        leaf = oriented(card(size, size, fold=0.18 * size), direction, random.uniform(0, 360))
        cards.append(leaf.moved(*(at + random.normal(0, 0.05, 3))))
    picture = image("Leaf Spray", leaf_spray(256, random))
    leaves = principled("Leaves", roughness=0.55, picture=picture, use_alpha=True)
    solid("Leaves", join_all(cards), leaves, into=into)


def join_all(shapes: list[Shape]) -> Shape:
    """Join many shapes by halves, which copies far less than one after the other."""
    if len(shapes) == 1:
        return shapes[0]
    middle = len(shapes) // 2
    return join_all(shapes[:middle]) + join_all(shapes[middle:])


# The bush and the grass


def build_bush(random: np.random.Generator) -> None:
    cards = []
    for _ in range(BLOSSOM_CARDS):
        direction = random.normal(0, 1, 3)
        direction[2] = abs(direction[2]) * 0.9 + 0.05
        direction /= np.linalg.norm(direction)
        at = direction * (0.62, 0.45, 0.66) * random.uniform(0.55, 1.0)
        facing = direction + random.normal(0, 0.35, 3)
        size = random.uniform(0.26, 0.36)
        cards.append(oriented(card(size, size, fold=0.12 * size), facing, random.uniform(0, 360)).moved(*at))
    picture = image("Blossom Spray", blossom_spray(256, random))
    where = {"location": (1.95, 2.15, 0.08), "into": collection("Rose Bush")}
    solid("Roses", join_all(cards), cutout("Roses", picture), **where)
    stems = [tube([(0, 0, -0.08), (0.25 * np.cos(a), 0.2 * np.sin(a), 0.5)], (0.02, 0.008), 6)
             for a in np.linspace(0, 2 * np.pi, 6)]  # fmt: skip
    solid("Rose Stems", join(stems), diffuse("Stem", (0.14, 0.12, 0.05)), **where)


def build_grass(random: np.random.Generator) -> None:
    cards = []
    while len(cards) < GRASS_CARDS:
        x, y = random.uniform(-5.0, 5.0), random.uniform(-4.4, WALL_Y - 0.1)
        on_path = abs(x - path_middle(y)) < 0.62
        under_bench = -0.1 < x < 1.5 and 1.55 < y < 2.3
        if on_path or under_bench:
            continue
        size = random.uniform(0.22, 0.42) * (1.25 if y > WALL_Y - 0.6 else 1.0)
        tuft = card(1.5 * size, size).turned("x", random.uniform(-12, 12)).turned("z", random.uniform(0, 360))
        cards.append(tuft.moved(x, y, ground_height(x, y) - 0.02))
    picture = image("Grass Tuft", grass_tuft(128, 192, random))
    blades = principled("Grass Blades", roughness=0.7, picture=picture, use_alpha=True)
    solid("Grass", join_all(cards), blades, into=collection("Grass"))


# Ground, wall, bench


def path_middle(y):
    return 0.75 + 0.28 * np.sin(y * 0.9 + 0.4)


def ground_height(x, y):
    return 0.05 * np.sin(x * 1.3 + 0.5) * np.sin(y * 1.1) + 0.03 * np.sin(2.3 * x - y)


def build_ground() -> None:
    into = collection("Ground")

    def turf(u, v):
        x, y = (u - 0.5) * 24, v * 14 - 8
        return np.stack([x, y, ground_height(x, y) - 0.03], axis=-1)

    solid("Turf", grid(60, 36, turf), diffuse("Turf", (0.13, 0.17, 0.05)), smooth_below=60, into=into)

    def flag(y: float, turn: float, width: float) -> Shape:
        x = path_middle(y)
        stone = box(width, 0.5, 0.09).turned("z", turn)
        return stone.moved(x, y, ground_height(x, y) - 0.035)

    turns = [4, -6, 3, 8, -4, 5, -7, 2, -3, 6]
    flags = [flag(-4.3 + 0.64 * i, turn, 0.95 + 0.05 * (i % 3)) for i, turn in enumerate(turns)]
    solid("Flagstones", join(flags), diffuse("Flagstone", (0.46, 0.42, 0.36), roughness=0.4), bevel=0.02, into=into)


def build_wall() -> None:
    into = collection("Wall")
    whitewash = diffuse("Whitewash", (0.80, 0.77, 0.70), roughness=0.3)
    tiles = diffuse("Coping Tiles", (0.50, 0.19, 0.09))
    solid("Wall", box(14, 0.35, 2.35), whitewash, location=(0, WALL_Y + 0.175, -0.15), into=into)
    ridge = extrude([(-0.32, 0), (0.32, 0), (0, 0.2)], 14).turned("z", 90)
    solid("Coping", ridge, tiles, bevel=0.012, location=(0, WALL_Y + 0.175, 2.2), into=into)


def build_bench() -> None:
    into = collection("Bench")
    slats = [box(1.45, 0.095, 0.035).moved(y=y, z=0.44) for y in (-0.2, -0.09, 0.02, 0.13)]
    back = [box(1.45, 0.03, 0.10).moved(y=0.22 + 0.06 * i, z=0.56 + 0.15 * i) for i in range(3)]
    paint = principled("Blue Paint", (0.12, 0.30, 0.42), roughness=0.4)
    where = {"location": (0.72, 2.05, 0.04), "into": into}
    solid("Bench Slats", join(slats + back), paint, bevel=0.008, **where)
    iron = principled("Cast Iron", (0.04, 0.04, 0.045), roughness=0.5)
    sides = []
    for x in (-0.62, 0.62):
        sides.append(tube([(x, -0.25, -0.05), (x, -0.22, 0.3), (x, -0.2, 0.43), (x, 0.16, 0.43)], 0.022, 8))
        sides.append(tube([(x, 0.26, -0.05), (x, 0.18, 0.3), (x, 0.2, 0.5), (x, 0.38, 0.93)], 0.022, 8))
    solid("Bench Irons", join(sides), iron, smooth_below=60, **where)
    pot = cylinder(0.15, 0.26, 20)
    solid("Pot", pot, diffuse("Terracotta", (0.52, 0.21, 0.10)), smooth_below=40, location=(-0.35, 2.35, 0), into=into)
