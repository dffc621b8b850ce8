"""Accumulated hard shadow maps: each sample, one point on each light and one depth map seen from it.

Every single map gives the exact hard shadow of one point of the light; the mean over the points is the exact soft
shadow. It converges to the truth for any light shape and any occluder, so all other shadow techniques are measured
against it. The points form a low-discrepancy set over the light, the error of a penumbra falls nearly like 1/n.

Maps are fitted to what the camera sees (addon/frame/depth_maps.py) and compared without a bias in metres by planes
stored per texel (shaders/lib/shadow.glsl). Casters with alpha are drawn stochastically, texel by texel.

| cost | per sample |
|---|---|
| maps | 1 view per light whose receivers lie within 68 degrees, up to 6 faces otherwise; more where depth asks for it |
| vertices | those of all casters, once per view |
| lookup per pixel and light | 1 texel of the map, 3 to 5 of the view list; with edge rays 4 texels |
| edge rays | 1 per pixel and light where the four texels do not agree and the penumbra is narrower than 4 texels |
| bytes | 20 per texel, (2 texels per picture pixel)^2 by default; 4 where light passes casters, from 64 samples on |

Where a ray of each pixel costs less than the maps of a light, or of the world's directions, or of points on emissive
surfaces, rays take their place (addon/frame/ray_costs.py): the same points of the light, without texels. Seconds and
relMSE of direct light, 256x192, 16 samples, llvmpipe, by maps and by rays: instances 2.95 .0214 and 2.16 .0212, garden
1.79 .0067 and 1.60 .0066, Cornell box .82 .0019 and .44 .0018, door 1.10 .0329 and .53 .0319, window 1.80 .0652 and
1.46 .0643; with all light, where points of the film at edges ask again, Cornell box 3.1 and 2.4, door 4.2 and 3.1,
garden and window alike.

Edge rays (shaders/lib/edge_visibility.glsl; Lauterbach, Mo, Manocha 2009) take the map's resolution out of sharp edges
and of contacts: without them a pixel just behind a blocker that it touches is lit at every resolution. relMSE of direct
light at 64 samples, before and after: fence 0.0152 and 0.0016, poles 0.0031 and 0.0005, foliage 0.077 and 0.023, grid
0.0058 and 0.0034 (128x96); garden 0.0017 and 0.0009, instances 0.0039 and 0.0032, hall 0.0055 and 0.0045 (256x192), in
1.35, 0.95 and 1.05 times the processor time.

Fails: with few samples penumbrae show steps; casters thinner than a texel are missed in single samples (their mean
is right but for edge rays); a receiver that no fitted view contains counts as lit. With rays faces that are shaded
smoothly but drawn flat have the shadow of their own edges, as in Cycles.

Bias: none for the diffuse path. On soft-edged point and spot lights the depth map is drawn from a point in the ball
while light arrives from its projection onto the disc that faces the receiver (as in Cycles): the difference is of
the order of (radius / distance)^2; where that is more than 1/16, direct_light traces rays. Where a light brings less
than `cutoff` of the picture's median light, it is left unshadowed: at most that share of light too much, for views and
casters that a picture with many lights need not draw. Under edge rays sharp shadows of casters narrower than half a
texel, f texels, are 2 f^2 instead of f wide: at most an eighth of a texel is missing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from ..frame import acceleration, depth_maps, lights
from ..frame.geometry import Draw
from ..frame.ray_costs import rays_cost_less
from ..frame.run import Frame
from ..frame.settings import Settings
from ..frame.technique import Param, Technique
from ..gfx import images, passes
from ..gfx.struct import Block, Struct
from ..snapshot.scene import Snapshot
from . import film_points, repeated_light
from .film import Film
from .surfaces import TILE

RESOLUTION = Param(
    "texels_per_pixel", "Map resolution", 2.0,
    "Texels of a depth map per pixel of the picture's longer side", 0.125, 16.0,
)  # fmt: skip
# Texels decide alone where casters let some light pass, and their error does not fall with samples: where leaves touch
# it outweighs noise from so many on. alpha_foliage, direct light, 64 samples: relMSE .0008 to .0006 (gloss .0097 to
# .0084) in 1.13 times the time; with 16 as much would be gained by more samples.
FINER_BY_LOT, FINER_FROM = 2.0, 64
MOST_RESOLUTION = 2048  # a map takes 84 MB then; with 4096 a handful of lights would need more than a GPU grants
CUTOFF = Param(
    "cutoff", "Shadow cutoff", 0.001,
    "Where a light can bring less than this share of the picture's median light, its shadows are left out", 0.0, 0.1,
    "FACTOR",
)  # fmt: skip
EDGE_RAYS = Param(
    "edge_rays", "Edge rays", True,
    "Where the texels of a map do not agree and the penumbra is narrow, a ray tells whether a point is in shadow",
    draft=False,
)  # fmt: skip
BY_COST, BY_MAPS, BY_RAYS = "COST", "MAPS", "RAYS"
SHADOWS_BY = Param(
    "by", "Shadows by", BY_COST,
    "What tells whether a point of a light is seen. Rays need opaque casters, and a hierarchy of all triangles",
    items=((BY_COST, "What costs less", 0), (BY_MAPS, "Depth maps", 1), (BY_RAYS, "Rays", 2)),
)  # fmt: skip
PIXEL_SHARE = 0.1  # of a pixel's side on the nearest surfaces, by which rays may begin off them
ATLAS_TEXELS = 2**24  # maps of more views than this are drawn and used in several rounds
PART_TEXELS = 2**21  # after as many of a sample that is drawn in parts, a window answers


def map_resolution(frame: Frame, texels_per_pixel: float) -> int:
    """Side of a depth map in texels."""
    wished = max(frame.size) * texels_per_pixel
    return int(np.clip(np.ceil(max(wished, 1.0) / 32) * 32, 32, MOST_RESOLUTION))


@dataclass(frozen=True)
class Lookup:
    """GLSL file with `float light_visibility(Light, ivec2 pixel, vec3 position, vec3 normal)` and what else it binds.
    `maps`: it reads depth maps."""

    name: str
    file: str
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


# What lookups by rays bind besides the hierarchy.
RAY_CONSTANTS = (("FLOAT", "offset_size"),)
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
    maps=False,
)


def ray_bindings(frame: Frame) -> tuple[dict[str, images.Image], dict[str, object]]:
    """Textures and RAY_CONSTANTS: what casts shadows, for rays."""
    hierarchy = frame.hierarchy("shadow")
    textures = hierarchy.textures
    return textures, {"offset_size": frame.offset_size}


def drawn_by_lot(frame: Frame) -> list[Draw]:
    """Casters that let some light pass."""
    return [draw for draw in frame.geometry.draws if frame.materials.compiled[draw.material].casts_by_lot]


def by_rays(frame: Frame, views: Callable[[], list], resolution: int) -> bool:
    """Whether rays take the place of maps. `views` makes those of such a map, where they are asked for; without any
    there is no shadow to trace."""
    wanted = frame.settings.get(AccumulatedMaps, SHADOWS_BY.name)
    if wanted == BY_MAPS or frame.settings.draft or acceleration.too_many(frame.snapshot):
        return False
    if drawn_by_lot(frame):  # maps ask the material itself; rays know it by cells
        return False
    asked = views()
    if not asked or wanted == BY_RAYS:
        return bool(asked)
    points = film_points.points_of_sample(frame, frame.settings.get(Film, film_points.POINTS.name))
    repeats = points - 1 if frame.settings.samples >= repeated_light.FEWEST else 0
    return not _far_off(frame) and rays_cost_less(frame, asked, resolution, repeats)


def _far_off(frame: Frame) -> bool:
    """Whether rays, which begin as far off a surface as float32 may be wrong about it, would pass below what touches it
    in a way that the picture shows: in pixels with little of a huge scene."""
    receivers = frame.receivers
    sides = (receivers.high - receivers.low).max(axis=1)
    return bool(len(sides)) and frame.offset_size > PIXEL_SHARE * float(np.percentile(sides, 10)) / TILE


NO_VIEWS = np.zeros((0, lights.VIEW_TEXELS, 4))


def traced_shadows(frame: Frame) -> Maps:
    """What is asked in place of maps: rays."""
    return Maps(None, NO_VIEWS, RAYS, *ray_bindings(frame))


class DepthMapService:
    """Draws depth maps for any technique that needs visibility from points or directions."""

    def __init__(self):
        self._atlas = depth_maps.Atlas()

    def alpha_casters(self, frame: Frame) -> depth_maps.AlphaCasters:
        """What lets some light pass, and how to draw it."""
        materials, draws = frame.materials, drawn_by_lot(frame)
        programs = {
            index: (passes.get(materials.caster_program(index)), materials.bindings(index, frame.geometry.instances))
            for index in {draw.material for draw in draws}
        }
        return depth_maps.AlphaCasters(draws, programs)

    def draw(self, frame: Frame, technique: Technique, views: list, resolution: int) -> Maps:
        """Draw the views, to be asked point by point, once `drawing` is exhausted."""
        cells, texels = self._atlas.prepare(views or [_NO_VIEW], resolution if views else 1)
        drawing = self._in_parts(frame, technique, views, cells) if views else iter(())
        return Maps(self._atlas.target.colors[0], texels, HARD, drawing=drawing)

    def _in_parts(self, frame: Frame, technique: Technique, views: list, cells) -> Iterator[None]:
        """Draws the views; yields now and then where a window waits."""
        drawn = depth_maps.draw_views(
            self._atlas, views, cells, frame.geometry, self.alpha_casters(frame), frame.sample,
            lasting=not frame.settings.draft,
        )  # fmt: skip
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


_NO_VIEW = depth_maps.MapView(np.zeros((4, 4)), 1.0, (0.0, 0.0, 0.0, 0.0))


def rounds(
    frame: Frame, items: list[tuple[np.ndarray, list]], resolution: int, most_texels: int = ATLAS_TEXELS
) -> Iterator[tuple[list[np.ndarray], list]]:
    """Split lights (rows, views) so that a round fits the atlas and the block; fills in the view numbers. Maps of a
    second round lie where those of the first were, whose light then cannot be repeated."""
    rows, views, texels = [], [], 0
    for row, own in items:
        size = sum((resolution // view.scale) ** 2 for view in own)
        full = texels + size > most_texels or len(views) + len(own) > lights.MOST_VIEWS
        if rows and (full or len(rows) == lights.MOST_LIGHTS):
            yield rows, views
            repeated_light.forbid(frame)
            rows, views, texels = [], [], 0
        texels += size
        row[0, 2:4] = len(views), len(own)
        rows.append(row)
        views += own
    if rows:
        yield rows, views


class AccumulatedMaps(Technique):
    name = "accumulated_maps"
    label = "Accumulated shadow maps"
    slot = "shadow"
    params = (RESOLUTION, CUTOFF, EDGE_RAYS, SHADOWS_BY)
    atlas_texels = ATLAS_TEXELS

    def __init__(self):
        self.service = DepthMapService()
        self._reached: dict[str, depth_maps.Receivers] = {}

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        if not any(light.cast_shadow and np.any(light.strength) for light in snapshot.lights):
            return "no light casts a shadow"
        if not any(instance.visibility.shadow for instance in snapshot.instances):
            return "no object casts a shadow"
        return None

    def run(self, frame: Frame) -> None:
        frame.services["shadow"] = self
        if frame.sample == 0:
            self._find_reached(frame)

    def serving(self, emitter: lights.Emitter) -> AccumulatedMaps:
        """The kind of maps that this light has."""
        return self

    def _find_reached(self, frame: Frame) -> None:
        """For each light the receivers where its shadows can be seen (see CUTOFF)."""
        self._reached = {}
        receivers = frame.receivers
        emitters = frame.emitters
        if receivers is None or not len(receivers.distance) or not emitters:
            return
        centre = (receivers.low + receivers.high) / 2
        typical = np.zeros(len(centre))  # irradiance at the tiles' centres if nothing is blocked
        largest = []
        for emitter in emitters:
            strength = float(np.abs(emitter.radiance).max())
            if emitter.kind == lights.SUN:
                typical += strength * emitter.area
                largest.append(np.full(len(centre), np.inf))
                continue
            strength *= emitter.area if emitter.area > 0 else 1.0
            strength *= emitter.concentration
            nearest = np.clip(emitter.centre, receivers.low, receivers.high)
            reach = float(np.linalg.norm(emitter.u[:3]) + np.linalg.norm(emitter.v[:3])) if emitter.has_span else 0
            gap = np.maximum(np.linalg.norm(nearest - emitter.centre, axis=1) - reach, 1e-6 * frame.geometry.size)
            largest.append(strength / gap**2)
            middle = np.linalg.norm(centre - emitter.centre, axis=1)
            typical += strength / np.maximum(middle, max(reach, emitter.radius, 1e-6 * frame.geometry.size)) ** 2
        # The median, not the mean: the tile next to a lamp must not decide for the room.
        least = frame.settings.get(self, "cutoff") * float(np.median(typical))
        for emitter, most in zip(emitters, largest):
            keep = most >= least
            self._reached[emitter.light.key] = depth_maps.Receivers(
                receivers.low[keep], receivers.high[keep], receivers.distance[keep]
            )

    def resolution(self, frame: Frame) -> int:
        finer = FINER_BY_LOT if frame.settings.samples >= FINER_FROM and drawn_by_lot(frame) else 1.0
        return map_resolution(frame, finer * frame.settings.get(self, "texels_per_pixel"))

    def cell(self, frame: Frame, number: int, points: float) -> float:
        """Share of a light's extent, along each axis, that the map of point `number` of `points` stands for; 0: a point
        alone; 1: the whole light, from its middle."""
        return 0.0

    def part(self, frame: Frame, emitter: lights.Emitter, number: int, points: float) -> lights.Emitter | None:
        """The part of the light that point `number` of `points` stands for as a whole; None where it is a point."""
        return None

    def traces(self, frame: Frame, emitter: lights.Emitter) -> bool:
        """Whether rays take the place of this light's maps."""
        return by_rays(frame, lambda: self.views(frame, emitter, emitter.middle(), 0), self.resolution(frame))

    def views(self, frame: Frame, emitter: lights.Emitter, sample: np.ndarray, number: int, cell: float = 0.0) -> list:
        """Views that cover point `number` of the light, at `sample`, for all receivers."""
        receivers = self._reached.get(emitter.light.key)
        if not emitter.light.cast_shadow or receivers is None or not len(receivers.distance):
            return []
        jitter = self.jitter(frame, emitter, number)
        if emitter.kind == lights.SUN:
            reach = cell * np.tan(min(emitter.radius, 1.5))
            return depth_maps.directional_views(
                sample, frame.receivers, frame.geometry, jitter, self.resolution(frame), reach
            )
        axis, cone = None, np.inf
        if emitter.kind in (lights.RECTANGLE, lights.ELLIPSE):
            axis, cone = emitter.axis, emitter.spread or np.inf
        elif emitter.flags & lights.SPOT_FLAG:
            half = emitter.light.spot_angle / 2
            if half < np.pi / 2 - 0.01:
                axis, cone = emitter.axis, _spot_tangent(emitter, half)
        return depth_maps.point_views(
            emitter.position(sample), axis, cone, receivers, frame.geometry, jitter, self.resolution(frame),
            cell * emitter.reach,
        )  # fmt: skip

    def jitter(self, frame: Frame, emitter: lights.Emitter, number: int) -> tuple[float, float, float, float]:
        """Shift and turn of the maps of point `number`."""
        return (*frame.random_at(number, "map"), *frame.random_at(number, "map/turn"))

    def most_texels(self, frame: Frame) -> int:
        """Of the views of a round."""
        return self.atlas_texels

    def draw(self, frame: Frame, views: list) -> Maps:
        """Draw the views of a round. The maps may be asked once `drawing` is exhausted."""
        maps = self.service.draw(frame, self, views, self.resolution(frame))
        if not (views and frame.settings.get(self, "edge_rays")) or acceleration.too_many(frame.snapshot):
            return maps
        textures, constants = ray_bindings(frame)
        return replace(maps, lookup=EDGES, textures=textures, constants=constants)

    def release(self) -> None:
        self.service.release()


def _spot_tangent(emitter: lights.Emitter, half: float) -> float:
    """Tangent of the cone's half angle; a scaled spot object has an elliptic cone, its wider side counts."""
    scale = np.linalg.norm(emitter.light.matrix[:3, :3], axis=0)
    stretch = max(scale[0], scale[1]) / max(scale[2], 1e-12)
    return float(np.tan(half) * stretch) * 1.001
