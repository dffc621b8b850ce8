"""What layers emit that a sample passes, where some are coloured: each one's light has the colours of those before it.

Layers are taken apart from back to front (Everitt, "Interactive Order-Independent Transparency", 2001): the farthest
one before what was found last is drawn, what is seen so far takes its colour, and what it emits is added. Nearer layers
than the `MOST`th colour what lies behind them, but not each other.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack

from ..gfx import images, passes

MOST = 4  # layers that are taken apart; each is a pass over all of them
NONE_LEFT = (0.0, 0.0, 0.0, -1.0)  # in the place of where a layer lies

Submit = Callable[[images.Image], None]  # draws all layers before what lies at the positions in an image


def add_in_order(target: images.Target, position: images.Image, submit: Submit) -> int:
    """Add what layers before the surfaces at `position` emit to a target of one image; returns the number of passes.
    `submit` draws with shaders/surface/layer.frag.glsl."""
    with ExitStack() as stack:

        def borrowed(image_format: str = "RGBA32F") -> images.Image:
            return stack.enter_context(images.borrowed(*target.size, image_format)).colors[0]

        seen, tint, glow, depth = borrowed(), borrowed(), borrowed(), borrowed("DEPTH_COMPONENT32F")
        places = borrowed(), borrowed()
        images.Target((seen,)).clear((0.0, 0.0, 0.0, 0.0))
        for k in range(MOST):
            found = places[k % 2]
            layer = images.Target((found, tint, glow), depth)
            layer.clear((0.0, 0.0, 0.0, 0.0), 0.0)
            images.Target((found,)).clear(NONE_LEFT)
            images.Target((tint,)).clear((1.0, 1.0, 1.0, 1.0))
            with passes.drawing(layer, depth_test="GREATER"):
                submit(position)
            _multiply(seen, tint)
            _add(images.Target((seen,)), glow)
            position = found
        left = places[MOST % 2]
        for held, blend in (((left, seen, glow), "MULTIPLY"), ((left, tint, seen), "ADDITIVE_PREMULT")):
            with passes.drawing(images.Target(held), blend=blend, depth_test="NONE", depth_write=False):
                submit(position)
        _add(target, seen)
    return MOST + 2


def _multiply(image: images.Image, by: images.Image) -> None:
    passes.fullscreen(passes.COPY, images.Target((image,)), blend="MULTIPLY", textures={"original": by})


def _add(target: images.Target, image: images.Image) -> None:
    passes.fullscreen(passes.COPY, target, blend="ADDITIVE_PREMULT", textures={"original": image})
