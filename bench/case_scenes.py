"""Scenes of `python -m bench cases`: what people put into materials, lamps and meshes, several of a kind in a picture.

Each builder fills a `Stage` (tests/techniques/conftest.py). Cards stand in a grid that an orthographic camera sees from
above, a third of each metre between them showing the floor that they light; lamps and displaced meshes stand alone.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

GRID, APART = 3, 1.3  # cards along a side, and metres from one to the next
KINDS = ("FLOAT", "INT", "INT8", "BOOLEAN", "FLOAT2", "FLOAT_VECTOR", "FLOAT_COLOR", "BYTE_COLOR", "QUATERNION")
DOMAINS = ("POINT", "FACE", "CORNER")


def place(number: int) -> tuple[float, float, float]:
    """Lower left corner of a card, above the floor so that it lights it."""
    row, column = divmod(number, GRID)
    return APART * column - 1.9, APART * row - 1.9, 0.15


def card(stage, number: int, material, vertices: int = 2):
    """A square of a metre with UVs, of so many vertices along a side."""
    import bpy

    side = np.linspace(0.0, 1.0, vertices)
    corners = [(x, y, 0.0) for y in side for x in side]
    rows = range(vertices - 1)
    faces = [(k + vertices * j, k + 1 + vertices * j, k + 1 + vertices * (j + 1), k + vertices * (j + 1))
             for j in rows for k in rows]  # fmt: skip
    made = stage.mesh(corners, faces, material=material, location=place(number))
    layer = made.data.uv_layers.new(name="UVMap")
    for loop in made.data.loops:
        layer.uv[loop.index].vector = corners[loop.vertex_index][:2]
    return bpy.data.objects[made.name]


def lit_floor(stage) -> None:
    """A grey floor under the camera, a dim world, a soft lamp."""
    stage.scene.render.filter_size = 1.5
    stage.floor(material=stage.diffuse(0.6))
    stage.camera_above(span=4.2)
    stage.world((0.8, 0.9, 1.0), 0.3)
    stage.light("AREA", (1.5, -1.0, 3.0), (0.3, 0.4, 0.0), size=1.0, energy=60.0)


def shining(stage, node: str, output, strength: float = 0.8, **settings):
    """A material that emits what a node gives, and the node."""
    material = stage.material("ShaderNodeEmission", Strength=strength)
    tree = material.node_tree
    made = tree.nodes.new(node)
    for name, value in settings.items():
        setattr(made, name, value)
    tree.links.new(made.outputs[output], tree.nodes["Emission"].inputs["Color"])
    return material, made


def coloured(stage, node: str, output, **settings):
    """A diffuse material of the colour that a node gives, and the node."""
    material = stage.diffuse()
    tree = material.node_tree
    made = tree.nodes.new(node)
    for name, value in settings.items():
        setattr(made, name, value)
    shader = next(one for one in tree.nodes if one.type == "BSDF_DIFFUSE")
    tree.links.new(made.outputs[output], shader.inputs["Color"])
    return material, made


# Images -------------------------------------------------------------------------------------------------------------


def images(stage) -> None:
    """A frame of a sequence, UDIM tiles, 13 images in one material, a pass of a multilayer file, 8 bits of an unusual
    colour space, alpha of floats and bytes, straight, premultiplied and packed."""
    import bpy

    from tests.cases.test_images import saved

    lit_floor(stage)
    folder = Path(tempfile.mkdtemp(prefix="candela_cases_"))
    random = np.random.default_rng(7)

    def noisy(name, kind="PNG", size=8, alpha=False):
        pixels = random.random((size, size, 4)).astype(np.float32)
        pixels[..., 3] = 0.3 + 0.7 * pixels[..., 3] if alpha else 1.0
        made = bpy.data.images.new("made", size, size, alpha=True)
        made.pixels.foreach_set(pixels.reshape(-1))
        made.filepath_raw, made.file_format = str(folder / name), kind
        made.save()
        bpy.data.images.remove(made)
        return bpy.data.images.load(str(folder / name))

    for number in range(1, 5):
        saved(folder, f"frame_{number:04d}.png", (number / 5, 1 - number / 5, 0.2, 1))
    sequence = bpy.data.images.load(str(folder / "frame_0001.png"))
    sequence.source = "SEQUENCE"
    material, node = coloured(stage, "ShaderNodeTexImage", "Color", image=sequence)
    user = node.image_user
    user.frame_duration, user.frame_start, user.frame_offset, user.use_auto_refresh = 4, 1, 1, True
    card(stage, 0, material)

    for number, color in ((1001, (0.9, 0.2, 0.1, 1)), (1002, (0.1, 0.8, 0.2, 1)), (1011, (0.2, 0.3, 0.9, 1))):
        saved(folder, f"tile.{number}.png", color, 8)
    tiles = bpy.data.images.load(str(folder / "tile.1001.png"))
    tiles.source, tiles.filepath_raw = "TILED", str(folder / "tile.<UDIM>.png")
    tiles.reload()
    for number in (1002, 1011)[len(tiles.tiles) - 1 :]:
        tiles.tiles.new(number)
    material, node = shining(stage, "ShaderNodeTexImage", "Color", image=tiles)
    doubled(material.node_tree, node)
    card(stage, 1, material)

    material, node = coloured(stage, "ShaderNodeTexImage", "Color", image=noisy("many 0.png"))
    mixed = node.outputs["Color"]
    for number in range(1, 13):
        another = material.node_tree.nodes.new("ShaderNodeTexImage")
        another.image = noisy(f"many {number}.png", size=4 + number)
        another.interpolation = ("Linear", "Closest", "Cubic")[number % 3]
        mix = material.node_tree.nodes.new("ShaderNodeMixRGB")
        mix.inputs[0].default_value = 0.4
        material.node_tree.links.new(mixed, mix.inputs[1])
        material.node_tree.links.new(another.outputs["Color"], mix.inputs[2])
        mixed = mix.outputs[0]
    shader = next(one for one in material.node_tree.nodes if one.type == "BSDF_DIFFUSE")
    material.node_tree.links.new(mixed, shader.inputs["Color"])
    card(stage, 2, material)

    material, node = shining(stage, "ShaderNodeTexImage", "Color", 0.5, image=multilayer(stage, folder))
    card(stage, 3, material)
    spaced = noisy("spaced.png")
    spaced.colorspace_settings.name = "Linear Rec.2020"
    card(stage, 4, coloured(stage, "ShaderNodeTexImage", "Color", image=spaced)[0])
    for number, (kind, mode) in enumerate((("PNG", "PREMUL"), ("OPEN_EXR", "STRAIGHT"), ("OPEN_EXR", "PREMUL"),
                                           ("PNG", "CHANNEL_PACKED")), 5):  # fmt: skip
        image = noisy(f"alpha {number}.{'png' if kind == 'PNG' else 'exr'}", kind, alpha=True)
        image.alpha_mode = mode
        if kind == "OPEN_EXR":
            image.colorspace_settings.name = "Linear Rec.709"
        material, node = coloured(stage, "ShaderNodeTexImage", "Color", image=image)
        see_through(stage, material, node.outputs["Alpha"])
        card(stage, number, material)


def doubled(tree, texture) -> None:
    """UVs from 0 to 2."""
    mapping, place_of = tree.nodes.new("ShaderNodeMapping"), tree.nodes.new("ShaderNodeTexCoord")
    mapping.inputs["Scale"].default_value = (2, 2, 1)
    tree.links.new(place_of.outputs["UV"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], texture.inputs["Vector"])


def see_through(stage, material, alpha) -> None:
    """A material's surface mixed with Transparent, by a socket."""
    tree = material.node_tree
    output = next(one for one in tree.nodes if one.type == "OUTPUT_MATERIAL")
    surface = output.inputs["Surface"].links[0].from_socket
    clear, mix = tree.nodes.new("ShaderNodeBsdfTransparent"), tree.nodes.new("ShaderNodeMixShader")
    tree.links.new(alpha, mix.inputs["Fac"])
    tree.links.new(clear.outputs[0], mix.inputs[1])
    tree.links.new(surface, mix.inputs[2])
    tree.links.new(mix.outputs[0], output.inputs["Surface"])


