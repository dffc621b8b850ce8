"""What the first picture costs before anything is compiled, by program: `python -m bench compiling`.

Each scene is rendered with one sample in a process of its own, without the driver's cache (Mesa's; other drivers keep
theirs). A program's seconds are processor time of all threads, to compile it and to draw with it for the first time:
software drivers translate most of a program then. So a second picture of the same size, which
compiles nothing, stands beside the first.

Targets: 3 s for a Cornell box, 6 for a window, metals or skin, 15 for anything (processor seconds, first less second).
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from bench.beside import ROOT, scenes_of
from bench.markdown import table
from bench.quick import size_of

USUAL = ("cornell_box", "window_interior", "metals", "skin", "glass", "haze", "caustics_table", "soft_shadow_garden")
NAMED = 6  # programs of a scene that are told by name
ANSWER = "compiled "
# In a process of its own: the driver's cache is chosen when the process begins.
RENDERED = f"""
import json, sys, time
sys.path.insert(0, ".")
import bpy, addon
from addon.gfx import images, library
addon.register()
spent, running = {{}}, []

def ended():
    if running:
        name, began = running.pop()
        images.finish()
        spent[name] = spent.get(name, 0.0) + time.process_time() - began

compiled, bound = library._compile, library.Shader.bind
fresh = {{}}

def compiling(program):
    ended()
    began = time.process_time()
    made = compiled(program)
    spent[program.name] = spent.get(program.name, 0.0) + time.process_time() - began
    fresh[id(made)] = program.name
    return made

def binding(self, *given, **named):
    ended()
    name = fresh.pop(id(self.handle), None)
    if name is not None:
        images.finish()
        running.append((name, time.process_time()))
    return bound(self, *given, **named)

library._compile, library.Shader.bind = compiling, binding
bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
scene = bpy.context.scene
scene.render.engine, scene.candela.samples = "CANDELA", 1
scene.render.resolution_x, scene.render.resolution_y = int(sys.argv[2]), int(sys.argv[3])
scene.render.resolution_percentage = 100
taken = []
for seed in (1, 2):
    scene.candela.seed = seed
    began = time.process_time()
    bpy.ops.render.render(scene=scene.name)
    ended()
    taken.append(time.process_time() - began)
print("{ANSWER}" + json.dumps([*taken, spent]), flush=True)
"""


def measured(scene: Path, size: tuple[int, int]) -> tuple[float, float, dict[str, float]]:
    """Processor seconds of the first and of the second picture, and those of each program. RuntimeError if the process
    gives no answer."""
    with tempfile.TemporaryDirectory() as folder:
        empty = {"MESA_SHADER_CACHE_DIR": folder, "MESA_SHADER_CACHE_DISABLE": "true"}
        asked = [sys.executable, "-c", RENDERED, str(scene), *map(str, size)]
        found = subprocess.Popen(
            asked, cwd=ROOT, env={**os.environ, **empty}, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        try:
            for line in found.stdout:
                if line.startswith(ANSWER):
                    first, second, programs = json.loads(line[len(ANSWER) :])
                    return first, second, programs
        finally:
            found.kill()  # its own exit handlers may wait for ever
            found.wait()
    raise RuntimeError(f"{scene.stem}: the process that renders it ended without an answer.")


def row(scene: str, first: float, second: float, programs: dict[str, float]) -> tuple[str, ...]:
    dearest = sorted(programs.items(), key=lambda one: -one[1])[:NAMED]
    told = ", ".join(f"{name} {seconds:.1f}" for name, seconds in dearest)
    return scene, f"{first:.1f}", f"{second:.1f}", f"{first - second:.1f}", str(len(programs)), told


HEAD = ("scene", "first, s of processor", "second", "difference", "programs", "of them, to compile and draw once")

# ------------------------------------------------------------------------------------------------------------- command


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--only", nargs="+", default=USUAL, metavar="NAME", help="scenes, as of `bench beside`")
    parser.add_argument("--size", default=(256, 192), type=size_of, metavar="WxH", help="default 256x192")


def command(options: argparse.Namespace) -> int:
    import addon
    from addon.cli.terminal import quiet

    addon.register()
    rows = []
    with quiet() as terminal:
        for scene in scenes_of(list(options.only)):
            try:
                rows.append(row(scene.stem, *measured(scene, options.size)))
            except RuntimeError as error:
                print(error, file=terminal, flush=True)
                continue
            print(*rows[-1], sep=", ", file=terminal, flush=True)
    print(table([HEAD, *rows]))
    return 0
