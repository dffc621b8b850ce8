"""Screen-space photons: caustics of lamps on diffuse surfaces, by photons that are traced and splatted on the picture.

A light's view of the casters gives the photons of the first interface; rays through the hierarchy follow them over up
to `interfaces` more, and where they end on a surface in the picture their footprint adds light to its pixels
(lighting/photons.py):

    L(x) += rho / pi * sum over photons  Phi K(x; Sigma)

After Quyen, "Combining image-space instant radiosity and photon mapping", 2014, with the hierarchy in place of lists of
fragments per pixel (exact hits on what the picture does not show, at the same cost per ray), grids fitted to casters in
place of a mask's pyramid, and all photons kept with their weight in place of roulette.

| cost | per sample, light and lobe (of glass 2: bent and mirrored) |
|---|---|
| draws | the surfaces that the light's view sees |
| rays | 1 per photon and interface, and 1 |
| passes | 2 of the grid, 1 instanced draw of it into the picture |
| bytes | 20 x 16 per photon |

Rough glossy lobes take photons of lamps and the world that smooth glass has let pass or mirrored, and rays of theirs
leave those out: a ray finds a small lamp by way of glass so rarely that it is a bright dot
(shaders/caustics/gloss.glsl). Sheen, velvet, toon and translucent lobes take what diffuse closures take; fibres none.

Bias, in diffuse indirect: as photons.py says. Receivers reflect evenly by their albedo. Caustics seen in mirrors and
through glass come from maps (lighting/caustic_maps.py).
What of the world's light is not much brighter than its mean passes casters straight.

Fails: above 4 million triangles nothing is traced.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

from ..frame.light_paths import LIGHT_SPECULAR_DIFFUSE
from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.shares import Turns
from ..frame.technique import Param, Technique, Write
from ..gfx import images
from ..gfx.library import Program
from ..kernels import splats
from ..lighting import caustic_casters
from ..lighting.caustic_maps import SEEN, CausticMaps
from ..lighting.kept_apart import KeptApart
from ..lighting.light_views import REFLECTED, REFRACTED
from ..lighting.path_sources import ShadedLobes
from ..lighting.photons import PHOTONS, SPREAD_SIDE, WALLED, LitView, Photons
from ..materials import gloss
from ..materials.compiler import may_be_soft
from ..scene import acceleration
from ..scene.materials import may_be_glossy
from ..scene.view import VIEW
from ..snapshot.panorama import bends_lines
from ..snapshot.scene import Snapshot
from ..surfaces.draw import SURFACE_TEXTURES, SURFACES, surface_bindings


@cache
def splat_program(gloss: bool, soft: bool) -> Program:
    """Draws photons into the picture. `gloss`: glossy lobes take them, too; `soft`: so do lobes without microfacets."""
    lobes = [name for name, taken in (("GLOSS", gloss), ("SOFT", soft), ("TO_GLOSSY", gloss or soft)) if taken]
    return splats.splat_program(
        "photon splat",
        "caustics/splat.frag.glsl",
        "film_view.row_x, film_view.row_y, film_view.row_w, film_view.row_q, film_view.backward.w",
        textures=(*(SURFACE_TEXTURES if lobes else SEEN), ("RGBA32F", "energy_table")),
        blocks=((VIEW, "film_view"),),
        defines=tuple((name, "") for name in lobes),
        outputs=(("VEC4", "out_light"), *((("VEC4", "out_gloss"),) if lobes else ())),
    )


DECLARED = tuple(splat_program(gloss, soft) for gloss in (False, True) for soft in (False, True))
LIGHT, GLOSS = "radiance.diffuse_indirect", "radiance.glossy_indirect"
LEAST_PIXELS = 0.92
MAPS_APART = 4  # samples for which rays ask the same map: it costs as much as the picture's photons, and shows less
INTERFACES = Param(
    "interfaces", "Interfaces", 16,
    "Number of glass or mirror surfaces after the first that a photon may meet before a diffuse surface",
    0, 32, draft=8,
)  # fmt: skip


class ScreenSpacePhotons(Technique):
    name = "screen_space_photons"
    label = "Screen-space photons"
    fills = (caustic_casters.SLOT,)
    owns = (LIGHT_SPECULAR_DIFFUSE,)
    params = (
        Param(
            "grid", "Photon grid", 160,
            "Photons along each side of the grid that a light sends towards casters of caustics; fewer are softer at "
            "few samples",
            16, 1024, draft=96,
        ),
        INTERFACES,
    )  # fmt: skip
    reads = SURFACES
    writes = (
        Write(LIGHT, "RGBA32F", "Light that arrives over other surfaces", True),
        Write(GLOSS, "RGBA32F", "Light that glossy surfaces receive from other surfaces", True, by_need=True),
    )

    def __init__(self):
        self._photons = Photons()
        self._casters: caustic_casters.Casters | None = None
        self._splat = splat_program(False, False)
        self._turns = Turns(self)
        self._apart = KeptApart()

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        if settings.bounces < 1:
            return "light is not reflected on its way (0 bounces)"
        found = caustic_casters.casters_of(snapshot)
        return found if isinstance(found, str) else bends_lines(snapshot) or acceleration.too_many(snapshot)

    def claims(self, snapshot: Snapshot, settings: Settings) -> bool:
        """Wherever it can trace: its error is below that of look-ups in every scene of docs/caustics.md."""
        return True

    def programs(self, snapshot: Snapshot, settings: Settings) -> tuple[Program, ...]:
        soft = any(may_be_soft(snapshot.materials[slot].graph) for slot in snapshot.used_materials)
        return PHOTONS, WALLED, splat_program(_on_gloss(snapshot, caustic_casters.casters_of(snapshot)), soft)

    def begin(self, frame: Frame) -> None:
        self._casters = caustic_casters.of(frame)
        if self._casters is not None:
            self._photons.begin(frame, self._casters)
            if self._casters.spreads:
                frame.account.chose(
                    self, "photons", f"{SPREAD_SIDE} x {SPREAD_SIDE}, because nothing makes light converge"
                )
            at_once = self._photons.all_at_once(frame, self._casters)
            on_gloss = GLOSS in frame.images and _on_gloss(frame.snapshot, self._casters)
            on_soft = GLOSS in frame.images and frame.materials.soft
            answered = frame.shared(caustic_casters.Answered)
            answered.on_gloss, answered.on_soft = on_gloss, on_soft
            self._splat = splat_program(on_gloss, on_soft)
            into = (LIGHT, GLOSS) if on_gloss or on_soft else (LIGHT,)
            self._apart.begin(frame, tuple(name.removeprefix("radiance.") for name in into))
            self._turns.begin(frame, into, at_once)

    def sample(self, frame: Frame) -> Iterator[None]:
        if self._casters is None or not self._turns.weight(frame):
            return
        side = frame.settings.get(self, "grid")
        maps = frame.kept(CausticMaps)
        # Few samples of glass need all their maps: which of them mirrors at an inner face is shared out over them.
        lasting = self._turns.may_rest or (self._turns.may_last and not self._casters.refracting)
        renews = not lasting or self._turns.renews(frame, MAPS_APART)
        if renews:
            maps.begin(frame, self._photons.resting(frame, self._casters), lasting)
        turn = self._turns.turn(frame) if self._turns.may_rest else None
        with self._apart.drawing(frame, self), self._turns.drawing(frame) as drawing:
            target = images.Target(tuple(drawing.images(0).values()))
            for light in self._photons.views(frame, self._casters, side, turn, fitted=True):
                yield from self._add(frame, target, light, maps if renews else None)
            if renews:
                maps.keep(frame, self)
            drawing.done(0)

    def _add(self, frame: Frame, target: images.Target, light: LitView, maps: CausticMaps | None) -> Iterator[None]:
        """Photons of a light's view, into the picture and into the map that rays ask, where there is one."""
        on_gloss = frame.shared(caustic_casters.Answered).on_gloss
        seen = {k: image for k, image in surface_bindings(frame).items() if ("RGBA32F", k) in self._splat.textures}
        at_hits = maps is not None and maps.wants(frame, light)
        key, rayed = caustic_casters.key_of(light.emitter), frame.service(ShadedLobes) is not None
        gloss_apart = at_hits and self._casters.wanted(key) != (REFRACTED | REFLECTED) and may_be_glossy(frame.snapshot)
        if at_hits:
            into_kept = maps.add(frame, self, self._casters, light, self._photons, gloss_apart)
        # Rays of gloss leave out what photons bring it: of lamps whose light they take glass as opaque for.
        known = not rayed or key == caustic_casters.WORLD or key in frame.kept(CausticMaps).lights
        onto_gloss = _lobes_on_gloss(frame, light) if on_gloss and known and key != caustic_casters.MESHES else 0
        interfaces = frame.settings.get(self, "interfaces")
        for bundle in self._photons.traced(frame, self, self._casters, light, interfaces, onto_gloss, gloss_apart):
            yield
            records = self._photons.footprints(frame, self, bundle, frame.view_block, LEAST_PIXELS)
            splats.draw(
                self._splat,
                target,
                records,
                textures={**seen, "energy_table": frame.materials.energy_table},
                blocks={"film_view": frame.view_block},
            )
            frame.count(self, "passes")
            if at_hits:
                into_kept(bundle)
            yield

    def release(self) -> None:
        self._photons.release()
        self._turns.drop()
        self._casters = None


def _on_gloss(snapshot: Snapshot, casters: caustic_casters.Casters | str) -> bool:
    """Whether glossy lobes may take photons, whatever caustics diffuse surfaces are to have. None end on mirrors or
    glass, even where those have a rough lobe, too."""
    if isinstance(casters, str) or not casters.refracting:
        return False
    rough = [*(max(gloss.mirrors(snapshot.materials[k].graph)) for k in casters.going_on)]
    rough += [max(gloss.glass(snapshot.materials[k].graph), default=1.0) for k in casters.refracting]
    return may_be_glossy(snapshot) and max(rough) <= gloss.SMOOTH


def _lobes_on_gloss(frame: Frame, light: LitView) -> int:
    """Those of glass next to the light, REFRACTED and REFLECTED as a sum, by which rays of gloss would find it."""
    of_light = light.emitter.light
    visibility = frame.snapshot.world.visibility if of_light is None else of_light.visibility
    return REFRACTED * visibility.transmission + REFLECTED * visibility.glossy
