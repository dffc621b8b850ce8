"""Memory of a long session: `python -m bench memory`, the process's size over many different scenes.

Small scenes, each in a file of its own and with materials of a shape that no other has, are rendered with one sample,
in sizes that differ, one after the other in this process: what a day of look development or a test run does. After each
the resident size is read, and what is kept counted: compiled programs, bytes of the image pool, sessions. A process
that keeps only what it may use again stays flat once it is full. The slope is that of the second half, by least
squares. A software driver takes some 10 MiB for a program, in the process itself; a GPU's driver far less.
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
        "pool": images.pool.allocated_bytes,
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


def line(row: dict) -> str:
    return (
        f"{row['scene'] + 1:4d} scenes: {row['bytes'] / 2**20:6.0f} MiB, {row['programs']} programs of"
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
        rows = measure(options.scenes, options.engine, lambda text: print(text, file=terminal, flush=True))
    found = {"engine": options.engine, "slope": slope(rows), "rows": rows}
    write_whole(options.results, json.dumps(found, indent=1) + "\n")
    half = rows[len(rows) // 2]
    print(
        f"{options.engine}: {half['bytes'] / 2**20:.0f} MiB after {half['scene'] + 1} scenes,"
        f" {rows[-1]['bytes'] / 2**20:.0f} after {len(rows)}: {found['slope'] / 2**20:+.2f} MiB a scene."
    )
    return 0
