"""Runs inside a windowed Blender: Tune in the render panel, and the dialog that applies what it proposes."""

import sys
import time
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))

from stage import ENGINE, main_region, picture, result, run, there, window

JOB_TIMEOUT_S = 300
jobs = sys.modules[next(name for name in sys.modules if name.endswith("candela.addon.ui.jobs"))]
tuning = sys.modules[next(name for name in sys.modules if name.endswith("candela.addon.ui.tuning"))]


def steps():
    scene = window().scene
    scene.render.engine = ENGINE
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 320, 180, 100
    scene.candela.samples = 1000
    scene.candela.bounces = 0  # indirect light takes its time without a GPU
    options = bpy.context.window_manager.candela_tuning
    options.milliseconds, options.percentage, options.budget, options.reference_samples = 500, 25, 20, 64
    opened(tuning.CANDELA_RENDER_PT_tune)
    with there():
        bpy.ops.screen.area_split(direction="VERTICAL", factor=0.6)
    yield 0.5
    area = max((one for one in window().screen.areas if one.type == "VIEW_3D"), key=lambda one: one.x)
    area.type = "PROPERTIES"
    area.spaces.active.context = "RENDER"
    yield 1.0
    result["properties"] = [area.x, window().height - area.y - area.height, area.width, area.height]
    properties = bpy.context.temp_override(window=window(), area=area, region=main_region(area))
    with properties:
        bpy.ops.candela.tune("INVOKE_DEFAULT")
    started, shown = time.monotonic(), False
    while jobs.Job.running is not None:
        if time.monotonic() - started > JOB_TIMEOUT_S:
            raise TimeoutError("Tune does not end")
        yield 0.2
        if not shown and jobs.Job.running is not None and jobs.Job.progress[0] > tuning.REFERENCE_SHARE:
            shown = True
            yield 0.5
            picture("tune_running.png")
    with properties:
        for _ in range(12):  # 40 pixels each
            bpy.ops.view2d.scroll_down()
    yield 1.0
    picture("tune_found.png")
    found = tuning.latest(scene)
    result["trials"] = len(found.trials)
    result["changes"] = tuning.changes(scene, found.best.candidate)
    x, y = area.x + area.width // 2, area.y + area.height // 2
    window().event_simulate(type="MOUSEMOVE", value="NOTHING", x=x, y=y)
    yield 0.3
    with properties:
        bpy.ops.candela.tune_apply("INVOKE_DEFAULT")
    yield 1.0
    picture("tune_apply.png")
    window().event_simulate(type="RET", value="PRESS", x=x, y=y)
    window().event_simulate(type="RET", value="RELEASE", x=x, y=y)
    yield 1.0
    result["samples"], result["proposed"] = scene.candela.samples, found.best.candidate.samples


def opened(panel):
    """As if its header had been clicked: panels that are closed at first have no other handle for scripts."""
    bpy.utils.unregister_class(panel)
    panel.bl_options = panel.bl_options - {"DEFAULT_CLOSED"}
    bpy.utils.register_class(panel)


run(steps)
