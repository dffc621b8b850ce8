"""Shader AOVs, UV and Vector passes: values of the surface that each pixel sees, as its node tree gives them.

What an AOV Output node computes is a function of the surface point beside the material's closures (compiler.py), and so
is the UV map that renders. At each point of the film the surfaces are drawn once more, with a program that calls these
functions alone, into an image for each colour and each four numbers; the film filter adds them to sums.

Layers count as in Cycles. A layer shows in full what it gives, whatever its opacity; what lies behind it follows where
the opacity is below the view layer's alpha threshold and this sample passes the layer. So the first surface from that
opacity on is found by the depth test, nothing behind the surface that the sample meets is drawn, and thinner layers
before both are added to it, but not to UV and Vector, which are that surface's alone.

Vector is how far what is seen was a frame ago from where it is seen, and how far it is from there to where it will be,
in pixels: by the camera's motion, the object's, and that of the mesh's vertices, which each corner has as an attribute
(snapshot/motion.py, shaders/surface/motion.glsl). Behind all it is what the camera's turn and zoom
make of what is infinitely far away. With motion blur it is 0, as in Cycles.
Denoising Depth is the distance from where the camera's rays begin; albedo and normal of that data are sums of the film.

| cost | per point of the film |
|---|---|
| draws | those of the surface pass, for each six images; thin layers once more |
| passes | 1 filter for each six images |
| bytes per pixel | 16 for each image, and 16 + 4 while it is drawn |

Nothing is drawn, compiled or held where the view layer asks for none. Bias: none. Differs from Cycles where a mesh has
bump by displacement, whose normal AOVs do not see; in AOV Output nodes of the world, which are not read; and where an
orthographic camera's scale changes, which Vector has and Cycles' has not. Hair and points move with their objects.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace

import numpy as np

from ..film import aovs as film_aovs
from ..film import filter as film_filter
from ..film.points import SurfaceValues
from ..frame.picture import Frame
from ..frame.technique import Technique, Write
from ..gfx import images
from ..scene.materials import AOV_GROUP
from ..surfaces.draw import draw_aovs

MOVING, NOTHING = ("VECTOR", "HIT"), "NOTHING"  # kinds that ask how things move; what stays 0


class ShaderAovs(Technique):
    name = "shader_aovs"
    label = "Values of surfaces"
    provides = (SurfaceValues,)

    def skip(self, snapshot, settings):
        if not settings.schedule.has_passes:
            return "a viewport shows no passes"
        return None if snapshot.film.aovs else "the view layer asks for no AOV, no UV, Vector or denoising data"

    def begin(self, frame: Frame) -> None:
        aovs, motion = frame.snapshot.film.aovs, frame.snapshot.motion
        held: dict[str, list] = {}  # by image of the frame, what its channels hold
        for aov, (image, _) in zip(aovs, film_aovs.places(aovs)):
            nothing = motion is None and aov.kind in MOVING
            held.setdefault(image, []).append((aov.name, NOTHING if nothing else aov.kind))
        self._images = {image: kinds for image, kinds in held.items() if any(kind != NOTHING for _, kind in kinds)}
        for image, held in self._images.items():
            frame.held.add(Write(image, "RGBA32F", f"AOVs: {', '.join(name or 'UV' for name, _ in held)}", True))
        self._motion = images.upload_list(_motion_rows(frame)) if motion is not None else None
        frame.provide(SurfaceValues(self._draw))

    def _draw(self, frame: Frame, surfaces: dict, place: tuple[float, float], share: float) -> None:
        names = list(self._images)
        for first in range(0, len(names), AOV_GROUP):
            group = names[first : first + AOV_GROUP]
            layout = tuple(tuple(self._images[name]) for name in group)
            with ExitStack() as stack:
                borrowed = [stack.enter_context(images.borrowed(*frame.size, "RGBA32F")) for _ in group]
                depth = stack.enter_context(images.borrowed(*frame.size, "DEPTH_COMPONENT32F")).colors[0]
                drawn = tuple(one.colors[0] for one in borrowed)
                draw_aovs(frame, self, images.Target(drawn, depth), layout, surfaces["surface_position"], self._motion)
                frame.count(self, "passes", film_filter.add(frame, dict(zip(group, drawn)), place, share))

    def release(self) -> None:
        self._motion = None


def _motion_rows(frame: Frame) -> np.ndarray:
    """(N, 4) the motion table, see shaders/surface/motion.glsl."""
    view, motion, origin = frame.view, frame.snapshot.motion, frame.geometry.origin
    rows = []
    for camera in (view.camera, *motion.cameras):
        seen = replace(view, camera=camera).values(0, 0, (0.0, 0.0), frame.geometry.size)
        rows += [seen[f"row_{name}"] for name in "xyw"]
    shift, back = np.eye(4), np.eye(4)
    shift[:3, 3], back[:3, 3] = origin, -origin
    for instance in frame.geometry.placed[0]:
        inverse = np.linalg.pinv(instance.matrix[:3, :3])
        now = np.eye(4)
        now[:3, :3], now[:3, 3] = inverse, -inverse @ instance.matrix[:3, 3]
        for then in motion.matrices.get(instance.key, (instance.matrix, instance.matrix)):
            same = np.array_equal(then, instance.matrix)
            mapped = np.eye(4) if same else back @ then @ now @ shift
            rows += [*mapped[:3], *np.pad(then[:3, :3], ((0, 0), (0, 1)))]
    return np.asarray(rows, np.float64).astype(np.float32)