def multilayer(stage, folder: Path):
    """An image of a multilayer file with a picture that Cycles renders for it."""
    import bpy

    scene = bpy.data.scenes.new("Layers")
    made = bpy.data.meshes.new("Card")
    made.from_pydata([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [], [(0, 1, 2, 3)])
    made.materials.append(stage.material("ShaderNodeEmission", Color=(0.2, 0.6, 0.1, 1)))
    lens = bpy.data.cameras.new("Camera")
    lens.type, lens.ortho_scale = "ORTHO", 3.0
    camera = bpy.data.objects.new("Camera", lens)
    camera.location.z = 2.0
    for one in (bpy.data.objects.new("Card", made), camera):
        scene.collection.objects.link(one)
    scene.camera, scene.render.engine = camera, "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    scene.render.resolution_x = scene.render.resolution_y = 8
    scene.view_layers[0].use_pass_z = True
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format, scene.render.filepath = "OPEN_EXR_MULTILAYER", str(folder / "layers.exr")
    bpy.ops.render.render(write_still=True, scene=scene.name)
    bpy.data.scenes.remove(scene)
    return bpy.data.images.load(str(folder / "layers.exr"))


# Attributes ---------------------------------------------------------------------------------------------------------


def attributes(stage) -> None:
    """A card for each type of attribute, of points, faces and corners in turn, read by Attribute nodes, one by UV Map;
    hair beside them; instances whose colours are attributes of theirs."""
    from tests.cases.test_attributes import fill

    lit_floor(stage)
    for number, kind in enumerate(KINDS):
        node, output, name = ("ShaderNodeAttribute", "Color", "attribute_name")
        if kind == "FLOAT2":
            node, output, name = "ShaderNodeUVMap", "UV", "uv_map"
        made = (coloured, shining)[number % 2](stage, node, output, **{name: "Mine"})[0]
        object_ = card(stage, number, made, 4)
        fill(object_.data.attributes.new("Mine", kind, DOMAINS[number % 3]))
    hair(stage)


def hair(stage) -> None:
    """Five strands coloured by a number of each, above the cards."""
    import bpy

    made = bpy.data.hair_curves.new("Hair")
    made.add_curves([9] * 5)
    spots = [c for i in range(5) for j in range(9) for c in (0.8 * i - 1.6, 0.4 * j - 1.6, 0.6)]
    made.attributes["position"].data.foreach_set("vector", spots)
    radius = made.attributes.get("radius") or made.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", [0.04] * 45)
    tone = made.attributes.new("Tone", "FLOAT_COLOR", "CURVE")
    tone.data.foreach_set("color", [c for i in range(5) for c in (0.2 * i, 0.8 - 0.15 * i, 0.4, 1.0)])
    made.materials.append(coloured(stage, "ShaderNodeAttribute", "Color", attribute_name="Tone")[0])
    stage.link("Hair", made)


# Working space ------------------------------------------------------------------------------------------------------


def working_space(stage) -> None:
    """ACEScg: a sky with its sun, cards of blackbodies, a wavelength, luminance, textures of three colour spaces, and a
    lamp that shines by its temperature."""
    import bpy

    lit_floor(stage)
    tree = stage.scene.world.node_tree
    sky = tree.nodes.new("ShaderNodeTexSky")
    sky.sun_elevation = 0.6
    background = next(node for node in tree.nodes if node.type == "BACKGROUND")
    background.inputs["Strength"].default_value = 0.02
    tree.links.new(sky.outputs[0], background.inputs["Color"])
    lamp = next(one.data for one in stage.scene.objects if one.type == "LIGHT")
    lamp.use_temperature, lamp.temperature = True, 2700.0
    for number, kelvin in enumerate((1500.0, 4000.0, 9000.0)):
        material, node = shining(stage, "ShaderNodeBlackbody", 0)
        node.inputs["Temperature"].default_value = kelvin
        card(stage, number, material)
    material, node = shining(stage, "ShaderNodeWavelength", 0)
    node.inputs["Wavelength"].default_value = 520.0
    card(stage, 3, material)
    material, node = coloured(stage, "ShaderNodeRGBToBW", 0)
    node.inputs[0].default_value = (0.8, 0.3, 0.1, 1)
    card(stage, 4, material)
    random = np.random.default_rng(3)
    for number, space in enumerate(("sRGB", "Linear Rec.709", "Non-Color"), 5):
        image = bpy.data.images.new(space, 6, 6, float_buffer=space != "sRGB")
        image.colorspace_settings.name = space
        image.pixels.foreach_set(random.random(144).astype(np.float32))
        image.update()
        image.pack()
        card(stage, number, coloured(stage, "ShaderNodeTexImage", "Color", image=image)[0])
    card(stage, 8, stage.diffuse(0.5))
    bpy.ops.wm.set_working_color_space(working_space="ACEScg", convert_colors=False)


# Lamps --------------------------------------------------------------------------------------------------------------


def lamps(stage) -> None:
    """A spot through a gobo, a point with a light profile, an area with linear falloff and a pattern along its sides, a
    dim sun whose colour follows its direction, over a floor with boxes."""
    import bpy

    from tests.cases.test_lamp_trees import CHECKER, PROFILE, chain

    def tree_of(light):
        if bpy.app.version < (5, 2):
            light.data.use_nodes = True
        tree = light.data.node_tree
        return tree, next(node for node in tree.nodes if node.type == "EMISSION")

    stage.scene.render.filter_size = 1.5
    stage.floor(material=stage.diffuse(0.7))
    stage.camera((0, -5.5, 4.2), (0.93, 0, 0), 0.8)
    for x in (-1.2, 0.1, 1.3):
        box(stage, (x, 0.3 * x, 0.0), 0.5)
    spot = tree_of(stage.light("SPOT", (-1.8, -0.5, 2.5), (0.3, 0.3, 0.0), spot_size=1.3, energy=150.0,
                               shadow_soft_size=0.02))  # fmt: skip
    chain(*spot, "Color", ("ShaderNodeTexCoord", "Normal", "", {}), CHECKER)
    text = bpy.data.texts.new("profile")
    text.write(PROFILE)
    point = tree_of(stage.light("POINT", (1.6, 0.4, 1.6), (0.2, 0.1, 0.0), energy=60.0, shadow_soft_size=0.05))
    chain(*point, "Strength", ("ShaderNodeTexIES", 0, "", {"mode": "INTERNAL", "ies": text, "Strength": 0.002}))
    area = stage.light("AREA", (0.0, 2.0, 2.0), (-0.6, 0.0, 0.0), size=1.0, energy=25.0)
    tree, emission = tree_of(area)
    chain(tree, emission, "Strength", ("ShaderNodeLightFalloff", "Linear", "", {"Strength": 1.0}))
    chain(tree, emission, "Color", ("ShaderNodeTexCoord", "UV", "", {}), CHECKER)
    sun = tree_of(stage.light("SUN", (0, 0, 5), (0.7, 0.5, 0.0), energy=0.2, angle=0.1))
    chain(*sun, "Color", ("ShaderNodeTexCoord", "Normal", "", {}), CHECKER)


def box(stage, corner, size: float):
    x, y, z = corner
    corners = [(x + size * i, y + size * j, z + size * k) for k in (0, 1) for j in (0, 1) for i in (0, 1)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return stage.mesh(corners, faces, material=stage.diffuse(0.6))


# Displacement -------------------------------------------------------------------------------------------------------


def displacement(stage) -> None:
    """A ball by Displacement Only, a floor by Displacement and Bump at its mesh's density, and a subdivided plate,
    under a lamp and the world."""
    import bpy

    stage.scene.render.filter_size = 1.5
    stage.camera((0, -5.0, 3.4), (0.98, 0, 0), 0.75)
    stage.world((0.8, 0.9, 1.0), 0.4)
    stage.light("AREA", (2.0, -1.5, 3.5), (0.3, 0.5, 0.0), size=1.0, energy=150.0)
    side = np.linspace(-3.0, 3.0, 121)
    faces = [(k + 121 * j, k + 1 + 121 * j, k + 122 + 121 * j, k + 121 + 121 * j)
             for j in range(120) for k in range(120)]  # fmt: skip
    stage.mesh([(x, y, 0.0) for y in side for x in side], faces, material=displacing(stage, "BOTH", 3.0, 0.15))
    lat, lon = np.meshgrid(np.linspace(0.05, np.pi - 0.05, 61), np.arange(120) * 2 * np.pi / 120, indexing="ij")
    ball = np.stack([np.sin(lat) * np.cos(lon), np.sin(lat) * np.sin(lon), np.cos(lat)], -1).reshape(-1, 3)
    faces = [(k * 120 + j, (k + 1) * 120 + j, (k + 1) * 120 + (j + 1) % 120, k * 120 + (j + 1) % 120)
             for k in range(60) for j in range(120)]  # fmt: skip
    stage.mesh((0.7 * ball).tolist(), faces, material=displacing(stage, "DISPLACEMENT", 2.5, 0.3),
               location=(-0.8, 0.2, 0.8))  # fmt: skip
    plate = stage.rectangle((-0.6, -0.6), (0.6, 0.6), material=displacing(stage, "DISPLACEMENT", 2.0, 0.3),
                            location=(1.1, 0.2, 0.8), turn=(0.5, -0.2, 0.0))  # fmt: skip
    levels = bpy.data.objects[plate.name].modifiers.new("Subdivision", "SUBSURF")
    levels.subdivision_type, levels.levels, levels.render_levels = "SIMPLE", 6, 6
    for one in stage.scene.objects:
        if one.type == "MESH":
            one.data.shade_smooth()


def displacing(stage, method: str, scale: float, height: float):
    """A diffuse material that noise displaces."""
    material = stage.diffuse(0.6)
    material.displacement_method = method
    tree = material.node_tree
    spot, noise, lift = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("TexCoord", "TexNoise", "Displacement"))
    noise.inputs["Scale"].default_value, noise.inputs["Detail"].default_value = scale, 1.0
    lift.inputs["Scale"].default_value = height
    output = next(one for one in tree.nodes if one.type == "OUTPUT_MATERIAL")
    tree.links.new(spot.outputs["Object"], noise.inputs["Vector"])
    tree.links.new(noise.outputs[0], lift.inputs["Height"])
    tree.links.new(lift.outputs[0], output.inputs["Displacement"])
    return material


# Blender 5's nodes --------------------------------------------------------------------------------------------------


def nodes(stage) -> None:
    """Cards of a repeat zone, closures, bundles, a menu switch in a group, Radial Tiling, integers and booleans."""
    from tests.cases import test_nodes_of_blender_5 as made

    lit_floor(stage)

    def new(number, socket_of):
        material = stage.material("ShaderNodeEmission", Strength=0.8) if number % 2 else stage.diffuse()
        tree = material.node_tree
        shader = next(one for one in tree.nodes if one.type in ("EMISSION", "BSDF_DIFFUSE"))
        tree.links.new(socket_of(tree), shader.inputs["Color"])
        card(stage, number, material)

    new(0, lambda tree: made.zone(tree, 4, made.noise(tree)))
    new(1, closure)
    new(2, bundle)
    for number, chosen in ((3, "A"), (4, "B")):
        new(number, lambda tree, chosen=chosen: switch(tree, chosen))
    new(5, tiling)
    new(6, lambda tree: made.zone(tree, 0, made.noise(tree)))


def closure(tree):
    from tests.cases.test_nodes_of_blender_5 import add, noise

    begin, end, run = (add(tree, kind) for kind in ("NodeClosureInput", "NodeClosureOutput", "NodeEvaluateClosure"))
    begin.pair_with_output(end)
    for node in (end, run):
        node.input_items.new("FLOAT", "Given")
        node.output_items.new("FLOAT", "Made")
    power = add(tree, "ShaderNodeMath", operation="POWER")
    power.inputs[1].default_value = 3.0
    tree.links.new(begin.outputs["Given"], power.inputs[0])
    tree.links.new(power.outputs[0], end.inputs["Made"])
    tree.links.new(end.outputs["Closure"], run.inputs["Closure"])
    tree.links.new(noise(tree), run.inputs["Given"])
    return run.outputs["Made"]


def bundle(tree):
    from tests.cases.test_nodes_of_blender_5 import add, noise

    pack, unpack = add(tree, "NodeCombineBundle"), add(tree, "NodeSeparateBundle")
    for node in (pack, unpack):
        node.bundle_items.new("FLOAT", "One")
        node.bundle_items.new("RGBA", "Two")
    pack.inputs["Two"].default_value = (0.9, 0.4, 0.1, 1)
    tree.links.new(noise(tree), pack.inputs["One"])
    tree.links.new(pack.outputs["Bundle"], unpack.inputs["Bundle"])
    mix = add(tree, "ShaderNodeMix", data_type="RGBA")
    tree.links.new(unpack.outputs["One"], mix.inputs["Factor"])
    tree.links.new(unpack.outputs["Two"], mix.inputs[6])
    return mix.outputs[2]


def switch(tree, chosen: str):
    import bpy

    from tests.cases.test_nodes_of_blender_5 import add, noise

    group = bpy.data.node_groups.new("Chosen", "ShaderNodeTree")
    group.interface.new_socket("Colour", in_out="OUTPUT", socket_type="NodeSocketColor")
    menu, end = group.nodes.new("GeometryNodeMenuSwitch"), group.nodes.new("NodeGroupOutput")
    menu.inputs["Menu"].default_value = chosen
    menu.inputs["A"].default_value = (0.2, 0.7, 0.1, 1)
    group.links.new(noise(group), menu.inputs["B"])
    group.links.new(menu.outputs[0], end.inputs[0])
    return add(tree, "ShaderNodeGroup", node_tree=group).outputs[0]


def tiling(tree):
    from tests.cases.test_nodes_of_blender_5 import add

    spot, tiles = add(tree, "ShaderNodeTexCoord"), add(tree, "ShaderNodeRadialTiling")
    shift = add(tree, "ShaderNodeVectorMath", operation="SUBTRACT")
    shift.inputs[1].default_value = (0.5, 0.5, 0.0)
    tree.links.new(spot.outputs["UV"], shift.inputs[0])
    tree.links.new(shift.outputs[0], tiles.inputs["Vector"])
    return tiles.outputs[0]


SCENES = {
    "images": images, "attributes": attributes, "working space": working_space, "lamps": lamps,
    "displacement": displacement, "nodes": nodes,
}  # fmt: skip
