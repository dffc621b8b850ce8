"""The corpus of what goes wrong in scenes: nothing raises, every pixel is finite and not negative, nothing is repaired.

Each case changes a small room with all kinds of light and is rendered at 24x16 with two samples.
"""

import bpy
import numpy as np
import pytest

from addon import engine
from addon.compare.reference import RenderFailed
from addon.frame.technique import OF_A_PICTURE, identifier
from addon.techniques import REGISTRY
from addon.ui.properties import block_of

SIZE = (24, 16)


class Room:
    """What cases change: a floor, a box, one light of each kind, a dim world, a camera."""

    def __init__(self, stage):
        self.stage, self.scene = stage, stage.scene
        self.material = stage.principled(Base_Color=(0.7, 0.5, 0.3, 1), Roughness=0.4)
        self.floor = stage.floor(half=5, material=self.material)
        corners = [(x, y, z) for z in (0, 1) for y in (-0.5, 0.5) for x in (-0.5, 0.5)]
        faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        self.box = stage.mesh(corners, faces, material=stage.diffuse(0.8))
        self.lights = {
            "POINT": stage.light("POINT", (1, 1, 2), shadow_soft_size=0.1),
            "SPOT": stage.light("SPOT", (-1, -1, 3), shadow_soft_size=0.1, spot_size=1.0, spot_blend=0.3),
            "SUN": stage.light("SUN", turn=(0.4, 0.2, 0), angle=0.1),
            "AREA": stage.light("AREA", (0, -1, 2.5), size=0.5),
        }
        self.world = stage.world((0.05, 0.1, 0.2))
        self.camera = stage.camera((3, -5, 3), (1.1, 0, 0.5))

    def every_light(self, **settings):
        for light in self.lights.values():
            for name, value in settings.items():
                if hasattr(light.data, name):
                    setattr(light.data, name, value)

    def one_light(self, kind, **settings):
        for other, light in self.lights.items():
            light.hide_render = other != kind
        for name, value in settings.items():
            setattr(self.lights[kind].data, name, value)

    def move(self, offset):
        for thing in self.scene.objects:
            thing.location = np.array(thing.location) + offset

    def set(self, **inputs):
        node = self.material.node_tree.nodes[0]
        for name, value in inputs.items():
            node.inputs[name.replace("_", " ")].default_value = value

    def set_vertex(self, value):
        self.box.data.vertices[3].co = value

    def add(self, vertices, faces=(), edges=(), **options):
        return self.stage.mesh(vertices, faces, edges, **options)

    def emit(self, strength):
        self.set(Emission_Color=(1, 1, 1, 1), Emission_Strength=strength)

    def sky(self, texel, size=(4, 2)):
        image = bpy.data.images.new("Sky", *size, float_buffer=True)
        pixels = np.full((size[0] * size[1], 4), 0.1, np.float32)
        pixels[-1, :3] = texel
        image.pixels.foreach_set(pixels.ravel())
        tree = self.world.node_tree
        node = tree.nodes.new("ShaderNodeTexEnvironment")
        node.image = image
        background = next(node for node in tree.nodes if node.type == "BACKGROUND")
        tree.links.new(node.outputs["Color"], background.inputs["Color"])

    def world_color(self, color, strength=1.0):
        background = next(node for node in self.world.node_tree.nodes if node.type == "BACKGROUND")
        background.inputs["Color"].default_value, background.inputs["Strength"].default_value = (*color, 1), strength

    def math(self, operation, a, b, socket):
        """A number out of node math, which may be none, as an input of the material."""
        tree = self.material.node_tree
        node = tree.nodes.new("ShaderNodeMath")
        node.operation = operation
        node.inputs[0].default_value, node.inputs[1].default_value = a, b
        tree.links.new(node.outputs[0], tree.nodes[0].inputs[socket])

    def image(self, image):
        tree = self.material.node_tree
        node = tree.nodes.new("ShaderNodeTexImage")
        node.image = image
        tree.links.new(node.outputs["Color"], tree.nodes[0].inputs["Base Color"])

    def remove_all(self, keep=()):
        bpy.data.batch_remove([thing for thing in self.scene.objects if thing not in keep])

    def border(self, x0, x1, y0, y1):
        render = self.scene.render
        render.use_border = True
        render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = x0, x1, y0, y1

    def orthographic(self, scale):
        self.camera.data.type, self.camera.data.ortho_scale = "ORTHO", scale


NAN, INF = float("nan"), float("inf")


