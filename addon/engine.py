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
from .film import catcher
from .film.noise import NoiseMeter
from .frame import ledger as ledgers
from .frame import slices, time_steps
from .frame.bands import Leash, samples_in_parts
from .frame.run import Frame, Renderer
from .gfx import context, images
from .snapshot import SnapshotCache, UnsupportedScene, camera_of_scene, motion, take
from .snapshot.errors import unforeseen
from .snapshot.scene import Note, Snapshot
from .techniques import make_registry
from .techniques.film import check_tree
from .ui import ENGINE
from .ui.passes import CATCHER, GLARE, RenderPass, missing_passes, wanted_passes
from .ui.properties import settings_of

AFTER_LAST = 1.0  # time of what follows the last sample (denoising, reading back), at most, by that of a sample
MOST_SESSIONS = 4  # scenes, and icons of materials, whose meshes, programs and images stay for their next picture
PICTURES_OF_CATCHERS = 3  # of which a picture with shadow catchers is made: each has a part of the time
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
        self._snapshot = self._moments = None
        self.update_stats("Candela", "Reading the scene")
        try:
            self._snapshot = self._take(depsgraph, shared)
            if motion.is_blurred(scene, depsgraph.view_layer) and not self.is_preview:
                self._moments = self._take_moments(depsgraph, shared)
        except UnsupportedScene as error:
            self._fail(str(error))
        except Exception as error:  # Blender would print it and go on with a black picture
            self._fail_unforeseen(error)
        self._sync_seconds = time.perf_counter() - started

    def _take(self, depsgraph, shared: Session) -> Snapshot:
        return take(depsgraph, shared.cache, self.resolution_x, self.resolution_y, camera=self.camera_override)

    def _take_moments(self, depsgraph, shared: Session) -> motion.Moments | None:
        """The scene while the shutter is open, where anything moves. It is evaluated now, while Blender keeps it."""
        scene = depsgraph.scene
        settings = settings_of(scene, viewport=False, layer=depsgraph.view_layer, depsgraph=depsgraph)
        own = scene.frame_current + scene.frame_subframe

        def moved_to(time: float) -> None:
            frame, subframe = divmod(own + time, 1.0)
            self.frame_set(int(frame), subframe)

        times = motion.shutter_times(scene, min(settings.motion_steps, settings.samples))
        return motion.take_moments(self._snapshot, times, moved_to, lambda: self._take(depsgraph, shared))

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
            before = shared.renderer.frame
            plates = None
            if catcher.has_catchers(snapshot) and not self.is_preview:
                if taken is not None or given or settings.is_slice:
                    raise ValueError("A picture with shadow catchers cannot be rendered in slices: render it whole.")
                found = self._plates(shared.renderer, snapshot, settings, eye)
                if found is None:
                    return
                settings, plates = found
                snapshot, started = catcher.catchers_unseen(snapshot), time.perf_counter()
            seen_as = catcher.catchers_unseen if plates else None
            steps = [] if layer.name in given else self._steps(snapshot, settings, eye, seen_as)
            with context.turn:
                _free_old_sessions()
                frame = self._begun(shared.renderer, snapshot, steps, settings)
                if before is not None and before.size != frame.size:
                    images.pool.trim()  # nobody asks for images of the old size again
            frame.ledger.times["sync"] = self._sync_seconds
            if steps and settings.noise_threshold:
                text = "the noise threshold does not count where something moves: all samples are drawn."
                frame.ledger.notes += (Note("Motion blur", text),)
            missing = missing_passes(layer)
            if missing and not self.is_preview:
                text = f"Candela does not write {', '.join(missing)}: compositor nodes that read it get nothing."
                frame.ledger.notes += (Note(f"View layer '{layer.name}'", text),)
            width, height = frame.size
            result = self.begin_result(0, 0, width, height, layer=layer.name, view=eye)
            drawn = self._drawn(shared.renderer, frame, steps, settings, started)
            for _ in self._merged(shared.renderer, frame, layer.name) or drawn:
                if self.test_break():
                    self.end_result(result, cancel=True)
                    with context.turn:
                        shared.renderer.finish(shared.renderer.frame, ())
                    return
            wanted = wanted_passes(layer, scene)
            if frame is not shared.renderer.frame:  # the last of several, one for each time step
                ledger, frame = frame.ledger, shared.renderer.frame
                frame.ledger.times |= ledger.times
                frame.ledger.notes = ledger.notes
            with context.turn:
                if taken is not None:
                    taken[layer.name] = slices.taken(frame)
                pixels = _finished(shared.renderer, frame, wanted, plates)
            for name, array in pixels.items():
                render_pass = result.layers[0].passes.find_by_name(name, eye)
                if render_pass is not None:
                    render_pass.rect.foreach_set(np.ascontiguousarray(array, np.float32).ravel())
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

    def _begun(self, renderer: Renderer, snapshot: Snapshot, steps: list[time_steps.Step], settings) -> Frame:
        """The frame of a picture, or of the first of its time steps."""
        if not steps:
            return renderer.begin(snapshot, settings, self._compiling)
        # What Denoise keeps for a picture that may end early counts the samples of one step.
        unlimited = replace(settings, time_limit=0.0, noise_threshold=0.0)
        return renderer.begin(steps[0].snapshot, unlimited, self._compiling, steps[0].numbers)

    def _drawn(
        self, renderer: Renderer, frame: Frame, steps: list[time_steps.Step], settings, started: float
    ) -> Iterator[None]:
        """Draw all samples of a frame, or of the time steps of which it is the first."""
        if steps:
            return self._drawn_in_steps(renderer, steps, settings, started)
        return self._drawn_at_once(renderer, frame, started)

    def _drawn_at_once(self, renderer: Renderer, frame: Frame, started: float) -> Iterator[None]:
        """Draw all samples: one after the other, or in parts for a window that has to answer meanwhile.

        With a time limit, counted from `started`, only as many as it allows: room is left for what follows the last.
        """
        limit, first, before = frame.settings.time_limit, time.perf_counter(), frame.samples_done
        meter = NoiseMeter(frame.settings.noise_threshold) if frame.settings.noise_threshold else None
        parts = _whole_samples if bpy.app.background else samples_in_parts
        shown = -1
        for _ in parts(renderer, frame):
            if frame.samples_done != shown:
                shown = frame.samples_done
                wanted = frame.settings.samples_to_draw
                self.update_stats("Candela", f"Rendering {shown} / {wanted} samples")
                self.update_progress(shown / wanted)
                if meter is not None and shown < wanted:
                    with context.turn:
                        if meter.look(frame):
                            renderer.stop(frame)
                            return
                if limit and shown > before:
                    with context.turn:
                        images.finish()
                        now = time.perf_counter()
                        each = (now - first) / (shown - before)
                        if shown < wanted and now - started + (1 + AFTER_LAST) * each > limit:
                            renderer.stop(frame)
                            return
            yield

    def _plates(self, renderer: Renderer, snapshot: Snapshot, settings, eye: str) -> tuple | None:
        """The settings with which the last of three pictures is drawn, and what it is composed with: the pictures with
        all and with shadow catchers alone (catcher.Layer), and whether the film is transparent. None if the render was
        cancelled. The first picture tells how many samples all have."""
        found = []
        settings = replace(settings, time_limit=settings.time_limit / PICTURES_OF_CATCHERS)
        for changed in (catcher.over_nothing, catcher.catchers_alone):
            shown = changed(snapshot)
            steps, started = self._steps(shown, settings, eye, changed), time.perf_counter()
            with context.turn:
                frame = self._begun(renderer, shown, steps, settings)
            for _ in self._drawn(renderer, frame, steps, settings, started):
                if self.test_break():
                    return None
            with context.turn:
                frame = renderer.frame
                renderer.show(frame)
                found.append(catcher.layer(renderer.finish(frame, catcher.IMAGES), shown))
            settings = replace(settings, samples=frame.samples_done, time_limit=0.0, noise_threshold=0.0)
        return settings, (*found, snapshot.film.transparent)

    def _steps(self, snapshot: Snapshot, settings, eye: str, changed=None) -> list[time_steps.Step]:
        """Time steps of a picture with motion blur; none where nothing moves. All are seen through the camera of an
        eye, where there are several, which is that of the frame itself."""
        moments = self._moments
        if moments is None:
            return []
        snapshots = [changed(one) for one in moments.snapshots] if changed else moments.snapshots
        if eye:
            snapshots = [replace(one, camera=snapshot.camera) for one in snapshots]
        return time_steps.shared_out(snapshots, moments.steps, settings)

    def _drawn_in_steps(
        self, renderer: Renderer, steps: list[time_steps.Step], settings, started: float
    ) -> Iterator[None]:
        """The same of a picture with motion blur."""
        parts = _whole_samples if bpy.app.background else samples_in_parts
        first, wanted, shown = time.perf_counter(), settings.samples_to_draw, -1
        unlimited = replace(settings, time_limit=0.0, noise_threshold=0.0)
        for done, stop in time_steps.drawn(renderer, steps, unlimited, parts, self._compiling):
            if done != shown:
                shown = done
                self.update_stats("Candela", f"Rendering {shown} / {wanted} samples")
                self.update_progress(shown / wanted)
                if settings.time_limit and shown:
                    with context.turn:
                        images.finish()
                    now = time.perf_counter()
                    each = (now - first) / shown
                    # A step that follows learns in one more sample.
                    if shown < wanted and now - started + (2 + AFTER_LAST) * each > settings.time_limit:
                        stop()
            yield

    def _merged(self, renderer: Renderer, frame: Frame, layer: str) -> list[None]:
        """Parts in which a picture of samples that were drawn before is finished; none where they are to be drawn."""
        if layer not in given:
            return []
        with context.turn:
            renderer.merge(frame, given[layer])
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
    while frame.samples_done < frame.samples_to_draw:
        yield
        with context.turn:
            renderer.advance(frame)
            if frame.samples_done < frame.samples_to_draw:  # the picture is read next, which waits
                leash.sample()


