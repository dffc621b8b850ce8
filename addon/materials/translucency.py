"""Painted translucency: three images of a material that change how light scatters below its surface (Shah 2007).

- **blur** says how far light spreads, in powers of two: 0.5 as the material's own radius says, 1 eight times as far, 0
  an eighth. Read where light leaves, as Cycles reads a radius.
- **tint** colours light where it enters: what is painted there lies below the skin, and its edges are as soft as the
  material's range.
- **translucency** says where light scatters at all: 0 is plain diffuse, which neither takes nor gives such light.

They join the material's graph as image nodes of a shader of their own, added to its surface, so that whatever evaluates
the material knows them, and images are watched and uploaded as those of any node.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .estimate import srgb_decode
from .graph import Graph, Input, Node

BLUR, TINT, TRANSLUCENCY = "blur_map", "tint_map", "translucency_map"
MAPS = (BLUR, TINT, TRANSLUCENCY)
OWNER = "image_space_subsurface"  # the technique whose parameters they are
NEUTRAL = {BLUR: (0.5, 0.5, 0.5), TINT: (1.0, 1.0, 1.0), TRANSLUCENCY: (1.0, 1.0, 1.0)}
SHADER = "CandelaTranslucency"
_IMAGE = {"projection": "FLAT", "interpolation": "Linear", "extension": "EXTEND"}
_SOCKETS = {BLUR: ("Blur", "FLOAT"), TINT: ("Tint", "COLOR"), TRANSLUCENCY: ("Translucency", "FLOAT")}


def names_of(own: tuple[tuple[str, object], ...]) -> dict[str, str]:
    """Names of the image data-blocks that a material's own settings give, by map."""
    given = dict(own)
    return {name: given[f"{OWNER}_{name}"] for name in MAPS if given.get(f"{OWNER}_{name}")}


def with_maps(graph: Graph, images: dict[str, str]) -> Graph:
    """The graph with these maps (Image.key by map) added to its surface; the same where there are none."""
    if not images or graph.surface is None:
        return graph
    nodes, inputs = dict(graph.nodes), {}
    for name in MAPS:
        socket, kind = _SOCKETS[name]
        value = NEUTRAL[name] if kind == "COLOR" else NEUTRAL[name][0]
        key = f"candela {name}"
        if name in images:
            outputs = {"Color": "COLOR", "Alpha": "FLOAT"}
            nodes[key] = Node(key, socket, "ShaderNodeTexImage", {}, outputs, dict(_IMAGE), images[name])
        inputs[socket] = Input(kind, value, (key, "Color") if name in images else None)
    nodes["candela maps"] = Node("candela maps", "Translucency", SHADER, inputs, {"BSDF": "SHADER"})
    both = {
        "Shader": Input("SHADER", link=graph.surface), "Shader_001": Input("SHADER", link=("candela maps", "BSDF")),
    }  # fmt: skip
    nodes["candela add"] = Node("candela add", "Translucency", "ShaderNodeAddShader", both, {"Shader": "SHADER"})
    return replace(graph, nodes=nodes, surface=("candela add", "Shader"))


def maps_of(graph: Graph) -> dict[str, str]:
    """Image.key by map, of a graph made by with_maps."""
    found = ((name, graph.nodes.get(f"candela {name}")) for name in MAPS)
    return {name: node.image for name, node in found if node is not None}


def sampled(image, uv: np.ndarray) -> np.ndarray:
    """(N, 3) scene-linear colours of a snapshot's Image at (N, 2) coordinates, bilinear, ends repeated; finite and not
    negative."""
    height, width = image.pixels.shape[:2]
    place = np.clip(np.nan_to_num(uv) * (width, height) - 0.5, 0.0, (width - 1, height - 1))
    low = np.floor(place).astype(int)
    high = np.minimum(low + 1, (width - 1, height - 1))
    x, y = (place - low).T[..., None]
    texel = image.pixels[..., :3]
    below = texel[low[:, 1], low[:, 0]] * (1 - x) + texel[low[:, 1], high[:, 0]] * x
    above = texel[high[:, 1], low[:, 0]] * (1 - x) + texel[high[:, 1], high[:, 0]] * x
    color = below * (1 - y) + above * y
    color = srgb_decode(color) if image.encoding == "SRGB" else color
    return np.maximum(np.nan_to_num(color, posinf=1.0, neginf=0.0), 0.0)
