"""A scene that every light path reaches, small enough to render in a tenth of a second."""

import bpy
import numpy as np
import pytest


def principled(name, **values):
    material = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0):
        material.use_nodes = True  # later versions have it on and warn about the property
    shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    for socket, value in values.items():
        shader.inputs[socket.replace("_", " ")].default_value = value
    return material


@pytest.fixture
def room(empty_scene):
    """A shiny floor, a mirror and a lamp of radiance that is seen, under a blue sky; Cycles, 16x12."""
    scene = empty_scene
    floor = bpy.data.meshes.new("Floor")
    floor.from_pydata([(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)], [], [(0, 1, 2, 3)])
    floor.materials.append(
        principled(
            "Floor", Base_Color=(0.6, 0.4, 0.2, 1), Roughness=0.3, Emission_Color=(1, 1, 1, 1), Emission_Strength=0.02
        )
    )
    wall = bpy.data.meshes.new("Wall")
    wall.from_pydata([(-2, 2, 0), (2, 2, 0), (2, 2, 3), (-2, 2, 3)], [], [(0, 1, 2, 3)])
    wall.materials.append(principled("Wall", Base_Color=(0.9, 0.9, 0.9, 1), Roughness=0.0, Metallic=1.0))
    lamp = bpy.data.lights.new("Lamp", "AREA")
    lamp.energy, lamp.size = 60, 1.5
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (0, -6, 2), (np.radians(80), 0, 0)
    lamp = bpy.data.objects.new("Lamp", lamp)
    lamp.location = (1, 0, 3)
    for thing in (bpy.data.objects.new("Floor", floor), bpy.data.objects.new("Wall", wall), lamp, camera):
        scene.collection.objects.link(thing)
    scene.camera = camera
    scene.world = bpy.data.worlds.new("World")
    if bpy.app.version < (5, 0):
        scene.world.use_nodes = True
    background = next(node for node in scene.world.node_tree.nodes if node.type == "BACKGROUND")
    background.inputs["Color"].default_value = (0.2, 0.4, 0.8, 1)
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 16, 12, 100
    return scene