def missing_image():
    image = bpy.data.images.new("Missing", 1, 1)
    image.source, image.filepath = "FILE", "//no_such_file.png"
    return image


def many_lights(room, count):
    for k in range(count):
        room.stage.light("POINT", (k % 16 - 8, k // 16 - 8, 1.5), shadow_soft_size=0.01, energy=1)


def clip(room, start, end):
    room.camera.data.clip_start, room.camera.data.clip_end = start, end


def lens(room, angle):
    room.camera.data.angle = angle


def place(thing, where):
    thing.location = where


GEOMETRY = {
    "empty scene": lambda r: r.remove_all(keep=[r.camera]),
    "empty scene without world": lambda r: (r.remove_all(keep=[r.camera]), setattr(r.scene, "world", None)),
    "only lights": lambda r: r.remove_all(keep=[r.camera, *r.lights.values()]),
    "mesh without vertices": lambda r: r.add([]),
    "loose vertices": lambda r: r.add([(0, 0, 1), (1, 0, 1)]),
    "loose edges": lambda r: r.add([(0, 0, 1), (1, 0, 2)], edges=[(0, 1)]),
    "vertex not a number": lambda r: r.set_vertex((NAN, 0, 0)),
    "vertex at infinity": lambda r: r.set_vertex((0, INF, 0)),
    "vertex very far": lambda r: r.set_vertex((0, 0, 1e30)),
    "triangle of one point": lambda r: r.add([(0, 0, 2)] * 3, [(0, 1, 2)]),
    "triangle on a line": lambda r: r.add([(0, 0, 2), (1, 0, 2), (2, 0, 2)], [(0, 1, 2)]),
    "coplanar faces": lambda r: r.stage.floor(half=5),
    "duplicate faces": lambda r: r.add([(x, y, 2) for y in (0, 1) for x in (0, 1)] * 2, [(0, 1, 3, 2), (4, 5, 7, 6)]),
    "flipped faces": lambda r: (r.box.data.flip_normals(), r.floor.data.flip_normals()),
    "concave face": lambda r: r.add([(0, 0, 2), (2, 0, 2), (2, 2, 2), (1, 0.1, 2), (0, 2, 2)], [(0, 1, 2, 3, 4)]),
    "triangle over the screen": lambda r: r.add([(-1e3, 2, -1e3), (1e3, 2, -1e3), (0, 2, 1e3)], [(0, 1, 2)]),
    "thin wires": lambda r: [
        r.add([(-3, 0.1 * k, 1), (3, 0.1 * k, 1), (3, 0.1 * k, 1.0001)], [(0, 1, 2)]) for k in range(5)
    ],
    "scale 0": lambda r: setattr(r.box, "scale", (0, 0, 0)),
    "scale 1e-6": lambda r: setattr(r.box, "scale", (1e-6,) * 3),
    "scale 1e6": lambda r: setattr(r.box, "scale", (1e6,) * 3),
    "scale 1e-20": lambda r: setattr(r.box, "scale", (1e-20,) * 3),
    "flat scale": lambda r: setattr(r.box, "scale", (1, 1, 0)),
    "negative scale": lambda r: setattr(r.box, "scale", (-1, 1, 1)),
    "place not a number": lambda r: place(r.box, (NAN, 0, 0)),
    "object very far": lambda r: place(r.box, (0, 1e18, 0)),
    "camera inside": lambda r: place(r.camera, (0, 0, 0.5)),
    "camera on a vertex": lambda r: place(r.camera, (0.5, 0.5, 1)),
    "camera in a plane": lambda r: place(r.camera, (3, -5, 0)),
    **{f"moved by {d:g}": (lambda r, d=d: r.move((d, -d, d / 2))) for d in (1e3, 1e5, 1e7)},
}
LIGHTS = {
    "power 1e-20 in the dark": lambda r: (r.world_color((0, 0, 0)), r.every_light(energy=1e-20)),
    **{f"power {p:g}": (lambda r, p=p: r.every_light(energy=p)) for p in (0.0, 1e-20, 1e12)},
    **{
        f"size {s:g}": (lambda r, s=s: r.every_light(shadow_soft_size=s, size=s, angle=min(s, np.pi)))
        for s in (0.0, 1e-6, 1e4)
    },
    **{f"only {kind}": (lambda r, k=kind: r.one_light(k)) for kind in ("POINT", "SPOT", "SUN", "AREA")},
    **{
        f"{kind} on the floor": (lambda r, k=kind: (r.one_light(k), place(r.lights[k], (1, 0, 0))))
        for kind in ("POINT", "SPOT", "AREA")
    },
    "inside the box": lambda r: [place(light, (0, 0, 0.5)) for light in r.lights.values()],
    "at the camera": lambda r: [place(light, r.camera.location) for light in r.lights.values()],
    "very far": lambda r: [place(light, (0, 0, 1e12)) for light in r.lights.values()],
    "place not a number": lambda r: [place(light, (0, NAN, 0)) for light in r.lights.values()],
    "scale 0": lambda r: [setattr(light, "scale", (0, 0, 0)) for light in r.lights.values()],
    "negative scale": lambda r: [setattr(light, "scale", (-1, 2, -3)) for light in r.lights.values()],
    "spheres that contain the scene": lambda r: r.every_light(shadow_soft_size=50, use_soft_falloff=False),
    "narrow spot": lambda r: r.one_light("SPOT", spot_size=np.radians(1), spot_blend=0.0),
    "spot of half the world": lambda r: r.one_light("SPOT", spot_size=np.pi, spot_blend=1.0),
    "hard spot": lambda r: r.one_light("SPOT", spot_blend=0.0, shadow_soft_size=0.0),
    "narrow spot of hardly any blend": lambda r: r.one_light("SPOT", spot_size=np.radians(1), spot_blend=1e-38),
    "sun of 0 degrees": lambda r: r.one_light("SUN", angle=0.0),
    "sun of 180 degrees": lambda r: r.one_light("SUN", angle=np.pi),
    "spread 0": lambda r: r.one_light("AREA", spread=0.0),
    "spread of half a degree": lambda r: r.one_light("AREA", spread=np.radians(0.5)),
    "flat area": lambda r: r.one_light("AREA", shape="RECTANGLE", size=1.0, size_y=0.0),
    "257 lights": lambda r: many_lights(r, 253),
    "seen by the camera": lambda r: [setattr(light, "visible_camera", True) for light in r.lights.values()],
}
WORLDS = {
    "black": lambda r: r.world_color((0, 0, 0)),
    "bright": lambda r: r.world_color((1, 1, 1), 1e12),
    "dim": lambda r: r.world_color((1e-20, 0, 0)),
    "none": lambda r: setattr(r.scene, "world", None),
    "image of one texel": lambda r: r.sky((1, 2, 3), size=(1, 1)),
    "texel of a million": lambda r: r.sky((1e6, 1e6, 1e6)),
    "texel not a number": lambda r: r.sky((NAN, 1, 1)),
    "infinite texel": lambda r: r.sky((INF, 1, 1)),
    "image without pixels": lambda r: r.sky((1, 1, 1)) or setattr(bpy.data.images["Sky"], "source", "FILE"),
}
CAMERAS = {
    "orthographic": lambda r: r.orthographic(5.0),
    "orthographic, tiny": lambda r: r.orthographic(1e-4),
    "orthographic, huge": lambda r: r.orthographic(1e6),
    "orthographic, moved": lambda r: (r.orthographic(5.0), r.move((1e5, 0, 0))),
    "narrow": lambda r: lens(r, np.radians(0.4)),
    "wide": lambda r: lens(r, np.radians(172)),
    "near is far": lambda r: clip(r, 6.0, 6.0),
    "near beyond far": lambda r: clip(r, 8.0, 2.0),
    "near 1e-9, far 1e12": lambda r: clip(r, 1e-9, 1e12),
    "shifted": lambda r: (setattr(r.camera.data, "shift_x", 5.0), setattr(r.camera.data, "shift_y", -3.0)),
    "scaled": lambda r: setattr(r.camera, "scale", (2, 0, -1)),
    "border of one pixel": lambda r: r.border(0.5, 0.55, 0.5, 0.57),
    "border of one column": lambda r: r.border(0.5, 0.55, 0.0, 1.0),
    "border of one row": lambda r: r.border(0.0, 1.0, 0.5, 0.57),
    "odd border": lambda r: r.border(0.1, 0.73, 0.21, 0.9),
    "wide pixels": lambda r: setattr(r.scene.render, "pixel_aspect_x", 20.0),
    "wide filter": lambda r: setattr(r.scene.render, "filter_size", 10.0),
    "transparent film": lambda r: setattr(r.scene.render, "film_transparent", True),
}
MATERIALS = {
    "albedo 0": lambda r: r.set(Base_Color=(0, 0, 0, 1)),
    "albedo 1": lambda r: r.set(Base_Color=(1, 1, 1, 1)),
    "albedo 10": lambda r: r.set(Base_Color=(10, 10, 10, 1)),
    "albedo negative": lambda r: r.set(Base_Color=(-1, 0.5, -1, 1)),
    "roughness 0": lambda r: r.set(Roughness=0.0),
    "roughness 1e-3": lambda r: r.set(Roughness=1e-3),
    "roughness 1": lambda r: r.set(Roughness=1.0),
    "mirror": lambda r: r.set(Roughness=0.0, Metallic=1.0),
    "IOR 1": lambda r: r.set(IOR=1.0),
    "IOR below 1": lambda r: r.set(IOR=0.5),
    "IOR 1000": lambda r: r.set(IOR=1000.0),
    "anisotropic": lambda r: r.set(Anisotropic=1.0, Roughness=0.3),
    "coat": lambda r: r.set(Coat_Weight=1.0, Coat_Roughness=0.0, Coat_IOR=4.0),
    "black specular": lambda r: r.set(Specular_IOR_Level=0.0),
    "specular 1": lambda r: r.set(Specular_IOR_Level=1.0),
    "half alpha": lambda r: r.set(Alpha=0.5),
    "alpha 0": lambda r: r.set(Alpha=0.0),
    "no slots": lambda r: r.box.data.materials.clear(),
    "empty slot": lambda r: r.box.data.materials.append(None),
    "missing image": lambda r: r.image(missing_image()),
    "node without image": lambda r: r.image(None),
    "emission 1e12": lambda r: r.emit(1e12),
    "0 / 0": lambda r: r.math("DIVIDE", 0.0, 0.0, "Roughness"),
    "root of -1": lambda r: r.math("SQRT", -1.0, 0.0, "Roughness"),
    "logarithm of 0 as metal": lambda r: r.math("LOGARITHM", 0.0, 0.0, "Metallic"),
    "0 to the -1 as alpha": lambda r: r.math("POWER", 0.0, -1.0, "Alpha"),
    "1e30 squared as emission": lambda r: (r.emit(1.0), r.math("POWER", 1e30, 2.0, "Emission Strength")),
    "1e30 squared as albedo": lambda r: r.math("POWER", 1e30, 2.0, "Base Color"),
    "1e30 squared as coat": lambda r: r.math("POWER", 1e30, 2.0, "Coat Weight"),
    "0 to the -1 as IOR": lambda r: r.math("POWER", 0.0, -1.0, "IOR"),
}
PARAMETERS = {
    f"{technique.name}.{param.name} {value}": (
        lambda r, t=technique, p=param, v=value: setattr(
            block_of(p.scope, r.scene).candela, identifier(t.name, p.name), v
        )
    )
    for technique in REGISTRY
    for param in technique.params_of(*OF_A_PICTURE)
    for value in dict.fromkeys((param.minimum, param.maximum, *(item[0] for item in param.items)))
    if value is not None
}
CORPUS = {
    f"{group}: {name}": case
    for group, cases in (
        ("geometry", GEOMETRY), ("lights", LIGHTS), ("world", WORLDS), ("camera", CAMERAS), ("material", MATERIALS),
        ("parameter", PARAMETERS),
    )
    for name, case in cases.items()
}  # fmt: skip


@pytest.fixture
def room(stage):
    return Room(stage)


@pytest.mark.parametrize("case", CORPUS)
def test_every_pixel_is_finite_and_not_negative(room, case):
    CORPUS[case](room)
    images = room.stage.render(4, SIZE, bounces=3)  # fails if a value had to be repaired, or is not finite
    for name, pixels in images.items():
        if name != "normal":
            assert pixels.min() >= 0, f"{name} is negative"
    assert images["combined"][..., 3].max() <= 1.0


# What else may fill a slot, on the cases that its arithmetic depends on: screen-space walks on geometry and cameras.
CHOICES = {
    f"{technique}, {name}": (slot, technique, name)
    for slot, technique, groups in (
        ("indirect", "ssdo", ("geometry", "camera")),
        ("indirect", "multires_radiosity", ("camera",)),
        ("indirect", "clustered_visibility", ("geometry",)),
        ("indirect", "imperfect_shadow_maps", ("geometry",)),
        ("indirect", "implicit_visibility", ("geometry",)),
        ("environment", "directional_occlusion", ("geometry", "camera", "world")),
    )
    for name in CORPUS
    if name.startswith((*groups, f"parameter: {technique}."))
}


@pytest.mark.slow
@pytest.mark.parametrize("choice", CHOICES)
def test_every_pixel_is_finite_and_not_negative_by_choice(room, choice):
    slot, technique, case = CHOICES[choice]
    setattr(room.scene.candela, f"slot_{slot}", technique)
    room.scene.candela.implicit_visibility_surfels, room.scene.candela.implicit_visibility_bins = 256, 8
    room.scene.candela.implicit_visibility_orientations = 1 if "surfels" in case else 8  # links take the most of 65536
    test_every_pixel_is_finite_and_not_negative(room, case)


@pytest.mark.parametrize("kind", ["POINT", "SPOT", "SUN", "AREA"])
def test_a_light_of_negative_power_subtracts_what_it_would_give(room, kind):
    for light in room.lights.values():
        light.hide_render = True
    room.scene.world = None
    room.lights[kind].hide_render = False
    given = room.stage.render(2, SIZE)["combined"][..., :3]
    room.lights[kind].data.energy *= -1
    np.testing.assert_allclose(room.stage.render(2, SIZE)["combined"][..., :3], -given, rtol=1e-5, atol=1e-7)
    assert given.max() > 0


@pytest.mark.parametrize("size", [(4, 4), (5, 4), (4, 37), (61, 7)])
def test_pictures_of_any_size_are_drawn(room, size):
    images = room.stage.render(2, size)
    assert images["combined"].shape == (size[1], size[0], 4)
    assert images["combined"][..., :3].max() > 0


def test_a_camera_that_is_a_program_is_refused_with_a_sentence(room):
    room.camera.data.type = "CUSTOM"
    with pytest.raises(RenderFailed, match=r"Camera .* is not supported, .*; choose Perspective, Orthographic"):
        room.stage.render(1, SIZE)
    room.camera.data.type = "PERSP"
    assert room.stage.render(1, SIZE)["combined"].max() > 0  # and the next render works


def test_a_scene_without_camera_is_refused_with_a_sentence(room):
    room.scene.camera = None
    with pytest.raises(RenderFailed, match=r"(?i)camera"):
        room.stage.render(1, SIZE)


def test_settings_toggled_objects_deleted_and_sizes_changed_in_a_row_give_what_each_gives_alone(room):
    """As an artist works: nothing of an earlier state may stay in the picture."""

    def states():
        yield lambda: None
        yield lambda: setattr(room.scene.candela, "slot_shadow", "accumulated_maps")
        yield lambda: setattr(room.scene.render, "film_transparent", True)
        yield lambda: room.border(0.2, 0.8, 0.2, 0.8)
        yield lambda: room.lights["SUN"].data.__setattr__("type", "POINT")
        yield lambda: bpy.data.objects.remove(room.box)
        yield lambda: setattr(room.scene.render, "use_border", False)

    pictures = []
    for change in states():
        change()
        pictures.append(room.stage.render(2, SIZE)["combined"])
    engine.free_sessions()
    np.testing.assert_array_equal(room.stage.render(2, SIZE)["combined"], pictures[-1])


@pytest.mark.slow
@pytest.mark.parametrize("by", ["MAPS", "RAYS"])
def test_a_sky_of_ten_kilometres_leaves_small_things_as_they_are(stage, by):
    """Contact shadows, indirect light below a small card, and what stands close to the camera."""
    stage.scene.candela.accumulated_maps_by = by
    stage.floor(half=2.0, material=stage.diffuse(0.8))
    stage.rectangle((-0.05, -0.05), (0.05, 0.05), 0.01, material=stage.diffuse(0.8))
    stage.rectangle((0.1, -0.1), (0.1001, 0.1), 1.3, material=stage.diffuse(0.8))
    stage.rectangle((-0.2, -0.2), (0.2, 0.2), material=stage.diffuse(0.8), turn=(0, 1.2, 0), location=(-0.2, 0, 0.2))
    stage.light("AREA", (0.4, 0.3, 1.0), size=0.2)
    stage.camera((0, 0, 1.5), (0, 0, 0), angle=0.4)
    before = stage.render(16, (32, 32), bounces=1)
    corners = [(x, y, z) for x in (-1e4, 1e4) for y in (-1e4, 1e4) for z in (-1e4, 1e4)]
    faces = [(0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5)]
    dome = stage.mesh(corners, faces, material=stage.diffuse(0.0))
    dome.visible_camera = dome.visible_shadow = False
    after = stage.render(16, (32, 32), bounces=1)
    for name in ("diffuse_direct", "diffuse_indirect", "depth"):
        scale = np.abs(before[name]).mean()
        assert scale > 0.0 and np.abs(after[name] - before[name]).mean() < 0.02 * scale, name
