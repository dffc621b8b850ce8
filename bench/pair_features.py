"""Features of `python -m bench pairs`: each is a function that adds itself to a base room, so that two make a pair.

The room is a box of 4 x 4 x 3 metres, open in front, where the camera stands; a softbox under the ceiling lights it, a
plain block stands in the middle. A feature that needs an object puts it on the next free place; one that concerns a
lamp takes the lamp of the room, or the one that another feature has put in its place.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

PLACES = ((-1.0, 0.4, 0.0), (1.0, 0.3, 0.0), (0.1, -0.9, 0.0))  # on the floor, for what features bring
FEATURES: dict[str, Callable[[Room], None]] = {}


class Room:
    """The base scene and what features may ask of it."""

    def __init__(self, stage):
        self.stage, self.scene = stage, stage.scene
        stage.clear()
        self.scene.render.filter_size = 1.5
        self.scene.frame_set(1)
        self._taken = 0
        self._has_own_lamp = False
        grey = lambda *color: stage.material("ShaderNodeBsdfDiffuse", Color=(*color, 1))  # noqa: E731
        self.floor = stage.rectangle((-2, -2), (2, 2), material=grey(0.7, 0.7, 0.7))
        self.floor.data.uv_layers.new(name="UVMap")
        white, red, green = grey(0.7, 0.7, 0.7), grey(0.65, 0.1, 0.08), grey(0.12, 0.5, 0.12)
        self.ceiling = stage.rectangle((-2, -2), (2, 2), 3.0, material=white)
        self.back = stage.rectangle((-2, 0), (2, 3), material=white, location=(0, 2, 0), turn=(math.pi / 2, 0, 0))
        for x, material in ((-2, red), (2, green)):
            stage.rectangle((-3, -2), (0, 2), material=material, location=(x, 0, 0), turn=(0, math.pi / 2, 0))
        self.block = self.box(grey(0.6, 0.55, 0.5), (0.0, 0.9, 0.0), 0.45, 1.1)
        self.lamp = stage.light("AREA", (0.3, -0.2, 2.9), size=0.8, energy=80.0)
        self.camera = stage.camera((0.0, -5.6, 1.5), (math.radians(90), 0, 0), angle=0.85)
        stage.world((0.0, 0.0, 0.0), 0.0)

    def place(self) -> tuple[float, float, float]:
        """The next free place on the floor."""
        self._taken += 1
        return PLACES[(self._taken - 1) % len(PLACES)]

    def box(self, material, at, half: float, height: float):
        """A block that stands at a place."""
        x, y, z = half, half, height
        corners = [(i, j, k) for i in (-x, x) for j in (-y, y) for k in (0.002, z)]
        faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        return self.stage.mesh(corners, faces, material=material, location=at)

    def ball(self, material, at=None, radius: float = 0.45, smooth: bool = True):
        """A ball that lies at a place, smooth-shaded."""
        x, y, z = at or self.place()
        rings, segments = 12, 24
        points = [(0.0, 0.0, -radius)]
        for k in range(1, rings):
            up = math.pi * k / rings - math.pi / 2
            for j in range(segments):
                turn = 2 * math.pi * j / segments
                points.append((radius * math.cos(up) * math.cos(turn), radius * math.cos(up) * math.sin(turn),
                               radius * math.sin(up)))  # fmt: skip
        points.append((0.0, 0.0, radius))
        last = len(points) - 1
        faces = [(0, 1 + (j + 1) % segments, 1 + j) for j in range(segments)]
        for k in range(rings - 2):
            a, b = 1 + k * segments, 1 + (k + 1) * segments
            faces += [(a + j, a + (j + 1) % segments, b + (j + 1) % segments, b + j) for j in range(segments)]
        top = 1 + (rings - 2) * segments
        faces += [(top + j, top + (j + 1) % segments, last) for j in range(segments)]
        made = self.stage.mesh(points, faces, material=material, location=(x, y, z + radius + 0.01))
        made.data.polygons.foreach_set("use_smooth", [smooth] * len(made.data.polygons))
        return made

    def replace_lamp(self, kind: str, location, turn=(0.0, 0.0, 0.0), **settings):
        """A lamp of another kind in the place of the room's; a second one stands beside it."""
        if not self._has_own_lamp:
            self.stage.scene.collection.objects.unlink(self.lamp)
            self._has_own_lamp = True
        self.lamp = self.stage.light(kind, location, turn, **settings)
        return self.lamp

    def world_strength(self, color, strength: float):
        """Light of the world, which falls in from the open front."""
        return self.stage.world(color, strength)

    def volume(self, node: str, **inputs):
        """A material whose volume is this node alone."""
        material = self.stage.material(node, **inputs)
        tree = material.node_tree
        output = next(one for one in tree.nodes if one.type == "OUTPUT_MATERIAL")
        shader = next(one for one in tree.nodes if one is not output)
        tree.links.remove(tree.links[0])
        tree.links.new(shader.outputs[0], output.inputs["Volume"])
        return material


