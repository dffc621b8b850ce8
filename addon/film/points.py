"""Film points: with few samples, each is drawn at several points of a pixel.

Light costs more than what reflects it, and is smoother. So each of a few samples draws its surfaces K times, and lights
them once:

    L = 1/K sum over points k  color(k) E(k)

E(k) is the light that arrives at the pixel whose own point lies next to point k, if that is on the surface that point k
sees. Else it is that of the pixels around which lie on that surface (normals within 37 degrees, two pixels of the
tangent plane), and where none does, as on wires, that of what is near, most of what faces alike. Glossy lobes take it
over by their weights times reflectance, of lobes of the same kind. Emission, the visible world, and the colours are
exact at every point.

K = points / samples, from 1 to MOST. Eight points a picture, as a sample beyond them pays better than a point: since
points go to all pixels whose filter covers them (film/filter.py), edges need no more. Fewer where a point costs much
beside a sample's light on this device (film/point_costs.py): without indirect light, or of many triangles.

relMSE at 256x192 and seconds, all light, one point a sample, and K as here: one sample, garden .033 1.2, .015 1.5;
window .086 1.1, .054 1.3; four samples, garden .0087 1.4, .0072 1.6; window .0201 1.9, .0176 2.1. With four points at
16 samples garden has .0019 for .0018, window .0060 for .0060, in 1.4 times the time.

| cost | per point of the film beside the sample's own |
|---|---|
| draws | those of the surface pass, two passes of the film and one of this |
| fetches per pixel | 10 + 4, at edges 9 x 9 |

Bias: at edges, of indirect light, and of direct light where it is not repeated (repeated_light.py), which is that of
the next pixel on the surface; light's own edges are half a pixel wider. It ends where K = 1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

from ..frame.light_paths import DIRECT, INDIRECT, LIGHT_PATHS, MEDIUM, SURFACE, LightPath, named, surface_path
from ..frame.picture import Frame
from ..frame.technique import Param, Service
from ..gfx import images, passes
from ..gfx.library import Program
from ..scene.materials import may_be_glossy
from ..scene.view import VIEW
from ..surfaces.draw import refracts
from .point_costs import PointCosts, costs_of, count_of
from .together import SUM, terms

POINTS = Param(
    "points", "Film points", 8,
    "Points of the pixel filter per picture; with fewer samples than this, each sample is shown at several points, "
    "at most eight",
    1, 1024, draft=1,
)  # fmt: skip
LEAST_WIDTH = 0.1  # pixels: a narrower filter sees a point
LOBES = ("diffuse", "glossy", "transmission")  # by which light is carried over
CARRIERS = tuple(surface_path(lobe, order) for order in (DIRECT, INDIRECT) for lobe in LOBES)
PATHS = tuple(path for path in named(SURFACE) if path in CARRIERS)
REFLECTED = tuple(path for path in PATHS if not path.startswith("transmission"))
FURTHER = tuple(path for path in LIGHT_PATHS if path.origin == SURFACE and path.name not in CARRIERS)
GUIDES = ("position", "normal", "diffuse", "tint", "lobe")


@dataclass(frozen=True)
class AtPoints(Service):
    """What a technique draws at each point of the film into sums of its own: `add` is called with the frame, which
    looks there, the surfaces that are seen (as of surface_bindings), the point's place in the pixel (as
    Frame.film_offset) and its share of the sample."""

    add: Callable[[Frame, dict[str, images.Image], tuple[float, float], float], None]


class SurfaceValues(AtPoints):
    """Values of the surfaces seen that the view layer asks for."""

    name = "values of surfaces"


class Coverage(AtPoints):
    """How much of a pixel each object, material or asset covers."""

    name = "coverage"


class Openness(AtPoints):
    """How open what is seen is to what lies around it."""

    name = "openness"


AT_POINTS = (SurfaceValues, Coverage, Openness)


class OwnPoint:
    """Whether light at a pixel's own point says nothing about other points of the film (frame.shared): then a sample
    shows its own point alone."""

    def __init__(self):
        self.needed = False


def all_alike(frame: Frame) -> bool:
    """Whether all points of a sample would show the same, or what may not be shown."""
    stochastic = any(material.transparent for material in frame.materials.compiled)
    narrow = frame.snapshot.film.filter_width < LEAST_WIDTH and not stochastic
    return narrow or frame.shared(OwnPoint).needed


def points_of_sample(frame: Frame, points: int) -> int:
    """How many of the picture's `points` of the film a sample shows: one where all of them would show the same."""
    if all_alike(frame):
        return 1
    asked = count_of(points, frame.settings.samples)
    return costs(frame).count(asked) if by_costs(frame) else asked


def by_costs(frame: Frame) -> bool:
    """Whether the number of points may follow what they cost here. The three pictures of shadow catchers
    (film/catcher.py) show other objects at the same points, and slices of a picture are drawn by several devices."""
    sliced = frame.settings.samples_to_draw != frame.settings.samples
    return not (all_alike(frame) or frame.snapshot.has_catchers or sliced)


