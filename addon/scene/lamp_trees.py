"""A lamp's node tree on the GPU: compiled like a material, asked for directions, places on the lamp and distances.

Cycles runs the tree each time that light leaves a lamp. What it reads there depends on the direction (the normal of a
point, spot or sun is the direction that light leaves by; an area lamp has its own), on the place on the lamp (areas and
balls) and on the length of the way (Light Falloff, Ray Length). So the tree is evaluated on the GPU along each of the
three, while the others stand still, and read back; sources/lamp_maps.py makes maps of factors of that.

| cost | once per lamp, when its tree, images, or what the tree reads of the lamp change |
|---|---|
| directions, places | side^2 evaluations, side 128, or up to 1024 with images |
| distances | 3 x DISTANCES evaluations, where the tree reads the length of the way |

Bias: rays are of no kind, and the depth is that after the first surface, as Cycles has it for light from lamps.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..gfx import images, passes
from ..gfx.library import Program
from ..gfx.struct import Block, Struct
from ..materials.compiled import CompiledMaterial
from ..materials.compiler import compile_material
from ..materials.graph import Graph
from ..materials.nodes.inputs import NO_PARAMETRIC, ONLY_TWO_RAYS
from ..snapshot.scene import Image, Light, Note
from .materials import MATERIAL_SCENE, values_block, values_struct
from .textures import upload_texture

LAMP = Struct(
    "Lamp",
    ("vec4", "rows[3]"),  # of the object's matrix, relative to the render origin
    ("vec4", "axis_x"),  # unit axes; w: radius of a ball
    ("vec4", "axis_y"),  # w: cotangent of the half angle (sun), half of it (spot)
    ("vec4", "axis_z"),
    ("vec4", "options"),  # what is asked, kind, side of the map, 2 sin of half the cone's half angle
    ("vec4", "direction"),  # reference, in the axes; w: logarithm of the first distance
    ("vec4", "place"),  # reference, 0..1; z: distance, m; w: step of its logarithm
    ("vec4", "half_u"),  # of an area; w: random number of the object
    ("vec4", "half_v"),  # w: pass index
    ("vec4", "color"),  # of the object
)
OCTAHEDRAL, CONE, PLACES, PATHS = 1, 2, 3, 4  # what is asked, as shaders/lamp/bake.frag.glsl numbers it
ROUND, SUN, AREA = range(3)
DISTANCES, NEAREST, FARTHEST = 256, 1e-4, 1e6  # m
STEP = np.log(FARTHEST / NEAREST) / (DISTANCES - 1)
PLAIN, PROFILE, PATTERN, LARGEST = 128, 256, 512, 1024  # sides of maps
DEPTHS = ("Ray Depth", "Diffuse Depth", "Glossy Depth", "Transparent Depth", "Transmission Depth", "Portal Depth")
ATTRIBUTES = {  # what a lamp gives for those of meshes
    "GENERATED": "vec4(object_from_world(point, point.position - object_place(point)), 1.0)",
    "UV": "vec4(point.instancer_uv, 0.0, 1.0)",
}


@dataclass(frozen=True)
class Asked:
    """What stays at its reference: a direction in the lamp's axes, a place on an area (0..1), a distance, m."""

    direction: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, -1.0]))
    place: tuple[float, float] = (0.5, 0.5)
    path: float = 1.0


