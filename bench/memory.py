"""Memory of a long session: `python -m bench memory`, the process's size over many different scenes.

Small scenes, each in a file of its own and with materials of a shape that no other has, are rendered with one sample,
in sizes that differ, one after the other in this process: what a day of look development or a test run does. After each
the resident size is read, and what is kept counted: compiled programs, bytes of the image pool, sessions. A process
that keeps only what it may use again stays flat once it is full. The slope is that of the second half, by least
squares. A software driver takes some 10 MiB for a program, in the process itself; a GPU's driver far less. `--film N`:
N frames of one scene that moves, with fog, glass, subsurface scattering, hair and markers of cameras, one after the
other; a pixel that is not finite ends it with an error.
"""

from __future__ import annotations

import argparse
import gc
import json
import random
import sys
from pathlib import Path

import numpy as np

from bench.cells import ROOT
from bench.shading import tree_of

RESULTS = ROOT / "out" / "memory.json"
OPERATIONS = ("ADD", "MULTIPLY", "MINIMUM", "SINE", "FRACT", "POWER", "ABSOLUTE")
SHADERS = ("ShaderNodeBsdfDiffuse", "ShaderNodeBsdfGlossy", "ShaderNodeBsdfPrincipled")
SIZES = ((32, 24), (40, 24), (48, 32), (33, 31), (64, 36))


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--scenes", type=int, default=200, metavar="N", help="default 200")
    parser.add_argument("--film", type=int, default=0, metavar="N", help="frames of an animation instead of scenes")
    parser.add_argument("--engine", default="CANDELA", help="default CANDELA")
    parser.add_argument("--results", default=RESULTS, type=Path, metavar="PATH", help="JSON; default out/memory.json")


def resident_bytes() -> int:
    """Of this process; where the system does not say, the most that it ever had."""
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    except OSError:
        import resource

        most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return most if sys.platform == "darwin" else 1024 * most
    import os

    return pages * os.sysconf("SC_PAGE_SIZE")


def kept() -> dict[str, int]:
    """What Candela holds in this process."""
    from addon import engine
    from addon.gfx import images, library

    return {
        "programs": library.kept(),
        "compiled": library.compile_count,
        "waiting": len(library._dropped),  # programs that are not used any more and cannot be freed yet
        "pool": images.pool.allocated_bytes,
        "images": sum(one.bytes for one in gc.get_objects() if isinstance(one, images.Image)),  # in the pool or not
        "sessions": len(engine._sessions),
    }


def build(number: int):
    """Scene `number` in an empty file: a cube on a plane, a lamp, and a material of a shape of its own."""
    import bpy

    draw = random.Random(number)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    material = bpy.data.materials.new("Own")
    tree = tree_of(material)
    tree.nodes.clear()
    socket = tree.nodes.new("ShaderNodeTexCoord").outputs["Object"]
    for _ in range(draw.randint(2, 8)):
        node = tree.nodes.new("ShaderNodeMath")
        node.operation = draw.choice(OPERATIONS)
        tree.links.new(socket, node.inputs[0])
        socket = node.outputs[0]
    shader, output = tree.nodes.new(draw.choice(SHADERS)), tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(socket, shader.inputs[0])
    tree.links.new(shader.outputs[0], output.inputs[0])
    for add, size, place in (
        (bpy.ops.mesh.primitive_plane_add, 8.0, (0.0, 0.0, 0.0)),
        (bpy.ops.mesh.primitive_cube_add, draw.uniform(0.5, 2.0), (draw.uniform(-1, 1), draw.uniform(-1, 1), 0.5)),
    ):
        add(size=size, location=place)
        bpy.context.object.data.materials.append(material)
    bpy.ops.object.light_add(type=draw.choice(("POINT", "SUN", "SPOT")), location=(0.0, 0.0, 3.0))
    bpy.context.object.data.energy = 50.0
    bpy.ops.object.camera_add(location=(0.0, -6.0, 3.0), rotation=(1.1, 0.0, 0.0))
    scene.camera = bpy.context.object
    return scene


def measure(scenes: int, engine: str, say=print) -> list[dict]:
    """A row for each scene: bytes, and what is kept."""
    import bpy

    rows = []
    for number in range(scenes):
        scene = build(number)
        scene.render.engine, scene.candela.samples = engine, 1
        scene.render.resolution_x, scene.render.resolution_y = SIZES[number % len(SIZES)]
        scene.render.resolution_percentage = 100
        bpy.ops.render.render(scene=scene.name)
        gc.collect()
        rows.append({"scene": number, "bytes": resident_bytes(), **kept()})
        if number % 10 == 9:
            say(line(rows[-1]))
    return rows


