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

import time
import traceback
import weakref
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from math import ceil, floor

import bpy
import gpu
import numpy as np

from . import techniques
from .frame.bands import Bands
from .frame.picture import Frame
from .frame.run import Renderer
from .frame.settings import Settings
from .gfx import context as gpu_context
from .gfx import images, library, passes
from .gfx.context import turn
from .snapshot import SnapshotCache, UnsupportedScene, camera_of_scene, camera_of_view, take
from .snapshot.errors import unforeseen
from .snapshot.scene import Camera, Snapshot
from .techniques.film import check_tree
from .ui.properties import settings_of

STEP_S = 0.08  # what a step may take while the picture changes, to stay below 0.1 s: coarser pixels are drawn for it
BUDGET_S = 0.05  # one redraw works until this is spent; what it has begun by then is finished
MOST_BUDGET_S = 0.25  # where Blender itself takes long to draw its window, as with a software GPU, work as long as it
REST_S = 0.25  # without a change for so long, or for two redraws, the picture is drawn in full resolution
SCALES = (1, 2, 4, 8, 16)  # screen pixels per side of a drawn pixel; all but the first are drafts
FREE_AFTER_S = 1.0  # a mode or frame change makes the next engine instance well within this time

TURN_WAIT_S = 0.1  # for the GPU, while a final render draws a part of a sample


@dataclass
class Pace:
    """Which scale keeps a step below STEP_S, learned from what steps took."""

    cost: dict[int, float] = field(default_factory=dict)  # seconds of a sample, by scale

    def learn(self, scale: int, seconds: float) -> None:
        """Take note of a sample's time; single slow ones count less than lasting ones."""
        known = self.cost.get(scale, seconds)
        self.cost[scale] = 0.5 * (known + seconds)

    def expected(self, scale: int) -> float | None:
        """Seconds of a sample: measured, and never more than a finer one took. None if nothing is known yet.

        Drafts do less for a pixel than full resolution, so they tell nothing about it.
        """
        guesses = [self.cost[finer] for finer in SCALES if finer <= scale and finer in self.cost]
        if scale > 1 and scale not in self.cost:
            guesses += [seconds / (scale / other) ** 2 for other, seconds in self.cost.items()]
        return min(guesses, default=None)

    def scale(self, before: float = 0.0) -> int:
        """The finest scale that is fast enough when `before` seconds of the step are spent already; the last but one
        for a scene never drawn."""
        if not self.cost:
            return SCALES[-2]
        left = STEP_S - before
        return next((scale for scale in SCALES if (self.expected(scale) or np.inf) <= left), SCALES[-1])


