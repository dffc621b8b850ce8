"""The render engine that Blender sees: thin, owns nothing.

Blender makes two instances per final render and throws viewport instances away on a mode change, so what lives longer
(meshes, programs, accumulated frames) stands in `_sessions`, keyed by scene and use, and for the 3D regions in
viewport.py. All of it is freed in `free_sessions`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial

import bpy
import numpy as np

from . import bake, final, main_loop, viewport
from .frame import ledger as ledgers
from .frame import slices
from .frame.bands import QueueLimit, samples_in_parts
from .frame.picture import Frame
from .frame.run import Renderer
from .frame.settings import Settings
from .gfx import context, images
from .snapshot import SnapshotCache, UnsupportedScene, camera_of_scene, shutter, take
from .snapshot.baking import instance_of, seen_by_nobody, triangles_of
from .snapshot.errors import unforeseen
from .snapshot.motion import STEPS, Moment, read_moment
from .snapshot.scene import Camera, Note, Snapshot, one_line
from .techniques import make_registry
from .techniques.film import check_tree
from .ui import ENGINE
from .ui.passes import cryptomatte_metadata, missing_passes, render_metadata, wanted_passes
from .ui.properties import settings_of
from .viewport import chosen

MOST_SESSIONS = 4  # scenes, and icons of materials, whose meshes, programs and images stay for their next picture
BEHIND_S = 0.5  # what the GPU may be behind in a render in the background

STEREO = ("left", "right")
NO_CONTEXT_YET = (
    "Blender before 5.2 opens the GPU by a render, which would end a bake: render any picture first, then bake again."
)


@dataclass
class Session:
    """What one scene's renders share: the renderer on the GPU, and what the sync may reuse."""

    renderer: Renderer = field(default_factory=lambda: Renderer(make_registry))
    cache: SnapshotCache = field(default_factory=SnapshotCache)


_sessions: dict[tuple, Session] = {}

# What the command line takes from final renders and gives to them, by view layer (frame/slices.py): while `taken` is a
# dictionary, each layer's samples are put there; of a layer in `given` no sample is drawn, but those sums are shown.
taken: dict[str, slices.Slice] | None = None
given: dict[str, dict[str, np.ndarray]] = {}
told: Callable[[final.Progress], None] | None = None  # what the command line hears of final renders, as they go on
FINISHED = final.Progress("Finished", 1.0)  # the last that is told of a view layer; one that was broken off lacks it


def session(scene: bpy.types.Scene, use: str) -> Session:
    """The session of a scene for 'final' or 'preview'."""
    key = (scene.original.session_uid, use)
    shared = _sessions[key] = _sessions.pop(key, None) or Session()  # the latest is the last
    shared.renderer.publishes = use != "preview"
    return shared


def _free_old_sessions() -> None:
    """Of more than MOST_SESSIONS free those that rendered the longest ago."""
    for key in list(_sessions)[:-MOST_SESSIONS]:
        _sessions.pop(key).renderer.release()


def free_sessions() -> None:
    """Free what renders of scenes hold; compiled programs stay."""
    main_loop.close_all()
    viewport.free_all()
    for shared in _sessions.values():
        shared.renderer.release()
    _sessions.clear()
    images.pool.trim()


@bpy.app.handlers.persistent
def _another_file(*_) -> None:
    free_sessions()
    ledgers.forget()


def register() -> None:
    bpy.utils.register_class(CandelaEngine)
    bpy.app.handlers.load_post.append(_another_file)
    main_loop.register()
    chosen.register()


def unregister() -> None:
    chosen.unregister()
    main_loop.unregister()
    bpy.app.handlers.load_post.remove(_another_file)
    bpy.utils.unregister_class(CandelaEngine)
    free_sessions()
    context.release_all()


