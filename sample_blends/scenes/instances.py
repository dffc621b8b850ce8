"""A miniature town at sundown, nearly all of it instances, seen by an orthographic camera.

What it tests: instances from geometry nodes (buildings and street lamps, unevenly scaled), a particle system (trees)
and collection instances (cars); many small meshes with several materials; long sun shadows across them; point and area
lights in the streets.
"""

import bpy
import numpy as np

from .construct import camera, collection, diffuse, glaze, light, mesh, place, principled, solid, world
from .shapes import Shape, ball, box, cylinder, extrude, grid, join, lathe, plane

HALF_TOWN = 15.0  # the town spans -15…15 in x and y; one unit is about ten metres
BLOCK_PITCH, LOTS_PER_BLOCK = 5.0, 4
CENTRE = np.array([3.0, 3.0])  # the tallest houses stand here
PARK, PARK_RADIUS = np.array([-7.0, 2.6]), 4.2
SQUARE, SQUARE_RADIUS = np.array([5.0, -9.6]), 2.4
RIVER_WIDTH = 2.6
TREE_COUNT = 1500


def build() -> None:
    random = np.random.default_rng(7)
    parts = collection("Parts")
    build_ground()
    build_trees(parts)
    build_houses(parts, random)
    build_lamps(parts)
    build_cars(parts, random)
    build_square()
    build_lights()
    view = camera((34, -38, 38), (0.6, -1.6, 0.6), lens=50)
    view.data.type = "ORTHO"
    view.data.ortho_scale = 27.0
    world((0.10, 0.135, 0.25), strength=1.0)
    bpy.context.view_layer.layer_collection.children[parts.name].exclude = True  # only instances show them


# The ground


def river_middle(x):
    """The y of the river's middle line at x."""
    return -6.2 + 2.6 * np.sin(x / 6.5 + 0.9)


def build_ground() -> None:
    into = collection("Ground")
    tray = box(2 * HALF_TOWN + 1, 2 * HALF_TOWN + 1, 1.2).moved(z=-1.2)
    solid("Town Tray", tray, diffuse("Asphalt", (0.30, 0.27, 0.27)), bevel=0.12, into=into)
    solid("Table", plane(400, 400).moved(z=-1.2), diffuse("Table", (0.36, 0.34, 0.40)), into=into)

    def water(u, v):
        x = (u - 0.5) * (2 * HALF_TOWN + 0.4)
        return np.stack([x, river_middle(x) + (v - 0.5) * RIVER_WIDTH, 0 * x + 0.04], axis=-1)

    river = principled("River", (0.05, 0.16, 0.24), roughness=0.22)
    solid("River Water", grid(48, 1, water), river, into=into)


