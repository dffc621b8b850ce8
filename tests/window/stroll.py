"""Runs inside a windowed Blender: a seeded random walk of edits, undo, views, modes, engines and renders.

    blender FILE.blend --python stroll.py -- SECONDS ENGINE [STEP ...] FOLDER

Each step is one thing that an artist may do at any time, without waiting for the viewport to be ready. With names of
steps the walk keeps to those. With one of Blender's own engines in place of Candela (BLENDER_EEVEE) it does the same
without any of Candela's code: what happens then too, is Blender's or the driver's.

Every LEG_S the file is opened anew and memory is noted when the viewport is at rest, so that all measurements are of
the same state: what an artist's edits add to a scene, and the steps that Blender keeps for undo, are gone by then.

What a button does Blender keeps for undo by itself; what a script does it does not, and an undo past a data-block that
no step knows of frees it under its users: Blender then crashes, with any engine. So every edit here ends with a step.
"""

import random
import sys
import time
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))

import memory
from stage import (
    ENGINE,
    FOLDER,
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

SECONDS, WALKED, *ONLY = sys.argv[sys.argv.index("--") + 1 : -1]
SECONDS = float(SECONDS)
SEED = 6
LEG_S = 20.0
CONTROL_REST_S = 3.0  # other engines do not tell when they rest
FILE = str(FOLDER / "walked.blend")
dice = random.Random(SEED)
result.update(steps={}, memory=[], seconds=SECONDS, engine=WALKED, seed=SEED)


def show():
    scene = window().scene
    scene.render.engine = WALKED
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 160, 90, 100
    scene.candela.samples = scene.candela.viewport_samples = 2
    scene.candela.bounces = 0
    scene.eevee.taa_samples = scene.eevee.taa_render_samples = 2
    scene.render.use_border = False  # a smaller picture takes less memory
    space = viewport_area().spaces.active
    space.region_3d.view_perspective = "CAMERA"
    space.shading.type = "RENDERED"


def one(kind):
    found = [thing for thing in window().scene.objects if thing.type == kind]
    return dice.choice(found) if found else None


def push(message):
    with there():
        bpy.ops.ed.undo_push(message=message)


def move_object():
    thing = dice.choice(list(window().scene.objects))
    thing.location.x += dice.uniform(-0.3, 0.3)
    push("move")


def change_light():
    light = one("LIGHT")
    if light is not None:
        light.data.energy *= dice.choice((0.5, 2.0))
        light.data.color = [dice.random() for _ in range(3)]
        push("light")


def change_material():
    thing = one("MESH")
    material = thing.active_material if thing is not None else None
    if material is not None and material.node_tree is not None:
        shader = next((node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED"), None)
        if shader is not None:
            shader.inputs["Roughness"].default_value = dice.random()
            push("material")


def add_object():
    with there():
        if bpy.context.mode == "OBJECT":
            bpy.ops.mesh.primitive_cube_add(size=0.4, location=(dice.uniform(-2, 2), dice.uniform(-2, 2), 1.0))
            push("add")


def delete_object():
    object_mode()  # as Blender's own operators do: it never frees a mesh whose object is removed while it is edited
    added = [thing for thing in window().scene.objects if thing.name.startswith("Cube")]
    if added:
        bpy.data.objects.remove(dice.choice(added))
        push("delete")


def undo():
    with there():
        if bpy.ops.ed.undo.poll():
            bpy.ops.ed.undo()


def redo():
    with there():
        if bpy.ops.ed.redo.poll():
            bpy.ops.ed.redo()


def object_mode():
    with there():
        if bpy.context.mode != "OBJECT":
            bpy.ops.object.mode_set(mode="OBJECT")
            push("mode")


def edit_mode():
    thing = one("MESH")
    with there():
        if bpy.context.mode != "OBJECT":
            object_mode()
        elif thing is not None and thing.name in window().view_layer.objects and thing.visible_get():
            window().view_layer.objects.active = thing
            bpy.ops.object.mode_set(mode="EDIT")
            push("mode")


def turn_view():
    region = viewport_area().spaces.active.region_3d
    region.view_perspective = dice.choice(("PERSP", "ORTHO", "CAMERA"))
    region.view_distance *= dice.uniform(0.8, 1.25)


def shading():
    workbench = window().scene.render.engine == "BLENDER_WORKBENCH"  # has no preview of materials
    kinds = ("SOLID", "RENDERED", "RENDERED") if workbench else ("SOLID", "RENDERED", "RENDERED", "MATERIAL")
    viewport_area().spaces.active.shading.type = dice.choice(kinds)


def engine():
    window().scene.render.engine = dice.choice(("BLENDER_WORKBENCH", WALKED, WALKED))
    push("engine")


def settings():
    candela = window().scene.candela
    candela.seed = dice.randrange(4)
    candela.viewport_samples = dice.choice((1, 2, 4))
    push("settings")


def frame():
    window().scene.frame_set(dice.randrange(1, 20))


def border():
    scene = window().scene
    scene.render.use_border = not scene.render.use_border
    scene.render.border_min_x, scene.render.border_max_x = 0.2, dice.uniform(0.3, 1.0)
    push("border")


def tree():
    candela = window().scene.candela
    if candela.pass_tree is not None:
        candela.pass_tree = None
    elif window().scene.camera is not None:
        with there():
            bpy.ops.candela.passes_from_auto(use=True)
    push("tree")


def run_tree():
    """Starts the job; what comes next, undo among it, comes while it runs."""
    tree = window().scene.candela.pass_tree
    if tree is not None and window().scene.camera is not None:
        tree.samples, tree.percentage = 2, 100
        push("samples")
        with there():
            if bpy.ops.candela.passes_run.poll():
                bpy.ops.candela.passes_run("INVOKE_DEFAULT")


STEPS = (
    *(move_object, change_light, change_material, add_object, delete_object, undo, undo, redo, edit_mode, turn_view),
    *(turn_view, shading, engine, settings, frame, border, tree, run_tree),
)
CANDELAS = (settings, tree, run_tree)
CHOSEN = [step for step in STEPS if (step.__name__ in ONLY or not ONLY) and (WALKED == ENGINE or step not in CANDELAS)]


def steps():
    show()
    bpy.ops.wm.save_as_mainfile(filepath=FILE)  # with the engine in it: undo goes back to what was opened
    yield from rest()
    started = measured = time.monotonic()
    while time.monotonic() - started < SECONDS:
        if dice.random() < 0.03:
            count("render")
            ended = yield from render()
            result.setdefault("renders", []).append(ended)
        else:
            step = dice.choice(CHOSEN)
            count(step.__name__)
            step()
        yield dice.choice((0.01, 0.05, 0.2, 0.5))
        if time.monotonic() - measured > LEG_S:
            bpy.ops.wm.open_mainfile(filepath=FILE)
            yield 0.5
            yield from rest()
            result["memory"].append({"s": time.monotonic() - started, **memory.now()})
            print(result["memory"][-1], flush=True)
            measured = time.monotonic()
    yield from rest()
    result["viewports"] = len(viewports())
    picture("strolled.png")


def rest():
    object_mode()
    show()
    push("rest")
    if WALKED == ENGINE:
        yield from wait_for_rest()
    else:
        yield CONTROL_REST_S


def count(name):
    result["steps"][name] = result["steps"].get(name, 0) + 1


run(steps)
