"""Runs a plan sample by sample: keeps what lives longer than a frame, allocates images, times each technique."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..gfx import context, images, passes
from ..gfx.library import MOST_TEXTURES
from ..gfx.struct import Block
from ..gfx.timing import Profiler, Stopwatch
from ..materials.compiler import may_reflect
from ..materials.working_space import current
from ..scene.acceleration import HierarchyCache
from ..scene.displacement import Displacement
from ..scene.emission_maps import EmissionMaps
from ..scene.geometry import SceneGeometry
from ..scene.materials import MaterialSet, compiling
from ..scene.media import has_media, volumes_key
from ..scene.opacity_maps import OpacityMaps
from ..scene.panorama import ANSWERS
from ..scene.surface_means import SurfaceMeans
from ..scene.view import VIEW, View
from ..scene.world_tree import WorldTree
from ..snapshot.scene import NO_LINKS, RANKED, Note, Snapshot
from ..sources.environment import Environment
from ..sources.lamp_maps import LampMaps
from . import device_probe, history, left_out
from . import ledger as ledger_module
from .held import Held
from .ledger import REUSED, Ledger, Row
from .picture import Frame
from .plan import Plan, make_plan
from .reads import content
from .settings import Settings
from .technique import Technique


class Renderer:
    """Draws frames of one scene. Keeps meshes, programs and prepared data from one frame to the next."""

    def __init__(self, registry: Callable[[], Sequence[Technique]]):
        self.techniques = tuple(registry())
        self.geometry = SceneGeometry()
        self.materials = MaterialSet()
        self.displacement = Displacement()
        self.frame: Frame | None = None
        self.agrees: Callable[[Snapshot, Settings], Settings | int] = _as_asked
        self.publishes = True  # its ledgers are those that the interface shows; icons of materials have none there
        self._hierarchies, self._surface_means, self._opacity = HierarchyCache(), SurfaceMeans(), OpacityMaps()
        self._glow = EmissionMaps()
        self._lamp_maps = LampMaps()
        self._environment: tuple[object, Environment] | None = None
        self._lasting: dict[type, object] = {}  # what frames share, by class
        self._frame_key: object = None
        self._untouched = False  # what is begun waits, and the frame before is still whole
        self._light: object = None  # what gives the frame's light, but for places of lamps: see frame/history.py
        self._view_block: Block | None = None
        context.on_release(self.release)

    def begin(self, snapshot: Snapshot, settings: Settings, numbers: tuple[int, ...] | None = None) -> Frame:
        """Make everything ready for samples of this snapshot: the settings' slice of them, or those of the `numbers`
        in ascending order. Raises ValueError if there is no camera.

        If nothing differs from the frame before, that frame comes back with the samples it already has. Where something
        is raised, the next frame begins anew.
        """
        parts = self.beginning(snapshot, settings, numbers)
        while True:
            try:
                next(parts)
            except StopIteration as end:
                return end.value

    def beginning(
        self, snapshot: Snapshot, settings: Settings, numbers: tuple[int, ...] | None = None
    ) -> Generator[tuple[int, int], None, Frame]:
        """The same in parts: yields (0, 0) when geometry and materials are those of the snapshot, then (done, total)
        after each program that had to be compiled; returns the frame. While `agrees` tells a number of programs that
        somebody else compiles, it goes no further and yields (0, that number); then it begins with the settings that
        `agrees` tells."""
        try:
            frame = yield from self._begin(snapshot, settings)
            frame.numbers = numbers
            return frame
        except BaseException:
            if not self._untouched:  # what is half made, or made of half of a change, is not to be taken for it
                self._frame_key = None
            raise

    def _begin(self, snapshot: Snapshot, settings: Settings) -> Generator[tuple[int, int], None, Frame]:
        if snapshot.camera is None:
            raise ValueError("The scene has no camera: add one, or make one active in the Scene properties.")
        if settings.samples_to_draw < 1:
            raise ValueError(f"Sample Offset {settings.sample_offset} leaves none of {settings.samples} samples.")
        watch, given, self._untouched = Stopwatch(), snapshot, False
        context.ensure()
        context.begin_picture()
        device_probe.ensure(measures=False)
        passes.left_out.clear()
        ledger = Ledger(samples=0)
        self.materials.update(snapshot)
        snapshot = self.displacement.apply(snapshot, self.materials)
        geometry_changed = self.geometry.update(snapshot, self.materials.compiled)
        view = View(snapshot.camera, snapshot.film, self.geometry.origin)
        self.materials.set_view(view)
        yield 0, 0  # a first look needs no more
        for _ in self.materials.uploading():
            yield 0, 0  # these have programs of their own
        while isinstance(agreed := self.agrees(given, settings), int):
            self._untouched = not geometry_changed  # nothing else has been changed yet that the key does not hold
            yield 0, agreed
        self._untouched = False
        # Measuring takes a second: a picture that is shown until another process has compiled does without.
        device_probe.ensure(measures=agreed is settings)
        settings = agreed
        environment = self._update_environment(snapshot)
        yield 0, 0  # so have its tables
        self._lamp_maps.update(snapshot, self.geometry.origin, self.materials)
        yield 0, 0
        plan = make_plan(self.techniques, snapshot, settings)
        ledger.times["upload"], ledger.times["compile"] = watch.working, watch.compiling
        said = (*snapshot.notes, *self.materials.notes, *environment.notes, *self._lamp_maps.notes)
        lacks = left_out.notes_of(plan, snapshot, settings, self.materials.compiled)
        ledger.notes = tuple(dict.fromkeys((*said, *lacks)))

        light = self._light_key(snapshot, settings, plan)
        key = self._content_key(snapshot, settings, light)
        if self.frame is not None and not geometry_changed and key == self._frame_key:
            ledger.rows = [
                Row(t.name, t.label, REUSED, "nothing changed", slot=", ".join(plan.slots_of(t)))
                for t in plan.techniques
            ]
            ledger.rows += plan.skipped
            self.frame.ledger = ledger
            self.frame.profiler = Profiler(settings.profile)
            self.frame.account.counters = {}
            self.frame.settings = replace(settings, seed=self.frame.settings.seed)  # see frame/history.py
            self.frame.snapshot = snapshot  # the same but for what only `show` asks for, as the time
            return self.frame
        yield from compiling(self._programs(plan, snapshot, settings))
        ledger.times["compile"] = watch.compiling
        self._frame_key = key
        light = (lights_key(snapshot, ("matrix",)), *light[1:])
        before = history.usable(history.remembered(self.frame, self._light), snapshot, light)
        self._drop_frame()
        self._light = light
        settings = history.seeded(settings, before)
        values = view.values(0, settings.seed, (0.0, 0.0), self.geometry.size)
        if self._view_block is None:
            self._view_block = Block(VIEW, **values)
        self._view_block.answers = ANSWERS if snapshot.camera.panorama else ()
        held = Held(plan, settings, view.size)
        frame = Frame(
            snapshot, settings, view, plan, self.geometry, self.materials, environment,
            held.images, held, Profiler(settings.profile), ledger, self._view_block, self._hierarchies,
            self._surface_means, self._opacity, self._glow, self._lamp_maps, lasting=self._lasting,
            before=before,
        )  # fmt: skip
        self.frame = frame
        environment.guide(None)
        for technique in plan.techniques:
            for write in technique.writes:
                if not write.by_need:
                    held.take(write)
        return frame

    def forget(self) -> None:
        """Begin the next frame anew, though nothing may have changed."""
        self._frame_key = None

    def advance(self, frame: Frame) -> None:
        """Render the next sample of the frame."""
        for _ in self.steps(frame):
            pass

    def steps(self, frame: Frame) -> Iterator[None]:
        """The same in parts: after each, other work may use the GPU before the next is asked for.

        A sample that is not brought to its end leaves sums that are good for nothing: the next `begin` starts anew.
        """
        done = frame.samples_done
        try:
            yield from _timed(frame, self._parts_of_sample(frame))
        finally:
            if self.frame is frame and frame.samples_done == done:
                self._frame_key = None

    def _parts_of_sample(self, frame: Frame) -> Iterator[None]:
        settings, profiler = frame.settings, frame.profiler
        measured = frame.samples_to_draw if settings.schedule.known_total else 0
        if frame.samples_done == 0:
            with profiler.once(measured):
                yield from self._begin_samples(frame)
                if frame.number_of(0):
                    # What is learned from the first sample (receivers, guides, depth) is the same in all slices of a
                    # picture; its light is that of another slice.
                    yield from _stage(frame, "sample")
                    self._clear_all_sums(frame)
        if frame.samples_done or frame.number_of(0):
            frame.sample = frame.number_of(frame.samples_done)
            frame.look()
            frame.held.shown.clear()
        with profiler.measured(frame.samples_done, measured):
            yield from _stage(frame, "sample")
        if frame.samples_done + 1 == settings.samples and frame.numbers is None:
            with profiler.once(measured):
                yield from _stage(frame, "end")
        frame.samples_done += 1
        frame.ledger.rows = []  # what was reused up to here is being added to

    def stop(self, frame: Frame) -> None:
        """End the picture with the samples that it has."""
        frame.settings = replace(frame.settings, samples=frame.samples_done)
        for _ in _stage(frame, "end"):
            pass

    def draw_surfaces(self, frame: Frame, number: int) -> None:
        """Draw what the picture's first sample and sample `number` see, without light, in a frame without samples."""
        for _ in self._begin_samples(frame):
            pass
        for drawn in (0, number):
            frame.sample = drawn
            frame.look()
            for _ in _stage(frame, "sample"):
                pass
        self._clear_all_sums(frame)

    def end_with(self, frame: Frame, done: int, samples: int | None) -> None:
        """End a picture of whose samples `done` are in the frame's sums, most of them drawn in other frames (see
        time_steps.py). `samples`: how many it is made of; None where those of other slices are missing."""
        frame.samples_done = done
        if samples is not None:
            frame.settings = replace(frame.settings, samples=samples)
            for _ in _stage(frame, "end"):
                pass
        frame.ledger.rows = []

    def _begin_samples(self, frame: Frame) -> Iterator[None]:
        frame.sample = 0
        frame.look()
        frame.held.shown.clear()
        frame.held.empty_sums()
        yield from _stage(frame, "begin")

    def merge(self, frame: Frame, sums: dict[str, np.ndarray]) -> None:
        """Bring a frame to its end with sums over all samples that were drawn elsewhere (frame/slices.py)."""
        for parts in (self._begin_samples(frame), _stage(frame, "sample")):
            for _ in parts:
                pass
        for name, pixels in sums.items():
            if name in frame.images:
                passes.copy(images.upload(pixels, frame.images[name].format), frame.target(name))
        frame.sample, frame.samples_done = frame.settings.samples - 1, frame.settings.samples
        frame.look()
        for _ in _stage(frame, "end"):
            pass
        frame.ledger.rows = []

    def show(self, frame: Frame) -> images.Image | None:
        """The mean of the samples so far as the image that is to be shown: scene-linear, premultiplied by alpha; None
        where no technique of the plan makes it. It changes with the next call. No sample may be half drawn."""
        frame.picture = Frame.picture
        frame.account.needless.clear()
        for _ in _stage(frame, "show"):
            pass
        return frame.images.get(frame.picture)

    def drawn_with(self, settings: Settings) -> dict:
        """The values of settings that samples depend on."""
        showing = {technique.name for technique in self.techniques if technique.only_shows}
        return {name: value for name, value in settings.values.items() if name[0] not in showing}

    def finish(self, frame: Frame, names: Sequence[str]) -> dict[str, np.ndarray]:
        """Mean images by name, (H, W, C) float32, row 0 at the bottom; completes and publishes the ledger.

        Values that are not finite become 0; the ledger counts them. KeyError for sums that are not held apart.
        """
        started = time.perf_counter()
        first = next((name for name in names if name in frame.images), None)
        if first is None:
            frame.account.read(None)
            images.finish()
        else:  # the wait for the GPU, with what comes of it first
            read = frame.account.read(frame.held.to_show(first))
        waited = time.perf_counter()
        sums = frame.held.sums
        out, bad = {}, 0
        for name in names:
            if name in sums and not frame.held.is_apart(name):
                raise KeyError(f"{name} is not held apart: settings.shows must name it when the picture begins.")
            if name not in frame.images:  # no technique of the plan brings such light
                out[name] = np.zeros((*frame.size[::-1], 4), np.float32)
                continue
            pixels = read if name == first else images.read(frame.held.to_show(name))
            finite = np.isfinite(pixels)
            if not finite.all():
                bad += int(pixels.size - finite.sum())
                pixels = np.where(finite, pixels, 0.0).astype(np.float32)
            if name in sums and frame.samples_done:
                pixels /= frame.samples_done
            if name.startswith(RANKED) and frame.samples_done:
                pixels[..., 1::2] /= frame.samples_done
            out[name] = pixels
        ledger = frame.ledger
        took = frame.drawn_s + frame.profiler.awaited + waited - started
        spent = frame.profiler.shares([t.name for t in frame.plan.techniques], took)
        if ledger.rows:  # reused but for what was done to show them
            worked = frame.account.counters.keys() | frame.account.needless.keys()
            shown = {t.name: _row(frame, t, spent) for t in frame.plan.techniques if t.only_shows and t.name in worked}
            ledger.rows = [shown.get(row.name, row) for row in ledger.rows]
        else:
            rows = [_row(frame, t, spent) for t in frame.plan.techniques]
            ledger.rows = rows + list(frame.plan.skipped)
            ledger.times["passes"] = took
        ledger.times["readback"] = time.perf_counter() - waited
        ledger.samples = frame.samples_done
        ledger.notes = tuple(dict.fromkeys((*ledger.notes, *_without_room())))
        ledger.bad_pixels = bad
        if self.publishes:
            ledger_module.publish(ledger)
        return out

    def release(self) -> None:
        """Free everything on the GPU."""
        self._drop_frame()
        for technique in self.techniques:
            technique.release()
        self.geometry.release()
        self.displacement.release()
        self.materials.release()
        self._hierarchies.release()
        self._lamp_maps.release()
        self._environment = self._view_block = self._frame_key = None
        for kept in self._lasting.values():
            if hasattr(kept, "release"):
                kept.release()
        self._lasting.clear()

    def _drop_frame(self) -> None:
        if self.frame is not None:
            self.frame.drop()
            self.frame = None

    def _update_environment(self, snapshot: Snapshot) -> Environment:
        world = snapshot.world
        image = (world.image.key, world.image.version) if world.image else None
        mapping = None if world.mapping is None else np.asarray(world.mapping).tobytes()
        tree = None
        if world.graph is not None:
            named = (snapshot.images.get(node.image) for node in world.graph.nodes.values())
            tree = (world.graph, tuple((shown.key, shown.version) for shown in named if shown is not None))
        key = (
            image, np.asarray(world.color).tobytes(), mapping, tree, world.visibility, snapshot.film.transparent,
            current().name,
        )  # fmt: skip
        if self._environment is None or self._environment[0] != key:
            compiled = WorldTree(world, snapshot.images, self.materials.energy_table) if tree else None
            self._environment = (key, Environment(world, snapshot.film.transparent, compiled))
        return self._environment[1]

    def _programs(self, plan: Plan, snapshot: Snapshot, settings: Settings) -> list:
        drawn = {draw.material for draw in self.geometry.draws}
        shown = sorted(k for k in drawn if not self.materials.compiled[k].bounds_alone)
        wanted = [self.materials.surface_program(material) for material in shown]
        wanted += [program for t in plan.techniques for program in t.programs(snapshot, settings)]
        wanted += [
            self.materials.caster_program(material)
            for material in shown
            if self.materials.compiled[material].casts_stochastically
        ]
        wanted += [self.materials.opacity_program(k) for k in shown if self.materials.compiled[k].uneven]
        # Pictures of what shines alone, as unlit drawings, measure no emission; where somebody asks after all, they are
        # compiled then.
        lit = any(may_reflect(snapshot.materials[k].graph) for k in snapshot.used_materials) or has_media(snapshot)
        varied = [k for k in shown if lit and self.materials.compiled[k].uneven_emission]
        wanted += [self.materials.emission_program(k) for k in varied]
        wanted += [self.materials.emission_map_program(k) for k in varied]
        wanted += [self.materials.tint_program(k) for k in shown if self.materials.compiled[k].colors_behind]
        wanted += [self.materials.layer_program(k) for k in shown if k in self.materials.layers_in_order]
        if not self.materials.layers_in_order:
            wanted += [self.materials.glow_program(k) for k in shown if self.materials.compiled[k].glows]
        if plan.fills("subsurface"):
            wanted += [self.materials.scatter_program(k) for k in shown if self.materials.compiled[k].scatter > 0.0]
        return list(dict.fromkeys(wanted))

    def _light_key(self, snapshot: Snapshot, settings: Settings, plan: Plan) -> tuple:
        """Equal for two pictures whose surfaces receive the same light, but for objects that move; lamps first."""
        # Who may throw caustics, where objects are asked one by one (caustic_casters.py).
        casters = () if snapshot.film.caustics_refractive else tuple(i.caustics_caster for i in snapshot.instances)
        return (
            lights_key(snapshot), self._lamp_maps.changes, casters, self._environment[0], self.materials.fingerprint(),
            volumes_key(snapshot), settings.bounces, settings.schedule.is_draft,
            tuple(sorted(settings.slots.items())), tuple(sorted(self.drawn_with(settings).items())),
            tuple(t.name for t in plan.techniques),
            tuple(one.links for one in snapshot.instances if one.links != NO_LINKS),
            snapshot.own_values,
        )  # fmt: skip

    @staticmethod
    def _content_key(snapshot: Snapshot, settings: Settings, light: tuple) -> tuple:
        return (
            light, snapshot.film, content(snapshot.camera, ("name",)), settings.seed, settings.shows,
            settings.takes, settings.take,
            settings.schedule.known_total and settings.samples,
            settings.schedule.known_total and (settings.sample_offset, settings.samples_to_draw),
            settings.schedule.known_total and (settings.time_limit, settings.noise_threshold),
            snapshot.motion and snapshot.motion.key,
            snapshot.baked,
        )  # fmt: skip

    def _clear_all_sums(self, frame: Frame) -> None:
        frame.held.empty_sums()
        for name in frame.held.shown.values():
            frame.target(name).clear()


