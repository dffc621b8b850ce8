"""The viewport: each 3D region's picture, coarse while it changes, refined sample by sample while it rests.

Blender calls `view_update` in the middle of its dependency-graph evaluation, where nothing may be drawn: `changed`
only records. All work is done by `draw`, which Blender calls whenever the region is drawn. One call works for a short
time, shows what there is and asks to be called again until the picture is complete, so that Blender keeps answering.
While the view moves a call draws a whole sample: a draft, in pixels coarse enough for that. At rest a sample in full
resolution takes as many calls as it needs, technique by technique and long passes in bands (frame/bands.py), and the
last whole one stays in view.

Engine instances come and go with the shading mode and with each frame of an animation. What they share lives in
`_viewports`, one `Viewport` for each region and scene, and is freed a moment after the last instance has gone: not by
the instance's end itself, which may come where no GPU context is, but by a timer of Blender's main loop.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable

import bpy
import gpu
import numpy as np

from ..gfx import context as gpu_context
from ..gfx import images
from ..gfx.context import turn
from ..snapshot import UnsupportedScene, camera_of_view, take
from ..snapshot.camera import framed, panoramic_view
from ..snapshot.errors import unforeseen
from ..snapshot.images import whole_key
from ..snapshot.scene import Camera, Snapshot, one_line
from ..ui.properties import settings_of
from ..ui.viewport_pass import shown_pass
from .ahead import VARIABLE, Ahead
from .pace import SCALES, STEP_S, STEP_SHARE, Pace, coarsest_for
from .picture import BUDGET_S, MOST_BUDGET_S, REST_S, Viewport

__all__ = [
    "BUDGET_S",
    "MOST_BUDGET_S",
    "REST_S",
    "SCALES",
    "STEP_S",
    "Pace",
    "Viewport",
    "changed",
    "coarsest_for",
    "draw",
    "free_all",
]

FREE_AFTER_S = 1.0  # a mode or frame change makes the next engine instance well within this time

LOOK_AGAIN_S = 0.1  # for programs that another process compiles
SAY_S = 1.0  # between two redraws that tell how many
EXTENSION = __package__.removesuffix(".viewport").removesuffix(".addon")

LOOK_AT_IMAGES_S, LOOK_SHARE = 1.0, 20.0  # least time between two looks at unsaved images, and by what reading takes

TURN_WAIT_S = 0.1  # for the GPU, while a final render draws a part of a sample

# -------------------------------------------------------------------------------------------------- Blender's callbacks

_ahead = Ahead()
_viewports: dict[tuple[int, int], Viewport] = {}  # by address of the region and session_uid of the scene


def _viewport_of(engine, context, depsgraph) -> Viewport:
    key = (context.region.as_pointer(), depsgraph.scene.original.session_uid)
    viewport = _viewports.get(key)
    if viewport is None:
        viewport = _viewports[key] = Viewport()
    viewport.ahead = _ahead if compiles_ahead() else None
    if viewport.owner() is not engine:
        viewport.attach(engine, _free_soon)
    return viewport


def changed(engine, context, depsgraph) -> None:
    """The scene may have changed: remember what Blender says about it. Draws nothing, allocates nothing."""
    viewport = _viewport_of(engine, context, depsgraph)
    viewport.dirty = True
    viewport.error = ""
    if viewport.frame is not None:
        viewport.cache.invalidate(depsgraph.updates)
    engine.tag_redraw()  # Blender draws again after an artist's change, not after one by a script


def draw(engine, context, depsgraph) -> None:
    """Draw the region: add samples, show the picture, and ask for another call until it is complete."""
    viewport = _viewport_of(engine, context, depsgraph)
    region, scene = context.region, depsgraph.scene
    size = size_of(region, scene)
    place = (size, context.region_data.view_perspective)
    if viewport.error and viewport.failed_at != place:  # it may have been this view's, or this size's
        viewport.error = ""
    viewport.dirty |= _painted(viewport)
    if not viewport.error:
        viewport.failed_at = place
        paused = viewport.paused = scene.candela.viewport_pause and viewport.picture is not None
        if paused:
            pass
        elif turn.acquire(timeout=TURN_WAIT_S):
            try:
                with images.lasting_context():
                    _refine(viewport, engine, context, depsgraph, size)
            finally:
                turn.release()
        else:
            engine.tag_redraw()  # a final render draws
    if viewport.picture is not None:
        _show(engine, scene, viewport, (region.width / size[0], region.height / size[1]))
    warning = viewport.warning()
    engine.update_stats("Candela", viewport.status() + (f" | Warning: {warning}" if warning else ""))
    if viewport.held:
        _redraw_soon(viewport)
    elif not viewport.done:
        engine.tag_redraw()
    elif viewport.news:
        viewport.news = False
        for area in context.screen.areas:
            if area.type == "PROPERTIES":
                area.tag_redraw()  # the Frame panel shows this picture's ledger


def _painted(viewport: Viewport) -> bool:
    """Whether the scene has to be read for an image that is shown and not saved: scripts may have written into it, of
    which Blender tells nobody. Asked now and then, where any image is shown."""
    now = time.monotonic()
    if viewport.dirty or not viewport.settled or not viewport.cache.images:
        return False
    if now < viewport.images_again:
        _look_later(viewport, viewport.images_again - now)
        return False
    viewport.images_again = now + max(LOOK_AT_IMAGES_S, LOOK_SHARE * viewport.reading)
    return _shows_unsaved(viewport)


def _shows_unsaved(viewport: Viewport) -> bool:
    return any(one.is_dirty and whole_key(one.session_uid) in viewport.cache.images for one in bpy.data.images)


def _look_later(viewport: Viewport, seconds: float) -> None:
    """Ask once more after that time, and draw again: what was painted since the last look would else stay unseen until
    something else draws the region."""
    if viewport.looks_later:
        return
    viewport.looks_later = True

    def look() -> None:
        viewport.looks_later = False
        if (engine := viewport.owner()) is not None and _shows_unsaved(viewport):
            engine.tag_redraw()

    _call_later(viewport, look, seconds)


def _refine(viewport: Viewport, engine, context, depsgraph, size: tuple[int, int]) -> None:
    space, region_data = context.space_data, context.region_data
    looks_through = looked_through(space, region_data, depsgraph.scene)
    if viewport.dirty:  # which the update does that tells of an eye; to ask all collections in each redraw takes long
        viewport.closes_eyes = closes_eyes(depsgraph.view_layer_eval.layer_collection)
    hidden = hidden_in(space, viewport.closes_eyes)
    shown = shown_in(space, hidden)
    if viewport.hidden != hidden:
        viewport.hidden = hidden
        viewport.dirty = True

    def source(camera: Camera, width: int, height: int) -> Snapshot:
        return take(depsgraph, viewport.cache, width, height, view=camera, shown=shown)

    blend, depth_test, depth_mask = gpu.state.blend_get(), gpu.state.depth_test_get(), gpu.state.depth_mask_get()
    try:
        camera = camera_of_view(region_data, space, looks_through)
        border = render_border(depsgraph, space, camera, looks_through, size)
        viewport.render_pass = shown_pass(space)
        viewport.step = STEP_SHARE / float(depsgraph.scene.candela.navigation)
        viewport.coarsest = coarsest_for(framed_height(depsgraph, camera, looks_through, size))
        if looks_through is not None and looks_through.data.type == "PANO":
            camera = panoramic_view(camera, depsgraph.scene_eval, depsgraph, looks_through, size)
        viewport.draw_frame(
            source, camera, size, settings_of(depsgraph.scene, viewport=True, depsgraph=depsgraph), border=border
        )
    except (UnsupportedScene, ValueError, RuntimeError) as error:
        _fail(viewport, engine, str(error))
    except Exception as error:
        # An error of Candela's own. Raised further it would come again with every redraw.
        _fail(viewport, engine, unforeseen(error))
    finally:
        gpu.state.blend_set(blend)
        gpu.state.depth_test_set(depth_test)
        gpu.state.depth_mask_set(depth_mask)


def size_of(region, scene) -> tuple[int, int]:
    """Width and height of a region's picture, in pixels."""
    pixel = pixel_size(scene.render.preview_pixel_size)
    return max(-(-region.width // pixel), 1), max(-(-region.height // pixel), 1)


def looked_through(space, region_data, scene):
    """The camera object that a region looks through; None: a view of its own."""
    if region_data.view_perspective != "CAMERA":
        return None
    camera = space.camera if space.use_local_camera else scene.camera
    return camera if camera is not None and camera.type == "CAMERA" else None


def shown_in(space, hidden: tuple[str, ...]):
    """Predicate on objects: whether a region shows one; None where it hides nothing (`hidden_in`)."""
    return (lambda shown_object: shown_object.visible_in_viewport_get(space)) if hidden else None


_KINDS = [p.identifier for p in bpy.types.SpaceView3D.bl_rna.properties if p.identifier.startswith("show_object_view")]


def hidden_in(space, eyes_closed: bool) -> tuple[str, ...]:
    """Names of what the region's own settings hide: other than in local view or in its collections, and kinds; and
    whether the eye of a collection is closed, whose objects Blender lists nevertheless."""
    own = [name for name in ("local_view", "use_local_collections") if getattr(space, name, None)]
    kinds = [name for name in _KINDS if not getattr(space, name, True)]
    return (*own, *kinds, *(("collections",) if eyes_closed else ()))


def closes_eyes(layer_collection) -> bool:
    return any(one.hide_viewport or closes_eyes(one) for one in layer_collection.children)


def render_border(depsgraph, space, view: Camera, looks_through, size: tuple[int, int]):
    """Pixels (x0, y0, x1, y1) of the region that its render border leaves to be drawn; None without one."""
    render = depsgraph.scene_eval.render
    if looks_through is not None and render.use_border:
        # Both frames lie one unit before the same eye, so they can be compared.
        left, right, bottom, top = framed(depsgraph.scene_eval, depsgraph, looks_through)
        low = left + (right - left) * render.border_min_x, bottom + (top - bottom) * render.border_min_y
        high = left + (right - left) * render.border_max_x, bottom + (top - bottom) * render.border_max_y
        left, right, bottom, top = view.frame
        scale, start = np.array([right - left, top - bottom]), np.array([left, bottom])
        shares = (*((np.array(low) - start) / scale), *((np.array(high) - start) / scale))
    elif looks_through is None and space.use_render_border:
        shares = (
            space.render_border_min_x, space.render_border_min_y, space.render_border_max_x, space.render_border_max_y,
        )  # fmt: skip
    else:
        return None
    edges = np.clip(np.round(np.array(shares) * (*size, *size)), 0, (*size, *size)).astype(int)
    x0, y0 = np.minimum(edges[:2], np.array(size) - 1)
    return int(x0), int(y0), int(max(edges[2], x0 + 1)), int(max(edges[3], y0 + 1))


def framed_height(depsgraph, view: Camera, looks_through, size: tuple[int, int]) -> float:
    """Pixels of the camera's frame from top to bottom; of a view of its own those of the region."""
    if looks_through is None:
        return float(size[1])
    _, _, bottom, top = framed(depsgraph.scene_eval, depsgraph, looks_through)
    return size[1] * (top - bottom) / (view.frame[3] - view.frame[2])


def pixel_size(wanted: str) -> int:
    """Screen pixels per side of a drawn one, as Blender's Pixel Size says for viewports."""
    if wanted != "AUTO":
        return int(wanted)
    return 2 if bpy.context.preferences.system.pixel_size > 1.5 else 1


def _fail(viewport: Viewport, engine, sentence: str) -> None:
    """Stop drawing until the scene changes; the sentence stands in the region, and once in Blender's reports."""
    viewport.drop()
    if viewport.reported != sentence:
        engine.report({"ERROR"}, one_line(sentence))
    viewport.error = viewport.reported = sentence


def _show(engine, scene, viewport: Viewport, pixel: tuple[float, float]) -> None:
    """Draw the picture over the region, with the scene's colour management. `pixel`: size of one on the screen."""
    from gpu_extras.presets import draw_texture_2d

    x, y, width, height = (extent * pixel[k % 2] for k, extent in enumerate(viewport.display.place))
    gpu.state.blend_set("ALPHA_PREMULT")
    engine.bind_display_space_shader(scene)
    draw_texture_2d(viewport.display.shown.texture, (x, y), width, height)
    engine.unbind_display_space_shader()
    gpu.shader.unbind()
    gpu.state.blend_set("NONE")


def compiles_ahead() -> bool:
    """Whether programs are compiled by a second Blender (ahead.py)."""
    own = bpy.context.preferences.addons.get(EXTENSION)
    return os.environ.get(VARIABLE) != "0" and getattr(own and own.preferences, "compiles_ahead", False)


def _redraw_soon(viewport: Viewport) -> None:
    """Draw again when the other process has compiled all that the picture waits for, and now and then meanwhile: what
    the window's redraws take, the other process lacks."""
    if viewport.looked_after:
        return
    viewport.looked_after, asked = True, time.monotonic()

    def look() -> float | None:
        engine = viewport.owner()
        if engine is None or not viewport.held:
            viewport.looked_after = False
            return None
        if not _ahead.came() and time.monotonic() - asked < SAY_S:
            return LOOK_AGAIN_S
        viewport.looked_after = False
        engine.tag_redraw()
        return None

    _call_later(viewport, look, LOOK_AGAIN_S)


def _call_later(viewport: Viewport, timer: Callable[[], float | None], seconds: float) -> None:
    viewport.timers = [one for one in viewport.timers if bpy.app.timers.is_registered(one)] + [timer]
    bpy.app.timers.register(timer, first_interval=seconds)


def _release(viewport: Viewport) -> None:
    for timer in filter(bpy.app.timers.is_registered, viewport.timers):
        bpy.app.timers.unregister(timer)
    viewport.release()


def _free_soon() -> None:
    if not bpy.app.timers.is_registered(_free_orphans):
        bpy.app.timers.register(_free_orphans, first_interval=FREE_AFTER_S)


def _free_orphans() -> float | None:
    """Free the viewports that no engine instance draws any more; runs in Blender's main loop."""
    orphans = [key for key, viewport in _viewports.items() if viewport.owner() is None]
    if not orphans:
        return None
    if not gpu_context.available() or not turn.acquire(timeout=0.0):
        return FREE_AFTER_S  # later
    try:
        for key in orphans:
            _release(_viewports.pop(key))
        images.pool.trim()
    finally:
        turn.release()
    return None


def free_all() -> None:
    """Free every viewport; those that are still open begin anew with their next redraw."""
    for viewport in _viewports.values():
        _release(viewport)
    _viewports.clear()
    _ahead.close()
    if bpy.app.timers.is_registered(_free_orphans):
        bpy.app.timers.unregister(_free_orphans)
