"""Photons of caustics: bundles of light that specular surfaces send to diffuse ones, as records in images.

The texels of a light's view of the casters (light_views.py) are photons of the flux

    Phi = E(P) * A,   E irradiance across the light's direction at P,  A = d_omega |P - light|^2, or a texel's area

which meet a material's own lobe at P: refracted or mirrored, one grid for each. From there a ray goes on through the
hierarchy of all triangles, from interface to interface with the means of their materials (glass_interfaces.py), until
it meets a surface that is no caster. There each photon stands for an ellipse, by its neighbours of the same path
(photon differentials on a grid, Kim, Ray Tracing Gems 2019):

    Sigma = k^2 / 2 * sum over neighbours (x' - x)(x' - x)^T  +  (blur^2 + least^2) I
    E(x)  = Phi * 3 max(0, 1 - q)^2 / (pi sqrt(det Sigma)),   q = x^T Sigma^-1 x

All photons of a sample share the point of the light, the numbers that a rough lobe draws from, and those that choose
between mirrored and bent at later interfaces (in proportion to Fresnel's reflectance, and shared out evenly over the
samples that have photons). So the photons of a sample are one smooth map, which needs few of them, and the mean over
the samples is the integral over light, lobes and paths. The grid is shifted below a texel in each sample and k falls
with their number, so that the mean converges. `blur` is what the light's extent and the lobe's width, which the samples
share out, leave to each: at one sample all of it; points of a light lie so much nearer to its middle.

| cost | per sample, view and lobe |
|---|---|
| draws | the surfaces that the view sees, into six images |
| rays | per photon 1 for each interface on its way, and 1 |
| passes | 2 of the grid's side squared; bytes 10 x 16 per texel |

Bias: footprints blur by about their size, and none of it remains as samples grow. Interfaces behind the first have
their material's means and no bumps; their colour is that of the place as far as opacity_maps.py knows it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
from math import gcd

import numpy as np

from ..frame.picture import Frame
from ..frame.technique import Technique
from ..gfx import images, passes
from ..gfx.library import Program
from ..gfx.struct import Block, Struct
from ..materials import gloss
from ..scene import acceleration
from ..scene.view import VIEW
from ..sources import lights
from ..surfaces.draw import SURFACE_TEXTURES
from ..surfaces.reflectance import Reflectance
from . import caustic_casters, photon_grids
from .asked import asked
from .caustic_sources import sources_of
from .glass_interfaces import most_interfaces, upload_interfaces
from .light_views import REFLECTED, REFRACTED, LightBuffers, LightView, views_of
from .media import is_endless

FOUND = ("photon_points", "photon_normals", "photon_fluxes")
EMISSION = Struct(
    "Emission",
    ("vec4", "box_low"),  # of the casters that the view is about
    ("vec4", "box_high"),  # w: widest roughness of a mirror that throws caustics
    ("vec4", "lobe"),  # two numbers that all photons of the sample draw their lobes from, two for later interfaces
    # What a sample leaves to blur: of the light's extent, of lobes; z: 0 in a picture of one sample; w: samples in
    # all, 0 unknown, -1 one.
    ("vec4", "spread"),
    # Of samples of unlike weight: what those that mirror at one of the first four inner faces lack or have more than
    # others, as a factor of what passes in the rest.
    ("vec4", "passing"),
    ("float", "mirroring"),  # and of what they mirror
    ("vec4", "absorbed"),  # by insides, 1/m, in the mean
    ("int", "interfaces"),  # at most, after the first
    ("int", "bends"),  # 1: photons of the refracted lobe
)

ALL_WANTED = 4  # of photon_gloss, as in shaders/caustics/photon.frag.glsl

PHOTONS = passes.fullscreen_program(
    "photons",
    "caustics/photon.frag.glsl",
    textures=(
        *acceleration.HIERARCHY_TEXTURES, *SURFACE_TEXTURES,
        *(("RGBA32F", name) for name in ("energy_table", "reflectance", "interface_table")),
    ),
    blocks=((VIEW, "film_view"), (lights.SOURCES, "sources"), (EMISSION, "photon_light")),
    constants=(("FLOAT", "offset_size"), ("INT", "photon_roll"), ("INT", "photon_gloss"), ("INT", "photon_diffuse")),
    outputs=(("VEC4", "out_point"), ("VEC4", "out_normal"), ("VEC4", "out_flux")),
)  # fmt: skip
MAP = (("RGBA32F", "receiver_position"), ("RGBA32F", "receiver_normal"))
BEHIND = tuple(("RGBA32F", f"behind_{name}") for name in ("position", "normal", "tint", "lobe", "emission"))
LOOKUPS = passes.fullscreen_program(
    "photons by look-ups",
    "caustics/lookup.frag.glsl",
    textures=(*SURFACE_TEXTURES, *BEHIND, *MAP, ("RGBA32F", "energy_table")),
    blocks=((VIEW, "film_view"), (VIEW, "map_view"), (lights.SOURCES, "sources"), (EMISSION, "photon_light")),
    outputs=(("VEC4", "out_point"), ("VEC4", "out_normal"), ("VEC4", "out_flux")),
)


@cache
def footprints_program(walls: bool) -> Program:
    """Records of photons. `walls`: they end at what stands on their surface, which rays look for."""
    return passes.fullscreen_program(
        "photon footprints",
        "caustics/footprint.frag.glsl",
        textures=(
            *(("RGBA32F", name) for name in FOUND), *(acceleration.HIERARCHY_TEXTURES if walls else ()),
        ),
        blocks=((VIEW, "film_view"),),
        constants=(
            ("FLOAT", "widening"), ("FLOAT", "least_pixels"), ("FLOAT", "longest"),
            *((("FLOAT", "offset_size"),) if walls else ()),
        ),
        defines=(("WALLS", ""),) if walls else (),
        outputs=(("VEC4", "out_centre"), ("VEC4", "out_first"), ("VEC4", "out_second"), ("VEC4", "out_value")),
    )  # fmt: skip


FOOTPRINTS, WALLED = footprints_program(False), footprints_program(True)
# Of footprints beside the way to the neighbours, and the exponent of their fall with samples. A grid's longest waves
# have amplitudes of 48 J3(q) / q^3, q = 2 pi times the widening. The first zero of J3 has none: few samples have that.
WIDENING, FALL, WIDENING_FEW = 1.443, -1.0 / 5.0, 1.0154
FEW = 16  # samples of a light, below which each has several of its points
FEW_LOBES = 64  # and below which each has all lobes of a material: one of three colours too often is a tint
VIEWS = 4  # of lights and casters in a sample, in the mean, where lights may take turns
CHOICES = 0.569840291  # from one interface's number to the next, as in caustics/photon.frag.glsl
WIDE = 0.1  # tangent of half a light's angle, seen from casters, from which on one point is not like the others
VERY_WIDE, MANY = 0.3, 128  # and from which on its image is wide, too: below so many samples it has several points
MOST_POINTS = 4  # of a wide light in a sample, each with as much less of the grid
MOST_IN_ALL = 32  # in a whole picture of few samples: each is blurred by the light's width over the root of all
LEAST_SIDE, LEAST_PART = 48, 32  # photons along a side where points share a grid, and where that is a coarser one
MOST_REACH = 2.0  # of a light, in diagonals of the casters, whose points share a map
SPREAD_SIDE = 64  # where nothing makes light converge
LONGEST = 12.0  # way to a neighbour, in ways of photons that nothing bends: beyond it, the bundle is torn


@dataclass(frozen=True)
class LitView:
    """A light's view of casters in one sample."""

    emitter: lights.Emitter  # or what stands for one (caustic_sources.py)
    sample: np.ndarray  # the point of the light that it looks from
    view: LightView
    lobes: tuple[int, ...]  # that photons may take there
    index: int  # how many points of this light have had photons before
    count: int  # how many points of it the picture has, or has had up to now
    weight: float  # of the point's photons: they stand for the samples that have none
    strata: int = 0  # points of it that share out the choices at inner faces; 0: not known; -1: the likelier way alone
    samples: int = 0  # of the picture, where each half of them shares out its number over half of these points
    middle: LightView | None = None  # from the light's middle, if one map serves all of its points in a sample


