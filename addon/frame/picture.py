"""One picture in the making: what techniques see while it is drawn, and by which they know of each other.

A frame holds the scene, the settings and the plan of one picture, its images by name, and what is drawn now: which
sample, through which point of the film and of the aperture. Services, shared objects and counters go through it, so
that techniques need not import one another. Frames are made by the renderer (run.py), which takes back their images.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeVar

import numpy as np

from ..gfx import images
from ..gfx.readback import Readback
from ..gfx.struct import Block
from ..gfx.timing import Profiler
from ..materials.compiled import CompiledMaterial
from ..sampling.lens import point_of
from ..sampling.sequence import FILM, LENS, alike, point, third, uniform
from ..scene import panorama
from ..scene.acceleration import Hierarchy, HierarchyCache
from ..scene.emission_maps import EmissionMaps
from ..scene.geometry import SceneGeometry
from ..scene.materials import MaterialSet
from ..scene.opacity_maps import OpacityMaps
from ..scene.receivers import Receivers
from ..scene.surface_means import SurfaceMeans
from ..scene.view import View, blackman_harris_offset
from ..snapshot.scene import Snapshot
from ..sources.environment import Environment
from ..sources.lamp_maps import LampMaps
from ..sources.lights import Emitter, emitters
from .account import Account
from .bands import Bands
from .held import Held
from .history import Before
from .ledger import Ledger
from .plan import Plan
from .settings import Settings
from .technique import Service, Technique

ServiceT = TypeVar("ServiceT", bound=Service)
SharedT = TypeVar("SharedT")

FOOTPRINT = 0.96  # side of a square that deviates as much as a pixel filter of half width 1
FAR_BEYOND = 300.0  # typical distances of what is seen
ORTHOGRAPHIC_DISTANCE = 1.4  # widths of what is seen: a lens of 50 mm before a sensor of 36 mm


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
    images: dict[str, images.Image]  # those of `held`, by name
    held: Held
    profiler: Profiler
    ledger: Ledger
    view_block: Block
    hierarchies: HierarchyCache
    surface_means: SurfaceMeans
    measured_opacity: OpacityMaps
    measured_emission: EmissionMaps
    lamp_maps: LampMaps
    view_rows: np.ndarray | None = None  # (4, 4) this sample's projection: rows x, y, w, q
    tiles: list[panorama.Tile] = field(default_factory=list)  # by which a panoramic camera is drawn; else none
    sample: int = 0  # the sample that is running
    at: str = ""  # label of the technique that is at work, or was last
    film_points: int = 1  # of each sample (film/points.py); the surface technique sets it before it calls `look`
    samples_done: int = 0
    part_done: float = 0.0  # of the first sample, what its sums hold already and can be shown
    numbers: tuple[int, ...] | None = None  # of the samples to draw; None: those of the settings' slice
    first_part: int | None = None  # samples in the sums of half the samples, where they are not half (time_steps.py)
    drawn_s: float = 0.0  # seconds that the samples took so far, without what others did between their parts
    find_receivers: Callable[[], Receivers] | None = None
    account: Account = field(default_factory=Account)  # what techniques tell of their work
    shared_out: Bands | None = None  # for a picture that is drawn between other work
    picture: str = "film.combined"  # the image that is shown; a technique that shows another one says so in `show`
    lasting: dict[type, object] = field(default_factory=dict)  # see `kept`; the renderer's
    read_last: set[str] = field(default_factory=set)  # images of the last sample that `end` reads; said in `begin`
    before: Before | None = None  # the picture before this one, where techniques remember it
    first_rows: np.ndarray | None = None  # `view_rows` of the first sample
    readback: Readback = field(default_factory=Readback)
    _services: dict[type[Service], Service] = field(default_factory=dict)
    _shared: dict[type, object] = field(default_factory=dict)
    _hierarchies: dict[tuple, Hierarchy | None] = field(default_factory=dict)  # of this frame, see `hierarchy`
    _receivers: Receivers | None = None
    _film_offsets: dict[int, tuple[float, float]] = field(default_factory=dict)

    def __post_init__(self):
        self.target, self.count = self.held.target, self.account.count  # asked for in each pass

    @cached_property
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
        """Boxes around what the camera sees; None where no technique finds any. The first access may wait for a
        readback from the GPU, so draw first what does not depend on it."""
        if self._receivers is None and self.find_receivers is not None:
            self._receivers, self.find_receivers = self.find_receivers(), None
        return self._receivers

    @cached_property
    def emitters(self) -> list[Emitter]:
        """The scene's lights of nonzero power, sorted so that neither names nor their order in the scene matter."""
        return emitters(self.snapshot, self.geometry.origin, self.lamp_maps)

    def random(self, use: str, at: int | None = None) -> tuple[float, float]:
        """This sample's point of the sequence for `use`; or the point number `at`, for uses that take more or fewer
        points than samples."""
        return point(self.sample if at is None else at, use, self.settings.seed)

    def uniform(self, use: str) -> float:
        """A number in 0..1 of this sample to choose one of several things by; `random` then gives a point on it."""
        return uniform(self.sample, use, self.settings.seed)

    def random_volume(self, use: str, at: int | None = None, evenly: bool = False) -> tuple[float, float, float]:
        """A point with a third number; `evenly`: of the set that stands for parts of what is drawn (sequence.alike)."""
        at = self.sample if at is None else at
        if evenly:
            return alike(at, use, self.settings.seed)
        return *self.random(use, at), third(at, use, self.settings.seed)

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
        if self.snapshot.camera.panorama is not None:
            self.tiles = self.tiles or panorama.tiles_of(self.view)
            panorama.look(self.tiles, self.view, number, settings.seed, self.geometry.size, lens, self._footprints())
        if self.is_first and film is None:
            self.first_rows = self.view_rows

    def _footprints(self) -> tuple[float, float]:
        """Sides in pixels of the squares over which lookups of textures average (materials/averages.py). All samples
        of a picture, and their points of the film, share what the pixel filter covers; where any number of samples may
        be shown, sample n takes the n-th of it."""
        samples = self.settings.samples if self.settings.schedule.known_total else self.sample + 1
        side = FOOTPRINT * self.snapshot.film.filter_width * (self.film_points * samples) ** -0.5
        return side, side if self.is_first else 0.0

    def film_offset(self, number: int) -> tuple[float, float]:
        """Where point `number` of the film lies, in pixels from a pixel's middle."""
        found = self._film_offsets.get(number)
        if found is None:
            width, (x, y) = self.snapshot.film.filter_width, self.random(FILM, number)
            found = blackman_harris_offset(x, width), blackman_harris_offset(y, width)
            self._film_offsets[number] = found
        return found

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
        """The bounding volume hierarchy of the triangles that rays of a path (a field of snapshot.scene.Visibility, as
        "shadow") can hit, without objects of the groups of blockers `passing` (snapshot/linking.py); None where the
        scene has too many triangles. Built on the first call."""
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

    def drop(self) -> None:
        """Give back the images of the frame."""
        self.readback.drop()
        self.account.drop()
        if self.before is not None:
            self.before.drop()
        self.held.drop()

    def bands(self, technique: Technique, part: str = "") -> Iterator[tuple[int, int]]:
        """Rows (from, to) of the picture: a long pass draws them one after the other, with a `yield` after each.

        A technique with several long passes names the `part`, since each has its own time.
        """
        height = self.size[1]
        return iter([(0, height)]) if self.shared_out is None else self.shared_out.split(technique.name + part, height)
