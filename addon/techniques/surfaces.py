"""Surfaces: what each pixel sees, as closures of the material there (the G-buffer).

Every material's graph runs once per visible pixel and leaves its closures in six images (`surface.*`); all lighting
reads them. Transparency is stochastic: a layer is drawn with the probability of its opacity, numbers stratified over
the samples per pixel and layer, so the mean over samples is exact alpha blending of any number of layers, at the
price of noise that falls like 1/n. Of several glossy lobes one is kept per sample (shaders/lib/closure.glsl).

The camera is shifted within the pixel filter (Blackman-Harris, importance-sampled), the same for all pixels.

On the first sample the picture is also reduced to boxes of 16x16-pixel tiles around what is seen: the receivers, to
which depth maps are fitted. With alpha materials both ends of the layers are drawn for it, opaque and left out.

| cost | per sample |
|---|---|
| draws | one per material (meshes shown once are joined) and one per instanced mesh and material |
| bytes written per pixel | 6 x 16 + 4 |
| first sample | + 1 or 2 surface passes and one reduction, read back at 1/256 of the pixels |

Fails: coloured transparency lets its mean colour through untinted; more layers than samples look dithered.
"""

from __future__ import annotations

import numpy as np

from ..frame.culling import Boxes, calls
from ..frame.depth_maps import Receivers
from ..frame.materials import SURFACE_IMAGES
from ..frame.run import Frame
from ..frame.technique import Technique, Write
from ..frame.view import VIEW
from ..gfx import images, passes

STOCHASTIC, OPAQUE, LEFT_OUT = 0, 1, 2
TILE = 16
DESCRIPTIONS = {  # the layout in full: shaders/lib/gbuffer.glsl
    "position": "Position relative to the render origin, m; whether something was hit, and held out",
    "normal": "Shading normal and the triangle's normal",
    "diffuse": "Diffuse albedo; roughness, anisotropy and tangent",
    "tint": "Glossy reflectance at normal incidence; weight of the lobe",
    "lobe": "Glossy normal, kind of Fresnel term, edge reflectance, index of refraction",
    "emission": "Emitted radiance towards the viewer; glossy roughness",
}
SURFACES = tuple(f"surface.{name}" for name in SURFACE_IMAGES)
SURFACE_TEXTURES = tuple(("FLOAT_2D", f"surface_{name}") for name in SURFACE_IMAGES)


def surface_bindings(frame: Frame) -> dict[str, images.Image]:
    """The surface images under the names that shaders/lib/gbuffer.glsl reads."""
    return {f"surface_{name}": frame.images[f"surface.{name}"] for name in SURFACE_IMAGES}


TILE_BOUNDS = passes.fullscreen_program(
    "tile bounds",
    "surface/tile_bounds.frag.glsl",
    textures=(("FLOAT_2D", "surface_position"),),
    blocks=((VIEW, "film_view"),),
    constants=(("INT", "tile"),),
    outputs=(("VEC4", "out_low"), ("VEC4", "out_high")),
)


class Surfaces(Technique):
    name = "surfaces"
    label = "Surfaces"
    writes = (
        *(Write(f"surface.{name}", "RGBA32F", text) for name, text in DESCRIPTIONS.items()),
        Write("surface.depth_buffer", "DEPTH_COMPONENT32F", "Depth buffer of the surface pass"),
    )

    def run(self, frame: Frame) -> None:
        if frame.sample == 0:
            modes = (OPAQUE, LEFT_OUT) if any(m.transparent for m in frame.materials.compiled) else (STOCHASTIC,)
            frame.receivers = self._receivers(frame, modes)
            if modes == (STOCHASTIC,):
                return  # what was drawn for the receivers is the first sample
        self._draw(frame, STOCHASTIC)

    def _draw(self, frame: Frame, mode: int) -> None:
        target = frame.target(*SURFACES, depth="surface.depth_buffer")
        target.clear((0.0, 0.0, 0.0, 0.0), 1.0)
        seen = np.flatnonzero(Boxes.of(frame.geometry.draws).seen(frame.view_rows))
        with passes.drawing(target):
            material = None
            for call in calls(frame.geometry.draws, seen):
                if call.draw.material != material:
                    material = call.draw.material
                    shader = passes.get(frame.materials.surface_program(material))
                    bindings = frame.materials.bindings(material, frame.geometry.instances)
                    bindings["blocks"]["film_view"] = frame.view_block
                    shader.bind(**bindings, constants={"first_instance": call.first, "transparent_mode": mode})
                shader.set_constant("first_instance", call.first)
                passes.draw(shader, call.draw.batch, call.count)
                frame.count(self, "triangles", call.triangles)
        frame.count(self, "passes")

    def _receivers(self, frame: Frame, modes: tuple[int, ...]) -> Receivers:
        width, height = frame.size
        tiles = -(-width // TILE), -(-height // TILE)
        low = np.full((tiles[1], tiles[0], 4), np.inf)
        high = np.full((tiles[1], tiles[0], 4), -np.inf)
        target = images.Target(tuple(images.pool.take(*tiles, "RGBA32F") for _ in range(2)))
        for mode in modes:
            self._draw(frame, mode)
            passes.fullscreen(
                TILE_BOUNDS,
                target,
                textures={"surface_position": frame.images["surface.position"]},
                blocks={"film_view": frame.view_block},
                constants={"tile": TILE},
            )
            low = np.minimum(low, images.read(target.colors[0]))
            high = np.maximum(high, images.read(target.colors[1]))
        for image in target.colors:
            images.pool.give(image)
        low, high = low.reshape(-1, 4).astype(np.float64), high.reshape(-1, 4).astype(np.float64)
        seen = (np.isfinite(low) & np.isfinite(high)).all(axis=1) & (low <= high).all(axis=1)
        seen &= low[:, 3] < 1e29
        order = np.argsort(low[seen, 3], kind="stable")
        low, high = low[seen][order], high[seen][order]
        return Receivers(low[:, :3], high[:, :3], low[:, 3])
