"""Edges and tiles on the GPU: receivers, how often each has the light's centre hidden, and which edges a tile needs.

Everything here is done once per light and sample, for techniques that then gather per pixel (shaders/edges/*).

| step | passes | fetches | bytes |
|---|---|---|---|
| receivers | 1 over the screen | 6 per pixel | 16 per pixel |
| bounds | 1 dispatch | 1 per pixel | 32 per tile |
| count | 1 additive draw of shadow quads, and of triangles that the camera looks through | 1 a fragment | 2 a pixel |
| words | 1 dispatch, a thread per word and tile | 4 per edge and tile | 4 per 32 edges and tile |

Words need no atomic operation and cannot overflow. They are made in runs of at most MOST_WORDS; where edges and tiles
ask for more, tiles grow. The count starts from the eye, D(eye, c), one ray through all triangles in float64, and adds
each shadow quad between the eye and the receiver with its sign: quads reach to infinity by vertices with w = 0, and
their depth is flattened, so that no plane clips them. The camera may look through some casters (hidden from it, before
its near plane, transparent): those are drawn into the count too, since the way from the eye crosses them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..frame.picture import Frame
from ..frame.technique import Technique
from ..gfx import context, geometry, images, passes
from ..gfx.library import Program
from ..gfx.struct import Block, Struct
from ..scene.edges import CasterEdges
from ..scene.view import VIEW
from ..sources import lights
from ..surfaces.draw import SURFACE_TEXTURES, surface_bindings
from . import silhouettes
from .silhouettes import Extent, Silhouettes

EDGE_LIGHT = Struct(
    "EdgeLight",
    ("vec4", "centre"),  # w = 1: a direction, the light is at infinity
    ("vec4", "axis"),  # of emission
    ("vec4", "half_u"),  # half axes of what holds the points, where they are the same for all receivers
    ("vec4", "half_v"),
    ("vec4", "size"),  # of the ball around the light; of the disc that faces the receiver; D(eye, c); receivers' offset
    ("vec4", "eye"),  # w = 1: a direction
    ("float", "reach"),  # m, of shadow quads; 0: to infinity
    ("int", "shape"),  # how a pattern's points become points of the light
    ("int", "edge_count"),
    ("int", "word_count"),
    ("int", "tile_columns"),
    ("int", "point_count"),
    ("int", "pattern_count"),
    ("int", "picture_row"),  # of this light's part of the images that hold several
    ("int", "card_count"),
    ("int", "card_word_count"),
    ("int", "salt"),
    ("int", "group_count"),
)
IN_PLANE, FACING_DISC, FACING_SPHERE, BALL_DISC, BALL_SPHERE, AS_THEY_ARE = range(6)  # edges/samples.glsl
MOST_WORDS = 2048 * 8192
SMALL_PICTURE = 100_000  # pixels, up to which tiles are finer
TILES = (8, 16, 32, 64)

LIGHT_BLOCK = (EDGE_LIGHT, "edge_light")
RECEIVERS = passes.fullscreen_program(
    "receivers of a light",
    "edges/receivers.frag.glsl",
    textures=SURFACE_TEXTURES,
    blocks=((VIEW, "film_view"), LIGHT_BLOCK),
    outputs=(("VEC4", "out_receiver"),),
)
BOUNDS = {
    tile: Program(
        name=f"bounds of receivers in tiles of {tile}",
        compute="edges/tile_bounds.comp.glsl",
        textures=(("RGBA32F", "receivers"),),
        images=(("low_of_tiles", "RGBA32F", "FLOAT_2D", "WRITE"), ("high_of_tiles", "RGBA32F", "FLOAT_2D", "WRITE")),
        defines=(("TILE", str(tile)),),
    )
    for tile in TILES
}
TILE_TEXTURES = (("RGBA32F", "low_of_tiles"), ("RGBA32F", "high_of_tiles"))
WORDS = Program(
    name="edges of tiles",
    compute="edges/words.comp.glsl",
    textures=(("RGBA32F", "edge_wedges"), *TILE_TEXTURES),
    images=(("tile_words", "R32UI", "UINT_2D", "WRITE"),),
    blocks=(LIGHT_BLOCK,),
)
COUNT_INPUTS = (("INT", "number"),)
COUNT = {
    what: Program(
        name=f"count of {what} before the light's centre",
        vertex=f"edges/{what}.vert.glsl",
        fragment=f"edges/{what}.frag.glsl",
        inputs=COUNT_INPUTS,
        varyings=(("flat", "VEC4", "flat_a"), ("flat", "VEC4", "flat_b")),
        outputs=(("VEC4", "out_count"),),
        textures=(("RGBA32F", f"{what}_records"), ("RGBA32F", "receivers")),
        blocks=((VIEW, "film_view"), LIGHT_BLOCK),
    )
    for what in ("quads", "triangles")
}


def programs() -> tuple[Program, ...]:
    """All passes of the front end."""
    return (RECEIVERS, *BOUNDS.values(), WORDS, *COUNT.values())


def programs_for(size: tuple[int, int]) -> tuple[Program, ...]:
    """Those that a picture of this size is sure to need."""
    return RECEIVERS, BOUNDS[tile_side(size, 1)], WORDS, COUNT["quads"]


@dataclass
class Lit:
    """What a technique gathers from: one light's edges, and this sample's receivers, count and tile words."""

    extent: Extent
    found: Silhouettes
    records: images.Image
    receivers: images.Image
    count: images.Image
    hidden: np.ndarray  # (T,) which of `casters` lie between the eye and the light's centre
    casters: CasterEdges  # that can block this light
    quads: images.Image
    looked_through: tuple[images.Image | None, np.ndarray]  # list, and which of `casters`
    words: images.Image
    tile: int
    block: Block
    values: dict  # of the block

    @property
    def textures(self) -> dict[str, images.Image]:
        return {
            "edge_records": self.records, "receivers": self.receivers, "centre_count": self.count,
            "tile_words": self.words,
        }  # fmt: skip

    def update(self, **values) -> None:
        """Set fields of the block."""
        self.values |= values
        self.block.update(**self.values)


LIT_TEXTURES = (
    ("RGBA32F", "edge_records"), ("RGBA32F", "receivers"), ("FLOAT_2D", "centre_count"), ("UINT_2D", "tile_words"),
)  # fmt: skip


class EdgeTiles:
    """The front end of a renderer's edge shadows: images that it keeps, and lists by light until something changes."""

    def __init__(self):
        self._kept: dict[str, images.Image] = {}
        self._lists: dict[str, tuple] = {}  # by light: key, silhouettes, records, wedges, quads
        self._blocks: list[Block] = []
        self._triangles: dict[int, tuple] = {}  # by number of light: key, list, which casters
        self._eyes: dict[str, tuple] = {}  # by light: key, which casters lie before its centre

    def found(self, frame: Frame, casters: CasterEdges, extent: Extent, accurate: bool, by_group: bool) -> tuple:
        """Silhouettes of a light with their lists on the GPU, from before if nothing changed."""
        emitter = extent.emitter
        key = (
            id(casters), frame.geometry.changes, accurate, by_group, emitter.kind, emitter.centre.tobytes(),
            emitter.u.tobytes(), emitter.v.tobytes(), extent.radius,
        )  # fmt: skip
        known = self._lists.get(emitter.light.key)
        if known is None or known[0] != key:
            own = casters.without(extent.never_blocks(casters.corners))
            made = silhouettes.silhouettes(own, extent, accurate, by_group)
            quads = made.records[made.drawn][:, :2].reshape(-1, 4)
            known = (key, made, *silhouettes.upload(made), images.upload_list(quads), own, casters)
            self._lists[emitter.light.key] = known
        return known

    def light(
        self, frame: Frame, technique: Technique, casters: CasterEdges, extent: Extent, accurate: bool = True,
        by_group: bool = False, number: int = 0, card_words: int = 0,
    ) -> Lit:  # fmt: skip
        """Receivers, count and words of one light for this sample's surfaces. `number`: of the light in the sample,
        whose images must not be another's; `card_words`: of each tile's other list."""
        _, made, records, wedges, quads, casters, _ = self.found(frame, casters, extent, accurate, by_group)
        width, height = frame.size
        words = -(-made.count // 32)
        tile = tile_side(frame.size, max(words, card_words))
        columns, rows = -(-width // tile), -(-height // tile)
        eye = eye_of(frame)
        hidden = self._hidden(frame, casters, extent, eye)
        half_u, half_v = extent.half_axes
        values = {
            "centre": (*extent.centre, float(extent.infinite)),
            "axis": (*extent.emitter.axis, 0.0), "half_u": (*half_u, 0.0), "half_v": (*half_v, 0.0),
            "size": (extent.radius, extent.disc, float(hidden.sum()), frame.offset_size),
            "eye": tuple(eye), "reach": reach_of(frame, casters) if eye[3] > 0.5 else 0.0,
            "shape": IN_PLANE, "edge_count": made.count, "word_count": words,
            "tile_columns": columns, "point_count": 1, "pattern_count": 1, "picture_row": 0, "card_count": 0,
            "card_word_count": 0, "salt": 0, "group_count": 0,
        }  # fmt: skip
        while len(self._blocks) <= number:
            self._blocks.append(Block(EDGE_LIGHT, **values))
        block = self._blocks[number]
        block.update(**values)
        receivers = self.kept("receivers", width, height, "RGBA32F")
        blocks = {"film_view": frame.view_block, "edge_light": block}
        passes.fullscreen(RECEIVERS, images.Target((receivers,)), textures=surface_bindings(frame), blocks=blocks)
        low, high = (self.kept(name, columns, rows, "RGBA32F") for name in ("low", "high"))
        of_tiles = {"low_of_tiles": low, "high_of_tiles": high}
        passes.compute(BOUNDS[tile], (columns, rows), textures={"receivers": receivers}, images=of_tiles)
        count = self.kept("count", width, height, "R16F")
        looked_through = self._looked_through(frame, casters, number)
        self._draw_count(made, quads, looked_through, receivers, count, blocks, float(hidden.sum()))
        total = max(words * columns * rows, 1)
        list_rows = -(-total // images.LIST_WIDTH)
        tile_words = self.kept("words", images.LIST_WIDTH, list_rows, "R32UI")
        if words:
            passes.compute(
                WORDS, (images.LIST_WIDTH, list_rows), textures={"edge_wedges": wedges, **of_tiles},
                images={"tile_words": tile_words}, blocks={"edge_light": block},
            )  # fmt: skip
        frame.count(technique, "edges", made.count)
        frame.count(technique, "shadow quads", len(made.drawn))
        frame.count(technique, "words", words * columns * rows)
        return Lit(
            extent, made, records, receivers, count, hidden, casters, quads, looked_through, tile_words, tile, block,
            values,
        )  # fmt: skip

    def _hidden(self, frame: Frame, casters: CasterEdges, extent: Extent, eye: np.ndarray) -> np.ndarray:
        """(T,) which casters lie between the eye and the light's centre; kept while neither moves."""
        light = extent.emitter.light.key
        key = (frame.geometry.changes, id(casters), extent.centre.tobytes(), eye.tobytes())
        if light not in self._eyes or self._eyes[light][0] != key:
            self._eyes[light] = (key, silhouettes.hidden_from_eye(casters, extent, eye))
        return self._eyes[light][1]

    def _draw_count(self, made, quads, looked_through, receivers, count, blocks, start: float) -> None:
        """D(p, c) of every receiver."""
        target = images.Target((count,))
        target.clear((start, 0.0, 0.0, 0.0))
        state = {"blend": "ADDITIVE_PREMULT", "depth_test": "NONE", "depth_write": False}
        lists = [("quads", quads, len(made.drawn), 6), ("triangles", looked_through[0], len(looked_through[1]), 3)]
        with passes.drawing(target, **state):
            for what, records, total, corners in lists:
                if total:
                    shader = passes.get(COUNT[what])
                    shader.bind(textures={f"{what}_records": records, "receivers": receivers}, blocks=blocks)
                    passes.draw(shader, corner_batch(corners), total)

    def _looked_through(self, frame: Frame, casters: CasterEdges, number: int) -> tuple:
        """Casters that the way from the eye to what is seen may cross: list of corners and planes, None without any,
        and which they are."""
        camera = frame.snapshot.camera
        seen_from = (camera.matrix.tobytes(), camera.clip_start, camera.clip_end, camera.aperture)
        key = (frame.geometry.changes, id(casters), seen_from)
        known = self._triangles.get(number)
        if known is not None and known[0] == key:
            return known[1:]
        forward = -camera.matrix[:3, 2]
        depth = (casters.corners.astype(np.float64) - (camera.matrix[:3, 3] - frame.geometry.origin)) @ forward
        reach = camera.aperture.radius if camera.aperture else 0.0
        before = depth.min(axis=1, initial=np.inf) < camera.clip_start * 1.001 + reach + 1e-5 * frame.geometry.size
        far = depth.max(axis=1, initial=-np.inf) > camera.clip_end
        own = np.flatnonzero(casters.unseen | before | far)
        rows = np.zeros((len(own), 4, 4), np.float32)
        rows[:, :3, :3] = casters.corners[own]
        rows[:, 3] = casters.planes[own]
        self._triangles[number] = (key, images.upload_list(rows.reshape(-1, 4)) if len(own) else None, own)
        return self._triangles[number][1:]

    def kept_bounds(self) -> tuple[images.Image, images.Image]:
        """Boxes around the receivers of tiles, of the light that was asked about last."""
        return self._kept["low"], self._kept["high"]

    def kept(self, name: str, width: int, height: int, image_format: str) -> images.Image:
        """The image of this name, another one of the pool if size or format differ."""
        image = self._kept.get(name)
        if image is None or image.size != (width, height) or image.format != image_format:
            if image is not None:
                images.pool.give(image)
            image = self._kept[name] = images.pool.take(width, height, image_format)
        return image

    @property
    def bytes(self) -> int:
        """Of all images and lists that are kept."""
        lists = [image for known in self._lists.values() for image in known[2:5]]
        return sum(image.bytes for image in (*self._kept.values(), *lists))

    def release(self) -> None:
        for image in self._kept.values():
            images.pool.give(image)
        self._kept, self._lists, self._blocks, self._triangles, self._eyes = {}, {}, [], {}, {}


def tile_side(size: tuple[int, int], words: int) -> int:
    """Pixels along a tile's side: the finest whose words fit."""
    first = 0 if size[0] * size[1] <= SMALL_PICTURE else 1
    for tile in TILES[first:]:
        if _fits(size, words, tile):
            return tile
    return TILES[-1]


def fits(size: tuple[int, int], entries: int) -> bool:
    """Whether a list of so many entries, a bit each in every tile, fits a picture of a size."""
    return _fits(size, -(-entries // 32), TILES[-1])


def _fits(size: tuple[int, int], words: int, tile: int) -> bool:
    return words * (-(-size[0] // tile)) * (-(-size[1] // tile)) <= MOST_WORDS


def eye_of(frame: Frame) -> np.ndarray:
    """(4,) where this sample looks from, relative to the render origin; w = 1: the direction towards an orthographic
    eye."""
    eye, backward = (frame.view_block.value(name) for name in ("eye", "backward"))
    return np.array([*backward[:3], 1.0]) if eye[3] > 0.5 else np.array([*eye[:3], 0.0])


def reach_of(frame: Frame, casters: CasterEdges) -> float:
    """Longer than the way from any caster to any receiver, m."""
    receivers = frame.receivers
    low, high = casters.corners.min(axis=(0, 1), initial=0.0), casters.corners.max(axis=(0, 1), initial=0.0)
    if receivers is not None and len(receivers.distance):
        low, high = np.minimum(low, receivers.low.min(axis=0)), np.maximum(high, receivers.high.max(axis=0))
    return 2.0 * float(np.linalg.norm(high - low)) + 1e-3


def nearest_receiver(frame: Frame, emitter: lights.Emitter) -> float:
    """Distance of the nearest tile of receivers from a light's centre, m; inf without any."""
    receivers = frame.receivers
    if emitter.kind == lights.SUN or receivers is None or not len(receivers.distance):
        return np.inf
    nearest = np.clip(emitter.centre, receivers.low, receivers.high)
    return float(np.linalg.norm(nearest - emitter.centre, axis=1).min())


_batches: dict[int, geometry.Batch] = {}


def corner_batch(count: int) -> geometry.Batch:
    """A batch of so many corners that know nothing but their number."""
    if count not in _batches:
        vertices = geometry.vertex_buffer(number=np.arange(count, dtype=np.int32))
        _batches[count] = geometry.triangle_batch(vertices, np.arange(count))
    return _batches[count]


@context.on_release
def _release() -> None:
    _batches.clear()
