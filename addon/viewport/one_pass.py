"""One render pass in place of the picture, as the menu Render Pass of a 3D view's shading asks.

A pass is made as a final render writes it (ui/passes.py), of the samples so far.
"""

from __future__ import annotations

from ..frame.picture import Frame
from ..gfx import images, passes
from ..gfx.library import Program
from ..ui.passes import RenderPass

ONE_PASS: Program = passes.fullscreen_program(
    "film one pass",
    "film/one_pass.frag.glsl",
    textures=(("RGBA32F", "source"), ("RGBA32F", "albedo")),
    constants=(("FLOAT", "scale"), ("FLOAT", "albedo_scale"), ("INT", "channel"), ("INT", "divided")),
    outputs=(("VEC4", "out_color"),),
)


def draw(frame: Frame, shown: RenderPass, target: images.Target) -> None:
    """Draw the pass into `target`; black where no technique of the plan brings such light."""
    name, *color = shown.images
    if name not in frame.images:
        target.clear((0.0, 0.0, 0.0, 1.0))
        return
    divided = bool(color) and color[0] in frame.images
    source = frame.held.to_show(name)
    exposure = frame.snapshot.film.exposure if name.startswith("radiance.") else 1.0
    passes.fullscreen(
        ONE_PASS,
        target,
        textures={"source": source, "albedo": frame.held.to_show(color[0]) if divided else source},
        constants={
            "scale": exposure * _scale(frame, name), "albedo_scale": _scale(frame, color[0]) if divided else 1.0,
            "channel": shown.first if len(shown.channels) == 1 else -1, "divided": int(divided),
        },
    )  # fmt: skip


def _scale(frame: Frame, name: str) -> float:
    """What an image's values are multiplied by for their mean over the samples."""
    return 1.0 / max(frame.samples_done, 1) if name in frame.held.sums else 1.0
