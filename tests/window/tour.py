"""Runs inside a windowed Blender: what a new user tries, one picture for each step.

A sample is opened and rendered by Candela; a light is moved, a material changed, a shadow technique chosen; then the
picture is compared with Cycles in the Image Editor, and the scene loses its camera and its light.
"""

import sys
import time
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))

from stage import ENGINE, main_region, picture, result, run, there, viewports, wait_for_rest, window

JOB_TIMEOUT_S = 400
jobs = sys.modules[next(name for name in sys.modules if name.endswith("candela.addon.ui.jobs"))]
editor = sys.modules[next(name for name in sys.modules if name.endswith("candela.addon.ui.compare_editor"))]


def steps():
    scene = window().scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 320, 180, 100
    left, right = yield from two_areas()
    yield 1.0
    picture("tour_opened.png")
    right.spaces.active.context = "RENDER"
    scene.render.engine = ENGINE
    scene.candela.viewport_samples = 4
    left.spaces.active.region_3d.view_perspective = "CAMERA"
    left.spaces.active.shading.type = "RENDERED"
    yield from wait_for_rest()
    picture("tour_engine.png")
    yield from popovers(left, right)
    bounces, scene.candela.bounces = scene.candela.bounces, 0  # indirect light takes its time without a GPU
    yield from edits(left, right, scene)
    yield from shadow(right, scene)
    scene.candela.bounces = bounces
    yield from comparison(left)
    yield from mistakes(left, scene)


def two_areas():
    with there():
        bpy.ops.screen.area_split(direction="VERTICAL", factor=0.6)
    yield 0.5
    left, right = sorted((a for a in window().screen.areas if a.type == "VIEW_3D"), key=lambda a: a.x)
    right.type = "PROPERTIES"
    return left, right


def popovers(left, right):
    """What opens from a header: the menu Render Pass of the view, and the quality presets of the render settings."""
    for area, panel, x, name in (
        (left, "VIEW3D_PT_shading", left.x + left.width - 40, "passes"),
        (right, "CANDELA_PT_quality_presets", right.x + right.width - 120, "presets"),
    ):
        y = area.y + area.height - 40
        window().event_simulate(type="MOUSEMOVE", value="NOTHING", x=x, y=y)
        yield 0.3
        with there(area):
            bpy.ops.wm.call_panel(name=panel, keep_open=True)
        yield 1.0
        picture(f"tour_{name}.png")
        for value in ("PRESS", "RELEASE"):
            window().event_simulate(type="ESC", value=value, x=x, y=y)
        yield 0.5


def edits(left, right, scene):
    light = next(one for one in scene.objects if one.type == "LIGHT" and one.data.type == "AREA")
    with there(left):
        bpy.ops.object.select_all(action="DESELECT")
    light.select_set(True)
    window().view_layer.objects.active = light
    yield 0.3
    right.spaces.active.context = "DATA"
    with there(left):
        bpy.ops.transform.translate(value=(-3.0, 0.0, 0.5))
    yield from wait_for_rest()
    picture("tour_light.png")
    mesh = next(one for one in scene.objects if one.name == "Knot")
    window().view_layer.objects.active = mesh
    yield 0.3
    right.spaces.active.context = "MATERIAL"
    shader = next(one for one in mesh.active_material.node_tree.nodes if one.type.startswith("BSDF"))
    shader.inputs[0].default_value = (0.1, 0.3, 0.8, 1.0)
    yield from wait_for_rest()
    picture("tour_material.png")


def shadow(right, scene):
    right.spaces.active.context = "RENDER"
    scene.candela.slot_shadow = "vssm"
    yield from wait_for_rest()
    picture("tour_shadow.png")


def comparison(left):
    """In place of the viewport, as a user would do it: the sidebar's Candela tab, its button, a path, and the swap."""
    bpy.context.preferences.system.use_region_overlap = False  # the sidebar stands beside the picture
    left.type = "IMAGE_EDITOR"
    left.spaces.active.show_region_ui = True
    options = bpy.context.window_manager.candela_comparison
    options.samples, options.reference_samples, options.percentage = 8, 32, 100
    yield 0.5
    next(region for region in left.regions if region.type == "UI").active_panel_category = "Candela"
    yield 0.5
    picture("tour_before_comparison.png")
    started = time.monotonic()
    with there(left):
        result["compare"] = list(bpy.ops.candela.compare("INVOKE_DEFAULT"))
    shown = False
    while jobs.Job.running is not None:
        if time.monotonic() - started > JOB_TIMEOUT_S:
            raise TimeoutError("the comparison does not end")
        yield 0.5
        if not shown and time.monotonic() - started > 4.0 and jobs.Job.running is not None:
            shown = True
            picture("tour_comparing.png")
    result["compare_s"] = time.monotonic() - started
    result["paths"] = [row.row.label for row in editor.latest()]
    with bpy.context.temp_override(window=window(), area=left, region=main_region(left)):
        bpy.ops.image.view_all(fit_view=True)
    yield 0.5
    picture("tour_compared.png")
    with there(left):
        result["swap"] = list(bpy.ops.candela.compare_swap())
    result["swapped"] = options.view
    yield 0.5
    picture("tour_cycles.png")
    options.view = "ERROR"
    yield 0.5
    picture("tour_error.png")
    with there(left):
        bpy.ops.candela.compare("INVOKE_DEFAULT")
    yield 0.2
    result["running_before_esc"] = jobs.Job.running is not None
    x, y = left.x + left.width // 2, left.y + left.height // 2
    window().event_simulate(type="ESC", value="PRESS", x=x, y=y)
    window().event_simulate(type="ESC", value="RELEASE", x=x, y=y)
    yield 1.0
    result["running_after_esc"] = jobs.Job.running is not None


def mistakes(left, scene):
    bpy.context.preferences.system.use_region_overlap = True
    left.type = "VIEW_3D"
    left.spaces.active.shading.type = "RENDERED"
    left.spaces.active.region_3d.view_perspective = "PERSP"
    for one in [one for one in scene.objects if one.type in ("CAMERA", "LIGHT")]:
        bpy.data.objects.remove(one)
    yield from wait_for_rest()
    picture("tour_dark.png")
    result["status"] = viewports()[0].status()


run(steps)
