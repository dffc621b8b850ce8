"""Blender data-blocks from shapes and numbers: meshes, materials, lights, camera, world, render settings.

Works the same in Blender 4.5 and 5.2: where 5.x gives a new data-block its nodes, 4.5 is asked for them.
"""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Vector

from .shapes import Shape

PICTURE_SIZE = (512, 384)


def begin(title: str) -> None:
    """Empty Blender and name its one scene."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.name = title
    for screen in bpy.data.screens:
        for area in screen.areas:
            if area.type == "FILE_BROWSER" and area.spaces.active.params:
                area.spaces.active.params.directory = b"//"  # otherwise the home folder of whoever runs this


def finish() -> None:
    """Set what all samples share: size, Cycles as an unbiased reference, a plain view transform."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = PICTURE_SIZE
    scene.render.resolution_percentage = 100
    scene.view_settings.view_transform = "Standard"
    scene.view_settings.look = "None"
    cycles = scene.cycles
    cycles.samples = 256
    cycles.preview_samples = 32
    cycles.use_adaptive_sampling = False  # every pixel gets the same number of samples
    cycles.use_denoising = True
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    cycles.blur_glossy = 0.0
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = 8
    cycles.transparent_max_bounces = 64


# Objects


def collection(name: str, parent: bpy.types.Collection | None = None) -> bpy.types.Collection:
    """A new collection, in the scene's own unless a parent is named."""
    new = bpy.data.collections.new(name)
    (parent or bpy.context.scene.collection).children.link(new)
    return new


def place(
    data,
    name: str,
    location=(0, 0, 0),
    rotation_degrees=(0, 0, 0),
    scale=(1, 1, 1),
    into: bpy.types.Collection | None = None,
) -> bpy.types.Object:
    """An object of `data` (None: an empty) in a collection."""
    thing = bpy.data.objects.new(name, data)
    thing.location = location
    thing.rotation_euler = np.radians(rotation_degrees)
    thing.scale = scale
    (into or bpy.context.scene.collection).objects.link(thing)
    return thing


def mesh(name: str, shape: Shape, *materials: bpy.types.Material, smooth_below: float = 0.0) -> bpy.types.Mesh:
    """A mesh data-block; edges that bend less than `smooth_below` degrees shade smooth."""
    data = bpy.data.meshes.new(name)
    data.from_pydata(shape.vertices.tolist(), [], shape.faces)
    if shape.uvs:
        layer = data.uv_layers.new(name="UVMap")
        layer.data.foreach_set("uv", np.asarray(shape.uvs, np.float32).ravel())
    for material in materials:
        data.materials.append(material)
    if len(materials) > 1:
        data.polygons.foreach_set("material_index", np.asarray(shape.face_slots(), np.int32))
    if smooth_below:
        data.shade_smooth()
        data.set_sharp_from_angle(angle=np.radians(smooth_below))
    data.validate()
    data.update()
    return data


def solid(
    name: str,
    shape: Shape,
    *materials: bpy.types.Material,
    smooth_below: float = 0.0,
    bevel: float = 0.0,
    **placing,
) -> bpy.types.Object:
    """A mesh and its object under one name; `bevel` metres round its hard edges by a modifier."""
    thing = place(mesh(name, shape, *materials, smooth_below=smooth_below), name, **placing)
    if bevel:
        modifier = thing.modifiers.new("Bevel", "BEVEL")
        modifier.width = bevel
        modifier.segments = 2
        modifier.limit_method = "ANGLE"
        modifier.harden_normals = True
        if not smooth_below:
            thing.data.shade_smooth()
    return thing


def aim(thing: bpy.types.Object, target) -> None:
    """Turn a light or camera so that it looks at a point, with its x axis level."""
    direction = Vector(target) - thing.location
    thing.rotation_euler = direction.to_track_quat("-Z", "Y").to_euler()


def light(
    name: str, kind: str, location, target=None, energy=100.0, color=(1, 1, 1), into=None, **settings
) -> bpy.types.Object:
    """A light object; `settings` are properties of its data-block (shape, size, angle, spot_blend, …)."""
    data = bpy.data.lights.new(name, kind)
    data.energy = energy
    data.color = color
    for key, value in settings.items():
        setattr(data, key, value)
    thing = place(data, name, location=location, into=into)
    if target is not None:
        aim(thing, target)
    return thing


def camera(location, target, lens: float = 50.0) -> bpy.types.Object:
    """The scene's camera; `lens` in millimetres on a sensor 36 mm wide."""
    data = bpy.data.cameras.new("Camera")
    data.lens = lens
    data.clip_start, data.clip_end = 0.05, 200.0
    thing = place(data, "Camera", location=location)
    aim(thing, target)
    bpy.context.scene.camera = thing
    return thing


# Shader nodes


def _cleared_tree(owner) -> bpy.types.NodeTree:
    if owner.node_tree is None:  # Blender 4.5
        owner.use_nodes = True
    owner.node_tree.nodes.clear()
    return owner.node_tree


def _node(tree, kind: str, location, **sockets):
    node = tree.nodes.new(kind)
    node.location = location
    for name, value in sockets.items():
        socket = node.inputs[name.replace("_", " ")]
        if isinstance(value, bpy.types.NodeSocket):
            tree.links.new(value, socket)
        else:
            socket.default_value = value
    return node


def _color(value):
    """RGB to RGBA; sockets and numbers pass."""
    return (*value, 1.0) if isinstance(value, tuple) and len(value) == 3 else value


def _image_node(tree, picture: bpy.types.Image, location):
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = picture
    node.location = location
    return node


def _output(tree, shader, x: float = 320.0, kind: str = "ShaderNodeOutputMaterial") -> None:
    output = tree.nodes.new(kind)
    output.location = (x, 0)
    tree.links.new(shader.outputs[0], output.inputs["Surface"])