def feature(make: Callable[[Room], None]) -> Callable[[Room], None]:
    FEATURES[make.__name__.replace("_", " ")] = make
    return make


# ------------------------------------------------------------------------------------------------------------- lights


@feature
def point_lamp(room):
    room.replace_lamp("POINT", (-0.8, -0.6, 2.2), shadow_soft_size=0.1, energy=90.0)


@feature
def spot(room):
    room.replace_lamp("SPOT", (0.9, -1.0, 2.7), (0.35, 0.25, 0.0), shadow_soft_size=0.08, energy=250.0, spot_size=1.3)


@feature
def sun(room):
    room.replace_lamp("SUN", (0, 0, 4), (math.radians(55), 0.15, 0.1), energy=3.0, angle=0.02)


@feature
def emissive_mesh(room):
    if not room._has_own_lamp:
        room.stage.scene.collection.objects.unlink(room.lamp)
        room._has_own_lamp = True
    glow = room.stage.material("ShaderNodeEmission", Strength=8.0, Color=(1.0, 0.8, 0.6, 1))
    room.lamp = room.ball(glow, at=(0.9, 0.6, 1.5), radius=0.25)


@feature
def world_colour(room):
    room.world_strength((0.5, 0.7, 1.0), 0.8)


@feature
def sky(room):
    world = room.world_strength((1, 1, 1), 0.05)
    tree = world.node_tree
    node = tree.nodes.new("ShaderNodeTexSky")
    if "HOSEK_WILKIE" in node.bl_rna.properties["sky_type"].enum_items:
        node.sky_type = "HOSEK_WILKIE"
        node.sun_direction = (0.3, -0.6, 0.6)
    background = next(one for one in tree.nodes if one.type == "BACKGROUND")
    background.inputs["Strength"].default_value = 0.3
    tree.links.new(node.outputs["Color"], background.inputs["Color"])


# -------------------------------------------------------------------------------------------------------------- media