class LampTree:
    """The compiled tree of one lamp."""

    def __init__(self, light: Light, named: dict[str, Image], energy_table: images.Image):
        self.compiled = compile_material(light.name, light.graph, named)
        # Rays to lamps are of no kind in Cycles, too; only how often light was reflected before is not known.
        known = {NO_PARAMETRIC} if _reads(light.graph, DEPTHS) else {NO_PARAMETRIC, ONLY_TWO_RAYS}
        said = [(node, text) for node, text in self.compiled.fallbacks if text not in known]
        self.notes = tuple(Note(f"Light '{light.name}'", text, node=node) for node, text in said)
        self.side = _side(light.graph, named)
        self.reads_path = reads_path(light.graph)
        self._values = values_block(self.compiled)
        self._textures = {"energy_table": energy_table}
        for slot, key in enumerate(self.compiled.images):
            self._textures[f"material_image{slot}"] = upload_texture(named, key)

    def bake(self, what: int, side: int, at: Asked, lamp: dict, edge: float, scene: Block) -> np.ndarray:
        """Radiance factors, (side + 2, side + 2, 3) with a border of one texel, or, of PATHS, (DISTANCES, 3).

        `lamp`: the fields of LAMP that belong to the lamp; `edge`: 2 sin of half the cone's half angle.
        """
        size = (DISTANCES, 1) if what == PATHS else (side + 2, side + 2)
        kind = lamp["kind"]
        values = {name: value for name, value in lamp.items() if name != "kind"}
        block = Block(
            LAMP, options=(what, kind, side, edge), direction=(*at.direction, np.log(NEAREST)),
            place=(*at.place, at.path, STEP), **values,
        )  # fmt: skip
        with images.borrowed(*size, "RGBA32F") as target:
            passes.fullscreen(
                bake_program(self.compiled),
                target,
                textures=self._textures,
                blocks={"material_values": self._values, "material_scene": scene, "lamp": block},
            )
            found = images.read(target.colors[0])[..., :3].astype(np.float64)
        found = np.nan_to_num(found, nan=0.0, posinf=1e30, neginf=-1e30)
        return found[0] if what == PATHS else found


def bake_program(compiled: CompiledMaterial) -> Program:
    """Evaluates a lamp's tree."""
    fill = "".join(
        f"  point.attributes[{k}] = {ATTRIBUTES[attribute.kind]};\n"
        for k, attribute in enumerate(compiled.attributes)
        if attribute.kind in ATTRIBUTES
    )
    head = "void fill_attributes(inout SurfacePoint point)"
    own = tuple(("FLOAT_2D", f"material_image{slot}") for slot in range(len(compiled.images)))
    return passes.fullscreen_program(
        f"lamp {compiled.program_key[:8]}",
        "lamp/bake.frag.glsl",
        textures=(("RGBA32F", "energy_table"), *own),
        blocks=((values_struct(compiled), "material_values"), (MATERIAL_SCENE, "material_scene"), (LAMP, "lamp")),
        outputs=(("VEC4", "out_radiance"),),
        snippets=(("generated/material", f"{compiled.glsl}\n{head}\n{{\n{fill}}}\n"),),
    )


def reads_path(graph: Graph) -> bool:
    """Whether a tree asks how far the lamp's light goes."""
    types = {node.type for node in graph.nodes.values()}
    return "ShaderNodeLightFalloff" in types or _reads(graph, ("Ray Length",))


def _reads(graph: Graph, outputs: tuple[str, ...]) -> bool:
    """Whether some of these outputs of Light Path nodes are read."""
    read = {socket.link for node in graph.nodes.values() for socket in node.inputs.values()}
    paths = [node.key for node in graph.nodes.values() if node.type == "ShaderNodeLightPath"]
    return any((key, output) in read for key in paths for output in outputs)


def _side(graph: Graph, named: dict[str, Image]) -> int:
    """Texels along the side of the maps: as fine as the largest image, within bounds."""
    types = {node.type for node in graph.nodes.values()}
    side = PROFILE if "ShaderNodeTexIES" in types else PLAIN
    if any(
        kind.startswith("ShaderNodeTex") and kind not in ("ShaderNodeTexIES", "ShaderNodeTexCoord") for kind in types
    ):
        side = PATTERN
    shown = [
        named[node.image] for node in graph.nodes.values() if node.image in named and node.type != "ShaderNodeTexIES"
    ]
    return max([side, *(min(max(image.pixels.shape[:2]), LARGEST) for image in shown)])
