"""The render engine that Blender sees: thin, owns nothing.

Blender makes two instances per final render and throws viewport instances away on a mode change, so what lives longer
(meshes, programs, accumulated frames) stands in `_sessions`, keyed by scene and use, and for the 3D regions in
viewport.py. All of it is freed in `free_sessions`.
"""

from __future__ import annotations

import time
import traceback
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import bpy
import numpy as np

from . import viewport
from .frame import ledger as ledgers
from .frame import slices
from .frame.bands import Leash, samples_in_parts
from .frame.run import Frame, Renderer
from .gfx import context, images
from .snapshot import SnapshotCache, UnsupportedScene, camera_of_scene, take
from .snapshot.errors import unforeseen
from .snapshot.light_groups import REST, Part, parts_of
from .snapshot.motion import STEPS, Moment, read_moment
from .snapshot.scene import Note, Snapshot
from .techniques import make_registry
from .techniques.film import check_tree
from .ui import ENGINE, light_groups
from .ui.passes import CAMERA_AXES, GLARE, RenderPass, cryptomatte_metadata, missing_passes, wanted_passes
from .ui.properties import settings_of

AFTER_LAST = 1.0  # time of what follows the last sample (denoising, reading back), at most, by that of a sample
MOST_SESSIONS = 4  # scenes, and icons of materials, whose meshes, programs and images stay for their next picture
BEHIND_S = 0.5  # what the GPU may be behind in a render in the background

STEREO = ("left", "right")


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
    viewport.free_all()
    for shared in _sessions.values():
        shared.renderer.release()
    _sessions.clear()
    images.pool.trim()


@bpy.app.handlers.persistent
def _another_file(*_) -> None:
    free_sessions()


def register() -> None:
    bpy.utils.register_class(CandelaEngine)
    bpy.app.handlers.load_post.append(_another_file)


def unregister() -> None:
    bpy.app.handlers.load_post.remove(_another_file)
    bpy.utils.unregister_class(CandelaEngine)
    free_sessions()
    context.release_all()


