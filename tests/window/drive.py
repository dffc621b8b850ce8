"""Runs inside a windowed Blender: render as F12 does, show the viewport rendered, take pictures, quit.

    blender FILE.blend --python drive.py -- FOLDER ENGINE

FOLDER receives render.png, viewport_first.png, viewport_early.png, viewport_late.png and result.json, which is written
last and holds what Blender said on the way. Everything happens in a timer, between the events of the window's own
loop, as it does for a person.
"""

import json
import shutil
import subprocess
import sys
import time
import traceback
from pathlib import Path

import bpy

FOLDER, ENGINE = Path(sys.argv[-2]), sys.argv[-1]
RENDER_SIZE = (320, 180)
RENDER_TIMEOUT_S = 240
# When the pictures of the resting viewport are taken, in seconds after its first one. Three, because "refines" means
# that the second is nearer to the third than the first is.
EARLY_S, LATE_S = 3, 25

result = {"render": "not finished"}


def steps():
    """What is done, with the seconds to wait yielded in between."""
    yield 2.0  # the window opens and is drawn
    window = bpy.context.window_manager.windows[0]
    scene = window.scene
    scene.render.engine = ENGINE
    result["engine"] = scene.render.engine
    yield from render_as_f12(window, scene)
    yield from show_viewport(window)


def render_as_f12(window, scene):
    """The render job as the key starts it, in the background of the window; the picture is saved afterwards."""
    scene.render.resolution_x, scene.render.resolution_y = RENDER_SIZE
    scene.render.resolution_percentage = 100
    scene.render.image_settings.file_format = "PNG"
    scene.render.image_settings.color_mode = "RGB"
    bpy.context.preferences.view.render_display_type = "NONE"
    bpy.app.handlers.render_complete.append(lambda *_: result.update(render="complete"))
    bpy.app.handlers.render_cancel.append(lambda *_: result.update(render="cancelled"))
    with bpy.context.temp_override(window=window):
        bpy.ops.render.render("INVOKE_DEFAULT")
    started = time.monotonic()
    while result["render"] == "not finished" and time.monotonic() - started < RENDER_TIMEOUT_S:
        yield 0.25
    result["render_s"] = time.monotonic() - started
    yield 1.0
    bpy.data.images["Render Result"].save_render(str(FOLDER / "render.png"), scene=scene)


def show_viewport(window):
    """The camera's view in "Rendered" shading, at rest; the whole window is pictured three times."""
    area = max((area for area in window.screen.areas if area.type == "VIEW_3D"), key=lambda a: a.width * a.height)
    for other in window.screen.areas:
        if other.type == "PROPERTIES":
            other.spaces.active.context = "RENDER"
    space = area.spaces.active
    space.overlay.show_overlays = False
    space.region_3d.view_perspective = "CAMERA"
    space.shading.type = "RENDERED"
    region = next(region for region in area.regions if region.type == "WINDOW")
    # The y axis of regions points upwards, that of pictures downwards.
    result["viewport"] = [region.x, window.height - region.y - region.height, region.width, region.height]
    yield 0.5
    picture(window, "viewport_first.png")
    yield EARLY_S
    picture(window, "viewport_early.png")
    yield LATE_S - EARLY_S
    picture(window, "viewport_late.png")


def picture(window, name):
    """The window as a picture. Where the driver cannot read what it has shown (black), the X server is asked for it."""
    path = FOLDER / name
    with bpy.context.temp_override(window=window):
        bpy.ops.screen.screenshot(filepath=str(path))
    image = bpy.data.images.load(str(path))
    black = not any(image.pixels[:][::388])  # red of every 97th pixel
    bpy.data.images.remove(image)
    if black and shutil.which("import"):  # ImageMagick's
        subprocess.run(["import", "-window", "root", str(path)], check=True)


def finish():
    (FOLDER / "result.json").write_text(json.dumps(result), encoding="utf-8")
    bpy.ops.wm.quit_blender()


def tick(walk=None):
    walk = walk or tick.walk
    try:
        return next(walk)
    except StopIteration:
        finish()
    except Exception:
        result["error"] = traceback.format_exc()
        finish()
    return None


tick.walk = steps()
bpy.app.timers.register(tick, first_interval=0.5)
