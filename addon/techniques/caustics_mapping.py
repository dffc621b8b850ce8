"""Caustics mapping: caustics of lamps by images that the light sees, with photons found by look-ups alone.

For each lamp the casters are drawn into a grid of photons, and what lies behind them into a map of receivers. A photon
is bent where it enters, looks up where it leaves the farthest surface of its caster, is bent again, and looks up the
receiver that it meets; its footprint is splatted into the map, which receivers in the picture ask like a shadow map:

    E(x) = sum over photons  Phi K(x; Sigma),    L(x) += rho / pi * E(x)

After Shah, Konttinen & Pattanaik, "Caustics mapping: an image-space technique for real-time caustics", IEEE TVCG 13(2),
2007. Where that iterates to a fixed point, which diverges for reflections, roots of the signed depth are bracketed and
then taken on the plane of the texel met; flux is in watts by the texel's solid angle in place of shares; splats are the
ellipses between neighbouring photons in place of discs (lighting/photons.py).

| cost | per sample, light and lobe |
|---|---|
| draws | casters nearest and farthest, receivers |
| fetches | 28 + 9 for a receiver and 14 + 6 for a caster's far side, per photon |
| passes | 4, and 1 instanced draw of the grid into the map |
| bytes | 36 x 16 per photon, 7 x 16 per texel of the map |

Bias, in diffuse indirect: one reflection or two refractions; what is mirrored inside of glass is missing (of a ball 13
% of its light). Of several surfaces along the light the first and the last count, so hollow or folded glass is taken
for full, and what stands in glass is lit as if it stood behind it. Receivers that the light does not see past the
casters get nothing: of reflections most, and whatever leaves the map's rectangle. The mean over samples converges to
that. With `by` rays, paths are those of screen-space photons, and only the map's own limits stay.

Fails: beside a lamp that stands within the casters' box, maps have the faces of a cube, and light that passes from one
face to another is lost.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..frame.light_paths import LIGHT_SPECULAR_DIFFUSE
from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.technique import Param, Technique, Write
from ..gfx import images, passes
from ..gfx.library import Program
from ..kernels import splats
from ..lighting import caustic_casters, photons
from ..lighting.caustic_maps import INTO_MAP, LEAST_TEXELS, SEEN, CausticMaps
from ..lighting.kept_apart import KeptApart
from ..lighting.light_views import LightBuffers, widened
from ..lighting.photons import MAP, Photons
from ..scene import acceleration
from ..scene.view import VIEW
from ..snapshot.scene import Snapshot
from ..surfaces.draw import SURFACES, surface_bindings

APPLY = passes.fullscreen_program(
    "caustic map applied",
    "caustics/apply.frag.glsl",
    textures=(*SEEN, *MAP, ("RGBA32F", "caustic_map")),
    blocks=((VIEW, "map_view"),),
    outputs=(("VEC4", "out_light"),),
)
LOOKUPS, RAYS = "LOOKUPS", "RAYS"


class CausticsMapping(Technique):
    name = "caustics_mapping"
    label = "Caustics mapping"
    fills = (caustic_casters.SLOT,)
    owns = (LIGHT_SPECULAR_DIFFUSE,)
    params = (
        Param(
            "grid", "Photon grid", 128,
            "Photons along each side of the grid that a light sends towards casters of caustics; fewer are softer at "
            "few samples",
            16, 1024, draft=96,
        ),
        Param("map_size", "Map size", 512, "Texels along each side of a caustic map", 64, 4096, draft=256),
        Param(
            "extent", "Map extent", 3.0,
            "Width of the map of receivers, relative to that of the casters of caustics as seen from the light",
            1.0, 16.0,
        ),
        Param(
            "by", "Photons by", LOOKUPS, "How the place where a photon lands is found",
            items=(
                (LOOKUPS, "Look-Ups", 0, "Steps in images of what the light sees: fast, and blind behind it"),
                (RAYS, "Rays", 1, "Rays through all triangles"),
            ),
        ),
    )  # fmt: skip
    reads = SURFACES
    writes = (Write("radiance.diffuse_indirect", "RGBA32F", "Light that arrives over other surfaces", True),)

    def __init__(self):
        self._photons = Photons()
        self._apart = KeptApart()
        self._receivers = LightBuffers()
        self._map: images.Target | None = None
        self._casters: caustic_casters.Casters | None = None

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        if settings.bounces < 1:
            return "light is not reflected on its way (0 bounces)"
        found = caustic_casters.casters_of(snapshot)
        if isinstance(found, str):
            return found
        return acceleration.too_many(snapshot) if settings.get(self, "by") == RAYS else None

    def programs(self, snapshot: Snapshot, settings: Settings) -> tuple[Program, ...]:
        if settings.get(self, "by") == RAYS:
            return photons.PHOTONS, photons.WALLED, INTO_MAP, APPLY
        return photons.LOOKUPS, photons.FOOTPRINTS, INTO_MAP, APPLY

    def begin(self, frame: Frame) -> None:
        self._casters = caustic_casters.of(frame)
        if self._casters is not None:
            self._photons.begin(frame, self._casters)
            self._apart.begin(frame, ("diffuse_indirect",))

    def sample(self, frame: Frame) -> Iterator[None]:
        if self._casters is None or frame.receivers is None or not len(frame.receivers.distance):
            return
        with self._apart.drawing(frame, self):
            yield from self._add(frame)

    def _add(self, frame: Frame) -> Iterator[None]:
        settings = frame.settings
        side, map_side = settings.get(self, "grid"), settings.get(self, "map_size")
        by_rays = settings.get(self, "by") == RAYS
        shift = np.array(frame.random("caustics/map", frame.sample))
        maps = frame.kept(CausticMaps)
        maps.begin(frame, self._photons.resting(frame, self._casters))
        for light in self._photons.views(frame, self._casters, side):
            view = widened(light.view, settings.get(self, "extent"), frame.receivers.corners, map_side, shift)
            block, seen = self._receivers.receivers(frame, self, view, self._casters.materials)
            receivers = {name.replace("surface", "receiver"): image for name, image in seen.items()}
            caught = {name: receivers[name] for _, name in MAP}
            target = self._map_of(map_side)
            target.clear()
            bundles = (
                self._photons.traced(frame, self, self._casters, light, 1)
                if by_rays
                else self._photons.looked_up(frame, self, self._casters, light, block, caught)
            )
            at_hits = maps.wants(frame, light)
            if at_hits:
                into_kept = maps.add(frame, self, self._casters, light, self._photons)
            for bundle in bundles:
                if at_hits:
                    into_kept(bundle)
                records = self._photons.footprints(frame, self, bundle, block, LEAST_TEXELS)
                splats.draw(INTO_MAP, target, records, textures=caught, blocks={"map_view": block})
                frame.count(self, "passes")
            bound = {name: image for name, image in surface_bindings(frame).items() if ("RGBA32F", name) in SEEN}
            passes.fullscreen(
                APPLY,
                frame.target("radiance.diffuse_indirect"),
                blend="ADDITIVE_PREMULT",
                textures={**bound, **caught, "caustic_map": target.colors[0]},
                blocks={"map_view": block},
            )
            frame.count(self, "passes")
            if at_hits:
                maps.keep(frame, self)
            yield

    def _map_of(self, side: int) -> images.Target:
        if self._map is None or self._map.size != (side, side):
            self._give()
            self._map = images.Target((images.pool.take(side, side, "RGBA32F"),))
        return self._map

    def _give(self) -> None:
        if self._map is not None:
            images.pool.give(self._map.colors[0])
        self._map = None

    def release(self) -> None:
        self._photons.release()
        self._receivers.release()
        self._give()
        self._casters = None