# ------------------------------------------------------------------------------------------------------------- passes


def _finished(
    renderer: Renderer, frame: Frame, wanted: list[RenderPass], plates: tuple | None = None
) -> dict[str, np.ndarray]:
    """Pass pixels by Blender's name, (H, W, channels) float32. `plates`: the two other pictures of a scene with shadow
    catchers, and whether its film is transparent."""
    renderer.show(frame)
    names = {"film.combined", *(name for asked in wanted for name in asked.images)} | set(
        catcher.IMAGES if plates else ()
    )
    arrays = renderer.finish(frame, sorted(names - set(CATCHER.images)))
    arrays[CATCHER.source] = np.ones_like(arrays["film.combined"][..., :3])
    if plates:
        everything, plate, transparent = plates
        things = catcher.layer(arrays, frame.snapshot)
        arrays[CATCHER.source] = change = catcher.change_of(everything, plate, things, transparent)
        arrays["film.combined"] = catcher.composed(change, everything, things, transparent, CATCHER in wanted)
    if GLARE.source not in frame.images:  # an eye that no plan could use: the pass shows what it would look at
        arrays[GLARE.source] = arrays["film.combined"]
    pixels = {asked.name: asked.pixels(arrays, frame.snapshot.film.exposure) for asked in wanted}
    return {"Combined": arrays["film.combined"], **pixels}
