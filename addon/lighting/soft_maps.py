"""Soft shadow maps: what techniques share that see a light, or a part of it, from one depth map.

Which part a map stands for follows from the samples: all of the light with one, a part whose extents shrink by sqrt(n)
with n (PointMaps.cell). Beside its map each view has a min-max pyramid, which tells most pixels at once that they
are lit or in full shadow, and the limits of its depths. Maps are kept, from frame to frame too, as long as the casters
and what they are seen from are the same: a light may change its power or colour.

How a kernel follows from the light and a blocker's height stands in shaders/lib/soft_kernel.glsl, the two steps
(blocker search, penumbra) in shaders/lib/soft_visibility.glsl; a technique brings what it filters the map to, and how
it asks a box of the filtered map for blockers.

What one map cannot tell, blockers that touch the receiver or that others hide from the light's middle, short rays see
(`contacts`, shaders/lib/contact.glsl): without them a handful of pixels, lit where two leaves meet, had nearly all of
foliage's relMSE. Scenes with too many triangles for a hierarchy look into smaller windows of the map instead. relMSE of
one-sample light by Auto, windows and rays (`python -m bench.soft --cycles 256`): poles 0.0066 and 0.0006, fence 0.077
and 0.008, foliage 0.092 and 0.005.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.technique import Param
from ..gfx import images
from ..kernels import tables
from ..materials.compiler import may_emit
from ..scene import acceleration
from ..snapshot.scene import Snapshot
from ..sources import lights
from . import depth_maps, shared_visibility
from .point_maps import PointMaps
from .visibility import PART_TEXELS, RAY_CONSTANTS, Lookup, Maps, drawn_stochastically, map_resolution, ray_bindings

REFINE = Param(
    "refine", "Refine", True,
    "Let each sample stand for a smaller part of the light as samples are added, so that the error goes to zero; "
    "otherwise every sample stands for the entire light, seen from its centre",
)  # fmt: skip
CONTACTS = Param(
    "contacts", "Contact rays", True,
    "Trace short rays for blockers close to the receiver, which a shadow map does not resolve",
    draft=False,
)  # fmt: skip
SPARSE = Param(
    "sparse", "Sparse lookups", True,
    "In large pictures of few samples, look shadows up at every fourth pixel and in between only where shadows or "
    "surfaces vary",
)  # fmt: skip
FEWEST_POINTS = (
    16  # fewer parts that do not tile the light, at points of a low-discrepancy set, are worse than all of it
)
LIMIT_TEXTURES = (("RG32F", "depth_bounds"), ("RG32F", "depth_limits"))
LIMIT_CONSTANTS = (("INT", "bounds_rows"), ("INT", "top_level"))
BOUNDS = tables.PyramidSource(
    "depth bounds",
    "vec2 bounds_source(ivec2 texel)\n{\n  vec4 caster = depth_maps_fetch(texel);\n"
    "  return (caster.w > 0.0) ? caster.xx : vec2(0.0);\n}\n",
    textures=(("RGBA32F", "depth_maps"),),
)
DEPTH_BOUNDS = tables.level_program(BOUNDS)


def soft_lookup(name: str, file: str, filtered: tuple[str, str], constants: tuple = (), defines: tuple = ()) -> Lookup:
    """A lookup that asks the map, its pyramid and limits, and the `filtered` map."""
    return Lookup(
        name,
        file,
        textures=(filtered, *LIMIT_TEXTURES),
        constants=(*LIMIT_CONSTANTS, *constants),
        defines=defines,
    )


def with_contacts(lookup: Lookup) -> Lookup:
    """The same with short rays for near blockers."""
    return replace(
        lookup,
        name=f"{lookup.name}, contact rays",
        textures=lookup.textures + acceleration.HIERARCHY_TEXTURES,
        constants=(*lookup.constants, *RAY_CONSTANTS, ("INT", "contact_rays")),
        defines=(*lookup.defines, ("CONTACT_RAYS", "1")),
    )


def lit_by_others(snapshot: Snapshot) -> bool:
    """Whether the world or an emissive mesh lights something that may stand in shadow."""
    if not snapshot.casts_shadows:
        return False
    used = snapshot.used_materials
    return bool(np.any(snapshot.world.color)) or any(may_emit(snapshot.materials[k].graph) for k in used)


def few_samples(frame: Frame) -> bool:
    """Whether each sample is so much of the picture that it pays to spend rays on it, and to save texels."""
    return frame.settings.samples < FEWEST_POINTS


class SoftMaps(PointMaps):
    """Base of the techniques; `filtered` is theirs."""

    atlas_texels = 2**22  # filtered maps take several times the bytes of plain ones
    least_side = 32  # of a map, texels
    contact_rays = 8  # at most, by which a picture of few samples looks for contacts of a map; with more samples, one

    def __init__(self):
        super().__init__()
        self.service.layers = False
        self._drawn: tuple[tuple, Maps] | None = None
        self._kept: dict[str, images.Image] = {}

    def serves_every_source(self, frame: Frame) -> bool:
        """Where it is chosen by hand. Auto takes it for lamps alone: a map for each of many directions costs more."""
        return self.name in (frame.settings.slots.get("shadow"), *(frame.settings.passes or ()))

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        reason = super().skip(snapshot, settings)
        chosen = self.name in (settings.slots.get("shadow"), *(settings.passes or ()))
        return None if chosen and lit_by_others(snapshot) else reason

    def cell(self, frame: Frame, number: int, points: float) -> float:
        if not frame.settings.get(self, "refine"):
            return 1.0
        if not frame.settings.schedule.known_total:
            return float((number + 1) ** -0.5)  # what is shown while it grows has `number` + 1 points up to here
        return float(points**-0.5) if points >= FEWEST_POINTS else 1.0

    def part(self, frame: Frame, emitter: lights.Emitter, number: int, points: float) -> lights.Emitter | None:
        """Where the number of points is known and even, parts that tile the light: 2^k points lie in one each."""
        if not (frame.settings.get(self, "refine") and frame.settings.schedule.known_total and points == round(points)):
            return None
        return emitter.part(*frame.random("light", number), round(points))

    def resolution(self, frame: Frame) -> int:
        """A power of two, so that no entry of the pyramid lies in two views."""
        wished = map_resolution(frame, frame.settings.get(self, "texels_per_pixel"))
        return max(1 << round(np.log2(wished)), self.least_side)

    def jitter(self, frame: Frame, emitter: lights.Emitter, number: int) -> tuple[float, float, float, float]:
        if not frame.settings.get(self, "refine"):
            number = 0
        shift_x, shift_y, turn, other = super().jitter(frame, emitter, number)
        if emitter.has_span:
            turn = depth_maps.turn_along(-emitter.axis, emitter.u[:3])  # boxes of texels are the light's shape
            # Points that share their place along an axis of the light, now the map's too, shift it differently there.
            shift_x, shift_y = shift_y, shift_x
        return shift_x, shift_y, turn, other

    def traces(self, frame: Frame, emitter: lights.Emitter) -> bool:
        return False

    def views(self, frame: Frame, emitter: lights.Emitter, sample: np.ndarray, number: int, cell: float = 0.0) -> list:
        # A light without extent has no kernel: its map is asked for one texel.
        cell *= emitter.extended
        frame.count(self, "lights with penumbra" if cell else "hard lights")
        return [replace(view, cell=cell) for view in super().views(frame, emitter, sample, number, cell)]

    def most_texels(self, frame: Frame) -> int:
        """Of the views of a round: filtered at once, a window answers between rounds only."""
        return self.atlas_texels if frame.shared_out is None else min(self.atlas_texels, PART_TEXELS)

    def draw(self, frame: Frame, views: list) -> Maps:
        seen = (frame.geometry.changes, self.resolution(frame), frame.settings.of(self), few_samples(frame))
        key = (*seen, *((view.rows.tobytes(), view.cell) for view in views))
        if not drawn_stochastically(frame) and self._drawn is not None and self._drawn[0] == key:
            frame.count(self, "maps kept", len(views))
            return self._to_ask(frame, self._drawn[1])
        maps = self.service.draw(frame, self, views, self.resolution(frame))
        for _ in maps.drawing:
            pass
        maps = self._with_bounds(frame, views, maps)
        self._drawn = (key, maps)
        return self._to_ask(frame, maps)

    def _to_ask(self, frame: Frame, maps: Maps) -> Maps:
        """`maps` with the lookup, and with what its rays bind where short rays look for near blockers."""
        lookup = self.lookup(frame)
        maps = replace(maps, lookup=lookup, sparse=len(maps.views) > 0 and self._sparse(frame))
        contacts = self.contact_rays > 0 and frame.settings.get(self, "contacts") and len(maps.views) > 0
        if not contacts or acceleration.too_many(frame.snapshot):
            return maps
        textures, constants = ray_bindings(frame)
        constants["contact_rays"] = self.contact_rays if few_samples(frame) else 1
        return replace(
            maps, lookup=with_contacts(lookup), textures=maps.textures | textures,
            constants=maps.constants | constants,
        )  # fmt: skip

    def _sparse(self, frame: Frame) -> bool:
        """Whether shadows are looked up at some pixels, and between where that does not suffice."""
        width, height = frame.size
        many = width * height >= shared_visibility.MANY_PIXELS
        # Of layers that are lit from both sides a pixel shows light of either.
        return few_samples(frame) and many and not frame.materials.soft and frame.settings.get(self, "sparse")

    def _with_bounds(self, frame: Frame, views: list, maps: Maps) -> Maps:
        """Pyramid, limits and filtered maps of the part of the atlas that holds views."""
        side = self.resolution(frame) if views else 2
        rectangles = maps.views[:, 4] if len(maps.views) else np.zeros((1, 4))
        width, height = (max(int(-(-(rectangles[:, k] + rectangles[:, 2]).max() // side)), 1) * side for k in (0, 1))
        levels = max(int(np.log2(side)), 1)
        bounds = self.kept("bounds", tables.pyramid_size(width, height), "RG32F")
        constants = {"bounds_rows": height, "top_level": levels}
        if views:
            tables.build_pyramid(BOUNDS, bounds, levels, textures={"depth_maps": maps.atlas})
        limits = images.upload(_limits(views, rectangles, (height // side, width // side), side), "RG32F")
        shared = {"depth_bounds": bounds, "depth_limits": limits}
        maps = replace(maps, textures=shared, constants=constants)
        return self.filtered(frame, maps, (width, height), bool(views))

    def filtered(self, frame: Frame, maps: Maps, size: tuple[int, int], drawn: bool) -> Maps:
        """`maps`, whose part `size` holds views, with what the lookup needs; without views nothing is built."""
        raise NotImplementedError

    def lookup(self, frame: Frame) -> Lookup:
        """How the filtered maps are asked; rays for near blockers apart."""
        raise NotImplementedError

    def kept(self, name: str, size: tuple[int, int], image_format: str) -> images.Image:
        """The technique's image of this name, another one of the pool if size or format differ."""
        image = self._kept.get(name)
        if image is None or image.size != size or image.format != image_format:
            if image is not None:
                images.pool.give(image)
            image = self._kept[name] = images.pool.take(*size, image_format)
        return image

    def release(self) -> None:
        super().release()
        for image in self._kept.values():
            images.pool.give(image)
        self._kept.clear()
        self._drawn = None


def _limits(views: list, rectangles: np.ndarray, shape: tuple[int, int], side: int) -> np.ndarray:
    """(rows, columns, 2) float32 by cell of the atlas: least q of its receivers, and 1 where views are perspective."""
    limits = np.zeros((*shape, 2), np.float32)
    limits[..., 0] = np.inf
    for view, (x, y, _, _) in zip(views, rectangles):
        place = (int(y) // side, int(x) // side)
        limits[place] = min(limits[place][0], max(view.least_q, 0.0)), view.light_point[3]
    return np.where(np.isfinite(limits), limits, 0.0).astype(np.float32)
