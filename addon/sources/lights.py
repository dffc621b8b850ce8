"""Lights as shaders read them: the record of a light, declared once for both, and this sample's point on each.

Radiance follows Cycles' conventions for every kind. All points inside a light come from the frame's sequence.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from ..gfx import images
from ..gfx.context import to_hold
from ..gfx.records import Record
from ..gfx.struct import Block, Struct
from ..snapshot.scene import LAST_GROUP, Light, Links, Snapshot
from .lamp_maps import LampMaps

LIGHT = Record(
    "Light",
    fetch="sources.light[{}]",
    texels=(
        ("int kind:4 unlit", "int flags", "int first_view", "int view_count"),  # unlit: groups of receivers, a bit each
        ("vec3 centre", "float radius"),  # suns, directions: unit vector towards the light, half angle
        ("vec3 point", "float rate"),  # of this sample; how many of a light a sample has on average (rates.py)
        ("vec3 radiance", "float area"),
        ("vec3 axis", "float spread"),  # of emission, unit; tan of the half spread, 0: Lambertian
    ),
    asked=(
        # Half width of an area light, or row of a spot's inverse matrix; cosine of half cone, or of a point on a
        # surface the groups of receivers that some emissive mesh does not light, a bit each.
        ("vec3 u", "float cone"),
        # Half height, or row; 1 / ((1 - cosine) blend), 0: a hard edge, or of a point on a surface
        # EmissiveTriangles.level, W / (m2 sr).
        ("vec3 v", "float edge"),
        # Row; for light_least of shaders/light/sources.glsl: m2, of points on surfaces over their area, which pixels
        # that draw points of their own replace.
        ("vec3 w", "float footprint"),
    ),
    kinds=("POINT", "SPHERE", "SUN", "RECTANGLE", "ELLIPSE", "DIRECTION", "SURFACE"),
    flags=(
        "DIFFUSE", "GLOSSY", "SHADOW", "SPOT", "CAMERA",
        "TRACED",  # rays of narrow lobes look for it
        "WHOLE",  # it is not sampled by a point
        "NEAR",  # rays are traced where it is near; no shader asks for it
        "TRANSMISSION",
        "SIDED",  # of a point on a surface: it shines only to where its normal points
        "EVEN",  # of a world of one colour
        "GLASS_BLOCKS",  # what passes glass arrives as photons of caustics
        "NARROW",  # `point` is a direction within its spread, not a place on it
        "MAPPED",  # its node tree varies; the bits above are the number of its map (lamp_maps.py)
    ),
    constants={"MAP_SHIFT": 14, "AS_A_WHOLE": 8},
)  # fmt: skip
TEXELS = LIGHT.texels
VIEW_TEXELS = 5
MOST_LIGHTS, MOST_VIEWS = 64, 96  # together just below the 16 KiB that every GPU grants a uniform block
SOURCES = Struct("Sources", ("vec4", f"light[{MOST_LIGHTS * TEXELS}]"), ("vec4", f"view[{MOST_VIEWS * VIEW_TEXELS}]"))
POINT, SPHERE, SUN, RECTANGLE, ELLIPSE, DIRECTION, SURFACE = LIGHT.kinds.values()
# What the lights of a pass may be, as bits: each kind, and WHOLE for those that are not sampled by a point. A lighting
# pass is compiled for one of few sets, so that it leaves out the rest and a change of a lamp compiles nothing.
WHOLE = LIGHT.constants["AS_A_WHOLE"]
LAMPS = sum(1 << kind for kind in (POINT, SPHERE, SUN, RECTANGLE, ELLIPSE))
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
SMALLEST = 1e-12  # metres or radians: smaller sizes count as none, since radiance over their square leaves float32
BRIGHTEST = 1e30  # W / (m2 sr): a light that would be brighter at its size counts as larger, or as a point
LEAST_SPREAD = np.radians(1.0)  # as in Cycles, which lets no area light be narrower
NO_BLEND = 1e-7  # of a cone's cosine: float32 holds no narrower edge, and its inverse may not fit
DIFFUSE_FLAG, GLOSSY_FLAG, SHADOW_FLAG, SPOT_FLAG, CAMERA_FLAG, TRACED_FLAG, WHOLE_FLAG = (
    LIGHT.flags[name] for name in ("DIFFUSE", "GLOSSY", "SHADOW", "SPOT", "CAMERA", "TRACED", "WHOLE")
)
NEAR_FLAG, TRANSMISSION_FLAG, SIDED_FLAG, EVEN_FLAG, GLASS_BLOCKS_FLAG, NARROW_FLAG, MAPPED_FLAG = (
    LIGHT.flags[name] for name in ("NEAR", "TRANSMISSION", "SIDED", "EVEN", "GLASS_BLOCKS", "NARROW", "MAPPED")
)
KIND_STEPS = 16  # in the steps of a row's `kind` stand the groups of receivers that a light does not light, 12 bits
MAP_SHIFT = LIGHT.constants["MAP_SHIFT"]


@dataclass(frozen=True)
class Emitter:
    """A light in the frame's units: positions relative to the render origin, radiance ready to use."""

    light: Light | None  # None: a part of the world
    kind: int
    flags: int
    centre: np.ndarray  # (3,); for suns the unit vector towards the light
    radius: float  # metres; for suns the half angle
    radiance: np.ndarray  # (3,); radiant intensity for a radius of 0
    area: float  # m2; for suns steradians
    axis: np.ndarray  # (3,) unit, the direction of emission
    spread: float  # tan of the half spread; 0 = Lambertian
    u: np.ndarray  # (3,) half width vector, or (4,) rows for spots
    v: np.ndarray
    w: np.ndarray
    maps: images.Image | None = None  # of lamp_maps.py, where MAPPED_FLAG is set

    @property
    def has_span(self) -> bool:
        """Whether `u` and `v` are the half axes of an area light; for spots they hold the cone's matrix."""
        return self.kind in (RECTANGLE, ELLIPSE)

    @property
    def is_flat(self) -> bool:
        """Whether two numbers choose a point of it: of a ball's, depths fill in what the first two leave."""
        return self.kind not in (POINT, SPHERE)

    @property
    def concentration(self) -> float:
        """How much brighter it is along its axis than without a spread (spread_attenuation in light/sources.glsl)."""
        half = np.arctan(self.spread)
        return float(self.spread / (self.spread - half if half > 0.05 else half**3 / 3.0)) if half > 0 else 1.0

    @property
    def power(self) -> float:
        """For choosing among many lights: total strength, W (suns: W/m2)."""
        return float(np.abs(self.light.strength).sum())

    def sample(self, x: float, y: float, z: float) -> np.ndarray:
        """This sample's point from three uniform numbers: position, offset from the centre, or direction."""
        if self.kind in (POINT, SPHERE):
            return _ball_offset(x, y, z) * self.radius
        if self.kind == SUN:
            return _cone_direction(self.centre, self.radius, x, y)
        if self.kind == RECTANGLE:
            return self.centre + (2 * x - 1) * self.u[:3] + (2 * y - 1) * self.v[:3]
        radius, turn = np.sqrt(x), 2 * np.pi * y
        return self.centre + radius * (np.cos(turn) * self.u[:3] + np.sin(turn) * self.v[:3])

    def is_narrow(self, receivers) -> bool:
        """Whether its spread lets most of scene.receivers.Receivers (or None) see only a part of it."""
        if not (self.has_span and self.spread > 0.0) or receivers is None or not len(receivers.distance):
            return False
        distance = np.median(np.linalg.norm((receivers.low + receivers.high) / 2 - self.centre, axis=1))
        return bool(np.pi * (self.spread * distance) ** 2 < self.area)

    def narrow_sample(self, x: float, y: float) -> np.ndarray:
        """In place of `sample`, for rows with NARROW_FLAG: a unit vector towards the light, drawn as it shines."""
        u, v = _beside(np.asarray(self.axis, np.float64).tobytes())
        # The tangent r of the angle has density r (h - r): inverse of 3 x^2 - 2 x^3.
        tangent = self.spread * (0.5 - np.sin(np.arcsin(1.0 - 2.0 * x) / 3.0))
        turn = 2.0 * np.pi * y
        return _unit(tangent * (np.cos(turn) * u + np.sin(turn) * v) - self.axis)

    def part(self, x: float, y: float, count: int) -> Emitter | None:
        """The one of `count` alike parts, as square as can be, that holds the point (x, y) of the unit square.

        None where the light cannot be cut so: only rectangles, in two again and again.
        """
        if self.kind != RECTANGLE or count < 1 or count & (count - 1):
            return None
        u, v, sides = self.u, self.v, [1, 1]
        while sides[0] * sides[1] < count:
            sides[int(np.linalg.norm(u) / sides[0] < np.linalg.norm(v) / sides[1])] *= 2
        place = [2 * (np.floor(value * side) + 0.5) / side - 1 for value, side in zip((x, y), sides)]
        centre = self.centre + place[0] * u + place[1] * v
        return replace(self, centre=centre, u=u / sides[0], v=v / sides[1], area=self.area / count)

    def middle(self) -> np.ndarray:
        """The sample that stands for the whole light."""
        return np.zeros(3) if self.kind in (POINT, SPHERE) else self.centre

    @property
    def reach(self) -> float:
        """Half of the longest extent, metres; not for suns."""
        return float(np.hypot(np.linalg.norm(self.u[:3]), np.linalg.norm(self.v[:3]))) if self.has_span else self.radius

    @property
    def extended(self) -> bool:
        return self.has_span or self.radius > 0

    def position(self, sample: np.ndarray) -> np.ndarray:
        """World position (relative to the origin) of a sample; not for suns."""
        return self.centre + sample if self.kind in (POINT, SPHERE) else sample

    @cached_property
    def _fixed(self) -> np.ndarray:
        """What is the same in each row of it."""
        rows = LIGHT.rows(
            centre=self.centre, radius=self.radius, area=self.area, axis=self.axis, spread=self.spread,
            u=self.u[:3], v=self.v[:3], w=self.w,
        )  # fmt: skip
        if len(self.u) > 3:  # of a spot
            rows[LIGHT.at.cone], rows[LIGHT.at.edge] = self.u[3], self.v[3]
        return rows

    def row(
        self, sample: np.ndarray, first_view: int, view_count: int, weight: float = 1.0, rate: float = 1.0,
        points: float = np.inf,
    ) -> np.ndarray:  # fmt: skip
        """(TEXELS, 4) float64 for the light list. `weight` is 1 / probability of having been chosen, `rate` how many
        points of this light a sample of the picture has on average, and `points` how many the whole picture has."""
        flags = self.flags if view_count else self.flags & ~SHADOW_FLAG
        kind = self.kind + (unlit_bits(self.light.links) if self.light is not None else 0)
        rows = self._fixed.copy()
        at = LIGHT.at
        rows[0] = kind, flags, first_view, view_count
        rows[at.point], rows[at.rate] = sample, rate
        rows[at.radiance] = self.radiance * weight / rate
        rows[at.footprint] = footprint(self.area, points) if self.kind != SUN else 0.0
        return rows if self.maps is None else MappedRow.of(rows, self.maps)


