"""A camera whose matrix mirrors, by its own scale or by its rig's, shows the mirrored picture, as in Cycles."""

import bpy
import pytest

from .conftest import agree

SIZE = (32, 24)


def sided(stage):
    """A material that is red from the front and blue from behind."""
    made = stage.material("ShaderNodeEmission")
    tree = made.node_tree
    mix = tree.nodes.new("ShaderNodeMix")
    mix.data_type = "RGBA"
    colors = [socket for socket in mix.inputs if socket.type == "RGBA"]
    colors[0].default_value, colors[1].default_value = (1, 0.1, 0, 1), (0, 0.1, 1, 1)
    facing = tree.nodes.new("ShaderNodeNewGeometry").outputs["Backfacing"]
    tree.links.new(facing, mix.inputs[0])
    tree.links.new(next(socket for socket in mix.outputs if socket.type == "RGBA"), tree.nodes["Emission"].inputs[0])
    return made


@pytest.fixture
def room(stage):
    """A floor, a smooth ball, and two cards, one seen from behind; an instance of it mirrored itself."""
    stage.floor(material=stage.diffuse(0.8))
    material = sided(stage)
    stage.rectangle((-1.6, 0.4), (-0.6, 1.2), 0.4, material=material)
    stage.rectangle((-1.6, -0.8), (-0.6, 0.1), 0.4, material=material, turn=(3.14159, 0, 0))
    stage.rectangle((-1.6, -1.2), (-0.6, -0.5), 0.4, material=material, scale=(-0.6, 1, 1))
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.6, location=(0.9, 0.3, 0.6))
    bpy.context.object.data.shade_smooth()
    bpy.context.object.data.materials.append(stage.principled(Base_Color=(0.6, 0.2, 0.1, 1), Roughness=0.4))
    stage.light("SUN", turn=(0.5, 0.4, 0), energy=2.0)
    stage.world(strength=0.2)


@pytest.mark.parametrize("scale", [(-1, 1, 1), (1, -1, 1), (1, 1, -1), (-2, -1, -0.5)])
@pytest.mark.parametrize("kind", ["ORTHO", "PERSP"])
def test_a_mirrored_camera_shows_what_cycles_shows(stage, room, beside, kind, scale):
    camera = stage.camera_above() if kind == "ORTHO" else stage.camera((0.4, -1, 6), (0.15, 0, 0))
    if scale[2] < 0:
        camera.rotation_euler.x += 3.1  # it looks the other way
    camera.scale = scale
    own, cycles = beside(16, SIZE, bounces=0)
    cycles, own = cycles["combined"][..., :3], own["combined"][..., :3]
    assert cycles.max() > 0.3
    agree(own.reshape(4, 6, 4, 8, 3).mean((1, 3)), cycles.reshape(4, 6, 4, 8, 3).mean((1, 3)))


def test_a_rig_that_mirrors_its_camera_does_the_same(stage, room, beside):
    camera = stage.camera((0.4, -1, 6), (0.15, 0, 0))
    camera.data.dof.use_dof, camera.data.dof.focus_distance = True, 5.0
    rig = bpy.data.objects.new("Rig", None)
    stage.scene.collection.objects.link(rig)
    rig.scale = (-1, 1, 1)
    camera.parent = rig
    own, cycles = beside(64, SIZE, bounces=0)
    cycles, own = cycles["combined"][..., :3], own["combined"][..., :3]
    agree(own.reshape(4, 6, 4, 8, 3).mean((1, 3)), cycles.reshape(4, 6, 4, 8, 3).mean((1, 3)))
