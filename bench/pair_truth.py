"""Light tracing of rooms of `python -m bench pairs` with Mitsuba 3, where Cycles cannot find what a pair shows.

A sun of a degree that a glass ball mirrors onto a wall is met by about one in a million of Cycles' paths: its pictures
lack that light, and two of them agree about it. Photons that leave the sun and are joined to the camera at each diffuse
surface have no such gap. What the camera sees in glass or a mirror they cannot reach: those blocks are left out.

`--truth PYTHON` names an interpreter that has the packages of the dependency group `truth`; it runs this file as a
program: `pair_truth.py SCENE.npz RESULT.npz PHOTONS`. Results are kept in results/pairs_truth.npz.

SCENE.npz: arrays `vertices_K`, `normals_K`, `faces_K` for mesh K; by mesh `glass`, `mirror`, `smooth` and `colors`
(R, G, B, IOR); of the sun `sun` (4, 4), `irradiance` and `spread` (radians); `camera` (4, 4), `angle` across the
picture, `size`.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

KEPT = Path(__file__).resolve().parent / "results" / "pairs_truth.npz"
DIRECTIONS = 16  # of the sun's disc
DEPTH = 32
STEP = 4096  # photons a pixel and call


def known() -> dict[str, np.ndarray]:
    """By names of features: two pictures (2, H, W, 3) of half the photons each, the lowest row first."""
    return dict(np.load(KEPT)) if KEPT.exists() else {}


def make(room, names: str, size: tuple[int, int], python: str, photons: int) -> None:
    """Trace a room's light and keep it. Raises ValueError where a room has what is not traced here."""
    with tempfile.TemporaryDirectory() as folder:
        scene, result = Path(folder) / "scene.npz", Path(folder) / "result.npz"
        np.savez(scene, **of_room(room, size))
        subprocess.run([python, __file__, str(scene), str(result), str(photons)], check=True)
        kept = known() | {names: np.load(result)["pictures"].astype(np.float32)}
    np.savez_compressed(KEPT, **kept)


def of_room(room, size: tuple[int, int]) -> dict[str, np.ndarray]:
    """What SCENE.npz holds."""
    import bpy

    if room.lamp.type != "LIGHT" or room.lamp.data.type != "SUN":
        raise ValueError("Only rooms that a sun lights are traced: choose a pair with 'sun'.")
    graph = bpy.context.evaluated_depsgraph_get()
    meshes = [one for one in room.scene.objects if one.type == "MESH"]
    shaders = [next(n for n in one.active_material.node_tree.nodes if n.type.startswith("BSDF")) for one in meshes]
    mirrors = np.array([one.type == "BSDF_PRINCIPLED" and _smooth_metal(one) for one in shaders])
    if unknown := {one.type for one, mirror in zip(shaders, mirrors) if not mirror} - {"BSDF_DIFFUSE", "BSDF_GLASS"}:
        raise ValueError(f"Diffuse and Glass BSDF and smooth metal are traced, not {', '.join(sorted(unknown))}.")
    data: dict[str, np.ndarray] = {}
    for number, one in enumerate(meshes):
        mesh, matrix = one.evaluated_get(graph).to_mesh(), np.array(one.matrix_world)
        mesh.calc_loop_triangles()
        places = np.array([vertex.co for vertex in mesh.vertices])
        data[f"vertices_{number}"] = places @ matrix[:3, :3].T + matrix[:3, 3]
        data[f"normals_{number}"] = np.array([vertex.normal for vertex in mesh.vertices]) @ matrix[:3, :3].T
        data[f"faces_{number}"] = np.array([triangle.vertices for triangle in mesh.loop_triangles])
    index = [float(one.inputs["IOR"].default_value) if one.type == "BSDF_GLASS" else 1.0 for one in shaders]
    tint = [one.inputs["Base Color" if mirror else "Color"] for one, mirror in zip(shaders, mirrors)]
    colors = [[*socket.default_value[:3], ior] for socket, ior in zip(tint, index)]
    camera, lamp = room.camera, room.lamp
    return data | {
        "glass": np.array([one.type == "BSDF_GLASS" for one in shaders]), "mirror": mirrors, "colors": np.array(colors),
        "smooth": np.array([bool(len(one.data.polygons) and one.data.polygons[0].use_smooth) for one in meshes]),
        "sun": np.array(lamp.matrix_world), "irradiance": np.array(lamp.data.energy * np.array(lamp.data.color)),
        "spread": np.array(lamp.data.angle), "camera": np.array(camera.matrix_world),
        "angle": np.array(camera.data.angle), "size": np.array(size),
    }  # fmt: skip


