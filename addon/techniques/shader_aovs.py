"""Shader AOVs and the UV pass: values of the surface that each pixel sees, as its node tree gives them.

What an AOV Output node computes is a function of the surface point beside the material's closures (compiler.py), and so
is the UV map that renders. At each point of the film the surfaces are drawn once more, with a program that calls these
functions alone, into an image for each colour and each four numbers; the film filter adds them to sums.

Layers count as in Cycles. A layer shows in full what it gives, whatever its opacity; what lies behind it follows where
the opacity is below the view layer's alpha threshold and this sample passes the layer. So the first surface from that
opacity on is found by the depth test, nothing behind the surface that the sample meets is drawn, and thinner layers
before both are added to it.

| cost | per point of the film |
|---|---|
| draws | those of the surface pass, for each six images; thin layers once more |
| passes | 1 filter for each six images |
| bytes per pixel | 16 for each image, and 16 + 4 while it is drawn |

Nothing is drawn, compiled or held where the view layer asks for none. Bias: none. Differs from Cycles where a mesh has
bump by displacement, whose normal AOVs do not see, and in AOV Output nodes of the world, which are not read.
"""

from __future__ import annotations

from contextlib import ExitStack

from ..film import aovs as film_aovs
from ..film import filter as film_filter
from ..film.points import PointStages
from ..frame.run import Frame
from ..frame.technique import Technique, Write
from ..gfx import images
from ..scene.materials import AOV_GROUP
from ..surfaces.draw import draw_aovs


class ShaderAovs(Technique):
    name = "shader_aovs"
    label = "Shader AOVs and UV"

    def skip(self, snapshot, settings):
        if not settings.whole:
            return "a viewport shows no passes"
        return None if snapshot.film.aovs else "the view layer asks for no AOV and no UV pass"

    def begin(self, frame: Frame) -> None:
        aovs = frame.snapshot.film.aovs
        self._images: dict[str, list] = {}  # by image of the frame, what its channels hold
        for aov, (image, _) in zip(aovs, film_aovs.places(aovs)):
            self._images.setdefault(image, []).append((aov.name, aov.kind))
        for image, held in self._images.items():
            frame.add_write(Write(image, "RGBA32F", f"AOVs: {', '.join(name or 'UV' for name, _ in held)}", True))
        frame.shared(PointStages).of[self.name] = self._draw

    def _draw(self, frame: Frame, surfaces: dict, place: tuple[float, float], share: float) -> None:
        names = list(self._images)
        for first in range(0, len(names), AOV_GROUP):
            group = names[first : first + AOV_GROUP]
            layout = tuple(tuple(self._images[name]) for name in group)
            with ExitStack() as stack:
                borrowed = [stack.enter_context(images.borrowed(*frame.size, "RGBA32F")) for _ in group]
                depth = stack.enter_context(images.borrowed(*frame.size, "DEPTH_COMPONENT32F")).colors[0]
                drawn = tuple(one.colors[0] for one in borrowed)
                draw_aovs(frame, self, images.Target(drawn, depth), layout, surfaces["surface_position"])
                frame.count(self, "passes", film_filter.add(frame, dict(zip(group, drawn)), place, share))
