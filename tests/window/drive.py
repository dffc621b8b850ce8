"""Runs inside a windowed Blender: renders as F12 does, shows the viewport moving and at rest, and the panels."""

import sys
import time
from pathlib import Path

import bpy
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Quaternion

sys.path.insert(0, str(Path(__file__).parent))

from stage import (
    ENGINE,
    FOLDER,
    candela,
    main_region,
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

RENDER_SIZE = (320, 180)
SAMPLES = 8
ORBIT_S = 5.0


def steps():
    scene = window().scene
    scene.render.engine = ENGINE
    result["engine"] = scene.render.engine
    scene.candela.samples = scene.candela.viewport_samples = SAMPLES
    bounces, scene.candela.bounces = scene.candela.bounces, 0  # indirect light takes its time without a GPU
    yield from first_look()
    yield from final_renders(scene)
    yield from resting_camera_view()
    yield from orbit(bounces)
    yield from panels()
    yield from same_view()


def first_look():
    """Rendered is chosen in a process that has compiled nothing: until the first picture with light, and how long
    Blender did not answer meanwhile."""
    space = viewport_area().spaces.active
    shading, space.shading.type = space.shading.type, "RENDERED"
    started = before = time.monotonic()
    first, longest, said = None, 0.0, set()
    while first is None or viewports()[0].looks:
        yield 0.0
        now = time.monotonic()
        longest, before = max(longest, now - before), now
        if viewports():
            said.add(viewports()[0].status().split(" (")[0])
            if first is None and viewports()[0].picture is not None:
                first = now - started
    result["cold"] = {"first_s": first, "lit_s": now - started, "longest_s": longest, "said": sorted(said)}
    space.shading.type = shading
    yield 1.5


def final_renders(scene):
    """Three times: anew, unchanged, and changed, since each render has a thread and a GPU context of its own."""
    scene.render.resolution_x, scene.render.resolution_y = RENDER_SIZE
    scene.render.resolution_percentage = 100
    for switch in ("z", "normal", "diffuse_direct", "diffuse_color", "glossy_color", "emit", "environment"):
        setattr(window().view_layer, f"use_pass_{switch}", True)
    started = time.monotonic()
    result["render"] = yield from render()
    result["render_s"] = time.monotonic() - started
    save(scene, "render.exr", "MULTI_LAYER_IMAGE", "OPEN_EXR_MULTILAYER")
    save(scene, "render.png", "IMAGE", "PNG")
    result["render_again"] = yield from render()
    save(scene, "render_again.png", "IMAGE", "PNG")
    scene.candela.seed = 1
    result["render_changed"] = yield from render()
    save(scene, "render_changed.png", "IMAGE", "PNG")
    scene.candela.seed = 0


def save(scene, name, media, file_format):
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):  # since Blender 5.0
        settings.media_type = media
    settings.file_format = file_format
    if media == "IMAGE":
        settings.color_mode = "RGB"
    else:
        settings.color_depth = "32"
    bpy.data.images["Render Result"].save_render(str(FOLDER / name), scene=scene)


def resting_camera_view():
    """What the camera sees: coarse at once, then refined. Where its frame lies is told for the comparison."""
    area = viewport_area()
    space, region = area.spaces.active, main_region(area)
    space.overlay.show_overlays = False
    space.show_gizmo = False
    space.region_3d.view_perspective = "CAMERA"
    space.shading.type = "RENDERED"
    started = time.monotonic()
    yield 0.1
    while not viewports() or viewports()[0].picture is None:
        yield 0.05
    result["first_picture_s"] = time.monotonic() - started
    picture("viewport_first.png")
    yield from wait_for_rest()
    result["rest_s"] = time.monotonic() - started
    picture("viewport_rest.png")
    result["status"] = viewports()[0].status()
    camera = window().scene.camera
    corners = [
        location_3d_to_region_2d(region, space.region_3d, camera.matrix_world @ corner)
        for corner in camera.data.view_frame(scene=window().scene)
    ]
    left, right = min(x for x, _ in corners), max(x for x, _ in corners)
    low, high = min(y for _, y in corners), max(y for _, y in corners)
    # The y axis of regions points upwards, that of pictures downwards.
    result["viewport"] = [region.x, window().height - region.y - region.height, region.width, region.height]
    result["camera"] = [region.x + left, window().height - region.y - high, right - left, high - low]