def costs(frame: Frame) -> PointCosts:
    """Of a point of this picture, and of a sample's light."""
    width, height = frame.size
    return costs_of(width * height, frame.geometry.triangles, frame.plan.fills("indirect"))


def lit_paths(frame: Frame) -> tuple[str, ...]:
    """Light paths that techniques of the plan may add to: diffuse and glossy always, through glass by need."""
    further = tuple(path.name for path in FURTHER if path.image in frame.images)
    return (*(PATHS if refracts(frame) else REFLECTED), *further)


def carrier(path: LightPath) -> str:
    """The path as which light of another one is carried over."""
    return surface_path(path.lobe if path.lobe in LOBES else LOBES[0], path.order)


def rounds(paths: tuple[str, ...]) -> list[dict[str, str]]:
    """Passes that carry `paths`: of each what it carries, by the path as which. The six of diffuse, glossy and
    transmitted light go first; any other as that of its lobe and order, those of other lobes as diffuse light."""
    made = [{path: path for path in paths if path in CARRIERS}]
    for path in FURTHER:
        if path.name in paths:
            free = next((one for one in made if carrier(path) not in one), None)
            if free is None:
                made.append(free := {})
            free[carrier(path)] = path.name
    return made


def pixel_paths(frame: Frame) -> tuple[str, ...]:
    """Light paths of the picture that are a pixel's own, whatever surface a point of the film shows."""
    return tuple(name for name in named(MEDIUM) if f"radiance.{name}" in frame.images)


def shown_paths(frame: Frame) -> set[str]:
    """Light paths that techniques of the plan add to and some material may show; Film only clears them."""
    writers = [technique for technique in frame.plan.techniques if technique.name != "film"]
    written = {write.name for technique in writers for write in technique.writes}
    glossy = may_be_glossy(frame.snapshot)
    paths = (*named(SURFACE), *pixel_paths(frame))
    return {path for path in paths if f"radiance.{path}" in written and (glossy or not path.startswith("glossy"))}


@cache
def between_program(paths: tuple[str, ...], drawn: tuple[str, ...], repeated: bool) -> Program:
    """Of the light of these `paths` those that are `drawn` each into an image; SUM among them: all others into one."""
    summed = [path for path in paths if path not in drawn]
    written = {path: f"light.{path}" for path in drawn} | {SUM: terms(summed, "light.{0}")}
    return passes.fullscreen_program(
        "film light between points, edges marked" if repeated else "film light between points",
        "film/between.frag.glsl",
        textures=tuple(
            ("RGBA32F", texture)
            for texture in (
                *(f"{which}_{guide}" for which in ("surface", "known") for guide in GUIDES),
                *(f"light_{path}" for path in paths),
            )
        ),
        blocks=((VIEW, "film_view"),),
        constants=(("VEC2", "offset"),),
        defines=(
            *((("TRANSMISSION", ""),) if len(paths) == len(PATHS) else ()),
            *((("REPEATED", "1"),) if repeated else ()),
            ("WRITE_ALL", " ".join(f"out_{name} = {written[name]};" for name in drawn)),
        ),
        writes_depth=repeated,
        has_no_use=("surface_edit", "frozen_eyes"),  # light that is known has been turned by edits
        outputs=tuple(("VEC4", f"out_{name}") for name in drawn),
    )


BETWEEN = tuple(
    between_program(paths, drawn, repeated)
    for paths in (REFLECTED, PATHS)
    for drawn in (paths, (SUM,), (*REFLECTED[:2], SUM))
    for repeated in (False, True)
)


def light_between(
    frame: Frame,
    paths: tuple[str, ...],
    drawn: tuple[str, ...],
    target: images.Target,
    surfaces: dict[str, images.Image],
    point: int,
    repeated: bool,
    carried: dict[str, str] | None = None,
) -> None:
    """Draw into `target`, an image for each that is `drawn` (as of between_program), what `surfaces` (by names of
    SURFACE_IMAGES), seen at this point of the film, reflect of this sample's light. `repeated`: direct light at edges
    is left to repeated_light.py; the target's depth marks them by 1. `carried`: the paths whose light it is, by those
    of `paths` as which it is carried (as of `rounds`); none: of these themselves."""
    between = tuple(there - own for there, own in zip(frame.film_offset(point), frame.film_offset(frame.sample)))
    carried = carried or {}
    textures = {f"light_{path}": frame.images[f"radiance.{carried.get(path, path)}"] for path in paths}
    textures |= {f"surface_{guide}": surfaces[guide] for guide in GUIDES}
    textures |= {f"known_{guide}": frame.images[f"surface.{guide}"] for guide in GUIDES}
    passes.fullscreen(
        between_program(paths, drawn, repeated), target, textures=textures,
        blocks={"film_view": frame.view_block}, constants={"offset": between},
    )  # fmt: skip