class Viewport:
    """What one region shows of one scene: its own samples, and the scene's content as it was read last."""

    def __init__(self):
        self.renderer = Renderer(techniques.make_registry)
        self.cache = SnapshotCache()
        self.pace = Pace()
        self.bands = Bands()
        self.dirty = True  # the scene may have changed since the snapshot
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
        self._target: images.Target | None = None  # the picture, apart from the frame's images, which come and go
        self._shown_with: tuple = ()  # what the picture was shown with, see Frame.shown_with
        self._waits = False  # what is shown is this view of this scene, only coarser
        self.place = (0, 0, 1, 1)  # where the picture lies, in pixels of the region: x, y, width, height
        self._sample: Iterator | None = None  # what is left of a sample that was begun
        self._sample_seconds = self._beginning = 0.0  # `_beginning`: what the frame took before its first sample
        self._pauses = (0.0, 0.0)  # between the last redraws
        self._left_at: float | None = None  # when the last redraw ended, if it left something to be done
        self._compiled = -1  # programs made so far, when the sample was begun
        self.paused = False  # the artist wants no more samples for now
        self.hidden: tuple = ()  # what the region's own settings hide, see _hidden
        self.news = False  # a ledger that the panels do not show yet
        self.reported = ""  # the error that was reported last
        self.failed_at: tuple | None = None  # the region's size and kind of view when the error came

    @property
    def picture(self) -> images.Image | None:
        """What the region shows: the last whole sample and those before it; None before the first."""
        return self._target.colors[0] if self._target else None

    @property
    def done(self) -> bool:
        """Nothing is left to be drawn until something changes."""
        return bool(self.error) or self._finished or self.paused

    def status(self) -> str:
        """How far the picture is, for the text in the region's corner."""
        if self.error:
            return self.error
        if self.frame is None:
            return "Waiting for the GPU"
        if self.paused:
            return f"Paused after sample {self.frame.samples_done} of {self.frame.settings.samples}"
        coarse = f", 1/{self.scale} resolution" if self.scale > 1 else ""
        return f"Sample {self.frame.samples_done} of {self.frame.settings.samples}, {self.seconds:.1f} s{coarse}"

    def attach(self, engine) -> None:
        """A new engine instance draws this from now on. What happened before it came is unknown: read all graphs."""
        self.owner = weakref.ref(engine)
        self.cache.doubt()
        self.dirty = True
        weakref.finalize(engine, _free_soon).atexit = False

    def draw_frame(
        self,
        source: Callable[[Camera, int, int], Snapshot],
        camera: Camera,
        size: tuple[int, int],
        settings: Settings,
        clock: Callable[[], float] = time.perf_counter,
        border: tuple[int, int, int, int] | None = None,
    ) -> images.Image | None:
        """Work on the picture of `camera` for BUDGET_S and return it: scene-linear, premultiplied. None: not yet one.

        The picture may be coarser than `size` while the view or the scene changes. `source(camera, width, height)`
        reads the scene and is asked only when it may have changed. `border`: pixels (x0, y0, x1, y1) that are drawn,
        by default all. Whatever the renderer raises goes through.
        """
        elsewhere = clock() - self._left_at if self._left_at is not None else 0.0
        self._pauses = self._pauses[1], elsewhere
        called = clock()
        self._prepare(source, camera, size, border or (0, 0, *size), settings, clock)
        frame, started = self.frame, clock()
        if self._target is None and self._sample is None and frame.samples_done:
            self._resolve(frame)  # the frame outlived an error that took its picture
        elif self._sample is None and frame.samples_done and frame.shown_with != self._shown_with:
            self._resolve(frame)  # the same samples, at another time or with other settings of a `show` stage
        budget = min(max(elsewhere, BUDGET_S), MOST_BUDGET_S) if self.scale == 1 else BUDGET_S
        while frame.samples_done < settings.samples:
            spent = self._work(frame, clock, budget)
            if self._sample is None:
                self._resolve(frame)  # now: the next sample, once it has begun, changes the images that are shown
            # Only a picture of this very view and scene may wait for its next sample.
            if (self._waits or frame.samples_done) and clock() - called + spent > budget:
                break
        self.seconds += clock() - started
        self._left_at = None if self.done else clock()
        if self.scale == 1 and frame.samples_done >= settings.samples and not self._finished:
            self._finished = True
            self.renderer.finish(frame, ())  # publishes the ledger
            frame.ledger.times["total"] = self.seconds
            images.pool.trim()  # what only moving views needed
            self.news = True
        return self.picture

    def _work(self, frame: Frame, clock, budget: float) -> float:
        """One part of a sample; the seconds that it took. `_sample` is None afterwards if the sample is whole."""
        if self._sample is None:
            self._sample, self._sample_seconds = self.renderer.steps(frame), self._beginning
            self._beginning = 0.0
            self._compiled = library.compile_count
        before, end = clock(), object()
        whole = next(self._sample, end) is end
        if whole and not frame.profiler.wait:
            images.finish()
        spent = clock() - before
        self.bands.learn(spent, budget / 2)
        self._sample_seconds += spent
        if whole:
            self._sample = None
            if library.compile_count == self._compiled:  # the first draw of a new program takes the driver's time
                self.pace.learn(self.scale, self._sample_seconds)
        return spent

    def _resolve(self, frame: Frame) -> None:
        """Take the mean of the frame's samples for the picture."""
        if self._target is None or self._target.size != frame.size:
            self._drop_picture()
            self._target = images.Target((images.pool.take(*frame.size, "RGBA32F"),))
        passes.copy(self.renderer.show(frame), self._target)
        self._shown_with = frame.shown_with
        film = frame.snapshot.film
        x, y = self._size[0] / film.width, self._size[1] / film.height
        x0, y0, x1, y1 = film.border
        self.place = x0 * x, y0 * y, (x1 - x0) * x, (y1 - y0) * y

    def drop(self) -> None:
        """Forget the picture and read the scene anew when it is next drawn."""
        self._drop_picture()
        self._sample = None
        self.dirty = True

    def _drop_picture(self) -> None:
        if self._target is not None:
            images.pool.give(self._target.colors[0])
            self._target = None

    def _prepare(self, source, camera: Camera, size, border, settings: Settings, clock) -> None:
        """Bring `self.frame` to what is asked: kept if nothing changed, else begun anew at a fitting scale."""
        asked = (
            _view_key(camera),
            size,
            border,
            replace(settings, samples=0, values=self.renderer.drawn_with(settings)),
        )
        moved, begun, reading = asked != self._asked, False, 0.0
        if self.dirty:
            started = clock()
            self._snapshot = source(camera, *size)
            self.dirty, reading = False, clock() - started
            if not moved:  # most updates change nothing that is drawn: selections, names, other scenes' settings
                before = self.frame
                if self._begin(camera, size, border, settings, self.scale, clock) is before:
                    return
                moved = begun = True
        if not moved and settings.samples != self.frame.settings.samples:  # more or less of the same picture
            self._begin(camera, size, border, settings, self.scale, clock)
        if moved:
            self._asked = asked
            self._changed_at = clock()
            before, scale = self.frame, self.pace.scale(reading)
            begun = begun and scale == self.scale
            if begun or self._begin(camera, size, border, settings, scale, clock) is not before:
                self._waits = False
        elif self.scale > 1 and clock() - self._changed_at > max(REST_S, 2.0 * min(self._pauses)):
            self._begin(camera, size, border, settings, 1, clock)
            self._waits = True

    def _begin(self, camera: Camera, size, border, settings: Settings, scale: int, clock) -> Frame:
        started = clock()
        check_tree(settings.passes)
        width, height = (max(-(-extent // scale), 1) for extent in size)
        x, y = width / size[0], height / size[1]
        border = floor(border[0] * x), floor(border[1] * y), ceil(border[2] * x), ceil(border[3] * y)
        film = replace(self._snapshot.film, width=width, height=height, border=border)
        # A part is done when the GPU has done it; a draft is drawn as one, and its passes need not wait for each other.
        settings = replace(settings, profile=scale == 1, shows=frozenset())
        if scale > 1:
            settings = settings.as_draft()
        frame = self.renderer.begin(replace(self._snapshot, camera=camera, film=film), settings)
        frame.shared_out = self.bands if scale == 1 else None
        if frame is not self.frame:
            if size != self._size:
                images.pool.trim()  # nobody will ask for the images of the old size again
            self.frame, self.scale, self._size = frame, scale, size
            self.seconds, self._finished, self._sample = 0.0, False, None
            self._beginning = clock() - started
        elif frame.samples_done < settings.samples:
            self._finished = False
        return frame

    def release(self) -> None:
        """Free everything on the GPU and all that was read of the scene; this viewport is not used again."""
        self.renderer.release()
        self.cache.clear()
        self._drop_picture()
        self.frame = self._sample = self._snapshot = None


def _view_key(camera: Camera) -> tuple:
    return camera.matrix.tobytes(), camera.kind, camera.frame, camera.clip_start, camera.clip_end, camera.aperture


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
    engine.tag_redraw()  # Blender draws again after an artist's change, not after one by a script


def draw(engine, context, depsgraph) -> None:
    """Draw the region: add samples, show the picture, and ask for another call until it is complete."""
    viewport = _viewport_of(engine, context, depsgraph)
    region, scene = context.region, depsgraph.scene
    size = (max(region.width, 1), max(region.height, 1))
    place = (size, context.region_data.view_perspective)
    if viewport.error and viewport.failed_at != place:  # it may have been this view's, or this size's
        viewport.error = ""
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
        _show(engine, scene, viewport)
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
    hidden, shown = _hidden(space), None
    if hidden:
        shown = lambda shown_object: shown_object.visible_in_viewport_get(space)  # noqa: E731
    if viewport.hidden != hidden:
        viewport.hidden = hidden
        viewport.dirty = True

    def source(camera: Camera, width: int, height: int) -> Snapshot:
        return take(depsgraph, viewport.cache, width, height, view=camera, shown=shown)

    blend, depth_test, depth_mask = gpu.state.blend_get(), gpu.state.depth_test_get(), gpu.state.depth_mask_get()
    try:
        camera = camera_of_view(region_data, space, looks_through)
        border = render_border(depsgraph, space, camera, looks_through, size)
        viewport.draw_frame(
            source, camera, size, settings_of(depsgraph.scene, viewport=True, depsgraph=depsgraph), border=border
        )
    except (UnsupportedScene, ValueError, RuntimeError) as error:
        _fail(viewport, engine, str(error))
    except Exception as error:
        # An error of Candela's own. Raised further it would come again with every redraw.
        traceback.print_exc()
        _fail(viewport, engine, unforeseen(error))
    finally:
        gpu.state.blend_set(blend)
        gpu.state.depth_test_set(depth_test)
        gpu.state.depth_mask_set(depth_mask)


_KINDS = [p.identifier for p in bpy.types.SpaceView3D.bl_rna.properties if p.identifier.startswith("show_object_view")]


def _hidden(space) -> tuple[str, ...]:
    """Names of what the region's own settings hide: other than in local view or in its collections, and kinds."""
    own = [name for name in ("local_view", "use_local_collections") if getattr(space, name, None)]
    kinds = [name for name in _KINDS if not getattr(space, name, True)]
    return (*own, *kinds)


def render_border(depsgraph, space, view: Camera, looks_through, size: tuple[int, int]):
    """Pixels (x0, y0, x1, y1) of the region that its render border leaves to be drawn; None without one."""
    render = depsgraph.scene_eval.render
    if looks_through is not None and render.use_border:
        # Both frames lie one unit before the same eye, so they can be compared.
        resolution = render.resolution_x, render.resolution_y
        left, right, bottom, top = camera_of_scene(depsgraph.scene_eval, depsgraph, *resolution, looks_through).frame
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


def _fail(viewport: Viewport, engine, sentence: str) -> None:
    """Stop drawing until the scene changes; the sentence stands in the region, and once in Blender's reports."""
    viewport.drop()
    if viewport.reported != sentence:
        engine.report({"ERROR"}, sentence)
    viewport.error = viewport.reported = sentence


def _show(engine, scene, viewport: Viewport) -> None:
    """Draw the picture over the region, with the scene's colour management."""
    from gpu_extras.presets import draw_texture_2d

    x, y, width, height = viewport.place
    gpu.state.blend_set("ALPHA_PREMULT")
    engine.bind_display_space_shader(scene)
    draw_texture_2d(viewport.picture.texture, (x, y), width, height)
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
    if not gpu_context.available() or not turn.acquire(timeout=0.0):
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
