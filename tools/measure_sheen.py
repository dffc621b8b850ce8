"""Measures Cycles' microfiber sheen and writes addon/materials/sheen.npz.

    python tools/measure_sheen.py

The model (Zeltner, Burley & Chiang, "Practical multiple-scattering sheen using linearly transformed cosines", 2022) is
a cosine lobe under a linear map, whose two coefficients a, b and albedo R depend on roughness and view angle and come
from a fit to simulated cloth. The fit is only known as a table inside Cycles, so it is measured: for a light direction
(x, y, z) in the frame of normal and viewer,

    f cos = R / pi * z * (a / ((a x + b z)^2 + (a y)^2 + z^2))^2

so that 1 / sqrt(pi f cos / z) is linear in (a / s, 2 b / s, (b^2 + 1) / (a s)) with s = sqrt(R). Cycles renders 32 x 32
patches, one for each roughness and cosine that it tabulates, under five suns, one after the other; least squares gives
the three terms, and these give a, b and R in closed form.
"""

import os
import sys
from pathlib import Path

import bpy
import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

import addon  # noqa: E402
from addon.compare.reference import render_passes  # noqa: E402
from addon.materials.energy import SHEEN_PATH, SHEEN_SIZE  # noqa: E402

SUNS = ((0, 0, 1), (0.5, 0.3, 0.8), (0.9, 0.0, 0.35), (0.7, -0.6, 0.4), (0.3, 0.8, 0.4))  # towards the sun


def patches():
    """Unit squares in the plane z = 0, column = roughness, row = cosine, that carry roughness and normal."""
    axis = np.linspace(0.0, 1.0, SHEEN_SIZE)
    corners, faces, roughness, normals = [], [], [], []
    for row, mu in enumerate(axis):
        for column, value in enumerate(axis):
            first = len(corners)
            corners += [(column, row, 0), (column + 1, row, 0), (column + 1, row + 1, 0), (column, row + 1, 0)]
            faces.append(range(first, first + 4))
            roughness += [value] * 4
            normals += [(np.sqrt(1.0 - mu * mu), 0.0, mu)] * 4
    mesh = bpy.data.meshes.new("Patches")
    mesh.from_pydata(corners, [], faces)
    mesh.attributes.new("roughness", "FLOAT", "POINT").data.foreach_set("value", roughness)
    mesh.attributes.new("facing", "FLOAT_VECTOR", "POINT").data.foreach_set("vector", np.ravel(normals))
    mesh.materials.append(material())
    return mesh, np.reshape(normals, (SHEEN_SIZE, SHEEN_SIZE, 4, 3))[:, :, 0]


def material():
    made = bpy.data.materials.new("Sheen")
    if bpy.app.version < (5, 0):
        made.use_nodes = True
    made.cycles.use_bump_map_correction = False
    tree = made.node_tree
    tree.nodes.clear()
    sheen, output = tree.nodes.new("ShaderNodeBsdfSheen"), tree.nodes.new("ShaderNodeOutputMaterial")
    sheen.inputs["Color"].default_value = (1, 1, 1, 1)
    tree.links.new(sheen.outputs[0], output.inputs["Surface"])
    for name, source, target in (("roughness", "Fac", "Roughness"), ("facing", "Vector", "Normal")):
        attribute = tree.nodes.new("ShaderNodeAttribute")
        attribute.attribute_name = name
        tree.links.new(attribute.outputs[source], sheen.inputs[target])
    return made


def measure() -> dict[str, np.ndarray]:
    """Tables a, b and albedo, each (SHEEN_SIZE, SHEEN_SIZE) float32 [roughness, mu]."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.filter_size = 0.01
    mesh, normals = patches()
    scene.collection.objects.link(bpy.data.objects.new("Patches", mesh))
    view = bpy.data.cameras.new("Camera")
    view.type, view.ortho_scale = "ORTHO", SHEEN_SIZE
    camera = bpy.data.objects.new("Camera", view)
    camera.location = (SHEEN_SIZE / 2, SHEEN_SIZE / 2, 10)
    scene.collection.objects.link(camera)
    scene.camera = camera
    data = bpy.data.lights.new("Sun", "SUN")
    data.angle, data.energy = 0.0, 1.0
    sun = bpy.data.objects.new("Sun", data)
    scene.collection.objects.link(sun)

    viewer = np.array([0.0, 0.0, 1.0])
    bitangent = np.array([0.0, 1.0, 0.0])
    tangent = np.cross(normals, bitangent)  # in the plane of normal and viewer, on the viewer's side
    assert (tangent @ viewer >= 0.0).all()
    rows, values = [], []
    for direction in SUNS:
        towards = np.array(direction) / np.linalg.norm(direction)
        sun.rotation_euler = (0, np.arccos(towards[2]), np.arctan2(towards[1], towards[0]))
        size = (SHEEN_SIZE, SHEEN_SIZE)
        lit = render_passes(scene, "CYCLES", 1, 0, direct_only=True, size=size).images["combined"][..., 0]
        x, y, z = tangent @ towards, np.full(size, bitangent @ towards), normals @ towards
        known = (z > 0.02) & (lit > 0.0)
        rows.append(np.where(known[..., None], np.stack([x * x + y * y, x * z, z * z], axis=-1), 0.0))
        inverse = 1.0 / np.sqrt(np.pi * np.where(known, lit, 1.0) / np.where(known, z, 1.0))
        values.append(np.where(known, inverse, 0.0))
    matrix, right = np.stack(rows, axis=2), np.stack(values, axis=2)
    first, second, third = np.moveaxis(np.linalg.pinv(matrix) @ right[..., None], 2, 0)[..., 0]
    inverse_albedo = first * third - 0.25 * second * second
    seen = inverse_albedo > 0.0
    albedo = np.where(seen, 1.0 / np.where(seen, inverse_albedo, 1.0), 0.0)
    tables = {"a": first * np.sqrt(albedo), "b": 0.5 * second * np.sqrt(albedo), "albedo": albedo}
    # Smooth cloth seen from the front reflects nothing: its shape is that of the next rougher one that can be seen.
    nearest = np.maximum(np.argmax(seen, axis=1)[:, None], np.arange(SHEEN_SIZE))
    for name in "ab":
        tables[name] = np.take_along_axis(tables[name], nearest, axis=1)
    return {name: np.ascontiguousarray(table.T, np.float32) for name, table in tables.items()}


if __name__ == "__main__":
    addon.register()
    measured = measure()
    assert all(np.isfinite(table).all() for table in measured.values())
    np.savez_compressed(SHEEN_PATH, **measured)
    print(f"Wrote {SHEEN_PATH.name}.")
    sys.stdout.flush()
    os._exit(0)
