"""Depth complexity sampling: how many layers lie between a receiver and each of 16 or 64 points of a light, exactly.

The number of layers before the light's centre is counted by shadow quads from the eye; at another point it differs by
the silhouette edges in between. Each edge that can matter to a tile of pixels is asked once per pixel and adds its
weight to the points that it hides (shaders/edges/depth_complexity.comp.glsl; front end: lighting/silhouettes.py,
lighting/edge_tiles.py). A point is seen where no layer is left. There are no maps, so no texels, leaks or offsets; what
errs is the number of points. Triangles with alpha are asked by their opacity (lighting/textured_volumes.py).

| mode | light | visibility | for |
|---|---|---|---|
| share | as a whole, in closed form | share of the points that are seen, by what each brings | few samples |
| points | by its 16 or 64 points, each lit for itself | a bit for each | many samples, gloss; the mean is exact |

With shares, neighbouring pixels ask 16 different patterns, nets of one sequence that are a net together. In pictures of
few samples a mean over those on the same plane (`smooth`) takes noise out; each sample has other patterns.

| cost | per light and sample |
|---|---|
| passes | 1 over the screen, 1 additive draw, 3 or 4 dispatches |
| per pixel and edge in its tile | 4 fetches, 60 operations to reject; a fetch and 20 operations per point else |
| bytes | 26 per pixel; 128 per silhouette edge; 4 per 32 edges and tile |

Cost grows with the silhouette edges whose wedge holds a pixel: few large casters cost little, a tree of 100,000 leaves
is for rays or maps (`most_edges`). Shares are biased on gloss, and by 1 / points at penumbrae; points are not.

Fails: casters that meet the light; counts of 256 layers are taken for none.

Source: Forest, Barthe, Paulin, "Accurate shadows by depth complexity sampling", Computer Graphics Forum 27(2), 2008.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

from ..frame.picture import Frame
from ..frame.technique import Param
from ..gfx import images, passes
from ..gfx.library import Program
from ..lighting import edge_tiles
from ..lighting.edge_shadows import (
    MOST_EDGES,
    PATTERNS,
    SEEN_SHARE,
    SHARE_LOOKUP,
    EdgeShadows,
    EdgeView,
    bits_lookup,
    point_patterns,
    shared_patterns,
)
from ..lighting.edge_tiles import LIGHT_BLOCK, LIT_TEXTURES, Lit
from ..lighting.light_rates import LightRates
from ..lighting.loop import lighting
from ..lighting.point_maps import CUTOFF
from ..lighting.textured_volumes import CARD_TEXTURES
from ..scene.view import VIEW
from ..sources.rates import Rate
from .accumulated_maps import AccumulatedMaps

COUNTS = (
    ("16", "16", 0, "Four by four points: fast, with visible steps in wide penumbrae"),
    ("64", "64", 1, "Eight by eight points"),
)
AUTO, SHARE, POINTS = "AUTO", "SHARE", "POINTS"
MODES = (
    (
        AUTO,
        "By Samples",
        0,
        "The share of the light in pictures of few samples without textured lamps; else by point",
    ),
    (SHARE, "Share of the Light", 1, "The whole light, as much of it as is seen: smooth at once"),
    (POINTS, "Point by Point", 2, "The light of each point that is seen: exact over many samples"),
)
FEW_SAMPLES = 4  # pictures of fewer take the light as a whole
NORMAL = ("RGBA32F", "surface_normal")


@cache
def gathering(points: int, tile: int, bits: bool, cards: bool, standard: bool = False, space: bool = False) -> Program:
    """The dispatch that counts layers. `space`: points of the light that lie in no plane."""
    seen = ("seen_points", "R32UI", "UINT_2D", "WRITE") if bits else ("seen_share", "R32F", "FLOAT_2D", "WRITE")
    return Program(
        name=f"depth complexity of {points} {'points' if bits else 'shares'}",
        compute="edges/depth_complexity.comp.glsl",
        textures=(
            *LIT_TEXTURES, ("RGBA32F", "light_pattern"), *(() if bits else (NORMAL,)),
            *(CARD_TEXTURES if cards else ()),
        ),
        images=(seen,),
        blocks=(LIGHT_BLOCK,),
        constants=(("INT", "first_row"), ("INT", "last_row")),
        defines=(
            ("POINTS", str(points)), ("TILE", str(tile)), *((("BITS", "1"),) if bits else ()),
            *((("CARDS", "1"),) if cards else ()), *((("STANDARD", "1"),) if standard else ()),
            *((("SPACE", "1"),) if space else ()),
        ),
    )  # fmt: skip


SMOOTH = Program(
    name="mean of neighbouring patterns",
    compute="edges/smooth_share.comp.glsl",
    textures=(("RGBA32F", "receivers"), NORMAL, ("R32F", "raw_share")),
    images=((SEEN_SHARE[1], SEEN_SHARE[0], "FLOAT_2D", "WRITE"),),
    blocks=((VIEW, "film_view"), LIGHT_BLOCK),
)
DECLARED = tuple(
    gathering(points, tile, bits, cards, standard, space)
    for points, tile, bits, cards, standard, space in (
        (16, 16, False, False, False, False),
        (64, 8, False, True, False, False),
        (16, 8, True, True, True, True),
        (64, 16, True, False, False, False),
    )
)
FRONT_END = edge_tiles.programs()
LIGHTING = tuple(lighting(lookup, False) for lookup in (SHARE_LOOKUP, bits_lookup(16), bits_lookup(64)))


class DepthComplexity(EdgeShadows):
    name = "depth_complexity"
    label = "Depth complexity sampling"
    requests = (LightRates,)
    params = (
        Param(
            "points", "Points", "64",
            "Number of points on each light whose visibility from a pixel is tested in each sample",
            items=COUNTS,
        ),
        Param(
            "mode", "Light", AUTO,
            "How visible light points become light: as a share of the unshadowed light, or shaded point by point",
            items=MODES,
        ),
        Param(
            "accurate", "Accurate edges", True,
            "Use silhouette edges seen from any point of a light, not only from its centre",
        ),
        Param("interleaved", "Interleaved", True, "Neighbouring pixels use different points of the light"),
        Param("smooth", "Smooth", True, "Average over neighbouring pixels with different points on the same plane"),
        MOST_EDGES,
        CUTOFF,
    )  # fmt: skip

    def __init__(self):
        super().__init__(AccumulatedMaps())

    def begin(self, frame: Frame) -> None:
        super().begin(frame)
        points = self.points(frame)
        if points and self._served:
            rates = frame.service(LightRates) or LightRates()
            rates.by_light |= dict.fromkeys(self._served, Rate(points.bit_length() - 1))
            frame.provide(rates)

    def points(self, frame: Frame) -> int:
        mode = frame.settings.get(self, "mode")
        few = frame.settings.samples < FEW_SAMPLES or frame.settings.schedule.is_draft
        # A share of what a textured lamp gives says nothing of which part of it is hidden.
        if mode == SHARE or (mode == AUTO and few and not any(map(frame.lamp_maps.textured, frame.snapshot.lights))):
            return 0
        return int(frame.settings.get(self, "points"))

    def accurate(self, frame: Frame) -> bool:
        return frame.settings.get(self, "accurate")

    def gather(self, frame: Frame, lit: Lit, views: list[EdgeView], found: images.Image) -> Iterator[None]:
        bits, points = self.points(frame) > 0, int(frame.settings.get(self, "points"))
        several = not bits and frame.settings.get(self, "interleaved")
        if bits:
            texels, shape = point_patterns(lit.extent, [view.sample for view in views])
        else:
            texels, shape = shared_patterns(frame, lit.extent, points, PATTERNS if several else 1)
        few = frame.settings.samples < FEW_SAMPLES or frame.settings.schedule.is_draft
        smooth = several and few and frame.settings.get(self, "smooth")
        cards = self.card_words(frame, lit)
        lit.update(shape=shape, point_count=points, pattern_count=len(texels), salt=self.salt(frame))
        first_row = lit.values["picture_row"]
        into = self.tiles.kept("raw share", *frame.size, "R32F") if smooth else found
        if smooth:
            lit.update(picture_row=0)
        program = gathering(
            points, lit.tile, bits, bool(cards), not self.accurate(frame), shape >= edge_tiles.BALL_DISC
        )
        textures = {**lit.textures, "light_pattern": images.upload(texels), **cards}
        if not bits:
            textures["surface_normal"] = frame.images["surface.normal"]
        for first, last in frame.bands(self, "gather"):
            passes.compute(
                program, (frame.size[0], last - first), textures=textures,
                images={("seen_points" if bits else "seen_share"): into}, blocks={"edge_light": lit.block},
                constants={"first_row": first, "last_row": last},
            )  # fmt: skip
            yield
        if smooth:
            lit.update(picture_row=first_row)
            passes.compute(
                SMOOTH, frame.size, images={"seen_share": found},
                textures={
                    "receivers": lit.receivers, "surface_normal": frame.images["surface.normal"], "raw_share": into,
                },
                blocks={"film_view": frame.view_block, "edge_light": lit.block},
            )  # fmt: skip
        frame.count(self, "points", points)
