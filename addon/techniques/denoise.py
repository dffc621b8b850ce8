"""Denoise: noise that is left in light after the last sample is filtered where variance tells it from shading.

    light = sum / colour            of diffuse and glossy light, each path by itself; of media and through glass without
    out   = light(p) + sum over pixels q  w(p, q) (light(q) - light(p))
    w     = binomial * same surface * exp(-(light(p) - light(q))^2 / s^2)
    s^2   = k^2 sqrt(var(p) var(q)) + light(p) light(q) / 100^2

An edge-avoiding wavelet of three or five levels (Dammertz, Sewtz, Hanika and Lensch 2010), steered by variance as in
Schied et al. 2017 (SVGF). The variance comes from the picture itself: the sums are copied half-way through the samples,
and half the squared difference of the two halves' means, averaged over 3x3 pixels of the same surface, estimates it.
That includes noise shared by all pixels (one set of virtual lights or light points). k is 3 for direct light, 5.5 for
diffuse indirect light, whose edges are softer, 5 for indirect gloss, and 2 for lamps in gloss and what glass shows,
whose edges are sharp.

w is symmetric and the centre keeps what the weights lack to one: pixels exchange light and none is lost, however skewed
the noise. Its variance is the geometric mean, so that a bright rim does not spread into its dark surroundings. Pixels
exchange light of lobes and glass only if these show what reflects alike (hits/guide.frag.glsl). What photons bring is
taken out before and put back behind (lighting/kept_apart.py). Where both halves agree nothing changes, so the result
still converges; textures are divided out before and stay.

| cost | after the last sample |
|---|---|
| passes | 5 for direct and 7 for indirect light, over the screen |
| fetches per noisy pixel and path | 9 x 5 + 3 or 5 x 25 x 3; 54 or 60 where there is no noise |

Bias: light is spread by at most 14 pixels over a surface, indirect light by 32, by an amount that the standard error
hides; means stay. Fails: creases in sunlit scenes whose indirect light fades within some pixels are blurred. Not
filtered: emission, pixels without the path's colour, pictures of one sample, drafts.

Errors with and without it, and what was tried and left: docs/log/2026-11-26-denoise.md.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from ..film.points import shown_paths
from ..film.resolve import COMBINED, resolve
from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.technique import Param, Technique, Write
from ..gfx import images, passes
from ..lighting.grass import GrassTable
from ..lighting.kept_apart import apart_of
from ..lighting.path_sources import SHOWN, SHOWN_THROUGH
from ..scene.media import has_media
from ..scene.view import VIEW
from ..snapshot.scene import Snapshot
from ..surfaces.seen_layers import SeenLayers
from .instant_radiosity import no_diffuse_light


@dataclass(frozen=True)
class Filter:
    """How far the light of a path may be exchanged between pixels."""

    tolerance: float  # standard errors that they may differ by
    sharpness: float  # power of the cosine between their normals
    strides: tuple[int, ...]  # of the levels


FILTERS = {
    "diffuse_direct": Filter(3.0, 32.0, (1, 2, 4)),
    "diffuse_indirect": Filter(5.5, 8.0, (1, 2, 4, 8, 1)),
    "glossy_direct": Filter(2.0, 32.0, (1, 2)),
    "glossy_indirect": Filter(5.0, 8.0, (1, 2, 4, 8, 1)),
    "transmission_direct": Filter(2.0, 32.0, (1, 2)),
    "transmission_indirect": Filter(2.0, 32.0, (1, 2, 4)),
    "volume_direct": Filter(3.0, 8.0, (1, 2, 4)),
    "volume_indirect": Filter(5.0, 8.0, (1, 2, 4, 8, 1)),
}
# Exchanged along what is seen equally far away, behind layers of one colour; no colour of its own.
OF_MEDIA = ("volume_direct", "volume_indirect")
THROUGH_GLASS = ("transmission_direct", "transmission_indirect")  # with their colour, which is what glass shows, too
GUIDES_OF_LOBES = {"glossy_direct": SHOWN, "glossy_indirect": SHOWN, **dict.fromkeys(THROUGH_GLASS, SHOWN_THROUGH)}
BY_NEED = OF_MEDIA + THROUGH_GLASS
FEWEST = 2  # samples: one for each half
GUIDES = (("RGBA32F", "surface_position"), ("RGBA32F", "normal_sum"))
LEAST_COLOR = (("LEAST_COLOR", "1e-4"),)  # albedo below this sends nothing that is seen
BEGIN = passes.fullscreen_program(
    "denoise: light and variance",
    "denoise/begin.frag.glsl",
    textures=(*GUIDES, ("RGBA32F", "sum_now"), ("RGBA32F", "half_sum"), ("RGBA32F", "color_sum")),
    blocks=((VIEW, "film_view"),),
    constants=(("INT", "count"), ("INT", "half_count"), ("FLOAT", "sharpness")),
    defines=LEAST_COLOR,
    outputs=(("VEC4", "out_light"),),
)
# The same where grass is seen, whose direct light no pixel shares with others.
BEGIN_BESIDE_GRASS = replace(
    BEGIN, name="denoise: light and variance beside grass", textures=(*BEGIN.textures, ("RGBA32F", "surface_lobe")),
    defines=(*BEGIN.defines, ("GRASS", "1")),
)  # fmt: skip
LEVEL = passes.program_of_pixels(
    "denoise: level",
    "denoise/level.glsl",
    textures=(*GUIDES, ("RGBA32F", "light_in")),
    blocks=((VIEW, "film_view"),),
    constants=(("INT", "stride"), ("FLOAT", "tolerance"), ("FLOAT", "sharpness")),
    outputs=(("VEC4", "out_light"),),
)
# The same for light of media.
BEGIN_OF_MEDIA = replace(
    BEGIN, name="denoise: light of media and variance", textures=(GUIDES[0], *BEGIN.textures[2:4]),
    defines=(("OF_MEDIA", "1"),),
)  # fmt: skip
LEVEL_OF_MEDIA = replace(
    LEVEL, name="denoise: level of media", textures=(GUIDES[0], *LEVEL.textures[2:]), defines=(("OF_MEDIA", "1"),)
)
# The same for light through glass.
BEGIN_THROUGH_GLASS = replace(
    BEGIN, name="denoise: light through glass and variance", textures=BEGIN.textures[:4],
    defines=(("THROUGH_GLASS", "1"),),
)  # fmt: skip
# The same for reflections and glass, which show edges that no surface has: `shown_sum` is SHOWN or SHOWN_THROUGH.
LEVEL_OF_REFLECTIONS = replace(
    LEVEL,
    name="denoise: level of reflections",
    textures=(*LEVEL.textures, ("RGBA32F", "shown_sum")),
    constants=(*LEVEL.constants, ("INT", "count")),
    defines=(("REFLECTIONS", "1"),),
)
END = passes.fullscreen_program(
    "denoise: reflected light",
    "denoise/end.frag.glsl",
    textures=(("RGBA32F", "light_in"), ("RGBA32F", "color_sum"), ("RGBA32F", "sum_now")),
    constants=(("INT", "count"),),
    defines=LEAST_COLOR,
    outputs=(("VEC4", "out_sum"),),
)
# The same for light of which photons have brought a part.
BEGIN_BESIDE_PHOTONS = replace(
    BEGIN, name="denoise: light and variance beside photons", defines=(*BEGIN.defines, ("APART", "1")),
    textures=(*BEGIN.textures, ("RGBA32F", "apart_sum"), ("RGBA32F", "apart_half")),
)  # fmt: skip
END_BESIDE_PHOTONS = replace(
    END, name="denoise: reflected light beside photons", textures=(*END.textures, ("RGBA32F", "apart_sum")),
    defines=(*END.defines, ("APART", "1")),
)  # fmt: skip
END_OF_MEDIA = replace(
    END, name="denoise: light of media", textures=(END.textures[0], END.textures[2]), defines=(("OF_MEDIA", "1"),)
)


class Denoise(Technique):
    name = "denoise"
    label = "Denoise"
    params = (
        Param(
            "strength", "Strength", 1.0,
            "Strength of the noise filter that runs after the last sample; 0: off",
            0.0, 2.0,
        ),
    )  # fmt: skip
    reads = ("surface.position", "surface.normal_sum", "color.diffuse", "color.glossy")
    writes = (
        Write("film.combined", "RGBA32F", "The picture with denoised light, premultiplied by alpha"),
        *(
            write
            for path in FILTERS
            for write in (
                Write(
                    f"denoise.{path}_half",
                    "RGBA32F",
                    "What the first half of the samples summed up",
                    by_need=path in BY_NEED,
                ),
                Write(f"denoise.{path}", "RGBA32F", "The sum of all samples, denoised", by_need=path in BY_NEED),
            )
        ),
    )

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        if settings.schedule.is_draft:
            return "it is a draft"
        if not settings.get(self, "strength"):
            return "its strength is 0"
        if settings.samples < FEWEST:
            return f"the picture has fewer than {FEWEST} samples"
        if has_media(snapshot):
            return None
        if not snapshot.instances:
            return "the scene has no surface"
        return no_diffuse_light(snapshot)

    def looks_at(self, settings: Settings) -> tuple[str, ...]:
        return (*(f"radiance.{path}" for path in FILTERS), "color.diffuse", "color.glossy", "surface.normal_sum")

    def begin(self, frame: Frame) -> None:
        for path in self._paths(frame):
            for name in (f"denoise.{path}_half", f"denoise.{path}"):
                if name not in frame.images:
                    frame.images[name] = images.pool.take(*frame.size, "RGBA32F")
        for write in self.writes:
            # A pass tree may show what no light path needs.
            if write.name.startswith("denoise.") and write.name in frame.images:
                frame.target(write.name).clear()
        for path in map(apart_of, self._paths(frame)):
            if f"film.{path}" in frame.images:
                frame.held.add(Write(f"denoise.{path}_half", "RGBA32F", "What its first half summed up"))
        frame.read_last |= {"surface.position", "surface.lobe"} if _beside_grass(frame) else {"surface.position"}

    def sample(self, frame: Frame) -> None:
        done = frame.sample + 1
        if frame.settings.may_end_early:
            self._keep_doubles(frame, done)
        elif done == frame.settings.samples // 2:
            for path in self._summed(frame):
                passes.copy(frame.images[f"film.{path}"], frame.target(f"denoise.{path}_half"))

    def _keep_doubles(self, frame: Frame, done: int) -> None:
        """Where nobody knows how many samples there will be: copies after 1, 2, 4, … samples, the last two of them. One
        is always from a third to two thirds of the way."""
        if done & (done - 1):
            return
        for path in self._summed(frame):
            half, before = f"denoise.{path}_half", f"denoise.{path}_before"
            if before not in frame.images:
                frame.images[before] = images.pool.take(*frame.size, "RGBA32F")
            passes.copy(frame.images[half], frame.target(before))
            passes.copy(frame.images[f"film.{path}"], frame.target(half))

    def _half(self, frame: Frame, path: str, count: int) -> tuple[int, str]:
        """Samples of the first part of all, and the image of their sum."""
        if frame.first_part is not None:
            return frame.first_part, f"denoise.{path}_half"
        if not frame.settings.may_end_early:
            return count // 2, f"denoise.{path}_half"
        last = 1 << (count.bit_length() - 1)
        return (last // 2, f"denoise.{path}_before") if 2 * count < 3 * last else (last, f"denoise.{path}_half")

    def end(self, frame: Frame) -> Iterator[None]:
        if frame.settings.samples < FEWEST or frame.first_part == 0:
            return
        for path in self._paths(frame):
            yield from self._filter(frame, path, frame.settings.samples)
            frame.held.shown[f"radiance.{path}"] = f"denoise.{path}"

    def show(self, frame: Frame) -> None:
        if frame.plan.last_writer(COMBINED) is self:
            resolve(frame)

    def _paths(self, frame: Frame) -> list[str]:
        shown = shown_paths(frame)
        return [path for path in FILTERS if path in shown and f"radiance.{path}" in frame.images]

    def _summed(self, frame: Frame) -> list[str]:
        """Of which the sums of the first half of the samples are kept."""
        paths = self._paths(frame)
        return [*paths, *(path for path in map(apart_of, paths) if f"denoise.{path}_half" in frame.images)]

    def _filter(self, frame: Frame, path: str, count: int) -> Iterator[None]:
        sums, guides = {"sum_now": frame.images[f"film.{path}"]}, {"surface_position": frame.images["surface.position"]}
        begin, level, end = (BEGIN_OF_MEDIA, LEVEL_OF_MEDIA, END_OF_MEDIA) if path in OF_MEDIA else (BEGIN, LEVEL, END)
        if path in THROUGH_GLASS:
            begin, end = BEGIN_THROUGH_GLASS, END_OF_MEDIA
        elif path not in OF_MEDIA:
            sums["color_sum"] = frame.images[f"color.{path.split('_')[0]}"]
        if path in OF_MEDIA:
            guides["surface_position"] = frame.kept(SeenLayers).position(frame, self)
        else:
            guides["normal_sum"] = frame.images["surface.normal_sum"]
        blocks, how = {"film_view": frame.view_block}, FILTERS[path]
        half_count, half = self._half(frame, path, count)
        grass = path == "diffuse_direct" and _beside_grass(frame)
        begin = BEGIN_BESIDE_GRASS if grass else begin
        beside = {"surface_lobe": frame.images["surface.lobe"]} if grass else {}
        if f"denoise.{apart_of(path)}_half" in frame.images:
            begin, end = BEGIN_BESIDE_PHOTONS, END_BESIDE_PHOTONS
            sums["apart_sum"] = frame.images[f"film.{apart_of(path)}"]
            beside["apart_half"] = frame.images[self._half(frame, apart_of(path), count)[1]]
        with images.borrowed(*frame.size, "RGBA32F") as light, images.borrowed(*frame.size, "RGBA32F") as other:
            for rows in frame.bands(self):
                passes.fullscreen(
                    begin, light, rows=rows, blocks=blocks,
                    textures={**guides, **sums, **beside, "half_sum": frame.images[half]},
                    constants={"count": count, "half_count": half_count, "sharpness": how.sharpness},
                )  # fmt: skip
                yield
            shown, guide = {}, GUIDES_OF_LOBES.get(path)
            if guide in frame.images:
                level, shown = LEVEL_OF_REFLECTIONS, {"shown_sum": frame.images[guide]}
            tolerance = how.tolerance * frame.settings.get(self, "strength")
            for stride in how.strides:
                constants = {"stride": stride, "tolerance": tolerance, "sharpness": how.sharpness}
                constants |= {"count": count} if shown else {}
                for rows in frame.bands(self):
                    passes.each_pixel(
                        level, other, rows=rows, blocks=blocks, constants=constants,
                        textures={**guides, **shown, "light_in": light.colors[0]},
                    )  # fmt: skip
                    yield
                light, other = other, light
            textures = {"light_in": light.colors[0], **sums}
            passes.fullscreen(end, frame.target(f"denoise.{path}"), textures=textures, constants={"count": count})
        frame.count(self, "passes", len(how.strides) + 2)


def _beside_grass(frame: Frame) -> bool:
    return frame.service(GrassTable) is not None
