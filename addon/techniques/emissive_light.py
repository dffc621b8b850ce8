"""Emissive light: meshes whose material emits, as light sources of other surfaces.

Points on emissive triangles are drawn half by power and half by area, a few per sample (in pictures of few
samples so many that the picture has FEWEST_POINTS), each with depth maps. All are of one low-discrepancy set:

    L(x, v) = mean over samples of  f(x, v, w) cos(w) Le |cos_y| V(x, y) / (|x - y|^2 p(y)),
    p(y) = (lum(Le) + mean of lum) / (2 power)

As in Cycles, emission leaves both sides of a surface; of a closed convex mesh that nobody looks into the outside
counts. Narrow lobes find emissive triangles by their own rays (traced_glossy), weighted against these points.

| cost | per sample |
|---|---|
| maps | `points` x (1 view, or up to 6 cube faces), or a ray per pixel for each where that costs less |
| passes | 1 over the screen |

Close to the meshes points that all pixels share would be seen as blotches. So each of them shines as from no nearer
than about five times the way to its neighbours in the picture,

    L_shared = f cos |cos_y| Le / max(r^2, r_0^2),   r_0^2 = SPREAD median(d_k^2 p_k) / p,   d_k from point to point

and what this leaves out close by each pixel adds by points of its own: it draws eight for a ray and keeps one by what
it brings (light/mesh_rays.glsl). Where half of what is lit is as near as the meshes are large, all light comes so.
These points stand for a part of the mesh each, too, and count as no nearer than that is wide: what they leave out, of a
tube before its board, a short ray of each pixel finds (light/close_by.frag.glsl).

Emission that varies is measured place by place (scene/emission_maps.py).

Fails: very many small emitters need many samples. What short rays find lights diffuse closures alone; others have it
in mirrors and along paths.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.technique import Param, Technique
from ..gfx import images, passes
from ..lighting import depth_maps, repeated_light
from ..lighting.asked import asked
from ..lighting.caustic_casters import meshes_answered
from ..lighting.emissive_triangles import EmissiveTriangles
from ..lighting.light_rates import EmissivePoints
from ..lighting.loop import DIRECT_WRITES, OUTPUTS, light_surfaces, lighting
from ..lighting.repeated_light import Lit
from ..lighting.visibility import (
    NO_VIEWS,
    RAY_CONSTANTS,
    RESOLUTION,
    LightPoint,
    Lookup,
    Maps,
    PlainMaps,
    Rays,
    ShadowLinks,
    VisibilityProvider,
    by_rays,
    glass_absorbs,
    map_resolution,
    ray_bindings,
)
from ..materials.compiler import may_emit, may_reflect
from ..scene import acceleration
from ..scene.view import VIEW
from ..snapshot.scene import Snapshot
from ..sources import lights
from ..surfaces.draw import ANY_SURFACE, LIT_SURFACES, SURFACE_TEXTURES

SPREAD = 25.0
FEWEST_POINTS = 32  # in a whole picture
MOST_RAYS = 4  # of a pixel in a sample, where it has points of its own, each for several of those


OWN_CANDIDATES = 8  # points of which a pixel keeps one
MESH_RAYS = Lookup(
    "mesh rays",
    "light/mesh_rays.glsl",
    textures=(*acceleration.HIERARCHY_TEXTURES, ("RGBA32F", "mesh_lights")),
    constants=(
        *RAY_CONSTANTS,
        ("VEC3", "near_low"),
        ("INT", "mesh_light_count"),
        ("VEC3", "near_high"),
        ("FLOAT", "mesh_light_power"),
        ("FLOAT", "mesh_light_level"),
        ("FLOAT", "mesh_light_least"),
    ),
    defines=(("OWN_POINTS", "1"), ("CANDIDATE_POINTS", str(OWN_CANDIDATES))),
    maps=False,
)
LIGHTING = lighting(MESH_RAYS, False)
CLOSE_BY = passes.fullscreen_program(
    "emissive surfaces close by",
    "light/close_by.frag.glsl",
    textures=(*acceleration.HIERARCHY_TEXTURES, *SURFACE_TEXTURES, ("RGBA32F", "energy_table")),
    blocks=((VIEW, "film_view"), (lights.SOURCES, "sources")),
    constants=(
        *RAY_CONSTANTS,
        ("FLOAT", "close_reach"),
        ("FLOAT", "drawn_least"),
        ("FLOAT", "mesh_light_level"),
        ("INT", "glass_blocks"),
    ),
    outputs=OUTPUTS,
    leaves_out=(("links", "of meshes that links leave out pixels draw no points of their own"),),
)


class EmissiveLight(Technique):
    name = "emissive_light"
    label = "Emissive surfaces"
    params = (
        Param("points", "Points", 4, "Points on emissive surfaces in each sample", 1, 64),
        replace(RESOLUTION, default=1.0),
    )
    reads = LIT_SURFACES
    writes = DIRECT_WRITES
    provides = (EmissivePoints,)
    requests = (VisibilityProvider,)

    def __init__(self):
        self._maps, self._rays = PlainMaps(self._resolution), Rays()
        self._sources = lights.Sources()
        self._triangles: EmissiveTriangles | None = None
        self._own: images.Image | None = None  # its triangles, where pixels have points of their own
        self._left_out = 0.0  # of shared points: least squared distance, m2, times what they are drawn in proportion to
        self._beside: tuple[np.ndarray, np.ndarray] | None = None  # the box in which they do; None: everywhere
        self._traced: bool | None = None  # whether rays take the place of maps; None: not decided yet

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        graphs = [snapshot.materials[slot].graph for slot in snapshot.used_materials]
        if not any(map(may_emit, graphs)):
            return "no material emits light"
        if not any(map(may_reflect, graphs)):
            return "no material reflects light"
        return None

    def begin(self, frame: Frame) -> None:
        self._traced = None
        self._own = self._beside = None
        if frame.receivers is None or not len(frame.receivers.distance):
            return
        self._triangles = EmissiveTriangles(frame, ("diffuse", "glossy"))
        self._choose_own(frame)
        frame.provide(EmissivePoints(self._triangles.power, float(self._count(frame.settings))))

    def sample(self, frame: Frame) -> Iterator[None]:
        if frame.receivers is None or not len(frame.receivers.distance):
            return
        count = self._count(frame.settings)
        if not self._triangles.power > 0:
            return
        resolution = self._resolution(frame)
        blocked = meshes_answered(frame)
        flags = lights.SHADOW_FLAG + lights.TRACED_FLAG + lights.GLASS_BLOCKS_FLAG * blocked
        provider = frame.service(VisibilityProvider)
        patches = provider is not None and provider.serves_every_source(frame)
        if self._own is not None:
            own = self._triangles.row((0.5, 0.5, 0.5), count, flags, 1, OWN_CANDIDATES * frame.settings.samples)
            points = [LightPoint(own, self._rays)] * count
            yield from light_surfaces(
                frame, self, points, 1 << lights.SURFACE, self._sources, lambda *_: self._own_rays(frame)
            )
            close_by = bool(self._triangles.flags[0] & lights.DIFFUSE_FLAG)  # the same of all
            if close_by:
                least = float(own[lights.LIGHT.at.footprint]) * self._triangles.power / count
                yield from self._close_by(frame, least, blocked)
            frame.account.count(self, "rays per pixel", count + close_by)
            if self._beside is None:
                return
        points = []
        for k in range(count):
            number = frame.sample * count + k
            numbers = frame.random_volume("emissive", number)
            triangle, point, _ = self._triangles.draw(*numbers)
            linked = frame.shared(ShadowLinks).of(frame, self._triangles.passing[triangle])
            if linked:
                row = self._triangles.row(numbers, count, flags, True, frame.settings.samples)
                points.append(LightPoint(row, linked))
                continue
            if patches:
                points.append(self._patch(frame, provider, numbers, number, count, flags))
                continue
            if self._traced is None:  # by the picture's first point that asks no other
                self._traced = by_rays(
                    frame, lambda place=point: _views(frame, place, 0, resolution), resolution, self, "emissive meshes",
                    glass_absorbs(frame) and not blocked,
                )  # fmt: skip
            views = [] if self._traced else _views(frame, point, number, resolution)
            views = [replace(view, glass_blocks=True) for view in views] if blocked else views
            row = self._triangles.row(numbers, count, flags, len(views) or self._traced, frame.settings.samples)
            points.append(LightPoint(row, self._rays if self._traced else self._maps, views))
        if self._own is not None:
            spread = self._left_out * count / self._triangles.power
            for point in points:
                point.row[lights.LIGHT.at.footprint] = spread
        yield from light_surfaces(frame, self, points, 1 << lights.SURFACE, self._sources)

    def _choose_own(self, frame: Frame) -> None:
        """Whether pixels draw points of their own, and where."""
        provider = frame.service(VisibilityProvider)
        patches = provider is not None and provider.serves_every_source(frame)
        if patches or frame.settings.schedule.is_draft or not frame.snapshot.casts_shadows:
            return
        if not self._triangles.may_be_own or frame.hierarchy("shadow") is None:
            return

        # Maps ask the material of a layer itself, rays know it by cells: those alone that add what maps leave out.
        if not self._triangles.near or any(material.uneven for material in frame.materials.compiled):
            count = self._count(frame.settings) * frame.settings.samples
            self._left_out = SPREAD * self._triangles.spacing(count)
            self._beside = self._triangles.beside(self._left_out)
            if self._beside is None:
                return
        said = "of each pixel's own, because surfaces stand close to emissive meshes"
        frame.account.chose(self, "points", said if self._beside is None else f"{said}; farther off the picture's")
        self._own = images.upload_list(self._triangles.texels())

    def _own_rays(self, frame: Frame) -> Maps:
        textures, constants = ray_bindings(frame)
        low, high = (np.zeros(3),) * 2 if self._beside is None else self._beside
        return Maps(
            None, NO_VIEWS, MESH_RAYS, textures={**textures, "mesh_lights": self._own},
            constants={
                **constants, "mesh_light_count": len(self._triangles.radiance),
                "mesh_light_power": self._triangles.power, "mesh_light_level": self._triangles.level,
                "mesh_light_least": 0.0 if self._beside is None else self._left_out,
                "near_low": low, "near_high": high,
            },
        )  # fmt: skip

    def _close_by(self, frame: Frame, least: float, glass_blocks: bool) -> Iterator[None]:
        """Add the diffuse light that points leave out within the root of `least`, W / sr, over what they are drawn in
        proportion to. Rays are those of diffuse paths: they meet the meshes that light diffuse surfaces, whether or not
        those cast shadows. `glass_blocks`: photons bring what passes glass."""
        constants = {
            "close_reach": self._triangles.reach_of(least), "drawn_least": least,
            "mesh_light_level": self._triangles.level,
            "glass_blocks": int(glass_blocks), "offset_size": frame.offset_size,
        }  # fmt: skip
        textures = {"energy_table": frame.materials.energy_table, **frame.hierarchy("diffuse").textures}
        program = asked(frame, CLOSE_BY, textures)
        lit = Lit(program, ANY_SURFACE, {"textures": textures, "blocks": {}, "constants": constants}, [])
        yield from repeated_light.add(frame, self, self._sources, lit)

    def _resolution(self, frame: Frame) -> int:
        return map_resolution(frame, frame.settings.get(self, "texels_per_pixel"))

    def _patch(
        self, frame: Frame, provider: VisibilityProvider, numbers, number: int, count: int, flags: int
    ) -> LightPoint:
        """A disc of the emissive surface around a point: the area that the picture's points leave to this one."""
        k, point, density = self._triangles.draw(*numbers)
        points = count * frame.settings.samples if frame.settings.schedule.known_total else number + 1
        radius = float(np.sqrt(1.0 / (np.pi * density * points)))
        normal, zero = self._triangles.normal[k], np.zeros(3)
        disc = lights.Emitter(
            None, lights.SURFACE, flags, point, radius, self._triangles.radiance[k], 1.0 / density, normal, 0.0,
            zero, zero, zero,
        )  # fmt: skip
        views = provider.views(frame, disc, point, number, 1.0)
        row = self._triangles.row(numbers, count, flags, len(views), frame.settings.samples)
        across = np.cross(normal, (1.0, 0.0, 0.0) if abs(normal[0]) < 0.9 else (0.0, 1.0, 0.0))
        across *= radius / max(float(np.linalg.norm(across)), 1e-30)
        row[lights.LIGHT.at.u], row[lights.LIGHT.at.v] = across, np.cross(normal, across)
        return LightPoint(row, provider, views)

    def _count(self, settings: Settings) -> int:
        """Points per sample: more where a picture of few samples would have few in all."""
        points = settings.get(self, "points")
        if self._own is not None and self._beside is None:  # a ray of each stands for several points
            return max(points // 2, min(FEWEST_POINTS // 2 // settings.samples, MOST_RAYS))
        return max(points, FEWEST_POINTS // settings.samples) if settings.schedule.known_total else points

    def release(self) -> None:
        self._maps.release()
        self._sources.release()
        self._triangles = self._own = self._beside = None


def _views(frame: Frame, point: np.ndarray, number: int, resolution: int) -> list[depth_maps.MapView]:
    """Of the map of a point, which is the picture's point `number`."""
    jitter = (*frame.random("map/emissive", number), *frame.random("map/emissive/turn", number))
    return depth_maps.point_views(point, None, np.inf, frame.receivers, frame.geometry, jitter, resolution)
