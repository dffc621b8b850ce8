"""Runs inside a windowed Blender: a final render while a viewport is redrawn, seen as it grows, and ended by Esc.

How often this script's timer runs meanwhile, and the longest pause between two runs, tell whether Blender answers.
"""

import itertools
import shutil
import subprocess
import sys
import time
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))

from stage import ENGINE, picture, render, result, run, there, viewports, wait_for_rest, window

ESC_AFTER_S, REDRAW_S = 3.0, 0.5


def steps():
    scene = window().scene
    scene.render.engine = ENGINE
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 256, 192, 100
    scene.candela.bounces, scene.candela.viewport_samples, scene.candela.samples = 0, 1, 24
    with there():
        bpy.ops.screen.area_split(direction="VERTICAL", factor=0.4)
    yield 0.5
    left, right = sorted((a for a in window().screen.areas if a.type == "VIEW_3D"), key=lambda a: a.x)
    right.type = "IMAGE_EDITOR"
    result["image"] = [right.x, window().height - right.y - right.height, right.width, right.height]
    left.spaces.active.region_3d.view_perspective = "CAMERA"
    left.spaces.active.shading.type = "RENDERED"
    yield from wait_for_rest()
    yield from seen_while_it_grows(left, right)
    yield from ended_by_a_key(left, right)
    yield from pause(left)
    result["render_by_script"] = list(bpy.ops.render.render())  # in the main loop itself, which waits
    yield from wait_for_rest()


def seen_while_it_grows(left, right):
    ticks, shots, stats = [], 0, []
    redrawn = [time.monotonic()]

    def meanwhile():
        ticks.append(time.monotonic())
        if ticks[-1] - redrawn[0] > REDRAW_S:
            redrawn[0] = ticks[-1]
            left.tag_redraw()  # with an engine that holds a GPU context, Blender would wait for its end here
        if "Render Result" in bpy.data.images and right.spaces.active.image is None:
            right.spaces.active.image = bpy.data.images["Render Result"]

    bpy.app.handlers.render_stats.append(lambda text, *_: stats.append(str(text)))
    walk = render(meanwhile)
    while True:
        try:
            wait = next(walk)
        except StopIteration as end:
            result["render"] = end.value
            break
        if shots < 3 and len(ticks) > 12 * (shots + 1):
            shots += 1
            picture(f"growing_{shots}.png")
        yield wait
    bpy.app.handlers.render_stats.clear()
    yield 0.5
    picture("grown.png")
    pauses = [after - before for before, after in itertools.pairwise(ticks)]
    result["answers"] = {"count": len(ticks), "s": ticks[-1] - ticks[0], "longest_s": max(pauses)}
    result["stats"] = [text.split("|")[-1].strip() for text in dict.fromkeys(stats)]


def ended_by_a_key(left, right):
    """By a key of the keyboard: Blender looks for Esc where events come in, which simulated ones do not pass."""
    if shutil.which("xdotool") is None:
        return
    scene = window().scene
    scene.candela.samples, scene.candela.seed = 10000, 2
    yield from wait_for_rest()
    place = str(right.x + right.width // 2), str(window().height - right.y - right.height // 2)
    subprocess.run(["xdotool", "mousemove", *place], check=True)
    started, pressed = time.monotonic(), []

    def escape():
        if not pressed and time.monotonic() - started > ESC_AFTER_S:
            pressed.append(time.monotonic())
            subprocess.run(["xdotool", "key", "Escape"], check=True)

    ended = []
    bpy.app.handlers.render_cancel.append(lambda *_: ended.append(time.monotonic()))
    result["escaped"] = yield from render(escape)
    result["escape_s"] = ended[0] - pressed[0]
    bpy.app.handlers.render_cancel.clear()
    picture("escaped.png")
    scene.candela.samples = 2
    result["render_after_escape"] = yield from render()


def pause(left):
    """The viewport's picture stays as it is, though its scene changes, until the button is pressed again."""
    scene = window().scene
    yield from wait_for_rest()
    scene.candela.viewport_pause = True
    yield 0.5
    drawn = viewports()[0].frame
    scene.candela.seed = 7
    yield 1.5
    result["paused"] = [viewports()[0].frame is drawn, viewports()[0].status(), viewports()[0].done]
    scene.candela.viewport_pause = False
    yield 0.5
    yield from wait_for_rest()
    result["went_on"] = viewports()[0].frame.settings.seed == 7


run(steps)