def _smooth_metal(shader) -> bool:
    return shader.inputs["Metallic"].default_value == 1.0 and shader.inputs["Roughness"].default_value == 0.0


def trace(scene_file: str, result_file: str, photons: int) -> None:
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    data = np.load(scene_file)
    width, height = (int(extent) for extent in data["size"])
    parts: dict[str, object] = {"type": "scene", "camera": _camera(mi, data, width, height)}
    for number, (smooth, color) in enumerate(zip(data["smooth"], data["colors"])):
        parts[f"mesh{number}"] = _mesh(mi, data, number, bool(smooth), [float(c) for c in color])
    for number, direction in enumerate(_disc(data["sun"], float(data["spread"]) / 2)):
        shares = [float(one) / DIRECTIONS for one in data["irradiance"]]
        parts[f"sun{number}"] = {
            "type": "directional", "direction": direction, "irradiance": {"type": "rgb", "value": shares},
        }  # fmt: skip
    scene = mi.load_dict(parts)
    tracer = mi.load_dict({"type": "ptracer", "max_depth": DEPTH, "rr_depth": 8, "hide_emitters": True})
    calls = max(1, round(photons / (2 * STEP * width * height)))
    seeds = 1 + np.arange(2 * calls).reshape(2, calls)
    halves = [np.mean([np.array(mi.render(scene, integrator=tracer, spp=STEP, seed=int(k))) for k in own], 0)
              for own in seeds]  # fmt: skip
    np.savez(result_file, pictures=np.array(halves)[:, ::-1, :, :3])


def _camera(mi, data, width: int, height: int) -> dict:
    matrix = data["camera"]
    at, ahead, up = matrix[:3, 3], -matrix[:3, 2], matrix[:3, 1]
    turned = mi.ScalarTransform4f().look_at(origin=at.tolist(), target=(at + ahead).tolist(), up=up.tolist())
    film = {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"}, "pixel_format": "rgb"}
    angle = float(np.degrees(data["angle"]))
    return {"type": "perspective", "fov": angle, "fov_axis": "x", "to_world": turned, "film": film}


def _mesh(mi, data, number: int, smooth: bool, color: list[float]):
    matte = {"type": "twosided", "side": {"type": "diffuse", "reflectance": {"type": "rgb", "value": color[:3]}}}
    clear = {"type": "dielectric", "int_ior": color[3], "ext_ior": 1.0}
    metal = {"type": "conductor", "material": "none", "specular_reflectance": {"type": "rgb", "value": color[:3]}}
    vertices, faces = data[f"vertices_{number}"], data[f"faces_{number}"]
    properties = mi.Properties()
    properties["mesh_bsdf"] = mi.load_dict(
        clear if data["glass"][number] else metal if data["mirror"][number] else matte
    )
    mesh = mi.Mesh(f"mesh{number}", len(vertices), len(faces), has_vertex_normals=smooth, props=properties)
    values = mi.traverse(mesh)
    values["vertex_positions"] = vertices.astype(np.float32).ravel()
    values["faces"] = faces.astype(np.uint32).ravel()
    if smooth:
        values["vertex_normals"] = data[f"normals_{number}"].astype(np.float32).ravel()
    values.update()
    return mesh


def _disc(sun: np.ndarray, half: float) -> list[list[float]]:
    """Directions in which the sun's light travels, evenly spread over its disc."""
    made = []
    for k in range(DIRECTIONS):
        off, turn = half * np.sqrt((k + 0.5) / DIRECTIONS), 2.399963 * k
        direction = -sun[:3, 2] + off * (np.cos(turn) * sun[:3, 0] + np.sin(turn) * sun[:3, 1])
        made.append((direction / np.linalg.norm(direction)).tolist())
    return made


if __name__ == "__main__":
    trace(sys.argv[1], sys.argv[2], int(sys.argv[3]))
