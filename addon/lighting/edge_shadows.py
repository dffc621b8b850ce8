"""Shadows by edges as a technique of the shadow slot: what depth complexity sampling and penumbra wedges share.

For each light that it serves a technique fills an image before the light is added: either the share of the light which
every pixel sees, with the light taken as a whole, or a bit for each of some points, with the light drawn point by
point. Lights that edges do not suit have the maps or rays of `fallback`: those without extent, round ones that are
large beside their distance, and those with more silhouette edges than tiles could stream.

Edge light (lighting/repeated_light.py) is left to its guess: what was found belongs to this sample's surfaces.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.technique import Param
from ..gfx import images, passes
from ..gfx.library import Program
from ..sampling import sequence
from ..scene import edges
from ..scene.edges import CasterEdges, EdgeCache
from ..snapshot.panorama import bends_lines
from ..snapshot.scene import Snapshot
from ..sources import lights
from ..surfaces.draw import SURFACES
from . import edge_tiles, repeated_light, silhouettes
from .caustic_casters import glass_alone
from .edge_tiles import EdgeTiles, Lit
from .loop import tinted_casters
from .point_maps import PointMaps
from .silhouettes import Extent, Silhouettes
from .textured_volumes import CARD_WORDS, CardCache
from .visibility import Lookup, Maps, VisibilityProvider, has_extent

NEAR = 0.25  # radius / distance of a round light from which rays take over, as direct_light has it
PATTERNS = 16  # of neighbouring pixels, four by four
SEEN_SHARE = ("R32F", "seen_share")
MOST_EDGES = Param(
    "most_edges", "Most edges", 20_000,
    "Lights with more silhouette edges than this use shadow maps or rays instead",
    100, 1_000_000,
)  # fmt: skip
SHARE_LOOKUP = Lookup("share by edges", "edges/visibility.glsl", textures=(SEEN_SHARE,), maps=False)


def bits_lookup(points: int) -> Lookup:
    """The lookup of a light that is sampled by so many points, of which each has a bit."""
    return Lookup(
        f"{points} points by edges", "edges/visibility.glsl", textures=(("UINT_2D", "seen_points"),),
        defines=(("SEEN_POINTS", str(points)),), maps=False,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class EdgeView:
    """What stands in place of a depth map's view: a point of a light (or all of it) that is asked about."""

    emitter: lights.Emitter
    sample: np.ndarray
    scale: int = 1