def _row(frame: Frame, technique: Technique, spent: dict[str, float]) -> Row:
    return frame.account.row(technique, ", ".join(frame.plan.slots_of(technique)), spent[technique.name])


def _as_asked(_snapshot: Snapshot, settings: Settings) -> Settings:
    """As `Renderer.agrees`: begin at once."""
    return settings


def _stage(frame: Frame, stage: str) -> Iterator[None]:
    """Run a stage of all techniques in the plan's order, in parts, and take the time of each."""
    for technique in frame.plan.techniques:
        run = getattr(technique, stage)
        if getattr(run, "__func__", run) is getattr(Technique, stage):
            continue
        frame.at = technique.label
        with frame.profiler.step(technique.name):
            parts = iter(run(frame) or ())
        for _ in frame.profiler.steps(technique.name, parts):
            yield


def _timed(frame: Frame, parts: Iterator[None]) -> Iterator[None]:
    """The same parts; what they take is added to the frame's time."""
    end = object()
    while True:
        watch = Stopwatch()
        part = next(parts, end)
        frame.drawn_s += watch.working
        times = frame.ledger.times
        times["compile"] = times.get("compile", 0.0) + watch.compiling
        if part is end:
            return
        yield


NO_LIGHT = ("name", "group")  # fields of a lamp that tell nothing of the light that it gives
IN_TREES = ("random", "pass_index", "color")  # that its node tree alone may ask for


def lights_key(snapshot: Snapshot, but: tuple[str, ...] = ()) -> tuple:
    """Equal in two snapshots if all lamps give the same light, but for fields that are left out."""
    left_out = NO_LIGHT + but
    return tuple(content(one, left_out if one.graph is not None else left_out + IN_TREES) for one in snapshot.lights)


# What artists call images that programs read beside others (gfx/images.py, gfx/struct.py).
BESIDE = {
    "lamp_maps": "what node trees of lamps do to their light",
    "surface_edit": "edits of reflections",
    "receiver_groups": "light linking of what mirrors and glass show",
}


def _without_room() -> Iterator[Note]:
    """What passes of this picture have left out, since graphics cards allow them no more textures."""
    for program, name in sorted(passes.left_out):
        text = (
            f"the pass '{program}' leaves out {BESIDE.get(name, name)}: with all that this scene asks of it, it would "
            f"read more than {MOST_TEXTURES} textures. Another technique in its slot may have room for them."
        )
        yield Note("Scene", text)
