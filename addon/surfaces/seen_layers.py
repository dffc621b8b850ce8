"""How coloured layers that a sample passes colour the media behind them.

Surfaces behind a coloured pane take its colour as they are drawn (draw.py); light of media is found along view rays,
and asks at each place what is before it (`layers_before` of shaders/media/view_ray.glsl). The image for that holds the
product of the colours of all layers that the sample has passed, and how far away the nearest is: of several layers,
media between them take the colours of all. Light that media send out themselves is one for a ray: it has the colours
where all of the media lie behind a layer.

| cost | per sample, where a material colours what passes it |
|---|---|
| passes | 3: the nearest layer, the product, and how far away it is |
| memory | 1 image; 3 and a depth buffer while they are drawn |
"""

from __future__ import annotations

import weakref
from contextlib import ExitStack
from dataclasses import replace

from ..frame.picture import Frame
from ..frame.technique import Technique
from ..gfx import images, passes
from ..scene.view import VIEW
from .draw import coloring, draw_passed_layers

AWAY = passes.fullscreen_program(
    "layers before media",
    "media/view_layers.frag.glsl",
    textures=(("RGBA32F", "layer_place"), ("RGBA32F", "layer_tint")),
    blocks=((VIEW, "film_view"),),
    outputs=(("VEC4", "out_layers"),),
)


class SeenLayers:
    """The image of this sample (frame.kept)."""

    def __init__(self):
        self._image: images.Image | None = None
        self._of: tuple[weakref.ref[Frame], int] | None = None  # picture and sample that the image is of

    def position(self, frame: Frame, technique: Technique) -> images.Image:
        """surface.position, beside which `view_layers` lies where some material colours what passes it."""
        position = frame.images["surface.position"]
        if not coloring(frame):
            return position
        if self._image is None or self._image.size != frame.size:
            self.release()
            self._image = images.pool.take(*frame.size, "RGBA32F")
        if self._of is None or self._of[0]() is not frame or self._of[1] != frame.sample:
            self._draw(frame, technique, position)
            self._of = weakref.ref(frame), frame.sample
        return replace(position, beside={**position.beside, "view_layers": self._image})

    def _draw(self, frame: Frame, technique: Technique, position: images.Image) -> None:
        with ExitStack() as stack:
            place, tint, other, depth = (
                stack.enter_context(images.borrowed(*frame.size, kind)).colors[0]
                for kind in ("RGBA32F", "RGBA32F", "RGBA32F", "DEPTH_COMPONENT32F")
            )
            draw_passed_layers(frame, technique, images.Target((place, tint, other), depth), position)
            passes.fullscreen(
                AWAY, images.Target((self._image,)), textures={"layer_place": place, "layer_tint": tint},
                blocks={"film_view": frame.view_block},
            )  # fmt: skip
        frame.count(technique, "passes")

    def release(self) -> None:
        if self._image is not None:
            images.pool.give(self._image)
        self._image = self._of = None
