"""Filter for samples that are shown alone: the mean of neighbouring pixels' light.

A masked mean over 4x4 pixels, of those on the same surface (normals within 37 degrees, within two pixels of the tangent
plane), of light without the surface's colour, so that textures stay: neighbours, whose random numbers
shaders/ssdo/fan.glsl stratifies together. For noisier estimates a second time over pixels three apart, 13x13 in all, of
those that differ by no more than four standard errors of both: a dark pixel has too small an error by its own account,
and with a stricter test darkness spreads. Single samples of instant radiosity lose half to four
fifths of their squared error: relMSE over the reference's noise at 96x72, mean of four seeds, with 128
virtual lights and before what reflects was drawn at several points of a pixel,

| | Cornell box | window | hall | door | courtyard | lamp |
|---|---|---|---|---|---|---|
| as drawn (one seed) | 0.55 | 0.80 | 0.55 | 2.8 | 0.24 | 0.28 |
| filtered | 0.20 | 0.35 | 0.24 | 0.44 | 0.09 | 0.09 |

    reflected = albedo * mean over neighbours on the surface of  arriving

Edges and textures need more points than light that is as smooth as this: film/points.py has them.

| cost | per pass |
|---|---|
| fetches per pixel | 16 x 4 |

A viewport at rest shows its first samples in the same way: there the sums are filtered on their way to the screen, with
the mean colours of their samples, and stay as they are.

Bias: light is spread over 4 (13) pixels of a surface, contact shadows first of all. Samples that are averaged are not
filtered, so it does not stay.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from ..frame.picture import Frame
from ..frame.technique import Technique
from ..gfx import images, passes
from ..scene.view import VIEW
from ..surfaces.draw import surface_bindings

APART = 3  # pixels, of those in the second mean
FEW = 8  # samples at rest in a viewport: up to here it shows indirect light filtered
MEAN, MEAN_OF_REFLECTED, MEAN_AGAIN, MEAN_OF_LOBES, MEAN_OF_LOBES_AGAIN = (
    passes.program_of_pixels(
        f"mean of neighbours{of}",
        "neighbours/mean.glsl",
        textures=(
            ("RGBA32F", "surface_position"), ("RGBA32F", "surface_normal"), ("RGBA32F", "surface_diffuse"),
            ("RGBA32F", "light_in"),
        ),
        blocks=((VIEW, "film_view"),),
        constants=(("INT", "stride"),),
        defines=defines,
        outputs=(("VEC4", "out_arriving"),),
    )
    for of, defines in (
        ("", ()),
        (", of reflected light", (("REFLECTED", ""),)),
        (", again", (("WITH_VARIANCE", ""),)),
        (", of all lobes", (("REFLECTED", ""), ("LOBES", ""))),
        (", of all lobes again", (("WITH_VARIANCE", ""), ("LOBES", ""))),
    )
)  # fmt: skip
COLOR = passes.fullscreen_program(
    "color of all that is diffuse",
    "neighbours/color.frag.glsl",
    textures=tuple(("RGBA32F", f"surface_{guide}") for guide in ("position", "normal", "diffuse", "tint", "lobe")),
    outputs=(("VEC4", "out_color"),),
)
REFLECT = passes.fullscreen_program(
    "reflected light",
    "neighbours/reflect.frag.glsl",
    textures=(("RGBA32F", "surface_diffuse"), ("RGBA32F", "arriving")),
    outputs=(("VEC4", "out_diffuse"),),
)


def shown_alone(frame: Frame) -> bool:
    """Whether this sample is a picture by itself, so that neighbours have to make up for missing samples. With light of
    pictures before (techniques/history.py) they do so once it is joined."""
    if any(technique.remembers for technique in frame.plan.techniques):
        return False
    return frame.is_first and (frame.settings.samples == 1 or frame.settings.schedule.is_draft)


def reflect(frame: Frame, technique: Technique, arriving: images.Image, path: str, noisy: bool = False) -> None:
    """Add what surfaces reflect of `arriving` to an image of radiance. If the sample is shown alone, of its mean over
    4x4 pixels, or 13x13 where it is `noisy`.
    """
    if not shown_alone(frame):
        _reflect(frame, arriving, path, "ADDITIVE_PREMULT")
        return
    with images.borrowed(*frame.size, "RGBA32F") as near, images.borrowed(*frame.size, "RGBA32F") as far:
        _mean(frame, MEAN, arriving, near, 1)
        if noisy:
            _mean(frame, MEAN_AGAIN, near.colors[0], far, APART)
        _reflect(frame, (far if noisy else near).colors[0], path, "ADDITIVE_PREMULT")
    frame.count(technique, "filtered samples")


def smooth(frame: Frame, technique: Technique, path: str) -> None:
    """Filter an image of diffuse radiance that holds this sample alone over 13x13 pixels, if it is shown alone."""
    if not shown_alone(frame):
        return
    lobes = frame.materials.soft
    mean, again = (MEAN_OF_LOBES, MEAN_OF_LOBES_AGAIN) if lobes else (MEAN_OF_REFLECTED, MEAN_AGAIN)
    with ExitStack() as stack:
        near, far = (stack.enter_context(images.borrowed(*frame.size, "RGBA32F")) for _ in range(2))
        color = frame.images["surface.diffuse"]
        if lobes:
            of_all = stack.enter_context(images.borrowed(*frame.size, "RGBA32F"))
            surfaces = surface_bindings(frame)
            passes.fullscreen(COLOR, of_all, textures={name: surfaces[name] for _, name in COLOR.textures})
            color = of_all.colors[0]
        _mean(frame, mean, frame.images[path], near, 1, color)
        _mean(frame, again, near.colors[0], far, APART, color)
        _reflect(frame, far.colors[0], path, "NONE", color)
    frame.count(technique, "filtered samples")


def means(frame: Frame, arriving: images.Image, near: images.Target, far: images.Target) -> Iterator[None]:
    """Means of `arriving` light over 4x4 and 13x13 pixels, in parts, one for each program."""
    _mean(frame, MEAN, arriving, near, 1)
    yield
    _mean(frame, MEAN_AGAIN, near.colors[0], far, APART)


@contextmanager
def shown_sum(frame: Frame, path: str) -> Iterator[images.Image]:
    """An image of sums of diffuse radiance as it is to be shown: filtered while a viewport has few samples.

    The sums themselves stay as they are, and the picture of all samples is theirs.
    """
    name = f"radiance.{path}"
    if not frame.settings.schedule.shows_each or frame.samples_done >= min(FEW, frame.settings.samples):
        yield frame.held.to_show(name)
        return
    with ExitStack() as stack:
        near, far, shown = (stack.enter_context(images.borrowed(*frame.size, "RGBA32F")) for _ in range(3))
        color = frame.images["color.diffuse"]
        _mean(frame, MEAN_OF_REFLECTED, frame.held.to_show(name), near, 1, color)
        _mean(frame, MEAN_AGAIN, near.colors[0], far, APART, color)
        textures = {"surface_diffuse": color, "arriving": far.colors[0]}
        passes.fullscreen(REFLECT, shown, textures=textures)
        yield shown.colors[0]


def _mean(frame: Frame, program, light, target: images.Target, stride: int, color: images.Image | None = None) -> None:
    surfaces = {f"surface_{name}": frame.images[f"surface.{name}"] for name in ("position", "normal")}
    surfaces["surface_diffuse"] = color or frame.images["surface.diffuse"]
    passes.each_pixel(
        program, target, textures={**surfaces, "light_in": light}, blocks={"film_view": frame.view_block},
        constants={"stride": stride},
    )  # fmt: skip


def _reflect(frame: Frame, arriving: images.Image, path: str, blend: str, color: images.Image | None = None) -> None:
    textures = {"surface_diffuse": color or frame.images["surface.diffuse"], "arriving": arriving}
    passes.fullscreen(REFLECT, frame.target(path), blend=blend, textures=textures)
