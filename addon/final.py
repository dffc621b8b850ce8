"""A final picture step by step: what a render draws, apart from Blender's result, so that any thread may follow it.

The steps yield None between two parts, and `Progress` where there is something to tell: a program compiled, a sample
done, and the picture as it grows. It is shown so rarely that reading it back takes a small share of the render.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass, replace
from itertools import groupby
from statistics import median

import numpy as np

from .film import catcher
from .film.noise import NoiseMeter
from .film.takes import ONE_EYE, Picture, Take, frame_images, is_light, takes_of
from .frame import ledger as ledgers
from .frame import slices, time_steps
from .frame.light_paths import LIGHT_PATHS
from .frame.picture import Frame
from .frame.run import Renderer
from .frame.settings import Settings
from .frame.within_sample import WithinSample
from .gfx import images, library
from .gfx.context import turn
from .snapshot.scene import Camera, Note, Snapshot
from .snapshot.shutter import Moments
from .ui.passes import CAMERA_AXES, CATCHER, GLARE, NOISY, RenderPass

AFTER_LAST = 1.0  # time of what follows the last sample (denoising, reading back), at most, by that of a sample
TAIL = 0.5  # the same, about
FEW_SAMPLES, MANY_SAMPLES = 4, 12
TELLING_PART = 0.3  # of the first sample, from which on it tells what one takes
TELL_S = 0.5  # between two sentences about one sample
SHOW_S = 1.0  # at least, between two pictures of a render that goes on
SHOW_SHARE = 0.04  # of the render's time, at most, that is spent on showing it
COMBINED = "film.combined"


Pixels = dict[str, np.ndarray]  # of passes by Blender's name, (H, W, channels) float32


@dataclass(frozen=True)
class Progress:
    """What there is to tell."""

    text: str
    share: float | None = None
    picture: np.ndarray | None = None  # (H, W, 4) float32: the mean of the samples so far
    left: float | None = None  # seconds until the end, about, as the text says
    eye: str = ""  # of which this is told
    pixels: Pixels | None = None  # of an eye's picture that is done
    ledger: ledgers.Ledger | None = None  # the same


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
    eyes: tuple[tuple[str, Camera | None], ...] = ONE_EYE  # views, and cameras in place of the snapshot's

    @property
    def is_of_slices(self) -> bool:
        """Whether its sums are taken, or given, which hold all there is."""
        return self.take is not None or self.given is not None


def steps(order: Order) -> Generator[Progress | None, None, tuple[Pixels, ledgers.Ledger]]:
    """Draw the pictures of all eyes, take by take; returns the passes of the last of them, and the ledger. `Progress`
    tells those of each as soon as it is done.

    Closed before its end it leaves a frame that the next picture begins anew.
    """
    with turn:
        order.before()
    takes = takes_of(order.snapshot, order.moments, order.catches, order.eyes)
    more, held = catcher.IMAGES if order.catches else (), None
    for eye, of_eye in groupby(takes, key=lambda take: take.eye):
        picture, settings, wanted = Picture(), order.settings, order.wanted
        started = order.started if eye == takes[0].eye else time.perf_counter()
        for take in of_eye:
            if picture.images and not order.is_of_slices:  # a group after the first brings light alone
                wanted = [asked for asked in order.wanted if any(map(is_light, asked.images))]
            if not order.is_of_slices:
                shows = more if take.is_plate else images_of(wanted, more)
                settings = replace(settings, shows=frozenset(shows))
            settings = replace(settings, takes=1 if take.is_plate else take.groups, take=take.number)
            frame = yield from _drawn(_Shot(order, take, settings, len(takes), started, picture))
            with turn:
                if order.take is not None:
                    held = slices.taken(frame, take.name, held)
                picture.add(take, mean_images(order.renderer, frame, [] if take.is_plate else wanted, more))
            if take.is_plate:  # all pictures of shadow catchers have as many samples as the first
                settings = replace(settings, time_limit=0.0, noise_threshold=0.0)
                if not (order.is_of_slices or settings.is_slice):
                    settings = replace(settings, samples=frame.samples_done)
        if picture.is_sum and GLARE in order.wanted:
            text = "glare is that of each light group for itself: without groups it is whole."
            frame.ledger.notes += (Note("Light groups", text),)
        pixels = pixels_of(picture, frame, order)
        yield Progress("Finishing", eye=eye, pixels=pixels, ledger=frame.ledger)
    if order.take is not None:
        order.take(held)
    return pixels, frame.ledger


@dataclass(frozen=True)
class _Shot:
    """A take that is to be drawn, and its place among the others."""

    order: Order
    take: Take
    settings: Settings
    of: int  # takes of all
    started: float  # time.perf_counter() from which the time limit of the take's picture counts
    before: Picture  # the takes that are drawn

    @property
    def limit(self) -> float:
        """Seconds from `started` until the take has to end: each that is left has as much of what is left; 0: none."""
        limit, passed = self.settings.time_limit, time.perf_counter() - self.started
        return limit and passed + max(limit - passed, 0.0) / self.take.left

    def left(self, done: float, wanted: int, each: float | None) -> float | None:
        """Seconds that are left for this eye's takes and those of the eyes that follow, by what a sample takes and by
        the time limit, which each eye has for itself; None before the first sample."""
        if each is None:
            return None
        of_eye = self.of // len(self.order.eyes)
        follow = (self.of - self.take.number - self.take.left) // of_eye
        own, other = (self.take.left * wanted - done + TAIL) * each, (of_eye * wanted + TAIL) * each
        if self.settings.time_limit:
            own = min(own, max(self.started + self.settings.time_limit - time.perf_counter(), 0.0))
        if self.order.settings.time_limit:
            other = min(other, self.order.settings.time_limit)
        return own + follow * other

    def share(self, samples: float, wanted: int) -> float:
        """Of all that is drawn, what is done."""
        return (self.take.number + samples / wanted) / self.of


def _drawn(shot: _Shot) -> Generator[Progress | None, None, Frame]:
    """Draw a take; returns its frame."""
    order, take, settings, renderer = shot.order, shot.take, shot.settings, shot.order.renderer
    before, snapshot, numbers, moments = renderer.frame, take.snapshot, None, []
    if take.moments is not None and order.given is None:
        moments = time_steps.shared_out(take.moments.snapshots, take.moments.steps, settings)
        snapshot, numbers = moments[0].snapshot, moments[0].numbers
        # What Denoise keeps for a picture that may end early counts the samples of one moment.
        settings = replace(settings, time_limit=0.0, noise_threshold=0.0)
        renderer.forget()
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
    if moments and shot.settings.noise_threshold:
        text = "the noise threshold does not count where something moves: all samples are drawn."
        frame.ledger.notes += (Note("Motion blur", text),)
    if order.given is not None:
        with turn:
            renderer.merge(frame, slices.images_of_part(order.given, take.name))
        yield None
        return frame
    if moments:
        parts = time_steps.drawn(renderer, moments, settings, order.parts)
    else:

        def stop() -> None:
            with turn:
                renderer.stop(frame)

        parts = ((frame.samples_done, stop) for _ in order.parts(renderer, frame))
    try:
        yield from _samples(shot, frame, parts, bool(moments))
    except GeneratorExit:
        with turn:
            renderer.finish(renderer.frame or frame, ())  # what was done stands in the ledger
        raise
    if renderer.frame is not frame:  # the last of several, one for each moment
        ledger, frame = frame.ledger, renderer.frame
        frame.ledger.times |= ledger.times
        frame.ledger.notes = ledger.notes
    return frame


def _samples(
    shot: _Shot, frame: Frame, parts: Iterable[tuple[int, Callable[[], None]]], moves: bool
) -> Generator[Progress | None, None, None]:
    """Draw all samples. With a time limit only as many as it allows: room is left for what follows the last. `parts`
    tell how many are done, and what ends the take with these. A take in which something moves is not shown."""
    take, renderer, limit = shot.take, shot.order.renderer, shot.limit
    shows = shot.order.shows and not moves
    wanted, first, before = frame.settings.samples_to_draw, time.perf_counter(), frame.samples_done
    shown, showing, next_picture = -1, 0.0, first + SHOW_S
    pace, inside = SamplePace(first, wanted), Inside(frame, first)
    meter = NoiseMeter(shot.settings.noise_threshold) if shot.settings.noise_threshold and not moves else None
    for done, stop in parts:
        if done == shown:
            news = inside.news(time.perf_counter()) if shows else None
            if news is not None:
                left = shot.left(inside.done, wanted, pace.each or inside.each)
                told = sentence(shown, wanted, left, news)
                news = Progress(told, shot.share(inside.done, wanted), left=left, eye=take.eye)
            yield news
            continue
        shown = done
        picture, now = None, time.perf_counter()
        # The last picture comes with its passes at once; a first one is worth more than its time.
        if shows and not take.is_plate and before < shown < wanted and (now >= next_picture or shown == before + 1):
            with turn:
                picture = picture_of(renderer, frame)
            if COMBINED in shot.before.images:
                picture[..., :3] += shot.before.images[COMBINED][..., :3]
            took = time.perf_counter() - now
            showing += took
            next_picture = now + took + max(SHOW_S, took / SHOW_SHARE)
        pace.learn(shown - before, time.perf_counter())
        left = shot.left(shown, wanted, pace.each or inside.each) if shows else None
        yield Progress(sentence(shown, wanted, left), shot.share(shown, wanted), picture, left, take.eye)
        if meter is not None and shown < wanted:
            with turn:
                enough = meter.look(frame)
            if enough:
                stop()
                return
        if limit and before < shown < wanted:
            with turn:
                images.finish()
            now = time.perf_counter()
            # A moment that follows learns in one more sample.
            if now - shot.started + (1 + moves + AFTER_LAST) * (now - first) / (shown - before) > limit:
                stop()
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
        self._compiled, self._first = library.compile_count, frame.samples_done
        self._looked_at, self._later = (now, library.compile_seconds), 0.0  # `_later`: what a later sample takes of it
        self.each: float | None = None  # seconds of a sample by what the first has taken so far; None: not yet known

    @property
    def done(self) -> float:
        """Samples that are done, with the part of the one that is drawn."""
        return self._within.done

    def news(self, now: float) -> str | None:
        """What is being done, now and then."""
        (before, compiling), self._looked_at = self._looked_at, (now, library.compile_seconds)
        worked = max(now - before - (library.compile_seconds - compiling), 0.0)
        is_first = self._frame.samples_done == self._first
        self._later += worked * (self._within.later(self._frame.at) if is_first else 1.0)
        if now - self._told_at < TELL_S or not self._frame.at:
            return None
        compiles, self._told_at = library.compile_count > self._compiled, now
        self._compiled = library.compile_count
        self._within.look()
        if self.done - self._first >= TELLING_PART:
            self.each = self._later / (self.done - self._first)
        return f"compiling shaders for {self._frame.at}" if compiles else self._frame.at


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
    return frame_images(sources)


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


def pixels_of(picture: Picture, frame: Frame, order: Order) -> Pixels:
    """The passes of an eye's picture, of which this take was the last."""
    wanted = order.wanted
    arrays = picture.with_black({name for asked in wanted for name in asked.images})
    if _below_zero(arrays) and not _may_have_negative_light(frame):
        _without_negative(arrays, frame.snapshot.film.exposure)
    arrays[CATCHER.source] = picture.catch(arrays, frame.snapshot, order.snapshot.film.transparent, CATCHER in wanted)
    arrays[CAMERA_AXES] = frame.snapshot.camera.matrix[:3, :3] * (1.0, 1.0, -1.0)
    pixels = {asked.name: asked.pixels(arrays, frame.snapshot.film.exposure) for asked in wanted}
    return {"Combined": arrays[COMBINED], **pixels}