def is_built(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Where houses may stand: off the river, the park and the square."""
    off_river = np.abs(y - river_middle(x)) > RIVER_WIDTH / 2 + 0.75
    off_park = np.hypot(x - PARK[0], y - PARK[1]) > PARK_RADIUS + 0.45
    off_square = np.hypot(x - SQUARE[0], y - SQUARE[1]) > SQUARE_RADIUS + 0.3
    return off_river & off_park & off_square


# Instances by geometry nodes


def scatter(name: str, positions, kinds, turns, sizes, parts: bpy.types.Collection, into) -> None:
    """Instance `parts`, in the order of their names, on points that carry their kind, turn (radians) and size."""
    data = bpy.data.meshes.new(name)
    data.from_pydata(np.asarray(positions, float).tolist(), [], [])
    euler = np.zeros((len(positions), 3), np.float32)
    euler[:, 2] = turns
    data.attributes.new("kind", "INT", "POINT").data.foreach_set("value", np.asarray(kinds, np.int32))
    data.attributes.new("turn", "FLOAT_VECTOR", "POINT").data.foreach_set("vector", euler.ravel())
    size = np.ascontiguousarray(sizes, np.float32)
    data.attributes.new("size", "FLOAT_VECTOR", "POINT").data.foreach_set("vector", size.ravel())
    thing = place(data, name, into=into)
    thing.modifiers.new("Scatter", "NODES").node_group = scatter_nodes(f"Scatter {name}", parts)


def scatter_nodes(name: str, parts: bpy.types.Collection) -> bpy.types.NodeTree:
    tree = bpy.data.node_groups.new(name, "GeometryNodeTree")
    tree.is_modifier = True
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")

    def node(kind: str, x: float, y: float):
        new = tree.nodes.new(kind)
        new.location = (x, y)
        return new

    def attribute(attribute_name: str, kind: str, y: float):
        new = node("GeometryNodeInputNamedAttribute", -260, y)
        new.data_type = kind
        new.inputs["Name"].default_value = attribute_name
        return new.outputs["Attribute"]

    instance = node("GeometryNodeInstanceOnPoints", 0, 0)
    instance.inputs["Pick Instance"].default_value = True
    source = node("GeometryNodeCollectionInfo", -260, -60)
    source.inputs["Collection"].default_value = parts
    source.inputs["Separate Children"].default_value = True
    source.inputs["Reset Children"].default_value = True
    links = tree.links
    links.new(node("NodeGroupInput", -260, 60).outputs[0], instance.inputs["Points"])
    links.new(source.outputs["Instances"], instance.inputs["Instance"])
    links.new(attribute("kind", "INT", -240), instance.inputs["Instance Index"])
    links.new(attribute("turn", "FLOAT_VECTOR", -380), instance.inputs["Rotation"])
    links.new(attribute("size", "FLOAT_VECTOR", -520), instance.inputs["Scale"])
    links.new(instance.outputs["Instances"], node("NodeGroupOutput", 220, 0).inputs[0])
    return tree


# Houses: each fills a lot of 1 x 1 and is 1 high before scaling; slot 0 is the wall, slot 1 the roof


def gable_house() -> Shape:
    roof = extrude([(-0.48, 0.6), (0.48, 0.6), (0, 1.0)], 0.86).in_slot(1)
    return box(0.84, 0.78, 0.6).in_slot(0) + roof


def stepped_tower() -> Shape:
    low, middle, high = box(0.86, 0.86, 0.45), box(0.64, 0.64, 0.33), box(0.4, 0.4, 0.18)
    return low.in_slot(0) + middle.moved(z=0.45).in_slot(0) + high.moved(z=0.78).in_slot(1)


def flat_slab() -> Shape:
    units = box(0.24, 0.24, 0.1).moved(-0.2, 0.1, 0.9) + box(0.3, 0.16, 0.06).moved(0.16, -0.22, 0.9)
    return box(0.88, 0.7, 0.9).in_slot(0) + units.in_slot(1)


def round_tower() -> Shape:
    angles = np.linspace(0, np.pi / 2, 4)[1:-1]
    dome = [(0.4, 0.8)] + [(0.4 * np.cos(a), 0.8 + 0.2 * np.sin(a)) for a in angles] + [(0, 1.0)]
    return lathe([(0.4, 0), (0.4, 0.8)], 10).in_slot(0) + lathe(dome, 10).in_slot(1)


def spire() -> Shape:
    body = lathe([(0.42, 0), (0.42, 0.35), (0.3, 0.4), (0.3, 0.7)], 8).turned("z", 22.5)
    return body.in_slot(0) + lathe([(0.36, 0.68), (0, 1.0)], 8).turned("z", 22.5).in_slot(1)


def sawtooth_hall() -> Shape:
    teeth = [(0.45, 0.6), (0.45, 1.0), (0.15, 0.7), (0.15, 1.0), (-0.15, 0.7), (-0.15, 1.0), (-0.45, 0.7), (-0.45, 0.6)]
    return box(0.9, 0.8, 0.6).in_slot(0) + extrude(teeth, 0.8).in_slot(1)


def build_houses(parts: bpy.types.Collection, random: np.random.Generator) -> None:
    brick = principled("Brick", (0.42, 0.15, 0.10), roughness=0.8)
    cream = diffuse("Cream Plaster", (0.74, 0.66, 0.52))
    rose = diffuse("Rose Plaster", (0.66, 0.38, 0.33), roughness=0.5)
    concrete = principled("Concrete", (0.48, 0.47, 0.46), roughness=0.7)
    window = glaze("Curtain Wall", (0.10, 0.19, 0.26), (0.8, 0.85, 0.9), roughness=0.3, share=0.25)
    slate = principled("Slate", (0.09, 0.11, 0.15), roughness=0.6)
    tile = diffuse("Roof Tile", (0.52, 0.17, 0.07))
    copper = principled("Green Copper", (0.16, 0.42, 0.34), roughness=0.55)
    brass = principled("Brass Roof", (0.80, 0.56, 0.24), roughness=0.35, metallic=1.0)
    kinds = [
        ("Gable House, Brick", gable_house(), (brick, slate)),
        ("Gable House, Cream", gable_house(), (cream, tile)),
        ("Gable House, Rose", gable_house(), (rose, tile)),
        ("Sawtooth Hall", sawtooth_hall(), (brick, copper)),
        ("Round Tower", round_tower(), (cream, copper)),
        ("Spire", spire(), (rose, slate)),
        ("Flat Slab, Concrete", flat_slab(), (concrete, slate)),
        ("Flat Slab, Glass", flat_slab(), (window, concrete)),
        ("Stepped Tower, Cream", stepped_tower(), (cream, brass)),
        ("Stepped Tower, Glass", stepped_tower(), (window, copper)),
    ]
    low_shares = np.array([0.24, 0.26, 0.24, 0.08, 0.06, 0.06, 0.04, 0.02, 0, 0])
    high_shares = np.array([0, 0, 0, 0, 0.06, 0.04, 0.22, 0.26, 0.22, 0.20])

    houses = collection("House Kinds", parts)
    for i, (name, shape, materials) in enumerate(kinds):
        place(mesh(name, shape, *materials, smooth_below=40), f"{i:02d} {name}", into=houses)

    cell = np.arange(-HALF_TOWN, HALF_TOWN, BLOCK_PITCH)
    lot = np.concatenate([start + 1.0 + np.arange(LOTS_PER_BLOCK) for start in cell])
    x, y = (axis.ravel() for axis in np.meshgrid(lot, lot))
    free = is_built(x, y) & (random.random(x.size) > 0.05)
    x, y = x[free], y[free]
    downtown = np.exp(-(((x - CENTRE[0]) / 6.5) ** 2) - ((y - CENTRE[1]) / 5.5) ** 2)
    height = 0.75 + 0.35 * random.random(x.size) + 5.0 * downtown**1.4 * (0.35 + 0.65 * random.random(x.size))
    kind = []
    for share in downtown:
        likely = low_shares + (high_shares - low_shares) * min(1.0, 1.6 * share)
        kind.append(random.choice(len(kinds), p=likely / likely.sum()))
    turn = random.integers(0, 4, x.size) * np.pi / 2
    width = 0.86 + 0.14 * random.random((x.size, 2))
    positions = np.stack([x, y, 0 * x], axis=1)
    scatter("Houses", positions, kind, turn, np.column_stack([width, height]), houses, collection("Houses"))


def build_lamps(parts: bpy.types.Collection) -> None:
    iron = principled("Lamp Iron", (0.05, 0.06, 0.07), roughness=0.5)
    milk = diffuse("Lamp Globe", (0.9, 0.88, 0.82))
    post = lathe([(0.035, 0), (0.018, 0.06), (0.018, 0.5)], 5).in_slot(0) + ball(0.05, 6, 4).moved(z=0.53).in_slot(1)
    kinds = collection("Lamp Kinds", parts)
    place(mesh("Street Lamp", post, iron, milk, smooth_below=60), "Street Lamp", into=kinds)
    street = np.arange(-HALF_TOWN + BLOCK_PITCH, HALF_TOWN, BLOCK_PITCH) - 0.28
    along = np.arange(-HALF_TOWN + 0.5, HALF_TOWN, 1.0)
    x, y = (axis.ravel() for axis in np.meshgrid(street, along))
    x, y = np.concatenate([x, y]), np.concatenate([y, x])
    free = np.abs(y - river_middle(x)) > RIVER_WIDTH / 2 + 0.1
    free &= np.hypot(*(np.stack([x, y], 1) - PARK).T) > PARK_RADIUS
    free &= np.hypot(*(np.stack([x, y], 1) - SQUARE).T) > SQUARE_RADIUS
    positions = np.stack([x, y, 0 * x], axis=1)[free]
    ones = np.ones((len(positions), 3))
    scatter("Street Lamps", positions, ones[:, 0] * 0, ones[:, 0] * 0, ones, kinds, collection("Street Lamps"))


# Trees by particles, cars by collection instances


def build_trees(parts: bpy.types.Collection) -> None:
    bark = diffuse("Bark", (0.16, 0.09, 0.05))
    fir = lathe([(0.30, 0.16), (0.10, 0.58), (0.21, 0.52), (0, 1.0)], 6)
    crown = ball(0.32, 6, 4).scaled(1, 1, 1.15).moved(z=0.56)
    trunk = lathe([(0.05, 0), (0.04, 0.3)], 5).in_slot(1)
    kinds = collection("Tree Kinds", parts)
    for name, shape, color in [
        ("Fir", fir, (0.05, 0.16, 0.09)),
        ("Lime Tree", crown, (0.17, 0.27, 0.05)),
        ("Copper Beech", crown.scaled(0.85, 0.85, 0.95), (0.36, 0.10, 0.05)),
    ]:
        whole = mesh(name, shape.in_slot(0) + trunk, diffuse(f"{name} Leaves", color), bark, smooth_below=30)
        place(whole, name, into=kinds)

    def bank(side: int):
        def surface(u, v):
            x = (u - 0.5) * (2 * HALF_TOWN - 0.6)
            y = river_middle(x) + side * (RIVER_WIDTH / 2 + 0.08 + v * 0.6)
            return np.stack([x, y, 0 * x + 0.03], axis=-1)

        return grid(48, 1, surface)

    angles = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    rim = [(PARK[0] + PARK_RADIUS * np.cos(a), PARK[1] + PARK_RADIUS * np.sin(a), 0.05) for a in angles]
    park = Shape(np.array([*rim, (*PARK, 0.05)]), [(i, (i + 1) % 48, 48) for i in range(48)])
    near_bank = bank(-1)
    near_bank = Shape(near_bank.vertices, [face[::-1] for face in near_bank.faces])  # mirrored: turn faces up again
    lawn = join([near_bank, Shape(bank(1).vertices, bank(1).faces), park])
    green = solid("Lawns", lawn, diffuse("Grass", (0.16, 0.25, 0.08)), into=collection("Lawns"))

    system = green.modifiers.new("Trees", "PARTICLE_SYSTEM").particle_system
    system.seed = 3
    settings = system.settings
    settings.name = "Trees"
    settings.type = "HAIR"
    settings.use_advanced_hair = True
    settings.count = TREE_COUNT
    settings.hair_length = 1.0
    settings.distribution = "RAND"
    settings.render_type = "COLLECTION"
    settings.instance_collection = kinds
    settings.use_collection_pick_random = True
    settings.particle_size = 0.62
    settings.size_random = 0.5
    settings.use_rotations = True
    settings.rotation_mode = "NONE"  # upright, as the parts stand


def build_cars(parts: bpy.types.Collection, random: np.random.Generator) -> None:
    rubber = diffuse("Tyre", (0.03, 0.03, 0.03))
    glass = principled("Car Window", (0.03, 0.04, 0.05), roughness=0.2)
    outline = [(-0.21, 0.03), (0.21, 0.03), (0.21, 0.09), (0.12, 0.1), (-0.2, 0.1)]
    cabin = extrude([(-0.17, 0.1), (0.1, 0.1), (0.04, 0.16), (-0.13, 0.16)], 0.15)
    wheel = cylinder(0.035, 0.03, 8).turned("x", 90).moved(z=0.035)
    wheels = join([wheel.moved(x=x, y=y) for x in (-0.12, 0.12) for y in (-0.065, 0.095)])
    cars = []
    for name, color in [("Red", (0.55, 0.05, 0.04)), ("White", (0.75, 0.75, 0.72)), ("Blue", (0.06, 0.20, 0.45))]:
        car = collection(f"{name} Car", parts)
        paint = principled(f"{name} Paint", color, roughness=0.3)
        place(
            mesh(f"{name} Car Body", extrude(outline, 0.17) + cabin.in_slot(1), paint, glass), f"{name} Body", into=car
        )
        place(mesh(f"{name} Car Wheels", wheels, rubber), f"{name} Wheels", into=car)
        cars.append(car)

    into = collection("Cars")
    for i in range(80):
        street = random.integers(-2, 3) * BLOCK_PITCH
        along = random.uniform(-HALF_TOWN + 1, HALF_TOWN - 1)
        lane = 0.16 * random.choice([-1, 1])
        goes_east = random.random() < 0.5
        x, y = (along, street + lane) if goes_east else (street - lane, along)
        if abs(y - river_middle(x)) < RIVER_WIDTH / 2 + 0.9 or not (is_built(np.array(x), np.array(y))):
            continue
        heading = (180 if lane > 0 else 0) if goes_east else (90 if lane < 0 else 270)
        thing = place(None, f"Car {i:02d}", location=(x, y, 0), rotation_degrees=(0, 0, heading), into=into)
        thing.instance_type = "COLLECTION"
        thing.instance_collection = cars[random.integers(3)]
        thing.empty_display_size = 0.2


def build_square() -> None:
    into = collection("Square")
    steps = [(SQUARE_RADIUS, 0), (SQUARE_RADIUS, 0.06), (2.0, 0.06), (2.0, 0.12), (0, 0.12)]
    solid("Market Square", lathe(steps, 48), diffuse("Pale Paving", (0.62, 0.55, 0.46)), smooth_below=30,
          location=(*SQUARE, 0), into=into)  # fmt: skip
    column = [(0.35, 0.12), (0.35, 0.3), (0.14, 0.4), (0.1, 1.9), (0.2, 2.0), (0.2, 2.08), (0, 2.08)]
    solid("Monument", lathe(column, 20) + ball(0.2, 20, 10).moved(z=2.27),
          principled("Gilded", (0.9, 0.62, 0.22), roughness=0.3, metallic=1.0), smooth_below=40,
          location=(*SQUARE, 0), into=into)  # fmt: skip


def build_lights() -> None:
    into = collection("Lights")
    light("Setting Sun", "SUN", (-30, -14, 16), (0, 0, 0), 4.2, (1.0, 0.66, 0.38), into, angle=np.radians(1.5))
    light("Square Light", "AREA", (SQUARE[0] + 2.6, SQUARE[1] - 1.6, 3.4), (*SQUARE, 0.3), 120, (1.0, 0.72, 0.36), into,
          shape="RECTANGLE", size=1.2, size_y=0.5)  # fmt: skip
    for i, (x, y) in enumerate([(0.0, -2.0), (-5.0, -2.6), (10.0, -1.0), (0.0, -10.0)]):
        light(f"Street Light {i + 1}", "POINT", (x, y, 0.9), None, 26, (1.0, 0.62, 0.28), into, shadow_soft_size=0.12)