def principled(
    name: str,
    color=(0.8, 0.8, 0.8),
    roughness: float = 0.5,
    metallic: float = 0.0,
    picture: bpy.types.Image | None = None,
    roughness_picture: bpy.types.Image | None = None,
    use_alpha: bool = False,
    **sockets,
) -> bpy.types.Material:
    """A Principled material; an image gives its base colour, and its alpha too if `use_alpha`."""
    material = bpy.data.materials.new(name)
    tree = _cleared_tree(material)
    if picture:
        texture = _image_node(tree, picture, (-340, 60))
        color = texture.outputs["Color"]
        if use_alpha:
            sockets["Alpha"] = texture.outputs["Alpha"]
    if roughness_picture:
        roughness = _image_node(tree, roughness_picture, (-340, -260)).outputs["Color"]
    sockets |= {"Base_Color": _color(color), "Roughness": roughness, "Metallic": metallic}
    _output(tree, _node(tree, "ShaderNodeBsdfPrincipled", (0, 0), **sockets))
    return material


def diffuse(name: str, color, roughness: float = 0.0, picture: bpy.types.Image | None = None) -> bpy.types.Material:
    material = bpy.data.materials.new(name)
    tree = _cleared_tree(material)
    if picture:
        color = _image_node(tree, picture, (-340, 60)).outputs["Color"]
    _output(tree, _node(tree, "ShaderNodeBsdfDiffuse", (0, 0), Color=_color(color), Roughness=roughness))
    return material


def glossy(name: str, color, roughness: float) -> bpy.types.Material:
    material = bpy.data.materials.new(name)
    tree = _cleared_tree(material)
    _output(tree, _node(tree, "ShaderNodeBsdfAnisotropic", (0, 0), Color=_color(color), Roughness=roughness))
    return material


def emission(name: str, color, strength: float) -> bpy.types.Material:
    """A material that shines with `strength` W/(sr m2) times its colour, and reflects nothing."""
    material = bpy.data.materials.new(name)
    tree = _cleared_tree(material)
    _output(tree, _node(tree, "ShaderNodeEmission", (0, 0), Color=_color(color), Strength=strength))
    return material


def glaze(name: str, color, gloss_color, roughness: float, share: float) -> bpy.types.Material:
    """Diffuse under a constant share of gloss, joined by a Mix Shader."""
    material = bpy.data.materials.new(name)
    tree = _cleared_tree(material)
    under = _node(tree, "ShaderNodeBsdfDiffuse", (-60, 0), Color=_color(color))
    over = _node(tree, "ShaderNodeBsdfAnisotropic", (-60, -140), Color=_color(gloss_color), Roughness=roughness)
    mixed = _node(tree, "ShaderNodeMixShader", (160, 0), Fac=share)
    tree.links.new(under.outputs[0], mixed.inputs[1])
    tree.links.new(over.outputs[0], mixed.inputs[2])
    _output(tree, mixed, 360)
    return material


def cutout(name: str, picture: bpy.types.Image) -> bpy.types.Material:
    """Diffuse where the image is opaque, Transparent where it is not, joined by a Mix Shader."""
    material = bpy.data.materials.new(name)
    tree = _cleared_tree(material)
    texture = _image_node(tree, picture, (-400, 60))
    hole = _node(tree, "ShaderNodeBsdfTransparent", (-60, 120))
    leaf = _node(tree, "ShaderNodeBsdfDiffuse", (-60, 0), Color=texture.outputs["Color"])
    mixed = _node(tree, "ShaderNodeMixShader", (160, 0), Fac=texture.outputs["Alpha"])
    tree.links.new(hole.outputs[0], mixed.inputs[1])
    tree.links.new(leaf.outputs[0], mixed.inputs[2])
    _output(tree, mixed, 360)
    return material


def world(color=(0, 0, 0), strength: float = 1.0, picture: bpy.types.Image | None = None, turn_degrees: float = 0.0):
    """The world: one colour, or an equirectangular image turned about the vertical."""
    data = bpy.data.worlds.new("World")
    bpy.context.scene.world = data
    tree = _cleared_tree(data)
    if picture:
        coordinates = tree.nodes.new("ShaderNodeTexCoord")
        coordinates.location = (-760, 0)
        turn = (0, 0, float(np.radians(turn_degrees)))
        mapping = _node(tree, "ShaderNodeMapping", (-560, 0), Vector=coordinates.outputs["Generated"], Rotation=turn)
        texture = _node(tree, "ShaderNodeTexEnvironment", (-320, 0), Vector=mapping.outputs["Vector"])
        texture.image = picture
        color = texture.outputs["Color"]
    background = _node(tree, "ShaderNodeBackground", (0, 0), Color=_color(color), Strength=strength)
    _output(tree, background, kind="ShaderNodeOutputWorld")
    return data


# Images


def image(name: str, pixels: np.ndarray, linear: bool = False) -> bpy.types.Image:
    """Pack (H, W, 3 or 4) values, bottom row first. `linear`: floats for light; otherwise 8-bit sRGB-encoded."""
    height, width, channels = pixels.shape
    rgba = np.ones((height, width, 4), np.float32)
    rgba[..., :channels] = pixels
    data = bpy.data.images.new(name, width, height, alpha=channels == 4, float_buffer=linear)
    data.pixels.foreach_set(rgba.ravel())
    data.update()
    data.pack()
    return data


def data_image(name: str, values: np.ndarray) -> bpy.types.Image:
    """Pack (H, W) numbers in [0, 1] that are no colour, such as roughness."""
    data = image(name, np.repeat(values[..., None], 3, axis=2))
    data.colorspace_settings.name = "Non-Color"
    return data
