"""Drawing what the camera sees: at once, or by the tiles of a panoramic camera (scene/panorama.py)."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from functools import cache

import numpy as np

from ..frame.picture import Frame
from ..gfx import images, passes
from ..gfx.library import Program
from ..gfx.struct import Block
from ..scene.panorama import ANSWERS
from ..scene.view import VIEW

Draw = Callable[[images.Target, Block, np.ndarray], None]


@cache
def from_tile(count: int) -> Program:
    """Of this many images."""
    return passes.fullscreen_program(
        "panorama from tile",
        "view/from_tile.frag.glsl",
        textures=tuple(("FLOAT_2D", f"tile_{k}") for k in range(count)),
        blocks=((VIEW, "film_view"),),
        constants=(
            *(("VEC3", f"tile_{name}") for name in ("right", "up", "backward", "eye")),
            ("VEC4", "tile_frame"), ("VEC4", "tile_bounds"), ("VEC2", "tile_shift"),
        ),
        defines=(("FROM_TILE", " ".join(f"out_{k} = tile_{k}_fetch(texel);" for k in range(count))),),
        snippets=ANSWERS,
        outputs=tuple(("VEC4", f"out_{k}") for k in range(count)),
    )  # fmt: skip


OUTSIDE = passes.fullscreen_program(
    "panorama outside of its lens",
    "view/outside.frag.glsl",
    blocks=((VIEW, "film_view"),),
    snippets=ANSWERS,
    outputs=(("VEC4", "out_emission"),),
)
FROM_TILES = tuple(from_tile(count) for count in (1, 2, 3, 6))


def draw_seen(frame: Frame, target: images.Target, draw: Draw, blend: str = "NONE") -> None:
    """Call `draw` with the target, and with the block of VIEW and the rows x, y, w, q by which the camera sees it. Of a
    panoramic camera it is called for each tile with images like the target's, a depth buffer among them, that are
    undefined before, and the target takes over what its pixels see, by `blend`, in place of what it held; its own depth
    stays."""
    if not frame.tiles:
        draw(target, frame.view_block, frame.view_rows)
        return
    if blend == "NONE":  # what a lens shows nothing by keeps nothing of the sample before
        images.Target(target.colors).clear()
    for tile in frame.tiles:
        size = tile.view.size
        with ExitStack() as stack:
            taken = [
                stack.enter_context(images.borrowed(*size, one.format)).colors[0] for one in target.colors
            ]  # fmt: skip
            depth = stack.enter_context(images.borrowed(*size, "DEPTH_COMPONENT32F"))
            draw(images.Target(tuple(taken), depth.colors[0]), tile.block, tile.drawn_rows)
            frame_of = tile.view.camera.frame
            passes.fullscreen(
                from_tile(len(taken)),
                images.Target(target.colors),
                blend=blend,
                rows=tile.rows,
                textures={f"tile_{k}": image for k, image in enumerate(taken)},
                blocks={"film_view": frame.view_block},
                constants={
                    "tile_right": tuple(tile.axes[0]), "tile_up": tuple(tile.axes[1]),
                    "tile_backward": tuple(tile.axes[2]), "tile_eye": tuple(tile.eye), "tile_frame": frame_of,
                    "tile_bounds": tile.bounds,
                    "tile_shift": tuple(float(tile.block.value(side)[3]) for side in ("right", "up")),
                },
            )  # fmt: skip


def clear_outside(frame: Frame, emission: images.Image) -> None:
    """Let nothing reach the eye where a panoramic camera's lens shows nothing."""
    if frame.tiles:
        passes.fullscreen(OUTSIDE, images.Target((emission,)), blocks={"film_view": frame.view_block})
