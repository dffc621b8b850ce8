"""What is compiled before anybody looks: when this engine is chosen for a scene in a window, or a file is opened that
has it, the other process (ahead.py) begins with what a 3D region would show if it were switched to Rendered.

The scene is read once more for that, and in one go, so large ones are left alone. Programs mostly do not depend on what
images show: where there are large ones, small ones stand in for those of bytes, which are neither loaded nor handed
over. Where a program does depend on it (an emission that is black, a metallic that is 0 all over), the view compiles
its own.
"""

from __future__ import annotations

import contextlib
from dataclasses import replace
from itertools import islice

import bpy

from ..film import catcher
from ..snapshot import SnapshotCache, camera_of_view, take
from ..snapshot.camera import panoramic_view
from ..snapshot.hair import hair_systems, point_count
from ..snapshot.images import byte_shape
from ..ui import ENGINE
from ..ui.properties import settings_of
from ..ui.viewport_pass import shown_pass
from . import _ahead, _viewports, closes_eyes, compiles_ahead, hidden_in, looked_through, shown_in, size_of

SOON_S = 0.3  # Blender has evaluated the scene by then
# Of a scene that is read for this: some tenths of a second. Objects are counted with instances, faces with modifiers.
MOST_OBJECTS, MOST_FACES = 2000, 500_000
# Pixels of images: above it, small images stand in; above it in images that nothing can stand in for, nothing is
# compiled ahead.
MOST_PIXELS = 1 << 24
HAIR = 8  # faces that take as long as a point of particle hair, each of which is asked of Blender
UNKNOWN_PIXELS = 1 << 22  # of an image that is not loaded: to ask for its size would load it

_subscriber = object()


def register() -> None:
    if bpy.app.background:
        return
    bpy.app.handlers.load_post.append(_opened)
    _opened()


def unregister() -> None:
    if bpy.app.background:
        return
    bpy.msgbus.clear_by_owner(_subscriber)
    bpy.app.handlers.load_post.remove(_opened)
    if bpy.app.timers.is_registered(_foresee):
        bpy.app.timers.unregister(_foresee)


@bpy.app.handlers.persistent
def _opened(*_) -> None:
    """Blender forgets subscriptions with each file."""
    bpy.msgbus.clear_by_owner(_subscriber)
    key = bpy.types.RenderSettings, "engine"
    bpy.msgbus.subscribe_rna(key=key, owner=_subscriber, args=(), notify=_soon)
    _soon()


def _soon() -> None:
    if not bpy.app.timers.is_registered(_foresee):
        bpy.app.timers.register(_foresee, first_interval=SOON_S)


def _foresee() -> None:
    """Let the other process begin, unless a region or a render is drawn by this engine already."""
    if _viewports or not compiles_ahead() or bpy.app.is_job_running("RENDER"):
        return
    with contextlib.suppress(Exception):  # nothing is lost: the view compiles as before, and says what is wrong
        for window in bpy.context.window_manager.windows:
            depsgraph, area = window.view_layer.depsgraph, _largest(window.screen)
            if window.scene.render.engine != ENGINE or depsgraph is None or area is None or _is_large(depsgraph):
                continue
            _ahead.foresee(*_shown_in(area, depsgraph))
            return


def _shown_in(area, depsgraph):
    """The scene and the settings of what an area would show."""
    space, region = area.spaces.active, next(one for one in area.regions if one.type == "WINDOW")
    scene, view = depsgraph.scene, space.region_3d
    size, looks_through = size_of(region, scene), looked_through(space, view, scene)
    camera = camera_of_view(view, space, looks_through)
    if looks_through is not None and looks_through.data.type == "PANO":
        camera = panoramic_view(camera, depsgraph.scene_eval, depsgraph, looks_through, size)
    hidden = hidden_in(space, closes_eyes(depsgraph.view_layer_eval.layer_collection))
    cache = SnapshotCache(stands_in=sum(map(_pixels, bpy.data.images)) > MOST_PIXELS)
    seen = take(depsgraph, cache, *size, view=camera, shown=shown_in(space, hidden))
    chosen = shown_pass(space)
    shows = frozenset(chosen.images if chosen is not None else ())
    if seen.has_catchers:
        shows = frozenset(catcher.IMAGES) if chosen is None else shows
        seen = catcher.catchers_unseen(seen)
    return seen, replace(settings_of(scene, viewport=True, depsgraph=depsgraph), shows=shows)


def _largest(screen):
    areas = [area for area in screen.areas if area.type == "VIEW_3D"]
    return max(areas, key=lambda area: area.width * area.height, default=None)


def _is_large(depsgraph) -> bool:
    """Whether to read the scene would take long; asked without loading anything."""
    objects, faces, meshes = 0, 0, set()
    for instance in islice(depsgraph.object_instances, MOST_OBJECTS + 1):
        objects, kind, data = objects + 1, instance.object.type, instance.object.data
        if kind == "VOLUME":  # of files that would be loaded
            return True
        if kind in ("MESH", "CURVES", "POINTCLOUD") and data.as_pointer() not in meshes:
            meshes.add(data.as_pointer())
            faces += len(data.polygons if kind == "MESH" else data.points)
            if kind == "MESH" and bpy.data.particles:
                faces += HAIR * sum(map(point_count, hair_systems(instance.object, final=False)))
    return objects > MOST_OBJECTS or faces > MOST_FACES or _has_large_images()


def _has_large_images() -> bool:
    return sum(_pixels(one) for one in bpy.data.images if not byte_shape(one)) > MOST_PIXELS


def _pixels(image) -> int:
    """Of an image that the scene may show, as far as that is known without loading it."""
    if not image.users or image.type in ("RENDER_RESULT", "COMPOSITING"):
        return 0
    tiles = len(image.tiles) if image.source == "TILED" else 1
    return tiles * (image.size[0] * image.size[1] if image.has_data else UNKNOWN_PIXELS)
