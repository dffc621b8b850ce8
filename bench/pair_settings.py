"""Objects, cameras and settings among the features of `python -m bench pairs`; see bench/pair_room.py."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path

import numpy as np

from bench.pair_room import feature

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
def deforming_blur(room):
    """A ball whose shape key moves while the shutter is open."""
    room.scene.render.use_motion_blur = True
    ball = room.ball(room.stage.diffuse(0.6))
    ball.shape_key_add(name="Basis")
    key = ball.shape_key_add(name="Stretched")
    for point in key.data:
        point.co.z *= 1.8
    for frame, value in ((0, 0.0), (2, 1.0)):
        key.value = value
        key.keyframe_insert("value", frame=frame)
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
def shadow_catcher(room):
    room.floor.is_shadow_catcher = True


@feature
def panorama(room):
    """The room from its middle, all around."""
    camera = room.camera.data
    camera.type = "PANO"
    lens = camera if hasattr(camera, "panorama_type") else camera.cycles
    lens.panorama_type = "EQUIRECTANGULAR"
    room.camera.location = (0.0, -1.2, 1.4)


@feature
def light_groups(room):
    """The lamp and the world in groups of their own, what glows in a third: together they are the picture."""
    names = ("Lamp", "World", "Glow")
    for name in names:
        room.layer.lightgroups.add(name=name)
    for one in room.scene.objects:
        one.lightgroup = "Lamp" if one.type == "LIGHT" else "Glow"
    room.scene.world.lightgroup = "World"

    def adds_up(layers: dict) -> str:
        total = sum(layers[f"Combined_{name}"][..., :3] for name in names)
        return apart(total, layers["Combined"][..., :3], "light groups")

    room.checks.append(adds_up)


@feature
def shader_aov(room):
    """A value that the block writes: a pixel has as much of it as it shows of the block."""
    made = room.layer.aovs.add()
    made.name, made.type = "level", "VALUE"
    output = room.block.data.materials[0].node_tree.nodes.new("ShaderNodeOutputAOV")
    output.aov_name, output.inputs["Value"].default_value = "level", 2.5

    def level(layers: dict) -> str:
        found = layers["level"]
        seen = room.block.visible_camera
        shown = found.mean() >= 0.01 if seen else found.max() == 0.0
        if not np.isfinite(found).all() or found.max() > 2.5 * 1.001 or found.min() < 0 or not shown:
            return f"the AOV of the block lies in {found.min():.3f} to {found.max():.3f}, mean {found.mean():.3f}"
        return ""

    room.checks.append(level)


def apart(total: np.ndarray, whole: np.ndarray, what: str) -> str:
    """A sentence where parts do not add up to the whole within a thousandth."""
    off = float(np.abs(total - whole).mean() / max(np.abs(whole).mean(), 1e-6))
    return f"{what} differ from the picture by {off:.3f} of its mean" if off > 1e-3 else ""


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
