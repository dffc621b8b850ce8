"""Lights, media, materials and surface detail among the features of `python -m bench pairs`; see bench/pair_room.py."""

from __future__ import annotations

import math

import numpy as np

from bench.pair_room import feature

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


@feature
def world_image(room):
    """A panorama with one bright window, which falls in from the open front."""
    import bpy

    world = room.world_strength((1, 1, 1), 1.0)
    image = bpy.data.images.new("Panorama", 32, 16, float_buffer=True)
    pixels = np.ones((16, 32, 4), np.float32)
    pixels[..., :3] = (0.15, 0.2, 0.3)
    pixels[9:12, 22:25, :3] = (12.0, 10.0, 7.0)
    image.pixels.foreach_set(pixels.reshape(-1))
    tree = world.node_tree
    node = tree.nodes.new("ShaderNodeTexEnvironment")
    node.image = image
    background = next(one for one in tree.nodes if one.type == "BACKGROUND")
    tree.links.new(node.outputs["Color"], background.inputs["Color"])


@feature
def gobo(room):
    """A spot whose own nodes colour its cone."""
    room.replace_lamp("SPOT", (-0.6, -1.2, 2.7), (0.4, -0.2, 0.0), shadow_soft_size=0.05, energy=250.0, spot_size=1.2)
    room.stage.use_nodes(room.lamp.data)
    tree = room.lamp.data.node_tree
    emission = next(one for one in tree.nodes if one.type == "EMISSION")
    coordinates, checker = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeTexChecker")
    checker.inputs["Scale"].default_value = 3.0
    checker.inputs["Color1"].default_value, checker.inputs["Color2"].default_value = (1, 0.4, 0.2, 1), (0.1, 0.3, 1, 1)
    tree.links.new(coordinates.outputs["Normal"], checker.inputs["Vector"])
    tree.links.new(checker.outputs["Color"], emission.inputs["Color"])


# -------------------------------------------------------------------------------------------------------------- media


def fog_box(room, material, within: float = 0.0):
    """`within`: m inside of the other one's faces. Of two that coincide Cycles misses one medium."""
    side = 1.98 - within
    corners = [(x, y, z) for x in (-side, side) for y in (-side, side) for z in (0.01 + within, 2.95 - within)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return room.stage.mesh(corners, faces, material=material)


@feature
def fog_in_a_box(room):
    fog_box(room, room.volume("ShaderNodeVolumeScatter", Density=0.12, Anisotropy=0.2))


@feature
def absorbing_box(room):
    fog_box(room, room.volume("ShaderNodeVolumeAbsorption", Color=(0.3, 0.5, 0.9, 1), Density=0.4), within=0.01)


@feature
def fog_of_the_world(room):
    world = room.scene.world
    tree = world.node_tree
    node = tree.nodes.new("ShaderNodeVolumeScatter")
    node.inputs["Density"].default_value = 0.03
    output = next(one for one in tree.nodes if one.type == "OUTPUT_WORLD")
    tree.links.new(node.outputs[0], output.inputs["Volume"])


@feature
def smoke(room):
    """A cloud whose density differs from place to place."""
    material = room.volume("ShaderNodeVolumePrincipled", Anisotropy=0.3, Color=(0.8, 0.8, 0.85, 1))
    tree = material.node_tree
    shader = next(one for one in tree.nodes if one.type == "PRINCIPLED_VOLUME")
    noise, factor = tree.nodes.new("ShaderNodeTexNoise"), tree.nodes.new("ShaderNodeMath")
    noise.inputs["Scale"].default_value = 3.0
    factor.operation, factor.inputs[1].default_value = "MULTIPLY", 4.0
    tree.links.new(noise.outputs[0], factor.inputs[0])
    tree.links.new(factor.outputs[0], shader.inputs["Density"])
    x, y, z = room.place()
    room.box(material, (x, y, z + 0.3), 0.45, 0.9)


@feature
def fire(room):
    """A medium that glows and absorbs."""
    material = room.volume("ShaderNodeVolumePrincipled", Density=1.5, Color=(0.1, 0.1, 0.1, 1), Emission_Strength=4.0,
                           Emission_Color=(1.0, 0.4, 0.1, 1))  # fmt: skip
    x, y, z = room.place()
    room.box(material, (x, y, z + 0.1), 0.3, 0.7)


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
def subsurface_skin(room):
    scattering(room, "RANDOM_WALK_SKIN")


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
def two_panes(room):
    """Two coloured panes above each other: light that passes both."""
    x, y, _ = room.place()
    for k, color in enumerate(((0.9, 0.5, 0.2, 1), (0.4, 0.8, 0.9, 1))):
        material = room.stage.material("ShaderNodeBsdfTransparent", Color=color)
        room.stage.rectangle(
            (-0.5, -0.5), (0.5, 0.5), material=material, location=(x, y, 1.1 + 0.3 * k), turn=(0.2, 0.1, 0)
        )


@feature
def glowing_veil(room):
    """A coloured transparent surface that glows."""
    x, y, _ = room.place()
    material = room.stage.material("ShaderNodeMixShader")
    tree = material.node_tree
    mix = next(one for one in tree.nodes if one.type == "MIX_SHADER")
    clear, glow = tree.nodes.new("ShaderNodeBsdfTransparent"), tree.nodes.new("ShaderNodeEmission")
    clear.inputs["Color"].default_value = (0.9, 0.6, 0.3, 1)
    glow.inputs["Color"].default_value, glow.inputs["Strength"].default_value = (0.2, 0.5, 1.0, 1), 1.5
    mix.inputs[0].default_value = 0.4
    tree.links.new(clear.outputs[0], mix.inputs[1])
    tree.links.new(glow.outputs[0], mix.inputs[2])
    room.stage.rectangle((-0.4, 0.0), (0.4, 0.9), material=material, location=(x, y, 0.05), turn=(1.4, 0, -0.2))


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
