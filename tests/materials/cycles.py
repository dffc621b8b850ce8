"""Renders patches of material side by side by Cycles, to compare values with it.

Patches are flat squares in a row-wise grid, seen by an orthographic camera that is tilted so that the cosine between
normal and view is the same everywhere. The world is white with radiance 1 (a furnace). The first sample of a pixel
stands at its centre and colour passes do not depend on chance, so one sample is exact for both.
"""

import math

import bpy
import numpy as np

from addon.compare.reference import render_passes

RESOLUTION = 4  # pixels along a side of each patch, unless asked otherwise


def new_material(name="Patch"):
    material = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    material.node_tree.nodes.clear()
    return material


def shader_material(node_type, **settings):
    """A material of one shader node; settings are sockets by name (underscores are spaces) or properties."""
    material = new_material()
    nodes = material.node_tree.nodes
    shader, output = nodes.new(node_type), nodes.new("ShaderNodeOutputMaterial")
    for name, value in settings.items():
        socket = shader.inputs.get(name.replace("_", " "))
        if socket is None:
            setattr(shader, name, value)
        else:
            socket.default_value = value
    material.node_tree.links.new(shader.outputs[0], output.inputs[0])
    return material


def render_patches(materials, cosine=1.0, samples=1, resolution=RESOLUTION, uv=(0.0, 1.0)):
    """Passes per patch: name -> (patches, resolution, resolution, channels), and the direction to the viewer (3,)."""
    scene = bpy.context.scene
    side = math.ceil(math.sqrt(len(materials)))
    tilt = math.acos(cosine)
    for i, material in enumerate(materials):
        _add_patch(scene, material, i % side, i // side, 1.0 / cosine, uv)
    normal_to_viewer = np.array([0.0, -math.sin(tilt), math.cos(tilt)])
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.type, camera.data.ortho_scale, camera.data.clip_end = "ORTHO", side, 1e5
    # Rotation about x turns the camera's backward axis (0, 0, 1) to (0, -sin, cos).
    camera.rotation_euler = (tilt, 0.0, 0.0)
    distance = 10.0 + 10.0 * side / cosine
    camera.location = np.array([0.5 * side, 0.5 * side / cosine, 0.0]) + distance * normal_to_viewer
    scene.collection.objects.link(camera)
    scene.camera = camera
    _white_world(scene)
    passes = render_passes(scene, "CYCLES", samples, size=(side * resolution,) * 2, direct_only=True)
    cells = {}
    for name, pixels in passes.images.items():
        rows = pixels.reshape(side, resolution, side, resolution, -1).swapaxes(1, 2)
        cells[name] = rows.reshape(side * side, resolution, resolution, -1)[: len(materials)]
    return cells, normal_to_viewer


def _add_patch(scene, material, column, row, stretch, uv):
    mesh = bpy.data.meshes.new("Patch")
    low, high = row * stretch, (row + 1) * stretch
    corners = [(column, low, 0), (column + 1, low, 0), (column + 1, high, 0), (column, high, 0)]
    mesh.from_pydata(corners, [], [(0, 1, 2, 3)])
    layer = mesh.uv_layers.new(name="UVMap")
    first, last = uv
    for loop, place in zip(layer.data, ((first, first), (last, first), (last, last), (first, last))):
        loop.uv = place
    mesh.materials.append(material)
    scene.collection.objects.link(bpy.data.objects.new("Patch", mesh))


def _white_world(scene):
    scene.world = bpy.data.worlds.new("White")
    if bpy.app.version < (5, 0, 0):
        scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
