"""What one 3D region shows: coarse while the scene or the view changes, refined while it rests, and always something.

Each call of `draw_frame` works for a short time. A picture is begun in parts, too: programs that it needs are compiled
one a call. Until the first draft is there the region shows a first look (surfaces/first_look.py), whose programs are
small and always the same; if the view is the same as before an edit, what was shown stays.
"""

from __future__ import annotations

import time
import weakref
from collections.abc import Callable, Iterator
from dataclasses import replace

from .. import techniques
from ..film import catcher
from ..frame.bands import Bands
from ..frame.picture import Frame
from ..frame.reads import content
from ..frame.run import Renderer
from ..frame.settings import Settings
from ..frame.within_sample import WithinSample
from ..gfx import device, images, library, passes
from ..snapshot import SnapshotCache
from ..snapshot.scene import Camera, Snapshot
from ..techniques.film import check_tree
from ..ui.notes import losses
from ..ui.passes import RenderPass
from . import one_pass
from .ahead import Ahead
from .beginning import AT_REST, CHECKS, CLIMBS, LIGHTS, MOVES, Beginning, coarser, drawn_with, only_direct
from .catchers import LEFT_OUT, Catchers
from .display import Display, Place, Scene
from .pace import SCALES, STEP_S, Pace, Redraw

BUDGET_S = 0.05  # one redraw works until this is spent; what it has begun by then is finished
MOST_BUDGET_S = 0.25  # where Blender itself takes long to draw its window, as with a software GPU, work as long as it
REST_S = 0.25  # without a change for so long, or for two redraws, the picture is drawn in finer pixels

MOST_LETTERS = 160  # of a warning in the region's text, for which Blender has 512 bytes


