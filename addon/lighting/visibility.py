"""Whether a point of a light is seen from a surface: what tells it (depth maps, rays, or edges: edge_shadows.py), and
drawing the maps. Which of maps and rays costs less: maps_or_rays.py.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from ..film import points as film_points
from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.technique import Param, Service, Technique
from ..gfx import images, passes
from ..gfx.library import Program
from ..gfx.struct import Block, Struct
from ..scene import acceleration
from ..scene.geometry import Draw
from ..snapshot.scene import Light, Snapshot
from ..sources import lights
from ..sources.rates import Rate
from . import depth_maps, edge_costs, repeated_light
from .edge_costs import FEW_EDGES
from .maps_or_rays import Compared, compared, maps_ns, rays_ns

RESOLUTION = Param(
    "texels_per_pixel", "Map resolution", 2.0,
    "Shadow map resolution, in texels per pixel of the picture's longer side",
    0.125, 16.0,
)  # fmt: skip
# Texels decide alone where casters let some light pass, and their error does not fall with samples: where leaves touch
# it outweighs noise from so many on. alpha_foliage, direct light, 64 samples: relMSE .0008 to .0006 (gloss .0097 to
# .0084) in 1.13 times the time; with 16 as much would be gained by more samples.
FINER_STOCHASTIC, FINER_FROM = 2.0, 64
MOST_RESOLUTION = 2048  # a map takes 84 MB then; with 4096 a handful of lights would need more than a GPU grants

BY_COST, BY_MAPS, BY_RAYS, BY_POINTS = "COST", "MAPS", "RAYS", "POINTS"
SHADOWS_BY = Param(
    "by", "Shadows by", BY_COST,
    "How visibility of a point on a light is tested. Rays need opaque casters and a hierarchy of all triangles",
    items=(
        (BY_COST, "What Costs Less", 0, "As measured on this device, for each light"),
        (BY_MAPS, "Depth Maps", 1, "Pictures of the scene as seen from points of the light"),
        (BY_RAYS, "Rays", 2, "A ray to a point of the light from each pixel"),
        (BY_POINTS, "Maps of Points", 3,
         "Of wide lamps, suns and the world many points in a sample, each with a small map drawn from points"),
    ),
)  # fmt: skip
PIXEL_SHARE = 0.1  # of a pixel's side on the nearest surfaces, by which rays may begin off them
ATLAS_TEXELS = 2**24  # maps of more views than this are drawn and used in several rounds
PART_TEXELS = 2**21  # after as many of a sample that is drawn in parts, a window answers


def map_resolution(frame: Frame, texels_per_pixel: float) -> int:
    """Side of a depth map in texels."""
    return side_of_map(frame.size, texels_per_pixel)


def side_of_map(size: tuple[int, int], texels_per_pixel: float) -> int:
    """The same for a picture of this size."""
    wished = max(size) * texels_per_pixel
    return int(np.clip(np.ceil(max(wished, 1.0) / 32) * 32, 32, MOST_RESOLUTION))


class VisibilityProvider(Service):
    """What tells whether points of lights are seen from surfaces. The one in the shadow slot serves the lamps.

    It says how it would have a light drawn, point by point (`traces` to `views`; by default as single points), and then
    answers batches of such points with a lookup and what that binds. `asks_views`: it answers by depth maps, so that a
    point without views is seen from everywhere.
    """

    name = "shadow"
    asks_views = True

    def serving(self, emitter: lights.Emitter) -> VisibilityProvider:
        """The provider of this lamp: itself, or one of several that it chooses among."""
        return self

    def serves_every_source(self, frame: Frame) -> bool:
        """Whether the world and emissive meshes are drawn as lights with extent that it serves, too."""
        return False

    def traces(self, frame: Frame, emitter: lights.Emitter) -> bool:
        """Whether rays take its place for this lamp."""
        return False

    def cell(self, frame: Frame, number: int, points: float) -> float:
        """Share of a light's extent, along each axis, that point `number` of `points` stands for; 0: a point alone;
        1: the whole light, from its middle."""
        return 0.0

    def part(self, frame: Frame, emitter: lights.Emitter, number: int, points: float) -> lights.Emitter | None:
        """The part of the light that point `number` of `points` stands for as a whole; None where it is a point."""
        return None

    def views(self, frame: Frame, emitter: lights.Emitter, sample: np.ndarray, number: int, cell: float = 0.0) -> list:
        """Views of the maps that point `number` of the light needs, at `sample`."""
        return []

    def rate(self, frame: Frame, rate: Rate) -> Rate:
        """How often it would have a light sampled whose rate is that elsewhere."""
        return rate

    def batches(self, frame: Frame, technique: Technique, points: list[LightPoint]) -> Iterator[Batch]:
        """The points in batches that fit a uniform block, each with what tells their visibility."""
        raise NotImplementedError


@dataclass
class LightPoint:
    """A point of a light that a sample draws: its row for the light list (lights.TEXELS, 4), the views of its map, and
    what tells from where it is seen."""

    row: np.ndarray
    provider: VisibilityProvider
    views: list = field(default_factory=list)

    @property
    def flags(self) -> int:
        """Of sources/lights.py."""
        return int(self.row[lights.LIGHT.at.flags])


@dataclass(frozen=True)
class TracedLobes(Service):
    """Lobes up to `roughness` find lights by rays of their own; points of lights leave that share to them."""

    name = "traced_lobes"
    roughness: float


def traced_roughness(frame: Frame) -> float:
    """Up to where lobes are traced; -1 where none are."""
    lobes = frame.service(TracedLobes)
    return -1.0 if lobes is None else lobes.roughness


@dataclass(frozen=True)
class Lookup:
    """GLSL with `float light_visibility(Light, ivec2 pixel, vec3 position, vec3 normal)`, a file below shaders/ or a
    text, and what else it binds. `maps`: it reads depth maps."""

    name: str
    file: str = ""
    text: str = ""
    textures: tuple[tuple[str, str], ...] = ()
    constants: tuple[tuple[str, str], ...] = ()
    defines: tuple[tuple[str, str], ...] = ()
    blocks: tuple[tuple[Struct, str], ...] = ()
    maps: bool = True


@dataclass(frozen=True)
class Maps:
    """Depth maps that were drawn: the atlas (None: rays take their place), its views for the uniform block, and what
    the lookup binds besides. `sparse`: they are asked at some pixels, and between where that does not suffice."""

    atlas: images.Image | None
    views: np.ndarray  # (V, VIEW_TEXELS, 4)
    lookup: Lookup
    textures: dict[str, images.Image] = field(default_factory=dict)
    constants: dict[str, object] = field(default_factory=dict)
    blocks: dict[str, Block] = field(default_factory=dict)
    sparse: bool = False
    drawing: Iterator[None] = field(default_factory=lambda: iter(()))  # to be exhausted before they are asked


# What lookups by rays bind besides the hierarchy, and that light takes the colours of layers that they pass.
RAY_CONSTANTS = (("FLOAT", "offset_size"),)
OF_LAYERS = (("LAYERS", "1"),)
HARD = Lookup("hard", "lib/hard_visibility.glsl")
EDGES = Lookup(
    "edge rays",
    "lib/edge_visibility.glsl",
    textures=acceleration.HIERARCHY_TEXTURES,
    constants=RAY_CONSTANTS,
)
RAYS = Lookup(
    "rays",
    "light/ray_visibility.glsl",
    textures=acceleration.HIERARCHY_TEXTURES,
    constants=RAY_CONSTANTS,
    defines=OF_LAYERS,
    maps=False,
)


def source_of(lookup: Lookup) -> tuple[tuple[str, str], ...]:
    """The snippet by which programs include a lookup."""
    return (("generated/visibility", lookup.text or f'#include "{lookup.file}"\n'),)


def ray_bindings(
    frame: Frame, passing: frozenset[int] = frozenset()
) -> tuple[dict[str, images.Image], dict[str, object]]:
    """Textures and RAY_CONSTANTS: what casts shadows, for rays; without objects of groups that let light pass."""
    hierarchy = frame.hierarchy("shadow", passing)
    textures = hierarchy.textures
    return textures, {"offset_size": frame.offset_size}


@dataclass(frozen=True)
class Layer:
    """Something on a material's surface that casts shadows beside it: drawn into depth maps with the mesh, which it
    rises `height` metres above, by a program like that of casters with textures and constants beside theirs."""

    program: Program
    textures: dict[str, images.Image]
    constants: dict[str, object]
    height: float


class Layers:
    """Layers by material (frame.shared), set before light is asked for."""

    def __init__(self):
        self.of: dict[int, Layer] = {}


def drawn_stochastically(frame: Frame, stopped: frozenset[int] = frozenset()) -> list[Draw]:
    """Casters that let some light pass, without the materials `stopped`."""
    compiled = frame.materials.compiled
    casting = {k for k, one in enumerate(compiled) if one.casts_stochastically and not one.bounds_alone} - stopped
    return [draw for draw in frame.geometry.draws if draw.material in casting]


def glass_absorbs(frame: Frame) -> bool:
    """Whether some caster is glass whose inside absorbs: of light that passes it straight maps do not know how far that
    goes through it, rays do."""
    absorbing = {k for k, one in enumerate(frame.materials.compiled) if any(one.absorbed_inside)}
    return bool(absorbing) and any(draw.material in absorbing for draw in drawn_stochastically(frame))


def by_rays(
    frame: Frame,
    views: Callable[[], list],
    resolution: int,
    technique: Technique | None = None,
    of: str = "light",
    needed: bool = False,
) -> bool:
    """Whether rays take the place of maps. `views` makes those of such a map, where they are asked for; without any
    there is no shadow to trace. The ledger's row of the `technique` says why, `of` which light. `needed`: maps do
    not know what casters let pass."""
    wanted = frame.settings.value("accumulated_maps", SHADOWS_BY)
    if wanted in (BY_MAPS, BY_POINTS) or frame.settings.schedule.is_draft or acceleration.too_many(frame.snapshot):
        return False
    layered = drawn_stochastically(frame) or frame.shared(Layers).of
    if layered and not needed:  # maps ask the material itself; rays know it by cells
        return False
    asked = views()
    if not asked or wanted == BY_RAYS or needed:
        return bool(asked)
    found = rays_beside(frame, asked, resolution)
    far_off = found.by_rays and _far_off(frame)
    if technique is not None:
        why = "maps, because rays begin too far off surfaces in so large a scene" if far_off else found.why
        frame.account.chose(technique, of, why)
    return found.by_rays and not far_off


def rays_beside(frame: Frame, views: list, resolution: int) -> Compared:
    """What a ray of each pixel costs beside these views."""
    points = film_points.points_of_sample(frame, frame.settings.value("film", film_points.POINTS))
    repeats = points - 1 if frame.settings.samples >= repeated_light.FEWEST else 0
    return compared(frame, views, resolution, repeats)


VIEWS = {"POINT": 6}  # of a map, by kind of lamp, where the lamp sees all around; one elsewhere


def foreseen(snapshot: Snapshot, settings: Settings, soft: bool = False) -> list[str]:
    """What is to be expected of `by_rays` before anything is drawn, as a sentence for each lamp with shadows: all
    casters are taken for seen by it. `soft`: lamps with extent have soft maps, or their edges where these are few
    (techniques/shadows_by_light.py). The ledger of a picture says what was chosen."""
    casters = [one for one in snapshot.instances if one.visibility.shadow]
    triangles = sum(snapshot.meshes[one.mesh].triangle_count for one in casters)
    lamps = [light for light in snapshot.lights if light.cast_shadow and np.any(light.strength)]
    wanted = settings.value("accumulated_maps", SHADOWS_BY)
    if wanted != BY_COST or not triangles or acceleration.too_many(snapshot):
        return []
    size = snapshot.film.width, snapshot.film.height
    side = side_of_map(size, settings.value("accumulated_maps", RESOLUTION))
    sentences = []
    for light in lamps:
        views = VIEWS.get(light.kind, 1)
        found = Compared(rays_ns(size[0] * size[1], triangles), maps_ns(triangles, views * side * side, views))
        why = found.why
        if soft and has_extent(light):
            why = "soft maps"
            if settings.value("shadows_by_light", FEW_EDGES):
                why = edge_costs.foreseen(size[0] * size[1], triangles, found)
        sentences.append(f"Shadows of {light.name}: {why}")
    return sentences


def has_extent(light: Light) -> bool:
    """Whether the light has extent, casts shadows, and gives something."""
    extent = {"SUN": light.angle, "AREA": max(map(abs, light.size), default=0.0)}.get(light.kind, light.radius)
    return light.cast_shadow and extent > 0.0 and bool(np.any(light.strength))


def _far_off(frame: Frame) -> bool:
    """Whether rays, which begin as far off a surface as float32 may be wrong about it, would pass below what touches it
    in a way that the picture shows: in pixels with little of a huge scene."""
    receivers = frame.receivers
    sides = (receivers.high - receivers.low).max(axis=1)
    return bool(len(sides)) and frame.offset_size > PIXEL_SHARE * float(np.percentile(sides, 10)) / receivers.side


NO_VIEWS = np.zeros((0, lights.VIEW_TEXELS, 4))


def traced_shadows(frame: Frame) -> Maps:
    """What is asked in place of maps: rays."""
    return Maps(None, NO_VIEWS, RAYS, *ray_bindings(frame))


class DepthMapService:
    """Draws depth maps for any technique that needs visibility from points or directions."""

    layers = True  # are drawn; where maps are filtered, which know one caster a texel, not

    def __init__(self):
        self._atlas = depth_maps.Atlas()

    def alpha_casters(self, frame: Frame, layers: bool = False) -> depth_maps.AlphaCasters:
        """What lets some light pass, and how to draw it; with what covers surfaces as `layers`."""
        materials, draws = frame.materials, drawn_stochastically(frame)
        programs = {
            index: (passes.get(materials.caster_program(index)), materials.bindings(index, frame.geometry.instances))
            for index in {draw.material for draw in draws}
        }
        covers = []
        found = frame.shared(Layers).of if layers else {}
        for draw in (one for one in frame.geometry.draws if one.material in found):
            layer = found[draw.material]
            bindings = materials.bindings(draw.material, frame.geometry.instances)
            bindings["textures"] |= layer.textures
            higher = replace(draw, low=draw.low - layer.height, high=draw.high + layer.height)
            covers.append((higher, passes.get(layer.program), bindings, layer.constants))
        return depth_maps.AlphaCasters(draws, programs, tuple(covers))

    def draw(self, frame: Frame, technique: Technique, views: list, resolution: int) -> Maps:
        """Draw the views, to be asked point by point, once `drawing` is exhausted."""
        cells, texels = self._atlas.prepare(views or [_NO_VIEW], resolution if views else 1)
        drawing = self._in_parts(frame, technique, views, cells) if views else iter(())
        return Maps(self._atlas.target.colors[0], texels, HARD, drawing=drawing)

    def _in_parts(self, frame: Frame, technique: Technique, views: list, cells) -> Iterator[None]:
        """Draws the views; yields now and then where a window waits."""
        alpha = self.alpha_casters(frame, self.layers)
        drawn = depth_maps.draw_views(
            self._atlas, views, cells, frame.geometry, alpha, frame.sample, lasting=not frame.settings.schedule.is_draft
        )
        frame.count(technique, "maps", len(views))
        texels = 0
        for (_, _, side), sent in zip(cells, drawn):
            frame.count(technique, "caster triangles", sent)
            texels += side * side
            if texels >= PART_TEXELS and frame.shared_out is not None:
                texels = 0
                yield

    def release(self) -> None:
        self._atlas.release()


Batch = tuple[list[LightPoint], Maps]


class Rays(VisibilityProvider):
    """A ray of each pixel to each point."""

    asks_views = False

    def batches(self, frame: Frame, technique: Technique, points: list[LightPoint]) -> Iterator[Batch]:
        for first in range(0, len(points), lights.MOST_LIGHTS):
            yield points[first : first + lights.MOST_LIGHTS], traced_shadows(frame)


class LinkedRays(Rays):
    """The same among the blockers of lights with shadow linking. It takes the place of whatever technique the shadow
    slot has: maps hold all casters."""

    def __init__(self, passing: frozenset[int]):
        self._passing = passing

    def batches(self, frame: Frame, technique: Technique, points: list[LightPoint]) -> Iterator[Batch]:
        maps = Maps(None, NO_VIEWS, RAYS, *ray_bindings(frame, self._passing))
        for first in range(0, len(points), lights.MOST_LIGHTS):
            yield points[first : first + lights.MOST_LIGHTS], maps


class ShadowLinks:
    """Providers by groups of blockers that let light pass (frame.shared)."""

    def __init__(self):
        self._made: dict[frozenset[int], LinkedRays] = {}

    def of(self, frame: Frame, passing: frozenset[int]) -> LinkedRays | None:
        """None where all block, and where rays cannot be traced."""
        if not passing or acceleration.too_many(frame.snapshot):
            return None
        return self._made.setdefault(passing, LinkedRays(passing))


class PlainMaps(VisibilityProvider):
    """Depth maps of single points or directions, with a resolution of its owner's."""

    def __init__(self, resolution: Callable[[Frame], int]):
        self.resolution = resolution
        self._service = DepthMapService()

    def batches(self, frame: Frame, technique: Technique, points: list[LightPoint]) -> Iterator[Batch]:
        resolution = self.resolution(frame)
        for own, views in rounds(frame, points, resolution):
            yield own, self._service.draw(frame, technique, views, resolution)

    def release(self) -> None:
        self._service.release()


_NO_VIEW = depth_maps.MapView(np.zeros((4, 4)), 1.0, (0.0, 0.0, 0.0, 0.0))


def rounds(
    frame: Frame, points: list[LightPoint], resolution: int, most_texels: int = ATLAS_TEXELS
) -> Iterator[tuple[list[LightPoint], list]]:
    """Split points so that a round with its views fits the atlas and the block; fills in the view numbers. Maps of a
    second round lie where those of the first were, whose light then cannot be repeated."""
    own, views, texels = [], [], 0
    for point in points:
        size = sum((resolution // view.scale) ** 2 for view in point.views)
        full = texels + size > most_texels or len(views) + len(point.views) > lights.MOST_VIEWS
        if own and (full or len(own) == lights.MOST_LIGHTS):
            yield own, views
            repeated_light.forbid(frame)
            own, views, texels = [], [], 0
        texels += size
        at = lights.LIGHT.at
        point.row[at.first_view], point.row[at.view_count] = len(views), len(point.views)
        own.append(point)
        views += point.views
    if own:
        yield own, views
