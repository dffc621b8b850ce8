"""Runs inside a windowed Blender: what artists do while the viewport renders. Nothing may fail or be left over."""

import itertools
import shutil
import subprocess
import sys
import time
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))

import memory
from stage import (
    ENGINE,
    candela,
    picture,
    render,
    result,
    run,
    there,
    viewport_area,
    viewports,
    wait_for_rest,
    window,
)

SAMPLES = 2
CANCEL_AFTER_S = 4.0
CYCLES = 4  # from rendered to solid shading and back
SAMPLE_BLENDS = Path(bpy.data.filepath).parent
result["done"] = []


def done(what):
    result["done"].append(what)
    print(f"walk: {what}", flush=True)


def show():
    """Candela in the viewport of the file that is open now."""
    scene = window().scene
    scene.render.engine = ENGINE
    scene.candela.accumulated_maps_by = "MAPS"  # memory that is seen to come and go: rays need a sixth of it
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
    yield from two_scenes()
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
    before = memory.now()
    space.shading.type = "SOLID"
    yield 3.0
    result["viewports_while_solid"] = len(viewports())
    after = memory.now()
    result["freed"] = {name: before[name] - after[name] for name in before}
    result["images_while_solid"] = after["images"]
    # The driver keeps some of what is freed for later, now and then all of it, but never more each time.
    result["taken_again"], result["freed_again"] = [], []
    for _ in range(CYCLES):
        before = memory.now()
        space.shading.type = "RENDERED"
        yield from wait_for_rest()
        again = memory.now()
        space.shading.type = "SOLID"
        yield 3.0
        last = memory.now()
        result["taken_again"].append({name: again[name] - before[name] for name in again})
        result["freed_again"].append({name: again[name] - last[name] for name in again})
    result["kept"] = {name: last[name] - after[name] for name in last}
    space.shading.type = "RENDERED"
    yield from wait_for_rest()
    done("shading")


def render_meanwhile():
    """F12 while the viewport turns, then while it rests, and Esc: the times between two steps of this script tell.

    With EEVEE, which holds a GPU context, all of Blender waits for the end of a render when a viewport is drawn.
    """
    scene = window().scene
    scene.render.resolution_percentage = 25
    scene.candela.samples = 8
    scene.candela.viewport_samples = 64
    region = viewport_area().spaces.active.region_3d

    def turn():
        region.view_camera_zoom += 0.5

    result["render_meanwhile"] = yield from render(turn)
    print("walk: render while the view turns", flush=True)
    scene.candela.viewport_samples = SAMPLES
    yield from wait_for_rest()
    answers = []
    scene.candela.samples, scene.candela.seed = 16, 1
    yield from wait_for_rest()
    started = time.monotonic()
    result["render_at_rest"] = yield from render(lambda: answers.append(time.monotonic()))
    pauses = sorted(after - before for before, after in itertools.pairwise(answers))
    result["answers"] = {"s": time.monotonic() - started, "count": len(answers), "longest_s": pauses[-1]}
    print("walk: render at rest", flush=True)
    yield from cancelled_render(scene)
    done("render")


def cancelled_render(scene):
    """By a key of the keyboard: Blender looks for Esc where events come in, which simulated ones do not pass."""
    if shutil.which("xdotool") is None:
        return
    scene.candela.samples = 10000
    yield from wait_for_rest()
    area = next(one for one in window().screen.areas if one.type == "PROPERTIES")
    place = str(area.x + area.width // 2), str(window().height - area.y - area.height // 2)
    subprocess.run(["xdotool", "mousemove", *place], check=True)
    pressed = [time.monotonic()]  # after the start: not yet

    def escape():
        """Again after a while: a render that an event has missed would keep all that follows from being tried."""
        if time.monotonic() - pressed[-1] > CANCEL_AFTER_S * len(pressed):
            pressed.append(time.monotonic())
            subprocess.run(["xdotool", "key", "Escape"], check=True)

    result["escaped"] = yield from render(escape)
    result["escape_s"] = time.monotonic() - pressed[1]
    print(f"walk: Esc pressed {len(pressed) - 1} times, {result['escape_s']:.1f} s", flush=True)
    scene.candela.samples = 8
    yield from wait_for_rest()


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


def two_scenes():
    """Each window shows a scene of its own; a change of one leaves the other at rest."""
    bpy.ops.wm.window_new_main()
    other = bpy.context.window_manager.windows[-1]
    other.scene = copy = window().scene.copy()
    area = max((one for one in other.screen.areas if one.type == "VIEW_3D"), key=lambda one: one.width * one.height)
    area.spaces.active.shading.type = "RENDERED"
    yield 1.0
    yield from wait_for_rest()
    shown = {scene: viewport.frame for (_, scene), viewport in candela()._viewports.items()}
    result["scenes_shown"] = len(shown)
    copy.candela.seed += 1
    copy.candela.viewport_samples = 64
    yield 0.5
    later = {scene: viewport.frame for (_, scene), viewport in candela()._viewports.items()}
    result["scenes_drawn_anew"] = [
        window().scene.session_uid != scene for scene in shown if later[scene] is not shown[scene]
    ]
    with bpy.context.temp_override(window=other):  # while it refines
        bpy.ops.wm.window_close()
    yield 2.0
    bpy.data.scenes.remove(copy)
    yield from wait_for_rest()
    result["viewports_after_window"] = len(viewports())
    done("scenes")


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
