"""The viewport: each 3D region's picture, coarse while it changes, refined sample by sample while it rests.

Blender calls `view_update` in the middle of its dependency-graph evaluation, where nothing may be drawn: `changed`
only records. All work is done by `draw`, which Blender calls whenever the region is drawn. One call adds samples for a
short time, shows what there is and asks to be called again until the picture is complete, so that Blender keeps
answering.

Engine instances come and go with the shading mode and with each frame of an animation. What they share lives in
`_viewports`, one `Viewport` for each region and scene, and is freed a moment after the last instance has gone: not by
the instance's end itself, which may come where no GPU context is, but by a timer of Blender's main loop.
"""

from __future__ import annotations

import threading
import time
import traceback
import weakref
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import bpy
import gpu

from . import techniques
from .frame.run import Frame, Renderer
from .frame.settings import Settings
from .gfx import context as gpu_context
from .gfx import images, library
from .snapshot import SnapshotCache, UnsupportedScene, camera_of_view, take
from .snapshot.scene import Camera, Snapshot
from .techniques.film import resolve
from .ui import notes
from .ui.properties import settings_of

STEP_S = 0.1  # what a sample may take while the picture changes: coarser pixels are drawn to stay below it
BUDGET_S = 0.05  # one redraw adds samples until this is spent, and at least one
REST_S = 0.25  # without a change for so long, the picture is drawn in full resolution
SCALES = (1, 2, 4, 8)  # screen pixels per side of a drawn pixel
FREE_AFTER_S = 1.0  # a mode or frame change makes the next engine instance well within this time

# GPU programs hold the constants of their next draw, for all contexts together. A final render draws from a thread of
# its own, so whoever draws takes a turn; the longest turn is one sample.
turn = threading.Lock()
TURN_WAIT_S = 0.02


_spare: list[Renderer] = []


def spare_renderer() -> Renderer:
    """A renderer that holds nothing. Old ones first: they stay listed for release until Candela ends."""
    return _spare.pop() if _spare else Renderer(techniques.make_registry)


def set_aside(renderer: Renderer) -> None:
    """Free what a renderer holds, and keep it for the next one who needs one."""
    renderer.release()
    _spare.append(renderer)


@dataclass
class Pace:
    """Which scale keeps a step below STEP_S, learned from what steps took."""

    cost: dict[int, float] = field(default_factory=dict)  # seconds of a sample, by scale

    def learn(self, scale: int, seconds: float) -> None:
        """Take note of a sample's time; single slow ones count less than lasting ones."""
        known = self.cost.get(scale, seconds)
        self.cost[scale] = 0.5 * (known + seconds)

    def expected(self, scale: int) -> float | None:
        """Seconds of a sample: measured, and never more than a finer one took. None if nothing is known yet."""
        guesses = [self.cost[finer] for finer in SCALES if finer <= scale and finer in self.cost]
        guesses += [seconds / (scale / finer) ** 2 for finer, seconds in self.cost.items() if scale not in self.cost]
        return min(guesses, default=None)

    def scale(self) -> int:
        """The finest scale that is fast enough; the last but one for a scene never drawn."""
        if not self.cost:
            return SCALES[-2]
        return next((scale for scale in SCALES if self.expected(scale) <= STEP_S), SCALES[-1])