class CandelaEngine(bpy.types.RenderEngine):
    """Real-time global illumination, sample by sample."""

    bl_idname = ENGINE
    bl_label = "Candela"
    bl_use_preview = True
    bl_use_gpu_context = bpy.app.background  # in a window every viewport would wait for the render: see main_loop.py
    bl_use_shading_nodes_custom = False
    bl_use_eevee_viewport = True

    def __init__(self, *args, **kwargs):
        super().__init__(*args, **kwargs)

    # ---------------------------------------------------------------------------------------------- final render

    def update_render_passes(self, scene=None, renderlayer=None):
        """Tell Blender (and the compositor) which passes will come."""
        self.register_pass(scene, renderlayer, "Combined", 4, "RGBA", "COLOR")
        for asked in wanted_passes(renderlayer, scene):
            self.register_pass(scene, renderlayer, asked.name, len(asked.channels), asked.channels, asked.kind)

    def update(self, data, depsgraph):
        """Read the scene while Blender keeps it locked. It comes before a bake, too, which reads the scene itself."""
        self._snapshot = self._moments = self._refused = None
        if not self.resolution_x:
            return
        started = time.perf_counter()
        scene = depsgraph.scene
        shared = session(scene, "preview" if self.is_preview else "final")
        self.update_stats("Candela", "Reading the scene")
        try:
            layer = depsgraph.view_layer
            blurred = shutter.is_blurred(scene, layer) and not self.is_preview
            around = self._frames_around(depsgraph) if layer.use_pass_vector and not blurred else None
            self._snapshot = self._take(depsgraph, shared, around)
            if blurred:
                self._moments = self._take_moments(depsgraph, shared, self._snapshot)
        except UnsupportedScene as error:
            self._refused = str(error)  # said by `render`
        except Exception as error:  # Blender would print it and go on with a black picture
            self._fail_unforeseen(error)
        self._sync_seconds = time.perf_counter() - started

    def _take(self, depsgraph, shared: Session, around: tuple[Moment, ...] | None = None, camera=None) -> Snapshot:
        size = self.resolution_x, self.resolution_y
        return take(depsgraph, shared.cache, *size, camera=camera or self.camera_override, around=around)

    def _take_moments(self, depsgraph, shared: Session, central: Snapshot) -> shutter.Moments | None:
        """The scene while the shutter is open, where anything moves. It is evaluated now, while Blender keeps it."""
        scene = depsgraph.scene
        settings = settings_of(scene, viewport=False, layer=depsgraph.view_layer, depsgraph=depsgraph)
        own = scene.frame_current + scene.frame_subframe

        def moved_to(time: float) -> None:
            frame, subframe = divmod(own + time, 1.0)
            self.frame_set(int(frame), subframe)

        # Markers may show another camera a moment later: a cut, as in Cycles, is between pictures.
        camera = self.camera_override or depsgraph.scene_eval.camera
        camera = camera and camera.original
        times = shutter.shutter_times(scene, min(settings.motion_steps, settings.samples))
        return shutter.take_moments(
            central, times, moved_to, lambda: self._take(depsgraph, shared, camera=camera), shutter.blurs(camera)
        )

    def _frames_around(self, depsgraph) -> tuple[Moment, ...] | None:
        """The scene in the frames before and after, for the Vector pass. It stands at its own again afterwards."""
        if self.is_preview:
            return None
        scene, camera = depsgraph.scene, self.camera_override or depsgraph.scene_eval.camera
        camera = camera and camera.original
        frame, part = scene.frame_current, scene.frame_subframe
        found = []
        try:
            for step in STEPS:
                self.frame_set(frame + step, part)
                found.append(read_moment(depsgraph, self.resolution_x, self.resolution_y, camera))
        finally:
            self.frame_set(frame, part)
        return tuple(found)

    def render(self, depsgraph):
        """Draw all samples and hand the passes to Blender. In background mode in the engine's own GPU context, which
        ends afterwards; in a window by its main loop (main_loop.py)."""
        snapshot = getattr(self, "_snapshot", None)
        if getattr(self, "_refused", None):
            self._fail(self._refused)
        if snapshot is not None:
            self._render(depsgraph, snapshot)

    def _camera_of(self, depsgraph, snapshot: Snapshot, eye: str) -> Camera | None:
        """The camera of a view, where there are several."""
        if not eye:
            return None
        self.active_view_set(eye)
        scene, film = depsgraph.scene_eval, snapshot.film
        camera = self.camera_override or scene.camera
        spherical = bool(self.use_spherical_stereo(camera))
        matrix = self.camera_model_matrix(camera, use_spherical_stereo=spherical)
        placed = np.array(matrix, np.float64).reshape(4, 4)
        shift = self.camera_shift_x(camera)
        return camera_of_scene(
            scene, depsgraph, film.width, film.height, camera, placed, shift, eye if spherical else ""
        )

    def _render(self, depsgraph, snapshot: Snapshot) -> None:
        started = time.perf_counter()
        scene, layer = depsgraph.scene, depsgraph.view_layer
        settings = settings_of(scene, viewport=False, preview=self.is_preview, layer=layer, depsgraph=depsgraph)
        result, told_of = None, []  # ledgers of the eyes that are done
        try:
            check_tree(settings.passes)
            eyes = tuple((eye, self._camera_of(depsgraph, snapshot, eye)) for eye in eyes_of(scene))
            order = self._order(scene, layer, snapshot, settings, started, eyes)
            for progress in (parts := main_loop.taken(final.steps(order))):
                if progress is not None:
                    result = self._tell(progress, result, layer.name)
                    if progress.pixels is not None:
                        self._end(result, progress, order, layer.name, started)
                        result = None
                        told_of.append(progress.ledger)
                if self.test_break():
                    parts.close()
                    if result is not None:
                        self.end_result(result, cancel=True, do_merge_results=True)  # what is there stays in view
                    self._warn(told_of)
                    return
            self._tell(FINISHED, None, layer.name)
        except (ValueError, RuntimeError) as error:
            self._fail(str(error))
            return
        except Exception as error:
            self._fail_unforeseen(error)
            return
        told_of[-1].times["total"] = time.perf_counter() - started + self._sync_seconds
        self._warn(told_of)

    def _warn(self, told_of: list[ledgers.Ledger]) -> None:
        """Report what the ledgers of finished pictures, one for each eye, warn of: each note once."""
        if self.is_preview:
            return
        for note in dict.fromkeys(note for ledger in told_of for note in ledger.notes):
            self.report({"WARNING"}, str(note))
        bad = sum(ledger.bad_pixels for ledger in told_of)
        if bad:
            self.report({"WARNING"}, f"{bad} values were not finite and were set to 0.")

    def _end(self, result, done: final.Progress, order: final.Order, layer: str, started: float) -> None:
        """Hand over the picture of an eye, with what tells of it."""
        for name, array in done.pixels.items():
            _fill(result, name, done.eye, array)
        seen = (order.snapshot, *(order.moments.snapshots if order.moments is not None else ()))
        told = cryptomatte_metadata(seen, layer) | render_metadata(layer, done.ledger, time.perf_counter() - started)
        for name, text in told.items():
            self.get_result().stamp_data_add_field(name, text)
        self.end_result(result)

    def _order(
        self, scene, layer, snapshot: Snapshot, settings: Settings, started: float, eyes: tuple = final.ONE_EYE
    ) -> final.Order:
        """What this render asks for."""
        shared = session(scene, "preview" if self.is_preview else "final")
        missing, texts = missing_passes(layer), []
        if missing:
            texts.append(f"Candela does not write {', '.join(missing)}: compositor nodes that read it get nothing.")
        if layer.use_pass_vector and shutter.is_blurred(scene, layer):
            texts.append("the Vector pass is zero with motion blur, as in Cycles: what moves is blurred already.")
        notes = () if self.is_preview else tuple(Note(f"View layer '{layer.name}'", text) for text in texts)
        if shutter.is_blurred(scene, layer) and not self.is_preview:
            notes += tuple(shutter.notes_of(scene))
        keep = None
        if taken is not None:
            keep = partial(taken.__setitem__, layer.name)
        catches = snapshot.has_catchers and not self.is_preview
        return final.Order(
            shared.renderer, snapshot, settings, wanted_passes(layer, scene),
            parts=_whole_samples if bpy.app.background else samples_in_parts, notes=notes,
            shows=not bpy.app.background and not self.is_preview, started=started, sync_seconds=self._sync_seconds,
            before=_free_old_sessions, given=given.get(layer.name), take=keep,
            moments=self._moments, catches=catches, eyes=eyes,
        )  # fmt: skip

    def _tell(self, progress: final.Progress, result, layer: str):
        """Show how far the render is; returns the result that shows its picture, if there is one yet."""
        self.update_stats("Candela", progress.text)
        if told is not None:
            told(progress)
        if progress.share is not None:
            self.update_progress(progress.share)
        picture = progress.picture if progress.pixels is None else progress.pixels["Combined"]
        if picture is not None and result is None:
            height, width = picture.shape[:2]
            if progress.eye:  # the eyes' cameras were asked for before: the last of them would stay in view
                self.active_view_set(progress.eye)
            result = self.begin_result(0, 0, width, height, layer=layer, view=progress.eye)
        if progress.picture is not None:
            _fill(result, "Combined", progress.eye, picture)
            self.update_result(result)
        return result

    # ------------------------------------------------------------------------------------------------------ bake

    def bake(self, depsgraph, object, pass_type, pass_filter, width, height):  # noqa: A002, as Blender names it
        """Fill the texels of a target that show an object. Blender asks for each object and target."""
        layer = depsgraph.view_layer
        result = self.begin_result(0, 0, width, height, layer=layer.name, view="")
        try:
            pixels = self._baked(depsgraph, object, pass_type, pass_filter, result, width, height)
            combined = _pass_of(result, "Combined")
            combined.rect.foreach_set(np.ascontiguousarray(pixels[..., : combined.channels], np.float32).ravel())
            self.end_result(result)
        except InterruptedError:
            self.end_result(result, cancel=True)
        except (ValueError, RuntimeError, UnsupportedScene) as error:
            self.end_result(result, cancel=True)
            self._fail(str(error))
        except Exception as error:
            self.end_result(result, cancel=True)
            self._fail_unforeseen(error)

    def _baked(self, depsgraph, thing, kind: str, what: int, result, width: int, height: int) -> np.ndarray:
        if bpy.app.background and context.opens_by_a_render():
            raise ValueError(NO_CONTEXT_YET)
        scene, shared = depsgraph.scene, session(depsgraph.scene, "bake")
        from_camera = scene.render.bake.view_from == "ACTIVE_CAMERA" and scene.camera is not None
        view = None if from_camera else seen_by_nobody()
        snapshot = take(depsgraph, shared.cache, width, height, camera=scene.camera, view=view)
        instance = instance_of(snapshot, thing)
        mesh = snapshot.meshes[instance.mesh]
        primitive, differential = (
            _pixels(_pass_of(result, name), height, width) for name in ("BakePrimitive", "BakeDifferential")
        )
        rows = bake.rows_of(mesh, triangles_of(thing, depsgraph))
        points = replace(bake.places(primitive, differential, rows, instance.key), through_camera=from_camera)
        if not (points.triangle >= 0).any():
            return np.zeros((height, width, 4), np.float32)
        if kind in bake.BY_MESH:
            return bake.by_mesh(kind, instance, mesh, points)
        settings = settings_of(scene, viewport=False, layer=depsgraph.view_layer, depsgraph=depsgraph)
        parts = _whole_samples if bpy.app.background else samples_in_parts
        draw = bake.drawing(shared.renderer, parts, main_loop.taken, self.test_break)
        for sentence in bake.left_out(instance, snapshot) if kind in bake.LIT else ():
            self.report({"WARNING"}, one_line(sentence))
        self.update_stats("Candela", f"Baking {thing.name}")
        return bake.baked(kind, what, bake.prepared(snapshot, points, width, height), settings, draw)

    # -------------------------------------------------------------------------------------------------- viewport

    def view_update(self, context, depsgraph):
        """Take note of a change. Comes in the middle of the scene's evaluation: nothing may be drawn here."""
        viewport.changed(self, context, depsgraph)

    def view_draw(self, context, depsgraph):
        """Draw a 3D region, whose framebuffer is bound."""
        viewport.draw(self, context, depsgraph)

    # --------------------------------------------------------------------------------------------------- reports

    def _fail(self, sentence: str) -> None:
        self.report({"ERROR"}, one_line(sentence))

    def _fail_unforeseen(self, error: Exception) -> None:
        self._fail(unforeseen(error))


