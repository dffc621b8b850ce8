"""What the scripts that run inside a windowed Blender share: waiting, rendering as F12 does, pictures of the window.

    blender FILE.blend --python SCRIPT.py -- FOLDER

A script's steps are a generator that runs in a timer, between the events of the window's own loop, as a person's do;
it yields the seconds to wait. `result.json` is written last and holds what came out.
"""

import json
import os
import shutil
import subprocess
import sys
import time
import traceback
from pathlib import Path

import bpy

FOLDER = Path(sys.argv[-1])
ENGINE = "CANDELA"
os.environ.setdefault("CANDELA_DEVICE", "software")  # what a machine measures chooses how shadows are found
RENDER_TIMEOUT_S, REST_TIMEOUT_S = 600, 600

result = {}


def run(steps):
    """Run the steps, write the result, and quit."""
    walk = steps()

    def tick():
        try:
            return next(walk)
        except StopIteration:
            pass
        except Exception:
            result["error"] = traceback.format_exc()
        (FOLDER / "result.json").write_text(json.dumps(result), encoding="utf-8")
        bpy.ops.wm.quit_blender()

    bpy.app.timers.register(tick, first_interval=2.0, persistent=True)


def window():
    return bpy.context.window_manager.windows[0]


def viewport_area():
    """The largest 3D viewport of the window."""
    found = [area for area in window().screen.areas if area.type == "VIEW_3D"]
    return max(found, key=lambda area: area.width * area.height)


def main_region(area):
    return next(region for region in area.regions if region.type == "WINDOW")


def there(area=None):
    """The context of a mouse over the viewport."""
    area = area or viewport_area()
    return bpy.context.temp_override(window=window(), area=area, region=main_region(area))


def candela():
    """The extension's viewport module, wherever Blender has installed it."""
    return next(module for name, module in sys.modules.items() if name.endswith("candela.addon.viewport"))


def library():
    """The extension's module of programs."""
    return next(module for name, module in sys.modules.items() if name.endswith("candela.addon.gfx.library"))


def viewports():
    return list(candela()._viewports.values())


def later(viewport):
    """Whether it will look at unsaved images once more, which older versions do not."""
    return getattr(viewport, "looks_later", False)


def wait_for_rest():
    """Until every viewport is complete; yields."""
    yield 0.3
    started = time.monotonic()
    while not (viewports() and all(one.done and not one.dirty and not later(one) for one in viewports())):
        if any(one.error for one in viewports()):
            break
        if time.monotonic() - started > REST_TIMEOUT_S:
            states = [(one.status(), one.done, one.dirty, later(one)) for one in viewports()]
            raise TimeoutError(f"the viewport never rests (status, done, dirty, looks later): {states}")
        yield 0.1
    for one in viewports():
        if one.error:
            raise RuntimeError(one.error)


def render(meanwhile=lambda: None):
    """The render job as the key starts it, in the background of the window; yields, then returns how it ended."""
    ended = []

    def completed(*_):
        ended.append("complete")

    def cancelled(*_):
        ended.append("cancelled")

    bpy.context.preferences.view.render_display_type = "NONE"
    bpy.app.handlers.render_complete.append(completed)
    bpy.app.handlers.render_cancel.append(cancelled)
    with bpy.context.temp_override(window=window()):
        bpy.ops.render.render("INVOKE_DEFAULT")
    started = time.monotonic()
    while not ended and time.monotonic() - started < RENDER_TIMEOUT_S:
        meanwhile()
        yield 0.1
    bpy.app.handlers.render_complete.remove(completed)
    bpy.app.handlers.render_cancel.remove(cancelled)
    yield 0.5
    return ended[0] if ended else "not finished"


def picture(name):
    """The window as a picture. Where the driver cannot read what it has shown (black), the X server is asked for it."""
    path = FOLDER / name
    with bpy.context.temp_override(window=window()):
        bpy.ops.screen.screenshot(filepath=str(path))
    image = bpy.data.images.load(str(path))
    black = not any(image.pixels[:][::388])  # red of every 97th pixel
    bpy.data.images.remove(image)
    if black and shutil.which("import"):  # ImageMagick's
        subprocess.run(["import", "-window", "root", str(path)], check=True)
