"""Film points: one sample of light reaches the eye from several points of each pixel's filter.

Light costs far more than what reflects it, and is smoother: in scenes full of edges most of the error of a picture of
few samples is how far edges and textures cover its pixels (at 16 samples nine tenths of it in `instances`, three
quarters in `soft_shadow_garden`). So each sample draws its surfaces K times, and lights them once:

    L = 1/K sum over points k  color(k) E(k)

E(k) is the light that arrives at the pixel's own point of the sample, if that lies on the surface that point k sees, so
inside of surfaces nothing is spread. Else it is that of the pixels around which lie on that surface (normals within 37
degrees, two pixels of the tangent plane), and where none does, as on wires, that of what is near, most of what faces
alike. Glossy lobes take it over by their weights, of lobes of the same kind. Emission, the visible world, and the
colours are exact at every point.

K = points / samples, from 1 to MOST: with as many samples as points each point is lit by itself again. Pictures without
indirect light have a quarter of that, since there a point costs nearly as much as a sample: with half, 16 samples of
the Cornell box took 1.8 times as long, and `soft_shadow_garden` erred as much as with more samples in the same time.

relMSE of direct light at 256x192, 4 and 16 samples, one point a sample, and eight and four: garden .031 .0061 and .016
.0043, instances .089 .0185 and .038 .0125, foliage .049 .0106 and .018 .0055, in 1.1 to 1.25 times the time.

| cost | per point of the film beside the sample's own |
|---|---|
| draws | those of the surface pass, one pass of the film and one of this |
| fetches per pixel | 10 + 4, at edges 9 x 9 |

Bias: at edges, of indirect light, and of direct light where it is not repeated (repeated_light.py), which is that of
the next pixel on the surface; in pixels where light and texture change together. It ends where K = 1.
"""

from __future__ import annotations

from ..frame.run import Frame
from ..frame.technique import Param
from ..frame.view import VIEW
from ..gfx import images, passes
from ..gfx.library import Program
from .surfaces import refracts

POINTS = Param(
    "points", "Film points", 64,
    "Points of the pixel filter in a picture: of fewer samples each shows its light at several, at most eight",
    1, 1024, draft=1,
)  # fmt: skip
LEAST_WIDTH = 0.1  # pixels: a narrower filter sees a point
MOST = 8  # points of the film that share a sample's light
PATHS = tuple(f"{lobe}_{order}" for order in ("direct", "indirect") for lobe in ("diffuse", "glossy", "transmission"))
REFLECTED = tuple(path for path in PATHS if not path.startswith("transmission"))
GUIDES = ("position", "normal", "diffuse", "tint", "lobe")


def count_of(points: int, samples: int) -> int:
    """How many points of the film a sample shows where the picture is to have that many in all."""
    return min(max(-(-points // max(samples, 1)), 1), MOST)


def points_of_sample(frame: Frame, points: int) -> int:
    """How many of the picture's `points` of the film a sample shows: one where all of them would show the same."""
    by_lot = any(material.transparent for material in frame.materials.compiled)
    if frame.snapshot.film.filter_width < LEAST_WIDTH and not by_lot:
        return 1
    count = count_of(points, frame.settings.samples)
    # Without indirect light a sample costs hardly more than a point.
    return count if frame.plan.fills("indirect") else -(-count // 4)


def lit_paths(frame: Frame) -> tuple[str, ...]:
    """Light paths that techniques of the plan may add to: diffuse and glossy always, through glass by need."""
    return PATHS if refracts(frame) else REFLECTED


def _programs(name: str, file: str, guides: bool, repeated: bool = False) -> tuple[Program, Program]:
    """Without light through glass, and with it."""
    seen = tuple(f"{which}_{guide}" for which in ("surface", "known") for guide in GUIDES) if guides else ()
    return tuple(
        passes.fullscreen_program(
            name,
            file,
            textures=tuple(("RGBA32F", texture) for texture in (*seen, *(f"light_{path}" for path in paths))),
            blocks=((VIEW, "film_view"),) if guides else (),
            constants=(("FLOAT", "film_share"), *((("VEC2", "offset"),) if guides else ())),
            defines=(*defines, *((("REPEATED", "1"),) if repeated else ())),
            writes_depth=repeated,
            outputs=tuple(("VEC4", f"out_{path}") for path in paths),
        )
        for paths, defines in ((REFLECTED, ()), (PATHS, (("TRANSMISSION", ""),)))
    )


ADD = _programs("film light", "film/add.frag.glsl", False)
BETWEEN = _programs("film light between points", "film/between.frag.glsl", True)
MARKING = _programs("film light between points, edges marked", "film/between.frag.glsl", True, True)


def add(frame: Frame, paths: tuple[str, ...], target: images.Target, share: float) -> None:
    """Add this sample's light as it was found at the pixels' own points, `share` of it, to the sums in `target`."""
    light = {f"light_{path}": frame.images[f"radiance.{path}"] for path in paths}
    passes.fullscreen(
        ADD[len(paths) == len(PATHS)], target, blend="ADDITIVE_PREMULT", textures=light,
        constants={"film_share": share},
    )  # fmt: skip


def add_between(
    frame: Frame,
    paths: tuple[str, ...],
    target: images.Target,
    surfaces: dict[str, images.Image],
    share: float,
    point: int,
    repeated: bool,
) -> None:
    """Add what `surfaces` (by names of SURFACE_IMAGES), seen at this point of the film, reflect of this sample's
    light. `repeated`: direct light at edges is left to repeated_light.py; the target's depth marks them by 1."""
    between = tuple(there - own for there, own in zip(frame.film_offset(point), frame.film_offset(frame.sample)))
    textures = {f"light_{path}": frame.images[f"radiance.{path}"] for path in paths}
    textures |= {f"surface_{guide}": surfaces[guide] for guide in GUIDES}
    textures |= {f"known_{guide}": frame.images[f"surface.{guide}"] for guide in GUIDES}
    passes.fullscreen(
        (MARKING if repeated else BETWEEN)[len(paths) == len(PATHS)], target,
        blend="ADDITIVE_PREMULT", textures=textures, blocks={"film_view": frame.view_block},
        constants={"film_share": share, "offset": between},
    )  # fmt: skip