class MappedRow(np.ndarray):
    """A row for the light list, with the image that holds the map of its lamp."""

    maps: images.Image | None = None

    @classmethod
    def of(cls, rows: np.ndarray, maps: images.Image) -> MappedRow:
        made = rows.view(cls)
        made.maps = maps
        return made

    def __array_finalize__(self, source) -> None:
        self.maps = getattr(source, "maps", None)


def emitters(snapshot: Snapshot, origin: np.ndarray, maps: LampMaps | None = None) -> list[Emitter]:
    """The scene's lights that give something, in an order of their own, so that random choices do not depend on names
    and on the order in the scene. `maps`: what their node trees make of their light."""
    found = (
        emitter(light, origin) if light.graph is None else _mapped(light, origin, maps) for light in snapshot.lights
    )
    return sorted((one for one in found if one is not None), key=_order)


def _mapped(light: Light, origin: np.ndarray, maps: LampMaps | None) -> Emitter | None:
    """A lamp with a node tree."""
    scale, number = (1.0, -1) if maps is None else maps.of(light)
    made = emitter(replace(light, strength=np.asarray(light.strength) * scale), origin)
    if made is None or number < 0:
        return made
    return replace(made, flags=made.flags | MAPPED_FLAG | number << MAP_SHIFT, maps=maps.image)


