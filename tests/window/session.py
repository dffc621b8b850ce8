"""Runs inside a windowed Blender: one edit after the other, as an artist makes them, and undo of some. When the view
rests, its picture is compared with one that nothing was kept for: the same scene read anew by a viewport of its own.

    blender FILE.blend --python session.py -- [EDIT ...] FOLDER

What differs after an edit is stale, or was kept wrongly.
"""

import math
import sys
import time
import traceback
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from edits import EDITS, scene
from stage import (
    ENGINE,
    FOLDER,
    candela,
    main_region,
    result,
    run,
    there,
    viewport_area,
    viewports,
    wait_for_rest,
)

SAMPLES = 2
PIXEL = "8"  # of the screen, for one of the picture
PAUSE_S = 0.02
WHOLE = 50.0 * (2.0 - math.sqrt(2.0))  # Blender's zoom at which the camera's frame fills the region
SAME = 0.03  # of a value, between two pictures: rays search trees that were refitted, or are made anew
MOST_OTHER, MOST_MEAN = 0.02, 0.01  # of all blocks may differ by more, and the picture's mean by so much
before = []  # the picture before the last edit


def stage_scene():
    """Things with names, one of which moves with the frame, and one that hangs on a parent."""
    one = scene()
    one.render.engine = ENGINE
    one.render.preview_pixel_size = PIXEL
    one.candela.viewport_samples, one.candela.bounces = SAMPLES, 1
    one.frame_set(1)
    things = bpy.data.collections.new("Things")
    one.collection.children.link(things)

    def add(name, operator, location, **more):
        with there():
            getattr(bpy.ops.mesh, operator)(location=location, **more)
        made = bpy.context.object
        made.name = name
        material = bpy.data.materials.new(name)
        if not material.use_nodes:
            material.use_nodes = True
        made.data.materials.append(material)
        return made

    add("Subject", "primitive_uv_sphere_add", (0.4, -0.4, 0.5), radius=0.3, segments=16, ring_count=8)
    second = add("Second", "primitive_cube_add", (-0.4, -0.2, 0.3), size=0.4)
    add("Ground", "primitive_plane_add", (0.0, 0.0, 0.02), size=1.8)
    moving = add("Moving", "primitive_cone_add", (0.0, 0.0, 0.2), radius1=0.2, depth=0.4)
    for frame, x in ((1, -0.8), (20, 0.8)):
        moving.location.x = x
        moving.keyframe_insert("location", frame=frame)
    with there():
        bpy.ops.object.empty_add(location=(0.0, 0.0, 0.9))
    bpy.context.object.name = "Parent"
    second.parent = bpy.context.object
    second.matrix_parent_inverse = bpy.context.object.matrix_world.inverted()
    one.collection.objects.unlink(second)
    things.objects.link(second)
    space = viewport_area().spaces.active
    space.overlay.show_overlays = space.show_gizmo = False
    space.region_3d.view_perspective, space.region_3d.view_camera_zoom = "CAMERA", WHOLE
    space.shading.type = "RENDERED"


def held(viewport):
    """The images of a viewport's frame by name."""
    read, frame = candela().images.read, viewport.frame
    return {name: read(frame.held.to_show(name)) for name in frame.images}


def fresh():
    """The picture of the viewport as one that has kept nothing would show it, (H, W, 4), and the frame's images."""
    module, shown = candela(), viewports()[0]
    space = viewport_area().spaces.active
    other = module.Viewport()
    with there():
        depsgraph = bpy.context.evaluated_depsgraph_get()
        closes_eyes = module.closes_eyes(depsgraph.view_layer_eval.layer_collection)
        visible = (lambda one: one.visible_in_viewport_get(space)) if module.hidden_in(space, closes_eyes) else None

        def source(camera, width, height):
            return module.take(depsgraph, other.cache, width, height, view=camera, shown=visible)

        _, size, border, _, other.render_pass = shown._asked
        other.scale, other.pace, other.step, other.coarsest = shown.scale, shown.pace, shown.step, shown.coarsest
        region_data = viewport_area().spaces.active.region_3d
        camera = module.camera_of_view(
            region_data, space, scene().camera if region_data.view_perspective == "CAMERA" else None
        )
        settings = module.settings_of(depsgraph.scene, viewport=True, depsgraph=depsgraph)
        with module.images.passing_context():
            while not other.done:
                other.draw_frame(source, camera, size, settings, border=border)
            found = module.images.read(other.picture), held(other)
            other.release()
    return found


def blocks(picture):
    """Means of 4 x 4 pixels: single choices of indirect light may differ, by the last digit of what they weigh."""
    height, width = (extent // 4 * 4 for extent in picture.shape[:2])
    return picture[:height, :width].reshape(height // 4, 4, width // 4, 4, -1).mean(axis=(1, 3))


def compared(name):
    """Note how much the picture at rest differs from a fresh one."""
    module = candela()
    with module.images.passing_context():
        kept, kept_images = module.images.read(viewports()[0].picture), held(viewports()[0])
    anew, anew_images = fresh()
    if kept.shape != anew.shape:
        result["edits"][name] = {"shapes": [kept.shape, anew.shape]}
        return
    kept_blocks, anew_blocks = blocks(kept), blocks(anew)
    away = np.abs(kept_blocks - anew_blocks).max(axis=-1) / np.maximum(np.abs(anew_blocks[..., :3]).max(axis=-1), 0.02)
    mean = float(np.abs(kept.mean(axis=(0, 1)) - anew.mean(axis=(0, 1))).max() / max(anew[..., :3].mean(), 1e-3))
    note = {
        "seen": len(viewports()[0].frame.snapshot.instances), "other": float((away > SAME).mean()), "mean": mean,
        "brightness": float(anew[..., :3].mean()), "changed": None,
    }  # fmt: skip
    if before and before[-1].shape == kept.shape:
        note["changed"] = float(np.abs(kept - before[-1]).mean() / max(anew[..., :3].mean(), 1e-3))
    before[:] = [kept]
    result["edits"][name] = note
    if note["other"] > MOST_OTHER or mean > MOST_MEAN:
        again, again_images = fresh()  # whether the first fresh one was wrong itself
        pictures = {"kept": kept, "fresh": anew, "again": again}
        found = {"kept": kept_images, "fresh": anew_images, "again": again_images}
        pictures |= {f"{who}:{what}": one for who, several in found.items() for what, one in several.items()}
        np.savez(FOLDER / f"{name}.npz", **pictures)


def steps():
    stage_scene()
    wanted = sys.argv[sys.argv.index("--") + 1 : -1]
    result["edits"], result["failed"] = {}, {}
    yield from wait_for_rest()
    compared("start")
    push("start")
    for change in EDITS:
        name = change.__name__
        if wanted and name not in wanted:
            continue
        started = time.monotonic()
        try:
            change()
        except Exception:
            result["failed"][name] = traceback.format_exc()
            continue
        push(name)
        yield PAUSE_S
        yield from wait_for_rest()
        compared(name)
        print(name, result["edits"][name], f"{time.monotonic() - started:.1f} s", flush=True)
        for k in range(1, 3) if EDITS.index(change) % 5 == 4 else ():
            with there():
                (bpy.ops.ed.undo if k == 1 else bpy.ops.ed.redo)()
            yield PAUSE_S
            yield from wait_for_rest()
            compared(f"{name}, {'undone' if k == 1 else 'redone'}")
    result["region"] = [main_region(viewport_area()).width, main_region(viewport_area()).height]


def push(message):
    with there():
        bpy.ops.ed.undo_push(message=message)


run(steps)
