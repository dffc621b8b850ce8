"""Names of the render passes that are compared, and the metric of each.

One table holds, for every picture, Candela's name, Blender's two spellings (the render passes were renamed in 5.0)
and the view-layer switch that makes Blender produce it. Everything else in this package reads the table.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..frame.light_paths import DIRECT, INDIRECT, LIGHT_PATHS, SEEN


@dataclass(frozen=True)
class PassName:
    """`image` is Candela's name; `blender` is the name in files of Blender 5.0 and later, `before_5` in 4.x."""

    image: str
    blender: str
    before_5: str
    switch: str  # property of the view layer; "cycles.x" is property x of its Cycles settings


PASS_NAMES = (
    PassName("combined", "Combined", "Combined", "use_pass_combined"),
    PassName("depth", "Depth", "Depth", "use_pass_z"),
    PassName("normal", "Normal", "Normal", "use_pass_normal"),
    PassName("diffuse_color", "Diffuse Color", "DiffCol", "use_pass_diffuse_color"),
    PassName("glossy_color", "Glossy Color", "GlossCol", "use_pass_glossy_color"),
    PassName("transmission_color", "Transmission Color", "TransCol", "use_pass_transmission_color"),
    *(PassName(path.name, path.label, path.before_5, path.switch) for path in LIGHT_PATHS),
)
# Named where a view layer asks for them; no comparison switches them on.
OTHER_NAMES = (
    PassName("shadow_catcher", "Shadow Catcher", "Shadow Catcher", "cycles.use_pass_shadow_catcher"),
    PassName("ambient_occlusion", "Ambient Occlusion", "AO", "use_pass_ambient_occlusion"),
    PassName("mist", "Mist", "Mist", "use_pass_mist"),
    PassName("position", "Position", "Position", "use_pass_position"),
    PassName("uv", "UV", "UV", "use_pass_uv"),
    PassName("object_index", "Object Index", "IndexOB", "use_pass_object_index"),
    PassName("material_index", "Material Index", "IndexMA", "use_pass_material_index"),
)
IMAGE_OF_PASS = {name: row.image for row in PASS_NAMES + OTHER_NAMES for name in (row.blender, row.before_5)} | {
    "Glare": "glare"  # written where a camera sees with an eye, without a switch of the view layer
}


@dataclass(frozen=True)
class Row:
    """One line of the comparison: a light path as radiance, or one of Blender's own passes.

    `always` rows are shown even when both pictures are black; the others only when there is something to see.
    """

    label: str
    source: str  # "path": a name out of `light_paths`; "image": a name out of the render's images
    name: str
    always: bool = False
    what: str = ""


ALWAYS_SHOWN = ("diffuse_direct", "glossy_direct", "emission", "environment")
ROWS = (
    Row("Combined", "image", "combined", True, "the picture as it is rendered"),
    Row("Direct light", "path", "direct_light", True, "all direct paths, emission and world: a render without bounces"),
    *(
        Row(
            path.label.capitalize(), "path", path.name, path.name in ALWAYS_SHOWN, "light × colour" if path.lobe else ""
        )
        for order in (DIRECT, INDIRECT, "")
        for path in LIGHT_PATHS
        if (path.order if path.origin != SEEN else "") == order
    ),
    Row("Diffuse direct pass", "image", "diffuse_direct", True, "as in the file, divided by the colour"),
    Row("Glossy direct pass", "image", "glossy_direct", True, "as in the file, divided by the colour"),
    Row("Diffuse color", "image", "diffuse_color", True),
    Row("Glossy color", "image", "glossy_color", True),
    Row("Transmission color", "image", "transmission_color"),
    Row("Normal", "image", "normal", True),
    Row("Depth", "image", "depth", True),
)


@dataclass(frozen=True)
class Passes:
    """One render: pictures by Candela's names, linear, (H, W, C) float32, bottom row first, and how they came about.

    Light passes are as in Blender's files: diffuse, glossy and transmission light is divided by the colour pass.
    """

    images: dict[str, np.ndarray]
    engine: str
    samples: int
    seed: int
    seconds: float  # wall time of the render, without writing and reading the file
    film_transparent: bool = False
    notes: tuple[str, ...] = field(default=())
    layers: dict[str, np.ndarray] = field(default_factory=dict)  # everything in the file, by its name there

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        height, width = next(iter(self.images.values())).shape[:2]
        return width, height


@np.errstate(over="ignore", invalid="ignore")  # the metrics count what is not finite
def light_paths(images: dict[str, np.ndarray], film_transparent: bool = False) -> dict[str, np.ndarray]:
    """Radiance per light path, (H, W, 3): what each path adds to the picture, so that paths can be weighed together.

    `diffuse_direct` becomes light x colour; emission, environment and volume stand as they are. `direct_light` is the
    sum of all direct paths, emission and environment: the Combined picture of a render without any bounce. The
    environment pass is filled behind a transparent film too, where it is not part of the picture, and then left out
    of the sum.
    """
    paths: dict[str, np.ndarray] = {}
    for path in LIGHT_PATHS:
        if path.name not in images:
            continue
        if not path.lobe:
            paths[path.name] = images[path.name][..., :3]
        elif f"{path.lobe}_color" in images:
            paths[path.name] = images[path.name][..., :3] * images[f"{path.lobe}_color"][..., :3]
    direct = [
        paths[path.name]
        for path in LIGHT_PATHS
        if path.name in paths and path.order == DIRECT and path.name != "environment"
    ]
    if "environment" in paths and not film_transparent:
        direct.append(paths["environment"])
    if "diffuse_direct" in paths and "emission" in paths:
        paths["direct_light"] = np.sum(direct, axis=0, dtype=np.float32)
    return paths
