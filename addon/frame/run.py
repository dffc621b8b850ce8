"""Runs a plan sample by sample: keeps what lives longer than a frame, allocates images, times each technique."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from ..gfx import context, images, passes
from ..gfx.readback import Readback, Reading, put
from ..gfx.struct import Block
from ..gfx.timing import Profiler, Stopwatch
from ..materials.compiled import CompiledMaterial
from ..materials.working_space import current
from ..sampling.lens import point_of
from ..sampling.sequence import FILM, LENS, lot, point, third
from ..scene.acceleration import Hierarchy, HierarchyCache
from ..scene.displacement import Displacement
from ..scene.emission_maps import EmissionMaps
from ..scene.geometry import SceneGeometry
from ..scene.materials import MaterialSet, compiling
from ..scene.media import volumes_key
from ..scene.opacity_maps import OpacityMaps
from ..scene.receivers import Receivers
from ..scene.surface_means import SurfaceMeans
from ..scene.view import VIEW, View, blackman_harris_offset
from ..scene.world_tree import WorldTree
from ..snapshot.scene import NO_LINKS, RANKED, Snapshot
from ..sources.environment import Environment
from ..sources.lamp_maps import LampMaps
from ..sources.lights import Emitter, emitters
from . import device_probe
from . import ledger as ledger_module
from .bands import Bands
from .ledger import RAN, REUSED, SKIPPED, Ledger, Row
from .plan import Plan, make_plan
from .settings import Settings
from .technique import Service, Technique, Write

ServiceT = TypeVar("ServiceT", bound=Service)
SharedT = TypeVar("SharedT")

FOOTPRINT = 0.96  # side of a square that deviates as much as a pixel filter of half width 1
MOST_TEXELS = 16  # counters that are kept in an image
FAR_BEYOND = 300.0  # by the typical distance of what is seen
ORTHOGRAPHIC_DISTANCE = 1.4  # by the width of what is seen: a lens of 50 mm before a sensor of 36 mm


@dataclass
class Frame:
    """One picture in the making: what a technique sees while it runs."""

    snapshot: Snapshot
    settings: Settings
    view: View
    plan: Plan
    geometry: SceneGeometry
    materials: MaterialSet
    environment: Environment
    images: dict[str, images.Image]
    profiler: Profiler
    ledger: Ledger
    view_block: Block
    hierarchies: HierarchyCache
    surface_means: SurfaceMeans
    measured_opacity: OpacityMaps
    measured_emission: EmissionMaps
    lamp_maps: LampMaps
    view_rows: np.ndarray | None = None  # (4, 4) this sample's projection: rows x, y, w, q
    sample: int = 0  # the sample that is running
    film_points: int = 1  # that a sample shows; the surface technique says it before it looks
    samples_done: int = 0
    numbers: tuple[int, ...] | None = None  # of the picture's samples, those that are drawn; None: the settings' slice
    first_part: int | None = None  # samples in the sums of half the samples, where they are not half (time_steps.py)
    drawn_s: float = 0.0  # seconds that the samples took so far, without what others did between their parts
    find_receivers: Callable[[], Receivers] | None = None
    counters: dict[str, dict[str, int]] = field(default_factory=dict)
    shared_out: Bands | None = None  # for a picture that is drawn between other work
    shown: dict[str, str] = field(default_factory=dict)  # sums, and the images that show them better, as sums, too
    picture: str = "film.combined"  # the image that is shown; a technique that shows another one says so in `show`
    needless: dict[str, str] = field(default_factory=dict)  # why a technique found nothing to do, by name; see `leave`
    choices: dict[str, dict[str, str]] = field(default_factory=dict)  # by technique: of what, and why; see `chose`
    lasting: dict[type, object] = field(default_factory=dict)  # see `kept`; the renderer's
    more_writes: list[Write] = field(default_factory=list)  # see `add_write`
    readback: Readback = field(default_factory=Readback)
    _services: dict[type[Service], Service] = field(default_factory=dict)
    _shared: dict[type, object] = field(default_factory=dict)
    _targets: dict[tuple[str, ...], images.Target] = field(default_factory=dict)
    _hierarchies: dict[tuple, Hierarchy | None] = field(default_factory=dict)  # of this frame, see `hierarchy`
    _receivers: Receivers | None = None
    _texels: list[tuple[str, str, int]] = field(default_factory=list)  # technique, name and factor; see `count_texel`
    _texel_sums: images.Target | None = None

    @property
    def size(self) -> tuple[int, int]:
        return self.view.size

    @property
    def is_first(self) -> bool:
        """Whether the first sample is running: for counters that are the same in each sample, read once."""
        return self.sample == 0

    @property
    def samples_to_draw(self) -> int:
        return self.settings.samples_to_draw if self.numbers is None else len(self.numbers)

    def number_of(self, drawn: int) -> int:
        """Which of the picture's samples is drawn after `drawn` others."""
        return self.settings.sample_offset + drawn if self.numbers is None else self.numbers[drawn]

    @property
    def receivers(self) -> Receivers | None:
        """Boxes around what the camera sees; None where no technique finds any. The first question may wait for the
        GPU: what can be drawn before is."""
        if self._receivers is None and self.find_receivers is not None:
            self._receivers, self.find_receivers = self.find_receivers(), None
        return self._receivers

    def read_later(self, image: images.Image) -> Reading:
        """Read an image of the pool, together with others, when one of them is asked for; the pool gets it back."""
        return self.readback.later(image)

    def is_apart(self, name: str) -> bool:
        """Whether anybody looks at this sum over samples by itself: whoever asked for the picture, or a technique."""
        return self.settings.shows is None or name in self._looked_at

    @cached_property
    def _looked_at(self) -> frozenset[str]:
        needs = (technique.looks_at(self.settings) for technique in self.plan.techniques)
        return self.settings.shows.union(*needs)

    @cached_property
    def emitters(self) -> list[Emitter]:
        """The scene's lights that give something, in an order of their own."""
        return emitters(self.snapshot, self.geometry.origin, self.lamp_maps)

    def random(self, use: str) -> tuple[float, float]:
        """This sample's point of the sequence for `use`."""
        return point(self.sample, use, self.settings.seed)

    def random_at(self, index: int, use: str) -> tuple[float, float]:
        """Point `index` of the sequence for `use`, for uses that take more or fewer points than samples."""
        return point(index, use, self.settings.seed)

    def lot(self, use: str) -> float:
        """A number of this sample that chooses among things, of which the chosen one then draws a point."""
        return lot(self.sample, use, self.settings.seed)

    def random_volume_at(self, index: int, use: str) -> tuple[float, float, float]:
        """The same with a third number."""
        return *self.random_at(index, use), third(index, use, self.settings.seed)

    def random_volume(self, use: str) -> tuple[float, float, float]:
        """The same with a third number."""
        return *self.random(use), third(self.sample, use, self.settings.seed)

    def look(self, lens: tuple[float, float] | None = None, film: int | None = None) -> None:
        """Set the view of this sample: its place on the film and, unless `lens` says another (as View.values), its
        point of the aperture. The first sample looks through the middle of both: as in Cycles depth is taken from it,
        and a picture that just began is sharp. `film`: the number of another point of the film, with which layers are
        drawn at random anew, too.
        """
        settings, aperture = self.settings, self.snapshot.camera.aperture
        number = self.sample if film is None else film
        if lens is None:
            lens = point_of(aperture, *self.random(LENS)) if aperture else (0.0, 0.0)
        values = self.view.values(
            number, settings.seed, self.film_offset(number), self.geometry.size, lens, self._footprints()
        )
        self.view_block.update(**values)
        self.view_rows = np.stack([values[f"row_{name}"] for name in "xywq"])

    def _footprints(self) -> tuple[float, float]:
        """Sides in pixels of the squares over which lookups of textures average (materials/averages.py). All samples
        of a picture, and their points of the film, share what the pixel filter covers; where any number of samples may
        be shown, sample n takes the n-th of it."""
        samples = self.settings.samples if self.settings.whole else self.sample + 1
        side = FOOTPRINT * self.snapshot.film.filter_width * (self.film_points * samples) ** -0.5
        return side, side if self.is_first else 0.0

    def film_offset(self, number: int) -> tuple[float, float]:
        """Where point `number` of the film lies, in pixels from a pixel's middle."""
        x, y = (blackman_harris_offset(u, self.snapshot.film.filter_width) for u in self.random_at(number, FILM))
        return x, y

    @property
    def typical_distance(self) -> float:
        """Of what is seen, m; of an orthographic camera that from which a common lens would see as much, since its own
        place says nothing. Asked where there are receivers."""
        camera = self.snapshot.camera
        if camera.kind == "ORTHOGRAPHIC":
            left, right, bottom, top = camera.frame
            return ORTHOGRAPHIC_DISTANCE * max(right - left, top - bottom)
        return self.receivers.typical_distance

    @property
    def offset_size(self) -> float:
        """How far beside a surface rays begin at least, m: what float32 may be wrong about a position. Of a scene that
        reaches far beyond what is seen (a sky of some kilometres), only what is seen counts."""
        seen = self.receivers is not None and len(self.receivers.distance)
        reach = FAR_BEYOND * self.typical_distance if seen else np.inf
        return 1e-6 * min(self.geometry.size, reach)

    @cached_property
    def blocker_sets(self) -> frozenset[frozenset[int]]:
        """Groups of blockers that lights let pass, all that differ."""
        snapshot = self.snapshot
        return frozenset(one.links.passing for one in (*snapshot.lights, *snapshot.instances) if one.links.passing)

    @cached_property
    def measured_materials(self) -> list[CompiledMaterial]:
        """The scene's materials, with the means that they have on the surfaces that show them."""
        return self.surface_means.of(self.materials, self.geometry)

    @cached_property
    def opacity_maps(self) -> OpacityMaps:
        """How opaque triangles are, place by place."""
        self.measured_opacity.update(self.materials, self.geometry)
        return self.measured_opacity

    @cached_property
    def emission_maps(self) -> EmissionMaps:
        """What triangles emit, place by place, where that varies."""
        self.measured_emission.update(self.materials, self.geometry)
        return self.measured_emission

    def hierarchy(self, path: str = "glossy", passing: frozenset[int] = frozenset()) -> Hierarchy | None:
        """Triangles that rays of a path (a name of Visibility) can meet, without objects of the groups of blockers
        `passing` (snapshot/linking.py); None where there are too many. Built on the first call."""
        key = path, passing
        if key not in self._hierarchies:  # to find it again each sample would mean to go through all instances
            self._hierarchies[key] = self.hierarchies.get(self, path, passing)
        return self._hierarchies[key]

    def provide(self, service: Service, kind: type[Service] | None = None) -> None:
        """Hand a service to the other techniques of this picture, as one of its class, or of the base `kind`."""
        self._services[kind or type(service)] = service

    def service(self, kind: type[ServiceT]) -> ServiceT | None:
        """The service of this class; None where no technique has provided one."""
        return self._services.get(kind)

    def shared(self, kind: type[SharedT]) -> SharedT:
        """The one object of a class that all techniques share in this picture, made by `kind()` when first asked."""
        if kind not in self._shared:
            self._shared[kind] = kind()
        return self._shared[kind]

    def kept(self, kind: type[SharedT]) -> SharedT:
        """The same, kept from picture to picture. Where it has `release`, that is called with the renderer's."""
        if kind not in self.lasting:
            self.lasting[kind] = kind()
        return self.lasting[kind]

    def owned(self, transport: str) -> bool:
        """Whether a technique of the plan takes over this kind of transport (light_paths.TRANSPORTS)."""
        return self.plan.owner(transport) is not None

    @property
    def shown_with(self) -> tuple:
        """What decides how the samples so far are shown: where it differs, `show` shows them otherwise."""
        showing = [technique for technique in self.plan.techniques if technique.only_shows]
        return tuple((t.name, self.settings.of(t), self.snapshot.moment) for t in showing)

    def count(self, technique: Technique, name: str, amount: int = 1) -> None:
        """Add to a counter of the technique's ledger row."""
        row = self.counters.setdefault(technique.name, {})
        row[name] = row.get(name, 0) + amount

    def chose(self, technique: Technique, of: str, why: str) -> None:
        """Between methods, by what they cost on this device: the ledger's row says it."""
        self.choices.setdefault(technique.name, {})[of] = why

    def count_texel(
        self, technique: Technique, name: str, image: images.Image, factor: int = 1, at: tuple[int, int] = (0, 0)
    ) -> None:
        """Add the first number of an image's texel, times `factor`, to a counter, without reading it now: it comes with
        the picture. Sums below 2^24 are exact."""
        entry = (technique.name, name, factor)
        if self._texel_sums is None:
            self._texel_sums = images.Target((images.pool.take(MOST_TEXELS, 1, "RGBA32F"),))
        if entry not in self._texels:
            if len(self._texels) == MOST_TEXELS:
                raise ValueError(f"More than {MOST_TEXELS} counters are kept in images.")
            if not self._texels:
                self._texel_sums.clear()
            self._texels.append(entry)
        put(image, self._texel_sums, self._texels.index(entry), 0, "ADDITIVE_PREMULT", (*at, 1, 1))

    def read_with_counters(self, image: images.Image | None) -> np.ndarray | None:
        """An image's pixels; what `count_texel` has counted is read with them, and added to the counters."""
        if not self._texels:
            return None if image is None else images.read(image)
        sums = self._texel_sums.colors[0]
        width = max(image.width if image else 0, sums.width)
        height = image.height if image else 0
        if image is not None and image.format != "RGBA32F":  # floats of another format: not worth a program
            pixels, image, height = images.read(image), None, 0
        else:
            pixels = None
        with images.borrowed(width, height + 1, "RGBA32F") as target:
            if image is not None:
                put(image, target, 0, 0)
            put(sums, target, 0, height)
            found = images.read(target.colors[0])
        for (technique, name, factor), amount in zip(self._texels, found[height, :, 0]):
            if amount > 0.0:  # as with `count`: what did not happen is not counted
                row = self.counters.setdefault(technique, {})
                row[name] = row.get(name, 0) + factor * round(float(amount))
        self._texels.clear()
        return found[:height, : image.width] if image is not None else pixels

    def add_write(self, write: Write) -> images.Image:
        """An image that this picture alone has, as for passes that its view layer asks for by name; empty.
        In `begin`."""
        if write.name not in self.images:
            self.images[write.name] = images.pool.take(*self.size, write.format)
            self.more_writes.append(write)
        self.target(write.name).clear()
        return self.images[write.name]

    @property
    def writes(self) -> list[Write]:
        """What the plan's techniques write, and what was added for this picture."""
        return [*(write for technique in self.plan.techniques for write in technique.writes), *self.more_writes]

    @property
    def sums(self) -> set[str]:
        """Names of what adds up over samples."""
        return {write.name for write in self.writes if write.accumulates}

    def drop(self) -> None:
        """Give back the images of the frame."""
        self.readback.drop()
        held = [*self.images.values(), *(self._texel_sums.colors if self._texel_sums else ())]
        for image in held:
            images.pool.give(image)
        self._texel_sums = None

    def leave(self, technique: Technique, reason: str) -> None:
        """The picture itself shows that the technique is not needed: its ledger row says skipped, and why."""
        self.needless[technique.name] = reason

    def to_show(self, name: str) -> images.Image:
        """The image of that name, or, of sums, the one that shows them better."""
        return self.images[self.shown.get(name, name)]

    def bands(self, technique: Technique, part: str = "") -> Iterator[tuple[int, int]]:
        """Rows (from, to) of the picture: a long pass draws them one after the other, with a `yield` after each.

        A technique with several long passes names the `part`, since each has its own time.
        """
        height = self.size[1]
        return iter([(0, height)]) if self.shared_out is None else self.shared_out.split(technique.name + part, height)

    def target(self, *names: str, depth: str = "") -> images.Target:
        """A render target over named images; kept with the frame."""
        key = (*names, "depth:" + depth)
        if key not in self._targets:
            self._targets[key] = images.Target(
                tuple(self.images[name] for name in names), self.images[depth] if depth else None
            )
        return self._targets[key]


