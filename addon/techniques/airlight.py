"""Airlight: light of lamps, the world and emissive meshes that media scatter towards the camera, with shadows.

    L(v) = integral over the view ray of  T(eye, x) sum over lights of  sigma_s(x) p(x, w, v) T(x, y) V(x, y) L(y) dw

A row of lights is a point of this sample on each of them, shared by all pixels; each row takes some places x on each
pixel's ray. Half of the places are drawn around the point, in equal steps of the angle under which it sees the ray
(equiangular sampling, Kulla & Fajardo 2012), half in proportion to transmittance times scattering, both weighted by the
balance heuristic: the first ends the singularity at a lamp in fog and keeps to a spot's cone, the second serves dense
media. V are rays of the hierarchy, T is that of media.py. What media emit is integrated in closed form.

Pictures of few samples take many places at a quarter of the pixels, whose numbers are dithered over 4 x 4 of them, and
spread their light, divided by what lamps would send without shadows, to pixels whose rays end equally far away.
Others take a quarter as many at every pixel, and converge. Light of several bounces, and light that media bring to
surfaces, is found by walks (lighting/media_bounces.py).

| cost | per sample |
|---|---|
| passes | 1, and 2 at full size where it is spread, and those of walks |
| rays | `rays` per pixel (4 times as many in a quarter of the pixels), shared by all lights |
| memory | 3 images; 1 and 2 of a quarter where it is spread |

Sources: Kulla & Fajardo 2012; Veach & Guibas 1995 (balance heuristic). In mirrors and behind glass
(shaded_reflections.py) rays of lobes ask the same of the way to what they meet, a pass more for each round of them, and
where light scatters more often another one.

Bias: below FEW samples shafts are as wide as four pixels at least. Penumbrae of round lamps where walks end are those
of points in a ball. Phase functions mixed at one place are one of their mean anisotropy. Gloss that no rays follow (all
of it in drafts) gets light of media as if from all sides alike. Mirrors and glass show no beams; surfaces that those
show get no light from media. Of a ray that crosses more than twelve boundaries only the nearest twelve are known.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np

from ..frame.light_paths import LIGHT_SPECULAR_MEDIUM
from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.technique import Param, Technique, Write
from ..gfx import images, passes
from ..gfx.library import Program
from ..lighting.emissive_triangles import EmissiveTriangles
from ..lighting.media import RAY_TEXTURES, LightOfMedia, MediaEmission, MediaService, Rays, is_endless
from ..lighting.media_bounces import CONSTANTS, LIT_TEXTURES, WORLD_TEXTURES, Lit, MediaBounces, defines_of
from ..materials.compiler import may_emit, may_tint
from ..materials.graph import Graph
from ..scene import acceleration
from ..scene.media import ATTENUATION_TEXTURES, MEDIA_TEXTURES, has_media
from ..scene.view import VIEW
from ..snapshot.scene import Snapshot
from ..sources import lights
from ..sources.environment import WORLD
from ..surfaces import seen_layers
from ..surfaces.draw import SURFACES
from ..surfaces.seen_layers import SeenLayers

FEW = 8  # samples: below, light of media is found at a quarter of the pixels
COARSE = 2  # pixels of one known pixel's side then
WORLD_DIRECTIONS, EMISSIVE_POINTS = 2, 4  # in a sample
# Below FEW samples, where two are most of what the whole picture gets:
FEW_EMISSIVE_POINTS, FEW_WORLD_DIRECTIONS = 16, 8
AS_IN_CYCLES = -1  # bounces: as the scene has them there
MOST_BOUNCES = 12  # of walks: what is left after them is little in all but the whitest of clouds
MOST_LAMPS = 16  # in a sample
SENDING = (
    "ShaderNodeVolumeScatter",
    "ShaderNodeVolumePrincipled",
    "ShaderNodeVolumeCoefficients",
    "ShaderNodeEmission",
)


@cache
def airlight_program(kinds: int, world: bool) -> Program:
    """Finds the light of media at every so many pixels, for lights of these kinds (bits as in lights.LAMPS).
    `world`: rays by the phase function look for it, too."""
    return passes.fullscreen_program(
        "airlight",
        "media/airlight.frag.glsl",
        textures=(*LIT_TEXTURES, *(WORLD_TEXTURES if world else ()), ("RGBA32F", "surface_position")),
        blocks=((VIEW, "film_view"), (lights.SOURCES, "sources"), *(((WORLD, "world_light"),) if world else ())),
        constants=(*CONSTANTS, ("INT", "places")),
        defines=defines_of(kinds, world),
        outputs=(("VEC4", "out_direct"), ("VEC4", "out_emission")),
    )


@cache
def at_hits_program(kinds: int, world: bool, transmission: bool) -> Program:
    """The same on rays that mirrors and glass send on."""
    seen = airlight_program(kinds, world)
    paths = ("glossy", "transmission") if transmission else ("glossy",)
    return replace(
        seen,
        name="airlight on rays of lobes",
        textures=tuple(dict.fromkeys((*seen.textures, *RAY_TEXTURES, ("RGBA32F", "met_path")))),
        constants=(*seen.constants, ("INT", "ray_number")),
        defines=(*seen.defines, ("AT_HITS", "1"), *((("TRANSMISSION", "1"),) if transmission else ())),
        outputs=tuple(("VEC4", f"out_{path}_{order}") for path in paths for order in ("direct", "indirect")),
    )


GUIDE_TEXTURE = ("RGBA32F", "airlight_guide")


@cache
def guide_program(kinds: int) -> Program:
    """Finds what lamps of these kinds would send without shadows, at every pixel."""
    return passes.fullscreen_program(
        "airlight's guide",
        "media/guide.frag.glsl",
        textures=(*MEDIA_TEXTURES, ("RGBA32F", "surface_position")),
        blocks=((VIEW, "film_view"), (lights.SOURCES, "sources")),
        constants=(("INT", "light_count"), ("INT", "glass_blocks"), ("INT", "hidden_rows")),
        defines=(("LIGHT_KINDS", str(kinds)),),
        outputs=(("VEC4", "out_guide"),),
    )


SPREAD = passes.fullscreen_program(
    "airlight spread, guided",
    "media/spread.frag.glsl",
    textures=(
        ("RGBA32F", "surface_position"), ("RGBA32F", "coarse_direct"), ("RGBA32F", "coarse_emission"),
        *ATTENUATION_TEXTURES, GUIDE_TEXTURE,
    ),
    blocks=((VIEW, "film_view"),),
    constants=(("IVEC2", "shown_pixel"), ("INT", "stride")),
    outputs=(("VEC4", "out_direct"), ("VEC4", "out_emission")),
)  # fmt: skip
PROGRAMS = (airlight_program(-1, True), at_hits_program(-1, True, True), guide_program(-1))


class Airlight(Technique):
    name = "airlight"
    label = "Airlight"
    fills = ("volume",)
    params = (
        Param(
            "rays", "Points per ray", 4,
            "Points on each pixel's ray at which in-scattered light is evaluated in a sample, shared by all lights",
            1, 64, draft=2,
        ),
        Param(
            "bounces", "Volume bounces", AS_IN_CYCLES,
            "Maximum number of times light is scattered or reflected before a medium scatters it to the camera; 0: "
            "light of lamps and world only; -1: as many as the scene's light paths allow in Cycles",
            AS_IN_CYCLES, MOST_BOUNCES, draft=2,
        ),
    )  # fmt: skip
    reads = SURFACES
    provides = (MediaEmission, LightOfMedia)
    requests = (MediaService,)
    writes = (
        Write("radiance.volume_direct", "RGBA32F", "Light that media scatter once towards the eye", True),
        Write("radiance.volume_indirect", "RGBA32F", "Light that media scatter after other bounces", True),
        Write("radiance.volume_emission", "RGBA32F", "Light that media emit"),
        Write("radiance.diffuse_indirect", "RGBA32F", "Light that media scatter onto diffuse surfaces", True),
        Write("radiance.glossy_indirect", "RGBA32F", "Light that media scatter onto rough gloss", True),
        Write("radiance.diffuse_direct", "RGBA32F", "Light that diffuse surfaces receive from media that shine", True),
    )

    def __init__(self):
        self._sources = lights.Sources()
        self._triangles: EmissiveTriangles | None = None
        self._triangles_alone: EmissiveTriangles | None = None  # light surfaces and no media
        self._bounces = MediaBounces()

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        if not has_media(snapshot):
            return "the scene has no volume"
        if not any(may_send(graph) for graph in volume_graphs(snapshot)):
            return "the scene's volumes absorb alone: nothing in them scatters or shines"
        return acceleration.too_many(snapshot)

    def programs(self, snapshot: Snapshot, settings: Settings) -> tuple[Program, ...]:
        tints = any(may_tint(one.graph) for one in snapshot.materials)
        return (seen_layers.AWAY,) if tints else ()

    def sample(self, frame: Frame) -> Iterator[None]:
        media = frame.service(MediaService)
        if media is None:
            return
        lit, world = self._lit_by(frame, media), self._lit_by_world
        coarse = frame.settings.samples < FEW
        stride = COARSE if coarse else 1
        asked = self._asked(frame, lit)
        turn = (frame.sample % COARSE, frame.sample // COARSE % COARSE)
        textures, blocks, kinds = lit.textures, lit.blocks, lit.kinds
        frame.target("radiance.volume_emission").clear()
        rays = frame.settings.get(self, "rays") * stride * stride
        places = places_of(rays, lit.rows - lit.hidden + world)
        program, names = airlight_program(kinds, world), ("radiance.volume_direct", "radiance.volume_emission")
        bindings = {
            "textures": textures | {"surface_position": frame.kept(SeenLayers).position(frame, self)}, "blocks": blocks,
            "constants": asked | {"places": places, "shown_pixel": turn if coarse else (0, 0), "stride": stride},
        }  # fmt: skip
        if coarse:
            yield from self._draw_spread(frame, program, names, stride, **bindings)
        else:
            yield from self._draw(frame, program, names, **bindings)
        frame.count(self, "light samples", lit.rows - lit.hidden)
        bounces = self._bounces_of(frame)
        if frame.settings.bounces and (media.media.scatters or media.media.emits):
            yield from self._bounces.sample(frame, self, media.media, lit, asked, bounces)

    def _lit_by(self, frame: Frame, media: MediaService) -> Lit:
        """What shines into media in this sample."""
        hidden, emitters, rows, seen = [], [], [], []
        if media.media.scatters:
            if frame.settings.bounces:
                hidden, emitters = self._rows_of(frame, self._surfaces_alone, self._triangles_alone)
                hidden += self._rows_of_world(frame) if self._world_alone else []
            rows, seen = self._rows_of(frame, self._emitters, self._triangles)
            rows += self._rows_of_world(frame) if self._lit_by_world else []
        found = {int(row[lights.LIGHT.at.kind]) % lights.KIND_STEPS for row in (*hidden, *rows)}
        kinds = lights.kinds_of(emitters + seen) | sum(1 << kind for kind in found if kind >= lights.DIRECTION)
        textures = {**frame.hierarchy("volume").textures, **media.media.textures}
        blocks = {"film_view": frame.view_block, "sources": self._sources.set(hidden + rows)}
        if self._lit_by_world:
            textures |= {
                "environment_map": frame.environment.map,
                "environment_density_map": frame.environment.density_map,
            }
            blocks["world_light"] = frame.environment.block
        self._lit = Lit(kinds, len(hidden) + len(rows), len(hidden), self._lit_by_world, textures, blocks)
        return self._lit

    @staticmethod
    def _asked(frame: Frame, lit: Lit) -> dict[str, object]:
        """CONSTANTS but for the pixel."""
        return {
            "light_count": lit.rows, "offset_size": frame.offset_size, "world_rows": float(world_directions(frame)),
            "glass_blocks": int(frame.plan.owns(LIGHT_SPECULAR_MEDIUM)), "hidden_rows": lit.hidden,
        }  # fmt: skip

    def _add_on_rays(self, frame: Frame, technique: Technique, rays: Rays, target: images.Target) -> None:
        """LightOfMedia.add, by the lights of the sample's own pass, which has run before."""
        lit, world = self._lit, self._lit_by_world
        program = at_hits_program(lit.kinds, world, rays.transmission)
        places = places_of(frame.settings.get(self, "rays"), lit.rows - lit.hidden + world)
        passes.fullscreen(
            program, target, blend="ADDITIVE_PREMULT", where=rays.where, textures=lit.textures | rays.textures,
            blocks=lit.blocks,
            constants=self._asked(frame, lit)
            | {"shown_pixel": (0, 0), "stride": 1, "places": places, "ray_number": rays.number},
        )  # fmt: skip
        frame.count(technique, "passes")
        media, bounces = frame.service(MediaService).media, self._bounces_of(frame)
        if bounces and media.scatters:
            self._bounces.on_rays(frame, technique, media, lit, self._asked(frame, lit), bounces, rays, target)

    def _bounces_of(self, frame: Frame) -> int:
        return min(frame.settings.bounces, max(frame.settings.get(self, "bounces"), 0))

    def _draw(self, frame: Frame, program: Program, names: tuple[str, ...], **bindings) -> Iterator[None]:
        """Draw a program's outputs into sums, band by band."""
        frame.count(self, "passes")
        target = frame.target(*names)
        for band in frame.bands(self, names[0]):
            passes.fullscreen(program, target, blend="ADDITIVE_PREMULT", rows=band, **bindings)
            yield

    def _draw_spread(
        self, frame: Frame, program: Program, names: tuple[str, ...], stride: int, **bindings
    ) -> Iterator[None]:
        """The same of what is asked at few pixels and spread over all."""
        frame.count(self, "passes", 3)
        size = tuple(-(-side // stride) for side in frame.size)
        found = tuple(images.pool.take(*size, "RGBA32F") for _ in names)
        passes.fullscreen(program, images.Target(found), **bindings)
        yield
        textures, blocks = bindings["textures"], bindings["blocks"]
        with images.borrowed(*frame.size, "RGBA32F") as guide:
            asks = guide_program(self._lit.kinds)
            passes.fullscreen(
                asks, guide, textures={name: textures[name] for _, name in asks.textures},
                blocks={name: blocks[name] for _, name in asks.blocks},
                constants={"light_count": self._lit.rows, "glass_blocks": 0, "hidden_rows": self._lit.hidden},
            )  # fmt: skip
            read = {name: textures[name] for _, name in SPREAD.textures if name in textures}
            passes.fullscreen(
                SPREAD, frame.target(*names), blend="ADDITIVE_PREMULT",
                textures={
                    **read, "coarse_direct": found[0], "coarse_emission": found[1], "airlight_guide": guide.colors[0],
                },
                blocks={"film_view": frame.view_block},
                constants={name: bindings["constants"][name] for name in ("shown_pixel", "stride")},
            )  # fmt: skip
        for image in found:
            images.pool.give(image)

    def begin(self, frame: Frame) -> None:
        """Find what shines into the media."""
        self._emitters = [one for one in frame.emitters if one.light.visibility.volume]
        # What lights surfaces and no media reaches those by a bounce.
        self._surfaces_alone = [
            one for one in frame.emitters if one.light.visibility.diffuse and not one.light.visibility.volume
        ]
        self._triangles = self._triangles_alone = None
        if any(may_emit(frame.snapshot.materials[slot].graph) for slot in frame.snapshot.used_materials):
            seen = EmissiveTriangles(frame, ("volume",)), EmissiveTriangles(frame, ("diffuse",), without="volume")
            self._triangles, self._triangles_alone = (one if one.power > 0 else None for one in seen)
        # Through fog without an end nothing comes from infinity.
        media = frame.service(MediaService)
        found = media.media.found if media is not None else []
        self._endless = is_endless(frame)
        scatters = any(one.scatters for one in found)
        visibility = frame.snapshot.world.visibility
        shines = frame.environment.power > 0 and not self._endless and scatters
        self._lit_by_world = shines and visibility.volume
        self._world_alone = shines and visibility.diffuse and not visibility.volume
        if media is not None:
            frame.provide(MediaEmission("radiance.volume_emission"))
            frame.provide(LightOfMedia(self._add_on_rays))

    def _rows_of(
        self, frame: Frame, emitters: list[lights.Emitter], triangles: EmissiveTriangles | None
    ) -> tuple[list[np.ndarray], list[lights.Emitter]]:
        """Points of this sample on lamps and shining meshes, and the lamps among them."""
        emitters = [one for one in emitters if one.kind != lights.SUN or not self._endless]
        chosen, weight = lights.spread_choice(len(emitters), MOST_LAMPS, frame.uniform("airlight/choose"))
        rows = []
        for number in chosen:
            emitter = emitters[number]
            sample = emitter.sample(*frame.random_volume("airlight/light"))
            rows.append(emitter.row(sample, 0, int(emitter.light.cast_shadow), weight))
        if triangles is not None:
            # A bulb shines to all sides, which few points on it do not.
            count = FEW_EMISSIVE_POINTS if frame.settings.samples < FEW else EMISSIVE_POINTS
            for k in range(count):
                drawn = frame.random_volume("airlight/emissive", frame.sample * count + k)
                samples = count * frame.settings.samples
                rows.append(triangles.row(drawn, count, lights.SHADOW_FLAG, 1, samples))
        return rows, [emitters[number] for number in chosen]

    @staticmethod
    def _rows_of_world(frame: Frame) -> list[np.ndarray]:
        """Directions of this sample in which the world is seen."""
        rows, count = [], world_directions(frame)
        flags = lights.SHADOW_FLAG + lights.DIFFUSE_FLAG * frame.snapshot.world.visibility.diffuse
        for k in range(count):
            drawn = frame.random("airlight/world", frame.sample * count + k)
            direction, radiance, density = frame.environment.draw(*drawn)
            rows.append(lights.direction_row(direction, radiance / density, density, flags, 0, 1, count))
        return rows

    def release(self) -> None:
        self._sources.release()
        self._bounces.release()
        self._triangles = self._triangles_alone = None


def world_directions(frame: Frame) -> int:
    """Directions of the world that all pixels of a sample share."""
    return FEW_WORLD_DIRECTIONS if frame.settings.samples < FEW else WORLD_DIRECTIONS


def places_of(rays: int, rows: int) -> int:
    """Places on the ray for each row of lights: one, or an even number, half of them drawn in either way."""
    each = rays // max(rows, 1)
    return 1 if each < 2 else each - each % 2


def volume_graphs(snapshot: Snapshot) -> list[Graph]:
    """Trees of all volumes of the scene."""
    used = snapshot.used_materials | {one.material for one in snapshot.volumes}
    graphs = [snapshot.materials[k].graph for k in sorted(used)]
    world = [snapshot.world.volume] if snapshot.world.volume is not None else []
    return world + [graph for graph in graphs if graph.volume is not None]


def may_send(graph: Graph) -> bool:
    """Whether a volume's tree may scatter or emit: cheap, by its nodes alone."""
    waiting, seen = [graph.volume[0]], set()
    while waiting:
        key = waiting.pop()
        node = graph.nodes.get(key)
        if node is None or key in seen:
            continue
        seen.add(key)
        if node.type in SENDING:
            return True
        waiting += [socket.link[0] for socket in node.inputs.values() if socket.link is not None]
    return False