def _order(one: Emitter) -> tuple:
    values = (one.centre, one.axis, one.radiance, one.u, one.v, one.w)
    return (one.kind, one.flags, one.radius, one.area, one.spread, *(number for value in values for number in value))


def emitter(light: Light, origin: np.ndarray) -> Emitter | None:
    """The light in the frame's units; None where it gives nothing (no power, no area, not finite)."""
    matrix = light.matrix
    strength = np.asarray(light.strength, np.float64)
    if not (np.isfinite(matrix).all() and np.isfinite(strength).all()) or not strength.any():
        return None
    flags = (
        DIFFUSE_FLAG * light.visibility.diffuse + GLOSSY_FLAG * light.visibility.glossy
        + SHADOW_FLAG * light.cast_shadow + CAMERA_FLAG * light.visibility.camera
        + TRANSMISSION_FLAG * light.visibility.transmission
    )  # fmt: skip
    power = float(np.abs(strength).max())
    smallest = max(SMALLEST, np.sqrt(power / BRIGHTEST) if light.normalize else 0.0)
    axis = -_unit(matrix[:3, 2])
    centre = matrix[:3, 3] - origin
    zero = np.zeros(3)
    if light.kind == "SUN":
        half = float(np.clip(light.angle, 0.0, np.pi)) / 2
        half = half if half > smallest else 0.0
        disc = np.pi * np.sin(half) ** 2 if half > 0 else 1.0
        radiance = strength / disc if light.normalize and half > 0 else strength
        solid_angle = 4 * np.pi * np.sin(half / 2) ** 2 if half > 0 else 1.0
        return Emitter(light, SUN, flags, -axis, half, radiance, solid_angle, axis, 0.0, zero, zero, zero)
    if light.kind == "AREA":
        u, v = _unit(matrix[:3, 0]), _unit(matrix[:3, 1])
        width = abs(light.size[0]) * np.linalg.norm(matrix[:3, 0])
        height = abs(light.size[1]) * np.linalg.norm(matrix[:3, 1])
        area = width * height * (np.pi / 4 if light.shape == "ELLIPSE" else 1.0)
        if not area > 0:
            return None
        area = max(area, smallest**2)
        radiance = strength / np.pi / (area if light.normalize else 1.0)
        spread = 0.0 if light.spread >= np.pi - 1e-6 else float(np.tan(max(light.spread, LEAST_SPREAD) / 2))
        kind = ELLIPSE if light.shape == "ELLIPSE" else RECTANGLE
        return Emitter(
            light, kind, flags, centre, 0.0, radiance, area, axis, spread, u * width / 2, v * height / 2, zero
        )
    radius = light.radius if light.radius > smallest else 0.0
    disc = np.pi * radius**2
    if radius > 0:
        radiance = strength / np.pi / (4 * disc if light.normalize else 1.0)
    else:
        radiance = strength / np.pi / (4.0 if light.normalize else 1.0)
    kind = POINT if light.soft_falloff or radius == 0 else SPHERE
    rows = [zero, zero, zero]
    if light.kind == "SPOT":
        flags |= SPOT_FLAG
        try:
            inverse = np.linalg.inv(matrix[:3, :3])
        except np.linalg.LinAlgError:
            return None
        cosine = np.cos(np.clip(light.spot_angle, 0.0, np.pi) / 2)
        soft = (1.0 - cosine) * light.spot_blend
        rows = [
            np.append(inverse[0], cosine),
            np.append(inverse[1], 1.0 / soft if soft > NO_BLEND else 0.0),
            inverse[2],
        ]
    return Emitter(light, kind, flags, centre, radius, radiance, max(disc, 0.0), axis, 0.0, *rows)