def orbit(bounces):
    """The view turns for a while, with indirect light; how long each redraw took is noted."""
    space, settings = viewport_area().spaces.active, window().scene.candela
    space.region_3d.view_perspective = "PERSP"
    yield from wait_for_rest()
    took, scales, draw, uploads = [], [], candela().draw, viewports()[0].renderer.geometry.uploads

    def timed(*arguments):
        started = time.perf_counter()
        draw(*arguments)
        took.append(time.perf_counter() - started)
        scales.append(viewports()[0].scale)

    candela().draw = timed
    settings.bounces = bounces
    while viewports()[0].frame.settings.bounces == 0 or viewports()[0].frame.samples_done == 0:
        yield 0.1  # programs of indirect light are compiled once
    took.clear(), scales.clear()
    started = time.monotonic()
    while time.monotonic() - started < ORBIT_S:
        space.region_3d.view_rotation = Quaternion((0, 0, 1), 0.02) @ space.region_3d.view_rotation
        yield 0.01
    picture("viewport_moving.png")
    settings.bounces = 0
    candela().draw = draw
    result["moving"] = {
        "steps_per_s": len(took) / ORBIT_S,
        "median_step_s": sorted(took)[len(took) // 2] if took else 0.0,
        "slowest_step_s": max(took, default=0.0),
        "scales": sorted(set(scales)),
        "meshes_uploaded": viewports()[0].renderer.geometry.uploads - uploads,
    }
    started = time.monotonic()
    yield from wait_for_rest()
    result["rest_after_moving_s"] = time.monotonic() - started
    picture("viewport_moved.png")


def panels():
    """The panels beside the viewport, one picture for each tab."""
    area = viewport_area()
    area.spaces.active.overlay.show_overlays = True
    area.spaces.active.region_3d.view_perspective = "CAMERA"
    with there(area):
        bpy.ops.screen.area_split(direction="VERTICAL", factor=0.6)
    yield 0.5
    left, right = sorted((a for a in window().screen.areas if a.type == "VIEW_3D"), key=lambda a: a.x)
    left.spaces.active.shading.type = "RENDERED"
    right.type = "PROPERTIES"
    yield from wait_for_rest()
    scene = window().scene
    light = next(one for one in scene.objects if one.type == "LIGHT" and one.data.type == "AREA")
    mesh = next(one for one in scene.objects if one.type == "MESH" and one.active_material)
    result["properties"] = [right.x, window().height - right.y - right.height, right.width, right.height]
    for tab, active in (
        ("RENDER", None), ("VIEW_LAYER", None), ("WORLD", None), ("DATA", light), ("OBJECT", mesh), ("MATERIAL", mesh),
    ):  # fmt: skip
        if active is not None:
            window().view_layer.objects.active = active
            yield 0.3
        right.spaces.active.context = tab
        yield 1.5
        picture(f"panel_{tab.lower()}.png")
        if tab == "RENDER":
            with bpy.context.temp_override(window=window(), area=right, region=main_region(right)):
                bpy.ops.view2d.scroll_down(page=True)
            yield 0.5
            picture("panel_frame.png")
    material = mesh.active_material
    yield from no_icon_is_drawn()
    material.asset_generate_preview()
    yield from no_icon_is_drawn()
    preview = material.preview.image_pixels_float[:]
    result["preview"] = [min(preview, default=0.0), max(preview, default=0.0)]


def no_icon_is_drawn():
    """Until the jobs that draw icons have ended. A script that ends one waits for a thread that waits for Python."""
    yield 1.0
    while bpy.app.is_job_running("RENDER_PREVIEW"):
        yield 0.2


def same_view():
    """The view of a viewport in a file with a camera that sees the same, for a render of it in the background."""
    area = next(a for a in window().screen.areas if a.type == "VIEW_3D")
    space, region, scene = area.spaces.active, main_region(area), window().scene
    space.overlay.show_overlays = space.show_gizmo = False
    space.show_region_header = space.show_region_tool_header = space.show_region_toolbar = False
    space.region_3d.view_perspective = "PERSP"
    scene.candela.bounces, scene.candela.light_probes_maps = 1, 0.0  # one point per light and sample, as viewports have
    yield from wait_for_rest()
    picture("view.png")
    result["view"] = [region.x, window().height - region.y - region.height, region.width, region.height]
    camera = bpy.data.cameras.new("View")
    camera.sensor_fit = "HORIZONTAL"
    camera.lens = space.region_3d.window_matrix[0][0] * camera.sensor_width / 2
    camera.clip_start, camera.clip_end = space.clip_start, space.clip_end
    scene.camera = bpy.data.objects.new("View", camera)
    scene.collection.objects.link(scene.camera)
    scene.camera.matrix_world = space.region_3d.view_matrix.inverted()
    scene.render.resolution_x, scene.render.resolution_y = region.width, region.height
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "view.blend"), copy=True)


run(steps)