def fog_box(room, material):
    corners = [(x, y, z) for x in (-1.98, 1.98) for y in (-1.98, 1.98) for z in (0.01, 2.95)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return room.stage.mesh(corners, faces, material=material)


@feature
def fog_in_a_box(room):
    fog_box(room, room.volume("ShaderNodeVolumeScatter", Density=0.12, Anisotropy=0.2))


@feature
def absorbing_box(room):
    fog_box(room, room.volume("ShaderNodeVolumeAbsorption", Color=(0.3, 0.5, 0.9, 1), Density=0.4))


@feature
def fog_of_the_world(room):
    world = room.scene.world
    tree = world.node_tree
    node = tree.nodes.new("ShaderNodeVolumeScatter")
    node.inputs["Density"].default_value = 0.03
    output = next(one for one in tree.nodes if one.type == "OUTPUT_WORLD")
    tree.links.new(node.outputs[0], output.inputs["Volume"])


# ---------------------------------------------------------------------------------------------------------- materials


@feature
def glass(room):
    room.ball(room.stage.material("ShaderNodeBsdfGlass", Roughness=0.0, IOR=1.45))


@feature
def absorbing_glass(room):
    material = room.stage.material("ShaderNodeBsdfGlass", Roughness=0.0, IOR=1.33)
    tree = material.node_tree
    node = tree.nodes.new("ShaderNodeVolumeAbsorption")
    node.inputs["Color"].default_value, node.inputs["Density"].default_value = (0.2, 0.6, 0.9, 1), 2.0
    output = next(one for one in tree.nodes if one.type == "OUTPUT_MATERIAL")
    tree.links.new(node.outputs[0], output.inputs["Volume"])
    room.ball(material)


@feature
def mirror(room):
    room.ball(room.stage.principled(Base_Color=(0.9, 0.85, 0.8, 1), Metallic=1.0, Roughness=0.0))


@feature
def rough_metal(room):
    room.ball(room.stage.principled(Base_Color=(0.9, 0.7, 0.4, 1), Metallic=1.0, Roughness=0.35))


@feature
def principled(room):
    room.ball(room.stage.principled(Base_Color=(0.2, 0.4, 0.8, 1), Roughness=0.5))


@feature
def coat(room):
    room.ball(room.stage.principled(Base_Color=(0.6, 0.1, 0.1, 1), Roughness=0.6, Coat_Weight=1.0, Coat_Roughness=0.05))


@feature
def sheen(room):
    room.ball(room.stage.principled(Base_Color=(0.1, 0.1, 0.3, 1), Sheen_Weight=1.0, Sheen_Roughness=0.4))


def scattering(room, method: str):
    material = room.stage.principled(
        Base_Color=(0.8, 0.5, 0.4, 1), Roughness=0.6, Subsurface_Weight=1.0, Subsurface_Radius=(0.2, 0.1, 0.05)
    )
    shader = next(one for one in material.node_tree.nodes if one.type == "BSDF_PRINCIPLED")
    shader.subsurface_method = method
    shader.inputs["Subsurface Scale"].default_value = 0.5
    return room.ball(material)


@feature
def subsurface_walk(room):
    scattering(room, "RANDOM_WALK")


@feature
def subsurface_burley(room):
    scattering(room, "BURLEY")


@feature
def translucent_sheet(room):
    x, y, _ = room.place()
    material = room.stage.material("ShaderNodeBsdfTranslucent", Color=(0.7, 0.8, 0.3, 1))
    room.stage.rectangle((-0.4, 0.0), (0.4, 0.9), material=material, location=(x, y, 0.05), turn=(1.3, 0, 0.3))


@feature
def coloured_pane(room):
    x, y, _ = room.place()
    material = room.stage.material("ShaderNodeBsdfTransparent", Color=(0.9, 0.3, 0.1, 1))
    room.stage.rectangle((-0.5, -0.5), (0.5, 0.5), material=material, location=(x, y, 1.2), turn=(0.2, 0.1, 0))


@feature
def alpha_cards(room):
    x, y, _ = room.place()
    stage = room.stage
    material = stage.principled(Base_Color=(0.2, 0.6, 0.2, 1), Roughness=0.8)
    tree = material.node_tree
    checker = tree.nodes.new("ShaderNodeTexChecker")
    checker.inputs["Scale"].default_value = 6.0
    shader = next(one for one in tree.nodes if one.type == "BSDF_PRINCIPLED")
    tree.links.new(checker.outputs["Fac" if "Fac" in checker.outputs else "Factor"], shader.inputs["Alpha"])
    for k in range(3):
        stage.card(material, 0.0, 1.0, location=(x, y + 0.2 * k, 0.6), turn=(1.4, 0, 0.4 * k), scale=(0.4, 0.5, 1))


# ------------------------------------------------------------------------------------------------------ surface detail


def floor_detail(room, node: str, into: str, **settings):
    """A height or normal on the floor."""
    tree = room.floor.data.materials[0].node_tree
    made = tree.nodes.new(node)
    for name, value in settings.items():
        made.inputs[name].default_value = value
    shader = next(one for one in tree.nodes if one.type == "BSDF_DIFFUSE")
    output = next(one for one in tree.nodes if one.type == "OUTPUT_MATERIAL")
    tree.links.new(made.outputs[0], shader.inputs["Normal"] if into == "Normal" else output.inputs["Displacement"])
    return tree, made


def waves(tree, scale: float = 1.5):
    node = tree.nodes.new("ShaderNodeTexWave")
    node.inputs["Scale"].default_value = scale
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(coordinates.outputs["Object"], node.inputs["Vector"])
    return node


@feature
def normal_map(room):
    floor_detail(room, "ShaderNodeNormalMap", "Normal", Color=(0.75, 0.5, 0.9, 1))


@feature
def bump(room):
    tree, made = floor_detail(room, "ShaderNodeBump", "Normal", Distance=0.1)
    tree.links.new(waves(tree).outputs[0], made.inputs["Height"])


def displaced(room, scale: float):
    tree, made = floor_detail(room, "ShaderNodeDisplacement", "Displacement", Scale=0.15)
    tree.links.new(waves(tree, scale).outputs[0], made.inputs["Height"])
    room.floor.data.materials[0].displacement_method = "DISPLACEMENT"
    modifier = room.floor.modifiers.new("Subdivision", "SUBSURF")
    modifier.subdivision_type, modifier.levels, modifier.render_levels = "SIMPLE", 5, 5


@feature
def displacement(room):
    """Waves that the floor's vertices can carry."""
    displaced(room, 0.3)


@feature
def relief(room):
    """Waves that they cannot: Cycles moves the vertices by what it finds there."""
    displaced(room, 1.5)


# ------------------------------------------------------------------------------------------------- objects and settings


def _excluded(room, role: str) -> None:
    """Exclude the block from a collection of the lamp's links; Blender before 4.0 has none."""
    import bpy

    if not hasattr(room.lamp, "light_linking"):
        return
    made = bpy.data.collections.new(role)
    made.objects.link(room.block)
    setattr(room.lamp.light_linking, role, made)
    for item in made.collection_objects:
        item.light_linking.link_state = "EXCLUDE"


@feature
def light_linking(room):
    """The lamp leaves the block out."""
    _excluded(room, "receiver_collection")


@feature
def shadow_linking(room):
    """The block does not block the lamp."""
    _excluded(room, "blocker_collection")


@feature
def no_diffuse_rays(room):
    """The block is not met by bounces of diffuse surfaces."""
    room.block.visible_diffuse = False


@feature
def no_shadow_rays(room):
    room.block.visible_shadow = False


@feature
def not_seen_by_the_camera(room):
    room.block.visible_camera = False


@feature
def holdout(room):
    room.block.is_holdout = True


@feature
def instances(room):
    """Objects of one mesh that take a colour of the object's own."""
    material = room.stage.diffuse()
    tree = material.node_tree
    info = tree.nodes.new("ShaderNodeObjectInfo")
    shader = next(one for one in tree.nodes if one.type == "BSDF_DIFFUSE")
    tree.links.new(info.outputs["Color"], shader.inputs["Color"])
    x, y, _ = room.place()
    first = room.box(material, (x, y, 0), 0.15, 0.3)
    for k in range(1, 5):
        made = room.stage.link("Copy", first.data, (x + 0.3 * math.cos(k), y + 0.3 * math.sin(k), 0.32 * (k % 2)))
        made.color = (0.2 * k, 0.8 - 0.15 * k, 0.3, 1)


@feature
def hair(room):
    """Curves that stand on the floor."""
    import bpy

    if not hasattr(bpy.data, "hair_curves"):
        return
    x, y, _ = room.place()
    data = bpy.data.hair_curves.new("Hair")
    count, points = 150, 4
    data.add_curves([points] * count)
    chance = np.random.default_rng(5)
    roots = chance.uniform(-0.35, 0.35, (count, 2))
    places = np.zeros((count, points, 3), np.float32)
    for k in range(points):
        places[:, k, :2] = roots * (1 + 0.15 * k)
        places[:, k, 2] = 0.25 * k
    data.attributes["position"].data.foreach_set("vector", places.reshape(-1))
    radius = data.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", np.full(count * points, 0.012, np.float32))
    data.materials.append(room.stage.diffuse(0.5))
    room.stage.link("Hair", data, (x, y, 0))


@feature
def motion_blur(room):
    room.scene.render.use_motion_blur = True
    for frame, x in ((0, -0.35), (2, 0.35)):
        room.block.location.x = x
        room.block.keyframe_insert("location", frame=frame)
    room.scene.frame_set(1)


@feature
def depth_of_field(room):
    dof = room.camera.data.dof
    dof.use_dof, dof.focus_distance, dof.aperture_fstop = True, 4.5, 0.15


@feature
def orthographic(room):
    camera = room.camera.data
    camera.type, camera.ortho_scale = "ORTHO", 4.4
    if camera.dof.use_dof:
        camera.dof.aperture_fstop = (
            3.0  # a lens as wide as the other: here it is 1 m / (2 N), whatever the focal length
        )


@feature
def border(room):
    render = room.scene.render
    render.use_border = True
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.25, 0.85, 0.1, 0.8


@feature
def transparent_film(room):
    room.scene.render.film_transparent = True


@feature
def image_texture(room):
    """An image of eight bits on the floor."""
    import bpy

    image = bpy.data.images.new("Pattern", 16, 16)
    pixels = np.random.default_rng(9).random((16, 16, 4)).astype(np.float32)
    pixels[..., 3] = 1
    image.pixels.foreach_set(pixels.reshape(-1))
    image.filepath_raw = str(Path(tempfile.mkdtemp(prefix="candela_pairs_")) / "pattern.png")
    image.file_format = "PNG"
    image.save()
    tree = room.floor.data.materials[0].node_tree
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(coordinates.outputs["Generated"], node.inputs["Vector"])
    shader = next(one for one in tree.nodes if one.type == "BSDF_DIFFUSE")
    tree.links.new(node.outputs["Color"], shader.inputs["Color"])