def passing_bits(passing: Iterable[int]) -> int:
    """The groups of blockers that let light pass, which rows of lights for traced paths hold in place of a first view
    (shaders/indirect/path.glsl); the last ones, which are one in the hierarchy, block."""
    return sum(1 << group for group in passing if group < LAST_GROUP)


def unlit_bits(links: Links) -> int:
    """What is added to a row's kind for the groups of receivers that are not lit (snapshot/linking.py)."""
    return sum(KIND_STEPS << group for group in links.unlit)


def footprint(area: float, points: float) -> float:
    """Least squared distance, m2, at which a point stands for its share of `area`.

    A point that is nearer than the radius of the disc it stands for would be brighter than all of the light.
    """
    return area / (np.pi * points)


def traceable(emitters: list[Emitter]) -> list[Emitter]:
    """The lights that rays of narrow lobes look for: those with extent, the strongest where a block cannot hold all.
    Of equal strength those that come first."""
    return sorted((e for e in emitters if e.extended), key=lambda e: -e.power)[:MOST_LIGHTS]


def spread_choice(count: int, most: int, u: float) -> tuple[np.ndarray, float]:
    """At most `most` of `count` lights, evenly out of all by the uniform number `u`, and how many each stands for."""
    if count <= most:
        return np.arange(count), 1.0
    return ((np.arange(most) + u) * count / most).astype(int), count / most


