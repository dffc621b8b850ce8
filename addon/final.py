"""A final picture step by step: what a render draws, apart from Blender's result, so that any thread may follow it.

The steps yield None between two parts, and `Progress` where there is something to tell: a program compiled, a sample
done, and the picture as it grows. It is shown so rarely that reading it back takes a small share of the render.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from statistics import median

import numpy as np

from .film import catcher
from .film.noise import NoiseMeter
from .frame import ledger as ledgers
from .frame import slices, time_steps
from .frame.light_paths import LIGHT_PATHS
from .frame.picture import Frame
from .frame.run import Renderer
from .frame.settings import Settings
from .frame.within_sample import WithinSample
from .gfx import images, library
from .gfx.context import turn
from .snapshot.light_groups import parts_of
from .snapshot.scene import Note, Snapshot
from .snapshot.shutter import Moments
from .ui import light_groups
from .ui.passes import CAMERA_AXES, CATCHER, GLARE, NOISY, RenderPass

AFTER_LAST = 1.0  # time of what follows the last sample (denoising, reading back), at most, by that of a sample
TAIL = 0.5  # the same, about
FEW_SAMPLES, MANY_SAMPLES = 4, 12
FIRST_COSTS = 1.35  # of a later one, about: it finds what all of them use (1.24 to 1.4 in five scenes)
TELLING_PART = 0.3  # of the first sample, from which on it tells what one takes
TELL_S = 0.5  # between two sentences about one sample
SHOW_S = 1.0  # at least, between two pictures of a render that goes on
SHOW_SHARE = 0.04  # of the render's time, at most, that is spent on showing it
COMBINED = "film.combined"
PICTURES_OF_CATCHERS = 3  # of which a picture with shadow catchers is made


@dataclass(frozen=True)
class Progress:
    """What there is to tell."""

    text: str
    share: float | None = None
    picture: np.ndarray | None = None  # (H, W, 4) float32: the mean of the samples so far
    left: float | None = None  # seconds until the end, about, as the text says


@dataclass
class Order:
    """What is to be rendered, and how its samples are drawn."""

    renderer: Renderer
    snapshot: Snapshot
    settings: Settings
    wanted: list[RenderPass]
    parts: Callable  # of all samples: (renderer, frame) -> iterator
    notes: tuple[Note, ...] = ()
    shows: bool = False  # whether anybody looks at the picture while it grows
    started: float = 0.0  # time.perf_counter() from which the time limit counts
    sync_seconds: float = 0.0
    before: Callable[[], None] = lambda: None  # in the GPU's context, first of all
    given: dict[str, np.ndarray] | None = None  # sums of samples that were drawn before, in place of drawing
    take: Callable[[slices.Slice], None] | None = None  # what is drawn, as a slice
    moments: Moments | None = None  # the scene while the shutter is open, where motion blur finds that it moves
    catches: bool = False  # whether shadow catchers are drawn as such

    def of_scene(self, changed: Callable[[Snapshot], Snapshot], settings: Settings) -> Order:
        """The same of a scene of which something is changed."""
        moments = self.moments
        if moments is not None:
            moments = replace(moments, snapshots=tuple(changed(one) for one in moments.snapshots))
        return replace(self, snapshot=changed(self.snapshot), moments=moments, settings=settings)


def steps(order: Order) -> Generator[Progress | None, None, tuple[dict[str, np.ndarray], ledgers.Ledger]]:
    """Draw the picture, for each of its light groups; returns pass pixels by Blender's name, (H, W, channels) float32,
    and the ledger.

    Closed before its end it leaves a frame that the next picture begins anew.
    """
    with turn:
        order.before()
    plates = held = None
    if order.catches:
        order, plates, held = yield from _plates(order)
    if order.take is None and order.given is None:  # slices hold all there is
        asked = images_of(order.wanted, catcher.IMAGES if plates else ())
        order = replace(order, settings=replace(order.settings, shows=frozenset(asked)))
    parts, total = parts_of(order.snapshot), light_groups.Sum(order.snapshot.film)
    for number, part in enumerate(parts):
        own = str(number) if len(parts) > 1 else ""  # under which a slice holds the part's images
        frame = yield from _part(order, part.snapshot, Share(number, len(parts), own, total))
        with turn:
            if order.take is not None:
                held = slices.taken(frame, own, held)
                order.take(held)
            total.add(part, mean_images(order.renderer, frame, order.wanted, catcher.IMAGES if plates else ()))
    if len(parts) > 1 and GLARE in order.wanted:
        text = "glare is that of each light group for itself: without groups it is whole."
        frame.ledger.notes += (Note("Light groups", text),)
    return pixels_of(total, frame, order.wanted, plates), frame.ledger


def _plates(order: Order) -> Generator[Progress | None, None, tuple[Order, tuple, slices.Slice | None]]:
    """Draw the pictures with all and with shadow catchers alone; returns what is left to be drawn, what that is
    composed with (both as catcher.Layer, and whether the film is transparent), and both in a slice, where one is taken.
    The first tells how many samples all have, and has a third of a time limit."""
    sliced = order.take is not None or order.given is not None
    shows = None if sliced else frozenset(catcher.IMAGES)  # slices hold all there is
    limit = order.settings.time_limit / PICTURES_OF_CATCHERS
    found, held, settings = [], None, replace(order.settings, time_limit=limit, shows=shows)
    for name, changed in ((catcher.ALL, catcher.over_nothing), (catcher.PLATE, catcher.catchers_alone)):
        plate = order.of_scene(lambda one, changed=changed: _ungrouped(changed(one)), settings)
        plate.shows, plate.notes, plate.started = False, (), time.perf_counter()
        frame = yield from _part(plate, plate.snapshot, Share(name=name))
        with turn:
            if order.take is not None:
                held = slices.taken(frame, name, held)
            found.append(catcher.layer(mean_images(order.renderer, frame, [], catcher.IMAGES), plate.snapshot))
        settings = replace(settings, time_limit=0.0, noise_threshold=0.0)
        if not (sliced or settings.is_slice):
            settings = replace(settings, samples=frame.samples_done)
    transparent = order.snapshot.film.transparent
    return order.of_scene(catcher.catchers_unseen, settings), (*found, transparent), held


def _ungrouped(snapshot: Snapshot) -> Snapshot:
    """The same as one picture, lit by all light groups."""
    return replace(snapshot, film=replace(snapshot.film, light_groups=()))


@dataclass(frozen=True)
class Share:
    """Which of the parts is drawn of a picture that is lit by one light group after the other."""

    number: int = 0
    of: int = 1
    name: str = ""  # under which slices hold it
    before: light_groups.Sum | None = None  # the parts that are drawn

    @property
    def left(self) -> int:
        """How many there are, with this one."""
        return self.of - self.number


def _part(order: Order, snapshot: Snapshot, share: Share) -> Generator[Progress | None, None, Frame]:
    """Draw one of the parts; returns its frame."""
    renderer, settings = order.renderer, order.settings
    before, steps, numbers = renderer.frame, _time_steps(order, share), None
    if steps:
        # What Denoise keeps for a picture that may end early counts the samples of one step.
        settings = replace(settings, time_limit=0.0, noise_threshold=0.0)
        snapshot, numbers = steps[0].snapshot, steps[0].numbers
    beginning = renderer.beginning(snapshot, settings, numbers)
    frame = None
    while frame is None:
        with turn:
            try:
                done, total = next(beginning)
            except StopIteration as end:
                frame = end.value
                break
        yield Progress(f"Compiling shaders, {done} of {total}") if total else None
    if before is not None and before.size != frame.size:
        with turn:
            images.pool.trim()  # nobody asks for images of the old size again
    frame.ledger.times["sync"] = order.sync_seconds
    frame.ledger.notes += order.notes
    if steps and order.settings.noise_threshold:
        text = "the noise threshold does not count where something moves: all samples are drawn."
        frame.ledger.notes += (Note("Motion blur", text),)
    if order.given is not None:
        with turn:
            renderer.merge(frame, slices.images_of_part(order.given, share.name))
        yield None
    else:
        try:
            yield from _samples_in_steps(order, steps, settings, share) if steps else _samples(order, frame, share)
        except GeneratorExit:
            with turn:
                renderer.finish(renderer.frame or frame, ())  # what was done stands in the ledger
            raise
    if renderer.frame is not frame:  # the last of several, one for each time step
        ledger, frame = frame.ledger, renderer.frame
        frame.ledger.times |= ledger.times
        frame.ledger.notes = ledger.notes
    return frame


def _time_steps(order: Order, share: Share) -> list[time_steps.Step]:
    """Those of a part of a picture with motion blur; none where nothing moves."""
    if order.moments is None or order.given is not None:
        return []
    snapshots = [parts_of(one)[share.number].snapshot for one in order.moments.snapshots]
    return time_steps.shared_out(snapshots, order.moments.steps, order.settings)


def _samples_in_steps(
    order: Order, steps: list[time_steps.Step], settings: Settings, share: Share
) -> Generator[Progress | None, None, None]:
    """Draw all samples of a picture with motion blur, which is not shown while it grows."""
    first, wanted, shown = time.perf_counter(), settings.samples_to_draw, -1
    passed = first - order.started
    limit = order.settings.time_limit and passed + max(order.settings.time_limit - passed, 0.0) / share.left
    for done, stop in time_steps.drawn(order.renderer, steps, settings, order.parts):
        if done == shown:
            yield None
            continue
        shown = done
        yield Progress(sentence(shown, wanted, None), (share.number + shown / wanted) / share.of)
        if limit and shown:
            with turn:
                images.finish()
            now = time.perf_counter()
            # A step that follows learns in one more sample.
            if shown < wanted and now - order.started + (2 + AFTER_LAST) * (now - first) / shown > limit:
                stop()


def _samples(order: Order, frame: Frame, share: Share) -> Generator[Progress | None, None, None]:
    """Draw all samples. With a time limit only as many as it allows: room is left for what follows the last."""
    renderer, limit = order.renderer, frame.settings.time_limit
    if limit:  # of what is left of it each part that is still to come has as much
        passed = time.perf_counter() - order.started
        limit = passed + max(limit - passed, 0.0) / share.left
    wanted, first, before = frame.settings.samples_to_draw, time.perf_counter(), frame.samples_done
    shown, showing, next_picture = -1, 0.0, first + SHOW_S
    pace, inside = SamplePace(first, wanted), Inside(frame, first)
    meter = NoiseMeter(frame.settings.noise_threshold) if frame.settings.noise_threshold else None
    for _ in order.parts(renderer, frame):
        if frame.samples_done == shown:
            news = inside.news(time.perf_counter()) if order.shows else None
            if news is not None:
                left = left_of(order, share.left * wanted - inside.done, pace.each or inside.each)
                told = sentence(shown, wanted, left, news)
                news = Progress(told, (share.number + inside.done / wanted) / share.of, left=left)
            yield news
            continue
        shown = frame.samples_done
        picture, now = None, time.perf_counter()
        # The last picture comes with its passes at once; a first one is worth more than its time.
        if order.shows and before < shown < wanted and (now >= next_picture or shown == before + 1):
            with turn:
                picture = picture_of(renderer, frame)
            if share.number:
                picture[..., :3] += share.before.images[COMBINED][..., :3]
            took = time.perf_counter() - now
            showing += took
            next_picture = now + took + max(SHOW_S, took / SHOW_SHARE)
        pace.learn(shown - before, time.perf_counter())
        left = left_of(order, share.left * wanted - shown, pace.each or inside.each) if order.shows else None
        yield Progress(sentence(shown, wanted, left), (share.number + shown / wanted) / share.of, picture, left)
        if meter is not None and shown < wanted:
            with turn:
                if meter.look(frame):
                    renderer.stop(frame)
                    return
        if limit and shown > before:
            with turn:
                images.finish()
                now = time.perf_counter()
                each = (now - first) / (shown - before)
                if shown < wanted and now - order.started + (1 + AFTER_LAST) * each > limit:
                    renderer.stop(frame)
                    return


class SamplePace:
    """What a sample takes, learned while a picture is drawn. The first ones prepare what the others find there: the
    first tells nothing, but of pictures that have few samples, and of the others the median counts."""

    def __init__(self, now: float, wanted: int):
        self._begun, self._wanted = (now, library.compile_seconds), wanted
        self._last: tuple[int, float] | None = None
        self._took: list[float] = []  # seconds of a sample, without the first ones
        self.each: float | None = None  # seconds; None before that is known

    def learn(self, done: int, now: float) -> None:
        """So many samples of this picture are done."""
        if done <= 0 or (self._last is not None and done <= self._last[0]):
            return
        if self._last is None:
            compiling = library.compile_seconds - self._begun[1]
            if done > 1 or self._wanted <= FEW_SAMPLES:
                self.each = max(now - self._begun[0] - compiling, 0.0) / done
        else:
            self._took.append((now - self._last[1]) / (done - self._last[0]))
            if len(self._took) > (self._wanted > MANY_SAMPLES):
                self.each = median(self._took)
        self._last = done, now


class Inside:
    """What is being done within a sample, how much of it is done, and what the first tells of the others."""

    def __init__(self, frame: Frame, now: float):
        self._frame, self._told_at, self._within = frame, now, WithinSample(frame)
        self._compiled, self._begun = library.compile_count, (now, library.compile_seconds, frame.samples_done)
        self.each: float | None = None  # seconds of a sample by what the first has taken so far; None: not yet known

    @property
    def done(self) -> float:
        """Samples that are done, with the part of the one that is drawn."""
        return self._within.done

    def news(self, now: float) -> str | None:
        """What is being done, now and then."""
        if now - self._told_at < TELL_S or not self._frame.at:
            return None
        compiles, self._told_at = library.compile_count > self._compiled, now
        self._compiled = library.compile_count
        self._within.look()
        started, compiled, first = self._begun
        if self.done - first >= TELLING_PART:
            worked = now - started - (library.compile_seconds - compiled)
            self.each = max(worked, 0.0) / (self.done - first) / FIRST_COSTS
        return f"compiling shaders for {self._frame.at}" if compiles else self._frame.at


def left_of(order: Order, samples: float, each: float | None) -> float | None:
    """Seconds that are left, by what a sample takes and by the time limit; None before the first sample."""
    if each is None:
        return None
    limit = order.settings.time_limit
    left = (samples + TAIL) * each
    return min(left, max(order.started + limit - time.perf_counter(), 0.0)) if limit else left


def sentence(done: int, wanted: int, left: float | None, doing: str = "") -> str:
    """How far a render is, in the words that render farms read, and what it is doing."""
    text = f"Rendering {done} / {wanted} samples"
    return ", ".join((text, *([] if left is None else [f"{clock(left)} left"]), *([doing] if doing else [])))


def clock(seconds: float) -> str:
    """A time as clocks show it: 0:07, 12:30, 1:02:30."""
    whole = round(seconds)
    hours, minutes = whole // 3600, whole // 60 % 60
    return f"{hours}:{minutes:02}:{whole % 60:02}" if hours else f"{minutes}:{whole % 60:02}"


def picture_of(renderer: Renderer, frame: Frame) -> np.ndarray:
    """The mean of the samples so far, (H, W, 4) float32, without what only shows it otherwise (an eye's glare)."""
    shown = renderer.show(frame)
    if shown is None:
        return np.zeros((*frame.size[::-1], 4), np.float32)
    image = frame.images.get(COMBINED)
    return np.nan_to_num(images.read(image if image is not None else shown), posinf=0.0, neginf=0.0)


def images_of(wanted: list[RenderPass], more: tuple[str, ...] = ()) -> set[str]:
    """Names of a frame's images that the picture and these passes are made from."""
    sources = {COMBINED, *more, *(name for asked in wanted for name in asked.images)} - {CATCHER.source}
    return light_groups.frame_images(sources)


def _noisy(frame: Frame, combined: np.ndarray) -> np.ndarray:
    """(H, W, 4) the picture without what Denoise has made of its light."""
    noisy = combined.copy()
    for path in LIGHT_PATHS:
        if path.image in frame.held.shown and path.image != frame.held.shown[path.image]:
            own, shown = (
                images.read(one) for one in (frame.images[f"film.{path.name}"], frame.held.to_show(path.image))
            )
            change = np.nan_to_num(own[..., :3] - shown[..., :3], posinf=0.0, neginf=0.0)
            noisy[..., :3] += frame.snapshot.film.exposure / max(frame.samples_done, 1) * change
    return noisy


def mean_images(
    renderer: Renderer, frame: Frame, wanted: list[RenderPass], more: tuple[str, ...] = ()
) -> dict[str, np.ndarray]:
    """Mean images of a frame that passes are made from."""
    renderer.show(frame)
    arrays = renderer.finish(frame, sorted(images_of(wanted, more) - {NOISY.source}))
    if NOISY in wanted:
        arrays[NOISY.source] = _noisy(frame, arrays[COMBINED])
    if GLARE.source not in frame.images:  # an eye that no plan could use: the pass shows what it would look at
        arrays[GLARE.source] = arrays[COMBINED]
    return arrays


def _may_have_negative_light(frame: Frame) -> bool:
    """Whether a lamp, a material or the world takes light away; those that differ from place to place may."""
    snapshot = frame.snapshot
    lamps = any(np.min(light.strength) < 0 or light.graph is not None for light in snapshot.lights)
    materials = any(
        one.uneven_emission or min(*one.emission, *one.emission_behind) < 0 for one in frame.materials.compiled
    )
    return lamps or materials or bool(frame.environment.color.min() < 0 or frame.environment.pixels.min() < 0)


def _below_zero(arrays: dict[str, np.ndarray]) -> list[np.ndarray]:
    """Light paths that surfaces or media send on, of which some pixel is below 0."""
    sent = [path.image for path in LIGHT_PATHS if path.name not in ("emission", "environment")]
    return [arrays[name] for name in sent if name in arrays and (arrays[name][..., :3] < 0).any()]


def _without_negative(arrays: dict[str, np.ndarray], exposure: float) -> None:
    """Raise to 0 what estimates by differences (a world's irradiance, known where nothing is in the way) have left
    below it in single pixels of few samples; the picture stays the sum of its light. What a material or the world
    sends out itself stays as they say: it may be data, and below 0."""
    added = 0.0
    for light in _below_zero(arrays):
        raised = np.maximum(light[..., :3], 0.0)
        added = added + (raised - light[..., :3])
        light[..., :3] = raised
    arrays[COMBINED][..., :3] += exposure * added


def pixels_of(
    total: light_groups.Sum, frame: Frame, wanted: list[RenderPass], plates: tuple | None = None
) -> dict[str, np.ndarray]:
    """Pass pixels by Blender's name, (H, W, channels) float32."""
    arrays = total.finished({name for asked in wanted for name in asked.images})
    if _below_zero(arrays) and not _may_have_negative_light(frame):
        _without_negative(arrays, frame.snapshot.film.exposure)
    arrays[CATCHER.source] = np.ones_like(arrays[COMBINED][..., :3])
    if plates:
        everything, plate, transparent = plates
        things = catcher.layer(arrays, frame.snapshot)
        arrays[CATCHER.source] = change = catcher.change_of(everything, plate, things, transparent)
        arrays[COMBINED] = catcher.composed(change, everything, things, transparent, CATCHER in wanted)
    arrays[CAMERA_AXES] = frame.snapshot.camera.matrix[:3, :3] * (1.0, 1.0, -1.0)
    pixels = {asked.name: asked.pixels(arrays, frame.snapshot.film.exposure) for asked in wanted}
    return {"Combined": arrays[COMBINED], **pixels}
