"""Runs inside a windowed Blender: what artists do while the viewport renders. Nothing may fail or be left over."""

import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))

from stage import (
    ENGINE,
    picture,
    render,
    resident_mib,
    result,
    run,
    there,
    viewport_area,
    viewports,
    wait_for_rest,
    window,
)

SAMPLES = 2
SAMPLE_BLENDS = Path(bpy.data.filepath).parent
result["done"] = []


def done(what):
    result["done"].append(what)


def show():
    """Candela in the viewport of the file that is open now."""
    scene = window().scene
    scene.render.engine = ENGINE
    scene.candela.viewport_samples = SAMPLES
    scene.candela.bounces = 0  # indirect light takes its time without a GPU
    space = viewport_area().spaces.active
    space.region_3d.view_perspective = "CAMERA"
    space.shading.type = "RENDERED"


def steps():
    show()
    yield from wait_for_rest()
    yield from edits()
    yield from switches()
    yield from render_meanwhile()
    yield from more_viewports()
    yield from other_files()


def edits():
    with there():
        bpy.ops.object.select_all(action="DESELECT")
    moved = next(one for one in window().scene.objects if one.type == "MESH" and one.name == "Knot")
    moved.select_set(True)
    window().view_layer.objects.active = moved
    with there():
        bpy.ops.ed.undo_push(message="before")
        bpy.ops.transform.translate(value=(0, 0, 1.5))
        bpy.ops.ed.undo_push(message="moved")
    yield from wait_for_rest()
    picture("moved.png")
    with there():
        bpy.ops.ed.undo()
    yield from wait_for_rest()
    picture("undone.png")
    done("move and undo")
    next(one for one in window().scene.objects if one.type == "LIGHT").data.color = (1.0, 0.1, 0.1)
    yield from wait_for_rest()
    done("light")
    with there():
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.transform.translate(value=(0, 0, 0.5))
    yield from wait_for_rest()
    with there():
        bpy.ops.object.mode_set(mode="OBJECT")
    yield from wait_for_rest()
    done("edit mode")
    with there():
        bpy.ops.view3d.localview()
    yield from wait_for_rest()
    picture("local_view.png")
    with there():
        bpy.ops.view3d.localview()
    viewport_area().spaces.active.region_3d.view_perspective = "ORTHO"
    yield from wait_for_rest()
    picture("orthographic.png")
    viewport_area().spaces.active.region_3d.view_perspective = "CAMERA"
    done("views")
    for frame in range(2, 6):
        window().scene.frame_set(frame)
        yield 0.2
    yield from wait_for_rest()
    done("frames")


def switches():
    for engine in ("BLENDER_WORKBENCH", ENGINE, "CYCLES", ENGINE):
        window().scene.render.engine = engine
        yield 1.0
    yield from wait_for_rest()
    done("engines")
    space = viewport_area().spaces.active
    before = resident_mib()
    space.shading.type = "SOLID"
    yield 3.0
    result["viewports_while_solid"] = len(viewports())
    result["freed_mib"] = before - resident_mib()
    space.shading.type = "RENDERED"
    yield from wait_for_rest()
    done("shading")


def render_meanwhile():
    scene = window().scene
    scene.render.resolution_percentage = 25
    scene.candela.samples = 8
    scene.candela.viewport_samples = 64
    region = viewport_area().spaces.active.region_3d

    def turn():
        region.view_camera_zoom += 0.5

    result["render_meanwhile"] = yield from render(turn)
    scene.candela.viewport_samples = SAMPLES
    yield from wait_for_rest()
    done("render")


def more_viewports():
    with there():
        bpy.ops.screen.area_split(direction="VERTICAL", factor=0.5)
    yield 0.5
    for area in window().screen.areas:
        if area.type == "VIEW_3D":
            area.spaces.active.shading.type = "RENDERED"
    yield 0.5
    yield from wait_for_rest()
    result["viewports_after_split"] = len(viewports())
    picture("two_viewports.png")
    with there():
        bpy.ops.screen.area_dupli("INVOKE_DEFAULT")
    yield 3.0
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[-1]):
        bpy.ops.wm.window_close()
    yield 3.0
    done("window")


def other_files():
    window().scene.candela.viewport_samples = 64
    yield 0.5
    for name in ("cornell_box", "alpha_foliage", "cornell_box"):
        bpy.ops.wm.open_mainfile(filepath=str(SAMPLE_BLENDS / f"{name}.blend"))
        yield 1.0
        show()
        yield 0.5
    yield from wait_for_rest()
    result["viewports_after_load"] = len(viewports())
    picture("loaded.png")
    bpy.ops.wm.read_homefile()
    yield 2.0
    result["viewports_at_home"] = len(viewports())
    done("files")


run(steps)