class Renderer:
    """Draws frames of one scene. Keeps meshes, programs and prepared data from one frame to the next."""

    def __init__(self, registry: Callable[[], Sequence[Technique]]):
        self.techniques = tuple(registry())
        self.geometry = SceneGeometry()
        self.materials = MaterialSet()
        self.displacement = Displacement()
        self.frame: Frame | None = None
        self.publishes = True  # its ledgers are those that the interface shows; icons of materials have none there
        self._hierarchies, self._surface_means, self._opacity = HierarchyCache(), SurfaceMeans(), OpacityMaps()
        self._glow = EmissionMaps()
        self._lamp_maps = LampMaps()
        self._environment: tuple[object, Environment] | None = None
        self._keys: dict[str, object] = {}
        self._lasting: dict[type, object] = {}  # what frames share, by class
        self._frame_key: object = None
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
        """The same in parts: yields (done, total) after each program that had to be compiled; returns the frame."""
        try:
            frame = yield from self._begin(snapshot, settings)
            frame.numbers = numbers
            return frame
        except BaseException:
            self._frame_key = None  # what is half made, or made of half of a change, is not to be taken for it
            raise

    def _begin(self, snapshot: Snapshot, settings: Settings) -> Generator[tuple[int, int], None, Frame]:
        if snapshot.camera is None:
            raise ValueError("The scene has no camera: add one, or make one active in the Scene properties.")
        if settings.samples_to_draw < 1:
            raise ValueError(f"Sample Offset {settings.sample_offset} leaves none of {settings.samples} samples.")
        watch = Stopwatch()
        context.ensure()
        context.begin_picture()
        device_probe.ensure()
        ledger = Ledger(samples=0)
        self.materials.update(snapshot)
        snapshot = self.displacement.apply(snapshot, self.materials)
        geometry_changed = self.geometry.update(snapshot, self.materials.compiled)
        view = View(snapshot.camera, snapshot.film, self.geometry.origin)
        self.materials.set_view(view)
        environment = self._update_environment(snapshot)
        self._lamp_maps.update(snapshot, self.geometry.origin, self.materials)
        plan = make_plan(self.techniques, snapshot, settings)
        ledger.times["upload"] = watch.working
        yield from compiling(self._programs(plan, snapshot, settings))
        ledger.times["compile"] = watch.compiling
        ledger.notes = tuple(
            dict.fromkeys((*snapshot.notes, *self.materials.notes, *environment.notes, *self._lamp_maps.notes))
        )

        key = self._content_key(snapshot, settings, plan)
        if self.frame is not None and not geometry_changed and key == self._frame_key:
            ledger.rows = [
                Row(t.name, t.label, REUSED, "nothing changed", slot=", ".join(plan.slots_of(t)))
                for t in plan.techniques
            ]
            ledger.rows += plan.skipped
            self.frame.ledger = ledger
            self.frame.profiler = Profiler(settings.profile)
            self.frame.counters = {}
            self.frame.settings = settings
            self.frame.snapshot = snapshot  # the same but for what only `show` asks for, as the time
            return self.frame
        self._frame_key = key
        self._drop_frame()
        values = view.values(0, settings.seed, (0.0, 0.0), self.geometry.size)
        if self._view_block is None:
            self._view_block = Block(VIEW, **values)
        frame = Frame(
            snapshot, settings, view, plan, self.geometry, self.materials, environment,
            {}, Profiler(settings.profile), ledger, self._view_block, self._hierarchies,
            self._surface_means, self._opacity, self._glow, self._lamp_maps, lasting=self._lasting,
        )  # fmt: skip
        self.frame = frame
        environment.guide(None)
        for technique in plan.techniques:
            for write in technique.writes:
                if write.name not in frame.images and not write.by_need:
                    frame.images[write.name] = images.pool.take(*frame.size, write.format)
        for technique in plan.techniques:
            wanted = technique.key(snapshot, settings)
            if technique.name not in self._keys or self._keys[technique.name] != wanted:
                with frame.profiler.step(technique.name):
                    technique.prepare(frame)
                self._keys[technique.name] = wanted
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
        measured = frame.samples_to_draw if settings.whole else 0
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
            frame.shown.clear()
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
        frame.shown.clear()
        self._clear_sums(frame)
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
        frame.needless.clear()
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
            frame.read_with_counters(None)
            images.finish()
        else:  # the wait for the GPU, with what comes of it first
            read = frame.read_with_counters(frame.to_show(first))
        waited = time.perf_counter()
        sums = frame.sums
        out, bad = {}, 0
        for name in names:
            if name in sums and not frame.is_apart(name):
                raise KeyError(f"{name} is not held apart: settings.shows must name it when the picture begins.")
            if name not in frame.images:  # no technique of the plan brings such light
                out[name] = np.zeros((*frame.size[::-1], 4), np.float32)
                continue
            pixels = read if name == first else images.read(frame.to_show(name))
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
            worked = frame.counters.keys() | frame.needless.keys()
            shown = {
                t.name: self._row(frame, t, spent[t.name])
                for t in frame.plan.techniques
                if t.only_shows and t.name in worked
            }
            ledger.rows = [shown.get(row.name, row) for row in ledger.rows]
        else:
            rows = [self._row(frame, t, spent[t.name]) for t in frame.plan.techniques]
            ledger.rows = rows + list(frame.plan.skipped)
            ledger.times["passes"] = took
        ledger.times["readback"] = time.perf_counter() - waited
        ledger.samples = frame.samples_done
        ledger.bad_pixels = bad
        if self.publishes:
            ledger_module.publish(ledger)
        return out

    @staticmethod
    def _row(frame: Frame, technique: Technique, seconds: float) -> Row:
        slot = ", ".join(frame.plan.slots_of(technique))
        if technique.name in frame.needless:
            return Row(technique.name, technique.label, SKIPPED, frame.needless[technique.name], slot=slot)
        counters = frame.counters.get(technique.name, {})
        chosen = tuple(f"{of}: {why}" for of, why in frame.choices.get(technique.name, {}).items())
        return Row(technique.name, technique.label, RAN, "", 1000 * seconds, slot, counters, chosen)

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
        self._keys.clear()
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
            if self.materials.compiled[material].casts_by_lot
        ]
        wanted += [self.materials.opacity_program(k) for k in shown if self.materials.compiled[k].uneven]
        varied = [k for k in shown if self.materials.compiled[k].uneven_emission]
        wanted += [self.materials.emission_program(k) for k in varied]
        wanted += [self.materials.emission_map_program(k) for k in varied]
        wanted += [
            self.materials.tint_program(k)
            for k in shown
            if self.materials.compiled[k].tinted or self.materials.compiled[k].added
        ]
        wanted += [self.materials.glow_program(k) for k in shown if self.materials.compiled[k].glows]
        if plan.fills("subsurface"):
            wanted += [self.materials.scatter_program(k) for k in shown if self.materials.compiled[k].scatter > 0.0]
        return list(dict.fromkeys(wanted))

    def _content_key(self, snapshot: Snapshot, settings: Settings, plan: Plan) -> tuple:
        camera = snapshot.camera
        # Who may throw caustics, where objects are asked one by one (caustic_casters.py).
        casters = () if snapshot.film.caustics_refractive else tuple(i.caustics_caster for i in snapshot.instances)
        return (
            lights_key(snapshot), self._lamp_maps.changes, casters, self._environment[0], self.materials.fingerprint(),
            volumes_key(snapshot), snapshot.film,
            camera.matrix.tobytes(), camera.kind, camera.frame, camera.clip_start, camera.clip_end, camera.aperture,
            settings.seed, settings.bounces, settings.draft, settings.shows, settings.whole and settings.samples,
            settings.whole and (settings.sample_offset, settings.samples_to_draw),
            settings.whole and (settings.time_limit, settings.noise_threshold),
            tuple(sorted(settings.slots.items())), tuple(sorted(self.drawn_with(settings).items())),
            tuple(t.name for t in plan.techniques),
            tuple(one.links for one in snapshot.instances if one.links is not NO_LINKS),
            snapshot.own_values,
            snapshot.motion and snapshot.motion.key,
        )  # fmt: skip

    def _clear_all_sums(self, frame: Frame) -> None:
        self._clear_sums(frame)
        for name in frame.shown.values():
            frame.target(name).clear()

    def _clear_sums(self, frame: Frame) -> None:
        for write in frame.writes:
            if (write.accumulates or write.ranked) and write.name in frame.images:
                frame.target(write.name).clear()


def _stage(frame: Frame, stage: str) -> Iterator[None]:
    """Run a stage of all techniques in the plan's order, in parts, and take the time of each."""
    for technique in frame.plan.techniques:
        run = getattr(technique, stage)
        if getattr(run, "__func__", run) is getattr(Technique, stage):
            continue
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


def lights_key(snapshot: Snapshot) -> tuple:
    """Equal in two snapshots if all lamps give the same light."""
    return tuple(
        (light.key, light.kind, light.matrix.tobytes(), np.asarray(light.strength).tobytes(), light.normalize,
         light.radius, light.soft_falloff, light.angle, light.shape, light.size, light.spread, light.spot_angle,
         light.spot_blend, light.cast_shadow, light.caustics, light.bounces, light.visibility, light.own,
         *(() if light.graph is None else (light.graph, light.random, light.pass_index, light.color)), light.links)
        for light in snapshot.lights
    )  # fmt: skip
