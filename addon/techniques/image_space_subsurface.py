"""Image-space subsurface scattering: light that enters skin, wax or marble at one place and leaves it at another.

    L(x) = albedo / pi * integral over the object's surface of  R(|x - y|) E(y) dA(y)

R is the profile of the material's own method, per channel (kernels/diffusion.py): Christensen-Burley's, or that of the
random walk. E is known where Shah, Konttinen and Pattanaik (2009) find it, at points seen by rasterisation, and at
points of the mesh, which also cover what the camera does not see. A smooth window of a few point distances divides R:

- **near**: pixels of the object around, at taps on a spiral, with all the light that the picture's techniques have
  brought there. The mean over taps is divided by that of the profile, so that it is smooth in one sample. Where the
  profile lies within a pixel, this is the local limit, albedo * E / pi.
- **far**: points of the mesh (scene/scatter_points.py), another of each cell in every sample, lit by every lamp, the
  world and emissive meshes by rays, and by indirect light (the virtual lights of the technique in that slot).

Objects do not exchange light. Albedo and radius are those of the place where light leaves, as in Cycles. Burley's
profile is summed over the surface as it is. Where an object is thin or bent beside its range, the random walk is walked
(lighting/walked_light.py). Elsewhere its mean over points is divided by the profile's, and the exit depends on the
angle of view (Chandrasekhar).

| cost | per sample |
|---|---|
| passes | 1 of the draws that scatter, 1 to 4 over the points, 7 more in glass, 2 over the picture, 2 more for walks |
| rays | a point: one per lamp point, `world directions` and `emissive points`; 4 for indirect light; EXITS in glass |
| fetches, bytes per pixel | 5 per tap, 3 per near point, 1 per row; 32, 208 as it runs; 400 a point (glass: 1900) |

Bias: distances are straight lines through what may be air; the mean over taps is a ratio of what is on screen; the
walk's profile is that of a plane; without virtual lights indirect light comes from pixels alone. Bumps and diffuse
roughness act where light leaves. In mirrors and in indirect light it is diffuse. Fails: a range of many pixels on an
object with more detail than `points` smooths that detail away.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack

import numpy as np

from ..frame.light_paths import SUBSURFACE
from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.technique import MATERIAL, Param, Technique, Write
from ..gfx import images, passes
from ..gfx.library import Program
from ..kernels import diffusion
from ..lighting import leaving_light, repeated_light, splatted_light, walked_light
from ..lighting.asked import asked
from ..lighting.leaving_light import LeavingLight, LeavingService
from ..lighting.point_light import LIGHTING, LIGHTING_IN_LOBES, LIGHTING_WITH_WAYS, PointLight
from ..lighting.splatted_light import Splats
from ..lighting.visibility import RAYS, ray_bindings
from ..materials import translucency
from ..materials.compiled import CompiledMaterial
from ..materials.compiler import may_scatter, may_walk
from ..scene import acceleration
from ..scene.materials import SCATTER_IMAGES
from ..scene.scatter_points import RANGE, ROW, ScatterPoints
from ..scene.traced_triangles import ALONE
from ..scene.view import VIEW
from ..snapshot.panorama import bends_lines
from ..snapshot.scene import Snapshot
from ..surfaces.draw import SURFACES, draw_scatter
from ..surfaces.hits import Hits
from ..surfaces.scatter_means import ScatterMeans
from .instant_radiosity import GATHER_CONSTANTS, GATHER_TEXTURES, LOBE_CONSTANTS, PATH_BLOCKS, GatherBindings

PAIRS = 1 << 20  # of boxes that are compared at once
RAYS_INDIRECT = 4  # of a point in a sample
CHOICE = "surface.walked"
IMAGES = tuple(f"surface.scatter_{name}" for name in SCATTER_IMAGES)

POINT_TEXTURES = (("RGBA32F", "point_position"), ("RGBA32F", "point_normal"), ("RGBA32F", "point_entry"))
PICTURE = (
    "surface_position", "surface_normal", "surface_diffuse", "spread_length", "scatter_share", "spread_entry",
    "light_direct",
    "light_indirect",
)  # fmt: skip
GATHER = passes.fullscreen_program(
    "subsurface gather",
    "subsurface/gather.frag.glsl",
    textures=tuple(
        ("RGBA32F", name)
        for name in (
            "cells", "cell_direct", "cell_indirect", *PICTURE, "walked_near", "scatter_objects", "walk_lobes",
            "whole_before", "cell_shapes",
        )
    ),
    blocks=((VIEW, "film_view"),),
    constants=(("INT", "first_object"), ("INT", "taps"), ("INT", "points_lit")),
    defines=(("WALK_LOBES", "1"), ("RANGE", str(RANGE))),
    outputs=tuple(("VEC4", f"out_{name}") for name in ("direct", "indirect", "whole", "near_direct", "near_indirect")),
)  # fmt: skip
LEFT = ("left_direct", "left_indirect", "near_direct", "near_indirect")
WALKED = tuple(f"walked_{name}" for name in walked_light.NAMES)
APPLY = passes.fullscreen_program(
    "subsurface apply",
    "subsurface/apply.frag.glsl",
    textures=tuple(("RGBA32F", name) for name in ("surface_diffuse", "scatter_share", *LEFT, *WALKED)),
    outputs=(("VEC4", "out_direct"), ("VEC4", "out_indirect"), ("VEC4", "out_walked")),
)
INDIRECT = passes.fullscreen_program(
    "subsurface indirect",
    "subsurface/indirect.frag.glsl",
    textures=(*GATHER_TEXTURES, *POINT_TEXTURES),
    blocks=PATH_BLOCKS,
    constants=(*(one for one in GATHER_CONSTANTS if one not in LOBE_CONSTANTS), ("INT", "rays")),
    outputs=(("VEC4", "out_indirect"),),
)
CHORD = passes.fullscreen_program(
    "subsurface chord",
    "subsurface/chord.frag.glsl",
    textures=(
        *RAYS.textures, *POINT_TEXTURES, ("RG32F", "trace_owners"),
        *(("RGBA32F", name) for name in (
            "point_curve", "point_instances", "scatter_objects", "scatter_near", "scatter_means",
        )),
    ),
    blocks=((VIEW, "film_view"),),
    constants=(*RAYS.constants, ("FLOAT", "longest"), ("INT", "first_object"), ("INT", "first_leaf")),
    defines=(("RANGE", str(RANGE)),),
    outputs=(("VEC4", "out_shape"),),
)  # fmt: skip
# Of programs that follow rays of points through glass; ImageSpaceSubsurface._followed binds it.
FOLLOWED_TEXTURES = (
    *acceleration.HIERARCHY_TEXTURES,
    *POINT_TEXTURES[:2],
    ("RG32F", "trace_owners"),
    *(("RGBA32F", name) for name in ("point_instances", "glass_indices", "scatter_near")),
)
COAT = passes.fullscreen_program(
    "subsurface coat",
    "subsurface/coat.frag.glsl",
    textures=(*FOLLOWED_TEXTURES, ("RGBA32F", "scatter_means"), ("RGBA32F", "scatter_objects")),
    blocks=((VIEW, "film_view"),),
    constants=(("FLOAT", "offset_size"), ("INT", "bounces"), ("INT", "first_object"), ("INT", "first_leaf")),
    outputs=tuple(("VEC4", f"out_{name}") for name in ("coat", "bent", "again", "landed")),
)
EXIT = passes.fullscreen_program(
    "where rays leave glass",
    "subsurface/exit.frag.glsl",
    textures=(*FOLLOWED_TEXTURES, *POINT_TEXTURES[2:], ("RGBA32F", "cell_coat"), ("RGBA32F", "cell_bent")),
    blocks=((VIEW, "film_view"),),
    constants=(("FLOAT", "offset_size"), ("INT", "first_leaf"), ("INT", "exits")),
    outputs=tuple(("VEC4", f"out_{name}") for name in ("position", "normal", "entry", "instance")),
)
ENTER = passes.fullscreen_program(
    "light that enters in glass",
    "subsurface/enter.frag.glsl",
    textures=tuple(
        ("RGBA32F", name) for name in ("cell_direct", "cell_across", "cell_around", "cell_bent", "point_entry")
    ),
    constants=(("INT", "blocks"), ("INT", "exits")),
    outputs=(("VEC4", "out_direct"),),
)
EXITS, LATER_EXITS = 16, 4  # rays of a point that may leave its glass, in a picture's first sample and in others
LOBE = 64.0  # power of the cosine about these that light counts by, in the first sample; in sample n by its root more
ECHOES = 4  # times that light which glass mirrors back is followed to where it enters
ECHO = passes.fullscreen_program(
    "light that glass mirrors back",
    "subsurface/echo.frag.glsl",
    textures=tuple(("RGBA32F", name) for name in ("cell_direct", "cell_entered", "cell_again", "cell_landed")),
    constants=(("INT", "first"), ("INT", "left")),
    outputs=(("VEC4", "out_direct"),),
)
LIGHT = ("radiance.diffuse_direct", "radiance.diffuse_indirect")
PROFILES, SPLATS = "PROFILES", "SPLATS"


def _index_of(material: CompiledMaterial) -> float:
    """Index of refraction of what is clear glass and nothing else; 0 of other materials."""
    glass = material.glass
    return glass.ior if glass is not None and glass.share > ALONE and glass.ior > 1.0 else 0.0


class ImageSpaceSubsurface(Technique):
    name = "image_space_subsurface"
    label = "Image-space subsurface"
    fills = ("subsurface",)
    params = (
        Param(
            "form", "Form", PROFILES,
            "How light below the surface is summed: by Blender's methods, or by the dipole as in the source",
            items=(
                (PROFILES, "Profiles and Walks", 0, "Pixels, points of the mesh and random walks: as Cycles"),
                (SPLATS, "Dipole Splats", 1, "Squares from each lamp's view, weighted by the dipole (Shah 2007)"),
            ),
        ),
        Param(
            "grid", "Splat Grid", 64,
            "With Dipole Splats: texels along each side of a lamp's view of the objects",
            8, 1024, draft=32,
        ),
        Param(
            "points", "Points", 4096,
            "Maximum number of points that are lit in each sample, on all objects with subsurface scattering",
            64, 65536, draft=512,
        ),
        Param(
            "taps", "Taps", 24,
            "Neighbouring pixels from which each pixel gathers scattered light in a sample",
            1, 256,
        ),
        Param(
            translucency.BLUR, "Blur Map", "",
            "Painted image: how far light spreads below the surface. 0.5: the material's radius, 1: eight times as "
            "far, 0: an eighth",
            scope=MATERIAL, image=True,
        ),
        Param(
            translucency.TINT, "Tint Map", "",
            "Painted image: colour of the light that enters the surface here",
            scope=MATERIAL, image=True,
        ),
        Param(
            translucency.TRANSLUCENCY, "Translucency Map", "",
            "Painted image: where light scatters below the surface; black: plain diffuse",
            scope=MATERIAL, image=True,
        ),
    )  # fmt: skip
    reads = SURFACES
    finishes = LIGHT
    requests = (GatherBindings,)
    owns = (SUBSURFACE,)
    writes = (
        Write(IMAGES[0], "RGBA32F", "How far light spreads below the surface, m; the albedo that says how"),
        Write(IMAGES[1], "RGBA32F", "Share of the diffuse albedo that does; the object"),
        Write(IMAGES[2], "RGBA32F", "Painted: tint of the light that enters; how translucent the surface is"),
        Write(IMAGES[3], "RGBA32F", "Interface that the view's ray enters by: roughness squared, index of refraction"),
        Write(CHOICE, "RGBA32F", "Which part of the light from below the surface walks find: black none, white all"),
        *(Write(name, "RGBA32F", "What left the surface takes the place of what entered", True) for name in LIGHT),
    )

    def __init__(self):
        self.points = ScatterPoints()
        self._light = PointLight("subsurface")
        self._splats = Splats()
        self._lobes: images.Image | None = None
        self._white: dict[tuple[int, int], tuple[images.Image, images.Image]] = {}
        self._whole: list[images.Target] = []  # sums of profiles over points, before this sample and after it
        self._shapes: images.Image | None = None  # of cells: normal, depth, mean length of lines through
        # Of cells, where anything is glass: by how much more light enters, how by the cosine at which it arrives, how
        # much of what leaves comes back, and from which cells.
        self._coats: tuple[images.Image, ...] = ()
        # Of refraction, by material; and by instance whether glass may be around.
        self._indices: images.Image | None = None
        self._around: images.Target | None = None  # light by way of glass, added up over a picture
        self._arounds = self._exits = 0  # samples, and rays of a point, that this is of
        self._coated: set[int] = set()  # materials of what glass may be around
        self._direct: tuple[int, images.Image] | None = None  # of points, with the sample
        self._leaving, self._leaving_sample = LeavingLight(), -1
        self._leaves: tuple[int, ...] = ()  # materials whose light is listed there
        self._met: tuple[int, ...] | None = None  # what the rays of these have met

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        shown = snapshot.used_materials
        if not any(may_scatter(snapshot.materials[material].graph) for material in shown):
            return "no material scatters light below its surface"
        return acceleration.too_many_copies(snapshot)

    def programs(self, snapshot: Snapshot, settings: Settings) -> tuple[Program, ...]:
        form = (
            splatted_light.PROGRAMS if self._splatted(settings, snapshot) else (GATHER, APPLY, *walked_light.PROGRAMS)
        )
        in_glass = (COAT, EXIT, ENTER, ECHO, LIGHTING_WITH_WAYS, LIGHTING_IN_LOBES)
        return CHORD, *in_glass, LIGHTING, *form, *leaving_light.PROGRAMS

    def _splatted(self, settings: Settings, snapshot: Snapshot) -> bool:
        """Whether light is summed by splats: not for panoramic cameras, whose lines are bent."""
        return settings.get(self, "form") == SPLATS and bends_lines(snapshot) is None

    def sample(self, frame: Frame) -> Iterator[None]:
        if not self._materials or frame.receivers is None or not len(frame.receivers.distance):
            frame.target(*IMAGES).clear()
            frame.target(CHOICE).clear()
            return
        # Light at other points of the film is taken from pixels: repeated, it would be light that enters there.
        repeated_light.forbid(frame)
        draw_scatter(frame, self, frame.target(*IMAGES), self.points.table, self._materials)
        if self._splatted(frame.settings, frame.snapshot):
            frame.target(CHOICE).clear()
            yield
            self._splats.draw(frame, self, self.points, self._light)
            self._direct = None
            return
        lit = self._lit_points(frame) if self.points.rows else None
        self._direct = None
        yield
        yield from self._gather(frame, lit)
        for image in lit or ():
            images.pool.give(image)

    def begin(self, frame: Frame) -> None:
        self._materials = {k for k, material in enumerate(frame.materials.compiled) if material.scatter > 0.0}
        if not self._materials:
            return
        moved = self.points.update(frame, frame.settings.get(self, "points"))
        means = frame.kept(ScatterMeans)
        means.update(frame, self._materials)
        # What stands inside an object makes it thinner, too.
        met = frame.geometry.changes, frame.hierarchy("shadow").leaves.number, means.drawings, frame.settings.bounces
        if moved or met != self._met:
            self._measure(frame)
            self._met = met
        if self._lobes is None:
            self._lobes = images.upload(diffusion.table())
        self._give_whole()
        self._give_around()
        self._light.begin(frame)
        if self._splatted(frame.settings, frame.snapshot):
            self._splats.begin(frame, self.points, self._materials, frame.settings.get(self, "grid"))
        else:
            self._whole = [images.Target((images.pool.take(*frame.size, "RGBA32F"),)) for _ in range(2)]
            self._whole[0].clear()
            if frame.settings.get(self, "form") == SPLATS:
                frame.account.chose(self, "form", f"{PROFILES}, because {bends_lines(frame.snapshot)}")
        self._leaving_sample, self._direct = -1, None
        self._leaving.begin()
        # In glass, which shows them without pixels around, other methods are known from points, too.
        graphs = frame.snapshot.materials
        walked = tuple(k for k in sorted(self._materials) if k in self._coated or may_walk(graphs[k].graph))
        if walked and self.points.rows:
            if moved or walked != self._leaves or self._leaving.image is None:
                self._leaving.update(self.points, walked)
                self._leaves = walked
            frame.provide(LeavingService(lambda: self._leaving_image(frame)))
        frame.count(self, "points", self.points.rows * ROW)
        frame.count(self, "objects", len(self.points.objects))

    def _measure(self, frame: Frame) -> None:
        """How thick objects are at their points, and how much of Burley's profile contours add."""
        self._give_shapes()
        if not self.points.rows:
            return
        self._shapes = images.pool.take(ROW, self.points.rows, "RGBA32F")
        position, normal = self.points.surface(0)
        textures, constants = ray_bindings(frame)
        owners, first_leaf = frame.kept(Hits).owners(frame, frame.hierarchy("shadow"))
        passes.fullscreen(
            CHORD, images.Target((self._shapes,)),
            textures={
                **textures, "point_position": position, "point_normal": normal, "point_entry": self.points.entries(0),
                "point_curve": self.points.curves, "point_instances": self.points.instances, "trace_owners": owners,
                "scatter_objects": self.points.table, "scatter_near": self.points.near,
                "scatter_means": frame.kept(ScatterMeans).image,
            },
            blocks={"film_view": frame.view_block},
            constants={
                **constants, "longest": 2.0 * frame.geometry.size, "first_object": self.points.first_object,
                "first_leaf": first_leaf,
            },
        )  # fmt: skip
        self._measure_coat(frame)

    def _in_glass(self, frame: Frame, glass: set[int]) -> np.ndarray:
        """Rows of the placed instances that scatter and whose boxes overlap that of one with any material of `glass`,
        as numbers (K,)."""
        placed = frame.geometry.placed[0]
        kinds = {slots: [not some.isdisjoint(slots) for some in (self._materials, glass)]
                 for slots in {one.materials for one in placed}}  # fmt: skip
        inside, around = (
            np.flatnonzero(one) for one in np.reshape([kinds[one.materials] for one in placed], (-1, 2)).T
        )
        low, high = frame.geometry.instance_bounds
        for _ in range(2):  # what all of the others together may meet
            if len(inside) and len(around):
                least, most = low[around].min(axis=0), high[around].max(axis=0)
                inside = inside[((low[inside] < most) & (least < high[inside])).all(axis=1)]
            inside, around = around, inside
        found, at_once = np.zeros(len(inside), bool), max(PAIRS // max(len(inside), 1), 1)
        for first in range(0, len(around), at_once):
            some = around[first : first + at_once, None]
            found |= ((low[inside] < high[some]) & (low[some] < high[inside])).all(axis=2).any(axis=0)
        return inside[found]

    def _measure_coat(self, frame: Frame) -> None:
        """What clear glass around points changes of the light that enters there."""
        indices = np.array([_index_of(one) for one in frame.measured_materials], np.float32)
        rows = self._in_glass(frame, {*np.flatnonzero(indices).tolist()}) if indices.any() else ()
        if not len(rows):
            return
        placed = frame.geometry.placed[0]
        self._coated = {slot for row in rows for slot in placed[row].materials}
        listed = np.zeros((max(len(indices), len(placed)), 4), np.float32)
        listed[: len(indices), 0], listed[rows, 1] = indices, 1.0
        self._coats = tuple(images.pool.take(ROW, self.points.rows, "RGBA32F") for _ in COAT.outputs)
        self._indices = images.upload_list(listed)
        textures, constants = self._followed(frame, *self.points.surface(0))
        passes.fullscreen(
            COAT, images.Target(self._coats),
            textures={
                **textures, "scatter_objects": self.points.table, "scatter_means": frame.kept(ScatterMeans).image,
            },
            blocks={"film_view": frame.view_block},
            constants={
                **constants, "bounces": frame.settings.bounces, "first_object": self.points.first_object,
            },
        )  # fmt: skip

    def _followed(self, frame: Frame, position: images.Image, normal: images.Image) -> tuple[dict, dict]:
        """Textures and constants by which rays of points are followed through glass."""
        hierarchy = frame.hierarchy("shadow")
        owners, first_leaf = frame.kept(Hits).owners(frame, hierarchy)
        textures = {
            **hierarchy.textures, "point_position": position, "point_normal": normal, "trace_owners": owners,
            "point_instances": self.points.instances, "glass_indices": self._indices, "scatter_near": self.points.near,
        }  # fmt: skip
        return textures, {"offset_size": frame.offset_size, "first_leaf": first_leaf}

    # Light at points of the mesh --------------------------------------------------------------------------------------

    def _lit_points(self, frame: Frame) -> tuple[images.Image, images.Image]:
        """Direct and indirect light of this sample at the points, as surfaces of the painted tint there reflect it."""
        direct = self._directly_lit(frame)
        indirect = images.pool.take(*direct.size, "RGBA32F")
        self._light_indirectly(frame, *self.points.surface(frame.sample), indirect)
        if self._coats:
            target = images.Target((indirect,))
            passes.fullscreen(passes.COPY, target, blend="MULTIPLY", textures={"original": self._coats[0]})
        return direct, indirect

    def _directly_lit(self, frame: Frame) -> images.Image:
        """Direct light of this sample at the points; `_direct` keeps it until the sample's end."""
        if self._direct is not None and self._direct[0] == frame.sample:
            return self._direct[1]
        size = (ROW, self.points.rows)
        direct, *others = (images.pool.take(*size, "RGBA32F") for _ in range(3 if self._coats else 2))
        position, normal = self.points.surface(frame.sample)
        target = images.Target((direct, *others))
        target.clear()
        tint = self.points.entries(frame.sample)
        drawn, rays = self._light_on(frame, position, normal, tint, target, self.points.instances)
        frame.count(self, "passes", drawn)
        if self._coats:
            _, bent, again, landed = self._coats
            rays += self._light_by_way_of_glass(frame, position, normal, tint)
            passes.fullscreen(
                ENTER, images.Target((others[-1],)),
                textures={
                    "cell_direct": direct, "cell_across": others[0], "cell_around": self._around.colors[0],
                    "cell_bent": bent, "point_entry": tint,
                },
                constants={"blocks": EXITS, "exits": self._exits},
            )  # fmt: skip
            entering, pair = others[-1], (direct, others[0])
            entered, echoes = entering, min(ECHOES, frame.settings.bounces)
            for k in range(echoes):
                passes.fullscreen(
                    ECHO, images.Target((pair[k & 1],)),
                    textures={
                        "cell_direct": entering, "cell_entered": entered, "cell_again": again, "cell_landed": landed,
                    },
                    constants={"first": int(k == 0), "left": frame.settings.bounces - echoes},
                )  # fmt: skip
                entered = pair[k & 1]
            direct, others = entered, [one for one in (entering, *pair) if one is not entered]
            frame.count(self, "passes", 1 + echoes)
        for image in others:
            images.pool.give(image)
        frame.count(self, "rays", rays * ROW * self.points.rows)
        self._direct = frame.sample, direct
        return direct

    def _light_on(
        self, frame: Frame, position, normal, tint, target: images.Target, instances: images.Image,
        lobe: float = 0.0,
    ) -> tuple[int, int]:  # fmt: skip
        """Add direct light of this sample on such points; numbers of passes and of rays a point."""
        black = self._constant_images(position.size)[1]
        surfaces = {"position": position, "normal": normal, "diffuse": tint}
        surfaces |= dict.fromkeys(("tint", "lobe", "emission"), black)
        return self._light.add(frame, surfaces, target, instances=instances, lobe=lobe)

    def _light_by_way_of_glass(self, frame: Frame, position, normal, tint) -> int:
        """Add to `_around` what sources send to where rays of each point leave glass; returns rays a point. Few
        of these see a lamp, and walks see what has come so far."""
        size = position.width, EXITS * position.height
        if self._around is None:
            self._around = images.Target(tuple(images.pool.take(*size, "RGBA32F") for _ in range(2)))
            self._around.clear()
            self._arounds = self._exits = 0
        exits = LATER_EXITS if self._arounds else EXITS
        self._arounds += 1
        self._exits += exits
        textures, constants = self._followed(frame, position, normal)
        with ExitStack() as stack:
            found = [stack.enter_context(images.borrowed(*size, "RGBA32F")).colors[0] for _ in EXIT.outputs]
            passes.fullscreen(
                EXIT, images.Target(tuple(found)),
                textures={
                    **textures, "point_entry": tint, "cell_coat": self._coats[0], "cell_bent": self._coats[1],
                },
                blocks={"film_view": frame.view_block},
                constants={**constants, "exits": exits},
            )  # fmt: skip
            drawn, rays = self._light_on(frame, *found[:3], self._around, found[3], LOBE * self._arounds**0.5)
        frame.count(self, "passes", 1 + drawn)
        return exits * rays

    def _give_around(self) -> None:
        for image in () if self._around is None else self._around.colors:
            images.pool.give(image)
        self._around = None

    def _leaving_image(self, frame: Frame) -> images.Image | None:
        """What leaves the points' surfaces in this sample, for others; None where nothing is drawn."""
        if self._leaving_sample != frame.sample:
            direct = self._directly_lit(frame)
            drawn = self._leaving.draw(
                frame, self.points,
                {
                    "cell_direct": direct, "cell_shapes": self._shapes, "walk_lobes": self._lobes,
                    "scatter_means": frame.kept(ScatterMeans).image,
                    "cell_coat": self._coats[0] if self._coats else self._shapes,  # not read without a coat
                },
                coated=bool(self._coats),
            )  # fmt: skip
            self._leaving_sample = frame.sample
            frame.count(self, "passes", drawn)
        return self._leaving.image

    def _light_indirectly(self, frame: Frame, position, normal, indirect: images.Image) -> None:
        target = images.Target((indirect,))
        provided = frame.service(GatherBindings)
        if provided is None:
            target.clear()
            return
        offered = provided.bindings
        textures = {name: offered["textures"][name] for _, name in GATHER_TEXTURES}
        program = asked(frame, INDIRECT, textures)
        names = {name for kind, name in GATHER_CONSTANTS if (kind, name) not in LOBE_CONSTANTS}
        passes.fullscreen(
            program, target,
            textures={
                **textures, "point_position": position, "point_normal": normal,
                "point_entry": self.points.entries(frame.sample),
            },
            blocks=offered["blocks"],
            constants={**{name: offered["constants"][name] for name in names}, "rays": RAYS_INDIRECT},
        )  # fmt: skip
        frame.count(self, "passes")

    def _constant_images(self, size: tuple[int, int]) -> tuple[images.Image, images.Image]:
        """A white image and a black one."""
        if size not in self._white:
            self._give_white()
            made = tuple(images.pool.take(*size, "RGBA32F") for _ in range(2))
            images.Target(made[:1]).clear((1.0, 1.0, 1.0, 0.0))
            images.Target(made[1:]).clear()
            self._white[size] = made
        return self._white[size]

    # Light at pixels --------------------------------------------------------------------------------------------------

    def _gather(self, frame: Frame, lit: tuple[images.Image, images.Image] | None) -> Iterator[None]:
        shown = frame.images
        nothing = self._constant_images((1, 1))[1] if lit is None else None
        walked = [images.pool.take(*(frame.size if lit else (1, 1)), "RGBA32F") for _ in WALKED]
        if lit is None:
            images.Target(tuple(walked)).clear()
        else:
            found = {"cell_direct": lit[0], "cell_indirect": lit[1], "cell_shapes": self._shapes}
            yield from walked_light.walk(frame, self, self.points, found, self._lobes, walked)
            frame.count(self, "passes", 2)
        yield
        points = {
            "cells": self.points.cells[frame.sample % len(self.points.cells)] if lit else nothing,
            "cell_direct": lit[0] if lit else nothing,
            "cell_indirect": lit[1] if lit else nothing,
            "walked_near": walked[-1],
            "cell_shapes": self._shapes if lit else nothing,
            "scatter_objects": self.points.table,
            "walk_lobes": self._lobes,
        }
        picture = (
            shown["surface.position"], shown["surface.normal"], shown["surface.diffuse"], shown[IMAGES[0]],
            shown[IMAGES[1]], shown[IMAGES[2]], shown[LIGHT[0]], shown[LIGHT[1]],
        )  # fmt: skip
        left = [images.pool.take(*frame.size, "RGBA32F") for _ in LEFT]
        before, after = self._whole
        target = images.Target((*left[:2], after.colors[0], *left[2:]))
        for rows in frame.bands(self):
            passes.fullscreen(
                GATHER, target, rows=rows,
                textures={**dict(zip(PICTURE, picture)), **points, "whole_before": before.colors[0]},
                blocks={"film_view": frame.view_block},
                constants={
                    "first_object": self.points.first_object, "taps": frame.settings.get(self, "taps"),
                    "points_lit": int(lit is not None),
                },
            )  # fmt: skip
            yield
        frame.target(CHOICE).clear()
        passes.fullscreen(
            APPLY, frame.target(*LIGHT, CHOICE),
            textures={
                "surface_diffuse": shown["surface.diffuse"], "scatter_share": shown[IMAGES[1]],
                **dict(zip(LEFT, left)), **dict(zip(WALKED, walked)),
            },
        )  # fmt: skip
        for image in (*left, *walked):
            images.pool.give(image)
        self._whole = [after, before]
        frame.count(self, "passes", 2)

    def _give_shapes(self) -> None:
        for image in (self._shapes, *self._coats):
            if image is not None:
                images.pool.give(image)
        self._shapes, self._coats, self._indices = None, (), None
        self._coated = set()

    def _give_whole(self) -> None:
        for target in self._whole:
            images.pool.give(target.colors[0])
        self._whole = []

    def _give_white(self) -> None:
        for made in self._white.values():
            for image in made:
                images.pool.give(image)
        self._white = {}

    def release(self) -> None:
        self.points.release()
        self._light.release()
        self._splats.release()
        self._give_whole()
        self._give_around()
        self._give_white()
        self._give_shapes()
        self._leaving.release()
        self._lobes = self._met = self._direct = None