class EdgeShadows(PointMaps):
    """Base; `gather` is the technique's own."""

    reads = SURFACES

    def __init__(self, fallback: PointMaps):
        super().__init__()
        self.fallback = fallback
        self.tiles, self.edges, self.cards = EdgeTiles(), EdgeCache(), CardCache()
        self._served: dict[str, Extent] = {}
        self._casters: CasterEdges = edges.NO_EDGES

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        return (
            super().skip(snapshot, settings)
            or edges.too_many(snapshot)
            or (
                None
                if any(has_extent(light) for light in snapshot.lights)
                else "no light that casts shadows has extent"
            )
        )

    def programs(self, snapshot: Snapshot, settings: Settings) -> tuple[Program, ...]:
        return edge_tiles.programs_for(snapshot.film.border_size)

    def begin(self, frame: Frame) -> None:
        super().begin(frame)
        self.find_casters(frame)
        for emitter in frame.emitters:
            reason, extent = self.suits(frame, emitter)
            frame.count(self, reason or "lights by edges")
            if extent is not None:
                self.serve(emitter, extent)
        if len(self._served) < len(frame.emitters):
            self.fallback.begin(frame)
            frame.provide(self, VisibilityProvider)

    def find_casters(self, frame: Frame) -> None:
        """What `suits` asks; no light is served yet."""
        geometry = frame.geometry
        self._casters = self.edges.casters(*geometry.placed, geometry.origin, geometry.changes)
        self._served = {}

    def serve(self, emitter: lights.Emitter, extent: Extent) -> None:
        """Answer for this light from now on."""
        self._served[emitter.light.key] = extent

    def silhouettes(self, frame: Frame, extent: Extent) -> Silhouettes:
        """The candidate edges of a light that `suits`."""
        return self.tiles.found(frame, self._casters, extent, self.accurate(frame), self.by_group)[1]

    def suits(self, frame: Frame, emitter: lights.Emitter) -> tuple[str, Extent | None]:
        """Why edges do not suit a light, and its extent where they do."""
        if not emitter.light.cast_shadow:
            return "lights without shadow", None
        if not emitter.extended:
            return "lights without extent", None
        if bends_lines(frame.snapshot):
            return "lights of a panoramic picture: rays or maps", None
        if tinted_casters(frame, glass_alone(frame)):  # what edges find is a share of the light, without colour
            return "lights that coloured panes tint: rays or maps", None
        nearest = edge_tiles.nearest_receiver(frame, emitter)
        if emitter.kind in (lights.POINT, lights.SPHERE) and emitter.radius > NEAR * nearest:
            return "round lights that are near: rays or maps", None
        extent = Extent.of(emitter, nearest)
        count = self.silhouettes(frame, extent).count
        if count > frame.settings.get(self, "most_edges") or not edge_tiles.fits(frame.size, count):
            return "lights with too many edges: rays or maps", None
        if not edge_tiles.fits(frame.size, self._card_count(frame)):
            return "lights with too many cards: rays or maps", None
        return "", extent

    def _card_count(self, frame: Frame) -> int:
        cards = self.cards.cards(frame)
        return cards.count if cards is not None else 0

    by_group = False

    def accurate(self, frame: Frame) -> bool:
        """Whether silhouettes of all points of the light count, not of its centre alone."""
        return True

    def points(self, frame: Frame) -> int:
        """Points by which each light is sampled; 0: it is taken as a whole."""
        return 0

    def serving(self, emitter: lights.Emitter) -> PointMaps:
        return self if emitter.light.key in self._served else self.fallback.serving(emitter)

    def cell(self, frame: Frame, number: int, points: float) -> float:
        return 0.0 if self.points(frame) else 1.0

    def traces(self, frame: Frame, emitter: lights.Emitter) -> bool:
        return False

    def resolution(self, frame: Frame) -> int:
        return 1

    def views(self, frame: Frame, emitter: lights.Emitter, sample: np.ndarray, number: int, cell: float = 0.0) -> list:
        receivers = frame.receivers
        if not emitter.light.cast_shadow or receivers is None or not len(receivers.distance):
            return []
        return [EdgeView(emitter, sample)]

    def most_texels(self, frame: Frame) -> int:
        """Views of a round: as many as one image holds, pictures above each other."""
        points = self.points(frame)
        rows = frame.size[1] * (2 if points else 1)
        lights_at_once = max(min(images.most_side() // rows, lights.MOST_LIGHTS // max(points, 1)), 1)
        return lights_at_once * max(points, 1)

    def draw(self, frame: Frame, views: list) -> Maps:
        points = self.points(frame)
        own = [views[k : k + max(points, 1)] for k in range(0, len(views), max(points, 1))]
        width, height = frame.size
        rows = height * max(len(own), 1) * (2 if points else 1)
        name, image_format = ("seen_points", "R32UI") if points else ("seen_share", "R32F")
        found = self.tiles.kept(name, width, rows, image_format)
        repeated_light.forbid(frame)
        lookup = bits_lookup(points) if points else SHARE_LOOKUP
        block = np.zeros((len(views), lights.VIEW_TEXELS, 4))
        return Maps(None, block, lookup, textures={name: found}, drawing=self._fill(frame, own, found))

    def _fill(self, frame: Frame, own: list[list[EdgeView]], found: images.Image) -> Iterator[None]:
        """One light after the other."""
        for number, views in enumerate(own):
            extent = self._served[views[0].emitter.light.key]
            lit = self.tiles.light(
                frame, self, self._casters, extent, self.accurate(frame), self.by_group, number,
                -(-self._card_count(frame) // 32),
            )  # fmt: skip
            lit.update(picture_row=number * frame.size[1])
            yield from self.gather(frame, lit, views, found)

    def card_words(self, frame: Frame, lit: Lit) -> dict[str, images.Image]:
        """What CARD_TEXTURES binds: the scene's cards, and which of them matter to which tile; empty without cards."""
        cards = self.cards.cards(frame)
        if cards is None:
            return {}
        low, high = self.tiles.kept_bounds()
        words = -(-cards.count // 32)
        rows = -(-words * low.width * low.height // images.LIST_WIDTH)
        found = self.tiles.kept("card words", images.LIST_WIDTH, rows, "R32UI")
        lit.update(card_count=cards.count, card_word_count=words)
        passes.compute(
            CARD_WORDS, (images.LIST_WIDTH, rows),
            textures={"card_records": cards.records, "low_of_tiles": low, "high_of_tiles": high},
            images={"card_words": found}, blocks={"edge_light": lit.block},
        )  # fmt: skip
        frame.count(self, "cards", cards.count)
        return {"card_records": cards.records, "card_tiles": cards.tiles, "card_words": found}

    def salt(self, frame: Frame) -> int:
        """For random choices of this sample."""
        return (frame.sample * 7919 + frame.settings.seed * 104729) % 2**24

    def gather(self, frame: Frame, lit: Lit, views: list[EdgeView], found: images.Image) -> Iterator[None]:
        """Fill the light's part of `found`, from row block.picture_row on."""
        raise NotImplementedError

    def release(self) -> None:
        super().release()
        self.fallback.release()
        self.tiles.release()
        self.edges.release()
        self.cards.release()
        self._served, self._casters = {}, edges.NO_EDGES


def shared_patterns(frame: Frame, extent: Extent, points: int, patterns: int) -> tuple[np.ndarray, int]:
    """Patterns of points of a light for neighbouring pixels in this sample, as edges/depth_complexity.comp.glsl reads
    them, and their shape (edge_tiles). Each, and all together, are nets of the sequence; each sample has others."""
    emitter, count = extent.emitter, points * patterns
    xy = sequence.points(frame.sample * count, count, "edges/light", frame.settings.seed).reshape(patterns, points, 2)
    x, y = xy[..., :1], xy[..., 1:]
    if emitter.kind == lights.RECTANGLE:
        return in_pairs(2.0 * xy - 1.0, sort=True), edge_tiles.IN_PLANE
    disc = np.concatenate(_disc(x, y), axis=-1)
    if emitter.kind == lights.SUN:
        directions = _cone_offsets(emitter, disc) + emitter.centre
        if not extent.in_plane:
            return _in_space(directions - emitter.centre), edge_tiles.AS_THEY_ARE
        return in_pairs(_places(extent, directions), sort=True), edge_tiles.IN_PLANE
    facing = edge_tiles.FACING_SPHERE if emitter.kind == lights.SPHERE else edge_tiles.FACING_DISC
    return in_pairs(disc, sort=True), edge_tiles.IN_PLANE if emitter.kind == lights.ELLIPSE else facing


def point_patterns(extent: Extent, samples: list[np.ndarray]) -> tuple[np.ndarray, int]:
    """One pattern of the points by which the light is sampled (Emitter.sample), in their order: texels, and shape."""
    emitter, given = extent.emitter, np.array(samples, float)[None]
    if emitter.kind in (lights.POINT, lights.SPHERE):
        shape = edge_tiles.BALL_SPHERE if emitter.kind == lights.SPHERE else edge_tiles.BALL_DISC
        return _in_space(given / emitter.radius), shape
    if not extent.in_plane:
        return _in_space(given - emitter.centre), edge_tiles.AS_THEY_ARE
    return in_pairs(_places(extent, given)), edge_tiles.IN_PLANE


def _places(extent: Extent, points: np.ndarray) -> np.ndarray:
    """(..., 2) where points of a light (..., 3) lie along its half axes; at infinity their directions."""
    if extent.infinite:
        points = points / (points @ extent.centre)[..., None]
    axes = np.linalg.pinv(np.stack(extent.half_axes, axis=1))
    return (points - extent.centre) @ axes.T


def _in_space(offsets: np.ndarray) -> np.ndarray:
    """(patterns, points, 4) texels of offsets (patterns, points, 3), each by itself."""
    return np.concatenate([offsets, np.zeros_like(offsets[..., :1])], axis=-1).astype(np.float32)


BOX = 16  # points that a box is around


def in_pairs(places: np.ndarray, sort: bool = False) -> np.ndarray:
    """(patterns, points / 2 + points / BOX, 4) float32 texels of places (patterns, points, 2): two points each, then
    boxes around each BOX (middle, half sides). `sort`: those are quadrants, as a net has as many points in each."""
    patterns, points = places.shape[:2]
    if sort:
        quadrant = (places[..., 0] >= 0) + 2 * (places[..., 1] >= 0)
        order = np.argsort(quadrant, axis=1, kind="stable")
        places = np.take_along_axis(places, order[..., None], axis=1)
    places = places.astype(np.float32)
    boxed = places.reshape(patterns, points // BOX, BOX, 2)
    low, high = boxed.min(axis=2), boxed.max(axis=2)
    boxes = np.concatenate([(low + high) / 2, (high - low) / 2 * np.float32(1.0001) + np.float32(1e-6)], axis=-1)
    return np.concatenate([places.reshape(patterns, points // 2, 4), boxes], axis=1)


def _disc(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The unit square onto the unit disc, evenly, neighbours staying neighbours (Shirley, Chiu 1997)."""
    a, b = 2 * x - 1, 2 * y - 1
    first = np.abs(a) > np.abs(b)
    radius = np.where(first, a, b)
    with np.errstate(divide="ignore", invalid="ignore"):
        turn = np.where(first, np.pi / 4 * b / a, np.pi / 2 - np.pi / 4 * a / b)
    turn = np.where(radius == 0, 0.0, turn)
    return radius * np.cos(turn), radius * np.sin(turn)


def _cone_offsets(emitter: lights.Emitter, disc: np.ndarray) -> np.ndarray:
    """(..., 3) directions of a sun's cone less its axis, evenly by solid angle, from points of the unit disc."""
    axis = np.asarray(emitter.centre, float)
    u, v = silhouettes.across(axis)
    squared = (disc**2).sum(axis=-1, keepdims=True)
    one_minus_cosine = squared * 2.0 * np.sin(emitter.radius / 2) ** 2
    sine = np.sqrt(np.maximum(one_minus_cosine * (2.0 - one_minus_cosine), 0.0))
    across = (disc[..., :1] * u + disc[..., 1:] * v) / np.sqrt(np.maximum(squared, 1e-300))
    return sine * across - one_minus_cosine * axis