class CandelaEngine(bpy.types.RenderEngine):
    """Real-time global illumination, sample by sample."""

    bl_idname = ENGINE
    bl_label = "Candela"
    bl_use_preview = True
    bl_use_gpu_context = True
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
        """Read the scene while Blender keeps it locked."""
        started = time.perf_counter()
        scene = depsgraph.scene
        shared = session(scene, "preview" if self.is_preview else "final")
        self._snapshot = None
        self.update_stats("Candela", "Reading the scene")
        try:
            around = self._frames_around(depsgraph) if depsgraph.view_layer.use_pass_vector else None
            size = self.resolution_x, self.resolution_y
            self._snapshot = take(depsgraph, shared.cache, *size, camera=self.camera_override, around=around)
        except UnsupportedScene as error:
            self._fail(str(error))
        except Exception as error:  # Blender would print it and go on with a black picture
            self._fail_unforeseen(error)
        self._sync_seconds = time.perf_counter() - started

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
        """Draw all samples and hand the passes to Blender. The GPU context is active, and ends afterwards."""
        snapshot = getattr(self, "_snapshot", None)
        if snapshot is not None:
            with images.passing_context():
                for eye in eyes(depsgraph.scene):
                    self._render(depsgraph, snapshot, eye)
                    if self.test_break():
                        break

    def _seen(self, depsgraph, snapshot: Snapshot, eye: str) -> Snapshot:
        """The same scene through the camera of a view, where there are several."""
        if not eye:
            return snapshot
        self.active_view_set(eye)
        scene, film = depsgraph.scene_eval, snapshot.film
        camera = self.camera_override or scene.camera
        placed = np.array(self.camera_model_matrix(camera), np.float64).reshape(4, 4)
        shift = self.camera_shift_x(camera)
        view = camera_of_scene(scene, depsgraph, film.width, film.height, camera, placed, shift)
        return replace(snapshot, camera=view)

    def _render(self, depsgraph, snapshot: Snapshot, eye: str) -> None:
        started = time.perf_counter()
        scene, layer = depsgraph.scene, depsgraph.view_layer
        shared = session(scene, "preview" if self.is_preview else "final")
        settings = settings_of(scene, viewport=False, preview=self.is_preview, layer=layer, depsgraph=depsgraph)
        try:
            check_tree(settings.passes)
            snapshot = self._seen(depsgraph, snapshot, eye)
            parts = [Part(REST, snapshot, True)] if self.is_preview else parts_of(snapshot)
            wanted, total, result = wanted_passes(layer, scene), light_groups.Sum(snapshot.film), None
            for number, part in enumerate(parts):
                before = shared.renderer.frame
                with context.turn:
                    _free_old_sessions()
                    frame = shared.renderer.begin(part.snapshot, settings, self._compiling)
                    if before is not None and before.size != frame.size:
                        images.pool.trim()  # nobody asks for images of the old size again
                frame.ledger.times["sync"] = self._sync_seconds
                frame.ledger.notes += self._about_passes(layer, parts)
                if result is None:
                    result = self.begin_result(0, 0, *frame.size, layer=layer.name, view=eye)
                drawn = self._drawn(shared.renderer, frame, started, number, len(parts))
                own = str(number) if len(parts) > 1 else ""  # under which a slice holds the part's images
                for _ in self._merged(shared.renderer, frame, layer.name, own) or drawn:
                    if self.test_break():
                        self.end_result(result, cancel=True)
                        with context.turn:
                            shared.renderer.finish(frame, ())
                        return
                with context.turn:
                    if taken is not None:
                        taken[layer.name] = slices.taken(frame, own, taken.get(layer.name))
                    total.add(part, _finished(shared.renderer, frame, wanted))
            for name, array in _pixels(total, frame, wanted).items():
                render_pass = result.layers[0].passes.find_by_name(name, eye)
                if render_pass is not None:
                    render_pass.rect.foreach_set(np.ascontiguousarray(array, np.float32).ravel())
            for field_name, text in cryptomatte_metadata(snapshot, layer.name).items():
                self.get_result().stamp_data_add_field(field_name, text)
            self.end_result(result)
        except (ValueError, RuntimeError) as error:
            self._fail(str(error))
            return
        except Exception as error:
            self._fail_unforeseen(error)
            return
        ledger = ledgers.latest()
        ledger.times["total"] = time.perf_counter() - started + self._sync_seconds
        if not self.is_preview:
            for note in ledger.notes:
                self.report({"WARNING"}, str(note))
            if ledger.bad_pixels:
                self.report({"WARNING"}, f"{ledger.bad_pixels} values were not finite and were set to 0.")

    # -------------------------------------------------------------------------------------------------- viewport

    def view_update(self, context, depsgraph):
        """Take note of a change. Comes in the middle of the scene's evaluation: nothing may be drawn here."""
        viewport.changed(self, context, depsgraph)

    def view_draw(self, context, depsgraph):
        """Draw a 3D region, whose framebuffer is bound."""
        viewport.draw(self, context, depsgraph)

    # --------------------------------------------------------------------------------------------------- reports

    def _about_passes(self, layer, parts: list[Part]) -> tuple[Note, ...]:
        """What is to be said of the passes that a view layer asks for."""
        missing, subject = missing_passes(layer), f"View layer '{layer.name}'"
        if missing and not self.is_preview:
            text = f"Candela does not write {', '.join(missing)}: compositor nodes that read it get nothing."
            return (Note(subject, text),)
        if len(parts) > 1 and light_groups.GLARE in [asked.source for asked in wanted_passes(layer, layer.id_data)]:
            return (Note(subject, "glare is that of each light group for itself: without groups it is whole."),)
        return ()

    def _drawn(self, renderer: Renderer, frame: Frame, started: float, number: int = 0, of: int = 1) -> Iterator[None]:
        """Draw all samples: one after the other, or in parts for a window that has to answer meanwhile.

        With a time limit, counted from `started`, only as many as it allows: room is left for what follows the last.
        Part `number` of a picture that is drawn in several has its share of the time that is left.
        """
        limit = frame.settings.time_limit
        if limit:
            passed = time.perf_counter() - started
            limit = passed + max(limit - passed, 0.0) / (of - number)
        first, before = time.perf_counter(), frame.samples_done
        parts = _whole_samples if bpy.app.background else samples_in_parts
        shown = -1
        for _ in parts(renderer, frame):
            if frame.samples_done != shown:
                shown = frame.samples_done
                wanted = frame.settings.samples_to_draw
                self.update_stats("Candela", f"Rendering {shown} / {wanted} samples")
                self.update_progress((number + shown / wanted) / of)
                if limit and shown > before:
                    with context.turn:
                        images.finish()
                        now = time.perf_counter()
                        each = (now - first) / (shown - before)
                        if shown < wanted and now - started + (1 + AFTER_LAST) * each > limit:
                            renderer.stop(frame)
                            return
            yield

    def _merged(self, renderer: Renderer, frame: Frame, layer: str, part: str = "") -> list[None]:
        """Parts in which a picture of samples that were drawn before is finished; none where they are to be drawn."""
        if layer not in given:
            return []
        with context.turn:
            renderer.merge(frame, slices.images_of_part(given[layer], part))
        return [None]

    def _compiling(self, done: int, total: int) -> bool:
        self.update_stats("Candela", f"Compiling shaders {done} of {total}")
        return self.test_break()

    def _fail(self, sentence: str) -> None:
        self.error_set(sentence)
        self.report({"ERROR"}, sentence)

    def _fail_unforeseen(self, error: Exception) -> None:
        traceback.print_exc()
        self._fail(unforeseen(error))


def eyes(scene) -> list[str]:
    """Names of the views that are rendered; one without a name where there is but one."""
    render = scene.render
    if not render.use_multiview:
        return [""]
    used = [view.name for view in render.views if view.use]
    return [name for name in used if name in STEREO] if render.views_format == "STEREO_3D" else used


def _whole_samples(renderer: Renderer, frame: Frame) -> Iterator[None]:
    leash = Leash(frame.profiler, BEHIND_S)
    while frame.samples_done < frame.settings.samples_to_draw:
        yield
        with context.turn:
            renderer.advance(frame)
            if frame.samples_done < frame.settings.samples_to_draw:  # the picture is read next, which waits
                leash.sample()


# ------------------------------------------------------------------------------------------------------------- passes


def _finished(renderer: Renderer, frame: Frame, wanted: list[RenderPass]) -> dict[str, np.ndarray]:
    """Mean images of the frame that passes are made from."""
    renderer.show(frame)
    sources = {"film.combined", *(name for asked in wanted for name in asked.images)}
    arrays = renderer.finish(frame, sorted(light_groups.frame_images(sources)))
    if GLARE.source not in frame.images:  # an eye that no plan could use: the pass shows what it would look at
        arrays[GLARE.source] = arrays["film.combined"]
    return arrays


def _pixels(total: light_groups.Sum, frame: Frame, wanted: list[RenderPass]) -> dict[str, np.ndarray]:
    """Pass pixels by Blender's name, (H, W, channels) float32."""
    arrays = total.finished({name for asked in wanted for name in asked.images})
    arrays[CAMERA_AXES] = frame.snapshot.camera.matrix[:3, :3] * (1.0, 1.0, -1.0)
    pixels = {asked.name: asked.pixels(arrays, frame.snapshot.film.exposure) for asked in wanted}
    return {"Combined": arrays["film.combined"], **pixels}
