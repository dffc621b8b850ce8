"""Micro-rendering: indirect light from lit points of all surfaces, drawn into a small picture at each place.

Points are spread over all surfaces by area, each for its own piece of a triangle, shaded with their own materials and
lit by all lamps, the world and emissive meshes (lighting/point_runs.py). A tree over them has triangles or rectangles
in place of flat groups of points (scene/point_tree.py). Every place that gathers walks the tree and draws what it sees
of it into a micro-buffer of its hemisphere, down to groups as large as `threshold` pixels (lighting/micro_buffers.py).
Pixels of the buffer are equal shares of what the surface reflects, so light is a plain mean:

    E / pi = mean over pixels of the radiance of the node in front       a lobe: mean of weight(ray) x that radiance

Where gloss is, nodes have its light, too: a lobe about where mirrors would send direct light, and of bounced light what
comes from one direction, as mean direction and flux, which average over a tree. What photons bring is left out.

Diffuse light is gathered by regions and interpolated as in multires_radiosity.py; lobes of microfacets by each pixel,
whose micro-buffer has rays of the lobe. Groups of points gather further bounces. Each sample has other points.

Source: Ritschel, Engelhardt, Grosch, Seidel, Kautz, Dachsbacher 2009; Ritschel's thesis 2009, chapter 6. Ours: rays
through the middles of pixels (there a group fills one pixel); both sides of points; gloss by direction.

| cost | with n points, a region or pixel that gathers, K x K pixels |
|---|---|
| fetches, rays | 2 per visited node, some 10 K^2 if triangles are large; 2 n rays for each point of a light source |
| bytes | 4 K^2 for each place of a dispatch, 16 MiB at most; 330 a point, 192 more with gloss (6 passes more, too) |
| passes | 4 x `levels` + 2, and for each bounce 4; the tree in parts on Mesa (docs/micro_rendering.md) |

Fails: lobes narrower than the points' spacing show pieces (mirrors need rays). A kilometre of ground takes all points.
Bias (diffuse and glossy indirect light): a piece sends the light of one place on it as far as nothing stands between
(shaders/micro/clips.frag.glsl); of more triangles than half of the points the smallest have discs, which reach over
edges: leaves, grass and hair are wrong. Gloss of a point has one lobe for all lamps and the last bounce, and is diffuse
in the bounces before. Sheen and translucent lobes get none, clear glass is not there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from itertools import product

from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.technique import Param
from ..gfx import context, images, passes
from ..gfx.library import Program
from ..kernels import lists
from ..lighting import caustic_casters, lit_points, micro_buffers
from ..lighting.asked import asked
from ..lighting.micro_buffers import (
    BUFFER_CONSTANTS,
    BUFFER_DEFINES,
    BUFFER_IMAGE,
    BUFFER_TEXTURES,
    LOBE_TEXTURES,
    NodeRadiance,
    buffer_bindings,
)
from ..lighting.point_runs import PointRuns, Run
from ..materials.compiler import may_mirror
from ..scene import acceleration
from ..scene.seen import SEES
from ..scene.view import VIEW
from ..snapshot.scene import Snapshot
from ..surfaces.draw import SURFACE_TEXTURES, surface_bindings
from .multires_radiosity import GRID, RUNS, MultiresRadiosity, _level_size, fitting_levels

MOST_TEXELS = 1 << 22  # of micro-buffers that are drawn at once
WIDEST = 8192  # texels of their image
BLOCK = tuple(("INT", name) for name in ("first_row", "row_count", "first_column", "columns"))  # of a picture


def _regions(listed: bool) -> Program:
    if listed:
        textures, constants = lists.READ, (("INT", "list_width"),)
    else:
        textures = (("FLOAT_2D", "region_flags"), ("FLOAT_2D", "coarser_flags"))
        constants = (("INT", "region_level"), ("INT", "levels"))
    return Program(
        name=f"micro-buffers of regions{'' if listed else ' of a level'}",
        compute="micro/region.comp.glsl",
        textures=(*SURFACE_TEXTURES, *BUFFER_TEXTURES, ("RGBA32F", "node_radiance"), *textures),
        images=(("gathered", "RGBA32F", "FLOAT_2D", "WRITE"), BUFFER_IMAGE),
        blocks=((VIEW, "film_view"),),
        constants=(
            *BUFFER_CONSTANTS, *GRID, *BLOCK, *constants,
        ),
        defines=(*RUNS, *BUFFER_DEFINES, ("PLACES", "1"), *(() if listed else (("BY_LEVEL", ""),))),
        group=(lists.RUN, 1, 1),
    )  # fmt: skip


REGIONS, REGIONS_OF_LEVEL = _regions(True), _regions(False)


@cache
def by_direction(program: Program, thrown: bool) -> Program:
    """The same program of micro-buffers, where gloss at points sends light by direction. `thrown`: without what photons
    bring of it."""
    return replace(
        program, name=f"{program.name}, gloss by direction{', but for photons' * thrown}",
        textures=(*program.textures, *(LOBE_TEXTURES if thrown else LOBE_TEXTURES[:2])),
        defines=(*program.defines, ("NODE_LOBES", "1"), *((("NODE_THROWN", "1"),) if thrown else ())),
    )  # fmt: skip


GLOSSY = Program(
    name="micro-buffers of lobes",
    compute="micro/glossy.comp.glsl",
    textures=(*SURFACE_TEXTURES, ("RGBA32F", "energy_table"), *BUFFER_TEXTURES, ("RGBA32F", "node_radiance")),
    images=(("gathered", "RGBA32F", "FLOAT_2D", "WRITE"), BUFFER_IMAGE),
    blocks=((VIEW, "film_view"),),
    constants=(*BUFFER_CONSTANTS, *BLOCK),
    defines=(*BUFFER_DEFINES, ("PLACES", "1")),
)
REFLECTED = passes.fullscreen_program(
    "light of micro-buffers reflected",
    "micro/reflected.frag.glsl",
    textures=(("RGBA32F", "surface_position"), ("RGBA32F", "surface_diffuse"), ("RGBA32F", "irradiance")),
    constants=(("IVEC2", "grid_offset"),),
    outputs=(("VEC4", "out_diffuse"),),
)


class MicroRendering(MultiresRadiosity):
    name = "micro_rendering"
    label = "Micro-rendering"
    params = (
        Param(
            "points", "Points", 8192,
            "Points on all surfaces at which light is stored; rounded to a power of two",
            64, 1 << 20,
        ),
        Param(
            "side", "Micro-buffer side", 8,
            "Pixels along each side of the micro-buffer, the picture of a hemisphere from which light is gathered",
            4, 32, draft=8,
        ),
        Param(
            "lobe_side", "Reflections' side", 5,
            "Pixels along each side of the micro-buffer of a glossy reflection",
            1, 32, draft=3,
        ),
        Param(
            "threshold", "Threshold", 1.0,
            "Largest group of points that is drawn as one disc, in pixels of the micro-buffer",
            0.05, 16.0,
        ),
        Param(
            "centre_test", "Centre test", True,
            "Draw a disc into the pixels whose centres see it; otherwise into the pixel that holds the disc's own "
            "centre, which enlarges silhouettes",
        ),
        Param(
            "groups", "Groups", 1024,
            "Groups of points that gather light for further bounces",
            16, 1 << 14, draft=256,
        ),
        Param(
            "levels", "Levels", 2,
            "Largest regions have 2^levels pixels a side; 0: gather light at every pixel",
            0, 5,
        ),
    )  # fmt: skip
    provides = ()

    def __init__(self):
        super().__init__()
        self._points = PointRuns("micro")
        self._radiance = NodeRadiance()

    def claims(self, snapshot: Snapshot, settings: Settings) -> bool:
        return False

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        return super().skip(snapshot, settings) or acceleration.too_many_copies(snapshot)

    def programs(self, snapshot: Snapshot, settings: Settings) -> tuple[Program, ...]:
        regions = REGIONS if context.counts_in_images() else REGIONS_OF_LEVEL
        if not any(may_mirror(snapshot.materials[k].graph) for k in snapshot.used_materials):
            return SEES, *lit_points.PROGRAMS, *micro_buffers.PROGRAMS, regions, REFLECTED
        found = caustic_casters.casters_of(snapshot)
        thrown = not isinstance(found, str) and bool(found.mirrors)
        seen = by_direction(regions, thrown), by_direction(GLOSSY, False)
        gathers = (micro_buffers.ARRIVING,) if settings.bounces > 2 else ()
        directed = (*lit_points.DIRECTED_PROGRAMS, *micro_buffers.DIRECTED_PROGRAMS, *gathers)
        return SEES, *directed, *seen, REFLECTED

    def begin(self, frame: Frame) -> None:
        if frame.receivers is not None and len(frame.receivers.distance):
            self._points.begin(frame, self, frame.settings.get(self, "points"))

    def sample(self, frame: Frame) -> Iterator[None]:
        if frame.receivers is None or not len(frame.receivers.distance):
            return
        run = self._points.run(frame, self, frame.sample)
        if run is None:
            return
        settings = {name: frame.settings.get(self, name) for name in ("threshold", "centre_test")}
        yield
        yield from self._radiance.update(
            frame, self, self._points, run, frame.settings.bounces - 1, self._groups(frame), **settings
        )
        yield
        levels = fitting_levels(frame.size, frame.settings.get(self, "levels"))
        offset = tuple(int(u * (1 << levels)) for u in frame.random("regions"))
        bindings = {
            "textures": {
                **surface_bindings(frame),
                "tree_nodes": run.nodes,
                "piece_clips": run.clips,
                "node_radiance": self._radiance.image,
                **self._radiance.lobes,
            },
            "blocks": {"film_view": frame.view_block},
            "constants": buffer_bindings(frame, run, frame.settings.get(self, "side"), **settings, use="micro regions"),
        }
        irradiance = yield from self.irradiance(frame, levels, offset, frame.typical_distance, bindings, None)
        textures = {name: surface_bindings(frame)[name] for name in ("surface_position", "surface_diffuse")}
        passes.fullscreen(
            REFLECTED, frame.target("radiance.diffuse_indirect"), blend="ADDITIVE_PREMULT",
            textures={**textures, "irradiance": irradiance}, constants={"grid_offset": offset},
        )  # fmt: skip
        images.pool.give(irradiance)
        frame.count(self, "passes", 4 * levels + 2)
        if frame.materials.glossy:
            yield from self._gather_lobes(frame, run, bindings, settings)

    def _groups(self, frame: Frame) -> int:
        """A power of two."""
        return 1 << (int(frame.settings.get(self, "groups")).bit_length() - 1)

    def _gather_listed(self, frame: Frame, bindings, bound, grid: dict, atlas, listed: dict) -> Iterator[None]:
        textures = bindings["textures"] | listed
        columns = min(lists.columns((WIDEST // bindings["constants"]["micro_side"], 0), 1), 512)
        rows = -(-frame.size[0] * frame.size[1] // columns)
        yield from self._dispatch(
            frame, REGIONS, bindings, textures, grid, atlas, (columns, rows), {"list_width": columns}
        )

    def _gather_levels(self, frame: Frame, bindings, bound, grid: dict, atlas, flags: list) -> Iterator[None]:
        levels, anything = len(flags), bindings["textures"]["tree_nodes"]  # for what a level does not look at
        for level in range(levels, -1, -1):
            textures = bindings["textures"] | {
                "region_flags": flags[level - 1] if level > 0 else anything,
                "coarser_flags": flags[level] if level < levels else anything,
            }
            size = _level_size(frame.size, level, levels)
            constants = {"region_level": level, "levels": levels}
            yield from self._dispatch(frame, REGIONS_OF_LEVEL, bindings, textures, grid, atlas, size, constants)

    def _gather_lobes(self, frame: Frame, run: Run, bindings, settings: dict) -> Iterator[None]:
        """Reflections of microfacets, each pixel's own."""
        side = frame.settings.get(self, "lobe_side")
        bindings = {
            "textures": {**bindings["textures"], "energy_table": frame.materials.energy_table},
            "blocks": bindings["blocks"],
            "constants": {**buffer_bindings(frame, run, side, **settings, use="micro lobes"), "centre_test": 1},
        }  # fmt: skip
        gathered = images.pool.take(*frame.size, "RGBA32F")
        images.Target((gathered,)).clear()
        try:
            yield from self._dispatch(frame, GLOSSY, bindings, bindings["textures"], {}, gathered, frame.size, {})
            target = frame.target("radiance.glossy_indirect")
            passes.fullscreen(
                passes.COPY, target, blend="ADDITIVE_PREMULT", textures={"original": gathered}
            )  # fmt: skip
        finally:
            images.pool.give(gathered)
        frame.count(self, "gathers of lobes", frame.size[0] * frame.size[1])
        frame.count(self, "passes")

    def _dispatch(
        self, frame: Frame, program: Program, bindings, textures, grid, atlas, size: tuple[int, int], constants
    ) -> Iterator[None]:  # fmt: skip
        """Block after block, so that micro-buffers take little memory, fit an image, and no dispatch takes long."""
        if self._radiance.lobes:  # photons bring nothing to gloss
            thrown = "node_thrown" in textures and program is not GLOSSY
            program = by_direction(program, thrown)
            textures = {name: image for name, image in textures.items() if thrown or name != "node_thrown"}
        program = asked(frame, program, textures := dict(textures))
        side, leaves = (bindings["constants"][name] for name in ("micro_side", "leaf_count"))
        width, height = size
        columns = min(WIDEST // side, width)
        rows = max(min(MOST_TEXELS // (columns * side * side), WIDEST // side, height), 1)
        micro = images.pool.take(columns * side, rows * side, "R32UI")
        try:
            for first_row, first_column in product(range(0, height, rows), range(0, width, columns)):
                block = {
                    "first_row": first_row, "row_count": min(rows, height - first_row),
                    "first_column": first_column, "columns": min(columns, width - first_column),
                }  # fmt: skip
                for part in micro_buffers.parts(leaves, side):
                    passes.compute(
                        program, (block["columns"], block["row_count"]), textures=textures,
                        images={"gathered": atlas, "micro": micro}, blocks=bindings["blocks"],
                        constants={**bindings["constants"], **grid, **constants, **block, "part": part},
                    )  # fmt: skip
                    yield
        finally:
            images.pool.give(micro)

    def release(self) -> None:
        super().release()
        self._points.release()
        self._radiance.release()