class Viewport:
    """What one region shows of one scene: its own samples, and the scene's content as it was read last."""

    def __init__(self):
        self.renderer = Renderer(techniques.make_registry)
        self.ahead: Ahead | None = None  # who compiles programs elsewhere, before a picture is begun here
        self.held = False  # the picture waits for that
        self.direct = False  # what is drawn lacks indirect light meanwhile, see `only_direct`
        self.was_whole = False  # a sample in full resolution has been shown
        self.looked_after = False  # a timer looks when that has come
        self.cache = SnapshotCache()
        self.pace = Pace()
        self.bands = Bands()
        self.display = Display()
        self.catchers = Catchers()
        self.dirty = True  # the scene may have changed since the snapshot
        self.reading = 0.0  # seconds that it took to be read last
        self.images_again = 0.0  # when unsaved images are looked at next
        self.looks_later = False  # a timer looks then
        self.timers: list[Callable[[], float | None]] = []  # of Blender's main loop, which end with this viewport
        self.frame: Frame | None = None
        self.scale = SCALES[-2]
        self.step, self.coarsest = STEP_S, SCALES[-1]  # what a step of a moving view may take; the coarsest pixels
        self.seconds = 0.0  # spent on the samples of this picture
        self.error = ""
        self.owner: Callable = lambda: None  # weak reference to the engine instance that draws it
        self.render_pass: RenderPass | None = None  # shown in the picture's place
        self.paused = False  # the artist wants no more samples for now
        self.hidden: tuple = ()  # what the region's own settings hide
        self.closes_eyes = False  # whether the view layer does, of a collection
        self.news = False  # a ledger that the panels do not show yet
        self.reported = ""  # the error that was reported last
        self.failed_at: tuple | None = None  # the region's size and kind of view when the error came
        self._snapshot: Snapshot | None = None
        self._asked: tuple | None = None
        self._size = (0, 0)  # of the region when the frame was begun
        self._changed_at = 0.0
        self._finished = False
        self._beginning: Beginning | None = None
        self._begun_for: Place = ()  # from where the frame shows the scene, and in which pixels
        self._waits = False  # what is shown is this view of this scene, only coarser
        self._sample: Iterator | None = None  # what is left of a sample that was begun
        self._sample_seconds = self._begun_s = 0.0  # `_begun_s`: what the frame took before its first sample
        self._pauses = (0.0, 0.0)  # between the last redraws
        self._left_at: float | None = None  # when the last redraw ended, if it left something to be done
        self._news = -1  # of the library, when the sample was begun
        self._within: WithinSample | None = None
        self._compiled = 0  # programs since the last whole sample
        self._unshown: list[Callable[[Frame], None]] = []  # what is left until the last whole sample is seen

    @property
    def picture(self) -> images.Image | None:
        """What the region shows, see Display."""
        return self.display.picture

    @property
    def looks(self) -> bool:
        """What is shown is a first look."""
        return self.display.looks

    @property
    def done(self) -> bool:
        """Nothing is left to be drawn until something changes."""
        return bool(self.error) or (self._finished and self._beginning is None) or self.paused

    @property
    def settled(self) -> bool:
        """Nothing is being begun."""
        return self.frame is not None and self._beginning is None

    def status(self) -> str:
        """How far the picture is, for the text in the region's corner."""
        if self.error:
            return self.error
        if self.paused and self.frame is not None:
            return f"Paused after sample {self.frame.samples_done} of {self.frame.settings.samples}"
        if self.held and self.ahead is not None:
            return self.ahead.doing + (", direct light only meanwhile" if self.direct else "")
        if self._beginning is not None:
            left = self._beginning.left
            return f"Compiling shaders ({left} remaining)" if left else "Reading the scene"
        if self.frame is None:
            return "Waiting for the GPU"
        if self.catchers.doing:
            return self.catchers.doing
        coarse = f", 1/{self.scale} resolution" if self.scale > 1 else ""
        coarse += ", direct light only" if self.direct else ""
        done, of = self.frame.samples_done, self.frame.settings.samples
        if done == 0 and self._compiled:
            return f"Compiling shaders for {self.frame.at} ({self._compiled} so far){coarse}"
        at = f", {self.frame.at}" if done < of and self.frame.at else ""
        inside = round(100 * (self._within.done - done)) if self._within is not None and at else 0
        part = f" ({inside} % of the next)" if self.scale == 1 and inside else ""
        return f"Sample {done} of {of}{part}, {self.seconds:.1f} s{coarse}{at}"

    def warning(self) -> str:
        """That the picture has lost something, for the text beside; empty if nothing."""
        if self.error or self.frame is None:
            return ""
        notes = self.frame.ledger.notes
        if self.catchers.scene is not None and not self.catchers.known:
            notes += (LEFT_OUT,)
        lost = losses(notes)
        if not lost:
            return ""
        more = f" (and {len(lost) - 1} more, in Render Properties)" if len(lost) > 1 else ""
        text = str(lost[0])
        return (text if len(text) <= MOST_LETTERS else text[: MOST_LETTERS - 1] + "…") + more

    def attach(self, engine, orphaned: Callable[[], None]) -> None:
        """A new engine instance draws this from now on. What happened before it came is unknown: read all graphs."""
        self.owner = weakref.ref(engine)
        self.cache.doubt()
        self.dirty = True
        weakref.finalize(engine, orphaned).atexit = False

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
        redraw = Redraw(clock, min(max(elsewhere, BUDGET_S), MOST_BUDGET_S))
        border = border or (0, 0, *size)
        self._prepare(source, camera, size, border, settings, clock)
        while self._begun(settings, redraw):
            frame, started = self.frame, clock()
            if self._unshown or self._sample is not None or not frame.samples_done:
                pass
            elif not self.display.holds:
                self._resolve(frame)  # the frame outlived an error that took its picture
            elif self._is_shown_otherwise(frame):
                # The same samples, at another time or with other settings of a `show` stage.
                self.catchers.forget()
                self._resolve(frame)
            spent = self._draw_samples(frame, settings, redraw) if self._shows(frame, redraw) else 0.0
            self.seconds += clock() - started
            if redraw.is_over(spent) or not self._climbs(camera, size, border, settings, clock):
                break
        self._show_something(camera, size, border)
        self._left_at = None if self.done else clock()
        frame = self.frame
        whole = self._beginning is None and self.scale == 1 and not self.direct and not self._unshown
        whole = whole and frame.samples_done >= settings.samples
        if whole and self.catchers.scene is not None and not self.catchers.known:
            whole = self._caught(frame, redraw.is_over)
        if whole and not self._finished:
            self._finished = True
            self.renderer.finish(frame, ())  # publishes the ledger
            frame.ledger.times["total"] = self.seconds
            self.display.drop_look()
            images.pool.trim()  # what only moving views needed
            self.news = True
        return self.picture

    def _caught(self, frame: Frame, enough: Callable[[], bool]) -> bool:
        """Work on what the picture at rest shows of shadow catchers; whether it shows that."""
        self._finished = False
        self.catchers.draw(frame.settings, self.bands, enough)
        if self.catchers.known:
            self._resolve(frame)
        return self.catchers.known

    def _draw_samples(self, frame: Frame, settings: Settings, redraw: Redraw) -> float:
        """Draw parts of samples until the budget is spent; seconds of the last one. Only a picture of this very view
        and scene may wait for its next sample, but a new program is reason enough to let Blender answer."""
        spent = 0.0
        while frame.samples_done < settings.samples:
            known = library.news()
            spent = self._work(frame, redraw.clock, redraw.budget)
            if self._sample is None:  # shown now: the next sample, once it has begun, changes the images that are shown
                self._unshown = [self._take, self._refine]
                if not self._shows(frame, redraw):
                    break
            elif frame.part_done and self.scale == 1 and self.render_pass is None and library.news() == known:
                self._take(frame)
            if (self._waits or frame.samples_done or redraw.is_fresh) and redraw.is_over(spent):
                break
            if self.scale > 1 and frame.samples_done and (self._waits or self._rests(redraw.clock)):
                break  # the next finer one says more than another sample of this one
        return spent

    def _shows(self, frame: Frame, redraw: Redraw) -> bool:
        """Show the last whole sample; whether that is done. Its programs, too, are compiled by more than one redraw."""
        while self._unshown:
            if redraw.is_fresh:
                images.finish()
                if redraw.is_over():
                    return False
            self._unshown.pop(0)(frame)
        return True

    def _work(self, frame: Frame, clock, budget: float) -> float:
        """One part of a sample; the seconds that it took. `_sample` is None afterwards if the sample is whole."""
        if self._sample is None:
            self._sample, self._sample_seconds = self.renderer.steps(frame), self._begun_s
            self._begun_s = 0.0
            self._news = library.news()
        before, end, compiled, uses = clock(), object(), library.compile_count, library.first_uses
        whole = next(self._sample, end) is end
        if (whole or library.first_uses != uses) and not frame.profiler.wait:
            images.finish()  # some drivers compile where the GPU draws, which a redraw that goes on has to know
        spent = clock() - before
        self.bands.learn(spent, budget / 2)
        self._sample_seconds += spent
        self._compiled += library.compile_count - compiled
        self._within.look()
        if whole:
            self._sample = None
            self._compiled = 0
            if library.news() == self._news:  # the first draw of a new program takes the driver's time
                self.pace.learn(self.scale, self._sample_seconds)
        return spent

    def _is_shown_otherwise(self, frame: Frame) -> bool:
        return frame.plan.shown_with(frame.snapshot, frame.settings) != self.display.shown_with

    def _resolve(self, frame: Frame) -> None:
        """Show the mean of the frame's samples at once."""
        self._unshown = [self._take, self._refine]
        while self._unshown:
            self._unshown.pop(0)(frame)

    def _take(self, frame: Frame) -> None:
        """Take the mean of the frame's samples for the picture."""
        self.display.take(frame, self._begun_for, lambda target: self._put(frame, target))
        self.was_whole |= self.scale == 1

    def _refine(self, frame: Frame) -> None:
        """Begin to draw a draft in finer pixels."""
        if self.scale > 1 and self.render_pass is None:
            parts = self.display.refining(frame, self._scene, self.scale, max(self.step, self._sample_seconds))
            self._refine_on(parts)

    def _refine_on(self, parts: Iterator[None]) -> None:
        """Go on with that: one part, before anything else is drawn."""
        if next(parts, parts) is not parts:
            self._unshown.insert(0, lambda _: self._refine_on(parts))

    def _put(self, frame: Frame, target: images.Target) -> None:
        """Draw what is shown of the frame's samples."""
        if self.render_pass is not None:
            one_pass.draw(frame, self.render_pass, target)
            return
        at = frame.at
        shown = self.renderer.show(frame)
        frame.at = at
        if self.catchers.scene is None:
            self._put_image(frame, shown, target)
            return
        with images.borrowed(*frame.size, "RGBA32F") as composed:
            self.catchers.compose(frame, shown, composed)
            self._put_image(frame, composed.colors[0], target)

    def _put_image(self, frame: Frame, shown: images.Image, target: images.Target) -> None:
        if self.direct and frame.snapshot.camera.panorama is None:
            self.display.fill_in(shown, target, self._scene, frame)
        else:
            passes.copy(shown, target)

    @property
    def _scene(self) -> Scene:
        return self._snapshot, self.renderer.geometry, self.renderer.materials.compiled

    def _show_something(self, camera: Camera, size, border) -> None:
        """If the picture of this view is still to come, and what is shown is of another one: a first look at it."""
        begun = self._beginning
        shown = self.frame is not None and self.frame.samples_done and self._take not in self._unshown
        pending = begun is not None or not (shown or self._waits)
        # A look is drawn by straight lines, of what has been placed.
        if pending and camera.panorama is None and (begun is None or begun.placed):
            self.display.look_at(camera, size, border, self._scene)

    def drop(self) -> None:
        """Forget the picture and read the scene anew when it is next drawn."""
        self.display.drop()
        self.catchers.forget()
        self._sample = self._beginning = None
        self._unshown = []
        self.dirty = True

    def _prepare(self, source, camera: Camera, size, border, settings: Settings, clock) -> None:
        """Begin what is asked, at a fitting scale, if the frame is not of it."""
        asked = (
            content(camera, ("name",)),
            size,
            border,
            replace(settings, samples=0, values=self.renderer.drawn_with(settings)),
            self.render_pass,
        )
        view = camera, size, border, settings
        moved, reading = asked != self._asked, 0.0
        if self.dirty:
            started = clock()
            self._snapshot = source(camera, *size)
            self.dirty, reading = False, clock() - started
            self.reading = reading
        elif not moved:
            begun = self._beginning
            if settings.samples != (begun.samples if begun else self.frame.settings.samples):
                self._begin(CHECKS, self.scale, *view)  # more or less of the same picture
            else:
                self._climbs(*view, clock)
            return
        if moved:
            self._asked = asked
            self._changed_at = clock()
            self._begin(MOVES, self.pace.scale(reading, self.step, self.coarsest), *view, reading)
        else:  # most updates change nothing that is drawn: selections, names, other scenes' settings
            self._begin(CHECKS, self.scale, *view, reading)

    def _climbs(self, camera: Camera, size, border, settings: Settings, clock) -> bool:
        """Begin the same picture in finer pixels, if it rests; whether it does."""
        if self._beginning is not None or not self.frame.samples_done or self._unshown:
            return False
        half = self._sample is not None and self.frame.samples_done < settings.samples
        if half and (self.scale == 1 or not self._rests(clock)):
            return False  # it is drawn first, unless fewer samples are asked now, or finer pixels come
        rests = self._rests(clock)
        finer = self.pace.finer(self.scale) if self.scale > 1 else 1
        if self.direct and (finer == 1 or not rests):
            self._begin(LIGHTS, self.scale, camera, size, border, settings)
            return True
        if self.scale == 1 or not rests:
            return False
        self._begin(CLIMBS, finer, camera, size, border, settings)
        return True

    def _rests(self, clock) -> bool:
        """Whether nothing has changed for so long that the picture is drawn in finer pixels."""
        return clock() - self._changed_at > max(REST_S, 2.0 * min(self._pauses))

    def _begin(
        self, why: str, scale: int, camera: Camera, size, border, settings: Settings, reading: float = 0.0
    ) -> None:
        check_tree(settings.passes)
        self._beginning = None
        asked = frozenset(self.render_pass.images if self.render_pass is not None else ())
        film = replace(
            self._snapshot.film, width=size[0], height=size[1], border=border, position="film.position" in asked
        )
        whole, caught = replace(self._snapshot, camera=camera, film=film), None
        if self._snapshot.has_catchers:  # passes, too, are those of what catchers are left out of
            if self.render_pass is None:
                caught, asked = whole, frozenset(catcher.IMAGES)
            whole = catcher.catchers_unseen(whole)
        settings = replace(settings, shows=asked)
        self.held = False
        drawn = drawn_with(settings, scale, scale == 1 or why in AT_REST)
        parts = self.renderer.beginning(replace(whole, film=coarser(whole.film, scale)), drawn)
        begun = Beginning(parts, camera, size, border, scale, why, settings.samples, reading, caught=caught)
        self.renderer.agrees = lambda _, drawn: self._agreed(begun, whole, settings, drawn)
        self._beginning = begun

    def _agreed(self, begun: Beginning, whole: Snapshot, settings: Settings, drawn: Settings) -> Settings | int:
        """With which settings the picture is begun: those it would be `drawn` with; until another process has compiled
        its programs without what has the largest; or how many it waits for."""
        left = None
        if self.ahead is not None:
            left = self.ahead.left(self.renderer, whole, settings, drawn.schedule.is_draft, edit=self.was_whole)
        begun.direct = self.held = False
        if left is None:
            return drawn
        if begun.why == CHECKS and not drawn.schedule.is_draft and not self.direct:
            return left  # it has changed: a draft is begun
        climbs = begun.why == CLIMBS and drawn.schedule.is_draft
        if begun.why in (CHECKS, MOVES) or (climbs and (self.direct or drawn.bounces == 0)):
            begun.direct = drawn.bounces > 0
            return only_direct(drawn) if begun.direct else drawn
        self.held = True
        return left

    def _begun(self, settings: Settings, redraw: Redraw) -> bool:
        """Go on with the frame that is begun, if there is one; whether there is time to draw it."""
        clock = redraw.clock
        while self._beginning is not None:
            begun, before = self._beginning, clock()
            try:
                done, total = next(begun.parts)
            except StopIteration as end:
                self._beginning = None
                begun.seconds += clock() - before
                self._adopt(end.value, begun, settings, clock)
                continue
            except BaseException:
                self._beginning = None
                raise
            begun.seconds += clock() - before
            begun.placed, begun.left = True, total - done
            if self.held:
                return False
            looks = not self.display.has_looked and self.picture is None and begun.camera.panorama is None
            if self.ahead is not None and looks:
                return False  # the first look comes before all else
            if begun.why == CHECKS and total:  # no picture that stays as it is compiles anything
                self._changed(begun, settings, clock)
            if not device.known() and not begun.direct:  # it is measured next, for a second: a first look comes before
                return False
            if redraw.is_fresh and redraw.is_over():
                return False
        return not (redraw.is_fresh and redraw.is_over())

    def _changed(self, begun: Beginning, settings: Settings, clock) -> None:
        """What is drawn has changed: begin it at a scale for that, unless that is what is begun."""
        self._changed_at = clock()
        scale = self.pace.scale(begun.reading, self.step, self.coarsest)
        if scale == begun.scale:
            begun.why = MOVES
            return
        left = begun.left
        self._begin(MOVES, scale, begun.camera, begun.size, begun.border, settings, begun.reading)
        self._beginning.placed, self._beginning.left = True, left

    def _adopt(self, frame: Frame, begun: Beginning, settings: Settings, clock) -> None:
        """Take the frame that is begun for the one that is drawn."""
        frame.shared_out = self.bands if begun.scale == 1 or begun.why in AT_REST else None
        anew = self.catchers.look_at(begun.caught, frame is self.frame)
        if anew and self._sample is None and frame.samples_done:
            self._resolve(frame)
        if frame is self.frame:
            if frame.samples_done < settings.samples:
                self._finished = False
            return
        if begun.size != self._size:
            images.pool.trim()  # nobody will ask for the images of the old size again
        self.frame, self.scale, self._size = frame, begun.scale, begun.size
        self.direct = begun.direct
        self._within = WithinSample(frame)
        self.seconds, self._finished, self._sample, self._compiled, self._unshown = 0.0, False, None, 0, []
        self._begun_s, self._begun_for = begun.seconds, (content(begun.camera, ("name",)), begun.size, begun.border)
        self._waits = begun.why in AT_REST
        if begun.why == CHECKS:
            self._changed(begun, settings, clock)

    def release(self) -> None:
        """Free everything on the GPU and all that was read of the scene; this viewport is not used again."""
        self._beginning, self._unshown = None, []
        self.renderer.release()
        self.cache.clear()
        self.display.drop()
        self.catchers.forget()
        self.catchers.scene = None
        self.frame = self._sample = self._snapshot = None
