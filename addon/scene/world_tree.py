"""A world's node tree on the GPU: compiled like a material, baked into a map that lights, shown exactly behind all.

Light needs directions drawn in proportion to radiance, so the tree is evaluated once per texel of an equirectangular
map, which is read back (sources/environment.py builds its tables from it). The map holds what light rays see; the
camera sees the tree itself, evaluated per pixel and sample (techniques/film.py), so that a Light Path node may show it
another background, and fine detail is not blurred.

As in Cycles, the point that the tree shades stands in the ray's direction, one unit from the origin, and its normal
points against the ray.

| cost | |
|---|---|
| bake | 0.5 million evaluations of the tree (2 million with a sky, up to 8 million with images), when it changes |
| background | one evaluation per pixel and point of the film |

Bias: light has the map's resolution, 0.35 degrees (0.18 with a sky) or that of the largest image up to 0.09. All
surfaces see the same world: Light Path tells the camera from light, not diffuse from glossy rays.
"""

from __future__ import annotations

import numpy as np

from ..gfx import images, passes
from ..gfx.library import Program
from ..gfx.struct import Block
from ..materials.compiled import CompiledMaterial
from ..materials.compiler import compile_material
from ..snapshot.scene import Image, Note, World
from .materials import MATERIAL_SCENE, values_block, values_struct
from .textures import upload_texture
from .view import VIEW, View

PLAIN, SKY, LARGEST = (1024, 512), (2048, 1024), (4096, 2048)
AXES = {
    "origin": (0, 0, 0, 0), "camera_position": (0, 0, 0, 0), "camera_right": (1, 0, 0, 0), "camera_up": (0, 0, 1, 0),
    "camera_backward": (0, -1, 0, 0), "window": (-1, -1, 2, 2),
}  # fmt: skip


class WorldTree:
    """The compiled tree of one World, with the images and values that it reads."""

    def __init__(self, world: World, named: dict[str, Image], energy_table: images.Image):
        self.compiled = compile_material("World", world.graph, named)
        self.notes = tuple(Note("World", text, node=node) for node, text in self.compiled.fallbacks)
        self.size = _size(world, named)
        self._scene = Block(MATERIAL_SCENE, **AXES)
        self._values = values_block(self.compiled)
        self._textures = {"energy_table": energy_table}
        for slot, key in enumerate(self.compiled.images):
            self._textures[f"material_image{slot}"] = upload_texture(named, key)

    def bake(self) -> np.ndarray:
        """Radiance that arrives from all directions, (H, W, 3) float64, equirectangular, bottom row first."""
        with images.borrowed(*self.size, "RGBA32F") as target:
            passes.fullscreen(
                bake_program(self.compiled),
                target,
                textures=self._textures,
                blocks={"material_values": self._values, "material_scene": self._scene},
            )
            return images.read(target.colors[0])[..., :3].astype(np.float64)

    def add_background(self, target: images.Target, view: View, view_block: Block, surfaces: dict) -> None:
        """Add what the camera sees where no surface is. `surfaces`: images by name."""
        camera, (left, right, bottom, top) = view.camera, view.camera.frame
        self._scene.update(
            **{
                **AXES,
                "camera_right": (*camera.matrix[:3, 0], 0.0),
                "camera_up": (*camera.matrix[:3, 1], 0.0),
                "camera_backward": (*camera.matrix[:3, 2], 0.0),
                "window": (left, bottom, right - left, top - bottom),
            }
        )
        passes.fullscreen(
            background_program(self.compiled),
            target,
            blend="ADDITIVE_PREMULT",
            textures={**self._textures, **{name: surfaces[name] for name in SEEN}},
            blocks={"material_values": self._values, "material_scene": self._scene, "film_view": view_block},
        )


SEEN = ("surface_position", "surface_emission")  # what the background pass reads of the surfaces


def bake_program(compiled: CompiledMaterial) -> Program:
    """Evaluates a world's tree for all directions."""
    return _program(compiled, "world bake", "world/bake.frag.glsl")


def background_program(compiled: CompiledMaterial) -> Program:
    """Evaluates a world's tree where the camera sees it."""
    return _program(compiled, "world background", "world/background.frag.glsl", SEEN, ((VIEW, "film_view"),))


def _program(
    compiled: CompiledMaterial,
    name: str,
    fragment: str,
    textures: tuple = (),
    blocks: tuple = (),
) -> Program:
    fill = "".join(
        f"  point.attributes[{k}] = vec4(point.position, 1.0);\n"
        for k, attribute in enumerate(compiled.attributes)
        if attribute.kind == "GENERATED"
    )
    head = "void fill_attributes(inout SurfacePoint point)"
    own = tuple(("FLOAT_2D", f"material_image{slot}") for slot in range(len(compiled.images)))
    return passes.fullscreen_program(
        f"{name} {compiled.program_key[:8]}",
        fragment,
        textures=(*(("RGBA32F", name) for name in (*textures, "energy_table")), *own),
        blocks=(*blocks, (values_struct(compiled), "material_values"), (MATERIAL_SCENE, "material_scene")),
        outputs=(("VEC4", "out_radiance"),),
        snippets=(("generated/material", f"{compiled.glsl}\n{head}\n{{\n{fill}}}\n"),),
    )


def _size(world: World, named: dict[str, Image]) -> tuple[int, int]:
    """Texels of the map: as fine as the largest image of the tree, within bounds."""
    shown = [named[node.image] for node in world.graph.nodes.values() if node.image in named]
    sky = any(node.type == "ShaderNodeTexSky" for node in world.graph.nodes.values())
    least = SKY if sky else PLAIN
    height = max([least[1], *(min(image.pixels.shape[0], LARGEST[1]) for image in shown)])
    return 2 * height, height
