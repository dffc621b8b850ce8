"""Light below surfaces as Shah's thesis has it (2007, chapter 6): places where light enters, splatted over the picture.

    L(x_o) = F_t(w_o) / pi * sum over places x_i of  R_d(|x_i - x_o|) F_t(w_i) E(x_i) dA(x_i)

Each x_i is a texel of a lamp's view of the objects, with the flux that it stands for, so that no area has to be counted
(the specification's flux mode). It is drawn as a square that faces the camera, as large as the radius within which 99 %
of the dipole lies; pixels of the same object add their share. As the thesis' own practice for the world, points of the
mesh stand for what has no view: the world, emissive meshes, lamps with links; and of all lamps on objects that shadow
rays do not meet for certain. A channel whose range is less than a pixel or what texels of all samples lie apart leaves
where it enters.

| cost | per sample |
|---|---|
| rays | `grid` squared for each lamp and group of objects, and what lights points of the mesh |
| fragments | a texel that is lit: the pixels within its radius |
| bytes | 32 a texel of a lamp's view, 48 a pixel |

Bias: that of the dipole, a half-infinite plane for bodies of any shape; 1 % beyond the radius; a grid coarser than a
mean free path shows as patches. Indirect light leaves where it enters.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..frame.picture import Frame
from ..frame.technique import Technique
from ..gfx import images, passes
from ..gfx.library import Program
from ..gfx.struct import Block
from ..scene import acceleration
from ..scene.culling import CORNERS
from ..scene.materials import SCATTER_IMAGES
from ..scene.scatter_points import ROW, ScatterPoints
from ..scene.view import VIEW
from ..sources import lights
from ..surfaces.hits import Hits
from ..surfaces.scatter_means import ScatterMeans
from .asked import asked
from .caustic_casters import answered
from .light_views import groups, views_of
from .point_light import PointLight

FEW = 4  # points of a wide lamp, in a picture of one sample
RECORDS = (("VEC4", "out_point"), ("VEC4", "out_flux"))
OBJECTS = tuple(("RGBA32F", name) for name in ("scatter_objects", "scatter_means", "point_entry", "splat_objects"))
RAYS = passes.fullscreen_program(
    "subsurface, a lamp's view",
    "subsurface/splat_rays.frag.glsl",
    textures=(
        *acceleration.HIERARCHY_TEXTURES, ("RG32F", "trace_owners"), ("RGBA32F", "scatter_near"),
        *OBJECTS,
    ),
    blocks=((VIEW, "film_view"), (lights.SOURCES, "sources")),
    constants=(
        *(("INT", name) for name in ("first_object", "first_leaf", "group_seen", "opaque_glass")),
        ("FLOAT", "offset_size"),
    ),
    outputs=RECORDS,
)  # fmt: skip
POINTS = passes.fullscreen_program(
    "subsurface, points as splats",
    "subsurface/splat_points.frag.glsl",
    textures=(
        *(("RGBA32F", name) for name in ("point_position", "point_instances", "cells", "cell_direct", "cell_whole")),
        *OBJECTS,
    ),
    constants=(("INT", "first_object"),),
    outputs=RECORDS,
)  # fmt: skip
SHOWN = ("surface_position", "surface_normal", "surface_diffuse", "spread_length", "scatter_share", "spread_entry",
         "scatter_walk")  # fmt: skip
PIXELS = passes.fullscreen_program(
    "subsurface, dipoles of pixels",
    "subsurface/splat_pixels.frag.glsl",
    textures=tuple(("RGBA32F", name) for name in SHOWN[3:]),
    outputs=(("VEC4", "out_real"), ("VEC4", "out_transport")),
)
SPLAT = Program(
    name="subsurface splat",
    vertex="subsurface/splat.vert.glsl",
    fragment="subsurface/splat.frag.glsl",
    inputs=passes.QUAD_INPUTS,
    varyings=(("flat", "VEC4", "splat_point"), ("flat", "VEC4", "splat_flux")),
    textures=tuple(
        ("RGBA32F", name)
        for name in ("splat_points", "splat_fluxes", "dipole_real", "dipole_transport", "surface_position")
    ),
    blocks=((VIEW, "film_view"),),
    constants=(("INT", "splat_columns"),),
    outputs=(("VEC4", "out_light"),),
)
APPLY = passes.fullscreen_program(
    "subsurface, light of splats",
    "subsurface/splat_apply.frag.glsl",
    textures=tuple(
        ("RGBA32F", name) for name in (*SHOWN, "light_direct", "splatted", "dipole_transport", "splat_objects")
    ),
    blocks=((VIEW, "film_view"),),
    outputs=(("VEC4", "out_direct"),),
)
PROGRAMS = (RAYS, POINTS, PIXELS, SPLAT, APPLY)


class Splats:
    """Splats of a picture. A technique owns one: `begin` once a picture, `draw` in each sample."""

    def __init__(self):
        self._sources = lights.Sources()
        self._block: Block | None = None
        self._boxes: list[tuple[np.ndarray, np.ndarray]] = []
        self._lamps: list[lights.Emitter] = []
        # By object: m between texels of all samples; number of its box, -1: no view of it, its points have all light.
        self._objects: images.Image | None = None
        self._unseen = False  # whether there are such

    def begin(self, frame: Frame, points: ScatterPoints, materials: set[int], grid: int) -> None:
        """Find what lamps look at. `materials`: those that scatter; `grid`: texels along a side of a view."""
        frame.kept(ScatterMeans).update(frame, sorted(materials))
        shown, meshes = [frame.geometry.placed[0][one.instance] for one in points.objects], frame.snapshot.meshes
        low, high = [], []
        for one in shown:
            mesh = meshes[one.mesh].positions
            corners = mesh.min(axis=0) + CORNERS * (mesh.max(axis=0) - mesh.min(axis=0))
            placed = corners @ one.matrix[:3, :3].T + one.matrix[:3, 3] - frame.geometry.origin
            low.append(placed.min(axis=0))
            high.append(placed.max(axis=0))
        self._boxes = list(zip(*groups(np.array(low), np.array(high)))) if shown else []
        compiled, rows = frame.materials.compiled, []
        for one, listed, own_low, own_high in zip(shown, points.objects, low, high):
            box, apart = -1, listed.spacing
            if one.visibility.shadow and not any(compiled[material].casts_stochastically for material in one.materials):
                for number, (box_low, box_high) in enumerate(self._boxes):
                    if (own_low >= box_low).all() and (own_high <= box_high).all():
                        box, apart = number, (box_high - box_low).max() / grid
            rows.append((apart / np.sqrt(frame.settings.samples), box, 0.0, 0.0))
        self._objects = images.upload_list(np.array(rows, np.float32).reshape(-1, 4))
        self._unseen = any(row[1] < 0 for row in rows)
        self._lamps = [one for one in frame.emitters if self._has_view(one)]

    @staticmethod
    def _has_view(one: lights.Emitter) -> bool:
        links = one.light.links
        return bool(one.flags & lights.DIFFUSE_FLAG) and one.light.cast_shadow and not (links.unlit or links.passing)

    def draw(self, frame: Frame, technique: Technique, points: ScatterPoints, light: PointLight) -> None:
        """Put the light of this sample's splats in the place of the direct light that entered."""
        shown = frame.images
        picture = dict(zip(SHOWN, (
            shown["surface.position"], shown["surface.normal"], shown["surface.diffuse"],
            *(shown[f"surface.scatter_{name}"] for name in SCATTER_IMAGES),
        )))  # fmt: skip
        dipoles = [images.pool.take(*frame.size, "RGBA32F") for _ in range(2)]
        passes.fullscreen(PIXELS, images.Target(tuple(dipoles)), textures={name: picture[name] for name in SHOWN[3:]})
        sums, before = (images.pool.take(*frame.size, "RGBA32F") for _ in range(2))
        target = images.Target((sums,))
        target.clear()
        read = {"dipole_real": dipoles[0], "dipole_transport": dipoles[1], "surface_position": picture[SHOWN[0]]}
        for records in self._records(frame, technique, points, light):
            self._splat(frame, target, records, read)
            for image in records:
                images.pool.give(image)
            frame.count(technique, "passes", 2)
        direct = frame.target("radiance.diffuse_direct")
        passes.copy(shown["radiance.diffuse_direct"], images.Target((before,)))
        passes.fullscreen(
            APPLY, direct,
            textures={
                **picture, "light_direct": before, "splatted": sums, "dipole_transport": dipoles[1],
                "splat_objects": self._objects,
            },
            blocks={"film_view": frame.view_block},
        )  # fmt: skip
        for image in (*dipoles, sums, before):
            images.pool.give(image)

    def _splat(self, frame: Frame, target: images.Target, records, read: dict[str, images.Image]) -> None:
        shader = passes.get(SPLAT)
        with passes.drawing(target, blend="ADDITIVE_PREMULT", depth_test="NONE", depth_write=False):
            shader.bind(
                textures={"splat_points": records[0], "splat_fluxes": records[1], **read},
                blocks={"film_view": frame.view_block}, constants={"splat_columns": records[0].width},
            )  # fmt: skip
            passes.draw_quads(shader, records[0].width * records[0].height)

    def _records(self, frame: Frame, technique: Technique, points: ScatterPoints, light: PointLight):
        """Images of places and fluxes, of the pool, which whoever asks gives back."""
        if not points.rows:
            return
        objects = {
            "scatter_objects": points.table, "scatter_means": frame.kept(ScatterMeans).image,
            "point_entry": points.entries(frame.sample), "splat_objects": self._objects,
        }  # fmt: skip
        yield from self._views(frame, technique, points, objects)
        yield from self._points(frame, technique, points, light, objects)

    def _views(
        self, frame: Frame, technique: Technique, points: ScatterPoints, objects: dict[str, images.Image]
    ) -> Iterator[tuple[images.Image, ...]]:
        hierarchy = frame.hierarchy("shadow")
        owners, first_leaf = frame.kept(Hits).owners(frame, hierarchy)
        grid = frame.settings.get(technique, "grid")
        for emitter in self._lamps:
            each = max(FEW // frame.settings.samples, 1) if emitter.extended else 1
            side = max(int(grid / np.sqrt(each)), 8)
            for number in range(frame.sample * each, (frame.sample + 1) * each):
                sample = emitter.sample(*frame.random_volume("subsurface/light", number))
                shift = frame.random("subsurface/grid", number)
                for box, (low, high) in enumerate(self._boxes):
                    constants = {
                        "group_seen": box, "opaque_glass": int(answered(frame, emitter)), "first_leaf": first_leaf,
                    }  # fmt: skip
                    for view in views_of(emitter, sample, low, high, side, shift, frame.geometry.size):
                        yield self._seen(frame, points, objects, view, emitter.row(sample, 0, 0, 1.0, each),
                                         hierarchy, owners, constants)  # fmt: skip
                        frame.count(technique, "rays", side * side)

    def _seen(
        self, frame: Frame, points: ScatterPoints, objects, view, row, hierarchy, owners, constants
    ) -> tuple[images.Image, ...]:
        values = {**view.values, "sample_index": frame.sample, "seed": frame.settings.seed}
        if self._block is None:
            self._block = Block(VIEW, **values)
        else:
            self._block.update(**values)
        made = tuple(images.pool.take(view.side, view.side, "RGBA32F") for _ in RECORDS)
        textures = {
            **hierarchy.textures, "trace_owners": owners, "scatter_near": points.near, **objects,
        }  # fmt: skip
        passes.fullscreen(
            asked(frame, RAYS, textures), images.Target(made), textures=textures,
            blocks={"film_view": self._block, "sources": self._sources.set([row])},
            constants={**constants, "first_object": points.first_object, "offset_size": frame.offset_size},
        )  # fmt: skip
        return made

    def _points(
        self, frame: Frame, technique: Technique, points: ScatterPoints, light: PointLight, objects
    ) -> Iterator[tuple[images.Image, ...]]:
        """Of the light of points of the mesh from all but the lamps with views; of objects that these miss from all."""
        size = (ROW, points.rows)
        position, normal = points.surface(frame.sample)
        lit = [images.pool.take(*size, "RGBA32F") for _ in range(2)]
        whole = [images.pool.take(*size, "RGBA32F") for _ in range(2)] if self._unseen else []
        black = images.pool.take(*size, "RGBA32F")
        for some in ((black,), lit, whole) if whole else ((black,), lit):
            images.Target(tuple(some)).clear()
        surfaces = {
            "position": position, "normal": normal, "diffuse": objects["point_entry"],
            **dict.fromkeys(("tint", "lobe", "emission"), black),
        }  # fmt: skip
        without = frozenset(id(one) for one in self._lamps)
        rays = 0
        for pair, left_out in ((lit, without), (whole, frozenset())):
            if pair:
                target = images.Target(tuple(pair))
                rays += light.add(frame, surfaces, target, None, points.instances, left_out, photons=True)[1]
        if rays:
            frame.count(technique, "rays", rays * ROW * points.rows)
            made = tuple(images.pool.take(*size, "RGBA32F") for _ in RECORDS)
            passes.fullscreen(
                POINTS, images.Target(made),
                textures={
                    "point_position": position, "point_instances": points.instances, "cell_direct": lit[0],
                    "cell_whole": (whole or lit)[0],
                    "cells": points.cells[frame.sample % len(points.cells)], **objects,
                },
                constants={"first_object": points.first_object},
            )  # fmt: skip
            yield made
        for image in (*lit, *whole, black):
            images.pool.give(image)

    def release(self) -> None:
        """Drop GPU resources."""
        self._sources.release()
        self.__init__()
