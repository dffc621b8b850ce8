"""What the first picture costs before anything is compiled, by program: `python -m bench compiling`.

Each scene is rendered with one sample in a process of its own, without the driver's cache (Mesa's; other drivers keep
theirs). A program's seconds are processor time of all threads, to compile it and to draw with it for the first time:
software drivers translate most of a program then. So a second picture of the same size, which
compiles nothing, stands beside the first.

With `--redraws` a viewport without a window shows each scene, as Blender's redraws would drive it, until it rests with
one sample: told are the redraws that take longest and the programs in them. No redraw is to take above a second.

Targets: 3 s for a Cornell box, 6 for a window, metals or skin, 15 for anything (processor seconds, first less second).
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

from bench.beside import ROOT, scenes_of
from bench.markdown import table
from bench.quick import size_of

USUAL = ("cornell_box", "window_interior", "metals", "skin", "glass", "haze", "caustics_table", "soft_shadow_garden")
LONG = 1.0  # s of the processor, which no redraw should take
TOLD = 3  # redraws of a scene
NAMED = 6  # programs of a scene that are told by name
ANSWER = "compiled "
LIMIT_S = 1800.0  # after which a process that has not answered is ended
# In a process of its own: the driver's cache is chosen when the process begins.
TIMED = """
import json, sys, time
sys.path.insert(0, ".")
import bpy, addon
from addon.gfx import images, library
addon.register()
spent, running = {}, []

def ended():
    if running:
        name, began = running.pop()
        images.finish()
        spent[name] = spent.get(name, 0.0) + time.process_time() - began

compiled, bound = library._compile, library.Shader.bind
fresh = {}

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
scene.render.engine, scene.candela.samples, scene.candela.viewport_samples = "CANDELA", 1, 1
scene.render.resolution_x, scene.render.resolution_y = int(sys.argv[2]), int(sys.argv[3])
scene.render.resolution_percentage = 100
"""
RENDERED = f"""{TIMED}
taken = []
for seed in (1, 2):
    scene.candela.seed = seed
    began = time.process_time()
    bpy.ops.render.render(scene=scene.name)
    ended()
    taken.append(time.process_time() - began)
print("{ANSWER}" + json.dumps([*taken, spent]), flush=True)
"""
# [[seconds, whether it is of a draft, {program: seconds}]] of each redraw.
REDRAWN = f"""{TIMED}
from addon.snapshot import camera_of_scene, take
from addon.ui.properties import settings_of
from addon.viewport import Viewport
shown, redraws = Viewport(), []
graph = bpy.context.evaluated_depsgraph_get()
size = int(sys.argv[2]), int(sys.argv[3])
camera = camera_of_scene(scene, graph, *size)
settings = settings_of(scene, viewport=True, depsgraph=graph)
source = lambda camera, width, height: take(graph, shown.cache, width, height, view=camera)
while not redraws or not shown.done:
    known, began = dict(spent), time.process_time()
    shown.draw_frame(source, camera, size, settings)
    ended()
    images.finish()
    new = {{name: spent[name] - known.get(name, 0.0) for name in spent if spent[name] != known.get(name)}}
    redraws.append([time.process_time() - began, shown.scale > 1, new])
print("{ANSWER}" + json.dumps(redraws), flush=True)
"""


def measured(script: str, scene: Path, size: tuple[int, int], limit_s: float = LIMIT_S) -> list:
    """What a script answers of a scene, in a process of its own without the driver's cache. RuntimeError if it gives no
    answer in time."""
    with tempfile.TemporaryDirectory() as folder:
        empty = {"MESA_SHADER_CACHE_DIR": folder, "MESA_SHADER_CACHE_DISABLE": "true"}
        asked = [sys.executable, "-c", script, str(scene), *map(str, size)]
        found = subprocess.Popen(
            asked, cwd=ROOT, env={**os.environ, **empty}, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        late = threading.Timer(limit_s, found.kill)  # which ends what is read below
        late.start()
        try:
            for line in found.stdout:
                if line.startswith(ANSWER):
                    return json.loads(line[len(ANSWER) :])
        finally:
            late.cancel()
            found.kill()  # its own exit handlers may wait for ever
            found.wait()
    raise RuntimeError(f"{scene.stem}: the process that draws it gave no answer, or none within {limit_s:g} s.")


def row(scene: str, first: float, second: float, programs: dict[str, float]) -> tuple[str, ...]:
    """Of processor seconds of the first and of the second picture, and of each program."""
    return scene, f"{first:.1f}", f"{second:.1f}", f"{first - second:.1f}", str(len(programs)), dearest(programs)


def dearest(programs: dict[str, float], digits: int = 1) -> str:
    found = sorted(programs.items(), key=lambda one: -one[1])[:NAMED]
    return ", ".join(f"{name} {seconds:.{digits}f}" for name, seconds in found)


def rows_of_redraws(scene: str, *redraws: tuple[float, bool, dict[str, float]]) -> list[tuple[str, ...]]:
    """The longest redraws of drafts and of the picture in full: of processor seconds, whether of a draft, programs."""
    rows = []
    for draft, name in ((True, "drafts"), (False, "in full")):
        own = sorted((one for one in redraws if one[1] == draft), key=lambda one: -one[0])
        long = sum(seconds > LONG for seconds, _, _ in own)
        for seconds, _, programs in own[:TOLD]:
            rows.append((scene, name, str(len(own)), str(long), f"{seconds:.2f}", dearest(programs, 2)))
    return rows


REDRAWS_HEAD = ("scene", "of", "redraws", f"above {LONG:g} s", "longest, s of processor", "programs in it")
HEAD = ("scene", "first, s of processor", "second", "difference", "programs", "of them, to compile and draw once")

# ------------------------------------------------------------------------------------------------------------- command


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--only", nargs="+", default=USUAL, metavar="NAME", help="scenes, as of `bench beside`")
    parser.add_argument("--size", default=(256, 192), type=size_of, metavar="WxH", help="default 256x192")
    parser.add_argument("--redraws", action="store_true", help="of a viewport, the longest, in place of pictures")


def command(options: argparse.Namespace) -> int:
    import addon
    from addon.cli.terminal import quiet

    addon.register()
    head, script = (REDRAWS_HEAD, REDRAWN) if options.redraws else (HEAD, RENDERED)
    rows = [head]
    with quiet() as terminal:
        for scene in scenes_of(list(options.only)):
            try:
                found = measured(script, scene, options.size)
            except RuntimeError as error:
                print(error, file=terminal, flush=True)
                continue
            new = rows_of_redraws(scene.stem, *found) if options.redraws else [row(scene.stem, *found)]
            for one in new:
                print(*one, sep=", ", file=terminal, flush=True)
            rows += new
    print(table(rows))
    return 0
