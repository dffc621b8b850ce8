"""Runs inside a windowed Blender: a turning view and playback, by Candela and by EEVEE in the same window."""

import sys
import time
from pathlib import Path

import bpy
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Quaternion, Vector

sys.path.insert(0, str(Path(__file__).parent))

from stage import ENGINE, main_region, picture, result, run, there, viewport_area, viewports, wait_for_rest, window

EEVEE = "BLENDER_EEVEE"
LASTS_S = 6.0
SHOWN = (5, 10, 15)  # frames of the strip
BLOCK = "Moving block"
drawn = []  # when the viewport was redrawn


def block(scene):
    """A red block before the camera, that goes half a metre a frame from left to right."""
    bpy.ops.mesh.primitive_cube_add(size=1.2)
    made = bpy.context.object
    made.name = BLOCK
    material = bpy.data.materials.new("Red")
    if not material.use_nodes:
        material.use_nodes = True
    material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.9, 0.02, 0.02, 1.0)
    made.data.materials.append(material)
    camera = scene.camera.matrix_world
    for frame, x in ((1, -2.5), (20, 2.5)):
        made.location = camera @ Vector((x, 0.0, -9.0))
        made.keyframe_insert("location", frame=frame)
    scene.frame_start, scene.frame_end = 1, 20


def turning(space):
    """The view turns; steps in a second, and in which pixels."""
    space.region_3d.view_perspective = "PERSP"
    yield 0.5
    drawn.clear()
    scales, started = set(), time.monotonic()
    while time.monotonic() - started < LASTS_S:
        space.region_3d.view_rotation = Quaternion((0, 0, 1), 0.02) @ space.region_3d.view_rotation
        scales |= {one.scale for one in viewports()} if window().scene.render.engine == ENGINE else {1}
        yield 0.01
    return {"steps_per_s": len(drawn) / LASTS_S, "scales": sorted(scales)}


def playing(scene):
    """An animation is played; frames in a second that are seen."""
    frames, scales = set(), set()

    def changed(*_):
        frames.add((time.monotonic(), scene.frame_current))

    with there():
        bpy.ops.screen.animation_play()
    yield 1.0
    bpy.app.handlers.frame_change_post.append(changed)
    drawn.clear()
    started = time.monotonic()
    while time.monotonic() - started < LASTS_S:
        scales |= {one.scale for one in viewports()} if scene.render.engine == ENGINE else {1}
        yield 0.02
    bpy.app.handlers.frame_change_post.remove(changed)
    with there():
        bpy.ops.screen.animation_play()
    return {
        "frames_per_s": len(frames) / LASTS_S, "redraws_per_s": len(drawn) / LASTS_S, "scales": sorted(scales),
    }  # fmt: skip


def strip(scene, space, name):
    """Pictures of a few frames as they are first shown, and where the block is in them."""
    places, area = [], viewport_area()
    region = main_region(area)
    for frame in SHOWN:
        drawn.clear()
        scene.frame_set(frame)
        while not drawn:
            yield 0.02
        yield 0.0
        picture(f"{name}_{frame}.png")
        at = location_3d_to_region_2d(region, space.region_3d, scene.objects[BLOCK].matrix_world.translation)
        places.append([region.x + at.x, window().height - region.y - at.y])
    return places


def steps():
    scene, space = window().scene, viewport_area().spaces.active
    block(scene)
    scene.candela.viewport_samples = 2
    space.overlay.show_overlays = space.show_gizmo = False
    handler = bpy.types.SpaceView3D.draw_handler_add(lambda: drawn.append(time.monotonic()), (), "WINDOW", "POST_PIXEL")
    for name, engine in (("candela", ENGINE), ("eevee", EEVEE)):
        scene.render.engine = engine
        scene.frame_set(1)
        space.region_3d.view_perspective = "CAMERA"
        space.shading.type = "RENDERED"
        yield 1.0
        if engine == ENGINE:
            yield from wait_for_rest()
        else:
            yield 20.0  # its shaders are compiled meanwhile
        result[name] = {"playback": (yield from playing(scene))}
        scene.frame_set(1)
        yield 2.0
        result[name]["places"] = yield from strip(scene, space, name)
        result[name]["orbit"] = yield from turning(space)
        picture(f"{name}_turning.png")
        space.shading.type = "SOLID"
        yield 2.0
    bpy.types.SpaceView3D.draw_handler_remove(handler, "WINDOW")


run(steps)