def film():
    """A scene of which nearly everything moves: what a long animation asks for in one process."""
    import bpy

    from bench import beside_scenes, media_scenes

    media_scenes.begin()
    scene = bpy.context.scene
    beside_scenes.haze()
    for name, place, inputs in (
        ("Glass", (-1.2, -0.8, 0.5), {"Transmission_Weight": 1.0, "Roughness": 0.0}),
        ("Skin", (1.2, -0.8, 0.5), {"Subsurface_Weight": 1.0}),
    ):
        beside_scenes.ball(0.4, place, beside_scenes.plain(0.8, 0.6, 0.5, **inputs))
        bpy.context.object.name = name
        moves(bpy.context.object, place, (place[0], -1.6, 1.2))
    hair = bpy.data.hair_curves.new("Hair")
    hair.add_curves([2] * 60)
    places = [c for i in range(60) for z in (0.0, 0.5) for c in (0.01 * (i % 10), 0.01 * (i // 10), z)]
    hair.attributes["position"].data.foreach_set("vector", places)
    tuft = bpy.data.objects.new("Hair", hair)
    scene.collection.objects.link(tuft)
    moves(tuft, (0.0, -1.5, 0.0), (0.8, -1.0, 0.0))
    moves(next(one for one in scene.objects if one.type == "LIGHT"), (0.0, 0.0, 5.0), (2.0, -2.0, 5.0))
    for number in range(2):
        bpy.ops.object.camera_add(location=(number - 0.5, -6.0, 1.6), rotation=(1.5, 0.0, 0.0))
        camera = bpy.context.object
        moves(camera, camera.location, (camera.location[0] * 2, -4.5, 1.6))
        for frame in range(1 + 10 * number, 1001, 20):
            scene.timeline_markers.new(f"{number}", frame=frame).camera = camera
    scene.camera = camera
    return scene


def moves(thing, start, end) -> None:
    """To and fro by its place, a hundred frames each way."""
    for frame in range(1, 1002, 100):
        thing.location = start if frame // 100 % 2 == 0 else end
        thing.keyframe_insert("location", frame=frame)


def frames(count: int, engine: str, say=print) -> list[dict]:
    """A row for each frame of `film`. RuntimeError for pixels that are not finite."""
    import bpy

    from addon.frame import ledger

    scene = film()
    scene.render.engine, scene.candela.samples = engine, 1
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 48, 36, 100
    rows = []
    for number in range(count):
        scene.frame_set(number + 1)
        bpy.ops.render.render(scene=scene.name)
        if engine == "CANDELA" and ledger.latest().bad_pixels:
            raise RuntimeError(f"Frame {number + 1} has {ledger.latest().bad_pixels} pixels that are not finite.")
        gc.collect()
        rows.append({"scene": number, "bytes": resident_bytes(), **kept()})
        if number % 25 == 24:
            say(line(rows[-1]))
    return rows


def line(row: dict) -> str:
    return (
        f"{row['scene'] + 1:4d} pictures: {row['bytes'] / 2**20:6.0f} MiB, {row['programs']} programs of"
        f" {row['compiled']} compiled, pool {row['pool'] / 2**20:.1f} MiB, {row['sessions']} sessions"
    )


def slope(rows: list[dict]) -> float:
    """Bytes per scene in the second half."""
    half = rows[len(rows) // 2 :]
    return float(np.polyfit([row["scene"] for row in half], [row["bytes"] for row in half], 1)[0])


def command(options: argparse.Namespace) -> int:
    import addon
    from addon.cli.terminal import quiet
    from bench.markdown import write_whole

    addon.register()
    options.results.parent.mkdir(parents=True, exist_ok=True)
    with quiet() as terminal:
        made, number = (frames, options.film) if options.film else (measure, options.scenes)
        rows = made(number, options.engine, lambda text: print(text, file=terminal, flush=True))
    found = {"engine": options.engine, "slope": slope(rows), "rows": rows}
    write_whole(options.results, json.dumps(found, indent=1) + "\n")
    half = rows[len(rows) // 2]
    print(
        f"{options.engine}: {half['bytes'] / 2**20:.0f} MiB after {half['scene'] + 1} pictures,"
        f" {rows[-1]['bytes'] / 2**20:.0f} after {len(rows)}: {found['slope'] / 2**20:+.2f} MiB a picture."
    )
    return 0
