"""Penumbra wedge blending: the share of a light that casters leave, by areas in closed form, without noise.

Per pixel and group of edges (a connected island of an object) the hidden area of each quarter of the light is summed up
over the silhouette edges: exact for one group. Groups that hide the same part of the light would count twice: their
overlap is estimated from the boxes around what each hides (`union`), as if each were filled evenly,

    e = (A_v / B_v) (A_s / B_s) |box_v and box_s|,

A hidden areas, B areas of boxes, v what was hidden before, s the group. Disjoint and filled boxes are exact. RMS error
of 2, 3, 5 and 9 random polygons: .0026 .0041 .0093 .0165 (a little too dark).

| cost | per light and sample |
|---|---|
| passes | 1 over the screen, 2 additive draws, 2 dispatches, 1 per picture without alpha |
| per pixel and edge in its tile | 4 fetches, 60 operations to reject, 300 else |
| bytes | 90 per pixel; 128 per silhouette edge |

For previews of few casters: a light whose edges belong to more than 48 groups has depth complexity sampling instead, as
have all lights that wedges do not suit. The light is taken as a whole (in closed form) and of one colour. Discs and
spheres count as squares of their area, turned with the receiver. Alpha casters are tested at 64 points
(lighting/textured_volumes.py); with boxes, each that they hide takes what solids leave of it there.

Fails by construction: gloss, whose highlight does not know which part of the light is hidden; textures on the light;
open curved sheets that fold over themselves, whose layers an area cannot tell apart (depth_complexity.py can).

Source: Forest, Barthe, Paulin, "Realistic soft shadows by penumbra-wedges blending", Graphics Hardware 2006. Areas in
closed form instead of a table, boxes that do not depend on the order of edges, and weights as seen from the receiver
(edges that only other points of the light see as silhouettes) are ours.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np

from ..frame.picture import Frame
from ..frame.technique import Param
from ..gfx import images, passes
from ..gfx.library import Program
from ..lighting import edge_tiles
from ..lighting.edge_shadows import MOST_EDGES, EdgeShadows, EdgeView, shared_patterns
from ..lighting.edge_tiles import COUNT_INPUTS, LIGHT_BLOCK, LIT_TEXTURES, Lit
from ..lighting.point_maps import CUTOFF
from ..lighting.silhouettes import Extent
from ..scene.edges import CasterEdges
from ..scene.view import VIEW
from ..sources import lights
from .depth_complexity import DepthComplexity, gathering

GROUPS = 48  # four images of four channels of three digits of base 256, which float32 holds exactly
BIAS = 96  # layers that a digit may fall short by, so that 159 may lie before a light
SQUARE_OF_DISC = np.sqrt(np.pi) / 2  # half a square's side, by the radius of a disc as large
FEW_BORDERS = 0.15  # share of the edges of a body that may be borders
FLAT = 0.25  # length of the sum of directed areas over the sum of areas, from which on an open mesh is a sheet
CARD_POINTS = 64
BOXES, PRODUCT, SUM = "BOXES", "PRODUCT", "SUM"
UNIONS = (
    (BOXES, "By Boxes", 0, "From where on the light each object lies: what two hide together counts once"),
    (PRODUCT, "Product of Shares", 1, "As if objects lay before the light by chance"),
    (SUM, "Plain Sum", 2, "Too dark where objects lie before one another"),
)
COUNTS = tuple(("RGBA32F", f"counts_{letter}") for letter in "abcd")
CARDS_SHARE = ("R32F", "cards_share")
CARDS_POINTS = (("UINT_2D", "card_points"), ("RGBA32F", "light_pattern"))  # by boxes: which points cards leave


def _count(what: str) -> Program:
    return Program(
        name=f"count of {what} by group",
        vertex=f"edges/{what}.vert.glsl",
        fragment="edges/groups.frag.glsl",
        inputs=COUNT_INPUTS,
        varyings=(("flat", "VEC4", "flat_a"), ("flat", "VEC4", "flat_b"), ("flat", "FLOAT", "flat_group")),
        outputs=tuple(("VEC4", f"out_{letter}") for letter in "abcd"),
        textures=(("RGBA32F", f"{what}_records"), ("RGBA32F", "receivers")),
        blocks=((VIEW, "film_view"), LIGHT_BLOCK),
        defines=(("GROUPS", "1"), *((("TRIANGLES", "1"),) if what == "triangles" else ())),
    )


COUNT_QUADS, COUNT_TRIANGLES = _count("quads"), _count("triangles")


@cache
def gathering_areas(tile: int, union: str, cards: bool, standard: bool = False) -> Program:
    """The dispatch that sums up areas and joins groups."""
    textures = [one for one in LIT_TEXTURES if one[1] != "centre_count"]
    of_cards, constants = ((CARDS_SHARE,), ()) if cards else ((), ())
    if cards and union == BOXES:
        of_cards, constants = CARDS_POINTS, (("INT", "card_shape"), ("INT", "card_patterns"))
    return Program(
        name=f"penumbra wedges, {union.lower()}",
        compute="edges/penumbra_wedges.comp.glsl",
        textures=(*textures, *COUNTS, ("RGBA32F", "groups"), *of_cards),
        images=(("seen_share", "R32F", "FLOAT_2D", "WRITE"),),
        blocks=(LIGHT_BLOCK,),
        constants=(
            ("INT", "first_row"), ("INT", "last_row"), ("VEC3", "rectangle_u"), ("VEC3", "rectangle_v"), *constants
        ),
        defines=(
            ("TILE", str(tile)), (f"UNION_{union}", "1"), *((("CARDS", "1"),) if cards else ()),
            *((("STANDARD", "1"),) if standard else ()),
        ),
    )  # fmt: skip


DECLARED = (
    gathering_areas(16, BOXES, False), gathering_areas(8, PRODUCT, True), gathering_areas(16, SUM, False, True),
    gathering_areas(8, BOXES, True),
)  # fmt: skip


class PenumbraWedges(EdgeShadows):
    name = "penumbra_wedges"
    label = "Penumbra wedge blending"
    params = (
        Param("union", "Union", BOXES, "How the areas that several objects hide are combined", items=UNIONS),
        Param(
            "accurate", "Accurate edges", True,
            "Use silhouette edges seen from any point of a light, not only from its centre",
        ),
        MOST_EDGES,
        CUTOFF,
    )  # fmt: skip
    by_group = True

    def __init__(self):
        super().__init__(DepthComplexity())
        self._groups: dict[str, tuple] = {}  # by light: silhouettes, groups' numbers, list, quads

    def accurate(self, frame: Frame) -> bool:
        return frame.settings.get(self, "accurate")

    def suits(self, frame: Frame, emitter: lights.Emitter) -> tuple[str, Extent | None]:
        reason, extent = super().suits(frame, emitter)
        if extent is None:
            return reason, None
        known = self.tiles.found(frame, self._casters, extent, self.accurate(frame), True)
        if len(np.unique(known[5].group[known[1].numbers])) > GROUPS:
            return "lights with too many groups of edges: depth complexity", None
        return "", extent

    def gather(self, frame: Frame, lit: Lit, views: list[EdgeView], found: images.Image) -> Iterator[None]:
        emitter = views[0].emitter
        names, table, quads = self._grouped(lit, emitter)
        counts = self._draw_counts(frame, lit, names, quads)
        union = frame.settings.get(self, "union")
        cards, of_cards = self._cards(frame, lit, union)
        union = PRODUCT if union == BOXES and CARDS_SHARE[1] in cards else union
        u, v = np.zeros(3), np.zeros(3)
        values = {"group_count": len(names), "shape": edge_tiles.IN_PLANE}
        if emitter.has_span:
            scale = SQUARE_OF_DISC if emitter.kind == lights.ELLIPSE else 1.0
            u, v = emitter.u[:3] * scale, emitter.v[:3] * scale
        else:
            sphere = emitter.kind == lights.SPHERE
            values["shape"] = edge_tiles.FACING_SPHERE if sphere else edge_tiles.FACING_DISC
            if emitter.kind == lights.SUN:
                size = lit.values["size"]
                values["size"] = (size[0], np.tan(min(emitter.radius, 1.5)), *size[2:])
        lit.update(**values)
        program = gathering_areas(lit.tile, union, bool(cards), not self.accurate(frame))
        textures = {name: image for name, image in lit.textures.items() if name != "centre_count"}
        textures |= {**counts, "groups": table, **cards}
        for first, last in frame.bands(self, "gather"):
            passes.compute(
                program, (frame.size[0], last - first), textures=textures, images={"seen_share": found},
                blocks={"edge_light": lit.block},
                constants={
                    "first_row": first, "last_row": last, "rectangle_u": tuple(u), "rectangle_v": tuple(v), **of_cards
                },
            )  # fmt: skip
            yield
        frame.count(self, "groups", len(names))

    def _grouped(self, lit: Lit, emitter: lights.Emitter) -> tuple:
        """Groups that have edges of this light, from the light away: numbers; a list of first edge, end and triangles
        of a layer; quads that know their group's place among them."""
        known = self._groups.get(emitter.light.key)
        if known is not None and known[0] is lit.found:
            return known[1:]
        group = lit.casters.group[lit.found.numbers]
        names, first, total = np.unique(group, return_index=True, return_counts=True)
        ends = lit.casters.ends[lit.found.numbers].astype(np.float64)
        away = -ends @ lit.extent.centre if lit.extent.infinite else np.linalg.norm(ends - lit.extent.centre, axis=2)
        nearest = np.minimum.reduceat(away.min(axis=1), first) if len(first) else first
        order = np.argsort(nearest, kind="stable")
        layer = triangles_of_a_layer(lit.casters)
        rows = np.zeros((1, GROUPS, 4), np.float32)
        rows[0, :, 2] = 1.0
        for place, k in enumerate(order):
            rows[0, place, :3] = first[k], first[k] + total[k], layer[names[k]]
        place_of = np.zeros(len(lit.casters.closed), np.int64)
        place_of[names[order]] = np.arange(len(order))
        quads = lit.found.records[lit.found.drawn][:, :2].copy()
        quads[:, 0, 3] = place_of[group[lit.found.drawn]]
        made = (names[order], images.upload(rows), images.upload_list(quads.reshape(-1, 4)))
        self._groups[emitter.light.key] = (lit.found, *made)
        return made

    def _draw_counts(self, frame: Frame, lit: Lit, names: np.ndarray, quads: images.Image) -> dict[str, images.Image]:
        """Layers of each group before the light's centre, in digits."""
        kept = [self.tiles.kept(name, *frame.size, "RGBA32F") for _, name in COUNTS]
        place_of = np.full(len(lit.casters.closed), -1, np.int64)
        place_of[names] = np.arange(len(names))
        start = np.full(GROUPS, float(BIAS))
        between = place_of[lit.casters.triangle_group[lit.hidden]]
        start += np.bincount(between[between >= 0], minlength=GROUPS)
        channels = start.reshape(4, 4, 3) @ (256.0 ** np.arange(3))
        for image, color in zip(kept, channels):
            images.Target((image,)).clear(tuple(color))
        target = images.Target(tuple(kept))
        blocks = {"film_view": frame.view_block, "edge_light": lit.block}
        work = [(COUNT_QUADS, "quads", quads, len(lit.found.drawn), 6)]
        own = lit.looked_through[1]
        own = own[place_of[lit.casters.triangle_group[own]] >= 0]
        if len(own):
            rows = np.zeros((len(own), 4, 4), np.float32)
            rows[:, :3, :3], rows[:, 3] = lit.casters.corners[own], lit.casters.planes[own]
            rows[:, 0, 3] = place_of[lit.casters.triangle_group[own]]
            work.append((COUNT_TRIANGLES, "triangles", images.upload_list(rows.reshape(-1, 4)), len(own), 3))
        with passes.drawing(target, blend="ADDITIVE_PREMULT", depth_test="NONE", depth_write=False):
            for program, what, records, total, corners in work:
                if total:
                    shader = passes.get(program)
                    shader.bind(textures={f"{what}_records": records, "receivers": lit.receivers}, blocks=blocks)
                    passes.draw(shader, edge_tiles.corner_batch(corners), total)
        return {name: image for (_, name), image in zip(COUNTS, kept)}

    def _cards(self, frame: Frame, lit: Lit, union: str) -> tuple[dict[str, images.Image], dict[str, object]]:
        """What alpha casters alone leave of the light, by points, and constants; empty without any. By boxes which
        points they are, unless those lie in no plane."""
        cards = self.card_words(frame, lit)
        if not cards:
            return {}, {}
        texels, shape = shared_patterns(frame, lit.extent, CARD_POINTS, 16)
        values = dict(lit.values)
        lit.update(
            shape=shape, point_count=CARD_POINTS, pattern_count=len(texels), salt=self.salt(frame), word_count=0,
            picture_row=0,
        )  # fmt: skip
        none = self.tiles.kept("no layers", *frame.size, "R16F")
        images.Target((none,)).clear()
        width, height = frame.size
        space, pattern = shape >= edge_tiles.BALL_DISC, images.upload(texels)
        bits = union == BOXES and not space
        if bits:
            found = {"seen_points": self.tiles.kept("cards points", width, 2 * height, "R32UI")}
            normal = {}
        else:
            found = {"seen_share": self.tiles.kept("cards share", width, height, CARDS_SHARE[0])}
            normal = {"surface_normal": frame.images["surface.normal"]}
        passes.compute(
            gathering(CARD_POINTS, lit.tile, bits, True, space=space), frame.size, images=found,
            textures={**lit.textures, "centre_count": none, "light_pattern": pattern, **cards, **normal},
            blocks={"edge_light": lit.block}, constants={"first_row": 0, "last_row": frame.size[1]},
        )  # fmt: skip
        lit.update(**values)
        if bits:
            of_cards = {"card_shape": shape, "card_patterns": len(texels)}
            return {"card_points": found["seen_points"], "light_pattern": pattern}, of_cards
        return {CARDS_SHARE[1]: found["seen_share"]}, {}

    def release(self) -> None:
        super().release()
        self._groups = {}


def triangles_of_a_layer(casters: CasterEdges) -> np.ndarray:
    """(G,) how many triangles a line through a group crosses where it hides something once: 2 of a body, 1 of a sheet.

    A body with a few holes is no sheet. However finely an open sheet is meshed, so that few edges are borders, its
    directed areas add up, where those of a body cancel but for its holes.
    """
    count = len(casters.closed)
    edges = np.bincount(casters.group, minlength=count)
    borders = np.bincount(casters.group[casters.faces[:, 1] < 0], minlength=count)
    corners = casters.corners.astype(np.float64)
    directed = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    total = np.stack([np.bincount(casters.triangle_group, directed[:, axis], count) for axis in range(3)], axis=1)
    whole = np.bincount(casters.triangle_group, np.linalg.norm(directed, axis=1), count)
    is_flat = np.linalg.norm(total, axis=1) > FLAT * whole
    is_sheet = (borders > FEW_BORDERS * edges) | ((borders > 0) & is_flat)
    return np.where(is_sheet, 1.0, 2.0)
