"""How fog dims light on its way: what media let pass, for passes that draw light or look along a view.

A pass that asks how much light arrives from somewhere includes ask/media.glsl and is drawn by what `asked`
(lighting/asked.py) makes of its program. Without a medium nothing of this is compiled.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from ..frame.picture import Frame
from ..frame.technique import Service, Technique
from ..gfx import images, passes
from ..gfx.interface import Interface, answer
from ..gfx.struct import Block
from ..scene.media import ATTENUATION_TEXTURES, Media
from ..scene.view import VIEW
from ..sources import lights

VIEW_PROGRAM = passes.fullscreen_program(
    "media along the view",
    "media/view.frag.glsl",
    textures=(("RGBA32F", "surface_position"),),
    blocks=((VIEW, "film_view"), (lights.SOURCES, "sources")),
    constants=(("INT", "light_count"), ("VEC4", "around_eye")),
    outputs=(("VEC4", "out_through"),),
)


RAY_TEXTURES = tuple(("RGBA32F", name) for name in ("lobe_start", "lobe_way", "surface_position"))
ON_RAYS = passes.fullscreen_program(
    "media on rays of lobes",
    "media/at_hits.frag.glsl",
    textures=(*RAY_TEXTURES, ("RGBA32F", "met_path"), *ATTENUATION_TEXTURES),
    blocks=((VIEW, "film_view"), (lights.SOURCES, "sources")),
    constants=(("INT", "light_count"), ("INT", "ray_number")),
    outputs=(("VEC4", "out_passed"),),
)


@dataclass(frozen=True)
class Rays:
    """Rays that mirrors and glass send on, and what they have met, as textures: lobe_start, lobe_way, met_path,
    surface_position. `number`: how many have gone before; `where`: of passes.fullscreen, which pixels have one;
    `transmission`: whether some may have been bent."""

    textures: dict[str, images.Image]
    number: int
    where: str
    transmission: bool


@dataclass
class MediaService(Service):
    """Media of the frame, ready to be asked."""

    name = "media"
    media: Media

    def fade(
        self, frame: Frame, technique: Technique, rays: Rays, target: images.Target, seen: Block, count: int
    ) -> None:
        """Multiply what passes on `rays` (rgb of the target's image) by what media let pass of it. `seen`: lamps that
        the rays may end at, `count` of them."""
        passes.fullscreen(
            ON_RAYS, target, blend="MULTIPLY", where=rays.where,
            textures={
                **{name: rays.textures[name] for name in (*(name for _, name in RAY_TEXTURES), "met_path")},
                **self.media.attenuation(),
            },
            blocks={"film_view": frame.view_block, "sources": seen},
            constants={"light_count": count, "ray_number": rays.number},
        )  # fmt: skip
        frame.count(technique, "passes")

    @property
    def bindings(self) -> dict[str, images.Image]:
        """Textures of MEDIA."""
        return self.media.attenuation()


@dataclass(frozen=True)
class AroundEye(Service):
    """The camera is in glass or water whose inside absorbs."""

    name = "around the eye"
    absorbed: tuple[float, float, float]  # 1/m


@contextmanager
def passing_view(
    frame: Frame, surfaces: dict[str, images.Image], seen: Block, count: int
) -> Iterator[images.Image | None]:
    """An image of what passes between the eye and the `surfaces` (by their bindings), or infinity; None if all does.
    `seen`: lamps that the camera sees, `count` of them."""
    around = frame.service(AroundEye)
    if around is None and frame.service(MediaService) is None:
        yield None
        return
    textures = {"surface_position": surfaces["surface_position"]}
    program = answer(frame, VIEW_PROGRAM, textures, (MEDIA,))
    with images.borrowed(*frame.size, "RGBA32F") as target:
        passes.fullscreen(
            program, target, textures=textures, blocks={"film_view": frame.view_block, "sources": seen},
            constants={"light_count": count, "around_eye": (*(around.absorbed if around else (0.0,) * 3), 0.0)},
        )  # fmt: skip
        yield target.colors[0]


@dataclass(frozen=True)
class MediaEmission(Service):
    """What media emit along each pixel's view ray in this sample, to be seen as emission of surfaces is."""

    name = "emission of media"
    image: str  # name of the frame's image


@dataclass(frozen=True)
class LightOfMedia(Service):
    """Light that media send back along rays of lobes: `add(frame, technique, rays, target)` adds it to the images of
    direct and indirect light that glossy surfaces, and where `rays.transmission` glass, receive."""

    name = "light of media"
    add: Callable[[Frame, Technique, Rays, images.Target], None]


def _media(frame: Frame) -> dict[str, images.Image] | None:
    service = frame.service(MediaService)
    return None if service is None else service.bindings


MEDIA = Interface("media", "media/media.glsl", ATTENUATION_TEXTURES, _media)


def is_endless(frame: Frame) -> bool:
    """Whether a medium without an end takes all light that comes from infinity."""
    service = frame.service(MediaService)
    return service is not None and service.media.endless