class Viewport:
    """What one region shows of one scene: its own samples, and the scene's content as it was read last."""

    def __init__(self):
        self.renderer = spare_renderer()
        self.cache = SnapshotCache()
        self.pace = Pace()
        self.dirty = True  # the scene may have changed since the snapshot
        self.picture: images.Image | None = None
        self.frame: Frame | None = None
        self.scale = SCALES[-2]
        self.seconds = 0.0  # spent on the samples of this picture
        self.error = ""
        self.owner: Callable = lambda: None  # weak reference to the engine instance that draws it
        self._snapshot: Snapshot | None = None
        self._asked: tuple | None = None
        self._size = (0, 0)  # of the region when the frame was begun
        self._changed_at = 0.0
        self._finished = False
        self._compiled = -1  # programs made so far, at the end of the last sample
        self.local_view = False
        self.news = False  # a ledger that the panels do not show yet
        self.reported = ""  # the error that was reported last

    @property
    def done(self) -> bool:
        """Nothing is left to be drawn until something changes."""
        return bool(self.error) or self._finished

    def status(self) -> str:
        """How far the picture is, for the text in the region's corner."""
        if self.error:
            return self.error
        if self.frame is None:
            return "Waiting for the GPU"
        coarse = f", 1/{self.scale} resolution" if self.scale > 1 else ""
        return f"Sample {self.frame.samples_done} of {self.frame.settings.samples}, {self.seconds:.1f} s{coarse}"

    def attach(self, engine) -> None:
        """A new engine instance draws this from now on. What happened before it came is unknown: read all graphs."""
        self.owner = weakref.ref(engine)
        self.cache.graphs.clear()
        self.dirty = True
        weakref.finalize(engine, _free_soon).atexit = False

    def draw_frame(
        self,
        source: Callable[[Camera, int, int], Snapshot],
        camera: Camera,
        size: tuple[int, int],
        settings: Settings,
        clock: Callable[[], float] = time.perf_counter,
    ) -> images.Image:
        """Add samples to the picture of `camera` for BUDGET_S and return it: scene-linear, premultiplied.

        The picture may be coarser than `size` while the view or the scene changes. `source(camera, width, height)`
        reads the scene and is asked only when it may have changed. Whatever the renderer raises goes through.
        """
        self._prepare(source, camera, size, settings, clock)
        frame, started = self.frame, clock()
        drawn = False
        while frame.samples_done < settings.samples:
            before = clock()
            self.renderer.advance(frame)
            frame.profiler.finish()
            cost = clock() - before
            if library.compile_count == self._compiled:  # the first draw of a new program takes the driver's time
                self.pace.learn(self.scale, cost)
            self._compiled = library.compile_count
            drawn = True
            if clock() - started + cost > BUDGET_S:
                break
        if drawn:
            self.picture = resolve(frame)
        self.seconds += clock() - started
        if self.scale == 1 and frame.samples_done >= settings.samples and not self._finished:
            self._finished = True
            self.renderer.finish(frame, ())  # publishes the ledger
            frame.ledger.times["total"] = self.seconds
            images.pool.trim()  # what only moving views needed
            self.news = True
        return self.picture

    def _prepare(self, source, camera: Camera, size: tuple[int, int], settings: Settings, clock) -> None:
        """Bring `self.frame` to what is asked: kept if nothing changed, else begun anew at a fitting scale."""
        asked = (_view_key(camera), size, settings)
        moved = asked != self._asked
        if self.dirty:
            self._snapshot = source(camera, *size)
            self.dirty = False
            if not moved:  # most updates change nothing that is drawn: selections, names, other scenes' settings
                before = self.frame
                if self._begin(camera, size, settings, self.scale) is before:
                    return
                moved = True
        if moved:
            self._asked = asked
            self._changed_at = clock()
            self._begin(camera, size, settings, self.pace.scale())
        elif self.scale > 1 and clock() - self._changed_at > REST_S:
            self._begin(camera, size, settings, 1)

    def _begin(self, camera: Camera, size: tuple[int, int], settings: Settings, scale: int) -> Frame:
        width, height = (max(-(-extent // scale), 1) for extent in size)
        film = replace(self._snapshot.film, width=width, height=height, border=(0, 0, width, height))
        frame = self.renderer.begin(replace(self._snapshot, camera=camera, film=film), settings)
        if frame is not self.frame:
            if size != self._size:
                images.pool.trim()  # nobody will ask for the images of the old size again
            self.frame, self.scale, self._size = frame, scale, size
            self.seconds, self._finished = 0.0, False
        elif frame.samples_done < settings.samples:
            self._finished = False
        notes.publish((*frame.snapshot.notes, *frame.materials.notes))
        return frame

    def release(self) -> None:
        """Free everything on the GPU and all that was read of the scene; this viewport is not used again."""
        set_aside(self.renderer)
        self.cache.clear()
        self.frame = self.picture = self._snapshot = None


def _view_key(camera: Camera) -> tuple:
    return camera.matrix.tobytes(), camera.kind, camera.frame, camera.clip_start, camera.clip_end


# -------------------------------------------------------------------------------------------------- Blender's callbacks

_viewports: dict[tuple[int, int], Viewport] = {}  # by address of the region and session_uid of the scene


def _viewport_of(engine, context, depsgraph) -> Viewport:
    key = (context.region.as_pointer(), depsgraph.scene.original.session_uid)
    viewport = _viewports.get(key)
    if viewport is None:
        viewport = _viewports[key] = Viewport()
    if viewport.owner() is not engine:
        viewport.attach(engine)
    return viewport


def changed(engine, context, depsgraph) -> None:
    """The scene may have changed: remember what Blender says about it. Draws nothing, allocates nothing."""
    viewport = _viewport_of(engine, context, depsgraph)
    viewport.dirty = True
    viewport.error = ""
    if viewport.frame is not None:
        viewport.cache.invalidate(depsgraph.updates)


def draw(engine, context, depsgraph) -> None:
    """Draw the region: add samples, show the picture, and ask for another call until it is complete."""
    viewport = _viewport_of(engine, context, depsgraph)
    region, scene = context.region, depsgraph.scene
    size = (max(region.width, 1), max(region.height, 1))
    if not viewport.error:
        if turn.acquire(timeout=TURN_WAIT_S):
            try:
                _refine(viewport, engine, context, depsgraph, size)
            finally:
                turn.release()
        else:
            engine.tag_redraw()  # a final render is drawing a sample
    if viewport.picture is not None:
        _show(engine, scene, viewport.picture, size)
    engine.update_stats("Candela", viewport.status())
    if not viewport.done:
        engine.tag_redraw()
    elif viewport.news:
        viewport.news = False
        for area in context.screen.areas:
            if area.type == "PROPERTIES":
                area.tag_redraw()  # the Frame panel shows this picture's ledger


def _refine(viewport: Viewport, engine, context, depsgraph, size: tuple[int, int]) -> None:
    space, region_data = context.space_data, context.region_data
    looks_through = None
    if region_data.view_perspective == "CAMERA":
        looks_through = space.camera if space.use_local_camera else depsgraph.scene.camera
        if looks_through is not None and looks_through.type != "CAMERA":
            looks_through = None
    shown = None
    if space.local_view is not None:
        shown = lambda shown_object: shown_object.visible_in_viewport_get(space)  # noqa: E731
    if viewport.local_view != (shown is not None):
        viewport.local_view = shown is not None
        viewport.dirty = True

    def source(camera: Camera, width: int, height: int) -> Snapshot:
        return take(depsgraph, viewport.cache, width, height, view=camera, shown=shown)

    blend, depth_test, depth_mask = gpu.state.blend_get(), gpu.state.depth_test_get(), gpu.state.depth_mask_get()
    try:
        camera = camera_of_view(region_data, space, looks_through)
        viewport.draw_frame(source, camera, size, settings_of(depsgraph.scene, viewport=True))
    except (UnsupportedScene, ValueError, RuntimeError) as error:
        _fail(viewport, engine, str(error))
    except Exception as error:
        # An error of Candela's own. Raised further it would come again with every redraw.
        traceback.print_exc()
        _fail(viewport, engine, f"{type(error).__name__}: {error}. The console holds the details; please report this.")
    finally:
        gpu.state.blend_set(blend)
        gpu.state.depth_test_set(depth_test)
        gpu.state.depth_mask_set(depth_mask)


def _fail(viewport: Viewport, engine, sentence: str) -> None:
    """Stop drawing until the scene changes; the sentence stands in the region, and once in Blender's reports."""
    viewport.picture = None
    viewport.dirty = True
    if viewport.reported != sentence:
        engine.report({"ERROR"}, sentence)
    viewport.error = viewport.reported = sentence


def _show(engine, scene, picture: images.Image, size: tuple[int, int]) -> None:
    """Draw the picture over the region, with the scene's colour management."""
    from gpu_extras.presets import draw_texture_2d

    gpu.state.blend_set("ALPHA_PREMULT")
    engine.bind_display_space_shader(scene)
    draw_texture_2d(picture.texture, (0, 0), *size)
    engine.unbind_display_space_shader()
    gpu.shader.unbind()
    gpu.state.blend_set("NONE")


def _free_soon() -> None:
    if not bpy.app.timers.is_registered(_free_orphans):
        bpy.app.timers.register(_free_orphans, first_interval=FREE_AFTER_S)


def _free_orphans() -> float | None:
    """Free the viewports that no engine instance draws any more; runs in Blender's main loop."""
    orphans = [key for key, viewport in _viewports.items() if viewport.owner() is None]
    if not orphans:
        return None
    if not gpu_context.available() or not turn.acquire(blocking=False):
        return FREE_AFTER_S  # later
    try:
        for key in orphans:
            _viewports.pop(key).release()
        images.pool.trim()
    finally:
        turn.release()
    return None


def free_all() -> None:
    """Free every viewport; those that are still open begin anew with their next redraw."""
    for viewport in _viewports.values():
        viewport.release()
    _viewports.clear()
    if bpy.app.timers.is_registered(_free_orphans):
        bpy.app.timers.unregister(_free_orphans)
