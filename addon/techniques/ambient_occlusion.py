"""Ambient Occlusion: the render pass of that name, which is the unoccluded share of the hemisphere at each surface.

    AO = mean over directions, by the cosine, of whether a ray meets nothing within the world's Distance

as Cycles defines it: the Distance of the world's Ambient Occlusion, 10 m as Blender has it. It is no light: the picture
does not have it. At each point of the film one ray through the hierarchy is cast where a surface is seen.

| cost | per point of the film |
|---|---|
| passes | 1, and 1 filter |
| rays per pixel | 1 |
| bytes per pixel | 16, and 16 while it is drawn |

Nothing is drawn, compiled or held where the view layer does not ask for the pass. Bias: none. Without a hierarchy
(above 4 million triangles) the pass is 1 where a surface is seen, with a warning.
"""

from __future__ import annotations

from ..film import filter as film_filter
from ..film.points import Openness
from ..frame.picture import Frame
from ..frame.technique import Technique, Write
from ..gfx import images, passes
from ..scene import acceleration
from ..scene.view import VIEW
from ..snapshot.scene import Note
from ..surfaces.draw import SURFACE_TEXTURES

OPEN = "film.open"
# Between the sequence numbers of a sample's film points: each point stratifies its directions over all samples.
APART = 1 << 16
CAST = passes.fullscreen_program(
    "ambient occlusion",
    "occlusion/open.frag.glsl",
    textures=(*acceleration.HIERARCHY_TEXTURES, *SURFACE_TEXTURES),
    blocks=((VIEW, "film_view"),),
    constants=(("FLOAT", "farthest"), ("FLOAT", "offset_size"), ("INT", "point_number")),
    outputs=(("VEC4", "out_open"),),
)


class AmbientOcclusion(Technique):
    name = "ambient_occlusion"
    label = "Ambient occlusion"
    provides = (Openness,)

    def skip(self, snapshot, settings):
        if not settings.schedule.has_passes:
            return "a viewport shows no passes"
        return None if snapshot.film.open_within is not None else "the view layer asks for no Ambient Occlusion"

    def begin(self, frame: Frame) -> None:
        self._points = (-1, 0)  # number of a sample, how many of its film points are drawn
        frame.held.add(Write(OPEN, "RGBA32F", "How open what is seen is to what lies around", True))
        if frame.hierarchy("shadow") is None:
            text = "it is 1 everywhere: the scene has more triangles than rays can be cast among."
            frame.ledger.notes = (*frame.ledger.notes, Note("Ambient Occlusion pass", text))
        frame.provide(Openness(self._draw))

    def _draw(self, frame: Frame, surfaces: dict, place: tuple[float, float], share: float) -> None:
        hierarchy, (sample, point) = frame.hierarchy("shadow"), self._points
        point = point if sample == frame.sample else 0
        self._points = frame.sample, point + 1
        with images.borrowed(*frame.size, "RGBA32F") as drawn:
            if hierarchy is None:
                drawn.clear((1.0, 1.0, 1.0, 1.0))
            else:
                passes.fullscreen(
                    CAST, drawn, textures={**surfaces, **hierarchy.textures}, blocks={"film_view": frame.view_block},
                    constants={
                        "farthest": frame.snapshot.film.open_within, "offset_size": frame.offset_size,
                        "point_number": point * APART + frame.sample,
                    },
                )  # fmt: skip
                frame.count(self, "rays", frame.size[0] * frame.size[1])
            frame.count(self, "passes", 1 + film_filter.add(frame, {OPEN: drawn.colors[0]}, place, share))
