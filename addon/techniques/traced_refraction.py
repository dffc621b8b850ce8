"""Traced refraction: what glass lets through, bent at every interface on the way, by one walk per pixel and sample.

Each walk starts with the transmission lobe of the surface that the camera sees (shaders/lib/refraction.glsl, Walter et
al. 2007, energy of multiple scattering restored as in Cycles), and goes on through what it meets: at interfaces it is
mirrored or bent at random, in proportion to Fresnel's reflectance; a light, the world or an opaque surface ends it.

    L_t(v) = sum over interfaces k of  T_k (light of this sample's points through k  +  what the walk finds behind k)

T_k is the product of f |cos| / p up to k, and of exp(-a t) for what insides of solids absorb on the way. Points on
lights and directions of the walk find the same light at rough interfaces, weighted by the power heuristic (Veach 1997);
at smooth ones, only the walk finds what has an extent. What the first interface brings is Transmission Direct of
Cycles' passes, the rest Transmission Indirect. Here, glass does not count as a bounce: it is followed through
`interfaces` of them however few bounces the scene allows.

Surfaces behind glass reflect lights and world by this sample's points, and other surfaces by the virtual lights of the
indirect slot's technique, where it has any, and by short rays, as pixels do (instant_radiosity.py).

| cost | per sample |
|---|---|
| draws | the surface pass once more, without what is transparent |
| rays | per pixel of glass and interface 1 for the walk, 1 for lights; where it ends 2 to 4 |
| fetches per ray | about 6 per node and 10 per leaf visited; 15 per interface |

Bias (indirect path): interfaces behind the first have their material's mean colour, index and roughness, and no bumps.
Insides do not scatter or shine, and absorb evenly. Surfaces behind glass reflect evenly, by their albedo in the picture
or their material's mean, have straight grey shadows, and no caustics. Against Cycles: within 2 % for a rough ball below
a world of which Cycles draws no light samples.

Fails: above 4 million triangles nothing is traced, and glass lets light pass straight on (surfaces.py). Figures:
docs/log/2026-11-26-indirect-light.md.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import replace

from ..frame.picture import Frame
from ..frame.reads import Reads
from ..frame.settings import Settings
from ..frame.technique import Param, Technique, Write
from ..gfx import images, passes
from ..gfx.library import Program
from ..lighting.asked import asked
from ..lighting.glass_interfaces import clear_roughness, upload_interfaces
from ..lighting.media import MediaService
from ..lighting.path_sources import SHOWN_THROUGH, PathSources, ShadedLobes
from ..materials.compiler import may_refract
from ..scene import acceleration
from ..scene.emission_maps import EmissiveLevel
from ..scene.view import VIEW
from ..snapshot.scene import Snapshot
from ..sources import lights
from ..sources.environment import WORLD
from ..surfaces.draw import LEFT_OUT, SURFACE_TEXTURES, SURFACES, draw_surfaces, surface_bindings
from ..surfaces.edits_at_hits import EditsAtHits
from ..surfaces.reflectance import Reflectance
from .instant_radiosity import NEAR_CONSTANTS, NOTHING_NEAR, GatherBindings

WORLD_DIRECTIONS = 2  # drawn per sample, shared by all pixels
EMISSIVE_POINTS = 2
PATHS = ("radiance.transmission_direct", "radiance.transmission_indirect")
BEHIND = ("reflectance", "interface_table", "behind_position", "behind_albedo", "virtual_lights")
EMISSIVE = ("emissive_power", "emissive_points", "emissive_level")
REFRACTION = passes.fullscreen_program(
    "traced refraction",
    "light/refraction.frag.glsl",
    textures=(
        *acceleration.HIERARCHY_TEXTURES, *SURFACE_TEXTURES,
        *(("RGBA32F", name) for name in (
            "energy_table", "environment_map", "reflectance", "interface_table", "behind_position", "behind_albedo",
            "virtual_lights")),
        ("R32F", "environment_density_map"),
    ),
    blocks=((VIEW, "film_view"), (WORLD, "world_light"), (lights.SOURCES, "sources")),
    constants=(
        ("INT", "light_count"), ("FLOAT", "offset_size"), ("INT", "interfaces"),
        ("INT", "world_transmission"), ("FLOAT", "world_samples"), ("FLOAT", "emissive_power"),
        ("FLOAT", "emissive_points"), ("FLOAT", "emissive_level"), ("FLOAT", "clear_roughness"), *NEAR_CONSTANTS,
    ),
    outputs=(("VEC4", "out_direct"), ("VEC4", "out_indirect")),
    leaves_out=(
        ("media", "the walk among means crosses insides of glass, which are no media of the scene"),
        ("leaving", "the walk among means knows no object, but the mean of its material"),
    ),
)  # fmt: skip
# Where shaded_reflections.py follows what the first interface lets pass, lamps and the world are left:
FIRST_ALONE = replace(
    REFRACTION,
    name="light through the first interface",
    textures=tuple(one for one in REFRACTION.textures if one[1] not in BEHIND),
    constants=tuple(one for one in REFRACTION.constants if one not in NEAR_CONSTANTS and one[1] not in EMISSIVE),
    defines=(("FIRST_ALONE", "1"),),
    leaves_out=(),
)
ALBEDO = passes.fullscreen_program(
    "surface albedo",
    "surface/albedo.frag.glsl",
    textures=(*SURFACE_TEXTURES, ("RGBA32F", "energy_table")),
    blocks=((VIEW, "film_view"),),
    outputs=(("VEC4", "out_position"), ("VEC4", "out_albedo")),
)


class TracedRefraction(Technique):
    name = "traced_refraction"
    label = "Traced refraction"
    fills = ("transmission",)
    params = (
        Param(
            "interfaces", "Interfaces", 8,
            "Number of glass surfaces behind the first that a ray may cross or be reflected by",
            0, 32,
        ),
    )  # fmt: skip
    reads = SURFACES
    requests = (GatherBindings, MediaService, EditsAtHits)
    writes = (
        Write(PATHS[0], "RGBA32F", "Light that arrives through one interface of glass", True),
        Write(PATHS[1], "RGBA32F", "Light that arrives through glass from elsewhere", True),
        Write(SHOWN_THROUGH, "RGBA32F", "What is seen through glass, as reflections show it", True),
    )

    def __init__(self):
        # By glass, and by surfaces behind it.
        self._sources = PathSources(("transmission", "diffuse"), "refraction", WORLD_DIRECTIONS, EMISSIVE_POINTS)
        # How the materials behind the first interface bend light, and what their insides absorb.
        self._interfaces: Reads[images.Image] = Reads(upload_interfaces)

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        used = snapshot.used_materials
        if not any(may_refract(snapshot.materials[slot].graph) for slot in used):
            return "no material is glass"
        return acceleration.too_many(snapshot)

    def begin(self, frame: Frame) -> None:
        self._table = self._interfaces.of(frame.materials.compiled)
        frame.kept(Reflectance).update(frame)
        self._sources.begin(frame)

    def sample(self, frame: Frame) -> Iterator[None]:
        rows = self._sources.rows(frame)
        hierarchy = frame.hierarchy("transmission")
        bindings = {
            "textures": {
                **surface_bindings(frame), "energy_table": frame.materials.energy_table,
                "environment_map": frame.environment.map, "environment_density_map": frame.environment.density_map,
                **hierarchy.textures,
            },
            "blocks": {
                "film_view": frame.view_block, "world_light": frame.environment.block,
                "sources": self._sources.block(rows),
            },
            "constants": {
                "light_count": len(rows), "offset_size": frame.offset_size, "interfaces": 0,
                "world_transmission": int(bool(self._sources.world_flags & lights.TRANSMISSION_FLAG)),
                "world_samples": float(WORLD_DIRECTIONS),
                "clear_roughness": clear_roughness(frame),
            },
        }  # fmt: skip
        if frame.service(ShadedLobes) is None:
            yield from self._walk(frame, bindings)
        else:
            yield from self._draw(frame, asked(frame, FIRST_ALONE, bindings["textures"]), bindings)
        frame.count(self, "passes")
        frame.count(self, "light samples", len(rows))

    def _draw(self, frame: Frame, program: Program, bindings: dict[str, dict]) -> Iterator[None]:
        target, edits = frame.target(*PATHS), frame.service(EditsAtHits)
        for band in frame.bands(self):
            with edits.entering(bindings["textures"]["surface_lobe"]) if edits is not None else nullcontext():
                passes.fullscreen(program, target, blend="ADDITIVE_PREMULT", rows=band, **bindings)
            yield

    def _walk(self, frame: Frame, bindings: dict[str, dict]) -> Iterator[None]:
        """Follow what passes the first interface by walks among means."""
        behind = self._draw_behind(frame)
        yield
        virtual_lights, near = self._indirect_light(frame)
        bindings["textures"] |= {
            "reflectance": frame.kept(Reflectance).image, "interface_table": self._table,
            "behind_position": behind.colors[0], "behind_albedo": behind.colors[1], "virtual_lights": virtual_lights,
        }  # fmt: skip
        bindings["constants"] |= {
            "interfaces": frame.settings.get(self, "interfaces"), "emissive_power": self._sources.emissive_power,
            "emissive_points": float(EMISSIVE_POINTS), "emissive_level": frame.shared(EmissiveLevel).value, **near,
        }  # fmt: skip
        yield from self._draw(frame, REFRACTION, bindings)
        for image in behind.colors:
            images.pool.give(image)

    def _draw_behind(self, frame: Frame) -> images.Target:
        """Places and reflectances of what stands behind glass in the picture. Its images go back to the pool."""
        surfaces = [images.pool.take(*frame.size, "RGBA32F") for _ in SURFACES]
        depth = images.pool.take(*frame.size, "DEPTH_COMPONENT32F")
        behind = images.Target(tuple(images.pool.take(*frame.size, "RGBA32F") for _ in range(2)))
        draw_surfaces(frame, self, images.Target(tuple(surfaces), depth), LEFT_OUT, glass=False)
        passes.fullscreen(
            ALBEDO,
            behind,
            textures={
                **{name: image for (_, name), image in zip(SURFACE_TEXTURES, surfaces)},
                "energy_table": frame.materials.energy_table,
            },
            blocks={"film_view": frame.view_block},
        )
        for image in (*surfaces, depth):
            images.pool.give(image)
        return behind

    def _indirect_light(self, frame: Frame) -> tuple[images.Image, dict[str, object]]:
        """Virtual lights and NEAR_CONSTANTS; where nothing provides them, of none and no bounces."""
        provided = frame.service(GatherBindings)
        if provided is None:
            return self._table, NOTHING_NEAR
        constants = {name: provided.bindings["constants"][name] for _, name in NEAR_CONSTANTS}
        return provided.bindings["textures"]["virtual_lights"], constants

    def release(self) -> None:
        self._sources.release()
        self._interfaces.forget()
        self._table = None