@dataclass(frozen=True)
class Bundle:
    """Photons of one view and lobe: images of FOUND, `side` along both sides."""

    found: tuple[images.Image, ...]
    side: int
    count: int  # of samples that share the light
    traced: bool  # not by look-ups


def _width(emitter: lights.Emitter, low: np.ndarray, high: np.ndarray) -> float:
    """Tangent of half the angle that a light spans, seen from the middle of a box."""
    if emitter.kind == lights.SUN:
        return float(np.tan(min(emitter.radius, 1.5)))
    far = float(np.linalg.norm((low + high) / 2 - emitter.position(emitter.middle())))
    return emitter.reach / max(far, 1e-30)


def _points(width: float, count: int, most_of_few: bool, on_gloss: bool, spreads: bool) -> int:
    """How many points of a light of this width (_width) photons of one sample come from, where `count` samples share
    them: several of a wide one where samples are few. `most_of_few`: so many where it is very wide or photons
    shine `on_gloss`, too, that few samples have MOST_IN_ALL together. `spreads`: nothing makes light converge."""
    few, most = (MANY, 2 * MOST_POINTS) if width > VERY_WIDE else (FEW, MOST_POINTS)
    if most_of_few and (width > VERY_WIDE or on_gloss):
        most = max(MOST_IN_ALL // count, most)
    points = min(max(few // count, 1), most) if width > WIDE else 1
    points = 1 << points.bit_length() - 1  # so that all of them are evenly spread
    return min(points, max(MOST_POINTS // count, 1)) if spreads else points


def _half_width(emitter: lights.Emitter) -> float:
    """Radius of a disc as large as the light is, m; of suns the tangent of half their angle."""
    if emitter.kind == lights.SUN:
        return float(np.tan(min(emitter.radius, 1.5)))
    return float(np.sqrt(emitter.area / np.pi)) if emitter.has_span else emitter.radius


def middle_view(emitter: lights.Emitter, low: np.ndarray, high: np.ndarray, size: float) -> LightView | None:
    """A lamp's view from its middle past the casters, where what its other points send there lands in it, too."""
    if emitter.light is None or emitter.kind == lights.SUN or emitter.reach > MOST_REACH * np.linalg.norm(high - low):
        return None
    found = views_of(emitter, emitter.middle(), low, high, SPREAD_SIDE, (0.5, 0.5), size)
    return found[0] if len(found) == 1 else None


def drawn_in(emitter: lights.Emitter, sample: np.ndarray, count: int) -> np.ndarray:
    """One of `count` points of a lamp, nearer to its middle: each is blurred by the lamp's width over the root of their
    number, so that all together are as wide as the lamp. Points of meshes and of the world stay."""
    if emitter.light is None:
        return sample
    middle = emitter.middle()
    moved = middle + np.sqrt(1.0 - 1.0 / max(count, 1)) * (sample - middle)
    return moved / np.linalg.norm(moved) if emitter.kind == lights.SUN else moved


def lattice(k: int, count: int) -> float:
    """Number `k` of `count` at equal distances in 0..1, in an order that leaves no gap for long: steps of about the
    golden section."""
    step = next(one for one in range(round(0.618034 * count), 0, -1) if gcd(one, count) == 1) if count > 1 else 1
    return k * step % count / count


def widening(count: int) -> float:
    """Half axes of footprints, in ways to a photon's neighbours, where `count` samples share the light."""
    return WIDENING if count <= 1 else min(WIDENING_FEW, WIDENING * count**FALL)


def balanced(light: LitView, moved: float) -> tuple[np.ndarray, float]:
    """Factors of what passes at the first four inner faces and of what is mirrored, where one in `strata` mirrors:
    weights of the two halves of the samples differ (sampling/turns.py), so that it matters in which that one is."""
    passing, count = np.ones(4), light.strata
    if not light.samples or count % 2:
        return passing, 1.0
    first, second = light.samples // 2 - 1, light.samples - light.samples // 2
    weights = np.repeat([first, second], count // 2) * 2.0 / (first + second)  # 1 in the mean
    numbers = np.array([lattice(k, count) for k in range(count)]) + moved
    for face in range(4):
        mirrors = int(np.argmin((numbers + face * CHOICES) % 1.0))
        passing[face] = (count - 1) / (count - weights[mirrors])
    return passing, 1.0 / weights[light.index % count]


class Photons:
    """Finds the photons of each sample. A technique owns one."""

    def __init__(self):
        self.buffers, self._behind = LightBuffers(), LightBuffers()
        self._sources = lights.Sources()
        self._interfaces: images.Image | None = None
        self._emission: Block | None = None
        self._parts = 1
        self._others: list = []  # emissive meshes and the bright world, where they are answered for
        self._found: images.Target | None = None
        self._footprints: images.Target | None = None

    def begin(self, frame: Frame, casters: caustic_casters.Casters) -> None:
        """Before the first sample of a frame."""
        frame.kept(Reflectance).update(frame)
        self._interfaces = upload_interfaces(frame.materials.compiled, casters.going_on)
        self._parts = most_interfaces([frame.materials.compiled[k] for k in casters.refracting])
        absorbed = [frame.materials.compiled[k].absorbed_inside for k in casters.refracting]
        self._absorbed = np.mean(absorbed, axis=0) if absorbed else np.zeros(3)
        self._others = sources_of(frame, casters)

    def views(
        self, frame: Frame, casters: caustic_casters.Casters, side: int, turn: tuple[int, int] | None = None,
        fitted: bool = False,
    ) -> Iterator[LitView]:  # fmt: skip
        """Views of the lights whose turn it is in this sample, `side` photons along each side; `fitted`: at most that
        many, by what shows (photon_grids.py). `turn`: how many samples had photons before, and how many have in all,
        where not all samples do and whoever asks weighs them."""
        alone = frame.settings.schedule.known_total and frame.settings.samples == 1
        whole = frame.settings.schedule.known_total
        on_gloss = bool(frame.shared(caustic_casters.Answered).on_gloss)
        kept = whole and not frame.settings.schedule.is_draft
        asked_of = {"most_of_few": kept, "on_gloss": on_gloss, "spreads": casters.spreads}
        boxes = list(caustic_casters.boxes_of(frame, casters))
        most = min(side, SPREAD_SIDE) if casters.spreads else side
        answered, grids = self._rounds(frame, casters)[0], {}
        if fitted and answered and boxes:
            grids = {id(one): row for one, row in zip(answered, photon_grids.sides(frame, answered, boxes, most))}
        for emitter, index, count, weight in self._turns(frame, casters, turn):
            key = caustic_casters.key_of(emitter)
            if key in casters.dark:
                continue
            wanted = casters.wanted(key)
            wanted |= (REFRACTED | REFLECTED) * (on_gloss and key != caustic_casters.MESHES)
            if not wanted:
                continue
            # All of them: what is wanted is told by the last interface of a path, not by the first.
            lobes = (REFRACTED, REFLECTED) if casters.refracting else (REFLECTED,)
            sharing, of_turns = count, 0
            if turn is not None and count > 1:
                # Sample 0 has its photons before it is known how many others do: those are a set without it.
                index, sharing, of_turns = max(index - 1, 0), count - (index > 0), frame.settings.samples
            for (low, high), grid in zip(boxes, grids.get(id(emitter), [most] * len(boxes))):
                parts_of = partial(_points, _width(emitter, low, high), **asked_of)
                parts = parts_of(sharing)
                first, points = index * parts, count * parts
                if not whole:  # while a view grows, its later samples have fewer: from MANY on one each
                    first = sum(map(parts_of, range(1, min(index, MANY) + 1))) + max(index - MANY, 0)
                    points = first + parts
                strata = sharing * parts if whole else 0  # 1: see _drawn
                strata = -1 if of_turns and sharing == count else strata
                shown = middle_view(emitter, low, high, frame.geometry.size) if parts > 1 else None
                finest = round((32 if casters.spreads else LEAST_SIDE) * grid / most)
                texels = max(round(grid / np.sqrt(parts)), min(max(finest, LEAST_PART), grid))
                for number in range(first, first + parts):
                    middle = alone and parts == 1
                    drawn = frame.random_volume("light", number, evenly=parts > 1 and emitter.is_flat)
                    sample = emitter.middle() if middle else drawn_in(emitter, emitter.sample(*drawn), points)
                    shift = frame.random("caustics/grid", number)
                    for view in views_of(emitter, sample, low, high, texels, shift, frame.geometry.size):
                        shared = emitter, sample, view, lobes, number, points, weight / parts
                        yield LitView(*shared, strata, of_turns, shown)

    def _rounds(self, frame: Frame, casters: caustic_casters.Casters) -> tuple[list[lights.Emitter], int]:
        """The lights that are answered for, and how many samples have photons of all of them. Where many lights see
        many casters and only the mean of a known number of samples is shown, lights take turns: the photons of a view
        are smooth, and VIEWS of them in a sample cost about as much as its other light."""
        settings = frame.settings
        endless = is_endless(frame)
        answered = [
            one for one in (*frame.emitters, *self._others)
            if caustic_casters.key_of(one) in casters.lights and not (endless and one.kind == lights.SUN)
        ]  # fmt: skip
        if not settings.schedule.known_total or settings.may_end_early:
            return answered, 1
        return answered, max(1, min(settings.samples, -(-len(answered) * len(casters.low) // VIEWS)))

    def _turns(self, frame: Frame, casters: caustic_casters.Casters, turn: tuple[int, int] | None):
        """The lights of this sample, with the last three fields of their views."""
        settings = frame.settings
        answered, rounds = self._rounds(frame, casters)
        if turn is not None:
            yield from ((emitter, *turn, 1.0) for emitter in answered)
            return
        for number, emitter in enumerate(answered):
            if frame.sample % rounds == number % rounds:
                count = (
                    len(range(number % rounds, settings.samples, rounds))
                    if settings.schedule.known_total
                    else frame.sample + 1
                )
                yield (
                    emitter,
                    frame.sample // rounds,
                    count,
                    settings.samples / count if settings.schedule.known_total else 1.0,
                )

    def all_at_once(self, frame: Frame, casters: caustic_casters.Casters) -> bool:
        """Whether a sample that has photons has those of all lights."""
        return self._rounds(frame, casters)[1] == 1

    def resting(self, frame: Frame, casters: caustic_casters.Casters) -> set[str]:
        """Keys of the lights whose turn it is not in this sample."""
        answered, rounds = self._rounds(frame, casters)
        resting = (one for k, one in enumerate(answered) if frame.sample % rounds != k % rounds)
        return {caustic_casters.key_of(one) for one in resting}

    def traced(
        self, frame: Frame, technique: Technique, casters: caustic_casters.Casters, light: LitView, interfaces: int,
        on_gloss: int = 0, all_wanted: bool = False,
    ) -> Iterator[Bundle]:  # fmt: skip
        """Photons of a view by rays, over up to `interfaces` after the first. Each bundle is valid until the next.
        `on_gloss`: glossy lobes take those that smooth glass lets pass (REFRACTED) and mirrors (REFLECTED), a sum.
        `all_wanted`: also those that neither these nor diffuse surfaces are to have."""
        target = self._target("_found", light.view.side, len(FOUND))
        for block, bound in self._drawn(frame, technique, casters, light, interfaces):
            textures = {
                **frame.hierarchy("transmission").textures, **bound["textures"],
                "reflectance": frame.kept(Reflectance).image, "interface_table": self._interfaces,
            }  # fmt: skip
            passes.fullscreen(
                asked(frame, PHOTONS, textures),
                target,
                textures=textures,
                blocks={"film_view": block, **bound["blocks"]},
                constants={
                    "offset_size": 1e-6 * frame.geometry.size, "photon_roll": light.index,
                    "photon_gloss": on_gloss | ALL_WANTED * all_wanted,
                    "photon_diffuse": casters.wanted(caustic_casters.key_of(light.emitter)),
                },
            )  # fmt: skip
            yield self._bundle(frame, technique, target, light, True)

    def looked_up(
        self, frame: Frame, technique: Technique, casters: caustic_casters.Casters, light: LitView, map_block: Block,
        receivers: dict[str, images.Image],
    ) -> Iterator[Bundle]:  # fmt: skip
        """The same by look-ups in what the light's views show: the casters' nearest and farthest surfaces, and
        `receivers`, images of MAP in the view `map_block`."""
        wanted = casters.wanted(caustic_casters.key_of(light.emitter))
        light = replace(light, lobes=tuple(lobe for lobe in light.lobes if lobe & wanted))  # the last interface's, too
        target = self._target("_found", light.view.side, len(FOUND))
        behind = self._behind.farthest(frame, technique, light.view, casters.refracting)
        for block, bound in self._drawn(frame, technique, casters, light, 1):
            textures = {**bound["textures"], **{name: behind[name] for _, name in BEHIND}, **receivers}
            passes.fullscreen(
                asked(frame, LOOKUPS, textures),
                target,
                textures=textures,
                blocks={"film_view": block, "map_view": map_block, **bound["blocks"]},
            )  # fmt: skip
            yield self._bundle(frame, technique, target, light, False)

    def _drawn(self, frame, technique, casters, light: LitView, interfaces: int):
        """Draws the casters' nearest surfaces by each lobe, and yields what programs that find photons bind."""
        emitter, view, count = light.emitter, light.view, light.count
        share = float(count) ** -0.5
        wide = _half_width(emitter)
        u, later = frame.random("caustics/lobe", light.index), frame.random("caustics/interface", light.index)
        passing, mirroring = np.ones(4), 1.0
        if light.strata > 1:  # evenly, moved by the same for all: each part has one number at each interface
            moved = frame.random("caustics/interface", 0)[1]
            later = later[0], (lattice(light.index, light.strata) + moved) % 1.0
            passing, mirroring = balanced(light, moved)
        strata = float(light.strata)
        if count == 1:
            u, later, strata = (0.5, 0.5), (0.5, 0.5), -1.0
        # Of several lobes each by itself: one alone would tint all.
        parts = self._parts if count < FEW_LOBES or light.strata < 0 else 1
        sources = self._sources.set([emitter.row(light.sample, 0, 0, light.weight / parts)])
        choice = frame.random_volume("caustics/interface", light.index)[2]
        if parts > 1 and light.strata > 0:
            choice = (light.index % light.strata + 0.5) / light.strata
        drawn = (
            one
            for part in range(parts)
            for one in self.buffers.draw(
                frame, technique, view, casters.materials, light.lobes, (choice + part) / parts
            )
        )  # fmt: skip
        for lobe, block, surfaces in drawn:
            values = {
                "box_low": (*view.low, 0.0), "box_high": (*view.high, gloss.THROWS),
                "lobe": (*u, *later), "spread": (share * wide, share, float(count > 1), strata),
                "absorbed": (*self._absorbed, 0.0), "passing": tuple(passing), "mirroring": float(mirroring),
                "interfaces": interfaces, "bends": int(lobe == REFRACTED),
            }  # fmt: skip
            if self._emission is None:
                self._emission = Block(EMISSION, **values)
            else:
                self._emission.update(**values)
            textures = {**surfaces, "energy_table": frame.materials.energy_table}
            yield block, {"textures": textures, "blocks": {"sources": sources, "photon_light": self._emission}}

    def _bundle(
        self, frame: Frame, technique: Technique, target: images.Target, light: LitView, traced: bool
    ) -> Bundle:
        frame.count(technique, "passes")
        frame.count(technique, "photons", target.size[0] ** 2)
        return Bundle(target.colors, target.size[0], light.count, traced)

    def footprints(
        self, frame: Frame, technique: Technique, bundle: Bundle, onto: Block, least_pixels: float
    ) -> tuple[images.Image, ...]:
        """Records of kernels/splats.py for a bundle, at least `least_pixels` pixels of the view `onto` wide."""
        target = self._target("_footprints", bundle.side, 4)
        textures = dict(zip(FOUND, bundle.found))
        constants = {"widening": widening(bundle.count), "least_pixels": least_pixels, "longest": LONGEST}
        if bundle.traced:
            textures |= frame.hierarchy("transmission").textures
            constants["offset_size"] = 1e-6 * frame.geometry.size
        passes.fullscreen(
            footprints_program(bundle.traced),
            target,
            textures=textures,
            blocks={"film_view": onto},
            constants=constants,
        )
        frame.count(technique, "passes")
        return target.colors

    def _target(self, name: str, side: int, count: int) -> images.Target:
        target = getattr(self, name)
        if target is None or target.size != (side, side):
            self._give(target)
            target = images.Target(tuple(images.pool.take(side, side, "RGBA32F") for _ in range(count)))
            setattr(self, name, target)
        return target

    @staticmethod
    def _give(target: images.Target | None) -> None:
        for image in target.colors if target is not None else ():
            images.pool.give(image)

    def release(self) -> None:
        self._give(self._found)
        self._give(self._footprints)
        self._found = self._footprints = self._interfaces = self._emission = None
        self.buffers.release()
        self._behind.release()
        self._sources.release()