class Sources:
    """The uniform block of lights and depth-map views that the lighting shaders read."""

    def __init__(self):
        self._block: Block | None = None

    def set(self, rows: list[np.ndarray], views: np.ndarray | None = None) -> Block:
        """At most MOST_LIGHTS rows of (TEXELS, 4), and (V, VIEW_TEXELS, 4) views, V <= MOST_VIEWS."""
        light = np.zeros((MOST_LIGHTS * TEXELS, 4), np.float32)
        view = np.zeros((MOST_VIEWS * VIEW_TEXELS, 4), np.float32)
        if rows:
            light[: len(rows) * TEXELS] = np.concatenate(rows)
        if views is not None:
            view[: views.shape[0] * VIEW_TEXELS] = views.reshape(-1, 4)
        if self._block is None:
            self._block = Block(SOURCES, light=light, view=view)
        else:
            self._block.update(light=light, view=view)
        maps = next((row.maps for row in rows if isinstance(row, MappedRow)), None)
        self._block.beside = {} if maps is None else {"lamp_maps": maps}
        return self._block

    def release(self) -> None:
        self._block = None


def kinds_of(emitters: Iterable[Emitter]) -> int:
    """The kinds of these lights as bits, for LIGHT_KINDS of a program; all lamps where that is as fast."""
    return to_hold(sum(1 << kind for kind in {emitter.kind for emitter in emitters}), LAMPS)


def direction_row(
    direction,
    radiance_over_density,
    density,
    flags,
    first_view: int,
    view_count: int,
    rate: float = 1.0,
    openness: float = 1.0,
) -> np.ndarray:
    """A row for light from one direction at infinity, as the environment draws them, `rate` in a sample; `openness`:
    of what is drawn from there, how much is expected to arrive."""
    return LIGHT.rows(
        kind=DIRECTION, flags=flags if view_count else flags & ~SHADOW_FLAG, first_view=first_view,
        view_count=view_count, centre=direction, radius=openness, rate=rate,
        radiance=np.asarray(radiance_over_density) / rate, area=density,
    )  # fmt: skip


def surface_row(
    point, normal, radiance, density, flags, first_view: int, view_count: int, samples: float = np.inf
) -> np.ndarray:
    """A row for a point on an emissive surface, drawn with `density` per m2 in each of `samples` samples; it shines to
    both sides, but for SIDED_FLAG."""
    return LIGHT.rows(
        kind=SURFACE, flags=flags if view_count else flags & ~SHADOW_FLAG, first_view=first_view,
        view_count=view_count, centre=point, point=point, rate=1.0, radiance=radiance, area=1.0 / density, axis=normal,
        footprint=footprint(1.0, samples),
    )  # fmt: skip


def _unit(v: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(v)
    return v / length if length > 0 else np.zeros(3)


# Radial quantiles of the ball density r^2 / sqrt(1 - r^2). It is the spherically symmetric density whose projection
# along any axis is an even disc (inverse Abel transform of a constant), so that one point serves all receivers.
_RADII = np.sin(np.linspace(0.0, np.pi / 2, 4097))
_RADIAL_CDF = (np.arcsin(_RADII) - _RADII * np.sqrt(1 - _RADII**2)) / (np.pi / 2)


def _ball_offset(x: float, y: float, z: float) -> np.ndarray:
    """Offset in the unit ball: direction from x and y, radius from z."""
    height = 1.0 - 2.0 * x
    turn = 2.0 * np.pi * y
    ring = np.sqrt(max(1.0 - height * height, 0.0))
    return np.interp(z, _RADIAL_CDF, _RADII) * np.array([ring * np.cos(turn), ring * np.sin(turn), height])


@lru_cache(maxsize=256)
def _beside(axis: bytes) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors across an axis (its three float64), and across each other."""
    axis = np.frombuffer(axis)
    helper = np.array([1.0, 0.0, 0.0]) if abs(axis[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    u = _unit(np.cross(helper, axis))
    return u, np.cross(axis, u)


def _cone_direction(axis: np.ndarray, half_angle: float, x: float, y: float) -> np.ndarray:
    """Uniform over the cone's solid angle; the disc map keeps neighbouring numbers neighbours."""
    u, v = _beside(np.asarray(axis, np.float64).tobytes())
    one_minus_cos = x * 2.0 * np.sin(half_angle / 2) ** 2
    cos_theta = 1.0 - one_minus_cos
    sin_theta = np.sqrt(max(one_minus_cos * (2.0 - one_minus_cos), 0.0))
    turn = 2.0 * np.pi * y
    return axis * cos_theta + sin_theta * (np.cos(turn) * u + np.sin(turn) * v)