def eyes_of(scene) -> list[str]:
    """Names of the views that are rendered; one without a name where there is but one."""
    render = scene.render
    if not render.use_multiview:
        return [""]
    used = [view.name for view in render.views if view.use]
    return [name for name in used if name in STEREO] if render.views_format == "STEREO_3D" else used


def _whole_samples(renderer: Renderer, frame: Frame) -> Iterator[None]:
    limit = QueueLimit(frame.profiler, BEHIND_S)
    yield
    while frame.samples_done < frame.samples_to_draw:
        with context.turn:
            renderer.advance(frame)
            if frame.samples_done < frame.samples_to_draw:  # the picture is read next, which waits
                limit.sample()
        yield


def _pass_of(result, name: str):
    return next(one for one in result.layers[0].passes if one.name == name)


def _pixels(render_pass, height: int, width: int) -> np.ndarray:
    """(H, W, channels) float32, bit by bit."""
    found = np.empty(height * width * render_pass.channels, np.float32)
    render_pass.rect.foreach_get(found)
    return found.reshape(height, width, render_pass.channels)


def _fill(result, name: str, eye: str, array: np.ndarray) -> None:
    """Write the pixels of a pass, if Blender has asked for it."""
    render_pass = result.layers[0].passes.find_by_name(name, eye)
    if render_pass is not None:
        render_pass.rect.foreach_set(np.ascontiguousarray(array, np.float32).ravel())
